/* The obviously right intersector: every crossing of the ray with a lattice plane is found, sorted, and between two of them the
   field is a cubic, followed in long double from critical point to critical point. No skipping, no Newton, no state. */
#ifndef ISOGI_REFERENCE_RAY_H
#define ISOGI_REFERENCE_RAY_H

#include "isogi_vol.h"
#include <math.h>
#include <stdlib.h>

typedef long double real;

typedef struct reference_field {
    const double *value; /* x fastest */
    int size[3];
    real tolerance; /* values nearer to the isovalue than this leave a case undecided */
} reference_field;

typedef struct reference_hit {
    int side;    /* as in isogi_hit; 0 = miss */
    real t;
    int decided; /* 0: somewhere before t, or at the end, the field comes within the tolerance of the isovalue without a clear crossing */
} reference_hit;

static real reference_value(const reference_field *f, const int cell[3], const real p[3], real isovalue) {
    real sum = 0;
    for (int i = 0; i < 8; i++) {
        int x = cell[0] + (i & 1), y = cell[1] + (i >> 1 & 1), z = cell[2] + (i >> 2);
        real u = p[0] - cell[0], v = p[1] - cell[1], w = p[2] - cell[2];
        real weight = (i & 1 ? u : 1 - u) * (i & 2 ? v : 1 - v) * (i & 4 ? w : 1 - w);
        sum += weight * ((real)f->value[x + f->size[0] * (y + f->size[1] * z)] - isovalue);
    }
    return sum;
}

static int reference_compare(const void *a, const void *b) {
    real x = *(const real *)a, y = *(const real *)b;
    return (x > y) - (x < y);
}

/* The parameters at which the ray meets lattice planes within [t0, t1], sorted, both ends included; their number. */
static int reference_planes(const reference_field *f, const real o[3], const real d[3], real t0, real t1, real *t) {
    int n = 0;
    t[n++] = t0;
    for (int a = 0; a < 3; a++)
        for (int plane = 0; plane < f->size[a] && d[a] != 0; plane++) {
            real at = (plane - o[a]) / d[a];
            if (at > t0 && at < t1) t[n++] = at;
        }
    t[n++] = t1;
    qsort(t, (size_t)n, sizeof *t, reference_compare);
    return n;
}

static real reference_root(const real c[4], real low, real high, int inside) {
    for (int i = 0; i < 80; i++) {
        real s = (low + high) / 2, v = c[0] + s * (c[1] + s * (c[2] + s * c[3]));
        if ((v >= 0) == inside) low = s;
        else high = s;
    }
    return (low + high) / 2;
}

/* First change of inside along one segment of one cell; 0 if none. *near counts critical values within the tolerance. */
static int reference_segment(const reference_field *f, const real c[4], int inside, real *root, int *near) {
    real at[4] = {0, 1, 1, 1};
    int n = 1;
    real disc = c[2] * c[2] - 3 * c[1] * c[3];
    if (disc >= 0) {
        real q = -(c[2] + (c[2] < 0 ? -sqrtl(disc) : sqrtl(disc)));
        real r[2] = {c[3] != 0 ? q / (3 * c[3]) : 2, q != 0 ? c[1] / q : 2};
        if (r[0] > r[1]) { real swap = r[0]; r[0] = r[1], r[1] = swap; }
        for (int i = 0; i < 2; i++)
            if (r[i] > 0 && r[i] < 1) at[n++] = r[i];
    }
    at[n++] = 1;
    for (int i = 1; i < n; i++) {
        real s = at[i], v = c[0] + s * (c[1] + s * (c[2] + s * c[3]));
        if (fabsl(v) <= f->tolerance) ++*near;
        else if ((v >= 0) != inside) {
            *root = reference_root(c, at[i - 1], s, inside);
            return 1;
        }
    }
    return 0;
}

/* o, d in grid coordinates. */
__attribute__((unused)) static reference_hit reference_intersect(const reference_field *f, const double origin[3], const double dir[3],
                                                                 double tmin, double tmax, double isovalue) {
    reference_hit hit = {0, 0, 1};
    real o[3], d[3], t0 = (real)tmin, t1 = tmax > 0 ? (real)tmax : 1e30L, t[4096];
    int near = 0, inside = -1;
    for (int a = 0; a < 3; a++) {
        o[a] = (real)origin[a], d[a] = (real)dir[a];
        real low = -o[a], high = (real)(f->size[a] - 1) - o[a];
        if (d[a] == 0 && (low > 0 || high < 0)) return hit;
        if (d[a] == 0) continue;
        real near_t = (d[a] > 0 ? low : high) / d[a], far_t = (d[a] > 0 ? high : low) / d[a];
        if (near_t > t0) t0 = near_t;
        if (far_t < t1) t1 = far_t;
    }
    if (t0 > t1) return hit;
    int n = reference_planes(f, o, d, t0, t1, t);
    for (int i = 0; i + 1 < n; i++) {
        real length = t[i + 1] - t[i], v[4], c[4], root;
        int cell[3];
        for (int a = 0; a < 3; a++) {
            real middle = o[a] + d[a] * (t[i] + length / 2);
            cell[a] = (int)floorl(middle);
            if (cell[a] < 0) cell[a] = 0;
            if (cell[a] > f->size[a] - 2) cell[a] = f->size[a] - 2;
        }
        for (int k = 0; k < 4; k++) {
            real p[3];
            for (int a = 0; a < 3; a++) p[a] = o[a] + d[a] * (t[i] + length * k / 3);
            v[k] = reference_value(f, cell, p, (real)isovalue);
        }
        c[0] = v[0];
        c[1] = (-11 * v[0] + 18 * v[1] - 9 * v[2] + 2 * v[3]) / 2;
        c[2] = (18 * v[0] - 45 * v[1] + 36 * v[2] - 9 * v[3]) / 2;
        c[3] = (-9 * v[0] + 27 * v[1] - 27 * v[2] + 9 * v[3]) / 2;
        if (inside < 0) {
            if (fabsl(v[0]) <= f->tolerance) near++;
            inside = v[0] >= 0;
        }
        if (reference_segment(f, c, inside, &root, &near)) {
            hit.side = inside ? -1 : 1, hit.t = t[i] + root * length, hit.decided = !near;
            return hit;
        }
    }
    hit.decided = !near;
    return hit;
}

/* Whether a hit found at t is the one that is truly at `truth`, not one behind it: within 1e-6 cells, or, where the ray grazes, not parted
   from it by values that differ from the isovalue by more than `least`. */
__attribute__((unused)) static int reference_same_hit(const reference_field *f, const double origin[3], const double dir[3],
                                                      double isovalue, double t, real truth, real least) {
    enum { PLACES = 16 };
    real most = 0;
    for (int a = 0; a < 3; a++) most = fmaxl(most, fabsl((real)dir[a]));
    for (int k = 0; k <= PLACES && fabsl(truth - (real)t) * most > 1e-6L; k++) {
        real p[3];
        int cell[3];
        for (int a = 0; a < 3; a++) {
            p[a] = (real)origin[a] + (real)dir[a] * (truth + ((real)t - truth) * k / PLACES), cell[a] = (int)floorl(p[a]);
            cell[a] = cell[a] < 0 ? 0 : cell[a] > f->size[a] - 2 ? f->size[a] - 2 : cell[a];
        }
        if (fabsl(reference_value(f, cell, p, (real)isovalue)) > least) return 0;
    }
    return 1;
}

#endif
