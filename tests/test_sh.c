/* Tests of isogi_sh.h. The reference is tests/reference_sh.h: 128 bits, from the definition. Where this program holds isogi_sh.h itself, as
   in the long suite, it chooses the instructions, and goes through every level; `make test` links it with what is compiled already. */
#ifdef ISOGI_SH_IMPLEMENTED /* by the best instructions of the processor: there are no others */
#undef ISOGI_SH_LEVEL
#define LINKED 1
enum { BEST_LEVEL = 0 };
#elif defined ISOGI_SH_LEVEL /* the most that this build may use */
#define LINKED 0
enum { BEST_LEVEL = ISOGI_SH_LEVEL };
#undef ISOGI_SH_LEVEL
#else
#define LINKED 0
enum { BEST_LEVEL = 99 };
#endif
static int instruction_level = BEST_LEVEL; /* a test may hold the header to less than the processor has */
#define ISOGI_SH_LEVEL instruction_level
#define ISOGI_SH_IMPLEMENTATION
#include "isogi_sh.h"
#include "reference_sh.h"
#include <float.h>
#include "generate_sh.h"
#include "test.h"

static const double pi = 3.14159265358979323846;

enum { MAX_COUNT = ISOGI_SH_MAX_ORDER * ISOGI_SH_MAX_ORDER };

/* ---- helpers ---- */

static void random_rotation(test_random *r, double m[9]) {
    double q[4], n = 0;
    do {
        n = 0;
        for (int i = 0; i < 4; i++) q[i] = random_range(r, -1, 1), n += q[i] * q[i];
    } while (n > 1 || n < 0.1);
    n = sqrt(n);
    double w = q[0] / n, x = q[1] / n, y = q[2] / n, z = q[3] / n;
    double t[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),    1 - 2 * (x * x + z * z),
                   2 * (y * z - w * x),     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
    memcpy(m, t, sizeof t);
}

/* out = m v, or its transpose */
static void apply(double out[3], const double m[9], const double v[3], int transposed) {
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int j = 0; j < 3; j++) sum += (transposed ? m[3 * j + i] : m[3 * i + j]) * v[j];
        out[i] = sum;
    }
}

/* The directions that break implementations: poles, axes, 1e-8 and less off them, and random ones. */
static int hard_direction(double d[3], int i, test_random *r) {
    static const double off[] = {0, 1e-8, -1e-8, 1e-16, 1e-4, 3e-3, 1e-300};
    if (i < 6 * 7 * 7) {
        int axis = i % 3, a = i / 6 % 7, b = i / 42;
        d[axis] = i / 3 % 2 ? -1 : 1;
        d[(axis + 1) % 3] = off[a];
        d[(axis + 2) % 3] = off[b];
        return 1;
    }
    random_direction(r, d);
    return i < 6 * 7 * 7 + (LONG_SUITE ? 4000 : 300);
}

/* ---- evaluation ---- */

/* By exact quadrature (Gauss-Legendre times uniform azimuth): the Gram matrix is the identity to 1e-12, to order 10. */
/* gcc 12 at -O3 leaves out a rounding to float that is followed by a widening. */
static float rounded(double x) {
    volatile float f = (float)x;
    return f;
}

TEST(basis_is_orthonormal) {
    enum { ORDER = 10, COUNT = ORDER * ORDER, LATITUDES = 12, LONGITUDES = 24 };
    static double gram[COUNT][COUNT];
    long double node[LATITUDES], weight[LATITUDES];
    reference_nodes(node, weight, LATITUDES);
    memset(gram, 0, sizeof gram);
    for (int i = 0; i < LATITUDES; i++)
        for (int j = 0; j < LONGITUDES; j++) {
            double phi = 2 * pi * j / LONGITUDES, s = sqrt((double)(1 - node[i] * node[i])), y[COUNT];
            double d[1][3] = {{s * cos(phi), s * sin(phi), (double)node[i]}};
            CHECK(isogi_sh_eval_f64(y, ORDER, (const double(*)[3])d, 1) == ISOGI_OK, "latitude %d", i);
            for (int a = 0; a < COUNT; a++)
                for (int b = 0; b < COUNT; b++) gram[a][b] += (double)weight[i] * 2 * pi / LONGITUDES * y[a] * y[b];
        }
    double worst = 0;
    for (int a = 0; a < COUNT; a++)
        for (int b = 0; b < COUNT; b++) worst = fmax(worst, fabs(gram[a][b] - (a == b)));
    CHECK(worst < 1e-12, "largest deviation from the identity %g", worst);
}

/* The convention of the header: Y0 = 1/sqrt(4 pi), Y1..Y3 = sqrt(3/(4 pi)) (y, z, x), and degree 2 written out. */
TEST(convention) {
    test_random r = {1};
    for (int i = 0; i < 100; i++) {
        double d[1][3], y[9];
        random_direction(&r, d[0]);
        isogi_sh_eval_f64(y, 3, (const double(*)[3])d, 1);
        double X = d[0][0], Y = d[0][1], Z = d[0][2], a = sqrt(3 / (4 * pi)), b = sqrt(15 / (4 * pi));
        double expected[9] = {
            sqrt(1 / (4 * pi)),     a * Y, a * Z, a * X, b * X * Y, b * Y * Z, sqrt(5 / (16 * pi)) * (3 * Z * Z - 1), b * X * Z,
            b / 2 * (X * X - Y * Y)};
        for (int k = 0; k < 9; k++) CHECK(fabs(y[k] - expected[k]) < 2e-15, "Y%d = %.17g, expected %.17g", k, y[k], expected[k]);
    }
}

/* What the header allows -ffast-math, and x87 registers. */
#define DOUBLE_FACTOR(degree) ((ROUNDING_FACTOR > 1 && (degree) == 100 ? 6 : ROUNDING_FACTOR) * (FLT_EVAL_METHOD == 2 ? 2 : 1))

/* Largest absolute error in double over hard and random directions. The bounds are those that the header states. */
TEST(double_evaluation_is_exact) {
    static const struct { int degree; double bound; } cases[] = {{4, 1e-15}, {10, 5e-15}, {20, 2e-14}, {50, 1.5e-13}, {100, 7e-13}};
    static double y[MAX_COUNT];
    static quad expected[MAX_COUNT];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        test_random r = {2};
        double d[1][3], worst = 0, at[3] = {0, 0, 0};
        int order = cases[c].degree + 1, step = LONG_SUITE || order < 20 ? 1 : order > 50 ? 13 : 7;
        for (int i = 0; hard_direction(d[0], i, &r); i += step) {
            quad e[3] = {(quad)d[0][0], (quad)d[0][1], (quad)d[0][2]};
            reference_eval(expected, order, e);
            isogi_sh_eval_f64(y, order, (const double(*)[3])d, 1);
            for (int k = 0; k < order * order; k++) {
                double error = (double)(expected[k] - (quad)y[k]);
                if (!(fabs(error) <= worst)) worst = fabs(error), memcpy(at, d[0], sizeof at);
            }
        }
        printf("    degree %d: largest error %.3g\n", cases[c].degree, worst);
        CHECK(worst <= cases[c].bound * DOUBLE_FACTOR(cases[c].degree),
              "degree %d: error %g at (%g %g %g), bound %g", cases[c].degree, worst, at[0], at[1], at[2], cases[c].bound);
    }
}

/* Where the rounding of z moves polynomials most: angles from the poles of 1e-6 to 1, by their logarithm, one direction at a time and
   sixteen at once, with every set of instructions. The worst is at m = 0 and +-1. */
TEST(double_evaluation_is_exact_at_any_distance_from_poles) {
    static const struct { int degree; double bound; } cases[] = {{4, 1e-15}, {10, 5e-15}, {20, 2e-14}, {50, 1.5e-13}, {100, 7e-13}};
    enum { COLUMNS = 3 };
    static double y[3][16 * MAX_COUNT], one[MAX_COUNT];
    static quad expected[MAX_COUNT];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const int order = cases[c].degree + 1, count = order * order;
        test_random r = {5};
        double d[16][3], worst = 0, at = 0;
        int level, set, levels = 0;
        for (set = 0; set < (LONG_SUITE ? 300 : 12); set++) {
            for (int i = 0; i < 16; i++) {
                const double angle = pow(10, -(i % 4 ? 2.2 : 6) * random_unit(&r)), phi = random_range(&r, 0, 2 * pi);
                d[i][0] = sin(angle) * cos(phi), d[i][1] = sin(angle) * sin(phi), d[i][2] = (i & 1 ? -1 : 1) * cos(angle);
            }
            for (level = 0; level < 3 && level <= BEST_LEVEL; level++) {
                instruction_level = level;
                isogi_sh_eval_f64(y[level], order, (const double(*)[3])d, 16);
            }
            for (int i = 0; i < 16; i++) {
                quad e[3] = {(quad)d[i][0], (quad)d[i][1], (quad)d[i][2]};
                reference_columns(expected, order, COLUMNS, e);
                for (levels = level, level = 0; level < levels; level++) {
                    instruction_level = level;
                    isogi_sh_eval_f64(one, order, (const double(*)[3])d + i, 1);
                    for (int l = 0; l < order; l++)
                        for (int m = -(l < COLUMNS ? l : COLUMNS - 1); m < COLUMNS && m <= l; m++) {
                            const int k = l * (l + 1) + m;
                            const double error = fmax(fabs((double)(expected[k] - (quad)y[level][i * count + k])),
                                                      fabs((double)(expected[k] - (quad)one[k])));
                            if (!(error <= worst)) worst = error, at = fabs(d[i][2]) < 1 ? acos(fabs(d[i][2])) : 0;
                        }
                }
            }
        }
        instruction_level = BEST_LEVEL;
        printf("    degree %d: largest error %.3g, at %.2g from a pole\n", cases[c].degree, worst, at);
        CHECK(worst <= cases[c].bound * DOUBLE_FACTOR(cases[c].degree), "degree %d: error %g, bound %g", cases[c].degree, worst,
              cases[c].bound);
    }
}

/* The same in float, in batches of both layouts, against the reference at the float direction. From degree 21 on floats are rounded
   doubles. */
TEST(float_evaluation_is_exact) {
    static const struct { int degree; double bound; } cases[] = {{4, 4.5e-7}, {10, 2.2e-6}, {20, 1e-5}, {21, 3e-7}, {50, 3e-7},
        {100, 3e-7}};
    enum { MOST = 8192 };
    static float d[MOST][3], x[3][MOST];
    static quad expected[MAX_COUNT];
    test_random r = {3};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        int order = cases[c].degree + 1, n = order * order;
        size_t step = order < 21 ? 1 : (LONG_SUITE ? 5 : order > 50 ? 19 : 7), count = 0;
        double worst = 0, wide[3];
        r.state = 3;
        for (int i = 0; hard_direction(wide, i, &r); i += (int)step, count++)
            for (int k = 0; k < 3; k++) x[k][count] = d[count][k] = rounded(wide[k]);
        float *y = (float *)malloc((size_t)n * count * sizeof *y), *columns = (float *)malloc((size_t)n * count * sizeof *y);
        CHECK(isogi_sh_eval(y, order, (const float(*)[3])d, count) == ISOGI_OK &&
                  isogi_sh_eval_soa(columns, order, x[0], x[1], x[2], count) == ISOGI_OK,
              "degree %d", cases[c].degree);
        for (size_t i = 0; i < count; i++) {
            quad e[3] = {(quad)d[i][0], (quad)d[i][1], (quad)d[i][2]};
            if (!LONG_SUITE && order == 101 && i % 2) continue;
            reference_eval(expected, order, e);
            for (int k = 0; k < n; k++) {
                double error = fmax(fabs((double)(expected[k] - (quad)y[(size_t)n * i + (size_t)k])),
                                    fabs((double)(expected[k] - (quad)columns[count * (size_t)k + i])));
                if (!(error <= worst)) worst = error;
            }
        }
        printf("    degree %d: largest error %.3g\n", cases[c].degree, worst);
        CHECK(worst <= cases[c].bound * ROUNDING_FACTOR, "degree %d: error %g, bound %g", cases[c].degree, worst, cases[c].bound);
        free(y), free(columns);
    }
}

/* Batches, in both types and at every instruction level, which go other ways than single directions: within the same bounds. More
   directions close to the poles and the equator, where polynomials and recursions cancel most. */
TEST(batches_are_exact_at_every_level) {
    static const struct { int order; double bound, bound64; } cases[] = {{3, 4.5e-7, 1e-15}, {4, 4.5e-7, 1e-15}, {5, 4.5e-7, 1e-15},
        {8, 2.2e-6, 5e-15}, {11, 2.2e-6, 5e-15}, {21, 1e-5, 2e-14}};
    enum { MOST = 2400 };
    static float d[MOST][3], y[3][MOST * 441];
    static double wide[MOST][3], y64[3][MOST * 441];
    static quad expected[441], expected64[441];
    test_random r = {41};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        int order = cases[c].order, n = order * order, count = LONG_SUITE ? MOST : order > 11 ? 300 : 340;
        for (int i = 0; i < count; i++) {
            if (!hard_direction(wide[i], i, &r)) random_direction(&r, wide[i]);
            if (i >= 294 && i % 3 < 2) { /* within 0.2 of a pole, or 0.05 of the equator */
                double z = i % 3 ? 0.05 * random_range(&r, -1, 1) : (i & 1 ? -1 : 1) * (1 - 0.02 * random_unit(&r)),
                       phi = random_range(&r, 0, 2 * pi), s = sqrt(1 - z * z);
                wide[i][0] = s * cos(phi), wide[i][1] = s * sin(phi), wide[i][2] = z;
            }
            for (int k = 0; k < 3; k++) d[i][k] = rounded(wide[i][k]);
        }
        double worst[3] = {0, 0, 0}, worst64[3] = {0, 0, 0};
        for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++) {
            isogi_sh_eval(y[instruction_level], order, (const float(*)[3])d, (size_t)count);
            isogi_sh_eval_f64(y64[instruction_level], order, (const double(*)[3])wide, (size_t)count);
        }
        const int levels = instruction_level;
        for (int i = 0; i < count; i++) {
            quad e[3] = {(quad)d[i][0], (quad)d[i][1], (quad)d[i][2]}, e64[3] = {(quad)wide[i][0], (quad)wide[i][1], (quad)wide[i][2]};
            reference_eval(expected, order, e), reference_eval(expected64, order, e64);
            for (int level = 0; level < levels; level++)
                for (int k = 0; k < n; k++) {
                    worst[level] = fmax(worst[level], fabs((double)(expected[k] - (quad)y[level][i * n + k])));
                    worst64[level] = fmax(worst64[level], fabs((double)(expected64[k] - (quad)y64[level][i * n + k])));
                }
        }
        for (int level = 0; level < levels; level++) {
            printf("    order %2d, level %d: %.3g in float, %.3g in double\n", order, level, worst[level], worst64[level]);
            CHECK(worst[level] <= cases[c].bound * ROUNDING_FACTOR, "order %d, level %d: float %g", order, level, worst[level]);
            CHECK(worst64[level] <= cases[c].bound64 * ROUNDING_FACTOR, "order %d, level %d: double %g", order, level, worst64[level]);
        }
    }
    instruction_level = BEST_LEVEL;
}

/* Few directions go other ways than batches: every count up to 20 at every level, rows, columns and sums, with directions of any length
   and, in some rounds, one without a direction among them. */
TEST(any_count_of_directions_is_exact_at_every_level) {
    enum { MOST = 20 };
    static const struct { int order; double bound, bound64; } cases[] = {{1, 1e-7, 1e-16}, {2, 1e-7, 3e-16}, {3, 4.5e-7, 1e-15},
        {4, 4.5e-7, 1e-15}, {5, 4.5e-7, 1e-15}, {6, 2.2e-6, 5e-15}, {11, 2.2e-6, 5e-15}, {21, 1e-5, 2e-14}, {22, 3e-7, 2e-13}};
    static float d[MOST][3], soa[3][MOST], y[MOST * 484], columns[MOST * 484], c32[3 * 484], sums[MOST * 3];
    static double wide[MOST][3], soa64[3][MOST], y64[MOST * 484], columns64[MOST * 484], c64[3 * 484], sums64[MOST * 3];
    static quad expected[MOST][484];
    test_random r = {47};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const int order = cases[c].order, n = order * order;
        double worst = 0, worst64 = 0, off = 0, off64 = 0, total = 0;
        for (int i = 0; i < 3 * n; i++) c32[i] = rounded(random_range(&r, -1, 1)), c64[i] = (double)c32[i], total += fabs(c64[i]) / 3;
        for (int round = 0; round < 2; round++) {
            for (int i = 0; i < MOST; i++) {
                random_direction(&r, wide[i]);
                for (int k = 0; k < 3; k++) {
                    if (i % 3) wide[i][k] *= i % 3 == 1 ? 1 + 5e-4 : 3e6;
                    if (round && i == 7) wide[i][k] = 0;
                    wide[i][k] = (double)(d[i][k] = rounded(wide[i][k])), soa[k][i] = d[i][k], soa64[k][i] = wide[i][k];
                }
                const quad e[3] = {(quad)wide[i][0], (quad)wide[i][1], round && i == 7 ? 1 : (quad)wide[i][2]};
                reference_eval(expected[i], order, e);
            }
            for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++)
                for (int count = 1; count <= MOST; count++)
                    for (int first = 0; first < (round ? 8 : 1); first += 7) { /* from the one without a direction on, too */
                        const int last = first + count <= MOST ? first + count : MOST;
                        const size_t some = (size_t)(last - first);
                        isogi_sh_eval(y, order, (const float(*)[3])d + first, some);
                        isogi_sh_eval_f64(y64, order, (const double(*)[3])wide + first, some);
                        isogi_sh_eval_soa(columns, order, soa[0] + first, soa[1] + first, soa[2] + first, some);
                        isogi_sh_eval_soa_f64(columns64, order, soa64[0] + first, soa64[1] + first, soa64[2] + first, some);
                        isogi_sh_eval_sum(sums, c32, order, 3, (const float(*)[3])d + first, some);
                        isogi_sh_eval_sum_f64(sums64, c64, order, 3, (const double(*)[3])wide + first, some);
                        for (size_t i = 0; i < some; i++) {
                            double sum[3] = {0, 0, 0};
                            for (int k = 0; k < n; k++) {
                                const double exact = (double)expected[(size_t)first + i][k];
                                worst = fmax(worst, fabs((double)y[i * (size_t)n + (size_t)k] - exact));
                                worst = fmax(worst, fabs((double)columns[(size_t)k * some + i] - exact));
                                worst64 = fmax(worst64, fabs(y64[i * (size_t)n + (size_t)k] - exact));
                                worst64 = fmax(worst64, fabs(columns64[(size_t)k * some + i] - exact));
                                for (int j = 0; j < 3; j++) sum[j] += exact * c64[3 * k + j];
                            }
                            for (size_t j = 0; j < 3; j++) {
                                off = fmax(off, fabs((double)sums[3 * i + j] - sum[j]));
                                off64 = fmax(off64, fabs(sums64[3 * i + j] - sum[j]));
                            }
                        }
                    }
        }
        printf("    order %2d: %.3g in float, %.3g in double; sums %.3g, %.3g\n", order, worst, worst64, off, off64);
        CHECK(worst <= cases[c].bound * ROUNDING_FACTOR, "order %d: float %g", order, worst);
        CHECK(worst64 <= cases[c].bound64 * ROUNDING_FACTOR, "order %d: double %g", order, worst64);
        CHECK(off <= (cases[c].bound + 6e-8) * total * ROUNDING_FACTOR, "order %d: sums %g", order, off);
        CHECK(off64 <= cases[c].bound64 * total * ROUNDING_FACTOR, "order %d: sums in double %g", order, off64);
    }
    instruction_level = BEST_LEVEL;
}

/* Floats against doubles of the plain code, which the tests above compare with 128 bits: cheap, so that many directions are seen.
   Bounds are those of the next degree that the header names. */
TEST(floats_are_exact_at_many_directions) {
    static const struct { int order; double bound; } cases[] = {{3, 4.5e-7}, {5, 4.5e-7}, {6, 2.2e-6}, {8, 2.2e-6}, {10, 2.2e-6},
        {11, 2.2e-6}, {12, 1e-5}, {15, 1e-5}, {16, 1e-5}, {21, 1e-5}};
    enum { BLOCK = 64 };
    static float d[BLOCK][3], y[BLOCK * 441];
    static double wide[BLOCK][3], expected[BLOCK * 441];
    test_random r = {43};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double worst[3] = {0, 0, 0}, square[3] = {0, 0, 0};
        size_t n = ISOGI_SH_COUNT(cases[c].order), count = BLOCK * n, sum = 0;
        for (int block = 0; block < (LONG_SUITE ? 4000 : 160); block++) {
            for (int i = 0; i < BLOCK; i++) {
                double z = random_range(&r, -1, 1), phi = random_range(&r, 0, 2 * pi), s;
                if (i % 4 == 1) z = 1 - pow(10, -6 * random_unit(&r));
                if (i % 4 == 2) z = pow(10, -7 * random_unit(&r));
                s = sqrt(1 - z * z);
                d[i][0] = rounded(s * cos(phi)), d[i][1] = rounded(s * sin(phi)), d[i][2] = rounded(z);
                for (int k = 0; k < 3; k++) wide[i][k] = (double)d[i][k];
            }
            instruction_level = 0;
            isogi_sh_eval_f64(expected, cases[c].order, (const double(*)[3])wide, BLOCK);
            for (; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++) {
                isogi_sh_eval(y, cases[c].order, (const float(*)[3])d, BLOCK);
                for (size_t i = 0; i < count; i++) {
                    double error = fabs((double)y[i] - expected[i]);
                    worst[instruction_level] = fmax(worst[instruction_level], test_finite(error) ? error : 1e9);
                    if (i / n % 4 == 1) square[instruction_level] += error * error;
                }
            }
            sum += count / 4;
        }
        instruction_level = BEST_LEVEL;
        for (int k = 0; k < 3; k++) square[k] = sqrt(square[k] / (double)sum);
        printf("    order %2d: %.3g, %.3g, %.3g at levels 0, 1, 2; ", cases[c].order, worst[0], worst[1], worst[2]);
        printf("near the pole rms %.3g, %.3g, %.3g\n", square[0], square[1], square[2]);
        for (int k = 0; k < 3; k++)
            CHECK(worst[k] <= cases[c].bound * ROUNDING_FACTOR, "order %d, level %d: %g", cases[c].order, k, worst[k]);
        if (cases[c].order < 21) continue;
        for (int k = 0; k < 3; k++) /* 2.2e-7 where the rounding of z counts in full: it comes in turn with another */
            CHECK(square[k] <= 1.95e-7 * ROUNDING_FACTOR, "level %d: rms %g", k, square[k]);
    }
}

/* Length does not matter, from denormal to huge; the zero vector and what is not finite count as +z. */
TEST(any_length_and_no_length) {
    static const float scales[] = {1, 1e-44f, 1e-38f, 1e-20f, 3e20f, 3e38f};
    float y[25], up[25], d[1][3] = {{0, 0, 1}},
          bad[][3] = {{0, 0, 0}, {NAN, 0, 1}, {0, INFINITY, 0}, {-INFINITY, NAN, 2}, {-0.0f, 0, -0.0f}};
    isogi_sh_eval(up, 5, (const float(*)[3])d, 1);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        isogi_sh_eval(y, 5, (const float(*)[3]) & bad[i], 1);
        CHECK(!memcmp(y, up, sizeof y), "case %d: Y2 %g, expected %g", (int)i, (double)y[2], (double)up[2]);
    }
    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        float axis[1][3] = {{-scales[i], 0, 0}}, diagonal[1][3] = {{scales[i], scales[i], 0}}, a = (float)sqrt(3 / (4 * pi));
        isogi_sh_eval(y, 5, (const float(*)[3])axis, 1);
        CHECK(fabsf(y[3] + a) < 1e-6f && fabsf(y[2]) < 1e-6f, "scale %g: Y3 %g", (double)scales[i], (double)y[3]);
        isogi_sh_eval(y, 5, (const float(*)[3])diagonal, 1);
        CHECK(fabsf(y[3] - a * 0.70710678f) < 1e-6f, "scale %g: Y3 %g", (double)scales[i], (double)y[3]);
    }
    for (int e = -1060; e < 1023; e += 31) {
        double big[1][3] = {{ldexp(0.6, e), 0, ldexp(-0.8, e)}}, z[9], one[1][3] = {{0.6, 0, -0.8}}, z1[9];
        isogi_sh_eval_f64(z, 3, (const double(*)[3])big, 1);
        isogi_sh_eval_f64(z1, 3, (const double(*)[3])one, 1);
        for (int k = 0; k < 9; k++) CHECK(fabs(z[k] - z1[k]) < (e < -1000 ? 1e-3 : 4e-16), "2^%d: Y%d %g, expected %g", e, k, z[k], z1[k]);
    }
}

/* Every function of a direction, at order 1, 2, 5 and the maximum, in batches that hold zero, denormal, huge and not finite vectors, poles
   and axes: the results are finite, and those of the same vector alone. 4e-6: two paths of float at order 5; the maximum is plain. */
TEST(any_vector_at_any_order) {
    enum { COUNT = 37 };
    static const int orders[] = {1, 2, 4, 5, 101};
    static float y[COUNT * MAX_COUNT], columns[COUNT * MAX_COUNT], one[MAX_COUNT], in_place[MAX_COUNT], gradient[COUNT][MAX_COUNT][3],
        c[MAX_COUNT];
    static double y64[COUNT * MAX_COUNT], columns64[COUNT * MAX_COUNT], samples[MAX_COUNT];
    static const float odd[] = {0, -0.0f, 1e-45f, -1e-40f, 1e-30f, 1, -1, 1e-8f, 1e30f, -3e38f, INFINITY, -INFINITY, NAN};
    float d[COUNT][3], x[3][COUNT], value[COUNT], ones[COUNT], zonal[101];
    double wide[COUNT][3], x64[3][COUNT], value64[COUNT];
    test_random r = {42};
    for (int i = 0; i < COUNT; i++)
        for (int k = 0; k < 3; k++) {
            d[i][k] = i < 24 ? odd[random_bits(&r) % (sizeof odd / sizeof *odd)] : (float)random_range(&r, -1, 1);
            if (i < 4) d[i][k] = i == 0 ? 0 : k == i - 1 ? 1e-42f : 0;
            x[k][i] = d[i][k], x64[k][i] = wide[i][k] = (double)d[i][k], ones[i] = 1;
        }
    for (int l = 0; l < 101; l++) zonal[l] = 1;
    for (size_t o = 0; o < sizeof orders / sizeof *orders; o++) {
        int order = orders[o], n = order * order, bad = 0;
        double worst = 0, worst64 = 0;
        for (int k = 0; k < n; k++) c[k] = (float)random_range(&r, -1, 1) / (float)order;
        CHECK(isogi_sh_eval(y, order, (const float(*)[3])d, COUNT) == ISOGI_OK &&
                  isogi_sh_eval_f64(y64, order, (const double(*)[3])wide, COUNT) == ISOGI_OK,
              "order %d", order);
        CHECK(isogi_sh_eval_soa(columns, order, x[0], x[1], x[2], COUNT) == ISOGI_OK &&
                  isogi_sh_eval_soa_f64(columns64, order, x64[0], x64[1], x64[2], COUNT) == ISOGI_OK,
              "order %d", order);
        for (int i = 0; i < COUNT; i++) {
            isogi_sh_eval(one, order, (const float(*)[3])d + i, 1);
            for (int k = 0; k < n; k++) {
                double at[4] = {(double)y[i * n + k], (double)columns[k * COUNT + i], y64[i * n + k], columns64[k * COUNT + i]};
                for (int p = 0; p < 4; p++) bad += !test_finite(at[p]);
                for (int p = 0; p < 2; p++) worst = fmax(worst, fabs(at[p] - (double)one[k]));
                worst64 = fmax(worst64, fabs(at[2] - at[3]));
            }
        }
        isogi_sh_eval_gradient(gradient[0], order, (const float(*)[3])d, COUNT);
        for (int i = 0; i < COUNT * n; i++)
            for (int k = 0; k < 3; k++) bad += !test_finite((double)(&gradient[0][0])[i][k]);
        CHECK(isogi_sh_eval_sum(value, c, order, 1, (const float(*)[3])d, COUNT) == ISOGI_OK, "order %d", order);
        for (int k = 0; k < n; k++) samples[k] = (double)c[k];
        CHECK(isogi_sh_eval_sum_f64(value64, samples, order, 1, (const double(*)[3])wide, COUNT) == ISOGI_OK, "order %d", order);
        for (int i = 0; i < COUNT; i++) {
            bad += !test_finite((double)value[i]) + !test_finite(value64[i]);
            CHECK(fabs((double)value[i] - value64[i]) < 2e-5, "order %d, vector %d: %.9g %.9g", order, i, (double)value[i], value64[i]);
        }
        CHECK(isogi_sh_project_samples(samples, order, 1, (const float(*)[3])d, ones, NULL, COUNT) == ISOGI_OK, "order %d", order);
        for (int k = 0; k < n; k++) bad += !test_finite(samples[k]);
        for (int i = 0; i < COUNT; i++) {
            isogi_result result = isogi_sh_zonal_to_direction(one, order, zonal, d[i]);
            CHECK(result == ISOGI_OK || result == ISOGI_INVALID, "order %d, vector %d: %d", order, i, (int)result);
            if (result != ISOGI_OK) continue;
            for (int k = 0; k < n; k++) bad += !test_finite((double)one[k]);
            memcpy(in_place, zonal, sizeof *zonal * (size_t)order);
            isogi_sh_zonal_to_direction(in_place, order, in_place, d[i]);
            CHECK(!memcmp(in_place, one, sizeof *one * (size_t)n), "order %d, vector %d: in place", order, i);
        }
        CHECK(bad == 0, "order %d: %d values are not finite", order, bad);
        CHECK(worst <= 4e-6 && worst64 < 1e-13, "order %d: alone and in a batch differ by %g; layouts by %g", order, worst, worst64);
    }
}

/* One coordinate that is not finite among directions that are good, in any lane and at every level, in both types and layouts: its
   direction counts as +z, the others are not touched. By bits, so that -ffast-math does not take the question for answered. */
TEST(one_bad_direction_in_a_batch_counts_as_up) {
    enum { COUNT = 24, N = 441 };
    static const int orders[] = {2, 3, 5, 8, 11, 12, 21};
    static const float odd[] = {NAN, -NAN, INFINITY, -INFINITY};
    static float d[COUNT][3], x[3][COUNT], y[COUNT * N], columns[COUNT * N];
    static double wide[COUNT][3], x64[3][COUNT], y64[COUNT * N], columns64[COUNT * N], expected[COUNT * N];
    test_random r = {44};
    double worst = 0;
    int bad = 0;
    for (int round = 0; round < 7 * 48; round++) {
        int order = orders[round % 7], n = order * order, at = round / 7 % COUNT;
        double good[COUNT][3];
        for (int i = 0; i < COUNT; i++) {
            random_direction(&r, good[i]);
            for (int k = 0; k < 3; k++) {
                d[i][k] = rounded(good[i][k]), good[i][k] = (double)d[i][k];
                if (i == at) d[i][k] = round / 112 == k ? odd[round % 4] : d[i][k], good[i][k] = k == 2;
                x[k][i] = d[i][k], wide[i][k] = x64[k][i] = (double)d[i][k];
            }
        }
        instruction_level = 0;
        isogi_sh_eval_f64(expected, order, (const double(*)[3])good, COUNT);
        for (; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++) {
            isogi_sh_eval(y, order, (const float(*)[3])d, COUNT);
            isogi_sh_eval_f64(y64, order, (const double(*)[3])wide, COUNT);
            isogi_sh_eval_soa(columns, order, x[0], x[1], x[2], COUNT);
            isogi_sh_eval_soa_f64(columns64, order, x64[0], x64[1], x64[2], COUNT);
            for (int i = 0; i < COUNT * n; i++) {
                double value[4] = {(double)y[i], (double)columns[i % n * COUNT + i / n], y64[i], columns64[i % n * COUNT + i / n]};
                for (int k = 0; k < 4; k++) {
                    bad += !test_finite(value[k]);
                    worst = fmax(worst, test_finite(value[k]) ? fabs(value[k] - expected[i]) : 0);
                }
            }
        }
        instruction_level = BEST_LEVEL;
    }
    CHECK(!bad && worst <= 1e-5 * ROUNDING_FACTOR, "%d values are not finite, the others differ by %g", bad, worst);
}

/* ---- rotation ---- */

/* f rotated, evaluated at w, is f evaluated at R^-1 w: 1000 random rotations, every order 1..16 in turn, and a few high ones.
   1e-12: thousands of roundings of coefficients of size 1. */
/* Within what evaluation at both directions may err: its bound at the order, of a vector of that norm. */
TEST(rotation_agrees_with_evaluation) {
    static double c[MAX_COUNT], rotated[MAX_COUNT], y[MAX_COUNT];
    test_random r = {4};
    double worst = 0;
    for (int i = 0; i < 1010; i++) {
        int order = i < 1000 ? 1 + i % 16 : 101, n = order * order;
        const double bound = order <= 5 ? 1e-15 : order <= 11 ? 5e-15 : order <= 21 ? 1.5e-14 : 2e-13;
        double m[9], w[1][3], back[1][3], a = 0, b = 0, norm = 0;
        random_rotation(&r, m);
        for (int k = 0; k < n; k++) c[k] = random_range(&r, -1, 1), norm += c[k] * c[k];
        CHECK(isogi_sh_rotate_f64(rotated, c, order, 1, m) == ISOGI_OK, "rotation %d", i);
        random_direction(&r, w[0]);
        apply(back[0], m, w[0], 1);
        isogi_sh_eval_f64(y, order, (const double(*)[3])w, 1);
        for (int k = 0; k < n; k++) a += rotated[k] * y[k];
        isogi_sh_eval_f64(y, order, (const double(*)[3])back, 1);
        for (int k = 0; k < n; k++) b += c[k] * y[k];
        worst = fmax(worst, fabs(a - b) / (2 * bound * sqrt(norm)));
        CHECK(fabs(a - b) < 2 * bound * sqrt(norm) * ROUNDING_FACTOR, "rotation %d, order %d: %.17g and %.17g", i, order, a, b);
    }
    printf("    largest difference %.3g of what evaluation may err\n", worst);
}

/* ---- projection ---- */

static int wanted, wanted_order;
static void one_function(void *user, const double d[3], double *value) {
    static double y[MAX_COUNT];
    double direction[1][3] = {{d[0], d[1], d[2]}};
    (void)user;
    isogi_sh_eval_f64(y, wanted_order, (const double(*)[3])direction, 1);
    value[0] = y[wanted];
    value[1] = 2 * y[0];
}

static int calls;
static void counted(void *user, const double d[3], double *value) {
    (void)user;
    calls++;
    value[0] = d[0] + d[1] * d[2] > 0.3 ? 1 : 0;
}

/* A resolution of 0 is the order: as many latitudes, twice as many longitudes, and the same numbers. */
TEST(resolution_of_a_projection_is_the_order_by_default) {
    double c[49], same[49];
    for (int order = 1; order <= 7; order++) {
        calls = 0;
        CHECK(isogi_sh_project_function(c, order, 1, 0, counted, NULL) == ISOGI_OK && calls == 2 * order * order, "order %d: %d calls",
              order, calls);
        CHECK(isogi_sh_project_function(same, order, 1, order, counted, NULL) == ISOGI_OK &&
                  !memcmp(c, same, (size_t)(order * order) * sizeof *c),
              "order %d: %g %g", order, c[0], same[0]);
    }
}

/* Projecting Y_i returns the i-th unit vector, to order 10, and for a few of the highest degrees. */
TEST(projecting_a_basis_function_returns_a_unit_vector) {
    static double c[2 * MAX_COUNT];
    wanted_order = 10;
    for (wanted = 0; wanted < 100; wanted += LONG_SUITE ? 1 : 3) {
        CHECK(isogi_sh_project_function(c, 10, 2, 0, one_function, NULL) == ISOGI_OK, "function %d", wanted);
        for (int k = 0; k < 100; k++) {
            CHECK(fabs(c[2 * k] - (k == wanted)) < 1e-13, "Y%d on Y%d: %g", wanted, k, c[2 * k]);
            CHECK(fabs(c[2 * k + 1] - (k == 0 ? 2 : 0)) < 1e-13, "second channel on Y%d: %g", k, c[2 * k + 1]);
        }
    }
    wanted_order = LONG_SUITE ? 101 : 61;
    const int count = wanted_order * wanted_order;
    for (wanted = count - 1; wanted > count - 200; wanted -= LONG_SUITE ? 11 : 200) {
        double worst = 0;
        isogi_sh_project_function(c, wanted_order, 2, 0, one_function, NULL);
        for (int k = 0; k < count; k++) worst = fmax(worst, fabs(c[2 * k] - (k == wanted)));
        CHECK(worst < 1e-11, "Y%d at order %d: largest error %g", wanted, wanted_order, worst);
    }
}

/* The direction of texel (i, j) by the formula of isogi_env. */
static void texel_direction(double d[3], double u, double v) {
    d[0] = sin(pi * v) * sin(2 * pi * (u - 0.5));
    d[1] = cos(pi * v);
    d[2] = -sin(pi * v) * cos(2 * pi * (u - 0.5));
}

/* An image painted with Y_i through the stated orientation projects to the unit vector; a constant to sqrt(4 pi) and nothing else.
   1e-6: the pixels are floats. Odd sizes too. */
TEST(equirect_projection_is_exact_for_band_limited_images) {
    static const int sizes[][2] = {{32, 16}, {31, 17}, {40, 15}, {64, 32}, {37, 16}, {36, 18}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        int width = sizes[s][0], height = sizes[s][1];
        float *image = (float *)malloc(sizeof(float) * 3 * (size_t)(width * height)), c[3 * 36];
        for (int i = 0; i < 36; i++) {
            double worst = 0;
            for (int p = 0; p < width * height; p++) {
                double d[1][3], y[36];
                texel_direction(d[0], (p % width + 0.5) / width, (p / width + 0.5) / height);
                isogi_sh_eval_f64(y, 6, (const double(*)[3])d, 1);
                image[3 * p] = (float)y[i], image[3 * p + 1] = 1, image[3 * p + 2] = (float)(2 * y[i]);
            }
            CHECK(isogi_sh_project_equirect(c, 6, image, width, height) == ISOGI_OK, "%dx%d", width, height);
            for (int k = 0; k < 36; k++) {
                worst = fmax(worst, fabs((double)c[3 * k] - (k == i)));
                worst = fmax(worst, fabs((double)c[3 * k + 1] - (k == 0 ? sqrt(4 * pi) : 0)));
                worst = fmax(worst, fabs((double)c[3 * k + 2] - (k == i ? 2 : 0)));
            }
            CHECK(worst < 1e-6, "%dx%d, Y%d: largest error %g", width, height, i, worst);
        }
        free(image);
    }
}

/* A sky of one colour, of whatever size, lights every normal with pi: small images have no degrees that their rows and columns alias. 1e-5:
   sums of floats. Widths from 32 on take a path of their own. */
TEST(white_skies_of_any_size_light_all_alike) {
    enum { MOST = 64 * 16 };
    static float image[3 * MOST];
    const float d[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0.6f, 0, 0.8f}};
    double worst = 0;
    for (int i = 0; i < 3 * MOST; i++) image[i] = 1;
    for (int height = 1; height <= 16; height++)
        for (int width = 1; width <= 64; width += width < 16 ? 1 : 16)
            for (int order = 1; order <= 8; order++) {
                const isogi_lighting sky = {.env = {.rgb = image, .width = width, .height = height}};
                float c[3 * 64], irradiance[6][3];
                CHECK(isogi_sh_project(c, order, &sky, NULL) == ISOGI_OK, "%dx%d", width, height);
                isogi_sh_convolve_cosine(c, c, order, 3), isogi_sh_eval_sum(irradiance[0], c, order, 3, d, 6);
                for (int i = 0; i < 18; i++) worst = fmax(worst, fabs((double)irradiance[i / 3][i % 3] - pi));
            }
    CHECK(worst < 1e-5, "irradiance differs from pi by %g", worst);
}

/* Texels as the environment shows them: a lookup at a texel's own direction returns that texel, rotated or not, and the centre of
   the image is -z with +x to its right, +y at the top. */
TEST(environment_lookup_has_the_stated_orientation) {
    enum { W = 16, H = 8 };
    float image[H][W][3], rgb[3];
    test_random r = {6};
    for (int j = 0; j < H; j++)
        for (int i = 0; i < W; i++)
            for (int k = 0; k < 3; k++) image[j][i][k] = (float)random_unit(&r);
    isogi_env env = {.rgb = &image[0][0][0], .width = W, .height = H};
    for (int turn = 0; turn < 2; turn++) {
        double m[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        if (turn) random_rotation(&r, m);
        for (int k = 0; k < 9 && turn; k++) env.rotation[k] = (float)m[k];
        for (int j = 0; j < H; j++)
            for (int i = 0; i < W; i++) {
                double d[3], w[3];
                texel_direction(d, (i + 0.5) / W, (j + 0.5) / H);
                apply(w, m, d, 0);
                float direction[3] = {(float)(7 * w[0]), (float)(7 * w[1]), (float)(7 * w[2])};
                isogi_env_radiance(&env, direction, rgb);
                for (int k = 0; k < 3; k++)
                    CHECK(fabsf(rgb[k] - image[j][i][k]) < 1e-5f, "texel %d %d: %g, expected %g", i, j, (double)rgb[k],
                          (double)image[j][i][k]);
            }
    }
    isogi_env plain = {.rgb = &image[0][0][0], .width = W, .height = H};
    for (int i = 0; i < 600; i++) { /* between texels: bilinear; the first 200 on both sides of the seam, the next beyond the last rows */
        double u = i < 200 ? random_range(&r, -0.5, 0.5) / W : random_unit(&r), v = random_unit(&r), d[3];
        if (i >= 200 && i < 400) v = random_range(&r, 0, 0.5) / H, v = i & 1 ? 1 - v : v;
        texel_direction(d, u, v);
        const double x = u * W - 0.5, y = fmin(fmax(v * H - 0.5, 0), H - 1), a = x - floor(x), b = y - floor(y);
        const int left = ((int)floor(x) + W) % W, right = (left + 1) % W, top = (int)floor(y), bottom = top + (top < H - 1);
        const float direction[3] = {(float)d[0], (float)d[1], (float)d[2]};
        isogi_env_radiance(&plain, direction, rgb);
        for (int k = 0; k < 3; k++) {
            double value = (1 - b) * ((1 - a) * (double)image[top][left][k] + a * (double)image[top][right][k]) +
                           b * ((1 - a) * (double)image[bottom][left][k] + a * (double)image[bottom][right][k]);
            CHECK(fabs((double)rgb[k] - value) < 2e-6 / fmax(sin(pi * v), 0.01), "u %g, v %g: %g, expected %g", u, v, (double)rgb[k],
                  value);
        }
    }
    float centre[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    isogi_env_radiance(&plain, centre, rgb);
    float expected = (image[3][7][0] + image[3][8][0] + image[4][7][0] + image[4][8][0]) / 4;
    CHECK(fabsf(rgb[0] - expected) < 1e-6f, "centre %g, expected %g", (double)rgb[0], (double)expected);
    isogi_env_radiance(&plain, up, rgb);
    CHECK(rgb[0] >= 0 && rgb[0] <= 1, "pole %g", (double)rgb[0]);
}

/* Wherever a direction points, and whatever it holds, a lookup stays inside the image: seen by the address sanitizer, and by values. */
TEST(environment_lookup_survives_anything) {
    float one[1][3] = {{5, 6, 7}}, wide[3][3] = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, rgb[3];
    const float odd[] = {0, -0.0f, 1, -1, 1e-45f, 1e38f, -3e38f, INFINITY, -INFINITY, NAN, 1e-8f};
    int n = (int)(sizeof odd / sizeof *odd);
    isogi_env a = {.rgb = one[0], .width = 1, .height = 1}, b = {.rgb = wide[0], .width = 3, .height = 1},
              c = {.rgb = wide[0], .width = 1, .height = 3};
    isogi_env black = {.rgb = NULL};
    for (int i = 0; i < n * n * n; i++) {
        float d[3] = {odd[i % n], odd[i / n % n], odd[i / n / n]};
        isogi_env_radiance(&a, d, rgb);
        CHECK(fabsf(rgb[0] - 5) < 1e-5f && fabsf(rgb[2] - 7) < 1e-5f, "direction %g %g %g: %g", (double)d[0], (double)d[1], (double)d[2],
              (double)rgb[0]);
        isogi_env_radiance(&b, d, rgb);
        CHECK(fabsf(rgb[0] - 1) < 1e-6f, "direction %g %g %g: %g", (double)d[0], (double)d[1], (double)d[2], (double)rgb[0]);
        isogi_env_radiance(&c, d, rgb);
        CHECK(fabsf(rgb[1] - 1) < 1e-6f, "direction %g %g %g: %g", (double)d[0], (double)d[1], (double)d[2], (double)rgb[1]);
        isogi_env_radiance(&black, d, rgb);
        CHECK(rgb[0] == 0, "black: %g", (double)rgb[0]);
    }
}

/* Image and SH of one environment, both rotated, agree after projection. 1e-5: float pixels and coefficients. */
TEST(rotated_environment_projects_alike_from_image_and_from_coefficients) {
    enum { W = 64, H = 32, ORDER = 5, N = ORDER * ORDER };
    static float image[H * W * 3];
    float sh[3 * N], from_image[3 * N], from_sh[3 * N];
    test_random r = {7};
    for (int round = 0; round < 5; round++) {
        double m[9];
        for (int i = 0; i < 3 * N; i++) sh[i] = (float)random_range(&r, -1, 1);
        isogi_lighting painted = {.env = {.sh = sh, .sh_order = ORDER}}, pixels = {.env = {.rgb = image, .width = W, .height = H}};
        for (int p = 0; p < W * H; p++) {
            double d[3];
            texel_direction(d, (p % W + 0.5) / W, (p / W + 0.5) / H);
            float direction[3] = {(float)d[0], (float)d[1], (float)d[2]};
            isogi_env_radiance(&painted.env, direction, image + 3 * p);
        }
        random_rotation(&r, m);
        for (int k = 0; k < 9; k++) painted.env.rotation[k] = pixels.env.rotation[k] = (float)m[k];
        CHECK(isogi_sh_project(from_image, ORDER, &pixels, NULL) == ISOGI_OK, "round %d", round);
        CHECK(isogi_sh_project(from_sh, ORDER, &painted, NULL) == ISOGI_OK, "round %d", round);
        for (int i = 0; i < 3 * N; i++)
            CHECK(fabsf(from_image[i] - from_sh[i]) < 1e-5f, "%d: %g and %g", i, (double)from_image[i], (double)from_sh[i]);
        double d[3];
        random_direction(&r, d);
        float w[3] = {(float)d[0], (float)d[1], (float)d[2]}, looked_up[3], wn[1][3] = {{w[0], w[1], w[2]}}, y[N];
        isogi_env_radiance(&painted.env, w, looked_up);
        isogi_sh_eval(y, ORDER, (const float(*)[3])wn, 1);
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int i = 0; i < N; i++) sum += (double)from_sh[3 * i + k] * (double)y[i];
            CHECK(fabs(sum - (double)looked_up[k]) < 1e-5, "radiance %g, expected %g", (double)looked_up[k], sum);
        }
    }
}

/* ---- lights ---- */

/* Irradiance on a surface that faces each light, by cosine convolution at high order: what the light's description says. Even
   degrees decay as l^-2.5 in the sum, so order 60 leaves 1e-3 for deltas. */
TEST(lights_have_the_irradiance_they_state) {
    enum { ORDER = 61 };
    static float c[3 * ORDER * ORDER], y[ORDER * ORDER];
    const float point[3] = {1, 2, 3};
    isogi_light lights[] = {
        {.vector = {2, 0, 0}, .rgb = {3, 1, 2}},
        {.vector = {0, -5, 1}, .rgb = {3, 1, 2}, .radius = 0.3f},
        {.vector = {1, 1, 1}, .rgb = {3, 1, 2}, .radius = 0.00465f},
        {.kind = ISOGI_LIGHT_POINT, .vector = {1, 2, 7}, .rgb = {48, 16, 32}},
        {.kind = ISOGI_LIGHT_SPHERE, .vector = {1, -2, 3}, .rgb = {48, 16, 32}, .radius = 2},
        {.vector = {0, 0, -1}, .rgb = {3, 1, 2}, .radius = 1.5f},
    };
    for (size_t i = 0; i < sizeof lights / sizeof *lights; i++) {
        isogi_lighting lighting = {.lights = &lights[i], .light_count = 1};
        float d[1][3];
        for (int k = 0; k < 3; k++) d[0][k] = lights[i].vector[k] - (lights[i].kind == ISOGI_LIGHT_DIRECTIONAL ? 0 : point[k]);
        CHECK(isogi_sh_project(c, ORDER, &lighting, point) == ISOGI_OK, "light %d", (int)i);
        CHECK(isogi_sh_convolve_cosine(c, c, ORDER, 3) == ISOGI_OK, "light %d", (int)i);
        isogi_sh_eval(y, ORDER, (const float(*)[3])d, 1);
        double e[3] = {0, 0, 0};
        for (int k = 0; k < 3 * ORDER * ORDER; k++) e[k % 3] += (double)c[k] * (double)y[k / 3];
        CHECK(fabs(e[0] - 3) < 3e-3 && fabs(e[1] - 1) < 1e-3 && fabs(e[2] - 2) < 2e-3, "light %d: irradiance %g %g %g", (int)i, e[0], e[1],
              e[2]);
    }
}

/* A disc's coefficients are those of its radiance, by quadrature over the disc; a small one tends to the delta. */
TEST(disc_matches_quadrature) {
    enum { ORDER = 12, N = ORDER * ORDER, STEPS = 400 };
    double radius = 0.7, z[ORDER] = {0}, L = 1 / (pi * sin(radius) * sin(radius));
    float c[3 * N], small[3 * N], delta[3 * N];
    isogi_light light = {.vector = {0, 0, 1}, .rgb = {1, 1, 1}, .radius = (float)radius}, tiny = light, none = light;
    tiny.radius = 1e-6f, none.radius = 0;
    isogi_lighting lighting = {.lights = &light, .light_count = 1};
    isogi_sh_project(c, ORDER, &lighting, NULL);
    for (int i = 0; i < STEPS; i++) { /* midpoint rule in cos t: error 1e-6 */
        double t = cos(radius) + (1 - cos(radius)) * (i + 0.5) / STEPS, y[N];
        double d[1][3] = {{sqrt(1 - t * t), 0, t}};
        isogi_sh_eval_f64(y, ORDER, (const double(*)[3])d, 1);
        for (int l = 0; l < ORDER; l++) z[l] += L * y[l * (l + 1)] * 2 * pi * (1 - cos(radius)) / STEPS;
    }
    for (int l = 0; l < ORDER; l++)
        for (int m = -l; m <= l; m++) {
            double value = (double)c[3 * (l * (l + 1) + m)], expected = m ? 0 : z[l];
            CHECK(fabs(value - expected) < 1e-5, "Y(%d,%d): %g, expected %g", l, m, value, expected);
        }
    lighting.lights = &tiny;
    isogi_sh_project(small, ORDER, &lighting, NULL);
    lighting.lights = &none;
    isogi_sh_project(delta, ORDER, &lighting, NULL);
    for (int i = 0; i < 3 * N; i++) CHECK(fabsf(small[i] - delta[i]) < 1e-6f, "%d: %g and %g", i, (double)small[i], (double)delta[i]);
}

/* ---- algebra ---- */

/* A uniform sky of radiance 1 gives irradiance pi; the clamped cosine's factors are the closed ones. */
TEST(cosine_convolution) {
    float c[121], out[121];
    static const double factor[11] = {3.14159265358979324, 2.09439510239319549, 0.785398163397448310, 0, -0.130899693899574718, 0,
                                      0.0490873852123405193, 0, -0.0245436926061702597, 0, 0.0143171540202659848};
    for (int i = 0; i < 121; i++) c[i] = 1;
    CHECK(isogi_sh_convolve_cosine(out, c, 11, 1) == ISOGI_OK, "order %d", 11);
    for (int i = 0; i < 121; i++) {
        int l = (int)sqrt((double)i);
        CHECK(fabs((double)out[i] - factor[l]) < 2e-7, "degree %d: %.9g, expected %.9g", l, (double)out[i], factor[l]);
    }
    CHECK(isogi_sh_convolve_cosine(c, c, 11, 1) == ISOGI_OK && !memcmp(c, out, sizeof c), "in place: %g", (double)c[5]);
}

/* The dot product is the integral of the product, by quadrature of the two expansions. */
TEST(dot_is_the_integral_of_the_product) {
    enum { ORDER = 6, N = 36, LATITUDES = 8, LONGITUDES = 16 };
    long double node[LATITUDES], weight[LATITUDES];
    float a[N], b[N];
    double integral = 0;
    test_random r = {8};
    reference_nodes(node, weight, LATITUDES);
    for (int i = 0; i < N; i++) a[i] = (float)random_range(&r, -1, 1), b[i] = (float)random_range(&r, -1, 1);
    for (int i = 0; i < LATITUDES; i++)
        for (int j = 0; j < LONGITUDES; j++) {
            double phi = 2 * pi * j / LONGITUDES, s = sqrt((double)(1 - node[i] * node[i])), y[N], f = 0, g = 0;
            double d[1][3] = {{s * cos(phi), s * sin(phi), (double)node[i]}};
            isogi_sh_eval_f64(y, ORDER, (const double(*)[3])d, 1);
            for (int k = 0; k < N; k++) f += (double)a[k] * y[k], g += (double)b[k] * y[k];
            integral += f * g * (double)weight[i] * 2 * pi / LONGITUDES;
        }
    double dot = isogi_sh_dot(a, b, ORDER);
    CHECK(fabs(dot - integral) < 1e-12, "%.17g, expected %.17g", dot, integral);
}

/* ---- other evaluations ---- */

/* Structure of arrays against array of structures: the same functions, any count. Bound: twice the float error of degree 10. */
TEST(both_layouts_agree) {
    enum { ORDER = 11, N = ORDER * ORDER, COUNT = 133 };
    static float x[COUNT], y[COUNT], z[COUNT], d[COUNT][3], aos[COUNT * N], soa[COUNT * N];
    static double X[COUNT], Y[COUNT], Z[COUNT], D[COUNT][3], wide[COUNT * N], wide_soa[COUNT * N];
    test_random r = {20};
    for (int i = 0; i < COUNT; i++) {
        random_direction(&r, D[i]);
        X[i] = D[i][0], Y[i] = D[i][1], Z[i] = D[i][2];
        for (int k = 0; k < 3; k++) d[i][k] = (float)(3 * D[i][k]);
        x[i] = d[i][0], y[i] = d[i][1], z[i] = d[i][2];
    }
    for (size_t count = 1; count <= COUNT; count += 11) {
        for (size_t i = 0; i < COUNT * N; i++) aos[i] = soa[i] = 99, wide[i] = wide_soa[i] = 99;
        CHECK(isogi_sh_eval(aos, ORDER, (const float(*)[3])d, count) == ISOGI_OK, "%d", (int)count);
        CHECK(isogi_sh_eval_soa(soa, ORDER, x, y, z, count) == ISOGI_OK, "%d", (int)count);
        CHECK(isogi_sh_eval_f64(wide, ORDER, (const double(*)[3])D, count) == ISOGI_OK, "%d", (int)count);
        CHECK(isogi_sh_eval_soa_f64(wide_soa, ORDER, X, Y, Z, count) == ISOGI_OK, "%d", (int)count);
        for (size_t i = 0; i < count; i++)
            for (size_t k = 0; k < N; k++) {
                CHECK(fabsf(aos[i * N + k] - soa[k * count + i]) < 4.4e-6f, "%g %g", (double)aos[i * N + k], (double)soa[k * count + i]);
                CHECK(fabs(wide[i * N + k] - wide_soa[k * count + i]) < 1.4e-14, "%g %g", wide[i * N + k], wide_soa[k * count + i]);
                CHECK(fabs(wide[i * N + k] - (double)aos[i * N + k]) < 5e-6, "%g %g", wide[i * N + k], (double)aos[i * N + k]);
            }
        if (count < COUNT) CHECK(aos[count * N] == 99 && soa[count * N] == 99, "written past the end at count %d", (int)count);
    }
}

/* Columns of order 11 go by 32 directions at a time where their number is a multiple of that, else by fewer: any number of directions, at
   every level, each against the reference within the bounds of degree 10. Every other 32 have unit lengths, those between powers of two;
   one direction is too long, too short or none for the fast way, in any place. Nothing is written but what was asked for. */
TEST(columns_of_order_11_are_exact_for_any_number_of_directions) {
    enum { ORDER = 11, N = ORDER * ORDER, MOST = 160, ODD = 5 };
    static const int counts[] = {32, 64, 96, 128, 160, 31, 33, 48, 63, 65, 95, 100, 127, 129};
    static const float odd[ODD][3] = {{0, 0, 0}, {NAN, 1, 0}, {0, -1e30f, 1e30f}, {1e-30f, 0, -1e-30f}, {3e38f, 3e38f, -3e38f}};
    static quad expected[MOST][N], strange[ODD][N];
    static float x[3][MOST + 1], out[MOST * N + 3];
    static double x64[3][MOST], out64[MOST * N + 2];
    test_random r = {23};
    double worst[2] = {0, 0};
    int spilt = 0, checked = 0;
    for (int i = 0; i < MOST + ODD; i++) {
        double d[3];
        quad e[3];
        if (i < MOST && (i % 4 || !hard_direction(d, i, &r))) random_direction(&r, d);
        for (int k = 0; k < 3; k++) {
            if (i < MOST) x[k][i + 1] = ldexpf(rounded(d[k]), i & 32 ? i % 9 - 4 : 0), x64[k][i] = (double)x[k][i + 1];
            e[k] = i < MOST ? (quad)x64[k][i] : i < MOST + 2 ? (quad)(k == 2) : (quad)odd[i - MOST][k];
        }
        reference_eval(i < MOST ? expected[i] : strange[i - MOST], ORDER, e);
    }
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        for (int kind = -1; kind < ODD; kind++) {
            const int count = counts[c], at = (int)(random_bits(&r) % (uint64_t)count);
            float was[3];
            if (!LONG_SUITE && kind >= 0 && (int)(c % ODD) != kind) continue;
            for (int k = 0; k < 3; k++) {
                was[k] = x[k][at + 1];
                if (kind >= 0) x[k][at + 1] = odd[kind][k], x64[k][at] = (double)odd[kind][k];
            }
            for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++) {
                for (int i = 0; i < MOST * N + 3; i++) out[i] = 99;
                for (int i = 0; i < MOST * N + 2; i++) out64[i] = 99;
                CHECK(isogi_sh_eval_soa(out + 1, ORDER, x[0] + 1, x[1] + 1, x[2] + 1, (size_t)count) == ISOGI_OK &&
                          isogi_sh_eval_soa_f64(out64 + 1, ORDER, x64[0], x64[1], x64[2], (size_t)count) == ISOGI_OK,
                      "%d directions", count);
                for (int i = 0; i < count; i++)
                    for (int k = 0; k < N; k++, checked++) {
                        const quad right = kind >= 0 && i == at ? strange[kind][k] : expected[i][k];
                        double error = fabs((double)(right - (quad)out[1 + k * count + i])),
                               error64 = fabs((double)(right - (quad)out64[1 + k * count + i]));
                        if (!(error <= worst[0])) worst[0] = error;
                        if (!(error64 <= worst[1])) worst[1] = error64;
                    }
                for (int i = 1 + count * N; i < MOST * N + 2; i++) spilt += out[i] < 99 || out[i] > 99 || out64[i] < 99 || out64[i] > 99;
                spilt += out[0] < 99 || out64[0] < 99;
            }
            instruction_level = BEST_LEVEL;
            for (int k = 0; k < 3; k++) x[k][at + 1] = was[k], x64[k][at] = (double)was[k];
        }
    CHECK(worst[0] <= 2.2e-6 * ROUNDING_FACTOR && worst[1] <= 5e-15 * ROUNDING_FACTOR && !spilt && checked > 100000,
          "errors %g, of doubles %g; %d numbers written beyond", worst[0], worst[1], spilt);
}

/* Gradients against central differences of the 128-bit reference (step 1e-10: error 1e-14 at degree 100), at poles, on axes and anywhere,
   at the direction as it is in each type. The bounds are those that the header states; floats are rounded doubles. */
TEST(gradient_is_the_derivative) {
    static const struct { int degree; double bound; } cases[] = {{4, 4e-15}, {10, 4e-14}, {20, 4e-13}, {100, 5e-11}};
    static double g[MAX_COUNT][3];
    static float gf[MAX_COUNT][3];
    static quad low[MAX_COUNT], high[MAX_COUNT];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const int order = cases[c].degree + 1, n = order * order, step = (LONG_SUITE ? 1 : 5) * (order > 100 ? 11 : order > 11 ? 5 : 1);
        test_random r = {21};
        double d[1][3], worst = 0, worst_float = 0, largest = 0;
        for (int i = 0; hard_direction(d[0], i, &r) && i < 600; i += step) {
            float f[1][3] = {{0, 0, 0}};
            const int as_float = i / step % 2;
            quad e[3], length = 0;
            for (int k = 0; k < 3; k++) {
                f[0][k] = rounded(d[0][k]);
                if (as_float) d[0][k] = (double)f[0][k];
                e[k] = (quad)d[0][k], length += e[k] * e[k];
            }
            length = quad_sqrt(length);
            for (int k = 0; k < 3; k++) e[k] /= length;
            CHECK(isogi_sh_eval_gradient_f64(g, order, (const double(*)[3])d, 1) == ISOGI_OK, "%d", i);
            CHECK(isogi_sh_eval_gradient(gf, order, (const float(*)[3])f, 1) == ISOGI_OK, "%d", i);
            for (int axis = 0; axis < 3; axis++) {
                const quad at = e[axis];
                e[axis] = at + (quad)1e-10;
                reference_eval(high, order, e);
                e[axis] = at - (quad)1e-10;
                reference_eval(low, order, e);
                e[axis] = at;
                for (int k = 0; k < n; k++) {
                    double expected = (double)((high[k] - low[k]) / (quad)2e-10), error = fabs(g[k][axis] - expected);
                    worst = error <= worst ? worst : error, largest = fmax(largest, fabs(expected));
                    if (!as_float) continue;
                    error = fabs((double)gf[k][axis] - expected) - cases[c].bound; /* a float's rounding is half an ulp: 6e-8 of it */
                    error = error <= 6e-8 * fabs(expected) ? error / (fabs(expected) + 1e-9) : 1;
                    worst_float = error <= worst_float ? worst_float : error;
                }
            }
        }
        printf("    degree %d: largest error %.3g of %.3g, float %.3g of a value\n", cases[c].degree, worst, largest, worst_float);
        CHECK(worst <= cases[c].bound * DOUBLE_FACTOR(cases[c].degree), "degree %d: %g", cases[c].degree, worst);
        CHECK(worst_float <= 6e-8, "degree %d: float %g", cases[c].degree, worst_float);
    }
}

/* An expansion evaluated without storing the basis is the dot product with the basis. 1e-13 and, in float, 1e-5: 121 terms of size 1. */
TEST(sums_agree_with_the_basis) {
    enum { ORDER = 11, N = ORDER * ORDER, COUNT = 37 };
    static double c[3 * N], y[N], D[COUNT][3], value[COUNT][3];
    static float cf[3 * N], d[COUNT][3], vf[COUNT][3];
    test_random r = {22};
    for (int order = 1; order <= ORDER; order++) {
        for (int i = 0; i < 3 * N; i++) cf[i] = (float)random_range(&r, -1, 1), c[i] = (double)cf[i];
        for (int i = 0; i < COUNT; i++) {
            random_direction(&r, D[i]);
            for (int k = 0; k < 3; k++) d[i][k] = rounded(D[i][k]), D[i][k] = (double)d[i][k];
        }
        for (int channels = 1; channels <= 3; channels++) {
            CHECK(isogi_sh_eval_sum_f64(&value[0][0], c, order, channels, (const double(*)[3])D, COUNT) == ISOGI_OK, "order %d", order);
            CHECK(isogi_sh_eval_sum(&vf[0][0], cf, order, channels, (const float(*)[3])d, COUNT) == ISOGI_OK, "order %d", order);
            for (int i = 0; i < COUNT; i++) {
                isogi_sh_eval_f64(y, order, (const double(*)[3]) & D[i], 1);
                for (int k = 0; k < channels; k++) {
                    double sum = 0, got = (&value[0][0])[i * channels + k], got_float = (double)(&vf[0][0])[i * channels + k];
                    for (int j = 0; j < order * order; j++) sum += y[j] * c[channels * j + k];
                    CHECK(fabs(sum - got) < 1e-13, "order %d, channel %d: %.17g, expected %.17g", order, k, got, sum);
                    CHECK(fabs(sum - got_float) < 1e-5, "order %d, channel %d: %.9g, expected %.9g", order, k, got_float, sum);
                }
            }
        }
    }
}

/* ---- more projections ---- */

static void smooth_function(void *user, const double d[3], double *value) {
    (void)user;
    value[0] = 1 + d[0] * d[1] + 0.5 * d[2];
    value[1] = d[2] > 0 ? 1 : 0;
}

/* Monte Carlo tends to the exact projection like 1/sqrt(N) (5 sigma, sigma of Y f about 1), stratified samples much faster; the same
   seed repeats the same numbers. */
TEST(random_projection_converges) {
    static double exact[2 * 16], plain[2 * 16], strata[2 * 16], again[2 * 16];
    double rms[2] = {0, 0};
    size_t n = 40000;
    isogi_sh_project_function(exact, 4, 2, 512, smooth_function, NULL);
    CHECK(isogi_sh_project_random(plain, 4, 2, n, 0, 1, smooth_function, NULL) == ISOGI_OK, "%d", 0);
    CHECK(isogi_sh_project_random(strata, 4, 2, n, 1, 1, smooth_function, NULL) == ISOGI_OK, "%d", 1);
    CHECK(isogi_sh_project_random(again, 4, 2, n, 1, 1, smooth_function, NULL) == ISOGI_OK && !memcmp(again, strata, sizeof again), "%d",
          2);
    CHECK(isogi_sh_project_random(again, 4, 2, n, 1, 2, smooth_function, NULL) == ISOGI_OK && memcmp(again, strata, sizeof again), "%s",
          "another seed");
    isogi_sh_project_random(again, 4, 2, n, 0, 2, smooth_function, NULL);
    CHECK(memcmp(again, plain, sizeof again), "%s", "another seed, independent");
    for (int i = 0; i < 32; i++) {
        rms[0] += (plain[i] - exact[i]) * (plain[i] - exact[i]) / 32;
        rms[1] += (strata[i] - exact[i]) * (strata[i] - exact[i]) / 32;
        CHECK(fabs(plain[i] - exact[i]) < 5 * sqrt(4 * pi) * 1.5 / sqrt((double)n), "%d: %g, expected %g", i, plain[i], exact[i]);
    }
    printf("    rms error %.3g, stratified %.3g\n", sqrt(rms[0]), sqrt(rms[1]));
    CHECK(rms[1] < rms[0] / 25, "%g and %g", rms[0], rms[1]);
}

/* Weighted samples: the nodes of a quadrature with their weights give the exact projection. */
TEST(weighted_samples_project) {
    enum { LATITUDES = 8, LONGITUDES = 16, COUNT = LATITUDES * LONGITUDES };
    static float d[COUNT][3], value[COUNT], weight[COUNT];
    long double node[LATITUDES], w[LATITUDES];
    double c[25];
    reference_nodes(node, w, LATITUDES);
    for (int i = 0; i < COUNT; i++) {
        double z = (double)node[i / LONGITUDES], s = sqrt(1 - z * z), phi = 2 * pi * (i % LONGITUDES) / LONGITUDES;
        d[i][0] = (float)(s * cos(phi)), d[i][1] = (float)(s * sin(phi)), d[i][2] = (float)z;
        value[i] = (float)(1 + d[i][0] * d[i][1]), weight[i] = (float)((double)w[i / LONGITUDES] * 2 * pi / LONGITUDES);
    }
    CHECK(isogi_sh_project_samples(c, 5, 1, (const float(*)[3])d, value, weight, COUNT) == ISOGI_OK, "%d", COUNT);
    for (int i = 0; i < 25; i++) {
        double expected = i == 0 ? sqrt(4 * pi) : i == 4 ? sqrt(4 * pi / 15) : 0;
        CHECK(fabs(c[i] - expected) < 2e-6, "Y%d: %g, expected %g", i, c[i], expected); /* float positions and values */
    }
    CHECK(isogi_sh_project_samples(c, 5, 1, (const float(*)[3])d, value, NULL, 1) == ISOGI_OK, "%s", "no weights");
    CHECK(fabs(c[0] - 4 * pi * (double)value[0] * sqrt(1 / (4 * pi))) < 1e-6, "%g", c[0]);
}

/* Batches that are full, that are not and that hold a direction of no use, of every channel and at every level: the sum of the samples,
   each by itself. What no sample fills counts nothing, and a value that is not finite stays in its channel. */
TEST(samples_in_batches_are_sums_of_samples) {
    static const int orders[] = {1, 2, 5, 10, 12, 21, 22}, channels[] = {1, 3, 16};
    static float d[40][3], value[16 * 40], weight[40];
    static double c[16 * 22 * 22], one[16 * 22 * 22], expected[16 * 22 * 22];
    test_random r = {71};
    double worst = 0;
    int round = 0, bad = 0;
    for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++)
        for (int o = 0; o < 7; o++, round++) {
            const int order = orders[o], some = channels[round % 3], n = some * order * order, count = 1 + round * 13 % 40;
            for (int i = 0; i < 40; i++) {
                for (int k = 0; k < 3; k++) d[i][k] = (float)random_range(&r, -1, 1);
                for (int k = 0; k < 16; k++) value[16 * i + k] = (float)random_range(&r, -1, 1);
                weight[i] = (float)random_range(&r, 0, 1);
            }
            if (round % 2) d[count / 2][0] = NAN;
            for (int i = 0; i < n; i++) expected[i] = 0;
            for (int i = 0; i < count; i++) {
                isogi_sh_project_samples(one, order, some, (const float(*)[3])d + i, value + some * i, weight + i, 1);
                for (int k = 0; k < n; k++) expected[k] += one[k];
            }
            value[some - 1] = round % 3 == 2 ? INFINITY : value[some - 1];
            isogi_sh_project_samples(c, order, some, (const float(*)[3])d, value, weight, (size_t)count);
            for (int k = 0; k < n; k++) {
                if (round % 3 == 2 && k % some == some - 1) bad += test_finite(c[k]);
                else worst = fmax(worst, test_finite(c[k]) ? fabs(c[k] - expected[k]) : 1e9);
            }
        }
    instruction_level = BEST_LEVEL;
    CHECK(worst < 1e-12 * ROUNDING_FACTOR && !bad, "%g; %d values are finite", worst, bad);
}

/* Images and coefficients next to the largest float, turned, with every set of instructions: what comes of them 2^64 times darker, times
   2^64, as far as floats go. */
TEST(environments_beyond_the_range_of_floats) {
    static const int sizes[4][2] = {{2, 3}, {1, 7}, {32, 16}, {9, 20}}, orders[4] = {5, 17, 100, 5};
    static float bright[3 * 32 * 16], dark[3 * 32 * 16], sh[2][3 * 25], out[3 * MAX_COUNT], expected[3 * MAX_COUNT];
    const double most = 3.4028234663852886e38, unit = ldexp(1, -64);
    test_random r = {9};
    int beyond = 0, within = 0;
    for (int k = 0; k < 40; k++) {
        int width = sizes[k % 4][0], height = sizes[k % 4][1], order = orders[k / 4 % 4], sampled = k % 5 != 0;
        isogi_lighting lighting = {.env = {.rgb = bright, .width = width, .height = height}};
        double m[9], worst = 0;
        for (int i = 0; i < 3 * 32 * 16; i++)
            bright[i] = (float)random_range(&r, k & 1 ? 0 : -most, most), dark[i] = (float)((double)bright[i] * unit);
        for (int i = 0; i < 3 * 25; i++) sh[0][i] = (float)random_range(&r, -most, most), sh[1][i] = (float)((double)sh[0][i] * unit);
        random_rotation(&r, m);
        for (int i = 0; i < 9; i++) lighting.env.rotation[i] = (float)m[i];
        if (k % 3) lighting.env.sh = sh[0], lighting.env.sh_order = 5;
        if (!sampled) memset(&lighting.env, 0, sizeof lighting.env), lighting.env.sh = sh[0], lighting.env.sh_order = 5;
        for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++) {
            isogi_lighting dim = lighting;
            if (dim.env.rgb) dim.env.rgb = dark;
            if (dim.env.sh) dim.env.sh = sh[1];
            for (int alone = 0; alone < 1 + sampled; alone++) { /* the image alone, too */
                isogi_result result = alone ? isogi_sh_project_equirect(out, order, bright, width, height)
                                            : isogi_sh_project(out, order, &lighting, NULL);
                if (alone) isogi_sh_project_equirect(expected, order, dark, width, height);
                else isogi_sh_project(expected, order, &dim, NULL);
                CHECK(result == ISOGI_OK, "case %d", k);
                for (int i = 0; i < 3 * order * order; i++) {
                    double e = (double)expected[i] / unit, error;
                    beyond += fabs(e) > most, within += fabs(e) < 0.9 * most && fabs(e) > 1e-3 * most;
                    e = e > most ? most : e < -most ? -most : e, error = fabs((double)out[i] - e) / most;
                    worst = fmax(worst, test_finite((double)out[i]) ? error : 1e9);
                }
            }
        }
        CHECK(worst < 2e-5, "case %d: %g of the largest float off", k, worst); /* floats' rounding of sums up to 50 times that */
    }
    instruction_level = BEST_LEVEL;
    CHECK(beyond > 200 * (BEST_LEVEL < 2 ? BEST_LEVEL + 1 : 3) && within > 1000, "%d coefficients beyond the range, %d within it", beyond,
          within);
}

/* Any number of channels is the same as one after the other; RGB is three of them. */
TEST(image_channels_are_independent) {
    enum { W = 24, H = 12, ORDER = 7, N = ORDER * ORDER };
    static float image[W * H * 7], one[W * H], all[7 * N], single[N];
    test_random r = {23};
    for (int i = 0; i < W * H * 7; i++) image[i] = (float)random_unit(&r);
    for (int channels = 1; channels <= 7; channels += 2) {
        CHECK(isogi_sh_project_image(all, ORDER, channels, image, W, H) == ISOGI_OK, "%d channels", channels);
        for (int k = 0; k < channels; k++) {
            for (int i = 0; i < W * H; i++) one[i] = image[channels * i + k];
            isogi_sh_project_image(single, ORDER, 1, one, W, H);
            for (int i = 0; i < N; i++)
                CHECK(fabsf(single[i] - all[channels * i + k]) < 1e-6f, "channel %d of %d, Y%d", k, channels, i);
        }
    }
}

/* Cube maps: painted with an expansion in the stated orientation they return it (texel centres: error about 3 / size^2), the solid
   angles of the texels add up to 4 pi, and a lit face is where it should be. */
TEST(cube_maps_have_exact_solid_angles_and_the_stated_orientation) {
    enum { SIZE = 48, ORDER = 4, N = ORDER * ORDER };
    static float pixels[6][SIZE * SIZE * 2];
    static double y[6][SIZE * SIZE][N];
    const float *face[6];
    float c[2 * N];
    for (int f = 0; f < 6; f++)
        for (int p = 0; p < SIZE * SIZE; p++) {
            double s = 2 * (p % SIZE + 0.5) / SIZE - 1, t = 2 * (p / SIZE + 0.5) / SIZE - 1;
            double table[6][3] = {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}};
            isogi_sh_eval_f64(y[f][p], ORDER, (const double(*)[3])table[f], 1);
        }
    for (int i = 0; i < N; i++) {
        for (int f = 0; f < 6; f++) {
            face[f] = pixels[f];
            for (int p = 0; p < SIZE * SIZE; p++) pixels[f][2 * p] = (float)y[f][p][i], pixels[f][2 * p + 1] = 1;
        }
        CHECK(isogi_sh_project_cube(c, ORDER, 2, face, SIZE) == ISOGI_OK, "Y%d", i);
        for (int k = 0; k < N; k++)
            CHECK(fabs((double)c[2 * k] - (k == i)) < 3.0 / (SIZE * SIZE), "Y%d on Y%d: %g", i, k, (double)c[2 * k]);
        CHECK(fabs((double)c[1] - sqrt(4 * pi)) < 1e-6, "constant: %.9g", (double)c[1]);
    }
    memset(pixels, 0, sizeof pixels);
    for (int p = 0; p < 2 * SIZE * SIZE; p++) pixels[2][p] = 1; /* the face +y alone */
    isogi_sh_project_cube(c, ORDER, 2, face, SIZE);
    CHECK(c[2] > 0.5f && fabsf(c[4]) < 1e-6f && fabsf(c[6]) < 1e-6f, "degree 1: %g %g %g", (double)c[2], (double)c[4], (double)c[6]);
    CHECK(fabs((double)c[0] - 4 * pi / 6 * sqrt(1 / (4 * pi))) < 1e-6, "a face is a sixth of the sphere: %g", (double)c[0]);
}

/* ---- more rotations ---- */

/* The recursion of Ivanic and Ruedenberg, as methods go in double: exact enough to degree 12 to be another opinion. */
static double ivanic_p(int i, int a, int s, int t, const double r[3][3], const double *before) {
    int w = 2 * i - 1;
#define R1(x, y) r[(x) + 1][(y) + 1]
#define R0(x, y) before[((x) + i - 1) * w + (y) + i - 1]
    if (t == i) return R1(a, 1) * R0(s, i - 1) - R1(a, -1) * R0(s, -i + 1);
    if (t == -i) return R1(a, 1) * R0(s, -i + 1) + R1(a, -1) * R0(s, i - 1);
    return R1(a, 0) * R0(s, t);
#undef R1
#undef R0
}

static void ivanic(double *rotation, int order, const double m[9]) {
    static const int axis[3] = {1, 2, 0}; /* y z x */
    double r[3][3];
    const double *before = rotation;
    rotation[0] = 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) r[i][j] = m[3 * axis[i] + axis[j]];
    for (int i = 1; i < order; i++) {
        double *now = (double *)before + (2 * i - 1) * (2 * i - 1);
        for (int s = -i; s <= i; s++)
            for (int t = -i; t <= i; t++) {
                double d = s == 0, as = abs(s), denominator = abs(t) < i ? (i + t) * (i - t) : 2 * i * (2 * i - 1);
                double u = sqrt((i + s) * (i - s) / denominator),
                       v = 0.5 * sqrt((1 + d) * (i + as - 1) * (i + as) / denominator) * (1 - 2 * d);
                double w = -0.5 * sqrt(fmax(0, (i - as - 1) * (i - as) / denominator)) * (1 - d), sum = 0;
                const double(*q)[3] = (const double(*)[3])r;
                if (i == 1) { now[(s + 1) * 3 + t + 1] = r[s + 1][t + 1]; continue; }
                if (abs(s) < i) sum += u * ivanic_p(i, 0, s, t, q, before);
                if (s == 0) sum += v * (ivanic_p(i, 1, 1, t, q, before) + ivanic_p(i, -1, -1, t, q, before));
                else if (s > 0) {
                    sum += v * ivanic_p(i, 1, s - 1, t, q, before) * (s == 1 ? sqrt(2) : 1);
                    if (s != 1) sum -= v * ivanic_p(i, -1, -s + 1, t, q, before);
                } else {
                    if (s != -1) sum += v * ivanic_p(i, 1, s + 1, t, q, before);
                    sum += v * ivanic_p(i, -1, -s - 1, t, q, before) * (s == -1 ? sqrt(2) : 1);
                }
                if (abs(s) < i - 1) {
                    if (s > 0) sum += w * (ivanic_p(i, 1, s + 1, t, q, before) + ivanic_p(i, -1, -s - 1, t, q, before));
                    if (s < 0) sum += w * (ivanic_p(i, 1, s - 1, t, q, before) - ivanic_p(i, -1, -s + 1, t, q, before));
                }
                now[(s + i) * (2 * i + 1) + t + i] = sum;
            }
        before = now;
    }
}

TEST(rotation_matrices_are_those_of_ivanic_and_ruedenberg) {
    enum { ORDER = 13 };
    static double ours[ISOGI_SH_ROTATION_COUNT(ORDER)], theirs[ISOGI_SH_ROTATION_COUNT(ORDER)];
    test_random r = {24};
    double worst = 0;
    for (int round = 0; round < 50; round++) {
        double m[9];
        random_rotation(&r, m);
        CHECK(isogi_sh_rotation_build_f64(ours, ORDER, m) == ISOGI_OK, "round %d", round);
        ivanic(theirs, ORDER, m);
        for (int l = 0, at = 0; l < ORDER; at += (2 * l + 1) * (2 * l + 1), l++)
            for (int i = 0; i <= 2 * l; i++)
                for (int j = 0; j <= 2 * l; j++)
                    worst = fmax(worst, fabs(ours[at + (2 * l + 1) * j + i] - theirs[at + (2 * l + 1) * i + j]));
    }
    printf("    largest difference %.3g\n", worst);
    CHECK(worst < 3e-14, "largest difference %g", worst);
}

/* R R^T = 1 by degree, at degrees 10, 30 and 100: the bounds the header's users may rely on; special angles among them. */
TEST(rotation_matrices_are_orthogonal) {
    static const struct { int degree; double bound; } cases[] = {{10, 4e-15}, {30, 1e-14}, {100, 2e-14}};
    static const double special[][3] = {
        {0, 0, 0}, {0, 1e-9, 0}, {1, 1e-9, 2}, {0, 3.14159265358979323846, 0}, {0.3, 1.5707963267948966, 0}, {1, 3.1415926, 2}};
    double *rotation = (double *)malloc(ISOGI_SH_ROTATION_COUNT(101) * sizeof(double));
    test_random r = {25};
    for (size_t c = 0; c < 3; c++) {
        int degree = cases[c].degree, width = 2 * degree + 1, rounds = degree > 50 ? LONG_SUITE ? 12 : 2 : 20;
        double worst = 0;
        for (int round = 0; round < rounds; round++) {
            double m[9];
            random_rotation(&r, m);
            if (round % 2 && round / 2 < 6) {
                const double *a = special[round / 2 % 6];
                double ca = cos(a[0]), sa = sin(a[0]), cb = cos(a[1]), sb = sin(a[1]), cc = cos(a[2]), sc = sin(a[2]);
                double t[9] = {ca * cb * cc - sa * sc, -ca * cb * sc - sa * cc, ca * sb, sa * cb * cc + ca * sc, -sa * cb * sc + ca * cc,
                    sa * sb, -sb * cc, sb * sc, cb};
                memcpy(m, t, sizeof m);
            }
            isogi_sh_rotation_build_f64(rotation, degree + 1, m);
            const double *block = rotation + ISOGI_SH_ROTATION_COUNT(degree);
            for (int i = 0; i < width; i++)
                for (int j = 0; j <= i; j++) {
                    double dot = 0;
                    for (int k = 0; k < width; k++) dot += block[i * width + k] * block[j * width + k];
                    worst = fmax(worst, fabs(dot - (i == j)));
                }
        }
        printf("    degree %d: %.4g\n", degree, worst);
        CHECK(worst <= cases[c].bound * ROUNDING_FACTOR, "degree %d: %g, bound %g", degree, worst, cases[c].bound);
    }
    free(rotation);
}

/* Build and apply is rotate; about z alone is rotate; the float versions follow; in place or not. */
TEST(rotations_agree_with_each_other) {
    enum { ORDER = 9, N = ORDER * ORDER, CHANNELS = 5 };
    static double c[N * CHANNELS], once[N * CHANNELS], applied[N * CHANNELS], rotation[ISOGI_SH_ROTATION_COUNT(ORDER)];
    static float cf[N * CHANNELS], f[N * CHANNELS], g[N * CHANNELS], rf[ISOGI_SH_ROTATION_COUNT(ORDER)];
    test_random r = {26};
    for (int order = 1; order <= ORDER; order++)
        for (int channels = 1; channels <= CHANNELS; channels++) {
            double m[9], angle = random_range(&r, -7, 7), applied_worst = 0, once_worst = 0;
            float mf[9];
            random_rotation(&r, m);
            for (int i = 0; i < 9; i++) mf[i] = (float)m[i], m[i] = (double)mf[i];
            for (int i = 0; i < N * CHANNELS; i++) cf[i] = (float)random_range(&r, -1, 1), c[i] = (double)cf[i];
            int n = order * order * channels;
            isogi_sh_rotate_f64(once, c, order, channels, m);
            isogi_sh_rotation_build_f64(rotation, order, m);
            isogi_sh_rotation_build(rf, order, mf);
            CHECK(isogi_sh_rotation_apply_f64(applied, c, order, channels, rotation) == ISOGI_OK, "order %d", order);
            CHECK(isogi_sh_rotation_apply(f, cf, order, channels, rf) == ISOGI_OK, "order %d", order);
            isogi_sh_rotate(g, cf, order, channels, mf);
            for (int i = 0; i < n; i++) {
                CHECK(fabs(once[i] - applied[i]) < 1e-13, "order %d, %d: %g %g", order, i, once[i], applied[i]);
                applied_worst = fmax(applied_worst, fabs(once[i] - (double)f[i]));
                once_worst = fmax(once_worst, fabs(once[i] - (double)g[i]));
            }
            if (channels == CHANNELS) printf("    order %d in float: %.3g applied, %.3g at once\n", order, applied_worst, once_worst);
            CHECK(applied_worst < 1e-6 && once_worst < 1e-6, "order %d, %d channels in float: %g applied, %g at once", order, channels,
                  applied_worst, once_worst);
            isogi_sh_rotate_f64(c, c, order, channels, m);
            CHECK(!memcmp(c, once, (size_t)n * sizeof *c), "order %d: in place %g %g", order, c[n - 1], once[n - 1]);
            CHECK(isogi_sh_matrix_from_euler_zyz(mf, angle, 0, 0) == ISOGI_OK, "angle %g", angle);
            isogi_sh_rotate(f, cf, order, channels, mf);
            CHECK(isogi_sh_rotate_z(g, cf, order, channels, angle) == ISOGI_OK, "angle %g", angle);
            for (int i = 0; i < n; i++) CHECK(fabsf(f[i] - g[i]) < 3e-6f, "order %d, about z: %g %g", order, (double)f[i], (double)g[i]);
        }
}

/* A matrix that is off by less than 1e-3, or that tilts z by less than any square can tell, still rotates: the norm stays, to the
   series of an inverse root (1e-13 at 1e-3) and 2 * 16 roundings; orders with and without unrolled degrees, float as well. */
TEST(rotations_by_inexact_matrices_keep_the_norm) {
    enum { ORDER = 7, N = ORDER * ORDER };
    const double off[] = {0, 1e-8, 4e-4, -4e-4}, tilt[] = {0, 1e-300, 1e-162, 1e-155, 1e-140, 1e-9};
    double c[N], out[N];
    float cf[N], f[N];
    test_random r = {29};
    for (int i = 0; i < 240; i++) {
        double m[9], before = 0, after = 0, after_float = 0;
        float mf[9];
        int order = 2 + i % 6, n = order * order;
        random_rotation(&r, m);
        if (i % 2) {
            const double tilted[9] = {1, 0, tilt[i / 2 % 6], 0, 1, -tilt[i / 2 % 6], -tilt[i / 2 % 6], tilt[i / 2 % 6], 1};
            memcpy(m, tilted, sizeof m);
        } else for (int k = 0; k < 9; k++) m[k] *= 1 + off[i / 2 % 4];
        for (int k = 0; k < 9; k++) mf[k] = (float)m[k];
        for (int k = 0; k < n; k++) cf[k] = (float)random_range(&r, -1, 1), c[k] = (double)cf[k], before += c[k] * c[k];
        CHECK(isogi_sh_rotate_f64(out, c, order, 1, m) == ISOGI_OK && isogi_sh_rotate(f, cf, order, 1, mf) == ISOGI_OK, "matrix %d", i);
        for (int k = 0; k < n; k++) after += out[k] * out[k], after_float += (double)f[k] * (double)f[k];
        CHECK(fabs(after / before - 1) < 1e-12, "matrix %d: norm off by %g", i, after / before - 1);
        CHECK(fabs(after_float / before - 1) < 4e-7, "matrix %d: norm in float off by %g", i, after_float / before - 1);
    }
}

/* The makers of matrices agree with what they say: where the axes go. */
TEST(matrices_are_what_they_say) {
    float m[9], n[9], half = 0.70710678f, q[4] = {3 * half, 0, 0, 3 * half}, z[3] = {0, 0, 2}, axis[3] = {1, -2, 0.5f},
          zero[4] = {0, 0, 0, 0};
    CHECK(isogi_sh_matrix_from_quaternion(m, q) == ISOGI_OK, "%s", "a quarter turn about z");
    CHECK(isogi_sh_matrix_from_axis_angle(n, z, pi / 2) == ISOGI_OK, "%s", "the same");
    const float quarter[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}; /* x to y */
    for (int i = 0; i < 9; i++)
        CHECK(fabsf(m[i] - quarter[i]) < 1e-6f && fabsf(n[i] - quarter[i]) < 1e-6f, "entry %d: %g %g", i, (double)m[i], (double)n[i]);
    isogi_sh_matrix_from_euler_zyz(m, 0, pi / 2, 0); /* about y: z to x */
    CHECK(fabsf(m[2] - 1) < 1e-6f && fabsf(m[8]) < 1e-6f, "z goes to %g %g %g", (double)m[2], (double)m[5], (double)m[8]);
    isogi_sh_matrix_from_axis_angle(m, axis, 1.234);
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) sum += (double)m[3 * i + k] * (double)axis[k];
        CHECK(fabs(sum - (double)axis[i]) < 1e-6, "the axis stays: %g", sum);
    }
    CHECK(isogi_sh_matrix_from_quaternion(m, zero) == ISOGI_INVALID && isogi_sh_matrix_from_axis_angle(m, zero, 1) == ISOGI_INVALID, "%s",
          "zero");
    CHECK(isogi_sh_matrix_from_axis_angle(m, axis, NAN) == ISOGI_INVALID &&
              isogi_sh_matrix_from_euler_zyz(m, 0, INFINITY, 0) == ISOGI_INVALID,
          "%s", "not finite");
    CHECK(isogi_sh_rotate_z(m, m, 3, 1, NAN) == ISOGI_INVALID, "%s", "angle");
}

/* Rodrigues' formula, for half the angle's sine along the axis and cosine, of any length: long double, from the vectors as they are
   rounded. */
static void turn_of(long double m[9], long double w, const double axis[3], long double s) {
    long double a[3] = {axis[0] * s, axis[1] * s, axis[2] * s}, norm = sqrtl(w * w + a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    w /= norm, a[0] /= norm, a[1] /= norm, a[2] /= norm;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            m[3 * i + k] = 2 * a[i] * a[k] + (i == k ? 2 * w * w - 1 : (k == (i + 1) % 3 ? -2 : 2) * w * a[3 - i - k]);
}

/* In double, of vectors of any length: rotations to 1e-15 each entry, orthonormal to 2e-15, that agree with the float ones to their
   rounding, and with rotations about z alone. What is wrong is reported, and leaves the matrix. */
TEST(matrices_in_double) {
    static const double lengths[] = {1, 3, 1e-320, 1e-160, 1e160, 1.5e308};
    enum { ORDER = 20, N = ORDER * ORDER };
    static double c[3 * N], once[3 * N], about[3 * N];
    test_random r = {44};
    for (int i = 0; i < 3 * N; i++) c[i] = random_range(&r, -1, 1);
    for (int round = 0; round < 60; round++) {
        double axis[3], angle = random_range(&r, -7, 7), length = lengths[round % 6], m[9], n[9], v[3], q[4], worst = 0,
                        rounding = length < 1e-300 ? 1e-3 : 0, off = 0;
        long double exact[2][9];
        float mf[9], nf[9], axis_f[3], q_f[4];
        random_direction(&r, axis);
        if (round % 12 < 6) axis[0] = axis[1] = 0, axis[2] = round % 12 < 3 ? 1 : -1;
        for (int k = 0; k < 3; k++)
            v[k] = length * axis[k], q[k + 1] = length * sin(angle / 2) * axis[k], axis_f[k] = (float)axis[k],
            q_f[k + 1] = (float)(sin(angle / 2) * axis[k]);
        q[0] = length * cos(angle / 2), q_f[0] = (float)cos(angle / 2);
        CHECK(isogi_sh_matrix_from_axis_angle_f64(m, v, angle) == ISOGI_OK && isogi_sh_matrix_from_quaternion_f64(n, q) == ISOGI_OK,
              "length %g", length);
        CHECK(isogi_sh_matrix_from_axis_angle(mf, axis_f, angle) == ISOGI_OK && isogi_sh_matrix_from_quaternion(nf, q_f) == ISOGI_OK,
              "length %g", length);
        turn_of(exact[0], cosl(angle / 2.0L), v,
                sinl(angle / 2.0L) / sqrtl((long double)v[0] * v[0] + (long double)v[1] * v[1] + (long double)v[2] * v[2]));
        turn_of(exact[1], q[0], q + 1, 1);
        for (int i = 0; i < 9; i++) {
            double dot = 0;
            for (int k = 0; k < 3; k++) dot += m[3 * (i / 3) + k] * m[3 * (i % 3) + k];
            off = fmax(off, fmax(fabs((double)(m[i] - exact[0][i])), fabs((double)(n[i] - exact[1][i]))));
            worst = fmax(worst, fabs(dot - (i / 3 == i % 3)));
            CHECK(fabs(m[i] - (double)mf[i]) < 4e-7 + rounding && fabs(m[i] - (double)nf[i]) < 4e-7 + rounding,
                  "length %g, entry %d: %g %g %g", length, i, m[i], (double)mf[i], (double)nf[i]);
        }
        CHECK(off <= 1e-15 * ROUNDING_FACTOR && worst <= 2e-15 * ROUNDING_FACTOR, "length %g: %g off, orthonormal to %g", length, off,
              worst);
        if (round % 12 >= 6) continue;
        int order = 1 + round % ORDER, channels = 1 + round % 3, count = order * order * channels;
        CHECK(isogi_sh_rotate_f64(once, c, order, channels, m) == ISOGI_OK &&
                  isogi_sh_rotate_z_f64(about, c, order, channels, axis[2] * angle) == ISOGI_OK,
              "order %d", order);
        for (int i = 0; i < count; i++)
            CHECK(fabs(once[i] - about[i]) <= 2e-14 * ROUNDING_FACTOR, "order %d, %d about z: %g %g", order, i, once[i], about[i]);
    }
    for (int round = 0; round < 20; round++) {
        double a = random_range(&r, -7, 7), b = random_range(&r, -7, 7), angle = random_range(&r, -7, 7), m[9], parts[3][9],
               z[3] = {0, 0, 1}, y[3] = {0, 1, 0}, product[9], all[9];
        CHECK(isogi_sh_matrix_from_euler_zyz_f64(m, a, b, angle) == ISOGI_OK, "round %d", round);
        isogi_sh_matrix_from_axis_angle_f64(parts[0], z, a), isogi_sh_matrix_from_axis_angle_f64(parts[1], y, b),
            isogi_sh_matrix_from_axis_angle_f64(parts[2], z, angle);
        for (int i = 0; i < 9; i++)
            product[i] = parts[0][3 * (i / 3)] * parts[1][i % 3] + parts[0][3 * (i / 3) + 1] * parts[1][3 + i % 3] +
                         parts[0][3 * (i / 3) + 2] * parts[1][6 + i % 3];
        for (int i = 0; i < 9; i++)
            all[i] = product[3 * (i / 3)] * parts[2][i % 3] + product[3 * (i / 3) + 1] * parts[2][3 + i % 3] +
                     product[3 * (i / 3) + 2] * parts[2][6 + i % 3];
        for (int i = 0; i < 9; i++) CHECK(fabs(m[i] - all[i]) < 3e-15, "Euler angles, entry %d: %g %g", i, m[i], all[i]);
    }
    double m[9] = {7}, zero[4] = {0, 0, 0, 0}, bad[4] = {1, (double)NAN, 0, (double)INFINITY}, z[3] = {0, 0, 1};
    CHECK(isogi_sh_matrix_from_quaternion_f64(m, zero) == ISOGI_INVALID && isogi_sh_matrix_from_quaternion_f64(m, bad) == ISOGI_INVALID &&
        isogi_sh_matrix_from_quaternion_f64(m, NULL) == ISOGI_INVALID, "%s", "quaternion");
    CHECK(isogi_sh_matrix_from_axis_angle_f64(m, zero, 1) == ISOGI_INVALID &&
        isogi_sh_matrix_from_axis_angle_f64(m, bad, 1) == ISOGI_INVALID &&
            isogi_sh_matrix_from_axis_angle_f64(m, z, (double)NAN) == ISOGI_INVALID, "%s", "axis");
    CHECK(isogi_sh_matrix_from_euler_zyz_f64(m, 0, 0, (double)INFINITY) == ISOGI_INVALID &&
        isogi_sh_matrix_from_euler_zyz_f64(NULL, 0, 0, 0) == ISOGI_INVALID, "%s", "angles");
    CHECK(isogi_sh_rotate_z_f64(m, m, 1, 1, (double)NAN) == ISOGI_INVALID && isogi_sh_rotate_z_f64(m, NULL, 1, 1, 0) == ISOGI_INVALID &&
        isogi_sh_rotate_z_f64(m, m, 102, 1, 0) == ISOGI_INVALID, "%s", "about z");
    CHECK(m[0] == 7, "%s", "outputs untouched");
}

/* Mirrored in an axis and evaluated is evaluated at the mirrored direction, exactly. */
TEST(mirrors) {
    enum { ORDER = 8, N = ORDER * ORDER };
    float c[N], mirrored[N], y[N];
    test_random r = {27};
    for (int axis = 0; axis < 3; axis++)
        for (int round = 0; round < 20; round++) {
            double d[3], a = 0, b = 0;
            float w[1][3];
            for (int i = 0; i < N; i++) c[i] = (float)random_range(&r, -1, 1);
            CHECK(isogi_sh_mirror(mirrored, c, ORDER, 1, axis) == ISOGI_OK, "axis %d", axis);
            random_direction(&r, d);
            for (int k = 0; k < 3; k++) w[0][k] = (float)d[k];
            isogi_sh_eval(y, ORDER, (const float(*)[3])w, 1);
            for (int i = 0; i < N; i++) a += (double)mirrored[i] * (double)y[i];
            w[0][axis] = -w[0][axis];
            isogi_sh_eval(y, ORDER, (const float(*)[3])w, 1);
            for (int i = 0; i < N; i++) b += (double)c[i] * (double)y[i];
            CHECK(fabs(a - b) < 1e-6, "axis %d: %g %g", axis, a, b);
        }
    CHECK(isogi_sh_mirror(c, c, ORDER, 1, 3) == ISOGI_INVALID, "%s", "axis 3");
}

/* Ten thousand small rotations in double: the norm of an order-6 expansion drifts by less than 2e-12 (the same
   half ulp ten thousand times), and they arrive where one large
   rotation does; in float by less than 2e-5. Rotations by 0, pi and 1e-9 do what they should. */
TEST(composed_rotations_do_not_drift) {
    enum { ORDER = 6, N = ORDER * ORDER, TURNS = 10000 };
    double c[N], start[N], before = 0, after = 0, after_float = 0, angle = 2 * pi / TURNS,
           m[9] = {cos(angle), 0, sin(angle), 0, 1, 0, -sin(angle), 0, cos(angle)};
    float f[N], mf[9];
    test_random r = {28};
    for (int i = 0; i < N; i++) f[i] = (float)random_range(&r, -1, 1), start[i] = c[i] = (double)f[i], before += c[i] * c[i];
    for (int i = 0; i < 9; i++) mf[i] = (float)m[i];
    for (int i = 0; i < TURNS; i++) isogi_sh_rotate_f64(c, c, ORDER, 1, m), isogi_sh_rotate(f, f, ORDER, 1, mf);
    double worst = 0;
    for (int i = 0; i < N; i++)
        after += c[i] * c[i], after_float += (double)f[i] * (double)f[i], worst = fmax(worst, fabs(c[i] - start[i]));
    printf("    norm drift %.3g, float %.3g; distance after a full circle %.3g\n", after / before - 1, after_float / before - 1, worst);
    CHECK(fabs(after / before - 1) < 2e-12, "drift %g", after / before - 1);
    CHECK(fabs(after_float / before - 1) < 2e-5, "drift %g", after_float / before - 1);
    CHECK(worst < 1e-10, "distance %g", worst);
    /* Orders 3 to 5 in float take the matrix as it is, whose roundings add up: the same one each time, and another each time. */
    for (int order = 3; order <= 5; order++)
        for (int random = 0; random < 2; random++) {
            for (int i = 0; i < N; i++) f[i] = (float)start[i];
            before = after_float = 0;
            for (int i = 0; i < TURNS; i++) {
                double turn[9];
                if (random) random_rotation(&r, turn);
                for (int k = 0; k < 9; k++) mf[k] = (float)(random ? turn[k] : m[k]);
                isogi_sh_rotate(f, f, order, 1, mf);
            }
            for (int i = 1; i < order * order; i++) before += start[i] * start[i], after_float += (double)f[i] * (double)f[i];
            printf("    order %d in float, %s: norm drift %.3g\n", order, random ? "random rotations" : "the same rotation",
                   sqrt(after_float / before) - 1);
            CHECK(fabs(sqrt(after_float / before) - 1) < 5e-4, "order %d: drift %g", order, sqrt(after_float / before) - 1);
        }
    double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, half[9] = {-1, 0, 0, 0, 1, 0, 0, 0, -1}, tiny[9] = {1, 0, 1e-9, 0, 1, 0, -1e-9, 0, 1},
           out[N];
    isogi_sh_rotate_f64(out, start, ORDER, 1, identity);
    for (int i = 0; i < N; i++) CHECK(fabs(out[i] - start[i]) < 2e-15, "identity: %g %g", out[i], start[i]);
    isogi_sh_rotate_f64(out, start, ORDER, 1, tiny);
    for (int i = 0; i < N; i++) CHECK(fabs(out[i] - start[i]) < 1e-8, "1e-9: %g %g", out[i], start[i]);
    isogi_sh_rotate_f64(out, start, ORDER, 1, half);
    isogi_sh_rotate_f64(out, out, ORDER, 1, half);
    for (int i = 0; i < N; i++) CHECK(fabs(out[i] - start[i]) < 4e-15, "half a turn twice: %g %g", out[i], start[i]);
}

/* ---- more algebra ---- */

/* A product's expansion is the projection of the product of the functions, by quadrature of the reference; orders 1..11 and, in the long
   suite, 26; all but orders 3 to 5 are found in double. Then the matrix of a fixed factor does the same, is symmetric, and many at once
   are one by one. */
TEST(products_are_exact) {
    enum { MAX = 26, COUNT = 19 };
    static float a[COUNT * MAX * MAX], b[COUNT * MAX * MAX], out[COUNT * MAX * MAX], matrix[MAX * MAX * MAX * MAX];
    static float single[MAX * MAX];
    static double y[MAX * MAX], expected[MAX * MAX];
    double worst = 0;
    long double node[64], weight[64];
    test_random r = {29};
    for (int order = 1; order <= (LONG_SUITE ? MAX : 11); order += order < 11 ? 1 : 15) {
        int n = order * order, latitudes = (3 * order) / 2 + 1, longitudes = 3 * order;
        for (int i = 0; i < COUNT * n; i++) a[i] = (float)random_range(&r, -1, 1), b[i] = (float)random_range(&r, -1, 1);
        CHECK(isogi_sh_product(out, a, b, order, COUNT) == ISOGI_OK, "order %d", order);
        reference_nodes(node, weight, latitudes);
        for (int e = 0; e < COUNT; e += order >= 3 && order <= 5 ? 1 : 9) {
            for (int i = 0; i < n; i++) expected[i] = 0;
            for (int i = 0; i < latitudes * longitudes; i++) {
                double z = (double)node[i / longitudes], s = sqrt(1 - z * z), phi = 2 * pi * (i % longitudes) / longitudes, f = 0, g = 0;
                double d[1][3] = {{s * cos(phi), s * sin(phi), z}};
                isogi_sh_eval_f64(y, order, (const double(*)[3])d, 1);
                for (int k = 0; k < n; k++) f += (double)a[e * n + k] * y[k], g += (double)b[e * n + k] * y[k];
                for (int k = 0; k < n; k++) expected[k] += (double)weight[i / longitudes] * 2 * pi / longitudes * f * g * y[k];
            }
            if (e == 0) { /* alone, and in a batch: as a share of what it can be */
                double norm = 0, other = 0, most = 0;
                for (int k = 0; k < n; k++) norm += (double)a[k] * (double)a[k], other += (double)b[k] * (double)b[k];
                isogi_sh_product(single, a, b, order, 1);
                for (int k = 0; k < n; k++) most = fmax(most, fabs((double)single[k] - expected[k]) / sqrt(norm * other));
                for (int k = 0; k < n; k++) most = fmax(most, fabs((double)out[k] - expected[k]) / sqrt(norm * other));
                worst = fmax(worst, most);
                CHECK(most <= 1e-7, "order %d alone: %g of both norms", order, most);
            }
            for (int k = 0; k < n; k++)
                CHECK(fabs((double)out[e * n + k] - expected[k]) < (order >= 3 && order <= 5 ? 1.5e-5 : 1e-7 + 6e-8 * fabs(expected[k])),
                      "order %d, %d of %d: %.9g, expected %.9g", order, k, e, (double)out[e * n + k], expected[k]);
        }
        printf("    order %d: %.3g of both norms\n", order, worst);
        worst = 0; /* the matrix against the product */
        double norm = 0, other = 0;
        for (int k = 0; k < n; k++) norm += (double)a[k] * (double)a[k], other += (double)b[k] * (double)b[k];
        CHECK(isogi_sh_product_matrix(matrix, a, order) == ISOGI_OK, "order %d", order);
        for (int i = 0; i < n; i++) {
            double sum = 0;
            for (int k = 0; k < n; k++) {
                sum += (double)matrix[i * n + k] * (double)b[k];
                CHECK(fabsf(matrix[i * n + k] - matrix[k * n + i]) <= 0, "order %d: %g %g", order, (double)matrix[i * n + k],
                      (double)matrix[k * n + i]);
            }
            worst = fmax(worst, fabs(sum - (double)out[i]) / sqrt(norm * other));
        }
        CHECK(worst <= 1e-7, "order %d: matrix and product differ by %g of both norms", order, worst);
        worst = 0;
    }
}

/* Zonal lobes: turned to a direction and evaluated there they depend on the angle alone; convolution with the clamped cosine as a
   zonal kernel is the cosine convolution; convolving a delta with a kernel is the kernel turned to the delta. */
TEST(zonal_functions) {
    enum { ORDER = 7, N = ORDER * ORDER };
    float zonal[ORDER], lobe[N], y[N], delta[N], other[N], cosine[ORDER];
    test_random r = {30};
    for (int round = 0; round < 20; round++) {
        double d[3], w[3], a = 0, b = 0, t = 0;
        for (int l = 0; l < ORDER; l++) zonal[l] = (float)random_range(&r, -1, 1);
        random_direction(&r, d), random_direction(&r, w);
        float df[3] = {(float)d[0], (float)d[1], (float)d[2]}, wf[1][3] = {{(float)w[0], (float)w[1], (float)w[2]}};
        CHECK(isogi_sh_zonal_to_direction(lobe, ORDER, zonal, df) == ISOGI_OK, "%d", round);
        isogi_sh_eval(y, ORDER, (const float(*)[3])wf, 1);
        for (int i = 0; i < N; i++) a += (double)lobe[i] * (double)y[i];
        for (int k = 0; k < 3; k++) t += d[k] * w[k];
        float at[1][3] = {{(float)sqrt(1 - t * t), 0, (float)t}};
        isogi_sh_eval(y, ORDER, (const float(*)[3])at, 1);
        for (int l = 0; l < ORDER; l++) b += (double)zonal[l] * (double)y[l * (l + 1)];
        CHECK(fabs(a - b) < 5e-6, "%g, expected %g", a, b);
        isogi_sh_eval(delta, ORDER, (const float(*)[3]) & df, 1);
        CHECK(isogi_sh_convolve(other, delta, ORDER, 1, zonal) == ISOGI_OK, "%d", round);
        for (int i = 0; i < N; i++) CHECK(fabsf(other[i] - lobe[i]) < 3e-6f, "%d: %g %g", i, (double)other[i], (double)lobe[i]);
        CHECK(isogi_sh_cosine_zonal(cosine, ORDER) == ISOGI_OK, "%d", round);
        isogi_sh_convolve(other, delta, ORDER, 1, cosine);
        isogi_sh_convolve_cosine(delta, delta, ORDER, 1);
        for (int i = 0; i < N; i++) CHECK(fabsf(other[i] - delta[i]) < 1e-6f, "%d: %g %g", i, (double)other[i], (double)delta[i]);
    }
}

/* Every order to 12 and the maximum, at every level, for vectors of any length, those next to 1 too, against 128 bits: roundings of values
   up to 1, and what the header allows order 5, which has a way in float. */
TEST(zonal_functions_are_exact) {
    static const double lengths[] = {1, 1, 1.0004, 0.9996, 1.003, 0.997, 1.02, 0.98, 1.3, 0.7, 3, 1e-30, 1e30};
    enum { LENGTHS = sizeof lengths / sizeof *lengths };
    static float lobe[MAX_COUNT + 1];
    static quad y[MAX_COUNT];
    for (int order = 1; order <= 13; order++) {
        const int n = order > 12 ? ISOGI_SH_MAX_ORDER : order;
        test_random r = {61};
        double worst[3] = {0, 0, 0};
        int level = 0;
        for (int i = 0; i < (n > 12 ? (QUICK_SUITE ? 26 : 40) : LONG_SUITE ? 4000 : QUICK_SUITE ? 104 : 260); i++) {
            double d[3], length = lengths[i % LENGTHS];
            float v[3], zonal[ISOGI_SH_MAX_ORDER];
            quad e[3];
            if (i / LENGTHS % 2) random_direction(&r, d);
            else hard_direction(d, i / (2 * LENGTHS) * 7 % 294, &r);
            for (int k = 0; k < 3; k++) v[k] = rounded(length * d[k]), e[k] = (quad)v[k];
            for (int l = 0; l < n; l++) zonal[l] = (float)random_range(&r, -1, 1);
            reference_eval(y, n, e);
            for (level = 0; level < 3 && level <= BEST_LEVEL; level++) {
                instruction_level = level;
                lobe[n * n] = 5;
                CHECK(isogi_sh_zonal_to_direction(lobe, n, zonal, v) == ISOGI_OK && lobe[n * n] == 5, "order %d", n);
                for (int l = 0; l < n; l++)
                    for (int k = l * l; k < (l + 1) * (l + 1); k++) {
                        double error = fabs((double)(y[k] * quad_sqrt(4 * (quad)pi / (quad)(2 * l + 1)) * (quad)zonal[l] - (quad)lobe[k]));
                        worst[level] = error <= worst[level] ? worst[level] : error;
                    }
            }
        }
        instruction_level = BEST_LEVEL;
        printf("    order %d: %.3g, %.3g, %.3g at levels 0, 1, 2\n", n, worst[0], worst[1], worst[2]);
        for (int k = 0; k < level; k++)
            CHECK(worst[k] <= (n == 5 && (k > 0 || LINKED) ? 4.5e-7 : 6e-8) * ROUNDING_FACTOR, "order %d, level %d: %g", n, k, worst[k]);
    }
}

TEST(sums_scalings_and_energy) {
    float a[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, b[12] = {3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3}, c[12];
    double energy[2];
    CHECK(isogi_sh_add(c, a, b, 2, 3) == ISOGI_OK && c[0] == 4 && c[11] == 15, "%g %g", (double)c[0], (double)c[11]);
    CHECK(isogi_sh_scale(c, a, 2, 2, 3) == ISOGI_OK && c[0] == 2 && c[11] == 24, "%g %g", (double)c[0], (double)c[11]);
    CHECK(isogi_sh_lerp(c, a, b, 0.25f, 2, 3) == ISOGI_OK && c[0] == 1.5f && c[11] == 9.75f, "%g %g", (double)c[0], (double)c[11]);
    CHECK(isogi_sh_band_energy(energy, a, 2, 3) == ISOGI_OK && energy[0] == 14 && energy[1] == 650 - 14, "%g %g", energy[0], energy[1]);
}

/* A window of width order: the factor at half its width, nothing lost at degree 0; de-ringing leaves no negative value, and any wider
   window would. Lobes of a delta, a hard hemisphere and a sun with sky. Rings are measured with and without. */
TEST(windows_and_deringing) {
    enum { ORDER = 8, N = ORDER * ORDER };
    static const char *const names[] = {"Hann", "Lanczos", "Gauss"};
    static const double at_half[] = {0.5, 0.63661977236758134, 0.5}, windowed[] = {0.029, 0.045, 0.027};
    float delta[3 * N], sky[3 * N], out[3 * N], up[3] = {0.3f, 1, 0.2f}, white[3] = {1, 0.9f, 0.8f}, black[3] = {0, 0, 0};
    isogi_light sun = {.vector = {1, 2, 3}, .rgb = {1, 2, 3}};
    isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    isogi_sh_project(delta, ORDER, &lighting, NULL);
    isogi_sh_hemisphere_sky(sky, ORDER, up, white, black);
    for (int kind = 0; kind < 3; kind++)
        for (int which = 0; which < 2; which++) {
            const float *c = which ? sky : delta;
            double width = -1, low[3] = {0, 0, 0}, high = 0;
            CHECK(isogi_sh_window(out, c, ORDER, 3, (isogi_sh_window_kind)kind, ORDER) == ISOGI_OK, "%s", names[kind]);
            CHECK(out[0] == c[0], "%s: degree 0 %g", names[kind], (double)out[0]);
            int i = 3 * (4 * 5 + 1);
            CHECK(fabs((double)out[i] - at_half[kind] * (double)c[i]) < 1e-6, "%s at half width: %g of %g", names[kind], (double)out[i],
                  (double)c[i]);
            for (int step = 0; step < 3; step++) { /* none, width = order, de-ringed */
                if (step == 0) memcpy(out, c, sizeof out);
                if (step == 1) isogi_sh_window(out, c, ORDER, 3, (isogi_sh_window_kind)kind, ORDER);
                if (step == 2) CHECK(isogi_sh_dering(out, c, ORDER, 3, (isogi_sh_window_kind)kind, &width) == ISOGI_OK, "%s", names[kind]);
                high = 0;
                test_random same = {32};
                for (int j = 0; j < 20000; j++) {
                    double d[3];
                    random_direction(&same, d);
                    float w[1][3] = {{(float)d[0], (float)d[1], (float)d[2]}}, rgb[3];
                    isogi_sh_eval_sum(rgb, out, ORDER, 3, (const float(*)[3])w, 1);
                    low[step] = fmin(low[step], (double)rgb[0]), high = fmax(high, (double)rgb[0]);
                }
                low[step] /= high;
            }
            printf("    %s, %s: lowest value / highest %.4f, windowed %.4f, de-ringed %.6f at width %.3f\n", which ? "hemisphere" : "delta",
                   names[kind], low[0], low[1], low[2], width);
            CHECK(low[0] < -0.02, "there are rings to begin with: %g", low[0]);
            CHECK(low[2] > -1e-5, "de-ringed: %g", low[2]);
            CHECK(which || (fabs(low[0] + 0.14) < 5e-3 && fabs(low[1] + windowed[kind]) < 5e-4), "what the header says of a delta: %g, %g",
                  low[0], low[1]);
            CHECK(width > (which ? 2.05 : 1.35) && width < (which ? 2.75 : 1.75), "what the header says of the width: %g", width);
            isogi_sh_window(out, c, ORDER, 3, (isogi_sh_window_kind)kind, width * 1.1);
            double wider = 0;
            for (int j = 0; j < 20000; j++) {
                double d[3];
                test_random one = {(uint64_t)j};
                random_direction(&one, d);
                float w[1][3] = {{(float)d[0], (float)d[1], (float)d[2]}}, rgb[3];
                isogi_sh_eval_sum(rgb, out, ORDER, 3, (const float(*)[3])w, 1);
                wider = fmin(wider, (double)rgb[0]);
            }
            CHECK(wider < 0, "a window a tenth wider rings: %g", wider);
        }
    double width = -1;
    isogi_sh_constant(out, ORDER, white);
    CHECK(isogi_sh_dering(out, out, ORDER, 3, ISOGI_SH_HANN, &width) == ISOGI_OK && width == 0, "nothing to do: width %g", width);
    out[1] = -1;
    CHECK(isogi_sh_dering(out, out, ORDER, 3, ISOGI_SH_HANN, &width) == ISOGI_INVALID, "%s", "a negative mean");
    CHECK(isogi_sh_window(out, out, ORDER, 3, ISOGI_SH_HANN, 0) == ISOGI_INVALID &&
              isogi_sh_window(out, out, ORDER, 3, ISOGI_SH_HANN, NAN) == ISOGI_INVALID,
          "%s", "width");
}

/* 0 is among the values. Plainly: gcc 12 for aarch64 fails to compile fmin and fmax in one loop. */
static void range_of(const float *value, int count, double *low, double *high) {
    float least = 0, most = 0;
    for (int i = 0; i < count; i++) least = value[i] < least ? value[i] : least, most = value[i] > most ? value[i] : most;
    *low = (double)least, *high = (double)most;
}

/* Nothing that is negative is left anywhere, in any channel: lights in a sky, whose weak rings have many troughs of almost the same depth,
   and lights that are alone. Seen from a spiral of directions. */
TEST(deringing_leaves_nothing_negative) {
    enum { MOST = 16, COUNT = 12000 };
    static float d[COUNT][3], value[COUNT], c[3 * MOST * MOST], out[3 * MOST * MOST], one[MOST * MOST];
    test_random r = {3};
    double lowest = 0;
    int windowed = 0;
    for (int i = 0; i < COUNT; i++) {
        double z = 1 - 2 * (i + 0.5) / COUNT, phi = i * 2.399963229728653, s = sqrt(1 - z * z);
        d[i][0] = (float)(s * cos(phi)), d[i][1] = (float)(s * sin(phi)), d[i][2] = (float)z;
    }
    for (int order = 4; order <= MOST; order += 4)
        for (int round = 0; round < (LONG_SUITE ? 60 : 8); round++) {
            isogi_light lights[3];
            const isogi_lighting lighting = {.lights = lights, .light_count = 3};
            double width, sky = round % 4 ? random_range(&r, 0.05, 0.35) : 0;
            memset(lights, 0, sizeof lights);
            for (int k = 0; k < 3; k++) {
                double v[3];
                random_direction(&r, v);
                for (int a = 0; a < 3; a++) lights[k].vector[a] = (float)v[a], lights[k].rgb[a] = (float)random_range(&r, 0.2, 1.2);
                lights[k].radius = (float)random_range(&r, 0, 0.3);
            }
            isogi_sh_project(c, order, &lighting, NULL);
            for (int k = 0; k < 3; k++) c[k] += (float)(sky * order * order / 12);
            CHECK(isogi_sh_dering(out, c, order, 3, (isogi_sh_window_kind)(round % 3), &width) == ISOGI_OK, "order %d", order);
            windowed += width > 0;
            for (int k = 0; k < 3; k++) {
                double low, high;
                for (int i = 0; i < order * order; i++) one[i] = out[3 * i + k];
                isogi_sh_eval_sum(value, one, order, 1, (const float(*)[3])d, COUNT);
                range_of(value, COUNT, &low, &high);
                lowest = fmin(lowest, low / high);
                CHECK(low >= -1e-5 * high, "order %d, round %d, channel %d, width %g: %g of the largest", order, round, k, width,
                      low / high);
            }
        }
    printf("    %d windows; lowest value %.3g of the largest\n", windowed, lowest);
    CHECK(windowed >= 16, "%d windows", windowed);
}

/* The window is the widest: of degree 1, where it is known; and of lobes at order 9, where narrower ones than the widest ring again, no
   window of a series of wider ones leaves nothing negative. A sky without a mean becomes black. */
TEST(deringing_takes_the_widest_window) {
    enum { ORDER = 9, N = ORDER * ORDER, COUNT = 5000 };
    static float d[COUNT][3], value[COUNT];
    float c[3 * N], out[3 * N];
    test_random r = {60};
    double width, worst = 0;
    for (int i = 0; i < COUNT; i++) {
        double z = 1 - 2 * (i + 0.5) / COUNT, phi = i * 2.399963229728653, s = sqrt(1 - z * z);
        d[i][0] = (float)(s * cos(phi)), d[i][1] = (float)(s * sin(phi)), d[i][2] = (float)z;
    }
    for (int i = 0; i < 30; i++) { /* 1 + b x: as far as the factor of degree 1 is 1 / b, and down to -1e-5 of the largest value */
        double b = i < 3 ? 1.01 : random_range(&r, 1.1, 20), expected[2];
        for (int k = 0; k < 12; k++) c[k] = 0;
        c[1] = (float)sqrt(4 * pi), c[0] = c[2] = 1, c[10] = (float)(b * sqrt(4 * pi / 3));
        CHECK(isogi_sh_dering(out, c, 2, 3, (isogi_sh_window_kind)(i % 3), &width) == ISOGI_OK, "%d", i);
        for (int last = 0; last < 2; last++) {
            double low = 0.01, high = 1000;
            for (int k = 0; k < 60; k++) {
                double w = sqrt(low * high), x = 1 / w, factor = i % 3 == 0 ? x < 1 ? (1 + cos(pi * x)) / 2 : 0
                    : i % 3 == 1 ? x < 1 ? sin(pi * x) / (pi * x) : 0 : exp2(-4 * x * x);
                if (factor * b > 1 + last * 2e-5) high = w;
                else low = w;
            }
            expected[last] = low;
        }
        worst = fmax(worst, 1 - width / expected[0]);
        CHECK(width > expected[0] * (1 - 1e-5) && width < expected[1], "1 + %g x: width %.9g, not %.9g to %.9g", b, width, expected[0],
              expected[1]);
    }
    printf("    widths of degree 1 are up to %.3g too narrow\n", worst);
    for (int round = 0; round < 6 + (LONG_SUITE ? 30 : 0); round++) {
        if (round == 1) r.state = 86025; /* leaves nothing negative at 1.75 and a little below 2.468, and does between them */
        for (int i = 0; i < N; i++) c[i] = 0;
        for (int k = 0; k < 1 + round % 4; k++) {
            double v[3], weight = random_unit(&r);
            float y[N], direction[1][3];
            random_direction(&r, v);
            for (int a = 0; a < 3; a++) direction[0][a] = (float)v[a];
            isogi_sh_eval(y, ORDER, (const float(*)[3])direction, 1);
            for (int i = 0; i < N; i++) c[i] += (float)weight * y[i];
        }
        CHECK(isogi_sh_dering(out, c, ORDER, 1, (isogi_sh_window_kind)(round % 3), &width) == ISOGI_OK && width > 0, "round %d", round);
        if (round == 1) CHECK(fabs(width - 2.468) < 1e-3, "width %g", width);
        for (double f = 1.02; f < 60; f *= f < 4 ? 1.03 : 1.5) {
            double low, high;
            isogi_sh_window(out, c, ORDER, 1, (isogi_sh_window_kind)(round % 3), width * f);
            isogi_sh_eval_sum(value, out, ORDER, 1, (const float(*)[3])d, COUNT);
            range_of(value, COUNT, &low, &high);
            CHECK(low < -1e-7 * high, "round %d: width %g, and %g leaves nothing negative", round, width, width * f);
        }
    }
    for (int kind = 0; kind < 3; kind++) {
        for (int i = 0; i < N; i++) c[i] = i ? 1 : 0;
        CHECK(isogi_sh_dering(out, c, ORDER, 1, (isogi_sh_window_kind)kind, &width) == ISOGI_OK, "kind %d", kind);
        for (int i = 0; i < N; i++) CHECK(out[i] == 0, "without a mean, kind %d: %g", kind, (double)out[i]);
    }
}

/* Converted back and forth nothing changes, and written-out values of degree 1 and 2 are where other software has them. */
TEST(conventions_convert) {
    enum { ORDER = 6, N = ORDER * ORDER };
    float c[2 * N], there[2 * N], back[2 * N];
    test_random r = {33};
    for (int i = 0; i < 2 * N; i++) c[i] = (float)random_range(&r, -1, 1);
    for (int a = 0; a < 24; a++)
        for (int b = 0; b < 24; b++) {
            isogi_sh_convention from = {(isogi_sh_normalisation)(a % 3), (isogi_sh_ordering)(a / 3 % 4), a / 12};
            isogi_sh_convention to = {(isogi_sh_normalisation)(b % 3), (isogi_sh_ordering)(b / 3 % 4), b / 12};
            CHECK(isogi_sh_convert(there, c, ORDER, 2, from, to) == ISOGI_OK &&
                      isogi_sh_convert(back, there, ORDER, 2, to, from) == ISOGI_OK,
                  "%d to %d", a, b);
            for (int i = 0; i < 2 * N; i++) CHECK(fabsf(back[i] - c[i]) < 2e-7f, "%d to %d: %g %g", a, b, (double)back[i], (double)c[i]);
        }
    isogi_sh_convention ours = {ISOGI_SH_ORTHONORMAL, ISOGI_SH_ACN, 0}, sid = {ISOGI_SH_SN3D, ISOGI_SH_SID, 0},
                        pairs = {ISOGI_SH_ORTHONORMAL, ISOGI_SH_PAIRS, 1};
    float one[9] = {0, 1, 2, 3, 4, 5, 6, 7, 8}, out[9];
    isogi_sh_convert(out, one, 3, 1, ours, sid); /* 1 -1 0; 2 -2 1 -1 0: of l(l+1)+m: 3 1 2 8 4 7 5 6 */
    static const int sid_order[9] = {0, 3, 1, 2, 8, 4, 7, 5, 6}, pair_order[9] = {0, 2, 3, 1, 6, 7, 5, 8, 4};
    for (int i = 0; i < 9; i++) {
        int l = i > 3 ? 2 : i > 0;
        double expected = sid_order[i] * sqrt((2 * l + 1) / (4 * pi)); /* coefficients shrink where the basis grows */
        CHECK(fabs((double)out[i] - expected) < 1e-6, "SID %d: %g, expected %g", i, (double)out[i], expected);
    }
    isogi_sh_convert(out, one, 3, 1, ours, pairs);
    for (int i = 0; i < 9; i++) {
        int odd = pair_order[i] == 1 || pair_order[i] == 3 || pair_order[i] == 5 || pair_order[i] == 7;
        CHECK(fabsf(out[i] - (float)(odd ? -pair_order[i] : pair_order[i])) < 1e-6f, "pairs %d: %g", i, (double)out[i]);
    }
    { /* W X Y Z R S T U V K L M N O P Q, which are degree and m of 0 0, 1 1, 1 -1, 1 0, 2 0, 2 1, 2 -1, 2 2, 2 -2, 3 0 .. 3 -3 */
        static const int m[16] = {0, 1, -1, 0, 0, 1, -1, 2, -2, 0, 1, -1, 2, -2, 3, -3};
        const isogi_sh_convention fuma = {ISOGI_SH_ORTHONORMAL, ISOGI_SH_FUMA, 0};
        float sixteen[16], there16[16];
        for (int i = 0; i < 16; i++) sixteen[i] = (float)i;
        CHECK(isogi_sh_convert(there16, sixteen, 4, 1, ours, fuma) == ISOGI_OK, "%s", "Furse and Malham");
        for (int i = 0; i < 16; i++) {
            int l = (int)sqrt((double)i);
            CHECK(there16[i] == (float)(l * (l + 1) + m[i]), "Furse and Malham %d: %g", i, (double)there16[i]);
        }
    }
    ours.ordering = (isogi_sh_ordering)7;
    CHECK(isogi_sh_convert(out, one, 3, 1, ours, sid) == ISOGI_INVALID, "%s", "ordering 7");
}

/* ---- simple environments and fits ---- */

typedef struct cone_case { double axis[3], cosine; } cone_case;
static void cone_function(void *user, const double d[3], double *value) {
    const cone_case *c = (const cone_case *)user;
    value[0] = d[0] * c->axis[0] + d[1] * c->axis[1] + d[2] * c->axis[2] > c->cosine ? 1 : 0;
}

/* Cones against Monte Carlo projection (stratified, 2e-2), and as closed forms: none, the hemisphere and all of the sphere. */
TEST(cones_and_skies) {
    enum { ORDER = 5, N = ORDER * ORDER };
    static double expected[N];
    const float axis[3] = {1, 2, -2}, rgb[3] = {1, 2, 0}, sky[3] = {2, 1, 4}, ground[3] = {1, 3, 0};
    float c[3 * N], d[3 * N], value[3];
    for (int i = 0; i < 6; i++) {
        double angle = i == 5 ? pi : 0.1 + 0.6 * i;
        cone_case user = {{1.0 / 3, 2.0 / 3, -2.0 / 3}, cos(angle)};
        CHECK(isogi_sh_cone(c, ORDER, axis, angle, rgb) == ISOGI_OK, "angle %g", angle);
        isogi_sh_project_random(expected, ORDER, 1, 60000, 1, 7, cone_function, &user);
        for (int k = 0; k < N; k++)
            CHECK(fabs((double)c[3 * k] - expected[k]) < 1e-2 && fabsf(c[3 * k + 1] - 2 * c[3 * k]) < 1e-5f && c[3 * k + 2] == 0,
                  "angle %g, Y%d: %g, expected %g", angle, k, (double)c[3 * k], expected[k]);
    }
    isogi_sh_constant(d, ORDER, rgb);
    for (int k = 0; k < 3 * N; k++) CHECK(fabsf(c[k] - d[k]) < 1e-6f, "a cone of pi is constant: %d: %g %g", k, (double)c[k], (double)d[k]);
    CHECK(isogi_sh_cone(c, ORDER, axis, 4, rgb) == ISOGI_INVALID && isogi_sh_cone(c, ORDER, axis, -1, rgb) == ISOGI_INVALID, "%s", "angle");
    isogi_sh_hemisphere_sky(c, ORDER, axis, sky, ground);
    isogi_sh_convolve_cosine(c, c, ORDER, 3);
    isogi_sh_eval_sum(value, c, ORDER, 3, (const float(*)[3]) & axis, 1); /* odd degrees past 1 do not reach irradiance: exact to 2e-3 */
    for (int k = 0; k < 3; k++) CHECK(fabs((double)value[k] - pi * (double)sky[k]) < 1e-5, "below the sky: %g", (double)value[k]);
    isogi_sh_gradient_sky(c, ORDER, axis, sky, ground);
    for (int side = -1; side <= 1; side++) {
        float w[1][3] = {{(float)side, (float)(2 * side), (float)(-2 * side)}};
        if (!side) w[0][0] = 2, w[0][1] = -1, w[0][2] = 0;
        isogi_sh_eval_sum(value, c, ORDER, 3, (const float(*)[3])w, 1);
        for (int k = 0; k < 3; k++) {
            double at = (double)ground[k] + 0.5 * (1 + side) * ((double)sky[k] - (double)ground[k]);
            CHECK(fabs((double)value[k] - at) < 1e-5, "gradient at %d: %g, expected %g", side, (double)value[k], at);
        }
    }
}

/* One light and an ambient term are found again, and nothing negative is returned for anything else. */
TEST(fits_find_one_light) {
    enum { ORDER = 4, N = ORDER * ORDER };
    test_random r = {34};
    for (int round = 0; round < 50; round++) {
        double d[3];
        float c[3 * N], e[3 * N], direction[3], rgb[3], ambient[3], base[3];
        random_direction(&r, d);
        isogi_light sun = {.vector = {(float)d[0], (float)d[1], (float)d[2]}, .rgb = {0, 0, 0}};
        for (int k = 0; k < 3; k++) sun.rgb[k] = (float)random_range(&r, 0.5, 3), base[k] = (float)random_range(&r, 0, 2);
        isogi_lighting lighting = {.lights = &sun, .light_count = 1};
        isogi_sh_project(c, ORDER, &lighting, NULL);
        CHECK(isogi_sh_dominant_direction(direction, rgb, c, ORDER) == ISOGI_OK, "%d", round);
        for (int k = 0; k < 3; k++)
            CHECK(fabs((double)direction[k] - d[k]) < 1e-5 && fabsf(rgb[k] - sun.rgb[k]) < 1e-4f, "alone: %g %g, expected %g %g",
                  (double)direction[k], (double)rgb[k], d[k], (double)sun.rgb[k]);
        isogi_sh_constant(e, ORDER, base);
        isogi_sh_add(c, c, e, ORDER, 3);
        CHECK(isogi_sh_fit_directional(direction, rgb, ambient, c, ORDER) == ISOGI_OK, "%d", round);
        for (int k = 0; k < 3; k++)
            CHECK(fabs((double)direction[k] - d[k]) < 1e-5 && fabsf(rgb[k] - sun.rgb[k]) < 1e-4f && fabsf(ambient[k] - base[k]) < 1e-4f,
                  "with ambient: %g %g %g, expected %g %g %g", (double)direction[k], (double)rgb[k], (double)ambient[k], d[k],
                  (double)sun.rgb[k], (double)base[k]);
        for (int i = 0; i < 3 * N; i++) c[i] = (float)random_range(&r, -1, 1);
        CHECK(isogi_sh_fit_directional(direction, rgb, ambient, c, ORDER) == ISOGI_OK, "%d", round);
        for (int k = 0; k < 3; k++) CHECK(rgb[k] >= 0 && ambient[k] >= 0, "%g %g", (double)rgb[k], (double)ambient[k]);
    }
    float c[3 * N] = {0}, direction[3], rgb[3];
    CHECK(isogi_sh_dominant_direction(direction, rgb, c, ORDER) == ISOGI_OK && direction[2] == 1 && rgb[0] == 0, "darkness: %g %g",
          (double)direction[2], (double)rgb[0]);
    CHECK(isogi_sh_dominant_direction(direction, rgb, c, 1) == ISOGI_INVALID, "%s", "order 1");
}

/* Mean square over all normals of what irradiance of a light `light` along y, and of `ambient`, differ from that of c: degree by degree. */
static double misfit(const double *c, const double *y, int order, double light, double ambient) {
    static const double factor[5] = {3.14159265358979324, 2.09439510239319549, 0.785398163397448310, 0, -0.130899693899574718};
    double sum = 0;
    for (int l = 0; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++) {
            double off = factor[l] * (c[i] - light * y[i] - (i ? 0 : sqrt(4 * pi) * ambient));
            sum += off * off;
        }
    return sum;
}

/* Nothing near a fit is closer, where its parts are positive and where one of them would be negative and is 0. */
TEST(fits_are_the_closest_without_negative_parts) {
    test_random r = {62};
    int kinds[4] = {0, 0, 0, 0};
    for (int round = 0; round < 300; round++) {
        const int order = 2 + round % 4, n = order * order;
        float c[75], direction[1][3], rgb[3], ambient[3];
        double wide[3], y[25], one[25];
        const double base = random_range(&r, -0.5, 1.5);
        for (int i = 0; i < 3 * n; i++) c[i] = (float)(random_range(&r, -1, 1) + (i < 3 ? base : 0));
        CHECK(isogi_sh_fit_directional(direction[0], rgb, ambient, c, order) == ISOGI_OK, "round %d", round);
        for (int k = 0; k < 3; k++) wide[k] = (double)direction[0][k];
        isogi_sh_eval_f64(y, order, (const double(*)[3])&wide, 1);
        for (int k = 0; k < 3; k++) {
            const double light = (double)rgb[k], rest = (double)ambient[k];
            for (int i = 0; i < n; i++) one[i] = (double)c[3 * i + k];
            const double best = misfit(one, y, order, light, rest);
            kinds[2 * (light > 0) + (rest > 0)]++;
            for (int a = -1; a <= 1; a++)
                for (int b = -1; b <= 1; b++) {
                    const double value = misfit(one, y, order, fmax(light + 0.01 * a, 0), fmax(rest + 0.01 * b, 0));
                    CHECK(value > best - 1e-6, "round %d, channel %d: light %g and ambient %g are %.9g off, %.9g is near", round, k, light,
                          rest, best, value);
                }
        }
    }
    CHECK(kinds[0] > 5 && kinds[1] > 20 && kinds[2] > 20 && kinds[3] > 20, "%d %d %d %d fits of each kind", kinds[0], kinds[1], kinds[2],
          kinds[3]);
}

/* A red, a green and a blue light along the axes: degree 1 adds their directions up, weighed by their luminances (Rec. 709). */
TEST(the_dominant_direction_is_that_of_luminance) {
    static const double luminance[3] = {0.2126, 0.7152, 0.0722}, power[3] = {3, 1, 7};
    isogi_light light[3];
    float c[3 * 9], direction[3];
    double length = 0;
    memset(light, 0, sizeof light);
    for (int k = 0; k < 3; k++) light[k].vector[k] = 1, light[k].rgb[k] = (float)power[k], length += pow(power[k] * luminance[k], 2);
    const isogi_lighting lighting = {.lights = light, .light_count = 3};
    CHECK(isogi_sh_project(c, 3, &lighting, NULL) == ISOGI_OK, "%s", "project");
    CHECK(isogi_sh_dominant_direction(direction, NULL, c, 3) == ISOGI_OK, "%s", "fit");
    for (int k = 0; k < 3; k++)
        CHECK(fabs((double)direction[k] - power[k] * luminance[k] / sqrt(length)) < 1e-6, "axis %d: %g", k, (double)direction[k]);
}

/* Truncation: what an order misses of three environments, in the mean of squares (Parseval); falls with the order, and faster the
   smoother the environment is: a point light not at all, a hemisphere as 1/order, a soft lobe exponentially. */
TEST(truncation_error_falls_with_order) {
    enum { ORDER = 33, N = ORDER * ORDER };
    static float delta[3 * N], sky[3 * N], lobe[3 * N];
    const float up[3] = {1, 1, 0}, one[3] = {1, 1, 1}, none[3] = {0, 0, 0};
    float zonal[ORDER], single[N];
    double energy[3][ORDER], total[3] = {0, 0, 0};
    isogi_light sun = {.vector = {1, 1, 0}, .rgb = {1, 1, 1}, .radius = 0.1f};
    isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    isogi_sh_project(delta, ORDER, &lighting, NULL);
    isogi_sh_hemisphere_sky(sky, ORDER, up, one, none);
    for (int l = 0; l < ORDER; l++) zonal[l] = (float)exp(-0.05 * l * (l + 1));
    isogi_sh_zonal_to_direction(single, ORDER, zonal, up);
    for (int i = 0; i < 3 * N; i++) lobe[i] = single[i / 3];
    isogi_sh_band_energy(energy[0], delta, ORDER, 3), isogi_sh_band_energy(energy[1], sky, ORDER, 3),
        isogi_sh_band_energy(energy[2], lobe, ORDER, 3);
    for (int e = 0; e < 3; e++)
        for (int l = 0; l < ORDER; l++) total[e] += energy[e][l];
    printf("    order   sun of 0.1 rad   hemisphere   soft lobe    (share of the energy of order %d that is missed)\n", ORDER);
    for (int order = 1; order < ORDER; order *= 2) {
        double missed[3];
        for (int e = 0; e < 3; e++) {
            missed[e] = 0;
            for (int l = order; l < ORDER; l++) missed[e] += energy[e][l] / total[e];
        }
        printf("    %5d   %14.4f   %10.6f   %.3g\n", order, missed[0], missed[1], missed[2]);
        if (order == 16)
            CHECK(missed[0] > 0.4 && missed[1] < 0.02 && missed[2] < 1e-9, "order 16: %g %g %g", missed[0], missed[1], missed[2]);
    }
}

/* ---- tables and instruction levels ---- */

/* The tables in the header are what their generator writes, to the letter. */
TEST(tables_are_as_generated) {
    char path[4096] = __FILE__, *slash = strrchr(path, '/');
    strcpy(slash ? slash + 1 : path, "../isogi_sh.h");
    FILE *header = fopen(path, "rb"), *made = tmpfile();
    if (!header) header = fopen("isogi_sh.h", "rb");
    if (!header || !made) SKIP("isogi_sh.h is not beside the tests, or there is no place for a temporary file");
    char line[512], expected[512];
    int found = 0, different = 0;
    generate(made);
    rewind(made);
    while (fgets(line, sizeof line, header) && !strstr(line, "generated: begin")) found = 0;
    while (fgets(line, sizeof line, header) && !strstr(line, "generated: end")) {
        found++;
        if (!fgets(expected, sizeof expected, made) || strcmp(line, expected)) different++;
    }
    CHECK(found > 100 && different == 0 && !fgets(expected, sizeof expected, made), "%d lines, %d differ", found, different);
    fclose(header), fclose(made);
}

#if !LINKED
/* Rotations at every level against plain C: to 1e-14 in double (the numbers are below 1 and sums of at most 31 of them) and to a float
   ulp of the largest in float, for orders on both sides of the tables' end, one or three channels, in place or not. Nothing past the
   end is written. */
TEST(rotations_agree_at_every_level) {
    enum { MOST = 60, N = MOST * MOST };
    static double c[3 * N + 1], plain[3 * N + 1], other[3 * N + 1];
    static float f[3 * N + 1], plain_f[3 * N + 1], other_f[3 * N + 1];
    test_random r = {41};
    double worst = 0, worst_f = 0;
    for (int order = 1; order <= MOST; order += order < 20 ? 1 : 13)
        for (int round = 0; round < 12; round++) {
            int channels = round % 3 == 2 ? 3 : 1, n = channels * order * order;
            double m[9];
            float mf[9];
            random_rotation(&r, m);
            for (int k = 0; k < 9; k++) mf[k] = (float)m[k];
            for (int i = 0; i < 3 * N + 1; i++)
                f[i] = (float)(c[i] = random_range(&r, -1, 1)), plain[i] = other[i] = 5, plain_f[i] = other_f[i] = 5;
            instruction_level = 0;
            isogi_sh_rotate_f64(plain, c, order, channels, m);
            isogi_sh_rotate(plain_f, f, order, channels, mf);
            instruction_level = BEST_LEVEL > 2 - round % 2 ? 2 - round % 2 : BEST_LEVEL;
            if (round & 2) memcpy(other, c, sizeof(double) * (size_t)n), memcpy(other_f, f, sizeof(float) * (size_t)n);
            isogi_sh_rotate_f64(other, round & 2 ? other : c, order, channels, m);
            isogi_sh_rotate(other_f, round & 2 ? other_f : f, order, channels, mf);
            for (int i = 0; i < n; i++)
                worst = fmax(worst, fabs(plain[i] - other[i])), worst_f = fmax(worst_f, fabs((double)plain_f[i] - (double)other_f[i]));
            for (int i = n; i < 3 * N + 1; i++)
                CHECK(other[i] == 5 && other_f[i] == 5, "order %d: number %d of %d is written", order, i, n);
        }
    instruction_level = BEST_LEVEL;
    CHECK(worst <= 1e-14 && worst_f <= 1e-6, "%g in double, %g in float", worst, worst_f);
}

/* The same for matrices: every entry of every order on both sides of the tables' end, and special angles, where recursions and products of
   quarter turns differ most. 3e-15: two ways, each orthogonal to 4e-15 at degree 10. */
TEST(matrices_agree_at_every_level) {
    enum { MOST = 18, N = ISOGI_SH_ROTATION_COUNT(MOST) };
    static double plain[N + 1], other[N + 1];
    static float plain_f[N + 1], other_f[N + 1];
    static const double special[][3] = {
        {0, 0, 0}, {0, 1e-9, 0}, {1, 1e-9, 2}, {0, 3.14159265358979323846, 0}, {0.3, 1.5707963267948966, 0}, {1, 3.1415926, 2}};
    test_random r = {42};
    double worst = 0, worst_f = 0;
    for (int order = 1; order <= MOST; order++)
        for (int round = 0; round < 12; round++) {
            int n = (int)ISOGI_SH_ROTATION_COUNT(order);
            double m[9];
            float mf[9];
            random_rotation(&r, m);
            if (round < 6) {
                double ca = cos(special[round][0]), sa = sin(special[round][0]), cb = cos(special[round][1]), sb = sin(special[round][1]),
                    cc = cos(special[round][2]), sc = sin(special[round][2]);
                double t[9] = {ca * cb * cc - sa * sc, -ca * cb * sc - sa * cc, ca * sb, sa * cb * cc + ca * sc, -sa * cb * sc + ca * cc,
                    sa * sb, -sb * cc, sb * sc, cb};
                memcpy(m, t, sizeof m);
            }
            for (int k = 0; k < 9; k++) mf[k] = (float)m[k];
            for (int i = 0; i <= N; i++) plain[i] = other[i] = 5, plain_f[i] = other_f[i] = 5;
            instruction_level = 0;
            isogi_sh_rotation_build_f64(plain, order, m);
            isogi_sh_rotation_build(plain_f, order, mf);
            instruction_level = BEST_LEVEL > 2 - round % 2 ? 2 - round % 2 : BEST_LEVEL;
            isogi_sh_rotation_build_f64(other, order, m);
            isogi_sh_rotation_build(other_f, order, mf);
            for (int i = 0; i < n; i++)
                worst = fmax(worst, fabs(plain[i] - other[i])), worst_f = fmax(worst_f, fabs((double)plain_f[i] - (double)other_f[i]));
            for (int i = n; i <= N; i++) CHECK(other[i] == 5 && other_f[i] == 5, "order %d: number %d of %d is written", order, i, n);
        }
    instruction_level = BEST_LEVEL;
    printf("    matrices differ by %.3g in double, %.3g in float\n", worst, worst_f);
    CHECK(worst <= 3e-15 * ROUNDING_FACTOR && worst_f <= 6e-8, "%g in double, %g in float", worst, worst_f);
}

/* Every level agrees with plain C within the float errors of the header, in double to 1e-14; odd counts, offsets, lengths and
   blocks with a zero or huge vector among good ones included. */
TEST(instruction_levels_agree) {
    enum { ORDER = 21, N = ORDER * ORDER, COUNT = 43 };
    static float d[COUNT][3], x[3][COUNT], base[COUNT * N], other[COUNT * N], c[3 * N], sum[COUNT * 3], sum2[COUNT * 3], p[2 * 25],
        p2[2 * 25], image[48 * 17 * 3], q[75], q2[75];
    static double D[COUNT][3], X[3][COUNT], wide[COUNT * N], wide2[COUNT * N];
    test_random r = {40};
    double worst = 0, worst_wide = 0, worst_sum = 0, worst_product = 0, worst_image = 0; /* worst: as a share of the bound */
    for (int i = 0; i < 3 * N; i++) c[i] = (float)random_range(&r, -1, 1);
    for (int i = 0; i < 48 * 17 * 3; i++) image[i] = (float)random_unit(&r);
    for (int order = 1; order <= ORDER; order++)
        for (int odd = 0; odd < 3; odd++) {
            size_t n = (size_t)(order * order);
            double bound = order <= 5 ? 4.5e-7 : order <= 11 ? 2.2e-6 : 1e-5;
            for (int i = 0; i < COUNT; i++) {
                random_direction(&r, D[i]);
                for (int k = 0; k < 3; k++) {
                    D[i][k] *= odd == 1 ? exp(random_range(&r, -20, 20)) : 1;
                    if (odd == 2 && i % 11 == 4) D[i][k] = i == 4 ? 0 : i == 15 ? 1e30 * D[i][k] : 1e-30 * D[i][k];
                    d[i][k] = rounded(D[i][k]), D[i][k] = (double)d[i][k], x[k][i] = d[i][k], X[k][i] = D[i][k];
                }
            }
            instruction_level = 0;
            isogi_sh_eval(base, order, (const float(*)[3])d, COUNT);
            isogi_sh_eval_f64(wide, order, (const double(*)[3])D, COUNT);
            isogi_sh_eval_sum(sum, c, order, 3, (const float(*)[3])d, COUNT);
            for (instruction_level = 1; instruction_level < 3; instruction_level++) {
                isogi_sh_eval(other, order, (const float(*)[3])d, COUNT);
                for (size_t i = 0; i < COUNT * n; i++)
                    CHECK(fabs((double)base[i] - (double)other[i]) < bound * ROUNDING_FACTOR,
                          "order %d, lengths %d, direction %d: %.9g %.9g", order, odd, (int)(i / n), (double)base[i], (double)other[i]);
                for (size_t i = 0; i < COUNT * n; i++) worst = fmax(worst, fabs((double)base[i] - (double)other[i]) / bound);
                isogi_sh_eval_soa(other, order, x[0], x[1], x[2], COUNT);
                for (size_t i = 0; i < COUNT * n; i++)
                    worst = fmax(worst, fabs((double)base[i] - (double)other[i % n * COUNT + i / n]) / bound);
                isogi_sh_eval_f64(wide2, order, (const double(*)[3])D, COUNT);
                for (size_t i = 0; i < COUNT * n; i++) worst_wide = fmax(worst_wide, fabs(wide[i] - wide2[i]));
                isogi_sh_eval_soa_f64(wide2, order, X[0], X[1], X[2], COUNT);
                for (size_t i = 0; i < COUNT * n; i++) worst_wide = fmax(worst_wide, fabs(wide[i] - wide2[i % n * COUNT + i / n]));
                isogi_sh_eval_sum(sum2, c, order, 3, (const float(*)[3])d, COUNT);
                for (int i = 0; i < 3 * COUNT; i++) worst_sum = fmax(worst_sum, fabs((double)sum[i] - (double)sum2[i]));
            }
        }
    for (int width = 32; width <= 48; width += width < 34 ? 1 : 2) {
        instruction_level = 0;
        isogi_sh_product(p, c, c + 50, 5, 2);
        isogi_sh_project_equirect(q, 5, image, width, 17);
        instruction_level = BEST_LEVEL;
        isogi_sh_product(p2, c, c + 50, 5, 2);
        isogi_sh_project_equirect(q2, 5, image, width, 17);
        for (int i = 0; i < 50; i++) worst_product = fmax(worst_product, fabs((double)p[i] - (double)p2[i]));
        for (int i = 0; i < 75; i++) worst_image = fmax(worst_image, fabs((double)q[i] - (double)q2[i]));
    }
    printf("    evaluation %.3g of the bound, double %.3g, sums %.3g, products %.3g, images %.3g\n", worst, worst_wide, worst_sum,
           worst_product, worst_image);
    CHECK(worst < ROUNDING_FACTOR, "evaluation differs by %g of its bound", worst);
    CHECK(worst_wide < 2e-14 * ROUNDING_FACTOR, "evaluation in double differs by %g", worst_wide);
    CHECK(worst_sum < 5e-5, "sums differ by %g", worst_sum);
    CHECK(worst_product < 2e-6, "products differ by %g", worst_product);
    CHECK(worst_image < 1e-6, "images differ by %g", worst_image);
}
#endif

/* ---- what is not valid ---- */

/* Every function that takes a matrix, at orders and instruction levels with ways of their own, reports it and writes nothing. */
static void no_rotation(const float m[9]) {
    static const int orders[] = {1, 2, 3, 4, 5, 6, 16, 17};
    enum { N = ISOGI_SH_ROTATION_COUNT(17) };
    static double out[N], in[N], wide[9];
    static float out_f[N], in_f[N];
    for (int k = 0; k < 9; k++) wide[k] = (double)m[k];
    for (instruction_level = 0; instruction_level < 3 && instruction_level <= BEST_LEVEL; instruction_level++)
        for (int o = 0; o < 8; o++) {
            for (int i = 0; i < N; i++) out[i] = 5, out_f[i] = 5;
            CHECK(isogi_sh_rotate(out_f, in_f, orders[o], 1, m) == ISOGI_INVALID, "order %d, level %d, float", orders[o],
                  instruction_level);
            CHECK(isogi_sh_rotate_f64(out, in, orders[o], 1, wide) == ISOGI_INVALID, "order %d, level %d, double", orders[o],
                  instruction_level);
            CHECK(isogi_sh_rotation_build(out_f, orders[o], m) == ISOGI_INVALID, "order %d, level %d, float matrix", orders[o],
                  instruction_level);
            CHECK(isogi_sh_rotation_build_f64(out, orders[o], wide) == ISOGI_INVALID, "order %d, level %d, double matrix", orders[o],
                  instruction_level);
            for (int i = 0; i < N; i++) CHECK(out[i] == 5 && out_f[i] == 5, "order %d, level %d writes", orders[o], instruction_level);
        }
    instruction_level = BEST_LEVEL;
}

#if !LINKED
/* Images whose rows are folded, against plain C, to a float's rounding: one to five channels, widths that fill blocks of columns and that
   do not, few rows and odd numbers of them, orders on both sides of groups and of the last that goes this way. The same for cubes,
   whose texels are taken sixteen at a time. */
TEST(images_agree_at_every_level) {
    enum { MOST = 34, WIDTH = 264 };
    static const int size[][2] = {{32, 1}, {36, 7}, {100, 33}, {256, 16}, {264, 19}, {34, 9}};
    static const int orders[] = {1, 2, 3, 4, 6, 7, 11, 32, 33};
    static float image[5 * WIDTH * 33 + 1], c[5 * MOST * MOST], plain[5 * MOST * MOST];
    test_random r = {43};
    double worst = 0;
    for (size_t i = 0; i < sizeof image / sizeof *image; i++) image[i] = (float)exp(random_range(&r, -3, 3));
    for (size_t k = 0; k < sizeof size / sizeof *size; k++)
        for (size_t o = 0; o < sizeof orders / sizeof *orders; o++)
            for (int channels = 1; channels <= 5; channels += 1 + QUICK_SUITE) {
                int n = channels * orders[o] * orders[o];
                double largest = 0;
                for (int i = 0; i < n; i++) c[i] = plain[i] = 7;
                instruction_level = 0;
                CHECK(isogi_sh_project_image(plain, orders[o], channels, image, size[k][0], size[k][1]) == ISOGI_OK, "size %d", (int)k);
                instruction_level = BEST_LEVEL;
                CHECK(isogi_sh_project_image(c, orders[o], channels, image, size[k][0], size[k][1]) == ISOGI_OK, "size %d", (int)k);
                for (int i = 0; i < n; i++) largest = fmax(largest, fabs((double)plain[i]));
                for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)c[i] - (double)plain[i]) / largest);
            }
    for (int k = 0; k < 3; k++)
        for (int order = 1; order <= 11; order += order == 5 ? 5 : 1)
            for (int channels = 1; channels <= 5; channels += 2) {
                static const int edge[] = {1, 16, 19};
                const float *face[6];
                int n = channels * order * order;
                double largest = 0;
                for (int f = 0; f < 6; f++) face[f] = image + 1000 * f;
                for (int i = 0; i < n; i++) c[i] = plain[i] = 7;
                instruction_level = 0;
                CHECK(isogi_sh_project_cube(plain, order, channels, face, edge[k]) == ISOGI_OK, "edge %d", edge[k]);
                instruction_level = BEST_LEVEL;
                CHECK(isogi_sh_project_cube(c, order, channels, face, edge[k]) == ISOGI_OK, "edge %d", edge[k]);
                for (int i = 0; i < n; i++) largest = fmax(largest, fabs((double)plain[i]));
                for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)c[i] - (double)plain[i]) / largest);
            }
    printf("    images differ by %.3g of the largest coefficient\n", worst);
    CHECK(worst <= 6e-8 * ROUNDING_FACTOR, "images differ by %g", worst);
}
#endif

TEST(bad_input_is_reported_and_changes_nothing) {
    float y[27] = {0}, before[27], d[1][3] = {{0, 0, 1}}, m[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, image[3 * 8] = {0};
    double c[9] = {0};
    for (int i = 0; i < 27; i++) y[i] = before[i] = (float)i;
    const float(*directions)[3] = (const float(*)[3])d;
    CHECK(isogi_sh_eval(y, 0, directions, 1) == ISOGI_INVALID, "order %d", 0);
    CHECK(isogi_sh_eval(y, 102, directions, 1) == ISOGI_INVALID, "order %d", 102);
    CHECK(isogi_sh_eval(y, -3, directions, 1) == ISOGI_INVALID, "order %d", -3);
    CHECK(isogi_sh_eval(NULL, 3, directions, 1) == ISOGI_INVALID && isogi_sh_eval(y, 3, NULL, 1) == ISOGI_INVALID, "%s", "NULL");
    CHECK(isogi_sh_eval(NULL, 3, NULL, 0) == ISOGI_OK, "%s", "nothing to do");
    CHECK(isogi_sh_eval(y, 3, directions, (size_t)-1 / 4) == ISOGI_TOO_LARGE, "%s", "count");
    CHECK(isogi_sh_eval_sum(y, before, 3, 1, directions, (size_t)-1 / 4) == ISOGI_TOO_LARGE, "%s", "count");
    CHECK(isogi_sh_eval_sum_f64(c, c, 3, 1, (const double(*)[3])c, (size_t)-1 / 8) == ISOGI_TOO_LARGE, "%s", "count");
    CHECK(isogi_sh_project_samples(c, 3, 1, directions, before, NULL, (size_t)-1 / 4) == ISOGI_TOO_LARGE, "%s", "count");
    CHECK(isogi_sh_product(y, before, before, 3, (size_t)-1 / 4) == ISOGI_TOO_LARGE, "%s", "count");
    CHECK(isogi_sh_rotate(y, y, 3, 0, m) == ISOGI_INVALID && isogi_sh_rotate(y, y, 3, 17, m) == ISOGI_INVALID, "%s", "channels");
    CHECK(isogi_sh_rotate(y, y, 0, 3, m) == ISOGI_INVALID, "%s", "order");
    for (int i = 0; i < 9; i++) {
        const float wrong[] = {NAN, INFINITY, 3e38f, m[i] + 0.01f, m[i] - 0.01f};
        for (int k = 0; k < 5; k++) {
            float bad[9];
            memcpy(bad, m, sizeof bad);
            bad[i] = wrong[k];
            CHECK(isogi_sh_rotate(y, y, 3, 3, bad) == ISOGI_INVALID, "entry %d %g", i, (double)wrong[k]);
            no_rotation(bad);
        }
    }
    m[8] = -1;
    CHECK(isogi_sh_rotate(y, y, 3, 3, m) == ISOGI_INVALID, "%s", "a mirror is no rotation");
    no_rotation(m);
    m[0] = m[4] = -1; /* through the origin */
    no_rotation(m);
    CHECK(isogi_sh_project_function(c, 3, 1, -1, one_function, NULL) == ISOGI_INVALID, "%s", "resolution");
    CHECK(isogi_sh_project_function(c, 3, 17, 0, one_function, NULL) == ISOGI_INVALID, "%s", "channels");
    CHECK(isogi_sh_project_function(c, 3, 1, 0, NULL, NULL) == ISOGI_INVALID, "%s", "function");
    CHECK(isogi_sh_project_equirect(y, 3, image, 0, 2) == ISOGI_INVALID && isogi_sh_project_equirect(y, 3, NULL, 4, 2) == ISOGI_INVALID,
          "%s", "image");
    CHECK(isogi_sh_convolve_cosine(y, NULL, 3, 3) == ISOGI_INVALID, "%s", "NULL");
    CHECK(!memcmp(y, before, sizeof y), "%s", "outputs untouched");
}

TEST(lighting_is_validated) {
    float image[2 * 4 * 3] = {0}, sh[27] = {0};
    isogi_light lights[2] = {{.vector = {0, 1, 0}, .rgb = {1, 1, 1}}, {.kind = ISOGI_LIGHT_POINT, .vector = {0, 0, 0}, .rgb = {1, 1, 1}}};
    const isogi_lighting good = {
        .env = {.rgb = image, .width = 4, .height = 2, .sh = sh, .sh_order = 3}, .lights = lights, .light_count = 2};
    isogi_lighting bad;
    isogi_lighting zero = {.lights = NULL};
    float out[27];
    CHECK(isogi_lighting_validate(NULL) == ISOGI_INVALID, "%s", "NULL");
    CHECK(isogi_lighting_validate(&zero) == ISOGI_OK, "%s", "zero is black");
    CHECK(isogi_sh_project(out, 3, &zero, NULL) == ISOGI_OK && out[0] == 0 && out[26] == 0, "black: %g", (double)out[0]);
    CHECK(isogi_lighting_validate(&good) == ISOGI_OK && !isogi_lighting_fault(&good), "%s", "good");
#define BAD(change, code)                                                                                                                  \
    bad = good;                                                                                                                            \
    change;                                                                                                                                \
    CHECK(isogi_lighting_validate(&bad) == code, "%s", #change);                                                                           \
    CHECK(fault_names(isogi_lighting_fault(&bad), #change), "%s: %s", #change, isogi_lighting_fault(&bad));                                \
    CHECK(isogi_sh_project(out, 3, &bad, NULL) == code, "%s", #change)
    BAD(bad.env.width = 0, ISOGI_INVALID);
    BAD(bad.env.height = -1, ISOGI_INVALID);
    BAD(bad.env.rgb = NULL, ISOGI_INVALID);
    BAD(bad.env.sh = NULL, ISOGI_INVALID);
    BAD(bad.env.sh_order = 0, ISOGI_INVALID);
    BAD(bad.env.sh_order = 102, ISOGI_INVALID);
    BAD(bad.lights = NULL, ISOGI_INVALID);
    BAD(bad.env.rotation[0] = 1, ISOGI_INVALID);
    BAD(bad.env.rotation[4] = NAN, ISOGI_INVALID);
#undef BAD
    const float wrong[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        image[23] = wrong[i];
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "image %g", (double)wrong[i]);
        image[23] = 0, sh[26] = wrong[i];
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "sh %g", (double)wrong[i]);
        sh[26] = 0, lights[1].rgb[2] = wrong[i];
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "rgb %g", (double)wrong[i]);
        lights[1].rgb[2] = 0, lights[0].vector[1] = wrong[i];
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "vector %g", (double)wrong[i]);
        lights[0].vector[1] = 1, lights[0].radius = wrong[i];
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "radius %g", (double)wrong[i]);
        CHECK(fault_names(isogi_lighting_fault(&good), "lights.radius"), "%s", isogi_lighting_fault(&good));
        lights[0].radius = 0;
    }
    lights[0].vector[1] = 0;
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "a direction of no length");
    lights[0].vector[1] = 1, lights[0].kind = (isogi_light_kind)(ISOGI_LIGHT_RECTANGLE + 1);
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "kind");
    lights[0].kind = ISOGI_LIGHT_RECTANGLE, lights[0].edge[0][0] = 2, lights[0].edge[1][1] = 3; /* at right angles to 1e-3 */
    for (int i = -1; i <= 1; i += 2) {
        lights[0].edge[1][0] = (float)i * 3 * 0.9e-3f;
        CHECK(isogi_lighting_validate(&good) == ISOGI_OK, "%s", "edges at right angles to 0.9e-3");
        lights[0].edge[1][0] = (float)i * 3 * 1.1e-3f;
        CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "edges at right angles to 1.1e-3");
    }
    lights[0].kind = ISOGI_LIGHT_SPHERE, lights[0].radius = -1;
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "negative radius");
}

TEST_MAIN("sh")
