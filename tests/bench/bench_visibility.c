/* The parameter study of Kronander 2011 (section 5), its tables 1 and 2 and the baseline of its figure 14, with our data.

       build/bench/bench_visibility [--quick] [--only SCENE] [--study NAME] [--sweeps] OUT.csv

   --study: rays, coefficients, blocks, grid, resolutions, frames or shading alone; --sweeps: without the paper's method, which takes most
   of the time.

   Two threads, wall seconds. torus-sphere-plane, the paper's worst case (9 coefficients, 128 rays, radius 16, 1:3, grid 64^3), and bonsai
   under Grace (4 coefficients, 64 rays, radius 16, 1:6.7, grid 64x64x32); one parameter is varied at a time, by sweeps (the default) and by
   the paper's method, which alone has a reduction and a radius. Time: of a whole update; in frames-*, of a frame. Errors are those of the
   frame of 512x512 in the standard view, once as RMSE of sRGB values (cases ...-rmse), once as the share of pixels that look different with
   a probability above 75 % (cases ...-seen; Yee and Newman 2004, with Daly's psychometric function: tests/perceptual.h; 45 degrees wide,
   100 cd/m^2), against sweeps with 2048 rays on the same grid (rays, reduction, radius), 36 coefficients (coefficients), a grid of twice
   the points along each axis of the finest one, which is 256x256x128 for bonsai and 128^3 for torus-sphere-plane (grid; takes 3 GB), a
   regular grid of 129 or 193 points along each axis (resolutions, ml256 too). --quick: torus-sphere-plane at 48^3, 128x128 pixels, a few
   settings. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "hdr.h"
#include "perceptual.h"
#include "picture.h"
#include "procedural.h"
#include <stdio.h>
#include <time.h>

static const double pi = 3.14159265358979323846;
static const isogi_context two = {.threads = 2};
static FILE *csv;
static int quick, sweeps_alone, SIDE = 512;
static const char *only_study;

typedef struct study {
    const char *name;
    isogi_pyramid *pyramid;
    isogi_transfer transfer;
    isogi_lighting lighting;
    isogi_dvr_desc base;
    isogi_view view;
    double exposure;
} study;

static double wall_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void row(const char *name, const char *scene, const char *kind, const char *method, const char *setting, double seconds,
                double error, double work, const char *unit) {
    fprintf(csv, "isogi_dvr.h,%s-%s%s,%s,%s,%.6g,%.6g,%.6g,%s\n", name, scene, kind, method, setting, seconds, error, work, unit);
    fflush(csv);
    fprintf(stderr, "  %-12s %-20s %-6s %-8s %-22s %9.4f s  error %.4g\n", name, scene, kind, method, setting, seconds, error);
}

static void need(isogi_result result, const char *what) {
    if (result == ISOGI_OK) return;
    fprintf(stderr, "%s: %s\n", what, isogi_result_string(result));
    exit(1);
}

/* A frame in display values over black: sRGB of what the exposure makes of it. */
typedef struct frame { float (*srgb)[3]; double update, render; isogi_dvr_report report; } frame;

static frame frame_of(const study *s, const isogi_dvr_desc *desc, int local, const isogi_lighting *lighting) {
    frame f = {.srgb = (float(*)[3])malloc((size_t)SIDE * (size_t)SIDE * sizeof(float[3])), .render = 1e9};
    float(*image)[4] = (float(*)[4])malloc((size_t)SIDE * (size_t)SIDE * sizeof *image);
    isogi_view view = s->view;
    isogi_dvr *dvr = NULL;
    if (!f.srgb || !image) exit(1);
    view.local = local;
    need(isogi_dvr_create(&dvr, desc, &two), "create");
    f.update = wall_seconds();
    need(isogi_dvr_set_transfer(dvr, &s->transfer), "set_transfer"), need(isogi_dvr_step(dvr, 0, NULL), "step");
    f.update = wall_seconds() - f.update;
    for (int turn = 0; turn < (quick ? 1 : 2); turn++) {
        double begun = wall_seconds();
        need(isogi_dvr_render(dvr, &view, lighting, image, NULL, NULL), "render");
        f.render = fmin(f.render, wall_seconds() - begun);
    }
    isogi_dvr_inspect(dvr, &f.report), f.report.level = NULL;
    for (int i = 0; i < 3 * SIDE * SIDE; i++) {
        double x = fmin(1, fmax(0, (double)image[i / 3][i % 3] * s->exposure));
        f.srgb[i / 3][i % 3] = (float)(x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055);
    }
    isogi_dvr_free(dvr), free(image);
    return f;
}

/* Two rows, one for each error. `rendering`: of the frame's time instead of the update's. */
static void rows(const char *name, const study *s, const char *method, const char *setting, const frame *f, const frame *reference,
                 int rendering, double work, const char *unit) {
    double sum = 0, seconds = rendering ? f->render : f->update;
    for (int i = 0; i < 3 * SIDE * SIDE; i++) sum += pow((double)f->srgb[i / 3][i % 3] - (double)reference->srgb[i / 3][i % 3], 2);
    row(name, s->name, "-rmse", method, setting, seconds, sqrt(sum / (3.0 * SIDE * SIDE)), work, unit);
    row(name, s->name, "-seen", method, setting, seconds,
        fmax(0, perceptual_difference((const float(*)[3])f->srgb, (const float(*)[3])reference->srgb, SIDE, SIDE, 45, 0.75)), work, unit);
}

static void measure(const char *name, const study *s, const isogi_dvr_desc *desc, int is_default, const char *setting,
                    const frame *reference) {
    frame f = frame_of(s, desc, 0, &s->lighting);
    rows(name, s,
         is_default                        ? "default"
         : desc->method == ISOGI_DVR_PAPER ? "paper"
                                           : "sweep",
         setting, &f, reference, 0, (double)(desc->grid[0] * desc->grid[1] * desc->grid[2]) * desc->directions, "ray");
    free(f.srgb);
}

/* Figure 8: rays. The paper's method up to 256: its time goes with them. */
static void study_rays(const study *s) {
    isogi_dvr_desc desc = s->base;
    desc.directions = quick ? 256 : 2048;
    frame reference = frame_of(s, &desc, 0, &s->lighting);
    for (int paper = 0; paper < 2 - sweeps_alone; paper++)
        for (int rays = 16; rays <= (quick ? 64 : paper ? 256 : 2048); rays *= 2) {
            char setting[32];
            desc = s->base, desc.directions = rays;
            if (paper) desc.method = ISOGI_DVR_PAPER;
            snprintf(setting, sizeof setting, "%d rays", rays);
            measure("rays", s, &desc, !paper && rays == (quick ? 64 : s->base.directions), setting, &reference);
        }
    free(reference.srgb);
}

/* Figure 9: coefficients. */
static void study_coefficients(const study *s) {
    isogi_dvr_desc desc = s->base;
    desc.order = 6, desc.directions = 256;
    frame reference = frame_of(s, &desc, 0, &s->lighting);
    for (int paper = 0; paper < (quick || sweeps_alone ? 1 : 2); paper++)
        for (int order = 1; order <= 4; order++) {
            char setting[32];
            desc = s->base, desc.order = order;
            if (paper) desc.method = ISOGI_DVR_PAPER;
            snprintf(setting, sizeof setting, "%d coefficients", order * order);
            measure("coefficients", s, &desc, !paper && order == s->base.order, setting, &reference);
        }
    free(reference.srgb);
}

/* Figures 10 and 12: reduction and radius, of the paper's method alone; sweeps stand beside it. */
static void study_blocks(const study *s) {
    const double reductions[] = {33, 13, 6.7, 3.3, 1.7}, radii[] = {4, 8, 12, 16, 32};
    isogi_dvr_desc desc = s->base;
    char setting[32];
    desc.directions = quick ? 256 : 2048;
    frame reference = frame_of(s, &desc, 0, &s->lighting);
    measure("reduction", s, &s->base, 1, "sweeps", &reference), measure("radius", s, &s->base, 1, "sweeps", &reference);
    for (int i = 0; i < 5 && !sweeps_alone; i++) {
        if (quick && i % 2) continue;
        desc = s->base, desc.method = ISOGI_DVR_PAPER, desc.directions = 32, desc.reduction = reductions[i];
        snprintf(setting, sizeof setting, "1:%g", reductions[i]);
        measure("reduction", s, &desc, 0, setting, &reference);
        desc = s->base, desc.method = ISOGI_DVR_PAPER, desc.directions = 32, desc.radius = radii[i];
        snprintf(setting, sizeof setting, "radius %g", radii[i]);
        measure("radius", s, &desc, 0, setting, &reference);
    }
    free(reference.srgb);
}

/* Figure 11: grids from half the base's points along each axis to twice or four times; the reference has twice as many as the last. */
static void study_grids(const study *s) {
    size_t most = quick ? 2 : s->base.order > 2 ? 4 : 8;
    isogi_dvr_desc desc = s->base;
    for (int a = 0; a < 3; a++) desc.grid[a] *= most;
    frame reference = frame_of(s, &desc, 0, &s->lighting);
    for (int paper = 0; paper < (quick || sweeps_alone ? 1 : 2); paper++)
        for (size_t half = 1; half <= most; half *= 2) { /* in halves of the base */
            char setting[80];
            desc = s->base;
            for (int a = 0; a < 3; a++) desc.grid[a] = desc.grid[a] * half / 2;
            if (paper) desc.method = ISOGI_DVR_PAPER;
            if (paper && half > 2) continue;
            snprintf(setting, sizeof setting, "%zux%zux%zu", desc.grid[0], desc.grid[1], desc.grid[2]);
            measure("grid", s, &desc, !paper && half == 2, setting, &reference);
        }
    free(reference.srgb);
}

/* Several resolutions beside the regular grid (coarsest 1): memory is in the setting. */
static void study_resolutions(const study *s) {
    const size_t points[] = {33, 65, 97, 129, 193};
    const int last = quick ? 1 : s->pyramid && isogi_vol_volume(s->pyramid)->size[0] > 128 ? 4 : 3;
    isogi_dvr_desc desc = s->base;
    desc.grid[0] = desc.grid[1] = desc.grid[2] = points[last], desc.visibility_step = 1;
    frame reference = frame_of(s, &desc, 0, &s->lighting);
    for (int coarsest = 1; coarsest <= 8; coarsest *= 8)
        for (int n = 0; n <= last - (coarsest == 1); n++) { /* the last regular grid is the reference */
            char setting[80];
            desc = s->base, desc.coarsest = coarsest, desc.grid[0] = desc.grid[1] = desc.grid[2] = points[n];
            frame f = frame_of(s, &desc, 0, &s->lighting);
            snprintf(setting, sizeof setting, "%zu^3: %.2f MB", points[n], (double)f.report.global_bytes / 1e6);
            rows("resolutions", s,
                 coarsest > 1 ? "coarsest-8"
                 : n          ? "regular"
                              : "default",
                 setting, &f, &reference, 0, (double)f.report.grid_points * desc.directions, "ray");
            free(f.srgb);
        }
    free(reference.srgb);
}

/* Figure 13: a frame by the kind of light and the number of coefficients; no error but that of the light itself: 0. */
static void study_frames(const study *s) {
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    isogi_light lights[2] = {{.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 1, 1}, .rgb = {3, 3, 3}}, {.kind = ISOGI_LIGHT_POINT}};
    double far = 0;
    for (int a = 0; a < 3; a++) far = fmax(far, (double)v->size[a] * v->spacing[a]);
    for (int a = 0; a < 3; a++) lights[1].vector[a] = (float)(v->origin[a] + 1.5 * far), lights[1].rgb[a] = (float)(9 * far * far);
    for (int order = 1; order <= 4; order++)
        for (int kind = 0; kind < 3; kind++) {
            const isogi_lighting lighting = {
                .env = kind ? (isogi_env){.rgb = NULL} : s->lighting.env, .lights = lights + (kind == 2), .light_count = kind > 0};
            static const char *const kinds[3] = {"environment", "directional", "point"};
            char setting[64];
            isogi_dvr_desc desc = s->base;
            if (!kind && !lighting.env.rgb && !lighting.env.sh) continue;
            desc.order = order, desc.directions = 32;
            frame f = frame_of(s, &desc, 0, &lighting);
            snprintf(setting, sizeof setting, "%s %d coefficients", kinds[kind], order * order);
            row("frames", s->name, "", order == s->base.order && kind == 1 ? "default" : kinds[kind], setting, f.render, 0, 1, "frame");
            free(f.srgb);
        }
}

/* Figure 14: local diffuse shading, local visibility, global visibility, against global visibility by 2048 rays. */
static void study_shading(const study *s) {
    isogi_dvr_desc desc = s->base;
    frame f, reference;
    desc.directions = quick ? 256 : 2048;
    reference = frame_of(s, &desc, 0, &s->lighting);
    f = frame_of(s, &s->base, 0, &s->lighting), rows("shading", s, "default", "global visibility", &f, &reference, 1, 1, "frame"),
    free(f.srgb);
    desc = s->base, desc.method = ISOGI_DVR_PAPER;
    for (int local = 0; local < 2 && !sweeps_alone; local++) {
        f = frame_of(s, &desc, local, &s->lighting);
        rows("shading", s, local ? "paper-local" : "paper", local ? "local visibility" : "global visibility", &f, &reference, 1, 1,
             "frame"),
            free(f.srgb);
    }
    desc = s->base, desc.shading = ISOGI_DVR_LOCAL;
    f = frame_of(s, &desc, 0, &s->lighting), rows("shading", s, "diffuse", "by the gradient", &f, &reference, 1, 1, "frame"), free(f.srgb);
    desc.shading = ISOGI_DVR_UNLIT;
    f = frame_of(s, &desc, 0, &s->lighting), rows("shading", s, "unlit", "", &f, &reference, 1, 1, "frame"), free(f.srgb);
    free(reference.srgb);
}

/* Tables 1 and 2: update and frame at the paper's own settings, and bytes: in megabytes where the error stands elsewhere. */
static void tables(const study *s) {
    isogi_dvr_desc desc = s->base;
    frame f = frame_of(s, &desc, 0, &s->lighting);
    const double megabyte = 1 << 20;
    row("table-1", s->name, "", "default", "update", f.update, 0, 1, "update"),
        row("table-1", s->name, "", "frame", "by sweeps", f.render, 0, 1, "frame");
    row("table-2", s->name, "", "default", "megabytes: global", f.update, (double)f.report.global_bytes / megabyte, 1, "update");
    free(f.srgb);
    if (sweeps_alone) return;
    desc.method = ISOGI_DVR_PAPER, f = frame_of(s, &desc, 0, &s->lighting);
    row("table-1", s->name, "", "paper", "update", f.update, 0, 1, "update"),
        row("table-1", s->name, "", "paper-frame", "by blocks", f.render, 0, 1, "frame");
    row("table-2", s->name, "", "paper", "megabytes: data", f.update, (double)f.report.data_bytes / megabyte, 1, "update");
    row("table-2", s->name, "", "paper", "megabytes: index", f.update, (double)f.report.index_bytes / megabyte, 1, "update");
    row("table-2", s->name, "", "paper", "megabytes: local", f.update, (double)f.report.local_bytes / megabyte, 1, "update");
    row("table-2", s->name, "", "paper", "megabytes: global", f.update, (double)f.report.global_bytes / megabyte, 1, "update");
    row("table-2", s->name, "", "paper", "megabytes: all", f.update,
        (double)(f.report.data_bytes + f.report.index_bytes + f.report.local_bytes + f.report.global_bytes) / megabyte, 1, "update");
    free(f.srgb);
}

static void studies(const study *s) {
    static const struct { const char *name; void (*run)(const study *); } list[] = {
        {"rays", study_rays}, {"coefficients", study_coefficients}, {"blocks", study_blocks}, {"grid", study_grids},
        {"resolutions", study_resolutions}, {"frames", study_frames}, {"shading", study_shading}};
    for (size_t i = 0; i < sizeof list / sizeof *list; i++)
        if (!only_study || !strcmp(only_study, list[i].name)) list[i].run(s);
}

static void look_at(study *s, const double toward[3], const float up[3]) {
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    double radius = 0, length = sqrt(toward[0] * toward[0] + toward[1] * toward[1] + toward[2] * toward[2]);
    s->view = (isogi_view){.width = SIDE, .height = SIDE, .up = {up[0], up[1], up[2]}};
    for (int a = 0; a < 3; a++) radius += pow(0.5 * (double)(v->size[a] - 1) * v->spacing[a], 2);
    for (int a = 0; a < 3; a++) {
        s->view.target[a] = (float)(v->origin[a] + 0.5 * (double)(v->size[a] - 1) * v->spacing[a]);
        s->view.eye[a] = (float)((double)s->view.target[a] + toward[a] / length * sqrt(radius) / sin(pi / 8));
    }
    s->base.pyramid = s->pyramid, s->base.shading = ISOGI_DVR_VISIBILITY, s->base.radius = 16;
}

/* One exposure for all pictures of a scene: nine tenths of what is seen are below 0.6 of white. */
static void expose(study *s) {
    isogi_dvr_desc desc = s->base;
    isogi_view view = s->view;
    isogi_dvr *dvr = NULL;
    view.width = view.height = 128;
    float(*image)[4] = (float(*)[4])malloc(128 * 128 * sizeof *image);
    need(isogi_dvr_create(&dvr, &desc, &two), "create"), need(isogi_dvr_set_transfer(dvr, &s->transfer), "set_transfer"),
        need(isogi_dvr_step(dvr, 0, NULL), "step");
    need(image ? isogi_dvr_render(dvr, &view, &s->lighting, image, NULL, NULL) : ISOGI_NO_MEMORY, "render");
    s->exposure = picture_exposure((const float(*)[4])image, 128 * 128, 0.9, 0.6);
    isogi_dvr_free(dvr), free(image);
}

static void bench_procedural(void) {
    static const isogi_transfer_point p[] = {
        {0, {.85f, .8f, .75f}, 0}, {.5, {.85f, .8f, .75f}, 0}, {.5, {.85f, .8f, .75f}, 8}, {1, {.85f, .8f, .75f}, 8}};
    const isogi_light sun = {.vector = {1, 2, 1.5f}, .rgb = {9, 9, 9}};
    const double toward[3] = {1.5, 1.2, 2};
    const float up[3] = {0, 1, 0};
    study s = {.name = "torus-sphere-plane", .transfer = {.points = p, .point_count = 4}, .lighting = {.lights = &sun, .light_count = 1},
               .base = {.order = 3, .directions = 128, .reduction = 3, .grid = {64, 64, 64}}};
    isogi_volume volume;
    need(procedural_make(procedural_find("torus-sphere-plane"), quick ? 48 : 128, &volume, &two), "volume"),
        need(isogi_vol_build(&s.pyramid, &volume, &two), "build");
    if (quick) s.base.grid[0] = s.base.grid[1] = s.base.grid[2] = 24, s.base.directions = 64;
    look_at(&s, toward, up), expose(&s);
    studies(&s);
    isogi_vol_free(s.pyramid), procedural_free(&volume);
}

/* Marschner-Lobb in a box of side 2 under a sun and a sky, for several resolutions alone. */
static void bench_marschner_lobb(void) {
    static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {2, 2, 2}};
    const double toward[3] = {1.5, 1.2, 2}, spacing = 2.0 / 255;
    const float up[3] = {0, 1, 0};
    const size_t n = 256;
    float *data = (float *)malloc(n * n * n * sizeof *data);
    isogi_volume volume = {
        .data = data, .type = ISOGI_F32, .size = {n, n, n}, .spacing = {spacing, spacing, spacing}, .origin = {-1, -1, -1}};
    double range[2], half;
    study s = {.name = "ml256",
               .lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = &sun, .light_count = 1},
               .base = {.order = 3, .directions = 32, .grid = {64, 64, 64}}};
    if (!data) exit(1);
    for (size_t i = 0; i < n * n * n; i++) {
        double x = -1 + spacing * (double)(i % n), y = -1 + spacing * (double)(i / n % n), z = -1 + spacing * (double)(i / n / n);
        data[i] = (float)((1 - sin(pi * z / 2) + 0.25 * (1 + cos(2 * pi * 6 * cos(pi * sqrt(x * x + y * y) / 2)))) / 2.5);
    }
    need(isogi_vol_build(&s.pyramid, &volume, &two), "build"), isogi_vol_range(s.pyramid, range), half = 0.05 * (range[1] - range[0]);
    const isogi_transfer_point p[] = {{range[0], {.2f, .3f, .9f}, 0}, {0.5 - half, {.83f, .75f, .63f}, 0}, {0.5, {.9f, .8f, .6f}, .357f},
                                      {0.5 + half, {.9f, .74f, .56f}, 0}, {range[1], {.9f, .2f, .2f}, 0}};
    s.transfer.points = p, s.transfer.point_count = 5;
    look_at(&s, toward, up), expose(&s), study_resolutions(&s);
    isogi_vol_free(s.pyramid), free(data);
}

/* The volumes of its tables that we have: bonsai, of another resolution than the paper's, engine, half of it, and fuel. */
static void bench_real(int which) {
    static const isogi_transfer_point bonsai[] = {{0, {.3f, .7f, .2f}, 0},     {25, {.3f, .7f, .2f}, 0},    {40, {.3f, .7f, .2f}, .15f},
                                                  {80, {.5f, .35f, .2f}, .2f}, {160, {.6f, .6f, .6f}, .6f}, {255, {.7f, .7f, .7f}, .9f}};
    static const isogi_transfer_point engine[] = {{0, {.8f, .8f, .8f}, 0},      {70, {.8f, .8f, .8f}, 0},  {100, {.8f, .8f, .8f}, .02f},
                                                  {150, {.8f, .8f, .8f}, .05f}, {180, {1, .7f, .3f}, .4f}, {255, {1, .6f, .2f}, .8f}};
    static const isogi_transfer_point fuel[] = {
        {0, {.2f, .4f, 1}, 0}, {10, {.2f, .4f, 1}, 0}, {40, {.2f, .4f, 1}, .1f}, {120, {1, .8f, .2f}, .5f}, {255, {1, .2f, .1f}, 1}};
    static const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {3, 3, 3}};
    static const char *const files[3] = {"bonsai_256x256x256_uint8.raw", "engine_256x256x128_uint8.raw", "fuel_64x64x64_uint8.raw"};
    const size_t sizes[3][3] = {{256, 256, 256}, {256, 256, 128}, {64, 64, 64}},
                 count = sizes[which][0] * sizes[which][1] * sizes[which][2];
    study s[3] = {{.name = "bonsai",
                   .transfer = {.points = bonsai, .point_count = 6},
                   .base = {.order = 2, .directions = 64, .reduction = 6.7, .grid = {64, 64, 32}}},
                  {.name = "engine",
                   .transfer = {.points = engine, .point_count = 6},
                   .base = {.order = 3, .directions = 32, .reduction = 2.8, .grid = {32, 32, 32}}},
                  {.name = "fuel",
                   .transfer = {.points = fuel, .point_count = 5},
                   .lighting = {.lights = &sun, .light_count = 1},
                   .base = {.order = 4, .directions = 128, .reduction = 4, .grid = {64, 64, 64}}}};
    const char *folder = getenv("ISOGI_DATA");
    char path[1024], error[512];
    uint8_t *data = (uint8_t *)malloc(count);
    isogi_volume volume = {.data = data, .type = ISOGI_U8, .size = {sizes[which][0], sizes[which][1], sizes[which][2]}};
    hdr_image image = {0};
    const double upright[3] = {1.5, 1.2, 2}, turned[3] = {1.5, 2, -1.2};
    const float up[2][3] = {{0, 1, 0}, {0, 0, -1}};
    FILE *file;
    snprintf(path, sizeof path, "%s/%s", folder ? folder : "", files[which]);
    file = folder ? fopen(path, "rb") : NULL;
    if (!file || !data || fread(data, 1, count, file) != count) {
        fprintf(stderr, "  %s: left out, ISOGI_DATA holds no %s\n", s[which].name, files[which]);
        if (file) fclose(file);
        free(data);
        return;
    }
    fclose(file);
    snprintf(path, sizeof path, "%s/hdr/grace_256x128.hdr", folder);
    if (which < 2 && hdr_read(path, &image, error))
        s[which].lighting.env.rgb = image.rgb, s[which].lighting.env.width = image.width, s[which].lighting.env.height = image.height;
    need(isogi_vol_build(&s[which].pyramid, &volume, &two), "build");
    look_at(&s[which], which ? upright : turned, up[!which]), expose(&s[which]);
    if (!only_study) tables(&s[which]);
    if (!which) studies(s);
    isogi_vol_free(s[which].pyramid), free(image.rgb), free(data);
}

int main(int argc, char **argv) {
    static const char *const names[3] = {"bonsai", "engine", "fuel"};
    const char *path = NULL, *only = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) quick = 1, SIDE = 128;
        else if (!strcmp(argv[i], "--sweeps")) sweeps_alone = 1;
        else if (!strcmp(argv[i], "--only") && i + 1 < argc) only = argv[++i];
        else if (!strcmp(argv[i], "--study") && i + 1 < argc) only_study = argv[++i];
        else path = argv[i];
    }
    if (!path || path[0] == '-' || !(csv = fopen(path, "w")))
        return fprintf(stderr, "usage: %s [--quick] [--only SCENE] [--study NAME] [--sweeps] OUT.csv\n", argv[0]), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    if (!only || !strcmp(only, "torus-sphere-plane")) bench_procedural();
    for (int which = 0; which < 3 && !quick; which++)
        if (!only || !strcmp(only, names[which])) bench_real(which);
    if (only ? !strcmp(only, "ml256") : !quick) bench_marschner_lobb();
    return fclose(csv) ? 1 : 0;
}
