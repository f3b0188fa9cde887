/* Properties of fields given by a function (isogi_vol_build_field): rays that find every crossing without a step size. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"

/* ---- functions ---- */

typedef struct function {
    double centre[3], radius, wave;
    long calls;
} function;

/* 1 - |p - c|^2 / r^2: inside a ball at 0. The Hessian is 2 / r^2 everywhere. */
static double ball(void *user, const double p[3], double g[3]) {
    function *f = (function *)user;
    double sum = 0;
    f->calls++;
    for (int a = 0; a < 3; a++) {
        double d = (p[a] - f->centre[a]) / f->radius;
        sum += d * d, g[a] = -2 * d / f->radius;
    }
    return 1 - sum;
}

/* sin x cos y + sin y cos z + sin z cos x in units of the wave: second derivatives of 2 on and 1 off the diagonal, hence at most 4. */
static double gyroid(void *user, const double p[3], double g[3]) {
    function *f = (function *)user;
    double k = f->wave, x = k * p[0], y = k * p[1], z = k * p[2];
    f->calls++;
    g[0] = k * (cos(x) * cos(y) - sin(z) * sin(x)), g[1] = k * (cos(y) * cos(z) - sin(x) * sin(y)),
    g[2] = k * (cos(z) * cos(x) - sin(y) * sin(z));
    return sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x);
}

/* x^2: touches 0 in a plane and never crosses it; below it, two planes close to each other. */
static double trough(void *user, const double p[3], double g[3]) {
    ((function *)user)->calls++;
    g[0] = 2 * p[0], g[1] = g[2] = 0;
    return p[0] * p[0];
}

/* Two charges; near them the field bends without bound, and in them it is infinite. */
static double charges(void *user, const double p[3], double g[3]) {
    double sum = 0;
    ((function *)user)->calls++;
    for (int n = 0; n < 2; n++) {
        double d[3] = {p[0] - (n ? 0.4 : -0.4), p[1], p[2] - 0.1}, r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        sum += 1 / r;
        for (int a = 0; a < 3; a++) g[a] -= d[a] / (r * r * r);
    }
    return sum;
}

/* The Hessian of 1/r has the norm 2 / r^3. */
static double charges_bend(void *user, const double low[3], const double high[3]) {
    double sum = 0;
    (void)user;
    for (int n = 0; n < 2; n++) {
        double c[3] = {n ? 0.4 : -0.4, 0, 0.1}, square = 0;
        for (int a = 0; a < 3; a++) {
            double d = fmax(0, fmax(low[a] - c[a], c[a] - high[a]));
            square += d * d;
        }
        sum += 2 / (square * sqrt(square));
    }
    return sum;
}

static isogi_pyramid *build_function(const isogi_field *shape, size_t cells) {
    isogi_field field = *shape;
    isogi_pyramid *p = NULL;
    for (int a = 0; a < 3; a++) field.cells[a] = cells ? cells + (size_t)a : 0;
    isogi_result result = isogi_vol_build_field(&p, &field, NULL);
    CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
    return p;
}

static isogi_ray ray_at_box(const isogi_field *f, double isovalue, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    double d[3];
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        ray.dir[a] = (float)d[a];
        ray.origin[a] = random_range(r, f->low[a], f->high[a]) - (double)ray.dir[a] * random_range(r, 0, 6);
    }
    return ray;
}

TEST(rays_hit_a_ball_where_its_equation_says) {
    function f = {.centre = {0.1, -0.2, 0.3}, .radius = 0.7};
    isogi_field field = {.value = ball, .user = &f, .hessian = 2 / 0.49, .low = {-1, -1, -1}, .high = {1, 1.5, 2}};
    test_random r = {30};
    long found = 0;
    double worst = 0;
    for (size_t cells = 0; cells < 40; cells += 13) {
        isogi_pyramid *p = build_function(&field, cells);
        for (int i = 0; i < 8000; i++) {
            double isovalue = random_range(&r, -0.1, 0.9), a = 0, b = 0, c = -0.49 * (1 - isovalue), normal[3];
            isogi_ray ray = ray_at_box(&field, isovalue, &r);
            isogi_hit hits[4] = {{0}};
            float normals[1][3];
            size_t count, expected = 0;
            for (int k = 0; k < 3; k++) {
                double o = ray.origin[k] - f.centre[k], d = (double)ray.dir[k];
                a += d * d, b += o * d, c += o * o;
            }
            double t[2] = {-1, -1}, disc = b * b - a * c;
            if (fabs(disc) < 1e-9) continue;
            if (disc > 0)
                for (int n = 0; n < 2; n++) {
                    double at = (-b + (n ? 1 : -1) * sqrt(disc)) / a;
                    if (at > 0) t[expected++] = at;
                }
            CHECK(isogi_vol_intersect_all(p, &ray, 1, 4, hits, &count, NULL) == ISOGI_OK, "rays");
            CHECK(count == expected, "%d hits, not %d (disc %g)", (int)count, (int)expected, disc);
            for (size_t n = 0; n < count && n < expected; n++) {
                CHECK(hits[n].side == (n + 2 - expected ? -1 : 1), "hit %d of %d: side %d", (int)n, (int)expected, hits[n].side);
                /* a root of slope 2 sqrt(disc) moves by the rounding of the value, some 1e-15, over that */
                CHECK(fabs(hits[n].t - t[n]) < 1e-14 * 100 / sqrt(disc), "t %.17g, not %.17g", hits[n].t, t[n]);
                worst = fmax(worst, fabs(hits[n].t - t[n]) * sqrt(disc));
                isogi_vol_normals(p, &hits[n], 1, ISOGI_NORMAL_TRILINEAR, normals);
                double length = 0;
                for (int k = 0; k < 3; k++)
                    normal[k] = ray.origin[k] + t[n] * (double)ray.dir[k] - f.centre[k], length += normal[k] * normal[k];
                for (int k = 0; k < 3; k++)
                    CHECK(fabs((double)normals[0][k] - normal[k] / sqrt(length)) < 1e-6, "normal %g", (double)normals[0][k]);
                found++;
            }
        }
        isogi_vol_free(p);
    }
    printf("    %ld hits, worst error %.2g\n", found, worst);
    CHECK(found > 5000, "only %ld hits", found);
}

/* Sampled so densely that what lies between two samples is known from the bound of the second derivative. */
static int reference_crossings(const isogi_field *f, const isogi_ray *ray, double bend, double t[], int side[], int most) {
    enum { STEPS = 6000 };
    double enter = ray->tmin, leave = 1e300, g[3], d[3], before = 0;
    int n = 0;
    for (int a = 0; a < 3; a++) {
        d[a] = (double)ray->dir[a];
        double t0 = (f->low[a] - ray->origin[a]) / d[a], t1 = (f->high[a] - ray->origin[a]) / d[a];
        enter = fmax(enter, fmin(t0, t1)), leave = fmin(leave, fmax(t0, t1));
    }
    if (!(enter < leave)) return 0;
    double h = (leave - enter) / STEPS;
    for (int i = 0; i <= STEPS; i++) {
        double at = enter + i * h, p[3], value, slope;
        for (int a = 0; a < 3; a++) p[a] = ray->origin[a] + at * d[a];
        value = f->value(f->user, p, g) - ray->isovalue;
        slope = g[0] * d[0] + g[1] * d[1] + g[2] * d[2];
        /* too near to an extremum at the isovalue, or to the border, to be decided by samples */
        if (fabs(value) < bend * h * h && fabs(slope) < 2 * bend * h) return -1;
        if ((i == 0 || i == STEPS) && fabs(value) < 1e-9) return -1;
        if (i && (value >= 0) != (before >= 0)) {
            double low = at - h, high = at;
            for (int k = 0; k < 60; k++) {
                double middle = 0.5 * (low + high);
                for (int a = 0; a < 3; a++) p[a] = ray->origin[a] + middle * d[a];
                if ((f->value(f->user, p, g) - ray->isovalue >= 0) == (before >= 0)) low = middle;
                else high = middle;
            }
            if (n < most) t[n] = low, side[n] = value >= 0 ? 1 : -1;
            n++;
        }
        before = value;
    }
    return n;
}

TEST(rays_hit_a_gyroid_wherever_it_crosses) {
    enum { MOST = 64 };
    static isogi_hit hits[MOST];
    static double t[MOST];
    static int side[MOST];
    function f = {.wave = 6.283185307179586};
    isogi_field field = {.value = gyroid, .user = &f, .hessian = 4 * f.wave * f.wave, .low = {-1, -1, -1}, .high = {1, 1, 1}};
    test_random r = {31};
    isogi_counters counters = {0};
    long crossings = 0, undecided = 0, calls = 0;
    for (size_t cells = 1; cells < 100; cells *= 4) {
        isogi_pyramid *p = build_function(&field, cells);
        for (int i = 0; i < (LONG_SUITE ? 3000 : 150); i++) {
            isogi_ray ray = ray_at_box(&field, random_range(&r, -1.2, 1.2), &r);
            size_t count;
            int expected = reference_crossings(&field, &ray, field.hessian, t, side, MOST);
            if (expected < 0) { undecided++; continue; }
            calls -= f.calls;
            isogi_vol_intersect_all(p, &ray, 1, MOST, hits, &count, &counters);
            calls += f.calls;
            CHECK((int)count == expected, "%d crossings, not %d", (int)count, expected);
            for (int n = 0; n < expected && n < (int)count; n++)
                CHECK(hits[n].side == side[n] && fabs(hits[n].t - t[n]) < 1e-8, "hit %d: side %d t %.12g, not %d %.12g", n, hits[n].side,
                      hits[n].t, side[n], t[n]);
            crossings += expected;
        }
        isogi_vol_free(p);
    }
    printf("    %ld crossings, %ld rays undecided, %.1f calls per crossing\n", crossings, undecided, (double)calls / (double)crossings);
    CHECK(counters.cubics == (uint64_t)calls, "%ld calls, %ld counted", calls, (long)counters.cubics);
    CHECK(crossings > 500 && undecided * 10 < crossings, "%ld crossings, %ld undecided", crossings, undecided);
}

TEST(two_crossings_as_close_as_rounding_allows_are_found) {
    function f = {.calls = 0};
    isogi_field field = {.value = trough, .user = &f, .hessian = 2, .low = {-1, -1, -1}, .high = {1, 1, 1}};
    test_random r = {32};
    isogi_pyramid *p = build_function(&field, 0);
    for (double gap = 0.5; gap > 1e-6; gap *= 0.7) {
        isogi_hit hits[8];
        size_t count;
        isogi_ray ray = {.origin = {-3, 0.1, 0.2}, .dir = {1, (float)random_range(&r, -0.2, 0.2), 0.1f}, .isovalue = gap * gap};
        isogi_vol_intersect_all(p, &ray, 1, 8, hits, &count, NULL);
        CHECK(count == 2 && hits[0].side == -1 && hits[1].side == 1, "%d hits for a gap of %g", (int)count, gap);
        if (count == 2) CHECK(fabs(hits[1].t - hits[0].t - 2 * gap) < 1e-10, "%g between them, not %g", hits[1].t - hits[0].t, 2 * gap);
    }
    /* along the plane in which the field touches the isovalue: nothing to be found, and an end to the search */
    for (int i = 0; i < 20; i++) {
        isogi_ray ray = {.origin = {0, -3, 0}, .dir = {i < 10 ? 0 : 1e-5f * (float)i, 1, 0.1f * (float)i}, .isovalue = 0};
        isogi_hit hit = {0};
        f.calls = 0;
        isogi_vol_intersect(p, &ray, 1, &hit, NULL);
        CHECK(hit.side == 0, "side %d", hit.side);
        CHECK(f.calls < 64 * 400, "%ld calls", f.calls);
    }
    isogi_vol_free(p);
}

TEST(a_field_that_bends_without_bound_is_searched_by_boxes) {
    function f = {.calls = 0};
    isogi_field field = {.value = charges, .user = &f, .hessian_in = charges_bend, .low = {-1, -1, -1}, .high = {1, 1, 1}};
    test_random r = {33};
    isogi_pyramid *p = build_function(&field, 40);
    long found = 0;
    double range[2];
    for (int i = 0; i < 5000; i++) {
        isogi_ray ray = ray_at_box(&field, random_range(&r, 3, 8), &r);
        isogi_hit hits[8];
        size_t count;
        isogi_vol_intersect_all(p, &ray, 1, 8, hits, &count, NULL);
        found += (long)count;
        for (size_t n = 0; n < count; n++) {
            double at[3], g[3] = {0, 0, 0};
            for (int a = 0; a < 3; a++) at[a] = ray.origin[a] + hits[n].t * (double)ray.dir[a];
            CHECK(fabs(charges(&f, at, g) - ray.isovalue) < 1e-9, "value %g at the isovalue %g", charges(&f, at, g), ray.isovalue);
            CHECK(n == 0 || hits[n].side != hits[n - 1].side, "side %d twice", hits[n].side);
        }
    }
    isogi_vol_range(p, range);
    CHECK(range[0] < 1.5 && range[1] > 20, "range %g..%g", range[0], range[1]);
    CHECK(found > 500, "only %ld hits", found);
    isogi_vol_free(p);
}

TEST(fields_are_sampled_and_skipped_like_volumes) {
    function f = {.wave = 3};
    isogi_field field = {.value = gyroid, .user = &f, .hessian = 36, .low = {-1, -2, 0}, .high = {1, 1, 2}};
    isogi_pyramid *p = build_function(&field, 30);
    isogi_counters counters = {0};
    test_random r = {34};
    for (int i = 0; i < 500; i++) {
        float point[1][3], value, gradient[1][3];
        double at[3], g[3], piece[2], range[1][2] = {{0.9, 1.0}}, end = 0;
        for (int a = 0; a < 3; a++) point[0][a] = (float)random_range(&r, field.low[a], field.high[a]), at[a] = (double)point[0][a];
        double truth = gyroid(&f, at, g);
        isogi_vol_sample(p, (const float(*)[3])point, 1, &value, gradient);
        CHECK(fabs((double)value - truth) < 1e-6 && fabs((double)gradient[0][1] - g[1]) < 1e-5, "value %g, not %g", (double)value, truth);
        isogi_ray ray = ray_at_box(&field, 0, &r);
        for (double t = 0; t < 8; t += 0.01) {
            for (int a = 0; a < 3; a++) at[a] = ray.origin[a] + t * (double)ray.dir[a];
            if (at[0] < -1 || at[0] > 1 || at[1] < -2 || at[1] > 1 || at[2] < 0 || at[2] > 2) continue;
            truth = gyroid(&f, at, g);
            while (end < t) {
                if (isogi_vol_next_interval(p, &ray, (const double(*)[2])range, 1, end, piece, &counters)) end = piece[1];
                else piece[0] = piece[1] = end = 1e30;
            }
            if (truth >= 0.9 && truth <= 1.0) CHECK(t >= piece[0] && t <= piece[1], "value %g at %g, skipped", truth, t);
        }
    }
    isogi_vol_free(p);
}

TEST(what_needs_voxels_refuses_a_function) {
    function f = {.radius = 1};
    isogi_field field = {.value = ball, .user = &f, .hessian = 2, .low = {-1, -1, -1}, .high = {1, 1, 1}}, bad = field;
    isogi_pyramid *p = build_function(&field, 0), *none = NULL;
    isogi_mesh mesh = {0};
    isogi_trace *trace = NULL;
    size_t first[3] = {0, 0, 0}, last[3] = {5, 5, 5};
    uint32_t cell[3] = {0, 0, 0};
    double corner[8], range[2];
    isogi_trace_desc desc = {.pyramid = p};
    CHECK(!isogi_vol_volume(p)->data && isogi_vol_volume(p)->size[0] == 65, "volume");
    CHECK(isogi_vol_mesh(p, &(isogi_mesh_desc){.isovalue = 0.5}, &mesh) == ISOGI_INVALID, "mesh");
    CHECK(isogi_vol_update(p, first, last, NULL) == ISOGI_INVALID, "update");
    CHECK(isogi_trace_create(&trace, &desc, NULL) == ISOGI_INVALID, "trace");
    CHECK(!isogi_volume_corners(isogi_vol_volume(p), cell, corner), "corners");
    CHECK(isogi_vol_box_range(p, first, last, range) == ISOGI_OK && range[0] < -1.9 && range[1] > -1.6, "range %g..%g", range[0], range[1]);
    isogi_vol_free(p);
    CHECK(isogi_vol_build_field(NULL, &field, NULL) == ISOGI_INVALID && isogi_vol_build_field(&none, NULL, NULL) == ISOGI_INVALID, "null");
    bad.value = NULL;
    CHECK(isogi_vol_build_field(&none, &bad, NULL) == ISOGI_INVALID, "no function");
    bad = field, bad.hessian = 0;
    CHECK(isogi_vol_build_field(&none, &bad, NULL) == ISOGI_INVALID, "no bound");
    bad = field, bad.high[1] = -1;
    CHECK(isogi_vol_build_field(&none, &bad, NULL) == ISOGI_INVALID, "empty box");
    bad = field, bad.low[1] = (double)NAN;
    CHECK(isogi_vol_build_field(&none, &bad, NULL) == ISOGI_INVALID, "no box");
    bad = field, bad.cells[1] = SIZE_MAX;
    CHECK(isogi_vol_build_field(&none, &bad, NULL) == ISOGI_TOO_LARGE && !none, "too many cells");
}

/* ---- memory ---- */

typedef struct scarce { long left, blocks; } scarce; /* allocation number `left` fails */
static void *scarce_alloc(void *user, size_t size, size_t align) {
    scarce *m = (scarce *)user;
    void *p = NULL;
    if (m->left-- == 0 || posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    m->blocks++;
    return p;
}
static void scarce_release(void *user, void *p, size_t size) { (void)size, ((scarce *)user)->blocks--, free(p); }

TEST(building_survives_every_failing_allocation) {
    function f = {.radius = 1};
    isogi_field field = {.value = ball, .user = &f, .hessian = 2, .low = {-1, -1, -1}, .high = {1, 1, 1}, .cells = {9, 9, 9}};
    int done = 0;
    for (long k = 0; !done && k < 100; k++) {
        scarce memory = {k, 0};
        isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
        isogi_pyramid *p = NULL;
        isogi_result result = isogi_vol_build_field(&p, &field, &context);
        done = result == ISOGI_OK;
        CHECK(done ? p && k >= 2 && memory.left >= 0 : result == ISOGI_NO_MEMORY && !p, "allocation %ld: %s", k,
              isogi_result_string(result));
        isogi_vol_free(p);
        CHECK(memory.blocks == 0, "allocation %ld: %ld blocks leak", k, memory.blocks);
    }
    CHECK(done, "there are more allocations, %d", done);
}

/* Bundles, and rays that leave the surface in any direction, hit what single rays do: those of an origin bit by bit, those of a start what
   a ray finds that begins beside it, but where it grazes. */
TEST(bundles_and_continued_rays_meet_functions_too) {
    enum { EACH = 24, TURNS = 60, MOST = 6 };
    function f = {.wave = 4};
    isogi_field field = {.value = gyroid, .user = &f, .hessian = 4 * 16, .low = {-1, -1.2, -0.9}, .high = {1.1, 0.8, 1}};
    isogi_pyramid *p = build_function(&field, 12);
    test_random r = {77};
    long hits = 0, left = 0, wrong = 0, wrong_any = 0, wrong_all = 0, wrong_start = 0, grazes = 0;
    for (int turn = 0; turn < TURNS; turn++) {
        static isogi_hit together[EACH], alone, all[EACH * MOST], one[MOST], starts[EACH], continued[EACH];
        static float dirs[EACH][3];
        uint8_t any[EACH];
        size_t counts[EACH], count;
        isogi_bundle b = {.isovalue = random_range(&r, -0.8, 0.8)};
        isogi_ray ray = {.isovalue = b.isovalue};
        for (int a = 0; a < 3; a++) ray.origin[a] = b.origin[a] = random_range(&r, field.low[a], field.high[a]);
        for (int i = 0; i < EACH; i++) {
            double d[3];
            random_direction(&r, d);
            for (int a = 0; a < 3; a++) dirs[i][a] = (float)d[a];
        }
        isogi_vol_bundle(p, &b, (const float(*)[3])dirs, EACH, together, NULL);
        isogi_vol_bundle_occluded(p, &b, (const float(*)[3])dirs, EACH, any, NULL);
        isogi_vol_bundle_all(p, &b, (const float(*)[3])dirs, EACH, MOST, all, counts, NULL);
        for (int i = 0; i < EACH; i++) {
            memcpy(ray.dir, dirs[i], sizeof ray.dir);
            isogi_vol_intersect(p, &ray, 1, &alone, NULL), isogi_vol_intersect_all(p, &ray, 1, MOST, one, &count, NULL);
            hits += alone.side != 0, wrong += alone.side != together[i].side || fabs(alone.t - together[i].t) > 0;
            wrong_any += any[i] != (alone.side != 0), wrong_all += count != counts[i];
            for (size_t n = 0; n < count && n < counts[i] && n < MOST; n++)
                wrong_all += one[n].side != all[(size_t)i * MOST + n].side || fabs(one[n].t - all[(size_t)i * MOST + n].t) > 0;
            starts[i] = together[0];
        }
        if (!together[0].side) continue;
        b.start = &together[0];
        isogi_vol_continue(p, starts, (const float(*)[3])dirs, NULL, b.isovalue, 0, EACH, continued, NULL);
        isogi_vol_bundle(p, &b, (const float(*)[3])dirs, EACH, all, NULL);
        for (int i = 0; i < EACH; i++) {
            const double beside = 1e-6;
            double place[3], g[3], slope = 0, steep = 0;
            wrong_start += continued[i].side != all[i].side || fabs(continued[i].t - all[i].t) > 0;
            for (int a = 0; a < 3; a++) place[a] = b.origin[a] + together[0].t * (double)dirs[0][a];
            gyroid(&f, place, g);
            for (int a = 0; a < 3; a++) slope += g[a] * (double)dirs[i][a], steep += g[a] * g[a];
            if (fabs(slope) < 1e-2 * sqrt(steep)) { grazes++; continue; }
            for (int a = 0; a < 3; a++) ray.origin[a] = place[a] + beside * (double)dirs[i][a];
            memcpy(ray.dir, dirs[i], sizeof ray.dir);
            isogi_vol_intersect(p, &ray, 1, &alone, NULL);
            left++, wrong_start += alone.side != continued[i].side || (alone.side && fabs(alone.t + beside - continued[i].t) > 1e-5);
        }
    }
    CHECK(hits > 500 && left > 500 && grazes < left / 10, "%ld hits, %ld rays from the surface, %ld graze it", hits, left, grazes);
    CHECK(!wrong && !wrong_any && !wrong_all && !wrong_start, "others: %ld in bundles, %ld any hits, %ld in lists, %ld from starts", wrong,
          wrong_any, wrong_all, wrong_start);
    isogi_vol_free(p);
}

/* Rays leave hits that lie within roundings of a lattice plane for good: no cell that they are in for no way brings the surface back. */
static double square_ball(void *user, const double p[3], double g[3]) {
    double f = 0;
    (void)user;
    for (int a = 0; a < 3; a++) f += p[a] * p[a], g[a] = 2 * p[a];
    return f;
}
TEST(hits_beside_lattice_planes_are_left_for_good) {
    const isogi_field f = {.value = square_ball, .hessian = 2, .low = {-1, -1, -1}, .high = {1, 1, 1}, .cells = {16, 16, 16}};
    isogi_pyramid *p = NULL;
    test_random r = {9};
    long starts = 0, again = 0;
    CHECK(isogi_vol_build_field(&p, &f, NULL) == ISOGI_OK, "build");
    for (double beside = 1e-3; beside > 1e-14; beside /= 10)
        for (int i = 0; i < (LONG_SUITE ? 20000 : 5000); i++) {
            const double aim[3] = {0.5, beside * random_range(&r, -1, 1), beside * random_range(&r, -1, 1)};
            isogi_ray ray = {.isovalue = 0.25};
            isogi_hit hit, next;
            double along = 0, grid[3], world[3];
            float dir[1][3];
            for (int a = 0; a < 3; a++) {
                ray.dir[a] = (float)(a ? random_range(&r, -1, 1) : random_range(&r, -1.1, -0.1));
                ray.origin[a] = aim[a] - (double)ray.dir[a], dir[0][a] = (float)random_range(&r, -1, 1);
            }
            isogi_vol_intersect(p, &ray, 1, &hit, NULL);
            if (!hit.side) continue;
            for (int a = 0; a < 3; a++) grid[a] = hit.cell[a] + hit.local[a];
            isogi_vol_to_world(p, grid, world);
            for (int a = 0; a < 3; a++) along += world[a] * (double)dir[0][a];
            isogi_vol_continue(p, &hit, (const float(*)[3])dir, NULL, 0.25, 0, 1, &next, NULL);
            starts++, again += next.side && (next.t < 1e-7 || along > 1e-9) && fabs(along) > 1e-6;
        }
    CHECK(starts > 10000 && again == 0, "%ld of %ld starts meet the ball again at once", again, starts);
    isogi_vol_free(p);
}

TEST_MAIN("vol_field")
