/* How isogi_trace.h keeps numbers in few bits, and draws directions. This program looks inside isogi_trace.h. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

/* Within half a step of the largest channel, over all magnitudes; what was unpacked packs to itself; never NaN, never infinite. */
TEST(rgb9e5_is_within_half_a_step) {
    test_random r = {3};
    for (int i = 0; i < (LONG_SUITE ? 1000000 : 100000); i++) {
        float rgb[3], back[3], again[3];
        double most = 0;
        for (int c = 0; c < 3; c++)
            rgb[c] = (float)(ldexp(random_unit(&r), (int)random_range(&r, -30, 17))), most = fmax(most, (double)rgb[c]);
        if (i % 100 == 0) rgb[0] = i % 200 ? (float)nan_value() : -1, most = fmax((double)rgb[1], (double)rgb[2]);
        uint32_t packed = isogi_trace__to_rgb9e5(rgb);
        isogi_trace__from_rgb9e5(packed, back);
        double step = fmax(most / 255.5, 1.0 / 16777216); /* 511.5 steps and more round up to the next exponent */
        for (int c = 0; c < 3; c++) {
            double x = rgb[c] > 0 ? fmin((double)rgb[c], 65408) : 0;
            if (c == 0 && i % 100 == 0) x = 0;
            CHECK(back[c] >= 0 && (double)back[c] <= 65408 && fabs((double)back[c] - x) <= 0.5 * step * 1.0000001, "%g of %g: %g", x, most,
                  (double)back[c]);
        }
        isogi_trace__from_rgb9e5(isogi_trace__to_rgb9e5(back), again);
        CHECK(!memcmp(back, again, sizeof back), "%g becomes %g", (double)back[0], (double)again[0]);
    }
}

TEST(errors_are_kept_rounded_up) {
    test_random r = {4};
    for (int i = 0; i < 10000; i++) {
        float x = (float)ldexp(random_unit(&r), (int)random_range(&r, -40, 40)),
              y = isogi_trace__bits_float(isogi_trace__to_short(x) << 16);
        CHECK(y >= x && (double)y <= (double)x * (1 + 1.0 / 127), "%g is kept as %g", (double)x, (double)y);
    }
    CHECK(isogi_trace__to_short(0) == 0 && isogi_trace__to_short(HUGE_VALF) == 0x7f80 && isogi_trace__to_short(3.4e38f) == 0x7f80,
          "ends, %d", 0);
}

/* What directions are drawn by: against the functions of <math.h>, and against the definition of the sequence. */
TEST(circle_is_that_of_cos_and_sin) {
    for (int i = 0; i <= 40000; i++) {
        double u = i / 40000.0, c, s;
        isogi_trace__circle(u, &c, &s);
        CHECK(fabs(c - cos(2 * PI * u)) < 1e-11 && fabs(s - sin(2 * PI * u)) < 1e-11, "%g: %.15g %.15g", u, c, s);
    }
}

/* Without a scramble: u[0] is the radical inverse in base 2; u[1] is made of columns each of which is the one before, plus itself shifted
   by one (the second dimension of Sobol's sequence). */
TEST(sobol_is_that_of_its_columns) {
    const isogi_trace__sequence plain = {{0, 0}};
    for (uint32_t i = 0; i < 5000; i++) {
        uint32_t index = i < 4096 ? i : i * 2654435761u, first = 0, second = 0, column = 0x80000000u;
        double u[2], v[2];
        for (uint32_t rest = index, bit = 0x80000000u; rest; rest >>= 1, bit >>= 1, column ^= column >> 1)
            if (rest & 1) first |= bit, second ^= column;
        isogi_trace__sobol(&plain, index, u);
        v[0] = isogi_trace__scramble(isogi_trace__reverse(first), 0), v[1] = isogi_trace__scramble(isogi_trace__reverse(second), 0);
        CHECK(!memcmp(u, v, sizeof u), "%u: %g %g, expected %g %g", index, u[0], u[1], v[0], v[1]);
    }
}

TEST_MAIN("trace_inside")
