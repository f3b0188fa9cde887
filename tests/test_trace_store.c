/* Tests of how isogi_trace.h holds light: formats, memory, export for a GPU, save, load and merge. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

static const char *const format_name[5] = {"default", "float", "half", "rgb9e5", "byte"};

/* a gyroid beside air: half of the texels have no surface */
static double gyroid_in_air(const double p[3], const double *q) { return p[0] < q[1] ? -2 : gyroid(p, q); }

static double tilted_plane(const double p[3], const double *q) { return q[0] * p[0] + q[1] * p[1] + q[2] * p[2] - 4; }

static isogi_trace_desc store_desc(const scene *s, isogi_trace_mode mode, int format, int samples) {
    static const isogi_light sun = {.vector = {1, 2, 3}, .rgb = {3, 2.5f, 2}, .radius = 0.05f};
    isogi_trace_desc d = desc_make(s, 0.7f, 2, samples);
    d.mode = mode, d.storage = (isogi_trace_format)format, d.lighting.lights = &sun, d.lighting.light_count = 1;
    d.albedo[2] = mode == ISOGI_TRACE_TRANSFER ? 0.7f : 0.4f;
    return d;
}

static isogi_trace *baked(const isogi_trace_desc *d) {
    isogi_trace *t = NULL;
    isogi_result result = isogi_trace_create(&t, d, NULL);
    if (result == ISOGI_OK) result = isogi_trace_step(t, 0, NULL);
    CHECK(result == ISOGI_OK, "result %d", result);
    return t;
}

/* ---- memory -------------------------------------------------------------------------------------------------------------------- */

/* The table by which the default was chosen: bytes of a valid texel, all overhead included, against the error that the format adds,
   relative to the mean. What 64 samples leave of noise is the measure. */
TEST(bytes_per_texel_against_error) {
    double q[2] = {0.45, 8}, noise = 0;
    int n = LONG_SUITE ? 32 : 12;
    scene s = scene_make(n, n, n, NULL, gyroid_in_air, q);
    float points[200][3], exact[200][3], e[200][3], error[200];
    n = surface_points(&s, 0.1, 200, 1, points);
    for (int mode = 0; mode < 2; mode++) {
        double mean = 0;
        static const double bound[2][5] = {{1e-6, 1e-6, 4e-4, 2e-3, 6e-3}, {6e-4, 1e-6, 6e-4, 0, 1e-2}};
        for (int format = 1; format < 6; format++) { /* 5: the default */
            isogi_trace_desc d = store_desc(&s, (isogi_trace_mode)mode, format % 5, 64);
            isogi_counters counters = {0};
            double sum = 0;
            if (mode == 1 && format == ISOGI_TRACE_RGB9E5) continue;
            isogi_trace *t = baked(&d);
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
            isogi_trace_counters(t, &counters);
            for (int i = 0; i < n && format == 1; i++) {
                memcpy(exact[i], e[i], sizeof e[i]), mean += (double)e[i][1] / n;
                noise += (double)error[i] / n;
            }
            for (int i = 0; i < n; i++)
                for (int c = 0; c < 3; c++) sum += pow((double)e[i][c] - (double)exact[i][c], 2) / n / 3;
            double bytes = (double)isogi_trace_memory(t) / (double)counters.texels, relative = sqrt(sum) / mean;
            printf("    %-10s %-8s %6.1f bytes a texel, error %.2e (noise of 64 samples %.1e)\n", mode ? "transfer" : "irradiance",
                   format_name[format % 5], bytes, relative, noise / mean);
            CHECK(relative <= bound[mode][format % 5], "%s: error %.2e", format_name[format % 5], relative);
            /* its values, 2 of its error, and a share of its brick */
            static const double values[2][5] = {{12, 12, 6, 4, 3}, {50, 100, 50, 0, 25}};
            CHECK(bytes > values[mode][format % 5] + 2 && bytes < values[mode][format % 5] + 2 + 8, "%s: %.1f bytes",
                  format_name[format % 5], bytes);
            isogi_trace_free(t);
        }
        noise = 0;
    }
    scene_free(&s);
}

/* What a transfer texture of 256^3 texels, order 5, takes by default: bricks' table, and the texels that have a surface. Extrapolated from
   64^3: a field whose texels are all valid stays below one gigabyte, air costs a thirtieth of it. */
SLOW_TEST(transfer_of_256_cubed_stays_below_a_gigabyte) {
    double q[2] = {0.1, 0};
    scene s = scene_make(64, 64, 64, NULL, gyroid_in_air, q);
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_TRANSFER, 0, 1);
    isogi_trace *t = NULL;
    size_t before, after;
    d.isovalue_min = -0.2, d.isovalue_max = 0.2;
    isogi_trace_create(&t, &d, NULL);
    before = isogi_trace_memory(t);
    isogi_trace_free(t);
    d.isovalue_min = d.isovalue_max = 0, d.bounces = 0;
    t = baked(&d);
    after = isogi_trace_memory(t);
    printf("    all texels: %.0f MB at 256^3; not yet computed, values within 0.2: %.0f MB\n", (double)after * 64 / 1e6,
           (double)before * 64 / 1e6);
    CHECK((double)after * 64 < 1e9 && (double)before * 64 < 64e6, "%.0f MB, %.0f MB", (double)after * 64 / 1e6, (double)before * 64 / 1e6);
    isogi_trace_free(t), scene_free(&s);
}

/* As far as light is told apart at all: radiance is up to 1e30. */
TEST(short_formats_follow_the_largest_and_the_smallest_light) {
    const float radiance[] = {1e-33f, 1e-30f, 1e30f};
    double q[4] = {7.5, 7.5, 7.5, 5};
    scene s = scene_make(16, 16, 16, NULL, ball, q);
    const float point[1][3] = {{7.5f, 7.5f, 12.5f}};
    for (int k = 0; k < 3; k++)
        for (int format = 1; format < 5; format++) {
            const float sky[3] = {3.5449077f * radiance[k], 3.5449077f * radiance[k], 3.5449077f * radiance[k]};
            isogi_trace_desc d = desc_make(&s, 0, 0, 4);
            float e[1][3];
            d.lighting.env.sh = sky, d.storage = (isogi_trace_format)format, d.lazy = 1;
            bake_and_sample(&d, NULL, point, 1, e);
            CHECK(fabs((double)e[0][0] / (PI * (double)radiance[k]) - 1) < 0.02, "radiance %g, %s: %g", (double)radiance[k],
                  format_name[format], (double)e[0][0]);
        }
    scene_free(&s);
}

/* Units follow the light: the formats hold a sun of 1e6 beside a sky of 1e-3, and a dim world of 1e-6. */
TEST(short_formats_follow_the_brightness) {
    double q[4] = {15.5, 15.5, 15.5, 9};
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    float points[50][3], exact[50][3], e[50][3];
    int n = surface_points(&s, 0, 50, 2, points);
    for (int bright = 0; bright < 2; bright++) {
        float sky[3] = {3.5e-3f, 3.5e-3f, 3.5e-3f}, factor = bright ? 1e6f : 1e-6f;
        isogi_light sun = {.vector = {1, 1, 1}, .rgb = {factor, factor, factor}};
        for (int format = 1; format < 5; format++) {
            isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
            double most = 0;
            if (bright) d.lighting.env.sh = sky;
            else sky[0] = sky[1] = sky[2] = 1e-6f, d.lighting.env.sh = sky;
            d.lighting.lights = &sun, d.lighting.light_count = 1, d.storage = (isogi_trace_format)format, d.lazy = 1;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, format == 1 ? exact : e);
            for (int i = 0; i < n; i++) most = fmax(most, (double)exact[i][0]);
            for (int i = 0; i < n && format > 1; i++)
                CHECK(fabs((double)e[i][0] - (double)exact[i][0]) <= 0.01 * most, "%s: %g, exact %g", format_name[format], (double)e[i][0],
                      (double)exact[i][0]);
        }
    }
    scene_free(&s);
}

/* ---- export -------------------------------------------------------------------------------------------------------------------- */

/* What a GPU would read from the dense array at a texel. */
static void exported(const isogi_trace *t, int format, const uint8_t *bytes, const float *scales, size_t texel, float *values) {
    size_t lattice[3], texels;
    int order, channels, count;
    isogi_trace_shape(t, lattice, &order, &channels);
    texels = lattice[0] * lattice[1] * lattice[2], count = order ? order * order * channels : 3;
    for (int v = 0; v < count; v++) {
        size_t at = order ? 4 * ((size_t)(v / 4) * texels + texel) + (size_t)(v % 4) : 3 * texel + (size_t)v;
        if (format == ISOGI_TRACE_FLOAT) memcpy(&values[v], bytes + 4 * at, 4);
        if (format == ISOGI_TRACE_HALF) {
            uint16_t h;
            memcpy(&h, bytes + 2 * at, 2);
            values[v] = (float)(h < 1024 ? ldexp(h, -24) : ldexp(1024 + h % 1024, (int)(h >> 10 & 31) - 25));
            if (h & 0x8000)
                values[v] = -(float)(h % 0x8000 < 1024 ? ldexp(h % 0x8000, -24) : ldexp(1024 + h % 1024, (int)(h >> 10 & 31) - 25));
        }
        if (format == ISOGI_TRACE_RGB9E5) {
            uint32_t p;
            memcpy(&p, bytes + 4 * texel, 4);
            values[v] = (float)ldexp(p >> 9 * v & 511, (int)(p >> 27) - 24);
        }
        if (format == ISOGI_TRACE_BYTE) values[v] = order ? fmaxf((float)(int8_t)bytes[at] / 127, -1) : (float)bytes[at] / 255;
        values[v] *= scales[v];
    }
}

static isogi_result export_now(const isogi_trace *t, int format, uint8_t **bytes, float *scales) {
    size_t size = isogi_trace_export_size(t, format);
    isogi_result result;
    *bytes = (uint8_t *)malloc(size + 8);
    memset(*bytes, 0xee, size + 8);
    CHECK(isogi_trace_export(t, format, *bytes, size - 1) == ISOGI_INVALID && (*bytes)[0] == 0xee, "%d", format);
    result = isogi_trace_export(t, format, *bytes, size);
    for (int i = 0; i < 8; i++) CHECK((*bytes)[size + (size_t)i] == 0xee, "written beyond the end, format %d", format);
    if (result == ISOGI_OK) result = isogi_trace_export_scales(t, format, scales);
    return result;
}

/* At the texels themselves every format holds what the library reads there, within the format's step. */
TEST(export_holds_the_texels) {
    double q[2] = {0.4, 6};
    scene s = scene_make(16, 15, 14, NULL, gyroid_in_air, q);
    for (int mode = 0; mode < 2; mode++)
        for (int format = 1; format < 5; format++) {
            isogi_trace_desc d = store_desc(&s, (isogi_trace_mode)mode, ISOGI_TRACE_FLOAT, 8);
            float scales[108], values[108], expected[108];
            uint8_t *bytes;
            int count = mode ? 25 : 3, seen = 0;
            isogi_trace *t = baked(&d);
            if (mode == 1 && format == ISOGI_TRACE_RGB9E5) {
                CHECK(isogi_trace_export_size(t, format) == 0 && isogi_trace_export(t, format, scales, sizeof scales) == ISOGI_INVALID,
                      "format %d", format);
                isogi_trace_free(t);
                continue;
            }
            CHECK(export_now(t, format, &bytes, scales) == ISOGI_OK, "format %d", format);
            for (size_t texel = 0; texel < 16 * 15 * 14; texel++) {
                size_t at[3] = {texel % 16, texel / 16 % 15, texel / 240};
                float point[1][3] = {{(float)at[0], (float)at[1], (float)at[2]}};
                exported(t, format, bytes, scales, texel, values);
                for (int v = 0; v < count; v++)
                    CHECK(values[v] > -1e6f && values[v] < 1e6f, "texel %d holds %g", (int)texel, (double)values[v]);
                if (!isogi_trace_valid(t, at)) continue;
                seen++;
                if (mode) isogi_trace_sample_transfer(t, (const float(*)[3])point, 1, expected);
                else isogi_trace_sample(t, (const float(*)[3])point, 1, (float(*)[3])expected, NULL);
                double most = 0;
                for (int v = 0; v < count; v++) most = fmax(most, fabs((double)expected[v]));
                for (int v = 0; v < count; v++) {
                    double step = format == ISOGI_TRACE_FLOAT ? 1e-6 * most : format == ISOGI_TRACE_HALF
                        ? fabs((double)expected[v]) / 2048 + 1e-6 : format == ISOGI_TRACE_RGB9E5 ? most / 512
                            : (double)scales[v] / (mode ? 254 : 510);
                    CHECK(fabs((double)values[v] - (double)expected[v]) <= step * 1.001 + 1e-6, "%s, texel %d value %d: %g, expected %g",
                        format_name[format], (int)texel, v, (double)values[v], (double)expected[v]);
                }
            }
            CHECK(seen > 500 && seen < 3000, "%d valid texels", seen);
            free(bytes), isogi_trace_free(t);
        }
    scene_free(&s);
}

/* Light of any brightness is exported with all the bits that the format has. */
TEST(export_of_dim_light_is_as_precise) {
    double q[4] = {5.5, 5.5, 5.5, 4};
    scene s = scene_make(12, 12, 12, NULL, ball, q);
    for (int k = 0; k < 6; k++)
        for (int format = ISOGI_TRACE_HALF; format <= ISOGI_TRACE_RGB9E5; format++) {
            static const float brightness[6] = {1e30f, 1e6f, 1, 1e-3f, 1e-7f, 1e-30f};
            isogi_trace_desc d = desc_make(&s, 0, 0, 4);
            float sky[3], scales[3], value[3], expected[1][3], point[1][3] = {{5, 9, 5}};
            uint8_t *bytes;
            for (int c = 0; c < 3; c++) sky[c] = white_sky[c] * brightness[k] * (c == 1 ? 0.37f : 1);
            d.lighting.env.sh = sky;
            isogi_trace *t = baked(&d);
            CHECK(export_now(t, format, &bytes, scales) == ISOGI_OK, "format %d", format);
            exported(t, format, bytes, scales, 5 + 12 * (9 + 12 * 5), value);
            isogi_trace_sample(t, (const float(*)[3])point, 1, expected, NULL);
            for (int c = 0; c < 3; c++)
                CHECK(expected[0][c] > 0 && fabs((double)value[c] / (double)expected[0][c] - 1) < 0.004,
                      "%s, brightness %g: %g, expected %g", format_name[format], (double)brightness[k], (double)value[c],
                      (double)expected[0][c]);
            free(bytes), isogi_trace_free(t);
        }
    scene_free(&s);
}

/* What lookups read is exported as well: drafts, and light from before a change that is yet to be computed anew. */
TEST(export_holds_drafts) {
    double q[2] = {0.4, 6};
    scene s = scene_make(16, 15, 14, NULL, gyroid_in_air, q);
    for (int lazy = 0; lazy < 2; lazy++) {
        isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, ISOGI_TRACE_FLOAT, 64);
        isogi_trace *t = NULL;
        isogi_trace_report report;
        float points[100][3], scales[3], values[3], e[1][3];
        uint8_t *bytes;
        int n = surface_points(&s, 0, 100, 4, points), seen = 0;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = lazy;
        if (isogi_trace_create(&t, &d, NULL) != ISOGI_OK) abort();
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        isogi_trace_step(t, lazy ? 900 : 0, NULL);
        d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.2f;
        if (!lazy) CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "change of albedo, lazy %d", lazy);
        isogi_trace_status(t, &report);
        CHECK(export_now(t, ISOGI_TRACE_FLOAT, &bytes, scales) == ISOGI_OK, "lazy %d", lazy);
        for (size_t texel = 0; texel < 16 * 15 * 14; texel++) {
            size_t at[3] = {texel % 16, texel / 16 % 15, texel / 240};
            float point[1][3] = {{(float)at[0], (float)at[1], (float)at[2]}}, error;
            if (!isogi_trace_valid(t, at)) continue;
            isogi_trace_sample(t, (const float(*)[3])point, 1, e, &error);
            if (!test_finite((double)error)) continue;
            exported(t, ISOGI_TRACE_FLOAT, bytes, scales, texel, values);
            seen += memcmp(values, e[0], sizeof values) == 0; /* other texels are not what a lookup finds in their place */
        }
        CHECK(report.drafts > 50 && seen >= (int)report.texels, "lazy %d: %d texels hold what is read there, of %d, %d drafts", lazy, seen,
              (int)report.texels, (int)report.drafts);
        free(bytes), isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Two texels side by side have light, no other: what surrounds them. Three texels deep the mean of those around, by 1 / distance^2; beyond,
   the mean of both. */
TEST(export_fills_what_has_no_light) {
    double q[1] = {8.3};
    scene s = scene_make(17, 17, 17, NULL, ground, q);
    isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {8, 9.5f, 8}, .rgb = {3, 2, 1}};
    /* of the texel at (8 + x, 8 + y, 8 + z) the part of the first one's light, at (8,8,8); the second is at (9,8,8) */
    static const struct { int at[3]; double first; } place[] = {
        {{0, 0, 0}, 1}, {{1, 0, 0}, 0}, {{-1, 0, 0}, 1}, {{-2, 0, 0}, 1}, {{-3, 0, 0}, 1}, {{-4, 0, 0}, 0.5}, {{-5, 0, 0}, 0.5},
        {{2, 1, -1}, 0}, {{3, 0, 1}, 0}, {{4, 2, 0}, 0}, {{5, 0, 0}, 0.5}, {{7, 8, 8}, 0.5}, {{-8, -8, -8}, 0.5},
        {{0, 1, 0}, 2.0 / 3}, {{1, 0, -1}, 1.0 / 3}, {{0, 1, 1}, 0.6}, {{1, -1, 1}, 0.4},
        /* two deep: (-1,1,0) has 1, (0,1,0) 2/3, (1,1,0) 1/3, beside it in z 1, 3/5, 2/5 */
        {{0, 2, 0}, (2.0 / 3 + (1 + 1.0 / 3) / 2 + 2 * 0.6 / 2 + 2 * (1 + 0.4) / 3) / (1 + 2.0 / 2 + 2.0 / 2 + 4.0 / 3)},
        {{0, 4, 0}, 0.5}, {{1, 4, 0}, 0.5}, {{0, 0, -5}, 0.5}};
    for (int format = ISOGI_TRACE_FLOAT; format <= ISOGI_TRACE_BYTE; format++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 4);
        float scales[3], value[3], e[2][3], points[2][3] = {{8, 8, 8}, {9, 8, 8}};
        uint8_t *bytes;
        d.lighting.lights = &lamp, d.lighting.light_count = 1, d.lighting.env.sh_order = 0, d.lighting.env.sh = NULL;
        for (int a = 0; a < 3; a++) d.box_first[a] = 8, d.box_end[a] = a ? 9 : 10;
        isogi_trace *t = baked(&d);
        isogi_trace_sample(t, (const float(*)[3])points, 2, e, NULL);
        CHECK(e[1][2] > 0 && e[0][2] > 1.2f * e[1][2], "E %g and %g", (double)e[0][2], (double)e[1][2]);
        CHECK(export_now(t, format, &bytes, scales) == ISOGI_OK, "format %d", format);
        for (size_t i = 0; i < sizeof place / sizeof *place; i++) {
            size_t texel = (size_t)(8 + place[i].at[0] + 17 * (8 + place[i].at[1] + 17 * (8 + place[i].at[2])));
            exported(t, format, bytes, scales, texel, value);
            for (int c = 0; c < 3; c++) {
                double expected = place[i].first * (double)e[0][c] + (1 - place[i].first) * (double)e[1][c];
                CHECK(fabs((double)value[c] - expected) < (format == ISOGI_TRACE_FLOAT ? 1e-6 : 0.01) * (double)e[0][0],
                      "%s, texel %d %d %d: %g, expected %g", format_name[format], place[i].at[0], place[i].at[1], place[i].at[2],
                      (double)value[c], expected);
            }
        }
        free(bytes), isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Plain trilinear interpolation of the dense array next to surfaces, as hardware does it, against the library's lookup, which leaves
   invalid texels out. Left as zeros, invalid texels darken their neighbourhood by half and more: those are the seams. */
TEST(exported_texture_has_no_seams) {
    double q[2] = {0.35, 12}, sum = 0, worst = 0, dark = 0, mean = 0;
    scene s = scene_make(32, 32, 32, NULL, gyroid_in_air, q);
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, LONG_SUITE ? 256 : 4);
    isogi_trace *t = baked(&d);
    float points[2000][3], e[2000][3], scales[3];
    uint8_t *bytes;
    int n = 0, beside = 0;
    for (int k = 0; k < 4; k++) n += surface_points(&s, -1.2 + 0.4 * k, 500, 5 + (uint64_t)k, points + n);
    CHECK(export_now(t, ISOGI_TRACE_FLOAT, &bytes, scales) == ISOGI_OK, "export %d", n);
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
    for (int i = 0; i < n; i++) {
        double value = 0, zeros = 0;
        int invalid = 0;
        for (int k = 0; k < 8; k++) {
            size_t at[3];
            double w = 1;
            float values[3];
            for (int a = 0; a < 3; a++) {
                double x = fmin(fmax((double)points[i][a], 0), 31);
                size_t low = x < 30 ? (size_t)x : 30;
                at[a] = low + (size_t)(k >> a & 1);
                w *= k >> a & 1 ? x - (double)low : 1 - (x - (double)low);
            }
            exported(t, ISOGI_TRACE_FLOAT, bytes, scales, at[0] + 32 * (at[1] + 32 * at[2]), values);
            value += w * (double)values[0];
            if (isogi_trace_valid(t, at)) zeros += w * (double)values[0];
            else invalid = 1;
        }
        mean += (double)e[i][0] / n;
        if (!invalid) {
            CHECK(fabs(value - (double)e[i][0]) < 1e-5 * PI, "among valid texels: %g, library %g", value, (double)e[i][0]);
            continue;
        }
        beside++, sum += pow(value - (double)e[i][0], 2), worst = fmax(worst, fabs(value - (double)e[i][0])),
                                                          dark += pow(zeros - (double)e[i][0], 2);
    }
    sum = sqrt(sum / beside) / mean, dark = sqrt(dark / beside) / mean;
    printf("    %d of %d points read invalid texels: plain interpolation differs by %.3f of the mean (largest %.3f); without extension by "
           "%.3f\n",
           beside, n, sum, worst / mean, dark);
    CHECK(beside > 50 && sum < 0.05 && worst < 0.3 * mean && dark > 5 * sum, "RMS %.4f, largest %.4f, without %.4f", sum, worst / mean,
          dark);
    free(bytes), isogi_trace_free(t), scene_free(&s);
}

/* ---- save, load, merge ------------------------------------------------------------------------------------------------------------ */

static uint8_t *save_now(const isogi_trace *t, size_t *size) {
    uint8_t *block;
    *size = isogi_trace_save_size(t);
    block = (uint8_t *)malloc(*size);
    CHECK(isogi_trace_save(t, block, *size - 1) == ISOGI_INVALID, "%d bytes", (int)*size);
    CHECK(isogi_trace_save(t, block, *size) == ISOGI_OK, "%d bytes", (int)*size);
    return block;
}

/* Stopped anywhere, saved, loaded into a new texture and finished there: the same bytes as if it had never stopped. */
TEST(bake_resumes_to_the_same_bits) {
    double q[2] = {0.5, 4};
    scene s = scene_make(12, 13, 11, NULL, gyroid_in_air, q);
    float points[30][3];
    int n = surface_points(&s, 0, 30, 1, points);
    for (int k = 0; k < 12; k++) {
        isogi_trace_desc d = store_desc(&s, (isogi_trace_mode)(k & 1), k % 4 == 3 ? ISOGI_TRACE_BYTE : k % 3, 4);
        isogi_trace *whole = NULL, *part = NULL, *rest = NULL;
        uint8_t *a, *b, *c;
        size_t size_a, size_b, size_c;
        double remaining = 1;
        d.sides = k >= 8 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE, d.lazy = k >= 4 && k < 8;
        CHECK(isogi_trace_create(&whole, &d, NULL) == ISOGI_OK && isogi_trace_create(&part, &d, NULL) == ISOGI_OK &&
                  isogi_trace_create(&rest, &d, NULL) == ISOGI_OK,
              "case %d", k);
        isogi_trace_request(whole, (const float(*)[3])points, (size_t)n), isogi_trace_request(part, (const float(*)[3])points, (size_t)n);
        isogi_trace_step(whole, 0, NULL);
        isogi_trace_step(part, d.lazy ? 500 : 4000, &remaining);
        CHECK(remaining > 0 && remaining < 1, "case %d: remaining %g", k, remaining);
        a = save_now(part, &size_a), b = save_now(whole, &size_b);
        CHECK(isogi_trace_load(rest, a, size_a) == ISOGI_OK, "case %d", k);
        isogi_trace_request(rest, (const float(*)[3])points, (size_t)n);
        CHECK(isogi_trace_step(rest, 0, &remaining) == ISOGI_OK && remaining <= 0, "case %d: remaining %g", k, remaining);
        c = save_now(rest, &size_c);
        CHECK(size_b == size_c && !memcmp(b, c, size_b), "case %d: %d and %d bytes", k, (int)size_b, (int)size_c);
        CHECK(isogi_trace_load(whole, a, size_a) == ISOGI_OK, "over what is there already, case %d", k);
        isogi_trace_free(whole), isogi_trace_free(part), isogi_trace_free(rest), free(a), free(b), free(c);
    }
    scene_free(&s);
}

/* The hash that ends a block covers every byte before it, so one number says that machines of either byte order write the same. Without
   light nothing is left to rounding. */
TEST(blocks_are_the_same_bytes_on_every_machine) {
    static const uint64_t expected[2] = {0x19c1fafb42273d7eu, 0xa444cc19aa50ff38u};
    double q[3] = {0.25, -0.5, 1};
    scene s = scene_make(9, 10, 11, NULL, tilted_plane, q);
    for (int k = 0; k < 2; k++) {
        isogi_trace_desc d = desc_make(&s, 0.75f, 1, 1);
        const isogi_light lamp = {.vector = {0, 1, 0}, .rgb = {0, 0, 0}};
        isogi_trace *t;
        uint8_t *block;
        uint64_t hash = 0;
        size_t size;
        d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0, d.lighting.lights = &lamp, d.lighting.light_count = 1;
        d.storage = k ? ISOGI_TRACE_HALF : ISOGI_TRACE_FLOAT;
        t = baked(&d), block = save_now(t, &size);
        for (int i = 0; i < 8; i++) hash |= (uint64_t)block[size - 8 + (size_t)i] << 8 * i;
        printf("    %d bytes, hash 0x%016llx\n", (int)size, (unsigned long long)hash);
        CHECK(hash == expected[k] && size > 1000, "%d bytes, hash 0x%016llx", (int)size, (unsigned long long)hash);
        isogi_trace_free(t), free(block);
    }
    scene_free(&s);
}

/* Feedback: cubes of texels do not know of each other. A bake of four of them, stopped in the last, goes on to the same bits; adaptive
   ones, too, where the texels of a cube are finished at different times. */
TEST(feedback_resumes_to_the_same_bits) {
    double q[2] = {0.5, 2};
    scene s = scene_make(20, 20, 3 * ISOGI_TRACE_CUBE + 32, NULL, gyroid_in_air, q);
    for (int k = 0; k < 1 + LONG_SUITE; k++) {
        isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, k ? 8 : 1);
        isogi_trace *part = NULL, *rest = NULL;
        isogi_trace_report report;
        uint8_t *block[3];
        size_t bytes[3];
        double remaining = 1;
        d.method = ISOGI_TRACE_FEEDBACK, d.bounces = 2, d.error = k ? 0.1f : 0;
        CHECK(isogi_trace_create(&part, &d, NULL) == ISOGI_OK && isogi_trace_create(&rest, &d, NULL) == ISOGI_OK, "case %d", k);
        for (int step = 0; remaining > 0.1; step++)
            CHECK(isogi_trace_step(part, 20000, &remaining) == ISOGI_OK && step < 1000, "case %d", k);
        block[0] = save_now(part, &bytes[0]);
        isogi_trace_status(part, &report);
        CHECK(remaining > 0 && isogi_trace_load(rest, block[0], bytes[0]) == ISOGI_OK, "case %d: remaining %g", k, remaining);
        isogi_trace_step(part, 0, &remaining), block[1] = save_now(part, &bytes[1]); /* it was not disturbed by saving */
        CHECK(bytes[0] > bytes[1] / 2 && bytes[0] < bytes[1], "case %d: %d of %d bytes", k, (int)bytes[0], (int)bytes[1]);
        CHECK(isogi_trace_step(rest, 0, &remaining) == ISOGI_OK && remaining <= 0, "case %d: remaining %g", k, remaining);
        block[2] = save_now(rest, &bytes[2]);
        CHECK(bytes[1] == bytes[2] && !memcmp(block[1], block[2], bytes[1]), "case %d: %d and %d bytes", k, (int)bytes[1], (int)bytes[2]);
        for (int i = 0; i < 3; i++) free(block[i]);
        isogi_trace_free(part), isogi_trace_free(rest);
    }
    scene_free(&s);
}

/* Lazy and adaptive: some texels are finished while others, which share their probes, are not. What one request asked for is saved when
   all of it is finished, and nothing of it before; what was finished before the next request stays in the block. */
TEST(lazy_feedback_resumes_to_the_same_bits) {
    double q[2] = {0.5, 2.5};
    scene s = scene_make(16, 16, 16, NULL, gyroid_in_air, q);
    float points[60][3];
    int n = surface_points(&s, 0, 60, 1, points), apart = 0;
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 64);
    d.method = ISOGI_TRACE_FEEDBACK, d.bounces = 2, d.error = 0.05f, d.lazy = 1;
    for (uint64_t rays = 1000; rays < 20000; rays += 4000) {
        isogi_trace *t[2] = {NULL, NULL};
        uint8_t *block[4];
        size_t bytes[4];
        isogi_trace_report report;
        double remaining = 1;
        int open = 0;
        for (int k = 0; k < 2; k++) CHECK(isogi_trace_create(&t[k], &d, NULL) == ISOGI_OK, "%d rays", (int)rays);
        isogi_trace_request(t[0], (const float(*)[3])points, (size_t)n / 2), isogi_trace_step(t[0], rays, &remaining);
        for (size_t i = 0; i < 16 * 16 * 16; i++) open += isogi_trace_wanted(t[0], (size_t[3]){i % 16, i / 16 % 16, i / 256});
        block[0] = save_now(t[0], &bytes[0]);
        CHECK(isogi_trace_load(t[1], block[0], bytes[0]) == ISOGI_OK, "%d rays", (int)rays);
        isogi_trace_request(t[1], (const float(*)[3])points, (size_t)n / 2);
        for (int k = 0; k < 2; k++) isogi_trace_step(t[k], 0, NULL), block[1 + k] = save_now(t[k], &bytes[1 + k]);
        CHECK(bytes[1] == bytes[2] && !memcmp(block[1], block[2], bytes[1]), "%d rays: %d and %d bytes", (int)rays, (int)bytes[1],
              (int)bytes[2]);
        isogi_trace_status(t[0], &report), apart += open > 0 && open < (int)report.texels / 2;
        isogi_trace_request(t[0], (const float(*)[3])points, (size_t)n), isogi_trace_step(t[0], rays, &remaining);
        block[3] = save_now(t[0], &bytes[3]);
        CHECK(remaining <= 0 || bytes[3] == bytes[1], "%d rays: %d, then %d bytes", (int)rays, (int)bytes[1], (int)bytes[3]);
        for (int k = 0; k < 4; k++) free(block[k]);
        isogi_trace_free(t[0]), isogi_trace_free(t[1]);
    }
    CHECK(apart, "%d times some were finished and others not", apart);
    scene_free(&s);
}

/* Feedback at work, whose texels get a block that holds them all: each counts once, they keep the block's light, and nothing is left to do,
   be it loaded before the first block of samples, within one or after one; what is asked for later is baked as ever. */
TEST(feedback_at_work_takes_a_block) {
    double q[2] = {0.5, 4};
    scene s = scene_make(17, 16, 15, NULL, gyroid_in_air, q);
    float points[40][3];
    int n = surface_points(&s, 0, 40, 1, points);
    for (int k = 0; k < 10; k++) {
        if ((!LONG_SUITE && (k / 2 + k) % 2) || (QUICK_SUITE && k / 2 % 3)) continue; /* whole and lazy in turn */
        static const uint64_t before[5] = {1, 600, 2500, 6000, 9000};
        isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 64);
        isogi_trace *whole = NULL, *part = NULL;
        isogi_trace_report report;
        uint8_t *a, *b, *c;
        size_t size_a, size_b, size_c;
        double remaining = 1;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = k & 1;
        CHECK(isogi_trace_create(&whole, &d, NULL) == ISOGI_OK && isogi_trace_create(&part, &d, NULL) == ISOGI_OK, "case %d", k);
        isogi_trace_request(whole, (const float(*)[3])points, (size_t)n / 2);
        isogi_trace_request(part, (const float(*)[3])points, (size_t)n / 2);
        isogi_trace_step(whole, 0, NULL), isogi_trace_step(part, before[k / 2], &remaining);
        a = save_now(whole, &size_a);
        CHECK(remaining > 0 && isogi_trace_load(part, a, size_a) == ISOGI_OK, "case %d: remaining %g", k, remaining);
        b = save_now(part, &size_b);
        CHECK(size_a == size_b && !memcmp(a, b, size_a), "case %d: %d and %d bytes", k, (int)size_a, (int)size_b);
        isogi_trace_request(part, (const float(*)[3])points, (size_t)n / 2);
        for (int step = 0; step < 20 && remaining > 0; step++) isogi_trace_step(part, 20000, &remaining);
        c = save_now(part, &size_c);
        CHECK(remaining <= 0 && size_a == size_c && !memcmp(a, c, size_a), "case %d: remaining %g, %d and %d bytes", k, remaining,
              (int)size_a, (int)size_c);
        isogi_trace_request(part, (const float(*)[3])points, (size_t)n);
        for (int step = 0; step < 40 && (!step || remaining > 0); step++) isogi_trace_step(part, 20000, &remaining);
        isogi_trace_status(part, &report);
        CHECK(remaining <= 0 && !report.drafts && report.texels >= (size_t)n, "case %d: remaining %g, %d drafts", k, remaining,
              (int)report.drafts);
        isogi_trace_free(whole), isogi_trace_free(part), free(a), free(b), free(c);
    }
    scene_free(&s);
}

/* A cube at work gets a block that holds all of it while the next one is still to be baked. In the bricks at low x only texels of odd x
   have a surface: in the first of two rounds over the cube's bricks these have nothing to bake. */
TEST(feedback_at_work_takes_a_cube) {
    double q[2] = {0.5, 3};
    scene s = scene_make(8, 8, ISOGI_TRACE_CUBE + 4, NULL, gyroid_in_air, q);
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 1), first = d;
    d.method = first.method = ISOGI_TRACE_FEEDBACK, first.box_end[0] = first.box_end[1] = 8, first.box_end[2] = ISOGI_TRACE_CUBE;
    isogi_trace *whole = baked(&d), *cube = baked(&first), *part = NULL;
    uint8_t *a, *b, *c;
    size_t size_a, size_b, size_c;
    a = save_now(whole, &size_a), b = save_now(cube, &size_b);
    CHECK(size_b > size_a / 2 && size_b < size_a, "%d of %d bytes", (int)size_b, (int)size_a);
    for (uint64_t rays = 1; rays < 2000; rays += rays) {
        double remaining = 1;
        isogi_trace_create(&part, &d, NULL);
        isogi_trace_step(part, rays, &remaining);
        CHECK(remaining > 0 && isogi_trace_load(part, b, size_b) == ISOGI_OK, "after %d rays", (int)rays);
        CHECK(isogi_trace_step(part, 0, &remaining) == ISOGI_OK && remaining <= 0, "after %d rays: remaining %g", (int)rays, remaining);
        c = save_now(part, &size_c);
        CHECK(size_a == size_c && !memcmp(a, c, size_a), "after %d rays: %d and %d bytes", (int)rays, (int)size_a, (int)size_c);
        isogi_trace_free(part), free(c);
    }
    isogi_trace_free(whole), isogi_trace_free(cube), free(a), free(b), scene_free(&s);
}

/* A block of one part of a volume is none of another part, though its voxels are the same: of the whole, and of three that begin later
   along one axis each. */
TEST(blocks_of_other_chunks_are_refused) {
    double q[4] = {4, 4, 4, 3};
    scene s = scene_make(9, 9, 9, NULL, ball, q);
    isogi_pyramid *pyramid[4];
    isogi_trace *part[4];
    for (int k = 0; k < 4; k++) {
        isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 1);
        isogi_volume volume = s.volume;
        if (k) volume.first[k - 1] = 100;
        CHECK(isogi_vol_build(&pyramid[k], &volume, NULL) == ISOGI_OK, "part %d", k);
        d.pyramid = pyramid[k], part[k] = baked(&d);
    }
    for (int k = 0; k < 16; k++) {
        size_t size;
        uint8_t *block = save_now(part[k / 4], &size);
        isogi_result result = isogi_trace_load(part[k % 4], block, size);
        CHECK(result == (k / 4 == k % 4 ? ISOGI_OK : ISOGI_INVALID), "part %d into %d: %s", k / 4, k % 4, isogi_result_string(result));
        free(block);
    }
    for (int k = 0; k < 4; k++) isogi_trace_free(part[k]), isogi_vol_free(pyramid[k]);
    scene_free(&s);
}

/* Boxes baked apart, one of them reaching past a brick, and loaded in any order: the same bytes as the whole, at once. */
TEST(boxes_merge_to_the_same_bits) {
    double q[2] = {0.5, 4};
    scene s = scene_make(12, 13, 11, NULL, gyroid_in_air, q);
    for (int mode = 0; mode < 2; mode++) {
        isogi_trace_desc d = store_desc(&s, (isogi_trace_mode)mode, 0, 4);
        isogi_trace *whole = baked(&d), *merged = NULL;
        size_t size_a, size_b, texels = 0;
        uint8_t *a, *b;
        double remaining = 1;
        isogi_counters counters = {0}, none = {0};
        isogi_trace_create(&merged, &d, NULL);
        isogi_trace_counters(whole, &counters);
        for (int k = 7; k >= 0; k--) {
            static const size_t cut[3][3] = {{0, 5, 12}, {0, 6, 13}, {0, 3, 11}};
            isogi_counters part = {0};
            for (int i = 0; i < 3; i++) d.box_first[i] = cut[i][k >> i & 1], d.box_end[i] = cut[i][(k >> i & 1) + 1];
            isogi_trace *t = baked(&d);
            isogi_trace_counters(t, &part);
            texels += part.texels;
            a = save_now(t, &size_a);
            CHECK(isogi_trace_load(merged, a, size_a) == ISOGI_OK, "box %d", k);
            isogi_trace_free(t), free(a);
        }
        CHECK(texels == counters.texels, "%d texels in boxes, %d in all", (int)texels, (int)counters.texels);
        CHECK(isogi_trace_step(merged, 0, &remaining) == ISOGI_OK && remaining <= 0, "remaining %g", remaining);
        isogi_trace_counters(merged, &none);
        CHECK(none.rays == 0, "%d rays after merging", (int)none.rays);
        a = save_now(whole, &size_a), b = save_now(merged, &size_b);
        CHECK(size_a == size_b && !memcmp(a, b, size_a), "%d and %d bytes", (int)size_a, (int)size_b);
        isogi_trace_free(whole), isogi_trace_free(merged), free(a), free(b);
        d.box_end[1] = 14;
        CHECK(isogi_trace_create(&merged, &d, NULL) == ISOGI_INVALID, "a box beyond the lattice, mode %d", mode);
    }
    scene_free(&s);
}

/* A block ends with the FNV-1a hash of what is before, lowest byte first. */
static void mend_hash(uint8_t *block, size_t size) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size - 8; i++) hash = (hash ^ block[i]) * 0x100000001b3u;
    for (int k = 0; k < 8; k++) block[size - 8 + (size_t)k] = (uint8_t)(hash >> 8 * k);
}

/* Boxes merged into one of them: lookups whose texels all lack a surface read the nearest one of either box. */
static double crumbs(const double p[3], const double *q) { return roughness(p) > q[0] ? 1 : -1; }
TEST(lookups_cross_the_border_of_merged_boxes) {
    double q[1] = {0.97};
    scene s = scene_make(16, 16, 16, NULL, crumbs, q);
    static float points[300][3], e[2][300][3];
    int n = surface_points(&s, 0, 300, 4, points), dark = 0;
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
    d.lattice[0] = d.lattice[1] = d.lattice[2] = 5;
    isogi_trace *whole = baked(&d), *part[2], *lazy = NULL;
    size_t size, all_size;
    uint8_t *all = save_now(whole, &all_size);
    for (int k = 0; k < 2; k++) {
        for (int a = 0; a < 3; a++) d.box_end[a] = 5;
        d.box_first[0] = k ? 2 : 0, d.box_end[0] = k ? 5 : 2; /* not where blocks of texels meet */
        part[k] = baked(&d);
    }
    uint8_t *block = save_now(part[1], &size);
    CHECK(isogi_trace_load(part[0], block, size) == ISOGI_OK, "a box into the other, %d", 1);
    isogi_trace_sample(whole, (const float(*)[3])points, (size_t)n, e[0], NULL);
    isogi_trace_sample(part[0], (const float(*)[3])points, (size_t)n, e[1], NULL);
    for (int i = 0; i < n; i++) dark += e[0][i][1] > 0 && e[1][i][1] <= 0;
    CHECK(n == 300 && !memcmp(e[0], e[1], sizeof e[0]), "other light than of the whole texture, dark at %d of %d", dark, n);
    d.lazy = 1, dark = 0; /* a lazy one of the second box, which is given all: nobody can ask it for what is not there */
    CHECK(isogi_trace_create(&lazy, &d, NULL) == ISOGI_OK && isogi_trace_load(lazy, all, all_size) == ISOGI_OK &&
              isogi_trace_request(lazy, (const float(*)[3])points, (size_t)n) == ISOGI_OK && isogi_trace_step(lazy, 0, NULL) == ISOGI_OK,
          "a lazy box, %d", 1);
    isogi_trace_sample(lazy, (const float(*)[3])points, (size_t)n, e[1], NULL);
    for (int i = 0; i < n; i++) dark += e[0][i][1] > 0 && e[1][i][1] <= 0;
    CHECK(!memcmp(e[0], e[1], sizeof e[0]), "lazy: other light than of the whole texture, dark at %d of %d", dark, n);
    isogi_trace_free(whole), isogi_trace_free(part[0]), isogi_trace_free(part[1]), isogi_trace_free(lazy);
    free(block), free(all), scene_free(&s);
}

/* A lazy box, points near its end whose texels within have no surface: the nearest one is asked for, whatever else was. */
TEST(points_at_the_end_of_a_lazy_box_do_not_depend_on_others) {
    double q[1] = {0.6};
    static float points[2000][3], e[2][3], error[2];
    int near = 0, differ = 0, unknown = 0;
    scene s = scene_make(12, 12, 12, NULL, crumbs, q);
    int n = surface_points(&s, 0, 2000, 5, points);
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
    isogi_trace *all = NULL;
    d.method = ISOGI_TRACE_PATHS, d.lazy = 1;
    for (int a = 0; a < 3; a++) d.lattice[a] = 20, d.box_end[a] = a ? 20 : 10;
    for (int i = 0; i < n; i++) /* between the last texels of the box and those beyond */
        if (fabs((double)points[i][0] - 9.5 * 11 / 19) < 0.3) memcpy(points[near++], points[i], sizeof points[i]);
    CHECK(isogi_trace_create(&all, &d, NULL) == ISOGI_OK && isogi_trace_request(all, (const float(*)[3])points, (size_t)near) == ISOGI_OK &&
              isogi_trace_step(all, 0, NULL) == ISOGI_OK, "%d points", near);
    for (int i = 0; i < near; i++) {
        isogi_trace *alone = NULL;
        const float(*p)[3] = (const float(*)[3])points + i;
        CHECK(isogi_trace_create(&alone, &d, NULL) == ISOGI_OK && isogi_trace_request(alone, p, 1) == ISOGI_OK &&
                  isogi_trace_step(alone, 0, NULL) == ISOGI_OK, "point %d", i);
        isogi_trace_sample(alone, p, 1, &e[0], &error[0]), isogi_trace_sample(all, p, 1, &e[1], &error[1]);
        differ += memcmp(e[0], e[1], sizeof e[0]) != 0, unknown += !isfinite(error[0]) && isfinite(error[1]);
        isogi_trace_free(alone);
    }
    CHECK(near > 60 && !differ && !unknown, "of %d points %d differ, %d are unknown", near, differ, unknown);
    isogi_trace_free(all), scene_free(&s);
}

/* Any change of any byte, any cut: refused, and nothing changes. With the hash mended, what is left to find is found. */
TEST(damaged_blocks_are_refused) {
    double q[2] = {0.5, 4};
    scene s = scene_make(12, 13, 11, NULL, gyroid_in_air, q);
    test_random r = {8};
    for (int format = 1; format < 5; format++) {
        isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, format, 2);
        isogi_trace *t = baked(&d), *other = NULL, *again = NULL;
        size_t size, size_after;
        uint8_t *block = save_now(t, &size), *copy = (uint8_t *)malloc(size + 1), *after;
        isogi_trace_create(&other, &d, NULL);
        for (int i = 0; i < (LONG_SUITE ? 3000 : QUICK_SUITE ? 125 : 250); i++) {
            size_t length = size;
            memcpy(copy, block, size), copy[size] = 0;
            if (i % 3 == 0) length = (size_t)random_range(&r, 0, (double)size);
            else if (i == 1) length = size + 1;
            else copy[i < 120 ? (size_t)i : (size_t)random_range(&r, 0, (double)size)] ^= (uint8_t)(1 << random_bits(&r) % 8);
            CHECK(isogi_trace_load(other, copy, length) == ISOGI_CORRUPT, "change %d", i);
        }
        /* the hash is right: sizes, numbers, order, texels and values are checked */
        for (int i = 0; i < (LONG_SUITE ? 3000 : QUICK_SUITE ? 125 : 250); i++) {
            memcpy(copy, block, size);
            for (int k = 0; k < 1 + i % 3; k++)
                copy[random_bits(&r) % 2 ? 8 + random_bits(&r) % 80 : random_bits(&r) % (size - 8)] = (uint8_t)random_bits(&r);
            mend_hash(copy, size);
            isogi_trace_free(again), again = NULL;
            isogi_trace_create(&again, &d, NULL);
            isogi_result result = isogi_trace_load(again, copy, size);
            CHECK(result == ISOGI_OK || result == ISOGI_CORRUPT || result == ISOGI_INVALID, "result %d", result);
            if (result == ISOGI_OK && i % 50 == 0) {
                float points[20][3], e[20][3];
                int n = surface_points(&s, 0, 20, (uint64_t)i, points);
                isogi_trace_sample(again, (const float(*)[3])points, (size_t)n, e, NULL);
                for (int p = 0; p < n; p++) CHECK(e[p][0] > -3.4e38f && e[p][0] < 3.4e38f, "a value that is no number %d", i);
                CHECK(isogi_trace_step(again, 0, NULL) == ISOGI_OK, "step %d", i);
            }
        }
        memcpy(copy, block, size), copy[8]++, mend_hash(copy, size);
        CHECK(isogi_trace_load(other, copy, size) == ISOGI_CORRUPT, "another version, format %d", format);
        after = save_now(other, &size_after);
        CHECK(size_after == 64, "%d bytes: something was loaded", (int)size_after);
        d.seed++, isogi_trace_free(other), other = NULL;
        isogi_trace_create(&other, &d, NULL);
        CHECK(isogi_trace_load(other, block, size) == ISOGI_INVALID, "another seed, format %d", format);
        CHECK(isogi_trace_load(NULL, block, size) == ISOGI_INVALID && isogi_trace_load(other, NULL, size) == ISOGI_INVALID,
              "nothing, format %d", format);
        isogi_trace_free(t), isogi_trace_free(other), isogi_trace_free(again), free(block), free(copy), free(after);
    }
    scene_free(&s);
}

/* Every field that the light depends on makes the block another one; those that choose texels, and those that mean nothing here, do not. */
static void no_paint(void *user, double isovalue, const double point[3], float albedo[3], float emission[3]) {
    (void)user, (void)isovalue, (void)point, (void)albedo, (void)emission;
}
TEST(blocks_belong_to_their_description) {
    double q[2] = {0.5, 4}, wide[3] = {1, 1.5, 1};
    scene s = scene_make(12, 13, 11, NULL, gyroid_in_air, q), s2 = scene_make(12, 13, 11, wide, gyroid_in_air, q);
    static float image[4][8][3], image2[8][4][3], voxels[12 * 13 * 11];
    isogi_pyramid *other_pyramid = NULL, *shifted = NULL;
    isogi_volume volume = s.volume;
    isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {1, 2, 3}, .rgb = {1, 1, 1}}, lamps[2], sphere = lamp, moved = lamp,
                red = lamp;
    isogi_light rectangle = {.kind = ISOGI_LIGHT_RECTANGLE, .vector = {1, 2, 3}, .rgb = {1, 1, 1}, .edge = {{1, 0, 0}, {0, 1, 0}}},
                turned = rectangle;
    const isogi_albedo_point table[1] = {{0, {0.5f, 0.5f, 0.5f}}}, longer[2] = {{0, {0.5f, 0.5f, 0.5f}}, {1, {0.5f, 0.5f, 0.5f}}},
                             elsewhere[1] = {{0.1, {0.5f, 0.5f, 0.5f}}};
    const float sky[12] = {1, 1, 1, 0.1f}, other_sky[3] = {1, 2, 3};
    memset(lamps, 0, sizeof lamps), lamps[0] = lamp;
    sphere.kind = ISOGI_LIGHT_SPHERE, sphere.radius = 0.5f, moved.vector[2] = 4, red.rgb[1] = 0.5f, turned.edge[1][1] = 2;
    for (int i = 0; i < 96; i++) (&image[0][0][0])[i] = (&image2[0][0][0])[i] = (float)(i % 5);
    memcpy(voxels, s.data, sizeof voxels), voxels[6 + 12 * (6 + 13 * 5)] += 5; /* one voxel, beyond its block's range */
    volume.data = voxels;
    isogi_vol_build(&other_pyramid, &volume, NULL);
    volume.data = s.data, volume.origin[1] = 2;
    isogi_vol_build(&shifted, &volume, NULL);
    enum { FIELDS = 47, SAME = 6 };
    for (int base = 0; base < 5; base++) {
        isogi_trace_desc good = store_desc(&s, base == 4 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, 0, 1);
        isogi_trace *t, *other;
        uint8_t *block;
        size_t size;
        int refused = 0;
        if (base == 1) good.method = ISOGI_TRACE_FEEDBACK;
        if (base == 2)
            good.lighting.lights = &lamp, good.lighting.light_count = 1, good.albedo_points = table, good.albedo_count = 1,
            good.emission_points = table, good.emission_count = 1;
        if (base == 3)
            good.lighting.lights = &rectangle, good.lighting.light_count = 1, good.lighting.env.rgb = &image[0][0][0],
            good.lighting.env.width = 8, good.lighting.env.height = 4;
        good.sides = ISOGI_TRACE_LOW_SIDE;
        t = baked(&good), block = save_now(t, &size);
        for (int i = 0; i < FIELDS + SAME; i++) {
            isogi_trace_desc d = good;
            isogi_result expected = i < FIELDS ? ISOGI_INVALID : ISOGI_OK, result;
            int light = base < 4; /* the lighting of transfer is not in it */
            switch (i) {
            case 0: d.samples = 2; break;
            case 1: d.bounces = 3; break;
            case 2: d.albedo[1] = 0.6f; break;
            case 3: d.lighting.lights = base == 2 ? lamps : &lamp, d.lighting.light_count = base == 2 ? 2 : 1, lamps[1] = red; break;
            case 4: d.albedo_points = base == 2 ? longer : table, d.albedo_count = base == 2 ? 2 : 1; break;
            case 5: d.emission_points = base == 2 ? longer : table, d.emission_count = base == 2 ? 2 : 1; break;
            case 6: d.reach = 3; break;
            case 7: d.no_shadows = 1; break;
            case 8: d.capped = 1; break;
            case 9: d.offset = 0.3f; break;
            case 10: d.normals = ISOGI_NORMAL_TRILINEAR; break;
            case 11: d.lattice[0] = 13; break;
            case 12: d.lattice_max[0] = 10, d.lattice_max[1] = 12, d.lattice_max[2] = 10, d.lattice[0] = 12; break;
            case 13: d.storage = base == 4 ? ISOGI_TRACE_FLOAT : ISOGI_TRACE_HALF; break;
            case 14: d.sides = ISOGI_TRACE_HIGH_SIDE; break;
            case 15: d.pyramid = s2.pyramid; break;
            case 16: d.pyramid = other_pyramid; break;
            case 17: d.pyramid = shifted; break;
            case 18: d.seed++; break;
            case 19: d.method = d.method ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS; break;
            case 20: if (base != 1) continue; d.error = 0.1f; break;
            case 21: d.material = no_paint; break;
            case 22: d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = 8, d.lighting.env.height = 4,
                d.lighting.env.rotation[0] = d.lighting.env.rotation[5] = -1, d.lighting.env.rotation[7] = -1; break;
            case 23: d.lighting.env.rgb = &image2[0][0][0], d.lighting.env.width = 4, d.lighting.env.height = 8; break;
            case 24: d.lighting.env.sh = other_sky, d.lighting.env.sh_order = 1; break;
            case 25: d.lighting.env.sh = sky, d.lighting.env.sh_order = 2; break;
            case 26: d.lighting.lights = &sphere, d.lighting.light_count = 1; break;
            case 27: d.lighting.lights = &moved, d.lighting.light_count = 1; break;
            case 28: d.lighting.lights = &red, d.lighting.light_count = 1; break;
            case 29: d.lighting.lights = &turned, d.lighting.light_count = 1; break;
            case 30: d.albedo_points = elsewhere, d.albedo_count = 1; break;
            case 31: d.emission_points = elsewhere, d.emission_count = 1; break;
            case 32: if (base != 4) continue; d.order = 3; break;
            case 33: if (base != 4) continue; d.transfer_channels = 3; break;
            case 34: d.lattice_min[2] = 1, d.lattice_max[0] = 11, d.lattice_max[1] = 12, d.lattice_max[2] = 10, d.lattice[2] = 11; break;
            case 35: d.lattice[1] = 14; break;
            case 36: d.lattice[2] = 12; break;
            case 37: d.albedo[0] = 0.1f; break;
            case 38: d.albedo[2] = 0.1f; break;
            case 39: d.bounces = -1; break;
            case 40: d.offset = -1; break;
            case 41: d.mode = base == 4 ? ISOGI_TRACE_IRRADIANCE : ISOGI_TRACE_TRANSFER; break;
            case 42: d.storage = ISOGI_TRACE_BYTE; break;
            case 43: d.storage = base == 4 ? ISOGI_TRACE_BYTE : ISOGI_TRACE_RGB9E5; break;
            case 44: d.seed += (uint64_t)1 << 40; break;
            case 45: d.lighting.lights = NULL, d.lighting.light_count = 0, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0,
                d.lighting.env.rgb = NULL, d.lighting.env.width = d.lighting.env.height = 0; break;
            case 46: d.sides = ISOGI_TRACE_BOTH_SIDES; break;
            case FIELDS: d.lazy = 1; break;
            case FIELDS + 1: d.lookup = ISOGI_TRACE_BSPLINE; break;
            case FIELDS + 2: d.isovalue_min = -0.1, d.isovalue_max = 0.1; break;
            case FIELDS + 3: if (base == 4) continue; d.transfer_channels = 3, d.order = 2; break;
            case FIELDS + 4: if (base == 1) continue; d.error = 0.1f; break;
            default: d.box_end[0] = d.box_end[1] = d.box_end[2] = 5;
            }
            if (!light && (i == 3 || i == 5 || (i >= 22 && i <= 29) || i == 31 || i == 45)) continue;
            if (base == 4 && i == 41) d.emission_count = 0;
            if (i == 41 && (base == 2 || base == 3)) continue; /* no lamps, no emission in transfer */
            other = NULL;
            result = isogi_trace_create(&other, &d, NULL);
            CHECK(result == ISOGI_OK, "base %d, change %d: %s", base, i, isogi_result_string(result));
            if (result != ISOGI_OK) continue;
            result = isogi_trace_load(other, block, size);
            CHECK(result == expected, "base %d, change %d: %s", base, i, isogi_result_string(result));
            refused += result == ISOGI_INVALID;
            isogi_trace_free(other);
        }
        CHECK(refused > 30, "%d descriptions were refused", refused);
        for (int side = 0; side < 2; side++) { /* both sides for one, cut where the first ends, and with something else after it */
            isogi_trace_desc d = good;
            isogi_trace *both;
            uint8_t *two;
            size_t size_two;
            d.sides = ISOGI_TRACE_BOTH_SIDES, both = baked(&d), two = save_now(both, &size_two);
            d.sides = side ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE, other = baked(&d);
            CHECK(isogi_trace_load(other, two, size_two) == ISOGI_INVALID, "base %d: both sides for side %d", base, side);
            two[size_two - 20] ^= 1;
            CHECK(isogi_trace_load(other, two, size_two) == (side ? ISOGI_INVALID : ISOGI_CORRUPT), "base %d: side %d", base, side);
            CHECK(isogi_trace_load(both, two, size_two) == ISOGI_CORRUPT, "base %d: damaged", base);
            CHECK(isogi_trace_load(both, two, size) == ISOGI_INVALID, "base %d: the low side alone", base);
            isogi_trace_free(both), isogi_trace_free(other), free(two);
        }
        isogi_trace_free(t), free(block);
    }
    isogi_vol_free(other_pyramid), isogi_vol_free(shifted), scene_free(&s), scene_free(&s2);
}

/* ---- memory that runs out ---------------------------------------------------------------------------------------------------- */

/* The k-th allocation fails, for every k: an error or success, nothing leaks, and after a failed step or load the rest still works. */
TEST(every_allocation_may_fail) {
    double q[2] = {0.5, 4};
    scene s = scene_make(9, 8, 7, NULL, gyroid_in_air, q);
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 1), levels = d;
    isogi_trace *good = baked(&d);
    size_t size;
    uint8_t *block = save_now(good, &size), *bytes = (uint8_t *)malloc(9 * 8 * 7 * 12);
    int finished = 0;
    levels.hierarchy = 0.2f, levels.sides = ISOGI_TRACE_BOTH_SIDES;
    for (long k = 0; k < 400 && !finished; k++) {
        scarce memory = {k, 0};
        isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 2}; /* a pool, too */
        for (int kind = 0; kind < 2; kind++) {
            isogi_trace *t = NULL;
            isogi_result result, loaded = ISOGI_OK;
            d.lazy = 1, memory.left = k;
            result = isogi_trace_create(&t, kind ? &levels : &d, &context);
            CHECK(result == ISOGI_OK ? t != NULL : result == ISOGI_NO_MEMORY && !t, "allocation %ld: %d", k, result);
            if (result == ISOGI_OK && !kind) loaded = isogi_trace_load(t, block, size);
            if (result == ISOGI_OK) result = isogi_trace_step(t, 0, NULL);
            CHECK(result == ISOGI_OK || result == ISOGI_NO_MEMORY, "allocation %ld: %d", k, result);
            if (t && result == ISOGI_OK && loaded == ISOGI_OK && !kind)
                result = isogi_trace_export(t, ISOGI_TRACE_FLOAT, bytes, 9 * 8 * 7 * 12);
            finished = memory.left >= 0;
            memory.left = -1;
            if (t && !kind) CHECK(isogi_trace_load(t, block, size) == ISOGI_OK &&
                isogi_trace_export(t, ISOGI_TRACE_FLOAT, bytes, 9 * 8 * 7 * 12) == ISOGI_OK, "after allocation %ld", k);
            if (t) CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "after allocation %ld", k);
            isogi_trace_free(t);
            CHECK(memory.blocks == 0, "allocation %ld: %ld blocks leak", k, memory.blocks);
        }
    }
    CHECK(finished, "there are more allocations, %d", finished);
    isogi_trace_free(good), free(block), free(bytes), scene_free(&s);
}

/* Where memory runs out while a block is loaded none of it is, and the bake goes on to the same bits: a part of a cube would find other
   probes. */
TEST(blocks_are_loaded_whole_or_not_at_all) {
    double q[2] = {0.5, 4};
    scene s = scene_make(16, 15, 14, NULL, gyroid_in_air, q);
    isogi_trace_desc d = store_desc(&s, ISOGI_TRACE_IRRADIANCE, 0, 4);
    isogi_trace *whole;
    size_t size;
    uint8_t *block;
    int failed = 1;
    d.method = ISOGI_TRACE_FEEDBACK, d.sides = ISOGI_TRACE_BOTH_SIDES;
    whole = baked(&d), block = save_now(whole, &size);
    for (long k = 0; failed; k += QUICK_SUITE ? 21 : 7) {
        scarce memory = {-1, 0};
        isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
        isogi_trace *t = NULL;
        isogi_trace_report before, after;
        isogi_result result;
        uint8_t *again;
        size_t bytes;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "%ld", k);
        isogi_trace_status(t, &before), memory.left = k;
        result = isogi_trace_load(t, block, size), failed = memory.left < 0, memory.left = -1;
        isogi_trace_status(t, &after);
        CHECK(result == (failed ? ISOGI_NO_MEMORY : ISOGI_OK), "allocation %ld: %d", k, result);
        CHECK(!failed || after.texels == before.texels, "allocation %ld: %d texels are loaded", k, (int)after.texels);
        CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "after allocation %ld", k);
        again = save_now(t, &bytes);
        CHECK(bytes == size && !memcmp(again, block, size), "other bits after allocation %ld", k);
        free(again), isogi_trace_free(t);
    }
    isogi_trace_free(whole), free(block), scene_free(&s);
}

/* RGB9E5: no channel is off by more than half a step, which is 1/512 of the power of two
   above the largest; and just below one, which the largest is rounded up to, of the next, but for the largest itself. */
TEST(shared_exponents_round_to_the_nearest) {
    double q[1] = {2.5};
    scene s = scene_make(5, 5, 5, NULL, ground, q);
    const float points[1][3] = {{2, 2, 2}};
    double worst = 0;
    for (int i = 0; i < 100; i++) {
        const float bright = 0.97f + 0.0004f * (float)i;
        isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, 1, 0, 1, 0);
        isogi_trace_desc d = desc_make(&s, 0, 0, 1);
        isogi_trace *t = NULL;
        float e[1][3];
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.lights = &sun, d.lighting.light_count = 1, d.storage = ISOGI_TRACE_RGB9E5;
        sun.rgb[0] = bright, sun.rgb[1] = 0.7f * bright, sun.rgb[2] = 0.1f;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                  isogi_trace_sample(t, points, 1, e, NULL) == ISOGI_OK,
              "bake");
        for (int c = 0; c < 3; c++) {
            const double off = fabs((double)e[0][c] - (double)sun.rgb[c]), half = bright > (c ? 0.999f : 1) ? 0x1p-9 : 0x1p-10;
            worst = fmax(worst, off / half);
            CHECK(off <= 1.001 * half, "light %g, channel %d: %g, not %g", (double)bright, c, (double)e[0][c], (double)sun.rgb[c]);
        }
        isogi_trace_free(t);
    }
    CHECK(worst > 0.9, "off by %g of half a step at most", worst);
    scene_free(&s);
}

static uint64_t number_at(const uint8_t *from) {
    uint64_t x = 0;
    for (int i = 0; i < 8; i++) x |= (uint64_t)from[i] << 8 * i;
    return x;
}

/* A block whose hash is right is looked at all the same: bricks that come twice and records that are no numbers are not loaded. */
TEST(blocks_of_a_right_hash_are_checked) {
    enum { HEADER = 56 };
    double q[4] = {8, 8, 8, 5};
    scene s = scene_make(17, 17, 17, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
    isogi_trace *t = NULL;
    d.storage = ISOGI_TRACE_HALF, d.isovalue_min = -0.1, d.isovalue_max = 0.1;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
    const size_t size = isogi_trace_save_size(t);
    uint8_t *block = (uint8_t *)malloc(size);
    CHECK(size > 500 && isogi_trace_save(t, block, size) == ISOGI_OK && isogi_trace_load(t, block, size) == ISOGI_OK, "save");
    for (int k = 0; k < 3; k++) {
        uint64_t hash = 0xcbf29ce484222325u, mask = number_at(block + HEADER + 8);
        size_t next = HEADER + 16;
        CHECK(isogi_trace_save(t, block, size) == ISOGI_OK, "save");
        for (; mask; mask &= mask - 1) next += 8; /* an error and three halves each */
        if (k == 1) memcpy(block + next, block + HEADER, 8);
        if (k == 2) block[HEADER + 16 + 4] = 0, block[HEADER + 16 + 5] = 0x7c;
        for (size_t i = 0; i < size - 8; i++) hash = (hash ^ block[i]) * 0x100000001b3u;
        for (int i = 0; i < 8; i++) block[size - 8 + (size_t)i] = (uint8_t)(hash >> 8 * i);
        CHECK(isogi_trace_load(t, block, size) == (k ? ISOGI_CORRUPT : ISOGI_OK), "%s is loaded, or nothing is",
              k == 1 ? "a brick that comes twice" : "an infinite number");
    }
    free(block), isogi_trace_free(t), scene_free(&s);
}

TEST_MAIN("trace_store")
