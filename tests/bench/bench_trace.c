/* Run time against error of isogi_trace.h: the scene engine-block of the design, a lazily baked standard view.

       build/bench/bench_trace [--quick] OUT.csv

   All threads, wall seconds. error = relative RMSE of irradiance over the surface points of the view, against the same texels baked
   with 16 (quick: 8) times the samples of the largest setting and another seed; work = rays. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "camera.h"
#include "procedural.h"
#include <stdio.h>
#include <time.h>

enum { MAX_SIZE = 256 };
static float points[MAX_SIZE * MAX_SIZE][3], reference[MAX_SIZE * MAX_SIZE][3], light[MAX_SIZE * MAX_SIZE][3];

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Points of the isosurface that the standard view sees. */
static size_t view(const isogi_pyramid *pyramid, double isovalue, int size) {
    const isogi_volume *v = isogi_vol_volume(pyramid);
    double toward[3] = {1.5, 1.2, 2.0}, up[3] = {0, 1, 0}, right[3], above[3], centre[3], radius = 0, reach = tan(PROCEDURAL_PI / 8);
    size_t count = 0;
    vector_normalize(toward);
    vector_cross(up, toward, right), vector_normalize(right), vector_cross(toward, right, above);
    for (int a = 0; a < 3; a++) centre[a] = 0.5 * v->spacing[a] * (double)(v->size[a] - 1);
    radius = sqrt(vector_dot(centre, centre));
    for (int i = 0; i < size * size; i++) {
        double x = (2 * (i % size + 0.5) / size - 1) * reach, y = (1 - 2 * (i / size + 0.5) / size) * reach;
        isogi_ray ray = {.flags = ISOGI_RAY_CAPPED, .isovalue = isovalue};
        isogi_hit hit;
        for (int a = 0; a < 3; a++) {
            ray.origin[a] = centre[a] + toward[a] * radius / sin(PROCEDURAL_PI / 8);
            ray.dir[a] = (float)(x * right[a] + y * above[a] - toward[a]);
        }
        isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
        isogi_vol_positions(pyramid, &hit, 1, (float(*)[3])points[count]);
        count += hit.side != 0;
    }
    return count;
}

/* Seconds of a lazy bake of the view; 0 on failure. */
static double bake(const isogi_trace_desc *desc, size_t count, float (*out)[3], isogi_counters *counters) {
    isogi_trace *trace = NULL;
    double begin = seconds_now();
    isogi_result result = isogi_trace_create(&trace, desc, NULL);
    if (result == ISOGI_OK) result = isogi_trace_request(trace, (const float(*)[3])points, count);
    if (result == ISOGI_OK) result = isogi_trace_step(trace, 0, NULL);
    if (result == ISOGI_OK) result = isogi_trace_sample(trace, (const float(*)[3])points, count, out, NULL);
    if (result == ISOGI_OK) isogi_trace_counters(trace, counters);
    isogi_trace_free(trace);
    return result == ISOGI_OK ? seconds_now() - begin : 0;
}

static double relative_rmse(size_t count) {
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        double e = (double)light[i][1], r = (double)reference[i][1];
        sum += r > 0 ? (e - r) * (e - r) / (r * r) : 0;
    }
    return sqrt(sum / (double)count);
}

int main(int argc, char **argv) {
    int quick = argc > 1 && !strcmp(argv[1], "--quick"), size = quick ? 32 : 160, settings[3] = {4, 16, 64};
    const procedural_shape *shape = procedural_find("engine-block");
    /* radiance 1 above to 0.3 below: 0.65 + 0.35 y; Y_0 = 0.2821, Y_1 = 0.4886 y */
    float sky[12] = {2.3042f, 2.3042f, 2.3042f, 0.71633f, 0.71633f, 0.71633f};
    isogi_light sun = {.vector = {1, 2, 1.5f}, .rgb = {3, 3, 3}, .radius = 0.0175f};
    isogi_trace_desc desc = {.lazy = 1, .capped = 1, .bounces = -1, .albedo = {0.7f, 0.7f, 0.7f}};
    isogi_pyramid *pyramid = NULL;
    isogi_volume volume;
    FILE *csv = argc == 2 + quick ? fopen(argv[1 + quick], "w") : NULL;
    size_t count;
    if (!csv) return fprintf(stderr, "usage: bench_trace [--quick] OUT.csv\n"), 2;
    if (procedural_make(shape, 0, &volume, NULL) != ISOGI_OK || isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) return 1;
    count = view(pyramid, shape->isovalue, size);
    desc.pyramid = pyramid, desc.lighting.env.sh = sky, desc.lighting.env.sh_order = 2;
    desc.lighting.lights = &sun, desc.lighting.light_count = 1;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    desc.samples = settings[2] * (quick ? 8 : 16), desc.seed = 1;
    if (!(bake(&desc, count, reference, &(isogi_counters){0}) > 0)) return 1;
    for (int i = 0; i < 3; i++) {
        isogi_counters counters = {0};
        double seconds;
        desc.samples = settings[i], desc.seed = 0;
        seconds = bake(&desc, count, light, &counters);
        if (!(seconds > 0)) return 1;
        fprintf(csv, "isogi_trace.h,engine-block,%s,samples=%d,%.6g,%.6g,%.6g,rays\n", settings[i] == 64 ? "default" : "samples", settings[i], seconds, relative_rmse(count), (double)counters.rays);
        fprintf(stderr, "  engine-block samples=%d: %.3f s, error %.4f, %.2f Mray/s\n", settings[i], seconds, relative_rmse(count), 1e-6 * (double)counters.rays / seconds);
    }
    isogi_vol_free(pyramid), procedural_free(&volume);
    return fclose(csv) != 0;
}
