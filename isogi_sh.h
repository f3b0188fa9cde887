/* isogi_sh.h - spherical harmonics and lights for C and C++        (part of isogi; needs nothing but libc and libm)

   (The helper text of this header is written with its implementation.)
*/
#ifndef ISOGI_SH_H
#define ISOGI_SH_H

#include <stddef.h>
#include <stdint.h>

/* ---- shared block 1: the same text stands in isogi_sh.h and isogi_vol.h ------------------------------------------ */
#ifndef ISOGI_SHARED_BLOCK
#define ISOGI_SHARED_BLOCK 1
#ifndef ISOGI_API
#ifdef __cplusplus
#define ISOGI_API extern "C"
#else
#define ISOGI_API extern
#endif
#endif
/* Every call that can fail returns one of these and leaves its outputs untouched unless it is ISOGI_OK. */
typedef enum isogi_result {
    ISOGI_OK = 0,
    ISOGI_INVALID,   /* an argument is outside its documented range */
    ISOGI_TOO_LARGE, /* a size overflows, or a limit of the library is exceeded */
    ISOGI_NO_MEMORY, /* the allocator returned NULL */
    ISOGI_CANCELLED, /* the progress callback asked to stop */
    ISOGI_CORRUPT    /* a memory block to be read back is damaged or of another version */
} isogi_result;
/* A short English text for a result; never NULL. */
static inline const char *isogi_result_string(isogi_result result) {
    switch (result) {
    case ISOGI_OK: return "ok";
    case ISOGI_INVALID: return "invalid argument";
    case ISOGI_TOO_LARGE: return "too large";
    case ISOGI_NO_MEMORY: return "out of memory";
    case ISOGI_CANCELLED: return "cancelled";
    case ISOGI_CORRUPT: return "corrupt data";
    }
    return "unknown result";
}
#elif ISOGI_SHARED_BLOCK != 1
#error "isogi headers of different versions are mixed: take all of them from one release"
#endif
/* ---- end of shared block ----------------------------------------------------------------------------------------- */

/* ---- lights: descriptions only, borrowed by whoever uses them ---- */

/* World space is right-handed, y up by convention. All radiometric values are linear RGB. */
typedef enum isogi_light_kind {
    ISOGI_LIGHT_DIRECTIONAL = 0, /* vector: towards the light (any length > 0); rgb: irradiance on a surface that faces it;
                                    radius: angular radius in radians, 0 = a mathematical direction */
    ISOGI_LIGHT_POINT,           /* vector: position; rgb: radiant intensity, so that E = rgb cos / distance^2; radius unused */
    ISOGI_LIGHT_SPHERE           /* vector: centre; rgb: radiant intensity as seen from afar; radius: world units */
} isogi_light_kind;

typedef struct isogi_light {
    isogi_light_kind kind;
    float vector[3], rgb[3], radius;
} isogi_light;

/* Light from infinitely far away, as an image, as SH coefficients, or as both added. All zero: black.
   Image: equirectangular, width x height x RGB floats, row 0 is up (+y), radiance. Longitude u in [0,1) runs to the right:
   direction(u,v) = (sin(pi v) sin(2 pi (u - 1/2)), cos(pi v), -sin(pi v) cos(2 pi (u - 1/2))), so the image's centre is -z,
   and +x lies to its right, as a camera that looks along -z sees it. Texel (i,j) has its centre at u = (i+1/2)/width.
   sh: sh_order^2 coefficients, interleaved RGB (sh[3*i + channel]), of radiance.
   rotation: row-major 3x3 that takes directions of the environment to directions of the world; all zero = identity. */
typedef struct isogi_env {
    const float *rgb;
    int width, height;
    const float *sh;
    int sh_order;
    float rotation[9];
} isogi_env;

typedef struct isogi_lighting {
    isogi_env env;
    const isogi_light *lights;
    size_t light_count;
} isogi_lighting;

/* Checks a lighting description: sizes, finite values, rotation orthonormal to 1e-3 (or zero). NULL is ISOGI_INVALID. */
ISOGI_API isogi_result isogi_lighting_validate(const isogi_lighting *lighting);

/* Radiance that arrives from `direction` (world, any length > 0) out of the environment alone: image (bilinear, wrapped in
   longitude, clamped at the poles) plus SH. */
ISOGI_API void isogi_env_radiance(const isogi_env *env, const float direction[3], float rgb[3]);

/* ---- spherical harmonics ---- */

/* Real, orthonormal, no Condon-Shortley phase; index i = l(l+1)+m (ACN); so Y1..Y3 = sqrt(3/(4 pi)) (y, z, x).
   "order n" keeps degrees 0..n-1: n*n coefficients. Coefficients of several channels are interleaved: c[channels*i + channel]. */
#define ISOGI_SH_MAX_ORDER 101
#define ISOGI_SH_COUNT(order) ((size_t)(order) * (size_t)(order))

/* y[count][order*order]: every basis function at every direction. Directions are normalised first; the zero vector (and any
   vector that is not finite) counts as +z. */
ISOGI_API isogi_result isogi_sh_eval(float *y, int order, const float (*direction)[3], size_t count);
ISOGI_API isogi_result isogi_sh_eval_f64(double *y, int order, const double (*direction)[3], size_t count);

/* Coefficients of a function on the sphere: `function` writes `channels` values for a unit direction. Gauss-Legendre in
   latitude times uniform in longitude with `resolution` latitudes (0 = order): exact to rounding when the function is
   band-limited to degree <= 2*resolution - order. c[order*order][channels]; channels 1..16. */
ISOGI_API isogi_result isogi_sh_project_function(double *c, int order, int channels, int resolution,
                                                 void (*function)(void *user, const double direction[3], double *value), void *user);

/* Coefficients (RGB interleaved) of an equirectangular RGB image laid out and oriented as in isogi_env. Fejer weights in
   latitude: exact for the band limit of the image. */
ISOGI_API isogi_result isogi_sh_project_equirect(float *rgb, int order, const float *image, int width, int height);

/* Coefficients (RGB interleaved) of the radiance of everything in `lighting` as it arrives at `point` (world; NULL = origin):
   environment rotated, directional lights as deltas (or discs), point and sphere lights with their attenuation there. */
ISOGI_API isogi_result isogi_sh_project(float *rgb, int order, const isogi_lighting *lighting, const float point[3]);

/* Rotates: out expands f(R^-1 w), so that a lobe towards d turns into a lobe towards R d; m is R, row-major. ISOGI_INVALID unless
   m is a rotation to 1e-3. out may be in. Ivanic and Ruedenberg 1996, 1998. */
ISOGI_API isogi_result isogi_sh_rotate(float *out, const float *in, int order, int channels, const float m[9]);
ISOGI_API isogi_result isogi_sh_rotate_f64(double *out, const double *in, int order, int channels, const double m[9]);

/* Integral over the sphere of the product of two expansions: sum of a_i b_i. */
ISOGI_API double isogi_sh_dot(const float *a, const float *b, int order);

/* Radiance to irradiance: convolves with the clamped cosine, in place or not. Irradiance at normal n is then sum out_i Y_i(n). */
ISOGI_API isogi_result isogi_sh_convolve_cosine(float *out, const float *in, int order, int channels);

#endif /* ISOGI_SH_H */

#if (defined(ISOGI_IMPLEMENTATION) || defined(ISOGI_SH_IMPLEMENTATION)) && !defined(ISOGI_SH_IMPLEMENTED)
#define ISOGI_SH_IMPLEMENTED

#include <math.h>
#include <string.h>

#define ISOGI_SH__PI 3.14159265358979323846
#define ISOGI_SH__LANES 8     /* directions that the plain code evaluates together */
#define ISOGI_SH__CHANNELS 16 /* the most that one call takes */

/* ==== numbers ======================================================================================================== */

/* By their bits, so that -ffast-math cannot fold the question away. */
static int isogi_sh__finite_f32(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

static int isogi_sh__finite_f64(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & ((uint64_t)0x7ff << 52)) != (uint64_t)0x7ff << 52;
}

static int isogi_sh__order_ok(int order) { return order >= 1 && order <= ISOGI_SH_MAX_ORDER; }

/* ==== directions ===================================================================================================== */

/* A unit vector whose z is z + z_low. Degree l turns an error e of z near the poles into one of l(l+1)/2 e, so that half an ulp of
   z = 1 - t would show at degree 100; t = (x^2+y^2) / (r (r+|z|)) is known to full relative precision there. */
typedef struct isogi_sh__unit {
    double x, y, z, z_low;
} isogi_sh__unit;

static isogi_sh__unit isogi_sh__normalise(double x, double y, double z) {
    isogi_sh__unit u = {0, 0, 1, 0};
    double ax = fabs(x), ay = fabs(y), az = fabs(z), largest = ax > ay ? ax : ay, r, t;
    largest = largest > az ? largest : az;
    if (!isogi_sh__finite_f64(x) || !isogi_sh__finite_f64(y) || !isogi_sh__finite_f64(z) || largest <= 0) return u;
    if (largest < 1e-100 || largest > 1e100) { /* squares would leave the range */
        int exponent;
        frexp(largest, &exponent);
        x = ldexp(x, -exponent), y = ldexp(y, -exponent), z = ldexp(z, -exponent);
        az = fabs(z);
    }
    r = sqrt(x * x + y * y + z * z);
    u.x = x / r;
    u.y = y / r;
    u.z = z / r;
    if (az > 0.5 * r) {
        t = (x * x + y * y) / (r * (r + az));
        u.z = 1 - t;
        u.z_low = (1 - u.z) - t;
        if (z < 0) u.z = -u.z, u.z_low = -u.z_low;
    }
    return u;
}

/* ==== basis functions ================================================================================================ */

/* Y_l^{+-m} = q_l (c_m, s_m) with c_m + i s_m = (x + i y)^m = sin^m t e^{i m p}: no trigonometry, nothing singular at the poles.
   q follows P_l^m, normalised: q_l = a_l z q_{l-1} - a_l / a_{l-1} q_{l-2}, a_l = sqrt((4 l^2 - 1) / (l^2 - m^2)), which is stable
   upwards. q grows to 1e20 at most where s_m is as small, up to degree 100: neither leaves the range of a float. */
static double isogi_sh__a(int l, int m) { return sqrt((double)(4 * l * l - 1) / (double)((l - m) * (l + m))); }

/* q_m^m from q_{m-1}^{m-1}; the sqrt 2 of m > 0 is in it. */
static double isogi_sh__next_diagonal(double q, int m) {
    return m == 0 ? 0.28209479177387814347 : q * sqrt((double)(2 * m + 1) / (double)(m == 1 ? 1 : 2 * m));
}

/* m = 0 near the poles: the three terms nearly cancel there and their roundings grow like l^2, but the differences of
   P_l obey l (P_l - P_{l-1}) = (l-1) (P_{l-1} - P_{l-2}) - (2l-1) t P_{l-1} with t = 1 - |z|, which does not (after Reinsch). */
static void isogi_sh__zonal_column(double *q, int order, double z, double z_low) {
    double t = z < 0 ? (1 + z) + z_low : (1 - z) - z_low, p = 1, difference = 0, sign = z < 0 ? -1 : 1;
    int l;
    q[0] = 0.28209479177387814347;
    for (l = 1; l < order; l++) {
        difference = ((double)(l - 1) * difference - (double)(2 * l - 1) * t * p) / (double)l;
        p += difference;
        q[l] = sqrt((double)(2 * l + 1)) * 0.28209479177387814347 * (l & 1 ? sign * p : p);
    }
}

/* q[l] for l = m .. order-1, from q[m] = diagonal */
static void isogi_sh__column(double *q, int order, int m, double diagonal, double z, double z_low) {
    double a_before = 0;
    int l;
    if (m == 0) {
        isogi_sh__zonal_column(q, order, z, z_low);
        return;
    }
    q[m] = diagonal;
    for (l = m + 1; l < order; l++) {
        double a = isogi_sh__a(l, m);
        q[l] = a * (z * q[l - 1] + (z_low * q[l - 1] - (l > m + 1 ? q[l - 2] / a_before : 0)));
        a_before = a;
    }
}

/* A place to put basis functions: of direction k and index i at data[k * direction_stride + i * index_stride]. */
typedef struct isogi_sh__output {
    void *data;
    size_t direction_stride, index_stride;
    int is_double;
} isogi_sh__output;

static void isogi_sh__store(const isogi_sh__output *out, size_t first, int lanes, int index, const double *q, const double *factor) {
    size_t at = first * out->direction_stride + (size_t)index * out->index_stride;
    int k;
    if (out->is_double) {
        double *y = (double *)out->data + at;
        for (k = 0; k < lanes; k++) y[(size_t)k * out->direction_stride] = q[k] * factor[k];
    } else {
        float *y = (float *)out->data + at;
        for (k = 0; k < lanes; k++) y[(size_t)k * out->direction_stride] = (float)(q[k] * factor[k]);
    }
}

/* The functions of m = 0, as in isogi_sh__zonal_column. */
static void isogi_sh__eval_zonal(const isogi_sh__output *out, size_t first, int lanes, int order, const isogi_sh__unit *u) {
    double t[ISOGI_SH__LANES], sign[ISOGI_SH__LANES], p[ISOGI_SH__LANES], d[ISOGI_SH__LANES], normal[ISOGI_SH__LANES];
    int l, k;
    for (k = 0; k < lanes; k++) {
        sign[k] = u[k].z < 0 ? -1 : 1;
        t[k] = u[k].z < 0 ? (1 + u[k].z) + u[k].z_low : (1 - u[k].z) - u[k].z_low;
        p[k] = 1, d[k] = 0;
    }
    for (l = 0; l < order; l++) {
        double n = sqrt((double)(2 * l + 1)) * 0.28209479177387814347;
        double keep = l ? (double)(l - 1) / (double)l : 0, gain = l ? (double)(2 * l - 1) / (double)l : 0;
        for (k = 0; k < lanes; k++) {
            d[k] = keep * d[k] - gain * (t[k] * p[k]);
            p[k] += d[k];
            normal[k] = l & 1 ? n * sign[k] : n;
        }
        isogi_sh__store(out, first, lanes, l * (l + 1), p, normal);
    }
}

/* All basis functions of up to ISOGI_SH__LANES directions. */
static void isogi_sh__eval_block(const isogi_sh__output *out, size_t first, int lanes, int order, const isogi_sh__unit *u) {
    double c[ISOGI_SH__LANES], s[ISOGI_SH__LANES], q[3][ISOGI_SH__LANES], diagonal = isogi_sh__next_diagonal(0, 0);
    int l, m, k;
    isogi_sh__eval_zonal(out, first, lanes, order, u);
    for (k = 0; k < lanes; k++) c[k] = u[k].x, s[k] = u[k].y;
    for (m = 1; m < order; m++) {
        double a_before = 0, *q0 = q[0], *q1 = q[1], *q2 = q[2];
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        for (k = 0; k < lanes; k++) q1[k] = 0, q0[k] = diagonal;
        for (l = m; l < order; l++) {
            double *oldest = q2;
            if (l > m) {
                double a = isogi_sh__a(l, m), b = l > m + 1 ? 1 / a_before : 0;
                q2 = q1, q1 = q0, q0 = oldest;
                for (k = 0; k < lanes; k++) q0[k] = a * (u[k].z * q1[k] + (u[k].z_low * q1[k] - b * q2[k]));
                a_before = a;
            }
            isogi_sh__store(out, first, lanes, l * (l + 1) + m, q0, c);
            isogi_sh__store(out, first, lanes, l * (l + 1) - m, q0, s);
        }
        for (k = 0; k < lanes; k++) {
            double x = u[k].x * c[k] - u[k].y * s[k];
            s[k] = u[k].x * s[k] + u[k].y * c[k];
            c[k] = x;
        }
    }
}

/* count * order^2 elements of `size` bytes are addressable */
static int isogi_sh__fits(size_t count, int order, size_t size) { return count <= (size_t)-1 / 2 / size / ISOGI_SH_COUNT(order); }

ISOGI_API isogi_result isogi_sh_eval(float *y, int order, const float (*direction)[3], size_t count) {
    isogi_sh__output out = {NULL, 0, 1, 0};
    size_t i;
    if (!isogi_sh__order_ok(order) || (count && (!y || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *y)) return ISOGI_TOO_LARGE;
    out.data = y;
    out.direction_stride = ISOGI_SH_COUNT(order);
    for (i = 0; i < count; i += ISOGI_SH__LANES) {
        isogi_sh__unit u[ISOGI_SH__LANES];
        int k, lanes = count - i < ISOGI_SH__LANES ? (int)(count - i) : ISOGI_SH__LANES;
        for (k = 0; k < lanes; k++) {
            const float *d = direction[i + (size_t)k];
            u[k] = isogi_sh__normalise((double)d[0], (double)d[1], (double)d[2]);
        }
        isogi_sh__eval_block(&out, i, lanes, order, u);
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_eval_f64(double *y, int order, const double (*direction)[3], size_t count) {
    isogi_sh__output out = {NULL, 0, 1, 1};
    size_t i;
    if (!isogi_sh__order_ok(order) || (count && (!y || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *y)) return ISOGI_TOO_LARGE;
    out.data = y;
    out.direction_stride = ISOGI_SH_COUNT(order);
    for (i = 0; i < count; i += ISOGI_SH__LANES) {
        isogi_sh__unit u[ISOGI_SH__LANES];
        int k, lanes = count - i < ISOGI_SH__LANES ? (int)(count - i) : ISOGI_SH__LANES;
        for (k = 0; k < lanes; k++) {
            const double *d = direction[i + (size_t)k];
            u[k] = isogi_sh__normalise(d[0], d[1], d[2]);
        }
        isogi_sh__eval_block(&out, i, lanes, order, u);
    }
    return ISOGI_OK;
}

/* ==== sums and zonal lobes =========================================================================================== */

/* value[channel] = sum over i of c[channels i + channel] Y_i(u), nothing stored on the way; channels <= ISOGI_SH__CHANNELS */
static void isogi_sh__sum(double *value, const float *c, int order, int channels, isogi_sh__unit u) {
    double q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, x;
    int l, m, k;
    for (k = 0; k < channels; k++) value[k] = 0;
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            const float *plus = c + channels * (l * (l + 1) + m), *minus = c + channels * (l * (l + 1) - m);
            for (k = 0; k < channels; k++) value[k] += q[l] * (cm * (double)plus[k] + sm * (double)minus[k]);
        }
        x = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = x;
    }
}

/* c += rgb sum over l of scale[l] Y_lm(u): a lobe around u */
static void isogi_sh__add_lobe(float *c, int order, const double *scale, isogi_sh__unit u, const double rgb[3]) {
    double q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, x;
    int l, m, k;
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            float *plus = c + 3 * (l * (l + 1) + m), *minus = c + 3 * (l * (l + 1) - m);
            double lobe = scale[l] * q[l];
            for (k = 0; k < 3; k++) {
                plus[k] = (float)((double)plus[k] + rgb[k] * lobe * cm);
                if (m > 0) minus[k] = (float)((double)minus[k] + rgb[k] * lobe * sm);
            }
        }
        x = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = x;
    }
}

/* Zonal factors of a disc of angular radius a (cos a given) and irradiance 1 on a surface that faces it: radiance 1 / (pi sin^2 a).
   From the integral of P_l over [cos a, 1] = sin^2 a P_l'(cos a) / (l (l+1)): no cancellation however small the disc; cos a = 1 is
   the mathematical direction, whose factors are all 1. */
static void isogi_sh__disc(double *scale, int order, double cosine) {
    double before = 0, derivative = 1; /* P_{l-1}', P_l' */
    int l;
    scale[0] = 2 / (1 + cosine);
    for (l = 1; l < order; l++) {
        double next = ((double)(2 * l + 1) * cosine * derivative - (double)(l + 1) * before) / (double)l;
        scale[l] = 2 * derivative / ((double)l * (double)(l + 1));
        before = derivative;
        derivative = next;
    }
}

/* ==== rotation ======================================================================================================= */

/* R = Z(a) Y(b) Z(c) = Z(a - 90) Y(-90) Z(b) Y(90) Z(c + 90). Rotations about z are 2x2 blocks; Y(90) is the matrix of Wigner's
   d(pi/2), whose entries are made where they are used, by the recursion over m that runs from the edge m = l inwards, where it is
   stable: nothing is stored, and nothing is lost at degree 100, where Ivanic and Ruedenberg's recursion has lost half its digits. */
typedef struct isogi_sh__euler {
    double a[2], b[2], c[2]; /* cosine and sine of each angle */
} isogi_sh__euler;

/* ISOGI_INVALID unless m is finite and a rotation to 1e-3. */
static isogi_result isogi_sh__euler_angles(isogi_sh__euler *e, const double m[9]) {
    double sine, length, det;
    int i, j;
    for (i = 0; i < 9; i++)
        if (!isogi_sh__finite_f64(m[i]) || fabs(m[i]) > 2) return ISOGI_INVALID;
    for (i = 0; i < 3; i++)
        for (j = 0; j <= i; j++) {
            double dot = m[3 * i] * m[3 * j] + m[3 * i + 1] * m[3 * j + 1] + m[3 * i + 2] * m[3 * j + 2];
            if (fabs(dot - (i == j ? 1 : 0)) > 1e-3) return ISOGI_INVALID;
        }
    det = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
    if (det < 0) return ISOGI_INVALID;
    sine = sqrt(m[2] * m[2] + m[5] * m[5]);
    length = sqrt(sine * sine + m[8] * m[8]);
    e->b[0] = m[8] / length;
    e->b[1] = sine / length;
    e->a[0] = sine > 0 ? m[2] / sine : 1;
    e->a[1] = sine > 0 ? m[5] / sine : 0;
    /* Given a, the second row of Z(-a) R is (sin c, cos c, 0): well defined however small b is. */
    e->c[0] = e->a[0] * m[4] - e->a[1] * m[1];
    e->c[1] = e->a[0] * m[3] - e->a[1] * m[0];
    length = sqrt(e->c[0] * e->c[0] + e->c[1] * e->c[1]);
    e->c[0] /= length;
    e->c[1] /= length;
    return ISOGI_OK;
}

/* power[m] = (cosine, sine) of m times the angle; halving keeps the error at log2 m roundings */
static void isogi_sh__powers(double (*power)[2], int order, double cosine, double sine) {
    int m;
    power[0][0] = 1, power[0][1] = 0;
    if (order > 1) power[1][0] = cosine, power[1][1] = sine;
    for (m = 2; m < order; m++) {
        const double *p = power[m / 2], *q = power[m - m / 2];
        power[m][0] = p[0] * q[0] - p[1] * q[1];
        power[m][1] = p[0] * q[1] + p[1] * q[0];
    }
}

static void isogi_sh__turn_z(double *band, int l, double (*power)[2]) {
    int m;
    for (m = 1; m <= l; m++) {
        double plus = band[l + m], minus = band[l - m];
        band[l + m] = plus * power[m][0] - minus * power[m][1];
        band[l - m] = plus * power[m][1] + minus * power[m][0];
    }
}

/* For degree l: step[m] = sqrt((l-m)(l+m+1)), edge[m] = d_{m,l}(pi/2) without its sign = 2^-l sqrt(binomial(2l, l+m)). */
static void isogi_sh__quarter_turn_start(double *step, double *edge, int l) {
    double square = 1;
    int m;
    for (m = 1; m <= l; m++) square *= (double)(2 * m - 1) / (double)(2 * m);
    for (m = 0; m <= l; m++) {
        step[m] = sqrt((double)((l - m) * (l + m + 1)));
        edge[m] = sqrt(square);
        square *= (double)(l - m) / (double)(l + m + 1);
    }
}

/* out = Y(90) in, or its transpose: a quarter turn about y. Entry (n, m), n <= m, is 2 e_nm (sqrt 2 e where n = 0 < m, e where both
   are 0) between cosines where l+m+n is even, between sines where it is odd; entry (m, n) is (-1)^(m+n) of it, where
   e_{n,m-1} step[m-1] = 2 n e_{n,m} - step[m] e_{n,m+1}. */
static void isogi_sh__turn_y(double *out, const double *in, int l, int transposed, const double *step, const double *edge) {
    int m, n;
    for (m = 0; m <= 2 * l; m++) out[m] = 0;
    for (n = 0; n <= l; n++) {
        double after = 0, e = (l + n) & 1 ? -edge[n] : edge[n];
        for (m = l; m >= n; m--) {
            double w = e * (n > 0 ? 2 : m > 0 ? 1.41421356237309504880 : 1), mirrored = (m + n) & 1 ? -w : w, before;
            int sign = (l + m + n) & 1 ? -1 : 1, im = l + sign * m, in_ = l + sign * n;
            if (sign > 0 || n > 0) {
                out[in_] += (transposed ? mirrored : w) * in[im];
                if (m != n) out[im] += (transposed ? w : mirrored) * in[in_];
            }
            if (m > n) {
                before = (2 * (double)n * e - step[m] * after) / step[m - 1];
                after = e;
                e = before;
            }
        }
    }
}

/* Any order, channel by channel; float or double alike. */
static void isogi_sh__rotate(void *out, const void *in, int is_double, int order, int channels, const isogi_sh__euler *e) {
    double first[ISOGI_SH_MAX_ORDER][2], middle[ISOGI_SH_MAX_ORDER][2], last[ISOGI_SH_MAX_ORDER][2];
    double step[ISOGI_SH_MAX_ORDER], edge[ISOGI_SH_MAX_ORDER], band[2 * ISOGI_SH_MAX_ORDER], turned[2 * ISOGI_SH_MAX_ORDER];
    int l, i, k;
    isogi_sh__powers(first, order, -e->c[1], e->c[0]);
    isogi_sh__powers(middle, order, e->b[0], e->b[1]);
    isogi_sh__powers(last, order, e->a[1], -e->a[0]);
    for (l = 0; l < order; l++) {
        isogi_sh__quarter_turn_start(step, edge, l);
        for (k = 0; k < channels; k++) {
            size_t at = (size_t)k + (size_t)channels * ISOGI_SH_COUNT(l);
            for (i = 0; i <= 2 * l; i++) {
                size_t j = at + (size_t)(channels * i);
                band[i] = is_double ? ((const double *)in)[j] : (double)((const float *)in)[j];
            }
            if (l > 0) {
                isogi_sh__turn_z(band, l, first);
                isogi_sh__turn_y(turned, band, l, 0, step, edge);
                isogi_sh__turn_z(turned, l, middle);
                isogi_sh__turn_y(band, turned, l, 1, step, edge);
                isogi_sh__turn_z(band, l, last);
            }
            for (i = 0; i <= 2 * l; i++) {
                size_t j = at + (size_t)(channels * i);
                if (is_double) ((double *)out)[j] = band[i];
                else ((float *)out)[j] = (float)band[i];
            }
        }
    }
}

ISOGI_API isogi_result isogi_sh_rotate_f64(double *out, const double *in, int order, int channels, const double m[9]) {
    isogi_sh__euler e;
    if (!out || !in || !m || !isogi_sh__order_ok(order) || channels < 1 || channels > ISOGI_SH__CHANNELS) return ISOGI_INVALID;
    if (isogi_sh__euler_angles(&e, m) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotate(out, in, 1, order, channels, &e);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_rotate(float *out, const float *in, int order, int channels, const float m[9]) {
    isogi_sh__euler e;
    double r[9];
    int i;
    if (!out || !in || !m || !isogi_sh__order_ok(order) || channels < 1 || channels > ISOGI_SH__CHANNELS) return ISOGI_INVALID;
    for (i = 0; i < 9; i++) r[i] = (double)m[i];
    if (isogi_sh__euler_angles(&e, r) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotate(out, in, 0, order, channels, &e);
    return ISOGI_OK;
}

/* ==== algebra ======================================================================================================== */

ISOGI_API double isogi_sh_dot(const float *a, const float *b, int order) {
    double sum = 0;
    int i, n = order * order;
    if (!a || !b || !isogi_sh__order_ok(order)) return 0;
    for (i = 0; i < n; i++) sum += (double)a[i] * (double)b[i];
    return sum;
}

ISOGI_API isogi_result isogi_sh_convolve_cosine(float *out, const float *in, int order, int channels) {
    double even = ISOGI_SH__PI; /* the factor of the last even degree: A_0 = pi, A_{l+2} = -A_l (l-1) / (l+4) */
    int l, i;
    if (!out || !in || !isogi_sh__order_ok(order) || channels < 1 || channels > ISOGI_SH__CHANNELS) return ISOGI_INVALID;
    for (l = 0; l < order; l++) {
        double factor = l == 1 ? 2 * ISOGI_SH__PI / 3 : l & 1 ? 0 : even;
        for (i = channels * l * l; i < channels * (l + 1) * (l + 1); i++) out[i] = (float)(factor * (double)in[i]);
        if (!(l & 1)) even *= -(double)(l - 1) / (double)(l + 4);
    }
    return ISOGI_OK;
}

/* ==== projection ===================================================================================================== */

/* Node i of n of Gauss-Legendre quadrature on [-1,1], i = 0 nearest to 1, by Newton's method on P_n. */
static void isogi_sh__gauss_legendre(double *node, double *weight, int i, int n) {
    double x = cos(ISOGI_SH__PI * ((double)i + 0.75) / ((double)n + 0.5)), derivative = 1, before = 1;
    int round, k;
    for (round = 0; round < 8; round++) {
        double p = x, step;
        before = 1;
        for (k = 2; k <= n; k++) {
            double next = ((double)(2 * k - 1) * x * p - (double)(k - 1) * before) / (double)k;
            before = p;
            p = next;
        }
        derivative = (double)n * (before - x * p) / (1 - x * x);
        step = p / derivative;
        x -= step;
        if (fabs(step) < 1e-15) break;
    }
    *node = x;
    *weight = 2 / ((1 - x * x) * derivative * derivative);
}

ISOGI_API isogi_result isogi_sh_project_function(double *c, int order, int channels, int resolution,
                                                 void (*function)(void *user, const double direction[3], double *value), void *user) {
    double q[ISOGI_SH_MAX_ORDER], azimuth[2][ISOGI_SH_MAX_ORDER][ISOGI_SH__CHANNELS], value[ISOGI_SH__CHANNELS];
    int i, j, k, l, m, longitudes;
    if (!c || !function || !isogi_sh__order_ok(order) || channels < 1 || channels > ISOGI_SH__CHANNELS || resolution < 0) return ISOGI_INVALID;
    if (resolution == 0) resolution = order;
    if (resolution > 1 << 20) return ISOGI_TOO_LARGE;
    longitudes = 2 * resolution;
    for (i = 0; i < order * order * channels; i++) c[i] = 0;
    for (i = 0; i < resolution; i++) {
        double z, weight, sine, diagonal = 0, power = 1;
        isogi_sh__gauss_legendre(&z, &weight, i, resolution);
        sine = sqrt((1 - z) * (1 + z));
        weight *= 2 * ISOGI_SH__PI / (double)longitudes;
        memset(azimuth, 0, sizeof azimuth);
        for (j = 0; j < longitudes; j++) {
            double phi = 2 * ISOGI_SH__PI * (double)j / (double)longitudes, x = cos(phi), y = sin(phi), cm = 1, sm = 0, t;
            double direction[3];
            direction[0] = sine * x, direction[1] = sine * y, direction[2] = z;
            function(user, direction, value);
            for (m = 0; m < order; m++) {
                for (k = 0; k < channels; k++) azimuth[0][m][k] += cm * value[k], azimuth[1][m][k] += sm * value[k];
                t = x * cm - y * sm;
                sm = x * sm + y * cm;
                cm = t;
            }
        }
        for (m = 0; m < order; m++) {
            diagonal = isogi_sh__next_diagonal(diagonal, m);
            isogi_sh__column(q, order, m, diagonal, z, 0);
            for (l = m; l < order; l++)
                for (k = 0; k < channels; k++) {
                    c[channels * (l * (l + 1) + m) + k] += weight * power * q[l] * azimuth[0][m][k];
                    if (m > 0) c[channels * (l * (l + 1) - m) + k] += weight * power * q[l] * azimuth[1][m][k];
                }
            power *= sine;
        }
    }
    return ISOGI_OK;
}

/* Fejer's first weight for colatitude t = pi (row + 1/2) / rows, on z = cos t: their sum is 2. */
static double isogi_sh__fejer(int row, int rows) {
    double angle = ISOGI_SH__PI * ((double)(2 * row + 1)) / (double)rows, sum = 1, c = cos(angle), now = c, before = 1, next;
    int k;
    for (k = 1; k <= rows / 2; k++) { /* cos(k angle), restarted so that the recursion cannot drift */
        if ((k & 31) == 0) now = cos((double)k * angle), before = cos((double)(k - 1) * angle);
        sum -= 2 * now / ((double)(2 * k - 1) * (double)(2 * k + 1));
        next = 2 * c * now - before;
        before = now;
        now = next;
    }
    return 2 * sum / (double)rows;
}

/* Azimuth sums of one row about the image's pole: sums[(m - first)][channel] = sum over texels of texel e^{i m p}. */
static void isogi_sh__row_sums(double (*cosines)[3], double (*sines)[3], int first, int end, const float *row, int width) {
    double cm, sm, t;
    int i, k, m;
    for (m = 0; m < end - first; m++)
        for (k = 0; k < 3; k++) cosines[m][k] = sines[m][k] = 0;
    for (i = 0; i < width; i++) {
        double p = ISOGI_SH__PI - 2 * ISOGI_SH__PI * (((double)i + 0.5) / (double)width - 0.5), x = cos(p), y = sin(p);
        double r = (double)row[3 * i], g = (double)row[3 * i + 1], b = (double)row[3 * i + 2];
        cm = first ? cos((double)first * p) : 1;
        sm = first ? sin((double)first * p) : 0;
        for (m = 0; m < end - first; m++) {
            cosines[m][0] += cm * r, cosines[m][1] += cm * g, cosines[m][2] += cm * b;
            sines[m][0] += sm * r, sines[m][1] += sm * g, sines[m][2] += sm * b;
            t = x * cm - y * sm;
            sm = x * sm + y * cm;
            cm = t;
        }
    }
}

/* Orders first <= m < end of the projection, in the frame whose z is the image's pole. */
static void isogi_sh__project_rows(float *rgb, int order, int first, int end, const float *image, int width, int height) {
    double total[2][4][ISOGI_SH_MAX_ORDER][3], cosines[4][3], sines[4][3], q[ISOGI_SH_MAX_ORDER];
    int j, k, l, m;
    memset(total, 0, sizeof total);
    for (j = 0; j < height; j++) {
        double t = ISOGI_SH__PI * ((double)j + 0.5) / (double)height, z = cos(t), sine = sin(t), power = 1, diagonal = 0;
        double weight = isogi_sh__fejer(j, height) * 2 * ISOGI_SH__PI / (double)width;
        isogi_sh__row_sums(cosines, sines, first, end, image + 3 * (size_t)width * (size_t)j, width);
        for (m = 0; m < end; m++) {
            diagonal = isogi_sh__next_diagonal(diagonal, m);
            if (m >= first) {
                isogi_sh__column(q, order, m, diagonal, z, 0);
                for (l = m; l < order; l++)
                    for (k = 0; k < 3; k++) {
                        total[0][m - first][l][k] += weight * power * q[l] * cosines[m - first][k];
                        total[1][m - first][l][k] += weight * power * q[l] * sines[m - first][k];
                    }
            }
            power *= sine;
        }
    }
    for (m = first; m < end; m++)
        for (l = m; l < order; l++)
            for (k = 0; k < 3; k++) {
                rgb[3 * (l * (l + 1) + m) + k] = (float)total[0][m - first][l][k];
                if (m > 0) rgb[3 * (l * (l + 1) - m) + k] = (float)total[1][m - first][l][k];
            }
}

static int isogi_sh__image_ok(const float *image, int width, int height) {
    return image && width > 0 && height > 0 && (size_t)width <= (size_t)-1 / 2 / (3 * sizeof(float)) / (size_t)height;
}

/* The image's frame has its pole on z; the world's is y: x y z of the image are z x y of the world. */
static const double isogi_sh__image_to_world[9] = {0, 1, 0, 0, 0, 1, 1, 0, 0};

ISOGI_API isogi_result isogi_sh_project_equirect(float *rgb, int order, const float *image, int width, int height) {
    isogi_sh__euler e;
    int first;
    if (!rgb || !isogi_sh__order_ok(order) || !image || width < 1 || height < 1) return ISOGI_INVALID;
    if (!isogi_sh__image_ok(image, width, height)) return ISOGI_TOO_LARGE;
    for (first = 0; first < order; first += 4)
        isogi_sh__project_rows(rgb, order, first, first + 4 < order ? first + 4 : order, image, width, height);
    if (isogi_sh__euler_angles(&e, isogi_sh__image_to_world) == ISOGI_OK) isogi_sh__rotate(rgb, rgb, 0, order, 3, &e);
    return ISOGI_OK;
}

/* ==== lights ========================================================================================================= */

static int isogi_sh__finite_array(const float *x, size_t count) {
    size_t i;
    for (i = 0; i < count; i++)
        if (!isogi_sh__finite_f32(x[i])) return 0;
    return 1;
}

/* The environment's rotation in double, identity where it is all zero; ISOGI_INVALID unless it is a rotation. */
static isogi_result isogi_sh__env_rotation(double m[9], const isogi_env *env) {
    isogi_sh__euler e;
    int i, zero = 1;
    for (i = 0; i < 9; i++) {
        m[i] = (double)env->rotation[i];
        if (!isogi_sh__finite_f32(env->rotation[i])) return ISOGI_INVALID;
        zero = zero && m[i] >= 0 && m[i] <= 0;
    }
    if (zero) m[0] = m[4] = m[8] = 1;
    return isogi_sh__euler_angles(&e, m);
}

static int isogi_sh__light_ok(const isogi_light *light) {
    int kind = (int)light->kind, vector_is_zero = light->vector[0] >= 0 && light->vector[0] <= 0 && light->vector[1] >= 0 &&
                                                  light->vector[1] <= 0 && light->vector[2] >= 0 && light->vector[2] <= 0;
    if (kind < (int)ISOGI_LIGHT_DIRECTIONAL || kind > (int)ISOGI_LIGHT_SPHERE) return 0;
    if (!isogi_sh__finite_array(light->vector, 3) || !isogi_sh__finite_array(light->rgb, 3)) return 0;
    if (kind == (int)ISOGI_LIGHT_POINT) return 1;
    if (!isogi_sh__finite_f32(light->radius) || light->radius < 0) return 0;
    return kind == (int)ISOGI_LIGHT_SPHERE || (!vector_is_zero && light->radius <= 1.5707964f);
}

ISOGI_API isogi_result isogi_lighting_validate(const isogi_lighting *lighting) {
    const isogi_env *env;
    double m[9];
    size_t i;
    if (!lighting) return ISOGI_INVALID;
    env = &lighting->env;
    if (env->rgb ? env->width < 1 || env->height < 1 : env->width != 0 || env->height != 0) return ISOGI_INVALID;
    if (env->sh ? !isogi_sh__order_ok(env->sh_order) : env->sh_order != 0) return ISOGI_INVALID;
    if (lighting->light_count && !lighting->lights) return ISOGI_INVALID;
    if (isogi_sh__env_rotation(m, env) != ISOGI_OK) return ISOGI_INVALID;
    if (env->rgb && !isogi_sh__image_ok(env->rgb, env->width, env->height)) return ISOGI_TOO_LARGE;
    if (env->rgb && !isogi_sh__finite_array(env->rgb, 3 * (size_t)env->width * (size_t)env->height)) return ISOGI_INVALID;
    if (env->sh && !isogi_sh__finite_array(env->sh, 3 * ISOGI_SH_COUNT(env->sh_order))) return ISOGI_INVALID;
    for (i = 0; i < lighting->light_count; i++)
        if (!isogi_sh__light_ok(&lighting->lights[i])) return ISOGI_INVALID;
    return ISOGI_OK;
}

/* Splits a texel coordinate into the texel left of it and the fraction towards the next. */
static int isogi_sh__split(double *fraction, double x, int size) {
    double low;
    int i;
    x = x > -1 ? x : -1; /* also where x is not a number */
    x = x < (double)size ? x : (double)size;
    low = floor(x);
    i = (int)low;
    *fraction = x - low;
    return i < -1 ? -1 : i > size - 1 ? size - 1 : i;
}

static void isogi_sh__image_radiance(const isogi_env *env, const double d[3], double rgb[3]) {
    double u = 0.5 + atan2(d[0], -d[2]) / (2 * ISOGI_SH__PI), v = atan2(sqrt(d[0] * d[0] + d[2] * d[2]), d[1]) / ISOGI_SH__PI, fu, fv;
    int k, i0 = isogi_sh__split(&fu, u * (double)env->width - 0.5, env->width), i1 = i0 + 1 < env->width ? i0 + 1 : 0;
    int j0 = isogi_sh__split(&fv, v * (double)env->height - 0.5, env->height), j1 = j0 + 1 < env->height ? j0 + 1 : j0;
    const float *row0, *row1;
    if (i0 < 0) i0 = env->width - 1;
    if (j0 < 0) j0 = 0;
    row0 = env->rgb + 3 * (size_t)env->width * (size_t)j0;
    row1 = env->rgb + 3 * (size_t)env->width * (size_t)j1;
    for (k = 0; k < 3; k++) {
        double top = (1 - fu) * (double)row0[3 * (size_t)i0 + (size_t)k] + fu * (double)row0[3 * (size_t)i1 + (size_t)k];
        double bottom = (1 - fu) * (double)row1[3 * (size_t)i0 + (size_t)k] + fu * (double)row1[3 * (size_t)i1 + (size_t)k];
        rgb[k] += (1 - fv) * top + fv * bottom;
    }
}

ISOGI_API void isogi_env_radiance(const isogi_env *env, const float direction[3], float rgb[3]) {
    double total[3] = {0, 0, 0}, sum[3], d[3], m[9];
    isogi_sh__unit u = isogi_sh__normalise((double)direction[0], (double)direction[1], (double)direction[2]);
    int k, zero = 1;
    for (k = 0; k < 9; k++) {
        m[k] = (double)env->rotation[k];
        zero = zero && m[k] >= 0 && m[k] <= 0;
    }
    d[0] = u.x, d[1] = u.y, d[2] = u.z;
    if (!zero)
        for (k = 0; k < 3; k++) d[k] = m[k] * u.x + m[3 + k] * u.y + m[6 + k] * u.z;
    if (env->rgb && env->width > 0 && env->height > 0) isogi_sh__image_radiance(env, d, total);
    if (env->sh && isogi_sh__order_ok(env->sh_order)) {
        isogi_sh__sum(sum, env->sh, env->sh_order, 3, zero ? u : isogi_sh__normalise(d[0], d[1], d[2]));
        for (k = 0; k < 3; k++) total[k] += sum[k];
    }
    for (k = 0; k < 3; k++) rgb[k] = (float)total[k];
}

/* Adds a light as it arrives at a point. A point light at the point itself adds nothing; inside a spherical one its light comes
   evenly from everywhere. */
static void isogi_sh__add_light(float *c, int order, const isogi_light *light, const float point[3]) {
    double scale[ISOGI_SH_MAX_ORDER], rgb[3], d[3], cosine = 1, factor = 1;
    int k, l;
    for (k = 0; k < 3; k++) d[k] = (double)light->vector[k];
    if (light->kind == ISOGI_LIGHT_DIRECTIONAL) {
        cosine = cos((double)light->radius);
    } else {
        double square, radius = light->kind == ISOGI_LIGHT_SPHERE ? (double)light->radius : 0;
        for (k = 0; k < 3; k++) d[k] -= point ? (double)point[k] : 0;
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if (square <= 0 && radius <= 0) return;
        if (square > radius * radius) {
            factor = 1 / square;
            cosine = sqrt((square - radius * radius) / square);
        } else {
            cosine = -1; /* all around, with the radiance of the sphere's surface: I / (pi r^2) */
            factor = 1 / (ISOGI_SH__PI * radius * radius);
        }
    }
    if (cosine < 0) {
        for (l = 1; l < order; l++) scale[l] = 0;
        scale[0] = 4 * ISOGI_SH__PI;
    } else {
        isogi_sh__disc(scale, order, cosine);
    }
    for (k = 0; k < 3; k++) rgb[k] = factor * (double)light->rgb[k];
    isogi_sh__add_lobe(c, order, scale, isogi_sh__normalise(d[0], d[1], d[2]), rgb);
}

ISOGI_API isogi_result isogi_sh_project(float *rgb, int order, const isogi_lighting *lighting, const float point[3]) {
    const isogi_env *env;
    isogi_result result;
    isogi_sh__euler e;
    double m[9];
    size_t i, n = 3 * (isogi_sh__order_ok(order) ? ISOGI_SH_COUNT(order) : 0);
    if (!rgb || !isogi_sh__order_ok(order) || (point && !isogi_sh__finite_array(point, 3))) return ISOGI_INVALID;
    result = isogi_lighting_validate(lighting);
    if (result != ISOGI_OK) return result;
    env = &lighting->env;
    if (env->rgb) {
        result = isogi_sh_project_equirect(rgb, order, env->rgb, env->width, env->height);
        if (result != ISOGI_OK) return result;
    } else {
        for (i = 0; i < n; i++) rgb[i] = 0;
    }
    if (env->sh) {
        size_t m_count = 3 * ISOGI_SH_COUNT(env->sh_order < order ? env->sh_order : order);
        for (i = 0; i < m_count; i++) rgb[i] += env->sh[i];
    }
    if ((env->rgb || env->sh) && isogi_sh__env_rotation(m, env) == ISOGI_OK && isogi_sh__euler_angles(&e, m) == ISOGI_OK)
        isogi_sh__rotate(rgb, rgb, 0, order, 3, &e);
    for (i = 0; i < lighting->light_count; i++) isogi_sh__add_light(rgb, order, &lighting->lights[i], point);
    return ISOGI_OK;
}

#undef ISOGI_SH__PI
#undef ISOGI_SH__LANES
#undef ISOGI_SH__CHANNELS
#endif /* implementation */
