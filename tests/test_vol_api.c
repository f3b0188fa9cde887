/* Properties of the calls around the rays of isogi_vol.h: voxels read one by one, all hits of a ray, bundles, value ranges, chunks
   with a halo, very large volumes, arguments that make no sense. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "ray_fields.h"
#include "reference_ray.h"
#include <float.h>

/* ---- numbers in 16 bits ---- */

/* Every finite half is itself again; between neighbours the nearer one is taken, of equals the even one. */
TEST(half_is_to_nearest_even) {
    for (uint16_t h = 0; h < 0x7c00; h++) {
        float x = isogi_half_to_float(h), next = isogi_half_to_float((uint16_t)(h + (h < 0x7bff)));
        double exact = h < 1024 ? ldexp(h, -24) : ldexp(1024 + h % 1024, (int)(h >> 10) - 25);
        float middle = (float)(0.5 * ((double)x + (double)next)), above = nextafterf(middle, 1e9f), below = nextafterf(middle, 0);
        CHECK((double)x >= exact && (double)x <= exact, "half %x: %g, expected %g", h, (double)x, exact);
        CHECK(isogi_float_to_half(x) == h && (h == 0 || isogi_float_to_half(-x) == (h | 0x8000)), "half %x is %x", h,
              isogi_float_to_half(x));
        if (h + 1 == 0x7c00) continue;
        CHECK(isogi_float_to_half(middle) == (h & 1 ? h + 1 : h), "middle above %x: %x", h, isogi_float_to_half(middle));
        CHECK(isogi_float_to_half(above) == h + 1 && isogi_float_to_half(below) == h, "beside the middle above %x", h);
    }
    const float odd[6] = {1e30f, 65504, 65519, 65520, 1e-30f, 3e-45f};
    const uint32_t expected[6] = {0x7bff, 0x7bff, 0x7bff, 0x7bff, 0, 0};
    for (int i = 0; i < 6; i++) CHECK(isogi_float_to_half(odd[i]) == expected[i], "%g: %x", (double)odd[i], isogi_float_to_half(odd[i]));
    CHECK(isogi_float_to_half(NAN) == 0, "NaN: %x", isogi_float_to_half(NAN));
}

/* ---- voxels one by one ---- */

TEST(corners_and_ranges_are_those_of_the_voxels) {
    test_random r = {1};
    field f = field_new(7, 1, 70);
    field_fill(&f, NOISE, &r);
    f.value[100] = (double)NAN, f.value[200] = (double)INFINITY;
    field_build(&f);
    const isogi_volume *v = isogi_vol_volume(f.pyramid);
    for (int i = 0; i < 2000; i++) {
        uint32_t cell[3] = {(uint32_t)(random_bits(&r) % 6), 0, (uint32_t)(random_bits(&r) % 69)};
        double corner[8];
        int finite = 1, told = isogi_volume_corners(v, cell, corner), at[3] = {(int)cell[0], 0, (int)cell[2]};
        double unchecked[8];
        CHECK(isogi_vol_corners(f.pyramid, at, unchecked) == told && !memcmp(unchecked, corner, sizeof corner), "unchecked is otherwise");
        for (int c = 0; c < 8; c++) {
            double value = *field_at(&f, (int)cell[0] + (c & 1), 0, (int)cell[2] + (c >> 2));
            finite &= test_finite(value);
            CHECK(!memcmp(&value, &corner[c], sizeof value), "corner %d: %g, not %g", c, corner[c], value);
        }
        CHECK(finite == told, "finite %d, told %d", finite, told);
    }
    for (int i = 0; i < 2000; i++) {
        size_t first[3], last[3];
        double range[2], least = DBL_MAX, largest = -DBL_MAX;
        for (int a = 0; a < 3; a++)
            first[a] = random_bits(&r) % v->size[a], last[a] = first[a] + random_bits(&r) % (v->size[a] + 1 - first[a]);
        for (size_t z = first[2]; z <= last[2] && z < 70; z++)
            for (size_t x = first[0]; x <= last[0] && x < 7; x++) {
                double value = *field_at(&f, (int)x, 0, (int)z);
                if (test_finite(value)) least = fmin(least, value), largest = fmax(largest, value);
            }
        isogi_volume_range(v, first, last, range);
        CHECK(range[0] == least && range[1] == largest, "%g..%g, not %g..%g", range[0], range[1], least, largest);
    }
    uint32_t beyond[3] = {6, 0, 0};
    double corner[8] = {1};
    CHECK(isogi_volume_corners(v, beyond, corner) == 0 && corner[0] == 0, "a cell that is not there: %g", corner[0]);
    field_free(&f);
}

/* ---- all hits ---- */

/* The hits of a ray, one call after the other. */
static size_t chain_of_hits(const isogi_pyramid *p, const isogi_ray *ray, isogi_hit *hits, size_t most) {
    size_t n = 0;
    isogi_hit next;
    isogi_vol_intersect(p, ray, 1, &next, NULL);
    while (next.side && n < most) {
        double left = ray->tmax - next.t, t = next.t;
        hits[n++] = next;
        if (ray->tmax > 0 && !(left > 0)) break;
        isogi_vol_continue(p, &hits[n - 1], (const float(*)[3]) & ray->dir, ray->tmax > 0 ? &left : NULL, ray->isovalue,
                           ray->flags | ISOGI_RAY_ONWARD, 1, &next, NULL);
        next.t += t;
    }
    return n;
}

TEST(all_hits_are_the_first_and_those_that_follow) {
    enum { RAYS = 150, MOST = 40 };
    static isogi_ray rays[RAYS];
    static isogi_hit all[RAYS][MOST], few[RAYS][2], chain[MOST];
    static size_t counts[RAYS], few_counts[RAYS], none[RAYS];
    test_random r = {2};
    long found = 0, cut = 0;
    for (int v = 0; v < (LONG_SUITE ? 300 : 30); v++) {
        field f = field_new(10, 9, 11);
        field_fill(&f, v % KINDS, &r);
        if (v % 5 == 0)
            for (int i = 0; i < 5; i++) f.value[random_bits(&r) % 990] = (double)NAN;
        field_build(&f);
        for (int i = 0; i < RAYS; i++) {
            rays[i] = random_ray(&f, v % KINDS == QUANTISED ? floor(random_range(&r, -3, 3)) : v % 2 ? 0.1
                : random_range(&r, -0.5, 0.5), &r);
            rays[i].flags = v % 2 ? (uint32_t)(i & 1) : 0;
            if (i % 4 == 0) rays[i].tmin = random_range(&r, 0, 10), rays[i].tmax = rays[i].tmin + random_range(&r, 0, 10);
        }
        memset(all, 0, sizeof all), memset(few, 0, sizeof few);
        CHECK(isogi_vol_intersect_all(f.pyramid, rays, RAYS, MOST, all[0], counts, NULL) == ISOGI_OK, "all");
        CHECK(isogi_vol_intersect_all(f.pyramid, rays, RAYS, 2, few[0], few_counts, NULL) == ISOGI_OK, "two");
        CHECK(isogi_vol_intersect_all(f.pyramid, rays, RAYS, 0, NULL, none, NULL) == ISOGI_OK, "none");
        for (int i = 0; i < RAYS; i++) {
            size_t n = chain_of_hits(f.pyramid, &rays[i], chain, MOST);
            CHECK(n == counts[i] || n == MOST, "%d hits, %d one by one", (int)counts[i], (int)n);
            for (size_t k = 0; k < n; k++)
                CHECK(same_hit(&chain[k], &all[i][k]), "ray %d, hit %d: t %.17g, %.17g", i, (int)k, chain[k].t, all[i][k].t);
            CHECK(few_counts[i] == (n < 3 ? n : 3) && none[i] == (n ? 1 : 0), "%d and %d of %d", (int)few_counts[i], (int)none[i], (int)n);
            for (size_t k = 0; k < n && k < 2; k++) CHECK(same_hit(&few[i][k], &all[i][k]), "ray %d, hit %d", i, (int)k);
            for (size_t k = n; k < MOST; k++) CHECK(all[i][k].side == 0, "written behind the last hit of ray %d", i);
            found += (long)n, cut += few_counts[i] == 3;
        }
        field_free(&f);
    }
    printf("    %ld hits, %ld rays with more than two\n", found, cut);
    CHECK(found > 2000 && cut > 100, "%ld hits, %ld cut off: the test says little", found, cut);
}

TEST(all_hits_are_those_of_the_reference) {
    enum { MOST = 60 };
    static isogi_hit hits[MOST];
    test_random r = {3};
    long crossings = 0, undecided = 0, different = 0;
    for (int v = 0; v < (LONG_SUITE ? 300 : 36); v++) {
        int kind = v % KINDS;
        field f = field_new(8, 7, 9);
        field_fill(&f, kind, &r);
        field_build(&f);
        reference_field reference = {f.value, {8, 7, 9}, 1e-10L};
        for (int i = 0; i < 300; i++) {
            isogi_ray ray = random_ray(&f, kind == QUANTISED ? 0.5 : random_range(&r, -0.5, 0.5), &r);
            double dir[3] = {(double)ray.dir[0], (double)ray.dir[1], (double)ray.dir[2]};
            if (i % 3 == 0) ray.tmin = random_range(&r, 0, 8), ray.tmax = ray.tmin + random_range(&r, 0, 8);
            size_t count, n = 0;
            isogi_vol_intersect_all(f.pyramid, &ray, 1, MOST, hits, &count, NULL);
            reference_hit truth = reference_intersect(&reference, ray.origin, dir, ray.tmin, ray.tmax, ray.isovalue);
            while (truth.decided && truth.side && n < count) {
                if (hits[n].side != truth.side || fabs(hits[n].t - (double)truth.t) > 1e-5) break;
                crossings++, n++;
                truth = reference_intersect(&reference, ray.origin, dir, (double)truth.t + 1e-7, ray.tmax, ray.isovalue);
            }
            undecided += !truth.decided;
            different += truth.decided && (truth.side || n < count);
        }
        field_free(&f);
    }
    printf("    %ld crossings, %ld undecided, %ld different\n", crossings, undecided, different);
    /* two roots within 1e-7 of each other are one for the reference, as it is used here */
    CHECK(different * 100000 <= crossings, "%ld of %ld crossings differ", different, crossings);
    CHECK(crossings > 5000 && undecided * 20 < crossings, "%ld crossings, %ld undecided", crossings, undecided);
}

/* On small whole numbers and an isovalue among them many faces have the isovalue all over: a ray that comes from outside and goes
   outside again touches such a layer in one point, which is one hit on the face itself. On every path alike. */
TEST(layers_without_thickness_are_touched_once_on_every_path) {
    enum { RAYS = 200, MOST = 40 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[5][RAYS][MOST], first[RAYS];
    static size_t counts[5][RAYS];
    test_random r = {31};
    long touched = 0, found = 0, different = 0, wrong = 0;
    for (int v = 0; v < (LONG_SUITE ? 400 : 40); v++) {
        field f = field_new(8, 8, 8);
        for (int i = 0; i < 512; i++) f.value[i] = (double)(random_bits(&r) % 4);
        for (int i = 0; i < RAYS; i++) rays[i] = random_ray(&f, 1 + i % 2, &r);
        for (int path = 1; path < 5; path++) {
            isogi_context context = {.threads = 1, .force_path = path};
            field_build_with(&f, &context);
            isogi_vol_intersect_all(f.pyramid, rays, RAYS, MOST, hits[path][0], counts[path], NULL);
            isogi_vol_intersect(f.pyramid, rays, RAYS, first, NULL);
            for (int i = 0; i < RAYS; i++) {
                different += counts[path][i] != counts[1][i] || first[i].side != (counts[1][i] ? hits[1][i][0].side : 0);
                for (size_t k = 0; k < counts[path][i] && k < counts[1][i]; k++) different += !same_hit(&hits[path][i][k], &hits[1][i][k]);
            }
            if (path < 4) isogi_vol_free(f.pyramid), f.pyramid = NULL;
        }
        for (int i = 0; i < RAYS; i++)
            for (size_t k = 0; k + 1 < counts[1][i]; k++) {
                const isogi_hit *h = &hits[1][i][k];
                int on_face = 0;
                for (int a = 0; a < 3; a++) on_face |= !(h->local[a] > 0) || !(h->local[a] < 1);
                found++;
                if (h[0].side != h[1].side) continue;
                touched++, wrong += h->side != 1 || !on_face;
            }
        field_free(&f);
    }
    printf("    %ld hits, %ld layers touched, %ld wrong, %ld different\n", found, touched, wrong, different);
    CHECK(wrong == 0 && different <= found * TOUCHES_PER_HIT, "%ld of %ld wrong, %ld different", wrong, touched, different);
    CHECK(touched > 15, "%ld touched: the test says little", touched);
}

/* ---- bundles ---- */

TEST(bundles_have_the_bits_of_single_rays) {
    enum { RAYS = 100 };
    static float dirs[RAYS][3];
    static isogi_hit hits[RAYS];
    static uint8_t occluded[RAYS];
    test_random r = {4};
    long found = 0;
    for (int v = 0; v < 40; v++) {
        field f = field_new(20, 21, 22);
        field_fill(&f, v % KINDS, &r);
        field_build(&f);
        for (int turn = 0; turn < 8; turn++) {
            isogi_ray ray = random_ray(&f, v % KINDS == QUANTISED ? 0 : random_range(&r, -0.5, 0.5), &r);
            isogi_hit start = {0}, alone;
            isogi_bundle bundle = {.isovalue = ray.isovalue, .flags = (uint32_t)(turn & 1), .tmax = turn % 3 ? 0 : 7};
            memcpy(bundle.origin, ray.origin, sizeof bundle.origin);
            isogi_vol_intersect(f.pyramid, &ray, 1, &start, NULL);
            if (turn & 2 && start.side) bundle.start = &start;
            else bundle.tmin = turn & 4 ? 1.5 : 0;
            for (int i = 0; i < RAYS; i++) {
                double d[3];
                random_direction(&r, d);
                for (int a = 0; a < 3; a++) dirs[i][a] = bundle.start || i % 2 ? (float)d[a] : ray.dir[a] + 0.2f * (float)d[a];
            }
            size_t count = turn % 4 ? RAYS : (size_t)v % 40;
            CHECK(isogi_vol_bundle(f.pyramid, &bundle, (const float(*)[3])dirs, count, hits, NULL) == ISOGI_OK, "hits");
            CHECK(isogi_vol_bundle_occluded(f.pyramid, &bundle, (const float(*)[3])dirs, count, occluded, NULL) == ISOGI_OK, "any hits");
            for (size_t i = 0; i < count; i++) {
                if (bundle.start) {
                    isogi_vol_continue(f.pyramid, &start, (const float(*)[3])dirs + i, &bundle.tmax, bundle.isovalue, bundle.flags, 1,
                                       &alone, NULL);
                } else {
                    isogi_ray one = {.flags = bundle.flags, .tmin = bundle.tmin, .tmax = bundle.tmax, .isovalue = bundle.isovalue};
                    memcpy(one.origin, bundle.origin, sizeof one.origin), memcpy(one.dir, dirs[i], sizeof one.dir);
                    isogi_vol_intersect(f.pyramid, &one, 1, &alone, NULL);
                }
                CHECK(same_hit(&alone, &hits[i]), "side %d and %d, t %.17g and %.17g", alone.side, hits[i].side, alone.t, hits[i].t);
                CHECK(occluded[i] == (alone.side != 0), "occluded %d, side %d", occluded[i], alone.side);
                found += alone.side != 0;
            }
        }
        field_free(&f);
    }
    CHECK(found > 5000, "only %ld hits", found);
}

/* Bundles side by side: those of all kinds, some in one place but for different isovalues, some that begin nowhere or beyond the box;
   and the same rays as a batch, in which those of a bundle follow each other. */
TEST(many_bundles_have_the_bits_of_one_at_a_time) {
    enum { BUNDLES = 40, EACH = 64 };
    static const size_t sizes[] = {1, 5, 8, 20, 64};
    static isogi_bundle bundles[BUNDLES];
    static isogi_hit starts[BUNDLES], hits[BUNDLES * EACH], alone[BUNDLES * EACH];
    static isogi_ray rays[BUNDLES * EACH];
    static uint8_t occluded[BUNDLES * EACH];
    static float dirs[BUNDLES * EACH][3];
    test_random r = {43};
    long found = 0, wrong = 0, wrong_any = 0, wrong_rays = 0;
    isogi_counters many = {0}, one = {0};
    for (int v = 0; v < 60; v++) {
        const size_t each = sizes[v % 5], count = v % 7 ? BUNDLES : 1 + random_bits(&r) % 3;
        isogi_context context = {.threads = 1, .force_path = v % 3 ? 0 : v / 3 % 4 + 1};
        field f = field_new(40, 41, 22);
        field_fill(&f, v % KINDS, &r);
        field_build_with(&f, &context);
        memset(bundles, 0, sizeof bundles);
        for (size_t n = 0; n < count; n++) {
            isogi_ray ray = random_ray(&f, v % KINDS == QUANTISED ? 0.25 : random_range(&r, -0.5, 0.5), &r);
            isogi_bundle *b = &bundles[n];
            memcpy(b->origin, ray.origin, sizeof b->origin);
            for (int a = 0; a < 3; a++) /* most begin inside */
                if (n % 4) b->origin[a] = random_range(&r, 0, f.size[a] - 1.0);
            b->isovalue = ray.isovalue, b->flags = n % 6 == 1 ? ISOGI_RAY_CAPPED : 0, b->tmax = n % 5 ? 0 : 9, b->tmin = n % 9 == 8 ? 1 : 0;
            if (n % 3 == 1) memcpy(b->origin, bundles[n - 1].origin, sizeof b->origin), b->isovalue += n % 2 ? 0.1 : 0;
            if (n == 11) b->origin[1] = (double)NAN;
            isogi_vol_intersect(f.pyramid, &ray, 1, &starts[n], NULL);
            if (n % 4 == 2 && starts[n].side) b->start = &starts[n], b->isovalue = ray.isovalue;
            for (size_t i = n * each; i < (n + 1) * each; i++) {
                double d[3];
                random_direction(&r, d);
                for (int a = 0; a < 3; a++) dirs[i][a] = (float)d[a];
                rays[i] = (isogi_ray){.flags = b->flags, .tmin = b->tmin, .tmax = b->tmax, .isovalue = b->isovalue};
                memcpy(rays[i].origin, b->origin, sizeof b->origin), memcpy(rays[i].dir, dirs[i], sizeof dirs[i]);
            }
            isogi_vol_bundle(f.pyramid, b, (const float(*)[3])dirs + n * each, each, alone + n * each, &one);
        }
        memset(hits, 77, sizeof hits);
        CHECK(isogi_vol_bundles(f.pyramid, bundles, count, (const float(*)[3])dirs, each, hits, &many) == ISOGI_OK, "hits");
        CHECK(isogi_vol_bundles_occluded(f.pyramid, bundles, count, (const float(*)[3])dirs, each, occluded, NULL) == ISOGI_OK, "any");
        for (size_t i = 0; i < count * each; i++) {
            wrong += !same_hit(&alone[i], &hits[i]), wrong_any += occluded[i] != (alone[i].side != 0);
            found += alone[i].side != 0;
        }
        isogi_vol_intersect(f.pyramid, rays, count * each, hits, NULL);
        for (size_t i = 0; i < count * each; i++) wrong_rays += !bundles[i / each].start && !same_hit(&alone[i], &hits[i]);
        field_free(&f);
    }
    printf("    %ld hits, %ld + %ld + %ld wrong\n", found, wrong, wrong_any, wrong_rays);
    CHECK(wrong == 0 && wrong_any == 0 && wrong_rays == 0, "%ld hits, %ld any hits, %ld rays differ", wrong, wrong_any, wrong_rays);
    CHECK(found > 5000, "only %ld hits", found);
    CHECK(many.rays == one.rays, "rays are counted otherwise");
    CHECK(isogi_vol_bundles(NULL, bundles, 1, (const float(*)[3])dirs, 1, hits, NULL) == ISOGI_INVALID, "no pyramid");
    {
        field f = field_new(4, 4, 4);
        field_build(&f);
        CHECK(isogi_vol_bundles(f.pyramid, NULL, 0, NULL, 0, NULL, NULL) == ISOGI_OK, "nothing");
        CHECK(isogi_vol_bundles(f.pyramid, NULL, 1, (const float(*)[3])dirs, 1, hits, NULL) == ISOGI_INVALID, "no bundles");
        CHECK(isogi_vol_bundles(f.pyramid, bundles, 1, NULL, 1, hits, NULL) == ISOGI_INVALID, "no directions");
        CHECK(isogi_vol_bundles_occluded(f.pyramid, bundles, 1, (const float(*)[3])dirs, 1, NULL, NULL) == ISOGI_INVALID, "no results");
        CHECK(isogi_vol_bundles(f.pyramid, bundles, SIZE_MAX / 2, (const float(*)[3])dirs, 3, hits, NULL) == ISOGI_TOO_LARGE, "too many");
        field_free(&f);
    }
}

/* All hits of a bundle: those of rays of their own, and from a start those of a chain of continued rays;
   and more than there is room for. */
TEST(bundles_have_all_hits_of_single_rays) {
    enum { RAYS = 75, MOST = 12 };
    static float dirs[RAYS][3];
    static isogi_hit hits[RAYS * MOST];
    static size_t counts[RAYS];
    test_random r = {44};
    long found = 0, wrong = 0, cut = 0;
    for (int v = 0; v < 12; v++) {
        field f = field_new(20, 21, 22);
        field_fill(&f, v % KINDS, &r);
        field_build(&f);
        for (int turn = 0; turn < 8; turn++) {
            isogi_ray ray = random_ray(&f, v % KINDS == QUANTISED ? 0 : random_range(&r, -0.5, 0.5), &r);
            isogi_hit start = {0};
            isogi_bundle bundle = {.isovalue = ray.isovalue, .flags = (uint32_t)(turn & 1), .tmax = turn % 3 ? 0 : 7};
            const size_t count = turn % 4 ? RAYS : (size_t)v % 40, room = turn & 4 ? MOST : 2;
            memcpy(bundle.origin, ray.origin, sizeof bundle.origin);
            isogi_vol_intersect(f.pyramid, &ray, 1, &start, NULL);
            hits[0] = start; /* which may lie among the hits */
            if (turn & 2 && start.side) bundle.start = turn & 1 ? hits : &start;
            else bundle.tmin = turn & 4 ? 1.5 : 0;
            for (int i = 0; i < RAYS; i++) {
                double d[3];
                random_direction(&r, d);
                for (int a = 0; a < 3; a++) dirs[i][a] = bundle.start || i % 2 ? (float)d[a] : ray.dir[a] + 0.2f * (float)d[a];
            }
            CHECK(isogi_vol_bundle_all(f.pyramid, &bundle, (const float(*)[3])dirs, count, room, hits, counts, NULL) == ISOGI_OK,
                  "all hits");
            for (size_t i = 0; i < count; i++) {
                const isogi_hit *own = hits + i * room;
                isogi_hit expected[MOST];
                size_t n = 0;
                if (bundle.start) {
                    isogi_hit next = start;
                    double left = bundle.tmax > 0 ? bundle.tmax : HUGE_VAL, t = 0;
                    while (n <= room && left > 0) {
                        const isogi_hit from = next;
                        isogi_vol_continue(f.pyramid, &from, (const float(*)[3])dirs + i, &left, bundle.isovalue,
                                           bundle.flags | (n ? (uint32_t)ISOGI_RAY_ONWARD : 0), 1, &next, NULL);
                        if (!next.side) break;
                        t += next.t, next.t = t, left = bundle.tmax > 0 ? bundle.tmax - t : HUGE_VAL;
                        if (n < room) expected[n] = next;
                        n++;
                    }
                } else {
                    isogi_ray one = {.flags = bundle.flags, .tmin = bundle.tmin, .tmax = bundle.tmax, .isovalue = bundle.isovalue};
                    memcpy(one.origin, bundle.origin, sizeof one.origin), memcpy(one.dir, dirs[i], sizeof one.dir);
                    isogi_vol_intersect_all(f.pyramid, &one, 1, room, expected, &n, NULL);
                }
                wrong += counts[i] != n, cut += n > room;
                for (size_t k = 0; k < n && k < room && counts[i] == n; k++) wrong += !same_hit(&expected[k], &own[k]), found++;
            }
        }
        field_free(&f);
    }
    CHECK(wrong == 0, "%ld differ, of %ld hits", wrong, found);
    CHECK(found > 5000 && cut > 100, "%ld hits, %ld rays with more than there is room for: the test says little", found, cut);
}

/* Rays of a bundle that begin inside the volume share the way to their first leaf, unless they leave it at once: where they begin on planes
   between blocks, or on the border, some of them do. */
TEST(bundles_that_begin_on_planes_between_blocks_have_the_bits_of_single_rays) {
    enum { RAYS = 150 };
    static float dirs[RAYS][3];
    static isogi_hit hits[RAYS];
    static uint8_t occluded[RAYS];
    test_random r = {41};
    long found = 0, missed = 0, wrong = 0;
    isogi_counters shared = {0}, single = {0};
    const isogi_context fastest = {.threads = 1};
    for (int kind = 0; kind < KINDS; kind++) {
        field f = field_new(70, 67, 21);
        field_fill(&f, kind, &r);
        field_build_with(&f, &fastest);
        for (int turn = 0; turn < 60; turn++) {
            isogi_bundle bundle = {.isovalue = random_ray(&f, kind == QUANTISED ? 0 : random_range(&r, -0.5, 0.5), &r).isovalue};
            const size_t count = turn % 3 ? 64 : 1 + random_bits(&r) % RAYS;
            for (int a = 0; a < 3; a++) {
                const double most = f.size[a] - 1, step = (double)(1 << 2 * (random_bits(&r) % 4)), at = random_range(&r, 0, most);
                bundle.origin[a] = turn % 5 == 4 ? at : fmin(step * floor(at / step + 0.5), most);
            }
            for (size_t i = 0; i < count; i++) {
                double d[3];
                random_direction(&r, d);
                for (int a = 0; a < 3; a++) dirs[i][a] = (float)d[a];
            }
            isogi_vol_bundle(f.pyramid, &bundle, (const float(*)[3])dirs, count, hits, &shared);
            isogi_vol_bundle_occluded(f.pyramid, &bundle, (const float(*)[3])dirs, count, occluded, NULL);
            for (size_t i = 0; i < count; i++) {
                isogi_ray one = {.isovalue = bundle.isovalue};
                isogi_hit alone;
                memcpy(one.origin, bundle.origin, sizeof one.origin), memcpy(one.dir, dirs[i], sizeof one.dir);
                isogi_vol_intersect(f.pyramid, &one, 1, &alone, &single);
                wrong += !same_hit(&alone, &hits[i]) || occluded[i] != (alone.side != 0);
                found += alone.side != 0, missed += !alone.side;
            }
        }
        field_free(&f);
    }
    printf("    %ld hits, %ld misses, %ld wrong; blocks a ray %.2f shared, %.2f alone\n", found, missed, wrong,
           (double)shared.blocks / (double)shared.rays, (double)single.blocks / (double)single.rays);
    CHECK(wrong == 0, "%ld of %ld differ", wrong, found + missed);
    CHECK(found > 5000 && missed > 500, "%ld hits, %ld misses: the test says little", found, missed);
    CHECK(shared.rays == single.rays, "rays are counted otherwise");
}

/* ---- value ranges ---- */

/* Whether a cell of the box first..last has a value in one of the ranges. */
static int box_holds(const field *f, const size_t first[3], const size_t last[3], const double (*ranges)[2], size_t count) {
    for (size_t z = first[2]; z < last[2]; z++)
        for (size_t y = first[1]; y < last[1]; y++)
            for (size_t x = first[0]; x < last[0]; x++) {
                double low = DBL_MAX, high = -DBL_MAX;
                for (int c = 0; c < 8; c++) {
                    double value = *field_at(f, (int)x + (c & 1), (int)y + (c >> 1 & 1), (int)z + (c >> 2));
                    if (test_finite(value)) low = fmin(low, value), high = fmax(high, value);
                }
                for (size_t n = 0; n < count; n++)
                    if (low <= high && ranges[n][0] <= high && ranges[n][1] >= low) return 1;
            }
    return 0;
}

static size_t random_ranges(double (*ranges)[2], test_random *r) {
    size_t count = 1 + random_bits(r) % 3;
    for (size_t n = 0; n < count; n++) ranges[n][0] = random_range(r, -4.5, 4.5), ranges[n][1] = ranges[n][0] + random_range(r, 0, 0.3);
    return count;
}

TEST(boxes_hold_what_their_voxels_say) {
    test_random r = {20};
    long held = 0, empty = 0;
    for (int v = 0; v < 12; v++) {
        field f = field_new(v % 3 ? 90 : 7, 30, 41);
        field_fill(&f, v % 2 ? SMOOTH : QUANTISED, &r);
        for (int i = 0; i < f.size[0] * f.size[1] * f.size[2]; i++) f.value[i] = (double)(float)f.value[i];
        field_build(&f);
        const isogi_volume *volume = isogi_vol_volume(f.pyramid);
        for (int i = 0; i < (LONG_SUITE ? 2000 : 200); i++) {
            size_t first[3], last[3], count;
            double ranges[3][2], range[2], truth[2];
            for (int a = 0; a < 3; a++) {
                first[a] = random_bits(&r) % (volume->size[a] - 1);
                last[a] = first[a] + 1 + random_bits(&r) % (i % 2 ? 6 : volume->size[a] - 1 - first[a]);
                if (last[a] >= volume->size[a]) last[a] = volume->size[a] - 1;
            }
            CHECK(isogi_vol_box_range(f.pyramid, first, last, range) == ISOGI_OK, "box");
            isogi_volume_range(volume, first, last, truth);
            CHECK(range[0] == truth[0] && range[1] == truth[1], "%g..%g, not %g..%g", range[0], range[1], truth[0], truth[1]);
            count = random_ranges(ranges, &r);
            int holds = box_holds(&f, first, last, (const double(*)[2])ranges, count);
            CHECK(isogi_vol_may_hold(f.pyramid, first, last, (const double(*)[2])ranges, count) == holds, "holds %d", holds);
            held += holds, empty += !holds;
        }
        field_free(&f);
    }
    CHECK(held > 300 && empty > 300, "%ld boxes hold some, %ld none: the test says little", held, empty);
}

/* Densely sampled: a place lies in a piece if and only if its block may hold a value of the ranges. */
TEST(pieces_of_rays_are_those_whose_blocks_hold_the_ranges) {
    test_random r = {21};
    long within = 0, between = 0, pieces = 0, touching = 0;
    for (int v = 0; v < (LONG_SUITE ? 200 : QUICK_SUITE ? 15 : 20); v++) {
        field f = field_new(70, 34, 66);
        field_fill(&f, v % KINDS, &r);
        for (int i = 0; i < f.size[0] * f.size[1] * f.size[2]; i++) f.value[i] = (double)(float)f.value[i];
        for (int i = 0; i < 300 * (v % 2); i++) f.value[random_bits(&r) % (70 * 34 * 66)] = (double)NAN;
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = 0.5 + a;
        field_build(&f);
        for (int i = 0; i < 40; i++) {
            isogi_ray ray = random_ray(&f, (double)NAN, &r);
            double ranges[3][2], piece[2] = {0, 0}, at, end = -1, step = 0.037;
            size_t count = random_ranges(ranges, &r);
            isogi_counters counters = {0};
            ray.isovalue = 0;
            for (int a = 0; a < 3; a++) ray.origin[a] *= 0.5 + a;
            if (i % 5 == 0) ray.dir[i % 3] = 0;
            if (i % 4 == 0) ray.tmin = random_range(&r, 0, 20), ray.tmax = ray.tmin + random_range(&r, 0, 50);
            int more = isogi_vol_next_interval(f.pyramid, &ray, (const double(*)[2])ranges, count, ray.tmin, piece, &counters), n = 0;
            pieces += more;
            CHECK(!more || (piece[0] >= ray.tmin && (!(ray.tmax > 0) || piece[1] <= ray.tmax)), "%.17g..%.17g of %.17g..%.17g", piece[0],
                  piece[1], ray.tmin, ray.tmax);
            for (at = ray.tmin; at < (ray.tmax > 0 ? ray.tmax : 400); at += step) {
                while (more && piece[1] < at && n++ < 1000) {
                    end = piece[1];
                    more = isogi_vol_next_interval(f.pyramid, &ray, (const double(*)[2])ranges, count, end, piece, &counters);
                    CHECK(!more || (piece[0] >= end && piece[1] > piece[0] && (!(ray.tmax > 0) || piece[1] <= ray.tmax)),
                          "%.17g..%.17g after %.17g, tmax %.17g", piece[0], piece[1], end, ray.tmax);
                    pieces += more, touching += more && piece[0] - end < 1e-9;
                }
                size_t first[3], last[3];
                int inside = 1, edge = 0;
                for (int a = 0; a < 3; a++) {
                    double grid = (ray.origin[a] + at * (double)ray.dir[a]) / (0.5 + a), block = grid / 4;
                    edge |= fabs(block - floor(block + 0.5)) < 1e-9 || fabs(grid - (f.size[a] - 1)) < 1e-9 || fabs(grid) < 1e-9;
                    inside &= grid >= 0 && grid <= f.size[a] - 1;
                    first[a] = inside ? 4 * (size_t)block : 0, last[a] = first[a] + 4;
                    if (last[a] > (size_t)f.size[a] - 1) last[a] = (size_t)f.size[a] - 1;
                }
                if (edge) continue;
                int holds = inside && isogi_vol_may_hold(f.pyramid, first, last, (const double(*)[2])ranges, count);
                int in_piece = more && at >= piece[0] && at <= piece[1];
                CHECK(holds == in_piece, "t %g: may hold %d, in a piece %d (%g..%g)", at, holds, in_piece, piece[0], piece[1]);
                within += holds, between += inside && !holds;
            }
            CHECK(n < 1000, "no end of pieces");
        }
        field_free(&f);
    }
    printf("    %ld pieces; %ld places within them, %ld between\n", pieces, within, between);
    CHECK(touching * 50 <= pieces, "%ld of %ld pieces begin where another ends", touching, pieces);
    CHECK(within > 10000 && between > 10000 && pieces > 300, "%ld and %ld places: the test says little", within, between);
}

TEST(pieces_end_with_their_ray_to_the_bit) {
    test_random r = {12};
    const double all[1][2] = {{-9, 9}};
    field f = field_new(9, 9, 9);
    long ends = 0, begins = 0;
    field_fill(&f, 0, &r), field_build(&f);
    for (int i = 0; i < 10000; i++) {
        isogi_ray ray = {.tmin = i % 2 ? -1e6 : random_range(&r, 0, 1), .tmax = 1 + random_unit(&r)};
        double piece[2];
        for (int a = 0; a < 3; a++) ray.origin[a] = random_range(&r, 0, 8), ray.dir[a] = (float)random_range(&r, -0.5, 0.5);
        for (double t = ray.tmin; t < ray.tmax && isogi_vol_next_interval(f.pyramid, &ray, all, 1, t, piece, NULL); t = piece[1]) {
            CHECK(piece[0] >= ray.tmin && piece[1] <= ray.tmax && piece[0] < piece[1], "%.17g..%.17g of %.17g..%.17g", piece[0], piece[1],
                  ray.tmin, ray.tmax);
            ends += !(piece[1] < ray.tmax), begins += !(piece[0] > ray.tmin);
        }
    }
    CHECK(ends > 3000 && begins > 3000, "%ld end and %ld begin with their ray", ends, begins);
    field_free(&f);
}

/* ---- chunks with a halo ---- */

enum { PARTS = 8, MESH_ROW = 6 };

/* The field cut into 2 x 2 x 2 at voxel `cut`; every second part as a view of the whole's memory, the others as copies with just
   their halo, packed. */
static isogi_volume part_of(const field *whole, const int cut[3], int part, double **copy) {
    isogi_volume v = whole->volume;
    int low[3], size[3], halo[2][3];
    *copy = NULL;
    for (int a = 0; a < 3; a++) {
        int upper = part >> a & 1;
        low[a] = upper ? cut[a] : 0, size[a] = upper ? whole->size[a] - cut[a] : cut[a] + 1;
        halo[0][a] = upper, halo[1][a] = !upper;
        v.size[a] = (size_t)size[a], v.first[a] += (size_t)low[a], v.halo_low[a] = (size_t)halo[0][a], v.halo_high[a] = (size_t)halo[1][a];
    }
    if (part % 2) {
        ptrdiff_t stride = 8;
        for (int a = 0; a < 3; a++) v.stride[a] = stride, stride *= whole->size[a];
        v.data = field_at(whole, low[0], low[1], low[2]);
        return v;
    }
    int n[3];
    for (int a = 0; a < 3; a++) n[a] = halo[0][a] + size[a] + halo[1][a];
    *copy = (double *)calloc((size_t)(n[0] * n[1] * n[2]), sizeof(double));
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            for (int i = 0; i < n[0]; i++)
                (*copy)[i + n[0] * (j + n[1] * k)] =
                    *field_at(whole, low[0] - halo[0][0] + i, low[1] - halo[0][1] + j, low[2] - halo[0][2] + k);
    v.data = *copy + halo[0][0] + n[0] * (halo[0][1] + n[1] * halo[0][2]);
    return v;
}

static void place_obliquely(field *f) {
    const double axes[9] = {0.8, -0.6, 0.1, 0.6, 0.8, 0, 0, 0.2, 1.1};
    memcpy(f->volume.axes, axes, sizeof axes);
    for (int a = 0; a < 3; a++)
        f->volume.spacing[a] = 0.1 * (a + 1.3), f->volume.origin[a] = 7.7 - 3.1 * a, f->volume.first[a] = (size_t)(1000 * a);
}

static int compare_rows(const void *a, const void *b) { return memcmp(a, b, MESH_ROW * sizeof(float)); }

/* Position and normal of every vertex, sorted by their bits; twins kept once. */
static size_t sorted_vertices(const isogi_mesh *mesh, float (**rows)[MESH_ROW], size_t have) {
    size_t n = have, kept = 0;
    *rows = (float(*)[MESH_ROW])realloc(*rows, (have + mesh->vertex_count + 1) * sizeof **rows);
    for (size_t i = 0; i < mesh->vertex_count; i++, n++)
        for (int a = 0; a < 3; a++) (*rows)[n][a] = mesh->positions[i][a] + 0.0f, (*rows)[n][3 + a] = mesh->normals[i][a] + 0.0f;
    qsort(*rows, n, sizeof **rows, compare_rows);
    for (size_t i = 0; i < n; i++)
        if (!kept || compare_rows((*rows)[kept - 1], (*rows)[i])) memcpy((*rows)[kept++], (*rows)[i], sizeof **rows);
    return kept;
}

TEST(meshes_of_chunks_meet_without_a_seam) {
    test_random r = {5};
    for (int v = 0; v < 12; v++) {
        field whole = field_new(13, 12, 14);
        const int cut[3] = {1 + (int)(random_bits(&r) % 11), 5, 1 + (int)(random_bits(&r) % 12)};
        const isogi_mesh_desc desc = {.isovalue = 0.05, .normals = 1};
        isogi_mesh mesh = {0};
        float(*all)[MESH_ROW] = NULL, (*parts)[MESH_ROW] = NULL;
        size_t vertices, in_parts = 0, triangles = 0;
        field_fill(&whole, SMOOTH, &r);
        if (v % 2) place_obliquely(&whole);
        field_build(&whole);
        CHECK(isogi_vol_mesh(whole.pyramid, &desc, &mesh) == ISOGI_OK, "mesh");
        vertices = sorted_vertices(&mesh, &all, 0);
        size_t expected = mesh.triangle_count;
        for (int part = 0; part < PARTS; part++) {
            double *copy;
            isogi_volume chunk = part_of(&whole, cut, part, &copy);
            isogi_pyramid *p = NULL;
            CHECK(isogi_vol_build(&p, &chunk, NULL) == ISOGI_OK, "part %d", part);
            CHECK(isogi_vol_mesh(p, &desc, &mesh) == ISOGI_OK, "part %d", part);
            in_parts = sorted_vertices(&mesh, &parts, in_parts), triangles += mesh.triangle_count;
            isogi_vol_free(p), free(copy);
        }
        CHECK(triangles == expected && expected > 100, "%d triangles, not %d", (int)triangles, (int)expected);
        /* lattice edges are computed alike; a vertex within a cell may differ in its last bits */
        size_t i = 0, k = 0, lone = 0;
        while (i < vertices && k < in_parts) {
            int order = compare_rows(all[i], parts[k]);
            lone += order != 0, i += order <= 0, k += order >= 0;
        }
        lone += vertices - i + in_parts - k;
        CHECK(lone == 0, "%d of %d vertices are not the whole's, bit by bit", (int)lone, (int)(vertices + in_parts));
        isogi_vol_mesh_free(whole.pyramid, &mesh);
        free(all), free(parts);
        field_free(&whole);
    }
}

TEST(hits_and_samples_of_chunks_are_those_of_the_whole) {
    enum { RAYS = 400, MOST = 32 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS][MOST], theirs[RAYS][MOST];
    static size_t counts[RAYS], their_counts[RAYS];
    test_random r = {6};
    long found = 0, different = 0, normals = 0;
    for (int v = 0; v < 12; v++) {
        field whole = field_new(13, 12, 14);
        const int cut[3] = {1 + (int)(random_bits(&r) % 11), 5, 1 + (int)(random_bits(&r) % 12)};
        double sum_of_t[RAYS] = {0};
        size_t in_parts[RAYS] = {0};
        field_fill(&whole, v % 2 ? NOISE : SMOOTH, &r);
        if (v % 4 > 1) place_obliquely(&whole);
        field_build(&whole);
        for (int i = 0; i < RAYS; i++) {
            double place[3], d[3];
            rays[i] = random_ray(&whole, 0.05, &r);
            for (int a = 0; a < 3; a++) d[a] = (double)rays[i].dir[a] + rays[i].origin[a];
            isogi_vol_to_world(whole.pyramid, rays[i].origin, place), isogi_vol_to_world(whole.pyramid, d, d);
            for (int a = 0; a < 3; a++) rays[i].origin[a] = place[a], rays[i].dir[a] = (float)(d[a] - place[a]);
        }
        isogi_vol_intersect_all(whole.pyramid, rays, RAYS, MOST, hits[0], counts, NULL);
        for (int part = 0; part < PARTS; part++) {
            double *copy;
            isogi_volume chunk = part_of(&whole, cut, part, &copy);
            isogi_pyramid *p = NULL;
            isogi_vol_build(&p, &chunk, NULL);
            isogi_vol_intersect_all(p, rays, RAYS, MOST, theirs[0], their_counts, NULL);
            for (int i = 0; i < RAYS; i++)
                for (size_t k = 0; k < their_counts[i]; k++) {
                    float ours[1][3], other[1][3];
                    in_parts[i]++, sum_of_t[i] += theirs[i][k].t;
                    for (size_t n = 0; n < counts[i]; n++) {
                        if (fabs(hits[i][n].t - theirs[i][k].t) > 1e-9) continue;
                        isogi_vol_normals(whole.pyramid, &hits[i][n], 1, ISOGI_NORMAL_SMOOTH, ours);
                        isogi_vol_normals(p, &theirs[i][k], 1, ISOGI_NORMAL_SMOOTH, other);
                        normals++;
                        /* the place is right to some 1e-13 of a cell, the gradient here no less than 1e-3 of its rate of change */
                        for (int a = 0; a < 3; a++)
                            CHECK(fabsf(ours[0][a] - other[0][a]) < 1e-6f, "normal %g, %g", (double)ours[0][a], (double)other[0][a]);
                    }
                }
            for (int i = 0; i < 200; i++) {
                double grid[3], world[3];
                float point[1][3], ours[4], other[4];
                for (int a = 0; a < 3; a++) grid[a] = random_range(&r, 0, (double)chunk.size[a] - 1);
                isogi_vol_to_world(p, grid, world);
                for (int a = 0; a < 3; a++) point[0][a] = (float)world[a];
                isogi_vol_sample_smooth(whole.pyramid, (const float(*)[3])point, 1, ours, (float(*)[3])(ours + 1));
                isogi_vol_sample_smooth(p, (const float(*)[3])point, 1, other, (float(*)[3])(other + 1));
                /* a point on the chunk's border may be rounded out of it: by 1e-6 of the origin, in cells of 0.1 and more */
                for (int a = 0; a < 4; a++)
                    CHECK(fabsf(ours[a] - other[a]) < (v % 4 > 1 ? 2e-3f : 1e-5f), "sample %d: %g, %g", a, (double)ours[a],
                          (double)other[a]);
            }
            isogi_vol_free(p), free(copy);
        }
        for (int i = 0; i < RAYS; i++) {
            double sum = 0;
            for (size_t n = 0; n < counts[i]; n++) sum += hits[i][n].t;
            found += (long)counts[i], different += in_parts[i] != counts[i] || fabs(sum - sum_of_t[i]) > 1e-7;
        }
        field_free(&whole);
    }
    printf("    %ld hits, %ld normals compared, %ld rays differ\n", found, normals, different);
    CHECK(different == 0 && found > 2000 && normals >= found, "%ld of %ld", different, found);
}

TEST(bad_halos_are_refused) {
    float voxel[27] = {0};
    isogi_volume good = {.data = &voxel[13], .type = ISOGI_F32, .size = {1, 1, 1}, .halo_low = {1, 1, 1}, .halo_high = {1, 1, 1}}, v = good;
    CHECK(isogi_volume_validate(&good) == ISOGI_OK, "good");
    v.halo_low[1] = SIZE_MAX;
    CHECK(isogi_volume_validate(&v) == ISOGI_TOO_LARGE, "endless halo");
    v = good, v.halo_high[0] = v.halo_high[1] = v.halo_high[2] = 0x7fffffff;
    CHECK(isogi_volume_validate(&v) == ISOGI_TOO_LARGE, "overflow");
#if SIZE_MAX > 0xffffffffu
    v = good, v.first[2] = SIZE_MAX;
    CHECK(isogi_volume_validate(&v) == ISOGI_TOO_LARGE, "far chunk");
#endif
}

/* ---- arguments that make no sense ---- */

TEST(calls_without_an_object_say_so) {
    double range[2] = {1, 1}, corner[8], at[3] = {1, 2, 3}, out[3] = {4, 5, 6};
    size_t lattice[3] = {1, 1, 1}, texel[3] = {0, 0, 0};
    uint32_t cell[3] = {0, 0, 0};
    int order = 7, channels = 7;
    isogi_counters counters = {.rays = 5};
    CHECK(!isogi_vol_volume(NULL) && !isogi_vol_context(NULL), "something of nothing");
    CHECK(!isogi_vol_level(NULL, 0).range, "a level of nothing");
    isogi_vol_range(NULL, range), isogi_vol_range(NULL, NULL);
    CHECK(range[0] == 0 && range[1] == 0, "range %g %g", range[0], range[1]);
    isogi_vol_to_world(NULL, at, out), isogi_vol_to_grid(NULL, at, out);
    CHECK(out[0] == 0 && out[2] == 0, "%g %g", out[0], out[2]);
    CHECK(isogi_volume_corners(NULL, cell, corner) == 0, "corners of nothing");
    isogi_volume_range(NULL, texel, texel, range);
    CHECK(range[0] > range[1], "a range of nothing: %g %g", range[0], range[1]);
    isogi_trace_shape(NULL, lattice, &order, &channels), isogi_trace_shape(NULL, NULL, NULL, NULL);
    CHECK(!lattice[0] && !lattice[2] && !order && !channels, "order %d, channels %d", order, channels);
    CHECK(!isogi_trace_valid(NULL, texel), "a texel of nothing");
    isogi_trace_counters(NULL, &counters), isogi_trace_counters(NULL, NULL);
    CHECK(counters.rays == 5, "%d rays", (int)counters.rays);
}

/* ---- what other headers stand on ---- */

typedef struct ledger { size_t blocks, bytes, align; } ledger;
static void *ledger_alloc(void *user, size_t size, size_t align) {
    ledger *l = (ledger *)user;
    l->blocks++, l->bytes += size, l->align = align;
    return malloc(size);
}
static void ledger_release(void *user, void *p, size_t size) {
    ledger *l = (ledger *)user;
    l->blocks--, l->bytes -= size;
    free(p);
}

TEST(memory_is_aligned_counted_and_never_wraps_around) {
    ledger l = {0, 0, 0};
    const isogi_context context = {.alloc = ledger_alloc, .release = ledger_release, .user = &l};
    const isogi_context *const contexts[2] = {NULL, &context};
    for (int c = 0; c < 2; c++) {
        CHECK(!isogi_allocate(contexts[c], 0, 8) && !isogi_allocate(contexts[c], 8, 0), "nothing is NULL, %d", c);
        CHECK(!isogi_allocate(contexts[c], SIZE_MAX / 2, 3) && !isogi_allocate(contexts[c], SIZE_MAX, SIZE_MAX),
              "a product that overflows, %d", c);
        char *p = (char *)isogi_allocate(contexts[c], 7, 9);
        CHECK(p != NULL && (c || (uintptr_t)p % 64 == 0), "block %p", (void *)p);
        if (p) memset(p, 1, 63);
        CHECK(!c || (l.blocks == 1 && l.bytes == 63 && l.align == 64), "%zu blocks, %zu bytes, alignment %zu", l.blocks, l.bytes, l.align);
        isogi_release(contexts[c], p, 7, 9), isogi_release(contexts[c], NULL, 7, 9);
    }
    CHECK(!isogi_allocate(NULL, SIZE_MAX - 8, 1), "no room beside %d bytes", 8);
    CHECK(!l.blocks && !l.bytes, "%zu blocks, %zu bytes left", l.blocks, l.bytes);
}

TEST(a_pyramid_knows_whether_all_voxels_are_finite) {
    const double odd[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    CHECK(!isogi_vol_finite(NULL), "no pyramid, %d", 0);
    for (int n = 0; n < 4; n++) {
        test_random r = {77};
        field f = field_new(9, 10, 11);
        field_fill(&f, NOISE, &r);
        if (n) f.value[300 * n] = odd[n - 1];
        field_build(&f);
        CHECK(isogi_vol_finite(f.pyramid) == !n, "case %d: %d", n, isogi_vol_finite(f.pyramid));
        field_free(&f);
    }
}

/* Bounds count in: a box of one value may hold an interval that begins or ends there, and none beside it; so do pieces of rays. A piece
   does not begin before its ray does, wherever it is looked for. */
TEST(intervals_that_touch_a_value_hold_it) {
    static float data[20][20][20];
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {20, 20, 20}};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < 8000; i++) data[i / 400][i / 20 % 20][i % 20] = 5;
    CHECK(isogi_vol_build(&p, &volume, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 4; k++) {
        const double range[1][2] = {{(const double[]){3, 5, 3, 5.5}[k], (const double[]){5, 8, 4.5, 8}[k]}};
        const size_t boxes[2][2][3] = {{{0, 0, 0}, {19, 19, 19}}, {{3, 5, 7}, {6, 6, 18}}};
        isogi_ray ray = {.origin = {-5, 7.3, 9.1}, .dir = {1, 0, 0}, .tmin = 9, .tmax = 20};
        double piece[2];
        for (int b = 0; b < 2; b++)
            CHECK(isogi_vol_may_hold(p, boxes[b][0], boxes[b][1], range, 1) == (k < 2), "box %d, %g to %g", b, range[0][0], range[0][1]);
        for (int from = 0; from < 3; from++) {
            const double start = (const double[]){-100, 0, 12}[from], begin = fmax(start, 9);
            const int found = isogi_vol_next_interval(p, &ray, range, 1, start, piece, NULL);
            CHECK(found == (k < 2) && (!found || (fabs(piece[0] - begin) < 1e-9 && fabs(piece[1] - 20) < 1e-9)),
                  "from %g, %g to %g: %d, %g to %g", start, range[0][0], range[0][1], found, piece[0], piece[1]);
        }
    }
    isogi_vol_free(p);
}

TEST_MAIN("vol_api")
