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
