/* How much work rays through isogi_vol.h do: counters per ray on the fields of the benchmark, and batches of every size. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "test.h"
#include <math.h>
#include <stdlib.h>

enum { RAYS = 1 << 14, SIDE = 1 << 7 };
static const double pi = 3.14159265358979323846;

/* The fields of the design: Marschner-Lobb with isovalue 0.5, gyroid with isovalue 0, on [-1,1]^3. */
static float *field_new(int n, int gyroid) {
    float *data = (float *)malloc((size_t)n * (size_t)n * (size_t)n * sizeof *data), *out = data;
    double *s = (double *)malloc((size_t)n * sizeof *s), *c = (double *)malloc((size_t)n * sizeof *c);
    double *wave = (double *)malloc((size_t)n * (size_t)n * sizeof *wave);
    for (int i = 0; i < n; i++) {
        double x = -1 + 2.0 * i / (n - 1);
        s[i] = gyroid ? sin(2 * pi * (x + 1)) : sin(pi * x / 2), c[i] = cos(2 * pi * (x + 1));
        for (int j = 0; j < n; j++) {
            double y = -1 + 2.0 * j / (n - 1);
            wave[i + n * j] = cos(12 * pi * cos(pi * sqrt(x * x + y * y) / 2));
        }
    }
    for (int z = 0; z < n; z++)
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++)
                *out++ = (float)(gyroid ? s[x] * c[y] + s[y] * c[z] + s[z] * c[x] : (1 - s[z] + 0.25 * (1 + wave[x + n * y])) / 2.5);
    free(s), free(c), free(wave);
    return data;
}

/* A view of the volume; or rays that leave the points that the view shows in random directions. */
static void rays_new(isogi_ray *rays, double isovalue) {
    for (int i = 0; i < RAYS; i++) {
        double sx = (2 * (i % SIDE + 0.5) / SIDE - 1) * tan(pi / 8), sy = (2 * ((double)(i / SIDE) + 0.5) / SIDE - 1) * tan(pi / 8);
        const double f[3] = {-0.541, -0.433, -0.721}, r[3] = {0.8, 0, -0.6}, u[3] = {0.26, -0.9, 0.346};
        memset(&rays[i], 0, sizeof rays[i]);
        for (int a = 0; a < 3; a++) rays[i].dir[a] = (float)(f[a] + sx * r[a] + sy * u[a]);
        rays[i].origin[0] = 1.5, rays[i].origin[1] = 1.2, rays[i].origin[2] = 2, rays[i].isovalue = isovalue;
    }
}

static void leave_surface(const isogi_pyramid *p, isogi_ray *rays, int n) {
    test_random r = {5};
    isogi_hit *hits = (isogi_hit *)malloc(RAYS * sizeof *hits);
    float(*position)[3] = (float(*)[3])malloc(RAYS * sizeof *position), (*normal)[3] = (float(*)[3])malloc(RAYS * sizeof *normal);
    isogi_vol_intersect(p, rays, RAYS, hits, NULL);
    int count = 0;
    for (int i = 0; i < RAYS; i++)
        if (hits[i].side) hits[count++] = hits[i];
    isogi_vol_positions(p, hits, (size_t)count, position);
    isogi_vol_normals(p, hits, (size_t)count, ISOGI_NORMAL_SMOOTH, normal);
    for (int i = 0; i < RAYS; i++) {
        double z = 2 * random_unit(&r) - 1, phi = 2 * pi * random_unit(&r), s = sqrt(1 - z * z), d[3] = {s * cos(phi), s * sin(phi), z};
        for (int a = 0; a < 3; a++) {
            rays[i].origin[a] = (double)position[i % count][a] + (double)normal[i % count][a] * 0.5 / (n - 1);
            rays[i].dir[a] = (float)(d[a] + (double)normal[i % count][a]);
        }
    }
    free(hits), free(position), free(normal);
}

typedef struct work { double blocks, cells, cubics; } work;

static work count_work(const isogi_pyramid *p, const isogi_ray *rays, size_t batch, isogi_hit *hits) {
    isogi_counters c = {0};
    for (size_t i = 0; i < RAYS; i += batch) isogi_vol_intersect(p, rays + i, RAYS - i < batch ? RAYS - i : batch, hits + i, &c);
    CHECK(c.rays == RAYS, "%g rays", (double)c.rays);
    return (work){(double)c.blocks / RAYS, (double)c.cells / RAYS, (double)c.cubics / RAYS};
}

/* Of single rays, of any hits, and of bundles of rays that begin where one of EACH does. */
static work count_single(const isogi_pyramid *p, const isogi_ray *rays) {
    isogi_counters c = {0};
    isogi_hit hit;
    for (size_t i = 0; i < RAYS; i += 8) isogi_vol_intersect(p, rays + i, 1, &hit, &c);
    return (work){(double)c.blocks / (double)c.rays, (double)c.cells / (double)c.rays, (double)c.cubics / (double)c.rays};
}

static work count_any(const isogi_pyramid *p, const isogi_ray *rays) {
    static uint8_t any[RAYS];
    isogi_counters c = {0};
    isogi_vol_occluded(p, rays, RAYS, any, &c);
    return (work){(double)c.blocks / (double)c.rays, (double)c.cells / (double)c.rays, (double)c.cubics / (double)c.rays};
}

static work count_bundles(const isogi_pyramid *p, const isogi_ray *rays) {
    enum { EACH = 64 };
    static float dirs[EACH][3];
    static isogi_hit hits[EACH];
    isogi_counters c = {0};
    for (size_t i = 0; i < RAYS; i += EACH) {
        isogi_bundle b = {.isovalue = rays[i].isovalue};
        memcpy(b.origin, rays[i].origin, sizeof b.origin);
        for (size_t k = 0; k < EACH; k++) memcpy(dirs[k], rays[i + k].dir, sizeof dirs[k]);
        isogi_vol_bundle(p, &b, (const float(*)[3])dirs, EACH, hits, &c);
    }
    return (work){(double)c.blocks / (double)c.rays, (double)c.cells / (double)c.rays, (double)c.cubics / (double)c.rays};
}

static void work_check(const char *what, int path, work done, const work *bound) {
    CHECK(done.blocks < bound->blocks && done.cells < bound->cells && done.cubics < bound->cubics,
          "path %d, %s: %g blocks, %g cells, %g cubics", path, what, done.blocks, done.cells, done.cubics);
}

/* Nodes and cells that rays look at follow from the geometry alone. A cubic is set up in double only for cells in doubt, which are the hits
   and few others; where any hit will do for hardly any. Bounds: some 15 % above what was counted. */
TEST(rays_look_at_few_nodes_and_cells_and_solve_hardly_more_cubics_than_hits) {
    static const work most[2][2] = {{{10, 3.5, 0.85}, {11, 4.2, 0.75}}, {{11.5, 3.5, 1.05}, {12, 4.3, 0.6}}};
    static const work any[2][2] = {{{10, 3.5, 0.15}, {11, 4.2, 0.06}}, {{11.5, 3.5, 0.24}, {12, 4.3, 0.055}}};
    static const work bundles[2] = {{10, 4.6, 0.83}, {9.2, 4.4, 0.85}};
    int n = LONG_SUITE ? 256 : 128;
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        float *data = field_new(n, gyroid);
        isogi_ray *rays = (isogi_ray *)malloc(RAYS * sizeof *rays);
        isogi_hit *hits[5];
        isogi_pyramid *pyramid[5];
        isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {(size_t)n, (size_t)n, (size_t)n}};
        for (int a = 0; a < 3; a++) volume.spacing[a] = 2.0 / (n - 1), volume.origin[a] = -1;
        for (int path = 2; path < 5; path++) {
            isogi_context context = {.threads = 1, .force_path = path};
            CHECK(isogi_vol_build(&pyramid[path], &volume, &context) == ISOGI_OK, "path %d", path);
            hits[path] = (isogi_hit *)malloc(RAYS * sizeof(isogi_hit));
        }
        rays_new(rays, gyroid ? 0 : 0.5);
        for (int surface = 0; surface < 2; surface++) {
            const work *bound = &most[gyroid][surface];
            work done[5];
            if (surface) leave_surface(pyramid[2], rays, n);
            for (int path = 2; path < 5; path++) done[path] = count_work(pyramid[path], rays, RAYS, hits[path]);
            for (int path = 2; path < 5; path++) {
                long different = 0, found = 0;
                for (int i = 0; i < RAYS; i++) different += hits[path][i].side != hits[2][i].side, found += hits[path][i].side != 0;
                printf("    %s, %s, path %d: %.2f hits, %.2f blocks, %.2f cells, %.3f cubics per ray\n",
                       gyroid ? "gyroid" : "Marschner-Lobb", surface ? "surface" : "primary", path, (double)found / RAYS, done[path].blocks,
                       done[path].cells, done[path].cubics);
                CHECK(!different, "path %d: %ld hits differ", path, different);
                work_check("rays", path, done[path], bound);
                work_check("single rays", path, count_single(pyramid[path], rays), bound);
                work_check("any hits", path, count_any(pyramid[path], rays), &any[gyroid][surface]);
                if (surface) work_check("bundles", path, count_bundles(pyramid[path], rays), &bundles[gyroid]);
            }
        }
        for (int path = 2; path < 5; path++) isogi_vol_free(pyramid[path]), free(hits[path]);
        free(rays), free(data);
    }
}

/* Without leaves rays read the voxels of all cells that they pass in blocks of 4^3 that hold the isovalue, and of no others. */
TEST(rays_of_compact_volumes_look_at_blocks_that_hold_the_isovalue_alone) {
    static const work most[2][2] = {{{10, 13.5, 3.2}, {11, 15.5, 4}}, {{11.5, 13, 3.2}, {12, 15.5, 4}}};
    int n = LONG_SUITE ? 256 : 128;
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        float *data = field_new(n, gyroid);
        isogi_ray *rays = (isogi_ray *)malloc(RAYS * sizeof *rays);
        isogi_hit *hits[2];
        isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {(size_t)n, (size_t)n, (size_t)n}};
        for (int i = 0; i < 2; i++) hits[i] = (isogi_hit *)malloc(RAYS * sizeof(isogi_hit));
        for (int a = 0; a < 3; a++) volume.spacing[a] = 2.0 / (n - 1), volume.origin[a] = -1;
        for (int path = 2; path < 5; path++) {
            isogi_context context = {.threads = 1, .force_path = path};
            isogi_pyramid *pyramid[2];
            rays_new(rays, gyroid ? 0 : 0.5);
            for (int compact = 0; compact < 2; compact++) {
                volume.compact = compact;
                CHECK(isogi_vol_build(&pyramid[compact], &volume, &context) == ISOGI_OK, "path %d", path);
            }
            for (int surface = 0; surface < 2; surface++) {
                long different = 0;
                if (surface) leave_surface(pyramid[0], rays, n);
                const work full = count_work(pyramid[0], rays, RAYS, hits[0]), done = count_work(pyramid[1], rays, RAYS, hits[1]);
                for (int i = 0; i < RAYS; i++) different += hits[0][i].side != hits[1][i].side || fabs(hits[0][i].t - hits[1][i].t) > 0;
                printf("    path %d: %.2f blocks, %.2f cells, %.3f cubics per ray; with leaves %.2f, %.2f, %.3f\n", path, done.blocks,
                       done.cells, done.cubics, full.blocks, full.cells, full.cubics);
                CHECK(!different, "path %d: %ld hits differ", path, different);
                work_check("compact", path, done, &most[gyroid][surface]);
                CHECK(done.cells > 2 * full.cells, "path %d: %g cells, with leaves %g: are there none?", path, done.cells, full.cells);
            }
            for (int compact = 0; compact < 2; compact++) isogi_vol_free(pyramid[compact]);
        }
        for (int i = 0; i < 2; i++) free(hits[i]);
        free(rays), free(data);
    }
}

/* A pool takes rays again and again, moves them when few are left, and reports each one once: in batches of any size, hits are
   the same, and so is the work for rays that do not coincide. Occlusion may be certain before a hit is. */
TEST(batches_of_any_size_give_the_same_bits) {
    static const size_t sizes[] = {1, 3, 4, 7, 8, 9, 15, 16, 17, 63, 64, 65, 200, 1000};
    int n = 48;
    float *data = field_new(n, 1);
    isogi_ray *rays = (isogi_ray *)malloc(RAYS * sizeof *rays);
    isogi_hit *whole = (isogi_hit *)malloc(RAYS * sizeof *whole), *parts = (isogi_hit *)malloc(RAYS * sizeof *parts);
    uint8_t *occluded = (uint8_t *)malloc(RAYS);
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {(size_t)n, (size_t)n, (size_t)n}};
    isogi_context context = {.threads = 1, .force_path = 4};
    isogi_pyramid *p;
    for (int a = 0; a < 3; a++) volume.spacing[a] = 2.0 / (n - 1), volume.origin[a] = -1;
    CHECK(isogi_vol_build(&p, &volume, &context) == ISOGI_OK, "build");
    rays_new(rays, 0);
    leave_surface(p, rays, n);
    for (int i = 0; i < RAYS; i += 5) rays[i].flags = i % 2 ? ISOGI_RAY_CAPPED : 0, rays[i].isovalue = 0.3, rays[i].tmax = i % 3 ? 0.25 : 0;
    for (int i = 0; i < RAYS; i += 77) rays[i].dir[0] = rays[i].dir[1] = 0, rays[i].isovalue = i % 2 ? 100 : 0;
    memset(whole, 0, RAYS * sizeof *whole), memset(parts, 0, RAYS * sizeof *parts);
    work all = count_work(p, rays, RAYS, whole);
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        work done = count_work(p, rays, sizes[k], parts);
        long wrong = 0, wrong_any = 0;
        for (size_t i = 0; i < RAYS; i += sizes[k])
            isogi_vol_occluded(p, rays + i, RAYS - i < sizes[k] ? RAYS - i : sizes[k], occluded + i, NULL);
        for (int i = 0; i < RAYS; i++)
            wrong += memcmp(&whole[i], &parts[i], sizeof *whole) != 0, wrong_any += occluded[i] != (whole[i].side != 0);
        CHECK(!wrong && !wrong_any, "batches of %zu: %ld hits differ, %ld occlusions", sizes[k], wrong, wrong_any);
        CHECK(fabs(done.blocks - all.blocks) < 1e-9 && fabs(done.cells - all.cells) < 1e-9 && fabs(done.cubics - all.cubics) < 1e-9,
              "batches of %zu: %g, %g blocks", sizes[k], done.blocks, all.blocks);
    }
    isogi_vol_free(p);
    free(rays), free(whole), free(parts), free(occluded), free(data);
}

/* Under -ffast-math the last bits depend on how the compiler saw fit to place each copy of a formula. */
static int same_hit(const isogi_hit *a, const isogi_hit *b) {
#ifdef __FAST_MATH__
    return a->side == b->side && !memcmp(a->cell, b->cell, sizeof a->cell) && fabs(a->t - b->t) <= 1e-12 * (1 + fabs(a->t));
#else
    return !memcmp(a, b, sizeof *a);
#endif
}

/* On from where rays hit, all in one direction or its opposite: together and alone. Some are said to begin on a surface that is not in the
   volume: all of it is inside, or outside. */
enum { ABREAST = 40 };
static void go_onward(const isogi_pyramid *p, const isogi_hit *hits, int count, const float dir[3], double isovalue, int pack, long *left,
                      long *wrong) {
    isogi_hit start[ABREAST], together[ABREAST], alone;
    float dirs[ABREAST][3];
    const uint32_t flags = (pack % 4 < 2 ? ISOGI_RAY_ONWARD : 0) | (pack % 3 ? 0 : ISOGI_RAY_CAPPED);
    int n = 0;
    if (pack % 8 == 3) isovalue += pack % 3 ? 1000 : -1000;
    for (int i = 0; i < count; i++)
        if (hits[i].side) start[n++] = hits[i];
    for (int i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) dirs[i][a] = pack % 2 ? -dir[a] : dir[a];
    isogi_vol_continue(p, start, (const float(*)[3])dirs, NULL, isovalue, flags, (size_t)n, together, NULL);
    for (int i = 0; i < n; i++) {
        isogi_vol_continue(p, &start[i], (const float(*)[3])dirs + i, NULL, isovalue, flags, 1, &alone, NULL);
        *left += alone.side != 0, *wrong += !same_hit(&alone, &together[i]);
    }
}

/* Rays side by side, as those of neighbouring pixels, may go together: they hit what each of them hits alone, with the same bits, on every
   path, kind of grid, direction and border. Some run in lattice planes, along axes, out of corners; some end within the volume, some begin
   on a surface, all in one direction; some volumes are compact, some are long. */
TEST(rays_side_by_side_hit_what_they_hit_alone) {
    enum { TURNS = 600, MOST = ABREAST };
    test_random r = {11};
    const int turns = LONG_SUITE ? 40 * TURNS : QUICK_SUITE ? TURNS / 3 : TURNS;
    long hits = 0, wrong = 0, wrong_plain = 0, wrong_any = 0, spread_out = 0, left = 0, wrong_left = 0;
    for (int turn = 0; turn < turns; turn++) {
        const int smooth = turn % 3, levels = turn % 4 == 1, path = 2 + turn / 12 % 3, length = turn % 50 == 7 ? turn / 50 % 3 : -1;
        isogi_volume volume = {.type = ISOGI_F32};
        size_t voxels = 1;
        for (int a = 0; a < 3; a++) {
            volume.size[a] = a == length ? 1000 + random_bits(&r) % 7000 : 2 + random_bits(&r) % (turn % 16 ? 24 : 90);
            voxels *= volume.size[a];
            volume.spacing[a] = turn % 5 ? 1 : random_range(&r, 0.3, 2);
        }
        float *data = (float *)malloc(voxels * sizeof *data);
        for (size_t i = 0; i < voxels; i++) {
            const double x = (double)(i % volume.size[0]), y = (double)(i / volume.size[0] % volume.size[1]),
                         z = (double)(i / volume.size[0] / volume.size[1]);
            const double v =
                smooth ? sin(0.4 * smooth * x + 1) + cos(0.37 * smooth * y + turn) * sin(0.3 * smooth * z) : random_range(&r, -1, 1);
            data[i] = (float)(levels ? floor(4 * v) / 4 : v);
        }
        volume.data = data, volume.compact = turn % 5 == 4;
        isogi_pyramid *p, *plain;
        isogi_context context = {.threads = 1, .force_path = path}, slow = {.threads = 1, .force_path = 2};
        CHECK(isogi_vol_build(&p, &volume, &context) == ISOGI_OK && isogi_vol_build(&plain, &volume, &slow) == ISOGI_OK, "build");
        for (int pack = 0; pack < 24; pack++) {
            isogi_ray rays[MOST];
            isogi_hit together[MOST], alone[MOST], other[MOST];
            uint8_t any[MOST];
            const int count = pack % 3 ? 16 : 8 + (int)(random_bits(&r) % (MOST - 8)), grid = pack % 6 == 1, axial = pack % 8 == 2,
                      pinhole = (turn + pack) % 4 == 2;
            const double spread = pow(10, random_range(&r, -6, -1.2)),
                         isovalue = levels ? floor(random_range(&r, -3, 3)) / 4 : random_range(&r, -0.7, 0.7);
            double target[3], way[3];
            for (int a = 0; a < 3; a++)
                target[a] = random_range(&r, 0, 1) * (double)(volume.size[a] - 1),
                way[a] = axial && a != pack % 3 ? 0 : random_range(&r, -1, 1);
            if (grid)
                for (int a = 0; a < 3; a++) target[a] = floor(target[a]), way[a] = floor(3 * way[a]);
            if (fabs(way[0]) + fabs(way[1]) + fabs(way[2]) < 0.1) way[1] = 1;
            for (int i = 0; i < count; i++) {
                memset(&rays[i], 0, sizeof rays[i]);
                for (int a = 0; a < 3; a++) {
                    const double d = way[a] + (axial || grid ? 0 : spread * random_range(&r, -1, 1)), back = pack % 4 == 3 ? 0.5 : 60;
                    rays[i].dir[a] = (float)(d * volume.spacing[a]);
                    rays[i].origin[a] =
                        (target[a] + (grid && i % 2 ? 0 : spread * random_range(&r, -1, 1)) - back * way[a]) * volume.spacing[a];
                    if (pinhole && i) rays[i].origin[a] = rays[0].origin[a];
                }
                rays[i].isovalue = pack % 11 == 7 && i == 9 ? isovalue + 0.125 : isovalue,
                rays[i].tmax = pack % 5 == 4 ? random_range(&r, 50, 70) : 0;
                rays[i].flags = pack % 7 == 6 && i % 5 == 2 ? ISOGI_RAY_CAPPED : 0;
            }
            memset(together, 0, sizeof together), memset(alone, 0, sizeof alone), memset(other, 0, sizeof other);
            isogi_vol_intersect(p, rays, (size_t)count, together, NULL);
            isogi_vol_occluded(p, rays, (size_t)count, any, NULL);
            for (int i = 0; i < count; i++) {
                isogi_vol_intersect(p, &rays[i], 1, &alone[i], NULL), isogi_vol_intersect(plain, &rays[i], 1, &other[i], NULL);
                hits += alone[i].side != 0, wrong += !same_hit(&together[i], &alone[i]), wrong_any += any[i] != (alone[i].side != 0);
                wrong_plain += together[i].side != other[i].side;
                spread_out += spread > 0.03;
            }
            go_onward(p, alone, count, rays[0].dir, isovalue, pack, &left, &wrong_left);
        }
        isogi_vol_free(p), isogi_vol_free(plain);
        free(data);
    }
    CHECK(hits > 1000 && spread_out && left > 1000 && !wrong_left, "%ld hits; %ld onward, %ld of them differ", hits, left, wrong_left);
    /* a ray that begins in a face, within rounding, in matter that is the isovalue all over, may be seen on either side */
    CHECK(!wrong && !wrong_any && wrong_plain * 2000000 <= hits, "%ld of %ld hits differ, %ld occlusions, %ld from the plain path", wrong,
          hits, wrong_any, wrong_plain);
}

/* Rays from anywhere, in runs of one isovalue: what is known of blocks for one isovalue says nothing of the next. The field rises along z
   and an axis, so that every isovalue has blocks of its own. */
TEST(rays_of_one_isovalue_after_the_other_hit_what_they_hit_alone) {
    enum { COUNT = 6000 };
    static isogi_ray rays[COUNT];
    static isogi_hit hits[COUNT], alone;
    static uint8_t any[COUNT];
    test_random r = {37};
    long hit = 0, wrong = 0, wrong_any = 0;
    for (int n = 0; n < 6; n++) {
        isogi_volume v = {.type = ISOGI_F32, .size = {50, 66, 83}};
        const isogi_context context = {.threads = 1, .force_path = n < 3 ? 4 : 0};
        isogi_pyramid *p = NULL;
        float *data = (float *)malloc(v.size[0] * v.size[1] * v.size[2] * sizeof *data), *out = data;
        for (size_t z = 0; z < v.size[2]; z++)
            for (size_t y = 0; y < v.size[1]; y++)
                for (size_t x = 0; x < v.size[0]; x++)
                    *out++ = (float)((double)z / 83 + (double)(n % 3 ? y : x) / 150 + 0.03 * sin(0.7 * (double)x) * sin(0.6 * (double)y));
        v.data = data;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "built");
        for (int i = 0; i < COUNT; i++) {
            memset(&rays[i], 0, sizeof rays[i]);
            for (int a = 0; a < 3; a++)
                rays[i].origin[a] = random_range(&r, -0.1, 1.1) * (double)(v.size[a] - 1), rays[i].dir[a] = (float)random_range(&r, -1, 1);
            rays[i].isovalue = 0.05 + 0.1 * (i / 75 * 7 % 13);
        }
        isogi_vol_intersect(p, rays, COUNT, hits, NULL), isogi_vol_occluded(p, rays, COUNT, any, NULL);
        for (int i = 0; i < COUNT; i++) {
            isogi_vol_intersect(p, &rays[i], 1, &alone, NULL);
            hit += hits[i].side != 0, wrong += !same_hit(&hits[i], &alone), wrong_any += any[i] != (alone.side != 0);
        }
        isogi_vol_free(p), free(data);
    }
    CHECK(hit > 4000 && !wrong && !wrong_any, "of %ld hits %ld are others, occlusions %ld", hit, wrong, wrong_any);
}

/* Rays that begin in one place, on a surface or near it, pass the cells round it at once where these certainly do not hold their hit: in
   smooth fields most do, so that fewer cells are looked at; all hit what they hit alone, with the same bits, in noise, too. Half of the
   rays run along the surface, but for those that are counted. */
TEST(rays_of_one_place_hit_what_they_hit_alone_and_look_at_fewer_cells) {
    enum { TURNS = 240, PACKS = 12, EACH = 64 };
    static const isogi_type types[] = {ISOGI_F32, ISOGI_U8, ISOGI_I16, ISOGI_F32, ISOGI_F64};
    static float dirs[EACH][3];
    static isogi_ray rays[EACH];
    static isogi_hit starts[EACH], together[EACH], alone[EACH], row[EACH];
    static uint8_t any[EACH];
    test_random r = {53};
    long hit = 0, wrong = 0, wrong_any = 0, wrong_plain = 0, wrong_row = 0;
    isogi_counters whole = {0}, parts = {0}, plainly = {0};
    const int turns = LONG_SUITE ? 40 * TURNS : QUICK_SUITE ? TURNS / 3 : TURNS;
    for (int turn = 0; turn < turns; turn++) {
        const int smooth = turn % 4;
        const size_t more[3] = {random_bits(&r) % 9, random_bits(&r) % 9, random_bits(&r) % 9};
        isogi_volume v = {.type = types[turn % 5], .size = {24 + more[0], 16 + more[1], 18 + more[2]}};
        const size_t voxels = v.size[0] * v.size[1] * v.size[2], bytes = v.type == ISOGI_U8 ? 1 : v.type == ISOGI_I16 ? 2 : 4;
        double *data = (double *)malloc(voxels * sizeof *data);
        isogi_context context = {.threads = 1, .force_path = 4}, slow = {.threads = 1, .force_path = 3};
        isogi_pyramid *p, *plain;
        for (size_t i = 0; i < voxels; i++) {
            const double x = (double)(i % v.size[0]), y = (double)(i / v.size[0] % v.size[1]), z = (double)(i / v.size[0] / v.size[1]);
            const double f = smooth ? sin(0.25 * smooth * x + 1) + cos(0.2 * smooth * y + turn) * sin(0.3 * smooth * z + 0.1 * x)
                                    : random_range(&r, -1, 1);
            if (v.type == ISOGI_F64) data[i] = f;
            else if (v.type == ISOGI_F32) ((float *)data)[i] = (float)(f / (turn % 2 ? 1 : 3));
            else if (bytes == 2) ((int16_t *)data)[i] = (int16_t)(-9000 * f);
            else ((uint8_t *)data)[i] = (uint8_t)(127 + 60 * f);
        }
        if (v.type == ISOGI_F32) v.scale = turn % 2 ? 1 : 3;
        if (bytes == 2) v.scale = -1.0 / 9000;
        if (bytes == 1) v.scale = 1.0 / 60, v.bias = -127.0 / 60;
        for (int a = 0; a < 3; a++) v.spacing[a] = turn % 3 ? 1 : random_range(&r, 0.3, 2);
        v.data = data;
        if (turn % 5 == 3) { /* rows and slices backwards */
            v.stride[0] = 4, v.stride[1] = -4 * (ptrdiff_t)v.size[0], v.stride[2] = v.stride[1] * (ptrdiff_t)v.size[1];
            v.data = (const float *)(const void *)data + voxels - v.size[0];
        }
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK && isogi_vol_build(&plain, &v, &slow) == ISOGI_OK, "build");
        for (int pack = 0; pack < PACKS; pack++) {
            const int kind = pack % 3; /* from a surface, onward from it, from near it */
            isogi_bundle b = {.isovalue = random_range(&r, -0.7, 0.7), .tmax = pack % 5 == 4 ? random_range(&r, 0.5, 4) : 0};
            isogi_ray ray = {.isovalue = b.isovalue};
            float place[1][3], normal[1][3];
            for (int a = 0; a < 3; a++) {
                ray.origin[a] = random_range(&r, 0.1, 0.9) * (double)(v.size[a] - 1) * v.spacing[a];
                ray.dir[a] = (float)random_range(&r, -1, 1);
            }
            isogi_vol_intersect(plain, &ray, 1, starts, NULL);
            if (!starts[0].side) continue;
            isogi_vol_positions(p, starts, 1, place), isogi_vol_normals(p, starts, 1, ISOGI_NORMAL_TRILINEAR, normal);
            if (kind < 2) b.start = starts, b.flags = kind ? ISOGI_RAY_ONWARD : 0;
            else {
                const double off = (pack % 2 ? 1 : -1) * pow(10, random_range(&r, -8, 0));
                for (int a = 0; a < 3; a++) b.origin[a] = (double)place[0][a] + off * (double)normal[0][a];
            }
            for (int i = 0; i < EACH; i++) {
                const int grazes = i % 2 && smooth != 1, up = smooth == 1 && i % 16;
                const double along = grazes ? pow(10, random_range(&r, i % 4 == 3 ? -5 : -1, 0)) : 1;
                double d[3], across = 0;
                for (int a = 0; a < 3; a++) d[a] = random_range(&r, -1, 1), across += d[a] * (double)normal[0][a];
                for (int a = 0; a < 3; a++)
                    dirs[i][a] = (float)(grazes || up ? d[a] + (fabs(across) * along - across) * (double)normal[0][a] : d[a]);
                rays[i] = (isogi_ray){.tmax = b.tmax, .isovalue = b.isovalue}, starts[i] = starts[0];
                memcpy(rays[i].origin, b.origin, sizeof b.origin), memcpy(rays[i].dir, dirs[i], sizeof dirs[i]);
            }
            isogi_vol_bundle(p, &b, (const float(*)[3])dirs, EACH, together, smooth == 1 ? &whole : NULL);
            isogi_vol_bundle_occluded(p, &b, (const float(*)[3])dirs, EACH, any, NULL);
            for (int i = 0; smooth == 1 && i < EACH; i += 8) {
                isogi_vol_bundle(p, &b, (const float(*)[3])dirs + i, 8, row, &parts);
                isogi_vol_bundle(plain, &b, (const float(*)[3])dirs + i, 8, row, &plainly);
            }
            for (int i = 0; i < EACH; i++) {
                isogi_hit other;
                const float(*const one)[3] = (const float(*)[3])dirs + i;
                if (kind < 2) {
                    isogi_vol_continue(p, starts, one, &b.tmax, b.isovalue, b.flags, 1, &alone[i], NULL);
                    isogi_vol_continue(plain, starts, one, &b.tmax, b.isovalue, b.flags, 1, &other, NULL);
                } else isogi_vol_intersect(p, &rays[i], 1, &alone[i], NULL), isogi_vol_intersect(plain, &rays[i], 1, &other, NULL);
                hit += alone[i].side != 0, wrong += !same_hit(&together[i], &alone[i]), wrong_any += any[i] != (alone[i].side != 0);
                wrong_plain += together[i].side != other.side;
            }
            if (kind == 2) isogi_vol_intersect(p, rays, EACH, row, NULL);
            else {
                double ends[EACH];
                for (int i = 0; i < EACH; i++) ends[i] = b.tmax;
                isogi_vol_continue(p, starts, (const float(*)[3])dirs, ends, b.isovalue, b.flags, EACH, row, NULL);
            }
            for (int i = 0; i < EACH; i++) wrong_row += !same_hit(&row[i], &alone[i]);
        }
        isogi_vol_free(p), isogi_vol_free(plain), free(data);
    }
    printf("    %ld hits; cells a ray %.2f of 64, %.2f of 8\n", hit, (double)whole.cells / (double)whole.rays,
           (double)parts.cells / (double)parts.rays);
    CHECK(hit > 30000 && !wrong && !wrong_any && !wrong_row && !wrong_plain,
          "of %ld hits %ld are others, %ld in a row, %ld on the plain path, occlusions %ld", hit, wrong, wrong_row, wrong_plain, wrong_any);
    if (parts.cubics < plainly.cubics) /* AVX-512 is there */
        CHECK((double)whole.cells < 0.85 * (double)parts.cells, "%g cells, %g", (double)whole.cells, (double)parts.cells);
}

/* Rays that leave a surface and rays that merely begin in the same place, in one call: what is known of the sides of the ones says nothing
   of the others, which cross the surface at once where rounding has put them beyond it. */
TEST(rays_that_leave_a_surface_say_nothing_of_rays_that_begin_there) {
    enum { EDGE = 16, EACH = 64, TURNS = 100 };
    static float data[EDGE][EDGE][EDGE], dirs[3 * EACH][3];
    static isogi_hit together[3 * EACH];
    static uint8_t any[3 * EACH];
    isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {EDGE, EDGE, EDGE}};
    isogi_context context = {.threads = 1, .force_path = 4};
    isogi_pyramid *p;
    test_random r = {59};
    long hit = 0, wrong = 0, wrong_any = 0;
    for (int z = 0; z < EDGE; z++)
        for (int y = 0; y < EDGE; y++)
            for (int x = 0; x < EDGE; x++) data[z][y][x] = (float)(sin(0.3 * x) + cos(0.2 * y) * sin(0.3 * z));
    CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
    for (int turn = 0; turn < TURNS; turn++) {
        isogi_bundle b[3] = {{.isovalue = random_range(&r, -0.7, 0.7)}};
        isogi_ray ray = {.origin = {8, 8, 8}, .isovalue = b[0].isovalue};
        isogi_hit start, alone;
        for (int a = 0; a < 3; a++) ray.dir[a] = (float)random_range(&r, -1, 1);
        isogi_vol_intersect(p, &ray, 1, &start, NULL);
        if (!start.side) continue;
        for (int a = 0; a < 3; a++) b[0].origin[a] = start.cell[a] + start.local[a];
        b[2] = b[1] = b[0], b[turn % 2 ? 0 : 1].start = b[2].start = &start;
        for (int i = 0; i < 3 * EACH; i++)
            for (int a = 0; a < 3; a++) dirs[i][a] = (float)random_range(&r, -1, 1);
        isogi_vol_bundles(p, b, 3, (const float(*)[3])dirs, EACH, together, NULL);
        isogi_vol_bundles_occluded(p, b, 3, (const float(*)[3])dirs, EACH, any, NULL);
        for (int i = 0; i < 3 * EACH; i++) {
            isogi_vol_bundle(p, &b[i / EACH], (const float(*)[3])dirs + i, 1, &alone, NULL);
            hit += alone.side != 0, wrong += !same_hit(&together[i], &alone), wrong_any += any[i] != (alone.side != 0);
        }
    }
    CHECK(hit > 4000 && !wrong && !wrong_any, "of %ld hits %ld are others, occlusions %ld", hit, wrong, wrong_any);
    isogi_vol_free(p);
}

/* In a linear field slopes are bounds that are reached: rays of one place whose hits lie just before, or just behind, the planes up to
   which they pass the cells at once. Every isovalue is that of such a point of the first ray. */
TEST(rays_of_one_place_hit_a_plane_just_before_they_leave_the_cells_round_it) {
    enum { EDGE = 16, EACH = 64, TURNS = 4000 };
    static float data[EDGE][EDGE][EDGE], dirs[EACH][3];
    static isogi_hit together[EACH];
    isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {EDGE, EDGE, EDGE}};
    isogi_context context = {.threads = 1, .force_path = 4};
    const double slope[3] = {0.7, -0.9, 0.37};
    isogi_pyramid *p;
    test_random r = {61};
    long hit = 0, wrong = 0;
    for (int z = 0; z < EDGE; z++)
        for (int y = 0; y < EDGE; y++)
            for (int x = 0; x < EDGE; x++) data[z][y][x] = (float)(slope[0] * x + slope[1] * y + slope[2] * z);
    CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
    for (int turn = 0; turn < TURNS; turn++) {
        const double near = (turn % 2 ? 1 : -1) * pow(10, random_range(&r, -9, -2));
        isogi_bundle b = {.isovalue = 0};
        double out = 1e30;
        for (int a = 0; a < 3; a++) b.origin[a] = random_range(&r, 4, 9);
        for (int i = 0; i < EACH; i++)
            for (int a = 0; a < 3; a++) dirs[i][a] = (float)random_range(&r, -1, 1);
        for (int a = 0; a < 3; a++) { /* to the planes behind 1 to 3 cells */
            const double d = (double)dirs[0][a], plane = floor(b.origin[a]) + (d > 0 ? 1 + turn % 3 : -(turn % 3));
            out = fmin(out, (plane - b.origin[a]) / d);
        }
        for (int a = 0; a < 3; a++) b.isovalue += slope[a] * (b.origin[a] + out * (1 + near) * (double)dirs[0][a]);
        isogi_vol_bundle(p, &b, (const float(*)[3])dirs, EACH, together, NULL);
        for (int i = 0; i < EACH; i += i ? 9 : 1) {
            isogi_hit alone;
            isogi_vol_bundle(p, &b, (const float(*)[3])dirs + i, 1, &alone, NULL);
            hit += alone.side != 0, wrong += !same_hit(&together[i], &alone);
        }
    }
    CHECK(hit > TURNS && !wrong, "of %ld hits %ld are others", hit, wrong);
    isogi_vol_free(p);
}

/* Any hit, where rays pass whole blocks of either side, and blocks that lie beyond the volume: of random balls in a volume, or of single
   voxels, at isovalues just above the least value and just below the largest. */
TEST(any_hit_is_a_hit) {
    enum { COUNT = 4000 };
    static const int sizes[3][3] = {{21, 33, 73}, {81, 21, 37}, {69, 70, 25}};
    static isogi_ray rays[COUNT];
    static isogi_hit hits[COUNT], alone;
    static uint8_t any[COUNT];
    test_random r = {31};
    long hit = 0, wrong = 0;
    for (int n = 0; n < 12; n++) {
        const int *size = sizes[n % 3], balls = n / 3 % 2, up = n / 6;
        const size_t voxels = (size_t)size[0] * (size_t)size[1] * (size_t)size[2];
        uint8_t *data = (uint8_t *)malloc(voxels);
        isogi_volume v = {.data = data, .type = ISOGI_U8, .size = {(size_t)size[0], (size_t)size[1], (size_t)size[2]}};
        const isogi_context context = {.threads = 1};
        isogi_pyramid *p = NULL;
        double ball[8][4];
        for (int k = 0; k < 32; k++) ball[k / 4][k % 4] = k % 4 < 3 ? random_range(&r, 0, size[k % 4]) : random_range(&r, 3, 25);
        for (size_t i = 0; i < voxels; i++) {
            const double at[3] = {(double)(i % v.size[0]), (double)(i / v.size[0] % v.size[1]), (double)(i / v.size[0] / v.size[1])};
            int inside = !balls && random_bits(&r) % 300 == 0;
            for (int k = 0; k < 8 && balls; k++)
                inside |= (at[0] - ball[k][0]) * (at[0] - ball[k][0]) + (at[1] - ball[k][1]) * (at[1] - ball[k][1]) +
                              (at[2] - ball[k][2]) * (at[2] - ball[k][2]) < ball[k][3] * ball[k][3];
            data[i] = inside != up ? 255 : 0;
        }
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "built");
        for (int i = 0; i < COUNT; i++) {
            memset(&rays[i], 0, sizeof rays[i]);
            for (int a = 0; a < 3; a++)
                rays[i].origin[a] = random_range(&r, -0.2, 1.2) * (size[a] - 1), rays[i].dir[a] = (float)random_range(&r, -1, 1);
            if (i % 3 == 0) rays[i].dir[i / 3 % 3] = 0;
            if (i % 6 == 0) rays[i].dir[(i / 3 + 1) % 3] = 0;
            if (i % 5 == 0) rays[i].tmax = random_range(&r, 1, 60);
            const int which = n % 2 ? i / 40 : i; /* one by one, and in runs, which rays go through together */
            rays[i].isovalue = which % 2 ? 0.5 : which % 4 ? 254.5 : 128;
        }
        isogi_vol_intersect(p, rays, COUNT, hits, NULL);
        isogi_vol_occluded(p, rays, COUNT, any, NULL);
        for (int i = 0; i < COUNT; i++) {
            hit += hits[i].side != 0, wrong += any[i] != (hits[i].side != 0);
            if (i % 8) continue;
            isogi_vol_intersect(p, &rays[i], 1, &alone, NULL);
            wrong += any[i] != (alone.side != 0);
        }
        isogi_vol_free(p);
        free(data);
    }
    CHECK(hit > COUNT && !wrong, "%ld of %ld hits differ", wrong, hit);
}

TEST_MAIN("vol_work")
