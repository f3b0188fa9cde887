/* Properties of isogi_dvr.h: transfer functions, ray casting in both spaces, peaks, SH visibility, lighting. What has no
   call is tested in test_dvr_inside.c. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

static double coulomb(double x, double y, double z) { /* three potentials, two of them smaller */
    const double c[3][4] = {{0.35, 0.4, 0.5, 0.10}, {0.7, 0.35, 0.45, 0.05}, {0.55, 0.7, 0.6, 0.03}};
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double dx = x - c[i][0], dy = y - c[i][1], dz = z - c[i][2];
        sum += c[i][3] / sqrt(dx * dx + dy * dy + dz * dz + 1e-4);
    }
    return sum;
}

static double marschner_lobb(double x, double y, double z) {
    double u = 2 * x - 1, v = 2 * y - 1, w = 2 * z - 1;
    return (1 - sin(PI * w / 2) + 0.25 * (1 + cos(2 * PI * 6 * cos(PI * sqrt(u * u + v * v) / 2)))) / (2 * (1 + 0.25));
}

/* ---- a second implementation, plain and slow, in long double ---- */

/* The trilinear value at p and, if asked for, how fast it changes along dir. */
static long double reference_along(const field *f, const long double p[3], const long double dir[3], long double *slope) {
    int c[3];
    if (slope) *slope = 0;
    for (int a = 0; a < 3; a++) {
        c[a] = (int)p[a];
        if (c[a] > f->size[a] - 2) c[a] = f->size[a] - 2;
        if (c[a] < 0) c[a] = 0;
    }
    for (int a = 0; a < 3 && slope; a++) { /* linear along each axis, so the difference of the cell's faces is the derivative */
        long double low[3] = {p[0], p[1], p[2]}, high[3] = {p[0], p[1], p[2]};
        low[a] = c[a], high[a] = c[a] + 1;
        *slope += dir[a] * (reference_value(f, c, high) - reference_value(f, c, low));
    }
    return reference_value(f, c, p);
}

/* Unlit radiance and opacity along a ray through a unit-spaced volume at the origin: the midpoint rule with `steps` equal pieces,
   no blocks, no early end. */
static void reference_ray(const field *f, const isogi_transfer *t, int data_space, const double eye[3], const float dir[3],
                          long double per_voxel, long double out[4]) {
    long double enter = 0, leave = 1e30L, d[3], clear = 1;
    for (int a = 0; a < 4; a++) out[a] = 0;
    for (int a = 0; a < 3; a++) {
        long double t0, t1, size = f->size[a] - 1;
        d[a] = (long double)dir[a];
        if (fabsl(d[a]) < 1e-30L) {
            if (eye[a] < 0 || eye[a] > (double)size) return;
            continue;
        }
        t0 = (0 - (long double)eye[a]) / d[a], t1 = (size - (long double)eye[a]) / d[a];
        enter = fmaxl(enter, fminl(t0, t1)), leave = fminl(leave, fmaxl(t0, t1));
    }
    if (enter >= leave) return;
    long double piece = 1 / per_voxel;
    for (long i = 0; i * piece < leave - enter; i++) {
        long double from = i * piece, to = fminl(from + piece, leave - enter), p[3], slope, c[4];
        for (int a = 0; a < 3; a++) p[a] = (long double)eye[a] + (enter + 0.5L * (from + to)) * d[a];
        reference_transfer(t, reference_along(f, p, d, &slope), c);
        long double depth = c[3] * (to - from) * (data_space ? fabsl(slope) : 1);
        for (int a = 0; a < 3; a++) out[a] += clear * -expm1l(-depth) * c[a];
        clear *= expl(-depth);
    }
    out[3] = 1 - clear;
}

/* ---- transfer functions ---- */

TEST(transfer_function_is_piecewise_linear_with_steps) {
    const isogi_transfer_point points[] = {{-1, {0, 0, 0}, 1}, {1, {1, 0.5f, 0}, 3}, {1, {0, 0, 1}, 10}, {2, {0, 0, 1}, 0}};
    const isogi_transfer t = {points, 4, NULL, 0};
    const struct { double x; float rgb[3], extinction; } expected[] = {
        {-5, {0, 0, 0}, 1},       {-1, {0, 0, 0}, 1},  {0, {0.5f, 0.25f, 0}, 2}, {0.5, {0.75f, 0.375f, 0}, 2.5f},
        {1 - 1e-12, {1, 0.5f, 0}, 3}, {1, {0, 0, 1}, 10}, {1.5, {0, 0, 1}, 5},      {2, {0, 0, 1}, 0},
        {1e300, {0, 0, 1}, 0},    {(double)INFINITY, {0, 0, 1}, 0}, {-(double)INFINITY, {0, 0, 0}, 1}, {(double)NAN, {0, 0, 0}, 0},
    };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        float rgb[3], extinction;
        isogi_transfer_at(&t, expected[i].x, rgb, &extinction);
        for (int a = 0; a < 3; a++)
            CHECK(fabsf(rgb[a] - expected[i].rgb[a]) < 1e-6f, "x %g channel %d: %g, not %g", expected[i].x, a, (double)rgb[a],
                  (double)expected[i].rgb[a]);
        CHECK(fabsf(extinction - expected[i].extinction) < 1e-6f, "x %g: %g", expected[i].x, (double)extinction);
    }
}

TEST(transfer_function_of_many_points_agrees_with_a_plain_search) {
    enum { N = 3000 };
    static isogi_transfer_point points[N];
    test_random r = {11};
    double x = -4;
    for (int i = 0; i < N; i++) {
        points[i] = (isogi_transfer_point){x, {(float)random_unit(&r), 0, 0}, (float)random_unit(&r)};
        x += random_unit(&r) < 0.2 ? 0 : random_range(&r, 0, 0.01);
    }
    const isogi_transfer t = {points, N, NULL, 0};
    for (int i = 0; i < 20000; i++) {
        double at = i < N ? points[i].value : random_range(&r, -5, 15);
        float rgb[3], extinction;
        long double c[4];
        isogi_transfer_at(&t, at, rgb, &extinction);
        reference_transfer(&t, (long double)at, c);
        CHECK(fabs((double)extinction - (double)c[3]) < 1e-6, "x %.17g: %g, not %g", at, (double)extinction, (double)c[3]);
        CHECK(fabs((double)rgb[0] - (double)c[0]) < 1e-6, "x %.17g: red %g, not %g", at, (double)rgb[0], (double)c[0]);
    }
}

/* ---- physical space ---- */

static double constant(double x, double y, double z) { return (void)x, (void)y, (void)z, 2; }

TEST(homogeneous_slab_has_the_transmittance_of_beer_and_lambert) {
    field f = field_of(constant, 20);
    const double steps[] = {0.1, 0.37, 0.5, 1, 3.3, 40}, extinctions[] = {1e-9, 1e-3, 0.05, 0.4, 2, 1e6}, unit = 1.7;
    for (int s = 0; s < 12; s++)
        for (int e = 0; e < 6; e++) {
            const isogi_transfer_point point = {0, {0.2f, 0.5f, 1}, (float)extinctions[e]};
            const isogi_transfer transfer = {&point, 1, NULL, 0};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .step = steps[s % 6], .unit = unit, .opaque = 1, .classification = s < 6
                ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const double eye[3] = {-30, 3, 5}, target[3] = {50, 12, 9}; /* in at x = 0, out at x = 19 */
            double along = sqrt(80 * 80 + 9 * 9 + 4 * 4) / 80, depth = (double)(float)extinctions[e] * 19 * along / unit;
            pixel p = cast(dvr, eye, target, NULL);
            /* float output; the direction is float too: 1e-6 of the depth. Pre-integrated: products of up to 200 floats */
            CHECK(fabs((double)p.c[3] - -expm1(-depth)) < (s < 6 ? 2e-7 : 5e-6) + 2e-6 * -expm1(-depth),
                  "step %g extinction %g: opacity %.9g, not %.9g", steps[s % 6], extinctions[e], (double)p.c[3], -expm1(-depth));
            if (depth < 1e-6) CHECK(fabs((double)p.c[3] / depth - 1) < 1e-4, "thin medium: %g of %g", (double)p.c[3], depth);
            for (int a = 0; a < 3; a++)
                CHECK(fabsf(p.c[a] - p.c[3] * point.rgb[a]) < (s < 6 ? 2e-7f : 5e-6f), "premultiplied channel %d: %g", a, (double)p.c[a]);
            /* half of the final opacity */
            double half = -log(1 + 0.5 * expm1(-depth)) / depth * 19 * along + 30 * along;
            CHECK(fabs((double)p.depth - half) < 1e-4, "step %g extinction %g: depth %g, not %g", steps[s % 6], extinctions[e],
                  (double)p.depth, half);
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

TEST(rays_that_miss_are_transparent_and_infinitely_deep) {
    field f = field_of(constant, 8);
    const isogi_transfer_point point = {0, {1, 1, 1}, 1};
    const isogi_transfer transfer = {&point, 1, NULL, 0}, none = {NULL, 0, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    const double eye[3] = {-30, 3, 5}, away[3] = {-40, 3, 5}, past[3] = {8, 20, 9}, in[3] = {5, 3, 5};
    pixel p = cast(dvr, eye, away, NULL), q = cast(dvr, eye, past, NULL), inside = cast(dvr, in, eye, NULL);
    CHECK(p.c[3] <= 0 && p.depth > 1e30f, "behind: %g %g", (double)p.c[3], (double)p.depth);
    CHECK(q.c[3] <= 0 && q.depth > 1e30f, "beside: %g %g", (double)q.c[3], (double)q.depth);
    /* an eye within the box sees what lies before it */
    CHECK(fabs((double)inside.c[3] - -expm1(-5)) < 1e-6, "inside: %g, not %g", (double)inside.c[3], -expm1(-5));
    CHECK(isogi_dvr_set_transfer(dvr, &none) == ISOGI_OK, "no points at all");
    p = cast(dvr, eye, in, NULL);
    CHECK(p.c[3] <= 0 && p.depth > 1e30f, "nothing absorbs: %g %g", (double)p.c[3], (double)p.depth);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* As isogi_view_ray promises: an eye that looks at itself looks along -z. */
TEST(an_eye_at_its_target_looks_along_minus_z) {
    field f = field_of(constant, 8);
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.3f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_dvr_desc descs[2] = {{.pyramid = f.pyramid, .opaque = 1}, {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA}};
    const isogi_view view[2] = {{.width = 3, .height = 2, .eye = {3, 4, 6}, .target = {3, 4, 6}},
                                {.width = 3, .height = 2, .eye = {3, 4, 6}, .target = {3, 4, 5}}};
    for (int space = 0; space < 2; space++) {
        isogi_dvr *dvr = dvr_new(&descs[space], &transfer);
        float image[2][6][4], depth[2][6];
        for (int i = 0; i < 2; i++) CHECK(isogi_dvr_render(dvr, &view[i], NULL, image[i], depth[i], NULL) == ISOGI_OK, "view %d", i);
        CHECK(!memcmp(image[0], image[1], sizeof image[0]) && !memcmp(depth[0], depth[1], sizeof depth[0]), "space %d: not along -z",
              space);
        CHECK(space || fabs((double)image[0][1][3] - -expm1(-0.3 * 6)) < 0.02, "opacity %g", (double)image[0][1][3]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Midpoint rule: the error falls with the square of the step where the integrand is smooth (physical space), and at least in
   proportion where it jumps (data space: the trilinear gradient does at cell faces). */
TEST(casting_converges_to_the_integral_in_both_spaces) {
    const isogi_transfer_point points[] = {
        {-1.2, {1, 0, 0}, 0}, {-0.3, {0.2f, 1, 0}, 0.6f}, {0.1, {0, 0.3f, 1}, 0.05f}, {0.5, {1, 1, 0}, 0.9f}, {1.2, {0, 1, 1}, 0.1f}};
    const isogi_transfer transfer = {points, 5, NULL, 0};
    const double steps[] = {1, 0.5, 0.25, 0.125};
    for (int space = 0; space < 2; space++) {
        double error[4] = {0}, largest[4] = {0};
        int pixels = 0;
        for (uint64_t seed = 1; seed <= 3; seed++) {
            field f = field_waves(14, seed);
            test_random r = {seed + 77};
            isogi_view view = view_of(&f, 1, &r, 6);
            long double expected[36][4];
            for (int i = 0; i < 36; i++) {
                double eye[3];
                float dir[3];
                isogi_view_ray(&view, i % 6, i / 6, eye, dir);
                reference_ray(&f, &transfer, space, eye, dir, LONG_SUITE ? 1000 : 200, expected[i]);
            }
            for (int s = 0; s < 4; s++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .step = steps[s], .opaque = 1, .space = (isogi_dvr_space)space,
                                             .classification = ISOGI_DVR_POST_CLASSIFIED};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
                for (int i = 0; i < 144; i++) {
                    double e = fabs((double)image[i / 4][i % 4] - (double)expected[i / 4][i % 4]);
                    error[s] += e * e, largest[s] = fmax(largest[s], e);
                }
                free(image);
                isogi_dvr_free(dvr);
            }
            pixels += 36;
            field_free(&f);
        }
        for (int s = 0; s < 4; s++) error[s] = sqrt(error[s] / pixels / 4);
        CHECK(error[1] < 4e-3, "space %d, default step: RMSE %g, largest %g", space, error[1], largest[1]);
        CHECK(error[3] < (space ? 1e-3 : 2e-4), "space %d, step 1/8: RMSE %g, largest %g", space, error[3], largest[3]);
        CHECK(error[3] < error[0] / (space ? 5 : 32), "space %d: RMSE %g %g %g %g for steps 1 to 1/8", space, error[0], error[1], error[2],
              error[3]);
        printf("    %s space: RMSE %.2g %.2g %.2g %.2g for steps of 1, 1/2, 1/4, 1/8 voxel\n", space ? "data" : "physical", error[0],
               error[1], error[2], error[3]);
    }
}

/* ---- data space ---- */

TEST(constant_data_contributes_nothing_in_data_space) {
    field f = field_of(constant, 10);
    const isogi_transfer_point point = {0, {1, 1, 1}, 1e6f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    test_random r = {5};
    for (int i = 0; i < 200; i++) {
        double eye[3], target[3];
        for (int a = 0; a < 3; a++) eye[a] = random_range(&r, -20, 30), target[a] = random_range(&r, 0, 9);
        pixel p = cast(dvr, eye, target, NULL);
        CHECK(p.c[3] <= 0 && p.c[0] <= 0, "opacity %g", (double)p.c[3]);
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

static double slope_direction[3];
static double linear(double x, double y, double z) { return slope_direction[0] * x + slope_direction[1] * y + slope_direction[2] * z; }

/* Kraus 2005, eq. 3: along a monotone piece only the values at its ends count. */
TEST(linear_data_has_the_opacity_of_the_values_passed) {
    test_random r = {6};
    for (int n = 0; n < 60; n++) {
        double d[3], eye[3], target[3], inverse[3], enter = -1e9, leave = 1e9, s[2];
        random_direction(&r, slope_direction);
        field f = field_of(linear, 12);
        const isogi_transfer_point flat = {0, {1, 1, 1}, (float)random_range(&r, 0.5, 3)};
        const isogi_transfer_point ramp[] = {{-3, {1, 1, 1}, 0}, {3, {1, 1, 1}, 4}}; /* tau = (s + 3) 2/3, integral (s + 3)^2 / 3 */
        const isogi_transfer constant_tau = {&flat, 1, NULL, 0}, ramp_tau = {ramp, 2, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .step = random_range(&r, 0.05, 2)};
        isogi_dvr *dvr = dvr_new(&desc, &constant_tau);
        random_direction(&r, d);
        for (int a = 0; a < 3; a++) target[a] = (double)(float)random_range(&r, 2, 9), eye[a] = (double)(float)(target[a] - 40 * d[a]);
        pixel p = cast(dvr, eye, target, NULL);
        for (int a = 0; a < 3; a++) {
            inverse[a] = 1 / (target[a] - eye[a]);
            double t0 = (0 - eye[a]) * inverse[a], t1 = (11 - eye[a]) * inverse[a];
            enter = fmax(enter, fmin(t0, t1)), leave = fmin(leave, fmax(t0, t1));
        }
        for (int i = 0; i < 2; i++) {
            double t = i ? leave : enter;
            s[i] = 0;
            for (int a = 0; a < 3; a++) s[i] += slope_direction[a] * (eye[a] + t * (target[a] - eye[a])) / 11;
        }
        double expected = -expm1(-(double)flat.extinction * fabs(s[1] - s[0]));
        CHECK(fabs((double)p.c[3] - expected) < 2e-6, "constant extinction: %g, not %g", (double)p.c[3], expected); /* float direction */
        CHECK(isogi_dvr_set_transfer(dvr, &ramp_tau) == ISOGI_OK, "ramp");
        p = cast(dvr, eye, target, NULL);
        expected = -expm1(-fabs((s[1] + 3) * (s[1] + 3) - (s[0] + 3) * (s[0] + 3)) / 3);
        /* the midpoint rule is exact for a linear extinction */
        CHECK(fabs((double)p.c[3] - expected) < 4e-6, "ramp: %g, not %g", (double)p.c[3], expected);
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

TEST(scaling_space_changes_no_pixel_in_data_space) {
    const isogi_transfer_point points[] = {
        {-1, {1, 0.2f, 0.1f}, 0}, {-0.2, {0.3f, 1, 0.1f}, 2}, {0.4, {0.1f, 0.4f, 1}, 0.3f}, {1, {1, 1, 0}, 3}};
    const isogi_peak peaks[] = {{0.3, {1, 1, 1}, 0.4f}, {-0.4, {0, 1, 0}, 0.2f}};
    const isogi_transfer transfer = {points, 4, peaks, 2};
    float(*image[3])[4];
    const double scales[3] = {1, 1e-3, 1e3};
    for (int i = 0; i < 3; i++) {
        field f = field_waves(16, 21);
        test_random r = {9};
        isogi_vol_free(f.pyramid);
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = scales[i];
        field_build(&f);
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_view view = view_of(&f, scales[i], &r, 32);
        image[i] = picture(dvr, &view, NULL, NULL, NULL);
        isogi_dvr_free(dvr);
        field_free(&f);
    }
    double seen = 0;
    for (int p = 0; p < 32 * 32; p++) seen += (double)image[0][p][3] / 1024;
    CHECK(seen > 0.3, "the picture shows something: mean opacity %g", seen);
    for (int i = 1; i < 3; i++) {
        double most = largest_difference(image[0], image[i], 1024);
        CHECK(most < 1e-5, "scale %g: largest difference %g", scales[i], most);
    }
    for (int i = 0; i < 3; i++) free(image[i]);
}

/* ---- peaks ---- */

/* The number of crossings along a ray, by another way: signs between fine samples of the long double reference. */
static int reference_crossings(const field *f, double isovalue, const double eye[3], const float dir[3], int *unsure) {
    long double d[3], p[3], last = 0, closest = 1e30L;
    int count = 0, begun = 0, rising = 0;
    for (int a = 0; a < 3; a++) d[a] = (long double)dir[a];
    *unsure = 0;
    for (int i = 0; i < 10000; i++) {
        int inside = 1;
        for (int a = 0; a < 3; a++) p[a] = (long double)eye[a] + i * 0.02L * d[a], inside &= p[a] >= 0 && p[a] <= f->size[a] - 1;
        if (!inside) {
            if (begun && fabsl(last) < 0.01L) *unsure = 1; /* near the surface where it leaves */
            begun = 0;
            continue;
        }
        long double v = reference_along(f, p, d, NULL) - (long double)isovalue;
        if (!begun && fabsl(v) < 0.01L) *unsure = 1;
        if (begun && (v >= 0) != (last >= 0)) count++;
        if (begun > 1 && (v > last) != rising)
            closest = fminl(closest, fminl(fabsl(v), fabsl(last))); /* an extremum next to the isovalue */
        rising = v > last, last = v, begun++;
    }
    if (closest < 1e-3L) *unsure = 1;
    return count;
}

TEST(every_crossing_of_a_peak_has_its_opacity_whatever_the_gradient) {
    const struct { field_function *function; double isovalue; } cases[] = {{coulomb, 0.4}, {coulomb, 0.7}, {marschner_lobb, 0.5}};
    const float opacity = 0.3f;
    int seen[12] = {0}, most = 0;
    for (int n = 0; n < 3; n++) {
        field f = field_of(cases[n].function, 32);
        const isogi_peak peak = {cases[n].isovalue, {0.9f, 0.5f, 0.2f}, opacity};
        const isogi_transfer transfer = {NULL, 0, &peak, 1};
        test_random r = {31};
        for (int view_number = 0; view_number < 3; view_number++) {
            isogi_view view = view_of(&f, 1, &r, 12);
            int count[144], unsure[144];
            view.fov = 14;
            for (int i = 0; i < 144; i++) {
                double eye[3];
                float dir[3];
                isogi_view_ray(&view, i % 12, i / 12, eye, dir);
                count[i] = reference_crossings(&f, peak.isovalue, eye, dir, &unsure[i]);
            }
            for (int space = 0; space < 2; space++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .opaque = 1};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
                for (int i = 0; i < 144; i++) {
                    double expected = 1 - pow(1 - (double)opacity, count[i]);
                    if (unsure[i]) continue;
                    CHECK(fabs((double)image[i][3] - expected) < 1e-6, "field %d space %d ray %d: %d crossings, opacity %g, not %g", n,
                          space, i, count[i], (double)image[i][3], expected);
                    for (int a = 0; a < 3; a++)
                        CHECK(fabs((double)image[i][a] - expected * (double)peak.rgb[a]) < 1e-6, "colour %d: %g", a, (double)image[i][a]);
                    seen[count[i] < 11 ? count[i] : 11]++;
                    if (count[i] > most) most = count[i];
                }
                free(image);
                isogi_dvr_free(dvr);
            }
        }
        field_free(&f);
    }
    printf("    rays by crossings 0.. : %d %d %d %d %d %d %d+; up to %d\n", seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], seen[6],
           most);
    CHECK(seen[0] > 20 && seen[2] > 20 && seen[4] > 20 && most >= 6, "the rays cover %d %d %d, up to %d crossings", seen[0], seen[2],
          seen[4], most);
}

/* The second crossing within one cell: a saddle whose value rises and falls along a diagonal. */
TEST(two_crossings_in_one_cell_both_count) {
    field f = field_new(2, 2, 2);
    *field_at(&f, 1, 0, 0) = *field_at(&f, 1, 0, 1) = 1, *field_at(&f, 0, 1, 0) = *field_at(&f, 0, 1, 1) = 1; /* x + y - 2 x y */
    field_build(&f);
    const isogi_peak peak = {0.3, {1, 1, 1}, 0.25f};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    const double eye[3] = {-1, -1, 0.4}, target[3] = {2, 2, 0.6}; /* 2 x (1 - x): 0, up to 0.5, 0 */
    pixel p = cast(dvr, eye, target, NULL);
    CHECK(fabs((double)p.c[3] - (1 - 0.75 * 0.75)) < 1e-7, "opacity %.9g", (double)p.c[3]);
    isogi_dvr_free(dvr);
    field_free(&f);
}

TEST(peaks_stand_in_order_between_samples) {
    slope_direction[0] = 1, slope_direction[1] = slope_direction[2] = 0;
    field f = field_of(linear, 11); /* value = x / 10 */
    const double eye[3] = {-5, 5, 5}, target[3] = {5, 5, 5};
    const isogi_transfer_point medium = {0, {0, 1, 0}, 0.1f};
    for (int i = 0; i < 40; i++) {
        double x = 0.13 + 9.7 * i / 40;
        const isogi_peak peaks[] = {{1, {0, 0, 1}, 0}, {x / 10, {1, 0, 0}, 0.5f}, {(x + 0.01) / 10, {0, 0, 1}, 1}};
        const isogi_transfer transfer = {&medium, 1, peaks, 3};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .step = 2.5, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel p = cast(dvr, eye, target, NULL);
        double before = exp(-0.1 * x), after = exp(-0.1 * (x + 0.01));
        /* a homogeneous medium divided at the crossings is exact whatever the step */
        CHECK(fabs((double)p.c[0] - 0.5 * before) < 1e-6, "x %g: red %g, not %g", x, (double)p.c[0], 0.5 * before);
        CHECK(fabs((double)p.c[1] - (1 - before + 0.5 * (before - after))) < 1e-6, "x %g: green %g", x, (double)p.c[1]);
        CHECK(fabs((double)p.c[2] - 0.5 * after) < 1e-6, "x %g: blue %g, not %g", x, (double)p.c[2], 0.5 * after);
        CHECK(p.c[3] >= 1, "opacity %g behind an opaque surface", (double)p.c[3]);
        CHECK(fabs((double)p.depth - (5 + (1 - before < 0.5 ? x : -log(0.5) / 0.1))) < 1e-5, "x %g: depth %g", x, (double)p.depth);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Kraus 2005, 4.5: N isosurfaces of opacity 1 - (1-a)^(1/N) converge to the constant transfer function, about as 1/N. */
TEST(many_isosurfaces_converge_to_a_constant_transfer_function) {
    field f = field_waves(16, 4);
    const isogi_transfer_point points[] = {{-1, {1, 1, 1}, 0}, {-1, {1, 1, 1}, 1}, {1, {1, 1, 1}, 1}, {1, {1, 1, 1}, 0}};
    const isogi_transfer continuous = {points, 4, NULL, 0};
    const isogi_dvr_desc fine = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .step = 0.02, .opaque = 1};
    isogi_dvr *dvr = dvr_new(&fine, &continuous);
    test_random r = {8};
    isogi_view view = view_of(&f, 1, &r, 10);
    float(*expected)[4] = picture(dvr, &view, NULL, NULL, NULL);
    double error[2] = {0, 0};
    for (int n = 0; n < 2; n++) {
        int count = n ? 256 : 32;
        isogi_peak peaks[256];
        for (int i = 0; i < count; i++) peaks[i] = (isogi_peak){-1 + 2 * (i + 0.5) / count, {1, 1, 1}, (float)-expm1(-2.0 / count)};
        const isogi_transfer surfaces = {NULL, 0, peaks, (size_t)count};
        CHECK(isogi_dvr_set_transfer(dvr, &surfaces) == ISOGI_OK, "peaks");
        float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
        for (int i = 0; i < 100; i++) error[n] += pow((double)(image[i][3] - expected[i][3]), 2) / 100;
        error[n] = sqrt(error[n]);
        free(image);
    }
    CHECK(error[0] < 0.05 && error[1] < 0.006 && error[1] < error[0] / 5, "RMSE %g with 32, %g with 256", error[0], error[1]);
    free(expected);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* ---- visibility ---- */

static void visibility_of(isogi_dvr *dvr, const float point[3], float *v) {
    double remaining = 1;
    isogi_result result = isogi_dvr_step(dvr, 0, &remaining);
    CHECK(result == ISOGI_OK && remaining <= 0, "step: %s, remaining %g", isogi_result_string(result), remaining);
    result = isogi_dvr_sample_visibility(dvr, (const float(*)[3])point, 1, v);
    CHECK(result == ISOGI_OK, "sample_visibility: %s", isogi_result_string(result));
}

/* Coefficients of a function that is symmetric about `axis` and has these zonal coefficients about +z. */
static void zonal(const double *z, int order, const double axis[3], double *out) {
    isogi_sh_eval_f64(out, order, (const double(*)[3])axis, 1);
    for (int l = 0; l < order; l++)
        for (int m = -l; m <= l; m++) out[l * (l + 1) + m] *= sqrt(4 * PI / (2 * l + 1)) * z[l];
}

TEST(visibility_of_a_half_space_agrees_with_its_closed_form) {
    const double z[4] = {sqrt(PI), sqrt(3 * PI) / 2, 0, -sqrt(7 * PI) / 8};
    /* the border of the half space passes between rays: the error of the lattice, about 6 / rays^(3/4), with a margin */
    const struct { int rays; double tolerance; } cases[] = {{16, 1}, {32, 0.7}, {64, 0.36}, {128, 0.2}, {256, 0.12}, {512, 0.075},
        {1024, 0.045}, {2048, 0.03}};
    printf("    largest error by rays:");
    for (int c = 0; c < 8; c++) {
        test_random r = {3};
        double most = 0;
        for (int n = 0; n < (LONG_SUITE ? 1000 : 60); n++) {
            random_direction(&r, slope_direction);
            field f = field_of(linear, 4);
            double middle = 0.5 * (slope_direction[0] + slope_direction[1] + slope_direction[2]) - 1e-7, expected[16];
            const isogi_transfer_point points[] = {{middle, {1, 1, 1}, 1e6f}, {middle, {1, 1, 1}, 0}};
            const isogi_transfer transfer = {points, 2, NULL, 0};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 4, .directions = cases[c].rays,
                .grid = {1, 1, 1},
                                         .method = ISOGI_DVR_BRUTE};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const float centre[3] = {1.5f, 1.5f, 1.5f};
            float v[16];
            visibility_of(dvr, centre, v);
            zonal(z, 4, slope_direction, expected);
            for (int i = 0; i < 16; i++) most = fmax(most, fabs((double)v[i] - expected[i]));
            isogi_dvr_free(dvr);
            field_free(&f);
        }
        CHECK(most < cases[c].tolerance, "%d rays: largest error of a coefficient %g", cases[c].rays, most);
        printf(" %d: %.3f", cases[c].rays, most);
    }
    printf("\n");
}

static double distance_from_centre(double x, double y, double z) {
    return 23 * sqrt((x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5) + (z - 0.5) * (z - 0.5)); /* voxels, on 24^3 */
}

/* A sphere of radius 6 seen from the middle of the face x = 0: the cone of directions that it covers, opaque as a medium and as a
   peak, and half transparent with two crossings. */
TEST(visibility_past_a_sphere_agrees_with_its_cone) {
    field f = field_of(distance_from_centre, 24);
    const isogi_transfer_point solid[] = {{6, {1, 1, 1}, 1e6f}, {6, {1, 1, 1}, 0}};
    const isogi_peak opaque = {6, {1, 1, 1}, 1}, half = {6, {1, 1, 1}, 0.5f};
    const isogi_transfer transfers[3] = {{solid, 2, NULL, 0}, {NULL, 0, &opaque, 1}, {NULL, 0, &half, 1}};
    const double sine = 6 / 11.5, cosine = sqrt(1 - sine * sine), axis[3] = {1, 0, 0};
    for (int space = 0; space < 2; space++)
        for (int n = 0; n < 3; n++) {
            double blocked = n == 2 ? 0.75 : 1, expected[9];
            /* zonal coefficients of 1 minus `blocked` on the cone */
            double z[3] = {sqrt(4 * PI) - blocked * sqrt(PI) * (1 - cosine), -blocked * sqrt(3 * PI) / 2 * sine * sine,
                           -blocked * sqrt(5 * PI) / 2 * cosine * sine * sine};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .shading = ISOGI_DVR_VISIBILITY,
                .directions = 4096,
                                         .grid = {2, 1, 1}, .method = ISOGI_DVR_BRUTE};
            isogi_dvr *dvr = dvr_new(&desc, &transfers[n]);
            const float point[3] = {0, 11.5f, 11.5f};
            float v[9];
            visibility_of(dvr, point, v);
            zonal(z, 3, axis, expected);
            /* the trilinear sphere is 0.2 % small, and 4096 rays count its rim to 0.004 */
            for (int i = 0; i < 9; i++)
                CHECK(fabs((double)v[i] - expected[i]) < 0.02, "space %d case %d coefficient %d: %g, not %g", space, n, i, (double)v[i],
                      expected[i]);
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

TEST(visibility_within_a_homogeneous_box_agrees_with_quadrature) {
    field f = field_of(constant, 9);
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.3f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = 1024, .grid = {3, 5, 2},
                                 .method = ISOGI_DVR_BRUTE};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    const float places[4][3] = {{4, 4, 0}, {0, 6, 8}, {8, 8, 8}, {4, 2, 8}};
    double remaining;
    isogi_dvr_step(dvr, 0, &remaining);
    for (int p = 0; p < 4; p++) {
        double expected[9] = {0};
        float v[9];
        isogi_dvr_sample_visibility(dvr, &places[p], 1, v);
        for (int i = 0; i < 400; i++)
            for (int j = 0; j < 400; j++) {
                double z = (i + 0.5) / 200 - 1, phi = (j + 0.5) * PI / 200,
                       d[3] = {sqrt(1 - z * z) * cos(phi), sqrt(1 - z * z) * sin(phi), z}, y[9];
                double leave = 1e9;
                for (int a = 0; a < 3; a++) leave = fmin(leave, ((d[a] > 0 ? 8 : 0) - (double)places[p][a]) / d[a]);
                isogi_sh_eval_f64(y, 3, (const double(*)[3])d, 1);
                for (int k = 0; k < 9; k++) expected[k] += y[k] * exp(-(double)point.extinction * leave) * 4 * PI / 160000;
            }
        /* jumps at the box's faces for points on them: the error of 1024 rays at a half space */
        for (int k = 0; k < 9; k++)
            CHECK(fabs((double)v[k] - expected[k]) < 0.04, "place %d coefficient %d: %g, not %g", p, k, (double)v[k], expected[k]);
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

TEST(a_new_transfer_function_starts_visibility_again) {
    field f = field_waves(10, 14);
    const isogi_transfer_point points[] = {{-1, {1, 1, 1}, 0}, {1, {1, 1, 1}, 0.4f}};
    const isogi_transfer_point next_to_nothing = {0, {1, 1, 1}, 1e-9f};
    const isogi_transfer first = {points, 2, NULL, 0}, second = {&next_to_nothing, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {2, 2, 2}, .method = ISOGI_DVR_BRUTE};
    isogi_dvr *dvr = dvr_new(&desc, &first);
    double remaining = 1;
    const float corner[3] = {0, 0, 0};
    float v[9];
    visibility_of(dvr, corner, v);
    CHECK(v[0] < 3.3f, "attenuated: %g", (double)v[0]);
    CHECK(isogi_dvr_set_transfer(dvr, &second) == ISOGI_OK, "set_transfer");
    CHECK(isogi_dvr_step(dvr, 1, &remaining) == ISOGI_OK && fabs(remaining - 7 / 8.0) < 1e-12, "remaining %g", remaining);
    visibility_of(dvr, corner, v);
    CHECK(fabs((double)v[0] - 2 * sqrt(PI)) < 1e-5, "clear: %g", (double)v[0]);
    isogi_dvr_free(dvr);
    field_free(&f);
}

TEST(interpolated_visibility_is_trilinear_between_grid_points) {
    field f = field_waves(9, 14);
    const isogi_transfer_point points[] = {{-1, {1, 1, 1}, 0}, {1, {1, 1, 1}, 0.4f}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .directions = 16, .grid = {3, 2, 5}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    test_random r = {2};
    isogi_dvr_step(dvr, 0, NULL);
    for (int n = 0; n < 100; n++) {
        float p[3], v[4], corner[4], distance[3] = {4, 8, 2};
        double low[3], u[3], expected[4] = {0};
        for (int a = 0; a < 3; a++) {
            p[a] = (float)random_range(&r, 0, 8);
            low[a] = floor((double)(p[a] / distance[a])) * (double)distance[a], u[a] = ((double)p[a] - low[a]) / (double)distance[a];
        }
        for (int c = 0; c < 8; c++) {
            float at[3];
            double w = 1;
            for (int a = 0; a < 3; a++) at[a] = (float)low[a] + (c >> a & 1 ? distance[a] : 0), w *= c >> a & 1 ? u[a] : 1 - u[a];
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])&at, 1, corner);
            for (int i = 0; i < 4; i++) expected[i] += w * (double)corner[i];
        }
        isogi_dvr_sample_visibility(dvr, (const float(*)[3])&p, 1, v);
        for (int i = 0; i < 4; i++)
            CHECK(fabs((double)v[i] - expected[i]) < 1e-5, "coefficient %d: %g, not %g", i, (double)v[i], expected[i]);
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* ---- lighting ---- */

TEST(a_medium_without_shadows_shows_its_albedo_under_a_uniform_sky) {
    field f = field_of(constant, 12);
    const isogi_transfer_point point = {0, {0.8f, 0.5f, 0.3f}, 1e-7f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    const double eye[3] = {-30, 3, 5}, target[3] = {5, 7, 6};
    for (int order = 1; order <= 6; order++)
        for (int directions = 1; directions <= 4096; directions *= 4)
            for (int stepped = 0; stepped < 2; stepped++) {
                const isogi_dvr_desc desc = {
                    .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = order, .directions = directions, .grid = {2, 2, 1}};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                if (stepped) isogi_dvr_step(dvr, 0, NULL);
                pixel p = cast(dvr, eye, target, &sky);
                /* a medium of optical depth 1e-6, float coefficients */
                for (int a = 0; a < 3; a++)
                    CHECK(fabs((double)(p.c[a] / p.c[3] - point.rgb[a])) < 1e-5, "order %d, %d rays, channel %d: %g, not %g", order,
                          directions, a, (double)(p.c[a] / p.c[3]), (double)point.rgb[a]);
                isogi_dvr_free(dvr);
            }
    field_free(&f);
}

TEST(lights_add_up) {
    field f = field_waves(12, 3);
    const isogi_transfer_point points[] = {{-1, {1, 0.2f, 0.1f}, 0}, {1, {0.3f, 1, 0.1f}, 0.05f}};
    const isogi_peak peak = {0.2, {1, 1, 1}, 0.1f};
    const isogi_transfer transfer = {points, 2, &peak, 1};
    const isogi_light lights[] = {{.vector = {1, 1, 1}, .rgb = {2, 1, 0.5f}},
                                  {.kind = ISOGI_LIGHT_POINT, .vector = {40, 5, 6}, .rgb = {300, 900, 100}}};
    const isogi_lighting parts[4] = {{.env = {.sh = sky_one, .sh_order = 1}},
                                     {.lights = &lights[0], .light_count = 1},
                                     {.lights = &lights[1], .light_count = 1},
                                     {.env = {.sh = sky_one, .sh_order = 1}, .lights = lights, .light_count = 2}};
    for (int shading = 1; shading < 3; shading++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = (isogi_dvr_shading)shading, .grid = {4, 4, 4}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        test_random r = {12};
        isogi_view view = view_of(&f, 1, &r, 16);
        float(*image[4])[4];
        double bright[3] = {0};
        isogi_dvr_step(dvr, 0, NULL);
        for (int i = 0; i < 4; i++) image[i] = picture(dvr, &view, &parts[i], NULL, NULL);
        for (int p = 0; p < 256; p++)
            for (int a = 0; a < 3; a++) {
                double sum = (double)image[0][p][a] + (double)image[1][p][a] + (double)image[2][p][a];
                CHECK(fabs(sum - (double)image[3][p][a]) < 1e-6, "shading %d pixel %d: %g, not %g", shading, p, (double)image[3][p][a],
                      sum);
                for (int i = 0; i < 3; i++) bright[i] = fmax(bright[i], (double)image[i][p][a]);
            }
        for (int i = 0; i < 3; i++) CHECK(bright[i] > 0.01, "shading %d: light %d is seen: %g", shading, i, bright[i]);
        for (int i = 0; i < 4; i++) free(image[i]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST(scattered_light_has_the_stated_units) {
    field f = field_of(constant, 5);
    const isogi_transfer_point point = {0, {0.8f, 0.5f, 0.3f}, 1e-7f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_light lights[] = {{.vector = {1, 2, -1}, .rgb = {2, 2, 2}},
                                  {.kind = ISOGI_LIGHT_POINT, .vector = {2, 300, 2}, .rgb = {5e4f, 5e4f, 5e4f}}};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY};
    const double eye[3] = {-30, 2, 2}, target[3] = {5, 2, 2}, expected[2] = {2 / (4 * PI), 5e4 / (298.0 * 298.0) / (4 * PI)};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    for (int i = 0; i < 2; i++) {
        const isogi_lighting lighting = {.lights = &lights[i], .light_count = 1};
        pixel p = cast(dvr, eye, target, &lighting);
        for (int a = 0; a < 3; a++)
            CHECK(fabs((double)(p.c[a] / p.c[3] / point.rgb[a]) / expected[i] - 1) < 1e-4, "light %d: %g, not %g", i,
                  (double)(p.c[a] / p.c[3] / point.rgb[a]), expected[i]);
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* A plane seen from both sides, lit from the side of the eye: rgb E cos / pi; under the sky: rgb; from behind: nothing. */
TEST(local_shading_faces_the_eye_on_both_sides) {
    slope_direction[0] = slope_direction[1] = 0, slope_direction[2] = 1;
    field f = field_of(linear, 9);
    const isogi_peak peak = {0.5, {0.8f, 0.5f, 0.3f}, 1};
    const isogi_transfer transfer = {NULL, 0, &peak, 1};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_LOCAL};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    for (int side = -1; side <= 1; side += 2) {
        const double eye[3] = {4, 4, 4 + 30 * side}, target[3] = {4, 4, 4};
        const isogi_light towards = {.vector = {0, 3, 4.0f * (float)side}, .rgb = {2, 2, 2}};
        const isogi_light behind = {.vector = {0, 3, -4.0f * (float)side}, .rgb = {2, 2, 2}};
        const isogi_lighting lit[3] = {
            {.env = {.sh = sky_one, .sh_order = 1}}, {.lights = &towards, .light_count = 1}, {.lights = &behind, .light_count = 1}};
        const double expected[3] = {1, 2 * 0.8 / PI, 0};
        for (int i = 0; i < 3; i++) {
            pixel p = cast(dvr, eye, target, &lit[i]);
            for (int a = 0; a < 3; a++)
                CHECK(fabs((double)p.c[a] - expected[i] * (double)peak.rgb[a]) < 1e-5, "side %d light %d: %g, not %g", side, i,
                      (double)p.c[a], expected[i] * (double)peak.rgb[a]);
        }
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* A slab above a floor: the floor under it is dark, beside it bright. */
static double floor_and_roof(double x, double y, double z) { return y < 0.1 ? 1 : (y > 0.55 && y < 0.75 && x > 0.55) ? 1 : ((void)z, 0); }

/* A mask's matter, of one value along the ray, has the side that its surface shows to the eye: lit from there it looks alike by every way,
   and with all values negated. */
TEST(flat_matter_is_lit_from_the_side_of_the_eye) {
    enum { N = 17, LONG = 24 };
    static uint8_t data[LONG][N][N];
    const isogi_transfer_point rising[] = {{50, {1, 1, 1}, 0}, {100, {1, 1, 1}, 0.8f}};
    const isogi_transfer_point falling[] = {{-100, {1, 1, 1}, 0.8f}, {-50, {1, 1, 1}, 0}};
    const double eye[3] = {8.3, 8.3, -20}, target[3] = {8.3, 8.3, 8};
    const isogi_light sun = {.vector = {0, 0, -1}, .rgb = {(float)PI, (float)PI, (float)PI}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    for (int k = 8; k < LONG; k++) memset(data[k], 100, sizeof data[k]);
    for (int n = 0; n < 6; n++) {
        const isogi_volume v = {.data = data, .type = ISOGI_U8, .size = {N, N, LONG}, .scale = n % 2 ? -1 : 1};
        const isogi_transfer transfer = {n % 2 ? falling : rising, 2, NULL, 0};
        isogi_pyramid *pyramid = NULL;
        CHECK(isogi_vol_build(&pyramid, &v, &serial) == ISOGI_OK, "build");
        const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_TWO_SIDED, .bound = n / 2 == 1 ? 0.01 : 0,
                                     .jitter = n / 2 == 2};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel p = cast(dvr, eye, target, &lighting);
        CHECK(fabs((double)p.c[0] - 0.632) < 0.003, "way %d%s: radiance %g", n / 2, n % 2 ? ", negated" : "", (double)p.c[0]);
        isogi_dvr_free(dvr), isogi_vol_free(pyramid);
    }
}

TEST(shadows_fall_away_from_the_light) {
    field f = field_of(floor_and_roof, 24);
    const isogi_transfer_point points[] = {{0, {1, 1, 1}, 0}, {0.3, {1, 1, 1}, 0}, {1, {1, 1, 1}, 3}};
    const isogi_transfer transfer = {points, 3, NULL, 0};
    const isogi_light sun = {.vector = {0, 1, 0}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = 256, .grid = {12, 12, 12}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    isogi_dvr_step(dvr, 0, NULL);
    const double eye[3] = {11.5, 10, -40}, lit[3] = {4, 2.2, 6}, dark[3] = {19, 2.2, 6};
    pixel in_light = cast(dvr, eye, lit, &lighting), in_shadow = cast(dvr, eye, dark, &lighting);
    CHECK(in_light.c[3] > 0.9f && in_shadow.c[3] > 0.9f, "both hit the floor: %g %g", (double)in_light.c[3], (double)in_shadow.c[3]);
    CHECK(in_light.c[0] > 2 * in_shadow.c[0], "in the light %g, in the shadow %g", (double)in_light.c[0], (double)in_shadow.c[0]);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* ---- skipping and ending early ---- */

TEST(an_empty_scene_costs_next_to_nothing) {
    field f = field_waves(70, 2);
    const isogi_transfer_point beyond[] = {{1e3, {1, 1, 1}, 0}, {2e3, {1, 1, 1}, 5}};
    const isogi_transfer transfer = {beyond, 2, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {4, 4, 4}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    isogi_counters count = {0};
    test_random r = {4};
    isogi_view view = view_of(&f, 1, &r, 64);
    isogi_dvr_step(dvr, 0, NULL);
    isogi_dvr_counters(dvr, &count);
    CHECK(count.rays == 0 && count.samples == 0, "%d rays, %d samples", (int)count.rays, (int)count.samples);
    float(*image)[4] = picture(dvr, &view, &sky, NULL, &count);
    CHECK(count.samples == 0 && count.blocks == 0 && count.cells == 0, "%d samples, %d blocks", (int)count.samples, (int)count.blocks);
    for (int i = 0; i < 64 * 64; i++) CHECK(image[i][3] <= 0, "opacity %g", (double)image[i][3]);
    free(image);
    isogi_dvr_free(dvr);
    field_free(&f);
}

TEST(ending_early_errs_by_no_more_than_what_is_left) {
    field f = field_waves(24, 5);
    const isogi_transfer_point points[] = {{-1, {1, 0.2f, 0.1f}, 0}, {1, {0.3f, 1, 0.1f}, 1}};
    const isogi_peak peak = {0.1, {1, 1, 1}, 0.4f};
    const isogi_transfer transfer = {points, 2, &peak, 1};
    test_random r = {7};
    isogi_view view = view_of(&f, 1, &r, 32);
    float(*whole)[4] = NULL;
    const float opaque[4] = {1, 0, 0.9f, 0.5f};
    uint64_t samples[4];
    for (int i = 0; i < 4; i++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = opaque[i]};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        isogi_counters count = {0};
        float(*image)[4] = picture(dvr, &view, NULL, NULL, &count);
        samples[i] = count.samples;
        if (i) {
            double most = largest_difference(whole, image, 1024), bound = 1 - (opaque[i] > 0 ? (double)opaque[i] : 0.999);
            CHECK(most <= bound + 1e-6, "opaque %g: largest difference %g", (double)opaque[i], most);
            CHECK(samples[i] < samples[i - 1], "opaque %g: %d samples, not fewer than %d", (double)opaque[i], (int)samples[i],
                  (int)samples[i - 1]);
            free(image);
        } else whole = image;
        isogi_dvr_free(dvr);
    }
    free(whole);
    field_free(&f);
}

/* ---- determinism, budgets, failures ---- */

TEST(any_number_of_threads_and_any_slicing_gives_the_same_bits) {
    field f = field_waves(24, 6);
    const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.env = {.sh = sky_one, .sh_order = 1}, .lights = &sun, .light_count = 1};
    test_random r = {7};
    isogi_view view = view_of(&f, 1, &r, 40);
    const int threads[] = {1, 2, 3, 8};
    const uint64_t slices[] = {0, 1, 997, 5000};
    enum { POINTS = 7 * 6 * 5 };
    static float points[POINTS][3], visibility[2][POINTS][9];
    float(*first)[4] = NULL;
    isogi_counters work[4];
    memset(work, 0, sizeof work);
    for (int i = 0; i < POINTS; i++) /* of the grid */
        points[i][0] = (float)(i % 7) * 23 / 6, points[i][1] = (float)(i / 7 % 6) * 23 / 5, points[i][2] = (float)(i / 42) * 23 / 4;
    for (int i = 0; i < 4; i++) {
        const isogi_context context = {.threads = threads[i]};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {7, 6, 5}};
        isogi_dvr *dvr = dvr_new_with(&desc, &sparse, &context);
        double remaining = 1, last = 2;
        int calls = 0;
        for (; remaining > 0 && calls < 1000; calls++) {
            CHECK(isogi_dvr_step(dvr, slices[i], &remaining) == ISOGI_OK, "step");
            CHECK(remaining < last, "remaining %g after %g", remaining, last);
            last = remaining;
        }
        CHECK(calls == (slices[i] == 0 ? 1 : slices[i] == 1 ? 210 : slices[i] == 997 ? 14 : 3), "%d calls", calls);
        float(*image)[4] = picture(dvr, &view, &lighting, NULL, &work[i]);
        isogi_dvr_counters(dvr, &work[i]);
        CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, POINTS, visibility[i > 0][0]) == ISOGI_OK, "sample");
        if (i) {
            CHECK(!memcmp(image, first, 1600 * sizeof *image), "%d threads: pixels differ by %g", threads[i],
                  largest_difference(image, first, 1600));
            CHECK(!memcmp(visibility[1], visibility[0], sizeof visibility[0]), "%d threads: visibility differs", threads[i]);
            CHECK(!memcmp(&work[i], &work[0], sizeof work[0]), "%d threads: other counts", threads[i]);
            free(image);
        } else first = image;
        isogi_dvr_free(dvr);
    }
    free(first);
    field_free(&f);
}

typedef struct stop { int after, calls; double last; } stop;

static int stop_after(void *user, double fraction) {
    stop *s = (stop *)user;
    CHECK(fraction >= 0 && fraction <= 1 && fraction >= s->last, "progress %g after %g", fraction, s->last);
    s->last = fraction;
    return s->calls++ >= s->after;
}

TEST(cancelling_leaves_outputs_alone_and_stepping_goes_on) {
    field f = field_waves(24, 6);
    stop s = {0, 0, 0};
    /* one thread: with more, the others may have finished everything before the callback has its first turn */
    const isogi_context context = {.progress = stop_after, .user = &s, .threads = 1};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .directions = 2, .grid = {20, 20, 20}};
    isogi_dvr *dvr = dvr_new_with(&desc, &sparse, &context), *whole = dvr_new(&desc, &sparse);
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    const isogi_view view = {.width = 64, .height = 64, .eye = {60, 70, 80}, .target = {12, 12, 12}};
    static float image[64 * 64][4], depth[64 * 64];
    double remaining = 7;
    isogi_counters count = {0};
    isogi_result result;
    memset(image, 0x55, sizeof image), memset(depth, 0x55, sizeof depth);
    result = isogi_dvr_render(dvr, &view, &sky, image, depth, &count);
    CHECK(result == ISOGI_CANCELLED, "%s", isogi_result_string(result));
    for (size_t i = 0; i < sizeof image; i++) CHECK(((unsigned char *)image)[i] == 0x55, "byte %d of the picture is written", (int)i);
    for (size_t i = 0; i < sizeof depth; i++) CHECK(((unsigned char *)depth)[i] == 0x55, "byte %d of the depth is written", (int)i);
    CHECK(count.rays == 0, "%d rays counted", (int)count.rays);
    int cancelled = 0, calls = 0;
    do {
        s = (stop){calls ? 12 : 0, 0, 0}; /* each time soon: pieces become small enough to be done before */
        result = isogi_dvr_step(dvr, 0, &remaining);
        cancelled += result == ISOGI_CANCELLED;
        if (result == ISOGI_CANCELLED) CHECK(remaining >= 7, "remaining is written: %g", remaining);
    } while (result == ISOGI_CANCELLED && ++calls < 300);
    CHECK(result == ISOGI_OK && remaining <= 0 && cancelled > 0, "%s, remaining %g, cancelled %d times", isogi_result_string(result),
          remaining, cancelled);
    isogi_dvr_step(whole, 0, NULL);
    CHECK(cancelled > 4, "cancelled %d times", cancelled);
    for (int i = 0; i < 20 * 20 * 20; i++) {
        const float point[3] = {(float)(i % 20) * 23 / 19, (float)(i / 20 % 20) * 23 / 19, (float)(i / 400) * 23 / 19};
        float v[2];
        visibility_of(dvr, point, &v[0]), visibility_of(whole, point, &v[1]);
        CHECK(!memcmp(&v[0], &v[1], sizeof v[0]), "resumed visibility differs: %g, not %g", (double)v[0], (double)v[1]);
    }
    isogi_dvr_free(dvr), isogi_dvr_free(whole);
    field_free(&f);
}

SLOW_TEST(steps_that_are_always_cancelled_get_on) {
    const isogi_transfer_point points[] = {{-0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0.3f}};
    const isogi_transfer media = {points, 2, NULL, 0};
    field f = field_waves(40, 6);
    for (int method = 1; method < 4; method++) {
        stop s = {1 << 30, 0, 0}; /* the paper's method reads voxels when it is created */
        const isogi_context context = {.progress = stop_after, .user = &s, .threads = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .directions = 24,
            .grid = {14, 14, 14}, .method = (isogi_dvr_method)method};
        isogi_dvr *dvr = dvr_new_with(&desc, &media, &context), *whole = dvr_new(&desc, &media);
        isogi_result result = ISOGI_CANCELLED;
        int steps = 0, differ = 0;
        for (; result == ISOGI_CANCELLED && steps < 500; steps++) {
            s = (stop){method == 2 ? 40 : 12, 0, 0}; /* a direction of the paper's method alone takes 14, and what comes before it */
            result = isogi_dvr_step(dvr, 0, NULL);
        }
        CHECK(result == ISOGI_OK && steps > 2, "method %d: %s after %d steps", method, isogi_result_string(result), steps);
        isogi_dvr_step(whole, 0, NULL);
        for (int i = 0; i < 14 * 14 * 14; i++) {
            const float point[1][3] = {{3.0f * (float)(i % 14), 3.0f * (float)(i / 14 % 14), 3.0f * (float)(i / 196)}};
            float v[2][4];
            isogi_dvr_sample_visibility(dvr, point, 1, v[0]), isogi_dvr_sample_visibility(whole, point, 1, v[1]);
            differ += memcmp(v[0], v[1], sizeof v[0]) != 0;
        }
        CHECK(!differ, "method %d: visibility differs at %d points", method, differ);
        isogi_dvr_free(dvr), isogi_dvr_free(whole);
    }
    field_free(&f);
}

typedef struct scarce { int until, calls, live; size_t bytes; } scarce;

static void *scarce_alloc(void *user, size_t size, size_t align) {
    scarce *s = (scarce *)user;
    void *p = NULL;
    if (s->calls++ == s->until) return NULL;
    s->live++, s->bytes += size;
    return posix_memalign(&p, align, size) ? NULL : p;
}

static void scarce_release(void *user, void *p, size_t size) {
    scarce *s = (scarce *)user;
    s->live--, s->bytes -= size;
    free(p);
}

TEST(every_allocation_may_fail) {
    field f = field_waves(8, 6);
    const isogi_light sun = {.kind = ISOGI_LIGHT_POINT, .vector = {100, 1, 1}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.env = {.sh = sky_one, .sh_order = 1}, .lights = &sun, .light_count = 1};
    const isogi_view view = {.width = 5, .height = 4, .eye = {60, 70, 80}};
    for (int shading = 0; shading < 3; shading++)
        for (int k = 0;; k++) {
            scarce s = {k, 0, 0, 0};
            const isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &s, .threads = 1};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = (isogi_dvr_shading)shading, .grid = {2, 2, 2}, .directions = 8};
            isogi_dvr *dvr = NULL;
            float image[20][4] = {{0}}, depth[20] = {0};
            double remaining = 9;
            isogi_result created = isogi_dvr_create(&dvr, &desc, &context), set = ISOGI_OK, stepped = ISOGI_OK, rendered = ISOGI_OK;
            CHECK(created == ISOGI_OK || (created == ISOGI_NO_MEMORY && !dvr), "create %d: %s", k, isogi_result_string(created));
            if (dvr) {
                set = isogi_dvr_set_transfer(dvr, &sparse);
                stepped = isogi_dvr_step(dvr, 0, &remaining);
                if (stepped != ISOGI_OK) CHECK(remaining >= 9, "remaining is written");
                rendered = isogi_dvr_render(dvr, &view, &lighting, image, depth, NULL);
                for (int i = 0; i < 20 && set != ISOGI_OK; i++) /* without one nothing is seen */
                    CHECK(!(image[i][3] > 0), "a transfer function that failed is in place: opacity %g", (double)image[i][3]);
                isogi_dvr_free(dvr);
            }
            int failed = (created != ISOGI_OK) + (set != ISOGI_OK) + (stepped != ISOGI_OK) + (rendered != ISOGI_OK);
            CHECK(failed == (s.calls > k), "allocation %d: %d calls failed", k, failed);
            CHECK(s.live == 0 && s.bytes == 0, "allocation %d: %d blocks, %d bytes left", k, s.live, (int)s.bytes);
            if (s.calls <= k) {
                CHECK(k > 3, "only %d allocations", k);
                break;
            }
        }
    field_free(&f);
}

/* A renderer's life by the paper's method, call by call; the planes are two, then others, then none. */
enum { LIFE = 11 };
static isogi_result live(isogi_dvr **dvr, int call, const isogi_dvr_desc *desc, const isogi_context *context) {
    static const double planes[3][4] = {{1, 0.5, 0, -3}, {0, -1, 0.2, 6}, {0.3, 0, -1, 5}};
    static const isogi_transfer_point p[2][3] = {{{-0.2, {1, 1, 1}, 0}, {0.1, {1, 0.2f, 1}, 0.3f}, {1, {0.3f, 1, 1}, 0.4f}},
                                                 {{-0.2, {1, 1, 1}, 0}, {0.1, {1, 0.2f, 0.1f}, 0.1f}, {1, {0.3f, 1, 1}, 0.9f}}};
    const isogi_transfer transfer[2] = {{p[0], 3, NULL, 0}, {p[1], 3, NULL, 0}};
    switch (call) {
    case 0: return isogi_dvr_create(dvr, desc, context);
    case 1: return isogi_dvr_set_transfer(*dvr, &transfer[0]);
    case 2: return isogi_dvr_step(*dvr, 1500, NULL); /* some of it */
    case 4: return isogi_dvr_set_clip(*dvr, planes, 2);
    case 6: return isogi_dvr_set_transfer(*dvr, &transfer[1]);
    case 8: return isogi_dvr_set_clip(*dvr, planes + 1, 2);
    case 9: return isogi_dvr_set_clip(*dvr, NULL, 0);
    default: return isogi_dvr_step(*dvr, 0, NULL);
    }
}

/* Functions and planes: what fails of these changes nothing. */
static int is_change(int call) { return call == 1 || call == 4 || call == 6 || call == 8 || call == 9; }

/* What is seen of it: visibility, local and global, the data of its blocks, a picture. Takes no part in what fails. */
typedef struct seen { float visibility[27][9], local[27][9], values[27], image[30][4]; } seen;
static void look_at(const isogi_dvr *dvr, scarce *memory, seen *s) {
    const isogi_lighting lighting = {.env = {.sh = sky_one, .sh_order = 1}};
    const isogi_view view = {.width = 6, .height = 5, .eye = {60, 70, 80}, .target = {9, 4, 4}};
    const scarce was = *memory;
    float at[27][3];
    for (int i = 0; i < 81; i++) at[i / 3][i % 3] = (float)(i % 3 == 0 ? i / 3 % 3 : i % 3 == 1 ? i / 9 % 3 : i / 27) * 4.3f;
    memset(s, 0, sizeof *s), memory->until = -1;
    CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, 27, s->visibility[0]) == ISOGI_OK &&
              isogi_dvr_sample_blocks(dvr, (const float(*)[3])at, 27, s->values, s->local[0]) == ISOGI_OK &&
              isogi_dvr_render(dvr, &view, &lighting, s->image, NULL, NULL) == ISOGI_OK,
          "look");
    *memory = was;
}

/* Each allocation of each of these calls fails once: that call alone says so. Where it is not a step nothing that is seen changes; the same
   call then works, and in the end all is seen as if nothing had failed, bit by bit. */
TEST(every_allocation_of_the_papers_method_may_fail) {
    static seen expected[LIFE], before, after;
    field f = field_new(20, 9, 10);
    test_random r = {14};
    int failed[LIFE] = {0};
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_range(&r, -0.3, 0.6) + 0.02 * (double)(i % 20);
    field_build(&f);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .grid = {3, 3, 3},
        .directions = 8, .radius = 6, .reduction = 3};
    for (int k = -1, more = 1; more; k++) {
        scarce s = {k, 0, 0, 0};
        const isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &s, .threads = 1};
        isogi_dvr *dvr = NULL;
        for (int call = 0; call < LIFE; call++) {
            isogi_result result = live(&dvr, call, &desc, &context);
            if (result != ISOGI_OK) {
                CHECK(result == ISOGI_NO_MEMORY && (call || !dvr), "allocation %d, call %d: %s", k, call, isogi_result_string(result));
                if (is_change(call)) look_at(dvr, &s, &after);
                CHECK(!is_change(call) || !memcmp(&before, &after, sizeof after), "allocation %d, call %d: half of it shows", k, call);
                result = live(&dvr, call, &desc, &context);
                CHECK(result == ISOGI_OK, "allocation %d, call %d again: %s", k, call, isogi_result_string(result));
                failed[call]++;
            }
            if (k < 0 || is_change(call + 1)) look_at(dvr, &s, k < 0 ? &expected[call] : &before);
            CHECK(k < 0 || !is_change(call + 1) || !memcmp(&before, &expected[call], sizeof before), "allocation %d, call %d: other bits",
                  k, call);
        }
        look_at(dvr, &s, &after);
        CHECK(!memcmp(&after, &expected[LIFE - 1], sizeof after), "allocation %d: other bits in the end", k);
        more = k < 0 || s.calls > k;
        isogi_dvr_free(dvr);
        CHECK(s.live == 0 && s.bytes == 0, "allocation %d: %d blocks, %d bytes left", k, s.live, (int)s.bytes);
    }
    for (int call = 0; call < LIFE; call++)
        CHECK(failed[call] >= (call == 9 ? 0 : call == 4 || call == 8 ? 1 : 3), "call %d failed %d times", call, failed[call]);
    field_free(&f);
}

/* Steps that fail here and there, with each method, before and after edits of the function: what remains falls all the same. */
TEST(what_remains_does_not_grow_when_memory_runs_out) {
    field f = field_waves(40, 11);
    for (int method = 0; method <= ISOGI_DVR_SWEEP; method++) {
        scarce s = {-1, 0, 0, 0};
        const isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &s, .threads = 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
            .grid = {4, 4, 4}, .directions = 20};
        isogi_transfer_point p[2] = {{0, {1, 1, 1}, 0.1f}, {1, {1, 1, 1}, 0.2f}};
        const isogi_transfer transfer = {p, 2, NULL, 0};
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        int failed = 0;
        for (int edit = 0; edit < 3; edit++) { /* the second keeps the classes of values, the third moves them */
            double remaining = 1, last = 2;
            p[1].extinction += 0.1f, p[0].value = edit == 2 ? 0.5 : 0;
            CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
            for (int i = 0; i < 3000 && remaining > 0; i++) {
                s.until = i % 3 == 2 ? s.calls + i % 5 : -1;
                isogi_result result = isogi_dvr_step(dvr, 1 + 100 * (uint64_t)(i % 7), &remaining);
                failed += result == ISOGI_NO_MEMORY;
                CHECK(result == ISOGI_NO_MEMORY || result == ISOGI_OK, "step: %s", isogi_result_string(result));
                CHECK(remaining < last || (result != ISOGI_OK && remaining <= last), "method %d, edit %d, step %d: %g after %g (%d failed)",
                      method, edit, i, remaining, last, failed);
                last = remaining;
            }
            CHECK(!(remaining > 0), "method %d, edit %d: %g left", method, edit, remaining);
        }
        CHECK(failed > 0, "method %d: no step failed", method);
        s.until = -1, isogi_dvr_free(dvr);
        CHECK(s.live == 0 && s.bytes == 0, "%d blocks left", s.live);
    }
    field_free(&f);
}

TEST(bad_input_is_refused) {
    field f = field_waves(6, 1);
    isogi_dvr *dvr = NULL;
    isogi_dvr_desc good = {.pyramid = f.pyramid}, bad;
    CHECK(isogi_dvr_create(NULL, &good, NULL) == ISOGI_INVALID && isogi_dvr_create(&dvr, NULL, NULL) == ISOGI_INVALID, "NULL");
#define REFUSED(change, code)                                                                                                  \
    bad = good, bad.change;                                                                                                    \
    CHECK(isogi_dvr_create(&dvr, &bad, NULL) == code && !dvr, #change);                                                        \
    CHECK(code != ISOGI_INVALID || fault_names(isogi_dvr_fault(&bad), #change), "%s: %s", #change, isogi_dvr_fault(&bad))
    REFUSED(pyramid = NULL, ISOGI_INVALID);
    REFUSED(space = (isogi_dvr_space)2, ISOGI_INVALID);
    REFUSED(shading = (isogi_dvr_shading)4, ISOGI_INVALID);
    REFUSED(unit = (double)NAN, ISOGI_INVALID);
    REFUSED(unit = -1, ISOGI_INVALID);
    REFUSED(step = (double)INFINITY, ISOGI_INVALID);
    REFUSED(step = 1e-9, ISOGI_INVALID);
    REFUSED(visibility_step = -1, ISOGI_INVALID);
    REFUSED(order = 7, ISOGI_INVALID);
    REFUSED(order = -1, ISOGI_INVALID);
    REFUSED(directions = 65537, ISOGI_INVALID);
    REFUSED(opaque = 1.5f, ISOGI_INVALID);
    REFUSED(opaque = NAN, ISOGI_INVALID);
    REFUSED(grid[1] = SIZE_MAX, ISOGI_TOO_LARGE);
    good.shading = ISOGI_DVR_VISIBILITY;
    REFUSED(grid[0] = bad.grid[1] = bad.grid[2] = 0x7fffffff, ISOGI_TOO_LARGE);
    CHECK(isogi_dvr_create(&dvr, &good, &serial) == ISOGI_OK && !isogi_dvr_fault(&good) && isogi_dvr_fault(NULL), "the good one");

    isogi_transfer_point points[2] = {{0, {1, 1, 1}, 1}, {1, {1, 1, 1}, 1}}, kept = points[1];
    isogi_peak peaks[257] = {{0, {1, 1, 1}, 0.5f}}, peak = peaks[0];
    isogi_transfer t = {points, 2, peaks, 1};
    CHECK(isogi_dvr_set_transfer(dvr, &t) == ISOGI_OK && !isogi_transfer_fault(&t), "the good one");
#define WRONG(part, whole, change)                                                                                             \
    part = whole, part.change; CHECK(isogi_dvr_set_transfer(dvr, &t) == ISOGI_INVALID, #change);                               \
    CHECK(fault_names(isogi_transfer_fault(&t), #change), "%s: %s", #change, isogi_transfer_fault(&t)); part = whole
    WRONG(points[1], kept, value = -1);
    WRONG(points[1], kept, value = (double)NAN);
    WRONG(points[1], kept, value = (double)INFINITY);
    WRONG(points[1], kept, extinction = -1);
    WRONG(points[1], kept, extinction = INFINITY);
    WRONG(points[1], kept, rgb[2] = NAN);
    WRONG(points[1], kept, rgb[0] = -0.1f);
    WRONG(peaks[0], peak, isovalue = (double)NAN);
    WRONG(peaks[0], peak, opacity = 1.01f);
    WRONG(peaks[0], peak, opacity = NAN);
    WRONG(peaks[0], peak, rgb[1] = -1);
    t.peak_count = 257;
    CHECK(isogi_dvr_set_transfer(dvr, &t) == ISOGI_TOO_LARGE, "257 peaks");
    t.peak_count = 1, t.points = NULL;
    CHECK(isogi_dvr_set_transfer(dvr, &t) == ISOGI_INVALID && isogi_dvr_set_transfer(dvr, NULL) == ISOGI_INVALID, "NULL points");
    CHECK(isogi_dvr_set_transfer(NULL, &t) == ISOGI_INVALID, "NULL renderer");

    float image[4][4], v[9];
    const isogi_lighting dark = {{NULL, 0, 0, NULL, 0, {0}}, NULL, 0};
    const isogi_view fine = {.width = 2, .height = 2, .eye = {9, 9, 9}};
    isogi_view view;
    CHECK(isogi_dvr_render(dvr, &fine, &dark, image, NULL, NULL) == ISOGI_OK && image[0][3] > 0.5f, "the good one stays: opacity %g",
          (double)image[0][3]);
#define UNSEEN(change, code)                                                                                                   \
    view = fine, view.change; CHECK(isogi_dvr_render(dvr, &view, &dark, image, NULL, NULL) == code, #change);                  \
    CHECK(fault_names(isogi_view_fault(&view), #change), "%s: %s", #change, isogi_view_fault(&view))
    UNSEEN(width = 0, ISOGI_INVALID);
    UNSEEN(height = -5, ISOGI_INVALID);
    UNSEEN(width = 40000, ISOGI_TOO_LARGE);
    UNSEEN(eye[1] = NAN, ISOGI_INVALID);
    UNSEEN(target[0] = INFINITY, ISOGI_INVALID);
    UNSEEN(fov = 180, ISOGI_INVALID);
    UNSEEN(fov = -1, ISOGI_INVALID);
    UNSEEN(up[2] = NAN, ISOGI_INVALID);
    CHECK(isogi_dvr_render(dvr, &fine, NULL, image, NULL, NULL) == ISOGI_INVALID, "no lighting while lit");
    CHECK(isogi_dvr_render(dvr, NULL, &dark, image, NULL, NULL) == ISOGI_INVALID && isogi_view_fault(NULL), "no view");
    CHECK(!isogi_view_fault(&fine), "nothing is wrong with it");
    CHECK(isogi_dvr_render(NULL, &fine, &dark, image, NULL, NULL) == ISOGI_INVALID, "no renderer");
    CHECK(isogi_dvr_render(dvr, &fine, &dark, NULL, NULL, NULL) == ISOGI_INVALID, "no picture");
    CHECK(isogi_dvr_render(dvr, &fine, &dark, image, NULL, NULL) == ISOGI_OK, "the good one");
    CHECK(isogi_dvr_step(NULL, 0, NULL) == ISOGI_INVALID && isogi_dvr_sample_visibility(dvr, NULL, 1, v) == ISOGI_INVALID, "NULL");
    CHECK(isogi_dvr_sample_visibility(dvr, NULL, 0, NULL) == ISOGI_OK, "no points");
    isogi_dvr_counters(NULL, NULL), isogi_dvr_counters(dvr, NULL), isogi_dvr_free(NULL);
    isogi_dvr_free(dvr);
    good.shading = ISOGI_DVR_UNLIT, dvr = NULL;
    CHECK(isogi_dvr_create(&dvr, &good, &serial) == ISOGI_OK, "unlit");
    double remaining = 1;
    CHECK(isogi_dvr_sample_visibility(dvr, &fine.eye, 1, v) == ISOGI_INVALID, "no visibility when unlit");
    CHECK(isogi_dvr_step(dvr, 0, &remaining) == ISOGI_OK && remaining <= 0, "nothing to step when unlit: %g", remaining);
    isogi_dvr_free(dvr);
    /* one sample a voxel of the finest axis, and an axis a billion times as long */
    isogi_vol_free(f.pyramid);
    f.volume.spacing[1] = 1e9, f.volume.spacing[0] = f.volume.spacing[2] = 1;
    field_build(&f);
    good.pyramid = f.pyramid, dvr = NULL;
    CHECK(isogi_dvr_create(&dvr, &good, NULL) == ISOGI_TOO_LARGE && !dvr, "too many samples on a ray");
    field_free(&f);
}

/* Element i of a volume of a type, from one of the values that all types hold. */
static void voxel_write(isogi_type type, void *data, size_t i, int value) {
    if (type == ISOGI_U8) ((uint8_t *)data)[i] = (uint8_t)value;
    if (type == ISOGI_I8) ((int8_t *)data)[i] = (int8_t)value;
    if (type == ISOGI_U16) ((uint16_t *)data)[i] = (uint16_t)value;
    if (type == ISOGI_I16) ((int16_t *)data)[i] = (int16_t)value;
    if (type == ISOGI_F32) ((float *)data)[i] = (float)value;
    if (type == ISOGI_F64) ((double *)data)[i] = value;
}

/* The same values as voxels of every type, in memory from either end, and upside down with a scale below 0: one picture, lit and unlit, in
   both spaces, and one visibility by each method. */
TEST(the_type_of_voxels_does_not_show) {
    enum { SIDE = 19, COUNT = SIDE * SIDE * SIDE, PIXELS = 40 * 40 };
    static const char *const names[6] = {"float", "double", "uint8", "int8", "uint16", "int16"};
    static const isogi_type types[6] = {ISOGI_F32, ISOGI_F64, ISOGI_U8, ISOGI_I8, ISOGI_U16, ISOGI_I16};
    static double room[COUNT];
    static float visibility[2][8][9];
    const isogi_transfer even = {hills, 6, NULL, 0}; /* without peaks, which make all methods brute force: pre-integrated,
                                                             by differences of integrals, which round more */
    float points[8][3];
    const isogi_light sun = {.vector = {1, 1, 1}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.env = {.sh = sky_one, .sh_order = 1}, .lights = &sun, .light_count = 1};
    field f = field_waves(SIDE, 6); /* for its view */
    test_random r = {7};
    const isogi_view view = view_of(&f, 1, &r, 40);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) points[i][a] = 4.5f * (float)(1 + (i >> a & 1));
    for (int way = 0; way < 7; way++) { /* space, shading; then methods */
        float(*first)[4] = NULL;
        for (int n = 0; n < 6 * 3; n += n < 6 || LONG_SUITE ? 1 : 5) {
            const isogi_type type = types[n % 6];
            const int reversed = n / 6 == 1, upside_down = n / 6 == 2, at = reversed ? COUNT - 1 : 0, step = reversed ? -1 : 1;
            const int least = type == ISOGI_I8 || type == ISOGI_I16 ? -64 : 0;
            const ptrdiff_t bytes = type == ISOGI_F64 ? 8 : type == ISOGI_F32 ? 4 : type == ISOGI_U8 || type == ISOGI_I8 ? 1 : 2;
            isogi_volume volume = {.type = type, .size = {SIDE, SIDE, SIDE}, .scale = upside_down ? -0.015625 : 0.015625};
            isogi_pyramid *pyramid = NULL;
            volume.bias = (upside_down ? 0.984375 : -1) - least * volume.scale;
            for (int i = 0; i < COUNT; i++) {
                const int value = (int)(63.5 + 50 * fmax(-1, fmin(1, f.value[i])));
                voxel_write(type, room, (size_t)(at + step * i), (upside_down ? 127 - value : value) + least);
            }
            volume.data = (const char *)room + at * bytes;
            for (int a = 0, stride = step; a < 3; a++, stride *= SIDE) volume.stride[a] = stride * bytes;
            CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
            const isogi_dvr_desc desc = {.pyramid = pyramid, .space = way < 4 && way % 2 ? ISOGI_DVR_DATA : ISOGI_DVR_PHYSICAL,
                                         .shading = way < 2 ? ISOGI_DVR_UNLIT : way == 2 ? ISOGI_DVR_LOCAL : ISOGI_DVR_VISIBILITY,
                                         .method = way == 5   ? ISOGI_DVR_PAPER
                                                   : way == 6 ? ISOGI_DVR_BRUTE
                                                              : ISOGI_DVR_METHOD_DEFAULT,
                                         .grid = {7, 6, 5}};
            isogi_dvr *dvr = dvr_new(&desc, way < 4 ? &landscape : &even);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            float(*image)[4] = picture(dvr, &view, &lighting, NULL, NULL);
            if (desc.shading == ISOGI_DVR_VISIBILITY)
                CHECK(isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, 8, visibility[n > 0][0]) == ISOGI_OK, "sample");
            if (n) {
                double most = largest_difference(image, first, PIXELS), brightest = 0;
                for (int i = 0; i < 4 * PIXELS; i++) brightest = fmax(brightest, (double)first[i / 4][i % 4]);
                most /= brightest;
                CHECK(brightest > 0.5 && most < (way < 4 ? 2e-5 : 5e-5), "way %d, %s%s%s: pixels differ by %g of %g", way, names[n % 6],
                      reversed ? ", reversed" : "", upside_down ? ", upside down" : "", most, brightest);
                for (int i = 0; i < 8 * 9 && desc.shading == ISOGI_DVR_VISIBILITY; i++) {
                    const float *now = visibility[1][i / 9], *then = visibility[0][i / 9];
                    CHECK(fabsf(now[i % 9] - then[i % 9]) < 1e-5f, "way %d, %s: visibility %g, not %g", way, names[n % 6],
                          (double)now[i % 9], (double)then[i % 9]);
                }
                free(image);
            } else first = image;
            isogi_dvr_free(dvr), isogi_vol_free(pyramid);
        }
        free(first);
    }
    field_free(&f);
}

TEST(cells_that_are_not_finite_are_transparent) {
    const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    for (int n = 0; n < 3; n++)
        for (int space = 0; space < 2; space++) {
            slope_direction[0] = 1, slope_direction[1] = slope_direction[2] = 0;
            field f = field_of(linear, 11);
            isogi_vol_free(f.pyramid);
            *field_at(&f, 5, 5, 5) = bad[n];
            field_build(&f);
            const isogi_transfer_point point = {0, {1, 1, 1}, 1};
            const isogi_transfer transfer = {&point, 1, NULL, 0};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .space = (isogi_dvr_space)space, .classification = space
                ? ISOGI_DVR_EXACT : ISOGI_DVR_POST_CLASSIFIED};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const double eye[3] = {-5, 5.5, 4.5}, target[3] = {5, 5.5, 4.5};
            pixel p = cast(dvr, eye, target, NULL);
            double expected = -expm1(space ? -0.8 : -8); /* two cells of ten are left out */
            CHECK(fabs((double)p.c[3] - expected) < 1e-6 && fabs((double)p.c[0] - expected) < 1e-6, "space %d: %g, not %g", space,
                  (double)p.c[3], expected);
            isogi_dvr_free(dvr);
            field_free(&f);
        }
}

TEST(odd_volumes_and_extinctions_are_defined) {
    const int sizes[][3] = {{1, 1, 1}, {1, 9, 9}, {9, 1, 9}, {9, 9, 1}, {2, 1, 1}, {2, 2, 2}, {65, 2, 2}};
    const double values[] = {0, 1, 1e30, 1e308, -1e308, 5e-324};
    const float extinctions[] = {0, 1e-9f, 1, 1e6f, 3e38f};
    test_random r = {1};
    for (int s = 0; s < 7; s++)
        for (int v = 0; v < 6; v++)
            for (int e = 0; e < 5; e++) {
                field f = field_new(sizes[s][0], sizes[s][1], sizes[s][2]);
                for (int i = 0; i < sizes[s][0] * sizes[s][1] * sizes[s][2]; i++) f.value[i] = i % 3 ? values[v] : -values[v];
                field_build(&f);
                const isogi_transfer_point points[] = {
                    {-1e308, {1, 1, 1}, extinctions[e]}, {0, {1, 1, 1}, 0}, {1e308, {0, 1, 1}, extinctions[e]}};
                const isogi_peak peak = {0.25 * values[v], {1, 1, 1}, 0.5f};
                const isogi_transfer transfer = {points, 3, &peak, 1};
                const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
                for (int shading = 0; shading < 3; shading++) {
                    const isogi_dvr_desc desc = {.pyramid = f.pyramid,
                                                 .space = (isogi_dvr_space)((s + e) % 2),
                                                 .shading = (isogi_dvr_shading)shading,
                                                 .directions = 9};
                    isogi_dvr *dvr = dvr_new(&desc, &transfer);
                    isogi_view view = {.width = 6, .height = 6, .eye = {20, 30, 40}, .target = {0.5f, 0.5f, 0.5f}, .fov = 20};
                    float(*image)[4], depth[36];
                    if (r.state % 2) view.eye[1] = 0.5f;
                    isogi_dvr_step(dvr, 0, NULL);
                    image = picture(dvr, &view, &sky, depth, NULL);
                    for (int i = 0; i < 36; i++) {
                        for (int a = 0; a < 4; a++)
                            CHECK(image[i][a] >= 0 && image[i][a] < 1.5f, "size %d value %g: pixel %g", s, values[v], (double)image[i][a]);
                        CHECK(image[i][3] > 0 ? depth[i] > 0 && depth[i] < 100 : depth[i] > 1e30f, "opacity %g, depth %g",
                              (double)image[i][3], (double)depth[i]);
                        if (s < 5) CHECK(image[i][3] <= 0, "a box without volume has opacity %g", (double)image[i][3]);
                    }
                    free(image);
                    isogi_dvr_free(dvr);
                }
                field_free(&f);
            }
}

/* A ray within the plane of a volume of one slice meets its voxels. */
TEST(a_ray_within_a_flat_volume_samples_it) {
    field f = field_new(9, 9, 1);
    for (int i = 0; i < 81; i++) f.value[i] = 1;
    field_build(&f);
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.25f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = f.pyramid};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    const double eye[3] = {-5, 4, 0}, target[3] = {5, 4, 0};
    pixel p = cast(dvr, eye, target, NULL);
    CHECK(fabs((double)p.c[3] - -expm1(-2)) < 1e-6, "opacity %g, not %g", (double)p.c[3], -expm1(-2));
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* ---- cameras ---- */

TEST(a_view_covers_its_angle_with_up_on_top) {
    const isogi_view view = {.width = 40, .height = 20, .eye = {1, 2, 3}, .target = {1, 2, -7}, .fov = 60};
    double origin[3];
    float dir[3];
    isogi_view_ray(&view, 19.5, 9.5, origin, dir);
    CHECK(fabsf(dir[0]) < 1e-6f && fabsf(dir[1]) < 1e-6f && fabsf(dir[2] + 1) < 1e-6f, "centre %g %g %g", (double)dir[0], (double)dir[1],
          (double)dir[2]);
    CHECK(fabs(origin[0] - 1) + fabs(origin[1] - 2) + fabs(origin[2] - 3) < 1e-12, "origin");
    isogi_view_ray(&view, 19.5, -0.5, origin, dir);
    CHECK(fabs(atan2((double)dir[1], -(double)dir[2]) - PI / 6) < 1e-6, "top border at %g",
          atan2((double)dir[1], -(double)dir[2]) * 180 / PI);
    isogi_view_ray(&view, 39.5, 9.5, origin, dir);
    CHECK(fabs((double)dir[0] / -(double)dir[2] - 2 * tan(PI / 6)) < 1e-6, "right border at %g", (double)dir[0] / -(double)dir[2]);
    isogi_view odd = view; /* up along the line of sight, and no line of sight: still a unit vector */
    odd.target[0] = 1, odd.target[1] = -9, odd.target[2] = 3;
    for (int i = 0; i < 2; i++) {
        isogi_view_ray(&odd, 3, 4, origin, dir);
        CHECK(fabsf(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2] - 1) < 1e-5f, "length of %g %g %g", (double)dir[0], (double)dir[1],
              (double)dir[2]);
        memcpy(odd.target, odd.eye, sizeof odd.eye);
    }
}

/* ---- real data ---- */

TEST(engine_under_its_transfer_function_is_lit_and_shadowed) {
    char *path = test_data("engine_256x256x128_uint8.raw");
    if (!path) SKIP("ISOGI_DATA has no engine");
    size_t bytes = 256 * 256 * 128;
    uint8_t *data = (uint8_t *)malloc(bytes);
    FILE *file = fopen(path, "rb");
    CHECK(file && fread(data, 1, bytes, file) == bytes, "%s", path);
    if (file) fclose(file);
    free(path);
    const isogi_volume volume = {.data = data, .type = ISOGI_U8, .size = {256, 256, 128}};
    const isogi_transfer_point points[] = {{0, {.8f, .8f, .8f}, 0},       {70, {.8f, .8f, .8f}, 0},     {100, {.8f, .8f, .8f}, 0.02f},
                                           {150, {.8f, .8f, .8f}, 0.05f}, {180, {1, .7f, .3f}, 0.4f}, {255, {1, .6f, .2f}, 0.8f}};
    const isogi_transfer transfer = {points, 6, NULL, 0};
    isogi_pyramid *pyramid = NULL;
    const isogi_context all = {0};
    CHECK(isogi_vol_build(&pyramid, &volume, &all) == ISOGI_OK, "build");
    const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = 32, .grid = {16, 16, 8}};
    isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &all);
    const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};
    const isogi_view view = {.width = 64, .height = 64, .eye = {400, 340, 470}, .target = {127.5f, 127.5f, 63.5f}};
    isogi_counters count = {0};
    float(*unshadowed)[4] = picture(dvr, &view, &sky, NULL, &count);
    isogi_dvr_step(dvr, 0, NULL);
    float(*shadowed)[4] = picture(dvr, &view, &sky, NULL, NULL);
    double bright = 0, dark = 0, opacity = 0;
    for (int i = 0; i < 64 * 64; i++) {
        bright += (double)unshadowed[i][1], dark += (double)shadowed[i][1], opacity += (double)shadowed[i][3];
        /* V exceeds 1 nowhere, but the weights' overshoot at rims */
        CHECK(shadowed[i][1] <= unshadowed[i][1] + 1e-4f, "pixel %d: %g brighter than without shadows, %g", i, (double)shadowed[i][1],
              (double)unshadowed[i][1]);
    }
    CHECK(dark > 0.2 * bright && dark < 0.9 * bright && opacity > 400, "sums: %g without, %g with shadows, opacity %g", bright, dark,
          opacity);
    CHECK(count.blocks_skipped > 4000 && count.samples < 500000, "%d samples, %d blocks skipped", (int)count.samples,
          (int)count.blocks_skipped);
    free(unshadowed), free(shadowed);
    isogi_dvr_free(dvr);
    isogi_vol_free(pyramid);
    free(data);
}

TEST_MAIN("dvr")
