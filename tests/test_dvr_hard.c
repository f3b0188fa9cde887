/* Scenes made to be hard: grids that are fine along one axis only, matter whose normals alternate, transfer functions with narrow peaks,
   numbers at the ends of their ranges. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include <float.h>
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

/* Nor has one that changes across the ray alone: layers of values whose digits a third of a sum rounds away. In data space they are not
   seen, silhouettes apart. */
TEST(layers_along_the_ray_have_no_side) {
    const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    const isogi_lighting lighting = {.env = {.sh = sky, .sh_order = 1}};
    const double eye[3] = {-4, 2.3, 2.7}, target[3] = {7, 2.3, 2.7};
    test_random r = {3};
    for (int n = 0; n < (QUICK_SUITE ? 100 : 1000); n++) {
        uint8_t bytes[6 * 6 * 12];
        const int exact = n % 2, data_space = n / 2 % 2;
        field f = field_new(12, 6, 6);
        for (size_t i = 0; i < 6; i++) {
            const double value = random_range(&r, 0.5, 1);
            for (size_t k = 0; k < 432; k++)
                if (k / 12 % 6 == i) f.value[k] = value, bytes[k] = (uint8_t)(200 * value);
        }
        if (!exact) f.volume.data = bytes, f.volume.type = ISOGI_U8, f.volume.scale = 1 / 255.0;
        field_build(&f);
        const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 20}, {1.1, {1, 1, 1}, data_space ? 2000 : 20}};
        const isogi_transfer transfer = {points, 2, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .bound = data_space ? 0 : 1, .opaque = 1, .shading = ISOGI_DVR_TWO_SIDED,
                                     .space = data_space ? ISOGI_DVR_DATA : ISOGI_DVR_PHYSICAL,
                                     .material = {{.diffuse = {1, 0, 0}}, {.diffuse = {0, 1, 0}}}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const pixel p = cast(dvr, eye, target, &lighting);
        if (data_space) CHECK(p.c[3] <= 0 && p.depth >= HUGE_VALF, "volume %d: opacity %g, at %g", n, (double)p.c[3], (double)p.depth);
        else CHECK(p.c[3] > 0.99f && fabs((double)p.c[0] - (double)p.c[1]) < 1e-4, "volume %d: red %g, green %g", n, (double)p.c[0],
                   (double)p.c[1]);
        isogi_dvr_free(dvr), field_free(&f);
    }
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

/* Cameras as far as ten million voxels away, with angles to match: a field that rises along x, so that optical depths are in closed form
   along rays that are worked out here, in double. Rounded to floats their directions would be off by half a voxel. Extinction that rises
   with x, and a peak; all ways to cast rays, and tetrahedra. */
TEST(pictures_from_afar_are_those_of_their_rays) {
    enum { N = 24, SIDE = 24 };
    static const char *const ways[] = {"pre-integrated", "bound", "post-classified", "data space", "tetrahedra"};
    const isogi_transfer_point rise[2] = {{0, {1, 1, 1}, 0}, {N - 1, {1, 1, 1}, 0.1f}};
    const isogi_peak peak = {11.3, {1, 1, 1}, 0.5f};
    const double toward[3] = {0.6, 0.48, 0.64};
    field f = field_new(N, N, N);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(i % N);
    field_build(&f);
    float corners[8][3], values[8], image[SIDE * SIDE][4];
    const uint32_t tets[6][4] = {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
    for (int k = 0; k < 8; k++) {
        for (int a = 0; a < 3; a++) corners[k][a] = k >> a & 1 ? N - 1 : 0;
        values[k] = corners[k][0];
    }
    const isogi_tet_mesh mesh = {(const float(*)[3])corners, values, 8, tets, 6};
    isogi_tets *built = NULL;
    CHECK(isogi_dvr_tets_build(&built, &mesh, NULL, &serial) == ISOGI_OK, "tetrahedra");
    for (double away = 1e3; away < 2e7; away *= 10)
        for (int way = 0; way < 5; way++)
            for (int peaks = way == 3; peaks < 2; peaks++) {
                const isogi_transfer transfer = {rise, peaks ? 0 : 2, &peak, (size_t)peaks};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .bound = way == 1 ? 0.01 : 0,
                                             .classification = way == 2 ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT,
                                             .space = way == 3 ? ISOGI_DVR_DATA : ISOGI_DVR_PHYSICAL};
                const isogi_tet_desc physical = {.opaque = 1};
                isogi_view view = {.width = SIDE, .height = SIDE, .fov = (float)(2 * atan(14 / away) * 180 / PI)};
                double worst = 0;
                int sure = 0;
                for (int a = 0; a < 3; a++) view.target[a] = 11.5f, view.eye[a] = (float)(11.5 + away * toward[a]);
                if (way == 4) {
                    CHECK(isogi_dvr_tets_render(built, &physical, &transfer, &view, image, NULL, NULL) == ISOGI_OK, "render");
                } else {
                    isogi_dvr *dvr = dvr_new(&desc, &transfer);
                    CHECK(isogi_dvr_render(dvr, &view, NULL, image, NULL, NULL) == ISOGI_OK, "render");
                    isogi_dvr_free(dvr);
                }
                for (int i = 0; i < SIDE * SIDE; i++) {
                    double eye[3], d[3], from = 0, to = 1e300, x[2], expected;
                    view_ray(&view, i % SIDE, i / SIDE, eye, d);
                    for (int a = 0; a < 3; a++) {
                        const double low = -eye[a] / d[a], high = (N - 1 - eye[a]) / d[a];
                        from = fmax(from, fmin(low, high)), to = fmin(to, fmax(low, high));
                    }
                    for (int k = 0; k < 2; k++) x[k] = eye[0] + (k ? to : from) * d[0];
                    if (peaks && (fabs(x[0] - 11.3) < 0.01 || fabs(x[1] - 11.3) < 0.01 || fabs(to - from) < 0.01)) continue;
                    if (to < from) expected = 0;
                    else if (peaks) expected = (x[0] < 11.3) != (x[1] < 11.3) ? 0.5 : 0;
                    else expected = -expm1(-(to - from) * 0.1 / (N - 1) * (x[0] + x[1]) / 2);
                    worst = fmax(worst, fabs((double)image[i][3] - expected)), sure++;
                }
                CHECK(sure > SIDE * SIDE / 2 && worst < (way == 0 || way == 2 ? 2e-3 : 1e-5), "%s%s from %g voxels away: %g off",
                      ways[way], peaks ? ", a peak" : "", away, worst);
            }
    isogi_dvr_tets_free(built), field_free(&f);
}

/* ---- grids at their ends ---- */

/* A renderer of fog by visibility, finished. */
static isogi_dvr *fog_new(const isogi_pyramid *p, float extinction, const isogi_dvr_desc *given) {
    const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, extinction}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    isogi_dvr_desc desc = *given;
    isogi_dvr *dvr = NULL;
    desc.pyramid = p, desc.shading = ISOGI_DVR_VISIBILITY;
    CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK &&
              isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "fog of %g", (double)extinction);
    return dvr;
}

static double openness(const isogi_dvr *dvr, double x, double y, double z) {
    const float point[1][3] = {{(float)x, (float)y, (float)z}};
    float v[36] = {0};
    isogi_dvr_sample_visibility(dvr, point, 1, v);
    return (double)v[0];
}

/* Along an axis with a single grid point visibility reaches to the ends: pictures by classes are those that sample. */
TEST(a_grid_of_one_point_along_an_axis) {
    enum { N = 48, SIDE = 24 };
    static float voxel[N * N * N], pixel[2][SIDE * SIDE][4];
    const isogi_light sun = {.vector = {0, 0, 1}, .rgb = {10, 10, 10}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {-450, 23.7f, 23.7f}, .target = {0, 23.7f, 23.7f}, .fov = 6};
    isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < N * N * N; i++) voxel[i] = i ? 1 : 0.999f;
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 4; k++) {
        double most = 0;
        for (int way = 0; way < 2; way++) {
            const isogi_dvr_desc desc = {.directions = 64, .grid = {1, 9, 9}, .opaque = 1, .step = 0.1,
                                         .classification = way ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
            isogi_dvr *dvr = fog_new(p, 0.14f + 0.03f * (float)k, &desc);
            isogi_dvr_render(dvr, &view, &lighting, pixel[way], NULL, NULL);
            isogi_dvr_free(dvr);
        }
        for (int i = 0; i < SIDE * SIDE; i++) most = fmax(most, fabs((double)pixel[0][i][0] - (double)pixel[1][i][0]));
        CHECK(most < 0.15, "extinction %g: pixels differ by up to %.3f", 0.14 + 0.03 * k, most);
    }
    isogi_vol_free(p);
}

/* The paper's method: what stands on the upper faces is as open as what stands on the lower ones, for all numbers of voxels. */
TEST(upper_faces_are_as_open_as_lower_ones) {
    for (int k = 0; k < 9; k++) {
        const int axis = k % 3;
        size_t size[3] = {17, 17, 17};
        size[axis] = k < 3 ? 108 : k < 6 ? 119 : 124;
        const size_t count = size[0] * size[1] * size[2];
        float *voxel = (float *)malloc(count * sizeof *voxel);
        isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {size[0], size[1], size[2]}};
        isogi_pyramid *p = NULL;
        for (size_t i = 0; i < count; i++) voxel[i] = i ? 1 : 0.999f;
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
        const isogi_dvr_desc desc = {.method = ISOGI_DVR_PAPER, .sphere = ISOGI_DVR_OCTAHEDRON, .directions = 32, .order = 2,
                                     .reduction = 1};
        isogi_dvr *dvr = fog_new(p, 0.05f, &desc);
        double at[2][3] = {{8, 8, 8}, {8, 8, 8}};
        at[0][axis] = 0, at[1][axis] = (double)size[axis] - 1;
        const double low = openness(dvr, at[0][0], at[0][1], at[0][2]), high = openness(dvr, at[1][0], at[1][1], at[1][2]);
        CHECK(low > 1 && fabs(high - low) < 0.02 * low, "%d voxels along axis %d: %.4f below, %.4f above", (int)size[axis], axis, low,
              high);
        isogi_dvr_free(dvr), isogi_vol_free(p), free(voxel);
    }
}

/* Sweeps: a wall beside a layer of NaN throws the shadow that it throws on the other side of one, along every axis. */
TEST(walls_beside_what_is_not_finite_keep_their_shadows) {
    double first = 0;
    for (int k = 0; k < 6; k++) {
        static float voxel[17 * 17 * 17];
        const int axis = k / 2, gap = 8 + (k % 2 ? 1 : -1);
        isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {17, 17, 17}};
        isogi_pyramid *p = NULL;
        for (int i = 0; i < 17 * 17 * 17; i++) {
            const int c[3] = {i % 17, i / 17 % 17, i / 289};
            voxel[i] = c[axis] == gap ? NAN : c[axis] == 8 ? 1 : 0;
        }
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
        const isogi_dvr_desc desc = {.sphere = ISOGI_DVR_OCTAHEDRON, .directions = 128, .order = 1, .visibility_step = 1,
                                     .grid = {17, 17, 17}};
        isogi_dvr *dvr = fog_new(p, 2, &desc);
        double at[3] = {8, 8, 8};
        at[axis] = k % 2 ? 2 : 14; /* the wall lies between */
        const double open = openness(dvr, at[0], at[1], at[2]);
        if (!k) first = open;
        CHECK(open < 3 && fabs(open - first) < 0.01, "axis %d, NaN at %d: %.4f, not %.4f", axis, gap, open, first);
        isogi_dvr_free(dvr), isogi_vol_free(p);
    }
}

/* One pixel along x, through the middle of a volume of floats. */
typedef struct probe { double opacity, depth, red; } probe;
static probe seen_along_x(const float *voxel, const size_t size[3], const isogi_dvr_desc *given, const isogi_transfer_point *points,
                          size_t count, const isogi_lighting *lighting, int path) {
    const isogi_context context = {.threads = 1, .force_path = path};
    const isogi_transfer transfer = {points, count, NULL, 0};
    const float y = 0.5f * (float)(size[1] - 1), z = 0.5f * (float)(size[2] - 1);
    const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {size[0], size[1], size[2]}};
    const isogi_view view = {.width = 1, .height = 1, .eye = {-10, y, z}, .target = {0, y, z}};
    isogi_pyramid *p = NULL;
    isogi_dvr *dvr = NULL;
    isogi_dvr_desc desc = *given;
    float pixel[1][4] = {{0}}, depth[1] = {0};
    CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
    desc.pyramid = p, desc.opaque = 1;
    CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK &&
              isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_render(dvr, &view, lighting, pixel, depth, NULL) == ISOGI_OK, "render");
    isogi_dvr_free(dvr), isogi_vol_free(p);
    return (probe){(double)pixel[0][3], (double)depth[0], (double)pixel[0][0]};
}

/* Up to 2^24 samples a ray are allowed, and taken. */
SLOW_TEST(rays_of_more_than_ten_million_samples) {
    static float voxel[4 * 1010];
    const size_t size[3] = {1010, 2, 2};
    const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, 0.0005f}};
    const isogi_dvr_desc desc = {.step = 1e-4};
    for (int i = 0; i < 4 * 1010; i++) voxel[i] = 1;
    const probe p = seen_along_x(voxel, size, &desc, points, 2, NULL, 0);
    CHECK(fabs(p.opacity - 0.396) < 0.1 && p.depth < 1100, "opacity %g, depth %g", p.opacity, p.depth); /* floats add up to much by then */
}

/* A piece of ray may lead over a whole block: what lies between the values at its ends counts, whatever else is in the volume. */
TEST(pieces_longer_than_blocks_are_not_leapt_over) {
    static float voxel[64 * 8 * 8];
    const size_t size[3] = {64, 8, 8};
    const isogi_transfer_point points[5] = {
        {0.1, {1, 1, 1}, 0}, {0.4, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 1}, {0.6, {1, 1, 1}, 0}, {0.9, {1, 1, 1}, 0}};
    for (int path = 1; path <= 4; path++)
        for (int step = 3; step <= 12; step++) {
            const isogi_dvr_desc desc = {.step = step, .tolerance = 1e30};
            double opacity[2];
            for (int near = 0; near < 2; near++) { /* matter where the ray begins */
                for (int i = 0; i < 64 * 64; i++) voxel[i] = i % 64 > 20 ? 1 : near && i % 64 < 2 ? 0.45f : 0;
                opacity[near] = seen_along_x(voxel, size, &desc, points, 5, NULL, path).opacity;
            }
            CHECK(opacity[0] > 0.2 && opacity[1] >= opacity[0] - 1e-5, "path %d, step %d: %.4f, %.4f with matter before", path, step,
                  opacity[0], opacity[1]);
        }
}

/* Floats whose difference is beyond floats. */
TEST(matter_between_the_largest_floats) {
    static float voxel[8 * 8 * 8];
    const size_t size[3] = {8, 8, 8};
    const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 0}, {1, {1, 0.5f, 0.2f}, 0.2f}};
    const isogi_dvr_desc desc = {.step = 0.25};
    const float huge[4] = {1.6e38f, 1.8e38f, 3e38f, FLT_MAX};
    for (int k = 0; k < 8; k++) {
        for (int i = 0; i < 512; i++) voxel[i] = i % 8 < 4 ? -huge[k / 2] : huge[k / 2];
        const probe p = seen_along_x(voxel, size, &desc, points, 2, NULL, k % 2);
        CHECK(fabs(p.opacity - (1 - exp(-0.2 * 3.5))) < 2e-3, "%g, path %d: %.5f", (double)huge[k / 2], k % 2, p.opacity);
    }
    double open[2];
    for (int k = 0; k < 2; k++) { /* and their shadows, by sweeps */
        static float slabs[33 * 33 * 33];
        isogi_pyramid *p = NULL;
        for (int i = 0; i < 33 * 33 * 33; i++) slabs[i] = i % 33 % 4 == 2 ? (k ? 3e38f : 1.4e38f) : -0.9f * (k ? 3e38f : 1.4e38f);
        const isogi_volume v = {.data = slabs, .type = ISOGI_F32, .size = {33, 33, 33}};
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
        const isogi_dvr_desc fog = {.order = 2, .directions = 64, .grid = {9, 9, 9}, .visibility_step = 2, .method = ISOGI_DVR_SWEEP};
        isogi_dvr *dvr = fog_new(p, 0.3f, &fog);
        open[k] = openness(dvr, 16, 16, 16);
        isogi_dvr_free(dvr), isogi_vol_free(p);
    }
    CHECK(open[0] < 1 && fabs(open[0] - open[1]) < 0.01, "open %.4f, of the largest %.4f", open[0], open[1]);
}

/* The least light is that of the sum of sky and lamps, on every path. */
SLOW_TEST(lamps_are_added_before_the_least_light) {
    enum { N = 32 };
    static float voxel[N * N * N], image[16 * 32 * 3];
    const isogi_transfer_point points[4] = {{0.2, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0.05f}, {0.7, {1, 1, 1}, 0.05f}, {1, {0, 0, 0}, 20}};
    const isogi_transfer transfer = {points, 4, NULL, 0};
    const isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {15.5f, 6, 60}, .rgb = {12000, 12000, 12000}};
    const isogi_lighting lighting = {.env = {.rgb = image, .width = 32, .height = 16}, .lights = &lamp, .light_count = 1};
    const isogi_view view = {.width = 1, .height = 1, .eye = {15.5f, 5, 100}, .target = {15.5f, 5, 15}, .fov = 1};
    const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_pyramid *p = NULL;
    float pixel[2][1][4];
    for (int i = 0; i < N * N * N; i++) voxel[i] = i / N % N >= 18 && i / N % N < 21 ? 1 : i / N % N < 12 ? 0.5f : 0;
    for (int i = 0; i < 16 * 32 * 3; i++) image[i] = i < 2 * 32 * 3 ? 100 : 0.02f; /* a bright spot above, hidden by a wall */
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int way = 0; way < 2; way++) {
        const isogi_dvr_desc desc = {.pyramid = p, .shading = ISOGI_DVR_VISIBILITY, .step = 0.25, .order = 3, .opaque = 1,
                                     .directions = 128, .grid = {17, 17, 17}, .method = ISOGI_DVR_BRUTE,
                                     .classification = way ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
        isogi_dvr *dvr = NULL;
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK &&
                  isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_render(dvr, &view, &lighting, pixel[way], NULL, NULL) == ISOGI_OK,
              "render");
        isogi_dvr_free(dvr);
    }
    CHECK(fabs((double)pixel[0][0][0] - (double)pixel[1][0][0]) < 0.01 * (double)pixel[1][0][0], "by classes %.5f, sampled %.5f",
          (double)pixel[0][0][0], (double)pixel[1][0][0]);
    isogi_vol_free(p);
}

/* The paper's blocks hold the values of nearly all voxels as well as ever, however far off a single one is. */
TEST(one_far_voxel_takes_no_digits_from_the_others) {
    static float voxel[33 * 33 * 33], points[512][3], value[512], ambient[512][4];
    const float far[4] = {0, -9999, -1e6f, -1e9f};
    for (int k = 0; k < 4; k++) {
        isogi_pyramid *p = NULL;
        double off = 0;
        for (int i = 0; i < 33 * 33 * 33; i++)
            voxel[i] = i ? 0.5f + 0.5f * sinf(0.3f * (float)(i % 33)) * cosf(0.25f * (float)(i / 33 % 33)) : far[k];
        const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {33, 33, 33}};
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
        const isogi_dvr_desc desc = {.method = ISOGI_DVR_PAPER, .order = 2, .directions = 16, .grid = {5, 5, 5}, .reduction = 1};
        isogi_dvr *dvr = fog_new(p, 0.1f, &desc);
        for (int i = 0; i < 512; i++)
            points[i][0] = (float)(18 + i % 8), points[i][1] = (float)(18 + i / 8 % 8), points[i][2] = (float)(18 + i / 64);
        CHECK(isogi_dvr_sample_blocks(dvr, (const float(*)[3])points, 512, value, ambient[0]) == ISOGI_OK, "blocks");
        for (int i = 0; i < 512; i++)
            off = fmax(off, fabs((double)value[i] - (double)voxel[(int)points[i][0] + 33 * (int)points[i][1] + 1089 * (int)points[i][2]]));
        CHECK(off < 1e-5, "a voxel of %g: values off by up to %g", (double)far[k], off);
        isogi_dvr_free(dvr), isogi_vol_free(p);
    }
}

/* Sweeps: what was prepared for a function of wide classes is prepared again for one of narrow ones, however far it had got. */
TEST(planes_prepared_for_wide_classes_are_prepared_again) {
    static float voxel[33 * 33 * 33];
    const isogi_transfer_point wide[3] = {{500.02, {1, 1, 1}, 0}, {500.03, {1, 1, 1}, 0.2f}, {1000, {1, 0, 0}, 0.2f}};
    const isogi_transfer before = {wide, 3, NULL, 0}, after = {wide, 2, NULL, 0};
    const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {33, 33, 33}};
    isogi_pyramid *p = NULL;
    double open[3];
    for (int i = 0; i < 33 * 33 * 33; i++) {
        const int x = i % 33, y = i / 33 % 33, z = i / 1089;
        voxel[i] = x % 16 || y % 16 || z % 16 ? (x / 4 + y / 4 + z / 4) % 2 ? 500.0f : 500.05f : 1000;
    }
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 3; k++) { /* never the first function; a part of it; all */
        const isogi_dvr_desc desc = {.pyramid = p, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .directions = 64, .grid = {9, 9, 9},
                                     .visibility_step = 1};
        isogi_dvr *dvr = NULL;
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK, "create");
        if (k) isogi_dvr_set_transfer(dvr, &before);
        for (int i = 0; i < 28 && k == 1; i++) isogi_dvr_step(dvr, 1, NULL);
        if (k == 2) isogi_dvr_step(dvr, 0, NULL);
        CHECK(isogi_dvr_set_transfer(dvr, &after) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        open[k] = openness(dvr, 16, 16, 16);
        isogi_dvr_free(dvr);
    }
    CHECK(fabs(open[1] - open[0]) < 0.01 && fabs(open[2] - open[0]) < 0.01, "anew %.4f, after a part %.4f, after all %.4f", open[0],
          open[1], open[2]);
    isogi_vol_free(p);
}

/* A ray along an isosurface has the opacity of those beside it, by samples too. */
TEST(rays_along_isosurfaces_are_seen_by_samples_too) {
    static float voxel[33 * 33 * 33], pixel[9][4];
    const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 0.02f}, {32, {1, 1, 1}, 0.02f}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {33, 33, 33}};
    const isogi_view view = {.width = 9, .height = 1, .eye = {16.5f, 16.5f, 100}, .target = {16.5f, 16.5f, 0}, .fov = 1e-2f};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < 33 * 33 * 33; i++) voxel[i] = (float)(i % 33);
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 6; k++) {
        const isogi_dvr_desc desc = {.pyramid = p, .space = ISOGI_DVR_DATA, .opaque = 1,
                                     .classification = (isogi_dvr_classification)(k / 2),
                                     .silhouette = k % 2 ? ISOGI_DVR_SILHOUETTE_GRADIENT : ISOGI_DVR_SILHOUETTE_EXACT};
        isogi_dvr *dvr = NULL;
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK &&
                  isogi_dvr_render(dvr, &view, NULL, pixel, NULL, NULL) == ISOGI_OK, "render");
        for (int i = 0; i < 9; i++)
            CHECK(fabs((double)pixel[i][3] - (1 - exp(-0.02 * 32))) < 0.01, "case %d, pixel %d: %.4f", k, i, (double)pixel[i][3]);
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(p);
}

/* An isosurface seen edge on behind a block that has its value throughout is seen as it is from a hair beside it. (Not by the approximate
   silhouettes, which weight the opacity of a piece: one of a single value has none.) */
TEST(silhouettes_behind_a_block_of_one_value) {
    static float voxel[9 * 9 * 33];
    const isogi_transfer_point points[2] = {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {33, 9, 9}};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < 9 * 9 * 33; i++) voxel[i] = 0.5f + (i % 33 > 8 ? 0.05f * (float)(i / 33 % 9 - 4) : 0);
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int k = ISOGI_DVR_SILHOUETTE_NONE; k <= ISOGI_DVR_SILHOUETTE_GRADIENT; k++) {
        const isogi_dvr_desc desc = {.pyramid = p, .space = ISOGI_DVR_DATA, .silhouette = (isogi_dvr_silhouette)k};
        isogi_dvr *dvr = NULL;
        float pixel[2][4];
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
        for (int i = 0; i < 2; i++) {
            const float y = i ? 4.0001f : 4;
            const isogi_view view = {.width = 1, .height = 1, .eye = {-5, y, 4.3f}, .target = {40, y, 4.3f}, .fov = 1};
            isogi_dvr_render(dvr, &view, NULL, pixel + i, NULL, NULL);
        }
        if (k == ISOGI_DVR_SILHOUETTE_APPROXIMATE) pixel[1][3] = 0;
        CHECK(fabs((double)pixel[0][3] - (double)pixel[1][3]) < 1e-3, "silhouette %d: %.6f, beside it %.6f", k, (double)pixel[0][3],
              (double)pixel[1][3]);
        CHECK(k != ISOGI_DVR_SILHOUETTE_EXACT || pixel[0][3] > 0.3f, "opacity %g", (double)pixel[0][3]);
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(p);
}

/* Before a transfer function is set nothing is there: no ray is needed to know. */
TEST(without_a_transfer_function_nothing_costs_rays) {
    static float voxel[32 * 32 * 32], pixel[64 * 64][4];
    const isogi_view view = {.width = 64, .height = 64, .eye = {15, 15, 100}, .target = {15, 15, 15}};
    const isogi_lighting dark = {.light_count = 0};
    isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {32, 32, 32}};
    isogi_pyramid *p = NULL;
    for (int i = 0; i < 32 * 32 * 32; i++) voxel[i] = 0.01f * (float)(i % 32) + 0.02f * (float)(i / 32 % 32);
    CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
    for (int k = 0; k < 3; k++) {
        const isogi_dvr_desc desc = {.pyramid = p, .shading = ISOGI_DVR_VISIBILITY, .directions = 16,
                                     .space = k == 1 ? ISOGI_DVR_DATA : ISOGI_DVR_PHYSICAL, .bound = k == 2 ? 0.1 : 0,
                                     .method = k == 2 ? ISOGI_DVR_PAPER : ISOGI_DVR_BRUTE};
        isogi_dvr *dvr = NULL;
        isogi_counters step = {0}, picture = {0};
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "create");
        isogi_dvr_counters(dvr, &step);
        CHECK(isogi_dvr_render(dvr, &view, &dark, pixel, NULL, &picture) == ISOGI_OK && step.rays == 0 && picture.cells == 0 &&
                  picture.samples == 0,
              "way %d: %d rays, %d cells, %d samples", k, (int)step.rays, (int)picture.cells, (int)picture.samples);
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(p);
}

/* An axis of one voxel has no neighbouring voxels: extinction is per the spacing of the others, whatever its own says. */
TEST(a_slice_has_the_spacing_of_its_plane) {
    static float voxel[33 * 33];
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.01f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const double through = 1 - exp(-0.01 * 64 / 2);
    for (int i = 0; i < 33 * 33; i++) voxel[i] = 1;
    for (int k = 0; k < 12; k++) {
        const double own[4] = {0, 4, 0.01, 1};
        isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {33, 33, 1}, .spacing = {2, 2, own[k % 4]}};
        isogi_pyramid *p = NULL;
        isogi_dvr *dvr = NULL;
        float pixel[1][4];
        CHECK(isogi_vol_build(&p, &v, NULL) == ISOGI_OK, "build");
        const isogi_dvr_desc desc = {.pyramid = p, .opaque = 1, .bound = k / 4 == 1 ? 0.1 : 0, .unit = k / 4 == 2 ? 2 : 0};
        const isogi_view view = {.width = 1, .height = 1, .fov = 1, .eye = {-40, 32, 0}, .target = {10, 32, 0}};
        CHECK(isogi_dvr_create(&dvr, &desc, NULL) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK &&
                  isogi_dvr_render(dvr, &view, NULL, pixel, NULL, NULL) == ISOGI_OK, "render");
        CHECK(fabs((double)pixel[0][3] - through) < 1e-4, "spacing %g, way %d: %.5f, not %.5f", own[k % 4], k / 4, (double)pixel[0][3],
              through);
        isogi_dvr_free(dvr), isogi_vol_free(p);
    }
}

TEST_MAIN("dvr_hard")
