/* Rays where rounding matters most: grazing, along the lattice, in extreme units, through every voxel type and every instruction path.
   What long double leaves undecided is decided in 113-bit numbers where the compiler has them. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "reference_ray.h"
#include "test.h"
#if defined(__unix__)
#include <sys/mman.h>
#endif

#if defined(__GNUC__) && !defined(__clang__) && defined(__SIZEOF_FLOAT128__)
__extension__ typedef __float128 wide;
#define WIDE_BITS 113
#else
typedef long double wide;
#define WIDE_BITS 64
#endif

/* Without libquadmath, which not every processor has: a root from double by three Newton steps, for values whose square is in range. */
static wide wide_sqrt(wide x) {
    wide root = (wide)sqrt((double)x);
    if (!(root > 0)) return 0;
    for (int i = 0; i < 3; i++) root = (root + x / root) / 2;
    return root;
}

static wide wide_floor(wide x) {
    wide whole = (wide)(long long)x;
    return whole > x ? whole - 1 : whole;
}

enum { PATHS = 5, BATCH = 500 };

/* ---- volumes, one pyramid for every instruction path ---- */

typedef struct scene {
    int size[3];
    double *value; /* as the library decodes it */
    double most;   /* largest |value| that is finite */
    void *raw;
    isogi_volume volume;
    isogi_pyramid *pyramid[PATHS];
} scene;

static size_t scene_voxels(const scene *s) { return (size_t)s->size[0] * (size_t)s->size[1] * (size_t)s->size[2]; }

static scene scene_new(int x, int y, int z) {
    scene s;
    memset(&s, 0, sizeof s);
    s.size[0] = x, s.size[1] = y, s.size[2] = z;
    s.value = (double *)calloc(scene_voxels(&s), sizeof(double));
    s.volume.data = s.value, s.volume.type = ISOGI_F64;
    for (int a = 0; a < 3; a++) s.volume.size[a] = (size_t)s.size[a];
    return s;
}

static void scene_build(scene *s) {
    for (size_t i = 0; i < scene_voxels(s); i++)
        if (isfinite(s->value[i])) s->most = fmax(s->most, fabs(s->value[i]));
    for (int p = 0; p < PATHS; p++) {
        isogi_context context = {.threads = 1, .force_path = p};
        isogi_result result = isogi_vol_build(&s->pyramid[p], &s->volume, &context);
        CHECK(result == ISOGI_OK, "path %d: %s", p, isogi_result_string(result));
    }
}

static void scene_free(scene *s) {
    for (int p = 0; p < PATHS; p++) isogi_vol_free(s->pyramid[p]);
    free(s->value), free(s->raw);
}

/* Voxels of another type; the values become what they decode to. */
static void scene_encode(scene *s, isogi_type type, double scale, double bias) {
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

static void scene_noise(scene *s, int levels, test_random *r) {
    for (size_t i = 0; i < scene_voxels(s); i++) {
        double v = random_range(r, -1, 1);
        s->value[i] = levels ? floor(v * levels) / levels : v;
    }
}

/* So smooth that most blocks lie on one side and are skipped. */
static void scene_waves(scene *s, test_random *r) {
    double wave[4];
    for (int a = 0; a < 4; a++) wave[a] = random_range(r, 0.02, 0.2);
    for (size_t i = 0; i < scene_voxels(s); i++) {
        size_t x = i % (size_t)s->size[0], y = i / (size_t)s->size[0] % (size_t)s->size[1], z = i / (size_t)s->size[0] / (size_t)s->size[1];
        s->value[i] = sin(wave[0] * (double)x + wave[1] * (double)y + wave[2] * (double)z + 20 * wave[3]);
    }
}

/* ---- the reference in wide numbers: as reference_ray.h, from the world's ray, with cells that have no surface ---- */

typedef struct wide_ray { wide o[3], d[3]; } wide_ray;

static wide_ray to_grid(const scene *s, const isogi_ray *ray) {
    wide_ray g;
    for (int a = 0; a < 3; a++) {
        wide h = (wide)(s->volume.spacing[a] > 0 ? s->volume.spacing[a] : 1);
        g.o[a] = ((wide)ray->origin[a] - (wide)s->volume.origin[a]) / h, g.d[a] = (wide)ray->dir[a] / h;
    }
    return g;
}

/* The cell's value minus the isovalue; *finite: whether the cell has a surface at all. */
static wide wide_value(const scene *s, const int cell[3], const wide p[3], double isovalue, int *finite) {
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

static void wide_cell(const scene *s, const wide_ray *g, wide t, int cell[3]) {
    for (int a = 0; a < 3; a++) {
        wide at = wide_floor(g->o[a] + g->d[a] * t);
        cell[a] = at < 0 ? 0 : at > (wide)(s->size[a] - 2) ? s->size[a] - 2 : (int)at;
    }
}

static wide wide_at(const scene *s, const wide_ray *g, const int cell[3], wide t, double isovalue, int *finite) {
    wide p[3];
    for (int a = 0; a < 3; a++) p[a] = g->o[a] + g->d[a] * t;
    return wide_value(s, cell, p, isovalue, finite);
}

static int wide_compare(const void *a, const void *b) {
    wide x = *(const wide *)a, y = *(const wide *)b;
    return (x > y) - (x < y);
}

static int wide_planes(const scene *s, const wide_ray *g, wide t0, wide t1, wide *t) {
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
static int wide_turns(const wide v[4], wide c[4], wide at[3]) {
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

/* First hit by values that are beyond the tolerance; undecided if anything before it comes nearer to the isovalue than that. */
static reference_hit wide_intersect(const scene *s, const isogi_ray *ray, wide tolerance) {
    reference_hit hit = {0, 0, 1};
    wide_ray g = to_grid(s, ray);
    wide t0 = (wide)ray->tmin, t1 = ray->tmax > 0 ? (wide)ray->tmax : (wide)1e30, t[1024], v[4], c[4], at[3];
    int inside = -1, doubts = 0, cell[3];
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
        if (inside < 0) doubts += v[0] <= tolerance && v[0] >= -tolerance, inside = v[0] >= 0;
        int turns = wide_turns(v, c, at);
        for (int k = 0; k < turns; k++) {
            wide value = c[0] + at[k] * (c[1] + at[k] * (c[2] + at[k] * c[3]));
            if (value <= tolerance && value >= -tolerance) doubts++;
            else if ((value >= 0) != inside) {
                wide low = k ? at[k - 1] : 0, high = at[k];
                for (int b = 0; b < 120; b++) {
                    wide middle = (low + high) / 2;
                    if ((c[0] + middle * (c[1] + middle * (c[2] + middle * c[3])) >= 0) == inside) low = middle;
                    else high = middle;
                }
                hit.side = inside ? -1 : 1, hit.t = (real)(t[i] + low * length), hit.decided = !doubts;
                return hit;
            }
        }
    }
    hit.decided = !doubts;
    return hit;
}

/* ---- rays against the reference ---- */

typedef struct tally {
    long rays, hits, wide, undecided, wrong[PATHS];
    double worst; /* |value - isovalue| at hits, in units of the tolerance */
} tally;

/* What double cannot know: the field moves by its slope (at most twice the largest difference, over three axes) times the rounding of
   a place (a few ulp of the farthest coordinate), and by a few ulp of the values themselves. */
static double rounding(const scene *s, const isogi_ray *ray) {
    wide_ray g = to_grid(s, ray);
    double farthest = 1;
    for (int a = 0; a < 3; a++) farthest = fmax(farthest, fmax((double)s->size[a], fabs((double)g.o[a])));
    return 32 * 0x1p-53 * (s->most + fabs(ray->isovalue)) * (1 + farthest) * ROUNDING_FACTOR;
}

static reference_hit truth_of(const scene *s, const isogi_ray *ray, int all_finite, tally *count) {
    double tolerance = rounding(s, ray), origin[3], dir[3];
    wide_ray g = to_grid(s, ray);
    reference_field field = {s->value, {s->size[0], s->size[1], s->size[2]}, 64 * (real)tolerance};
    reference_hit hit = {0, 0, 0};
    for (int a = 0; a < 3; a++) origin[a] = (double)g.o[a], dir[a] = (double)g.d[a];
    if (all_finite) hit = reference_intersect(&field, origin, dir, ray->tmin, ray->tmax, ray->isovalue);
    if (hit.decided) return hit;
    count->wide++;
    return wide_intersect(s, ray, (wide)tolerance);
}

static void compare_rays(const scene *s, const isogi_ray *rays, int n, int all_finite, tally *count) {
    static isogi_hit hits[PATHS][BATCH];
    static uint8_t occluded[PATHS][BATCH];
    for (int p = 0; p < PATHS; p++) {
        isogi_vol_intersect(s->pyramid[p], rays, (size_t)n, hits[p], NULL);
        isogi_vol_occluded(s->pyramid[p], rays, (size_t)n, occluded[p], NULL);
    }
    for (int i = 0; i < n; i++) {
        reference_hit truth = truth_of(s, &rays[i], all_finite, count);
        wide_ray g = to_grid(s, &rays[i]);
        count->rays++, count->hits += truth.side != 0, count->undecided += !truth.decided;
        if (!truth.decided) continue;
        for (int p = 0; p < PATHS; p++) {
            const isogi_hit *h = &hits[p][i];
            int cell[3], finite = 1;
            isogi_hit one;
            if (i % 16 == 0) {
                isogi_vol_intersect(s->pyramid[p], &rays[i], 1, &one, NULL);
                count->wrong[p] += one.side != truth.side;
            }
            if (h->side != truth.side || occluded[p][i] != (truth.side != 0)) {
                if (!count->wrong[p]++)
                    printf("    path %d: side %d at %.17g, occluded %d, reference %d at %.17g; origin %.17g %.17g %.17g dir %.9g %.9g %.9g "
                           "t %.17g %.17g isovalue %.17g size %d %d %d type %d\n", p, h->side, h->t, occluded[p][i], truth.side, (double)truth.t,
                           rays[i].origin[0], rays[i].origin[1], rays[i].origin[2], (double)rays[i].dir[0], (double)rays[i].dir[1],
                           (double)rays[i].dir[2], rays[i].tmin, rays[i].tmax, rays[i].isovalue, s->size[0], s->size[1], s->size[2],
                           (int)s->volume.type);
                continue;
            }
            if (!h->side) continue;
            wide_cell(s, &g, (wide)h->t, cell);
            double value = fabs((double)wide_at(s, &g, cell, (wide)h->t, rays[i].isovalue, &finite));
            if (finite) count->worst = fmax(count->worst, value / rounding(s, &rays[i]));
        }
    }
}

/* residual: bound of |value - isovalue| at a hit in units of what rounding explains. The solver ends its Newton steps at 1e-13 of a
   segment, which is up to 3e-13 of the values, a hundred times what rounding alone explains in small volumes. */
static void tally_check(const char *what, const tally *t, int undecided_percent) {
    printf("    %s: %ld rays, %ld hits, %ld looked at in %d bits, %ld undecided; residual %.2g roundings\n", what, t->rays, t->hits, t->wide,
           WIDE_BITS, t->undecided, t->worst);
    for (int p = 0; p < PATHS; p++) CHECK(t->wrong[p] == 0, "%s: path %d is wrong for %ld of %ld rays", what, p, t->wrong[p], t->rays);
    CHECK(t->undecided * 100 <= t->rays * undecided_percent, "%ld of %ld undecided", t->undecided, t->rays);
    CHECK(t->worst < 100, "residual %g roundings", t->worst);
    CHECK(t->hits * 20 > t->rays, "%ld hits in %ld rays: the test says little", t->hits, t->rays);
}

/* A ray through a random place of the box, from inside or from `away` box lengths away, in the scene's world. */
static isogi_ray ray_through(const scene *s, double isovalue, double away, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    double d[3], back = away * random_unit(r);
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        double h = s->volume.spacing[a] > 0 ? s->volume.spacing[a] : 1;
        ray.dir[a] = (float)(d[a] * h);
        ray.origin[a] = s->volume.origin[a] + h * random_range(r, 0, s->size[a] - 1) - (double)ray.dir[a] * back;
    }
    return ray;
}

/* Along axes and diagonals: in cell faces, along edges, through corners. */
static isogi_ray ray_on_lattice(const scene *s, double isovalue, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    int back = random_bits(r) & 1 ? 0 : 50;
    do
        for (int a = 0; a < 3; a++) ray.dir[a] = (float)((int)(random_bits(r) % 3) - 1);
    while (ray.dir[0] == 0 && ray.dir[1] == 0 && ray.dir[2] == 0);
    for (int a = 0; a < 3; a++) {
        double at = (double)(random_bits(r) % (uint64_t)s->size[a]);
        if (!(random_bits(r) & 3)) at += at < s->size[a] - 1 ? 0.5 : -0.25;
        ray.origin[a] = at - back * (double)ray.dir[a];
    }
    return ray;
}

static void run_rays(const scene *s, int lattice, int n, double low, double high, double step, int all_finite, tally *t, test_random *r) {
    isogi_ray rays[BATCH];
    for (int done = 0; done < n; done += BATCH) {
        for (int i = 0; i < BATCH; i++) {
            double isovalue = random_range(r, low, high);
            if (step > 0) isovalue = step * floor(isovalue / step);
            rays[i] = lattice ? ray_on_lattice(s, isovalue, r) : ray_through(s, isovalue, 60, r);
        }
        compare_rays(s, rays, BATCH, all_finite, t);
    }
}

/* ---- shapes and sizes ---- */

TEST(odd_sizes_hit_like_the_reference) {
    const int size[][3] = {{2, 2, 2}, {2, 5, 9}, {9, 2, 17}, {4, 5, 3}, {63, 3, 2}, {64, 2, 5}, {65, 4, 2}, {66, 3, 3}, {2, 65, 17}, {5, 16, 64},
                           {16, 17, 15}, {3, 2, 129}, {63, 17, 66}, {64, 65, 16}, {65, 33, 64}, {66, 63, 9}};
    test_random r = {1};
    tally t = {0};
    for (int i = 0; i < 32; i++) {
        const int *n = size[i / 2];
        scene s = scene_new(n[0], n[1], n[2]);
        if (i & 1) scene_waves(&s, &r);
        else scene_noise(&s, 0, &r);
        scene_build(&s);
        run_rays(&s, 0, LONG_SUITE ? 20000 : 500, -0.8, 0.8, 0, 1, &t, &r);
        run_rays(&s, 1, LONG_SUITE ? 20000 : 500, -0.8, 0.8, 0, 1, &t, &r);
        scene_free(&s);
    }
    tally_check("sizes", &t, 1);
}

/* ---- types, scale and bias; isovalues at levels of the data and between them ---- */

TEST(every_type_and_scale_hits_like_the_reference) {
    const double scale[] = {0, 0.5, -0.25, -3}, bias[] = {0, 7, -100, 0.125};
    test_random r = {2};
    for (int at_levels = 0; at_levels < 2; at_levels++) {
        tally t = {0};
        for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
            for (int k = 0; k < 4; k++) {
                scene s = scene_new(6 + type, 13, 7);
                double low = 1e300, high = -1e300;
                scene_noise(&s, 5, &r);
                scene_encode(&s, (isogi_type)type, scale[k], bias[k]);
                for (size_t i = 0; i < scene_voxels(&s); i++) low = fmin(low, s.value[i]), high = fmax(high, s.value[i]);
                scene_build(&s);
                run_rays(&s, 0, LONG_SUITE ? 20000 : 500, low, high, at_levels ? 1 / 8.0 : 0, 1, &t, &r);
                if (!at_levels) run_rays(&s, 1, LONG_SUITE ? 20000 : 500, low, high, 0, 1, &t, &r);
                scene_free(&s);
            }
        tally_check(at_levels ? "at levels" : "between levels", &t, 5);
    }
}

/* ---- units ---- */

TEST(extreme_values_spacings_and_origins_hit_like_the_reference) {
    const double unit[] = {1e30, 1e-30, 1, 1}, spacing[][3] = {{1, 1, 1000}, {1e-6, 1e6, 1}, {1e6, 1e-6, 1e-3}, {1, 1, 1}};
    const double origin[] = {0, 1e3, -1e3, 1e6};
    test_random r = {3};
    for (int k = 0; k < 4; k++) {
        tally t = {0};
        for (int v = 0; v < 6; v++) {
            scene s = scene_new(7, 9, 6);
            scene_noise(&s, 0, &r);
            for (size_t i = 0; i < scene_voxels(&s); i++) s.value[i] *= unit[k];
            for (int a = 0; a < 3; a++) s.volume.spacing[a] = spacing[k][a], s.volume.origin[a] = origin[k] * spacing[k][a];
            scene_build(&s);
            run_rays(&s, 0, LONG_SUITE ? 20000 : 500, -0.7 * unit[k], 0.7 * unit[k], 0, 0, &t, &r);
            scene_free(&s);
        }
        tally_check("units", &t, 1);
    }
}

TEST(rays_from_a_million_cells_away_hit_like_the_reference) {
    test_random r = {4};
    tally t = {0};
    for (int v = 0; v < 6; v++) {
        scene s = scene_new(8, 8, 8);
        isogi_ray rays[BATCH];
        scene_noise(&s, 0, &r);
        scene_build(&s);
        for (int k = 0; k < (LONG_SUITE ? 40 : 1); k++) {
            for (int i = 0; i < BATCH; i++) {
                rays[i] = ray_through(&s, random_range(&r, -0.7, 0.7), 0, &r);
                for (int a = 0; a < 3; a++) rays[i].origin[a] -= 1e6 * (double)rays[i].dir[a];
            }
            compare_rays(&s, rays, BATCH, 1, &t);
        }
        scene_free(&s);
    }
    tally_check("far away", &t, 1);
}

/* ---- tangents and grazed saddles: isovalues next to an extremum of the field along the ray ---- */

TEST(tangent_rays_and_saddles_hit_like_the_reference) {
    test_random r = {5};
    tally t = {0};
    for (int v = 0; v < (LONG_SUITE ? 2000 : 60); v++) {
        scene s = scene_new(3, 4, 3);
        isogi_ray rays[BATCH];
        scene_noise(&s, v & 1 ? 4 : 0, &r);
        scene_build(&s);
        for (int i = 0; i < BATCH; i++) {
            /* the extremum along the ray of a cell, then an isovalue 1e-1 .. 1e-15 beside it: a double root, split or lost */
            wide v4[4], c[4], at[3];
            int cell[3], finite = 1, turns;
            isogi_ray ray = ray_through(&s, 0, 0, &r);
            for (int a = 0; a < 3; a++) cell[a] = (int)ray.origin[a];
            wide_ray g = to_grid(&s, &ray);
            for (int k = 0; k < 4; k++) v4[k] = wide_at(&s, &g, cell, (wide)k / 3, 0, &finite);
            turns = wide_turns(v4, c, at);
            wide s0 = at[turns > 2 ? (int)(random_bits(&r) & 1) : 0], value = c[0] + s0 * (c[1] + s0 * (c[2] + s0 * c[3]));
            ray.isovalue = (double)value + (random_bits(&r) & 1 ? 1 : -1) * pow(10, random_range(&r, -15, -1));
            if (random_bits(&r) & 1) ray.tmax = 1;
            rays[i] = ray;
        }
        compare_rays(&s, rays, BATCH, 1, &t);
        scene_free(&s);
    }
    tally_check("tangents", &t, 20);
}

/* ---- triple roots: (x - a)(y - a)(z - a) is trilinear, and (s - a)^3 along the diagonal of the cell ---- */

TEST(triple_roots_on_diagonals_are_crossings) {
    for (int k = 1; k < 16; k++) {
        scene s = scene_new(2, 2, 2);
        double a = k / 16.0;
        isogi_ray ray = {.origin = {-2, -2, -2}, .dir = {1, 1, 1}};
        isogi_hit hit = {0};
        for (int i = 0; i < 8; i++) s.value[i] = (i & 1 ? 1 - a : -a) * (i & 2 ? 1 - a : -a) * (i & 4 ? 1 - a : -a);
        scene_build(&s);
        for (int p = 0; p < PATHS; p++) {
            isogi_vol_intersect(s.pyramid[p], &ray, 1, &hit, NULL);
            /* the cube root of a rounding of 1e-16 */
            CHECK(hit.side == 1 && fabs(hit.t - 2 - a) < 2e-5, "path %d: root %g, side %d at %.17g", p, a, hit.side, hit.t - 2);
        }
        scene_free(&s);
    }
}

TEST(nearly_constant_cells_hit_like_the_reference) {
    test_random r = {6};
    tally t = {0};
    for (int v = 0; v < 10; v++) {
        scene s = scene_new(6, 7, 5);
        scene_noise(&s, 0, &r);
        for (size_t i = 0; i < scene_voxels(&s); i++) s.value[i] = 1 + s.value[i] * pow(10, -1 - v);
        scene_build(&s);
        run_rays(&s, 0, LONG_SUITE ? 10000 : 500, 1 - 0.7 * pow(10, -1 - v), 1 + 0.7 * pow(10, -1 - v), 0, 0, &t, &r);
        scene_free(&s);
    }
    tally_check("nearly constant", &t, 5);
}

/* ---- along lattice lines at isovalues that are levels: exact, by walking the voxels ---- */

TEST(axis_rays_at_data_levels_change_sides_where_voxels_do) {
    test_random r = {7};
    long wrong[PATHS] = {0}, hits = 0;
    for (int v = 0; v < (LONG_SUITE ? 300 : 30); v++) {
        scene s = scene_new(11, 6, 19);
        scene_noise(&s, 2, &r);
        scene_encode(&s, ISOGI_U8, 0, 0);
        scene_build(&s);
        for (int i = 0; i < 300; i++) {
            int axis = (int)(random_bits(&r) % 3), at[3], found = 0;
            double isovalue = 40 + 10 * floor(random_range(&r, -2, 2)), last = 0, truth = 0;
            isogi_ray ray = {.isovalue = isovalue};
            for (int a = 0; a < 3; a++) ray.origin[a] = at[a] = (int)(random_bits(&r) % (uint64_t)s.size[a]);
            ray.origin[axis] = -3, ray.dir[axis] = 1;
            for (int k = 0; k < s.size[axis] && !found; k++) {
                at[axis] = k;
                double value = s.value[at[0] + s.size[0] * (at[1] + s.size[1] * at[2])] - isovalue;
                if (k && (value >= 0) != (last >= 0)) found = value >= 0 ? 1 : -1, truth = 3 + k - 1 + last / (last - value);
                last = value;
            }
            hits += found != 0;
            for (int p = 0; p < PATHS; p++) {
                isogi_hit hit = {0};
                isogi_vol_intersect(s.pyramid[p], &ray, 1, &hit, NULL);
                wrong[p] += hit.side != found || fabs(hit.t - truth) > 1e-12;
            }
        }
        scene_free(&s);
    }
    for (int p = 0; p < PATHS; p++) CHECK(wrong[p] == 0 && hits > 1000, "path %d: %ld wrong of %ld hits", p, wrong[p], hits);
}

/* ---- ends of rays ---- */

TEST(ends_on_crossings_keep_to_the_documented_side) {
    scene s = scene_new(6, 6, 6);
    for (int i = 0; i < 216; i++) s.value[i] = i % 6; /* f = x: in at x = 3 (closed), out below it */
    scene_build(&s);
    for (int p = 0; p < PATHS; p++) {
        isogi_hit h = {0};
        isogi_ray ray = {.origin = {0.5, 2.25, 2.5}, .dir = {1, 0, 0}, .isovalue = 3, .tmax = 2.5};
        isogi_vol_intersect(s.pyramid[p], &ray, 1, &h, NULL);
        /* the accuracy that the header states */
        CHECK(h.side == 1 && fabs(h.t - 2.5) < 1e-12, "path %d: ends on the crossing: side %d at 2.5 + %g", p, h.side, h.t - 2.5);
        ray.tmax = 2.5 - 0x1p-20;
        isogi_vol_intersect(s.pyramid[p], &ray, 1, &h, NULL);
        CHECK(h.side == 0, "path %d: ends before it: side %d at %g", p, h.side, h.t);
        ray.tmin = 2.5, ray.tmax = 0;
        isogi_vol_intersect(s.pyramid[p], &ray, 1, &h, NULL);
        CHECK(h.side == 0, "path %d: begins inside, on it: side %d at %g", p, h.side, h.t);
        ray.tmin = 2.5 - 0x1p-20;
        isogi_vol_intersect(s.pyramid[p], &ray, 1, &h, NULL);
        CHECK(h.side == 1 && fabs(h.t - 2.5) < 1e-12, "path %d: begins before it: side %d at %g", p, h.side, h.t);
    }
    scene_free(&s);
}

/* ---- voxels that are not finite ---- */

TEST(cells_without_a_surface_hit_like_the_reference) {
#ifdef __FAST_MATH__
    SKIP("the reference looks for NaN, and -ffast-math promises that there is none");
#endif
    test_random r = {8};
    tally t = {0};
    for (int v = 0; v < (LONG_SUITE ? 200 : 10); v++) {
        scene s = scene_new(9, 18, 7);
        scene_noise(&s, 0, &r);
        for (int k = 0; k < 12; k++) s.value[random_bits(&r) % scene_voxels(&s)] = k % 3 == 0 ? (double)NAN : k % 3 == 1 ? (double)INFINITY : -(double)INFINITY;
        scene_build(&s);
        run_rays(&s, 0, BATCH, -0.7, 0.7, 0, 0, &t, &r);
        scene_free(&s);
    }
    tally_check("not finite", &t, 1);
}

/* ---- offsets beyond 2^31 and 2^32 bytes: few voxels, far apart in memory that is never touched ---- */

TEST(voxels_many_gigabytes_apart_are_found) {
#if defined(__unix__) && defined(MAP_NORESERVE) && UINTPTR_MAX > 0xffffffffu && !defined(TEST_SANITIZED)
    test_random r = {9};
    const ptrdiff_t stride[3] = {1 << 12, (ptrdiff_t)1 << 29, ((ptrdiff_t)1 << 32) + 8};
    size_t bytes = (size_t)1 << 36;
    char *data = (char *)mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (data == (char *)MAP_FAILED) SKIP("no 64 GB of addresses");
    for (int reversed = 0; reversed < 2; reversed++) {
        tally t = {0};
        scene s = scene_new(9, 7, 10);
        scene_noise(&s, 0, &r);
        s.volume.data = reversed ? data + 9 * stride[2] : data;
        for (int a = 0; a < 3; a++) s.volume.stride[a] = a == 2 && reversed ? -stride[a] : stride[a];
        for (int k = 0; k < 10; k++)
            for (int j = 0; j < 7; j++)
                for (int i = 0; i < 9; i++)
                    memcpy((char *)(uintptr_t)s.volume.data + i * s.volume.stride[0] + j * s.volume.stride[1] + k * s.volume.stride[2],
                           &s.value[i + 9 * (j + 7 * k)], 8);
        scene_build(&s);
        run_rays(&s, 0, 1000, -0.7, 0.7, 0, 1, &t, &r);
        tally_check("far apart", &t, 1);
        scene_free(&s);
    }
    munmap(data, bytes);
#else
    SKIP("needs sparse memory of 64 GB");
#endif
}

/* ---- no leaks: from inside, and on from every hit, in batches on every path ---- */

TEST(nothing_escapes_from_closed_surfaces_on_any_path) {
    enum { COUNT = 4096 };
    static isogi_ray rays[COUNT];
    static isogi_hit hits[COUNT];
    static float dirs[COUNT][3];
    test_random r = {10};
    long wanted = LONG_SUITE ? 60000000 : 1000000, done = 0, escaped[PATHS] = {0};
    while (done < wanted) {
        scene s = scene_new(18 + (int)(random_bits(&r) % 50), 18, 20);
        scene_noise(&s, 0, &r);
        for (size_t i = 0; i < scene_voxels(&s); i++) {
            int x = (int)i % s.size[0], y = (int)i / s.size[0] % 18, z = (int)i / s.size[0] / 18;
            if (x == 0 || y == 0 || z == 0 || x == s.size[0] - 1 || y == 17 || z == 19) s.value[i] = -1;
            else s.value[i] = s.value[i] * 2 + 1.2;
        }
        scene_build(&s);
        for (int p = 0; p < PATHS; p++)
            for (int turn = 0; turn < (LONG_SUITE ? 20 : 2); turn++) {
                for (int i = 0; i < COUNT; i++) {
                    double d[3];
                    int at[3];
                    do
                        for (int a = 0; a < 3; a++) at[a] = (int)(random_bits(&r) % (uint64_t)s.size[a]);
                    while (!(s.value[at[0] + s.size[0] * (at[1] + 18 * at[2])] > 0.01));
                    memset(&rays[i], 0, sizeof rays[i]);
                    random_direction(&r, d);
                    for (int a = 0; a < 3; a++) rays[i].origin[a] = at[a], rays[i].dir[a] = dirs[i][a] = (float)d[a];
                }
                isogi_vol_intersect(s.pyramid[p], rays, COUNT, hits, NULL);
                for (int i = 0; i < COUNT; i++) escaped[p] += hits[i].side != -1;
                done += COUNT;
                for (int round = 0; round < 4; round++) { /* -1 goes on to +1 or out; what comes in must come out */
                    static isogi_hit starts[COUNT];
                    memcpy(starts, hits, sizeof starts);
                    isogi_vol_continue(s.pyramid[p], starts, (const float(*)[3])dirs, NULL, 0, 0, COUNT, hits, NULL);
                    for (int i = 0; i < COUNT; i++) {
                        if (starts[i].side == 1) escaped[p] += hits[i].side != -1;
                        if (starts[i].side == -1) escaped[p] += hits[i].side != 1 && hits[i].side != 0;
                        if (starts[i].side == 0) hits[i].side = 0;
                        done += starts[i].side != 0;
                    }
                }
            }
        scene_free(&s);
    }
    printf("    %ld rays\n", done);
    for (int p = 0; p < PATHS; p++) CHECK(escaped[p] == 0, "path %d: %ld escaped", p, escaped[p]);
}

TEST_MAIN("vol_hard")
