/* Scenes made to be hard: grids that are fine along one axis only, matter whose normals alternate, transfer functions with narrow peaks,
   numbers at the ends of their ranges. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "test.h"

static const isogi_light from_above = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {0, 1, 0}, .rgb = {12.566f, 12.566f, 12.566f}};
static const isogi_lighting above = {.lights = &from_above, .light_count = 1};

static isogi_dvr *stepped(const isogi_dvr_desc *desc, const isogi_transfer *transfer) {
    isogi_dvr *dvr = dvr_new(desc, transfer);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    return dvr;
}

/* A dense wall under a roof, lit from above and seen along x. The field is constant along z, where it is sampled every voxel, or every
   second or fourth: the same picture is due, of a wall in the shade. How far in front of dense matter visibility is looked up is a matter
   of the grid's distance along the ray, whatever it is along other axes. */
TEST(shade_does_not_depend_on_distances_across_the_ray) {
    const isogi_transfer_point points[2] = {{0.2, {1, 1, 1}, 0}, {0.8, {1, 1, 1}, 4}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    for (int every = 1; every <= 4; every *= 2) {
        field f = field_new(32, 32, 32 / every + 1);
        for (size_t i = 0; i < field_count(&f); i++) {
            size_t x = i % 32, y = i / 32 % 32;
            f.value[i] = (x >= 20 && x <= 23 && y < 22) || (y >= 25 && y <= 27 && x >= 8 && x <= 30);
        }
        f.volume.spacing[0] = f.volume.spacing[1] = 1, f.volume.spacing[2] = every;
        field_build(&f);
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++)
            for (int bounded = 0; bounded < 2; bounded++) {
                const double eye[3] = {-60, 15, 16}, target[3] = {20, 15, 16};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method,
                                             .order = 4, .directions = 64, .grid = {16, 16, (size_t)(16 / every)},
                                             .bound = bounded ? 0.1 : 0};
                isogi_dvr *dvr = stepped(&desc, &transfer);
                pixel p = cast(dvr, eye, target, &above);
                CHECK((double)p.c[0] < 0.02 && (double)p.c[3] > 0.99, "every %d, method %d: %g", every, method, (double)p.c[0]);
                isogi_dvr_free(dvr);
                if (method != ISOGI_DVR_SWEEP) break; /* the other way of casting is that of all methods */
            }
        field_free(&f);
    }
}

/* What one distance along z hides, 16 along x do not: matter that is opaque over the largest distance of the grid can be looked into. */
TEST(several_resolutions_are_fine_where_matter_is_seen_along_one_axis) {
    const isogi_transfer_point points[2] = {{0.5, {1, 1, 1}, 0}, {0.6, {1, 1, 1}, 0.3f}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    float v[2][16];
    field f = field_new(33, 33, 9);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = i % 33 >= 4;
    f.volume.spacing[0] = f.volume.spacing[1] = 1, f.volume.spacing[2] = 16;
    field_build(&f);
    for (int coarse = 0; coarse < 2; coarse++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .coarsest = coarse ? 8 : 1, .order = 4,
                                     .directions = 64, .grid = {33, 33, 9}};
        isogi_dvr *dvr = stepped(&desc, &transfer);
        const float place[3] = {12, 28, 64};
        isogi_dvr_sample_visibility(dvr, &place, 1, v[coarse]);
        isogi_dvr_free(dvr);
    }
    CHECK(fabs((double)v[0][0] - (double)v[1][0]) < 0.01, "regular %g, several resolutions %g", (double)v[0][0], (double)v[1][0]);
    field_free(&f);
}

/* Steep, and up and down in turn, while the value rises along the ray: each piece shows little, and those that show most all have one
   normal. The reference takes light at every sample. */
TEST(alternating_normals_are_all_lit) {
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.005f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {0, 1, 0}, .rgb = {3.14159f, 3.14159f, 3.14159f}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const double eye[3] = {-50, 4, 4}, target[3] = {100, 4, 4}, rise[4] = {1, 0.02, 0.6, 0.02};
    double value = 0;
    pixel p[3];
    field f = field_new(401, 9, 9);
    for (int x = 0; x < 401; value += rise[x++ % 4])
        for (int i = 0; i < 81; i++) *field_at(&f, x, i % 9, i / 9) = value + (x % 4 < 2 ? 4 : -4) * (i % 9 - 4);
    field_build(&f);
    for (int c = 0; c < 3; c++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = ISOGI_DVR_DATA, .shading = ISOGI_DVR_LOCAL, .step = 0.05, .opaque = 1,
                                     .classification = (isogi_dvr_classification)c, .normals = ISOGI_NORMAL_TRILINEAR};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        p[c] = cast(dvr, eye, target, &lighting);
        isogi_dvr_free(dvr);
    }
    /* exact rays look light up at the middle of a cell, where the normal turns: a 30th of what is lit */
    for (int c = 0; c < 2; c++)
        CHECK(fabs((double)p[c].c[0] - (double)p[2].c[0]) < 0.01, "%d: %g, at every sample %g", c, (double)p[c].c[0], (double)p[2].c[0]);
    field_free(&f);
}

/* A ramp along the ray, linear, so that pre-integration is exact: opacity and colour of a peak of the transfer function are the same
   wherever between two samples it lies, however gentle the ramp is against the table's classes. Scalar code and vectors. */
TEST(narrow_peaks_on_gentle_ramps_are_whole) {
    for (int path = 0; path < 2; path++)
        for (double width = 16; width <= 256; width *= 16)
            for (double slope = 16; slope < 600; slope *= 4) {
                const double eye[3] = {-60, 3.5, 3.5}, target[3] = {30, 3.5, 3.5};
                const isogi_context context = {.threads = 1, .force_path = path ? 0 : 1};
                double worst[2] = {0, 0};
                field f = field_new(64, 8, 8);
                for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 10000 + slope * (double)(i % 64);
                f.value[0] = 65535;
                field_build(&f);
                for (int k = 0; k < 7; k++) {
                    double c = 10000 + slope * (30 + k / 7.0), peak = 2 * slope / width;
                    const isogi_transfer_point points[5] = {{0, {1, 1, 1}, 0}, {c - width, {1, 0.5f, 0}, 0}, {c, {1, 0.5f, 0}, (float)peak},
                                                            {c + width, {1, 0.5f, 0}, 0}, {65535, {1, 1, 1}, 1e-7f}};
                    const isogi_transfer transfer = {points, 5, NULL, 0};
                    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_UNLIT, .opaque = 1};
                    isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
                    pixel p = cast(dvr, eye, target, NULL);
                    worst[0] = fmax(worst[0], fabs((double)p.c[3] - (1 - exp(-2))));
                    worst[1] = fmax(worst[1], fabs((double)p.c[1] - 0.5 * (1 - exp(-2))));
                    isogi_dvr_free(dvr);
                }
                /* floats of a sum over some hundred classes */
                CHECK(worst[0] < 1e-3 && worst[1] < 1e-3, "path %d, half width %g, slope %g: opacity off by %g, colour by %g", path, width,
                      slope, worst[0], worst[1]);
                field_free(&f);
            }
}

/* Thin haze above values of dense matter, which only a corner of the volume has: sums over classes begin with the dense ones, of twenty
   million times as much. */
TEST(haze_above_dense_matter_has_all_its_digits) {
    const isogi_transfer_point points[4] = {
        {0, {1, 1, 1}, 1e5f}, {100, {1, 1, 1}, 9e4f}, {101, {1, 1, 1}, 0.005f}, {256, {1, 1, 1}, 0.006f}};
    const isogi_transfer transfer = {points, 4, NULL, 0};
    const double eye[3] = {-60, 3.5, 3.5}, target[3] = {30, 3.5, 3.5};
    const double exact = 1 - exp(-63 * (0.005 + 0.001 * (150 + 0.3 * 31.5 - 101) / 155)); /* extinction is linear along the ray */
    for (int path = 0; path < 2; path++) {
        const isogi_context context = {.threads = 1, .force_path = path ? 0 : 1};
        field f = field_new(64, 8, 8);
        isogi_dvr_desc desc = {.shading = ISOGI_DVR_UNLIT, .opaque = 1};
        isogi_dvr *dvr;
        pixel p;
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 150 + 0.3 * (double)(i % 64);
        f.value[0] = 0;
        field_build(&f);
        desc.pyramid = f.pyramid, dvr = dvr_new_with(&desc, &transfer, &context), p = cast(dvr, eye, target, NULL);
        CHECK(fabs((double)p.c[3] - exact) < 1e-4, "path %d: opacity %g, exact %g", path, (double)p.c[3], exact);
        CHECK(fabs((double)p.c[0] - (double)p.c[3]) < 1e-4, "path %d: colour %g of 1", path, (double)(p.c[0] / p.c[3]));
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* Differences of values need not be numbers where values are. */
TEST(functions_suggested_for_huge_values_are_finite) {
    static const double low[3] = {-1e308, -1.7e308, 1e307}, step[3] = {2e307, 5.6e307, 2e307};
    for (int k = 0; k < 3; k++) {
        field f = field_new(10, 10, 10);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = low[k] + step[k] * (double)(i % 7);
        field_build(&f);
        for (int space = 0; space < 2; space++) {
            isogi_transfer_point points[ISOGI_SUGGEST_POINTS];
            const isogi_transfer transfer = {points, ISOGI_SUGGEST_POINTS, NULL, 0};
            double threshold = NAN;
            isogi_result result = isogi_transfer_suggest(f.pyramid, (isogi_dvr_space)space, points, &threshold);
            CHECK(result == ISOGI_OK && isogi_transfer_validate(&transfer) == ISOGI_OK, "%d: %d, points %g %g %g %g %g %g", k, result,
                  points[0].value, points[1].value, points[2].value, points[3].value, points[4].value, points[5].value);
            CHECK(fabs(threshold) <= 1.7e308, "threshold %g", threshold);
        }
        field_free(&f);
    }
}

/* A value that does not change has neither a front nor a back. */
TEST(constant_matter_has_the_ambient_light_of_both_materials) {
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f}; /* radiance 1: sqrt(4 pi) */
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}};
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.5f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const double eye[3] = {-20, 3.2, 3.4}, target[3] = {4, 3.2, 3.4};
    field f = field_new(8, 8, 8);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1;
    field_build(&f);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_TWO_SIDED,
                                 .material = {{.diffuse = {1, 1, 0.2f}}, {.diffuse = {0.5f, 0, 0.2f}}}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    pixel p = cast(dvr, eye, target, &lighting);
    for (int a = 0; a < 3; a++) {
        double mean[3] = {0.75, 0.5, 0.2};
        CHECK(p.c[3] > 0.9f && fabs((double)(p.c[a] / p.c[3]) - mean[a]) < 1e-3, "channel %d: %g", a, (double)(p.c[a] / p.c[3]));
    }
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* Colours go to 1e30; whatever the light, pixels are finite. */
TEST(glaring_colours_are_refused_or_clamped) {
    isogi_transfer_point point = {0, {1e30f, 0, 1}, 0.5f};
    isogi_peak peak = {0.5, {1, 1, 1e31f}, 0.5f};
    isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {-1, 1, 0}, .rgb = {1e30f, 1e30f, 1e30f}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const double eye[3] = {-20, 3.2, 3.4}, target[3] = {4, 3.2, 3.4};
    field f = field_new(8, 8, 8);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 0.1 * (double)(i % 8);
    field_build(&f);
    for (int space = 0; space < 2; space++)
        for (int shading = 0; shading < 3 - space; shading++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .shading = (isogi_dvr_shading)shading};
            isogi_dvr *dvr = stepped(&desc, &transfer);
            pixel p = cast(dvr, eye, target, &lighting);
            for (int a = 0; a < 4; a++)
                CHECK(p.c[a] >= 0 && p.c[a] <= 3.1e38f, "space %d, shading %d, channel %d: %g", space, shading, a, (double)p.c[a]);
            isogi_dvr_free(dvr);
        }
    point.rgb[1] = 1.1e30f;
    CHECK(isogi_transfer_validate(&transfer) == ISOGI_INVALID, "%s", "a colour above 1e30");
    point.rgb[1] = 0, transfer.peaks = &peak, transfer.peak_count = 1;
    CHECK(isogi_transfer_validate(&transfer) == ISOGI_INVALID, "%s", "a peak's colour above 1e30");
    field_free(&f);
}

/* What the centre of a picture from far along z (way 0) or the mean visibility at a place (else: a method) says of a field. */
static double seen_by(int way, const field *f, const isogi_transfer *transfer, double unit, size_t grid, const float place[1][3],
                      const double target[3]) {
    const double eye[3] = {target[0], target[1], target[2] + 50};
    const isogi_dvr_desc desc = {.pyramid = f->pyramid, .shading = way ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT, .unit = unit,
        .method = (isogi_dvr_method)way, .grid = {grid, grid, grid}, .directions = 64, .reduction = 1};
    isogi_dvr *dvr = dvr_new(&desc, transfer);
    float v[1][9] = {{0}};
    double seen;
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    if (way) CHECK(isogi_dvr_sample_visibility(dvr, place, 1, v[0]) == ISOGI_OK, "visibility");
    seen = way ? (double)v[0][0] : (double)cast(dvr, eye, target, NULL).c[3];
    isogi_dvr_free(dvr);
    return seen;
}

/* Pictures and visibility depend on values only by way of the transfer function: the same at any scale of both, by every method. */
TEST(values_of_any_scale_look_alike) {
    static const double scales[] = {1, 1e-23, 1e-28, 1e-40, 1e-150, 1e-299, 1e23, 1e32, 1e39, 1e150, 1e299};
    double first[4] = {0, 0, 0, 0};
    for (int k = 0; k < 11; k++) {
        isogi_transfer_point p[3] = {{0.2, {1, 0.5f, 0.2f}, 0}, {0.7, {0.4f, 1, 0.2f}, 2}, {1, {0.1f, 0.2f, 1}, 3}};
        const isogi_transfer transfer = {p, 3, NULL, 0};
        const double target[3] = {4, 5, 4};
        const float place[1][3] = {{4, 4, 4}};
        field f = field_new(9, 9, 9);
        for (int i = 0; i < 729; i++) f.value[i] = (i % 9 + i / 9 % 9) / 16.0 * scales[k];
        for (int i = 0; i < 3; i++) p[i].value *= scales[k];
        field_build(&f);
        for (int way = 0; way < 4; way++) {
            const double seen = seen_by(way, &f, &transfer, 4, 3, place, target);
            if (!k) first[way] = seen;
            CHECK(fabs(seen - first[way]) < (way ? 0.2 : 0.004) && seen > 0.2 && seen < 3.2, "scale %g, %d: %g, not %g", scales[k], way,
                  seen, first[way]);
            if (way < 2 || k < 1) printf("    scale %g, %d: %.4f\n", scales[k], way, seen);
        }
        field_free(&f);
    }
}

/* A value far beyond the transfer function's last point is classified as that point, also where no float holds it. */
TEST(voxels_beyond_floats_are_matter_like_others) {
    static const double big[] = {2, 1e30, 1e37, 3.4028234663852886e38, 1e39, 1e100, 8e307};
    static const isogi_transfer_point p[2] = {{0.2, {1, 0.5f, 0.2f}, 0}, {0.7, {0.4f, 1, 0.2f}, 2}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    const double target[3] = {12, 8, 8};
    const float place[1][3] = {{4, 8, 8}};
    double first[4] = {0};
    for (int k = 0; k < 7; k++) {
        field f = field_new(17, 17, 17);
        for (int i = 0; i < 17 * 17 * 17; i++) f.value[i] = i % 17 > 8 ? big[k] : 0;
        field_build(&f);
        for (int way = 0; way < 4; way++) {
            const double seen = seen_by(way, &f, &transfer, 1, 5, place, target);
            if (!k) first[way] = seen;
            CHECK(fabs(seen - first[way]) < (way ? 0.3 : 0.001) && seen > 0.5 && seen < 2.9, "value %g, %d: %g, not %g", big[k], way, seen,
                  first[way]);
            printf("    value %g, %d: %.4f\n", big[k], way, seen);
        }
        field_free(&f);
    }
}

/* As everywhere, numbers that stand for no path are the best one. */
TEST(paths_of_other_numbers_are_the_best) {
    field f = field_waves(20, 5);
    test_random r = {9};
    const isogi_view view = view_of(&f, 1.5, &r, 24);
    float(*image[3])[4];
    for (int shading = 0; shading < 2; shading++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = shading ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT};
        const isogi_lighting white = {.env = {.sh = sky_one, .sh_order = 1}};
        for (int k = 0; k < 3; k++) {
            const isogi_context context = {.threads = 1, .force_path = k == 1 ? -1 : 9 * k};
            const isogi_transfer transfer = {hills, 6, NULL, 0};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            image[k] = picture(dvr, &view, &white, NULL, NULL);
            isogi_dvr_free(dvr);
        }
        for (int k = 1; k < 3; k++)
            CHECK(!memcmp(image[0], image[k], (size_t)view.width * (size_t)view.height * sizeof *image[0]), "shading %d, path %d", shading,
                  k);
        for (int k = 0; k < 3; k++) free(image[k]);
    }
    field_free(&f);
}

/* The second field is read in double: labels of large numbers, and of small differences, far from the origin; a step of colours at the very
   value of a field that is the same everywhere. Volumes of one geometry, and of another one. */
TEST(second_field_is_read_in_double) {
    static double data[8][8][8], label[9][9][9];
    const double from[5] = {0, 1.6e9, 1e6, 0, 0.7}, step[5] = {1, 10, 0.001, 1, 0}, origin[5] = {0, 0, 0, 33554432, 0};
    for (int k = 0; k < 5; k++)
        for (int wider = 0; wider < 2; wider++) {
            isogi_volume v = {.data = data, .type = ISOGI_F64, .size = {8, 8, 8}, .origin = {origin[k], 0, 0}}, w = v;
            isogi_pyramid *p = NULL, *q = NULL;
            const isogi_peak peak = {3.5, {1, 1, 1}, 1};
            const isogi_transfer transfer = {NULL, 0, &peak, 1};
            const isogi_transfer_point ramp[2] = {{from[k], {0, 0, 1}, 0}, {from[k] + 7 * step[k], {1, 1, 1}, 0}};
            const double eye[3] = {origin[k] + 4, 3.5, 20}, target[3] = {origin[k] + 4, 3.5, 0};
            const int n = wider ? 9 : 8; /* begins a voxel earlier */
            w.data = label, w.size[0] = w.size[1] = w.size[2] = (size_t)n;
            for (int a = 0; a < 3; a++) w.origin[a] -= wider;
            for (int z = 0; z < n; z++)
                for (int y = 0; y < n; y++)
                    for (int x = 0; x < n; x++) {
                        if (z < 8 && y < 8 && x < 8) data[z][y][x] = z;
                        (&label[0][0][0])[x + n * (y + n * z)] = from[k] + step[k] * (x - wider);
                    }
            CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK && isogi_vol_build(&q, &w, NULL) == ISOGI_OK, "build");
            const isogi_dvr_desc desc = {.pyramid = p, .space = ISOGI_DVR_DATA, .second = q, .second_points = ramp, .second_count = 2};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const double expected = step[k] > 0 ? 4 / 7.0 : 1;
            const pixel seen = cast(dvr, eye, target, NULL);
            CHECK(fabs((double)seen.c[0] - expected) < 1e-6 && fabs((double)seen.c[2] - 1) < 1e-6, "%g by %g, %d: %g, not %g", from[k],
                  step[k], wider, (double)seen.c[0], expected);
            isogi_dvr_free(dvr), isogi_vol_free(p), isogi_vol_free(q);
        }
}

/* Colours up to 1e30 are what they are, however dense the matter. */
TEST(matter_glows_at_any_density) {
    field f = field_new(8, 8, 8);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(20 * (i / 64) + 3 * (i % 8));
    field_build(&f);
    for (int k = 0; k < 4; k++) {
        const float rgb = k == 2 ? 1e28f : 1e30f, density = (const float[]){0.1f, 1000, 1e6f, 1e7f}[k];
        const isogi_transfer_point points[2] = {{0, {rgb, rgb / 2, rgb / 4}, density}, {200, {rgb, rgb / 2, rgb / 4}, density}};
        const isogi_transfer transfer = {points, 2, NULL, 0};
        const double eye[3] = {3.5, 3.5, 30}, target[3] = {3.5, 3.5, 0}, opacity = -expm1(-7 * (double)density);
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const pixel seen = cast(dvr, eye, target, NULL);
        for (int c = 0; c < 3; c++)
            CHECK(fabs((double)seen.c[c] / (double)rgb * (1 << c) / opacity - 1) < 1e-3, "density %g, colour %d: %g of %g",
                  (double)density, c, (double)seen.c[c], (double)rgb);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST_MAIN("dvr_hard")
