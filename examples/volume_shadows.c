/* A ring of fog above a floor, as text (a character stands for 1x2 pixels), shaded in three ways: as it glows, by its gradient, and with
   shadows. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include <math.h>
#include <stdio.h>

enum { N = 48, WIDTH = 52, HEIGHT = 44 };
static float data[N][N][N], image[3][HEIGHT][WIDTH][4];

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    for (int z = 0; z < N; z++)
        for (int y = 0; y < N; y++)
            for (int x = 0; x < N; x++) {
                float u = (float)(x - 24), v = (float)(y - 27), w = (float)(z - 24), out = sqrtf(u * u + 0.4f * v * v + w * w) - 14;
                float ring = 1.3f - sqrtf(out * out + v * v) / 6, floor = 1.3f - (float)y / 4;
                data[z][y][x] = ring > floor ? ring : floor;
            }
    const isogi_transfer_point points[] = {{0.3, {1, 1, 1}, 0}, {0.6, {1, 1, 1}, 0.9f}};
    const isogi_transfer transfer = {.points = points, .point_count = 2};
    const isogi_light sun = {.vector = {0.7f, 2, -0.3f}, .rgb = {6, 6, 6}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    const isogi_view view = {.width = WIDTH, .height = HEIGHT, .eye = {24, 75, 95}, .target = {24, 17, 24}, .fov = 32};
    const isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_dvr_desc desc = {.order = 4, .directions = 128};
    isogi_pyramid *pyramid = NULL;
    if (isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) return 1;
    for (int i = 0; i < 3; i++) {
        const isogi_dvr_shading shading[3] = {ISOGI_DVR_UNLIT, ISOGI_DVR_LOCAL, ISOGI_DVR_VISIBILITY};
        isogi_dvr *dvr = NULL;
        desc.pyramid = pyramid, desc.shading = shading[i];
        if (isogi_dvr_create(&dvr, &desc, NULL) || isogi_dvr_set_transfer(dvr, &transfer) || isogi_dvr_step(dvr, 0, NULL)) return 1;
        if (isogi_dvr_render(dvr, &view, &lighting, image[i][0], NULL, NULL)) return 1;
        isogi_dvr_free(dvr);
    }
    for (int row = 0; row < HEIGHT; row += 2, putchar('\n'))
        for (int i = 0; i < 3; i++)
            for (int x = 0; x < WIDTH; x++) putchar(" .:-=+*#%@"[(int)(9.99f * fminf(sqrtf(0.5f * image[i][row][x][0]), 1))]);
    isogi_vol_free(pyramid);
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
