/* Rays where rounding matters most: grazing, along the lattice, in extreme units, through every voxel type and every instruction path.
   What long double leaves undecided is decided in 113-bit numbers where the compiler has them. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "test.h"
#include "reference_wide.h"
#if defined(__unix__)
#include <sys/mman.h>
#endif
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

enum { BATCH = 500 };

/* ---- rays against the reference ---- */

typedef struct tally {
    long rays, hits, wide, undecided, wrong[PATHS];
    double worst; /* |value - isovalue| at hits, in units of the tolerance */
} tally;

static reference_hit truth_of(const scene *s, const isogi_ray *ray, int all_finite, tally *count) {
    double tolerance = rounding(s, ray), origin[3], dir[3];
    wide_ray g = to_grid(s, ray);
    reference_field field = {s->value, {s->size[0], s->size[1], s->size[2]}, 64 * (real)tolerance};
    reference_hit hit = {0, 0, 0};
    for (int a = 0; a < 3; a++) origin[a] = (double)g.o[a], dir[a] = (double)g.d[a];
    if (all_finite) hit = reference_intersect(&field, origin, dir, ray->tmin, ray->tmax, ray->isovalue);
    if (hit.decided) return hit;
    count->wide++;
    return wide_intersect(s, ray);
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
                count->wrong[p] += one.side != truth.side || (one.side && !wide_same_hit(s, &rays[i], one.t, truth.t));
            }
            if (h->side != truth.side || occluded[p][i] != (truth.side != 0) ||
                (h->side && !wide_same_hit(s, &rays[i], h->t, truth.t))) {
                if (!count->wrong[p]++)
                    printf("    path %d: side %d at %.17g, occluded %d, reference %d at %.17g; origin %.17g %.17g %.17g dir %.9g %.9g %.9g "
                           "t %.17g %.17g isovalue %.17g size %d %d %d type %d\n",
                           p, h->side, h->t, occluded[p][i], truth.side, (double)truth.t, rays[i].origin[0], rays[i].origin[1],
                           rays[i].origin[2], (double)rays[i].dir[0], (double)rays[i].dir[1], (double)rays[i].dir[2], rays[i].tmin,
                           rays[i].tmax, rays[i].isovalue, s->size[0], s->size[1], s->size[2], (int)s->volume.type);
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
    printf("    %s: %ld rays, %ld hits, %ld looked at in %d bits, %ld undecided; residual %.2g roundings\n", what, t->rays, t->hits,
           t->wide, WIDE_BITS, t->undecided, t->worst);
    for (int p = 0; p < PATHS; p++) CHECK(t->wrong[p] == 0, "%s: path %d is wrong for %ld of %ld rays", what, p, t->wrong[p], t->rays);
    CHECK(t->undecided * 100 <= t->rays * (WIDE_BITS == 113 ? 0 : undecided_percent), "%ld of %ld undecided", t->undecided, t->rays);
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
    const int batch = QUICK_SUITE ? 200 : BATCH;
    for (int done = 0; done < n; done += batch) {
        for (int i = 0; i < batch; i++) {
            double isovalue = random_range(r, low, high);
            if (step > 0) isovalue = step * floor(isovalue / step);
            rays[i] = lattice ? ray_on_lattice(s, isovalue, r) : ray_through(s, isovalue, 60, r);
        }
        compare_rays(s, rays, batch, all_finite, t);
    }
}

/* ---- shapes and sizes ---- */

TEST(odd_sizes_hit_like_the_reference) {
    const int size[][3] = {{2, 2, 2},   {2, 5, 9},   {9, 2, 17},   {4, 5, 3},   {63, 3, 2},   {64, 2, 5},   {65, 4, 2},   {66, 3, 3},
                           {2, 65, 17}, {5, 16, 64}, {16, 17, 15}, {3, 2, 129}, {63, 17, 66}, {64, 65, 16}, {65, 33, 64}, {66, 63, 9}};
    test_random r = {1};
    tally t = {0};
    for (int i = 0; i < 32; i++) {
        const int *n = size[i / 2];
        scene s = scene_new(n[0], n[1], n[2]);
        if (i & 1) scene_waves(&s, &r);
        else scene_noise(&s, 0, &r);
        scene_build(&s);
        run_rays(&s, 0, LONG_SUITE ? 20000 : 150, -0.8, 0.8, 0, 1, &t, &r);
        run_rays(&s, 1, LONG_SUITE ? 20000 : 150, -0.8, 0.8, 0, 1, &t, &r);
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
                run_rays(&s, 0, LONG_SUITE ? 20000 : 150, low, high, at_levels ? 1 / 8.0 : 0, 1, &t, &r);
                if (!at_levels) run_rays(&s, 1, LONG_SUITE ? 20000 : 150, low, high, 0, 1, &t, &r);
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
        for (int v = 0; v < (LONG_SUITE ? 6 : 3); v++) {
            scene s = scene_new(7, 9, 6);
            scene_noise(&s, 0, &r);
            for (size_t i = 0; i < scene_voxels(&s); i++) s.value[i] *= unit[k];
            for (int a = 0; a < 3; a++) s.volume.spacing[a] = spacing[k][a], s.volume.origin[a] = origin[k] * spacing[k][a];
            scene_build(&s);
            run_rays(&s, 0, LONG_SUITE ? 20000 : 130, -0.7 * unit[k], 0.7 * unit[k], 0, 0, &t, &r);
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
    for (int v = 0; v < (LONG_SUITE ? 2000 : QUICK_SUITE ? 12 : 30); v++) {
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

/* Rays through corners of the lattice: rounding moves them off it by some 1e-16, and what they meet there must not depend on that. One
   voxel has the isovalue, all others are below it: exact rays touch it, from however far they come, alone or together, on every path. */
/* Beside faces by one or a few roundings, nearly still on the axes across these: the time to a face is far larger than that to the next
   surface, and lost where it is reckoned from rounded places. One ray at a time, which has ways of its own, against the plain path. */
TEST(rays_that_hardly_leave_a_face_hit_alike_on_all_paths) {
    test_random r = {17};
    long wrong[PATHS] = {0}, hits = 0, rays = 0;
    for (int turn = 0; turn < (LONG_SUITE ? 4000 : 150); turn++) {
        scene s = scene_new(2 + (int)(random_bits(&r) % 7), 2 + (int)(random_bits(&r) % 7), 2 + (int)(random_bits(&r) % 7));
        scene_noise(&s, turn & 1 ? 0 : 8, &r);
        scene_build(&s);
        for (int i = 0; i < 400; i++) {
            isogi_ray ray = {.isovalue = random_range(&r, -0.5, 0.5)};
            isogi_hit plain, hit;
            const int across = (int)(random_bits(&r) % 3); /* the axis on which it moves as others do */
            for (int a = 0; a < 3; a++) {
                const double slow = pow(10, -random_range(&r, 13, 18));
                ray.origin[a] = (double)(random_bits(&r) % (uint64_t)s.size[a]) + (double)((int)(random_bits(&r) % 17) - 8) * 2.3e-16;
                ray.dir[a] = (float)((a == across || !(random_bits(&r) & 3) ? 1 : slow) * random_range(&r, -2, 2));
            }
            isogi_vol_intersect(s.pyramid[1], &ray, 1, &plain, NULL);
            rays++, hits += plain.side != 0;
            for (int p = 0; p < PATHS; p++) {
                isogi_vol_intersect(s.pyramid[p], &ray, 1, &hit, NULL);
                if (hit.side == plain.side && (!hit.side || fabs(hit.t - plain.t) <= 1e-9 * fmax(1, plain.t))) continue;
                if (!wrong[p]++)
                    printf("    path %d: side %d at %.17g, plain %d at %.17g; origin %.17g %.17g %.17g dir %.9g %.9g %.9g\n", p, hit.side,
                           hit.t, plain.side, plain.t, ray.origin[0], ray.origin[1], ray.origin[2], (double)ray.dir[0], (double)ray.dir[1],
                           (double)ray.dir[2]);
            }
        }
        scene_free(&s);
    }
    printf("    %ld rays, %ld hits\n", rays, hits);
    for (int p = 0; p < PATHS; p++) CHECK(wrong[p] == 0, "path %d differs for %ld of %ld rays", p, wrong[p], rays);
    CHECK(hits * 4 > rays, "%ld hits in %ld rays: the test says little", hits, rays);
}

/* Rays nearly along an axis, through the lattice's edges within a few roundings: which face comes first there is a matter of rounding,
   but t and the place of a hit must say the same. */
TEST(t_and_place_agree_where_rays_run_along_edges) {
    test_random r = {31};
    scene s = scene_new(13, 11, 9);
    double worst[PATHS] = {0};
    long hits = 0;
    scene_noise(&s, 0, &r);
    scene_build(&s);
    for (int turn = 0; turn < (LONG_SUITE ? 3000000 : QUICK_SUITE ? 10000 : 30000); turn++) {
        enum { RAYS = 4 };
        isogi_ray ray[RAYS];
        isogi_hit one, hit[RAYS];
        const int fast = (int)(random_bits(&r) % 3);
        memset(ray, 0, sizeof ray);
        for (int a = 0; a < 3; a++) {
            ray[0].origin[a] = 1 + (double)(random_bits(&r) % 7) + (double)((int)(random_bits(&r) % 25) - 12) * 0x1p-51;
            ray[0].dir[a] = (float)(random_range(&r, -1, 1) * pow(10, -random_range(&r, 6, 10)));
        }
        ray[0].origin[fast] = (double)(random_bits(&r) % 8), ray[0].dir[fast] = random_bits(&r) & 1 ? 1 : -1;
        ray[0].tmin = -30, ray[0].isovalue = random_range(&r, -0.9, 0.9);
        for (int i = 1; i < RAYS; i++) ray[i] = ray[0];
        for (int p = 0; p < PATHS; p++) {
            isogi_vol_intersect(s.pyramid[p], ray, 1, &one, NULL);
            isogi_vol_intersect(s.pyramid[p], ray, RAYS, hit, NULL);
            for (int i = 0; i < 2; i++) {
                const isogi_hit *h = i ? &hit[RAYS - 1] : &one;
                const double at = ray[0].origin[fast] + h->t * (double)ray[0].dir[fast];
                if (!h->side) continue;
                hits++, worst[p] = fmax(worst[p], fabs(h->cell[fast] + h->local[fast] - at));
            }
        }
    }
    printf("    %ld hits\n", hits);
    /* the accuracy that the header states */
    for (int p = 0; p < PATHS; p++) CHECK(worst[p] < 1e-12, "path %d: %g cells apart", p, worst[p]);
    CHECK(hits > 100000, "%ld hits: the test says little", hits);
    scene_free(&s);
}

TEST(one_voxel_is_touched_by_every_ray_through_it) {
    enum { N = 9, RAYS = 16 };
    static float data[N * N * N];
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    long rays = 0, missed[5] = {0}, apart[5] = {0};
    isogi_pyramid *p[5];
    for (int i = 0; i < N * N * N; i++) data[i] = i == 4 + N * 4 + N * N * 4 ? 0.0f : -1.0f;
    for (int path = 1; path < 5; path++) {
        isogi_context context = {.threads = 1, .force_path = path};
        CHECK(isogi_vol_build(&p[path], &volume, &context) == ISOGI_OK, "build");
    }
    for (int d = 0; d < 15 * 15 * 15; d++) {
        isogi_ray ray[RAYS];
        isogi_hit hit[RAYS];
        const int dir[3] = {d % 15 - 7, d / 15 % 15 - 7, d / 225 - 7};
        if (!dir[0] && !dir[1] && !dir[2]) continue;
        for (int away = 1; away < 80; away += LONG_SUITE ? 1 : 26) {
            memset(ray, 0, sizeof ray);
            for (int i = 0; i < RAYS; i++)
                for (int a = 0; a < 3; a++) ray[i].dir[a] = (float)dir[a], ray[i].origin[a] = 4 - 0.5 * away * dir[a];
            rays++;
            for (int path = 1; path < 5; path++) {
                isogi_vol_intersect(p[path], ray, 1, hit, NULL);
                missed[path] += hit[0].side != 1 || fabs(hit[0].t - 0.5 * away) > 1e-9;
                isogi_vol_intersect(p[path], ray, RAYS, hit, NULL);
                for (int i = 0; i < RAYS; i++) apart[path] += hit[i].side != 1;
            }
        }
    }
    for (int path = 1; path < 5; path++) {
        CHECK(!missed[path] && !apart[path], "path %d: %ld of %ld rays miss the voxel, %ld together", path, missed[path], rays,
              apart[path]);
        isogi_vol_free(p[path]);
    }
}

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

/* A start in a corner that the surface touches, out of whose cell the ray goes at once: the surface that comes later, behind cells
   without any, is not the one that it starts from. */
TEST(behind_a_touched_corner_the_next_surface_is_met) {
    const double along[7] = {-1, 0, 3, 1, 2, 0.5, -2};
    for (int dx = -1; dx <= 1; dx += 2)
        for (int axis = 0; axis < 3; axis++) {
            int n[3] = {3, 3, 3};
            n[axis] = 7;
            scene s = scene_new(n[0], n[1], n[2]);
            for (size_t i = 0; i < scene_voxels(&s); i++) {
                const int at[3] = {(int)i % n[0], (int)i / n[0] % n[1], (int)i / n[0] / n[1]};
                s.value[i] = along[dx > 0 ? at[axis] : 6 - at[axis]];
            }
            scene_build(&s);
            for (int p = 0; p < PATHS; p++)
                for (int many = 1; many <= 64; many += 63) {
                    static isogi_hit starts[64], hits[64];
                    static float dirs[64][3];
                    for (int i = 0; i < many; i++) {
                        memset(&starts[i], 0, sizeof starts[i]);
                        starts[i].side = 1;
                        for (int a = 0; a < 3; a++) starts[i].local[a] = 0.5, dirs[i][a] = 0.0625f;
                        starts[i].cell[axis] = dx > 0 ? 0 : 5, starts[i].local[axis] = dx > 0 ? 1 : 0, dirs[i][axis] = (float)dx;
                    }
                    isogi_vol_continue(s.pyramid[p], starts, (const float(*)[3])dirs, NULL, 0, 0, (size_t)many, hits, NULL);
                    CHECK(hits[many - 1].side == -1 && fabs(hits[many - 1].t - 4.2) < 1e-12, "path %d axis %d: side %d at %.17g, not 4.2",
                          p, axis, hits[many - 1].side, hits[many - 1].t);
                }
            scene_free(&s);
        }
}

/* Along diagonals from voxel to voxel through cells of whole numbers, for isovalues one rounding beside that of the voxel where they
   leave: there the field is all but 0, by another crossing just behind, but the ray crosses the surface elsewhere in the cell. */
TEST(a_crossing_is_not_mistaken_for_one_behind_the_end_of_its_cell) {
    enum { RAYS = 64 };
    test_random r = {23};
    long rays = 0, wrong[PATHS] = {0}, alone[PATHS] = {0};
    for (int turn = 0; turn < (LONG_SUITE ? 40000 : 4000); turn++) {
        scene s = scene_new(2, 2, 2);
        double b[4], truth = 0, last = 0;
        isogi_ray ray[RAYS];
        isogi_hit hit[RAYS];
        const int from = (int)(random_bits(&r) & 7);
        memset(ray, 0, sizeof ray);
        for (int i = 0; i < 8; i++) s.value[i] = floor(random_range(&r, -40, 41));
        ray[0].isovalue = nextafter(s.value[7 - from], random_bits(&r) & 1 ? 100 : -100), ray[0].tmax = 4;
        b[0] = s.value[from] - ray[0].isovalue, b[3] = s.value[7 - from] - ray[0].isovalue, b[1] = b[2] = 0;
        for (int a = 0; a < 3; a++) {
            b[1] += (s.value[from ^ (1 << a)] - ray[0].isovalue) / 3, b[2] += (s.value[(7 - from) ^ (1 << a)] - ray[0].isovalue) / 3;
            ray[0].dir[a] = from >> a & 1 ? -1 : 1, ray[0].origin[a] = (from >> a & 1) - 3 * (double)ray[0].dir[a];
        }
        int clear = fabs(b[0]) > 0.01;
        for (int i = 1; i < 244 && clear && !(truth > 0); i++) {
            double low = (i - 1) / 256.0, high = i / 256.0, value = 0, u = high;
            for (int k = 0; k < 60; k++) {
                const double v = 1 - u;
                value = v * v * (v * b[0] + 3 * u * b[1]) + u * u * (3 * v * b[2] + u * b[3]);
                if (!k && (value >= 0) == (b[0] >= 0)) break;
                if (!k) truth = 1, last = value;
                if ((value >= 0) == (b[0] >= 0)) low = u;
                else high = u;
                u = 0.5 * (low + high);
            }
            clear = fabs(truth > 0 ? last : value) > 0.01;
            if (truth > 0) truth = 3 + high;
        }
        if (!clear || !(truth > 0)) {
            scene_free(&s);
            continue;
        }
        rays++;
        for (int i = 1; i < RAYS; i++) ray[i] = ray[0];
        scene_build(&s);
        for (int p = 0; p < PATHS; p++) {
            isogi_vol_intersect(s.pyramid[p], ray, 1, hit, NULL);
            alone[p] += hit[0].side != (b[0] >= 0 ? -1 : 1) || !(fabs(hit[0].t - truth) < 1e-9);
            isogi_vol_intersect(s.pyramid[p], ray, RAYS, hit, NULL);
            wrong[p] += hit[RAYS - 1].side != (b[0] >= 0 ? -1 : 1) || !(fabs(hit[RAYS - 1].t - truth) < 1e-9);
        }
        scene_free(&s);
    }
    printf("    %ld rays\n", rays);
    for (int p = 0; p < PATHS; p++) CHECK(!wrong[p] && !alone[p], "path %d: %ld of %ld rays, %ld alone", p, wrong[p], rays, alone[p]);
    CHECK(rays > 500, "%ld rays: the test says little", rays);
}

/* The same for rays of all directions through voxels of a volume, many at once: just before a hit they are on the other side. */
TEST(just_before_a_hit_rays_are_on_the_other_side) {
    enum { RAYS = 96 };
    test_random r = {29};
    long hits = 0, wrong[PATHS] = {0};
    for (int turn = 0; turn < (LONG_SUITE ? 4000 : QUICK_SUITE ? 100 : 200); turn++) {
        scene s = scene_new(9, 9, 9);
        isogi_ray ray[RAYS];
        isogi_hit hit[RAYS];
        memset(ray, 0, sizeof ray);
        for (size_t i = 0; i < scene_voxels(&s); i++) s.value[i] = floor(random_range(&r, -40, 41));
        for (int i = 0; i < RAYS; i++) {
            int at[3];
            for (int a = 0; a < 3; a++) {
                at[a] = 1 + (int)(random_bits(&r) % 7), ray[i].dir[a] = (float)((int)(random_bits(&r) % 129) - 64) / 64;
                if (fabsf(ray[i].dir[a]) < 0.25f) ray[i].dir[a] = 0.25f;
                ray[i].origin[a] = at[a] - (double)ray[i].dir[a];
            }
            ray[i].isovalue = nextafter(s.value[at[0] + 9 * (at[1] + 9 * at[2])], random_bits(&r) & 1 ? 100 : -100);
        }
        scene_build(&s);
        for (int p = 0; p < PATHS; p++) {
            isogi_vol_intersect(s.pyramid[p], ray, RAYS, hit, NULL);
            for (int i = 0; i < RAYS; i++) {
                const wide_ray g = to_grid(&s, &ray[i]);
                const wide before = (wide)hit[i].t - (wide)1e-6;
                int cell[3], finite = 1;
                if (!hit[i].side || hit[i].t < 1e-5) continue;
                wide_cell(&s, &g, before, cell);
                const double value = (double)wide_at(&s, &g, cell, before, ray[i].isovalue, &finite);
                if (fabs(value) < 1e-10) continue;
                hits++, wrong[p] += (value >= 0) != (hit[i].side < 0);
            }
        }
        scene_free(&s);
    }
    printf("    %ld hits\n", hits);
    for (int p = 0; p < PATHS; p++) CHECK(!wrong[p], "path %d: %ld hits", p, wrong[p]);
    CHECK(hits > 20000, "%ld hits: the test says little", hits);
}

/* All numbers times a power of two: the same hits, however far the squares of values leave the range of double. */
TEST(values_of_any_size_have_the_same_hits) {
    const double unit[] = {0x1p-900, 0x1p-500, 0x1p500, 0x1p900};
    test_random r = {11};
    for (int k = 0; k < 4; k++) {
        scene a = scene_new(8, 7, 9), b = scene_new(8, 7, 9);
        isogi_ray rays[BATCH], scaled[BATCH];
        isogi_hit ha[BATCH], hb[BATCH];
        long hits = 0;
        scene_noise(&a, 0, &r);
        for (size_t i = 0; i < scene_voxels(&a); i++) b.value[i] = a.value[i] * unit[k];
        scene_build(&a), scene_build(&b);
        for (int i = 0; i < BATCH; i++)
            rays[i] = scaled[i] = ray_through(&a, random_range(&r, -0.7, 0.7), 20, &r), scaled[i].isovalue *= unit[k];
        for (int p = 0; p < PATHS; p++) {
            isogi_vol_intersect(a.pyramid[p], rays, BATCH, ha, NULL);
            isogi_vol_intersect(b.pyramid[p], scaled, BATCH, hb, NULL);
            for (int i = 0; i < BATCH; i++) {
                hits += ha[i].side != 0;
                CHECK(ha[i].side == hb[i].side && fabs(ha[i].t - hb[i].t) < 1e-7, "path %d: side %d at %.17g, times 2^%d side %d at %.17g",
                      p, ha[i].side, ha[i].t, (int)log2(unit[k]), hb[i].side, hb[i].t);
            }
        }
        CHECK(hits > BATCH, "%ld hits", hits);
        scene_free(&a), scene_free(&b);
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
        run_rays(&s, 0, LONG_SUITE ? 10000 : 150, 1 - 0.7 * pow(10, -1 - v), 1 + 0.7 * pow(10, -1 - v), 0, 0, &t, &r);
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

/* The faces of the box hold the isovalue to the bit, so they are inside wherever a ray enters, whatever rounding makes of the place. */
TEST(surfaces_in_border_faces_have_no_speckle) {
    enum { SIZE = 13, RAYS = 600 };
    static double value[SIZE * SIZE * SIZE];
    test_random r = {31};
    for (int solid = 0; solid < 2; solid++) {
        isogi_volume volume = {
            .data = value, .type = ISOGI_F64, .size = {SIZE, SIZE, SIZE}, .spacing = {0.3, 0.7, 1.1}, .origin = {0.1, -3.3, 7.7}};
        for (int i = 0; i < SIZE * SIZE * SIZE; i++) {
            const int x = i % SIZE, y = i / SIZE % SIZE, z = i / SIZE / SIZE;
            value[i] = !x || !y || !z || x == SIZE - 1 || y == SIZE - 1 || z == SIZE - 1 ? 0.125 : solid ? 1 : -1;
        }
        for (int path = 0; path < 5; path++) {
            static isogi_ray rays[RAYS];
            static isogi_hit hits[RAYS];
            isogi_context context = {.threads = 1, .force_path = path};
            isogi_pyramid *p = NULL;
            long wrong = 0;
            CHECK(isogi_vol_build(&p, &volume, &context) == ISOGI_OK, "not built");
            for (int i = 0; i < RAYS; i++) {
                const int axis = i % 3, upper = i / 3 & 1;
                double at[3], within[3];
                memset(&rays[i], 0, sizeof rays[i]);
                for (int a = 0; a < 3; a++) at[a] = 1 + (SIZE - 3) * random_unit(&r), within[a] = 1 + (SIZE - 3) * random_unit(&r);
                at[axis] = upper ? SIZE - 1 : 0;
                for (int a = 0; a < 3; a++) {
                    rays[i].dir[a] = (float)((within[a] - at[a]) * volume.spacing[a]);
                    rays[i].origin[a] = volume.origin[a] + at[a] * volume.spacing[a] - (double)rays[i].dir[a];
                }
                rays[i].isovalue = 0.125, rays[i].tmax = 1.001, rays[i].flags = i & 8 ? ISOGI_RAY_CAPPED : 0;
            }
            isogi_vol_intersect(p, rays, RAYS, hits, NULL);
            for (int i = 0; i < RAYS; i++) {
                const int side = rays[i].flags ? 2 : solid ? 0 : -1;
                isogi_hit one;
                isogi_vol_intersect(p, &rays[i], 1, &one, NULL);
                wrong += hits[i].side != side || one.side != side || (side && !(fabs(hits[i].t - 1) < 1e-6)); /* dir is float */
            }
            CHECK(wrong == 0, "path %d, inner voxels %s: %ld of %d rays", path, solid ? "inside" : "outside", wrong, RAYS);
            isogi_vol_free(p);
        }
    }
}

TEST(cells_without_a_surface_hit_like_the_reference) {
#ifdef __FAST_MATH__
    SKIP("the reference looks for NaN, and -ffast-math promises that there is none");
#endif
    test_random r = {8};
    tally t = {0};
    for (int v = 0; v < (LONG_SUITE ? 200 : 6); v++) {
        scene s = scene_new(9, 18, 7);
        scene_noise(&s, 0, &r);
        for (int k = 0; k < 12; k++)
            s.value[random_bits(&r) % scene_voxels(&s)] = k % 3 == 0 ? (double)NAN : k % 3 == 1 ? (double)INFINITY : -(double)INFINITY;
        for (int i = 0; i < 9 * 18 * 7 && v % 2; i++) { /* a sheet, and what is out of a ball */
            const double x = i % 9 - 4, y = i / 9 % 18 - 8.5, z = i / 162 - 3;
            if (v % 4 == 1 ? i / 9 % 18 == 8 && random_bits(&r) % 4 : x * x + y * y + z * z > 30) s.value[i] = (double)NAN;
        }
        scene_build(&s);
        run_rays(&s, 0, 150, -0.7, 0.7, 0, 0, &t, &r);
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
    long wanted = LONG_SUITE ? 60000000 : 400000, done = 0, escaped[PATHS] = {0};
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

/* Programs that are linked with -ffast-math take denormal numbers for 0. Rays that begin within a cell that holds the surface have the same
   hits there, on every path. */
TEST(hits_are_the_same_where_denormals_are_zero) {
#ifdef __SSE2__
    static isogi_hit before[BATCH], after[BATCH];
    static uint8_t any[2][BATCH];
    const unsigned normally = _mm_getcsr();
    test_random r = {91};
    long hits = 0, wrong[PATHS] = {0};
    for (int v = 0; v < 20; v++) {
        scene s = scene_new(6, 7, 5);
        isogi_ray rays[BATCH];
        scene_noise(&s, 0, &r), scene_build(&s);
        for (int i = 0; i < BATCH; i++) rays[i] = ray_through(&s, random_range(&r, -0.7, 0.7), 0, &r);
        for (int p = 0; p < PATHS; p++)
            for (size_t each = 1; each <= BATCH; each = each == 1 ? 3 : each == 3 ? BATCH : BATCH + 1) {
                for (int zero = 0; zero < 2; zero++) {
                    _mm_setcsr(zero ? normally | 0x8040 : normally);
                    for (size_t i = 0; i < BATCH; i += each) {
                        const size_t count = BATCH - i < each ? BATCH - i : each;
                        isogi_vol_intersect(s.pyramid[p], rays + i, count, (zero ? after : before) + i, NULL);
                        isogi_vol_occluded(s.pyramid[p], rays + i, count, any[zero] + i, NULL);
                    }
                }
                _mm_setcsr(normally);
                for (int i = 0; i < BATCH; i++) {
                    hits += before[i].side != 0;
                    wrong[p] += before[i].side != after[i].side || fabs(before[i].t - after[i].t) > 1e-12 || any[0][i] != any[1][i];
                }
            }
        scene_free(&s);
    }
    for (int p = 0; p < PATHS; p++) CHECK(!wrong[p], "path %d: %ld of %ld hits are others", p, wrong[p], hits / PATHS);
    CHECK(hits > 20 * BATCH, "%ld hits", hits);
#else
    SKIP("no SSE2");
#endif
}

TEST_MAIN("vol_hard")
