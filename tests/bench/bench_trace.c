/* Run time against error of isogi_trace.h on the lit scenes of the design.

       build/bench/bench_trace [--quick | --tables | --dry] [--only SCENE] OUT.csv

   Scenes: engine-block, engine, bonsai and cthead; of the quick bench and of --tables the first two, unless --only names another. --tables:
   the rows table1-, table2-, lattice- and figure5- alone. `--tables --only cavity`, `--tables --only figure5`: lattice-cavity, figure5-
   alone. --dry: all rows in seconds, to look at the table's form: every scene is the engine block on 24 voxels, lit by daylight; all
   but the first have the rows of --quick, and of naive an error as if a sun stood in an image. No figure means anything.

   Error: relative RMSE, sqrt(sum (E - R)^2 / sum R^2), of irradiance over pixels of the standard view (every k-th of 900x900), against
   paths of 8192 samples through the same texels (kept in build/bench/, by everything that defines them but the library's own code).
   Where the standard error of that reference is more than a tenth of the error of a row, its setting says so; `usable` and `converged`
   must be larger than ten of it. Of the curves and of what follows from them (rows without a name, filter-, speedup-) errors up to 16
   samples are root mean squares over three seeds. Naive is the paper's way: uniform hemisphere, independent numbers, whole paths with
   shadow rays, every texel of the view; `converged` is its error with 100 samples (root mean square of three runs: few paths find a
   sun), `usable` with 10, sqrt(10) times as large. Under a sky with a sun it is above that of a black picture, where no figure would
   mean anything: `usable` is at most 0.5, and naive's time then scaled to that error. Its time is that of its texels behind the measured
   pixels, scaled to all of the view. Wall seconds, two threads, but for the rows rays-SCENE.

     speedup-SCENE          work: time of naive over time of the default at the error converged; method equal-error: at the errors e of
                            all points of the curve up to 16 samples that are usable, for which naive's time is scaled by
                            (converged / e)^2 (each the best of three, in turn with naive)
     filter-SCENE           the filter over texels at equal error: seconds of the default with the samples of speedup-, and (method
                            filter-off) of as many samples more as reach its error without; work: seconds over the default's, times the
                            square of the errors' ratio where the most samples tried (32 times) do not suffice
     rays-SCENE             one thread; work: rays while baking (over the seconds: rays a second)
     lazy-SCENE             seconds to usable, and light at every pixel, from a volume that was just read: the pyramid, request, and
                            steps, on two threads; lazy-converged-SCENE: to converged. The pyramid's share, and a bound that was not
                            reached, in the setting
     threads-SCENE          work: seconds on one thread over seconds on two (of two runs each, in turn, the better); seconds: on two
     full-SCENE             the whole texture to converged, with the fewest samples that reach it (full bench only)
     table1-SCENE           Wyman 2006, table 1: irradiance, transfer, and the path-traced picture (paths for every pixel that shows the
                            surface), with 100, 625, 2500 and 10,000 samples, whole paths. Lazily: the texels of the view; fully: all
                            texels. Measured on those of the chosen pixels (with 2500 samples of a fourth of these, with 10,000 of a
                            sixteenth), and seconds scaled to all. Work: samples. Errors of transfer, those of relighting by order 5,
                            hold what the order loses; of the picture, what two seeds differ by, over the root of 2
     table2-SCENE           Wyman 2006, table 2: seconds and frames/s of displaying the standard view, 512 x 512, two threads; extra memory
                            in the setting. Lambert, shadowed Lambert, Phong with shadows, irradiance texture, transfer of order 5
     lattice-SCENE          all texels that the isovalue reads, 8 samples: the regular lattice, the hierarchical one by its tolerance, and a
                            regular one of every second texel; work: megabytes; texels and rays in the setting. Of cavity (albedo 0.5),
                            where light varies slowly, too: all isovalues within 4 voxels
     figure5-...            Wyman 2006, figure 5, as numbers: gradient normals, smoothed normals, and smoothed normals with offset (the
                            default), on shapes whose light is known in closed form, given as distances with noise of +-0.2 voxel: ball,
                            direct light of a sun; hollow, four bounces of the light of a lamp within a hollow sphere. Light is gathered at
                            the points themselves, or read from a texture whose texels are 5/4 of a voxel apart, so that both line up every
                            five voxels. The error is split over patches 3 voxels wide: macroscopic, the RMS of patches' mean errors
                            (bands, and bias); microscopic, that of what is left (noise); both over the RMS of the light. work: this error
                            over the default's */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "camera.h"
#include "daylight.h"
#include "goals.h"
#include "hdr.h"
#include "procedural.h"
#include "volume_file.h"
#include <stdio.h>
#include <time.h>

enum { SIZE = 900, MOST = 6000 };
static const double USABLE = 0.5; /* the largest error that is called so */
static int dry, view_side = SIZE, reference_samples = 8192;

typedef struct bench_scene {
    const char *name, *file, *image_file;
    isogi_volume volume;
    isogi_pyramid *pyramid;
    isogi_trace_desc desc;
    hdr_image image;
    float sky[4][3];
    isogi_light sun;
    double isovalue, up[3], toward[3], pyramid_seconds;
} bench_scene;

static float points[SIZE * SIZE][3], chosen[MOST][3], reference[MOST][3], light[MOST][3];
static float reference_errors[MOST]; /* standard errors of luminance, */
static double reference_error;       /* and as error_of has it: their RMS over that of luminance */
static size_t seen, picked;
static const float white_sky[3] = {3.5449077f, 3.5449077f, 3.5449077f}; /* radiance 1 */
static const isogi_context two = {.threads = 2}, one = {.threads = 1};

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- scenes --------------------------------------------------------------------------------------------------------------- */

static int scene_load(bench_scene *s, const char *name) {
    const char *data = getenv("ISOGI_DATA"), *hdr = "grace";
    char path[1024], error[FILE_ERROR_SIZE];
    isogi_trace_desc *d = &s->desc;
    memset(s, 0, sizeof *s);
    s->name = name, s->up[1] = 1, s->toward[0] = 1.5, s->toward[1] = 1.2, s->toward[2] = 2;
    d->lazy = 1, d->bounces = -1, d->albedo[0] = d->albedo[1] = d->albedo[2] = 0.7f;
    if (dry || !strcmp(name, "engine-block") || !strcmp(name, "cavity")) {
        const procedural_shape *shape = procedural_find(strcmp(name, "cavity") ? "engine-block" : name);
        if (procedural_make(shape, dry ? 24 : 0, &s->volume, NULL) != ISOGI_OK) return 0;
        s->isovalue = shape->isovalue;
        daylight_make(&d->lighting, s->sky, &s->sun);
        if (!strcmp(name, "cavity"))
            d->lighting.env.sh = white_sky, d->lighting.env.sh_order = 1, d->lighting.light_count = 0,
            d->albedo[0] = d->albedo[1] = d->albedo[2] = 0.5f;
    } else {
        if (!data) return fprintf(stderr, "  %s is left out: ISOGI_DATA is not set\n", name), 0;
        if (!strcmp(name, "bonsai")) {
            d->albedo[0] = 0.6f, d->albedo[2] = 0.5f, hdr = "uffizi", s->isovalue = 40;
            s->up[1] = 0, s->up[2] = -1, s->toward[1] = 2, s->toward[2] = -1.2;
        } else if (!strcmp(name, "cthead")) d->albedo[0] = d->albedo[1] = d->albedo[2] = 0.8f, s->isovalue = 130;
        else s->isovalue = 80;
        snprintf(path, sizeof path, "%s/%s", data,
                 !strcmp(name, "bonsai")   ? "bonsai_256x256x256_uint8.raw"
                 : !strcmp(name, "cthead") ? "cthead8_256x256x99_uint8.raw"
                                           : "engine_256x256x128_uint8.raw");
        if (!volume_read(path, &s->volume, error)) return fprintf(stderr, "  %s is left out: %s\n", name, error), 0;
        if (!strcmp(name, "cthead")) s->volume.spacing[0] = s->volume.spacing[1] = 1, s->volume.spacing[2] = 2;
        snprintf(path, sizeof path, "%s/hdr/%s_256x128.hdr", data, hdr);
        if (!hdr_read(path, &s->image, error)) return fprintf(stderr, "  %s is left out: %s\n", name, error), 0;
        d->lighting.env.rgb = s->image.rgb, d->lighting.env.width = s->image.width, d->lighting.env.height = s->image.height;
    }
    s->pyramid_seconds = seconds_now();
    if (isogi_vol_build(&s->pyramid, &s->volume, &two) != ISOGI_OK) return 0;
    s->pyramid_seconds = seconds_now() - s->pyramid_seconds;
    d->pyramid = s->pyramid;
    return 1;
}

static void scene_unload(bench_scene *s) {
    isogi_vol_free(s->pyramid);
    if (s->image.rgb) volume_free(&s->volume), free(s->image.rgb);
    else procedural_free(&s->volume);
}

/* Points of the isosurface that the standard view sees, and every so many of them to measure at. */
static void view(const bench_scene *s, size_t pixels) {
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    static isogi_ray ray[SIZE];
    static isogi_hit hit[SIZE];
    const int n = view_side;
    double centre[3], eye[3], t[3], radius;
    camera c;
    for (int a = 0; a < 3; a++) centre[a] = 0.5 * v->spacing[a] * (double)(v->size[a] - 1), t[a] = s->toward[a];
    radius = sqrt(vector_dot(centre, centre)), vector_normalize(t), seen = picked = 0;
    for (int a = 0; a < 3; a++) eye[a] = centre[a] + t[a] * radius / sin(PROCEDURAL_PI / 8);
    camera_look(&c, n, n, eye, centre, s->up, 45);
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            double d[3];
            memset(&ray[x], 0, sizeof ray[x]);
            camera_direction(&c, x, y, d);
            for (int a = 0; a < 3; a++) ray[x].origin[a] = eye[a], ray[x].dir[a] = (float)d[a];
            ray[x].isovalue = s->isovalue;
        }
        isogi_vol_intersect(s->pyramid, ray, (size_t)n, hit, NULL);
        for (int x = 0; x < n; x++)
            if (hit[x].side) isogi_vol_positions(s->pyramid, &hit[x], 1, (float(*)[3])points[seen++]);
    }
    for (size_t i = 0; i < pixels && pixels < seen; i++)
        memcpy(chosen[picked++], points[i * (seen / pixels) + isogi_trace__mix(i + 1) % (seen / pixels)], sizeof chosen[0]);
}

static double error_of(float (*e)[3]) {
    double sum = 0, all = 0;
    for (size_t i = 0; i < picked; i++)
        for (int c = 0; c < 3; c++) {
            double d = (double)(e[i][c] - reference[i][c]);
            sum += d * d, all += (double)reference[i][c] * (double)reference[i][c];
        }
    return sqrt(sum / all);
}

/* ---- the reference, kept ---------------------------------------------------------------------------------------------------- */

/* Reads what was kept, or writes what is to be kept. */
static int reference_keep(const char *path, const char *mode) {
    FILE *file = fopen(path, mode);
    size_t values = 0, errors = 0;
    if (!file) return 0;
    if (mode[0] == 'r')
        values = fread(reference, sizeof reference[0], picked, file), errors = fread(reference_errors, sizeof(float), picked, file);
    else values = fwrite(reference, sizeof reference[0], picked, file), errors = fwrite(reference_errors, sizeof(float), picked, file);
    return !fclose(file) && values == picked && errors == picked;
}

static int reference_make(const bench_scene *s) {
    isogi_trace_desc d = s->desc;
    isogi_trace *t = NULL;
    char path[256];
    double remaining = 1, begin = seconds_now(), square = 0, all = 0;
    uint64_t key;
    d.samples = reference_samples, d.seed = 77, d.method = ISOGI_TRACE_PATHS;
    if (isogi_trace_create(&t, &d, &two) != ISOGI_OK) return 0;
    key = isogi_trace__hash_trace(t); /* the description with its lighting, and the volume */
    for (size_t i = 0; i < picked; i++)
        for (int c = 0; c < 3; c++) key = isogi_trace__key(key, (uint64_t)isogi_trace__float_bits(chosen[i][c]));
    snprintf(path, sizeof path, "build/bench/reference-%s-%d-%016llx", s->name, reference_samples, (unsigned long long)key);
    if (!reference_keep(path, "rb")) {
        if (isogi_trace_request(t, (const float(*)[3])chosen, picked) != ISOGI_OK) return 0;
        while (remaining > 0) {
            if (isogi_trace_step(t, 4000000, &remaining) != ISOGI_OK) return 0;
            fprintf(stderr, "\r  reference of %s: %3.0f %%, %.0f s", s->name, 100 * (1 - remaining), seconds_now() - begin);
        }
        fprintf(stderr, "\n");
        isogi_trace_sample(t, (const float(*)[3])chosen, picked, reference, reference_errors);
        if (!reference_keep(path, "wb")) remove(path);
    }
    isogi_trace_free(t);
    for (size_t i = 0; i < picked; i++) {
        double rgb[3] = {(double)reference[i][0], (double)reference[i][1], (double)reference[i][2]},
               luminance = isogi_trace__luminance(rgb);
        square += (double)reference_errors[i] * (double)reference_errors[i], all += luminance * luminance;
    }
    reference_error = sqrt(square / all);
    fprintf(stderr, "  reference of %s: %d samples, standard error %.5f of the light\n", s->name, reference_samples, reference_error);
    return 1;
}

/* ---- naive ------------------------------------------------------------------------------------------------------------------ */

typedef struct naive_job {
    isogi_trace *trace; /* its texels are overwritten */
    int samples;
    uint64_t run;
    size_t *brick, count;
    uint64_t *rays;
} naive_job;

typedef struct naive_path {
    const isogi_trace__scene *scene;
    const isogi_trace__site *site;
    isogi_counters counters;
    uint64_t key, number;
    isogi_hit start;
    float shading[3], geometric[3];
    double sum[3];
} naive_path;

static double naive_number(naive_path *p) { return isogi_trace__unit(isogi_trace__key(p->key, p->number++)); }

static void naive_ray(naive_path *p, int depth, const float dir[3], double tmax, isogi_hit *hit) {
    isogi_ray ray;
    if (!depth)
        isogi_trace__site_rays(p->scene, p->site, p->scene->high ? -1 : 1, (const float(*)[3])dir, &tmax, 1, &ray, hit, &p->counters);
    else
        isogi_vol_continue(p->scene->pyramid, &p->start, (const float(*)[3])dir, &tmax, p->site->isovalue, p->scene->flags, 1, hit,
                           &p->counters);
}

static double naive_cosine(const naive_path *p, int depth, const float dir[3]) {
    return depth ? isogi_trace__kernel(p->shading, p->geometric, dir) : isogi_trace__site_kernel(p->site, dir);
}

/* Shadow rays to all lights. through: of irradiance. */
static void naive_lights(naive_path *p, int depth, const double through[3]) {
    const isogi_lighting *lighting = &p->scene->desc.lighting;
    float position[1][3];
    double point[3];
    if (depth) isogi_vol_positions(p->scene->pyramid, &p->start, 1, position);
    for (int a = 0; a < 3; a++) point[a] = depth ? (double)position[0][a] : p->site->origin[a];
    for (size_t l = 0; l < lighting->light_count; l++) {
        double u = naive_number(p), v = naive_number(p), cosine;
        isogi_trace__beam beam;
        isogi_hit hit;
        if (!isogi_trace__light_beam(&lighting->lights[l], point, u, v, &beam)) continue;
        cosine = naive_cosine(p, depth, beam.dir);
        if (!(cosine > 0)) continue;
        naive_ray(p, depth, beam.dir, beam.tmax, &hit);
        for (int a = 0; a < 3 && !hit.side; a++) p->sum[a] += through[a] * beam.rgb[a] * cosine;
    }
}

/* One path; adds its irradiance to p->sum. Directions uniform on the hemisphere, mirrored as the library's are. */
static void naive_trace(naive_path *p, const float albedo[3]) {
    double through[3] = {1, 1, 1}, most = fmax((double)albedo[0], fmax((double)albedo[1], (double)albedo[2]));
    signed char from = p->site->open ? 0 : 1;
    p->start = p->site->place;
    for (int depth = 0;; depth++) {
        double u, v, cosine, density = 1;
        float dir[3], radiance[3], s[1][3], g[1][3];
        isogi_hit hit;
        isogi_trace__basis basis;
        if (depth) {
            isogi_trace__normals(p->scene->pyramid, p->scene->desc.normals, &p->start, &from, 1, s, g);
            memcpy(p->shading, s, sizeof s), memcpy(p->geometric, g, sizeof g);
        } else memcpy(p->shading, p->site->normal, sizeof p->shading), memcpy(p->geometric, p->site->geometric, sizeof p->geometric);
        naive_lights(p, depth, through);
        u = naive_number(p), v = naive_number(p);
        isogi_trace__basis_of(p->shading, &basis);
        isogi_trace__around(&basis, u, sqrt(1 - u * u), v, dir);
        if (depth || p->site->on_surface) {
            double mirrored;
            isogi_trace__mirror(p->geometric, dir);
            mirrored =
                isogi_trace__dot(p->shading, dir) - 2 * isogi_trace__dot(p->geometric, dir) * isogi_trace__dot(p->geometric, p->shading);
            density = (isogi_trace__dot(p->shading, dir) > 0) + (mirrored > 0);
        }
        cosine = naive_cosine(p, depth, dir);
        for (int a = 0; a < 3; a++) through[a] *= 2 * cosine / (density > 0 ? density : 1);
        naive_ray(p, depth, dir, 0, &hit);
        if (!hit.side) {
            isogi_env_radiance(&p->scene->desc.lighting.env, dir, radiance);
            for (int a = 0; a < 3; a++) p->sum[a] += PROCEDURAL_PI * through[a] * (double)radiance[a];
            return;
        }
        for (int a = 0; a < 3; a++) through[a] *= (double)albedo[a] / (depth >= 3 ? most : 1);
        if (depth >= 3 && naive_number(p) >= most) return;
        if (!from || from == (hit.side > 0 ? 1 : -1)) p->start = hit, from = (signed char)(hit.side > 0 ? 1 : -1);
    }
}

static void naive_task(void *arg, size_t task) {
    const naive_job *job = (const naive_job *)arg;
    isogi_trace *t = job->trace;
    for (uint32_t slot = 0; slot < sizeof t->bricks[0]->state; slot++) {
        const isogi_trace__brick *brick = t->bricks[job->brick[task]];
        isogi_trace__site site;
        naive_path p;
        float albedo[3], e[3];
        size_t x[3];
        if (brick->state[slot] != ISOGI_TRACE__DONE) continue;
        isogi_trace__texel_of(t, job->brick[task], slot, x);
        isogi_trace__texel_site(t, x, &site), isogi_trace__site_start(&t->scene, &site, t->scene.high);
        isogi_trace_albedo(&t->scene.desc, site.isovalue, albedo);
        memset(&p, 0, sizeof p);
        p.scene = &t->scene, p.site = &site, p.key = isogi_trace__key(5 + job->run, x[0] + 4096 * (x[1] + 4096 * x[2]));
        for (int k = 0; k < job->samples; k++) naive_trace(&p, albedo);
        for (int a = 0; a < 3; a++) e[a] = (float)(p.sum[a] / job->samples);
        isogi_trace__record_write(t, isogi_trace__record(t, brick, slot), e, 0);
        job->rays[task] += p.counters.rays;
    }
}

/* Seconds for the texels of the chosen pixels; *error, *texels. run: of independent numbers. */
static double naive(const bench_scene *s, int samples, uint64_t run, double *error, double *texels) {
    isogi_trace_desc d = s->desc;
    naive_job job = {.samples = samples, .run = run};
    isogi_trace_report report;
    double begin, spent;
    d.samples = 1, d.method = ISOGI_TRACE_PATHS, d.bounces = 0; /* to find the texels */
    if (isogi_trace_create(&job.trace, &d, &two) != ISOGI_OK ||
        isogi_trace_request(job.trace, (const float(*)[3])chosen, picked) != ISOGI_OK || isogi_trace_step(job.trace, 0, NULL) != ISOGI_OK)
        return 0;
    isogi_trace_status(job.trace, &report);
    job.brick = calloc(job.trace->brick_count, sizeof *job.brick), job.rays = calloc(job.trace->brick_count, sizeof *job.rays);
    for (size_t i = 0; i < job.trace->brick_count; i++)
        if (job.trace->bricks[i]) job.brick[job.count++] = i;
    begin = seconds_now();
    isogi_parallel(&two, job.count, naive_task, &job, 0, 1);
    spent = seconds_now() - begin;
    isogi_trace_sample(job.trace, (const float(*)[3])chosen, picked, light, NULL);
    *error = error_of(light), *texels = (double)report.texels;
    isogi_trace_free(job.trace), free(job.brick), free(job.rays);
    return spent;
}

/* ---- ours ------------------------------------------------------------------------------------------------------------------- */

typedef struct outcome { double seconds, error, rays, texels, bytes; } outcome;

/* The whole view, lazily; or the whole texture. */
static outcome ours(const isogi_trace_desc *desc, const isogi_context *context) {
    isogi_trace *t = NULL;
    isogi_counters counters = {0};
    outcome o = {0};
    double begin = seconds_now();
    isogi_result result = isogi_trace_create(&t, desc, context);
    if (result == ISOGI_OK) result = isogi_trace_request(t, (const float(*)[3])points, seen);
    if (result == ISOGI_OK) result = isogi_trace_step(t, 0, NULL);
    o.seconds = seconds_now() - begin;
    if (result != ISOGI_OK) exit(1);
    isogi_trace_sample(t, (const float(*)[3])chosen, picked, light, NULL);
    isogi_trace_counters(t, &counters);
    o.error = error_of(light), o.rays = (double)counters.rays, o.texels = (double)counters.texels, o.bytes = (double)isogi_trace_memory(t);
    isogi_trace_free(t);
    return o;
}

/* The same with three seeds: the best of their times, and the root mean square of their errors. Of more than 16 samples one is enough. */
static outcome ours_over_seeds(const isogi_trace_desc *desc, const isogi_context *context) {
    isogi_trace_desc d = *desc;
    outcome o = ours(&d, context), other;
    double square = o.error * o.error;
    int seeds = 1;
    for (; seeds < 3 && d.samples <= 16; seeds++)
        d.seed++, other = ours(&d, context), square += other.error * other.error, o.seconds = fmin(o.seconds, other.seconds);
    o.error = sqrt(square / seeds);
    return o;
}

/* Where a chosen pixel has no light its error tells nothing. */
static double error_where_lit(const isogi_trace *t) {
    static float known[MOST];
    isogi_trace_sample(t, (const float(*)[3])chosen, picked, light, known);
    for (size_t i = 0; i < picked; i++)
        if (!(known[i] < HUGE_VALF)) return HUGE_VAL;
    return error_of(light);
}

/* Seconds until all pixels have light and the error is below the bound, in steps, from the volume on; the error then, which is that of all
   samples where these do not reach the bound. */
static outcome lazily(const bench_scene *s, double bound) {
    isogi_trace_desc d = s->desc;
    isogi_trace *t = NULL;
    isogi_counters counters = {0};
    outcome o = {0};
    double remaining = 1;
    d.samples = 20; /* blocks of 4 and of 16 */
    double begin = seconds_now();
    if (isogi_trace_create(&t, &d, &two) != ISOGI_OK || isogi_trace_request(t, (const float(*)[3])points, seen) != ISOGI_OK) exit(1);
    o.seconds = s->pyramid_seconds + seconds_now() - begin;
    for (o.error = 1e9; remaining > 0 && o.error > bound;) {
        begin = seconds_now();
        if (isogi_trace_step(t, dry ? 500 : 100000, &remaining) != ISOGI_OK) exit(1);
        o.seconds += seconds_now() - begin; /* measuring the error is not counted */
        o.error = error_where_lit(t);
    }
    isogi_trace_counters(t, &counters);
    o.rays = (double)counters.rays;
    isogi_trace_free(t);
    return o;
}

/* Two cores. Speed-ups are at the error of naive with 100 samples. */
static const goal goals[] = {{"lazy-engine", 1, NULL, "Wyman 2006, other crop, 30 CPUs: 57"},
                             {"lazy-converged-engine", 10, NULL, "Wyman 2006, other crop, 30 CPUs: 57"},
                             {"full-engine", 60, NULL, "Wyman 2006, other crop, 30 CPUs: 1092"},
                             {"speedup-engine-block", 50, "x", NULL},
                             {"speedup-engine", 50, "x", NULL},
                             {"speedup-bonsai", 50, "x", NULL},
                             {"speedup-cthead", 50, "x", NULL},
                             {"threads-engine-block", 1.9, "x", NULL},
                             {"threads-engine", 1.9, "x", NULL},
                             {"threads-bonsai", 1.9, "x", NULL},
                             {"threads-cthead", 1.9, "x", NULL}};

static void row(FILE *csv, const char *name, const bench_scene *s, const char *method, const char *setting, double seconds, double error,
                double work, const char *unit) {
    char uncertain[48] = "", both[48];
    if (s->pyramid && error > 0 && error < 10 * reference_error && strcmp(method, "path-traced picture")) /* has no reference */
        snprintf(uncertain, sizeof uncertain, " (reference +-%.2g)", reference_error);
    fprintf(csv, "isogi_trace.h,%s%s,%s,%s%s,%.6g,%.6g,%.6g,%s\n", name, s->name, method, setting, uncertain, seconds, error, work, unit);
    fprintf(stderr, "  %s%s %s %s%s: %.3g s, error %.4f, %.4g %s\n", name, s->name, method, setting, uncertain, seconds, error, work, unit);
    if (strcmp(method, "default")) return;
    snprintf(both, sizeof both, "%s%s", name, s->name);
    goals_note(both, strcmp(unit, "x") ? seconds : work, error);
}

static void lazy_row(FILE *csv, const bench_scene *s, const char *name, const char *aim, double bound) {
    outcome o = lazily(s, bound);
    char setting[96], missed[48] = "";
    if (o.error > bound) snprintf(missed, sizeof missed, " NOT reached: bound=%.4f", bound);
    snprintf(setting, sizeof setting, "%s%s (pyramid %.2g s)", aim, missed, s->pyramid_seconds);
    row(csv, name, s, "default", setting, o.seconds, o.error, o.rays, "rays");
}

/* ---- tables 1 and 2 of Wyman 2006 --------------------------------------------------------------------------------------------------- */

/* The chosen pixels' texels alone. Error of transfer, relit by the scene's lighting. */
static outcome transferred(const bench_scene *s, const isogi_trace_desc *desc) {
    isogi_trace *t = NULL;
    isogi_counters counters = {0};
    outcome o = {0};
    double begin = seconds_now();
    if (isogi_trace_create(&t, desc, &two) != ISOGI_OK || isogi_trace_request(t, (const float(*)[3])chosen, picked) != ISOGI_OK ||
        isogi_trace_step(t, 0, NULL) != ISOGI_OK)
        exit(1);
    o.seconds = seconds_now() - begin;
    if (desc->mode == ISOGI_TRACE_TRANSFER && isogi_trace_relight(t, &s->desc.lighting) != ISOGI_OK) exit(1);
    isogi_trace_sample(t, (const float(*)[3])chosen, picked, light, NULL);
    isogi_trace_counters(t, &counters);
    o.error = error_of(light), o.rays = (double)counters.rays, o.texels = (double)counters.texels;
    isogi_trace_free(t);
    return o;
}

/* Texels that a texture has in all, or that the view reads, and the bytes that it takes once they are computed. */
static outcome whole_texture(const isogi_trace_desc *desc, int lazy) {
    isogi_trace_desc d = *desc;
    isogi_trace *t = NULL;
    outcome o = {0};
    d.lazy = lazy, d.method = ISOGI_TRACE_PATHS;
    if (isogi_trace_create(&t, &d, &two) != ISOGI_OK || isogi_trace_request(t, (const float(*)[3])points, seen) != ISOGI_OK) exit(1);
    o.texels = (double)t->wanted, o.bytes = (double)isogi_trace_memory(t) + o.texels * (double)t->record;
    isogi_trace_free(t);
    return o;
}

/* A path for each chosen pixel. Two seeds, since no texture is a picture's reference: their difference over the root of 2 is the error. */
static outcome pictured(const bench_scene *s, int samples) {
    static float e[2][MOST][3];
    isogi_trace_desc d = s->desc;
    outcome o = {0};
    double difference = 0, all = 0, begin = seconds_now();
    d.samples = samples;
    for (int k = 0; k < 2; k++, d.seed++)
        if (isogi_trace_gather(&d, (const float(*)[3])chosen, NULL, picked, e[k], NULL, &two) != ISOGI_OK) exit(1);
    o.seconds = 0.5 * (seconds_now() - begin);
    for (size_t i = 0; i < picked; i++)
        for (int c = 0; c < 3; c++)
            difference += pow((double)e[1][i][c] - (double)e[0][i][c], 2) / 2, all += (double)e[0][i][c] * (double)e[1][i][c];
    o.error = sqrt(difference / all);
    return o;
}

/* Ends with a part of the chosen pixels: the more samples, the fewer. */
static void table1(FILE *csv, const bench_scene *s) {
    static const int samples[4] = {100, 625, 2500, 10000};
    double all[2] = {whole_texture(&s->desc, 0).texels, whole_texture(&s->desc, 1).texels};
    isogi_trace_desc d = s->desc;
    char setting[96];
    outcome o;
    d.samples = 16, o = ours(&d, &two);
    row(csv, "table1-", s, "default", "lazy samples=16 by feedback", o.seconds, o.error, 16, "samples");
    for (int k = 0; k < 4; k++) {
        if (k > 1) { /* every fourth */
            for (size_t i = 0; 4 * i < picked; i++)
                memcpy(chosen[i], chosen[4 * i], sizeof chosen[i]), memcpy(reference[i], reference[4 * i], sizeof reference[i]);
            picked = (picked + 3) / 4;
        }
        d = s->desc, d.method = ISOGI_TRACE_PATHS, d.samples = samples[k], d.order = 5;
        for (int mode = 0; mode < 2; mode++) {
            d.mode = (isogi_trace_mode)mode;
            if (mode) memset(&d.lighting, 0, sizeof d.lighting);
            o = transferred(s, &d);
            for (int lazy = 0; lazy < 2; lazy++) {
                snprintf(setting, sizeof setting, "%s samples=%d (from %.0f texels)", lazy ? "lazy" : "full", samples[k], o.texels);
                row(csv, "table1-", s, mode ? "transfer" : "irradiance", setting, o.seconds / o.texels * all[lazy], o.error, samples[k],
                    "samples");
            }
        }
        o = pictured(s, samples[k]);
        snprintf(setting, sizeof setting, "samples=%d (from %zu pixels)", samples[k], picked);
        row(csv, "table1-", s, "path-traced picture", setting, o.seconds * (double)seen / (double)picked, o.error, samples[k], "samples");
    }
}

enum { FRAME = 512 };
typedef struct frame_job {
    const bench_scene *s;
    const isogi_trace *texture; /* NULL: by normals */
    int shadows, phong;
    double eye[3], centre[3];
    float *image;
} frame_job;

/* A row of the picture: rays, then light by the texture or by normal, lamp and shadow ray. */
static void frame_task(void *arg, size_t y) {
    const frame_job *job = (const frame_job *)arg;
    const bench_scene *s = job->s;
    static const double lamp[3] = {0.371, 0.743, 0.557};
    isogi_ray ray[FRAME], shadow[FRAME];
    isogi_hit hit[FRAME];
    float position[FRAME][3], normal[FRAME][3], e[FRAME][3], *image = job->image + 3 * y * FRAME;
    uint8_t blocked[FRAME];
    size_t at[FRAME], n = 0;
    camera c;
    camera_look(&c, FRAME, FRAME, job->eye, job->centre, s->up, 45);
    memset(ray, 0, sizeof ray);
    for (int x = 0; x < FRAME; x++) {
        double d[3];
        camera_direction(&c, x, (int)y, d);
        for (int a = 0; a < 3; a++) ray[x].origin[a] = job->eye[a], ray[x].dir[a] = (float)d[a];
        ray[x].isovalue = s->isovalue;
    }
    isogi_vol_intersect(s->pyramid, ray, FRAME, hit, NULL);
    for (size_t x = 0; x < FRAME; x++)
        if (hit[x].side) hit[n] = hit[x], ray[n] = ray[x], at[n++] = x;
    isogi_vol_positions(s->pyramid, hit, n, position);
    memset(image, 0, 3 * FRAME * sizeof *image);
    if (job->texture) {
        isogi_trace_sample(job->texture, (const float(*)[3])position, n, e, NULL);
        for (size_t i = 0; i < n; i++) memcpy(image + 3 * at[i], e[i], sizeof e[i]);
        return;
    }
    isogi_vol_normals(s->pyramid, hit, n, ISOGI_NORMAL_SMOOTH, normal);
    for (size_t i = 0; i < n; i++) {
        memset(&shadow[i], 0, sizeof shadow[i]);
        for (int a = 0; a < 3; a++)
            shadow[i].origin[a] = (double)position[i][a] + 0.5 * (double)normal[i][a], shadow[i].dir[a] = (float)lamp[a];
        shadow[i].isovalue = s->isovalue, blocked[i] = 0;
    }
    if (job->shadows) isogi_vol_occluded(s->pyramid, shadow, n, blocked, NULL);
    for (size_t i = 0; i < n; i++) {
        double cosine = 0, mirrored = 0, shine = 0;
        for (int a = 0; a < 3; a++) cosine += lamp[a] * (double)normal[i][a];
        for (int a = 0; a < 3; a++) mirrored -= (double)ray[i].dir[a] * (2 * cosine * (double)normal[i][a] - lamp[a]);
        if (job->phong && mirrored > 0) shine = pow(mirrored, 40);
        for (int a = 0; a < 3; a++) image[3 * at[i] + (size_t)a] = (float)(0.5 + (blocked[i] || cosine < 0 ? 0 : 3 * cosine + shine));
    }
}

static void table2(FILE *csv, const bench_scene *s) {
    static const char *const name[5] = {"lambert", "lambert shadowed", "phong shadowed", "default", "transfer"};
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    frame_job job = {.s = s, .image = calloc(3 * FRAME * FRAME, sizeof *job.image)};
    double toward[3], radius, best;
    for (int a = 0; a < 3; a++) job.centre[a] = 0.5 * v->spacing[a] * (double)(v->size[a] - 1), toward[a] = s->toward[a];
    radius = sqrt(vector_dot(job.centre, job.centre)), vector_normalize(toward);
    for (int a = 0; a < 3; a++) job.eye[a] = job.centre[a] + toward[a] * radius / sin(PROCEDURAL_PI / 8);
    for (int k = 0; k < 5; k++) {
        isogi_trace *t = NULL;
        isogi_trace_desc d = s->desc;
        char setting[64];
        double bytes[2] = {0, 0};
        if (k > 2) {
            d.samples = 1, d.bounces = 0, d.method = ISOGI_TRACE_PATHS;
            if (k == 4) d.mode = ISOGI_TRACE_TRANSFER, memset(&d.lighting, 0, sizeof d.lighting);
            if (isogi_trace_create(&t, &d, &two) != ISOGI_OK || isogi_trace_request(t, (const float(*)[3])points, seen) != ISOGI_OK ||
                isogi_trace_step(t, 0, NULL) != ISOGI_OK)
                exit(1);
            if (k == 4 && isogi_trace_relight(t, &s->desc.lighting) != ISOGI_OK) exit(1);
            bytes[0] = (double)isogi_trace_memory(t), bytes[1] = whole_texture(&d, 0).bytes;
        }
        job.texture = t, job.shadows = k == 1 || k == 2, job.phong = k == 2, best = 1e9;
        for (int i = 0; i < 7; i++) {
            double begin = seconds_now();
            isogi_parallel(&two, FRAME, frame_task, &job, 0, 1);
            best = fmin(best, seconds_now() - begin);
        }
        snprintf(setting, sizeof setting, "memory lazy=%.1fMB full=%.1fMB", bytes[0] / 1e6, bytes[1] / 1e6);
        row(csv, "table2-", s, name[k], setting, best, 0, 1 / best, "frames/s");
        isogi_trace_free(t);
    }
    free(job.image);
}

/* ---- the hierarchical lattice against the regular one --------------------------------------------------------------------------- */

static void lattice_table(FILE *csv, const bench_scene *s) {
    static const char *const method[4] = {"default", "hierarchy", "hierarchy", "every second texel"};
    static const float tolerance[4] = {0, 0.1f, 0.4f, 0};
    const isogi_volume *v = isogi_vol_volume(s->pyramid);
    double within = strcmp(s->name, "cavity") ? 0 : 4 * 2.0 / 127; /* its values are distances in halves of its 127 voxels */
    for (int k = 0; k < 4; k++) {
        isogi_trace_desc d = s->desc;
        char setting[96];
        outcome o;
        d.lazy = 0, d.samples = 8, d.hierarchy = tolerance[k], d.isovalue_min = s->isovalue - within, d.isovalue_max = s->isovalue + within;
        for (int a = 0; a < 3; a++) d.lattice[a] = k == 3 ? (v->size[a] + 1) / 2 : 0;
        o = ours(&d, &two);
        snprintf(setting, sizeof setting, "tolerance=%.1f texels=%.0f rays=%.0f", (double)tolerance[k], o.texels, o.rays);
        row(csv, "lattice-", s, method[k], setting, o.seconds, o.error, o.bytes / 1e6, "MB");
    }
}

static void lattice_cavity(FILE *csv) {
    bench_scene s;
    if (!scene_load(&s, "cavity")) exit(1);
    view(&s, dry ? 20 : 400);
    if (!reference_make(&s)) exit(1);
    lattice_table(csv, &s), scene_unload(&s);
}

/* ---- figure 5 of Wyman 2006: normals and offset ------------------------------------------------------------------------------- */

enum { PATCHES = 40, PATCH = 64, FIGURE5 = PATCHES * PATCH, FIGURE5_SIDE = 51, FIGURE5_LATTICE = 41 };
static const double figure5_centre[3] = {25.1, 24.8, 25.3}, figure5_radius = 18;
static float figure5_voxels[FIGURE5_SIDE][FIGURE5_SIDE][FIGURE5_SIDE];

/* Isovalue 0: a ball, or all but that ball. */
static isogi_pyramid *figure5_volume(int hollow) {
    isogi_volume v = {.data = figure5_voxels, .type = ISOGI_F32, .size = {FIGURE5_SIDE, FIGURE5_SIDE, FIGURE5_SIDE}};
    isogi_pyramid *pyramid = NULL;
    for (size_t i = 0; i < sizeof figure5_voxels / sizeof(float); i++) {
        double at[3] = {(double)(i % FIGURE5_SIDE), (double)(i / FIGURE5_SIDE % FIGURE5_SIDE), (double)(i / FIGURE5_SIDE / FIGURE5_SIDE)},
               r[3], depth;
        for (int a = 0; a < 3; a++) r[a] = at[a] - figure5_centre[a];
        depth = figure5_radius - sqrt(vector_dot(r, r));
        (&figure5_voxels[0][0][0])[i] = (float)((hollow ? -depth : depth) + 0.4 * isogi_trace__unit(isogi_trace__mix(i)) - 0.2);
    }
    if (isogi_vol_build(&pyramid, &v, NULL) != ISOGI_OK) exit(1);
    return pyramid;
}

/* Patches 3 voxels wide of the sphere, none of whose middles is further than acos(least) from `toward`. */
static void figure5_points(const isogi_pyramid *pyramid, const double toward[3], double least, float (*p)[3]) {
    uint64_t number = 0;
    for (int i = 0; i < FIGURE5;) {
        double middle[3], u = isogi_trace__unit(isogi_trace__mix(++number)), v = isogi_trace__unit(isogi_trace__mix(++number));
        middle[0] = sqrt(1 - pow(2 * u - 1, 2)) * cos(2 * PROCEDURAL_PI * v), middle[1] = 2 * u - 1,
        middle[2] = sqrt(1 - pow(2 * u - 1, 2)) * sin(2 * PROCEDURAL_PI * v);
        if (vector_dot(middle, toward) < least) continue;
        for (int end = i + PATCH; i < end;) {
            isogi_ray ray = {0};
            isogi_hit hit;
            double d[3], off[3];
            for (int a = 0; a < 3; a++)
                off[a] = 2 * isogi_trace__unit(isogi_trace__mix(++number)) - 1, d[a] = middle[a] + off[a] * 1.5 / figure5_radius;
            if (vector_dot(off, off) > 1) continue;
            vector_normalize(d);
            for (int a = 0; a < 3; a++) ray.origin[a] = figure5_centre[a], ray.dir[a] = (float)d[a];
            isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
            isogi_vol_positions(pyramid, &hit, 1, (float(*)[3])p[i++]);
        }
    }
}

/* error[0]: macroscopic, error[1]: microscopic. */
static void figure5_split(float (*e)[3], const double *exact, double error[2]) {
    double light2 = 0, sum[2] = {0, 0};
    for (int k = 0; k < PATCHES; k++) {
        double mean = 0;
        for (int i = k * PATCH; i < (k + 1) * PATCH; i++) mean += ((double)e[i][0] - exact[i]) / PATCH, light2 += exact[i] * exact[i];
        for (int i = k * PATCH; i < (k + 1) * PATCH; i++) sum[0] += mean * mean, sum[1] += pow((double)e[i][0] - exact[i] - mean, 2);
    }
    for (int j = 0; j < 2; j++) error[j] = sqrt(sum[j] / light2);
}

/* Light at the points themselves, or from a texture; seconds. */
static double figure5_light(isogi_trace_desc *d, int texture, float (*p)[3], float (*e)[3]) {
    double begin = seconds_now();
    isogi_trace *t = NULL;
    isogi_result result;
    for (int a = 0; a < 3; a++) d->lattice[a] = FIGURE5_LATTICE;
    if (texture) {
        result = isogi_trace_create(&t, d, &two);
        if (result == ISOGI_OK) result = isogi_trace_request(t, (const float(*)[3])p, FIGURE5);
        if (result == ISOGI_OK) result = isogi_trace_step(t, 0, NULL);
        if (result == ISOGI_OK) result = isogi_trace_sample(t, (const float(*)[3])p, FIGURE5, e, NULL);
        isogi_trace_free(t);
    } else result = isogi_trace_gather(d, (const float(*)[3])p, NULL, FIGURE5, e, NULL, &two);
    if (result != ISOGI_OK) exit(1);
    return seconds_now() - begin;
}

/* A lamp within a hollow sphere of albedo a: each part of a sphere lights all others alike, so that the light of one bounce is the same
   everywhere, the flux over the area, and of the next a times as much. */
static void figure5(FILE *csv, int hollow) {
    static const char *const method[3] = {"default", "gradient normals", "smoothed normals"};
    static const char *const name[2][2] = {{"figure5-ball-points-", "figure5-ball-texture-"},
                                           {"figure5-hollow-points-", "figure5-hollow-texture-"}};
    static const bench_scene scale[2] = {{.name = "macroscopic"}, {.name = "microscopic"}};
    static float p[FIGURE5][3], e[FIGURE5][3];
    static double exact[FIGURE5];
    double toward[3] = {1, 2, 3}, base[2][2];
    isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 2, 3}, .rgb = {1, 1, 1}},
                lamp = {.kind = ISOGI_LIGHT_POINT, .rgb = {100, 100, 100}};
    isogi_pyramid *pyramid = figure5_volume(hollow);
    isogi_trace_desc d = {
        .pyramid = pyramid, .method = ISOGI_TRACE_PATHS, .samples = hollow ? 128 : 1, .bounces = hollow ? 4 : 0, .lazy = 1};
    vector_normalize(toward), figure5_points(pyramid, toward, hollow ? -1 : 0.05, p);
    for (int a = 0; a < 3; a++) lamp.vector[a] = (float)(figure5_centre[a] + 0.4 * figure5_radius * toward[a]);
    for (int a = 0; a < 3 && hollow; a++) d.albedo[a] = 0.8f;
    d.lighting.lights = hollow ? &lamp : &sun, d.lighting.light_count = 1;
    for (int i = 0; i < FIGURE5; i++) {
        double n[3], to[3], mean = 100 / (figure5_radius * figure5_radius), length;
        for (int a = 0; a < 3; a++) n[a] = (double)p[i][a] - figure5_centre[a];
        vector_normalize(n);
        for (int a = 0; a < 3; a++) to[a] = figure5_radius * n[a] - 0.4 * figure5_radius * toward[a];
        length = sqrt(vector_dot(to, to));
        exact[i] = hollow ? 100 * vector_dot(to, n) / (length * length * length) + mean * 0.8 * (1 - pow(0.8, 4)) / (1 - 0.8)
                          : fmax(0, vector_dot(n, toward));
    }
    for (int k = 0; k < 3; k++) {
        d.normals = k == 1 ? ISOGI_NORMAL_TRILINEAR : ISOGI_NORMAL_SMOOTH, d.offset = k ? -1 : 0;
        for (int texture = 0; texture < 2; texture++) {
            double error[2], seconds = figure5_light(&d, texture, p, e);
            figure5_split(e, exact, error);
            for (int j = 0; j < 2; j++) {
                if (!k) base[texture][j] = error[j];
                row(csv, name[hollow][texture], &scale[j], method[k], hollow ? "four bounces" : "direct", seconds, error[j],
                    error[j] / base[texture][j], "x");
            }
        }
    }
    isogi_vol_free(pyramid);
}

/* on: what the filter reached, with these samples. */
static void filter_rows(FILE *csv, const bench_scene *s, int samples, outcome on) {
    isogi_trace_desc d = s->desc;
    outcome off;
    char setting[64];
    double ratio;
    d.samples = samples, d.unfiltered = 1;
    snprintf(setting, sizeof setting, "samples=%d", samples);
    row(csv, "filter-", s, "default", setting, on.seconds, on.error, 1, "x");
    for (off = ours_over_seeds(&d, &two); off.error > on.error && d.samples < 32 * samples; off = ours_over_seeds(&d, &two))
        d.samples *= 2;
    snprintf(setting, sizeof setting, "samples=%d", d.samples);
    ratio = off.error > on.error ? pow(off.error / on.error, 2) : 1;
    row(csv, "filter-", s, "filter-off", setting, off.seconds, off.error, ratio * off.seconds / on.seconds, "x");
}

static void bench(FILE *csv, const char *name, int quick, int tables) {
    bench_scene s;
    const int sweep[2][9] = {{1, 2, 3, 4, 8, 16, 64, 128, 256}, {1, 2, 4, 8, 16}}, last = quick ? 5 : 9;
    double naives, usable, converged, texels, seconds = HUGE_VAL;
    outcome o, best, curve[9];
    int found = -1;
    char setting[96];
    isogi_trace_desc d;
    if (!scene_load(&s, name)) return;
    view(&s, dry ? 20 : quick ? 1500 : 3000);
    if (!reference_make(&s)) exit(1);
    if (tables) {
        table2(csv, &s), lattice_table(csv, &s), table1(csv, &s), scene_unload(&s);
        return;
    }
    naives = 0;
    for (uint64_t run = 0; run < 3; run++)
        seconds = fmin(seconds, naive(&s, 100, run, &converged, &texels)), naives += converged * converged / 3;
    naives = sqrt(naives);
    if (dry && strcmp(name, "engine-block")) naives = 1.4; /* as if it were lit by an image with a sun */
    usable = fmin(sqrt(10) * naives, USABLE), converged = usable / sqrt(10);
    if (!dry && reference_error > 0.1 * fmin(usable, converged)) { /* no figure would mean anything */
        fprintf(stderr, "bench_trace: %s: the reference's standard error %.5f is more than a tenth of naive's %.5f\n", name,
                reference_error, fmin(usable, converged));
        exit(1);
    }
    d = s.desc;
    for (int i = 0; i < last; i++) { /* the curve, and the first point below the error of naive */
        d.samples = sweep[quick][i], curve[i] = o = ours_over_seeds(&d, &two);
        snprintf(setting, sizeof setting, "samples=%d", d.samples);
        row(csv, "", &s, d.samples == (quick ? 8 : 64) ? "default" : "feedback", setting, o.seconds, o.error, o.rays, "rays");
        if (found < 0 && (o.error <= converged || i == last - 1)) found = i;
        if (quick || (d.samples & (d.samples - 1))) continue;
        d.method = ISOGI_TRACE_PATHS;
        o = ours(&d, &two), row(csv, "", &s, "paths", setting, o.seconds, o.error, o.rays, "rays");
        d.method = ISOGI_TRACE_FEEDBACK;
    }
    for (int i = 0; i < 2; i++) { /* the best of three, in turn with naive: other work on the machine is no part of either */
        double error, again = 10 * naive(&s, 10, 3, &error, &texels);
        seconds = again < seconds ? again : seconds;
        for (int k = 0; k < last && (k <= found || sweep[quick][k] <= 16); k++)
            d.samples = sweep[quick][k], curve[k].seconds = fmin(curve[k].seconds, ours(&d, &two).seconds);
    }
    best = curve[found], d.samples = sweep[quick][found];
    seconds *= best.texels / texels * naives * naives / (converged * converged); /* of all texels of the view, at that error */
    filter_rows(csv, &s, d.samples, best);
    snprintf(setting, sizeof setting, "samples=%d", d.samples);
    if (best.error > converged) { /* all of the sweep is worse */
        snprintf(setting, sizeof setting, "samples=%d (scaled from error %.4f)", d.samples, best.error);
        best.seconds *= best.error * best.error / (converged * converged);
    }
    row(csv, "speedup-", &s, "default", setting, best.seconds, converged, seconds / best.seconds, "x");
    for (int i = 0; i < last && sweep[quick][i] <= 16; i++) { /* naive's time, as if it had as many samples as its error asks for */
        const double e = curve[i].error, scaled = seconds * converged * converged / (e * e);
        if (e > usable) continue;
        snprintf(setting, sizeof setting, "samples=%d (naive scaled to %.0f samples)", sweep[quick][i], 100 * pow(naives / e, 2));
        row(csv, "speedup-", &s, "equal-error", setting, curve[i].seconds, e, scaled / curve[i].seconds, "x");
    }
    snprintf(setting, sizeof setting, "samples=100");
    if (naives > converged * 1.0001)
        snprintf(setting, sizeof setting, "samples=%.0f (scaled from 100 of error %.2f)", 100 * pow(naives / converged, 2), naives);
    row(csv, "speedup-", &s, "naive", setting, seconds, converged, 1, "x");
    d.samples = 8, o = ours(&d, &one);
    row(csv, "rays-", &s, "default", "samples=8", o.seconds, o.error, o.rays, "rays");
    best = ours(&d, &two), seconds = o.seconds;
    seconds = fmin(seconds, ours(&d, &one).seconds), best.seconds = fmin(best.seconds, ours(&d, &two).seconds);
    row(csv, "threads-", &s, "default", "samples=8", best.seconds, best.error, seconds / best.seconds, "x");
    lazy_row(csv, &s, "lazy-", "usable", usable), lazy_row(csv, &s, "lazy-converged-", "converged", converged);
    if (!quick) {
        d.lazy = 0;
        for (d.samples = sweep[quick][found]; (o = ours(&d, &two)).error > converged && d.samples < 256;) d.samples *= 2;
        snprintf(setting, sizeof setting, "samples=%d texels=%.0f MB=%.0f", d.samples, o.texels, o.bytes / 1e6);
        row(csv, "full-", &s, "default", setting, o.seconds, o.error, o.rays, "rays");
        table2(csv, &s), lattice_table(csv, &s), table1(csv, &s);
    }
    scene_unload(&s);
}

int main(int argc, char **argv) {
    static const char *const scenes[6] = {"engine-block", "engine", "bonsai", "cthead", "cavity", "figure5"};
    const char *only = NULL;
    int quick = 0, tables = 0, at = 1;
    FILE *csv;
    for (; at < argc - 1; at++) {
        if (!strcmp(argv[at], "--quick")) quick = 1;
        else if (!strcmp(argv[at], "--tables")) quick = tables = 1;
        else if (!strcmp(argv[at], "--dry")) dry = 1, view_side = 90, reference_samples = 256;
        else if (!strcmp(argv[at], "--only") && at + 2 < argc) only = argv[++at];
        else break;
    }
    for (int i = 0; only && strcmp(only, scenes[i]); i++)
        if (i == 5) return fprintf(stderr, "bench_trace: there is no scene %s\n", only), 2;
    csv = at == argc - 1 && argv[at][0] != '-' ? fopen(argv[at], "w") : NULL;
    if (!csv) return fprintf(stderr, "usage: bench_trace [--quick | --tables | --dry] [--only SCENE] OUT.csv\n"), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    if ((tables || !quick) && (!only || !strcmp(only, "figure5"))) figure5(csv, 0), figure5(csv, 1);
    if ((tables || !quick) && (!only || !strcmp(only, "cavity"))) lattice_cavity(csv);
    for (int i = 0; i < 4; i++)
        if (only ? !strcmp(only, scenes[i]) : !quick || i < 2) bench(csv, scenes[i], quick || (dry && i), tables);
    goals_print(goals, sizeof goals / sizeof *goals);
    return fclose(csv) != 0;
}
