/* Spherical harmonics in 128 bits, straight from the definition: the reference of test_sh.c and bench_sh.c.
   Only additions, multiplications, divisions and one Newton square root, so that no library is needed; and nodes for quadrature. */
#ifndef REFERENCE_SH_H
#define REFERENCE_SH_H

#include <math.h>
#include <stdlib.h>

#if defined(__SIZEOF_FLOAT128__)
__extension__ typedef __float128 quad;
#else
typedef long double quad;
#endif

static quad quad_sqrt(quad x) {
    if (!(x > 0)) return 0;
    int exponent = 0;
    while (x > (quad)1e60) x /= (quad)0x1p200, exponent += 100;
    while (x < (quad)1e-60) x *= (quad)0x1p200, exponent -= 100;
    quad r = (quad)sqrt((double)x);
    for (int i = 0; i < 3; i++) r = (r + x / r) / 2;
    for (; exponent > 0; exponent -= 100) r *= (quad)0x1p100;
    for (; exponent < 0; exponent += 100) r /= (quad)0x1p100;
    return r;
}

/* y[order*order] for the direction as it is given, normalised in 128 bits, of |m| < columns alone. Not for the zero vector. */
static void reference_columns(quad *y, int order, int columns, const quad direction[3]) {
    static const char pi_digits[] = "314159265358979323846264338327950288";
    quad pi = 0, x = direction[0], z = direction[2], yy = direction[1], r = quad_sqrt(x * x + yy * yy + z * z);
    for (const char *p = pi_digits; *p; p++) pi = pi * 10 + (quad)(*p - '0');
    for (int i = 0; i < 35; i++) pi /= 10;
    x /= r, yy /= r, z /= r;
    quad c = 1, s = 0, double_factorial = 1;
    for (int m = 0; m < columns; m++) {
        quad before = 0, p = double_factorial, ratio = 1; /* ratio: (l-m)! / (l+m)! */
        for (int k = 2; k <= 2 * m; k++) ratio /= (quad)k;
        for (int l = m; l < order; l++) {
            quad n = quad_sqrt((quad)(2 * l + 1) / (4 * pi) * ratio * (m ? 2 : 1));
            y[l * (l + 1) + m] = n * p * c;
            if (m) y[l * (l + 1) - m] = n * p * s;
            quad next = ((quad)(2 * l + 1) * z * p - (quad)(l + m) * before) / (quad)(l - m + 1);
            before = p, p = next;
            ratio = ratio * (quad)(l - m + 1) / (quad)(l + m + 1);
        }
        double_factorial *= (quad)(2 * m + 1);
        quad t = x * c - yy * s;
        s = x * s + yy * c, c = t;
    }
}

static void reference_eval(quad *y, int order, const quad direction[3]) { reference_columns(y, order, order, direction); }

/* The n nodes and weights of Gauss and Legendre on [-1, 1], from 1 down: Newton's method on P_n, apart from what the header does. */
__attribute__((unused)) static void reference_nodes(long double *node, long double *weight, int n) {
    for (int i = 0; i < n; i++) {
        long double x = cosl(3.14159265358979323846264L * ((long double)i + 0.75L) / ((long double)n + 0.5L)), slope = 1;
        for (int round = 0; round < 12; round++) {
            long double p = 1, before = 0;
            for (int k = 0; k < n; k++) {
                long double next = ((long double)(2 * k + 1) * x * p - (long double)k * before) / (long double)(k + 1);
                before = p, p = next;
            }
            slope = (long double)n * (before - x * p) / (1 - x * x);
            x -= p / slope;
        }
        node[i] = x, weight[i] = 2 / ((1 - x * x) * slope * slope);
    }
}

#endif
