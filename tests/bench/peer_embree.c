/* Isosurface rays of isogi_vol.h beside the same rays through Embree 3, on the mesh of the same field: on one machine, one thread, turn
   by turn in one run. `make bench-peers` builds and runs it where <embree3/rtcore.h> is (libembree-dev). LIBS: -lembree3

       build/bench/peer_embree [ml|gyroid] [high] [REPETITIONS]

   CPU seconds, medians. A first turn asks Embree in each of its ways (one ray a call, packets of 16, streams); its fastest counts.
   Writing the rays into Embree's structures counts, as reading isogi_ray does for us. Its scene: one mesh with shared indices, no robust
   flag, Embree's usual build quality; `high` takes four times as long and is hardly faster on these meshes. wrong: Embree's missed and
   extra hits per million, t99: 99th percentile of the distance between its t and ours in voxels; both are errors of the mesh, and of
   rays that begin a quarter of a voxel away from it.
   goal: the design's goal / Embree's speed when the goals were set. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "vol_scenes.h"
#include <embree3/rtcore.h>

enum { MOST = 32 };

typedef enum way { ONE, PACKET, STREAM, WAYS } way;
static const char *const way_names[WAYS] = {"one a call", "packets of 16", "streams of 64"};

typedef struct peer {
    RTCDevice device;
    RTCScene scene;
    double mesh_seconds, build_seconds;
    size_t triangles;
} peer;

static peer peer_new(const scene *s, enum RTCBuildQuality quality) {
    peer p = {.device = rtcNewDevice("threads=1,set_affinity=0")};
    isogi_mesh mesh = {0};
    const isogi_mesh_desc desc = {.isovalue = s->isovalue};
    double start;
    if (!p.device) fprintf(stderr, "Embree makes no device\n"), exit(1);
    for (int run = 0; run < 2; run++) { /* the second one finds its memory */
        start = cpu_seconds();
        if (isogi_vol_mesh(s->pyramid, &desc, &mesh) != ISOGI_OK) exit(1);
        p.mesh_seconds = cpu_seconds() - start;
    }
    p.triangles = mesh.triangle_count;
    RTCGeometry g = rtcNewGeometry(p.device, RTC_GEOMETRY_TYPE_TRIANGLE);
    memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.vertex_count), mesh.positions,
           12 * mesh.vertex_count);
    memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.triangle_count), mesh.triangles,
           12 * mesh.triangle_count);
    start = cpu_seconds();
    rtcSetGeometryBuildQuality(g, quality);
    rtcCommitGeometry(g);
    p.scene = rtcNewScene(p.device);
    rtcSetSceneBuildQuality(p.scene, quality);
    rtcAttachGeometry(p.scene, g);
    rtcCommitScene(p.scene);
    p.build_seconds = cpu_seconds() - start;
    rtcReleaseGeometry(g);
    isogi_vol_mesh_free(s->pyramid, &mesh);
    return p;
}

static void peer_free(peer *p) {
    rtcReleaseScene(p->scene);
    rtcReleaseDevice(p->device);
}

/* ---- Embree's ways; t of rays without a hit is -1 ---- */

static void fill(struct RTCRay *to, const isogi_ray *ray) {
    to->org_x = (float)ray->origin[0], to->org_y = (float)ray->origin[1], to->org_z = (float)ray->origin[2];
    to->dir_x = ray->dir[0], to->dir_y = ray->dir[1], to->dir_z = ray->dir[2];
    to->tnear = 0, to->tfar = HUGE_VALF, to->time = 0, to->mask = ~0u, to->id = 0, to->flags = 0;
}

static void trace_one(const peer *p, struct RTCIntersectContext *context, const isogi_ray *rays, size_t count, int any, float *t) {
    for (size_t i = 0; i < count; i++) {
        struct RTCRayHit r;
        fill(&r.ray, &rays[i]);
        r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        if (any) rtcOccluded1(p->scene, context, &r.ray), t[i] = r.ray.tfar < 0 ? 0 : -1;
        else rtcIntersect1(p->scene, context, &r), t[i] = r.hit.geomID != RTC_INVALID_GEOMETRY_ID ? r.ray.tfar : -1;
    }
}

static void trace_packets(const peer *p, struct RTCIntersectContext *context, const isogi_ray *rays, size_t count, int any, float *t) {
    static const int all[16] __attribute__((aligned(64))) = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
    for (size_t i = 0; i < count; i += 16) {
        struct RTCRayHit16 r;
        for (int k = 0; k < 16; k++) {
            const isogi_ray *ray = &rays[i + (size_t)k];
            r.ray.org_x[k] = (float)ray->origin[0], r.ray.org_y[k] = (float)ray->origin[1], r.ray.org_z[k] = (float)ray->origin[2];
            r.ray.dir_x[k] = ray->dir[0], r.ray.dir_y[k] = ray->dir[1], r.ray.dir_z[k] = ray->dir[2];
            r.ray.tnear[k] = 0, r.ray.tfar[k] = HUGE_VALF, r.ray.time[k] = 0, r.ray.mask[k] = ~0u, r.ray.id[k] = 0, r.ray.flags[k] = 0;
            r.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        }
        if (any) rtcOccluded16(all, p->scene, context, &r.ray);
        else rtcIntersect16(all, p->scene, context, &r);
        for (int k = 0; k < 16; k++)
            t[i + (size_t)k] = any ? (r.ray.tfar[k] < 0 ? 0 : -1) : r.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID ? r.ray.tfar[k] : -1;
    }
}

static void trace_streams(const peer *p, struct RTCIntersectContext *context, const isogi_ray *rays, size_t count, int any, float *t) {
    for (size_t i = 0; i < count; i += BUNDLE) {
        struct RTCRayHit r[BUNDLE];
        for (size_t k = 0; k < BUNDLE; k++)
            fill(&r[k].ray, &rays[i + k]), r[k].ray.id = (unsigned)k, r[k].hit.geomID = RTC_INVALID_GEOMETRY_ID;
        if (any) rtcOccluded1M(p->scene, context, &r[0].ray, BUNDLE, sizeof r[0]);
        else rtcIntersect1M(p->scene, context, r, BUNDLE, sizeof r[0]);
        for (size_t k = 0; k < BUNDLE; k++) {
            const size_t at = r[k].ray.id; /* a stream may be sorted */
            t[i + at] = any ? (r[k].ray.tfar < 0 ? 0 : -1) : r[k].hit.geomID != RTC_INVALID_GEOMETRY_ID ? r[k].ray.tfar : -1;
        }
    }
}

static void trace_peer(const peer *p, way how, const isogi_ray *rays, int coherent, int any, float *t) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    (how == ONE ? trace_one : how == PACKET ? trace_packets : trace_streams)(p, &context, rays, RAYS, any, t);
}

/* ---- the table ---- */

typedef struct work {
    const char *name;
    size_t batch;
    int any, bundle, coherent;
    unsigned ways;    /* of Embree that are the same task: bits */
    double ratios[2]; /* goal / Embree when the goals were set, for both fields */
} work;

static void compare(const scene *s, const peer *p, const work *w, const isogi_ray *rays, double ratio, int runs) {
    isogi_hit *hits = (isogi_hit *)calloc(RAYS, sizeof *hits);
    uint8_t *occluded = (uint8_t *)calloc(RAYS, 1);
    float *t = (float *)malloc(RAYS * sizeof *t);
    double *error = (double *)malloc(RAYS * sizeof *error), ours[MOST], theirs[MOST], best = 1e300;
    size_t wrong = 0, compared = 0;
    int fastest = 0;
    for (int run = -1; run < runs; run++) { /* the first turn warms up and chooses Embree's way */
        double start = cpu_seconds();
        trace_all(s, rays, w->batch, w->bundle, hits, w->any ? occluded : NULL, NULL);
        if (run >= 0) ours[run] = cpu_seconds() - start;
        for (int i = 0; i < WAYS; i++) {
            if (run < 0 ? !(w->ways >> i & 1) : i != fastest) continue;
            start = cpu_seconds();
            trace_peer(p, (way)i, rays, w->coherent, w->any, t);
            const double seconds = cpu_seconds() - start;
            if (run >= 0) theirs[run] = seconds;
            else if (seconds < best) best = seconds, fastest = i;
        }
    }
    const double our = median(ours, runs), their = median(theirs, runs);
    for (size_t i = 0; i < RAYS; i++) {
        const int hit = w->any ? occluded[i] : hits[i].side != 0;
        wrong += hit != (t[i] >= 0);
        if (!w->any && hit && t[i] >= 0) error[compared++] = fabs(hits[i].t - (double)t[i]) * (s->n - 1) / 2;
    }
    qsort(error, compared, sizeof *error, compare_doubles);
    printf("%-10s %-10s %7.2f %7.2f %6.2f %6.2f   %-14s %6.0f", w->name, s->name, RAYS / our / 1e6, RAYS / their / 1e6, their / our, ratio,
           way_names[fastest], 1e6 * (double)wrong / RAYS);
    if (compared) printf(" %7.2g", error[compared * 99 / 100]);
    printf("\n");
    fflush(stdout);
    free(hits), free(occluded), free(t), free(error);
}

int main(int argc, char **argv) {
    static const work works[] = {
        {"primary1", 1, 0, 0, 1, 1u << ONE, {7 / 6.9, 7 / 5.5}},
        {"primary16", 16, 0, 0, 1, 1u << PACKET, {18 / 18.0, 18 / 16.5}},
        {"surface", RAYS, 0, 0, 0, 7, {4 / 1.6, 4 / 1.9}},
        {"anyhit", RAYS, 1, 0, 0, 7, {5 / 1.7, 5 / 2.2}},
        {"bundle64", BUNDLES * BUNDLE, 0, 1, 0, 7, {8 / 1.4, 8 / 1.6}}};
    static const char *const fields[2] = {"ml", "gyroid"};
    enum RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    int only = -1, runs = 5;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], fields[0]) || !strcmp(argv[i], fields[1])) only = !strcmp(argv[i], fields[1]);
        else if (!strcmp(argv[i], "high")) quality = RTC_BUILD_QUALITY_HIGH;
        else if (atoi(argv[i]) > 0 && atoi(argv[i]) <= MOST) runs = atoi(argv[i]);
        else return fprintf(stderr, "usage: peer_embree [ml|gyroid] [high] [REPETITIONS]\n"), 2;
    }
    printf("%-10s %-10s %7s %7s %6s %6s   %-14s %6s %7s\n", "Mray/s", "", "ours", "Embree", "ratio", "goal", "Embree by", "wrong", "t99");
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        if (only >= 0 && gyroid != only) continue;
        scene s = scene_new(gyroid, N, 1);
        peer p = peer_new(&s, quality);
        for (size_t i = 0; i < sizeof works / sizeof *works; i++)
            compare(&s, &p, &works[i], i < 2 ? s.primary : i < 4 ? s.surface : s.bundles, works[i].ratios[gyroid], runs);
        printf("%-10s %-10s our pyramid serves every isovalue; Embree: %zu triangles in %.0f ms, hierarchy in %.0f ms\n", "isovalue",
               s.name, p.triangles, 1e3 * p.mesh_seconds, 1e3 * p.build_seconds);
        peer_free(&p);
        scene_free(&s);
    }
    return 0;
}
