/* Scenes for rays, and the reference of reference_ray.h once more in 113-bit numbers where the compiler has them (else in long double):
   from the world's ray, with cells that have no surface, and exact at the isovalue itself. For test programs that have included
   "isogi_vol.h" and "test.h". */
#ifndef ISOGI_REFERENCE_WIDE_H
#define ISOGI_REFERENCE_WIDE_H

#include "reference_ray.h"

#if defined(__GNUC__) && !defined(__clang__) && defined(__SIZEOF_FLOAT128__)
__extension__ typedef __float128 wide;
#define WIDE_BITS 113
#define WIDE_SNAP 1e-26       /* of a cell: what is nearer to a plane of the lattice lies in it */
#define WIDE_ROUNDING 0x1p-50 /* of what double rounds by */
#else
typedef long double wide;
#define WIDE_BITS 64
#define WIDE_SNAP 1e-14
#define WIDE_ROUNDING 0x1p-8
#endif

/* Without libquadmath, which not every processor has: a root from double by three Newton steps, for values whose square is in range. */
__attribute__((unused)) static wide wide_sqrt(wide x) {
    wide root = (wide)sqrt((double)x);
    if (!(root > 0)) return 0;
    for (int i = 0; i < 3; i++) root = (root + x / root) / 2;
    return root;
}

__attribute__((unused)) static wide wide_floor(wide x) {
    wide whole = (wide)(long long)x;
    return whole > x ? whole - 1 : whole;
}

enum { PATHS = 7 };

/* ---- volumes, one pyramid for every instruction path ---- */

typedef struct scene {
    int size[3];
    double *value; /* as the library decodes it */
    double most;   /* largest |value| that is finite */
    void *raw;
    isogi_volume volume;
    isogi_pyramid *pyramid[PATHS];
} scene;

__attribute__((unused)) static size_t scene_voxels(const scene *s) { return (size_t)s->size[0] * (size_t)s->size[1] * (size_t)s->size[2]; }

__attribute__((unused)) static scene scene_new(int x, int y, int z) {
    scene s;
    memset(&s, 0, sizeof s);
    s.size[0] = x, s.size[1] = y, s.size[2] = z;
    s.value = (double *)calloc(scene_voxels(&s), sizeof(double));
    s.volume.data = s.value, s.volume.type = ISOGI_F64;
    for (int a = 0; a < 3; a++) s.volume.size[a] = (size_t)s.size[a];
    return s;
}

__attribute__((unused)) static void scene_build(scene *s) {
    for (size_t i = 0; i < scene_voxels(s); i++)
        if (isfinite(s->value[i])) s->most = fmax(s->most, fabs(s->value[i]));
    for (int p = 0; p < PATHS; p++) {
        isogi_context context = {.threads = 1, .force_path = forced_path(p)};
        s->volume.compact = p > 4;
        isogi_result result = isogi_vol_build(&s->pyramid[p], &s->volume, &context);
        CHECK(result == ISOGI_OK, "path %d: %s", p, isogi_result_string(result));
    }
}

__attribute__((unused)) static void scene_free(scene *s) {
    for (int p = 0; p < PATHS; p++) isogi_vol_free(s->pyramid[p]);
    free(s->value), free(s->raw);
}

/* Voxels of another type; the values become what they decode to. */
__attribute__((unused)) static void scene_encode(scene *s, isogi_type type, double scale, double bias) {
    size_t n = scene_voxels(s);
    double factor = scale == 0 ? 1 : scale;
    s->raw = calloc(n, 8);
    s->volume.data = s->raw, s->volume.type = type, s->volume.scale = scale, s->volume.bias = bias;
    for (size_t i = 0; i < n; i++) {
        double raw = floor(40 + 20 * s->value[i]), kept = raw;
        if (type == ISOGI_U8) ((uint8_t *)s->raw)[i] = (uint8_t)raw;
        if (type == ISOGI_I8) ((int8_t *)s->raw)[i] = (int8_t)raw;
        if (type == ISOGI_U16) ((uint16_t *)s->raw)[i] = (uint16_t)raw;
        if (type == ISOGI_I16) kept = -raw, ((int16_t *)s->raw)[i] = (int16_t)kept;
        if (type == ISOGI_F32) ((float *)s->raw)[i] = (float)(s->value[i]), kept = (double)((float *)s->raw)[i];
        if (type == ISOGI_F64) ((double *)s->raw)[i] = kept = s->value[i];
        s->value[i] = factor * kept + bias;
    }
}

__attribute__((unused)) static void scene_noise(scene *s, int levels, test_random *r) {
    for (size_t i = 0; i < scene_voxels(s); i++) {
        double v = random_range(r, -1, 1);
        s->value[i] = levels ? floor(v * levels) / levels : v;
    }
}

/* So smooth that most blocks lie on one side and are skipped. */
__attribute__((unused)) static void scene_waves(scene *s, test_random *r) {
    double wave[4];
    for (int a = 0; a < 4; a++) wave[a] = random_range(r, 0.02, 0.2);
    for (size_t i = 0; i < scene_voxels(s); i++) {
        size_t x = i % (size_t)s->size[0], y = i / (size_t)s->size[0] % (size_t)s->size[1], z = i / (size_t)s->size[0] / (size_t)s->size[1];
        s->value[i] = sin(wave[0] * (double)x + wave[1] * (double)y + wave[2] * (double)z + 20 * wave[3]);
    }
}

/* ---- the reference in wide numbers ---- */

typedef struct wide_ray { wide o[3], d[3]; } wide_ray;

__attribute__((unused)) static wide_ray to_grid(const scene *s, const isogi_ray *ray) {
    wide_ray g;
    for (int a = 0; a < 3; a++) {
        wide h = (wide)(s->volume.spacing[a] > 0 ? s->volume.spacing[a] : 1);
        g.o[a] = ((wide)ray->origin[a] - (wide)s->volume.origin[a]) / h, g.d[a] = (wide)ray->dir[a] / h;
    }
    return g;
}

/* The cell's value minus the isovalue; *finite: whether the cell has a surface at all. */
__attribute__((unused)) static wide wide_value(const scene *s, const int cell[3], const wide p[3], double isovalue, int *finite) {
    wide sum = 0;
    for (int i = 0; i < 8; i++) {
        int x = cell[0] + (i & 1), y = cell[1] + (i >> 1 & 1), z = cell[2] + (i >> 2);
        wide u = p[0] - (wide)cell[0], v = p[1] - (wide)cell[1], w = p[2] - (wide)cell[2];
        double corner = s->value[(size_t)x + (size_t)s->size[0] * ((size_t)y + (size_t)s->size[1] * (size_t)z)];
        if (!isfinite(corner)) *finite = 0;
        else sum += (i & 1 ? u : 1 - u) * (i & 2 ? v : 1 - v) * (i & 4 ? w : 1 - w) * ((wide)corner - (wide)isovalue);
    }
    return sum;
}

__attribute__((unused)) static void wide_cell(const scene *s, const wide_ray *g, wide t, int cell[3]) {
    for (int a = 0; a < 3; a++) {
        wide at = wide_floor(g->o[a] + g->d[a] * t);
        cell[a] = at < 0 ? 0 : at > (wide)(s->size[a] - 2) ? s->size[a] - 2 : (int)at;
    }
}

__attribute__((unused)) static wide wide_at(const scene *s, const wide_ray *g, const int cell[3], wide t, double isovalue, int *finite) {
    wide p[3];
    for (int a = 0; a < 3; a++) {
        p[a] = g->o[a] + g->d[a] * t;
        wide whole = wide_floor(p[a] + 0.5), off = p[a] - whole; /* at a plane of the lattice: by its voxels alone */
        if (off < WIDE_SNAP && off > -WIDE_SNAP) p[a] = whole;
    }
    return wide_value(s, cell, p, isovalue, finite);
}

__attribute__((unused)) static int wide_compare(const void *a, const void *b) {
    wide x = *(const wide *)a, y = *(const wide *)b;
    return (x > y) - (x < y);
}

__attribute__((unused)) static int wide_planes(const scene *s, const wide_ray *g, wide t0, wide t1, wide *t) {
    int n = 0;
    t[n++] = t0;
    for (int a = 0; a < 3; a++)
        for (int plane = 0; plane < s->size[a] && (g->d[a] > 0 || g->d[a] < 0); plane++) {
            wide at = ((wide)plane - g->o[a]) / g->d[a];
            if (at > t0 && at < t1) t[n++] = at;
        }
    t[n++] = t1;
    qsort(t, (size_t)n, sizeof *t, wide_compare);
    return n;
}

/* Places within (0, 1) at which the cubic through v (at 0, 1/3, 2/3, 1) turns, then 1; their number. c: its coefficients. */
__attribute__((unused)) static int wide_turns(const wide v[4], wide c[4], wide at[3]) {
    int n = 0;
    c[0] = v[0], c[1] = (-11 * v[0] + 18 * v[1] - 9 * v[2] + 2 * v[3]) / 2;
    c[2] = (18 * v[0] - 45 * v[1] + 36 * v[2] - 9 * v[3]) / 2, c[3] = (-9 * v[0] + 27 * v[1] - 27 * v[2] + 9 * v[3]) / 2;
    wide disc = c[2] * c[2] - 3 * c[1] * c[3];
    if (disc >= 0) {
        wide root = wide_sqrt(disc), q = -(c[2] + (c[2] < 0 ? -root : root));
        int cubic = c[3] > 0 || c[3] < 0, linear = q > 0 || q < 0;
        wide r[2] = {cubic ? q / (3 * c[3]) : 2, linear ? c[1] / q : 2};
        if (r[0] > r[1]) { wide swap = r[0]; r[0] = r[1], r[1] = swap; }
        for (int i = 0; i < 2; i++)
            if (r[i] > 0 && r[i] < 1) at[n++] = r[i];
    }
    at[n++] = 1;
    return n;
}

/* Whether a value is inside. Nearer to zero than the tolerance it may be either, as `near` has it; zero itself is no rounded number: all
   corners that count are at the isovalue. */
__attribute__((unused)) static int wide_inside(wide value, wide tolerance, int near) {
    if (value > tolerance || value < -tolerance) return value > 0;
    return value > 0 || value < 0 ? near : 1;
}

/* First hit, if all that is within the tolerance is inside (near 1) or outside (0). */
__attribute__((unused)) static reference_hit wide_read(const scene *s, const isogi_ray *ray, wide tolerance, int near) {
    reference_hit hit = {0, 0, 1};
    wide_ray g = to_grid(s, ray);
    wide t0 = (wide)ray->tmin, t1 = ray->tmax > 0 ? (wide)ray->tmax : (wide)1e30, t[1024], v[4], c[4], at[3];
    int inside = -1, cell[3];
    for (int a = 0; a < 3; a++) {
        wide low = -g.o[a], high = (wide)(s->size[a] - 1) - g.o[a];
        if (!(g.d[a] > 0 || g.d[a] < 0)) {
            if (low > 0 || high < 0) return hit;
            continue;
        }
        wide first = (g.d[a] > 0 ? low : high) / g.d[a], last = (g.d[a] > 0 ? high : low) / g.d[a];
        t0 = first > t0 ? first : t0, t1 = last < t1 ? last : t1;
    }
    if (t0 > t1) return hit;
    int n = wide_planes(s, &g, t0, t1, t);
    for (int i = 0; i + 1 < n; i++) {
        wide length = t[i + 1] - t[i];
        int finite = 1;
        wide_cell(s, &g, t[i] + length / 2, cell);
        for (int k = 0; k < 4; k++) v[k] = wide_at(s, &g, cell, t[i] + length * (wide)k / 3, ray->isovalue, &finite);
        if (!finite) { inside = -1; continue; }
        if (inside < 0) inside = wide_inside(v[0], tolerance, near);
        int turns = wide_turns(v, c, at);
        for (int k = -1; k < turns; k++) {
            wide low = k > 0 ? at[k - 1] : 0, high = k < 0 ? 0 : at[k];
            wide value = k < 0 ? v[0] : k == turns - 1 ? v[3] : c[0] + high * (c[1] + high * (c[2] + high * c[3]));
            if (wide_inside(value, tolerance, near) == inside) continue;
            for (int b = 0; b < 120; b++) {
                wide middle = (low + high) / 2;
                if (wide_inside(c[0] + middle * (c[1] + middle * (c[2] + middle * c[3])), tolerance, near) == inside) low = middle;
                else high = middle;
            }
            hit.side = inside ? -1 : 1, hit.t = (real)(t[i] + low * length);
            return hit;
        }
    }
    return hit;
}

/* What double cannot know: the field moves by its slope (at most twice the largest difference, over three axes) times the rounding of
   a place (a few ulp of the farthest coordinate), and by a few ulp of the values themselves. */
__attribute__((unused)) static double rounding(const scene *s, const isogi_ray *ray) {
    wide_ray g = to_grid(s, ray);
    double farthest = 1;
    for (int a = 0; a < 3; a++) farthest = fmax(farthest, fmax((double)s->size[a], fabs((double)g.o[a])));
    return 32 * 0x1p-53 * (s->most + fabs(ray->isovalue)) * (1 + farthest) * ROUNDING_FACTOR;
}

/* Cells along the axis that the ray passes fastest, for a step of 1 in t. */
__attribute__((unused)) static double wide_speed(const scene *s, const isogi_ray *ray) {
    wide_ray g = to_grid(s, ray);
    double most = 0;
    for (int a = 0; a < 3; a++) most = fmax(most, fabs((double)g.d[a]));
    return most;
}

/* First hit; undecided if it depends on which side of the isovalue those values lie that wide numbers cannot tell from it. */
__attribute__((unused)) static reference_hit wide_intersect(const scene *s, const isogi_ray *ray) {
    const wide tolerance = (wide)rounding(s, ray) * (wide)WIDE_ROUNDING;
    reference_hit hit = wide_read(s, ray, tolerance, 1), other = wide_read(s, ray, tolerance, 0);
    hit.decided = hit.side == other.side && fabs((double)(hit.t - other.t)) * wide_speed(s, ray) < (WIDE_BITS == 113 ? 1e-9 : 1e-2);
    return hit;
}

/* Whether a hit found at t is the one that is truly at `truth`, not one behind it: as near as double tells, or, where the ray grazes, not
   parted from it by values that differ from the isovalue. */
__attribute__((unused)) static int wide_same_hit(const scene *s, const isogi_ray *ray, double t, real truth) {
    enum { PLACES = 16 };
    wide_ray g = to_grid(s, ray);
    double farthest = 0;
    for (int a = 0; a < 3; a++) farthest = fmax(farthest, fabs((double)g.o[a]));
    if (fabs((double)(truth - (real)t)) * wide_speed(s, ray) < 1e-9 + 1e-15 * farthest) return 1;
    for (int k = 0; k <= PLACES; k++) {
        wide at = (wide)truth + ((wide)t - (wide)truth) * k / PLACES;
        int cell[3], finite = 1;
        wide_cell(s, &g, at, cell);
        if (fabs((double)wide_at(s, &g, cell, at, ray->isovalue, &finite)) > 100 * rounding(s, ray) || !finite) return 0;
    }
    return 1;
}

#endif
