/* Run time against error of isogi_vol.h: the isosurface rows of the design, on the fields ml256 and gyroid256.

       build/bench/bench_vol [--quick] OUT.csv

   One thread, CPU seconds, medians of several runs in one process. Rays: error = missed + extra hits per million, and those
   that are not the first; `default` against
   tests/reference_quick.h on all rays (--quick: every eighth), what that cannot decide and t against reference_ray.h; the other methods
   (usual_rays.h) against `default`, on one ray of METHOD_STRIDE. t99: 99th percentile of the error of t in voxels. Per ray: blocks, cells
   and cubics looked at. Other rows name their error in `setting`.
   bundle64: BUNDLES bundles a call; bundle64alone: one.
   Samples along rays: at half-voxel steps inside the volume, along the primary rays in their order, as a renderer takes them: one tile of
   4x4 rays after the other, four tiles a call, in every 16th row of tiles (--quick: every 64th); the gap between rows does the cache no
   good. Along far rays: 256 steps of rays 32 pixels apart, which share no memory.
   A table of goals and peers' figures for the same work is printed at the end. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "goals.h"
#include "reference_quick.h"
#include "usual_rays.h"
#include "vol_scenes.h"

enum { METHOD_STRIDE = 16 };

static FILE *csv;
static int runs = 5, sampled = 4000;
static size_t judged = RAYS, every = 16; /* row of tiles is sampled */

static void row(const char *name, const char *scene_name, const char *method, const char *setting, double seconds, double error,
                double work, const char *unit) {
    char both[48];
    fprintf(csv, "isogi_vol.h,%s%s%s,%s,%s,%.6g,%.6g,%.6g,%s\n", name, scene_name ? "-" : "", scene_name ? scene_name : "", method, setting,
            seconds, error, work, unit);
    fflush(csv);
    fprintf(stderr, "  %-20s %-10s %-10s %9.3f M%s  error %.3g  %s\n", name, scene_name ? scene_name : "", method, work / seconds / 1e6,
            unit, error, setting);
    if (strcmp(method, "default")) return;
    snprintf(both, sizeof both, "%s%s%s", name, scene_name ? "-" : "", scene_name ? scene_name : "");
    goals_note(both, work / seconds / 1e6, error);
}

/* ---- rays ---- */

/* Voxels: a hit farther than this from the first one is another; by the usual methods, which err more, than the second. */
#define APART 0.001
#define APART_USUAL 0.1

/* What is true of a ray: by the cheap reference, which may not know (1e-9: what double cannot tell, of values within 2 at 256^3 voxels), or
   in long double. t: between which the hit lies. */
static reference_hit truth_of(const scene *s, const isogi_ray *ray, int place, double t[2]) {
    const reference_field quick = {s->reference, {s->n, s->n, s->n}, 1e-9L}, slow = {s->reference, {s->n, s->n, s->n}, 1e-10L};
    const double h = 2.0 / (s->n - 1);
    reference_hit hit = {0, 0, 0};
    double o[3], d[3];
    for (int a = 0; a < 3; a++) o[a] = (ray->origin[a] + 1) / h, d[a] = (double)ray->dir[a] / h;
    if (!place) {
        const quick_truth truth = quick_intersect(&quick, o, d, 0, 0, s->isovalue);
        hit.side = truth.side, hit.decided = truth.decided, t[0] = truth.t[0], t[1] = truth.t[1];
    }
    if (!hit.decided) hit = reference_intersect(&slow, o, d, 0, 0, s->isovalue), t[0] = t[1] = (double)hit.t;
    return hit;
}

/* Missed and extra hits, and hits that are not the first one, per million among `judged` rays; *t99: 99th percentile of the error of t in
   voxels, of `sampled` ones. */
static double wrong_hits(const scene *s, const isogi_ray *rays, const isogi_hit *hits, const uint8_t *occluded, double *t99) {
    double *error = (double *)malloc((size_t)sampled * sizeof *error), h = 2.0 / (s->n - 1);
    int wrong = 0, decided = 0, compared = 0;
    for (size_t i = 0; i < judged; i++) {
        const size_t r = i * (RAYS / judged);
        double t[2];
        const reference_hit truth = truth_of(s, &rays[r], 0, t);
        decided += truth.decided;
        if (!truth.decided) continue;
        if (truth.side && hits && hits[r].side) wrong += hits[r].t < t[0] - APART * h || hits[r].t > t[1] + APART * h;
        else wrong += (truth.side != 0) != (hits ? hits[r].side != 0 : occluded[r] != 0);
    }
    for (int i = 0; i < sampled && hits; i++) {
        const size_t r = (size_t)i * (RAYS / (size_t)sampled);
        double t[2];
        const reference_hit truth = truth_of(s, &rays[r], 1, t);
        if (truth.decided && truth.side && hits[r].side) error[compared++] = fabs((double)truth.t - hits[r].t) / h;
    }
    qsort(error, (size_t)compared, sizeof *error, compare_doubles);
    *t99 = compared ? error[(size_t)((double)compared * 0.99)] : 0;
    free(error);
    return 1e6 * wrong / (decided ? decided : 1);
}

/* The usual methods over one ray of METHOD_STRIDE; truth: what the default found. */
static void bench_usual(const scene *s, const char *name, const isogi_ray *rays, const isogi_hit *truth) {
    static const char *const names[USUAL_METHODS] = {"float", "double", "marching", "cardano"};
    const size_t count = RAYS / METHOD_STRIDE;
    double *t = (double *)malloc(count * sizeof *t), *error = (double *)malloc(count * sizeof *error);
    for (int m = 0; m < USUAL_METHODS; m++) {
        size_t wrong = 0, compared = 0;
        double start = cpu_seconds(), seconds;
        char setting[64];
        for (size_t i = 0; i < count; i++)
            if (!usual_trace(s->pyramid, (usual_method)m, &rays[i * METHOD_STRIDE], &t[i])) t[i] = -1;
        seconds = cpu_seconds() - start;
        for (size_t i = 0; i < count; i++) {
            const isogi_hit *hit = &truth[i * METHOD_STRIDE];
            wrong += (t[i] >= 0) != (hit->side != 0);
            if (t[i] >= 0 && hit->side) {
                error[compared] = fabs(t[i] - hit->t) * (s->n - 1) / 2;
                wrong += error[compared++] > APART_USUAL;
            }
        }
        qsort(error, compared, sizeof *error, compare_doubles);
        snprintf(setting, sizeof setting, "one ray a call; t99 %.2g voxels", compared ? error[compared * 99 / 100] : 0);
        row(name, s->name, names[m], setting, seconds, 1e6 * (double)wrong / (double)count, (double)count, "rays");
    }
    free(t), free(error);
}

static void bench_rays_by(const scene *s, const char *name, const char *method, const isogi_ray *rays, size_t batch, int kind, int usual) {
    isogi_hit *hits = (isogi_hit *)malloc(RAYS * sizeof *hits);
    uint8_t *occluded = (uint8_t *)malloc(RAYS);
    isogi_counters count = {0};
    double seconds[16], t99 = 0, error;
    char setting[128], looked[64];
    trace_all(s, rays, batch, kind == SHARED, hits, kind == ANY ? occluded : NULL, &count);
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        trace_all(s, rays, batch, kind == SHARED, hits, kind == ANY ? occluded : NULL, NULL);
        seconds[run] = cpu_seconds() - start;
    }
    error = wrong_hits(s, rays, kind == ANY ? NULL : hits, kind == ANY ? occluded : NULL, &t99);
    snprintf(looked, sizeof looked, "per ray %.2f blocks %.2f cells %.2f cubics", (double)count.blocks / RAYS, (double)count.cells / RAYS,
             (double)count.cubics / RAYS);
    if (kind == ANY) snprintf(setting, sizeof setting, "batch %zu; %s", batch, looked);
    else snprintf(setting, sizeof setting, "batch %zu; t99 %.2g voxels; %s", batch, t99, looked);
    row(name, s->name, method, setting, median(seconds, runs), error, RAYS, "rays");
    if (usual) bench_usual(s, name, rays, hits);
    free(hits), free(occluded);
}

static void bench_rays(const scene *s, const char *name, const isogi_ray *rays, size_t batch, int kind, int usual) {
    bench_rays_by(s, name, "default", rays, batch, kind, usual);
}

/* As on machines without AVX-512, and without AVX2, too; and on this one with a compact pyramid. */
static void bench_paths(const scene *whole) {
    static const char *const names[3] = {"compact", "without-avx2", "without-avx512"};
    for (int way = 0; way < 3; way++) {
        const isogi_context context = {.threads = 1, .force_path = way ? way + 1 : 0};
        isogi_volume volume = *isogi_vol_volume(whole->pyramid);
        scene s = *whole;
        volume.compact = !way;
        if (isogi_vol_build(&s.pyramid, &volume, &context) != ISOGI_OK) exit(1);
        bench_rays_by(&s, "primary1", names[way], s.primary, 1, FIRST, 0);
        bench_rays_by(&s, "primary16", names[way], s.primary, 16, FIRST, 0);
        bench_rays_by(&s, "surface", names[way], s.surface, RAYS, FIRST, 0);
        bench_rays_by(&s, "bundle64", names[way], s.bundles, BUNDLES * BUNDLE, SHARED, 0);
        isogi_vol_free(s.pyramid);
    }
}

/* ---- pyramids, and volumes with holes ---- */

static void bench_build(const isogi_volume *volume, const char *method, const char *setting) {
    double seconds[16];
    for (int run = 0; run < runs; run++) {
        isogi_pyramid *p;
        double start = cpu_seconds();
        if (isogi_vol_build(&p, volume, &serial) != ISOGI_OK) exit(1);
        seconds[run] = cpu_seconds() - start;
        isogi_vol_free(p);
    }
    row("pyramid-256", NULL, method, setting, median(seconds, runs), 0, (double)N * N * N, "voxels");
}

static void bench_holed_rays(const scene *s, const isogi_pyramid *plain, const char *name, const isogi_ray *rays, size_t batch, int kind) {
    isogi_hit *hits = (isogi_hit *)malloc(RAYS * sizeof *hits);
    uint8_t *occluded = (uint8_t *)malloc(RAYS);
    double seconds[16], wrong = 0;
    char setting[64];
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        trace_all(s, rays, batch, kind == SHARED, hits, kind == ANY ? occluded : NULL, NULL);
        seconds[run] = cpu_seconds() - start;
    }
    for (size_t i = 0; i < RAYS; i += METHOD_STRIDE) {
        isogi_hit hit;
        isogi_vol_intersect(plain, &rays[i], 1, &hit, NULL);
        if (kind == ANY) wrong += (hit.side != 0) != occluded[i];
        else wrong += hit.side != hits[i].side || (hit.side && fabs(hit.t - hits[i].t) > APART * 2 / (N - 1));
    }
    snprintf(setting, sizeof setting, "batch %zu; error: against the plain walk", batch);
    row(name, s->name, "holes", setting, median(seconds, runs), 1e6 * wrong * METHOD_STRIDE / RAYS, RAYS, "rays");
    free(hits), free(occluded);
}

/* All voxels out of a ball, which are half of them, are NaN. */
static void bench_holes(const scene *whole, int build) {
    const isogi_context plainly = {.threads = 1, .force_path = 1};
    const size_t voxels = (size_t)N * N * N;
    isogi_volume volume = *isogi_vol_volume(whole->pyramid);
    isogi_pyramid *plain;
    scene s = *whole;
    s.data = (float *)malloc(voxels * sizeof *s.data);
    for (size_t i = 0; i < voxels; i++) {
        double square = 0;
        for (size_t a = 0, at = i; a < 3; a++, at /= N) square += pow(2.0 * (double)(at % N) / (N - 1) - 1, 2);
        s.data[i] = square < 1 ? whole->data[i] : (float)NAN;
    }
    volume.data = s.data;
    if (isogi_vol_build(&s.pyramid, &volume, &serial) != ISOGI_OK || isogi_vol_build(&plain, &volume, &plainly) != ISOGI_OK) exit(1);
    bench_holed_rays(&s, plain, "primary1", s.primary, 1, FIRST);
    bench_holed_rays(&s, plain, "primary16", s.primary, 16, FIRST);
    bench_holed_rays(&s, plain, "surface", s.surface, RAYS, FIRST);
    bench_holed_rays(&s, plain, "anyhit", s.surface, RAYS, ANY);
    bench_holed_rays(&s, plain, "bundle64", s.bundles, BUNDLES * BUNDLE, SHARED);
    if (build) bench_build(&volume, "holes", "float32; error: none possible");
    isogi_vol_free(s.pyramid), isogi_vol_free(plain), free(s.data);
}

/* ---- the rest ---- */

/* A cubic B-spline by its definition, for places whose 64 voxels exist; or its slope along an axis (0..2; -1: the value). */
static real spline_at(const scene *s, const int cell[3], const real u[3], int along) {
    real sum = 0;
    for (int t = 0; t < 64; t++) {
        const int tap[3] = {t & 3, t >> 2 & 3, t >> 4};
        real weight = 1;
        for (int a = 0; a < 3; a++) {
            const real d = u[a] - (tap[a] - 1), x = fabsl(d), y = 2 - x;
            if (a == along) weight *= (x < 1 ? (9 * x - 12) * x / 6 : -y * y / 2) * (d < 0 ? -1 : 1);
            else weight *= x < 1 ? ((real)4 - 6 * x * x + 3 * x * x * x) / 6 : y * y * y / 6;
        }
        sum += weight * (real)s->reference[(cell[0] + tap[0] - 1) +
                                           (ptrdiff_t)s->n * ((cell[1] + tap[1] - 1) + (ptrdiff_t)s->n * (cell[2] + tap[2] - 1))];
    }
    return sum;
}

/* Largest error of a sample of values, against long double. */
static double worst_sample(const scene *s, const float (*points)[3], const float *values, size_t count, int smooth, double unit,
                           double low) {
    double worst = 0, h = 2.0 / (s->n - 1);
    reference_field field = {s->reference, {s->n, s->n, s->n}, 0};
    for (size_t i = 0; i < count; i += 1009) {
        real p[3], u[3], truth;
        int cell[3], inner = 1;
        for (int a = 0; a < 3; a++) {
            p[a] = ((real)points[i][a] + 1) / (real)h;
            p[a] = p[a] < 0 ? 0 : p[a] > s->n - 1 ? s->n - 1 : p[a];
            cell[a] = (int)p[a] > s->n - 2 ? s->n - 2 : (int)p[a], u[a] = p[a] - cell[a];
            inner &= cell[a] > 0 && cell[a] < s->n - 2;
        }
        if (smooth && !inner) continue;
        truth = smooth ? spline_at(s, cell, u, -1) : reference_value(&field, cell, p, 0);
        double e = fabs((double)(truth - ((real)values[i] * (real)unit + (real)low)));
        worst = e > worst ? e : worst;
    }
    return worst;
}

enum { ALONG_RAYS, FAR_RAYS, ANYWHERE, ALONE };       /* where samples are; ALONE: as FAR_RAYS, a point a call */
enum { TRILINEAR, TRILINEAR_GRADIENTS, TRICUBIC };    /* what is sampled */
enum { TILES = 64, LONGEST = 1024, SPREAD = 1 << 21 };/* rays a call; points a ray at most; points that are not along all rays */
static const char *const samplings[] = {"", "value and gradient; ", "value and gradient; "};

/* Points at half-voxel steps from where a ray enters the volume to where it leaves it; their number. */
static size_t points_along(const isogi_ray *ray, float (*points)[3]) {
    double enter = 0, leave = 1e9;
    size_t count = 0;
    for (int a = 0; a < 3; a++) {
        const double d = (double)ray->dir[a], low = (-1 - ray->origin[a]) / d, high = (1 - ray->origin[a]) / d;
        enter = fmax(enter, fmin(low, high)), leave = fmin(leave, fmax(low, high));
    }
    for (double t = enter; t <= leave && count < LONGEST; t += 1.0 / (N - 1), count++)
        for (int a = 0; a < 3; a++) points[count][a] = (float)(ray->origin[a] + t * (double)ray->dir[a]);
    return count;
}

static void spread_points(const scene *s, int places, float (*points)[3]) {
    random_state = 2;
    for (size_t i = 0; i < SPREAD; i++) {
        const isogi_ray *ray = &s->primary[i / 256 * 128];
        const double t = 1.9 + (double)(i % 256) / (N - 1);
        for (int a = 0; a < 3; a++)
            points[i][a] = (float)(places == ANYWHERE ? 2 * random_unit() - 1 : ray->origin[a] + t * (double)ray->dir[a]);
    }
}

/* Along all primary rays in their order, those of four tiles of pixels a call; or all points in one call, of rays 32 pixels apart or
   anywhere; or each point in a call of its own. Making the points takes no time. bytes: the field in 8 bits. */
static void bench_samples(const scene *s, const char *name, int what, int places, int bytes) {
    const size_t most = places == ALONG_RAYS ? TILES * LONGEST : SPREAD, voxels = (size_t)N * N * N;
    const size_t calls = places == ALONG_RAYS ? RAYS / TILES : 1, row_of_tiles = 4 * WIDTH / TILES, together = places == ALONE ? 1 : most;
    float(*points)[3] = (float(*)[3])malloc(most * sizeof *points), (*gradients)[3] = (float(*)[3])malloc(most * sizeof *gradients);
    float *values = (float *)malloc(most * sizeof *values);
    uint8_t *raw = (uint8_t *)malloc(bytes ? voxels : 1);
    double seconds[16], worst = 0, work = 0;
    char setting[128];
    isogi_pyramid *pyramid = s->pyramid;
    if (bytes) { /* values from -1.5 to 1.5 */
        isogi_volume v = *isogi_vol_volume(s->pyramid);
        for (size_t i = 0; i < voxels; i++) raw[i] = (uint8_t)(((double)s->data[i] + 1.5) * 85), s->reference[i] = raw[i] / 85.0 - 1.5;
        v.data = raw, v.type = ISOGI_U8, v.stride[0] = v.stride[1] = v.stride[2] = 0;
        if (isogi_vol_build(&pyramid, &v, &serial) != ISOGI_OK) exit(1);
    }
    if (places != ALONG_RAYS) spread_points(s, places, points);
    for (int run = -1; run < runs; run++) { /* the first run touches the memory, and tells the error */
        double used = 0;
        work = 0;
        for (size_t call = 0; call < calls; call++) {
            size_t count = 0;
            if (call / row_of_tiles % every) continue;
            for (size_t i = 0; i < TILES && places == ALONG_RAYS; i++) count += points_along(&s->primary[call * TILES + i], points + count);
            if (places != ALONG_RAYS) count = SPREAD;
            used -= cpu_seconds();
            for (size_t i = 0, n; i < count; i += n) {
                const float(*at)[3] = (const float(*)[3])points + i;
                n = count - i < together ? count - i : together;
                if (what == TRICUBIC) isogi_vol_sample_smooth(pyramid, at, n, values + i, gradients + i);
                else isogi_vol_sample(pyramid, at, n, values + i, what == TRILINEAR ? NULL : gradients + i);
            }
            used += cpu_seconds(), work += (double)count;
            if (run < 0)
                worst = fmax(worst, worst_sample(s, (const float(*)[3])points, values, count, what == TRICUBIC, bytes ? 1 / 85.0 : 1,
                                                 bytes ? -1.5 : 0));
        }
        if (run >= 0) seconds[run] = used;
    }
    if (places == ALONG_RAYS)
        snprintf(setting, sizeof setting, "%serror: largest of value; 1024x1024 rays in every %zuth row of tiles; %d a call",
                 samplings[what], every, TILES);
    else snprintf(setting, sizeof setting, "%serror: largest of value%s", samplings[what], places == ALONE ? "; 1 a call" : "");
    row(name, NULL, "default", setting, median(seconds, runs), worst, work, "samples");
    if (bytes) {
        isogi_vol_free(pyramid);
        for (size_t i = 0; i < voxels; i++) s->reference[i] = (double)s->data[i];
    }
    free(points), free(gradients), free(values), free(raw);
}

/* The cell of a world point, and the place in it. */
static void place_of(const scene *s, const double point[3], int cell[3], real at[3]) {
    for (int a = 0; a < 3; a++) {
        at[a] = ((real)point[a] + 1) * (s->n - 1) / 2;
        cell[a] = at[a] < 0 ? 0 : (int)at[a] > s->n - 2 ? s->n - 2 : (int)at[a];
    }
}

/* How far a point is from the trilinear surface of its cell, in voxels, to first order. */
static double off_surface(const scene *s, const double point[3]) {
    reference_field field = {s->reference, {s->n, s->n, s->n}, 0};
    real at[3], slope = 0;
    int cell[3];
    place_of(s, point, cell, at);
    for (int a = 0; a < 3; a++) {
        real low[3] = {at[0], at[1], at[2]}, high[3] = {at[0], at[1], at[2]}, difference;
        low[a] = cell[a], high[a] = cell[a] + 1;
        difference = reference_value(&field, cell, high, 0) - reference_value(&field, cell, low, 0);
        slope += difference * difference;
    }
    return (double)(fabsl(reference_value(&field, cell, at, (real)s->isovalue)) / sqrtl(slope));
}

/* Largest distance of vertices from the exact trilinear surface, in voxels; *middles: 99th percentile of that of the triangles' middles. */
static double worst_vertex(const scene *s, const isogi_mesh *mesh, double *middles) {
    const size_t stride = 11, count = mesh->triangle_count / stride;
    double *off = (double *)malloc((count + 1) * sizeof *off), worst = 0;
    for (size_t i = 0; i < mesh->vertex_count; i += stride) {
        const double point[3] = {(double)mesh->positions[i][0], (double)mesh->positions[i][1], (double)mesh->positions[i][2]};
        worst = fmax(worst, off_surface(s, point));
    }
    for (size_t i = 0; i < count; i++) {
        double middle[3] = {0, 0, 0};
        for (int k = 0; k < 9; k++) middle[k % 3] += (double)mesh->positions[mesh->triangles[i * stride][k / 3]][k % 3] / 3;
        off[i] = off_surface(s, middle);
    }
    qsort(off, count, sizeof *off, compare_doubles);
    *middles = off[count * 99 / 100];
    free(off);
    return worst;
}

/* Largest angle between a normal and minus the gradient of the B-spline where its vertex is. */
static double worst_normal(const scene *s, const isogi_mesh *mesh) {
    double worst = 0;
    for (size_t i = 0; i < mesh->vertex_count; i += 101) {
        const double point[3] = {(double)mesh->positions[i][0], (double)mesh->positions[i][1], (double)mesh->positions[i][2]};
        real at[3], g[3], length = 0, off = 0;
        int cell[3], inner = 1;
        place_of(s, point, cell, at);
        for (int a = 0; a < 3; a++) inner &= cell[a] > 0 && cell[a] < s->n - 2, at[a] -= cell[a];
        if (!inner) continue;
        for (int a = 0; a < 3; a++) g[a] = spline_at(s, cell, at, a), length += g[a] * g[a];
        for (int a = 0; a < 3; a++) {
            const real d = g[a] / sqrtl(length) + (real)mesh->normals[i][a];
            off += d * d;
        }
        worst = fmax(worst, (double)sqrtl(off));
    }
    return worst;
}

static void bench_mesh(const scene *s, const char *name, int normals) {
    isogi_mesh mesh = {0};
    isogi_mesh_desc desc = {.isovalue = s->isovalue, .normals = normals};
    double seconds[16], worst, middles = 0;
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        if (isogi_vol_mesh(s->pyramid, &desc, &mesh) != ISOGI_OK) exit(1);
        seconds[run] = cpu_seconds() - start;
    }
    if (normals) worst = worst_normal(s, &mesh);
    else worst = worst_vertex(s, &mesh, &middles);
    char setting[128];
    if (normals) snprintf(setting, sizeof setting, "%zu triangles; error: largest of normals in radians", mesh.triangle_count);
    else
        snprintf(setting, sizeof setting, "%zu triangles; error: largest of vertices in voxels; 99 %% of triangles' middles within %.2g",
                 mesh.triangle_count, middles);
    row(name, s->name, "default", setting, median(seconds, runs), worst, (double)N * N * N, "voxels");
    isogi_vol_mesh_free(s->pyramid, &mesh);
}

/* ---- goals; peers as measured on another machine of the same kind ---- */

static const goal goals[] = {
    {"primary1-ml256", 7, "Mrays/s", "Embree 6.9, Open VKL 0.28, OpenVDB 0.97"},
    {"primary1-gyroid256", 7, "Mrays/s", "Embree 5.5, Open VKL 0.31, OpenVDB 0.91"},
    {"primary16-ml256", 18, "Mrays/s", "Embree 18.0, Open VKL 2.7"},
    {"primary16-gyroid256", 18, "Mrays/s", "Embree 16.5, Open VKL 2.6"},
    {"surface-ml256", 4, "Mrays/s", "Embree 1.6, Open VKL 0.43, OpenVDB 0.44"},
    {"surface-gyroid256", 4, "Mrays/s", "Embree 1.9, Open VKL 0.40, OpenVDB 0.41"},
    {"anyhit-ml256", 5, "Mrays/s", "Embree 1.7"},
    {"anyhit-gyroid256", 5, "Mrays/s", "Embree 2.2"},
    {"bundle64-ml256", 8, "Mrays/s", "Embree 1.4"},
    {"bundle64-gyroid256", 8, "Mrays/s", "Embree 1.6"},
    {"pyramid-256", 419, "Mvoxels/s", "Open VKL 258 (65 ms), OpenVDB 140-210"},
    {"trilinear-along-rays", 300, "Msamples/s", "Open VKL 89 (16 wide), 33 (scalar call)"},
    {"tricubic-along-rays", 40, "Msamples/s", "Open VKL 15"},
    {"tricubic-random", 5, "Msamples/s", "Open VKL 3.9"},
    {"mesh-gyroid256", 280, "Mvoxels/s", "FlyingEdges3D 224 (75 ms), MarchingCubes 42"},
    {"mesh-normals-gyroid256", 210, "Mvoxels/s", "FlyingEdges3D 193 (87 ms)"}};

int main(int argc, char **argv) {
    const char *path = NULL;
    int quick = 0;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) quick = 1, runs = 3, sampled = 1000, judged = RAYS / 8, every = 64;
        else path = argv[i];
    }
    csv = path && path[0] != '-' ? fopen(path, "w") : NULL;
    if (!csv) return fprintf(stderr, "usage: bench_vol [--quick] OUT.csv\n"), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        scene s = scene_new(gyroid, N, 1);
        bench_rays(&s, "primary1", s.primary, 1, FIRST, 0);
        bench_rays(&s, "primary16", s.primary, 16, FIRST, 1);
        bench_rays(&s, "surface", s.surface, RAYS, FIRST, 1);
        bench_rays(&s, "anyhit", s.surface, RAYS, ANY, 0);
        bench_rays(&s, "bundle64", s.bundles, BUNDLES * BUNDLE, SHARED, 0);
        bench_rays(&s, "bundle64alone", s.bundles, BUNDLE, SHARED, 0);
        bench_paths(&s), bench_holes(&s, gyroid);
        if (gyroid) {
            isogi_volume volume;
            volume = *isogi_vol_volume(s.pyramid), bench_build(&volume, "default", "float32; error: none possible");
            volume.data = s.reference, volume.type = ISOGI_F64, memset(volume.stride, 0, sizeof volume.stride);
            bench_build(&volume, "doubles", "float64; error: none possible");
            bench_samples(&s, "trilinear-along-rays", TRILINEAR, ALONG_RAYS, 0);
            bench_samples(&s, "trilinear-along-far-rays", TRILINEAR, FAR_RAYS, 0);
            bench_samples(&s, "trilinear-gradients-along-rays", TRILINEAR_GRADIENTS, ALONG_RAYS, 0);
            bench_samples(&s, "trilinear-bytes-along-rays", TRILINEAR, ALONG_RAYS, 1);
            bench_samples(&s, "trilinear-bytes-along-far-rays", TRILINEAR, FAR_RAYS, 1);
            bench_samples(&s, "trilinear-alone", TRILINEAR, ALONE, 0);
            bench_samples(&s, "trilinear-gradients-alone", TRILINEAR_GRADIENTS, ALONE, 0);
            bench_samples(&s, "tricubic-along-rays", TRICUBIC, ALONG_RAYS, 0);
            bench_samples(&s, "tricubic-along-far-rays", TRICUBIC, FAR_RAYS, 0);
            bench_samples(&s, "tricubic-bytes-along-rays", TRICUBIC, ALONG_RAYS, 1);
            bench_samples(&s, "tricubic-bytes-along-far-rays", TRICUBIC, FAR_RAYS, 1);
            bench_samples(&s, "tricubic-random", TRICUBIC, ANYWHERE, 0);
            bench_mesh(&s, "mesh", 0);
            bench_mesh(&s, "mesh-normals", 1);
        }
        scene_free(&s);
    }
    /* how cost grows with resolution */
    for (int n = 64; n <= (quick ? 128 : LARGEST); n *= 2)
        for (int gyroid = 0; gyroid < 2 && n != N; gyroid++) {
            scene s = scene_new(gyroid, n, !quick);
            bench_rays(&s, "primary16", s.primary, 16, FIRST, 1);
            if (!quick) {
                bench_rays(&s, "surface", s.surface, RAYS, FIRST, 0);
                bench_rays(&s, "bundle64", s.bundles, BUNDLES * BUNDLE, SHARED, 0);
            }
            scene_free(&s);
        }
    goals_print(goals, sizeof goals / sizeof *goals);
    fclose(csv);
    return 0;
}
