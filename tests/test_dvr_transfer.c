/* Transfer functions to begin with: presets, imported tables, suggestions from a histogram. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "procedural.h"

TEST(presets_are_valid_and_span_their_range) {
    isogi_transfer_point p[ISOGI_PRESET_POINTS];
    for (int preset = 0; preset < 4; preset++) {
        CHECK(isogi_transfer_preset((isogi_preset)preset, -3, 1e6, 0.5f, p) == ISOGI_OK, "preset %d", preset);
        const isogi_transfer t = {p, ISOGI_PRESET_POINTS, NULL, 0};
        float rgb[3], extinction;
        CHECK(isogi_transfer_validate(&t) == ISOGI_OK, "preset %d is valid", preset);
        CHECK(fabs(p[0].value + 3) < 1e-12 && fabs(p[8].value - 1e6) < 1e-6 && p[0].extinction <= 0 &&
                  fabsf(p[8].extinction - 0.5f) < 1e-7f,
              "ends of %d", preset);
        isogi_transfer_at(&t, (1e6 - 3) / 2, rgb, &extinction);
        CHECK(fabsf(extinction - 0.25f) < 1e-6f, "extinction %g in the middle", (double)extinction);
        for (int i = 0; i < 9; i++)
            for (int a = 0; a < 3; a++) CHECK(p[i].rgb[a] >= 0 && p[i].rgb[a] <= 1, "colour %g", (double)p[i].rgb[a]);
    }
    CHECK(isogi_transfer_preset(ISOGI_PRESET_HOT, 1, 1, 1, p) == ISOGI_INVALID &&
              isogi_transfer_preset(ISOGI_PRESET_HOT, 2, 1, 1, p) == ISOGI_INVALID,
          "range");
    CHECK(isogi_transfer_preset(ISOGI_PRESET_HOT, 0, 1, -1, p) == ISOGI_INVALID &&
              isogi_transfer_preset((isogi_preset)4, 0, 1, 1, p) == ISOGI_INVALID,
          "values");
    CHECK(isogi_transfer_preset(ISOGI_PRESET_HOT, 0, (double)NAN, 1, p) == ISOGI_INVALID &&
              isogi_transfer_preset(ISOGI_PRESET_HOT, 0, 1, 1, NULL) == ISOGI_INVALID,
          "NaN");
}

TEST(imported_tables_keep_opacity_and_colour) {
    const float table[4][4] = {{0, 0.5f, 1, 0}, {0.1f, 0.2f, 0.05f, 0.25f}, {0.5f, 0.25f, 0, 0.5f}, {1, 1, 1, 1}};
    isogi_transfer_point p[4];
    for (int flags = 0; flags < 4; flags++) {
        CHECK(isogi_transfer_import(table, 4, 10, 40, 2, flags, p) == ISOGI_OK, "flags %d", flags);
        for (int i = 0; i < 4; i++) {
            CHECK(fabs(p[i].value - (10 + 10 * i)) < 1e-9, "value %g", p[i].value);
            double opacity = -expm1(-2 * (double)p[i].extinction);
            CHECK(fabs(opacity - (double)table[i][3]) < 2e-7, "opacity of length 2: %g, not %g", opacity, (double)table[i][3]);
            for (int a = 0; a < 3; a++) {
                double x = (double)table[i][a];
                if (flags & ISOGI_TABLE_SRGB) x = x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
                if (flags & ISOGI_TABLE_PREMULTIPLIED) x = table[i][3] > 0 ? fmin(1, x / (double)table[i][3]) : 0;
                CHECK(fabs((double)p[i].rgb[a] - x) < 1e-6, "flags %d entry %d channel %d: %g, not %g", flags, i, a, (double)p[i].rgb[a],
                      x);
            }
        }
    }
    float bad[2][4] = {{0, 0, 0, 0}, {0, 0, 0, 2}};
    CHECK(isogi_transfer_import((const float(*)[4])bad, 2, 0, 1, 1, 0, p) == ISOGI_INVALID, "opacity 2");
    bad[1][3] = NAN;
    CHECK(isogi_transfer_import((const float(*)[4])bad, 2, 0, 1, 1, 0, p) == ISOGI_INVALID, "NaN");
    CHECK(isogi_transfer_import(table, 1, 0, 1, 1, 0, p) == ISOGI_INVALID &&
              isogi_transfer_import(table, 4, 1, 1, 1, 0, p) == ISOGI_INVALID,
          "sizes");
    CHECK(isogi_transfer_import(table, 4, 0, 1, 0, 0, p) == ISOGI_INVALID &&
              isogi_transfer_import(table, 4, 0, 1, 1, 4, p) == ISOGI_INVALID,
          "length, flags");
    CHECK(isogi_transfer_import(NULL, 4, 0, 1, 1, 0, p) == ISOGI_INVALID &&
              isogi_transfer_import(table, 4, 0, 1, 1, 0, NULL) == ISOGI_INVALID,
          "NULL");
}

/* Where low and high are fewer numbers apart than a table has entries, several points have one value. */
/* Premultiplied colours above their opacity are those of opacity: 1. */
TEST(premultiplied_colours_end_at_one) {
    const float table[2][4] = {{0.5f, 0.2f, 0.25f, 0.25f}, {1, 1, 0, 0.5f}};
    isogi_transfer_point p[2];
    CHECK(isogi_transfer_import(table, 2, 0, 1, 1, ISOGI_TABLE_PREMULTIPLIED, p) == ISOGI_OK, "import");
    for (int a = 0; a < 3; a++)
        CHECK(fabsf(p[0].rgb[a] - (a == 1 ? 0.8f : 1)) < 1e-6f && fabsf(p[1].rgb[a] - (a < 2)) < 1e-6f, "channel %d: %g, %g", a,
              (double)p[0].rgb[a], (double)p[1].rgb[a]);
}

TEST(tables_of_more_entries_than_numbers_are_valid) {
    enum { COUNT = 322 };
    static float table[COUNT][4];
    isogi_transfer_point p[COUNT];
    test_random r = {8};
    for (int run = 0; run < 200; run++) {
        const double low = random_range(&r, -1, 1);
        double high = low;
        for (int i = 0; i < 1 + run; i++) high = nextafter(high, 2);
        const isogi_transfer transfer = {p, COUNT, NULL, 0};
        CHECK(isogi_transfer_import((const float(*)[4])table, COUNT, low, high, 1, 0, p) == ISOGI_OK &&
                  isogi_transfer_validate(&transfer) == ISOGI_OK && p[COUNT - 1].value <= high,
              "%.17g to %.17g", low, high);
    }
}

/* And so have several points of a preset; denormals, too. */
TEST(presets_of_ranges_of_a_few_roundings_are_valid) {
    isogi_transfer_point p[ISOGI_PRESET_POINTS];
    const isogi_transfer transfer = {p, ISOGI_PRESET_POINTS, NULL, 0};
    test_random r = {11};
    for (int run = 0; run < 2000; run++) {
        const double low = run % 4 ? random_range(&r, -1, 1) : (run / 4 % 20 - 10) * 4.9406564584124654e-324;
        double high = low;
        for (int i = 0; i < 1 + run % 12; i++) high = nextafter(high, 2);
        CHECK(isogi_transfer_preset((isogi_preset)(run % 3), low, high, 1, p) == ISOGI_OK &&
                  isogi_transfer_validate(&transfer) == ISOGI_OK && p[0].value <= low && p[ISOGI_PRESET_POINTS - 1].value >= high,
              "%.17g to %.17g", low, high);
    }
}

/* Three materials with noise: the thresholds part them. */
TEST(suggestions_part_what_the_histogram_parts) {
    test_random r = {9};
    for (int n = 0; n < 20; n++) {
        field f = field_new(24, 24, 24);
        double scale = pow(10, random_range(&r, -8, 8)), bias = scale * random_range(&r, -3, 3), threshold;
        for (size_t i = 0; i < field_count(&f); i++) {
            double x = (double)(i % 24), level = x < 14 ? 0 : x < 19 ? 1 : 2.2;
            f.value[i] = bias + scale * (level + random_range(&r, -0.15, 0.15));
        }
        field_build(&f);
        for (int space = 0; space < 2; space++) {
            isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
            const isogi_transfer t = {p, ISOGI_SUGGEST_POINTS, NULL, 0};
            CHECK(isogi_transfer_suggest(f.pyramid, (isogi_dvr_space)space, p, &threshold) == ISOGI_OK &&
                      isogi_transfer_validate(&t) == ISOGI_OK,
                  "suggest");
            double first = (threshold - bias) / scale, second = (p[3].value - bias) / scale;
            CHECK(first > 0.14 && first < 0.87 && second > 1.13 && second < 2.07, "thresholds %g %g", first, second);
            float rgb[3], air, middle, top;
            isogi_transfer_at(&t, bias, rgb, &air), isogi_transfer_at(&t, bias + scale, rgb, &middle),
                isogi_transfer_at(&t, bias + 2.2 * scale, rgb, &top);
            CHECK(air <= 0 && middle > 0 && top > middle, "air %g, then %g, %g", (double)air, (double)middle, (double)top);
        }
        field_free(&f);
    }
}

/* Air of one value takes three fifths of the voxels, and would be a class of its own; the three classes are those of what it surrounds. */
TEST(suggestions_do_not_count_air_as_a_class) {
    test_random r = {10};
    field f = field_new(30, 24, 24);
    double threshold;
    for (size_t i = 0; i < field_count(&f); i++) {
        size_t x = i % 30;
        f.value[i] = x < 18 ? 0 : (x < 22 ? 1 : x < 26 ? 2 : 3.2) + random_range(&r, -0.15, 0.15);
    }
    field_build(&f);
    for (int space = 0; space < 2; space++) {
        isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
        CHECK(isogi_transfer_suggest(f.pyramid, (isogi_dvr_space)space, p, &threshold) == ISOGI_OK, "suggest");
        CHECK(threshold > 1.13 && threshold < 1.87 && p[3].value > 2.13 && p[3].value < 3.07, "thresholds %g %g", threshold, p[3].value);
    }
    field_free(&f);
}

/* Air of a value between two others is no class, but it is no gap between them either: the first threshold parts it from what is below, in
   the middle of what is empty there. */
TEST(thresholds_stay_on_their_side_of_air) {
    field f = field_new(20, 20, 20);
    isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
    double threshold;
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = i % 20 < 4 ? 50 : i % 20 < 16 ? 100 : 200;
    field_build(&f);
    CHECK(isogi_transfer_suggest(f.pyramid, ISOGI_DVR_PHYSICAL, p, &threshold) == ISOGI_OK, "suggest");
    CHECK(threshold > 70 && threshold < 80 && p[3].value < 100, "thresholds %g %g", threshold, p[3].value);
    field_free(&f);
}

/* Up to a thousandth of the voxels at an end of the range is left out where that halves it, two are not. */
TEST(a_thousandth_of_outliers_is_left_out) {
    for (int n = 0; n < 4; n++) {
        const int high = n % 2, few = n / 2;
        field f = field_new(40, 40, 40);
        isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
        for (size_t i = 0; i < field_count(&f); i++)
            f.value[i] = i % (few ? 1200 : 500) == 7 ? (high ? 50 : -49) : (double)(i * 7919 % 1000) / 999;
        field_build(&f);
        CHECK(isogi_transfer_suggest(f.pyramid, ISOGI_DVR_PHYSICAL, p, NULL) == ISOGI_OK, "suggest");
        CHECK(few ? p[0].value > -1 && p[5].value < 2 : high ? p[5].value > 49 : p[0].value < -48, "%s %s: from %g to %g",
              few ? "few" : "many", high ? "high" : "low", p[0].value, p[5].value);
        field_free(&f);
    }
}

TEST(suggestions_for_odd_volumes_are_valid) {
    isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
    const isogi_transfer t = {p, ISOGI_SUGGEST_POINTS, NULL, 0};
    const double values[][2] = {{5, 5}, {0, 1e-300}, {-1e300, 1e300}, {(double)NAN, 3}, {(double)NAN, (double)NAN}, {1, 1 + 1e-15}};
    for (size_t n = 0; n < 6; n++)
        for (int thin = 0; thin < 2; thin++) {
            field f = field_new(thin ? 1 : 5, 4, 3);
            for (size_t i = 0; i < field_count(&f); i++) f.value[i] = values[n][i % 2];
            field_build(&f);
            for (int space = 0; space < 2; space++)
                CHECK(isogi_transfer_suggest(f.pyramid, (isogi_dvr_space)space, p, NULL) == ISOGI_OK &&
                          isogi_transfer_validate(&t) == ISOGI_OK,
                      "case %zu", n);
            field_free(&f);
        }
    CHECK(isogi_transfer_suggest(NULL, ISOGI_DVR_DATA, p, NULL) == ISOGI_INVALID, "NULL");
}

/* Few voxels in emptiness, a layer at the end of an axis, and masks have two values: classes begin halfway between them. A single value is
   not seen, in either space. */
TEST(suggestions_for_one_and_two_values) {
    enum { SIDE = 32, COUNT = SIDE * SIDE * SIDE };
    static uint8_t data[COUNT];
    for (int n = 0; n < 4; n++) {
        isogi_volume volume = {.data = data, .type = ISOGI_U8, .size = {SIDE, SIDE, n == 1 ? 2 : SIDE}};
        const double low = n == 3 ? 7 : 0, high = n == 2 ? 1 : n == 3 ? 7 : 200;
        isogi_pyramid *pyramid = NULL;
        for (int i = 0; i < COUNT; i++) {
            const int x = i % SIDE - 16, y = i / SIDE % SIDE - 16, z = i / SIDE / SIDE;
            const int in = n == 0 ? x * x + y * y + (z - 16) * (z - 16) < 4 : n == 1 ? z == 1 : x * x + y * y < 80;
            data[i] = (uint8_t)(in ? high : low);
        }
        CHECK(isogi_vol_build(&pyramid, &volume, NULL) == ISOGI_OK, "build");
        for (int space = 0; space < 2; space++) {
            isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
            const isogi_transfer t = {p, ISOGI_SUGGEST_POINTS, NULL, 0};
            float rgb[3], of_low, of_high;
            double threshold;
            CHECK(isogi_transfer_suggest(pyramid, (isogi_dvr_space)space, p, &threshold) == ISOGI_OK, "suggest");
            isogi_transfer_at(&t, low, rgb, &of_low), isogi_transfer_at(&t, high, rgb, &of_high);
            CHECK(of_low <= 0 && (n == 3 ? of_high <= 0 : of_high > 0.001f && of_high < 100), "case %d: %g, %g", n, (double)of_low,
                  (double)of_high);
            CHECK(fabs(threshold - 0.5 * (low + high)) <= 0.01 * (high - low), "case %d: threshold %g", n, threshold);
        }
        isogi_vol_free(pyramid);
    }
}

static double nothing(void *user, const double point[3], double gradient[3]) {
    (void)user, (void)point;
    gradient[0] = gradient[1] = gradient[2] = 0;
    return 1;
}

/* The last layer of a long axis is counted, and a pyramid of a function has nothing to count. */
TEST(suggestions_see_last_layers_and_refuse_functions) {
    static uint8_t data[512 * 4];
    const isogi_volume volume = {.data = data, .type = ISOGI_U8, .size = {2, 512, 2}};
    isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
    isogi_pyramid *pyramid = NULL;
    double threshold;
    for (int i = 0; i < 512 * 4; i++) data[i] = i / 2 % 512 < 510 ? 0 : i / 2 % 512 < 511 ? 100 : 200;
    CHECK(isogi_vol_build(&pyramid, &volume, NULL) == ISOGI_OK, "build");
    CHECK(isogi_transfer_suggest(pyramid, ISOGI_DVR_PHYSICAL, p, &threshold) == ISOGI_OK, "suggest");
    CHECK(threshold > 90 && threshold < 110, "threshold %g", threshold);
    isogi_vol_free(pyramid), pyramid = NULL;
    const isogi_field function = {.value = nothing, .hessian = 1, .high = {1, 1, 1}, .cells = {4, 4, 4}};
    CHECK(isogi_vol_build_field(&pyramid, &function, NULL) == ISOGI_OK, "build a function's");
    CHECK(isogi_transfer_suggest(pyramid, ISOGI_DVR_PHYSICAL, p, &threshold) == ISOGI_INVALID, "a function");
    isogi_vol_free(pyramid);
}

/* A thirtieth of the box's diagonal is half opaque at the fifth point, whatever the shape of voxels is. */
TEST(suggestions_know_the_shape_of_voxels) {
    static const double depth[] = {1, 5, 0.1};
    field f = field_new(24, 24, 24);
    test_random r = {12};
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_unit(&r);
    for (int n = 0; n < 3; n++) {
        const isogi_volume volume = {.data = f.value, .type = ISOGI_F64, .size = {24, 24, 24}, .spacing = {2, 2, 2 * depth[n]}};
        const double least = fmin(1, depth[n]), diagonal = 24 * sqrt(2 + depth[n] * depth[n]) / least; /* in smallest spacings */
        isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
        isogi_pyramid *pyramid = NULL;
        CHECK(isogi_vol_build(&pyramid, &volume, NULL) == ISOGI_OK, "build");
        CHECK(isogi_transfer_suggest(pyramid, ISOGI_DVR_PHYSICAL, p, NULL) == ISOGI_OK, "suggest");
        CHECK(fabs(exp(-(double)p[4].extinction * diagonal / 30) - 0.5) < 0.01, "depth %g: transparency %g", depth[n],
              exp(-(double)p[4].extinction * diagonal / 30));
        isogi_vol_free(pyramid);
    }
    field_free(&f);
}

TEST(a_suggestion_shows_the_engine_block) {
    isogi_volume volume = {.data = NULL};
    isogi_pyramid *pyramid = NULL;
    isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
    CHECK(procedural_make(procedural_find("engine-block"), 48, &volume, &serial) == ISOGI_OK &&
              isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK,
          "volume");
    for (int space = 0; space < 2; space++) {
        CHECK(isogi_transfer_suggest(pyramid, (isogi_dvr_space)space, p, NULL) == ISOGI_OK, "suggest");
        const isogi_transfer t = {p, ISOGI_SUGGEST_POINTS, NULL, 0};
        const isogi_dvr_desc desc = {.pyramid = pyramid, .space = (isogi_dvr_space)space};
        isogi_dvr *dvr = dvr_new(&desc, &t);
        const isogi_view view = {.width = 24, .height = 24, .eye = {90, 70, 100}, .target = {23.5f, 23.5f, 14}, .fov = 30};
        float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
        double seen = 0, empty = 0;
        for (int i = 0; i < 576; i++) seen += image[i][3] > 0.3f, empty += image[i][3] < 0.02f;
        CHECK(seen > 100 && empty > 50, "space %d: %g pixels show something, %g nothing", space, seen, empty);
        free(image), isogi_dvr_free(dvr);
    }
    isogi_vol_free(pyramid), procedural_free(&volume);
}

/* ---- memory ---- */

static size_t bytes_held, bytes_most;
static void *counted(void *user, size_t size, size_t align) {
    void *p = NULL;
    (void)user, bytes_held += size, bytes_most = bytes_held > bytes_most ? bytes_held : bytes_most;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void given_back(void *user, void *p, size_t size) { (void)user, bytes_held -= p ? size : 0, free(p); }

/* The figures under "Memory" in the header: bytes of functions of few and of many points, and of a picture in work. */
TEST(transfer_functions_and_pictures_take_the_memory_that_is_stated) {
    enum { SIDE = 128, MOST = 4000 };
    static isogi_transfer_point p[MOST];
    static float image[SIDE * SIDE][4];
    const isogi_context context = {.alloc = counted, .release = given_back, .threads = 2};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {70, 60, 90}, .target = {11.5f, 11.5f, 11.5f}, .fov = 20};
    field f = field_waves(24, 3);
    for (int way = 0; way < 4; way++) /* samples of physical space, and with a bound; exact and pre-integrated in data space */
        for (int n = 10; n <= MOST; n *= QUICK_SUITE ? 400 : 20) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)(way / 2), .bound = way == 1 ? 0.1 : 0,
                                         .classification = (isogi_dvr_classification)(way == 3), .table = 128};
            for (int i = 0; i < n; i++) p[i] = (isogi_transfer_point){-1 + 2.0 * i / n, {1, 1, 1}, 0.1f * (float)(i % 3)};
            const isogi_transfer transfer = {p, (size_t)n, NULL, 0};
            isogi_dvr *dvr = NULL;
            CHECK(isogi_dvr_create(&dvr, &desc, &context) == ISOGI_OK, "create");
            const size_t before = bytes_held;
            CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "set_transfer");
            const size_t taken = bytes_held - before - (way == 3 ? 16 * 128 * 128 + 8 * (size_t)n : 0), each = taken / (size_t)n;
            if (way) CHECK(each >= 100 && each <= 270, "way %d: %zu bytes for each of %d points", way, each, n);
            bytes_most = bytes_held;
            if (way != 1 || n < MOST) /* a cell has a part for each point */
                CHECK(isogi_dvr_render(dvr, &view, NULL, image, NULL, NULL) == ISOGI_OK, "render");
            const size_t work = bytes_most - bytes_held, least = way == 1 && n == MOST ? 0 : 16 * SIDE * SIDE,
                         most = 20 * (SIDE + 64) * (SIDE + 64) + (way ? 0 : n < 200 ? 1 << 16 : 1 << 20); /* whole tiles */
            CHECK(work >= least && work <= most, "way %d, %d points: %zu bytes for a picture", way, n, work);
            isogi_dvr_free(dvr);
            CHECK(!bytes_held, "%zu bytes are left", bytes_held);
        }
    field_free(&f);
}

TEST(the_largest_points_are_looked_up_like_others) {
    const isogi_transfer_point p[] = {{1.2e308, {1, 1, 1}, 0}, {1.7e308, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    const double value[] = {1.1e308, 1.45e308, 1.79e308}, expected[] = {0, 0.5, 1};
    for (int i = 0; i < 3; i++) {
        float rgb[3], extinction;
        isogi_transfer_at(&transfer, value[i], rgb, &extinction);
        CHECK(fabs((double)extinction - expected[i]) < 1e-6, "%g: %g, not %g", value[i], (double)extinction, expected[i]);
    }
}

TEST_MAIN("dvr_transfer")
