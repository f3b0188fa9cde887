/* Very many rays: against a reference that is cheap and knows when it does not know, and out of closed surfaces, which nothing may leave
   unseen. Runs on all cores.

   Quick: 150 thousand and 10 million rays. With --long, 100 million and a billion, or as many as fit into five minutes each, which it
   prints, and an eighth of that in any time; ISOGI_TEST_RAYS and ISOGI_TEST_SECONDS set other numbers for both. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "test.h"
#include "reference_quick.h"
#include "reference_wide.h"

enum { SOME = 2048, KINDS = 6, TURNS = 24 };

/* Paths in turn, the fast ones more often. */
static const int paths[TURNS] = {0, 2, 4, 0, 3, 4, 1, 4, 0, 5, 2, 4, 0, 4, 3, 4, 0, 4, 6, 4, 0, 4, 0, 4};

static const char *const kinds[KINDS] = {
    "noise", "waves", "bytes between levels", "bytes at levels", "smooth bytes at levels", "smooth bytes between levels"};

static double number_from(const char *name, double otherwise) {
    const char *text = getenv(name);
    const double number = text ? atof(text) : 0;
    return number > 0 ? number : otherwise;
}

static double wall_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Every task makes its own volume and rays and keeps its own account: CHECK is not for threads. */
typedef struct account {
    long rays, hits, wide, undecided, wrong, misplaced;
    char first[256]; /* what went wrong first */
} account;

typedef struct crowd {
    account *task;
    size_t least; /* tasks that are done in any case: */
    double until; /* others do not begin after this */
} crowd;

/* ---- fields ---- */

/* A scene of one kind with a pyramid on one path; *isovalue: one to start from, *step: distance of levels, 0 if there are none. */
static scene crowd_scene(int kind, int closed, int path, isogi_pyramid **pyramid, test_random *r) {
    const int large = kind == 1 || kind >= 4, n = large ? 24 : 9;
    scene s = scene_new(3 + (int)(random_bits(r) % (uint64_t)n), 3 + (int)(random_bits(r) % (uint64_t)n),
                        3 + (int)(random_bits(r) % (uint64_t)n));
    const isogi_context context = {.threads = 1, .force_path = forced_path(path)};
    double wave[3][4];
    for (int w = 0; w < 3; w++)
        for (int a = 0; a < 4; a++) wave[w][a] = random_range(r, -1, 1) * (a < 3 ? 0.6 : 6.28);
    for (size_t i = 0; i < scene_voxels(&s); i++) {
        const int x = (int)i % s.size[0], y = (int)i / s.size[0] % s.size[1], z = (int)i / s.size[0] / s.size[1];
        double v = large ? 0 : random_range(r, -1, 1);
        for (int w = 0; w < 3 && large; w++) v += 0.45 * sin(wave[w][0] * x + wave[w][1] * y + wave[w][2] * z + wave[w][3]);
        if (closed && !(x && y && z && x < s.size[0] - 1 && y < s.size[1] - 1 && z < s.size[2] - 1)) v = -1.5;
        s.value[i] = kind >= 2 ? floor((kind < 4 ? 4 : 10) * v) : v;
    }
    if (kind >= 2) { /* bytes: raw = 40 + 20 value, 2 to 74; the value is what it decodes to */
        for (size_t i = 0; i < scene_voxels(&s); i++) s.value[i] /= kind < 4 ? 4 : 8;
        scene_encode(&s, ISOGI_U8, 0, 0);
    }
    for (size_t i = 0; i < scene_voxels(&s); i++) s.most = fmax(s.most, fabs(s.value[i]));
    s.volume.compact = path > 4;
    if (isogi_vol_build(pyramid, &s.volume, &context) != ISOGI_OK) abort();
    return s;
}

static double crowd_isovalue(const scene *s, int kind, test_random *r) {
    if (kind < 2) return random_range(r, -0.6, 0.6);
    /* a value that the data have, or one beside it */
    const double level = s->value[random_bits(r) % scene_voxels(s)];
    return kind == 3 || kind == 4 ? level : level + random_range(r, 0.01, 0.99);
}

static quick_truth crowd_truth(const scene *s, const isogi_ray *ray, double tolerance) {
    const reference_field field = {s->value, {s->size[0], s->size[1], s->size[2]}, (real)tolerance};
    const double dir[3] = {(double)ray->dir[0], (double)ray->dir[1], (double)ray->dir[2]};
    return quick_intersect(&field, ray->origin, dir, ray->tmin, ray->tmax, ray->isovalue);
}

/* ---- against the reference ---- */

static void note(account *a, const char *what, const scene *s, int kind, int path, const isogi_ray *ray, const isogi_hit *hit, int truth) {
    if (a->first[0]) return;
    snprintf(a->first, sizeof a->first,
             "%s: %s, path %d, size %d %d %d, origin %.17g %.17g %.17g dir %.9g %.9g %.9g isovalue %.17g: side %d at %.17g, reference %d",
             what, kinds[kind], path, s->size[0], s->size[1], s->size[2], ray->origin[0], ray->origin[1], ray->origin[2],
             (double)ray->dir[0], (double)ray->dir[1], (double)ray->dir[2], ray->isovalue, hit->side, hit->t, truth);
}

/* Whether it is not the first hit, for certain. */
static int is_other(const scene *s, const isogi_ray *ray, const isogi_hit *hit) {
    const reference_hit truth = wide_intersect(s, ray);
    return truth.decided && !wide_same_hit(s, ray, hit->t, truth.t);
}

static void compare_task(void *arg, size_t i) {
    const crowd *c = (const crowd *)arg;
    account *a = &c->task[i];
    test_random r = {1000003 * (uint64_t)(i + 1)};
    const int kind = (int)(i % KINDS), path = paths[i / KINDS % TURNS];
    isogi_pyramid *pyramid = NULL;
    if (i >= c->least && wall_seconds() > c->until) return;
    scene s = crowd_scene(kind, 0, path, &pyramid, &r);
    isogi_ray *rays = (isogi_ray *)malloc(SOME * sizeof *rays);
    isogi_hit *hits = (isogi_hit *)malloc(SOME * sizeof *hits);
    for (int batch = 0; batch < 12; batch++) {
        for (int k = 0; k < SOME; k++) {
            double d[3], back = random_bits(&r) & 1 ? 0 : 40 * random_unit(&r);
            memset(&rays[k], 0, sizeof rays[k]);
            random_direction(&r, d);
            for (int x = 0; x < 3; x++) {
                rays[k].dir[x] = (float)d[x];
                rays[k].origin[x] = random_range(&r, 0, s.size[x] - 1) - back * (double)rays[k].dir[x];
            }
            rays[k].isovalue = crowd_isovalue(&s, kind, &r);
        }
        isogi_vol_intersect(pyramid, rays, SOME, hits, NULL);
        for (int k = 0; k < SOME; k++) {
            const double tolerance = rounding(&s, &rays[k]);
            quick_truth truth = crowd_truth(&s, &rays[k], 64 * tolerance);
            a->rays++;
            if (!truth.decided) {
                reference_hit wide_truth = wide_intersect(&s, &rays[k]);
                a->wide++;
                if (!wide_truth.decided) { a->undecided++; continue; }
                truth.side = wide_truth.side, truth.t[0] = truth.t[1] = (double)wide_truth.t;
            }
            a->hits += truth.side != 0;
            if (hits[k].side != truth.side) a->wrong++, note(a, "side", &s, kind, path, &rays[k], &hits[k], truth.side);
            else if (truth.side && (hits[k].t < truth.t[0] - 1e-9 || hits[k].t > truth.t[1] + 1e-9) && is_other(&s, &rays[k], &hits[k]))
                a->misplaced++, note(a, "another hit", &s, kind, path, &rays[k], &hits[k], truth.side);
            else if (truth.side) { /* the field at the hit is the isovalue */
                double corner[8], value = -rays[k].isovalue;
                const int cell[3] = {(int)hits[k].cell[0], (int)hits[k].cell[1], (int)hits[k].cell[2]};
                for (int n = 0; n < 8; n++) {
                    corner[n] = s.value[cell[0] + (n & 1) + s.size[0] * (cell[1] + (n >> 1 & 1) + s.size[1] * (cell[2] + (n >> 2)))];
                    value += corner[n] * (n & 1 ? hits[k].local[0] : 1 - hits[k].local[0]) *
                             (n & 2 ? hits[k].local[1] : 1 - hits[k].local[1]) * (n & 4 ? hits[k].local[2] : 1 - hits[k].local[2]);
                }
                if (fabs(value) > 100 * tolerance) a->misplaced++, note(a, "place", &s, kind, path, &rays[k], &hits[k], truth.side);
            }
        }
    }
    isogi_vol_free(pyramid);
    free(s.value), free(s.raw), free(rays), free(hits);
}

/* ---- out of closed surfaces ---- */

static void escape_task(void *arg, size_t i) {
    const crowd *c = (const crowd *)arg;
    account *a = &c->task[i];
    test_random r = {7000003 * (uint64_t)(i + 1)};
    const int kind = (int)(i % KINDS), path = paths[i / KINDS % TURNS], at_level = kind == 3 || kind == 4;
    isogi_pyramid *pyramid = NULL;
    if (i >= c->least && wall_seconds() > c->until) return;
    scene s = crowd_scene(kind, 1, path, &pyramid, &r);
    isogi_ray *rays = (isogi_ray *)malloc(SOME * sizeof *rays);
    isogi_hit *hits = (isogi_hit *)malloc(SOME * sizeof *hits), *starts = (isogi_hit *)malloc(SOME * sizeof *starts);
    float(*dirs)[3] = (float(*)[3])malloc(SOME * sizeof *dirs);
    int *inside = (int *)malloc(scene_voxels(&s) * sizeof *inside), count = 0;
    for (int k = 0; k < SOME; k++) {
        double d[3];
        random_direction(&r, d);
        for (int x = 0; x < 3; x++) dirs[k][x] = (float)d[x];
    }
    for (int batch = 0; batch < 48; batch++) {
        const double isovalue = crowd_isovalue(&s, kind, &r);
        count = 0;
        for (size_t k = 0; k < scene_voxels(&s); k++)
            if (s.value[k] > isovalue + 1e-3) inside[count++] = (int)k;
        /* the border must lie outside for a surface to be closed */
        if (!count || s.value[0] >= isovalue) continue;
        for (int k = 0; k < SOME; k++) {
            const int at = inside[random_bits(&r) % (uint64_t)count];
            memset(&rays[k], 0, sizeof rays[k]);
            rays[k].origin[0] = at % s.size[0], rays[k].origin[1] = at / s.size[0] % s.size[1],
            rays[k].origin[2] = at / s.size[0] / s.size[1];
            memcpy(rays[k].dir, dirs[k], sizeof dirs[k]);
            rays[k].isovalue = isovalue;
        }
        isogi_vol_intersect(pyramid, rays, SOME, hits, NULL);
        a->rays += SOME;
        for (int k = 0; k < SOME; k++)
            if (hits[k].side != -1) a->wrong++, note(a, "escaped", &s, kind, path, &rays[k], &hits[k], -1);
        /* what comes out goes in again or leaves; what comes in comes out, but where layers without thickness are only touched */
        for (int round = 0; round < 3 && !at_level; round++) {
            memcpy(starts, hits, SOME * sizeof *starts);
            isogi_vol_continue(pyramid, starts, (const float(*)[3])dirs, NULL, isovalue, 0, SOME, hits, NULL);
            for (int k = 0; k < SOME; k++) {
                const int before = starts[k].side, now = hits[k].side;
                a->rays += before != 0;
                if ((before == 1 && now != -1) || (before == -1 && now != 1 && now != 0))
                    a->wrong++, note(a, "escaped", &s, kind, path, &rays[k], &hits[k], -before);
                if (before == 0) hits[k].side = 0;
            }
        }
    }
    isogi_vol_free(pyramid);
    free(s.value), free(s.raw), free(rays), free(hits), free(starts), free(dirs), free(inside);
}

/* ---- all tasks ---- */

/* quick, rays: how many in the quick and in the long suite. */
static account crowd_run(void (*task)(void *, size_t), double quick, double rays, double rays_per_task) {
    const double wanted = LONG_SUITE ? number_from("ISOGI_TEST_RAYS", rays) : quick;
    const size_t tasks = (size_t)(wanted / rays_per_task) + 1;
    const double seconds = LONG_SUITE ? number_from("ISOGI_TEST_SECONDS", 300) : 60;
    crowd c = {(account *)calloc(tasks, sizeof(account)), tasks / 8 + 1, wall_seconds() + seconds};
    const double begun = wall_seconds();
    account sum = {0};
    isogi_parallel(NULL, tasks, task, &c, 0, 1);
    for (size_t i = 0; i < tasks; i++) {
        const account *a = &c.task[i];
        sum.rays += a->rays, sum.hits += a->hits, sum.wide += a->wide, sum.undecided += a->undecided, sum.wrong += a->wrong,
            sum.misplaced += a->misplaced;
        if (a->first[0] && !sum.first[0]) memcpy(sum.first, a->first, sizeof sum.first);
    }
    free(c.task);
    printf("    %ld rays of %.0f in %.0f s\n", sum.rays, wanted, wall_seconds() - begun);
    return sum;
}

/* The cheap reference itself, against the plain one of reference_ray.h. */
TEST(the_cheap_reference_agrees_with_the_plain_one) {
    test_random r = {5};
    long differs = 0, decided = 0, rays = 0;
    for (int i = 0; i < 60; i++) {
        isogi_pyramid *pyramid = NULL;
        scene s = crowd_scene(i % KINDS, 0, 1, &pyramid, &r);
        const reference_field field = {s.value, {s.size[0], s.size[1], s.size[2]}, 1e-12L};
        for (int k = 0; k < 200; k++) {
            isogi_ray ray = {.isovalue = crowd_isovalue(&s, i % KINDS, &r)};
            double d[3], dir[3];
            random_direction(&r, d);
            for (int x = 0; x < 3; x++) {
                ray.dir[x] = (float)d[x], dir[x] = (double)ray.dir[x];
                ray.origin[x] = random_range(&r, 0, s.size[x] - 1) - (k & 1 ? 30 * dir[x] : 0);
            }
            const quick_truth quick = crowd_truth(&s, &ray, 64 * rounding(&s, &ray));
            const reference_hit plain = reference_intersect(&field, ray.origin, dir, 0, 0, ray.isovalue);
            rays++, decided += quick.decided && plain.decided;
            differs += quick.decided && plain.decided && quick.side != plain.side;
        }
        isogi_vol_free(pyramid);
        free(s.value), free(s.raw);
    }
    CHECK(differs == 0 && decided * 10 > rays * 8, "%ld of %ld differ, %ld decided", differs, rays, decided);
}

TEST(very_many_rays_hit_like_the_reference) {
    const account sum = crowd_run(compare_task, 150000, 1e8, 12.0 * SOME);
    printf("    %ld hits, %ld looked at in %d bits, %ld undecided\n", sum.hits, sum.wide, WIDE_BITS, sum.undecided);
    CHECK(sum.wrong == 0 && sum.misplaced == 0, "%ld wrong, %ld misplaced; %s", sum.wrong, sum.misplaced, sum.first);
    CHECK((WIDE_BITS == 113 ? !sum.undecided : sum.undecided * 50 < sum.rays) && sum.hits * 4 > sum.rays &&
              sum.rays > (LONG_SUITE && !getenv("ISOGI_TEST_RAYS") ? 10000000 : 100000),
          "%ld undecided, %ld hits of %ld rays", sum.undecided, sum.hits, sum.rays);
}

TEST(nothing_escapes_from_very_many_closed_surfaces) {
    const account sum = crowd_run(escape_task, 1e7, 1e9, 48 * 1.45 * SOME);
    CHECK(sum.wrong == 0, "%ld escaped; %s", sum.wrong, sum.first);
    CHECK(sum.rays > (!LONG_SUITE ? 2000000 : getenv("ISOGI_TEST_RAYS") ? 30000 : 100000000), "%ld rays", sum.rays);
}

TEST_MAIN("vol_many")
