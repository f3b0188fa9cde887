/* Scenes that strain isogi_trace.h: endless light, suns beside near darkness, volumes and lattices of next to nothing, noise, NaN.
   FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

/* Bakes the whole texture, in steps that all bring it further; the values that lookups find anywhere. */
static isogi_trace_report baked(const isogi_trace_desc *d, double *least, double *most) {
    isogi_trace *t = NULL;
    isogi_trace_report report = {0};
    test_random r = {1};
    double remaining = 1;
    const isogi_volume *v = isogi_vol_volume(d->pyramid);
    isogi_result result = isogi_trace_create(&t, d, NULL);
    CHECK(result == ISOGI_OK, "create: %s", isogi_result_string(result));
    for (int step = 0; remaining > 0 && result == ISOGI_OK; step++) {
        result = isogi_trace_step(t, 100000, &remaining);
        CHECK(step < 10000, "%d steps, and %g remain", step, remaining);
        if (step >= 10000) break;
    }
    CHECK(result == ISOGI_OK && remaining <= 0, "step: %s", isogi_result_string(result));
    isogi_trace_status(t, &report);
    *least = 1e30, *most = -1e30;
    for (int i = 0; i < 200; i++) {
        float p[1][3], e[1][3];
        for (int a = 0; a < 3; a++) p[0][a] = (float)random_range(&r, -1, (double)v->size[a]);
        CHECK(isogi_trace_sample(t, (const float(*)[3])p, 1, e, NULL) == ISOGI_OK, "point %d", i);
        for (int c = 0; c < 3; c++) *least = fmin(*least, (double)e[0][c]), *most = fmax(*most, (double)e[0][c]);
        if (!(e[0][0] >= 0 && e[0][0] < 1e30f)) *most = 1e31; /* NaN too */
    }
    isogi_trace_free(t);
    return report;
}

/* A white closed cavity that glows: its light grows without end, the same step for every reflection. Either method ends after a bounded
   number of
   rays, and says that the numbers mean nothing; paths by errors as large as the light. */
TEST(white_closed_glowing_cavity_says_so_in_bounded_time) {
    double q[5] = {9.5, 9.5, 9.5, 4, 9}, least, most;
    scene s = scene_make(20, 20, 20, NULL, shell, q);
    isogi_albedo_point glow[1] = {{0, {1, 1, 1}}};
    for (int method = 0; method < 2; method++) {
        isogi_trace_desc d = desc_make(&s, 1, -1, 4);
        isogi_trace_report report;
        memset(&d.lighting, 0, sizeof d.lighting);
        d.method = (isogi_trace_method)method, d.emission_points = glow, d.emission_count = 1, d.isovalue_min = -0.02,
        d.isovalue_max = 0.02;
        if (method) d.lazy = 1, d.samples = 2; /* a path of 10000 reflections costs as many rays: a few texels show it */
        if (!method) {
            report = baked(&d, &least, &most);
            CHECK(report.diverges && report.worst > 1e30 && most < 1e30, "diverges %d, worst error %g, light up to %g", report.diverges,
                  report.worst, most);
        } else {
            isogi_trace *t = NULL;
            float p[1][3] = {{13.5f, 9.5f, 9.5f}}, e[1][3], error[1];
            isogi_counters counters = {0};
            isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])p, 1);
            CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "method %d", method);
            isogi_trace_sample(t, (const float(*)[3])p, 1, e, error), isogi_trace_counters(t, &counters);
            CHECK(counters.rays <= 10001u * 2 * 8, "%g rays", (double)counters.rays);
            CHECK(e[0][0] > 100 && e[0][0] < 1e6f && error[0] > 0.05f * e[0][0], "E %g, error %g", (double)e[0][0], (double)error[0]);
            isogi_trace_free(t);
        }
    }
    scene_free(&s);
}

/* A sun of radiance 1e6, as one pixel of an image whose rest is 1e-3: what it lights is lit the same everywhere, and what it does not light
   holds the sky's light alone: no firefly, on texels or between. A pit whose floor is partly shaded, reflections and all; the brightest
   value that a diffuse surface can get is that of facing the sun, over 1 - albedo. Two seeds differ by less than .15 of the sun's light
   (rms over 200 points; 1.4 where the sun is found by chance), and no point by more than six times as much. */
TEST(sun_of_a_million_beside_a_dark_sky) {
    enum { W = 64, H = 32 };
    static float image[H][W][3];
    double q[5] = {16, 15, 16, 20, 9}, solid = 2 * PI / W * (cos(9 * PI / H) - cos(10 * PI / H));
    scene s = scene_make(33, 33, 33, NULL, pit, q);
    for (int i = 0; i < W * H * 3; i++) (&image[0][0][0])[i] = 1e-3f;
    for (int c = 0; c < 3; c++) image[9][20][c] = 1e6f;
    for (int method = 0; method < 2; method++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 3, LONG_SUITE ? 64 : 16);
        float points[200][3], e[200][3], other[200][3], error[200];
        double rms = 0, worst = 0;
        int n = surface_points(&s, 0, 200, 5, points), shaded = 0, lit_by_sun = 0;
        isogi_trace *t = NULL;
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = W, d.lighting.env.height = H, d.lazy = 1,
        d.method = (isogi_trace_method)method;
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
        double full = 1e6 * solid;
        for (int i = 0; i < n; i++) {
            CHECK(e[i][0] >= 0 && (double)e[i][0] < 1.3 * full / (1 - 0.5), "method %d: firefly of %g, the sun brings %g", method,
                  (double)e[i][0], full);
            shaded += (double)e[i][0] < 0.1 * full, lit_by_sun += (double)e[i][0] > 0.3 * full;
        }
        CHECK(shaded > 5 && lit_by_sun > 20, "method %d: %d in the shade, %d in the sun", method, shaded, lit_by_sun);
        isogi_trace_free(t);
        d.seed = 1, bake_and_sample(&d, NULL, (const float(*)[3])points, n, other);
        for (int i = 0; i < n; i++) {
            double apart = fabs((double)e[i][0] - (double)other[i][0]) / full;
            rms += apart * apart / n, worst = fmax(worst, apart);
        }
        printf("    %s: two seeds differ by %.3f of the sun (rms), %.3f at most\n", method ? "paths" : "feedback", sqrt(rms), worst);
        CHECK(sqrt(rms) < 0.15 && worst < 6 * sqrt(rms), "method %d: two seeds differ by %g, %g at most", method, sqrt(rms), worst);
        /* a plane that the sun cannot see, and one that it can: exact, and the dark one does not know of the sun */
        scene plane = scene_make(17, 17, 17, NULL, ground, (const double[1]){8});
        isogi_trace_desc p = desc_make(&plane, 0.5f, -1, 16384); /* standard error 0.75 % */
        float middle[1][3] = {{8, 8, 8}}, up[1][3];
        p.lighting = d.lighting, p.method = (isogi_trace_method)method, p.lazy = 1;
        for (int side = 0; side < 2; side++) {
            double expected = side ? PI * 1e-3 : 0;
            for (int y = 0; y < 16 * H && !side; y++) /* the midpoint rule: the pixel's light is spread over its neighbours, bilinearly */
                for (int x = 0; x < 16 * W; x++) {
                    double v = (y + 0.5) * PI / (16 * H), f = 2 * PI * ((x + 0.5) / (16 * W) - 0.5);
                    float dir[3] = {(float)(sin(v) * sin(f)), (float)cos(v), (float)(-sin(v) * cos(f))}, rgb[3];
                    if (cos(v) <= 0) continue;
                    isogi_env_radiance(&d.lighting.env, dir, rgb);
                    expected += (double)rgb[0] * cos(v) * sin(v) * (PI / (16 * H)) * (2 * PI / (16 * W));
                }
            p.sides = side ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE;
            bake_and_sample(&p, NULL, (const float(*)[3])middle, 1, up);
            CHECK(fabs((double)up[0][0] - expected) < 0.03 * expected, "method %d, side %d: E %g, expected %g", method, side,
                  (double)up[0][0], expected);
        }
        scene_free(&plane);
    }
    scene_free(&s);
}

/* ---- next to nothing --------------------------------------------------------------------------------------------------------------- */

static double noise(const double p[3], const double *q) {
    test_random r = {(uint64_t)(p[0] + 100 * p[1] + 10000 * p[2] + 1e6 * q[0])};
    return random_range(&r, -1, 1);
}
static double constant(const double p[3], const double *q) { (void)p; return q[0]; }
static double patched(const double p[3], const double *q) {
    test_random r = {(uint64_t)(7 + p[0] + 100 * p[1] + 10000 * p[2])};
    uint64_t kind = random_bits(&r) % 60;
    return kind == 0 ? nan_value() : kind == 1 ? (double)HUGE_VALF : kind == 2 ? -(double)HUGE_VALF : gyroid(p, q);
}

/* Both methods, both modes, every switch: a texture is made, ends, and gives finite light that is not negative and, by a white sky of 1
   and an albedo
   below 1, no more than pi; of a constant volume, none at all. */
TEST(volumes_of_next_to_nothing) {
    struct { const char *name; int n[3]; field *f; double q[1]; int light; } v[9] = {
        {"one cell", {2, 2, 2}, noise, {1}, 1}, {"a row of cells", {2, 2, 9}, noise, {2}, 1}, {"a plate", {9, 2, 9}, noise, {3}, 1},
        {"constant", {8, 8, 8}, constant, {3}, 0},
        {"zero", {5, 5, 5}, constant, {0}, 0}, {"noise", {12, 11, 13}, noise, {5}, 1},
        {"NaN and infinities", {14, 13, 12}, patched, {0.5}, 1},
        {"all NaN", {5, 4, 6}, constant, {0}, 0}, {"of 1e30", {6, 6, 6}, constant, {1e30}, 0}};
    v[7].q[0] = nan_value();
    for (int i = 0; i < 9; i++) {
        scene s = scene_make(v[i].n[0], v[i].n[1], v[i].n[2], NULL, v[i].f, v[i].q);
        for (int k = 0; k < (LONG_SUITE ? 32 : 16); k++) {
            isogi_trace_desc d = desc_make(&s, 0.8f, (k >> 2 ^ k >> 4) & 1 ? -1 : 2, 2);
            isogi_trace_report report;
            double least, most;
            d.method = (isogi_trace_method)(k & 1), d.capped = k & 2, d.offset = k & 4 ? -1 : 0,
            d.sides = k & 8 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
            if (k % 5 == 4) d.mode = ISOGI_TRACE_TRANSFER, d.order = 1;
            if (k % 7 == 6) d.normals = ISOGI_NORMAL_TRILINEAR;
            report = baked(&d, &least, &most);
            CHECK(least >= 0 && most <= PI * 1.001, "%s, case %d: light from %g to %g", v[i].name, k, least, most);
            if (!v[i].light && !d.capped)
                CHECK(report.texels == 0 && most <= 0, "%s, case %d: %d texels, light up to %g", v[i].name, k, (int)report.texels, most);
            if (v[i].light) CHECK(report.texels > 0, "%s, case %d: no texel", v[i].name, k);
        }
        scene_free(&s);
    }
}

/* Lattices that are one texel wide along some axes, or have two texels, in the middle of a volume or over all of it; under an open sky the
   light of
   a ball's surface is pi wherever a texel is. Saved, loaded and exported, too. */
TEST(lattices_one_texel_wide) {
    double q[4] = {10, 10.2, 9.7, 6};
    scene s = scene_make(21, 21, 21, NULL, ball, q);
    for (int k = 1; k < 27; k++) {
        isogi_trace_desc d = desc_make(&s, 0.8f, 1, 4);
        isogi_trace *t = NULL, *u = NULL;
        float *texels, scales[3], p[1][3] = {{10, 16, 10}}, e[1][3];
        uint8_t *block;
        size_t bytes, shape[3];
        double least, most;
        d.method = (isogi_trace_method)(k & 1);
        for (int a = 0; a < 3; a++) {
            int choice = k / (a == 0 ? 1 : a == 1 ? 3 : 9) % 3;
            d.lattice[a] = choice == 0 ? 0 : (size_t)choice;
            if (k > 13) d.lattice_min[a] = choice == 1 ? 16.5 : 3, d.lattice_max[a] = choice == 1 ? 16.5 : 18;
        }
        isogi_trace_report report = baked(&d, &least, &most);
        /* a ball sees nothing but sky: all texels have pi but those beside the centre, where the normal is smoothed away */
        CHECK(least >= 0 && most <= PI * 1.01, "lattice %d: light from %g to %g", k, least, most);
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                  isogi_trace_create(&u, &d, NULL) == ISOGI_OK,
              "lattice %d", k);
        isogi_trace_shape(t, shape, NULL, NULL);
        bytes = isogi_trace_save_size(t), block = (uint8_t *)malloc(bytes),
        texels = (float *)malloc(isogi_trace_export_size(t, ISOGI_TRACE_FLOAT));
        CHECK(isogi_trace_export_size(t, ISOGI_TRACE_FLOAT) == 12 * shape[0] * shape[1] * shape[2], "lattice %d", k);
        CHECK(isogi_trace_save(t, block, bytes) == ISOGI_OK && isogi_trace_load(u, block, bytes) == ISOGI_OK, "lattice %d", k);
        CHECK(isogi_trace_export(u, ISOGI_TRACE_FLOAT, texels, isogi_trace_export_size(u, ISOGI_TRACE_FLOAT)) == ISOGI_OK &&
                  isogi_trace_export_scales(u, ISOGI_TRACE_FLOAT, scales) == ISOGI_OK,
              "lattice %d", k);
        isogi_trace_sample(u, (const float(*)[3])p, 1, e, NULL);
        if (report.texels) CHECK(texels[0] >= 0 && texels[0] <= 3.2f && e[0][0] <= 3.2f, "lattice %d: %g", k, (double)texels[0]);
        isogi_trace_free(t), isogi_trace_free(u), free(block), free(texels);
    }
    scene_free(&s);
}

/* Convex bodies see nothing of themselves: pi under a white sky, whatever albedo, bounces, method and isovalue: ball, ellipsoid by
   spacing, block. */
static double block(const double p[3], const double *q) {
    return q[3] - fmax(fmax(fabs(p[0] - q[0]), fabs(p[1] - q[1])), fabs(p[2] - q[2]));
}
TEST(convex_bodies_see_the_whole_sky) {
    double q[4] = {15.3, 15.6, 15.1, 8}, wide[3] = {1, 0.5, 2}, centre[4] = {15.3, 7.8, 30.2, 7};
    for (int k = 0; k < 3; k++) {
        scene s = scene_make(32, 32, 32, k == 1 ? wide : NULL, k == 2 ? block : ball, k == 1 ? centre : q);
        for (int method = 0; method < 2; method++) {
            isogi_trace_desc d = desc_make(&s, 0.9f, -1, 32);
            float points[100][3], e[100][3];
            double mean = 0, worst = 0;
            int n = surface_points(&s, 0.5, 100, 17, points);
            d.method = (isogi_trace_method)method, d.lazy = 1;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
            for (int i = 0; i < n; i++) mean += (double)e[i][1] / n, worst = fmax(worst, fabs((double)e[i][1] - PI));
            /* the trilinear ball has dents of 1/60 voxel; the block's edges are rounded by a voxel, where rays start beside their own
               texel */
            CHECK(n == 100 && fabs(mean - PI) < 0.005 * PI && worst < (k == 2 ? 0.2 : 0.05) * PI,
                  "body %d, method %d: mean %.4f, worst %.4f", k, method, mean, worst);
        }
        scene_free(&s);
    }
}

TEST_MAIN("trace_stress")
