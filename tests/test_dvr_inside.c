/* What isogi_dvr.h keeps private, for what has no call: directions and their weights, marks of empty blocks, what the paper's method has
   read, the table of light, monotone pieces of rays. This program looks inside isogi_dvr.h.
   FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

/* ---- directions and their weights ---- */

static double constant(double x, double y, double z) { return (void)x, (void)y, (void)z, 2; }

/* With 2 (degree + 1)^2 <= rays the weights integrate every degree of the basis: V = 1 has no coefficient but the first. */
TEST(weights_of_visibility_rays_are_exact_and_positive) {
    field f = field_of(constant, 3);
    const struct { int order, rays; } cases[] = {{2, 32}, {3, 64}, {4, 98}, {4, 128}, {5, 256}, {6, 242}, {6, 2048}, {3, 32}, {6, 72}};
    for (int c = 0; c < 9; c++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = cases[c].order, .directions = cases[c].rays, .grid = {1, 1, 1}};
        isogi_dvr *dvr = NULL;
        CHECK(isogi_dvr_create(&dvr, &desc, &serial) == ISOGI_OK, "create");
        size_t n = dvr->coefficients;
        double most = 0;
        for (size_t k = 0; k < (size_t)cases[c].rays; k++)
            CHECK(dvr->kernel[k * n] > 0.3f / (float)cases[c].rays, "%d rays: weight %g", cases[c].rays, (double)dvr->kernel[k * n]);
        int exact = cases[c].rays >= 2 * (2 * cases[c].order - 1) * (2 * cases[c].order - 1);
        for (size_t i = 0; i < n; i++) {
            /* projecting basis function i has to return the unit vector */
            double sum[36] = {0};
            for (size_t k = 0; k < (size_t)cases[c].rays; k++) {
                double d[3] = {dvr->direction[k][3], dvr->direction[k][4], dvr->direction[k][5]}, y[36];
                isogi_sh_eval_f64(y, cases[c].order, (const double(*)[3])d, 1);
                for (size_t j = 0; j < n; j++) sum[j] += (double)dvr->kernel[k * n + j] * (exact ? y[i] : 2 * sqrt(PI) * y[0]);
            }
            for (size_t j = 0; j < n; j++) most = fmax(most, fabs(sum[j] - (exact ? i == j : j ? 0 : 2 * sqrt(PI))));
        }
        CHECK(most < 3e-6, "order %d, %d rays: error %g", cases[c].order, cases[c].rays, most);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

static const isogi_dvr_sphere spheres[] = {ISOGI_DVR_TETRAHEDRON, ISOGI_DVR_OCTAHEDRON, ISOGI_DVR_ICOSAHEDRON};
static const char *const sphere_name[] = {"Fibonacci", "tetrahedron", "octahedron", "icosahedron"};
static const int faces[] = {0, 4, 8, 20};

/* Directions of divided solids, weighed by their area: basis functions are orthonormal on them up to an error that falls with their
   number as a midpoint rule's does, like 1 / n. The tetrahedron's faces are the most distorted by projection. */
TEST(spherical_harmonics_are_orthonormal_on_divided_solids) {
    static const double c[] = {0, 44, 14, 3.5}; /* twice what is measured, for order 4; in the end 6.8, 6.8, 1.7 */
    field f = field_of(constant, 3);
    for (int s = 0; s < 3; s++) {
        printf("    %s:", sphere_name[spheres[s]]);
        for (int parts = 1; parts <= 10; parts = parts < 4 ? parts + 1 : parts + 3) {
            const int n = faces[spheres[s]] * parts * parts;
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 4, .directions = n,
                .sphere = spheres[s], .grid = {1, 1, 1}};
            isogi_dvr *dvr = NULL;
            double sum[16][16] = {{0}}, worst = 0, area = 0;
            CHECK(isogi_dvr_create(&dvr, &desc, &serial) == ISOGI_OK && dvr->desc.directions == n, "create");
            for (int k = 0; k < n; k++) {
                double d[3] = {dvr->direction[k][3], dvr->direction[k][4], dvr->direction[k][5]}, y[16];
                isogi_sh_eval_f64(y, 4, (const double(*)[3])d, 1);
                CHECK(fabs(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1) < 1e-6 && dvr->kernel[16 * k] > 0, "direction %d", k);
                for (int i = 0; i < 16; i++)
                    for (int j = 0; j < 16; j++) sum[i][j] += y[i] * (double)dvr->kernel[16 * k + j];
                area += (double)dvr->kernel[16 * k] * sqrt(4 * PI);
            }
            CHECK(fabs(area / (4 * PI) - 1) < 1e-6, "%d directions: area %g", n, area);
            for (int i = 0; i < 16; i++)
                for (int j = 0; j < 16; j++) worst = fmax(worst, fabs(sum[i][j] - (i == j)));
            printf(" %d: %.2g", n, worst);
            if (n >= 64) CHECK(worst < c[spheres[s]] / n, "%s, %d directions: %g", sphere_name[spheres[s]], n, worst);
            isogi_dvr_free(dvr);
        }
        printf("\n");
    }
    field_free(&f);
}

/* ---- empty blocks ---- */

TEST(stepping_over_empty_blocks_changes_no_bit) {
    for (int space = 0; space < 2; space++)
        for (uint64_t seed = 1; seed <= 6; seed++) {
            const int side = LONG_SUITE ? 48 : 24, pixels = side * side;
            field f = field_waves(40, seed);
            const double steps[] = {0.5, 0.31, 1.7, 0.5, 9, 0.77};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .shading = ISOGI_DVR_VISIBILITY,
                .step = steps[seed - 1],
                                         .directions = 20, .grid = {3, 3, 3}};
            const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
            isogi_dvr *dvr = dvr_new(&desc, &sparse);
            isogi_counters count[2] = {{0}, {0}};
            float(*image[2])[4], *depth = (float *)calloc(2 * (size_t)pixels, sizeof(float)), v[2][27 * 9];
            test_random r = {seed};
            isogi_view view = view_of(&f, 1, &r, side);
            for (int i = 0; i < 2; i++) {
                /* second time: every block counts as not empty */
                if (i) memset(dvr->empty_blocks, 0, dvr->block_count), dvr->transparent = 0, dvr->next = 0;
                isogi_dvr_step(dvr, 0, NULL);
                memcpy(v[i], dvr->visibility, sizeof v[i]);
                image[i] = picture(dvr, &view, &sky, depth + pixels * i, &count[i]);
            }
            CHECK(!memcmp(image[0], image[1], (size_t)pixels * sizeof *image[0]), "space %d seed %d: pixels differ by %g", space, (int)seed,
                  largest_difference(image[0], image[1], pixels));
            CHECK(!memcmp(depth, depth + pixels, (size_t)pixels * sizeof *depth), "space %d seed %d: depths differ", space, (int)seed);
            CHECK(!memcmp(v[0], v[1], sizeof v[0]), "space %d seed %d: visibility differs", space, (int)seed);
            CHECK(count[0].blocks_skipped > 0 && count[1].blocks_skipped == 0 &&
                      (count[0].samples + count[0].cells < count[1].samples + count[1].cells || steps[seed - 1] > 4),
                  "skipped %d, samples %d of %d", (int)count[0].blocks_skipped, (int)count[0].samples, (int)count[1].samples);
            CHECK(image[0][side * side / 2 + side / 2][3] >= 0, "opacity");
            for (int i = 0; i < 2; i++) free(image[i]);
            free(depth);
            isogi_dvr_free(dvr);
            field_free(&f);
        }
}

/* On the upper border the place in the cell is 1, and a + 1 * (b - a) rounds past b: no sample may leave the range of its cell and
   find extinction beyond it. */
TEST(samples_stay_within_the_range_of_their_cell) {
    test_random r = {19};
    for (int n = 0; n < 300; n++) {
        field f = field_new(3, 3, 3);
        double least = 1e9, largest = -1e9;
        for (int i = 0; i < 27; i++) {
            f.value[i] = random_range(&r, -1, 1) * pow(10, random_range(&r, -3, 3));
            least = fmin(least, f.value[i]), largest = fmax(largest, f.value[i]);
        }
        for (int k = 0; k < 3; k++) *field_at(&f, 2, 2, k) = n % 2 ? least : largest; /* the edge that the ray runs along */
        field_build(&f);
        const isogi_transfer_point points[] = {{nextafter(least, -1e9), {1, 1, 1}, 1}, {least, {1, 1, 1}, 0}, {largest, {1, 1, 1}, 0},
                                               {nextafter(largest, 1e9), {1, 1, 1}, 1}};
        const isogi_transfer transfer = {points, 4, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .step = 0.1, .classification = ISOGI_DVR_POST_CLASSIFIED};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const double eye[3] = {2, 2, 20}, target[3] = {2, 2, 0};
        memset(dvr->empty_blocks, 0, dvr->block_count), dvr->transparent = 0;
        pixel p = cast(dvr, eye, target, NULL);
        CHECK(p.c[3] <= 0, "volume %d: opacity %g", n, (double)p.c[3]);
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* The mark of a block against the largest extinction that a dense scan of its values finds. */
TEST(blocks_are_marked_empty_exactly_where_nothing_absorbs) {
    enum { N = 40 };
    isogi_transfer_point points[N];
    test_random r = {17};
    field f = field_waves(30, 9);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid};
    int marked = 0, unmarked = 0;
    for (int trial = 0; trial < (LONG_SUITE ? 30 : 15); trial++) {
        double x = random_range(&r, -1.5, 0);
        for (int i = 0; i < N; i++) {
            points[i] = (isogi_transfer_point){x, {1, 1, 1}, random_unit(&r) < 0.9 ? 0 : 1};
            x += random_unit(&r) < 0.2 ? 0 : random_range(&r, 0, 0.1);
        }
        const isogi_transfer transfer = {points, (size_t)(1 + trial % N), NULL, 0};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_level level = isogi_vol_level(f.pyramid, 0);
        for (size_t b = 0; b < level.size[0] * level.size[1] * level.size[2]; b++) {
            float most = 0, rgb[3], extinction;
            double low = (double)level.range[b][0], high = (double)level.range[b][1];
            for (int i = 0; i <= 400 + N; i++) {
                double at = i <= 400 ? low + (high - low) * i / 400 : points[i - 401].value;
                if (at < low || at > high) continue;
                isogi_transfer_at(&transfer, at, rgb, &extinction);
                most = fmaxf(most, extinction);
            }
            if (most > 0) unmarked++;
            else marked += dvr->empty[0][b];
            CHECK(!(most > 0) || !dvr->empty[0][b], "trial %d block %d has extinction %g and is marked empty", trial, (int)b, (double)most);
        }
        isogi_dvr_free(dvr);
    }
    CHECK(marked > 100 && unmarked > 100, "%d empty and %d others", marked, unmarked);
    field_free(&f);
}

/* What the marks of a box of voxels first..last are, by all its voxels: bit 0: none of the values between absorbs; bit 1: all are alike. */
static int marks_of(const uint8_t *data, const size_t size[3], const size_t first[3], const size_t last[3], const isogi_transfer *t) {
    double low = 999, high = -1, at[2];
    float rgb[2][3], extinction[2], most = 0;
    int alike = 1;
    for (size_t z = first[2]; z <= last[2]; z++)
        for (size_t y = first[1]; y <= last[1]; y++)
            for (size_t x = first[0]; x <= last[0]; x++) {
                const double value = data[x + size[0] * (y + size[1] * z)];
                low = fmin(low, value), high = fmax(high, value);
            }
    isogi_transfer_at(t, low, rgb[0], &extinction[0]), most = extinction[0];
    for (size_t i = 0; i <= t->point_count; i++) { /* the function is linear between these; no point lies at a value of a voxel */
        at[0] = i < t->point_count ? t->points[i].value : high;
        if (at[0] < low || at[0] > high) continue;
        if (i < t->point_count) {
            memcpy(rgb[1], t->points[i].rgb, sizeof rgb[1]), extinction[1] = t->points[i].extinction;
        } else isogi_transfer_at(t, at[0], rgb[1], &extinction[1]);
        most = fmaxf(most, extinction[1]);
        alike = alike && extinction[1] >= extinction[0] && extinction[1] <= extinction[0] && !memcmp(rgb[0], rgb[1], sizeof rgb[0]);
    }
    return (most > 0 ? 0 : 1) + 2 * alike;
}

static void reversed_for(void *user, size_t n, void (*task)(void *, size_t), void *arg) {
    (void)user;
    while (n--) task(arg, n);
}

/* Values in regions along x: most are empty, whole blocks of 64 cells among them; some of one colour, some of noise, some with a voxel here
   and there. */
static void fill_regions(uint8_t *data, const size_t size[3], uint64_t seed) {
    test_random r = {seed};
    for (size_t x = 0; x < size[0]; x++) {
        test_random here = {x / 23 + 7}, around = {x / 200 + 31};
        const uint64_t kind = random_bits(&around) % 2 ? 0 : random_bits(&here) % 8;
        for (size_t i = x; i < size[0] * size[1] * size[2]; i += size[0]) {
            const uint64_t bits = kind < 3 ? 0 : random_bits(&r);
            data[i] = (uint8_t)(kind < 3 ? 0 : kind == 3 ? bits % 10 : kind == 4 ? 20 + bits % 21
                                : kind == 5 ? bits >> 8 : bits % 300 ? 5 : 200);
        }
    }
}

/* Blocks to the nearest one that is not empty, up to 6. */
static int free_around(const isogi_dvr *d, const size_t at[3]) {
    const size_t *size = d->level[0].size;
    int least = 6;
    for (int i = 0; i < 13 * 13 * 13; i++) {
        const int to[3] = {i % 13 - 6, i / 13 % 13 - 6, i / 169 - 6}, far = abs(to[0]) > abs(to[1]) ? abs(to[0]) : abs(to[1]);
        const size_t x = at[0] + (size_t)to[0], y = at[1] + (size_t)to[1], z = at[2] + (size_t)to[2];
        const int distance = far > abs(to[2]) ? far : abs(to[2]);
        if (x < size[0] && y < size[1] && z < size[2] && distance < least && !d->empty[0][x + size[0] * (y + size[1] * z)])
            least = distance;
    }
    return least;
}

static size_t block_at(const isogi_dvr *d, int level, size_t x, size_t y, size_t z) {
    return x + d->level[level].size[0] * (y + d->level[level].size[1] * z);
}

/* Marks of a renderer, of every so many blocks below the highest level, against plain loops; count: of blocks by their mark, and of steady
   ones. */
static int wrong_marks(const isogi_dvr *d, const isogi_transfer *transfer, size_t every, size_t count[5]) {
    const uint8_t *data = (const uint8_t *)d->volume.data;
    int wrong = 0;
    for (int n = 2; n >= 0; n--) { /* level 0 says of those above, too */
        const isogi_level *level = &d->level[n];
        size_t at[3], i = 0;
        for (at[2] = 0; at[2] < level->size[2]; at[2]++)
            for (at[1] = 0; at[1] < level->size[1]; at[1]++)
                for (at[0] = 0; at[0] < level->size[0]; at[0]++, i++) {
                    size_t first[3], last[3], up[3];
                    int mark, out = 0;
                    if (n < 2 && i % every) continue;
                    for (int a = 0; a < 3; a++) {
                        first[a] = at[a] * (size_t)level->cells, last[a] = first[a] + (size_t)level->cells;
                        if (last[a] > d->volume.size[a] - 1) last[a] = d->volume.size[a] - 1;
                        up[a] = at[a] * (size_t)level->cells / 16;
                    }
                    mark = marks_of(data, d->volume.size, first, last, transfer);
                    if (n < 2) out = d->cut[block_at(d, 1, up[0], up[1], up[2])] == 2;
                    int empty = (mark & 1) || out;
                    for (int k = 1; k < 3 && empty && !n; k++)
                        empty += d->empty[k][block_at(d, k, at[0] >> 2 * k, at[1] >> 2 * k, at[2] >> 2 * k)];
                    wrong += d->empty[n][i] != empty || d->steady[n][i] != mark >> 1;
                    if (!n) count[empty]++, count[4] += (size_t)(mark >> 1), wrong += d->leap[i] != free_around(d, at);
                }
    }
    return wrong;
}

/* Memory that holds no marks. */
static void *odd_alloc(void *user, size_t size, size_t align) {
    void *p = NULL;
    (void)user;
    return posix_memalign(&p, align < 64 ? 64 : align, size) ? NULL : memset(p, 0x55, size);
}
static void odd_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

/* Many blocks, marked in pieces of 8192, by one thread up to 16384 and by several from there on; their number a multiple of the pieces, a
   highest level of 64 blocks and more. All marks, planes included, against plain loops over all voxels and all blocks around, and the same
   bits for one thread, four, and a scheduler that begins with the last task. */
TEST(marks_of_many_blocks_are_those_of_plain_loops) {
    static const struct { size_t size[3], blocks; } cases[] = {
        {{14169, 5, 9}, 8192}, {{4101, 17, 17}, 16722}, {{1769, 25, 25}, 16384}};
    static const isogi_transfer_point p[] = {{9.5, {1, 1, 1}, 0}, {19.5, {1, 0, 1}, 1}, {40.5, {1, 0, 1}, 1}, {40.5, {1, 1, 1}, 0},
                                             {99.5, {1, 1, 1}, 0}, {120.5, {0, 1, 1}, 0.5f}, {180.5, {0, 1, 0}, 0.5f}};
    static const double planes[1][4] = {{1, 0.25, 0, -100}};
    const isogi_transfer transfer = {p, 7, NULL, 0};
    for (int c = !LONG_SUITE; c < (LONG_SUITE ? 3 : 2); c++) { /* of 16722 in the quick run */
        const size_t *size = cases[c].size;
        uint8_t *data = (uint8_t *)malloc(size[0] * size[1] * size[2]);
        const isogi_volume v = {.data = data, .type = ISOGI_U8, .size = {size[0], size[1], size[2]}};
        const isogi_context contexts[3] = {{.threads = 1, .alloc = odd_alloc, .release = odd_release},
                                           {.threads = 4, .alloc = odd_alloc, .release = odd_release}, {.parallel_for = reversed_for}};
        isogi_pyramid *pyramid = NULL;
        isogi_dvr *dvr[3] = {NULL};
        fill_regions(data, size, 19);
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        for (int clip = 0; clip < 2; clip++)
            for (int way = 0; way < 3; way++) {
                const isogi_dvr_desc desc = {.pyramid = pyramid};
                size_t count[5] = {0};
                if (!clip) dvr[way] = dvr_new_with(&desc, &transfer, &contexts[way]);
                else CHECK(isogi_dvr_set_clip(dvr[way], planes, 1) == ISOGI_OK, "planes");
                const size_t blocks = dvr[way]->block_count, *fine = dvr[way]->level[0].size, leaps = fine[0] * fine[1] * fine[2];
                CHECK(blocks == cases[c].blocks, "%zu blocks", blocks);
                if (way)
                    CHECK(!memcmp(dvr[way]->empty_blocks, dvr[0]->empty_blocks, 2 * blocks) && !memcmp(dvr[way]->leap, dvr[0]->leap, leaps),
                          "case %d, way %d: other marks", c, way);
                else {
                    const int wrong = wrong_marks(dvr[way], &transfer, LONG_SUITE ? 1 : 19, count);
                    CHECK(!wrong, "case %d, planes %d: %d marks are wrong", c, clip, wrong);
                    for (int k = 0; k < 5; k++) CHECK(count[k] > 10, "case %d: %zu blocks of kind %d", c, count[k], k);
                }
            }
        for (int way = 0; way < 3; way++) isogi_dvr_free(dvr[way]);
        isogi_vol_free(pyramid), free(data);
    }
}

static size_t all_tasks; /* of all calls of parallel_for */
static void summed_for(void *user, size_t n, void (*task)(void *, size_t), void *arg) {
    (void)user, all_tasks += n;
    for (size_t i = 0; i < n; i++) task(arg, i);
}

/* Blocks that a transparent function drops are not read, between functions or at first; a function that shows them has them read. */
TEST(what_is_transparent_is_not_read) {
    field f = field_noise(LONG_SUITE ? 65 : 33, 4);
    const isogi_context context = {.parallel_for = summed_for, .threads = 1};
    const isogi_transfer_point a[] = {{-1, {1, 1, 1}, 0}, {1, {1, 1, 1}, 0}}, b[] = {{-0.5, {1, 1, 1}, 0}, {0.8, {1, 1, 1}, 0.2f}},
                               c[] = {{-0.7, {1, 1, 1}, 0}, {0.6, {1, 1, 1}, 0.2f}};
    const isogi_transfer clear = {a, 2, NULL, 0}, first = {b, 2, NULL, 0}, second = {c, 2, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 2,
        .directions = 16, .grid = {5, 5, 5}, .reduction = 20};
    const float middle = (float)(f.size[0] / 2), place[] = {middle, middle, middle};
    float v[2][4];
    for (int before = 0; before < 3; before++) { /* nothing; a function whose voxels are read in part; one that is done */
        isogi_dvr *dvr = dvr_new_with(&desc, before ? &first : &clear, &context), *fresh = dvr_new_with(&desc, &second, &context);
        double remaining = 1;
        CHECK(!before || isogi_dvr_step(dvr, before == 1, NULL) == ISOGI_OK, "step");
        const size_t counted = dvr->blocks.counted;
        CHECK(counted == (before == 0 ? 0u : before == 1 ? 1u : dvr->blocks.total) &&
            isogi_dvr_set_transfer(dvr, &clear) == ISOGI_OK, "%zu blocks read", counted);
        all_tasks = 0;
        CHECK(isogi_dvr_step(dvr, 1, &remaining) == ISOGI_OK && !(remaining > 0), "transparent: %g left", remaining);
        /* data laid out for five levels, of no block */
        CHECK(dvr->blocks.counted == counted && all_tasks <= 5 * dvr->blocks.total && !dvr->blocks.data_count, "%zu tasks for %zu blocks",
              all_tasks, dvr->blocks.total);
        CHECK(isogi_dvr_set_transfer(dvr, &second) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                  isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK,
              "step");
        CHECK(isogi_dvr_sample_visibility(dvr, &place, 1, v[0]) == ISOGI_OK &&
                  isogi_dvr_sample_visibility(fresh, &place, 1, v[1]) == ISOGI_OK,
              "sample");
        CHECK(dvr->blocks.counted == dvr->blocks.total && !memcmp(v[0], v[1], sizeof v[0]) && v[0][0] < 3.4f, "%g, not %g", (double)v[0][0],
              (double)v[1][0]);
        isogi_dvr_free(dvr), isogi_dvr_free(fresh);
    }
    field_free(&f);
}

/* ---- the table of light ---- */

/* A shell with a hole, haze in it: dark, buried and open points side by side. */
static double cave(double x, double y, double z) {
    double u = x - 0.5, v = y - 0.5, w = z - 0.5, r = sqrt(u * u + v * v + w * w), shell = 1 - fabs(r - 0.45) / 0.03;
    if (v > 0.25 && u * u + w * w < 0.04) shell = 0;
    return r < 0.36 ? fmax(shell, 0.05) : fmax(shell, 0);
}

static const isogi_transfer_point solid[] = {
    {0, {1, 1, 1}, 0}, {0.02, {1, 1, 1}, 0}, {0.03, {1, 1, 1}, 0.006f}, {0.1, {1, 1, 1}, 0.006f}, {0.25, {0.8f, 0.5f, 0.3f}, 2}};
static const isogi_transfer scenery = {solid, 5, NULL, 0};

/* Light of a picture, openness and all, is the same on both sides of every face between blocks: beside buried points it changes
   by a thousandth within 2e-5 voxels. */
TEST(the_table_of_light_has_no_seams) {
    enum { N = 65 };
    field f = field_of(cave, N);
    const isogi_dvr_desc desc = {
        .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = 24, .grid = {N, N, N}, .coarsest = 8};
    const isogi_light sun = {.vector = {1, 2, 0.7f}, .rgb = {3, 3, 3}};
    const isogi_lighting outdoors = {.env = {.sh = sky_one, .sh_order = 1}, .lights = &sun, .light_count = 1};
    const isogi_view slanting = {.width = 48, .height = 48, .eye = {140, 110, 170}, .target = {32, 28, 32}};
    isogi_dvr *dvr = dvr_new(&desc, &scenery);
    isogi_dvr__render_job job;
    isogi_dvr__fast_ray ray;
    test_random r = {3};
    double most = 0, brightest = 0;
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    memset(&job, 0, sizeof job), memset(&ray, 0, sizeof ray);
    job.dvr = dvr, job.view = &slanting;
    CHECK(isogi_dvr__set_lights(&job.lights, dvr, &outdoors) == ISOGI_OK && isogi_dvr__begin_frame(&job) == ISOGI_OK, "begin");
    CHECK(job.fast.frame.light && job.fast.frame.held.block, "no table of light in several resolutions");
    CHECK(job.fast.frame.open, "nothing is dense");
    for (int i = 0; i < 50000; i++) {
        float light[2][4], p[3];
        for (int a = 0; a < 3; a++) p[a] = (float)random_range(&r, 0, N - 1);
        p[i % 3] = 8 * (float)(1 + random_bits(&r) % 7);
        for (int n = 0; n < 2; n++) {
            for (int a = 0; a < 3; a++) ray.origin[a] = p[a] + (a == i % 3 ? n ? 1e-5f : -1e-5f : 0);
            isogi_dvr__fast_light(&job.fast.frame, &ray, 0, 0.5f * (float)(i / 3 % 3), light[n]);
        }
        for (int a = 0; a < 3; a++) {
            most = fmax(most, fabs((double)light[0][a] - (double)light[1][a]));
            brightest = fmax(brightest, (double)light[0][a]);
        }
    }
    printf("    brightest light %.3g, largest step %.2g\n", brightest, most);
    CHECK(most < 2e-3 * brightest && brightest > 0.1, "a step of %g in light of up to %g", most, brightest);
    isogi_dvr__end_frame(&job);
    isogi_release(&serial, job.lights.list, job.lights.count, sizeof *job.lights.list);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* ---- monotone pieces of rays ---- */

TEST(monotone_pieces_are_found_exactly) {
    test_random r = {15};
    int by_count[3] = {0, 0, 0};
    double worst = 0;
    for (int n = 0; n < (LONG_SUITE ? 2000000 : 40000); n++) {
        double b[4], u[2], scale = pow(10, random_range(&r, -30, 30));
        for (int i = 0; i < 4; i++) b[i] = n % 3 ? random_range(&r, -1, 1) : (double)((int)(random_bits(&r) % 5) - 2);
        for (int i = 0; i < 4; i++) b[i] *= scale;
        int found = isogi_dvr__extrema(b, u), expected = 0;
        long double d0 = (long double)b[1] - (long double)b[0], d1 = (long double)b[2] - (long double)b[1],
                    d2 = (long double)b[3] - (long double)b[2];
        long double a = d0 - 2 * d1 + d2, h = d1 - d0, root = h * h - a * d0, at[2];
        if (fabsl(root) < 1e-12L * h * h) continue; /* an inflection with a level tangent: both answers are right */
        if (root > 0) { /* two roots of a u^2 + 2 h u + d0, each by the formula that does not cancel */
            long double q = h > 0 ? -h - sqrtl(root) : sqrtl(root) - h, x[2] = {a < 0 || a > 0 ? q / a : 2, q < 0 || q > 0 ? d0 / q : 2};
            for (int i = 0; i < 2; i++)
                if (x[i] > 1e-12L && x[i] < 1 - 1e-12L) at[expected++] = x[i];
            if (expected == 2 && at[0] > at[1]) root = at[0], at[0] = at[1], at[1] = root;
        }
        /* on an end itself rounding decides: then the piece beyond it has no length */
        for (int i = found; i-- > 0;)
            if (!(u[i] > 1e-12 && u[i] < 1 - 1e-12)) u[0] = u[1 - i], found--;
        by_count[expected]++;
        CHECK(found == expected, "%g %g %g %g: %d extrema, not %d", b[0], b[1], b[2], b[3], found, expected);
        for (int i = 0; i < found && found == expected; i++) {
            double error = fabs(u[i] - (double)at[i]);
            worst = fmax(worst, error);
            CHECK(error < 1e-8, "extremum at %.17g, not %.17Lg", u[i], at[i]); /* a double root: the square root of a rounding error */
        }
    }
    printf("    cubics with 0, 1, 2 extrema: %d %d %d; worst place %.2g\n", by_count[0], by_count[1], by_count[2], worst);
    CHECK(by_count[1] > 1000 && by_count[2] > 1000, "%d %d", by_count[1], by_count[2]);
}

/* Pieces join: each begins at the place and the value with which the last one ends, from the entry of the box to its exit; within each the
   value goes one way. */
TEST(monotone_pieces_cover_the_ray_without_a_gap) {
    test_random r = {16};
    for (int n = 0; n < 300; n++) {
        field f = field_noise(n % 2 ? 6 : 3, (uint64_t)n);
        const isogi_transfer_point everywhere = {0, {1, 1, 1}, 1};
        const isogi_transfer transfer = {.points = &everywhere, .point_count = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        double eye[3], target[3], dir[3], at = 0, value = 0;
        random_line(&f, &r, eye, target);
        if (n % 5 == 0) eye[0] = target[0], eye[1] = target[1] = floor(target[1]); /* along faces */
        if (n % 7 == 0) for (int a = 0; a < 3; a++) eye[a] = -2, target[a] = 1;      /* through voxels, corner to corner */
        for (int a = 0; a < 3; a++) dir[a] = target[a] - eye[a];
        isogi_dvr__march m;
        isogi_dvr__walk w;
        isogi_dvr__stretch p;
        if (isogi_dvr__begin(&m, dvr, eye, dir, sqrt(isogi_dvr__dot(dir, dir)), 1e300, 0.5)) {
            int pieces = 0;
            isogi_dvr__begin_walk(&w, &m);
            while (isogi_dvr__next_monotone(&w, &p)) {
                CHECK(p.from >= at - 1e-15 * m.length && p.from <= at + 1e-12 * m.length, "piece %d begins at %.17g, not %.17g", pieces,
                      p.from, at);
                if (pieces)
                    CHECK(!(p.value[0] < value) && !(p.value[0] > value), "piece %d begins with %.17g, not %.17g", pieces, p.value[0],
                          value);
                for (int i = 0; i < 8; i++) {
                    double u0 = p.u0 + (p.u1 - p.u0) * i / 8, u1 = p.u0 + (p.u1 - p.u0) * (i + 1) / 8;
                    double step = isogi_dvr__bernstein(p.b, u1) - isogi_dvr__bernstein(p.b, u0);
                    CHECK(step * (p.value[1] - p.value[0]) >= -1e-15, "piece %d goes from %g to %g, and once by %g", pieces, p.value[0],
                          p.value[1], step);
                }
                at = p.to, value = p.value[1], pieces++;
            }
            CHECK(fabs(at - m.length) < 1e-12 * m.length, "pieces end at %.17g of %.17g", at, m.length);
        }
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* Axes scaled each by its own factor, and the rays along with them: the same cells, the same cubics, the same pixels. */
TEST(scaling_each_axis_along_with_the_rays_changes_nothing) {
    test_random r = {10};
    uint64_t passed = 0;
    for (int n = 0; n < 60; n++) {
        field f = field_noise(8, (uint64_t)n);
        double scale[3], eye[2][3], target[2][3];
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &landscape);
        random_line(&f, &r, eye[0], target[0]);
        isogi_view view = line_of_sight(eye[0], target[0]);
        isogi_counters count = {0};
        pixel p;
        CHECK(isogi_dvr_render(dvr, &view, NULL, (float(*)[4])p.c, NULL, &count) == ISOGI_OK, "render");
        isogi_dvr_free(dvr), isogi_vol_free(f.pyramid);
        for (int a = 0; a < 3; a++) {
            scale[a] = ldexp(1, (int)(random_bits(&r) % 40) - 20); /* powers of two: ends of the line stay floats */
            f.volume.spacing[a] = scale[a], eye[1][a] = eye[0][a] * scale[a], target[1][a] = target[0][a] * scale[a];
        }
        field_build(&f);
        const isogi_dvr_desc scaled = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        if (isogi_dvr_create(&dvr, &scaled, &serial) == ISOGI_TOO_LARGE) { /* more samples than the other methods take */
            field_free(&f);
            continue;
        }
        CHECK(isogi_dvr_set_transfer(dvr, &landscape) == ISOGI_OK, "set_transfer");
        /* errors of rounding relative to an axis of 1e6 times the others' length would lead elsewhere; so scale what the renderer does, not
           the view */
        double origin[3], dir[3];
        view_ray(&view, 0, 0, origin, dir);
        isogi_dvr__march m = {0};
        isogi_dvr__pixel_ray ray = {.dvr = dvr, .clear = 1};
        if (isogi_dvr__begin(&m, dvr, origin, dir, 1, 1e300, 0.5)) isogi_dvr__cast_values(&ray, &m);
        for (int a = 0; a < 4; a++) {
            double got = a < 3 ? ray.rgb[a] : 1 - ray.clear;
            CHECK(fabs((double)p.c[a] - got) < 1e-7, "ray %d, channel %d: %.9g, not %.9g", n, a, got, (double)p.c[a]);
        }
        /* the same way, cell by cell */
        CHECK(m.work.cells == count.cells && m.work.cubics == count.cubics && m.work.blocks == count.blocks &&
                  m.work.blocks_skipped == count.blocks_skipped,
              "ray %d: %d cells, %d cubics, %d blocks, %d skipped, not %d, %d, %d, %d", n, (int)m.work.cells, (int)m.work.cubics,
              (int)m.work.blocks, (int)m.work.blocks_skipped, (int)count.cells, (int)count.cubics, (int)count.blocks,
              (int)count.blocks_skipped);
        passed += count.cells;
        isogi_dvr_free(dvr);
        field_free(&f);
    }
    CHECK(passed > 300, "%d cells", (int)passed);
}

/* As the renderer finds them: of one opaque probe after the other. */
static int walk_crossings(const isogi_dvr *dvr, const double origin[3], const float dir[3], double isovalue, crossing *out) {
    isogi_dvr__march m;
    isogi_dvr__span s;
    double d[3] = {(double)dir[0], (double)dir[1], (double)dir[2]};
    double touched = -1; /* t at which the last piece ended with the isovalue itself */
    int count = 0;
    if (!isogi_dvr__begin(&m, dvr, origin, d, 1, 1e300, 0.5)) return 0;
    isogi_dvr__begin_walk(&s.walk, &m);
    while (isogi_dvr__next_monotone(&s.walk, &s.piece) && count < 60)
        if ((s.piece.value[0] >= isovalue) != (s.piece.value[1] >= isovalue)) {
            double t = m.enter + s.piece.t0 + isogi_dvr__place_of(&s.piece, isovalue) * s.piece.dt;
            if (s.piece.value[1] < isovalue && !(s.piece.value[0] > isovalue) && s.piece.from <= touched) continue; /* in one point: once */
            touched = s.piece.value[1] > isovalue || s.piece.value[1] < isovalue ? -1 : s.piece.to;
            out[count].t = t, out[count++].side = s.piece.value[1] >= isovalue ? 1 : -1;
        }
    return count;
}

/* The ray enters or leaves the box where the field is the isovalue, as on a face of voxels that all have it: then the rounding of that
   place decides whether the surface is passed. */
static int ends_on_surface(const field *f, const double origin[3], const float dir[3], double isovalue) {
    long double o[3], d[3], ends[2];
    for (int a = 0; a < 3; a++) o[a] = (long double)origin[a], d[a] = (long double)dir[a];
    reference_ends(f, o, d, ends);
    for (int i = 0; i < 2; i++) {
        long double p[3];
        int c[3];
        for (int a = 0; a < 3; a++) {
            p[a] = o[a] + ends[i] * d[a], c[a] = (int)floorl(p[a]);
            c[a] = c[a] < 0 ? 0 : c[a] > f->size[a] - 2 ? f->size[a] - 2 : c[a];
        }
        if (fabsl(reference_value(f, c, p) - (long double)isovalue) < 1e-13L)
            return 1; /* a double's rounding of t, times the slope: 1e-14 */
    }
    return 0;
}

TEST(crossings_are_those_of_the_exact_intersector) {
    test_random r = {77};
    int total = 0, rays = LONG_SUITE ? 40000 : 1500, odd = 0, open = 0;
    double worst = 0;
    for (int n = 0; n < 12; n++) {
        field f = n < 4 ? field_noise(9, (uint64_t)n) : n < 8 ? field_waves(12, (uint64_t)n) : field_new(8, 8, 8);
        if (n >= 8) { /* small whole numbers, and isovalues that voxels have */
            for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(random_bits(&r) % 4);
            field_build(&f);
        }
        double isovalue = n < 8 ? random_range(&r, -0.5, 0.5) : n % 2 ? 2 : 1.5;
        const isogi_peak peak = {isovalue, {1, 1, 1}, 0.25f};
        const isogi_transfer transfer = {.peaks = &peak, .peak_count = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        for (int i = 0; i < rays / 12; i++) {
            double eye[3], target[3], origin[3];
            float dir[3];
            crossing expected[64], got[64];
            random_line(&f, &r, eye, target);
            isogi_view view = line_of_sight(eye, target);
            isogi_view_ray(&view, 0, 0, origin, dir);
            if (ends_on_surface(&f, origin, dir, isovalue)) {
                open++;
                continue;
            }
            int count = intersector_crossings(f.pyramid, origin, dir, isovalue, expected),
                found = walk_crossings(dvr, origin, dir, isovalue, got);
            total += count;
            CHECK(count == found, "field %d ray %d: %d crossings, not %d", n, i, found, count);
            for (int k = 0; k < count && count == found; k++) {
                double error = fabs(got[k].t - expected[k].t);
                CHECK(got[k].side == expected[k].side, "field %d ray %d crossing %d: side %d", n, i, k, got[k].side);
                /* next to an extremum the place is ill-conditioned: the square root of a rounding error */
                CHECK(error < 1e-6, "field %d ray %d crossing %d: t %.17g, not %.17g", n, i, k, got[k].t, expected[k].t);
                worst = fmax(worst, error), odd += error > 1e-11;
            }
            pixel p = cast(dvr, eye, target, NULL);
            CHECK(fabs((double)p.c[3] - (1 - pow(0.75, count))) < 1e-6, "field %d ray %d: opacity %g of %d crossings", n, i, (double)p.c[3],
                  count);
        }
        isogi_dvr_free(dvr);
        field_free(&f);
    }
    printf("    %d crossings along %d rays: the same; largest difference of t %.2g, %d above 1e-11; %d rays end on the surface\n", total,
           rays - open, worst, odd, open);
    CHECK(total > 500 && open < rays / 100, "%d crossings, %d rays left out", total, open);
}

TEST_MAIN("dvr_inside")
