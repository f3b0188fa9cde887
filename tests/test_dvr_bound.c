/* Pictures of physical space with an error bound (isogi_dvr_desc.bound), against quadrature in long double. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "test.h"

enum { N = 12, POINTS = 6 };

/* Colour and opacity of a ray by many small steps, each homogeneous, whose value is that of its middle. */
static void reference_ray(const field *f, const isogi_transfer *t, const double eye[3], const float dir[3], long double out[4],
                          double *half) {
    enum { STEPS = 20000 };
    long double enter = 0, leave = 1e9L, depth = 0, length;
    static long double passed[STEPS];
    for (int a = 0; a < 3; a++) {
        long double t0 = (0 - (long double)eye[a]) / (long double)dir[a], t1 = (N - 1 - (long double)eye[a]) / (long double)dir[a];
        enter = fmaxl(enter, fminl(t0, t1)), leave = fminl(leave, fmaxl(t0, t1));
    }
    for (int a = 0; a < 4; a++) out[a] = 0;
    *half = INFINITY, length = (leave - enter) / STEPS;
    for (int i = 0; i < STEPS && enter < leave; i++) {
        long double p[3], c[4], opacity;
        int cell[3];
        for (int a = 0; a < 3; a++) {
            p[a] = (long double)eye[a] + (enter + (i + 0.5L) * length) * (long double)dir[a];
            cell[a] = (int)fminl(fmaxl(floorl(p[a]), 0), N - 2);
        }
        reference_transfer(t, reference_value(f, cell, p), c);
        opacity = -expm1l(-c[3] * length);
        for (int a = 0; a < 3; a++) out[a] += expl(-depth) * opacity * c[a];
        depth += c[3] * length, passed[i] = -expm1l(-depth);
    }
    out[3] = -expm1l(-depth);
    for (int i = 0; i < STEPS && enter < leave && out[3] > 1e-6L; i++)
        if (passed[i] >= 0.5L * out[3]) {
            *half = (double)(enter + (i + 0.5L) * length);
            break;
        }
}

static void random_function(test_random *r, isogi_transfer_point points[POINTS], int steps, double extinction) {
    for (int i = 0; i < POINTS; i++) {
        points[i].value = -1 + 2.0 * i / (POINTS - 1) + random_range(r, -0.15, 0.15);
        if (steps && i % 2) points[i].value = points[i - 1].value;
        for (int a = 0; a < 3; a++) points[i].rgb[a] = (float)random_unit(r);
        points[i].extinction = random_unit(r) < 0.3 ? 0 : (float)(extinction * random_unit(r));
    }
}

/* Opacity to the rounding of floats, whatever the bound; colours within it; depth. Where the function has steps, quadrature errs by a
   step's length of its own at each crossing. */
TEST(errors_stay_below_the_bound_on_random_fields_and_functions) {
    const double bounds[] = {1, 0.1, 0.01, 1e-3};
    double most[4] = {0, 0, 0, 0}, sampled = 0, deepest = 0;
    test_random r = {21};
    for (int n = 0; n < (LONG_SUITE ? 40 : 8); n++) {
        field f = n % 2 ? field_noise(N, 100 + (uint64_t)n) : field_waves(N, 100 + (uint64_t)n);
        isogi_transfer_point points[POINTS];
        const isogi_transfer transfer = {points, POINTS, NULL, 0};
        const double extinctions[] = {0.05, 0.5, 4, 40};
        int steps = n % 4 > 1;
        random_function(&r, points, steps, extinctions[n / 2 % 4]);
        for (int ray = 0; ray < (LONG_SUITE ? 6 : 3); ray++) {
            double eye[3], target[3], half;
            long double expected[4];
            float dir[3];
            double origin[3];
            random_direction(&r, eye);
            for (int a = 0; a < 3; a++) eye[a] = (double)(float)(5.5 + 20 * eye[a]), target[a] = random_range(&r, 3, 8);
            isogi_view view = line_of_sight(eye, target);
            isogi_view_ray(&view, 0, 0, origin, dir);
            reference_ray(&f, &transfer, origin, dir, expected, &half);
            for (int k = 0; k < 5; k++) {
                isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .bound = k < 4 ? bounds[k] : 0};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                float c[1][4], depth;
                double tolerance = steps ? 4e-3 : 2e-5, error = 0; /* 20000 steps over some 15 voxels: of second order but at steps */
                CHECK(isogi_dvr_render(dvr, &view, NULL, c, &depth, NULL) == ISOGI_OK, "render");
                isogi_dvr_free(dvr);
                for (int a = 0; a < 3; a++) error = fmax(error, fabs((double)c[0][a] - (double)expected[a]));
                if (k == 4) {
                    sampled = fmax(sampled, fabs((double)c[0][3] - (double)expected[3]));
                    continue;
                }
                most[k] = fmax(most[k], error);
                CHECK(fabs((double)c[0][3] - (double)expected[3]) < tolerance, "field %d ray %d: opacity %g, not %g", n, ray,
                      (double)c[0][3], (double)expected[3]);
                CHECK(error < bounds[k] + tolerance, "field %d ray %d, bound %g: error %g", n, ray, bounds[k], error);
                if (half < 1e9 && expected[3] > 1e-3L && !steps)
                    deepest = fmax(deepest, fabs((double)depth - half));
            }
        }
        field_free(&f);
    }
    printf("    bounds 1 .1 .01 .001: largest errors of colours %.2g %.2g %.2g %.2g; of opacity by samples half a voxel apart %.2g\n",
           most[0], most[1], most[2], most[3], sampled);
    CHECK(most[3] < 4e-3 + 1e-3 && most[0] > most[3] && sampled > 0.01, "errors %g %g, of samples %g", most[0], most[3], sampled);
    CHECK(deepest < 5e-3, "depth of half opacity errs by %g", deepest); /* some steps of quadrature, where it stands still */
}

/* xyz in one cell, a cube along the diagonal, under a thin medium whose colour is the value: the picture's colour over its opacity is the
   mean of the cube, 1/4. A part stands for its field by a straight line; the mean of a monotone cubic is no further than 0.29 of its range
   from that of its ends (0.5 - 0.21, Gauss's place), so that errors are at most that share of the bound. */
TEST(parts_are_no_coarser_than_the_bound_asks_for) {
    field f = field_new(2, 2, 2);
    const isogi_transfer_point p[] = {{0, {0, 0, 0}, 1e-3f}, {1, {1, 1, 1}, 1e-3f}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    const double eye[3] = {-3, -3, -3}, target[3] = {0.5, 0.5, 0.5};
    double least = 1;
    *field_at(&f, 1, 1, 1) = 1, field_build(&f);
    for (double bound = 0.9; bound > 0.02; bound *= 0.9) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .bound = bound};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const pixel got = cast(dvr, eye, target, NULL);
        double error = fabs((double)got.c[0] / (double)got.c[3] - 0.25);
        CHECK(error < 0.29 * bound + 1e-3, "bound %g: error %g", bound, error); /* 1e-3: what the medium hides of itself */
        least = fmin(least, error);
        isogi_dvr_free(dvr);
    }
    CHECK(least < 2e-3, "an error of %g with a bound of 0.02", least);
    field_free(&f);
}

/* Constant data absorbs by its length; a step in the middle of a linear field by the lengths on its two sides. */
TEST(homogeneous_media_and_steps_are_exact) {
    for (int kind = 0; kind < 2; kind++) {
        field f = field_new(N, N, N);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = kind ? (double)(i % N) : 0.5;
        field_build(&f);
        const isogi_transfer_point p[] = {{0, {1, 0.5f, 0}, 0.1f}, {4.3, {1, 0.5f, 0}, 0.1f},
                                           {4.3, {0, 0, 1}, 0.3f}, {11, {0, 0, 1}, 0.3f}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .bound = 1};
        const double eye[3] = {-20, 4.2, 5.7}, target[3] = {5, 4.2, 5.7};
        isogi_view view = line_of_sight(eye, target);
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        double front = exp(-0.1 * (kind ? 4.3 : 11)), back = kind ? exp(-0.3 * (11 - 4.3)) : 1;
        float c[1][4];
        CHECK(isogi_dvr_render(dvr, &view, NULL, c, NULL, NULL) == ISOGI_OK, "render");
        CHECK(fabs((double)c[0][3] - (1 - front * back)) < 1e-6 && fabs((double)c[0][0] - (1 - front)) < 1e-6 &&
                  fabs((double)c[0][2] - front * (1 - back)) < 1e-6,
              "kind %d: %g %g %g, not %g %g %g", kind, (double)c[0][3], (double)c[0][0], (double)c[0][2],
              1 - front * back, 1 - front, front * (1 - back));
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* With peaks, lights and clip planes as without a bound, up to what samples half a voxel apart err by. */
TEST(pictures_with_a_bound_are_those_of_small_steps) {
    enum { SIDE = 24 };
    static float image[2][SIDE * SIDE][4], depth[2][SIDE * SIDE];
    field f = field_waves(N, 5);
    const isogi_transfer_point p[] = {{-1, {1, 0.5f, 0}, 0}, {-0.2, {1, 0.5f, 0}, 0}, {0.5, {0.2f, 0.4f, 1}, 0.5f}, {1, {1, 1, 1}, 0.8f}};
    const isogi_peak peak = {0.1, {0.9f, 0.8f, 0.3f}, 0.4f};
    const isogi_light sun = {.vector = {1, 2, 1}, .rgb = {3, 3, 3}};
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}, .lights = &sun, .light_count = 1};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {20, 17, 24}, .target = {5.5f, 5.5f, 5.5f}};
    const double plane[1][4] = {{1, 0.3, 0, -4}};
    for (int peaks = 0; peaks < 2; peaks++)
        for (int shading = ISOGI_DVR_UNLIT; shading <= ISOGI_DVR_TWO_SIDED; shading++) {
            const isogi_transfer transfer = {p, 4, &peak, (size_t)peaks};
            for (int n = 0; n < 2; n++) {
                isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = (isogi_dvr_shading)shading, .opaque = 1, .bound = n ? 0.01 : 0,
                                       .step = n ? 50 : 0.02, .directions = 16, .grid = {4, 4, 4}, .visibility_step = 1,
                                       .classification = n ? ISOGI_DVR_EXACT : ISOGI_DVR_POST_CLASSIFIED};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
                CHECK(isogi_dvr_render(dvr, &view, &lighting, image[n], depth[n], NULL) == ISOGI_OK, "render");
                isogi_dvr_free(dvr);
            }
            double rms = rms_difference(image[0], image[1], SIDE * SIDE);
            CHECK(rms < (shading ? 0.02 : 1e-3), "peaks %d, shading %d: rms %g", peaks, shading, rms); /* light once for a cell */
            for (int i = 0; i < SIDE * SIDE; i++)
                if (!shading && image[0][i][3] > 0.1f)
                    CHECK(fabs((double)depth[0][i] - (double)depth[1][i]) < 0.05, "depth %g, not %g", (double)depth[1][i],
                          (double)depth[0][i]);
        }
    field_free(&f);
}

/* The opacity along z of layers of values, by quadrature: what lies between two layers is linear. */
static double layered_opacity(const double *layer, const isogi_transfer *t) {
    enum { STEPS = 4000 };
    double depth = 0;
    for (int i = 0; i < (N - 1) * STEPS; i++) {
        double u = (i % STEPS + 0.5) / STEPS, a = layer[i / STEPS], b = layer[i / STEPS + 1];
        float rgb[3], extinction;
        isogi_transfer_at(t, a < b || b < a ? a + u * (b - a) : a, rgb, &extinction);
        depth += (double)extinction / STEPS;
    }
    return 1 - exp(-depth);
}

/* The upper side of a step holds at the value itself, for volumes and layers of it: at any value, whatever its digits, and where it is
   the least, the largest or the only one that occurs; also where denormal numbers are zero (path 5: with a bound). */
TEST(constant_regions_on_a_step_absorb_as_its_upper_side_says) {
    const double kinds[][3] = {{5, 5, 5}, {0, 5, 7}, {5, 7, 6}, {0, 3, 5}, {0, 0, 0}, {-5000.7, -5000.7, -5000.7},
                               {5000, 5001, 5000}, {1e6 + 0.25, 1e6 + 0.25, 1e6 + 0.25}};
    const double at[] = {5, 5, 5, 5, 0, -5000.7, 5000, 1e6 + 0.25}, eye[3] = {5.4, 5.4, -30}, target[3] = {5.4, 5.4, 3};
    for (int kind = 0; kind < 8; kind++) {
        double layer[N], s = (double)(float)at[kind];
        field f = field_new(N, N, N);
        for (int z = 0; z < N; z++) layer[z] = (double)(float)kinds[kind][z / 4];
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = layer[i / (N * N)];
        field_build(&f);
        const isogi_transfer_point up[] = {{s - 5, {1, 1, 1}, 0}, {s, {1, 1, 1}, 0}, {s, {1, 1, 1}, 0.2f},
                                           {s + 4, {1, 1, 1}, 0.2f}};
        const isogi_transfer_point down[] = {{s - 5, {1, 1, 1}, 0.2f}, {s, {1, 1, 1}, 0.2f},
                                             {s, {1, 1, 1}, 0}, {s + 4, {1, 1, 1}, 0}};
        const isogi_transfer_point tent[] = {{s - 5, {1, 1, 1}, 0}, {s - 1, {1, 1, 1}, 0}, {s, {1, 1, 1}, 0.2f},
                                             {s, {1, 1, 1}, 0}, {s + 1, {1, 1, 1}, 0}};
        const isogi_transfer transfers[] = {{up, 4, NULL, 0}, {down, 4, NULL, 0}, {up, 3, NULL, 0},
                                            {up + 2, 1, NULL, 0}, {tent, 5, NULL, 0}};
        for (int k = 0; k < 5; k++)
            for (int path = 0; path <= 5; path++) { /* 0: with a bound */
                const isogi_context context = {.threads = 1, .force_path = path % 5};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .bound = path % 5 ? 0 : 0.01, .step = 0.1};
                double expected = layered_opacity(layer, &transfers[k]);
                flush_denormals(path == 5);
                isogi_dvr *dvr = dvr_new_with(&desc, &transfers[k], &context);
                double opacity = (double)cast(dvr, eye, target, NULL).c[3];
                double tolerance = path % 5 ? 0.01 : 2e-4; /* samples; classes of values for the steps between */
                flush_denormals(0);
                CHECK(fabs(opacity - expected) < tolerance, "layers %d, function %d, %s %d: opacity %g, not %g", kind, k,
                      path % 5 ? "path" : "bound", path, opacity, expected);
                isogi_dvr_free(dvr);
            }
        field_free(&f);
    }
}

/* Double data up to the largest numbers there are: the picture of the same data divided by 2^1000. */
TEST(the_largest_doubles_give_the_picture_of_small_ones) {
#ifdef __FAST_MATH__
    SKIP("-ffast-math may sum in an order that overflows next to the largest double");
#endif
    static double data[N][N][N];
    float c[2][4], depth[2];
    for (int n = 0; n < 2; n++) {
        double most = n ? 1.7e308 : ldexp(1.7e308, -1000);
        isogi_volume volume = {.data = data, .type = ISOGI_F64, .size = {N, N, N}};
        isogi_pyramid *pyramid = NULL;
        for (int i = 0; i < N * N * N; i++) data[i / N / N][i / N % N][i % N] = most * cos(0.5 * (i / N / N) + 0.1 * (i % N));
        CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
        const isogi_transfer_point p[] = {{-most, {1, 0, 0}, 0.3f}, {-0.5 * most, {0, 1, 0}, 0},
                                          {0.9 * most, {0.2f, 0, 1}, 0.2f}, {most, {0, 1, 0}, 0.6f}};
        const isogi_transfer transfer = {p, 4, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = pyramid, .opaque = 1, .bound = 0.001};
        const double eye[3] = {4.1, 5.4, -30}, target[3] = {5.4, 5.7, 3};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel got = cast(dvr, eye, target, NULL);
        memcpy(c[n], got.c, sizeof c[n]), depth[n] = got.depth;
        isogi_dvr_free(dvr), isogi_vol_free(pyramid);
    }
    for (int a = 0; a < 4; a++)
        CHECK(fabs((double)c[0][a] - (double)c[1][a]) < 1e-6 && c[0][3] > 0.3f, "channel %d: %g, not %g", a, (double)c[1][a],
              (double)c[0][a]);
    CHECK(fabs((double)depth[0] - (double)depth[1]) < 1e-4, "depth %g, not %g", (double)depth[1], (double)depth[0]);
}

TEST(bounds_out_of_range_are_refused) {
    field f = field_waves(N, 5);
    const double bad[] = {-1, 1e-5, 1.5, NAN, INFINITY};
    for (int i = 0; i < 5; i++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .bound = bad[i]};
        isogi_dvr *dvr = NULL;
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_INVALID && !dvr, "%g", bad[i]);
    }
    field_free(&f);
}

static double height_in_voxels(double x, double y, double z) { return (void)x, (void)y, 24 * z; }

/* A skin whose extinction rises from 0 within a cell, lit from where it is looked at: as samples of a hundredth of a voxel see it, however
   small the bound, and with it the first part of each piece, is. */
TEST(surfaces_are_as_bright_with_any_bound) {
    static const double top[3] = {8, 32, 128}, bounds[5] = {0, 1, 0.1, 0.01, 0.001};
    const isogi_light sun = {.vector = {0.3f, 0.2f, -1}, .rgb = {12.566f, 12.566f, 12.566f}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const double eye[3] = {3, 5, -40}, target[3] = {12, 13, 20};
    field f = field_of(height_in_voxels, 25);
    for (int k = 0; k < 3; k++) {
        const isogi_transfer_point p[] = {
            {11.5, {1, 0, 0}, 0}, {12.5, {0, 1, 1}, (float)top[k]}, {30, {0, 1, 1}, (float)top[k]}};
        const isogi_transfer transfer = {p, 3, NULL, 0};
        pixel seen[5];
        for (int way = 0; way < 5; way++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .opaque = 1, .order = 4, .directions = 256,
                                         .grid = {7, 7, 7}, .bound = bounds[way], .step = way ? 0 : 0.01, .visibility_step = 0.5,
                                         .classification = way ? ISOGI_DVR_EXACT : ISOGI_DVR_POST_CLASSIFIED};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            seen[way] = cast(dvr, eye, target, &lighting);
            isogi_dvr_free(dvr);
            for (int a = 0; a < 4; a++)
                CHECK(fabs((double)seen[way].c[a] - (double)seen[0].c[a]) < (way == 1 ? 0.06 : 0.03) * (double)seen[0].c[3],
                      "extinction %g, bound %g, channel %d: %g, by samples %g", top[k], bounds[way], a, (double)seen[way].c[a],
                      (double)seen[0].c[a]);
        }
    }
    field_free(&f);
}

TEST_MAIN("dvr_bound")
