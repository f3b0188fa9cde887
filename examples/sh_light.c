/* A sky with a sun, projected to spherical harmonics, turned through a day: what light falls on a white ball, drawn as text. */
#define ISOGI_IMPLEMENTATION
#include "isogi_sh.h"
#include <math.h>
#include <stdio.h>

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    static float sky[64 * 128 * 3];
    for (int i = 0; i < 64 * 128; i++) { /* rows of an equirectangular image, zenith first: blue sky, brown ground */
        float up = cosf(3.14159265f * ((float)(i / 128) + 0.5f) / 64);
        for (int k = 0; k < 3; k++) sky[3 * i + k] = up > 0 ? 0.3f + 0.2f * (float)k * up : 0.15f - 0.04f * (float)k;
    }
    isogi_light sun = {.vector = {1, 0.25f, 0.3f}, .rgb = {4, 3.5f, 3}, .radius = 0.005f}; /* low in the east */
    isogi_lighting lighting = {.env = {.rgb = sky, .width = 128, .height = 64}};
    float day[3 * 25], light[3 * 25], sunlight[3 * 25];
    if (isogi_sh_project(day, 5, &lighting, NULL) != ISOGI_OK) return 1;
    lighting = (isogi_lighting){.lights = &sun, .light_count = 1};
    if (isogi_sh_project(sunlight, 5, &lighting, NULL) != ISOGI_OK) return 1;

    for (int hour = 0; hour < 3; hour++) {
        float m[9], axis[3] = {-0.3f, 0, 1}, direction[3], rgb[3];
        isogi_sh_matrix_from_axis_angle(m, axis, 0.9 * hour);
        isogi_sh_rotate(light, sunlight, 5, 3, m); /* the sun moves, the sky stays */
        isogi_sh_add(light, light, day, 5, 3);
        isogi_sh_dominant_direction(direction, rgb, light, 5);
        isogi_sh_convolve_cosine(light, light, 5, 3);
        printf("\n    light mostly from (%.2f %.2f %.2f), (%.1f %.1f %.1f) of it\n\n", (double)direction[0], (double)direction[1],
               (double)direction[2], (double)rgb[0], (double)rgb[1], (double)rgb[2]);
        for (int row = 0; row < 22; row++, putchar('\n'))
            for (int column = 0; column < 48; column++) {
                float x = ((float)column - 23.5f) / 22, y = (10.5f - (float)row) / 10.5f, z = 1 - x * x - y * y,
                      normal[1][3] = {{x, y, sqrtf(z > 0 ? z : 0)}};
                isogi_sh_eval_sum(rgb, light, 5, 3, (const float(*)[3])normal, 1);
                putchar(z > 0 ? " .:-=+*#%@"[rgb[1] <= 0 ? 0 : rgb[1] >= 5 ? 9 : (int)(2 * rgb[1])] : ' ');
            }
    }
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
