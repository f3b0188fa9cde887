/* How isosurface rays are usually traced, for comparison: four ways to look for a surface inside of a cell or a block, under the same
   walk over the blocks of 4^3 cells whose range holds the isovalue. None of them certifies what it finds. */
#ifndef USUAL_RAYS_H
#define USUAL_RAYS_H

#include "isogi_vol.h"
#include <math.h>
#include <string.h>

/* float: cell cubics in float, parted at their extrema, Newton inside brackets; double: the same in double; marching: steps of
   half a voxel through active blocks, then bisection between the last two; cardano: the closed form of the cubic's roots, in double. */
typedef enum usual_method { USUAL_FLOAT, USUAL_DOUBLE, USUAL_MARCHING, USUAL_CARDANO, USUAL_METHODS } usual_method;

typedef struct usual_ray {
    const float *data;
    int n; /* voxels a side; data are packed floats */
    double origin[3], dir[3], isovalue; /* grid units */
} usual_ray;

static void usual_corners(const usual_ray *r, const int cell[3], double c[8]) {
    const float *p = r->data + cell[0] + r->n * (cell[1] + (ptrdiff_t)r->n * cell[2]);
    const ptrdiff_t y = r->n, z = y * y;
    c[0] = (double)p[0], c[1] = (double)p[1], c[2] = (double)p[y], c[3] = (double)p[y + 1];
    c[4] = (double)p[z], c[5] = (double)p[z + 1], c[6] = (double)p[z + y], c[7] = (double)p[z + y + 1];
    for (int i = 0; i < 8; i++) c[i] -= r->isovalue;
}

static double usual_sample(const usual_ray *r, double t) {
    int cell[3];
    double c[8], u[3];
    for (int a = 0; a < 3; a++) {
        double x = fmin(fmax(r->origin[a] + t * r->dir[a], 0), r->n - 1);
        cell[a] = (int)x < r->n - 2 ? (int)x : r->n - 2, u[a] = x - cell[a];
    }
    usual_corners(r, cell, c);
    for (int i = 0; i < 4; i++) c[i] = c[2 * i] + u[0] * (c[2 * i + 1] - c[2 * i]);
    for (int i = 0; i < 2; i++) c[i] = c[2 * i] + u[1] * (c[2 * i + 1] - c[2 * i]);
    return c[0] + u[2] * (c[1] - c[0]);
}

/* Coefficients of powers of s in [0, 1] along the part of the ray between two places in a cell. */
static void usual_cubic(const double c[8], const double from[3], const double to[3], double k[4]) {
    const double du = to[0] - from[0], dv = to[1] - from[1], dw = to[2] - from[2];
    double a[4], b[4]; /* a + s b on the four lines along x */
    for (int i = 0; i < 4; i++) a[i] = c[2 * i] + from[0] * (c[2 * i + 1] - c[2 * i]), b[i] = du * (c[2 * i + 1] - c[2 * i]);
    double q[2][3];
    for (int i = 0; i < 2; i++) {
        const double a0 = a[2 * i], b0 = b[2 * i], a1 = a[2 * i + 1] - a0, b1 = b[2 * i + 1] - b0;
        q[i][0] = a0 + from[1] * a1, q[i][1] = b0 + from[1] * b1 + dv * a1, q[i][2] = dv * b1;
    }
    const double d0 = q[1][0] - q[0][0], d1 = q[1][1] - q[0][1], d2 = q[1][2] - q[0][2];
    k[0] = q[0][0] + from[2] * d0, k[1] = q[0][1] + from[2] * d1 + dw * d0, k[2] = q[0][2] + from[2] * d2 + dw * d1, k[3] = dw * d2;
}

#define USUAL_SPLIT(REAL, SQRT, NAME, STEPS)                                                                                  \
    static int NAME(const double c[4], int inside, double *root) {                                                                  \
        const REAL k0 = (REAL)c[0], k1 = (REAL)c[1], k2 = (REAL)c[2], k3 = (REAL)c[3];                                              \
        REAL end[3], low = 0, disc = k2 * k2 - 3 * k1 * k3;                                                                         \
        int n = 0;                                                                                                                  \
        if (disc > 0) {                                                                                                             \
            const REAL q = -(k2 + (k2 < 0 ? -SQRT(disc) : SQRT(disc)));                                                             \
            REAL r0 = q / (3 * k3), r1 = k1 / q;                                                                                    \
            if (r0 > r1) { const REAL swap = r0; r0 = r1, r1 = swap; }                                                              \
            if (r0 > 0 && r0 < 1) end[n++] = r0;                                                                                    \
            if (r1 > 0 && r1 < 1) end[n++] = r1;                                                                                    \
        }                                                                                                                           \
        end[n++] = 1;                                                                                                               \
        for (int i = 0; i < n; low = end[i++]) {                                                                                    \
            REAL a = low, b = end[i], s = b, v = k0 + s * (k1 + s * (k2 + s * k3));                                                 \
            if ((v >= 0) == inside) continue;                                                                                       \
            s = (REAL)0.5 * (a + b);                                                                                                \
            for (int step = 0; step < STEPS; step++) {                                                                              \
                v = k0 + s * (k1 + s * (k2 + s * k3));                                                                              \
                if ((v >= 0) == inside) a = s;                                                                                      \
                else b = s;                                                                                                         \
                const REAL next = s - v / (k1 + s * (2 * k2 + s * (3 * k3)));                                                       \
                s = next >= a && next <= b ? next : (REAL)0.5 * (a + b);                                                              \
            }                                                                                                                       \
            *root = (double)s;                                                                                                      \
            return 1;                                                                                                               \
        }                                                                                                                           \
        return 0;                                                                                                                   \
    }
USUAL_SPLIT(float, sqrtf, usual_split_float, 6)
USUAL_SPLIT(double, sqrt, usual_split_double, 8)
#undef USUAL_SPLIT

/* The least root in [0, 1] by Cardano's formula, or the cosine of a third of an angle where there are three. */
static int usual_cardano(const double k[4], double *root) {
    double r[3];
    int n = 0;
    const double size = fabs(k[0]) + fabs(k[1]) + fabs(k[2]);
    if (fabs(k[3]) > 1e-12 * size) {
        const double a = k[2] / k[3], b = k[1] / k[3], c = k[0] / k[3], q = (a * a - 3 * b) / 9,
                     p = (2 * a * a * a - 9 * a * b + 27 * c) / 54;
        if (p * p < q * q * q) {
            const double angle = acos(p / sqrt(q * q * q)), m = -2 * sqrt(q), third = 2.0943951023931953;
            for (int i = 0; i < 3; i++) r[n++] = m * cos(angle / 3 + third * (i - 1)) - a / 3;
        } else {
            const double e = cbrt(fabs(p) + sqrt(p * p - q * q * q)) * (p > 0 ? -1 : 1);
            r[n++] = e + (e != 0 ? q / e : 0) - a / 3;
        }
    } else if (fabs(k[2]) > 1e-12 * size) {
        const double disc = k[1] * k[1] - 4 * k[2] * k[0];
        if (disc >= 0) r[n++] = (-k[1] - sqrt(disc)) / (2 * k[2]), r[n++] = (-k[1] + sqrt(disc)) / (2 * k[2]);
    } else if (k[1] != 0) r[n++] = -k[0] / k[1];
    *root = 2;
    for (int i = 0; i < n; i++)
        if (r[i] >= 0 && r[i] <= 1 && r[i] < *root) *root = r[i];
    return *root <= 1;
}

/* The first change of side in a cell, between the times t and out. */
static int usual_cell(const usual_ray *r, usual_method method, const int cell[3], double t, double out, int *inside, double *hit) {
    double c[8], from[3], to[3], k[4], root;
    int below = 0, found;
    usual_corners(r, cell, c);
    for (int i = 0; i < 8; i++) below += c[i] < 0;
    if (below == 0 || below == 8) {
        const int before = *inside, now = below == 0;
        *inside = now;
        return before >= 0 && before != now ? *hit = t, 1 : 0;
    }
    for (int a = 0; a < 3; a++) {
        from[a] = fmin(fmax(r->origin[a] + t * r->dir[a] - cell[a], 0), 1);
        to[a] = fmin(fmax(r->origin[a] + out * r->dir[a] - cell[a], 0), 1);
    }
    usual_cubic(c, from, to, k);
    if (*inside < 0) *inside = k[0] >= 0;
    found = method == USUAL_CARDANO ? usual_cardano(k, &root)
                                    : method == USUAL_FLOAT ? usual_split_float(k, *inside, &root) : usual_split_double(k, *inside, &root);
    if (found) *hit = t + root * (out - t);
    return found;
}

/* Steps from t to out through a block; *value: what the field was at the last sample. */
static int usual_march(const usual_ray *r, double t, double out, int *inside, double *last, double *hit) {
    const double length = sqrt(r->dir[0] * r->dir[0] + r->dir[1] * r->dir[1] + r->dir[2] * r->dir[2]), step = 0.5 / length;
    if (*inside < 0) *inside = usual_sample(r, t) >= 0, *last = t;
    for (double at = *last + step; at < out + step; at += step) {
        const double here = at < out ? at : out;
        if ((usual_sample(r, here) >= 0) != *inside) {
            double low = *last, high = here;
            for (int i = 0; i < 12; i++) {
                const double middle = 0.5 * (low + high);
                if ((usual_sample(r, middle) >= 0) == *inside) low = middle;
                else high = middle;
            }
            return *hit = 0.5 * (low + high), 1;
        }
        *last = here;
    }
    return 0;
}

/* First hit of a ray in world units; 0: none. */
static int usual_trace(const isogi_pyramid *p, usual_method method, const isogi_ray *ray, double *hit) {
    const isogi_volume *v = isogi_vol_volume(p);
    const isogi_level level = isogi_vol_level(p, 0);
    const int cells = (int)v->size[0] - 1;
    usual_ray r;
    double t = ray->tmin, end = 1e300, last = 0;
    int cell[3], inside = -1;
    memset(&r, 0, sizeof r);
    r.data = (const float *)v->data, r.n = cells + 1, r.isovalue = ray->isovalue;
    isogi_vol_to_grid(p, ray->origin, r.origin);
    for (int a = 0; a < 3; a++) {
        r.dir[a] = (double)ray->dir[a] / v->spacing[a];
        const double t0 = -r.origin[a] / r.dir[a], t1 = (cells - r.origin[a]) / r.dir[a];
        t = fmax(t, fmin(t0, t1)), end = fmin(end, fmax(t0, t1));
    }
    if (!(t < end)) return 0;
    for (int a = 0; a < 3; a++) {
        const double x = fmin(fmax(r.origin[a] + t * r.dir[a], 0), cells);
        cell[a] = (int)x < cells ? (int)x : cells - 1;
    }
    while (t < end) {
        const float *range =
            level.range[(size_t)(cell[0] >> 2) + level.size[0] * ((size_t)(cell[1] >> 2) + level.size[1] * (size_t)(cell[2] >> 2))];
        const int active = (double)range[0] < ray->isovalue && (double)range[1] >= ray->isovalue,
                  whole = !active || method == USUAL_MARCHING;
        double out = 1e300;
        int axis = 0;
        for (int a = 0; a < 3; a++) {
            const int low = whole ? cell[a] & ~3 : cell[a], plane = r.dir[a] > 0 ? low + (whole ? 4 : 1) : low;
            const double at = ((plane < cells ? plane : cells) - r.origin[a]) / r.dir[a];
            if (at < out) out = at, axis = a;
        }
        out = fmax(out, t);
        if (!active) {
            const int now = (double)range[0] >= ray->isovalue;
            if (inside >= 0 && inside != now) return *hit = t, 1;
            inside = now, last = out;
        } else if (method == USUAL_MARCHING ? usual_march(&r, t, fmin(out, end), &inside, &last, hit)
                                            : usual_cell(&r, method, cell, t, fmin(out, end), &inside, hit)) return 1;
        for (int a = 0; a < 3; a++) {
            const int low = whole ? cell[a] & ~3 : cell[a], high = low + (whole ? 4 : 1) < cells ? low + (whole ? 4 : 1) : cells;
            if (a == axis) cell[a] = r.dir[a] > 0 ? high : low - 1;
            else {
                const int c = (int)fmin(fmax(r.origin[a] + out * r.dir[a], low), high);
                cell[a] = c < high ? c : high - 1;
            }
        }
        if (cell[axis] < 0 || cell[axis] >= cells) break;
        t = out;
    }
    return 0;
}

#endif
