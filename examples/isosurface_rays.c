/* Draws three isosurfaces of one volume as text, each by a ray for every character: no mesh, nothing rebuilt in between. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include <stdio.h>

enum { N = 48, WIDTH = 48, HEIGHT = 24 };
static float data[N][N][N];

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    /* two metaballs */
    for (int z = 0; z < N; z++)
        for (int y = 0; y < N; y++)
            for (int x = 0; x < N; x++) {
                float a = (float)((x - 17) * (x - 17) + (y - 20) * (y - 20) + (z - 24) * (z - 24));
                float b = (float)((x - 31) * (x - 31) + (y - 27) * (y - 27) + (z - 24) * (z - 24));
                data[z][y][x] = 60 / (a + 1) + 60 / (b + 1);
            }
    isogi_volume volume = {.data = data, .type = ISOGI_F32, .size = {N, N, N}};
    isogi_pyramid *pyramid = NULL;
    isogi_result result = isogi_vol_build(&pyramid, &volume, NULL);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;
    for (int row = 0; row < HEIGHT; row++, putchar('\n'))
        for (int column = 0; column < 3 * WIDTH; column++) {
            const double isovalue[3] = {0.45, 0.8, 2};
            isogi_ray ray = {.dir = {0, 0, -1}, .isovalue = isovalue[column / WIDTH]};
            isogi_hit hit = {0};
            float normal[1][3];
            ray.origin[0] = column % WIDTH, ray.origin[1] = N - 2.0 * row, ray.origin[2] = N;
            isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
            isogi_vol_normals(pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal);
            float light = 0.5f * normal[0][0] + 0.6f * normal[0][1] + 0.6f * normal[0][2];
            putchar(hit.side ? ".:-=+*#%@"[(int)(light > 0 ? light * 8.9f : 0)] : ' ');
        }
    isogi_vol_free(pyramid);
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
