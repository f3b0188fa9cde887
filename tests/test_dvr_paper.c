/* What Kronander 2011 and Kraus 2005 describe step by step: sphere sets, the order in which blocks are raised, pictures between steps,
   a bucky ball of tetrahedra. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

static double half_height(double x, double y, double z) { return (void)x, (void)y, z; }

static const char *const sphere_name[] = {"Fibonacci", "tetrahedron", "octahedron", "icosahedron"};

/* A place beside an opaque half space sees exactly half of the sphere: pi under the square root for the mean, sqrt(3 pi) / 2 up. And a slab
   of depth q above it lets exp(-q / cos) through, less where a ray leaves the box by a side before the slab's end: by a midpoint rule over
   80,000 directions. Each set of directions, by brute force and sweeps: some 35 of 500 parts of the sphere lie on the slab's horizon and
   count whole or not at all, wrong by .29 of a part each: sqrt(35) .29 / 500 = .34 % of 4 pi, times at most .49, is .021; 3.3 times that is
   allowed, and less than half of it where the slab takes half of the light or less. */
TEST(slabs_are_seen_by_every_set_of_directions) {
    enum { N = 49 };
    field f = field_of(half_height, N);
    const float place[] = {24, 24, 6};
    for (int opaque = 0; opaque < 2; opaque++) {
        const double low = 20 / 48.0, high = 28 / 48.0, depth = opaque ? 1e6 : 0.8;
        const isogi_transfer_point p[] = {
            {low, {1, 1, 1}, 0}, {low, {1, 1, 1}, (float)(depth / 8)}, {high, {1, 1, 1}, (float)(depth / 8)}, {high, {1, 1, 1}, 0}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        double expected[4] = {0};
        for (int i = 0; i < 200; i++)
            for (int j = 0; j < 400; j++) {
                double z = (i + 0.5) / 100 - 1, phi = (j + 0.5) * 2 * PI / 400, r = sqrt(1 - z * z), t0 = 14 / z, t1 = 22 / z, side,
                       clear = 1, d[3] = {r * cos(phi), r * sin(phi), z}, y[4];
                side = 24 / fmax(fabs(d[0]), fabs(d[1]));
                if (z > 0 && side > t0) clear = exp(-depth / 8 * (fmin(t1, side) - t0));
                isogi_sh_eval_f64(y, 2, (const double(*)[3])d, 1);
                for (int k = 0; k < 4; k++) expected[k] += clear * y[k] * 4 * PI / (200 * 400);
            }
        printf("    %s slab:", opaque ? "opaque" : "translucent");
        for (int s = 0; s <= 3; s++)
            for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method += 2) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                    .order = 2, .directions = 500, .sphere = (isogi_dvr_sphere)s,
                                             .grid = {3, 3, 9}, .visibility_step = 1};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                float v[4];
                double worst = 0;
                CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &place, 1, v) == ISOGI_OK, "step");
                for (int k = 0; k < 4; k++) worst = fmax(worst, fabs((double)v[k] - expected[k]));
                printf(" %s %.2g", sphere_name[s], worst);
                CHECK(worst < (opaque ? 0.07 : 0.03), "%s, %d rays, method %d: %g %g %g %g, not %g %g %g %g", sphere_name[s],
                      desc.directions, method, (double)v[0], (double)v[1], (double)v[2], (double)v[3], expected[0], expected[1],
                      expected[2], expected[3]);
                isogi_dvr_free(dvr);
            }
        printf("\n");
    }
    field_free(&f);
}

/* ---- local visibility ---- */

/* Between sheared axes a ray takes further along an axis than it does through the volume: what is that far away shadows, as a march along
   4000 rays says, the same bits for any number of threads. A shear by which rays would reach too far is refused. */
SLOW_TEST(local_visibility_follows_sheared_axes) {
    enum { NX = 33, NY = 100, NZ = 100, RAYS = 4000, AT = 48 };
    static float data[NX * NY * NZ];
    static const double cosine[3] = {0.8, 0.95, 0.98};
    static const isogi_transfer_point p[3] = {{0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0.3f}, {1, {1, 1, 1}, 0.3f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    for (int k = QUICK_SUITE; k < 3; k++) {
        const double sine = sqrt(1 - cosine[k] * cosine[k]), slab[2] = {AT + 17, AT + 16 / sine}; /* along y, beyond 16 voxels */
        isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {NX, NY, NZ}, .axes = {1, 0, 0, 0, 1, cosine[k], 0, 0, sine}};
        isogi_pyramid *pyramid = NULL;
        double grid[3] = {16, AT, AT}, world[3], sum = 0;
        float place[1][3], seen[2][9];
        for (int i = 0; i < NX * NY * NZ; i++) data[i] = i / NX % NY >= slab[0] && i / NX % NY <= slab[1];
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "cosine %g", cosine[k]);
        isogi_vol_to_world(pyramid, grid, world);
        for (int a = 0; a < 3; a++) place[0][a] = (float)world[a];
        for (int i = 0; i < RAYS; i++) {
            const double z = 1 - (2 * i + 1.0) / RAYS, r = sqrt(1 - z * z), angle = 2.399963229728653 * i;
            const double y = r * sin(angle), rise = y - z * cosine[k] / sine; /* voxels along y for each of the way */
            double depth = 0;
            for (int step = 0; step < 320; step++) {
                const double at = AT + rise * (step + 0.5) / 20;
                if (at >= slab[0] - 0.5 && at <= floor(slab[1]) + 0.5) depth += 0.3 / 20;
            }
            sum += exp(-depth) / RAYS;
        }
        for (int n = k != 1 || QUICK_SUITE; n < 2; n++) { /* of the second, on one thread and on two */
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {2, 2, 2}, .reduction = 1,
                .method = ISOGI_DVR_PAPER, .directions = 150};
            const isogi_context context = {.threads = 1 + n};
            isogi_dvr *dvr = NULL;
            isogi_result result = isogi_dvr_create(&dvr, &desc, &context);
            CHECK(result == (k == 2 ? ISOGI_TOO_LARGE : ISOGI_OK), "cosine %g: %s", cosine[k], isogi_result_string(result));
            if (k == 2) continue;
            CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_blocks(dvr, (const float(*)[3])place, 1, NULL, seen[n]) == ISOGI_OK,
                  "cosine %g", cosine[k]);
            isogi_dvr_free(dvr);
        }
        if (k < 2) {
            const double mean = (double)seen[1][0] / sqrt(4 * PI);
            printf("    cosine %.2f: %.4f of local light is hidden, %.4f by march\n", cosine[k], 1 - mean, 1 - sum);
            CHECK(fabs(mean - sum) < 0.05 * (1 - sum) && sum < 0.98 && (k != 1 || QUICK_SUITE || !memcmp(seen[0], seen[1], sizeof seen[0])),
                  "cosine %g: %g of local light is hidden, %g by march", cosine[k], 1 - mean, 1 - sum);
        }
        isogi_vol_free(pyramid);
    }
}

/* Matter of one extinction, seen from a voxel on a clip plane, along a face of the box and oblique: half of all rays leave it at once, the
   others see 8 of the smallest voxels of it, however long the others are, and whether blocks are held fine or coarse, as where all values
   look the same. 512 directions come as near to half as 1 %. */
TEST(matter_ends_at_planes_for_local_visibility) {
    enum { N = 17, HALF = N / 2 };
    static float data[N * N * N];
    for (int i = 0; i < N * N * N; i++) data[i] = (float)(0.5 + 0.4 * sin(0.7 * i));
    for (int length = QUICK_SUITE ? 4 : 1; length <= 4; length *= 4) {
        const isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {N, N, N}, .spacing = {length, 1, 1}};
        isogi_pyramid *pyramid = NULL;
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        for (int k = 0; k < 12; k += QUICK_SUITE ? 5 : 1) { /* along three axes, kept above or below */
            const int axis = k % 3, oblique = k / 3 % 2, coarse = k / 6;
            const float extinction = (const float[]){0.05f, 0.2f, 1}[k / 4];
            const isogi_transfer_point p[2] = {{0, {1, (float)coarse, 1}, extinction}, {1, {1, 1, 1}, extinction}};
            const isogi_transfer transfer = {p, 2, NULL, 0};
            const float place[1][3] = {{HALF * (float)length, HALF, HALF}};
            const double expected = 0.5 + 0.5 * exp(-HALF * (double)extinction);
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .grid = {3, 3, 3},
                .reduction = 1, .radius = HALF, .method = ISOGI_DVR_PAPER, .directions = 512};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            isogi_dvr_report report;
            double plane[1][4] = {{0}};
            float seen = 0;
            for (int a = 0; a < 3; a++) {
                plane[0][a] = (k & 1 ? -1 : 1) * (a == axis ? 1 : oblique ? 0.6 - 0.4 * a : 0);
                plane[0][3] -= plane[0][a] * (double)place[0][a];
            }
            CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])plane, 1) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_inspect(dvr, &report) == ISOGI_OK && report.level_count[coarse ? 1 : 5] == 1 &&
                      isogi_dvr_sample_blocks(dvr, place, 1, NULL, &seen) == ISOGI_OK,
                  "%zu blocks of level 1, %zu of 16", report.level_count[1], report.level_count[5]);
            CHECK(fabs((double)seen / sqrt(4 * PI) - expected) < 0.01,
                  "%s plane, axis %d, %s blocks, voxels of %d, extinction %g: %g, not %g", oblique ? "oblique" : "straight", axis,
                  coarse ? "coarse" : "fine", length, (double)extinction, (double)seen / sqrt(4 * PI), expected);
            isogi_dvr_free(dvr);
        }
        isogi_vol_free(pyramid);
    }
}

/* Two voxels from a plane through a block, on the face between two, and a little beyond that, where the block is not cut itself: rays of 8
   voxels see exp(-tau 2 / cos) outwards. Halves and 64 directions err by less than .01, blocks of one node by .16 and more. */
TEST(visibility_beside_a_plane_is_fine_in_any_block) {
    enum { N = 33 };
    static float data[N * N * N];
    static const double planes[] = {8, 16, 15.9, 15};
    const isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    const isogi_transfer_point p = {0, {1, 1, 1}, 0.2f};
    const isogi_transfer transfer = {&p, 1, NULL, 0};
    isogi_pyramid *pyramid = NULL;
    double expected = 0.5 * exp(-0.2 * 8);
    for (int i = 0; i < 1000; i++) expected += 0.5 * exp(-0.2 * fmin(8, 2 / ((i + 0.5) / 1000))) / 1000;
    CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 4; k++) {
        const double plane[1][4] = {{1, 0, 0, -planes[k]}};
        const float place[1][3] = {{(float)planes[k] + 2, 16, 16}};
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .grid = {3, 3, 3}, .radius = 8,
            .method = ISOGI_DVR_PAPER, .directions = 64};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float seen = 0;
        CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                  isogi_dvr_sample_blocks(dvr, place, 1, NULL, &seen) == ISOGI_OK,
              "step");
        CHECK(fabs((double)seen / sqrt(4 * PI) - expected) < 0.02, "beside %g: %g, not %g", planes[k], (double)seen / sqrt(4 * PI),
              expected);
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid);
}

/* Local visibility on every instruction path, in blocks of all levels, those that the border cuts thin and, for orders that are even, such
   as two planes cut among them: the paths add up a ray's
   depth in the same order, with or without fusing products, and hold it in halves. A coefficient is at most sqrt(4 pi), where halves lie
   2^-9 apart: one that is rounded the other way, and interpolation between such. Global visibility is a product of up to six local
   ones. */
TEST(every_path_has_the_same_local_visibility) {
    enum { PLACES = 400 };
    static float at[PLACES][3], v[5][2][PLACES * 36];
    field f = field_new(43, 37, 52);
    test_random r = {8};
    size_t levels[6] = {0};
    const isogi_transfer_point p[] = {{0.3, {1, 0.2f, 0.4f}, 0}, {0.5, {0.3f, 1, 0.4f}, 0.04f}, {1, {0.1f, 1, 1}, 0.3f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    for (size_t i = 0; i < field_count(&f); i++) { /* rough on one side, smooth on the other, empty beyond */
        double x = (double)(i % 43) / 42, z = (double)(i / 43 / 37) / 51;
        f.value[i] = z > 0.8 ? 0 : z + (x < 0.5 ? random_range(&r, 0, 0.5) : 0.1 * x);
    }
    field_build(&f);
    for (int i = 0; i < PLACES; i++)
        for (int a = 0; a < 3; a++) at[i][a] = (float)random_range(&r, -0.5, f.size[a] - 0.5);
    for (int order = 1; order <= 6; order += LONG_SUITE ? 1 : 3) {
        const size_t count = (size_t)(PLACES * order * order);
        for (int path = 1; path < 5; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER,
                .directions = LONG_SUITE ? 100 : 12, .order = order,
                .grid = {5, 4, 6}, .reduction = order % 2 ? 8 : 700, .radius = 9};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            isogi_dvr_report report;
            double most[2] = {0, 0}, least = 9;
            const double planes[2][4] = {{-1, 0.3, 0.2, 30}, {0.2, 1, -0.4, 2}};
            CHECK(isogi_dvr_set_clip(dvr, planes, order % 2 ? 0 : 2) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_inspect(dvr, &report) == ISOGI_OK &&
                      isogi_dvr_sample_blocks(dvr, (const float(*)[3])at, PLACES, NULL, v[path][0]) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[path][1]) == ISOGI_OK,
                  "path %d", path);
            for (int n = 1; n < 6; n++) levels[n] += report.level_count[n];
            for (int k = 0; k < 2; k++)
                for (size_t i = 0; i < count; i++) most[k] = fmax(most[k], fabs((double)v[path][k][i] - (double)v[1][k][i]));
            for (size_t i = 0; i < count; i += (size_t)(order * order)) least = fmin(least, (double)v[path][0][i]);
            CHECK(most[0] <= 0x1p-9 && most[1] <= 6 * 0x1p-9 && least < 2, "order %d, path %d: local %g, global %g off; at least %g", order,
                  path, most[0], most[1], least);
            isogi_dvr_free(dvr);
        }
    }
    for (int n = 1; n < 6; n++) CHECK(levels[n] > 0, "no block of level %d", 1 << (n - 1));
    field_free(&f);
}

/* What is not finite is as transparent as finite voxels that do not absorb, though the function absorbs at the lowest value that occurs. */
TEST(what_is_not_finite_throws_no_shadow) {
    enum { N = 32 };
    static float data[2][N * N * N];
    static const isogi_transfer_point p[3] = {{0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0.2f}, {100, {1, 1, 1}, 0.2f}};
    static const float places[3][3] = {{4, 15.5f, 15.5f}, {10, 15.5f, 15.5f}, {24, 15.5f, 15.5f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    float seen[2][3][9], values[3];
    for (int i = 0; i < N * N * N; i++)
        data[0][i] = i % N < 24 ? 0 : 1 + (float)(i % N), data[1][i] = i % N < 24 ? (i % 3 ? NAN : (float)HUGE_VAL) : data[0][i];
    for (int n = 0; n < 2; n++) {
        isogi_volume v = {.data = data[n], .type = ISOGI_F32, .size = {N, N, N}};
        isogi_pyramid *pyramid = NULL;
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "%d", n);
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {N, N, N}, .reduction = 1,
            .method = ISOGI_DVR_PAPER};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, places, 3, seen[n][0]) == ISOGI_OK &&
                  isogi_dvr_sample_blocks(dvr, places, 3, values, NULL) == ISOGI_OK && values[2] >= 25 && values[2] <= 25,
              "step: %g", (double)values[2]);
        isogi_dvr_free(dvr), isogi_vol_free(pyramid);
    }
    for (int i = 0; i < 3; i++)
        CHECK(fabsf(seen[1][i][0] - seen[0][i][0]) < 0.02f, "x %g: %g, of finite air %g", (double)places[i][0], (double)seen[1][i][0],
              (double)seen[0][i][0]);
}

/* ---- the order in which blocks are raised ---- */

/* CIE 1976 L*u*v* of a colour of sRGB's primaries, D65: from the definition, u' and v' of the white point by the same matrix. */
static void luv_of(const double rgb[3], double luv[3]) {
    static const double m[3][3] = {{0.4124564, 0.3575761, 0.1804375}, {0.2126729, 0.7151522, 0.0721750}, {0.0193339, 0.1191920, 0.9503041}};
    double c[3] = {0, 0, 0}, white[3] = {0, 0, 0}, l;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) c[i] += m[i][j] * rgb[j], white[i] += m[i][j];
    l = c[1] > 216 / 24389.0 ? 116 * cbrt(c[1]) - 16 : 24389 / 27.0 * c[1];
    double sum = c[0] + 15 * c[1] + 3 * c[2], whole = white[0] + 15 * white[1] + 3 * white[2];
    luv[0] = l;
    luv[1] = sum > 0 ? 13 * l * (4 * c[0] / sum - 4 * white[0] / whole) : 0;
    luv[2] = sum > 0 ? 13 * l * (9 * c[1] / sum - 9 * white[1] / whole) : 0;
}

static double luv_difference(const isogi_transfer *t, double a, double b) {
    double luv[2][3], sum = 0;
    for (int n = 0; n < 2; n++) {
        float rgb[3], extinction;
        double seen[3];
        isogi_transfer_at(t, n ? b : a, rgb, &extinction);
        for (int k = 0; k < 3; k++) seen[k] = (double)rgb[k] * (1 - exp(-(double)extinction));
        luv_of(seen, luv[n]);
    }
    for (int k = 0; k < 3; k++) sum += pow(luv[0][k] - luv[1][k], 2);
    return sqrt(sum);
}

/* 64 blocks around one value, each with a noise of its own. What a block gains by being raised is its significance, halved with each
   raise, for each point more: whatever the budget, no block that was raised had a smaller gain at a greater price than one that was not. */
TEST(blocks_are_raised_in_the_order_of_their_significance) {
    enum { N = 65, BLOCKS = 64 };
    field f = field_new(N, N, N);
    test_random r = {5};
    double significance[BLOCKS] = {0}, amplitude[BLOCKS];
    const isogi_transfer_point p[] = {{0, {0.1f, 0.2f, 1}, 0.02f}, {0.4, {0.2f, 1, 0.4f}, 0.3f}, {1, {1, 0.2f, 0.1f}, 1.5f}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    int raised = 0;
    for (int i = 0; i < BLOCKS; i++) amplitude[i] = 0.03 * pow(15, random_unit(&r));
    for (int i = 0; i < N * N * N; i++) {
        const int c[3] = {i % N, i / N % N, i / N / N};
        int block = c[0] / 16 + 4 * (c[1] / 16) + 16 * (c[2] / 16), face = c[0] % 16 == 0 || c[1] % 16 == 0 || c[2] % 16 == 0;
        f.value[i] = face ? 0.5 : 0.5 + (random_bits(&r) & 1 ? 1 : -1) * amplitude[block];
        if (!face) significance[block] = fmax(significance[block], luv_difference(&transfer, f.value[i], 0.5));
    }
    field_build(&f);
    for (double reduction = 1.5; reduction < 3000; reduction *= 1.9) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 8,
            .sphere = ISOGI_DVR_OCTAHEDRON, .order = 1, .grid = {2, 2, 2},
                                     .reduction = reduction};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_dvr_report report;
        CHECK(isogi_dvr_step(dvr, 64 * 64 * 8, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
        for (int a = 0; a < BLOCKS; a++)
            for (int b = 0; b < BLOCKS; b++) {
                int from = report.level[a] / 2, to = report.level[b]; /* a was raised from there; b was not from here */
                if (!from || to == 16) continue;
                double cost[2] = {7.0 * from * from * from, 7.0 * to * to * to},
                       gain[2] = {significance[a] / from / cost[0], significance[b] / to / cost[1]};
                /* 64 bins of values stand for the values: a quarter; means are those of wider boxes than blocks */
                if (cost[1] > cost[0]) continue;
                raised++;
                CHECK(gain[1] < 1.25 * gain[0], "reduction %g: block %d raised from %d for %g, block %d not from %d for %g", reduction, a,
                      from, gain[0], b, to, gain[1]);
            }
        isogi_dvr_free(dvr);
    }
    CHECK(raised > 1000, "%d comparisons", raised);
    field_free(&f);
}

/* Five blocks around one grey of luminance 0.1, each with another opaque colour besides. Differences in CIE L*u*v* (D65), from left to
   right: 19.2 of lightness (luminance 0.25), 20.8 of u*, 6.4 of lightness (luminance 0.14), 22.4 of lightness (luminance 0.02), 30.6 of v*.
   Neither hue differs in luminance, and luminance itself goes 0.15, 0, 0.04, 0.08, 0. Blocks are raised by the largest difference, all of
   them once before any is raised again, as their differences are within a factor of 16. */
TEST(hue_counts_as_lightness_does_when_levels_are_chosen) {
    enum { X = 81, Y = 17, BLOCKS = 5, PLACES = 11 };
    static const float colour[BLOCKS][3] = {{0.25f, 0.25f, 0.25f}, {0.1705f, 0.07903f, 0.1f}, {0.14f, 0.14f, 0.14f},
                                            {0.02f, 0.02f, 0.02f}, {0.09f, 0.0929f, 0.2f}};
    static const struct { int points; uint8_t level[BLOCKS]; } expected[] = {
        {5, {1, 1, 1, 1, 1}},  {12, {1, 1, 1, 1, 2}},  {19, {1, 1, 1, 2, 2}},  {26, {1, 2, 1, 2, 2}},  {33, {2, 2, 1, 2, 2}},
        {40, {2, 2, 2, 2, 2}}, {96, {2, 2, 2, 2, 4}},  {152, {2, 2, 2, 4, 4}}, {208, {2, 4, 2, 4, 4}}, {264, {4, 4, 2, 4, 4}},
        {320, {4, 4, 4, 4, 4}}};
    field f = field_new(X, Y, Y);
    isogi_transfer_point p[4 * BLOCKS + 2];
    const isogi_transfer transfer = {p, 4 * BLOCKS + 2, NULL, 0};
    for (int i = 0; i < 2 * BLOCKS + 1; i++) /* the colours at 0.08 to 0.4 from the middle, to both sides, each 0.04 wide */
        for (int end = 0; end < 2; end++) {
            isogi_transfer_point *q = &p[2 * i + end];
            q->value = 0.5 + 0.08 * (i - BLOCKS) + (end ? 0.02 : -0.02), q->extinction = 40;
            for (int a = 0; a < 3; a++) q->rgb[a] = i == BLOCKS ? 0.1f : colour[abs(i - BLOCKS) - 1][a];
        }
    for (int i = 0; i < X * Y * Y; i++) { /* a chequerboard, whose averages are the middle */
        const int x = i % X, y = i / X % Y, z = i / X / Y, face = x % 16 == 0 || y % 16 == 0 || z % 16 == 0;
        f.value[i] = face ? 0.5 : 0.5 + ((x + y + z) % 2 ? 0.08 : -0.08) * (1 + x / 16);
    }
    field_build(&f);
    for (int n = 0; n < PLACES; n++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .directions = 8,
                                     .order = 1, .grid = {2, 2, 2}, .reduction = X * Y * Y / (expected[n].points + 0.5)};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_dvr_report report;
        CHECK(isogi_dvr_step(dvr, 5 * 64 * 8, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "step");
        CHECK(!memcmp(report.level, expected[n].level, BLOCKS), "%d points: levels %d %d %d %d %d", expected[n].points, report.level[0],
              report.level[1], report.level[2], report.level[3], report.level[4]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- pictures between steps ---- */

/* More matter in an edit darkens every place: whatever has been stepped so far, pixels lie between the picture before and that after, and
   the picture comes nearer to it. Order 1, which does not ring. A hundredth, since light is interpolated with the weight of what grid
   points
   see: those that have grown dark weigh less against those whose turn has not come. */
TEST(pictures_between_steps_lie_between_old_and_new) {
    enum { N = 49, SIDE = 24 };
    field f = field_new(N, N, N);
    for (size_t i = 0; i < field_count(&f); i++) {
        double x = (double)(i % N) - 24, y = (double)(i / N % N) - 24, z = (double)(i / N / N) - 24;
        f.value[i] = sqrt(x * x + y * y + z * z);
    }
    field_build(&f);
    const isogi_transfer_point before[] = {{8, {1, 0.8f, 0.5f}, 0.05f}, {16, {0.5f, 0.8f, 1}, 0.02f}, {17, {0.5f, 0.8f, 1}, 0}};
    const isogi_transfer_point after[] = {{8, {1, 0.8f, 0.5f}, 0.3f}, {16, {0.5f, 0.8f, 1}, 0.05f}, {17, {0.5f, 0.8f, 1}, 0}};
    const isogi_transfer old = {before, 3, NULL, 0}, now = {after, 3, NULL, 0};
    const float white[6] = {1, 1, 1, 1, 1, 1};
    const isogi_lighting lighting = {.env = {.rgb = white, .width = 2, .height = 1}};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {90, 70, 100}, .target = {24, 24, 24}, .fov = 35};
    static float image[3][SIDE * SIDE][4];
    for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .order = 1,
            .directions = 48, .grid = {9, 9, 9}, .reduction = 2};
        isogi_dvr *dvr = dvr_new(&desc, &old), *fresh = dvr_new(&desc, &now);
        double remaining = 1, last = 1e30;
        int frames = 0, moved = 0;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK &&
                  isogi_dvr_set_transfer(dvr, &now) == ISOGI_OK,
              "edit");
        CHECK(isogi_dvr_render(dvr, &view, &lighting, image[0], NULL, NULL) == ISOGI_OK &&
                  isogi_dvr_render(fresh, &view, &lighting, image[1], NULL, NULL) == ISOGI_OK,
              "render");
        CHECK(rms_difference(image[0], image[1], SIDE * SIDE) > 0.02, "method %d: the edit changes little", method);
        while (remaining > 0) {
            double error;
            CHECK(isogi_dvr_step(dvr, 9000, &remaining) == ISOGI_OK &&
                      isogi_dvr_render(dvr, &view, &lighting, image[2], NULL, NULL) == ISOGI_OK,
                  "step");
            for (int i = 0; i < 4 * SIDE * SIDE; i++) {
                float a = image[0][i / 4][i % 4], b = image[1][i / 4][i % 4], x = image[2][i / 4][i % 4];
                CHECK(x >= fminf(a, b) - 0.01f && x <= fmaxf(a, b) + 0.01f, "method %d, %g left: pixel %d is %g, between %g and %g", method,
                      remaining, i / 4, (double)x, (double)a, (double)b);
            }
            error = rms_difference(image[1], image[2], SIDE * SIDE);
            CHECK(error <= last + 1e-6, "method %d, %g left: error %g after %g", method, remaining, error, last);
            moved += error < last - 1e-4 && remaining > 0, last = error, frames++;
        }
        CHECK(last < 1e-6 && frames > 3, "method %d: ends with an error of %g after %d frames", method, last, frames);
        if (method == ISOGI_DVR_BRUTE) CHECK(moved > 1, "brute force goes on point by point: %d", moved);
        isogi_dvr_free(dvr), isogi_dvr_free(fresh);
    }
    field_free(&f);
}

/* ---- budgets ---- */

static size_t most_tasks; /* of one call of parallel_for */
static void counted_for(void *user, size_t n, void (*task)(void *, size_t), void *arg) {
    (void)user;
    most_tasks = n > most_tasks ? n : most_tasks;
    for (size_t i = 0; i < n; i++) task(arg, i);
}

/* Voxels that an edit makes sweeps and blocks read anew count as rays: a small budget reads a plane or a block at a time, what is left
   falls
   with every step, and what is there in the end is what one step, or a renderer that knew no other function, has; bit for bit. */
TEST(what_is_read_after_a_change_counts_against_the_budget) {
    enum { N = 65, POINTS = 27 };
    field f = field_noise(N, 4);
    const isogi_context context = {.parallel_for = counted_for, .threads = 1};
    const isogi_transfer_point a[] = {{-1, {1, 1, 1}, 0}, {1, {1, 1, 1}, 0.1f}},
                               b[] = {{-0.5, {1, 1, 1}, 0}, {0.7, {1, 1, 1}, 0.05f}, {0.8, {1, 1, 1}, 0.2f}};
    const isogi_transfer first = {a, 2, NULL, 0}, second = {b, 3, NULL, 0};
    static float v[3][POINTS][4], points[POINTS][3];
    for (int i = 0; i < 3 * POINTS; i++) points[i / 3][i % 3] = (float)(i / 3 / (i % 3 == 0 ? 1 : i % 3 == 1 ? 3 : 9) % 3 * 32);
    for (int method = ISOGI_DVR_PAPER; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .order = 2,
            .directions = 16, .grid = {5, 5, 5}, .reduction = 20};
        for (int n = 0; n < 3; n++) { /* at once; in small steps; changed while the first is being read */
            isogi_dvr *dvr = dvr_new_with(&desc, n == 2 ? &first : &second, &context);
            double remaining = 2, last = 2;
            int steps = 0;
            if (!n) CHECK(isogi_dvr_step(dvr, 0, &last) == ISOGI_OK && !(last > 0), "at once");
            for (; n && remaining > 0; steps++) {
                if (n == 2 && steps == 5) last = isogi_dvr_set_transfer(dvr, &second) == ISOGI_OK ? 2 : 0;
                most_tasks = 0;
                CHECK(isogi_dvr_step(dvr, 1, &remaining) == ISOGI_OK, "step");
                CHECK(remaining < last && (remaining > 0 || steps > 30), "method %d: %g left after %g", method, remaining, last);
                if (steps < 12) CHECK(most_tasks == 1, "method %d, step %d: %zu planes or blocks at once", method, steps, most_tasks);
                last = remaining;
            }
            CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, POINTS, v[n][0]) == ISOGI_OK, "sample");
            isogi_dvr_free(dvr);
        }
        CHECK(!memcmp(v[0], v[1], sizeof v[0]) && !memcmp(v[0], v[2], sizeof v[0]), "method %d: steps end elsewhere", method);
        CHECK(v[0][13][0] > 0.1f && v[0][13][0] < 3.4f, "method %d: %g in the middle", method, (double)v[0][13][0]);
    }
    field_free(&f);
}

/* ---- a bucky ball of tetrahedra ---- */

/* 60 atoms at the corners of a truncated icosahedron: even permutations of (0, 1, 3g), (1, 2 + g, 2g), (g, 2, 2g + 1) with all signs. */
static double bucky_ball(double x, double y, double z) {
    const double g = 1.61803398874989484820, corner[3][3] = {{0, 1, 3 * g}, {1, 2 + g, 2 * g}, {g, 2, 2 * g + 1}};
    double at[3] = {(2 * x - 1) * 6.5, (2 * y - 1) * 6.5, (2 * z - 1) * 6.5}, sum = 0;
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 3; turn++)
            for (int sign = 0; sign < 8; sign++) {
                double d2 = 0;
                if (!k && sign & 1) continue; /* minus 0 */
                for (int a = 0; a < 3; a++) {
                    double c = corner[k][a] * (sign >> a & 1 ? -1 : 1) - at[(a + turn) % 3];
                    d2 += c * c;
                }
                sum += exp(-d2);
            }
    return sum;
}

/* Five tetrahedra to a cell, turned from cell to cell; in data space a surface has its opacity at every crossing, whatever the mesh. The
   field is linear in each: along a ray it is found again by a plain search for crossings of the piecewise linear field, tetrahedron by
   tetrahedron, in double. */
TEST(a_bucky_ball_of_tetrahedra_shows_every_crossing) {
    enum { N = 25, CELLS = (N - 1) * (N - 1) * (N - 1), SIDE = 20 };
    static const uint8_t corner[2][5][4] = {{{0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}, {1, 2, 4, 7}},
                                            {{1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}}};
    static float points[N * N * N][3], values[N * N * N], image[SIDE * SIDE][4];
    static uint32_t tets[5 * CELLS][4];
    const isogi_peak peak = {0.4, {1, 0.5f, 0.25f}, 0.3f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    const isogi_tet_mesh mesh = {(const float(*)[3])points, values, N * N * N, (const uint32_t(*)[4])tets, 5 * CELLS};
    const isogi_tet_desc desc = {.space = ISOGI_DVR_DATA, .opaque = 1};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {40, 33, 61}, .target = {12, 12, 12}, .fov = 25};
    isogi_tets *built = NULL;
    isogi_tet_report report;
    int many[6] = {0}, differ = 0;
    size_t count = 0;
    for (int i = 0; i < N * N * N; i++) {
        const int c[3] = {i % N, i / N % N, i / N / N};
        for (int a = 0; a < 3; a++) points[i][a] = (float)c[a];
        values[i] = (float)bucky_ball(c[0] / (N - 1.0), c[1] / (N - 1.0), c[2] / (N - 1.0));
        if (c[0] + 1 == N || c[1] + 1 == N || c[2] + 1 == N) continue;
        for (int t = 0; t < 5; t++, count++)
            for (int k = 0; k < 4; k++) {
                int b = corner[(c[0] + c[1] + c[2]) % 2][t][k];
                tets[count][k] = (uint32_t)(i + (b & 1) + N * ((b >> 1 & 1) + N * (b >> 2)));
            }
    }
    CHECK(isogi_dvr_tets_build(&built, &mesh, &report, &serial) == ISOGI_OK && !report.degenerate && !report.crowded &&
              report.border == 12 * (N - 1) * (N - 1),
          "build: %zu border", report.border);
    CHECK(isogi_dvr_tets_render(built, &desc, &transfer, &view, image, NULL, NULL) == ISOGI_OK, "render");
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double origin[3];
            float dir[3];
            int crossings = 0;
            isogi_view_ray(&view, x, y, origin, dir);
            for (size_t t = 0; t < count; t++) { /* value - isovalue where the ray enters and leaves */
                double e[3][3], g[3], o[3], det, w[2][3], enter = -1e30, leave = 1e30, low, high;
                const float *p0 = points[tets[t][0]];
                double apart[3], along = 0, across = 0;
                for (int a = 0; a < 3; a++) {
                    double turn = (double)points[tets[t][1]][a] + (double)points[tets[t][2]][a] - 2 * (double)p0[a];
                    apart[a] = floor((double)p0[a] + 0.5 * turn) + 0.5 - origin[a];
                }
                for (int a = 0; a < 3; a++) along += apart[a] * (double)dir[a], across += apart[a] * apart[a];
                if (across - along * along > 4) continue; /* far off */
                for (int k = 0; k < 3; k++)
                    for (int a = 0; a < 3; a++) e[k][a] = (double)points[tets[t][k + 1]][a] - (double)p0[a];
                det = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                      e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
                for (int a = 0; a < 3; a++) o[a] = origin[a] - (double)p0[a];
                for (int k = 0; k < 3; k++) { /* barycentric coordinates along the ray: w[0] + t w[1] */
                    const double *u = e[(k + 1) % 3], *v = e[(k + 2) % 3],
                                 n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
                    w[0][k] = (o[0] * n[0] + o[1] * n[1] + o[2] * n[2]) / det,
                    w[1][k] = ((double)dir[0] * n[0] + (double)dir[1] * n[1] + (double)dir[2] * n[2]) / det;
                }
                for (int k = 0; k < 4; k++) {
                    double at = k < 3 ? w[0][k] : 1 - w[0][0] - w[0][1] - w[0][2], by = k < 3 ? w[1][k] : -w[1][0] - w[1][1] - w[1][2];
                    if (by > 0) enter = fmax(enter, -at / by);
                    else if (by < 0) leave = fmin(leave, -at / by);
                    else if (at < 0) leave = -1e30;
                }
                if (!(enter < leave)) continue;
                for (int k = 0; k < 3; k++) g[k] = (double)values[tets[t][k + 1]] - (double)values[tets[t][0]];
                low = (double)values[tets[t][0]] - peak.isovalue, high = low;
                for (int k = 0; k < 3; k++) low += g[k] * (w[0][k] + enter * w[1][k]), high += g[k] * (w[0][k] + leave * w[1][k]);
                crossings += (low >= 0) != (high >= 0);
            }
            /* a crossing within rounding of a face may be seen by both sides or by none here */
            differ += fabs((double)image[x + SIDE * y][3] - (1 - pow(0.7, crossings))) > 1e-5;
            many[crossings < 5 ? crossings : 5]++;
        }
    printf("    pixels with 0, 1, 2, 3, 4, more crossings: %d %d %d %d %d %d\n", many[0], many[1], many[2], many[3], many[4], many[5]);
    CHECK(!differ && many[2] > 50 && many[4] > 50 && !many[1] && !many[3], "%d pixels differ", differ);
    isogi_dvr_tets_free(built);
}

/* Beside a voxel without a value blocks hold theirs up to the last voxel that has one. */
TEST(blocks_hold_the_voxels_beside_one_without_a_value) {
    field f = field_new(17, 17, 17);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1 + 0.1 * (double)(i % 17);
    *field_at(&f, 9, 8, 8) = (double)NAN;
    field_build(&f);
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.1f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 1,
                                 .directions = 8, .grid = {3, 3, 3}, .reduction = 1};
    const float at[4][3] = {{8, 8, 8}, {9, 7, 8}, {10, 8, 8}, {8.5f, 8, 8}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    float value[4];
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_blocks(dvr, at, 4, value, NULL) == ISOGI_OK, "step");
    for (int i = 0; i < 3; i++)
        CHECK(fabs((double)value[i] - (1 + 0.1 * (double)at[i][0])) < 1e-5, "at %g %g: %g", (double)at[i][0], (double)at[i][1],
              (double)value[i]);
    CHECK(!test_finite((double)value[3]), "%g between a voxel and one without a value", (double)value[3]);
    isogi_dvr_free(dvr), field_free(&f);
}

/* Local visibility is the paper's: pictures by it are refused where another method is at work. */
TEST(local_pictures_are_for_the_papers_method) {
    field f = field_waves(17, 3);
    isogi_view view = {.width = 2, .height = 2, .eye = {40, 8, 8}, .target = {8, 8, 8}, .local = 1};
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    for (int method = 0; method <= ISOGI_DVR_SWEEP; method++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .order = 1,
                                     .directions = 8, .grid = {3, 3, 3}};
        const isogi_transfer transfer = {hills, 6, NULL, 0};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float image[4][4];
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        const isogi_result result = isogi_dvr_render(dvr, &view, &sky, image, NULL, NULL);
        CHECK(result == (method == ISOGI_DVR_PAPER ? ISOGI_OK : ISOGI_INVALID), "method %d: %s", method, isogi_result_string(result));
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST_MAIN("dvr_paper")
