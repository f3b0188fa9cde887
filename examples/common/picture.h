/* picture.h - linear light to an 8-bit sRGB picture: automatic exposure, a shoulder, a backdrop

   Every pixel is premultiplied linear radiance and opacity. Tone mapping is honest up to 0.7 of display white (plain sRGB) and bends
   softly towards white above, per channel. The automatic exposure brings the brightness that a given share of the
   covered pixels stays below to a given place; it depends on nothing but the picture. */
#ifndef PICTURE_H
#define PICTURE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

static inline double picture_luminance(const float rgb[3]) {
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

/* Linear, any size >= 0, to 0..1 of display light. */
static inline double picture_shoulder(double x) {
    const double knee = 0.7;
    if (!(x > 0)) return 0;
    return x < knee ? x : knee + (1 - knee) * (1 - exp((knee - x) / (1 - knee)));
}

static inline unsigned char picture_srgb(double x) {
    double y;
    x = x > 0 ? (x < 1 ? x : 1) : 0;
    y = x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
    return (unsigned char)(255 * y + 0.5);
}

static int picture_compare(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Factor that brings the brightness which `fraction` of the covered pixels do not exceed to `target`; 1 if nothing is covered. */
static inline double picture_exposure(const float (*rgba)[4], size_t count, double fraction, double target) {
    float *sorted = (float *)malloc((count + 1) * sizeof *sorted);
    size_t i, n = 0;
    double at = 0;
    if (!sorted) return 1;
    for (i = 0; i < count; i++) {
        double y;
        if (!(rgba[i][3] > 0.25f)) continue;
        y = picture_luminance(rgba[i]) / (double)rgba[i][3];
        if (y >= 0 && y < 1e30) sorted[n++] = (float)y;
    }
    if (n) qsort(sorted, n, sizeof *sorted, picture_compare), at = (double)sorted[(size_t)(fraction * (double)(n - 1))];
    free(sorted);
    return at > 1e-12 ? target / at : 1;
}

/* A pixel over a backdrop that is given in display light. */
static inline void picture_pixel(const float rgba[4], double exposure, const double backdrop[3], unsigned char out[3]) {
    double a = (double)rgba[3];
    int c;
    a = a > 0 ? (a < 1 ? a : 1) : 0;
    for (c = 0; c < 3; c++) {
        double light = a > 1e-6 ? picture_shoulder(exposure * (double)rgba[c] / a) * a : 0;
        out[c] = picture_srgb(light + (1 - a) * backdrop[c]);
    }
}

#endif /* PICTURE_H */
