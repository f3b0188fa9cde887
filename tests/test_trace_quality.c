/* How good the picture is that isogi_trace.h makes: hierarchical lattice, resolution of the texture, hard shadows, normals and offset. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

/* Relative RMSE over points of a texture's light, and what the texture cost. */
static double texture_error(const isogi_trace_desc *d, const float (*points)[3], const float (*reference)[3], int n,
                            isogi_counters *counters, size_t *memory) {
    float e[400][3];
    isogi_trace *t = NULL;
    double sum = 0, mean = 0, remaining = 1;
    isogi_result result = isogi_trace_create(&t, d, NULL);
    CHECK(result == ISOGI_OK, "result %d", result);
    isogi_trace_request(t, points, (size_t)n);
    for (double before = 1; remaining > 0 && result == ISOGI_OK; before = remaining) {
        result = isogi_trace_step(t, 200000, &remaining);
        CHECK(result == ISOGI_OK && remaining <= before, "result %d, remaining %g after %g", result, remaining, before);
    }
    isogi_trace_sample(t, points, (size_t)n, e, NULL);
    memset(counters, 0, sizeof *counters);
    isogi_trace_counters(t, counters), *memory = isogi_trace_memory(t);
    for (int i = 0; i < n; i++) sum += pow((double)e[i][1] - (double)reference[i][1], 2) / n, mean += (double)reference[i][1] / n;
    isogi_trace_free(t);
    return sqrt(sum) / mean;
}

/* A wide plain with one ball: light varies only near the ball. Two levels cost a part of the regular lattice, at hardly more error. */
TEST(hierarchical_lattice) {
    int n = LONG_SUITE ? 65 : 33;
    double q[5] = {0.3 * n, 0.3 * n, 0.3 * n, 0.1 * n, 0.12 * n}, error[3];
    scene s = scene_make(n, n, n, NULL, ball_over_plane, q);
    float points[200][3], reference[200][3];
    int count = surface_points(&s, 0, 200, 3, points);
    isogi_trace_desc d = desc_make(&s, 0.6f, 2, LONG_SUITE ? 1024 : 512);
    isogi_counters counters[3];
    size_t memory[3];
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)count, reference, NULL, NULL);
    d.samples = 64, d.isovalue_min = -1, d.isovalue_max = 1;
    for (int k = 0; k < 3; k++) {
        static const float hierarchy[3] = {0, 0.1f, 0.4f};
        d.hierarchy = hierarchy[k];
        error[k] = texture_error(&d, (const float(*)[3])points, (const float(*)[3])reference, count, &counters[k], &memory[k]);
        printf("    tolerance %.1f: %7d texels, %8d rays, %7d bytes, error %.4f\n", (double)hierarchy[k], (int)counters[k].texels,
               (int)counters[k].rays, (int)memory[k], error[k]);
    }
    CHECK(counters[1].rays < 0.8 * (double)counters[0].rays && counters[2].rays <= counters[1].rays, "rays %d, %d, %d",
          (int)counters[0].rays, (int)counters[1].rays, (int)counters[2].rays);
    CHECK(memory[1] < memory[0] && error[1] < error[0] + 0.02 && error[2] < error[0] + 0.05, "errors %.4f, %.4f, %.4f", error[0], error[1],
          error[2]);
    d.lazy = 1;
    isogi_trace *t = NULL;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_INVALID, "lazy and hierarchical, %d", 1);
    d.lazy = 0, d.sides = ISOGI_TRACE_BOTH_SIDES, d.samples = 1, d.hierarchy = 0.3f, d.mode = ISOGI_TRACE_TRANSFER;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "both sides %d", 1);
    CHECK(isogi_trace_relight(t, &d.lighting) == ISOGI_OK && isogi_trace_export_size(t, 0) == 0 && isogi_trace_save_size(t) == 0,
          "both sides %d", 2);
    CHECK(isogi_trace_sample(isogi_trace_high(t), (const float(*)[3])points, (size_t)count, reference, NULL) == ISOGI_OK &&
              reference[0][0] >= 0,
          "both sides %d", 3);
    isogi_trace_free(t), scene_free(&s);
}

/* What a scene does not need, in rays, texels and cells with and without. The same ball over the ground, as distances everywhere and cut
   off 1.5 voxels from the surface: what is constant takes a look at each texel, and neither rays nor memory. Of what is left an interval of
   isovalues takes a part, what a view of it asks for a smaller one, and every texel its samples alone: 8, no more. */
static double cut_off(const double p[3], const double *q) { return fmax(-1.5, fmin(1.5, ball_over_plane(p, q))); }
TEST(counters_prove_what_is_skipped) {
    enum { N = 33 };
    static const char *const name[6] = {"all values", "cut off", "an interval", "a view", "a view's interval", "constant"};
    double q[5] = {16, 20, 16, 5.3, 8.4};
    float points[60][3];
    isogi_counters c[6];
    size_t memory[6];
    for (int k = 0; k < 6; k++) {
        scene s = scene_make(N, N, N, NULL, k ? cut_off : ball_over_plane, q);
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 8);
        isogi_trace *t = NULL;
        int n = surface_points(&s, 0, 60, 3, points);
        if (k == 5) { /* as it could be: all in the air */
            for (size_t i = 0; i < N * N * N; i++) s.data[i] = -1.5f;
            isogi_vol_update(s.pyramid, (const size_t[3]){0, 0, 0}, (const size_t[3]){N - 1, N - 1, N - 1}, NULL);
        }
        if (k == 2 || k == 4) d.isovalue_min = -0.1, d.isovalue_max = 0.1;
        d.lazy = k == 3 || k == 4;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK,
              "%s", name[k]);
        memset(&c[k], 0, sizeof c[k]), isogi_trace_counters(t, &c[k]), memory[k] = isogi_trace_memory(t);
        printf("    %-17s %5d texels, %5d skipped, %6d rays, %8d blocks, %8d cells, %6d bytes\n", name[k], (int)c[k].texels,
               (int)c[k].texels_skipped, (int)c[k].rays, (int)c[k].blocks, (int)c[k].cells, (int)memory[k]);
        CHECK(c[k].rays == 8 * c[k].texels, "%s: %d rays for %d texels", name[k], (int)c[k].rays, (int)c[k].texels);
        if (k < 2 || k == 5)
            CHECK(c[k].texels + c[k].texels_skipped == N * N * N, "%s: %d texels, %d skipped", name[k], (int)c[k].texels,
                  (int)c[k].texels_skipped);
        isogi_trace_free(t), scene_free(&s);
    }
    for (int k = 1; k < 4; k++) /* rays that are left end sooner, too */
        CHECK(3 * c[k].texels < 2 * c[k - 1].texels && 3 * c[k].cells < 2 * c[k - 1].cells && c[k].blocks < c[k - 1].blocks &&
                  memory[k] < memory[k - 1],
              "%s: %d of %d texels, %d of %d cells, %d of %d bytes", name[k], (int)c[k].texels, (int)c[k - 1].texels, (int)c[k].cells,
              (int)c[k - 1].cells, (int)memory[k], (int)memory[k - 1]);
    CHECK(c[4].texels == c[3].texels && c[4].rays == c[3].rays, "a view reads what its interval reads: %d and %d texels",
          (int)c[3].texels, (int)c[4].texels);
    CHECK(c[5].texels == 0 && c[5].rays == 0 && c[5].cells == 0 && c[5].blocks == 0, "constant: %d cells", (int)c[5].cells);
}

/* By feedback, with all reflections: an interval's texels are fewer, a view's fewer still, and so are their rays and cells, those of probes
   included; with a target for errors texels take fewer samples; without reflections no probe is made. */
TEST(counters_prove_it_of_reflected_light) {
    enum { N = 33, CASES = 6 };
    static const char *const name[CASES] = {"all values", "an interval", "a view", "64 samples", "to a target", "no reflections"};
    static const int less_than[CASES] = {-1, 0, 1, -1, 3, 2};
    double q[5] = {16, 20, 16, 5.3, 8.4};
    float points[60][3];
    isogi_counters c[CASES] = {{0}};
    scene s = scene_make(N, N, N, NULL, cut_off, q);
    int n = surface_points(&s, 0, 60, 3, points);
    for (int k = 0; k < CASES; k++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, k == 5 ? 0 : -1, k == 3 || k == 4 ? 64 : 8);
        isogi_trace_report report;
        isogi_trace *t = NULL;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = k > 1, d.error = k == 4 ? 0.05f : 0;
        if (k == 1) d.isovalue_min = -0.1, d.isovalue_max = 0.1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK,
              "%s", name[k]);
        isogi_trace_counters(t, &c[k]), isogi_trace_status(t, &report);
        printf("    %-14s %5d texels, %6d probes, %6d rays, %7d cells\n", name[k], (int)c[k].texels, (int)report.probes, (int)c[k].rays,
               (int)c[k].cells);
        CHECK((report.probes == 0) == (k == 5), "%s: %d probes", name[k], (int)report.probes);
        if (less_than[k] >= 0) {
            const isogi_counters *more = &c[less_than[k]];
            CHECK(6 * c[k].rays < 5 * more->rays && 6 * c[k].cells < 5 * more->cells, "%s: %d of %d rays, %d of %d cells", name[k],
                  (int)c[k].rays, (int)more->rays, (int)c[k].cells, (int)more->cells);
            CHECK(k < 3 ? 3 * c[k].texels < 2 * more->texels : c[k].texels == more->texels, "%s: %d of %d texels", name[k],
                  (int)c[k].texels, (int)more->texels);
        }
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Textures of 1/8, 1 and 8 times the volume's texels (Wyman 2006, fig. 12): error against light gathered at the points themselves, with
   enough samples that the lattice is what is seen. Finer is better. */
TEST(resolution_of_the_texture) {
    double q[1] = {0.35}, error[3];
    scene s = scene_make(33, 33, 33, NULL, gyroid, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 0.5, 0.05);
    float points[100][3], reference[100][3];
    int n = surface_points(&s, 0, LONG_SUITE ? 100 : 40, 4, points);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, LONG_SUITE ? 2048 : 128);
    d.lighting.lights = &sun, d.lighting.light_count = 1;
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, reference, NULL, NULL);
    d.lazy = 1;
    for (int k = 0; k < 3; k++) {
        isogi_counters counters;
        size_t memory, size = k == 0 ? 17 : k == 1 ? 33 : 65;
        d.lattice[0] = d.lattice[1] = d.lattice[2] = size;
        error[k] = texture_error(&d, (const float(*)[3])points, (const float(*)[3])reference, n, &counters, &memory);
        printf("    %2d^3 texels for 33^3 voxels: error %.4f\n", (int)size, error[k]);
    }
    CHECK(error[0] > (LONG_SUITE ? 1.4 : 1.1) * error[1] && error[1] > (LONG_SUITE ? 1 : 0.8) * error[2] && error[2] < 0.06,
          "errors %.4f %.4f %.4f", error[0], error[1], error[2]);
    scene_free(&s);
}

/* The known weakness: a hard shadow is as wide as the lattice is coarse. The edge of a slab throws a straight shadow border on the ground;
   from 10 % to 90 % of the light takes one texel to one and a half. */
static double slab(const double p[3], const double *q) { return fmax(q[0] - p[1], fmin(fmin(16.25 - p[0], p[1] - 20), 24 - p[1])); }
TEST(hard_shadows_blur_by_little_more_than_a_texel) {
    double q[1] = {6.3};
    scene s = scene_make(33, 33, 33, NULL, slab, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, 1, 0, 1, 0);
    for (int k = 0; k < 3; k++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 1);
        isogi_trace *t = NULL;
        float points[400][3], e[400][3];
        double from = 0, to = 0, texel = k == 0 ? 2 : k == 1 ? 1 : 0.5;
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.lights = &sun, d.lighting.light_count = 1, d.lazy = 1;
        d.lattice[0] = d.lattice[1] = d.lattice[2] = (size_t)(32 / texel) + 1;
        for (int i = 0; i < 400; i++) points[i][0] = (float)(12 + 0.02 * i), points[i][1] = 6.3f, points[i][2] = 16;
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])points, 400), isogi_trace_step(t, 0, NULL);
        isogi_trace_sample(t, (const float(*)[3])points, 400, e, NULL);
        for (int i = 0; i < 400; i++) {
            if (e[i][0] < 0.1f) from = (double)points[i][0];
            if (e[i][0] < 0.9f) to = (double)points[i][0];
        }
        printf("    texels of %.1f voxels: the border of a hard shadow is %.2f voxels wide\n", texel, to - from);
        CHECK(to - from > 0.3 * texel && to - from < 1.7 * texel && e[0][0] < 0.01f && e[399][0] > 0.99f,
              "width %.2f of texels of %.1f, from %g to %g", to - from, texel, (double)e[0][0], (double)e[399][0]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Normals and offset (Wyman 2006, fig. 5), against the closed form: a ball under a sun has E = n.l. Gradient normals show voxels; rays that
   start on the trilinear surface meet its bumps: dark specks where the sun is low. */
TEST(normals_and_offset) {
    double q[4] = {15.6, 15.3, 15.8, 10}, error[3];
    int specks[3];
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 1, 0);
    float points[400][3], e[400][3];
    int n = surface_points(&s, 0, 400, 6, points);
    for (int k = 0; k < 3; k++) {
        static const char *const name[3] = {"gradient normals", "smoothed normals", "smoothed normals and offset"};
        isogi_trace_desc d = desc_make(&s, 0, 0, 1);
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.lights = &sun, d.lighting.light_count = 1;
        d.normals = k ? ISOGI_NORMAL_SMOOTH : ISOGI_NORMAL_TRILINEAR, d.offset = k == 2 ? 0 : -1;
        isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, NULL, NULL);
        error[k] = 0, specks[k] = 0;
        for (int i = 0; i < n; i++) {
            double r[3], cosine = 0, length = 0, toward[3] = {1, 2, 3};
            for (int a = 0; a < 3; a++) r[a] = (double)points[i][a] - q[a], length += r[a] * r[a], cosine += r[a] * toward[a];
            cosine /= sqrt(length * 14);
            error[k] += pow((double)e[i][0] - fmax(cosine, 0), 2) / n;
            specks[k] += cosine > 0.02 && e[i][0] <= 0;
        }
        error[k] = sqrt(error[k]);
        printf("    %-28s error %.4f of the sun, %d of %d points wrongly dark\n", name[k], error[k], specks[k], n);
    }
    CHECK(error[0] > 2 * error[2] && error[1] <= error[0] && error[2] <= error[1] * 1.01 && error[2] < 0.01, "errors %.4f %.4f %.4f",
          error[0], error[1], error[2]);
    CHECK(specks[2] == 0, "%d wrongly dark points", specks[2]);
    scene_free(&s);
}

/* Coarse texels and fine ones are one bake: its progress rises once from 0 to 1. */
static int goes_on(void *user, double fraction) {
    double *last = (double *)user;
    if (fraction < last[0] || fraction > 1) last[1]++;
    last[0] = fraction;
    return 0;
}
TEST(progress_of_a_hierarchy_rises) {
    double q[1] = {0.4};
    scene s = scene_make(16, 16, 16, NULL, gyroid, q);
    for (int k = 0; k < 4; k++) {
        double last[2] = {0, 0};
        isogi_context context = {.progress = goes_on, .user = last, .threads = 1};
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 8);
        isogi_trace *t = NULL;
        d.hierarchy = 0.2f, d.method = k & 1 ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS,
        d.sides = k & 2 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
        CHECK(last[0] > 0.9 && !(last[1] > 0), "case %d: progress fell %g times, ends at %g", k, last[1], last[0]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

static double sheet(const double p[3], const double *q) { return -fabs(p[0] - q[0]); }

/* A sheet, red light on one side and green of the same luminance on the other; and transfer, whose first coefficient is the same on both.
   Neither is smooth: a hierarchy tells the sides as a regular lattice does. */
TEST(hierarchies_tell_colours_and_directions) {
    const double q[1] = {15.25};
    const float point[2][3] = {{14.65f, 16, 16}, {15.85f, 16, 16}};
    isogi_light sun[2] = {{.vector = {1}, .rgb = {1 / 0.2126f}}, {.vector = {-1}, .rgb = {0, 1 / 0.7152f}}};
    scene s = scene_make(33, 33, 33, NULL, sheet, q);
    for (int mode = 0; mode < 2; mode++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 32);
        float e[2][2][3];
        d.mode = (isogi_trace_mode)mode, d.method = ISOGI_TRACE_FEEDBACK, d.order = 3, d.isovalue_min = -1, d.isovalue_max = -0.4;
        d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0, d.lighting.lights = sun, d.lighting.light_count = mode ? 1 : 2;
        for (int k = 0; k < 2; k++) {
            isogi_trace *t = NULL;
            d.hierarchy = k ? 0.2f : 0;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "mode %d", mode);
            isogi_trace_sample(t, point, 2, e[k], NULL), isogi_trace_free(t);
        }
        for (int i = 0; i < 2; i++)
            for (int c = 0; c < 3; c++)
                CHECK(fabs((double)e[0][i][c] - (double)e[1][i][c]) < 0.1, "mode %d, side %d, channel %d: %g regular, %g in levels",
                      mode, i, c, (double)e[0][i][c], (double)e[1][i][c]);
    }
    scene_free(&s);
}

/* a box with a ball on it; q[0]: the volume's last voxel, for its mirror image, else 0; q[1]: +1 or -1 */
static double mask(const double p[3], const double *q) {
    double x = q[0] > 0 ? q[0] - p[0] : p[0], y = q[0] > 0 ? q[0] - p[1] : p[1], z = q[0] > 0 ? q[0] - p[2] : p[2];
    int inside = (x >= 6 && x <= 13 && y >= 5 && y <= 10 && z >= 7 && z <= 14) || length3(x - 9, y - 12, z - 10) < 4.2;
    return inside ? q[1] : -q[1];
}

/* The light of a mirrored mask is the mirrored light, on the low side and on the high one (of the mask's negative, whose matter reaches
   the open border), for both kinds of normals: nothing depends on which side of a voxel's cell a texel lies. */
TEST(mirrored_masks_have_mirrored_light) {
    for (int k = 0; k < 4; k++) {
        double q[2][2] = {{0, k / 2 ? -1 : 1}, {19, k / 2 ? -1 : 1}}, apart = 0, noise = 0, mean = 0, worst = 0;
        float points[2][200][3], e[2][200][3], error[2][200];
        int n = 0, dark = 0;
        for (int m = 0; m < 2; m++) {
            scene s = scene_make(20, 20, 20, NULL, mask, q[m]);
            isogi_trace_desc d = desc_make(&s, 0.5f, 1, 48);
            isogi_trace *t = NULL;
            d.normals = (isogi_normal_kind)(k & 1), d.sides = k / 2 ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE;
            if (!m) n = surface_points(&s, 0, 200, 5, points[0]);
            for (int i = 0; i < n; i++)
                for (int a = 0; a < 3 && m; a++) points[1][i][a] = 19 - points[0][i][a];
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
            isogi_trace_sample(t, (const float(*)[3])points[m], (size_t)n, e[m], error[m]);
            isogi_trace_free(t), scene_free(&s);
        }
        for (int i = 0; i < n; i++) {
            double difference = (double)e[1][i][1] - (double)e[0][i][1], stated = hypot((double)error[0][i], (double)error[1][i]);
            dark += !(error[0][i] < 100 && error[1][i] < 100);
            apart += difference * difference / n, noise += stated * stated / n, mean += (double)e[0][i][1] / n;
            worst = fmax(worst, fabs(difference));
        }
        printf("    normals %d, side %d: mean %.3f, apart by %.4f (rms, noise %.4f), %.4f at most\n", k & 1, k / 2, mean, sqrt(apart),
               sqrt(noise), worst);
        CHECK(n == 200 && !dark, "case %d: %d points, %d without light", k, n, dark);
        CHECK(apart < 1.5 * noise && worst < 0.7, "case %d: %g apart, noise %g, worst %g", k, sqrt(apart), sqrt(noise), worst);
    }
}

static double thin(const double p[3], const double *q) {
    double in = p[0] > 3 && p[0] < 28 && p[1] > 3 && p[1] < 28 && p[2] > 3 && p[2] < 28, sum = p[0] + p[1];
    int flat = p[0] >= 16 && p[0] <= 16, line = flat && p[1] >= 16 && p[1] <= 16;
    return in > 0 && (q[0] < 1 ? flat : q[0] < 2 ? sum >= 31 && sum <= 31 : line) ? 1 : -1;
}

/* Seen from within, a maximum one voxel thick has nothing to be looked at through: as texels there, points of the caller's own are without
   light, whether normals are theirs or not. In front of it, on a surface of lower value, there is some. */
TEST(no_light_within_a_sheet_of_one_voxel) {
    const double q[1] = {0};
    const float points[2][3] = {{16, 10.3f, 12.7f}, {15.5f, 10.3f, 12.7f}}, normals[2][3] = {{-1, 0, 0}, {-1, 0, 0}};
    scene s = scene_make(32, 32, 32, NULL, thin, q);
    for (int given = 0; given < 2; given++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 32);
        float e[2][3], error[2];
        d.sides = ISOGI_TRACE_HIGH_SIDE;
        CHECK(isogi_trace_gather(&d, points, given ? normals : NULL, 2, e, error, NULL) == ISOGI_OK, "gather");
        CHECK(!test_finite((double)error[0]) && e[0][1] <= 0, "given %d: light %g with error %g", given, (double)e[0][1], (double)error[0]);
        CHECK(error[1] < 10, "given %d: in front, light %g with error %g", given, (double)e[1][1], (double)error[1]);
    }
    scene_free(&s);
}

/* Sheets and rods one voxel thick, straight and slanted: the smoothed gradient vanishes in all of their voxels, and the trilinear ones of
   both sides cancel. Every point that is seen from outside has light: pi, since nothing hides the sky. */
TEST(sheets_and_rods_of_one_voxel_have_light) {
    for (int k = 0; k < 6; k++) {
        const double q[1] = {k / 2};
        scene s = scene_make(32, 32, 32, NULL, thin, q);
        isogi_trace_desc d = desc_make(&s, 0, 0, 32);
        isogi_trace *t = NULL;
        float points[100][3], e[100][3], error[100], worst = 0;
        int n = surface_points(&s, 0, 100, 3, points), dark = 0;
        d.normals = (isogi_normal_kind)(k & 1);
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
        for (int i = 0; i < n; i++) dark += !(error[i] < 100), worst = fmaxf(worst, fabsf(e[i][1] - (float)PI));
        CHECK(n > 20 && !dark && worst < 0.4f, "case %d: %d of %d without light, %g off pi", k, dark, n, (double)worst);
        isogi_trace_free(t), scene_free(&s);
    }
}

TEST_MAIN("trace_quality")
