/* Isolines on a slice (Kraus 2005, figure 1a): build/isolines SHAPE LINES LOW HIGH OUT.png

   The slice z = middle of a procedural volume; LINES equidistant isovalues from LOW to HIGH, each two pixels wide wherever the field
   is steep or flat: the distance to a line is the difference of value over the gradient. Dense lines are steep data, which standard
   volume rendering shows as the less opaque surface. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "option_text.h"
#include "picture.h"
#include "png.h"
#include "procedural.h"
#include <stdlib.h>

enum { SIDE = 512 };
static unsigned char picture[SIDE][SIDE][3];
static float points[SIDE][3], values[SIDE], gradients[SIDE][3];

int main(int argc, char **argv) {
    const procedural_shape *shape = argc == 6 ? procedural_find(argv[1]) : NULL;
    isogi_volume volume;
    isogi_pyramid *pyramid = NULL;
    char error[FILE_ERROR_SIZE];
    if (!shape) return fprintf(stderr, "usage: %s SHAPE LINES LOW HIGH OUT.png\n", argv[0]), 2;
    double lines, low, high, gap;
    if (!whole_numbers(argv[2], ',', 1, 1, 1000, &lines) || !numbers(argv[3], ',', 1, -1e9, 1e9, &low) ||
        !numbers(argv[4], ',', 1, -1e9, 1e9, &high) || !(gap = (high - low) / (lines > 1 ? lines - 1 : 1), gap > 1e-9))
        return fprintf(stderr, "isolines: LINES is 1 to 1000, LOW is a number below HIGH\n"), 1;
    isogi_result result = procedural_make(shape, 0, &volume, NULL);
    if (result == ISOGI_OK) result = isogi_vol_build(&pyramid, &volume, NULL);
    if (result != ISOGI_OK) return fprintf(stderr, "isolines: %s\n", isogi_result_string(result)), 1;
    const size_t side = volume.size[0] > volume.size[1] ? volume.size[0] : volume.size[1];
    double pixel = (double)(side - 1) / SIDE;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            points[x][0] = (float)((x + 0.5) * pixel), points[x][1] = (float)((SIDE - y - 0.5) * pixel);
            points[x][2] = 0.5f * (float)(volume.size[2] - 1);
        }
        if (isogi_vol_sample(pyramid, (const float(*)[3])points, SIDE, values, gradients) != ISOGI_OK) return 1;
        for (int x = 0; x < SIDE; x++) {
            double level = floor(((double)values[x] - low) / gap + 0.5),
                   slope = sqrt((double)(gradients[x][0] * gradients[x][0] + gradients[x][1] * gradients[x][1]));
            level = level > 0 ? level < lines - 1 ? level : lines - 1 : 0;
            double away = fabs((double)values[x] - low - level * gap) / (slope > 1e-12 ? slope : 1e-12) / pixel; /* in pixels */
            double ink = away < 0.5 ? 1 : away < 1.5 ? 1.5 - away : 0, warm = lines > 1 ? level / (lines - 1) : 0;
            const double colour[3] = {0.1 + 0.7 * warm, 0.15, 0.7 - 0.6 * warm};
            for (int c = 0; c < 3; c++) picture[y][x][c] = picture_srgb(0.9 + ink * (colour[c] - 0.9));
        }
    }
    if (!png_write(argv[5], picture[0][0], SIDE, SIDE, 3, error)) return fprintf(stderr, "isolines: %s\n", error), 1;
    isogi_vol_free(pyramid), procedural_free(&volume);
    return 0;
}
