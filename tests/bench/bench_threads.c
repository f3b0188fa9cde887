/* What more threads bring: calls that divide their work, on 1, 2, 4 ... threads up to the number of cores.

       build/bench/bench_threads [--quick] OUT.csv

   Wall seconds, the best of three runs, all numbers of threads in turn; "visibility" with a renderer and its transfer function, which
   "transfer-function" is alone. Error: 0 where the result is the bits of one thread, else 1.
   Work, in items of the call; the table at the end says how many times as fast as one thread. The gyroid at 256^3 floats and the
   scene engine-block with 128 voxels along its longest side; --quick: both with 64. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "isogi_trace.h"
#include "daylight.h"
#include "procedural.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { TURNS = 3, MOST_COUNTS = 16, GATHERED = 8192, PICTURE = 512 };

static int quick;
static FILE *csv;

static isogi_volume gyroid, block;
static isogi_pyramid *gyroid_pyramid, *block_pyramid;
static double block_isovalue;
static isogi_mesh mesh; /* of the block: points of its surface */
static isogi_lighting day;

static double wall_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void must(isogi_result result, const char *what) {
    if (result == ISOGI_OK) return;
    fprintf(stderr, "bench_threads: %s: %s\n", what, isogi_result_string(result));
    exit(1);
}

/* FNV-1a of what a call brought, after what it brought before. */
static uint64_t hash_of(uint64_t hash, const void *data, size_t size) {
    const unsigned char *bytes = (const unsigned char *)data;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

static void *must_allocate(size_t size) {
    void *p = malloc(size);
    if (p) return p;
    fprintf(stderr, "bench_threads: out of memory\n");
    exit(1);
}

/* ---- the calls: each times itself, and tells a hash of its result and how many items it worked on ---- */

typedef struct outcome {
    double seconds, work;
    uint64_t hash;
} outcome;

static double voxels(const isogi_volume *v) { return (double)v->size[0] * (double)v->size[1] * (double)v->size[2]; }

static outcome pyramid(const isogi_context *context) {
    isogi_pyramid *p = NULL;
    outcome o = {-wall_seconds(), voxels(&gyroid), 0};
    must(isogi_vol_build(&p, &gyroid, context), "pyramid");
    o.seconds += wall_seconds();
    for (int n = 0; n < 3; n++) {
        const isogi_level level = isogi_vol_level(p, n);
        o.hash = hash_of(o.hash, level.range, level.size[0] * level.size[1] * level.size[2] * sizeof *level.range);
    }
    for (int i = 0; i < 4096; i++) { /* what rays read has no call */
        const isogi_ray ray = {.origin = {-3, -3, -2}, .dir = {3, 2 + (float)(i % 64) / 32, 1 + (float)(i / 64) / 32}};
        isogi_hit hit = {0};
        isogi_vol_intersect(p, &ray, 1, &hit, NULL);
        o.hash = hash_of(o.hash, &hit.t, sizeof hit.t);
    }
    isogi_vol_free(p);
    return o;
}

static outcome prefilter(const isogi_context *context) {
    const size_t count = (size_t)voxels(&gyroid);
    static float *coefficients; /* touched once, so that no run pays for fresh memory */
    outcome o = {0, (double)count, 0};
    if (!coefficients)
        coefficients = (float *)must_allocate(count * sizeof *coefficients),
        memset(coefficients, 0, count * sizeof *coefficients);
    o.seconds -= wall_seconds();
    must(isogi_vol_prefilter(&gyroid, coefficients, context), "prefilter");
    o.seconds += wall_seconds(), o.hash = hash_of(0, coefficients, count * sizeof *coefficients);
    return o;
}

static outcome mesh_normals(const isogi_context *context) {
    static isogi_mesh kept; /* as an isovalue slider does */
    const isogi_mesh_desc desc = {.isovalue = 0, .normals = 1};
    isogi_pyramid *p = NULL;
    outcome o = {0, voxels(&gyroid), 0};
    must(isogi_vol_build(&p, &gyroid, context), "pyramid");
    o.seconds -= wall_seconds();
    must(isogi_vol_mesh(p, &desc, &kept), "mesh");
    o.seconds += wall_seconds();
    o.hash = hash_of(0, kept.positions, kept.vertex_count * sizeof *kept.positions);
    o.hash = hash_of(o.hash, kept.normals, kept.vertex_count * sizeof *kept.normals);
    o.hash = hash_of(o.hash, kept.triangles, kept.triangle_count * sizeof *kept.triangles);
    isogi_vol_free(p);
    return o;
}

static isogi_trace_desc bake_desc(isogi_trace_mode mode, int samples) {
    return (isogi_trace_desc){.pyramid = block_pyramid,
                              .mode = mode,
                              .lighting = day,
                              .albedo = {0.7f, 0.7f, 0.7f},
                              .bounces = -1,
                              .samples = samples,
                              .isovalue_min = block_isovalue,
                              .isovalue_max = block_isovalue,
                              .method = ISOGI_TRACE_FEEDBACK};
}

/* The texture that the desc describes, of all points of the block's surface where it is lazy. */
static outcome baked(isogi_trace_desc desc, const isogi_context *context) {
    isogi_trace *trace = NULL;
    isogi_counters counters = {0};
    outcome o = {-wall_seconds(), 0, 0};
    float(*light)[3] = (float(*)[3])must_allocate(mesh.vertex_count * sizeof *light);
    must(isogi_trace_create(&trace, &desc, context), "create");
    if (desc.lazy) must(isogi_trace_request(trace, (const float(*)[3])mesh.positions, mesh.vertex_count), "request");
    must(isogi_trace_step(trace, 0, NULL), "step");
    o.seconds += wall_seconds();
    if (desc.mode == ISOGI_TRACE_TRANSFER) must(isogi_trace_relight(trace, &day), "relight");
    isogi_trace_sample(trace, (const float(*)[3])mesh.positions, mesh.vertex_count, light, NULL);
    o.hash = hash_of(0, light, mesh.vertex_count * sizeof *light);
    isogi_trace_counters(trace, &counters), o.work = (double)counters.texels;
    isogi_trace_free(trace), free(light);
    return o;
}

static outcome bake_quick(const isogi_context *context) { return baked(bake_desc(ISOGI_TRACE_IRRADIANCE, 1), context); }
static outcome bake(const isogi_context *context) { return baked(bake_desc(ISOGI_TRACE_IRRADIANCE, 8), context); }
static outcome bake_transfer(const isogi_context *context) { return baked(bake_desc(ISOGI_TRACE_TRANSFER, 4), context); }

static outcome bake_lazy(const isogi_context *context) {
    isogi_trace_desc desc = bake_desc(ISOGI_TRACE_IRRADIANCE, 4);
    desc.lazy = 1;
    return baked(desc, context);
}

static outcome bake_paths(const isogi_context *context) {
    isogi_trace_desc desc = bake_desc(ISOGI_TRACE_IRRADIANCE, 2);
    desc.method = ISOGI_TRACE_PATHS;
    return baked(desc, context);
}

static outcome gather(const isogi_context *context) {
    const size_t count = mesh.vertex_count < GATHERED ? mesh.vertex_count : GATHERED;
    const isogi_trace_desc desc = bake_desc(ISOGI_TRACE_IRRADIANCE, 16);
    float(*light)[3] = (float(*)[3])must_allocate(count * sizeof *light);
    outcome o = {-wall_seconds(), (double)count, 0};
    must(isogi_trace_gather(&desc, (const float(*)[3])mesh.positions, (const float(*)[3])mesh.normals, count, light, NULL,
                            context),
         "gather");
    o.seconds += wall_seconds(), o.hash = hash_of(0, light, count * sizeof *light);
    free(light);
    return o;
}

/* Sheets of the gyroid in fog. */
enum { VISIBILITY, TRANSFER, FRAME };
static outcome rendered(isogi_dvr_space space, isogi_dvr_shading shading, int part, const isogi_context *context) {
    static const isogi_transfer_point points[4] = {{-1.5, {0.2f, 0.3f, 0.9f}, 0.05f},
                                                   {-0.1, {0.9f, 0.8f, 0.6f}, 0.05f},
                                                   {0, {0.9f, 0.8f, 0.6f}, 30},
                                                   {1.5, {0.9f, 0.2f, 0.2f}, 0.02f}};
    const isogi_transfer transfer = {.points = points, .point_count = 4};
    const isogi_dvr_desc desc = {.pyramid = gyroid_pyramid, .space = space, .shading = shading, .unit = 1};
    const isogi_view view = {.width = PICTURE, .height = PICTURE, .eye = {4.5f, 3.6f, 6}};
    static float image[PICTURE * PICTURE][4];
    isogi_dvr *dvr = NULL;
    outcome o = {-wall_seconds(), 0, 0};
    isogi_counters counters = {0};
    must(isogi_dvr_create(&dvr, &desc, context), "create");
    if (part == TRANSFER) o.seconds = -wall_seconds();
    must(isogi_dvr_set_transfer(dvr, &transfer), "transfer function");
    if (part == TRANSFER) o.seconds += wall_seconds();
    must(isogi_dvr_step(dvr, 0, NULL), "visibility");
    if (part == VISIBILITY) o.seconds += wall_seconds();
    if (part == FRAME) o.seconds = -wall_seconds();
    must(isogi_dvr_render(dvr, &view, &day, image, NULL, &counters), "frame");
    if (part == FRAME) o.seconds += wall_seconds();
    o.work = part == FRAME ? (double)PICTURE * PICTURE : part == TRANSFER ? voxels(&gyroid) : 64 * pow(ceil((double)gyroid.size[0] / 4), 3);
    o.hash = hash_of(0, image, sizeof image);
    isogi_dvr_free(dvr);
    return o;
}

static outcome visibility(const isogi_context *context) {
    return rendered(ISOGI_DVR_PHYSICAL, ISOGI_DVR_VISIBILITY, VISIBILITY, context);
}
static outcome transfer_function(const isogi_context *context) { return rendered(ISOGI_DVR_PHYSICAL, ISOGI_DVR_UNLIT, TRANSFER, context); }
static outcome frame_lit(const isogi_context *context) {
    return rendered(ISOGI_DVR_PHYSICAL, ISOGI_DVR_VISIBILITY, FRAME, context);
}
static outcome frame_unlit(const isogi_context *context) { return rendered(ISOGI_DVR_PHYSICAL, ISOGI_DVR_UNLIT, FRAME, context); }
static outcome frame_data(const isogi_context *context) { return rendered(ISOGI_DVR_DATA, ISOGI_DVR_UNLIT, FRAME, context); }

static const struct call {
    const char *header, *name, *unit;
    outcome (*run)(const isogi_context *);
} calls[] = {{"isogi_vol.h", "pyramid", "voxels", pyramid},
             {"isogi_vol.h", "prefilter", "voxels", prefilter},
             {"isogi_vol.h", "mesh-normals", "voxels", mesh_normals},
             {"isogi_trace.h", "bake-1-sample", "texels", bake_quick},
             {"isogi_trace.h", "bake-8-samples", "texels", bake},
             {"isogi_trace.h", "bake-lazy", "texels", bake_lazy},
             {"isogi_trace.h", "bake-transfer", "texels", bake_transfer},
             {"isogi_trace.h", "bake-paths", "texels", bake_paths},
             {"isogi_trace.h", "gather", "points", gather},
             {"isogi_dvr.h", "visibility", "rays", visibility},
             {"isogi_dvr.h", "transfer-function", "voxels", transfer_function},
            {"isogi_dvr.h", "frame-lit", "pixels", frame_lit},
             {"isogi_dvr.h", "frame-unlit", "pixels", frame_unlit},
             {"isogi_dvr.h", "frame-scale-invariant", "pixels", frame_data}};

static void scenes_make(void) {
    static float sky[4][3];
    static isogi_light sun;
    const procedural_shape *shape = procedural_find("gyroid");
    isogi_mesh_desc desc = {.normals = 1};
    must(procedural_make(shape, quick ? 64 : 256, &gyroid, NULL), "gyroid");
    must(isogi_vol_build(&gyroid_pyramid, &gyroid, NULL), "gyroid");
    shape = procedural_find("engine-block"), block_isovalue = desc.isovalue = shape->isovalue;
    must(procedural_make(shape, quick ? 64 : 128, &block, NULL), "engine-block");
    must(isogi_vol_build(&block_pyramid, &block, NULL), "engine-block");
    must(isogi_vol_mesh(block_pyramid, &desc, &mesh), "engine-block");
    daylight_make(&day, sky, &sun);
}

int main(int argc, char **argv) {
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    int counts[MOST_COUNTS], count = 0;
    quick = argc > 1 && !strcmp(argv[1], "--quick");
    if (argc != 2 + quick) return fprintf(stderr, "usage: bench_threads [--quick] OUT.csv\n"), 2;
    csv = fopen(argv[1 + quick], "w");
    if (!csv) return perror(argv[1 + quick]), 1;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    for (int n = 1; n < cores && count < MOST_COUNTS - 1; n *= 2) counts[count++] = n;
    counts[count++] = cores > 1 ? (int)cores : 1;
    scenes_make();
    printf("%-24s %10s", "threads", "1");
    for (int i = 1; i < count; i++) printf(" %7d", counts[i]);
    printf("\n");
    for (size_t k = 0; k < sizeof calls / sizeof *calls; k++) {
        outcome best[MOST_COUNTS];
        for (int turn = 0; turn < TURNS; turn++)
            for (int i = 0; i < count; i++) {
                const isogi_context context = {.threads = counts[i]};
                const outcome o = calls[k].run(&context);
                if (!turn || o.seconds < best[i].seconds) best[i] = o;
            }
        printf("%-24s %8.2fms", calls[k].name, 1e3 * best[0].seconds);
        for (int i = 0; i < count; i++) {
            fprintf(csv, "%s,%s,%s,threads=%d,%.6g,%d,%.6g,%s\n", calls[k].header, calls[k].name,
                    i == count - 1 ? "default" : "fewer threads", counts[i], best[i].seconds, best[i].hash != best[0].hash,
                    best[i].work, calls[k].unit);
            if (i) printf(" %6.2fx", best[0].seconds / best[i].seconds);
            if (best[i].hash != best[0].hash) printf(" OTHER BITS");
        }
        printf("\n"), fflush(stdout);
    }
    return fclose(csv) ? 1 : 0;
}
