/* Properties of rendering in data space (Kraus 2005): exact per cell, pre-integrated and post-classified; peaks, silhouettes, two-sided light. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

/* ---- the reference: a walk in long double, cells cut into many short pieces, each cut at the points of the transfer function ---- */

typedef struct reference {
    long double rgb[3], clear, depth_t[64], depth_clear[64];
    long double half_from; /* unused until the whole is known */
} reference;

/* From value x to y, a short way: Gauss's rule with five points between the points of the transfer function, depth by Simpson's rule; peaks
   where "value >= isovalue" changes. */
static void reference_values(const isogi_transfer *t, long double x, long double y, long double out[4], int *crossings) {
    while (x < y || x > y) {
        long double next = y, v[4];
        size_t peak = t->peak_count;
        for (size_t i = 0; i < t->point_count; i++) {
            long double at = (long double)t->points[i].value;
            if (x < y ? at > x && at < next : at < x && at > next) next = at;
        }
        for (size_t i = 0; i < t->peak_count; i++) {
            long double at = (long double)t->peaks[i].isovalue;
            if (x < y ? at > x && at <= next : at <= x && at > y && at >= next && at < x) next = at, peak = i;
        }
        for (int i = 0; i < 6; i++) { /* the last one only for the depth of the whole */
            static const long double place[6] = {0.046910077030668003601L, 0.23076534494715845448L, 0.5L, 0.76923465505284154552L, 0.9530899229693319964L, 1};
            static const long double weight[5] = {0.11846344252809454376L, 0.23931433524968323402L, 0.28444444444444444444L, 0.23931433524968323402L,
                                                  0.11846344252809454376L};
            long double at = x + place[i] * (next - x), low[4], middle[4], depth;
            reference_transfer(t, x + 1e-9L * (at - x), low), reference_transfer(t, 0.5L * (x + at), middle);
            reference_transfer(t, x + (1 - 1e-9L) * (at - x), v);
            depth = (low[3] + 4 * middle[3] + v[3]) / 6 * fabsl(at - x);
            if (i == 5) out[3] *= expl(-depth);
            for (int a = 0; a < 3 && i < 5; a++) out[a] += out[3] * expl(-depth) * weight[i] * v[3] * v[a] * fabsl(next - x);
        }
        if (peak < t->peak_count) {
            for (int a = 0; a < 3; a++) out[a] += out[3] * (long double)t->peaks[peak].opacity * (long double)t->peaks[peak].rgb[a];
            out[3] *= 1 - (long double)t->peaks[peak].opacity;
            if (crossings) ++*crossings;
        }
        x = next;
    }
}

/* Premultiplied colour and transmittance up to where the transmittance falls below `end` (at *t, if so); unit-spaced volume at 0. */
static void reference_ray(const field *f, const isogi_transfer *t, const double eye[3], const float dir[3], int pieces, long double end,
                          long double out[4], long double *stop, int *crossings) {
    long double enter = 0, leave = 1e30L, o[3], d[3];
    for (int a = 0; a < 3; a++) out[a] = 0, o[a] = (long double)eye[a], d[a] = (long double)dir[a];
    out[3] = 1, *stop = -1;
    for (int a = 0; a < 3; a++) {
        long double t0 = -o[a] / d[a], t1 = (f->size[a] - 1 - o[a]) / d[a];
        enter = fmaxl(enter, fminl(t0, t1)), leave = fminl(leave, fmaxl(t0, t1));
    }
    for (long double at = enter; at < leave - 1e-15L;) {
        long double to = leave, last = 0;
        int c[3];
        for (int a = 0; a < 3; a++) {
            c[a] = (int)floorl(o[a] + (at + 1e-12L) * d[a]);
            if (c[a] < 0) c[a] = 0;
            if (c[a] > f->size[a] - 2) c[a] = f->size[a] - 2;
            long double border = ((d[a] > 0 ? c[a] + 1 : c[a]) - o[a]) / d[a];
            if (border > at + 1e-13L && border < to) to = border;
        }
        for (int i = 0; i <= pieces; i++) {
            long double p[3], here = at + (to - at) * i / pieces, value;
            for (int a = 0; a < 3; a++) p[a] = o[a] + here * d[a];
            value = reference_value(f, c, p);
            if (i) reference_values(t, last, value, out, crossings);
            last = value;
            if (out[3] <= end) {
                *stop = here;
                return;
            }
        }
        at = to;
    }
}

/* A transfer function with steps, empty stretches and points as close as can be. */
static void random_transfer(test_random *r, isogi_transfer_point *p, size_t count, double extinction) {
    double value = -0.8;
    for (size_t i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) p[i].rgb[a] = (float)random_unit(r);
        p[i].value = value, p[i].extinction = random_unit(r) < 0.3 ? 0 : (float)(extinction * random_unit(r));
        if (random_unit(r) > 0.25) value += random_range(r, 0.01, 3.0 / (double)count);
    }
}

TEST(exact_rays_agree_with_a_long_double_quadrature) {
    const double extinctions[] = {0.3, 3, 60};
    double most = 0, deepest = 0;
    int rays = LONG_SUITE ? 60 : 3, half = 0;
    test_random r = {101};
    for (int kind = 0; kind < 2; kind++)
        for (int e = 0; e < 3; e++)
            for (int n = 0; n < rays; n++) {
                field f = kind ? field_waves(9, (uint64_t)n + 1) : field_noise(7, (uint64_t)n + 50);
                isogi_transfer_point points[12];
                isogi_peak peaks[3];
                random_transfer(&r, points, 12, extinctions[e]);
                for (int i = 0; i < 3; i++) {
                    peaks[i] = (isogi_peak){random_range(&r, -0.6, 0.6), {0, 0, 0}, (float)random_range(&r, 0, 0.5)};
                    for (int a = 0; a < 3; a++) peaks[i].rgb[a] = (float)random_unit(&r);
                }
                const isogi_transfer transfer = {.points = points, .point_count = 12, .peaks = peaks, .peak_count = n % 2 ? 3 : 0};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                double eye[3], target[3], origin[3];
                float dir[3];
                long double expected[4], stop;
                random_line(&f, &r, eye, target);
                isogi_view view = line_of_sight(eye, target);
                isogi_view_ray(&view, 0, 0, origin, dir);
                pixel p = cast(dvr, eye, target, NULL);
                reference_ray(&f, &transfer, origin, dir, 600, -1, expected, &stop, NULL);
                /* float pixels: 6e-8; extrema within the reference's short pieces: some 1e-7 of the extinction */
                double tolerance = 2e-7 + 2e-7 * extinctions[e] * (double)expected[3] + (e == 2 ? 8e-7 : 3e-7);
                if (tolerance > 1e-6) tolerance = 1e-6;
                for (int a = 0; a < 4; a++) {
                    double error = fabs((double)p.c[a] - (double)(a < 3 ? expected[a] : 1 - expected[3]));
                    most = fmax(most, error);
                    CHECK(error <= tolerance, "field %d extinction %g ray %d channel %d: %.9g, not %.9g", kind, extinctions[e], n, a, (double)p.c[a],
                          (double)(a < 3 ? expected[a] : 1 - expected[3]));
                }
                long double clear[4];
                reference_ray(&f, &transfer, origin, dir, 600, 1 - 0.5L * (1 - expected[3]), clear, &stop, NULL);
                if (stop > 0) {
                    /* float depth, and one short piece of the reference */
                    double error = fabs((double)p.depth - (double)stop);
                    deepest = fmax(deepest, error), half++;
                    CHECK(error < 4e-3, "field %d extinction %g ray %d: half depth %.9g, not %.9g", kind, extinctions[e], n, (double)p.depth, (double)stop);
                } else CHECK(p.depth > 1e30f || expected[3] > 1 - 1e-9L, "nothing is seen: depth %g", (double)p.depth);
                isogi_dvr_free(dvr);
                field_free(&f);
            }
    printf("    %d rays: largest error %.2g, of half depth %.2g voxel in %d\n", 6 * rays, most, deepest, half);
    CHECK(half > 3 * rays, "%d rays have a half depth", half);
}

/* The field f = x: opacity and colour of a linear transfer function have closed forms, from a thousand-millionth to opaque. */
static double along_x(double x, double y, double z) { return (void)y, (void)z, x; }

TEST(thin_and_opaque_media_keep_their_relative_accuracy) {
    field f = field_of(along_x, 9);
    for (double tau = 1e-9; tau < 2e6; tau *= 10) {
        const isogi_transfer_point points[] = {{0, {1, 0, 0.5f}, 0}, {1, {0, 1, 0.5f}, (float)tau}};
        const isogi_transfer transfer = {.points = points, .point_count = 2};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const double eye[3] = {-20, 4, 4}, target[3] = {0, 4, 4};
        pixel p = cast(dvr, eye, target, NULL);
        double k = (double)(float)tau, opacity = -expm1(-k / 2), green = 0;
        /* int s k s exp(-k s^2 / 2) ds by many points, to 1e-9 of itself: with s = sqrt(2 w / k), w the depth */
        for (int i = 0; i < 200000; i++) {
            double top = sqrt(fmin(k / 2, 40)), v = (i + 0.5) / 200000 * top;
            green += sqrt(2 / k) * v * 2 * v * exp(-v * v) * top / 200000;
        }
        CHECK(fabs((double)p.c[3] / opacity - 1) < 3e-7, "extinction %g: opacity %.9g, not %.9g", k, (double)p.c[3], opacity);
        CHECK(fabs((double)p.c[1] / green - 1) < 3e-7, "extinction %g: green %.9g, not %.9g", k, (double)p.c[1], green);
        CHECK(fabs((double)p.c[0] - (opacity - green)) < 3e-7 * opacity, "extinction %g: red %.9g, not %.9g", k, (double)p.c[0], opacity - green);
        CHECK(fabs((double)p.c[2] / opacity - 0.5) < 3e-7, "extinction %g: blue %.9g", k, (double)p.c[2]);
        /* half of the opacity: k s^2 / 2 = -log(1 - opacity / 2) */
        double half = 20 + 8 * sqrt(-2 * log1p(-opacity / 2) / k);
        CHECK(fabs((double)p.depth - half) < 4e-6, "extinction %g: half depth %.9g, not %.9g", k, (double)p.depth, half);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* f from 0 to 1 or back, short ways that end in the points. */
static void reference_table(const isogi_transfer *t, int down, long double out[4]) {
    size_t steps = 20 + t->point_count;
    long double at = down;
    for (size_t i = 0; i < steps; i++) {
        long double to = (i + 1) / (long double)steps, next = down ? 1 - to : to;
        for (size_t k = 0, n = t->point_count; k < n && n < 50; k++) { /* few points: cut at them */
            long double value = (long double)t->points[down ? n - 1 - k : k].value;
            if (down ? value < at && value > next : value > at && value < next) reference_values(t, at, value, out, NULL), at = value;
        }
        reference_values(t, at, next, out, NULL);
        at = next;
        if (out[3] < 1e-12L) break;
    }
}

/* A long table of points goes through runs of pieces put together in advance: as piece after piece, in both directions. */
TEST(long_tables_are_composited_as_their_pieces_are) {
    enum { N = 500 };
    static isogi_transfer_point points[N];
    field f = field_of(along_x, 4);
    test_random r = {7};
    for (int i = 0; i < N; i++) {
        points[i].value = i && random_unit(&r) < 0.1 ? points[i - 1].value : (i + random_unit(&r)) / N;
        points[i].extinction = (float)(random_unit(&r) < 0.2 ? 0 : random_range(&r, 0, 4));
        for (int a = 0; a < 3; a++) points[i].rgb[a] = (float)random_unit(&r);
    }
    for (int n = 0; n < 20; n++) {
        size_t count = n < 12 ? (size_t)n + 1 : (size_t)(N >> n % 8);
        const isogi_transfer transfer = {.points = points, .point_count = count};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const double left[3] = {-2, 1, 1}, right[3] = {5, 1, 1};
        pixel up = cast(dvr, left, right, NULL), down = cast(dvr, right, left, NULL);
        long double rising[4] = {0, 0, 0, 1}, falling[4] = {0, 0, 0, 1};
        reference_table(&transfer, 0, rising), reference_table(&transfer, 1, falling);
        for (int a = 0; a < 4; a++) {
            CHECK(fabs((double)up.c[a] - (double)(a < 3 ? rising[a] : 1 - rising[3])) < 2e-7, "%zu points rising %d: %g", count, a, (double)up.c[a]);
            CHECK(fabs((double)down.c[a] - (double)(a < 3 ? falling[a] : 1 - falling[3])) < 2e-7, "%zu points falling %d: %g", count, a, (double)down.c[a]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- monotone pieces ---- */

TEST(monotone_pieces_are_found_exactly) {
    test_random r = {15};
    int by_count[3] = {0, 0, 0};
    double worst = 0;
    for (int n = 0; n < (LONG_SUITE ? 2000000 : 40000); n++) {
        double b[4], u[2], scale = pow(10, random_range(&r, -30, 30));
        for (int i = 0; i < 4; i++) b[i] = n % 3 ? random_range(&r, -1, 1) : (double)((int)(random_bits(&r) % 5) - 2);
        for (int i = 0; i < 4; i++) b[i] *= scale;
        int found = isogi_dvr__extrema(b, u), expected = 0;
        long double d0 = (long double)b[1] - (long double)b[0], d1 = (long double)b[2] - (long double)b[1], d2 = (long double)b[3] - (long double)b[2];
        long double a = d0 - 2 * d1 + d2, h = d1 - d0, root = h * h - a * d0, at[2];
        if (fabsl(root) < 1e-12L * h * h) continue; /* an inflection with a level tangent: both answers are right */
        if (root > 0) { /* two roots of a u^2 + 2 h u + d0, each by the formula that does not cancel */
            long double q = h > 0 ? -h - sqrtl(root) : sqrtl(root) - h, x[2] = {a < 0 || a > 0 ? q / a : 2, q < 0 || q > 0 ? d0 / q : 2};
            for (int i = 0; i < 2; i++)
                if (x[i] > 1e-12L && x[i] < 1 - 1e-12L) at[expected++] = x[i];
            if (expected == 2 && at[0] > at[1]) root = at[0], at[0] = at[1], at[1] = root;
        }
        /* on an end itself rounding decides: then the piece beyond it has no length */
        for (int i = found; i-- > 0;)
            if (!(u[i] > 1e-12 && u[i] < 1 - 1e-12)) u[0] = u[1 - i], found--;
        by_count[expected]++;
        CHECK(found == expected, "%g %g %g %g: %d extrema, not %d", b[0], b[1], b[2], b[3], found, expected);
        for (int i = 0; i < found && found == expected; i++) {
            double error = fabs(u[i] - (double)at[i]);
            worst = fmax(worst, error);
            CHECK(error < 1e-8, "extremum at %.17g, not %.17Lg", u[i], at[i]); /* a double root: the square root of a rounding error */
        }
    }
    printf("    cubics with 0, 1, 2 extrema: %d %d %d; worst place %.2g\n", by_count[0], by_count[1], by_count[2], worst);
    CHECK(by_count[1] > 1000 && by_count[2] > 1000, "%d %d", by_count[1], by_count[2]);
}

/* Pieces join: each begins at the place and the value with which the last one ends, from the entry of the box to its exit; within each the
   value goes one way. */
TEST(monotone_pieces_cover_the_ray_without_a_gap) {
    test_random r = {16};
    for (int n = 0; n < 300; n++) {
        field f = field_noise(n % 2 ? 6 : 3, (uint64_t)n);
        const isogi_transfer_point everywhere = {0, {1, 1, 1}, 1};
        const isogi_transfer transfer = {.points = &everywhere, .point_count = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        double eye[3], target[3], dir[3], at = 0, value = 0;
        random_line(&f, &r, eye, target);
        if (n % 5 == 0) eye[0] = target[0], eye[1] = target[1] = floor(target[1]); /* along faces */
        if (n % 7 == 0) for (int a = 0; a < 3; a++) eye[a] = -2, target[a] = 1;      /* through voxels, corner to corner */
        for (int a = 0; a < 3; a++) dir[a] = target[a] - eye[a];
        isogi_dvr__march m;
        isogi_dvr__walk w;
        isogi_dvr__stretch p;
        if (isogi_dvr__begin(&m, dvr, eye, dir, sqrt(isogi_dvr__dot(dir, dir)), 0.5)) {
            int pieces = 0;
            isogi_dvr__begin_walk(&w, &m);
            while (isogi_dvr__next_monotone(&w, &p)) {
                CHECK(p.from >= at - 1e-15 * m.length && p.from <= at + 1e-12 * m.length, "piece %d begins at %.17g, not %.17g", pieces, p.from, at);
                if (pieces) CHECK(!(p.value[0] < value) && !(p.value[0] > value), "piece %d begins with %.17g, not %.17g", pieces, p.value[0], value);
                for (int i = 0; i < 8; i++) {
                    double u0 = p.u0 + (p.u1 - p.u0) * i / 8, u1 = p.u0 + (p.u1 - p.u0) * (i + 1) / 8;
                    double step = isogi_dvr__bernstein(p.b, u1) - isogi_dvr__bernstein(p.b, u0);
                    CHECK(step * (p.value[1] - p.value[0]) >= -1e-15, "piece %d goes from %g to %g, and once by %g", pieces, p.value[0], p.value[1], step);
                }
                at = p.to, value = p.value[1], pieces++;
            }
            CHECK(fabs(at - m.length) < 1e-12 * m.length, "pieces end at %.17g of %.17g", at, m.length);
        }
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

TEST_MAIN("dvr_data")
