/* Draws marbles on a table as text, lit by sky, sun and each other, of a formula that nobody has sampled: isogi_trace_gather_field asks a
   function of yours what its rays meet; here, the rays of isogi_vol_build_field. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { WIDTH = 84, HEIGHT = 34, MARBLES = 3, SHARP = 9 };
static float points[WIDTH * HEIGHT][3], normals[WIDTH * HEIGHT][3], light[WIDTH * HEIGHT][3];

/* Sum of exp(-SHARP d^2), d: distance to the table and to the middle of each marble. */
static double marbles(void *user, const double p[3], double gradient[3]) {
    double sum = exp(-SHARP * (p[1] + 0.8) * (p[1] + 0.8));
    (void)user, gradient[0] = gradient[2] = 0, gradient[1] = -2 * SHARP * (p[1] + 0.8) * sum;
    for (int i = 0; i < MARBLES; i++) {
        const double turn = 6.2832 / MARBLES * i, d[3] = {p[0] - 0.5 * sin(turn), p[1] + 0.3, p[2] - 0.5 * cos(turn)};
        const double one = 1.2 * exp(-SHARP * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
        for (int a = 0; a < 3; a++) gradient[a] -= 2 * SHARP * d[a] * one;
        sum += one;
    }
    return sum;
}

/* What isogi_trace asks; user: the field's pyramid. */
static void meet(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    for (size_t i = 0; i < count; i++) {
        isogi_ray ray = rays[i];
        isogi_hit hit;
        ray.isovalue = 0.7;
        isogi_vol_intersect((const isogi_pyramid *)user, &ray, 1, &hit, NULL);
        isogi_vol_normals((const isogi_pyramid *)user, &hit, 1, ISOGI_NORMAL_SMOOTH, &surfaces[i].normal);
        surfaces[i].t = hit.side ? hit.t : 0;
    }
}

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    /* Second derivatives: at most 2 SHARP of the table and 1.2 times as much of each marble. */
    isogi_field field = {.value = marbles, .hessian = 2 * SHARP * (1 + 1.2 * MARBLES), .low = {-2, -1.5, -2}, .high = {2, 1, 2}};
    isogi_light sun = {.vector = {1, 1.2f, 0.6f}, .rgb = {2, 2, 2}, .radius = 0.1f};
    float sky[12] = {1.6f, 1.6f, 1.6f, 0.8f, 0.8f, 0.8f}; /* brighter above */
    isogi_trace_desc desc = {
        .lighting = {{.sh = sky, .sh_order = 2}, &sun, 1}, .albedo = {0.7f, 0.7f, 0.7f}, .bounces = 2, .samples = 16, .offset = 1e-4f};
    isogi_pyramid *pyramid = NULL;
    size_t count = 0, pixel[WIDTH * HEIGHT] = {0};
    isogi_result result = isogi_vol_build_field(&pyramid, &field, NULL);
    for (int i = 0; i < WIDTH * HEIGHT && result == ISOGI_OK; i++) {
        double across = 3 * (i % WIDTH + 0.5) / WIDTH - 1.5, up = 0.9 - 2.3 * (i / WIDTH + 0.5) / HEIGHT;
        isogi_ray ray = {.origin = {across, 0.8 * up + 1.8, 2.4 - 0.6 * up}, .dir = {0, -0.6f, -0.8f}};
        isogi_trace_surface seen = {0};
        meet(pyramid, &ray, 1, &seen);
        if (!(seen.t > 0)) continue;
        for (int a = 0; a < 3; a++) points[count][a] = (float)(ray.origin[a] + seen.t * (double)ray.dir[a]);
        memcpy(normals[count], seen.normal, sizeof seen.normal);
        pixel[i] = ++count;
    }
    if (result == ISOGI_OK)
        result = isogi_trace_gather_field(&desc, meet, pyramid, (const float(*)[3])points, (const float(*)[3])normals, count, light,
                                          NULL, NULL);
    for (int i = 0; i < WIDTH * HEIGHT && result == ISOGI_OK; i++) {
        int shade = pixel[i] ? (int)(2.8f * light[pixel[i] - 1][0]) : 0;
        printf("%c%s", pixel[i] ? ".,:;-=+*oO#%@"[shade < 12 ? shade : 12] : ' ', i % WIDTH == WIDTH - 1 ? "\n" : "");
    }
    isogi_vol_free(pyramid);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
