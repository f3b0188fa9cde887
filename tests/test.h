/* The test runner: one file of tests is one program.

       #include "test.h"
       TEST(dot_is_symmetric) { CHECK(a == b, "a %g b %g", a, b); }
       TEST_MAIN("sh")

   build/tests/test_sh [--quick | --long] [--list] [FILTER]

   A test passes when none of its CHECKs fails; each failing CHECK prints its place, its condition and the
   values it was given (the first few of a test, then a count). SKIP("why") ends a test that cannot run here.
   LONG_SUITE is true under --long, in `make check`: tests then use their full sizes. QUICK_SUITE is true under --quick, in `make test`:
   some are smaller yet, and SLOW_TESTs, which take long for what they find, are left out. With neither, as programs are built
   by other compilers and sanitizers in `make check`, all tests run at sizes between. The last line is "N passed, N failed, N skipped",
   which is also written to the file named by ISOGI_TEST_SUMMARY, where that is set, for `make test` to add up. A test that
   crashes is named; the program then ends without counts, which `make test` counts as a failure. */
#ifndef ISOGI_TEST_H
#define ISOGI_TEST_H

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct test_case {
    const char *name;
    void (*run)(void);
    int slow;
    struct test_case *next;
} test_case;

static test_case *test_first, **test_last = &test_first;
static int test_failures, test_skipped, LONG_SUITE, QUICK_SUITE;
static jmp_buf test_leave;

#define TEST(name) TEST_AS(name, 0)
#define SLOW_TEST(name) TEST_AS(name, 1)
#define TEST_AS(name, is_slow)                                                                     \
    static void test_body_##name(void);                                                            \
    static test_case test_case_##name = {#name, test_body_##name, is_slow, NULL};                  \
    __attribute__((constructor)) static void test_register_##name(void) {                          \
        *test_last = &test_case_##name;                                                            \
        test_last = &test_case_##name.next;                                                        \
    }                                                                                              \
    static void test_body_##name(void)

/* Whether what is said of a description names something that the change to it, as C text, names, too. */
static inline int fault_names(const char *fault, const char *change) {
    const char *word = "abcdefghijklmnopqrstuvwxyz_0123456789";
    size_t length;
    for (; fault && *change; change += length ? length : 1) {
        length = strspn(change, word);
        for (const char *at = fault; length > 1 && *at; at += strspn(at, word) + (strspn(at, word) == 0))
            if (strspn(at, word) == length && !memcmp(at, change, length)) return 1;
    }
    return 0;
}

/* CHECK(condition, "format", values...): the format and its values are printed when the condition is false */
#define CHECK(condition, ...)                                                                      \
    do {                                                                                           \
        if (!(condition)) test_fail(__FILE__, __LINE__, #condition, __VA_ARGS__);                  \
    } while (0)

#define SKIP(why)                                                                                  \
    do {                                                                                           \
        printf("    skipped: %s\n", why);                                                          \
        test_skipped = 1;                                                                          \
        longjmp(test_leave, 1);                                                                    \
    } while (0)

__attribute__((format(printf, 4, 5))) static void test_fail(const char *file, int line, const char *condition,
                                                            const char *format, ...) {
    if (test_failures++ < 8) {
        va_list values;
        va_start(values, format);
        printf("    %s:%d: not true: %s   (", file, line, condition);
        vprintf(format, values);
        printf(")\n");
        va_end(values);
    }
}

/* Random numbers for tests: splitmix64, so that every test is repeatable and seeded by its own number. */
/* Rays are tried on seven paths: 0 to 4 are those of isogi_context.force_path; 5 and 6 are of compact volumes, the best and the portable
   one. This is what force_path has to be. */
__attribute__((unused)) static int forced_path(int path) { return path < 5 ? path : 2 * (path - 5); }

typedef struct test_random { uint64_t state; } test_random;

__attribute__((unused)) static uint64_t random_bits(test_random *r) {
    uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}
__attribute__((unused)) static double random_unit(test_random *r) { return (double)(random_bits(r) >> 11) * 0x1p-53; }
__attribute__((unused)) static double random_range(test_random *r, double low, double high) {
    return low + (high - low) * random_unit(r);
}
__attribute__((unused)) static void random_direction(test_random *r, double d[3]) {
    double z = random_range(r, -1, 1), phi = random_range(r, 0, 6.283185307179586), s = sqrt(1 - z * z);
    d[0] = s * cos(phi), d[1] = s * sin(phi), d[2] = z;
}

/* By bits, since -ffast-math lets compilers take every number for finite. */
__attribute__((unused)) static int test_finite(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits >> 52 & 0x7ff) != 0x7ff;
}

/* Has denormal numbers flushed to zero, or not, as engines do on their threads; threads begin with what began them has. 0: not here. */
#if defined(__SSE2__) && !defined(__FAST_MATH__)
#include <xmmintrin.h>
__attribute__((unused)) static int flush_denormals(int flush) {
    _mm_setcsr((_mm_getcsr() & ~0x8040u) | (flush ? 0x8040u : 0));
    return 1;
}
#else
__attribute__((unused)) static int flush_denormals(int flush) { return (void)flush, 0; }
#endif

/* Bounds of rounding errors are for arithmetic as it is written; -ffast-math changes the order of sums. */
#ifdef __FAST_MATH__
#define ROUNDING_FACTOR 4
#else
#define ROUNDING_FACTOR 1
#endif

/* The path of a file of real data below ISOGI_DATA, or NULL where there is none: SKIP then. The caller frees it. */
__attribute__((unused)) static char *test_data(const char *name) {
    const char *folder = getenv("ISOGI_DATA");
    if (!folder || !*folder) return NULL;
    size_t length = strlen(folder) + strlen(name) + 2;
    char *path = (char *)malloc(length);
    snprintf(path, length, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    if (!file) { free(path); return NULL; }
    fclose(file);
    return path;
}

/* Says which test crashed, then lets the signal do its work. Sanitizers have handlers of their own, which say more. */
static const char *test_suite, *test_running;
static struct timespec test_started;
__attribute__((unused)) static void test_crashed(int number) {
    fprintf(stderr, "FAIL %s.%s: crashed (signal %d)\n", test_suite, test_running, number);
    signal(number, SIG_DFL);
    raise(number);
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TEST_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define TEST_SANITIZED 1
#endif
#endif

/* One test, and how it ended: 0 passed, 1 failed, 2 skipped. A function of its own, so that longjmp finds nothing to spoil. */
static int test_run(const test_case *t) {
    struct timespec end;
    test_failures = test_skipped = 0;
    test_running = t->name;
    clock_gettime(CLOCK_MONOTONIC, &test_started);
    if (!setjmp(test_leave)) t->run();
    clock_gettime(CLOCK_MONOTONIC, &end);
    double seconds = (double)(end.tv_sec - test_started.tv_sec) + 1e-9 * (double)(end.tv_nsec - test_started.tv_nsec);
    if (test_failures > 8) printf("    ... %d failing checks in all\n", test_failures);
    printf("%s %s.%s (%.2f s)\n", test_failures ? "FAIL" : test_skipped ? "skip" : "ok  ", test_suite, test_running, seconds);
    return test_failures ? 1 : test_skipped ? 2 : 0;
}

static int test_main(const char *suite, int argc, char **argv) {
    const char *filter = NULL, *summary = getenv("ISOGI_TEST_SUMMARY");
    int count[3] = {0, 0, 0};
    char counts[80];
    setvbuf(stdout, NULL, _IOLBF, 0);
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--long")) LONG_SUITE = 1;
        else if (!strcmp(argv[i], "--quick")) QUICK_SUITE = 1;
        else if (!strcmp(argv[i], "--list")) {
            for (test_case *t = test_first; t; t = t->next) printf("%s.%s\n", suite, t->name);
            return 0;
        } else if (argv[i][0] == '-') {
            fprintf(stderr, "usage: %s [--quick | --long] [--list] [FILTER]\n", argv[0]);
            return 2;
        } else filter = argv[i];
    }
    test_suite = suite;
#ifndef TEST_SANITIZED
    const int crashes[] = {SIGSEGV, SIGABRT, SIGFPE, SIGILL};
    for (int i = 0; i < 4; i++) signal(crashes[i], test_crashed);
#endif
    for (test_case *t = test_first; t; t = t->next)
        if (!(QUICK_SUITE && t->slow) && (!filter || strstr(t->name, filter))) count[test_run(t)]++;
    if (filter && !(count[0] + count[1] + count[2])) {
        fprintf(stderr, "%s: no test's name contains \"%s\"\n", argv[0], filter);
        return 2;
    }
    snprintf(counts, sizeof counts, "%d passed, %d failed, %d skipped", count[0], count[1], count[2]);
    if (summary && *summary) {
        FILE *file = fopen(summary, "a");
        if (file) fprintf(file, "%s\n", counts), fclose(file);
        printf("%s: ", suite);
    }
    printf("%s\n", counts);
    return count[1] ? 1 : 0;
}

#define TEST_MAIN(suite) int main(int argc, char **argv) { return test_main(suite, argc, argv); }

#endif
