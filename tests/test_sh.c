/* Tests of isogi_sh.h. The reference is tests/reference_sh.h: 128 bits, from the definition. */
#define ISOGI_SH_IMPLEMENTATION
#include "isogi_sh.h"
#include "reference_sh.h"
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
    double t[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),    2 * (x * y + w * z),    1 - 2 * (x * x + z * z),
                   2 * (y * z - w * x),     2 * (x * z - w * y),     2 * (y * z + w * x),    1 - 2 * (x * x + y * y)};
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

/* Gauss-Legendre nodes in 80 or more bits, by bisection: slow and independent of the header's. */
static void reference_nodes(long double *node, long double *weight, int n) {
    for (int i = 0; i < n; i++) {
        long double x = cosl(3.14159265358979323846264L * ((long double)i + 0.75L) / ((long double)n + 0.5L)), d = 1;
        for (int round = 0; round < 12; round++) {
            long double p = 1, before = 0;
            for (int k = 0; k < n; k++) {
                long double next = ((long double)(2 * k + 1) * x * p - (long double)k * before) / (long double)(k + 1);
                before = p, p = next;
            }
            d = (long double)n * (before - x * p) / (1 - x * x);
            x -= p / d;
        }
        node[i] = x;
        weight[i] = 2 / ((1 - x * x) * d * d);
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
        double expected[9] = {sqrt(1 / (4 * pi)), a * Y, a * Z, a * X, b * X * Y, b * Y * Z, sqrt(5 / (16 * pi)) * (3 * Z * Z - 1), b * X * Z,
                              b / 2 * (X * X - Y * Y)};
        for (int k = 0; k < 9; k++) CHECK(fabs(y[k] - expected[k]) < 2e-15, "Y%d = %.17g, expected %.17g", k, y[k], expected[k]);
    }
}

/* Largest absolute error in double over hard and random directions. The bounds are those that the header states. */
TEST(double_evaluation_is_exact) {
    static const struct { int degree; double bound; } cases[] = {{4, 1.1e-15}, {10, 7e-15}, {20, 3e-14}, {50, 2e-13}, {100, 1e-12}};
    static double y[MAX_COUNT];
    static quad expected[MAX_COUNT];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        test_random r = {2};
        double d[1][3], worst = 0, at[3] = {0, 0, 0};
        int order = cases[c].degree + 1, step = !LONG_SUITE && order > 20 ? 7 : 1;
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
        CHECK(worst <= cases[c].bound, "degree %d: error %g at (%g %g %g), bound %g", cases[c].degree, worst, at[0], at[1], at[2],
              cases[c].bound);
    }
}

/* The same in float, in batches, against the reference at the float direction. */
TEST(float_evaluation_is_exact) {
    static const struct { int degree; double bound; } cases[] = {{4, 4.5e-7}, {10, 2.2e-6}, {20, 1e-5}, {100, 5e-4}};
    static float d[8192][3];
    static quad expected[MAX_COUNT];
    test_random r = {3};
    double wide[3];
    size_t count = 0;
    for (int i = 0; hard_direction(wide, i, &r); i++, count++)
        for (int k = 0; k < 3; k++) d[count][k] = (float)wide[k];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        int order = cases[c].degree + 1, n = order * order;
        size_t step = !LONG_SUITE && order > 20 ? 37 : 1;
        float *y = (float *)malloc((size_t)n * count * sizeof *y);
        double worst = 0;
        CHECK(isogi_sh_eval(y, order, (const float(*)[3])d, count) == ISOGI_OK, "degree %d", cases[c].degree);
        for (size_t i = 0; i < count; i += step) {
            quad e[3] = {(quad)d[i][0], (quad)d[i][1], (quad)d[i][2]};
            reference_eval(expected, order, e);
            for (int k = 0; k < n; k++) {
                double error = fabs((double)(expected[k] - (quad)y[(size_t)n * i + (size_t)k]));
                if (!(error <= worst)) worst = error;
            }
        }
        printf("    degree %d: largest error %.3g\n", cases[c].degree, worst);
        CHECK(worst <= cases[c].bound, "degree %d: error %g, bound %g", cases[c].degree, worst, cases[c].bound);
        free(y);
    }
}

/* Length does not matter, from denormal to huge; the zero vector and what is not finite count as +z. */
TEST(any_length_and_no_length) {
    static const float scales[] = {1, 1e-44f, 1e-38f, 1e-20f, 3e20f, 3e38f};
    float y[25], up[25], d[1][3] = {{0, 0, 1}}, bad[][3] = {{0, 0, 0}, {NAN, 0, 1}, {0, INFINITY, 0}, {-INFINITY, NAN, 2}, {-0.0f, 0, -0.0f}};
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

/* ---- rotation ---- */

/* f rotated, evaluated at w, is f evaluated at R^-1 w: 1000 random rotations, every order 1..16 in turn, and a few high ones.
   1e-12: thousands of roundings of coefficients of size 1. */
TEST(rotation_agrees_with_evaluation) {
    static double c[MAX_COUNT], rotated[MAX_COUNT], y[MAX_COUNT];
    test_random r = {4};
    double worst = 0;
    for (int i = 0; i < 1010; i++) {
        int order = i < 1000 ? 1 + i % 16 : 101, n = order * order;
        double m[9], w[1][3], back[1][3], a = 0, b = 0;
        random_rotation(&r, m);
        for (int k = 0; k < n; k++) c[k] = random_range(&r, -1, 1) / (i < 1000 ? 1 : order);
        CHECK(isogi_sh_rotate_f64(rotated, c, order, 1, m) == ISOGI_OK, "rotation %d", i);
        random_direction(&r, w[0]);
        apply(back[0], m, w[0], 1);
        isogi_sh_eval_f64(y, order, (const double(*)[3])w, 1);
        for (int k = 0; k < n; k++) a += rotated[k] * y[k];
        isogi_sh_eval_f64(y, order, (const double(*)[3])back, 1);
        for (int k = 0; k < n; k++) b += c[k] * y[k];
        worst = fmax(worst, fabs(a - b));
        CHECK(fabs(a - b) < 1e-12, "rotation %d, order %d: %.17g and %.17g", i, order, a, b);
    }
    printf("    largest difference %.3g\n", worst);
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

/* Projecting Y_i returns the i-th unit vector, to order 10, and for a few of the highest degrees. */
TEST(projecting_a_basis_function_returns_a_unit_vector) {
    static double c[2 * MAX_COUNT];
    wanted_order = 10;
    for (wanted = 0; wanted < 100; wanted++) {
        CHECK(isogi_sh_project_function(c, 10, 2, 0, one_function, NULL) == ISOGI_OK, "function %d", wanted);
        for (int k = 0; k < 100; k++) {
            CHECK(fabs(c[2 * k] - (k == wanted)) < 1e-13, "Y%d on Y%d: %g", wanted, k, c[2 * k]);
            CHECK(fabs(c[2 * k + 1] - (k == 0 ? 2 : 0)) < 1e-13, "second channel on Y%d: %g", k, c[2 * k + 1]);
        }
    }
    wanted_order = 101;
    for (wanted = MAX_COUNT - 1; wanted > MAX_COUNT - 200; wanted -= LONG_SUITE ? 11 : 200) {
        double worst = 0;
        isogi_sh_project_function(c, 101, 2, 0, one_function, NULL);
        for (int k = 0; k < MAX_COUNT; k++) worst = fmax(worst, fabs(c[2 * k] - (k == wanted)));
        CHECK(worst < 1e-11, "Y%d at order 101: largest error %g", wanted, worst);
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
                    CHECK(fabsf(rgb[k] - image[j][i][k]) < 1e-5f, "texel %d %d: %g, expected %g", i, j, (double)rgb[k], (double)image[j][i][k]);
            }
    }
    isogi_env plain = {.rgb = &image[0][0][0], .width = W, .height = H};
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
    isogi_env a = {.rgb = one[0], .width = 1, .height = 1}, b = {.rgb = wide[0], .width = 3, .height = 1}, c = {.rgb = wide[0], .width = 1, .height = 3};
    isogi_env black = {.rgb = NULL};
    for (int i = 0; i < n * n * n; i++) {
        float d[3] = {odd[i % n], odd[i / n % n], odd[i / n / n]};
        isogi_env_radiance(&a, d, rgb);
        CHECK(fabsf(rgb[0] - 5) < 1e-5f && fabsf(rgb[2] - 7) < 1e-5f, "direction %g %g %g: %g", (double)d[0], (double)d[1], (double)d[2], (double)rgb[0]);
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
        {ISOGI_LIGHT_DIRECTIONAL, {2, 0, 0}, {3, 1, 2}, 0},
        {ISOGI_LIGHT_DIRECTIONAL, {0, -5, 1}, {3, 1, 2}, 0.3f},
        {ISOGI_LIGHT_DIRECTIONAL, {1, 1, 1}, {3, 1, 2}, 0.00465f},
        {ISOGI_LIGHT_POINT, {1, 2, 7}, {48, 16, 32}, 0},
        {ISOGI_LIGHT_SPHERE, {1, -2, 3}, {48, 16, 32}, 2},
        {ISOGI_LIGHT_DIRECTIONAL, {0, 0, -1}, {3, 1, 2}, 1.5f},
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
        CHECK(fabs(e[0] - 3) < 3e-3 && fabs(e[1] - 1) < 1e-3 && fabs(e[2] - 2) < 2e-3, "light %d: irradiance %g %g %g", (int)i, e[0], e[1], e[2]);
    }
}

/* A disc's coefficients are those of its radiance, by quadrature over the disc; a small one tends to the delta. */
TEST(disc_matches_quadrature) {
    enum { ORDER = 12, N = ORDER * ORDER, STEPS = 400 };
    double radius = 0.7, z[ORDER] = {0}, L = 1 / (pi * sin(radius) * sin(radius));
    float c[3 * N], small[3 * N], delta[3 * N];
    isogi_light light = {ISOGI_LIGHT_DIRECTIONAL, {0, 0, 1}, {1, 1, 1}, (float)radius}, tiny = light, none = light;
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

/* ---- what is not valid ---- */

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
    CHECK(isogi_sh_rotate(y, y, 3, 0, m) == ISOGI_INVALID && isogi_sh_rotate(y, y, 3, 17, m) == ISOGI_INVALID, "%s", "channels");
    CHECK(isogi_sh_rotate(y, y, 0, 3, m) == ISOGI_INVALID, "%s", "order");
    for (int i = 0; i < 9; i++) {
        const float wrong[] = {NAN, INFINITY, 3e38f, m[i] + 0.01f, m[i] - 0.01f};
        for (int k = 0; k < 5; k++) {
            float bad[9];
            memcpy(bad, m, sizeof bad);
            bad[i] = wrong[k];
            CHECK(isogi_sh_rotate(y, y, 3, 3, bad) == ISOGI_INVALID, "entry %d %g", i, (double)wrong[k]);
        }
    }
    m[8] = -1;
    CHECK(isogi_sh_rotate(y, y, 3, 3, m) == ISOGI_INVALID, "%s", "a mirror is no rotation");
    CHECK(isogi_sh_project_function(c, 3, 1, -1, one_function, NULL) == ISOGI_INVALID, "%s", "resolution");
    CHECK(isogi_sh_project_function(c, 3, 17, 0, one_function, NULL) == ISOGI_INVALID, "%s", "channels");
    CHECK(isogi_sh_project_function(c, 3, 1, 0, NULL, NULL) == ISOGI_INVALID, "%s", "function");
    CHECK(isogi_sh_project_equirect(y, 3, image, 0, 2) == ISOGI_INVALID && isogi_sh_project_equirect(y, 3, NULL, 4, 2) == ISOGI_INVALID, "%s", "image");
    CHECK(isogi_sh_convolve_cosine(y, NULL, 3, 3) == ISOGI_INVALID, "%s", "NULL");
    CHECK(!memcmp(y, before, sizeof y), "%s", "outputs untouched");
}

TEST(lighting_is_validated) {
    float image[2 * 4 * 3] = {0}, sh[27] = {0};
    isogi_light lights[2] = {{ISOGI_LIGHT_DIRECTIONAL, {0, 1, 0}, {1, 1, 1}, 0}, {ISOGI_LIGHT_POINT, {0, 0, 0}, {1, 1, 1}, 0}};
    const isogi_lighting good = {.env = {.rgb = image, .width = 4, .height = 2, .sh = sh, .sh_order = 3}, .lights = lights, .light_count = 2};
    isogi_lighting bad;
    isogi_lighting zero = {.lights = NULL};
    float out[27];
    CHECK(isogi_lighting_validate(NULL) == ISOGI_INVALID, "%s", "NULL");
    CHECK(isogi_lighting_validate(&zero) == ISOGI_OK, "%s", "zero is black");
    CHECK(isogi_sh_project(out, 3, &zero, NULL) == ISOGI_OK && out[0] == 0 && out[26] == 0, "black: %g", (double)out[0]);
    CHECK(isogi_lighting_validate(&good) == ISOGI_OK, "%s", "good");
#define BAD(change, code)                                                                                                                  \
    bad = good;                                                                                                                            \
    change;                                                                                                                                \
    CHECK(isogi_lighting_validate(&bad) == code, "%s", #change);                                                                           \
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
        lights[0].radius = 0;
    }
    lights[0].vector[1] = 0;
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "a direction of no length");
    lights[0].vector[1] = 1, lights[0].kind = (isogi_light_kind)3;
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "kind");
    lights[0].kind = ISOGI_LIGHT_SPHERE, lights[0].radius = -1;
    CHECK(isogi_lighting_validate(&good) == ISOGI_INVALID, "%s", "negative radius");
}

TEST_MAIN("sh")
