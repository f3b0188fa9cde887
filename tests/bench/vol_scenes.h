/* The scenes of the design, their rays, and the calls that trace them: what bench_vol.c and peer_embree.c measure alike. */
#ifndef VOL_SCENES_H
#define VOL_SCENES_H

#include "isogi_vol.h"
#include "large.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { N = 256, WIDTH = 1024, RAYS = WIDTH * WIDTH, BUNDLE = 64, BUNDLES = 64, LARGEST = 512 };

typedef struct scene {
    char name[24];
    int n; /* voxels a side */
    double isovalue;
    float *data;
    double *reference; /* the same values for the reference */
    isogi_pyramid *pyramid;
    isogi_ray *primary, *surface, *bundles;
    isogi_hit *starts; /* of the bundles: one primary hit for BUNDLE rays */
} scene;

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

static uint64_t random_state;
static double random_unit(void) {
    uint64_t z = (random_state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/* ---- the fields and rays of the design ---- */

/* Both fields are sums of products of functions of one or two coordinates: one sine a row instead of one a voxel. */
static void field_fill(float *data, int gyroid, int n) {
    static double s[LARGEST], c[LARGEST];
    double *wave = (double *)malloc((size_t)n * (size_t)n * sizeof *wave);
    const size_t size = (size_t)n;
    for (int i = 0; i < n; i++) {
        double x = -1 + 2.0 * i / (n - 1);
        s[i] = gyroid ? sin(2 * pi * (x + 1)) : sin(pi * x / 2), c[i] = cos(2 * pi * (x + 1));
    }
    for (int i = 0; i < n * n && !gyroid; i++) {
        double x = -1 + 2.0 * (i % n) / (n - 1), y = -1 + 2.0 * (double)(i / n) / (n - 1);
        wave[i] = cos(2 * pi * 6 * cos(pi * sqrt(x * x + y * y) / 2));
    }
    for (size_t i = 0; i < size * size * size; i++) {
        size_t x = i % size, y = i / size % size, z = i / size / size;
        data[i] = (float)(gyroid ? s[x] * c[y] + s[y] * c[z] + s[z] * c[x]
                                 : (1 - s[z] + 0.25 * (1 + wave[i % (size * size)])) / (2 * (1 + 0.25)));
    }
    free(wave);
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

static void surface_ray(isogi_ray *ray, const float position[3], const float normal[3], const scene *s) {
    memset(ray, 0, sizeof *ray);
    for (int a = 0; a < 3; a++) ray->origin[a] = (double)position[a] + (double)normal[a] * 0.25 * 2 / (s->n - 1);
    cosine_direction(normal, ray->dir);
    ray->isovalue = s->isovalue;
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
        surface_ray(&s->surface[i], position[0], normal[0], s);
        if (i % BUNDLE) continue;
        for (size_t k = 0; k < BUNDLE; k++) surface_ray(&s->bundles[i + k], position[0], normal[0], s);
    }
    free(hits);
}

/* surfaces: with the rays that leave them. */
static scene scene_new(int gyroid, int n, int surfaces) {
    scene s = {.n = n, .isovalue = gyroid ? 0 : 0.5};
    size_t voxels = (size_t)n * (size_t)n * (size_t)n;
    snprintf(s.name, sizeof s.name, "%s%d", gyroid ? "gyroid" : "ml", n);
    s.data = (float *)large_allocate(voxels * sizeof(float)), s.reference = (double *)malloc(voxels * sizeof(double));
    field_fill(s.data, gyroid, n);
    for (size_t i = 0; i < voxels; i++) s.reference[i] = (double)s.data[i];
    isogi_volume volume = {.data = s.data, .type = ISOGI_F32, .size = {(size_t)n, (size_t)n, (size_t)n}};
    for (int a = 0; a < 3; a++) volume.spacing[a] = 2.0 / (n - 1), volume.origin[a] = -1;
    if (isogi_vol_build(&s.pyramid, &volume, &serial) != ISOGI_OK) exit(1);
    s.primary = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    s.surface = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    s.bundles = (isogi_ray *)malloc(RAYS * sizeof(isogi_ray));
    primary_rays(s.primary, s.isovalue);
    if (surfaces) surface_rays(&s);
    return s;
}

static void scene_free(scene *s) {
    isogi_vol_free(s->pyramid);
    free(s->data), free(s->reference), free(s->primary), free(s->surface), free(s->bundles);
}

/* A call of the library over all rays, `batch` at a time. bundle: every BUNDLE rays share their origin. */
static void trace_all(const scene *s, const isogi_ray *rays, size_t batch, int bundle, isogi_hit *hits, uint8_t *occluded,
                      isogi_counters *counters) {
    static float dirs[BUNDLES * BUNDLE][3];
    static isogi_bundle bundles[BUNDLES];
    for (size_t i = 0; i < RAYS; i += batch) {
        if (bundle) {
            for (size_t n = 0; n < batch / BUNDLE; n++) {
                memcpy(bundles[n].origin, rays[i + n * BUNDLE].origin, sizeof bundles[n].origin);
                bundles[n].isovalue = s->isovalue;
            }
            for (size_t k = 0; k < batch; k++) memcpy(dirs[k], rays[i + k].dir, sizeof dirs[k]);
            isogi_vol_bundles(s->pyramid, bundles, batch / BUNDLE, (const float(*)[3])dirs, BUNDLE, hits + i, counters);
        } else if (occluded) isogi_vol_occluded(s->pyramid, rays + i, batch, occluded + i, counters);
        else isogi_vol_intersect(s->pyramid, rays + i, batch, hits + i, counters);
    }
}

enum { FIRST, ANY, SHARED };

#endif
