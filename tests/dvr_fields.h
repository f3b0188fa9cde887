/* Small volumes, renderers and single rays for tests of isogi_dvr.h in data space. */
#ifndef DVR_FIELDS_H
#define DVR_FIELDS_H

#include "isogi_dvr.h"
#include "fields.h"

#define PI 3.14159265358979323846

/* ---- transfer functions and light that several programs use ---- */

static const float sky_one[3] = {3.5449077f, 3.5449077f, 3.5449077f}; /* radiance 1: sqrt(4 pi) */

static const isogi_transfer_point sparse_points[] = {
    {0.5, {1, 0.5f, 0.2f}, 0}, {0.9, {0.4f, 1, 0.2f}, 0.8f}, {0.9, {0.4f, 1, 0.2f}, 0}};
static const isogi_peak sparse_peaks[] = {{0.4, {1, 1, 1}, 0.2f}, {-0.8, {0, 0, 1}, 0.5f}};
static const isogi_transfer sparse = {sparse_points, 3, sparse_peaks, 2};

static const isogi_transfer_point hills[] = {{-1, {1, 0.2f, 0.1f}, 0},  {-0.2, {0.3f, 1, 0.1f}, 2}, {0.1, {0.1f, 0.4f, 1}, 0},
                                             {0.4, {0.1f, 0.4f, 1}, 0}, {0.4, {1, 1, 0}, 3},        {1, {1, 0, 1}, 1}};
static const isogi_peak sheets[] = {{0.3, {1, 1, 1}, 0.4f}, {-0.4, {0, 1, 0}, 0.2f}};
static const isogi_transfer landscape = {hills, 6, sheets, 2};

/* ---- fields, renderers, rays ---- */

static void field_build(field *f) { field_build_with(f, &serial); }

typedef double field_function(double x, double y, double z); /* of grid coordinates over (size - 1): 0..1 */

__attribute__((unused)) static field field_of(field_function *function, int n) {
    field f = field_new(n, n, n);
    for (int i = 0; i < n * n * n; i++) f.value[i] = function(i % n / (n - 1.0), i / n % n / (n - 1.0), i / n / n / (n - 1.0));
    field_build(&f);
    return f;
}

/* Independent voxels, -1..1: the worst that a cubic can be. */
__attribute__((unused)) static field field_noise(int n, uint64_t seed) {
    field f = field_new(n, n, n);
    test_random r = {seed};
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_range(&r, -1, 1);
    field_build(&f);
    return f;
}

/* A sum of waves in random directions: smooth, -1..1 or so. */
__attribute__((unused)) static field field_waves(int n, uint64_t seed) {
    field f = field_new(n, n, n);
    test_random r = {seed};
    for (int wave = 0; wave < 6; wave++) {
        double d[3], phase = random_range(&r, 0, 6), length = random_range(&r, 0.1, 0.5);
        random_direction(&r, d);
        for (int i = 0; i < n * n * n; i++)
            f.value[i] += 0.3 * sin(length * (d[0] * (i % n) + d[1] * (i / n % n) + d[2] * (i / n / n)) + phase);
    }
    field_build(&f);
    return f;
}

static isogi_dvr *dvr_new_with(const isogi_dvr_desc *desc, const isogi_transfer *transfer, const isogi_context *context) {
    isogi_dvr *dvr = NULL;
    isogi_result result = isogi_dvr_create(&dvr, desc, context);
    CHECK(result == ISOGI_OK, "create: %s", isogi_result_string(result));
    if (!dvr) abort();
    result = isogi_dvr_set_transfer(dvr, transfer);
    CHECK(result == ISOGI_OK, "set_transfer: %s", isogi_result_string(result));
    return dvr;
}

static isogi_dvr *dvr_new(const isogi_dvr_desc *desc, const isogi_transfer *transfer) { return dvr_new_with(desc, transfer, &serial); }

/* The ray of pixel (x, y), worked out in double, as pictures have it: forward + across right + down under, of length 1. */
__attribute__((unused)) static void view_ray(const isogi_view *view, double x, double y, double origin[3], double dir[3]) {
    const double half = tan((view->fov > 0 ? (double)view->fov : 45) * PI / 360), up[3] = {0, 1, 0};
    const double across = (2 * (x + 0.5) - view->width) / view->height * half, down = (2 * (y + 0.5) / view->height - 1) * half;
    double axis[3][3]; /* forward, right = forward x up, under = forward x right */
    for (int a = 0; a < 3; a++) origin[a] = (double)view->eye[a], axis[0][a] = (double)view->target[a] - origin[a];
    for (int k = 0; k < 3; k++) {
        const double *with = k == 1 ? up : axis[1];
        for (int a = 0; a < 3 && k; a++) axis[k][a] = axis[0][(a + 1) % 3] * with[(a + 2) % 3] - axis[0][(a + 2) % 3] * with[(a + 1) % 3];
        const double length = sqrt(axis[k][0] * axis[k][0] + axis[k][1] * axis[k][1] + axis[k][2] * axis[k][2]);
        for (int a = 0; a < 3; a++) axis[k][a] /= length;
    }
    for (int a = 0; a < 3; a++) dir[a] = (axis[0][a] + across * axis[1][a] + down * axis[2][a]) / sqrt(1 + across * across + down * down);
}

/* One ray: the only pixel of a picture. */
typedef struct pixel { float c[4], depth; } pixel;

static isogi_view line_of_sight(const double eye[3], const double target[3]) {
    isogi_view view = {.width = 1, .height = 1, .fov = 1};
    for (int a = 0; a < 3; a++) view.eye[a] = (float)eye[a], view.target[a] = (float)target[a];
    return view;
}

__attribute__((unused)) static pixel cast(const isogi_dvr *dvr, const double eye[3], const double target[3],
                                          const isogi_lighting *lighting) {
    isogi_view view = line_of_sight(eye, target);
    pixel p;
    isogi_result result = isogi_dvr_render(dvr, &view, lighting, (float(*)[4])p.c, &p.depth, NULL);
    CHECK(result == ISOGI_OK, "render: %s", isogi_result_string(result));
    return p;
}

/* A random line through the box, from outside, whose ends are floats. */
__attribute__((unused)) static void random_line(const field *f, test_random *r, double eye[3], double target[3]) {
    double d[3];
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        target[a] = (double)(float)random_range(r, 0.1, 0.9) * (f->size[a] - 1);
        target[a] = (double)(float)target[a], eye[a] = (double)(float)(target[a] + 3 * f->size[0] * d[a]);
    }
}

__attribute__((unused)) static isogi_view view_of(const field *f, double scale, test_random *r, int size) {
    isogi_view view = {.width = size, .height = size, .fov = 35};
    double d[3], centre[3], radius = 0;
    random_direction(r, d);
    for (int a = 0; a < 3; a++) centre[a] = 0.5 * (f->size[a] - 1), radius += centre[a] * centre[a];
    for (int a = 0; a < 3; a++) {
        view.target[a] = (float)(scale * centre[a]);
        view.eye[a] = (float)(scale * (centre[a] + 3 * sqrt(radius) * d[a]));
    }
    return view;
}

__attribute__((unused)) static float (*picture(const isogi_dvr *dvr, const isogi_view *view, const isogi_lighting *lighting, float *depth,
                                               isogi_counters *count))[4] {
    float(*pixels)[4] = (float(*)[4])calloc((size_t)view->width * (size_t)view->height, sizeof *pixels);
    isogi_result result = isogi_dvr_render(dvr, view, lighting, pixels, depth, count);
    CHECK(result == ISOGI_OK, "render: %s", isogi_result_string(result));
    return pixels;
}

__attribute__((unused)) static double largest_difference(float (*a)[4], float (*b)[4], int pixels) {
    double most = 0;
    for (int i = 0; i < 4 * pixels; i++) most = fmax(most, fabs((double)a[i / 4][i % 4] - (double)b[i / 4][i % 4]));
    return most;
}

__attribute__((unused)) static double rms_difference(float (*a)[4], float (*b)[4], int pixels) {
    double sum = 0;
    for (int i = 0; i < 4 * pixels; i++) sum += pow((double)a[i / 4][i % 4] - (double)b[i / 4][i % 4], 2);
    return sqrt(sum / (4 * pixels));
}

/* ---- a second implementation, plain and slow, in long double ---- */

__attribute__((unused)) static void reference_transfer(const isogi_transfer *t, long double x, long double out[4]) {
    const isogi_transfer_point *p = t->points;
    size_t n = t->point_count, i = 0;
    for (int a = 0; a < 4; a++) out[a] = 0;
    if (!n) return;
    while (i < n && (long double)p[i].value <= x) i++;
    const isogi_transfer_point *low = i ? &p[i - 1] : &p[0], *high = i < n ? &p[i] : &p[n - 1];
    long double u = low == high ? 0 : (x - (long double)low->value) / ((long double)high->value - (long double)low->value);
    for (int a = 0; a < 3; a++) out[a] = (long double)low->rgb[a] + u * ((long double)high->rgb[a] - (long double)low->rgb[a]);
    out[3] = (long double)low->extinction + u * ((long double)high->extinction - (long double)low->extinction);
}

/* The trilinear value within a given cell. */
__attribute__((unused)) static long double reference_value(const field *f, const int c[3], const long double p[3]) {
    long double value = 0;
    for (int n = 0; n < 8; n++) {
        long double w = 1;
        for (int a = 0; a < 3; a++) w *= n >> a & 1 ? p[a] - c[a] : 1 - (p[a] - c[a]);
        value += w * (long double)f->value[c[0] + (n & 1) + f->size[0] * (c[1] + (n >> 1 & 1) + f->size[1] * (c[2] + (n >> 2)))];
    }
    return value;
}

/* Where the ray o + t d enters and leaves the box. */
__attribute__((unused)) static void reference_ends(const field *f, const long double o[3], const long double d[3], long double ends[2]) {
    ends[0] = 0, ends[1] = 1e30L;
    for (int a = 0; a < 3; a++) {
        long double t0 = -o[a] / d[a], t1 = (f->size[a] - 1 - o[a]) / d[a];
        ends[0] = fmaxl(ends[0], fminl(t0, t1)), ends[1] = fminl(ends[1], fmaxl(t0, t1));
    }
}

typedef struct crossing { double t; int side; } crossing;

/* What the exact intersector of isogi_vol.h finds along the same ray. */
__attribute__((unused)) static int intersector_crossings(const isogi_pyramid *pyramid, const double origin[3], const float dir[3],
                                                         double isovalue, crossing *out) {
    isogi_ray ray = {.dir = {dir[0], dir[1], dir[2]}, .isovalue = isovalue};
    isogi_hit hit;
    int count = 0;
    double t = 0;
    for (int a = 0; a < 3; a++) ray.origin[a] = origin[a];
    isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
    while (hit.side && count < 60) {
        isogi_hit next;
        t += hit.t;
        out[count].t = t, out[count++].side = hit.side;
        isogi_vol_continue(pyramid, &hit, (const float(*)[3])dir, NULL, isovalue, 0, 1, &next, NULL);
        hit = next;
    }
    return count;
}

#endif
