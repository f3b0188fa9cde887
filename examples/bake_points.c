/* Draws a knot of tubes as text, lit by the sky and by what it reflects itself: one bake of the points that are seen. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include <math.h>
#include <stdio.h>

enum { N = 64, WIDTH = 76, HEIGHT = 38 };
static float data[N][N][N], knot[315][3], points[WIDTH * HEIGHT][3], light[WIDTH * HEIGHT][3];

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    for (int k = 0; k < 315; k++) { /* a trefoil knot */
        float t = 0.02f * (float)k;
        knot[k][0] = 9 * (sinf(t) + 2 * sinf(2 * t)), knot[k][1] = 9 * (cosf(t) - 2 * cosf(2 * t)), knot[k][2] = -9 * sinf(3 * t);
    }
    for (int i = 0; i < N * N * N; i++) { /* minus the squared distance to it */
        float nearest = 1e9f, x = (float)(i % N) - 31.5f, y = (float)(i / N % N) - 31.5f, z = (float)(i / N / N) - 31.5f;
        for (int k = 0; k < 315; k++) {
            float dx = x - knot[k][0], dy = y - knot[k][1], dz = z - knot[k][2], d = dx * dx + dy * dy + dz * dz;
            nearest = d < nearest ? d : nearest;
        }
        data[i / N / N][i / N % N][i % N] = -nearest;
    }
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_pyramid *pyramid = NULL;
    size_t count = 0, pixel[WIDTH * HEIGHT] = {0};
    if (isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) return 1;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        isogi_ray ray = {.origin = {i % WIDTH * 63.0 / WIDTH, 63 - i / WIDTH * 63.0 / HEIGHT, 80}, .dir = {0, 0, -1}, .isovalue = -30};
        isogi_hit hit = {0};
        isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
        isogi_vol_positions(pyramid, &hit, 1, &points[count]);
        if (hit.side) pixel[i] = ++count;
    }
    isogi_light sun = {.vector = {1, 1, 1}, .rgb = {2, 2, 2}, .radius = 0.1f};
    float sky[12] = {1.6f, 1.6f, 1.6f, 0.8f, 0.8f, 0.8f}; /* brighter above */
    isogi_trace_desc desc = {
        .pyramid = pyramid, .lighting = {{.sh = sky, .sh_order = 2}, &sun, 1}, .albedo = {0.7f, 0.7f, 0.7f}, .bounces = -1};
    isogi_result result = isogi_trace_gather(&desc, (const float (*)[3])points, NULL, count, light, NULL, NULL);
    for (int i = 0; i < WIDTH * HEIGHT && result == ISOGI_OK; i++) {
        int shade = pixel[i] ? (int)(3.2f * light[pixel[i] - 1][0]) : 0;
        printf("%c%s", pixel[i] ? ".,:;-=+*oO#%@"[shade < 12 ? shade : 12] : ' ', i % WIDTH == WIDTH - 1 ? "\n" : "");
    }
    isogi_vol_free(pyramid);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
