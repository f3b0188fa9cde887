/* The parameter study of Kronander 2011 (section 5), its tables 1 and 2 and the baseline of its figure 14, with our data.

       build/bench/bench_visibility [--quick] [--only SCENE] [--study NAME] [--sweeps] OUT.csv

   --study: rays, coefficients, blocks, grid, resolutions, frames, shading, light or tables alone; --sweeps: without the paper's method,
   which takes most of the time.

   Two threads, wall seconds. torus-sphere-plane, the paper's worst case (9 coefficients, 128 rays, radius 16, 1:3, grid 64^3), and bonsai
   under Grace (4 coefficients, 64 rays, radius 16, 1:6.7, grid 64x64x32); one parameter is varied at a time, by sweeps (the default) and by
   the paper's method, which alone has a reduction and a radius. Time: of a whole update; in frames-* and shading-*, of a frame. Errors are
   those of the frame of 512x512 in the standard view, as RMSE of sRGB values and, in cases ...-seen, as the share of pixels that look
   different with a probability above 75 % (Yee and Newman 2004, with Daly's psychometric function: tests/perceptual.h; 45 degrees wide,
   100 cd/m^2), against the same frame with another visibility:

       rays, reduction, radius, frames, shading, tables   as many coefficients of 2048 rays by brute force, at the same grid points
       coefficients        light from 2048 directions, each by its own ray, at the same grid points, without spherical harmonics; rows
                           "truncation" are coefficients of those rays, at the time of their frame
       grid                brute force on a grid of twice the points along each axis of the finest one; 32 rays, as all rows have, of which
                           "brute" are brute force on the coarser grids, at the time of their frame
       resolutions         a regular grid of 129 or 193 points along each axis by sweeps: what coarser grids lose (ml256 too)

   What is computed by brute force is kept in build/bench/ and goes on where it was stopped (brute_reference.h): with all scenes it takes
   half an hour, once. shading-*: every picture at an exposure at which the mean of its sRGB values is the reference's; the setting says how
   many times the reference's that is. table-2-*: work is megabytes. light-*: at places, see study_light. --quick: torus-sphere-plane at
   48^3, 128x128 pixels, a few settings; its sweeps err by their lattice of 2 voxels more than by rays or grid, which rows "lattice 1"
   show. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "brute_reference.h"
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

/* What 2048 rays by brute force tell of a grid point: coefficients of order 4, and at LIGHT the light that arrives, RGB. A renderer of
   order 5 computes it, whose kernel has that many columns. */
enum { DIRECTIONS = 2048, LIGHT = 16, TRUTH = 25 };

typedef struct study {
    const char *name;
    isogi_pyramid *pyramid;
    isogi_transfer transfer;
    isogi_lighting lighting;
    isogi_dvr_desc base;
    isogi_view view;
    double exposure;
    float (*truth)[TRUTH]; /* at grid points; NULL until it is asked for */
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

/* ---- references ---- */

/* Light into the last columns of a kernel, one for each channel: an image's, of each direction what is nearest to it of all directions;
   of a directional light, whose direction takes the place of the nearest. */
static void put_light(isogi_dvr *d, const isogi_lighting *lighting) {
    const isogi_env *env = &lighting->env;
    for (size_t k = 0; k < DIRECTIONS; k++)
        for (int c = LIGHT; c < TRUTH; c++) d->kernel[k * TRUTH + (size_t)c] = 0;
    for (int i = 0; i < env->width * env->height + (int)lighting->light_count; i++) {
        const isogi_light *light = i < env->width * env->height ? NULL : &lighting->lights[i - env->width * env->height];
        double w[3], area = 1, most = -2;
        size_t nearest = 0;
        float rgb[3];
        if (light) {
            for (int a = 0; a < 3; a++) w[a] = (double)light->vector[a], rgb[a] = light->rgb[a];
            vector_normalize(w);
        } else {
            const double row = pi * (i / env->width + 0.5) / env->height, turn = 2 * pi * ((i % env->width + 0.5) / env->width - 0.5);
            w[0] = sin(row) * sin(turn), w[1] = cos(row), w[2] = -sin(row) * cos(turn);
            area = 2 * pi / env->width * 2 * sin(row) * sin(0.5 * pi / env->height);
            for (int a = 0; a < 3; a++) rgb[a] = env->rgb[3 * i + a];
        }
        for (size_t k = 0; k < DIRECTIONS; k++) {
            const double *v = d->direction[k] + 3, dot = v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
            if (dot > most) most = dot, nearest = k;
        }
        if (light) memcpy(d->direction[nearest] + 3, w, sizeof w), isogi_dvr__transform(d->to_grid, w, d->direction[nearest]);
        for (int a = 0; a < 3; a++) d->kernel[nearest * TRUTH + LIGHT + (size_t)a] += (float)(area * (double)rgb[a]);
    }
}

static const float (*truth_of(study *s))[TRUTH] {
    isogi_dvr_desc desc = s->base;
    isogi_dvr *dvr = NULL;
    const size_t bytes = desc.grid[0] * desc.grid[1] * desc.grid[2] * sizeof *s->truth;
    if (s->truth) return (const float(*)[TRUTH])s->truth;
    desc.method = ISOGI_DVR_BRUTE, desc.order = 5, desc.directions = DIRECTIONS, desc.visibility_step = 0.05;
    need(isogi_dvr_create(&dvr, &desc, &two), "create"), need(isogi_dvr_set_transfer(dvr, &s->transfer), "set_transfer");
    put_light(dvr, &s->lighting);
    brute_visibility(dvr, &s->view, &s->transfer, s->name, brute_hash(1, dvr->kernel, dvr->kernel_count * sizeof *dvr->kernel), 0.01);
    s->truth = (float(*)[TRUTH])malloc(bytes);
    if (!s->truth) exit(1);
    memcpy(s->truth, dvr->visibility, bytes), isogi_dvr_free(dvr);
    return (const float(*)[TRUTH])s->truth;
}

/* Where visibility comes from. */
typedef enum source {
    COMPUTED, /* from the method that is measured */
    BRUTE,    /* from brute force with the same directions */
    TRUNCATED, /* from the truth: as many coefficients as the order has */
    WHOLE     /* and the light itself: coefficients 1 to 3 of order 2 are the channels of light, which an environment of these three sees */
} source;

static void fill(isogi_dvr *d, study *s, source from) {
    const float(*truth)[TRUTH] = from == BRUTE ? NULL : truth_of(s);
    if (from == BRUTE) {
        brute_visibility(d, &s->view, &s->transfer, s->name, 0, 0.05); /* few rays, of which each may graze what is opaque */
        return;
    }
    for (size_t i = 0; i < d->point_count; i++)
        for (size_t c = 0; c < d->coefficients; c++)
            d->visibility[i * d->coefficients + c] = truth[i][c && from == WHOLE ? LIGHT + c - 1 : c];
    d->next = d->point_count;
}

/* A frame in display values over black: sRGB of what the exposure makes of it. */
typedef struct frame { float (*srgb)[3], (*image)[4]; double update, render, mean; isogi_dvr_report report; } frame;

static double coded(double x) {
    x = fmin(1, fmax(0, x));
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

static void display(frame *f, double exposure) {
    f->mean = 0;
    for (int i = 0; i < 3 * SIDE * SIDE; i++) {
        f->srgb[i / 3][i % 3] = (float)coded((double)f->image[i / 3][i % 3] * exposure);
        f->mean += (double)f->srgb[i / 3][i % 3] / (3.0 * SIDE * SIDE);
    }
}

/* An exposure of its own, at which the mean is that of another frame; how many times the usual one. */
static double expose_like(frame *f, const study *s, const frame *other) {
    double low = 1e-4, high = 1e4;
    for (int i = 0; i < 40; i++) {
        display(f, sqrt(low * high) * s->exposure);
        if (f->mean < other->mean) low = sqrt(low * high);
        else high = sqrt(low * high);
    }
    return sqrt(low * high);
}

static void release(frame *f) { free(f->srgb), free(f->image); }

static frame frame_from(study *s, const isogi_dvr_desc *changed, source from, int local, const isogi_lighting *lighting) {
    static const float channels[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}; /* of order 2 */
    const isogi_lighting whole = {.env = {.sh = channels, .sh_order = 2}};
    frame f = {.srgb = (float(*)[3])malloc((size_t)SIDE * (size_t)SIDE * sizeof(float[3])), .render = 1e9};
    isogi_view view = s->view;
    isogi_dvr_desc desc = *changed;
    isogi_dvr *dvr = NULL;
    f.image = (float(*)[4])malloc((size_t)SIDE * (size_t)SIDE * sizeof *f.image);
    if (!f.srgb || !f.image) exit(1);
    view.local = local;
    if (from != COMPUTED) desc.method = ISOGI_DVR_BRUTE, desc.visibility_step = 0.05;
    if (from == WHOLE) desc.order = 2, lighting = &whole;
    need(isogi_dvr_create(&dvr, &desc, &two), "create");
    f.update = wall_seconds();
    need(isogi_dvr_set_transfer(dvr, &s->transfer), "set_transfer");
    for (double remaining = 1; from == COMPUTED && remaining > 0;) /* few directions at once where each takes a quarter of a gigabyte */
        need(isogi_dvr_step(dvr, dvr->point_count > 1u << 25 ? 2 * dvr->point_count : 0, &remaining), "step");
    if (from != COMPUTED) fill(dvr, s, from);
    f.update = wall_seconds() - f.update;
    for (int turn = 0; turn < (quick ? 1 : 2); turn++) {
        double begun = wall_seconds();
        need(isogi_dvr_render(dvr, &view, lighting, f.image, NULL, NULL), "render");
        f.render = fmin(f.render, wall_seconds() - begun);
    }
    isogi_dvr_inspect(dvr, &f.report), f.report.level = NULL;
    isogi_dvr_free(dvr);
    display(&f, s->exposure);
    return f;
}

static frame frame_of(study *s, const isogi_dvr_desc *desc) { return frame_from(s, desc, COMPUTED, 0, &s->lighting); }

static double rmse(const frame *f, const frame *reference) {
    double sum = 0;
    for (int i = 0; i < 3 * SIDE * SIDE; i++) sum += pow((double)f->srgb[i / 3][i % 3] - (double)reference->srgb[i / 3][i % 3], 2);
    return sqrt(sum / (3.0 * SIDE * SIDE));
}

/* Two rows, one for each error. `rendering`: of the frame's time instead of the update's. */
static void rows(const char *name, const study *s, const char *method, const char *setting, const frame *f, const frame *reference,
                 int rendering, double work, const char *unit) {
    double seconds = rendering ? f->render : f->update;
    row(name, s->name, "-rmse", method, setting, seconds, rmse(f, reference), work, unit);
    row(name, s->name, "-seen", method, setting, seconds,
        fmax(0, perceptual_difference((const float(*)[3])f->srgb, (const float(*)[3])reference->srgb, SIDE, SIDE, 45, 0.75)), work, unit);
}

static void measure(const char *name, study *s, const isogi_dvr_desc *desc, int is_default, const char *setting,
                    const frame *reference) {
    frame f = frame_of(s, desc);
    rows(name, s,
         is_default                        ? "default"
         : desc->method == ISOGI_DVR_PAPER ? "paper"
                                           : "sweep",
         setting, &f, reference, 0, (double)(desc->grid[0] * desc->grid[1] * desc->grid[2]) * desc->directions, "ray");
    release(&f);
}

/* Figure 8: rays. The paper's method up to 256: its time goes with them. */
static void study_rays(study *s) {
    isogi_dvr_desc desc = s->base;
    frame reference = frame_from(s, &desc, TRUNCATED, 0, &s->lighting);
    for (int way = 0; way < 3 - sweeps_alone; way++) /* sweeps on their lattice of 2 voxels and on one of 1, the paper's method */
        for (int rays = 16; rays <= (quick ? 64 : way ? 256 : 2048); rays *= 2) {
            char setting[32];
            desc = s->base, desc.directions = rays;
            if (way == 1) desc.visibility_step = 1;
            if (way == 2) desc.method = ISOGI_DVR_PAPER;
            snprintf(setting, sizeof setting, way == 1 ? "%d rays; lattice 1" : "%d rays", rays);
            measure("rays", s, &desc, !way && rays == (quick ? 64 : s->base.directions), setting, &reference);
        }
    release(&reference);
}

/* Figure 9: coefficients. */
static void study_coefficients(study *s) {
    isogi_dvr_desc desc = s->base;
    frame reference = frame_from(s, &desc, WHOLE, 0, &s->lighting);
    for (int order = 1; order <= 4; order++) {
        char setting[32];
        desc.order = order;
        frame f = frame_from(s, &desc, TRUNCATED, 0, &s->lighting);
        snprintf(setting, sizeof setting, "%d coefficients", order * order);
        rows("coefficients", s, "truncation", setting, &f, &reference, 1, 1, "frame"), release(&f);
    }
    for (int paper = 0; paper < (quick || sweeps_alone ? 1 : 2); paper++)
        for (int order = 1; order <= 4; order++) {
            char setting[32];
            desc = s->base, desc.order = order;
            if (paper) desc.method = ISOGI_DVR_PAPER;
            snprintf(setting, sizeof setting, "%d coefficients", order * order);
            measure("coefficients", s, &desc, !paper && order == s->base.order, setting, &reference);
        }
    release(&reference);
}

/* Figures 10 and 12: reduction and radius, of the paper's method alone; sweeps stand beside it. */
static void study_blocks(study *s) {
    const double reductions[] = {33, 13, 6.7, 3.3, 1.7}, radii[] = {4, 8, 12, 16, 32};
    isogi_dvr_desc desc = s->base;
    char setting[32];
    frame reference = frame_from(s, &desc, TRUNCATED, 0, &s->lighting);
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
    release(&reference);
}

/* Figure 11: grids from half the base's points along each axis to twice or four times; the reference has twice as many as the last, and for
   bonsai sweeps have as many, too: 512x512x256, as the paper, for which 4 GB of memory will do. What the grid alone does is told by brute
   force with the same directions. */
static void study_grids(study *s) {
    size_t most = quick ? 2 : s->base.order > 2 ? 4 : 8;
    isogi_dvr_desc desc = s->base;
    desc.directions = 32;
    for (int a = 0; a < 3; a++) desc.grid[a] *= most;
    frame reference = frame_from(s, &desc, BRUTE, 0, &s->lighting);
    for (int way = 0; way < (quick || sweeps_alone ? 2 : 3); way++)
        for (size_t half = 1; half <= (way == 0 && most == 8 ? 16 : way < 2 ? most : 2); half *= 2) { /* in halves of the base */
            char setting[80];
            for (int a = 0; a < 3; a++) desc.grid[a] = s->base.grid[a] * half / 2;
            if (way == 2) desc.method = ISOGI_DVR_PAPER;
            snprintf(setting, sizeof setting, "%zux%zux%zu", desc.grid[0], desc.grid[1], desc.grid[2]);
            if (way == 1) {
                frame f = frame_from(s, &desc, BRUTE, 0, &s->lighting);
                rows("grid", s, "brute", setting, &f, &reference, 1, 1, "frame"), release(&f);
            } else measure("grid", s, &desc, !way && half == 2, setting, &reference);
        }
    release(&reference);
}

/* Several resolutions beside the regular grid (coarsest 1): memory is in the setting. */
static void study_resolutions(study *s) {
    const size_t points[] = {33, 65, 97, 129, 193};
    const int last = s->pyramid && isogi_vol_volume(s->pyramid)->size[0] > 128 ? 4 : 3;
    isogi_dvr_desc desc = s->base;
    desc.grid[0] = desc.grid[1] = desc.grid[2] = points[last], desc.visibility_step = 1;
    frame reference = frame_of(s, &desc);
    for (int coarsest = 1; coarsest <= 8; coarsest *= 8)
        for (int n = 0; n <= last - (coarsest == 1); n++) { /* the last regular grid is the reference */
            char setting[80];
            desc = s->base, desc.coarsest = coarsest, desc.grid[0] = desc.grid[1] = desc.grid[2] = points[n];
            frame f = frame_of(s, &desc);
            snprintf(setting, sizeof setting, "%zu^3: %.2f MB", points[n], (double)f.report.global_bytes / 1e6);
            rows("resolutions", s,
                 coarsest > 1 ? "coarsest-8"
                 : n          ? "regular"
                              : "default",
                 setting, &f, &reference, 0, (double)f.report.grid_points * desc.directions, "ray");
            release(&f);
        }
    release(&reference);
}

/* Figure 13: a frame by the kind of light and the number of coefficients. */
static void study_frames(study *s) {
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
            frame reference = frame_from(s, &desc, TRUNCATED, 0, &lighting), f = frame_from(s, &desc, COMPUTED, 0, &lighting);
            snprintf(setting, sizeof setting, "%s %d coefficients", kinds[kind], order * order);
            row("frames", s->name, "", order == s->base.order && kind == 1 ? "default" : kinds[kind], setting, f.render,
                rmse(&f, &reference), 1, "frame");
            release(&f), release(&reference);
        }
}

/* Figure 14: local diffuse shading, local visibility, global visibility, and no light at all; each at an exposure of its own. */
static void study_shading(study *s) {
    static const struct { const char *method, *setting; isogi_dvr_method by; isogi_dvr_shading shading; int local; } list[] = {
        {"default", "global visibility", ISOGI_DVR_METHOD_DEFAULT, ISOGI_DVR_VISIBILITY, 0},
        {"paper", "global visibility", ISOGI_DVR_PAPER, ISOGI_DVR_VISIBILITY, 0},
        {"paper-local", "local visibility", ISOGI_DVR_PAPER, ISOGI_DVR_VISIBILITY, 1},
        {"diffuse", "by the gradient", ISOGI_DVR_METHOD_DEFAULT, ISOGI_DVR_LOCAL, 0},
        {"unlit", "unlit", ISOGI_DVR_METHOD_DEFAULT, ISOGI_DVR_UNLIT, 0}};
    frame reference = frame_from(s, &s->base, TRUNCATED, 0, &s->lighting);
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        char setting[64];
        isogi_dvr_desc desc = s->base;
        if (sweeps_alone && list[i].by == ISOGI_DVR_PAPER) continue;
        desc.method = list[i].by, desc.shading = list[i].shading;
        frame f = frame_from(s, &desc, COMPUTED, list[i].local, &s->lighting);
        snprintf(setting, sizeof setting, "%s; exposure x %.3g", list[i].setting, expose_like(&f, s, &reference));
        rows("shading", s, list[i].method, setting, &f, &reference, 1, 1, "frame"), release(&f);
    }
    release(&reference);
}

/* Tables 1 and 2: update and frame at the paper's own settings, and megabytes. */
static void tables(study *s) {
    const double megabyte = 1 << 20;
    frame reference = frame_from(s, &s->base, TRUNCATED, 0, &s->lighting);
    for (int paper = 0; paper < 2 - sweeps_alone; paper++) {
        isogi_dvr_desc desc = s->base;
        if (paper) desc.method = ISOGI_DVR_PAPER;
        frame f = frame_of(s, &desc);
        const double error = rmse(&f, &reference);
        const size_t bytes[4] = {f.report.global_bytes, f.report.local_bytes, f.report.index_bytes, f.report.data_bytes};
        static const char *const names[5] = {"global", "local", "index", "data", "all"};
        row("table-1", s->name, "", paper ? "paper" : "default", "update", f.update, error, 1, "update");
        row("table-1", s->name, "", paper ? "paper-frame" : "frame", paper ? "by blocks" : "by sweeps", f.render, error, 1, "frame");
        for (int i = 0; i < (paper ? 5 : 1); i++)
            row("table-2", s->name, "", paper ? "paper" : "default", names[i], f.update, error,
                (double)(i < 4 ? bytes[i] : bytes[0] + bytes[1] + bytes[2] + bytes[3]) / megabyte, "megabyte");
        release(&f);
    }
    release(&reference);
}

static void studies(study *s) {
    static const struct { const char *name; void (*run)(study *); } list[] = {
        {"rays", study_rays}, {"coefficients", study_coefficients}, {"blocks", study_blocks}, {"grid", study_grids},
        {"resolutions", study_resolutions}, {"frames", study_frames}, {"shading", study_shading}};
    for (size_t i = 0; i < sizeof list / sizeof *list; i++)
        if (only_study ? !strcmp(only_study, list[i].name) : !quick || list[i].run != study_resolutions) list[i].run(s);
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

/* What series that ring below zero cost: light at 400 places where rays of the view come to half of their opacity, half a voxel before
   it, from coefficients of 2048 rays, against light from these directions; under skies as they are, and turned so that most of their light
   is hidden ("behind"). "cut": negative light is black; "default": it is the least that isogi_dvr.h gives. RMSE of sRGB values, each sky at
   its own exposure. */
enum { PLACES = 400 };

static size_t places_of(const study *s, float places[PLACES][3]) {
    enum { SAMPLE = 128 };
    static float image[SAMPLE * SAMPLE][4], depth[SAMPLE * SAMPLE];
    isogi_dvr_desc desc = s->base;
    isogi_view view = s->view;
    isogi_dvr *dvr = NULL;
    size_t seen = 0, count = 0;
    view.width = view.height = SAMPLE, desc.shading = ISOGI_DVR_UNLIT;
    need(isogi_dvr_create(&dvr, &desc, &two), "create"), need(isogi_dvr_set_transfer(dvr, &s->transfer), "set_transfer");
    need(isogi_dvr_render(dvr, &view, NULL, image, depth, NULL), "render"), isogi_dvr_free(dvr);
    for (size_t i = 0; i < SAMPLE * SAMPLE; i++) seen += image[i][3] > 0.9f;
    for (size_t i = 0, n = 0; i < SAMPLE * SAMPLE && count < PLACES; i++) {
        double origin[3];
        float dir[3];
        if (!(image[i][3] > 0.9f) || n++ * PLACES / seen < count) continue;
        isogi_view_ray(&view, (double)(i % SAMPLE), (double)(i / SAMPLE), origin, dir);
        for (int a = 0; a < 3; a++) places[count][a] = (float)(origin[a] + ((double)depth[i] - 0.5) * (double)dir[a]);
        count++;
    }
    return count;
}

/* Transmittance from a place to the border in steps of half a voxel (voxels are 1 apart, the first at 0). */
static double clear_along(const study *s, const float place[3], const double dir[3]) {
    static float at[BRUTE_SAMPLES][3], value[BRUTE_SAMPLES];
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    double depth = 0;
    size_t count = 0;
    for (int inside = 1; inside && count < BRUTE_SAMPLES; count++)
        for (int a = 0; a < 3; a++) {
            at[count][a] = place[a] + (float)(0.5 * ((double)count + 0.5) * dir[a]);
            inside &= at[count][a] >= 0 && at[count][a] <= (float)(v->size[a] - 1);
        }
    need(isogi_vol_sample(s->pyramid, (const float(*)[3])at, --count, value, NULL), "sample"); /* the last is outside */
    for (size_t i = 0; i < count && depth < 12; i++) {
        float rgb[3], extinction;
        isogi_transfer_at(&s->transfer, (double)value[i], rgb, &extinction), depth += 0.5 * (double)extinction;
    }
    return exp(-depth);
}

/* Turns an environment so that most of its light comes from behind what is seen, where matter hides it from the places: the rotation from
   its degree 1 to the direction of the view. */
static void turn_behind(const study *s, isogi_env *env) {
    const isogi_lighting lighting = {.env = *env};
    float sh[12];
    double from[3], to[3], axis[3], cosine;
    need(isogi_sh_project(sh, 2, &lighting, NULL), "project");
    for (int a = 0; a < 3; a++)
        from[a] = (double)sh[a ? 3 * a : 9] + (double)sh[a ? 3 * a + 1 : 10] + (double)sh[a ? 3 * a + 2 : 11], /* y, z, x */
            to[a] = (double)(s->view.target[a] - s->view.eye[a]);
    vector_normalize(from), vector_normalize(to), cosine = vector_dot(from, to);
    for (int a = 0; a < 3; a++) axis[a] = from[(a + 1) % 3] * to[(a + 2) % 3] - from[(a + 2) % 3] * to[(a + 1) % 3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            const double cross = a == b ? 0 : (b - a + 3) % 3 == 1 ? -axis[3 - a - b] : axis[3 - a - b];
            env->rotation[3 * a + b] = (float)((a == b ? cosine : 0) + cross + axis[a] * axis[b] / (1 + cosine));
        }
}

static void study_light(study *s) {
    static const char *const skies[4] = {"grace", "grace-behind", "uffizi", "uffizi-behind"};
    static float places[PLACES][3], clear[PLACES][DIRECTIONS], y[DIRECTIONS][16], light[DIRECTIONS][3];
    static double direction[DIRECTIONS][3];
    const size_t count = places_of(s, places);
    for (size_t k = 0; k < DIRECTIONS; k++) { /* a spherical Fibonacci lattice */
        const double z = 1 - (2 * (double)k + 1) / DIRECTIONS, turn = pi * (3 - sqrt(5)) * (double)k;
        direction[k][0] = sqrt(1 - z * z) * cos(turn), direction[k][1] = sqrt(1 - z * z) * sin(turn), direction[k][2] = z;
        const float w[1][3] = {{(float)direction[k][0], (float)direction[k][1], (float)z}};
        need(isogi_sh_eval(y[k], 4, w, 1), "eval");
        for (size_t i = 0; i < count; i++) clear[i][k] = (float)clear_along(s, places[i], direction[k]);
    }
    for (int sky = 0; sky < 4; sky++) {
        char path[1024], error[512], kind[32];
        hdr_image image = {0};
        study own = *s;
        snprintf(path, sizeof path, "%s/hdr/%s_256x128.hdr", getenv("ISOGI_DATA"), sky > 1 ? "uffizi" : "grace");
        snprintf(kind, sizeof kind, "-%s", skies[sky]);
        if (!hdr_read(path, &image, error)) continue;
        own.lighting = (isogi_lighting){.env = {.rgb = image.rgb, .width = image.width, .height = image.height}};
        if (sky % 2) turn_behind(s, &own.lighting.env);
        expose(&own), memset(light, 0, sizeof light);
        for (int i = 0; i < image.width * image.height; i++) { /* every pixel's light comes from the nearest direction */
            const double r = pi * (i / image.width + 0.5) / image.height, turn = 2 * pi * ((i % image.width + 0.5) / image.width - 0.5),
                         still[3] = {sin(r) * sin(turn), cos(r), -sin(r) * cos(turn)};
            const double area = 2 * pi / image.width * 2 * sin(r) * sin(0.5 * pi / image.height);
            double w[3];
            size_t nearest = 0;
            for (int a = 0; a < 3; a++) {
                const float *m = own.lighting.env.rotation + 3 * a;
                w[a] = sky % 2 ? (double)m[0] * still[0] + (double)m[1] * still[1] + (double)m[2] * still[2] : still[a];
            }
            for (size_t k = 1; k < DIRECTIONS; k++)
                if (vector_dot(direction[k], w) > vector_dot(direction[nearest], w)) nearest = k;
            for (int a = 0; a < 3; a++) light[nearest][a] += (float)(area * (double)image.rgb[3 * i + a]);
        }
        for (int order = 2; order <= 4; order++) {
            isogi_dvr_desc desc = s->base;
            isogi_dvr__lights lights;
            isogi_dvr *dvr = NULL;
            double sum[2] = {0, 0};
            char setting[32];
            desc.order = order;
            need(isogi_dvr_create(&dvr, &desc, &two), "create"), need(isogi_dvr__set_lights(&lights, dvr, &own.lighting), "lights");
            for (size_t i = 0; i < count; i++)
                for (int a = 0; a < 3; a++) {
                    double truth = 0, series = 0, v[16] = {0};
                    for (size_t k = 0; k < DIRECTIONS; k++) {
                        truth += (double)clear[i][k] * (double)light[k][a] / (4 * pi);
                        for (int c = 0; c < order * order; c++) v[c] += 4 * pi / DIRECTIONS * (double)clear[i][k] * (double)y[k][c];
                    }
                    for (int c = 0; c < order * order; c++) series += (double)lights.sh[3 * c + a] * v[c] / (4 * pi);
                    for (int least = 0; least < 2; least++)
                        sum[least] += pow(coded(own.exposure * fmax(series, least ? (double)lights.least[a] * v[0] : 0)) -
                                              coded(own.exposure * truth), 2);
                }
            snprintf(setting, sizeof setting, "%d coefficients", order * order);
            for (int least = 0; least < 2; least++)
                row("light", s->name, kind, least ? "default" : "cut", setting, 0, sqrt(sum[least] / (3.0 * (double)count)), 1, "place");
            isogi_release(&two, lights.list, lights.count, sizeof *lights.list), isogi_dvr_free(dvr);
        }
        free(image.rgb);
    }
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
    isogi_vol_free(s.pyramid), procedural_free(&volume), free(s.truth);
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
    if (!only_study || !strcmp(only_study, "tables")) tables(&s[which]);
    if (!which) studies(s);
    if (which < 2 && (!only_study || !strcmp(only_study, "light"))) study_light(&s[which]);
    isogi_vol_free(s[which].pyramid), free(image.rgb), free(data), free(s[which].truth);
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
