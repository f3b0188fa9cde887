/* isogi_vol: volumes some voxels of which are not finite, as masks of land, of air and of failed sensors are. Rays have the hits of the
   plain walk (which test_vol_hard compares with a reference) on every path, and hardly do more work than without holes. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "ray_fields.h"
#include "test.h"

/* Single voxels; balls; all but a ball; below a hilly ground; sheets one voxel thick in borders of blocks, with low values and high ones in
   turns between them; a few infinite ones. */
enum { SPECKS, BALLS, OUTSIDE, GROUND, SHEETS, INFINITE, HOLES };

static int in_ball(const int at[3], const double ball[4]) {
    double square = 0;
    for (int a = 0; a < 3; a++) square += (at[a] - ball[a]) * (at[a] - ball[a]);
    return square < ball[3] * ball[3];
}

static void make_holes(field *f, int holes, test_random *r) {
    const double odd[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY}, slope = random_range(r, -0.5, 0.5);
    const uint64_t rare = 15 + random_bits(r) % 150;
    const int axis = (int)(random_bits(r) % 3), most = f->size[0] > f->size[1] ? f->size[0] : f->size[1];
    double ball[3][4];
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) ball[i][a] = random_range(r, 0.2, 0.8) * (f->size[a] - 1);
        ball[i][3] = random_range(r, 1, 0.2 * most + 1);
    }
    ball[0][3] = holes == OUTSIDE ? 0.45 * most : ball[0][3];
    for (size_t i = 0; i < field_count(f); i++) {
        const int x = (int)i % f->size[0], y = (int)i / f->size[0] % f->size[1], z = (int)i / f->size[0] / f->size[1];
        const int at[3] = {x, y, z};
        int hole = 0;
        if (holes == SPECKS) hole = random_bits(r) % rare == 0;
        else if (holes == BALLS) hole = in_ball(at, ball[0]) || in_ball(at, ball[1]) || in_ball(at, ball[2]);
        else if (holes == OUTSIDE) hole = !in_ball(at, ball[0]);
        else if (holes == GROUND) hole = z < 0.3 * f->size[2] + slope * x + sin(0.3 * y);
        else if (holes == SHEETS) hole = at[axis] % 12 == 4 && random_bits(r) % 40;
        else hole = random_bits(r) % 700 == 0;
        if (holes == SHEETS) f->value[i] += (at[axis] + 7) / 12 % 2 ? 1 : -1;
        if (hole) f->value[i] = odd[holes == INFINITE ? 1 + x % 2 : holes == BALLS ? x % 3 : 0];
    }
}

/* A field with holes, as built by every path, and for all but the plain one as a compact volume, too. */
enum { WAYS = 7, TOGETHER = 48 };
typedef struct holed {
    field f;
    float *single; /* the values, where they are floats */
    isogi_pyramid *way[WAYS];
} holed;

static holed holed_new(int kind, int holes, int floats, test_random *r) {
    const int large = random_bits(r) % 8 == 0; /* now and then one more level of nodes */
    const int x = (large ? 65 : 2) + (int)(random_bits(r) % 40), y = 2 + (int)(random_bits(r) % 40), z = 2 + (int)(random_bits(r) % 40);
    holed h = {.f = field_new(x, y, z)};
    field *f = &h.f;
    field_fill(f, kind, r);
    if (holes < HOLES) make_holes(f, holes, r);
    if (floats) {
        h.single = (float *)malloc(field_count(f) * sizeof *h.single);
        for (size_t i = 0; i < field_count(f); i++) h.single[i] = (float)f->value[i];
        f->volume.data = h.single, f->volume.type = ISOGI_F32;
    }
    f->volume.scale = random_bits(r) & 1 ? -0.5 : 1, f->volume.bias = random_bits(r) & 1 ? 0.25 : 0;
    for (int a = 0; a < 3; a++) f->volume.spacing[a] = random_range(r, 0.7, 1.3);
    for (int w = 0; w < WAYS; w++) {
        const isogi_context context = {.threads = 1, .force_path = w ? 2 + (w - 1) / 2 : 1};
        f->volume.compact = w && !(w & 1);
        CHECK(isogi_vol_build(&h.way[w], &f->volume, &context) == ISOGI_OK, "build");
    }
    return h;
}

static void holed_free(holed *h) {
    for (int w = 0; w < WAYS; w++) isogi_vol_free(h->way[w]);
    free(h->single), field_free(&h->f);
}

/* Rays from all sides, or side by side: a picture's, whose neighbours nearly coincide. */
static void make_rays(const holed *h, isogi_ray *rays, int abreast, double isovalue, int capped, test_random *r) {
    const double spread = random_bits(r) & 1 ? 0.3 : 0.01;
    for (int i = 0; i < TOGETHER; i++) {
        rays[i] = abreast && i ? rays[0] : random_ray(&h->f, isovalue, r);
        for (int a = 0; a < 3 && abreast; a++) {
            if (!i) rays[i].origin[a] -= 50 * (double)rays[i].dir[a];
            rays[i].dir[a] += (float)random_range(r, -0.002, 0.002), rays[i].origin[a] += spread * random_range(r, -1, 1);
        }
        rays[i].flags = capped && i % 3 == 0 ? ISOGI_RAY_CAPPED : 0;
        if (i % 11 == 5) rays[i].tmin = random_range(r, -5, 60), rays[i].tmax = rays[i].tmin + random_range(r, 0.1, 30);
    }
}

typedef struct found { long hits, different; } found;

static void compare(found *all, const isogi_hit *hits, const isogi_hit *plain, int count, const char *what, int way) {
    for (int i = 0; i < count; i++) {
        all->hits += plain[i].side != 0;
        if (same_hit(&hits[i], &plain[i])) continue;
        if (!all->different++)
            printf("    %s, way %d: ray %d has side %d at %.17g, by the plain walk %d at %.17g\n", what, way, i, hits[i].side, hits[i].t,
                   plain[i].side, plain[i].t);
    }
}

static void compare_flags(found *all, const uint8_t *any, const isogi_hit *plain, int count) {
    for (int i = 0; i < count; i++) all->hits += any[i], all->different += any[i] != (plain[i].side != 0);
}

/* On from hits: each in a direction of its own, or all in the ray's, which then come to all further crossings. */
static void compare_onward(found *all, const holed *h, int way, const isogi_hit *from, const isogi_ray *rays, test_random *r) {
    isogi_hit start[TOGETHER], hits[TOGETHER], plain[TOGETHER];
    float dirs[TOGETHER][3];
    const int onward = random_bits(r) & 1;
    const uint32_t flags = (onward ? ISOGI_RAY_ONWARD : 0) | (random_bits(r) & 1 ? ISOGI_RAY_CAPPED : 0);
    int n = 0;
    for (int i = 0; i < TOGETHER; i++) {
        double d[3];
        if (!from[i].side) continue;
        random_direction(r, d);
        for (int a = 0; a < 3; a++) dirs[n][a] = onward ? rays[i].dir[a] : (float)d[a];
        start[n++] = from[i];
    }
    isogi_vol_continue(h->way[way], start, (const float(*)[3])dirs, NULL, rays->isovalue, flags, (size_t)n, hits, NULL);
    isogi_vol_continue(h->way[0], start, (const float(*)[3])dirs, NULL, rays->isovalue, flags, (size_t)n, plain, NULL);
    compare(all, hits, plain, n, "onward", way);
}

/* Many rays from one point of a surface, or from anywhere. */
static void compare_bundle(found *all, const holed *h, int way, const isogi_hit *from, const isogi_ray *rays, test_random *r) {
    isogi_hit hits[TOGETHER], plain[TOGETHER];
    uint8_t any[TOGETHER];
    float dirs[TOGETHER][3];
    isogi_bundle bundle = {.isovalue = rays->isovalue};
    const isogi_hit *start = &from[random_bits(r) % TOGETHER];
    if (start->side) bundle.start = start;
    bundle.flags = (random_bits(r) & 1 ? ISOGI_RAY_CAPPED : 0) | (start->side && random_bits(r) & 1 ? ISOGI_RAY_ONWARD : 0);
    bundle.tmax = random_bits(r) % 4 ? 0 : random_range(r, 1, 20);
    for (int a = 0; a < 3; a++) bundle.origin[a] = random_range(r, -0.1, 1.1) * (h->f.size[a] - 1) * h->f.volume.spacing[a];
    for (int i = 0; i < TOGETHER; i++) {
        double d[3];
        random_direction(r, d);
        for (int a = 0; a < 3; a++) dirs[i][a] = (float)d[a];
    }
    isogi_vol_bundle(h->way[way], &bundle, (const float(*)[3])dirs, TOGETHER, hits, NULL);
    isogi_vol_bundle(h->way[0], &bundle, (const float(*)[3])dirs, TOGETHER, plain, NULL);
    compare(all, hits, plain, TOGETHER, "bundle", way);
    isogi_vol_bundle_occluded(h->way[way], &bundle, (const float(*)[3])dirs, TOGETHER, any, NULL);
    compare_flags(all, any, plain, TOGETHER);
}

/* Every hit along a few rays. */
static void compare_all(found *all, const holed *h, int way, const isogi_ray *rays) {
    enum { FEW = 8, MOST = 12 };
    isogi_hit hits[FEW * MOST], plain[FEW * MOST];
    size_t counts[FEW], plain_counts[FEW];
    isogi_vol_intersect_all(h->way[way], rays, FEW, MOST, hits, counts, NULL);
    isogi_vol_intersect_all(h->way[0], rays, FEW, MOST, plain, plain_counts, NULL);
    for (int i = 0; i < FEW; i++) {
        const int n = (int)(plain_counts[i] < MOST ? plain_counts[i] : MOST);
        all->different += counts[i] != plain_counts[i];
        if (counts[i] == plain_counts[i]) compare(all, hits + i * MOST, plain + i * MOST, n, "all", way);
    }
}

SLOW_TEST(rays_past_holes_hit_what_the_plain_walk_hits) {
    test_random r = {71};
    found first = {0, 0}, any = {0, 0}, onward = {0, 0}, bundles = {0, 0};
    for (int turn = 0; turn < (LONG_SUITE ? 6000 : 150); turn++) {
        const int kind = turn / HOLES % KINDS;
        holed h = holed_new(kind, turn % HOLES, random_bits(&r) % 4 > 0, &r);
        for (int pack = 0; pack < 8; pack++) {
            isogi_ray rays[TOGETHER];
            isogi_hit plain[TOGETHER], hits[TOGETHER];
            uint8_t occluded[TOGETHER];
            double isovalue = random_range(&r, -0.8, 0.8);
            if (kind == QUANTISED && random_bits(&r) & 1) isovalue = floor(2 * isovalue) / 2;
            if (pack == 7) isovalue *= 20; /* often in no voxel */
            make_rays(&h, rays, (int)(random_bits(&r) % 2), isovalue, (int)(random_bits(&r) % 2), &r);
            isogi_vol_intersect(h.way[0], rays, TOGETHER, plain, NULL);
            for (int w = 1; w < WAYS; w++) {
                isogi_vol_intersect(h.way[w], rays, TOGETHER, hits, NULL);
                compare(&first, hits, plain, TOGETHER, "first hits", w);
                isogi_vol_occluded(h.way[w], rays, TOGETHER, occluded, NULL);
                compare_flags(&any, occluded, plain, TOGETHER);
                for (int i = w; i < TOGETHER; i += 7) {
                    isogi_vol_intersect(h.way[w], &rays[i], 1, &hits[i], NULL), compare(&first, &hits[i], &plain[i], 1, "alone", w);
                    isogi_vol_occluded(h.way[w], &rays[i], 1, &occluded[i], NULL), compare_flags(&any, &occluded[i], &plain[i], 1);
                }
                compare_onward(&onward, &h, w, plain, rays, &r), compare_bundle(&bundles, &h, w, plain, rays, &r);
                compare_all(&onward, &h, w, rays);
            }
        }
        holed_free(&h);
    }
    printf("    %ld first hits, %ld any, %ld onward, %ld of bundles\n", first.hits, any.hits, onward.hits, bundles.hits);
    CHECK(first.hits > 50000 && any.hits > 50000 && onward.hits > 20000 && bundles.hits > 20000, "too few hits to say much");
    CHECK(first.different <= TOUCHES_PER_HIT * (double)first.hits && any.different <= TOUCHES_PER_HIT * (double)any.hits,
          "%ld first hits differ, %ld any", first.different, any.different);
    CHECK(onward.different <= TOUCHES_PER_HIT * (double)onward.hits && bundles.different <= TOUCHES_PER_HIT * (double)bundles.hits,
          "%ld onward hits differ, %ld of bundles", onward.different, bundles.different);
}

/* What lies out of a ball is NaN, half of the volume: rays to its middle pass that without looking at cells, and look at few more where it
   ends. */
TEST(rays_through_masks_look_at_few_more_cells) {
    enum { SIDE = 96, RAYS = 4096 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS];
    for (int path = 2; path < 5; path++) {
        const isogi_context context = {.threads = 1, .force_path = path == 4 ? 0 : path};
        double blocks[2], cells[2];
        for (int holes = 0; holes < 2; holes++) {
            test_random r = {5};
            isogi_counters count = {0};
            field f = field_new(SIDE, SIDE, SIDE);
            for (size_t i = 0; i < field_count(&f); i++) {
                double square = 0, p[3];
                size_t at = i;
                for (int a = 0; a < 3; a++, at /= SIDE) p[a] = 2.0 * (double)(at % SIDE) / (SIDE - 1) - 1, square += p[a] * p[a];
                f.value[i] = sin(6 * p[0]) * cos(6 * p[1]) + sin(6 * p[1]) * cos(6 * p[2]) + sin(6 * p[2]) * cos(6 * p[0]);
                if (holes && square > 1) f.value[i] = (double)NAN;
            }
            field_build_with(&f, &context);
            for (int i = 0; i < RAYS; i++) {
                double d[3];
                random_direction(&r, d);
                memset(&rays[i], 0, sizeof rays[i]);
                for (int a = 0; a < 3; a++)
                    rays[i].dir[a] = (float)d[a], rays[i].origin[a] = SIDE * (0.5 - d[a]) + random_range(&r, -0.3, 0.3) * SIDE;
                rays[i].isovalue = 0.9;
            }
            isogi_vol_intersect(f.pyramid, rays, RAYS, hits, &count);
            blocks[holes] = (double)count.blocks / RAYS, cells[holes] = (double)count.cells / RAYS;
            field_free(&f);
        }
        printf("    path %d: %.2f blocks and %.2f cells a ray, without holes %.2f and %.2f\n", path, blocks[1], cells[1], blocks[0],
               cells[0]);
        CHECK(blocks[1] < 1.5 * blocks[0] && cells[1] < cells[0] + 3, "path %d: %g blocks, %g cells", path, blocks[1], cells[1]);
    }
}

TEST_MAIN("vol_holes")
