/* First hits from lattice plane to lattice plane in double: a hundred times as fast as reference_ray.h, and knows when it does not know. */
#ifndef ISOGI_REFERENCE_QUICK_H
#define ISOGI_REFERENCE_QUICK_H

#include "reference_ray.h"

/* t: between which the hit lies; the field has one root there. */
typedef struct quick_truth { int side, decided; double t[2]; } quick_truth;

/* Side of a face of the cell as a whole: 1 inside, 0 outside, -1 both. axis < 0: none. */
static int face_side(const double c[8], int axis, int upper) {
    int inside = 0;
    if (axis < 0) return -1;
    for (int i = 0; i < 8; i++)
        if ((i >> axis & 1) == upper) inside += c[i] >= 0;
    return inside == 4 ? 1 : inside == 0 ? 0 : -1;
}

/* Change of side along one cell: 1 with *inside turned and the part of the way in which that is, 0, or -1: too near to say. Values are
   compared with the tolerance, except at the exit through a face whose corners agree. */
static int quick_cell(const double c[8], const double from[3], const double to[3], int exit_side, double tolerance, int *inside,
                      double part[2]) {
    double v[4], k1, k2, k3, disc, at[3], turn[4] = {0, 1, 1, 1};
    int n = 0;
    for (int j = 0; j < 4; j++) {
        double p[3], f[4];
        for (int a = 0; a < 3; a++) p[a] = from[a] + (to[a] - from[a]) * j / 3;
        for (int i = 0; i < 4; i++) f[i] = (1 - p[0]) * c[2 * i] + p[0] * c[2 * i + 1];
        v[j] = (1 - p[2]) * ((1 - p[1]) * f[0] + p[1] * f[1]) + p[2] * ((1 - p[1]) * f[2] + p[1] * f[3]);
    }
    if (*inside < 0) {
        if (fabs(v[0]) <= tolerance) return -1;
        *inside = v[0] >= 0;
    }
    k1 = (-11 * v[0] + 18 * v[1] - 9 * v[2] + 2 * v[3]) / 2, k2 = (18 * v[0] - 45 * v[1] + 36 * v[2] - 9 * v[3]) / 2;
    k3 = (-9 * v[0] + 27 * v[1] - 27 * v[2] + 9 * v[3]) / 2;
    disc = k2 * k2 - 3 * k1 * k3;
    if (disc >= 0) {
        const double q = -(k2 + (k2 < 0 ? -sqrt(disc) : sqrt(disc)));
        const double r[2] = {k3 != 0 ? q / (3 * k3) : 2, q != 0 ? k1 / q : 2};
        for (int i = 0; i < 2; i++) { /* in order */
            const double x = (r[0] < r[1]) == (i == 0) ? r[0] : r[1];
            if (x > 0 && x < 1) turn[n + 1] = x, at[n++] = v[0] + x * (k1 + x * (k2 + x * k3));
        }
    }
    turn[n + 1] = 1, at[n++] = exit_side < 0 ? v[3] : exit_side ? 2 * tolerance : -2 * tolerance;
    for (int i = 0; i < n; i++) {
        if (fabs(at[i]) <= tolerance) return -1;
        if ((at[i] >= 0) != *inside) return *inside = !*inside, part[0] = turn[i], part[1] = turn[i + 1], 1;
    }
    return 0;
}

/* origin, dir in grid coordinates; tmax 0: none. The field's tolerance must cover the rounding of places and values in double. */
static quick_truth quick_intersect(const reference_field *f, const double origin[3], const double dir[3], double tmin, double tmax,
                                   double isovalue) {
    quick_truth truth = {0, 1, {0, 0}};
    const double tolerance = (double)f->tolerance;
    double t = tmin, end = tmax > 0 ? tmax : 1e300;
    int cell[3], inside = -1, axis = -1;
    for (int a = 0; a < 3; a++) {
        const double low = -origin[a], high = f->size[a] - 1 - origin[a];
        if (fabs(dir[a]) < 1e-30) return truth.decided = 0, truth;
        t = fmax(t, (dir[a] > 0 ? low : high) / dir[a]), end = fmin(end, (dir[a] > 0 ? high : low) / dir[a]);
    }
    if (t > end) return truth.decided = end - t < -1e-9, truth;
    for (int a = 0; a < 3; a++) {
        const double x = origin[a] + t * dir[a], nearest = fabs(x - floor(x + 0.5));
        /* begins at a lattice plane: which cell is first is not known; at the border of the box it is */
        cell[a] = x > 0 ? x < f->size[a] - 1 ? (int)x : f->size[a] - 2 : 0;
        if (nearest < 1e-12 && cell[a] > 0 && cell[a] < f->size[a] - 2) truth.decided = 0;
    }
    while (truth.decided) {
        double c[8], out = end, from[3], to[3], part[2];
        int below = 0, changed;
        const double *corner = f->value + cell[0] + f->size[0] * (cell[1] + f->size[1] * cell[2]);
        axis = -1;
        for (int a = 0; a < 3; a++) {
            const double at = (cell[a] + (dir[a] > 0) - origin[a]) / dir[a];
            if (at < out) out = at, axis = a;
        }
        out = fmax(out, t);
        for (int i = 0; i < 8; i++) {
            c[i] = corner[(i & 1) + f->size[0] * ((i >> 1 & 1) + f->size[1] * (i >> 2))] - isovalue;
            below += c[i] < 0;
        }
        if (below == 0 || below == 8) {
            if (inside == (below == 8)) return truth.side = inside ? -1 : 1, truth.t[0] = truth.t[1] = t, truth;
            inside = below == 0;
        } else {
            for (int a = 0; a < 3; a++) {
                from[a] = fmin(fmax(origin[a] + t * dir[a] - cell[a], 0), 1),
                to[a] = fmin(fmax(origin[a] + out * dir[a] - cell[a], 0), 1);
            }
            changed = quick_cell(c, from, to, axis < 0 ? -1 : face_side(c, axis, dir[axis] > 0), tolerance, &inside, part);
            if (changed < 0) truth.decided = 0;
            if (changed > 0) {
                for (int k = 0; k < 2; k++) truth.t[k] = t + (out - t) * part[k];
                return truth.side = inside ? 1 : -1, truth;
            }
        }
        if (axis < 0) break;
        cell[axis] += dir[axis] > 0 ? 1 : -1, t = out;
        if (cell[axis] < 0 || cell[axis] > f->size[axis] - 2) break;
    }
    return truth;
}

#endif
