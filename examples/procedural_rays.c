/* Draws a surface that nobody has sampled, as text: rays against a function and its gradient, without voxels and without a step size. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include <math.h>
#include <stdio.h>

enum { WIDTH = 96, HEIGHT = 44 };

/* The gyroid within a ball, blended smoothly: g - 4 max(0, |p|^2 - 1)^2, g = sin x cos y + sin y cos z + sin z cos x at x = 5 p. */
static double gyroid(void *user, const double p[3], double gradient[3]) {
    const double k = *(const double *)user, x = k * p[0], y = k * p[1], z = k * p[2];
    double beyond = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1;
    if (beyond < 0) beyond = 0;
    gradient[0] = k * (cos(x) * cos(y) - sin(z) * sin(x)) - 16 * beyond * p[0];
    gradient[1] = k * (cos(y) * cos(z) - sin(x) * sin(y)) - 16 * beyond * p[1];
    gradient[2] = k * (cos(z) * cos(x) - sin(y) * sin(z)) - 16 * beyond * p[2];
    return sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x) - 4 * beyond * beyond;
}

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    double k = 5;
    /* Second derivatives: 4 k^2 of the gyroid (2 on and 1 off the diagonal), 16 beyond + 32 |p|^2 of the rest, in |p|^2 <= 3 * 1.3^2. */
    isogi_field field = {
        .value = gyroid, .user = &k, .hessian = 4 * 25 + 16 * 4.07 + 32 * 5.07, .low = {-1.3, -1.3, -1.3}, .high = {1.3, 1.3, 1.3}};
    isogi_pyramid *pyramid = NULL;
    isogi_counters counters = {0};
    isogi_result result = isogi_vol_build_field(&pyramid, &field, NULL);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;
    for (int row = 0; row < HEIGHT; row++, putchar('\n'))
        for (int column = 0; column < WIDTH; column++) {
            isogi_ray ray = {.origin = {2, 1, 3}, .dir = {-0.53f, -0.27f, -0.8f}, .isovalue = 0.2};
            isogi_hit hit = {0};
            float normal[1][3];
            double across = 2.9 * (column + 0.5) / WIDTH - 1.45, up = 1.45 - 2.9 * (row + 0.5) / HEIGHT;
            ray.origin[0] += 0.83 * across - 0.15 * up, ray.origin[1] += 0.96 * up, ray.origin[2] += -0.55 * across - 0.23 * up;
            isogi_vol_intersect(pyramid, &ray, 1, &hit, &counters);
            isogi_vol_normals(pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal);
            float light = 0.2f * normal[0][0] + 0.7f * normal[0][1] + 0.6f * normal[0][2];
            putchar(hit.side ? ".:-=+*#%@"[(int)(light > 0 ? light * 8.9f : 0)] : ' ');
        }
    printf("%.0f calls of the function for each of %d rays\n", (double)counters.cubics / (WIDTH * HEIGHT), WIDTH * HEIGHT);
    isogi_vol_free(pyramid);
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
