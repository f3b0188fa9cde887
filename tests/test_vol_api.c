/* Properties of the calls around the rays of isogi_vol.h: voxels read one by one, all hits of a ray, bundles, value ranges, updates,
   chunks with a halo, fields given by a callback, very large volumes, arguments that make no sense. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include <float.h>

/* ---- volumes for tests ---- */

typedef struct field {
    int size[3];
    double *value;
    isogi_volume volume;
    isogi_pyramid *pyramid;
} field;

static field field_new(int x, int y, int z) {
    field f = {{x, y, z}, (double *)calloc((size_t)x * (size_t)y * (size_t)z, sizeof(double)), {0}, NULL};
    f.volume.data = f.value, f.volume.type = ISOGI_F64;
    for (int a = 0; a < 3; a++) f.volume.size[a] = (size_t)f.size[a];
    return f;
}

static double *field_at(const field *f, int i, int j, int k) { return &f->value[i + f->size[0] * (j + f->size[1] * k)]; }

/* Every instruction path in turn, so that what holds for one volume after the other holds for all of them. */
static void field_build(field *f) {
    static int builds;
    isogi_context context = {.threads = 1, .force_path = builds++ % 5};
    isogi_result result = isogi_vol_build(&f->pyramid, &f->volume, &context);
    CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
}

static void field_free(field *f) {
    isogi_vol_free(f->pyramid);
    free(f->value);
}

enum { NOISE, SMOOTH, QUANTISED, KINDS };

/* White noise; a sum of a few waves; the same rounded to few levels, so that isovalues can equal data. */
static void field_fill(field *f, int kind, test_random *r) {
    double wave[4][4];
    for (int w = 0; w < 4; w++)
        for (int a = 0; a < 4; a++) wave[w][a] = random_range(r, -1, 1) * (a < 3 ? 0.9 : 6.28);
    for (int k = 0; k < f->size[2]; k++)
        for (int j = 0; j < f->size[1]; j++)
            for (int i = 0; i < f->size[0]; i++) {
                double v = 0;
                for (int w = 0; w < 4; w++) v += sin(wave[w][0] * i + wave[w][1] * j + wave[w][2] * k + wave[w][3]);
                if (kind == NOISE) v = random_range(r, -1, 1);
                if (kind == QUANTISED) v = floor(2 * v);
                *field_at(f, i, j, k) = v;
            }
}

__attribute__((unused)) static isogi_ray random_ray(const field *f, double isovalue, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    double d[3], target[3];
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        target[a] = random_range(r, 0, f->size[a] - 1);
        ray.dir[a] = (float)d[a];
        ray.origin[a] = target[a] - (double)ray.dir[a] * random_range(r, 0, 1) * 2 * f->size[a];
    }
    return ray;
}

/* ---- voxels one by one ---- */

TEST(corners_and_ranges_are_those_of_the_voxels) {
    test_random r = {1};
    field f = field_new(7, 1, 70);
    field_fill(&f, NOISE, &r);
    f.value[100] = (double)NAN, f.value[200] = (double)INFINITY;
    field_build(&f);
    const isogi_volume *v = isogi_vol_volume(f.pyramid);
    for (int i = 0; i < 2000; i++) {
        uint32_t cell[3] = {(uint32_t)(random_bits(&r) % 6), 0, (uint32_t)(random_bits(&r) % 69)};
        double corner[8];
        int finite = 1, told = isogi_volume_corners(v, cell, corner);
        for (int c = 0; c < 8; c++) {
            double value = *field_at(&f, (int)cell[0] + (c & 1), 0, (int)cell[2] + (c >> 2));
            finite &= !!isfinite(value);
            CHECK(!memcmp(&value, &corner[c], sizeof value), "corner %d: %g, not %g", c, corner[c], value);
        }
        CHECK(finite == told, "finite %d, told %d", finite, told);
    }
    for (int i = 0; i < 2000; i++) {
        size_t first[3], last[3];
        double range[2], least = DBL_MAX, largest = -DBL_MAX;
        for (int a = 0; a < 3; a++) first[a] = random_bits(&r) % v->size[a], last[a] = first[a] + random_bits(&r) % (v->size[a] + 1 - first[a]);
        for (size_t z = first[2]; z <= last[2] && z < 70; z++)
            for (size_t x = first[0]; x <= last[0] && x < 7; x++) {
                double value = *field_at(&f, (int)x, 0, (int)z);
                if (isfinite(value)) least = fmin(least, value), largest = fmax(largest, value);
            }
        isogi_volume_range(v, first, last, range);
        CHECK(range[0] == least && range[1] == largest, "%g..%g, not %g..%g", range[0], range[1], least, largest);
    }
    uint32_t beyond[3] = {6, 0, 0};
    double corner[8] = {1};
    CHECK(isogi_volume_corners(v, beyond, corner) == 0 && corner[0] == 0, "a cell that is not there: %g", corner[0]);
    field_free(&f);
}

/* ---- arguments that make no sense ---- */

TEST(calls_without_an_object_say_so) {
    double range[2] = {1, 1}, corner[8], at[3] = {1, 2, 3}, out[3] = {4, 5, 6};
    size_t lattice[3] = {1, 1, 1}, texel[3] = {0, 0, 0};
    uint32_t cell[3] = {0, 0, 0};
    int order = 7, channels = 7;
    isogi_counters counters = {.rays = 5};
    CHECK(!isogi_vol_volume(NULL) && !isogi_vol_context(NULL), "something of nothing");
    CHECK(!isogi_vol_level(NULL, 0).range, "a level of nothing");
    isogi_vol_range(NULL, range), isogi_vol_range(NULL, NULL);
    CHECK(range[0] == 0 && range[1] == 0, "range %g %g", range[0], range[1]);
    isogi_vol_to_world(NULL, at, out), isogi_vol_to_grid(NULL, at, out);
    CHECK(out[0] == 0 && out[2] == 0, "%g %g", out[0], out[2]);
    CHECK(isogi_volume_corners(NULL, cell, corner) == 0, "corners of nothing");
    isogi_volume_range(NULL, texel, texel, range);
    CHECK(range[0] > range[1], "a range of nothing: %g %g", range[0], range[1]);
    isogi_trace_shape(NULL, lattice, &order, &channels), isogi_trace_shape(NULL, NULL, NULL, NULL);
    CHECK(!lattice[0] && !lattice[2] && !order && !channels, "order %d, channels %d", order, channels);
    CHECK(!isogi_trace_valid(NULL, texel), "a texel of nothing");
    isogi_trace_counters(NULL, &counters), isogi_trace_counters(NULL, NULL);
    CHECK(counters.rays == 5, "%d rays", (int)counters.rays);
}

TEST_MAIN("vol_api")
