/* Classes of values follow the transfer function: outliers, wide ranges, steps and integrators of isogi_dvr.h. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

enum { SIDE = 32, COUNT = 9 };

/* |x| from the middle of the box, and one voxel in a corner that is something else. */
static field radius_field(int n, double outlier) {
    field f = field_new(n, n, n);
    for (size_t i = 0; i < field_count(&f); i++) {
        double x = (double)(i % (size_t)n) - n / 2, y = (double)(i / (size_t)n % (size_t)n) - n / 2,
               z = (double)(i / (size_t)n / (size_t)n) - n / 2;
        f.value[i] = sqrt(x * x + y * y + z * z);
    }
    if (outlier > 0) f.value[0] = outlier;
    field_build(&f);
    return f;
}

static const isogi_view view_49 = {.width = SIDE, .height = SIDE, .eye = {90, 70, 100}, .target = {24, 24, 24}, .fov = 35};
static const isogi_transfer_point shell[] = {
    {0, {1, 0.5f, 0.2f}, 0}, {12, {0.2f, 0.5f, 1}, 0}, {13.5, {1, 1, 1}, 0.4f}, {15, {1, 1, 1}, 0}};

static double opacity_difference(float (*a)[4], float (*b)[4], int count) {
    double worst = 0;
    for (int i = 0; i < count; i++) worst = fmax(worst, fabs((double)a[i][3] - (double)b[i][3]));
    return worst;
}

/* A shell of a sphere, and one voxel outside of it that takes nearly all of the range of values: neither shadows nor histograms see it. */
TEST(an_outlier_takes_no_shadow_from_any_method) {
    const double outlier[] = {40, 400, 4e3, 1e30};
    const isogi_transfer transfer = {shell, 4, NULL, 0};
    for (int k = 0; k < 4; k++) {
        field f = radius_field(49, outlier[k]);
        float v[4][COUNT];
        const float middle[3] = {24, 24, 24};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                .directions = 32, .grid = {7, 7, 7}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &middle, 1, v[method]) == ISOGI_OK, "step");
            /* behind the shell, of depth 0.6; the two other methods see it a little blurred */
            CHECK(fabs((double)v[method][0] - 1.94) < 0.15, "outlier %g, method %d: %g", outlier[k], method, (double)v[method][0]);
            CHECK(fabs((double)v[method][0] / (double)v[ISOGI_DVR_BRUTE][0] - 1) < 0.1, "outlier %g, method %d: %g of %g", outlier[k],
                  method, (double)v[method][0], (double)v[ISOGI_DVR_BRUTE][0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

/* The same, where the transfer function goes from end to end of the range: a tent as wide as a thousandth of it. */
TEST(narrow_tents_in_a_wide_range_cast_shadows) {
    float v[2][4][COUNT];
    for (int wide = 0; wide < 2; wide++) {
        field f = radius_field(49, wide ? 4000 : 0);
        const isogi_transfer_point p[] = {
            {0, {1, 1, 1}, 0}, {14, {1, 1, 1}, 0}, {16, {1, 1, 1}, 0.3f}, {18, {1, 1, 1}, 0}, {4000, {1, 1, 1}, 0.001f}};
        const isogi_transfer transfer = {p, wide ? 5 : 4, NULL, 0};
        const float middle[3] = {24, 24, 24};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                .directions = 32, .grid = {7, 7, 7},
                                         .visibility_step = 0.5};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            float *at = v[wide][method];
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &middle, 1, at) == ISOGI_OK, "step");
            if (method != ISOGI_DVR_PAPER)
                CHECK(fabs((double)at[0] / (sqrt(4 * PI) * exp(-0.6)) - 1) < 0.02, "method %d: %g", method, (double)at[0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
    /* local rays take steps of a voxel between nodes: what they blur of a tent, they blur in either range */
    CHECK(fabs((double)v[1][ISOGI_DVR_PAPER][0] / (double)v[0][ISOGI_DVR_PAPER][0] - 1) < 0.04,
          "the paper's method: %g, and %g in a wide range", (double)v[0][ISOGI_DVR_PAPER][0], (double)v[1][ISOGI_DVR_PAPER][0]);
}

/* Outliers leave the suggested points where they were. */
TEST(suggestions_leave_out_outliers) {
    const double outlier[] = {0, 400, 1e5, 1e30};
    double first = 0;
    for (int k = 0; k < 4; k++) {
        field f = radius_field(49, outlier[k]);
        isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
        double threshold;
        CHECK(isogi_transfer_suggest(f.pyramid, ISOGI_DVR_PHYSICAL, p, &threshold) == ISOGI_OK, "suggest");
        if (!k) first = threshold;
        CHECK(fabs(threshold - first) < 1 && p[5].value < 84, "outlier %g: threshold %g, not %g; last point %g", outlier[k], threshold,
              first, p[5].value);
        field_free(&f);
    }
}

/* Pictures of the shell, against small steps in double. */
TEST(an_outlier_takes_no_class_from_a_picture) {
    const double outlier[] = {40, 400, 4e3, 1e5, 1e30, -1e30};
    const isogi_transfer transfer = {shell, 4, NULL, 0};
    static float image[2][SIDE * SIDE][4];
    for (int k = 0; k < 6; k++) {
        field f = radius_field(49, fabs(outlier[k]));
        if (outlier[k] < 0) isogi_vol_free(f.pyramid), f.value[0] = outlier[k], field_build(&f);
        for (int fine = 1; fine >= 0; fine--)
            for (int path = 1; path <= (fine ? 1 : 4); path += 3) { /* plain and best */
                const isogi_context context = {.threads = 1, .force_path = path == 1 ? 1 : 0};
                const isogi_dvr_desc desc = {
                    .pyramid = f.pyramid, .step = fine ? 0.05 : 0, .classification = fine ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
                isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
                CHECK(isogi_dvr_render(dvr, &view_49, NULL, image[fine], NULL, NULL) == ISOGI_OK, "render");
                isogi_dvr_free(dvr);
                if (!fine) CHECK(opacity_difference(image[0], image[1], SIDE * SIDE) < 0.012, "outlier %g: opacity errs by %g", outlier[k],
                                opacity_difference(image[0], image[1], SIDE * SIDE));
            }
        field_free(&f);
    }
}

/* Pre-integrated tables of data space stand where the transfer function changes, however far outliers and its last points lie. */
TEST(an_outlier_takes_no_entry_from_a_table_of_pairs) {
    static const struct { double outlier; int far; } cases[] = {{0, 0}, {4e3, 0}, {1e30, 1}, {-1e30, 0}};
    static float image[2][SIDE * SIDE][4];
    const isogi_transfer_point narrow[] = {
        {0, {1, 0.5f, 0.2f}, 0}, {12, {0.2f, 0.5f, 1}, 0}, {13.5, {1, 1, 1}, 0.4f}, {15, {1, 1, 1}, 0}, {1e30, {1, 1, 1}, 1e-34f}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++)
        for (int silhouette = 0; silhouette < 2; silhouette++) {
            field f = radius_field(49, fabs(cases[k].outlier));
            const isogi_transfer transfer = {narrow, cases[k].far ? 5 : 4, NULL, 0};
            if (cases[k].outlier < 0) isogi_vol_free(f.pyramid), f.value[0] = cases[k].outlier, field_build(&f);
            for (int exact = 0; exact < 2; exact++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .step = 0.25, .classification = exact
                    ? ISOGI_DVR_EXACT : ISOGI_DVR_PRE_INTEGRATED,
                                             .silhouette = silhouette ? ISOGI_DVR_SILHOUETTE_EXACT : ISOGI_DVR_SILHOUETTE_NONE};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                CHECK(isogi_dvr_render(dvr, &view_49, NULL, image[exact], NULL, NULL) == ISOGI_OK, "render");
                isogi_dvr_free(dvr);
            }
            float worst = 0;
            for (int i = 0; i < SIDE * SIDE; i++)
                for (int a = 0; a < 4; a++) worst = fmaxf(worst, fabsf(image[0][i][a] - image[1][i][a]));
            CHECK(worst < (silhouette ? 0.015f : 0.006f), "outlier %g, silhouette %d, far %d: pixels err by %g", cases[k].outlier,
                  silhouette, cases[k].far, (double)worst);
            field_free(&f);
        }
}

/* Shells down to a third of a voxel thick: pre-integrated pictures come nearer to what small steps see with every smaller step, down to a
   thousandth: by its square, or, where a tangent's turn lies within one step, in proportion to it. */
TEST(pictures_of_thin_shells_converge_with_the_step) {
    enum { W = 48 };
    static float image[2][W * W][4];
    const isogi_view view = {.width = W, .height = W, .eye = {120, 90, 130}, .target = {32, 32, 32}, .fov = 35};
    const double half[] = {0.15, 0.5, 1.5}, peak[] = {4, 1.2, 0.4}, step[] = {1, 0.5, 0.25, 0.1};
    field f = radius_field(65, 0);
    for (int w = 0; w < 3; w++) {
        const isogi_transfer_point p[] = {
            {0, {1, 0.5f, 0.2f}, 0}, {20, {0.2f, 0.5f, 1}, 0}, {20 + half[w], {1, 1, 1}, (float)peak[w]}, {20 + 2 * half[w], {1, 1, 1}, 0}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        double error[4];
        for (int n = -1; n < 4; n++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .step = n < 0 ? 0.01 : step[n], .classification = n < 0
                ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_render(dvr, &view, NULL, image[n >= 0], NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr);
            if (n >= 0) error[n] = opacity_difference(image[0], image[1], W * W);
        }
        printf("    tent of %g voxels: largest error of opacity %.4f %.4f %.4f %.5f for steps of 1, 1/2, 1/4, 1/10 voxel\n", 2 * half[w],
               error[0], error[1], error[2], error[3]);
        CHECK(error[0] < 0.015 && error[1] < 0.6 * error[0] && error[2] < (w ? 0.12 : 0.35) * error[0] && error[3] < 1e-3, "width %g",
              2 * half[w]);
    }
    field_free(&f);
}

/* Asking for depth, a peak that no value reaches or no limit of opacity: the integrator stays. */
TEST(the_integrator_does_not_depend_on_what_else_is_asked_for) {
    const isogi_transfer_point p[] = {{0, {1, 0.5f, 0.2f}, 0.3f}, {10, {1, 0.5f, 0.2f}, 0.3f}, {10.5, {0.2f, 0.5f, 1}, 0},
                                      {18, {0.2f, 0.5f, 1}, 0},   {18.3, {1, 1, 1}, 1.5f},     {18.6, {1, 1, 1}, 0}};
    const isogi_peak far_off = {500, {1, 1, 1}, 0.1f};
    const isogi_light sun = {.vector = {1, 2, 1}, .rgb = {3, 3, 3}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    static float image[4][SIDE * SIDE][4], depth[SIDE * SIDE];
    field f = radius_field(49, 0);
    for (int lit = 0; lit < 2; lit++) {
        for (int n = 0; n < 4; n++) {
            const isogi_transfer transfer = {p, 6, &far_off, n == 2};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = lit ? ISOGI_DVR_VISIBILITY
                : ISOGI_DVR_UNLIT, .method = ISOGI_DVR_BRUTE, .directions = 16, .grid = {5, 5, 5},
                                         .opaque = n == 3 ? 1 : 0};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_render(dvr, &view_49, &lighting, image[n], n == 1 ? depth : NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr);
        }
        CHECK(!memcmp(image[0], image[1], sizeof image[0]), "depth changes the picture");
        CHECK(!memcmp(image[0], image[2], sizeof image[0]), "a peak that no value reaches changes the picture");
        CHECK(opacity_difference(image[0], image[3], SIDE * SIDE) < 1.001e-3, "beyond what is left at 0.999: %g",
              opacity_difference(image[0], image[3], SIDE * SIDE));
        for (int i = 0; i < SIDE * SIDE; i++)
            CHECK((depth[i] < 1e30f) == (image[0][i][3] > 0) && depth[i] > 50, "pixel %d: opacity %g, depth %g", i, (double)image[0][i][3],
                  (double)depth[i]);
    }
    field_free(&f);
}

/* Uniform matter: local rays are exp(-extinction radius) wherever they stay within. */
TEST(local_visibility_of_uniform_matter_is_that_of_its_radius) {
    field f = radius_field(97, 0);
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.02f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const float places[2][3] = {{48, 48, 48}, {50, 43, 40}};
    for (double radius = 4; radius <= 32; radius *= 2) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 32,
            .radius = radius, .order = 2, .grid = {2, 2, 2}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float values[2], v[2][4];
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_blocks(dvr, places, 2, values, v[0]) == ISOGI_OK, "step");
        for (int i = 0; i < 2; i++) {
            CHECK(fabs((double)v[i][0] / (sqrt(4 * PI) * exp(-0.02 * radius)) - 1) < 1e-3, "radius %g: %g", radius,
                  (double)v[i][0]); /* half floats */
            for (int c = 1; c < 4; c++) CHECK(fabs((double)v[i][c]) < 2e-3, "radius %g: coefficient %d is %g", radius, c, (double)v[i][c]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Global and local visibility are both held: changing between them computes nothing. Where there is none it is refused. */
TEST(local_shading_is_the_papers_alone) {
    field f = radius_field(49, 0);
    const isogi_peak peak = {20, {1, 1, 1}, 0.5f};
    const isogi_transfer transfer = {shell, 4, NULL, 0}, peaks = {shell, 4, &peak, 1};
    const isogi_light sun = {.vector = {1, 2, 1}, .rgb = {30, 30, 30}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    static float image[3][SIDE * SIDE][4];
    for (int method = ISOGI_DVR_METHOD_DEFAULT; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .directions = 16, .grid = {5, 5, 5}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_view view = view_49;
        isogi_counters count = {0}, again = {0};
        isogi_dvr_report report;
        double difference = 0;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        isogi_dvr_counters(dvr, &count);
        for (int n = 0; n < 3; n++) {
            view.local = n == 1;
            isogi_result result = isogi_dvr_render(dvr, &view, &lighting, image[n], NULL, NULL);
            CHECK(result == (n == 1 && method != ISOGI_DVR_PAPER ? ISOGI_INVALID : ISOGI_OK), "method %d: %s", method,
                  isogi_result_string(result));
        }
        isogi_dvr_counters(dvr, &again);
        CHECK(!memcmp(&count, &again, sizeof count) && !memcmp(image[0], image[2], sizeof image[0]), "method %d: computed anew", method);
        for (int i = 0; i < SIDE * SIDE; i++) difference = fmax(difference, fabs((double)image[0][i][0] - (double)image[1][i][0]));
        if (method == ISOGI_DVR_PAPER) CHECK(difference > 0.01, "local and global light differ by %g", difference);
        for (int local = -77; local <= 2; local += 79) {
            view.local = local;
            CHECK(isogi_dvr_render(dvr, &view, &lighting, image[0], NULL, NULL) == ISOGI_INVALID, "local = %d", local);
        }
        CHECK(isogi_dvr_inspect(dvr, &report) == ISOGI_OK && (method == ISOGI_DVR_PAPER) == (report.level != NULL), "levels");
        if (method == ISOGI_DVR_PAPER) {
            size_t blocks = report.block_count[0] * report.block_count[1] * report.block_count[2];
            CHECK(report.global_bytes == 125 * 9 * sizeof(float) && report.local_bytes % (9 * 2) == 0 && report.local_bytes > 0,
                  "coefficients");
            CHECK(report.data_bytes >= report.points * sizeof(float) && report.index_bytes >= blocks && report.index_bytes < 100 * blocks,
                  "data, index");
            CHECK(isogi_dvr_set_transfer(dvr, &peaks) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK && !report.level &&
                      !report.data_bytes,
                  "peaks: brute force has no levels");
            view.local = 1;
            CHECK(isogi_dvr_render(dvr, &view, &lighting, image[0], NULL, NULL) == ISOGI_INVALID, "peaks: no local visibility");
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Exact rays take no steps: no ray is too long for them. */
TEST(exact_rays_know_no_longest_ray) {
    field f = radius_field(9, 0);
    isogi_vol_free(f.pyramid);
    f.volume.spacing[0] = f.volume.spacing[1] = 1, f.volume.spacing[2] = 1e7;
    field_build(&f);
    const isogi_transfer_point p[] = {{1, {1, 1, 1}, 0.2f}, {4, {1, 1, 1}, 0.4f}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    for (int n = 0; n < 3; n++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid,
                                     .space = n == 2 ? ISOGI_DVR_PHYSICAL : ISOGI_DVR_DATA,
                                     .classification = n ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
        const double eye[3] = {4, 4, -1e7}, target[3] = {4, 4, 4e7};
        isogi_dvr *dvr = NULL;
        isogi_result result = isogi_dvr_create(&dvr, &desc, &serial);
        CHECK(result == (n ? ISOGI_TOO_LARGE : ISOGI_OK), "%d: %s", n, isogi_result_string(result));
        if (n || !dvr) continue;
        CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "transfer function");
        /* 4 down to 0 and up again; 0.2 below 1 */
        pixel q = cast(dvr, eye, target, NULL);
        CHECK(fabs((double)q.c[3] + expm1(-2 * (0.2 + 0.9))) < 1e-6, "opacity %g", (double)q.c[3]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* A point dragged bit by bit narrows the function a little at a time: what is seen in the end is what a renderer sees
   that knew no other. */
SLOW_TEST(many_small_edits_end_like_one) {
    field f = radius_field(49, 1e5);
    const float middle[3] = {24, 24, 24};
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .directions = 32, .grid = {7, 7, 7}};
        float v[2][COUNT];
        for (int fresh = 0; fresh < 2; fresh++) {
            isogi_dvr *dvr = NULL;
            for (double end = fresh ? 99 : 1e5;; end = fmax(0.55 * end, 99)) {
                const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {14, {1, 1, 1}, 0}, {15, {1, 1, 1}, 0.6f}, {16, {1, 1, 1}, 0},
                                                  {end - 1, {1, 1, 1}, 0}, {end, {1, 1, 1}, 0.5f}, {end + 1, {1, 1, 1}, 0.5f}};
                const isogi_transfer transfer = {p, 7, NULL, 0};
                if (!dvr) dvr = dvr_new(&desc, &transfer);
                CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "end at %g", end);
                if (end <= 99) break;
            }
            CHECK(isogi_dvr_sample_visibility(dvr, &middle, 1, v[fresh]) == ISOGI_OK, "sample");
            isogi_dvr_free(dvr);
        }
        CHECK(fabs((double)v[0][0] - (double)v[1][0]) < 0.002, "method %d: %g bit by bit, %g at once", method, (double)v[0][0],
              (double)v[1][0]);
    }
    field_free(&f);
}

/* Units and extinctions at the ends of what floats hold: opaque where there is matter, in its colour, and never no number. */
TEST(lengths_and_extinctions_without_measure_are_opaque) {
    static const struct { double unit; float extinction; } extreme[] = {{1e-45, 1}, {1e-40, 1e-3f}, {1e-12, 1e38f}, {1, 1e38f}};
    field f = field_new(8, 8, 8);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(i % 8);
    for (int k = 0; k < 8; k++)
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const float e = extreme[k / 2].extinction;
            const isogi_transfer_point step[] = {{0, {1, 1, 1}, 0}, {3.5, {1, 1, 1}, 0}, {3.5, {1, 0.5f, 1}, e}, {7, {1, 0.5f, 1}, e}},
                                       ramp[] = {{0, {1, 0.5f, 1}, 0}, {7, {1, 0.5f, 1}, e}};
            const isogi_transfer transfer = {k & 1 ? step : ramp, k & 1 ? 4 : 2, NULL, 0};
            const isogi_view view = {.width = 8, .height = 8, .fov = 30, .eye = {20, 18, 22}, .target = {3.5f, 3.5f, 3.5f}};
            isogi_dvr *dvr = NULL;
            float image[64][4];
            field_build_with(&f, &context);
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_UNLIT, .unit = extreme[k / 2].unit};
            CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
            CHECK(isogi_dvr_render(dvr, &view, NULL, image, NULL, NULL) == ISOGI_OK, "render");
            for (int i = 0; i < 64; i++)
                for (int a = 0; a < 4; a++) CHECK(test_finite((double)image[i][a]), "case %d, path %d: pixel %d is no number", k, path, i);
            CHECK(fabs((double)image[27][3] - 1) < 1e-6 && fabs((double)image[27][0] - 1) < 1e-3 && fabs((double)image[27][1] - 0.5) < 1e-2,
                  "case %d, path %d: %g %g, opacity %g", k, path, (double)image[27][0], (double)image[27][1], (double)image[27][3]);
            isogi_dvr_free(dvr);
            isogi_vol_free(f.pyramid), f.pyramid = NULL;
        }
    field_free(&f);
}

/* A ray along the faces of the box, beside it, hits nothing: none of its planes is in the way. */
TEST(rays_beside_the_box_along_its_faces_are_transparent) {
    enum { WIDTH = 17 };
    static const isogi_transfer_point points[] = {{0, {1, 1, 1}, 5}, {1, {1, 1, 1}, 5}};
    static const isogi_transfer transfer = {.points = points, .point_count = 2};
    static const float data[16][16][16]; /* zeros */
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {16, 16, 16}};
    for (int path = 1; path <= 4; path++)
        for (int beside = 0; beside < 2; beside++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const float x = beside ? -5 : 3;
            const isogi_view view = {.width = WIDTH, .height = WIDTH, .fov = 40, .eye = {x, 7, 40}, .target = {x, 7, 0}};
            isogi_pyramid *pyramid = NULL;
            isogi_dvr *dvr = NULL;
            float image[WIDTH * WIDTH][4];
            CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_UNLIT};
            CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
            CHECK(isogi_dvr_render(dvr, &view, NULL, image, NULL, NULL) == ISOGI_OK, "render");
            CHECK(image[WIDTH * 8 + 13][3] > 0.99f, "path %d: opacity %g of the box", path, (double)image[WIDTH * 8 + 13][3]);
            for (int y = 0; y < WIDTH; y++)
                CHECK(beside ? !(image[WIDTH * y + 8][3] > 0) : y != 8 || image[WIDTH * y + 8][3] > 0.99f, "path %d, row %d: opacity %g",
                      path, y, (double)image[WIDTH * y + 8][3]);
            isogi_dvr_free(dvr);
            isogi_vol_free(pyramid);
        }
}

/* Frames of physical space are those of plain code on every path, whatever type voxels have, up to the last voxel of the data. */
TEST(frames_of_all_types_agree_on_all_paths) {
    enum { WIDTH = 24, HEIGHT = 18 };
    static float image[2][WIDTH * HEIGHT][4], depth[2][WIDTH * HEIGHT];
    static const size_t sizes[3][3] = {{37, 19, 22}, {9, 40, 5}, {3, 2, 4}};
    static const isogi_type types[4] = {ISOGI_F32, ISOGI_U8, ISOGI_U16, ISOGI_I16};
    const isogi_transfer_point points[] = {
        {0, {.2f, .4f, 1}, 0}, {0.3, {.2f, .4f, 1}, 0}, {0.6, {1, .8f, .2f}, .2f}, {1, {1, .2f, .1f}, .5f}};
    const isogi_transfer transfer = {.points = points, .point_count = 4};
    const double plane[4] = {0.3, -0.2, 1, -2};
    double most = 0, farthest = 0;
    for (int n = 0; n < 24; n++) {
        const isogi_type type = types[n / 3 % 4];
        const size_t *size = sizes[n % 3], count = size[0] * size[1] * size[2], bytes = type == ISOGI_F32 ? 4 : type == ISOGI_U8 ? 1 : 2;
        const double top = type == ISOGI_F32 ? 1 : type == ISOGI_U8 ? 255 : type == ISOGI_U16 ? 65535 : 32767;
        float seen = 0;
        char *data = (char *)malloc(count * bytes); /* to the byte: a vector that reads beyond is seen by the sanitizer */
        for (size_t i = 0; i < count; i++) {
            size_t x = i % size[0], y = i / size[0] % size[1], z = i / size[0] / size[1];
            double value = 0.5 + 0.45 * sin(0.41 * (double)x) * cos(0.37 * (double)y + 0.1) * cos(0.3 * (double)z + (n > 11));
            if (bytes == 4) memcpy(data + 4 * i, &(float){(float)value}, 4);
            else if (bytes == 1) data[i] = (char)(uint8_t)(top * value);
            else memcpy(data + 2 * i, &(uint16_t){(uint16_t)(top * value)}, 2);
        }
        const isogi_volume volume = {
            .data = data, .type = type, .size = {size[0], size[1], size[2]}, .spacing = {1, 1.25, 0.75}, .scale = 1 / top};
        const isogi_view view = {.width = WIDTH, .height = HEIGHT, .eye = {n > 11 ? 20.f : 70, 40, 60},
                                 .target = {0.5f * (float)size[0], 0.5f * (float)size[1], 0.4f * (float)size[2]},
                                 .fov = n % 3 == 2 ? 5 : n > 11 ? 60 : 30};
        for (int path = 1; path <= 4; path++) { /* sums of some tens of floats differ by a few roundings */
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_dvr_desc desc = {.shading = ISOGI_DVR_UNLIT};
            isogi_pyramid *pyramid = NULL;
            isogi_dvr *dvr = NULL;
            isogi_counters work = {0};
            int to = path > 1;
            CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
            desc.pyramid = pyramid;
            CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
            if (n % 2) CHECK(isogi_dvr_set_clip(dvr, &plane, 1) == ISOGI_OK, "clip");
            CHECK(isogi_dvr_render(dvr, &view, NULL, image[to], depth[to], &work) == ISOGI_OK, "render");
            isogi_dvr_free(dvr), isogi_vol_free(pyramid);
            for (int i = 0; to && i < WIDTH * HEIGHT; i++) {
                for (int a = 0; a < 4; a++) most = fmax(most, fabs((double)image[0][i][a] - (double)image[1][i][a]));
                seen = fmaxf(seen, image[0][i][3]);
                if (depth[0][i] < 1e30f && depth[1][i] < 1e30f && image[0][i][3] > 1e-2f)
                    farthest = fmax(farthest, fabs((double)depth[0][i] - (double)depth[1][i]));
            }
            CHECK(most < 2e-6 && farthest < 1e-4, "case %d, path %d: pixels differ by %g, depths by %g", n, path, most, farthest);
        }
        CHECK(seen > 0.05f, "case %d: opacity %g", n, (double)seen);
        free(data);
    }
    printf("    largest difference of pixels %.2g, of depth %.2g\n", most, farthest);
}

/* Light by the gradient is post-classified in physical space, whatever is asked for: it has no grid. */
TEST(light_by_the_gradient_is_post_classified) {
    field f = radius_field(49, 0);
    const isogi_transfer transfer = {shell, 4, NULL, 0};
    const isogi_light light = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 1, 0.5f}, .rgb = {2, 3, 4}};
    const isogi_lighting lighting = {.lights = &light, .light_count = 1};
    for (int two_sided = 0; two_sided < 2; two_sided++) {
        static float image[2][SIDE * SIDE][4];
        float most = 0;
        for (int n = 0; n < 2; n++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid,
                                         .shading = two_sided ? ISOGI_DVR_TWO_SIDED : ISOGI_DVR_LOCAL,
                                         .classification = n ? ISOGI_DVR_POST_CLASSIFIED : (isogi_dvr_classification)0,
                                         .material = {{.diffuse = {1, 1, 1}}, {.diffuse = {1, 1, 1}}, {.diffuse = {0.5f, 0.5f, 0.5f}}}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_render(dvr, &view_49, &lighting, image[n], NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < SIDE * SIDE; i++) most = fmaxf(most, image[0][i][1]);
        CHECK(!memcmp(image[0], image[1], sizeof image[0]) && most > 0.1f && most < 10, "two-sided %d: brightest %g", two_sided,
              (double)most);
    }
    field_free(&f);
}

/* 0..7, in steps that bytes and their scale hold exactly, and an offset. */
static isogi_volume far_from_zero(int type, double offset, double *doubles, uint8_t *bytes) {
    isogi_volume v = {.size = {8, 8, 8}, .data = type ? (const void *)bytes : (const void *)doubles, .type = type ? ISOGI_U8 : ISOGI_F64};
    for (int i = 0; i < 512; i++) {
        bytes[i] = (uint8_t)(32 * (3.5 + 3.5 * sin(i % 8 * 0.7 + i / 8 % 8 * 0.5 + i / 64 * 0.3)));
        doubles[i] = offset + bytes[i] / 32.0;
    }
    if (type) v.scale = 1 / 32.0, v.bias = offset;
    return v;
}

/* Slabs across x, each of one label, and a transfer function with a step at every label: a ray within a slab passes the extinction that
   begins there, and no other. Labels of integers and floats, scaled or not, few or many, near zero or far off. */
TEST(labels_at_steps_have_all_that_begins_there) {
    enum { THICK = 4, MOST = 12, LONG = THICK * MOST + 1, DEEP = 17 };
    static const struct labels { isogi_type type; int slabs; double least, distance, scale, bias; } kinds[] = {
        {ISOGI_U8, 12, 0, 1, 1, 0},      {ISOGI_U8, 7, 7, 13, 1, 0},         {ISOGI_U8, 3, 200, 20, 1, 0},
        {ISOGI_I16, 12, -6, 1, 1, 0},    {ISOGI_I16, 9, -2000, 9, 0.37, -3}, {ISOGI_U16, 12, 60000, 1, 1, 0},
        {ISOGI_U16, 8, 500, 7, 1e-3, 1}, {ISOGI_F32, 6, 0, 1, 1, 0},         {ISOGI_F32, 12, 0.1, 0.1, 1, 0},
        {ISOGI_F32, 5, 1e4, 1, 1, 0},    {ISOGI_F64, 7, -1 / 3.0, 1 / 7.0, 1, 0}, {ISOGI_F64, 10, 1e-9, 1e-9, 3, 0},
    };
    static double data[LONG * DEEP * DEEP];
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const struct labels l = kinds[k];
        const size_t size[3] = {(size_t)(THICK * l.slabs + 1), DEEP, DEEP};
        const isogi_volume v = {.data = data, .type = l.type, .size = {size[0], DEEP, DEEP}, .scale = l.scale, .bias = l.bias};
        isogi_transfer_point p[2 * MOST];
        const isogi_transfer transfer = {p, 2 * (size_t)l.slabs, NULL, 0};
        isogi_pyramid *pyramid = NULL;
        for (size_t i = 0; i < size[0] * DEEP * DEEP; i++) {
            const int slab = (int)(i % size[0]) / THICK;
            const double raw = l.least + l.distance * (slab < l.slabs ? slab : l.slabs - 1);
            switch (l.type) {
            case ISOGI_U8: ((uint8_t *)data)[i] = (uint8_t)raw; break;
            case ISOGI_I16: ((int16_t *)data)[i] = (int16_t)raw; break;
            case ISOGI_U16: ((uint16_t *)data)[i] = (uint16_t)raw; break;
            case ISOGI_F32: ((float *)data)[i] = (float)raw; break;
            default: data[i] = raw;
            }
        }
        for (int i = 0; i < 2 * l.slabs; i++) {
            const double raw = l.least + l.distance * (i / 2);
            const int before = (i - 1) / 2;
            p[i] = (isogi_transfer_point){(l.type == ISOGI_F32 ? (double)(float)raw : raw) * l.scale + l.bias, {1, 1, 1},
                                          i ? 0.02f * (float)(1 + before * 5 % 7) : 0};
            p[i].rgb[0] = i ? (float)(before * 3 % 5) / 4 : 0;
        }
        CHECK(isogi_vol_build(&pyramid, &v, &serial) == ISOGI_OK, "build");
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = pyramid, .opaque = 1};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            for (int i = 0; i < l.slabs; i++) {
                const double x = THICK * i + 1.5, eye[3] = {x, 8.2, 40}, target[3] = {x, 8.2, 0};
                const double extinction = 0.02 * (1 + i * 5 % 7), opacity = -expm1(-(DEEP - 1) * extinction), red = i * 3 % 5 / 4.0;
                const pixel seen = cast(dvr, eye, target, NULL);
                CHECK(fabs((double)seen.c[3] - opacity) < 1e-4 && fabs((double)seen.c[0] - red * opacity) < 1e-4,
                      "kind %zu, path %d, label %d: opacity %g of %g, red %g of %g", k, path, i, (double)seen.c[3], opacity,
                      (double)seen.c[0], red * opacity);
            }
            isogi_dvr_free(dvr);
        }
        isogi_vol_free(pyramid);
    }
}

/* Random labels, and waves, none of which lies below the step: a ray passes all that begins there, wherever its samples fall. */
TEST(values_from_a_step_on_have_all_that_begins_there) {
    for (int k = 0; k < 12; k++) {
        field f = field_new(33, 9, 9);
        test_random r = {(uint64_t)k + 1};
        const double least = k < 6 ? 100 + 17 * k : 1.3 * k;
        const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {least, {1, 1, 1}, 0.001f}, {least, {1, 1, 1}, 0.05f}, {250, {1, 1, 1}, 0.05f},
                                          {251, {1, 1, 1}, 0}};
        const isogi_transfer transfer = {p, 5, NULL, 0};
        for (size_t i = 0; i < field_count(&f); i++)
            f.value[i] = least + (k % 3 == 0 ? (double)(random_bits(&r) % 2) : k % 3 == 1 ? 0.2 * (double)(i % 2) : random_unit(&r));
        f.value[0] = 0, f.value[1] = 255; /* in a corner: classes of all values between */
        field_build(&f);
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            for (int i = 0; i < 20; i++) {
                const double y = 2 + 0.3 * i, eye[3] = {-40, y, 4.3}, target[3] = {60, y, 4.3};
                const double opacity = -expm1(-32 * 0.05);
                const pixel seen = cast(dvr, eye, target, NULL);
                CHECK(fabs((double)seen.c[3] - opacity) < 1e-3, "field %d, path %d, ray %d: %g of %g", k, path, i, (double)seen.c[3],
                      opacity);
            }
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

/* The shadows of labels: matter of one label all around, others in two corners of the box. */
TEST(labels_at_steps_cast_shadows) {
    for (int labels = 2; labels < 9; labels++) {
        field f = field_new(33, 33, 33);
        const isogi_transfer_point p[4] = {{0, {1, 1, 1}, 0.005f}, {1, {1, 1, 1}, 0.01f}, {1, {1, 1, 1}, 0.05f}, {labels, {1, 1, 1}, 0.2f}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = i == 0 ? 0 : i + 1 == field_count(&f) ? labels : 1;
        field_build(&f);
        float v[4][COUNT];
        const float middle[3] = {16, 16, 16};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                .directions = 32, .grid = {5, 5, 5}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &middle, 1, v[method]) == ISOGI_OK, "step");
            CHECK(fabs((double)v[method][0] / (double)v[ISOGI_DVR_BRUTE][0] - 1) < (method == ISOGI_DVR_PAPER ? 0.15 : 0.03),
                  "%d labels, method %d: %g of %g", labels, method, (double)v[method][0], (double)v[ISOGI_DVR_BRUTE][0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

/* What is added to all values and to the transfer function changes nothing: neither pictures nor visibility. */
TEST(values_far_from_zero_are_told_apart) {
    const double offset[] = {0, 1e6, 1e9};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {-20, 13, 3}, .target = {3.5f, 3.5f, 3.5f}, .fov = 30};
    static double doubles[512];
    static uint8_t bytes[512];
    static float image[2][SIDE * SIDE][4];
    for (int type = 0; type < 2; type++)
        for (int method = 0; method <= ISOGI_DVR_SWEEP; method++) { /* 0: a picture without light */
            float v[2][27 * COUNT], points[27][3];
            for (int i = 0; i < 81; i++) (&points[0][0])[i] = (float)(3 * (i % 3 == 0 ? i / 3 % 3 : i % 3 == 1 ? i / 9 % 3 : i / 27));
            for (int k = 0; k < 3; k++) {
                const isogi_volume volume = far_from_zero(type, offset[k], doubles, bytes);
                const isogi_transfer_point p[] = {{offset[k], {1, 0, 0}, 0.3f}, {offset[k] + 2, {0, 1, 0}, 0},
                                                  {offset[k] + 4, {0, 0, 1}, 0.5f}, {offset[k] + 7, {1, 1, 1}, 0}};
                const isogi_transfer transfer = {p, 4, NULL, 0};
                isogi_dvr_desc desc = {.step = 0.1, .grid = {5, 5, 5}, .visibility_step = 1, .opaque = 1};
                isogi_pyramid *pyramid = NULL;
                isogi_dvr *dvr;
                double worst = 0;
                CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
                desc.pyramid = pyramid;
                if (method) desc.shading = ISOGI_DVR_VISIBILITY, desc.method = (isogi_dvr_method)method;
                dvr = dvr_new(&desc, &transfer);
                if (method) {
                    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
                    isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, 27, v[k > 0]);
                    for (int i = 0; i < 27 * COUNT && k; i++) worst = fmax(worst, fabs((double)v[1][i] - (double)v[0][i]));
                } else {
                    CHECK(isogi_dvr_render(dvr, &view, NULL, image[k > 0], NULL, NULL) == ISOGI_OK, "render");
                    for (int i = 0; i < SIDE * SIDE && k; i++)
                        for (int c = 0; c < 4; c++) worst = fmax(worst, fabs((double)image[1][i][c] - (double)image[0][i][c]));
                }
                CHECK(worst < 2e-3, "type %d, method %d, offset %g: %g", type, method, offset[k], worst);
                isogi_dvr_free(dvr), isogi_vol_free(pyramid);
            }
        }
}

/* A ball far from zero, and one voxel on the other side of zero: doubles tell its values apart, floats that count from zero do not. */
TEST(a_voxel_beyond_zero_takes_no_digits_from_the_others) {
    static double data[33 * 33 * 33];
    const isogi_volume volume = {.data = data, .type = ISOGI_F64, .size = {33, 33, 33}};
    for (int far = -1; far <= 1; far += 2) {
        const double bulk = 1e9 * far;
        const isogi_transfer_point p[] = {{bulk + 0.4, {1, 1, 1}, 0}, {bulk + 0.6, {1, 1, 1}, 0.5f}, {bulk + 1.5, {1, 1, 1}, 0.5f},
                                          {bulk + 2, {1, 1, 1}, 0}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        isogi_pyramid *pyramid = NULL;
        float v[4][125 * COUNT], at[125][3];
        for (int i = 0; i < 33 * 33 * 33; i++) {
            const double x = i % 33 - 16, y = i / 33 % 33 - 16, z = i / (33 * 33) - 16, r = sqrt(x * x + y * y + z * z);
            data[i] = bulk + (r < 8 ? 1 : r < 10 ? (10 - r) / 2 : 0);
        }
        data[0] = -5 * far;
        for (int i = 0; i < 375; i++) at[i / 3][i % 3] = (float)(8 * (i % 3 == 0 ? i / 3 % 5 : i % 3 == 1 ? i / 15 % 5 : i / 75));
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                .grid = {5, 5, 5}};
            double sum = 0;
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, 125, v[method]);
            for (int i = 0; i < 125; i++) sum += fabs((double)v[method][COUNT * i] - (double)v[ISOGI_DVR_BRUTE][COUNT * i]) / 125;
            CHECK(sum < 0.2, "%g, method %d: %g off on average", bulk, method, sum);
            isogi_dvr_free(dvr);
        }
        isogi_vol_free(pyramid);
    }
}

/* However small the unit of extinction: what has none is transparent. Counts that no array can have are refused. */
TEST(tiny_units_and_endless_counts) {
    field f = field_new(8, 8, 8);
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {4, {1, 1, 1}, 0}, {7, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    const float point[1][3] = {{0, 3, 3}};
    for (int i = 0; i < 512; i++) f.value[i] = i % 8;
    field_build(&f);
    for (int coarsest = 1; coarsest < 3; coarsest++) {
        double first = 0;
        for (double unit = 1e-3; unit > 1e-300; unit *= 1e-33) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .unit = unit, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_SWEEP,
                .coarsest = coarsest, .grid = {8, 8, 8}, .visibility_step = 1};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            float v[9] = {0};
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, point, 1, v) == ISOGI_OK, "step");
            if (!(first > 0)) first = (double)v[0];
            CHECK(fabs((double)v[0] - first) < 0.1 && first > 2.9, "unit %g, coarsest %d: %g, not %g", unit, coarsest, (double)v[0], first);
            CHECK(isogi_dvr_sample_visibility(dvr, point, SIZE_MAX, v) == ISOGI_TOO_LARGE, "SIZE_MAX points");
            isogi_dvr_free(dvr);
        }
    }
    field_free(&f);
}

/* Values whose differences are no floats: half of the box is opaque, by every method. */
TEST(the_widest_range_of_floats) {
    static float data[512];
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {8, 8, 8}};
    const isogi_transfer_point p[] = {{1e38, {1, 1, 1}, 0}, {2e38, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    const float points[2][3] = {{0, 3.5f, 3.5f}, {6.9f, 3.5f, 3.5f}};
    isogi_pyramid *pyramid = NULL;
    for (int i = 0; i < 512; i++) data[i] = i % 8 < 4 ? -3e38f : 3e38f;
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
            .grid = {8, 8, 8}, .visibility_step = 1, .directions = 64};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float v[2][9];
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, points, 2, v[0]) == ISOGI_OK, "step");
        CHECK(v[0][0] > 2 && v[1][0] < 0.75f * v[0][0], "method %d: %g, in matter %g", method, (double)v[0][0], (double)v[1][0]);
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid);
}

TEST_MAIN("dvr_classes")
