/* Classes of values follow the transfer function: outliers, wide ranges, steps and integrators of isogi_dvr.h. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

enum { SIDE = 32, COUNT = 9 };

/* |x| from the middle of the box, and one voxel in a corner that is something else. */
static field radius_field(int n, double outlier) {
    field f = field_new(n, n, n);
    for (size_t i = 0; i < field_count(&f); i++) {
        double x = (double)(i % (size_t)n) - n / 2, y = (double)(i / (size_t)n % (size_t)n) - n / 2, z = (double)(i / (size_t)n / (size_t)n) - n / 2;
        f.value[i] = sqrt(x * x + y * y + z * z);
    }
    if (outlier > 0) f.value[0] = outlier;
    field_build(&f);
    return f;
}

__attribute__((unused)) static const isogi_view view_49 = {.width = SIDE, .height = SIDE, .eye = {90, 70, 100}, .target = {24, 24, 24}, .fov = 35};
static const isogi_transfer_point shell[] = {{0, {1, 0.5f, 0.2f}, 0}, {12, {0.2f, 0.5f, 1}, 0}, {13.5, {1, 1, 1}, 0.4f}, {15, {1, 1, 1}, 0}};

__attribute__((unused)) static double opacity_difference(float (*a)[4], float (*b)[4], int count) {
    double worst = 0;
    for (int i = 0; i < count; i++) worst = fmax(worst, fabs((double)a[i][3] - (double)b[i][3]));
    return worst;
}

/* A shell of a sphere, and one voxel outside of it that takes nearly all of the range of values: neither shadows nor histograms see it. */
TEST(an_outlier_takes_no_shadow_from_any_method) {
    const double outlier[] = {40, 400, 4e3, 1e30};
    const isogi_transfer transfer = {shell, 4, NULL, 0};
    for (int k = 0; k < 4; k++) {
        field f = radius_field(49, outlier[k]);
        float v[4][COUNT];
        const float middle[3] = {24, 24, 24};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .directions = 32, .grid = {7, 7, 7}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &middle, 1, v[method]) == ISOGI_OK, "step");
            /* behind the shell, of depth 0.6; the two other methods see it a little blurred */
            CHECK(fabs((double)v[method][0] - 1.94) < 0.15, "outlier %g, method %d: %g", outlier[k], method, (double)v[method][0]);
            CHECK(fabs((double)v[method][0] / (double)v[ISOGI_DVR_BRUTE][0] - 1) < 0.1, "outlier %g, method %d: %g of %g", outlier[k], method,
                  (double)v[method][0], (double)v[ISOGI_DVR_BRUTE][0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
}

/* The same, where the transfer function goes from end to end of the range: a tent as wide as a thousandth of it. */
TEST(narrow_tents_in_a_wide_range_cast_shadows) {
    float v[2][4][COUNT];
    for (int wide = 0; wide < 2; wide++) {
        field f = radius_field(49, wide ? 4000 : 0);
        const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {14, {1, 1, 1}, 0}, {16, {1, 1, 1}, 0.3f}, {18, {1, 1, 1}, 0}, {4000, {1, 1, 1}, 0.001f}};
        const isogi_transfer transfer = {p, wide ? 5 : 4, NULL, 0};
        const float middle[3] = {24, 24, 24};
        for (int method = ISOGI_DVR_BRUTE; method <= ISOGI_DVR_SWEEP; method++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)method, .directions = 32, .grid = {7, 7, 7},
                                         .visibility_step = 0.5};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            float *at = v[wide][method];
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_sample_visibility(dvr, &middle, 1, at) == ISOGI_OK, "step");
            if (method != ISOGI_DVR_PAPER) CHECK(fabs((double)at[0] / (sqrt(4 * PI) * exp(-0.6)) - 1) < 0.02, "method %d: %g", method, (double)at[0]);
            isogi_dvr_free(dvr);
        }
        field_free(&f);
    }
    /* local rays take steps of a voxel between nodes: what they blur of a tent, they blur in either range */
    CHECK(fabs((double)v[1][ISOGI_DVR_PAPER][0] / (double)v[0][ISOGI_DVR_PAPER][0] - 1) < 0.04, "the paper's method: %g, and %g in a wide range",
          (double)v[0][ISOGI_DVR_PAPER][0], (double)v[1][ISOGI_DVR_PAPER][0]);
}

/* Outliers leave the suggested points where they were. */
TEST(suggestions_leave_out_outliers) {
    const double outlier[] = {0, 400, 1e5, 1e30};
    double first = 0;
    for (int k = 0; k < 4; k++) {
        field f = radius_field(49, outlier[k]);
        isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
        double threshold;
        CHECK(isogi_transfer_suggest(f.pyramid, ISOGI_DVR_PHYSICAL, p, &threshold) == ISOGI_OK, "suggest");
        if (!k) first = threshold;
        CHECK(fabs(threshold - first) < 1 && p[5].value < 84, "outlier %g: threshold %g, not %g; last point %g", outlier[k], threshold, first, p[5].value);
        field_free(&f);
    }
}

TEST_MAIN("dvr_classes")
