/* Properties of rendering in data space (Kraus 2005): exact per cell, pre-integrated and post-classified; peaks, silhouettes, two-sided
   light. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "procedural.h"

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
            static const long double place[6] = {0.046910077030668003601L, 0.23076534494715845448L, 0.5L,
                                                 0.76923465505284154552L,  0.9530899229693319964L,  1};
            static const long double weight[5] = {0.11846344252809454376L, 0.23931433524968323402L, 0.28444444444444444444L,
                                                  0.23931433524968323402L, 0.11846344252809454376L};
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
static void reference_ray(const field *f, const isogi_transfer *t, const double eye[3], const double dir[3], int pieces, long double end,
                          long double out[4], long double *stop, int *crossings) {
    long double ends[2], leave, o[3], d[3];
    for (int a = 0; a < 3; a++) out[a] = 0, o[a] = (long double)eye[a], d[a] = (long double)dir[a];
    out[3] = 1, *stop = -1;
    reference_ends(f, o, d, ends), leave = ends[1];
    for (long double at = ends[0]; at < leave - 1e-15L;) {
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
    int rays = LONG_SUITE ? 60 : 2, half = 0;
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
                double eye[3], target[3], origin[3], dir[3];
                long double expected[4], stop = -1;
                random_line(&f, &r, eye, target);
                isogi_view view = line_of_sight(eye, target);
                view_ray(&view, 0, 0, origin, dir);
                pixel p = cast(dvr, eye, target, NULL);
                double tolerance = 0, errors[4];
                /* a step of the extinction within a short piece that holds an extremum takes shorter pieces: then these decide */
                for (int pieces = 600, again = 1; again && pieces <= 4800; pieces *= 8) {
                    reference_ray(&f, &transfer, origin, dir, pieces, -1, expected, &stop, NULL);
                    /* float pixels: 6e-8; extrema within the reference's short pieces: some 1e-7 of the extinction */
                    tolerance = fmin(1e-6, 2e-7 + 2e-7 * extinctions[e] * (double)expected[3] + (e == 2 ? 8e-7 : 3e-7));
                    again = 0;
                    for (int a = 0; a < 4; a++) {
                        errors[a] = fabs((double)p.c[a] - (double)(a < 3 ? expected[a] : 1 - expected[3]));
                        again |= !(errors[a] <= tolerance);
                    }
                }
                for (int a = 0; a < 4; a++) {
                    double error = errors[a];
                    most = fmax(most, error);
                    CHECK(error <= tolerance, "field %d extinction %g ray %d channel %d: %.9g, not %.9g", kind, extinctions[e], n, a,
                          (double)p.c[a], (double)(a < 3 ? expected[a] : 1 - expected[3]));
                }
                long double clear[4];
                if (expected[3] < 1) reference_ray(&f, &transfer, origin, dir, 600, 1 - 0.5L * (1 - expected[3]), clear, &stop, NULL);
                if (stop > 0) {
                    /* float depth, and one short piece of the reference */
                    double error = fabs((double)p.depth - (double)stop);
                    deepest = fmax(deepest, error), half++;
                    CHECK(error < 4e-3, "field %d extinction %g ray %d: half depth %.9g, not %.9g", kind, extinctions[e], n,
                          (double)p.depth, (double)stop);
                } else CHECK(p.depth > 1e30f, "nothing is seen: depth %g", (double)p.depth);
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
        CHECK(fabs((double)p.c[0] - (opacity - green)) < 3e-7 * opacity, "extinction %g: red %.9g, not %.9g", k, (double)p.c[0],
              opacity - green);
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
            CHECK(fabs((double)up.c[a] - (double)(a < 3 ? rising[a] : 1 - rising[3])) < 2e-7, "%zu points rising %d: %g", count, a,
                  (double)up.c[a]);
            CHECK(fabs((double)down.c[a] - (double)(a < 3 ? falling[a] : 1 - falling[3])) < 2e-7, "%zu points falling %d: %g", count, a,
                  (double)down.c[a]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- invariance (Kraus 2005, 4.1) ---- */

TEST(scaling_space_by_a_million_either_way_changes_no_pixel) {
    const double scales[] = {1, 1e-6, 1e-3, 37, 1e6};
    for (int silhouette = 0; silhouette < 2; silhouette++)
        for (int classification = 0; classification < 3; classification++) {
            float(*image[5])[4];
            for (int i = 0; i < 5; i++) {
                field f = field_waves(14, 21);
                test_random r = {9};
                isogi_vol_free(f.pyramid);
                for (int a = 0; a < 3; a++) f.volume.spacing[a] = scales[i];
                field_build(&f);
                const isogi_dvr_desc desc = {.pyramid = f.pyramid,
                                             .space = ISOGI_DVR_DATA,
                                             .classification = (isogi_dvr_classification)classification,
                                             .silhouette = (isogi_dvr_silhouette)silhouette};
                isogi_dvr *dvr = dvr_new(&desc, &landscape);
                isogi_view view = view_of(&f, scales[i], &r, 24);
                image[i] = picture(dvr, &view, NULL, NULL, NULL);
                isogi_dvr_free(dvr);
                field_free(&f);
            }
            double seen = 0;
            for (int p = 0; p < 24 * 24; p++) seen += (double)image[0][p][3] / (24 * 24);
            CHECK(seen > 0.3, "the picture shows something: mean opacity %g", seen);
            for (int i = 1; i < 5; i++) {
                /* the rays' origins and directions are floats: 1e-7 of a gradient of 0.1 per voxel over the distance; silhouettes of
                   surfaces seen edge on multiply it */
                double most = largest_difference(image[0], image[i], 24 * 24), rms = rms_difference(image[0], image[i], 24 * 24);
                CHECK(silhouette ? rms < 1e-3 : most < 2e-5, "classification %d scale %g: largest difference %g, RMS %g", classification,
                      scales[i], most, rms);
            }
            for (int i = 0; i < 5; i++) free(image[i]);
        }
}

TEST(constant_data_contributes_nothing_whatever_its_extinction) {
    test_random r = {5};
    for (int n = 0; n < 30; n++) {
        field f = field_new(9, 5, 7);
        double value = n % 3 ? random_range(&r, -1e6, 1e6) : 1.0 / 3;
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = value;
        field_build(&f);
        const isogi_transfer_point point = {0, {1, 1, 1}, 1e30f};
        const isogi_transfer transfer = {.points = &point, .point_count = 1};
        for (int c = 0; c < 3; c++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .classification = (isogi_dvr_classification)c};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            double eye[3], target[3];
            random_line(&f, &r, eye, target);
            pixel p = cast(dvr, eye, target, NULL);
            CHECK(p.c[3] <= 0 && p.c[0] <= 0 && p.depth > 1e30f, "classification %d: opacity %g", c, (double)p.c[3]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

/* ---- peaks ---- */

/* Kraus 2005, 4.5: N isosurfaces of opacity 1 - (1-a)^(1/N) converge to the constant transfer function: the rate. */
TEST(n_isosurfaces_converge_to_the_constant_transfer_function) {
    const int counts[] = {16, 64, 256, 1024, 4096};
    field f = field_waves(16, 4);
    const isogi_transfer_point points[] = {
        {-1, {0.2f, 0.5f, 1}, 0}, {-1, {0.2f, 0.5f, 1}, 1}, {1, {0.2f, 0.5f, 1}, 1}, {1, {0.2f, 0.5f, 1}, 0}};
    const isogi_transfer continuous = {.points = points, .point_count = 4};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
    isogi_dvr *dvr = dvr_new(&desc, &continuous);
    test_random r = {8};
    isogi_view view = view_of(&f, 1, &r, 16);
    float(*expected)[4] = picture(dvr, &view, NULL, NULL, NULL);
    isogi_peak *peaks = (isogi_peak *)malloc(4096 * sizeof *peaks);
    double error[5];
    for (int n = 0; n < 5; n++) {
        for (int i = 0; i < counts[n]; i++)
            peaks[i] = (isogi_peak){-1 + 2 * (i + 0.5) / counts[n], {0.2f, 0.5f, 1}, (float)-expm1(-2.0 / counts[n])};
        const isogi_transfer surfaces = {.peaks = peaks, .peak_count = (size_t)counts[n]};
        CHECK(isogi_dvr_set_transfer(dvr, &surfaces) == ISOGI_OK, "%d peaks", counts[n]);
        float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
        error[n] = rms_difference(image, expected, 256);
        free(image);
        if (n) CHECK(error[n] < error[n - 1] / 3, "RMSE %g with %d, %g with %d", error[n - 1], counts[n - 1], error[n], counts[n]);
    }
    printf("    RMSE with 16, 64, 256, 1024, 4096 isosurfaces: %.2g %.2g %.2g %.2g %.2g: about N^%.2f\n", error[0], error[1], error[2],
           error[3], error[4], log(error[4] / error[0]) / log(256));
    CHECK(error[4] < 2e-4, "RMSE %g with 4096", error[4]);
    free(peaks), free(expected);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* Along lattice lines every value that counts is a voxel's: whole numbers, exact. */
TEST(crossings_along_lattice_lines_are_exact) {
    test_random r = {78};
    for (int n = 0; n < 200; n++) {
        field f = field_new(12, 3, 3);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(random_bits(&r) % 3);
        field_build(&f);
        const isogi_peak peaks[2] = {{1, {1, 0, 0}, 0.25f}, {1.5, {0, 1, 0}, 0.5f}};
        const isogi_transfer transfer = {.peaks = peaks, .peak_count = 2};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        for (int line = 0; line < 9; line++) {
            const double eye[3] = {line % 2 ? -3 : 20, line % 3, line / 3}, target[3] = {5, line % 3, line / 3};
            const double *v = f.value + 12 * line;
            double clear = 1;
            int one = 0, two = 0;
            for (int x = 1; x < 12; x++) {
                one += (v[x] >= 1) != (v[x - 1] >= 1), two += (v[x] >= 1.5) != (v[x - 1] >= 1.5);
                if (x > 1 && v[x - 2] < 1 && v[x] < 1 && !(v[x - 1] < 1) && !(v[x - 1] > 1)) one--; /* touched in one point: once */
            }
            clear = pow(0.75, one) * pow(0.5, two);
            pixel p = cast(dvr, eye, target, NULL);
            CHECK(fabs((double)p.c[3] - (1 - clear)) < 1e-7, "volume %d line %d: opacity %.9g, not %.9g (%d and %d crossings)", n, line,
                  (double)p.c[3], 1 - clear, one, two);
        }
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* f = x: what lies between two peaks is between them in the picture, too, from either side; peaks of one value in the order given. */
TEST(peaks_and_media_stand_in_exact_order) {
    field f = field_of(along_x, 6);
    const isogi_transfer_point medium = {0, {0, 1, 0}, 3};
    const isogi_peak peaks[] = {{0.75, {0, 0, 1}, 0.5f}, {0.3, {1, 0, 0}, 0.5f}, {0.75, {1, 1, 1}, 0.25f}};
    const isogi_transfer transfer = {&medium, 1, peaks, 3};
    for (int c = 0; c < 2; c++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .classification = (isogi_dvr_classification)c};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const double left[3] = {-2, 2.3, 2.7}, right[3] = {9, 2.3, 2.7};
        pixel up = cast(dvr, left, right, NULL), down = cast(dvr, right, left, NULL);
        double a = exp(-3 * 0.3), b = exp(-3 * 0.45), e = exp(-3 * 0.25);
        double rising[3] = {a * 0.5 + a * 0.5 * b * 0.5 * 0.25, 0, a * 0.5 * b * (0.5 + 0.5 * 0.25)};
        double falling[3] = {e * (0.5 * 0.25 + 0.5 * 0.75 * b * 0.5), 0, e * (0.5 + 0.5 * 0.25)};
        rising[1] = 1 - a + a * 0.5 * (1 - b) + a * 0.5 * b * (0.5 * 0.25 + 0.5 * 0.75 * (1 - e));
        falling[1] = 1 - e + e * (0.5 * 0.25 + 0.375 * (1 - b) + 0.375 * b * 0.5 * (1 - a));
        for (int i = 0; i < 3; i++) {
            CHECK(fabs((double)up.c[i] - rising[i]) < (c ? 1e-5 : 1e-6), "classification %d rising, channel %d: %.9g, not %.9g", c, i,
                  (double)up.c[i], rising[i]);
            CHECK(fabs((double)down.c[i] - falling[i]) < (c ? 1e-5 : 1e-6), "classification %d falling, channel %d: %.9g, not %.9g", c, i,
                  (double)down.c[i], falling[i]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- classifications against the sampling rate (Kraus 2005, 3.2.4) ---- */

TEST(classifications_converge_to_the_exact_integral) {
    const double steps[] = {2, 1, 0.5, 0.25, 0.125};
    double error[3][5];
    field f = field_waves(20, 3);
    test_random r = {31};
    isogi_view view = view_of(&f, 1, &r, 24);
    const isogi_transfer smooth = {hills, 3, NULL, 0};
    const isogi_dvr_desc exact = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
    isogi_dvr *dvr = dvr_new(&exact, &smooth);
    float(*expected)[4] = picture(dvr, &view, NULL, NULL, NULL);
    isogi_dvr_free(dvr);
    for (int c = 0; c < 3; c++)
        for (int s = 0; s < 5; s++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .step = steps[s],
                                         .classification = (isogi_dvr_classification)c};
            dvr = dvr_new(&desc, &smooth);
            float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
            error[c][s] = rms_difference(image, expected, 24 * 24);
            free(image);
            isogi_dvr_free(dvr);
        }
    for (int c = 1; c < 3; c++)
        printf("    %s: RMSE %.2g %.2g %.2g %.2g %.2g for steps of 2, 1, 1/2, 1/4, 1/8 voxel\n",
               c == 1 ? "pre-integrated" : "post-classified", error[c][0], error[c][1], error[c][2], error[c][3], error[c][4]);
    CHECK(error[0][0] <= 0 && error[0][4] <= 0, "exact rays know no step: %g", error[0][0]);
    CHECK(error[1][2] < 1.5e-3 && error[2][2] < 1e-2 && error[1][4] < error[1][0] / 15 && error[2][4] < error[2][0] / 8,
          "pre %g .. %g, post %g .. %g", error[1][0], error[1][4], error[2][0], error[2][4]);
    for (int s = 0; s < 5; s++)
        CHECK(error[1][s] < error[2][s], "step %g: pre-integrated %g, post-classified %g", steps[s], error[1][s], error[2][s]);
    free(expected);
    field_free(&f);
}

/* Light is looked up for every piece, however little it shows. Against light at every sample of dense post-classified rays: no worse than
   unlit pictures differ, plus a 20th of 1/255. A fog of little steps is the hard case: all its pieces are weak. */
TEST(weak_pieces_are_lit_each) {
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 2, 3}, .rgb = {3, 2.5f, 2}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    field f = field_waves(20, 3);
    for (int thin = 0; thin < 3; thin++) {
        double error[2];
        test_random r = {53};
        isogi_view view = view_of(&f, 1, &r, 24);
        const isogi_transfer_point fog = {0, {1, 1, 1}, thin == 1 ? 0.05f : 0.5f};
        const isogi_transfer transfer = {thin ? &fog : hills, thin ? 1 : 3, NULL, 0};
        for (int lit = 0; lit < 2; lit++) {
            float(*image[2])[4];
            for (int i = 0; i < 2; i++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .shading = lit ? ISOGI_DVR_LOCAL
                    : ISOGI_DVR_UNLIT, .opaque = 1, .step = 1.0 / 16,
                                             .classification = i ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                image[i] = picture(dvr, &view, lit ? &lighting : NULL, NULL, NULL);
                isogi_dvr_free(dvr);
            }
            error[lit] = rms_difference(image[0], image[1], 24 * 24);
            free(image[0]), free(image[1]);
        }
        printf("    %s: unlit %.2g, lit %.2g\n", thin ? thin < 2 ? "thin fog" : "fog" : "hills", error[0], error[1]);
        CHECK(error[1] < error[0] + 0.05 / 255, "lit %g, unlit %g", error[1], error[0]);
    }
    field_free(&f);
}

/* ---- silhouettes (Kraus 2005, 5.1) ---- */

static double tilt[3];
static double tilted(double x, double y, double z) { return tilt[0] * x + tilt[1] * y + tilt[2] * z; }

TEST(silhouettes_follow_the_angle_between_surface_and_view) {
    test_random r = {41};
    const double eye[3] = {-20, 5.2, 5.4}, target[3] = {5, 5.2, 5.4};
    for (int n = 0; n < 200; n++) {
        random_direction(&r, tilt);
        if (n % 4 == 0) tilt[0] *= 1e-3; /* nearly edge on */
        double length = sqrt(tilt[0] * tilt[0] + tilt[1] * tilt[1] + tilt[2] * tilt[2]), aslant = length / fabs(tilt[0]),
               a0 = random_range(&r, 0.02, 0.9);
        field f = field_of(tilted, 12);
        double middle = (tilt[1] * 5.2 + tilt[2] * 5.4 + tilt[0] * 5.5) / 11;
        const isogi_peak peak = {middle, {1, 0.5f, 0.25f}, (float)a0};
        const isogi_transfer transfer = {NULL, 0, &peak, 1};
        double expected[4] = {a0, 1 - pow(1 - a0, aslant), fmin(1, a0 * aslant), fmin(1, a0 * aslant)};
        for (int kind = 0; kind < 4; kind++)
            for (int space = 0; space < 2; space++)
                for (int normals = 0; normals < 2; normals++) {
                    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .opaque = 1,
                        .silhouette = (isogi_dvr_silhouette)kind,
                                                 .normals = (isogi_normal_kind)normals};
                    isogi_dvr *dvr = dvr_new(&desc, &transfer);
                    pixel p = cast(dvr, eye, target, NULL);
                    /* normals are floats */
                    double tolerance = 1e-6 + 4e-6 * aslant * (kind ? 1 - expected[kind] + 1e-3 : 0);
                    CHECK(fabs((double)p.c[3] - expected[kind]) < tolerance, "kind %d space %d angle 1/%g: opacity %.9g, not %.9g", kind,
                          space, aslant, (double)p.c[3], expected[kind]);
                    for (int a = 0; a < 3; a++)
                        CHECK(fabsf(p.c[a] - p.c[3] * peak.rgb[a]) < 2e-7f, "colour scales with opacity: %g of %g", (double)p.c[a],
                              (double)p.c[3]);
                    isogi_dvr_free(dvr);
                }
        /* samples: the whole ray passes a change of value of tilt[0]; silhouettes make it the length of the gradient (eq. 17, 18) */
        const isogi_transfer_point medium = {0, {1, 1, 1}, 0.7f};
        const isogi_transfer everywhere = {&medium, 1, NULL, 0};
        double change = (double)0.7f * fabs(tilt[0]), plain = -expm1(-change), whole = -expm1(-change * aslant);
        for (int kind = 0; kind < 4; kind++)
            for (int c = 0; c < 3; c++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1,
                    .silhouette = (isogi_dvr_silhouette)kind,
                                             .classification = (isogi_dvr_classification)c, .table = 16}; /* of a constant */
                isogi_dvr *dvr = dvr_new(&desc, &everywhere);
                pixel p = cast(dvr, eye, target, NULL);
                /* the approximation depends on how the ray is cut: each small opacity times the factor; between the two */
                if (kind == ISOGI_DVR_SILHOUETTE_APPROXIMATE)
                    CHECK((double)p.c[3] > plain - 1e-6 && (double)p.c[3] < fmin(1, fmax(whole * 1.3, whole + 0.05)),
                          "classification %d: %g for %g", c, (double)p.c[3], whole);
                else
                    CHECK(fabs((double)p.c[3] - (kind ? whole : plain)) < 2e-6 + 2e-4 * (c == 1),
                          "kind %d classification %d: opacity %.9g, not %.9g", kind, c, (double)p.c[3], kind ? whole : plain);
                isogi_dvr_free(dvr);
            }
        /* the whole ray as one sample: the approximation of eq. 16 for all of it */
        const isogi_dvr_desc once = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .step = 100,
                                     .silhouette = ISOGI_DVR_SILHOUETTE_APPROXIMATE, .classification = ISOGI_DVR_POST_CLASSIFIED};
        isogi_dvr *dvr = dvr_new(&once, &everywhere);
        pixel p = cast(dvr, eye, target, NULL);
        CHECK(fabs((double)p.c[3] - fmin(1, plain * aslant)) < 2e-6, "one sample: opacity %.9g, not %.9g", (double)p.c[3],
              fmin(1, plain * aslant));
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* Volumes turned, stretched and sheared: of a medium of constant extinction per unit of data, silhouettes make the integral of |grad s|
   along the ray (eq. 17), the gradient that of space; here by Simpson's rule on a sixteenth of a cell. Noise, whose gradient turns within
   cells. */
TEST(silhouettes_integrate_the_gradient_of_space_along_the_ray) {
    enum { SIDE = 8, PARTS = 16 };
    test_random r = {43};
    const int count = LONG_SUITE ? 400 : 40;
    double sum[2] = {0, 0};
    for (int n = 0; n < count; n++) {
        field f = field_new(SIDE, SIDE, SIDE);
        double *m = f.volume.axes, to_grid[3][3], size, o[3], d[3], enter = 0, leave = 1e9, whole = 0, tau = 0.15;
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_range(&r, -1, 1);
        do { /* columns of random directions that are not nearly in a plane */
            for (int a = 0; a < 3; a++) {
                double column[3];
                random_direction(&r, column);
                for (int b = 0; b < 3; b++) m[3 * b + a] = column[b];
            }
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    to_grid[a][b] = m[3 * ((b + 1) % 3) + (a + 1) % 3] * m[3 * ((b + 2) % 3) + (a + 2) % 3] -
                                    m[3 * ((b + 1) % 3) + (a + 2) % 3] * m[3 * ((b + 2) % 3) + (a + 1) % 3];
            size = m[0] * to_grid[0][0] + m[3] * to_grid[0][1] + m[6] * to_grid[0][2];
        } while (fabs(size) < 0.3);
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = random_range(&r, 0.4, 2.5);
        for (int a = 0; a < 9; a++) to_grid[a / 3][a % 3] /= size * f.volume.spacing[a / 3];
        field_build(&f);
        double eye[3], target[3], world[3], aside[3], origin[3];
        float dir[3];
        random_direction(&r, aside);
        for (int a = 0; a < 3; a++) world[a] = random_range(&r, 2, SIDE - 3) * f.volume.spacing[a];
        for (int a = 0; a < 3; a++) {
            target[a] = m[3 * a] * world[0] + m[3 * a + 1] * world[1] + m[3 * a + 2] * world[2];
            eye[a] = target[a] + 60 * aside[a];
        }
        const isogi_view view = line_of_sight(eye, target);
        isogi_view_ray(&view, 0, 0, origin, dir);
        for (int a = 0; a < 3; a++) {
            o[a] = d[a] = 0;
            for (int b = 0; b < 3; b++) o[a] += to_grid[a][b] * origin[b], d[a] += to_grid[a][b] * (double)dir[b];
            double t0 = -o[a] / d[a], t1 = (SIDE - 1 - o[a]) / d[a];
            enter = fmax(enter, fmin(t0, t1)), leave = fmin(leave, fmax(t0, t1));
        }
        for (double at = enter, to; at < leave - 1e-9; at = to) { /* from face to face */
            int c[3];
            to = leave;
            for (int a = 0; a < 3; a++) {
                double x = o[a] + (at + 1e-9) * d[a];
                c[a] = (int)fmin(fmax(floor(x), 0), SIDE - 2);
                to = fmin(to, (c[a] + (d[a] > 0) - o[a]) / d[a]);
            }
            to = fmax(to, at + 1e-8);
            for (int k = 0; k <= 2 * PARTS; k++) {
                double u[3], g[3] = {0, 0, 0}, square = 0, weight = (k == 0 || k == 2 * PARTS ? 1 : k % 2 ? 4 : 2) / (6.0 * PARTS);
                for (int a = 0; a < 3; a++) u[a] = o[a] + (at + (to - at) * k / (2 * PARTS)) * d[a] - c[a];
                for (int corner = 0; corner < 8; corner++)
                    for (int a = 0; a < 3; a++) {
                        double w = corner >> a & 1 ? 1 : -1;
                        for (int b = 1; b < 3; b++) w *= corner >> (a + b) % 3 & 1 ? u[(a + b) % 3] : 1 - u[(a + b) % 3];
                        g[a] += w * *field_at(&f, c[0] + (corner & 1), c[1] + (corner >> 1 & 1), c[2] + (corner >> 2));
                    }
                for (int b = 0; b < 3; b++) square += pow(g[0] * to_grid[0][b] + g[1] * to_grid[1][b] + g[2] * to_grid[2][b], 2);
                whole += weight * (to - at) * sqrt(square);
            }
        }
        const isogi_transfer_point medium = {0, {1, 1, 1}, (float)tau};
        const isogi_transfer everywhere = {&medium, 1, NULL, 0};
        const double expected = -expm1(-tau * whole);
        for (int kind = ISOGI_DVR_SILHOUETTE_EXACT; kind <= ISOGI_DVR_SILHOUETTE_GRADIENT; kind += 2)
            for (int c = 0; c < 3; c += 2) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .step = 0.01,
                                             .silhouette = (isogi_dvr_silhouette)kind, .classification = (isogi_dvr_classification)c};
                isogi_dvr *dvr = dvr_new(&desc, &everywhere);
                double error = fabs((double)cast(dvr, eye, target, NULL).c[3] - expected);
                sum[c / 2] += error * error / (2 * count);
                CHECK(error < (c ? 5e-3 : 0.02), "volume %d, kind %d, classification %d: opacity off by %g of %g", n, kind, c, error,
                      expected);
                isogi_dvr_free(dvr);
            }
        field_free(&f);
    }
    /* two places of Gauss for each monotone piece; one makes fifteen times as much */
    printf("    RMSE of opacity: exact %.2g, post-classified in steps of 0.01 %.2g\n", sqrt(sum[0]), sqrt(sum[1]));
    CHECK(sum[0] < 2e-3 * 2e-3 && sum[1] < 1e-3 * 1e-3, "RMSE %g, post-classified %g", sqrt(sum[0]), sqrt(sum[1]));
}

/* The ray runs within the surface, or within a layer of constant value: the limits of eq. 15 and 17. */
TEST(surfaces_seen_edge_on_have_the_limit) {
    tilt[0] = 0, tilt[1] = 1, tilt[2] = 0;
    field f = field_of(tilted, 12);
    const double eye[3] = {-20, 5.25, 5.4}, target[3] = {5, 5.25, 5.4};
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.7f};
    const isogi_transfer everywhere = {&medium, 1, NULL, 0};
    for (int kind = 0; kind < 4; kind++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .silhouette = (isogi_dvr_silhouette)kind};
        isogi_dvr *dvr = dvr_new(&desc, &everywhere);
        pixel p = cast(dvr, eye, target, NULL);
        double expected = kind == 1 || kind == 3 ? -expm1(-(double)0.7f) : 0;
        CHECK(fabs((double)p.c[3] - expected) < 1e-6, "kind %d: opacity %g, not %g", kind, (double)p.c[3], expected);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- light from both sides (Kraus 2005, 5.2) ---- */

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Eq. 19 as it is printed, for unit vectors and any orientation of n. */
static void printed_equation(const double l[3], const double v[3], const double n[3], double a, const double cd[3], const isogi_material *m,
                             double out[3]) {
    double ln = dot(l, n), vn = dot(v, n), r[3], rv = 0, lv = 0;
    for (int i = 0; i < 3; i++) r[i] = 2 * n[i] * ln - l[i], rv += r[i] * v[i], lv -= l[i] * v[i];
    for (int i = 0; i < 3; i++) {
        double front = cd[i] * (double)m[0].diffuse[i], through = cd[i] * (double)m[2].diffuse[i], gloss = cd[i] * (double)m[2].specular[i];
        if (ln * vn > 0) out[i] += a * front * fabs(ln) + a * (double)m[0].specular[i] * pow(fmax(0, rv), (double)m[0].exponent);
        if (ln * vn < 0) out[i] += a * (1 - a) * through * fabs(ln) + a * (1 - a) * gloss * pow(fmax(0, lv), (double)m[2].exponent);
    }
}

TEST(two_sided_light_is_that_of_the_equation) {
    test_random r = {42};
    const isogi_material front = {{0.9f, 0.8f, 0.7f}, {1, 1, 0.5f}, 20}, back = {{0.2f, 0.8f, 0.3f}, {0.5f, 0.25f, 0}, 5},
                         through = {{0.5f, 1, 1}, {1, 0.5f, 1}, 8};
    for (int n = 0; n < 120; n++) {
        random_direction(&r, tilt);
        field f = field_of(tilted, 12);
        double eye[3], target[3], v[3], normal[3], expected[3] = {0, 0, 0}, a0 = random_range(&r, 0.1, 0.95), middle = 0;
        isogi_light lights[5];
        for (int a = 0; a < 3; a++)
            target[a] = random_range(&r, 4, 7), target[a] = (double)(float)target[a], middle += tilt[a] * target[a] / 11;
        random_direction(&r, v);
        for (int a = 0; a < 3; a++) eye[a] = (double)(float)(target[a] + 40 * v[a]);
        isogi_view view = line_of_sight(eye, target);
        float dir[3];
        double origin[3];
        isogi_view_ray(&view, 0, 0, origin, dir);
        for (int a = 0; a < 3; a++) v[a] = -(double)dir[a], normal[a] = n % 2 ? tilt[a] : -tilt[a];
        const isogi_peak peak = {middle, {0.9f, 0.6f, 0.3f}, (float)a0};
        const double cd[3] = {(double)0.9f, (double)0.6f, (double)0.3f};
        const isogi_transfer transfer = {NULL, 0, &peak, 1};
        /* values rise along the ray where the eye is on the low side */
        int low = dot(v, tilt) < 0;
        const isogi_material seen[3] = {low ? front : back, low ? back : front, through};
        for (int i = 0; i < 5; i++) {
            double l[3], scale = 1, reach = 0;
            random_direction(&r, l);
            lights[i] = (isogi_light){.kind = i < 3 ? ISOGI_LIGHT_DIRECTIONAL : ISOGI_LIGHT_POINT,
                                      .rgb = {(float)(1 + i), 1, (float)(2 - 0.3 * i)}};
            for (int a = 0; a < 3; a++) lights[i].vector[a] = (float)(i < 3 ? l[a] : target[a] + 9 * l[a]);
            for (int a = 0; a < 3; a++) l[a] = (double)lights[i].vector[a] - (i < 3 ? 0 : target[a]), reach += l[a] * l[a];
            if (i >= 3) scale = 1 / reach;
            for (int a = 0; a < 3; a++) l[a] /= sqrt(reach);
            double one[3] = {0, 0, 0};
            printed_equation(l, v, normal, (double)(float)a0, cd, seen, one);
            for (int a = 0; a < 3; a++) expected[a] += one[a] * (double)lights[i].rgb[a] * scale / PI;
        }
        const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
        for (int a = 0; a < 3; a++) expected[a] += (double)(float)a0 * cd[a] * (double)seen[0].diffuse[a];
        const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = lights, .light_count = 5};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)(n / 2 % 2), .shading = ISOGI_DVR_TWO_SIDED,
            .opaque = 1,
                                     .material = {front, back, through}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel p = cast(dvr, eye, target, &lighting);
        for (int a = 0; a < 3; a++)
            CHECK(fabs((double)p.c[a] - expected[a]) < 2e-5, "case %d channel %d: %.9g, not %.9g", n, a, (double)p.c[a], expected[a]);
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* The same for a medium: of a constant extinction in f = x all pieces of a ray have one opacity a, so that light that returns is multiplied
   by the opacity A of them all, and light that passes by A (1 - a): pieces of a cell each in exact rays, of a step each in sampled ones. */
TEST(two_sided_light_of_a_medium_is_that_of_its_pieces) {
    test_random r = {45};
    const isogi_material front = {{0.9f, 0.8f, 0.7f}, {1, 1, 0.5f}, 20}, back = {{0.2f, 0.8f, 0.3f}, {0.5f, 0.25f, 0}, 5},
                         through = {{0.5f, 1, 1}, {1, 0.5f, 1}, 8};
    const double ends[2][3] = {{-20, 5.2, 5.4}, {31, 5.2, 5.4}};
    tilt[0] = 1, tilt[1] = tilt[2] = 0;
    field f = field_of(tilted, 12);
    for (int n = 0; n < 180; n++) {
        const int way = n % 3, rising = n / 3 % 2;
        const isogi_transfer_point medium = {0, {0.9f, 0.6f, 0.3f}, (float)random_range(&r, 0.5, 20)};
        const isogi_transfer transfer = {&medium, 1, NULL, 0};
        const double cd[3] = {(double)0.9f, (double)0.6f, (double)0.3f}, v[3] = {rising ? -1 : 1, 0, 0}, normal[3] = {1, 0, 0};
        const double whole = -expm1(-(double)medium.extinction), piece = -expm1(-(double)medium.extinction / (way ? 22 : 11));
        const isogi_material seen[3] = {rising ? front : back, rising ? back : front, through};
        double l[3], expected[3] = {0, 0, 0};
        random_direction(&r, l);
        const isogi_light light = {.vector = {(float)l[0], (float)l[1], (float)l[2]}, .rgb = {3, 3, 3}};
        const isogi_lighting lighting = {.lights = &light, .light_count = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .shading = ISOGI_DVR_TWO_SIDED, .opaque = 1,
                                     .classification = (isogi_dvr_classification)way, .material = {front, back, through}, .step = 0.5,
                                     .table = 512};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel p = cast(dvr, ends[!rising], ends[rising], &lighting);
        printed_equation(l, v, normal, piece, cd, seen, expected);
        for (int a = 0; a < 3; a++) {
            expected[a] *= whole / piece * 3 / PI;
            CHECK(fabs((double)p.c[a] - expected[a]) < 2e-5, "case %d, way %d, channel %d: %.7g, not %.7g", n, way, a, (double)p.c[a],
                  expected[a]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST(light_that_grazes_neither_returns_nor_passes) {
    tilt[0] = 1, tilt[1] = 0, tilt[2] = 0;
    field f = field_of(tilted, 6);
    const isogi_peak peak = {0.5, {1, 1, 1}, 0.5f};
    const isogi_transfer_point medium = {0, {1, 1, 1}, 1};
    const isogi_transfer surface = {NULL, 0, &peak, 1}, fog = {&medium, 1, NULL, 0};
    const isogi_light light = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {0, 1, 0}, .rgb = {100, 100, 100}};
    const isogi_lighting lighting = {.lights = &light, .light_count = 1};
    const double eye[3] = {-20, 2.5, 2.5}, target[3] = {5, 2.5, 2.5};
    isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .shading = ISOGI_DVR_TWO_SIDED,
        .material = {{.exponent = 0}, {.exponent = 0}, {.exponent = 0}}};
    isogi_dvr *dvr = dvr_new(&desc, &surface);
    pixel p = cast(dvr, eye, target, &lighting);
    CHECK(fabsf(p.c[3] - 0.5f) < 1e-7f && p.c[0] < 1e-6f, "H(0) = 0: %g", (double)p.c[0]);
    isogi_dvr_free(dvr);
    /* no normal at all, in a constant field: only ambient light, and there is none */
    field flat = field_new(6, 6, 6);
    field_build(&flat);
    desc.pyramid = flat.pyramid, desc.space = ISOGI_DVR_PHYSICAL;
    dvr = dvr_new(&desc, &fog);
    p = cast(dvr, eye, target, &lighting);
    CHECK(p.c[3] > 0.5f && p.c[0] <= 0, "no normal: %g", (double)p.c[0]);
    isogi_dvr_free(dvr);
    field_free(&flat), field_free(&f);
}

/* Local shading where there is no gradient: light from all sides, a quarter of irradiance / pi; and within a lamp the light is that at
   its surface. */
TEST(local_light_without_a_gradient_and_within_a_lamp) {
    field flat = field_new(6, 6, 6);
    field_build(&flat);
    const isogi_transfer_point medium = {0, {0.8f, 0.6f, 0.4f}, 1};
    const isogi_transfer fog = {&medium, 1, NULL, 0};
    const double eye[3] = {-20, 2.5, 2.5}, target[3] = {5, 2.5, 2.5};
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {0, 1, 0}, .rgb = {3, 3, 3}};
    const isogi_light lamp = {.kind = ISOGI_LIGHT_SPHERE, .vector = {2.5f, 2.5f, 2.5f}, .rgb = {50, 50, 50}, .radius = 20};
    for (int i = 0; i < 2; i++) {
        const isogi_lighting lighting = {.lights = i ? &lamp : &sun, .light_count = 1};
        const isogi_dvr_desc desc = {.pyramid = flat.pyramid, .shading = ISOGI_DVR_LOCAL, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &fog);
        pixel p = cast(dvr, eye, target, &lighting);
        double irradiance = i ? 50 / (20.0 * 20) : 3;
        for (int a = 0; a < 3; a++) {
            double expected = (double)p.c[3] * (double)medium.rgb[a] * irradiance * 0.25 / PI;
            CHECK(fabs((double)p.c[a] / expected - 1) < 1e-5, "light %d channel %d: %g, not %g", i, a, (double)p.c[a], expected);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&flat);
}

/* A rectangle shines from its centre, by the cosine to its normal, to one side alone: a peak ten voxels away, which faces it. */
TEST(rectangles_shine_to_one_side) {
    tilt[0] = 1, tilt[1] = 0, tilt[2] = 0;
    field f = field_of(tilted, 6);
    const isogi_peak peak = {0.5, {0.8f, 0.6f, 0.4f}, 0.5f};
    const isogi_transfer surface = {NULL, 0, &peak, 1};
    const double eye[3] = {-20, 2.5, 2.5}, target[3] = {5, 2.5, 2.5};
    for (int n = 0; n < 2 * 4; n++) {
        const double angle = n / 2 * PI / 3, s = sin(angle), c = cos(angle);
        const isogi_light lamp = {.kind = ISOGI_LIGHT_RECTANGLE, .vector = {-7.5f, 2.5f, 2.5f}, .rgb = {300, 300, 300},
                                  .edge = {{(float)-s, (float)c, 0}, {0, 0, 1}}}; /* shines along c, s, 0 */
        const isogi_lighting lighting = {.lights = &lamp, .light_count = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = n % 2 ? ISOGI_DVR_TWO_SIDED : ISOGI_DVR_LOCAL};
        isogi_dvr *dvr = dvr_new(&desc, &surface);
        pixel p = cast(dvr, eye, target, &lighting);
        for (int a = 0; a < 3; a++) {
            double expected = 0.5 * (double)peak.rgb[a] * 3 * fmax(c, 0) / PI;
            CHECK(fabs((double)p.c[a] - expected) < 1e-5, "turned by %g, channel %d: %g, not %g", angle, a, (double)p.c[a], expected);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- a second field ---- */

TEST(a_second_field_colours_peaks) {
    tilt[0] = 1, tilt[1] = tilt[2] = 0;
    field f = field_of(tilted, 8);
    tilt[0] = 0, tilt[1] = 1;
    field second = field_of(tilted, 5); /* another lattice over the same box: y / 4 in its own units, y / 7 in the world */
    isogi_vol_free(second.pyramid);
    for (int a = 0; a < 3; a++) second.volume.spacing[a] = 7 / 4.0;
    field_build(&second);
    const isogi_transfer_point colours[] = {{0, {0, 1, 0.5f}, 0}, {1, {1, 0, 0.5f}, 0}};
    const isogi_peak peak = {0.4, {1, 0.5f, 1}, 0.6f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    for (int c = 0; c < 3; c++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .classification = (isogi_dvr_classification)c,
            .second = second.pyramid,
                                     .second_points = colours, .second_count = 2};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        for (int i = 0; i < 8; i++) {
            double y = 0.5 + 0.8 * i, u = y / 7, expected[3] = {0.6 * u, 0.6 * 0.5 * (1 - u), 0.6 * 0.5};
            const double eye[3] = {-20, y, 3.3}, target[3] = {5, y, 3.3};
            pixel p = cast(dvr, eye, target, NULL);
            for (int a = 0; a < 3; a++)
                CHECK(fabs((double)p.c[a] - expected[a]) < 1e-6, "y %g channel %d: %g, not %g", y, a, (double)p.c[a], expected[a]);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f), field_free(&second);
}

/* Beyond its box the second field is what it is at its border, on both sides. */
TEST(beyond_its_box_the_second_field_is_as_at_its_border) {
    tilt[0] = 1, tilt[1] = tilt[2] = 0;
    field f = field_of(tilted, 17), second = field_new(6, 6, 6);
    for (size_t i = 0; i < field_count(&second); i++) second.value[i] = (double)(i / 6 % 6); /* y - 5 */
    for (int a = 0; a < 3; a++) second.volume.origin[a] = 5;
    field_build(&second);
    const isogi_transfer_point colours[] = {{-20, {0, 1, 0.5f}, 0}, {20, {1, 0, 0.5f}, 0}};
    const isogi_peak peak = {0.4, {1, 0.5f, 1}, 0.6f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    const isogi_dvr_desc desc = {
        .pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .second = second.pyramid, .second_points = colours, .second_count = 2};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    for (int i = 0; i < 16; i++) {
        const double y = 0.4 + i, u = (fmin(fmax(y - 5, 0), 5) + 20) / 40, expected[3] = {0.6 * u, 0.6 * 0.5 * (1 - u), 0.6 * 0.5};
        const double eye[3] = {-20, y, 15.5}, target[3] = {5, y, 15.5}; /* beyond it along z, too */
        const pixel p = cast(dvr, eye, target, NULL);
        for (int a = 0; a < 3; a++)
            CHECK(fabs((double)p.c[a] - expected[a]) < 1e-6, "y %g channel %d: %g, not %g", y, a, (double)p.c[a], expected[a]);
    }
    isogi_dvr_free(dvr), field_free(&f), field_free(&second);
}

static double known_above_three(void *user, const double point[3], double gradient[3]) {
    (void)user, gradient[0] = gradient[1] = gradient[2] = 0;
    return point[1] > 3 ? 1 : (double)NAN;
}

/* Where the second field has no value, be it given by voxels or by a function, peaks have their own colour. */
TEST(peaks_keep_their_colour_where_the_second_field_is_unknown) {
    tilt[0] = 1, tilt[1] = tilt[2] = 0;
    field f = field_of(tilted, 8), second = field_new(8, 8, 8);
    const isogi_field function = {.value = known_above_three, .hessian = 1, .high = {7, 7, 7}, .cells = {8, 8, 8}};
    isogi_pyramid *other = NULL;
    for (size_t i = 0; i < field_count(&second); i++) second.value[i] = i / 8 % 8 > 3 ? 1 : (double)NAN;
    field_build(&second);
    CHECK(isogi_vol_build_field(&other, &function, &serial) == ISOGI_OK, "build");
    const isogi_transfer_point colours[] = {{0, {0, 0.25f, 0}, 0}, {1, {0.5f, 0, 0.25f}, 0}};
    const isogi_peak peak = {0.4, {1, 0.5f, 0.8f}, 0.6f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    for (int c = 0; c < 6; c++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .classification = (isogi_dvr_classification)(c / 2),
                                     .second = c % 2 ? other : second.pyramid, .second_points = colours, .second_count = 2};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        for (int known = 0; known < 2; known++) {
            const double eye[3] = {-20, known ? 5.5 : 2.25, 3.3}, target[3] = {5, eye[1], 3.3};
            const pixel p = cast(dvr, eye, target, NULL);
            for (int a = 0; a < 3; a++) {
                const double expected = 0.6 * (double)peak.rgb[a] * (known ? (double)colours[1].rgb[a] : 1);
                CHECK(fabs((double)p.c[a] - expected) < 1e-6, "case %d, known %d, channel %d: %g, not %g", c, known, a, (double)p.c[a],
                      expected);
            }
        }
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(other), field_free(&f), field_free(&second);
}

/* Rays of visibility that only touch a peak, in the plane of voxels where values turn, meet it once: half of the light is lost where
   half of it would be by one crossing. */
TEST(visibility_meets_a_peak_that_is_touched_once) {
    field f = field_new(9, 7, 7);
    float v[3][1][3];
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 4 - fabs((double)(i % 9) - 4);
    field_build(&f);
    for (int k = 0; k < 3; k++) {
        const isogi_peak peak = {4, {1, 1, 1}, 0.5f * (float)k};
        const isogi_transfer transfer = {NULL, 0, &peak, 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .shading = ISOGI_DVR_VISIBILITY, .order = 1,
                                     .directions = 64, .grid = {2, 2, 2}};
        const float at[1][3] = {{0, 6, 0}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, at, 1, v[k][0]) == ISOGI_OK, "step");
        isogi_dvr_free(dvr);
    }
    CHECK(v[2][0][0] < v[0][0][0] - 0.1f && fabsf(v[1][0][0] - 0.5f * (v[0][0][0] + v[2][0][0])) < 1e-4f,
          "visibility %g without the peak, %g through half of it, %g with it", (double)v[0][0][0], (double)v[1][0][0], (double)v[2][0][0]);
    field_free(&f);
}

/* In the middle of a sheet one voxel thick there is no normal: a peak there is seen straight on, whatever the silhouettes. */
TEST(a_peak_without_a_normal_is_seen_straight_on) {
    const isogi_peak peak = {1, {1, 1, 1}, 0.3f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    field f = field_new(9, 9, 9);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = i % 9 == 4;
    field_build(&f);
    for (int n = 0; n < 8; n++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)(n / 4), .silhouette = (isogi_dvr_silhouette)(n % 4)};
        const double eye[3] = {-20, 3.2, 3.7}, target[3] = {8, 4.4, 4.1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const pixel p = cast(dvr, eye, target, NULL);
        CHECK(fabs((double)p.c[3] - 0.3) < 1e-6, "space %d, silhouettes %d: opacity %g", n / 4, n % 4, (double)p.c[3]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- robustness ---- */

/* Cells with a corner that is not finite are transparent, and the ray begins anew behind them: what it missed is no crossing. */
TEST(cells_that_are_not_finite_break_the_ray) {
    const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.9f};
    const isogi_peak peak = {0.5, {1, 1, 1}, 0.5f};
    for (int b = 0; b < 3; b++)
        for (int c = 0; c < 3; c++)
            for (int kind = 0; kind < 2; kind++) {
                field f = field_new(11, 4, 4);
                for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(i % 11) / 10;
                f.value[5 + 11 * (1 + 4 * 1)] = bad[b]; /* cells x 4..6 of the middle lines */
                field_build(&f);
                const isogi_transfer transfer = {&medium, kind ? 0 : 1, &peak, kind ? 1 : 0};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1,
                    .classification = (isogi_dvr_classification)c, .step = 0.25};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                const double eye[3] = {-5, 1.5, 1.5}, target[3] = {5, 1.5, 1.5};
                pixel p = cast(dvr, eye, target, NULL);
                double expected = kind ? 0 : -expm1(-(double)0.9f * 0.8); /* 0..0.4 and 0.6..1; the peak is in the gap */
                CHECK(fabs((double)p.c[3] - expected) < (c == 1 ? 0.025 : 1e-6), "value %g classification %d: opacity %g, not %g", bad[b],
                      c, (double)p.c[3], expected);
                isogi_dvr_free(dvr);
                field_free(&f);
            }
}

/* Planes of voxels without values part a volume: its picture is that of what is before them, over that of what is behind. On both sides of
   the plane lie blocks in which nothing counts, of values apart: between those there is no passage. */
TEST(walls_without_values_part_the_ray) {
    enum { LONG = 24, WIDE = 9, PIXELS = 12 * 9 };
    static const isogi_transfer_point points[] = {{0.2, {1, 0.5f, 0.2f}, 0},   {0.2, {1, 1, 0.3f}, 0.05f},  {0.4, {0.2f, 1, 1}, 0.05f},
                                                  {0.4, {1, 0.1f, 1}, 5},      {0.6, {1, 0.3f, 0.7f}, 5},   {0.6, {0.3f, 0.2f, 1}, 0.05f},
                                                  {0.8, {1, 0.6f, 0.1f}, 0.05f}, {0.8, {1, 1, 1}, 0}};
    static const isogi_peak peak = {0.5, {1, 0.4f, 0.2f}, 0.7f};
    static const int walls[] = {8, 10, 12, 13}; /* between blocks, and within one */
    static float image[3][PIXELS][4], depth[PIXELS];
    double most = 0, least = 1;
    for (int n = 0; n < 4 * 3 * 2; n += LONG_SUITE ? 1 : QUICK_SUITE ? 9 : 5) {
        const int wall = walls[n % 4], axis = n / 4 % 3, back = n / 12;
        size_t size[3] = {WIDE, WIDE, WIDE};
        float *value[3];
        isogi_pyramid *pyramid[3][2];
        size[axis] = LONG;
        for (int part = 0; part < 3; part++) {
            isogi_volume volume = {.type = ISOGI_F32, .size = {size[0], size[1], size[2]}};
            volume.data = value[part] = (float *)malloc(sizeof(float) * size[0] * size[1] * size[2]);
            for (size_t i = 0; i < size[0] * size[1] * size[2]; i++) {
                size_t at[3] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1]};
                int from = (int)at[axis] - wall, out = abs(from) - 5;
                double away = (out > 0 ? 0.05 * out : 0) + 0.004 * (double)(at[0] + at[1] + at[2] - at[axis]);
                value[part][i] = (float)(from < 0 ? 0.1 + away : 0.9 - away);
                if (from == 0 || (part == 1 && from > 0) || (part == 2 && from < 0)) value[part][i] = NAN; /* 1: before, 2: behind */
            }
            /* a voxel of no cell, so that tables are of the same values in all three */
            if (part == 1) value[part][size[0] * size[1] * size[2] - 1] = 0.9f;
            if (part == 2) value[part][0] = 0.1f;
            for (int plain = 0; plain < 2; plain++) {
                const isogi_context context = {.threads = 1, .force_path = plain};
                CHECK(isogi_vol_build(&pyramid[part][plain], &volume, &context) == ISOGI_OK, "build");
            }
        }
        for (int way = 0; way < 2 * 2 * 3 * 2 * 2 * 2; way++) {
            const int plain = way & 1, space = way >> 1 & 1, lit = way >> 2 & 1, with_peak = way >> 3 & 1, bound = way >> 4 & 1;
            const int classification = way >> 5;
            const isogi_context context = {.threads = 1, .force_path = plain};
            const isogi_transfer transfer = {points, 8, &peak, (size_t)with_peak};
            const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
            isogi_view view = {.width = 12, .height = 9, .fov = 5};
            if (bound && (space == ISOGI_DVR_DATA || classification)) continue;
            for (int a = 0; a < 3; a++) view.eye[a] = 1.3f + (float)a, view.target[a] = 4.4f, view.up[a] = a == (axis + 1) % 3;
            view.eye[axis] = back ? 60 : -40, view.target[axis] = 10;
            for (int part = 0; part < 3; part++) {
                const isogi_dvr_desc desc = {.pyramid = pyramid[part][plain], .space = (isogi_dvr_space)space, .opaque = 1,
                                             .classification = (isogi_dvr_classification)classification, .bound = bound ? 0.01 : 0,
                                             .shading = lit ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT, .grid = {2, 2, 2}, .step = 0.7,
                                             .table = 32, .tolerance = 1e6}; /* steps do not depend on what is before */
                isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context); /* no step is done: nothing casts a shadow */
                CHECK(isogi_dvr_render(dvr, &view, &sky, image[part], depth, NULL) == ISOGI_OK, "render");
                isogi_dvr_free(dvr);
            }
            for (int i = 0; i < PIXELS; i++) {
                const float *first = image[back ? 2 : 1][i], *second = image[back ? 1 : 2][i];
                for (int a = 0; a < 4; a++) {
                    double whole = (double)first[a] + (1 - (double)first[3]) * (double)second[a];
                    most = fmax(most, fabs((double)image[0][i][a] - whole));
                }
                least = fmin(least, (double)image[0][i][3]);
            }
            CHECK(most < 2e-6, "wall %d, axis %d, %s, way %d: pixels differ by %g", wall, axis, back ? "from behind" : "from before", way,
                  most);
        }
        for (int part = 0; part < 3; part++) isogi_vol_free(pyramid[part][0]), isogi_vol_free(pyramid[part][1]), free(value[part]);
    }
    printf("    largest difference %.2g; opacity at least %.2g\n", most, least);
    CHECK(least > 1e-3, "a pixel has no opacity");
}

/* Unlit pictures without peaks follow several rays at once where the machine can: they agree with those of plain code, and see as much. */
TEST(rays_side_by_side_agree_with_plain_code) {
    enum { WIDTH = 33, HEIGHT = 21 };
    static float image[2][WIDTH * HEIGHT][4], depth[2][WIDTH * HEIGHT];
    static const size_t sizes[3][3] = {{70, 19, 34}, {9, 66, 5}, {2, 3, 2}};
    /* within; along an axis; along lattice lines */
    static const float eyes[4][3] = {{80, 50, 90}, {20.3f, 7.1f, 3.2f}, {-30, 2, 2}, {4, 4, 60}};
    test_random r = {77};
    static const float opaque[] = {1, 0.5f, 0, 0.9f}; /* never; 0: the default */
    double most = 0, farthest = 0;
    int ended = 0, together = 0, later = 0;
    for (int n = 0; n < (LONG_SUITE ? 3 * 3 * 4 * 8 : 3 * 3 * 4); n++) {
        const size_t *size = sizes[n % 3], count = size[0] * size[1] * size[2];
        const isogi_type type = n / 3 % 3 == 0 ? ISOGI_F32 : n / 3 % 3 == 1 ? ISOGI_U8 : ISOGI_U16;
        const float *eye = eyes[n / 9 % 4];
        const double plane[4] = {0.3, -0.2, 1, -0.4 * (double)size[2]};
        const size_t bytes = type == ISOGI_F32 ? 4 : type == ISOGI_U8 ? 1 : 2;
        char *data = (char *)malloc(count * bytes); /* to the byte: a vector that reads beyond is seen by the sanitizer */
        for (size_t i = 0; i < count; i++) {
            size_t x = i % size[0], y = i / size[0] % size[1], z = i / size[0] / size[1];
            double value = 0.5 + 0.45 * sin(0.21 * (double)x) * cos(0.17 * (double)y + 0.1) * cos(0.3 * (double)z) + 0.04 * random_unit(&r);
            float narrow = x / 24 == 1 ? 0.11f : (float)value; /* blocks in which nothing changes */
            if (random_unit(&r) < (n % 2 ? 0.003 : 0)) narrow = n % 4 > 1 ? HUGE_VALF : -HUGE_VALF;
            if (n % 4 == 1 && x / 16 == 3) narrow = (float)NAN; /* whole blocks */
            if (type == ISOGI_F32) memcpy(data + 4 * i, &narrow, 4);
            else if (type == ISOGI_U8) data[i] = (char)(uint8_t)(255 * value);
            else memcpy(data + 2 * i, &(uint16_t){(uint16_t)(65535 * value)}, 2);
        }
        const isogi_volume volume = {.data = data, .type = type, .size = {size[0], size[1], size[2]}, .spacing = {1, 1.25, 0.75},
                                     .scale = type == ISOGI_F32 ? 1 : type == ISOGI_U8 ? 1 / 255.0 : 1 / 65535.0};
        isogi_transfer_point points[12];
        random_transfer(&r, points, 12, n % 5 == 4 ? 40 : 4);
        for (int i = 0; i < 12; i++) points[i].value = 0.5 + 0.6 * points[i].value;
        if (n % 3) for (int i = 0; i < 5; i++) points[i].extinction = 0; /* quiet below */
        isogi_transfer_point comb[4 * 7]; /* more quiet ranges than are compared one by one */
        const int teeth = 7;
        for (int i = 0; i < 4 * teeth; i++) {
            comb[i] = points[i / 4 % 12], comb[i].value = (i / 4 + 0.1 * (i % 4)) / teeth;
            comb[i].extinction = i % 4 == 1 || i % 4 == 2 ? 2 * (float)teeth * (1 + (float)(i / 4 % 3)) : 0;
        }
        const int combed = n % 6 == 4;
        const isogi_transfer transfer = {.points = combed ? comb : points, .point_count = combed ? (size_t)(4 * teeth) : 12};
        const isogi_view view = {
            .width = WIDTH,
            .height = HEIGHT,
            .eye = {eye[0], eye[1], eye[2]},
            .target = {n / 9 % 4 == 3 ? 4.f : 0.4f * (float)size[0], n / 9 % 4 > 1 ? eye[1] : 0.6f * (float)size[1], 2}};
        isogi_counters last = {0}, never = {0};
        for (int way = 0; way < 2 * 4; way++) {
            const int path = way & 1;
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_dvr_desc own = {.pyramid = NULL, .space = ISOGI_DVR_DATA, .opaque = opaque[way / 2]};
            isogi_pyramid *pyramid = NULL;
            isogi_dvr *dvr = NULL;
            isogi_counters work = {0};
            CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
            own.pyramid = pyramid;
            CHECK(isogi_dvr_create(&dvr, &own, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
            if (n % 7 > 4) CHECK(isogi_dvr_set_clip(dvr, &plane, 1) == ISOGI_OK, "clip");
            CHECK(isogi_dvr_render(dvr, &view, NULL, image[path], depth[path], &work) == ISOGI_OK, "render");
            isogi_dvr_free(dvr), isogi_vol_free(pyramid);
            if (!path) {
                last = work;
                continue;
            }
            /* several at once look for an empty block at every cell, one ray only where it comes to another block */
            together += last.blocks > work.blocks;
            ended += way == 3 && work.cells < never.cells;
            if (way == 1) never = work;
            CHECK(last.cells + last.cells / 50 + 20 >= work.cells && work.cells + work.cells / (combed ? 8 : 50) + 20 >= last.cells,
                  "case %d.%d: %g cells, not %g", n, way / 2, (double)last.cells, (double)work.cells);
            for (int i = 0; i < WIDTH * HEIGHT; i++) {
                /* float pixels; a ray along faces may take the cells on either side, whose values agree to a rounding */
                double apart = 0;
                for (int a = 0; a < 4; a++) apart = fmax(apart, fabs((double)image[0][i][a] - (double)image[1][i][a]));
                if (combed && own.opaque < 1 && apart > 1e-6) { /* plain code at a quiet cell, several at once where the value turns */
                    float end = own.opaque > 0 ? own.opaque : 0.999f;
                    later++;
                    CHECK(image[0][i][3] >= image[1][i][3] - 1e-6f && image[1][i][3] >= end - 1e-6f && apart < 1.000001 - (double)end,
                          "case %d, opaque %g: opacities %g and %g, %g apart", n, (double)end, (double)image[0][i][3],
                          (double)image[1][i][3], apart);
                    continue;
                }
                most = fmax(most, apart);
                if (depth[0][i] < 1e30f && depth[1][i] < 1e30f && image[0][i][3] > 1e-3f)
                    farthest = fmax(farthest, fabs((double)depth[0][i] - (double)depth[1][i]));
            }
            CHECK(most < 1e-6 && farthest < 1e-3, "case %d, opaque %g: pixels differ by %g, depths by %g", n, (double)own.opaque, most,
                  farthest);
        }
        free(data);
    }
    printf("    largest difference of pixels %.2g, of depth %.2g; %d pictures of several rays at once, %d rays that end later\n", most,
           farthest, together, later);
    CHECK(ended, "no ray ends at its opacity");
#if defined(__x86_64__) && (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 9)) && !defined(__TINYC__) && \
    !defined(ISOGI_NO_SIMD) && !defined(_WIN32)
    if (__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        CHECK(together, "no rays went side by side");
#endif
}

/* A value that is not near the ray, however large, changes nothing along it. */
TEST(an_outlier_far_from_the_ray_changes_no_pixel) {
    static const isogi_transfer_point points[] = {
        {0, {1, .5f, .2f}, .3f}, {.5, {.1f, .9f, .4f}, 2}, {1, {1, 1, 1}, .1f}, {1e30, {0, 0, 0}, 0}};
    static float data[6][6][24], image[2][9][4];
    const isogi_transfer transfer = {.points = points, .point_count = 4};
    for (int path = 0; path < 2; path++) {
        for (int outlier = 0; outlier < 2; outlier++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {24, 6, 6}};
            const isogi_view view = {.width = 3, .height = 3, .eye = {-60, 1.6f, 1.7f}, .target = {12, 1.5f, 1.4f}, .fov = 0.5f};
            isogi_pyramid *pyramid = NULL;
            isogi_dvr_desc desc = {.space = ISOGI_DVR_DATA, .opaque = 1};
            isogi_dvr *dvr;
            for (int i = 0; i < 24 * 36; i++) data[i / 144][i / 24 % 6][i % 24] = 0.5f + 0.4f * sinf(1.1f * (float)(i % 24));
            if (outlier) data[5][5][23] = 1e30f;
            CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
            desc.pyramid = pyramid, dvr = dvr_new_with(&desc, &transfer, &context);
            CHECK(isogi_dvr_render(dvr, &view, NULL, image[outlier], NULL, NULL) == ISOGI_OK, "render");
            isogi_dvr_free(dvr), isogi_vol_free(pyramid);
        }
        for (int i = 0; i < 9; i++) {
            CHECK(image[0][i][3] > 0.5f, "opacity %g", (double)image[0][i][3]);
            for (int a = 0; a < 4; a++)
                CHECK(fabs((double)image[0][i][a] - (double)image[1][i][a]) < 1e-6, "path %d, pixel %d: %g, not %g", path, i,
                      (double)image[1][i][a], (double)image[0][i][a]);
        }
    }
}

static int calls_left, blocks_out;
static void *failing_alloc(void *user, size_t size, size_t align) {
    (void)user, (void)align;
    if (calls_left-- == 0) return NULL;
    blocks_out++;
    void *p = NULL;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void counting_release(void *user, void *p, size_t size) { (void)user, (void)size, blocks_out--, free(p); }

TEST(every_allocation_of_a_transfer_function_may_fail) {
    field f = field_waves(8, 2);
    const isogi_context context = {.alloc = failing_alloc, .release = counting_release, .threads = 1};
    for (int c = 0; c < 3; c++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .classification = (isogi_dvr_classification)c, .table = 16};
        isogi_dvr *dvr = NULL;
        calls_left = 1 << 30, blocks_out = 0;
        CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &landscape) == ISOGI_OK, "create");
        int before = blocks_out, failures = 0;
        for (int k = 0;; k++) {
            calls_left = k;
            isogi_result result = isogi_dvr_set_transfer(dvr, &landscape);
            CHECK(blocks_out == before, "%d blocks, not %d", blocks_out, before);
            if (result == ISOGI_OK) break;
            CHECK(result == ISOGI_NO_MEMORY, "%s", isogi_result_string(result));
            calls_left = 1 << 30, failures++;
            const double eye[3] = {-9, 3, 4}, target[3] = {4, 4, 4};
            CHECK(cast(dvr, eye, target, NULL).c[3] > 0, "the old function stays");
        }
        CHECK(failures >= (c == 2 ? 4 : 7), "%d allocations", failures);
        calls_left = 1 << 30;
        isogi_dvr_free(dvr);
        CHECK(blocks_out == 0, "%d blocks left", blocks_out);
    }
    field_free(&f);
}

TEST(a_renderer_without_a_context_takes_the_pyramids) {
    field f = field_new(6, 6, 6);
    const isogi_context context = {.alloc = failing_alloc, .release = counting_release, .threads = 1};
    isogi_dvr *dvr = NULL;
    calls_left = 1 << 30, blocks_out = 0;
    CHECK(isogi_vol_build(&f.pyramid, &f.volume, &context) == ISOGI_OK, "build");
    int before = blocks_out;
    const isogi_dvr_desc desc = {.pyramid = f.pyramid};
    CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && blocks_out > before, "%d blocks, %d before", blocks_out, before);
    isogi_dvr_free(dvr);
    CHECK(blocks_out == before, "%d blocks, not %d", blocks_out, before);
    field_free(&f);
}

TEST(odd_transfer_functions_are_defined) {
    field f = field_of(along_x, 7);
    const double eye[3] = {-9, 3, 4}, target[3] = {4, 3, 4};
    const struct { isogi_transfer_point points[5]; size_t count; double depth; } cases[] = {
        {{{0.5, {1, 1, 1}, 2}}, 1, 2},                                                                       /* one point: constant */
        {{{5, {1, 1, 1}, 2}}, 1, 2},                                                                         /* far above the data */
        {{{0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 1e6f}, {0.5, {1, 1, 1}, 0}}, 3, 0},                          /* a single value: no width */
        {{{0.25, {1, 1, 1}, 0}, {0.25, {1, 1, 1}, 3}, {0.75, {1, 1, 1}, 3}, {0.75, {1, 1, 1}, 0}}, 4, 1.5}, /* a box */
        {{{-1e300, {1, 1, 1}, 1}, {1e300, {1, 1, 1}, 1}}, 2, 1},                                             /* the widest that there is */
        {{{-1.7e308, {1, 1, 1}, 1}, {1.7e308, {1, 1, 1}, 1}}, 2, 1},
        {{{0.5, {1, 1, 1}, 4}, {0.5 + 1e-16, {1, 1, 1}, 4}}, 2, 4},
        {{{2, {1, 1, 1}, 0}, {3, {1, 1, 1}, 9}}, 2, 0},                                                      /* nothing within the data */
        {{{-3, {1, 1, 1}, 9}, {-2, {1, 1, 1}, 1}}, 2, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int c = 0; c < 2; c++) {
            const isogi_transfer transfer = {cases[i].points, cases[i].count, NULL, 0};
            const isogi_dvr_desc desc = {
                .pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .classification = (isogi_dvr_classification)c, .table = 1024};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            pixel p = cast(dvr, eye, target, NULL);
            CHECK(fabs((double)p.c[3] + expm1(-cases[i].depth)) < (c ? 2e-3 : 2e-7), "case %zu classification %d: opacity %.9g, not %.9g",
                  i, c, (double)p.c[3], -expm1(-cases[i].depth));
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* Extreme fields, extinctions and peaks: every pixel is a number, opacities are 0..1. */
TEST(extreme_values_give_numbers) {
    test_random r = {55};
    for (int n = 0; n < (LONG_SUITE ? 120 : 40); n++) {
        field f = field_new(4, 4, 4);
        double scale = pow(10, random_range(&r, -300, 300));
        isogi_transfer_point points[5];
        isogi_peak peaks[3];
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = scale * random_range(&r, -1, 1);
        field_build(&f);
        for (int i = 0; i < 5; i++)
            points[i] = (isogi_transfer_point){scale * (-1 + 0.5 * i), {1, 0.5f, 0}, i % 2 ? 0 : (float)pow(10, random_range(&r, -38, 38))};
        for (int i = 0; i < 3; i++) peaks[i] = (isogi_peak){scale * random_range(&r, -1, 1), {0, 1, 1}, (float)random_unit(&r)};
        const isogi_transfer transfer = {points, 5, peaks, 3};
        for (int c = 0; c < 3; c++)
            for (int s = 0; s < 4; s++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .silhouette = (isogi_dvr_silhouette)s,
                                             .classification = (isogi_dvr_classification)c, .table = 32};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                double eye[3], target[3];
                random_line(&f, &r, eye, target);
                pixel p = cast(dvr, eye, target, NULL);
                for (int a = 0; a < 4; a++)
                    CHECK(p.c[a] >= 0 && p.c[a] <= 1.00001f, "scale %g classification %d silhouette %d: channel %d %g", scale, c, s, a,
                          (double)p.c[a]);
                CHECK(p.depth > 0, "depth %g", (double)p.depth);
                isogi_dvr_free(dvr);
            }
        field_free(&f);
    }
}

TEST(pictures_are_the_same_bits_for_any_number_of_threads) {
    field f = field_waves(20, 8);
    test_random r = {3};
    isogi_view view = view_of(&f, 1, &r, 40);
    for (int c = 0; c < 2; c++) {
        float(*image[2])[4];
        for (int i = 0; i < 2; i++) {
            const isogi_context context = {.threads = i ? 3 : 1};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .classification = (isogi_dvr_classification)c,
                .silhouette = ISOGI_DVR_SILHOUETTE_EXACT};
            isogi_dvr *dvr = NULL;
            CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &landscape) == ISOGI_OK, "create");
            image[i] = picture(dvr, &view, NULL, NULL, NULL);
            isogi_dvr_free(dvr);
        }
        CHECK(!memcmp(image[0], image[1], 1600 * sizeof *image[0]), "classification %d: pixels differ by %g", c,
              largest_difference(image[0], image[1], 1600));
        free(image[0]), free(image[1]);
    }
    field_free(&f);
}

TEST(bad_descriptions_are_refused) {
    field f = field_waves(4, 1);
    isogi_dvr *dvr = NULL;
    const isogi_transfer_point wrong[] = {{1, {1, 1, 1}, 0}, {0, {1, 1, 1}, 0}};
    const isogi_dvr_desc good = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA};
    isogi_dvr_desc bad;
#define REFUSED(change)                                                                                                        \
    bad = good, bad.change;                                                                                                    \
    CHECK(isogi_dvr_create(&dvr, &bad, &serial) == ISOGI_INVALID && !dvr, #change);                                            \
    CHECK(fault_names(isogi_dvr_fault(&bad), #change), "%s: %s", #change, isogi_dvr_fault(&bad))
    REFUSED(classification = (isogi_dvr_classification)3);
    REFUSED(classification = (isogi_dvr_classification)-1);
    REFUSED(silhouette = (isogi_dvr_silhouette)4);
    REFUSED(normals = (isogi_normal_kind)2);
    REFUSED(table = 1);
    REFUSED(table = -1);
    REFUSED(table = 1025);
    REFUSED(material[0].exponent = NAN);
    REFUSED(material[1].exponent = -1);
    REFUSED(material[2].exponent = 2e6f);
    REFUSED(material[0].diffuse[1] = -1);
    REFUSED(material[2].specular[2] = INFINITY);
    REFUSED(second_count = 1);
    REFUSED(second_count = 2; bad.second_points = wrong);
    REFUSED(method = (isogi_dvr_method)9);
    REFUSED(sphere = (isogi_dvr_sphere)9);
    REFUSED(coarsest = 3);
    REFUSED(tolerance = (double)NAN);
    REFUSED(anisotropy = 1);
    REFUSED(emission = -1);
    REFUSED(bound = 1e-5);
    REFUSED(radius = 33);
    REFUSED(radius = 0.5);
    REFUSED(reduction = 0.5);
    REFUSED(visibility_step = 3e4);
    field_free(&f);
}

/* ---- the figures of Kraus 2005, as numbers; as pictures they come from examples/figures_scale_invariant.sh ---- */

typedef struct figure { const char *name, *shape; double isovalue, half; } figure;

/* Figures 1, 8a to 8d: rays that cross the surface exactly twice. With a peak all have one opacity, with a narrow tent in physical space
   opacity follows the gradient. Figures 1d, 5: with silhouettes opacity is never less. */
TEST(isosurfaces_are_uniform_where_standard_rendering_follows_the_gradient) {
    const figure figures[] = {
        {"1b, 1c", "coulomb", 0.72, 0.02}, {"8a, 8b", "marschner-lobb", 0.5, 0.03}, {"8c, 8d", "hydrogen", 0.06, 0.015}};
    for (int n = 0; n < 3; n++) {
        const procedural_shape *shape = procedural_find(figures[n].shape);
        isogi_volume volume = {.data = NULL};
        isogi_pyramid *pyramid = NULL;
        double sum[2] = {0, 0}, square[2] = {0, 0}, spread[2];
        int count = 0, enhanced = 0;
        CHECK(procedural_make(shape, 48, &volume, &serial) == ISOGI_OK && isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK,
              "volume");
        double v = figures[n].isovalue, h = figures[n].half;
        const isogi_peak peak = {v, {1, 1, 1}, 0.3f};
        const isogi_transfer_point tent[] = {{v - h, {1, 1, 1}, 0}, {v, {1, 1, 1}, 0.6f}, {v + h, {1, 1, 1}, 0}};
        const isogi_transfer surface = {NULL, 0, &peak, 1}, narrow = {tent, 3, NULL, 0};
        const isogi_dvr_desc data = {.pyramid = pyramid, .space = ISOGI_DVR_DATA, .opaque = 1},
                             physical = {.pyramid = pyramid, .step = 0.05, .opaque = 1};
        isogi_dvr_desc lines = data;
        lines.silhouette = ISOGI_DVR_SILHOUETTE_EXACT;
        isogi_dvr *dvr[3] = {dvr_new(&data, &surface), dvr_new(&physical, &narrow), dvr_new(&lines, &surface)};
        isogi_view view = {.width = 28, .height = 28, .fov = 40, .target = {23.5f, 23.5f, 23.5f}, .eye = {40, 35, 120}};
        float(*image[3])[4];
        for (int i = 0; i < 3; i++) image[i] = picture(dvr[i], &view, NULL, NULL, NULL);
        for (int i = 0; i < 28 * 28; i++) {
            double origin[3];
            float dir[3];
            crossing at[64];
            isogi_view_ray(&view, i % 28, i / 28, origin, dir);
            int crossings = intersector_crossings(pyramid, origin, dir, v, at);
            CHECK(fabs((double)image[0][i][3] - (1 - pow((double)(1 - 0.3f), crossings))) < 1e-6, "figure %s: %d crossings, opacity %g",
                  figures[n].name, crossings, (double)image[0][i][3]);
            CHECK(image[2][i][3] > image[0][i][3] - 1e-6f, "silhouettes only add: %g, %g", (double)image[2][i][3], (double)image[0][i][3]);
            enhanced += image[2][i][3] > image[0][i][3] + 0.1f;
            if (crossings != 2) continue;
            for (int k = 0; k < 2; k++) sum[k] += (double)image[k][i][3], square[k] += pow((double)image[k][i][3], 2);
            count++;
        }
        for (int k = 0; k < 2; k++) spread[k] = sqrt(fmax(0, square[k] / count - pow(sum[k] / count, 2))) / (sum[k] / count);
        printf("    figure %s: %d rays with two crossings, spread of opacity %.2g scale-invariant, %.2g standard; %d pixels enhanced\n",
               figures[n].name, count, spread[0], spread[1], enhanced);
        CHECK(count > 5 && spread[0] < 1e-6 && spread[1] > 0.15 && enhanced > 10, "figure %s: %d rays, %g, %g, %d", figures[n].name, count,
              spread[0], spread[1], enhanced);
        for (int i = 0; i < 3; i++) free(image[i]), isogi_dvr_free(dvr[i]);
        isogi_vol_free(pyramid), procedural_free(&volume);
    }
}

/* Figure 6: backlight does nothing without transmission, more with diffuse, yet more with specular transmission. */
TEST(backlight_comes_through_translucent_surfaces) {
    isogi_volume volume = {.data = NULL};
    isogi_pyramid *pyramid = NULL;
    double light[3] = {0, 0, 0};
    CHECK(procedural_make(procedural_find("coulomb"), 32, &volume, &serial) == ISOGI_OK &&
              isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK,
          "volume");
    const isogi_peak peaks[] = {{0.72, {.15f, .3f, .9f}, 0.35f}, {1.5, {.9f, .15f, .1f}, 0.7f}};
    const isogi_transfer sheets_of_figure = {NULL, 0, peaks, 2};
    const isogi_light lamp = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {-0.05f, 0, -1}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.lights = &lamp, .light_count = 1};
    const isogi_view view = {.width = 24, .height = 24, .fov = 30, .target = {15.5f, 15.5f, 15.5f}, .eye = {15.5f, 15.5f, 80}};
    for (int i = 0; i < 3; i++) {
        isogi_dvr_desc desc = {.pyramid = pyramid, .space = ISOGI_DVR_DATA, .shading = ISOGI_DVR_TWO_SIDED};
        for (int a = 0; a < 3; a++) desc.material[2].diffuse[a] = i ? 1 : 1e-20f, desc.material[2].specular[a] = 1;
        desc.material[2].exponent = i == 2 ? 30 : 0;
        isogi_dvr *dvr = dvr_new(&desc, &sheets_of_figure);
        float(*image)[4] = picture(dvr, &view, &lighting, NULL, NULL);
        for (int p = 0; p < 24 * 24; p++) light[i] += (double)image[p][0] + (double)image[p][2];
        free(image), isogi_dvr_free(dvr);
    }
    printf("    light of the picture: %.3g without transmission, %.3g diffuse, %.3g diffuse and specular\n", light[0], light[1], light[2]);
    CHECK(light[1] > 5 * light[0] && light[1] > 1 && light[2] > 1.3 * light[1], "%g %g %g", light[0], light[1], light[2]);
    isogi_vol_free(pyramid), procedural_free(&volume);
}

/* Rays of pre-integrated pictures sample where they enter empty space and where they leave it, not in every block of it: matter amid a
   margin of 48 voxels takes few more samples than matter alone, those in the blocks next to it (three times as many; eight times, if every
   empty block were sampled). */
TEST(empty_margins_take_no_samples) {
    const isogi_transfer_point points[] = {{0, {1, 1, 1}, 0}, {40, {1, 1, 1}, 0}, {150, {1, 0.5f, 0.2f}, 0.001f}};
    const isogi_transfer transfer = {points, 3, NULL, 0};
    const isogi_view view = {.width = 16, .height = 16, .fov = 3, .target = {56, 56, 56}, .eye = {300, 250, 400}};
    const isogi_dvr_desc plain = {.space = ISOGI_DVR_DATA, .classification = ISOGI_DVR_PRE_INTEGRATED, .opaque = 1};
    uint64_t samples[2];
    for (int margin = 0; margin < 2; margin++) {
        const int n = margin ? 113 : 17, first = margin ? 48 : 0;
        uint8_t *data = (uint8_t *)calloc((size_t)(n * n * n), 1);
        for (int i = 0; i < 17 * 17 * 17; i++)
            data[i % 17 + first + n * (i / 17 % 17 + first + n * (i / 289 + first))] = (uint8_t)(100 + 50 * (i / 3 % 2));
        const double origin = margin ? 0 : 48;
        const isogi_volume volume = {
            .data = data, .type = ISOGI_U8, .size = {(size_t)n, (size_t)n, (size_t)n}, .origin = {origin, origin, origin}};
        isogi_dvr_desc desc = plain;
        isogi_pyramid *pyramid = NULL;
        isogi_counters count = {0};
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        desc.pyramid = pyramid;
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        free(picture(dvr, &view, NULL, NULL, &count));
        samples[margin] = count.samples;
        isogi_dvr_free(dvr), isogi_vol_free(pyramid), free(data);
    }
    CHECK(samples[0] > 3000 && samples[1] < 4 * samples[0], "%d samples, %d with margins", (int)samples[0], (int)samples[1]);
}

TEST_MAIN("dvr_data")
