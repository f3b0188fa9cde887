/* Properties of isogi_vol.h: volumes, pyramid, sampling, rays. Meshes have their own file. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include <pthread.h>
#include <sched.h>
#include <time.h>
#include "ray_fields.h"
#include "reference_ray.h"

static double wide_isovalue(int kind, test_random *r) {
    return kind == QUANTISED ? floor(random_range(r, -4, 4)) + (random_bits(r) & 1 ? 0.5 : 0) : random_range(r, -0.9, 0.9);
}

/* ---- rays against the reference ---- */

typedef struct ray_tally {
    long rays, undecided, missed, extra, wrong_side, other_hit, worse_than_1e4;
    double worst_t;
} ray_tally;

static void tally_ray(field *f, const reference_field *reference, const isogi_ray *ray, ray_tally *tally) {
    double dir[3] = {(double)ray->dir[0], (double)ray->dir[1], (double)ray->dir[2]};
    isogi_hit hit = {0};
    uint8_t occluded = 0;
    reference_hit truth = reference_intersect(reference, ray->origin, dir, ray->tmin, ray->tmax, ray->isovalue);
    isogi_vol_intersect(f->pyramid, ray, 1, &hit, NULL);
    isogi_vol_occluded(f->pyramid, ray, 1, &occluded, NULL);
    CHECK(occluded == (hit.side != 0), "occluded %d, side %d", occluded, hit.side);
    tally->rays++;
    if (!truth.decided) { tally->undecided++; return; }
    if (truth.side && !hit.side) tally->missed++;
    if (!truth.side && hit.side) tally->extra++;
    if (!truth.side || !hit.side) return;
    if (truth.side != hit.side) { tally->wrong_side++; return; }
    double length = sqrt(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);
    double error = fabs((double)(truth.t - (real)hit.t)) * length;
    if (error > tally->worst_t) tally->worst_t = error;
    if (error > 1e-4) tally->worse_than_1e4++;
    tally->other_hit += !reference_same_hit(reference, ray->origin, dir, ray->isovalue, hit.t, truth.t, 1e-10L);
    for (int a = 0; a < 3; a++) {
        double at = ray->origin[a] + hit.t * dir[a], place = hit.cell[a] + hit.local[a];
        CHECK(fabs(at - place) < 1e-9 * (1 + fabs(at)), "axis %d: origin + t dir %.17g, cell + local %.17g", a, at, place);
    }
}

static void tally_check(const char *what, const ray_tally *t) {
    printf("    %s: %ld rays, %ld undecided, %ld missed, %ld extra; t: worst %.2g cells, %ld over 1e-4\n", what, t->rays, t->undecided,
           t->missed, t->extra, t->worst_t, t->worse_than_1e4);
    CHECK(t->missed == 0 && t->extra == 0 && t->wrong_side == 0 && t->other_hit == 0,
          "missed %ld, extra %ld, wrong side %ld, not the first %ld", t->missed, t->extra, t->wrong_side, t->other_hit);
    /* the reference is in long double; only nearly tangent rays, whose root is ill-conditioned, may differ visibly */
    CHECK(t->worse_than_1e4 * 10000 <= t->rays, "t is off by more than 1e-4 cell for %ld of %ld", t->worse_than_1e4, t->rays);
    CHECK(t->undecided * 20 <= t->rays, "%ld of %ld undecided: the test says little", t->undecided, t->rays);
}

/* Half of them from within the box, some with limits. */
static isogi_ray any_ray(const field *f, double isovalue, test_random *r) {
    isogi_ray ray = random_ray(f, isovalue, r);
    if (random_bits(r) & 1)
        for (int a = 0; a < 3; a++) ray.origin[a] = random_range(r, 0, f->size[a] - 1);
    if (!(random_bits(r) & 7)) ray.tmin = random_range(r, 0, 3), ray.tmax = ray.tmin + random_range(r, 0, 6);
    return ray;
}

static void random_rays(int kind, const char *name, uint64_t seed) {
    test_random r = {seed};
    ray_tally tally = {0};
    int volumes = LONG_SUITE ? 400 : 60, rays = LONG_SUITE ? 8500 : 1500;
    for (int v = 0; v < volumes; v++) {
        field f = field_new(2 + (int)(random_bits(&r) % 9), 2 + (int)(random_bits(&r) % 9), 2 + (int)(random_bits(&r) % 9));
        field_fill(&f, kind, &r);
        field_build(&f);
        reference_field reference = {f.value, {f.size[0], f.size[1], f.size[2]}, 1e-12L};
        for (int i = 0; i < rays; i++) {
            isogi_ray ray = any_ray(&f, wide_isovalue(kind, &r), &r);
            tally_ray(&f, &reference, &ray, &tally);
        }
        field_free(&f);
    }
    tally_check(name, &tally);
}

TEST(random_rays_hit_noise_like_the_reference) { random_rays(NOISE, "noise", 1); }
TEST(random_rays_hit_smooth_fields_like_the_reference) { random_rays(SMOOTH, "smooth", 2); }
TEST(random_rays_hit_quantised_fields_like_the_reference) { random_rays(QUANTISED, "quantised", 3); }

/* Rays along axes and diagonals, in faces, along edges, through corners. The reference is undecided where such a ray runs along
   values that equal the isovalue, so isovalues lie between the levels. */
TEST(axis_and_lattice_rays_hit_like_the_reference) {
    test_random r = {4};
    ray_tally tally = {0};
    for (int v = 0; v < (LONG_SUITE ? 400 : 60); v++) {
        field f = field_new(7, 6, 8);
        field_fill(&f, QUANTISED, &r);
        field_build(&f);
        reference_field reference = {f.value, {7, 6, 8}, 1e-12L};
        for (int i = 0; i < 500; i++) {
            isogi_ray ray = {.isovalue = floor(random_range(&r, -3, 3)) + 0.37};
            do
                for (int a = 0; a < 3; a++) ray.dir[a] = (float)((int)(random_bits(&r) % 3) - 1);
            while (ray.dir[0] == 0 && ray.dir[1] == 0 && ray.dir[2] == 0);
            for (int a = 0; a < 3; a++) {
                double at = (double)(random_bits(&r) % (uint64_t)f.size[a]);
                if (random_bits(&r) & 1) at = random_range(&r, 0, f.size[a] - 1);
                ray.origin[a] = at - (random_bits(&r) & 1 ? 0 : 16) * (double)ray.dir[a];
            }
            tally_ray(&f, &reference, &ray, &tally);
        }
        field_free(&f);
    }
    tally_check("lattice rays", &tally);
}

/* The same field and the same rays, seen through huge and tiny values, spacings, and origins far away, must give the same hits. */
TEST(hits_do_not_depend_on_the_scale_of_values_and_space) {
    test_random r = {5};
    const double values[] = {1e30, 1e-30, -1e30, 1e-300, 1e200}, spaces[] = {1e-6, 1e6, 1e-3, 1, 1e3};
    for (int v = 0; v < 5; v++) {
        field f = field_new(9, 8, 7), g = field_new(9, 8, 7);
        field_fill(&f, NOISE, &r);
        field_build(&f);
        memcpy(g.value, f.value, sizeof(double) * 9 * 8 * 7);
        g.volume.scale = fabs(values[v]), g.volume.spacing[0] = spaces[v], g.volume.spacing[1] = spaces[(v + 1) % 5];
        g.volume.spacing[2] = spaces[(v + 3) % 5];
        field_build(&g);
        long different = 0, hits = 0;
        for (int i = 0; i < 4000; i++) {
            isogi_ray a = any_ray(&f, random_range(&r, -0.5, 0.5), &r), b = a;
            isogi_hit ha = {0}, hb = {0};
            b.isovalue *= fabs(values[v]), b.tmin = b.tmax = a.tmin = a.tmax = 0;
            for (int x = 0; x < 3; x++) b.origin[x] *= g.volume.spacing[x], b.dir[x] = (float)((double)b.dir[x] * g.volume.spacing[x]);
            for (int x = 0; x < 3; x++) a.dir[x] = (float)((double)b.dir[x] / g.volume.spacing[x]);
            isogi_vol_intersect(f.pyramid, &a, 1, &ha, NULL);
            isogi_vol_intersect(g.pyramid, &b, 1, &hb, NULL);
            hits += ha.side != 0;
            /* the direction is rounded to float once more: 1e-5 of a cell over the length of the ray */
            different += ha.side != hb.side || fabs(ha.t - hb.t) > 1e-4;
        }
        CHECK(different <= 8 && hits > 500, "values * %g: %ld of %ld hits differ", values[v], different, hits);
        field_free(&f), field_free(&g);
    }
}

TEST(a_far_origin_costs_no_precision) {
    test_random r = {6};
    field f = field_new(12, 12, 12);
    field_fill(&f, SMOOTH, &r);
    field_build(&f);
    double worst = 0;
    for (int i = 0; i < 5000; i++) {
        isogi_ray near_ray = any_ray(&f, 0.1, &r), far_ray = near_ray;
        isogi_hit a = {0}, b = {0};
        near_ray.tmin = near_ray.tmax = far_ray.tmin = far_ray.tmax = 0;
        for (int x = 0; x < 3; x++) near_ray.origin[x] = random_range(&r, 0, 11) - 30 * (double)near_ray.dir[x];
        for (int x = 0; x < 3; x++) {
            volatile float d = far_ray.dir[x]; /* gcc 12 -O3 uses the direction as it was before it was rounded to float */
            far_ray.origin[x] = near_ray.origin[x] - 1e6 * (double)d;
        }
        isogi_vol_intersect(f.pyramid, &near_ray, 1, &a, NULL);
        isogi_vol_intersect(f.pyramid, &far_ray, 1, &b, NULL);
        CHECK(a.side == b.side, "sides %d %d", a.side, b.side);
        if (a.side && fabs(b.t - a.t - 1e6) > worst) worst = fabs(b.t - a.t - 1e6);
    }
    /* 1e6 cells times 2^-53 is 1e-10; grazing rays multiply it */
    CHECK(worst < 1e-6, "t moved by %g", worst);
    field_free(&f);
}

/* The fast walk and the plain one (force_path 1) are two designs: they must agree on large volumes, on any type, on any path. */
static void compare_walks(int path) {
    test_random r = {20};
    long different = 0, hits = 0;
    for (int type = QUICK_SUITE ? path % 2 : ISOGI_U8; type <= ISOGI_F64; type += 1 + QUICK_SUITE) {
        int size[3] = {40 + (int)(random_bits(&r) % 60), 65, 30 + (int)(random_bits(&r) % 130)}, voxels = size[0] * size[1] * size[2];
        size_t bytes = type <= ISOGI_I8 ? 1 : type <= ISOGI_I16 ? 2 : type == ISOGI_F32 ? 4 : 8;
        char *data = (char *)malloc((size_t)voxels * bytes);
        for (int i = 0; i < voxels; i++) {
            int x = i % size[0], y = i / size[0] % size[1], z = i / size[0] / size[1];
            double v = 50 + 30 * sin(0.31 * x + 0.1 * z) * cos(0.23 * y) + 20 * sin(0.17 * z + 0.05 * x) + random_range(&r, 0, 2);
            if (type == ISOGI_U8) ((uint8_t *)data)[i] = (uint8_t)v;
            if (type == ISOGI_I8) ((int8_t *)data)[i] = (int8_t)v;
            if (type == ISOGI_U16) ((uint16_t *)(void *)data)[i] = (uint16_t)(100 * v);
            if (type == ISOGI_I16) ((int16_t *)(void *)data)[i] = (int16_t)(100 * v);
            if (type == ISOGI_F32) ((float *)(void *)data)[i] = (float)v;
            if (type == ISOGI_F64) ((double *)(void *)data)[i] = v;
        }
        isogi_volume v = {.data = data, .type = (isogi_type)type, .size = {(size_t)size[0], (size_t)size[1], (size_t)size[2]}};
        if (type == ISOGI_U16) v.scale = 0.01, v.bias = -3;
        isogi_context plain = {.threads = 1, .force_path = 1}, fast = {.threads = 1, .force_path = forced_path(path)};
        isogi_pyramid *a = NULL, *b = NULL;
        v.compact = path > 4;
        isogi_vol_build(&a, &v, &fast);
        isogi_vol_build(&b, &v, &plain);
        field f = {{size[0], size[1], size[2]}, NULL, {0}, NULL};
        for (int i = 0; i < (LONG_SUITE ? 200000 : 20000); i++) {
            double isovalue = random_range(&r, 20, 80) * (type == ISOGI_I16 ? 100 : 1);
            isogi_ray ray = any_ray(&f, i & 1 ? floor(isovalue) : isovalue, &r);
            isogi_hit ha = {0}, hb = {0}, na = {0}, nb = {0};
            double d[3];
            float dir[1][3];
            isogi_vol_intersect(a, &ray, 1, &ha, NULL);
            isogi_vol_intersect(b, &ray, 1, &hb, NULL);
            different += ha.side != hb.side || fabs(ha.t - hb.t) > 1e-7;
            if (!ha.side || !hb.side) continue;
            hits++;
            random_direction(&r, d);
            for (int x = 0; x < 3; x++) dir[0][x] = (float)d[x];
            isogi_vol_continue(a, &hb, (const float(*)[3])dir, NULL, ray.isovalue, 0, 1, &na, NULL);
            isogi_vol_continue(b, &hb, (const float(*)[3])dir, NULL, ray.isovalue, 0, 1, &nb, NULL);
            different += na.side != nb.side || fabs(na.t - nb.t) > 1e-7;
        }
        isogi_vol_free(a), isogi_vol_free(b);
        free(data);
    }
    printf("    %ld hits, %ld different\n", hits, different);
    /* a ray that grazes within rounding (1e-12 of a cell) may be seen either way */
    CHECK(different * 100000 <= hits && hits > 20000, "%ld of %ld differ", different, hits);
}

/* Many rays in one call, of any isovalue, capped or not, against the same rays one by one in plain code. */
static void compare_batches(int path, int kind) {
    enum { COUNT = 3000 };
    test_random r = {21};
    field f = field_new(40, 71, 53);
    isogi_context plain = {.threads = 1, .force_path = 1}, fast = {.threads = 1, .force_path = forced_path(path)};
    isogi_pyramid *a = NULL, *b = NULL;
    isogi_ray *rays = (isogi_ray *)malloc(COUNT * sizeof *rays);
    isogi_hit *hits = (isogi_hit *)malloc(COUNT * sizeof *hits), *starts = (isogi_hit *)malloc(COUNT * sizeof *starts);
    float(*dirs)[3] = (float(*)[3])malloc(COUNT * sizeof *dirs);
    uint8_t *occluded = (uint8_t *)malloc(COUNT);
    long different = 0, found = 0;
    field_fill(&f, kind, &r);
    f.volume.compact = path > 4;
    isogi_vol_build(&a, &f.volume, &fast), isogi_vol_build(&b, &f.volume, &plain);
    for (int i = 0; i < COUNT; i++) {
        double d[3];
        rays[i] = any_ray(&f, wide_isovalue(kind, &r), &r);
        rays[i].flags = i % 3 == 0 ? ISOGI_RAY_CAPPED : 0;
        if (i % 7 == 0) /* along lattice planes, edges and diagonals */
            for (int x = 0; x < 3; x++)
                rays[i].dir[x] = (float)((int)(random_bits(&r) % 3) - 1), rays[i].origin[x] = floor(rays[i].origin[x]);
        if (i % 101 == 0) rays[i].dir[0] = (float)NAN;
        random_direction(&r, d);
        for (int x = 0; x < 3; x++) dirs[i][x] = (float)d[x];
    }
    isogi_vol_intersect(a, rays, COUNT, hits, NULL);
    isogi_vol_occluded(a, rays, COUNT, occluded, NULL);
    for (int i = 0; i < COUNT; i++) {
        isogi_vol_intersect(b, &rays[i], 1, &starts[i], NULL);
        found += starts[i].side != 0;
        different += hits[i].side != starts[i].side || occluded[i] != (starts[i].side != 0) || fabs(hits[i].t - starts[i].t) > 1e-7;
    }
    printf("    path %d: %ld hits, %ld different\n", path, found, different);
    for (int i = 0; i < COUNT; i++) rays[i].isovalue = 0.25;
    isogi_vol_intersect(b, rays, COUNT, starts, NULL);
    for (int capped = 0; capped < 2; capped++) {
        memcpy(hits, starts, COUNT * sizeof *hits);
        isogi_vol_continue(a, hits, (const float(*)[3])dirs, NULL, 0.25, capped ? ISOGI_RAY_CAPPED : 0, COUNT, hits, NULL);
        for (int i = 0; i < COUNT; i++) {
            isogi_hit truth = {0};
            isogi_vol_continue(b, &starts[i], (const float(*)[3])dirs + i, NULL, 0.25, capped ? ISOGI_RAY_CAPPED : 0, 1, &truth, NULL);
            if (starts[i].side) different += hits[i].side != truth.side || fabs(hits[i].t - truth.t) > 1e-7;
        }
    }
    CHECK(different <= found * TOUCHES_PER_HIT && found > COUNT / 3, "%ld of %d differ, %ld hits", different, COUNT, found);
    isogi_vol_free(a), isogi_vol_free(b);
    free(rays), free(hits), free(starts), free(dirs), free(occluded);
    free(f.value);
}

TEST(batches_agree_with_single_rays) {
    for (int path = 0; path < 7; path++)
        for (int kind = 0; kind < KINDS; kind++) compare_batches(path, kind);
}

TEST(the_best_and_the_plain_walk_agree) { compare_walks(0); }
TEST(the_portable_and_the_plain_walk_agree) { compare_walks(2); }
TEST(the_avx2_and_the_plain_walk_agree) { compare_walks(3); }
TEST(the_avx512_and_the_plain_walk_agree) { compare_walks(4); }
TEST(the_walks_of_compact_volumes_and_the_plain_one_agree) {
    compare_walks(5);
    if (LONG_SUITE) compare_walks(6);
}

/* ---- no leaks ---- */

/* A ball of noise above the isovalue inside a shell below it: from inside, every ray must come out through the surface. */
TEST(rays_from_inside_a_closed_surface_never_escape) {
    test_random r = {7};
    long rays = LONG_SUITE ? 10000000 : 400000, escaped = 0, done = 0;
    while (done < rays) {
        int n = 6 + (int)(random_bits(&r) % 10), quantised = (int)(random_bits(&r) & 1);
        field f = field_new(n, n, n);
        for (int k = 0; k < n; k++)
            for (int j = 0; j < n; j++)
                for (int i = 0; i < n; i++) {
                    int border = i == 0 || j == 0 || k == 0 || i == n - 1 || j == n - 1 || k == n - 1;
                    double v = border ? -1 : random_range(&r, -1, 3);
                    *field_at(&f, i, j, k) = quantised ? floor(v) : v;
                }
        field_build(&f);
        isogi_ray ray = {0};
        isogi_hit hit = {0}, next = {0};
        for (int i = 0; i < 20000; i++) {
            double d[3];
            float point[1][3], value, dir[1][3];
            for (int a = 0; a < 3; a++) ray.origin[a] = random_range(&r, 1, n - 2), point[0][a] = (float)ray.origin[a];
            for (int a = 0; a < 3; a++) ray.origin[a] = (double)point[0][a];
            isogi_vol_sample(f.pyramid, (const float(*)[3])point, 1, &value, NULL);
            if (!(value > 1e-6f)) continue;
            if (i % 4 == 0)
                do
                    for (int a = 0; a < 3; a++) d[a] = (double)(random_bits(&r) % 3) - 1;
                while (d[0] == 0 && d[1] == 0 && d[2] == 0);
            else random_direction(&r, d);
            for (int a = 0; a < 3; a++) ray.dir[a] = (float)d[a];
            isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
            escaped += hit.side != -1;
            done++;
            if (hit.side != -1 || quantised) continue; /* layers without thickness are entered and not left */
            /* go on from the surface in any direction: what goes back inside must come out again */
            random_direction(&r, d);
            for (int a = 0; a < 3; a++) dir[0][a] = (float)d[a];
            isogi_hit start = hit;
            isogi_vol_continue(f.pyramid, &start, (const float(*)[3])dir, NULL, 0, 0, 1, &next, NULL);
            done++;
            while (next.side == 1) {
                start = next;
                isogi_vol_continue(f.pyramid, &start, (const float(*)[3])dir, NULL, 0, 0, 1, &next, NULL);
                escaped += next.side != -1;
                done++;
                if (next.side == -1)
                    start = next, isogi_vol_continue(f.pyramid, &start, (const float(*)[3])dir, NULL, 0, 0, 1, &next, NULL);
            }
        }
        field_free(&f);
    }
    printf("    %ld rays\n", done);
    CHECK(escaped == 0, "%ld of %ld escaped", escaped, done);
}

/* ---- going on from a hit ---- */

TEST(continuing_along_a_ray_finds_every_crossing_of_the_reference) {
    test_random r = {8};
    long crossings = 0, different = 0, undecided = 0;
    for (int v = 0; v < (LONG_SUITE ? 300 : 40); v++) {
        int kind = (int)(v % KINDS);
        field f = field_new(8, 7, 9);
        field_fill(&f, kind, &r);
        field_build(&f);
        reference_field reference = {f.value, {8, 7, 9}, 1e-10L};
        for (int i = 0; i < 500; i++) {
            isogi_ray ray = any_ray(&f, kind == QUANTISED ? 0.5 : random_range(&r, -0.5, 0.5), &r);
            double dir[3] = {(double)ray.dir[0], (double)ray.dir[1], (double)ray.dir[2]}, at = 0;
            isogi_hit hit = {0}, next = {0};
            ray.tmin = ray.tmax = 0;
            isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
            reference_hit truth = reference_intersect(&reference, ray.origin, dir, 0, 0, ray.isovalue);
            int last = 0;
            while (truth.decided && truth.side && hit.side) {
                crossings++;
                if (hit.side != truth.side || hit.side == last || fabs(at + hit.t - (double)truth.t) > 1e-5) { different++; break; }
                last = hit.side;
                at += hit.t;
                isogi_vol_continue(f.pyramid, &hit, (const float(*)[3])&ray.dir, NULL, ray.isovalue, 0, 1, &next, NULL);
                hit = next;
                /* the reference starts a little behind its own root */
                truth = reference_intersect(&reference, ray.origin, dir, (double)truth.t + 1e-7, 0, ray.isovalue);
            }
            undecided += !truth.decided;
            if (truth.decided && (truth.side != 0) != (hit.side != 0)) different++;
        }
        field_free(&f);
    }
    printf("    %ld crossings, %ld undecided, %ld different\n", crossings, undecided, different);
    /* two roots within 1e-7 of each other are one for the reference, as it is used here */
    CHECK(different * 100000 <= crossings, "%ld of %ld crossings differ", different, crossings);
    CHECK(crossings > 10000, "only %ld crossings", crossings);
}

TEST(leaving_a_plane_never_hits_it_again) {
    field f = field_new(6, 6, 6);
    test_random r = {9};
    for (int k = 0; k < 6; k++)
        for (int j = 0; j < 6; j++)
            for (int i = 0; i < 6; i++) *field_at(&f, i, j, k) = 3 - k; /* inside below z = 3 - isovalue */
    field_build(&f);
    for (int i = 0; i < 20000; i++) {
        double isovalue = i % 3 ? random_range(&r, -1.5, 2.5) : floor(random_range(&r, -1, 2)), d[3];
        isogi_ray ray = {.origin = {random_range(&r, 0, 5), random_range(&r, 0, 5), 5}, .dir = {0, 0, -1}, .isovalue = isovalue};
        isogi_hit hit = {0}, next = {0};
        float dir[1][3];
        isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
        CHECK(hit.side == 1 && fabs(hit.t - (2 + isovalue)) < 1e-12, "side %d t %g isovalue %g", hit.side, hit.t, isovalue);
        random_direction(&r, d);
        if (i % 7 == 0) d[2] = 0;
        for (int a = 0; a < 3; a++) dir[0][a] = (float)d[a];
        isogi_vol_continue(f.pyramid, &hit, (const float(*)[3])dir, NULL, isovalue, 0, 1, &next, NULL);
        CHECK(next.side == 0, "hit the plane it left: t %g, direction z %g, isovalue %g", next.t, d[2], isovalue);
    }
    field_free(&f);
}

/* ---- border ---- */

TEST(the_border_is_open_unless_capped) {
    field f = field_new(5, 5, 5);
    for (int i = 0; i < 125; i++) f.value[i] = 1;
    field_build(&f);
    isogi_ray ray = {.origin = {2, 2, -3}, .dir = {0, 0, 2}, .isovalue = 0.5};
    isogi_hit hit = {0}, next = {0};
    float normal[1][3] = {{0}};
    isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
    CHECK(hit.side == 0, "side %d", hit.side);
    ray.flags = ISOGI_RAY_CAPPED;
    isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
    CHECK(hit.side == 2 && fabs(hit.t - 1.5) < 1e-12, "side %d t %g", hit.side, hit.t);
    isogi_vol_normals(f.pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal);
    CHECK(normal[0][2] == -1 && normal[0][0] == 0, "normal %g %g %g", (double)normal[0][0], (double)normal[0][1], (double)normal[0][2]);
    isogi_vol_continue(f.pyramid, &hit, (const float(*)[3])&ray.dir, NULL, 0.5, ISOGI_RAY_CAPPED, 1, &next, NULL);
    CHECK(next.side == -2 && fabs(next.t - 2) < 1e-12, "side %d t %g", next.side, next.t);
    isogi_vol_continue(f.pyramid, &next, (const float(*)[3])&ray.dir, NULL, 0.5, ISOGI_RAY_CAPPED, 1, &hit, NULL);
    CHECK(hit.side == 0, "side %d t %g", hit.side, hit.t);
    field_free(&f);
}

/* ---- bad rays, bad volumes ---- */

TEST(nonsense_rays_miss) {
    field f = field_new(4, 4, 4);
    for (int i = 0; i < 64; i++) f.value[i] = i;
    field_build(&f);
    isogi_hit hit = {0};
    const isogi_ray good = {.origin = {1.5, 1.5, -1}, .dir = {0, 0, 1}, .isovalue = 30};
    for (int i = 0; i < 12; i++) {
        isogi_ray ray = good;
        if (i == 0) ray.dir[2] = 0;
        if (i == 1) ray.dir[1] = (float)NAN;
        if (i == 2) ray.origin[0] = (double)NAN;
        if (i == 3) ray.isovalue = (double)NAN;
        if (i == 4) ray.tmin = 5, ray.tmax = 4;
        if (i == 5) ray.tmin = (double)NAN;
        if (i == 6) ray.tmax = (double)NAN;
        if (i == 7) ray.origin[1] = (double)INFINITY;
        if (i == 8) ray.dir[0] = (float)INFINITY;
        if (i == 9) ray.isovalue = (double)INFINITY;
        if (i == 10) ray.isovalue = -(double)INFINITY;
        if (i == 11) ray.tmax = -1;
        hit.side = 7;
        isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
        CHECK(hit.side == 0, "case %d: side %d", i, hit.side);
    }
    isogi_ray ray = good;
    ray.tmax = (double)INFINITY;
    isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
    CHECK(hit.side == 1, "unlimited ray: side %d", hit.side);
    CHECK(isogi_vol_intersect(NULL, &ray, 1, &hit, NULL) == ISOGI_INVALID, "no pyramid");
    CHECK(isogi_vol_intersect(f.pyramid, NULL, 0, NULL, NULL) == ISOGI_OK, "no rays");
    field_free(&f);
}

TEST(bad_volumes_are_refused) {
    float voxel[8] = {0};
    const isogi_volume good = {.data = voxel, .type = ISOGI_F32, .size = {2, 2, 2}};
    isogi_pyramid *p = (isogi_pyramid *)1;
    isogi_volume v;
    CHECK(isogi_volume_validate(&good) == ISOGI_OK && !isogi_volume_fault(&good), "good");
    CHECK(isogi_vol_build(&p, NULL, NULL) == ISOGI_INVALID && isogi_volume_fault(NULL), "null");
#define REFUSED(change, code)                                                                                                  \
    v = good, change;                                                                                                          \
    CHECK(isogi_vol_build(&p, &v, NULL) == code && isogi_volume_validate(&v) == code, #change);                                \
    CHECK(fault_names(isogi_volume_fault(&v), #change), "%s: %s", #change, isogi_volume_fault(&v))
    REFUSED(v.data = NULL, ISOGI_INVALID);
    REFUSED(v.data = (const char *)voxel + 1, ISOGI_INVALID);
    REFUSED(v.type = (isogi_type)17, ISOGI_INVALID);
    REFUSED(v.size[1] = 0, ISOGI_INVALID);
    REFUSED((v.size[0] = v.size[1] = v.size[2] = 0x7fffffff), ISOGI_TOO_LARGE);
    REFUSED(v.size[0] = 0x80000000u, ISOGI_TOO_LARGE);
    REFUSED(v.halo_low[1] = 0x80000000u, ISOGI_TOO_LARGE);
    for (int i = 0; i < 3; i++) {
        const double bad[3] = {-1, (double)NAN, (double)INFINITY};
        REFUSED(v.spacing[i] = bad[i], ISOGI_INVALID);
    }
    REFUSED(v.axes[0] = v.axes[4] = 1, ISOGI_INVALID); /* singular */
    REFUSED(v.axes[1] = (double)NAN, ISOGI_INVALID);
    REFUSED(v.origin[2] = (double)INFINITY, ISOGI_INVALID);
    REFUSED((v.stride[0] = 3, v.stride[1] = 8, v.stride[2] = 16), ISOGI_INVALID);
    REFUSED(v.scale = (double)NAN, ISOGI_INVALID);
    REFUSED(v.bias = 1e301, ISOGI_INVALID);
#if !defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ == 0 /* registers of more range find a finite inverse */
    REFUSED((v.axes[0] = v.axes[4] = v.axes[8] = 1e-105), ISOGI_INVALID);
    REFUSED((v.axes[0] = v.axes[8] = 1e-150, v.axes[4] = 1e-10), ISOGI_INVALID);
#endif
    REFUSED(v.spacing[1] = 1e-310, ISOGI_INVALID);
#if SIZE_MAX > 0xffffffffu
    REFUSED(v.first[2] = ((size_t)1 << 53) + 1, ISOGI_TOO_LARGE);
#endif
#undef REFUSED
    CHECK(p == (isogi_pyramid *)1, "the output was touched");
}

/* Two blocks, one outside and one inside, that share a face of NaN alone: no finite value says where the surface is. */
TEST(a_face_of_nan_between_two_sides_is_no_surface) {
    for (int x = 3; x <= 5; x++) {
        field f = field_new(12, 3, 3);
        for (int i = 0; i < 108; i++) f.value[i] = i % 12 < x ? 0 : i % 12 == x ? (double)NAN : 1;
        field_build(&f);
        isogi_ray ray = {.origin = {-1, 0.7, 0.6}, .dir = {1, 0, 0}, .isovalue = 0.5};
        isogi_hit hit = {0};
        isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
        CHECK(hit.side == 0, "NaN at x = %d: side %d at t = %g", x, hit.side, hit.t);
        field_free(&f);
    }
}

TEST(cells_that_touch_a_nan_hold_no_surface) {
    test_random r = {11};
    const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    for (int b = 0; b < 3; b++) {
        field f = field_new(9, 9, 9);
        field_fill(&f, NOISE, &r);
        for (int i = 0; i < 40; i++) f.value[random_bits(&r) % 729] = bad[b];
        field_build(&f);
        for (int i = 0; i < 20000; i++) {
            isogi_ray ray = any_ray(&f, random_range(&r, -0.5, 0.5), &r);
            isogi_hit hit = {0};
            isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
            if (!hit.side) continue;
            CHECK(isfinite(hit.t) && isfinite(hit.local[0]), "t %g", hit.t);
            /* a hit on a face may belong to either cell: look at those that lie well inside */
            int inner = 1, touches = 0;
            for (int a = 0; a < 3; a++) inner &= hit.local[a] > 1e-9 && hit.local[a] < 1 - 1e-9;
            for (int c = 0; c < 8; c++)
                touches |=
                    !isfinite(*field_at(&f, (int)hit.cell[0] + (c & 1), (int)hit.cell[1] + (c >> 1 & 1), (int)hit.cell[2] + (c >> 2)));
            CHECK(!(inner && touches), "a hit in cell %u %u %u", hit.cell[0], hit.cell[1], hit.cell[2]);
        }
        field_free(&f);
    }
}

TEST(axes_of_one_voxel_hold_no_surface_and_can_be_sampled) {
    double value[3] = {1, 2, 4};
    for (int axis = 0; axis < 3; axis++) {
        isogi_volume v = {.data = value, .type = ISOGI_F64, .size = {1, 1, 1}};
        isogi_pyramid *p = NULL;
        isogi_ray ray = {.origin = {0, 0, 0}, .dir = {1, 1, 1}, .isovalue = 1.5};
        isogi_hit hit = {0};
        float point[1][3] = {{0, 0, 0}}, sampled = 0, gradient[1][3] = {{0}};
        v.size[axis] = 3;
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "axis %d", axis);
        isogi_vol_intersect(p, &ray, 1, &hit, NULL);
        CHECK(hit.side == 0, "side %d", hit.side);
        point[0][axis] = 1.5f;
        isogi_vol_sample(p, (const float(*)[3])point, 1, &sampled, gradient);
        CHECK(sampled == 3 && gradient[0][axis] == 2, "value %g gradient %g", (double)sampled, (double)gradient[0][axis]);
        isogi_vol_sample_smooth(p, (const float(*)[3])point, 1, &sampled, gradient);
        CHECK(isfinite(sampled) && isfinite(gradient[0][axis]), "value %g", (double)sampled);
        isogi_vol_free(p);
    }
}

/* ---- types, strides, placement ---- */

TEST(every_type_stride_and_placement_reads_the_same_values) {
    test_random r = {12};
    enum { N = 6 };
    double base[N * N * N];
    for (int i = 0; i < N * N * N; i++) base[i] = floor(random_range(&r, 0, 100));
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++) {
        size_t bytes = type <= ISOGI_I8 ? 1 : type <= ISOGI_I16 ? 2 : type == ISOGI_F32 ? 4 : 8;
        /* interleaved by two, y flipped by a negative stride */
        char *data = (char *)calloc((size_t)(N * N * N) * 2, bytes);
        for (int k = 0; k < N; k++)
            for (int j = 0; j < N; j++)
                for (int i = 0; i < N; i++) {
                    double v = base[i + N * (j + N * k)] - (type == ISOGI_I8 || type == ISOGI_I16 ? 50 : 0);
                    char *at = data + (size_t)(2 * (i + N * ((N - 1 - j) + N * k))) * bytes;
                    switch (type) {
                    case ISOGI_U8: *(uint8_t *)(void *)at = (uint8_t)v; break;
                    case ISOGI_I8: *(int8_t *)(void *)at = (int8_t)v; break;
                    case ISOGI_U16: *(uint16_t *)(void *)at = (uint16_t)v; break;
                    case ISOGI_I16: *(int16_t *)(void *)at = (int16_t)v; break;
                    case ISOGI_F32: *(float *)(void *)at = (float)v; break;
                    default: *(double *)(void *)at = v;
                    }
                }
        isogi_volume v = {.type = (isogi_type)type, .size = {N, N, N}, .scale = 2, .bias = 1};
        ptrdiff_t b = (ptrdiff_t)bytes;
        v.data = data + (size_t)(2 * N * (N - 1)) * bytes;
        v.stride[0] = 2 * b, v.stride[1] = -2 * N * b, v.stride[2] = 2 * N * N * b;
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "type %d", type);
        double shift = type == ISOGI_I8 || type == ISOGI_I16 ? 50 : 0;
        for (int i = 0; i < N * N * N; i++) {
            float point[1][3] = {{(float)(i % N), (float)(i / N % N), (float)(i / N / N)}}, value;
            isogi_vol_sample(p, (const float(*)[3])point, 1, &value, NULL);
            CHECK((double)value == 2 * (base[i] - shift) + 1, "type %d voxel %d: %g, not %g", type, i, (double)value,
                  2 * (base[i] - shift) + 1);
        }
        isogi_vol_free(p);
        free(data);
    }
}

TEST(oriented_axes_map_both_ways_and_turn_gradients) {
    field f = field_new(6, 7, 8);
    double c = cos(0.7), s = sin(0.7), g[3] = {0.3, -0.8, 0.5};
    const double axes[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    memcpy(f.volume.axes, axes, sizeof axes);
    f.volume.spacing[0] = 0.5, f.volume.spacing[1] = 2, f.volume.spacing[2] = 3;
    f.volume.origin[0] = 10, f.volume.origin[1] = -5, f.volume.origin[2] = 2;
    field_build(&f);
    for (int k = 0; k < 8; k++)
        for (int j = 0; j < 7; j++)
            for (int i = 0; i < 6; i++) {
                double grid[3] = {(double)i, (double)j, (double)k}, world[3], back[3];
                isogi_vol_to_world(f.pyramid, grid, world);
                isogi_vol_to_grid(f.pyramid, world, back);
                *field_at(&f, i, j, k) = g[0] * world[0] + g[1] * world[1] + g[2] * world[2];
                for (int a = 0; a < 3; a++) CHECK(fabs(back[a] - grid[a]) < 1e-13, "grid %g back %g", grid[a], back[a]);
            }
    isogi_vol_free(f.pyramid);
    field_build(&f);
    test_random r = {13};
    for (int i = 0; i < 1000; i++) {
        double grid[3] = {random_range(&r, 0, 5), random_range(&r, 0, 6), random_range(&r, 0, 7)}, world[3];
        isogi_vol_to_world(f.pyramid, grid, world);
        float point[1][3] = {{(float)world[0], (float)world[1], (float)world[2]}}, value[2], gradient[2][3];
        isogi_vol_sample(f.pyramid, (const float(*)[3])point, 1, &value[0], &gradient[0]);
        isogi_vol_sample_smooth(f.pyramid, (const float(*)[3])point, 1, &value[1], &gradient[1]);
        double truth = g[0] * world[0] + g[1] * world[1] + g[2] * world[2];
        for (int m = 0; m < 2; m++) {
            /* float points and results: a few ulp of the largest coordinate */
            CHECK(fabs((double)value[m] - truth) < 1e-5, "value %g, not %g", (double)value[m], truth);
            for (int a = 0; a < 3; a++)
                CHECK(fabs((double)gradient[m][a] - g[a]) < 1e-6, "gradient %g, not %g", (double)gradient[m][a], g[a]);
        }
        isogi_ray ray = {.origin = {world[0], world[1], world[2]}, .dir = {0.2f, 1, 0.3f}, .isovalue = truth - 1};
        isogi_hit hit = {0};
        float normal[1][3], position[1][3];
        isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
        if (!hit.side) continue;
        isogi_vol_positions(f.pyramid, &hit, 1, position);
        isogi_vol_normals(f.pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal);
        double at = g[0] * (double)position[0][0] + g[1] * (double)position[0][1] + g[2] * (double)position[0][2];
        CHECK(fabs(at - (truth - 1)) < 1e-5, "hit at %g, not %g", at, truth - 1);
        double length = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
        for (int a = 0; a < 3; a++) CHECK(fabs((double)normal[0][a] + g[a] / length) < 1e-6, "normal %g", (double)normal[0][a]);
    }
    field_free(&f);
}

/* ---- B-spline ---- */

/* The definition: 64 products of one-dimensional basis functions, with voxels continued linearly, in long double. */
static real bspline_basis(real x, int derivative) {
    real a = fabsl(x), s = x < 0 ? -1 : 1;
    if (a >= 2) return 0;
    if (derivative) return s * (a < 1 ? (real)1.5 * a * a - 2 * a : -(2 - a) * (2 - a) / 2);
    return a < 1 ? ((real)4 - 6 * a * a + 3 * a * a * a) / 6 : (2 - a) * (2 - a) * (2 - a) / 6;
}

static real voxel_continued(field *f, int i, int j, int k) {
    int v[3] = {i, j, k};
    for (int a = 0; a < 3; a++) {
        int last = f->size[a] - 1, w[3] = {i, j, k}, u[3] = {i, j, k};
        if (v[a] >= 0 && v[a] <= last) continue;
        w[a] = v[a] < 0 ? 0 : last, u[a] = v[a] < 0 ? 1 : last - 1;
        return 2 * voxel_continued(f, w[0], w[1], w[2]) - voxel_continued(f, u[0], u[1], u[2]);
    }
    return (real)*field_at(f, i, j, k);
}

TEST(bspline_agrees_with_its_definition) {
    test_random r = {14};
    for (int v = 0; v < (QUICK_SUITE ? 16 : 40); v++) {
        field f = field_new(2 + (int)(random_bits(&r) % 5), 2 + (int)(random_bits(&r) % 5), 2 + (int)(random_bits(&r) % 5));
        int voxels = f.size[0] * f.size[1] * f.size[2];
        float *raw = (float *)malloc((size_t)voxels * sizeof *raw);
        field_fill(&f, NOISE, &r);
        if (v & 1) { /* floats, scaled */
            for (int i = 0; i < voxels; i++) raw[i] = (float)f.value[i], f.value[i] = 0.25 * (double)raw[i] + 3;
            f.volume.data = raw, f.volume.type = ISOGI_F32, f.volume.scale = 0.25, f.volume.bias = 3;
        }
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = random_range(&r, 0.2, 3);
        field_build(&f);
        for (int i = 0; i < 200; i++) {
            float point[1][3], value, gradient[1][3];
            real g[3], want[4] = {0};
            for (int a = 0; a < 3; a++) {
                double at = random_bits(&r) % 4 ? random_range(&r, 0, f.size[a] - 1) : (double)(random_bits(&r) % (uint64_t)f.size[a]);
                point[0][a] = (float)(at * f.volume.spacing[a]);
                g[a] = (real)((double)point[0][a] / f.volume.spacing[a]);
                if (g[a] > f.size[a] - 1) g[a] = f.size[a] - 1;
            }
            for (int z = -1; z <= f.size[2]; z++)
                for (int y = -1; y <= f.size[1]; y++)
                    for (int x = -1; x <= f.size[0]; x++)
                        for (int m = 0; m < 4; m++)
                            want[m] += voxel_continued(&f, x, y, z) * bspline_basis(g[0] - x, m == 1) * bspline_basis(g[1] - y, m == 2) *
                                       bspline_basis(g[2] - z, m == 3);
            isogi_vol_sample_smooth(f.pyramid, (const float(*)[3])point, 1, &value, gradient);
            CHECK(fabs((double)((real)value - want[0])) < 1e-6, "value %g, not %Lg", (double)value, want[0]);
            for (int a = 0; a < 3; a++) {
                real truth = want[a + 1] / (real)f.volume.spacing[a];
                /* issue: 1e-5 of (largest sample / spacing) */
                CHECK(fabsl((real)gradient[0][a] - truth) < 1e-5L / (real)f.volume.spacing[a], "gradient %g, not %Lg",
                      (double)gradient[0][a], truth);
            }
        }
        field_free(&f);
        free(raw);
    }
}

TEST(bspline_reproduces_constant_linear_and_quadratic_derivatives) {
    test_random r = {15};
    for (int degree = 0; degree <= 2; degree++) {
        field f = field_new(9, 8, 10);
        double q[10];
        for (int i = 0; i < 10; i++) q[i] = random_range(&r, -1, 1) * (i == 0 || (i < 4 && degree >= 1) || degree == 2);
        for (int k = 0; k < 10; k++)
            for (int j = 0; j < 8; j++)
                for (int i = 0; i < 9; i++)
                    *field_at(&f, i, j, k) = q[0] + q[1] * i + q[2] * j + q[3] * k + q[4] * i * i + q[5] * j * j + q[6] * k * k +
                                             q[7] * i * j + q[8] * j * k + q[9] * k * i;
        field_build(&f);
        for (int i = 0; i < 2000; i++) {
            double margin = degree == 2 ? 1 : 0; /* beyond the border the field is continued linearly */
            double x = random_range(&r, margin, 8 - margin), y = random_range(&r, margin, 7 - margin),
                   z = random_range(&r, margin, 9 - margin);
            float point[1][3] = {{(float)x, (float)y, (float)z}}, gradient[1][3];
            x = (double)point[0][0], y = (double)point[0][1], z = (double)point[0][2];
            double truth[3] = {q[1] + 2 * q[4] * x + q[7] * y + q[9] * z, q[2] + 2 * q[5] * y + q[7] * x + q[8] * z,
                               q[3] + 2 * q[6] * z + q[8] * y + q[9] * x};
            isogi_vol_sample_smooth(f.pyramid, (const float(*)[3])point, 1, NULL, gradient);
            for (int a = 0; a < 3; a++)
                CHECK(fabs((double)gradient[0][a] - truth[a]) < 1e-5, "degree %d: %g, not %g", degree, (double)gradient[0][a], truth[a]);
        }
        field_free(&f);
    }
}

TEST(trilinear_gradient_is_the_derivative_of_the_value) {
    test_random r = {16};
    field f = field_new(7, 7, 7);
    field_fill(&f, NOISE, &r);
    field_build(&f);
    for (int i = 0; i < 5000; i++) {
        float p[3][3], value[3], gradient[3][3];
        for (int a = 0; a < 3; a++) p[0][a] = (float)(floor(random_range(&r, 0, 6)) + random_range(&r, 0.1, 0.9));
        for (int axis = 0; axis < 3; axis++) {
            memcpy(p[1], p[0], sizeof p[0]), memcpy(p[2], p[0], sizeof p[0]);
            p[1][axis] -= 0.03125f, p[2][axis] += 0.03125f; /* exact: the field is linear along an axis within the cell */
            isogi_vol_sample(f.pyramid, (const float(*)[3])p, 3, value, gradient);
            double slope = ((double)value[2] - (double)value[1]) / ((double)p[2][axis] - (double)p[1][axis]);
            CHECK(fabs(slope - (double)gradient[0][axis]) < 1e-5, "slope %g, gradient %g", slope, (double)gradient[0][axis]);
        }
    }
    field_free(&f);
}

/* ---- pyramid ---- */

TEST(every_block_bounds_its_voxels_and_no_more) {
    test_random r = {17};
    for (int v = 0; v < 12; v++) {
        field f = field_new(1 + (int)(random_bits(&r) % 70), 1 + (int)(random_bits(&r) % 40), 1 + (int)(random_bits(&r) % 70));
        field_fill(&f, NOISE, &r);
        field_build(&f);
        for (int n = 0; n < 3; n++) {
            isogi_level level = isogi_vol_level(f.pyramid, n);
            for (size_t b = 0; b < level.size[0] * level.size[1] * level.size[2]; b++) {
                int at[3] = {(int)(b % level.size[0]), (int)(b / level.size[0] % level.size[1]), (int)(b / level.size[0] / level.size[1])};
                double low = 1e300, high = -1e300;
                int first[3], last[3];
                for (int a = 0; a < 3; a++) {
                    first[a] = at[a] * level.cells;
                    last[a] = first[a] + level.cells < f.size[a] - 1 ? first[a] + level.cells : f.size[a] - 1;
                }
                for (int k = first[2]; k <= last[2]; k++)
                    for (int j = first[1]; j <= last[1]; j++)
                        for (int i = first[0]; i <= last[0]; i++) {
                            double x = *field_at(&f, i, j, k);
                            low = x < low ? x : low, high = x > high ? x : high;
                        }
                CHECK((double)level.range[b][0] <= low && (double)level.range[b][1] >= high,
                      "level %d block %zu: [%g, %g] does not hold [%g, %g]", n, b, (double)level.range[b][0], (double)level.range[b][1],
                      low, high);
                CHECK((double)level.range[b][0] > low - 1e-6 && (double)level.range[b][1] < high + 1e-6, "level %d block %zu is loose", n,
                      b);
            }
        }
        field_free(&f);
    }
}

TEST(skipping_proves_itself_by_counters) {
    int n = 128;
    field f = field_new(n, n, n);
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++)
                *field_at(&f, i, j, k) = 40 - sqrt((i - 64.) * (i - 64.) + (j - 64.) * (j - 64.) + (k - 64.) * (k - 64.));
    field_build(&f);
    test_random r = {18};
    isogi_counters count = {0};
    for (int i = 0; i < 20000; i++) {
        isogi_ray ray = any_ray(&f, 0, &r);
        isogi_hit hit = {0};
        ray.tmin = ray.tmax = 0;
        isogi_vol_intersect(f.pyramid, &ray, 1, &hit, &count);
    }
    double rays = (double)count.rays;
    printf("    per ray: %.2f blocks, %.2f cells, %.2f cubics\n", (double)count.blocks / rays, (double)count.cells / rays,
           (double)count.cubics / rays);
    CHECK(count.rays == 20000, "%g rays", rays);
    /* a ray through 128 cells a side would cross about 130 of them */
    CHECK((double)count.cells / rays < 6 && (double)count.cubics / rays < 2 && (double)count.blocks / rays < 20,
          "per ray: %g blocks, %g cells, %g cubics", (double)count.blocks / rays, (double)count.cells / rays, (double)count.cubics / rays);
    field_free(&f);
}

/* ---- memory and threads ---- */

typedef struct allocator { long calls, fail_at, live; int wrong_size; } allocator;

static void *test_alloc(void *user, size_t size, size_t align) {
    allocator *a = (allocator *)user;
    if (++a->calls == a->fail_at) return NULL;
    char *p = NULL;
    if (posix_memalign((void **)&p, align, size + align)) return NULL;
    memcpy(p, &size, sizeof size);
    a->live++;
    return p + align;
}

static void test_release(void *user, void *p, size_t size) {
    allocator *a = (allocator *)user;
    size_t allocated;
    memcpy(&allocated, (char *)p - 64, sizeof allocated);
    a->wrong_size += allocated != size;
    a->live--;
    free((char *)p - 64);
}

TEST(building_survives_every_failing_allocation) {
    test_random r = {19};
    field f = field_new(20, 21, 22);
    field_fill(&f, NOISE, &r);
    for (long k = 1;; k++) {
        allocator a = {0, k, 0, 0};
        isogi_context context = {.alloc = test_alloc, .release = test_release, .user = &a, .threads = 1};
        isogi_pyramid *p = NULL;
        isogi_result result = isogi_vol_build(&p, &f.volume, &context);
        if (result == ISOGI_OK) isogi_vol_free(p);
        else CHECK(result == ISOGI_NO_MEMORY && !p, "%s", isogi_result_string(result));
        CHECK(a.live == 0 && a.wrong_size == 0, "allocation %ld fails: %ld blocks live, %d wrong sizes", k, a.live, a.wrong_size);
        if (result == ISOGI_OK) { CHECK(k > 3, "only %ld allocations were tried", k); break; }
    }
    field_free(&f);
}

typedef struct squares { double out[1000]; } squares;
static void square_task(void *arg, size_t i) { ((squares *)arg)->out[i] = (double)i * (double)i; }
static int cancel(void *user, double fraction) {
    ++*(int *)user;
    return fraction > 0; /* however few tasks this thread gets, its last report is the end */
}
static void backwards(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg) {
    *(int *)user += 1;
    while (n--) task(arg, n);
}

TEST(parallel_runs_every_task_once_and_can_be_cancelled) {
    for (int threads = 0; threads <= 8; threads++) {
        squares s = {{0}};
        isogi_context context = {.threads = threads};
        CHECK(isogi_parallel(&context, 1000, square_task, &s, 0, 1) == ISOGI_OK, "threads %d", threads);
        for (int i = 0; i < 1000; i++) CHECK(s.out[i] == (double)i * i, "task %d: %g", i, s.out[i]);
    }
    squares s = {{0}};
    int calls = 0;
    isogi_context context = {.parallel_for = backwards, .user = (void *)&calls};
    CHECK(isogi_parallel(&context, 1000, square_task, &s, 0, 1) == ISOGI_OK && calls == 1 && s.out[999] == 998001, "calls %d", calls);
    for (int own = 0; own < 2; own++) {
        calls = 0;
        isogi_context cancels = {.progress = cancel, .user = &calls, .threads = 1 + own};
        CHECK(isogi_parallel(&cancels, 1000, square_task, &s, 0, 1) == ISOGI_CANCELLED, "calls %d", calls);
    }
    CHECK(isogi_parallel(NULL, 0, square_task, &s, 0, 1) == ISOGI_OK && isogi_parallel(NULL, 5, NULL, &s, 0, 1) == ISOGI_INVALID,
          "edge cases");
}

/* Fractions that a build tells: they rise to 1. */
typedef struct told_fractions {
    double last;
    int falls;
} told_fractions;

static int note_fraction(void *user, double fraction) {
    told_fractions *t = (told_fractions *)user;
    t->falls += !(fraction >= t->last), t->last = fraction;
    return 0;
}

TEST(builds_tell_their_progress_up_to_the_end) {
    for (int kind = 0; kind < 4; kind++) { /* as usual, compact, by plain code, with a voxel that is not a number */
        field f = field_new(30, 20, 40);
        told_fractions told = {0, 0};
        isogi_context context = {.progress = note_fraction, .user = &told, .threads = 1, .force_path = kind == 2};
        isogi_pyramid *p = NULL;
        for (int i = 0; i < 30 * 20 * 40; i++) f.value[i] = i % 7;
        if (kind == 3) f.value[100] = (double)NAN;
        f.volume.compact = kind == 1;
        CHECK(isogi_vol_build(&p, &f.volume, &context) == ISOGI_OK, "kind %d", kind);
        CHECK(told.last >= 1 && told.last <= 1 && !told.falls, "kind %d: %g in the end, %d falls", kind, told.last, told.falls);
        isogi_vol_free(p), free(f.value);
    }
}

/* A caller who wants to stop at one turn of the progress: what it was told, and memory. */
typedef struct turns {
    allocator memory; /* first: contexts have one user */
    long told, stop_at, told_after;
    int stopped, falls;
    double last;
} turns;

static int stop_at_turn(void *user, double fraction) {
    turns *t = (turns *)user;
    t->falls += !(fraction >= t->last && fraction <= 1), t->last = fraction;
    t->told_after += t->stopped;
    return ++t->told == t->stop_at && (t->stopped = 1);
}

static void one_by_one(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg) {
    (void)user;
    while (n--) task(arg, n);
}

static double waves(void *user, const double p[3], double g[3]) {
    (void)user;
    for (int a = 0; a < 3; a++) g[a] = cos(p[a]);
    return sin(p[0]) + sin(p[1]) + sin(p[2]);
}

/* As usual, compact, by plain code, with a voxel that is not a number; of a function; coefficients alone. */
enum { AS_USUAL, COMPACT, PLAIN, BROKEN, FUNCTION, COEFFICIENTS, MADE };
static isogi_result build_kind(int kind, const field *f, isogi_pyramid **p, float *coefficients, const isogi_context *context) {
    static const isogi_field shape = {.value = waves, .hessian = 1, .high = {9, 7, 8}, .cells = {20, 30, 50}};
    isogi_context own = *context;
    isogi_volume volume = f->volume;
    volume.compact = kind == COMPACT, own.force_path = kind == PLAIN;
    if (kind == FUNCTION) return isogi_vol_build_field(p, &shape, &own);
    if (kind == COEFFICIENTS) return isogi_vol_prefilter(&volume, coefficients, &own);
    return isogi_vol_build(p, &volume, &own);
}

/* Stopped at every turn of its progress, the last one among them, by one thread, two, or another's scheduler: the code says so, nothing is
   made, nothing leaks and nobody is asked again. Not stopped, it is told all up to the end, and what is made is the same. */
TEST(builds_stop_at_any_turn) {
    enum { X = 17, Y = 21, Z = 30 };
    static float coefficients[2][X * Y * Z];
    for (int kind = 0; kind < MADE; kind++) {
        field f = field_new(X, Y, Z);
        isogi_pyramid *expected = NULL;
        for (int i = 0; i < X * Y * Z; i++) f.value[i] = i % 7 + 0.3 * (i % 11);
        if (kind == BROKEN) f.value[100] = (double)NAN;
        CHECK(build_kind(kind, &f, &expected, coefficients[0], &serial) == ISOGI_OK, "kind %d", kind);
        for (int way = 0; way < 3; way++)
            for (long k = 1, more = 1; more && k < 1000; k += way == 1 && !LONG_SUITE ? 7 : 1) {
                turns t = {.stop_at = k};
                const isogi_context context = {.alloc = test_alloc, .release = test_release, .progress = stop_at_turn, .user = &t,
                    .threads = 1 + (way == 1), .parallel_for = way == 2 ? one_by_one : NULL};
                isogi_pyramid *const untouched = (isogi_pyramid *)(void *)&t;
                isogi_pyramid *p = untouched;
                const isogi_result result = build_kind(kind, &f, &p, coefficients[1], &context);
                more = t.stopped;
                CHECK(result == (t.stopped ? ISOGI_CANCELLED : ISOGI_OK) && !t.told_after && !t.falls,
                      "kind %d, way %d, turn %ld: %s, asked %ld times more, %d falls", kind, way, k, isogi_result_string(result),
                      t.told_after, t.falls);
                CHECK(t.stopped || (t.last >= 1 && (way == 1 || k > 3)), "kind %d, way %d: told %g in the end, after %ld turns", kind, way,
                      t.last, k - 1);
                CHECK((p == untouched) == (t.stopped || kind == COEFFICIENTS), "kind %d, way %d, turn %ld: a pyramid", kind, way, k);
                if (!t.stopped && kind == COEFFICIENTS)
                    CHECK(!memcmp(coefficients[0], coefficients[1], sizeof coefficients[0]), "way %d: other coefficients", way);
                if (!t.stopped && kind != COEFFICIENTS) {
                    for (int n = 0; n < 3; n++) {
                        const isogi_level a = isogi_vol_level(p, n), b = isogi_vol_level(expected, n);
                        CHECK(!memcmp(a.range, b.range, a.size[0] * a.size[1] * a.size[2] * sizeof *a.range), "kind %d, way %d: level %d",
                              kind, way, n);
                    }
                    isogi_vol_free(p);
                }
                CHECK(t.memory.live == 0 && !t.memory.wrong_size, "kind %d, way %d, turn %ld: %ld blocks left", kind, way, k,
                      t.memory.live);
            }
        isogi_vol_free(expected), free(f.value);
    }
}

/* ---- threads that stay ---- */

/* Counts what was done and by whom: a thread that comes for the first time leaves its mark with itself. */
typedef struct labour {
    const isogi_context *context;
    pthread_key_t mark;
    pthread_mutex_t lock;
    long done[64], fresh, at_work, most, inner;
} labour;

static void labour_task(void *arg, size_t i) {
    labour *l = (labour *)arg;
    const int known = pthread_getspecific(l->mark) != NULL;
    if (!known) pthread_setspecific(l->mark, l);
    pthread_mutex_lock(&l->lock);
    l->done[i]++, l->fresh += !known, l->at_work++;
    l->most = l->at_work > l->most ? l->at_work : l->most;
    pthread_mutex_unlock(&l->lock);
    sched_yield();
    pthread_mutex_lock(&l->lock);
    l->at_work--;
    pthread_mutex_unlock(&l->lock);
}

static labour *labour_begin(const isogi_context *context) {
    labour *l = (labour *)calloc(1, sizeof *l);
    l->context = context;
    if (pthread_key_create(&l->mark, NULL) || pthread_mutex_init(&l->lock, NULL)) abort();
    pthread_setspecific(l->mark, l); /* the thread that calls is known */
    return l;
}

static void labour_end(labour *l) { pthread_key_delete(l->mark), pthread_mutex_destroy(&l->lock), free(l); }

TEST(threads_of_a_pool_stay_and_run_every_task_once) {
    for (int threads = 0; threads <= 6; threads += 1 + threads / 4) {
        isogi_context context = {0};
        CHECK(isogi_thread_pool_create(&context.thread_pool, threads, NULL) == ISOGI_OK, "threads %d", threads);
        labour *l = labour_begin(&context);
        const int cores = threads ? threads : 256;
        long expected[64] = {0};
        for (int job = 0; job < 400; job++) {
            const size_t n = 1 + (size_t)(job * 37 % 64);
            CHECK(isogi_parallel(&context, n, labour_task, l, 0, 1) == ISOGI_OK, "threads %d, job %d", threads, job);
            for (size_t i = 0; i < n; i++) expected[i]++;
        }
        CHECK(!memcmp(expected, l->done, sizeof expected), "threads %d: tasks left out or run twice", threads);
        CHECK(l->fresh < cores && l->most <= cores, "threads %d: %ld of them came, up to %ld at once", threads, l->fresh, l->most);
        isogi_thread_pool_free(context.thread_pool);
        labour_end(l);
    }
#ifndef ISOGI_NO_THREADS
    isogi_context all = {.threads = -1}; /* 0 or less: all cores */
    isogi_thread_pool *begun = isogi_thread_pool_begin(&all);
    CHECK(begun && all.thread_pool == begun, "a pool for all cores, %d", all.threads);
    isogi_thread_pool_end(&all, begun);
#endif
    isogi_context few = {.threads = 2}; /* a context's own limit */
    CHECK(isogi_thread_pool_create(&few.thread_pool, 5, NULL) == ISOGI_OK, "pool");
    labour *l = labour_begin(&few);
    few.threads = 0, isogi_parallel(&few, 64, labour_task, l, 0, 1); /* so that there are more */
    few.threads = 2, l->most = 0, memset(l->done, 0, sizeof l->done);
    for (int job = 0; job < 100; job++) isogi_parallel(&few, 64, labour_task, l, 0, 1);
    CHECK(l->most <= 2 && l->done[63] == 100, "%ld at once, %ld times", l->most, l->done[63]);
    few.threads = 1, l->fresh = l->most = 0;
    for (int job = 0; job < 100; job++) isogi_parallel(&few, 64, labour_task, l, 0, 1);
    CHECK(l->most == 1 && l->fresh == 0, "%ld at once, %ld other threads", l->most, l->fresh);
    isogi_thread_pool_free(few.thread_pool);
    labour_end(l);
}

static void nap(long nanoseconds) {
    const struct timespec t = {0, nanoseconds};
    nanosleep(&t, NULL);
}

/* Waits for a second thread, 5 s at most, and then some more. */
static void meeting_task(void *arg, size_t i) {
    labour *l = (labour *)arg;
    int met = 0;
    (void)i;
    pthread_mutex_lock(&l->lock);
    l->at_work++, l->most = l->at_work > l->most ? l->at_work : l->most;
    pthread_mutex_unlock(&l->lock);
    for (int k = 0; k < 5000 && !met; k++) {
        nap(1000000);
        pthread_mutex_lock(&l->lock);
        met = l->most > 1;
        pthread_mutex_unlock(&l->lock);
    }
    nap(2000000);
    pthread_mutex_lock(&l->lock);
    l->at_work--, l->done[0]++;
    pthread_mutex_unlock(&l->lock);
}

/* Whoever has fallen asleep, too; and a call waits for all that work for it. */
TEST(threads_of_a_pool_wake_up_and_are_waited_for) {
    isogi_context context = {0};
    int alone = 0;
#ifdef ISOGI_NO_THREADS
    alone = 1;
#endif
    CHECK(isogi_thread_pool_create(&context.thread_pool, 4, NULL) == ISOGI_OK, "pool");
    labour *l = labour_begin(&context);
    for (int job = 0; job < 4 && !alone; job++) {
        l->most = l->done[0] = 0;
        isogi_parallel(&context, 8, meeting_task, l, 0, 1);
        pthread_mutex_lock(&l->lock);
        CHECK(l->most > 1 && l->most <= 4, "job %d: %ld threads came together", job, l->most);
        CHECK(l->at_work == 0 && l->done[0] == 8, "job %d: %ld still at work, %ld done", job, l->at_work, l->done[0]);
        pthread_mutex_unlock(&l->lock);
        nap(20000000);
    }
    isogi_thread_pool_free(context.thread_pool);
    labour_end(l);
}

static void inner_task(void *arg, size_t i) {
    labour *l = (labour *)arg;
    squares s = {{0}};
    long right = 0;
    (void)i;
    for (int job = 0; job < 20; job++) {
        memset(&s, 0, sizeof s);
        right += isogi_parallel(l->context, 50, square_task, &s, 0, 1) == ISOGI_OK && s.out[1] == 1 && s.out[49] == 2401;
    }
    pthread_mutex_lock(&l->lock);
    l->inner += right;
    pthread_mutex_unlock(&l->lock);
}

/* Tasks of its own call, and those of several threads. */
TEST(a_pool_at_work_is_as_if_there_were_none) {
    isogi_context context = {0}, others = {.threads = 4};
    int calls = 0;
    squares s = {{0}};
    CHECK(isogi_thread_pool_create(&context.thread_pool, 3, NULL) == ISOGI_OK, "pool");
    labour *l = labour_begin(&context);
    isogi_parallel(&context, 6, inner_task, l, 0, 1);
    isogi_parallel(&others, 6, inner_task, l, 0, 1);
    CHECK(l->inner == 240, "%ld of 240 jobs are right", l->inner);
    context.progress = cancel, context.user = &calls;
    CHECK(isogi_parallel(&context, 1000, square_task, &s, 0, 1) == ISOGI_CANCELLED && calls > 0, "%d calls", calls);
    context.progress = NULL;
    CHECK(isogi_parallel(&context, 1000, square_task, &s, 0, 1) == ISOGI_OK && s.out[999] == 998001, "after a call was cancelled");
    isogi_thread_pool_free(context.thread_pool);
    labour_end(l);
}

TEST(pools_say_what_is_wrong) {
    isogi_thread_pool *pool = NULL;
    allocator a = {0, 1, 0, 0};
    isogi_context context = {.alloc = test_alloc, .release = test_release, .user = &a};
    CHECK(isogi_thread_pool_create(&pool, -1, NULL) == ISOGI_INVALID && isogi_thread_pool_create(NULL, 1, NULL) == ISOGI_INVALID && !pool,
          "arguments");
    CHECK(isogi_thread_pool_create(&pool, 2, &context) == ISOGI_NO_MEMORY && !pool, "no memory");
    CHECK(isogi_thread_pool_create(&pool, 100000, &context) == ISOGI_OK && a.live == 1, "%ld blocks", a.live);
    isogi_thread_pool_free(pool), isogi_thread_pool_free(NULL);
    CHECK(a.live == 0 && a.wrong_size == 0, "%ld blocks live, %d wrong sizes", a.live, a.wrong_size);
}

/* Where a context has a pool, a scheduler or one thread, or no memory is left, it stays as it is; always, where there are no threads. */
TEST(calls_of_many_parts_get_a_pool_where_they_can) {
    allocator a = {0, 0, 0, 0};
    isogi_context plain = {.alloc = test_alloc, .release = test_release, .user = &a}, context = plain;
    isogi_thread_pool *pool = isogi_thread_pool_begin(&context), *other;
    squares s = {{0}};
#ifdef ISOGI_NO_THREADS
    CHECK(!pool && !context.thread_pool && a.live == 0, "%ld blocks", a.live);
#else
    CHECK(pool && context.thread_pool == pool && a.live == 1, "%ld blocks", a.live);
#endif
    other = isogi_thread_pool_begin(&context);
    isogi_thread_pool_end(&context, other);
    CHECK(!other && context.thread_pool == pool, "a call within");
    CHECK(isogi_parallel(&context, 1000, square_task, &s, 0, 1) == ISOGI_OK && s.out[999] == 998001, "the last task: %g", s.out[999]);
    isogi_thread_pool_end(&context, pool);
    CHECK(!context.thread_pool && a.live == 0 && a.wrong_size == 0, "%ld blocks", a.live);
    context.threads = 1;
    CHECK(!isogi_thread_pool_begin(&context) && !context.thread_pool, "one thread");
    context = plain, context.parallel_for = backwards;
    CHECK(!isogi_thread_pool_begin(&context) && !context.thread_pool, "a scheduler");
    context = plain, a.fail_at = a.calls + 1;
    CHECK(!isogi_thread_pool_begin(&context) && !context.thread_pool && !isogi_thread_pool_begin(NULL), "no memory, no context");
    CHECK(a.live == 0, "%ld blocks", a.live);
}

TEST_MAIN("vol")
