/* The least and the highest order, and vectors without length, as short and as long as floats are, for what isogi_sh.h does besides
   evaluation: cones, skies, lights, windows, conventions, algebra, rotations, projections, fits. The reference is tests/reference_sh.h:
   128 bits, from the definition. */
#define _GNU_SOURCE /* stacks of threads */
#define ISOGI_SH_IMPLEMENTATION
#include "isogi_sh.h"
#include "reference_sh.h"
#include "stack.h"
#include <float.h>
#include "test.h"

static const double pi = 3.14159265358979323846;

enum { MOST = ISOGI_SH_MAX_ORDER, N = MOST * MOST };

static const int orders[] = {1, 2, 101};
enum { ORDERS = sizeof orders / sizeof *orders };

/* axes of every length: poles, beside them, denormal (the least float too), huge (the sum of squares overflows floats) */
static const float axes[][3] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {1, 2, -2}, {1e-8f, 0, 1}, {0, 1e-30f, -1},
    {1e-40f, 2e-40f, -2e-40f}, {1e-45f, 0, 0}, {3e38f, -3e38f, 1e38f}, {0, 0, 3.4e38f}, {1e-40f, 0, 1e38f}};
enum { AXES = sizeof axes / sizeof *axes };

static quad basis[N];
static float c[3 * N], d[3 * N], e[3 * N];
static double zonal[MOST], expected[N];

static void basis_at(int order, const float v[3]) {
    quad q[3];
    for (int k = 0; k < 3; k++) q[k] = (quad)v[k];
    reference_eval(basis, order, q);
}

/* expected = the axis-symmetric function of zonal coefficients around v */
static void turn_zonal(int order, const float v[3]) {
    basis_at(order, v);
    for (int l = 0; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++) expected[i] = sqrt(4 * pi / (2 * l + 1)) * zonal[l] * (double)basis[i];
}

/* zonal = that of 1 within `angle` of the axis: Y_l^0 integrated over z by 64 Gauss-Legendre nodes, exact to degree 127 */
static void cone_zonal(int order, double angle) {
    double below = 2 * sin(angle / 2) * sin(angle / 2); /* the part of z from 1 down */
    long double node[64], share[64];
    for (int l = 0; l < order; l++) zonal[l] = 0;
    reference_nodes(node, share, 64);
    for (int i = 0; i < 64; i++) {
        long double z = 1 - (long double)below * (1 - node[i]) / 2, weight = (long double)below * share[i] / 2, p = 1, before = 0;
        for (int l = 0; l < order; l++) {
            long double next = ((long double)(2 * l + 1) * z * p - (long double)l * before) / (long double)(l + 1);
            zonal[l] +=
                (double)(2 * 3.14159265358979323846264L * weight * sqrtl((long double)(2 * l + 1) / (4 * 3.14159265358979323846264L)) * p);
            before = p, p = next;
        }
    }
}

/* channel `channel` of c is `factor` times expected; a float's rounding, and that of the largest coefficient in double */
static void check_channel(const char *what, int order, int channel, double factor) {
    double worst = 0, largest = 0, allowed;
    int at = 0;
    for (int i = 0; i < order * order; i++) largest = fmax(largest, fabs(factor * expected[i]));
    for (int i = 0; i < order * order; i++) {
        double error = fabs((double)c[3 * i + channel] - factor * expected[i]) / (largest > 0 ? largest : 1);
        if (!(error <= worst)) worst = error, at = i;
    }
    allowed = 1.2e-7; /* half an ulp of a float, 6e-8, and as much for the recursions to degree 100 */
    CHECK(worst <= allowed, "%s, order %d, channel %d: %g of the largest coefficient at Y%d", what, order, channel, worst, at);
}

TEST(cones_of_any_axis_and_order) {
    const double angles[] = {0, 1e-6, 0.01, 0.3, pi / 2, 3, pi};
    const float rgb[3] = {1, 3, 0};
    char what[64];
    for (int o = 0; o < ORDERS; o++)
        for (int i = 0; i < 7; i++) {
            cone_zonal(orders[o], angles[i]);
            for (int a = 0; a < AXES; a++) {
                if (orders[o] > 2 && !LONG_SUITE && (a + i) % 4) continue;
                snprintf(what, sizeof what, "axis %d, angle %g", a, angles[i]);
                CHECK(isogi_sh_cone(c, orders[o], axes[a], angles[i], rgb) == ISOGI_OK, "%s", what);
                turn_zonal(orders[o], axes[a]);
                for (int k = 0; k < 3; k++) check_channel(what, orders[o], k, (double)rgb[k]);
            }
        }
}

/* A hemisphere over the ground, and a sky linear in height: s/2 + g/2 + (s - g)/2 cos t. */
TEST(skies_of_any_axis_and_order) {
    const float sky[3] = {2, 1, 4}, ground[3] = {1, 3, 0};
    char what[64];
    for (int o = 0; o < ORDERS; o++)
        for (int a = 0; a < AXES; a++) {
            int order = orders[o];
            if (order > 2 && !LONG_SUITE && a % 4) continue;
            snprintf(what, sizeof what, "axis %d", a);
            CHECK(isogi_sh_hemisphere_sky(c, order, axes[a], sky, ground) == ISOGI_OK, "%s", what);
            for (int k = 0; k < 3; k++) {
                cone_zonal(order, pi / 2);
                for (int l = 0; l < order; l++) zonal[l] *= (double)sky[k] - (double)ground[k];
                zonal[0] += sqrt(4 * pi) * (double)ground[k];
                turn_zonal(order, axes[a]);
                check_channel(what, order, k, 1);
            }
            CHECK(isogi_sh_gradient_sky(c, order, axes[a], sky, ground) == ISOGI_OK, "%s", what);
            for (int k = 0; k < 3; k++) {
                for (int l = 0; l < order; l++) zonal[l] = 0;
                zonal[0] = sqrt(4 * pi) * ((double)sky[k] + (double)ground[k]) / 2;
                if (order > 1) zonal[1] = sqrt(4 * pi / 3) * ((double)sky[k] - (double)ground[k]) / 2;
                turn_zonal(order, axes[a]);
                check_channel(what, order, k, 1);
            }
        }
}

/* What has no direction is refused where it is an axis, and changes nothing; to evaluation it is +z. */
TEST(axes_without_direction) {
    const float bad[][3] = {{0, 0, 0}, {NAN, 0, 1}, {0, INFINITY, 0}, {1, 0, -INFINITY}}, rgb[3] = {1, 1, 1}, wrong[3] = {1, NAN, 1},
                up[3] = {0, 0, 1};
    float z[MOST];
    for (int o = 0; o < ORDERS; o++) {
        int order = orders[o];
        for (int i = 0; i < 3 * order * order; i++) c[i] = d[i] = (float)i;
        for (int i = 0; i < 4; i++) {
            isogi_light light = {.vector = {bad[i][0], bad[i][1], bad[i][2]}, .rgb = {1, 1, 1}};
            isogi_lighting lighting = {.lights = &light, .light_count = 1};
            CHECK(isogi_sh_cone(c, order, bad[i], 1, rgb) == ISOGI_INVALID, "cone %d", i);
            CHECK(isogi_sh_hemisphere_sky(c, order, bad[i], rgb, rgb) == ISOGI_INVALID &&
                      isogi_sh_gradient_sky(c, order, bad[i], rgb, rgb) == ISOGI_INVALID,
                  "sky %d", i);
            CHECK(isogi_sh_project(c, order, &lighting, NULL) == ISOGI_INVALID, "light %d", i);
        }
        CHECK(isogi_sh_cone(c, order, up, 1, wrong) == ISOGI_INVALID && isogi_sh_constant(c, order, wrong) == ISOGI_INVALID, "%s",
              "radiance");
        CHECK(isogi_sh_cone(c, order, up, (double)NAN, rgb) == ISOGI_INVALID && isogi_sh_cone(c, order, up, HUGE_VAL, rgb) == ISOGI_INVALID,
              "%s", "angle");
        CHECK(isogi_sh_gradient_sky(c, order, up, wrong, rgb) == ISOGI_INVALID &&
                  isogi_sh_hemisphere_sky(c, order, up, rgb, wrong) == ISOGI_INVALID,
              "%s", "sky");
        CHECK(!memcmp(c, d, 3 * ISOGI_SH_COUNT(order) * sizeof *c), "order %d: outputs untouched", order);
        for (int l = 0; l < order; l++) z[l] = 1 / (float)(1 + l);
        for (int l = 0; l < order; l++) zonal[l] = (double)z[l];
        for (int i = 0; i < 4 + AXES; i++) {
            const float *axis = i < 4 ? bad[i] : axes[i - 4];
            CHECK(isogi_sh_zonal_to_direction(d, order, z, axis) == ISOGI_OK, "%d", i);
            turn_zonal(order, i < 4 ? up : axis);
            for (int k = 0; k < order * order; k++) c[3 * k] = d[k];
            check_channel("zonal lobe", order, 0, 1);
        }
    }
}

/* Directional lights of any length are Y at their direction; point lights fall off with the square; inside a sphere all is even; and
   the first coefficients do not depend on how many are asked for, by rectangles neither (1e-7 of the largest, as the header states). */
TEST(lights_of_any_length_and_order) {
    const float rgb[3] = {3, 2, 1};
    for (int o = 0; o < ORDERS; o++)
        for (int a = 0; a < AXES; a++) {
            int order = orders[o];
            if (order > 2 && !LONG_SUITE && a % 3) continue;
            isogi_light light = {.vector = {axes[a][0], axes[a][1], axes[a][2]}, .rgb = {3, 2, 1}};
            isogi_lighting lighting = {.lights = &light, .light_count = 1};
            CHECK(isogi_sh_project(c, order, &lighting, NULL) == ISOGI_OK, "axis %d", a);
            basis_at(order, axes[a]);
            for (int i = 0; i < order * order; i++) expected[i] = (double)basis[i];
            for (int k = 0; k < 3; k++) check_channel("directional light", order, k, (double)rgb[k]);
        }
    for (int o = 0; o < ORDERS; o++) {
        int order = orders[o];
        const float point[3] = {10, 20, 30}, towards[3] = {2, -1, 2};
        isogi_light light = {.kind = ISOGI_LIGHT_POINT, .vector = {16, 17, 36}, .rgb = {3, 2, 1}};
        isogi_lighting lighting = {.lights = &light, .light_count = 1};
        CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK, "%s", "point");
        basis_at(order, towards);
        for (int i = 0; i < order * order; i++) expected[i] = (double)basis[i] / 81;
        for (int k = 0; k < 3; k++) check_channel("point light", order, k, (double)rgb[k]);
        light.kind = ISOGI_LIGHT_SPHERE, light.radius = 10; /* all around: radiance I / (pi r^2) */
        CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK, "%s", "inside");
        for (int i = 0; i < order * order; i++) expected[i] = i ? 0 : sqrt(4 * pi) / (pi * 100);
        for (int k = 0; k < 3; k++) check_channel("inside a spherical light", order, k, (double)rgb[k]);
        light.kind = ISOGI_LIGHT_RECTANGLE, light.edge[0][0] = 4, light.edge[1][2] = 2; /* shines to -y, where the point is not: dark */
        CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK && c[0] == 0 && c[3 * order * order - 1] == 0, "behind: %g",
              (double)c[0]);
        light.edge[1][2] = -2;
        CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK && c[0] > 0, "before: %g", (double)c[0]);
        isogi_sh_project(d, 5, &lighting, point);
        for (int i = 0; i < 3 * order * order && i < 75; i++)
            CHECK(fabsf(c[i] - d[i]) <= 2e-7f * d[0], "rectangle, order %d: %g, at order 5 %g", order, (double)c[i], (double)d[i]);
    }
}

/* ---- rectangles against quadrature ----
   Seen from a point at distance h of its plane, a rectangle is latitudes a and longitudes p about the axis of one edge: where p leads to
   y = h tan p along the other edge, a runs between two ends. Gauss-Legendre in both, y in parts that halve towards the foot of the
   perpendicular, since the integrand has poles at +- i h: nothing cancels, and what is left is rounding, however near or narrow it is. */

enum { NODES = 160 };

/* nodes and weights on [0,1] */
static const double (*gauss(int n))[2] {
    static double rules[NODES][NODES][2];
    long double node[NODES], weight[NODES];
    if (rules[n][n - 1][1] > 0) return (const double(*)[2])rules[n];
    reference_nodes(node, weight, n);
    for (int i = 0; i < n; i++) rules[n][i][0] = (double)(0.5L * (1 - node[i])), rules[n][i][1] = (double)(0.5L * weight[i]);
    return (const double(*)[2])rules[n];
}

/* Unit edges and the direction to the plane, the distance, the extent along each edge as seen from the foot, and the largest coordinate. */
typedef struct aspect {
    double axis[3][3], distance, low[2], high[2], area, scale;
} aspect;

static aspect aspect_of(const isogi_light *light, const float point[3]) {
    aspect s = {.scale = 0};
    long double v[3][3], to[3], along[3], length[3];
    for (int k = 0; k < 3; k++) {
        v[0][k] = (long double)light->edge[0][k], v[1][k] = (long double)light->edge[1][k],
        to[k] = (long double)light->vector[k] - (long double)point[k];
        s.scale = fmax(s.scale, fabs((double)to[k]) + fabs((double)v[0][k]) + fabs((double)v[1][k]));
    }
    for (int k = 0; k < 3; k++) v[2][k] = v[0][(k + 2) % 3] * v[1][(k + 1) % 3] - v[0][(k + 1) % 3] * v[1][(k + 2) % 3];
    for (int a = 0; a < 3; a++) {
        length[a] = sqrtl(v[a][0] * v[a][0] + v[a][1] * v[a][1] + v[a][2] * v[a][2]);
        along[a] = (v[a][0] * to[0] + v[a][1] * to[1] + v[a][2] * to[2]) / length[a];
        for (int k = 0; k < 3; k++) s.axis[a][k] = (double)(v[a][k] / length[a]);
    }
    for (int a = 0; a < 2; a++) s.low[a] = (double)(along[a] - length[a] / 2), s.high[a] = (double)(along[a] + length[a] / 2);
    s.distance = (double)along[2], s.area = (double)(length[0] * length[1]);
    return s;
}

/* expected += what lies between y and y + size along edge 1 */
static void add_slice(const aspect *s, int order, double y, double size) {
    static double all[N];
    int columns = 24 + order / 3;
    for (int i = 0; i < columns; i++) {
        double at = y + size * gauss(columns)[i][0], r = sqrt(s->distance * s->distance + at * at), from = atan2(s->low[0], r);
        double range = atan2(r * (s->high[0] - s->low[0]), r * r + s->low[0] * s->high[0]);
        int rows = 12 + (int)(order * (range + 0.5) / 4);
        for (int j = 0; j < rows; j++) {
            double a = from + range * gauss(rows)[j][0],
                   weight = size * gauss(columns)[i][1] * s->distance / (r * r) * range * gauss(rows)[j][1] * cos(a), w[1][3];
            for (int k = 0; k < 3; k++) w[0][k] = sin(a) * s->axis[0][k] + cos(a) * (at * s->axis[1][k] + s->distance * s->axis[2][k]) / r;
            isogi_sh_eval_f64(all, order, (const double(*)[3])w, 1);
            for (int k = 0; k < order * order; k++) expected[k] += weight * all[k];
        }
    }
}

static void rectangle_by_quadrature(const aspect *s, int order) {
    for (int i = 0; i < order * order; i++) expected[i] = 0;
    for (int side = -1; side <= 1; side += 2) {
        double low = fmax(side < 0 ? -s->high[1] : s->low[1], 0), high = side < 0 ? -s->low[1] : s->high[1];
        while (high > low) {
            double next = high > s->distance / 4 ? fmax(high / 2, low) : low;
            add_slice(s, order, side < 0 ? -high : next, high - next);
            high = next;
        }
    }
}

/* A rectangle with its foot at a place in edges from its centre, `distance` behind the point; the frame's rows are orthogonal exactly. */
static isogi_light rectangle_at(float point[3], int turned, const double side[2], const double place[2], double distance) {
    static const float frame[2][3][3] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{2, -1, 2}, {2, 2, -1}, {-1, 2, 2}}};
    isogi_light light = {.kind = ISOGI_LIGHT_RECTANGLE, .rgb = {1, 2, 0.5f}};
    for (int k = 0; k < 3; k++) {
        light.edge[0][k] = (float)side[0] * frame[turned][0][k], light.edge[1][k] = (float)side[1] * frame[turned][1][k];
        light.vector[k] = -(float)place[0] * light.edge[0][k] - (float)place[1] * light.edge[1][k];
        point[k] = (float)distance * frame[turned][2][k];
    }
    return light;
}

static double rectangle_error(const isogi_light *light, const float point[3], int order, const aspect *s) {
    double worst = 0, largest = 0;
    isogi_lighting lighting = {.lights = light, .light_count = 1};
    if (isogi_sh_project(c, order, &lighting, point) != ISOGI_OK) return 1e9;
    for (int i = 0; i < order * order; i++) largest = fmax(largest, fabs(expected[i]));
    for (int i = 0; i < 3 * order * order; i++) {
        double error = fabs((double)c[i] * s->area / (double)light->rgb[i % 3] - expected[i / 3]) / largest;
        if (!(error <= worst)) worst = error;
    }
    return worst;
}

/* From above, on an edge, a corner, beside and far from squares and strips of 1 : 1e6, a billion sides away to 1e-12 of a side (of 1e-18,
   where edges are along axes; turned, the distance to the plane is a difference, of which the header promises 1e-14 of the extent). */
TEST(rectangles_near_large_and_long) {
    static const double sides[][2] = {{1, 1}, {1, 0x1p-20}, {0x1p-10, 1}, {0x1p20, 0x1p20}, {0x1p-10, 0x1p10}, {0x1p-40, 0x1p-42},
        {0x1p-20, 1}, {1, 0x1p-10}};
    static const double places[][2] = {{0, 0}, {0.25, -0.375}, {0.5, 0.5}, {0.75, 0.25}, {0.5, 0}, {0.499, 0.4999}, {4, 3}, {0, 100}};
    double worst[2] = {0, 0};
    int count = 0, number = 0;
    for (int turned = 0; turned < 2; turned++)
        for (int s = 0; s < 8; s++)
            for (int p = 0; p < 8; p++)
                for (int k = -3; k <= 12; k++) {
                    float point[3];
                    isogi_light light = rectangle_at(point, turned, sides[s], places[p], pow(10, -k));
                    aspect from = aspect_of(&light, point);
                    double allowed = ROUNDING_FACTOR * (1e-7 + (turned ? 1e-14 * from.scale / from.distance : 0)), error;
                    if ((!LONG_SUITE && number++ % 11) || (turned && from.distance < 1e-8 * from.scale)) continue;
                    rectangle_by_quadrature(&from, 6);
                    for (int order = 6; order > 0; order -= order == 6 ? 3 : 2) {
                        error = rectangle_error(&light, point, order, &from);
                        worst[turned] = fmax(worst[turned], error);
                        CHECK(error <= allowed, "%g x %g, turned %d, foot at %g %g, distance %g, order %d: %g", sides[s][0], sides[s][1],
                              turned, places[p][0], places[p][1], from.distance, order, error);
                    }
                    count++;
                }
    printf("    %d rectangles: errors to %.2g of the largest coefficient, turned ones %.2g\n", count, worst[0], worst[1]);
}

/* Sizes of every kind, so that both ways of integration are met, and where they meet. */
TEST(rectangles_of_any_size) {
    test_random r = {77};
    for (int i = 0; i < (LONG_SUITE ? 2000 : 120); i++) {
        const int some[] = {2, 4, 11};
        float point[3];
        int order = some[i % 3];
        double narrow = 0.01 / order, side[2] = {pow(10, random_range(&r, -2, 3)), pow(10, random_range(&r, -2, 3))},
               distance = pow(10, random_range(&r, -4, 2));
        double place[2] = {random_range(&r, -1.5, 1.5), random_range(&r, -1.5, 1.5)};
        if (i & 1) side[1] = distance * narrow * random_range(&r, 0.3, 4);
        isogi_light light = rectangle_at(point, 0, side, place, distance);
        aspect from = aspect_of(&light, point);
        rectangle_by_quadrature(&from, order);
        double error = rectangle_error(&light, point, order, &from);
        CHECK(error <= ROUNDING_FACTOR * 1e-7, "%g x %g, foot at %g %g, distance %g, order %d: %g", side[0], side[1], place[0], place[1],
              distance, order, error);
    }
}

/* The same scene in other units has the same light, to the ends of floats; the extremes together come to something finite. */
TEST(rectangles_in_any_unit) {
    static const double sides[][2] = {{1, 0.5}, {8, 0x1p-12}, {0x1p-6, 0x1p-6}}, above[2] = {0.25, -0.375};
    static const float ends[] = {1e-45f, 1e-30f, 1, 1e30f, 3e38f};
    for (int s = 0; s < 3; s++)
        for (int turned = 0; turned < 2; turned++)
            for (int exponent = -100; exponent <= 100; exponent += 200) {
                float point[3], unit = ldexpf(1, exponent);
                isogi_light light = rectangle_at(point, turned, sides[s], above, 0.75);
                isogi_lighting lighting = {.lights = &light, .light_count = 1};
                CHECK(isogi_sh_project(d, 6, &lighting, point) == ISOGI_OK, "%d", s);
                for (int k = 0; k < 3; k++)
                    light.vector[k] *= unit, light.edge[0][k] *= unit, light.edge[1][k] *= unit, point[k] *= unit,
                        light.rgb[k] = ldexpf(light.rgb[k], exponent);
                CHECK(isogi_sh_project(c, 6, &lighting, point) == ISOGI_OK, "%d", s);
                for (int i = 0; i < 108; i++) CHECK(fabs(ldexp((double)c[i], exponent) - (double)d[i]) <= 1e-6 * (double)d[1],
                    "rectangle %d, unit 2^%d, coefficient %d: %g, not %g", s, exponent, i, ldexp((double)c[i], exponent), (double)d[i]);
            }
    for (int i = 0; i < 625; i++) {
        isogi_light light = {.kind = ISOGI_LIGHT_RECTANGLE, .vector = {ends[i / 5 % 5], 0, -ends[i % 5]}, .rgb = {3e38f, 1, 1e-45f},
            .edge = {{ends[i / 25 % 5], 0, 0}, {0, ends[i / 125], 0}}};
        isogi_lighting lighting = {.lights = &light, .light_count = 1};
        CHECK(isogi_sh_project(c, 3, &lighting, NULL) == ISOGI_OK && c[0] >= 0, "rectangle %d: %g", i, (double)c[0]);
        for (int k = 0; k < 27; k++) CHECK(test_finite((double)c[k]), "rectangle %d, coefficient %d: %g", i, k, (double)c[k]);
    }
}

/* Of the highest order too: 1e-7 of the largest coefficient, and a time that no shape makes longer (measured 15 ms each; from quadrature
   it was 12 s for the first and no end of the others). */
TEST(rectangles_of_the_highest_order) {
    static const double sides[][2] = {{1, 1}, {1000, 0x1p-10}, {1, 0x1p-20}, {0x1p20, 0x1p20}, {0.25, 0.5}}, above[2] = {0.25, -0.375};
    static const double distances[] = {0.5, 0.125, 1e-6, 1e-9, 1};
    clock_t start = clock();
    for (int i = 0; i < 5; i++)
        for (int order = 32; order <= 101; order += 69) {
            float point[3];
            isogi_light light = rectangle_at(point, i & 1, sides[i], above, distances[i]);
            isogi_lighting lighting = {.lights = &light, .light_count = 1};
            CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK && test_finite((double)c[3 * order * order - 1]), "%d", i);
        }
    double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    CHECK(seconds < 5, "ten rectangles took %g s", seconds);
    for (int i = LONG_SUITE ? 0 : 4; i < 5; i++) {
        if (i == 1 || i == 3) continue; /* their quadrature would take minutes */
        float point[3];
        int order = LONG_SUITE ? 101 : 40;
        isogi_light light = rectangle_at(point, 0, sides[i], above, distances[i]);
        aspect from = aspect_of(&light, point);
        rectangle_by_quadrature(&from, order);
        double error = rectangle_error(&light, point, order, &from);
        CHECK(error <= ROUNDING_FACTOR * 1.2e-7, "%g x %g, distance %g: %g", sides[i][0], sides[i][1], distances[i], error);
    }
}

/* Next to a light its light grows beyond floats: it is dimmed, in its direction and colour; and sums end at the largest float. */
TEST(lights_beyond_the_range_of_floats) {
    isogi_light lights[64];
    isogi_lighting lighting = {.lights = lights, .light_count = 1};
    const float places[][3] = {{1e-20f, 0, 0}, {0, 1e-25f, 0}, {0, 0, -1e-45f}, {1e-30f, -1e-30f, 0}};
    for (int o = 0; o < ORDERS; o++)
        for (int i = 0; i < 12; i++) {
            int order = orders[o], n = 3 * order * order;
            const float *v = places[i % 4];
            double w[1][3] = {{(double)v[0], (double)v[1], (double)v[2]}}, y[9] = {0};
            memset(lights, 0, sizeof lights);
            lights[0] = (isogi_light){.kind = i < 8 ? i < 4 ? ISOGI_LIGHT_POINT : ISOGI_LIGHT_SPHERE : ISOGI_LIGHT_RECTANGLE,
                                      .vector = {v[0], v[1], v[2]},
                                      .rgb = {1, 0.5f, -0.25f}};
            if (i < 8) lights[0].radius = i < 4 ? 0 : 1e-45f;
            else
                lights[0].vector[0] = 0, lights[0].vector[1] = 0, lights[0].vector[2] = -1e-25f, lights[0].edge[0][0] = 1e-25f,
                lights[0].edge[1][1] = 2e-25f;
            CHECK(isogi_sh_project(c, order, &lighting, NULL) == ISOGI_OK && c[0] > 1e36f, "light %d, order %d: %g", i, order,
                  (double)c[0]);
            CHECK(fabs((double)c[1] / (double)c[0] - 0.5) < 1e-6 && fabs((double)c[2] / (double)c[0] + 0.25) < 1e-6,
                  "colour of light %d: %g %g %g", i, (double)c[0], (double)c[1], (double)c[2]);
            if (order > 1 && i < 4) {
                isogi_sh_eval_f64(y, 2, (const double(*)[3])w, 1);
                for (int k = 1; k < 4; k++)
                    CHECK(fabs((double)c[3 * k] / (double)c[0] - y[k] / y[0]) < 1e-6, "direction of light %d: %g", i, (double)c[3 * k]);
            }
            for (int k = 0; k < n; k++)
                CHECK(test_finite((double)c[k]), "light %d, order %d, coefficient %d: %g", i, order, k, (double)c[k]);
        }
    for (int i = 0; i < 64; i++) lights[i] = (isogi_light){.vector = {0, i < 32, i >= 32}, .rgb = {3e38f, -3e38f, i & 1 ? 3e38f : -3e38f}};
    lighting.light_count = 64;
    CHECK(isogi_sh_project(c, 11, &lighting, NULL) == ISOGI_OK, "%s", "sum");
    for (int k = 0; k < 3 * 11 * 11; k++) CHECK(test_finite((double)c[k]), "sum, coefficient %d: %g", k, (double)c[k]);
    CHECK(c[0] > 1e38f && c[1] < -1e38f && fabsf(c[2]) < 1e32f, "sum: %g %g %g", (double)c[0], (double)c[1], (double)c[2]);
}

/* Half the sky: irradiance 1, so radiance 1 / pi; the float next to pi / 2 is beyond it. */
TEST(discs_to_half_pi_as_a_float) {
    const float up[3] = {0, 0, 1}, one[3] = {(float)(1 / pi), (float)(1 / pi), (float)(1 / pi)};
    isogi_light light = {.vector = {0, 0, 3}, .rgb = {1, 1, 1}, .radius = 1.5707964f};
    isogi_lighting lighting = {.lights = &light, .light_count = 1};
    for (int order = 1; order <= 101; order += 50) {
        CHECK(isogi_sh_project(c, order, &lighting, NULL) == ISOGI_OK && isogi_sh_cone(d, order, up, pi / 2, one) == ISOGI_OK, "order %d",
              order);
        for (int i = 0; i < 3 * order * order; i++)
            CHECK(fabsf(c[i] - d[i]) < 1e-6f, "order %d, coefficient %d: %g, expected %g", order, i, (double)c[i], (double)d[i]);
    }
}

TEST(cones_to_pi_as_a_float) {
    const float up[3] = {0, 0, 1}, one[3] = {1, 1, 1};
    for (int order = 1; order <= 101; order += 50) {
        CHECK(isogi_sh_cone(c, order, up, (double)3.14159265358979323846f, one) == ISOGI_OK && fabs((double)c[0] - sqrt(4 * pi)) < 1e-6,
              "order %d: %g", order, (double)c[0]);
        for (int i = 3; i < 3 * order * order; i++) CHECK(fabsf(c[i]) < 1e-6f, "order %d, coefficient %d: %g", order, i, (double)c[i]);
        CHECK(isogi_sh_cone(c, order, up, 3.1416, one) == ISOGI_INVALID, "order %d: 3.1416", order);
    }
}

/* The factors are those of the header's formulas; order 1 is never changed; a window in place is the same. */
TEST(windows_of_any_order) {
    const double widths[] = {1e-300, 0.5, 1, 7.5, 101, 1e300};
    for (int o = 0; o < ORDERS; o++)
        for (int kind = 0; kind < 3; kind++)
            for (int w = 0; w < 6; w++) {
                int order = orders[o], n = order * order;
                for (int i = 0; i < 3 * n; i++) c[i] = d[i] = (float)(1 + i % 7);
                CHECK(isogi_sh_window(d, d, order, 3, (isogi_sh_window_kind)kind, widths[w]) == ISOGI_OK, "kind %d, width %g", kind,
                      widths[w]);
                for (int l = 0; l < order; l++) {
                    double t = l / widths[w], factor = kind == ISOGI_SH_HANN ? (1 + cos(pi * t)) / 2 : kind == ISOGI_SH_GAUSS
                        ? exp2(-4 * t * t) : l ? sin(pi * t) / (pi * t) : 1;
                    if (kind != ISOGI_SH_GAUSS && t >= 1) factor = 0;
                    for (int i = 3 * l * l; i < 3 * (l + 1) * (l + 1); i++)
                        CHECK(fabs((double)d[i] - factor * (double)c[i]) <= 1.2e-7 * (double)c[i],
                              "kind %d, width %g, degree %d: %g, expected %g", kind, widths[w], l, (double)d[i], factor * (double)c[i]);
                }
            }
    double width = -1;
    c[0] = 1;
    CHECK(isogi_sh_dering(d, c, 1, 1, ISOGI_SH_HANN, &width) == ISOGI_OK && d[0] == 1 && width == 0, "order 1: %g, width %g", (double)d[0],
          width);
    CHECK(isogi_sh_dering(d, c, 101, 1, ISOGI_SH_HANN, &width) == ISOGI_TOO_LARGE && width == 0, "order 101: width %g", width);
    const double wrong[] = {0, -1, (double)NAN};
    for (int i = 0; i < 3; i++) CHECK(isogi_sh_window(d, c, 1, 1, ISOGI_SH_HANN, wrong[i]) == ISOGI_INVALID, "width %g", wrong[i]);
}

/* Where each (l, m) goes and by how much it is scaled, and back again from every convention to every other. */
TEST(conventions_of_any_order) {
    for (int o = 0; o < ORDERS; o++)
        for (int i = 0; i < 24; i++) {
            int order = orders[o], n = order * order;
            isogi_sh_convention ours = {ISOGI_SH_ORTHONORMAL, ISOGI_SH_ACN, 0},
                                theirs = {(isogi_sh_normalisation)(i % 3), (isogi_sh_ordering)(i / 3 % 4), i / 12};
            for (int k = 0; k < n; k++) c[k] = (float)(1 + k % 1000);
            CHECK(isogi_sh_convert(d, c, order, 1, ours, theirs) == ISOGI_OK, "%d", i);
            for (int l = 0; l < order; l++)
                for (int m = -l; m <= l; m++) {
                    int size = m < 0 ? -m : m, pair = 2 * size - (m > 0), sid = m ? 2 * (l - size) + (m < 0) : 2 * l;
                    const int paired = theirs.ordering == ISOGI_SH_PAIRS || (theirs.ordering == ISOGI_SH_FUMA && l != 1);
                    int at = l * l + (theirs.ordering == ISOGI_SH_ACN ? l + m : paired ? pair : sid);
                    double factor = theirs.normalisation ? 1 / sqrt(4 * pi) : 1; /* coefficients shrink as the basis grows */
                    if (theirs.normalisation == ISOGI_SH_SN3D) factor *= sqrt(2 * l + 1);
                    if (theirs.condon_shortley && m % 2) factor = -factor;
                    double value = factor * (double)c[l * (l + 1) + m];
                    CHECK(fabs((double)d[at] - value) <= 1.2e-7 * fabs(value), "convention %d, Y_%d^%d: %g, expected %g", i, l, m,
                          (double)d[at], value);
                }
            isogi_sh_convention third = {(isogi_sh_normalisation)((i + 1) % 3), (isogi_sh_ordering)((i / 3 + 1) % 4), !(i / 12)};
            CHECK(isogi_sh_convert(e, d, order, 1, theirs, third) == ISOGI_OK && isogi_sh_convert(d, e, order, 1, third, ours) == ISOGI_OK,
                  "%d", i);
            for (int k = 0; k < n; k++)
                CHECK(fabsf(d[k] - c[k]) <= 3e-7f * c[k], "there and back by %d: Y%d %g, was %g", i, k, (double)d[k], (double)c[k]);
        }
}

/* sum of coefficients times the basis at v, every third of c */
static double value_at(int order, const float *f, const float v[3]) {
    quad sum = 0;
    basis_at(order, v);
    for (int i = 0; i < order * order; i++) sum += basis[i] * (quad)f[3 * i];
    return (double)sum;
}

static int close_to(double a, double b, double part) { return fabs(a - b) <= part * fmax(fabs(a), fabs(b)); } /* false for NaN */

TEST(algebra_of_any_order) {
    test_random r = {50};
    for (int o = 0; o < ORDERS; o++) {
        int order = orders[o], n = order * order;
        double dot = 0, energy[MOST], squares[MOST] = {0}, a = 1;
        float one[MOST], single[2][N];
        for (int i = 0; i < 3 * n; i++) c[i] = (float)random_range(&r, -1, 1), d[i] = (float)random_range(&r, -1, 1);
        for (int i = 0; i < n; i++) single[0][i] = c[i], single[1][i] = d[i], dot += (double)c[i] * (double)d[i];
        CHECK(fabs(isogi_sh_dot(c, d, order) - dot) <= 1e-12, "order %d: dot %.17g, expected %.17g", order, isogi_sh_dot(c, d, order), dot);
        CHECK(isogi_sh_add(e, c, d, order, 3) == ISOGI_OK &&
                  close_to((double)e[3 * n - 1], (double)c[3 * n - 1] + (double)d[3 * n - 1], 1e-6),
              "order %d: add", order);
        CHECK(isogi_sh_scale(e, c, 0.5f, order, 3) == ISOGI_OK && e[0] == 0.5f * c[0] && e[3 * n - 1] == 0.5f * c[3 * n - 1],
              "order %d: scale", order);
        CHECK(isogi_sh_lerp(e, c, d, 0.25f, order, 3) == ISOGI_OK &&
                  fabs((double)e[3 * n - 1] - 0.75 * (double)c[3 * n - 1] - 0.25 * (double)d[3 * n - 1]) <= 1.2e-7,
              "order %d: lerp", order);
        CHECK(isogi_sh_band_energy(energy, c, order, 3) == ISOGI_OK, "order %d", order);
        for (int l = 0; l < order; l++) {
            for (int i = 3 * l * l; i < 3 * (l + 1) * (l + 1); i++) squares[l] += (double)c[i] * (double)c[i];
            CHECK(close_to(energy[l], squares[l], 1e-12), "order %d, band %d: energy %g, expected %g", order, l, energy[l], squares[l]);
        }
        for (int axis = 0; axis < 3; axis++) {
            float v[3] = {0.36f, 0.48f, -0.8f};
            CHECK(isogi_sh_mirror(e, c, order, 3, axis) == ISOGI_OK, "axis %d", axis);
            double mirrored = value_at(order, e, v);
            v[axis] = -v[axis];
            CHECK(fabs(mirrored - value_at(order, c, v)) <= 1e-11, "order %d, axis %d: %g, expected %g", order, axis, mirrored,
                  value_at(order, c, v));
        }
        /* a product with a constant scales; its mean is the dot product */
        for (int i = 0; i < n; i++) e[i] = i ? 0 : sqrtf(4 * (float)pi), e[n + i] = 9;
        if (order <= 2 || LONG_SUITE) CHECK(isogi_sh_product(e + n, single[0], e, order, 1) == ISOGI_OK, "order %d", order);
        for (int i = 0; i < n && (order <= 2 || LONG_SUITE); i++)
            CHECK(fabsf(e[n + i] - c[i]) <= 3e-7f, "order %d: %g times 1 is %g", order, (double)c[i], (double)e[n + i]);
        CHECK(isogi_sh_product(e, single[0], single[1], order, 1) == ISOGI_OK && close_to((double)e[0], 0.28209479177387814 * dot, 1e-6),
              "order %d: mean %g, expected %g", order, (double)e[0], 0.28209479177387814 * dot);
        /* clamped cosine: Ramamoorthi and Hanrahan 2001, eq. 19 */
        CHECK(isogi_sh_cosine_zonal(one, order) == ISOGI_OK && isogi_sh_convolve_cosine(d, c, order, 3) == ISOGI_OK &&
                  isogi_sh_convolve(e, c, order, 3, one) == ISOGI_OK,
              "order %d", order);
        for (int l = 0; l < order; l++) {
            double factor = l == 1 ? 2 * pi / 3 : l & 1 ? 0 : 2 * pi * a / ((l + 2) * (1 - l)) * (l & 2 ? -1 : 1);
            if (!(l & 1)) a *= (l + 1) / (double)(l + 2); /* l! / (2^l (l/2)!^2) */
            CHECK(fabs((double)one[l] - factor * sqrt((2 * l + 1) / (4 * pi))) <= 1.2e-7, "degree %d: %g, expected %g", l, (double)one[l],
                  factor * sqrt((2 * l + 1) / (4 * pi)));
            for (int i = 3 * l * l; i < 3 * (l + 1) * (l + 1); i++)
                CHECK(fabs((double)d[i] - factor * (double)c[i]) <= 4e-7 && fabs((double)e[i] - factor * (double)c[i]) <= 6e-7,
                      "degree %d: %g and %g, expected %g", l, (double)d[i], (double)e[i], factor * (double)c[i]);
        }
    }
}

/* f times g at the highest order (40 in the quick suite: the matrix of 101 has 416 MB) by quadrature of f and g as they are evaluated: from
   a product, and from the matrix of f, whose entries are within half an ulp, and which is symmetric to the bit. */
TEST(products_of_the_highest_order) {
    static double y[N], expected_product[N];
    const int order = LONG_SUITE ? MOST : 40, n = order * order, latitudes = 3 * order / 2 + 1, longitudes = 3 * order;
    static long double node[3 * MOST / 2 + 1], weight[3 * MOST / 2 + 1];
    float *matrix = (float *)malloc((size_t)n * (size_t)n * sizeof *matrix);
    double worst = 0, worst_matrix = 0;
    test_random r = {74};
    if (!matrix) SKIP("no memory");
    for (int i = 0; i < n; i++) c[i] = (float)random_range(&r, -1, 1), d[i] = (float)random_range(&r, -1, 1), expected_product[i] = 0;
    reference_nodes(node, weight, latitudes);
    for (int i = 0; i < latitudes * longitudes; i++) {
        const double z = (double)node[i / longitudes], s = sqrt((1 - z) * (1 + z)), phi = 2 * pi * (i % longitudes) / longitudes;
        const double v[1][3] = {{s * cos(phi), s * sin(phi), z}};
        double f = 0, g = 0, scale = (double)weight[i / longitudes] * 2 * pi / longitudes;
        isogi_sh_eval_f64(y, order, v, 1);
        for (int k = 0; k < n; k++) f += (double)c[k] * y[k], g += (double)d[k] * y[k];
        for (int k = 0; k < n; k++) expected_product[k] += scale * f * g * y[k];
    }
    CHECK(isogi_sh_product(e, c, d, order, 1) == ISOGI_OK, "order %d", order);
    for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)e[i] - expected_product[i]) - 6e-8 * fabs(expected_product[i]));
    CHECK(isogi_sh_product_matrix(matrix, c, order) == ISOGI_OK, "order %d", order);
    for (int i = 0; i < n; i++) {
        double sum = 0, most = 0;
        for (int k = 0; k < n; k++) {
            const float entry = matrix[(size_t)n * (size_t)i + (size_t)k];
            sum += (double)entry * (double)d[k], most += fabs((double)entry * (double)d[k]);
            if (k < i && (k % 64 == i % 64 || order < MOST)) /* strides of 40 KB take long */
                CHECK(!memcmp(&entry, matrix + (size_t)n * (size_t)k + i, sizeof entry), "%d %d: %g", i, k, (double)entry);
        }
        worst_matrix = fmax(worst_matrix, fabs(sum - expected_product[i]) - 6e-8 * most);
    }
    printf("    order %d: products off by half an ulp and %.3g, the matrix by %.3g\n", order, worst, worst_matrix);
    CHECK(worst <= 1e-10 && worst_matrix <= 1e-10, "order %d: beyond half an ulp %g, the matrix %g", order, worst, worst_matrix);
    free(matrix);
}

TEST(rotations_of_any_order) {
    const double angles[][3] = {{0, 0, 0}, {0, 1e-9, 0}, {0, 3.14159265358979323846, 0}, {3, 1.5, -2}};
    static double wide[N], turned[N];
    float *rotation = (float *)malloc(ISOGI_SH_ROTATION_COUNT(MOST) * sizeof *rotation), m[9], z[9];
    test_random r = {51};
    for (int o = 0; o < ORDERS; o++)
        for (int a = 0; a < 4 && rotation; a++) {
            int order = orders[o], n = order * order;
            if (order > 2 && !LONG_SUITE && a != 3) continue;
            double m64[9], worst = 0, worst_applied = 0, worst_z = 0;
            const float v[3] = {0.36f, 0.48f, -0.8f};
            float back[3];
            for (int i = 0; i < 3 * n; i++) c[i] = (float)random_range(&r, -1, 1);
            for (int i = 0; i < n; i++) wide[i] = (double)c[3 * i];
            CHECK(isogi_sh_matrix_from_euler_zyz(m, angles[a][0], angles[a][1], angles[a][2]) == ISOGI_OK, "%d", a);
            for (int k = 0; k < 9; k++) m64[k] = (double)m[k];
            for (int k = 0; k < 3; k++) back[k] = m[k] * v[0] + m[3 + k] * v[1] + m[6 + k] * v[2];
            CHECK(isogi_sh_rotate(d, c, order, 3, m) == ISOGI_OK && isogi_sh_rotate_f64(turned, wide, order, 1, m64) == ISOGI_OK,
                  "order %d", order);
            CHECK(isogi_sh_rotation_build(rotation, order, m) == ISOGI_OK && isogi_sh_rotation_apply(e, c, order, 3, rotation) == ISOGI_OK,
                  "order %d", order);
            for (int i = 0; i < n; i++)
                worst = fmax(worst, fabs((double)d[3 * i] - turned[i])),
                worst_applied = fmax(worst_applied, fabs((double)e[3 * i] - turned[i]));
            /* roundings of the result; of 2 l + 1 entries of a matrix and their products besides */
            CHECK(worst <= 3e-7 && worst_applied <= 3e-7 * sqrt(order), "order %d, rotation %d: %g in float, %g applied", order, a, worst,
                  worst_applied);
            /* the derivative of a sum is `order` times the sum, and a float matrix is off by 1e-7 */
            CHECK(fabs(value_at(order, d, v) - value_at(order, c, back)) <= 2e-6 * order * sqrt(n),
                  "order %d, rotation %d: %g, expected %g", order, a, value_at(order, d, v), value_at(order, c, back));
            CHECK(isogi_sh_matrix_from_euler_zyz(z, angles[a][0], 0, 0) == ISOGI_OK && isogi_sh_rotate(e, c, order, 3, z) == ISOGI_OK &&
                      isogi_sh_rotate_z(d, c, order, 3, angles[a][0]) == ISOGI_OK,
                  "%d", a);
            for (int i = 0; i < 3 * n; i++) worst_z = fmax(worst_z, fabs((double)d[i] - (double)e[i]));
            CHECK(worst_z <= 3e-7 * (order + 1), "order %d, about z: %g", order, worst_z);
        }
    CHECK(rotation != NULL, "%s", "memory");
    free(rotation);
    for (int a = 0; a < AXES; a++) {
        float q[4] = {0, axes[a][0], axes[a][1], axes[a][2]};
        for (int kind = 0; kind < 2; kind++) {
            double off = 0;
            CHECK((kind ? isogi_sh_matrix_from_quaternion(m, q) : isogi_sh_matrix_from_axis_angle(m, axes[a], 1e9)) == ISOGI_OK,
                  "axis %d, kind %d", a, kind);
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    double dot = 0;
                    for (int k = 0; k < 3; k++) dot += (double)m[3 * i + k] * (double)m[3 * j + k];
                    off = fmax(off, test_finite(dot) ? fabs(dot - (i == j)) : 1e9);
                }
            CHECK(off <= 4e-7, "axis %d, kind %d: %g from orthonormal", a, kind, off);
        }
    }
}

static void constant(void *user, const double direction[3], double *value) {
    (void)user, (void)direction;
    value[0] = 2, value[1] = -1;
}

/* A constant is its mean, whatever the order and the number of samples. */
TEST(projections_of_any_order) {
    enum { WIDTH = 204, HEIGHT = 103 };
    static double wide[2 * N];
    static float image[WIDTH * HEIGHT * 3];
    const double mean = sqrt(4 * pi);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) image[i] = 2;
    for (int o = 0; o < ORDERS; o++) {
        int order = orders[o], n = order * order, sizes[] = {1, 2, 5};
        double worst = 0;
        CHECK(isogi_sh_project_function(wide, order, 2, 0, constant, NULL) == ISOGI_OK && close_to(wide[0], 2 * mean, 1e-13) &&
                  close_to(wide[1], -mean, 1e-13),
              "order %d: %g %g", order, wide[0], wide[1]);
        for (int i = 2; i < 2 * n; i++) worst = fmax(worst, fabs(wide[i]));
        CHECK(worst <= 1e-12, "order %d: a constant has %g", order, worst);
        for (int stratified = 0; stratified < 2; stratified++)
            CHECK(isogi_sh_project_random(wide, order, 2, 3, stratified, 7, constant, NULL) == ISOGI_OK &&
                      close_to(wide[0], 2 * mean, 1e-13) && test_finite(wide[2 * n - 1]),
                  "order %d: %g", order, wide[0]);
        CHECK(isogi_sh_project_equirect(c, order, image, WIDTH, HEIGHT) == ISOGI_OK, "order %d", order);
        worst = 0;
        for (int i = 3; i < 3 * n; i++) worst = fmax(worst, fabs((double)c[i]));
        CHECK(close_to((double)c[0], 2 * mean, 3e-7) && worst <= 2e-6, "order %d: %g, and %g", order, (double)c[0], worst);
        for (int k = 0; k < 3; k++) {
            const float *faces[6] = {image, image, image, image, image, image};
            CHECK(isogi_sh_project_image(c, order, 1, image, sizes[k], sizes[2 - k]) == ISOGI_OK &&
                      close_to((double)c[0], 2 * mean, 3e-7) && test_finite((double)c[n - 1]),
                  "order %d, size %d: %g", order, sizes[k], (double)c[0]);
            CHECK(isogi_sh_project_cube(c, order, 3, faces, sizes[k]) == ISOGI_OK && close_to((double)c[0], 2 * mean, 3e-7) &&
                      test_finite((double)c[3 * n - 1]),
                  "order %d, cube of %d: %g", order, sizes[k], (double)c[0]);
        }
        for (int i = 0; i < 3 * n; i++) c[i] = (float)(i % 5) / (float)n;
        for (int a = 0; a < AXES; a++) { /* an environment of coefficients, and derivatives, in any direction */
            static double gradient[N][3];
            const double direction[1][3] = {{(double)axes[a][0], (double)axes[a][1], (double)axes[a][2]}};
            const isogi_env env = {.sh = c, .sh_order = order};
            float rgb[3];
            isogi_env_radiance(&env, axes[a], rgb);
            CHECK(fabs((double)rgb[0] - value_at(order, c, axes[a])) <= 1e-6, "order %d, axis %d: %g, expected %g", order, a,
                  (double)rgb[0], value_at(order, c, axes[a]));
            CHECK(isogi_sh_eval_gradient_f64(gradient, order, direction, 1) == ISOGI_OK, "axis %d", a);
            double length = sqrt(direction[0][0] * direction[0][0] + direction[0][1] * direction[0][1] + direction[0][2] * direction[0][2]);
            for (int i = 0; i < n; i++) {
                double along = 0;
                for (int k = 0; k < 3; k++) along += gradient[i][k] * (direction[0][k] / length);
                if (!(fabs(along) <= 1e-12 * order)) worst = 1e9;
            }
            CHECK(worst < 1, "order %d, axis %d: a gradient is not tangent", order, a);
        }
    }
}

/* Weighted samples at axes of every length, at no direction, which is +z, and at none at all: sums of Y. */
TEST(samples_of_any_order) {
    static quad sum[2 * N];
    static double wide[2 * N];
    float direction[AXES + 1][3], value[2 * (AXES + 1)], weight[AXES + 1];
    for (int i = 0; i <= AXES; i++) {
        for (int k = 0; k < 3; k++) direction[i][k] = i < AXES ? axes[i][k] : 0;
        value[2 * i] = (float)(i + 1), value[2 * i + 1] = (float)(3 - i), weight[i] = 0.125f * (float)(i % 5);
    }
    for (int o = 0; o < ORDERS; o++) {
        const int order = orders[o], n = order * order;
        double worst = 0;
        for (int i = 0; i < 2 * n; i++) sum[i] = 0;
        for (int i = 0; i <= AXES; i++) {
            basis_at(order, i < AXES ? axes[i] : axes[0]);
            for (int k = 0; k < 2 * n; k++) sum[k] += basis[k / 2] * (quad)weight[i] * (quad)value[2 * i + k % 2];
        }
        CHECK(isogi_sh_project_samples(wide, order, 2, (const float(*)[3])direction, value, weight, AXES + 1) == ISOGI_OK, "order %d",
              order);
        for (int k = 0; k < 2 * n; k++) worst = fmax(worst, test_finite(wide[k]) ? fabs(wide[k] - (double)sum[k]) : 1e9);
        CHECK(worst <= 1e-12 * order * ROUNDING_FACTOR, "order %d: %g", order, worst);
        CHECK(isogi_sh_project_samples(wide, order, 2, NULL, NULL, NULL, 0) == ISOGI_OK && wide[0] == 0 && wide[2 * n - 1] == 0,
              "order %d: nothing is %g", order, wide[0]);
    }
}

TEST(fits_of_any_order) {
    for (int o = 1; o < ORDERS; o++)
        for (int a = 0; a < AXES; a++) {
            isogi_light sun = {.vector = {axes[a][0], axes[a][1], axes[a][2]}, .rgb = {3, 2, 1}};
            isogi_lighting lighting = {.lights = &sun, .light_count = 1};
            float direction[3], rgb[3], ambient[3];
            double length = sqrt((double)axes[a][0] * (double)axes[a][0] + (double)axes[a][1] * (double)axes[a][1] +
                                 (double)axes[a][2] * (double)axes[a][2]),
                   off = 0;
            isogi_sh_project(c, orders[o], &lighting, NULL);
            CHECK(isogi_sh_fit_directional(direction, rgb, ambient, c, orders[o]) == ISOGI_OK, "axis %d", a);
            for (int k = 0; k < 3; k++) off = fmax(off, fabs((double)direction[k] - (double)axes[a][k] / length));
            CHECK(off <= 1e-5 && fabs((double)rgb[0] - 3) <= 1e-4 && fabs((double)ambient[0]) <= 1e-4, "order %d, axis %d: %g off, %g %g",
                  orders[o], a, off, (double)rgb[0], (double)ambient[0]);
            CHECK(isogi_sh_dominant_direction(direction, rgb, c, orders[o]) == ISOGI_OK, "axis %d", a);
            off = fabs((double)rgb[0] - 3) + fabs((double)rgb[1] - 2) + fabs((double)rgb[2] - 1);
            for (int k = 0; k < 3; k++) off = fmax(off, fabs((double)direction[k] - (double)axes[a][k] / length));
            CHECK(off <= 1e-5, "order %d, axis %d: dominant direction %g off", orders[o], a, off);
        }
}

/* ---- what doubles reach, and what has a closed form ---- */

/* What the header allows doubles at an order, -ffast-math and x87 registers included. */
static double allowed_at(int order) {
    const double bound = order <= 5 ? 1e-15 : order <= 11 ? 5e-15 : order <= 21 ? 2e-14 : 7e-13;
    return bound * (ROUNDING_FACTOR > 1 ? 6 : 1) * (FLT_EVAL_METHOD == 2 ? 2 : 1);
}

/* Doubles as short and as long as they are, the zero vector and what is not finite, in every function in double that takes directions:
   in a batch, in both layouts and alone they are the reference's; what has no direction is +z. */
TEST(doubles_of_any_length_and_order) {
    static const double vectors[][3] = {{0, 0, 1}, {5e-324, 0, 0}, {1e-310, 2e-310, -2e-310}, {1.7e308, -1.7e308, 1e308},
        {1e-300, 0, 1e300}, {0, -1.7e308, 5e-324}, {1e-8, 0, -1}, {0, 1e-8, 1}, {-1e-160, 1e-160, 0}, {1e155, 1, -1e155}, {0, 0, 0},
        {-0.0, 0, -0.0}, {(double)NAN, 0, 1}, {0, (double)INFINITY, 0}, {1, 2, -(double)INFINITY}};
    enum { COUNT = sizeof vectors / sizeof *vectors, DIRECTED = 10 };
    static double y[COUNT * N], columns[COUNT * N], one[N], wide[3 * N], gradient[COUNT][N][3], up[N][3], x[3][COUNT], sum[3 * COUNT];
    static const double above[1][3] = {{0, 0, 2}};
    static const int some[] = {1, 2, 5, 21, 101};
    test_random r = {71};
    for (int i = 0; i < COUNT; i++)
        for (int k = 0; k < 3; k++) x[k][i] = vectors[i][k];
    for (int o = 0; o < 5; o++) {
        const int order = some[o], n = order * order;
        double worst = 0, worst_sum = 0, along = 0;
        for (int i = 0; i < 3 * n; i++) wide[i] = random_range(&r, -1, 1) / n;
        CHECK(isogi_sh_eval_f64(y, order, vectors, COUNT) == ISOGI_OK &&
                  isogi_sh_eval_soa_f64(columns, order, x[0], x[1], x[2], COUNT) == ISOGI_OK &&
                  isogi_sh_eval_sum_f64(sum, wide, order, 3, vectors, COUNT) == ISOGI_OK,
              "order %d", order);
        isogi_sh_eval_gradient_f64(up, order, above, 1);
        for (int i = 0; i < COUNT; i++) {
            quad v[3] = {0, 0, 1}, length = 1, value[3] = {0, 0, 0};
            for (int k = 0; k < 3 && i < DIRECTED; k++) v[k] = (quad)vectors[i][k];
            reference_eval(basis, order, v);
            isogi_sh_eval_f64(one, order, vectors + i, 1);
            for (int k = 0; k < n; k++) {
                const double at[3] = {y[i * n + k], columns[k * COUNT + i], one[k]};
                for (int p = 0; p < 3; p++) worst = fmax(worst, test_finite(at[p]) ? fabs((double)(basis[k] - (quad)at[p])) : 1e9);
                for (int channel = 0; channel < 3; channel++) value[channel] += basis[k] * (quad)wide[3 * k + channel];
            }
            for (int k = 0; k < 3; k++)
                worst_sum = fmax(worst_sum, test_finite(sum[3 * i + k]) ? fabs((double)(value[k] - (quad)sum[3 * i + k])) : 1e9);
            CHECK(isogi_sh_eval_gradient_f64(gradient[i], order, vectors + i, 1) == ISOGI_OK, "vector %d", i);
            if (i >= DIRECTED)
                CHECK(!memcmp(gradient[i], up, (size_t)n * sizeof *up), "order %d, vector %d: its gradient is not that of +z", order, i);
            length = quad_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            for (int k = 0; k < n; k++) {
                const double *g = gradient[i][k];
                const quad dot = (quad)g[0] * v[0] + (quad)g[1] * v[1] + (quad)g[2] * v[2];
                along = fmax(along, test_finite(g[0] + g[1] + g[2]) ? fabs((double)(dot / length)) : 1e9);
            }
        }
        printf("    order %d: %.3g, sums %.3g; gradients along their direction %.3g\n", order, worst, worst_sum, along);
        CHECK(worst <= allowed_at(order) && worst_sum <= allowed_at(order), "order %d: %g, sums %g", order, worst, worst_sum);
        CHECK(along <= 1e-12 * order, "order %d: gradients along their direction %g", order, along);
    }
}

/* By 0, pi and 1e-9 about each axis, in double: at once, by a matrix and about z, they are evaluation at the direction turned back; and
   1e-9 is not nothing. */
TEST(rotations_by_nothing_by_half_a_turn_and_by_little) {
    static const double angles[] = {0, 3.14159265358979323846, 1e-9};
    static double wide[N], turned[3][N], y[N];
    static const int some[] = {1, 2, 6, 17, 101};
    double *rotation = (double *)malloc(ISOGI_SH_ROTATION_COUNT(MOST) * sizeof *rotation);
    test_random r = {72};
    for (int i = 0; rotation && i < 45; i++) {
        const int order = some[i / 9], n = order * order, axis = i % 3, ways = 1 + (order < 101 || i % 9 == 5 || LONG_SUITE);
        const double angle = angles[i / 3 % 3];
        double v[3] = {0, 0, 0}, m[9], to[1][3], back[1][3], norm = 0, moved = 0, expected_value = 0;
        v[axis] = 1;
        CHECK(isogi_sh_matrix_from_axis_angle_f64(m, v, angle) == ISOGI_OK, "axis %d, angle %g", axis, angle);
        for (int k = 0; k < n; k++) wide[k] = random_range(&r, -1, 1), norm += wide[k] * wide[k];
        CHECK(isogi_sh_rotate_f64(turned[0], wide, order, 1, m) == ISOGI_OK, "axis %d, angle %g", axis, angle);
        if (ways > 1)
            CHECK(isogi_sh_rotation_build_f64(rotation, order, m) == ISOGI_OK &&
                      isogi_sh_rotation_apply_f64(turned[1], wide, order, 1, rotation) == ISOGI_OK, "order %d", order);
        isogi_sh_rotate_z_f64(turned[2], wide, order, 1, angle);
        for (int k = 0; k < n; k++) moved = fmax(moved, fabs(turned[0][k] - wide[k]));
        CHECK(order < 2 || (angle > 0) == (moved > 1e-11), "order %d, axis %d, angle %g moves by %g", order, axis, angle, moved);
        for (int k = 0; k < 10; k++) {
            random_direction(&r, to[0]);
            for (int a = 0; a < 3; a++) back[0][a] = m[a] * to[0][0] + m[3 + a] * to[0][1] + m[6 + a] * to[0][2];
            isogi_sh_eval_f64(y, order, (const double(*)[3])back, 1);
            expected_value = 0;
            for (int j = 0; j < n; j++) expected_value += wide[j] * y[j];
            isogi_sh_eval_f64(y, order, (const double(*)[3])to, 1);
            for (int way = 0; way < 3; way++) {
                double value = 0;
                if ((way == 1 && ways < 2) || (way == 2 && axis < 2)) continue;
                for (int j = 0; j < n; j++) value += turned[way][j] * y[j];
                CHECK(fabs(value - expected_value) <= 2 * allowed_at(order) * sqrt(norm),
                      "order %d, axis %d, angle %g, way %d: %.17g, not %.17g", order, axis, angle, way, value, expected_value);
            }
        }
    }
    CHECK(rotation != NULL, "%s", "memory");
    free(rotation);
}

/* Ten thousand turns by one matrix: what the header says the norm drifts, of every channel, at orders on all ways but those of tensors. */
TEST(norms_after_ten_thousand_rotations) {
    enum { ORDER = 17, CHANNELS = 3 };
    static double wide[CHANNELS * ORDER * ORDER];
    static const int some[] = {2, 3, 6, 8, 16, 17};
    const double axis[3] = {1, 2, -2};
    double m[9], worst = 0, worst_float = 0;
    float mf[9];
    test_random r = {73};
    CHECK(isogi_sh_matrix_from_axis_angle_f64(m, axis, 0.7) == ISOGI_OK, "%s", "matrix");
    for (int k = 0; k < 9; k++) mf[k] = (float)m[k];
    for (int o = 0; o < 6; o += 1 + QUICK_SUITE)
        for (int channels = some[o] == 3 ? 3 : 1; channels <= CHANNELS; channels += 2) {
            const int n = channels * some[o] * some[o];
            double before[CHANNELS] = {0, 0, 0}, after[CHANNELS] = {0, 0, 0}, after_float[CHANNELS] = {0, 0, 0};
            for (int i = 0; i < n; i++)
                c[i] = (float)random_range(&r, -1, 1), wide[i] = (double)c[i], before[i % channels] += wide[i] * wide[i];
            for (int i = 0; i < 10000; i++)
                isogi_sh_rotate_f64(wide, wide, some[o], channels, m), isogi_sh_rotate(c, c, some[o], channels, mf);
            for (int i = 0; i < n; i++)
                after[i % channels] += wide[i] * wide[i], after_float[i % channels] += (double)c[i] * (double)c[i];
            for (int k = 0; k < channels; k++)
                worst = fmax(worst, fabs(sqrt(after[k] / before[k]) - 1)),
                worst_float = fmax(worst_float, fabs(sqrt(after_float[k] / before[k]) - 1));
        }
    printf("    norms drift by %.3g in double, %.3g in float\n", worst, worst_float);
    CHECK(worst <= 2e-12 * ROUNDING_FACTOR && worst_float <= 2e-5 * ROUNDING_FACTOR, "drift %g, in float %g", worst, worst_float);
}

/* The antiderivative of the solid angle of what lies between the centre of a face and (s, t). */
static double corner(double s, double t) { return atan2(s * t, sqrt(s * s + t * t + 1)); }

/* One texel alone has its solid angle, wherever in whichever face. */
TEST(texels_of_cubes_have_their_solid_angles) {
    enum { MOST_TEXELS = 19 };
    static float texels[6][MOST_TEXELS * MOST_TEXELS];
    static const int sizes[] = {1, 2, 5, 16, 19};
    const float *face[6] = {texels[0], texels[1], texels[2], texels[3], texels[4], texels[5]};
    double worst = 0;
    for (int k = 0; k < 5; k++)
        for (int i = 0; i < 6 * sizes[k] * sizes[k]; i++) {
            const int size = sizes[k], p = i / 6;
            const double s = 2.0 * (p % size) / size - 1, t = 2.0 * (p / size) / size - 1, step = 2.0 / size;
            const double angle = corner(s + step, t + step) - corner(s, t + step) - corner(s + step, t) + corner(s, t);
            texels[i % 6][p] = 1;
            CHECK(isogi_sh_project_cube(c, 2, 1, face, size) == ISOGI_OK, "size %d", size);
            worst = fmax(worst, fabs((double)c[0] * sqrt(4 * pi) / angle - 1));
            texels[i % 6][p] = 0;
        }
    CHECK(worst <= 1.2e-7, "a solid angle is off by %g of it", worst);
}

/* A constant is its mean and nothing else; a sphere of radius r seen from a distance d is a disc of angular radius asin(r / d). */
TEST(constants_and_spheres) {
    static const double ratios[] = {1e-6, 0.01, 0.3, 0.9, 0.999};
    const float rgb[3] = {3, 0.5f, 0}, point[3] = {1, -2, 4};
    for (int o = 0; o < ORDERS; o++) {
        const int order = orders[o];
        CHECK(isogi_sh_constant(c, order, rgb) == ISOGI_OK, "order %d", order);
        for (int i = 0; i < order * order; i++) expected[i] = i ? 0 : sqrt(4 * pi);
        for (int k = 0; k < 3; k++) check_channel("constant", order, k, (double)rgb[k]);
        for (int i = 0; i < 5; i++) {
            const double distance = 6; /* of (4, -4, 2) */
            isogi_light light = {
                .kind = ISOGI_LIGHT_SPHERE, .vector = {5, -6, 6}, .rgb = {3, 0.5f, 0}, .radius = (float)(ratios[i] * distance)};
            isogi_lighting lighting = {.lights = &light, .light_count = 1};
            const double part = (double)light.radius / distance, half = asin(part);
            CHECK(isogi_sh_project(c, order, &lighting, point) == ISOGI_OK, "sphere %d", i);
            cone_zonal(order, half);
            for (int l = 0; l < order; l++) zonal[l] /= pi * part * part * distance * distance;
            turn_zonal(order, (const float[3]){4, -4, 2});
            for (int k = 0; k < 3; k++) check_channel("sphere", order, k, (double)rgb[k]);
        }
    }
}

/* Of the highest order that is de-ringed: a lamp in a sky, seen from a spiral of directions. */
TEST(deringing_of_the_highest_order) {
    enum { ORDER = 32, COUNT = 20000 };
    static float directions_of[COUNT][3], value[COUNT];
    const float up[3] = {1, 2, -2}, rgb[3] = {5, 5, 5}, sky[3] = {0.02f, 0.02f, 0.02f};
    double width = -1, low = 0, high = 0;
    for (int i = 0; i < COUNT; i++) {
        const double z = 1 - 2 * (i + 0.5) / COUNT, phi = i * 2.399963229728653, s = sqrt(1 - z * z);
        directions_of[i][0] = (float)(s * cos(phi)), directions_of[i][1] = (float)(s * sin(phi)), directions_of[i][2] = (float)z;
    }
    isogi_sh_cone(c, ORDER, up, 0.1, rgb), isogi_sh_constant(d, ORDER, sky), isogi_sh_add(c, c, d, ORDER, 3);
    for (int i = 0; i < ORDER * ORDER; i++) e[i] = c[3 * i];
    for (int windowed = 0; windowed < 2; windowed++) {
        if (windowed) CHECK(isogi_sh_dering(e, e, ORDER, 1, ISOGI_SH_LANCZOS, &width) == ISOGI_OK && width > 1, "width %g", width);
        isogi_sh_eval_sum(value, e, ORDER, 1, (const float(*)[3])directions_of, COUNT);
        low = high = 0;
        for (int i = 0; i < COUNT; i++) {
            if ((double)value[i] < low) low = (double)value[i];
            if ((double)value[i] > high) high = (double)value[i];
        }
        CHECK(windowed ? low >= -1e-5 * high : low < -0.01 * high, "windowed %d: %g of the largest", windowed, low / high);
    }
}

/* ---- the stack: what the header promises ---- */

#if STACK_MEASURED
enum { MANY = 67, WIDE = 48, HIGH = 24, TURNED = 22 }; /* matrices of more take minutes and megabytes */

static float many[N * MANY], image[WIDE * HIGH * 3], directions[MANY][3], coordinates[3][MANY], turn[ISOGI_SH_ROTATION_COUNT(TURNED)];
static double many_f64[N * MANY], directions_f64[MANY][3], coordinates_f64[3][MANY], turn_f64[ISOGI_SH_ROTATION_COUNT(TURNED)];
static const float flat[9] = {0.36f, 0.48f, -0.8f, -0.8f, 0.6f, 0, 0.48f, 0.64f, 0.6f};
static const double flat_f64[9] = {0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6};

static void use_eval(int order) {
    isogi_sh_eval(many, order, (const float(*)[3])directions, MANY);
    isogi_sh_eval_soa(many, order, coordinates[0], coordinates[1], coordinates[2], MANY);
}
static void use_eval_f64(int order) {
    isogi_sh_eval_f64(many_f64, order, (const double(*)[3])directions_f64, MANY);
    isogi_sh_eval_soa_f64(many_f64, order, coordinates_f64[0], coordinates_f64[1], coordinates_f64[2], MANY);
}
static void use_gradient(int order) {
    isogi_sh_eval_gradient((float(*)[3])many, order, (const float(*)[3])directions, 3);
    isogi_sh_eval_gradient_f64((double(*)[3])many_f64, order, (const double(*)[3])directions_f64, 3);
}
static void use_sum(int order) {
    isogi_sh_eval_sum(many, c, order, 3, (const float(*)[3])directions, MANY);
    isogi_sh_eval_sum_f64(many_f64, many_f64 + MANY, order, 1, (const double(*)[3])directions_f64, MANY);
}
static void use_rotate(int order) {
    isogi_sh_rotate(d, c, order, 1, flat), isogi_sh_rotate(d, c, order, 3, flat), isogi_sh_rotate_z(d, c, order, 3, 0.3);
    isogi_sh_rotate_f64(many_f64, many_f64, order, 1, flat_f64), isogi_sh_rotate_f64(many_f64, many_f64, order, 2, flat_f64);
}
static void use_matrix(int order) {
    if (order > TURNED) return;
    isogi_sh_rotation_build(turn, order, flat), isogi_sh_rotation_apply(d, c, order, 1, turn),
        isogi_sh_rotation_apply(d, c, order, 3, turn);
    isogi_sh_rotation_build_f64(turn_f64, order, flat_f64), isogi_sh_rotation_apply_f64(many_f64, many_f64 + N, order, 1, turn_f64);
    if (order <= 11) isogi_sh_product_matrix(many, c, order);
}
static void use_product(int order) {
    if (order <= 22) isogi_sh_product(many, c, e, order, 1);
    if (order <= 5) isogi_sh_product(many, c, c, order, 19);
}
static void use_algebra(int order) {
    double energy[MOST], width;
    isogi_sh_cosine_zonal(e, order), isogi_sh_convolve(d, c, order, 3, e), isogi_sh_convolve_cosine(d, c, order, 3),
        isogi_sh_mirror(d, c, order, 3, 1);
    isogi_sh_zonal_to_direction(d, order, e, directions[0]), isogi_sh_window(d, c, order, 3, ISOGI_SH_HANN, order),
        isogi_sh_band_energy(energy, c, order, 3);
    if (order <= 22) isogi_sh_dering(d, c, order, 1, ISOGI_SH_HANN, &width);
}
static void use_projection(int order) {
    const float *faces[6] = {image, image, image, image, image, image};
    isogi_sh_project_equirect(d, order, image, WIDE, HIGH), isogi_sh_project_image(d, order, 2, image, WIDE, HIGH),
        isogi_sh_project_cube(d, order, 3, faces, 4);
    isogi_sh_project_function(many_f64, order, 2, 0, constant, NULL), isogi_sh_project_random(many_f64, order, 2, 9, 1, 3, constant, NULL);
    isogi_sh_project_samples(many_f64, order, 3, (const float(*)[3])directions, image, NULL, MANY);
}
static void use_lights(int order) {
    static const isogi_light lights[] = {{ISOGI_LIGHT_DIRECTIONAL, {1, 2, 3}, {1, 1, 1}, 0.1f, {{0}}},
                                         {ISOGI_LIGHT_POINT, {1, 2, 3}, {1, 1, 1}, 0, {{0}}},
                                         {ISOGI_LIGHT_SPHERE, {1, 2, 3}, {1, 1, 1}, 1, {{0}}},
                                         {ISOGI_LIGHT_RECTANGLE, {0, 0, -2}, {1, 1, 1}, 0, {{1, 0, 0}, {0, 2, 0}}},
                                         {ISOGI_LIGHT_RECTANGLE, {0, 0, -2}, {1, 1, 1}, 0, {{1e-4f, 0, 0}, {0, 2, 0}}}}; /* narrow */
    const isogi_lighting lighting = {
        .env = {.rgb = image, .width = WIDE, .height = HIGH, .sh = c, .sh_order = order}, .lights = lights, .light_count = 5};
    float v[3], rgb[3], ambient[3];
    isogi_sh_project(d, order, &lighting, NULL), isogi_env_radiance(&lighting.env, directions[0], rgb);
    isogi_sh_cone(d, order, directions[0], 0.4, rgb), isogi_sh_gradient_sky(d, order, directions[0], rgb, rgb),
        isogi_sh_hemisphere_sky(d, order, directions[0], rgb, rgb);
    isogi_sh_dominant_direction(v, rgb, d, order), isogi_sh_fit_directional(v, rgb, ambient, d, order);
}

TEST(calls_take_little_stack) {
    static const struct {
        const char *name;
        void (*run)(int order);
    } uses[] = {{"evaluation", use_eval}, {"evaluation in double", use_eval_f64}, {"gradients", use_gradient}, {"sums", use_sum},
        {"rotation", use_rotate}, {"matrices", use_matrix},
                {"products", use_product}, {"algebra", use_algebra}, {"projection", use_projection}, {"lights", use_lights}};
    static const int all[] = {1, 2, 3, 4, 5, 8, 11, 12, 16, 17, 21, 22, MOST};
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++) {
            directions[i][k] = coordinates[k][i] = sinf((float)(3 * i + k + 1));
            directions_f64[i][k] = coordinates_f64[k][i] = (double)directions[i][k];
        }
    for (int i = 0; i < 3 * N; i++) c[i] = d[i] = e[i] = 1.0f / (float)(i + 1);
    for (size_t u = 0; u < sizeof uses / sizeof *uses; u++) {
        size_t most = 0;
        int at = 0;
        for (size_t o = 0; o < sizeof all / sizeof *all; o++) {
            size_t bytes = stack_of(uses[u].run, all[o]);
            if (bytes > most) most = bytes, at = all[o];
        }
        if (LONG_SUITE) printf("    %-22s %6zu bytes at order %d\n", uses[u].name, most, at);
        CHECK(most < MOST_BYTES_SH, "%s of order %d: %zu bytes", uses[u].name, at, most);
    }
}
#endif

TEST_MAIN("sh_limits")
