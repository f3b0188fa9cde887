/* Pictures of media by isogi_dvr.h: every path of physical space, limits, emission and phase function, depth, geometry, jitter, steady
   blocks. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

static const isogi_lighting sky = {.env = {.sh = sky_one, .sh_order = 1}};

static double even(double x, double y, double z) { return (void)x, (void)y, (void)z, 2; }
static double along_x(double x, double y, double z) { return (void)y, (void)z, 48 * x; }

/* One pixel without depth: physical space is pre-integrated then. */
static void colour_of(const isogi_dvr *dvr, const double eye[3], const double target[3], const isogi_lighting *lighting, float out[4],
                      isogi_counters *count) {
    const isogi_view view = line_of_sight(eye, target);
    isogi_result result = isogi_dvr_render(dvr, &view, lighting, (float(*)[4])out, NULL, count);
    CHECK(result == ISOGI_OK, "render: %s", isogi_result_string(result));
}

/* What is integrated along a line through f = x, in physical space (per = length of the line per unit of x) or in data space (per = 1),
   by the midpoint rule in long double; jumps of the transfer function at whole values stay between pieces. */
static void along_values(const isogi_transfer *t, double low, double high, double per, long double out[4]) {
    enum { PIECES = 200 }; /* for each unit */
    long double clear = 1;
    for (int a = 0; a < 4; a++) out[a] = 0;
    for (long i = 0; i < (high - low) * PIECES; i++) {
        long double v[4], depth;
        reference_transfer(t, low + (i + 0.5L) / PIECES, v);
        depth = v[3] * per / PIECES;
        for (int a = 0; a < 3; a++) out[a] += clear * -expm1l(-depth) * v[a];
        clear *= expl(-depth);
    }
    out[3] = 1 - clear;
}

/* ---- homogeneous media and limits ---- */

TEST(homogeneous_media_follow_beer_and_lambert_without_depth_too) {
    field f = field_of(even, 20);
    const double steps[] = {0, 0.37, 3.3}, extinctions[] = {1e-9, 1e-3, 0.05, 0.4, 2, 1e6};
    const double eye[3] = {-30, 3, 5}, target[3] = {50, 12, 9}, length = 19 * sqrt(80 * 80 + 9 * 9 + 4 * 4) / 80;
    for (int s = 0; s < 3; s++)
        for (int e = 0; e < 6; e++)
            for (int lit = 0; lit < 2; lit++) {
                const isogi_transfer_point point = {0, {0.2f, 0.5f, 1}, (float)extinctions[e]};
                const isogi_transfer transfer = {&point, 1, NULL, 0};
                const isogi_dvr_desc desc = {
                    .pyramid = f.pyramid, .step = steps[s], .shading = lit ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT, .grid = {2, 2, 2}};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                double expected = -expm1(-length * (double)point.extinction);
                float c[4];
                colour_of(dvr, eye, target, &sky, c, NULL);
                /* floats, and rays end at 0.999; a thin medium keeps its relative accuracy but for 1 - T in float */
                CHECK(fabs((double)c[3] - expected) < 2e-6 + (expected > 0.99 ? 1e-3 : 0), "step %g extinction %g: %g, not %g", steps[s],
                      extinctions[e], (double)c[3], expected);
                for (int a = 0; a < 3; a++) /* no shadows yet: under a sky of 1 lit looks as unlit */
                    CHECK(fabs((double)(c[a] - c[3] * point.rgb[a])) < 1e-6 + 1e-4 * expected,
                          "step %g extinction %g lit %d channel %d: %g of %g", steps[s], extinctions[e], lit, a, (double)c[a],
                          (double)c[3]);
                isogi_dvr_free(dvr);
            }
    field_free(&f);
}

/* One point, several at one value, all of them beyond the data, values as far away as doubles go, and the opaque limit of each: by both
   paths of physical space, and in data space. */
TEST(odd_transfer_functions_are_integrated_as_they_say) {
    const isogi_transfer_point cases[][5] = {
        {{24, {1, 0.5f, 0.2f}, 0.05f}, {0, {0, 0, 0}, 0}},
        {{24, {1, 0, 0}, 0.01f}, {24, {0, 1, 0}, 7}, {24, {0, 0, 1}, 3}, {24, {0.5f, 0.5f, 1}, 0.1f}},
        {{-1e9, {1, 0, 0}, 0.02f}, {-5, {0.5f, 1, 0}, 0.04f}},
        {{90, {1, 0, 0}, 0.02f}, {1e9, {0.5f, 1, 0}, 0.04f}},
        {{-1e308, {1, 0, 0}, 0.02f}, {1e308, {0, 1, 0}, 0.06f}},
        {{10, {1, 0, 0}, 0}, {20, {1, 0, 0}, 0.2f}, {20, {0, 0, 1}, 0}, {48, {0, 0, 1}, 0.1f}},
        {{12, {0, 0, 0}, 0}, {12, {0.2f, 0.9f, 0.4f}, 1e6f}},
    };
    const size_t counts[] = {1, 4, 2, 2, 2, 4, 2};
    field f = field_of(along_x, 49);
    const double eye[3] = {-30, 10, 15}, target[3] = {64, 37, 30}, per = sqrt(94 * 94 + 27 * 27 + 15 * 15) / 94;
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        const isogi_transfer transfer = {cases[n], counts[n], NULL, 0};
        long double expected[4];
        for (int way = 0; way < 4; way++) { /* pre-integrated, post-classified; data space exactly, pre-integrated */
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = way < 2 ? ISOGI_DVR_PHYSICAL : ISOGI_DVR_DATA, .opaque = way ? 1
                : 0, .step = way == 1 ? 0.05 : 0,
                                         .classification = way == 1 ? ISOGI_DVR_POST_CLASSIFIED : way == 3 ? ISOGI_DVR_PRE_INTEGRATED
                                         : ISOGI_DVR_EXACT};
            /* a thousand classes of value; steps of a 20th of a voxel at jumps; exact; 256 entries a side, blurred over two of them */
            const double tolerance[4] = {0.004, 0.01, 1e-5, 0.05};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            float c[4];
            if (way % 2 == 0) along_values(&transfer, 0, 48, way < 2 ? per : 1, expected);
            colour_of(dvr, eye, target, NULL, c, NULL);
            for (int a = 0; a < 4; a++)
                CHECK(fabs((double)c[a] - (double)expected[a]) < tolerance[way], "case %zu way %d channel %d: %.6g, not %.6g", n, way, a,
                      (double)c[a], (double)expected[a]);
            isogi_dvr_free(dvr);
        }
    }
    field_free(&f);
}

TEST(opaque_matter_hides_what_is_behind_it) {
    field f = field_of(along_x, 49);
    const isogi_transfer_point p[] = {
        {16, {1, 1, 1}, 0}, {16, {0.9f, 0.2f, 0.1f}, 1e6f}, {17, {0.9f, 0.2f, 0.1f}, 1e6f}, {17, {0.1f, 0.2f, 0.9f}, 1e6f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    for (int space = 0; space < 2; space++)
        for (int back = 0; back < 2; back++) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            const double ends[2][3] = {{-20, 20, 22}, {70, 22, 20}};
            pixel seen = cast(dvr, ends[back], ends[!back], NULL);
            float c[4];
            colour_of(dvr, ends[back], ends[!back], NULL, c, NULL);
            for (int a = 0; a < 3; a++)
                CHECK(fabsf(c[a] - p[back ? 3 : 1].rgb[a]) < 2e-3f && fabsf(seen.c[a] - p[back ? 3 : 1].rgb[a]) < 2e-3f,
                      "space %d side %d channel %d: %g, with depth %g", space, back, a, (double)c[a], (double)seen.c[a]);
            double surface = back ? 70 - 48 : 16 + 20; /* along x; the line leans by a tenth of a percent */
            CHECK(fabs((double)seen.depth - surface) < (space ? 0.03 : 0.3), "space %d side %d: depth %g, not %g", space, back,
                  (double)seen.depth, surface);
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* ---- light: emission and phase function ---- */

TEST(emission_glows_without_light_and_adds_to_it) {
    field f = field_of(even, 12);
    const isogi_transfer_point point = {0, {0.8f, 0.5f, 0.3f}, 0.1f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_lighting dark = {.lights = NULL};
    const double eye[3] = {-30, 3, 5}, target[3] = {5, 7, 6};
    for (int way = 0; way < 2; way++) /* both paths of physical space */
        for (int n = 0; n < 3; n++) {
            const double emission = n ? 2.5 : 0;
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .emission = emission, .grid = {2, 2, 2},
                                         .classification = way ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            float c[4];
            colour_of(dvr, eye, target, n == 1 ? &dark : &sky, c, NULL); /* visibility is not stepped: no shadows, light 1 */
            for (int a = 0; a < 3; a++) {
                double expected = (double)(c[3] * point.rgb[a]) * (emission + (n == 1 ? 0 : 1));
                CHECK(fabs((double)c[a] - expected) < 1e-4 * expected + 1e-6, "way %d case %d: %g, not %g", way, n, (double)c[a], expected);
            }
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* Without shadows light from one direction, scattered by an angle: E / (4 pi) sum of (2 l + 1) g^l P_l(cosine), the series of Henyey and
   Greenstein's function up to the order; and a sky of 1 looks the same whatever g is. */
TEST(scattering_follows_henyey_and_greenstein) {
    enum { L = 6 };
    field f = field_of(even, 12);
    const isogi_transfer_point point = {0, {1, 1, 1}, 1e-5f}; /* too thin for shadows */
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const double g[] = {0, 0.3, 0.7, -0.5, 0.99}, eye[3] = {-30, 3, 5}, target[3] = {5, 7, 6};
    test_random r = {3};
    for (int n = 0; n < 5; n++) {
        const isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .anisotropy = g[n], .order = L, .grid = {2, 2, 2}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        double view[3], length = 0;
        float c[4];
        for (int a = 0; a < 3; a++) view[a] = target[a] - eye[a], length += view[a] * view[a];
        colour_of(dvr, eye, target, &sky, c, NULL);
        CHECK(fabs((double)(c[0] / c[3]) - 1) < 1e-4, "g %g: a sky of 1 looks like %g", g[n], (double)(c[0] / c[3]));
        for (int k = 0; k < 20; k++) {
            double to[3], cosine = 0, series = 0, p0 = 1, p1;
            random_direction(&r, to);
            const isogi_light sun = {.vector = {(float)to[0], (float)to[1], (float)to[2]}, .rgb = {2, 2, 2}};
            const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
            for (int a = 0; a < 3; a++)
                cosine += to[a] * view[a] / sqrt(length); /* light that comes from where the ray goes goes straight on */
            p1 = cosine;
            for (int l = 0; l < L; l++) {
                double p2 = ((2 * l + 3) * cosine * p1 - (l + 1) * p0) / (l + 2);
                series += (2 * l + 1) * pow(g[n], l) * p0, p0 = p1, p1 = p2;
            }
            colour_of(dvr, eye, target, &lighting, c, NULL);
            double expected = fmax(0, 2 / (4 * PI) * series); /* what rings below zero is cut */
            CHECK(fabs((double)(c[0] / c[3]) - expected) < 2e-4 * (1 + expected), "g %g cosine %g: %g, not %g", g[n], cosine,
                  (double)(c[0] / c[3]), expected);
        }
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* A floor that is lit by half of a sky of 1, above a glare that it hides: the series of order 3 is negative there, and light 0 would be as
   wrong as can be. A directional light in the place of the glare, which casts a shadow that is black, adds nothing; nor does the glare
   alone at order 6, which rings little. */
static double ground(double x, double y, double z) { return (void)x, (void)z, y < 0.5; }

TEST(a_sky_that_glares_behind_matter_does_not_blacken_what_it_lights_from_in_front) {
    enum { WIDTH = 32, HEIGHT = 16 };
    static float image[WIDTH * HEIGHT * 3];
    field f = field_of(ground, 25);
    const isogi_transfer_point p[] = {{0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 3}, {1, {1, 1, 1}, 3}};
    const isogi_transfer transfer = {p, 3, NULL, 0};
    const double eye[3] = {13, 60, 8}, target[3] = {12, 12, 12};
    const isogi_light sun = {.vector = {0, -1, 0}, .rgb = {10, 10, 10}};
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) image[i] = i / 3 / WIDTH < HEIGHT - 2 ? 1 : 60;
    const isogi_lighting glare = {.env = {.rgb = image, .width = WIDTH, .height = HEIGHT}}, below = {.lights = &sun, .light_count = 1};
    for (int way = 0; way < 4; way++) { /* both paths of physical space; forward scattering */
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {13, 13, 13}, .order = way < 3 ? 3 : 2,
                                     .classification = way % 2 ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT,
                                     .anisotropy = way == 2 ? 0.05 : 0};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float lit[4], dark[4];
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        colour_of(dvr, eye, target, &glare, lit, NULL), colour_of(dvr, eye, target, &below, dark, NULL);
        CHECK(lit[3] > 0.99f && lit[0] > 0.25f && lit[0] < 0.65f, "way %d: light %g, not about 0.5", way, (double)lit[0]);
        CHECK(dark[0] < 1e-6f, "way %d: %g in a shadow", way, (double)dark[0]);
        isogi_dvr_free(dvr);
    }
    for (int i = 0; i < WIDTH * (HEIGHT - 2) * 3; i++) image[i] = 0;
    for (int order = 3; order <= 6; order += 3) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .grid = {13, 13, 13}, .order = order};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float lit[4];
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        colour_of(dvr, eye, target, &glare, lit, NULL);
        CHECK(order == 3 ? lit[0] > 0.1f : lit[0] < 0.06f, "order %d: light %g where all light is hidden", order, (double)lit[0]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* A medium too thin for shadows under a sky of 1 + k cos, along whose dark side the eye looks: degree 1 of what is scattered is g k, so
   that the series is 1 + g k, and where that is less than the least that the header states, light is that least. */
TEST(the_least_light_of_a_sky_is_as_stated_for_all_orders_and_phase_functions) {
    field f = field_of(even, 12);
    const isogi_transfer_point point = {0, {1, 1, 1}, 1e-5f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const double eye[3] = {5, 6, -40}, target[3] = {5, 6, 6}, g[] = {0.05, 0.3, 0.6, 0.9, -0.05, -0.3, -0.6, -0.9},
                 share[] = {0, 0, 0.25, 0.25, 0.25, 0.125, 0};
    for (int order = 2; order <= 6; order++)
        for (int n = 0; n < 8; n++) {
            const isogi_dvr_desc desc = {
                .pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .anisotropy = g[n], .order = order, .grid = {2, 2, 2}};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            for (int dark = 0; dark < 2; dark++) {
                const double k = (g[n] > 0 ? -1 : 1) * (dark ? 60 : 0.2), size = fabs(g[n]);
                float sh[12] = {0}, c[4];
                for (int a = 0; a < 3; a++) sh[a] = (float)sqrt(4 * PI), sh[6 + a] = (float)(k * sqrt(4 * PI / 3)); /* degree 1 along z */
                const isogi_lighting lighting = {.env = {.sh = sh, .sh_order = 2}};
                const double expected = fmax(1 + g[n] * k, share[order] * (1 - size) / ((1 + size) * (1 + size)));
                colour_of(dvr, eye, target, &lighting, c, NULL);
                CHECK(fabs((double)(c[0] / c[3]) - expected) < 1e-4, "order %d, g %g, k %g: light %g, not %g", order, g[n], k,
                      (double)(c[0] / c[3]), expected);
            }
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* Saw teeth, rising to a step or falling from one: what lies just below a step counts to its lower side, and a linear field passes teeth of
   half their height on average, however few classes of values there are to each. */
TEST(teeth_of_a_transfer_function_keep_their_opacity) {
    enum { TEETH = 600 };
    static isogi_transfer_point p[2 * TEETH];
    field f = field_of(along_x, 49);
    const isogi_transfer transfer = {p, 2 * TEETH, NULL, 0};
    const double eye[3] = {-30, 20.3, 20.6}, target[3] = {50, 20.3, 20.6};
    for (int falling = 0; falling < 2; falling++)
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1};
            for (int i = 0; i < 2 * TEETH; i++)
                p[i] = (isogi_transfer_point){48.0 / TEETH * ((i + 1) / 2), {1, 1, 1}, i % 2 != falling ? 0.04f : 0};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            float c[4];
            colour_of(dvr, eye, target, NULL, c, NULL);
            double depth = -log1p(-(double)c[3]);
            CHECK(fabs(depth - 0.96) < 2e-3, "%s, path %d: depth %g, not 0.96", falling ? "falling" : "rising", path, depth);
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* Light falls off into a medium that is lit from where the eye is. Of a piece of optical depth 2 the front is seen most, and light is
   looked up there: four fifths of what small steps give, as it falls off ever less; light from the middle is less than three fifths. */
TEST(light_is_that_of_where_a_long_piece_is_seen) {
    enum { SIDE = 65 };
    static float data[SIDE * SIDE * SIDE]; /* floats: the vectors of every path read these */
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
    isogi_pyramid *pyramid = NULL;
    const isogi_transfer_point point = {0, {1, 1, 1}, 0.25f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const isogi_light lamp = {.vector = {-1, 0, 0}, .rgb = {10, 10, 10}};
    const isogi_lighting lighting = {.lights = &lamp, .light_count = 1};
    const isogi_view view = {.width = 8, .height = 8, .eye = {-90, 32, 32}, .target = {50, 32, 32}, .fov = 5};
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) data[i] = 2;
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int path = 1; path <= 4; path++) {
        const isogi_context context = {.threads = 1, .force_path = path};
        double light[2] = {0, 0};
        for (int n = 0; n < 2; n++) {
            const isogi_dvr_desc desc = {.pyramid = pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 3, .directions = 32, .opaque = 1,
                                         .grid = {33, 5, 5}, .step = n ? 8 : 0.2, .visibility_step = 2};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            float(*image)[4] = picture(dvr, &view, &lighting, NULL, NULL);
            for (int i = 0; i < 64; i++) light[n] += (double)image[i][0];
            free(image), isogi_dvr_free(dvr);
        }
        CHECK(light[1] > 0.75 * light[0] && light[1] < light[0], "path %d: %g of what small steps give", path, light[1] / light[0]);
    }
    isogi_vol_free(pyramid);
}

/* ---- depth ---- */

/* Matter from x = 16 to 40: opacity begins at the face, half of it is reached ln 2 further or so. Samples of
   physical space know it to half a step; exact rays, with a bound or in data space, to rounding. */
TEST(depth_is_that_of_first_or_of_half_opacity_as_asked) {
    field f = field_of(along_x, 49);
    const double eye[3] = {-20, 20, 22}, target[3] = {80, 21, 24}, per = sqrt(100 * 100 + 1 + 4) / 100;
    for (int way = 0; way < 3; way++)
        for (double k = 1e-6; k < 2; k *= 10) {
            const isogi_transfer_point p[] = {{16, {1, 1, 1}, 0}, {16, {1, 1, 1}, (float)k}, {40, {1, 1, 1}, (float)k}, {40, {1, 1, 1}, 0}};
            const isogi_peak peak = {30, {1, 1, 1}, 0.25f};
            for (int peaks = 0; peaks < 2; peaks++) {
                const isogi_transfer transfer = {p, peaks ? 0u : 4u, &peak, (size_t)peaks};
                const int space = way == 1;
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .step = 0.25, .opaque = 1,
                                             .bound = way == 2 ? 0.1 : 0};
                const double tolerance = way ? 2e-4 : 0.15; /* depths are floats of 60 */
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                isogi_view view = line_of_sight(eye, target);
                float c[2][4], depth[2];
                for (int first = 0; first < 2; first++) {
                    view.depth = first ? ISOGI_DEPTH_FIRST : ISOGI_DEPTH_HALF;
                    CHECK(isogi_dvr_render(dvr, &view, NULL, &c[first], &depth[first], NULL) == ISOGI_OK, "render");
                }
                double whole = 24 * (space ? 1 : per) * k, half = peaks ? 30 : 16 + 24 * -log1p(0.5 * expm1(-whole)) / whole;
                CHECK(!memcmp(c[0], c[1], sizeof c[0]), "the picture does not depend on what depth means");
                const double begins = (20 + (peaks ? 30 : 16)) * per;
                CHECK(fabs((double)depth[1] - begins) < tolerance, "way %d extinction %g peaks %d: first %g, not %g", way, k, peaks,
                      (double)depth[1], begins);
                CHECK(fabs((double)depth[0] - (20 + half) * per) < tolerance, "way %d extinction %g peaks %d: half %g, not %g", way, k,
                      peaks, (double)depth[0], (20 + half) * per);
                view.depth = (isogi_depth_kind)2;
                CHECK(isogi_dvr_render(dvr, &view, NULL, &c[0], NULL, NULL) == ISOGI_INVALID, "a kind of depth that does not exist");
                isogi_dvr_free(dvr);
            }
        }
    field_free(&f);
}

TEST(depth_through_tetrahedra_is_as_on_the_lattice) {
    const float points[4][3] = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {0, 0, 10}};
    const float values[4] = {0, 10, 0, 0}; /* f = x */
    const uint32_t tet[1][4] = {{0, 1, 2, 3}};
    const isogi_tet_mesh mesh = {points, values, 4, tet, 1};
    const isogi_transfer_point p[] = {{2, {1, 1, 1}, 0}, {2, {1, 1, 1}, 0.3f}, {7, {1, 1, 1}, 0.3f}, {7, {1, 1, 1}, 0}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    isogi_tets *tets = NULL;
    CHECK(isogi_dvr_tets_build(&tets, &mesh, NULL, &serial) == ISOGI_OK, "build");
    const double eye[3] = {-10, 1, 1}, target[3] = {10, 1, 1};
    isogi_view view = line_of_sight(eye, target);
    for (int first = 0; first < 2; first++) {
        float c[1][4], depth;
        view.depth = first ? ISOGI_DEPTH_FIRST : ISOGI_DEPTH_HALF;
        CHECK(isogi_dvr_tets_render(tets, NULL, &transfer, &view, c, &depth, NULL) == ISOGI_OK, "render");
        double expected = 12 + (first ? 0 : -log1p(0.5 * expm1(-1.5)) / 0.3);
        CHECK(fabs((double)depth - expected) < 1e-4, "%s: %g, not %g", first ? "first" : "half", (double)depth, expected);
    }
    isogi_dvr_tets_free(tets);
}

/* Air is the least value of a scan, and extinction rises from there: beside matter, where no block of air is stepped over, it is clear all
   the same, to rays and to light that passes through it. What is saturated, at the greatest value, has the extinction of that. */
TEST(ends_of_the_range_are_not_blurred) {
    enum { N = 40 };
    static const isogi_type types[] = {ISOGI_U8, ISOGI_I16, ISOGI_F32};
    static float floats[N * N * N];
    static int16_t shorts[N * N * N];
    static uint8_t bytes[N * N * N];
    const void *const data[] = {bytes, shorts, floats};
    for (int n = 0; n < 12; n++) {
        const double air = n % 3 == 1 ? -1000 : n % 3 ? -0.3 : 0, top = n % 3 == 1 ? 3000 : n % 3 ? 7.9 : 255;
        const isogi_transfer_point rising[] = {{air, {1, 1, 1}, 0}, {n % 2 ? top : 2 * top - air, {1, 1, 1}, n % 2 ? 2 : 4}};
        const isogi_transfer transfer = {rising, 2, NULL, 0};
        const isogi_context context = {.threads = 1, .force_path = n / 3};
        isogi_volume volume = {.data = data[n % 3], .type = types[n % 3], .size = {N, N, N}};
        float c[1][4], open[2], depth, place[1][3] = {{21.5f, 21.5f, 20}};
        isogi_pyramid *pyramid;
        for (int i = 0; i < N * N * N; i++) { /* rods along z, four apart; behind them a block */
            const int matter = (i % N % 4 == 0 && i / N % N % 4 == 0) || i / N / N > 30;
            bytes[i] = matter ? 255 : 0, shorts[i] = matter ? 3000 : -1000, floats[i] = (float)(matter ? top : air);
        }
        CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
        for (int method = 0; method < 2; method++) {
            const isogi_dvr_desc desc = {.pyramid = pyramid, .opaque = 1, .shading = ISOGI_DVR_VISIBILITY, .order = 1, .directions = 16,
                                         .grid = {LONG_SUITE ? 20 : 5, 9, 9}, .visibility_step = 1, .unit = 16,
                                         .method = method ? ISOGI_DVR_BRUTE : ISOGI_DVR_SWEEP};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_sample_visibility(dvr, (const float(*)[3])place, 1, &open[method]) == ISOGI_OK,
                  "step");
            isogi_dvr_free(dvr);
        }
        CHECK(fabs((double)(open[0] - open[1])) < 0.15 * (double)open[1], "case %d: visibility %g by sweeps, %g by brute force", n,
              (double)open[0], (double)open[1]);
        const isogi_dvr_desc unlit = {.pyramid = pyramid, .opaque = 1, .unit = 16};
        isogi_dvr *dvr = dvr_new_with(&unlit, &transfer, &context);
        const double eye[3] = {21.8, 22.2, -20}, air_end[3] = {21.8, 22.2, 29.5}, within[3] = {21.8, 22.2, 38}, down[3] = {21.8, 22.2, 60};
        isogi_view view = line_of_sight(eye, within);
        float until = (float)(air_end[2] - eye[2]);
        view.until = &until;
        CHECK(isogi_dvr_render(dvr, &view, NULL, c, &depth, NULL) == ISOGI_OK, "render");
        CHECK(!(c[0][3] > 1e-6f) && (c[0][3] > 0 || depth > 1e30f), "case %d: air has opacity %g", n, (double)c[0][3]);
        view = line_of_sight(down, within), until = 31 - 60, until = -until, view.until = &until;
        CHECK(isogi_dvr_render(dvr, &view, NULL, c, NULL, NULL) == ISOGI_OK, "render");
        /* 8 voxels at the greatest value, of an extinction of 2 */
        CHECK(fabs(-log1p(-(double)c[0][3]) - 1) < 2e-4, "case %d: depth %g, not 1", n, -log1p(-(double)c[0][3]));
        isogi_dvr_free(dvr), isogi_vol_free(pyramid);
    }
}

/* ---- clip planes ---- */

/* A medium of constant extinction in the field x, of which planes in any direction, or the six of a box, leave a part: opacity of what is
   left along a ray (of the values passed, in data space), from where it begins; and an isosurface that counts where it is left. */
TEST(planes_and_boxes_cut_pictures_where_they_say) {
    field f = field_of(along_x, 49);
    test_random r = {31};
    const isogi_transfer_point medium = {0, {1, 0.5f, 0.2f}, 0.02f};
    const isogi_peak peak = {25, {1, 1, 1}, 0.25f};
    int cut = 0, crossed = 0, nothing = 0;
    for (int n = 0; n < (LONG_SUITE ? 20000 : 1200); n++) {
        const int way = n % 6, data = way > 2, peaks = n / 6 % 2, count = n % 5 ? 1 + (int)(random_bits(&r) % 4) : 6;
        const isogi_transfer transfer = {&medium, 1, &peak, (size_t)peaks};
        const isogi_context context = {.threads = 1, .force_path = n / 12 % 5};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)data, .opaque = 1, .bound = way == 2 ? 0.1 : 0,
                                     .classification = (isogi_dvr_classification)(way == 1 ? 2 : way > 2 ? way - 3 : 0), .step = 0.2};
        double planes[6][4], target[3], eye[3], origin[3], dir[3], from = 0, to = 1e9, enter, leave, at;
        for (int a = 0; a < 3; a++) target[a] = random_range(&r, 16, 32), eye[a] = target[a] + random_range(&r, n % 4 ? -90 : -9, 90);
        for (int i = 0; i < count; i++) {
            planes[i][3] = 0;
            for (int a = 0; a < 3; a++) {
                planes[i][a] = count < 6 ? random_range(&r, -2, 2) : a == i / 2 ? 1 - 2 * (i % 2) : 0;
                planes[i][3] -= planes[i][a] * (24 + (count < 6 ? random_range(&r, -12, 12) : i % 2 ? 9 : -9));
            }
        }
        isogi_view view = line_of_sight(eye, target);
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        float c[1][4], depth;
        view.depth = ISOGI_DEPTH_FIRST;
        CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])planes, (size_t)count) == ISOGI_OK &&
                  isogi_dvr_render(dvr, &view, NULL, c, &depth, NULL) == ISOGI_OK,
              "render");
        isogi_dvr_free(dvr), view_ray(&view, 0, 0, origin, dir);
        for (int a = 0; a < 3; a++) {
            double low = -origin[a] / dir[a], high = (48 - origin[a]) / dir[a];
            from = fmax(from, fmin(low, high)), to = fmin(to, fmax(low, high));
        }
        enter = from, leave = to;
        for (int i = 0; i < count; i++) {
            double here = planes[i][3], slope = 0;
            for (int a = 0; a < 3; a++) here += planes[i][a] * origin[a], slope += planes[i][a] * dir[a];
            if (slope > 0) from = fmax(from, -here / slope);
            else to = fmin(to, -here / slope);
        }
        at = (25 - origin[0]) / dir[0];
        const int passed = peaks && at > from && at < to, left = to > from;
        if (fabs(at - from) < 1e-3 || fabs(at - to) < 1e-3 || fabs(to - from) < 1e-3) continue;
        double thick = left ? (double)medium.extinction * (to - from) * (data ? fabs(dir[0]) : 1) : 0;
        double expected = 1 - exp(-thick) * (passed ? 0.75 : 1);
        cut += left && (from > enter + 1 || to < leave - 1), crossed += passed, nothing += !left && leave > enter + 1;
        CHECK(fabs((double)c[0][3] - expected) < (way == 0 ? 1e-5 : 2e-6), "case %d, way %d: opacity %g, not %g", n, way,
              (double)c[0][3], expected);
        if (!left) CHECK(depth > 1e30f, "case %d: depth %g of nothing", n, (double)depth);
        else if (thick > 1e-3) CHECK(fabs((double)depth - from) < 1e-3, "case %d, way %d: from %g, not %g", n, way, (double)depth, from);
    }
    CHECK(cut > 300 && crossed > 60 && nothing > 20, "%d rays cut, %d cross the surface, %d see nothing", cut, crossed, nothing);
    field_free(&f);
}

/* A ray along a plane is on one side of it all the way: it sees what it would see without the plane, or nothing, of matter and isosurfaces
   alike, also in the blocks that the plane cuts through. */
TEST(rays_along_planes_are_kept_or_cut_as_a_whole) {
    static const double normals[4][3] = {{0, 1, 0}, {0, 0, -2}, {0, 3, 4}, {0, 1, -0.5}};
    field f = field_of(along_x, 49);
    const isogi_transfer_point medium = {0, {1, 0.5f, 0.2f}, 0.02f};
    const isogi_peak peak = {25, {1, 1, 1}, 0.25f};
    const double eye[3] = {-30, 20.25, 21.5}, target[3] = {60, 20.25, 21.5};
    for (int n = 0; n < 6 * 2 * 4 * 2; n++) {
        const int way = n % 6, data = way > 2, peaks = n / 6 % 2, kept = n / 48;
        const double *normal = normals[n / 12 % 4];
        const isogi_transfer transfer = {&medium, 1, &peak, (size_t)peaks};
        const isogi_context context = {.threads = 1, .force_path = n % 5};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)data, .opaque = 1, .bound = way == 2 ? 0.1 : 0,
                                     .classification = (isogi_dvr_classification)(way == 1 ? 2 : way > 2 ? way - 3 : 0), .step = 0.2};
        const double off = (kept ? 0.3 : -0.3) - normal[1] * eye[1] - normal[2] * eye[2];
        const double plane[1][4] = {{normal[0], normal[1], normal[2], off}};
        const double expected = kept ? 1 - exp(-48 * (double)medium.extinction) * (peaks ? 0.75 : 1) : 0;
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        float c[4];
        CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK, "clip");
        colour_of(dvr, eye, target, NULL, c, NULL);
        CHECK(fabs((double)c[3] - expected) < 1e-5, "way %d, peaks %d, plane %d: opacity %g, not %g", way, peaks, n / 12 % 4, (double)c[3],
              expected);
        const pixel seen = cast(dvr, eye, target, NULL);
        CHECK(kept ? fabs((double)seen.depth - 30) < 48 : seen.depth > 1e30f, "way %d, plane %d: depth %g", way, n / 12 % 4,
              (double)seen.depth);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* Rays along an axis beside the box meet nothing, however close they pass. */
TEST(rays_beside_the_box_meet_nothing) {
    field f = field_of(along_x, 49);
    const isogi_transfer_point medium = {0, {1, 0.5f, 0.2f}, 0.02f};
    const isogi_peak peak = {25, {1, 1, 1}, 0.25f};
    for (int n = 0; n < 6 * 2 * 6; n++) {
        const int way = n % 6, data = way > 2, peaks = n / 6 % 2, axis = n / 12 % 3, high = n / 36;
        const isogi_transfer transfer = {&medium, 1, &peak, (size_t)peaks};
        const isogi_context context = {.threads = 1, .force_path = n % 5};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)data, .bound = way == 2 ? 0.1 : 0,
                                     .classification = (isogi_dvr_classification)(way == 1 ? 2 : way > 2 ? way - 3 : 0)};
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        double eye[3] = {20.25, 21.5, 24}, target[3] = {20.25, 21.5, 24};
        float c[4];
        eye[axis] = -30, target[axis] = 60, eye[(axis + 1) % 3] = target[(axis + 1) % 3] = high ? 48.25 : -0.25;
        colour_of(dvr, eye, target, NULL, c, NULL);
        const pixel p = cast(dvr, eye, target, NULL);
        CHECK(!(c[3] > 0) && !(p.c[3] > 0) && p.depth > 1e30f, "way %d, peaks %d, axis %d: opacity %g", way, peaks, axis, (double)p.c[3]);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* A tent among many points of the function that all lie within the values of one block: it is seen whichever of them it is. */
TEST(extinction_at_any_point_of_the_function_is_seen) {
    field f = field_of(along_x, 49);
    const double eye[3] = {-30, 20.3, 20.6}, target[3] = {60, 20.3, 20.6};
    for (int points = 4; points < 14; points += 3)
        for (int tent = 1; tent < points - 1; tent++)
            for (int way = 0; way < 2; way++) {
                isogi_transfer_point p[20];
                const isogi_transfer transfer = {p, (size_t)points, NULL, 0};
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .step = way ? 0.02 : 0,
                                             .classification = way ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
                for (int i = 0; i < points; i++) p[i] = (isogi_transfer_point){0.5 + 3.0 * i / (points - 1), {1, 1, 1}, i == tent ? 1 : 0};
                isogi_dvr *dvr = dvr_new(&desc, &transfer);
                float c[4];
                colour_of(dvr, eye, target, NULL, c, NULL);
                CHECK(fabs(-log1p(-(double)c[3]) - 3.0 / (points - 1)) < 0.01, "point %d of %d, way %d: depth %g, not %g", tent, points,
                      way, -log1p(-(double)c[3]), 3.0 / (points - 1));
                isogi_dvr_free(dvr);
            }
    field_free(&f);
}

/* Voxels whose rows and planes go backwards in memory look as the same voxels in order. */
TEST(volumes_that_lie_backwards_look_the_same) {
    enum { N = 21, COUNT = N * N * N };
    static uint8_t bytes[3][COUNT];
    static uint16_t shorts[3][COUNT];
    static float floats[3][COUNT];
    field f = field_waves(N, 5);
    test_random r = {12};
    for (int i = 0; i < COUNT; i++) {
        const int y = N * (N - 1 - i / N % N), z = N * N * (N - 1 - i / N / N), v = (int)(100 + 60 * f.value[i]);
        const int to[3] = {i, i % N + y + i / N / N * N * N, i % N + y + z};
        for (int k = 0; k < 3; k++) {
            bytes[k][to[k]] = (uint8_t)(v < 0 ? 0 : v < 255 ? v : 255);
            shorts[k][to[k]] = bytes[k][to[k]], floats[k][to[k]] = bytes[k][to[k]];
        }
    }
    const isogi_transfer_point p[] = {{60, {1, 0, 0}, 0}, {100, {0, 1, 0}, 0.3f}, {120, {0, 0, 1}, 0}, {200, {1, 1, 1}, 0.2f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    for (int n = 0; n < 3 * 2 * 4; n++) {
        const int type = n % 3, data = n / 3 % 2, path = n / 6 + 1;
        const isogi_context context = {.threads = 1, .force_path = path};
        const isogi_view view = view_of(&f, 1, &r, 24);
        float(*image[3])[4];
        for (int back = 0; back < 3; back++) { /* as it is, rows backwards, planes too */
            isogi_volume v = {.type = (const isogi_type[]){ISOGI_U8, ISOGI_U16, ISOGI_F32}[type], .size = {N, N, N}};
            const ptrdiff_t size = (const ptrdiff_t[]){1, 2, 4}[type];
            const char *at = type == 0 ? (const char *)bytes[back] : type == 1 ? (const char *)shorts[back] : (const char *)floats[back];
            isogi_pyramid *pyramid = NULL;
            v.data = at + (back == 0 ? 0 : back == 1 ? size * N * (N - 1) : size * (COUNT - N));
            v.stride[0] = size, v.stride[1] = back ? -size * N : size * N, v.stride[2] = back == 2 ? -size * N * N : size * N * N;
            CHECK(isogi_vol_build(&pyramid, &v, &context) == ISOGI_OK, "build");
            const isogi_dvr_desc desc = {.pyramid = pyramid, .space = (isogi_dvr_space)data};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            image[back] = picture(dvr, &view, NULL, NULL, NULL);
            isogi_dvr_free(dvr), isogi_vol_free(pyramid);
        }
        for (int back = 1; back < 3; back++)
            CHECK(largest_difference(image[0], image[back], 24 * 24) < 2e-5, "type %d, space %d, path %d, %d backwards: %g", type, data,
                  path, back, largest_difference(image[0], image[back], 24 * 24));
        for (int back = 0; back < 3; back++) free(image[back]);
    }
    field_free(&f);
}

/* ---- what lies at the end of something ---- */

static double two_steps(double x, double y, double z) { return (void)y, (void)z, 48 * x < 20.5 ? 1 : 2; }
static double plateau(double x, double y, double z) { return (void)y, (void)z, fmin(2 * x, 1); }

/* Where all values of a block are classified alike, whole pieces of a ray within it are passed at once: the one that leaves it is
   sampled in its middle like all others, whatever lies there. */
TEST(pieces_that_leave_a_steady_block_are_sampled) {
    field f = field_of(two_steps, 49);
    const isogi_transfer_point points[] = {{1, {1, 1, 1}, 0.002f}, {2, {1, 1, 1}, 0.1f}};
    const isogi_transfer transfer = {points, 2, NULL, 0};
    const double ends[2][3] = {{-30, 20.3, 20.6}, {90, 20.3, 20.6}};
    for (int back = 0; back < 2; back++)
        for (double step = 0.7; step < 4; step += 0.26) {
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .opaque = 1, .classification = ISOGI_DVR_POST_CLASSIFIED, .step = step};
            isogi_dvr *dvr = dvr_new(&desc, &transfer);
            double depth = 0;
            float c[4];
            for (double from = 0; from < 48; from += step) {
                const double to = fmin(from + step, 48), x = back ? 48 - 0.5 * (from + to) : 0.5 * (from + to);
                depth += (to - from) * (0.002 + 0.098 * fmin(fmax(x - 20, 0), 1));
            }
            colour_of(dvr, ends[back], ends[!back], NULL, c, NULL);
            CHECK(fabs(-log1p(-(double)c[3]) - depth) < 1e-4, "step %g, way %d: depth %g, not %g", step, back,
                  -log1p(-(double)c[3]), depth);
            isogi_dvr_free(dvr);
        }
    field_free(&f);
}

/* A peak at the largest value of all is met where values reach it, once. */
TEST(a_peak_at_the_largest_value_is_seen) {
    field f = field_of(plateau, 33);
    const double eye[3] = {-30, 20.3, 20.6}, target[3] = {50, 20.3, 20.6};
    for (int way = 0; way < 5; way++) {
        const isogi_peak peak = {1, {1, 1, 1}, 0.25f};
        const isogi_transfer transfer = {NULL, 0, &peak, 1};
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)(way > 2), .bound = way == 2 ? 0.1 : 0,
                                     .classification = way % 2 ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        const pixel p = cast(dvr, eye, target, NULL);
        CHECK(fabs((double)p.c[3] - 0.25) < 1e-6 && fabs((double)p.depth - 46) < 1e-4, "way %d: opacity %g, %g off", way, (double)p.c[3],
              (double)p.depth);
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

static double floor_and_air(double x, double y, double z) { return (void)x, (void)y, z; }

/* The least of light holds for all of it: in the shadow of a floor from a sky that shines from below, whose series is far below zero, a
   lamp that does not make up for that adds nothing. Pictures by tables of light, and by samples. */
TEST(the_least_light_counts_lamps_too) {
    field f = field_of(floor_and_air, 33);
    const isogi_transfer_point points[] = {{0, {1, 1, 1}, 50}, {0.1, {1, 1, 1}, 50}, {0.2, {1, 1, 1}, 1e-4f}};
    const isogi_transfer transfer = {points, 3, NULL, 0};
    const double eye[3] = {-30, 16, 22}, target[3] = {60, 16, 22};
    const float sh[12] = {3.5449077f, 3.5449077f, 3.5449077f, 0, 0, 0, -122.8f, -122.8f, -122.8f}; /* 1 - 60 cos */
    const isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {16, 16, 60}, .rgb = {20000, 20000, 20000}};
    for (int path = 0; path < 5; path++) {
        float c[2][4];
        for (int lit = 0; lit < 2; lit++) {
            const isogi_lighting lighting = {.env = {.sh = sh, .sh_order = 2}, .lights = &lamp, .light_count = (size_t)lit};
            const isogi_context context = {.threads = 1, .force_path = path};
            const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .grid = {5, 5, 5},
                                         .classification = path == 4 ? ISOGI_DVR_POST_CLASSIFIED : ISOGI_DVR_EXACT};
            isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            colour_of(dvr, eye, target, &lighting, c[lit], NULL);
            isogi_dvr_free(dvr);
        }
        CHECK(c[0][0] > 0.05f * c[0][3] && c[0][0] < 0.25f * c[0][3], "path %d: the least is %g", path, (double)(c[0][0] / c[0][3]));
        CHECK(fabsf(c[1][0] / c[0][0] - 1) < 1e-3f, "path %d: light %g, with a lamp %g", path, (double)(c[0][0] / c[0][3]),
              (double)(c[1][0] / c[1][3]));
    }
    field_free(&f);
}

/* ---- geometry among matter ---- */

/* A wall across the view, given by how far off it is in every pixel, ends rays where a clip plane does; infinitely far walls are none. */
TEST(geometry_ends_rays_where_it_stands) {
    enum { SIDE = 17, PIXELS = SIDE * SIDE };
    static const struct { isogi_dvr_space space; isogi_dvr_classification way; isogi_dvr_shading shading; int peaks, local; double bound; }
        kinds[] = {{0, 0, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0}, {0, 2, 2, 1, 0, 0}, {0, 0, 3, 1, 0, 0}, {0, 0, 1, 1, 0, 0.1}, {0, 0, 1, 0, 1, 0},
                   {1, 0, 0, 0, 0, 0}, {1, 0, 1, 1, 0, 0}, {1, 1, 0, 1, 0, 0}, {1, 2, 3, 1, 0, 0}};
    static const isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {40, 20, 60}, .rgb = {3000, 2500, 2000}};
    const isogi_lighting lighting = {.env = {.sh = sky_one, .sh_order = 1}, .lights = &lamp, .light_count = 1};
    field f = field_waves(33, 8);
    test_random r = {77};
    static float values[33 * 33 * 33]; /* which vectors read */
    isogi_volume volume = {.data = values, .type = ISOGI_F32, .size = {33, 33, 33}};
    isogi_pyramid *floats;
    for (size_t i = 0; i < field_count(&f); i++) values[i] = (float)f.value[i];
    CHECK(isogi_vol_build(&floats, &volume, &serial) == ISOGI_OK, "build");
    for (size_t n = 0; n < 3 * sizeof kinds / sizeof *kinds; n++) {
        const size_t k = n % (sizeof kinds / sizeof *kinds);
        const isogi_transfer transfer = {hills, 6, sheets, kinds[k].peaks ? 2 : 0};
        const isogi_context context = {.threads = 1, .force_path = n < sizeof kinds / sizeof *kinds ? 0 : (int)(random_bits(&r) % 5)};
        const isogi_dvr_desc desc = {.pyramid = n % 3 ? floats : f.pyramid, .space = kinds[k].space, .classification = kinds[k].way,
                                     .unit = 20, .shading = kinds[k].shading, .bound = kinds[k].bound, .order = 2, .directions = 8,
                                     .grid = {5, 5, 5}, .step = 0.5, .method = kinds[k].local ? ISOGI_DVR_PAPER : ISOGI_DVR_METHOD_DEFAULT};
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        isogi_view view = view_of(&f, 1, &r, SIDE);
        float until[PIXELS], depth[2][PIXELS], (*whole)[4], (*cut)[4], (*clipped)[4];
        double plane[4], into = 0, origin[3];
        int shorter = 0, ended = 0;
        /* samples stand in the middle of pieces, of the last one elsewhere where it is shorter */
        const float slack = kinds[k].bound > 0 || (kinds[k].space && !kinds[k].way) ? 1e-5f : 0.03f;
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        view.depth = n % 2 ? ISOGI_DEPTH_FIRST : ISOGI_DEPTH_HALF, view.local = kinds[k].local;
        whole = picture(dvr, &view, &lighting, depth[0], NULL), view.until = until;
        for (int i = 0; i < PIXELS; i++) until[i] = i % 2 ? HUGE_VALF : 3e38f;
        cut = picture(dvr, &view, &lighting, depth[1], NULL);
        CHECK(!memcmp(whole, cut, sizeof *whole * PIXELS) && !memcmp(depth[0], depth[1], sizeof depth[0]), "kind %zu: far walls are seen",
              k);
        free(cut);
        /* through the middle, aslant, its kept side towards the eye */
        for (int a = 0; a < 3; a++) plane[a] = view.eye[a] - view.target[a] + (float)random_range(&r, -40, 40);
        plane[3] = 0;
        for (int a = 0; a < 3; a++)
            into += plane[a] * (double)(view.eye[a] - view.target[a]), plane[3] -= plane[a] * (double)view.target[a];
        for (int a = 0; a < 4; a++) plane[a] *= into < 0 ? -1 : 1;
        for (int i = 0; i < PIXELS; i++) {
            double rate = 0, at = plane[3];
            float dir[3];
            isogi_view_ray(&view, i % SIDE, i / SIDE, origin, dir);
            for (int a = 0; a < 3; a++) rate += plane[a] * (double)dir[a], at += plane[a] * origin[a];
            until[i] = rate < 0 ? (float)(-at / rate) : HUGE_VALF;
        }
        cut = picture(dvr, &view, &lighting, depth[0], NULL), view.until = NULL;
        /* not stepped: visibility is the same as before */
        if (!view.local) {
            CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])plane, 1) == ISOGI_OK, "clip");
            clipped = picture(dvr, &view, &lighting, depth[1], NULL);
            for (int i = 0; i < PIXELS; i++)
                for (int a = 0; a < 4; a++)
                    CHECK(fabs((double)cut[i][a] - (double)clipped[i][a]) < 1e-4, "kind %zu: pixel %d, channel %d: %g, clipped %g", k, i, a,
                          (double)cut[i][a], (double)clipped[i][a]);
            free(clipped);
        }
        for (int i = 0; i < PIXELS; i++) {
            shorter += cut[i][3] < whole[i][3] - 0.01f, ended += cut[i][3] > 0.01f && until[i] < 1e30f;
            CHECK(cut[i][3] <= whole[i][3] + slack, "kind %zu: pixel %d is more opaque before a wall: %g, %g", k, i, (double)cut[i][3],
                  (double)whole[i][3]);
            CHECK(!(depth[0][i] < 1e30f) || depth[0][i] <= until[i] * 1.000001f, "kind %zu: pixel %d is seen %g off, behind %g", k, i,
                  (double)depth[0][i], (double)until[i]);
        }
        CHECK(shorter > PIXELS / 8 && ended > PIXELS / 8, "kind %zu: %d pixels show less, %d something", k, shorter, ended);
        free(whole), free(cut), view.until = until;
        for (int i = 0; i < PIXELS; i++) until[i] = i % 3 ? (i % 3 > 1 ? -HUGE_VALF : -1) : 0;
        cut = picture(dvr, &view, &lighting, depth[0], NULL);
        for (int i = 0; i < PIXELS; i++) CHECK(!(cut[i][3] > 0) && depth[0][i] > 1e30f, "pixel %d shows what is behind a wall", i);
        until[PIXELS - 1] = NAN, memcpy(depth[1], depth[0], sizeof depth[0]);
        CHECK(isogi_dvr_render(dvr, &view, &lighting, cut, depth[0], NULL) == ISOGI_INVALID && !memcmp(depth[1], depth[0], sizeof depth[0]),
              "a wall nowhere");
        free(cut), isogi_dvr_free(dvr);
    }
    isogi_vol_free(floats), field_free(&f);
}

/* The last piece of a ray is integrated up to where it ends, whatever the values beyond: extinction that grows by the value, in the field
   x, ends at a wall or at a clip plane after any part of a step. */
TEST(rays_end_within_a_step) {
    enum { N = 49 };
    static float data[N * N * N];
    const isogi_transfer_point rising[] = {{0, {1, 0.5f, 0.2f}, 0}, {48, {1, 0.5f, 0.2f}, 0.05f}};
    const isogi_transfer transfer = {rising, 2, NULL, 0};
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_pyramid *pyramid;
    test_random r = {41};
    double worst = 0;
    for (int i = 0; i < N * N * N; i++) data[i] = (float)(i % N);
    CHECK(isogi_vol_build(&pyramid, &volume, &serial) == ISOGI_OK, "build");
    for (int n = 0; n < (LONG_SUITE ? 20000 : 600); n++) {
        const isogi_context context = {.threads = 1, .force_path = n % 5};
        const isogi_dvr_desc desc = {.pyramid = pyramid, .opaque = 1, .step = n / 5 % 2 ? 4 : 1, .tolerance = n / 10 % 2 ? 1e-3 : 0};
        double eye[3], target[3], origin[3], plane[1][4] = {{0}};
        float dir[3], until[32], c[32][4], depth[32];
        for (int a = 0; a < 3; a++) target[a] = random_range(&r, 20, 28), eye[a] = target[a] + random_range(&r, -90, 90);
        isogi_view view = line_of_sight(eye, target);
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        view.width = 8, view.height = 4, view.depth = ISOGI_DEPTH_FIRST;
        isogi_view_ray(&view, 0, 0, origin, dir);
        double distance = 0;
        for (int a = 0; a < 3; a++) distance += pow(target[a] - origin[a], 2);
        distance = sqrt(distance) + random_range(&r, -8, 8);
        for (int i = 0; i < 32; i++) until[i] = (float)distance;
        if (n / 20 % 2) { /* across the line of sight: as far off in its middle */
            for (int a = 0; a < 3; a++)
                plane[0][a] = -(double)dir[a], plane[0][3] += (double)dir[a] * (origin[a] + distance * (double)dir[a]);
            CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])plane, 1) == ISOGI_OK, "clip");
        } else view.until = until;
        CHECK(isogi_dvr_render(dvr, &view, NULL, c, depth, NULL) == ISOGI_OK, "render");
        isogi_dvr_free(dvr);
        for (int i = 0; i < 32; i++) {
            double from = 0, to = 1e9, rate = 0, at = plane[0][3];
            isogi_view_ray(&view, i % 8, i / 8, origin, dir);
            for (int a = 0; a < 3; a++) {
                double low = -origin[a] / (double)dir[a], high = (N - 1 - origin[a]) / (double)dir[a];
                from = fmax(from, fmin(low, high)), to = fmin(to, fmax(low, high));
                rate += plane[0][a] * (double)dir[a], at += plane[0][a] * origin[a];
            }
            to = fmin(to, view.until ? distance : -at / rate);
            double middle = origin[0] + 0.5 * (from + to) * (double)dir[0];
            double expected = to > from ? 1 - exp(-0.05 / 48 * middle * (to - from)) : 0;
            worst = fmax(worst, fabs((double)c[i][3] - expected));
            /* a ray of nearly one value sees the middle of its class, of 1024 */
            CHECK(fabs((double)c[i][3] - expected) < 4e-4, "case %d, ray %d: opacity %g, not %g", n, i, (double)c[i][3], expected);
        }
    }
    printf("    largest error of opacity %.2g\n", worst);
    isogi_vol_free(pyramid);
}

/* ---- jitter ---- */

TEST(jitter_is_off_by_default_repeats_itself_and_is_right_on_average) {
    field f = field_waves(24, 6);
    const isogi_transfer_point p[] = {
        {-1, {1, 0.2f, 0.1f}, 0}, {0.2, {0.3f, 1, 0.1f}, 0.3f}, {0.3, {0.3f, 1, 0.1f}, 0}, {1, {0, 0, 1}, 0.2f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    const isogi_context two = {.threads = 2};
    test_random r = {7};
    isogi_view view = view_of(&f, 1, &r, 24);
    for (int space = 0; space < 2; space++) {
        isogi_dvr_desc desc = {
            .pyramid = f.pyramid, .space = (isogi_dvr_space)space, .classification = ISOGI_DVR_POST_CLASSIFIED, .step = 0.02, .opaque = 1};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float(*fine)[4] = picture(dvr, &view, NULL, NULL, NULL), (*plain)[4], mean[576][4] = {{0}};
        isogi_dvr_free(dvr);
        desc.step = 2;
        dvr = dvr_new(&desc, &transfer), plain = picture(dvr, &view, NULL, NULL, NULL), isogi_dvr_free(dvr);
        const uint32_t seeds = LONG_SUITE ? 64 : 16;
        for (uint32_t seed = 1; seed <= seeds; seed++) {
            desc.jitter = seed;
            dvr = dvr_new(&desc, &transfer);
            float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL), (*again)[4];
            isogi_dvr_free(dvr);
            CHECK(isogi_dvr_create(&dvr, &desc, &two) == ISOGI_OK && isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "create");
            again = picture(dvr, &view, NULL, NULL, NULL), isogi_dvr_free(dvr);
            CHECK(!memcmp(image, again, 576 * sizeof *image), "seed %u: the same bits with two threads", (unsigned)seed);
            CHECK(memcmp(image, plain, 576 * sizeof *image), "seed %u: not those without jitter", (unsigned)seed);
            for (int i = 0; i < 2304; i++) mean[i / 4][i % 4] += image[i / 4][i % 4] / (float)seeds;
            free(image), free(again);
        }
        /* of many shifts the mean is that of steps as many times as fine, but for chance and what products of opacities lose */
        double error[2] = {rms_difference(plain, fine, 576), rms_difference(mean, fine, 576)};
        CHECK(error[1] < (LONG_SUITE ? 0.35 : 0.5) * error[0] && error[0] > 0.002, "space %d: RMSE %g of the mean, %g without jitter",
              space, error[1], error[0]);
        free(fine), free(plain);
    }
    field_free(&f);
}

/* All pixels look along the same ray, at shells thinner than a step: shifts that are independent of each other make differences between
   neighbours twice as large, squared, as between a pixel and their mean. */
TEST(jitter_is_a_pixels_own) {
    enum { SIDE = 32 };
    field f = field_of(along_x, 49);
    const isogi_transfer_point p[] = {{10, {1, 1, 1}, 0}, {11, {1, 1, 1}, 0.2f}, {12, {1, 1, 1}, 0},
                                      {30, {1, 1, 1}, 0}, {33, {1, 1, 1}, 0.1f}};
    const isogi_transfer transfer = {p, 5, NULL, 0};
    const isogi_view view = {.width = SIDE, .height = SIDE, .eye = {-30, 20, 21}, .target = {50, 20, 21}, .fov = 0.001f};
    for (uint32_t seed = 0; seed < 8; seed++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .classification = ISOGI_DVR_POST_CLASSIFIED, .step = 5, .opaque = 1,
                                     .jitter = seed};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        float(*image)[4] = picture(dvr, &view, NULL, NULL, NULL);
        double mean = 0, square = 0, across = 0, down = 0;
        for (int i = 0; i < SIDE * SIDE; i++) mean += (double)image[i][3] / (SIDE * SIDE);
        for (int i = 0; i < SIDE * SIDE; i++) {
            square += pow((double)image[i][3] - mean, 2) / (SIDE * SIDE);
            if (i % SIDE) across += pow((double)image[i][3] - (double)image[i - 1][3], 2) / (SIDE * (SIDE - 1));
            if (i >= SIDE) down += pow((double)image[i][3] - (double)image[i - SIDE][3], 2) / (SIDE * (SIDE - 1));
        }
        if (!seed) CHECK(square < 1e-10, "without jitter pixels differ by %g", sqrt(square));
        else /* 1024 pixels: a standard deviation of 0.06 to 0.1 */
            CHECK(square > 1e-3 && fabs(across / square - 2) < 0.4 && fabs(down / square - 2) < 0.4,
                  "seed %u: pixels differ by %g from their mean, squared %g and %g times that from those beside and below", (unsigned)seed,
                  sqrt(square), across / square, down / square);
        free(image), isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST(jitter_changes_no_homogeneous_medium_and_no_exact_ray) {
    field f = field_of(even, 20), waves = field_waves(12, 3);
    const isogi_transfer_point point = {0, {0.2f, 0.5f, 1}, 0.1f};
    const isogi_transfer transfer = {&point, 1, NULL, 0};
    const double eye[3] = {-30, 3, 5}, target[3] = {50, 12, 9}, length = 19 * sqrt(80 * 80 + 9 * 9 + 4 * 4) / 80;
    for (uint32_t seed = 1; seed < 50; seed++) {
        isogi_dvr_desc desc = {.pyramid = f.pyramid, .jitter = seed, .step = 0.1 * seed, .shading = seed % 2 ? ISOGI_DVR_UNLIT
            : ISOGI_DVR_VISIBILITY, .grid = {2, 2, 2}};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        pixel c = cast(dvr, eye, target, &sky);
        CHECK(fabs((double)c.c[3] - -expm1(-0.1 * length)) < 1e-6, "seed %u: %g, not %g", (unsigned)seed, (double)c.c[3],
              -expm1(-0.1 * length));
        isogi_dvr_free(dvr);
        const isogi_dvr_desc exact = {.pyramid = waves.pyramid, .space = ISOGI_DVR_DATA, .jitter = seed},
                             without = {.pyramid = waves.pyramid, .space = ISOGI_DVR_DATA};
        isogi_dvr *a = dvr_new(&exact, &transfer), *b = dvr_new(&without, &transfer);
        pixel x = cast(a, eye, target, NULL), y = cast(b, eye, target, NULL);
        CHECK(!memcmp(x.c, y.c, sizeof x.c), "exact rays have no samples to move: %g, %g", (double)x.c[3], (double)y.c[3]);
        isogi_dvr_free(a), isogi_dvr_free(b);
    }
    field_free(&f), field_free(&waves);
}

/* ---- blocks of one classification ---- */

static double waves_and_steps(double x, double y, double z) { return x < 0.3 ? 1 : x > 0.7 ? 5 : 2 + sin(9 * y) * cos(7 * z); }

TEST(blocks_of_one_classification_take_one_sample) {
    field f = field_of(even, 65), g = field_of(waves_and_steps, 65), broken = field_of(even, 65);
    const isogi_transfer_point point = {0, {0.2f, 0.5f, 1}, 0.01f},
                               p[] = {{1.5, {1, 0, 0}, 0.01f}, {1.6, {0, 1, 0}, 0.05f}, {4, {0, 0, 1}, 0.02f}};
    const isogi_transfer one = {&point, 1, NULL, 0}, three = {p, 3, NULL, 0};
    const double eye[3] = {-30, 3, 5}, target[3] = {90, 42, 30}, length = 64 * sqrt(120 * 120 + 39 * 39 + 25 * 25) / 120;
    isogi_dvr_desc desc = {.pyramid = f.pyramid, .classification = ISOGI_DVR_POST_CLASSIFIED, .step = 0.5};
    isogi_dvr *dvr = dvr_new(&desc, &one);
    isogi_counters count = {0};
    float c[4];
    colour_of(dvr, eye, target, NULL, c, &count);
    CHECK(fabs((double)c[3] - -expm1(-0.01 * length)) < 1e-6 && count.samples <= 2, "opacity %g, not %g; %d samples of 139", (double)c[3],
          -expm1(-0.01 * length), (int)count.samples);
    isogi_dvr_free(dvr);
    /* a voxel that is not finite: nothing is passed unseen */
    *(broken.value + 32 + 65 * (20 + 65 * 20)) = (double)NAN, isogi_vol_free(broken.pyramid), field_build(&broken);
    desc.pyramid = broken.pyramid, dvr = dvr_new(&desc, &one), memset(&count, 0, sizeof count);
    colour_of(dvr, eye, target, NULL, c, &count);
    CHECK(count.samples > 100, "%d samples", (int)count.samples);
    isogi_dvr_free(dvr);
    /* a mixed field: the same picture with fewer samples, depth and all; and where there is light every sample is looked at */
    isogi_view view = {.width = 20, .height = 20, .eye = {150, 90, 110}, .target = {32, 32, 32}, .fov = 30};
    uint64_t samples[2];
    float(*image[2])[4], depth[2][400];
    for (int lit = 0; lit < 2; lit++) {
        desc.pyramid = g.pyramid, desc.shading = lit ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT,
        desc.grid[0] = desc.grid[1] = desc.grid[2] = 2;
        dvr = dvr_new(&desc, &three), memset(&count, 0, sizeof count);
        image[lit] = picture(dvr, &view, &sky, depth[lit], &count), samples[lit] = count.samples;
        isogi_dvr_free(dvr);
    }
    CHECK(samples[0] < 0.85 * (double)samples[1], "%d samples, %d with light", (int)samples[0], (int)samples[1]);
    CHECK(largest_difference(image[0], image[1], 400) < 2e-5, "the pictures differ by %g", largest_difference(image[0], image[1], 400));
    for (int i = 0; i < 400; i++)
        CHECK(fabsf(depth[0][i] - depth[1][i]) < 1e-3f || depth[0][i] > 1e30f, "pixel %d: depth %g, %g", i, (double)depth[0][i],
              (double)depth[1][i]);
    free(image[0]), free(image[1]);
    field_free(&f), field_free(&g), field_free(&broken);
}

TEST_MAIN("dvr_medium")
