/* Run time against error of isogi_sh.h.

       build/bench/bench_sh [--quick] [--only CASE] OUT.csv        --only: cases whose names begin so

   One thread, CPU seconds, data in cache, the shortest of many short runs, which is what the code takes where nothing else runs on the
   core; error is the largest absolute one against tests/reference_sh.h (128 bits). Errors are taken over poles, axes, directions 1e-8
   off them and random ones, of rotations over 16 of them, times over random ones. Methods: default is what a caller gets; plain and
   avx2 are the same calls held to a lower instruction level; fill, of evaluation, is memset of as many bytes: no evaluation on that
   core is faster. A table on stderr sets ours beside the goal and the best other library known (measured on one core of an AVX-512
   server, data in cache, whose clock is not known: sphericart's float evaluation took 12, 73 and 276 ns at degrees 4, 10 and 20 there).
   Cycles are ns times the clock that a chain of dependent operations shows beside the case, for comparing figures of different days.
   Cases truncation-*: what an order misses of three environments; build/bench/sh.svg shows them against the order. Cases ringing-*: how
   far the projection falls below zero, as a share of its highest value, without a window and with one as wide as the order. Cases
   light-*: one light of isogi_sh_project, by order; error as a share of the largest coefficient, against quadrature. `make bench-peers`
   measures peers here: it judges goals by ratio. */
static int bench_level = 99;
#define ISOGI_SH_LEVEL bench_level
#define ISOGI_SH_IMPLEMENTATION
#include "isogi_sh.h"
#include "reference_sh.h"
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { MAX_ORDER = 21, MAX_N = MAX_ORDER * MAX_ORDER, MAX_COUNT = 1024, HARD = 64, MATRICES = 16, WIDTH = 1024, HEIGHT = 512 };

static FILE *csv;
static int quick;
static const char *only = "";
static uint64_t random_state = 1;
static __attribute__((aligned(64))) float directions[MAX_COUNT][3], soa[3][MAX_COUNT], basis[MAX_N * MAX_COUNT], matrix[MATRICES][9],
    image[WIDTH * HEIGHT * 3];
static __attribute__((aligned(64))) double directions64[MAX_COUNT][3], basis64[MAX_N * MAX_COUNT], matrix64[MATRICES][9];
static float in[MAX_N * 64], in2[MAX_N * 64], out[MAX_N * 64];
static double in64[MAX_N], out64[MAX_N];
static float rotation[ISOGI_SH_ROTATION_COUNT(16)];
static double rotation64[ISOGI_SH_ROTATION_COUNT(16)];

static double random_unit(void) {
    uint64_t z = (random_state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* One case: `run` does `count` operations of order `order`; `error` measures them. */
typedef struct bench_case {
    const char *name, *unit;
    void (*run)(int order, size_t count);
    double (*error)(int order, size_t count);
    int order;
    size_t count;
    double peer, goal, bound; /* ns an operation: of the best other library known (on another machine; 0: of none), and to reach;
                                 largest error allowed */
} bench_case;

static double seconds_of(void (*run)(int order, size_t count), int order, size_t count) {
    double best = 1e9, begun, taken;
    int runs = quick ? 1000 : 5000, loops = 1;
    run(order, count); /* pages that are written for the first time take long */
    for (;;) {
        begun = cpu_seconds();
        for (int i = 0; i < loops; i++) run(order, count);
        taken = cpu_seconds() - begun;
        if (taken > 1e-4) break;
        loops *= 2;
    }
    if (taken > 3e-4) runs = runs / 10;
    for (int r = 0; r < runs; r++) {
        begun = cpu_seconds();
        for (int i = 0; i < loops; i++) run(order, count);
        taken = (cpu_seconds() - begun) / loops;
        if (taken < best) best = taken;
    }
    return best;
}

/* In GHz: a chain of multiplications (3 cycles) and additions (1), as processors of these years take for them. The clock of a shared
   machine may change by a factor of two within a run; this tells a slow clock from slow code. */
static double clock_ghz(void) {
    volatile uint64_t start = 3;
    double best = 1e9;
    for (int r = 0; r < 20; r++) {
        uint64_t x = start;
        double begun = cpu_seconds();
        for (uint64_t i = 0; i < 50000; i++) x = x * 0x9e3779b97f4a7c15u + i;
        double taken = cpu_seconds() - begun;
        start = x;
        if (taken < best) best = taken;
    }
    return 50000 * 4e-9 / best;
}

static void head(void) {
    fprintf(stderr, "  %-20s %-8s %11s %11s %6s %10s %13s %9s %9s  %s\n", "case", "method", "ours, ns", "cycles", "GHz", "goal, ns",
            "best peer", "error", "allowed", "status");
}

static void row(const bench_case *c, const char *method) {
    double before = clock_ghz(), seconds = seconds_of(c->run, c->order, c->count), clock = fmax(before, clock_ghz()),
           error = c->error(c->order, c->count);
    double ns = seconds / (double)c->count * 1e9;
    char status[64];
    fprintf(csv, "isogi_sh.h,%s,%s,,%.6g,%.6g,%zu,%s\n", c->name, method, seconds, error, c->count, c->unit);
    fflush(csv);
    if (!(error <= c->bound)) snprintf(status, sizeof status, "NOT EXACT");
    else if (ns <= c->goal) snprintf(status, sizeof status, "reached");
    else snprintf(status, sizeof status, "%.2f of the goal%s", ns / c->goal, ns < c->peer ? ", before the best peer" : "");
    fprintf(stderr, "  %-20s %-8s %11.2f %11.1f %6.2f %10.1f %13.1f %9.2g %9.2g  %s\n", c->name, method, ns, ns * clock, clock, c->goal,
            c->peer, error, c->bound, status);
}

/* ---- evaluation ---- */

/* times: of random directions, which come after the hard ones */
static void run_aos_f32(int order, size_t count) { isogi_sh_eval(basis, order, (const float(*)[3])directions + HARD, count); }
static void run_one_f32(int order, size_t count) { /* one direction a call */
    for (size_t i = 0; i < count; i++)
        isogi_sh_eval(basis + i * (size_t)(order * order), order, (const float(*)[3])directions + HARD + i, 1);
}
static void run_soa_f32(int order, size_t count) { isogi_sh_eval_soa(basis, order, soa[0] + HARD, soa[1] + HARD, soa[2] + HARD, count); }
static void run_aos_f64(int order, size_t count) { isogi_sh_eval_f64(basis64, order, (const double(*)[3])directions64 + HARD, count); }

/* errors: over all of them */
static double error_of_basis(int order, size_t count, int is_double, int is_soa, int one_a_call) {
    static quad expected[MAX_N];
    double worst = 0;
    size_t n = (size_t)(order * order);
    count = quick ? 256 : MAX_COUNT;
    if (is_double) isogi_sh_eval_f64(basis64, order, (const double(*)[3])directions64, count);
    else if (is_soa) isogi_sh_eval_soa(basis, order, soa[0], soa[1], soa[2], count);
    else if (!one_a_call) isogi_sh_eval(basis, order, (const float(*)[3])directions, count);
    else
        for (size_t i = 0; i < count; i++) isogi_sh_eval(basis + i * n, order, (const float(*)[3])directions + i, 1);
    for (size_t i = 0; i < count; i++) {
        quad d[3];
        for (int k = 0; k < 3; k++) d[k] = is_double ? (quad)directions64[i][k] : (quad)directions[i][k];
        reference_eval(expected, order, d);
        for (size_t k = 0; k < n; k++) {
            double error =
                fabs((double)(expected[k] - (is_double ? (quad)basis64[i * n + k] : (quad)basis[is_soa ? k * count + i : i * n + k])));
            if (!(error <= worst)) worst = error;
        }
    }
    return worst;
}
static void run_fill_f32(int order, size_t count) { memset(basis, (int)count, (size_t)(order * order) * count * sizeof *basis); }
static void run_fill_f64(int order, size_t count) { memset(basis64, (int)count, (size_t)(order * order) * count * sizeof *basis64); }

/* beside a case of evaluation: how long its bytes take to be written at all */
static void fill_row(const bench_case *c) {
    double seconds = seconds_of(c->run == run_aos_f64 ? run_fill_f64 : run_fill_f32, c->order, c->count);
    fprintf(csv, "isogi_sh.h,%s,fill,,%.6g,0,%zu,%s\n", c->name, seconds, c->count, c->unit);
    fprintf(stderr, "  %-20s %-8s %11.2f\n", c->name, "fill", seconds / (double)c->count * 1e9);
}

static double error_one_f32(int order, size_t count) { return error_of_basis(order, count, 0, 0, 1); }
static double error_aos_f32(int order, size_t count) { return error_of_basis(order, count, 0, 0, 0); }
static double error_soa_f32(int order, size_t count) { return error_of_basis(order, count, 0, 1, 0); }
static double error_aos_f64(int order, size_t count) { return error_of_basis(order, count, 1, 0, 0); }

/* ---- rotation: the reference evaluates the input at the direction rotated back, for poles, axes, directions 1e-8 off them and 32
   random ones, and the output at the direction ---- */

static quad sum_at(int order, const float *c, const double *c64, const quad d[3]) {
    static quad y[MAX_N];
    quad sum = 0;
    reference_eval(y, order, d);
    for (int i = 0; i < order * order; i++) sum += y[i] * (c64 ? (quad)c64[i] : (quad)c[i]);
    return sum;
}

static double error_of_rotation(int order, const double m[9], int is_double) {
    double worst = 0;
    for (int i = 0; i < HARD + 32; i++) { /* poles, axes and 1e-8 off them first */
        quad d[3], back[3];
        for (int k = 0; k < 3; k++) d[k] = (quad)directions64[i][k];
        for (int k = 0; k < 3; k++) back[k] = (quad)m[k] * d[0] + (quad)m[3 + k] * d[1] + (quad)m[6 + k] * d[2];
        quad difference = sum_at(order, out, is_double ? out64 : NULL, d) - sum_at(order, in, is_double ? in64 : NULL, back);
        worst = fmax(worst, fabs((double)difference));
    }
    return worst;
}

static void run_rotate_f32(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotate(out, in, order, 1, matrix[i % MATRICES]);
}
static void run_rotate_f64(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotate_f64(out64, in64, order, 1, matrix64[i % MATRICES]);
}

/* The largest error over all matrices. */
static double error_rotate_f32(int order, size_t count) {
    double m[9], worst = 0;
    (void)count;
    for (int i = 0; i < MATRICES; i++) {
        for (int k = 0; k < 9; k++) m[k] = (double)matrix[i][k];
        isogi_sh_rotate(out, in, order, 1, matrix[i]), worst = fmax(worst, error_of_rotation(order, m, 0));
    }
    return worst;
}
static double error_rotate_f64(int order, size_t count) {
    double worst = 0;
    (void)count;
    for (int i = 0; i < MATRICES; i++)
        isogi_sh_rotate_f64(out64, in64, order, 1, matrix64[i]), worst = fmax(worst, error_of_rotation(order, matrix64[i], 1));
    return worst;
}

static void run_build(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotation_build_f64(rotation64, order, matrix64[i % MATRICES]);
}
static double error_build(int order, size_t count) {
    double worst = 0;
    (void)count;
    for (int i = 0; i < MATRICES; i++) {
        isogi_sh_rotation_build_f64(rotation64, order, matrix64[i]), isogi_sh_rotation_apply_f64(out64, in64, order, 1, rotation64);
        worst = fmax(worst, error_of_rotation(order, matrix64[i], 1));
    }
    return worst;
}
static void run_apply(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_rotation_apply(out, in, order, 1, rotation);
}
static double error_apply(int order, size_t count) {
    double m[9], worst = 0;
    (void)count;
    for (int i = MATRICES; i-- > 0;) { /* the first stays for the next runs */
        for (int k = 0; k < 9; k++) m[k] = (double)matrix[i][k];
        isogi_sh_rotation_build(rotation, order, matrix[i]), isogi_sh_rotation_apply(out, in, order, 1, rotation);
        worst = fmax(worst, error_of_rotation(order, m, 0));
    }
    return worst;
}

/* ---- algebra ---- */

static void run_product(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_product(out, in, in2, order, 1);
}
static void run_product_batch(int order, size_t count) { isogi_sh_product(out, in, in2, order, count); }

/* by a product rule in 128 bits: equally spaced azimuths, and latitudes of Fejer's second rule, exact to degree 63 */
static double error_product(int order, size_t count) {
    static quad y[MAX_N], expected[MAX_N];
    double worst = 0, pi = 3.14159265358979323846;
    int n = order * order, latitudes = 63, longitudes = 3 * order;
    (void)count;
    for (int i = 0; i < n; i++) expected[i] = 0;
    for (int i = 0; i < latitudes; i++) {
        double theta = pi * (i + 1) / (latitudes + 1), weight = 0;
        for (int k = 1; k <= (latitudes + 1) / 2; k++) weight += sin((2 * k - 1) * theta) / (2 * k - 1);
        weight *= 4 * sin(theta) / (latitudes + 1);
        for (int j = 0; j < longitudes; j++) {
            double phi = 2 * pi * j / longitudes;
            quad d[3] = {(quad)(sin(theta) * cos(phi)), (quad)(sin(theta) * sin(phi)), (quad)cos(theta)}, a = 0, b = 0;
            reference_eval(y, order, d);
            for (int k = 0; k < n; k++) a += y[k] * (quad)in[k], b += y[k] * (quad)in2[k];
            for (int k = 0; k < n; k++) expected[k] += (quad)(weight * 2 * pi / longitudes) * a * b * y[k];
        }
    }
    for (int k = 0; k < n; k++) worst = fmax(worst, fabs((double)(expected[k] - (quad)out[k])));
    return worst;
}

static void run_zonal(int order, size_t count) {
    for (size_t i = 0; i < count; i++) isogi_sh_zonal_to_direction(out, order, in, directions[i]);
}
static double error_zonal(int order, size_t count) {
    static quad y[MAX_N];
    double worst = 0;
    for (size_t i = 0; i < count; i++) {
        quad d[3] = {(quad)directions[i][0], (quad)directions[i][1], (quad)directions[i][2]};
        isogi_sh_zonal_to_direction(out, order, in, directions[i]);
        reference_eval(y, order, d);
        for (int l = 0; l < order; l++)
            for (int k = l * l; k < (l + 1) * (l + 1); k++) {
                quad expected = y[k] * (quad)in[l] * quad_sqrt(4 * (quad)3.14159265358979323846 / (quad)(2 * l + 1));
                worst = fmax(worst, fabs((double)(expected - (quad)out[k])));
            }
    }
    return worst;
}

static void run_sum(int order, size_t count) { isogi_sh_eval_sum(out, in, order, 1, (const float(*)[3])directions, count); }
static double error_sum(int order, size_t count) {
    double worst = 0;
    for (size_t i = 0; i < count; i++) {
        quad d[3] = {(quad)directions[i][0], (quad)directions[i][1], (quad)directions[i][2]};
        worst = fmax(worst, fabs((double)(sum_at(order, in, NULL, d) - (quad)out[i])));
    }
    return worst;
}

/* ---- projection: of an image painted with a known expansion of order 5, whose coefficients are the answer ---- */

static void run_project(int order, size_t count) {
    (void)count;
    isogi_sh_project_equirect(out, order, image, WIDTH, HEIGHT);
}
static double error_project(int order, size_t count) {
    double worst = 0;
    (void)count;
    for (int i = 0; i < 3 * order * order; i++) worst = fmax(worst, fabs((double)out[i] - (i < 75 ? (double)in[i] : 0)));
    return worst;
}

/* ---- truncation: how much of an environment an order misses ---- */

/* root of the mean square of what a 256 x 128 image and the sum of its projection differ by at texels, as a share of the image's; and the
   deepest ring, below zero, against the brightest value of the projection, as it is and under a Hann window as wide as the order */
enum { ENV_W = 256, ENV_H = 128, HIGHEST = 32 };

static void paint(int kind, int i, int j, float rgb[3]) {
    double u = (i + 0.5) / ENV_W, v = (j + 0.5) / ENV_H, pi = 3.14159265358979323846, y = cos(pi * v),
           x = sin(pi * v) * sin(2 * pi * (u - 0.5));
    double z = -sin(pi * v) * cos(2 * pi * (u - 0.5)), sun = (x + y + z) / sqrt(3), sky = 0.5 + 0.5 * y;
    for (int k = 0; k < 3; k++) {
        if (kind == 0) rgb[k] = sun > cos(0.15) ? 50.0f : 0.1f * (float)(1 + k) * (float)sky; /* a small hard sun in a sky */
        else if (kind == 1) rgb[k] = y > 0 ? 1.0f : 0.0f;                                     /* a hemisphere: one long edge */
        else rgb[k] = (float)(exp(8 * (sun - 1)) * (1 + 0.2 * k) + 0.2 * sky + 0.3 * exp(12 * (-z - 1))); /* soft lamps */
    }
}

static double ring(const float *c, int order) {
    double lowest = 0, highest = 0;
    static float value[MAX_COUNT];
    isogi_sh_eval_sum(value, c, order, 1, (const float(*)[3])directions, MAX_COUNT);
    for (int i = 0; i < MAX_COUNT; i++) lowest = fmin(lowest, (double)value[i]), highest = fmax(highest, (double)value[i]);
    return lowest / highest;
}

/* the integral over the sphere of the square of what image and sum differ by at the texels' centres */
static double missed_square(const float *c, int order) {
    static float d[ENV_W][3], value[ENV_W * 3];
    const double edge = 3.14159265358979323846 / ENV_H;
    double sum = 0;
    for (int j = 0; j < ENV_H; j++) {
        const double area = (cos(edge * j) - cos(edge * (j + 1))) * 2 * 3.14159265358979323846 / ENV_W;
        for (int i = 0; i < ENV_W; i++) {
            const double phi = 2 * 3.14159265358979323846 * ((i + 0.5) / ENV_W - 0.5), t = edge * (j + 0.5);
            d[i][0] = (float)(sin(t) * sin(phi)), d[i][1] = (float)cos(t), d[i][2] = (float)(-sin(t) * cos(phi));
        }
        isogi_sh_eval_sum(value, c, order, 3, (const float(*)[3])d, ENV_W);
        for (int i = 0; i < 3 * ENV_W; i++) {
            const double off = (double)image[3 * ENV_W * j + i] - (double)value[i];
            sum += area * off * off;
        }
    }
    return sum;
}

static void truncation(void) {
    static const char *const names[] = {"truncation-sun", "truncation-hemisphere", "truncation-soft"};
    static const int orders[] = {2, 3, 4, 5, 6, 8, 11, 16, 23, 32};
    static float c[3 * HIGHEST * HIGHEST], single[HIGHEST * HIGHEST];
    fprintf(stderr, "\n  truncation: relative error in the mean of squares, and lowest value / highest, without and with a Hann window\n");
    for (int kind = 0; kind < 3; kind++) {
        double total = 0;
        for (int j = 0; j < ENV_H; j++)
            for (int i = 0; i < ENV_W; i++) {
                float *p = image + 3 * (j * ENV_W + i);
                double edge = 3.14159265358979323846 / ENV_H,
                       area = (cos(edge * j) - cos(edge * (j + 1))) * 2 * 3.14159265358979323846 / ENV_W;
                paint(kind, i, j, p);
                for (int k = 0; k < 3; k++) total += area * (double)p[k] * (double)p[k];
            }
        for (size_t o = 0; o < sizeof orders / sizeof *orders; o++) {
            double begun = cpu_seconds(), seconds, missed, plain, windowed;
            isogi_sh_project_equirect(c, orders[o], image, ENV_W, ENV_H);
            seconds = cpu_seconds() - begun;
            missed = sqrt(missed_square(c, orders[o]) / total);
            for (int i = 0; i < orders[o] * orders[o]; i++) single[i] = c[3 * i];
            plain = ring(single, orders[o]);
            isogi_sh_window(single, single, orders[o], 1, ISOGI_SH_HANN, orders[o]);
            windowed = ring(single, orders[o]);
            fprintf(csv, "isogi_sh.h,%s,%s,order %d,%.6g,%.6g,1,image\n", names[kind], orders[o] == 5 ? "default" : "other orders",
                    orders[o], fmax(seconds, 1e-9), missed);
            fprintf(csv, "isogi_sh.h,ringing-%s,%s,order %d,%.6g,%.6g,1,image\n", strchr(names[kind], '-') + 1,
                    orders[o] == 5 ? "default" : "no window", orders[o], fmax(seconds, 1e-9), fmax(0, -plain));
            fprintf(csv, "isogi_sh.h,ringing-%s,hann,order %d,%.6g,%.6g,1,image\n", strchr(names[kind], '-') + 1, orders[o],
                    fmax(seconds, 1e-9), fmax(0, -windowed));
            fprintf(stderr, "  %-22s order %2d   error %-9.3g ring %8.4f   windowed %8.4f\n", names[kind], orders[o], missed, plain,
                    windowed);
        }
    }
}

/* ---- lights: 16 of a kind, somewhere around the point ---- */

enum { LIGHTS = 16, NODES = 16, AROUND = 24 }; /* NODES: exact for degrees to 31; AROUND: to 23 */
static isogi_light some_lights[LIGHTS];
static const isogi_lighting some_lighting = {.lights = some_lights, .light_count = LIGHTS};
static quad light_expected[MAX_N], light_basis[MAX_N];

static void run_lights(int order, size_t count) { (void)count, isogi_sh_project(out, order, &some_lighting, NULL); }

static void add_light(quad weight, const double direction[3]) {
    quad d[3] = {(quad)direction[0], (quad)direction[1], (quad)direction[2]};
    reference_eval(light_basis, MAX_ORDER, d);
    for (int i = 0; i < MAX_N; i++) light_expected[i] += weight * light_basis[i];
}

static void gauss(double *node, double *weight, int n) {
    long double x[NODES], w[NODES];
    reference_nodes(x, w, n);
    for (int i = 0; i < n; i++) node[i] = (double)x[i], weight[i] = (double)w[i];
}

/* `radiance` within the angle whose half has the sine `half` of a direction */
static void add_cap(double radiance, const double axis[3], double half) {
    double node[NODES], weight[NODES], side[3], up[3], length;
    int least = fabs(axis[0]) < fabs(axis[1]) ? fabs(axis[0]) < fabs(axis[2]) ? 0 : 2 : fabs(axis[1]) < fabs(axis[2]) ? 1 : 2;
    for (int k = 0; k < 3; k++) side[k] = (k == least) - axis[least] * axis[k];
    length = sqrt(side[0] * side[0] + side[1] * side[1] + side[2] * side[2]);
    for (int k = 0; k < 3; k++) side[k] /= length;
    for (int k = 0; k < 3; k++) up[k] = axis[(k + 1) % 3] * side[(k + 2) % 3] - axis[(k + 2) % 3] * side[(k + 1) % 3];
    gauss(node, weight, NODES);
    for (int i = 0; i < NODES; i++)
        for (int j = 0; j < AROUND; j++) {
            double below = half * half * (1 + node[i]), s = sqrt(below * (2 - below)), phi = 2 * 3.14159265358979323846 * j / AROUND, d[3];
            for (int k = 0; k < 3; k++) d[k] = (1 - below) * axis[k] + s * (cos(phi) * side[k] + sin(phi) * up[k]);
            add_light((quad)(radiance * half * half * weight[i] * 2 * 3.14159265358979323846 / AROUND), d);
        }
}

static void add_rectangle(const isogi_light *l) {
    double node[NODES], weight[NODES], normal[3], area = 0;
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        normal[k] = (double)l->edge[0][a] * (double)l->edge[1][b] - (double)l->edge[0][b] * (double)l->edge[1][a];
        area += normal[k] * normal[k];
    }
    area = sqrt(area);
    gauss(node, weight, NODES);
    for (int i = 0; i < NODES; i++)
        for (int j = 0; j < NODES; j++) {
            double p[3], square = 0, facing = 0;
            for (int k = 0; k < 3; k++) {
                p[k] = (double)l->vector[k] + 0.5 * node[i] * (double)l->edge[0][k] + 0.5 * node[j] * (double)l->edge[1][k];
                square += p[k] * p[k], facing -= p[k] * normal[k] / area;
            }
            if (facing > 0) add_light((quad)((double)l->rgb[0] * weight[i] * weight[j] / 4 * facing / (square * sqrt(square))), p);
        }
}

/* kinds: 0 direction, 1 disc, 2 point, 3 sphere, 4 rectangle that faces the point */
static void place_lights(int kind) {
    static const isogi_light_kind kinds[] = {ISOGI_LIGHT_DIRECTIONAL, ISOGI_LIGHT_DIRECTIONAL, ISOGI_LIGHT_POINT, ISOGI_LIGHT_SPHERE,
                                             ISOGI_LIGHT_RECTANGLE};
    for (int i = 0; i < LIGHTS; i++) {
        const double *d = directions64[HARD + i];
        isogi_light *l = &some_lights[i];
        memset(l, 0, sizeof *l);
        l->kind = kinds[kind];
        l->radius = kind == 1 || kind == 3 ? (float)(0.05 + 0.4 * random_unit()) : 0;
        for (int k = 0; k < 3; k++) l->vector[k] = (float)(d[k] * (1 + random_unit())), l->rgb[k] = (float)(1 + k);
        if (kind < 4) continue;
        const float *v = l->vector;
        double a[3] = {(double)v[1], -(double)v[0], 0}, b[3], size = 0.2 + 0.8 * random_unit(), cross = 0, length = 0;
        for (int k = 0; k < 3; k++) length += a[k] * a[k];
        for (int k = 0; k < 3; k++) a[k] *= size / sqrt(length);
        for (int k = 0; k < 3; k++)
            b[k] = (double)v[(k + 1) % 3] * a[(k + 2) % 3] - (double)v[(k + 2) % 3] * a[(k + 1) % 3], cross += b[k] * b[k];
        for (int k = 0; k < 3; k++) l->edge[0][k] = (float)a[k], l->edge[1][k] = (float)(-b[k] * 0.5 * size / sqrt(cross));
        for (int k = 0; k < 3; k++) l->vector[k] += 0.3f * (l->edge[0][k] + l->edge[1][k]); /* not quite opposite */
    }
}

static void expect_lights(int kind) {
    for (int i = 0; i < MAX_N; i++) light_expected[i] = 0;
    for (int i = 0; i < LIGHTS; i++) {
        const isogi_light *l = &some_lights[i];
        double d[3], square = 0, sine;
        for (int k = 0; k < 3; k++) square += (double)l->vector[k] * (double)l->vector[k];
        for (int k = 0; k < 3; k++) d[k] = (double)l->vector[k] / sqrt(square);
        sine = kind == 1 ? sin((double)l->radius) : (double)l->radius / sqrt(square); /* of the angular radius */
        if (kind == 4) add_rectangle(l);
        else if (kind == 1 || kind == 3)
            add_cap(1 / (3.14159265358979323846 * (kind == 1 ? sine * sine : (double)l->radius * (double)l->radius)), d,
                    sin(asin(sine) / 2));
        else add_light((quad)(kind == 2 ? 1 / square : 1), d);
    }
}

static double error_of_lights(int order) {
    double worst = 0, largest = 0;
    for (int i = 0; i < order * order; i++) largest = fmax(largest, fabs((double)light_expected[i]));
    isogi_sh_project(out, order, &some_lighting, NULL);
    for (int i = 0; i < order * order; i++) worst = fmax(worst, fabs((double)(light_expected[i] - (quad)out[3 * i])) / largest);
    return worst;
}

static const char *const light_name[5] = {"light-directional", "light-disc", "light-point", "light-sphere", "light-rectangle"};

static int chosen(const char *name) { return !strncmp(name, only, strlen(only)); }

static void lights(void) {
    static const int orders[] = {2, 3, 5, 8, 11, 16, 21}; /* 2, 3, 5, 11 and 21 where it must be quick */
    fprintf(stderr, "\n  lights: ns a light (RGB)\n");
    for (int kind = 0; kind < 5; kind++) {
        if (!chosen(light_name[kind])) continue;
        place_lights(kind), expect_lights(kind);
        for (size_t o = 0; o < sizeof orders / sizeof *orders; o++) {
            if (quick && o & 1 && orders[o] != 3) continue;
            double seconds = seconds_of(run_lights, orders[o], LIGHTS), error = error_of_lights(orders[o]);
            fprintf(csv, "isogi_sh.h,%s,%s,order %d,%.6g,%.6g,%d,light\n", light_name[kind], orders[o] == 5 ? "default" : "other orders",
                    orders[o], seconds, error, LIGHTS);
            fprintf(stderr, "  %-22s order %2d %10.1f ns   error %.2g\n", light_name[kind], orders[o], seconds / LIGHTS * 1e9, error);
        }
    }
}

static void prepare(void) {
    static const double off[] = {0, 1e-8, -1e-8};
    double pi = 3.14159265358979323846;
    for (int i = 0; i < MAX_COUNT; i++) {
        double z = 2 * random_unit() - 1, phi = 2 * pi * random_unit(), s = sqrt(1 - z * z), d[3] = {s * cos(phi), s * sin(phi), z};
        if (i < 54) d[i % 3] = i / 3 % 2 ? -1 : 1, d[(i + 1) % 3] = off[i / 6 % 3], d[(i + 2) % 3] = off[i / 18];
        for (int k = 0; k < 3; k++) directions64[i][k] = d[k], soa[k][i] = directions[i][k] = (float)d[k];
    }
    for (int i = 0; i < MATRICES; i++) {
        double q[4], n = 0;
        for (int k = 0; k < 4; k++) q[k] = random_unit() - 0.5, n += q[k] * q[k];
        for (int k = 0; k < 4; k++) q[k] /= sqrt(n);
        double w = q[0], x = q[1], y = q[2], z = q[3];
        double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
                       2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
        for (int k = 0; k < 9; k++) matrix64[i][k] = m[k], matrix[i][k] = (float)m[k];
    }
    for (int i = 0; i < MAX_N * 64; i++) in[i] = (float)(2 * random_unit() - 1), in2[i] = (float)(2 * random_unit() - 1);
    for (int i = 0; i < MAX_N; i++) in64[i] = 2 * random_unit() - 1;
    isogi_sh_rotation_build(rotation, 5, matrix[0]);
    for (int j = 0; j < HEIGHT; j++)
        for (int i = 0; i < WIDTH; i++) {
            double u = (i + 0.5) / WIDTH, v = (j + 0.5) / HEIGHT;
            float d[1][3] = {
                {(float)(sin(pi * v) * sin(2 * pi * (u - 0.5))), (float)cos(pi * v), (float)(-sin(pi * v) * cos(2 * pi * (u - 0.5)))}};
            isogi_sh_eval_sum(image + 3 * (j * WIDTH + i), in, 5, 3, (const float(*)[3])d, 1);
        }
}

int main(int argc, char **argv) {
    static const bench_case cases[] = {
        {"eval-aos-f32-L4", "direction", run_aos_f32, error_aos_f32, 5, 128, 3.6, 2, 4.5e-7},
        {"eval-aos-f32-L10", "direction", run_aos_f32, error_aos_f32, 11, 32, 35, 12, 2.2e-6},
        {"eval-aos-f32-L20", "direction", run_aos_f32, error_aos_f32, 21, 16, 148, 60, 1e-5},
        {"eval-one-f32-L2", "direction", run_one_f32, error_one_f32, 3, 64, 0, 15, 4.5e-7},
        {"eval-one-f32-L4", "direction", run_one_f32, error_one_f32, 5, 64, 0, 30, 4.5e-7},
        {"eval-soa-f32-L4", "direction", run_soa_f32, error_soa_f32, 5, 128, 1.5, 0.9, 4.5e-7},
        {"eval-soa-f32-L10", "direction", run_soa_f32, error_soa_f32, 11, 32, 9.3, 3.5, 2.2e-6},
        {"eval-soa-f32-L20", "direction", run_soa_f32, error_soa_f32, 21, 16, 49, 20, 1e-5},
        {"eval-aos-f64-L4", "direction", run_aos_f64, error_aos_f64, 5, 64, 4.2, 3, 1.1e-15},
        {"eval-aos-f64-L10", "direction", run_aos_f64, error_aos_f64, 11, 16, 38, 20, 7e-15},
        {"rotate-once-n3", "rotation", run_rotate_f32, error_rotate_f32, 3, 64, 7.9, 7.5, 4.5e-7},
        {"rotate-once-n4", "rotation", run_rotate_f32, error_rotate_f32, 4, 64, 21.5, 20, 4.5e-7},
        {"rotate-once-n5", "rotation", run_rotate_f32, error_rotate_f32, 5, 64, 35, 32, 4.5e-7},
        {"rotate-once-n8", "rotation", run_rotate_f64, error_rotate_f64, 8, 16, 588, 550, 7e-15},
        {"rotate-once-n16", "rotation", run_rotate_f64, error_rotate_f64, 16, 16, 2719, 2500, 3e-14},
        {"rotate-build-n8", "rotation", run_build, error_build, 8, 16, 2900, 600, 7e-15},
        {"rotate-build-n16", "rotation", run_build, error_build, 16, 16, 9900, 2500, 3e-14},
        {"rotate-apply-n5", "rotation", run_apply, error_apply, 5, 64, 78, 9, 4.5e-7},
        {"product-n5", "product", run_product, error_product, 5, 16, 163, 140, 1e-6},
        {"product-batch-n5", "product", run_product_batch, error_product, 5, 64, 163, 20, 1e-6},
        {"product-batch-n3", "product", run_product_batch, error_product, 3, 64, 0, 100, 2e-7},
        {"product-batch-n8", "product", run_product_batch, error_product, 8, 64, 0, 1000, 5e-7},
        {"zonal-n5", "lobe", run_zonal, error_zonal, 5, 64, 12, 8, 4.5e-7},
        {"sum-n5", "direction", run_sum, error_sum, 5, 256, 16.6, 5, 2e-6},
        {"project-equirect-n5", "image", run_project, error_project, 5, 1, 2.8e6, 0.6e6, 1e-7},
        {"project-equirect-n4", "image", run_project, error_project, 4, 1, 0, 1.3e6, 1e-7},
        {"project-equirect-n8", "image", run_project, error_project, 8, 1, 0, 2.8e6, 1e-7},
    };
    const char *path = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick")) quick = 1; else if (!strcmp(argv[i], "--only") && i + 1 < argc) only = argv[++i];
        else if (argv[i][0] != '-') path = argv[i];
        else { path = NULL; break; }
    }
    size_t matching = 0, lit = 0;
    const int missing = chosen("truncation-"); /* and ringing, of the same projections */
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) matching += (size_t)chosen(cases[i].name);
    for (int kind = 0; kind < 5; kind++) lit += (size_t)chosen(light_name[kind]);
    matching += lit + (size_t)missing;
    if (!matching) fprintf(stderr, "no case begins with %s\n", only);
    if (!matching || !path || !(csv = fopen(path, "w"))) {
        fprintf(stderr, "usage: %s [--quick] [--only CASE] OUT.csv\n", argv[0]);
        return 1;
    }
    fprintf(csv, "header,case,method,setting,seconds,error,work,unit\n");
    prepare();
    head();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (!chosen(cases[i].name)) continue;
        row(&cases[i], "default");
        if (!strncmp(cases[i].name, "eval", 4) && cases[i].run != run_one_f32) fill_row(&cases[i]);
        if (quick) continue;
        for (bench_level = 0; bench_level < 2; bench_level++) row(&cases[i], bench_level ? "avx2" : "plain");
        bench_level = 99;
    }
    if (lit) lights();
    if (missing) truncation();
    return fclose(csv) ? 1 : 0;
}
