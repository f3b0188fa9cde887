/* Writes the tables of isogi_sh.h, those between its lines "generated: begin" and "generated: end", in 128 bits.
   tests/test_sh.c compares; `build/tests/test_sh --list` and the filter "tables" run that test alone. */
#ifndef GENERATE_SH_H
#define GENERATE_SH_H

#include "reference_sh.h"
#include <stdio.h>
#include <string.h>

enum { GENERATE_ORDER = 21, GENERATE_TURNS = 15, GENERATE_LATITUDES = 7, GENERATE_LOW = 11 };

static quad generate_pi(void) {
    quad pi = 0;
    for (const char *p = "314159265358979323846264338327950288"; *p; p++) pi = pi * 10 + (quad)(*p - '0');
    for (int i = 0; i < 35; i++) pi /= 10;
    return pi;
}

/* Factors of the recursions: see the comment in front of the tables. */
static int generate_factors(quad *v) {
    quad q = quad_sqrt(1 / (4 * generate_pi()));
    int n = 0;
    for (int l = 0; l < GENERATE_ORDER; l++) {
        v[n++] = l ? (quad)(l - 1) / (quad)l : 0;
        v[n++] = l ? -(quad)(2 * l - 1) / (quad)l : 0;
        v[n++] = quad_sqrt((quad)(2 * l + 1) / (4 * generate_pi()));
    }
    for (int m = 1; m < GENERATE_ORDER; m++) {
        quad before = 0;
        q *= quad_sqrt((quad)(2 * m + 1) / (quad)(m == 1 ? 1 : 2 * m));
        v[n++] = q;
        for (int l = m + 1; l < GENERATE_ORDER; l++) {
            quad a = quad_sqrt((quad)(4 * l * l - 1) / (quad)(l * l - m * m));
            v[n++] = a;
            v[n++] = l > m + 1 ? -(a / before) : 0;
            before = a;
        }
    }
    return n;
}

/* Entries of the quarter turn about y: d_nm(pi/2) with its sign, times 2, sqrt 2 or 1. */
static int generate_turns(quad *v) {
    int count = 0;
    for (int l = 1; l <= GENERATE_TURNS; l++)
        for (int n = 0; n <= l; n++) {
            quad square = 1, row[GENERATE_TURNS + 2] = {0};
            for (int k = 1; k <= 2 * l; k++) square *= (quad)k / 4; /* binomial(2l, l+n) / 4^l, from factorials */
            for (int k = 1; k <= 2 * l; k++) square *= 4;
            for (int k = 1; k <= l + n; k++) square /= (quad)k;
            for (int k = 1; k <= l - n; k++) square /= (quad)k;
            for (int k = 0; k < l; k++) square /= 4;
            row[l] = ((l + n) & 1 ? -1 : 1) * quad_sqrt(square);
            for (int m = l; m > n; m--)
                row[m - 1] = (2 * (quad)n * row[m] - quad_sqrt((quad)((l - m) * (l + m + 1))) * row[m + 1]) /
                             quad_sqrt((quad)((l - m + 1) * (l + m)));
            for (int m = n; m <= l; m++) v[count++] = row[m] * (n ? 2 : m ? quad_sqrt(2) : 1);
        }
    return count;
}

/* The whole quarter turn, column by column: in column m the entries of even n, then those of odd n. */
static int generate_turn_columns(quad *v) {
    static quad half[1024];
    int count = 0;
    const quad *triangle = half;
    generate_turns(half);
    for (int l = 1; l <= GENERATE_TURNS; l++) {
        for (int m = 0; m <= l; m++)
            for (int odd = 0; odd < 2; odd++)
                for (int n = odd; n <= l; n += 2) {
                    int low = n < m ? n : m, high = n < m ? m : n;
                    quad entry = triangle[low * (l + 1) - low * (low - 1) / 2 + high - low];
                    v[count++] = n > m && ((m + n) & 1) ? -entry : entry;
                }
        triangle += (l + 1) * (l + 2) / 2;
    }
    return count;
}

/* Y_l^m = q_l^m (c_m, s_m) for l < 11: coefficients of q in v = 2 z^2 - 1 for m < 2, in v + 1/4 for m > 1, the highest first, without the
   factor z of an odd q; m outer. After them for each m and l > m + 5 A, B, C of q_l = (A v + B) q_{l-2} + C q_{l-4}, v as above. */
static int generate_polynomials(quad *v) {
    static quad factors[1024];
    int count = 0;
    generate_factors(factors);
    for (int m = 0; m < GENERATE_LOW; m++) {
        quad p[2][GENERATE_LOW + 1] = {{0}}, a_before = 1;
        const quad *table = m ? factors + 3 * GENERATE_ORDER + (m - 1) * (2 * GENERATE_ORDER - 1 - m) : factors + 2;
        for (int l = m; l < GENERATE_LOW; l++) {
            quad *q = p[l & 1], *before = p[~l & 1], a = l > m ? quad_sqrt((quad)(4 * l * l - 1) / (quad)(l * l - m * m)) : 1;
            if (l == m) q[0] = table[0];
            for (int k = GENERATE_LOW - 1; k >= 0 && l > m; k--) { /* z times z is (1 + v) / 2 */
                quad next = (l - m) & 1 ? before[k] : (before[k] + (k ? before[k - 1] : 0)) / 2;
                q[k] = a * next - (l > m + 1 ? a / a_before * q[k] : 0);
            }
            a_before = a;
            quad shifted[GENERATE_LOW];
            int degree = (l - m) / 2;
            for (int k = 0; k <= degree; k++) shifted[k] = q[k];
            for (int i = 0; i < degree && m > 1; i++)
                for (int k = degree - 1; k >= i; k--) shifted[k] -= shifted[k + 1] / 4;
            for (int k = degree; k >= 0; k--) v[count++] = shifted[k];
        }
    }
    for (int m = 0; m < GENERATE_LOW; m++)
        for (int l = m + 6; l < GENERATE_LOW; l++) {
            quad a[4]; /* of l, l - 1, .. */
            for (int k = 0; k < 4; k++) a[k] = quad_sqrt((quad)(4 * (l - k) * (l - k) - 1) / (quad)((l - k) * (l - k) - m * m));
            v[count++] = a[0] * a[1] / 2; /* z^2 is (1 + v) / 2, or (3/4 + v) / 2 */
            v[count++] = a[0] * a[1] * (m < 2 ? 1 : (quad)3 / 4) / 2 - a[0] * a[1] / (a[2] * a[2]) - a[0] / a[1];
            v[count++] = -a[0] * a[1] / (a[2] * a[3]);
        }
    return count;
}

/* For vector units, which take two columns at a time: factors of m = 0 as above; for each odd m q_m, a_{m+1}, q_{m+1}, and for each later l
   those of both recursions. */
static int generate_columns(quad *v) {
    static quad factors[1024];
    int count = 3 * GENERATE_ORDER;
    generate_factors(factors);
    for (int i = 0; i < count; i++) v[i] = factors[i];
    for (int m = 1; m < GENERATE_ORDER; m += 2) {
        const quad *p = factors + 3 * GENERATE_ORDER + (m - 1) * (2 * GENERATE_ORDER - 1 - m), *q = p + 2 * (GENERATE_ORDER - m) - 1;
        v[count++] = p[0], v[count++] = p[1], v[count++] = q[0];
        for (int l = m + 2; l < GENERATE_ORDER; l++)
            for (int k = 0; k < 4; k++) v[count++] = k < 2 ? p[2 * (l - m) - 1 + k] : q[2 * (l - m) - 5 + k];
    }
    return count;
}

/* Legendre nodes by Newton; q_l^m sin^m at each, for l, m < 5 (m outer), and again times the weights and pi / 2, or pi where m = 0;
   lane 8 is empty. */
static int generate_latitudes(quad *v) {
    quad node[GENERATE_LATITUDES], weight[GENERATE_LATITUDES];
    int count = 0, n = GENERATE_LATITUDES;
    for (int i = 0; i < n; i++) {
        quad x = (quad)cos(3.14159265358979323846 * (i + 0.75) / (n + 0.5)), d = 1;
        if (2 * i + 1 == n) x = 0;
        for (int round = 0; round < 6; round++) {
            quad p = 1, before = 0;
            for (int k = 0; k < n; k++) {
                quad next = ((quad)(2 * k + 1) * x * p - (quad)k * before) / (quad)(k + 1);
                before = p, p = next;
            }
            d = (quad)n * (before - x * p) / (1 - x * x);
            x -= p / d;
        }
        if (2 * i + 1 == n) x = 0;
        node[i] = x;
        weight[i] = 2 * generate_pi() / ((1 - x * x) * d * d);
    }
    for (int weighted = 0; weighted < 2; weighted++) {
        for (int m = 0; m < 5; m++)
            for (int l = m; l < 5; l++)
                for (int i = 0; i < 8; i++) {
                    quad y[25], d[3] = {0, 0, 1};
                    if (i < n) d[0] = quad_sqrt(1 - node[i] * node[i]), d[2] = node[i], reference_eval(y, 5, d);
                    quad value = i < n ? y[l * (l + 1) + m] : 0;
                    if (value < (quad)1e-30 && value > (quad)-1e-30) value = 0; /* zeros of P at the equator */
                    v[count++] = weighted && i < n ? value * weight[i] / (m ? 2 : 1) : value;
                }
    }
    return count;
}

static void generate_table(FILE *out, const char *type, const char *name, const quad *v, int count, int is_double) {
    int column = 4;
    fprintf(out, "static const %s %s[%d] = {\n   ", type, name, count);
    for (int i = 0; i < count; i++) {
        char text[64];
        if (is_double) snprintf(text, sizeof text, "%.17g", (double)v[i]);
        else snprintf(text, sizeof text, "%.9g", (double)(float)v[i]);
        if (!strchr(text, '.') && !strchr(text, 'e')) strcat(text, ".0");
        strcat(text, is_double ? "," : "f,");
        if (column + 1 + (int)strlen(text) > 127) fprintf(out, "\n   "), column = 4;
        column += fprintf(out, " %s", text);
    }
    fprintf(out, "\n};\n");
}

static void generate(FILE *out) {
    static quad v[4096];
    int count = generate_factors(v);
    generate_table(out, "double", "isogi_sh__table_f64", v, count, 1);
    count = generate_turns(v);
    generate_table(out, "double", "isogi_sh__turn_f64", v, count, 1);
    fprintf(out, "#ifdef ISOGI_SH__VECTORS\n");
    count = generate_columns(v);
    generate_table(out, "float", "isogi_sh__columns_f32", v, count, 0);
    fprintf(out, "#endif\n#ifdef ISOGI_SH__SIMD\n");
    generate_table(out, "double", "isogi_sh__columns_f64", v, count, 1);
    count = generate_polynomials(v);
    generate_table(out, "float", "isogi_sh__polynomials_f32", v, count, 0);
    generate_table(out, "double", "isogi_sh__polynomials_f64", v, count, 1);
    count = generate_turn_columns(v);
    generate_table(out, "double", "isogi_sh__turn_columns_f64", v, count, 1);
    count = generate_latitudes(v);
    generate_table(out, "float", "isogi_sh__latitudes_f32", v, count, 0);
    fprintf(out, "#endif\n");
}

#endif
