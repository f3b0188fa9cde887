/* Run time against error of isogi_dvr.h.

       build/bench/bench_dvr [--quick] OUT.csv

   One thread, CPU seconds. Volumes are procedural, as the scenes name them: Marschner-Lobb and gyroid on the cube, here 128^3
   (64^3 with --quick). Frames: standard view, shaded by visibility under a uniform sky and a directional light; error = RMSE of
   sRGB values against steps of a sixteenth of a voxel, same visibility. Visibility: order 3 on a grid of 8^3 (6^3); error =
   relative RMSE of all coefficients against 2048 rays. Methods: default; steps, rays = other settings of the same code.
   Data space: frames of 512x512 at 256^3, whatever the mode; tables of pieces. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include <stdio.h>
#include <time.h>

static const double pi = 3.14159265358979323846;
static const isogi_context serial = {.threads = 1};
static FILE *csv;
static int N = 128, WIDTH = 192;
static size_t points = 8;

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void row(const char *name, const char *scene, const char *method, const char *setting, double seconds, double error, double work, const char *unit) {
    fprintf(csv, "isogi_dvr.h,%s-%s,%s,%s,%.6g,%.6g,%.6g,%s\n", name, scene, method, setting, seconds, error, work, unit);
    fflush(csv);
    fprintf(stderr, "  %-20s %-8s %-8s %-10s %8.3f s %9.3f M%s/s  error %.3g\n", name, scene, method, setting, seconds, work / seconds / 1e6, unit, error);
}

static double marschner_lobb(double x, double y, double z) {
    return (1 - sin(pi * z / 2) + 0.25 * (1 + cos(2 * pi * 6 * cos(pi * sqrt(x * x + y * y) / 2)))) / 2.5;
}

static double gyroid(double x, double y, double z) {
    x = 2 * pi * (x + 1), y = 2 * pi * (y + 1), z = 2 * pi * (z + 1);
    return sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x);
}

static double srgb(double x) {
    x = x < 0 ? 0 : x > 1 ? 1 : x;
    return x < 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

static isogi_dvr *create(const isogi_dvr_desc *desc, const isogi_transfer *transfer) {
    isogi_dvr *dvr = NULL;
    if (isogi_dvr_create(&dvr, desc, &serial) != ISOGI_OK || isogi_dvr_set_transfer(dvr, transfer) != ISOGI_OK) exit(1);
    return dvr;
}

/* Frames of one renderer with several steps; the last is the reference. */
static void bench_frames(const char *scene, const isogi_pyramid *pyramid, const isogi_transfer *transfer, isogi_dvr_space space, isogi_dvr_shading shading) {
    static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {2, 2, 2}};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = &sun, .light_count = 1};
    const double steps[5] = {0.0625, 1, 0.5, 0.25, 0.125}, far = sqrt(3) / sin(pi / 8) / sqrt(1.5 * 1.5 + 1.2 * 1.2 + 2 * 2);
    const isogi_view view = {.width = WIDTH, .height = WIDTH, .eye = {(float)(1.5 * far), (float)(1.2 * far), (float)(2 * far)}};
    size_t pixels = (size_t)WIDTH * (size_t)WIDTH;
    float(*image)[4] = (float(*)[4])malloc(pixels * sizeof *image), (*reference)[4] = (float(*)[4])malloc(pixels * sizeof *reference);
    for (int s = 0; s < 5; s++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .space = space, .shading = shading, .step = steps[s], .visibility_step = 1, .directions = 16,
                                     .grid = {8, 8, 8}};
        isogi_dvr *dvr = create(&desc, transfer);
        isogi_counters count = {0};
        double sum = 0, seconds;
        char name[64], setting[64];
        if (isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
        seconds = cpu_seconds();
        if (isogi_dvr_render(dvr, &view, &lighting, s ? image : reference, NULL, &count) != ISOGI_OK) exit(1);
        seconds = cpu_seconds() - seconds;
        for (size_t i = 0; s && i < 4 * pixels; i++) {
            double d = srgb((double)image[i / 4][i % 4]) - srgb((double)reference[i / 4][i % 4]);
            if (i % 4 < 3) sum += d * d;
        }
        snprintf(name, sizeof name, "frame-%s-%s", space ? "data" : "physical", shading ? "lit" : "unlit");
        snprintf(setting, sizeof setting, "step %g", steps[s]);
        if (s) row(name, scene, s == 2 ? "default" : "steps", setting, seconds, sqrt(sum / (double)(3 * pixels)), (double)count.samples, "sample");
        isogi_dvr_free(dvr);
    }
    free(image), free(reference);
}

static void bench_visibility(const char *scene, const isogi_pyramid *pyramid, const isogi_transfer *transfer) {
    const int rays[5] = {2048, 16, 32, 64, 256};
    size_t count = points * points * points;
    float *v = (float *)malloc(count * 9 * sizeof(float)), *reference = (float *)malloc(count * 9 * sizeof(float));
    float(*places)[3] = (float(*)[3])malloc(count * sizeof *places);
    for (size_t i = 0; i < count; i++) {
        size_t c[3] = {i % points, i / points % points, i / points / points};
        for (int a = 0; a < 3; a++) places[i][a] = (float)(2 * (double)c[a] / (double)(points - 1) - 1);
    }
    for (int s = 0; s < 5; s++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = rays[s], .grid = {points, points, points}};
        isogi_dvr *dvr = create(&desc, transfer);
        double sum = 0, norm = 0, seconds = cpu_seconds();
        char setting[64];
        if (isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
        seconds = cpu_seconds() - seconds;
        if (isogi_dvr_sample_visibility(dvr, (const float(*)[3])places, count, s ? v : reference) != ISOGI_OK) exit(1);
        for (size_t i = 0; s && i < 9 * count; i++) {
            double d = (double)v[i] - (double)reference[i];
            sum += d * d, norm += (double)reference[i] * (double)reference[i];
        }
        snprintf(setting, sizeof setting, "%d rays", rays[s]);
        if (s) row("visibility", scene, rays[s] == 64 ? "default" : "rays", setting, seconds, sqrt(sum / norm), (double)count * rays[s], "ray");
        isogi_dvr_free(dvr);
    }
    free(v), free(reference), free(places);
}

/* ---- data space ---- */

static double rendered(const isogi_dvr_desc *desc, const isogi_transfer *transfer, int width, float (*image)[4], isogi_counters *count) {
    const double away = sqrt(3) / sin(pi / 8) / sqrt(1.5 * 1.5 + 1.2 * 1.2 + 2 * 2);
    const isogi_view view = {.width = width, .height = width, .eye = {(float)(1.5 * away), (float)(1.2 * away), (float)(2 * away)}};
    isogi_dvr *dvr = create(desc, transfer);
    double seconds = cpu_seconds();
    if (isogi_dvr_render(dvr, &view, NULL, image, NULL, count) != ISOGI_OK) exit(1);
    seconds = cpu_seconds() - seconds;
    isogi_dvr_free(dvr);
    return seconds;
}

/* Unlit frames of 512x512 of the gyroid at 256^3 with a tent of opacity 1 - 1/e for each passage: exact, pre-integrated, post-classified. The
   error is that of 128x128 pixels of the same view against post-classified steps of a 64th of a voxel: none of the methods measured. */
static void bench_scale_invariant(void) {
    const struct { const char *method; isogi_dvr_classification classification; double step; } ways[] = {
        {"reference", ISOGI_DVR_POST_CLASSIFIED, 1 / 64.0},   {"default", ISOGI_DVR_EXACT, 0.5},                {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 1},
        {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 0.5},    {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 0.25}, {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 1},
        {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 0.5}, {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 0.25}};
    enum { SIDE = 256, FRAME = 512, SAMPLE = 128 };
    const size_t n = SIDE;
    float *data = (float *)malloc(n * n * n * sizeof *data);
    float(*image)[4] = (float(*)[4])malloc(FRAME * FRAME * sizeof *image), (*reference)[4] = (float(*)[4])malloc(SAMPLE * SAMPLE * sizeof *reference);
    for (size_t i = 0; i < n * n * n; i++)
        data[i] = (float)gyroid(2.0 * (double)(i % n) / (SIDE - 1) - 1, 2.0 * (double)(i / n % n) / (SIDE - 1) - 1, 2.0 * (double)(i / n / n) / (SIDE - 1) - 1);
    const isogi_transfer_point p[] = {{-1.5, {.2f, .3f, .9f}, 0}, {-0.15, {.83f, .75f, .63f}, 0}, {0, {.9f, .8f, .6f}, (float)(1 / 0.15)},
                                      {0.15, {.9f, .74f, .56f}, 0}, {1.5, {.9f, .2f, .2f}, 0}};
    const isogi_transfer transfer = {.points = p, .point_count = 5};
    const double spacing = 2.0 / (SIDE - 1);
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {n, n, n}, .spacing = {spacing, spacing, spacing}, .origin = {-1, -1, -1}};
    isogi_pyramid *pyramid = NULL;
    if (isogi_vol_build(&pyramid, &volume, &serial) != ISOGI_OK) exit(1);
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid, .space = ISOGI_DVR_DATA, .classification = ways[w].classification, .step = ways[w].step};
        isogi_counters count = {0};
        double sum = 0, seconds;
        char setting[64];
        rendered(&desc, &transfer, SAMPLE, w ? image : reference, &count);
        if (!w) continue;
        for (int i = 0; i < 3 * SAMPLE * SAMPLE; i++) sum += pow(srgb((double)image[i / 3][i % 3]) - srgb((double)reference[i / 3][i % 3]), 2);
        memset(&count, 0, sizeof count);
        seconds = rendered(&desc, &transfer, FRAME, image, &count);
        snprintf(setting, sizeof setting, ways[w].classification == ISOGI_DVR_EXACT ? "512x512" : "512x512 step %g", ways[w].step);
        row("frame-scale-invariant", "gyroid256", ways[w].method, setting, seconds, sqrt(sum / (3 * SAMPLE * SAMPLE)), (double)count.samples, "sample");
    }
    isogi_vol_free(pyramid);
    free(data), free(image), free(reference);
}

/* Kraus 2005, figure 8e and f: pieces of rays through tetrahedra by tables of two dimensions, which data space needs, against three, which
   physical space needs; and by the integrals themselves. Error: RMSE of opacity. */
static void bench_tables(void) {
    enum { COUNT = 200000, SIDE = 128, LENGTHS = 32 };
    const isogi_transfer_point p[] = {{0, {.2f, .3f, .9f}, 0}, {0.3, {.2f, .8f, .9f}, 2}, {0.5, {.9f, .8f, .6f}, 0.1f}, {0.7, {.9f, .2f, .2f}, 4}, {1, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {.points = p, .point_count = 5};
    isogi_dvr__transfer own;
    isogi_dvr__integral g;
    isogi_dvr_desc desc = {.space = ISOGI_DVR_DATA};
    float *table = (float *)malloc(sizeof(float[4]) * SIDE * SIDE * LENGTHS);
    double (*piece)[3] = (double(*)[3])malloc(COUNT * sizeof *piece), *exact = (double *)malloc(COUNT * sizeof *exact);
    uint64_t state = 1;
    if (isogi_dvr__transfer_copy(&own, &transfer, &serial) != ISOGI_OK || isogi_dvr__integral_build(&g, &own, &desc, &serial) != ISOGI_OK) exit(1);
    for (int i = 0; i < COUNT; i++)
        for (int a = 0; a < 3; a++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            double x = (double)(state >> 40) / 0x1p24;
            piece[i][a] = a == 1 ? fmin(1, fmax(0, piece[i][0] + 0.2 * (x - 0.5))) : x; /* as small a change as tetrahedra show */
        }
    for (int dimensions = 2; dimensions < 4; dimensions++)
        for (int way = 0; way < 2; way++) {
            size_t layers = dimensions == 3 ? LENGTHS : 1;
            double sum = 0, glow = 0, seconds;
            for (size_t i = 0; !way && i < SIDE * SIDE * layers; i++) { /* [length][front][back] */
                double x = (double)(i / SIDE % SIDE) / (SIDE - 1), y = (double)(i % SIDE) / (SIDE - 1);
                isogi_dvr__layer layer = {{0, 0, 0}, 1};
                isogi_dvr__add_values(&g, x, y, dimensions == 3 ? (double)(i / SIDE / SIDE) / (LENGTHS - 1) : fabs(y - x), &layer);
                for (int a = 0; a < 3; a++) table[4 * i + (size_t)a] = (float)layer.rgb[a];
                table[4 * i + 3] = (float)(1 - layer.clear);
            }
            seconds = cpu_seconds();
            for (int i = 0; i < COUNT; i++) {
                double x = piece[i][0] * (SIDE - 1), y = piece[i][1] * (SIDE - 1), z = piece[i][2] * (LENGTHS - 1), opacity;
                if (!way) {
                    isogi_dvr__layer layer = {{0, 0, 0}, 1};
                    isogi_dvr__add_values(&g, piece[i][0], piece[i][1], dimensions == 3 ? piece[i][2] : fabs(piece[i][1] - piece[i][0]), &layer);
                    exact[i] = opacity = 1 - layer.clear, glow += layer.rgb[0];
                } else {
                    size_t c[3] = {(size_t)x < SIDE - 2 ? (size_t)x : SIDE - 2, (size_t)y < SIDE - 2 ? (size_t)y : SIDE - 2, (size_t)z < LENGTHS - 2 ? (size_t)z : LENGTHS - 2};
                    double u[3] = {x - (double)c[0], y - (double)c[1], z - (double)c[2]}, v[4] = {0, 0, 0, 0};
                    for (int k = 0; k < (dimensions == 3 ? 8 : 4); k++) {
                        const float *at = table + 4 * ((dimensions == 3 ? c[2] + (size_t)(k >> 2) : 0) * SIDE * SIDE + (c[0] + (size_t)(k & 1)) * SIDE + c[1] + (size_t)(k >> 1 & 1));
                        double weight = (k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) * (dimensions == 2 ? 1 : k & 4 ? u[2] : 1 - u[2]);
                        for (int a = 0; a < 4; a++) v[a] += weight * (double)at[a];
                    }
                    opacity = v[3], glow += v[0];
                }
                sum += pow(opacity - exact[i], 2);
            }
            seconds = cpu_seconds() - seconds;
            if (!(glow > 0)) exit(1);
            row("tet-pieces", dimensions == 3 ? "physical" : "data", way ? dimensions == 3 ? "table-3d" : "table-2d" : "default", way ? "128 entries a side" : "integrals", seconds,
                sqrt(sum / COUNT), COUNT, "piece");
        }
    isogi_dvr__integral_free(&g, &serial), isogi_dvr__transfer_free(&own, &serial);
    free(table), free(piece), free(exact);
}

int main(int argc, char **argv) {
    const char *path = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) N = 64, WIDTH = 128, points = 6;
        else path = argv[i];
    }
    if (!path || !(csv = fopen(path, "w"))) return fprintf(stderr, "usage: %s [--quick] OUT.csv\n", argv[0]), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    for (int f = 0; f < 2; f++) {
        size_t n = (size_t)N, i;
        float *data = (float *)malloc(n * n * n * sizeof(float)), low = 1e9f, high = -1e9f;
        for (i = 0; i < n * n * n; i++) {
            double x = 2.0 * (double)(i % n) / (N - 1) - 1, y = 2.0 * (double)(i / n % n) / (N - 1) - 1, z = 2.0 * (double)(i / n / n) / (N - 1) - 1;
            data[i] = (float)(f ? gyroid(x, y, z) : marschner_lobb(x, y, z));
            low = fminf(low, data[i]), high = fmaxf(high, data[i]);
        }
        double middle = f ? 0 : 0.5, half = 0.05 * (double)(high - low), at[5] = {(double)low, middle - half, middle, middle + half, (double)high};
        isogi_transfer_point p[5] = {{0, {.2f, .3f, .9f}, 0}, {0, {0, 0, 0}, 0}, {0, {.9f, .8f, .6f}, 0.357f}, {0, {0, 0, 0}, 0}, {0, {.9f, .2f, .2f}, 0}};
        for (i = 0; i < 5; i++) p[i].value = at[i];
        for (int a = 0; a < 3; a++)
            for (i = 1; i < 4; i += 2) {
                double u = (at[i] - at[i - 1 + 0]) / (at[i + 1] - at[i - 1]);
                p[i].rgb[a] = p[i - 1].rgb[a] + (float)u * (p[i + 1].rgb[a] - p[i - 1].rgb[a]);
            }
        const isogi_transfer physical = {.points = p, .point_count = 5};
        const double spacing = 2.0 / (N - 1);
        const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {n, n, n}, .spacing = {spacing, spacing, spacing}, .origin = {-1, -1, -1}};
        isogi_pyramid *pyramid = NULL;
        if (isogi_vol_build(&pyramid, &volume, &serial) != ISOGI_OK) return 1;
        const char *scene = f ? "gyroid" : "ml";
        bench_frames(scene, pyramid, &physical, ISOGI_DVR_PHYSICAL, ISOGI_DVR_UNLIT);
        bench_frames(scene, pyramid, &physical, ISOGI_DVR_PHYSICAL, ISOGI_DVR_VISIBILITY);
        bench_visibility(scene, pyramid, &physical);
        isogi_vol_free(pyramid);
        free(data);
    }
    bench_scale_invariant();
    bench_tables();
    return fclose(csv) ? 1 : 0;
}
