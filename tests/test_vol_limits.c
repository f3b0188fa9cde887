/* The limits of isogi_vol.h: views of every shape, more than 2^31 voxels, what a pyramid costs, and numbers and pointers that no caller
   should send. */
#ifndef _DEFAULT_SOURCE
#define _DEFAULT_SOURCE 1
#endif
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "fields.h"
#include <float.h>
#ifdef __unix__
#include <sys/mman.h>
#include <unistd.h>
#endif

/* ---- views ---- */

/* A crop of an array of pixels with channels, mirrored, thinned out, or the same plane again and again: any of these is a view. */
static isogi_volume random_view(void *array, const int size[3], int channels, isogi_type type, test_random *r) {
    isogi_volume v = {.type = type};
    ptrdiff_t bytes = (ptrdiff_t)type_bytes(type), stride = bytes * channels,
              offset = (ptrdiff_t)(random_bits(r) % (unsigned)channels) * bytes;
    for (int a = 0; a < 3; a++) {
        int kind = (int)(random_bits(r) % 8), step = kind == 0 ? 0 : kind == 1 ? 2 : 1;
        int most = step == 2 ? (size[a] + 1) / 2 : size[a], n = kind == 2 ? 1 : 1 + (int)(random_bits(r) % (unsigned)most), first = 0;
        if (step == 1) first = (int)(random_bits(r) % (unsigned)(size[a] - n + 1));
        if (step == 0) first = (int)(random_bits(r) % (unsigned)size[a]);
        v.size[a] = (size_t)n, v.stride[a] = step * stride;
        if (random_bits(r) & 1) first += step * (n - 1), v.stride[a] = -v.stride[a];
        offset += first * stride, stride *= size[a];
        v.spacing[a] = pow(10, floor(random_range(r, -6, 7)));
        v.origin[a] = random_range(r, -3, 3) * v.spacing[a];
    }
    if (!v.stride[0] && !v.stride[1] && !v.stride[2]) v.stride[0] = bytes * channels, v.size[0] = 1; /* all zero would mean packed */
    v.data = (const char *)array + offset;
    if (random_bits(r) & 1) v.scale = random_range(r, -2, 2), v.bias = random_range(r, -50, 50);
    return v;
}

/* The same voxels, packed. */
static void *packed_copy(const isogi_volume *v) {
    size_t bytes = type_bytes(v->type), n = 0;
    char *copy = (char *)malloc(v->size[0] * v->size[1] * v->size[2] * bytes);
    for (ptrdiff_t k = 0; k < (ptrdiff_t)v->size[2]; k++)
        for (ptrdiff_t j = 0; j < (ptrdiff_t)v->size[1]; j++)
            for (ptrdiff_t i = 0; i < (ptrdiff_t)v->size[0]; i++)
                memcpy(copy + bytes * n++, (const char *)v->data + i * v->stride[0] + j * v->stride[1] + k * v->stride[2], bytes);
    return copy;
}

static isogi_ray ray_in_view(const isogi_volume *v, double isovalue, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    double d[3];
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        ray.dir[a] = (float)(d[a] * v->spacing[a]);
        ray.origin[a] = v->origin[a] + v->spacing[a] * (random_range(r, 0, (double)v->size[a] - 1) - d[a] * random_range(r, 0, 20));
    }
    return ray;
}

TEST(any_view_is_as_good_as_a_packed_copy) {
    enum { RAYS = 64, SIZE = 24 };
    static isogi_ray rays[RAYS];
    static isogi_hit ours[RAYS], theirs[RAYS];
    const int size[3] = {SIZE, 9, 11};
    test_random r = {1};
    long found = 0, solid = 0;
    for (int turn = 0; turn < (LONG_SUITE ? 20000 : 500); turn++) {
        isogi_type type = (isogi_type)(random_bits(&r) % 6);
        int channels = 1 + (int)(random_bits(&r) % 3);
        isogi_context context = {.threads = 1, .force_path = turn % 5};
        size_t voxels = (size_t)(size[0] * size[1] * size[2] * channels);
        char *array = (char *)calloc(voxels, type_bytes(type));
        for (size_t i = 0; i < voxels; i++) {
            double value = floor(random_range(&r, 0, 100));
            if (type == ISOGI_F32) ((float *)(void *)array)[i] = (float)value;
            else if (type == ISOGI_F64) ((double *)(void *)array)[i] = value;
            else if (type >= ISOGI_U16) ((uint16_t *)(void *)array)[i] = (uint16_t)value;
            else array[i] = (char)value;
        }
        isogi_volume view = random_view(array, size, channels, type, &r), packed = view;
        void *copy = packed_copy(&view);
        isogi_pyramid *p = NULL, *q = NULL;
        isogi_mesh mesh = {0}, other = {0};
        isogi_mesh_desc desc = {.isovalue = 50.5 * (view.scale < 0 || view.scale > 0 ? view.scale : 1) + view.bias, .closed = turn % 2};
        packed.data = copy, packed.stride[0] = packed.stride[1] = packed.stride[2] = 0;
        CHECK(isogi_vol_build(&p, &view, &context) == ISOGI_OK && isogi_vol_build(&q, &packed, &context) == ISOGI_OK, "build");
        for (int i = 0; i < RAYS; i++) rays[i] = ray_in_view(&view, desc.isovalue, &r);
        isogi_vol_intersect(p, rays, RAYS, ours, NULL), isogi_vol_intersect(q, rays, RAYS, theirs, NULL);
        for (int i = 0; i < RAYS; i++) {
            CHECK(same_hit(&ours[i], &theirs[i]), "type %d: side %d and %d, t %.17g and %.17g", (int)type, ours[i].side, theirs[i].side,
                  ours[i].t, theirs[i].t);
            found += ours[i].side != 0;
        }
        CHECK(isogi_vol_mesh(p, &desc, &mesh) == ISOGI_OK && isogi_vol_mesh(q, &desc, &other) == ISOGI_OK, "mesh");
        CHECK(mesh.vertex_count == other.vertex_count && mesh.triangle_count == other.triangle_count, "%d and %d triangles",
              (int)mesh.triangle_count, (int)other.triangle_count);
        if (mesh.vertex_count == other.vertex_count && mesh.vertex_count)
            CHECK(!memcmp(mesh.positions, other.positions, mesh.vertex_count * 12), "vertices differ");
        solid += mesh.triangle_count > 0;
        for (int i = 0; i < 20; i++) {
            float point[1][3], value[2], gradient[2][3];
            double most = 200 + fabs(view.bias);
            for (int a = 0; a < 3; a++)
                point[0][a] = (float)(view.origin[a] + view.spacing[a] * random_range(&r, -1, (double)view.size[a]));
            for (int filter = ISOGI_FILTER_LINEAR; filter <= ISOGI_FILTER_CATMULL_ROM; filter++) {
                isogi_vol_sample_filtered(p, (isogi_filter)filter, (const float(*)[3])point, 1, &value[0], &gradient[0]);
                isogi_vol_sample_filtered(q, (isogi_filter)filter, (const float(*)[3])point, 1, &value[1], &gradient[1]);
                /* the documented error of either, 2^-21 of the largest number */
                CHECK(fabs((double)value[0] - (double)value[1]) <= 0x1p-19 * most, "filter %d: %g and %g", filter, (double)value[0],
                      (double)value[1]);
                for (int a = 0; a < 3; a++) {
                    CHECK(test_finite((double)gradient[0][a]), "gradient %g", (double)gradient[0][a]);
                    CHECK(view.size[a] > 1 || fabsf(gradient[0][a]) <= 0, "a gradient of %g along an axis of one voxel",
                          (double)gradient[0][a]);
                }
            }
        }
        isogi_vol_mesh_free(p, &mesh), isogi_vol_mesh_free(q, &other);
        isogi_vol_free(p), isogi_vol_free(q);
        free(copy), free(array);
    }
    printf("    %ld hits, %ld volumes with a surface\n", found, solid);
    CHECK(found > 1500 && solid > 100, "%ld hits, %ld surfaces: the test says little", found, solid);
}

/* ---- memory, and more voxels than 2^31 ---- */

static void *counting_alloc(void *user, size_t size, size_t align) {
    (void)align;
    *(size_t *)user += size;
    char *base = (char *)malloc(size + 64);
    char *p = base + (64 - (uintptr_t)base % 64);
    p[-1] = (char)(p - base);
    return p;
}

static void counting_release(void *user, void *p, size_t size) {
    *(size_t *)user -= size;
    free((char *)p - ((char *)p)[-1]);
}

TEST(a_pyramid_takes_the_memory_that_is_documented) {
    test_random r = {2};
    size_t used = 0;
    const size_t n = 129;
    uint8_t *data = (uint8_t *)malloc(n * n * n);
    for (size_t i = 0; i < n * n * n; i++) data[i] = (uint8_t)random_bits(&r);
    for (int path = 0; path < 3; path++) { /* 2: the best one, for a compact volume */
        isogi_volume v = {.data = data, .type = ISOGI_U8, .size = {n, n, n}, .compact = path > 1};
        isogi_context context = {.alloc = counting_alloc, .release = counting_release, .user = &used, .threads = 1, .force_path = path % 2};
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
        /* a side of 128 cells: others leave blocks at the border partly empty */
        printf("    path %d: %.3f bytes for a voxel\n", path, (double)used / (double)(n * n * n));
        CHECK((double)used < (path ? path == 1 ? 0.17 : 0.2 : 2.35) * (double)(n * n * n), "%d bytes", (int)used);
        isogi_vol_free(p);
        CHECK(used == 0, "%d bytes are left", (int)used);
    }
    free(data);
}

/* A few voxels behind the first 2^31, in memory that is never touched otherwise. path: 1, the plain one, takes an eighth of a byte for a
   voxel, the others two. */
#if defined(__unix__) && defined(MAP_NORESERVE) && UINTPTR_MAX > 0xffffffffu && !defined(TEST_SANITIZED)
#define SPARSE
static void check_beyond(uint8_t *data, const size_t size[3], const size_t at[3], int path) {
    isogi_context context = {.threads = 0, .force_path = path};
    isogi_pyramid *p = NULL;
    double range[2], piece[2], wanted[1][2] = {{100, 300}};
    size_t first[3], last[3], far_end[3] = {size[0] - 1, size[1] - 1, size[2] - 1};
    isogi_counters counters = {0};
    isogi_volume v = {.data = data, .type = ISOGI_U8, .size = {size[0], size[1], size[2]}};
    data[at[0] + size[0] * (at[1] + size[1] * at[2])] = 200;
    CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
    isogi_vol_range(p, range);
    CHECK(range[0] == 0 && range[1] == 200, "range %g..%g", range[0], range[1]);
    for (int a = 0; a < 3; a++) {
        enum { RAYS = 80 };
        isogi_ray ray = {.origin = {(double)at[0], (double)at[1], (double)at[2]}, .isovalue = 50}, rays[RAYS];
        isogi_hit hits[RAYS];
        size_t count;
        long wrong = 0;
        ray.origin[a] = -10, ray.dir[a] = 1;
        isogi_vol_intersect_all(p, &ray, 1, 4, hits, &count, NULL);
        CHECK(count == 2 && hits[0].side == 1 && fabs(hits[0].t - ((double)at[a] + 9.25)) < 1e-9 &&
                  fabs(hits[1].t - ((double)at[a] + 10.75)) < 1e-9,
              "axis %d: %d hits", a, (int)count);
        for (int i = 0; i < RAYS; i++) rays[i] = ray, rays[i].origin[(a + 1) % 3] += 0.01 * (i - RAYS / 2); /* along the pyramid's slope */
        isogi_vol_intersect(p, rays, RAYS, hits, NULL);
        for (int i = 0; i < RAYS; i++)
            wrong += hits[i].side != 1 || fabs(hits[i].t - ((double)at[a] + 9 + 0.25 / (1 - 0.01 * abs(i - RAYS / 2)))) > 1e-9;
        CHECK(wrong == 0, "axis %d: %ld of %d rays", a, wrong, RAYS);
        CHECK(isogi_vol_next_interval(p, &ray, (const double(*)[2])wanted, 1, 0, piece, NULL) && piece[0] <= (double)at[a] + 9.5 &&
                  piece[1] >= (double)at[a] + 10.5 && piece[1] - piece[0] < 13, "axis %d: piece %g..%g", a, piece[0], piece[1]);
        first[a] = at[a] - 5, last[a] = at[a] - 1;
    }
    CHECK(!isogi_vol_may_hold(p, first, last, (const double(*)[2])wanted, 1) &&
              isogi_vol_may_hold(p, at, at, (const double(*)[2])wanted, 1),
          "boxes");
    float point[1][3] = {{(float)at[0] + 0.5f, (float)at[1], (float)at[2]}}, value;
    isogi_vol_sample(p, (const float(*)[3])point, 1, &value, NULL);
    CHECK(value == 100, "value %g", (double)value);
    if (path != 1) { /* an octahedron */
        const isogi_mesh_desc desc = {.isovalue = 50};
        isogi_mesh mesh = {0};
        CHECK(isogi_vol_mesh(p, &desc, &mesh) == ISOGI_OK && mesh.vertex_count == 6 && mesh.triangle_count == 8,
              "%d vertices, %d triangles", (int)mesh.vertex_count, (int)mesh.triangle_count);
        for (size_t i = 0; i < mesh.vertex_count; i++) {
            float away = 0;
            for (int a = 0; a < 3; a++) away += fabsf(mesh.positions[i][a] - (float)at[a]);
            CHECK(fabsf(away - 0.75f) < 1e-3f, "a vertex %g away", (double)away);
        }
        isogi_vol_mesh_free(p, &mesh);
    }
    data[size[0] * size[1] * size[2] - 1] = 255;
    CHECK(isogi_vol_update(p, far_end, far_end, &counters) == ISOGI_OK && counters.blocks <= 3, "%d blocks", (int)counters.blocks);
    isogi_vol_range(p, range);
    CHECK(range[1] == 255, "range %g..%g", range[0], range[1]);
    data[size[0] * size[1] * size[2] - 1] = 0;
    isogi_vol_free(p);
}
#endif

TEST(voxels_beyond_two_to_the_31_are_found) {
#ifdef SPARSE
    const size_t size[3] = {2100, 1024, 1030}, at[3] = {2000, 1000, 1010}, bytes = size[0] * size[1] * size[2];
    uint8_t *data;
    if (!LONG_SUITE) SKIP("reads 2^31 voxels: in the long suite");
    data = (uint8_t *)mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (data == (uint8_t *)MAP_FAILED) SKIP("no 2 GB of addresses");
    check_beyond(data, size, at, 1);
    if ((double)sysconf(_SC_AVPHYS_PAGES) * (double)sysconf(_SC_PAGESIZE) > 10e9) check_beyond(data, size, at, 0);
    else printf("    10 GB of memory are not free: the plain path alone\n");
    munmap(data, bytes);
#else
    SKIP("needs sparse memory of 2 GB");
#endif
}

/* ---- numbers and pointers that no caller should send ---- */

static double odd_number(test_random *r) {
    const double odd[] = {0, -0.0, 1, -1, (double)NAN, (double)INFINITY, -(double)INFINITY, 1e300, -1e300, DBL_MAX, 1e-300, 5e-324, 0.5, 3,
        7, 1e10, -2.5, 1e-6};
    return random_bits(r) % 3 ? random_range(r, -2, 9) : odd[random_bits(r) % (sizeof odd / sizeof *odd)];
}

static float odd_float(test_random *r) {
    double x = odd_number(r);
    return fabs(x) > 3e38 && test_finite(x) ? FLT_MAX : (float)x;
}

static isogi_hit odd_hit(test_random *r) {
    isogi_hit hit;
    hit.t = odd_number(r), hit.side = (int)(random_bits(r) % 9) - 4;
    for (int a = 0; a < 3; a++) {
        hit.local[a] = odd_number(r);
        hit.cell[a] = random_bits(r) % 4 ? (uint32_t)(random_bits(r) % 8) : (uint32_t)random_bits(r);
    }
    return hit;
}

static void check_odd_hit(const isogi_pyramid *p, const isogi_hit *hit, const char *what) {
    const isogi_volume *v = isogi_vol_volume(p);
    CHECK(hit->side >= -2 && hit->side <= 2, "%s: side %d", what, hit->side);
    CHECK(test_finite(hit->t), "%s: t %g", what, hit->t);
    for (int a = 0; a < 3; a++)
        CHECK(hit->side ? hit->local[a] >= 0 && hit->local[a] <= 1 && hit->cell[a] + 1 < v->size[a] : hit->cell[a] == 0, "%s: cell %u + %g",
              what, (unsigned)hit->cell[a], hit->local[a]);
}

static double cubic_function(void *user, const double p[3], double g[3]) {
    (void)user;
    g[0] = 3 * p[0] * p[0] - 12, g[1] = 1, g[2] = -1;
    return p[0] * p[0] * p[0] - 12 * p[0] + p[1] - p[2];
}

static void odd_calls(const isogi_pyramid *p, test_random *r) {
    enum { N = 24, MANY = 3 };
    isogi_ray rays[N];
    isogi_hit starts[N], hits[N], all[N * MANY];
    float dirs[N][3], points[N][3], values[N], vectors[N][3];
    double tmax[N], grid[N][3], ranges[2][2], piece[2], t = odd_number(r);
    uint8_t occluded[N];
    size_t counts[N], first[3], last[3];
    for (int i = 0; i < N; i++) {
        rays[i].flags = (uint32_t)(random_bits(r) % 4), rays[i].tmin = odd_number(r), rays[i].tmax = odd_number(r),
        rays[i].isovalue = odd_number(r);
        tmax[i] = odd_number(r), starts[i] = odd_hit(r);
        for (int a = 0; a < 3; a++) {
            rays[i].origin[a] = odd_number(r), rays[i].dir[a] = odd_float(r), dirs[i][a] = odd_float(r), points[i][a] = odd_float(r);
            grid[i][a] = odd_number(r);
        }
    }
    for (int a = 0; a < 3; a++) first[a] = random_bits(r) % 12, last[a] = random_bits(r) % 12;
    for (int n = 0; n < 4; n++) ranges[n / 2][n % 2] = odd_number(r);
    isogi_bundle bundle = {
        .start = random_bits(r) & 1 ? starts : NULL, .tmin = odd_number(r), .tmax = odd_number(r), .isovalue = odd_number(r), .flags = 1};
    memcpy(bundle.origin, rays[0].origin, sizeof bundle.origin);
    CHECK(isogi_vol_intersect(p, rays, N, hits, NULL) == ISOGI_OK, "rays");
    for (int i = 0; i < N; i++) check_odd_hit(p, &hits[i], "intersect");
    CHECK(isogi_vol_occluded(p, rays, N, occluded, NULL) == ISOGI_OK, "any hits");
    CHECK(isogi_vol_intersect_all(p, rays, N, MANY, all, counts, NULL) == ISOGI_OK, "all hits");
    for (int i = 0; i < N; i++) {
        CHECK(counts[i] <= MANY + 1 && (counts[i] > 0) == (hits[i].side != 0) && occluded[i] == (hits[i].side != 0), "%d hits",
              (int)counts[i]);
        for (size_t n = 0; n < counts[i] && n < MANY; n++) check_odd_hit(p, &all[(size_t)i * MANY + n], "all");
    }
    CHECK(isogi_vol_continue(p, starts, (const float(*)[3])dirs, tmax, rays[1].isovalue, rays[1].flags, N, hits, NULL) == ISOGI_OK,
          "continue");
    for (int i = 0; i < N; i++) check_odd_hit(p, &hits[i], "continue");
    CHECK(isogi_vol_bundle(p, &bundle, (const float(*)[3])dirs, N, hits, NULL) == ISOGI_OK, "bundle");
    for (int i = 0; i < N; i++) check_odd_hit(p, &hits[i], "bundle");
    CHECK(isogi_vol_bundle_occluded(p, &bundle, (const float(*)[3])dirs, N, occluded, NULL) == ISOGI_OK, "bundle");
    CHECK(isogi_vol_normals(p, starts, N, (isogi_normal_kind)(random_bits(r) % 2), vectors) == ISOGI_OK, "normals");
    for (int i = 0; i < N; i++) {
        double length = 0;
        for (int a = 0; a < 3; a++) length += (double)vectors[i][a] * (double)vectors[i][a];
        CHECK(fabs(length) <= 0 || fabs(length - 1) < 1e-5, "a normal of length %g", sqrt(length));
    }
    CHECK(isogi_vol_positions(p, starts, N, vectors) == ISOGI_OK, "positions");
    CHECK(isogi_vol_sample(p, (const float(*)[3])points, N, values, vectors) == ISOGI_OK, "samples");
    CHECK(isogi_vol_sample_smooth(p, (const float(*)[3])points, N, values, vectors) == ISOGI_OK, "samples");
    CHECK(isogi_vol_sample_grid(p, ISOGI_FILTER_CATMULL_ROM, (const double(*)[3])grid, N, values, vectors) == ISOGI_OK, "samples");
    for (int n = 0; n < 50 && isogi_vol_next_interval(p, rays, (const double(*)[2])ranges, 2, t, piece, NULL); n++) {
        CHECK(test_finite(piece[0]) && piece[1] > piece[0] && !(piece[0] < t) && n < 49, "piece %g..%g behind %g", piece[0], piece[1], t);
        t = piece[1];
    }
    isogi_vol_may_hold(p, first, last, (const double(*)[2])ranges, 2);
    CHECK(isogi_vol_box_range(p, first, last, piece) == ISOGI_OK, "box");
}

TEST(odd_numbers_end_in_codes_and_misses) {
    test_random r = {3};
    for (int turn = 0; turn < (LONG_SUITE ? 20000 : 400); turn++) {
        double data[8 * 7 * 6];
        isogi_context context = {.threads = 1, .force_path = turn % 5};
        isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {8, 7, 6}};
        isogi_field function = {.value = cubic_function, .hessian = 60, .low = {-1, -2, 0}, .high = {9, 7, 6}, .cells = {5, 6, 7}};
        isogi_pyramid *p = NULL;
        isogi_mesh mesh = {0};
        for (int i = 0; i < 8 * 7 * 6; i++) data[i] = turn % 3 ? random_range(&r, -1, 6) : odd_number(&r);
        if (turn % 7 == 0) v.size[random_bits(&r) % 3] = 1;
        if (turn % 4 == 0) CHECK(isogi_vol_build_field(&p, &function, &context) == ISOGI_OK, "field");
        else CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
        odd_calls(p, &r);
        isogi_mesh_desc desc = {.isovalue = odd_number(&r), .normals = 1, .closed = turn % 2};
        isogi_result result = isogi_vol_mesh(p, &desc, &mesh);
        CHECK(result == (turn % 4 == 0 || !test_finite(desc.isovalue) ? ISOGI_INVALID : ISOGI_OK), "mesh: %s", isogi_result_string(result));
        isogi_vol_mesh_free(p, &mesh);
        isogi_vol_free(p);
    }
}

/* All of the box lies inside of minus infinity, but no path makes a cap of that. */
TEST(infinite_isovalues_are_misses_on_every_path) {
    double data[5 * 5 * 5];
    for (int i = 0; i < 125; i++) data[i] = i % 7;
    for (int path = 0; path < 5; path++) {
        isogi_context context = {.threads = 1, .force_path = path};
        isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {5, 5, 5}};
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
        for (int i = 0; i < 4; i++) {
            isogi_ray ray[70];
            isogi_hit hit[70];
            memset(ray, 0, sizeof ray);
            for (int k = 0; k < 70; k++) {
                for (int a = 0; a < 3; a++) ray[k].origin[a] = i & 2 ? 2.25 : -1.5, ray[k].dir[a] = 1;
                ray[k].flags = ISOGI_RAY_CAPPED, ray[k].isovalue = i & 1 ? (double)INFINITY : -(double)INFINITY;
            }
            isogi_vol_intersect(p, ray, 1, hit, NULL);
            CHECK(hit[0].side == 0, "path %d, alone: side %d at %g", path, hit[0].side, hit[0].t);
            isogi_vol_intersect(p, ray, 70, hit, NULL);
            CHECK(hit[69].side == 0, "path %d: side %d at %g", path, hit[69].side, hit[69].t);
            uint8_t hidden[70];
            float dirs[70][3];
            for (int k = 0; k < 70; k++) {
                memset(&hit[k], 0, sizeof hit[k]), hit[k].side = k % 2 ? 2 : 1;
                for (int a = 0; a < 3; a++) hit[k].cell[a] = 1, hit[k].local[a] = 0.5, dirs[k][a] = 1;
            }
            isogi_vol_occluded(p, ray, 70, hidden, NULL);
            isogi_vol_continue(p, hit, (const float(*)[3])dirs, NULL, ray[0].isovalue, ISOGI_RAY_CAPPED, 70, hit, NULL);
            for (int k = 0; k < 70; k++) CHECK(!hidden[k] && !hit[k].side, "path %d, ray %d", path, k);
        }
        isogi_vol_free(p);
    }
}

/* However far the ray comes from, and however short the piece: what holds a hit is no gap. */
TEST(short_pieces_of_far_rays_are_not_skipped) {
    static float data[8][8][8];
    isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {8, 8, 8}};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < 512; i++) data[i / 64][i / 8 % 8][i % 8] = (float)(i % 8);
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "%s", "build");
    for (int e = 9; e < 41; e++) { /* across an edge of the box */
        const double far = ldexp(1, e), chord = ldexp(far, -41);
        const isogi_ray ray = {.origin = {chord - far, far, 2.5}, .dir = {1, -1, 0}, .isovalue = chord / 2};
        const double range[1][2] = {{chord / 2, chord / 2}};
        double piece[2] = {0, 0}, t = ray.tmin;
        isogi_hit hit = {0};
        int pieces = 0;
        isogi_vol_intersect(p, &ray, 1, &hit, NULL);
        for (; pieces < 100 && isogi_vol_next_interval(p, &ray, range, 1, t, piece, NULL); pieces++, t = piece[1])
            CHECK(piece[1] > piece[0] && piece[0] >= t, "2^%d: %.17g to %.17g", e, piece[0], piece[1]);
        CHECK(hit.side == 1 && pieces > 0 && pieces < 100 && hit.t <= piece[1], "2^%d: side %d at %.17g, %d pieces", e, hit.side, hit.t,
              pieces);
    }
    isogi_vol_free(p);
}

/* Doubles so small that squares of a hundredth of the smallest normal number would be nothing: hits are those of ordinary ones. */
TEST(the_smallest_doubles_are_hit_like_others) {
    enum { N = 8, RAYS = 2000 };
    static double data[2][N * N * N];
    static const int powers[2] = {0, -1050};
    static isogi_ray rays[2][RAYS];
    static isogi_hit hits[2][RAYS];
    test_random r = {77};
    for (int i = 0; i < N * N * N; i++) data[0][i] = floor(random_range(&r, -1000, 1000)), data[1][i] = ldexp(data[0][i], powers[1]);
    for (int i = 0; i < RAYS; i++) {
        isogi_ray *ray = &rays[0][i];
        for (int a = 0; a < 3; a++) ray->origin[a] = random_range(&r, -1, N), ray->dir[a] = (float)random_range(&r, -1, 1);
        ray->isovalue = floor(random_range(&r, -900, 900)) + 0.5;
        rays[1][i] = *ray, rays[1][i].isovalue = ldexp(ray->isovalue, powers[1]);
    }
    for (int path = 0; path < 5; path++) {
        int other = 0;
        for (int k = 0; k < 2; k++) {
            isogi_volume v = {.data = data[k], .type = ISOGI_F64, .size = {N, N, N}};
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_pyramid *p = NULL;
            CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK && isogi_vol_intersect(p, rays[k], RAYS, hits[k], NULL) == ISOGI_OK,
                  "%d", k);
            isogi_vol_free(p);
        }
        for (int i = 0; i < RAYS; i++)
            other += hits[0][i].side != hits[1][i].side || (hits[0][i].side && fabs(hits[0][i].t - hits[1][i].t) > 1e-5);
        CHECK(!other, "path %d: %d of %d hits are others", path, other, RAYS);
    }
}

/* Descriptions of odd numbers are refused or understood, never followed into the woods. */
TEST(odd_descriptions_are_refused_or_understood) {
    test_random r = {4};
    long built = 0;
    for (int turn = 0; turn < (LONG_SUITE ? 200000 : 10000); turn++) {
        static double data[512];
        isogi_volume v = {.data = data + 64, .type = (isogi_type)(random_bits(&r) % 7), .size = {3, 4, 5}};
        isogi_pyramid *p = NULL;
        int n = (int)(random_bits(&r) % 3);
        for (int i = 0; i < n; i++) {
            int a = (int)(random_bits(&r) % 3);
            switch (random_bits(&r) % 9) {
            case 0: v.spacing[a] = odd_number(&r); break;
            case 1: v.origin[a] = odd_number(&r); break;
            case 2: v.axes[3 * a + (int)(random_bits(&r) % 3)] = odd_number(&r); break;
            case 3: v.scale = odd_number(&r); break;
            case 4: v.bias = odd_number(&r); break;
            case 5: v.size[a] = random_bits(&r) & 1 ? (size_t)random_bits(&r) : 0; break;
            case 6: v.stride[a] = random_bits(&r) & 1 ? PTRDIFF_MIN : PTRDIFF_MAX; break;
            case 7: v.first[a] = (size_t)(random_bits(&r) >> 10); break;
            case 8: v.halo_low[a] = random_bits(&r) & 1 ? 1 : (size_t)random_bits(&r); break;
            }
        }
        isogi_result result = isogi_volume_validate(&v);
        CHECK(result == ISOGI_OK || result == ISOGI_INVALID || result == ISOGI_TOO_LARGE, "%s", isogi_result_string(result));
        if (result != ISOGI_OK || v.stride[0] || v.stride[1] || v.stride[2]) continue;
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "valid, and cannot be built");
        if (turn % 10 == 0 && p) odd_calls(p, &r);
        isogi_vol_free(p), built++;
    }
    CHECK(built > 1000, "only %ld were built", built);
}

/* Values go up to 1e300: what scale and bias would take beyond is refused, just below it is built and has its range. */
TEST(scales_beyond_the_largest_value_are_refused) {
    static const double largest[6] = {255, 128, 65535, 32768, (double)FLT_MAX, 1};
    static const double data[8] = {0};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int sign = -1; sign <= 1; sign += 2) {
            isogi_volume v = {.data = data, .type = (isogi_type)type, .size = {2, 2, 2}};
            v.scale = sign * 0.999e300 / largest[type];
            CHECK(isogi_volume_validate(&v) == ISOGI_OK, "type %d, scale %g", type, v.scale);
            v.scale = sign * 1.001e300 / largest[type];
            CHECK(isogi_volume_validate(&v) == ISOGI_INVALID, "type %d, scale %g", type, v.scale);
            v.scale = 0.6e300 / largest[type], v.bias = sign * 0.6e300;
            CHECK(isogi_volume_validate(&v) == ISOGI_INVALID, "type %d, scale %g, bias %g", type, v.scale, v.bias);
            v.scale = 1, v.bias = sign * 0.999e300;
            CHECK(isogi_volume_validate(&v) == ISOGI_OK, "type %d, bias %g", type, v.bias);
            v.bias = sign * 1.001e300;
            CHECK(isogi_volume_validate(&v) == ISOGI_INVALID, "type %d, bias %g", type, v.bias);
        }
    float extreme[8] = {0, 1, 2, 3, 4, FLT_MAX, -FLT_MAX, 5};
    isogi_volume v = {.data = extreme, .type = ISOGI_F32, .size = {2, 2, 2}, .scale = -2.9e261};
    isogi_pyramid *p = NULL;
    double range[2];
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    isogi_vol_range(p, range);
    CHECK(range[0] <= -0.98e300 && range[0] >= -1e300 && range[1] >= 0.98e300 && range[1] <= 1e300, "%g..%g", range[0], range[1]);
    isogi_vol_free(p), p = NULL;
    v.scale = -1e300;
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_INVALID && !p, "values of 3e338");
}

TEST(calls_without_arguments_are_refused) {
    static const double data[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {2, 2, 2}};
    isogi_pyramid *p = NULL;
    isogi_ray ray = {.dir = {1, 0, 0}};
    isogi_hit hit = {0};
    isogi_bundle bundle = {0};
    isogi_mesh mesh = {0};
    isogi_mesh_desc desc = {0};
    float vector[1][3] = {{0}};
    double range[1][2] = {{0, 1}};
    size_t count = 7, at[3] = {0, 0, 0};
    uint8_t any;
    CHECK(isogi_vol_build(NULL, &v, NULL) == ISOGI_INVALID && isogi_vol_build(&p, NULL, NULL) == ISOGI_INVALID, "build");
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    CHECK(isogi_vol_intersect(p, NULL, 1, &hit, NULL) == ISOGI_INVALID && isogi_vol_intersect(p, &ray, 1, NULL, NULL) == ISOGI_INVALID,
          "intersect");
    CHECK(isogi_vol_occluded(NULL, &ray, 1, &any, NULL) == ISOGI_INVALID && isogi_vol_occluded(p, &ray, 1, NULL, NULL) == ISOGI_INVALID,
          "occluded");
    CHECK(isogi_vol_intersect_all(NULL, &ray, 1, 1, &hit, &count, NULL) == ISOGI_INVALID, "all");
    CHECK(isogi_vol_intersect_all(p, &ray, 1, 1, NULL, &count, NULL) == ISOGI_INVALID &&
              isogi_vol_intersect_all(p, &ray, 1, 0, NULL, NULL, NULL) == ISOGI_INVALID,
          "all");
    CHECK(isogi_vol_intersect_all(p, &ray, 2, SIZE_MAX / 2, &hit, &count, NULL) == ISOGI_TOO_LARGE && count == 7, "all: too many");
    CHECK(isogi_vol_continue(p, NULL, (const float(*)[3])vector, NULL, 0, 0, 1, &hit, NULL) == ISOGI_INVALID, "continue");
    CHECK(isogi_vol_continue(p, &hit, NULL, NULL, 0, 0, 1, &hit, NULL) == ISOGI_INVALID &&
              isogi_vol_continue(p, NULL, NULL, NULL, 0, 0, 0, NULL, NULL) == ISOGI_OK,
          "continue");
    CHECK(isogi_vol_bundle(p, NULL, (const float(*)[3])vector, 1, &hit, NULL) == ISOGI_INVALID &&
              isogi_vol_bundle(p, &bundle, NULL, 1, &hit, NULL) == ISOGI_INVALID,
          "bundle");
    CHECK(isogi_vol_bundle(p, &bundle, (const float(*)[3])vector, 1, NULL, NULL) == ISOGI_INVALID, "bundle");
    CHECK(isogi_vol_bundle_occluded(p, &bundle, (const float(*)[3])vector, 1, NULL, NULL) == ISOGI_INVALID, "bundle");
    CHECK(isogi_vol_bundle_occluded(NULL, &bundle, (const float(*)[3])vector, 1, &any, NULL) == ISOGI_INVALID, "bundle");
    CHECK(isogi_vol_bundle_all(NULL, &bundle, (const float(*)[3])vector, 1, 1, &hit, &count, NULL) == ISOGI_INVALID &&
              isogi_vol_bundle_all(p, NULL, (const float(*)[3])vector, 1, 1, &hit, &count, NULL) == ISOGI_INVALID &&
              isogi_vol_bundle_all(p, &bundle, NULL, 1, 1, &hit, &count, NULL) == ISOGI_INVALID &&
              isogi_vol_bundle_all(p, &bundle, (const float(*)[3])vector, 1, 1, NULL, &count, NULL) == ISOGI_INVALID &&
              isogi_vol_bundle_all(p, &bundle, (const float(*)[3])vector, 1, 0, NULL, NULL, NULL) == ISOGI_INVALID,
          "bundle, all hits");
    CHECK(isogi_vol_positions(p, NULL, 1, vector) == ISOGI_INVALID && isogi_vol_positions(p, &hit, 1, NULL) == ISOGI_INVALID, "positions");
    CHECK(isogi_vol_normals(p, &hit, 1, (isogi_normal_kind)9, vector) == ISOGI_INVALID &&
              isogi_vol_normals(NULL, &hit, 1, ISOGI_NORMAL_SMOOTH, vector) == ISOGI_INVALID,
          "normals");
    CHECK(isogi_vol_sample(p, NULL, 1, NULL, NULL) == ISOGI_INVALID &&
              isogi_vol_sample_smooth(NULL, (const float(*)[3])vector, 1, NULL, NULL) == ISOGI_INVALID,
          "sample");
    CHECK(isogi_vol_sample(p, (const float(*)[3])vector, 1, NULL, NULL) == ISOGI_OK, "nothing asked for");
    CHECK(isogi_vol_box_range(NULL, at, at, range[0]) == ISOGI_INVALID && isogi_vol_box_range(p, NULL, at, range[0]) == ISOGI_INVALID,
          "box");
    CHECK(!isogi_vol_may_hold(NULL, at, at, (const double(*)[2])range, 1) && !isogi_vol_may_hold(p, at, at, NULL, 1), "box");
    CHECK(!isogi_vol_next_interval(NULL, &ray, (const double(*)[2])range, 1, 0, range[0], NULL) &&
              !isogi_vol_next_interval(p, NULL, NULL, 1, 0, NULL, NULL),
          "interval");
    CHECK(isogi_vol_mesh(p, NULL, &mesh) == ISOGI_INVALID && isogi_vol_mesh(p, &desc, NULL) == ISOGI_INVALID &&
              isogi_vol_mesh(NULL, &desc, &mesh) == ISOGI_INVALID,
          "mesh");
    isogi_vol_mesh_free(NULL, NULL), isogi_vol_free(NULL);
    isogi_vol_free(p);
}

TEST_MAIN("vol_limits")
