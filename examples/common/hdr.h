/* hdr.h - Radiance RGBE images (.hdr, .pic), run-length coded or flat, into linear float RGB

   The header's sizes are checked against the file's length before any memory is taken. Orientations -Y +X (rows from top to
   bottom) and its three mirror images are read; images stored by columns and XYZE colours are refused by name. */
#ifndef HDR_H
#define HDR_H

#include "files.h"
#include <math.h>

typedef struct hdr_image {
    float *rgb; /* [height][width][3], row 0 on top */
    int width, height;
} hdr_image;

enum { HDR_MOST = 1 << 27 }; /* pixels, as 16384 x 8192: 1.5 GiB of floats */

typedef struct hdr_source {
    const unsigned char *data;
    size_t size, at;
} hdr_source;

/* The next line of text without its end, cut at 255 characters; 0 at the end of the file. */
static inline int hdr_line(hdr_source *in, char line[256]) {
    size_t n = 0;
    if (in->at >= in->size) return 0;
    while (in->at < in->size && in->data[in->at] != '\n') {
        if (n < 255 && in->data[in->at] != '\r') line[n++] = (char)in->data[in->at];
        in->at++;
    }
    line[n] = 0;
    if (in->at >= in->size) return 0;
    in->at++;
    return 1;
}

/* Header up to and with the line of sizes; sign[0] of y, sign[1] of x: the direction in which rows and pixels are stored. */
static inline int hdr_header(hdr_source *in, int *width, int *height, char sign[2], float *exposure, char *error) {
    char line[256], first = 0, second = 0, extra;
    long a = 0, b = 0;
    *exposure = 1;
    if (!hdr_line(in, line) || (strncmp(line, "#?RADIANCE", 10) && strncmp(line, "#?RGBE", 6)))
        return file_fail(error, "is not a Radiance picture (it does not begin with #?RADIANCE)");
    while (hdr_line(in, line) && line[0]) {
        double factor;
        if (!strncmp(line, "FORMAT=", 7) && !strstr(line, "32-bit_rle_rgbe"))
            return file_fail(error, "has %.40s; 32-bit_rle_rgbe is read", line);
        if (!strncmp(line, "EXPOSURE=", 9)) {
            if (sscanf(line + 9, "%lf", &factor) != 1 || !(factor > 1e-20 && factor < 1e20))
                return file_fail(error, "has an impossible exposure");
            *exposure = (float)((double)*exposure / factor);
        }
    }
    if (!(*exposure > 1e-30f && *exposure < 1e30f)) return file_fail(error, "has an impossible exposure");
    if (!hdr_line(in, line)) return file_fail(error, "ends within its header");
    if (sscanf(line, "%c%*1[Yy] %8ld %c%*1[Xx] %8ld%c", &sign[0], &a, &sign[1], &b, &extra) != 4) {
        if (sscanf(line, "%c%*1[Xx] %8ld %c%*1[Yy] %8ld%c", &first, &a, &second, &b, &extra) == 4)
            return file_fail(error, "is stored by columns (%.30s); rows (-Y N +X N) are read", line);
        return file_fail(error, "has no line of sizes like \"-Y 128 +X 256\"");
    }
    if ((sign[0] != '-' && sign[0] != '+') || (sign[1] != '-' && sign[1] != '+'))
        return file_fail(error, "has no line of sizes like \"-Y 128 +X 256\"");
    if (a < 1 || b < 1 || a > 32768 || b > 32768) return file_fail(error, "claims %ld x %ld pixels; 1 to 32768 are allowed", b, a);
    *height = (int)a, *width = (int)b;
    return 1;
}

/* One row of RGBE into row[4 * width]. New run-length code: 2 2 hi lo, then each channel by itself; else flat pixels, in which
   1 1 1 n repeats the pixel before. */
static inline int hdr_row(hdr_source *in, unsigned char *row, size_t width) {
    size_t i, channel, shift = 0;
    const unsigned char *p = in->data + in->at;
    if (width >= 8 && width < 32768 && in->size - in->at >= 4 && p[0] == 2 && p[1] == 2 && p[2] < 128) {
        if (((size_t)p[2] << 8 | p[3]) != width) return 0;
        in->at += 4;
        for (channel = 0; channel < 4; channel++) {
            for (i = 0; i < width;) {
                size_t n, k;
                int run;
                if (in->at >= in->size) return 0;
                n = in->data[in->at++];
                run = n > 128;
                if (run) n -= 128;
                if (!n || n > width - i || in->size - in->at < (run ? 1 : n)) return 0;
                for (k = 0; k < n; k++) row[4 * (i + k) + channel] = in->data[in->at + (run ? 0 : k)];
                in->at += run ? 1 : n, i += n;
            }
        }
        return 1;
    }
    for (i = 0; i < width;) {
        if (in->size - in->at < 4) return 0;
        p = in->data + in->at, in->at += 4;
        if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
            size_t n, k;
            if (!i || shift > 24) return 0;
            n = (size_t)p[3] << shift, shift += 8;
            if (n > width - i) return 0;
            for (k = 0; k < n; k++, i++) memcpy(row + 4 * i, row + 4 * (i - 1), 4);
        } else memcpy(row + 4 * i++, p, 4), shift = 0;
    }
    return 1;
}

/* The caller frees image->rgb. *image is untouched on failure; error says what is wrong without the file's name. */
static inline int hdr_decode(const unsigned char *data, size_t size, hdr_image *image, char *error) {
    hdr_source in;
    int width = 0, height = 0, x, y;
    char sign[2];
    float exposure, *rgb;
    unsigned char *row;
    in.data = data, in.size = size, in.at = 0;
    if (!hdr_header(&in, &width, &height, sign, &exposure, error)) return 0;
    /* run-length code holds 127 equal bytes in 2, a repeat at most 2^32 pixels in 16: bound by what real files can reach */
    if ((uint64_t)width * (uint64_t)height / 128 > size - in.at)
        return file_fail(error, "claims %d x %d pixels but holds %zu bytes of them", width, height, size - in.at);
    if ((uint64_t)width * (uint64_t)height > HDR_MOST)
        return file_fail(error, "is %d x %d pixels, at most %d million are read", width, height, HDR_MOST / 1000000);
    rgb = (float *)malloc((size_t)width * (size_t)height * 3 * sizeof *rgb);
    row = (unsigned char *)malloc((size_t)width * 4);
    if (!rgb || !row) {
        free(rgb), free(row);
        return file_fail(error, "out of memory");
    }
    for (y = 0; y < height; y++) {
        float *out = rgb + (size_t)(sign[0] == '-' ? y : height - 1 - y) * (size_t)width * 3;
        if (!hdr_row(&in, row, (size_t)width)) {
            free(rgb), free(row);
            return file_fail(error, "is damaged or cut off in row %d of %d", y, height);
        }
        for (x = 0; x < width; x++) {
            const unsigned char *p = row + 4 * x;
            float *to = out + 3 * (sign[1] == '+' ? x : width - 1 - x);
            float f = p[3] ? (float)ldexp(1, p[3] - 136) * exposure : 0;
            to[0] = (float)p[0] * f, to[1] = (float)p[1] * f, to[2] = (float)p[2] * f;
            if (!(to[0] + to[1] + to[2] < 3e38f)) to[0] = to[1] = to[2] = 1e38f; /* an exposure that overflows */
        }
    }
    free(row);
    image->rgb = rgb, image->width = width, image->height = height;
    return 1;
}

static inline int hdr_read(const char *path, hdr_image *image, char *error) {
    unsigned char *data = NULL;
    size_t size = 0;
    char why[FILE_ERROR_SIZE];
    int ok;
    if (!file_read(path, (size_t)1 << 30, &data, &size, error)) return 0;
    ok = hdr_decode(data, size, image, why) || file_fail(error, "%.200s: %.250s", path, why);
    free(data);
    return ok;
}

#endif /* HDR_H */
