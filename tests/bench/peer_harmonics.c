/* isogi_sh.h beside other code, on one machine, one thread, turn by turn in one run: rows of bench_sh.c in units of a peer, so that goals
   stated in ns of one machine can be judged on another. `make bench-peers` builds and runs it.

       build/bench/peer_harmonics [CASE]        CASE: rows whose names begin so

   Peers: `generated`, straight-line code as Sloan's generator writes it (Efficient Spherical Harmonic Evaluation, JCGT 2013: constants
   folded, one term after the other, no loops), written anew here, in plain C and with 4 directions in a vector; `loops`, a matrix applied
   by plain loops; `sphericart` where SPHERICART names a folder with its include/sphericart.h and lib/libsphericart.so; `SHTns` where SHTNS
   names one with its shtns.h and libshtns.a, and fftw3 is installed. Not here for want of a peer in C: rotation to order 5, products,
   images.

   Nanoseconds an operation, data in cache, the shortest of many short runs. goal here: the peer's time here times the goal over that peer,
   both in ns of the machine that the goals were set on; of the goal: ours over it, and `reached` where that is not above 1. fill: memset
   of as many bytes, under which no evaluation goes on this core: a goal below it is out of reach here, and said to be. difference: the
   largest between results of the two (of evaluation; sphericart's floats are off by 2e-4 and 2e-2 at degrees 19 and 20). */
#include "isogi_sh.h"
#ifdef PEER_SPHERICART
#include <sphericart.h>
#endif
#ifdef PEER_SHTNS
#include <complex.h>
#include <fftw3.h>
#include <shtns.h>
#endif
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { COUNT = 128, ORDER = 21, N = ORDER * ORDER, MATRICES = 16 };
typedef float f4 __attribute__((vector_size(16)));

static __attribute__((aligned(64))) float directions[COUNT][3], soa[3][COUNT], ours[N * 16], theirs[N * 16], in[N],
    rotation[ISOGI_SH_ROTATION_COUNT(5)];
static __attribute__((aligned(64))) double directions64[COUNT][3], ours64[N * 16], theirs64[N * 16], in64[N], matrix64[MATRICES][9];
static int order;
static size_t count;

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- generated code: for each m the polynomials of z by Sloan's rules, all loops unrolled, constants in the order of their use ---- */

static float table_f32[2 * N];
static f4 table_f4[2 * N];
static double table_f64[2 * N];

static int entry(int at, double value) {
    table_f32[at] = (float)value, table_f64[at] = value;
    for (int k = 0; k < 4; k++) table_f4[at][k] = (float)value;
    return at + 1;
}

/* For each m the function of degree m is a constant, the next ones c z, a z^2 + b, z (a z^2 + b), all others follow by recursion. */
static void tabulate(void) {
    double diagonal = sqrt(1 / (4 * 3.14159265358979323846));
    int at = 0;
    for (int m = 0; m < order; m++) {
        double p[3][4] = {{0}}, a = 0, before; /* the last three in powers of z */
        if (m) diagonal *= sqrt((2 * m + 1.0) / (m == 1 ? 1 : 2 * m));
        for (int l = m; l < order; l++) {
            double *q = p[l % 3], *q1 = p[(l + 2) % 3], *q2 = p[(l + 1) % 3];
            before = a;
            if (l > m) a = sqrt((4.0 * l * l - 1) / (l * l - m * m));
            before = l > m + 1 ? a / before : 0;
            for (int k = 3; k >= 0 && l < m + 4; k--) q[k] = l == m ? (k ? 0 : diagonal) : (k ? a * q1[k - 1] : 0) - before * q2[k];
            if (l > m + 1) at = entry(at, l < m + 4 ? q[l - m] : a);
            at = entry(at, l < m + 4 ? q[(l - m) & 1] : -before);
        }
    }
}

#define PUT(l, value) \
    { \
        r = value, q = p, p = r; \
        out[(l) * (l) + (l) + m] = m ? p * c : p; \
        if (m) out[(l) * (l) + (l)-m] = p * s; \
    }
#define COLUMN(NAME, m) \
    if (m < n) t = NAME##_column(out, t, n, m, z, z2, c, s), next = x * c - y * s, s = x * s + y * c, c = next;
#define DEFINE_GENERATED(NAME, T, V)                                                                                                 \
    static inline __attribute__((always_inline)) const V *NAME##_column(V *out, const V *t, int n, int m, V z, V z2, V c, V s) {      \
        V p = t[0], q = p, r;                                                                                                          \
        PUT(m, t[0])                                                                                                                  \
        if (m + 1 < n) PUT(m + 1, t[1] * z)                                                                                           \
        if (m + 2 < n) PUT(m + 2, t[2] * z2 + t[3])                                                                                   \
        if (m + 3 < n) PUT(m + 3, z * (t[4] * z2 + t[5]))                                                                             \
        _Pragma("GCC unroll 32") for (int l = m + 4; l < n; l++) PUT(l, t[2 * (l - m) - 2] * z * p + t[2 * (l - m) - 1] * q)          \
        return t + (n - m > 2 ? 2 * (n - m) - 2 : n - m);                                                                             \
    }                                                                                                                                 \
    static inline __attribute__((always_inline)) void NAME##_all(V *out, int n, V x, V y, V z, const V *t) {                          \
        V z2 = z * z, c = x, s = y, next;                                                                                             \
        t = NAME##_column(out, t, n, 0, z, z2, c, s);                                                                                 \
        COLUMN(NAME, 1) COLUMN(NAME, 2) COLUMN(NAME, 3) COLUMN(NAME, 4) COLUMN(NAME, 5) COLUMN(NAME, 6) COLUMN(NAME, 7)               \
        COLUMN(NAME, 8) COLUMN(NAME, 9) COLUMN(NAME, 10) COLUMN(NAME, 11) COLUMN(NAME, 12) COLUMN(NAME, 13) COLUMN(NAME, 14)          \
        COLUMN(NAME, 15) COLUMN(NAME, 16) COLUMN(NAME, 17) COLUMN(NAME, 18) COLUMN(NAME, 19) COLUMN(NAME, 20)                         \
    }                                                                                                                                 \
    static __attribute__((noinline)) void NAME##5(V *out, V x, V y, V z) { NAME##_all(out, 5, x, y, z, table_##T); }                  \
    static __attribute__((noinline)) void NAME##11(V *out, V x, V y, V z) { NAME##_all(out, 11, x, y, z, table_##T); }                \
    static __attribute__((noinline)) void NAME##21(V *out, V x, V y, V z) { NAME##_all(out, 21, x, y, z, table_##T); }                \
    static void NAME(V *out, V x, V y, V z) {                                                                                         \
        if (order == 5) NAME##5(out, x, y, z);                                                                                        \
        else if (order == 11) NAME##11(out, x, y, z);                                                                                 \
        else NAME##21(out, x, y, z);                                                                                                  \
    }
DEFINE_GENERATED(generated, f32, float)
DEFINE_GENERATED(generated64, f64, double)
DEFINE_GENERATED(generated4, f4, f4)

/* ---- the rows ---- */

static void aos(void) { isogi_sh_eval(ours, order, (const float(*)[3])directions, count); }
static void aos64(void) { isogi_sh_eval_f64(ours64, order, (const double(*)[3])directions64, count); }
static void structure(void) { isogi_sh_eval_soa(ours, order, soa[0], soa[1], soa[2], count); }
static void generated_aos(void) {
    for (size_t i = 0; i < count; i++)
        generated(theirs + (size_t)(order * order) * i, directions[i][0], directions[i][1], directions[i][2]);
}
static void generated_aos64(void) {
    for (size_t i = 0; i < count; i++)
        generated64(theirs64 + (size_t)(order * order) * i, directions64[i][0], directions64[i][1], directions64[i][2]);
}
static void generated_structure(void) { /* of 4 directions each */
    for (size_t i = 0; i < count; i += 4)
        generated4((f4 *)(void *)(theirs + (size_t)(order * order) * i), *(f4 *)(void *)(soa[0] + i), *(f4 *)(void *)(soa[1] + i),
                   *(f4 *)(void *)(soa[2] + i));
}

static void zonal(void) {
    for (size_t i = 0; i < count; i++) isogi_sh_zonal_to_direction(ours + 25 * i, 5, in, directions[i]);
}
static void generated_zonal(void) {
    static const float scale[5] = {3.5449077f, 2.0466534f, 1.5853309f, 1.3398491f, 1.1816359f}; /* sqrt(4 pi / (2 l + 1)) */
    for (size_t i = 0; i < count; i++) {
        float *y = theirs + 25 * i;
        generated(y, directions[i][0], directions[i][1], directions[i][2]);
        for (int l = 0; l < 5; l++)
            for (int k = l * l; k < (l + 1) * (l + 1); k++) y[k] *= in[l] * scale[l];
    }
}

static void sum(void) { isogi_sh_eval_sum(ours, in, 5, 1, (const float(*)[3])directions, count); }
static void generated_sum(void) {
    for (size_t i = 0; i < count; i++) {
        float y[25], value = 0;
        generated(y, directions[i][0], directions[i][1], directions[i][2]);
        for (int k = 0; k < 25; k++) value += y[k] * in[k];
        theirs[i] = value;
    }
}

static void apply(void) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotation_apply(ours + 25 * i, in, 5, 1, rotation);
}
static void loops(void) {
    for (size_t i = 0; i < count; i++) {
        const float *r = rotation;
        for (int l = 0; l < 5; r += (2 * l + 1) * (2 * l + 1), l++)
            for (int k = 0; k <= 2 * l; k++) {
                float value = 0;
                for (int j = 0; j <= 2 * l; j++) value += r[(2 * l + 1) * j + k] * in[l * l + j]; /* columns */
                theirs[25 * i + (size_t)(l * l + k)] = value;
            }
    }
}

#ifdef PEER_SPHERICART
static sphericart_spherical_harmonics_calculator_f_t *calculator;
static sphericart_spherical_harmonics_calculator_t *calculator64;
static void sphericart_aos(void) {
    sphericart_spherical_harmonics_compute_array_f(calculator, directions[0], 3 * count, theirs, (size_t)(order * order) * count);
}
static void sphericart_aos64(void) {
    sphericart_spherical_harmonics_compute_array(calculator64, directions64[0], 3 * count, theirs64, (size_t)(order * order) * count);
}
#endif

#ifdef PEER_SHTNS
static shtns_rot rotator;
static double angles[MATRICES][3];
static complex double qlm[ORDER * ORDER], rlm[ORDER * ORDER];
static void rotate64(void) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotate_f64(ours64, in64, order, 1, matrix64[i]);
}
static void shtns_rotate(void) {
    for (size_t i = 0; i < count; i++) {
        shtns_rotation_set_angles_ZYZ(rotator, angles[i][0], angles[i][1], angles[i][2]);
        shtns_rotation_apply_real(rotator, qlm, rlm);
    }
}
#endif

typedef struct peer_case {
    const char *name, *peer;
    void (*ours)(void), (*theirs)(void);
    int order;
    size_t count;
    double goal, theirs_then; /* ns an operation, both on one machine */
} peer_case;

static const peer_case cases[] = {
    {"eval-aos-f32-L4", "generated", aos, generated_aos, 5, 128, 2.0, 3.6},
    {"eval-aos-f32-L10", "generated", aos, generated_aos, 11, 32, 12, 35},
    {"eval-aos-f32-L20", "generated", aos, generated_aos, 21, 16, 60, 148},
    {"eval-soa-f32-L4", "generated", structure, generated_structure, 5, 128, 0.9, 1.5},
    {"eval-soa-f32-L10", "generated", structure, generated_structure, 11, 32, 3.5, 9.3},
    {"eval-soa-f32-L20", "generated", structure, generated_structure, 21, 16, 20, 49},
    {"eval-aos-f64-L4", "generated", aos64, generated_aos64, 5, 64, 3, 4.2},
    {"eval-aos-f64-L10", "generated", aos64, generated_aos64, 11, 16, 20, 38},
    {"zonal-n5", "generated", zonal, generated_zonal, 5, 128, 8, 12},
    {"sum-n5", "generated", sum, generated_sum, 5, 128, 5, 16.6},
    {"rotate-apply-n5", "loops", apply, loops, 5, 128, 9, 78},
#ifdef PEER_SPHERICART
    {"eval-aos-f32-L4", "sphericart", aos, sphericart_aos, 5, 128, 2.0, 12},
    {"eval-aos-f32-L10", "sphericart", aos, sphericart_aos, 11, 32, 12, 73},
    {"eval-aos-f32-L20", "sphericart", aos, sphericart_aos, 21, 16, 60, 276},
    {"eval-aos-f64-L4", "sphericart", aos64, sphericart_aos64, 5, 64, 3, 0},
    {"eval-aos-f64-L10", "sphericart", aos64, sphericart_aos64, 11, 16, 20, 0},
#endif
#ifdef PEER_SHTNS
    {"rotate-once-n8", "SHTns", rotate64, shtns_rotate, 8, 16, 550, 588},
    {"rotate-once-n16", "SHTns", rotate64, shtns_rotate, 16, 16, 2500, 2719},
#endif
};

/* largest difference of results that stand at the same place, or, of structures of arrays, where each has them */
static double difference(const peer_case *c) {
    size_t n = c->ours == sum ? 1 : ISOGI_SH_COUNT(c->order);
    double worst = 0;
    for (size_t i = 0; i < c->count; i++)
        for (size_t k = 0; k < n; k++) {
            int wide = c->ours == aos64, columns = c->ours == structure;
            double a = wide ? ours64[n * i + k] : (double)ours[columns ? c->count * k + i : n * i + k];
            double b = wide ? theirs64[n * i + k] : (double)theirs[columns ? n * (i & ~(size_t)3) + 4 * k + i % 4 : n * i + k];
            worst = fmax(worst, fabs(a - b));
        }
    return worst;
}

static void fill(void) { memset(ours, (int)count, (size_t)(order * order) * count * sizeof *ours); }
static void fill64(void) { memset(ours64, (int)count, (size_t)(order * order) * count * sizeof *ours64); }

static void row(const peer_case *c) {
    int evaluates = c->ours == aos || c->ours == structure || c->ours == aos64, runs = evaluates ? 3 : 2;
    void (*const f[3])(void) = {c->ours, c->theirs, c->ours == aos64 ? fill64 : fill};
    double best[3] = {1, 1, 1}, begun, taken, goal;
    int loops = 1;
    c->ours(), c->theirs(); /* pages that are written for the first time take long */
    for (;; loops *= 2) {
        begun = cpu_seconds();
        for (int i = 0; i < loops; i++) c->ours();
        if (cpu_seconds() - begun > 5e-5) break;
    }
    for (int run = 0; run < 500 * runs; run++) {
        f[run % runs](); /* into the cache */
        begun = cpu_seconds();
        for (int i = 0; i < loops; i++) f[run % runs]();
        taken = 1e9 * (cpu_seconds() - begun) / (loops * (double)c->count);
        if (run < runs || taken < best[run % runs]) best[run % runs] = taken;
    }
    c->ours(), c->theirs(); /* for the difference */
    printf("%-18s %-12s %10.2f %10.2f %10.2f", c->name, c->peer, best[1], best[0], best[0] / best[1]);
    goal = c->theirs_then > 0 ? c->goal * best[1] / c->theirs_then : 0;
    if (goal > 0) printf(" %10.2f %10.2f", goal, best[0] / goal);
    else printf(" %10s %10s", "-", "-");
    if (evaluates) printf(" %8.2f", best[2]);
    else printf(" %8s", "-");
    if (c->order == 5 || c->order == 11 || c->order == 21) printf(" %11.2g", difference(c));
    else printf(" %11s", "-"); /* numbers of SHTns are complex */
    printf("  %s\n", goal <= 0 ? "" : best[0] <= goal ? "reached" : evaluates && goal < best[2] ? "goal below fill" : "not reached");
    fflush(stdout);
}

static double random_unit(void) { return 2.0 * rand() / RAND_MAX - 1; }

/* random directions, coefficients and rotations */
static void prepare(void) {
    srand(1);
    for (int i = 0; i < COUNT; i++) {
        double z = random_unit(), phi = 3.14159265358979323846 * random_unit(), s = sqrt(1 - z * z), d[3] = {s * cos(phi), s * sin(phi), z};
        for (int k = 0; k < 3; k++) directions64[i][k] = d[k], directions[i][k] = soa[k][i] = (float)d[k];
    }
    for (int i = 0; i < N; i++) in64[i] = random_unit(), in[i] = (float)in64[i];
    for (int i = 0; i < MATRICES; i++) {
        double a[3] = {3 * random_unit(), 1.5 + random_unit(), 3 * random_unit()};
        isogi_sh_matrix_from_euler_zyz_f64(matrix64[i], a[0], a[1], a[2]);
#ifdef PEER_SHTNS
        memcpy(angles[i], a, sizeof a);
#endif
    }
    float m[9];
    for (int k = 0; k < 9; k++) m[k] = (float)matrix64[0][k];
    isogi_sh_rotation_build(rotation, 5, m);
}

int main(int argc, char **argv) {
    const char *only = argc > 1 ? argv[1] : "";
    prepare();
    printf("%-18s %-12s %10s %10s %10s %10s %10s %8s %11s\n", "case", "peer", "peer, ns", "ours, ns", "ours/peer", "goal here", "of goal",
           "fill", "difference");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (strncmp(cases[i].name, only, strlen(only)) != 0) continue;
        order = cases[i].order, count = cases[i].count;
        tabulate();
#ifdef PEER_SPHERICART
        calculator = sphericart_spherical_harmonics_new_f((size_t)order - 1);
        calculator64 = sphericart_spherical_harmonics_new((size_t)order - 1);
        if (!calculator || !calculator64) return fprintf(stderr, "sphericart makes no calculator\n"), 1;
#endif
#ifdef PEER_SHTNS
        rotator = shtns_rotation_create(order - 1, order - 1, sht_orthonormal);
        for (int k = 0; k < order * order; k++) qlm[k] = in64[k] + (complex double)I * in64[N - 1 - k];
#endif
        row(&cases[i]);
#ifdef PEER_SPHERICART
        sphericart_spherical_harmonics_delete_f(calculator), sphericart_spherical_harmonics_delete(calculator64);
#endif
#ifdef PEER_SHTNS
        shtns_rotation_destroy(rotator);
#endif
    }
    return 0;
}
