/* Values and gradients of isogi_vol.h between voxels, against their definitions in double, for every path of instructions. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "test.h"
#if defined(__unix__)
#include <sys/mman.h>
#endif

typedef double real; /* 1e-15 against 2^-24, and quick where long double is emulated */
enum { PATHS = 5 };
static const isogi_filter filters[3] = {ISOGI_FILTER_LINEAR, ISOGI_FILTER_BSPLINE, ISOGI_FILTER_CATMULL_ROM};
static const char *const filter_names[3] = {"trilinear", "B-spline", "Catmull-Rom"};

/* ---- volumes of any type and layout ---- */

typedef struct lattice {
    int size[3], halo[2]; /* halo: voxels before and behind, the same on all axes */
    char *memory;
    isogi_volume volume;
    double least, most; /* of all decoded values */
} lattice;

static size_t type_size(isogi_type type) { return type <= ISOGI_I8 ? 1 : type <= ISOGI_I16 ? 2 : type == ISOGI_F32 ? 4 : 8; }

static char *raw_at(const lattice *l, int i, int j, int k) {
    return (char *)(uintptr_t)l->volume.data + i * l->volume.stride[0] + j * l->volume.stride[1] + k * l->volume.stride[2];
}

static double voxel(const lattice *l, int i, int j, int k) {
    const char *p = raw_at(l, i, j, k);
    double raw = 0;
    float f;
    uint16_t u;
    int16_t s;
    switch (l->volume.type) {
    case ISOGI_U8: raw = *(const uint8_t *)p; break;
    case ISOGI_I8: raw = *(const int8_t *)p; break;
    case ISOGI_U16: memcpy(&u, p, 2), raw = u; break;
    case ISOGI_I16: memcpy(&s, p, 2), raw = s; break;
    case ISOGI_F32: memcpy(&f, p, 4), raw = (double)f; break;
    case ISOGI_F64: memcpy(&raw, p, 8); break;
    }
    return (l->volume.scale == 0 ? 1 : l->volume.scale) * raw + l->volume.bias;
}

static void voxel_set(lattice *l, int i, int j, int k, double unit) {
    char *p = raw_at(l, i, j, k);
    float f = (float)(unit * 10 - 3);
    double d = unit * 10 - 3;
    uint16_t u = (uint16_t)(unit * 65535);
    int16_t s = (int16_t)(unit * 65535 - 32768);
    switch (l->volume.type) {
    case ISOGI_U8: *(uint8_t *)p = (uint8_t)(unit * 255); break;
    case ISOGI_I8: *(int8_t *)p = (int8_t)(unit * 255 - 128); break;
    case ISOGI_U16: memcpy(p, &u, 2); break;
    case ISOGI_I16: memcpy(p, &s, 2); break;
    case ISOGI_F32: memcpy(p, &f, 4); break;
    case ISOGI_F64: memcpy(p, &d, 8); break;
    }
}

enum { PACKED, INTERLEAVED, MIRRORED, CHUNK, LAYOUTS };

/* Random voxels; memory of exactly the size that the volume has, so that a sanitizer sees what is read beyond. */
static lattice lattice_new(isogi_type type, int layout, int x, int y, int z, test_random *r) {
    lattice l;
    memset(&l, 0, sizeof l);
    const ptrdiff_t bytes = (ptrdiff_t)type_size(type), step = layout == INTERLEAVED ? 3 * bytes : bytes;
    l.size[0] = x, l.size[1] = y, l.size[2] = z;
    l.halo[0] = layout == CHUNK ? 1 : 0, l.halo[1] = layout == CHUNK ? 2 : 0;
    size_t voxels = 1;
    ptrdiff_t stride = step, start = 0;
    for (int a = 0; a < 3; a++) {
        ptrdiff_t all = l.size[a] + l.halo[0] + l.halo[1];
        l.volume.size[a] = (size_t)l.size[a], l.volume.stride[a] = stride;
        l.volume.halo_low[a] = (size_t)l.halo[0], l.volume.halo_high[a] = (size_t)l.halo[1];
        start += l.halo[0] * stride;
        if (layout == MIRRORED && a > 0) start += (all - 1) * stride, l.volume.stride[a] = -stride;
        voxels *= (size_t)all, stride *= all;
    }
    l.memory = (char *)malloc(((voxels - 1) * (size_t)step + (size_t)bytes));
    l.volume.data = l.memory + start, l.volume.type = type;
    if (layout == PACKED || layout == CHUNK) l.volume.scale = -0.25, l.volume.bias = 7;
    l.least = 1e300, l.most = -1e300;
    for (int k = -l.halo[0]; k < z + l.halo[1]; k++)
        for (int j = -l.halo[0]; j < y + l.halo[1]; j++)
            for (int i = -l.halo[0]; i < x + l.halo[1]; i++) {
                voxel_set(&l, i, j, k, random_unit(r));
                l.least = fmin(l.least, voxel(&l, i, j, k)), l.most = fmax(l.most, voxel(&l, i, j, k));
            }
    return l;
}

/* ---- definitions ---- */

/* Basis functions about 0, and their derivatives. */
static real basis(isogi_filter filter, real x, int derivative) {
    const real a = fabs(x), s = x < 0 ? -1 : 1, b = 2 - a;
    if (filter == ISOGI_FILTER_LINEAR) return a >= 1 ? 0 : derivative ? -s : 1 - a;
    if (a >= 2) return 0;
    if (filter == ISOGI_FILTER_BSPLINE) {
        if (derivative) return s * (a < 1 ? (real)1.5 * a * a - 2 * a : -b * b / 2);
        return a < 1 ? ((real)4 - 6 * a * a + 3 * a * a * a) / 6 : b * b * b / 6;
    }
    if (derivative) return s * (a < 1 ? (real)4.5 * a * a - 5 * a : (real)-1.5 * a * a + 5 * a - 4);
    return a < 1 ? (real)1.5 * a * a * a - (real)2.5 * a * a + 1 : (real)-0.5 * a * a * a + (real)2.5 * a * a - 4 * a + 2;
}

/* Continued linearly beyond what the cubic filters may read: one voxel of a halo. */
static real continued(const lattice *l, int i, int j, int k) {
    const int at[3] = {i, j, k};
    for (int a = 0; a < 3; a++) {
        const int low = l->halo[0] ? -1 : 0, high = l->size[a] - 1 + (l->halo[1] ? 1 : 0);
        int near_border[3] = {i, j, k}, inner[3] = {i, j, k};
        if (at[a] >= low && at[a] <= high) continue;
        if (l->size[a] == 1) near_border[a] = inner[a] = 0;
        else near_border[a] = at[a] < low ? low : high, inner[a] = at[a] < low ? low + 1 : high - 1;
        return 2 * continued(l, near_border[0], near_border[1], near_border[2]) - continued(l, inner[0], inner[1], inner[2]);
    }
    return (real)voxel(l, i, j, k);
}

/* want: value and gradient per grid unit at g, which lies in the box; its cell counts upwards at faces. */
static void definition(const lattice *l, isogi_filter filter, const real g[3], real want[4]) {
    int cell[3];
    real weight[3][4], slope[3][4];
    for (int a = 0; a < 3; a++) {
        cell[a] = (int)g[a];
        if (cell[a] > l->size[a] - 2) cell[a] = l->size[a] > 1 ? l->size[a] - 2 : 0;
        for (int t = 0; t < 4; t++) {
            const real x = g[a] - (cell[a] + t - 1);
            const int flat = l->size[a] == 1;
            weight[a][t] = flat ? t == 1 : basis(filter, x, 0), slope[a][t] = flat ? 0 : basis(filter, x, 1);
            /* at the ends of a cell the derivative of its own line counts */
            if (filter == ISOGI_FILTER_LINEAR && !flat) slope[a][t] = t == 1 ? -1 : t == 2 ? 1 : 0;
        }
    }
    want[0] = want[1] = want[2] = want[3] = 0;
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++)
            for (int i = 0; i < 4; i++) {
                const real wx = weight[0][i], wy = weight[1][j], wz = weight[2][k], dx = slope[0][i], dy = slope[1][j], dz = slope[2][k];
                if (wx == 0 && dx == 0) continue;
                if ((wy == 0 && dy == 0) || (wz == 0 && dz == 0)) continue;
                const real v = continued(l, cell[0] + i - 1, cell[1] + j - 1, cell[2] + k - 1);
                want[0] += v * wx * wy * wz, want[1] += v * dx * wy * wz, want[2] += v * wx * dy * wz, want[3] += v * wx * wy * dz;
            }
}

/* ---- every filter, type, layout and path ---- */

/* Largest errors in units of 2^-24: of values, relative to the largest number; of gradients, to the range of the voxels. */
static void compare_lattice(const lattice *l, const isogi_pyramid *p, test_random *r, double worst[3][2]) {
    enum { COUNT = 150 };
    static float points[COUNT][3], values[COUNT], gradients[COUNT][3];
    static double grid[COUNT][3];
    double size = fmax(fmax(fabs(l->least), fabs(l->most)), fabs(l->volume.bias)), range = l->most - l->least;
    for (int i = 0; i < COUNT; i++)
        for (int a = 0; a < 3; a++) {
            double at = random_range(r, -0.1, 1.1) * (l->size[a] - 1);
            if (!(random_bits(r) % 5)) at = floor(at); /* spacings are powers of two: lattice planes are met exactly */
            points[i][a] = (float)(at * l->volume.spacing[a] + l->volume.origin[a]);
            grid[i][a] = ((double)points[i][a] - l->volume.origin[a]) / l->volume.spacing[a];
        }
    for (int f = 0; f < 3; f++)
        for (int from_grid = 0; from_grid < 2; from_grid++) {
            if (from_grid) isogi_vol_sample_grid(p, filters[f], (const double(*)[3])grid, COUNT, values, gradients);
            else isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points, COUNT, values, gradients);
            for (int i = 0; i < COUNT; i++) {
                real g[3], want[4];
                for (int a = 0; a < 3; a++) {
                    g[a] = (real)grid[i][a];
                    g[a] = g[a] < 0 ? 0 : g[a] > l->size[a] - 1 ? l->size[a] - 1 : g[a];
                }
                definition(l, filters[f], g, want);
                double error = fabs((double)((real)values[i] - want[0])) / size * 0x1p24;
                worst[f][0] = fmax(worst[f][0], error);
                for (int a = 0; a < 3; a++) {
                    error = fabs((double)((real)gradients[i][a] * (real)l->volume.spacing[a] - want[a + 1])) / range * 0x1p24;
                    worst[f][1] = fmax(worst[f][1], error);
                }
            }
        }
}

static void every_volume_on_path(int path) {
    test_random r = {1};
    double worst[3][2] = {{0}};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int layout = 0; layout < LAYOUTS; layout++)
            for (int n = 0; n < (LONG_SUITE ? 40 : 4); n++) {
                const int flat = n == 3 && layout != CHUNK;
                lattice l = lattice_new((isogi_type)type, layout, 2 + (int)(random_bits(&r) % 9), flat ? 1 : 2 + (int)(random_bits(&r) % 7),
                                        2 + (int)(random_bits(&r) % 8), &r);
                const isogi_context context = {.threads = 1, .force_path = path};
                isogi_pyramid *p = NULL;
                for (int a = 0; a < 3; a++) l.volume.spacing[a] = 0.25 * (1 << (a + type % 3)), l.volume.origin[a] = a - 1.5;
                isogi_result result = isogi_vol_build(&p, &l.volume, &context);
                CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
                compare_lattice(&l, p, &r, worst);
                isogi_vol_free(p);
                free(l.memory);
            }
    for (int f = 0; f < 3; f++) {
        printf("    path %d, %-11s: value %.2f, gradient %.2f in 2^-24 of the largest number, of the range\n", path, filter_names[f],
               worst[f][0], worst[f][1]);
        /* what the header states */
        CHECK(worst[f][0] < 8 * ROUNDING_FACTOR && worst[f][1] < 8 * ROUNDING_FACTOR, "path %d, %s: %g, %g", path, filter_names[f],
              worst[f][0], worst[f][1]);
    }
}

TEST(samples_agree_with_their_definition_by_default) { every_volume_on_path(0); }
TEST(samples_agree_with_their_definition_in_plain_code) { every_volume_on_path(1); }
TEST(samples_agree_with_their_definition_in_portable_code) { every_volume_on_path(2); }
TEST(samples_agree_with_their_definition_in_avx2) { every_volume_on_path(3); }
TEST(samples_agree_with_their_definition_in_avx512) { every_volume_on_path(4); }

/* ---- what voxels share ---- */

/* Stores the nearest number of the lattice's type to `raw`. */
static void raw_set(const lattice *l, int i, int j, int k, double raw) {
    char *p = raw_at(l, i, j, k);
    switch (l->volume.type) {
    case ISOGI_U8: *(uint8_t *)p = (uint8_t)raw; break;
    case ISOGI_I8: *(int8_t *)p = (int8_t)raw; break;
    case ISOGI_U16: memcpy(p, &(uint16_t){(uint16_t)raw}, 2); break;
    case ISOGI_I16: memcpy(p, &(int16_t){(int16_t)raw}, 2); break;
    case ISOGI_F32: memcpy(p, &(float){(float)raw}, 4); break;
    case ISOGI_F64: memcpy(p, &raw, 8); break;
    }
}

/* A lattice whose voxels are offset + step * n for n of 0 .. most; differences: the same voxels less the offset, decoded without bias. */
static void steps_on_offset(lattice *l, lattice *differences, double offset, double step, int most, test_random *r) {
    double scale = l->volume.scale == 0 ? 1 : l->volume.scale;
    differences->volume.scale = 1, differences->volume.bias = 0;
    for (int k = -l->halo[0]; k < l->size[2] + l->halo[1]; k++)
        for (int j = -l->halo[0]; j < l->size[1] + l->halo[1]; j++)
            for (int i = -l->halo[0]; i < l->size[0] + l->halo[1]; i++) {
                const double above = step * (double)(random_bits(r) % (uint64_t)(most + 1));
                raw_set(l, i, j, k, offset + above), raw_set(differences, i, j, k, scale * above);
            }
}

static void random_points(const lattice *l, int count, float (*points)[3], double (*grid)[3], test_random *r) {
    for (int i = 0; i < count; i++)
        for (int a = 0; a < 3; a++) {
            double at = random_range(r, -0.1, 1.1) * (l->size[a] - 1);
            if (!(random_bits(r) % 5)) at = floor(at);
            points[i][a] = (float)at, grid[i][a] = (double)points[i][a];
        }
}

/* Constant voxels have no gradient, and hits among them no normal, whatever the value, the type, the layout and the path. */
TEST(constant_voxels_have_no_gradient) {
    enum { COUNT = 60 };
    static float points[COUNT][3], values[COUNT], gradients[COUNT][3], normals[COUNT][3];
    static double grid[COUNT][3];
    static isogi_hit hits[COUNT];
    test_random r = {9};
    for (int n = 0; n < 6 * LAYOUTS * 4; n++) {
        const int path = 1 + n % 4, layout = n / 4 % LAYOUTS, type = n / 4 / LAYOUTS;
        lattice l = lattice_new((isogi_type)type, layout, 7, 6, 5, &r), ignored = lattice_new(ISOGI_F64, layout, 7, 6, 5, &r);
        const isogi_context context = {.threads = 1, .force_path = path};
        isogi_pyramid *p = NULL;
        if (n & 1) l.volume.scale = 0.37, l.volume.bias = 0.1;
        steps_on_offset(&l, &ignored, type == ISOGI_F64 ? 1.0 / 3 : type == ISOGI_F32 ? 0.7 : 101, 0, 0, &r);
        CHECK(isogi_vol_build(&p, &l.volume, &context) == ISOGI_OK, "built");
        random_points(&l, COUNT, points, grid, &r);
        const double constant = voxel(&l, 0, 0, 0), size = fmax(fabs(constant), fabs(l.volume.bias));
        for (int f = 0; f < 6; f++) {
            if (f < 3) isogi_vol_sample_grid(p, filters[f], (const double(*)[3])grid, COUNT, values, gradients);
            else isogi_vol_sample_filtered(p, filters[f - 3], (const float(*)[3])points, COUNT, values, gradients);
            for (int i = 0; i < COUNT; i++) {
                CHECK(fabs((double)values[i] - constant) <= 0x1p-21 * size * ROUNDING_FACTOR, "%.9g of %.9g", (double)values[i], constant);
                for (int a = 0; a < 3; a++)
                    CHECK(!(fabs((double)gradients[i][a]) > 0), "type %d, layout %d, path %d, %s: %g", type, layout, path,
                          filter_names[f % 3], (double)gradients[i][a]);
            }
        }
        for (int i = 0; i < COUNT; i++) {
            hits[i].side = 1;
            for (int a = 0; a < 3; a++)
                hits[i].cell[a] = (uint32_t)(random_bits(&r) % (uint64_t)(l.size[a] - 1)), hits[i].local[a] = random_unit(&r);
        }
        for (int kind = ISOGI_NORMAL_SMOOTH; kind <= ISOGI_NORMAL_TRILINEAR; kind++) {
            CHECK(isogi_vol_normals(p, hits, COUNT, (isogi_normal_kind)kind, normals) == ISOGI_OK, "normals");
            for (int i = 0; i < COUNT; i++)
                CHECK(!(fabs((double)normals[i][0]) + fabs((double)normals[i][1]) + fabs((double)normals[i][2]) > 0),
                      "type %d, layout %d, path %d, kind %d: %g %g %g", type, layout, path, kind, (double)normals[i][0],
                      (double)normals[i][1], (double)normals[i][2]);
        }
        isogi_vol_free(p);
        free(l.memory), free(ignored.memory);
    }
}

/* In the middle of a sheet of one voxel, of any values and anywhere on it, the smoothed gradient vanishes, and so does the normal:
   rounding alone would let it point anywhere. A thousandth of a voxel beside it, the normal is that of the sheet. So in a volume one of
   whose voxels, far away, is a million times as large. */
TEST(smoothed_normals_vanish_in_the_middle_of_a_sheet) {
    enum { SIDE = 12, COUNT = 200 };
    static double voxels[SIDE * SIDE * SIDE];
    static isogi_hit hits[COUNT];
    static float normals[COUNT][3];
    test_random r = {12};
    for (int n = 0; n < 4 * 3 * 4; n++) {
        const int path = 1 + n % 4, axis = n / 4 % 3, kind = n / 12;
        const isogi_context context = {.threads = 1, .force_path = path};
        const double high = kind == 1 ? 1000.3 : kind == 2 ? 7e-200 : 1, low = kind == 1 ? 999.1 : kind == 2 ? -3e-200 : -1;
        isogi_volume v = {.data = voxels, .type = ISOGI_F64, .size = {SIDE, SIDE, SIDE}};
        isogi_pyramid *p = NULL;
        for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
            const int place[3] = {i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
            voxels[i] = place[axis] == 6 ? high : low;
        }
        if (kind == 3) voxels[0] = 1e6;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "built");
        for (int beside = 0; beside < 2; beside++) {
            for (int i = 0; i < COUNT; i++) {
                hits[i].side = 1;
                for (int a = 0; a < 3; a++) hits[i].cell[a] = 3 + (uint32_t)(random_bits(&r) % 6), hits[i].local[a] = random_unit(&r);
                hits[i].cell[axis] = i % 2 ? 6 : 5, hits[i].local[axis] = i % 2 ? 0.001 * beside : 1 - 0.001 * beside;
            }
            isogi_vol_normals(p, hits, COUNT, ISOGI_NORMAL_SMOOTH, normals);
            for (int i = 0; i < COUNT; i++)
                for (int a = 0; a < 3; a++) {
                    const double expected = beside && a == axis ? i % 2 ? 1 : -1 : 0;
                    CHECK(fabs((double)normals[i][a] - expected) <= (beside ? 1e-6 : 0), "kind %d, path %d, axis %d: %g, expected %g", kind,
                          path, a, (double)normals[i][a], expected);
                }
        }
        isogi_vol_free(p);
    }
}

/* What is rounding is told by the voxels that count: a huge one whose weight is 0 changes no normal. */
TEST(smoothed_normals_go_by_voxels_that_count) {
    enum { SIDE = 12 };
    static double voxels[SIDE * SIDE * SIDE];
    const isogi_hit hit = {.cell = {4, 5, 6}, .local = {0.3, 0.4, 0}, .side = 1};
    for (int path = 1; path < 5; path++) {
        const isogi_context context = {.threads = 1, .force_path = path};
        isogi_volume v = {.data = voxels, .type = ISOGI_F64, .size = {SIDE, SIDE, SIDE}};
        isogi_pyramid *p = NULL;
        float n[1][3];
        for (int i = 0; i < SIDE * SIDE * SIDE; i++) voxels[i] = i / SIDE / SIDE == 8 ? 1e30 : i % SIDE;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "built");
        isogi_vol_normals(p, &hit, 1, ISOGI_NORMAL_SMOOTH, n);
        CHECK(fabs((double)n[0][0] + 1) < 1e-6, "path %d: %g %g %g", path, (double)n[0][0], (double)n[0][1], (double)n[0][2]);
        isogi_vol_free(p);
    }
}

/* The error of a gradient goes with the differences between voxels, whatever they have in common. */
TEST(gradients_do_not_suffer_from_an_offset) {
    enum { COUNT = 80, CASES = 6 };
    static const struct { isogi_type type; double offset, step; int most; double scale, bias; } cases[CASES] = {
        {ISOGI_F32, 1e6, 0.25, 40, 0, 0},     /* 1e6 and a small slope */
        {ISOGI_F32, 1048575, 0.0625, 15, 0, 0}, /* all but at a power of two: beyond the border steps of this size are no floats */
        {ISOGI_F64, 1e6, 0x1p-13, 40, 0, 0},    {ISOGI_F64, 1e12, 0.25, 7, -2, 1e9},
        {ISOGI_U8, 200, 1, 3, 1e-3, 1e7},       {ISOGI_I16, -30000, 1, 5, 1, 1e12}};
    static float points[COUNT][3], gradients[COUNT][3];
    static double grid[COUNT][3];
    test_random r = {10};
    for (int n = 0; n < CASES * LAYOUTS * 4; n++) {
        const int path = 1 + n % 4, layout = n / 4 % LAYOUTS, c = n / 4 / LAYOUTS;
        lattice l = lattice_new(cases[c].type, layout, 7, 6, 5, &r), differences = lattice_new(ISOGI_F64, layout, 7, 6, 5, &r);
        const isogi_context context = {.threads = 1, .force_path = path};
        isogi_pyramid *p = NULL;
        l.volume.scale = cases[c].scale, l.volume.bias = cases[c].bias;
        steps_on_offset(&l, &differences, cases[c].offset, cases[c].step, cases[c].most, &r);
        const double range = fabs(cases[c].step * cases[c].most * (cases[c].scale == 0 ? 1 : cases[c].scale));
        CHECK(isogi_vol_build(&p, &l.volume, &context) == ISOGI_OK, "built");
        random_points(&l, COUNT, points, grid, &r);
        for (int f = 0; f < 3; f++) {
            isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points, COUNT, NULL, gradients);
            for (int i = 0; i < COUNT; i++) {
                real g[3], want[4];
                for (int a = 0; a < 3; a++) g[a] = fmin(fmax(grid[i][a], 0), l.size[a] - 1);
                definition(&differences, filters[f], g, want);
                for (int a = 0; a < 3; a++)
                    CHECK(fabs((double)gradients[i][a] - want[a + 1]) <= (f ? 0x1p-20 : 0x1p-21) * range * ROUNDING_FACTOR,
                          "case %d, layout %d, path %d, %s at %g %g %g: %.9g, not %.9g", c, layout, path, filter_names[f], grid[i][0],
                          grid[i][1], grid[i][2], (double)gradients[i][a], want[a + 1]);
            }
        }
        isogi_vol_free(p);
        free(l.memory), free(differences.memory);
    }
}

/* Places are found in double, or in floats that are as good where the volume lets them: long rows of random voxels, whose samples change by
   all of the range from cell to cell, tell errors of places by 2^-24 cell. Against the plain code, which locates in double. */
static void compare_places(const lattice *l, const char *name, test_random *r) {
    enum { COUNT = 400 };
    static float points[COUNT][3], values[2][COUNT], gradients[2][COUNT][3];
    const double range = l->most - l->least, size = fmax(fabs(l->least), fabs(l->most));
    double worst[2] = {0, 0}, steepest = 0;
    isogi_pyramid *p[2] = {NULL, NULL};
    const isogi_context plain = {.threads = 1, .force_path = 1};
    CHECK(isogi_vol_build(&p[0], &l->volume, &plain) == ISOGI_OK, "built");
    for (int i = 0; i < COUNT; i++) {
        double grid[3], world[3];
        for (int a = 0; a < 3; a++) grid[a] = random_range(r, -0.1, 1.1) * (l->size[a] - 1);
        if (!(i % 5)) grid[i % 3] = floor(grid[i % 3]);
        if (!(i % 17)) grid[i % 3] *= 1e6;
        isogi_vol_to_world(p[0], grid, world);
        for (int a = 0; a < 3; a++) points[i][a] = (float)world[a];
    }
    for (int a = 0; a < 3; a++) steepest = fmax(steepest, 1 / l->volume.spacing[a]);
    for (int path = 2; path <= PATHS; path++) {
        const isogi_context context = {.threads = 1, .force_path = path % PATHS};
        CHECK(isogi_vol_build(&p[1], &l->volume, &context) == ISOGI_OK, "built");
        for (int f = 0; f < 3; f++) {
            for (int k = 0; k < 2; k++)
                CHECK(isogi_vol_sample_filtered(p[k], filters[f], (const float(*)[3])points, COUNT, values[k], gradients[k]) == ISOGI_OK,
                      "sampled");
            for (int i = 0; i < COUNT; i++) {
                double jump = 0;
                const float *g = gradients[1][i];
                if (!(test_finite((double)values[1][i]) && test_finite((double)g[0]) && test_finite((double)g[1]) &&
                      test_finite((double)g[2])))
                    worst[0] = 1;
                worst[0] = fmax(worst[0], fabs((double)values[0][i] - (double)values[1][i]) / size);
                for (int a = 0; a < 3; a++)
                    jump = fmax(jump, fabs((double)gradients[0][i][a] - (double)gradients[1][i][a]) / (range * steepest));
                /* on a lattice plane either cell has its trilinear gradient */
                if (f || i % 5) worst[1] = fmax(worst[1], jump);
            }
        }
        isogi_vol_free(p[1]);
    }
    printf("    %-9s: value %.2f, gradient %.2f in 2^-24 of the largest number, of the range\n", name, worst[0] * 0x1p24,
           worst[1] * 0x1p24);
    CHECK(worst[0] * 0x1p24 < 8 * ROUNDING_FACTOR && worst[1] * 0x1p24 < 8 * ROUNDING_FACTOR, "%s: %g, %g", name, worst[0] * 0x1p24,
          worst[1] * 0x1p24);
    isogi_vol_free(p[0]);
}

TEST(places_are_found_alike_on_every_path) {
    static const char *const names[4] = {"straight", "far", "turned", "stretched"};
    test_random r = {7};
    for (int kind = 0; kind < 4; kind++)
        for (int n = 0; n < 3; n++) {
            lattice l = lattice_new(n == 2 ? ISOGI_U8 : ISOGI_F32, PACKED, n ? 40 : 3000, n ? 50 : 4, n ? 30 : 5, &r);
            for (int a = 0; a < 3; a++) {
                l.volume.spacing[a] = kind == 3 ? exp(random_range(&r, -13, 13)) : random_range(&r, 0.001, 0.01);
                l.volume.origin[a] = l.volume.spacing[a] * (kind == 1 ? 123456.7 : random_range(&r, -4000, 4000));
            }
            if (kind == 2) {
                const double c = cos(1.1), s = sin(1.1), turned[9] = {c, -s * c, s * s, s, c * c, -c * s, 0, s, c};
                memcpy(l.volume.axes, turned, sizeof turned);
            }
            compare_places(&l, names[kind], &r);
            free(l.memory);
        }
}

/* Far along a long axis the first guess of a cell, in floats, is as unsure as it can be: right below its planes it must not be too high. */
TEST(places_right_below_planes_far_out_are_found) {
    enum { N = 8192, POINTS = 512 };
    static float voxel[4 * N], point[POINTS][3], value[POINTS];
    test_random r = {12};
    long over = 0;
    for (int i = 0; i < 4 * N; i++) voxel[i] = (float)(i % N & 1);
    for (int trial = 0; trial < 200; trial++) {
        /* the inverse of the spacing half an ulp of floats above one */
        const double m = (double)(float)(1 + ldexp(1 + random_range(&r, 0, 1), -3 - trial % 9)) - ldexp(0.4995, -23);
        const double at = -N + ldexp(0.004, -10);
        isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {N, 2, 2}, .spacing = {1 / m, 1, 1}, .origin = {-at / m, 0, 0}};
        isogi_context context = {.threads = 1, .force_path = trial % 4};
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
        for (int i = 0; i < POINTS; i++)
            point[i][0] = (float)(v.origin[0] + (8190 - i % 64 - random_range(&r, 0, 0.001)) / m), point[i][1] = point[i][2] = 0.5f;
        isogi_vol_sample(p, (const float(*)[3])point, POINTS, value, NULL);
        for (int i = 0; i < POINTS; i++) {
            const double grid = fmin(fmax(((double)point[i][0] - v.origin[0]) * m, 0), N - 1), cell = fmin(floor(grid), N - 2);
            const double right = fmod(cell, 2) > 0 ? 1 - (grid - cell) : grid - cell;
            over += fabs((double)value[i] - right) > ldexp(1, -21);
        }
        isogi_vol_free(p);
    }
    CHECK(over == 0, "%ld of %d beyond 2^-21", over, 200 * POINTS);
}

/* Voxels whose difference is beyond floats: the gradient is not, and is the same on every path. */
TEST(gradients_between_huge_floats_are_numbers) {
    for (int k = 0; k < 6; k++) {
        static float voxel[8] = {2e38f, -2e38f, -2e38f, 1e38f, 0, -2e38f, 2e38f, -2e38f};
        isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {2, 2, 2}, .spacing = {10, 10, 10}, .scale = k & 1 ? 1e-38 : 1};
        float point[1][3] = {{2, 3, 4}}, value[2][1], gradient[2][1][3];
        for (int plain = 0; plain < 2; plain++) {
            isogi_context context = {.threads = 1, .force_path = plain ? 1 : k / 2 + (k > 1)};
            isogi_pyramid *p = NULL;
            CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
            isogi_vol_sample(p, (const float(*)[3])point, 1, value[plain], gradient[plain]);
            isogi_vol_free(p);
        }
        for (int a = 0; a < 3; a++)
            CHECK(fabs((double)gradient[0][0][a] - (double)gradient[1][0][a]) <= 1e-5 * fabs((double)gradient[1][0][a]),
                  "case %d, axis %d: %g, plainly %g", k, a, (double)gradient[0][0][a], (double)gradient[1][0][a]);
        CHECK(isfinite(gradient[1][0][0]) && fabs((double)gradient[1][0][0]) > 0, "case %d: %g", k, (double)gradient[1][0][0]);
    }
}

TEST(the_size_of_a_call_changes_no_bit) {
    enum { COUNT = 333 };
    static float points[COUNT][3], whole[COUNT], parts[COUNT], whole_gradients[COUNT][3], part_gradients[COUNT][3];
    test_random r = {2};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int path = 0; path < PATHS; path++) {
            lattice l = lattice_new((isogi_type)type, PACKED, 9, 11, 10, &r);
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_pyramid *p = NULL;
            isogi_vol_build(&p, &l.volume, &context);
            for (int i = 0; i < COUNT; i++)
                for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, -0.5, l.size[a] - 0.5);
            for (int f = 0; f < 3; f++) {
                isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points, COUNT, whole, whole_gradients);
                for (int i = 0, n; i < COUNT; i += n) {
                    n = 1 + (int)(random_bits(&r) % 20);
                    if (n > COUNT - i) n = COUNT - i;
                    isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points + i, (size_t)n, parts + i, part_gradients + i);
                }
                CHECK(!memcmp(whole, parts, sizeof whole) && !memcmp(whole_gradients, part_gradients, sizeof whole_gradients),
                      "type %d path %d %s", type, path, filter_names[f]);
                isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points, COUNT, parts, NULL);
                CHECK(!memcmp(whole, parts, sizeof whole), "type %d path %d %s: values without gradients", type, path, filter_names[f]);
            }
            isogi_vol_free(p);
            free(l.memory);
        }
}

/* Calls of one point, and of few, have ways of their own: for each type, layout and way to tell where points are, at the border, outside,
   and where an axis has one voxel; values, gradients, or both. */
TEST(few_points_have_the_bits_of_many) {
    enum { COUNT = 36, PATHS_OF_BLOCKS = 3 };
    static float points[COUNT][3], value[2][COUNT], gradient[2][COUNT][3];
    static double grid[COUNT][3];
    test_random r = {13};
    for (int n = 0; n < 6 * 4 * LAYOUTS * PATHS_OF_BLOCKS; n++) {
        const int path = 2 + n % PATHS_OF_BLOCKS, kind = n / PATHS_OF_BLOCKS, layout = kind % LAYOUTS, oriented = kind / LAYOUTS % 2;
        const int from_grid = kind / LAYOUTS / 2 % 2;
        const int y = layout == CHUNK || kind % 3 ? 4 : 1, z = (layout == CHUNK ? 2 : 1) + kind % 5;
        lattice l = lattice_new((isogi_type)(kind / LAYOUTS / 4), layout, 5, y, z, &r);
        const isogi_context context = {.threads = 1, .force_path = path};
        isogi_pyramid *p = NULL;
        l.volume.spacing[kind % 3] = 0.7;
        for (int a = 0; a < 3; a++) l.volume.origin[a] = 1.7 - 2 * a;
        for (int a = 0; a < 3 && oriented; a++) l.volume.axes[4 * a] = 1, l.volume.axes[3 * a + (a + 1) % 3] = 0.25;
        CHECK(isogi_vol_build(&p, &l.volume, &context) == ISOGI_OK, "built");
        for (int i = 0; i < COUNT; i++) {
            double world[3];
            for (int a = 0; a < 3; a++) grid[i][a] = random_range(&r, -1, l.size[a]);
            if (i % 8 == 7) grid[i][i % 3] = floor(grid[i][i % 3]);
            isogi_vol_to_world(p, grid[i], world);
            for (int a = 0; a < 3; a++) points[i][a] = (float)world[a];
        }
        for (int f = 0; f < 3; f++)
            for (int few = COUNT; few; few = few == COUNT ? 9 : few - 1)
                for (int i = 0; i < COUNT; i += few) {
                    const size_t count = (size_t)(few < COUNT - i ? few : COUNT - i);
                    float *v = few < COUNT && (few + i) % 3 == 0 ? NULL : value[few < COUNT] + i;
                    float(*g)[3] = few < COUNT && (few + i) % 3 == 1 ? NULL : gradient[few < COUNT] + i;
                    if (from_grid) isogi_vol_sample_grid(p, filters[f], (const double(*)[3])grid + i, count, v, g);
                    else isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points + i, count, v, g);
                    CHECK((!v || !memcmp(v, value[0] + i, count * sizeof *v)) && (!g || !memcmp(g, gradient[0] + i, count * sizeof *g)),
                          "type %d, layout %d, path %d, %s, axes %d, grid %d: %d points from %d on", (int)l.volume.type, layout, path,
                          filter_names[f], oriented, from_grid, few, i);
                }
        isogi_vol_free(p);
        free(l.memory);
    }
}

/* ---- places that are none, calls that are wrong ---- */

TEST(points_that_are_not_finite_lie_somewhere_in_the_box) {
    test_random r = {3};
    const float odd[4] = {NAN, INFINITY, -INFINITY, 3e38f};
    for (int path = 0; path < PATHS; path++) {
        lattice l = lattice_new(ISOGI_U8, PACKED, 6, 7, 8, &r);
        const isogi_context context = {.threads = 1, .force_path = path};
        isogi_pyramid *p = NULL;
        isogi_vol_build(&p, &l.volume, &context);
        for (int f = 0; f < 2; f++)
            for (int i = 0; i < 64; i++) {
                float point[1][3] = {{odd[i & 3], i & 4 ? odd[i >> 3 & 3] : 2.5f, i & 32 ? odd[i >> 4 & 3] : 1.5f}}, value = -1e9f, g[1][3];
                isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])point, 1, &value, g);
                CHECK((double)value >= l.least - 1e-3 && (double)value <= l.most + 1e-3, "path %d: %g", path, (double)value);
            }
        isogi_vol_free(p);
        free(l.memory);
    }
}

TEST(wrong_calls_are_refused) {
    test_random r = {4};
    lattice l = lattice_new(ISOGI_F32, PACKED, 4, 4, 4, &r);
    isogi_pyramid *p = NULL;
    float point[1][3] = {{1, 1, 1}}, value = 5, coefficients[64];
    double grid[1][3] = {{1, 1, 1}};
    isogi_vol_build(&p, &l.volume, NULL);
    CHECK(isogi_vol_sample(NULL, (const float(*)[3])point, 1, &value, NULL) == ISOGI_INVALID, "no pyramid");
    CHECK(isogi_vol_sample(p, NULL, 1, &value, NULL) == ISOGI_INVALID, "no points");
    CHECK(isogi_vol_sample_grid(p, ISOGI_FILTER_LINEAR, NULL, 1, &value, NULL) == ISOGI_INVALID, "no points");
    CHECK(isogi_vol_sample_grid(p, (isogi_filter)7, (const double(*)[3])grid, 1, &value, NULL) == ISOGI_INVALID, "no filter");
    CHECK(isogi_vol_sample(p, NULL, 0, NULL, NULL) == ISOGI_OK && isogi_vol_sample(p, (const float(*)[3])point, 1, NULL, NULL) == ISOGI_OK,
          "nothing to do");
    CHECK(value == 5, "a refused call wrote");
    CHECK(isogi_vol_prefilter(NULL, coefficients, NULL) == ISOGI_INVALID && isogi_vol_prefilter(&l.volume, NULL, NULL) == ISOGI_INVALID,
          "prefilter");
    isogi_vol_free(p);
    free(l.memory);
}

/* The last voxel of a volume is the last byte before memory that must not be read. */
TEST(nothing_is_read_beyond_the_volume) {
#if defined(__unix__) && defined(MAP_ANONYMOUS)
    const size_t page = 65536, voxels = 5 * 6 * 7;
    char *memory = (char *)mmap(NULL, 3 * page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == (char *)MAP_FAILED || mprotect(memory + page, page, PROT_READ | PROT_WRITE)) SKIP("no memory to be protected");
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int at_end = 0; at_end < 2; at_end++)
            for (int path = 0; path < PATHS; path++) {
                const isogi_context context = {.threads = 1, .force_path = path};
                isogi_volume v = {.type = (isogi_type)type, .size = {5, 6, 7}};
                isogi_pyramid *p = NULL;
                v.data = at_end ? memory + 2 * page - voxels * type_size((isogi_type)type) : memory + page;
                isogi_vol_build(&p, &v, &context);
                for (int f = 0; f < 3; f++)
                    for (int k = 0; k < 14; k++)
                        for (int j = 0; j < 12; j++) {
                            float points[10][3], values[10], gradients[10][3];
                            for (int i = 0; i < 10; i++)
                                points[i][0] = 0.5f * (float)i, points[i][1] = 0.5f * (float)j, points[i][2] = 0.5f * (float)k;
                            isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])points, 10, values, gradients);
                            CHECK(values[3] == 0 && gradients[3][1] == 0, "%g", (double)values[3]);
                        }
                isogi_vol_free(p);
            }
    munmap(memory, 3 * page);
#else
    SKIP("needs memory that can be protected");
#endif
}

/* Pages that hold `bytes` at their end, with nothing behind; NULL if there is no such memory. */
static char *fenced(size_t bytes) {
#if defined(__unix__)
    const size_t page = 4096, all = (bytes + page - 1) / page * page;
    char *memory = (char *)mmap(NULL, all + page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == (char *)MAP_FAILED || mprotect(memory, all, PROT_READ | PROT_WRITE)) return NULL;
    return memory + all - bytes;
#else
    (void)bytes;
    return NULL;
#endif
}

/* Of any number of points; what is not asked for changes nothing in what is. */
TEST(nothing_is_read_or_written_beyond_the_points) {
    enum { MOST = 70 };
    static float values[MOST], gradients[MOST][3];
    float *points = (float *)(void *)fenced(sizeof gradients), *value = (float *)(void *)fenced(sizeof values);
    float *gradient = (float *)(void *)fenced(sizeof gradients);
    test_random r = {11};
    if (!points || !value || !gradient) SKIP("no memory to be protected");
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int path = 0; path < PATHS; path++) {
            lattice l = lattice_new((isogi_type)type, PACKED, 9, 11, 10, &r);
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_pyramid *p = NULL;
            CHECK(isogi_vol_build(&p, &l.volume, &context) == ISOGI_OK, "built");
            for (int f = 0; f < 3; f++)
                for (int n = 1; n <= MOST; n++) {
                    float *at = points + 3 * (MOST - n), *v = value + (MOST - n), *g = gradient + 3 * (MOST - n);
                    for (int i = 0; i < 3 * n; i++) at[i] = (float)random_range(&r, -0.5, 9);
                    isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])(void *)at, (size_t)n, values, gradients);
                    isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])(void *)at, (size_t)n, v, NULL);
                    isogi_vol_sample_filtered(p, filters[f], (const float(*)[3])(void *)at, (size_t)n, NULL, (float(*)[3])(void *)g);
                    CHECK(!memcmp(values, v, (size_t)n * sizeof *v) && !memcmp(gradients, g, 3 * (size_t)n * sizeof *g),
                          "type %d, path %d, filter %d: %d points", type, path, f, n);
                }
            isogi_vol_free(p);
            free(l.memory);
        }
}

/* Scales that floats do not reach, of voxels that make up for it. */
TEST(scales_beyond_floats) {
    enum { COUNT = 60 };
    static float data[6 * 6 * 6], points[COUNT][3], values[COUNT], gradients[COUNT][3];
    test_random r = {12};
    for (int n = 0; n < 2; n++)
        for (int path = 0; path < PATHS; path++) {
            const double unit = n ? 1e20 : 1e-20;
            const isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {6, 6, 6}, .scale = n ? 1e-41 : 1e41};
            const isogi_context context = {.threads = 1, .force_path = path}, plain = {.threads = 1, .force_path = 1};
            isogi_pyramid *p[2] = {NULL, NULL};
            const double most = unit * v.scale;
            for (int i = 0; i < 216; i++) data[i] = (float)(unit * random_range(&r, -1, 1));
            for (int i = 0; i < COUNT; i++)
                for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, 0, 5);
            CHECK(isogi_vol_build(&p[0], &v, &context) == ISOGI_OK && isogi_vol_build(&p[1], &v, &plain) == ISOGI_OK, "built");
            for (int f = 0; f < 3; f++) {
                float value[COUNT], gradient[COUNT][3];
                isogi_vol_sample_filtered(p[0], filters[f], (const float(*)[3])points, COUNT, values, gradients);
                isogi_vol_sample_filtered(p[1], filters[f], (const float(*)[3])points, COUNT, value, gradient);
                for (int i = 0; i < COUNT; i++) {
                    CHECK(fabs((double)values[i] - (double)value[i]) < 1e-6 * most, "path %d, filter %d: %g, not %g of %g", path, f,
                          (double)values[i], (double)value[i], most);
                    for (int a = 0; a < 3; a++)
                        CHECK(fabs((double)gradients[i][a] - (double)gradient[i][a]) < 4e-6 * most, "path %d, filter %d: %g, not %g of %g",
                              path, f, (double)gradients[i][a], (double)gradient[i][a], most);
                }
            }
            isogi_vol_free(p[0]), isogi_vol_free(p[1]);
        }
}

/* ---- interpolation ---- */

static double marschner_lobb(double x, double y, double z, double gradient[3]) {
    const double pi = 3.14159265358979323846, radius = sqrt(x * x + y * y), phase = 12 * pi * cos(pi * radius / 2);
    /* d/dr of 0.25 cos(12 pi cos(pi r / 2)) / 2.5 */
    const double slope = 0.1 * sin(phase) * 6 * pi * pi * sin(pi * radius / 2);
    gradient[0] = radius > 0 ? slope * x / radius : 0, gradient[1] = radius > 0 ? slope * y / radius : 0;
    gradient[2] = -0.2 * pi * cos(pi * z / 2);
    return (1 - sin(pi * z / 2) + 0.25 * (1 + cos(phase))) / 2.5;
}

/* The signal that such filters are tested by, at N voxels a side: root mean square error of values, mean angle between gradients, and how
   far samples
   leave the range of their 64 voxels, relative to the range of the field. */
TEST(interpolation_of_marschner_lobb_errs_as_stated) {
    enum { SIZES = 2, COUNT = 20000, METHODS = 4 };
    const int sizes[SIZES] = {41, 81};
    const char *const names[METHODS] = {"trilinear", "B-spline", "Catmull-Rom", "prefiltered"};
    /* as isogi_vol.h has them, to half of their last digit */
    static const double stated[SIZES][METHODS][3] = {{{0.034, 32, 0}, {0.046, 20, 0}, {0.025, 22, 0}, {0.016, 12, 0.003}},
                                                     {{0.010, 17, 0}, {0.017, 3.2, 0}, {0.0025, 4.4, 0.006}, {0.0004, 0.7, 0.012}}};
    static const double last[3] = {5e-5, 0.05, 5e-4};
    double rms[SIZES][METHODS], angle[SIZES][METHODS], over[SIZES][METHODS];
    test_random r = {5};
    for (int s = 0; s < SIZES; s++) {
        const int n = sizes[s];
        const size_t voxels = (size_t)n * (size_t)n * (size_t)n;
        float *data = (float *)malloc(voxels * sizeof(float)), *coefficients = (float *)malloc(voxels * sizeof(float));
        float(*points)[3] = (float(*)[3])malloc(COUNT * sizeof *points), (*gradients)[3] = (float(*)[3])malloc(COUNT * sizeof *gradients);
        float *values = (float *)malloc(COUNT * sizeof *values);
        double unused[3], h = 2.0 / (n - 1);
        for (size_t i = 0; i < voxels; i++)
            data[i] = (float)marschner_lobb(-1 + h * (double)(i % (size_t)n), -1 + h * (double)(i / (size_t)n % (size_t)n),
                                            -1 + h * (double)(i / (size_t)n / (size_t)n), unused);
        isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {(size_t)n, (size_t)n, (size_t)n}};
        for (int a = 0; a < 3; a++) v.spacing[a] = h, v.origin[a] = -1;
        isogi_volume c = v;
        c.data = coefficients;
        CHECK(isogi_vol_prefilter(&v, coefficients, NULL) == ISOGI_OK, "prefilter");
        isogi_pyramid *p[2] = {NULL, NULL};
        isogi_vol_build(&p[0], &v, NULL), isogi_vol_build(&p[1], &c, NULL);
        for (int i = 0; i < COUNT; i++)
            for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, -0.9, 0.9);
        for (int m = 0; m < METHODS; m++) {
            double sum = 0, angles = 0, most = 0;
            isogi_vol_sample_filtered(p[m == 3], m == 3 ? ISOGI_FILTER_BSPLINE : filters[m], (const float(*)[3])points, COUNT, values,
                                      gradients);
            for (int i = 0; i < COUNT; i++) {
                double g[3], dot = 0, l0 = 0, l1 = 0, low = 1e300, high = -1e300,
                             at[3] = {(double)points[i][0], (double)points[i][1], (double)points[i][2]};
                double truth = marschner_lobb(at[0], at[1], at[2], g), value = (double)values[i];
                sum += (value - truth) * (value - truth);
                for (int a = 0; a < 3; a++)
                    dot += g[a] * (double)gradients[i][a], l0 += g[a] * g[a], l1 += (double)gradients[i][a] * (double)gradients[i][a];
                angles += l1 > 0 ? acos(fmax(-1, fmin(1, dot / sqrt(l0 * l1)))) : 0;
                for (int t = 0; t < 64; t++) {
                    int cell[3], tap[3] = {t & 3, t >> 2 & 3, t >> 4};
                    for (int a = 0; a < 3; a++) cell[a] = (int)((at[a] + 1) / h) + tap[a] - 1;
                    double x = (double)data[cell[0] + n * (cell[1] + n * cell[2])];
                    low = fmin(low, x), high = fmax(high, x);
                }
                most = fmax(most, fmax(low - value, value - high));
            }
            rms[s][m] = sqrt(sum / COUNT), angle[s][m] = angles / COUNT * 180 / 3.14159265358979323846, over[s][m] = fmax(most, 0);
            printf("    %d^3 %-11s: value RMS %.4f, gradient %.1f degrees, overshoot %.4f\n", n, names[m], rms[s][m], angle[s][m],
                   over[s][m]);
            for (int k = 0; k < 3; k++) {
                const double measured = k == 0 ? rms[s][m] : k == 1 ? angle[s][m] : over[s][m];
                CHECK(fabs(measured - stated[s][m][k]) <= last[k] + 0.05 * stated[s][m][k], "%d^3 %s, number %d: %g, not %g", n, names[m],
                      k, measured, stated[s][m][k]);
            }
        }
        isogi_vol_free(p[0]), isogi_vol_free(p[1]);
        free(data), free(coefficients), free(points), free(gradients), free(values);
    }
    CHECK(rms[0][2] < rms[0][0] && rms[0][3] < rms[0][2] && rms[0][0] < rms[0][1], "order of errors at 41^3");
    /* fourth and third order against second, where the signal is resolved */
    CHECK(rms[1][3] < 0.2 * rms[1][0] && rms[1][2] < 0.5 * rms[1][0], "prefiltered %g, Catmull-Rom %g, trilinear %g", rms[1][3], rms[1][2],
          rms[1][0]);
    CHECK(angle[1][3] < angle[1][2] && angle[1][2] < angle[1][0], "gradients");
    /* weights that are not negative, and sum to 1, stay within the voxels up to rounding */
    CHECK(over[0][0] < 1e-6 && over[0][1] < 1e-6, "overshoot without negative weights: %g, %g", over[0][0], over[0][1]);
    CHECK(over[0][2] < 0.1 && over[0][3] < 0.1, "overshoot: %g, %g", over[0][2], over[0][3]);
}

TEST(interpolating_filters_pass_through_the_voxels) {
    test_random r = {6};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int layout = 0; layout < MIRRORED; layout++)
            for (int n = 1; n < 8; n++) {
                lattice l = lattice_new((isogi_type)type, layout, n, 8 - n, 5, &r);
                const size_t voxels = (size_t)l.size[0] * (size_t)l.size[1] * (size_t)l.size[2];
                float *coefficients = (float *)malloc(voxels * sizeof(float)), value[2];
                isogi_pyramid *p[2] = {NULL, NULL};
                isogi_volume c = {.data = coefficients, .type = ISOGI_F32};
                for (int a = 0; a < 3; a++) c.size[a] = l.volume.size[a];
                CHECK(isogi_vol_prefilter(&l.volume, coefficients, NULL) == ISOGI_OK, "prefilter");
                isogi_vol_build(&p[0], &l.volume, NULL), isogi_vol_build(&p[1], &c, NULL);
                for (size_t i = 0; i < voxels; i++) {
                    int at[3] = {(int)(i % c.size[0]), (int)(i / c.size[0] % c.size[1]), (int)(i / c.size[0] / c.size[1])};
                    double grid[1][3] = {{at[0], at[1], at[2]}}, truth = voxel(&l, at[0], at[1], at[2]),
                           size = fmax(fabs(l.least), fabs(l.most));
                    isogi_vol_sample_grid(p[0], ISOGI_FILTER_CATMULL_ROM, (const double(*)[3])grid, 1, &value[0], NULL);
                    isogi_vol_sample_grid(p[1], ISOGI_FILTER_BSPLINE, (const double(*)[3])grid, 1, &value[1], NULL);
                    /* coefficients grow by 3 for each axis at most, and are floats */
                    CHECK(fabs((double)value[0] - truth) < 1e-6 * size, "Catmull-Rom %g, not %g", (double)value[0], truth);
                    CHECK(fabs((double)value[1] - truth) < 1e-5 * size, "prefiltered %g, not %g", (double)value[1], truth);
                }
                isogi_vol_free(p[0]), isogi_vol_free(p[1]);
                free(coefficients), free(l.memory);
            }
}

/* Voxels near the largest float: linear continuation beyond a corner makes them up to 27 times as large, differences twice. */
TEST(huge_values_stay_finite_at_the_border) {
    static float data[6 * 6 * 6];
    const double points[3][3] = {{2.3, 2.4, 2.6}, {0.3, 0.4, 0.6}, {4.9, 0.1, 2.5}};
    const float largest[4] = {9e35f, 2e36f, 4e37f, 3e38f};
    isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {6, 6, 6}};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 216; i++) data[i] = (i % 6 + i / 6 % 6 + i / 36) & 1 ? largest[k] : -largest[k];
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.force_path = path};
            isogi_pyramid *p = NULL;
            float value[3];
            CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "%g", (double)largest[k]);
            for (int f = ISOGI_FILTER_BSPLINE; f <= ISOGI_FILTER_CATMULL_ROM; f++) {
                CHECK(isogi_vol_sample_grid(p, (isogi_filter)f, points, 3, value, NULL) == ISOGI_OK, "%g", (double)largest[k]);
                for (int i = 0; i < 3; i++)
                    CHECK(test_finite((double)value[i]) && fabs((double)value[i]) < 1.5 * (double)largest[k],
                          "path %d, filter %d, point %d: %g of %g", path, f, i, (double)value[i], (double)largest[k]);
            }
            isogi_vol_free(p);
        }
    }
}

/* The same of the largest doubles, whose differences are no doubles. */
TEST(huge_doubles_stay_finite) {
    static double data[6 * 6 * 6];
    const double points[3][3] = {{2.3, 2.4, 2.6}, {0.3, 0.4, 0.6}, {4.9, 0.1, 2.5}};
    const isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {6, 6, 6}, .scale = 1e-300};
    for (int i = 0; i < 216; i++) data[i] = (i % 6 + i / 6 % 6 + i / 36) & 1 ? 1.7e308 : -1.7e308;
    for (int path = 1; path <= 4; path++) {
        const isogi_context context = {.force_path = path};
        isogi_pyramid *p = NULL;
        float value[3], gradient[3][3];
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "built");
        for (int f = ISOGI_FILTER_BSPLINE; f <= ISOGI_FILTER_CATMULL_ROM; f++) {
            CHECK(isogi_vol_sample_grid(p, (isogi_filter)f, points, 3, value, gradient) == ISOGI_OK, "sampled");
            for (int i = 0; i < 3; i++) {
                double most = 0;
                for (int a = 0; a < 3; a++) most = test_finite((double)gradient[i][a]) ? fmax(most, fabs((double)gradient[i][a])) : 1e300;
                CHECK(test_finite((double)value[i]) && fabs((double)value[i]) < 1.5 * 1.7e8 && most < 6 * 1.7e8,
                      "path %d, filter %d, point %d: %g, gradient to %g", path, f, i, (double)value[i], most);
            }
        }
        isogi_vol_free(p);
    }
}

/* Prefiltered, voxels beyond what its floats can hold spoil none but themselves. */
TEST(prefiltered_coefficients_are_finite) {
    static const double large[4] = {1e36, 9e36, 1e40, 1e300};
    for (int k = 0; k < 4; k++) {
        double data[6][6][6];
        float out[216];
        isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {6, 6, 6}};
        for (int i = 0; i < 216; i++)
            data[i / 36][i / 6 % 6][i % 6] = i == 100 || k < 2 ? ((i / 36 + i / 6 + i) % 2 ? large[k] : -large[k]) : 1;
        CHECK(isogi_vol_prefilter(&v, out, NULL) == ISOGI_OK, "%g", large[k]);
        for (int i = 0; i < 216; i++) CHECK(test_finite((double)out[i]), "%g: coefficient %d is %g", large[k], i, (double)out[i]);
    }
}

TEST_MAIN("sample")
