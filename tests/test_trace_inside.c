/* How isogi_trace.h keeps numbers in few bits, draws directions, fits light to texels, and comes by threads and large memory.
   This program looks inside isogi_trace.h.
   FLAGS: -O0
   LIBS: -Wl,--wrap=pthread_create */
#include <pthread.h>
#include <sys/mman.h>
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"

/* The linker has all threads of isogi_vol.h, which others have theirs by, created here. */
int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *arg);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *arg);
static int created;
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *arg) {
    created++;
    return __real_pthread_create(thread, attributes, start, arg);
}
#include "test.h"
#include "trace_scenes.h"

/* ---- numbers ---- */

/* Within half a step of the largest channel, over all magnitudes; what was unpacked packs to itself; never NaN, never infinite. */
TEST(rgb9e5_is_within_half_a_step) {
    test_random r = {3};
    for (int i = 0; i < (LONG_SUITE ? 1000000 : 100000); i++) {
        float rgb[3], back[3], again[3];
        double most = 0;
        for (int c = 0; c < 3; c++)
            rgb[c] = (float)(ldexp(random_unit(&r), (int)random_range(&r, -30, 17))), most = fmax(most, (double)rgb[c]);
        if (i % 100 == 0) rgb[0] = i % 200 ? (float)nan_value() : -1, most = fmax((double)rgb[1], (double)rgb[2]);
        uint32_t packed = isogi_trace__to_rgb9e5(rgb);
        isogi_trace__from_rgb9e5(packed, back);
        double step = fmax(most / 255.5, 1.0 / 16777216); /* 511.5 steps and more round up to the next exponent */
        for (int c = 0; c < 3; c++) {
            double x = rgb[c] > 0 ? fmin((double)rgb[c], 65408) : 0;
            if (c == 0 && i % 100 == 0) x = 0;
            CHECK(back[c] >= 0 && (double)back[c] <= 65408 && fabs((double)back[c] - x) <= 0.5 * step * 1.0000001, "%g of %g: %g", x, most,
                  (double)back[c]);
        }
        isogi_trace__from_rgb9e5(isogi_trace__to_rgb9e5(back), again);
        CHECK(!memcmp(back, again, sizeof back), "%g becomes %g", (double)back[0], (double)again[0]);
    }
}

TEST(errors_are_kept_rounded_up) {
    test_random r = {4};
    for (int i = 0; i < 10000; i++) {
        float x = (float)ldexp(random_unit(&r), (int)random_range(&r, -40, 40)),
              y = isogi_trace__bits_float(isogi_trace__to_short(x) << 16);
        CHECK(y >= x && (double)y <= (double)x * (1 + 1.0 / 127), "%g is kept as %g", (double)x, (double)y);
    }
    CHECK(isogi_trace__to_short(0) == 0 && isogi_trace__to_short(HUGE_VALF) == 0x7f80 && isogi_trace__to_short(3.4e38f) == 0x7f80,
          "ends, %d", 0);
}

/* What directions are drawn by: against the functions of <math.h>, and against the definition of the sequence. */
TEST(circle_is_that_of_cos_and_sin) {
    for (int i = 0; i <= 40000; i++) {
        double u = i / 40000.0, c, s;
        isogi_trace__circle(u, &c, &s);
        CHECK(fabs(c - cos(2 * PI * u)) < 1e-11 && fabs(s - sin(2 * PI * u)) < 1e-11, "%g: %.15g %.15g", u, c, s);
    }
}

/* Without a scramble: u[0] is the radical inverse in base 2; u[1] is made of columns each of which is the one before, plus itself shifted
   by one (the second dimension of Sobol's sequence). */
TEST(sobol_is_that_of_its_columns) {
    const isogi_trace__sequence plain = {{0, 0}};
    for (uint32_t i = 0; i < 5000; i++) {
        uint32_t index = i < 4096 ? i : i * 2654435761u, first = 0, second = 0, column = 0x80000000u;
        double u[2], v[2];
        for (uint32_t rest = index, bit = 0x80000000u; rest; rest >>= 1, bit >>= 1, column ^= column >> 1)
            if (rest & 1) first |= bit, second ^= column;
        isogi_trace__sobol(&plain, index, u);
        v[0] = isogi_trace__scramble(isogi_trace__reverse(first), 0), v[1] = isogi_trace__scramble(isogi_trace__reverse(second), 0);
        CHECK(!memcmp(u, v, sizeof u), "%u: %g %g, expected %g %g", index, u[0], u[1], v[0], v[1]);
    }
}

/* ---- the filter: planes, and what texels share with one of them in its dense blocks ---- */

/* What is fitted is a plane: weights sum to 1, and where the texel itself counts for nothing, light that is linear in place comes out
   as it is, from texels on one side alone, too. */
TEST(planes_are_fitted_exactly) {
    for (int run = 0; run < 200; run++) {
        double weight[40], sum = 0, first[3] = {0, 0, 0};
        int apart[40][3], n = 8 + run % 32;
        for (int i = 0; i < n; i++) {
            uint64_t key = isogi_trace__mix((uint64_t)(64 * run + i + 1));
            weight[i] = 0.1 + isogi_trace__unit(key);
            for (int a = 0; a < 3; a++) apart[i][a] = (int)(isogi_trace__mix(key + (uint64_t)a) % 5) - (run % 2 ? 0 : 2);
        }
        double moment[10] = {0}, plane[4];
        for (int i = 0; i < n; i++) {
            const double w = weight[i], x = apart[i][0], y = apart[i][1], z = apart[i][2];
            const double of[10] = {1, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z};
            for (int a = 0; a < 10; a++) moment[a] += w * of[a];
        }
        isogi_trace__fit(moment, 1e-9, plane);
        for (int i = 0; i < n; i++) {
            weight[i] *= plane[0] + plane[1] * apart[i][0] + plane[2] * apart[i][1] + plane[3] * apart[i][2];
            sum += weight[i];
            for (int a = 0; a < 3; a++) first[a] += weight[i] * apart[i][a];
        }
        CHECK(fabs(sum - 1) < 1e-12, "run %d: weights sum to 1 %+g", run, sum - 1);
        for (int a = 0; a < 3; a++) CHECK(fabs(first[a]) < 1e-6, "run %d: axis %d: %g", run, a, first[a]);
    }
}

enum { DENSE_CENTRE = 3 + 10 * (3 + 10 * 3) };
static isogi_trace__dense dense;

/* A texel of a surface that faces z, without slope; its mean and luminance are light. */
static void dense_put(int x, int y, int z, int samples, double light, double variance) {
    const int row = 3 + y + 10 * (3 + z), at = 10 * row + 3 + x;
    dense.filled[row] = (uint16_t)(dense.filled[row] | 1u << (3 + x));
    dense.samples[at] = (float)samples, dense.share[at] = 1 / (float)samples, dense.steps[at] = 1, dense.normal[2][at] = 1;
    dense.luminance[at] = dense.mean[0][at] = dense.mean[1][at] = dense.mean[2][at] = (float)light;
    dense.variance[at] = dense.guessed[at] = (float)variance, dense.noise[at] = (float)(0.5 + 4.0 / samples);
    dense.albedo[0][at] = dense.albedo[1][at] = dense.albedo[2][at] = 0.5f;
}

/* All widths of vectors give the same bits, of blocks full and nearly empty, in one colour and in several. */
TEST(blends_are_the_same_bits_on_all_paths) {
    int shared = 0;
    for (int run = 0; run < 400; run++) {
        isogi_trace__blend one, other;
        memset(&dense, 0, sizeof dense), memset(&one, 0, sizeof one);
        dense.unit = 1, dense.tinted = run % 2;
        for (int i = 0; i < 1000; i++) {
            double u[12];
            for (int k = 0; k < 12; k++) u[k] = isogi_trace__unit(isogi_trace__mix((uint64_t)(12000 * run + 12 * i + k)));
            if (u[0] * 8 > 1 + run % 8) continue;
            dense.filled[i / 10] = (uint16_t)(dense.filled[i / 10] | 1u << i % 10);
            dense.samples[i] = (float)floor(1 + 20 * u[1] * u[1]), dense.share[i] = 1 / dense.samples[i];
            dense.high[i] = (float)u[2], dense.low[i] = (float)(1e-8 * u[3]);
            dense.steps[i] = (float)(1 + u[4]), dense.guessed[i] = (float)(0.2 * u[5]), dense.noise[i] = (float)(0.5 + u[6]);
            dense.normal[0][i] = (float)(0.5 * u[7]), dense.normal[2][i] = 0.9f, dense.luminance[i] = (float)(0.5 + 0.5 * u[8]);
            dense.lights[i] = (float)u[9], dense.variance[i] = (float)u[10];
            dense.hidden[i] = (float)u[1], dense.reflected[i] = (float)u[2];
            for (int a = 0; a < 3; a++)
                dense.mean[a][i] = (float)u[a], dense.albedo[a][i] = (float)u[8 - a], dense.glow[a][i] = (float)(0.1 * u[11 - a]);
        }
        for (int path = 0; path < 3; path++) { /* plain, vectors of 4, of 8 where the machine has them */
            static isogi_trace t;
            t.context.force_path = !path, t.wide = 0;
#if defined(__x86_64__) && defined(__GNUC__)
            t.wide = path == 2 && __builtin_cpu_supports("avx2");
#endif
            isogi_trace__blend_of(&t, &dense, DENSE_CENTRE + (size_t)run % 4 * 111, path ? &other : &one);
            if (!path) shared += one.alike > 0, other = one;
            CHECK(!memcmp(&one, &other, sizeof one), "run %d, path %d: %.9g %.9g", run, path, one.rgb[0], other.rgb[0]);
        }
    }
    CHECK(shared > 200, "%d texels share light", shared);
}

/* Two texels side by side tell no slope of their own: three samples a texel away say that light is even. Least squares of the light a
   here and slope s, with noise that hides the difference and weights 1 and w:  (0 - a) + w (1 - a - s) = 0,  w (1 - a - s) = 3 s. */
TEST(slopes_of_the_filter_have_a_penalty) {
    isogi_trace__blend b;
    double w = pow(1 / (1 + 1.0 / 24 / 8), 8);
    memset(&dense, 0, sizeof dense);
    dense_put(0, 0, 0, 4, 0, 10), dense_put(1, 0, 0, 4, 1, 10);
    isogi_trace__blend_plain(&dense, DENSE_CENTRE, &b);
    CHECK(fabs(b.rgb[0] - 3 / (4 + 3 / w)) < 1e-4, "light %g, expected %g", b.rgb[0], 3 / (4 + 3 / w));
}

/* One new sample among texels that have millions, on a slanted plane: the fit finds their linear light, and is worth no less than they are
   counted as, 10000 times as many samples each. */
TEST(many_samples_beside_few_can_be_fitted) {
    for (int run = 0; run < 20; run++) {
        isogi_trace__blend b;
        int count = 0;
        memset(&dense, 0, sizeof dense);
        for (int x = -3; x <= 3; x++)
            for (int y = -3; y <= 3; y++) {
                const int z = -x - y, own = !x && !y, many = (int)(isogi_trace__mix((uint64_t)(100 * run + 10 * x + y)) % 16777216);
                if (x * x + y * y + z * z > 12) continue;
                dense_put(x, y, z, own ? 1 : 1 + many, 1 + 0.1 * x - 0.05 * y, own ? 10 : 5);
                count++;
            }
        isogi_trace__blend_plain(&dense, DENSE_CENTRE, &b);
        CHECK(count > 12 && fabs(b.rgb[0] - 1) < 1e-3, "run %d: light %g of %d texels", run, b.rgb[0], count);
        CHECK(b.alike > 1e4 && isogi_trace__finite(b.alike), "run %d: worth %g samples", run, b.alike);
    }
}

/* ---- threads and memory ---- */

/* Some hundred parts on all threads, which are created once for a step and once for a request, or not at all where the context has a pool;
   without work for two, none are. */
TEST(steps_and_requests_keep_their_threads) {
    double q[1] = {0.35};
    scene s = scene_make(24, 24, 24, NULL, gyroid, q);
    static float points[4000][3];
    const int n = surface_points(&s, 0, 4000, 7, points);
    for (int own = 0; own < 2; own++) {
        isogi_context context = {.threads = 3};
        isogi_trace_desc d = desc_make(&s, 0.7f, -1, 8);
        isogi_trace *t = NULL;
        double remaining = 1;
        int most = 0, steps = 0, all = 0;
        if (own) CHECK(isogi_thread_pool_create(&context.thread_pool, 3, NULL) == ISOGI_OK, "pool %d", own);
        d.lazy = 1, d.method = ISOGI_TRACE_FEEDBACK, d.isovalue_min = -0.1, d.isovalue_max = 0.1;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "create %d", own);
        created = 0;
        CHECK(isogi_trace_request(t, (const float(*)[3])points, (size_t)n) == ISOGI_OK && created == 2, "request: %d threads", created);
        all += created;
        for (; remaining > 0; steps++, all += created) {
            created = 0;
            CHECK(isogi_trace_step(t, 20000, &remaining) == ISOGI_OK, "step %d", steps);
            most = created > most ? created : most;
        }
        printf("    %d steps, %d threads created in one of them, %d in all\n", steps, most, all);
        CHECK(steps > 3 && (own ? all == 2 : most == 2), "pool %d: %d steps, %d threads, %d in all", own, steps, most, all);
        created = 0;
        CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, 1) == ISOGI_OK && !created,
              "nothing to do: %d threads", created);
        isogi_trace_free(t), isogi_thread_pool_free(context.thread_pool);
    }
    scene_free(&s);
}

#ifdef MADV_HUGEPAGE
/* Whether the memory at p is to lie in huge pages ("hg" in what Linux says of it). */
static int is_marked(const void *p) {
    FILE *maps = fopen("/proc/self/smaps", "r");
    char line[512];
    int inside = 0, marked = 0;
    while (maps && fgets(line, sizeof line, maps)) {
        unsigned long first, end;
        if (sscanf(line, "%lx-%lx ", &first, &end) == 2) inside = (uintptr_t)p >= first && (uintptr_t)p < end;
        if (inside && !strncmp(line, "VmFlags:", 8)) marked = strstr(line, " hg") != NULL;
    }
    if (maps) fclose(maps);
    return marked;
}
#endif

/* From 4 MB on blocks begin with a huge page. */
TEST(large_blocks_ask_for_huge_pages) {
#ifdef MADV_HUGEPAGE
    const size_t page = 2097152;
    void *probe = mmap(NULL, 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    const int can = probe != MAP_FAILED && madvise(probe, 2 * page, MADV_HUGEPAGE) == 0 && is_marked(probe);
    if (probe != MAP_FAILED) munmap(probe, 2 * page);
    if (!can) SKIP("this system has no huge pages, or does not show them");
    for (size_t size = 2 * page; size < 6 * page; size += page - 1000) {
        char *p = (char *)isogi_allocate(NULL, 1, size);
        const int marked = is_marked(p);
        CHECK(marked && (uintptr_t)p % page == 0, "%zu bytes at %p: marked %d", size, (void *)p, marked);
        memset(p, 1, size);
        isogi_release(NULL, p, 1, size);
    }
#else
    SKIP("madvise knows no huge pages");
#endif
}

TEST_MAIN("trace_inside")
