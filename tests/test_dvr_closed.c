/* Visibility of isogi_dvr.h against closed forms, coefficient by coefficient, by every method; and what it costs. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

enum { N = 49, ORDER = 4, COUNT = ORDER * ORDER };
static const char *const method_name[4] = {"default", "brute force", "paper", "sweeps"};

/* ---- scenes with a closed form: transmittance from a place towards a direction, in voxels ---- */

typedef double transmittance(const double place[3], const double dir[3]);
static double extinction, middle[3], edge; /* of the scene at hand; edge: of the box, in voxels */

/* The part of a ray within low..high of one axis and within the box. */
static double length_between(const double place[3], const double dir[3], int axis, double low, double high) {
    double enter = 0, leave = 1e30;
    for (int a = 0; a < 3; a++) {
        double from = a == axis ? low : 0, to = a == axis ? high : edge, t0, t1;
        if (fabs(dir[a]) < 1e-12) {
            if (place[a] < from || place[a] > to) return 0;
            continue;
        }
        t0 = (from - place[a]) / dir[a], t1 = (to - place[a]) / dir[a];
        enter = fmax(enter, fmin(t0, t1)), leave = fmin(leave, fmax(t0, t1));
    }
    return fmax(0, leave - enter);
}

static double through_box(const double place[3], const double dir[3]) { return exp(-extinction * length_between(place, dir, 0, 0, edge)); }
static double through_slab(const double place[3], const double dir[3]) { return exp(-extinction * length_between(place, dir, 2, 20, 28)); }
static double past_half_space(const double place[3], const double dir[3]) {
    return exp(-extinction * length_between(place, dir, 2, 0, 20));
}

static double past_sphere(const double place[3], const double dir[3]) { /* of radius 10 */
    double to[3], along, across, half;
    for (int a = 0; a < 3; a++) to[a] = middle[a] - place[a];
    along = to[0] * dir[0] + to[1] * dir[1] + to[2] * dir[2];
    across = to[0] * to[0] + to[1] * to[1] + to[2] * to[2] - along * along;
    if (across >= 100) return 1;
    half = sqrt(100 - across);
    return exp(-extinction * fmax(0, along + half - fmax(0, along - half)));
}

/* Its coefficients, by the midpoint rule on equal areas, of what is missing to 1: 1e-3 at a jump. */
static void project(transmittance *t, const double place[3], double out[COUNT]) {
    enum { ROWS = 100, COLUMNS = 200 };
    static double y[ROWS * COLUMNS][COUNT], d[ROWS * COLUMNS][3];
    static int ready;
    for (int i = 0; !ready && i < ROWS * COLUMNS; i++) {
        double z = (i / COLUMNS + 0.5) * 2 / ROWS - 1, phi = (i % COLUMNS + 0.5) * 2 * PI / COLUMNS, r = sqrt(1 - z * z);
        d[i][0] = r * cos(phi), d[i][1] = r * sin(phi), d[i][2] = z;
    }
    if (!ready) isogi_sh_eval_f64(y[0], ORDER, (const double(*)[3])d, ROWS * COLUMNS), ready = 1;
    for (int c = 0; c < COUNT; c++) out[c] = c ? 0 : sqrt(4 * PI);
    for (int i = 0; i < ROWS * COLUMNS; i++) {
        double missing = (1 - t(place, d[i])) * 4 * PI / (ROWS * COLUMNS);
        for (int c = 0; c < COUNT; c++) out[c] -= missing * y[i][c];
    }
}

static double height(double x, double y, double z) { return (void)x, (void)y, 48 * z; }
static double distance(double x, double y, double z) {
    return 48 * sqrt((x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5) + (z - 0.5) * (z - 0.5));
}
static double nothing_but_one(double x, double y, double z) { return (void)x, (void)y, (void)z, 1; }

typedef struct closed_scene {
    const char *name;
    field_function *field;
    transmittance *exact;
    double low, high; /* values that absorb */
    double extinction;
    double tolerance[4]; /* by method, largest error of a coefficient; sqrt(4 pi) is 3.54 */
} closed_scene;

/* Brute force: the error of 256 rays at an edge, and of steps of a voxel at the border of matter. Sweeps: besides, a lattice of one voxel,
   on which an opaque edge stands up to half a voxel outside. The paper's method puts a ray together from local views of four degrees, which
   blur what is opaque: 0.1 of what is seen. At most twice what is measured. */
static const closed_scene closed_scenes[] = {
    {"homogeneous box", nothing_but_one, through_box, 0, 2, 0.02, {0, 0.03, 0.15, 0.04}},
    {"dense homogeneous box", nothing_but_one, through_box, 0, 2, 0.3, {0, 0.06, 0.2, 0.07}},
    {"slab", height, through_slab, 20, 28, 0.1, {0, 0.03, 0.2, 0.05}},
    {"opaque slab", height, through_slab, 20, 28, 1e6, {0, 0.1, 0.4, 0.1}},
    {"half space", height, past_half_space, -1, 20, 1e6, {0, 0.1, 0.3, 0.1}},
    {"sphere", distance, past_sphere, -1, 10, 0.1, {0, 0.02, 0.15, 0.04}},
    {"opaque sphere", distance, past_sphere, -1, 10, 1e6, {0, 0.05, 0.5, 0.35}},
    {"box of next to nothing", nothing_but_one, through_box, 0, 2, 1e-9, {0, 1e-5, 1e-3, 1e-5}}, /* half floats in the paper's blocks */
};

static isogi_dvr_desc lit_by(const isogi_pyramid *pyramid, int method) {
    const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .order = ORDER,
        .directions = 256,
                                 .grid = {5, 5, 5}, .visibility_step = 1, .reduction = 1};
    return desc;
}

static double largest_of(const float *v, const double *expected) {
    double most = 0;
    for (int c = 0; c < COUNT; c++) most = fmax(most, fabs((double)v[c] - expected[c]));
    return most;
}

TEST(every_method_agrees_with_closed_forms_coefficient_by_coefficient) {
    /* off the borders of matter, where a grid point stands on either side */
    const float places[][3] = {{24, 24, 36}, {36, 12, 36}, {0, 24, 48}, {12, 12, 12}, {24, 24, 48}};
    middle[0] = middle[1] = middle[2] = 24, edge = N - 1;
    printf("    largest errors by brute force, paper, sweeps:");
    for (size_t s = 0; s < sizeof closed_scenes / sizeof *closed_scenes; s++) {
        const closed_scene *scene = &closed_scenes[s];
        field f = field_of(scene->field, N);
        const isogi_transfer_point p[] = {{scene->low, {1, 1, 1}, 0},
                                          {scene->low, {1, 1, 1}, (float)scene->extinction},
                                          {scene->high, {1, 1, 1}, (float)scene->extinction},
                                          {scene->high, {1, 1, 1}, 0}};
        const isogi_transfer transfer = {.points = p, .point_count = 4};
        printf("%s %s", s ? ";" : "", scene->name);
        extinction = scene->extinction;
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            isogi_dvr_desc desc = lit_by(f.pyramid, method);
            double most = 0;
            if (method == ISOGI_DVR_PAPER && !LONG_SUITE) {
                if (s % 2) continue; /* the slow one: half of the scenes, a quarter of the rays */
                desc.directions = 64;
            }
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
                double place[3] = {(double)places[k][0], (double)places[k][1], (double)places[k][2]}, expected[COUNT];
                float v[COUNT];
                project(scene->exact, place, expected);
                isogi_dvr_sample_visibility(dvr, &places[k], 1, v);
                CHECK(largest_of(v, expected) < scene->tolerance[method], "%s, %s: error %g at place %zu", scene->name, method_name[method],
                      largest_of(v, expected), k);
                most = fmax(most, largest_of(v, expected));
            }
            printf(" %.2g", most);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
    printf("\n");
}

/* ---- odd shapes and odd voxels ---- */

TEST(volumes_thinner_than_a_block_are_seen_by_every_method) {
    const int sizes[][3] = {{5, 33, 33}, {33, 3, 20}, {2, 2, 2}, {17, 16, 4}, {2, 40, 2}, {33, 20, 1}, {1, 1, 17}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        field f = field_new(sizes[s][0], sizes[s][1], sizes[s][2]);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1;
        field_build(&f);
        const isogi_transfer_point p = {0, {1, 1, 1}, 0.05f};
        const isogi_transfer transfer = {&p, 1, NULL, 0};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            isogi_dvr_desc desc = lit_by(f.pyramid, method);
            for (int a = 0; a < 3; a++) desc.grid[a] = sizes[s][a] > 1 ? 3 : 1;
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const float centre[3] = {0.5f * (float)(sizes[s][0] - 1), 0.5f * (float)(sizes[s][1] - 1), 0.5f * (float)(sizes[s][2] - 1)};
            double expected[COUNT], place[3] = {(double)centre[0], (double)centre[1], (double)centre[2]}, sum = 0;
            float v[COUNT];
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &centre, 1, v) == ISOGI_OK, "step");
            for (int i = 0; i < 4000; i++) { /* the mean over a Fibonacci lattice */
                double z = (i + 0.5) / 2000 - 1, phi = i * 2.399963229728653, r = sqrt(1 - z * z), d[3] = {r * cos(phi), r * sin(phi), z},
                       leave = 1e9;
                for (int a = 0; a < 3; a++)
                    if (fabs(d[a]) > 1e-9) leave = fmin(leave, ((d[a] > 0 ? sizes[s][a] - 1 : 0) - place[a]) / d[a]);
                sum += exp(-0.05 * leave) / 4000;
            }
            expected[0] = sum * sqrt(4 * PI);
            /* steps of a voxel where the way is a voxel long; the paper's blocks are half a node too wide, with nodes as far apart as the
               volume is thick */
            CHECK(fabs((double)v[0] - expected[0]) < (method == ISOGI_DVR_PAPER ? 0.4 : 0.06), "%d x %d x %d, %s: %g, not %g", sizes[s][0],
                  sizes[s][1], sizes[s][2], method_name[method], (double)v[0], expected[0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

TEST(voxels_that_are_not_finite_let_light_through_by_every_method) {
    const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    field f = field_of(nothing_but_one, 33);
    const isogi_transfer_point p = {0, {1, 1, 1}, 0.03f};
    const isogi_transfer transfer = {&p, 1, NULL, 0};
    for (int n = 0; n < 4; n++) { /* the last time nothing is finite */
        float whole[COUNT], v[COUNT];
        const float place[3] = {16, 16, 32};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++)
            for (int broken = 0; broken < 2; broken++) {
                const isogi_view view = {.width = 8, .height = 8, .eye = {60, 50, 70}, .target = {16, 16, 16}};
                const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {1, 1, 1}};
                const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
                for (size_t i = 0; i < field_count(&f); i++) f.value[i] = broken && (n == 3 || i % 400 == 7) ? bad[n % 3] : 1;
                isogi_vol_free(f.pyramid), field_build(&f);
                isogi_dvr_desc desc = lit_by(f.pyramid, method);
                desc.directions = 32;
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                          isogi_dvr_sample_visibility(dvr, &place, 1, broken ? v : whole) == ISOGI_OK,
                      "step");
                float(*image)[4] = picture(dvr, &view, &lighting, NULL, NULL);
                for (int i = 0; i < 64; i++)
                    for (int a = 0; a < 4; a++)
                        CHECK(image[i][a] >= 0 && image[i][a] < 10, "%s: pixel %g", method_name[method], (double)image[i][a]);
                for (int c = 0; c < COUNT; c++) CHECK(fabsf(v[c]) < 4 || !broken, "%s: coefficient %g", method_name[method], (double)v[c]);
                if (broken)
                    CHECK(v[0] > whole[0] - 1e-3f, "%s: %g with holes, %g without", method_name[method], (double)v[0], (double)whole[0]);
                if (broken && n == 3)
                    CHECK(fabs((double)v[0] - sqrt(4 * PI)) < 2e-3 && image[27][3] <= 0, "%s: %g where nothing is finite",
                          method_name[method], (double)v[0]);
                free(image), isogi_dvr_free(dvr);
            }
    }
    field_free(&f);
}

/* ---- what it costs ---- */

static isogi_counters counted(const isogi_dvr *dvr) {
    isogi_counters count = {0};
    isogi_dvr_counters(dvr, &count);
    return count;
}

TEST(empty_scenes_cost_no_ray_and_no_sample) {
    field f = field_of(distance, 40);
    const isogi_transfer_point beyond[] = {{1e3, {1, 1, 1}, 0}, {2e3, {1, 1, 1}, 5}}, dense = {0, {1, 1, 1}, 0.2f};
    const isogi_transfer empty = {beyond, 2, NULL, 0}, none = {NULL, 0, NULL, 0}, full = {&dense, 1, NULL, 0};
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    for (int space = 0; space < 2; space++)
        for (int method = ISOGI_DVR_BRUTE; method <= (space ? ISOGI_DVR_BRUTE : ISOGI_DVR_SWEEP); method++) {
            isogi_dvr_desc desc = lit_by(f.pyramid, method);
            desc.space = (isogi_dvr_space)space, desc.directions = 32;
            isogi_dvr *dvr = dvr_new(&desc, &empty), *fresh = dvr_new(&desc, &full);
            const isogi_view view = {.width = 16, .height = 16, .eye = {90, 80, 70}, .target = {20, 20, 20}};
            isogi_counters count = {0};
            const float place[3] = {20, 20, 20};
            double remaining = 1;
            float v[COUNT], again[COUNT];
            for (int n = 0; n < 2; n++) {
                CHECK(isogi_dvr_step(dvr, 1, &remaining) == ISOGI_OK && remaining <= 0, "remaining %g", remaining);
                CHECK(counted(dvr).rays == 0 && counted(dvr).samples == 0, "%s: %d rays", method_name[method], (int)counted(dvr).rays);
                float(*image)[4] = picture(dvr, &view, &sky, NULL, &count);
                CHECK(!count.samples && !count.blocks && !count.cells, "%d samples, %d blocks, %d cells", (int)count.samples,
                      (int)count.blocks, (int)count.cells);
                free(image);
                isogi_dvr_sample_visibility(dvr, &place, 1, v);
                for (int c = 0; c < COUNT; c++)
                    CHECK(fabs((double)v[c] - (c ? 0 : sqrt(4 * PI))) < 1e-6, "coefficient %d: %g", c, (double)v[c]);
                if (!n) CHECK(isogi_dvr_set_transfer(dvr, &none) == ISOGI_OK, "set_transfer");
            }
            /* what was not computed is not forgotten: a full scene after it is that of a new renderer, and empty again it is clear */
            CHECK(isogi_dvr_set_transfer(dvr, &full) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK,
                  "step");
            isogi_dvr_sample_visibility(dvr, &place, 1, v), isogi_dvr_sample_visibility(fresh, &place, 1, again);
            CHECK(!memcmp(v, again, sizeof v) && v[0] < 1.5f, "%s: %g after an empty scene, %g without one", method_name[method],
                  (double)v[0], (double)again[0]);
            CHECK(isogi_dvr_set_transfer(dvr, &empty) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            isogi_dvr_sample_visibility(dvr, &place, 1, v);
            CHECK(fabs((double)v[0] - sqrt(4 * PI)) < 1e-6, "%s: %g when empty again", method_name[method], (double)v[0]);
            isogi_dvr_free(dvr), isogi_dvr_free(fresh);
        }
    field_free(&f);
}

TEST(moving_any_light_recomputes_nothing) {
    field f = field_of(distance, 40);
    const isogi_transfer_point p[] = {{8, {1, 1, 1}, 0.2f}, {12, {1, 1, 1}, 0}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    float sky[2 * 4 * 2 * 3];
    for (int i = 0; i < 48; i++) sky[i] = 0.1f * (float)i;
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        isogi_dvr_desc desc = lit_by(f.pyramid, method);
        desc.directions = 32;
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const isogi_view view = {.width = 8, .height = 8, .eye = {90, 80, 70}, .target = {20, 20, 20}};
        const float place[3] = {10, 20, 30};
        isogi_dvr_report before, after;
        float v[2][COUNT], last = -1;
        double remaining = 1;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        isogi_counters count = counted(dvr);
        isogi_dvr_inspect(dvr, &before), isogi_dvr_sample_visibility(dvr, &place, 1, v[0]);
        for (int n = 0; n < 8; n++) {
            const isogi_light lights[3] = {
                {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {(float)n - 3, 1, 1}, .rgb = {1, 1, 1}},
                {.kind = ISOGI_LIGHT_POINT, .vector = {60, 10 * (float)n, 20}, .rgb = {99, 99, 99}},
                {.kind = ISOGI_LIGHT_SPHERE, .vector = {20, 60, 10 * (float)n}, .rgb = {99, 99, 99}, .radius = 3}};
            const isogi_lighting lighting = {.env = {.rgb = sky, .width = 4, .height = 2, .rotation = {0, 0, 1, 1, 0, 0, 0, 1, 0}},
                                             .lights = lights + n % 3,
                                             .light_count = n < 6 ? 1 : 2};
            float(*image)[4] = picture(dvr, &view, &lighting, NULL, NULL);
            CHECK(image[27][0] < last || image[27][0] > last, "light %d changes the picture: %g", n, (double)image[27][0]);
            last = image[27][0];
            CHECK(isogi_dvr_step(dvr, 0, &remaining) == ISOGI_OK && remaining <= 0, "nothing is left to do: %g", remaining);
            free(image);
        }
        isogi_counters again = counted(dvr);
        isogi_dvr_inspect(dvr, &after), isogi_dvr_sample_visibility(dvr, &place, 1, v[1]);
        CHECK(!memcmp(&count, &again, sizeof count) && !memcmp(v[0], v[1], sizeof v[0]), "%s: %d rays more", method_name[method],
              (int)(again.rays - count.rays));
        CHECK(before.blocks_classified == after.blocks_classified && before.blocks_computed == after.blocks_computed, "%s: blocks",
              method_name[method]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Values of one corner alone are classified anew: the blocks that hold them are, and local visibility within a ray's reach of them. */
TEST(an_edit_of_the_transfer_function_recomputes_the_blocks_that_it_changes) {
    field f = field_new(145, 49, 49); /* 9 x 3 x 3 blocks */
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(i % 145);
    field_build(&f);
    isogi_transfer_point p[] = {{0, {1, 1, 1}, 0.01f}, {100, {1, 1, 1}, 0.01f}, {130, {1, 1, 1}, 0.01f}, {144, {1, 1, 1}, 0.01f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    for (int method = ISOGI_DVR_PAPER; method <= ISOGI_DVR_SWEEP; method++) {
        isogi_dvr_desc desc = lit_by(f.pyramid, method);
        desc.directions = 16, p[3].extinction = 0.01f;
        isogi_dvr *dvr = dvr_new(&desc, &transfer), *fresh = NULL;
        isogi_dvr_report before, after;
        float v[2][COUNT];
        isogi_dvr_step(dvr, 0, NULL), isogi_dvr_inspect(dvr, &before);
        CHECK(before.blocks_classified == 81, "%d blocks at first", (int)before.blocks_classified);
        p[3].extinction = 0.5f; /* from value 130 on: the last of nine layers of blocks (128 to 144) */
        CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "edit");
        isogi_dvr_inspect(dvr, &after);
        CHECK(after.blocks_classified - before.blocks_classified == 9, "%s: %d of 81 blocks classified anew", method_name[method],
              (int)(after.blocks_classified - before.blocks_classified));
        if (method == ISOGI_DVR_PAPER)
            CHECK(after.blocks_computed - before.blocks_computed <= 27 && after.blocks_computed > before.blocks_computed,
                  "%d blocks computed anew, three layers hold 27", (int)(after.blocks_computed - before.blocks_computed));
        fresh = dvr_new(&desc, &transfer), isogi_dvr_step(fresh, 0, NULL);
        for (int i = 0; i < 9; i++) {
            const float place[3] = {18 * (float)i, 20, 30};
            isogi_dvr_sample_visibility(dvr, &place, 1, v[0]), isogi_dvr_sample_visibility(fresh, &place, 1, v[1]);
            CHECK(!memcmp(v[0], v[1], sizeof v[0]), "%s at %d: %g, a new renderer %g", method_name[method], i, (double)v[0][0],
                  (double)v[1][0]);
        }
        isogi_dvr_free(dvr), isogi_dvr_free(fresh);
    }
    field_free(&f);
}

/* A plane is the same one, however long its normal is. */
TEST(planes_of_any_length_cut_alike) {
    static const int power[] = {0, -1040, -1000, -300, 300, 1018};
    const isogi_transfer_point p[] = {{-1, {1, 0, 0}, 0.02f}, {0, {0, 1, 0}, 0.1f}, {1, {0, 1, 1}, 0.02f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    const isogi_view view = {.width = 16, .height = 16, .eye = {70, 50, 60}, .target = {16, 16, 16}};
    const float place[1][3] = {{20, 16, 16}};
    field f = field_waves(33, 5);
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .order = 2,
                                     .directions = 16, .grid = {5, 5, 5}};
        float(*first)[4] = NULL, v[2][4];
        for (size_t k = 0; k < sizeof power / sizeof *power; k++) {
            const double plane[1][4] = {{ldexp(1, power[k]), ldexp(0.5, power[k]), ldexp(-0.25, power[k]), ldexp(-18, power[k])}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            float(*pixels)[4] = picture(dvr, &view, &sky, NULL, NULL);
            CHECK(isogi_dvr_sample_visibility(dvr, place, 1, v[k > 0]) == ISOGI_OK, "sample");
            if (!k) first = pixels;
            else
                CHECK(!(largest_difference(first, pixels, 256) > 0) && !memcmp(v[0], v[1], sizeof v[0]), "%s, times 2^%d: off by %g",
                      method_name[method], power[k], largest_difference(first, pixels, 256));
            if (k) free(pixels);
            isogi_dvr_free(dvr);
        }
        free(first);
    }
    field_free(&f);
}

/* Planes along the faces of the box cut nothing off, whatever side of a face their rounding puts them on. (Not by brute force: of rays that
   run within a face, rounding may part some from it at once.) */
TEST(planes_along_the_faces_cut_nothing) {
    static const double edges[] = {0.3, 0.7, 1.1, 0.05}, corners[] = {-1.7, 12.3, 100.1};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0.3f}};
    const isogi_transfer transfer = {p, 1, NULL, 0};
    for (int k = 0; k < 24; k++) {
        field f = field_new(17, 17, 17);
        float place[25][3], v[2][25][4];
        double plane[6][4] = {{0}}, most = 0;
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = edges[k % 4], f.volume.origin[a] = corners[k / 4 % 3];
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1;
        field_build(&f);
        for (int i = 0; i < 2; i++) {
            const double grid[3] = {16 * i, 16 * i, 16 * i};
            double world[3];
            isogi_vol_to_world(f.pyramid, grid, world);
            for (int a = 0; a < 3; a++) plane[2 * a + i][a] = i ? -1 : 1, plane[2 * a + i][3] = i ? world[a] : -world[a];
        }
        for (int i = 0; i < 25; i++) {
            const double grid[3] = {i % 5 * 4, i / 5 * 4, 8};
            double world[3];
            isogi_vol_to_world(f.pyramid, grid, world);
            for (int a = 0; a < 3; a++) place[i][a] = (float)world[a];
        }
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY,
                                     .method = k < 12 ? ISOGI_DVR_SWEEP : ISOGI_DVR_PAPER, .order = 2, .directions = 32, .grid = {5, 5, 5}};
        for (int cut = 0; cut < 2; cut++) {
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])plane, cut ? 6 : 0) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK,
                  "step");
            CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])place, 25, v[cut][0]) == ISOGI_OK, "sample");
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < 100; i++) {
            const double off = fabs((double)v[0][i / 4][i % 4] - (double)v[1][i / 4][i % 4]);
            if (!(off <= most)) most = off;
        }
        CHECK(most < 1e-6, "spacing %g, origin %g: off by %g", edges[k % 4], corners[k / 4 % 3], most);
        field_free(&f);
    }
}

/* What is cut away costs no points: the others get its levels, and light comes in through the cut. */
TEST(clip_planes_select_levels_anew_and_let_light_in) {
    field f = field_noise(65, 5); /* 4 x 4 x 4 blocks, none of them simple */
    const isogi_transfer_point p[] = {{-1, {0, 0, 1}, 0.01f}, {0, {1, 0.5f, 0}, 0.3f}, {1, {1, 1, 1}, 0.05f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    const double plane[1][4] = {{1, 0, 0, -32}}; /* keeps x >= 32 */
    const float place[3] = {32, 32, 32};
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        isogi_dvr_desc desc = lit_by(f.pyramid, method);
        desc.directions = 32, desc.reduction = 6, desc.order = 2;
        isogi_dvr *dvr = dvr_new(&desc, &transfer), *fresh = dvr_new(&desc, &transfer);
        isogi_dvr_report whole, cut;
        float v[3][COUNT];
        double remaining = 0;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        isogi_dvr_inspect(dvr, &whole), isogi_dvr_sample_visibility(dvr, &place, 1, v[0]);
        size_t before = whole.level_count[0], fine = whole.level_count[5], points = whole.points, budget = (size_t)(65 * 65 * 65 / 6);
        CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK && isogi_dvr_step(dvr, 1, &remaining) == ISOGI_OK && remaining > 0,
              "a clip plane leaves work to do: %g", remaining);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        CHECK(isogi_dvr_set_clip(fresh, plane, 1) == ISOGI_OK && isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK, "step");
        isogi_dvr_inspect(dvr, &cut), isogi_dvr_sample_visibility(dvr, &place, 1, v[1]),
            isogi_dvr_sample_visibility(fresh, &place, 1, v[2]);
        CHECK(!memcmp(v[1], v[2], sizeof(float[4])), "%s: %g, %g when cut from the beginning", method_name[method], (double)v[1][0],
              (double)v[2][0]);
        /* x is coefficient 3: on a face whose outside is clear, that of a half space is sqrt(3 pi) / 2 = 1.5 against +x */
        CHECK(v[1][0] > v[0][0] + 0.8f && v[1][3] < -0.8f && fabsf(v[0][3]) < 0.4f, "%s: light %g and %g within, %g and %g on the cut",
              method_name[method], (double)v[0][0], (double)v[0][3], (double)v[1][0], (double)v[1][3]);
        if (method != ISOGI_DVR_PAPER) CHECK(!cut.level, "levels by %s", method_name[method]);
        else
            CHECK(before == 0 && cut.level_count[0] == 16 && cut.level_count[5] > fine && cut.points <= budget && points <= budget,
                  "%zu dropped, then %zu; %zu at full resolution, then %zu; %zu points, then %zu", before, cut.level_count[0], fine,
                  cut.level_count[5], points, cut.points);
        isogi_dvr_free(dvr), isogi_dvr_free(fresh);
    }
    field_free(&f);
}

/* ---- data space: visibility cell by cell ---- */

static double through_values(const double place[3],
                             const double dir[3]) { /* f = z: what counts is the height climbed, in or out of 10..30 */
    double length = length_between(place, dir, 0, 0, edge), end = place[2] + length * dir[2], low = fmin(end, place[2]),
           high = fmax(end, place[2]);
    return exp(-extinction * fmax(0, fmin(high, 30) - fmax(low, 10)));
}

TEST(visibility_in_data_space_has_no_step) {
    field f = field_of(height, N);
    const isogi_transfer_point p[] = {{10, {1, 1, 1}, 0}, {10, {1, 1, 1}, 0.1f}, {30, {1, 1, 1}, 0.1f}, {30, {1, 1, 1}, 0}};
    isogi_peak peaks[1000]; /* the same: a thousand sheets */
    for (int i = 0; i < 1000; i++) peaks[i] = (isogi_peak){10 + 0.02 * i + 0.01, {1, 1, 1}, (float)-expm1(-0.002)};
    const isogi_transfer transfers[2] = {{p, 4, NULL, 0}, {NULL, 0, peaks, 1000}};
    const float places[][3] = {{24, 24, 0}, {0, 12, 24}, {12, 48, 48}};
    extinction = 0.1, edge = N - 1;
    for (int n = 0; n < 2; n++) {
        isogi_dvr_desc desc = lit_by(f.pyramid, ISOGI_DVR_BRUTE);
        desc.space = ISOGI_DVR_DATA, desc.directions = 512, desc.visibility_step = 1000;
        isogi_dvr *dvr = dvr_new(&desc, &transfers[n]);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        CHECK(counted(dvr).cells > 0, "%d cells", (int)counted(dvr).cells);
        for (int k = 0; k < 3; k++) {
            double place[3] = {(double)places[k][0], (double)places[k][1], (double)places[k][2]}, expected[COUNT];
            float v[COUNT];
            project(through_values, place, expected), isogi_dvr_sample_visibility(dvr, &places[k], 1, v);
            CHECK(largest_of(v, expected) < 0.01, "case %d place %d: error %g", n, k, largest_of(v, expected)); /* of 512 rays */
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST_MAIN("dvr_closed")
