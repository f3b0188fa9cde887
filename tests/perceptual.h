/* perceptual.h - how many pixels of two pictures a viewer would tell apart

   The metric of Yee and Newman 2004, "A perceptual metric for production testing": the threshold of luminance at a pixel's adaptation
   (Ward Larson 1997), raised by the eye's insensitivity to the frequencies that the pictures hold there (Barten 1989) and by masking
   (Daly 1993), against the difference of luminance; and a difference of colour in CIE L*a*b*. It says where a difference is at its
   threshold;
   how likely one of r thresholds is detected, tells Daly's psychometric function, 1 - exp(-r^3.5). Kronander 2011 counts the pixels in
   which that is above 75 %. Frequencies are octaves, by a pyramid of Burt and Adelson's kernel that keeps all pixels. */
#ifndef PERCEPTUAL_H
#define PERCEPTUAL_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PERCEPTUAL_LEVELS = 8 };

/* Threshold against intensity: cd/m^2 that can just be told apart. */
static double perceptual_threshold(double adaptation) {
    double x = log10(adaptation), y = x - 1.255;
    if (x < -3.94) y = -2.86;
    else if (x < -1.44) y = pow(0.405 * x + 1.6, 2.18) - 2.86;
    else if (x < -0.0184) y = x - 0.395;
    else if (x < 1.9) y = pow(0.249 * x + 0.65, 2.7) - 0.72;
    return pow(10, y);
}

/* Contrast sensitivity at cycles per degree and cd/m^2. */
static double perceptual_sensitivity(double frequency, double luminance) {
    double a = 440 * pow(1 + 0.7 / luminance, -0.2), b = 0.3 * pow(1 + 100 / luminance, 0.15);
    return a * frequency * exp(-b * frequency) * sqrt(1 + 0.06 * exp(b * frequency));
}

static double perceptual_masking(double contrast) {
    double a = pow(392.498 * contrast, 0.7);
    return pow(1 + pow(0.0153 * a, 4), 0.25);
}

/* Luminance (of a white of 100 cd/m^2) and a*, b* of a picture in display values, 0..1. */
static void perceptual_colours(const float (*srgb)[3], size_t count, float *luminance, float (*ab)[2]) {
    for (size_t i = 0; i < count; i++) {
        double c[3], xyz[3], f[3];
        for (int a = 0; a < 3; a++) {
            double x = fmin(1, fmax(0, (double)srgb[i][a]));
            c[a] = x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
        }
        xyz[0] = (0.4124564 * c[0] + 0.3575761 * c[1] + 0.1804375 * c[2]) / 0.95047;
        xyz[1] = 0.2126729 * c[0] + 0.7151522 * c[1] + 0.0721750 * c[2];
        xyz[2] = (0.0193339 * c[0] + 0.1191920 * c[1] + 0.9503041 * c[2]) / 1.08883;
        for (int a = 0; a < 3; a++) f[a] = xyz[a] > 0.008856452 ? cbrt(xyz[a]) : (903.2963 * xyz[a] + 16) / 116;
        luminance[i] = (float)(100 * xyz[1]), ab[i][0] = (float)(500 * (f[0] - f[1])), ab[i][1] = (float)(200 * (f[1] - f[2]));
    }
}

/* Blurred by the kernel 1 5 8 5 1 / 20, its taps 2^level pixels apart; borders are mirrored. */
static void perceptual_blur(const float *from, float *to, float *scratch, int width, int height, int level) {
    const float weight[3] = {0.4f, 0.25f, 0.05f};
    for (int pass = 0; pass < 2; pass++) {
        const float *in = pass ? scratch : from;
        float *out = pass ? to : scratch;
        int size = pass ? height : width;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                int at = pass ? y : x;
                float sum = 0;
                for (int k = -2; k <= 2; k++) {
                    int p = at + k * (1 << level);
                    while (p < 0 || p >= size) p = p < 0 ? -p - 1 : 2 * size - 1 - p;
                    sum += weight[k < 0 ? -k : k] * in[pass ? p * width + x : y * width + p];
                }
                out[y * width + x] = sum;
            }
    }
}

/* The share of pixels in which a viewer sees a difference with a probability above `detection` (0.75). a, b: [height*width] in display
   values, 0..1; degrees: that the picture is wide. -1 without memory. */
static double perceptual_difference(const float (*a)[3], const float (*b)[3], int width, int height, double degrees, double detection) {
    size_t count = (size_t)width * (size_t)height, seen = 0, i;
    float *level[2] = {(float *)malloc(count * sizeof(float) * (PERCEPTUAL_LEVELS + 1)),
                       (float *)malloc(count * sizeof(float) * (PERCEPTUAL_LEVELS + 1))};
    float(*ab[2])[2] = {(float(*)[2])malloc(count * sizeof(float[2])), (float(*)[2])malloc(count * sizeof(float[2]))};
    double per_degree = width / (2 * tan(degrees * 3.14159265358979 / 360) * 180 / 3.14159265358979), frequency[PERCEPTUAL_LEVELS],
           most = perceptual_sensitivity(3.248, 100);
    double ratio = pow(-log(1 - detection), 1 / 3.5);
    int ok = level[0] && level[1] && ab[0] && ab[1], adapted = 0, n;
    for (n = 0; ok && n < 2; n++) {
        perceptual_colours(n ? b : a, count, level[n], ab[n]);
        for (int l = 1; l < PERCEPTUAL_LEVELS; l++)
            perceptual_blur(level[n] + (size_t)(l - 1) * count, level[n] + (size_t)l * count, level[n] + PERCEPTUAL_LEVELS * count, width,
                            height, l - 1);
    }
    for (n = 0; n < PERCEPTUAL_LEVELS; n++) frequency[n] = 0.5 * per_degree / (1 << n);
    while (adapted < PERCEPTUAL_LEVELS - 1 && (1 << adapted) < per_degree) adapted++; /* the eye adapts to about a degree */
    for (i = 0; ok && i < count; i++) {
        double adaptation = fmax(0.5 * (double)(level[0][(size_t)adapted * count + i] + level[1][(size_t)adapted * count + i]), 1e-5),
               sum = 0, factor = 0, colour, delta, da, db;
        for (n = 0; n < PERCEPTUAL_LEVELS - 2; n++) {
            size_t at = (size_t)n * count + i, next = at + count, beyond = next + count;
            double numerator = fmax(fabs((double)(level[0][at] - level[0][next])), fabs((double)(level[1][at] - level[1][next])));
            double contrast = numerator / fmax(fmax(fabs((double)level[0][beyond]), fabs((double)level[1][beyond])), 1e-5);
            sum += contrast;
            factor += contrast * most / perceptual_sensitivity(frequency[n], 100) *
                      perceptual_masking(contrast * perceptual_sensitivity(frequency[n], adaptation));
        }
        factor = sum > 0 ? fmin(10, fmax(1, factor / sum)) : 1;
        delta = fabs((double)(level[0][i] - level[1][i])) / (factor * perceptual_threshold(adaptation));
        colour = adaptation < 10 ? pow(adaptation / 10, 2) : 1; /* rods see no colour */
        da = (double)(ab[0][i][0] - ab[1][i][0]), db = (double)(ab[0][i][1] - ab[1][i][1]);
        delta = fmax(delta, (da * da + db * db) * colour / factor);
        seen += delta > ratio;
    }
    for (n = 0; n < 2; n++) free(level[n]), free(ab[n]);
    return ok ? (double)seen / (double)count : -1;
}

#endif
