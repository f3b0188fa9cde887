/* Pictures of one height beside each other: build/strip OUT.png A.png B.png ... */
#include "png.h"

int main(int argc, char **argv) {
    enum { GAP = 4, MOST = 16 };
    char error[FILE_ERROR_SIZE], why[FILE_ERROR_SIZE];
    unsigned char *pixels[MOST], *file = NULL, *strip;
    int shape[MOST][3], width = -GAP, count = argc - 2, ok;
    size_t size = 0;
    if (count < 1 || count > MOST) return fprintf(stderr, "usage: %s OUT.png A.png B.png ..., at most %d\n", argv[0], MOST), 2;
    for (int i = 0; i < count; i++) {
        const char *path = argv[i + 2];
        if (file_same(argv[1], path)) return fprintf(stderr, "strip: %s is both a picture and the strip\n", path), 1;
        if (!file_read(path, (size_t)1 << 28, &file, &size, error)) return fprintf(stderr, "strip: %s\n", error), 1;
        ok = png_decode(file, size, &pixels[i], shape[i], why), free(file);
        if (!ok) return fprintf(stderr, "strip: %s: %s\n", path, why), 1;
        if (shape[i][2] != 3) return fprintf(stderr, "strip: %s: has an alpha channel; RGB is needed\n", path), 1;
        if (shape[i][1] != shape[0][1])
            return fprintf(stderr, "strip: %s: is %d pixels high, the first %d\n", path, shape[i][1], shape[0][1]), 1;
        width += shape[i][0] + GAP;
    }
    strip = (unsigned char *)malloc((size_t)width * (size_t)shape[0][1] * 3);
    if (!strip) return fprintf(stderr, "strip: out of memory\n"), 1;
    memset(strip, 255, (size_t)width * (size_t)shape[0][1] * 3);
    for (int y = 0; y < shape[0][1]; y++)
        for (int i = 0, x = 0; i < count; x += shape[i++][0] + GAP) {
            size_t row = (size_t)shape[i][0] * 3;
            memcpy(strip + 3 * ((size_t)y * (size_t)width + (size_t)x), pixels[i] + row * (size_t)y, row);
        }
    if (!png_write(argv[1], strip, width, shape[0][1], 3, error)) return fprintf(stderr, "strip: %s\n", error), 1;
    for (int i = 0; i < count; i++) free(pixels[i]);
    return free(strip), 0;
}
