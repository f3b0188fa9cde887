/* The viewer as its users meet it: pictures that stay the same, and one clear line for everything that is wrong.

   The program is run as a process: build/viewer, or what ISOGI_VIEWER names. Files are made in a folder of their own below /tmp.
   ISOGI_GOLDEN=write makes the pictures in tests/golden anew instead of comparing with them: look at them before committing.
   FLAGS: -O0 */
#define ISOGI_VOL_IMPLEMENTATION
#include "isogi_vol.h"
#include "test.h"

#include "camera.h"
#include "files.h"
#include "hdr.h"
#include "isogi_dvr.h"
#include "picture.h"
#include "png.h"
#include "procedural.h"
#include "programs.h"
#include "raster.h"
#include "transfer_file.h"
#include "volume_file.h"

/* ---- running the program --------------------------------------------------------------------------------------------------------- */

static const char *viewer_path(void) {
    const char *viewer = getenv("ISOGI_VIEWER");
    return viewer && *viewer ? viewer : "build/viewer";
}
static run_result run_viewer(const char *arguments) { return run_program(viewer_path(), arguments); }
static void check_refused(const char *arguments, const char *must_say) { check_refusal(viewer_path(), arguments, 1, must_say); }

/* ---- pictures ------------------------------------------------------------------------------------------------------------------------ */

static unsigned char *read_picture(const char *path, int shape[3]) {
    unsigned char *data = NULL, *pixels = NULL;
    size_t size = 0;
    char error[FILE_ERROR_SIZE] = "";
    if (file_read(path, 1 << 26, &data, &size, error)) {
        if (!png_decode(data, size, &pixels, shape, error)) pixels = NULL;
        free(data);
    }
    CHECK(pixels, "%s: %s", path, error);
    return pixels;
}

/* Root of the mean squared difference of sRGB values 0..255, and the share of pixels that differ by more than 32 in any channel. */
static double picture_difference(const unsigned char *a, const unsigned char *b, int width, int height, double *outliers) {
    double sum = 0;
    size_t bad = 0, pixels = (size_t)width * (size_t)height;
    for (size_t i = 0; i < pixels; i++) {
        int worst = 0;
        for (size_t c = 0; c < 3; c++) {
            int d = a[3 * i + c] - b[3 * i + c];
            sum += d * d;
            worst = abs(d) > worst ? abs(d) : worst;
        }
        bad += worst > 32;
    }
    *outliers = (double)bad / (double)pixels;
    return sqrt(sum / (3 * (double)pixels));
}

/* Tolerance: the pictures are the same bits on one machine and instruction path. Another path, compiler or C library changes the last
   bits of light and of geometry: a few edge pixels flip, the Monte Carlo noise of a few texels changes. gcc and clang, -O1 to -O3,
   -march=native, -ffast-math differ by at most 0.03 of 255 root mean square; 0.5, and 0.5 % of pixels off by more than 32, leave
   room for more exotic machines, and a tenth more of red light already exceeds it. */
static void check_golden(const char *name, const char *arguments) {
    char path[256], command[1024];
    int shape[3] = {0, 0, 0}, golden_shape[3] = {0, 0, 0};
    const char *mode = getenv("ISOGI_GOLDEN");
    char out[256];
    unsigned char *picture, *golden;
    run_result r;
    int writing = mode && !strcmp(mode, "write");
    strcpy(out, temporary("golden.png"));
    snprintf(path, sizeof path, "tests/golden/%s.png", name);
    snprintf(command, sizeof command, "%s --size 96x72 --out '%s'", arguments, writing ? path : out);
    r = run_viewer(command);
    CHECK(r.status == 0, "%s: ended with %d: %s", arguments, r.status, r.error);
    if (writing || r.status) return;
    picture = read_picture(out, shape), golden = read_picture(path, golden_shape);
    if (picture && golden) {
        double outliers, difference;
        CHECK(shape[0] == 96 && shape[1] == 72 && shape[2] == 3 && !memcmp(shape, golden_shape, sizeof shape), "%s: %dx%dx%d", name,
              shape[0], shape[1], shape[2]);
        difference = picture_difference(picture, golden, 96, 72, &outliers);
        CHECK(difference < 0.5, "%s: differs by %.3f of 255 (root mean square)", name, difference);
        CHECK(outliers < 0.005, "%s: %.2f %% of the pixels differ by more than 32", name, 100 * outliers);
    }
    free(picture), free(golden);
}

TEST(picture_of_the_mesh_by_lambert_stays_the_same) { check_golden("lambert", "procedural:engine-block:96 --mode lambert"); }
TEST(picture_of_exact_rays_by_phong_stays_the_same) { check_golden("phong", "procedural:torus-sphere-plane:64 --mode phong --raycast"); }
TEST(picture_of_vicinity_shading_stays_the_same) { check_golden("vicinity", "procedural:skull:64 --mode vicinity --samples 32"); }
TEST(picture_of_baked_light_stays_the_same) { check_golden("irradiance", "procedural:engine-block:80 --mode irradiance --samples 32"); }
TEST(picture_of_transferred_light_stays_the_same) {
    check_golden("transfer", "procedural:skull:64 --mode transfer --samples 32 --bounces 2");
}
TEST(picture_of_traced_paths_stays_the_same) { check_golden("pathtrace", "procedural:cavity:64 --mode pathtrace --samples 64 --aa 1"); }
TEST(picture_of_a_clipped_volume_stays_the_same) {
    check_golden("clip", "procedural:gyroid:64 --mode irradiance --samples 16 --clip 0,0,-1,40");
}
TEST(picture_of_volume_rendering_stays_the_same) { check_golden("dvr", "procedural:engine-block:64 --mode dvr"); }
TEST(picture_of_scale_invariant_rendering_stays_the_same) {
    check_golden("scale-invariant", "procedural:marschner-lobb:64 --mode scale-invariant");
}

/* A volume of which nothing is known: what its histogram suggests shows the ball and not the air around it, in both spaces. */
TEST(a_transfer_function_is_suggested_where_none_is_given) {
    static unsigned char ball[24][24][24];
    const char *modes[] = {"dvr", "scale-invariant"};
    char command[1024];
    for (int i = 0; i < 24 * 24 * 24; i++) {
        double d[3] = {i % 24 - 11.5, i / 24 % 24 - 11.5, i / 576 - 11.5}, r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        ball[i / 576][i / 24 % 24][i % 24] = (unsigned char)(r < 4 ? 220 : r < 8 ? 110 : 10 + i % 5);
    }
    const char *path = temporary("ball_24x24x24_uint8.raw");
    write_bytes(path, ball, sizeof ball);
    for (int m = 0; m < 2; m++) {
        const char *out = temporary("ball.png");
        int shape[3] = {0, 0, 0};
        snprintf(command, sizeof command, "'%s' --mode %s --size 48x48 --out '%s'", path, modes[m], out);
        run_result r = run_viewer(command);
        CHECK(r.status == 0, "%s: %s", modes[m], r.error);
        unsigned char *picture = read_picture(out, shape);
        if (!picture) continue;
        const unsigned char *middle = picture + 3 * (24 * 48 + 24), *corner = picture + 3 * (6 * 48 + 24);
        CHECK(middle[0] > corner[0] + 40, "%s: the ball %d, above it %d", modes[m], middle[0], corner[0]);
        free(picture);
    }
}

/* A speck in emptiness, the densest that is suggested, in both modes, by default and by a preset. And a lattice without a texel on the
   surface says why the picture is black. */
SLOW_TEST(a_speck_is_shown_and_a_coarse_lattice_named) {
    static unsigned char speck[40][40][40];
    const char *ways[] = {"dvr", "dvr --preset grey", "scale-invariant", "scale-invariant --preset grey"};
    char command[1024];
    run_result r;
    for (int i = 0; i < 27; i++) speck[19 + i / 9][19 + i / 3 % 3][19 + i % 3] = 200;
    const char *path = temporary("speck_40x40x40_uint8.raw");
    write_bytes(path, speck, sizeof speck);
    for (int m = 0; m < 4; m += 1 + QUICK_SUITE) {
        const char *out = temporary("speck.png");
        snprintf(command, sizeof command, "'%s' --mode %s --size 33x33 --out '%s'", path, ways[m], out);
        r = run_viewer(command);
        CHECK(r.status == 0 && !*r.error, "%s: %s", ways[m], r.error);
        int shape[3] = {0, 0, 0};
        unsigned char *picture = read_picture(out, shape);
        if (!picture) continue;
        const int middle = picture[3 * (16 * 33 + 16)], beside = picture[3 * (16 * 33 + 5)];
        CHECK(middle > beside + 60, "%s: the speck %d, beside it %d", ways[m], middle, beside);
        free(picture);
    }
    snprintf(command, sizeof command, "'%s' --lattice 2,2,2 --samples 1 --size 33x33 --out '%s'", path, temporary("speck.png"));
    r = run_viewer(command);
    CHECK(r.status == 0 && strstr(r.error, "the lattice is too coarse"), "%d: %s", r.status, r.error);
}

/* The bytes of the picture that a command makes, without its --out; how many. */
static size_t picture_bytes(const char *command, char *bytes, size_t room) {
    char whole[1024];
    snprintf(whole, sizeof whole, "%s --out '%s'", command, temporary("lattice.png"));
    run_result r = run_viewer(whole);
    CHECK(r.status == 0, "%s: %s", command, r.error);
    const size_t size = read_text(temporary("lattice.png"), bytes, room);
    CHECK(size > 100 && size < room - 1, "%s: %zu bytes", command, size);
    return size;
}

/* Texels are as close along every axis as along the one on which voxels are closest, up to four for a voxel; what is asked for counts. */
TEST(slices_far_apart_get_more_texels) {
    const char *with[] = {"1,1,2", "1,1,2 --lattice 20,20,39", "1,1,2 --lattice 20,20,20", "0.5,2,9", "0.5,2,9 --lattice 20,77,77"};
    static char picture[5][1 << 16];
    size_t size[5];
    for (int k = 0; k < 5; k++) {
        char command[256];
        snprintf(command, sizeof command, "procedural:gyroid:20 --spacing %s --samples 1 --size 40x40", with[k]);
        size[k] = picture_bytes(command, picture[k], sizeof picture[k]);
    }
#define SAME(a, b) (size[a] == size[b] && !memcmp(picture[a], picture[b], size[a]))
    CHECK(SAME(0, 1) && !SAME(0, 2), "two voxels apart");
    CHECK(SAME(3, 4), "four texels a voxel at most");
#undef SAME
}

/* Voxels that are more than five pixels wide have two texels. */
TEST(large_voxels_get_more_texels) {
    const char *with[] = {"150", "150 --lattice 24,24,24", "300", "300 --lattice 47,47,47", "300 --lattice 24,24,24"};
    static char picture[5][1 << 17];
    size_t size[5];
    for (int k = 0; k < 5; k++) {
        char command[256];
        snprintf(command, sizeof command, "procedural:gyroid:24 --samples 1 --size 60x%s", with[k]);
        size[k] = picture_bytes(command, picture[k], sizeof picture[k]);
    }
#define SAME(a, b) (size[a] == size[b] && !memcmp(picture[a], picture[b], size[a]))
    CHECK(SAME(0, 1), "small voxels");
    CHECK(SAME(2, 3) && !SAME(2, 4), "large voxels");
#undef SAME
}

/* From linear light to 8 bits as the comment of isogi_dvr.h states it: exposure, what is above 0.7 bent, sRGB. */
static double displayed(double linear, double exposure) {
    double x = linear * exposure;
    if (x > 0.7) x = 1 - 0.3 * exp((0.7 - x) / 0.3);
    return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055);
}

/* Opaque matter of one colour fills the picture; then pixels by themselves: half covered, over a backdrop, and what no picture should
   hold. */
TEST(light_is_displayed_as_the_header_states) {
    static unsigned char even[8][8][8];
    static const double colours[4][3] = {{0, 0.0005, 0.002}, {0.1, 0.3, 0.69}, {0.71, 0.9, 1}, {0.02, 0.5, 0.05}};
    const double exposures[] = {0.4, 1, 2.5}, backdrop[3] = {0.2, 0.05, 0.6};
    char path[256], function[256], out[256]; /* longer than the next 15 calls */
    strcpy(path, temporary("even_8x8x8_uint8.raw")), strcpy(function, temporary("even.tf")), strcpy(out, temporary("even.png"));
    memset(even, 9, sizeof even), write_bytes(path, even, sizeof even);
    for (int n = 0; n < 4 * 3; n++) {
        const double *colour = colours[n / 3], exposure = exposures[n % 3];
        char text[100], command[1024];
        int shape[3] = {0, 0, 0};
        snprintf(text, sizeof text, "0 1e6 %g %g %g\n", colour[0], colour[1], colour[2]), write_bytes(function, text, strlen(text));
        snprintf(command, sizeof command, "'%s' --mode dvr --shading unlit --tf '%s' --exposure %g --size 16x16 --out '%s'", path, function,
                 exposure, out);
        run_result r = run_viewer(command);
        unsigned char *picture = read_picture(out, shape);
        CHECK(r.status == 0 && picture, "%s", r.error);
        for (int a = 0; picture && a < 3; a++) {
            double got = picture[3 * (8 * 16 + 8) + a], expected = displayed(colour[a], exposure);
            CHECK(fabs(got - expected) < 1.01, "colour %g, exposure %g: %g, not %g", colour[a], exposure, got, expected); /* 0.999 opaque */
        }
        free(picture);
        const float half[4] = {(float)(0.5 * colour[0]), (float)(0.5 * colour[1]), (float)(0.5 * colour[2]), 0.5f};
        unsigned char coded[3];
        picture_pixel(half, exposure, backdrop, coded);
        for (int a = 0; a < 3; a++) {
            double x = exposure * colour[a], light = 0.5 * (x > 0.7 ? 1 - 0.3 * exp((0.7 - x) / 0.3) : x) + 0.5 * backdrop[a];
            double expected = displayed(light < 0.7 ? light : 0, 1); /* what is composited is not bent again */
            if (light < 0.7) CHECK(fabs(coded[a] - expected) < 0.51, "half of %g: %d, not %g", colour[a], coded[a], expected);
        }
    }
    const float odd[5][4] = {{-1, -0.1f, -1e30f, 1}, {NAN, NAN, NAN, 1}, {1e30f, 1e30f, 1e30f, 1}, {1, 1, 1, 0}, {1, 1, 1, NAN}};
    const int expected[5] = {0, 0, 255, 0, 0}; /* over black */
    for (int n = 0; n < 5; n++) {
        unsigned char coded[3];
        const double black[3] = {0, 0, 0};
        picture_pixel(odd[n], 1, black, coded);
        for (int a = 0; a < 3; a++) CHECK(coded[a] == expected[n], "case %d: %d, not %d", n, coded[a], expected[n]);
    }
}

/* The two ways to see the surface agree: mesh and exact rays differ by less than a voxel, so only edges may differ. */
TEST(mesh_and_exact_rays_show_the_same_surface) {
    int shape[3];
    double outliers, difference;
    char mesh[256], rays[256], command[1024];
    unsigned char *a, *b;
    strcpy(mesh, temporary("mesh.png")), strcpy(rays, temporary("rays.png"));
    snprintf(command, sizeof command, "procedural:engine-block:96 --mode lambert --size 160x120 --exposure 0.4 --out '%s'", mesh);
    CHECK(run_viewer(command).status == 0, "%s", command);
    snprintf(command, sizeof command, "procedural:engine-block:96 --mode lambert --size 160x120 --exposure 0.4 --raycast --out '%s'", rays);
    CHECK(run_viewer(command).status == 0, "%s", command);
    a = read_picture(mesh, shape), b = read_picture(rays, shape);
    if (a && b) {
        difference = picture_difference(a, b, 160, 120, &outliers);
        CHECK(difference < 4 && outliers < 0.01, "differ by %.3f, %.2f %% outliers", difference, 100 * outliers);
    }
    free(a), free(b);
}

TEST(the_number_of_threads_changes_no_byte) {
    char text[2][1 << 16], command[512];
    size_t size[2];
    for (int i = 0; i < 2; i++) {
        const char *out = temporary(i ? "three.png" : "one.png");
        snprintf(command, sizeof command, "procedural:engine-block:%d --samples 16 --size 80x60 --threads %d --out '%s'",
                 QUICK_SUITE ? 40 : 64, i ? 3 : 1, out);
        CHECK(run_viewer(command).status == 0, "%s", command);
        size[i] = read_text(out, text[i], sizeof text[i]);
    }
    CHECK(size[0] > 100 && size[0] == size[1] && !memcmp(text[0], text[1], size[0]), "%zu and %zu bytes", size[0], size[1]);
}

TEST(every_lookup_draws_a_picture_of_its_own) {
    static const char *const names[5] = {"", "--lookup trilinear", "--lookup nearest", "--lookup closest-isovalue", "--lookup bspline"};
    char text[5][1 << 15], command[512];
    size_t size[5];
    for (int i = 0; i < 5; i++) {
        const char *out = temporary("lookup.png");
        snprintf(command, sizeof command, "procedural:gyroid:20 --samples 4 --size 64x48 %s --out '%s'", names[i], out);
        CHECK(run_viewer(command).status == 0, "%s", command);
        size[i] = read_text(out, text[i], sizeof text[i]);
    }
    for (int i = 0; i < 5; i++)
        for (int k = i + 1; k < 5; k++) {
            int same = size[i] == size[k] && !memcmp(text[i], text[k], size[i]);
            CHECK(size[i] > 100 && same == (i == 0 && k == 1), "\"%s\" and \"%s\": %s", names[i], names[k],
                  same ? "the same" : "different");
        }
}

/* Gloss adds light to the diffuse picture of the same exposure, and highlights of another exponent are others. */
TEST(gloss_of_transfer_adds_highlights) {
    static const char *const names[3] = {"", "--gloss 2", "--gloss 25"};
    unsigned char *picture[3];
    char command[512];
    for (int i = 0; i < 3; i++) {
        const char *out = temporary("gloss.png");
        int shape[3];
        snprintf(command, sizeof command, "procedural:gyroid:24 --mode transfer --samples 4 --size 64x48 --exposure 0.3 %s --out '%s'",
                 names[i], out);
        CHECK(run_viewer(command).status == 0, "%s", command);
        picture[i] = read_picture(out, shape);
    }
    for (int i = 1; i < 3 && picture[0] && picture[1] && picture[2]; i++) {
        int darker = 0, brighter = 0;
        double outliers;
        for (int k = 0; k < 3 * 64 * 48; k++) darker += picture[i][k] < picture[0][k], brighter += picture[i][k] > picture[0][k] + 3;
        CHECK(!darker && brighter > 1000, "%s: %d values are darker, %d brighter", names[i], darker, brighter);
        CHECK(i == 1 || picture_difference(picture[1], picture[2], 64, 48, &outliers) > 1, "exponents 2 and 25 look the same");
    }
    for (int i = 0; i < 3; i++) free(picture[i]);
}

/* Several clip planes cut what each of them cuts, in any order, of surfaces (by mesh and by rays) and of volumes. */
SLOW_TEST(clip_planes_add_up) {
    static const char *const ways[] = {"--mode vicinity --samples 4", "--mode lambert --raycast", "--mode dvr --exposure 1"};
    static const char *const planes[] = {"--clip 1,0,0,-12", "--clip 0,-1,0,18", "--clip 1,0,0,-12 --clip 0,-1,0,18",
                                         "--clip 0,-1,0,18 --clip 1,0,0,-12", ""};
    char command[512];
    for (int w = 0; w < 3; w++) {
        unsigned char *picture[5];
        int shape[3] = {0}, kept[5] = {0};
        double outliers;
        for (int k = 0; k < 5; k++) {
            snprintf(command, sizeof command, "procedural:gyroid:32 %s %s --size 48x48 --out '%s'", ways[w], planes[k],
                     temporary("cut.png"));
            run_result r = run_viewer(command);
            CHECK(r.status == 0, "%s: %s", command, r.error);
            picture[k] = read_picture(temporary("cut.png"), shape);
            if (!picture[k]) return;
        }
        CHECK(!memcmp(picture[2], picture[3], 48 * 48 * 3), "%s: the order matters", ways[w]);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < k; i++)
                CHECK(picture_difference(picture[i], picture[k], 48, 48, &outliers) > 2, "%s: \"%s\" looks like \"%s\"", ways[w], planes[i],
                      planes[k]);
        /* where the backdrop is seen: at least as much of it as by either plane alone */
        snprintf(command, sizeof command, "procedural:gyroid:32 %s --clip 1,0,0,-1e6 --size 48x48 --out '%s'", ways[w],
                 temporary("cut.png"));
        CHECK(run_viewer(command).status == 0, "%s", command);
        unsigned char *nothing = read_picture(temporary("cut.png"), shape);
        for (int i = 0; nothing && w && i < 48 * 48; i++)
            for (int k = 0; k < 3; k++) kept[k] += memcmp(picture[k] + 3 * i, nothing + 3 * i, 3) != 0;
        CHECK(!w || (kept[2] > 0 && kept[2] < kept[0] && kept[2] < kept[1]), "%s: %d, %d and %d pixels", ways[w], kept[0], kept[1],
              kept[2]);
        for (int k = 0; k < 5; k++) free(picture[k]);
        free(nothing);
    }
}

/* What is said of volume rendering changes its picture as it should. */
SLOW_TEST(methods_local_light_and_presets_are_seen) {
    static const char *const ways[] = {"", "--method sweep", "--method brute", "--method paper", "--method paper --local", "--preset grey",
        "--preset hot", "--preset cool-warm", "--preset spectrum"};
    enum { COUNT = sizeof ways / sizeof *ways };
    unsigned char *picture[COUNT];
    char command[512];
    int shape[3];
    double outliers;
    for (int k = 0; k < COUNT; k++) {
        snprintf(command, sizeof command, "procedural:engine-block:40 --mode dvr --size 48x48 --exposure 1 %s --out '%s'", ways[k],
                 temporary("way.png"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0, "%s: %s", command, r.error);
        picture[k] = read_picture(temporary("way.png"), shape);
        if (!picture[k]) return;
    }
    CHECK(!memcmp(picture[0], picture[1], 48 * 48 * 3), "the default is not sweeps");
    for (int k = 2; k < COUNT; k++)
        for (int i = k < 5 ? 1 : 0; i < k; i++) {
            double difference = picture_difference(picture[i], picture[k], 48, 48, &outliers);
            CHECK(difference > (k < 5 ? 0.1 : 1), "\"%s\" looks like \"%s\": %g", ways[i], ways[k], difference);
            if (k < 4) CHECK(difference < 12, "\"%s\" differs from \"%s\" by %g", ways[i], ways[k], difference);
        }
    for (int k = 0; k < COUNT; k++) free(picture[k]);
}

/* Scenes of isosurfaces have light for volume rendering, too: what is black at any exposure has none. */
SLOW_TEST(every_scene_is_lit_in_volume_rendering) {
    static const char *const scenes[] = {"engine-block", "cavity", "torus-sphere-plane", "cthead"};
    for (int k = 0; k < (getenv("ISOGI_DATA") ? 4 : 3); k++) {
        unsigned char *picture[2] = {NULL, NULL};
        double outliers;
        int shape[3];
        for (int i = 0; i < 2; i++) {
            char command[512];
            snprintf(command, sizeof command, "--scene %s --mode dvr --preset grey --size 24x24 --exposure %d --order 2 --directions 16 "
                     "--grid 8,8,8 --out '%s'", scenes[k], 1 + i, temporary("scene.png"));
            run_result r = run_viewer(command);
            CHECK(r.status == 0, "%s: %s", command, r.error);
            picture[i] = read_picture(temporary("scene.png"), shape);
        }
        if (picture[0] && picture[1])
            CHECK(picture_difference(picture[0], picture[1], 24, 24, &outliers) > 4, "%s is as bright at twice the exposure", scenes[k]);
        free(picture[0]), free(picture[1]);
    }
}

SLOW_TEST(compact_pyramids_take_less_memory_and_show_the_same) {
    unsigned char *picture[2] = {NULL, NULL};
    double memory[2] = {0, 0}, outliers, difference = 1;
    int shape[3];
    for (int i = 0; i < 2; i++) {
        char command[512];
        snprintf(command, sizeof command,
                 "procedural:engine-block:96 --mode lambert --raycast --shadows on --size 80x60 --stats %s --out '%s'",
                 i ? "--compact" : "", temporary("compact.png"));
        run_result r = run_viewer(command);
        const char *line = strstr(r.output, "memory_bytes ");
        CHECK(r.status == 0 && line, "%s: %s", command, r.error);
        if (line) memory[i] = atof(line + 13);
        picture[i] = read_picture(temporary("compact.png"), shape);
    }
    if (picture[0] && picture[1]) difference = picture_difference(picture[0], picture[1], 80, 60, &outliers);
    CHECK(!(difference > 0) && memory[0] - memory[1] > 1.8 * 96 * 96 * 57, "differ by %g, %g and %g bytes", difference, memory[0],
          memory[1]);
    free(picture[0]), free(picture[1]);
}

/* Lines end as they do anywhere. */
TEST(transfer_functions_end_their_lines_by_cr_or_lf) {
    static const char *const text[] = {"-1 0 1 .5 .2\n0 .3 1 .5 .2\n# half\n\n1 1 .2 .5 1\n",
                                       "-1 0 1 .5 .2\r0 .3 1 .5 .2\r# half\r\r1 1 .2 .5 1\r",
                                       "-1 0 1 .5 .2\r\n0 .3 1 .5 .2\r\n# half\r\n\r\n1 1 .2 .5 1"};
    char command[512];
    unsigned char *picture[3];
    int shape[3];
    for (int k = 0; k < 3; k++) {
        write_bytes(temporary("lines.tf"), text[k], strlen(text[k]));
        snprintf(command, sizeof command, "procedural:gyroid:16 --mode dvr --shading unlit --size 32x32 --tf '%s' --out '%s'",
                 temporary("lines.tf"), temporary("lines.png"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0, "%d: %s", k, r.error);
        picture[k] = read_picture(temporary("lines.png"), shape);
        if (!picture[k]) return;
    }
    for (int k = 1; k < 3; k++) CHECK(!memcmp(picture[0], picture[k], 32 * 32 * 3), "case %d looks otherwise", k);
    for (int k = 0; k < 3; k++) free(picture[k]);
    write_bytes(temporary("lines.tf"), "1 0 0 0 0\r2 0 0 0 0\r\n3 0 0 0 0\n4 0 0 0 2\n", 41);
    snprintf(command, sizeof command, "procedural:gyroid:8 --mode dvr --tf '%s' --out '%s'", temporary("lines.tf"), temporary("never.png"));
    check_refused(command, "line 4: a colour");
}

/* An opaque box, seen from in front: depth is the distance to its face, from 3 radii to its middle, in the middle of a picture,
   which has no pixel there. */
TEST(depth_is_written_as_a_float_map) {
    unsigned char box[8 * 8 * 8];
    char path[256], command[1024];
    static unsigned char map[1 << 15];
    const float *depth = NULL;
    static float rows[40 * 30];
    memset(box, 9, sizeof box);
    strcpy(path, temporary("box_8x8x8_uint8.raw"));
    write_bytes(path, box, sizeof box);
    write_bytes(temporary("box.tf"), "0 1e6 1 1 1\n", 11);
    for (int aa = 1; aa <= 4; aa += 3) {
        snprintf(command, sizeof command,
                 "'%s' --mode dvr --shading unlit --size 40x30 --aa %d --camera 0,0,3 --tf '%s' --depth '%s' --out '%s'", path, aa,
                 temporary("box.tf"), temporary("box.pfm"), temporary("box.png"));
        run_result r = run_viewer(command);
        FILE *file = fopen(temporary("box.pfm"), "rb");
        size_t size = file ? fread(map, 1, sizeof map, file) : 0;
        if (file) fclose(file);
        CHECK(r.status == 0 && size == 14 + 4 * 40 * 30 && !memcmp(map, "Pf\n40 30\n-1.0\n", 14), "%s, %zu bytes", r.error, size);
        if (size != 14 + 4 * 40 * 30) return;
        for (int i = 0; i < 40 * 30; i++) {
            uint32_t bits =
                map[14 + 4 * i] | (uint32_t)map[15 + 4 * i] << 8 | (uint32_t)map[16 + 4 * i] << 16 | (uint32_t)map[17 + 4 * i] << 24;
            memcpy(&rows[i], &bits, sizeof bits);
        }
        depth = rows;
        double expected = 3 * sqrt(3) * 3.5 - 3.5, got = (double)depth[15 * 40 + 20];
        CHECK(fabs(got - expected) < 0.2, "--aa %d: depth %g, not %g", aa, got, expected);
        CHECK(depth[0] > 1e30f && depth[39] > 1e30f && depth[29 * 40] > 1e30f, "nothing in the corners: %g", (double)depth[0]);
    }
}

/* An opaque box of which a plane leaves the lower half: rows go from the bottom up, and of a pixel's samples the nearest is kept, so that
   with more of them no pixel is lost and none is farther. */
TEST(depth_goes_from_the_bottom_up_and_keeps_the_nearest_sample) {
    enum { W = 40, H = 30 };
    static float depth[2][W * H];
    unsigned char box[8 * 8 * 8];
    char path[256], command[1024];
    memset(box, 9, sizeof box);
    strcpy(path, temporary("half_8x8x8_uint8.raw"));
    write_bytes(path, box, sizeof box);
    write_bytes(temporary("half.tf"), "0 1e6 1 1 1\n", 11);
    for (int n = 0; n < 2; n++) { /* one sample; sixteen */
        static unsigned char map[14 + 4 * W * H + 1];
        snprintf(command, sizeof command,
                 "'%s' --mode dvr --shading unlit --size 40x30 --aa %d --camera 0,0,3 --clip 0,-1,0,3.1 --tf '%s' --depth '%s' --out '%s'",
                 path, n ? 4 : 1, temporary("half.tf"), temporary("half.pfm"), temporary("half.png"));
        run_result r = run_viewer(command);
        FILE *file = fopen(temporary("half.pfm"), "rb");
        size_t size = file ? fread(map, 1, sizeof map, file) : 0;
        if (file) fclose(file);
        CHECK(r.status == 0 && size == 14 + 4 * W * H, "%s, %zu bytes", r.error, size);
        for (int i = 0; i < W * H; i++) {
            uint32_t bits =
                map[14 + 4 * i] | (uint32_t)map[15 + 4 * i] << 8 | (uint32_t)map[16 + 4 * i] << 16 | (uint32_t)map[17 + 4 * i] << 24;
            memcpy(&depth[n][i], &bits, sizeof bits);
        }
    }
    int seen[2][2] = {{0}}, fewer = 0, farther = 0;
    for (int i = 0; i < W * H; i++) {
        for (int n = 0; n < 2; n++) seen[n][i >= W * H / 2] += depth[n][i] < 1e30f;
        fewer += depth[0][i] < 1e30f && !(depth[1][i] < 1e30f);
        farther += depth[0][i] < 1e30f && depth[1][i] > depth[0][i] + 0.05f;
    }
    printf("    pixels seen below and above: %d and %d of one sample, %d and %d of sixteen\n", seen[0][0], seen[0][1], seen[1][0],
           seen[1][1]);
    CHECK(seen[0][0] > 40 && !seen[0][1] && seen[1][0] > seen[0][0] && !seen[1][1], "%d below, %d above", seen[0][0], seen[0][1]);
    CHECK(!fewer && !farther, "%d pixels lost, %d farther", fewer, farther);
}

/* Nothing is ignored: in every mode every option is refused, or the picture is another one. WITH is what the option needs beside it; modes
   where the option is the default, so that it is taken and changes nothing, are named. What --help lists is here, or in `apart`. */
#define ALL_MODES "lambert phong vicinity irradiance transfer pathtrace dvr scale-invariant"
static const struct { const char *with, *option, *same; } tried[] = {
    {"", "--raycast", ""}, {"", "--env ENV", ""}, {"", "--light directional:1,1,0:3,1,1:2", ""}, {"", "--albedo 0.9,0.3,0.1", ""},
    {"", "--bounces 0", ""}, {"", "--samples 9", ""}, {"", "--lattice 12,12,12", ""}, {"", "--lookup nearest", ""},
    {"", "--shadows on", "vicinity irradiance transfer pathtrace"}, {"", "--shadows off", "lambert phong"},
    {"", "--ambient constant", "phong"}, {"", "--ambient normal", "lambert"}, {"", "--fog 2", ""}, {"", "--gloss 10", ""},
    {"", "--normals trilinear", ""}, {"", "--offset -1", ""}, {"", "--reach 2", ""}, {"", "--storage byte", ""},
    {"", "--storage float", "vicinity irradiance"}, {"", "--storage half", "transfer"}, {"", "--tf TF", ""}, {"", "--preset hot", ""},
    {"", "--shading unlit", ""}, {"", "--shading visibility", "dvr"}, {"", "--shading local", "scale-invariant"},
    {"", "--shading two-sided", ""}, {"", "--method brute", ""}, {"", "--method paper", ""}, {"", "--order 2", ""},
    {"", "--directions 40", ""}, {"", "--grid 4,4,4", ""}, {"", "--coarsest 8", ""}, {"", "--coarsest 1", "dvr"}, {"", "--local", ""},
    {"--method paper", "--local", ""}, {"--shading visibility", "--order 2", ""}, {"--shading visibility", "--grid 4,4,4", ""},
    {"", "--classification post-classified", ""}, {"", "--classification pre-integrated", "dvr"}, {"", "--silhouette exact", ""},
    {"--tf PEAK", "--silhouette exact", ""}, {"", "--transmission none", ""}, {"--shading two-sided", "--transmission none", ""},
    {"", "--step 2", ""}, {"--classification post-classified", "--step 2", ""}, {"", "--bound .01", ""}, {"--bound .01", "--step 2", ""},
    {"--bound .01 --method brute", "--step 3", ""}, {"", "--iso 0.3", ""}, {"", "--clip 1,0,0,-12", ""}, {"", "--exposure 0.4", ""},
    {"", "--aa 9", ""}, {"", "--up 1,0,0", ""}, {"", "--camera 10,20,3", ""}, {"", "--spacing 1,2,1", ""}, {"", "--surface 0.4", ""},
    {"--surface 0.4", "--albedo 0.9,0.3,0.1", ""}};
static const char apart[] = "--scene --mode --out --size --nan --compare --depth --threads --compact --stats --help";

/* The bytes of the picture; 0 where the words are refused, in one line. */
static size_t picture_of(const char *mode, const char *words, unsigned char *bytes, size_t most) {
    char command[1024] = "procedural:torus-sphere-plane:24 --size 48x48 --threads 1 --mode ", *at = command + strlen(command);
    run_result r;
    at += sprintf(at, "%s --out '%s' %s ", mode, temporary("option.png"), strstr("lambert phong dvr scale-invariant", mode) ||
        strstr(words, "--samples") ? "" : "--samples 4");
    for (const char *c = words; *c; c++) /* files by their names here */
        if (!strncmp(c, "ENV", 3)) at += sprintf(at, "'%s'", temporary("o.hdr")), c += 2;
        else if (!strncmp(c, "TF", 2)) at += sprintf(at, "'%s'", temporary("o.tf")), c += 1;
        else if (!strncmp(c, "PEAK", 4)) at += sprintf(at, "'%s'", temporary("peak.tf")), c += 3;
        else *at++ = *c;
    *at = 0;
    r = run_viewer(command);
    CHECK(r.status == 0 || (r.status == 1 && r.lines == 1), "%s: status %d, %zu lines: %s", command, r.status, r.lines, r.error);
    return r.status ? 0 : read_text(temporary("option.png"), (char *)bytes, most);
}

/* Among matter that is clear the surface is what lambert shows; matter covers it, and what is behind it is hidden. */
TEST(a_surface_stands_in_the_matter) {
    enum { SIDE = 48, PIXELS = SIDE * SIDE };
    static const char *const scene = "procedural:gyroid:24 --size 48x48 --exposure 1 --albedo .9,.6,.2 --light directional:1,1,1:3,2,1";
    /* clear; before the surface; within it, opaque; at it */
    static const char *const matter[] = {"-1.5 0 1 1 1\n", "-1.5 0 1 .2 .1\n-.5 0 1 .2 .1\n-.1 .2 .1 .2 1\n0.3 0 .1 .2 1\n",
                                         "0.5 0 .1 1 .1\n0.5 1e6 .1 1 .1\n", "-1.5 0 1 1 1\npeak 0.2 0.5 0 0 1\n"};
    static const char *const ways[] = {"--mode lambert --shadows on --raycast --iso 0.2 --aa 1", "--mode dvr --shading unlit --surface 0.2",
                                       "--mode scale-invariant --shading unlit --surface 0.2 --aa 1",
                                       "--mode dvr --shading unlit --surface 0.2 --aa 4"};
    static unsigned char map[14 + 4 * PIXELS + 1];
    unsigned char *picture[7];
    char command[1024];
    int shape[3] = {0}, seen = 0, changed[7] = {0};
    double outliers;
    for (int n = 0; n < 7; n++) {
        write_bytes(temporary("matter.tf"), matter[n < 4 ? 0 : n - 3], strlen(matter[n < 4 ? 0 : n - 3]));
        int length = snprintf(command, sizeof command, "%s %s --out '%s'", scene, ways[n < 4 ? n : 1], temporary("surface.png"));
        if (n)
            snprintf(command + length, sizeof command - (size_t)length, " --tf '%s' --depth '%s'", temporary("matter.tf"),
                     temporary("surface.pfm"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0, "%s: %s", command, r.error);
        picture[n] = read_picture(temporary("surface.png"), shape);
        if (!picture[n]) return;
        FILE *file = n ? fopen(temporary("surface.pfm"), "rb") : NULL;
        CHECK(!n || (file && fread(map, 1, sizeof map, file) == sizeof map - 1), "no depth of %zu bytes", sizeof map - 1);
        if (file) fclose(file);
        if (n != 1) continue;
        for (int i = 0; i < PIXELS; i++) {
            const unsigned char *at = map + 14 + 4 * i;
            uint32_t bits = at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
            seen += bits != 0x7f800000;
        }
    }
    for (int n = 1; n < 7; n++)
        for (int i = 0; i < PIXELS; i++) changed[n] += memcmp(picture[0] + 3 * i, picture[n] + 3 * i, 3) != 0;
    CHECK(seen > PIXELS / 6, "%d pixels have a depth", seen);
    CHECK(!changed[1] && !changed[2] && !changed[6], "%d, %d and, with a peak at the surface, %d pixels differ from those of lambert",
          changed[1], changed[2], changed[6]);
    CHECK(changed[3] && picture_difference(picture[0], picture[3], SIDE, SIDE, &outliers) < 12, "four samples show something else");
    CHECK(changed[4] > PIXELS / 6, "matter before the surface changes %d pixels", changed[4]);
    CHECK(changed[5] < seen / 20, "matter behind the surface changes %d pixels of %d", changed[5], seen); /* the box opens some of it */
    for (int n = 0; n < 7; n++) free(picture[n]);
}

TEST(every_option_is_refused_or_changes_the_picture) {
    enum { MOST = 1 << 16 };
    static unsigned char plain[MOST], bytes[MOST];
    static char help[16384];
    char modes[] = ALL_MODES, command[512], with[512], name[64], hdr[600] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
    size_t changed = 0, refused = 0, length = strlen(hdr);
    snprintf(command, sizeof command, "'%s' --help >'%s'", viewer_path(), temporary("help"));
    CHECK(system(command) == 0, "--help fails");
    read_text(temporary("help"), help, sizeof help);
    for (const char *line = help; (line = strstr(line, "\n  --")) && sscanf(line += 3, "%63s", name) == 1;) {
        int found = strstr(apart, name) != NULL;
        for (size_t i = 0; i < sizeof tried / sizeof *tried; i++) found |= !strncmp(tried[i].option, name, strlen(name));
        CHECK(found, "%s is not tried", name);
    }
    if (!LONG_SUITE) return;
    for (int i = 0; i < 32; i++, length += 4)
        hdr[length] = (char)(40 + 5 * i), hdr[length + 1] = 60, hdr[length + 2] = (char)(200 - 5 * i), hdr[length + 3] = (char)129;
    write_bytes(temporary("o.hdr"), hdr, length);
    write_bytes(temporary("o.tf"), "0 0 .2 .2 .2\n1 .9 1 .5 .2\n", 26);
    write_bytes(temporary("peak.tf"), "peak .4 .5 1 .5 .2\n", 19);
    for (const char *mode = strtok(modes, " "); mode; mode = strtok(NULL, " ")) {
        size_t base = 0;
        for (size_t i = 0; i < sizeof tried / sizeof *tried; i++) {
            if (!i || strcmp(tried[i].with, tried[i - 1].with)) base = picture_of(mode, tried[i].with, plain, MOST);
            if (!base) continue;
            snprintf(with, sizeof with, "%s %s", tried[i].with, tried[i].option);
            size_t size = picture_of(mode, with, bytes, MOST);
            int same = size == base && !memcmp(plain, bytes, size);
            CHECK(same == (strstr(tried[i].same, mode) != NULL), "--mode %s %s: %s", mode, with, same ? "changes nothing" : size ?
                "is not the default" : "is refused");
            changed += size && !same, refused += !size;
        }
    }
    printf("    %zu pictures changed, %zu refused\n", changed, refused);
    CHECK(changed > 150 && refused > 100, "%zu and %zu", changed, refused);
}

/* One, two and four paths for each pixel are what they say. */
TEST(few_paths_are_not_rounded_up_in_silence) {
    static char text[3][1 << 15];
    size_t size[3];
    char command[512];
    for (int i = 0; i < 3; i++) {
        snprintf(command, sizeof command, "procedural:gyroid:16 --mode pathtrace --samples %d --size 32x24 --out '%s'", 1 << i,
                 temporary("few.png"));
        CHECK(run_viewer(command).status == 0, "%s", command);
        size[i] = read_text(temporary("few.png"), text[i], sizeof text[i]);
        for (int k = 0; k < i; k++)
            CHECK(size[k] != size[i] || memcmp(text[k], text[i], size[i]), "%d and %d paths are the same picture", 1 << k, 1 << i);
    }
}

/* ---- what is refused --------------------------------------------------------------------------------------------------------- */

TEST(silly_options_get_one_line_that_names_the_option) {
    static const char *const bad[][2] = {
        {"", "VOLUME"}, {"procedural:gyroid --nonsense", "--nonsense"}, {"procedural:gyroid --size", "--size"},
        {"procedural:gyroid --env --stats", "--env: needs a value"}, {"procedural:gyroid --out --raycast", "--out: needs a value"},
        {"procedural:gyroid --iso --raycast", "--iso: needs a value"},
        {"procedural:gyroid --size 0x10", "--size"}, {"procedural:gyroid --size 10", "--size"},
        {"procedural:gyroid --size 10x10x10", "--size"},
        {"procedural:gyroid --size 1e9x1e9", "--size"}, {"procedural:gyroid --size 16384x16384", "--size"},
        {"procedural:gyroid --size 10.5x10", "--size"},
        {"procedural:gyroid --size nanx10", "--size"}, {"procedural:gyroid --size -5x10", "--size"},
        {"procedural:gyroid --iso nan", "--iso"},
        {"procedural:gyroid --iso inf", "--iso"}, {"procedural:gyroid --iso 1,2", "--iso"}, {"procedural:gyroid --iso ''", "--iso"},
        {"procedural:gyroid --mode nice", "lambert phong vicinity"}, {"procedural:gyroid --spacing 1,1", "--spacing"},
        {"procedural:gyroid --spacing 0,1,1", "--spacing"}, {"procedural:gyroid --spacing 1,-1,1", "--spacing"},
        {"procedural:gyroid --spacing 1,1,1,1", "--spacing"},
        {"procedural:gyroid --albedo 2,0,0", "--albedo"}, {"procedural:gyroid --albedo 1", "--albedo"},
        {"procedural:gyroid --bounces 1.5", "--bounces"},
        {"procedural:gyroid --bounces -2", "--bounces"}, {"procedural:gyroid --samples 0", "--samples"},
        {"procedural:gyroid --samples 1e30", "--samples"},
        {"procedural:gyroid --lattice 0,4,4", "--lattice"}, {"procedural:gyroid --lattice 4,4", "--lattice"},
        {"procedural:gyroid --lookup magic", "--lookup"},
        {"procedural:gyroid --clip 0,0,0,1", "--clip"}, {"procedural:gyroid --clip 1,2,3", "--clip"},
        {"procedural:gyroid --clip 1e30,0,0,1", "from -1e9 to 1e9"},
        {"procedural:gyroid --tf x.tf", "--tf: works with --mode dvr"},
        {"procedural:gyroid --mode phong --classification exact", "--classification: works with --mode dvr"},
        {"procedural:gyroid --step 1", "--step: works"},
        {"procedural:gyroid --mode dvr --samples 4",
         "--samples: works with --mode vicinity, irradiance, transfer and pathtrace"},
        {"procedural:gyroid --mode dvr --raycast", "--raycast: works with surfaces"},
        {"procedural:gyroid --mode scale-invariant --method paper", "--method: works with --mode dvr, not"},
        {"procedural:gyroid --mode dvr --shading unlit --method sweep", "--method: needs"},
        {"procedural:gyroid --mode dvr --shading unlit --method default", "--method: needs"},
        {"procedural:gyroid --mode dvr --method fast", "default brute paper sweep"},
        {"procedural:gyroid --mode dvr --local", "--local: needs"},
        {"procedural:gyroid --mode dvr --preset rainbow", "grey hot cool-warm spectrum"},
        {"procedural:gyroid --mode dvr --preset hot --tf x.tf", "not both"},
        {"procedural:gyroid --depth a.pfm", "--depth: works"}, {"procedural:gyroid:8 --mode dvr --depth /nowhere/a.pfm", "/nowhere/a.pfm"},
        {"procedural:coulomb:8 --mode dvr --method paper --local", "--local: knows no peaks"},
        {"procedural:coulomb:8 --mode dvr --method paper", "--method: paper knows no peaks"},
        {"procedural:coulomb:8 --mode scale-invariant --order 3", "--order: needs"},
        {"procedural:gyroid --mode dvr --iso 1", "--iso: works with surfaces and --mode scale-invariant, not with --mode dvr"},
        {"procedural:gyroid --mode scale-invariant --preset hot --iso 1", "--iso: is for surfaces"},
        {"procedural:coulomb:8 --mode scale-invariant --iso 1", "--iso: the transfer function"},
        {"procedural:gyroid --mode dvr --transmission none", "--transmission: needs"},
        {"procedural:gyroid --mode scale-invariant --transmission none", "--transmission: needs"},
        {"procedural:engine-block:8 --mode dvr --silhouette exact", "--silhouette: is for peaks"},
        {"procedural:engine-block:8 --mode dvr --silhouette none", "--silhouette: is for peaks"},
        {"procedural:gyroid --mode scale-invariant --step 1", "--step: exact rays"},
        {"procedural:gyroid --mode scale-invariant --method brute", "--method: works"},
        {"procedural:gyroid --mode dvr --shading unlit --env sky", "--env: --shading unlit"},
        {"procedural:gyroid --mode dvr --shading unlit --light directional:1,1,1:1,1,1", "--light: --shading unlit"},
        {"procedural:gyroid --mode dvr --shading local --grid 8,8,8", "--grid: needs"},
        {"procedural:gyroid --mode dvr --shading unlit --directions 8", "--directions: needs"},
        {"procedural:gyroid --mode dvr --order 7", "1 to 6"},
        {"procedural:gyroid --mode dvr --directions 0", "--directions"},
        {"procedural:gyroid --mode dvr --grid 8,8", "--grid"},
        {"procedural:gyroid --grid 8,8,8", "--grid: works with --mode dvr and scale-invariant, not with --mode irradiance"},
        {"procedural:gyroid --mode scale-invariant --bound .1", "--bound: works with --mode dvr, not"},
        {"procedural:gyroid:8 --mode dvr --bound .1 --step 1", "--step: rays with --bound"},
        {"procedural:coulomb:8 --mode dvr --bound .1 --step 1", "--step: rays with --bound"},
        {"procedural:gyroid --mode dvr --bound .1 --step 1 --method paper", "--step: rays with --bound"},
        {"procedural:gyroid --mode dvr --bound .1 --step 1 --shading local --method brute", "--method: needs"},
        {"procedural:gyroid --mode dvr --bound .1 --step 1 --shading local", "--step: rays with --bound"},
        {"procedural:gyroid --mode dvr --bound .1 --classification post-classified", "--classification: rays with --bound"},
        {"procedural:gyroid --mode dvr --bound 2", "--bound"},
        {"procedural:gyroid --coarsest 8", "--coarsest: works with --mode dvr"},
        {"procedural:gyroid --mode dvr --coarsest 3", "--coarsest"},
        {"procedural:gyroid --mode dvr --shading unlit --coarsest 1", "--coarsest: needs"},
        {"procedural:gyroid --mode dvr --method paper --coarsest 2", "--coarsest: needs"},
        {"procedural:coulomb:8 --mode dvr --coarsest 2", "--coarsest: knows no peaks"},
        {"procedural:gyroid --mode vicinity --env sky", "--env: works with modes that have no light of their own"},
        {"procedural:gyroid --light directional:1,1,1:1,1,1 --mode vicinity", "--light: works with modes that have no light of their own"},
        {"procedural:gyroid --mode vicinity --bounces 2",
         "--bounces: works with --mode irradiance, transfer and pathtrace, not with --mode vicinity"},
        {"procedural:gyroid --mode lambert --samples 4", "--samples: works"},
        {"procedural:gyroid --mode pathtrace --lattice 8,8,8", "--lattice: works"},
        {"procedural:gyroid --ambient normal", "--ambient: works with --mode lambert and phong, not"},
        {"procedural:gyroid --lookup x", "allowed: trilinear nearest"},
        {"procedural:gyroid --mode dvr --depth same.png --out same.png", "--depth: same.png is the file of --out"},
        {"procedural:gyroid --mode dvr --depth ./same.png --out same.png", "--depth: ./same.png is the file of --out"},
        {"procedural:gyroid --mode dvr --out tests/golden/dvr.png --depth ./tests/golden/dvr.png", "is the file of --out"},
        {"procedural:gyroid --mode dvr --out /tmp/never.png --depth tests/golden/dvr.png --compare tests/golden/dvr.png",
        "is the file of --compare"},
        {"procedural:gyroid --mode dvr --tf tests/test_viewer.c --out tests/test_viewer.c",
        "--out: tests/test_viewer.c is the file of --tf"},
        {"tests/test.h --out ./tests/test.h", "is the file of VOLUME"},
        {"procedural:gyroid --env tests/test.h --out tests/test.h", "is the file of --env"},
        {"procedural:gyroid --camera 1,2", "--camera"}, {"procedural:gyroid --camera 0,91,2", "--camera"},
        {"procedural:gyroid --camera 0,0,0", "--camera"},
        {"procedural:gyroid --up 0,0,0", "--up"}, {"procedural:gyroid --threads -1", "--threads"},
        {"procedural:gyroid --threads 1000", "--threads"},
        {"procedural:gyroid --light sun:1,1,1:1,1,1", "--light"}, {"procedural:gyroid --light directional:0,0,0:1,1,1", "--light"},
        {"procedural:gyroid --light directional:1,1,1", "--light"}, {"procedural:gyroid --light point:1,1,1:-1,0,0", "--light"},
        {"procedural:gyroid --light sphere:1,1,1:1,1,1", "--light"}, {"procedural:gyroid --light rectangle:1,1,1:1,1,1:1,0,0", "--light"},
        {"procedural:gyroid --light rectangle:1,1,1:1,1,1:1,0,0:1,1,0", "--light"},
        {"procedural:gyroid --light point:1,1,1:1,1,1:1,0,0:0,1,0", "--light"},
        {"procedural:gyroid --light point:1,1,1:1,1,1:1:1", "--light"},
        {"procedural:gyroid --mode transfer --light point:1,1,1:1,1,1", "--light"}, {"procedural:gyroid --exposure 0", "--exposure"},
        {"procedural:gyroid:8 --mode dvr --size 16384x2 --aa 9", "--size 16384x2 with --aa 9 is 49152x6 samples; at most 32768"},
        {"procedural:gyroid --lattice 4096,4096,4096", "--lattice: the table of its bricks alone needs 8.0 GiB"},
        {"procedural:gyroid --shadows maybe", "--shadows"},
        {"procedural:gyroid --mode transfer --storage rgb9e5", "--storage"},
        {"procedural:gyroid:16 --size 32x32 --compare /dev/null", "/dev/null"},
        {"procedural:gyroid:2048 --compare /nowhere.png", "/nowhere.png"},
        {"procedural:gyroid:2048 --compare tests/golden/dvr.png", "is not 900x900"},
        {"procedural:gyroid --gloss 10", "--gloss: works with --mode transfer, not"},
        {"procedural:gyroid --mode transfer --gloss -1", "--gloss"},
        {"procedural:gyroid --aa 1000", "--aa"}, {"procedural:gyroid --shading flat", "--shading"}, {"procedural:gyroid --out ''", "--out"},
        {"procedural:gyroid procedural:skull", "second volume"}, {"procedural:gyroid --scene engine", "not both"},
        {"--scene nowhere", "engine bonsai"},
        {"procedural:teapot", "marschner-lobb"}, {"procedural:", "marschner-lobb"}, {"procedural:gyroid:1", "2 to 2048"},
        {"procedural:gyroid:", "2 to 2048"},
        {"procedural:gyroid:99999", "2 to 2048"}, {"procedural:gyroid:nan", "2 to 2048"}, {"--scene cthead --mode dvr", "--tf"}};
    char command[1024];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        const char *out = strstr(bad[i][0], "--out") ? "" : temporary("never.png");
        snprintf(command, sizeof command, *out ? "%s --out '%s'" : "%s%s", bad[i][0], out);
        if (!*bad[i][0]) strcpy(command, "");
        check_refused(command, bad[i][1]);
    }
    snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --out '%s'", temporary("planes.png"));
    for (int i = 0; i < 32; i++) strcat(command, " --clip 1,0,0,9");
    CHECK(run_viewer(command).status == 0, "%s", "32 planes");
    strcat(command, " --clip 1,0,0,9");
    check_refused(command, "--clip");
    CHECK(access(temporary("never.png"), F_OK) != 0, "a refused run wrote a picture: %s", temporary("never.png"));
}

TEST(bad_volumes_get_one_line) {
    unsigned char bytes[64 * 4] = {0};
    float numbers[8] = {0, 1, 2, NAN, 4, 5, 6, 7};
    char command[512];
    static const struct { const char *name; size_t size; const char *say; } files[] = {
        {"short_4x4x4_uint8.raw", 63, "63 bytes"}, {"long_4x4x4_uint8.raw", 65, "65 bytes"}, {"empty_4x4x4_uint8.raw", 0, "0 bytes"},
        {"zero_0x4x4_uint8.raw", 0, "size of 0"}, {"nosize_uint8.raw", 64, "name must end"}, {"notype_4x4x4.raw", 64, "name must end"},
        {"two_8x8_uint8.raw", 64, "name must end"}, {"four_2x2x4x4_uint8.raw", 64, "name must end"},
        {"odd_4x4x4_uint24.raw", 64, "name must end"},
        {"minus_-4x4x4_uint8.raw", 64, "name must end"}, {"huge_99999999999x4x4_uint8.raw", 64, "name must end"},
        {"vast_999999999x999999999x999999999_float64.raw", 64, "too large"}, {"big_2000000000x20x2_uint8.raw", 64, "64 bytes"},
        {"flat_64x1x1_uint8.raw", 64, "only one layer"}, {"other_4x4x4_uint8.nrrd", 64, "only raw volumes"},
        {"nothing", 4, "only raw volumes"},
        {"4x4x4_uint8.raw", 63, "63 bytes"}, {"x_4x4x4_UINT8.raw", 64, "name must end"}};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        const char *path = temporary(files[i].name);
        write_bytes(path, bytes, files[i].size);
        snprintf(command, sizeof command, "'%s' --size 8x8 --out '%s'", path, temporary("never.png"));
        check_refused(command, files[i].say);
    }
    snprintf(command, sizeof command, "'%s' --out '%s'", temporary("missing_4x4x4_uint8.raw"), temporary("never.png"));
    check_refused(command, "No such file");
    snprintf(command, sizeof command, "'%s' --out '%s'", folder, temporary("never.png"));
    check_refused(command, "only raw volumes");
    {
        char path[256];
        strcpy(path, temporary("nan_2x2x2_float32.raw"));
        write_bytes(path, numbers, sizeof numbers);
        snprintf(command, sizeof command, "'%s' --size 8x8 --out '%s'", path, temporary("nan.png"));
        check_refused(command, "voxel 1,1,0");
        snprintf(command, sizeof command, "'%s' --size 8x8 --mode lambert --nan 3 --out '%s'", path, temporary("nan.png"));
        CHECK(run_viewer(command).status == 0, "--nan: %s", command);
    }
    mkdir(temporary("dir_4x4x4_uint8.raw"), 0700);
    snprintf(command, sizeof command, "'%s' --out '%s'", temporary("dir_4x4x4_uint8.raw"), temporary("never.png"));
    check_refused(command, "folder");
}

TEST(bad_environments_and_transfer_functions_get_one_line) {
    static const char *const hdr[][2] = {
        {"", "does not begin"}, {"hello", "does not begin"}, {"#?RADIANCE\n", "within its header"}, {"#?RADIANCE\n\n", "header"},
        {"#?RADIANCE\n\n-Y 4 +X 4\n", "row 0"},
        {"#?RADIANCE\n\n+X 4 -Y 4\n", "columns"}, {"#?RADIANCE\n\n-Y 0 +X 4\nabcd", "claims"},
        {"#?RADIANCE\n\n-Y 99999999 +X 99999999\nabcd", "claims"},
        {"#?RADIANCE\n\n-Y 32768 +X 32768\nabcd", "claims"}, {"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd", "FORMAT"},
        {"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\nabcd", "exposure"}, {"#?RADIANCE\nEXPOSURE=x\n\n-Y 1 +X 1\nabcd", "exposure"},
        {"#?RADIANCE\n\n-Y 2 +X 2\nabcdabcd", "row 1"}};
    static const char *const tf[][2] = {{"", "no point"}, {"# only words\n", "no point"}, {"1 2 3\n", "line 1"},
        {"1 0 0 0 0\n0 0 0 0 0\n", "ascend"},
        {"1 -1 0 0 0\n", "line 1"}, {"1 0 2 0 0\n", "colour"}, {"\n\nnan 0 0 0 0\n", "line 3"}, {"peak 1 2 1 1 1\n", "opacity"},
        {"peak 1\n", "line 1"}, {"1 0 0 0 0 0\n", "line 1"}};
    char command[512];
    for (size_t i = 0; i < sizeof hdr / sizeof hdr[0]; i++) {
        const char *path = temporary("bad.hdr");
        write_bytes(path, hdr[i][0], strlen(hdr[i][0]));
        snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --env '%s' --out '%s'", path, temporary("never.png"));
        check_refused(command, hdr[i][1]);
    }
    {
        static const char header[] = "#?RADIANCE\n\n-Y 16384 +X 8193\n";
        static char bytes[1100000]; /* of black: more than a 128th of the pixels */
        memcpy(bytes, header, strlen(header));
        write_bytes(temporary("bad.hdr"), bytes, sizeof bytes);
        snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --env '%s' --out '%s'", temporary("bad.hdr"),
                 temporary("never.png"));
        check_refused(command, "134 million are read");
    }
    for (size_t i = 0; i < sizeof tf / sizeof tf[0]; i++) {
        const char *path = temporary("bad.txt");
        write_bytes(path, tf[i][0], strlen(tf[i][0]));
        snprintf(command, sizeof command, "procedural:gyroid:8 --mode dvr --size 8x8 --tf '%s' --out '%s'", path, temporary("never.png"));
        check_refused(command, tf[i][1]);
    }
    {
        FILE *file = fopen(temporary("bad.txt"), "w");
        for (int i = 0; i < 257; i++) fprintf(file, "peak %d .1 1 1 1\n", i);
        fclose(file);
        snprintf(command, sizeof command, "procedural:gyroid:8 --mode dvr --size 8x8 --tf '%s' --out '%s'", temporary("bad.txt"),
                 temporary("never.png"));
        check_refused(command, "line 257");
    }
    check_refused("procedural:gyroid:8 --env /nowhere/at/all.hdr", "/nowhere/at/all.hdr");
    check_refused("procedural:gyroid:8 --mode dvr --tf /nowhere.txt", "/nowhere.txt");
    static const unsigned char dark[80000];
    write_bytes(temporary("long_20000x2x2_uint8.raw"), dark, sizeof dark);
    snprintf(command, sizeof command, "'%s' --mode dvr --step 0.001 --size 8x8", temporary("long_20000x2x2_uint8.raw"));
    check_refused(command, "--step: samples on a ray: too large");
}

TEST(an_existing_file_survives_every_failure) {
    char command[512], text[64], precious[256];
    static const char *const failing[] = {"procedural:gyroid:8 --size 0x0", "procedural:teapot", "/nowhere_4x4x4_uint8.raw",
                                          "procedural:gyroid:8 --env /nowhere.hdr"};
    strcpy(precious, temporary("precious.png"));
    write_bytes(precious, "do not touch", 12);
    for (size_t i = 0; i < sizeof failing / sizeof failing[0]; i++) {
        snprintf(command, sizeof command, "%s --out '%s'", failing[i], precious);
        CHECK(run_viewer(command).status == 1, "%s", command);
        read_text(precious, text, sizeof text);
        CHECK(!strcmp(text, "do not touch"), "after %s it holds \"%.20s\"", command, text);
    }
    /* a file size limit makes the write itself fail half way */
    snprintf(command, sizeof command, "procedural:gyroid:8 --size 512x512 --mode lambert --out '%s'", precious);
    {
        char shell[1024];
        const char *viewer = getenv("ISOGI_VIEWER");
        snprintf(shell, sizeof shell, "ulimit -f 8; '%s' %s 2>/dev/null", viewer && *viewer ? viewer : "build/viewer",
                 command);
        CHECK(system(shell) != 0, "a write beyond the limit was not noticed");
    }
    read_text(precious, text, sizeof text);
    CHECK(!strcmp(text, "do not touch"), "after a full disk it holds \"%.20s\"", text);
    snprintf(command, sizeof command, "ls '%s' | grep -c tmp >/dev/null", folder);
    CHECK(system(command) != 0, "a temporary file was left in %s", folder);
    snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --out '%s/none/x.png'", folder);
    check_refused(command, "No such file");
    snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --out '%s'", folder);
    check_refused(command, "folder");
}

/* A picture without a surface says so, be it empty or of the sides of a volume that is matter throughout; no other does. */
TEST(pictures_without_a_surface_are_told) {
    static const char *const words[] = {"--iso 9", "--iso 9 --raycast", "--iso -9", "--iso -9 --raycast", "--mode pathtrace --iso -9", "",
                                        "--clip 1,0,0,-12", "--raycast"};
    char command[512];
    for (int k = 0; k < 8; k++) {
        snprintf(command, sizeof command, "procedural:gyroid:24 --size 16x16 --samples 4 %s --out '%s'", words[k], temporary("note.png"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0 && !strstr(r.error, "no surface is in view") == (k > 4) && !strstr(r.error, "lattice"), "%s: %s", words[k],
              r.error);
    }
}

TEST(matter_that_is_not_in_view_is_told) {
    static const char *const words[] = {"--clip 1,0,0,-1e8", "--mode scale-invariant --clip 1,0,0,-1e8", ""};
    char command[512];
    for (int k = 0; k < 3; k++) {
        snprintf(command, sizeof command, "procedural:gyroid:8 --size 8x8 --mode dvr %s --out '%s'", words[k], temporary("matter.png"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0 && !strstr(r.error, "nothing is in view") == (k == 2), "%s: %s", words[k], r.error);
    }
}

TEST(black_pictures_are_told) {
    static const char *const words[] = {"--albedo 0,0,0", "--mode lambert --light directional:0,1,0:0,0,0",
                                        "--mode dvr --light point:-9,0,0:0,0,0", "--samples 4", "--mode lambert --iso 9"};
    char command[512];
    for (int k = 0; k < 5; k++) {
        snprintf(command, sizeof command, "procedural:gyroid:16 --size 16x16 %s --out '%s'", words[k], temporary("black.png"));
        run_result r = run_viewer(command);
        CHECK(r.status == 0 && !strstr(r.error, "is black") == (k > 2), "%s: %s", words[k], r.error);
    }
}

TEST(stats_are_key_value_lines_and_help_is_complete) {
    static const char *const keys[] = {"size 32x32x32", "range ",           "isovalue ",        "triangles ",
                                       "rays_light ",   "rays_per_second ", "texels_computed ", "texels_requested ",
                                       "memory_bytes ", "seconds_bake ",    "seconds_total ",   "error_relative "};
    static const char *const named[] = {"--scene",    "--size",   "--iso",       "--mode",    "--raycast", "--spacing",    "--env",
                                        "--light",    "--albedo", "--bounces",   "--samples", "--lattice", "--lookup",     "--shadows",
                                        "--ambient",  "--fog",    "--gloss",     "--normals", "--offset",  "--reach",      "--storage",
                                        "--compare",  "--tf",     "--preset",    "--method",  "--order",   "--directions", "--grid",
                                        "--coarsest", "--bound",  "--local",     "--depth",   "--clip",    "--camera",     "--up",
                                        "--threads",  "--out",    "--compact", "--stats",  "procedural:", "Examples"};
    char command[512];
    run_result r;
    snprintf(command, sizeof command, "procedural:gyroid:32 --size 32x32 --samples 8 --stats --out '%s'", temporary("stats.png"));
    r = run_viewer(command);
    CHECK(r.status == 0, "%d: %s", r.status, r.error);
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) CHECK(strstr(r.output, keys[i]), "no \"%s\" in: %s", keys[i], r.output);
    for (char *line = strtok(r.output, "\n"); line; line = strtok(NULL, "\n")) CHECK(strchr(line, ' ') && line[0] != ' ', "\"%s\"", line);
    snprintf(command, sizeof command, "--help");
    {
        char help[16384];
        const char *viewer = getenv("ISOGI_VIEWER");
        char shell[512];
        snprintf(shell, sizeof shell, "'%s' --help >'%s'", viewer && *viewer ? viewer : "build/viewer", temporary("help"));
        CHECK(system(shell) == 0, "--help fails");
        snprintf(shell, sizeof shell, "'%s' --help >/dev/full 2>&1", viewer && *viewer ? viewer : "build/viewer");
        CHECK(access("/dev/full", W_OK) != 0 || system(shell) != 0, "--help to a full disk succeeds");
        read_text(temporary("help"), help, sizeof help);
        for (size_t i = 0; i < sizeof named / sizeof named[0]; i++) CHECK(strstr(help, named[i]), "--help does not tell of %s", named[i]);
        for (char *line = strtok(help, "\n"); line; line = strtok(NULL, "\n"))
            CHECK(strlen(line) <= 100, "%zu columns: %s", strlen(line), line);
    }
}

/* ---- the parts --------------------------------------------------------------------------------------------------------------- */

TEST(png_round_trip_is_exact) {
    test_random random = {1};
    for (int pass = 0; pass < 60; pass++) {
        int width = 1 + (int)(random_bits(&random) % (pass < 50 ? 40 : 700)), height = 1 + (int)(random_bits(&random) % 60),
            channels = pass % 2 ? 3 : 4, shape[3];
        size_t n = (size_t)width * (size_t)height * (size_t)channels, size;
        unsigned char *pixels = (unsigned char *)malloc(n), *file, *back = NULL;
        char error[FILE_ERROR_SIZE];
        for (size_t i = 0; i < n; i++) /* constant, smooth, noise, and noise of few values */
            pixels[i] = (unsigned char)(pass % 4 == 0 ? 7 : pass % 4 == 1 ? i / 9 : pass % 4 == 2 ? random_bits(&random)
                : random_bits(&random) % 3 * 100);
        CHECK(png_encode(pixels, width, height, channels, &file, &size), "%dx%dx%d", width, height, channels);
        CHECK(png_decode(file, size, &back, shape, error), "%dx%dx%d: %s", width, height, channels, error);
        if (back)
            CHECK(shape[0] == width && shape[1] == height && shape[2] == channels && !memcmp(pixels, back, n),
                  "%dx%dx%d came back as %dx%dx%d", width, height, channels, shape[0], shape[1], shape[2]);
        free(pixels), free(file), free(back);
    }
}

/* A picture of 8 x 8 by another encoder (zlib, fixed Huffman codes), whose rows use the filters 0 1 2 3 4 4 4 4: a mistake that our
   encoder and decoder share cannot hide here. */
TEST(png_of_another_encoder_is_read) {
    static const unsigned char file[] = {
        137, 80,  78,  71,  13,  10,  26,  10,  0,   0,   0,   13,  73,  72,  68,  82,  0,   0,   0,   8,   0,   0,   0,   8,
        8,   2,   0,   0,   0,   75,  109, 41,  220, 0,   0,   0,   182, 73,  68,  65,  84,  120, 1,   99,  96,  152, 198, 96,
        180, 133, 33,  197, 6,   72,  131, 128, 145, 13,  67,  202, 22,  134, 105, 211, 24,  24,  167, 85,  48,  100, 201, 85,
        24,  117, 108, 48,  154, 86,  97,  196, 176, 33,  43,  107, 131, 81,  69,  133, 209, 163, 13,  76,  231, 30,  49,  76,
        123, 180, 225, 220, 35,  141, 115, 143, 110, 156, 123, 20,  48,  237, 17,  195, 57,  48,  151, 153, 129, 31,  104, 64,
        79,  74,  59,  195, 156, 203, 55,  24,  62,  110, 96,  168, 120, 147, 114, 164, 103, 206, 35,  6,   22,  160, 14,  6,
        134, 13,  12,  32,  181, 27,  178, 24,  2,   24,  30,  117, 48,  60,  218, 48,  237, 81,  0,   11,  80,  111, 22,  72,
        2,   136, 128, 246, 119, 100, 1,   213, 129, 216, 27,  88,  206, 1,   221, 224, 83,  145, 5,   226, 84,  0,   181, 130,
        244, 1,   25,  91,  54,  128, 141, 218, 178, 97,  90,  135, 70,  214, 163, 27,  12,  32,  163, 54,  76,  219, 2,   148,
        211, 0,   0,   219, 22,  87,  55,  37,  163, 196, 211, 0,   0,   0,   0,   73,  69,  78,  68,  174, 66,  96,  130};
    unsigned char *pixels = NULL;
    char error[FILE_ERROR_SIZE] = "";
    int shape[3] = {0, 0, 0};
    CHECK(png_decode(file, sizeof file, &pixels, shape, error) && shape[0] == 8 && shape[1] == 8 && shape[2] == 3, "%s", error);
    for (int j = 0; pixels && j < 8; j++)
        for (int i = 0; i < 8; i++) {
            const unsigned char *p = pixels + 3 * (8 * j + i);
            CHECK(p[0] == (i * 37 + j * 59) % 4 * 50 && p[1] == (i * i + j * 83 + 5) % 7 * 30 && p[2] == i * j * 3 % 5 * 40,
                  "pixel %d,%d: %d %d %d", i, j, p[0], p[1], p[2]);
        }
    free(pixels);
}

/* Noise cannot be packed, a constant picture must be: deflate's own limit is 1032 to 1. */
TEST(png_compresses) {
    unsigned char *pixels = (unsigned char *)calloc(300 * 300, 3), *file;
    size_t size;
    CHECK(png_encode(pixels, 300, 300, 3, &file, &size) && size < 1200, "%zu bytes for a black picture of 270000", size);
    free(file);
    for (size_t i = 0; i < 300 * 300 * 3; i++) pixels[i] = (unsigned char)((i / 3 % 300 + i / 900) / 4);
    CHECK(png_encode(pixels, 300, 300, 3, &file, &size) && size < 6000, "%zu bytes for a gradient of 270000", size);
    free(file), free(pixels);
}

/* Readers of hostile bytes: whatever is changed, they return, and under a sanitizer they return cleanly. */
static size_t mutate(test_random *random, const unsigned char *from, size_t size, unsigned char *to) {
    size_t n = size;
    memcpy(to, from, size);
    for (int k = 1 + (int)(random_bits(random) % 4); k; k--) {
        size_t at = random_bits(random) % n;
        switch (random_bits(random) % 4) {
        case 0: to[at] ^= (unsigned char)(1u << random_bits(random) % 8); break;
        case 1: to[at] = (unsigned char)random_bits(random); break;
        case 2: n = at + 1; break;
        default: to[at] = (unsigned char)("\xff\x00 -+9\n"[random_bits(random) % 7]); break;
        }
    }
    return n;
}

/* A run-length coded picture of 16 x 4 and its floats. */
static size_t make_hdr(unsigned char *file) {
    size_t n = (size_t)sprintf((char *)file, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 16\n");
    for (int y = 0; y < 4; y++) {
        file[n++] = 2, file[n++] = 2, file[n++] = 0, file[n++] = 16;
        for (int channel = 0; channel < 4; channel++) {
            file[n++] = 128 + 10, file[n++] = (unsigned char)(channel == 3 ? 129 : 100 + y);
            file[n++] = 6;
            for (int i = 0; i < 6; i++) file[n++] = (unsigned char)(channel == 3 ? 128 + i % 2 : 10 * channel + i);
        }
    }
    return n;
}

TEST(hdr_pixels_are_right) {
    unsigned char file[1024];
    hdr_image image = {NULL, 0, 0};
    char error[FILE_ERROR_SIZE];
    size_t n = make_hdr(file);
    CHECK(hdr_decode(file, n, &image, error), "%s", error);
    if (!image.rgb) return;
    CHECK(image.width == 16 && image.height == 4, "%dx%d", image.width, image.height);
    /* mantissa m, exponent e: m * 2^(e - 136); these are exact in float */
    CHECK(image.rgb[0] == 100.0f / 128 && image.rgb[3 * 16 * 3] == 103.0f / 128, "%g %g", (double)image.rgb[0],
          (double)image.rgb[3 * 16 * 3]);
    CHECK(image.rgb[3 * 11 + 1] == 11.0f / 128 && image.rgb[3 * 12 + 2] == 22.0f / 256, "%g %g", (double)image.rgb[3 * 11 + 1],
          (double)image.rgb[3 * 12 + 2]);
    free(image.rgb);
    {
        /* flat pixels, mirrored and upside down, exposure 2 */
        static const char flat[] = "#?RGBE\nEXPOSURE=2\n\n+Y 2 -X 2\n\x80\x40\x20\x81\x01\x02\x03\x80\x10\x20\x30\x80\x11\x12\x13\x00";
        CHECK(hdr_decode((const unsigned char *)flat, sizeof flat - 1, &image, error), "%s", error);
        CHECK(image.rgb[3 * 3] == 0.5f && image.rgb[3 * 3 + 1] == 0.25f && image.rgb[3 * 2] == 0.5f / 256, "%g", (double)image.rgb[9]);
        CHECK(image.rgb[3] == 8.0f / 256 && image.rgb[0] == 0, "%g %g", (double)image.rgb[3], (double)image.rgb[0]);
        free(image.rgb);
    }
}

TEST(hostile_hdr_and_png_bytes_are_survived) {
    unsigned char hdr[1024], bad[4096], *png, pixels[24 * 10 * 3];
    test_random random = {7};
    size_t hdr_size = make_hdr(hdr), png_size, refused = 0;
    char error[FILE_ERROR_SIZE];
    int rounds = LONG_SUITE ? 1000000 : 60000, shape[3];
    for (size_t i = 0; i < sizeof pixels; i++) pixels[i] = (unsigned char)(i % 7 * 30);
    CHECK(png_encode(pixels, 24, 10, 3, &png, &png_size) && png_size < sizeof bad, "%zu bytes", png_size);
    for (int i = 0; i < rounds; i++) {
        hdr_image image;
        unsigned char *out;
        size_t n = mutate(&random, hdr, hdr_size, bad);
        if (hdr_decode(bad, n, &image, error)) free(image.rgb);
        else refused++;
        n = mutate(&random, png, png_size, bad);
        if (png_decode(bad, n, &out, shape, error)) free(out);
        else refused++;
        /* past the checksums, into the decoder itself */
        if (n > 70) {
            png_source in;
            unsigned char raw[24 * 3 * 10 + 10];
            memset(&in, 0, sizeof in);
            in.data = bad + 8 + 25 + 13 + 8 + 2, in.size = n - 56;
            (void)png_inflate(&in, raw, sizeof raw);
        }
    }
    CHECK(refused > (size_t)rounds, "only %zu of %d were refused", refused, 2 * rounds);
    free(png);
}

TEST(raw_names_are_read) {
    size_t size[3];
    isogi_type type;
    char error[FILE_ERROR_SIZE];
    CHECK(volume_parse_name("/some/where/engine_256x255x128_uint8.raw", size, &type, error) && size[0] == 256 && size[1] == 255 &&
              size[2] == 128 && type == ISOGI_U8,
          "%s", error);
    CHECK(volume_parse_name("a_b_c_1x2x3_float64.raw", size, &type, error) && size[0] == 1 && size[1] == 2 && size[2] == 3 &&
              type == ISOGI_F64,
          "%s", error);
    CHECK(volume_parse_name("4x5x6_int16.raw", size, &type, error) && size[2] == 6 && type == ISOGI_I16, "%s", error);
    CHECK(!volume_parse_name("x_4x5x6_int16.raw.gz", size, &type, error), "a packed file passed");
    CHECK(!volume_parse_name(".raw", size, &type, error) && !volume_parse_name("_.raw", size, &type, error) &&
              !volume_parse_name("", size, &type, error),
          "nothing passed");
}

TEST(guessed_isovalue_parts_two_materials) {
    unsigned char voxels[4096];
    isogi_volume v;
    const double range[2] = {0, 255};
    double iso;
    for (size_t i = 0; i < 4096; i++) voxels[i] = (unsigned char)(i % 8 < 4 ? 0 : i % 8 < 6 ? 60 + i % 5 : 190 + i % 5);
    memset(&v, 0, sizeof v);
    v.data = voxels, v.size[0] = v.size[1] = v.size[2] = 16;
    iso = volume_guess_isovalue(&v, range);
    CHECK(iso > 64 && iso < 190, "%g", iso);
}

/* Masks have two values, however many voxels have either. */
TEST(guessed_isovalue_of_a_mask_is_halfway) {
    static const int values[3][2] = {{0, 1}, {0, 255}, {7, 9}};
    for (int n = 0; n < 9; n++) {
        const int low = values[n % 3][0], high = values[n % 3][1], every = n / 3 == 0 ? 2 : n / 3 == 1 ? 100 : 2000;
        const double range[2] = {low, high};
        unsigned char voxels[4096];
        isogi_volume v;
        memset(&v, 0, sizeof v);
        for (int i = 0; i < 4096; i++) voxels[i] = (unsigned char)(i % every ? low : high);
        v.data = voxels, v.size[0] = v.size[1] = v.size[2] = 16;
        double iso = volume_guess_isovalue(&v, range);
        CHECK(fabs(iso - 0.5 * (low + high)) <= 0.01 * (high - low), "%d and %d: %g", low, high, iso);
    }
}

/* A grid of triangles over the whole picture, with shared edges: every pixel is drawn, whatever the places of the corners. */
TEST(rasterizer_leaves_no_crack) {
    enum { n = 23 };
    static float positions[(n + 1) * (n + 1)][3];
    static uint32_t triangles[2 * n * n][3];
    static float inverse[200 * 150];
    static uint32_t seen[200 * 150];
    test_random random = {3};
    for (int pass = 0; pass < 40; pass++) {
        isogi_mesh mesh;
        camera view;
        const double eye[3] = {0, 0, 3}, target[3] = {0, 0, 0}, up[3] = {0, 1, 0};
        size_t holes = 0, count = 0, wrong = 0;
        memset(&mesh, 0, sizeof mesh);
        for (int j = 0; j <= n; j++)
            for (int i = 0; i <= n; i++) {
                float *p = positions[j * (n + 1) + i];
                int inner = i > 0 && j > 0 && i < n && j < n;
                p[0] = (float)(-3 + 6.0 * i / n + (inner ? random_range(&random, -0.12, 0.12) : 0));
                p[1] = (float)(-3 + 6.0 * j / n + (inner ? random_range(&random, -0.12, 0.12) : 0)), p[2] = 0;
            }
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) {
                uint32_t a = (uint32_t)(j * (n + 1) + i), b = a + 1, c = a + n + 1, d = c + 1;
                uint32_t one[3] = {a, b, d}, two[3] = {a, d, c};
                memcpy(triangles[count++], one, sizeof one), memcpy(triangles[count++], two, sizeof two);
            }
        mesh.positions = positions, mesh.triangles = triangles, mesh.vertex_count = (n + 1) * (n + 1), mesh.triangle_count = count;
        camera_look(&view, 200, 150, eye, target, up, 45);
        CHECK(raster_draw(&mesh, &view, 0.125, -0.375, NULL, 0, 0.01, inverse, seen, NULL) == ISOGI_OK, "pass %d", pass);
        for (int i = 0; i < 200 * 150; i++) holes += seen[i] == RASTER_NONE, wrong += fabs(1 / (double)inverse[i] - 3) > 1e-5;
        CHECK(!holes && !wrong, "pass %d: %zu pixels are empty, %zu have a wrong depth", pass, holes, wrong);
    }
}

/* Random triangles, some of them through the eye's plane, against a ray per pixel: Moeller and Trumbore in double. */
static double ray_triangle(const double o[3], const double d[3], const float a[3], const float b[3], const float c[3], double *margin) {
    double e1[3], e2[3], p[3], q[3], s[3], det, u, v;
    for (int i = 0; i < 3; i++) e1[i] = (double)b[i] - (double)a[i], e2[i] = (double)c[i] - (double)a[i], s[i] = o[i] - (double)a[i];
    vector_cross(d, e2, p), det = vector_dot(e1, p), u = vector_dot(s, p) / det;
    vector_cross(s, e1, q), v = vector_dot(d, q) / det;
    *margin = fmin(fmin(u, v), 1 - u - v);
    return vector_dot(e2, q) / det;
}

TEST(rasterizer_agrees_with_rays) {
    static float positions[60][3], inverse[64 * 48];
    static uint32_t triangles[20][3], seen[64 * 48];
    test_random random = {5};
    size_t compared = 0, wrong = 0;
    for (int pass = 0; pass < 50; pass++) {
        isogi_mesh mesh;
        camera view;
        const double eye[3] = {0.1, 0.2, 2}, target[3] = {0, 0, 0}, up[3] = {0, 1, 0};
        memset(&mesh, 0, sizeof mesh);
        for (int i = 0; i < 60; i++)
            for (int k = 0; k < 3; k++) positions[i][k] = (float)random_range(&random, -3, 3);
        for (uint32_t i = 0; i < 60; i++) triangles[i / 3][i % 3] = i;
        mesh.positions = positions, mesh.triangles = triangles, mesh.vertex_count = 60, mesh.triangle_count = 20;
        camera_look(&view, 64, 48, eye, target, up, 60);
        CHECK(raster_draw(&mesh, &view, 0, 0, NULL, 0, 0.05, inverse, seen, NULL) == ISOGI_OK, "pass %d", pass);
        for (int i = 0; i < 64 * 48; i++) {
            double d[3], nearest = 1e30, closest = 1;
            camera_direction(&view, i % 64, i / 64, d);
            for (int t = 0; t < 20; t++) {
                double margin, at = ray_triangle(eye, d, positions[3 * t], positions[3 * t + 1], positions[3 * t + 2], &margin);
                if (at > 0.03 && fabs(margin) < 0.02) closest = 0; /* too near an edge for places rounded to 1/256 pixel */
                if (at > 0.05 && margin > 0 && at < nearest) nearest = at;
                if (fabs(at - 0.05) < 0.02) closest = 0;
            }
            if (closest == 0) continue;
            compared++;
            if (nearest > 1e29 ? inverse[i] != 0 : fabs((double)inverse[i] * nearest - 1) > 0.02) wrong++;
        }
    }
    CHECK(compared > 30000, "only %zu pixels could be compared", compared);
    CHECK(wrong <= compared / 1000, "%zu of %zu pixels differ from rays", wrong, compared); /* grazing triangles move by more than 2 % */
}

TEST(camera_up_follows_the_standard_view_of_the_scenes) {
    /* bonsai is upside down: up -z takes the standard direction (1.5, 1.2, 2) to (1.5, 2, -1.2) */
    const double up[3] = {0, 0, -1}, other[3][3] = {{0, -1, 0}, {0.6, 0, 0.8}, {0.36, -0.48, 0.8}};
    double m[9], d[3] = {1.5, 1.2, 2.0};
    rotation_from_up(up, m);
    rotation_apply(m, d, d);
    CHECK(fabs(d[0] - 1.5) < 1e-12 && fabs(d[1] - 2) < 1e-12 && fabs(d[2] + 1.2) < 1e-12, "%g %g %g", d[0], d[1], d[2]);
    for (int k = 0; k < 3; k++) {
        double y[3] = {0, 1, 0}, x[3] = {1, 0, 0}, z[3] = {0, 0, 1}, cross[3];
        rotation_from_up(other[k], m);
        rotation_apply(m, x, x), rotation_apply(m, y, y), rotation_apply(m, z, z);
        vector_cross(x, y, cross);
        for (int i = 0; i < 3; i++)
            CHECK(fabs(y[i] - other[k][i]) < 1e-12 && fabs(cross[i] - z[i]) < 1e-12, "up %d: %g %g", k, y[i], cross[i]);
    }
}

TEST(procedural_volumes_hold_their_formulas) {
    for (size_t k = 0; k < PROCEDURAL_SHAPE_COUNT; k++) {
        const procedural_shape *shape = &procedural_shapes[k];
        isogi_volume v;
        double least = 1e300, most = -1e300;
        memset(&v, 0, sizeof v);
        CHECK(procedural_make(shape, 41, &v, NULL) == ISOGI_OK, "%s", shape->name);
        if (!v.data) continue;
        for (size_t i = 0; i < v.size[0] * v.size[1] * v.size[2]; i++) {
            double x = volume_voxel(&v, i);
            least = x < least ? x : least, most = x > most ? x : most;
        }
        CHECK(least < shape->isovalue && most > shape->isovalue, "%s: range %g to %g, isovalue %g", shape->name, least, most,
              shape->isovalue);
        procedural_free(&v);
    }
    {
        /* values that need no computer: the origin of Marschner-Lobb, a corner and a maximum of the gyroid, the orbital's lobe */
        const double origin[3] = {0, 0, 0}, corner[3] = {-1, -1, -1}, lobe[3] = {0, 0.3, 0}, rim[3] = {0.7, 0.3, 0};
        CHECK(fabs(procedural_marschner_lobb(origin, 0) - (1 + 0.25 * 2) / 2.5) < 1e-12, "%g", procedural_marschner_lobb(origin, 0));
        CHECK(fabs(procedural_gyroid(corner, 0)) < 1e-12, "%g", procedural_gyroid(corner, 0));
        CHECK(fabs(procedural_hydrogen(lobe, 0) - 1) < 1e-12, "%g", procedural_hydrogen(lobe, 0));
        CHECK(fabs(procedural_cavity(rim, 0)) < 1e-12, "%g", procedural_cavity(rim, 0));
    }
}

TEST(real_volumes_are_shown) {
    char *path = test_data("fuel_64x64x64_uint8.raw"), command[1024];
    run_result r;
    if (!path) SKIP("ISOGI_DATA is not set, or holds no fuel_64x64x64_uint8.raw");
    snprintf(command, sizeof command, "'%s' --size 64x64 --samples 8 --stats --out '%s'", path, temporary("fuel.png"));
    r = run_viewer(command);
    CHECK(r.status == 0 && strstr(r.output, "size 64x64x64"), "%d: %s", r.status, r.error);
    snprintf(command, sizeof command, "'%s' --mode dvr --shading local --size 64x64 --out '%s'", path, temporary("fuel.png"));
    r = run_viewer(command);
    CHECK(r.status == 0, "%d: %s", r.status, r.error);
    free(path);
}

/* A block of matter that fills its box is seen by its sections alone. */
TEST(fog_lies_over_sections_too) {
    unsigned char bytes[8 * 8 * 8];
    char command[1024], clear[256];
    run_result r;
    double difference = 0;
    const char *path = temporary("block_8x8x8_uint8.raw");
    memset(bytes, 200, sizeof bytes), bytes[0] = 0;
    write_bytes(path, bytes, sizeof bytes);
    strcpy(clear, temporary("clear.png"));
    snprintf(command, sizeof command, "'%s' --mode lambert --iso 100 --exposure 1 --size 32x32 --out '%s'", path, clear);
    r = run_viewer(command);
    CHECK(r.status == 0, "%d: %s", r.status, r.error);
    snprintf(command, sizeof command, "'%s' --mode lambert --iso 100 --exposure 1 --size 32x32 --fog 3 --compare '%s' --out '%s'", path,
             clear, temporary("fog.png"));
    r = run_viewer(command);
    CHECK(r.status == 0 && sscanf(r.output, "difference_rms %lf", &difference) == 1 && difference > 0.03, "%d: %s: %g", r.status, r.error,
          difference);
}

/* Where the box cuts matter its section is seen in the right places whatever the unit of values is, also where floats do not hold it. */
TEST(sections_do_not_depend_on_the_unit) {
    static const double scale[] = {1, 1e300, 1e39, 1e-46, 1e-300, 0.001}, shift[] = {0, 0, 0, 0, 0, 1e9};
    double value[7 * 7 * 7];
    char command[1024], unit[256];
    strcpy(unit, temporary("unit.png"));
    for (int k = 0; k < 6; k++) {
        double difference = k ? 1 : 0;
        for (int i = 0; i < 343; i++) {
            const double x = i % 7 - 3.0, y = i / 7 % 7 - 3.0, z = i / 49 - 3.0; /* a ball that the sides of the box cut */
            value[i] = scale[k] * (3.7 - sqrt(x * x + y * y + z * z)) / 8 + shift[k];
        }
        const char *path = temporary("ball_7x7x7_float64.raw");
        write_bytes(path, value, sizeof value);
        snprintf(command, sizeof command, "'%s' --mode lambert --iso %.17g --exposure 1 --size 64x64 %s%s%s --out '%s'", path, shift[k],
                 k ? "--compare '" : "", k ? unit : "", k ? "'" : "", k ? temporary("other.png") : unit);
        const run_result r = run_viewer(command);
        CHECK(r.status == 0, "%d: %s", r.status, r.error);
        CHECK((!k || sscanf(r.output, "difference_rms %lf", &difference) == 1) && difference < 0.005, "%g f + %g: %g", scale[k], shift[k],
              difference);
    }
}

/* A picture made with options, then the same compared with it. */
static run_result compared_with(const char *options, const char *then) {
    const char *first = temporary("first.png");
    char command[1024];
    snprintf(command, sizeof command, "procedural:gyroid:24 --mode lambert --size 64x48 %s --out '%s'", options, first);
    run_result r = run_viewer(command);
    CHECK(r.status == 0, "%d: %s", r.status, r.error);
    snprintf(command, sizeof command, "procedural:gyroid:24 --mode lambert --size 64x48 --compare '%s' %s --out '%s'", first, then,
             temporary("same.png"));
    return run_viewer(command);
}

/* A picture that is compared is as bright as the other one, whatever light it has. */
TEST(compared_pictures_have_the_same_mean) {
    double difference = 1, exposure = 0;
    run_result r = compared_with("--exposure 0.12", "--stats");
    CHECK(r.status == 0 && sscanf(strstr(r.output, "difference_rms"), "difference_rms %lf", &difference) == 1 && difference < 0.001 &&
              sscanf(strstr(r.output, "\nexposure"), " exposure %lf", &exposure) == 1 && fabs(exposure - 0.12) < 0.001,
          "%d: %s: difference %g, exposure %g", r.status, r.error, difference, exposure);
    r = compared_with("", "");
    CHECK(r.status == 0 && !strcmp(r.output, "difference_rms 0.000000\n"), "%d: %s: %s", r.status, r.error, r.output);
}

/* Under a sky that is the same everywhere ambient light is the same, constant or by normal, and a white surface is as bright as the sky,
   and as fog. */
SLOW_TEST(ambient_light_and_fog_are_the_sky) {
    static const char *const then[] = {"--ambient constant", "--ambient constant --fog 50"};
    const char *first = temporary("first.png");
    char command[1024];
    run_result r;
    snprintf(command, sizeof command, "--scene furnace --mode lambert --ambient normal --exposure 0.5 --size 48x48 --out '%s'", first);
    r = run_viewer(command);
    CHECK(r.status == 0, "%d: %s", r.status, r.error);
    for (int k = 0; k < 2; k++) {
        double difference = 1;
        snprintf(command, sizeof command, "--scene furnace --mode lambert %s --exposure 0.5 --size 48x48 --compare '%s' --out '%s'",
                 then[k], first, temporary("then.png"));
        r = run_viewer(command);
        CHECK(r.status == 0 && sscanf(r.output, "difference_rms %lf", &difference) == 1 && difference < 0.004, "%s: %d: %s: %g", then[k],
              r.status, r.error, difference);
    }
}

/* A row of one pixel in a block that is stored: filters 0 to 4 there are, and no others. */
TEST(unknown_filters_of_png_are_damage) {
    for (unsigned filter = 0; filter < 8; filter++) {
        static const unsigned char signature[8] = {137, 80, 78, 71, 13, 10, 26, 10};
        unsigned char file[128] = {0}, *p = file + 8, *pixels = NULL;
        char error[FILE_ERROR_SIZE] = "";
        int shape[3];
        memcpy(file, signature, 8);
        png_put32(p + 8, 1), png_put32(p + 12, 1), p[16] = 8, p[17] = 2;
        png_chunk(p, "IHDR", 13), p += 25;
        const unsigned char stored[11] = {0x78, 1, 1, 4, 0, 0xfb, 0xff, (unsigned char)filter, 10, 20, 30};
        memcpy(p + 8, stored, sizeof stored), png_put32(p + 19, png_adler(stored + 7, 4));
        png_chunk(p, "IDAT", 15), p += 27;
        png_chunk(p, "IEND", 0), p += 12;
        const int read = png_decode(file, (size_t)(p - file), &pixels, shape, error);
        CHECK(read == (filter < 5), "filter %u: %d, %s", filter, read, error);
        CHECK(read ? pixels[0] == 10 && pixels[1] == 20 && pixels[2] == 30 : strstr(error, "damaged") != NULL, "filter %u: %s", filter,
              error);
        if (read) free(pixels);
    }
}

/* What a scene is made of is kept, too: its volume, and its environment. */
TEST(data_of_scenes_is_not_overwritten) {
    static const char *const bad[][2] = {{"--scene fuel --out '%s/fuel_64x64x64_uint8.raw'", "--out: %s/fuel_64x64x64_uint8.raw"},
                                         {"--scene fuel --out '%s/never.png' --depth '%s/./fuel_64x64x64_uint8.raw'", "--depth: "},
                                         {"--scene engine --out '%s/grace_256x128.hdr'", "is the file of --scene"}};
    static unsigned char zero[64 * 64 * 64];
    const char *volume = temporary("fuel_64x64x64_uint8.raw"), *given = getenv("ISOGI_DATA");
    char command[1024], say[512], path[512], *kept = given ? strdup(given) : NULL;
    struct stat status;
    write_bytes(volume, zero, sizeof zero);
    snprintf(path, sizeof path, "%s/hdr", folder), mkdir(path, 0777);
    write_bytes(temporary("grace_256x128.hdr"), zero, 100);
    snprintf(path, sizeof path, "%s/hdr/grace_256x128.hdr", folder);
    CHECK(symlink("../grace_256x128.hdr", path) == 0, "%s", path);
    setenv("ISOGI_DATA", folder, 1);
    for (size_t i = 0; i < 3; i++) {
        snprintf(command, sizeof command, bad[i][0], folder, folder), snprintf(say, sizeof say, bad[i][1], folder);
        check_refused(command, say);
    }
    if (kept) setenv("ISOGI_DATA", kept, 1);
    else unsetenv("ISOGI_DATA");
    free(kept);
    CHECK(stat(volume, &status) == 0 && status.st_size == (off_t)sizeof zero, "%s was overwritten", volume);
    CHECK(stat(path, &status) == 0 && status.st_size == 100, "%s was overwritten", path);
}

TEST_MAIN("viewer")
