/* Run time against error of isogi_vol.h: the isosurface rows of the design, on the fields ml256 and gyroid256.

       build/bench/bench_vol [--quick] OUT.csv

   One thread, CPU seconds, medians of several runs in one process. Rays: error = missed + extra hits per million, against
   tests/reference_ray.h on a sample of the rays. Other rows name their error in `setting`. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "reference_ray.h"
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { N = 256, WIDTH = 1024, RAYS = WIDTH * WIDTH, BUNDLE = 64 };

typedef struct scene {
    const char *name;
    double isovalue;
    float *data;
    double *reference; /* the same values for the reference */
    isogi_pyramid *pyramid;
    isogi_ray *primary, *surface, *bundles;
    isogi_hit *starts; /* of the bundles: one primary hit for BUNDLE rays */
} scene;

static FILE *csv;
static int runs = 5, sampled = 4000;
static const isogi_context serial = {.threads = 1};
static const double pi = 3.14159265358979323846;

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *seconds, int n) {
    qsort(seconds, (size_t)n, sizeof *seconds, compare_doubles);
    return seconds[n / 2];
}

static void row(const char *name, const char *scene_name, const char *method, const char *setting, double seconds, double error, double work,
                const char *unit) {
    fprintf(csv, "isogi_vol.h,%s%s%s,%s,%s,%.6g,%.6g,%.6g,%s\n", name, scene_name ? "-" : "", scene_name ? scene_name : "", method, setting,
            seconds, error, work, unit);
    fflush(csv);
    fprintf(stderr, "  %-20s %-10s %-24s %9.3f M%s  error %.3g\n", name, scene_name ? scene_name : "", setting, work / seconds / 1e6, unit, error);
}

static uint64_t random_state;
static double random_unit(void) {
    uint64_t z = (random_state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/* ---- the fields and rays of the design ---- */

/* Both fields are sums of products of functions of one or two coordinates: one sine a row instead of one a voxel. */
static void field_fill(float *data, int gyroid) {
    static double s[N], c[N], wave[N * N];
    for (int i = 0; i < N; i++) {
        double x = -1 + 2.0 * i / (N - 1);
        s[i] = gyroid ? sin(2 * pi * (x + 1)) : sin(pi * x / 2), c[i] = cos(2 * pi * (x + 1));
    }
    for (int i = 0; i < N * N && !gyroid; i++) {
        double x = -1 + 2.0 * (i % N) / (N - 1), y = -1 + 2.0 * (double)(i / N) / (N - 1);
        wave[i] = cos(2 * pi * 6 * cos(pi * sqrt(x * x + y * y) / 2));
    }
    for (size_t i = 0; i < (size_t)N * N * N; i++) {
        size_t x = i % N, y = i / N % N, z = i / N / N;
        data[i] = (float)(gyroid ? s[x] * c[y] + s[y] * c[z] + s[z] * c[x] : (1 - s[z] + 0.25 * (1 + wave[i % (N * N)])) / (2 * (1 + 0.25)));
    }
}

static void primary_rays(isogi_ray *rays, double isovalue) {
    const double eye[3] = {1.5, 1.2, 2.0};
    double length = sqrt(eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2]), f[3], r[3], u[3], tangent = tan(pi / 8);
    for (int a = 0; a < 3; a++) f[a] = -eye[a] / length;
    r[0] = -f[2], r[1] = 0, r[2] = f[0];
    length = sqrt(r[0] * r[0] + r[2] * r[2]);
    r[0] /= length, r[2] /= length;
    u[0] = r[1] * f[2] - r[2] * f[1], u[1] = r[2] * f[0] - r[0] * f[2], u[2] = r[0] * f[1] - r[1] * f[0];
    /* in tiles of 4x4 pixels, so that a batch of 16 is a packet */
    for (int i = 0; i < RAYS; i++) {
        int tile = i / 16, x = tile % (WIDTH / 4) * 4 + i % 4, y = tile / (WIDTH / 4) * 4 + i / 4 % 4;
        double sx = (2 * (x + 0.5) / WIDTH - 1) * tangent, sy = (1 - 2 * (y + 0.5) / WIDTH) * tangent, d[3], l = 0;
        for (int a = 0; a < 3; a++) d[a] = f[a] + sx * r[a] + sy * u[a], l += d[a] * d[a];
        memset(&rays[i], 0, sizeof rays[i]);
        for (int a = 0; a < 3; a++) rays[i].origin[a] = eye[a], rays[i].dir[a] = (float)(d[a] / sqrt(l));
        rays[i].isovalue = isovalue;
    }
}

static void cosine_direction(const float n[3], float out[3]) {
    double z = 2 * random_unit() - 1, phi = 2 * pi * random_unit(), s = sqrt(1 - z * z), d[3], l = 0;
    d[0] = s * cos(phi) + (double)n[0], d[1] = s * sin(phi) + (double)n[1], d[2] = z + (double)n[2];
    for (int a = 0; a < 3; a++) l += d[a] * d[a];
    for (int a = 0; a < 3; a++) out[a] = (float)(d[a] / sqrt(l));
}

static void surface_ray(isogi_ray *ray, const float position[3], const float normal[3], double isovalue) {
    memset(ray, 0, sizeof *ray);
    for (int a = 0; a < 3; a++) ray->origin[a] = (double)position[a] + (double)normal[a] * 0.25 * 2 / (N - 1);
    cosine_direction(normal, ray->dir);
    ray->isovalue = isovalue;
}

/* Cosine-distributed rays from primary hit points in shuffled order; and bundles of 64 from one point each. */
static void surface_rays(scene *s) {
    isogi_hit *hits = (isogi_hit *)malloc(RAYS * sizeof *hits);
    size_t count = 0, p = 0;
    isogi_vol_intersect(s->pyramid, s->primary, RAYS, hits, NULL);
    for (size_t i = 0; i < RAYS; i++)
        if (hits[i].side) hits[count++] = hits[i];
    random_state = 1;
    for (size_t i = count - 1; i > 0; i--) {
        size_t j = (size_t)(random_unit() * (double)(i + 1));
        isogi_hit swap = hits[i];
        hits[i] = hits[j], hits[j] = swap;
    }
    for (size_t i = 0; i < RAYS; i++, p++) {
        float position[1][3], normal[1][3];
        isogi_vol_positions(s->pyramid, &hits[p % count], 1, position);
        isogi_vol_normals(s->pyramid, &hits[p % count], 1, ISOGI_NORMAL_SMOOTH, normal);
        surface_ray(&s->surface[i], position[0], normal[0], s->isovalue);
        if (i % BUNDLE) continue;
        for (size_t k = 0; k < BUNDLE; k++) surface_ray(&s->bundles[i + k], position[0], normal[0], s->isovalue);
    }
    free(hits);
}

static scene scene_new(int gyroid) {
    scene s = {.name = gyroid ? "gyroid256" : "ml256", .isovalue = gyroid ? 0 : 0.5};
    size_t voxels = (size_t)N * N * N;
    s.data = (float *)malloc(voxels * sizeof(float)), s.reference = (double *)malloc(voxels * sizeof(double));
    field_fill(s.data, gyroid);
    for (size_t i = 0; i < voxels; i++) s.reference[i] = (double)s.data[i];
    isogi_volume volume = {.data = s.data, .type = ISOGI_F32, .size = {N, N, N}};
    for (int a = 0; a < 3; a++) volume.spacing[a] = 2.0 / (N - 1), volume.origin[a] = -1;
    if (isogi_vol_build(&s.pyramid, &volume, &serial) != ISOGI_OK) exit(1);
    s.primary = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    s.surface = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    s.bundles = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    primary_rays(s.primary, s.isovalue);
    surface_rays(&s);
    return s;
}

static void scene_free(scene *s) {
    isogi_vol_free(s->pyramid);
    free(s->data), free(s->reference), free(s->primary), free(s->surface), free(s->bundles);
}

/* ---- rays ---- */

/* Missed and extra hits per million among a sample spread over the rays; *t99: 99th percentile of the error of t in voxels. */
static double wrong_hits(const scene *s, const isogi_ray *rays, const isogi_hit *hits, const uint8_t *occluded, double *t99) {
    reference_field field = {s->reference, {N, N, N}, 1e-10L};
    double *error = (double *)malloc((size_t)sampled * sizeof *error), h = 2.0 / (N - 1);
    int wrong = 0, decided = 0, compared = 0;
    for (int i = 0; i < sampled; i++) {
        size_t r = (size_t)i * (RAYS / (size_t)sampled);
        double o[3], d[3];
        for (int a = 0; a < 3; a++) o[a] = (rays[r].origin[a] + 1) / h, d[a] = (double)rays[r].dir[a] / h;
        reference_hit truth = reference_intersect(&field, o, d, 0, 0, s->isovalue);
        if (!truth.decided) continue;
        decided++;
        wrong += (truth.side != 0) != (hits ? hits[r].side != 0 : occluded[r] != 0);
        if (hits && truth.side && hits[r].side) error[compared++] = fabs((double)truth.t - hits[r].t) / h;
    }
    qsort(error, (size_t)compared, sizeof *error, compare_doubles);
    *t99 = compared ? error[(size_t)((double)compared * 0.99)] : 0;
    free(error);
    return 1e6 * wrong / (decided ? decided : 1);
}

static void bench_rays(const scene *s, const char *name, const isogi_ray *rays, size_t batch, int any) {
    isogi_hit *hits = (isogi_hit *)malloc(RAYS * sizeof *hits);
    uint8_t *occluded = (uint8_t *)malloc(RAYS);
    double seconds[16], t99 = 0, error;
    char setting[64];
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        for (size_t i = 0; i < RAYS; i += batch) {
            if (any) isogi_vol_occluded(s->pyramid, rays + i, batch, occluded + i, NULL);
            else isogi_vol_intersect(s->pyramid, rays + i, batch, hits + i, NULL);
        }
        seconds[run] = cpu_seconds() - start;
    }
    error = wrong_hits(s, rays, any ? NULL : hits, any ? occluded : NULL, &t99);
    if (any) snprintf(setting, sizeof setting, "batch %zu", batch);
    else snprintf(setting, sizeof setting, "batch %zu; t99 %.2g voxels", batch, t99);
    row(name, s->name, "default", setting, median(seconds, runs), error, RAYS, "rays");
    free(hits), free(occluded);
}

/* ---- the rest ---- */

static void bench_build(const scene *s) {
    double seconds[16];
    for (int run = 0; run < runs; run++) {
        isogi_pyramid *p;
        double start = cpu_seconds();
        isogi_vol_build(&p, isogi_vol_volume(s->pyramid), &serial);
        seconds[run] = cpu_seconds() - start;
        isogi_vol_free(p);
    }
    row("pyramid-256", NULL, "default", "float32; error: none possible", median(seconds, runs), 0, (double)N * N * N, "voxels");
}

/* Points along primary rays at half-voxel steps, or anywhere. */
static void bench_samples(const scene *s, const char *name, int smooth, int random) {
    size_t count = 1 << 21;
    float(*points)[3] = (float(*)[3])malloc(count * sizeof *points), (*gradients)[3] = (float(*)[3])malloc(count * sizeof *gradients);
    float *values = (float *)malloc(count * sizeof *values);
    double seconds[16], worst = 0, h = 2.0 / (N - 1);
    random_state = 2;
    for (size_t i = 0; i < count; i++) {
        const isogi_ray *ray = &s->primary[i / 256 * 128];
        double t = 1.9 + 0.5 * h * (double)(i % 256);
        for (int a = 0; a < 3; a++) points[i][a] = (float)(random ? 2 * random_unit() - 1 : ray->origin[a] + t * (double)ray->dir[a]);
    }
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        if (smooth) isogi_vol_sample_smooth(s->pyramid, (const float(*)[3])points, count, values, gradients);
        else isogi_vol_sample(s->pyramid, (const float(*)[3])points, count, values, NULL);
        seconds[run] = cpu_seconds() - start;
    }
    /* error against long double on a sample; of the smooth ones, only the trilinear part has a reference here */
    reference_field field = {s->reference, {N, N, N}, 0};
    for (size_t i = 0; i < count && !smooth; i += 1009) {
        real p[3];
        int cell[3];
        for (int a = 0; a < 3; a++) {
            p[a] = ((real)points[i][a] + 1) / (real)h;
            p[a] = p[a] < 0 ? 0 : p[a] > N - 1 ? N - 1 : p[a];
            cell[a] = (int)p[a] > N - 2 ? N - 2 : (int)p[a];
        }
        double e = fabs((double)(reference_value(&field, cell, p, 0) - (real)values[i]));
        worst = e > worst ? e : worst;
    }
    row(name, NULL, "default", smooth ? "value and gradient; error in test_vol" : "error: largest of value", median(seconds, runs), worst, (double)count,
        "samples");
    free(points), free(gradients), free(values);
}

static void bench_mesh(const scene *s, const char *name, int normals) {
    isogi_mesh mesh = {0};
    isogi_mesh_desc desc = {.isovalue = s->isovalue, .normals = normals};
    double seconds[16], worst = 0;
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        if (isogi_vol_mesh(s->pyramid, &desc, &mesh) != ISOGI_OK) exit(1);
        seconds[run] = cpu_seconds() - start;
    }
    for (size_t i = 0; i < mesh.vertex_count; i += 101) {
        float value;
        isogi_vol_sample(s->pyramid, (const float(*)[3])mesh.positions + i, 1, &value, NULL);
        worst = fabs((double)value - s->isovalue) > worst ? fabs((double)value - s->isovalue) : worst;
    }
    char setting[64];
    snprintf(setting, sizeof setting, "%zu triangles; error: of value", mesh.triangle_count);
    row(name, s->name, "default", setting, median(seconds, runs), worst, (double)N * N * N, "voxels");
    isogi_vol_mesh_free(s->pyramid, &mesh);
}

int main(int argc, char **argv) {
    const char *path = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) runs = 3, sampled = 1000;
        else path = argv[i];
    }
    csv = path ? fopen(path, "w") : NULL;
    if (!csv) return fprintf(stderr, "usage: bench_vol [--quick] OUT.csv\n"), 2;
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        scene s = scene_new(gyroid);
        bench_rays(&s, "primary1", s.primary, 1, 0);
        bench_rays(&s, "primary16", s.primary, 16, 0);
        bench_rays(&s, "surface", s.surface, RAYS, 0);
        bench_rays(&s, "anyhit", s.surface, RAYS, 1);
        bench_rays(&s, "bundle64", s.bundles, BUNDLE, 0);
        if (gyroid) {
            bench_build(&s);
            bench_samples(&s, "trilinear-along-rays", 0, 0);
            bench_samples(&s, "tricubic-along-rays", 1, 0);
            bench_samples(&s, "tricubic-random", 1, 1);
            bench_mesh(&s, "mesh", 0);
            bench_mesh(&s, "mesh-normals", 1);
        }
        scene_free(&s);
    }
    fclose(csv);
    return 0;
}
