/* Scenes and helpers that the tests of isogi_trace.h share: small analytic fields, isovalue 0 unless said otherwise. */
#ifndef TRACE_SCENES_H
#define TRACE_SCENES_H

#include "isogi_trace.h"
#include "test.h"

#define SHARED __attribute__((unused)) static

#define PI 3.14159265358979323846
/* radiance 1 = SH coefficient sqrt(4 pi) */
static const float white_sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};

/* ---- memory whose allocation number `left` fails; blocks: those in use ---- */

typedef struct scarce { long left, blocks; } scarce;
SHARED void *scarce_alloc(void *user, size_t size, size_t align) {
    scarce *m = (scarce *)user;
    void *p = NULL;
    if (m->left-- == 0 || posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    m->blocks++;
    return p;
}
SHARED void scarce_release(void *user, void *p, size_t size) { (void)size, ((scarce *)user)->blocks--, free(p); }

/* ---- scenes -------------------------------------------------------------------------------------------------------------- */

typedef double field(const double p[3], const double *parameter);

typedef struct scene {
    float *data;
    isogi_volume volume;
    isogi_pyramid *pyramid;
} scene;

SHARED scene scene_make(int nx, int ny, int nz, const double spacing[3], field *f, const double *parameter) {
    scene s;
    size_t i = 0;
    memset(&s, 0, sizeof s);
    s.data = (float *)malloc((size_t)nx * (size_t)ny * (size_t)nz * sizeof(float));
    for (int z = 0; z < nz; z++)
        for (int y = 0; y < ny; y++)
            for (int x = 0; x < nx; x++) {
                double p[3] = {x, y, z};
                for (int a = 0; spacing && a < 3; a++) p[a] *= spacing[a];
                s.data[i++] = (float)f(p, parameter);
            }
    s.volume.data = s.data, s.volume.type = ISOGI_F32;
    s.volume.size[0] = (size_t)nx, s.volume.size[1] = (size_t)ny, s.volume.size[2] = (size_t)nz;
    for (int a = 0; spacing && a < 3; a++) s.volume.spacing[a] = spacing[a];
    if (isogi_vol_build(&s.pyramid, &s.volume, NULL) != ISOGI_OK) abort();
    return s;
}

/* Points of the surface that are seen from (p, p, p), each in a random direction. */
SHARED void points_seen_from(const scene *s, double p, uint64_t seed, size_t count, float (*points)[3]) {
    test_random r = {seed};
    for (size_t i = 0; i < count; i++) {
        isogi_ray ray;
        isogi_hit hit;
        double w[3];
        random_direction(&r, w);
        memset(&ray, 0, sizeof ray), memset(&hit, 0, sizeof hit);
        for (int a = 0; a < 3; a++) ray.origin[a] = p, ray.dir[a] = (float)w[a];
        isogi_vol_intersect(s->pyramid, &ray, 1, &hit, NULL);
        isogi_vol_positions(s->pyramid, &hit, 1, points + i);
    }
}

SHARED double nan_value(void) {
    uint64_t bits = 0x7ff8000000000000u;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

SHARED void scene_free(scene *s) { isogi_vol_free(s->pyramid), free(s->data); }

SHARED double length3(double x, double y, double z) { return sqrt(x * x + y * y + z * z); }

/* parameter: centre, radius */
SHARED double ball(const double p[3], const double *q) { return q[3] - length3(p[0] - q[0], p[1] - q[1], p[2] - q[2]); }
/* solid below y = q[3] without the ball about (q0,q1,q2) of radius q[4] */
SHARED double pit(const double p[3], const double *q) {
    double sphere = length3(p[0] - q[0], p[1] - q[1], p[2] - q[2]) - q[4], plane = q[3] - p[1];
    return sphere < plane ? sphere : plane;
}
/* solid below y = q[4], and a ball above it */
SHARED double ball_over_plane(const double p[3], const double *q) {
    double sphere = ball(p, q), plane = q[4] - p[1];
    return sphere > plane ? sphere : plane;
}
SHARED double ground(const double p[3], const double *q) { return q[0] - p[1]; }
SHARED double torus(const double p[3], const double *q) {
    double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2], ring = sqrt(x * x + z * z) - q[3];
    return q[4] - sqrt(ring * ring + y * y);
}
SHARED double gyroid(const double p[3], const double *q) {
    double x = q[0] * p[0], y = q[0] * p[1], z = q[0] * p[2];
    return sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x);
}
/* a hollow ball: radii q[3] inside, q[4] outside */
SHARED double shell(const double p[3], const double *q) {
    double r = length3(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
    return r - q[3] < q[4] - r ? r - q[3] : q[4] - r;
}

/* rough surfaces: their trilinear and their smoothed normals differ by up to a right angle */
SHARED double roughness(const double p[3]) {
    test_random r = {(uint64_t)(p[0] + 100 * p[1] + 10000 * p[2])};
    return random_range(&r, -1, 1);
}
SHARED double rough_pit(const double p[3], const double *q) { return pit(p, q) + roughness(p); }
SHARED double rough_ball(const double p[3], const double *q) { return ball(p, q) + roughness(p); }
SHARED double rough_shell(const double p[3], const double *q) { return shell(p, q) + roughness(p); }

SHARED isogi_trace_desc desc_make(const scene *s, float albedo, int bounces, int samples) {
    isogi_trace_desc d;
    memset(&d, 0, sizeof d);
    d.pyramid = s->pyramid, d.bounces = bounces, d.samples = samples, d.method = ISOGI_TRACE_PATHS;
    d.albedo[0] = d.albedo[1] = d.albedo[2] = albedo;
    d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1;
    return d;
}

/* Points where rays from inside or outside, towards random places of the box, first meet the isosurface. */
SHARED int surface_points(const scene *s, double isovalue, int count, uint64_t seed, float (*points)[3]) {
    test_random r = {seed};
    int found = 0;
    for (int attempt = 0; attempt < 100 * count && found < count; attempt++) {
        isogi_ray ray;
        isogi_hit hit = {0, {0, 0, 0}, {0, 0, 0}, 0};
        double d[3];
        memset(&ray, 0, sizeof ray);
        random_direction(&r, d);
        for (int a = 0; a < 3; a++) {
            double spacing = s->volume.spacing[a] > 0 ? s->volume.spacing[a] : 1;
            ray.origin[a] = random_range(&r, 0, spacing * (double)(s->volume.size[a] - 1)), ray.dir[a] = (float)d[a];
        }
        ray.isovalue = isovalue;
        isogi_vol_intersect(s->pyramid, &ray, 1, &hit, NULL);
        if (!hit.side) continue;
        isogi_vol_positions(s->pyramid, &hit, 1, (float(*)[3])points[found]);
        found++;
    }
    return found;
}

/* From the centre of a pit down to its wall, at least 5 % of its radius below the rim. */
SHARED void pit_points(const scene *s, const double q[5], int count, float (*points)[3]) {
    test_random r = {3};
    for (int found = 0; found < count;) {
        isogi_ray ray;
        isogi_hit hit = {0, {0, 0, 0}, {0, 0, 0}, 0};
        double d[3];
        random_direction(&r, d);
        if (d[1] > -0.05) continue;
        memset(&ray, 0, sizeof ray);
        for (int a = 0; a < 3; a++) ray.origin[a] = q[a], ray.dir[a] = (float)d[a];
        isogi_vol_intersect(s->pyramid, &ray, 1, &hit, NULL);
        isogi_vol_positions(s->pyramid, &hit, 1, (float(*)[3])points[found++]);
    }
}

SHARED double mean_irradiance(const isogi_trace_desc *d, const float (*points)[3], int count, double *worst) {
    float(*e)[3] = (float(*)[3])malloc((size_t)count * sizeof *e);
    double sum = 0;
    isogi_result result = isogi_trace_gather(d, points, NULL, (size_t)count, e, NULL, NULL);
    CHECK(result == ISOGI_OK, "result %d", result);
    if (worst) *worst = 0;
    for (int i = 0; i < count; i++) sum += (double)e[i][1] / count;
    for (int i = 0; i < count && worst; i++) *worst = fmax(*worst, fabs((double)e[i][1] - sum));
    free(e);
    return sum;
}

/* Bakes the whole texture and looks it up. */
SHARED void bake_and_sample(const isogi_trace_desc *d, const isogi_context *context, const float (*points)[3], int count,
                            float (*e)[3]) {
    isogi_trace *t = NULL;
    double remaining = 1;
    isogi_result result = isogi_trace_create(&t, d, context);
    CHECK(result == ISOGI_OK, "result %d", result);
    if (d->lazy) isogi_trace_request(t, points, (size_t)count);
    result = isogi_trace_step(t, 0, &remaining);
    CHECK(result == ISOGI_OK && remaining <= 0, "result %d, remaining %g", result, remaining);
    isogi_trace_sample(t, points, (size_t)count, e, NULL);
    isogi_trace_free(t);
}

/* ---- lights --------------------------------------------------------------------------------------------------------------- */

SHARED isogi_light light_make(isogi_light_kind kind, double x, double y, double z, double intensity, double radius) {
    isogi_light l;
    memset(&l, 0, sizeof l);
    l.kind = kind, l.vector[0] = (float)x, l.vector[1] = (float)y, l.vector[2] = (float)z, l.radius = (float)radius;
    l.rgb[0] = (float)intensity, l.rgb[1] = (float)(2 * intensity), l.rgb[2] = (float)(3 * intensity);
    return l;
}

SHARED double lit(const scene *s, const isogi_light *light, const float point[3], int channel, int samples) {
    isogi_trace_desc d = desc_make(s, 0.5f, 0, samples);
    float e[1][3] = {{0, 0, 0}}, p[1][3];
    memcpy(p[0], point, sizeof p[0]);
    memset(&d.lighting, 0, sizeof d.lighting);
    d.lighting.lights = light, d.lighting.light_count = 1;
    d.offset = -1; /* on the surface itself: the analytic values hold there */
    CHECK(isogi_trace_gather(&d, (const float(*)[3])p, NULL, 1, e, NULL, NULL) == ISOGI_OK, "light kind %d", light->kind);
    return (double)e[0][channel];
}

#undef SHARED
#endif
