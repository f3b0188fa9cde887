/* Run time against error of isogi_dvr.h.

       build/bench/bench_dvr [--quick | --dry] [--only SCENE] OUT.csv

   One thread, CPU seconds. Volumes are procedural, as the scenes name them: Marschner-Lobb and gyroid on the cube, here 128^3
   (64^3 with --quick). Frames: standard view, shaded by visibility under a uniform sky and a directional light; error = RMSE of
   sRGB values against steps of a sixteenth of a voxel, same visibility. Visibility: order 3 on a grid of 8^3 (6^3); error =
   relative RMSE of all coefficients against 2048 rays by brute force in steps of a quarter of a voxel. Methods: default; steps, rays =
   other settings of the same code.
   Data space: frames of 512x512 at 256^3 (--quick: without the finest steps); tables of pieces. Frames of the scenes: error against
   visibility of 2048 rays by brute force on the same grid, kept in build/bench/: computing it takes minutes, once, and goes on where it
   was stopped. A table of goals is printed at the end. --dry: all rows in seconds, to look at the table's form: scenes of 16 voxels, with
   made-up data in place of files; no figure means anything. tf-edit: an update after a part of the function has changed. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "brute_reference.h"
#include "goals.h"
#include "hdr.h"
#include "large.h"
#include <stdio.h>
#include <time.h>

static const double pi = 3.14159265358979323846;
static const isogi_context serial = {.threads = 1};
static FILE *csv;
static int N = 128, WIDTH = 192, POINTS = 1024; /* POINTS: of visibility */
static int PIXELS = 512, FRAME = 512, REFERENCE = 2048; /* pixels a side of frames whose error, and whose time is measured; directions
                                                           of their reference */
static size_t points = 8;
static int dry, force_path;

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* On a machine that runs VTK's fixed-point caster in 0.54 s unlit, 0.78 s shaded (frames of ml256 and gyroid256: one core, `make
   bench-peers` runs it here; others two). */
static const goal goals[] = {{"frame-ml256", 0.1, NULL, "VTK, by gradients: 0.78"},
                             {"frame-gyroid256", 0.1, NULL, "VTK, by gradients: 0.92"},
                             {"frame-engine", 1 / 30.0, NULL, "30 frames/s"},
                             {"frame-bonsai", 1 / 30.0, NULL, "30 frames/s"},
                             {"tf-update-fuel", 0.15, NULL, "Kronander 2011 on a GPU 0.15; error at most:"},
                             {"tf-update-fuel:paper", 0.15, NULL, "that of the paper's method"},
                             {"tf-update-engine", 0.45, NULL, "Kronander 2011 on a GPU 0.45, twice the data; error at most:"},
                             {"tf-update-engine:paper", 0.45, NULL, "that of the paper's method"},
                             {"tf-update-bonsai", 0.75, NULL, "Kronander 2011 on a GPU 1.48, three times the data; error at most:"},
                             {"tf-update-bonsai:paper", 0.75, NULL, "that of the paper's method"}};

static void row(const char *name, const char *scene, const char *method, const char *setting, double seconds, double error, double work,
                const char *unit) {
    char both[48];
    fprintf(csv, "isogi_dvr.h,%s-%s,%s,%s,%.6g,%.6g,%.6g,%s\n", name, scene, method, setting, seconds, error, work, unit);
    fflush(csv);
    fprintf(stderr, "  %-20s %-8s %-8s %-10s %8.3f s %9.3f M%s/s  error %.3g\n", name, scene, method, setting, seconds,
            work / seconds / 1e6, unit, error);
    if (strcmp(method, "default") && strcmp(method, "paper")) return;
    snprintf(both, sizeof both, "%s-%s%s", name, scene, strcmp(method, "default") ? ":paper" : "");
    goals_note(both, seconds, error);
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
    const isogi_context context = {.threads = 1, .force_path = force_path};
    isogi_dvr *dvr = NULL;
    if (isogi_dvr_create(&dvr, desc, &context) != ISOGI_OK || isogi_dvr_set_transfer(dvr, transfer) != ISOGI_OK) exit(1);
    return dvr;
}

/* Frames of one renderer with several steps, of which the first is the reference; unlit ones with error bounds, too. */
static void bench_frames(const char *scene, const isogi_pyramid *pyramid, const isogi_transfer *transfer, isogi_dvr_space space,
                         isogi_dvr_shading shading) {
    static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {2, 2, 2}};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = &sun, .light_count = 1};
    const double steps[8] = {0.0625, 1, 0.5, 0.25, 0.125, 0, 0, 0}, bounds[8] = {0, 0, 0, 0, 0, 1, 0.1, 0.01},
                 far = sqrt(3) / sin(pi / 8) / sqrt(1.5 * 1.5 + 1.2 * 1.2 + 2 * 2);
    const isogi_view view = {.width = WIDTH, .height = WIDTH, .eye = {(float)(1.5 * far), (float)(1.2 * far), (float)(2 * far)}};
    size_t pixels = (size_t)WIDTH * (size_t)WIDTH;
    float(*image)[4] = (float(*)[4])malloc(pixels * sizeof *image), (*reference)[4] = (float(*)[4])malloc(pixels * sizeof *reference);
    for (int s = 0; s < (shading ? 5 : 8); s++) {
        const isogi_dvr_desc desc = {.pyramid = pyramid,
                                     .space = space,
                                     .shading = shading,
                                     .step = steps[s],
                                     .bound = bounds[s],
                                     .visibility_step = 1,
                                     .directions = 16,
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
        snprintf(setting, sizeof setting, s < 5 ? "step %g" : "bound %g", s < 5 ? steps[s] : bounds[s]);
        if (s)
            row(name, scene, s == (space ? 2 : 1) ? "default" : s < 5 ? "steps" : "bound", setting, seconds,
                sqrt(sum / (double)(3 * pixels)), (double)count.samples, "sample");
        isogi_dvr_free(dvr);
    }
    free(image), free(reference);
}

static void bench_visibility(const char *scene, const isogi_pyramid *pyramid, const isogi_transfer *transfer) {
    const int rays[6] = {2048, 16, 32, 64, 256, 256};
    size_t count = points * points * points;
    float *v = (float *)malloc(count * 9 * sizeof(float)), *reference = (float *)malloc(count * 9 * sizeof(float));
    float(*places)[3] = (float(*)[3])malloc(count * sizeof *places);
    for (size_t i = 0; i < count; i++) {
        size_t c[3] = {i % points, i / points % points, i / points / points};
        for (int a = 0; a < 3; a++) places[i][a] = (float)(2 * (double)c[a] / (double)(points - 1) - 1);
    }
    for (int s = 0; s < 6; s++) { /* the first is the reference; the last on a lattice as fine as the voxels */
        const isogi_dvr_desc desc = {.pyramid = pyramid,
                                     .shading = ISOGI_DVR_VISIBILITY,
                                     .method = s ? ISOGI_DVR_METHOD_DEFAULT : ISOGI_DVR_BRUTE,
                                     .visibility_step = s == 5 ? 1
                                                        : s    ? 0
                                                               : 0.25,
                                     .directions = rays[s],
                                     .grid = {points, points, points}};
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
        snprintf(setting, sizeof setting, s == 5 ? "%d rays; lattice 1" : "%d rays", rays[s]);
        if (s)
            row("visibility", scene, rays[s] == 64 ? "default" : "rays", setting, seconds, sqrt(sum / norm), (double)count * rays[s],
                "ray");
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

/* Unlit frames of 512x512 of the gyroid at 256^3 with a tent of opacity 1 - 1/e for each passage: exact, pre-integrated, post-classified.
   The error is that of 128x128 pixels of the same view against post-classified steps of a 64th of a voxel: none of the methods measured. */
static void bench_scale_invariant(void) {
    const struct { const char *method; isogi_dvr_classification classification; double step;
    } ways[] = {{"reference", ISOGI_DVR_POST_CLASSIFIED, 1 / 64.0},  {"default", ISOGI_DVR_EXACT, 0.5},
                {"plain", ISOGI_DVR_EXACT, 0.5}, /* rays one by one, as without AVX-512 */
                {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 1},     {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 0.5},
                {"pre-integrated", ISOGI_DVR_PRE_INTEGRATED, 0.25},  {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 1},
                {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 0.5}, {"post-classified", ISOGI_DVR_POST_CLASSIFIED, 0.25}};
    const int SIDE = dry ? 16 : 256, SAMPLE = dry ? 16 : 128;
    const size_t n = (size_t)SIDE, pixels = (size_t)FRAME * (size_t)FRAME, sample = (size_t)SAMPLE * (size_t)SAMPLE;
    float *data = (float *)large_allocate(n * n * n * sizeof *data);
    float(*image)[4] = (float(*)[4])malloc(pixels * sizeof *image), (*reference)[4] = (float(*)[4])malloc(sample * sizeof *reference);
    for (size_t i = 0; i < n * n * n; i++)
        data[i] = (float)gyroid(2.0 * (double)(i % n) / (SIDE - 1) - 1, 2.0 * (double)(i / n % n) / (SIDE - 1) - 1,
                                2.0 * (double)(i / n / n) / (SIDE - 1) - 1);
    const isogi_transfer_point p[] = {{-1.5, {.2f, .3f, .9f}, 0}, {-0.15, {.83f, .75f, .63f}, 0}, {0, {.9f, .8f, .6f}, (float)(1 / 0.15)},
                                      {0.15, {.9f, .74f, .56f}, 0}, {1.5, {.9f, .2f, .2f}, 0}};
    const isogi_transfer transfer = {.points = p, .point_count = 5};
    const double spacing = 2.0 / (SIDE - 1);
    const isogi_volume volume = {
        .data = data, .type = ISOGI_F32, .size = {n, n, n}, .spacing = {spacing, spacing, spacing}, .origin = {-1, -1, -1}};
    isogi_pyramid *pyramid = NULL;
    if (isogi_vol_build(&pyramid, &volume, &serial) != ISOGI_OK) exit(1);
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        const isogi_dvr_desc desc = {
            .pyramid = pyramid, .space = ISOGI_DVR_DATA, .classification = ways[w].classification, .step = ways[w].step};
        isogi_counters count = {0};
        double sum = 0, seconds;
        char setting[64];
        if (w && PIXELS < 512 && ways[w].step < 0.5) continue;
        force_path = !strcmp(ways[w].method, "plain");
        rendered(&desc, &transfer, SAMPLE, w ? image : reference, &count);
        if (!w) continue;
        for (int i = 0; i < 3 * SAMPLE * SAMPLE; i++)
            sum += pow(srgb((double)image[i / 3][i % 3]) - srgb((double)reference[i / 3][i % 3]), 2);
        memset(&count, 0, sizeof count);
        seconds = rendered(&desc, &transfer, FRAME, image, &count);
        snprintf(setting, sizeof setting, ways[w].classification == ISOGI_DVR_EXACT ? "512x512" : "512x512 step %g", ways[w].step);
        row("frame-scale-invariant", "gyroid256", ways[w].method, setting, seconds, sqrt(sum / (3 * SAMPLE * SAMPLE)),
            (double)count.samples, "sample");
    }
    force_path = 0, isogi_vol_free(pyramid);
    free(data), free(image), free(reference);
}

/* Kraus 2005, figure 8e and f: pieces of rays through tetrahedra by tables of two dimensions, which data space needs, against three, which
   physical space needs; and by the integrals themselves. Error: RMSE of opacity against long double, piece by piece of the function. */
static long double bench_opacity(const isogi_transfer *t, double x, double y, double length) {
    const long double low = fmin(x, y), high = fmax(x, y), span = high - low;
    long double depth = 0;
    for (size_t i = 0; i + 1 < t->point_count; i++) {
        const isogi_transfer_point *p = t->points + i;
        const long double from = fmaxl(low, (long double)p->value), to = fminl(high, (long double)p[1].value),
                          slope = ((long double)p[1].extinction - (long double)p->extinction) / ((long double)p[1].value - p->value);
        if (!(to > from) && (span > 0 || low < (long double)p->value || low >= (long double)p[1].value)) continue;
        depth += ((long double)p->extinction + slope * ((from + to) / 2 - p->value)) * (span > 0 ? (to - from) / span : 1);
    }
    return -expm1l(-depth * length);
}

static void bench_tables(void) {
    enum { SIDE = 128, LENGTHS = 32 };
    const int COUNT = dry ? 2000 : 200000;
    const isogi_transfer_point p[] = {
        {0, {.2f, .3f, .9f}, 0}, {0.3, {.2f, .8f, .9f}, 2}, {0.5, {.9f, .8f, .6f}, 0.1f}, {0.7, {.9f, .2f, .2f}, 4}, {1, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {.points = p, .point_count = 5};
    isogi_dvr__transfer own;
    isogi_dvr__integral g;
    isogi_dvr_desc desc = {.space = ISOGI_DVR_DATA};
    float *table = (float *)malloc(sizeof(float[4]) * SIDE * SIDE * LENGTHS);
    double (*piece)[3] = (double(*)[3])malloc((size_t)COUNT * sizeof *piece), *opacity = (double *)malloc((size_t)COUNT * sizeof *opacity);
    uint64_t state = 1;
    if (isogi_dvr__transfer_copy(&own, &transfer, &serial) != ISOGI_OK || isogi_dvr__integral_build(&g, &own, &desc, &serial) != ISOGI_OK)
        exit(1);
    for (int i = 0; i < COUNT; i++)
        for (int a = 0; a < 3; a++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            double x = (double)(state >> 40) / 0x1p24;
            piece[i][a] = a == 1 ? fmin(1, fmax(0, piece[i][0] + 0.2 * (x - 0.5))) : x; /* as small a change as tetrahedra show */
        }
    for (int dimensions = 2; dimensions < 4; dimensions++)
        for (int way = 0; way < 2; way++) {
            size_t layers = dimensions == 3 ? LENGTHS : 1;
            double glow = 0, seconds;
            long double sum = 0;
            for (size_t i = 0; !way && i < SIDE * SIDE * layers; i++) { /* [length][front][back] */
                double x = (double)(i / SIDE % SIDE) / (SIDE - 1), y = (double)(i % SIDE) / (SIDE - 1);
                isogi_dvr__layer layer = {{0, 0, 0}, 1};
                isogi_dvr__add_values(&g, x, y, dimensions == 3 ? (double)(i / SIDE / SIDE) / (LENGTHS - 1) : fabs(y - x), &layer);
                for (int a = 0; a < 3; a++) table[4 * i + (size_t)a] = (float)layer.rgb[a];
                table[4 * i + 3] = (float)(1 - layer.clear);
            }
            seconds = cpu_seconds();
            for (int i = 0; i < COUNT; i++) {
                double x = piece[i][0] * (SIDE - 1), y = piece[i][1] * (SIDE - 1), z = piece[i][2] * (LENGTHS - 1);
                if (!way) {
                    isogi_dvr__layer layer = {{0, 0, 0}, 1};
                    isogi_dvr__add_values(&g, piece[i][0], piece[i][1], dimensions == 3 ? piece[i][2] : fabs(piece[i][1] - piece[i][0]),
                                          &layer);
                    opacity[i] = 1 - layer.clear, glow += layer.rgb[0];
                } else {
                    size_t c[3] = {(size_t)x < SIDE - 2 ? (size_t)x : SIDE - 2, (size_t)y < SIDE - 2 ? (size_t)y : SIDE - 2,
                                   (size_t)z < LENGTHS - 2 ? (size_t)z : LENGTHS - 2};
                    double u[3] = {x - (double)c[0], y - (double)c[1], z - (double)c[2]}, v[4] = {0, 0, 0, 0};
                    for (int k = 0; k < (dimensions == 3 ? 8 : 4); k++) {
                        const float *at = table + 4 * ((dimensions == 3 ? c[2] + (size_t)(k >> 2) : 0) * SIDE * SIDE +
                                                       (c[0] + (size_t)(k & 1)) * SIDE + c[1] + (size_t)(k >> 1 & 1));
                        double weight = (k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) *
                                        (dimensions == 2 ? 1
                                         : k & 4         ? u[2]
                                                         : 1 - u[2]);
                        for (int a = 0; a < 4; a++) v[a] += weight * (double)at[a];
                    }
                    opacity[i] = v[3], glow += v[0];
                }
            }
            seconds = cpu_seconds() - seconds;
            for (int i = 0; i < COUNT; i++) {
                long double d = opacity[i] - bench_opacity(&transfer, piece[i][0], piece[i][1],
                                                           dimensions == 3 ? piece[i][2] : fabs(piece[i][1] - piece[i][0]));
                sum += d * d;
            }
            if (!(glow > 0)) exit(1);
            row("tet-pieces", dimensions == 3 ? "physical" : "data", way ? dimensions == 3 ? "table-3d" : "table-2d" : "default",
                way ? "128 entries a side" : "integrals", seconds, (double)sqrtl(sum / COUNT), COUNT, "piece");
        }
    isogi_dvr__integral_free(&g, &serial), isogi_dvr__transfer_free(&own, &serial);
    free(table), free(piece), free(opacity);
}

/* ---- the scenes: frames and updates of a transfer function ------------------------------------------------------------------- */

typedef struct bench_scene {
    const char *name, *file, *hdr; /* file NULL: procedural, 256^3 on the cube */
    size_t size[3], grid[3];
    double reduction;
    int order, rays, points, threads, flipped, update, frame;
    isogi_transfer_point point[6];
    isogi_light sun;
} bench_scene;

static const bench_scene bench_scenes[] = {
    {.name = "ml256",
     .size = {256, 256, 256},
     .grid = {64, 64, 64},
     .order = 3,
     .rays = 32,
     .threads = 1,
     .frame = 1,
     .sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 1, 1}, .rgb = {2, 2, 2}}},
    {.name = "gyroid256",
     .size = {256, 256, 256},
     .grid = {64, 64, 64},
     .order = 3,
     .rays = 32,
     .threads = 1,
     .frame = 1,
     .sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 1, 1}, .rgb = {2, 2, 2}}},
    {.name = "fuel",
     .file = "fuel_64x64x64_uint8.raw",
     .size = {64, 64, 64},
     .grid = {64, 64, 64},
     .order = 4,
     .rays = 128,
     .reduction = 4,
     .threads = 2,
     .update = 1,
     .points = 5,
     .point = {{0, {.2f, .4f, 1}, 0}, {10, {.2f, .4f, 1}, 0}, {40, {.2f, .4f, 1}, .1f}, {120, {1, .8f, .2f}, .5f}, {255, {1, .2f, .1f}, 1}},
     .sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 1, 1}, .rgb = {3, 3, 3}}},
    {.name = "engine",
     .file = "engine_256x256x128_uint8.raw",
     .hdr = "hdr/grace_256x128.hdr",
     .size = {256, 256, 128},
     .grid = {32, 32, 32},
     .order = 3,
     .rays = 32,
     .reduction = 2.8,
     .threads = 2,
     .update = 1,
     .frame = 1,
     .points = 6,
     .point = {{0, {.8f, .8f, .8f}, 0},
               {70, {.8f, .8f, .8f}, 0},
               {100, {.8f, .8f, .8f}, .02f},
               {150, {.8f, .8f, .8f}, .05f},
               {180, {1, .7f, .3f}, .4f},
               {255, {1, .6f, .2f}, .8f}}},
    {.name = "bonsai",
     .file = "bonsai_256x256x256_uint8.raw",
     .hdr = "hdr/grace_256x128.hdr",
     .size = {256, 256, 256},
     .grid = {64, 64, 32},
     .order = 2,
     .rays = 64,
     .reduction = 6.7,
     .threads = 2,
     .update = 1,
     .frame = 1,
     .flipped = 1,
     .points = 6,
     .point = {{0, {.3f, .7f, .2f}, 0},
               {25, {.3f, .7f, .2f}, 0},
               {40, {.3f, .7f, .2f}, .15f},
               {80, {.5f, .35f, .2f}, .2f},
               {160, {.6f, .6f, .6f}, .6f},
               {255, {.7f, .7f, .7f}, .9f}}}};

static double wall_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Transmittance as the text books have it: half-voxel steps through the trilinear field of bytes; nothing of the header. */
static double bench_ray(const bench_scene *s, const uint8_t *data, const float *table, const double from[3], const double dir[3]) {
    double leave = 1e9, depth = 0;
    for (int a = 0; a < 3; a++) {
        double t = ((dir[a] > 0 ? (double)s->size[a] - 1 : 0) - from[a]) / dir[a];
        if (fabs(dir[a]) > 1e-12 && t < leave) leave = t;
    }
    for (double t = 0.25; t < leave && depth < 12; t += 0.5) {
        size_t at = 0, stride = 1, step[3];
        double u[3], v[4];
        for (int a = 0; a < 3; a++) {
            double x = fmin(fmax(from[a] + t * dir[a], 0), (double)s->size[a] - 1.000001);
            u[a] = x - floor(x), at += stride * (size_t)x, step[a] = stride, stride *= s->size[a];
        }
        for (int k = 0; k < 4; k++) {
            const uint8_t *p = data + at + (k & 1 ? step[1] : 0) + (k & 2 ? step[2] : 0);
            v[k] = p[0] + u[0] * ((double)p[1] - (double)p[0]);
        }
        v[0] += u[1] * (v[1] - v[0]), v[2] += u[1] * (v[3] - v[2]), v[0] += u[2] * (v[2] - v[0]);
        depth += 0.5 * (double)table[(size_t)(v[0] * 16)];
    }
    return exp(-depth);
}

/* Relative RMSE of all coefficients against 2048 rays, on 1024 points (256 with --quick) of the grid drawn at random. */
typedef struct bench_reference { float place[1024][3]; double v[1024][16]; } bench_reference;

static void bench_make_reference(const bench_scene *s, const uint8_t *data, const isogi_transfer *transfer, bench_reference *out) {
    double(*dir)[3] = (double(*)[3])malloc(2048 * sizeof *dir), *y = (double *)malloc(2048 * 16 * sizeof *y);
    float table[4096];
    uint32_t seed = 1;
    for (int i = 0; i < 4096; i++) {
        float rgb[3];
        isogi_transfer_at(transfer, i / 16.0, rgb, &table[i]);
    }
    for (int k = 0; k < 2048; k++) {
        double z = 1 - (2 * k + 1) / 2048.0, r = sqrt(1 - z * z), phi = 2 * pi * fmod(k * 0.6180339887498949, 1);
        dir[k][0] = r * cos(phi), dir[k][1] = r * sin(phi), dir[k][2] = z;
    }
    isogi_sh_eval_f64(y, s->order, (const double(*)[3])dir, 2048);
    for (int i = 0; i < POINTS; i++) {
        int n = s->order * s->order;
        double from[3];
        for (int a = 0; a < 3; a++) {
            seed = seed * 1664525u + 1013904223u;
            from[a] = (double)((seed >> 8) % s->grid[a]) * ((double)s->size[a] - 1) / ((double)s->grid[a] - 1),
            out->place[i][a] = (float)from[a];
        }
        memset(out->v[i], 0, sizeof out->v[i]);
        for (int k = 0; k < 2048; k++) {
            double clear = bench_ray(s, data, table, from, dir[k]);
            for (int c = 0; c < n; c++) out->v[i][c] += clear * y[k * n + c] * 4 * pi / 2048;
        }
    }
    free(dir), free(y);
}

static void bench_update(const bench_scene *s, const isogi_pyramid *pyramid, const uint8_t *data, const isogi_transfer *transfer) {
    static const char *const names[] = {"default", "brute", "paper", "sweep"};
    bench_reference *reference = (bench_reference *)malloc(sizeof *reference);
    const isogi_context threads = {.threads = s->threads};
    bench_make_reference(s, data, transfer, reference);
    for (int m = 0; m < 7; m++) {
        isogi_dvr_desc desc = {.pyramid = pyramid,
                               .shading = ISOGI_DVR_VISIBILITY,
                               .order = s->order,
                               .directions = s->rays,
                               .grid = {s->grid[0], s->grid[1], s->grid[2]}};
        float(*v)[16] = (float(*)[16])calloc(1024, sizeof *v);
        double seconds = 1e9, sum = 0, norm = 0;
        int n = s->order * s->order;
        char name[32], setting[32];
        if (m == 1) continue; /* minutes; its error is that of its rays */
        desc.method = (isogi_dvr_method)(m < 4 ? m : ISOGI_DVR_SWEEP), desc.reduction = s->reduction;
        if (m == ISOGI_DVR_PAPER) desc.sphere = ISOGI_DVR_OCTAHEDRON;
        if (m == 4) desc.directions = s->rays / 2;
        if (m > 4) desc.directions = s->rays << (m - 4);
        for (int turn = 0; turn < (m == ISOGI_DVR_PAPER || m > 4 ? 1 : 3); turn++) {
            isogi_dvr *dvr = NULL;
            double begun;
            if (isogi_dvr_create(&dvr, &desc, &threads) != ISOGI_OK) exit(1);
            begun = wall_seconds();
            if (isogi_dvr_set_transfer(dvr, transfer) != ISOGI_OK || isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
            seconds = fmin(seconds, wall_seconds() - begun);
            if (!turn && isogi_dvr_sample_visibility(dvr, (const float(*)[3])reference->place, (size_t)POINTS, v[0]) != ISOGI_OK) exit(1);
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < POINTS; i++)
            for (int c = 0; c < n; c++) {
                double d = (double)v[0][i * n + c] - reference->v[i][c];
                sum += d * d, norm += reference->v[i][c] * reference->v[i][c];
            }
        snprintf(name, sizeof name, "%s", m < 4 ? names[m] : "sweep"), snprintf(setting, sizeof setting, "%d rays", desc.directions);
        row("tf-update", s->name, name, setting, seconds, sqrt(sum / norm),
            (double)(s->grid[0] * s->grid[1] * s->grid[2]) * desc.directions, "ray");
        free(v);
    }
    free(reference);
}

/* An edit of a transfer function whose visibility is there: a tenth less extinction in the uppermost 10, 50, 100 % of the values that
   absorb, to the end of the step. Error: of coefficients at random places against a renderer made for the new function. */
static void bench_edit(const bench_scene *s, const isogi_pyramid *pyramid, const isogi_transfer *transfer) {
    static const double shares[] = {0.1, 0.5, 1};
    const isogi_context threads = {.threads = s->threads};
    const size_t n = (size_t)(s->order * s->order), count = (size_t)POINTS;
    const isogi_dvr_desc desc = {.pyramid = pyramid,
                                 .shading = ISOGI_DVR_VISIBILITY,
                                 .order = s->order,
                                 .directions = s->rays,
                                 .grid = {s->grid[0], s->grid[1], s->grid[2]}};
    float(*place)[3] = (float(*)[3])malloc(count * sizeof *place), *v = (float *)malloc(2 * count * n * sizeof *v);
    uint32_t seed = 1;
    for (size_t i = 0; i < 3 * count; i++) {
        seed = seed * 1664525u + 1013904223u;
        place[i / 3][i % 3] = (float)(seed >> 8) / 16777216.0f * (float)(s->size[i % 3] - 1);
    }
    for (int k = 0; k < 3; k++) {
        isogi_transfer_point p[16];
        isogi_transfer edited = {.points = p};
        isogi_dvr *dvr = NULL, *fresh = NULL;
        double least = 0, at, seconds = 1e9, sum = 0, norm = 0;
        char setting[32];
        for (size_t i = transfer->point_count; i-- > 0;)
            if (!(transfer->points[i].extinction > 0)) {
                least = transfer->points[i].value;
                break;
            }
        at = least + (1 - shares[k]) * (transfer->points[transfer->point_count - 1].value - least);
        for (size_t i = 0; i < transfer->point_count; i++) {
            if (transfer->points[i].value > at && (!i || transfer->points[i - 1].value <= at))
                for (int side = 0; side < 2; side++) {
                    isogi_transfer_point *q = &p[edited.point_count++];
                    q->value = at, isogi_transfer_at(transfer, at, q->rgb, &q->extinction);
                    if (side) q->extinction *= 0.9f;
                }
            p[edited.point_count] = transfer->points[i];
            if (transfer->points[i].value > at) p[edited.point_count].extinction *= 0.9f;
            edited.point_count++;
        }
        if (isogi_dvr_create(&dvr, &desc, &threads) != ISOGI_OK || isogi_dvr_create(&fresh, &desc, &threads) != ISOGI_OK) exit(1);
        for (int turn = 0; turn < 3; turn++) {
            double begun;
            if (isogi_dvr_set_transfer(dvr, transfer) != ISOGI_OK || isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
            begun = wall_seconds();
            if (isogi_dvr_set_transfer(dvr, &edited) != ISOGI_OK || isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
            seconds = fmin(seconds, wall_seconds() - begun);
        }
        if (isogi_dvr_set_transfer(fresh, &edited) != ISOGI_OK || isogi_dvr_step(fresh, 0, NULL) != ISOGI_OK ||
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])place, count, v) != ISOGI_OK ||
            isogi_dvr_sample_visibility(fresh, (const float(*)[3])place, count, v + count * n) != ISOGI_OK)
            exit(1);
        for (size_t i = 0; i < count * n; i++) {
            double d = (double)v[i] - (double)v[count * n + i];
            sum += d * d, norm += (double)v[i] * (double)v[i];
        }
        snprintf(setting, sizeof setting, "%g %% of values", 100 * shares[k]);
        row("tf-edit", s->name, k ? "edit" : "default", setting, seconds, sqrt(sum / norm),
            (double)(s->grid[0] * s->grid[1] * s->grid[2]) * s->rays, "ray");
        isogi_dvr_free(dvr), isogi_dvr_free(fresh);
    }
    free(place), free(v);
}

/* The reference picture: visibility of 2048 rays by brute force (brute_reference.h), post-classified steps of 1/8 voxel. Times are those of
   512x512 pixels; with --quick the error is that of 16x16 pixels of the same view, whose reference takes a minute or
   two, once. */
static void bench_frame(const bench_scene *s, const isogi_pyramid *pyramid, const isogi_transfer *transfer,
                        const isogi_lighting *lighting) {
    const isogi_volume *volume = isogi_vol_volume(pyramid);
    const isogi_context threads = {.threads = s->threads}, all = {0};
    const double steps[] = {0.125, 0, 0.5, 2};
    isogi_view view = {.width = FRAME, .height = FRAME};
    double toward[3] = {1.5, s->flipped ? 2.0 : 1.2, s->flipped ? -1.2 : 2.0}, radius = 0, length = sqrt(1.5 * 1.5 + 1.2 * 1.2 + 4);
    size_t pixels = (size_t)PIXELS * (size_t)PIXELS;
    float(*image)[4] = (float(*)[4])malloc((size_t)FRAME * (size_t)FRAME * sizeof *image);
    float(*reference)[4] = (float(*)[4])malloc(pixels * sizeof *reference);
    if (s->flipped) view.up[2] = -1;
    for (int a = 0; a < 3; a++) radius += pow(0.5 * (double)(s->size[a] - 1) * volume->spacing[a], 2);
    for (int a = 0; a < 3; a++) {
        view.target[a] = (float)(volume->origin[a] + 0.5 * (double)(s->size[a] - 1) * volume->spacing[a]);
        view.eye[a] = (float)((double)view.target[a] + toward[a] / length * sqrt(radius) / sin(pi / 8));
    }
    for (int i = 0; i < 4; i++) {
        isogi_dvr_desc desc = {.pyramid = pyramid,
                               .shading = ISOGI_DVR_VISIBILITY,
                               .order = s->order,
                               .directions = i ? s->rays : REFERENCE,
                               .grid = {s->grid[0], s->grid[1], s->grid[2]},
                               .step = steps[i],
                               .method = i ? ISOGI_DVR_METHOD_DEFAULT : ISOGI_DVR_BRUTE,
                               .visibility_step = i ? 0 : 0.25,
                               .classification = i ? ISOGI_DVR_EXACT : ISOGI_DVR_POST_CLASSIFIED};
        double seconds = 1e9, sum = 0;
        isogi_counters count;
        isogi_dvr *dvr = NULL;
        char setting[32];
        if (isogi_dvr_create(&dvr, &desc, i ? &threads : &all) != ISOGI_OK || isogi_dvr_set_transfer(dvr, transfer) != ISOGI_OK) exit(1);
        view.width = view.height = PIXELS;
        if (!i) brute_visibility(dvr, &view, transfer, s->name, 0, dry ? 0.1 : 0.01); /* dry: noise */
        else if (isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) exit(1);
        for (int turn = 0; turn < (i ? 3 : 1); turn++) {
            double begun = s->threads == 1 ? cpu_seconds() : wall_seconds();
            view.width = view.height = i ? FRAME : PIXELS;
            memset(&count, 0, sizeof count);
            if (isogi_dvr_render(dvr, &view, lighting, i ? image : reference, NULL, &count) != ISOGI_OK) exit(1);
            seconds = fmin(seconds, (s->threads == 1 ? cpu_seconds() : wall_seconds()) - begun);
        }
        view.width = view.height = PIXELS;
        if (i && PIXELS < FRAME && isogi_dvr_render(dvr, &view, lighting, image, NULL, NULL) != ISOGI_OK) exit(1);
        isogi_dvr_free(dvr);
        if (!i) continue;
        for (size_t k = 0; k < 3 * pixels; k++) {
            double d = srgb((double)image[k / 3][k % 3]) - srgb((double)reference[k / 3][k % 3]);
            sum += d * d;
        }
        snprintf(setting, sizeof setting, "step %g", i == 1 ? 1 : steps[i]);
        row("frame", s->name, i == 1 ? "default" : "steps", setting, seconds, sqrt(sum / (double)(3 * pixels)), (double)count.samples,
            "sample");
    }
    free(image), free(reference);
}

static void bench_scene_rows(const bench_scene *s) {
    const char *folder = getenv("ISOGI_DATA");
    static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    size_t count = s->size[0] * s->size[1] * s->size[2];
    isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = &s->sun, .light_count = s->sun.rgb[0] > 0};
    isogi_volume volume = {.size = {s->size[0], s->size[1], s->size[2]}};
    isogi_transfer_point p[6];
    isogi_transfer transfer = {.points = p, .point_count = (size_t)s->points};
    isogi_pyramid *pyramid = NULL;
    hdr_image image = {0};
    char path[512], error[512];
    void *data = large_allocate(count * (s->file ? 1 : sizeof(float)));
    memcpy(p, s->point, sizeof p);
    if (s->file) {
        FILE *file;
        snprintf(path, sizeof path, "%s/%s", folder ? folder : "", s->file);
        for (size_t i = 0; dry && i < count; i++) ((uint8_t *)data)[i] = (uint8_t)(i * 37 % 256);
        file = dry ? NULL : folder ? fopen(path, "rb") : NULL;
        if (!dry && (!file || fread(data, 1, count, file) != count)) {
            fprintf(stderr, "  %s: left out, ISOGI_DATA holds no %s\n", s->name, s->file);
            if (file) fclose(file);
            free(data);
            return;
        }
        if (file) fclose(file);
        if (s->hdr && !dry) {
            snprintf(path, sizeof path, "%s/%s", folder, s->hdr);
            if (!hdr_read(path, &image, error)) fprintf(stderr, "  %s: %s\n", path, error);
            else
                lighting.env.sh = NULL, lighting.env.sh_order = 0, lighting.env.rgb = image.rgb, lighting.env.width = image.width,
                lighting.env.height = image.height;
        }
    } else {
        float *f = (float *)data, low = 1e9f, high = -1e9f, u;
        size_t n = s->size[0];
        double iso = s->name[0] == 'g' ? 0 : 0.5, spacing = 2 / (double)(n - 1);
        for (size_t i = 0; i < count; i++) {
            double x = -1 + spacing * (double)(i % n), y = -1 + spacing * (double)(i / n % n), z = -1 + spacing * (double)(i / n / n);
            f[i] = (float)(s->name[0] == 'g' ? gyroid(x, y, z) : marschner_lobb(x, y, z));
            low = fminf(low, f[i]), high = fmaxf(high, f[i]);
        }
        const isogi_transfer_point tent[5] = {{(double)low, {.2f, .3f, .9f}, 0},
                                              {iso - 0.05 * (double)(high - low), {0, 0, 0}, 0},
                                              {iso, {.9f, .8f, .6f}, 0.357f},
                                              {iso + 0.05 * (double)(high - low), {0, 0, 0}, 0},
                                              {(double)high, {.9f, .2f, .2f}, 0}};
        memcpy(p, tent, sizeof tent);
        for (int i = 1; i < 4; i += 2) {
            int end = i == 1 ? 0 : 4;
            u = (float)((p[i].value - p[2].value) / (p[end].value - p[2].value));
            for (int a = 0; a < 3; a++) p[i].rgb[a] = p[2].rgb[a] + u * (p[end].rgb[a] - p[2].rgb[a]);
        }
        transfer.point_count = 5, volume.type = ISOGI_F32;
        for (int a = 0; a < 3; a++) volume.spacing[a] = spacing, volume.origin[a] = -1;
    }
    if (s->file && !s->hdr) lighting.env.sh = NULL, lighting.env.sh_order = 0;
    volume.data = data;
    if (isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) exit(1);
    if (s->frame) bench_frame(s, pyramid, &transfer, &lighting);
    if (s->update) bench_update(s, pyramid, (const uint8_t *)data, &transfer);
    if (s->update) bench_edit(s, pyramid, &transfer);
    isogi_vol_free(pyramid);
    free(image.rgb), free(data);
}

int main(int argc, char **argv) {
    const char *path = NULL, *only = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) N = 64, WIDTH = 128, points = 6, POINTS = 256, PIXELS = 16;
        else if (!strcmp(argv[i], "--dry")) dry = 1, N = 16, WIDTH = 16, points = 4, POINTS = 8, PIXELS = FRAME = 16, REFERENCE = 64;
        else if (!strcmp(argv[i], "--only") && i + 1 < argc) only = argv[++i];
        else path = argv[i];
    }
    if (!path || path[0] == '-' || !(csv = fopen(path, "w")))
        return fprintf(stderr, "usage: %s [--quick | --dry] [--only SCENE] OUT.csv\n", argv[0]), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    for (int f = only ? 2 : 0; f < 2; f++) {
        size_t n = (size_t)N, i;
        float *data = (float *)malloc(n * n * n * sizeof(float)), low = 1e9f, high = -1e9f;
        for (i = 0; i < n * n * n; i++) {
            double x = 2.0 * (double)(i % n) / (N - 1) - 1, y = 2.0 * (double)(i / n % n) / (N - 1) - 1,
                   z = 2.0 * (double)(i / n / n) / (N - 1) - 1;
            data[i] = (float)(f ? gyroid(x, y, z) : marschner_lobb(x, y, z));
            low = fminf(low, data[i]), high = fmaxf(high, data[i]);
        }
        double middle = f ? 0 : 0.5, half = 0.05 * (double)(high - low),
               at[5] = {(double)low, middle - half, middle, middle + half, (double)high};
        isogi_transfer_point p[5] = {
            {0, {.2f, .3f, .9f}, 0}, {0, {0, 0, 0}, 0}, {0, {.9f, .8f, .6f}, 0.357f}, {0, {0, 0, 0}, 0}, {0, {.9f, .2f, .2f}, 0}};
        for (i = 0; i < 5; i++) p[i].value = at[i];
        for (int a = 0; a < 3; a++)
            for (i = 1; i < 4; i += 2) {
                double u = (at[i] - at[i - 1 + 0]) / (at[i + 1] - at[i - 1]);
                p[i].rgb[a] = p[i - 1].rgb[a] + (float)u * (p[i + 1].rgb[a] - p[i - 1].rgb[a]);
            }
        const isogi_transfer physical = {.points = p, .point_count = 5};
        const double spacing = 2.0 / (N - 1);
        const isogi_volume volume = {
            .data = data, .type = ISOGI_F32, .size = {n, n, n}, .spacing = {spacing, spacing, spacing}, .origin = {-1, -1, -1}};
        isogi_pyramid *pyramid = NULL;
        if (isogi_vol_build(&pyramid, &volume, &serial) != ISOGI_OK) return 1;
        const char *scene = f ? "gyroid" : "ml";
        bench_frames(scene, pyramid, &physical, ISOGI_DVR_PHYSICAL, ISOGI_DVR_UNLIT);
        bench_frames(scene, pyramid, &physical, ISOGI_DVR_PHYSICAL, ISOGI_DVR_VISIBILITY);
        bench_visibility(scene, pyramid, &physical);
        isogi_vol_free(pyramid);
        free(data);
    }
    for (size_t i = 0; i < sizeof bench_scenes / sizeof bench_scenes[0]; i++)
        if (!only || !strcmp(only, bench_scenes[i].name)) {
            bench_scene s = bench_scenes[i];
            for (int a = 0; dry && a < 3; a++) s.size[a] = 16, s.grid[a] = 8;
            bench_scene_rows(&s);
        }
    if (!only || !strcmp(only, "scale-invariant")) bench_scale_invariant();
    if (!only) bench_tables();
    goals_print(goals, sizeof goals / sizeof *goals);
    return fclose(csv) ? 1 : 0;
}
