/* How isogi_trace.h keeps numbers in few bits, draws directions, and comes by threads and large memory.
   This program looks inside isogi_trace.h and isogi_vol.h. FLAGS: -O0 */
#include <pthread.h>
static int created;
static int counted_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *arg) {
    created++;
    return pthread_create(thread, attributes, start, arg);
}
#define pthread_create counted_create
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#undef pthread_create
#include "test.h"
#include "trace_scenes.h"

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
