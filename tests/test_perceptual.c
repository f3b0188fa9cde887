/* The metric that tells how many pixels of two pictures look different: perceptual.h. */
#include "test.h"
#include "perceptual.h"

enum { W = 96, H = 64 };
static float a[W * H][3], b[W * H][3];
static int rows = H;

static void grey(float x) {
    for (int i = 0; i < W * H; i++) a[i][0] = a[i][1] = a[i][2] = b[i][0] = b[i][1] = b[i][2] = x;
}

static double seen(double detection) { return perceptual_difference((const float(*)[3])a, (const float(*)[3])b, W, rows, 10, detection); }

TEST(the_same_picture_shows_no_difference) {
    test_random r = {1};
    for (int i = 0; i < W * H; i++)
        for (int c = 0; c < 3; c++) a[i][c] = b[i][c] = (float)random_unit(&r);
    CHECK(seen(0.75) <= 0, "%g", seen(0.75));
    b[7][1] = b[7][1] > 0.5f ? 0 : 1;
    CHECK(seen(0.75) > 0 && seen(0.75) < 0.02, "one pixel: %g", seen(0.75));
}

/* In a uniform field: 10^-1.255 of the luminance in the light (Weber's law), times (ln 4)^(1/3.5) for 75 %; a larger share in the dark. */
TEST(a_uniform_difference_is_seen_from_its_threshold_on) {
    double last = 0;
    rows = 2;
    for (double x = 0.02; x < 0.95; x += 0.15) {
        double low = 0, high = 0.1, linear[2];
        for (int n = 0; n < 16; n++) {
            double middle = 0.5 * (low + high);
            grey((float)x);
            for (int i = 0; i < W * rows; i++)
                for (int c = 0; c < 3; c++) b[i][c] = (float)(x + middle);
            if (seen(0.75) > 0.5) high = middle;
            else low = middle;
        }
        for (int n = 0; n < 2; n++) linear[n] = x + n * high <= 0.04045 ? (x + n * high) / 12.92 : pow((x + n * high + 0.055) / 1.055, 2.4);
        double share = linear[1] / linear[0] - 1;
        CHECK(share > 0.05 && share < 0.9 && (!last || share < 1.3 * last), "at %g: %g of the luminance is seen, darker %g", x, share,
              last);
        last = share;
    }
    rows = H;
    CHECK(fabs(last - pow(10, -1.255) * pow(log(4), 1 / 3.5)) < 0.01, "in the light %g of the luminance is seen", last);
}

TEST(a_difference_is_the_rarer_the_surer_it_has_to_be) {
    test_random r = {2};
    double last = 1;
    grey(0.5f);
    for (int i = 0; i < W * H; i++)
        for (int c = 0; c < 3; c++) b[i][c] += (float)random_range(&r, -0.05, 0.05);
    for (double detection = 0.1; detection < 0.99; detection += 0.1) {
        double now = seen(detection);
        CHECK(now <= last, "%g at %g", now, detection);
        last = now;
    }
    CHECK(last > 0 && last < 0.9, "%g", last);
}

TEST(texture_hides_what_a_plain_field_shows) {
    double share[2];
    for (int texture = 0; texture < 2; texture++) {
        grey(0.5f);
        for (int i = 0; i < W * H; i++) {
            float wave = texture ? 0.2f * (float)sin(2.1 * (i % W)) * (float)sin(2.3 * (i / W)) : 0;
            for (int c = 0; c < 3; c++) a[i][c] += wave, b[i][c] += wave + 0.06f;
        }
        share[texture] = seen(0.75);
    }
    CHECK(share[0] >= 1 && share[1] < 0.3, "%g in a plain field, %g in a texture", share[0], share[1]);
}

TEST_MAIN("perceptual")
