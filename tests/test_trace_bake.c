/* Tests of how isogi_trace.h bakes by default: light at hits from probes, samples in blocks, errors, stepping. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "procedural.h"
#include "test.h"
#include "trace_scenes.h"

static isogi_trace_desc feedback(const scene *s, float albedo, int bounces, int samples) {
    isogi_trace_desc d = desc_make(s, albedo, bounces, samples);
    d.method = ISOGI_TRACE_FEEDBACK;
    return d;
}

/* ---- closed forms -------------------------------------------------------------------------------------------------------- */

/* White surfaces under a white sky vanish: E = D + A E has the solution pi whatever the hits. The passes end when the largest change is
   below 1e-4; cavities that let a tenth of the light out leave ten times that. */
TEST(white_furnace) {
    double q_ball[4] = {15.5, 15.5, 15.5, 9.3}, q_torus[5] = {15.5, 15.5, 15.5, 9, 4}, q_gyroid[1] = {0.35},
           q_pit[5] = {16, 15, 16, 22.3, 12};
    field *f[6] = {ball, torus, gyroid, pit, rough_pit, rough_ball};
    const double *q[6] = {q_ball, q_torus, q_gyroid, q_pit, q_pit, q_ball};
    const char *name[6] = {"ball", "torus", "gyroid", "pit", "rough pit", "rough ball"};
    for (int i = 0; i < 6; i++) {
        scene s = scene_make(32, 32, 32, NULL, f[i], q[i]);
        isogi_trace_desc d = feedback(&s, 1, -1, 20);
        double mean = 0;
        float points[64][3], e[64][3];
        double worst = 0;
        const int wanted = LONG_SUITE ? 64 : 24, n = surface_points(&s, 0, wanted, 2, points);
        d.lazy = 1;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
        for (int k = 0; k < n; k++) worst = fmax(worst, fabs((double)e[k][1] - PI)), mean += (double)e[k][1] / n;
        double expected = PI;
        if (i >= 4) { /* noise makes pockets, closed on the isosurfaces of some texels, and dark: as by paths that are as good as endless */
            expected = 0, d.method = ISOGI_TRACE_PATHS, d.bounces = 200, d.samples = 64;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
            for (int k = 0; k < n; k++) expected += (double)e[k][1] / n;
        }
        CHECK(n == wanted && (worst < 0.005 * PI || i >= 4), "%s: largest deviation of E from pi %g", name[i], worst);
        CHECK(fabs(mean - expected) < (i < 4 ? 0.002 : 0.02) * PI, "%s: mean %g, expected %g", name[i], mean, expected);
        scene_free(&s);
    }
}

/* With one sample a texel, too: probes of one sample alone are rooms without a way out where they meet one another. */
TEST(white_furnace_of_one_sample) {
    double q_gyroid[1] = {0.35}, q_pit[5] = {16, 15, 16, 22.3, 12};
    for (int i = 0; i < 2; i++) {
        scene s = scene_make(32, 32, 32, NULL, i ? pit : gyroid, i ? q_pit : q_gyroid);
        isogi_trace_desc d = feedback(&s, 1, -1, 1);
        float points[64][3], e[64][3];
        double worst = 0, mean = 0;
        const int n = surface_points(&s, 0, 64, 2, points);
        d.lazy = 1;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
        for (int k = 0; k < n; k++) worst = fmax(worst, fabs((double)e[k][1] - PI)), mean += (double)e[k][1] / n;
        printf("    %s: largest deviation %.4f pi, mean %.4f pi\n", i ? "pit" : "gyroid", worst / PI, mean / PI);
        CHECK(n == 64 && worst < 0.005 * PI && fabs(mean - PI) < 0.002 * PI, "largest deviation of E from pi %g, mean %g", worst, mean);
        scene_free(&s);
    }
}

/* E = pi F / (1 - R (1 - F)) in a cavity whose opening is the share F of its sphere; F from the run without reflections. Both methods:
   the noise of 64 samples, averaged over 200 points, is below 1 %; probes of 2 voxels in a cavity of radius 26 add less than that. */
TEST(cavity_with_opening_follows_its_closed_form) {
    int n = 64, count = LONG_SUITE ? 200 : 60;
    double r = 0.4 * n, c = n / 2.0, q[5] = {c, 0.75 * n, c, 0.75 * n, r};
    scene s = scene_make(n, n, n, NULL, pit, q);
    static float points[200][3], e[200][3];
    pit_points(&s, q, count, points);
    for (int method = 0; method < 1 + LONG_SUITE; method++) {
        isogi_trace_desc d = desc_make(&s, 0, -1, LONG_SUITE ? 64 : 20);
        double opening = 0;
        d.method = (isogi_trace_method)method, d.lazy = 1;
        for (int i = 0; i < 4; i++) {
            const double albedo[4] = {0, 0.2, 0.5, 0.9};
            double mean = 0, expected;
            d.albedo[0] = d.albedo[1] = d.albedo[2] = (float)albedo[i];
            bake_and_sample(&d, NULL, (const float(*)[3])points, count, e);
            for (int k = 0; k < count; k++) mean += (double)e[k][1] / count;
            if (!i) opening = mean / PI;
            expected = PI * opening / (1 - albedo[i] * (1 - opening));
            CHECK(fabs(mean - expected) < 0.02 * expected, "method %d, R %g: E %.4f, expected %.4f", method, albedo[i], mean, expected);
            if (!i) CHECK(fabs(opening - 0.5) < 0.03 * 0.5, "F %.4f, one half expected", opening);
        }
    }
    scene_free(&s);
}

/* Sky minus what the sphere hides, along a profile of 32 points: pi (1 - (r/d)^2 cos t). 1024 samples: standard error 0.5 % at most;
   four of these. Lookups read texels up to half a voxel above and below the plane: their planes are as flat. */
TEST(profile_of_a_plane_below_a_black_sphere) {
    double q[5] = {32, 30, 32, 8, 12};
    scene s = scene_make(64, 64, 64, NULL, ball_over_plane, q);
    float point[32][3], e[2][32][3];
    for (int i = 0; i < 32; i++) point[i][0] = (float)(32 + 0.87 * i), point[i][1] = 12, point[i][2] = (float)(32 - 0.31 * i);
    for (int method = 0; method < 2; method++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 1024);
        d.method = (isogi_trace_method)method, d.lazy = 1;
        bake_and_sample(&d, NULL, (const float(*)[3])point, 32, e[method]);
        for (int i = 0; i < 32; i++) {
            double h = 18, distance = length3((double)point[i][0] - 32, h, (double)point[i][2] - 32);
            double expected = PI * (1 - 64 / (distance * distance) * h / distance);
            CHECK(fabs((double)e[method][i][0] - expected) < 0.02 * expected, "method %d, at %d: E %.4f, expected %.4f", method, i,
                  (double)e[method][i][0], expected);
        }
    }
    scene_free(&s);
}

/* a box in a box: half its width q[3] inside, q[4] outside */
static double hollow_box(const double p[3], const double *q) {
    double r = fmax(fmax(fabs(p[0] - q[0]), fabs(p[1] - q[1])), fabs(p[2] - q[2]));
    return fmin(r - q[3], q[4] - r);
}

/* A closed cavity whose walls glow, a ball and a box: E = pi L / (1 - R), the same everywhere, for every number of reflections as the
   geometric sum. Nothing of it depends on the shape; in the box's corners paths begin a fraction of a voxel from three walls. */
TEST(closed_glowing_cavity_follows_its_closed_form) {
    double q[5] = {15.5, 15.5, 15.5, 8.3, 13};
    isogi_albedo_point glow[1] = {{0, {0.5f, 1, 2}}};
    for (int shape = 0; shape < 2; shape++) {
        scene s = scene_make(32, 32, 32, NULL, shape ? hollow_box : shell, q);
        float points[50][3], e[50][3];
        points_seen_from(&s, 15.5, 4, 50, points);
        for (int bounces = -1; bounces < 3; bounces++) {
            isogi_trace_desc d = feedback(&s, 0.6f, bounces, 16);
            double expected = PI / (1 - 0.6), worst = 0;
            if (bounces >= 0) expected *= 1 - pow(0.6, bounces + 1);
            d.lazy = 1, d.emission_points = glow, d.emission_count = 1, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0;
            bake_and_sample(&d, NULL, (const float(*)[3])points, 50, e);
            for (int i = 0; i < 50; i++) worst = fmax(worst, fabs((double)e[i][1] - expected));
            CHECK(worst < 1e-3 * expected, "shape %d, %d reflections: E %.5f, expected %.5f, largest deviation %g", shape, bounces,
                  (double)e[0][1], expected, worst);
        }
        scene_free(&s);
    }
}

/* The report still knows of the probes when they are gone, with the groups of texels that they were made for. */
TEST(probes_are_counted) {
    double q[1] = {0.35};
    scene s = scene_make(24, 24, 24, NULL, gyroid, q);
    for (int lazy = 0; lazy < 2; lazy++) {
        isogi_trace_desc d = feedback(&s, 0.5f, 2, 4);
        isogi_trace *t = NULL;
        double remaining = 1;
        uint64_t most = 0;
        float points[50][3];
        int n = surface_points(&s, 0, 50, 3, points);
        d.lazy = lazy;
        if (isogi_trace_create(&t, &d, NULL) != ISOGI_OK) abort();
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        while (remaining > 0 && isogi_trace_step(t, 3000, &remaining) == ISOGI_OK) {
            isogi_trace_report report;
            isogi_trace_status(t, &report);
            CHECK(report.probes >= most, "lazy %d: %d probes after %d", lazy, (int)report.probes, (int)most);
            most = report.probes;
        }
        CHECK(most > 100, "lazy %d: %d probes", lazy, (int)most);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Albedo 1 in a closed cavity with a light inside: true light is infinite. It ends, and says so; an open one is not accused, nor is one
   that loses a 1400th at each reflection, whose steps fall by less than a third in 500 passes. */
TEST(endless_light_is_reported) {
    double q[5] = {15.5, 15.5, 15.5, 8, 13}, open[5] = {16, 15, 16, 22.3, 12};
    isogi_albedo_point glow[1] = {{0, {1, 1, 1}}};
    const float albedo[4] = {1, 0.99f, 1, 0.9993f};
    for (int variant = 0; variant < (LONG_SUITE ? 4 : 3); variant++) {
        scene s = scene_make(32, 32, 32, NULL, variant == 2 ? pit : shell, variant == 2 ? open : q);
        isogi_trace_desc d = feedback(&s, albedo[variant], -1, 8);
        isogi_trace *t = NULL;
        isogi_trace_report report;
        float point[1][3] = {{7.6f, 15.5f, 15.5f}}, e[1][3], error[1];
        if (variant != 2) d.emission_points = glow, d.emission_count = 1, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0;
        if (variant == 2) point[0][0] = 16, point[0][1] = 3.1f, point[0][2] = 16;
        d.lazy = 1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])point, 1) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK,
              "variant %d", variant);
        isogi_trace_sample(t, (const float(*)[3])point, 1, e, error);
        isogi_trace_status(t, &report);
        CHECK(report.diverges == (variant == 0), "variant %d: diverges %d, E %g", variant, report.diverges, (double)e[0][1]);
        CHECK((error[0] > 1e30f) == (variant == 0) && e[0][1] > 0 && e[0][1] < 1e30f, "variant %d: E %g, error %g", variant,
              (double)e[0][1], (double)error[0]);
        if (variant & 1)
            CHECK(fabs((double)e[0][1] * (1 - (double)albedo[variant]) - PI) < 0.02 * PI, "R %g: E %g", (double)albedo[variant],
                  (double)e[0][1]);
        isogi_trace_free(t), t = NULL;
        if (variant == 3) { /* as variant 1, in longer time */
            scene_free(&s);
            continue;
        }
        d.lazy = 0, d.lattice[0] = ISOGI_TRACE_CUBE + 6, d.lattice[1] = d.lattice[2] = 8; /* the last cube lies outside the shell */
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "variant %d", variant);
        isogi_trace_status(t, &report);
        CHECK(variant == 2 || report.diverges == (variant == 0), "variant %d: diverges %d in two cubes", variant, report.diverges);
        isogi_trace_free(t), scene_free(&s);
    }
}

/* A context whose allocations fail once: the last of so many. */
typedef struct nth_failure { int left; } nth_failure;
static void *nth_alloc(void *user, size_t size, size_t align) {
    void *p = NULL;
    if (--((nth_failure *)user)->left == 0) return NULL;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void nth_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

/* A hollow in matter with a narrow way out. q: centre, radius, radius of the way along z */
static double bottle(const double p[3], const double *q) {
    double ball = length3(p[0] - q[0], p[1] - q[1], p[2] - q[2]) - q[3], tube = length3(p[0] - q[0], p[1] - q[1], 0) - q[4];
    tube = p[2] > q[2] ? tube : ball;
    return ball < tube ? ball : tube;
}

static void white(void *user, double isovalue, const double p[3], float albedo[3], float emission[3]) {
    (void)user, (void)isovalue, (void)p, (void)emission;
    for (int c = 0; c < 3; c++) albedo[c] *= 2;
}

/* A white bottle lets one part in thousands of its light out at each reflection. Passes alone would take tens of thousands, and called it
   endless light. However colours are given, in transfer, too: E = pi all over its inside. */
TEST(light_finds_its_way_through_narrow_necks) {
    double q[5] = {15.5, 15.5, 14, 12, 1.6};
    scene s = scene_make(32, 32, 40, NULL, bottle, q);
    float points[24][3], e[24][3];
    const int n = surface_points(&s, 0, 24, 2, points);
    for (int variant = 0; variant < 4; variant++) {
        isogi_trace_desc d = feedback(&s, 1, -1, 8);
        double worst = 0;
        d.lazy = 1, d.storage = ISOGI_TRACE_FLOAT;
        if (variant == 1 || variant == 2) d.mode = ISOGI_TRACE_TRANSFER, d.order = 2, d.transfer_channels = 2 * variant - 1;
        if (variant == 3) d.material = white, d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.5f;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
        for (int k = 0; k < n; k++)
            for (int c = 0; c < 3; c++) worst = fmax(worst, fabs((double)e[k][c] - PI));
        CHECK(n == 24 && worst < 0.005 * PI, "variant %d: largest deviation of E from pi %g", variant, worst);
    }
    scene_free(&s);
}

/* A groove of the engine block so small that a texel's rays meet but two or three probes, nine in ten of whose rays meet each other: its
   light is theirs. With 8 samples at most they saw no way out in two of three bakes, and it stayed dark, .1 of the sky, however many
   samples the texel had. White it has E = pi; with albedo .9 paths bring 1.578 (8192 samples, +-.016), with .7 .784 (+-.013). */
SLOW_TEST(pockets_with_few_probes_have_their_light) {
    static const double expected[3] = {PI, 1.578, 0.784}, albedo[3] = {1, 0.9, 0.7};
    const float point[1][3] = {{119, 113, 75}};
    const int seeds = 12;
    const procedural_shape *shape = procedural_find("engine-block");
    isogi_volume volume = {0};
    isogi_pyramid *pyramid = NULL;
    CHECK(procedural_make(shape, 0, &volume, NULL) == ISOGI_OK, "engine block");
    volume.spacing[0] = volume.spacing[1] = volume.spacing[2] = 1;
    CHECK(isogi_vol_build(&pyramid, &volume, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 3; k++) {
        double mean = 0, least = 1e30;
        for (int seed = 0; seed < seeds; seed++) {
            float e[1][3];
            isogi_trace_desc d = {.pyramid = pyramid, .bounces = -1, .samples = 64, .lazy = 1, .lookup = ISOGI_TRACE_NEAREST,
                                  .seed = (uint64_t)seed};
            for (int c = 0; c < 3; c++) d.albedo[c] = (float)albedo[k];
            d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1;
            bake_and_sample(&d, NULL, point, 1, e);
            mean += (double)e[0][1] / seeds, least = fmin(least, (double)e[0][1]);
        }
        printf("    albedo %g: mean %.4f of %.4f, the least %.4f\n", albedo[k], mean, expected[k], least);
        CHECK(least > 0.6 * expected[k] && fabs(mean - expected[k]) < (k ? 0.1 : 0.005) * expected[k],
              "albedo %g: mean %g, not %g; the least %g", albedo[k], mean, expected[k], least);
    }
    isogi_vol_free(pyramid), procedural_free(&volume);
}

/* Light that fades slowly is worked out in another way than by passes, which a number of bounces asks for: that many reflections each, all
   that matter here. Each colour by itself, and by passes again where there is no memory for it. */
SLOW_TEST(light_that_fades_slowly_is_that_of_many_passes) {
    double q[5] = {15.5, 15.5, 14, 12, 2.5};
    scene s = scene_make(32, 32, 40, NULL, bottle, q);
    float points[24][3], passes[24][3], e[24][3];
    const int n = surface_points(&s, 0, 24, 2, points);
    int failed = 1, without = 0;
    isogi_trace_desc d = feedback(&s, 1, 5000, 8);
    d.lazy = 1, d.storage = ISOGI_TRACE_FLOAT, d.albedo[0] = 0.995f, d.albedo[1] = 0.6f, d.albedo[2] = 0.98f;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, passes);
    d.bounces = -1;
    for (int which = 1; failed; which++) { /* the block of memory that there is none for */
        nth_failure failure = {which};
        isogi_context context = {.threads = 1, .alloc = nth_alloc, .release = nth_release, .user = &failure};
        isogi_trace *t = NULL;
        int done = isogi_trace_create(&t, &d, &context) == ISOGI_OK &&
                   isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK;
        failed = failure.left <= 0;
        if (done) isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
        without += done && failed;
        for (int k = 0; k < n && done; k++)
            for (int c = 0; c < 3; c++)
                CHECK(fabs((double)e[k][c] - (double)passes[k][c]) < 2e-3 * PI, "%d, point %d, channel %d: E %.5f, by passes %.5f", which,
                      k, c, (double)e[k][c], (double)passes[k][c]);
        CHECK(done || failed, "%d", which);
        isogi_trace_free(t);
    }
    printf("    E %.4f %.4f %.4f pi; done without a block of memory: %d\n", (double)e[0][0] / PI, (double)e[0][1] / PI,
           (double)e[0][2] / PI, without);
    CHECK(without == 1, "%d bakes done without a block of memory", without);
    scene_free(&s);
}

/* What a context was asked for: tasks, blocks of memory taken and given back; of those taken, how many are as large as those in which
   nodes lie, and bytes of the largest other. */
typedef struct demand { size_t tasks, blocks, slabs, largest; } demand;
enum { SLAB = 8 << 20 };

static void count_tasks(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg) {
    ((demand *)user)->tasks += n;
    for (size_t i = 0; i < n; i++) task(arg, i);
}
static void *count_alloc(void *user, size_t size, size_t align) {
    demand *d = (demand *)user;
    void *p = NULL;
    d->blocks++;
    if (size == SLAB) d->slabs++;
    else if (size > d->largest) d->largest = size;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void count_release(void *user, void *p, size_t size) { (void)size, ((demand *)user)->blocks++, free(p); }

/* What carries light over to the texels traces no rays, but counts as much: no step does more than its budget's share of it. A task is
   256 nodes or a batch of hits; with 500 rays a step runs 4 tasks that publish, 16 that look at nodes, or as many that trace; a step
   without a limit runs over a thousand. Nor does a step make or give back all that there is, or move it into a larger place: memory comes
   and goes in few blocks, far below the 2879 that all nodes at once take; a large one, for nodes that are still to come, is taken for
   texels or for probes, and nothing is moved into it. The light is the same bits as in one step. */
SLOW_TEST(steps_stay_near_their_budget) {
    double q[5] = {31.5, 30, 31.5, 36.2, 24};
    scene s = scene_make(64, 64, 64, NULL, pit, q);
    static float points[300][3], e[2][300][3];
    size_t one_side = 0;
    int n = surface_points(&s, 0, 300, 5, points);
    for (int sides = QUICK_SUITE; sides < 2; sides++) { /* what one side spends the other does not have */
        isogi_trace_desc d = feedback(&s, 0.7f, -1, 4);
        size_t most = 0, whole = 0, steps = 0, blocks = 0, slabs = 0, largest = 0;
        demand asked = {0};
        d.isovalue_min = -0.3, d.isovalue_max = 0.3;
        d.sides = sides ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        for (int sliced = 0; sliced < 2; sliced++) {
            isogi_context counting = {.parallel_for = count_tasks, .alloc = count_alloc, .release = count_release, .user = &asked};
            isogi_trace *t = NULL;
            isogi_counters counters = {0};
            double remaining = 1;
            uint64_t rays = 0;
            CHECK(isogi_trace_create(&t, &d, &counting) == ISOGI_OK, "create");
            for (whole = 0; remaining > 0; steps++) {
                memset(&asked, 0, sizeof asked);
                CHECK(isogi_trace_step(t, sliced ? 500 : 0, &remaining) == ISOGI_OK, "step");
                memset(&counters, 0, sizeof counters), isogi_trace_counters(t, &counters);
                if (sliced) CHECK(counters.rays - rays < 1000, "%llu rays", (unsigned long long)(counters.rays - rays));
                if (sliced && asked.tasks > most) most = asked.tasks;
                if (sliced && asked.blocks > blocks) blocks = asked.blocks;
                if (sliced && asked.slabs > slabs) slabs = asked.slabs;
                if (sliced && asked.largest > largest) largest = asked.largest;
                whole += asked.tasks, rays = counters.rays;
            }
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[sliced], NULL);
            isogi_trace_free(t);
        }
        printf("    %zu steps, at most %zu tasks in one of them, %zu in all; %zu blocks of memory, %zu bytes\n", steps, most, whole, blocks,
               largest);
        CHECK(blocks < 1000 && largest < 1000000, "%zu blocks of memory, of up to %zu bytes, in a step", blocks, largest);
        CHECK(slabs >= 1 && slabs <= 2, "%zu large blocks in a step", slabs);
        CHECK(most <= 30 && steps > 100, "%zu tasks, %zu steps", most, steps);
        CHECK(!sides || QUICK_SUITE || most <= one_side + 2, "%zu tasks on both sides, %zu on one", most, one_side);
        one_side = most;
        CHECK(!memcmp(e[0], e[1], (size_t)n * sizeof e[0][0]), "other light in slices");
    }
    scene_free(&s);
}

/* ---- against paths ------------------------------------------------------------------------------------------------------- */

/* Where a sun throws shadows cells of probes are as small as the number of samples asks for, down to a voxel; the sky alone needs no
   smaller ones, nor do few samples, nor where a target ends the bake of a texel. What it brings: the error on engine-block with 16 and more
   samples (bench_trace). */
SLOW_TEST(probes_lie_closer_where_lights_throw_shadows) {
    double q[5] = {24, 22, 24, 26, 16}, probes[2][3];
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 1, 0.2, 3, 0.01);
    static float points[300][3];
    int n = surface_points(&s, 0, 300, 7, points);
    for (int lit = 0; lit < 2; lit++)
        for (int way = 0; way < 3; way++) {
            isogi_trace_desc d = feedback(&s, 0.5f, -1, way ? 64 : 8);
            isogi_trace *t = NULL;
            isogi_trace_report report;
            d.lazy = 1, d.error = way == 2 ? 1e-9f : 0, d.lighting.lights = &sun, d.lighting.light_count = (size_t)lit;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "lit %d", lit);
            CHECK(isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK,
                  "lit %d", lit);
            isogi_trace_status(t, &report);
            probes[lit][way] = (double)report.probes;
            isogi_trace_free(t);
        }
    printf("    probes of 8 samples, of 64, to a target: %.0f, %.0f, %.0f; where a sun shines %.0f, %.0f, %.0f\n", probes[0][0],
           probes[0][1], probes[0][2], probes[1][0], probes[1][1], probes[1][2]);
    CHECK(fabs(probes[0][0] - probes[1][0]) < 0.01 * probes[0][0] && fabs(probes[0][2] - probes[1][2]) < 0.01 * probes[0][2],
          "%.0f, %.0f and %.0f, %.0f", probes[0][0], probes[0][2], probes[1][0], probes[1][2]);
    CHECK(probes[1][1] > 1.2 * probes[0][1] && probes[1][1] < 2 * probes[0][1], "%.0f and %.0f", probes[0][1], probes[1][1]);
    scene_free(&s);
}

/* A hit is worth one path that goes on: probes do not fill a closed room for the light of one place in it. With two
   samples each they did, 2600 here. */
TEST(probes_do_not_breed) {
    double q[5] = {31.5, 31.5, 31.5, 24, 29};
    scene s = scene_make(64, 64, 64, NULL, rough_shell, q);
    isogi_trace_desc d = feedback(&s, 0.6f, -1, 16);
    isogi_trace *t = NULL;
    isogi_trace_report report = {0};
    float point[1][3] = {{7.6f, 31.5f, 31.5f}};
    d.lazy = 1;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])point, 1) == ISOGI_OK &&
              isogi_trace_step(t, 0, NULL) == ISOGI_OK,
          "bake");
    isogi_trace_status(t, &report);
    printf("    %llu texels, %llu probes\n", (unsigned long long)report.texels, (unsigned long long)report.probes);
    CHECK(report.texels > 0 && report.probes < 1000, "%llu probes", (unsigned long long)report.probes);
    isogi_trace_free(t), scene_free(&s);
}

/* The light of bright spots in an image is averaged over neighbours as that of the other sky is: on the sides of a pit, with 4 samples,
   half of the error that paths of 4 samples have, of four runs. */
SLOW_TEST(bright_spots_of_the_sky_are_filtered) {
    enum { WIDTH = 64, HEIGHT = 32, RUNS = 4 };
    static float image[HEIGHT][WIDTH][3], points[200][3], e[200][3], reference[200][3];
    double q[5] = {24, 22, 24, 26, 16}, rms[2] = {0, 0};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    int n = surface_points(&s, 0, 200, 7, points);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int c = 0; c < 3; c++) image[y][x][c] = y > 4 && y < 9 && x % 16 < 4 ? 40.0f : 0.2f;
    for (int run = 0; run <= 2 * RUNS; run++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, run ? 4 : 256);
        d.method = run % 2 ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS, d.lazy = 1, d.seed = (uint64_t)(run + 1) / 2;
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = WIDTH, d.lighting.env.height = HEIGHT;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, run ? e : reference);
        for (int i = 0; run && i < n; i++) rms[run % 2] += pow((double)e[i][1] - (double)reference[i][1], 2) / (n * RUNS);
    }
    printf("    error %.4f, by paths %.4f\n", sqrt(rms[1]), sqrt(rms[0]));
    CHECK(n > 100 && sqrt(rms[1]) < 0.51 * sqrt(rms[0]), "error %.4f, by paths %.4f", sqrt(rms[1]), sqrt(rms[0]));
    scene_free(&s);
}

/* An image with a bright patch on an even sky: mean square of its luminance over the square of its mean. */
static double sky_with_patch(float (*image)[64][3], int height, float bright) {
    double sum[3] = {0, 0, 0};
    for (int y = 0; y < height; y++)
        for (int x = 0; x < 64; x++) {
            const float value = y > height / 8 && y < height / 3 && x > 8 && x < 20 ? bright : 1;
            const double area = cos(PI * y / height) - cos(PI * (y + 1) / height);
            for (int c = 0; c < 3; c++) image[y][x][c] = value;
            sum[0] += area, sum[1] += area * (double)value, sum[2] += area * (double)value * (double)value;
        }
    return sum[2] * sum[0] / (sum[1] * sum[1]);
}

/* Bakes by four seeds, not lazily and lazily, in blocks: the same light. Sums over n points and all seeds: of light, of squares of what it
   differs from the reference by, and of squares of the errors that are told. */
typedef struct bake_sums { double light, square, told; } bake_sums;
enum { BAKE_SEEDS = 4 };
static bake_sums bake_both_ways(isogi_trace_desc d, const float (*points)[3], int n, const float (*reference)[3]) {
    static float e[2][200][3], error[2][200];
    bake_sums sum = {0, 0, 0};
    for (d.seed = 0; d.seed < BAKE_SEEDS; d.seed++) {
        for (d.lazy = 0; d.lazy < 2; d.lazy++) {
            isogi_trace *t = NULL;
            isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, points, (size_t)n), isogi_trace_step(t, 0, NULL);
            isogi_trace_sample(t, points, (size_t)n, e[d.lazy], error[d.lazy]), isogi_trace_free(t);
        }
        for (int i = 0; i < n; i++) {
            const double light = (double)e[0][i][1], apart = light - (double)reference[i][1];
            CHECK(fabs(light - (double)e[1][i][1]) <= 1e-5 * light + 1e-6, "blocks %g, at once %g", (double)e[1][i][1], light);
            sum.light += light, sum.square += apart * apart, sum.told += pow((double)error[0][i], 2);
        }
    }
    return sum;
}

/* The more uneven an image, the more rays does a texel send to its bright parts with each sample: none, 2, 3 (of mean squares above 2) and
   4 (above 3). Those below the horizon are not traced: on a ball, half of all. What is told of their noise is as near to it as under an
   even sky (unfiltered: four times the error, as samples are well spread and a lookup's texels have noise of their own), and six samples
   bring the same in blocks and at once. */
SLOW_TEST(uneven_skies_get_more_rays) {
    enum { HEIGHT = 32 };
    static const float bright[4] = {1.5f, 5, 10, 40};
    static float image[HEIGHT][64][3], points[200][3], reference[200][3];
    double q[5] = {12, 11, 12, 13, 8}, o[4] = {12, 12, 12, 8}, told[4];
    scene s = scene_make(24, 24, 24, NULL, pit, q), round = scene_make(24, 24, 24, NULL, ball, o);
    int n = surface_points(&s, 0, 200, 7, points);
    for (int k = 0; k < 4; k += LONG_SUITE ? 1 : 3) {
        const double uneven = sky_with_patch(image, HEIGHT, bright[k]);
        double rays;
        bake_sums sum;
        isogi_trace_desc d = desc_make(&round, 0, 0, 8);
        isogi_counters counters = {0};
        isogi_trace *t = NULL;
        memset(&d.lighting, 0, sizeof d.lighting), d.method = ISOGI_TRACE_FEEDBACK;
        d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = 64, d.lighting.env.height = HEIGHT;
        isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL), isogi_trace_counters(t, &counters), isogi_trace_free(t);
        rays = (double)counters.rays / (double)counters.texels / 8 - 1; /* about half of the directions are above a texel's horizon */
        CHECK(fabs(rays - (k ? (k + 1) / 2.0 : 0)) < 0.1, "mean square %.2f: %.2f rays to the sky", uneven, rays);
        if (QUICK_SUITE) continue; /* only counted */
        d.pyramid = s.pyramid, d.lazy = 1, d.unfiltered = 1, d.samples = 1024, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, reference);
        d.samples = 6;
        sum = bake_both_ways(d, (const float(*)[3])points, n, (const float(*)[3])reference);
        told[k] = sqrt(sum.told / sum.square);
        printf("    mean square %.2f: %.2f rays to the sky, error %.4f, told %.2f of it\n", uneven, rays,
               sqrt(sum.square / (n * BAKE_SEEDS)), told[k]);
        CHECK(told[k] > 0.75 * told[0] && told[k] < 1.33 * told[0], "mean square %.2f: told %.2f of it", uneven, told[k]);
    }
    scene_free(&s), scene_free(&round);
}

/* Lights that look wide, whose half-shadows are everywhere, get 2 n + 4 rays with n samples of a texel, others (n + 5) / 2: counted on a
   ball, half of which faces the light. What they bring to a pit is that of paths, the same in blocks and at once, and the error that is
   told covers it (three to six times as much). */
SLOW_TEST(wide_lights_get_more_rays) {
    enum { SAMPLES = 8, LIGHTS = 5 };
    const isogi_light lights[LIGHTS] = {light_make(ISOGI_LIGHT_DIRECTIONAL, 0.3, 1, 0.2, 3, 0.03),
                                        light_make(ISOGI_LIGHT_SPHERE, 12, 112, 12, 30000, 4),
                                        light_make(ISOGI_LIGHT_DIRECTIONAL, 0.3, 1, 0.2, 3, 0.2),
                                        light_make(ISOGI_LIGHT_SPHERE, 12, 112, 12, 30000, 20),
                                        {ISOGI_LIGHT_RECTANGLE, {12, 112, 12}, {30000, 30000, 30000}, 0, {{40, 0, 0}, {0, 0, 40}}}};
    static float points[100][3], reference[100][3];
    double q[5] = {12, 11, 12, 13, 8}, o[4] = {12, 12, 12, 8};
    scene s = scene_make(24, 24, 24, NULL, pit, q), round = scene_make(24, 24, 24, NULL, ball, o);
    int n = surface_points(&s, 0, 100, 7, points);
    for (int k = 0; k < LIGHTS; k += LONG_SUITE ? 1 : 2) {
        const double wide = k > 1;
        double rays, expected = 0;
        bake_sums sum;
        isogi_trace_desc d = desc_make(&round, 0, 0, SAMPLES);
        isogi_counters counters = {0};
        isogi_trace *t = NULL;
        memset(&d.lighting, 0, sizeof d.lighting), d.lighting.lights = &lights[k], d.lighting.light_count = 1;
        d.method = ISOGI_TRACE_FEEDBACK;
        isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL), isogi_trace_counters(t, &counters), isogi_trace_free(t);
        rays = (double)counters.rays / (double)counters.texels - SAMPLES;
        CHECK(fabs(rays / (wide ? SAMPLES + 2 : 3) - 1) < 0.15, "light %d: %.2f rays", k, rays);
        if (QUICK_SUITE) continue; /* only counted */
        d.pyramid = s.pyramid, d.method = ISOGI_TRACE_PATHS, d.lazy = 1, d.samples = 1024;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, reference);
        d.method = ISOGI_TRACE_FEEDBACK, d.samples = 6, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
        sum = bake_both_ways(d, (const float(*)[3])points, n, (const float(*)[3])reference);
        for (int i = 0; i < n; i++) expected += BAKE_SEEDS * (double)reference[i][1];
        printf("    light %d: %.2f rays, error %.4f of %.4f, told %.2f of it\n", k, rays, sqrt(sum.square / (n * BAKE_SEEDS)),
               expected / (n * BAKE_SEEDS), sqrt(sum.told / sum.square));
        CHECK(fabs(sum.light - expected) < 0.01 * expected, "light %d: %g, by paths %g", k, sum.light, expected);
        CHECK(sum.told > 2 * sum.square, "light %d: told %.2f of the error", k, sqrt(sum.told / sum.square));
    }
    scene_free(&s), scene_free(&round);
}

/* One or two samples a texel are worth baking: those of the texels around make up for them, on the sides of a pit under a sky that is
   brighter above. The error over that of light which is not filtered, of four runs: .42 of 1 sample, .45 of 2 (where texels do not turn
   a common sequence: .92, .90; by the noise of so few samples: 1, .63). */
TEST(few_samples_are_filtered) {
    enum { RUNS = 4 };
    static const float sky[4][3] = {{3, 3, 3}, {1, 1, 1}, {0, 0, 0}, {0, 0, 0}};
    static float points[200][3], e[200][3], reference[200][3];
    double q[5] = {24, 22, 24, 26, 16};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    int n = surface_points(&s, 0, 200, 7, points);
    for (int samples = 1; samples <= 2; samples++) {
        double rms[2] = {0, 0};
        for (int run = samples > 1; run <= 2 * RUNS; run++) {
            isogi_trace_desc d = desc_make(&s, 0, 0, run ? samples : 256);
            d.method = run ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS, d.unfiltered = run % 2, d.seed = (uint64_t)(run + 1) / 2;
            d.lazy = 1, d.lighting.env.sh = &sky[0][0], d.lighting.env.sh_order = 2;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, run ? e : reference);
            for (int i = 0; run && i < n; i++) rms[run % 2] += pow((double)e[i][1] - (double)reference[i][1], 2) / (n * RUNS);
        }
        printf("    %d: error %.4f, unfiltered %.4f: %.3f\n", samples, sqrt(rms[0]), sqrt(rms[1]), sqrt(rms[0] / rms[1]));
        CHECK(n > 100 && sqrt(rms[0]) < 0.55 * sqrt(rms[1]), "%d: error %.4f, unfiltered %.4f", samples, sqrt(rms[0]), sqrt(rms[1]));
    }
    scene_free(&s);
}

/* A black ball all but touches the ground: what it leaves of the sky falls to nothing within a few voxels. With 16 samples the filter takes
   two fifths of the error by noise. Where it goes by what texels have gathered themselves, which tells light apart by no less than that
   noise, it lets .06 of the light in below the ball; by what its first round has smoothed, half of that. */
SLOW_TEST(soft_shadows_are_not_blurred) {
    enum { SIDE = 24, POINTS = SIDE * SIDE, RUNS = 4 };
    static float points[POINTS][3], e[POINTS][3], reference[POINTS][3];
    double q[5] = {24, 21, 24, 8, 12}, rms[2] = {0, 0}, leak[2] = {0, 0};
    scene s = scene_make(48, 48, 48, NULL, ball_over_plane, q);
    for (int i = 0; i < POINTS; i++) points[i][0] = 12.5f + (float)(i % SIDE), points[i][1] = 12, points[i][2] = 12.5f + (float)(i / SIDE);
    for (int run = 0; run <= 2 * RUNS; run++) {
        isogi_trace_desc d = feedback(&s, 0, 0, run ? 16 : 2048);
        d.lazy = 1, d.unfiltered = run % 2, d.seed = (uint64_t)(run + 1) / 2;
        if (!run) d.method = ISOGI_TRACE_PATHS;
        bake_and_sample(&d, NULL, (const float(*)[3])points, POINTS, run ? e : reference);
        for (int i = 0; i < POINTS && run; i++) {
            const double off = ((double)e[i][1] - (double)reference[i][1]) / PI;
            rms[run % 2] += off * off / (POINTS * RUNS);
            if (length3((double)points[i][0] - q[0], 0, (double)points[i][2] - q[2]) < 2) leak[run % 2] += off / (12 * RUNS);
        }
    }
    printf("    error %.4f, unfiltered %.4f; leak %.4f, %.4f\n", sqrt(rms[0]), sqrt(rms[1]), leak[0], leak[1]);
    CHECK(sqrt(rms[0]) < 0.61 * sqrt(rms[1]) && fabs(leak[0]) < 0.045, "error %.4f, unfiltered %.4f, leak %.4f", sqrt(rms[0]), sqrt(rms[1]),
          leak[0]);
    scene_free(&s);
}

/* Coefficients of grey transfer, order 5. */
enum { SERIES = 25 };
static void bake_series(isogi_trace_desc d, const float (*points)[3], int n, float (*series)[SERIES]) {
    isogi_trace *t = NULL;
    d.mode = ISOGI_TRACE_TRANSFER, d.order = 5;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, points, (size_t)n) == ISOGI_OK &&
              isogi_trace_step(t, 0, NULL) == ISOGI_OK && isogi_trace_sample_transfer(t, points, (size_t)n, &series[0][0]) == ISOGI_OK,
          "bake");
    isogi_trace_free(t);
}

static double series_error(const float (*series)[SERIES], const float (*reference)[SERIES], int n) {
    double sum = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < SERIES; k++) sum += pow((double)series[i][k] - (double)reference[i][k], 2) / n;
    return sqrt(sum);
}

/* In a pit, the error of all coefficients over that of transfer that is not filtered: of a few samples, whose directions tell little of
   high bands, a sixth is left, of 16 a fifth, of 64 two fifths. */
SLOW_TEST(transfer_is_filtered) {
    enum { POINTS = 200 };
    const int runs = LONG_SUITE ? 4 : 1;
    static float points[POINTS][3], e[POINTS][SERIES], reference[POINTS][SERIES];
    double q[5] = {24, 22, 24, 26, 16};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    int n = surface_points(&s, 0, POINTS, 7, points);
    isogi_trace_desc d = desc_make(&s, 0.6f, -1, LONG_SUITE ? 1024 : 512);
    d.lazy = 1;
    bake_series(d, (const float(*)[3])points, n, reference);
    d.method = ISOGI_TRACE_FEEDBACK, d.lazy = 0, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
    for (d.samples = 4; d.samples <= (LONG_SUITE ? 64 : 16); d.samples *= 4) {
        double square[2] = {0, 0};
        for (int run = 0; run < 2 * runs; run++) {
            d.unfiltered = run % 2, d.seed = (uint64_t)(run / 2 + 1);
            bake_series(d, (const float(*)[3])points, n, e);
            square[run % 2] += pow(series_error((const float(*)[SERIES])e, (const float(*)[SERIES])reference, n), 2) / runs;
        }
        printf("    %d samples: error %.4f, unfiltered %.4f: %.3f\n", d.samples, sqrt(square[0]), sqrt(square[1]),
               sqrt(square[0] / square[1]));
        CHECK(n > 100 && sqrt(square[0]) < (d.samples > 16 ? 0.45 : 0.25) * sqrt(square[1]), "%d samples: error %.4f, unfiltered %.4f",
              d.samples, sqrt(square[0]), sqrt(square[1]));
    }
    scene_free(&s);
}

/* So it is with one sample, of which no noise is known, and of any order: what an even sky brings to a pit. */
SLOW_TEST(few_samples_of_transfer_are_filtered) {
    enum { POINTS = 200 };
    static float points[POINTS][3], e[POINTS][3], reference[POINTS][3];
    double q[5] = {24, 22, 24, 26, 16};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    int n = surface_points(&s, 0, POINTS, 7, points);
    isogi_trace_desc d = desc_make(&s, 0, 0, LONG_SUITE ? 1024 : 512);
    d.lazy = 1;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, reference);
    d.method = ISOGI_TRACE_FEEDBACK, d.mode = ISOGI_TRACE_TRANSFER, d.lazy = 0, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
    for (d.order = 1; d.order <= 5; d.order += d.order)
        for (d.samples = 1; d.samples <= 4; d.samples *= 2) {
            double square[2] = {0, 0};
            for (d.unfiltered = 0; d.unfiltered < 2; d.unfiltered++) {
                bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
                for (int i = 0; i < n; i++) square[d.unfiltered] += pow((double)e[i][1] - (double)reference[i][1], 2) / n;
            }
            printf("    order %d, %d samples: error %.4f, unfiltered %.4f: %.3f\n", d.order, d.samples, sqrt(square[0]), sqrt(square[1]),
                   sqrt(square[0] / square[1]));
            CHECK(n > 100 && sqrt(square[0]) < 0.6 * sqrt(square[1]), "order %d, %d samples: error %.4f, unfiltered %.4f", d.order,
                  d.samples, sqrt(square[0]), sqrt(square[1]));
        }
    scene_free(&s);
}

static double wall_on_ground(const double p[3], const double *q) {
    double wall = q[1] - fabs(p[0] - q[2]), top = q[3] - p[1], plane = q[0] - p[1];
    wall = wall < top ? wall : top;
    return wall > plane ? wall : plane;
}

/* On both sides of a thin wall as much of the sky is seen, but the other half of it. The ground there faces the same way and is three
   texels apart. Were that shared which brings as much light from anywhere, a twentieth of what comes from one side would be the other's. */
TEST(transfer_is_not_shared_across_walls) {
    enum { SIDE = 12, POINTS = 2 * SIDE, RUNS = 4 };
    static float points[POINTS][3], e[POINTS][SERIES], reference[POINTS][SERIES];
    double q[4] = {8, 0.6, 16, 24}, square[2] = {0, 0}, toward[2] = {0, 0};
    scene s = scene_make(33, 33, 33, NULL, wall_on_ground, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, 2048);
    d.lazy = 1;
    for (int i = 0; i < POINTS; i++) points[i][0] = i % 2 ? 17.5f : 14.5f, points[i][1] = 8, points[i][2] = 10.5f + (float)(i / 2);
    bake_series(d, (const float(*)[3])points, POINTS, reference);
    d.method = ISOGI_TRACE_FEEDBACK, d.samples = 16;
    for (int run = 0; run < 2 * RUNS; run++) {
        d.unfiltered = run % 2, d.seed = (uint64_t)(run / 2 + 1);
        bake_series(d, (const float(*)[3])points, POINTS, e);
        square[run % 2] += pow(series_error((const float(*)[SERIES])e, (const float(*)[SERIES])reference, POINTS), 2) / RUNS;
        for (int i = 0; i < POINTS; i++) toward[run % 2] += (double)e[i][3] / (double)reference[i][3] / (POINTS * RUNS);
    }
    printf("    error %.4f, unfiltered %.4f; from the side: %.3f, %.3f of the light\n", sqrt(square[0]), sqrt(square[1]), toward[0],
           toward[1]);
    CHECK(sqrt(square[0]) < 0.75 * sqrt(square[1]) && fabs(toward[0] - 1) < 0.03, "error %.4f, unfiltered %.4f; from the side %.3f",
          sqrt(square[0]), sqrt(square[1]), toward[0]);
    scene_free(&s);
}

static double bars_over_ground(const double p[3], const double *q) {
    double bar = q[2] - fmax(fabs(fmod(p[0], q[1]) - q[1] / 2), fabs(p[1] - q[3])), plane = q[0] - p[1];
    return bar > plane ? bar : plane;
}

/* Below bars what is seen of the sky changes from texel to texel, and first of all in bands that the filter does not compare. With many
   samples what is shared there is left out again: were it not, the error would be more than twice that of transfer that is not filtered.
   What is told of it, under a sun, covers it. */
SLOW_TEST(fine_detail_of_transfer_is_kept) {
    enum { POINTS = 300 };
    static float points[POINTS][3], e[POINTS][3], error[POINTS], reference[POINTS][3];
    const isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0.5, 0.8, 0.3, 3, 0);
    double q[4] = {6, 8, 1.2, 12}, square[3] = {0, 0, 0};
    scene s = scene_make(32, 24, 24, NULL, bars_over_ground, q);
    int n = surface_points(&s, 0, POINTS, 7, points), covered = 0;
    for (int run = 0; run < 3; run++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, run ? 256 : LONG_SUITE ? 2048 : 1024);
        isogi_trace *t = NULL;
        d.mode = ISOGI_TRACE_TRANSFER, d.order = 5, d.lighting.lights = &sun, d.lighting.light_count = 1, d.lazy = !run;
        if (run) d.method = ISOGI_TRACE_FEEDBACK, d.unfiltered = run == 1, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK && isogi_trace_relight(t, &d.lighting) == ISOGI_OK,
              "bake");
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, run ? e : reference, error), isogi_trace_free(t);
        for (int i = 0; i < n && run; i++) {
            const double off = fabs((double)e[i][1] - (double)reference[i][1]);
            square[run] += off * off / n, covered += run == 2 && off <= 2 * (double)error[i];
        }
    }
    printf("    error %.4f, unfiltered %.4f; %d of %d points within twice the error told\n", sqrt(square[2]), sqrt(square[1]), covered, n);
    CHECK(n > 200 && sqrt(square[2]) < 1.2 * sqrt(square[1]) && covered > 0.95 * n, "error %.4f, unfiltered %.4f; %d of %d points",
          sqrt(square[2]), sqrt(square[1]), covered, n);
    scene_free(&s);
}

/* A texel's error keeps .18 of its own variance, which stands for what the filter blurs: there where many texels share their light, it
   is nearly all of what is left. */
SLOW_TEST(errors_tell_of_what_the_filter_blurs) {
    static float points[200][3], e[200][3], error[2][200];
    double q[5] = {24, 22, 24, 26, 16}, square[2] = {0, 0};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    int n = surface_points(&s, 0, 200, 7, points);
    for (int unfiltered = 0; unfiltered < 2; unfiltered++) {
        isogi_trace_desc d = feedback(&s, 0, 0, 64);
        isogi_trace *t = NULL;
        d.unfiltered = unfiltered, d.lazy = 0, d.isovalue_min = -0.3, d.isovalue_max = 0.3;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error[unfiltered]);
        for (int i = 0; i < n; i++) square[unfiltered] += pow((double)error[unfiltered][i], 2) / n;
        isogi_trace_free(t);
    }
    printf("    variance %.4g, unfiltered %.4g: %.3f\n", square[0], square[1], square[0] / square[1]);
    CHECK(n == 200 && square[0] > 0.18 * square[1] && square[0] < 0.21 * square[1], "variance %g, unfiltered %g", square[0], square[1]);
    scene_free(&s);
}

/* Which texels share light depends on no unit of values: not even where squares of them are no numbers. */
TEST(light_is_the_same_whatever_the_unit_of_values) {
    const double scales[3] = {1, 0x1p+560, 0x1p-560};
    double q[5] = {16, 15, 16, 18, 10};
    static float points[100][3], e[3][100][3], error[3][100];
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    const int n = surface_points(&s, 0, 100, 7, points);
    for (int i = 0; i < 3; i++) {
        isogi_trace_desc d = feedback(&s, 0, 0, 4);
        isogi_trace *t;
        int same = 0;
        isogi_vol_free(s.pyramid);
        s.volume.scale = scales[i];
        CHECK(isogi_vol_build(&s.pyramid, &s.volume, NULL) == ISOGI_OK, "scale %g", scales[i]);
        d.pyramid = s.pyramid, d.lazy = 1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                  isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[i], error[i]) == ISOGI_OK,
              "scale %g", scales[i]);
        for (int k = 0; k < n; k++)
            same += fabs((double)(e[i][k][1] - e[0][k][1])) < 1e-4 * (double)e[0][k][1] &&
                    fabs((double)(error[i][k] - error[0][k])) <= 0.01 * (double)error[0][k];
        CHECK(n > 80 && same == n, "scale %g: %d of %d points have the same light and error", scales[i], same, n);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Without the filter a texel's light is its own, whatever is baked beside it; with it, that of its neighbours goes into it. */
TEST(unfiltered_texels_stand_alone) {
    double q[5] = {24, 22, 24, 26, 16};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    static float points[200][3], e[2][200][3];
    int n = surface_points(&s, 0, 200, 7, points);
    for (int unfiltered = 0; unfiltered < 2; unfiltered++) {
        isogi_trace_desc d = feedback(&s, 0.6f, 0, 16);
        int same = 0;
        d.lazy = 1, d.unfiltered = unfiltered;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e[0]);
        for (int i = 0; i < 20; i++) bake_and_sample(&d, NULL, (const float(*)[3])points + i, 1, e[1] + i);
        for (int i = 0; i < 20; i++) same += !memcmp(e[0][i], e[1][i], sizeof e[0][i]);
        CHECK(unfiltered ? same == 20 : same < 18, "unfiltered %d: %d of 20 points have the same light alone", unfiltered, same);
    }
    scene_free(&s);
}

/* Light from probes is not exactly that at the hit: its bias against paths, measured where it matters most (a gyroid's narrow
   channels, albedo 0.8), of three runs, which differ by 0.8 %, printed, and bounded. Long: 1364 samples, noise 0.2 %; quick: 84 samples at
   60 points, noise 1 % of the mean and 5 % at a point. */
SLOW_TEST(bias_against_paths_is_small) {
    double q[1] = {0.3};
    scene s = scene_make(48, 48, 48, NULL, gyroid, q);
    static float points[200][3], e[2][200][3];
    isogi_trace_desc d = desc_make(&s, 0.8f, -1, LONG_SUITE ? 1364 : 84);
    double bias = 0, square = 0, mean = 0;
    int n = surface_points(&s, 0, LONG_SUITE ? 200 : 60, 5, points);
    d.lazy = 1;
    d.method = ISOGI_TRACE_PATHS;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, e[1]);
    for (d.method = ISOGI_TRACE_FEEDBACK; d.seed < 3; d.seed++) {
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e[0]);
        for (int i = 0; i < n; i++) {
            double apart = (double)e[0][i][1] - (double)e[1][i][1];
            bias += apart / (3 * n), square += apart * apart / (3 * n), mean += (double)e[1][i][1] / (3 * n);
        }
    }
    printf("    bias %.4f of the mean, root mean square difference %.4f\n", bias / mean, sqrt(square) / mean);
    CHECK(fabs(bias) < (LONG_SUITE ? 0.01 : 0.025) * mean && sqrt(square) < (LONG_SUITE ? 0.03 : 0.06) * mean, "bias %g, rms %g of %g",
          bias, sqrt(square), mean);
    scene_free(&s);
}

/* Transfer of every order, grey and in colours, by probes and by paths: relit it is the light of paths. One channel for a coloured surface
   is that of a grey one of its mean albedo. Points in a pit, colours by isovalue, and by place with four reflections; noise of 84 samples
   and probes at each of 100 points: 0.055 of a mean of 2.6 (rms), 1.3 % of the mean at most. */
static void bands(void *user, double isovalue, const double p[3], float albedo[3], float emission[3]) {
    (void)user, (void)isovalue, (void)emission;
    for (int c = 0; c < 3; c++) albedo[c] *= (int)floor(p[0] / 3) % 3 == c ? 1 : 0.4f;
}
static void grey_bands(void *user, double isovalue, const double p[3], float albedo[3], float emission[3]) {
    (void)user, (void)isovalue, (void)p, (void)emission;
    for (int c = 0; c < 3; c++) albedo[c] *= 0.6f;
}
TEST(transfer_of_any_order_and_colour_is_lit_as_by_paths) {
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    static float points[100][3], e[100][3], truth[100][3], sh[108];
    const isogi_albedo_point colours[1] = {{0, {0.9f, 0.3f, 0.6f}}}, mean[1] = {{0, {0.6f, 0.6f, 0.6f}}};
    int n = surface_points(&s, 0, 100, 3, points);
    for (int order = 1; order <= 6; order++)
        for (int kind = 0; kind < 4; kind++) { /* three channels; one, of a coloured surface; the same by place */
            isogi_trace_desc d = desc_make(&s, 0, kind / 2 ? 4 : -1, LONG_SUITE ? 1024 : 256);
            test_random r = {(uint64_t)order};
            if ((!LONG_SUITE && kind != order % 4) || (QUICK_SUITE && order != 2 && order != 5)) continue;
            for (int i = 0; i < order * order * 3; i++) sh[i] = (float)(i < 3 ? 4 : random_range(&r, -0.5, 0.5));
            d.lazy = 1, d.lighting.env.sh = sh, d.lighting.env.sh_order = order;
            d.albedo_points = kind == 1 ? mean : colours, d.albedo_count = 1;
            if (kind >= 2) d.albedo_count = 0, d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.9f, d.material = kind == 2 ? bands : grey_bands;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, truth);
            for (int method = 0; method < 2; method++) {
                isogi_trace_desc transfer = d;
                isogi_trace *t = NULL;
                double square = 0, sum[3] = {0, 0, 0}, all[3] = {0, 0, 0};
                int found = 0, channels = 0;
                transfer.mode = ISOGI_TRACE_TRANSFER, transfer.method = (isogi_trace_method)method, transfer.order = order;
                transfer.samples = 84, transfer.seed = 7, transfer.albedo_points = colours;
                transfer.transfer_channels = kind % 2, transfer.material = kind >= 2 ? bands : NULL;
                CHECK(isogi_trace_create(&t, &transfer, NULL) == ISOGI_OK, "order %d", order);
                isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
                CHECK(isogi_trace_relight(t, &d.lighting) == ISOGI_OK, "order %d", order);
                isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL), isogi_trace_shape(t, NULL, &found, &channels);
                CHECK(found == order && channels == (kind % 2 ? 1 : 3), "order %d, %d channels", found, channels);
                for (int i = 0; i < n; i++)
                    for (int c = 0; c < 3; c++) {
                        sum[c] += (double)e[i][c] / n, all[c] += (double)truth[i][c] / n;
                        square += pow((double)e[i][c] - (double)truth[i][c], 2) / n / 3;
                    }
                for (int c = 0; c < 3; c++)
                    CHECK(fabs(sum[c] - all[c]) < 0.02 * all[c], "order %d, kind %d, method %d, channel %d: mean %.4f, by paths %.4f",
                          order, kind, method, c, sum[c], all[c]);
                CHECK(sqrt(square) < 0.03 * all[1], "order %d, kind %d, method %d: %.4f off (rms)", order, kind, method, sqrt(square));
                printf("    order %d, kind %d, method %d: means %+.4f %+.4f %+.4f, rms %.4f of %.4f\n", order, kind, method,
                       sum[0] - all[0], sum[1] - all[1], sum[2] - all[2], sqrt(square), all[1]);
                isogi_trace_free(t);
            }
        }
    scene_free(&s);
}

/* Voxels that are flat, long or both. Cells of probes that were cubes of the smallest spacing would number up to its ratio squared; they
   are half a voxel wide at least, so at most some 8 times as many. Light stays that of paths: noise 0.5 % in the mean over seeds, bias of
   probes as above. */
SLOW_TEST(flat_and_long_voxels_need_few_probes) {
    enum { SEEDS = 4 };
    static const double spacings[6][3] = {{1, 1, 1}, {1, 1, 100}, {1, 1, 1000}, {1, 1, 0.01}, {0.1, 1, 10}, {1e-9, 1, 1e9}};
    double q[1] = {0.5};
    scene s = scene_make(24, 24, 24, NULL, gyroid, q);
    uint64_t cubes = 0;
    for (int k = 0; k < 6; k++) {
        static float points[200][3], e[2][200][3];
        double mean[2] = {0, 0}, remaining = 1;
        isogi_trace_report report = {0};
        int n;
        isogi_vol_free(s.pyramid), s.pyramid = NULL;
        memcpy(s.volume.spacing, spacings[k], sizeof s.volume.spacing);
        CHECK(isogi_vol_build(&s.pyramid, &s.volume, NULL) == ISOGI_OK, "pyramid %d", k);
        n = surface_points(&s, 0, LONG_SUITE ? 200 : 100, 6, points);
        for (int turn = 0; turn <= SEEDS; turn++) {
            const int method = turn == SEEDS;
            isogi_trace_desc d = desc_make(&s, 0.7f, -1, LONG_SUITE ? 64 : 16);
            isogi_trace *t = NULL;
            d.method = (isogi_trace_method)method, d.lazy = 1, d.seed = method ? 0 : (uint64_t)turn;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK,
                  "spacing %d", k);
            remaining = 1;
            for (int step = 0; step < (LONG_SUITE ? 40 : 10) && remaining > 0; step++) isogi_trace_step(t, 50000, &remaining);
            CHECK(remaining <= 0, "spacing %d, method %d: does not end, %g remain", k, method, remaining);
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[method], NULL);
            if (!method) isogi_trace_status(t, &report);
            for (int i = 0; i < n; i++) mean[method] += (double)e[method][i][1] / n / (method ? 1 : SEEDS);
            isogi_trace_free(t);
        }
        if (!k) cubes = report.probes;
        printf("    spacing %g %g %g: %llu probes, E %.4f, of paths %.4f\n", spacings[k][0], spacings[k][1], spacings[k][2],
               (unsigned long long)report.probes, mean[0], mean[1]);
        CHECK(report.probes < 10 * cubes, "spacing %d: %llu probes, %llu in cubes", k, (unsigned long long)report.probes,
              (unsigned long long)cubes);
        CHECK(fabs(mean[0] - mean[1]) < 0.03 * mean[1], "spacing %d: E %.4f, of paths %.4f", k, mean[0], mean[1]);
    }
    scene_free(&s);
}

/* Grid axes that are long, short or turned in the world are like others: edges of a quarter of a unit, be it by the spacing or by the
   axes, give the same bits, and axes in another order about the same number of probes. */
static double turned_torus(const double p[3], const double *q) {
    const double world[3] = {p[2], p[0], p[1]};
    return torus(world, q);
}
TEST(probes_follow_the_axes) {
    double q[5] = {15.5, 15.5, 15.5, 9, 4};
    static float points[100][3], e[4][100][3];
    isogi_trace_report report[4];
    for (int k = 0; k < 4; k++) {
        scene s = scene_make(32, 32, 32, NULL, k == 3 ? turned_torus : torus, q);
        isogi_trace_desc d;
        isogi_trace *t = NULL;
        isogi_vol_free(s.pyramid), s.pyramid = NULL;
        for (int a = 0; a < 3; a++)
            s.volume.spacing[a] = k == 1 ? 0.25 : 1, s.volume.axes[3 * (k == 3 ? (a + 1) % 3 : a) + a] = k == 2 ? 0.25 : 1;
        CHECK(isogi_vol_build(&s.pyramid, &s.volume, NULL) == ISOGI_OK, "pyramid %d", k);
        if (!k) surface_points(&s, 0, 100, 7, points);
        for (int i = 0; i < 100 && k == 1; i++)
            for (int a = 0; a < 3; a++) points[i][a] *= 0.25f;
        for (int i = 0; i < 100 && k == 3; i++)
            for (int a = 0; a < 3; a++) points[i][a] *= 4;
        d = feedback(&s, 0.8f, -1, 16);
        d.lattice[0] = d.lattice[1] = d.lattice[2] = 10;
        memset(&report[k], 0, sizeof report[k]);
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake %d", k);
        isogi_trace_status(t, &report[k]);
        isogi_trace_sample(t, (const float(*)[3])points, 100, e[k], NULL);
        isogi_trace_free(t), scene_free(&s);
        printf("    %d: %llu probes\n", k, (unsigned long long)report[k].probes);
    }
    CHECK(!memcmp(e[1], e[2], sizeof e[1]), "axes of .25 are not like a spacing of .25, %d", 0);
    for (int k = 1; k < 4; k++)
        CHECK(fabs((double)report[k].probes / (double)report[0].probes - 1) < 0.1, "%d: %llu probes, not %llu", k,
              (unsigned long long)report[k].probes, (unsigned long long)report[0].probes);
}

/* ---- determinism and stepping ---------------------------------------------------------------------------------------------- */

TEST(same_bits_for_any_threads_and_budget) {
    double q[5] = {8, 7, 8, 10, 5}, neck[5] = {7.5, 7, 8, 5, 1.6};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 2, 0.2);
    static float points[400][3], first[400][3], e[400][3];
    for (int way = 0; way < 5; way++) { /* irradiance full and lazy, lazy transfer, adaptive; white: not by passes alone */
        scene s = way == 4 ? scene_make(16, 15, 22, NULL, bottle, neck) : scene_make(16, 15, 14, NULL, pit, q);
        const int n = surface_points(&s, 0, LONG_SUITE ? 400 : 100, 14, points);
        isogi_trace_desc d = feedback(&s, way == 4 ? 1 : 0.8f, -1, LONG_SUITE ? 20 : 8);
        const int threads[4] = {1, 3, 2, 8};
        d.lighting.lights = &sun, d.lighting.light_count = 1, d.lazy = way == 1 || way == 2 || way == 4, d.error = way == 3 ? 0.02f : 0;
        d.mode = way == 2 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, d.order = 2;
        for (int i = 0; i < (QUICK_SUITE ? 2 : 4); i++) {
            isogi_context context;
            memset(&context, 0, sizeof context);
            context.threads = threads[i];
            bake_and_sample(&d, &context, (const float(*)[3])points, n, i ? e : first);
            CHECK(!i || !memcmp(e, first, sizeof e), "way %d: %d threads differ from one", way, threads[i]);
        }
        for (int i = 0; i < 3; i++) {
            isogi_trace *t = NULL;
            double remaining = 1, before = 2;
            uint64_t budget[3] = {1, 777, 50000};
            if (!i && (way == 4 || (!LONG_SUITE && way))) continue; /* a hundred passes over segments of a ray: millions of steps */
            isogi_trace_create(&t, &d, NULL);
            isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
            for (int k = 0; remaining > 0 && k < 1000000; k++, before = remaining) {
                CHECK(isogi_trace_step(t, budget[i], &remaining) == ISOGI_OK, "step");
                CHECK(remaining <= before, "remaining rose: %g after %g", remaining, before);
            }
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
            CHECK(remaining <= 0 && !memcmp(e, first, sizeof e), "way %d: budget %g differs", way, (double)budget[i]);
            isogi_trace_free(t);
        }
        scene_free(&s);
    }
}

/* Memory as allocators hand it out: full of old bytes. */
static void *filled_alloc(void *user, size_t size, size_t align) {
    void *p = NULL;
    if (posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    return memset(p, *(const int *)user, size);
}
static void filled_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

/* Light that is loaded over texels that have begun is what others beside them compare theirs with, too: nothing that they read was in
   memory before. Loaded after the first samples, and in the middle of what follows them. */
TEST(light_is_the_same_in_any_memory) {
    enum { POINTS = 200, FILLS = 3 };
    const int fill[FILLS] = {0, 0x41, 0xff};
    const uint64_t budgets[3] = {1500, 5000, 9000};
    double q[5] = {15.5, 15, 15.5, 18, 12};
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    static float points[POINTS][3], e[FILLS][POINTS][3];
    int n = surface_points(&s, 0, POINTS, 5, points);
    isogi_trace_desc d = feedback(&s, 0.7f, -1, 20);
    isogi_trace *half = NULL;
    d.lazy = 1;
    CHECK(isogi_trace_create(&half, &d, NULL) == ISOGI_OK, "create %d", 0);
    CHECK(isogi_trace_request(half, (const float(*)[3])points, (size_t)n / 2) == ISOGI_OK && isogi_trace_step(half, 0, NULL) == ISOGI_OK,
          "bake %d", 0);
    size_t size = isogi_trace_save_size(half);
    void *block = malloc(size);
    CHECK(isogi_trace_save(half, block, size) == ISOGI_OK, "save %d", 0);
    for (int b = 0; b < 3; b++)
        for (int k = 0; k < FILLS; k++) {
            isogi_context context = {.alloc = filled_alloc, .release = filled_release, .user = (void *)(uintptr_t)&fill[k]};
            isogi_trace *t = NULL;
            CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create %d", k);
            isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, budgets[b], NULL);
            CHECK(isogi_trace_load(t, block, size) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "load %d", k);
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[k], NULL);
            isogi_trace_free(t);
            CHECK(!memcmp(e[k], e[0], sizeof e[0]), "after %d rays: other light in memory of %d", (int)budgets[b], fill[k]);
        }
    free(block), isogi_trace_free(half), scene_free(&s);
}

/* A budget may be any number: the largest is as good as none. */
TEST(the_largest_budget_is_no_other) {
    double q[5] = {15.5, 15, 15.5, 18, 12};
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    float points[50][3], e[2][50][3];
    int n = surface_points(&s, 0, 50, 5, points);
    for (int k = 0; k < 2; k++) {
        isogi_trace_desc d = feedback(&s, 0.7f, -1, 8);
        isogi_trace *t = NULL;
        double remaining = 1;
        d.lazy = 1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create %d", k);
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 1000, NULL);
        CHECK(isogi_trace_step(t, k ? UINT64_MAX : 0, &remaining) == ISOGI_OK && remaining <= 0, "remaining %g", remaining);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[k], NULL);
        isogi_trace_free(t);
    }
    CHECK(!memcmp(e[0], e[1], (size_t)n * sizeof e[0][0]), "other light, %d points", n);
    scene_free(&s);
}

/* Transfer knows no lights: the same bits whatever shines, also where that changes while it is baked. */
TEST(transfer_does_not_know_the_lights) {
    enum { POINTS = 100 };
    double q[5] = {24, 22, 24, 26, 16};
    scene s = scene_make(48, 48, 48, NULL, pit, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 1, 0.2, 3, 0.01);
    static float points[POINTS][3], transfer[3][POINTS * 4];
    int n = surface_points(&s, 0, POINTS, 5, points);
    for (int k = 0; k < 3; k++) { /* dark, lit, lit from the middle on */
        isogi_trace_desc d = feedback(&s, 0.7f, -1, 64);
        isogi_trace *t = NULL;
        d.lazy = 1, d.mode = ISOGI_TRACE_TRANSFER, d.order = 2, d.lighting.lights = &sun, d.lighting.light_count = k == 1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create %d", k);
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 30000, NULL);
        d.lighting.light_count = k > 0;
        CHECK(k < 2 || isogi_trace_change(t, &d) == ISOGI_OK, "change %d", k);
        CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step %d", k);
        CHECK(isogi_trace_sample_transfer(t, (const float(*)[3])points, (size_t)n, transfer[k]) == ISOGI_OK, "sample %d", k);
        CHECK(!memcmp(transfer[k], transfer[0], sizeof transfer[0]), "other transfer, %d", k);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

static int go_on(void *user, double fraction) { return (void)user, (void)fraction, 0; }

/* Between blocks of samples light is worked out for whoever looks. Where a step goes to its end, and no callback can stop it, nobody does:
   three blocks take less than three quarters of the tasks, to the same bits. With a target for errors each block is needed. */
TEST(light_that_nobody_sees_is_not_worked_out) {
    enum { POINTS = 200 };
    double q[5] = {15.5, 15, 15.5, 18, 12};
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    float points[POINTS][3], e[2][POINTS][3];
    int n = surface_points(&s, 0, POINTS, 5, points);
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        size_t tasks[2];
        for (int watched = 0; watched < 2; watched++) {
            demand asked = {0};
            isogi_context counting = {.parallel_for = count_tasks, .user = &asked, .progress = watched ? go_on : NULL};
            isogi_trace_desc d = feedback(&s, 0.7f, -1, 64);
            d.lazy = 1, d.error = adaptive ? 1e-4f : 0;
            bake_and_sample(&d, &counting, (const float(*)[3])points, n, e[watched]);
            tasks[watched] = asked.tasks;
        }
        printf("    %s: %d tasks, %d when watched\n", adaptive ? "to a target" : "all samples", (int)tasks[0], (int)tasks[1]);
        CHECK(adaptive ? tasks[0] == tasks[1] : 4 * tasks[0] < 3 * tasks[1], "%d tasks, %d when watched", (int)tasks[0], (int)tasks[1]);
        CHECK(!memcmp(e[0], e[1], (size_t)n * sizeof e[0][0]), "other light when watched, %d", adaptive);
    }
    scene_free(&s);
}

/* A hierarchy does not know how many texels it will want before its coarse ones are done; what it reports never rises all the same, comes
   to 0 only at the end, and begins anew after a change. */
TEST(hierarchies_report_what_falls) {
    double q[5] = {15.5, 15, 15.5, 18, 12};
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    for (int k = 0; k < 4; k++) {
        isogi_trace_desc d = feedback(&s, 0.7f, 1, 2);
        isogi_trace *t = NULL;
        double remaining = 1, before = 1;
        int rises = 0, begun = 0;
        d.method = k & 1 ? ISOGI_TRACE_PATHS : ISOGI_TRACE_FEEDBACK, d.hierarchy = 0.1f;
        d.sides = k & 2 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE, d.isovalue_min = -0.3, d.isovalue_max = 0.3;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "case %d", k);
        for (int round = 0; round < 2; round++) {
            for (remaining = before = 1; remaining > 0; before = remaining, begun++) {
                CHECK(isogi_trace_step(t, 1000, &remaining) == ISOGI_OK, "case %d", k);
                rises += remaining > before;
                if (before >= 1 && remaining < 0.5) CHECK(0, "case %d: from 1 to %g in a step", k, remaining);
            }
            d.albedo[1] = 0.3f;
            CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "case %d", k);
        }
        CHECK(!rises && begun > 20, "case %d: rose %d times in %d steps", k, rises, begun);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Nodes are made for a cube of texels at a time. Where the memory for some of them fails the step can be repeated, and the group is the
   same: so is the light. Of 103680 texels the first cube has 82944. */
typedef struct chunk_failure { long large, fails; } chunk_failure;
static void *chunk_alloc(void *user, size_t size, size_t align) {
    chunk_failure *f = (chunk_failure *)user;
    void *p = NULL;
    if (size > 50000 && f->fails >= 0 && f->large++ == f->fails) return NULL;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void chunk_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }
SLOW_TEST(groups_are_the_same_after_a_failure) {
    double q[1] = {0.35};
    scene s = scene_make(36, 36, 80, NULL, gyroid, q);
    uint8_t *block[2];
    size_t size[2];
    for (int k = 0; k < 2; k++) {
        chunk_failure failure = {0, -1};
        isogi_context context = {.threads = 2, .alloc = chunk_alloc, .release = chunk_release, .user = &failure};
        isogi_trace_desc d = feedback(&s, 0.7f, 1, 1);
        isogi_trace *t = NULL;
        int failed = 0;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create");
        failure.fails = k ? 2 : -1;
        while (isogi_trace_step(t, 0, NULL) == ISOGI_NO_MEMORY) failed++;
        CHECK(failed == k, "%d failures", failed);
        size[k] = isogi_trace_save_size(t), block[k] = (uint8_t *)malloc(size[k]);
        CHECK(isogi_trace_save(t, block[k], size[k]) == ISOGI_OK, "save");
        isogi_trace_free(t);
    }
    CHECK(size[0] == size[1] && !memcmp(block[0], block[1], size[0]), "other bits after a failure: %zu and %zu bytes", size[0], size[1]);
    free(block[0]), free(block[1]), scene_free(&s);
}

/* Every instruction path of rays gives the same hits, hence the same light: to the last bit here, but a ray that grazes the surface within
   rounding may be seen either way, once in 100,000 (test_vol), and under -ffast-math or contraction t may differ in its last bits. So one
   point in a hundred may differ by more than float rounding (1e-5), none by more than two standard errors. */
TEST(instruction_paths_agree) {
    double q_gyroid[1] = {0.35}, q_pit[5] = {16, 15, 16, 22.3, 12}, q_ball[4] = {15.5, 15.5, 15.5, 9.3};
    field *const surface[3] = {gyroid, pit, rough_ball};
    const double *const parameter[3] = {q_gyroid, q_pit, q_ball};
    isogi_light lights[2] = {light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 1, 0.2), light_make(ISOGI_LIGHT_POINT, 16, 60, 16, 900, 0)};
    for (int variant = 0; variant < (LONG_SUITE ? 12 : 2); variant++) { /* feedback and paths; irradiance and transfer; three surfaces */
        int shape = variant / 4, transfer = variant / 2 % 2, n = 40, different = 0;
        scene s = scene_make(32, 32, 32, NULL, surface[shape], parameter[shape]);
        static float points[200][3], e[2][200][3], error[200];
        double worst = 0;
        n = surface_points(&s, 0, n, 3, points);
        for (int path = 1; path <= 4; path++) {
            isogi_context context = {.force_path = path};
            isogi_trace_desc d = desc_make(&s, 0.7f, -1, 20);
            isogi_trace *t = NULL;
            isogi_pyramid *pyramid = NULL;
            if (isogi_vol_build(&pyramid, &s.volume, &context) != ISOGI_OK) abort();
            d.pyramid = pyramid, d.lazy = 1, d.method = (isogi_trace_method)(variant % 2), d.mode = (isogi_trace_mode)transfer;
            d.lighting.lights = lights, d.lighting.light_count = transfer ? 1 : 2;
            CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "variant %d, path %d", variant, path);
            CHECK(isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                      isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[path > 1], error) == ISOGI_OK,
                  "variant %d, path %d", variant, path);
            for (int i = 0; i < n && path > 1; i++) {
                double green = (double)e[0][i][1], off = fabs((double)e[1][i][1] - green), apart = 0;
                for (int a = 0; a < 3; a++)
                    apart = fmax(apart, fabs((double)e[1][i][a] - (double)e[0][i][a]) / fmax(1e-9, (double)e[0][i][a]));
                different += apart > 1e-5, worst = fmax(worst, apart);
                CHECK(off <= 1e-5 * green + 2 * (double)error[i], "variant %d, path %d, point %d: %g off %g", variant, path, i, off, green);
            }
            isogi_trace_free(t), isogi_vol_free(pyramid);
        }
        CHECK(n > 20 && different * 100 <= 3 * n, "variant %d: %d of %d points differ, by up to %g", variant, different, 3 * n, worst);
        scene_free(&s);
    }
}

/* Lazily other probes may be the first in their cells: under even light the same within 3 % (rms), as the header says; with 84 samples the
   difference is the same, so it is the probes, not the noise. */
TEST(lazily_and_fully_agree) {
    double q[5] = {12, 11, 12, 15, 7}, square = 0, sum = 0;
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    static float points[200][3], full[200][3], lazy[200][3];
    isogi_trace_desc d = feedback(&s, 0.7f, -1, LONG_SUITE ? 84 : 16);
    int n = surface_points(&s, 0, 200, 9, points);
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, full);
    d.lazy = 1;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, lazy);
    for (int i = 0; i < n; i++) square += pow((double)(full[i][1] - lazy[i][1]), 2), sum += (double)full[i][1] * (double)full[i][1];
    printf("    lazily against fully: %.4f (rms)\n", sqrt(square / sum));
    CHECK(n > 150 && sqrt(square / sum) < 0.03, "rms %g", sqrt(square / sum));
    scene_free(&s);
}

/* Where all texels around a point lack a surface, the nearest one is read that has one: requested, though none of the isovalues wanted may
   be near it. */
static double two_crumbs(const double p[3], const double *q) {
    return length3(p[0] - 6, p[1] - 6, p[2] - 6) < 0.5 ? 1 : length3(p[0] - 12, p[1] - 8, p[2] - 8) < 0.5 ? q[0] : -1;
}
TEST(lazily_the_nearest_is_whatever_the_interval) {
    double q[1] = {0.2};
    scene s = scene_make(17, 17, 17, NULL, two_crumbs, q);
    static float points[20][3], e[2][20][3];
    int n = 20, dark = 0;
    for (int i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) points[i][a] = a == i % 3 ? 6.2f : 6 + 0.01f * (float)(i - 10); /* 0.6 on the crumb */
    for (int k = 0; k < 2; k++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
        d.lattice[0] = d.lattice[1] = d.lattice[2] = 5;
        if (k) d.lazy = 1, d.isovalue_min = 0.5, d.isovalue_max = 0.7;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, e[k]);
    }
    for (int i = 0; i < n; i++) dark += e[0][i][1] > 0 && e[1][i][1] <= 0;
    CHECK(e[0][0][1] > 0 && !memcmp(e[0], e[1], sizeof e[0]), "other light than of the whole texture, dark at %d of %d", dark, n);
    scene_free(&s);
}

/* Texels beyond the interval are looked at where the nearest is sought, which is one of them: the others are not computed for whoever asks
   there later, just as if he had asked before. */
static double three_crumbs(const double p[3], const double *q) {
    return length3(p[0] - 12, p[1] - 12, p[2] - 12) < 0.5 ? q[0] : two_crumbs(p, q);
}
TEST(lazily_the_order_of_requests_does_not_matter) {
    double q[1] = {0.2};
    scene s = scene_make(17, 17, 17, NULL, three_crumbs, q);
    float places[2][1][3] = {{{6.2f, 6, 6}}, {{11.9f, 12, 12}}};
    for (int method = 0; method < 2; method++) {
        uint64_t texels[3], wanted[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
            isogi_trace *t = NULL;
            isogi_trace_report report;
            size_t x[3];
            d.method = method ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS;
            d.lattice[0] = d.lattice[1] = d.lattice[2] = 5, d.lazy = 1;
            if (k < 2) d.isovalue_min = 0.5, d.isovalue_max = 0.7;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create");
            for (int i = 0; i < 2; i++) isogi_trace_request(t, (const float(*)[3])places[i ^ (k & 1)], 1);
            for (x[2] = 1; x[2] < 5; x[2]++)
                for (x[1] = 1; x[1] < 5; x[1]++)
                    for (x[0] = 1; x[0] < 5; x[0]++)
                        wanted[k] |= (uint64_t)isogi_trace_wanted(t, x) << (x[0] - 1 + 4 * (x[1] - 1) + 16 * (x[2] - 1));
            CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step");
            isogi_trace_status(t, &report), texels[k] = report.texels;
            isogi_trace_free(t);
        }
        CHECK(texels[0] == 1 && texels[1] == 1 && wanted[0] == wanted[1] && texels[2] == 2,
              "method %d: %d texels, %d in the other order, %d without an interval", method, (int)texels[0],
              (int)texels[1], (int)texels[2]);
    }
    scene_free(&s);
}

/* Within the first rays every point that was asked for has a value; steps keep to their budget; what follows changes little: the largest
   step is the one from the first guess, of 4 samples and no reflections, to light from probes (16 % of the picture, rms). */
TEST(lazy_bakes_are_usable_at_once) {
    double q[5] = {32, 31, 32, 45, 20};
    scene s = scene_make(64, 64, 64, NULL, pit, q);
    static float points[600][3], e[600][3], last[600][3], error[600];
    isogi_trace_desc d = feedback(&s, 0.7f, -1, 84);
    isogi_trace *t = NULL;
    isogi_counters c = {0};
    isogi_trace_report report;
    double remaining = 1, jump = 0, whole = 0;
    int n = surface_points(&s, 0, 600, 9, points), missing = 0, steps = 0;
    uint64_t usable = 0;
    d.lazy = 1;
    isogi_trace_create(&t, &d, NULL);
    CHECK(isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0, "nothing was asked for");
    isogi_trace_counters(t, &c);
    CHECK(c.rays == 0 && c.texels == 0, "%g rays for nothing", (double)c.rays);
    isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
    for (remaining = 1; remaining > 0; steps++) {
        uint64_t before = c.rays;
        isogi_trace_step(t, 2000, &remaining);
        memset(&c, 0, sizeof c), isogi_trace_counters(t, &c);
        CHECK(c.rays - before < 4000, "a step of %g rays", (double)(c.rays - before));
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
        missing = 0;
        for (int i = 0; i < n; i++) missing += error[i] > 1e30f;
        if (!missing && !usable) usable = c.rays;
        else if (usable) {
            double square = 0, sum = 0;
            for (int i = 0; i < n; i++) {
                double change = fabs((double)(e[i][1] - last[i][1]));
                jump = fmax(jump, change), square += change * change, sum += (double)e[i][1] * (double)e[i][1];
            }
            whole = fmax(whole, sqrt(square / sum));
        }
        memcpy(last, e, sizeof e);
    }
    isogi_trace_status(t, &report);
    printf("    usable after %.3f of the rays; largest step of a value %.3f, of the picture %.3f (rms); %d steps, %g texels, %g probes\n",
           (double)usable / (double)c.rays, jump, whole, steps, (double)report.texels, (double)report.probes);
    CHECK(whole < 0.2 && jump < 0.4 * PI, "a step changes the picture by %.3f, a point by %.3f", whole, jump);
    CHECK(missing == 0 && usable > 0 && usable * 8 < c.rays, "usable after %g of %g rays", (double)usable, (double)c.rays);
    CHECK(report.texels == c.texels && report.drafts == 0 && report.error < 0.05 * report.light, "%g texels, error %g of %g",
          (double)report.texels, report.error, report.light);
    /* what has been asked for before costs nothing; another isovalue only its own texels */
    isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
    {
        isogi_counters again = {0}, other = {0};
        int k = surface_points(&s, 1, 600, 9, points);
        isogi_trace_counters(t, &again);
        CHECK(again.rays == c.rays, "%g rays for nothing new", (double)(again.rays - c.rays));
        isogi_trace_request(t, (const float(*)[3])points, (size_t)k), isogi_trace_step(t, 0, NULL);
        isogi_trace_counters(t, &other);
        CHECK(other.texels > again.texels && other.texels - again.texels < again.texels, "%g texels, then %g", (double)again.texels,
              (double)other.texels);
    }
    isogi_trace_free(t), scene_free(&s);
}

/* ---- errors ---------------------------------------------------------------------------------------------------------------- */

/* Lookups of four seeds, and how many of them are within two of the errors that they report; half of 1/1000 for the passes that end
   early. */
static void covered(const char *name, isogi_trace_desc d, const float (*points)[3], int n, const float *expected, double least) {
    enum { SEEDS = 4 };
    static float e[200][3], error[200];
    int within = 0;
    double square = 0, claimed = 0;
    for (d.seed = 0; d.seed < SEEDS; d.seed++) {
        isogi_trace *t = NULL;
        isogi_trace_report report;
        isogi_counters counters = {0};
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, points, (size_t)n);
        CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step");
        isogi_trace_sample(t, points, (size_t)n, e, error);
        for (int i = 0; i < n; i++) {
            double apart = fabs((double)e[i][1] - (double)expected[i]);
            within += apart <= 2 * (double)error[i] + 5e-4 * (double)expected[i], square += apart * apart / (SEEDS * n),
                claimed += (double)error[i] * (double)error[i] / (SEEDS * n);
            CHECK(error[i] > 0, "%s: no error at %d", name, i);
        }
        isogi_trace_status(t, &report);
        if (d.error > 0) { /* without reflections there are no probes, which are uncertain themselves */
            CHECK(d.bounces || report.worst <= 1.01 * (double)d.error * report.unit, "%s: worst %g of %g, aim %g", name, report.worst,
                  report.unit, (double)d.error);
            isogi_trace_counters(t, &counters);
            CHECK(counters.rays * 4 < counters.texels * (uint64_t)d.samples && report.drafts == 0, "%s: %g rays for %g texels", name,
                  (double)counters.rays, (double)counters.texels);
        }
        isogi_trace_free(t);
    }
    printf("    %-14s %-8s %4d samples, error %4.2f: %5.1f %% within 2 standard errors, rms %.4f, reported %.4f\n", name,
           d.method ? "paths" : "feedback", d.samples, (double)d.error, 100.0 * within / (SEEDS * n), sqrt(square), sqrt(claimed));
    CHECK(within >= least * SEEDS * n && sqrt(claimed) < 6 * sqrt(square) + 0.1 * (double)expected[0], "%s: %d of %d, reported %g, rms %g",
          name, within, SEEDS * n, sqrt(claimed), sqrt(square));
}

/* 95 % of the reported errors cover the true ones (twice the standard error), with few samples and many, and of adaptive bakes whatever
   their aim, on scenes with closed forms: a plane below a black sphere, a glowing closed cavity; and a pit, whose closed form holds for
   no voxels: against many paths. */
TEST(errors_are_honest) {
    double q_plane[5] = {32, 30, 32, 8, 12}, q_shell[5] = {15.5, 15.5, 15.5, 8, 13}, q_pit[5] = {16, 15, 16, 20.3, 10};
    scene s[3];
    isogi_albedo_point glow[1] = {{0, {0.5f, 1, 2}}};
    static float points[3][60][3], expected[3][60], e[60][3];
    isogi_trace_desc d[3];
    int n = 60;
    s[0] = scene_make(64, 64, 64, NULL, ball_over_plane, q_plane), s[1] = scene_make(32, 32, 32, NULL, shell, q_shell),
    s[2] = scene_make(32, 32, 32, NULL, pit, q_pit);
    d[0] = feedback(&s[0], 0, 0, 0), d[1] = feedback(&s[1], 0.6f, -1, 0), d[2] = feedback(&s[2], 0.5f, -1, LONG_SUITE ? 4096 : 512);
    d[1].emission_points = glow, d[1].emission_count = 1, d[1].lighting.env.sh = NULL, d[1].lighting.env.sh_order = 0;
    for (int i = 0; i < n; i++) {
        double distance, x = 0.45 * i, z = -0.16 * i;
        points[0][i][0] = (float)(32 + x), points[0][i][1] = 12, points[0][i][2] = (float)(32 + z);
        distance = length3(x, 18, z), expected[0][i] = (float)(PI * (1 - 64 / (distance * distance) * 18 / distance));
        expected[1][i] = (float)(PI / (1 - 0.6));
    }
    n = surface_points(&s[2], 0, 60, 21, points[2]);
    CHECK(surface_points(&s[1], 0, 60, 22, points[1]) == n, "too few points");
    for (int i = 0; i < 60; i++) { /* onto the inner wall */
        double w[3], l = 0;
        for (int a = 0; a < 3; a++) w[a] = (double)points[1][i][a] - 15.5, l += w[a] * w[a];
        for (int a = 0; a < 3; a++) points[1][i][a] = (float)(15.5 + 8 * w[a] / sqrt(l));
    }
    d[2].method = ISOGI_TRACE_PATHS, d[2].lazy = 1, bake_and_sample(&d[2], NULL, (const float(*)[3])points[2], n, e);
    for (int i = 0; i < n; i++) expected[2][i] = e[i][1];
    for (int k = 0; k < 3; k++) {
        const char *name[3] = {"plane", "closed cavity", "pit"};
        for (int method = 0; method < 2; method++)
            for (int samples = 4; samples <= 64; samples *= 4) {
                if (samples == 64 && !LONG_SUITE) continue;
                d[k].method = (isogi_trace_method)method, d[k].samples = samples, d[k].lazy = 1;
                covered(name[k], d[k], (const float(*)[3])points[k], n, expected[k], 0.95);
            }
        for (int aim = LONG_SUITE ? 1 : 5; aim < 6; aim += aim == 1 ? 1 : 3) { /* 1, 2 and 5 % */
            d[k].method = ISOGI_TRACE_FEEDBACK, d[k].samples = 21844, d[k].error = 0.01f * (float)aim;
            covered(name[k], d[k], (const float(*)[3])points[k], n, expected[k], 0.95);
        }
        scene_free(&s[k]);
    }
}

/* What glows where it reflects, and what is lit by all of the sky through everything, is told as honestly: a ray brings both at once. */
SLOW_TEST(errors_of_what_glows_and_reflects_are_honest) {
    enum { POINTS = 80 };
    static float points[POINTS][3], e[POINTS][3], expected[POINTS];
    double q[1] = {0.5};
    scene s = scene_make(25, 25, 25, NULL, gyroid, q);
    isogi_albedo_point glow[1] = {{0, {1, 1, 1}}};
    CHECK(surface_points(&s, 0, POINTS, 5, points) == POINTS, "too few points, %d", POINTS);
    for (int k = 0; k < 2; k++) {
        isogi_trace_desc d = feedback(&s, 0.8f, 2, 2048);
        if (k) d.no_shadows = 1;
        else d.emission_points = glow, d.emission_count = 1, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0;
        d.lazy = 1, d.method = ISOGI_TRACE_PATHS;
        bake_and_sample(&d, NULL, (const float(*)[3])points, POINTS, e);
        for (int i = 0; i < POINTS; i++) expected[i] = e[i][1];
        d.method = ISOGI_TRACE_FEEDBACK;
        for (d.samples = 16; d.samples <= 64; d.samples *= 4)
            covered(k ? "no shadows" : "glow", d, (const float(*)[3])points, POINTS, expected, 0.93);
    }
    scene_free(&s);
}

/* Where finite data end in matter, nothing that is not finite passes as matter: a texel or a point there has none, and no light. */
TEST(what_is_not_finite_is_no_matter_on_the_high_side) {
    static float voxels[16 * 8 * 8];
    static const float sky[3] = {3.5449f, 3.5449f, 3.5449f}, points[2][3] = {{8, 4, 4}, {6, 4, 4}};
    const size_t texel[2][3] = {{8, 4, 4}, {6, 4, 4}};
    isogi_pyramid *pyramid = NULL;
    isogi_trace *t = NULL;
    float e[2][3], error[2];
    for (int i = 0; i < 16 * 8 * 8; i++) voxels[i] = i % 16 > 8 ? NAN : (float)(i % 16);
    const isogi_volume v = {.data = voxels, .type = ISOGI_F32, .size = {16, 8, 8}};
    CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
    const isogi_trace_desc d = {.pyramid = pyramid, .lighting = {.env = {.sh = sky, .sh_order = 1}}, .samples = 16,
                                .sides = ISOGI_TRACE_HIGH_SIDE};
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create");
    CHECK(!isogi_trace_valid(t, texel[0]) && isogi_trace_valid(t, texel[1]), "valid: %d, within %d", isogi_trace_valid(t, texel[0]),
          isogi_trace_valid(t, texel[1]));
    CHECK(isogi_trace_gather(&d, points, NULL, 2, e, error, NULL) == ISOGI_OK && e[0][1] <= 0 && isinf(error[0]) && isfinite(error[1]),
          "E %g +- %g, within %g +- %g", (double)e[0][1], (double)error[0], (double)e[1][1], (double)error[1]);
    isogi_trace_free(t), isogi_vol_free(pyramid);
}

/* Transfer that is lit through everything, and reflects: a path brings light at every vertex, and errors know that. */
TEST(errors_of_transfer_without_shadows_are_bounds) {
    enum { POINTS = 40, SEEDS = 6 };
    static float points[POINTS][3], e[SEEDS][POINTS][3], error[POINTS];
    double q[5] = {12, 12, 12, 16, 7}, spread = 0, told = 0;
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    isogi_trace_desc d = desc_make(&s, 0.95f, -1, 64);
    d.mode = ISOGI_TRACE_TRANSFER, d.order = 3, d.no_shadows = 1, d.lazy = 1;
    CHECK(surface_points(&s, 0, POINTS, 5, points) == POINTS, "too few points, %d", POINTS);
    for (int k = 0; k < SEEDS; k++) {
        isogi_trace *t = NULL;
        d.seed = (uint64_t)k;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, POINTS) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
        isogi_trace_sample(t, (const float(*)[3])points, POINTS, e[k], error);
        for (int i = 0; i < POINTS; i++) told += (double)error[i] * (double)error[i] / (SEEDS * POINTS);
        isogi_trace_free(t);
    }
    for (int i = 0; i < POINTS; i++) {
        double mean = 0;
        for (int k = 0; k < SEEDS; k++) mean += (double)e[k][i][1] / SEEDS;
        for (int k = 0; k < SEEDS; k++) spread += pow((double)e[k][i][1] - mean, 2) / ((SEEDS - 1) * POINTS);
    }
    CHECK(told > 0.7 * spread && told < 30 * spread, "told %g, spread %g", sqrt(told), sqrt(spread));
    scene_free(&s);
}

/* The error falls as the sampler promises: independent numbers would give a slope of -1/2 on a log-log plot; a (0,2)-sequence does better
   where the light is smooth (up to -1), and no worse at the shadows' borders. 60 points of a pit and of the plane below a ball, of the
   method that has no bias, and 4 seeds; the slope of a least-squares line over 4 .. 256 samples. */
SLOW_TEST(error_falls_with_the_samples) {
    double q_pit[5] = {16, 15, 16, 22.3, 12}, q_plane[5] = {16, 17, 16, 5, 7};
    for (int k = 0; k < 2; k++) {
        scene s = scene_make(32, 32, 32, NULL, k ? ball_over_plane : pit, k ? q_plane : q_pit);
        float points[60][3], reference[60][3], e[60][3];
        int n = surface_points(&s, 0, 60, 5, points);
        double xy = 0, xx = 0, error[4], mean = 0;
        isogi_trace_desc d = desc_make(&s, 0.5f, 2, LONG_SUITE ? 32768 : 2048);
        d.seed = 9;
        isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, reference, NULL, NULL);
        for (int i = 0; i < 4; i++) {
            d.samples = 4 << (2 * i), error[i] = 0;
            for (d.seed = 1; d.seed <= 4; d.seed++) {
                isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, NULL, NULL);
                for (int j = 0; j < n; j++) error[i] += pow((double)e[j][1] - (double)reference[j][1], 2) / (4 * n);
            }
            error[i] = sqrt(error[i]), mean += log(error[i]) / 4;
        }
        for (int i = 0; i < 4; i++) xy += (i - 1.5) * log(4) * (log(error[i]) - mean), xx += pow((i - 1.5) * log(4), 2);
        printf("    %s: errors %.4f %.4f %.4f %.4f, slope %.3f\n", k ? "plane" : "pit", error[0], error[1], error[2], error[3], xy / xx);
        CHECK(xy / xx > -1 && xy / xx < -0.5, "slope %.3f", xy / xx);
        scene_free(&s);
    }
}

/* What is to do falls as the work is done, in steps of one budget: nowhere is it told for long that nothing was done, and passes and
   what is written after the last ray have their share. The context's progress says the same. */
static int last_fraction(void *user, double fraction) {
    double *last = (double *)user;
    last[1] += fraction < last[0] || fraction > 1;
    last[0] = fraction;
    return 0;
}
TEST(remaining_falls_as_the_work_is_done) {
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    float points[300][3];
    int n = surface_points(&s, 0, 300, 9, points);
    for (int k = 0; k < 8; k++) {
        if (!LONG_SUITE && k > 1 && k < 6) continue;
        static double left[4000];
        double last[2] = {0, 0}, before = 1, off = 0;
        isogi_context context = {.progress = last_fraction, .user = last, .threads = 1};
        isogi_trace_desc d = feedback(&s, 0.7f, -1, k & 4 ? 4 : LONG_SUITE ? 40 : 20);
        isogi_trace *t = NULL;
        isogi_counters counters[2];
        int steps = 0, ended = 0, still = 0, most = 0, from = 0;
        d.lazy = k & 1, d.mode = k & 2 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, d.order = 2;
        d.isovalue_min = -0.3, d.isovalue_max = 0.3;
        memset(counters, 0, sizeof counters);
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "case %d", k);
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        for (left[0] = 1; left[steps] > 0 && steps < 3999; before = left[steps]) {
            if (isogi_trace_step(t, 400, &left[++steps]) != ISOGI_OK) abort();
            memset(&counters[1], 0, sizeof counters[1]), isogi_trace_counters(t, &counters[1]);
            if (counters[1].rays > counters[0].rays) ended = steps;
            counters[0] = counters[1];
            CHECK(left[steps] <= before && fabs(1 - last[0] - left[steps]) < 0.02, "case %d, step %d: %g to do, after %g, told %g", k,
                  steps, left[steps], before, last[0]);
        }
        for (int i = 1; i <= steps; i++) {
            off = fmax(off, fabs(1 - left[i] - (double)i / steps));
            if (left[from] - left[i] > 0.01) from = i;
            still = i - from, most = still > most ? still : most;
        }
        printf("    case %d: %d steps, %.2f from even, %.2f without any change, at the last ray %.3f to do\n", k, steps, off,
               (double)most / steps, left[ended]);
        CHECK(left[steps] <= 0 && !(last[1] > 0) && most < 0.15 * steps && left[ended] > 0.02,
              "case %d: %g off, %d of %d steps without a change, at the last ray %g to do, fell %g times", k, off, most, steps, left[ended],
              last[1]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Nor does it rise where more is asked for while levels are on their way, but by the request itself. */
static double ripples(const double p[3], const double *q) {
    (void)q;
    return sin(0.5 * p[0]) + sin(0.4 * p[1]) * cos(0.45 * p[2]);
}
TEST(remaining_falls_after_another_request) {
    scene s = scene_make(16, 16, 16, NULL, ripples, NULL);
    float points[400][3];
    test_random r = {7};
    for (int i = 0; i < 1200; i++) points[i / 3][i % 3] = (float)random_range(&r, 0, 15);
    for (int when = LONG_SUITE ? 1 : 15; when < (LONG_SUITE ? 40 : QUICK_SUITE ? 16 : 18); when++) {
        double last[2] = {0, 0}, before = 1, left = 1;
        isogi_context context = {.progress = last_fraction, .user = last, .threads = 1};
        isogi_trace_desc d = feedback(&s, 0.6f, -1, 84);
        isogi_trace *t = NULL;
        d.lazy = 1;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create");
        isogi_trace_request(t, (const float(*)[3])points, 200);
        for (int step = 1; left > 0 && step < 100000; step++, before = left) {
            if (step == 12 * when) isogi_trace_request(t, (const float(*)[3])points + 200, 200), before = 1, last[0] = 0;
            if (isogi_trace_step(t, 300, &left) != ISOGI_OK) abort();
            CHECK(left <= before, "request at step %d, step %d: %g to do, after %g", 12 * when, step, left, before);
        }
        CHECK(left <= 0 && !(last[1] > 0), "request at step %d: %g to do at the end, told less %g times", 12 * when, left, last[1]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* The report against all texels that can be read, each looked up at its own place: counts, light, mean and largest error, of one side or
   both, and of both levels of a hierarchy. Pits of one voxel, at every other coarse texel along each axis, leave a corner of every coarse
   cell without a surface, so that all fine texels are computed. TRANSFER: under a uniform sky. */
static double pitted_gyroid(const double p[3], const double *q) {
    return fmod(p[0], 4) == 2 && fmod(p[1], 4) == 2 && fmod(p[2], 4) == 2 ? -9 : gyroid(p, q);
}
static void report_by_texels(isogi_trace *t, isogi_trace_report *sum) {
    size_t lattice[3], at[3];
    isogi_trace_shape(t, lattice, NULL, NULL);
    for (at[2] = 0; at[2] < lattice[2]; at[2]++)
        for (at[1] = 0; at[1] < lattice[1]; at[1]++)
            for (at[0] = 0; at[0] < lattice[0]; at[0]++) {
                float point[1][3], e[1][3], error[1];
                double luminance;
                for (int a = 0; a < 3; a++) point[0][a] = (float)(8 * (double)at[a] / (double)(lattice[a] - 1));
                if (!isogi_trace_valid(t, at)) continue;
                isogi_trace_sample(t, (const float(*)[3])point, 1, e, error);
                luminance = 0.2126 * (double)e[0][0] + 0.7152 * (double)e[0][1] + 0.0722 * (double)e[0][2];
                sum->texels++, sum->light += luminance * luminance, sum->error += (double)error[0] * (double)error[0];
                sum->worst = fmax(sum->worst, (double)error[0]);
            }
}
TEST(report_is_that_of_all_texels) {
    double q[1] = {0.45};
    scene s = scene_make(9, 9, 9, NULL, pitted_gyroid, q);
    for (int k = 0; k < 16; k++) {
        isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 2, 0.3);
        isogi_trace_desc d = feedback(&s, 0.7f, k % 2 ? 2 : 0, 4);
        isogi_trace *t = NULL, *coarse = NULL;
        isogi_trace_report report, sum;
        d.method = k & 1 ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS, d.storage = ISOGI_TRACE_FLOAT;
        d.sides = k & 2 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE, d.hierarchy = k & 4 ? 0.2f : 0;
        d.mode = k & 8 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, d.albedo[1] = 0.5f;
        if (!d.mode) d.lighting.lights = &sun, d.lighting.light_count = 1;
        memset(&sum, 0, sizeof sum);
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
        report_by_texels(t, &sum);
        if (k & 2) report_by_texels(isogi_trace_high(t), &sum);
        if (k & 4) { /* the coarse texels alone */
            d.hierarchy = 0, d.lattice[0] = d.lattice[1] = d.lattice[2] = 5;
            CHECK(isogi_trace_create(&coarse, &d, NULL) == ISOGI_OK && isogi_trace_step(coarse, 0, NULL) == ISOGI_OK, "case %d", k);
            report_by_texels(coarse, &sum);
            if (k & 2) report_by_texels(isogi_trace_high(coarse), &sum);
        }
        sum.light = d.mode ? 0 : sqrt(sum.light / (double)sum.texels), sum.error = sqrt(sum.error / (double)sum.texels);
        isogi_trace_status(t, &report);
        CHECK(report.texels == sum.texels && sum.texels > 200 && !report.drafts, "case %d: %d texels, by lookups %d, %d drafts", k,
              (int)report.texels, (int)sum.texels, (int)report.drafts);
        CHECK(fabs(report.light - sum.light) <= 1e-4 * sum.light && fabs(report.error - sum.error) < 1e-4 * sum.error &&
                  fabs(report.worst - sum.worst) < 1e-4 * sum.worst,
              "case %d: light %g, errors %g and %g, by lookups %g, %g and %g", k, report.light, report.error, report.worst, sum.light,
              sum.error, sum.worst);
        isogi_trace_free(t), isogi_trace_free(coarse);
    }
    isogi_trace_desc single = desc_make(&s, 0.5f, 1, 1); /* one sample says nothing of its error */
    isogi_trace *t = NULL;
    isogi_trace_report report;
    CHECK(isogi_trace_create(&t, &single, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "a single sample, %d", 1);
    isogi_trace_status(t, &report);
    CHECK(isinf(report.error) && isinf(report.worst) && report.texels > 100, "errors %g, %g", report.error, report.worst);
    isogi_trace_free(t);
    scene_free(&s);
}

/* Boxes baked apart by feedback, whose borders lie within cubes and between them, are the same bits as the whole: loaded in any order, in
   steps, for both sides, adaptively. All texels of the cubes that a box meets are baked, no others. */
TEST(parts_by_feedback_are_the_whole) {
    double q[1] = {0.35};
    const size_t size[3] = {ISOGI_TRACE_CUBE + 9, LONG_SUITE ? 11 : QUICK_SUITE ? 4 : 6, ISOGI_TRACE_CUBE + 5};
    scene s = scene_make((int)size[0], (int)size[1], (int)size[2], NULL, gyroid, q);
    for (int k = QUICK_SUITE; k < (LONG_SUITE ? 5 : 2); k++) {
        isogi_trace_desc d = feedback(&s, 0.7f, k == 1 ? 2 : -1, k == 1 ? 4 : 3);
        isogi_trace *whole = NULL, *merged = NULL, *part = NULL;
        void *block[2] = {NULL, NULL};
        double remaining = 1;
        d.sides = k == 1 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE, d.error = k == 2 ? 0.1f : 0;
        d.mode = k == 3 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, d.order = 2;
        d.isovalue_min = k == 4 ? -0.1 : 0, d.isovalue_max = k == 4 ? 0.1 : 0;
        CHECK(isogi_trace_create(&whole, &d, NULL) == ISOGI_OK && isogi_trace_create(&merged, &d, NULL) == ISOGI_OK, "create, case %d", k);
        CHECK(isogi_trace_step(whole, 0, NULL) == ISOGI_OK, "step, case %d", k);
        for (int i = 3; i >= 0; i--) { /* cut within a cube along x, between two along z */
            for (int a = 0; a < 3; a++) d.box_first[a] = 0, d.box_end[a] = size[a];
            if (i & 1) d.box_first[0] = 40;
            else d.box_end[0] = 40;
            if (i & 2) d.box_first[2] = ISOGI_TRACE_CUBE;
            else d.box_end[2] = ISOGI_TRACE_CUBE;
            isogi_context context = {.threads = 1 + i % 2};
            isogi_trace_report report;
            uint64_t texels = 0;
            CHECK(isogi_trace_create(&part, &d, &context) == ISOGI_OK, "box %d, case %d", i, k);
            for (remaining = 1; remaining > 0;)
                if (isogi_trace_step(part, i & 2 ? 20000 : 0, &remaining) != ISOGI_OK) break;
            for (size_t n = 0; n < size[0] * size[1] * size[2]; n++) {
                const size_t texel[3] = {n % size[0], n / size[0] % size[1], n / size[0] / size[1]};
                int in = (texel[0] < ISOGI_TRACE_CUBE || (i & 1)) && (texel[2] < ISOGI_TRACE_CUBE) == !(i & 2);
                texels += (uint64_t)(in && isogi_trace_valid(whole, texel));
                texels += (uint64_t)(in && k == 1 && isogi_trace_valid(isogi_trace_high(whole), texel));
            }
            isogi_trace_status(part, &report);
            CHECK(remaining <= 0 && !report.drafts && (k == 4 ? report.texels < texels : report.texels == texels) && report.texels > 50,
                  "box %d, case %d: remaining %g, %d texels, not %d", i, k, remaining, (int)report.texels, (int)texels);
            size_t bytes = isogi_trace_save_size(part);
            block[0] = malloc(bytes);
            CHECK(isogi_trace_save(part, block[0], bytes) == ISOGI_OK && isogi_trace_load(merged, block[0], bytes) == ISOGI_OK,
                  "box %d, case %d", i, k);
            free(block[0]), isogi_trace_free(part);
        }
        isogi_counters none = {0};
        CHECK(isogi_trace_step(merged, 0, &remaining) == ISOGI_OK && remaining <= 0, "remaining %g, case %d", remaining, k);
        isogi_trace_counters(merged, &none);
        size_t bytes = isogi_trace_save_size(whole);
        CHECK(none.rays == 0 && bytes > 50000 && bytes == isogi_trace_save_size(merged), "%d rays after merging, %d bytes, case %d",
              (int)none.rays, (int)bytes, k);
        for (int i = 0; i < 2; i++) block[i] = malloc(bytes), isogi_trace_save(i ? merged : whole, block[i], bytes);
        CHECK(!memcmp(block[0], block[1], bytes), "other bits than of the whole, case %d", k);
        free(block[0]), free(block[1]), isogi_trace_free(whole), isogi_trace_free(merged);
    }
    scene_free(&s);
}

/* Texels of a glowing or pale range of isovalues lie beside those of a dark one, on other isosurfaces: its light is no part of theirs,
   however noisy. Neither probes nor the filter may mix them (mixed: 60 % and 20 % too much for the dark). Texels of a pit within a voxel
   of the border
   between two ranges, against paths. What the filter averages lies on one side of the border then, where the pit is half a voxel
   deeper: 8 %; noise of 4 samples at 100 texels: 3 %. */
SLOW_TEST(isovalues_of_other_colours_do_not_light_each_other) {
    double q[5] = {16, 15, 16, 22.3, 12};
    scene s = scene_make(32, 32, 32, NULL, pit, q);
    isogi_albedo_point glow[2] = {{0, {0, 0, 0}}, {0.001, {3, 3, 3}}},
                       albedo[2] = {{0, {0.05f, 0.05f, 0.05f}}, {0.001, {0.9f, 0.9f, 0.9f}}};
    static float points[2][400][3], e[400][3];
    int n[2] = {0, 0};
    for (int x = 4; x < 28; x++)
        for (int z = 4 + x % 3; z < 28; z += 3)
            for (int y = 4 + x % 2; y < 20; y += 2) {
                double p[3] = {x, y, z}, value = pit(p, q);
                float *to = points[value > 0][n[value > 0]];
                if (fabs(value) > 1 || length3(x - 16, y - 15, z - 16) > 14) continue;
                to[0] = (float)x, to[1] = (float)y, to[2] = (float)z, n[value > 0]++;
            }
    for (int kind = 0; kind < 2; kind++) {
        double mean[2][2] = {{0, 0}, {0, 0}};
        for (int method = 0; method < 2; method++) {
            isogi_trace_desc d = desc_make(&s, kind ? 0 : 0.5f, -1, method ? 64 : 4);
            isogi_trace *t = NULL;
            d.method = (isogi_trace_method)method, d.lazy = method, d.isovalue_min = -1, d.isovalue_max = 1;
            if (kind) d.albedo_points = albedo, d.albedo_count = 2;
            else d.emission_points = glow, d.emission_count = 2;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create");
            for (int side = 0; side < 2; side++) isogi_trace_request(t, (const float(*)[3])points[side], (size_t)n[side]);
            CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step");
            for (int side = 0; side < 2; side++) {
                isogi_trace_sample(t, (const float(*)[3])points[side], (size_t)n[side], e, NULL);
                for (int i = 0; i < n[side]; i++) mean[side][method] += (double)e[i][1] / n[side];
            }
            isogi_trace_free(t);
        }
        for (int side = 0; side < 2; side++) {
            double by_paths = mean[side][1];
            printf("    %s, %s: %d texels, E %.3f, by paths %.3f\n", kind ? "albedo" : "glow", side ? "bright" : "dark", n[side],
                   mean[side][0], by_paths);
            CHECK(n[side] > 100 && fabs(mean[side][0] - by_paths) < 0.12 * by_paths, "%s %d: E %.4f, by paths %.4f",
                  kind ? "albedo" : "glow", side, mean[side][0], by_paths);
        }
    }
    scene_free(&s);
}

static double distance_from(const double p[3], const double *q) { return length3(p[0] - q[0], p[1] - q[1], p[2] - q[2]); }

/* Every isosurface is a closed sphere that lights itself alone, hence E = pi e / (1 - albedo), whatever its neighbours' colours are: glow
   that falls to 0 within a voxel; albedo that rises to .9. */
SLOW_TEST(walls_of_many_colours_have_their_own_light) {
    static const struct { const char *what; double low, high, bound; } ways[2] = {
        {"glow by isovalue", 5.6, 6.4, 0.03}, {"albedo by isovalue", 6.6, 7.4, 0.032}};
    static const isogi_albedo_point glow[4] = {{5, {1, 2, 1}}, {5.8, {0, 3, 0.1f}}, {7.1, {0, 0, 0}}, {8.6, {0, 1.7f, 1.2f}}},
                                    white[1] = {{0, {1, 1, 1}}},
                                    albedo[3] = {{5, {0.1f, 0.2f, 0.9f}}, {7.1, {0.2f, 0.9f, 0.1f}}, {8.6, {0.9f, 0.1f, 0.3f}}};
    double q[3] = {10.9, 10.2, 10.2};
    scene s = scene_make(22, 22, 22, NULL, distance_from, q);
    for (int way = 0; way < 1 + LONG_SUITE; way++) {
        isogi_trace_desc d = {.pyramid = s.pyramid, .albedo = {0.3f, 0.8f, 0.7f}, .bounces = -1, .lookup = ISOGI_TRACE_NEAREST,
                              .samples = 64, .isovalue_min = ways[way].low, .isovalue_max = ways[way].high};
        isogi_trace *t = NULL;
        double square = 0, size = 0;
        int count = 0;
        if (way == 0) d.emission_points = glow, d.emission_count = 4;
        if (way == 1) d.emission_points = white, d.emission_count = 1, d.albedo_points = albedo, d.albedo_count = 3;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "%s", ways[way].what);
        for (size_t i = 0; i < 22 * 22 * 22; i++) {
            const float place[1][3] = {{(float)(i % 22), (float)(i / 22 % 22), (float)(i / 22 / 22)}};
            float e[1][3], error[1], reflected[3], sent[3];
            if ((double)s.data[i] < d.isovalue_min || (double)s.data[i] > d.isovalue_max) continue;
            CHECK(isogi_trace_sample(t, place, 1, e, error) == ISOGI_OK, "sample");
            if (!(error[0] < 1e30f)) continue;
            isogi_trace_material(&d, (double)s.data[i], NULL, reflected, sent);
            const double expected = PI * (double)sent[1] / (1 - (double)reflected[1]);
            square += pow((double)e[0][1] - expected, 2), size += expected * expected, count++;
        }
        printf("    %s: %d texels, %.4f off\n", ways[way].what, count, sqrt(square / size));
        CHECK(count > 100 && square < pow(ways[way].bound, 2) * size, "%s: %d texels, %.4f off", ways[way].what, count,
              sqrt(square / size));
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Colours finer than the cells of probes: what a ray brings has the albedo of the place that it met. In closed spheres that glow light is
   even, pi (1 + mean albedo) by one reflection and pi / (1 - mean albedo) by all. Chequers of .05 and .95, one voxel wide, cover half of
   each. With the albedo of the probes' places it was 4 and 16 % off, however many samples there were. */
static void chequers(void *user, double isovalue, const double p[3], float albedo[3], float emission[3]) {
    const int odd = ((int)floor(p[0]) + (int)floor(p[1]) + (int)floor(p[2])) & 1;
    (void)user, (void)isovalue;
    for (int c = 0; c < 3; c++) albedo[c] = odd ? 0.05f : 0.95f, emission[c] = 1;
}
SLOW_TEST(colours_finer_than_probes_are_those_of_hits) {
    double q[3] = {10.9, 10.2, 10.2};
    scene s = scene_make(22, 22, 22, NULL, distance_from, q);
    for (int all = 0; all < 2; all++) {
        isogi_trace_desc d = {.pyramid = s.pyramid, .material = chequers, .bounces = all ? -1 : 1, .lookup = ISOGI_TRACE_NEAREST,
                              .samples = 1024, .isovalue_min = 5.6, .isovalue_max = 6.4};
        const double expected = all ? 2 * PI : 1.5 * PI;
        isogi_trace *t = NULL;
        double square = 0;
        int count = 0, covered = 0;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bounces %d", d.bounces);
        for (size_t i = 0; i < 22 * 22 * 22; i++) {
            const float place[1][3] = {{(float)(i % 22), (float)(i / 22 % 22), (float)(i / 22 / 22)}};
            float e[1][3], error[1];
            if ((double)s.data[i] < d.isovalue_min || (double)s.data[i] > d.isovalue_max) continue;
            CHECK(isogi_trace_sample(t, place, 1, e, error) == ISOGI_OK, "sample");
            if (!(error[0] < 1e30f)) continue;
            const double apart = (double)e[0][1] - expected;
            square += apart * apart / expected / expected, covered += fabs(apart) < 2 * (double)error[0], count++;
        }
        printf("    bounces %d: %d texels, %.4f off, %.3f covered\n", d.bounces, count, sqrt(square / count), (double)covered / count);
        CHECK(count > 100 && sqrt(square / count) < (all ? 0.025 : 0.012), "bounces %d: %d texels, %.4f off", d.bounces, count,
              sqrt(square / count));
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* A round hollow whose mouth is shut by a skin of value 128: below that isosurfaces in it are closed and black, above it they see the
   sky, though they lie side by side. Neither may light the other. */
static double hollow_behind_a_skin(const double p[3], const double *q) {
    double r = sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[0]) * (p[1] - q[0]));
    double hollow = length3(r, 0, p[2] - 10) - 6, mouth = fmax(r - 4, 10 - p[2]), air = fmin(fmin(hollow, mouth), 21.5 - p[2]);
    double f = 130 + 20 * fmax(-3.5, fmin(3.5, air));
    return p[2] >= 18 && p[2] <= 19 && f < 128 ? 128 : f;
}
TEST(isovalues_beside_each_other_do_not_light_each_other) {
    enum { N = 28 };
    double q[1] = {13.5}, open[2] = {0, 0}, closed = 0, stated = 0;
    int opens = 0, shut = 0;
    scene s = scene_make(N, N, N, NULL, hollow_behind_a_skin, q);
    for (int method = 0; method < 2; method++) {
        isogi_trace_desc d = desc_make(&s, 0.8f, -1, 16);
        isogi_trace *t = NULL;
        d.method = (isogi_trace_method)method, d.lookup = ISOGI_TRACE_NEAREST;
        if (isogi_trace_create(&t, &d, NULL) != ISOGI_OK || isogi_trace_step(t, 0, NULL) != ISOGI_OK) abort();
        for (int i = 2 * N * N; i < 17 * N * N; i++) {
            size_t at[3] = {(size_t)(i % N), (size_t)(i / N % N), (size_t)(i / N / N)};
            float point[1][3] = {{(float)at[0], (float)at[1], (float)at[2]}}, e[1][3], error[1];
            if (length3((double)at[0] - 13.5, (double)at[1] - 13.5, (double)at[2] - 10) > 8 || !isogi_trace_valid(t, at)) continue;
            isogi_trace_sample(t, (const float(*)[3])point, 1, e, error);
            if (s.data[i] > 128) open[method] += (double)e[0][1], opens++;
            else if (!method) closed += (double)e[0][1], stated += (double)error[0], shut++;
        }
        isogi_trace_free(t);
    }
    CHECK(shut > 500 && opens > 1000, "%d closed texels, %d open ones", shut, opens);
    CHECK(closed / shut < 0.02 && closed < stated, "E %g on closed isosurfaces, stated error %g", closed / shut, stated / shut);
    CHECK(fabs(open[0] / open[1] - 1) < 0.05, "E %g on open isosurfaces, %g by paths", 2 * open[0] / opens, 2 * open[1] / opens);
    scene_free(&s);
}

/* The same where it matters: texels of a scan, full of hollows, against paths. Errors cover what they say they do: of 1500 texels, against
   3000 samples, 94 % are within two standard errors, 93 and 96 % of bakes that aim at 2 and 5 %; here there are 160. */
SLOW_TEST(errors_are_honest_on_a_scan) {
    enum { N = 32, POINTS = 160 };
    char *path = test_data("cthead8_256x256x99_uint8.raw");
    static uint8_t voxels[N][N][N];
    static const struct { int samples; float error; double least; } bake[4] = {
        {400, 0, 0}, {64, 0, 0.95}, {21844, 0.02f, 0.9}, {21844, 0.05f, 0.9}};
    static float points[POINTS][3], e[2][POINTS][3], error[2][POINTS];
    isogi_volume v;
    isogi_pyramid *pyramid;
    int count = 0;
    test_random r = {7};
    if (!path) SKIP("ISOGI_DATA is not set, or lacks cthead8");
    FILE *file = fopen(path, "rb");
    for (int z = 0; z < N; z++)
        for (int y = 0; y < N; y++) {
            long at = (128 - N / 2) + 256 * (128 - N / 2 + y + 256L * (49 - N / 2 + z));
            if (fseek(file, at, SEEK_SET) || fread(voxels[z][y], 1, N, file) != N) abort();
        }
    fclose(file), free(path);
    memset(&v, 0, sizeof v);
    v.data = voxels, v.type = ISOGI_U8, v.size[0] = v.size[1] = v.size[2] = N;
    if (isogi_vol_build(&pyramid, &v, NULL) != ISOGI_OK) abort();
    while (count < POINTS) {
        int x = (int)(N * random_unit(&r)), y = (int)(N * random_unit(&r)), z = (int)(N * random_unit(&r));
        if (abs(voxels[z][y][x] - 130) > 3) continue;
        points[count][0] = (float)x, points[count][1] = (float)y, points[count++][2] = (float)z;
    }
    for (int k = 0; k < 4; k++) { /* paths first */
        isogi_trace_desc d;
        isogi_trace *t = NULL;
        double square = 0, all = 0;
        int beyond = 0, found = 0;
        memset(&d, 0, sizeof d);
        d.pyramid = pyramid, d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1, d.bounces = -1, d.lookup = ISOGI_TRACE_NEAREST;
        d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.8f, d.method = k ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS;
        d.samples = bake[k].samples, d.error = bake[k].error, d.lazy = !k;
        if (k) d.isovalue_min = 127, d.isovalue_max = 133;
        if (isogi_trace_create(&t, &d, NULL) != ISOGI_OK) abort();
        isogi_trace_request(t, (const float(*)[3])points, POINTS), isogi_trace_step(t, 0, NULL);
        isogi_trace_sample(t, (const float(*)[3])points, POINTS, e[!!k], error[!!k]);
        isogi_trace_free(t);
        for (int i = 0; i < POINTS && k; i++) {
            double apart = (double)e[1][i][1] - (double)e[0][i][1];
            if (!test_finite((double)error[0][i]) || !test_finite((double)error[1][i])) continue;
            beyond += fabs(apart) > 2 * sqrt((double)error[0][i] * (double)error[0][i] + (double)error[1][i] * (double)error[1][i]);
            square += apart * apart, all += (double)e[0][i][1] * (double)e[0][i][1], found++;
        }
        if (!k) continue;
        printf("    aim %.2f: %.1f %% of %d texels are beyond two standard errors; rms difference %.4f\n", (double)bake[k].error,
               100.0 * beyond / found, found, sqrt(square / all));
        CHECK(found > POINTS / 2 && beyond <= (1 - bake[k].least) * found, "aim %g: %d of %d texels are beyond two standard errors",
              (double)bake[k].error, beyond, found);
    }
    isogi_vol_free(pyramid);
}

/* More samples go where the error is above the target: it is met everywhere, with fewer rays than the same number for all. */
TEST(adaptive_bakes_meet_their_target) {
    double q[5] = {32, 31, 32, 45, 20};
    scene s = scene_make(64, 64, 64, NULL, pit, q);
    static float points[400][3];
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 2, 0.1);
    int n = surface_points(&s, 0, LONG_SUITE ? 400 : 60, 9, points);
    isogi_counters c[2] = {{0}, {0}};
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        isogi_trace_desc d = feedback(&s, 0.5f, -1, 5460);
        isogi_trace *t = NULL;
        isogi_trace_report report;
        d.lazy = 1, d.lighting.lights = &sun, d.lighting.light_count = 1;
        if (adaptive) d.error = 0.02f;
        else d.samples = 340;
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step");
        isogi_trace_status(t, &report), isogi_trace_counters(t, &c[adaptive]);
        if (adaptive) CHECK(report.worst <= 0.0202 * report.unit && report.drafts == 0, "worst %g of %g", report.worst, report.unit);
        isogi_trace_free(t);
    }
    printf("    %g of %g rays\n", (double)c[1].rays, (double)c[0].rays);
    CHECK(c[1].rays * 4 < c[0].rays * 3, "%g rays, %g for all alike", (double)c[1].rays, (double)c[0].rays);
    scene_free(&s);
}

/* Of a full bake every texel with a surface is wanted, and none at the end; of one that is stopped, those that a save does not hold. */
TEST(what_is_wanted_is_what_is_missing) {
    double q[1] = {0.5};
    scene s = scene_make(12, 12, 12, NULL, gyroid, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
    isogi_trace *t = NULL;
    isogi_trace_report report;
    size_t beyond[3] = {0, 12, 0};
    double remaining = 1;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && !isogi_trace_wanted(NULL, beyond) && !isogi_trace_wanted(t, NULL) &&
              !isogi_trace_wanted(t, beyond),
          "arguments");
    for (int phase = 0; phase < 3; phase++) {
        size_t wanted = 0, valid = 0, odd = 0;
        if (phase) CHECK(isogi_trace_step(t, phase == 1 ? 1000 : 0, &remaining) == ISOGI_OK, "phase %d", phase);
        for (size_t i = 0; i < 12 * 12 * 12; i++) {
            size_t texel[3] = {i % 12, i / 12 % 12, i / 144};
            wanted += (size_t)isogi_trace_wanted(t, texel), valid += (size_t)isogi_trace_valid(t, texel);
            odd += isogi_trace_wanted(t, texel) && !isogi_trace_valid(t, texel);
        }
        isogi_trace_status(t, &report);
        CHECK(!odd && wanted + report.texels == valid && (wanted == 0) == (phase == 2), "phase %d: %zu wanted, %zu valid, %llu there",
              phase, wanted, valid, (unsigned long long)report.texels);
    }
    isogi_trace_free(t), scene_free(&s);
}

/* A lazy bake's first answers, of one channel: their errors know of it. */
TEST(drafts_of_any_colour_have_errors) {
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    float points[40][3], e[40][3], error[40];
    int n = surface_points(&s, 0, 40, 5, points);
    for (int c = 0; c < 3; c++) {
        isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0.2f, 1, 0.1f, 0, 0.3);
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 64);
        isogi_trace *t = NULL;
        int lit = 0;
        sun.rgb[c] = 3, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0, d.lighting.lights = &sun, d.lighting.light_count = 1;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = 1;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "%d", c);
        CHECK(isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK, "%d", c);
        isogi_trace_step(t, 350, NULL), isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
        for (int i = 0; i < n; i++) {
            lit += e[i][c] > 0;
            CHECK(!(e[i][c] > 0) || error[i] >= 0.5f * e[i][c], "channel %d: %g with error %g", c, (double)e[i][c], (double)error[i]);
        }
        CHECK(lit > 3, "channel %d: %d points are lit", c, lit);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* What was asked for is loaded while it is at work, at any place of it; what is asked for then is lit as in a texture that had all of it
   before, whatever memory held. */
static int memory_holds;
static void *held_alloc(void *user, size_t size, size_t align) {
    void *p = malloc(size);
    (void)user, (void)align; /* at most that of malloc here */
    return p ? memset(p, memory_holds, size) : p;
}
static void held_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }
TEST(requests_after_a_block_that_came_in_the_middle_of_work) {
    enum { POINTS = 300 };
    scene s = scene_make(16, 16, 16, NULL, ripples, NULL);
    static float points[2 * POINTS][3], e[POINTS][3], expected[POINTS][3], last[POINTS][3];
    const float(*more)[3] = (const float(*)[3])points + POINTS;
    const isogi_context context = {.threads = 1, .alloc = held_alloc, .release = held_release};
    const int n = surface_points(&s, 0, 2 * POINTS, 3, points);
    for (int bounces = -1; bounces < 1; bounces++) {
        isogi_trace_desc d = feedback(&s, 0.9f, bounces, bounces ? 8 : 4);
        isogi_trace *t = NULL;
        size_t size;
        uint8_t *block;
        double left = 1, apart, sum = 0, worst = 0;
        int differ = 0, steps = 0;
        d.lazy = 1;
        CHECK(n == 2 * POINTS && isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create");
        isogi_trace_request(t, (const float(*)[3])points, POINTS), isogi_trace_step(t, 0, NULL);
        size = isogi_trace_save_size(t), block = (uint8_t *)malloc(size);
        CHECK(isogi_trace_save(t, block, size) == ISOGI_OK, "save");
        isogi_trace_request(t, more, POINTS), isogi_trace_step(t, 0, NULL);
        isogi_trace_sample(t, more, POINTS, expected, NULL), isogi_trace_free(t);
        for (int i = 0; i < POINTS; i++) sum += pow((double)expected[i][1], 2);
        for (int before = 0; left > 0; before += QUICK_SUITE ? 12 : 3)
            for (memory_holds = 0; memory_holds < 0x100; memory_holds += 0x7f) {
                if (memory_holds > 0x7f) break;
                CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create");
                isogi_trace_request(t, (const float(*)[3])points, POINTS);
                for (left = 1, steps = 0; steps < before && left > 0; steps++) isogi_trace_step(t, bounces ? 1000 : 100, &left);
                CHECK(isogi_trace_load(t, block, size) == ISOGI_OK, "load");
                isogi_trace_request(t, more, POINTS), isogi_trace_step(t, 0, NULL);
                isogi_trace_sample(t, more, POINTS, e, NULL), isogi_trace_free(t);
                for (int i = apart = 0; i < POINTS; i++) apart += pow((double)e[i][1] - (double)expected[i][1], 2);
                if (!(apart <= worst)) worst = apart;
                if (memory_holds) differ += memcmp(e, last, sizeof e) != 0;
                memcpy(last, e, sizeof e);
            }
        CHECK(steps > 20 && !differ, "%d reflections, %d steps: %d by what memory held", bounces, steps, differ);
        CHECK(sqrt(worst / sum) < 0.08, "%d reflections: up to %g apart", bounces, sqrt(worst / sum));
        printf("    %d reflections: %d steps, up to %.3g apart\n", bounces, steps, sqrt(worst / sum));
        free(block);
    }
    scene_free(&s);
}

/* Where light fades so slowly that it is worked out at once, request after request: the same bits in slices. */
TEST(requests_of_slow_light_are_the_same_bits_in_slices) {
    enum { POINTS = 240, PARTS = 4 };
    double q[5] = {8, 8, 8, 5.2, 30};
    scene s = scene_make(17, 17, 17, NULL, shell, q);
    static float points[POINTS][3], e[2][POINTS][3];
    const int n = surface_points(&s, 0, POINTS, 3, points);
    for (int samples = 5; samples < 7; samples++) {
        isogi_trace_desc d = feedback(&s, 0.995f, -1, samples);
        const isogi_albedo_point glow = {0, {1, 1, 1}};
        d.lazy = 1, d.isovalue_min = -0.2, d.isovalue_max = 0.2, d.emission_points = &glow, d.emission_count = 1;
        for (int sliced = 0; sliced < 2; sliced++) {
            isogi_trace *t = NULL;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create");
            for (int part = 0; part < PARTS; part++) {
                double left = 1;
                isogi_trace_request(t, (const float(*)[3])points + n * part / PARTS, (size_t)(n / PARTS));
                while (left > 0 && isogi_trace_step(t, sliced ? 100 : 0, &left) == ISOGI_OK) {}
            }
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[sliced], NULL), isogi_trace_free(t);
        }
        CHECK(n == POINTS && !memcmp(e[0], e[1], sizeof e[0]), "%d samples: other light in slices", samples);
    }
    scene_free(&s);
}

/* A walk through a lazy texture: each request costs what it brings, however much was asked for before; light is that of one request for
   all, to the bit where none is reflected. */
static int by_x(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}
TEST(requests_cost_what_they_bring) {
    enum { POINTS = 1000, PARTS = 8 };
    scene s = scene_make(30, 20, 20, NULL, ripples, NULL);
    static float points[POINTS][3], e[2][POINTS][3];
    const int n = surface_points(&s, 0, POINTS, 3, points);
    qsort(points, POINTS, sizeof points[0], by_x);
    for (int bounces = 1; bounces >= -1; bounces--)
        for (int unfiltered = 0; unfiltered < 2; unfiltered++) {
            const int samples = bounces ? 4 : 36;
            isogi_trace_desc d = feedback(&s, 0.7f, bounces, samples);
            int steps[2] = {0, 0}, most = 0;
            double apart = 0, sum = 0;
            d.lazy = 1, d.unfiltered = unfiltered;
            for (int k = 0; k < 2; k++) {
                isogi_trace *t = NULL;
                CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create %d", k);
                for (int part = 0; part < (k ? PARTS : 1); part++) {
                    const int first = k ? n * part / PARTS : 0, end = k ? n * (part + 1) / PARTS : n;
                    double left = 1;
                    int some = 0;
                    isogi_trace_request(t, (const float(*)[3])points + first, (size_t)(end - first));
                    while (left > 0 && isogi_trace_step(t, 200, &left) == ISOGI_OK) some++;
                    steps[k] += some, most = k && some > most ? some : most;
                }
                isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[k], NULL);
                isogi_trace_free(t);
            }
            for (int i = 0; i < n; i++)
                apart += pow((double)e[1][i][1] - (double)e[0][i][1], 2), sum += pow((double)e[0][i][1], 2);
            apart = sqrt(apart / sum);
            printf("    %d samples, %d reflections: %d steps, in %d parts %d, up to %d each; %.3g apart\n", samples, bounces, steps[0],
                   PARTS, steps[1], most, apart);
            CHECK(n == POINTS && steps[1] < 1.3 * steps[0] && most < 2.5 / PARTS * steps[0], "%d, %d: %d steps, %d in all parts, up to %d",
                  bounces, unfiltered, steps[0], steps[1], most);
            CHECK(apart <= (bounces ? 0.15 : 0), "%d, %d: %g apart", bounces, unfiltered, apart);
        }
    scene_free(&s);
}

/* More points than are looked through together, by many tasks, most of them in cells of others before them: the texels of each alone. */
TEST(many_points_in_one_request) {
    enum { POINTS = 70000, PIECE = 1000 };
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    float (*points)[3] = (float(*)[3])malloc(POINTS * sizeof *points);
    isogi_trace_lookup lookup[2] = {ISOGI_TRACE_TRILINEAR, ISOGI_TRACE_BSPLINE};
    for (int i = 0; i < POINTS; i++) /* slices of the volume, one after the other; every seventh point on faces of cells */
        for (int a = 0; a < 3; a++) {
            unsigned bits = (unsigned)(3 * i + a) * 2654435761u;
            double x = 24 * (a == 2 ? (i / 2800 + (bits >> 8) / 16777216.0) / 25 : (bits >> 8) / 16777216.0);
            points[i][a] = (float)(i % 7 ? x : floor(x));
        }
    for (int l = 0; l < 2; l++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
        isogi_trace *one = NULL, *pieces = NULL;
        size_t wanted = 0, apart = 0;
        d.lazy = 1, d.lookup = lookup[l];
        CHECK(isogi_trace_create(&one, &d, NULL) == ISOGI_OK && isogi_trace_create(&pieces, &d, NULL) == ISOGI_OK, "created");
        CHECK(isogi_trace_request(one, (const float(*)[3])points, POINTS) == ISOGI_OK, "all at once");
        for (int i = 0; i < POINTS; i += PIECE)
            CHECK(isogi_trace_request(pieces, (const float(*)[3])points + i, PIECE) == ISOGI_OK, "from %d on", i);
        for (size_t i = 0; i < 25 * 25 * 25; i++) {
            size_t texel[3] = {i % 25, i / 25 % 25, i / 625};
            wanted += (size_t)isogi_trace_wanted(one, texel);
            apart += isogi_trace_wanted(one, texel) != isogi_trace_wanted(pieces, texel);
        }
        CHECK(wanted > 1000 && !apart, "lookup %d: of %zu texels %zu are wanted in one way alone", l, wanted, apart);
        isogi_trace_free(one), isogi_trace_free(pieces);
    }
    free(points), scene_free(&s);
}

/* Beside voxels that are not finite there is no smoothed normal, but a surface, which rays hit and light reaches. */
TEST(surfaces_beside_a_mask_are_lit) {
    double q[1] = {0.4};
    scene s = scene_make(24, 24, 24, NULL, gyroid, q);
    static float points[400][3], e[400][3], error[400];
    int n = 0, dark[2] = {0, 0};
    for (int i = 0; i < 24 * 24 * 24; i++) {
        const double x = i % 24 - 11.5, y = i / 24 % 24 - 11.5, z = i / 576 - 11.5;
        if (x * x + y * y + z * z < 60) s.data[i] = NAN;
    }
    isogi_vol_free(s.pyramid);
    if (isogi_vol_build(&s.pyramid, &s.volume, NULL) != ISOGI_OK) abort();
    n = surface_points(&s, 0, 400, 3, points);
    isogi_trace_desc d = desc_make(&s, 0, 0, 16);
    CHECK(isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, error, NULL) == ISOGI_OK, "gather");
    for (int i = 0; i < n; i++) dark[0] += !(error[i] < 1e30f);
    d.isovalue_min = -0.01, d.isovalue_max = 0.01;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
    for (int i = 0; i < n; i++) dark[1] += !(e[i][1] > 0);
    printf("    %d points: %d without light by gathering, %d by texels\n", n, dark[0], dark[1]);
    CHECK(n > 200 && !dark[0] && dark[1] <= n / 100, "%d points: %d without light by gathering, %d by texels", n, dark[0], dark[1]);
    scene_free(&s);
}

/* While anything remains to be done some texel is said to be wanted, of the second side, too, and afterwards none. Path-traced, a texel
   that is wanted has no light where it alone is read, one that is done has. */
TEST(what_remains_is_wanted) {
    double q[4] = {5, 5, 5, 3};
    scene s = scene_make(11, 11, 11, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
    for (int both = 0; both < 2; both++) {
        isogi_trace *t = NULL;
        double remaining = 1;
        int steps = 0, early = 0;
        d.sides = both ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "create");
        for (; remaining > 0 && steps < 10000; steps++) {
            size_t texel[3], wanted = 0;
            CHECK(isogi_trace_step(t, 400, &remaining) == ISOGI_OK, "step");
            for (texel[2] = 0; texel[2] < 11; texel[2]++)
                for (texel[1] = 0; texel[1] < 11; texel[1]++)
                    for (texel[0] = 0; texel[0] < 11; texel[0]++) {
                        const float at[1][3] = {{(float)texel[0], (float)texel[1], (float)texel[2]}};
                        const int is_wanted = isogi_trace_wanted(t, texel);
                        float e[1][3], error;
                        wanted += (size_t)is_wanted;
                        if (both || steps % 8 || !isogi_trace_valid(t, texel)) continue;
                        isogi_trace_sample(t, at, 1, e, &error), early += is_wanted;
                        CHECK(test_finite((double)error) == !is_wanted, "a texel that is %s has light of error %g",
                              is_wanted ? "wanted" : "done", (double)error);
                    }
            CHECK((wanted > 0) == (remaining > 0), "%d texels wanted, %g remain", (int)wanted, remaining);
        }
        CHECK(steps > 8 && (both || early > 100), "%d steps, %d texels seen early", steps, early);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* The memory of a texture of both sides is that of either. */
TEST(memory_counts_both_sides) {
    double q[4] = {5, 5, 5, 3};
    scene s = scene_make(11, 11, 11, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 1);
    isogi_trace *t = NULL, *both = NULL;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "low side");
    d.sides = ISOGI_TRACE_BOTH_SIDES;
    CHECK(isogi_trace_create(&both, &d, NULL) == ISOGI_OK && isogi_trace_step(both, 0, NULL) == ISOGI_OK, "both sides");
    const size_t low = isogi_trace_memory(t), high = isogi_trace_memory(isogi_trace_high(both)), all = isogi_trace_memory(both);
    CHECK(low > 1000 && high > 1000 && all == low + high, "%zu and %zu bytes, together %zu", low, high, all);
    isogi_trace_free(t), isogi_trace_free(both), scene_free(&s);
}

TEST_MAIN("trace_bake")
