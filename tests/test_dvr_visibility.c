/* Visibility of isogi_dvr.h by sweeps and by the paper's blocks, and pictures of physical space. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "test.h"

enum { N = 49 };
static float data[N][N][N];
static const isogi_context serial = {.threads = 1};

static isogi_pyramid *linear_field(void) {
    isogi_pyramid *pyramid = NULL;
    for (int i = 0; i < N * N * N; i++)
        data[i / N / N][i / N % N][i % N] = (float)(i % N) + 0.37f * (float)(i / N % N) - 0.2f * (float)(i / N / N);
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    return pyramid;
}

static isogi_dvr *renderer(isogi_dvr_desc desc, const isogi_transfer *transfer, const isogi_context *context) {
    isogi_dvr *dvr = NULL;
    CHECK(isogi_dvr_create(&dvr, &desc, context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, transfer) == ISOGI_OK, "create");
    return dvr;
}

static const isogi_transfer_point ramp[] = {{-20, {1, 0.5f, 0.2f}, 0}, {80, {0.2f, 0.5f, 1}, 0.1f}};
static const isogi_transfer ramp_transfer = {ramp, 2, NULL, 0};

TEST(blocks_of_all_levels_hold_a_linear_field_without_a_seam) {
    isogi_pyramid *pyramid = linear_field();
    int mixed = 0;
    for (double reduction = 1; reduction < 1e7; reduction *= 6) { /* the last budgets are smaller than a block */
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 8,
                                     .sphere = ISOGI_DVR_OCTAHEDRON, .order = 2, .grid = {3, 3, 3}, .reduction = reduction};
        isogi_dvr *dvr = renderer(desc, &ramp_transfer, &serial);
        isogi_dvr_report report;
        test_random r = {7};
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
        CHECK((double)report.points <= fmax(N * N * N / reduction, 27), "%d points of %g", (int)report.points, N * N * N / reduction);
        mixed |= report.level_count[3] && report.level_count[4];
        for (int i = 0; i < 2000; i++) {
            float p[3], value;
            for (int a = 0; a < 3; a++) p[a] = i % 4 == a ? 16 * (float)(1 + i % 2) : (float)random_range(&r, 0, N - 1);
            isogi_dvr_sample_blocks(dvr, (const float(*)[3])p, 1, &value, NULL);
            double expected = (double)p[0] + 0.37 * (double)p[1] - 0.2 * (double)p[2];
            CHECK(fabs((double)value - expected) < 1e-4, "reduction %g: %g, not %g", reduction, (double)value,
                  expected); /* float rounding of 70 */
        }
        isogi_dvr_free(dvr);
    }
    CHECK(mixed, "no budget mixed levels");
    isogi_vol_free(pyramid);
}

/* Averages of rough data differ from level to level: where blocks of two levels meet, the finer one has what the coarser one holds, and
   both sides agree on values and on local visibility, a ten-thousandth of a voxel to either side of faces, edges and corners. */
TEST(blocks_of_different_levels_meet_without_a_seam_in_rough_data) {
    isogi_pyramid *pyramid = NULL;
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    const isogi_transfer_point p[] = {{0, {0, 0, 1}, 0.01f}, {0.5, {1, 0.5f, 0}, 0.3f}, {1, {1, 1, 1}, 0.05f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    test_random r = {12};
    int mixed = 0;
    for (int i = 0; i < N * N * N; i++) {
        const int x = i % N, y = i / N % N, z = i / N / N;
        data[z][y][x] = (float)(0.5 + 0.25 * sin(x * 0.3) * cos(y * 0.25) + 0.2 * sin(z * 0.4) + 0.3 * x / N * random_range(&r, -1, 1));
    }
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (double reduction = 2; reduction < 2000; reduction *= 5) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 16,
                                     .order = 2, .grid = {2, 2, 2}, .reduction = reduction};
        isogi_dvr *dvr = renderer(desc, &transfer, &serial);
        isogi_dvr_report report;
        double step[2] = {0, 0};
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
        for (int n = 1; n < 5; n++) mixed |= (report.level_count[n] && report.level_count[n + 1]) << n;
        for (int i = 0; i < 6000; i++) {
            float q[2][3], value[2], v[2][4];
            const int faces = 1 + i % 3; /* 2, 3: edges and corners */
            for (int a = 0; a < 3; a++) {
                const int face = (a + i / 3) % 3 < faces;
                const double x = face ? 16 * (1 + (double)(random_bits(&r) % 2)) : random_range(&r, 0, N - 1);
                q[0][a] = (float)(x - face * 1e-4), q[1][a] = (float)(x + face * 1e-4);
            }
            isogi_dvr_sample_blocks(dvr, (const float(*)[3])q, 2, value, v[0]);
            step[0] = fmax(step[0], fabs((double)value[0] - (double)value[1]));
            for (int c = 0; c < 4; c++) step[1] = fmax(step[1], fabs((double)v[0][c] - (double)v[1][c]));
        }
        /* slopes of at most 0.6 a voxel over 2e-4 voxels; coefficients are half floats of up to 3.5: a rounding is 1e-3 */
        CHECK(step[0] < 2e-4 && step[1] < 2e-3, "reduction %g: values step by %g, visibility by %g", reduction, step[0], step[1]);
        isogi_dvr_free(dvr);
    }
    CHECK(mixed == 30, "pairs of levels that occurred together: %d", mixed); /* 1 and 2, 2 and 4, 4 and 8, 8 and 16 */
    isogi_vol_free(pyramid);
}

/* One cell is left over beyond whole blocks on every axis: blocks of one cell hold what they have of it, and all keep to the budget.
   Visibility
   is that of brute force up to what a coarse level cannot hold. */
TEST(blocks_that_the_border_cuts_thin_keep_to_the_budget) {
    enum { CUT = 34, POINTS = 125 };
    static float cut[CUT][CUT][CUT], v[2][POINTS][4], points[POINTS][3];
    const isogi_volume volume = {.data = cut, .type = ISOGI_F32, .size = {CUT, CUT, CUT}};
    const double tolerance[] = {0.05, 0.05, 0.25, 0.25}; /* twice what is measured: where the budget ends, blocks hold a point or two */
    isogi_pyramid *pyramid = NULL;
    double reduction = 1;
    for (int i = 0; i < CUT * CUT * CUT; i++)
        cut[i / CUT / CUT][i / CUT % CUT][i % CUT] = (float)(i % CUT) + 0.37f * (float)(i / CUT % CUT) - 0.2f * (float)(i / CUT / CUT);
    for (int i = 0; i < POINTS; i++)
        for (int a = 0, k = i; a < 3; a++, k /= 5) points[i][a] = (float)(k % 5 * (CUT - 1)) / 4;
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int n = 0; n < 4; n++, reduction *= 5) {
        double error = 0, norm = 0;
        for (int m = 0; m < 2; m++) {
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = m ? ISOGI_DVR_PAPER
                : ISOGI_DVR_BRUTE, .directions = 32,
                                         .sphere = ISOGI_DVR_OCTAHEDRON, .order = 2, .grid = {5, 5, 5}, .reduction = reduction};
            isogi_dvr *dvr = renderer(desc, &ramp_transfer, &serial);
            isogi_dvr_report report;
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
            CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, POINTS, v[m][0]) == ISOGI_OK, "sample");
            if (m)
                CHECK(report.points && (double)report.points <= CUT * CUT * CUT / reduction, "%d points of %g", (int)report.points,
                      CUT * CUT * CUT / reduction);
            /* 17 + 17 + 2 nodes along an axis: those on faces between blocks are held twice */
            if (m && !n)
                CHECK(report.points == 33 * 33 * 33 && report.data_bytes == 36 * 36 * 36 * sizeof(float), "%zu points, %zu bytes",
                      report.points, report.data_bytes);
            /* four coefficients of two bytes at every node, and two places and a number for each block, with three bytes */
            if (m && !n)
                CHECK(report.local_bytes == 36 * 36 * 36 * 4 * 2 && report.index_bytes == 27 * (3 * sizeof(size_t) + 3) &&
                          report.global_bytes == POINTS * 4 * sizeof(float),
                      "%zu bytes of local visibility, %zu of the index, %zu of global visibility", report.local_bytes, report.index_bytes,
                      report.global_bytes);
            if (m) CHECK(fabs(report.reduction / (CUT * CUT * CUT / (double)report.points) - 1) < 1e-12, "reduction %g", report.reduction);
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < 4 * POINTS; i++)
            error += pow((double)v[1][i / 4][i % 4] - (double)v[0][i / 4][i % 4], 2), norm += pow((double)v[0][i / 4][i % 4], 2);
        CHECK(sqrt(error / norm) < tolerance[n], "reduction %g: relative error %g", reduction, sqrt(error / norm));
    }
    isogi_vol_free(pyramid);
}

/* Matter that lets light in dims what is below its surface. A ball of optical depth 0.4 a voxel is 1.8 times as bright on a grid of 4
   voxels, whose light is that in front of it, as on one of half a voxel; if all points that see less than half of their surroundings
   counted for less, it would be 2.0 times. */
TEST(translucent_matter_is_dimmed_by_itself_on_coarse_grids_too) {
    enum { SIDE = 33, WIDTH = 24 };
    static float ball[SIDE][SIDE][SIDE], image[WIDTH * WIDTH][4];
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}};
    const isogi_volume volume = {.data = ball, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {4, {1, 1, 1}, 0}, {5, {1, 1, 1}, 0.4f}, {16, {1, 1, 1}, 0.4f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    const isogi_view view = {.width = WIDTH, .height = WIDTH, .eye = {50, 40, 60}, .target = {16, 16, 16}, .fov = 30};
    isogi_pyramid *pyramid = NULL;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        ball[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] =
            (float)(16 - sqrt(pow(i % SIDE - 16, 2) + pow(i / SIDE % SIDE - 16, 2) + pow(i / SIDE / SIDE - 16, 2)));
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int way = 0; way < 2; way++) {
        double light[2] = {0, 0};
        for (int fine = 0; fine < 2; fine++) {
            const size_t n = fine ? 65 : 9;
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .grid = {n, n, n},
                                         .classification = way ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT, .visibility_step = 0.5};
            isogi_dvr *dvr = renderer(desc, &transfer, &serial);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            CHECK(isogi_dvr_render(dvr, &view, &lighting, image, NULL, NULL) == ISOGI_OK, "render");
            for (int i = 0; i < WIDTH * WIDTH; i++) light[fine] += (double)image[i][0];
            isogi_dvr_free(dvr);
        }
        CHECK(light[0] < 1.9 * light[1] && light[0] > 0.9 * light[1], "way %d: %g times as bright", way, light[0] / light[1]);
    }
    isogi_vol_free(pyramid);
}

/* Above an opaque floor, grid points at every node of the lattice and at every other: a ray of a sweep that runs within the floor is no
   neighbour of theirs, whatever its share. Light is that of the same directions by brute force, on every path. */
TEST(sweeps_do_not_blur_light_across_the_surface_of_an_opaque_floor) {
    enum { SIDE = 33, POINTS = 17 };
    static float ground[SIDE][SIDE][SIDE];
    const isogi_volume volume = {.data = ground, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 8}, {1, {1, 1, 1}, 8}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    float at[2 * POINTS][3], v[5][2 * POINTS]; /* by brute force, by sweeps of each path */
    memset(at, 0, sizeof at);
    for (int i = 0; i < 2 * POINTS; i++)
        at[i][i / POINTS ? 2 : 0] = (float)(2 * (i % POINTS)), at[i][1] = 16, at[i][i / POINTS ? 0 : 2] = 16;
    for (int every = 1; every <= 2; every++) {
        isogi_pyramid *pyramid = NULL;
        /* the floor ends where a node's box does: 1.5 voxels below the points, then 0.5 */
        for (int i = 0; i < SIDE * SIDE * SIDE; i++) ground[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] = i / SIDE % SIDE < 14 + every;
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        for (int path = 0; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = path ? ISOGI_DVR_SWEEP
                : ISOGI_DVR_BRUTE, .order = 1,
                                         .grid = {POINTS, POINTS, POINTS}, .visibility_step = path ? 2.0 / every : 0.25};
            isogi_dvr *dvr = renderer(desc, &transfer, &context);
            double error = 0;
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, 2 * POINTS, v[path]) == ISOGI_OK,
                  "step");
            isogi_dvr_free(dvr);
            for (int i = 0; i < 2 * POINTS; i++) error = fmax(error, fabs((double)v[path][i] - (double)v[0][i]));
            /* 0.19 and 0.18, of a lattice as coarse as this; without weights 0.61 and 0.53 */
            CHECK(error < 0.3, "path %d, %d nodes to a point: error %g of %g", path, every, error, (double)v[0][POINTS / 2]);
        }
        isogi_vol_free(pyramid);
    }
}

/* Uneven matter up to the border, grid points at every node of a lattice and at every other: what lies between them has no part in what
   arrives, and rays that stand outside count alike in both. Nor does matter overflow that no light gets through. */
TEST(sweeps_of_two_grids_agree_on_the_faces_of_a_full_box) {
    enum { SIDE = 33, POINTS = 6 * 17 * 17 };
    static float full[SIDE][SIDE][SIDE], at[POINTS][3], v[2][POINTS];
    static const float extinction[] = {0.3f, 2, 8, 1e19f, 1e37f};
    const isogi_volume volume = {.data = full, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    isogi_pyramid *pyramid = NULL;
    test_random r = {8};
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        full[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] = (float)random_range(&r, 0.2, 1);
    for (int i = 0; i < POINTS; i++) {
        int face = i / 17 / 17, a = face / 2;
        at[i][a] = (float)(face % 2 * (SIDE - 1)), at[i][(a + 1) % 3] = (float)(2 * (i % 17)),
        at[i][(a + 2) % 3] = (float)(2 * (i / 17 % 17));
    }
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int n = 0; n < 4 * 5; n++) {
        const isogi_context context = {.threads = 1, .force_path = 1 + n % 4};
        const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, extinction[n / 4]}};
        const isogi_transfer transfer = {p, 2, NULL, 0};
        double error = 0;
        int bad = 0;
        for (size_t every = 1; every <= 2; every++) {
            const size_t grid = (SIDE - 1) / every + 1;
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_SWEEP, .order = 1,
                .directions = 24,
                                         .grid = {grid, grid, grid}, .visibility_step = 1};
            isogi_dvr *dvr = renderer(desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, POINTS, v[every - 1]) == ISOGI_OK,
                  "step");
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < POINTS; i++) {
            uint32_t bits[2]; /* comparisons with what is not finite mean nothing under -ffast-math */
            memcpy(&bits[0], &v[0][i], sizeof bits[0]), memcpy(&bits[1], &v[1][i], sizeof bits[1]);
            bad += (bits[0] >> 23 & 255) == 255 || (bits[1] >> 23 & 255) == 255;
            error = fmax(error, fabs((double)v[0][i] - (double)v[1][i]));
        }
        CHECK(!bad, "extinction %g, path %d: %d of %d are not finite", (double)extinction[n / 4], 1 + n % 4, bad, POINTS);
        CHECK(error < 1e-5, "extinction %g, path %d: differ by %g", (double)extinction[n / 4], 1 + n % 4,
              error); /* float sums of 24 of up to 0.15 */
    }
    isogi_vol_free(pyramid);
}

/* Middles of faces and edges, and corners, of a box that is full of matter: towards what is outside nothing is in the way, wherever between
   two nodes of the lattice the rays of a sweep stand. Light is that of the same directions by brute force: half, a quarter, an eighth of
   the sphere, and what comes through the box. */
TEST(light_on_the_border_of_a_full_box_is_that_from_outside) {
    enum { SIDE = 25, POINTS = 26 };
    static float full[SIDE][SIDE][SIDE];
    static const float extinction[] = {0.05f, 0.3f, 2, 50};
    const isogi_volume volume = {.data = full, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    isogi_pyramid *pyramid = NULL;
    float at[POINTS][3], v[2][POINTS][9];
    int count = 0;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) full[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] = 1;
    for (int i = 0; i < 27; i++) {
        if (i == 13) continue; /* within */
        at[count][0] = (float)(i % 3 * 12), at[count][1] = (float)(i / 3 % 3 * 12), at[count++][2] = (float)(i / 9 * 12);
    }
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    printf("    largest errors of coefficients:");
    for (int n = 0; n < 4; n++) {
        double worst = 0;
        for (int way = 0; way <= 12; way++) { /* by brute force; on every path nodes at grid points, twice as many, and blocks */
            const isogi_context context = {.threads = 1, .force_path = way ? 1 + (way - 1) % 4 : 0};
            const isogi_transfer_point p = {1, {1, 1, 1}, extinction[n]};
            const isogi_transfer transfer = {&p, 1, NULL, 0};
            const size_t grid = way > 8 ? 9 : 7;
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {grid, grid, grid},
                                         .method = way ? ISOGI_DVR_SWEEP : ISOGI_DVR_BRUTE, .coarsest = way > 8 ? 8 : 1,
                                         .visibility_step = !way ? 0.25 : way <= 4 ? 4 : 2};
            isogi_dvr *dvr = renderer(desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, POINTS, v[way > 0][0]) == ISOGI_OK,
                  "step");
            isogi_dvr_free(dvr);
            for (int i = 0; way && i < 9 * POINTS; i++) {
                const float *q = at[i / 9];
                double error = fabs((double)v[1][i / 9][i % 9] - (double)v[0][i / 9][i % 9]);
                if (way > 8 && ((int)q[0] == 12 || (int)q[1] == 12 || (int)q[2] == 12)) continue; /* a block that is buried: its corners */
                CHECK(error < 0.02, "extinction %g, way %d, coefficient %d at %g %g %g: %g, not %g", (double)extinction[n], way, i % 9,
                      (double)q[0], (double)q[1], (double)q[2], (double)v[1][i / 9][i % 9], (double)v[0][i / 9][i % 9]);
                worst = fmax(worst, error);
            }
        }
        printf(" %.2g", worst);
    }
    printf("\n");
    isogi_vol_free(pyramid);
}

/* Leaves of two or three voxels behind a steep function, a hard case for sweeps, whose nodes hold extinction instead of values: mean light
   among them is that of brute force up to what the header says. */
TEST(fine_matter_errs_by_sweeps_as_stated) {
    enum { SIDE = 49, POINTS = 13, COUNT = POINTS * POINTS * POINTS };
    static float leaves[SIDE][SIDE][SIDE], at[COUNT][3], v[COUNT];
    static const double lattice[] = {0.25, 2, 1, 0.5}, least[] = {0, -0.04, -0.2, -0.07}; /* the first is brute force */
    const isogi_volume volume = {.data = leaves, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {0.6, {1, 1, 1}, 0}, {0.7, {1, 1, 1}, 0.3f}, {1, {1, 1, 1}, 0.5f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    isogi_pyramid *pyramid = NULL;
    double mean[4];
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        const double x = 0.9 * (i % SIDE), y = 0.8 * (i / SIDE % SIDE), z = 0.7 * (i / SIDE / SIDE);
        leaves[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] = (float)fmax(0, sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x) - 0.3);
    }
    for (int i = 0; i < COUNT; i++)
        at[i][0] = (float)(4 * (i % POINTS)), at[i][1] = (float)(4 * (i / POINTS % POINTS)), at[i][2] = (float)(4 * (i / POINTS / POINTS));
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int way = 0; way < 4; way++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .directions = 32,
                                     .method = way ? ISOGI_DVR_SWEEP : ISOGI_DVR_BRUTE, .grid = {POINTS, POINTS, POINTS},
                                     .visibility_step = lattice[way]};
        isogi_dvr *dvr = renderer(desc, &transfer, &serial);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, COUNT, v) == ISOGI_OK,
              "step");
        isogi_dvr_free(dvr), mean[way] = 0;
        for (int i = 0; i < COUNT; i++) mean[way] += (double)v[i] / COUNT;
        CHECK(mean[way] / mean[0] - 1 >= least[way] && mean[way] / mean[0] - 1 < 0.04, "lattice of %g voxels: %g, not %g", lattice[way],
              mean[way], mean[0]);
    }
    printf("    mean light by sweeps, lattice of 2, 1, 1/2 voxels: %+.2g, %+.2g, %+.2g of it\n", mean[1] / mean[0] - 1,
           mean[2] / mean[0] - 1, mean[3] / mean[0] - 1);
    isogi_vol_free(pyramid);
}

/* Notes the largest piece. */
static void *noting_alloc(void *user, size_t size, size_t align) {
    void *p = NULL;
    if (size > *(size_t *)user) *(size_t *)user = size;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void noting_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

/* Voxels twenty and a thousand times as long along two axes as along the third are swept with no more than two nodes each: as right as by
   brute force in small steps, and the largest piece of memory is that of the nodes. */
TEST(long_voxels_are_swept_with_few_nodes) {
    enum { SIDE = 25, POINTS = 9, COUNT = POINTS * POINTS * POINTS };
    static float waves[SIDE][SIDE][SIDE], at[COUNT][3], v[2][COUNT];
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE % SIDE, z = i / SIDE / SIDE;
        waves[z][y][x] = (float)(0.5 + 0.25 * sin(0.5 * x + 0.3 * z) + 0.25 * cos(0.4 * y - 0.2 * x) * sin(0.35 * z));
    }
    for (int length = 20; length <= 1000; length *= 50) {
        const isogi_volume volume = {
            .data = waves, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}, .spacing = {length, length, 1}};
        const isogi_transfer_point p[] = {
            {0.4, {1, 1, 1}, 0}, {0.6, {1, 1, 1}, 0.3f / sqrtf((float)length)}, {0.9, {1, 1, 1}, 0.05f / sqrtf((float)length)}};
        const isogi_transfer transfer = {p, 3, NULL, 0};
        isogi_pyramid *pyramid = NULL;
        size_t most = 0;
        double error = 0;
        const isogi_context context = {.threads = 1, .alloc = noting_alloc, .release = noting_release, .user = &most};
        for (int i = 0; i < COUNT; i++)
            at[i][0] = (float)(3 * length * (i % POINTS)), at[i][1] = (float)(3 * length * (i / POINTS % POINTS)),
            at[i][2] = (float)(3 * (i / POINTS / POINTS));
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        for (int way = 0; way < 2; way++) {
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .directions = 32,
                                         .method = way ? ISOGI_DVR_SWEEP : ISOGI_DVR_BRUTE, .grid = {POINTS, POINTS, POINTS},
                                         .visibility_step = way ? 0 : length < 100 ? 0.25 : 8};
            isogi_dvr *dvr = renderer(desc, &transfer, way ? &context : &serial);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, COUNT, v[way]) == ISOGI_OK,
                  "step");
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < COUNT; i++) error += pow((double)(v[1][i] - v[0][i]) / sqrt(4 * 3.14159265358979), 2) / COUNT;
        printf("    voxels of %d: rms error %.3g, largest piece of memory %zu kB\n", length, sqrt(error), most / 1000);
        CHECK(sqrt(error) < 0.02 && most < 4000000, "voxels of %d: rms error %g, largest piece of memory %zu bytes", length, sqrt(error),
              most);
        isogi_vol_free(pyramid);
    }
}

TEST(visibility_is_the_same_bits_for_any_threads_and_slicing) {
    isogi_pyramid *pyramid = linear_field();
    for (int method = ISOGI_DVR_PAPER; method <= ISOGI_DVR_SWEEP; method++) {
        float v[2][27 * 9], points[27][3];
        for (int i = 0; i < 27; i++)
            points[i][0] = (float)(24 * (i % 3)), points[i][1] = (float)(24 * (i / 3 % 3)), points[i][2] = (float)(24 * (i / 9));
        for (int n = 0; n < 2; n++) {
            const isogi_context two = {.threads = 2};
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                .directions = 20, .grid = {5, 3, 4}};
            isogi_dvr *dvr = renderer(desc, &ramp_transfer, n ? &two : &serial);
            double remaining = 1;
            while (remaining > 0) CHECK(isogi_dvr_step(dvr, n ? 100 : 0, &remaining) == ISOGI_OK, "step");
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, 27, v[n]);
            isogi_dvr_free(dvr);
        }
        CHECK(!memcmp(v[0], v[1], sizeof v[0]), "method %d", method);
    }
    isogi_vol_free(pyramid);
}

TEST(an_edit_computes_only_what_it_changes_and_light_computes_nothing) {
    isogi_pyramid *pyramid = linear_field();
    for (int method = ISOGI_DVR_PAPER; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
            .directions = 8, .grid = {3, 3, 3}, .reduction = 1};
        isogi_transfer_point high[] = {{50, {1, 1, 1}, 0}, {60, {1, 1, 1}, 0.3f}};
        const isogi_transfer edited = {high, 2, NULL, 0};
        isogi_dvr *dvr = renderer(desc, &edited, &serial);
        isogi_dvr_report before, after;
        isogi_counters count = {0}, again = {0};
        float image[64][4];
        const isogi_view view = {.width = 8, .height = 8, .eye = {100, 90, 120}, .target = {24, 24, 24}};
        const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 2, 3}, .rgb = {1, 1, 1}};
        const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
        isogi_dvr_step(dvr, 0, NULL), isogi_dvr_inspect(dvr, &before);
        CHECK(before.blocks_classified > 0 && before.blocks_classified < 20, "%d of 27 blocks", (int)before.blocks_classified);
        isogi_dvr_counters(dvr, &count);
        high[0].rgb[1] = 0.5f; /* colour alone, and light */
        isogi_dvr_set_transfer(dvr, &edited), isogi_dvr_step(dvr, 0, NULL);
        CHECK(isogi_dvr_render(dvr, &view, &lighting, image, NULL, NULL) == ISOGI_OK, "render");
        isogi_dvr_step(dvr, 0, NULL), isogi_dvr_counters(dvr, &again), isogi_dvr_inspect(dvr, &after);
        CHECK(again.rays == count.rays && after.blocks_classified == before.blocks_classified, "method %d: %d rays more", method,
              (int)(again.rays - count.rays));
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid);
}

/* Kronander 2011, 4.2: a ray of local visibility steps from node to node of the finest block around, so coarser ones need fewer samples. */
TEST(rays_of_local_visibility_take_steps_as_long_as_their_blocks_are_coarse) {
    isogi_pyramid *pyramid = linear_field();
    for (int level = 1; level <= 16; level *= 2) { /* all 27 blocks are of this level */
        const double voxels = (double)N * N * N;
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 8,
                                     .radius = 12, .grid = {3, 3, 3}, .reduction = voxels / (27.0 * level * level * level)};
        isogi_dvr *dvr = renderer(desc, &ramp_transfer, &serial);
        isogi_dvr_report report;
        isogi_counters count = {0};
        int at = 1;
        while (1 << (at - 1) < level) at++;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
        isogi_dvr_counters(dvr, &count);
        CHECK(report.level_count[at] == 27, "%d blocks of level %d", (int)report.level_count[at], level);
        CHECK(count.samples == (count.rays - 27 * 8) * (uint64_t)((12 * level + 15) / 16), "level %d: %.0f samples of %.0f rays", level,
              (double)count.samples, (double)count.rays); /* 27 * 8 rays are those of global visibility */
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid);
}

TEST(opacity_does_not_depend_on_the_step) {
    isogi_pyramid *pyramid = linear_field();
    const isogi_view view = {.width = 1, .height = 1, .eye = {200, 20, 22}, .target = {0, 20, 22}};
    double expected = 0; /* depth: the integral of extinction (f + 20) / 1000 from x = 0 to 48 at y = 20, z = 22 */
    expected = 48 * (24 + 0.37 * 20 - 0.2 * 22 + 20) / 1000;
    for (double step = 0.1; step < 20; step *= 2.3) {
        float pixel[1][4];
        const isogi_dvr_desc desc = {.pyramid = pyramid, .step = step};
        isogi_dvr *dvr = renderer(desc, &ramp_transfer, &serial);
        CHECK(isogi_dvr_render(dvr, &view, NULL, pixel, NULL, NULL) == ISOGI_OK, "render");
        CHECK(fabs((double)pixel[0][3] - (1 - exp(-expected))) < 1e-4, "step %g: %g", step,
              (double)pixel[0][3]); /* 1024 classes, float sums */
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid);
}

/* What is 0 in a description is what the header says: light and pictures are the same bits. */
TEST(zero_is_the_default_that_is_stated) {
    enum { POINTS = 200, W = 12 };
    isogi_pyramid *pyramid = linear_field();
    const isogi_view view = {.width = W, .height = W, .eye = {100, 90, 120}, .target = {24, 24, 24}};
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 2, 3}, .rgb = {1, 1, 1}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    for (int n = 0; n < 5; n++) { /* sweeps, brute force with a step of its own and without, the paper's method, data space */
        static float v[2][POINTS][9], points[POINTS][3], image[2][W * W][4];
        isogi_dvr_desc d[2];
        memset(d, 0, sizeof d);
        for (int k = 0; k < 2; k++) {
            d[k].pyramid = pyramid, d[k].shading = ISOGI_DVR_VISIBILITY;
            d[k].method = n == 0 ? ISOGI_DVR_METHOD_DEFAULT : n == 3 ? ISOGI_DVR_PAPER : ISOGI_DVR_BRUTE;
            if (n == 1) d[k].step = 0.7;
            if (n == 4) d[k].space = ISOGI_DVR_DATA, d[k].classification = ISOGI_DVR_POST_CLASSIFIED;
            if (n) d[k].directions = 16;
        }
        d[1].unit = 1, d[1].order = 3, d[1].opaque = 0.999f, d[1].coarsest = 1, d[1].radius = 16, d[1].reduction = 4, d[1].table = 256;
        d[1].tolerance = 0.5, d[1].grid[0] = d[1].grid[1] = d[1].grid[2] = 13; /* of 49 voxels */
        d[1].visibility_step = n == 0 ? 2 : n == 1 ? 1.4 : 1;
        if (!n) d[1].directions = 64, d[1].method = ISOGI_DVR_SWEEP;
        if (n != 1) d[1].step = n == 4 ? 0.5 : 1;
        for (int k = 0; k < 2; k++) {
            isogi_dvr *dvr = renderer(d[k], &ramp_transfer, &serial);
            test_random r = {9};
            for (int i = 0; i < POINTS; i++)
                for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, 0, N - 1);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, POINTS, v[k][0]) == ISOGI_OK, "sample");
            CHECK(isogi_dvr_render(dvr, &view, &lighting, image[k], NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr);
        }
        CHECK(!memcmp(v[0], v[1], sizeof v[0]), "case %d: visibility %g, not %g", n, (double)v[0][0][0], (double)v[1][0][0]);
        CHECK(!memcmp(image[0], image[1], sizeof image[0]), "case %d: pictures", n);
    }
    isogi_vol_free(pyramid);
}

/* ---- where pictures look visibility up ---- */

enum { ALONG = 4 }; /* points of the grid along each axis */

/* The mean of V at a place of the box, of the eight points around, each by its trilinear weight times 1 + w (min(1, 5 m)^2 - 1). */
static double weighed_visibility(double m[ALONG][ALONG][ALONG], const double place[3], const double size[3], double by) {
    double sum = 0, total = 0, u[3];
    int cell[3];
    for (int a = 0; a < 3; a++) {
        double x = fmin(fmax(place[a] / size[a], 0), 1) * (ALONG - 1);
        cell[a] = x < ALONG - 2 ? (int)x : ALONG - 2, u[a] = x - cell[a];
    }
    for (int k = 0; k < 8; k++) {
        double mean = m[cell[2] + (k >> 2)][cell[1] + (k >> 1 & 1)][cell[0] + (k & 1)], open = fmin(1, 5 * fmax(mean, 0.005));
        double w = (k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) * (k & 4 ? u[2] : 1 - u[2]) * (1 + by * (open * open - 1));
        sum += w * mean, total += w;
    }
    return sum / total;
}

/* Homogeneous matter under a sky of 1: the picture is the integral along the ray of what the header says, with visibility looked up
   r x^2 / (x^2 + 16) in front of each place, among open points the more the denser it is. On every path, by exact rays, and by samples. */
TEST(visibility_is_looked_up_in_front_of_dense_matter_among_open_points) {
    enum { X = 17, Y = 13, Z = 15, SIDE = 4 };
    static const double size[3] = {X - 1, Y - 1, Z - 1};
    static const float extinction[] = {0.1f, 0.4f, 0.8f, 3};
    static float filled[Z][Y][X];
    const isogi_volume volume = {.data = filled, .type = ISOGI_F32, .size = {X, Y, Z}};
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}};
    isogi_pyramid *pyramid = NULL;
    double worst[2] = {0, 0};
    for (int i = 0; i < X * Y * Z; i++) filled[i / X / Y][i / X % Y][i % X] = (float)(i % X);
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int n = 0; n < 4 * 6; n++) { /* paths 1 to 4, a bound, jitter */
        const int way = n / 4;
        const double tau = (double)extinction[n % 4];
        const isogi_context context = {.threads = 1, .force_path = way < 4 ? way + 1 : 0};
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {ALONG, ALONG, ALONG}, .step = 0.05,
                                     .visibility_step = 1, .opaque = 1, .bound = way == 4 ? 0.01 : 0, .jitter = way == 5,
                                     .directions = 128};
        const isogi_transfer_point point = {0, {1, 1, 1}, extinction[n % 4]};
        const isogi_transfer transfer = {&point, 1, NULL, 0};
        const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {30, 45, 60}, .target = {8, 6, 7}, .fov = 6};
        double m[ALONG][ALONG][ALONG];
        float image[SIDE * SIDE][4];
        isogi_dvr *dvr = renderer(desc, &transfer, &context);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        for (int i = 0; i < ALONG * ALONG * ALONG; i++) {
            const int at[3] = {i % ALONG, i / ALONG % ALONG, i / ALONG / ALONG};
            float p[3], v[9];
            for (int a = 0; a < 3; a++) p[a] = (float)(size[a] * at[a] / (ALONG - 1));
            CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])p, 1, v) == ISOGI_OK, "sample");
            m[at[2]][at[1]][at[0]] = (double)(v[0] / sky[0]);
        }
        CHECK(isogi_dvr_render(dvr, &view, &lighting, image, NULL, NULL) == ISOGI_OK, "render");
        isogi_dvr_free(dvr);
        for (int i = 0; i < SIDE * SIDE; i++) {
            enum { STEPS = 3000 };
            double o[3], from = 0, to = 1e9, sum = 0, square = 0, r, off, clear = 1;
            float d[3];
            isogi_view_ray(&view, i % SIDE, i / SIDE, o, d);
            for (int a = 0; a < 3; a++) {
                double near = (size[a] - o[a]) / (double)d[a], far = -o[a] / (double)d[a]; /* all components are negative */
                from = fmax(from, near), to = fmin(to, far);
                square += pow((double)d[a] * (ALONG - 1) / size[a], 2);
            }
            r = 1.5 / sqrt(square), off = r * pow(tau * r, 2) / (pow(tau * r, 2) + 16);
            for (int k = 0; k < STEPS; k++) {
                double t = from + (to - from) * pow((k + 0.5) / STEPS, 2), length = (to - from) * (2 * k + 1) / STEPS / STEPS, place[3];
                double lost = 1 - exp(-tau * length);
                for (int a = 0; a < 3; a++) place[a] = o[a] + fmax(t - off, from) * (double)d[a];
                sum += clear * lost * weighed_visibility(m, place, size, fmax(0, 2 * off / r - 1)), clear *= 1 - lost;
            }
            worst[way == 4] = fmax(worst[way == 4], fabs((double)image[i][0] - sum));
            /* exact rays look light up once in a cell */
            CHECK(fabs((double)image[i][0] - sum) < (way == 4 ? 2e-3 : 1e-4), "way %d, extinction %g, pixel %d: %g, not %g", way, tau, i,
                  (double)image[i][0], sum);
        }
    }
    printf("    largest difference of samples %.2g, of exact rays %.2g\n", worst[0], worst[1]);
    isogi_vol_free(pyramid);
}

/* Lamps of every kind, in and beside soft matter and a sky: pre-integrated pictures of every path are those of samples a sixteenth of a
   voxel apart, which isogi_sh_project lights one by one. */
TEST(lamps_light_pieces_of_rays_as_they_light_samples) {
    enum { SIDE = 33, W = 12 };
    static float ball[SIDE][SIDE][SIDE], image[2][W * W][4];
    const isogi_volume volume = {.data = ball, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    const float sky[3] = {1, 0.5f, 0.2f};
    const isogi_light lamps[4] = {
        {.kind = ISOGI_LIGHT_POINT, .vector = {60, 50, 40}, .rgb = {9000, 6000, 3000}},
        {.kind = ISOGI_LIGHT_POINT, .vector = {20, 27, 22}, .rgb = {400, 200, 300}},
        {.kind = ISOGI_LIGHT_SPHERE, .vector = {10, 45, 30}, .rgb = {4000, 2000, 3000}, .radius = 8},
        {.kind = ISOGI_LIGHT_RECTANGLE, .vector = {16, 16, 60}, .rgb = {3000, 5000, 4000}, .edge = {{-10, 0, 0}, {0, 10, 0}}}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {2, {1, 0.8f, 0.6f}, 0.03f}, {16, {0.6f, 0.8f, 1}, 0.3f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    const isogi_view view = {.width = W, .height = W, .eye = {70, 55, 80}, .target = {16, 16, 16}, .fov = 25};
    isogi_pyramid *pyramid = NULL;
    double worst = 0;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        ball[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] =
            (float)fmax(0, 14 - sqrt(pow(i % SIDE - 16, 2) + pow(i / SIDE % SIDE - 16, 2) + pow(i / SIDE / SIDE - 16, 2)));
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int n = 0; n < 5 * 2; n++) { /* each lamp, then all; orders 2 and 4 */
        const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = lamps + n % 5 % 4, .light_count = n % 5 < 4 ? 1 : 4};
        for (int path = 0; path <= 4; path++) { /* path 0: samples */
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2 + n / 5 * 2, .grid = {9, 9, 9},
                                         .step = path ? 0 : 0.0625, .visibility_step = 1, .opaque = 1,
                                         .classification = path ? ISOGI_DVR_EXACT : ISOGI_DVR_POST_CLASSIFIED};
            isogi_dvr *dvr = renderer(desc, &transfer, path ? &context : &serial);
            double sum = 0, norm = 0;
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            CHECK(isogi_dvr_render(dvr, &view, &lighting, image[path > 0], NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr);
            for (int i = 0; i < 3 * W * W; i++) {
                double x = (double)image[0][i / 3][i % 3], y = (double)image[path > 0][i / 3][i % 3];
                sum += (x - y) * (x - y), norm += x * x;
            }
            worst = fmax(worst, sqrt(sum / norm));
            CHECK(sqrt(sum / norm) < 0.007, "lamps %d, order %d, path %d: relative RMSE %g", n % 5, 2 + n / 5 * 2, path, sqrt(sum / norm));
        }
    }
    printf("    largest relative RMSE %.2g\n", worst);
    isogi_vol_free(pyramid);
}

/* The face of opaque matter, wherever between points of a coarse grid it lies, from above and aslant: half of a sky of 1, and up to .04
   more, as light is looked up in front of it and the matter ends at the sides; a sun has one brightness all over. */
TEST(the_face_of_opaque_matter_is_evenly_lit) {
    enum { SIDE = 33, W = 12 };
    static float ground[SIDE][SIDE][SIDE];
    const isogi_volume volume = {.data = ground, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}, .spacing = {4, 4, 1}};
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 0.5f, 2}, .rgb = {4, 4, 4}};
    const isogi_lighting light[2] = {{.env = {.sh = sky, .sh_order = 1}}, {.lights = &sun, .light_count = 1}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {0, {1, 1, 1}, 20}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    double range[2][2] = {{9, 0}, {9, 0}};
    for (int n = 0; n < 4; n++) {
        static const float heights[4] = {14, 15.9f, 16, 16.3f}; /* points of the grid are four apart, from 0 */
        const float height = heights[n];
        const isogi_dvr_desc desc = {.shading = ISOGI_DVR_VISIBILITY, .grid = {9, 9, 9}, .directions = 256};
        isogi_dvr_desc with = desc;
        isogi_pyramid *pyramid = NULL;
        for (int i = 0; i < SIDE * SIDE * SIDE; i++)
            ground[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] = height - (float)(i / SIDE / SIDE);
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        with.pyramid = pyramid;
        isogi_dvr *dvr = renderer(with, &transfer, &serial);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        for (int k = 0; k < 4; k++) { /* from above and aslant, sky and sun */
            isogi_view view = {.width = W, .height = W, .eye = {64, 64, 300}, .target = {64, 64, height}, .fov = 4};
            float image[W * W][4];
            if (k & 1) view.eye[0] = 464, view.eye[2] = height + 60, view.fov = 1;
            CHECK(isogi_dvr_render(dvr, &view, &light[k >> 1], image, NULL, NULL) == ISOGI_OK, "render");
            for (int i = 0; i < W * W; i++) {
                if (image[i][3] < 0.99f) continue;
                range[k >> 1][0] = fmin(range[k >> 1][0], (double)(image[i][0] / image[i][3]));
                range[k >> 1][1] = fmax(range[k >> 1][1], (double)(image[i][0] / image[i][3]));
            }
        }
        isogi_dvr_free(dvr), isogi_vol_free(pyramid);
    }
    CHECK(range[0][0] > 0.49 && range[0][1] < 0.55, "sky %g to %g", range[0][0], range[0][1]);
    CHECK(range[1][1] - range[1][0] < 0.02, "sun %g to %g", range[1][0], range[1][1]);
}

/* A plane without matter on either side, at eight places between the grid's points, an opaque one at first through one of them, seen from
   both sides, whether values rise or fall: an opaque one shows the light on the side that is seen. A translucent one that scatters
   evenly, of opacity .5, shows (1 - .5^2) / 2 / .5 of a sun before it and .5 log(2) / .5 of one behind, which its grid points know but
   roughly, and by nine harmonics, that overshoot by .15 of the sun. */
SLOW_TEST(sheets_are_lit_on_the_side_that_is_seen) {
    isogi_pyramid *pyramid = linear_field();
    const double slope[3] = {1, 0.37, -0.2}, length = sqrt(1 + 0.37 * 0.37 + 0.2 * 0.2);
    for (int k = 0; k < 8; k++) {
        const int space = k & 1, turned = k >> 1 & 1;
        const float opacity = k & 4 ? 0.5f : 1;
        double mean[2] = {0, 0};
        for (int place = 0; place < 8; place++) {
            const isogi_peak peak = {24 * (1 + 0.37 - 0.2) + 0.75 * length * (opacity < 1 ? place + 0.4 : place), {1, 1, 1}, opacity};
            const isogi_transfer transfer = {NULL, 0, &peak, 1};
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .space = (isogi_dvr_space)space, .order = 3,
                                         .grid = {9, 9, 9}, .directions = 64};
            isogi_dvr *dvr = renderer(desc, &transfer, &serial);
            isogi_view view = {.width = 1, .height = 1, .target = {24, 24, 24}};
            isogi_dvr_step(dvr, 0, NULL);
            for (int a = 0; a < 3; a++) view.eye[a] = 24 + (float)((turned ? -60 : 60) * slope[a] / length + (a == 1 ? 20 : 0));
            for (int behind = 0; behind < 2; behind++) {
                isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL};
                const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
                float pixel[1][4];
                for (int a = 0; a < 3; a++) sun.vector[a] = (float)(slope[a] * (turned == behind ? 1 : -1)), sun.rgb[a] = 12.5663706f;
                CHECK(isogi_dvr_render(dvr, &view, &lighting, pixel, NULL, NULL) == ISOGI_OK, "render");
                mean[behind] += (double)pixel[0][0] / (double)opacity / 8;
                CHECK(opacity < 1 || fabs((double)pixel[0][0] - !behind) < (behind ? 0.01 : 0.3),
                      "space %d, side %d, place %d: %g of a sun %s", space, turned, place, (double)pixel[0][0],
                      behind ? "behind" : "before");
            }
            isogi_dvr_free(dvr);
        }
        CHECK(opacity < 1 ? fabs(mean[0] - 0.75) < 0.25 && fabs(mean[1] - 0.69) < 0.25 && mean[0] > mean[1] : fabs(mean[0] - 1) < 0.2,
              "space %d, opacity %g, side %d: %.3f of a sun before it, %.3f of one behind", space, (double)opacity, turned, mean[0],
              mean[1]);
    }
    isogi_vol_free(pyramid);
}

/* An opaque sheet upon grid points: what it shows of light is that of the points before it, on either side, as it is where no point lies
   upon it. */
TEST(sheets_upon_grid_points_are_lit_from_their_own_side) {
    isogi_pyramid *pyramid = NULL;
    for (int i = 0; i < N * N * N; i++) data[i / N / N][i / N % N][i % N] = (float)(i % N);
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int back = 0; back < 2; back++) {
        const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {back ? 1 : -1, 0.2f, 0.1f}, .rgb = {3, 3, 3}};
        const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
        const isogi_view view = {.width = 1, .height = 1, .eye = {back ? 90 : -40, 20, 28}, .target = {24, 20, 28}};
        float pixel[2][1][4];
        for (int upon = 0; upon < 2; upon++) {
            const isogi_peak peak = {upon ? 24 : back ? 23 : 25, {1, 1, 1}, 1}; /* points at 0, 12, 24 ... */
            const isogi_transfer transfer = {NULL, 0, &peak, 1};
            const isogi_dvr_desc desc = {
                .pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 3, .grid = {5, 5, 5}, .directions = 64};
            isogi_dvr *dvr = renderer(desc, &transfer, &serial);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_render(dvr, &view, &lighting, pixel[upon], NULL, NULL) == ISOGI_OK,
                  "render");
            isogi_dvr_free(dvr);
        }
        CHECK(pixel[0][0][0] > 0.1f && fabsf(pixel[1][0][0] / pixel[0][0][0] - 1) < 0.3f, "side %d: light %g upon points, %g beside", back,
              (double)pixel[1][0][0], (double)pixel[0][0][0]);
    }
    isogi_vol_free(pyramid);
}

/* Within a closed opaque peak it is dark, whatever shines outside. */
TEST(closed_sheets_let_no_light_in) {
    isogi_pyramid *pyramid = NULL;
    for (int i = 0; i < N * N * N; i++) {
        const double d[3] = {i % N - 24.1, i / N % N - 23.8, i / N / N - 24.3};
        data[i / N / N][i / N % N][i % N] = (float)sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    const isogi_peak peak = {9.3, {1, 1, 1}, 1};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 3, .grid = {9, 9, 9}, .directions = 64};
    isogi_dvr *dvr = renderer(desc, &transfer, &serial);
    const float white[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_lighting sky = {.env = {.sh = white, .sh_order = 1}};
    test_random r = {3};
    isogi_dvr_step(dvr, 0, NULL);
    for (int i = 0; i < 40; i++) {
        isogi_view view = {.width = 1, .height = 1, .eye = {24.1f, 23.8f, 24.3f}};
        double d[3];
        float pixel[1][4];
        random_direction(&r, d);
        for (int a = 0; a < 3; a++) view.target[a] = view.eye[a] + (float)d[a];
        CHECK(isogi_dvr_render(dvr, &view, &sky, pixel, NULL, NULL) == ISOGI_OK && pixel[0][0] < 0.01f && pixel[0][3] > 0.99f,
              "ray %d: %g of opacity %g", i, (double)pixel[0][0], (double)pixel[0][3]);
    }
    isogi_dvr_free(dvr), isogi_vol_free(pyramid);
}

TEST_MAIN("dvr_visibility")
