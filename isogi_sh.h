/* isogi_sh.h - spherical harmonics and lights, for C and C++        (part of isogi; needs nothing but libc and libm)

   Quick start

       #define ISOGI_IMPLEMENTATION
       #include "isogi_sh.h"
       #include <stdio.h>
       int main(void) {
           static isogi_light sun; // static: all zero, which is the default everywhere
           static isogi_lighting lighting;
           const float up[1][3] = {{0, 1, 0}};
           float light[3 * 25], irradiance[3];
           sun.vector[0] = sun.vector[1] = 1, sun.rgb[0] = sun.rgb[1] = 3, sun.rgb[2] = 2, sun.radius = 0.1f;
           lighting.lights = &sun, lighting.light_count = 1;
           isogi_sh_project(light, 5, &lighting, NULL);                       // radiance, order 5: 25 coefficients x RGB
           isogi_sh_convolve_cosine(light, light, 5, 3);                      // radiance to irradiance
           isogi_sh_eval_sum(irradiance, light, 5, 3, up, 1);                 // on a surface that faces up
           printf("%g %g %g\n", irradiance[0], irradiance[1], irradiance[2]); // about 3 cos 45 = 2.1 in red
       }

   What it does

   - Evaluates real spherical harmonics to degree 100 in float and double, in both layouts, with gradients, and whole expansions.
   - Projects functions, samples, equirectangular and cube images, and lights onto them.
   - Rotates expansions by matrix, quaternion, axis and angle, or Euler angles, in float and double: once, or built once and applied
     many times.
   - Multiplies, convolves, windows, de-rings, mirrors and converts expansions; fits "ambient + one directional light" to them.
   - Owns the description of lights that isogi_trace.h and isogi_dvr.h use.

   What it does NOT do

   - No complex harmonics, no spin weights, no fast transforms for thousands of degrees.
   - No files and no images but arrays of floats that you own. No allocation, no threads, no state: pure functions.

   Which function?

   - an image or lights into coefficients   isogi_sh_project, isogi_sh_project_equirect, isogi_sh_project_cube
   - light on a surface with normal n       isogi_sh_convolve_cosine once, then isogi_sh_eval_sum at n
   - turn an environment                    isogi_sh_rotate; for many expansions isogi_sh_rotation_build and _apply
   - transfer times light                   isogi_sh_dot; visibility times light, kept as SH: isogi_sh_product
   - rings around bright lights             isogi_sh_window with a width of about the order, or isogi_sh_dering
   - coefficients from other software       isogi_sh_convert

   How many coefficients? Order 3 (9) holds all but 1 % of the energy of irradiance, but under a single small light errs by up to 9 % of
   its largest value (order 5: 6 %); order 5 (25) holds visibility and soft light; a light of angular radius a is seen as such from order
   pi / a on. Energy left in the last band (isogi_sh_band_energy) tells what the order misses.

   What a window costs: every window blurs, and at width = order keeps half (Lanczos 64 %) of degree order / 2. The deepest ring of a
   delta at order 8 is 14 % of its peak; with a Hann, Lanczos or Gauss window of that width 2.9, 4.5 and 2.7 %. To leave nothing
   negative isogi_sh_dering has to go down to widths of 1.4 to 1.7 for it, and 2.1 to 2.7 for a hard hemisphere.

   Options, to be defined before the implementation

   - ISOGI_IMPLEMENTATION       implements every isogi header that the file includes
   - ISOGI_SH_IMPLEMENTATION    implements this one alone
   - ISOGI_NO_SIMD              plain C only; else SSE2 or NEON, and on x86-64 AVX2 or AVX-512, chosen at run time (gcc 12 or later, clang)
   - ISOGI_SH_LEVEL             0 SSE2 or NEON, 1 AVX2, 2 AVX-512: uses at most this level
   - ISOGI_API                  linkage of public functions, if extern does not suit

   Memory       None allocated. Stack use stays below 32 KB (below 60 where the compiler does not optimise).
   Threads      Every function is pure: call them from any thread.
   Speed        Batches of 16 directions and more (8 of doubles) use all lanes of AVX2 and AVX-512, whatever the count; a direction alone
                takes up to five times its share of a batch up to order 5, eight times beyond. Results that stay in the first-level cache,
                such as 64 directions at order 11, take half or a third of the time; rows of a structure of arrays that are a multiple of
                4096 bytes long take twice as long again, since all functions of a direction compete for the same lines of the cache.
   Determinism  The same input on the same instruction path gives the same bits. Paths agree within the float errors below.
   Accuracy     Largest absolute error against 128 bits, poles and all: double 1e-15 at degree 4, 5e-15 at 10, 2e-14 at 20, 1.5e-13 at 50,
                7e-13 at 100 (all near poles, some .01 to .1 off them, for m = 0 and +-1; up to twice as much in x87 registers, as on
                32-bit x86); float 4.5e-7 at 4, 2.2e-6 at 10, 1e-5 at 20, and 3e-7 beyond, where floats are rounded doubles. Gradients,
                which grow as degree^1.5, in double 4e-15 at degree 4, 4e-14 at 10, 4e-13 at 20, 7e-11 (of 284) at 100; in float those
                rounded. tests/test_sh.c states and checks each.
                All bounds assume IEEE arithmetic: -ffast-math may reorder what cancels, and costs up to four times as much, six at
                degree 100. Where denormal numbers are flushed to zero (FTZ, DAZ), vectors shorter than 1e-37 (double 1e-307) have no
                direction.
   Limits       Order 1..101 (degree 0..100), 1..16 channels. Counts times order^2 must be addressable, random samples up to 2^30, and a
                function's resolution up to 2^20: else ISOGI_TOO_LARGE. Any rounding mode will do; floating-point exceptions must not
                trap (feenableexcept), as compilers divide before they ask whether they may.

   Conventions  Real, orthonormal, without the Condon-Shortley phase, index i = l (l + 1) + m (ACN). Y1..Y3 = sqrt(3 / 4 pi) (y, z, x).
                An expansion of several channels is interleaved: c[channels i + channel]. Directions need not be normalised.
                A rotation matrix is row-major and takes old directions to new ones: w = R v.

   History  1.0  first release
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
                                    radius: angular radius in radians, up to pi / 2; 0 = a mathematical direction */
    ISOGI_LIGHT_POINT,           /* vector: position; rgb: radiant intensity, so that E = rgb cos / distance^2; radius unused */
    ISOGI_LIGHT_SPHERE,          /* vector: centre; rgb: radiant intensity as seen from afar; radius: world units */
    ISOGI_LIGHT_RECTANGLE        /* vector: centre; edge: its two sides (world), at right angles to 1e-3; it shines to the side of
                                    edge[0] x edge[1] alone; rgb: radiant intensity along that normal, so its radiance is rgb / area */
} isogi_light_kind;

typedef struct isogi_light {
    isogi_light_kind kind;
    float vector[3], rgb[3], radius;
    float edge[2][3]; /* RECTANGLE alone; corners at vector +- edge[0] / 2 +- edge[1] / 2 */
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

/* Checks a lighting description: sizes, finite values, rotation within 1e-3 (isogi_sh_rotate) or zero. NULL is ISOGI_INVALID. */
ISOGI_API isogi_result isogi_lighting_validate(const isogi_lighting *lighting);
/* What is wrong with it: the member at fault and why, as "env.rotation: ...", for whoever writes the program; NULL where it is valid. */
ISOGI_API const char *isogi_lighting_fault(const isogi_lighting *lighting);

/* Radiance that arrives from `direction` (world, any length > 0) out of the environment alone: image (bilinear, wrapped in
   longitude, clamped at the poles) plus SH. */
ISOGI_API void isogi_env_radiance(const isogi_env *env, const float direction[3], float rgb[3]);

/* ---- spherical harmonics: evaluation ---- */

/* Real, orthonormal, no Condon-Shortley phase; index i = l(l+1)+m (ACN); so Y1..Y3 = sqrt(3/(4 pi)) (y, z, x).
   "order n" keeps degrees 0..n-1: n*n coefficients. Coefficients of several channels are interleaved: c[channels*i + channel]. */
#define ISOGI_SH_MAX_ORDER 101
#define ISOGI_SH_COUNT(order) ((size_t)(order) * (size_t)(order))

/* y[count][order*order]: every basis function at every direction. Directions are normalised first; the zero vector (and any
   vector that is not finite) counts as +z. */
ISOGI_API isogi_result isogi_sh_eval(float *y, int order, const float (*direction)[3], size_t count);
ISOGI_API isogi_result isogi_sh_eval_f64(double *y, int order, const double (*direction)[3], size_t count);

/* The same as structures of arrays: coordinates x[count], y[count], z[count]; basis[order*order][count]. */
ISOGI_API isogi_result isogi_sh_eval_soa(float *basis, int order, const float *x, const float *y, const float *z, size_t count);
ISOGI_API isogi_result isogi_sh_eval_soa_f64(double *basis, int order, const double *x, const double *y, const double *z, size_t count);

/* gradient[count][order*order]: Cartesian gradient of Y_i(d / |d|) at the normalised direction: tangent to the sphere, finite
   everywhere, poles included. */
ISOGI_API isogi_result isogi_sh_eval_gradient(float (*gradient)[3], int order, const float (*direction)[3], size_t count);
ISOGI_API isogi_result isogi_sh_eval_gradient_f64(double (*gradient)[3], int order, const double (*direction)[3], size_t count);

/* value[count][channels] = sum over i of c[channels*i + channel] Y_i(direction): the expansion itself. */
ISOGI_API isogi_result isogi_sh_eval_sum(float *value, const float *c, int order, int channels, const float (*direction)[3], size_t count);
ISOGI_API isogi_result isogi_sh_eval_sum_f64(double *value, const double *c, int order, int channels, const double (*direction)[3],
                                             size_t count);

/* ---- projection ---- */

/* Coefficients of a function on the sphere: `function` writes `channels` values for a unit direction. Gauss-Legendre in
   latitude times uniform in longitude with `resolution` latitudes (0 = order): exact to rounding when the function is
   band-limited to degree <= 2*resolution - order. c[order*order][channels]; channels 1..16. */
ISOGI_API isogi_result isogi_sh_project_function(double *c, int order, int channels, int resolution,
                                                 void (*function)(void *user, const double direction[3], double *value), void *user);

/* The same by Monte Carlo, for functions with edges: `samples` directions from `seed`, independent, or one in each cell of an
   equal-area grid where stratified is not 0 (samples is then rounded up to a full grid). */
ISOGI_API isogi_result isogi_sh_project_random(double *c, int order, int channels, size_t samples, int stratified, uint64_t seed,
                                               void (*function)(void *user, const double direction[3], double *value), void *user);

/* c = sum over j of weight[j] value[j][channel] Y(direction[j]). For uniformly distributed samples the weight is 4 pi / count, which
   weight = NULL stands for. */
ISOGI_API isogi_result isogi_sh_project_samples(double *c, int order, int channels, const float (*direction)[3], const float *value,
                                                const float *weight, size_t count);

/* Coefficients (RGB interleaved) of an equirectangular RGB image laid out and oriented as in isogi_env. Fejer weights in latitude:
   coefficients of degree l of an image of degrees up to n are exact where l + n < height and width; what rows and columns cannot tell apart
   (degrees l >= height; of orders about the image's axis, which is y, those with 2 m >= width) is zero. Sums end at FLT_MAX; pixels are
   not checked. The second takes any number of channels, 1..16. */
ISOGI_API isogi_result isogi_sh_project_equirect(float *rgb, int order, const float *image, int width, int height);
ISOGI_API isogi_result isogi_sh_project_image(float *c, int order, int channels, const float *image, int width, int height);

/* Cube map: face[0..5] are +x -x +y -y +z -z, each size x size x channels. In a face, s in [-1,1] runs to the right and t downwards,
   as graphics interfaces have it: directions (1,-t,-s) (-1,-t,s) (s,1,t) (s,-1,-t) (s,-t,1) (-s,-t,-1). Exact solid angles;
   the function is taken at texel centres, so that the error falls as 1 / size^2. */
ISOGI_API isogi_result isogi_sh_project_cube(float *c, int order, int channels, const float *const face[6], int size);

/* Coefficients (RGB interleaved) of the radiance of everything in `lighting` as it arrives at `point` (world; NULL = origin):
   environment rotated, directional lights as deltas (or discs), point and sphere lights with their attenuation there. A point light
   at the very point adds nothing; inside a spherical one its light comes evenly from everywhere. Rectangles exactly, by integrals along
   their edges: to the rounding of floats (1e-7 of the largest coefficient), as if the point were 1e-14 of the distance elsewhere; the
   cost, like that of rotating four expansions, does not depend on how near, large or long they are.
   Results are finite: a light that comes to more than 1e37 (next to a point light it would) is dimmed to that; sums end at FLT_MAX. */
ISOGI_API isogi_result isogi_sh_project(float *rgb, int order, const isogi_lighting *lighting, const float point[3]);

/* ---- rotation ---- */

/* Rotates: out expands f(R^-1 w), so that a lobe towards d turns into a lobe towards R d; m is R, row-major. ISOGI_INVALID unless
   m is a rotation: entries of m m^T within 1e-3 of those of 1, determinant above 0; the nearest Euler angles are used where it is off by
   more than 1e-6. out may be in. Wigner's d(pi/2) between rotations about z: exact at any degree, where the recursion of Ivanic and
   Ruedenberg (1996, 1998) loses digits beyond 30. One channel of order 3 to 5 in float is turned as tensors by the matrix as it is, whose
   roundings add up: up to 1e-3 of the norm after 10,000 calls with one matrix; others drift by 2e-5 of it, and in double by 2e-12. To go
   on turning, rotate the first expansion by the product of the matrices, or use double. */
ISOGI_API isogi_result isogi_sh_rotate(float *out, const float *in, int order, int channels, const float m[9]);
ISOGI_API isogi_result isogi_sh_rotate_f64(double *out, const double *in, int order, int channels, const double m[9]);

/* About z alone, by an angle in radians. */
ISOGI_API isogi_result isogi_sh_rotate_z(float *out, const float *in, int order, int channels, double angle);
ISOGI_API isogi_result isogi_sh_rotate_z_f64(double *out, const double *in, int order, int channels, double angle);

/* Built once, applied many times: order (4 order^2 - 1) / 3 numbers, degree by degree a (2l+1)^2 matrix column by column: column j
   is the rotated basis function j, and entry (i, j) stands at (2l+1) j + i. out must not overlap in. */
#define ISOGI_SH_ROTATION_COUNT(order) ((size_t)(order) * (4 * (size_t)(order) * (size_t)(order) - 1) / 3)
ISOGI_API isogi_result isogi_sh_rotation_build(float *rotation, int order, const float m[9]);
ISOGI_API isogi_result isogi_sh_rotation_build_f64(double *rotation, int order, const double m[9]);
ISOGI_API isogi_result isogi_sh_rotation_apply(float *out, const float *in, int order, int channels, const float *rotation);
ISOGI_API isogi_result isogi_sh_rotation_apply_f64(double *out, const double *in, int order, int channels, const double *rotation);

/* Rotation matrices: from a quaternion (w, x, y, z; any length > 0), an axis (any length > 0) and an angle (radians, right-handed),
   and Euler angles Z(a) Y(b) Z(c), c applied first. Entries are right to 2e-15, and rounded to float. */
ISOGI_API isogi_result isogi_sh_matrix_from_quaternion(float m[9], const float quaternion[4]);
ISOGI_API isogi_result isogi_sh_matrix_from_axis_angle(float m[9], const float axis[3], double angle);
ISOGI_API isogi_result isogi_sh_matrix_from_euler_zyz(float m[9], double a, double b, double c);
ISOGI_API isogi_result isogi_sh_matrix_from_quaternion_f64(double m[9], const double quaternion[4]);
ISOGI_API isogi_result isogi_sh_matrix_from_axis_angle_f64(double m[9], const double axis[3], double angle);
ISOGI_API isogi_result isogi_sh_matrix_from_euler_zyz_f64(double m[9], double a, double b, double c);

/* f with one coordinate negated: axis 0, 1, 2 = x, y, z. out may be in. */
ISOGI_API isogi_result isogi_sh_mirror(float *out, const float *in, int order, int channels, int axis);

/* ---- algebra; out may be in unless it says otherwise ---- */

/* Integral over the sphere of the product of two expansions: sum of a_i b_i. */
ISOGI_API double isogi_sh_dot(const float *a, const float *b, int order);

/* out = a + b, factor a, and (1-t) a + t b */
ISOGI_API isogi_result isogi_sh_add(float *out, const float *a, const float *b, int order, int channels);
ISOGI_API isogi_result isogi_sh_scale(float *out, const float *a, float factor, int order, int channels);
ISOGI_API isogi_result isogi_sh_lerp(float *out, const float *a, const float *b, float t, int order, int channels);

/* Expansion of the product of two functions, truncated to their order: `count` products of single-channel expansions, each
   order*order long. Exact: the triple products of Y are integrated by Gauss-Legendre. out must not overlap a or b. */
ISOGI_API isogi_result isogi_sh_product(float *out, const float *a, const float *b, int order, size_t count);

/* matrix[order*order][order*order], row-major and symmetric, so that matrix * b = product of f and b. Not for a matrix that overlaps f. */
ISOGI_API isogi_result isogi_sh_product_matrix(float *matrix, const float *f, int order);

/* Convolution with an axis-symmetric kernel of zonal coefficients z[order] (its expansion when it stands around +z): scales degree
   l by sqrt(4 pi / (2l+1)) z[l]. */
ISOGI_API isogi_result isogi_sh_convolve(float *out, const float *in, int order, int channels, const float *zonal);

/* Radiance to irradiance: convolves with the clamped cosine, in place or not. Irradiance at normal n is then sum out_i Y_i(n). */
ISOGI_API isogi_result isogi_sh_convolve_cosine(float *out, const float *in, int order, int channels);

/* Zonal coefficients of the clamped cosine around +z. */
ISOGI_API isogi_result isogi_sh_cosine_zonal(float *zonal, int order);

/* c[order*order] = the axis-symmetric function of zonal coefficients z[order], turned from +z to `direction`. To the rounding
   of floats, at order 5 to 4.5e-7 of the largest z. */
ISOGI_API isogi_result isogi_sh_zonal_to_direction(float *c, int order, const float *zonal, const float direction[3]);

/* Factors that fade high degrees, against rings. width > 0 and finite, in degrees: HANN (1 + cos(pi l / width)) / 2 and LANCZOS
   sin(pi l / width) / (pi l / width) below width, 0 from there on; GAUSS 2^-(2 l / width)^2. */
typedef enum isogi_sh_window_kind { ISOGI_SH_HANN = 0, ISOGI_SH_LANCZOS, ISOGI_SH_GAUSS } isogi_sh_window_kind;
ISOGI_API isogi_result isogi_sh_window(float *out, const float *in, int order, int channels, isogi_sh_window_kind kind, double width);

/* The widest (weakest) window under which no channel is negative anywhere: certainly nothing below -1e-5 of its largest value is left,
   and windows that are wider by steps of 2 % all leave something below -1e-6. width (may be NULL) receives it, at most 1e-5 of it too
   narrow, or 0 where none is needed (which isogi_sh_window does not take). It takes 1 to 10 milliseconds a channel at order 8, 5 to 80 at
   16, and up to two seconds at 32, longest where a bright light stands in a dark sky. ISOGI_INVALID where a channel's mean is negative.
   Order 32 at most, else ISOGI_TOO_LARGE. */
ISOGI_API isogi_result isogi_sh_dering(float *out, const float *in, int order, int channels, isogi_sh_window_kind kind, double *width);

/* energy[order]: the sum of squares over each degree and all channels. */
ISOGI_API isogi_result isogi_sh_band_energy(double *energy, const float *c, int order, int channels);

/* How coefficients of the same function look elsewhere. All zero is this header's convention. */
typedef enum isogi_sh_normalisation {
    ISOGI_SH_ORTHONORMAL = 0,
    ISOGI_SH_N3D, /* basis times sqrt(4 pi): mean square 1; geodesy's "4 pi" */
    ISOGI_SH_SN3D /* Schmidt: N3D / sqrt(2l+1) */
} isogi_sh_normalisation;
typedef enum isogi_sh_ordering {
    ISOGI_SH_ACN = 0, /* m = -l .. l */
    ISOGI_SH_SID,     /* m = l, -l, l-1, -(l-1), .. 0 */
    ISOGI_SH_PAIRS,   /* m = 0, 1, -1, 2, -2, .. */
    ISOGI_SH_FUMA     /* Furse and Malham's W XYZ RSTUV KLMNOPQ: SID in degree 1, else PAIRS. Their coefficients are SN3D's of no
                         Condon-Shortley phase times 1/sqrt 2 (W); 1 (X Y Z R K); 2/sqrt 3 (S T U V); sqrt(45/32) (L M);
                         3/sqrt 5 (N O); sqrt(8/5) (P Q) */
} isogi_sh_ordering;
typedef struct isogi_sh_convention {
    isogi_sh_normalisation normalisation;
    isogi_sh_ordering ordering;
    int condon_shortley; /* not 0: basis functions carry (-1)^m */
} isogi_sh_convention;
/* Coefficients of a function under `from` into those of the same function under `to`. out must not overlap in. */
ISOGI_API isogi_result isogi_sh_convert(float *out, const float *in, int order, int channels, isogi_sh_convention from,
                                        isogi_sh_convention to);

/* ---- simple environments and fits; RGB interleaved ---- */

/* Radiance rgb from everywhere; from a cone of half_angle (radians, 0..pi or pi as a float) around `axis`; from a hemisphere `sky`
   around `up` and `ground` below it; and from a sky that runs linearly in height from ground (at -up) to sky (at up). Axes of any
   length > 0. */
ISOGI_API isogi_result isogi_sh_constant(float *c, int order, const float rgb[3]);
ISOGI_API isogi_result isogi_sh_cone(float *c, int order, const float axis[3], double half_angle, const float rgb[3]);
ISOGI_API isogi_result isogi_sh_hemisphere_sky(float *c, int order, const float up[3], const float sky[3], const float ground[3]);
ISOGI_API isogi_result isogi_sh_gradient_sky(float *c, int order, const float up[3], const float sky[3], const float ground[3]);

/* The direction most light comes from: that of degree 1 of the luminance (Rec. 709); +z where there is none. Order >= 2. rgb (may be NULL):
   irradiance of the one directional light there that gives surfaces the closest irradiance, in the mean of squares and as far as `order`
   knows either: the coefficients of a light give that light. */
ISOGI_API isogi_result isogi_sh_dominant_direction(float direction[3], float rgb[3], const float *c, int order);

/* The same with an ambient term: irradiance `rgb` from `direction` plus radiance `ambient` from everywhere. Neither is negative. */
ISOGI_API isogi_result isogi_sh_fit_directional(float direction[3], float rgb[3], float ambient[3], const float *c, int order);

#endif /* ISOGI_SH_H */

#if (defined(ISOGI_IMPLEMENTATION) || defined(ISOGI_SH_IMPLEMENTATION)) && !defined(ISOGI_SH_IMPLEMENTED)
#define ISOGI_SH_IMPLEMENTED

#include <math.h>
#include <string.h>

#define ISOGI_SH__PI 3.14159265358979323846
#define ISOGI_SH__LANES 8     /* directions that the plain code evaluates together */
#define ISOGI_SH__CHANNELS 16 /* the most that one call takes */
#define ISOGI_SH__TABLE_ORDER 21 /* what is tabled */
#define ISOGI_SH__TURNS 15        /* the highest degree whose quarter turn is tabled */
#define ISOGI_SH__TOGETHER 4  /* channels, or columns of a matrix, that are rotated in one pass */
#define ISOGI_SH__DERING_ORDER 32
#define ISOGI_SH__GROUP 5     /* orders m that are projected in one pass */

/* 16-byte vectors where the compiler's target has them; 32 and 64 bytes by the processor that runs. gcc for Windows does not align its
   stack for those. Not where floats are computed in x87 registers, whose scalars do not mix with vectors. */
#if !defined(ISOGI_NO_SIMD) && (defined(__SSE2__) || defined(__ARM_NEON)) && \
    (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 12)) && \
    !(defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ == 2)
#define ISOGI_SH__VECTORS 1
#endif
#if !defined(ISOGI_NO_SIMD) && defined(__x86_64__) && (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 12 && !defined(_WIN32)))
#define ISOGI_SH__SIMD 1
#include <immintrin.h>
#endif
#if defined(__clang__)
#define ISOGI_SH__UNROLL _Pragma("unroll 5")
#define ISOGI_SH__UNROLL9 _Pragma("unroll 9")
#define ISOGI_SH__UNROLL25 _Pragma("unroll 25")
#elif defined(__GNUC__) && __GNUC__ >= 8
#define ISOGI_SH__UNROLL _Pragma("GCC unroll 5")
#define ISOGI_SH__UNROLL9 _Pragma("GCC unroll 9")
#define ISOGI_SH__UNROLL25 _Pragma("GCC unroll 25")
#else
#define ISOGI_SH__UNROLL
#define ISOGI_SH__UNROLL9
#define ISOGI_SH__UNROLL25
#endif

#if defined(__GNUC__)
#define ISOGI_SH__INLINE static inline __attribute__((always_inline))
#define ISOGI_SH__APART static __attribute__((noinline))
#else
#define ISOGI_SH__INLINE static inline
#define ISOGI_SH__APART static
#endif

/* ==== numbers ======================================================================================================== */

/* By their bits, so that -ffast-math cannot fold the question away. */
static int isogi_sh__finite_f32(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

ISOGI_SH__INLINE double isogi_sh__get(const void *in, int is_double, int i) {
    return is_double ? ((const double *)in)[i] : (double)((const float *)in)[i];
}

/* |x| < limit; not for NaN */
ISOGI_SH__INLINE int isogi_sh__below(float x, float limit) {
    uint32_t bits, most;
    memcpy(&bits, &x, sizeof bits);
    memcpy(&most, &limit, sizeof most);
    return (bits & 0x7fffffffu) < most;
}

static int isogi_sh__finite_f64(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & ((uint64_t)0x7ff << 52)) != (uint64_t)0x7ff << 52;
}

static int isogi_sh__finite_array(const float *x, size_t count) {
    size_t i;
    for (i = 0; i < count; i++)
        if (!isogi_sh__finite_f32(x[i])) return 0;
    return 1;
}

static int isogi_sh__order_ok(int order) { return order >= 1 && order <= ISOGI_SH_MAX_ORDER; }

/* an order and a number of interleaved channels */
static int isogi_sh__shape_ok(int order, int channels) {
    return isogi_sh__order_ok(order) && channels >= 1 && channels <= ISOGI_SH__CHANNELS;
}

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

/* For results in float: squares of floats stay within the range of double, and the low part of z does not show up to order 5. Lengths that
   differ from 1 by little take no root: the next term is 5/16 e^3. */
ISOGI_SH__INLINE isogi_sh__unit isogi_sh__normalise_f32(const float d[3]) {
    isogi_sh__unit u = {0, 0, 1, 0};
    double x = (double)d[0], y = (double)d[1], z = (double)d[2], square = x * x + y * y + z * z, e = 1 - square, inverse;
    if (!isogi_sh__finite_f64(square) || square <= 0) return u;
    inverse = fabs(e) < 1e-3 ? 1 + e * (0.5 + 0.375 * e) : 1 / sqrt(square);
    u.x = x * inverse, u.y = y * inverse, u.z = z * inverse;
    return u;
}

/* ==== basis functions ================================================================================================ */

/* Y_l^{+-m} = q_l (c_m, s_m) with c_m + i s_m = (x + i y)^m = sin^m t e^{i m p}: no trigonometry, nothing singular at the poles.
   q follows P_l^m, normalised: q_l = a_l z q_{l-1} - a_l / a_{l-1} q_{l-2}, a_l = sqrt((4 l^2 - 1) / (l^2 - m^2)), which is stable
   upwards. q grows to 1e20 at most where s_m is as small, up to degree 100: neither leaves the range of a float. */
/* Written by tests/generate_sh.h, which tests/test_sh.c compares with this.
   table: for each degree l of m = 0 the factors (l-1)/l, -(2l-1)/l, sqrt((2l+1)/(4 pi)); then for each m > 0 the diagonal q_m and for
   each l > m the factors a_l, -a_l / a_{l-1} of the recursion.
   columns: the same of m = 0; then for each odd m q_m, a_{m+1}, q_{m+1}, and for each l > m + 1 the factors of columns m and m + 1.
   polynomials: for m = 0 .. 10, l = m .. 10 those of isogi_sh__eval_f8_low and its like, the highest coefficient first; then for
   m = 0 .. 4, l = m + 6 .. 10 the factors of a recursion over even and odd l - m: see NAME_function of ISOGI_SH__DEFINE_ELEVEN.
   turn: for l = 1 .. 15, n = 0 .. l, m = n .. l the entries of a quarter turn about y, see isogi_sh__turn_y.
   turn_columns: for l = 1 .. 15, m = 0 .. l all entries (n, m) of it, those of even n, then those of odd n.
   latitudes: for m = 0 .. 4, l = m .. 4 the values q_l^m sin^m at 7 Legendre nodes (and an empty lane); pi times their weights. */
/* generated: begin */
static const double isogi_sh__table_f64[463] = {
    0.0, 0.0, 0.28209479177387814, 0.0, -1.0, 0.48860251190291992, 0.5, -1.5, 0.63078313050503998, 0.66666666666666663,
    -1.6666666666666667, 0.7463526651802308, 0.75, -1.75, 0.84628437532163447, 0.80000000000000004, -1.8, 0.9356025796273888,
    0.83333333333333337, -1.8333333333333333, 1.0171072362820548, 0.8571428571428571, -1.8571428571428572, 1.0925484305920792,
    0.875, -1.875, 1.1631066229203195, 0.88888888888888884, -1.8888888888888888, 1.2296226898414837, 0.90000000000000002,
    -1.8999999999999999, 1.2927207364566027, 0.90909090909090906, -1.9090909090909092, 1.3528790949515024,
    0.91666666666666663, -1.9166666666666667, 1.4104739588693906, 0.92307692307692313, -1.9230769230769231,
    1.4658075357087597, 0.9285714285714286, -1.9285714285714286, 1.5191269449366245, 0.93333333333333335, -1.9333333333333333,
    1.5706373285785544, 0.9375, -1.9375, 1.6205112036071436, 0.94117647058823528, -1.9411764705882353, 1.6688952945311364,
    0.94444444444444442, -1.9444444444444444, 1.7159156293944244, 0.94736842105263153, -1.9473684210526316,
    1.7616814099864819, 0.94999999999999996, -1.95, 1.8062879984608917, 0.48860251190291992, 2.2360679774997898, 0.0,
    2.0916500663351889, -0.93541434669348533, 2.0493901531919199, -0.9797958971132712, 2.0310096011589902,
    -0.99103120896511487, 2.0213149892370277, -0.99522670305623862, 2.0155644370746373, -0.99715504402183208,
    2.0118695404073912, -0.99816681789017425, 2.0093531297410121, -0.99874921777190895, 2.0075614636426526,
    -0.99910833687128453, 2.0062402647738877, -0.99934188870792151, 2.0052378963551982, -0.9995003746877732,
    2.0044593143431828, -0.99961172586383362, 2.0038424627162224, -0.99969226034045866, 2.0033454163331039,
    -0.99975195336341716, 2.0029390170153341, -0.99979713966725037, 2.0026024734496528, -0.99983197513113353,
    2.0023206350873464, -0.99985926394976399, 2.0020822493927, -0.99988094529394089, 2.0018788167600157, -0.99989838947288712,
    0.54627421529603959, 2.6457513110645907, 0.0, 2.2912878474779199, -0.8660254037844386, 2.1712405933672376,
    -0.94760708295868568, 2.1139418156609704, -0.97361012046232687, 2.0816659994661326, -0.9847319278346619,
    2.0615528128088303, -0.9903379376602871, 2.0481223583578192, -0.99348527267040398, 2.0386883037875112,
    -0.99539380324041182, 2.0317984959648752, -0.99662047022596034, 2.026608708444444, -0.99744571741206722,
    2.0225995873897262, -0.99802175869569076, 2.0194368026754388, -0.99843627738579288, 2.0168969490698876,
    -0.99874229606879183, 2.0148259998133362, -0.9989732002631535, 2.0131148946216082, -0.99915074294659367,
    2.0116846174288852, -0.99928952033659668, 2.0104767610501466, -0.99939957965166426, 2.0094473837049796,
    -0.99948799341275174, 0.59004358992664352, 3.0, 0.0, 2.4874685927665499, -0.82915619758884995, 2.3013683530231086,
    -0.92518488865161452, 2.2079402165819619, -0.95940322360024699, 2.1532216876958201, -0.97521738656001777,
    2.1180441711898057, -0.98366284497920964, 2.0939473213563384, -0.98862306548596146, 2.0766559657295187,
    -0.99174222032690906, 2.0637972912229676, -0.99380798999990649, 2.0539595906443728, -0.9952332040455556,
    2.0462565272714635, -0.99624965193668058, 2.0401071141087268, -0.99699479851094885, 2.0351168037383749,
    -0.99755389786357773, 2.0310096011589902, -0.99798183447169209, 2.0275875100994067, -0.99831507883683523,
    2.024705365770985, -0.99857853517341888, 2.0222546987202588, -0.99878961794038945, 0.62583573544917614,
    3.3166247903553998, 0.0, 2.6739483914241875, -0.80622577482985491, 2.4308621740219887, -0.90909090909090906,
    2.3048861143232218, -0.94817638735546539, 2.229177150706235, -0.96715283972318222, 2.179449471770337,
    -0.97769236109380364, 2.1447610589527217, -0.98408386463328368, 2.1194781197266463, -0.98821176880261852,
    2.1004201260420148, -0.99100816681840076, 2.0856653614614209, -0.99297532698451274, 2.0739902137422357,
    -0.99440219512922989, 2.0645822822062576, -0.99546384960081247, 2.0568833780186058, -0.99627096277343574,
    2.050498830661811, -0.99689600906642317, 2.0451427078940418, -0.99738789279580298, 2.0406034646643136,
    -0.99778047604589781, 0.65638205684017015, 3.6055512754639891, 0.0, 2.8504385627478448, -0.79056941504209488,
    2.5570415597837939, -0.89706952228389236, 2.4016363469220612, -0.93922460420437093, 2.3065125189341593,
    -0.9603920767980495, 2.2430448056157952, -0.97248325651937384, 2.1981657747106436, -0.97999191510005046,
    2.1650635094610968, -0.9849409604906143, 2.1398475105532762, -0.98835322899414757, 2.1201415047114192,
    -0.99079092984678996, 2.1044171232366051, -0.99258333397093024, 2.0916500663351889, -0.99393320993236345,
    2.0811303848941725, -0.9949706303122452, 2.0723520109148583, -0.99578192022804934, 2.0649455198624489,
    -0.99642604585832906, 0.6831841051919143, 3.872983346207417, 0.0, 3.017804310611087, -0.77919372247397956,
    2.6791375063213492, -0.88777708246391906, 2.4968730444297722, -0.93196897827695324, 2.3837686425440854,
    -0.95470158078801415, 2.3073955174772429, -0.96796118394051334, 2.2528177844479149, -0.97634660697919706,
    2.2121821805628938, -0.98196232106939829, 2.1809662438042814, -0.98588907503509982, 2.1563858652847823,
    -0.98872959240459257, 2.1366369348357592, -0.99084165280112557, 2.1205017749999122, -0.99244833805276922,
    2.1071307505705477, -0.99369440545299004, 2.0959143930173156, -0.99467695227256547, 0.70716273252459616,
    4.1231056256176606, 0.0, 3.1770662567847086, -0.770551750371122, 2.7970572771691153, -0.8803899733585745,
    2.5900450446533423, -0.92598927658525143, 2.460209661583209, -0.94987138029195528, 2.3717082451262845,
    -0.96402688037572715, 2.3079277744862159, -0.97310779233865152, 2.2600784378986818, -0.97926740294193726,
    2.2230674720995864, -0.98362403482177097, 2.1937410968480306, -0.98680814882156564, 2.1700439878239588,
    -0.98919785518075953, 2.1505813167606567, -0.99103120896511487, 2.1343747458109497, -0.99246409757984944,
    0.72892666017482988, 4.358898943540674, 0.0, 3.3291640592396963, -0.76376261582597338, 2.9109593282157542,
    -0.87438145925453414, 2.6809513236909019, -0.92098549701625909, 2.5354627641855498, -0.94573248748692074,
    2.4355324226579662, -0.96058694178469484, 2.363017336304797, -0.97022618722766529, 2.3082731640774234,
    -0.97683293669229676, 2.2656860623955239, -0.98155023315928858, 2.2317637040621552, -0.98502777640009742,
    2.2042200113840402, -0.98765832931686226, 2.1814968648679218, -0.98969107149070357, 0.74890095185318828,
    4.5825756949558398, 0.0, 3.4749100707788108, -0.758287544405155, 3.0210898905832191, -0.86940088492883505,
    2.7695585470349866, -0.91674152287482091, 2.6093477445855915, -0.94215294613615863, 2.4986107250941583,
    -0.9575614175146977, 2.4177911997760035, -0.96765421499777271, 2.3564559438666821, -0.97463169858712206,
    2.308509932184803, -0.9796533383929068, 2.2701478869385201, -0.9833823347643228, 2.2388700687965297, -0.98622212309517365,
    0.76739511822199002, 4.7958315233127191, 0.0, 3.6149940274061061, -0.75377836144440902, 3.1277162108561214,
    -0.86520646704923476, 2.8559149146989657, -0.9130991183874837, 2.6817904466978773, -0.93903023262181384,
    2.5607991541103545, -0.9548841361798045, 2.4720661623652211, -0.9653494919339114, 2.4044230077089179,
    -0.97263699666048442, 2.351326355949745, -0.9779170921302377, 2.3086792761230392, -0.98186254336034939,
    0.78464210578719684, 5.0, 0.0, 3.75, -0.75, 3.2310988842807022, -0.86162636914152069, 2.9401072717216916,
    -0.90994035683194807, 2.7527763762750106, -0.93628433314374193, 2.6220221204253789, -0.95250095250142874,
    2.5257296658248256, -0.9632754987646972, 2.4520399670478454, -0.97082439194737991, 2.393988887964797,
    -0.97632539442130717, 0.80082199578397173, 5.196152422706632, 0.0, 3.8804242432615932, -0.74678799380567684,
    3.3314809667922112, -0.85853524201055353, 3.0222389997200043, -0.90717582656041185, 2.8223247937435034,
    -0.93385228435109813, 2.6822461565718467, -0.9503676410729972, 2.5787147157554005, -0.96140121570767056,
    2.4992186278915258, -0.96917220529352444, 0.81607711883762835, 5.3851648071345037, 0.0, 4.0066908326662078,
    -0.74402380914284494, 3.4290845264669656, -0.85583956179247289, 3.1024184114977142, -0.90473663963430495,
    2.8904737863674561, -0.93168406158731498, 2.7414640249326636, -0.94844798034925004, 2.6309842116740119,
    -0.9597004329606823, 0.83052208306452402, 5.5677643628300215, 0.0, 4.1291645644125152, -0.74161984870956632,
    3.5241105031922135, -0.85346816485954535, 3.1807526624998683, -0.90256893466271138, 2.9572714696920448,
    -0.92973952503676238, 2.7996848562146504, -0.94671215845672618, 0.84425065085737261, 5.7445626465380286, 0.0,
    4.2481613669916074, -0.73950997288745202, 3.6167399797065976, -0.851365959826484, 3.2573446421352252,
    -0.90063003157873467, 3.0227707252027662, -0.92798615353802616, 0.85734058883802511, 5.9160797830996161, 0.0,
    4.3639566504559628, -0.73764330611673246, 3.7071359757712075, -0.84948964270391458, 3.3322915038553673,
    -0.89888569656853223, 0.86985717192062806, 6.0827625302982193, 0.0, 4.4767920061877646, -0.7359800721939872,
    3.7954453500749294, -0.84780471034368232, 0.88185576867832882, 6.2449979983983983, 0.0, 4.5868806049657023,
    -0.73448872299751911, 0.89338378434994947, 6.4031242374328485, 0.0, 0.90448214509349101,
};
static const double isogi_sh__turn_f64[815] = {
    -0.0, -1.0, 1.0, -0.5, 0.0, 0.8660254037844386, -1.0, -1.0, 0.5, 0.0, 0.61237243569579447, -0.0, -0.79056941504209488,
    -0.25, 0.79056941504209488, 0.96824583655185426, -1.0, -0.61237243569579447, 0.25, 0.375, -0.0, -0.55901699437494745, 0.0,
    0.73950997288745202, 0.75, 0.35355339059327379, -0.66143782776614768, -0.93541434669348533, 0.5, 0.93541434669348533,
    0.66143782776614768, -0.75, -0.35355339059327379, 0.125, -0.0, -0.48412291827592713, 0.0, 0.52291251658379723, -0.0,
    -0.70156076002011403, 0.125, -0.66143782776614768, -0.40504629365049127, 0.57282196186947998, 0.90571104663683988, 0.5,
    -0.30618621784789724, -0.8660254037844386, -0.68465319688145765, 0.8125, 0.79549512883486595, 0.41926274578121059, -0.5,
    -0.19764235376052372, 0.0625, -0.3125, 0.0, 0.45285552331841994, -0.0, -0.49607837082461076, 0.0, 0.67169328938139616,
    -0.625, -0.19764235376052372, 0.59292706128157113, 0.4330127018922193, -0.50775240028974755, -0.87945295496689302,
    -0.53125, -0.5625, 0.17116329922036441, 0.80282703616657058, 0.6952686081652184, -0.0625, -0.68465319688145765,
    -0.80282703616657058, -0.46351240544347894, 0.8125, 0.58630196997792872, 0.25387620014487378, -0.3125,
    -0.10825317547305482, 0.03125, 0.0, 0.41339864235384227, -0.0, -0.42961647140211001, 0.0, 0.47495887979908324, -0.0,
    -0.64725984928774938, -0.078125, 0.57409915846480741, 0.24356964481437338, -0.53855274811294018, -0.44879395676078349,
    0.45768182862115031, 0.85624429742626607, -0.3125, 0.4198446513295126, 0.58630196997792872, -0.07328774624724109,
    -0.74739129644383739, -0.69912054128740919, -0.609375, -0.10364452469860624, 0.57004488584233437, 0.7927281808728639,
    0.49435287561113672, -0.5, -0.78125, -0.63737743919909806, -0.2981060004427955, 0.671875, 0.39836089949943632,
    0.14905300022139775, -0.1875, -0.058463396668342833, 0.015625, 0.2734375, -0.0, -0.39218438743784789, 0.0,
    0.41132645565900572, -0.0, -0.45768182862115031, 0.0, 0.6267066542400439, 0.546875, 0.13072812914594931,
    -0.53102017087395093, -0.27421763710600383, 0.49435287561113672, 0.45768182862115031, -0.41780443616002932,
    -0.83560887232005865, 0.5, 0.38081430021731066, -0.32775276505317236, -0.59086470003715741, 0.0, 0.69912054128740919,
    0.69912054128740919, 0.265625, 0.60515364784490888, 0.2181912506838897, -0.47134697278119864, -0.77450210821210808,
    -0.51633473880807201, -0.28125, 0.33802043207474902, 0.73020759034674521, 0.6665852814906732, 0.3332926407453366,
    -0.703125, -0.70883101388835967, -0.4621937330546575, -0.184877493221863, 0.5, 0.2567449488305466, 0.085581649610182206,
    -0.109375, -0.03125, 0.0078125, -0.0, -0.36685490255855924, 0.0, 0.37548796377180987, -0.0, -0.39636409043643195, 0.0,
    0.44314852502786806, -0.0, -0.60904939217552378, 0.0546875, -0.51301422373068761, -0.16792332234534904,
    0.49435287561113672, 0.2954323500185787, -0.45768182862115031, -0.46242477217583727, 0.38519665736315783,
    0.8171255055356399, 0.21875, -0.42961647140211001, -0.4215855488510013, 0.25194555463432966, 0.58546856234984979,
    0.05633673867912483, -0.65699362630089497, -0.69684697253055494, 0.453125, -0.13799626353637262, -0.57727978755972398,
    -0.2981060004427955, 0.38725105410605404, 0.75268075590684524, 0.53222566657034687, 0.5625, 0.39218438743784789,
    -0.20252314682524564, -0.67232906168594264, -0.68179450716473211, -0.36157613954394169, 0.140625, 0.60515364784490888,
    0.71624052404290139, 0.5093126879064569, 0.21608307321780204, -0.71875, -0.56832917123353788, -0.31560952932381492,
    -0.11158481919598204, 0.34765625, 0.15944009087467617, 0.048317644050206957, -0.0625, -0.016572815184059706, 0.00390625,
    -0.24609375, 0.0, 0.35123682832287462, -0.0, -0.3618292555284191, 0.0, 0.38377788032373783, -0.0, -0.43066295528485787,
    0.0, 0.59362791713657326, -0.4921875, -0.094721528538922975, 0.48298692237730412, 0.19515618744994995, -0.462853538862457,
    -0.31049159295683837, 0.42672987787577638, 0.46456464835370331, -0.35797110294949086, -0.80044772017563703, -0.46484375,
    -0.27885262964960544, 0.36618880141431143, 0.44538102542935076, -0.18922142726223226, -0.57486942301328303,
    -0.10058119679362292, 0.62002413794998734, 0.69320806007343949, -0.328125, -0.48613591206575141, 0.034938562148434216,
    0.5390625, 0.35432938970151773, -0.31560952932381492, -0.72958042576281468, -0.54379714235296417, 0.015625,
    -0.49410588440130926, -0.45851455342565189, 0.091108623356957824, 0.61371650557790114, 0.6878550219704731,
    0.38452264694764726, 0.484375, 0.017469281074217108, -0.50419383750820479, -0.7057243619147634, -0.54379714235296417,
    -0.24319347525427157, 0.462890625, 0.69255289805296638, 0.61149346306489138, 0.36479021288140734, 0.13594928558824104,
    -0.62890625, -0.42100604954085874, -0.20644078533943455, -0.06594508990677396, 0.23046875, 0.09631896879639025,
    0.026921970218926214, -0.03515625, -0.0087346405371085539, 0.001953125, 0.0, 0.33321251269014679, -0.0,
    -0.3384602766747063, 0.0, 0.35033967020804879, -0.0, -0.37296505974556871, 0.0, 0.41975832570891686, -0.0,
    -0.57997947393467886, -0.041015625, 0.46765007670081832, 0.12498474027950122, -0.45637974396671571, -0.21561916177558219,
    0.43552935783159685, 0.32136177701094576, -0.40022386008781852, -0.46501810346249056, 0.33485130540064439,
    0.78529592002431536, -0.1640625, 0.41655170126194269, 0.32021721143623744, -0.31014124452051578, -0.45838141911581126,
    0.13689999147558637, 0.56163127361285714, 0.13594928558824104, -0.58736804535412457, -0.68875008418641726, -0.349609375,
    0.23534953642800108, 0.4953107286295218, 0.047641839522072141, -0.49716719187291986, -0.39401846316690065,
    0.25433782432394114, 0.70641320967457455, 0.55222860860084622, -0.5, -0.13435455876499874, 0.41751216299648086,
    0.49510851970963143, -9.9454594674319224e-35, -0.55722625443603468, -0.6878550219704731, -0.40329075444049978,
    -0.3857421875, -0.52272828294256846, -0.14035007305082209, 0.40784785676472313, 0.68448811471566962, 0.56871666443773183,
    0.26675176057529504, 0.18359375, -0.32425698663835922, -0.64612728525422913, -0.63603688806045899, -0.40544165371889518,
    -0.1584741601909983, 0.6279296875, 0.65553753643092161, 0.47810190182411116, 0.24930093301108064, 0.083523216080989837,
    -0.5, -0.2950124033243931, -0.13072812914594931, -0.038323079824899575, 0.1474609375, 0.056959635044600332,
    0.014842464993721351, -0.01953125, -0.0045804841404525681, 0.0009765625, 0.2255859375, -0.0, -0.32109161153484977, 0.0,
    0.32771275372847303, -0.0, -0.34046896063984994, 0.0, 0.36352137351394465, -0.0, -0.41010741896821795, 0.0,
    0.56776801212685668, 0.451171875, 0.072712931519477678, -0.44527394981164053, -0.14842464993721352, 0.43272849689657278,
    0.23130311098294945, -0.41160690265053901, -0.32928552212043122, 0.37724395759248291, 0.46435521203002894,
    -0.31494102773717564, -0.77144481702380407, 0.43359375, 0.21528718442430275, -0.37077237317518807, -0.34870255998744387,
    0.26094510187280051, 0.46435521203002894, -0.092871042406005785, -0.54718531932211101, -0.16464276106021561,
    0.5583307674216148, 0.68381274393975289, 0.345703125, 0.392578125, -0.15374580191486631, -0.49003980202465125,
    -0.11374333288754637, 0.45497333155018549, 0.42195411222921914, -0.20164537722024989, -0.68381274393975289,
    -0.5583307674216148, 0.11669921875, 0.48401456158383843, 0.22371382266342774, -0.34122999866263909, -0.51184499799395866,
    -0.074462490393391603, 0.50411344305062478, 0.68381274393975289, 0.41874807556621113, -0.2568359375, 0.27404717188285704,
    0.52668415780940514, 0.23408184791529116, -0.31925529371635791, -0.65705604098220638, -0.58636459044042155,
    -0.28725880996301434, -0.525390625, -0.30237819268448052, 0.19810985037948722, 0.5893083378135775, 0.6469680498067143,
    0.43879508023281599, 0.17913734136900075, -0.1572265625, -0.54296875, -0.65785022183448094, -0.52110934255625663,
    -0.28767847243653455, -0.10066649535040352, 0.6572265625, 0.55492127556105875, 0.35144583567747545, 0.16438769853516261,
    0.05033324767520176, -0.3720703125, -0.19834078136318262, -0.080712757698960413, -0.021967230232816392, 0.091796875,
    0.033116845620728849, 0.0081119373661309325, -0.0107421875, -0.0023920798269366971, 0.00048828125, -0.0,
    -0.3074218129566329, 0.0, 0.3108956160203436, -0.0, -0.31847955038633519, 0.0, 0.33184809401474752, -0.0,
    -0.35516344310694486, 0.0, 0.40147261151570629, -0.0, -0.55674234096704367, 0.0322265625, -0.43236470658687337,
    -0.097772148023233835, 0.42493094836993028, 0.16692864173800467, -0.41160690265053901, -0.24350992753551057,
    0.39048459390687013, 0.33508120677026226, -0.35710955873299804, -0.46294341611217071, 0.29759129894416503,
    0.75871192019586065, 0.12890625, -0.39838364181026775, -0.25337986301296467, 0.32847213547974063, 0.36815240573389746,
    -0.21780190046617978, -0.46568005127581963, 0.055501063431182898, 0.53234749916129154, 0.18821326330232457,
    -0.53234749916129154, -0.67861257155893595, 0.279052734375, -0.27693877404913597, -0.41641008901347271,
    0.08325159514677434, 0.4761056429933383, 0.16673428435381696, -0.41417145645063463, -0.44139922820050997,
    0.15605819373554447, 0.66209884230076488, 0.56267581946979872, 0.427734375, -0.014846480269053488, -0.45121414845245256,
    -0.28960676761644083, 0.26921970218926217, 0.51530701050804206, 0.13541510165361681, -0.45482644910810605,
    -0.67707550826808405, -0.4315526536043392, 0.438232421875, 0.34012635856225309, -0.16916849025751901,
    -0.50923193110085896, -0.30447947908103351, 0.23938234163584529, 0.62629484514797773, 0.59845585408961322,
    0.30515380780267742, 0.134765625, 0.49108084137057362, 0.38293206041101469, -0.08745006771444902, -0.52812803369136074,
    -0.64803329186808356, -0.46599532384531833, -0.19800993746085563, -0.40478515625, 0.012788868021199995,
    0.45029618794257004, 0.64326862003139085, 0.55232951835200383, 0.32163431001569542, 0.11714425878649873, -0.421875,
    -0.62989984533656562, -0.58944264093559184, -0.39943226817081151, -0.19648088031186392, -0.062616240172380169,
    0.59912109375, 0.43555891764461224, 0.24672049987442993, 0.10537715749466425, 0.029851121241790731, -0.263671875,
    -0.12912985164246521, -0.048828125, -0.012448778109357385, 0.055908203125, 0.018989684065068416, 0.0044013077093066275,
    -0.005859375, -0.0012448778109357384, 0.000244140625, -0.20947265625, 0.0, 0.29765989046048263, -0.0,
    -0.30213623022215325, 0.0, 0.31041546806428333, -0.0, -0.32421838231812738, 0.0, 0.34768548049628262, -0.0,
    -0.39367628467146953, 0.0, 0.54671012572894095, -0.4189453125, -0.058097261762847484, 0.41489743677369451,
    0.11794190764567768, -0.40642925122563589, -0.18176068675697232, 0.39264796001215768, 0.25312379436441274,
    -0.37169141324941796, -0.33930628577946798, 0.33930628577946798, 0.46102645791479357, -0.28231989495348686,
    -0.74694823221280537, -0.4068603515625, -0.17260776719378471, 0.36391209618543363, 0.28180798175816646,
    -0.28986522975410922, -0.38115332581581463, 0.17989751732911829, 0.463898924695541, -0.023526657912790572,
    -0.51758647408139258, -0.20778181666966614, 0.50895942866920196, 0.6732900378401131, -0.346435546875,
    -0.32292413190190605, 0.21308945636308815, 0.42706950870871979, -0.022873774761468183, -0.45711888182303367,
    -0.2093118259149121, 0.37556057991683511, 0.4546259651624846, -0.11638109588227706, -0.64141717638938223,
    -0.56567677845718523, -0.185791015625, -0.43748201605755099, -0.069981750766127296, 0.40964323385175955,
    0.33717349471455332, -0.20312265248042521, -0.50991810239246971, -0.18542476450635262, 0.40940679470381547,
    0.6685584961684895, 0.44220987944028806, 0.099853515625, -0.37504362806209851, -0.39271064912769232, 0.075265034640615985,
    0.47892214576016834, 0.35648134650374186, -0.16815157853950086, -0.5940298123825668, -0.60627913847438053,
    -0.32081276509794054, 0.4073486328125, -0.01107548459200562, -0.43617162672688647, -0.43385279709812374,
    -0.0075199672027643745, 0.46623796657139122, 0.64200733655528519, 0.48804529210874026, 0.21520774524260011, 0.41845703125,
    0.46051523295669194, 0.10677294225083157, -0.35738968834541424, -0.61730946168753364, -0.5738873206469336,
    -0.35143277635949616, -0.13282910411488658, -0.13818359375, 0.29827230784788966, 0.58383998553034289, 0.60740303427372,
    0.43932900265328106, 0.22655408120134224, 0.07492571967068562, -0.56982421875, -0.61645531984834367, -0.48540841888275221,
    -0.2913120475459437, -0.13017755780506604, -0.038268604914882223, 0.4993896484375, 0.323486328125, 0.1671048503760762,
    0.066019615639599419, 0.017467148463445048, -0.179931640625, -0.081935281474721233, -0.029048630881423742,
    -0.0069868593853780201, 0.033447265625, 0.010764359221215138, 0.0023733181268583473, -0.003173828125,
    -0.00064593537867787859, 0.0001220703125, 0.0, 0.28683224752162628, -0.0, -0.28927341704999932, 0.0, 0.29448597000911825,
    -0.0, -0.30327852628212976, 0.0, 0.3173919676413941, -0.0, -0.34093366339296705, 0.0, 0.38658243724628416, -0.0,
    -0.53752106580927217, -0.02618408203125, 0.40394834339674734, 0.07922078790244208, -0.39873588833009171,
    -0.13441384053565325, 0.38956832062087621, 0.19379790506025349, -0.37554324061629185, -0.26076411037221198,
    0.3548550075792854, 0.34235127309753577, -0.32343807220408372, -0.45876982929941612, 0.26876053290463608,
    0.73603103219489319, -0.104736328125, 0.3799989517881342, 0.2067696700235564, -0.3310846973421977, -0.30302356320529844,
    0.25483020517266358, 0.38948564307572286, -0.14649116500376397, -0.46003667446804863, -0.0040347885451753928,
    0.50316903057893003, 0.22417598874858996, -0.48779241888341757, -0.66793727800614189, -0.22894287109375,
    0.29399379697892691, 0.35199464622911381, -0.15517261518701916, -0.4286700817965402, -0.028644157129432864,
    0.43535910608833489, 0.24359565946994083, -0.33946218116365456, -0.46324573850344275, 0.081648410079144057,
    0.6218157656172929, 0.56763753573489439, -0.365234375, 0.10229863635764282, 0.43030351350995694, 0.13928971533740286,
    -0.36422508440437623, -0.37057633718956928, 0.14340014800379311, 0.49867904036398752, 0.22655408120134224,
    -0.36769626757932261, -0.65889208135462229, -0.45111256989931958, -0.42730712890625, -0.19016394045597712,
    0.3049217387440265, 0.42205711248781647, 0.0065124826332197535, -0.44134584368013519, -0.39408144000834733,
    0.1050106271406714, 0.56142233892139592, 0.61080930711268278, 0.33455403583971705, -0.282958984375, -0.43714995515444194,
    -0.093199064769063672, 0.37120770160461297, 0.46234040213014482, 0.087858194089874039, -0.40579961606642534,
    -0.63093824454571124, -0.50579815939707506, -0.23086421787197636, 0.12091064453125, -0.32868469278573381,
    -0.48155741518097483, -0.20261879347603617, 0.2684838288199568, 0.58398818968480659, 0.58762464811598147,
    0.37742785470181978, 0.14766124989354926, 0.484375, 0.25394503957384318, -0.18086190602980601, -0.52658294615399537,
    -0.61229767863811557, -0.47182552381421849, -0.25439406264952041, -0.087085854130327989, 0.15130615234375,
    0.49112388946794067, 0.61281058297545588, 0.52259019340167601, 0.33148487801281024, 0.15456205830431868,
    0.047031736593168907, -0.610595703125, -0.54350403259425462, -0.37606850032574635, -0.20437310147934784,
    -0.084132928097752038, -0.023040751274049497, 0.39044189453125, 0.23024942986358732, 0.10997049821990883,
    0.040584202601753307, 0.010104037837881882, -0.119140625, -0.050905076689572927, -0.017040945670522605,
    -0.0038890459770688454, 0.01971435546875, 0.0060427887192523689, 0.0012729891122201056, -0.001708984375,
    -0.00033430331878977424, 6.103515625e-05,
};
#ifdef ISOGI_SH__VECTORS
static const float isogi_sh__columns_f32[453] = {
    0.0f, 0.0f, 0.282094806f, 0.0f, -1.0f, 0.488602519f, 0.5f, -1.5f, 0.630783141f, 0.666666687f, -1.66666663f, 0.746352673f,
    0.75f, -1.75f, 0.846284389f, 0.800000012f, -1.79999995f, 0.935602605f, 0.833333313f, -1.83333337f, 1.01710725f,
    0.857142866f, -1.85714281f, 1.09254849f, 0.875f, -1.875f, 1.16310668f, 0.888888896f, -1.88888884f, 1.22962272f,
    0.899999976f, -1.89999998f, 1.29272079f, 0.909090936f, -1.90909088f, 1.35287905f, 0.916666687f, -1.91666663f, 1.41047394f,
    0.923076928f, -1.92307687f, 1.46580756f, 0.928571403f, -1.92857146f, 1.51912689f, 0.933333337f, -1.93333328f, 1.57063735f,
    0.9375f, -1.9375f, 1.62051117f, 0.941176474f, -1.94117641f, 1.66889524f, 0.944444418f, -1.94444442f, 1.71591568f,
    0.947368443f, -1.94736838f, 1.76168144f, 0.949999988f, -1.95000005f, 1.806288f, 0.488602519f, 2.23606801f, 0.546274245f,
    2.09165001f, -0.935414374f, 2.64575124f, 0.0f, 2.04939008f, -0.979795873f, 2.2912879f, -0.866025388f, 2.03100967f,
    -0.991031229f, 2.17124057f, -0.9476071f, 2.0213151f, -0.995226681f, 2.11394191f, -0.973610103f, 2.01556444f, -0.99715507f,
    2.08166599f, -0.984731913f, 2.01186943f, -0.9981668f, 2.06155276f, -0.990337908f, 2.00935316f, -0.998749197f, 2.04812241f,
    -0.993485272f, 2.00756145f, -0.999108315f, 2.03868842f, -0.995393813f, 2.00624037f, -0.999341905f, 2.0317986f,
    -0.996620476f, 2.00523782f, -0.999500394f, 2.02660871f, -0.997445703f, 2.00445938f, -0.999611735f, 2.0225997f,
    -0.998021781f, 2.00384235f, -0.999692261f, 2.01943684f, -0.998436272f, 2.00334549f, -0.999751925f, 2.01689696f,
    -0.998742282f, 2.00293899f, -0.999797165f, 2.01482606f, -0.998973191f, 2.00260258f, -0.999831975f, 2.01311493f,
    -0.999150753f, 2.00232053f, -0.999859273f, 2.01168466f, -0.999289513f, 2.00208235f, -0.99988097f, 2.01047683f,
    -0.999399602f, 2.00187874f, -0.999898374f, 2.00944734f, -0.999487996f, 0.590043604f, 3.0f, 0.625835717f, 2.48746848f,
    -0.82915622f, 3.31662488f, 0.0f, 2.30136824f, -0.925184906f, 2.67394829f, -0.806225777f, 2.2079401f, -0.959403217f,
    2.43086219f, -0.909090936f, 2.15322161f, -0.975217402f, 2.3048861f, -0.948176384f, 2.11804414f, -0.983662844f,
    2.22917724f, -0.967152834f, 2.09394741f, -0.988623083f, 2.17944956f, -0.977692366f, 2.07665586f, -0.991742194f,
    2.14476109f, -0.984083891f, 2.06379724f, -0.993807971f, 2.11947823f, -0.988211751f, 2.05395961f, -0.995233178f,
    2.10042024f, -0.991008162f, 2.04625654f, -0.996249676f, 2.08566546f, -0.992975354f, 2.04010701f, -0.996994793f,
    2.07399011f, -0.99440217f, 2.03511691f, -0.997553885f, 2.06458235f, -0.995463848f, 2.03100967f, -0.997981846f,
    2.05688334f, -0.996270955f, 2.02758741f, -0.998315096f, 2.05049872f, -0.996896029f, 2.02470541f, -0.998578548f,
    2.04514265f, -0.997387886f, 2.02225471f, -0.998789608f, 2.0406034f, -0.997780502f, 0.656382084f, 3.60555124f,
    0.683184087f, 2.85043859f, -0.790569425f, 3.87298346f, 0.0f, 2.55704165f, -0.897069514f, 3.01780438f, -0.779193699f,
    2.40163636f, -0.939224601f, 2.67913747f, -0.88777709f, 2.30651259f, -0.960392058f, 2.49687314f, -0.931968987f,
    2.24304485f, -0.972483277f, 2.38376856f, -0.954701602f, 2.19816589f, -0.979991913f, 2.30739546f, -0.967961192f,
    2.16506362f, -0.984940946f, 2.25281787f, -0.976346612f, 2.13984752f, -0.988353252f, 2.21218228f, -0.981962323f,
    2.12014151f, -0.990790904f, 2.18096614f, -0.985889077f, 2.10441709f, -0.992583334f, 2.1563859f, -0.988729596f,
    2.09165001f, -0.993933201f, 2.13663697f, -0.990841627f, 2.08113027f, -0.99497062f, 2.12050176f, -0.99244833f, 2.07235193f,
    -0.995781898f, 2.10713077f, -0.993694425f, 2.06494546f, -0.996426046f, 2.09591436f, -0.994676948f, 0.707162738f,
    4.12310553f, 0.728926659f, 3.17706633f, -0.770551741f, 4.35889912f, 0.0f, 2.79705739f, -0.880389988f, 3.32916403f,
    -0.763762593f, 2.59004498f, -0.92598927f, 2.91095924f, -0.874381483f, 2.46020961f, -0.949871361f, 2.68095136f,
    -0.92098552f, 2.37170815f, -0.964026868f, 2.53546286f, -0.945732474f, 2.30792785f, -0.973107815f, 2.43553233f,
    -0.960586965f, 2.26007843f, -0.979267418f, 2.36301732f, -0.970226169f, 2.22306752f, -0.983624041f, 2.30827308f,
    -0.976832926f, 2.19374108f, -0.986808121f, 2.26568604f, -0.981550217f, 2.17004395f, -0.98919785f, 2.2317636f,
    -0.98502779f, 2.15058136f, -0.991031229f, 2.20422006f, -0.987658322f, 2.13437486f, -0.992464125f, 2.18149686f,
    -0.989691079f, 0.74890095f, 4.5825758f, 0.767395139f, 3.47491002f, -0.758287549f, 4.79583168f, 0.0f, 3.02108979f,
    -0.869400859f, 3.61499405f, -0.753778338f, 2.76955843f, -0.91674155f, 3.1277163f, -0.86520648f, 2.60934782f,
    -0.942152917f, 2.85591483f, -0.91309911f, 2.49861073f, -0.957561433f, 2.68179035f, -0.93903023f, 2.41779113f,
    -0.967654228f, 2.56079912f, -0.954884112f, 2.35645604f, -0.974631727f, 2.47206616f, -0.965349495f, 2.30850983f,
    -0.979653358f, 2.404423f, -0.972636998f, 2.2701478f, -0.983382344f, 2.35132647f, -0.977917075f, 2.23887014f,
    -0.986222148f, 2.30867934f, -0.981862545f, 0.7846421f, 5.0f, 0.80082202f, 3.75f, -0.75f, 5.19615221f, 0.0f, 3.23109889f,
    -0.861626387f, 3.88042426f, -0.746787965f, 2.94010735f, -0.909940362f, 3.33148098f, -0.85853523f, 2.75277638f,
    -0.936284304f, 3.02223897f, -0.907175839f, 2.62202215f, -0.952500939f, 2.82232475f, -0.933852255f, 2.52572966f,
    -0.963275492f, 2.68224621f, -0.95036763f, 2.45203996f, -0.97082442f, 2.57871461f, -0.961401224f, 2.39398885f,
    -0.976325393f, 2.4992187f, -0.96917218f, 0.816077113f, 5.38516474f, 0.83052206f, 4.00669098f, -0.7440238f, 5.56776428f,
    0.0f, 3.42908454f, -0.85583955f, 4.1291647f, -0.741619825f, 3.10241842f, -0.904736638f, 3.52411056f, -0.85346818f,
    2.89047384f, -0.931684077f, 3.18075275f, -0.902568936f, 2.74146414f, -0.948448002f, 2.95727158f, -0.929739535f,
    2.63098431f, -0.959700406f, 2.79968476f, -0.946712136f, 0.844250679f, 5.74456263f, 0.857340574f, 4.24816132f, -0.73951f,
    5.91608f, 0.0f, 3.61673999f, -0.851365983f, 4.36395645f, -0.737643301f, 3.25734472f, -0.900630057f, 3.70713592f,
    -0.849489629f, 3.02277064f, -0.927986145f, 3.3322916f, -0.898885667f, 0.869857192f, 6.08276272f, 0.881855786f,
    4.47679186f, -0.735980093f, 6.24499798f, 0.0f, 3.79544544f, -0.847804725f, 4.58688068f, -0.734488726f, 0.893383801f,
    6.40312433f, 0.904482126f,
};
#endif
#ifdef ISOGI_SH__SIMD
static const double isogi_sh__columns_f64[453] = {
    0.0, 0.0, 0.28209479177387814, 0.0, -1.0, 0.48860251190291992, 0.5, -1.5, 0.63078313050503998, 0.66666666666666663,
    -1.6666666666666667, 0.7463526651802308, 0.75, -1.75, 0.84628437532163447, 0.80000000000000004, -1.8, 0.9356025796273888,
    0.83333333333333337, -1.8333333333333333, 1.0171072362820548, 0.8571428571428571, -1.8571428571428572, 1.0925484305920792,
    0.875, -1.875, 1.1631066229203195, 0.88888888888888884, -1.8888888888888888, 1.2296226898414837, 0.90000000000000002,
    -1.8999999999999999, 1.2927207364566027, 0.90909090909090906, -1.9090909090909092, 1.3528790949515024,
    0.91666666666666663, -1.9166666666666667, 1.4104739588693906, 0.92307692307692313, -1.9230769230769231,
    1.4658075357087597, 0.9285714285714286, -1.9285714285714286, 1.5191269449366245, 0.93333333333333335, -1.9333333333333333,
    1.5706373285785544, 0.9375, -1.9375, 1.6205112036071436, 0.94117647058823528, -1.9411764705882353, 1.6688952945311364,
    0.94444444444444442, -1.9444444444444444, 1.7159156293944244, 0.94736842105263153, -1.9473684210526316,
    1.7616814099864819, 0.94999999999999996, -1.95, 1.8062879984608917, 0.48860251190291992, 2.2360679774997898,
    0.54627421529603959, 2.0916500663351889, -0.93541434669348533, 2.6457513110645907, 0.0, 2.0493901531919199,
    -0.9797958971132712, 2.2912878474779199, -0.8660254037844386, 2.0310096011589902, -0.99103120896511487,
    2.1712405933672376, -0.94760708295868568, 2.0213149892370277, -0.99522670305623862, 2.1139418156609704,
    -0.97361012046232687, 2.0155644370746373, -0.99715504402183208, 2.0816659994661326, -0.9847319278346619,
    2.0118695404073912, -0.99816681789017425, 2.0615528128088303, -0.9903379376602871, 2.0093531297410121,
    -0.99874921777190895, 2.0481223583578192, -0.99348527267040398, 2.0075614636426526, -0.99910833687128453,
    2.0386883037875112, -0.99539380324041182, 2.0062402647738877, -0.99934188870792151, 2.0317984959648752,
    -0.99662047022596034, 2.0052378963551982, -0.9995003746877732, 2.026608708444444, -0.99744571741206722,
    2.0044593143431828, -0.99961172586383362, 2.0225995873897262, -0.99802175869569076, 2.0038424627162224,
    -0.99969226034045866, 2.0194368026754388, -0.99843627738579288, 2.0033454163331039, -0.99975195336341716,
    2.0168969490698876, -0.99874229606879183, 2.0029390170153341, -0.99979713966725037, 2.0148259998133362,
    -0.9989732002631535, 2.0026024734496528, -0.99983197513113353, 2.0131148946216082, -0.99915074294659367,
    2.0023206350873464, -0.99985926394976399, 2.0116846174288852, -0.99928952033659668, 2.0020822493927, -0.99988094529394089,
    2.0104767610501466, -0.99939957965166426, 2.0018788167600157, -0.99989838947288712, 2.0094473837049796,
    -0.99948799341275174, 0.59004358992664352, 3.0, 0.62583573544917614, 2.4874685927665499, -0.82915619758884995,
    3.3166247903553998, 0.0, 2.3013683530231086, -0.92518488865161452, 2.6739483914241875, -0.80622577482985491,
    2.2079402165819619, -0.95940322360024699, 2.4308621740219887, -0.90909090909090906, 2.1532216876958201,
    -0.97521738656001777, 2.3048861143232218, -0.94817638735546539, 2.1180441711898057, -0.98366284497920964,
    2.229177150706235, -0.96715283972318222, 2.0939473213563384, -0.98862306548596146, 2.179449471770337,
    -0.97769236109380364, 2.0766559657295187, -0.99174222032690906, 2.1447610589527217, -0.98408386463328368,
    2.0637972912229676, -0.99380798999990649, 2.1194781197266463, -0.98821176880261852, 2.0539595906443728,
    -0.9952332040455556, 2.1004201260420148, -0.99100816681840076, 2.0462565272714635, -0.99624965193668058,
    2.0856653614614209, -0.99297532698451274, 2.0401071141087268, -0.99699479851094885, 2.0739902137422357,
    -0.99440219512922989, 2.0351168037383749, -0.99755389786357773, 2.0645822822062576, -0.99546384960081247,
    2.0310096011589902, -0.99798183447169209, 2.0568833780186058, -0.99627096277343574, 2.0275875100994067,
    -0.99831507883683523, 2.050498830661811, -0.99689600906642317, 2.024705365770985, -0.99857853517341888,
    2.0451427078940418, -0.99738789279580298, 2.0222546987202588, -0.99878961794038945, 2.0406034646643136,
    -0.99778047604589781, 0.65638205684017015, 3.6055512754639891, 0.6831841051919143, 2.8504385627478448,
    -0.79056941504209488, 3.872983346207417, 0.0, 2.5570415597837939, -0.89706952228389236, 3.017804310611087,
    -0.77919372247397956, 2.4016363469220612, -0.93922460420437093, 2.6791375063213492, -0.88777708246391906,
    2.3065125189341593, -0.9603920767980495, 2.4968730444297722, -0.93196897827695324, 2.2430448056157952,
    -0.97248325651937384, 2.3837686425440854, -0.95470158078801415, 2.1981657747106436, -0.97999191510005046,
    2.3073955174772429, -0.96796118394051334, 2.1650635094610968, -0.9849409604906143, 2.2528177844479149,
    -0.97634660697919706, 2.1398475105532762, -0.98835322899414757, 2.2121821805628938, -0.98196232106939829,
    2.1201415047114192, -0.99079092984678996, 2.1809662438042814, -0.98588907503509982, 2.1044171232366051,
    -0.99258333397093024, 2.1563858652847823, -0.98872959240459257, 2.0916500663351889, -0.99393320993236345,
    2.1366369348357592, -0.99084165280112557, 2.0811303848941725, -0.9949706303122452, 2.1205017749999122,
    -0.99244833805276922, 2.0723520109148583, -0.99578192022804934, 2.1071307505705477, -0.99369440545299004,
    2.0649455198624489, -0.99642604585832906, 2.0959143930173156, -0.99467695227256547, 0.70716273252459616,
    4.1231056256176606, 0.72892666017482988, 3.1770662567847086, -0.770551750371122, 4.358898943540674, 0.0,
    2.7970572771691153, -0.8803899733585745, 3.3291640592396963, -0.76376261582597338, 2.5900450446533423,
    -0.92598927658525143, 2.9109593282157542, -0.87438145925453414, 2.460209661583209, -0.94987138029195528,
    2.6809513236909019, -0.92098549701625909, 2.3717082451262845, -0.96402688037572715, 2.5354627641855498,
    -0.94573248748692074, 2.3079277744862159, -0.97310779233865152, 2.4355324226579662, -0.96058694178469484,
    2.2600784378986818, -0.97926740294193726, 2.363017336304797, -0.97022618722766529, 2.2230674720995864,
    -0.98362403482177097, 2.3082731640774234, -0.97683293669229676, 2.1937410968480306, -0.98680814882156564,
    2.2656860623955239, -0.98155023315928858, 2.1700439878239588, -0.98919785518075953, 2.2317637040621552,
    -0.98502777640009742, 2.1505813167606567, -0.99103120896511487, 2.2042200113840402, -0.98765832931686226,
    2.1343747458109497, -0.99246409757984944, 2.1814968648679218, -0.98969107149070357, 0.74890095185318828,
    4.5825756949558398, 0.76739511822199002, 3.4749100707788108, -0.758287544405155, 4.7958315233127191, 0.0,
    3.0210898905832191, -0.86940088492883505, 3.6149940274061061, -0.75377836144440902, 2.7695585470349866,
    -0.91674152287482091, 3.1277162108561214, -0.86520646704923476, 2.6093477445855915, -0.94215294613615863,
    2.8559149146989657, -0.9130991183874837, 2.4986107250941583, -0.9575614175146977, 2.6817904466978773,
    -0.93903023262181384, 2.4177911997760035, -0.96765421499777271, 2.5607991541103545, -0.9548841361798045,
    2.3564559438666821, -0.97463169858712206, 2.4720661623652211, -0.9653494919339114, 2.308509932184803, -0.9796533383929068,
    2.4044230077089179, -0.97263699666048442, 2.2701478869385201, -0.9833823347643228, 2.351326355949745, -0.9779170921302377,
    2.2388700687965297, -0.98622212309517365, 2.3086792761230392, -0.98186254336034939, 0.78464210578719684, 5.0,
    0.80082199578397173, 3.75, -0.75, 5.196152422706632, 0.0, 3.2310988842807022, -0.86162636914152069, 3.8804242432615932,
    -0.74678799380567684, 2.9401072717216916, -0.90994035683194807, 3.3314809667922112, -0.85853524201055353,
    2.7527763762750106, -0.93628433314374193, 3.0222389997200043, -0.90717582656041185, 2.6220221204253789,
    -0.95250095250142874, 2.8223247937435034, -0.93385228435109813, 2.5257296658248256, -0.9632754987646972,
    2.6822461565718467, -0.9503676410729972, 2.4520399670478454, -0.97082439194737991, 2.5787147157554005,
    -0.96140121570767056, 2.393988887964797, -0.97632539442130717, 2.4992186278915258, -0.96917220529352444,
    0.81607711883762835, 5.3851648071345037, 0.83052208306452402, 4.0066908326662078, -0.74402380914284494,
    5.5677643628300215, 0.0, 3.4290845264669656, -0.85583956179247289, 4.1291645644125152, -0.74161984870956632,
    3.1024184114977142, -0.90473663963430495, 3.5241105031922135, -0.85346816485954535, 2.8904737863674561,
    -0.93168406158731498, 3.1807526624998683, -0.90256893466271138, 2.7414640249326636, -0.94844798034925004,
    2.9572714696920448, -0.92973952503676238, 2.6309842116740119, -0.9597004329606823, 2.7996848562146504,
    -0.94671215845672618, 0.84425065085737261, 5.7445626465380286, 0.85734058883802511, 4.2481613669916074,
    -0.73950997288745202, 5.9160797830996161, 0.0, 3.6167399797065976, -0.851365959826484, 4.3639566504559628,
    -0.73764330611673246, 3.2573446421352252, -0.90063003157873467, 3.7071359757712075, -0.84948964270391458,
    3.0227707252027662, -0.92798615353802616, 3.3322915038553673, -0.89888569656853223, 0.86985717192062806,
    6.0827625302982193, 0.88185576867832882, 4.4767920061877646, -0.7359800721939872, 6.2449979983983983, 0.0,
    3.7954453500749294, -0.84780471034368232, 4.5868806049657023, -0.73448872299751911, 0.89338378434994947,
    6.4031242374328485, 0.90448214509349101,
};
static const float isogi_sh__polynomials_f32[206] = {
    0.282094806f, 0.488602519f, 0.473087341f, 0.157695785f, 0.932940841f, -0.186588168f, 0.925623536f, 0.264463872f,
    -0.343803018f, 1.84196758f, -0.409326136f, -0.497038871f, 1.83556068f, 0.500607491f, -1.16808414f, -0.150976852f,
    3.66174436f, -0.84501791f, -1.92049527f, 0.1963173f, 3.6545856f, 0.974556148f, -3.2610147f, -0.552021325f, 0.347001046f,
    7.29788256f, -1.7171489f, -5.66659117f, 0.818947911f, 0.496532202f, 7.28875446f, 1.91809332f, -8.34934711f, -1.57960629f,
    1.86601841f, 0.148808062f, 0.488602519f, 1.09254849f, 1.14261448f, 0.68556869f, 2.34166288f, 0.334523261f, 2.37796998f,
    1.58531332f, -0.339709997f, 4.80662632f, 0.873932064f, -1.0195874f, 4.84403229f, 3.35356092f, -1.72759199f, -0.68877852f,
    9.7455616f, 1.9491123f, -4.3480196f, -0.368014216f, 9.79113674f, 6.91139078f, -5.7594924f, -3.01265764f, 0.318181753f,
    19.6563091f, 4.13817024f, -13.5099096f, -1.70395255f, 1.00645542f, 0.546274245f, 1.44530571f, 1.65580571f, 0.76876694f,
    3.59515262f, 0.299596041f, 3.79997158f, 1.55453384f, -0.510981023f, 7.91027164f, -0.30424124f, -1.35871363f, 8.15372181f,
    2.03843045f, -3.17524743f, -0.544353545f, 16.6998196f, -3.68378377f, -6.20103598f, 0.234959289f, 17.0228634f,
    0.895940185f, -11.1663132f, -1.34061635f, 0.721474469f, 0.590043604f, 1.77013075f, 2.20157242f, 1.16194093f, 5.06662893f,
    1.03635597f, 5.59340668f, 3.22696543f, -0.256690443f, 12.0438452f, 2.00730753f, -1.5633837f, 12.7546978f, 6.18977976f,
    -3.23556685f, -0.989246547f, 26.7076645f, 1.05425f, -8.7595768f, -0.525833011f, 0.625835717f, 2.07566237f, 2.77510691f,
    1.5767653f, 6.74590254f, 1.94593346f, 7.77426863f, 5.44198799f, 0.186881453f, 17.3302212f, 5.60683632f, -1.46542311f,
    18.8851719f, 12.6729441f, -2.33506656f, -1.38039351f, 0.656382084f, 2.36661911f, 3.37295127f, 2.01079798f, 8.62477684f,
    3.01867175f, 10.3567886f, 8.22450829f, 0.830066144f, 23.8880615f, 10.6867647f, -0.984550536f, 0.683184087f, 2.64596057f,
    3.99249578f, 2.46203899f, 10.6964455f, 4.247118f, 13.3538322f, 11.5967493f, 1.68214881f, 0.707162738f, 2.91570663f,
    4.6316967f, 2.92886686f, 12.955121f, 5.62524986f, 0.728926659f, 3.17731762f, 5.2889061f, 3.4099524f, 0.74890095f,
    3.43189526f, 0.767395139f, 1.98305321f, -0.0257539377f, -1.01354098f, 1.98795271f, -0.0169910491f, -1.006881f,
    1.99099135f, -0.0120666139f, -1.00400305f, 1.99300718f, -0.00901813153f, -1.00254261f, 1.9944135f, -0.00699794199f,
    -1.00171876f, 2.03704524f, 0.0522319302f, -0.978800237f, 2.02752638f, 0.0368641168f, -0.987757921f, 2.02127814f,
    0.0274381656f, -0.9922598f, 2.01694989f, 0.0212310515f, -0.99478358f, 2.14573216f, -0.3413665f, -0.934984744f,
    2.11115623f, -0.384497911f, -0.959502876f, 2.08774161f, -0.412054241f, -0.972973943f, 2.28030944f, -0.208942369f,
    -0.897532761f, 2.21753645f, -0.28205508f, -0.932877719f, 2.42918944f, -0.0703186393f, -0.867124736f,
};
static const double isogi_sh__polynomials_f64[206] = {
    0.28209479177387814, 0.48860251190291992, 0.47308734787877998, 0.15769578262625999, 0.9329408314752885,
    -0.1865881662950577, 0.92562353550803766, 0.26446386728801075, -0.34380302747441399, 1.8419675786414216,
    -0.40932612858698258, -0.49703887042705031, 1.8355607154777709, 0.50060746785757382, -1.1680840916676722,
    -0.1509768553856175, 3.6617443494062649, -0.84501792678606114, -1.9204952881501389, 0.19631729612201421,
    3.6545855070762969, 0.9745561352203459, -3.2610147601603878, -0.55202130736257349, 0.34700104814663829,
    7.2978827124136885, -1.7171488735091032, -5.6665912825800406, 0.81894792428895691, 0.49653220922798197, 7.288754650414309,
    1.9180933290563971, -8.3493474323631407, -1.5796062709876211, 1.8660183970458162, 0.14880806329084184,
    0.48860251190291992, 1.0925484305920792, 1.1426144986611644, 0.68556869919669861, 2.341662902450512, 0.3345232717786446,
    2.377969918777409, 1.5853132791849391, -0.33970998839677269, 4.8066262407795337, 0.87393204377809708, -1.0195873844077799,
    4.8440324566124913, 3.3535609315009554, -1.7275919950156435, -0.68877850781669447, 9.7455613522034579, 1.9491122704406918,
    -4.3480196802138504, -0.36801420490838233, 9.7911371020665339, 6.9113908955763765, -5.7594924129803138,
    -3.0126575698666258, 0.31818174868912225, 19.656309531350573, 4.138170427652752, -13.509909337336927, -1.7039525290334863,
    1.0064554773137349, 0.54627421529603959, 1.4453057213202771, 1.6558057175757301, 0.76876694030301751, 3.5951525887299929,
    0.29959604906083276, 3.7999716954990594, 1.5545338754314335, -0.51098104238718411, 7.9102718774540648,
    -0.30424122605592557, -1.3587136572724858, 8.1537216195240063, 2.0384304048810016, -3.1752473614492525,
    -0.54435357403072204, 16.699819552772645, -3.6837837248763186, -6.2010359368751367, 0.23495928245204725,
    17.022863398799789, 0.89594017888419941, -11.166313258887634, -1.3406163706098131, 0.72147445223743711,
    0.59004358992664352, 1.7701307697799304, 2.2015723474586268, 1.1619409611587197, 5.0666289273320793, 1.0363559169542889,
    5.5934068855770116, 3.2269655109098143, -0.25669043836782612, 12.043845014131556, 2.0073075023552591, -1.5633837277959231,
    12.754697865447371, 6.1897798464671068, -3.2355667379259878, -0.98924657511282288, 26.707665430062931, 1.0542499511866945,
    -8.7595768003012129, -0.52583300261395183, 0.62583573544917614, 2.0756623148810411, 2.7751069540079829,
    1.5767653147772629, 6.7459025233633838, 1.9459334202009761, 7.7742685273391237, 5.4419879691373865, 0.18688145498411354,
    17.330221764598988, 5.6068364532526136, -1.4654231639182966, 18.885171335259027, 12.672943922344874, -2.3350666569718497,
    -1.3803934736637187, 0.65638205684017015, 2.3666191622317521, 3.3729512616816919, 2.0107978675410085, 8.6247765552452709,
    3.0186717943358445, 10.356788429579144, 8.2245084587834381, 0.83006613148832853, 23.888062168776749, 10.686764654452755,
    -0.98455054991281876, 0.6831841051919143, 2.6459606618019, 3.9924957454465693, 2.4620390430253845, 10.696445095454319,
    4.2471179055480377, 13.353832715031466, 11.596749463053641, 1.6821488191728877, 0.70716273252459616, 2.9157066406993195,
    4.6316965914244523, 2.9288669622242858, 12.955120656683151, 5.6252497588229469, 0.72892666017482988, 3.1773176489546975,
    5.2889058608439745, 3.4099524629125626, 0.74890095185318828, 3.4318952998917145, 0.76739511822199002, 1.983053201505194,
    -0.025753937681885639, -1.0135409740718178, 1.9879526609838891, -0.016991048384477684, -1.006881027645312,
    1.9909913500872998, -0.012066614242953333, -1.0040029932510537, 1.9930071616269462, -0.0090181319530631045,
    -1.0025425658982019, 1.9944134940340694, -0.0069979420843300682, -1.0017188140704978, 2.0370453042160284,
    0.052231930877334062, -0.97880022814735546, 2.0275263488394164, 0.036864115433443936, -0.98775794018221952,
    2.0212781788241014, 0.027438165323404092, -0.9922598062206599, 2.0169499550589056, 0.021231052158514795,
    -0.99478359736899846, 2.1457321982639557, -0.34136648608744746, -0.93498476488130378, 2.1111562044246086,
    -0.38449790600945927, -0.95950288575837794, 2.0877415483548898, -0.41205425296478088, -0.97297395734845937,
    2.2803093224518043, -0.20894237004366079, -0.89753276503218704, 2.2175364593886497, -0.28205507597487212,
    -0.93287769473694482, 2.4291894817946043, -0.070318642894054331, -0.86712474618349289,
};
static const double isogi_sh__turn_columns_f64[1495] = {
    -0.0, 1.0, -1.0, 1.0, -0.5, 0.8660254037844386, -0.0, 0.0, 1.0, -1.0, 0.8660254037844386, 0.5, -1.0, 0.0, -0.0,
    -0.61237243569579447, 0.79056941504209488, 0.61237243569579447, -0.79056941504209488, -0.25, 0.96824583655185426, -0.0,
    -1.0, 0.79056941504209488, 0.61237243569579447, -0.79056941504209488, -0.61237243569579447, 0.96824583655185426, 0.25,
    0.375, -0.55901699437494745, 0.73950997288745202, 0.0, -0.0, -0.0, -0.35355339059327379, 0.93541434669348533, 0.75,
    -0.66143782776614768, -0.55901699437494745, 0.5, 0.66143782776614768, 0.35355339059327379, -0.93541434669348533, 0.0,
    0.93541434669348533, 0.35355339059327379, -0.66143782776614768, -0.75, 0.73950997288745202, 0.66143782776614768, 0.125,
    -0.93541434669348533, -0.35355339059327379, -0.0, 0.0, -0.0, 0.48412291827592713, -0.52291251658379723,
    0.70156076002011403, -0.48412291827592713, 0.66143782776614768, -0.57282196186947998, 0.125, -0.40504629365049127,
    0.90571104663683988, 0.0, 0.5, -0.8660254037844386, -0.66143782776614768, 0.30618621784789724, 0.68465319688145765,
    0.52291251658379723, -0.30618621784789724, -0.79549512883486595, -0.40504629365049127, 0.8125, 0.41926274578121059, -0.0,
    -0.8660254037844386, -0.5, 0.57282196186947998, 0.79549512883486595, 0.19764235376052372, -0.70156076002011403,
    -0.68465319688145765, -0.19764235376052372, 0.90571104663683988, 0.41926274578121059, 0.0625, -0.3125,
    0.45285552331841994, -0.49607837082461076, 0.67169328938139616, -0.0, 0.0, -0.0, 0.0, 0.19764235376052372,
    -0.4330127018922193, 0.87945295496689302, -0.625, 0.59292706128157113, -0.50775240028974755, 0.45285552331841994,
    -0.53125, 0.17116329922036441, 0.6952686081652184, -0.19764235376052372, 0.5625, -0.80282703616657058, -0.0, -0.5625,
    0.68465319688145765, 0.46351240544347894, 0.59292706128157113, -0.0625, -0.80282703616657058, -0.49607837082461076,
    0.17116329922036441, 0.8125, 0.25387620014487378, 0.4330127018922193, -0.68465319688145765, -0.58630196997792872, 0.0,
    0.80282703616657058, 0.58630196997792872, 0.10825317547305482, -0.50775240028974755, -0.80282703616657058, -0.3125,
    0.67169328938139616, 0.6952686081652184, 0.25387620014487378, 0.03125, -0.87945295496689302, -0.46351240544347894,
    -0.10825317547305482, 0.0, -0.0, 0.0, -0.0, -0.41339864235384227, 0.42961647140211001, -0.47495887979908324,
    0.64725984928774938, 0.41339864235384227, -0.57409915846480741, 0.53855274811294018, -0.45768182862115031, -0.078125,
    0.24356964481437338, -0.44879395676078349, 0.85624429742626607, -0.0, -0.3125, 0.58630196997792872, -0.74739129644383739,
    0.57409915846480741, -0.4198446513295126, 0.07328774624724109, 0.69912054128740919, -0.42961647140211001,
    0.4198446513295126, 0.10364452469860624, -0.7927281808728639, 0.24356964481437338, -0.609375, 0.57004488584233437,
    0.49435287561113672, 0.0, 0.58630196997792872, -0.5, -0.63737743919909806, -0.53855274811294018, -0.10364452469860624,
    0.78125, 0.2981060004427955, 0.47495887979908324, -0.07328774624724109, -0.78125, -0.39836089949943632,
    -0.44879395676078349, 0.57004488584233437, 0.671875, 0.14905300022139775, -0.0, -0.74739129644383739,
    -0.63737743919909806, -0.1875, 0.45768182862115031, 0.7927281808728639, 0.39836089949943632, 0.058463396668342833,
    -0.64725984928774938, -0.69912054128740919, -0.2981060004427955, -0.058463396668342833, 0.85624429742626607,
    0.49435287561113672, 0.14905300022139775, 0.015625, 0.2734375, -0.39218438743784789, 0.41132645565900572,
    -0.45768182862115031, 0.6267066542400439, 0.0, -0.0, 0.0, -0.0, -0.0, -0.13072812914594931, 0.27421763710600383,
    -0.45768182862115031, 0.83560887232005865, 0.546875, -0.53102017087395093, 0.49435287561113672, -0.41780443616002932,
    -0.39218438743784789, 0.5, -0.32775276505317236, 0.0, 0.69912054128740919, 0.13072812914594931, -0.38081430021731066,
    0.59086470003715741, -0.69912054128740919, 0.0, 0.38081430021731066, -0.60515364784490888, 0.47134697278119864,
    0.51633473880807201, -0.53102017087395093, 0.265625, 0.2181912506838897, -0.77450210821210808, 0.41132645565900572,
    -0.32775276505317236, -0.28125, 0.73020759034674521, 0.3332926407453366, -0.27421763710600383, 0.60515364784490888,
    -0.33802043207474902, -0.6665852814906732, -0.0, -0.59086470003715741, 0.33802043207474902, 0.70883101388835967,
    0.184877493221863, 0.49435287561113672, 0.2181912506838897, -0.703125, -0.4621937330546575, -0.45768182862115031, 0.0,
    0.73020759034674521, 0.5, 0.085581649610182206, 0.45768182862115031, -0.47134697278119864, -0.70883101388835967,
    -0.2567449488305466, 0.0, 0.69912054128740919, 0.6665852814906732, 0.2567449488305466, 0.03125, -0.41780443616002932,
    -0.77450210821210808, -0.4621937330546575, -0.109375, 0.6267066542400439, 0.69912054128740919, 0.3332926407453366,
    0.085581649610182206, 0.0078125, -0.83560887232005865, -0.51633473880807201, -0.184877493221863, -0.03125, -0.0, 0.0,
    -0.0, 0.0, -0.0, 0.36685490255855924, -0.37548796377180987, 0.39636409043643195, -0.44314852502786806,
    0.60904939217552378, -0.36685490255855924, 0.51301422373068761, -0.49435287561113672, 0.45768182862115031,
    -0.38519665736315783, 0.0546875, -0.16792332234534904, 0.2954323500185787, -0.46242477217583727, 0.8171255055356399, 0.0,
    0.21875, -0.4215855488510013, 0.58546856234984979, -0.65699362630089497, -0.51301422373068761, 0.42961647140211001,
    -0.25194555463432966, -0.05633673867912483, 0.69684697253055494, 0.37548796377180987, -0.42961647140211001,
    0.13799626353637262, 0.2981060004427955, -0.75268075590684524, -0.16792332234534904, 0.453125, -0.57727978755972398,
    0.38725105410605404, 0.53222566657034687, -0.0, -0.4215855488510013, 0.5625, -0.20252314682524564, -0.68179450716473211,
    0.49435287561113672, -0.13799626353637262, -0.39218438743784789, 0.67232906168594264, 0.36157613954394169,
    -0.39636409043643195, 0.25194555463432966, 0.39218438743784789, -0.60515364784490888, -0.5093126879064569,
    0.2954323500185787, -0.57727978755972398, 0.140625, 0.71624052404290139, 0.21608307321780204, 0.0, 0.58546856234984979,
    -0.20252314682524564, -0.71875, -0.31560952932381492, -0.45768182862115031, -0.2981060004427955, 0.60515364784490888,
    0.56832917123353788, 0.11158481919598204, 0.44314852502786806, 0.05633673867912483, -0.67232906168594264,
    -0.56832917123353788, -0.15944009087467617, -0.46242477217583727, 0.38725105410605404, 0.71624052404290139, 0.34765625,
    0.048317644050206957, -0.0, -0.65699362630089497, -0.68179450716473211, -0.31560952932381492, -0.0625,
    0.38519665736315783, 0.75268075590684524, 0.5093126879064569, 0.15944009087467617, 0.016572815184059706,
    -0.60904939217552378, -0.69684697253055494, -0.36157613954394169, -0.11158481919598204, -0.016572815184059706,
    0.8171255055356399, 0.53222566657034687, 0.21608307321780204, 0.048317644050206957, 0.00390625, -0.24609375,
    0.35123682832287462, -0.3618292555284191, 0.38377788032373783, -0.43066295528485787, 0.59362791713657326, -0.0, 0.0, -0.0,
    0.0, -0.0, 0.0, 0.094721528538922975, -0.19515618744994995, 0.31049159295683837, -0.46456464835370331,
    0.80044772017563703, -0.4921875, 0.48298692237730412, -0.462853538862457, 0.42672987787577638, -0.35797110294949086,
    0.35123682832287462, -0.46484375, 0.36618880141431143, -0.18922142726223226, -0.10058119679362292, 0.69320806007343949,
    -0.094721528538922975, 0.27885262964960544, -0.44538102542935076, 0.57486942301328303, -0.62002413794998734, -0.0,
    -0.27885262964960544, 0.48613591206575141, -0.5390625, 0.31560952932381492, 0.54379714235296417, 0.48298692237730412,
    -0.328125, 0.034938562148434216, 0.35432938970151773, -0.72958042576281468, -0.3618292555284191, 0.36618880141431143,
    0.015625, -0.45851455342565189, 0.61371650557790114, 0.38452264694764726, 0.19515618744994995, -0.48613591206575141,
    0.49410588440130926, -0.091108623356957824, -0.6878550219704731, 0.0, 0.44538102542935076, -0.49410588440130926,
    -0.017469281074217108, 0.7057243619147634, 0.24319347525427157, -0.462853538862457, 0.034938562148434216, 0.484375,
    -0.50419383750820479, -0.54379714235296417, 0.38377788032373783, -0.18922142726223226, -0.45851455342565189, 0.462890625,
    0.61149346306489138, 0.13594928558824104, -0.31049159295683837, 0.5390625, 0.017469281074217108, -0.69255289805296638,
    -0.36479021288140734, -0.0, -0.57486942301328303, 0.091108623356957824, 0.69255289805296638, 0.42100604954085874,
    0.06594508990677396, 0.42672987787577638, 0.35432938970151773, -0.50419383750820479, -0.62890625, -0.20644078533943455,
    -0.43066295528485787, -0.10058119679362292, 0.61371650557790114, 0.61149346306489138, 0.23046875, 0.026921970218926214,
    0.46456464835370331, -0.31560952932381492, -0.7057243619147634, -0.42100604954085874, -0.09631896879639025, 0.0,
    0.62002413794998734, 0.6878550219704731, 0.36479021288140734, 0.09631896879639025, 0.0087346405371085539,
    -0.35797110294949086, -0.72958042576281468, -0.54379714235296417, -0.20644078533943455, -0.03515625, 0.59362791713657326,
    0.69320806007343949, 0.38452264694764726, 0.13594928558824104, 0.026921970218926214, 0.001953125, -0.80044772017563703,
    -0.54379714235296417, -0.24319347525427157, -0.06594508990677396, -0.0087346405371085539, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0,
    -0.33321251269014679, 0.3384602766747063, -0.35033967020804879, 0.37296505974556871, -0.41975832570891686,
    0.57997947393467886, 0.33321251269014679, -0.46765007670081832, 0.45637974396671571, -0.43552935783159685,
    0.40022386008781852, -0.33485130540064439, -0.041015625, 0.12498474027950122, -0.21561916177558219, 0.32136177701094576,
    -0.46501810346249056, 0.78529592002431536, -0.0, -0.1640625, 0.32021721143623744, -0.45838141911581126,
    0.56163127361285714, -0.58736804535412457, 0.46765007670081832, -0.41655170126194269, 0.31014124452051578,
    -0.13689999147558637, -0.13594928558824104, 0.68875008418641726, -0.3384602766747063, 0.41655170126194269,
    -0.23534953642800108, -0.047641839522072141, 0.39401846316690065, -0.70641320967457455, 0.12498474027950122, -0.349609375,
    0.4953107286295218, -0.49716719187291986, 0.25433782432394114, 0.55222860860084622, 0.0, 0.32021721143623744, -0.5,
    0.41751216299648086, -9.9454594674319224e-35, -0.6878550219704731, -0.45637974396671571, 0.23534953642800108,
    0.13435455876499874, -0.49510851970963143, 0.55722625443603468, 0.40329075444049978, 0.35033967020804879,
    -0.31014124452051578, -0.13435455876499874, 0.52272828294256846, -0.40784785676472313, -0.56871666443773183,
    -0.21561916177558219, 0.4953107286295218, -0.3857421875, -0.14035007305082209, 0.68448811471566962, 0.26675176057529504,
    -0.0, -0.45838141911581126, 0.41751216299648086, 0.18359375, -0.64612728525422913, -0.40544165371889518,
    0.43552935783159685, 0.047641839522072141, -0.52272828294256846, 0.32425698663835922, 0.63603688806045899,
    0.1584741601909983, -0.37296505974556871, 0.13689999147558637, 0.49510851970963143, -0.32425698663835922,
    -0.65553753643092161, -0.24930093301108064, 0.32136177701094576, -0.49716719187291986, -0.14035007305082209, 0.6279296875,
    0.47810190182411116, 0.083523216080989837, 0.0, 0.56163127361285714, -9.9454594674319224e-35, -0.64612728525422913, -0.5,
    -0.13072812914594931, -0.40022386008781852, -0.39401846316690065, 0.40784785676472313, 0.65553753643092161,
    0.2950124033243931, 0.038323079824899575, 0.41975832570891686, 0.13594928558824104, -0.55722625443603468,
    -0.63603688806045899, -0.2950124033243931, -0.056959635044600332, -0.46501810346249056, 0.25433782432394114,
    0.68448811471566962, 0.47810190182411116, 0.1474609375, 0.014842464993721351, -0.0, -0.58736804535412457,
    -0.6878550219704731, -0.40544165371889518, -0.13072812914594931, -0.01953125, 0.33485130540064439, 0.70641320967457455,
    0.56871666443773183, 0.24930093301108064, 0.056959635044600332, 0.0045804841404525681, -0.57997947393467886,
    -0.68875008418641726, -0.40329075444049978, -0.1584741601909983, -0.038323079824899575, -0.0045804841404525681,
    0.78529592002431536, 0.55222860860084622, 0.26675176057529504, 0.083523216080989837, 0.014842464993721351, 0.0009765625,
    0.2255859375, -0.32109161153484977, 0.32771275372847303, -0.34046896063984994, 0.36352137351394465, -0.41010741896821795,
    0.56776801212685668, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0, -0.0, -0.072712931519477678, 0.14842464993721352,
    -0.23130311098294945, 0.32928552212043122, -0.46435521203002894, 0.77144481702380407, 0.451171875, -0.44527394981164053,
    0.43272849689657278, -0.41160690265053901, 0.37724395759248291, -0.31494102773717564, -0.32109161153484977, 0.43359375,
    -0.37077237317518807, 0.26094510187280051, -0.092871042406005785, -0.16464276106021561, 0.68381274393975289,
    0.072712931519477678, -0.21528718442430275, 0.34870255998744387, -0.46435521203002894, 0.54718531932211101,
    -0.5583307674216148, 0.0, 0.21528718442430275, -0.392578125, 0.49003980202465125, -0.45497333155018549,
    0.20164537722024989, 0.5583307674216148, -0.44527394981164053, 0.345703125, -0.15374580191486631, -0.11374333288754637,
    0.42195411222921914, -0.68381274393975289, 0.32771275372847303, -0.37077237317518807, 0.11669921875, 0.22371382266342774,
    -0.51184499799395866, 0.50411344305062478, 0.41874807556621113, -0.14842464993721352, 0.392578125, -0.48401456158383843,
    0.34122999866263909, 0.074462490393391603, -0.68381274393975289, -0.0, -0.34870255998744387, 0.48401456158383843,
    -0.27404717188285704, -0.23408184791529116, 0.65705604098220638, 0.28725880996301434, 0.43272849689657278,
    -0.15374580191486631, -0.2568359375, 0.52668415780940514, -0.31925529371635791, -0.58636459044042155,
    -0.34046896063984994, 0.26094510187280051, 0.22371382266342774, -0.525390625, 0.19810985037948722, 0.6469680498067143,
    0.17913734136900075, 0.23130311098294945, -0.49003980202465125, 0.27404717188285704, 0.30237819268448052,
    -0.5893083378135775, -0.43879508023281599, 0.0, 0.46435521203002894, -0.34122999866263909, -0.30237819268448052,
    0.54296875, 0.52110934255625663, 0.10066649535040352, -0.41160690265053901, -0.11374333288754637, 0.52668415780940514,
    -0.1572265625, -0.65785022183448094, -0.28767847243653455, 0.36352137351394465, -0.092871042406005785,
    -0.51184499799395866, 0.19810985037948722, 0.6572265625, 0.35144583567747545, 0.05033324767520176, -0.32928552212043122,
    0.45497333155018549, 0.23408184791529116, -0.54296875, -0.55492127556105875, -0.16438769853516261, -0.0,
    -0.54718531932211101, -0.074462490393391603, 0.5893083378135775, 0.55492127556105875, 0.19834078136318262,
    0.021967230232816392, 0.37724395759248291, 0.42195411222921914, -0.31925529371635791, -0.65785022183448094, -0.3720703125,
    -0.080712757698960413, -0.41010741896821795, -0.16464276106021561, 0.50411344305062478, 0.6469680498067143,
    0.35144583567747545, 0.091796875, 0.0081119373661309325, 0.46435521203002894, -0.20164537722024989, -0.65705604098220638,
    -0.52110934255625663, -0.19834078136318262, -0.033116845620728849, 0.0, 0.5583307674216148, 0.68381274393975289,
    0.43879508023281599, 0.16438769853516261, 0.033116845620728849, 0.0023920798269366971, -0.31494102773717564,
    -0.68381274393975289, -0.58636459044042155, -0.28767847243653455, -0.080712757698960413, -0.0107421875,
    0.56776801212685668, 0.68381274393975289, 0.41874807556621113, 0.17913734136900075, 0.05033324767520176,
    0.0081119373661309325, 0.00048828125, -0.77144481702380407, -0.5583307674216148, -0.28725880996301434,
    -0.10066649535040352, -0.021967230232816392, -0.0023920798269366971, -0.0, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0,
    0.3074218129566329, -0.3108956160203436, 0.31847955038633519, -0.33184809401474752, 0.35516344310694486,
    -0.40147261151570629, 0.55674234096704367, -0.3074218129566329, 0.43236470658687337, -0.42493094836993028,
    0.41160690265053901, -0.39048459390687013, 0.35710955873299804, -0.29759129894416503, 0.0322265625, -0.097772148023233835,
    0.16692864173800467, -0.24350992753551057, 0.33508120677026226, -0.46294341611217071, 0.75871192019586065, 0.0,
    0.12890625, -0.25337986301296467, 0.36815240573389746, -0.46568005127581963, 0.53234749916129154, -0.53234749916129154,
    -0.43236470658687337, 0.39838364181026775, -0.32847213547974063, 0.21780190046617978, -0.055501063431182898,
    -0.18821326330232457, 0.67861257155893595, 0.3108956160203436, -0.39838364181026775, 0.27693877404913597,
    -0.08325159514677434, -0.16673428435381696, 0.44139922820050997, -0.66209884230076488, -0.097772148023233835,
    0.279052734375, -0.41641008901347271, 0.4761056429933383, -0.41417145645063463, 0.15605819373554447, 0.56267581946979872,
    -0.0, -0.25337986301296467, 0.427734375, -0.45121414845245256, 0.26921970218926217, 0.13541510165361681,
    -0.67707550826808405, 0.42493094836993028, -0.27693877404913597, 0.014846480269053488, 0.28960676761644083,
    -0.51530701050804206, 0.45482644910810605, 0.4315526536043392, -0.31847955038633519, 0.32847213547974063,
    -0.014846480269053488, -0.34012635856225309, 0.50923193110085896, -0.23938234163584529, -0.59845585408961322,
    0.16692864173800467, -0.41641008901347271, 0.438232421875, -0.16916849025751901, -0.30447947908103351,
    0.62629484514797773, 0.30515380780267742, 0.0, 0.36815240573389746, -0.45121414845245256, 0.134765625,
    0.38293206041101469, -0.52812803369136074, -0.46599532384531833, -0.41160690265053901, 0.08325159514677434,
    0.34012635856225309, -0.49108084137057362, 0.08745006771444902, 0.64803329186808356, 0.19800993746085563,
    0.33184809401474752, -0.21780190046617978, -0.28960676761644083, 0.49108084137057362, -0.012788868021199995,
    -0.64326862003139085, -0.32163431001569542, -0.24350992753551057, 0.4761056429933383, -0.16916849025751901,
    -0.40478515625, 0.45029618794257004, 0.55232951835200383, 0.11714425878649873, -0.0, -0.46568005127581963,
    0.26921970218926217, 0.38293206041101469, -0.421875, -0.58944264093559184, -0.19648088031186392, 0.39048459390687013,
    0.16673428435381696, -0.50923193110085896, 0.012788868021199995, 0.62989984533656562, 0.39943226817081151,
    0.062616240172380169, -0.35516344310694486, 0.055501063431182898, 0.51530701050804206, -0.08745006771444902,
    -0.62989984533656562, -0.43555891764461224, -0.10537715749466425, 0.33508120677026226, -0.41417145645063463,
    -0.30447947908103351, 0.45029618794257004, 0.59912109375, 0.24672049987442993, 0.029851121241790731, 0.0,
    0.53234749916129154, 0.13541510165361681, -0.52812803369136074, -0.58944264093559184, -0.263671875, -0.048828125,
    -0.35710955873299804, -0.44139922820050997, 0.23938234163584529, 0.64326862003139085, 0.43555891764461224,
    0.12912985164246521, 0.012448778109357385, 0.40147261151570629, 0.18821326330232457, -0.45482644910810605,
    -0.64803329186808356, -0.39943226817081151, -0.12912985164246521, -0.018989684065068416, -0.46294341611217071,
    0.15605819373554447, 0.62629484514797773, 0.55232951835200383, 0.24672049987442993, 0.055908203125, 0.0044013077093066275,
    -0.0, -0.53234749916129154, -0.67707550826808405, -0.46599532384531833, -0.19648088031186392, -0.048828125, -0.005859375,
    0.29759129894416503, 0.66209884230076488, 0.59845585408961322, 0.32163431001569542, 0.10537715749466425,
    0.018989684065068416, 0.0012448778109357384, -0.55674234096704367, -0.67861257155893595, -0.4315526536043392,
    -0.19800993746085563, -0.062616240172380169, -0.012448778109357385, -0.0012448778109357384, 0.75871192019586065,
    0.56267581946979872, 0.30515380780267742, 0.11714425878649873, 0.029851121241790731, 0.0044013077093066275,
    0.000244140625, -0.20947265625, 0.29765989046048263, -0.30213623022215325, 0.31041546806428333, -0.32421838231812738,
    0.34768548049628262, -0.39367628467146953, 0.54671012572894095, -0.0, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0, 0.0,
    0.058097261762847484, -0.11794190764567768, 0.18176068675697232, -0.25312379436441274, 0.33930628577946798,
    -0.46102645791479357, 0.74694823221280537, -0.4189453125, 0.41489743677369451, -0.40642925122563589, 0.39264796001215768,
    -0.37169141324941796, 0.33930628577946798, -0.28231989495348686, 0.29765989046048263, -0.4068603515625,
    0.36391209618543363, -0.28986522975410922, 0.17989751732911829, -0.023526657912790572, -0.20778181666966614,
    0.6732900378401131, -0.058097261762847484, 0.17260776719378471, -0.28180798175816646, 0.38115332581581463,
    -0.463898924695541, 0.51758647408139258, -0.50895942866920196, -0.0, -0.17260776719378471, 0.32292413190190605,
    -0.42706950870871979, 0.45711888182303367, -0.37556057991683511, 0.11638109588227706, 0.56567677845718523,
    0.41489743677369451, -0.346435546875, 0.21308945636308815, -0.022873774761468183, -0.2093118259149121, 0.4546259651624846,
    -0.64141717638938223, -0.30213623022215325, 0.36391209618543363, -0.185791015625, -0.069981750766127296,
    0.33717349471455332, -0.50991810239246971, 0.40940679470381547, 0.44220987944028806, 0.11794190764567768,
    -0.32292413190190605, 0.43748201605755099, -0.40964323385175955, 0.20312265248042521, 0.18542476450635262,
    -0.6685584961684895, 0.0, 0.28180798175816646, -0.43748201605755099, 0.37504362806209851, -0.075265034640615985,
    -0.35648134650374186, 0.5940298123825668, 0.32081276509794054, -0.40642925122563589, 0.21308945636308815, 0.099853515625,
    -0.39271064912769232, 0.47892214576016834, -0.16815157853950086, -0.60627913847438053, 0.31041546806428333,
    -0.28986522975410922, -0.069981750766127296, 0.4073486328125, -0.43617162672688647, -0.0075199672027643745,
    0.64200733655528519, 0.21520774524260011, -0.18176068675697232, 0.42706950870871979, -0.37504362806209851,
    0.01107548459200562, 0.43385279709812374, -0.46623796657139122, -0.48804529210874026, -0.0, -0.38115332581581463,
    0.40964323385175955, -0.01107548459200562, -0.46051523295669194, 0.35738968834541424, 0.5738873206469336,
    0.13282910411488658, 0.39264796001215768, -0.022873774761468183, -0.39271064912769232, 0.41845703125, 0.10677294225083157,
    -0.61730946168753364, -0.35143277635949616, -0.32421838231812738, 0.17989751732911829, 0.33717349471455332,
    -0.43617162672688647, -0.13818359375, 0.58383998553034289, 0.43932900265328106, 0.07492571967068562, 0.25312379436441274,
    -0.45711888182303367, 0.075265034640615985, 0.46051523295669194, -0.29827230784788966, -0.60740303427372,
    -0.22655408120134224, 0.0, 0.463898924695541, -0.20312265248042521, -0.43385279709812374, 0.29827230784788966,
    0.61645531984834367, 0.2913120475459437, 0.038268604914882223, -0.37169141324941796, -0.2093118259149121,
    0.47892214576016834, 0.10677294225083157, -0.56982421875, -0.48540841888275221, -0.13017755780506604, 0.34768548049628262,
    -0.023526657912790572, -0.50991810239246971, -0.0075199672027643745, 0.58383998553034289, 0.4993896484375,
    0.1671048503760762, 0.017467148463445048, -0.33930628577946798, 0.37556057991683511, 0.35648134650374186,
    -0.35738968834541424, -0.61645531984834367, -0.323486328125, -0.066019615639599419, -0.0, -0.51758647408139258,
    -0.18542476450635262, 0.46623796657139122, 0.60740303427372, 0.323486328125, 0.081935281474721233, 0.0069868593853780201,
    0.33930628577946798, 0.4546259651624846, -0.16815157853950086, -0.61730946168753364, -0.48540841888275221,
    -0.179931640625, -0.029048630881423742, -0.39367628467146953, -0.20778181666966614, 0.40940679470381547,
    0.64200733655528519, 0.43932900265328106, 0.1671048503760762, 0.033447265625, 0.0023733181268583473, 0.46102645791479357,
    -0.11638109588227706, -0.5940298123825668, -0.5738873206469336, -0.2913120475459437, -0.081935281474721233,
    -0.010764359221215138, 0.0, 0.50895942866920196, 0.6685584961684895, 0.48804529210874026, 0.22655408120134224,
    0.066019615639599419, 0.010764359221215138, 0.00064593537867787859, -0.28231989495348686, -0.64141717638938223,
    -0.60627913847438053, -0.35143277635949616, -0.13017755780506604, -0.029048630881423742, -0.003173828125,
    0.54671012572894095, 0.6732900378401131, 0.44220987944028806, 0.21520774524260011, 0.07492571967068562,
    0.017467148463445048, 0.0023733181268583473, 0.0001220703125, -0.74694823221280537, -0.56567677845718523,
    -0.32081276509794054, -0.13282910411488658, -0.038268604914882223, -0.0069868593853780201, -0.00064593537867787859, 0.0,
    -0.0, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0, -0.28683224752162628, 0.28927341704999932, -0.29448597000911825,
    0.30327852628212976, -0.3173919676413941, 0.34093366339296705, -0.38658243724628416, 0.53752106580927217,
    0.28683224752162628, -0.40394834339674734, 0.39873588833009171, -0.38956832062087621, 0.37554324061629185,
    -0.3548550075792854, 0.32343807220408372, -0.26876053290463608, -0.02618408203125, 0.07922078790244208,
    -0.13441384053565325, 0.19379790506025349, -0.26076411037221198, 0.34235127309753577, -0.45876982929941612,
    0.73603103219489319, -0.0, -0.104736328125, 0.2067696700235564, -0.30302356320529844, 0.38948564307572286,
    -0.46003667446804863, 0.50316903057893003, -0.48779241888341757, 0.40394834339674734, -0.3799989517881342,
    0.3310846973421977, -0.25483020517266358, 0.14649116500376397, 0.0040347885451753928, -0.22417598874858996,
    0.66793727800614189, -0.28927341704999932, 0.3799989517881342, -0.29399379697892691, 0.15517261518701916,
    0.028644157129432864, -0.24359565946994083, 0.46324573850344275, -0.6218157656172929, 0.07922078790244208,
    -0.22894287109375, 0.35199464622911381, -0.4286700817965402, 0.43535910608833489, -0.33946218116365456,
    0.081648410079144057, 0.56763753573489439, 0.0, 0.2067696700235564, -0.365234375, 0.43030351350995694,
    -0.36422508440437623, 0.14340014800379311, 0.22655408120134224, -0.65889208135462229, -0.39873588833009171,
    0.29399379697892691, -0.10229863635764282, -0.13928971533740286, 0.37057633718956928, -0.49867904036398752,
    0.36769626757932261, 0.45111256989931958, 0.29448597000911825, -0.3310846973421977, 0.10229863635764282,
    0.19016394045597712, -0.42205711248781647, 0.44134584368013519, -0.1050106271406714, -0.61080930711268278,
    -0.13441384053565325, 0.35199464622911381, -0.42730712890625, 0.3049217387440265, 0.0065124826332197535,
    -0.39408144000834733, 0.56142233892139592, 0.33455403583971705, -0.0, -0.30302356320529844, 0.43030351350995694,
    -0.282958984375, -0.093199064769063672, 0.46234040213014482, -0.40579961606642534, -0.50579815939707506,
    0.38956832062087621, -0.15517261518701916, -0.19016394045597712, 0.43714995515444194, -0.37120770160461297,
    -0.087858194089874039, 0.63093824454571124, 0.23086421787197636, -0.30327852628212976, 0.25483020517266358,
    0.13928971533740286, -0.43714995515444194, 0.32868469278573381, 0.20261879347603617, -0.58398818968480659,
    -0.37742785470181978, 0.19379790506025349, -0.4286700817965402, 0.3049217387440265, 0.12091064453125,
    -0.48155741518097483, 0.2684838288199568, 0.58762464811598147, 0.14766124989354926, 0.0, 0.38948564307572286,
    -0.36422508440437623, -0.093199064769063672, 0.484375, -0.18086190602980601, -0.61229767863811557, -0.25439406264952041,
    -0.37554324061629185, -0.028644157129432864, 0.42205711248781647, -0.32868469278573381, -0.25394503957384318,
    0.52658294615399537, 0.47182552381421849, 0.087085854130327989, 0.3173919676413941, -0.14649116500376397,
    -0.37057633718956928, 0.37120770160461297, 0.25394503957384318, -0.49112388946794067, -0.52259019340167601,
    -0.15456205830431868, -0.26076411037221198, 0.43535910608833489, 0.0065124826332197535, -0.48155741518097483,
    0.15130615234375, 0.61281058297545588, 0.33148487801281024, 0.047031736593168907, -0.0, -0.46003667446804863,
    0.14340014800379311, 0.46234040213014482, -0.18086190602980601, -0.610595703125, -0.37606850032574635,
    -0.084132928097752038, 0.3548550075792854, 0.24359565946994083, -0.44134584368013519, -0.20261879347603617,
    0.49112388946794067, 0.54350403259425462, 0.20437310147934784, 0.023040751274049497, -0.34093366339296705,
    -0.0040347885451753928, 0.49867904036398752, 0.087858194089874039, -0.52658294615399537, -0.54350403259425462,
    -0.23024942986358732, -0.040584202601753307, 0.34235127309753577, -0.33946218116365456, -0.39408144000834733,
    0.2684838288199568, 0.61281058297545588, 0.39044189453125, 0.10997049821990883, 0.010104037837881882, 0.0,
    0.50316903057893003, 0.22655408120134224, -0.40579961606642534, -0.61229767863811557, -0.37606850032574635, -0.119140625,
    -0.017040945670522605, -0.32343807220408372, -0.46324573850344275, 0.1050106271406714, 0.58398818968480659,
    0.52259019340167601, 0.23024942986358732, 0.050905076689572927, 0.0038890459770688454, 0.38658243724628416,
    0.22417598874858996, -0.36769626757932261, -0.63093824454571124, -0.47182552381421849, -0.20437310147934784,
    -0.050905076689572927, -0.0060427887192523689, -0.45876982929941612, 0.081648410079144057, 0.56142233892139592,
    0.58762464811598147, 0.33148487801281024, 0.10997049821990883, 0.01971435546875, 0.0012729891122201056, -0.0,
    -0.48779241888341757, -0.65889208135462229, -0.50579815939707506, -0.25439406264952041, -0.084132928097752038,
    -0.017040945670522605, -0.001708984375, 0.26876053290463608, 0.6218157656172929, 0.61080930711268278, 0.37742785470181978,
    0.15456205830431868, 0.040584202601753307, 0.0060427887192523689, 0.00033430331878977424, -0.53752106580927217,
    -0.66793727800614189, -0.45111256989931958, -0.23086421787197636, -0.087085854130327989, -0.023040751274049497,
    -0.0038890459770688454, -0.00033430331878977424, 0.73603103219489319, 0.56763753573489439, 0.33455403583971705,
    0.14766124989354926, 0.047031736593168907, 0.010104037837881882, 0.0012729891122201056, 6.103515625e-05,
};
static const float isogi_sh__latitudes_f32[240] = {
    0.282094806f, 0.282094806f, 0.282094806f, 0.282094806f, 0.282094806f, 0.282094806f, 0.282094806f, 0.0f, 0.463736504f,
    0.362313986f, 0.198296964f, 0.0f, -0.198296964f, -0.362313986f, -0.463736504f, 0.0f, 0.536928117f, 0.204880089f,
    -0.159546867f, -0.31539157f, -0.159546867f, 0.204880089f, 0.536928117f, 0.0f, 0.532703996f, -0.0693624169f, -0.329627067f,
    0.0f, 0.329627067f, 0.0693624169f, -0.532703996f, 0.0f, 0.462982625f, -0.308218598f, -0.104915656f, 0.317356646f,
    -0.104915656f, -0.308218598f, 0.462982625f, 0.0f, 0.153885886f, 0.327812403f, 0.446554273f, 0.488602519f, 0.446554273f,
    0.327812403f, 0.153885886f, 0.0f, 0.326587349f, 0.543550372f, 0.405246824f, 0.0f, -0.405246824f, -0.543550372f,
    -0.326587349f, 0.0f, 0.50439471f, 0.536419153f, -0.0737049133f, -0.457045794f, -0.0737049133f, 0.536419153f, 0.50439471f,
    0.0f, 0.661105335f, 0.282620609f, -0.458362132f, 0.0f, 0.458362132f, -0.282620609f, -0.661105335f, 0.0f, 0.0541872196f,
    0.245895237f, 0.456297219f, 0.546274245f, 0.456297219f, 0.245895237f, 0.0541872196f, 0.0f, 0.136069715f, 0.482423604f,
    0.489956141f, 0.0f, -0.489956141f, -0.482423604f, -0.136069715f, 0.0f, 0.248980492f, 0.606715798f, 0.060449183f,
    -0.473087341f, 0.060449183f, 0.606715798f, 0.248980492f, 0.0f, 0.0184337348f, 0.178194046f, 0.45044294f, 0.590043604f,
    0.45044294f, 0.178194046f, 0.0184337348f, 0.0f, 0.0524868108f, 0.396409333f, 0.548430264f, 0.0f, -0.548430264f,
    -0.396409333f, -0.0524868108f, 0.0f, 0.00615790021f, 0.126805812f, 0.43665117f, 0.625835717f, 0.43665117f, 0.126805812f,
    0.00615790021f, 0.0f, 0.11475306f, 0.247882456f, 0.338388085f, 0.370406687f, 0.338388085f, 0.247882456f, 0.11475306f,
    0.0f, 0.188642919f, 0.318372697f, 0.237868011f, 0.0f, -0.237868011f, -0.318372697f, -0.188642919f, 0.0f, 0.218416467f,
    0.180032313f, -0.19138515f, -0.41412726f, -0.19138515f, 0.180032313f, 0.218416467f, 0.0f, 0.216698125f, -0.0609501712f,
    -0.39540562f, 0.0f, 0.39540562f, 0.0609501712f, -0.216698125f, 0.0f, 0.188336253f, -0.270837963f, -0.125852048f,
    0.416707516f, -0.125852048f, -0.270837963f, 0.188336253f, 0.0f, 0.0312995426f, 0.144027725f, 0.267833084f, 0.320781589f,
    0.267833084f, 0.144027725f, 0.0312995426f, 0.0f, 0.066426076f, 0.238814414f, 0.243057832f, 0.0f, -0.243057832f,
    -0.238814414f, -0.066426076f, 0.0f, 0.102591112f, 0.235681221f, -0.0442065261f, -0.300063699f, -0.0442065261f,
    0.235681221f, 0.102591112f, 0.0f, 0.134465188f, 0.12417224f, -0.274915189f, 0.0f, 0.274915189f, -0.12417224f,
    -0.134465188f, 0.0f, 0.0110213822f, 0.108036578f, 0.273676693f, 0.358644724f, 0.273676693f, 0.108036578f, 0.0110213822f,
    0.0f, 0.0276758317f, 0.211957738f, 0.293864548f, 0.0f, -0.293864548f, -0.211957738f, -0.0276758317f, 0.0f, 0.0506412648f,
    0.266566783f, 0.0362560451f, -0.310595453f, 0.0362560451f, 0.266566783f, 0.0506412648f, 0.0f, 0.00374932028f,
    0.0782913715f, 0.270165443f, 0.38738057f, 0.270165443f, 0.0782913715f, 0.00374932028f, 0.0f, 0.010675529f, 0.174166486f,
    0.328935981f, 0.0f, -0.328935981f, -0.174166486f, -0.010675529f, 0.0f, 0.00125248311f, 0.05571343f, 0.261893421f,
    0.410879165f, 0.261893421f, 0.05571343f, 0.00125248311f, 0.0f,
};
#endif
/* generated: end */

/* where m > 0 starts in the table */
static const double *isogi_sh__table(int m) {
    return isogi_sh__table_f64 + 3 * ISOGI_SH__TABLE_ORDER + (m - 1) * (2 * ISOGI_SH__TABLE_ORDER - 1 - m);
}

static double isogi_sh__a(int l, int m) { return sqrt((double)(4 * l * l - 1) / (double)((l - m) * (l + m))); }

/* q_m^m from q_{m-1}^{m-1}; the sqrt 2 of m > 0 is in it. */
static double isogi_sh__next_diagonal(double q, int m) {
    if (m > 0 && m < ISOGI_SH__TABLE_ORDER) return isogi_sh__table(m)[0];
    return m == 0 ? 0.28209479177387814347 : q * sqrt((double)(2 * m + 1) / (double)(2 * m));
}

/* m = 0 near the poles: the three terms nearly cancel there and their roundings grow like l^2, but the differences of
   P_l obey l (P_l - P_{l-1}) = (l-1) (P_{l-1} - P_{l-2}) - (2l-1) t P_{l-1} with t = 1 - |z|, which does not (after Reinsch). */
static void isogi_sh__zonal_column(double *q, int order, double z, double z_low) {
    double t = z < 0 ? (1 + z) + z_low : (1 - z) - z_low, p = 1, difference = 0, sign = z < 0 ? -1 : 1;
    int l;
    q[0] = 0.28209479177387814347;
    for (l = 1; l < order && l < ISOGI_SH__TABLE_ORDER; l++) {
        const double *factor = isogi_sh__table_f64 + 3 * l;
        difference = factor[0] * difference + factor[1] * t * p;
        p += difference;
        q[l] = factor[2] * (l & 1 ? sign * p : p);
    }
    for (; l < order; l++) {
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
    if (order <= ISOGI_SH__TABLE_ORDER) {
        const double *factor = isogi_sh__table(m) + 1;
        double before = 0;
        for (l = m + 1; l < order; l++, factor += 2) {
            q[l] = factor[0] * (z * q[l - 1] + z_low * q[l - 1]) + factor[1] * before;
            before = q[l - 1];
        }
        return;
    }
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

/* Orders up to 5 of one direction, unrolled; rest: what is left of z counts, which floats do not show. */
#define ISOGI_SH__UNROLLED_ORDER 5
ISOGI_SH__INLINE void isogi_sh__eval_low(double *y, int order, isogi_sh__unit u, int rest) {
    const double *table = isogi_sh__table_f64;
    double q[ISOGI_SH__UNROLLED_ORDER], before[ISOGI_SH__UNROLLED_ORDER], c[ISOGI_SH__UNROLLED_ORDER], s[ISOGI_SH__UNROLLED_ORDER];
    double p = 1, difference = 0, sign = u.z < 0 ? -1 : 1, t = u.z < 0 ? (1 + u.z) + u.z_low : (1 - u.z) - u.z_low;
    int l, m;
    c[0] = 1, s[0] = 0, y[0] = table[2];
    ISOGI_SH__UNROLL
    for (l = 1; l < ISOGI_SH__UNROLLED_ORDER; l++) {
        double *centre = y + l * (l + 1);
        if (l >= order) return;
        difference = table[3 * l] * difference + table[3 * l + 1] * t * p; /* as in isogi_sh__zonal_column */
        p += difference;
        centre[0] = table[3 * l + 2] * (l & 1 ? sign * p : p);
        c[l] = u.x * c[l - 1] - u.y * s[l - 1], s[l] = u.x * s[l - 1] + u.y * c[l - 1];
        ISOGI_SH__UNROLL
        for (m = 1; m <= l; m++) {
            const double *pair = table + 3 * ISOGI_SH__TABLE_ORDER + (m - 1) * (2 * ISOGI_SH__TABLE_ORDER - 1 - m) + 2 * (l - m) - 1;
            if (m < l) {
                double last = q[m];
                q[m] = pair[0] * (u.z * last) + (rest ? pair[0] * (u.z_low * last) + pair[1] * before[m] : pair[1] * before[m]);
                before[m] = last;
            } else q[m] = pair[1], before[m] = 0;
            centre[m] = q[m] * c[m], centre[-m] = q[m] * s[m];
        }
    }
}

static void isogi_sh__eval_low_f32(float *y, int order, const float d[3]) {
    double wide[ISOGI_SH__UNROLLED_ORDER * ISOGI_SH__UNROLLED_ORDER];
    size_t i;
    isogi_sh__eval_low(wide, order, isogi_sh__normalise_f32(d), 0);
    for (i = 0; i < ISOGI_SH_COUNT(order); i++) y[i] = (float)wide[i];
}

static void isogi_sh__eval_low_f64(double *y, int order, const double d[3]) {
    isogi_sh__eval_low(y, order, isogi_sh__normalise(d[0], d[1], d[2]), 1);
}

/* ==== batches on vector units ========================================================================================= */

/* The same recursions with one direction in each lane, for orders up to ISOGI_SH__TABLE_ORDER, whose constants are tabled. Vectors are
   those of gcc and clang; each function names its instruction set, so that no compiler flag is needed, and runs only where the
   processor has it. Blocks with lengths out of range, tails and higher orders go through the plain code above. */
#ifdef ISOGI_SH__VECTORS
typedef float isogi_sh__f4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t isogi_sh__i4 __attribute__((vector_size(16), aligned(4), may_alias));

#define ISOGI_SH__SPLIT 15 /* rows of functions are turned degree by degree up to here, then the rest; odd */
/* The next degree of column m and of column m + 1, whose last values are p and q, into p_before and q_before, where those before stand;
   t: constants, height: z. */
#define ISOGI_SH__STEP_TWO(NAME, FMA, height, p, p_before, q, q_before, at)                                                    \
    p_before = FMA(height * NAME##_splat(t[at]), p, p_before * NAME##_splat(t[(at) + 1]));                                     \
    q_before = FMA(height * NAME##_splat(t[(at) + 2]), q, q_before * NAME##_splat(t[(at) + 3]))
#define ISOGI_SH__PUT_TWO(V, p, q)                                                                                             \
    *(V *)(centre + side) = p * power[0], *(V *)(centre - side) = p * power[1];                                                \
    *(V *)(centre + side + stride) = q * power[2], *(V *)(centre - side - stride) = q * power[3];                              \
    step += 2 * stride, centre += step

/* Defines NAME_any: all functions for WIDTH directions, that of index i at out + stride i; NAME_load and NAME_unit: directions of
   length 1, or 0 for a squared length outside [1e-30, 1e30].

   Lengths that differ from 1 by rounding alone are corrected by a series, others by a root in each lane. z = z' + low, since half an
   ulp of z near the poles is much. For m = 0, t = 1 - |z| is exact there; other columns take z' and z' + 2 low, rounded, in turn, whose
   mean has half the error of z' at no cost (in double, other roundings are greater). Near the poles (x + i y)^m would become denormal
   numbers, which take a hundred times as long: what is too small to matter is cleared. */
#define ISOGI_SH__DEFINE_EVAL(NAME, TARGET, T, V, I, WIDTH, FMA, REST, LESS, TABLE, LARGEST_ERROR, NEAR_POLE, TINY, ROOT)      \
    /* x in every lane. Compilers take a variable once, a number in memory or an expression once for each lane. */             \
    TARGET ISOGI_SH__INLINE V NAME##_splat(T x) {                                                                              \
        V zero = {0};                                                                                                          \
        return x - zero;                                                                                                       \
    }                                                                                                                          \
    /* scales vectors to about length 1, in place; 0 if a squared length is out of range: by its bits, as -ffast-math wants it */ \
    TARGET static int NAME##_scale(V *u) {                                                                                     \
        V zero = {0}, square = FMA(u[0], u[0], FMA(u[1], u[1], u[2] * u[2]));                                                  \
        I good = ((I)square > (I)(zero + (T)1e-30)) & ((I)square < (I)(zero + (T)1e30));                                       \
        T lane[WIDTH];                                                                                                         \
        int k;                                                                                                                 \
        memcpy(lane, &square, sizeof lane);                                                                                    \
        for (k = 0; k < WIDTH; k++) {                                                                                          \
            if (!good[k]) return 0;                                                                                            \
            lane[k] = 1 / ROOT(lane[k]);                                                                                       \
        }                                                                                                                      \
        memcpy(&square, lane, sizeof lane);                                                                                    \
        u[0] *= square, u[1] *= square, u[2] *= square;                                                                        \
        return 1;                                                                                                              \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE V NAME##_error(const V *u) { /* 1 - its squared length */                                          \
        V zero = {0}, one = zero + 1;                                                                                          \
        return FMA(-u[0], u[0], FMA(-u[1], u[1], REST(one, u[2])));                                                            \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_correct(V *u, V e) {                                                                   \
        V z = u[2], zero = {0};                                                                                                \
        e *= FMA(e, zero + (T)0.375, zero + (T)0.5);                                                                           \
        u[0] = FMA(u[0], e, u[0]), u[1] = FMA(u[1], e, u[1]), u[2] = FMA(z, e, z), u[3] = FMA(z, e, z - u[2]);                 \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART int NAME##_far(V *u) {                                                                              \
        if (!NAME##_scale(u)) return 0;                                                                                        \
        NAME##_correct(u, NAME##_error(u));                                                                                    \
        return 1;                                                                                                              \
    }                                                                                                                          \
    /* u[0..2] becomes a unit vector, u[3] the rest of its z */                                                                \
    TARGET ISOGI_SH__INLINE int NAME##_unit(V *u) {                                                                            \
        V zero = {0}, e = NAME##_error(u), apart[4];                                                                           \
        I sign = (I)(zero - 1) ^ (I)(zero + 1);                                                                                \
        if (LESS((I)e & ~sign, (I)(zero + (T)LARGEST_ERROR))) {                                                                \
            NAME##_correct(u, e);                                                                                              \
            return 1;                                                                                                          \
        }                                                                                                                      \
        apart[0] = u[0], apart[1] = u[1], apart[2] = u[2];                                                                     \
        if (!NAME##_far(apart)) return 0;                                                                                      \
        u[0] = apart[0], u[1] = apart[1], u[2] = apart[2], u[3] = apart[3];                                                    \
        return 1;                                                                                                              \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE int NAME##_load(V *u, const T *x, const T *y, const T *z) {                                        \
        u[0] = *(const V *)x, u[1] = *(const V *)y, u[2] = *(const V *)z;                                                      \
        return NAME##_unit(u);                                                                                                 \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE V NAME##_clear(V x) {                                                                              \
        V zero = {0};                                                                                                          \
        I top = (I)(zero - 1) ^ (I)(zero + 1);                                                                                 \
        return (V)((I)x & (I)((V)((I)x & ~top) > (T)TINY));                                                                    \
    }                                                                                                                          \
    /* (x + i y)^(m + 1) from (x + i y)^m */                                                                                   \
    TARGET ISOGI_SH__INLINE void NAME##_next_power(V *to, const V *from, const V *u, int clear) {                              \
        V c = FMA(u[0], from[0], -(u[1] * from[1])), s = FMA(u[0], from[1], u[1] * from[0]);                                   \
        to[0] = clear ? NAME##_clear(c) : c, to[1] = clear ? NAME##_clear(s) : s;                                              \
    }                                                                                                                          \
    /* Degrees `from` to `to` - 1 of column m, which is odd, and of the next: neither waits for the other. centre: where Y_l^0 of the\
       first of them goes, not before m; z: two numbers whose mean is the height, taken in turn; power: (x + i y)^m and the next one;\
       t: constants of both columns. In `state` stands where the recursions were left off, and will be, where it is not NULL. */\
    TARGET ISOGI_SH__INLINE void NAME##_two_columns(T *centre, size_t stride, int from, int to, int m, const T *t, const V *z, \
                                                    const V *power, V *state) {                                                \
        size_t side = stride * (size_t)m, step = 2 * stride * (size_t)(m < from ? from : m);                                   \
        V p, p_before, q, q_before, zero = {0};                                                                                \
        int l = from;                                                                                                          \
        if (m < from) {                                                                                                        \
            p = state[0], p_before = state[1], q = state[2], q_before = state[3];                                              \
        } else {                                                                                                               \
            p_before = NAME##_splat(t[0]), q_before = zero;                                                                    \
            *(V *)(centre + side) = p_before * power[0], *(V *)(centre - side) = p_before * power[1];                          \
            if (m + 1 == to) return;                                                                                           \
            step += 2 * stride, centre += step;                                                                                \
            p = z[0] * NAME##_splat(t[1]) * p_before, q = NAME##_splat(t[2]), l = m + 2;                                       \
            ISOGI_SH__PUT_TWO(V, p, q);                                                                                        \
        }                                                                                                                      \
        t += 4 * (l - m) - 5;                                                                                                  \
        for (; l + 1 < to; l += 2, t += 8) {                                                                                   \
            ISOGI_SH__STEP_TWO(NAME, FMA, z[1], p, p_before, q, q_before, 0);                                                  \
            ISOGI_SH__PUT_TWO(V, p_before, q_before);                                                                          \
            ISOGI_SH__STEP_TWO(NAME, FMA, z[0], p_before, p, q_before, q, 4);                                                  \
            ISOGI_SH__PUT_TWO(V, p, q);                                                                                        \
        }                                                                                                                      \
        if (!from && state) { /* all of an even number of degrees, as SPLIT is odd */                                          \
            state[0] = p, state[1] = p_before, state[2] = q, state[3] = q_before;                                              \
        } else if (l < to) {                                                                                                   \
            ISOGI_SH__STEP_TWO(NAME, FMA, z[1], p, p_before, q, q_before, 0);                                                  \
            ISOGI_SH__PUT_TWO(V, p_before, q_before);                                                                          \
        }                                                                                                                      \
    }                                                                                                                          \
    /* The next degree of m = 0, as in isogi_sh__zonal_column, but for the sign of z where it is odd. column: the value of the \
       degree before, the step to it, and 1 - |z|. */                                                                          \
    TARGET ISOGI_SH__INLINE V NAME##_next_zonal(V *column, const T *factor) {                                                  \
        column[1] = FMA(column[2] * NAME##_splat(factor[1]), column[0], column[1] * NAME##_splat(factor[0]));                  \
        column[0] += column[1];                                                                                                \
        return column[0] * NAME##_splat(factor[2]);                                                                            \
    }                                                                                                                          \
    /* Degrees `from`, which is SPLIT or 0, to `to` - 1; state: that of m = 0 and of columns below SPLIT, to be written or read, or\
       NULL where these are all degrees. With two columns go two degrees of m = 0, each of which waits for the one before. */  \
    TARGET ISOGI_SH__INLINE void NAME##_degrees(T *out, size_t stride, int from, int to, const V *u, V *state) {               \
        V column[3], power[4], z[2], zero = {0}, one = zero + 1, r = FMA(u[0], u[0], u[1] * u[1]);                             \
        I sign = (I)u[2] & ((I)(-one) ^ (I)one);                                                                               \
        const T *t = TABLE + 3 * ISOGI_SH__TABLE_ORDER, *factor = TABLE + 3 * (from ? from : 1);                               \
        T *centre = out + stride * (size_t)(from ? from : 2); /* where Y_l^0 of the first degree of the columns goes */        \
        int m, clear = !LESS((I)(zero + (T)NEAR_POLE), (I)r);                                                                  \
        z[0] = u[2], z[1] = u[2] + (u[3] + u[3]);                                                                              \
        column[2] = (one - (V)((I)u[2] ^ sign)) - (V)((I)u[3] ^ sign);                                                         \
        power[0] = clear ? NAME##_clear(u[0]) : u[0], power[1] = clear ? NAME##_clear(u[1]) : u[1];                            \
        if (from) column[0] = state[0], column[1] = state[1];                                                                  \
        else column[0] = one, column[1] = zero, *(V *)out = NAME##_splat(TABLE[2]);                                            \
        for (m = 1; m < to; m += 2) {                                                                                          \
            NAME##_next_power(power + 2, power, u, clear);                                                                     \
            NAME##_two_columns(centre, stride, from, to, m, t, z, power, state && m < ISOGI_SH__SPLIT ? state + 2 * m : NULL); \
            NAME##_next_power(power, power + 2, u, clear);                                                                     \
            t += 4 * (ISOGI_SH__TABLE_ORDER - m) - 5;                                                                          \
            if (m < from) continue;                                                                                            \
            *(V *)centre = (V)((I)NAME##_next_zonal(column, factor) ^ sign), centre += 2 * stride * (size_t)(m + 1);           \
            if (m + 1 < to) *(V *)centre = NAME##_next_zonal(column, factor + 3);                                              \
            centre += 2 * stride * (size_t)(m + 2), factor += 6;                                                               \
        }                                                                                                                      \
        if (!from && state) state[0] = column[0], state[1] = column[1];                                                        \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART void NAME##_any(T *out, size_t stride, int to, const V *u) { NAME##_degrees(out, stride, 0, to, u, NULL); }

/* y[k][i] = row i + .. of column k, for 4 rows (or vectors of 4 x 4 tiles) a, b, c, d */
#define ISOGI_SH__TURN(V, SUFFIX)                                                                                              \
    {                                                                                                                          \
        V e = ISOGI_SH__LOW_##SUFFIX(a, b), f = ISOGI_SH__HIGH_##SUFFIX(a, b), g = ISOGI_SH__LOW_##SUFFIX(c, d), \
            h = ISOGI_SH__HIGH_##SUFFIX(c, d); \
        *(V *)(y + i) = ISOGI_SH__EVEN_##SUFFIX(e, g);                                                                         \
        *(V *)(y + i + n) = ISOGI_SH__ODD_##SUFFIX(e, g);                                                                      \
        *(V *)(y + i + 2 * n) = ISOGI_SH__EVEN_##SUFFIX(f, h);                                                                 \
        *(V *)(y + i + 3 * n) = ISOGI_SH__ODD_##SUFFIX(f, h);                                                                  \
    }
#define ISOGI_SH__LOW_F4(a, b) __builtin_shufflevector(a, b, 0, 4, 1, 5)
#define ISOGI_SH__HIGH_F4(a, b) __builtin_shufflevector(a, b, 2, 6, 3, 7)
#define ISOGI_SH__EVEN_F4(a, b) __builtin_shufflevector(a, b, 0, 1, 4, 5)
#define ISOGI_SH__ODD_F4(a, b) __builtin_shufflevector(a, b, 2, 3, 6, 7)
#define ISOGI_SH__ROW_F4(i) (*(const isogi_sh__f4 *)(in + pitch * (size_t)(i)))

/* y[4][n] = in[n][pitch] from row i on */
ISOGI_SH__INLINE void isogi_sh__eval_f4_turn(float *y, size_t n, const float *in, size_t pitch, size_t i) {
    size_t k;
    for (; i + 4 <= n; i += 4) {
        isogi_sh__f4 a = ISOGI_SH__ROW_F4(i), b = ISOGI_SH__ROW_F4(i + 1), c = ISOGI_SH__ROW_F4(i + 2), d = ISOGI_SH__ROW_F4(i + 3);
        ISOGI_SH__TURN(isogi_sh__f4, F4)
    }
    for (; i < n; i++)
        for (k = 0; k < 4; k++) y[n * k + i] = in[pitch * i + k];
}

ISOGI_SH__INLINE void isogi_sh__eval_f4_split(isogi_sh__f4 *u, const float *from) {
    isogi_sh__f4 a = *(const isogi_sh__f4 *)from, b = *(const isogi_sh__f4 *)(from + 4), c = *(const isogi_sh__f4 *)(from + 8);
    isogi_sh__f4 x = __builtin_shufflevector(a, b, 0, 3, 6, 6), y = __builtin_shufflevector(a, b, 1, 4, 7, 7),
                 z = __builtin_shufflevector(a, b, 2, 5, 5, 5);
    u[0] = __builtin_shufflevector(x, c, 0, 1, 2, 5), u[1] = __builtin_shufflevector(y, c, 0, 1, 2, 6),
    u[2] = __builtin_shufflevector(z, c, 0, 1, 4, 7);
}

/* a < b in all lanes, for the bits of numbers that are not negative: NaN is greater than all others, with -ffast-math too */
ISOGI_SH__INLINE int isogi_sh__less_f4(isogi_sh__i4 a, isogi_sh__i4 b) {
    isogi_sh__i4 less = a < b;
    int64_t word[2];
    memcpy(word, &less, sizeof word);
    return (word[0] & word[1]) == -1;
}
#define ISOGI_SH__LESS_F4(a, b) isogi_sh__less_f4(a, b)
#define ISOGI_SH__FMA_F4(a, b, c) ((a) * (b) + (c))
#define ISOGI_SH__REST_F4(one, z) (((one) - (z)) * ((one) + (z))) /* 1 - z^2, exact near the poles without fused operations too */
ISOGI_SH__DEFINE_EVAL(isogi_sh__eval_f4, , float, isogi_sh__f4, isogi_sh__i4, 4, ISOGI_SH__FMA_F4, ISOGI_SH__REST_F4, ISOGI_SH__LESS_F4,
                      isogi_sh__columns_f32, 1e-3, 1e-3, 1e-19, sqrtf)

/* Blocks of 4 from the first direction on: how many are done. */
static size_t isogi_sh__eval_f4(float *out, size_t stride, int order, const float *x, const float *y, const float *z, size_t count) {
    isogi_sh__f4 u[4];
    size_t i;
    for (i = 0; i + 4 <= count && isogi_sh__eval_f4_load(u, x + i, y + i, z + i); i += 4)
        isogi_sh__eval_f4_any(out + i, stride, order, u);
    return i;
}

static size_t isogi_sh__eval_f4_rows(float *out, int order, const float (*direction)[3], size_t count) {
    float scratch[4 * ISOGI_SH__TABLE_ORDER * ISOGI_SH__TABLE_ORDER];
    isogi_sh__f4 u[4];
    size_t i, n = ISOGI_SH_COUNT(order);
    for (i = 0; i + 4 <= count; i += 4) {
        isogi_sh__eval_f4_split(u, direction[i]);
        if (!isogi_sh__eval_f4_unit(u)) break;
        isogi_sh__eval_f4_any(scratch, 4, order, u);
        isogi_sh__eval_f4_turn(out + n * i, n, scratch, 4, 0);
    }
    return i;
}
#endif

#ifdef ISOGI_SH__SIMD
/* isogi_sh__level() > 0 */
ISOGI_SH__INLINE int isogi_sh__avx2(void) {
#ifdef ISOGI_SH_LEVEL
    if (!(ISOGI_SH_LEVEL)) return 0;
#endif
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

/* 0 what the compiler may use anyway, 1 AVX2 and FMA, 2 AVX-512 */
static int isogi_sh__level(void) {
    int level = 0;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) level = 1;
    if (level && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq")) level = 2;
#ifdef ISOGI_SH_LEVEL
    if (level > (ISOGI_SH_LEVEL)) level = (ISOGI_SH_LEVEL);
#endif
    return level;
}

typedef float isogi_sh__f8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef float isogi_sh__f16 __attribute__((vector_size(64), aligned(4), may_alias));
typedef double isogi_sh__d4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef double isogi_sh__half __attribute__((vector_size(32), aligned(4), may_alias)); /* 8 floats: gcc 12 stores it from where it is */
typedef double isogi_sh__d8 __attribute__((vector_size(64), aligned(8), may_alias));
typedef int32_t isogi_sh__i8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef int32_t isogi_sh__i16 __attribute__((vector_size(64), aligned(4), may_alias));
typedef int64_t isogi_sh__l4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long isogi_sh__l8 __attribute__((vector_size(64), aligned(8), may_alias));
typedef double isogi_sh__d2 __attribute__((vector_size(16), aligned(8), may_alias));
typedef double isogi_sh__two __attribute__((aligned(4), may_alias)); /* 2 floats */

#define ISOGI_SH__AVX2 __attribute__((target("avx2,fma")))
#define ISOGI_SH__AVX512 __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq")))
#define ISOGI_SH__SPLAT_F8(x) isogi_sh__eval_f8_splat(x)
#if defined(__clang__)
#define ISOGI_SH__FROM_F8(p) ISOGI_SH__SPLAT_F8(*(p))
#else /* gcc would rather load neighbours together, and shuffle them */
#define ISOGI_SH__FROM_F8(p) ((isogi_sh__f8)_mm256_broadcast_ss(p))
#endif
#define ISOGI_SH__ADD_F8(a, x, sum) ISOGI_SH__FMA_F8(a, ISOGI_SH__SPLAT_F8(x), sum) /* of a number x */
#define ISOGI_SH__FMA_F8(a, b, c) ((isogi_sh__f8)_mm256_fmadd_ps((__m256)(a), (__m256)(b), (__m256)(c)))
#define ISOGI_SH__FMA_D4(a, b, c) ((isogi_sh__d4)_mm256_fmadd_pd((__m256d)(a), (__m256d)(b), (__m256d)(c)))
#define ISOGI_SH__FMA_F16(a, b, c) ((isogi_sh__f16)_mm512_fmadd_ps((__m512)(a), (__m512)(b), (__m512)(c)))
#define ISOGI_SH__FMA_D8(a, b, c) ((isogi_sh__d8)_mm512_fmadd_pd((__m512d)(a), (__m512d)(b), (__m512d)(c)))

/* Vectors of several rows that stand one after the other in memory, and halves of a vector: gcc 12 would shuffle where an insertion or
   an extraction costs a third. */
#if defined(__clang__)
#define ISOGI_SH__HALF_D8(v, k) __builtin_shufflevector(v, v, 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3)
#define ISOGI_SH__JOIN_F8(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#define ISOGI_SH__TWICE_F4(p) ISOGI_SH__JOIN_F8(*(const isogi_sh__f4 *)(p), *(const isogi_sh__f4 *)(p))
#define ISOGI_SH__JOIN_HALVES(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#define ISOGI_SH__JOIN_F16(a, b, c, d) __builtin_shufflevector(ISOGI_SH__JOIN_F8(a, b), ISOGI_SH__JOIN_F8(c, d), 0, 1, 2, 3, 4, 5, 6, 7, \
    8, 9, 10, 11, 12, 13, 14, 15)
#else /* with a mask of all: without, gcc 12 warns of vectors that its own headers leave undefined */
#define ISOGI_SH__JOIN_F8(a, b) ((isogi_sh__f8)_mm256_insertf128_ps(_mm256_castps128_ps256((__m128)(a)), (__m128)(b), 1))
#define ISOGI_SH__TWICE_F4(p) _mm256_broadcast_ps((const __m128 *)(const void *)(p))
#define ISOGI_SH__HALF_D8(v, k) ((isogi_sh__d4)_mm512_maskz_extractf64x4_pd(0xff, (__m512d)(v), k))
#define ISOGI_SH__JOIN_HALVES(a, b) ((isogi_sh__d8)_mm512_mask_insertf64x4(_mm512_castpd256_pd512((__m256d)(a)), 0xff, \
    _mm512_castpd256_pd512((__m256d)(a)), (__m256d)(b), 1))
#define ISOGI_SH__PUT_F16(v, a, k) _mm512_mask_insertf32x4(v, 0xffff, v, (__m128)(a), k)
#define ISOGI_SH__JOIN_F16(a, b, c, d)                                                                                        \
    ((isogi_sh__f16)ISOGI_SH__PUT_F16(ISOGI_SH__PUT_F16(ISOGI_SH__PUT_F16(_mm512_castps128_ps512((__m128)(a)), b, 1), c, 2), d, 3))
#endif

/* y[4][n] = in[n][pitch]: 4 x 4 transposed in each quarter of a vector, whose quarters are rows 4 apart. n is a square, 9 or more: what
   16 and 8 rows at a time leave over is 4, 1 or none. The plain loop is for them. */
#define ISOGI_SH__LOW_F8(a, b) __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13)
#define ISOGI_SH__HIGH_F8(a, b) __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15)
#define ISOGI_SH__EVEN_F8(a, b) __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define ISOGI_SH__ODD_F8(a, b) __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
#define ISOGI_SH__LOW_F16(a, b) __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
#define ISOGI_SH__HIGH_F16(a, b) __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
#define ISOGI_SH__EVEN_F16(a, b) __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
#define ISOGI_SH__ODD_F16(a, b) __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
#define ISOGI_SH__JOIN_D8(i, j) ISOGI_SH__JOIN_HALVES(*(const isogi_sh__d4 *)(const void *)(in + pitch * (i)), \
    *(const isogi_sh__d4 *)(const void *)(in + pitch * (j)))
/* Two vectors of quarters a b c d and e f g h become a e c g and b f d h, by one shuffle, which is what transposing waits for, and two
   blends, which other units do. */
#define ISOGI_SH__ACROSS_D8(p, q) __builtin_shufflevector(p, q, 2, 3, 8, 9, 6, 7, 12, 13)
#define ISOGI_SH__BLEND_D8(mask, p, r) _mm512_mask_blend_pd(mask, (__m512d)(p), (__m512d)(r))
#define ISOGI_SH__FIRST_D8(p, r) (isogi_sh__d8) ISOGI_SH__BLEND_D8(0xcc, p, r)
#define ISOGI_SH__SECOND_D8(q, r) (isogi_sh__d8) ISOGI_SH__BLEND_D8(0x33, q, r)
#define ISOGI_SH__ROWS_F8(j) ISOGI_SH__JOIN_F8(ISOGI_SH__ROW_F4(j), ISOGI_SH__ROW_F4((j) + 4))
#define ISOGI_SH__ROWS_F16(j) ISOGI_SH__JOIN_F16(ISOGI_SH__ROW_F4(j), ISOGI_SH__ROW_F4((j) + 4), ISOGI_SH__ROW_F4((j) + 8), \
    ISOGI_SH__ROW_F4((j) + 12))
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__join_f8_turn(float *y, size_t n, const float *in, size_t pitch, size_t i) {
    size_t k;
    for (; i + 8 <= n; i += 8) {
        isogi_sh__f8 a = ISOGI_SH__ROWS_F8(i), b = ISOGI_SH__ROWS_F8(i + 1), c = ISOGI_SH__ROWS_F8(i + 2), d = ISOGI_SH__ROWS_F8(i + 3);
        ISOGI_SH__TURN(isogi_sh__f8, F8)
    }
    for (; i < n; i++)
        for (k = 0; k < 4; k++) y[n * k + i] = in[pitch * i + k];
}
/* y[k][i] = row i of column k for one or two 8 x 8 tiles in memory; see isogi_sh__transpose_f16 */
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__transpose_f8(float *y, size_t n, const isogi_sh__f8 *row, size_t tiles) {
    const float *in = (const float *)row;
    size_t half, tile, k, pitch = 8;
    for (half = 0; half < 2; half++, y += 4 * n, in += 4) {
        isogi_sh__f8 v[2][4];
        ISOGI_SH__UNROLL
        for (tile = 0; tile < tiles; tile++) {
            isogi_sh__f8 a = ISOGI_SH__ROWS_F8(8 * tile), b = ISOGI_SH__ROWS_F8(8 * tile + 1), c = ISOGI_SH__ROWS_F8(8 * tile + 2),
                         d = ISOGI_SH__ROWS_F8(8 * tile + 3);
            isogi_sh__f8 e = ISOGI_SH__LOW_F8(a, b), f = ISOGI_SH__HIGH_F8(a, b), g = ISOGI_SH__LOW_F8(c, d), h = ISOGI_SH__HIGH_F8(c, d);
            v[tile][0] = ISOGI_SH__EVEN_F8(e, g), v[tile][1] = ISOGI_SH__ODD_F8(e, g);
            v[tile][2] = ISOGI_SH__EVEN_F8(f, h), v[tile][3] = ISOGI_SH__ODD_F8(f, h);
        }
        ISOGI_SH__UNROLL
        for (k = 0; k < 4; k++) {
            ISOGI_SH__UNROLL
            for (tile = 0; tile < tiles; tile++) *(isogi_sh__f8 *)(y + n * k + 8 * tile) = v[tile][k];
        }
    }
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__join_f16_turn(float *y, size_t n, const float *in, size_t pitch, size_t i) {
    for (; i + 16 <= n; i += 16) {
        isogi_sh__f16 a = ISOGI_SH__ROWS_F16(i), b = ISOGI_SH__ROWS_F16(i + 1), c = ISOGI_SH__ROWS_F16(i + 2),
                      d = ISOGI_SH__ROWS_F16(i + 3);
        ISOGI_SH__TURN(isogi_sh__f16, F16)
    }
    isogi_sh__join_f8_turn(y, n, in, pitch, i);
}

/* y[k][i] = row i of column k for 8 rows and as many columns as are lanes, from registers: 4 x 4 (or 2 x 2) transposed in each quarter
   of a vector, then quarters of both halves of the rows joined. Halves of 64 bytes are stored each by itself, which costs as much as the
   last shuffle would: stores that cross lines of the cache are what evaluation of rows waits for in the end. */
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_f8_turn(float *y, size_t n, const isogi_sh__f8 *row) {
    int half;
    ISOGI_SH__UNROLL
    for (half = 0; half < 2; half++, row += 4, y += 4) {
        isogi_sh__f8 e = ISOGI_SH__LOW_F8(row[0], row[1]), f = ISOGI_SH__HIGH_F8(row[0], row[1]), v[4];
        isogi_sh__f8 g = ISOGI_SH__LOW_F8(row[2], row[3]), h = ISOGI_SH__HIGH_F8(row[2], row[3]);
        size_t k;
        v[0] = ISOGI_SH__EVEN_F8(e, g), v[1] = ISOGI_SH__ODD_F8(e, g), v[2] = ISOGI_SH__EVEN_F8(f, h), v[3] = ISOGI_SH__ODD_F8(f, h);
        ISOGI_SH__UNROLL
        for (k = 0; k < 4; k++) {
            *(isogi_sh__f4 *)(y + n * k) = __builtin_shufflevector(v[k], v[k], 0, 1, 2, 3);
            *(isogi_sh__f4 *)(y + n * (k + 4)) = __builtin_shufflevector(v[k], v[k], 4, 5, 6, 7);
        }
    }
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_f16_turn(float *y, size_t n, const isogi_sh__f16 *row) {
    isogi_sh__d8 v[2][4];
    int half;
    size_t k;
    ISOGI_SH__UNROLL
    for (half = 0; half < 2; half++, row += 4) {
        isogi_sh__f16 e = ISOGI_SH__LOW_F16(row[0], row[1]), f = ISOGI_SH__HIGH_F16(row[0], row[1]);
        isogi_sh__f16 g = ISOGI_SH__LOW_F16(row[2], row[3]), h = ISOGI_SH__HIGH_F16(row[2], row[3]);
        v[half][0] = (isogi_sh__d8)ISOGI_SH__EVEN_F16(e, g), v[half][1] = (isogi_sh__d8)ISOGI_SH__ODD_F16(e, g);
        v[half][2] = (isogi_sh__d8)ISOGI_SH__EVEN_F16(f, h), v[half][3] = (isogi_sh__d8)ISOGI_SH__ODD_F16(f, h);
    }
    ISOGI_SH__UNROLL
    for (k = 0; k < 4; k++) {
        isogi_sh__d8 p = __builtin_shufflevector(v[0][k], v[1][k], 0, 1, 8, 9, 2, 3, 10, 11);
        isogi_sh__d8 q = __builtin_shufflevector(v[0][k], v[1][k], 4, 5, 12, 13, 6, 7, 14, 15);
        *(isogi_sh__half *)(y + n * k) = ISOGI_SH__HALF_D8(p, 0);
        *(isogi_sh__half *)(y + n * (k + 4)) = ISOGI_SH__HALF_D8(p, 1);
        *(isogi_sh__half *)(y + n * (k + 8)) = ISOGI_SH__HALF_D8(q, 0);
        *(isogi_sh__half *)(y + n * (k + 12)) = ISOGI_SH__HALF_D8(q, 1);
    }
}

ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_d4_turn(double *y, size_t n, const isogi_sh__d4 *row) {
    isogi_sh__d4 v[2][4];
    size_t half, k;
    ISOGI_SH__UNROLL
    for (half = 0; half < 2; half++, row += 4) {
        isogi_sh__d4 a = __builtin_shufflevector(row[0], row[1], 0, 4, 2, 6), b = __builtin_shufflevector(row[0], row[1], 1, 5, 3, 7);
        isogi_sh__d4 c = __builtin_shufflevector(row[2], row[3], 0, 4, 2, 6), d = __builtin_shufflevector(row[2], row[3], 1, 5, 3, 7);
        v[half][0] = __builtin_shufflevector(a, c, 0, 1, 4, 5), v[half][1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
        v[half][2] = __builtin_shufflevector(a, c, 2, 3, 6, 7), v[half][3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
    }
    ISOGI_SH__UNROLL
    for (k = 0; k < 4; k++) *(isogi_sh__d4 *)(y + n * k) = v[0][k], *(isogi_sh__d4 *)(y + n * k + 4) = v[1][k];
}

/* 8 numbers of a direction, from halves of two vectors, and the constant before them where they are the first. What are neighbours in
   memory is stored one after the other, whatever the compiler would like: stores in another order take a seventh longer. */
#define ISOGI_SH__IN_ORDER __asm__ volatile("" ::: "memory")
#define ISOGI_SH__PUT_HALVES(y, k)                                                                                             \
    ISOGI_SH__IN_ORDER;                                                                                                        \
    if (first) (y)[-1] = 0.28209479177387814;                                                                                  \
    *(isogi_sh__d4 *)(y) = ISOGI_SH__HALF_D8(p, k);                                                                            \
    ISOGI_SH__IN_ORDER; /* clang would join them */                                                                            \
    *(isogi_sh__d4 *)((y) + 4) = ISOGI_SH__HALF_D8(q, k);                                                                      \
    ISOGI_SH__IN_ORDER
#define ISOGI_SH__LANE(k) (mixed ? 3 * (k) % 8 : (k)) /* the direction of lane k */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_turn_at(double *y, size_t n, const isogi_sh__d8 *row, int first, int mixed) {
    isogi_sh__d8 v[4][2], p, q;
    size_t k;
    ISOGI_SH__UNROLL
    for (k = 0; k < 4; k++) {
        v[k][0] = __builtin_shufflevector(row[2 * k], row[2 * k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
        v[k][1] = __builtin_shufflevector(row[2 * k], row[2 * k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    }
    ISOGI_SH__UNROLL
    for (k = 0; k < 2; k++) {
        p = __builtin_shufflevector(v[0][k], v[1][k], 0, 1, 8, 9, 2, 3, 10, 11);
        q = __builtin_shufflevector(v[2][k], v[3][k], 0, 1, 8, 9, 2, 3, 10, 11);
        ISOGI_SH__PUT_HALVES(y + n * ISOGI_SH__LANE(k), 0);
        ISOGI_SH__PUT_HALVES(y + n * ISOGI_SH__LANE(k + 2), 1);
        p = __builtin_shufflevector(v[0][k], v[1][k], 4, 5, 12, 13, 6, 7, 14, 15);
        q = __builtin_shufflevector(v[2][k], v[3][k], 4, 5, 12, 13, 6, 7, 14, 15);
        ISOGI_SH__PUT_HALVES(y + n * ISOGI_SH__LANE(k + 4), 0);
        ISOGI_SH__PUT_HALVES(y + n * ISOGI_SH__LANE(k + 6), 1);
    }
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_turn(double *y, size_t n, const isogi_sh__d8 *row) {
    isogi_sh__eval_d8_turn_at(y, n, row, 0, 0);
}

/* the same for columns 1 to 8 of order 5, with column 0, which is constant, and for later ones; of doubles, lanes are those of
   isogi_sh__eval_d8_mixed */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_turn_first(double *y, const isogi_sh__d8 *row) {
    isogi_sh__eval_d8_turn_at(y + 1, 25, row + 1, 1, 1);
}
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_turn_mixed(double *y, const isogi_sh__d8 *row) {
    isogi_sh__eval_d8_turn_at(y, 25, row, 0, 1);
}
#define ISOGI_SH__DEFINE_TURN_FIRST(NAME, TARGET, T, V, WIDTH)                                                                 \
    TARGET ISOGI_SH__INLINE void NAME##_turn_first(T *y, const V *row) {                                                       \
        size_t k;                                                                                                              \
        ISOGI_SH__UNROLL25                                                                                                     \
        for (k = 0; k < WIDTH; k++) y[25 * k] = (T)0.28209479177387814;                                                        \
        NAME##_turn(y + 1, 25, row + 1);                                                                                       \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_turn_mixed(T *y, const V *row) { NAME##_turn(y, 25, row); }
ISOGI_SH__DEFINE_TURN_FIRST(isogi_sh__eval_f8, ISOGI_SH__AVX2, float, isogi_sh__f8, 8)
ISOGI_SH__DEFINE_TURN_FIRST(isogi_sh__eval_f16, ISOGI_SH__AVX512, float, isogi_sh__f16, 16)
ISOGI_SH__DEFINE_TURN_FIRST(isogi_sh__eval_d4, ISOGI_SH__AVX2, double, isogi_sh__d4, 4)

/* The same for 16 rows of floats and 8 of doubles from memory, where halves of two rows are joined by an insertion, so that one shuffle
   is less and whole vectors are stored. Of `tiles` tiles, 1 or 2, those of a direction are stored one after the other where stores are what
   this waits for: neighbours that cross lines of the cache are written in two thirds of the time. */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__transpose_f16(float *y, size_t n, const isogi_sh__f16 *row, size_t tiles) {
    const float *in = (const float *)row;
    size_t half, k, pitch = 16;
    for (half = 0; half < 2 * tiles; half++, y += half & 1 ? (ptrdiff_t)(8 * n) : 16 - (ptrdiff_t)(8 * n), in += half & 1 ? 8 : 248) {
        isogi_sh__f16 v[2][4];
        ISOGI_SH__UNROLL
        for (k = 0; k < 2; k++) {
            const isogi_sh__f16 a = (isogi_sh__f16)ISOGI_SH__JOIN_D8(4 * k, 4 * k + 8),
                                b = (isogi_sh__f16)ISOGI_SH__JOIN_D8(4 * k + 1, 4 * k + 9);
            const isogi_sh__f16 c = (isogi_sh__f16)ISOGI_SH__JOIN_D8(4 * k + 2, 4 * k + 10),
                                d = (isogi_sh__f16)ISOGI_SH__JOIN_D8(4 * k + 3, 4 * k + 11);
            isogi_sh__f16 e = ISOGI_SH__LOW_F16(a, b), f = ISOGI_SH__HIGH_F16(a, b), g = ISOGI_SH__LOW_F16(c, d),
                          h = ISOGI_SH__HIGH_F16(c, d);
            v[k][0] = ISOGI_SH__EVEN_F16(e, g), v[k][1] = ISOGI_SH__ODD_F16(e, g), v[k][2] = ISOGI_SH__EVEN_F16(f, h),
            v[k][3] = ISOGI_SH__ODD_F16(f, h);
        }
        ISOGI_SH__UNROLL
        for (k = 0; k < 4; k++) {
            isogi_sh__d8 p = (isogi_sh__d8)v[0][k], q = (isogi_sh__d8)v[1][k], r = ISOGI_SH__ACROSS_D8(p, q);
            *(isogi_sh__f16 *)(y + n * k) = (isogi_sh__f16)ISOGI_SH__FIRST_D8(p, r);
            *(isogi_sh__f16 *)(y + n * (k + 4)) = (isogi_sh__f16)ISOGI_SH__SECOND_D8(q, r);
        }
    }
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__transpose_d8(double *y, size_t n, const isogi_sh__d8 *row, size_t tiles) {
    const double *in = (const double *)row;
    size_t half, tile, k, pitch = 8;
    for (half = 0; half < 2; half++, y += 4 * n, in += 4) {
        isogi_sh__d8 v[2][4];
        ISOGI_SH__UNROLL
        for (tile = 0; tile < tiles; tile++) {
            const isogi_sh__d8 a = ISOGI_SH__JOIN_D8(8 * tile, 8 * tile + 2), b = ISOGI_SH__JOIN_D8(8 * tile + 1, 8 * tile + 3),
                               c = ISOGI_SH__JOIN_D8(8 * tile + 4, 8 * tile + 6), d = ISOGI_SH__JOIN_D8(8 * tile + 5, 8 * tile + 7);
            isogi_sh__d8 e = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14),
                         f = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
            isogi_sh__d8 g = __builtin_shufflevector(c, d, 0, 8, 2, 10, 4, 12, 6, 14),
                         h = __builtin_shufflevector(c, d, 1, 9, 3, 11, 5, 13, 7, 15);
            v[tile][0] = __builtin_shufflevector(e, g, 0, 1, 4, 5, 8, 9, 12, 13);
            v[tile][1] = __builtin_shufflevector(f, h, 0, 1, 4, 5, 8, 9, 12, 13);
            v[tile][2] = __builtin_shufflevector(e, g, 2, 3, 6, 7, 10, 11, 14, 15);
            v[tile][3] = __builtin_shufflevector(f, h, 2, 3, 6, 7, 10, 11, 14, 15);
        }
        ISOGI_SH__UNROLL
        for (k = 0; k < 4; k++) {
            ISOGI_SH__UNROLL
            for (tile = 0; tile < tiles; tile++) *(isogi_sh__d8 *)(y + n * k + 8 * tile) = v[tile][k];
        }
    }
}

ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__transpose_d4(double *y, size_t n, const isogi_sh__d4 *row, size_t tiles) {
    size_t tile;
    for (tile = 0; tile < tiles; tile++) isogi_sh__eval_d4_turn(y + 8 * tile, n, row + 8 * tile);
}

/* directions into coordinates */
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_f8_split(isogi_sh__f8 *u, const float *from) {
    isogi_sh__f8 a = *(const isogi_sh__f8 *)from, b = *(const isogi_sh__f8 *)(from + 8), c = *(const isogi_sh__f8 *)(from + 16);
    isogi_sh__f8 x = __builtin_shufflevector(a, b, 0, 3, 6, 9, 12, 15, 0, 0), y = __builtin_shufflevector(a, b, 1, 4, 7, 10, 13, 0, 0, 0);
    isogi_sh__f8 z = __builtin_shufflevector(a, b, 2, 5, 8, 11, 14, 0, 0, 0);
    u[0] = __builtin_shufflevector(x, c, 0, 1, 2, 3, 4, 5, 10, 13);
    u[1] = __builtin_shufflevector(y, c, 0, 1, 2, 3, 4, 8, 11, 14);
    u[2] = __builtin_shufflevector(z, c, 0, 1, 2, 3, 4, 9, 12, 15);
}

ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_d4_split(isogi_sh__d4 *u, const double *from) {
    isogi_sh__d4 a = *(const isogi_sh__d4 *)from, b = *(const isogi_sh__d4 *)(from + 4), c = *(const isogi_sh__d4 *)(from + 8);
    isogi_sh__d4 x = __builtin_shufflevector(a, b, 0, 3, 6, 0), y = __builtin_shufflevector(a, b, 1, 4, 7, 0);
    isogi_sh__d4 z = __builtin_shufflevector(a, b, 2, 5, 0, 0);
    u[0] = __builtin_shufflevector(x, c, 0, 1, 2, 5);
    u[1] = __builtin_shufflevector(y, c, 0, 1, 2, 6);
    u[2] = __builtin_shufflevector(z, c, 0, 1, 4, 7);
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_f16_split(isogi_sh__f16 *u, const float *from) {
    isogi_sh__f16 a = *(const isogi_sh__f16 *)from, b = *(const isogi_sh__f16 *)(from + 16), c = *(const isogi_sh__f16 *)(from + 32);
    isogi_sh__f16 x = __builtin_shufflevector(a, b, 0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 0, 0, 0, 0, 0);
    isogi_sh__f16 y = __builtin_shufflevector(a, b, 1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 0, 0, 0, 0, 0);
    isogi_sh__f16 z = __builtin_shufflevector(a, b, 2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 0, 0, 0, 0, 0, 0);
    u[0] = __builtin_shufflevector(x, c, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29);
    u[1] = __builtin_shufflevector(y, c, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30);
    u[2] = __builtin_shufflevector(z, c, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31);
}

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_split(isogi_sh__d8 *u, const double *from) {
    isogi_sh__d8 a = *(const isogi_sh__d8 *)from, b = *(const isogi_sh__d8 *)(from + 8), c = *(const isogi_sh__d8 *)(from + 16);
    isogi_sh__d8 x = __builtin_shufflevector(a, b, 0, 3, 6, 9, 12, 15, 0, 0), y = __builtin_shufflevector(a, b, 1, 4, 7, 10, 13, 0, 0, 0);
    isogi_sh__d8 z = __builtin_shufflevector(a, b, 2, 5, 8, 11, 14, 0, 0, 0);
    u[0] = __builtin_shufflevector(x, c, 0, 1, 2, 3, 4, 5, 10, 13);
    u[1] = __builtin_shufflevector(y, c, 0, 1, 2, 3, 4, 8, 11, 14);
    u[2] = __builtin_shufflevector(z, c, 0, 1, 2, 3, 4, 9, 12, 15);
}

/* The same by blends, which more units do than shuffles, and without vectors of indices, whose loads would wait for stores: the lanes are
   directions 0 3 6 1 4 7 2 5. */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_d8_mixed(isogi_sh__d8 *u, const double *from) {
    isogi_sh__d8 a = *(const isogi_sh__d8 *)from, b = *(const isogi_sh__d8 *)(from + 8), c = *(const isogi_sh__d8 *)(from + 16), y, z;
    u[0] = (isogi_sh__d8)ISOGI_SH__BLEND_D8(0x24, ISOGI_SH__BLEND_D8(0x92, a, b), c);
    y = (isogi_sh__d8)ISOGI_SH__BLEND_D8(0x49, ISOGI_SH__BLEND_D8(0x24, a, b), c);
    z = (isogi_sh__d8)ISOGI_SH__BLEND_D8(0x92, ISOGI_SH__BLEND_D8(0x49, a, b), c);
    u[1] = __builtin_shufflevector(y, y, 1, 2, 3, 4, 5, 6, 7, 0);
    u[2] = __builtin_shufflevector(z, z, 2, 3, 4, 5, 6, 7, 0, 1);
}
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_f8_mixed(isogi_sh__f8 *u, const float *from) { isogi_sh__eval_f8_split(u, from); }
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__eval_d4_mixed(isogi_sh__d4 *u, const double *from) { isogi_sh__eval_d4_split(u, from); }
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__eval_f16_mixed(isogi_sh__f16 *u, const float *from) { isogi_sh__eval_f16_split(u, from); }

#define ISOGI_SH__REST_F8(one, z) ISOGI_SH__FMA_F8(-(z), z, one)
#define ISOGI_SH__REST_D4(one, z) ISOGI_SH__FMA_D4(-(z), z, one)
#define ISOGI_SH__REST_F16(one, z) ISOGI_SH__FMA_F16(-(z), z, one)
#define ISOGI_SH__REST_D8(one, z) ISOGI_SH__FMA_D8(-(z), z, one)
#define ISOGI_SH__LESS_F8(a, b) (_mm256_movemask_ps((__m256)((a) < (b))) == 0xff)
#define ISOGI_SH__LESS_D4(a, b) (_mm256_movemask_pd((__m256d)((a) < (b))) == 0xf)
#define ISOGI_SH__LESS_F16(a, b) (_mm512_cmplt_epi32_mask((__m512i)(a), (__m512i)(b)) == 0xffff)
#define ISOGI_SH__LESS_D8(a, b) (_mm512_cmplt_epi64_mask((__m512i)(a), (__m512i)(b)) == 0xff)

/* With fused products: low orders as polynomials in v = cos 2t = z^2 - x^2 - y^2, whose coefficients are small, so that little cancels
   anywhere, and of which no operation waits for the one before (4.7e-7 was seen at order 5 where products are not fused). Function l of
   column m is (c, s) times a polynomial, times z where l - m is odd; t: the polynomials of that column. centre: where Y_l^0 goes. From
   m = 2 on they are in v + 1/4, which is smaller where sin^m t is not. */
#define ISOGI_SH__LOW_ORDER 11
#define ISOGI_SH__PUT_ONE(V, WIDTH)                                                                                            \
    *(V *)centre = p[0];                                                                                                       \
    if (two) *(V *)(centre + WIDTH) = p[1];                                                                                    \
    centre -= step, step -= 2 * stride
#define ISOGI_SH__PUT_PAIR(V, WIDTH)                                                                                           \
    *(V *)(centre + first) = p[0] * c[0], *(V *)(centre - first) = p[0] * s[0];                                                \
    if (two) *(V *)(centre + first + WIDTH) = p[1] * c[1], *(V *)(centre - first + WIDTH) = p[1] * s[1];                       \
    centre -= step, step -= 2 * stride
#define ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, at, degree) NAME##_polynomial(p, v, t + at, degree, two); PUT(V, WIDTH)
#define ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, at, degree)                                                                     \
    NAME##_polynomial(p, v, t + at, degree, two);                                                                              \
    p[0] *= z[0];                                                                                                              \
    if (two) p[1] *= z[1];                                                                                                     \
    PUT(V, WIDTH)
#define ISOGI_SH__POLYNOMIALS(NAME, V, WIDTH, PUT)                                                                             \
    switch (order - m) {                                                                                                       \
    case 11: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 30, 5); __attribute__((fallthrough));                                     \
    case 10: ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, 25, 4); __attribute__((fallthrough));                                      \
    case 9: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 20, 4); __attribute__((fallthrough));                                      \
    case 8: ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, 16, 3); __attribute__((fallthrough));                                       \
    case 7: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 12, 3); __attribute__((fallthrough));                                      \
    case 6: ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, 9, 2); __attribute__((fallthrough));                                        \
    case 5: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 6, 2); __attribute__((fallthrough));                                       \
    case 4: ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, 4, 1); __attribute__((fallthrough));                                        \
    case 3: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 2, 1); __attribute__((fallthrough));                                       \
    case 2: ISOGI_SH__PUT_ODD(NAME, V, WIDTH, PUT, 1, 0); __attribute__((fallthrough));                                        \
    default: ISOGI_SH__PUT_EVEN(NAME, V, WIDTH, PUT, 0, 0);                                                                    \
    }

/* Order 11 by itself, written out in full for sets of 32 registers: loads of constants and sums of addresses take as long there as products
   do, so that two vectors of directions share the former, and all addresses are one of eleven, up or down by m strides. Columns go from
   their first degree; the first six functions are the polynomials of above, each later one follows from those 2 and 4 before. */
#define ISOGI_SH__HIDE(x) __asm__ volatile("" : "+r"(x)) /* what stands in x is not computed anew, nor its constants made ready elsewhere */
#define ISOGI_SH__ROW(l) gap += step, at += gap; if (!fixed) ISOGI_SH__HIDE(at); h.row[l] = at
#define ISOGI_SH__DEFINE_ELEVEN(NAME, TARGET, T, V, I, WIDTH, FMA, LESS, POLYNOMIALS, NEAR_POLE, SQUARE_ERROR, TURN, TILE)     \
    typedef struct NAME##_eleven {                                                                                             \
        V x[2], y[2], z[2], v[2], c[2], s[2], zc[2], zs[2], p[11][2];                                                          \
        char *row[11]; /* of each degree, where Y_l^0 goes */                                                                  \
        T *done;       /* of rows that are turned meanwhile, or NULL */                                                        \
        const V *rows;                                                                                                         \
        ptrdiff_t up, down;                                                                                                    \
        int fixed; /* the stride is known, and addresses are constants */                                                      \
    } NAME##_eleven;                                                                                                           \
    TARGET ISOGI_SH__INLINE void NAME##_put(const NAME##_eleven *h, int l, const V *p, const V *c, const V *s, int two) {      \
        *(V *)(void *)(h->row[l] + h->up) = p[0] * c[0], *(V *)(void *)(h->row[l] + h->down) = p[0] * s[0];                    \
        if (!two) return;                                                                                                      \
        *(V *)(void *)(h->row[l] + h->up + WIDTH * sizeof(T)) = p[1] * c[1];                                                   \
        *(V *)(void *)(h->row[l] + h->down + WIDTH * sizeof(T)) = p[1] * s[1];                                                 \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_term(V *p, const V *v, T term, int two) {                                              \
        V next = NAME##_splat(term);                                                                                           \
        p[0] = FMA(p[0], v[0], next);                                                                                          \
        if (two) p[1] = FMA(p[1], v[1], next);                                                                                 \
    }                                                                                                                          \
    /* degree m + i of column m; t: polynomials of this column, step: factors of its recursion */                              \
    TARGET ISOGI_SH__INLINE void NAME##_function(NAME##_eleven *h, const T *t, const T *step, int m, int i, int two) {         \
        V *p = h->p[i], q[2];                                                                                                  \
        if (m + i > 10) return;                                                                                                \
        if (i < 6) {                                                                                                           \
            t += (i + 1) * (i + 1) / 4;                                                                                        \
            p[0] = p[1] = NAME##_splat(t[0]);                                                                                  \
            if (i > 1) NAME##_term(p, h->v, t[1], two);                                                                        \
            if (i > 3) NAME##_term(p, h->v, t[2], two);                                                                        \
        } else {                                                                                                               \
            V a = NAME##_splat(step[3 * i - 18]), b = NAME##_splat(step[3 * i - 17]), c = NAME##_splat(step[3 * i - 16]);      \
            p[0] = FMA(FMA(h->v[0], a, b), h->p[i - 2][0], c * h->p[i - 4][0]);                                                \
            if (two) p[1] = FMA(FMA(h->v[1], a, b), h->p[i - 2][1], c * h->p[i - 4][1]);                                       \
        }                                                                                                                      \
        if ((i & 1) && m > 0 && m < 8) {                                                                                       \
            NAME##_put(h, m + i, p, h->zc, h->zs, two);                                                                        \
            return;                                                                                                            \
        }                                                                                                                      \
        q[0] = p[0], q[1] = p[1];                                                                                              \
        if (i & 1) q[0] *= h->z[0];                                                                                            \
        if ((i & 1) && two) q[1] *= h->z[1];                                                                                   \
        if (m) {                                                                                                               \
            NAME##_put(h, m + i, q, h->c, h->s, two);                                                                          \
            return;                                                                                                            \
        }                                                                                                                      \
        *(V *)(void *)h->row[i] = q[0];                                                                                        \
        if (two) *(V *)(void *)(h->row[i] + WIDTH * sizeof(T)) = q[1];                                                         \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_ready(NAME##_eleven *h, int m, int k) { /* (x + i y)^m and that times z */             \
        V zero = {0}, before = h->c[k];                                                                                        \
        if (m > 1) h->c[k] = FMA(h->x[k], h->c[k], -(h->y[k] * h->s[k])), h->s[k] = FMA(h->x[k], h->s[k], h->y[k] * before);   \
        if (m == 2) h->v[k] = FMA(h->z[k] + h->z[k], h->z[k], zero - (T)0.75);                                                 \
        if (m < 8) h->zc[k] = h->z[k] * h->c[k], h->zs[k] = h->z[k] * h->s[k];                                                 \
    }                                                                                                                          \
    /* one of eight parts of NAME_turn_all for 121 rows */                                                                     \
    TARGET ISOGI_SH__INLINE void NAME##_part(T *out, const V *rows, int part) {                                                \
        const size_t alone = 121 % TILE == 1;                                                                                  \
        size_t k = alone + 2 * TILE * (size_t)part, j;                                                                         \
        if (!part && alone)                                                                                                    \
            for (j = 0; j < WIDTH; j++) out[121 * j] = ((const T *)rows)[j];                                                   \
        if (k + 2 * TILE <= 121) TURN(out + k, 121, rows + k, 2);                                                              \
        else if (k < 121) {                                                                                                    \
            j = k < 121 - TILE ? k : 121 - TILE;                                                                               \
            TURN(out + j, 121, rows + j, 1);                                                                                   \
            if (k + TILE < 121) TURN(out + 121 - TILE, 121, rows + 121 - TILE, 1);                                             \
        }                                                                                                                      \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_eleventh(NAME##_eleven *h, const T *t, const T *step, ptrdiff_t by, int m, int two) {  \
        if (m) {                                                                                                               \
            ptrdiff_t up = h->up + by, down = h->down - by;                                                                    \
            if (!h->fixed) ISOGI_SH__HIDE(up);                                                                                 \
            if (!h->fixed) ISOGI_SH__HIDE(down);                                                                               \
            h->up = up, h->down = down;                                                                                        \
            NAME##_ready(h, m, 0);                                                                                             \
            if (two) NAME##_ready(h, m, 1);                                                                                    \
        }                                                                                                                      \
        NAME##_function(h, t, step, m, 0, two), NAME##_function(h, t, step, m, 1, two);                                        \
        NAME##_function(h, t, step, m, 2, two), NAME##_function(h, t, step, m, 3, two);                                        \
        NAME##_function(h, t, step, m, 4, two), NAME##_function(h, t, step, m, 5, two);                                        \
        NAME##_function(h, t, step, m, 6, two), NAME##_function(h, t, step, m, 7, two);                                        \
        NAME##_function(h, t, step, m, 8, two), NAME##_function(h, t, step, m, 9, two);                                        \
        NAME##_function(h, t, step, m, 10, two);                                                                               \
        if (h->fixed && h->done && m < 8) NAME##_part(h->done, h->rows, m); /* one takes products, the other stores */         \
    }                                                                                                                          \
    /* done: where `rows` go meanwhile, or NULL */                                                                             \
    TARGET ISOGI_SH__INLINE int NAME##_all_eleven(T *out, size_t stride, const V *u, const V *other, int two, int fixed, T *done, \
                                                  const V *rows) {                                                             \
        NAME##_eleven h;                                                                                                       \
        V r, q, zero = {0};                                                                                                    \
        const T *t = POLYNOMIALS;                                                                                              \
        char *at = (char *)out;                                                                                                \
        ptrdiff_t by = (ptrdiff_t)(stride * sizeof(T)), step, gap = 0;                                                         \
        h.x[0] = h.c[0] = u[0], h.y[0] = h.s[0] = u[1], h.z[0] = u[2], h.up = h.down = 0, h.row[0] = at, h.fixed = fixed;      \
        h.done = done, h.rows = rows;                                                                                          \
        h.x[1] = h.c[1] = other[0], h.y[1] = h.s[1] = other[1], h.z[1] = other[2];                                             \
        r = FMA(h.x[0], h.x[0], h.y[0] * h.y[0]), q = FMA(h.x[1], h.x[1], h.y[1] * h.y[1]);                                    \
        h.v[0] = FMA(h.z[0], h.z[0], -r), h.v[1] = FMA(h.z[1], h.z[1], -q);                                                    \
        if (two) r *= q; /* neither is more than 1 */                                                                          \
        if (!LESS((I)(zero + (T)NEAR_POLE), (I)r)) return 0;                                                                   \
        ISOGI_SH__HIDE(t);                                                                                                     \
        if (!fixed) ISOGI_SH__HIDE(by);                                                                                        \
        step = 2 * by;                                                                                                         \
        ISOGI_SH__ROW(1); ISOGI_SH__ROW(2); ISOGI_SH__ROW(3); ISOGI_SH__ROW(4); ISOGI_SH__ROW(5);                              \
        ISOGI_SH__ROW(6); ISOGI_SH__ROW(7); ISOGI_SH__ROW(8); ISOGI_SH__ROW(9); ISOGI_SH__ROW(10);                             \
        NAME##_eleventh(&h, t + 0, t + 161, by, 0, two);                                                                       \
        NAME##_eleventh(&h, t + 36, t + 176, by, 1, two);                                                                      \
        NAME##_eleventh(&h, t + 66, t + 188, by, 2, two);                                                                      \
        NAME##_eleventh(&h, t + 91, t + 197, by, 3, two);                                                                      \
        NAME##_eleventh(&h, t + 111, t + 203, by, 4, two);                                                                     \
        NAME##_eleventh(&h, t + 127, t + 0, by, 5, two);                                                                       \
        NAME##_eleventh(&h, t + 139, t + 0, by, 6, two);                                                                       \
        NAME##_eleventh(&h, t + 148, t + 0, by, 7, two);                                                                       \
        NAME##_eleventh(&h, t + 154, t + 0, by, 8, two);                                                                       \
        NAME##_eleventh(&h, t + 158, t + 0, by, 9, two);                                                                       \
        NAME##_eleventh(&h, t + 160, t + 0, by, 10, two);                                                                      \
        return 1;                                                                                                              \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART int NAME##_eleven_rows(T *out, const V *u, T *done, const V *rows) {                                \
        return NAME##_all_eleven(out, WIDTH, u, u, 0, 1, done, rows);                                                          \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART int NAME##_eleven_one(T *out, size_t stride, const V *u) {                                          \
        return NAME##_all_eleven(out, stride, u, u, 0, 0, NULL, NULL);                                                         \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART void NAME##_low(T *out, size_t stride, int order, const V *u);                                      \
    /* two vectors with lengths to be corrected by roots, or near a pole; 0 if out of range */                                 \
    TARGET ISOGI_SH__APART int NAME##_eleven_apart(T *out, size_t stride, const T *x, const T *y, const T *z) {                \
        V u[8];                                                                                                                \
        if (!NAME##_load(u, x, y, z) || !NAME##_load(u + 4, x + WIDTH, y + WIDTH, z + WIDTH)) return 0;                        \
        NAME##_low(out, stride, 11, u), NAME##_low(out + WIDTH, stride, 11, u + 4);                                            \
        return 1;                                                                                                              \
    }                                                                                                                          \
    /* two vectors at a time while there are as many: how many directions are done, fewer before lengths out of range */       \
    TARGET ISOGI_SH__APART size_t NAME##_eleven_two(T *out, size_t stride, const T *x, const T *y, const T *z, size_t count) { \
        size_t i;                                                                                                              \
        for (i = 0; i + 2 * WIDTH <= count; i += 2 * WIDTH) {                                                                  \
            V zero = {0}, u[4], other[4], e, f;                                                                                \
            const I sign = (I)(zero - 1) ^ (I)(zero + 1);                                                                      \
            u[0] = *(const V *)(x + i), u[1] = *(const V *)(y + i), u[2] = *(const V *)(z + i);                                \
            other[0] = *(const V *)(x + i + WIDTH), other[1] = *(const V *)(y + i + WIDTH), other[2] = *(const V *)(z + i + WIDTH); \
            e = NAME##_error(u), f = NAME##_error(other);                                                                      \
            if (LESS((I)FMA(e, e, f * f) & ~sign, (I)(zero + (T)SQUARE_ERROR))) { /* NaN of either sign is not less */         \
                NAME##_correct(u, e), NAME##_correct(other, f);                                                                \
                if (NAME##_all_eleven(out + i, stride, u, other, 1, 0, NULL, NULL)) continue;                                  \
            }                                                                                                                  \
            if (!NAME##_eleven_apart(out + i, stride, x + i, y + i, z + i)) break;                                             \
        }                                                                                                                      \
        return i;                                                                                                              \
    }
#define ISOGI_SH__DEFINE_NO_ELEVEN(NAME, TARGET, T, V, I, WIDTH, FMA, LESS, POLYNOMIALS, NEAR_POLE, SQUARE_ERROR, TURN, TILE)  \
    TARGET ISOGI_SH__INLINE int NAME##_eleven_rows(T *out, const V *u, T *done, const V *rows) {                               \
        return (void)out, (void)u, (void)done, (void)rows, 0;                                                                  \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE int NAME##_eleven_one(T *out, size_t stride, const V *u) { return (void)out, (void)stride, (void)u, 0; } \
    TARGET ISOGI_SH__APART size_t NAME##_eleven_two(T *out, size_t stride, const T *x, const T *y, const T *z, size_t count) {  \
        return (void)out, (void)stride, (void)x, (void)y, (void)z, (void)count, (size_t)0;                                     \
    }
#ifdef __OPTIMIZE__
#define ISOGI_SH__DEFINE_WIDE_ELEVEN ISOGI_SH__DEFINE_ELEVEN
#else /* each would be half a megabyte of code, and take 400 KB of stack */
#define ISOGI_SH__DEFINE_WIDE_ELEVEN ISOGI_SH__DEFINE_NO_ELEVEN
#endif

/* Defines NAME(out, stride, order, x, y, z, count): all functions at the first directions, that of index i at out + stride i; WIDTH at a
   time. It returns how many directions are done, and stops before a block whose lengths are out of range. NAME_rows: the same with the
   functions of a direction together. */
#define ISOGI_SH__DEFINE_FUSED(NAME, TARGET, T, V, I, WIDTH, FMA, LESS, POLYNOMIALS, NEAR_POLE, TURN, TILE)                    \
    /* Order 5 with as few multiplications as there are, which is what takes the time here: from squares and their sums, and from \
       functions of lower degree. */                                                                                           \
    TARGET ISOGI_SH__INLINE void NAME##_order5(V *out, const V *u) {                                                           \
        V x = u[0], y = u[1], z = u[2], zero = {0}, yy = y * y, r = FMA(x, x, yy), v = FMA(z, z, -r), twice = yy + yy;         \
        V c = r - twice, s = x * y, f;                                                                                         \
        out[0] = zero + (T)0.28209479177387814;                                                                                \
        out[1] = y * (T)0.48860251190291992;                                                                                   \
        out[2] = z * (T)0.48860251190291992;                                                                                   \
        out[3] = x * (T)0.48860251190291992;                                                                                   \
        s += s;                                                                                                                \
        out[4] = s * (T)0.54627421529603959;                                                                                   \
        f = z * (T)1.0925484305920792;                                                                                         \
        out[5] = f * y;                                                                                                        \
        out[7] = f * x;                                                                                                        \
        out[6] = FMA(v, zero + (T)0.47308734787878, zero + (T)0.15769578262626);                                               \
        out[9] = (y * (T)0.59004358992664352) * (c + c + r);                                                                   \
        out[15] = (x * (T)0.59004358992664352) * (c - twice);                                                                  \
        out[8] = c * (T)0.54627421529603959;                                                                                   \
        f = z * (T)1.4453057213202769;                                                                                         \
        out[10] = f * s;                                                                                                       \
        out[14] = f * c;                                                                                                       \
        f = FMA(v, zero + (T)1.1426144986611644, zero + (T)0.6855686991966986);                                                \
        out[11] = f * y;                                                                                                       \
        out[13] = f * x;                                                                                                       \
        out[12] = z * FMA(v, zero + (T)0.9329408314752885, zero - (T)0.1865881662950577);                                      \
        f = z + z + z;                                                                                                         \
        out[17] = f * out[9];                                                                                                  \
        out[23] = f * out[15];                                                                                                 \
        f = FMA(v, zero + (T)1.6558057175757301, zero + (T)1.18271836969695);                                                  \
        out[18] = f * s;                                                                                                       \
        out[22] = f * c;                                                                                                       \
        f = z * FMA(v, zero + (T)2.341662902450512, zero + (T)0.3345232717786446);                                             \
        out[19] = f * y;                                                                                                       \
        out[21] = f * x;                                                                                                       \
        out[20] = FMA(v, FMA(v, zero + (T)0.9256235355080377, zero + (T)0.26446386728801075), zero - (T)0.343803027474414);    \
        out[16] = (s * c) * (T)1.2516714708983523;                                                                             \
        out[24] = (c - s) * ((c + s) * (T)0.62583573544917614);                                                                \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_polynomial(V *p, const V *v, const T *t, int degree, int two) {                        \
        V next = NAME##_splat(t[0]);                                                                                           \
        int i;                                                                                                                 \
        p[0] = p[1] = next;                                                                                                    \
        ISOGI_SH__UNROLL                                                                                                       \
        for (i = 1; i <= degree; i++) {                                                                                        \
            next = NAME##_splat(t[i]), p[0] = FMA(p[0], v[0], next);                                                           \
            if (two) p[1] = FMA(p[1], v[1], next);                                                                             \
        }                                                                                                                      \
    }                                                                                                                          \
    /* One column after the other, each from its last degree, for one vector of directions or two, whose functions stand       \
       WIDTH apart: two share constants, addresses and jumps. */                                                               \
    TARGET ISOGI_SH__INLINE void NAME##_columns(T *out, size_t stride, int order, const V *u, const V *other, int two) {       \
        V x[2] = {u[0], other[0]}, y[2] = {u[1], other[1]}, z[2] = {u[2], other[2]}, v[2], c[2], s[2], p[2], zero = {0}, before; \
        V r = FMA(x[0], x[0], y[0] * y[0]), q = FMA(x[1], x[1], y[1] * y[1]);                                                  \
        const T *t = POLYNOMIALS;                                                                                              \
        size_t last = (size_t)order - 1, first = 0, step = 2 * stride * last;                                                  \
        T *centre = out + stride * last * (last + 1);                                                                          \
        int m = 0, clear = !LESS((I)(zero + (T)NEAR_POLE), (I)r) || (two && !LESS((I)(zero + (T)NEAR_POLE), (I)q));            \
        v[0] = FMA(z[0], z[0], -r), v[1] = FMA(z[1], z[1], -q);                                                                \
        c[0] = x[0], s[0] = y[0], c[1] = x[1], s[1] = y[1];                                                                    \
        ISOGI_SH__POLYNOMIALS(NAME, V, WIDTH, ISOGI_SH__PUT_ONE)                                                               \
        for (m = 1; m < order; m++) {                                                                                          \
            t += (ISOGI_SH__LOW_ORDER + 2 - m) * (ISOGI_SH__LOW_ORDER + 2 - m) / 4;                                            \
            if (m > 1) {                                                                                                       \
                before = c[0], c[0] = FMA(x[0], c[0], -(y[0] * s[0])), s[0] = FMA(x[0], s[0], y[0] * before);                  \
                if (two) before = c[1], c[1] = FMA(x[1], c[1], -(y[1] * s[1])), s[1] = FMA(x[1], s[1], y[1] * before);         \
            }                                                                                                                  \
            if (m == 2) v[0] = FMA(z[0] + z[0], z[0], zero - (T)0.75), v[1] = FMA(z[1] + z[1], z[1], zero - (T)0.75);          \
            if (clear) c[0] = NAME##_clear(c[0]), s[0] = NAME##_clear(s[0]), c[1] = NAME##_clear(c[1]), s[1] = NAME##_clear(s[1]); \
            first += stride, step = 2 * stride * last, centre = out + stride * last * (last + 1);                              \
            ISOGI_SH__POLYNOMIALS(NAME, V, WIDTH, ISOGI_SH__PUT_PAIR)                                                          \
        }                                                                                                                      \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART void NAME##_low(T *out, size_t stride, int order, const V *u) {                                     \
        if (order < 11 || !NAME##_eleven_one(out, stride, u)) NAME##_columns(out, stride, order, u, u, 0);                     \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART void NAME##_low_rows(T *out, int order, const V *u) {                                               \
        if (order < 11 || !NAME##_eleven_rows(out, u, NULL, NULL)) NAME##_columns(out, WIDTH, order, u, u, 0);                 \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_low_two(T *out, size_t stride, int order, const V *u) {                                \
        NAME##_columns(out, stride, order, u, u + 4, 1);                                                                       \
    }                                                                                                                          \
    /* degrees below SPLIT, and those from it on */                                                                            \
    TARGET static void NAME##_first(T *out, int to, const V *u, V *state) {                                                    \
        NAME##_degrees(out, WIDTH, 0, to, u, to < ISOGI_SH__SPLIT ? NULL : state);                                             \
    }                                                                                                                          \
    TARGET static void NAME##_rest(T *out, int order, const V *u, V *state) {                                                  \
        NAME##_degrees(out, WIDTH, ISOGI_SH__SPLIT, order, u, state);                                                          \
    }                                                                                                                          \
    TARGET ISOGI_SH__INLINE void NAME##_block(T *out, size_t stride, int order, const V *u) {                                  \
        if (order <= ISOGI_SH__LOW_ORDER) NAME##_low(out, stride, order, u);                                                   \
        else NAME##_any(out, stride, order, u);                                                                                \
    }                                                                                                                          \
    /* low orders, two vectors at a time while there are as many */                                                            \
    TARGET ISOGI_SH__APART size_t NAME##_pairs(T *out, size_t stride, int order, const T *x, const T *y, const T *z, size_t count) { \
        V u[8];                                                                                                                \
        size_t i;                                                                                                              \
        for (i = 0; i + 2 * WIDTH <= count; i += 2 * WIDTH) {                                                                  \
            if (!NAME##_load(u, x + i, y + i, z + i) || !NAME##_load(u + 4, x + i + WIDTH, y + i + WIDTH, z + i + WIDTH)) return i; \
            NAME##_low_two(out + i, stride, order, u);                                                                         \
        }                                                                                                                      \
        return i;                                                                                                              \
    }                                                                                                                          \
    /* any order but 5 from direction `begin` on, with the next directions made ready while the values of those before are stored; the \
       last block ends with the last direction, and repeats some */                                                            \
    TARGET ISOGI_SH__APART size_t NAME##_blocks(T *out, size_t stride, int order, const T *x, const T *y, const T *z, size_t count, \
                                                size_t begin) {                                                                \
        V u[2][4];                                                                                                             \
        size_t i, at = 0;                                                                                                      \
        int more, now = 0;                                                                                                     \
        for (i = begin;; i += WIDTH, now = !now) {                                                                             \
            size_t next = i < count - WIDTH ? i : count - WIDTH;                                                               \
            more = i < count && NAME##_load(u[now], x + next, y + next, z + next);                                             \
            if (i > begin) NAME##_block(out + at, stride, order, u[!now]);                                                     \
            if (!more) return i < count ? i : count;                                                                           \
            at = next;                                                                                                         \
        }                                                                                                                      \
    }                                                                                                                          \
    /* order 5, likewise */                                                                                                    \
    TARGET ISOGI_SH__APART size_t NAME##_blocks5(T *out, size_t stride, const T *x, const T *y, const T *z, size_t count) {    \
        V u[4], next[4], basis[25];                                                                                            \
        size_t i, at = 0;                                                                                                      \
        int k, more = 1;                                                                                                       \
        if (!NAME##_load(u, x, y, z)) return 0;                                                                                \
        for (i = WIDTH; more; i += WIDTH) {                                                                                    \
            T *to = out + at;                                                                                                  \
            at = i < count - WIDTH ? i : count - WIDTH, more = i < count;                                                      \
            if (more) more = NAME##_load(next, x + at, y + at, z + at);                                                        \
            NAME##_order5(basis, u);                                                                                           \
            ISOGI_SH__UNROLL25                                                                                                 \
            for (k = 0; k < 25; k++) *(V *)(to + stride * (size_t)k) = basis[k];                                               \
            u[0] = next[0], u[1] = next[1], u[2] = next[2];                                                                    \
        }                                                                                                                      \
        i -= WIDTH;                                                                                                            \
        return i < count ? i : count;                                                                                          \
    }                                                                                                                          \
    TARGET static size_t NAME(T *out, size_t stride, int order, const T *x, const T *y, const T *z, size_t count) {            \
        size_t begin = 0;                                                                                                      \
        if (count < WIDTH) return 0;                                                                                           \
        if (order == 5) return NAME##_blocks5(out, stride, x, y, z, count);                                                    \
        if (order == 11) begin = NAME##_eleven_two(out, stride, x, y, z, count);                                               \
        if (begin == count) return count;                                                                                      \
        if (order <= ISOGI_SH__LOW_ORDER && count >= 2 * WIDTH + begin)                                                        \
            begin += NAME##_pairs(out + begin, stride, order, x + begin, y + begin, z + begin, count - begin);                 \
        return begin < count ? NAME##_blocks(out, stride, order, x, y, z, count, begin) : count;                               \
    }                                                                                                                          \
    /* `count` rows, 9 or more, for as many directions as are lanes: by 8 or TILE, after one alone,                            \
        or the last with some that come again */                                                                               \
    TARGET ISOGI_SH__INLINE void NAME##_turn_all(T *out, size_t n, const V *rows, size_t count) {                              \
        size_t k, at, alone = count % TILE == 1 || count == 9;                                                                 \
        if (alone)                                                                                                             \
            for (k = 0; k < WIDTH; k++) out[n * k] = ((const T *)rows)[k];                                                     \
        if (count <= 16) {                                                                                                     \
            NAME##_turn(out + alone, n, rows + alone);                                                                         \
            if (count == 16) NAME##_turn(out + 8, n, rows + 8);                                                                \
        } else {                                                                                                               \
            for (k = alone; k + 2 * TILE <= count; k += 2 * TILE) TURN(out + k, n, rows + k, 2);                               \
            for (; k < count; k += TILE) at = k < count - TILE ? k : count - TILE, TURN(out + at, n, rows + at, 1);            \
        }                                                                                                                      \
    }                                                                                                                          \
    /* order 5, with the next directions made ready meanwhile */                                                               \
    TARGET static size_t NAME##_rows5(T *out, const T (*direction)[3], size_t count) {                                         \
        V zero = {0}, u[4] = {zero, zero, zero, zero}, next[4] = {zero, zero, zero, zero}, basis[25];                          \
        size_t i, at = 0;                                                                                                      \
        int more;                                                                                                              \
        for (i = 0;; i += WIDTH) {                                                                                             \
            size_t after = i < count - WIDTH ? i : count - WIDTH;                                                              \
            more = i < count;                                                                                                  \
            if (more) {                                                                                                        \
                NAME##_mixed(next, direction[after]);                                                                          \
                more = NAME##_unit(next);                                                                                      \
            }                                                                                                                  \
            if (i) {                                                                                                           \
                T *row = out + 25 * at;                                                                                        \
                NAME##_order5(basis, u);                                                                                       \
                NAME##_turn_first(row, basis);                                                                                 \
                NAME##_turn_mixed(row + 9, basis + 9);                                                                         \
                NAME##_turn_mixed(row + 17, basis + 17);                                                                       \
            }                                                                                                                  \
            if (!more) return i < count ? i : count;                                                                           \
            u[0] = next[0], u[1] = next[1], u[2] = next[2], at = after;                                                        \
        }                                                                                                                      \
    }                                                                                                                          \
    /* order 11 in full vectors: those of the block before are turned into rows meanwhile, some after each column: one takes products, the \
       other stores */                                                                                                         \
    TARGET ISOGI_SH__APART size_t NAME##_rows11(T *out, const T (*direction)[3], size_t count) {                               \
        V rows[2][121] __attribute__((aligned(64))), u[4];                                                                     \
        size_t i, at = 0;                                                                                                      \
        int more, now = 0;                                                                                                     \
        for (i = 0;; i += WIDTH, now = !now) {                                                                                 \
            size_t next = i < count - WIDTH ? i : count - WIDTH;                                                               \
            T *done = i ? out + 121 * at : NULL;                                                                               \
            more = i < count;                                                                                                  \
            if (more) {                                                                                                        \
                NAME##_split(u, direction[next]);                                                                              \
                more = NAME##_unit(u);                                                                                         \
            }                                                                                                                  \
            if (!more || !NAME##_eleven_rows((T *)rows[now], u, done, rows[!now])) {                                           \
                if (done) NAME##_turn_all(done, 121, rows[!now], 121);                                                         \
                if (!more) return i < count ? i : count;                                                                       \
                NAME##_low_rows((T *)rows[now], 11, u);                                                                        \
            }                                                                                                                  \
            at = next;                                                                                                         \
        }                                                                                                                      \
    }                                                                                                                          \
    TARGET ISOGI_SH__APART size_t NAME##_rows_any(T *out, int order, const T (*direction)[3], size_t count) {                  \
        V rows[ISOGI_SH__SPLIT * ISOGI_SH__SPLIT] __attribute__((aligned(64))), state[2 * ISOGI_SH__SPLIT], u[2][4];           \
        size_t i, n = ISOGI_SH_COUNT(order), at = 0;                                                                           \
        int from, to, more, now = 0;                                                                                           \
        for (i = 0;; i += WIDTH, now = !now) {                                                                                 \
            size_t next = i < count - WIDTH ? i : count - WIDTH;                                                               \
            more = i < count;                                                                                                  \
            if (more) {                                                                                                        \
                NAME##_split(u[now], direction[next]);                                                                         \
                more = NAME##_unit(u[now]);                                                                                    \
            }                                                                                                                  \
            for (from = 0; i && from < order; from = to) {                                                                     \
                to = from || order < ISOGI_SH__SPLIT ? order : ISOGI_SH__SPLIT;                                                \
                if (order <= ISOGI_SH__LOW_ORDER) NAME##_low_rows((T *)rows, order, u[!now]);                                  \
                else if (from) NAME##_rest((T *)rows, order, u[!now], state);                                                  \
                else NAME##_first((T *)rows, to, u[!now], state);                                                              \
                NAME##_turn_all(out + n * at + from * from, n, rows, (size_t)(to * to - from * from));                         \
            }                                                                                                                  \
            if (!more) return i < count ? i : count;                                                                           \
            at = next;                                                                                                         \
        }                                                                                                                      \
    }                                                                                                                          \
    TARGET static size_t NAME##_rows(T *out, int order, const T (*direction)[3], size_t count) {                               \
        if (count < WIDTH) return 0;                                                                                           \
        if (order == 5) return NAME##_rows5(out, direction, count);                                                            \
        if (order == 11 && WIDTH * sizeof(T) == 64) return NAME##_rows11(out, direction, count);                               \
        return NAME##_rows_any(out, order, direction, count);                                                                  \
    }

#define ISOGI_SH__DEFINE_F32(NAME, TARGET, V, I, WIDTH, SUFFIX, TURN, TILE, ELEVEN)                                            \
    ISOGI_SH__DEFINE_EVAL(NAME, TARGET, float, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__REST_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, \
                          isogi_sh__columns_f32, 1e-3, 1e-3, 1e-19, sqrtf)                                                     \
    ELEVEN(NAME, TARGET, float, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, isogi_sh__polynomials_f32, 1e-7, \
        1e-6, TURN, TILE)                                                                                                      \
    ISOGI_SH__DEFINE_FUSED(NAME, TARGET, float, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, isogi_sh__polynomials_f32, \
        1e-3, TURN, TILE)
#define ISOGI_SH__DEFINE_F64(NAME, TARGET, V, I, WIDTH, SUFFIX, TURN, TILE, ELEVEN)                                            \
    ISOGI_SH__DEFINE_EVAL(NAME, TARGET, double, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__REST_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, \
                          isogi_sh__columns_f64, 1e-6, 1e-25, 1e-200, sqrt)                                                    \
    ELEVEN(NAME, TARGET, double, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, isogi_sh__polynomials_f64, 1e-25, \
        1e-12, TURN, TILE)                                                                                                     \
    ISOGI_SH__DEFINE_FUSED(NAME, TARGET, double, V, I, WIDTH, ISOGI_SH__FMA_##SUFFIX, ISOGI_SH__LESS_##SUFFIX, isogi_sh__polynomials_f64, \
        1e-25, TURN, TILE)
ISOGI_SH__DEFINE_F32(isogi_sh__eval_f8, ISOGI_SH__AVX2, isogi_sh__f8, isogi_sh__i8, 8, F8, isogi_sh__transpose_f8, 8,
                     ISOGI_SH__DEFINE_NO_ELEVEN)
ISOGI_SH__DEFINE_F64(isogi_sh__eval_d4, ISOGI_SH__AVX2, isogi_sh__d4, isogi_sh__l4, 4, D4, isogi_sh__transpose_d4, 8,
                     ISOGI_SH__DEFINE_NO_ELEVEN)
ISOGI_SH__DEFINE_F32(isogi_sh__eval_f16, ISOGI_SH__AVX512, isogi_sh__f16, isogi_sh__i16, 16, F16, isogi_sh__transpose_f16, 16,
                     ISOGI_SH__DEFINE_WIDE_ELEVEN)
ISOGI_SH__DEFINE_F64(isogi_sh__eval_d8, ISOGI_SH__AVX512, isogi_sh__d8, isogi_sh__l8, 8, D8, isogi_sh__transpose_d8, 8,
                     ISOGI_SH__DEFINE_WIDE_ELEVEN)

/* 8 single-channel sums */
ISOGI_SH__AVX2 static int isogi_sh__sum_rows_f32(float *value, const float *c, int order, int channels, const float (*direction)[3]) {
    isogi_sh__f8 scratch[ISOGI_SH__TABLE_ORDER * ISOGI_SH__TABLE_ORDER];
    isogi_sh__f8 u[4];
    int i, j, n = order * order;
    size_t k;
    isogi_sh__eval_f8_split(u, direction[0]);
    if (!isogi_sh__eval_f8_unit(u)) return 0;
    if (order == 5) isogi_sh__eval_f8_order5(scratch, u);
    else isogi_sh__eval_f8_block((float *)scratch, 8, order, u);
    for (j = 0; j < channels; j++) {
        isogi_sh__f8 zero = {0}, even = zero, odd = zero;
        for (i = 0; i + 1 < n; i += 2) {
            even = ISOGI_SH__ADD_F8(scratch[i], c[channels * i + j], even);
            odd = ISOGI_SH__ADD_F8(scratch[i + 1], c[channels * (i + 1) + j], odd);
        }
        if (i < n) even += scratch[i] * c[channels * i + j];
        even += odd;
        for (k = 0; k < 8; k++) value[(size_t)channels * k + (size_t)j] = even[k];
    }
    return 1;
}
#endif

#ifdef ISOGI_SH__VECTORS
/* Batches at the best level: how many of the first directions are done. */
static size_t isogi_sh__eval_rows_f32(float *y, int order, const float (*direction)[3], size_t count) {
    size_t done = 0, n = ISOGI_SH_COUNT(order);
    int level = 0;
    if (order < 3 || order > ISOGI_SH__TABLE_ORDER || count < 4) return 0;
#ifdef ISOGI_SH__SIMD
    level = isogi_sh__level();
    if (level > 1) done = isogi_sh__eval_f16_rows(y, order, direction, count);
    if (level && done < count) done += isogi_sh__eval_f8_rows(y + n * done, order, direction + done, count - done);
#endif
    if (!level) done = isogi_sh__eval_f4_rows(y + n * done, order, direction + done, count);
    return done;
}

/* The same for structures of arrays, whose functions stand `stride` apart. */
ISOGI_SH__INLINE size_t isogi_sh__eval_columns_f32(float *out, size_t stride, int order, const float *x, const float *y, const float *z,
                                         size_t count) {
    size_t done = 0;
    int level = 0;
    if (order < 3 || order > ISOGI_SH__TABLE_ORDER || count < 4) return 0;
#ifdef ISOGI_SH__SIMD
    level = isogi_sh__level();
    if (level > 1) {
        if (order == 11 && count % 32 == 0) done = isogi_sh__eval_f16_eleven_two(out, stride, x, y, z, count); /* a call less */
        if (done < count) done += isogi_sh__eval_f16(out + done, stride, order, x + done, y + done, z + done, count - done);
    }
    if (level && done < count) done += isogi_sh__eval_f8(out + done, stride, order, x + done, y + done, z + done, count - done);
#endif
    if (!level) done = isogi_sh__eval_f4(out + done, stride, order, x, y, z, count);
    return done;
}
#endif
#ifdef ISOGI_SH__SIMD
static size_t isogi_sh__eval_rows_f64(double *y, int order, const double (*direction)[3], size_t count) {
    size_t done = 0, n = ISOGI_SH_COUNT(order);
    int level = order >= 3 && order <= ISOGI_SH__TABLE_ORDER && count >= 4 ? isogi_sh__level() : 0;
    if (level > 1) done = isogi_sh__eval_d8_rows(y, order, direction, count);
    if (level && done < count) done += isogi_sh__eval_d4_rows(y + n * done, order, direction + done, count - done);
    return done;
}

static size_t isogi_sh__eval_columns_f64(double *out, size_t stride, int order, const double *x, const double *y, const double *z,
                                         size_t count) {
    size_t done = 0;
    int level = order >= 3 && order <= ISOGI_SH__TABLE_ORDER && count >= 4 ? isogi_sh__level() : 0;
    if (level > 1) done = isogi_sh__eval_d8(out, stride, order, x, y, z, count);
    if (level && done < count) done += isogi_sh__eval_d4(out + done, stride, order, x + done, y + done, z + done, count - done);
    return done;
}
#endif

/* Directions too few for a batch, whose coordinates stand `step` apart: as many as one vector holds, in whose other lanes the first one
   stands again. Y_i of direction k goes to out[index i + each k]. How many are done, 0: they are not for vector units. */
#ifdef ISOGI_SH__VECTORS
ISOGI_SH__APART size_t isogi_sh__eval_few_f32(float *out, size_t index, size_t each, int order, const float *x, const float *y,
                                              const float *z, size_t step, size_t count) {
    float lane[3][8], rows[8 * ISOGI_SH__TABLE_ORDER * ISOGI_SH__TABLE_ORDER];
    size_t i, k, lanes = 4, done;
    if (order < 3 || order > ISOGI_SH__TABLE_ORDER || !count) return 0;
#ifdef ISOGI_SH__SIMD
    if (isogi_sh__level()) lanes = 8;
#endif
    for (k = 0; k < lanes; k++) {
        size_t at = k < count ? k * step : 0;
        lane[0][k] = x[at], lane[1][k] = y[at], lane[2][k] = z[at];
    }
#ifdef ISOGI_SH__SIMD
    if (lanes == 8) done = isogi_sh__eval_f8(rows, 8, order, lane[0], lane[1], lane[2], 8);
    else
#endif
        done = isogi_sh__eval_f4(rows, 4, order, lane[0], lane[1], lane[2], 4);
    done = done < count ? done : count;
    for (k = 0; k < done; k++)
        for (i = 0; i < ISOGI_SH_COUNT(order); i++) out[index * i + each * k] = rows[lanes * i + k];
    return done;
}
#endif
#ifdef ISOGI_SH__SIMD
ISOGI_SH__APART size_t isogi_sh__eval_few_f64(double *out, size_t index, size_t each, int order, const double *x, const double *y,
                                              const double *z, size_t step, size_t count) {
    double lane[3][4], rows[4 * ISOGI_SH__TABLE_ORDER * ISOGI_SH__TABLE_ORDER];
    size_t i, k, done;
    if (order < 3 || order > ISOGI_SH__TABLE_ORDER || !count || !isogi_sh__level()) return 0;
    for (k = 0; k < 4; k++) {
        size_t at = k < count ? k * step : 0;
        lane[0][k] = x[at], lane[1][k] = y[at], lane[2][k] = z[at];
    }
    done = isogi_sh__eval_d4(rows, 4, order, lane[0], lane[1], lane[2], 4);
    done = done < count ? done : count;
    for (k = 0; k < done; k++)
        for (i = 0; i < ISOGI_SH_COUNT(order); i++) out[index * i + each * k] = rows[4 * i + k];
    return done;
}
#endif

/* count * order^2 elements of `size` bytes are addressable; it takes no division where they are at the highest order */
ISOGI_SH__INLINE int isogi_sh__fits(size_t count, int order, size_t size) {
    return count <= (size_t)-1 / 2 / size / ISOGI_SH_COUNT(ISOGI_SH_MAX_ORDER) || count <= (size_t)-1 / 2 / size / ISOGI_SH_COUNT(order);
}

/* count directions, and as many values of every channel, of `size` bytes a number are */
ISOGI_SH__INLINE int isogi_sh__samples_fit(size_t count, int channels, size_t size) {
    return count <= (size_t)-1 / 2 / size / 16 || count <= (size_t)-1 / 2 / size / (size_t)(channels > 3 ? channels : 3);
}

/* Where neither a single direction nor a batch will do. */
ISOGI_SH__APART void isogi_sh__eval_f32(float *y, int order, const float (*direction)[3], size_t count) {
    isogi_sh__output out = {NULL, 0, 1, 0};
    size_t i = 0, k, lanes, n = ISOGI_SH_COUNT(order);
    out.data = y;
    out.direction_stride = n;
    for (; i < count; i += lanes) {
        isogi_sh__unit u[ISOGI_SH__LANES];
        const float *d = direction[i];
#ifdef ISOGI_SH__VECTORS
        lanes = isogi_sh__eval_rows_f32(y + i * n, order, direction + i, count - i);
        if (!lanes) lanes = isogi_sh__eval_few_f32(y + i * n, 1, n, order, d, d + 1, d + 2, 3, count - i);
        if (lanes) continue;
#endif
        lanes = 1;
        if (order <= ISOGI_SH__UNROLLED_ORDER) isogi_sh__eval_low_f32(y + i * n, order, d);
        else {
            for (; i + lanes < count && lanes < ISOGI_SH__LANES; lanes++) {}
            for (k = 0; k < lanes; k++, d += 3) u[k] = isogi_sh__normalise((double)d[0], (double)d[1], (double)d[2]);
            isogi_sh__eval_block(&out, i, (int)lanes, order, u);
        }
    }
}

ISOGI_API isogi_result isogi_sh_eval(float *y, int order, const float (*direction)[3], size_t count) {
    if (!isogi_sh__order_ok(order) || (count && (!y || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *y)) return ISOGI_TOO_LARGE;
    if (count != 1 || order > ISOGI_SH__UNROLLED_ORDER) isogi_sh__eval_f32(y, order, direction, count);
    else isogi_sh__eval_low_f32(y, order, direction[0]);
    return ISOGI_OK;
}

/* Where neither a single direction nor a batch will do. */
ISOGI_SH__APART void isogi_sh__eval_f64(double *y, int order, const double (*direction)[3], size_t count) {
    isogi_sh__output out = {NULL, 0, 1, 1};
    size_t i = 0, k, lanes, n = ISOGI_SH_COUNT(order);
    out.data = y;
    out.direction_stride = n;
    for (; i < count; i += lanes) {
        isogi_sh__unit u[ISOGI_SH__LANES];
        const double *d = direction[i];
#ifdef ISOGI_SH__SIMD
        lanes = isogi_sh__eval_rows_f64(y + i * n, order, direction + i, count - i);
        if (!lanes) lanes = isogi_sh__eval_few_f64(y + i * n, 1, n, order, d, d + 1, d + 2, 3, count - i);
        if (lanes) continue;
#endif
        lanes = 1;
        if (order <= ISOGI_SH__UNROLLED_ORDER) isogi_sh__eval_low_f64(y + i * n, order, d);
        else {
            for (; i + lanes < count && lanes < ISOGI_SH__LANES; lanes++) {}
            for (k = 0; k < lanes; k++, d += 3) u[k] = isogi_sh__normalise(d[0], d[1], d[2]);
            isogi_sh__eval_block(&out, i, (int)lanes, order, u);
        }
    }
}

ISOGI_API isogi_result isogi_sh_eval_f64(double *y, int order, const double (*direction)[3], size_t count) {
    if (!isogi_sh__order_ok(order) || (count && (!y || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *y)) return ISOGI_TOO_LARGE;
    if (count != 1 || order > ISOGI_SH__UNROLLED_ORDER) isogi_sh__eval_f64(y, order, direction, count);
    else isogi_sh__eval_low_f64(y, order, direction[0]);
    return ISOGI_OK;
}

/* directions from i on, where no batch begins */
ISOGI_SH__APART isogi_result isogi_sh__eval_soa(void *basis, int is_double, int order, const void *x, const void *y, const void *z,
                                                size_t i, size_t count) {
    isogi_sh__output out = {NULL, 1, 0, 0};
    out.data = basis;
    out.index_stride = count;
    out.is_double = is_double;
    while (i < count) {
        const float *x32 = (const float *)x + i, *y32 = (const float *)y + i, *z32 = (const float *)z + i;
        const double *x64 = (const double *)x + i, *y64 = (const double *)y + i, *z64 = (const double *)z + i;
        isogi_sh__unit u[ISOGI_SH__LANES];
        size_t few = 0;
        int k, lanes = count - i < ISOGI_SH__LANES ? (int)(count - i) : ISOGI_SH__LANES;
#ifdef ISOGI_SH__VECTORS
        if (!is_double) {
            few = isogi_sh__eval_columns_f32((float *)basis + i, count, order, x32, y32, z32, count - i);
            if (!few) few = isogi_sh__eval_few_f32((float *)basis + i, count, 1, order, x32, y32, z32, 1, count - i);
        }
#endif
#ifdef ISOGI_SH__SIMD
        if (is_double) {
            few = isogi_sh__eval_columns_f64((double *)basis + i, count, order, x64, y64, z64, count - i);
            if (!few) few = isogi_sh__eval_few_f64((double *)basis + i, count, 1, order, x64, y64, z64, 1, count - i);
        }
#endif
        i += few;
        if (few) continue;
        for (k = 0; k < lanes; k++)
            if (is_double) u[k] = isogi_sh__normalise(x64[k], y64[k], z64[k]);
            else u[k] = isogi_sh__normalise((double)x32[k], (double)y32[k], (double)z32[k]);
        isogi_sh__eval_block(&out, i, lanes, order, u);
        i += (size_t)lanes;
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_eval_soa(float *basis, int order, const float *x, const float *y, const float *z, size_t count) {
    size_t done = 0;
    if (!isogi_sh__order_ok(order) || (count && (!basis || !x || !y || !z))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *basis)) return ISOGI_TOO_LARGE;
#ifdef ISOGI_SH__VECTORS
    done = isogi_sh__eval_columns_f32(basis, count, order, x, y, z, count);
#endif
    return done < count ? isogi_sh__eval_soa(basis, 0, order, x, y, z, done, count) : ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_eval_soa_f64(double *basis, int order, const double *x, const double *y, const double *z, size_t count) {
    size_t done = 0;
    if (!isogi_sh__order_ok(order) || (count && (!basis || !x || !y || !z))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *basis)) return ISOGI_TOO_LARGE;
#ifdef ISOGI_SH__SIMD
    done = isogi_sh__eval_columns_f64(basis, count, order, x, y, z, count);
#endif
    return done < count ? isogi_sh__eval_soa(basis, 1, order, x, y, z, done, count) : ISOGI_OK;
}

/* ==== gradients ====================================================================================================== */

ISOGI_SH__INLINE void isogi_sh__put_gradient(void *out, int is_double, size_t at, isogi_sh__unit u, double x, double y, double z) {
    double radial = x * u.x + y * u.y + z * u.z;
    x -= radial * u.x, y -= radial * u.y, z -= radial * u.z;
    if (is_double) {
        double *g = (double *)out + 3 * at;
        g[0] = x, g[1] = y, g[2] = z;
    } else {
        float *g = (float *)out + 3 * at;
        g[0] = (float)x, g[1] = (float)y, g[2] = (float)z;
    }
}

/* Terms +-m of degree l, from q_l^m and dq_l^m, m-th powers of x + i y and those before */
ISOGI_SH__INLINE void isogi_sh__put_gradients(void *out, int is_double, size_t centre, int m, isogi_sh__unit u, double mq, double dq,
                                              const double now[2], const double before[2]) {
    size_t away = (size_t)m;
    isogi_sh__put_gradient(out, is_double, centre + away, u, mq * before[0], -mq * before[1], dq * now[0]);
    if (m) isogi_sh__put_gradient(out, is_double, centre - away, u, mq * before[1], mq * before[0], dq * now[1]);
}

/* q(z) c_m(x, y) is a polynomial, whose gradient loses its radial part: dq_l^m / dz = sqrt((l-m)(l+m+1)) q_l^{m+1}, and the
   derivatives of (x + i y)^m are m (x + i y)^{m-1} (1, i). Nothing is singular at the poles. */
ISOGI_SH__INLINE void isogi_sh__gradient(void *out, int is_double, size_t first, int order, isogi_sh__unit u) {
    double column[2][ISOGI_SH_MAX_ORDER + 1], power[2][2] = {{1, 0}, {1, 0}}, diagonal = isogi_sh__next_diagonal(0, 0);
    int l, m;
    isogi_sh__column(column[0], order, 0, diagonal, u.z, u.z_low);
    for (m = 0; m < order; m++) {
        const double *q = column[m & 1], *next = column[(m + 1) & 1], *now = power[m & 1];
        double *other = power[(m + 1) & 1];
        diagonal = isogi_sh__next_diagonal(diagonal, m + 1);
        if (m + 1 < order) isogi_sh__column(column[(m + 1) & 1], order, m + 1, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            double dq = l > m ? sqrt((double)((l - m) * (l + m + 1)) * (m ? 1 : 0.5)) * next[l] : 0;
            isogi_sh__put_gradients(out, is_double, first + (size_t)(l * (l + 1)), m, u, (double)m * q[l], dq, now, other);
        }
        other[0] = u.x * now[0] - u.y * now[1], other[1] = u.x * now[1] + u.y * now[0];
    }
}

/* The same degree by degree for low orders, where all roots are constants; recursions as in isogi_sh__eval_low. */
ISOGI_SH__INLINE void isogi_sh__gradient_low(void *out, int is_double, size_t first, int order, isogi_sh__unit u) {
    const double *table = isogi_sh__table_f64;
    double q[ISOGI_SH__UNROLLED_ORDER], before[ISOGI_SH__UNROLLED_ORDER], power[ISOGI_SH__UNROLLED_ORDER][2];
    double p = 1, difference = 0, sign = u.z < 0 ? -1 : 1, t = u.z < 0 ? (1 + u.z) + u.z_low : (1 - u.z) - u.z_low;
    int l, m;
    power[0][0] = 1, power[0][1] = 0;
    isogi_sh__put_gradients(out, is_double, first, 0, u, 0, 0, power[0], power[0]);
    ISOGI_SH__UNROLL
    for (l = 1; l < ISOGI_SH__UNROLLED_ORDER; l++) {
        if (l >= order) return;
        difference = table[3 * l] * difference + table[3 * l + 1] * t * p;
        p += difference;
        q[0] = table[3 * l + 2] * (l & 1 ? sign * p : p);
        power[l][0] = u.x * power[l - 1][0] - u.y * power[l - 1][1], power[l][1] = u.x * power[l - 1][1] + u.y * power[l - 1][0];
        ISOGI_SH__UNROLL
        for (m = 1; m <= l; m++) {
            const double *pair = table + 3 * ISOGI_SH__TABLE_ORDER + (m - 1) * (2 * ISOGI_SH__TABLE_ORDER - 1 - m) + 2 * (l - m) - 1;
            if (m < l) {
                double last = q[m];
                q[m] = pair[0] * (u.z * last + u.z_low * last) + pair[1] * before[m], before[m] = last;
            } else q[m] = pair[1], before[m] = 0;
        }
        ISOGI_SH__UNROLL
        for (m = 0; m <= l; m++)
            isogi_sh__put_gradients(out, is_double, first + (size_t)(l * (l + 1)), m, u, m * q[m],
                                    m < l ? sqrt((l - m) * (l + m + 1) * (m ? 1 : 0.5)) * q[m + 1] : 0, power[m], power[m ? m - 1 : 0]);
    }
}

ISOGI_API isogi_result isogi_sh_eval_gradient(float (*gradient)[3], int order, const float (*direction)[3], size_t count) {
    size_t i;
    if (!isogi_sh__order_ok(order) || (count && (!gradient || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *gradient)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i++) {
        const float *d = direction[i];
        size_t first = i * ISOGI_SH_COUNT(order);
        if (order <= ISOGI_SH__UNROLLED_ORDER) isogi_sh__gradient_low(gradient, 0, first, order, isogi_sh__normalise_f32(d));
        else isogi_sh__gradient(gradient, 0, first, order, isogi_sh__normalise((double)d[0], (double)d[1], (double)d[2]));
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_eval_gradient_f64(double (*gradient)[3], int order, const double (*direction)[3], size_t count) {
    size_t i;
    if (!isogi_sh__order_ok(order) || (count && (!gradient || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *gradient)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i++) {
        isogi_sh__unit u = isogi_sh__normalise(direction[i][0], direction[i][1], direction[i][2]);
        if (order <= ISOGI_SH__UNROLLED_ORDER) isogi_sh__gradient_low(gradient, 1, i * ISOGI_SH_COUNT(order), order, u);
        else isogi_sh__gradient(gradient, 1, i * ISOGI_SH_COUNT(order), order, u);
    }
    return ISOGI_OK;
}

/* ==== sums and zonal lobes =========================================================================================== */

/* value[k] = sum over i of c[channels i + k] y[i], for three channels */
ISOGI_SH__INLINE void isogi_sh__three_products(double *value, const double *y, const void *c, int is_double, int count) {
    double a = 0, b = 0, d = 0;
    int i;
    for (i = 0; i < count; i++, y++) {
        a += isogi_sh__get(c, is_double, 3 * i) * *y;
        b += isogi_sh__get(c, is_double, 3 * i + 1) * *y;
        d += isogi_sh__get(c, is_double, 3 * i + 2) * *y;
    }
    value[0] = a, value[1] = b, value[2] = d;
}

/* The same for any channels. */
static void isogi_sh__products(double *value, const double *y, const void *c, int is_double, int count, int channels) {
    int i, k;
    if (channels == 3 && is_double) isogi_sh__three_products(value, y, c, 1, count);
    else if (channels == 3) isogi_sh__three_products(value, y, c, 0, count);
    else
        for (k = 0; k < channels; k++) {
            double sum = 0;
            for (i = 0; i < count; i++) sum += isogi_sh__get(c, is_double, channels * i + k) * y[i];
            value[k] = sum;
        }
}

/* value[channel] = sum over i of c[channels i + channel] Y_i(u), channels <= ISOGI_SH__CHANNELS */
static void isogi_sh__sum(double *value, const void *c, int is_double, int order, int channels, isogi_sh__unit u) {
    double q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, x;
    int l, m, k;
    if (order <= ISOGI_SH__UNROLLED_ORDER) {
        double y[ISOGI_SH__UNROLLED_ORDER * ISOGI_SH__UNROLLED_ORDER];
        isogi_sh__eval_low(y, order, u, 1);
        isogi_sh__products(value, y, c, is_double, order * order, channels);
        return;
    }
    for (k = 0; k < channels; k++) value[k] = 0;
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            int plus = channels * (l * (l + 1) + m), minus = channels * (l * (l + 1) - m);
            for (k = 0; k < channels; k++) {
                double a = isogi_sh__get(c, is_double, plus + k), b = isogi_sh__get(c, is_double, minus + k);
                value[k] += q[l] * (cm * a + sm * b);
            }
        }
        x = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = x;
    }
}

/* Of up to 4 directions; vector units evaluate all functions of low orders first. */
#define ISOGI_SH__SUMS 4
static void isogi_sh__sums(double *value, const void *c, int is_double, int order, int channels, const double (*direction)[3],
                           size_t count) {
    size_t k;
#ifdef ISOGI_SH__SIMD
    double y[ISOGI_SH__SUMS * ISOGI_SH__LOW_ORDER * ISOGI_SH__LOW_ORDER];
    size_t n = ISOGI_SH_COUNT(order);
    int least = count < ISOGI_SH__SUMS ? ISOGI_SH__UNROLLED_ORDER + 1 : 3;
    if (order >= least && order <= ISOGI_SH__LOW_ORDER && isogi_sh__level()) {
        isogi_sh__eval_f64(y, order, direction, count);
        for (k = 0; k < count; k++)
            isogi_sh__products(value + k * (size_t)channels, y + k * n, c, is_double, order * order, channels);
        return;
    }
#endif
    for (k = 0; k < count; k++)
        isogi_sh__sum(value + k * (size_t)channels, c, is_double, order, channels,
                      isogi_sh__normalise(direction[k][0], direction[k][1], direction[k][2]));
}

ISOGI_API isogi_result isogi_sh_eval_sum(float *value, const float *c, int order, int channels, const float (*direction)[3], size_t count) {
    double sum[ISOGI_SH__SUMS * ISOGI_SH__CHANNELS], wide[ISOGI_SH__SUMS][3];
    size_t i, k, some;
#ifdef ISOGI_SH__SIMD
    int level = order >= 3 && order <= ISOGI_SH__TABLE_ORDER && count >= 8 ? isogi_sh__level() : 0;
#endif
    if (!isogi_sh__shape_ok(order, channels) || !c || (count && (!value || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__samples_fit(count, channels, sizeof *value)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i += some) {
#ifdef ISOGI_SH__SIMD
        some = 8;
        if (level && count - i >= some && isogi_sh__sum_rows_f32(value + i * (size_t)channels, c, order, channels, direction + i)) continue;
#endif
        some = count - i < ISOGI_SH__SUMS ? count - i : ISOGI_SH__SUMS;
        for (k = 0; k < 3 * some; k++) wide[k / 3][k % 3] = (double)direction[i + k / 3][k % 3];
        isogi_sh__sums(sum, c, 0, order, channels, (const double(*)[3])wide, some);
        for (k = 0; k < some * (size_t)channels; k++) value[i * (size_t)channels + k] = (float)sum[k];
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_eval_sum_f64(double *value, const double *c, int order, int channels, const double (*direction)[3],
                                             size_t count) {
    size_t i, some;
    if (!isogi_sh__shape_ok(order, channels) || !c || (count && (!value || !direction))) return ISOGI_INVALID;
    if (!isogi_sh__samples_fit(count, channels, sizeof *value)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i += some) {
        some = count - i < ISOGI_SH__SUMS ? count - i : ISOGI_SH__SUMS;
        isogi_sh__sums(value + i * (size_t)channels, c, 1, order, channels, direction + i, some);
    }
    return ISOGI_OK;
}

/* c += colour sum over l of scale[l] Y_lm(u): a lobe around u */
ISOGI_SH__INLINE void isogi_sh__add_lobe(float *c, int order, int channels, const double *scale, isogi_sh__unit u, const double *colour) {
    double q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, x;
    int l, m, k;
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            float *plus = c + channels * (l * (l + 1) + m), *minus = c + channels * (l * (l + 1) - m);
            double cosine = scale[l] * q[l] * cm, sine = scale[l] * q[l] * sm; /* 0 where m is */
            /* cppcheck-suppress objectIndex */
            for (k = 0; k < channels; k++) plus[k] += (float)(colour[k] * cosine);
            /* cppcheck-suppress objectIndex */
            for (k = 0; k < channels; k++) minus[k] += (float)(colour[k] * sine);
        }
        x = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = x;
    }
}

static void isogi_sh__add_rgb_lobe(float *c, int order, const double *scale, isogi_sh__unit u, const double *rgb) {
    isogi_sh__add_lobe(c, order, 3, scale, u, rgb);
}

/* Zonal factors of a disc of angular radius a (cos a given) and irradiance 1 on a surface that faces it: radiance 1 / (pi sin^2 a).
   From the integral of P_l over [cos a, 1] = sin^2 a P_l'(cos a) / (l (l+1)): no cancellation however small the disc; cos a = 1 is
   the mathematical direction, whose factors are all 1. */
static void isogi_sh__disc(double *scale, int order, double cosine) {
    double before = 0, derivative = 1; /* P_{l-1}', P_l' */
    int l;
    if (cosine >= 1) {
        for (l = 0; l < order; l++) scale[l] = 1;
        return;
    }
    scale[0] = cosine > -1 ? 2 / (1 + cosine) : 0;
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

/* 1 / sqrt(square) for a square within 0.01 of 1, by its series: full precision where the matrix has it, and no root to wait for. */
static double isogi_sh__inverse_near_one(double square) {
    double d = square - 1;
    return 1 - d * (0.5 - d * (0.375 - d * (0.3125 - d * (0.2734375 - d * 0.24609375))));
}

/* ISOGI_INVALID unless m is finite and a rotation to 1e-3. An entry that is not finite shows in the sum of the squares. */
static isogi_result isogi_sh__euler_angles(isogi_sh__euler *e, const double m[9]) {
    double xx = m[0] * m[0] + m[1] * m[1] + m[2] * m[2], yy = m[3] * m[3] + m[4] * m[4] + m[5] * m[5];
    double zz = m[6] * m[6] + m[7] * m[7] + m[8] * m[8], xy = m[0] * m[3] + m[1] * m[4] + m[2] * m[5];
    double xz = m[0] * m[6] + m[1] * m[7] + m[2] * m[8], yz = m[3] * m[6] + m[4] * m[7] + m[5] * m[8];
    double det = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
    double square, sine, inverse;
    if (!isogi_sh__finite_f64(xx + yy + zz)) return ISOGI_INVALID;
    if (fabs(xx - 1) > 1e-3 || fabs(yy - 1) > 1e-3 || fabs(zz - 1) > 1e-3) return ISOGI_INVALID;
    if (fabs(xy) > 1e-3 || fabs(xz) > 1e-3 || fabs(yz) > 1e-3 || det < 0) return ISOGI_INVALID;
    square = m[2] * m[2] + m[5] * m[5];
    sine = sqrt(square);
    inverse = isogi_sh__inverse_near_one(square + m[8] * m[8]);
    e->b[0] = m[8] * inverse;
    e->b[1] = sine * inverse;
    inverse = square > 1e-280 ? 1 / sine : 0; /* below, roundings of the square would show, and a is free */
    e->a[0] = square > 1e-280 ? m[2] * inverse : 1;
    e->a[1] = m[5] * inverse;
    /* Given a, the second row of Z(-a) R is (sin c, cos c, 0): well defined however small b is. */
    e->c[0] = e->a[0] * m[4] - e->a[1] * m[1];
    e->c[1] = e->a[0] * m[3] - e->a[1] * m[0];
    inverse = isogi_sh__inverse_near_one(e->c[0] * e->c[0] + e->c[1] * e->c[1]);
    e->c[0] *= inverse;
    e->c[1] *= inverse;
    return ISOGI_OK;
}

/* power[m] = (cosine, sine) of m times the angle. Halving keeps the error of the angle small; the length, whose error would grow
   with m and show as a rotation that is not orthogonal, is set to 1 again at each step. */
static void isogi_sh__powers(double (*power)[2], int order, double cosine, double sine) {
    int m;
    power[0][0] = 1, power[0][1] = 0;
    for (m = 1; m < order; m++) {
        const double *p = power[m / 2], *q = power[m - m / 2];
        double c = m > 1 ? p[0] * q[0] - p[1] * q[1] : cosine, s = m > 1 ? p[0] * q[1] + p[1] * q[0] : sine;
        double correction = 0.5 * (1 - (c * c + s * s));
        power[m][0] = c + correction * c;
        power[m][1] = s + correction * s;
    }
}

/* A band holds a few channels interleaved, so that what is computed per coefficient serves all of them. */
ISOGI_SH__INLINE void isogi_sh__turn_z(double *band, int l, int channels, double (*power)[2]) {
    int m, k;
    ISOGI_SH__UNROLL
    for (m = 1; m <= l; m++) {
        double *plus = band + channels * (l + m), *minus = band + channels * (l - m);
        for (k = 0; k < channels; k++) {
            double p = plus[k], q = minus[k];
            plus[k] = p * power[m][0] - q * power[m][1];
            minus[k] = p * power[m][1] + q * power[m][0];
        }
    }
}

/* What quarter turns of degree l need: edge[m] = d_{m,l}(pi/2) without its sign = 2^-l sqrt(binomial(2l, l+m)), and of the recursion,
   with step_m = sqrt((l-m)(l+m+1)), gain[m] = 2 / step_{m-1} and ratio[m] = step_m / step_{m-1}. */
typedef struct isogi_sh__quarter_turn {
    double edge[ISOGI_SH_MAX_ORDER], gain[ISOGI_SH_MAX_ORDER], ratio[ISOGI_SH_MAX_ORDER];
} isogi_sh__quarter_turn;

static void isogi_sh__quarter_turn_start(isogi_sh__quarter_turn *t, int l) {
    double square = 1, inverse = 0;
    int m;
    t->gain[0] = t->ratio[0] = 0;
    for (m = 1; m <= l; m++) square *= (double)(2 * m - 1) / (double)(2 * m);
    for (m = 0; m <= l; m++) {
        double step = sqrt((double)((l - m) * (l + m + 1)));
        t->edge[m] = sqrt(square);
        square *= (double)(l - m) / (double)(l + m + 1);
        if (m) t->gain[m] = 2 * inverse, t->ratio[m] = step * inverse;
        inverse = m < l ? 1 / step : 0;
    }
}

/* out = Y(90) in, or its transpose: a quarter turn about y. Entry (n, m), n <= m, is 2 e_nm (sqrt 2 e where n = 0 < m, e where both
   are 0) between cosines where l+m+n is even, between sines where it is odd; entry (m, n) is (-1)^(m+n) of it, where
   e_{n,m-1} step_{m-1} = 2 n e_{n,m} - step_m e_{n,m+1}. */
static void isogi_sh__turn_y_plain(double *out, const double *in, int l, int channels, int transposed, const isogi_sh__quarter_turn *t) {
    int m, n, k;
    for (m = 0; m < channels * (2 * l + 1); m++) out[m] = 0;
    for (n = 0; n <= l; n++) {
        double after = 0, e = (l + n) & 1 ? -t->edge[n] : t->edge[n];
        for (m = l; m >= n; m--) {
            double w = e * (n > 0 ? 2 : m > 0 ? 1.41421356237309504880 : 1), mirrored = (m + n) & 1 ? -w : w, before;
            int sign = (l + m + n) & 1 ? -1 : 1, at_m = channels * (l + sign * m), at_n = channels * (l + sign * n);
            double to_n = transposed ? mirrored : w, to_m = transposed ? w : mirrored;
            if (sign > 0 || n > 0)
                for (k = 0; k < channels; k++) {
                    out[at_n + k] += to_n * in[at_m + k];
                    if (m != n) out[at_m + k] += to_m * in[at_n + k];
                }
            if (m > n) {
                before = (double)n * t->gain[m] * e - t->ratio[m] * after;
                after = e;
                e = before;
            }
        }
    }
}

#ifdef ISOGI_SH__SIMD
/* The same for one of the channels, with a row n in each lane, even ones beside odd ones. The recursion goes on to m = 0, so that each row
   is whole and none is mirrored; it stays stable, since rows only oscillate where they are no longer growing. */
#define ISOGI_SH__DEFINE_TURN_Y(NAME, TARGET, V, WIDTH, FMA, SPLAT)                                                            \
    TARGET static void NAME(double *out, const double *in, int l, int channels, int transposed, const isogi_sh__quarter_turn *t) { \
        double cosines[ISOGI_SH_MAX_ORDER], sines[ISOGI_SH_MAX_ORDER], lane[4][WIDTH]; /* of m = l, l - 1, .. 0 */             \
        double sign = transposed && (l & 1) ? -1 : 1, sine_sign = transposed ? -sign : 1;                                      \
        int first, i, j;                                                                                                       \
        for (i = 0; i <= l; i++) cosines[i] = in[channels * (2 * l - i)], sines[i] = in[channels * i];                         \
        cosines[l] *= 0.70710678118654752440, sines[l] = 0;                                                                    \
        for (first = 0; first <= l; first += 2 * WIDTH) {                                                                      \
            V zero = {0}, even, odd, even_n, odd_n, even_after = zero, odd_after = zero, even_c = zero, even_s = zero, odd_c = zero, \
                odd_s = zero, d; \
            for (j = 0; j < 2 * WIDTH; j++) {                                                                                  \
                double e = first + j > l ? 0 : t->edge[first + j] * (first + j ? 2 : 1.41421356237309504880);                  \
                lane[j & 1][j / 2] = (l + first + j) & 1 ? -e : e, lane[2 + (j & 1)][j / 2] = first + j;                       \
            }                                                                                                                  \
            memcpy(&even, lane[0], sizeof even), memcpy(&odd, lane[1], sizeof odd);                                            \
            memcpy(&even_n, lane[2], sizeof even), memcpy(&odd_n, lane[3], sizeof odd);                                        \
            for (i = 0; i < l; i += 2) {                                                                                       \
                even_c = FMA(even, SPLAT(cosines[i]), even_c), odd_s = FMA(odd, SPLAT(sines[i]), odd_s);                       \
                d = even, even = FMA(even_n * t->gain[l - i], even, -(even_after * t->ratio[l - i])), even_after = d;          \
                d = odd, odd = FMA(odd_n * t->gain[l - i], odd, -(odd_after * t->ratio[l - i])), odd_after = d;                \
                even_s = FMA(even, SPLAT(sines[i + 1]), even_s), odd_c = FMA(odd, SPLAT(cosines[i + 1]), odd_c);               \
                d = even, even = FMA(even_n * t->gain[l - i - 1], even, -(even_after * t->ratio[l - i - 1])), even_after = d;  \
                d = odd, odd = FMA(odd_n * t->gain[l - i - 1], odd, -(odd_after * t->ratio[l - i - 1])), odd_after = d;        \
            }                                                                                                                  \
            if (i == l) even_c = FMA(even, SPLAT(cosines[l]), even_c);                                                         \
            memcpy(lane[0], &even_c, sizeof even), memcpy(lane[1], &odd_c, sizeof odd);                                        \
            memcpy(lane[2], &even_s, sizeof even), memcpy(lane[3], &odd_s, sizeof odd);                                        \
            for (j = 0; j < 2 * WIDTH && first + j <= l; j++) {                                                                \
                if (first + j) out[channels * (l - first - j)] = sine_sign * lane[2 + (j & 1)][j / 2];                         \
                out[channels * (l + first + j)] = sign * lane[j & 1][j / 2];                                                   \
            }                                                                                                                  \
        }                                                                                                                      \
    }
ISOGI_SH__DEFINE_TURN_Y(isogi_sh__turn_y_rows4, ISOGI_SH__AVX2, isogi_sh__d4, 4, ISOGI_SH__FMA_D4, isogi_sh__eval_d4_splat)
ISOGI_SH__DEFINE_TURN_Y(isogi_sh__turn_y_rows8, ISOGI_SH__AVX512, isogi_sh__d8, 8, ISOGI_SH__FMA_D8, isogi_sh__eval_d8_splat)
#undef ISOGI_SH__DEFINE_TURN_Y
#endif

static void isogi_sh__turn_y(double *out, const double *in, int l, int channels, int transposed, const isogi_sh__quarter_turn *t) {
#ifdef ISOGI_SH__SIMD
    int level = l > 4 ? isogi_sh__level() : 0, k;
    if (level) {
        for (k = 0; k < channels; k++)
            (level > 1 ? isogi_sh__turn_y_rows8 : isogi_sh__turn_y_rows4)(out + k, in + k, l, channels, transposed, t);
        return;
    }
#endif
    isogi_sh__turn_y_plain(out, in, l, channels, transposed, t);
}

/* The same for one channel and l <= ISOGI_SH__TURNS, from the table. Cosines (index l + m) and sines (l - m) do not mix, and where
   row n meets cosines of m it does not meet sines: m runs in steps of two. */
static void isogi_sh__turn_y_tabled(double *out, const double *in, int l, int transposed) {
    const double *w = isogi_sh__turn_f64 + l * (l + 1) * (l + 2) / 6 - 1;
    double sign = l & 1 ? -1 : 1; /* entry (m, n) is this times entry (n, m) between cosines, its negative between sines */
    double cosine_n = transposed ? sign : 1, cosine_m = transposed ? 1 : sign, sine_n = transposed ? -sign : 1,
           sine_m = transposed ? 1 : -sign;
    int m, n;
    for (m = 0; m <= 2 * l; m++) out[m] = 0;
    for (n = 0; n <= l; n++) {
        double sum = 0, x = cosine_m * in[l + n];
        int first = n + (l & 1); /* l + m + n even */
        for (m = first; m <= l; m += 2) {
            if (m > n) out[l + m] += w[m - n] * x;
            sum += w[m - n] * in[l + m];
        }
        out[l + n] += cosine_n * sum;
        if (n > 0) {
            sum = 0, x = sine_m * in[l - n];
            for (m = n + 1 - (l & 1); m <= l; m += 2) {
                if (m > n) out[l - m] += w[m - n] * x;
                sum += w[m - n] * in[l - m];
            }
            out[l - n] += sine_n * sum;
        }
        w += l - n + 1;
    }
}

/* What the degrees of one rotation share. */
typedef struct isogi_sh__turns {
    double first[ISOGI_SH_MAX_ORDER][2], middle[ISOGI_SH_MAX_ORDER][2], last[ISOGI_SH_MAX_ORDER][2];
    isogi_sh__quarter_turn quarter;
} isogi_sh__turns;

static void isogi_sh__turns_start(isogi_sh__turns *t, int order, const isogi_sh__euler *e) {
    isogi_sh__powers(t->first, order, -e->c[1], e->c[0]);
    isogi_sh__powers(t->middle, order, e->b[0], e->b[1]);
    isogi_sh__powers(t->last, order, e->a[1], -e->a[0]);
}

/* One degree, after isogi_sh__quarter_turn_start; `other` is as large as band. */
static void isogi_sh__rotate_band(double *band, double *other, int l, int channels, isogi_sh__turns *t) {
    if (l == 0) return;
    isogi_sh__turn_z(band, l, channels, t->first);
    if (channels == 1 && l <= ISOGI_SH__TURNS) {
        isogi_sh__turn_y_tabled(other, band, l, 0);
        isogi_sh__turn_z(other, l, 1, t->middle);
        isogi_sh__turn_y_tabled(band, other, l, 1);
        isogi_sh__turn_z(band, l, 1, t->last);
        return;
    }
    isogi_sh__turn_y(other, band, l, channels, 0, &t->quarter);
    isogi_sh__turn_z(other, l, channels, t->middle);
    isogi_sh__turn_y(band, other, l, channels, 1, &t->quarter);
    isogi_sh__turn_z(band, l, channels, t->last);
}

/* Degrees 1 to 4 of one channel, which most callers have alone: the same steps with l a constant, so that loops, signs and table
   are gone from what is compiled. */
ISOGI_SH__INLINE void isogi_sh__turn_y_fixed(double *out, const double *in, int l, int transposed) {
    const double *w = isogi_sh__turn_f64 + l * (l + 1) * (l + 2) / 6 - 1;
    int m, n;
    ISOGI_SH__UNROLL9
    for (m = 0; m <= 2 * l; m++) out[m] = 0;
    ISOGI_SH__UNROLL
    for (n = 0; n <= l; n++) {
        ISOGI_SH__UNROLL
        for (m = n; m <= l; m++, w++) {
            int sign = (l + m + n) & 1 ? -1 : 1;
            double mirrored = (m + n) & 1 ? -*w : *w;
            if (sign > 0 || n > 0) {
                out[l + sign * n] += (transposed ? mirrored : *w) * in[l + sign * m];
                if (m != n) out[l + sign * m] += (transposed ? *w : mirrored) * in[l + sign * n];
            }
        }
    }
}

ISOGI_SH__INLINE void isogi_sh__rotate_fixed(double *c, int l, isogi_sh__turns *t) {
    double band[9], other[9];
    int i;
    ISOGI_SH__UNROLL9
    for (i = 0; i <= 2 * l; i++) band[i] = c[l * l + i];
    isogi_sh__turn_z(band, l, 1, t->first);
    isogi_sh__turn_y_fixed(other, band, l, 0);
    isogi_sh__turn_z(other, l, 1, t->middle);
    isogi_sh__turn_y_fixed(band, other, l, 1);
    isogi_sh__turn_z(band, l, 1, t->last);
    ISOGI_SH__UNROLL9
    for (i = 0; i <= 2 * l; i++) c[l * l + i] = band[i];
}

static void isogi_sh__rotate_low(double *c, int order, isogi_sh__turns *t) {
    if (order > 1) isogi_sh__rotate_fixed(c, 1, t);
    if (order > 2) isogi_sh__rotate_fixed(c, 2, t);
    if (order > 3) isogi_sh__rotate_fixed(c, 3, t);
    if (order > 4) isogi_sh__rotate_fixed(c, 4, t);
}

#ifdef ISOGI_SH__SIMD
/* ---- one channel of orders 3 to 5 in float ---- */

/* Products of two rows of R: lanes 3 to 7 are the pairs xy, yz, zz, zx, xx, lanes 0 to 2 those of y, z, x with themselves. */
typedef struct isogi_sh__row_pairs {
    isogi_sh__f8 ax, ay, az, bx, by, bz; /* entries of the first and of the second row */
    isogi_sh__f8 xx, yy, zz, xy, yz, zx; /* their products, x times y in either order */
} isogi_sh__row_pairs;

/* 0 unless the matrix is a rotation to 1e-6, as rotations rounded to float are: all products of rows are 0 or 1, and the last column
   is what the cross products of the rows say. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma"))) int isogi_sh__row_pairs_start(isogi_sh__row_pairs *r, const float m[9]) {
    isogi_sh__f8 low = *(const isogi_sh__f8 *)m, high = *(const isogi_sh__f8 *)(m + 1), zero = {0}, off, cross;
    const isogi_sh__f8 same = {1, 1, 1, 0, 0, 1, 0, 1}, pair = {0, 0, 0, 1, 1, 0, 1, 0};
    r->ax = __builtin_shufflevector(low, low, 3, 6, 0, 0, 3, 6, 6, 0), r->bx = __builtin_shufflevector(low, low, 3, 6, 0, 3, 6, 6, 0, 0);
    r->ay = __builtin_shufflevector(low, low, 4, 7, 1, 1, 4, 7, 7, 1), r->by = __builtin_shufflevector(low, low, 4, 7, 1, 4, 7, 7, 1, 1);
    r->az = __builtin_shufflevector(high, high, 4, 7, 1, 1, 4, 7, 7, 1),
    r->bz = __builtin_shufflevector(high, high, 4, 7, 1, 4, 7, 7, 1, 1);
    r->xx = r->ax * r->bx, r->yy = r->ay * r->by, r->zz = r->az * r->bz;
    r->xy = ISOGI_SH__FMA_F8(r->ax, r->by, r->ay * r->bx), r->yz = ISOGI_SH__FMA_F8(r->ay, r->bz, r->az * r->by);
    r->zx = ISOGI_SH__FMA_F8(r->ax, r->bz, r->az * r->bx);
    off = (r->xx - same) + (r->yy + r->zz);
    cross = (ISOGI_SH__FMA_F8(r->ax, r->by, -(r->ay * r->bx)) - __builtin_shufflevector(high, high, 7, 7, 7, 7, 1, 7, 4, 7)) * pair;
    off = ISOGI_SH__FMA_F8(off, off, cross * cross); /* compared by bits, since -ffast-math lets NaN pass */
    return ISOGI_SH__LESS_F8((isogi_sh__i8)off & 0x7fffffff, (isogi_sh__i8)(zero + 1e-12f));
}

/* Degrees 1 and 2, c[1] to c[8], without angles: degree 1 is a vector v, degree 2 a traceless symmetric tensor T, and R v and R T R^T
   need the products above; the last lane becomes xx - yy = 2 xx + zz. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma"))) isogi_sh__f8 isogi_sh__rotate_degrees12(const float *in,
                                                                                             const isogi_sh__row_pairs *r) {
    const isogi_sh__f8 zero = {0}, trace = {0, 0, 0, 0, 0, -0.57735026919f, 0, -0.57735026919f};
    const isogi_sh__f8 scale = {0, 0, 0, 1, 1, 0.86602540378f, 1, 1}, half = {0, 0, 0, 0, 0, 0, 0, 0.5f};
    isogi_sh__f8 q, v;
    v = ISOGI_SH__ADD_F8(r->ax, in[3], ISOGI_SH__ADD_F8(r->ay, in[1], r->az * ISOGI_SH__SPLAT_F8(in[2])));
    q = ISOGI_SH__ADD_F8(ISOGI_SH__FMA_F8(r->zz, 1.73205080757f - zero, trace), in[6], (r->xx - r->yy) * ISOGI_SH__SPLAT_F8(in[8]));
    q = ISOGI_SH__ADD_F8(r->xy, in[4], q);
    q = ISOGI_SH__ADD_F8(r->yz, in[5], q);
    q = ISOGI_SH__ADD_F8(r->zx, in[7], q);
    q = ISOGI_SH__FMA_F8(q, scale, __builtin_shufflevector(q, q, 5, 5, 5, 5, 5, 5, 5, 5) * half);
    return __builtin_shufflevector(v, q, 0, 1, 2, 11, 12, 13, 14, 15);
}

/* Degree 3, c[8] to c[15] of which the first is not looked at, as a traceless symmetric tensor of rank 3. Its entries that are asked for
   are 222, 333, 111, 123, 233, 331, 311, one a lane: sums over i, j, k of T_ijk A_i B_j C_k with the pairs of rows and a third one. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma"))) isogi_sh__f8 isogi_sh__rotate_degree3(const float *in, const float m[9],
                                                                                           const isogi_sh__row_pairs *r) {
    isogi_sh__f8 low = *(const isogi_sh__f8 *)m, high = *(const isogi_sh__f8 *)(m + 1), c = *(const isogi_sh__f8 *)in, p, v;
    const isogi_sh__f8 scale = {-1.69479004f, 1.33984917f, 1.69479004f, 2.07568541f, 1.6409734f, 1.6409734f, 2.07568541f, 0};
    const isogi_sh__f8 rest = {-1.27109253f, 0, 1.27109253f, 0, 0, 0, 1.03784271f, 0};
    /* T: 111, 122, 112, 222, 113, 223, 333, 123; and 133, 233 */
    const isogi_sh__f8 k1 = {0.59004359f, -0.59004359f, 0.59004359f, -0.59004359f, 0.481768574f, -0.481768574f, 0.746352665f, 0.481768574f};
    const isogi_sh__f8 k2 = {-0.457045799f, -0.1523486f, -0.1523486f, -0.457045799f, -0.373176333f, -0.373176333f, 0, 0};
    const isogi_sh__f8 k3 = {0.609394399f, 0.609394399f, 0, 0, 0, 0, 0, 0};
    float t[16];
    *(isogi_sh__f8 *)t = ISOGI_SH__FMA_F8(k2, __builtin_shufflevector(c, c, 5, 5, 3, 3, 4, 4, 4, 4),
                                          k1 * __builtin_shufflevector(c, c, 7, 7, 1, 1, 6, 6, 4, 2));
    *(isogi_sh__f8 *)(t + 8) = k3 * __builtin_shufflevector(c, c, 5, 3, 5, 3, 5, 3, 5, 3);
    __asm__("" : "+m"(t)); /* spread from memory: shuffles are what this waits for */
#define ISOGI_SH__ROWS(i0, i1, i2, i3, i4, i5)                                                                                  \
    p = ISOGI_SH__ADD_F8(r->xx, t[i0], ISOGI_SH__ADD_F8(r->yy, t[i1], r->zz * ISOGI_SH__SPLAT_F8(t[i2]))); \
    p = ISOGI_SH__ADD_F8(r->xy, t[i3], ISOGI_SH__ADD_F8(r->yz, t[i4], ISOGI_SH__ADD_F8(r->zx, t[i5], p)))
    ISOGI_SH__ROWS(0, 1, 8, 2, 7, 4);
    v = p * __builtin_shufflevector(low, low, 3, 6, 0, 6, 6, 0, 0, 0);
    ISOGI_SH__ROWS(2, 3, 9, 1, 5, 7);
    v = ISOGI_SH__FMA_F8(p, __builtin_shufflevector(low, low, 4, 7, 1, 7, 7, 1, 1, 1), v);
    ISOGI_SH__ROWS(4, 5, 6, 7, 9, 8);
    v = ISOGI_SH__FMA_F8(p, __builtin_shufflevector(high, high, 4, 7, 1, 7, 7, 1, 1, 1), v);
#undef ISOGI_SH__ROWS
    return ISOGI_SH__FMA_F8(scale, v, rest * __builtin_shufflevector(v, v, 4, 4, 5, 4, 4, 4, 1, 4));
}

/* Degree 4, c[0] to c[8], as a traceless symmetric tensor of rank 4, whose entries with two equal pairs of indices are a symmetric matrix T
   over the pairs xx, yy, xy, yz, zx; zz is what the trace leaves, so that pairs of rows count as Q: xx - zz, yy - zz, xy, yz, zx. Lanes of
   M are Q T; those times Q of the rows zz and xx are the entries asked for: yyzz, zzzz, xxzz, xyzz, yzzz, -, zxzz, -, and xxyy, xxzz, -,
   xxxy, xxyz, -, xxzx, -. An entry is a coefficient of the polynomial in x, y, z by the number of orders its factors can stand in;
   constants: 3/16 sqrt(35/pi), 3/8 sqrt(70/pi), 3/8 sqrt(5/pi), 3/8 sqrt(10/pi), 3/16 sqrt(1/pi) of m = 4, 3, 2, 1, 0 in them. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma"))) void isogi_sh__rotate_degree4(float *out, const float *in,
                                                                                   const isogi_sh__row_pairs *r) {
    isogi_sh__f8 c = *(const isogi_sh__f8 *)in, zero = {0}, q0 = r->xx - r->zz, q1 = r->yy - r->zz, m, zz, xx;
    /* T: xxxx, xxyy, yyyy, xxxy, yyxy, xxyz, xxzx, yyyz; yyzx, yyzz, xyzz, xxzz */
    const isogi_sh__f8 k1 = {-0.473087348f, 0, 0.473087348f, 0.625835735f, -0.625835735f, 0.442532692f, 0.442532692f, -0.442532692f},
                       k2 = {0.317356641f,  0.105785547f,  0.317356641f,  -0.236543674f,
                             -0.236543674f, -0.167261636f, -0.501784908f, -0.501784908f};
    const isogi_sh__f8 k3 = {0.625835735f, -0.625835735f, 0.625835735f, 0, 0, 0, 0, 0},
                       k4 = {-0.442532692f, -0.473087348f, 0.473087348f, 0.473087348f, 0, 0, 0, 0},
                       k5 = {-0.167261636f, -0.423142188f, 0, -0.423142188f, 0, 0, 0, 0};
    const isogi_sh__f8 s1 = {0.798931687f, 0.564930014f, 2.11377456f, 1.49466432f, 1.1816359f, 1.49466432f, -1.05688728f, 1.69479004f},
                       s2 = {1.59786337f, 2.25972005f, 0, 0, 0, 0, 1.05688728f, 2.25972005f};
    float t[16], last = in[8];
    *(isogi_sh__f8 *)t = ISOGI_SH__FMA_F8(k3, last - zero,
                                          ISOGI_SH__FMA_F8(k2, __builtin_shufflevector(c, c, 4, 4, 4, 2, 2, 3, 5, 3),
                                                           k1 * __builtin_shufflevector(c, c, 6, 6, 6, 0, 0, 1, 7, 1)));
    *(isogi_sh__f8 *)(t + 8) = ISOGI_SH__FMA_F8(k5, __builtin_shufflevector(c, c, 5, 4, 4, 4, 5, 4, 4, 4),
                                                k4 * __builtin_shufflevector(c, c, 7, 6, 2, 6, 7, 6, 2, 6));
    __asm__("" : "+m"(t)); /* spread from memory, as in degree 3 */
#define ISOGI_SH__ENTRIES(q, i0, i1, i2, i3, i4)                                                                                 \
    m = ISOGI_SH__ADD_F8(q0, t[i0], q1 * ISOGI_SH__SPLAT_F8(t[i1]));                             \
    m = ISOGI_SH__ADD_F8(r->xy, t[i2], ISOGI_SH__ADD_F8(r->yz, t[i3], ISOGI_SH__ADD_F8(r->zx, t[i4], m))); \
    zz = ISOGI_SH__FMA_F8(m, __builtin_shufflevector(q, q, 1, 1, 1, 1, 5, 5, 5, 5), zz);                                         \
    xx = ISOGI_SH__FMA_F8(m, __builtin_shufflevector(q, q, 2, 2, 2, 2, 7, 7, 7, 7), xx)
    zz = xx = zero;
    ISOGI_SH__ENTRIES(q0, 0, 1, 3, 5, 6);
    ISOGI_SH__ENTRIES(q1, 1, 2, 4, 7, 8);
    ISOGI_SH__ENTRIES(r->xy, 3, 4, 1, 8, 5);
    ISOGI_SH__ENTRIES(r->yz, 5, 7, 8, 9, 10);
    ISOGI_SH__ENTRIES(r->zx, 6, 8, 5, 10, 11);
#undef ISOGI_SH__ENTRIES
    m = s1 * __builtin_shufflevector(zz, zz, 3, 4, 3, 4, 1, 6, 0, 6);
    *(isogi_sh__f8 *)out = ISOGI_SH__FMA_F8(s2, __builtin_shufflevector(xx, xx, 3, 4, 3, 4, 1, 6, 1, 6), m);
    out[8] = (0.125f * zz[1] - xx[0]) * 1.59786337f;
}

/* The first degrees from what they share. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma"))) int isogi_sh__rotate_low_f8(float *out, const float *in, int order, const float m[9]) {
    isogi_sh__row_pairs r;
    isogi_sh__f8 one, three;
    if (!isogi_sh__row_pairs_start(&r, m)) return 0;
    one = isogi_sh__rotate_degrees12(in, &r);
    if (order > 3) {
        three = isogi_sh__rotate_degree3(in + 8, m, &r);
        three = __builtin_shufflevector(one, three, 7, 8, 11, 12, 9, 13, 14, 10);
    }
    if (order > 4) isogi_sh__rotate_degree4(out + 16, in + 16, &r);
    out[0] = in[0];
    *(isogi_sh__f8 *)(out + 1) = one;
    if (order > 3) *(isogi_sh__f8 *)(out + 8) = three;
    return 1;
}

#endif

#ifdef ISOGI_SH__SIMD
/* ---- one channel in double, degrees to ISOGI_SH__TURNS ----
   A quarter turn about y takes the cosines of even m to those of even or of odd n, as l + m + n is even, and the sines the other way: four
   matrices of at most 8 x 8, applied column by column. So each degree is four vectors: cosines and sines, of even and of odd m. */
typedef struct isogi_sh__multiples {
    isogi_sh__d8 even_c, even_s, odd_c, odd_s; /* cosines and sines of 0, 2, .. 14 and of 1, 3, .. 15 times an angle */
} isogi_sh__multiples;

/* (c, s) times (x, y) as complex numbers; length 1 again: see isogi_sh__powers. */
#define ISOGI_SH__TURN_BY(c, s, x, y) t = ISOGI_SH__FMA_D8(c, x, -(s * (y))), s = ISOGI_SH__FMA_D8(c, y, s * (x)), c = t
#define ISOGI_SH__UNIT_LENGTH(c, s) t = ISOGI_SH__FMA_D8(-c, c, ISOGI_SH__FMA_D8(-s, s, one)) * 0.5, c = ISOGI_SH__FMA_D8(c, t, c), \
    s = ISOGI_SH__FMA_D8(s, t, s)
ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) void isogi_sh__multiples_start(isogi_sh__multiples *t8,
                                                                                                              double c1, double s1) {
    const isogi_sh__d8 zero = {0}, one = {1, 1, 1, 1, 1, 1, 1, 1};
    double c2 = c1 * c1 - s1 * s1, s2 = 2 * c1 * s1, c4 = c2 * c2 - s2 * s2, s4 = 2 * c2 * s2, c8 = c4 * c4 - s4 * s4, s8 = 2 * c4 * s4;
    isogi_sh__d8 c = __builtin_shufflevector(one, zero + c2, 0, 9, 2, 11, 4, 13, 6, 15),
                 s = __builtin_shufflevector(zero, zero + s2, 0, 9, 2, 11, 4, 13, 6, 15), t;
    isogi_sh__d8 x = __builtin_shufflevector(one, zero + c4, 0, 1, 10, 11, 4, 5, 14, 15),
                 y = __builtin_shufflevector(zero, zero + s4, 0, 1, 10, 11, 4, 5, 14, 15);
    ISOGI_SH__TURN_BY(c, s, x, y);
    x = __builtin_shufflevector(one, zero + c8, 0, 1, 2, 3, 12, 13, 14, 15),
    y = __builtin_shufflevector(zero, zero + s8, 0, 1, 2, 3, 12, 13, 14, 15);
    ISOGI_SH__TURN_BY(c, s, x, y);
    x = c, y = s;
    ISOGI_SH__TURN_BY(x, y, zero + c1, zero + s1);
    ISOGI_SH__UNIT_LENGTH(c, s);
    ISOGI_SH__UNIT_LENGTH(x, y);
    t8->even_c = c, t8->even_s = s, t8->odd_c = x, t8->odd_s = y;
}
#undef ISOGI_SH__TURN_BY
#undef ISOGI_SH__UNIT_LENGTH

/* 0, 1, .. 7, or 8, 9, .. 15, of even and of odd ones */
#define ISOGI_SH__MERGE(even, odd, high) \
    ((high) ? __builtin_shufflevector(even, odd, 4, 12, 5, 13, 6, 14, 7, 15) : __builtin_shufflevector(even, odd, 0, 8, 1, 9, 2, 10, 3, 11))

ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) void isogi_sh__turn_z_d8(isogi_sh__d8 v[4],
                                                                                                        const isogi_sh__multiples *t) {
    isogi_sh__d8 even = ISOGI_SH__FMA_D8(v[0], t->even_c, -(v[2] * t->even_s)), odd = ISOGI_SH__FMA_D8(v[1], t->odd_c, -(v[3] * t->odd_s));
    v[2] = ISOGI_SH__FMA_D8(v[0], t->even_s, v[2] * t->even_c), v[3] = ISOGI_SH__FMA_D8(v[1], t->odd_s, v[3] * t->odd_c);
    v[0] = even, v[1] = odd;
}

/* Lanes past a column's end hold other columns' numbers: nothing reads what comes of them. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) void isogi_sh__turn_y_d8(isogi_sh__d8 v[4], int l) {
    const isogi_sh__d8 zero = {0};
    const double *w = isogi_sh__turn_columns_f64 + l * (l + 1) * (2 * l + 1) / 6 - 1;
    int alike = l & 1, other = 1 - alike, step = 2 * (l + 1), odd_n = l / 2 + 1, i;
    const double *column = w + alike * (l + 1), *across = w + other * (l + 1), *x, *y;
    isogi_sh__d8 from[4], even_c = zero, even_s = zero, odd_c = zero, odd_s = zero;
    for (i = 0; i < 4; i++) from[i] = v[i];
    x = (const double *)from + 8 * alike, y = (const double *)from + 8 * other;
    for (i = 0; 2 * i < l; i++, column += step, across += step) {
        even_c = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)column, isogi_sh__eval_d8_splat(x[i]), even_c);
        odd_s = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)(column + odd_n), isogi_sh__eval_d8_splat(x[i + 16]), odd_s);
        odd_c = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)(across + odd_n), isogi_sh__eval_d8_splat(y[i]), odd_c);
        even_s = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)across, isogi_sh__eval_d8_splat(y[i + 16]), even_s);
    }
    if (!alike) {
        even_c = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)column, isogi_sh__eval_d8_splat(x[i]), even_c);
        odd_s = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)(column + odd_n), isogi_sh__eval_d8_splat(x[i + 16]), odd_s);
    }
    v[0] = even_c, v[1] = odd_c, v[2] = even_s, v[3] = odd_s;
}

/* Eight numbers of float or double at index i, those of the mask; zero elsewhere. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) isogi_sh__d8
isogi_sh__get_rows(const void *in, int is_double, int i, unsigned mask) {
    const __mmask8 some = (__mmask8)mask;
    if (is_double) return (isogi_sh__d8)_mm512_maskz_loadu_pd(some, (const double *)in + i);
    return __builtin_convertvector((isogi_sh__f8)_mm256_maskz_loadu_ps(some, (const float *)in + i), isogi_sh__d8);
}

ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) void isogi_sh__put_rows(void *out, int is_double, int i,
                                                                                                       isogi_sh__d8 v, unsigned mask) {
    const __mmask8 some = (__mmask8)mask;
    if (is_double) _mm512_mask_storeu_pd((double *)out + i, some, (__m512d)v);
    else _mm256_mask_storeu_ps((float *)out + i, some, _mm512_maskz_cvtpd_ps(0xff, (__m512d)v));
}

/* The three angles of one rotation. */
typedef struct isogi_sh__turns_d8 {
    isogi_sh__multiples first, middle, last;
} isogi_sh__turns_d8;

ISOGI_SH__AVX512 static void isogi_sh__rotate_d8(void *out, const void *in, int is_double, int order, const isogi_sh__turns_d8 *t) {
    const isogi_sh__d8 zero = {0};
    isogi_sh__d8 v[4], back = zero + 1;
    int l;
    isogi_sh__put_rows(out, is_double, 0, isogi_sh__get_rows(in, is_double, 0, 1), 1);
    for (l = 1; l < order; l++) {
        /* what there is of l, l+1, .. and of l-15, .. l-1 */
        int at = l * (l + 1), bits = (2 << l) - 1, sine_bits = (0xffff << (15 - l)) & 0x7fff;
        isogi_sh__d8 low = isogi_sh__get_rows(in, is_double, at, (unsigned)bits),
                     low_s = isogi_sh__get_rows(in, is_double, at - 7, (unsigned)(sine_bits >> 8));
        isogi_sh__d8 high = isogi_sh__get_rows(in, is_double, at + 8, (unsigned)(bits >> 8)),
                     high_s = isogi_sh__get_rows(in, is_double, at - 15, (unsigned)sine_bits);
        v[0] = __builtin_shufflevector(low, high, 0, 2, 4, 6, 8, 10, 12, 14),
        v[1] = __builtin_shufflevector(low, high, 1, 3, 5, 7, 9, 11, 13, 15);
        v[2] = __builtin_shufflevector(low_s, high_s, 7, 5, 3, 1, 15, 13, 11, 9),
        v[3] = __builtin_shufflevector(low_s, high_s, 6, 4, 2, 0, 14, 12, 10, 8);
        isogi_sh__turn_z_d8(v, &t->first);
        isogi_sh__turn_y_d8(v, l);
        isogi_sh__turn_z_d8(v, &t->middle);
        isogi_sh__turn_y_d8(v, l); /* the transpose is (-1)^l of it between cosines, the negative of that between sines */
        back = -back;
        v[0] *= back, v[1] *= back, v[2] *= -back, v[3] *= -back;
        isogi_sh__turn_z_d8(v, &t->last);
        isogi_sh__put_rows(out, is_double, at, __builtin_shufflevector(v[0], v[1], 0, 8, 1, 9, 2, 10, 3, 11), (unsigned)bits);
        isogi_sh__put_rows(out, is_double, at - 7, __builtin_shufflevector(v[2], v[3], 11, 3, 10, 2, 9, 1, 8, 0),
                           (unsigned)(sine_bits >> 8));
        if (l < 8) continue;
        isogi_sh__put_rows(out, is_double, at + 8, __builtin_shufflevector(v[0], v[1], 4, 12, 5, 13, 6, 14, 7, 15), (unsigned)(bits >> 8));
        isogi_sh__put_rows(out, is_double, at - 15, __builtin_shufflevector(v[2], v[3], 15, 7, 14, 6, 13, 5, 12, 4), (unsigned)sine_bits);
    }
}

/* Orders to ISOGI_SH__TURNS + 1; of several channels each by itself. */
ISOGI_SH__AVX512 static void isogi_sh__rotate_channels(void *out, const void *in, int is_double, int order, int channels,
                                                       const isogi_sh__euler *e) {
    double c[(ISOGI_SH__TURNS + 1) * (ISOGI_SH__TURNS + 1)];
    isogi_sh__turns_d8 t;
    int i, k, n = order * order;
    isogi_sh__multiples_start(&t.first, -e->c[1], e->c[0]);
    isogi_sh__multiples_start(&t.middle, e->b[0], e->b[1]);
    isogi_sh__multiples_start(&t.last, e->a[1], -e->a[0]);
    if (channels == 1) {
        isogi_sh__rotate_d8(out, in, is_double, order, &t);
        return;
    }
    for (k = 0; k < channels; k++) {
        if (is_double)
            for (i = 0; i < n; i++) c[i] = ((const double *)in)[channels * i + k];
        else
            for (i = 0; i < n; i++) c[i] = (double)((const float *)in)[channels * i + k];
        isogi_sh__rotate_d8(c, c, 1, order, &t);
        if (is_double)
            for (i = 0; i < n; i++) ((double *)out)[channels * i + k] = c[i];
        else
            for (i = 0; i < n; i++) ((float *)out)[channels * i + k] = (float)c[i];
    }
}
#endif

/* Any order, a few channels at a time; float or double alike. */
ISOGI_SH__APART void isogi_sh__rotate(void *out, const void *in, int is_double, int order, int channels, const isogi_sh__euler *e) {
    double band[2 * ISOGI_SH_MAX_ORDER * ISOGI_SH__TOGETHER], other[2 * ISOGI_SH_MAX_ORDER * ISOGI_SH__TOGETHER];
    isogi_sh__turns turns;
    int l = 0, i, k, first;
#ifdef ISOGI_SH__SIMD
    if (order > 5 && isogi_sh__level() > 1) {
        l = order < ISOGI_SH__TURNS + 1 ? order : ISOGI_SH__TURNS + 1;
        isogi_sh__rotate_channels(out, in, is_double, l, channels, e);
        if (l == order) return;
    }
#endif
    isogi_sh__turns_start(&turns, order, e);
    if (l == 0) {
        int low = order < 5 ? order * order : 25;
        for (k = 0; k < channels; k++) {
            for (i = 0; i < low; i++) band[i] = isogi_sh__get(in, is_double, channels * i + k);
            isogi_sh__rotate_low(band, order, &turns);
            for (i = 0; i < low; i++) {
                if (is_double) ((double *)out)[channels * i + k] = band[i];
                else ((float *)out)[channels * i + k] = (float)band[i];
            }
        }
        l = 5;
    }
    for (; l < order; l++) {
        if (channels > 1 || l > ISOGI_SH__TURNS) isogi_sh__quarter_turn_start(&turns.quarter, l);
        for (first = 0; first < channels; first += ISOGI_SH__TOGETHER) {
            int some = channels - first < ISOGI_SH__TOGETHER ? channels - first : ISOGI_SH__TOGETHER;
            int at = channels * l * l + first;
            for (i = 0; i <= 2 * l; i++)
                for (k = 0; k < some; k++) band[some * i + k] = isogi_sh__get(in, is_double, at + channels * i + k);
            isogi_sh__rotate_band(band, other, l, some, &turns);
            for (i = 0; i <= 2 * l; i++)
                for (k = 0; k < some; k++) {
                    int j = at + channels * i + k;
                    if (is_double) ((double *)out)[j] = band[some * i + k];
                    else ((float *)out)[j] = (float)band[some * i + k];
                }
        }
    }
}

ISOGI_API isogi_result isogi_sh_rotate_f64(double *out, const double *in, int order, int channels, const double m[9]) {
    isogi_sh__euler e;
    if (!out || !in || !m || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    if (isogi_sh__euler_angles(&e, m) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotate(out, in, 1, order, channels, &e);
    return ISOGI_OK;
}

/* Kept out of the caller, whose fast way would pay for its registers. */
ISOGI_SH__APART isogi_result isogi_sh__rotate_f32(float *out, const float *in, int order, int channels, const float m[9]) {
    isogi_sh__euler e;
    double r[9];
    int i;
    if (!out || !in || !m || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (i = 0; i < 9; i++) r[i] = (double)m[i];
    if (isogi_sh__euler_angles(&e, r) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotate(out, in, 0, order, channels, &e);
    return ISOGI_OK;
}

#ifdef ISOGI_SH__SIMD
/* Each ends with the plain way where its own does not do, so that callers need not come back. */
ISOGI_SH__AVX2 static isogi_result isogi_sh__rotate_order3(float *out, const float *in, const float m[9]) {
    return isogi_sh__rotate_low_f8(out, in, 3, m) ? ISOGI_OK : isogi_sh__rotate_f32(out, in, 3, 1, m);
}

ISOGI_SH__AVX2 static isogi_result isogi_sh__rotate_order4(float *out, const float *in, const float m[9]) {
    return isogi_sh__rotate_low_f8(out, in, 4, m) ? ISOGI_OK : isogi_sh__rotate_f32(out, in, 4, 1, m);
}

ISOGI_SH__AVX2 static isogi_result isogi_sh__rotate_order5(float *out, const float *in, const float m[9]) {
    return isogi_sh__rotate_low_f8(out, in, 5, m) ? ISOGI_OK : isogi_sh__rotate_f32(out, in, 5, 1, m);
}
#endif

ISOGI_API isogi_result isogi_sh_rotate(float *out, const float *in, int order, int channels, const float m[9]) {
#ifdef ISOGI_SH__SIMD
    if (channels == 1 && out && in && m && isogi_sh__avx2()) {
        if (order == 3) return isogi_sh__rotate_order3(out, in, m);
        if (order == 4) return isogi_sh__rotate_order4(out, in, m);
        if (order == 5) return isogi_sh__rotate_order5(out, in, m);
    }
#endif
    return isogi_sh__rotate_f32(out, in, order, channels, m);
}

/* Where coefficients or a matrix go. */
typedef struct isogi_sh__blocks {
    void *data;
    int is_double;
} isogi_sh__blocks;

ISOGI_SH__INLINE void isogi_sh__put(const isogi_sh__blocks *out, int i, double value) {
    if (out->is_double) ((double *)out->data)[i] = value;
    else ((float *)out->data)[i] = (float)value;
}

static isogi_result isogi_sh__rotate_z(void *out, const void *in, int is_double, int order, int channels, double angle) {
    double power[ISOGI_SH_MAX_ORDER][2];
    isogi_sh__blocks to;
    int l, m, k;
    if (!out || !in || !isogi_sh__shape_ok(order, channels) || !isogi_sh__finite_f64(angle)) return ISOGI_INVALID;
    to.data = out, to.is_double = is_double;
    isogi_sh__powers(power, order, cos(angle), sin(angle));
    for (l = 0; l < order; l++)
        for (m = 0; m <= l; m++)
            for (k = 0; k < channels; k++) {
                int plus = channels * (l * (l + 1) + m) + k, minus = channels * (l * (l + 1) - m) + k;
                double p = isogi_sh__get(in, is_double, plus), q = isogi_sh__get(in, is_double, minus);
                double x = p * power[m][0] - q * power[m][1], y = p * power[m][1] + q * power[m][0];
                if (m == 0) x = p, y = p;
                isogi_sh__put(&to, plus, x), isogi_sh__put(&to, minus, y);
            }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_rotate_z(float *out, const float *in, int order, int channels, double angle) {
    return isogi_sh__rotate_z(out, in, 0, order, channels, angle);
}

ISOGI_API isogi_result isogi_sh_rotate_z_f64(double *out, const double *in, int order, int channels, double angle) {
    return isogi_sh__rotate_z(out, in, 1, order, channels, angle);
}

/* What Wigner's d of one angle b needs, for orders up to ISOGI_SH__TURNS + 1. */
typedef struct isogi_sh__wigner {
    double a[ISOGI_SH__TURNS + 1][2], c[ISOGI_SH__TURNS + 1][2]; /* multiples of the outer angles */
    double cosine[2 * ISOGI_SH__TURNS + 2], sine[2 * ISOGI_SH__TURNS + 2]; /* powers of cos b/2, -sin b/2 */
    double zonal[ISOGI_SH__TURNS + 1][2]; /* the recursion's factors a_l, -a_l / a_{l-1} for m = 0 */
    double less, more, less_low, more_low; /* 1 - cos b and 1 + cos b, each in two parts: an ulp of them shows l^2 times */
    double excess;                        /* cos^2 + sin^2 of b/2 as rounded, less 1: their m-th powers would show it */
} isogi_sh__wigner;

/* x y - high in full, high being x * y as rounded (Dekker) */
static double isogi_sh__product_rest(double x, double y, double high) {
    double t = 134217729 * x, a = t - (t - x), b = x - a, u = 134217729 * y, c = u - (u - y), d = y - c;
    return ((a * c - high) + (a * d + b * c)) + b * d;
}

/* power[k] = x^k for 1 < count <= 2 ISOGI_SH__TURNS + 2, each rounded once only: by halving, in numbers of twice the length. */
static void isogi_sh__exact_powers(double *power, int count, double x) {
    double low[2 * ISOGI_SH__TURNS + 2];
    int k;
    power[0] = 1, low[0] = 0, power[1] = x, low[1] = 0;
    for (k = 2; k < count; k++) {
        int i = k / 2, j = k - i;
        double p = power[i] * power[j], rest = isogi_sh__product_rest(power[i], power[j], p) + (power[i] * low[j] + low[i] * power[j]);
        power[k] = p + rest;
        low[k] = (p - power[k]) + rest;
    }
}

static void isogi_sh__wigner_start(isogi_sh__wigner *w, int order, const isogi_sh__euler *e) {
    double half_c, half_s, cc, ss, before = 1;
    int l;
    if (e->b[0] > 0) half_c = sqrt(0.5 * (1 + e->b[0])), half_s = e->b[1] / (2 * half_c);
    else half_s = sqrt(0.5 * (1 - e->b[0])), half_c = e->b[1] / (2 * half_s);
    cc = half_c * half_c, ss = half_s * half_s;
    w->excess = cc > ss ? ((cc - 1) + ss) : ((ss - 1) + cc);
    w->less_low = isogi_sh__product_rest(half_s, half_s, ss), w->more_low = isogi_sh__product_rest(half_c, half_c, cc);
    w->excess += w->less_low + w->more_low;
    w->less_low = 2 * (w->less_low - ss * w->excess);
    w->more_low = 2 * (w->more_low - cc * w->excess);
    isogi_sh__powers(w->a, order, e->a[0], e->a[1]);
    isogi_sh__powers(w->c, order, e->c[0], e->c[1]);
    isogi_sh__exact_powers(w->cosine, 2 * order, half_c);
    isogi_sh__exact_powers(w->sine, 2 * order, -half_s);
    w->less = 2 * ss;
    w->more = 2 * cc;
    for (l = 1; l < order; l++) {
        double a = sqrt((double)(4 * l * l - 1)) / (double)l;
        w->zonal[l][0] = a;
        w->zonal[l][1] = -a / before;
        before = a;
    }
}

/* The 2x2 block of rows (cos, sin) n and columns (cos, sin) m of degree l, from A = d and B = (-1)^m' d of the other sign:
   Z(a) diag(A + B, A - B) Z(c) with p = n a + m c, q = n a - m c. */
ISOGI_SH__INLINE void isogi_sh__put_block(const isogi_sh__blocks *out, int at, int l, int n, int m, double a, double b, const double p[2],
                                          const double q[2]) {
    int width = 2 * l + 1, plus = at + width * (l + m) + l, minus = at + width * (l - m) + l;
    isogi_sh__put(out, plus + n, a * p[0] + b * q[0]);
    isogi_sh__put(out, minus + n, b * q[1] - a * p[1]);
    isogi_sh__put(out, plus - n, a * p[1] + b * q[1]);
    isogi_sh__put(out, minus - n, a * p[0] - b * q[0]);
}

ISOGI_SH__INLINE void isogi_sh__turn_product(double p[2], const double a[2], const double c[2], double sign) {
    p[0] = a[0] * c[0] - sign * a[1] * c[1];
    p[1] = a[1] * c[0] + sign * a[0] * c[1];
}

/* Entries (n, m) and (m, n) of all degrees, n <= m, m > 0, by the recursion over l with n and m fixed. With a and b as in the table,
   F = a_m a_n / (l (2l+3)), S = b_m b_n (l+1) (2l-1) / (l (2l+3)) and k = F (l(l+1) cos b - n m) - 1 - S it is
       d_{l+1} - d_l = S (d_l - d_{l-1}) + k d_l,
   which keeps its digits where cos b is near 1: there, for n = m, k is -F l(l+1) (1 - cos b). For the d of the other sign and cos b
   near -1 the same holds of (-1)^l d with 1 + cos b. */
ISOGI_SH__INLINE void isogi_sh__wigner_pair(const isogi_sh__blocks *out, int order, int n, int m, const isogi_sh__wigner *w) {
    const double *fm = isogi_sh__table(m) + 1, *fn = n ? isogi_sh__table(n) + 1 + 2 * (m - n) : w->zonal[m + 1];
    double start = fabs(isogi_sh__turn_f64[m * (m + 1) * (m + 2) / 6 - 1 + n * (m + 1) - n * (n - 1) / 2 + m - n]) *
                   (n ? 0.5 : 0.70710678118654752440);
    double p[2], q[2], p_across[2], q_across[2], a_step = 0, b_step = 0, a, b, sign = n & 1 ? -1 : 1, flip = (m + n) & 1 ? -1 : 1;
    int l, at = m * (4 * m * m - 1) / 3;
    start *= (double)((int32_t)1 << m) * (1 - (double)m * w->excess);
    a = start * w->cosine[m + n] * w->sine[m - n];
    b = start * w->cosine[m - n] * w->sine[m + n];
    isogi_sh__turn_product(p, w->a[n], w->c[m], 1);
    isogi_sh__turn_product(q, w->a[n], w->c[m], -1);
    isogi_sh__turn_product(p_across, w->a[m], w->c[n], 1);
    isogi_sh__turn_product(q_across, w->a[m], w->c[n], -1);
    for (l = m;; l++) {
        int width = 2 * l + 1, centre = at + width * l + l;
        double first, second, square, k;
        if (n == 0) {
            double value = 1.41421356237309504880 * a;
            isogi_sh__put(out, centre + width * m, value * p[0]);
            isogi_sh__put(out, centre - width * m, -value * p[1]);
            isogi_sh__put(out, centre + m, flip * value * p_across[0]);
            isogi_sh__put(out, centre - m, flip * value * p_across[1]);
        } else {
            isogi_sh__put_block(out, at, l, n, m, a, sign * b, p, q);
            if (n != m) isogi_sh__put_block(out, at, l, m, n, flip * a, flip * sign * b, p_across, q_across);
        }
        if (l + 1 == order) break;
        at += width * width;
        square = (double)(l * (l + 1));
        first = fm[0] * fn[0] / (double)(l * (2 * l + 3));
        second = fm[1] * fn[1] * (double)((l + 1) * (2 * l - 1)) / (double)(l * (2 * l + 3));
        k = n == m ? 0 : first * (square - (double)(n * m)) - (1 + second);
        first *= square;
        a_step = second * a_step + ((k - first * w->less_low) - first * w->less) * a;
        b_step = second * b_step + ((k - first * w->more_low) - first * w->more) * b;
        a += a_step, b += b_step, sign = -sign;
        fm += 2, fn += 2;
    }
}

/* n = m = 0: the Legendre polynomial of |cos b|, from the one before, by differences from 1, where cos b is near. */
ISOGI_SH__INLINE double isogi_sh__zonal_entry(const isogi_sh__wigner *w, int l, double *difference, double before) {
    double t = w->less < 1 ? w->less : w->more, low = w->less < 1 ? w->less_low : w->more_low;
    if (l == 0) return 1;
    *difference = isogi_sh__table_f64[3 * l] * *difference + isogi_sh__table_f64[3 * l + 1] * (t * before + low * before);
    return before + *difference;
}

ISOGI_SH__APART void isogi_sh__build_blocks(const isogi_sh__blocks *out, int order, const isogi_sh__euler *e) {
    isogi_sh__wigner w;
    double p = 1, difference = 0;
    int l, m, n, at = 0;
    isogi_sh__wigner_start(&w, order, e);
    for (l = 0; l < order; l++) {
        p = isogi_sh__zonal_entry(&w, l, &difference, p);
        isogi_sh__put(out, at + 2 * l * (l + 1), w.less < 1 || !(l & 1) ? p : -p);
        at += (2 * l + 1) * (2 * l + 1);
    }
    for (m = 1; m < order; m++)
        for (n = 0; n <= m; n++) isogi_sh__wigner_pair(out, order, n, m, &w);
}

#ifdef ISOGI_SH__SIMD
/* ---- matrices in lanes, degrees to ISOGI_SH__TURNS ----
   R = Z(a) Y(b) Z(c) with Y(b) = Z(-90) Y(-90) Z(b) Y(90) Z(90), whose middle is one product of matrices: with the entries W of a quarter
   turn, k = l, l-2, .. between cosines and k = l-1, l-3, .. between sines,
       Y_nm = s_n s_m sum over k of W_nk W_mk t_k,   s = 1, -1, -1, 1, 1, ..
   where t_k is cos kb, or sin kb for odd n and even m, or -sin kb for even n and odd m. Lanes are n; what is past l in them holds other
   numbers of the table, and nothing reads what comes of it. */
typedef double isogi_sh__square[ISOGI_SH__TURNS + 1][ISOGI_SH__TURNS + 1];
typedef struct isogi_sh__build {
    isogi_sh__d8 outer[ISOGI_SH__TURNS + 1][2][4]; /* [m][n / 8]: cos na cos mc, sin na cos mc, cos na sin mc, sin na sin mc,
                                                      times s_n s_m */
    isogi_sh__d8 middle[ISOGI_SH__TURNS + 1][2];   /* t_k for n = 0, 1, .. and even m, and for odd m */
    isogi_sh__square even, odd;                    /* [k][n]: W_nk t_k for even and for odd m */
} isogi_sh__build;

ISOGI_SH__AVX512 static void isogi_sh__build_start(isogi_sh__build *t, int order, const isogi_sh__euler *e) {
    const isogi_sh__d8 sign = {1, -1, -1, 1, 1, -1, -1, 1};
    isogi_sh__multiples a, b, c;
    int h, k, m;
    isogi_sh__multiples_start(&b, e->b[0], e->b[1]);
    isogi_sh__multiples_start(&c, e->c[0], e->c[1]);
    isogi_sh__multiples_start(&a, e->a[0], e->a[1]);
    for (k = 0; k < order; k++) {
        double cosine = ((const double *)(k & 1 ? &b.odd_c : &b.even_c))[k / 2],
               sine = ((const double *)(k & 1 ? &b.odd_s : &b.even_s))[k / 2];
        const isogi_sh__d8 zero = {0};
        t->middle[k][0] = __builtin_shufflevector(zero + cosine, zero + sine, 0, 9, 2, 11, 4, 13, 6, 15);
        t->middle[k][1] = __builtin_shufflevector(zero - sine, zero + cosine, 0, 9, 2, 11, 4, 13, 6, 15);
    }
    for (h = 0; 8 * h < order; h++) {
        isogi_sh__d8 ca = sign * ISOGI_SH__MERGE(a.even_c, a.odd_c, h), sa = sign * ISOGI_SH__MERGE(a.even_s, a.odd_s, h);
        for (m = 0; m < order; m++) {
            double cosine = ((const double *)(m & 1 ? &c.odd_c : &c.even_c))[m / 2],
                   sine = ((const double *)(m & 1 ? &c.odd_s : &c.even_s))[m / 2];
            isogi_sh__d8 *o = t->outer[m][h];
            if ((m + 1) & 2) cosine = -cosine, sine = -sine;
            o[0] = ca * cosine, o[1] = sa * cosine, o[2] = ca * sine, o[3] = sa * sine;
        }
    }
}

/* Columns m to m + 3 and -m to -m - 3 of degree l, rows -7 to 7 or (2 halves) -15 to 15. Row -0 is row 0, which comes last. */
ISOGI_SH__INLINE __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq"))) void
isogi_sh__build_columns(double *out, int l, int m, int halves, const isogi_sh__build *t) {
    const double *table = isogi_sh__turn_columns_f64 + l * (l + 1) * (2 * l + 1) / 6 - 1 + m / 2, *w;
    const isogi_sh__d8 zero = {0};
    isogi_sh__d8 y[4][2][2], v;
    int i, h, k, sines, beyond = l < 8 * halves - 1 ? 8 * halves - 1 - l : 0;
    double *plus = out + (2 * l + 1) * (l + m) + l, *minus = out + (2 * l + 1) * (l - m) + l;
    ISOGI_SH__UNROLL
    for (sines = 0; sines < 2; sines++) {
        ISOGI_SH__UNROLL
        for (i = 0; i < 4; i++) y[i][sines][0] = y[i][sines][1] = zero;
        for (k = (l + sines) & 1, w = table + k * (l + 1); k <= l; k += 2, w += 2 * (l + 1)) {
            ISOGI_SH__UNROLL
            for (i = 0; i < 4; i++) {
                isogi_sh__d8 w_mk = isogi_sh__eval_d8_splat(w[(i & 1 ? l / 2 + 1 : 0) + i / 2]);
                ISOGI_SH__UNROLL
                for (h = 0; h < halves; h++)
                    y[i][sines][h] = ISOGI_SH__FMA_D8(*(const isogi_sh__d8 *)((i & 1 ? t->odd : t->even)[k] + 8 * h), w_mk, y[i][sines][h]);
            }
        }
    }
    ISOGI_SH__UNROLL
    for (i = 0; i < 4; i++, plus += 2 * l + 1, minus -= 2 * l + 1) {
        if (m + i > l) break;
        ISOGI_SH__UNROLL
        for (h = halves - 1; h >= 0; h--) {
            const __mmask8 up = (__mmask8)(h == halves - 1 ? 255u >> beyond : 255u),
                           down = (__mmask8)(h == halves - 1 ? 255u << beyond : 255u);
            const isogi_sh__d8 *o = t->outer[m + i][h], c = y[i][0][h], s = y[i][1][h];
            v = ISOGI_SH__FMA_D8(o[1], c, o[2] * s);
            _mm512_mask_storeu_pd(plus - 8 * h - 7, down, (__m512d)__builtin_shufflevector(v, v, 7, 6, 5, 4, 3, 2, 1, 0));
            _mm512_mask_storeu_pd(plus + 8 * h, up, (__m512d)ISOGI_SH__FMA_D8(o[0], c, -(o[3] * s)));
            if (m + i == 0) continue;
            v = ISOGI_SH__FMA_D8(o[0], s, -(o[3] * c));
            _mm512_mask_storeu_pd(minus - 8 * h - 7, down, (__m512d)__builtin_shufflevector(v, v, 7, 6, 5, 4, 3, 2, 1, 0));
            _mm512_mask_storeu_pd(minus + 8 * h, up, (__m512d)ISOGI_SH__FMA_D8(-o[2], c, -(o[1] * s)));
        }
    }
}

ISOGI_SH__AVX512 static void isogi_sh__build_degree(double *out, int l, isogi_sh__build *t) {
    const double *w = isogi_sh__turn_columns_f64 + l * (l + 1) * (2 * l + 1) / 6 - 1;
    int k, m, h;
    for (k = 0; k <= l; k++, w += l + 1) {
        isogi_sh__d8 even = *(const isogi_sh__d8 *)w, odd = *(const isogi_sh__d8 *)(w + l / 2 + 1);
        for (h = 0; 8 * h <= l; h++) {
            isogi_sh__d8 v = ISOGI_SH__MERGE(even, odd, h);
            *(isogi_sh__d8 *)(t->even[k] + 8 * h) = v * t->middle[k][0], *(isogi_sh__d8 *)(t->odd[k] + 8 * h) = v * t->middle[k][1];
        }
    }
    for (m = 0; m <= l; m += 4) {
        if (l < 8) isogi_sh__build_columns(out, l, m, 1, t);
        else isogi_sh__build_columns(out, l, m, 2, t);
    }
}

ISOGI_SH__AVX512 static void isogi_sh__build_lanes(void *out, int is_double, int order, const isogi_sh__euler *e) {
    double block[(2 * ISOGI_SH__TURNS + 1) * (2 * ISOGI_SH__TURNS + 1) + 7];
    isogi_sh__build t;
    int l, i, at = 0, count = 1;
    isogi_sh__build_start(&t, order, e);
    for (l = 0; l < order; l++, at += count, count += 8 * l) {
        double *degree = is_double ? (double *)out + at : block;
        if (l) isogi_sh__build_degree(degree, l, &t);
        else degree[0] = 1;
        for (i = 0; i < count && !is_double; i += 8)
            isogi_sh__put_rows(out, 0, at + i, *(const isogi_sh__d8 *)(block + i), count - i < 8 ? 255u >> (8 - count + i) : 255u);
    }
}
#endif

/* Columns of the matrices are rotated unit vectors. */
ISOGI_SH__APART void isogi_sh__build_high(void *rotation, int is_double, int order, const isogi_sh__euler *e) {
    double band[2 * ISOGI_SH_MAX_ORDER * ISOGI_SH__TOGETHER], other[2 * ISOGI_SH_MAX_ORDER * ISOGI_SH__TOGETHER];
    isogi_sh__turns turns;
    size_t at = 0;
    int l, i, k, first;
    isogi_sh__turns_start(&turns, order, e);
    for (l = 0; l < order; l++) {
        int width = 2 * l + 1;
        isogi_sh__quarter_turn_start(&turns.quarter, l);
        for (first = 0; first < width; first += ISOGI_SH__TOGETHER) {
            int some = width - first < ISOGI_SH__TOGETHER ? width - first : ISOGI_SH__TOGETHER;
            for (i = 0; i < some * width; i++) band[i] = 0;
            for (k = 0; k < some; k++) band[some * (first + k) + k] = 1;
            isogi_sh__rotate_band(band, other, l, some, &turns);
            for (k = 0; k < some; k++)
                for (i = 0; i < width; i++) {
                    size_t j = at + (size_t)(width * (first + k) + i);
                    if (is_double) ((double *)rotation)[j] = band[some * i + k];
                    else ((float *)rotation)[j] = (float)band[some * i + k];
                }
        }
        at += (size_t)(width * width);
    }
}

/* Each way in a function of its own, so that their stacks do not add up. */
static void isogi_sh__rotation_build(void *rotation, int is_double, int order, const isogi_sh__euler *e) {
    if (order > ISOGI_SH__TURNS + 1) isogi_sh__build_high(rotation, is_double, order, e);
#ifdef ISOGI_SH__SIMD
    else if (order > 1 && isogi_sh__level() > 1) isogi_sh__build_lanes(rotation, is_double, order, e);
#endif
    else {
        isogi_sh__blocks out;
        out.data = rotation, out.is_double = is_double;
        isogi_sh__build_blocks(&out, order, e);
    }
}

ISOGI_API isogi_result isogi_sh_rotation_build_f64(double *rotation, int order, const double m[9]) {
    isogi_sh__euler e;
    if (!rotation || !m || !isogi_sh__order_ok(order) || isogi_sh__euler_angles(&e, m) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotation_build(rotation, 1, order, &e);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_rotation_build(float *rotation, int order, const float m[9]) {
    isogi_sh__euler e;
    double r[9];
    int i;
    if (!rotation || !m || !isogi_sh__order_ok(order)) return ISOGI_INVALID;
    for (i = 0; i < 9; i++) r[i] = (double)m[i];
    if (isogi_sh__euler_angles(&e, r) != ISOGI_OK) return ISOGI_INVALID;
    isogi_sh__rotation_build(rotation, 0, order, &e);
    return ISOGI_OK;
}

#ifdef ISOGI_SH__SIMD
/* One channel of order 5: columns times numbers. What is loaded and stored past a band is overwritten by the next one. Loads are what
   this waits for, so the numbers are spread from registers, four a load: the empty assembly keeps the compiler from fetching each by
   itself. Degree 4 has nine rows: of an even column the first eight are loaded, of an odd one the last eight, so that the ninth rows of
   two neighbours stand together. Degrees 0 and 1 share four lanes. */
#define ISOGI_SH__COLUMN(sum, offset, x) sum = ISOGI_SH__FMA_F8(*(const isogi_sh__f8 *)(rotation + (offset)), x, sum)
#define ISOGI_SH__FOUR(i) four = ISOGI_SH__TWICE_F4(in + (i)); __asm__("" : "+x"(four))
#define ISOGI_SH__SPREAD(i) __builtin_shufflevector(four, four, i, i, i, i, i + 4, i + 4, i + 4, i + 4)
#define ISOGI_SH__OF_FOUR(i, sum, offset) ISOGI_SH__COLUMN(sum, offset, ISOGI_SH__SPREAD(i))
#define ISOGI_SH__NINTH(i, j) (isogi_sh__two_pairs(rotation + (i), rotation + (j)) * __builtin_shufflevector(four, four, 0, 1, 2, 3))
ISOGI_SH__AVX2 ISOGI_SH__INLINE isogi_sh__f4 isogi_sh__two_pairs(const float *a, const float *b) {
    isogi_sh__d2 pairs = {*(const isogi_sh__two *)a, *(const isogi_sh__two *)b};
    return (isogi_sh__f4)pairs;
}

ISOGI_SH__AVX2 static isogi_result isogi_sh__apply_order5(float *out, const float *in, const float *rotation) {
    isogi_sh__f8 zero = {0}, b = zero, c = zero, even, odd = zero, x = ISOGI_SH__SPLAT_F8(in[24]), four;
    isogi_sh__f4 none = {0}, a = *(const isogi_sh__f4 *)in, ninth, rest;
    ISOGI_SH__FOUR(16);
    ninth = ISOGI_SH__NINTH(92, 110);
    even = ISOGI_SH__SPREAD(0) * *(const isogi_sh__f8 *)(rotation + 84);
    ISOGI_SH__OF_FOUR(1, odd, 94);
    ISOGI_SH__OF_FOUR(2, even, 102);
    ISOGI_SH__OF_FOUR(3, odd, 112);
    ISOGI_SH__FOUR(20);
    ninth += ISOGI_SH__NINTH(128, 146);
    ISOGI_SH__OF_FOUR(0, even, 120);
    ISOGI_SH__OF_FOUR(1, odd, 130);
    ISOGI_SH__OF_FOUR(2, even, 138);
    ISOGI_SH__OF_FOUR(3, odd, 148);
    ISOGI_SH__COLUMN(even, 156, x);
    ISOGI_SH__FOUR(8);
    ISOGI_SH__OF_FOUR(0, b, 30);
    ISOGI_SH__OF_FOUR(1, c, 35);
    ISOGI_SH__OF_FOUR(2, c, 42);
    ISOGI_SH__OF_FOUR(3, c, 49);
    ISOGI_SH__FOUR(4);
    ISOGI_SH__OF_FOUR(0, b, 10);
    ISOGI_SH__OF_FOUR(1, b, 15);
    ISOGI_SH__OF_FOUR(2, b, 20);
    ISOGI_SH__OF_FOUR(3, b, 25);
    ISOGI_SH__FOUR(12);
    ISOGI_SH__OF_FOUR(0, c, 56);
    ISOGI_SH__OF_FOUR(1, c, 63);
    ISOGI_SH__OF_FOUR(2, c, 70);
    ISOGI_SH__OF_FOUR(3, c, 77);
    __asm__("" : "+x"(a));
    rest = *(const isogi_sh__f4 *)(rotation + 3) * __builtin_shufflevector(a, a, 2, 2, 2, 2);
    rest += *(const isogi_sh__f4 *)(rotation + 6) * __builtin_shufflevector(a, a, 3, 3, 3, 3);
    a = *(const isogi_sh__f4 *)rotation * __builtin_shufflevector(a, a, 0, 1, 1, 1) + __builtin_shufflevector(none, rest, 0, 5, 6, 7);
    *(isogi_sh__f4 *)out = a;
    *(isogi_sh__f8 *)(out + 4) = b;
    *(isogi_sh__f8 *)(out + 9) = c;
    /* odd: row 8 and rows 1 to 7; ninth: rows 8 and 0 */
    odd = __builtin_shufflevector(odd, odd, 7, 0, 1, 2, 3, 4, 5, 6);
    ninth += __builtin_shufflevector(ninth, ninth, 2, 3, 0, 1);
    __asm__("" : "+x"(odd));
    out[24] = __builtin_fmaf(rotation[164], x[0], ninth[0] + odd[0]);
    ninth = __builtin_shufflevector(ninth, ninth, 1, 1, 3, 3);
    even += (isogi_sh__f8)_mm256_blend_ps((__m256)odd, (__m256)__builtin_shufflevector(ninth, none, 0, 1, 2, 3, 4, 5, 6, 7), 1);
    *(isogi_sh__f8 *)(out + 16) = even;
    return ISOGI_OK;
}
#undef ISOGI_SH__NINTH
#undef ISOGI_SH__SPREAD
#undef ISOGI_SH__COLUMN
#undef ISOGI_SH__OF_FOUR
#undef ISOGI_SH__FOUR

/* `rows` rows of a band, 1 .. 8 or (2 halves) 9 .. 16, for `some` of its channels: columns times numbers, less what is past the rows. */
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__apply_rows(float *out, const float *in, const float *rotation, int width, int rows,
                                                          int channels, int some, int halves) {
    static const int32_t keep[24] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
    const __m256i last = _mm256_loadu_si256((const __m256i *)(const void *)(keep + 8 + 8 * halves - rows));
    isogi_sh__f8 zero = {0}, a[3] = {zero, zero, zero}, b[3] = {zero, zero, zero};
    float sum[3][16];
    int i, j, k;
    for (j = 0; j < width; j++, rotation += width, in += channels) {
        isogi_sh__f8 high = (isogi_sh__f8)_mm256_maskload_ps(rotation + 8 * (halves - 1), last), low = high;
        if (halves > 1) low = (isogi_sh__f8)_mm256_loadu_ps(rotation);
        ISOGI_SH__UNROLL
        for (k = 0; k < some; k++) {
            isogi_sh__f8 x = ISOGI_SH__FROM_F8(in + k);
            a[k] = ISOGI_SH__FMA_F8(low, x, a[k]);
            if (halves > 1) b[k] = ISOGI_SH__FMA_F8(high, x, b[k]);
        }
    }
    ISOGI_SH__UNROLL
    for (k = 0; k < some; k++) {
        *(isogi_sh__f8 *)sum[k] = a[k];
        if (halves > 1) *(isogi_sh__f8 *)(sum[k] + 8) = b[k];
    }
    for (i = 0; i < rows; i++, out += channels) {
        ISOGI_SH__UNROLL
        for (k = 0; k < some; k++) out[k] = sum[k][i];
    }
}

ISOGI_SH__AVX2 static void isogi_sh__apply_band(float *out, const float *in, const float *rotation, int width, int channels) {
    int first, k, rows;
    for (first = 0; first < width; first += rows) {
        rows = width - first < 16 ? width - first : 16;
        for (k = 0; k < channels;) {
            float *to = out + channels * first + k;
            if (channels - k < 3 && rows > 8) isogi_sh__apply_rows(to, in + k, rotation + first, width, rows, channels, 1, 2), k++;
            else if (channels - k < 3) isogi_sh__apply_rows(to, in + k, rotation + first, width, rows, channels, 1, 1), k++;
            else if (rows > 8) isogi_sh__apply_rows(to, in + k, rotation + first, width, rows, channels, 3, 2), k += 3;
            else isogi_sh__apply_rows(to, in + k, rotation + first, width, rows, channels, 3, 1), k += 3;
        }
    }
}
#endif

/* Kept out of the caller, whose fast way would pay for its registers. */
ISOGI_SH__APART isogi_result isogi_sh__rotation_apply(float *out, const float *in, int order, int channels, const float *rotation) {
    int l, i, j, k;
    if (!out || !in || !rotation || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
#ifdef ISOGI_SH__SIMD
    if (isogi_sh__avx2()) {
        for (l = 0; l < order; rotation += (2 * l + 1) * (2 * l + 1), l++)
            isogi_sh__apply_band(out + channels * l * l, in + channels * l * l, rotation, 2 * l + 1, channels);
        return ISOGI_OK;
    }
#endif
    for (l = 0; l < order; l++) {
        int width = 2 * l + 1, base = channels * l * l;
        for (i = 0; i < width * channels; i++) out[base + i] = 0;
        for (j = 0; j < width; j++, rotation += width)
            for (i = 0; i < width; i++)
                for (k = 0; k < channels; k++) out[base + channels * i + k] += rotation[i] * in[base + channels * j + k];
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_rotation_apply(float *out, const float *in, int order, int channels, const float *rotation) {
#ifdef ISOGI_SH__SIMD
    if (order == 5 && channels == 1 && out && in && rotation && isogi_sh__avx2()) return isogi_sh__apply_order5(out, in, rotation);
#endif
    return isogi_sh__rotation_apply(out, in, order, channels, rotation);
}

ISOGI_API isogi_result isogi_sh_rotation_apply_f64(double *out, const double *in, int order, int channels, const double *rotation) {
    int l, i, j, k;
    if (!out || !in || !rotation || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (l = 0; l < order; l++) {
        int width = 2 * l + 1, base = channels * l * l;
        for (i = 0; i < width * channels; i++) out[base + i] = 0;
        for (j = 0; j < width; j++, rotation += width)
            for (i = 0; i < width; i++)
                for (k = 0; k < channels; k++) out[base + channels * i + k] += rotation[i] * in[base + channels * j + k];
    }
    return ISOGI_OK;
}

static void isogi_sh__quaternion_matrix(double m[9], double w, double x, double y, double z) {
    m[0] = 1 - 2 * (y * y + z * z), m[1] = 2 * (x * y - w * z), m[2] = 2 * (x * z + w * y);
    m[3] = 2 * (x * y + w * z), m[4] = 1 - 2 * (x * x + z * z), m[5] = 2 * (y * z - w * x);
    m[6] = 2 * (x * z - w * y), m[7] = 2 * (y * z + w * x), m[8] = 1 - 2 * (x * x + y * y);
}

ISOGI_API isogi_result isogi_sh_matrix_from_quaternion_f64(double m[9], const double quaternion[4]) {
    double q[4], square = 0, largest = 0, length;
    int i, exponent;
    if (!m || !quaternion) return ISOGI_INVALID;
    for (i = 0; i < 4; i++) {
        if (!isogi_sh__finite_f64(quaternion[i])) return ISOGI_INVALID;
        if (fabs(quaternion[i]) > largest) largest = fabs(quaternion[i]);
    }
    if (largest <= 0) return ISOGI_INVALID;
    frexp(largest, &exponent); /* squares of the numbers as they are might leave the range */
    for (i = 0; i < 4; i++) q[i] = ldexp(quaternion[i], -exponent), square += q[i] * q[i];
    length = sqrt(square);
    isogi_sh__quaternion_matrix(m, q[0] / length, q[1] / length, q[2] / length, q[3] / length);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_matrix_from_axis_angle_f64(double m[9], const double axis[3], double angle) {
    isogi_sh__unit u;
    double s;
    int i;
    if (!m || !axis || !isogi_sh__finite_f64(angle)) return ISOGI_INVALID;
    for (i = 0; i < 3; i++)
        if (!isogi_sh__finite_f64(axis[i])) return ISOGI_INVALID;
    if (!(axis[0] > 0 || axis[0] < 0 || axis[1] > 0 || axis[1] < 0 || axis[2] > 0 || axis[2] < 0)) return ISOGI_INVALID;
    u = isogi_sh__normalise(axis[0], axis[1], axis[2]);
    s = sin(angle / 2);
    isogi_sh__quaternion_matrix(m, cos(angle / 2), s * u.x, s * u.y, s * u.z);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_matrix_from_euler_zyz_f64(double m[9], double a, double b, double c) {
    double ca, sa, cb, sb, cc, sc;
    if (!m || !isogi_sh__finite_f64(a) || !isogi_sh__finite_f64(b) || !isogi_sh__finite_f64(c)) return ISOGI_INVALID;
    ca = cos(a), sa = sin(a), cb = cos(b), sb = sin(b), cc = cos(c), sc = sin(c);
    m[0] = ca * cb * cc - sa * sc, m[1] = -ca * cb * sc - sa * cc, m[2] = ca * sb;
    m[3] = sa * cb * cc + ca * sc, m[4] = -sa * cb * sc + ca * cc, m[5] = sa * sb;
    m[6] = -sb * cc, m[7] = sb * sc, m[8] = cb;
    return ISOGI_OK;
}

/* m as floats, if it was made */
static isogi_result isogi_sh__rounded_matrix(float m[9], const double wide[9], isogi_result result) {
    int i;
    for (i = 0; i < 9 && result == ISOGI_OK; i++) m[i] = (float)wide[i];
    return result;
}

ISOGI_API isogi_result isogi_sh_matrix_from_quaternion(float m[9], const float quaternion[4]) {
    double wide[9], q[4];
    int i;
    if (!m || !quaternion) return ISOGI_INVALID;
    for (i = 0; i < 4; i++) q[i] = (double)quaternion[i];
    return isogi_sh__rounded_matrix(m, wide, isogi_sh_matrix_from_quaternion_f64(wide, q));
}

ISOGI_API isogi_result isogi_sh_matrix_from_axis_angle(float m[9], const float axis[3], double angle) {
    double wide[9], v[3];
    int i;
    if (!m || !axis) return ISOGI_INVALID;
    for (i = 0; i < 3; i++) v[i] = (double)axis[i];
    return isogi_sh__rounded_matrix(m, wide, isogi_sh_matrix_from_axis_angle_f64(wide, v, angle));
}

ISOGI_API isogi_result isogi_sh_matrix_from_euler_zyz(float m[9], double a, double b, double c) {
    double wide[9];
    if (!m) return ISOGI_INVALID;
    return isogi_sh__rounded_matrix(m, wide, isogi_sh_matrix_from_euler_zyz_f64(wide, a, b, c));
}

/* Y_lm is even or odd in each coordinate: in z as l + m, in y as m < 0, in x as the two together. */
ISOGI_API isogi_result isogi_sh_mirror(float *out, const float *in, int order, int channels, int axis) {
    int l, m, k;
    if (!out || !in || !isogi_sh__shape_ok(order, channels) || axis < 0 || axis > 2) return ISOGI_INVALID;
    for (l = 0; l < order; l++)
        for (m = -l; m <= l; m++) {
            int odd_x = (m < 0) != (m & 1), odd = axis == 2 ? (l + m) & 1 : axis == 1 ? m < 0 : odd_x;
            for (k = 0; k < channels; k++) {
                int i = channels * (l * (l + 1) + m) + k;
                out[i] = odd ? -in[i] : in[i];
            }
        }
    return ISOGI_OK;
}

/* ==== algebra ======================================================================================================== */

ISOGI_API double isogi_sh_dot(const float *a, const float *b, int order) {
    double sum = 0;
    int i;
    if (!a || !b || !isogi_sh__order_ok(order)) return 0;
    for (i = 0; i < order * order; i++) sum += (double)a[i] * (double)b[i];
    return sum;
}

/* factor[l] for every coefficient of degree l */
static void isogi_sh__scale_bands(float *out, const float *in, int order, int channels, const double *factor) {
    int l, i;
    for (l = 0; l < order; l++)
        for (i = channels * l * l; i < channels * (l + 1) * (l + 1); i++) out[i] = (float)(factor[l] * (double)in[i]);
}

ISOGI_API isogi_result isogi_sh_add(float *out, const float *a, const float *b, int order, int channels) {
    int i;
    if (!out || !a || !b || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (i = 0; i < channels * order * order; i++) out[i] = a[i] + b[i];
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_scale(float *out, const float *a, float factor, int order, int channels) {
    int i;
    if (!out || !a || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (i = 0; i < channels * order * order; i++) out[i] = factor * a[i];
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_lerp(float *out, const float *a, const float *b, float t, int order, int channels) {
    int i;
    if (!out || !a || !b || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (i = 0; i < channels * order * order; i++) out[i] = (1 - t) * a[i] + t * b[i];
    return ISOGI_OK;
}

/* sqrt(4 pi / (2l+1)) */
static double isogi_sh__zonal_factor(int l) { return sqrt(4 * ISOGI_SH__PI / (double)(2 * l + 1)); }

ISOGI_API isogi_result isogi_sh_convolve(float *out, const float *in, int order, int channels, const float *zonal) {
    double factor[ISOGI_SH_MAX_ORDER];
    int l;
    if (!out || !in || !zonal || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (l = 0; l < order; l++) factor[l] = isogi_sh__zonal_factor(l) * (double)zonal[l];
    isogi_sh__scale_bands(out, in, order, channels, factor);
    return ISOGI_OK;
}

/* A_0 = pi, A_1 = 2 pi / 3, A_{l+2} = -A_l (l-1) / (l+4) for even l, 0 for other odd l. */
static void isogi_sh__cosine_factors(double *factor, int order) {
    double even = ISOGI_SH__PI;
    int l;
    for (l = 0; l < order; l++) {
        factor[l] = l == 1 ? 2 * ISOGI_SH__PI / 3 : l & 1 ? 0 : even;
        if (!(l & 1)) even *= -(double)(l - 1) / (double)(l + 4);
    }
}

ISOGI_API isogi_result isogi_sh_convolve_cosine(float *out, const float *in, int order, int channels) {
    double factor[ISOGI_SH_MAX_ORDER];
    if (!out || !in || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    isogi_sh__cosine_factors(factor, order);
    isogi_sh__scale_bands(out, in, order, channels, factor);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_cosine_zonal(float *zonal, int order) {
    double factor[ISOGI_SH_MAX_ORDER];
    int l;
    if (!zonal || !isogi_sh__order_ok(order)) return ISOGI_INVALID;
    isogi_sh__cosine_factors(factor, order);
    for (l = 0; l < order; l++) zonal[l] = (float)(factor[l] / isogi_sh__zonal_factor(l));
    return ISOGI_OK;
}

static void isogi_sh__zonal_low(float *c, int order, const float *zonal, const float d[3]) {
    static const double factor[ISOGI_SH__UNROLLED_ORDER] = {3.5449077018110321, 2.0466534158929770, 1.5853309190424045,
                                                            1.3398491713813586, 1.1816359006036774};
    double y[ISOGI_SH__UNROLLED_ORDER * ISOGI_SH__UNROLLED_ORDER], scale[ISOGI_SH__UNROLLED_ORDER];
    int l, i;
    isogi_sh__eval_low(y, order, isogi_sh__normalise_f32(d), 0);
    for (l = 0; l < order; l++) scale[l] = factor[l] * (double)zonal[l]; /* c may be where zonal is */
    for (l = i = 0; l < order; l++)
        for (; i < (l + 1) * (l + 1); i++) c[i] = (float)(scale[l] * y[i]);
}

/* Kept out of the caller, whose fast way would pay for its registers. */
ISOGI_SH__APART isogi_result isogi_sh__zonal_to_direction(float *c, int order, const float *zonal, const float direction[3]) {
    double scale[ISOGI_SH_MAX_ORDER], one = 1;
    int l, i;
    if (!c || !zonal || !direction || !isogi_sh__order_ok(order)) return ISOGI_INVALID;
    if (order <= ISOGI_SH__UNROLLED_ORDER) {
        isogi_sh__zonal_low(c, order, zonal, direction);
        return ISOGI_OK;
    }
    for (l = 0; l < order; l++) scale[l] = isogi_sh__zonal_factor(l) * (double)zonal[l];
    for (i = 0; i < order * order; i++) c[i] = 0;
    isogi_sh__add_lobe(c, order, 1, scale, isogi_sh__normalise((double)direction[0], (double)direction[1], (double)direction[2]), &one);
    return ISOGI_OK;
}

#ifdef ISOGI_SH__SIMD
/* Order 5 in float, for directions of length 1 to 1e-3, others as above: c[i] is a lobe's factor times a polynomial of z^2 and of
   ww = x^2 + y^2 (of z alone its terms cancel near poles), times z where l - m is odd, times cosine or sine of m. Here x, y, z, cm, sm
   stand in all lanes, and blends pick them. Constant terms, those of ww, of zz and of zz ww: a, b and d by degree. */
ISOGI_SH__AVX2 static isogi_result isogi_sh__zonal_order5_f8(float *c, const float *zonal, const float d[3]) {
    const isogi_sh__f8 one = {1, 1, 1, 1, 1, 1, 1, 1};
    const isogi_sh__f8 a0 = {1.0f, 1.0f, 1.0f, 1.0f, 0.866025404f, 1.73205081f, 0, 1.73205081f};
    const isogi_sh__f8 a1 = {0, 0, 0, 0, 0, 0, -0.5f, 0};
    const isogi_sh__f8 a2 = {0, 0, 0, 0, 0, 0, 1.0f, 0};
    const isogi_sh__f8 b0 = {0.866025404f, 0.790569415f, 1.93649167f, 0, 0, 0, 1.93649167f, 0.790569415f};
    const isogi_sh__f8 b1 = {0, 0, 0, -0.612372436f, -1.5f, -0.612372436f, 0, 0};
    const isogi_sh__f8 b2 = {0, 0, 0, 2.44948974f, 1.0f, 2.44948974f, 0, 0};
    const isogi_sh__f8 d0 = {0.739509973f, 2.09165007f, 0, 0, 0, 0, 0, 2.09165007f};
    const isogi_sh__f8 d1 = {0, 0, -0.559016994f, -2.37170825f, 0.375f, -2.37170825f, -0.559016994f, 0};
    const isogi_sh__f8 d2 = {0, 0, 3.35410197f, 3.16227766f, 1.0f, 3.16227766f, 3.35410197f, 0};
    const isogi_sh__f8 d3 = {0, 0, 0, 0, -4.375f, 0, 0, 0};
    isogi_sh__f8 x = ISOGI_SH__FROM_F8(d), y = ISOGI_SH__FROM_F8(d + 1), z = ISOGI_SH__FROM_F8(d + 2), scale;
    isogi_sh__f8 e = ISOGI_SH__FMA_F8(x, x, ISOGI_SH__FMA_F8(y, y, ISOGI_SH__FMA_F8(z, z, -one)));
    isogi_sh__f8 c2, s2, c3, s3, c4, s4, zz, ww, v, w;
    isogi_sh__f8 l2 = ISOGI_SH__FROM_F8(zonal + 2), l3 = ISOGI_SH__FROM_F8(zonal + 3), l4 = ISOGI_SH__FROM_F8(zonal + 4);
    if (!isogi_sh__below(e[0], 1e-3f)) return isogi_sh__zonal_to_direction(c, 5, zonal, d);
    scale = e * ISOGI_SH__FMA_F8(e, one * 0.375f, one * -0.5f);
    x = ISOGI_SH__FMA_F8(x, scale, x), y = ISOGI_SH__FMA_F8(y, scale, y), z = ISOGI_SH__FMA_F8(z, scale, z);
    zz = z * z, ww = ISOGI_SH__FMA_F8(x, x, y * y);
    c2 = (x - y) * (x + y), s2 = (x + x) * y;
    c3 = ISOGI_SH__FMA_F8(x, c2, -(y * s2)), s3 = ISOGI_SH__FMA_F8(x, s2, y * c2), c4 = ISOGI_SH__FMA_F8(c2, c2, -(s2 * s2)),
    s4 = (c2 + c2) * s2;
    /* degrees 0, 1 and 2 but for its last: 1; y 1 x; s2 y 1 x */
    w = __builtin_shufflevector(one, x, 0, 1, 2, 11, 4, 5, 6, 15), w = __builtin_shufflevector(w, y, 0, 9, 2, 3, 4, 13, 6, 7);
    w = __builtin_shufflevector(w, s2, 0, 1, 2, 3, 12, 5, 6, 7) *
        ISOGI_SH__FMA_F8(a2, zz, ISOGI_SH__FMA_F8(a1, ww, a0)) * __builtin_shufflevector(one, z, 0, 1, 10, 3, 4, 13, 6, 15);
    v = __builtin_shufflevector(ISOGI_SH__FROM_F8(zonal + 1), l2, 0, 1, 2, 3, 12, 13, 14, 15),
    v = __builtin_shufflevector(v, ISOGI_SH__FROM_F8(zonal), 8, 1, 2, 3, 4, 5, 6, 7);
    *(isogi_sh__f8 *)c = w * v;
    /* c2; s3 s2 y 1 x c2 c3, and from s4 on */
    v = __builtin_shufflevector(one, x, 0, 1, 2, 3, 4, 13, 6, 7), v = __builtin_shufflevector(v, y, 0, 1, 2, 11, 4, 5, 6, 7);
    v = __builtin_shufflevector(v, c2, 8, 1, 2, 3, 4, 5, 14, 7), v = __builtin_shufflevector(v, s2, 0, 1, 10, 3, 4, 5, 6, 7);
    v = __builtin_shufflevector(v, c3, 0, 1, 2, 3, 4, 5, 6, 15), v = __builtin_shufflevector(v, s3, 0, 9, 2, 3, 4, 5, 6, 7);
    w = v * ISOGI_SH__FMA_F8(b2, zz, ISOGI_SH__FMA_F8(b1, ww, b0)) * __builtin_shufflevector(one, z, 0, 1, 10, 3, 12, 5, 14, 7);
    *(isogi_sh__f8 *)(c + 8) = w * __builtin_shufflevector(l3, l2, 8, 1, 2, 3, 4, 5, 6, 7);
    w = ISOGI_SH__FMA_F8(ISOGI_SH__FMA_F8(d3, ww, d2), zz, ISOGI_SH__FMA_F8(d1, ww, d0)) *
        __builtin_shufflevector(one, z, 0, 9, 2, 11, 4, 13, 6, 15);
    *(isogi_sh__f8 *)(c + 16) = __builtin_shufflevector(v, s4, 8, 1, 2, 3, 4, 5, 6, 7) * w * l4;
    c[24] = 0.739509973f * c4[0] * l4[0];
    return ISOGI_OK;
}
#endif

ISOGI_API isogi_result isogi_sh_zonal_to_direction(float *c, int order, const float *zonal, const float direction[3]) {
#ifdef ISOGI_SH__SIMD
    if (order == 5 && c && zonal && direction && isogi_sh__avx2()) return isogi_sh__zonal_order5_f8(c, zonal, direction);
#endif
    return isogi_sh__zonal_to_direction(c, order, zonal, direction);
}

static double isogi_sh__window(isogi_sh_window_kind kind, double l, double width) {
    double x = l / width;
    if (l <= 0) return 1;
    if (kind == ISOGI_SH_GAUSS) return exp(-0.69314718055994530942 * 4 * x * x);
    if (x >= 1) return 0;
    return kind == ISOGI_SH_HANN ? 0.5 * (1 + cos(ISOGI_SH__PI * x)) : sin(ISOGI_SH__PI * x) / (ISOGI_SH__PI * x);
}

static int isogi_sh__window_ok(isogi_sh_window_kind kind) { return (int)kind >= (int)ISOGI_SH_HANN && (int)kind <= (int)ISOGI_SH_GAUSS; }

ISOGI_API isogi_result isogi_sh_window(float *out, const float *in, int order, int channels, isogi_sh_window_kind kind, double width) {
    double factor[ISOGI_SH_MAX_ORDER];
    int l;
    if (!out || !in || !isogi_sh__shape_ok(order, channels) || !isogi_sh__window_ok(kind)) return ISOGI_INVALID;
    if (!isogi_sh__finite_f64(width) || width <= 0) return ISOGI_INVALID;
    for (l = 0; l < order; l++) factor[l] = isogi_sh__window(kind, (double)l, width);
    isogi_sh__scale_bands(out, in, order, channels, factor);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_band_energy(double *energy, const float *c, int order, int channels) {
    int l, i;
    if (!energy || !c || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    for (l = 0; l < order; l++) {
        energy[l] = 0;
        for (i = channels * l * l; i < channels * (l + 1) * (l + 1); i++) energy[l] += (double)c[i] * (double)c[i];
    }
    return ISOGI_OK;
}

/* ==== conventions ==================================================================================================== */

static int isogi_sh__convention_ok(isogi_sh_convention v) {
    return (int)v.normalisation >= (int)ISOGI_SH_ORTHONORMAL && (int)v.normalisation <= (int)ISOGI_SH_SN3D &&
           (int)v.ordering >= (int)ISOGI_SH_ACN && (int)v.ordering <= (int)ISOGI_SH_FUMA;
}

static int isogi_sh__position(isogi_sh_ordering ordering, int l, int m) {
    int away = m < 0 ? -m : m;
    if (ordering == ISOGI_SH_ACN) return l * l + l + m;
    if (ordering == ISOGI_SH_SID || (ordering == ISOGI_SH_FUMA && l == 1)) return l * l + 2 * (l - away) + (m < 0 ? 1 : 0);
    return l * l + (m > 0 ? 2 * m - 1 : 2 * away);
}

/* its basis function over ours */
static double isogi_sh__relative(isogi_sh_convention v, int l, int m) {
    double factor = v.normalisation == ISOGI_SH_ORTHONORMAL ? 1
                    : v.normalisation == ISOGI_SH_N3D       ? sqrt(4 * ISOGI_SH__PI)
                                                            : isogi_sh__zonal_factor(l);
    return v.condon_shortley && (m & 1) ? -factor : factor;
}

ISOGI_API isogi_result isogi_sh_convert(float *out, const float *in, int order, int channels, isogi_sh_convention from,
                                        isogi_sh_convention to) {
    int l, m, k;
    if (!out || !in || !isogi_sh__shape_ok(order, channels)) return ISOGI_INVALID;
    if (!isogi_sh__convention_ok(from) || !isogi_sh__convention_ok(to)) return ISOGI_INVALID;
    for (l = 0; l < order; l++)
        for (m = -l; m <= l; m++) {
            double factor = isogi_sh__relative(from, l, m) / isogi_sh__relative(to, l, m);
            const float *source = in + channels * isogi_sh__position(from.ordering, l, m);
            float *target = out + channels * isogi_sh__position(to.ordering, l, m);
            for (k = 0; k < channels; k++) target[k] = (float)(factor * (double)source[k]);
        }
    return ISOGI_OK;
}

/* ==== quadrature, products ============================================================================================ */

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

/* Fourier series of an expansion along the circle of latitude z: f = sum over m of c[m] cos m p + s[m] sin m p */
static void isogi_sh__latitude(double *c, double *s, const float *f, int order, double z, double sine) {
    double q[ISOGI_SH_MAX_ORDER], diagonal = 0, power = 1;
    int l, m;
    for (m = 0; m < order; m++) {
        double a = 0, b = 0;
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, z, 0);
        for (l = m; l < order; l++) a += q[l] * (double)f[l * (l + 1) + m], b += q[l] * (double)f[l * (l + 1) - m];
        c[m] = power * a;
        s[m] = m ? power * b : 0;
        power *= sine;
    }
}

/* Term m of the product of two Fourier series of `order` terms: cosine in p[0], sine in p[1]. */
static void isogi_sh__fourier_product(double p[2], int m, const double a[2][ISOGI_SH_MAX_ORDER], const double b[2][ISOGI_SH_MAX_ORDER],
                                      int order) {
    int i;
    double c = 0, s = 0;
    for (i = 0; i <= m; i++) { /* i + (m-i) */
        double weight = i == 0 || i == m ? 1 : 0.5;
        if (m == 0) weight = 1;
        c += weight * (a[0][i] * b[0][m - i] - a[1][i] * b[1][m - i]);
        s += weight * (a[0][i] * b[1][m - i] + a[1][i] * b[0][m - i]);
    }
    for (i = m == 0 ? 1 : m + 1; i < order; i++) { /* i - (i-m) */
        int j = i - m;
        if (m == 0) c += 0.5 * (a[0][i] * b[0][i] + a[1][i] * b[1][i]);
        else {
            c += 0.5 * (a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[0][j] * b[0][i] + a[1][j] * b[1][i]);
            s += 0.5 * (a[1][i] * b[0][j] - a[0][i] * b[1][j] + a[0][j] * b[1][i] - a[1][j] * b[0][i]);
        }
    }
    p[0] = c, p[1] = s;
}

/* Orders first <= m < end of a product. Its integrand has degree 3 (order - 1) at most: exact with half as many latitudes. */
static void isogi_sh__product(float *out, const float *f, const float *g, int order, int first, int end) {
    double a[2][ISOGI_SH_MAX_ORDER], b[2][ISOGI_SH_MAX_ORDER], q[ISOGI_SH_MAX_ORDER], total[2][ISOGI_SH__GROUP][ISOGI_SH_MAX_ORDER];
    int i, l, m, latitudes = (3 * (order - 1)) / 2 + 1;
    memset(total, 0, sizeof total);
    for (i = 0; i < latitudes; i++) {
        double z, weight, sine, diagonal = 0, power = 1, p[2];
        isogi_sh__gauss_legendre(&z, &weight, i, latitudes);
        sine = sqrt((1 - z) * (1 + z));
        isogi_sh__latitude(a[0], a[1], f, order, z, sine);
        isogi_sh__latitude(b[0], b[1], g, order, z, sine);
        for (m = 0; m < end; m++) {
            diagonal = isogi_sh__next_diagonal(diagonal, m);
            if (m >= first) {
                double scale = weight * power * (m ? ISOGI_SH__PI : 2 * ISOGI_SH__PI);
                isogi_sh__fourier_product(p, m, (const double(*)[ISOGI_SH_MAX_ORDER])a, (const double(*)[ISOGI_SH_MAX_ORDER])b, order);
                isogi_sh__column(q, order, m, diagonal, z, 0);
                for (l = m; l < order; l++)
                    total[0][m - first][l] += scale * q[l] * p[0], total[1][m - first][l] += scale * q[l] * p[1];
            }
            power *= sine;
        }
    }
    for (m = first; m < end; m++)
        for (l = m; l < order; l++) {
            out[l * (l + 1) + m] = (float)total[0][m - first][l];
            if (m) out[l * (l + 1) - m] = (float)total[1][m - first][l];
        }
}

/* Orders 1 and 2: what two linear functions make of degree 2 is left out. */
static void isogi_sh__product_linear(float *out, const float *f, const float *g, int n) {
    double sum = 0, f0 = 0.28209479177387814347 * (double)f[0], g0 = 0.28209479177387814347 * (double)g[0];
    int i;
    for (i = 0; i < n; i++) sum += (double)f[i] * (double)g[i];
    for (i = 1; i < n; i++) out[i] = (float)(f0 * (double)g[i] + (double)f[i] * g0);
    out[0] = (float)(0.28209479177387814347 * sum);
}

#ifdef ISOGI_SH__SIMD
/* Orders 3 to 5 with the 7 latitudes that products of order 5 need as lanes: expansions into Fourier series, their product, and back. */
ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__latitudes_f8(isogi_sh__f8 *c, isogi_sh__f8 *s, const float *f, int order) {
    const isogi_sh__f8 *q = (const isogi_sh__f8 *)isogi_sh__latitudes_f32;
    isogi_sh__f8 zero = {0};
    int l, m;
    ISOGI_SH__UNROLL
    for (m = 0; m < order; m++, q += 5 - order) {
        isogi_sh__f8 a = zero, b = zero;
        ISOGI_SH__UNROLL
        for (l = m; l < order; l++, q++) {
            a = ISOGI_SH__ADD_F8(*q, f[l * (l + 1) + m], a);
            if (m) b = ISOGI_SH__ADD_F8(*q, f[l * (l + 1) - m], b);
        }
        c[m] = a, s[m] = b;
    }
}

/* c and s, twice the terms of the product of two Fourier series, from ac, as, bc, bs; the table for the way back halves them. */
#define ISOGI_SH__FOURIER(V, FMA, ORDER)                                                                                       \
    a0 = ac[0] + ac[0], b0 = bc[0] + bc[0], c[0] = a0 * bc[0];                                                                 \
    ISOGI_SH__UNROLL                                                                                                           \
    for (i = 1; i < ORDER; i++) c[0] = FMA(ac[i], bc[i], FMA(as[i], bs[i], c[0]));                                             \
    ISOGI_SH__UNROLL                                                                                                           \
    for (m = 1; m < ORDER; m++) {                                                                                              \
        V cosine = zero, sine = zero;                                                                                          \
        ISOGI_SH__UNROLL                                                                                                       \
        for (i = 1; i < ORDER; i++) { /* what is taken away */                                                                 \
            if (i < m) cosine = FMA(as[i], bs[m - i], cosine);                                                                 \
            if (i > m) sine = FMA(ac[i], bs[i - m], FMA(as[i - m], bc[i], sine));                                              \
        }                                                                                                                      \
        cosine = FMA(a0, bc[m], FMA(ac[m], b0, -cosine)), sine = FMA(a0, bs[m], FMA(as[m], b0, -sine));                        \
        ISOGI_SH__UNROLL                                                                                                       \
        for (i = 1; i < ORDER; i++) {                                                                                          \
            if (i < m) cosine = FMA(ac[i], bc[m - i], cosine), sine = FMA(as[i], bc[m - i], FMA(ac[i], bs[m - i], sine));      \
            if (i <= m) continue;                                                                                              \
            cosine = FMA(ac[i], bc[i - m], FMA(as[i], bs[i - m], cosine)), sine = FMA(as[i], bc[i - m], sine);                 \
            cosine = FMA(ac[i - m], bc[i], FMA(as[i - m], bs[i], cosine)), sine = FMA(ac[i - m], bs[i], sine);                 \
        }                                                                                                                      \
        c[m] = cosine, s[m] = sine;                                                                                            \
    }

ISOGI_SH__AVX2 ISOGI_SH__INLINE void isogi_sh__product_f8(float *out, const float *f, const float *g, int order) {
    isogi_sh__f8 ac[5], as[5], bc[5], bs[5], a0, b0, c[5], s[5], zero = {0}, scratch[25], turned[8];
    const isogi_sh__f8 *q = (const isogi_sh__f8 *)isogi_sh__latitudes_f32 + 15, *last = scratch + order * order - 1;
    int i, l, m;
    isogi_sh__latitudes_f8(ac, as, f, order);
    isogi_sh__latitudes_f8(bc, bs, g, order);
    ISOGI_SH__FOURIER(isogi_sh__f8, ISOGI_SH__FMA_F8, order)
    ISOGI_SH__UNROLL
    for (m = 0; m < order; m++, q += 5 - order) {
        ISOGI_SH__UNROLL
        for (l = m; l < order; l++, q++) {
            scratch[l * (l + 1) + m] = *q * c[m];
            if (m) scratch[l * (l + 1) - m] = *q * s[m];
        }
    }
    for (i = 0; i + 8 <= order * order; i += 8) {
        isogi_sh__transpose_f8((float *)turned, 8, scratch + i, 1);
        *(isogi_sh__f8 *)(out + i) = ((turned[0] + turned[1]) + (turned[2] + turned[3])) + ((turned[4] + turned[5]) + turned[6]);
    }
    if (order != 4)
        out[i] = (((*last)[0] + (*last)[1]) + ((*last)[2] + (*last)[3])) + (((*last)[4] + (*last)[5]) + (*last)[6]);
}

ISOGI_SH__AVX2 static void isogi_sh__product_order3(float *out, const float *f, const float *g) { isogi_sh__product_f8(out, f, g, 3); }
ISOGI_SH__AVX2 static void isogi_sh__product_order4(float *out, const float *f, const float *g) { isogi_sh__product_f8(out, f, g, 4); }
ISOGI_SH__AVX2 static void isogi_sh__product_order5(float *out, const float *f, const float *g) { isogi_sh__product_f8(out, f, g, 5); }

static void isogi_sh__product_low_f8(float *out, const float *f, const float *g, int order) {
    if (order == 3) isogi_sh__product_order3(out, f, g);
    else if (order == 4) isogi_sh__product_order4(out, f, g);
    else isogi_sh__product_order5(out, f, g);
}

/* Sixteen products of order 5 with one in each lane. Latitudes z and -z share the parts of a series that are even and odd in z:
   latitude 3 is the equator. What is wanted later goes to memory, so that a product of two series has all registers. */
typedef struct isogi_sh__series_f16 {
    isogi_sh__f16 c[5], s[5];
} isogi_sh__series_f16;

ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__series_of_f16(isogi_sh__series_f16 *above, isogi_sh__series_f16 *below,
                                                               const isogi_sh__f16 *f, int latitude) {
    const float *q = isogi_sh__latitudes_f32 + latitude;
    isogi_sh__f16 zero = {0};
    int l, m;
    ISOGI_SH__UNROLL
    for (m = 0; m < 5; m++) {
        isogi_sh__f16 part[2][2] = {{zero, zero}, {zero, zero}};
        ISOGI_SH__UNROLL
        for (l = m; l < 5; l++, q += 8) {
            int parity = (l + m) & 1;
            if (parity && latitude == 3) continue;
            part[parity][0] = ISOGI_SH__FMA_F16(f[l * (l + 1) + m], isogi_sh__eval_f16_splat(*q), part[parity][0]);
            if (m) part[parity][1] = ISOGI_SH__FMA_F16(f[l * (l + 1) - m], isogi_sh__eval_f16_splat(*q), part[parity][1]);
        }
        above->c[m] = part[0][0], above->s[m] = part[0][1];
        if (latitude == 3) continue;
        below->c[m] = above->c[m], below->s[m] = above->s[m];
        if (m == 4) continue; /* nothing is odd */
        above->c[m] += part[1][0], above->s[m] += part[1][1], below->c[m] -= part[1][0], below->s[m] -= part[1][1];
    }
}

/* Twice the product of two series, to degree 4. A product of two complex numbers takes three multiplications of real ones: from u, sums of
   the products of cosines, w, of those of sines, and t, of cosines and sines at once. */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__series_product_f16(isogi_sh__series_f16 *out, const isogi_sh__series_f16 *f,
                                                                    const isogi_sh__series_f16 *g) {
    isogi_sh__f16 zero = {0}, f0 = f->c[0] + f->c[0], g0 = g->c[0] + g->c[0], first = f0 * g->c[0];
    isogi_sh__f16 f_sum[5], f_less[5], g_sum[5], g_less[5];
    int i, m;
    ISOGI_SH__UNROLL
    for (m = 1; m < 5; m++) {
        first = ISOGI_SH__FMA_F16(f->c[m], g->c[m], ISOGI_SH__FMA_F16(f->s[m], g->s[m], first));
        f_sum[m] = f->c[m] + f->s[m], f_less[m] = f->c[m] - f->s[m], g_sum[m] = g->c[m] + g->s[m], g_less[m] = g->c[m] - g->s[m];
    }
    out->c[0] = first, out->s[0] = zero;
    ISOGI_SH__UNROLL
    for (m = 1; m < 5; m++) {
        isogi_sh__f16 u = zero, t = zero, w = zero;
        ISOGI_SH__UNROLL
        for (i = 1; i < m; i++) {
            u = ISOGI_SH__FMA_F16(f->c[i], g->c[m - i], u);
            w = ISOGI_SH__FMA_F16(-f->s[i], g->s[m - i], w);
            t = ISOGI_SH__FMA_F16(f_sum[i], g_sum[m - i], t);
        }
        ISOGI_SH__UNROLL
        for (i = m + 1; i < 5; i++) {
            u = ISOGI_SH__FMA_F16(f->c[i], g->c[i - m], ISOGI_SH__FMA_F16(f->c[i - m], g->c[i], u));
            w = ISOGI_SH__FMA_F16(f->s[i], g->s[i - m], ISOGI_SH__FMA_F16(f->s[i - m], g->s[i], w));
            t = ISOGI_SH__FMA_F16(f_sum[i], g_less[i - m], ISOGI_SH__FMA_F16(f_less[i - m], g_sum[i], t));
        }
        out->c[m] = ISOGI_SH__FMA_F16(f0, g->c[m], ISOGI_SH__FMA_F16(f->c[m], g0, u + w));
        out->s[m] = ISOGI_SH__FMA_F16(f0, g->s[m], ISOGI_SH__FMA_F16(f->s[m], g0, t - u + w));
    }
}

/* The sum and the difference of the products at latitudes z and -z */
ISOGI_SH__AVX512 static void isogi_sh__product_latitude_f16(isogi_sh__series_f16 *sum, const isogi_sh__f16 *f, const isogi_sh__f16 *g,
                                                            int latitude) {
    isogi_sh__series_f16 series[2][2], product[2]; /* [below][of g] */
    int m;
    isogi_sh__series_of_f16(&series[0][0], &series[1][0], f, latitude);
    isogi_sh__series_of_f16(&series[0][1], &series[1][1], g, latitude);
    isogi_sh__series_product_f16(&product[0], &series[0][0], &series[0][1]);
    isogi_sh__series_product_f16(&product[1], &series[1][0], &series[1][1]);
    ISOGI_SH__UNROLL
    for (m = 0; m < 5; m++) {
        sum[0].c[m] = product[0].c[m] + product[1].c[m], sum[1].c[m] = product[0].c[m] - product[1].c[m];
        if (m) sum[0].s[m] = product[0].s[m] + product[1].s[m], sum[1].s[m] = product[0].s[m] - product[1].s[m];
    }
}

ISOGI_SH__AVX512 static void isogi_sh__product_equator_f16(isogi_sh__series_f16 *sum, const isogi_sh__f16 *f, const isogi_sh__f16 *g) {
    isogi_sh__series_f16 f_series, g_series;
    isogi_sh__series_of_f16(&f_series, &f_series, f, 3);
    isogi_sh__series_of_f16(&g_series, &g_series, g, 3);
    isogi_sh__series_product_f16(sum, &f_series, &g_series);
}

/* column[i] = element i of each of 16 expansions of order 5, for 8 elements: rows 8 apart are joined, 4 x 4 turned in each quarter of a
   vector, and quarters of two joined. */
ISOGI_SH__AVX512 ISOGI_SH__INLINE void isogi_sh__columns_f16(isogi_sh__f16 *column, const float *in) {
    const size_t pitch = 25;
    isogi_sh__d8 v[2][4];
    size_t half, k;
    ISOGI_SH__UNROLL
    for (half = 0; half < 2; half++, in += 4 * pitch) {
        isogi_sh__f16 row[4], e, f, g, h;
        ISOGI_SH__UNROLL
        for (k = 0; k < 4; k++)
            row[k] = (isogi_sh__f16)ISOGI_SH__JOIN_HALVES((isogi_sh__d4) * (const isogi_sh__half *)(const void *)(in + pitch * k),
                                                          (isogi_sh__d4) * (const isogi_sh__half *)(const void *)(in + pitch * (k + 8)));
        e = ISOGI_SH__LOW_F16(row[0], row[1]), f = ISOGI_SH__HIGH_F16(row[0], row[1]);
        g = ISOGI_SH__LOW_F16(row[2], row[3]), h = ISOGI_SH__HIGH_F16(row[2], row[3]);
        v[half][0] = (isogi_sh__d8)ISOGI_SH__EVEN_F16(e, g), v[half][1] = (isogi_sh__d8)ISOGI_SH__ODD_F16(e, g);
        v[half][2] = (isogi_sh__d8)ISOGI_SH__EVEN_F16(f, h), v[half][3] = (isogi_sh__d8)ISOGI_SH__ODD_F16(f, h);
    }
    ISOGI_SH__UNROLL
    for (k = 0; k < 4; k++) {
        column[k] = (isogi_sh__f16)__builtin_shufflevector(v[0][k], v[1][k], 0, 1, 8, 9, 4, 5, 12, 13);
        column[k + 4] = (isogi_sh__f16)__builtin_shufflevector(v[0][k], v[1][k], 2, 3, 10, 11, 6, 7, 14, 15);
    }
}

ISOGI_SH__AVX512 static void isogi_sh__product_order5_f16(float *out, const float *f, const float *g) {
    static const int columns[4] = {0, 8, 16, 17};
    const float *q = isogi_sh__latitudes_f32 + 8 * 15;
    isogi_sh__series_f16 sum[4][2]; /* [latitude][odd] */
    isogi_sh__f16 a[25], b[25], c[25], zero = {0};
    int i, l, m;
    for (i = 0; i < 8; i++) isogi_sh__columns_f16((i < 4 ? a : b) + columns[i % 4], (i < 4 ? f : g) + columns[i % 4]);
    for (i = 0; i < 3; i++) isogi_sh__product_latitude_f16(sum[i], a, b, i);
    isogi_sh__product_equator_f16(sum[3], a, b);
    ISOGI_SH__UNROLL
    for (m = 0; m < 5; m++) {
        ISOGI_SH__UNROLL
        for (l = m; l < 5; l++, q += 8) {
            int odd = (l + m) & 1;
            isogi_sh__f16 cosine = zero, sine = zero;
            ISOGI_SH__UNROLL
            for (i = 0; i < 4 - odd; i++) {
                cosine = ISOGI_SH__FMA_F16(sum[i][odd].c[m], isogi_sh__eval_f16_splat(q[i]), cosine);
                if (m) sine = ISOGI_SH__FMA_F16(sum[i][odd].s[m], isogi_sh__eval_f16_splat(q[i]), sine);
            }
            c[l * (l + 1) + m] = cosine;
            if (m) c[l * (l + 1) - m] = sine;
        }
    }
    for (i = 0; i < 4; i++) isogi_sh__join_f16_turn(out + 100 * i, 25, (const float *)c + 4 * i, 16, 0);
}
#undef ISOGI_SH__FOURIER

/* Other low orders in double, four products side by side. What all of them share: columns at the latitudes z >= 0, degrees l >= m of
   m = 0, then of m = 1 and so on, and what is integrated counts as. */
#define ISOGI_SH__SIDE 10 /* orders that go this way */
typedef struct isogi_sh__product_rows {
    double q[7][55], weight[7];
    int count;
} isogi_sh__product_rows;

static void isogi_sh__product_rows_start(isogi_sh__product_rows *r, int order) {
    int i, l, m, latitudes = (3 * (order - 1)) / 2 + 1;
    r->count = (latitudes + 1) / 2;
    for (i = 0; i < r->count; i++) {
        double column[ISOGI_SH__SIDE], z, sine, power = 1, *q = r->q[i];
        isogi_sh__gauss_legendre(&z, &r->weight[i], i, latitudes);
        r->weight[i] *= (2 * i + 1 == latitudes ? 0.25 : 0.5) * ISOGI_SH__PI; /* the equator is its own mirror image */
        sine = sqrt((1 - z) * (1 + z));
        for (m = 0; m < order; m++, power *= sine) {
            isogi_sh__column(column, order, m, isogi_sh__next_diagonal(0, m), z, 0);
            for (l = m; l < order; l++) *q++ = power * column[l];
        }
    }
}

/* Terms -m .. m of twice the complex Fourier series at a latitude and at its mirror image: series[mirrored][imaginary], m = 0 in the
   middle */
ISOGI_SH__AVX2 static void isogi_sh__series_d4(isogi_sh__d4 series[2][2][2 * ISOGI_SH__SIDE], const isogi_sh__d4 *c, const double *q,
                                               int order) {
    isogi_sh__d4 zero = {0};
    int i, j, l, m;
    for (m = 0; m < order; m++) {
        isogi_sh__d4 even = zero, odd = zero, even_s = zero, odd_s = zero;
        for (l = m; l < order; l += 2, q += 2) {
            even = ISOGI_SH__FMA_D4(c[l * (l + 1) + m], isogi_sh__eval_d4_splat(q[0]), even);
            even_s = ISOGI_SH__FMA_D4(c[l * (l + 1) - m], isogi_sh__eval_d4_splat(q[0]), even_s);
            if (l + 1 == order) break;
            odd = ISOGI_SH__FMA_D4(c[(l + 1) * (l + 2) + m], isogi_sh__eval_d4_splat(q[1]), odd);
            odd_s = ISOGI_SH__FMA_D4(c[(l + 1) * (l + 2) - m], isogi_sh__eval_d4_splat(q[1]), odd_s);
        }
        if (l + 1 == order) q++;
        i = order - 1 - m, j = order - 1 + m;
        series[0][0][i] = series[0][0][j] = even + odd, series[1][0][i] = series[1][0][j] = even - odd;
        series[0][1][j] = even_s + odd_s, series[1][1][j] = even_s - odd_s;
        series[0][1][i] = -series[0][1][j], series[1][1][i] = -series[1][1][j];
    }
    for (i = 0; i < 2; i++) series[i][0][order - 1] += series[i][0][order - 1], series[i][1][order - 1] = zero;
}

/* `some` products, at most 4 */
ISOGI_SH__AVX2 static void isogi_sh__products_d4(float *out, const float *f, const float *g, int order, int some,
                                                 const isogi_sh__product_rows *r) {
    isogi_sh__d4 in[2][ISOGI_SH__SIDE * ISOGI_SH__SIDE], total[ISOGI_SH__SIDE * ISOGI_SH__SIDE], zero = {0};
    isogi_sh__d4 a[2][2][2 * ISOGI_SH__SIDE], b[2][2][2 * ISOGI_SH__SIDE];
    int i, j, k, l, m, n = order * order;
    for (i = 0; i < n; i++) {
        in[0][i] = in[1][i] = total[i] = zero;
        for (k = 0; k < some; k++) ((double *)&in[0][i])[k] = (double)f[n * k + i], ((double *)&in[1][i])[k] = (double)g[n * k + i];
    }
    for (j = 0; j < r->count; j++) {
        const double *q = r->q[j];
        isogi_sh__series_d4(a, in[0], q, order);
        isogi_sh__series_d4(b, in[1], q, order);
        for (m = 0; m < order; m++) {
            isogi_sh__d4 c[2], s[2], weight = isogi_sh__eval_d4_splat(r->weight[j]);
            for (i = 0; i < 2; i++) {
                isogi_sh__d4 real = zero, real_less = zero, imaginary = zero, more = zero;
                for (k = m; k <= 2 * order - 2; k++) {
                    isogi_sh__d4 ac = a[i][0][k], as = a[i][1][k], bc = b[i][0][2 * order - 2 + m - k], bs = b[i][1][2 * order - 2 + m - k];
                    real = ISOGI_SH__FMA_D4(ac, bc, real), real_less = ISOGI_SH__FMA_D4(as, bs, real_less);
                    imaginary = ISOGI_SH__FMA_D4(ac, bs, imaginary), more = ISOGI_SH__FMA_D4(as, bc, more);
                }
                c[i] = (real - real_less) * weight, s[i] = (imaginary + more) * weight;
            }
            for (l = m; l < order; l++, q++) {
                isogi_sh__d4 *to = total + l * (l + 1), by = isogi_sh__eval_d4_splat(*q);
                to[m] = ISOGI_SH__FMA_D4((l + m) & 1 ? c[0] - c[1] : c[0] + c[1], by, to[m]);
                if (m) to[-m] = ISOGI_SH__FMA_D4((l + m) & 1 ? s[0] - s[1] : s[0] + s[1], by, to[-m]);
            }
        }
    }
    for (k = 0; k < some; k++)
        for (i = 0; i < n; i++) out[n * k + i] = (float)((const double *)&total[i])[k];
}
#endif

ISOGI_API isogi_result isogi_sh_product(float *out, const float *a, const float *b, int order, size_t count) {
    size_t i, n;
    int first;
    if (!isogi_sh__order_ok(order) || (count && (!out || !a || !b))) return ISOGI_INVALID;
    if (!isogi_sh__fits(count, order, sizeof *out)) return ISOGI_TOO_LARGE;
    n = ISOGI_SH_COUNT(order);
    if (order <= 2) {
        for (i = 0; i < count; i++) isogi_sh__product_linear(out + n * i, a + n * i, b + n * i, (int)n);
        return ISOGI_OK;
    }
#ifdef ISOGI_SH__SIMD
    if (order <= 5 && isogi_sh__level()) {
        for (i = 0; order == 5 && i + 16 <= count && isogi_sh__level() > 1; i += 16)
            isogi_sh__product_order5_f16(out + n * i, a + n * i, b + n * i);
        for (; i < count; i++) isogi_sh__product_low_f8(out + n * i, a + n * i, b + n * i, order);
        return ISOGI_OK;
    }
    if (order <= ISOGI_SH__SIDE && isogi_sh__level()) {
        isogi_sh__product_rows rows;
        isogi_sh__product_rows_start(&rows, order);
        for (i = 0; i < count; i += 4)
            isogi_sh__products_d4(out + n * i, a + n * i, b + n * i, order, count - i < 4 ? (int)(count - i) : 4, &rows);
        return ISOGI_OK;
    }
#undef ISOGI_SH__SIDE
#endif
    for (i = 0; i < count; i++)
        for (first = 0; first < order; first += ISOGI_SH__GROUP)
            isogi_sh__product(out + n * i, a + n * i, b + n * i, order, first,
                              first + ISOGI_SH__GROUP < order ? first + ISOGI_SH__GROUP : order);
    return ISOGI_OK;
}

/* The product with a fixed f as a matrix. Its entry of Y_l^{+-m} and Y_k^{+-n} is an integral over z of q_l, q_k and a weight that all
   degrees share: terms n - m and n + m of f's Fourier series, whose even degrees meet even l + m + k + n, its odd ones the others. Powers
   of the sine are even together, so that all is a polynomial in z of degree 3 (order - 1): exact with these latitudes and their mirror
   images. */
#define ISOGI_SH__HALF (3 * (ISOGI_SH_MAX_ORDER - 1) / 4 + 1) /* the most latitudes above the equator */
#define ISOGI_SH__ROWS 4                                      /* degrees l taken together */
typedef struct isogi_sh__ladder {
    double a, q[2][ISOGI_SH__HALF]; /* of the last degree a of its recursion, and q of this and the one before */
} isogi_sh__ladder;

typedef struct isogi_sh__operator {
    int order, half;
    double diagonal[ISOGI_SH_MAX_ORDER], z[ISOGI_SH__HALF], share[ISOGI_SH__HALF];
    isogi_sh__ladder column[2];
    double weight[2][ISOGI_SH__HALF][4];               /* of even and odd l + m + k + n; of signs ++, +-, -+, -- of m and n */
    double row[2][ISOGI_SH__HALF][4 * ISOGI_SH__ROWS]; /* these times q_l, where k is even, and where it is odd */
} isogi_sh__operator;

static double isogi_sh__power(double x, int n) {
    double power = 1;
    for (; n; n >>= 1, x *= x)
        if (n & 1) power *= x;
    return power;
}

/* q_l of order m at these latitudes, for l = m, m + 1, .. one after the other */
static const double *isogi_sh__climb(isogi_sh__ladder *q, const isogi_sh__operator *o, int l, int m) {
    double *now = q->q[l & 1], *before = q->q[(l & 1) ^ 1], a, b;
    int i;
    if (l == m) {
        for (i = 0; i < o->half; i++) now[i] = o->diagonal[m], before[i] = 0;
        return now;
    }
    a = sqrt((4.0 * l * l - 1) / ((double)(l - m) * (l + m)));
    b = l == m + 1 ? 0 : a / q->a;
    for (i = 0; i < o->half; i++) now[i] = a * o->z[i] * before[i] - b * now[i];
    q->a = a;
    return now;
}

/* Adds term d = n - m or n + m of f's series to the weights: cos m cos n = (cos (n - m) + cos (n + m)) / 2 and so on. */
static void isogi_sh__operator_weigh(isogi_sh__operator *o, const float *f, int m, int n, double sign) {
    int d = sign > 0 ? n + m : n - m, power = sign > 0 ? n + m : n, i, l, v;
    for (l = d; l < o->order; l++) {
        double c = (double)f[l * (l + 1) + d], s = d ? (double)f[l * (l + 1) - d] : 0, part[4];
        const double *q = isogi_sh__climb(&o->column[0], o, l, d);
        if (l == d) /* times what all of the integral share */
            for (i = 0; i < o->half; i++) o->column[0].q[d & 1][i] *= o->share[i] * isogi_sh__power((1 - o->z[i]) * (1 + o->z[i]), power);
        part[0] = d ? c : 2 * c, part[1] = s, part[2] = sign * s, part[3] = -sign * part[0];
        for (i = 0; i < o->half; i++)
            for (v = 0; v < 4; v++) o->weight[(l + d) & 1][i][v] += part[v] * q[i];
    }
}

/* Rows of degrees first .. and of m, both signs, from columns of n, both signs */
static void isogi_sh__operator_rows(isogi_sh__operator *o, float *matrix, int first, int m, int n) {
    size_t side = ISOGI_SH_COUNT(o->order);
    int i, j, k, l, end = first + ISOGI_SH__ROWS < o->order ? first + ISOGI_SH__ROWS : o->order;
    for (l = first; l < first + ISOGI_SH__ROWS; l++) {
        const double *q = isogi_sh__climb(&o->column[0], o, l, m);
        for (k = 0; k < 2; k++)
            for (i = 0; i < o->half; i++)
                for (j = 0; j < 4; j++) o->row[k][i][4 * (l - first) + j] = q[i] * o->weight[(l + m + k + n) & 1][i][j];
    }
    for (k = n; k < o->order; k++) {
        const double *q = isogi_sh__climb(&o->column[1], o, k, n);
        double sum[4 * ISOGI_SH__ROWS] = {0};
        for (i = 0; i < o->half; i++)
            for (j = 0; j < 4 * ISOGI_SH__ROWS; j++) sum[j] += q[i] * o->row[k & 1][i][j];
        for (l = first; l < end; l++)
            for (j = 0; j < 4; j++)
                if ((m || j < 2) && (n || !(j & 1)))
                    matrix[side * (size_t)(l * (l + 1) + (j < 2 ? m : -m)) + (size_t)(k * (k + 1) + (j & 1 ? -n : n))] =
                        (float)sum[4 * (l - first) + j];
    }
}

/* Entries with |m| <= |n|; the others are their mirror images, since the matrix is symmetric. */
ISOGI_SH__APART void isogi_sh__operator_matrix(float *matrix, const float *f, int order) {
    isogi_sh__operator o;
    size_t side = ISOGI_SH_COUNT(order);
    int i, k, l, m, n;
    o.order = order, o.half = 3 * (order - 1) / 4 + 1;
    for (m = 0; m < order; m++) o.diagonal[m] = isogi_sh__next_diagonal(m ? o.diagonal[m - 1] : 0, m);
    for (i = 0; i < o.half; i++) {
        isogi_sh__gauss_legendre(&o.z[i], &o.share[i], i, 2 * o.half);
        o.share[i] *= ISOGI_SH__PI; /* half of what an azimuth comes to, and both sides of the equator */
    }
    for (m = 0; m < order; m++)
        for (n = m; n < order; n++) {
            for (k = 0; k < 2; k++) memset(o.weight[k], 0, (size_t)o.half * sizeof *o.weight[k]);
            isogi_sh__operator_weigh(&o, f, m, n, -1);
            isogi_sh__operator_weigh(&o, f, m, n, 1);
            for (l = m; l < order; l += ISOGI_SH__ROWS) isogi_sh__operator_rows(&o, matrix, l, m, n);
        }
    for (l = 0; l < order; l++) /* degree by degree, which caches hold */
        for (k = 0; k < order; k++)
            for (m = -l; m <= l; m++)
                for (n = -k; n <= k; n++)
                    if (n * n > m * m || (n * n == m * m && k > l)) {
                        size_t row = (size_t)(l * (l + 1) + m), column = (size_t)(k * (k + 1) + n);
                        matrix[side * column + row] = matrix[side * row + column];
                    }
}
#undef ISOGI_SH__HALF
#undef ISOGI_SH__ROWS

ISOGI_API isogi_result isogi_sh_product_matrix(float *matrix, const float *f, int order) {
    if (!matrix || !f || !isogi_sh__order_ok(order)) return ISOGI_INVALID;
    if (!isogi_sh__fits(ISOGI_SH_COUNT(order), order, sizeof *matrix)) return ISOGI_TOO_LARGE;
#ifdef ISOGI_SH__SIMD
    if (order >= 3 && order <= 5 && isogi_sh__level()) { /* products of f and unit vectors take less */
        int i, j, n = order * order;
        for (i = 0; i < n; i++) {
            float unit[25] = {0};
            unit[i] = 1;
            isogi_sh__product_low_f8(matrix + n * i, f, unit, order);
            for (j = 0; j < i; j++) matrix[n * i + j] = matrix[n * j + i]; /* rounding would make them differ */
        }
        return ISOGI_OK;
    }
#endif
    isogi_sh__operator_matrix(matrix, f, order);
    return ISOGI_OK;
}

/* ==== de-ringing ====================================================================================================== */

/* One channel under a window; where it was last found below zero (colatitude and longitude); and of the row that is looked at, sums of
   cos m p and of sin m p: of the value, its derivative by the colatitude, and its Laplacian. */
typedef struct isogi_sh__ringing {
    const float *c;
    const double *factor;
    int order, channels;
    double highest, second, third, place[2], azimuth[3][2][ISOGI_SH__DERING_ORDER];
} isogi_sh__ringing;

/* The first `sums` of the three. With functions q of m without their power of the sine s, d/dz q = sqrt((l - m) (l + m + 1)) q of m + 1,
   at m = 0 by a root of 2 less. */
static void isogi_sh__ringing_row(isogi_sh__ringing *f, double colatitude, int sums) {
    double column[2][ISOGI_SH_MAX_ORDER], z = cos(colatitude), sine = sin(colatitude), diagonal = isogi_sh__next_diagonal(0, 0), power = 1;
    int i, k, l, m, n = f->order;
    isogi_sh__column(column[0], n, 0, diagonal, z, 0);
    for (m = 0; m < n; m++) {
        const double *q = column[m & 1], *above = column[(m + 1) & 1];
        double sum[3][2] = {{0, 0}, {0, 0}, {0, 0}};
        diagonal = isogi_sh__next_diagonal(diagonal, m + 1);
        if (m + 1 < n) isogi_sh__column(column[(m + 1) & 1], n, m + 1, diagonal, z, 0);
        for (k = 0; k < (m ? 2 : 1); k++)
            for (l = m; l < n; l++) {
                double c = f->factor[l] * (double)f->c[f->channels * (l * (l + 1) + (k ? -m : m))];
                sum[0][k] += c * q[l];
                if (sums < 3) continue;
                if (l > m) sum[1][k] -= c * sqrt((double)((l - m) * (l + m + 1)) * (m ? 1 : 0.5)) * above[l];
                sum[2][k] -= c * (double)(l * (l + 1)) * q[l];
            }
        for (k = 0; k < 2; k++) {
            sum[1][k] *= power * sine;
            if (m) sum[1][k] += (double)m * power / sine * z * sum[0][k];
            for (i = 0; i < sums; i++) f->azimuth[i][k][m] = i == 1 ? sum[i][k] : power * sum[i][k];
        }
        power *= sine;
    }
}

static double isogi_sh__ringing_at(const isogi_sh__ringing *f, double longitude) {
    double x = cos(longitude), y = sin(longitude), cm = 1, sm = 0, value = 0, turned;
    int m;
    for (m = 0; m < f->order; m++) {
        value += cm * f->azimuth[0][0][m] + sm * f->azimuth[0][1][m];
        turned = x * cm - y * sm;
        sm = x * sm + y * cm;
        cm = turned;
    }
    return value;
}

/* The largest second derivative along any great circle there: the larger eigenvalue of the Hessian, whose trace is the Laplacian. */
static double isogi_sh__ringing_bend(const isogi_sh__ringing *f, double colatitude, double longitude) {
    double x = cos(longitude), y = sin(longitude), cm = 1, sm = 0, p = 0, pp = 0, t = 0, tp = 0, trace = 0, turned,
        sine = sin(colatitude), z = cos(colatitude), along, across;
    int m;
    for (m = 0; m < f->order; m++) {
        pp -= (double)(m * m) * (cm * f->azimuth[0][0][m] + sm * f->azimuth[0][1][m]);
        p += (double)m * (cm * f->azimuth[0][1][m] - sm * f->azimuth[0][0][m]);
        t += cm * f->azimuth[1][0][m] + sm * f->azimuth[1][1][m];
        tp += (double)m * (cm * f->azimuth[1][1][m] - sm * f->azimuth[1][0][m]);
        trace += cm * f->azimuth[2][0][m] + sm * f->azimuth[2][1][m];
        turned = x * cm - y * sm;
        sm = x * sm + y * cm;
        cm = turned;
    }
    along = pp / (sine * sine) + z / sine * t;
    across = (tp - z / sine * p) / sine;
    return 0.5 * trace + sqrt((along - 0.5 * trace) * (along - 0.5 * trace) + across * across);
}

/* Bounds |f_l| of each degree (Cauchy and Schwarz); returns their sum, which bounds |f|. */
static double isogi_sh__ringing_bounds(double *bound, const isogi_sh__ringing *f) {
    double sum = 0;
    int i, l;
    for (l = 0; l < f->order; l++) {
        double squares = 0;
        for (i = l * l; i < (l + 1) * (l + 1); i++) squares += (double)f->c[f->channels * i] * (double)f->c[f->channels * i];
        bound[l] = f->factor[l] * sqrt((double)(2 * l + 1) / (4 * ISOGI_SH__PI) * squares);
        sum += bound[l];
    }
    return sum;
}

/* Bounds of the second and third derivatives along great circles, on which f is a trigonometric polynomial: by Bernstein's inequality a
   power of its degree times half the range of f, which is at most `range`; degrees above any k may be counted by their own bounds. */
static void isogi_sh__ringing_derivatives(isogi_sh__ringing *f, double range) {
    double bound[ISOGI_SH__DERING_ORDER], rest[2] = {0, 0};
    int k;
    isogi_sh__ringing_bounds(bound, f);
    for (k = f->order - 1; k >= 0; k--) {
        double second = (double)(k * k), third = second * (double)k, two, three;
        two = 0.5 * second * range + rest[0], three = 0.5 * third * range + rest[1];
        if (k == f->order - 1 || two < f->second) f->second = two;
        if (k == f->order - 1 || three < f->third) f->third = three;
        rest[0] += second * bound[k], rest[1] += third * bound[k], range += 2 * bound[k];
    }
}

/* Whether some of the `count` <= 32 cells of a row of square cells, of which pi / size are between the poles, holds a value below -1e-6 of
   the highest. Where f is least its slope is 0: the middle of a cell that holds that place, d from it at most, is higher by at
   most second d^2 / 2, and by bend d^2 / 2 + third d^3 / 3, bend being the second derivative in the middle. Cells whose middles are
   higher still are dropped, the others split in four, until nothing below -8e-6 can be left. */
static int isogi_sh__ringing_search(isogi_sh__ringing *f, int row, double size, const int *cell, int count) {
    double colatitude = size * ((double)row + 0.5), sine = sin(colatitude);
    /* of the chord to a corner: 4 sin^2 (size/4) (1 + sines of both latitudes), and below 2 % more along the arc for 6 rows or more */
    double square = 1.02 * 0.25 * size * size * (1 + sine * (sine + 0.5 * size));
    int i, child[64], children = 0;
    isogi_sh__ringing_row(f, colatitude, 3);
    for (i = 0; i < count; i++) {
        double longitude = size * ((double)cell[i] + 0.5), value = isogi_sh__ringing_at(f, longitude), bend;
        if (value < -1e-6 * f->highest) {
            f->place[0] = colatitude, f->place[1] = longitude;
            return 1;
        }
        if (value - 0.5 * f->second * square >= -8e-6 * f->highest) continue;
        bend = isogi_sh__ringing_bend(f, colatitude, longitude);
        if (value - (bend > 0 ? 0.5 * bend : 0) * square - f->third / 3 * square * sqrt(square) >= -8e-6 * f->highest) continue;
        child[children++] = 2 * cell[i], child[children++] = 2 * cell[i] + 1;
    }
    for (i = 0; i < children; i += 32) {
        int some = children - i < 32 ? children - i : 32;
        if (isogi_sh__ringing_search(f, 2 * row, 0.5 * size, child + i, some)) return 1;
        if (isogi_sh__ringing_search(f, 2 * row + 1, 0.5 * size, child + i, some)) return 1;
    }
    return 0;
}

/* Whether the channel falls below -1e-6 of its largest value; where not, it is above -8e-6 of it for certain. A grid of 3 order latitudes
   finds the range to a part that Bernstein's inequality bounds, and a search from the grid's cells the rest. */
static int isogi_sh__is_ringing(isogi_sh__ringing *f) {
    double least[3 * ISOGI_SH__DERING_ORDER], lowest = 0, highest = 0,
        size = ISOGI_SH__PI / (double)(3 * f->order), margin;
    int i, j, at[2] = {0, 0}, cell[32], rows = 3 * f->order, columns = 6 * f->order;
    for (i = 0; i < rows; i++) {
        isogi_sh__ringing_row(f, size * ((double)i + 0.5), 1);
        for (j = 0; j < columns; j++) {
            double value = isogi_sh__ringing_at(f, size * ((double)j + 0.5));
            least[i] = j == 0 || value < least[i] ? value : least[i];
            highest = i + j == 0 || value > highest ? value : highest;
            if (i + j == 0 || value < lowest) lowest = value, at[0] = i, at[1] = j;
        }
    }
    if (lowest < -1e-6 * highest || !(highest > 0)) {
        f->place[0] = size * ((double)at[0] + 0.5), f->place[1] = size * ((double)at[1] + 0.5);
        return lowest < 0;
    }
    f->highest = highest;
    isogi_sh__ringing_derivatives(f, (highest - lowest) / cos((double)(f->order - 1) * 0.7142 * size));
    if (isogi_sh__ringing_search(f, at[0], size, at + 1, 1)) return 1;
    margin = 0.5 * f->second * 1.02 * 0.25 * size * size * (2 + 0.5 * size) - 8e-6 * highest;
    for (i = 0; i < rows; i++)
        for (j = 0; j < columns && least[i] < margin; j += 32) {
            int k, some = columns - j < 32 ? columns - j : 32;
            for (k = 0; k < some; k++) cell[k] = j + k;
            if (isogi_sh__ringing_search(f, i, size, cell, some)) return 1;
        }
    return 0;
}

/* Whether any channel rings under a window of width 1 / inverse (0: none). `last`: -1, or a channel that rang under another window: where
   it did it is asked first, since windows that are narrower by a little leave it so. */
static int isogi_sh__any_ringing(isogi_sh__ringing *f, const float *c, isogi_sh_window_kind kind, double inverse, double *factor,
                                 int *last) {
    double bound[ISOGI_SH__DERING_ORDER];
    int l, k;
    for (l = 0; l < f->order; l++) factor[l] = inverse > 0 ? isogi_sh__window(kind, (double)l, 1 / inverse) : 1;
    if (*last >= 0) {
        f->c = c + *last;
        isogi_sh__ringing_row(f, f->place[0], 1);
        if (isogi_sh__ringing_at(f, f->place[1]) < -1e-6 * isogi_sh__ringing_bounds(bound, f)) return 1;
    }
    for (k = 0; k < f->channels; k++) {
        f->c = c + k;
        if (isogi_sh__is_ringing(f)) {
            *last = k;
            return 1;
        }
    }
    return 0;
}

ISOGI_API isogi_result isogi_sh_dering(float *out, const float *in, int order, int channels, isogi_sh_window_kind kind, double *width) {
    double factor[ISOGI_SH_MAX_ORDER], weak = 0, strong; /* inverse widths */
    isogi_sh__ringing f;
    int i, k, last = -1;
    if (!out || !in || !isogi_sh__shape_ok(order, channels) || !isogi_sh__window_ok(kind)) return ISOGI_INVALID;
    if (order > ISOGI_SH__DERING_ORDER) return ISOGI_TOO_LARGE;
    for (k = 0; k < channels; k++)
        if (!(in[k] >= 0)) return ISOGI_INVALID;
    if (!isogi_sh__finite_array(in, (size_t)channels * ISOGI_SH_COUNT(order))) return ISOGI_INVALID;
    memset(&f, 0, sizeof f);
    f.factor = factor, f.order = order, f.channels = channels;
    strong = order > 1 && isogi_sh__any_ringing(&f, in, kind, 0, factor, &last) ? 1 / (64 * (double)order) : 0;
    /* A window narrower than one without rings may have them again: from the weak side. At 16 no degree but 0 is left of any window. */
    while (strong > 0 && strong < 16 && isogi_sh__any_ringing(&f, in, kind, strong, factor, &last)) {
        weak = strong;
        strong = strong * 1.02 < 16 ? strong * 1.02 : 16;
    }
    for (i = 0; i < 15 && strong > 0 && strong < 16; i++) {
        double middle = 0.5 * (weak + strong);
        if (isogi_sh__any_ringing(&f, in, kind, middle, factor, &last)) weak = middle;
        else strong = middle;
    }
    for (i = 0; i < order; i++) factor[i] = strong > 0 ? isogi_sh__window(kind, (double)i, 1 / strong) : 1;
    isogi_sh__scale_bands(out, in, order, channels, factor);
    if (width) *width = strong > 0 ? 1 / strong : 0;
    return ISOGI_OK;
}

/* ==== projection ===================================================================================================== */

ISOGI_API isogi_result isogi_sh_project_function(double *c, int order, int channels, int resolution,
                                                 void (*function)(void *user, const double direction[3], double *value), void *user) {
    double q[ISOGI_SH_MAX_ORDER], azimuth[2][ISOGI_SH_MAX_ORDER][ISOGI_SH__CHANNELS], value[ISOGI_SH__CHANNELS];
    int i, j, k, l, m, longitudes;
    if (!c || !function || !isogi_sh__shape_ok(order, channels) || resolution < 0) return ISOGI_INVALID;
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

/* Fejer's first weight for colatitude t = pi (row + 1/2) / rows, on z = cos t: their sum is 2. The recursion loses k^2 ulps of a term that
   counts 1 / k^2. */
static double isogi_sh__fejer(int row, int rows) {
    double angle = ISOGI_SH__PI * ((double)(2 * row + 1)) / (double)rows, sum = 1, c = cos(angle), now = c, before = 1, next;
    int k;
    for (k = 1; k <= rows / 2; k++) { /* now = cos(k angle) */
        sum -= 2 * now / ((double)(2 * k - 1) * (double)(2 * k + 1));
        next = 2 * c * now - before;
        before = now;
        now = next;
    }
    return 2 * sum / (double)rows;
}

/* What is projected: channels `channel` .. `channel + group - 1` of an image, and orders first <= m < end. */
typedef struct isogi_sh__pixels {
    const float *image;
    int width, height, channels, channel, group, first, end;
    double unit; /* what a radiance of 1 counts as */
} isogi_sh__pixels;

/* total[0 or 1][m - first][l][channel], with room for `most` degrees, as coefficients */
static void isogi_sh__project_store(float *c, int order, const isogi_sh__pixels *p, double (*total)[3], int most) {
    int k, l, m;
    for (m = p->first; m < p->end; m++)
        for (l = m; l < order; l++)
            for (k = 0; k < p->group; k++) {
                int at = (m - p->first) * most + l;
                c[p->channels * (l * (l + 1) + m) + p->channel + k] = (float)total[at][k];
                if (m > 0) c[p->channels * (l * (l + 1) - m) + p->channel + k] = (float)total[ISOGI_SH__GROUP * most + at][k];
            }
}

/* Azimuth sums of one row about the image's pole: sums[0 or 1][m - first][channel] = sum over texels of texel (cos, sin) m p. */
static void isogi_sh__row_sums(double sums[2][ISOGI_SH__GROUP][3], const isogi_sh__pixels *p, int row) {
    const float *texel = p->image + (size_t)p->channels * (size_t)p->width * (size_t)row + p->channel;
    double step = 2 * ISOGI_SH__PI / (double)p->width, turn_c = cos(step), turn_s = -sin(step), x = 1, y = 0, t;
    int i, k, m;
    memset(sums, 0, 2 * sizeof *sums);
    for (i = 0; i < p->width; i++, texel += p->channels) {
        double angle = 2 * ISOGI_SH__PI - step * ((double)i + 0.5), cm = 1, sm = 0;
        if (i % 64 == 0) x = cos(angle), y = sin(angle);
        if (p->first) cm = cos((double)p->first * angle), sm = sin((double)p->first * angle);
        for (m = 0; m < p->end - p->first; m++) {
            for (k = 0; k < p->group; k++) {
                sums[0][m][k] += cm * (double)texel[k];
                sums[1][m][k] += sm * (double)texel[k];
            }
            t = x * cm - y * sm;
            sm = x * sm + y * cm;
            cm = t;
        }
        t = x * turn_c - y * turn_s;
        y = x * turn_s + y * turn_c;
        x = t;
    }
}

#ifdef ISOGI_SH__SIMD
/* Order 5 of an RGB image whose width is a multiple of 4. Texels a quarter turn apart share their factors: with e, f the differences of
   opposite ones and g, h their sums, m = 0 and 4 take g + h, m = 2 takes g - h, m = 1 and 3 take e and f. RGB stays interleaved: factors
   are repeated for each channel, and a period of 24 floats, 8 texels, is three vectors. Lanes sum a few dozen floats; rows are
   summed in double. */
#define ISOGI_SH__QUARTER 192 /* columns whose factors are held, for all rows */
#define ISOGI_SH__PITCH (3 * ISOGI_SH__QUARTER)
#define ISOGI_SH__ROWS 8      /* whose weights are found together */

/* factor[2 m - 2 + (sine)][3 column + channel], m = 1 .. 4, zero beyond `columns` */
static void isogi_sh__image_factors(float (*factor)[ISOGI_SH__PITCH], int first, int columns, int width) {
    double step = 2 * ISOGI_SH__PI / (double)width, start = 2 * ISOGI_SH__PI - step * ((double)first + 0.5), t;
    double x = cos(start), y = sin(start), turn_c = cos(step), turn_s = -sin(step);
    int i, k, m;
    for (i = 0; i < columns; i++) {
        double c = x, s = y;
        for (m = 1; m < 5; m++) {
            for (k = 0; k < 3; k++) factor[2 * m - 2][3 * i + k] = (float)c, factor[2 * m - 1][3 * i + k] = (float)s;
            t = x * c - y * s;
            s = x * s + y * c;
            c = t;
        }
        t = x * turn_c - y * turn_s;
        y = x * turn_s + y * turn_c;
        x = t;
    }
    for (m = 0; m < 8; m++)
        for (i = 3 * columns; i < ISOGI_SH__PITCH; i++) factor[m][i] = 0;
}

/* The sums of one row over one block of columns, a third of the lanes: sum[0] for m = 0, then cosine and sine for each m. */
ISOGI_SH__AVX2 static void isogi_sh__image_row(isogi_sh__f8 *sum, const float *row, size_t quarter, int floats, const float *factor) {
    isogi_sh__f8 a = sum[0], c1 = sum[1], s1 = sum[2], c2 = sum[3], s2 = sum[4], c3 = sum[5], s3 = sum[6], c4 = sum[7], s4 = sum[8];
    int i;
    for (i = 0; i < floats; i += 24) {
        const float *p = row + i, *by = factor + i;
        isogi_sh__f8 p0 = *(const isogi_sh__f8 *)p, p1 = *(const isogi_sh__f8 *)(p + quarter);
        isogi_sh__f8 p2 = *(const isogi_sh__f8 *)(p + 2 * quarter), p3 = *(const isogi_sh__f8 *)(p + 3 * quarter);
        isogi_sh__f8 e = p0 - p2, f = p1 - p3, g = p0 + p2, h = p1 + p3, all = g + h;
        isogi_sh__f8 c = *(const isogi_sh__f8 *)(by), s = *(const isogi_sh__f8 *)(by + ISOGI_SH__PITCH);
        a += all;
        c1 = ISOGI_SH__FMA_F8(e, c, ISOGI_SH__FMA_F8(f, s, c1)), s1 = ISOGI_SH__FMA_F8(e, s, ISOGI_SH__FMA_F8(-f, c, s1));
        g -= h;
        c2 = ISOGI_SH__FMA_F8(g, *(const isogi_sh__f8 *)(by + 2 * ISOGI_SH__PITCH), c2),
        s2 = ISOGI_SH__FMA_F8(g, *(const isogi_sh__f8 *)(by + 3 * ISOGI_SH__PITCH), s2);
        c = *(const isogi_sh__f8 *)(by + 4 * ISOGI_SH__PITCH), s = *(const isogi_sh__f8 *)(by + 5 * ISOGI_SH__PITCH);
        c3 = ISOGI_SH__FMA_F8(e, c, ISOGI_SH__FMA_F8(-f, s, c3)), s3 = ISOGI_SH__FMA_F8(e, s, ISOGI_SH__FMA_F8(f, c, s3));
        c4 = ISOGI_SH__FMA_F8(all, *(const isogi_sh__f8 *)(by + 6 * ISOGI_SH__PITCH), c4),
        s4 = ISOGI_SH__FMA_F8(all, *(const isogi_sh__f8 *)(by + 7 * ISOGI_SH__PITCH), s4);
    }
    sum[0] = a, sum[1] = c1, sum[2] = s1, sum[3] = c2, sum[4] = s2, sum[5] = c3, sum[6] = s3, sum[7] = c4, sum[8] = s4;
}

/* All lanes of a row over one block of columns: what is no multiple of 8 columns goes through a copy, since nothing may be read behind
   the image. */
ISOGI_SH__AVX2 static void isogi_sh__image_block(isogi_sh__f8 (*sum)[9], const float *row, size_t quarter, int columns,
                                                 const float *factor) {
    float rest[4][24];
    int j, k, whole = columns / 8 * 24;
    for (j = 0; j < 3; j++) isogi_sh__image_row(sum[j], row + 8 * j, quarter, whole, factor + 8 * j);
    if (whole == 3 * columns) return;
    memset(rest, 0, sizeof rest);
    for (k = 0; k < 4; k++) memcpy(rest[k], row + (size_t)k * quarter + whole, sizeof(float) * (size_t)(3 * columns - whole));
    for (j = 0; j < 3; j++) isogi_sh__image_row(sum[j], rest[0] + 8 * j, 24, 24, factor + whole + 8 * j);
}

/* Fejer's weights of ISOGI_SH__ROWS rows side by side, from c = cos 2t; see isogi_sh__fejer. */
ISOGI_SH__AVX2 static void isogi_sh__fejer_rows(double *weight, const double *cosine, int rows) {
    isogi_sh__d4 zero = {0}, c[2], now[2], before[2], sum[2];
    int j, k;
    for (j = 0; j < 2; j++) c[j] = now[j] = *(const isogi_sh__d4 *)(cosine + 4 * j), before[j] = sum[j] = zero + 1, c[j] += c[j];
    for (k = 1; k <= rows / 2; k++) {
        double factor = -2 / ((double)(2 * k - 1) * (double)(2 * k + 1));
        for (j = 0; j < 2; j++) {
            isogi_sh__d4 next = ISOGI_SH__FMA_D4(c[j], now[j], -before[j]);
            sum[j] = ISOGI_SH__FMA_D4(now[j], factor - zero, sum[j]);
            before[j] = now[j];
            now[j] = next;
        }
    }
    for (j = 0; j < 2; j++) *(isogi_sh__d4 *)(weight + 4 * j) = sum[j] * (2 / (double)rows);
}

/* total[25][12]: += what one row, at z = cos t with weight `power`, adds to each coefficient; 4 texels x 3 channels to be summed later */
ISOGI_SH__AVX2 static void isogi_sh__image_add(double (*total)[12], isogi_sh__f8 (*sum)[9], double z, double sine, double power) {
    isogi_sh__d4 part[9][3];
    double q[5];
    int j, k, l, m;
    for (k = 0; k < 9; k++) {
        isogi_sh__f8 a = sum[0][k], b = sum[1][k], c = sum[2][k];
        part[k][0] =
            __builtin_convertvector(__builtin_shufflevector(a, a, 0, 1, 2, 3) + __builtin_shufflevector(b, b, 4, 5, 6, 7), isogi_sh__d4);
        part[k][1] =
            __builtin_convertvector(__builtin_shufflevector(a, a, 4, 5, 6, 7) + __builtin_shufflevector(c, c, 0, 1, 2, 3), isogi_sh__d4);
        part[k][2] =
            __builtin_convertvector(__builtin_shufflevector(b, b, 0, 1, 2, 3) + __builtin_shufflevector(c, c, 4, 5, 6, 7), isogi_sh__d4);
    }
    for (m = 0; m < 5; m++, power *= sine) {
        isogi_sh__column(q, 5, m, isogi_sh__next_diagonal(0, m), z, 0);
        for (l = m; l < 5; l++)
            for (k = m ? 2 * m - 1 : 0; k <= 2 * m; k++) {
                isogi_sh__d4 *to = (isogi_sh__d4 *)total[l * (l + 1) + (k == 2 * m ? -m : m)], by = isogi_sh__eval_d4_splat(power * q[l]);
                for (j = 0; j < 3; j++) to[j] = ISOGI_SH__FMA_D4(part[k][j], by, to[j]);
            }
    }
}

ISOGI_SH__AVX2 static void isogi_sh__project_fast(float *rgb, const float *image, int width, int height) {
    float factor[8][ISOGI_SH__PITCH];
    double total[25][12], weight[ISOGI_SH__ROWS], z[ISOGI_SH__ROWS], sine[ISOGI_SH__ROWS], cosine[ISOGI_SH__ROWS];
    isogi_sh__f8 sum[3][9];
    int row, first, j, i, k, quarter = width / 4;
    memset(total, 0, sizeof total);
    for (first = 0; first < quarter; first += ISOGI_SH__QUARTER) {
        int columns = quarter - first < ISOGI_SH__QUARTER ? quarter - first : ISOGI_SH__QUARTER;
        isogi_sh__image_factors(factor, first, columns, width);
        for (row = 0; row < height; row += ISOGI_SH__ROWS) {
            for (j = 0; j < ISOGI_SH__ROWS; j++) {
                double t = ISOGI_SH__PI * ((double)(row + j) + 0.5) / (double)height;
                z[j] = cos(t), sine[j] = sin(t), cosine[j] = (z[j] - sine[j]) * (z[j] + sine[j]);
            }
            isogi_sh__fejer_rows(weight, cosine, height);
            for (j = 0; j < ISOGI_SH__ROWS && row + j < height; j++) {
                memset(sum, 0, sizeof sum);
                isogi_sh__image_block(sum, image + 3 * ((size_t)width * (size_t)(row + j) + (size_t)first), 3 * (size_t)quarter, columns,
                                      factor[0]);
                isogi_sh__image_add(total, sum, z[j], sine[j], weight[j] * 2 * ISOGI_SH__PI / (double)width);
            }
        }
    }
    for (i = 0; i < 25; i++)
        for (k = 0; k < 3; k++) rgb[3 * i + k] = (float)(total[i][k] + total[i][k + 3] + total[i][k + 6] + total[i][k + 9]);
}
#undef ISOGI_SH__QUARTER
#undef ISOGI_SH__PITCH
#undef ISOGI_SH__ROWS
#endif

#ifdef ISOGI_SH__SIMD
/* ---- the same in double, of any order and channels, where the width is a multiple of 4 ----
   Rows are folded as above, one channel in a row of memory, and the sums of two such rows found at once: one channel of two rows. */
#define ISOGI_SH__FOLD 64 /* columns of a quarter that are folded at once */
#define ISOGI_SH__ROWS 16 /* rows that share the factors of those columns */
#define ISOGI_SH__FOLDED_ORDER 32
typedef double isogi_sh__folded[4][ISOGI_SH__FOLD]; /* differences of opposite texels, two; what m = 2, 6, .. take; sums of all four */
typedef double isogi_sh__fold_factors[ISOGI_SH__GROUP][2][ISOGI_SH__FOLD]; /* cosines and sines */

/* Zero beyond `columns` */
static void isogi_sh__fold_factors_start(isogi_sh__fold_factors factor, const isogi_sh__pixels *p, int from, int columns) {
    double step = 2 * ISOGI_SH__PI / (double)p->width, start = 2 * ISOGI_SH__PI - step * ((double)from + 0.5);
    int i, m;
    memset(factor, 0, sizeof(isogi_sh__fold_factors));
    for (m = p->first; m < p->end; m++) {
        double x = cos((double)m * start), y = sin((double)m * start), turn_c = cos((double)m * step), turn_s = -sin((double)m * step), t;
        for (i = 0; i < columns; i++) {
            factor[m - p->first][0][i] = x, factor[m - p->first][1][i] = y;
            t = x * turn_c - y * turn_s;
            y = x * turn_s + y * turn_c;
            x = t;
        }
    }
}

static void isogi_sh__fold(isogi_sh__folded to, const float *texel, size_t channels, size_t quarter, int columns) {
    int i;
    for (i = 0; i < columns; i++, texel += channels) {
        double a = (double)texel[0], b = (double)texel[quarter], c = (double)texel[2 * quarter], d = (double)texel[3 * quarter];
        double ac = a + c, bd = b + d;
        to[0][i] = a - c, to[1][i] = b - d, to[2][i] = ac - bd, to[3][i] = ac + bd;
    }
    for (; i & 7; i++) to[0][i] = to[1][i] = to[2][i] = to[3][i] = 0;
}

#define ISOGI_SH__SUM_D4(v) (((v)[0] + (v)[1]) + ((v)[2] + (v)[3]))

/* sums[row][0 or 1][m - first][channel] += what the columns of two rows add, `rows` of which are wanted */
ISOGI_SH__AVX2 static void isogi_sh__fold_sums(double (*sums)[2][ISOGI_SH__GROUP][3], int channel, int rows, isogi_sh__folded *f,
                                               isogi_sh__fold_factors factor, const isogi_sh__pixels *p, int columns) {
    int i, m, r;
    for (m = p->first; m < p->end; m++) {
        const double *c = factor[m - p->first][0], *s = factor[m - p->first][1];
        isogi_sh__d4 zero = {0}, cosine[2], sine[2];
        isogi_sh__d4 c0 = zero, c1 = zero, s0 = zero, s1 = zero, c2 = zero, c3 = zero, s2 = zero, s3 = zero;
        if (m & 1) {
            for (i = 0; i < columns; i += 4) {
                isogi_sh__d4 x = *(const isogi_sh__d4 *)(c + i), y = *(const isogi_sh__d4 *)(s + i);
                isogi_sh__d4 e = *(const isogi_sh__d4 *)(f[0][0] + i), g = *(const isogi_sh__d4 *)(f[0][1] + i);
                c0 = ISOGI_SH__FMA_D4(e, x, c0), s0 = ISOGI_SH__FMA_D4(e, y, s0);
                c1 = ISOGI_SH__FMA_D4(g, y, c1), s1 = ISOGI_SH__FMA_D4(g, x, s1);
                e = *(const isogi_sh__d4 *)(f[1][0] + i), g = *(const isogi_sh__d4 *)(f[1][1] + i);
                c2 = ISOGI_SH__FMA_D4(e, x, c2), s2 = ISOGI_SH__FMA_D4(e, y, s2);
                c3 = ISOGI_SH__FMA_D4(g, y, c3), s3 = ISOGI_SH__FMA_D4(g, x, s3);
            }
            if (m & 2) c1 = -c1, c3 = -c3;
            else s1 = -s1, s3 = -s3;
        } else {
            const double *a = f[0][m & 2 ? 2 : 3], *b = f[1][m & 2 ? 2 : 3];
            for (i = 0; i < columns; i += 8) {
                isogi_sh__d4 x = *(const isogi_sh__d4 *)(c + i), y = *(const isogi_sh__d4 *)(s + i);
                isogi_sh__d4 e = *(const isogi_sh__d4 *)(a + i), g = *(const isogi_sh__d4 *)(b + i);
                c0 = ISOGI_SH__FMA_D4(e, x, c0), s0 = ISOGI_SH__FMA_D4(e, y, s0);
                c2 = ISOGI_SH__FMA_D4(g, x, c2), s2 = ISOGI_SH__FMA_D4(g, y, s2);
                x = *(const isogi_sh__d4 *)(c + i + 4), y = *(const isogi_sh__d4 *)(s + i + 4);
                e = *(const isogi_sh__d4 *)(a + i + 4), g = *(const isogi_sh__d4 *)(b + i + 4);
                c1 = ISOGI_SH__FMA_D4(e, x, c1), s1 = ISOGI_SH__FMA_D4(e, y, s1);
                c3 = ISOGI_SH__FMA_D4(g, x, c3), s3 = ISOGI_SH__FMA_D4(g, y, s3);
            }
        }
        cosine[0] = c0 + c1, sine[0] = s0 + s1, cosine[1] = c2 + c3, sine[1] = s2 + s3;
        for (r = 0; r < rows; r++) {
            sums[r][0][m - p->first][channel] += ISOGI_SH__SUM_D4(cosine[r]);
            sums[r][1][m - p->first][channel] += ISOGI_SH__SUM_D4(sine[r]);
        }
    }
}

/* Azimuth sums of ISOGI_SH__ROWS rows; see isogi_sh__row_sums. */
static void isogi_sh__folded_sums(double (*sums)[2][ISOGI_SH__GROUP][3], const isogi_sh__pixels *p, int row, int rows) {
    isogi_sh__fold_factors factor;
    isogi_sh__folded folded[2];
    int from, r, i, k, quarter = p->width / 4;
    memset(sums, 0, ISOGI_SH__ROWS * sizeof *sums);
    for (from = 0; from < quarter; from += ISOGI_SH__FOLD) {
        int columns = quarter - from < ISOGI_SH__FOLD ? quarter - from : ISOGI_SH__FOLD;
        isogi_sh__fold_factors_start(factor, p, from, columns);
        for (r = 0; r < rows; r += 2) {
            int some = rows - r < 2 ? 1 : 2;
            for (k = 0; k < p->group; k++) {
                for (i = 0; i < 2; i++) {
                    size_t at = (size_t)p->width * (size_t)(row + r + (i < some ? i : 0)) + (size_t)from;
                    isogi_sh__fold(folded[i], p->image + (size_t)p->channels * at + p->channel + k, (size_t)p->channels,
                                   (size_t)p->channels * (size_t)quarter, columns);
                }
                isogi_sh__fold_sums(sums + r, k, some, folded, factor, p, columns);
            }
        }
    }
}

ISOGI_SH__APART void isogi_sh__project_folded(float *c, int order, const isogi_sh__pixels *p) {
    double total[2][ISOGI_SH__GROUP][ISOGI_SH__FOLDED_ORDER][3], sums[ISOGI_SH__ROWS][2][ISOGI_SH__GROUP][3], q[ISOGI_SH__FOLDED_ORDER];
    double weight[8], z[8], sine[8], cosine[8];
    int row, j, k, l, m, limit = order < p->height ? order : p->height; /* degrees that rows can tell apart */
    memset(total, 0, sizeof total);
    for (row = 0; row < p->height; row++) {
        double power, diagonal = 0, (*sum)[ISOGI_SH__GROUP][3] = sums[row % ISOGI_SH__ROWS];
        j = row % 8;
        if (row % ISOGI_SH__ROWS == 0)
            isogi_sh__folded_sums(sums, p, row, p->height - row < ISOGI_SH__ROWS ? p->height - row : ISOGI_SH__ROWS);
        if (j == 0) {
            for (k = 0; k < 8; k++) {
                double t = ISOGI_SH__PI * ((double)(row + k) + 0.5) / (double)p->height;
                z[k] = cos(t), sine[k] = sin(t), cosine[k] = (z[k] - sine[k]) * (z[k] + sine[k]);
            }
            isogi_sh__fejer_rows(weight, cosine, p->height);
        }
        power = p->unit * weight[j] * 2 * ISOGI_SH__PI / (double)p->width;
        for (m = 0; m < p->end; m++, power *= sine[j]) {
            diagonal = isogi_sh__next_diagonal(diagonal, m);
            if (m < p->first || (m && 2 * m >= p->width)) continue;
            isogi_sh__column(q, order, m, diagonal, z[j], 0);
            for (l = m; l < limit; l++)
                for (k = 0; k < p->group; k++) {
                    total[0][m - p->first][l][k] += power * q[l] * sum[0][m - p->first][k];
                    total[1][m - p->first][l][k] += power * q[l] * sum[1][m - p->first][k];
                }
        }
    }
    isogi_sh__project_store(c, order, p, total[0][0], ISOGI_SH__FOLDED_ORDER);
}
#undef ISOGI_SH__FOLD
#undef ISOGI_SH__ROWS
#undef ISOGI_SH__SUM_D4
#endif

/* Their part of the projection, in the frame whose z is the image's pole. */
ISOGI_SH__APART void isogi_sh__project_rows(float *c, int order, const isogi_sh__pixels *p) {
    double total[2][ISOGI_SH__GROUP][ISOGI_SH_MAX_ORDER][3], sums[2][ISOGI_SH__GROUP][3], q[ISOGI_SH_MAX_ORDER];
    int j, k, l, m, limit = order < p->height ? order : p->height; /* degrees that rows can tell apart */
    memset(total, 0, sizeof total);
    for (j = 0; j < p->height; j++) {
        double t = ISOGI_SH__PI * ((double)j + 0.5) / (double)p->height, z = cos(t), sine = sin(t), power = 1, diagonal = 0;
        double weight = p->unit * isogi_sh__fejer(j, p->height) * 2 * ISOGI_SH__PI / (double)p->width;
        isogi_sh__row_sums(sums, p, j);
        for (m = 0; m < p->end; m++) {
            diagonal = isogi_sh__next_diagonal(diagonal, m);
            if (m >= p->first && (m == 0 || 2 * m < p->width)) {
                isogi_sh__column(q, order, m, diagonal, z, 0);
                for (l = m; l < limit; l++)
                    for (k = 0; k < p->group; k++) {
                        total[0][m - p->first][l][k] += weight * power * q[l] * sums[0][m - p->first][k];
                        total[1][m - p->first][l][k] += weight * power * q[l] * sums[1][m - p->first][k];
                    }
            }
            power *= sine;
        }
    }
    isogi_sh__project_store(c, order, p, total[0][0], ISOGI_SH_MAX_ORDER);
}

static int isogi_sh__image_fits(int width, int height, int channels) {
    return (size_t)width <= (size_t)-1 / 2 / sizeof(float) / (size_t)channels / (size_t)height;
}

/* The image's frame has its pole on z; the world's is y: x y z of the image are z x y of the world. */
static const double isogi_sh__image_to_world[9] = {0, 1, 0, 0, 0, 1, 1, 0, 0};

/* Where the sums would leave the range of floats, and to what end would depend on how they are added up, they are taken in this unit, and
   so turned: coefficients are at most 700 times the largest radiance. */
#define ISOGI_SH__DIM 5.421010862427522e-20 /* 2^-64 */

/* Coefficients in that unit as they are, to the ends of the range of floats. */
static void isogi_sh__undim(float *c, size_t count) {
    size_t i;
    for (i = 0; i < count; i++) {
        double x = (double)c[i] / ISOGI_SH__DIM;
        c[i] = x > 3.4028234663852886e38 ? 3.4028234663852886e38f : x < -3.4028234663852886e38 ? -3.4028234663852886e38f : (float)x;
    }
}

static void isogi_sh__image(float *c, int order, int channels, const float *image, int width, int height, double unit) {
    isogi_sh__pixels p;
    isogi_sh__euler e;
    p.image = image, p.width = width, p.height = height, p.channels = channels, p.unit = unit;
#ifdef ISOGI_SH__SIMD
    if (order == 5 && channels == 3 && !(width & 3) && width >= 32 && height >= 5 && unit >= 1 && isogi_sh__level()) {
        isogi_sh__project_fast(c, image, width, height);
        if (isogi_sh__euler_angles(&e, isogi_sh__image_to_world) == ISOGI_OK) isogi_sh__rotate(c, c, 0, order, channels, &e);
        return;
    }
#endif
    for (p.first = 0; p.first < order; p.first += ISOGI_SH__GROUP)
        for (p.channel = 0; p.channel < channels; p.channel += 3) {
            p.end = p.first + ISOGI_SH__GROUP < order ? p.first + ISOGI_SH__GROUP : order;
            p.group = p.channel + 3 < channels ? 3 : channels - p.channel;
#ifdef ISOGI_SH__SIMD
            if (order <= ISOGI_SH__FOLDED_ORDER && !(width & 3) && width >= 32 && isogi_sh__level()) {
                isogi_sh__project_folded(c, order, &p);
                continue;
            }
#endif
            isogi_sh__project_rows(c, order, &p);
        }
    if (isogi_sh__euler_angles(&e, isogi_sh__image_to_world) == ISOGI_OK) isogi_sh__rotate(c, c, 0, order, channels, &e);
}

ISOGI_API isogi_result isogi_sh_project_image(float *c, int order, int channels, const float *image, int width, int height) {
    size_t count;
    if (!c || !isogi_sh__shape_ok(order, channels) || !image || width < 1 || height < 1) return ISOGI_INVALID;
    if (!isogi_sh__image_fits(width, height, channels)) return ISOGI_TOO_LARGE;
    count = (size_t)channels * ISOGI_SH_COUNT(order);
    isogi_sh__image(c, order, channels, image, width, height, 1);
    if (isogi_sh__finite_array(c, count)) return ISOGI_OK;
    isogi_sh__image(c, order, channels, image, width, height, ISOGI_SH__DIM);
    isogi_sh__undim(c, count);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_project_equirect(float *rgb, int order, const float *image, int width, int height) {
    return isogi_sh_project_image(rgb, order, 3, image, width, height);
}

/* c += value Y(u): one weighted sample, in double. The caller holds what is summed; for float output see isogi_sh__add_lobe. */
static void isogi_sh__add_sample(double *c, int order, int channels, const double *value, isogi_sh__unit u) {
    double q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, t;
    int l, m, k;
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++)
            for (k = 0; k < channels; k++) {
                c[channels * (l * (l + 1) + m) + k] += q[l] * cm * value[k];
                if (m > 0) c[channels * (l * (l + 1) - m) + k] += q[l] * sm * value[k];
            }
        t = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = t;
    }
}

/* Samples, each with its weight in its values, that wait until there are as many as are evaluated together. */
#define ISOGI_SH__BASIS 1792 /* functions of one batch: of 16 directions to order 10, of 4 at order 21 */
typedef struct isogi_sh__samples {
    double direction[3][16], value[ISOGI_SH__CHANNELS][16];
    int order, channels, count, most;
} isogi_sh__samples;

static void isogi_sh__samples_start(isogi_sh__samples *s, double *c, int order, int channels) {
    int i;
    s->order = order, s->channels = channels, s->count = 0, s->most = 1;
    for (i = 0; i < channels * order * order; i++) c[i] = 0;
#ifdef ISOGI_SH__SIMD
    if (order <= ISOGI_SH__TABLE_ORDER && isogi_sh__level())
        s->most = order <= 10 ? 16 : ISOGI_SH__BASIS / (order * order) / 4 * 4;
#endif
}

#ifdef ISOGI_SH__SIMD
ISOGI_SH__AVX2 static void isogi_sh__add_lanes(double *c, const isogi_sh__samples *s, const double *y, int lanes) {
    int i, j, k;
    for (i = 0; i < s->order * s->order; i++, y += lanes, c += s->channels)
        for (k = 0; k < s->channels; k++) {
            isogi_sh__d4 sum = *(const isogi_sh__d4 *)y * *(const isogi_sh__d4 *)s->value[k];
            for (j = 4; j < lanes; j += 4)
                sum = ISOGI_SH__FMA_D4(*(const isogi_sh__d4 *)(y + j), *(const isogi_sh__d4 *)(s->value[k] + j), sum);
            c[k] += (sum[0] + sum[1]) + (sum[2] + sum[3]);
        }
}

/* In lanes, of which those that no sample fills count nothing. 0: a direction is not for vector units. */
static int isogi_sh__add_batch(double *c, isogi_sh__samples *s) {
    double y[ISOGI_SH__BASIS];
    int i, k, lanes = (s->count + 3) / 4 * 4;
    for (i = s->count; i < lanes; i++) {
        s->direction[0][i] = s->direction[1][i] = 0, s->direction[2][i] = 1;
        for (k = 0; k < s->channels; k++) s->value[k][i] = 0;
    }
    if (isogi_sh__eval_columns_f64(y, (size_t)lanes, s->order < 3 ? 3 : s->order, s->direction[0], s->direction[1], s->direction[2],
                                   (size_t)lanes) < (size_t)lanes)
        return 0;
    isogi_sh__add_lanes(c, s, y, lanes);
    return 1;
}
#endif

static void isogi_sh__add_samples(double *c, isogi_sh__samples *s) {
    double value[ISOGI_SH__CHANNELS];
    int i, k, count = s->count;
#ifdef ISOGI_SH__SIMD
    if (count > 1 && isogi_sh__add_batch(c, s)) count = 0;
#endif
    for (i = 0; i < count; i++) {
        for (k = 0; k < s->channels; k++) value[k] = s->value[k][i];
        isogi_sh__add_sample(c, s->order, s->channels, value,
                             isogi_sh__normalise(s->direction[0][i], s->direction[1][i], s->direction[2][i]));
    }
    s->count = 0;
}

ISOGI_API isogi_result isogi_sh_project_samples(double *c, int order, int channels, const float (*direction)[3], const float *value,
                                                const float *weight, size_t count) {
    isogi_sh__samples s;
    size_t i;
    int k;
    if (!c || !isogi_sh__shape_ok(order, channels) || (count && (!direction || !value))) return ISOGI_INVALID;
    if (!isogi_sh__samples_fit(count, channels, sizeof *value)) return ISOGI_TOO_LARGE;
    isogi_sh__samples_start(&s, c, order, channels);
    for (i = 0; i < count; i++) {
        double w = weight ? (double)weight[i] : 4 * ISOGI_SH__PI / (double)count;
        for (k = 0; k < 3; k++) s.direction[k][s.count] = (double)direction[i][k];
        for (k = 0; k < channels; k++) s.value[k][s.count] = w * (double)value[i * (size_t)channels + (size_t)k];
        if (++s.count == s.most || i + 1 == count) isogi_sh__add_samples(c, &s);
    }
    return ISOGI_OK;
}

/* Uniform in [0, 1): splitmix64. */
static double isogi_sh__random(uint64_t *state) {
    uint64_t z = (*state += ((uint64_t)0x9e3779b9u << 32) + 0x7f4a7c15u);
    z = (z ^ (z >> 30)) * (((uint64_t)0xbf58476du << 32) + 0x1ce4e5b9u);
    z = (z ^ (z >> 27)) * (((uint64_t)0x94d049bbu << 32) + 0x133111ebu);
    return (double)((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}

ISOGI_API isogi_result isogi_sh_project_random(double *c, int order, int channels, size_t samples, int stratified, uint64_t seed,
                                               void (*function)(void *user, const double direction[3], double *value), void *user) {
    double value[ISOGI_SH__CHANNELS];
    isogi_sh__samples s;
    size_t i, rows = 1, columns = 1;
    int k;
    if (!c || !function || !isogi_sh__shape_ok(order, channels) || samples < 1) return ISOGI_INVALID;
    if (samples > (size_t)1 << 30) return ISOGI_TOO_LARGE;
    if (stratified) { /* about square cells at the equator */
        rows = (size_t)sqrt((double)samples / 3);
        rows = rows > 0 ? rows : 1;
        columns = (samples + rows - 1) / rows;
        samples = rows * columns;
    }
    isogi_sh__samples_start(&s, c, order, channels);
    for (i = 0; i < samples; i++) {
        double a = isogi_sh__random(&seed), b = isogi_sh__random(&seed), direction[3], z, sine, phi;
        z = 1 - 2 * ((double)(i / columns % rows) + a) / (double)rows;
        phi = 2 * ISOGI_SH__PI * ((double)(i % columns) + b) / (double)columns;
        sine = sqrt((1 - z) * (1 + z));
        direction[0] = sine * cos(phi), direction[1] = sine * sin(phi), direction[2] = z;
        function(user, direction, value);
        for (k = 0; k < 3; k++) s.direction[k][s.count] = direction[k];
        for (k = 0; k < channels; k++) s.value[k][s.count] = value[k] * (4 * ISOGI_SH__PI / (double)samples);
        if (++s.count == s.most || i + 1 == samples) isogi_sh__add_samples(c, &s);
    }
    return ISOGI_OK;
}

/* Signed solid angle of the rectangle from the centre of a cube's face to (s, t). */
static double isogi_sh__corner_angle(double s, double t) { return atan2(s * t, sqrt(s * s + t * t + 1)); }

static isogi_sh__unit isogi_sh__cube_direction(int face, double s, double t) {
    switch (face) {
    case 0: return isogi_sh__normalise(1, -t, -s);
    case 1: return isogi_sh__normalise(-1, -t, s);
    case 2: return isogi_sh__normalise(s, 1, t);
    case 3: return isogi_sh__normalise(s, -1, -t);
    case 4: return isogi_sh__normalise(s, -t, 1);
    default: return isogi_sh__normalise(-s, -t, -1);
    }
}

#ifdef ISOGI_SH__SIMD
/* Low orders: 16 texels of a row at a time, whose solid angles are those of all faces, and up to 4 channels. */
#define ISOGI_SH__CUBE_ORDER 10
ISOGI_SH__AVX2 static void isogi_sh__cube_add(isogi_sh__d4 (*total)[4], int n, const double (*y)[16], const double (*value)[16],
                                              int channels) {
    int i, k;
    for (i = 0; i < n; i++) {
        const isogi_sh__d4 *a = (const isogi_sh__d4 *)y[i];
        for (k = 0; k < channels; k++) {
            const isogi_sh__d4 *b = (const isogi_sh__d4 *)value[k];
            isogi_sh__d4 less = ISOGI_SH__FMA_D4(a[0], b[0], total[i][k]), more = a[1] * b[1];
            total[i][k] = ISOGI_SH__FMA_D4(a[2], b[2], less) + ISOGI_SH__FMA_D4(a[3], b[3], more);
        }
    }
}

/* Channels `channel` .. `channel + some - 1` */
static void isogi_sh__cube_low(float *c, int order, int channels, int channel, int some, const float *const face[6], int size) {
    isogi_sh__d4 total[ISOGI_SH__CUBE_ORDER * ISOGI_SH__CUBE_ORDER][4];
    double y[ISOGI_SH__CUBE_ORDER * ISOGI_SH__CUBE_ORDER][16], value[4][16], corner[2][17], direction[3][16], edge = 2 / (double)size;
    int f, from, i, j, k, n = order * order;
    memset(total, 0, sizeof total);
    for (from = 0; from < size; from += 16)
        for (j = -1; j < size; j++) {
            double *above = corner[(j + 1) & 1], *below = corner[j & 1], t = edge * (double)j - 1 + edge / 2;
            for (i = 0; i <= 16; i++)
                below[i] = from + i <= size ? isogi_sh__corner_angle(edge * (double)(from + i) - 1, edge * (double)(j + 1) - 1) : 0;
            for (f = 0; f < 6 && j >= 0; f++) {
                for (i = 0; i < 16; i++) {
                    int column = from + i < size ? from + i : size - 1, sign = f & 1 ? -1 : 1;
                    const float *texel = face[f] + ((size_t)j * (size_t)size + (size_t)column) * (size_t)channels + channel;
                    double s = edge * (double)(from + i) - 1 + edge / 2, solid = below[i + 1] - below[i] - above[i + 1] + above[i];
                    direction[f / 2][i] = (double)sign;
                    direction[f / 2 == 0 ? 2 : 0][i] = f == 0 || f == 5 ? -s : s;
                    direction[f / 2 == 1 ? 2 : 1][i] = f == 2 ? t : -t;
                    for (k = 0; k < some; k++) value[k][i] = from + i < size ? solid * (double)texel[k] : 0;
                }
                isogi_sh_eval_soa_f64(y[0], order < 3 ? 3 : order, direction[0], direction[1], direction[2], 16);
                isogi_sh__cube_add(total, n, (const double(*)[16])y, (const double(*)[16])value, some);
            }
        }
    for (i = 0; i < n; i++)
        for (k = 0; k < some; k++) {
            isogi_sh__d4 sum = total[i][k];
            c[channels * i + channel + k] = (float)((sum[0] + sum[1]) + (sum[2] + sum[3]));
        }
}
#endif

/* Orders first <= m < end of one channel, over all texels. */
static void isogi_sh__project_cube(float *c, int order, int channels, int channel, int first, int end, const float *const face[6],
                                   int size) {
    double total[2][ISOGI_SH__GROUP][ISOGI_SH_MAX_ORDER], q[ISOGI_SH_MAX_ORDER];
    int f, i, j, l, m;
    memset(total, 0, sizeof total);
    for (f = 0; f < 6; f++)
        for (j = 0; j < size; j++)
            for (i = 0; i < size; i++) {
                double edge = 2 / (double)size, s0 = edge * (double)i - 1, t0 = edge * (double)j - 1, cm = 1, sm = 0, diagonal = 0, x;
                double solid = isogi_sh__corner_angle(s0 + edge, t0 + edge) - isogi_sh__corner_angle(s0, t0 + edge) -
                               isogi_sh__corner_angle(s0 + edge, t0) + isogi_sh__corner_angle(s0, t0);
                double value = solid * (double)face[f][((size_t)j * (size_t)size + (size_t)i) * (size_t)channels + (size_t)channel];
                isogi_sh__unit u = isogi_sh__cube_direction(f, s0 + edge / 2, t0 + edge / 2);
                for (m = 0; m < end; m++) {
                    diagonal = isogi_sh__next_diagonal(diagonal, m);
                    if (m >= first) {
                        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
                        for (l = m; l < order; l++)
                            total[0][m - first][l] += value * q[l] * cm, total[1][m - first][l] += value * q[l] * sm;
                    }
                    x = u.x * cm - u.y * sm;
                    sm = u.x * sm + u.y * cm;
                    cm = x;
                }
            }
    for (m = first; m < end; m++)
        for (l = m; l < order; l++) {
            c[channels * (l * (l + 1) + m) + channel] = (float)total[0][m - first][l];
            if (m > 0) c[channels * (l * (l + 1) - m) + channel] = (float)total[1][m - first][l];
        }
}

ISOGI_API isogi_result isogi_sh_project_cube(float *c, int order, int channels, const float *const face[6], int size) {
    int f, first, channel;
    if (!c || !isogi_sh__shape_ok(order, channels) || !face || size < 1) return ISOGI_INVALID;
    for (f = 0; f < 6; f++)
        if (!face[f]) return ISOGI_INVALID;
    if (!isogi_sh__image_fits(size, size, channels)) return ISOGI_TOO_LARGE;
#ifdef ISOGI_SH__SIMD
    if (order <= ISOGI_SH__CUBE_ORDER && isogi_sh__level()) {
        for (channel = 0; channel < channels; channel += 4)
            isogi_sh__cube_low(c, order, channels, channel, channels - channel < 4 ? channels - channel : 4, face, size);
        return ISOGI_OK;
    }
#undef ISOGI_SH__CUBE_ORDER
#endif
    for (channel = 0; channel < channels; channel++)
        for (first = 0; first < order; first += ISOGI_SH__GROUP)
            isogi_sh__project_cube(c, order, channels, channel, first, first + ISOGI_SH__GROUP < order ? first + ISOGI_SH__GROUP : order,
                                   face, size);
    return ISOGI_OK;
}

/* ==== lights ========================================================================================================= */

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
    return zero ? ISOGI_OK : isogi_sh__euler_angles(&e, m);
}

/* What left the range of floats goes to its end. First a look whether anything did: an exponent of ones and one more is carried into the
   highest bit. */
static void isogi_sh__clamp(float *c, size_t count) {
    uint32_t any = 0;
    size_t i;
    for (i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &c[i], sizeof bits);
        any |= (bits & 0x7fffffffu) + 0x00800000u;
    }
    if (!(any >> 31)) return;
    for (i = 0; i < count; i++)
        if (!isogi_sh__finite_f32(c[i])) {
            uint32_t bits;
            memcpy(&bits, &c[i], sizeof bits);
            bits = (bits & 0x80000000u) | 0x7f7fffffu;
            memcpy(&c[i], &bits, sizeof bits);
        }
}

static const char *isogi_sh__edges_fault(const isogi_light *light) {
    double aa = 0, bb = 0, ab = 0;
    int k;
    if (!isogi_sh__finite_array(light->edge[0], 6)) return "lights: a rectangle's edge is not finite";
    for (k = 0; k < 3; k++) {
        aa += (double)light->edge[0][k] * (double)light->edge[0][k], bb += (double)light->edge[1][k] * (double)light->edge[1][k];
        ab += (double)light->edge[0][k] * (double)light->edge[1][k];
    }
    if (!(aa > 0 && bb > 0)) return "lights: a rectangle's edge has no length";
    return fabs(ab) <= 1e-3 * sqrt(aa) * sqrt(bb) ? NULL : "lights: a rectangle's edges are not at right angles";
}

static const char *isogi_sh__light_fault(const isogi_light *light) {
    int kind = (int)light->kind;
    const float *v = light->vector;
    if (kind < (int)ISOGI_LIGHT_DIRECTIONAL || kind > (int)ISOGI_LIGHT_RECTANGLE) return "lights: a kind that is none";
    /* before any comparison: with -ffast-math what equals zero may be taken for zero, and NaN for what equals zero */
    if (!isogi_sh__finite_array(v, 3)) return "lights: a vector is not finite";
    if (!isogi_sh__finite_array(light->rgb, 3)) return "lights: an rgb is not finite";
    if (kind == (int)ISOGI_LIGHT_POINT) return NULL;
    if (kind == (int)ISOGI_LIGHT_RECTANGLE) return isogi_sh__edges_fault(light);
    if (!isogi_sh__finite_f32(light->radius) || light->radius < 0) return "lights: a radius is negative or not finite";
    if (kind == (int)ISOGI_LIGHT_SPHERE) return NULL;
    if (!(fabs((double)v[0]) + fabs((double)v[1]) + fabs((double)v[2]) > 0)) return "lights: a direction has no length";
    return light->radius <= 1.5707964f ? NULL : "lights: a directional light's radius is above pi / 2";
}

/* code: what a call returns for it. */
static const char *isogi_sh__lighting_fault(const isogi_lighting *lighting, isogi_result *code) {
    const isogi_env *env;
    const char *fault = NULL;
    double m[9];
    size_t i;
    *code = ISOGI_INVALID;
    if (!lighting) return "lighting: NULL";
    env = &lighting->env;
    if (env->rgb && (env->width < 1 || env->height < 1)) return "env.width, env.height: below 1";
    if (!env->rgb && (env->width || env->height)) return "env.width, env.height: a size, but env.rgb is NULL";
    if (env->sh && !isogi_sh__order_ok(env->sh_order)) return "env.sh_order: not 1 .. ISOGI_SH_MAX_ORDER";
    if (!env->sh && env->sh_order) return "env.sh_order: not 0, but env.sh is NULL";
    if (lighting->light_count && !lighting->lights) return "lights: NULL, but light_count is not 0";
    if (isogi_sh__env_rotation(m, env) != ISOGI_OK) return "env.rotation: neither all zero nor a rotation";
    if (env->rgb && !isogi_sh__image_fits(env->width, env->height, 3)) return *code = ISOGI_TOO_LARGE, "env.width, env.height: too large";
    if (env->rgb && !isogi_sh__finite_array(env->rgb, 3 * (size_t)env->width * (size_t)env->height)) return "env.rgb: not finite";
    if (env->sh && !isogi_sh__finite_array(env->sh, 3 * ISOGI_SH_COUNT(env->sh_order))) return "env.sh: not finite";
    for (i = 0; i < lighting->light_count && !fault; i++) fault = isogi_sh__light_fault(&lighting->lights[i]);
    if (!fault) *code = ISOGI_OK;
    return fault;
}

ISOGI_API isogi_result isogi_lighting_validate(const isogi_lighting *lighting) {
    isogi_result code;
    isogi_sh__lighting_fault(lighting, &code);
    return code;
}

ISOGI_API const char *isogi_lighting_fault(const isogi_lighting *lighting) {
    isogi_result code;
    return isogi_sh__lighting_fault(lighting, &code);
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
        isogi_sh__sum(sum, env->sh, 0, env->sh_order, 3, zero ? u : isogi_sh__normalise(d[0], d[1], d[2]));
        for (k = 0; k < 3; k++) total[k] += sum[k];
    }
    for (k = 0; k < 3; k++) rgb[k] = (float)total[k];
}

/* Scales a colour so that `part` of it stays below 1e37, whence no coefficient leaves the range of floats. */
static void isogi_sh__dim(double rgb[3], double part) {
    double largest = fabs(rgb[0]) > fabs(rgb[1]) ? fabs(rgb[0]) : fabs(rgb[1]);
    int k;
    largest = part * (largest > fabs(rgb[2]) ? largest : fabs(rgb[2]));
    if (largest > 1e37)
        for (k = 0; k < 3; k++) rgb[k] *= 1e37 / largest;
}

/* ---- rectangles ----
   A rectangle is a polygon of constant radiance on the sphere. For degrees l > 0 Green's theorem turns the integral of Y over it into
   one along its edges: l (l+1) integral of Y = sum over edges of the integral of N . grad Y, N the inward pole of the edge's great
   circle (to the same end as Wang and Ramamoorthi 2018). With z = N the edge is an arc of the equator, where Y is q(0) (cos m p, sin m p):
   its integral is closed, and a rotation takes it to the world. Where the polygon is narrow the edges nearly cancel; one narrower than
   ISOGI_SH__NARROW / order is integrated across in closed form instead, by the series of Y about the great circle along it. */
#define ISOGI_SH__NARROW 0.01
#define ISOGI_SH__LOW (ISOGI_SH__TURNS + 1) /* orders that are rotated whole, which is faster */

/* As seen from the point; the inside is to the left of each edge. No product of coordinates that are floats leaves the range of doubles. */
typedef struct isogi_sh__rectangle {
    double corner[4][3], edge[2][3];
    double volume; /* of the box of a corner and the edges: distance to the plane times area, > 0 in front */
    double radiance[3];
    int order;
} isogi_sh__rectangle;

/* corners in steps of either edge from the first */
static const int isogi_sh__corner_at[4][2] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};

/* Integrals of cos m p and sin m p along the equator of a frame, and how that is turned to the world. */
typedef struct isogi_sh__arc {
    double cosine[ISOGI_SH_MAX_ORDER], sine[ISOGI_SH_MAX_ORDER];
    isogi_sh__euler frame;
} isogi_sh__arc;

static double isogi_sh__dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* c = a x b; returns its length */
static double isogi_sh__cross3(double *c, const double *a, const double *b) {
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
    return sqrt(isogi_sh__dot3(c, c));
}

/* corner j - corner i, without the roundings of corners far away */
static void isogi_sh__between(double *d, const isogi_sh__rectangle *r, int i, int j) {
    int a = isogi_sh__corner_at[j][0] - isogi_sh__corner_at[i][0], b = isogi_sh__corner_at[j][1] - isogi_sh__corner_at[i][1], k;
    for (k = 0; k < 3; k++) d[k] = a * r->edge[0][k] + b * r->edge[1][k];
}

/* The rotation that takes x and z to these unit vectors at right angles */
static void isogi_sh__frame(isogi_sh__euler *e, const double x[3], const double z[3]) {
    double m[9], y[3];
    int k;
    isogi_sh__cross3(y, z, x);
    for (k = 0; k < 3; k++) m[3 * k] = x[k], m[3 * k + 1] = y[k], m[3 * k + 2] = z[k];
    memset(e, 0, sizeof *e);
    isogi_sh__euler_angles(e, m);
}

/* One channel of an order up to ISOGI_SH__LOW: as isogi_sh__rotate, on a third of its stack */
static void isogi_sh__turn_all_to_world(double *c, int order, const isogi_sh__euler *e) {
    double other[2 * ISOGI_SH__LOW];
    isogi_sh__turns turns;
    int l;
#ifdef ISOGI_SH__SIMD
    if (order > 5 && isogi_sh__level() > 1) {
        isogi_sh__rotate_channels(c, c, 1, order, 1, e);
        return;
    }
#endif
    isogi_sh__turns_start(&turns, order, e);
    isogi_sh__rotate_low(c, order, &turns);
    for (l = 5; l < order; l++) isogi_sh__rotate_band(c + l * l, other, l, 1, &turns);
}

/* A turn about z of degree l of four expansions, interleaved, whose angles are given:
   multiples of four angles would not fit on the stack. */
static void isogi_sh__turn_z_four(double *band, int l, double (*angle)[2]) {
    double c[4], s[4];
    int i, m;
    for (i = 0; i < 4; i++) c[i] = 1, s[i] = 0;
    for (m = 1; m <= l; m++) {
        double *plus = band + 4 * (l + m), *minus = band + 4 * (l - m);
        for (i = 0; i < 4; i++) {
            double x = c[i], p = plus[i], q = minus[i];
            c[i] = x * angle[i][0] - s[i] * angle[i][1];
            s[i] = x * angle[i][1] + s[i] * angle[i][0];
            plus[i] = p * c[i] - q * s[i];
            minus[i] = p * s[i] + q * c[i];
        }
    }
}

/* At z = 0: q_l^m where l - m is even, else its derivative, from diagonal = q_l^l down. */
static void isogi_sh__equator(double *q, int l, double diagonal) {
    int m;
    for (m = l; m >= 0; m--) {
        double a = (double)((l - m) * (l + m + 1)), half = m > 0 ? 1 : 0.70710678118654752440;
        if (m == l) q[m] = diagonal;
        else if ((l - m) & 1) q[m] = half * sqrt(a) * q[m + 1];
        else q[m] = -half * sqrt((double)((l - m - 1) * (l + m + 2)) / a) * q[m + 2];
    }
}

/* Edge i as an arc that begins at x, and its N; 0 where nothing is seen of it. */
static int isogi_sh__edge(isogi_sh__arc *arc, double pole[3], const isogi_sh__rectangle *r, int i) {
    const double *from = r->corner[i], *to = r->corner[(i + 1) & 3];
    double side[3], x[3], half[ISOGI_SH_MAX_ORDER][2], distance = sqrt(isogi_sh__dot3(from, from)), across, angle;
    int k, m;
    isogi_sh__between(side, r, i, (i + 1) & 3);
    across = isogi_sh__cross3(pole, from, side);
    if (!(across > 0) || !(distance > 0)) return 0;
    for (k = 0; k < 3; k++) x[k] = from[k] / distance, pole[k] /= across;
    isogi_sh__frame(&arc->frame, x, pole);
    angle = atan2(across, isogi_sh__dot3(from, to));
    isogi_sh__powers(half, r->order, cos(0.5 * angle), sin(0.5 * angle));
    arc->cosine[0] = angle, arc->sine[0] = 0;
    for (m = 1; m < r->order; m++) {
        arc->cosine[m] = 2 * half[m][1] * half[m][0] / (double)m;
        arc->sine[m] = 2 * half[m][1] * half[m][1] / (double)m;
    }
    return 1;
}

/* c += the radiance times degree l; degree 0 comes first */
static void isogi_sh__add_degree(float *c, const double *band, int l, isogi_sh__rectangle *r) {
    int i, k;
    if (l == 0) isogi_sh__dim(r->radiance, fabs(band[0]));
    for (i = 0; i <= 2 * l; i++)
        for (k = 0; k < 3; k++) c[3 * (l * l + i) + k] = (float)((double)c[3 * (l * l + i) + k] + r->radiance[k] * band[i]);
}

/* What the outer angles leave of 2 pi */
static double isogi_sh__solid_angle(double (*pole)[3]) {
    double angle = 2 * ISOGI_SH__PI, n[3];
    int i;
    for (i = 0; i < 4; i++) {
        double across = isogi_sh__cross3(n, pole[i], pole[(i + 1) & 3]);
        angle -= atan2(across, isogi_sh__dot3(pole[i], pole[(i + 1) & 3]));
    }
    return angle > 0 ? angle : 0;
}

/* Degree l > 0 of an edge in its frame; q: isogi_sh__equator */
static void isogi_sh__edge_degree(double *band, int l, const double *q, const isogi_sh__arc *arc) {
    int m;
    for (m = 0; m <= l; m++) {
        double value = (l - m) & 1 ? q[m] / (double)(l * (l + 1)) : 0;
        band[l - m] = value * arc->sine[m];
        band[l + m] = value * arc->cosine[m];
    }
}

/* The sum over edges, whole expansions at a time: degrees to ISOGI_SH__LOW - 1. */
ISOGI_SH__APART void isogi_sh__add_edges_low(float *c, isogi_sh__rectangle *r) {
    isogi_sh__arc arc;
    double pole[4][3], sum[ISOGI_SH__LOW * ISOGI_SH__LOW], part[ISOGI_SH__LOW * ISOGI_SH__LOW], q[ISOGI_SH__LOW][ISOGI_SH__LOW];
    double diagonal = isogi_sh__next_diagonal(0, 0);
    int i, k, l, order = r->order < ISOGI_SH__LOW ? r->order : ISOGI_SH__LOW;
    for (l = 1; l < order; l++) {
        diagonal = isogi_sh__next_diagonal(diagonal, l);
        isogi_sh__equator(q[l], l, diagonal);
    }
    for (i = 0; i < 4; i++) {
        if (!isogi_sh__edge(&arc, pole[i], r, i)) return;
        part[0] = 0;
        for (l = 1; l < order; l++) isogi_sh__edge_degree(part + l * l, l, q[l], &arc);
        isogi_sh__turn_all_to_world(part, order, &arc.frame);
        for (k = 0; k < order * order; k++) sum[k] = i ? sum[k] + part[k] : part[k];
    }
    sum[0] = isogi_sh__next_diagonal(0, 0) * isogi_sh__solid_angle(pole);
    for (l = 0; l < order; l++) isogi_sh__add_degree(c, sum + l * l, l, r);
}

/* Those from there on degree by degree, since expansions of high orders do not fit on the stack; as isogi_sh__rotate_band, of all edges. */
ISOGI_SH__APART void isogi_sh__add_edges_high(float *c, isogi_sh__rectangle *r) {
    isogi_sh__arc arc[4];
    isogi_sh__quarter_turn quarter;
    double pole[4][3], band[8 * ISOGI_SH_MAX_ORDER], other[8 * ISOGI_SH_MAX_ORDER], q[ISOGI_SH_MAX_ORDER], turn[3][4][2];
    double diagonal = isogi_sh__next_diagonal(0, 0);
    int i, k, l, m;
    for (i = 0; i < 4; i++) {
        const isogi_sh__euler *e;
        if (!isogi_sh__edge(&arc[i], pole[i], r, i)) return;
        e = &arc[i].frame;
        turn[0][i][0] = -e->c[1], turn[0][i][1] = e->c[0];
        turn[1][i][0] = e->b[0], turn[1][i][1] = e->b[1];
        turn[2][i][0] = e->a[1], turn[2][i][1] = -e->a[0];
    }
    for (l = 1; l < r->order; l++) {
        diagonal = isogi_sh__next_diagonal(diagonal, l);
        if (l < ISOGI_SH__LOW) continue;
        isogi_sh__equator(q, l, diagonal);
        for (m = 0; m <= l; m++) {
            double value = (l - m) & 1 ? q[m] / (double)(l * (l + 1)) : 0;
            for (i = 0; i < 4; i++) band[4 * (l - m) + i] = value * arc[i].sine[m], band[4 * (l + m) + i] = value * arc[i].cosine[m];
        }
        isogi_sh__quarter_turn_start(&quarter, l);
        isogi_sh__turn_z_four(band, l, turn[0]);
        isogi_sh__turn_y(other, band, l, 4, 0, &quarter);
        isogi_sh__turn_z_four(other, l, turn[1]);
        isogi_sh__turn_y(band, other, l, 4, 1, &quarter);
        isogi_sh__turn_z_four(band, l, turn[2]);
        for (k = 0; k <= 2 * l; k++) band[k] = (band[4 * k] + band[4 * k + 1]) + (band[4 * k + 2] + band[4 * k + 3]);
        isogi_sh__add_degree(c, band, l, r);
    }
}

/* A narrow polygon about the great circle through its two corners that are farthest apart. */
typedef struct isogi_sh__strip {
    double x[3], z[3];         /* the first of the two, and the circle's pole */
    double along[4], slope[4]; /* of each corner: longitude from x, and the tangent of its latitude */
} isogi_sh__strip;

/* 0 unless it is narrow. A corner off the circle is as high above it as the volume is over the area that circle and pole leave. */
static int isogi_sh__strip_start(isogi_sh__strip *strip, const isogi_sh__rectangle *r) {
    double d[3], y[3], n[3], best = -1, distance, across = 0;
    int i, j, a = 0, b = 1;
    for (i = 0; i < 4; i++)
        for (j = i + 1; j < 4; j++) {
            const double *p = r->corner[i], *q = r->corner[j];
            double length, tangent;
            isogi_sh__between(d, r, i, j);
            length = isogi_sh__cross3(n, p, d);
            tangent = sqrt(isogi_sh__dot3(p, p) * isogi_sh__dot3(q, q)) + isogi_sh__dot3(p, q); /* length / this: of half the angle */
            tangent = length / (tangent > 1e-300 ? tangent : 1e-300);
            if (tangent > best) best = tangent, across = length, a = i, b = j;
        }
    distance = sqrt(isogi_sh__dot3(r->corner[a], r->corner[a]));
    if (!(distance > 0) || !(across > 0)) return 0;
    isogi_sh__between(d, r, a, b);
    isogi_sh__cross3(strip->z, r->corner[a], d);
    for (i = 0; i < 3; i++) strip->x[i] = r->corner[a][i] / distance, strip->z[i] /= across;
    isogi_sh__cross3(y, strip->z, strip->x);
    for (i = 0; i < 4; i++) {
        double u, v;
        isogi_sh__between(d, r, a, i);
        u = distance + isogi_sh__dot3(strip->x, d), v = isogi_sh__dot3(y, d);
        strip->along[i] = atan2(v, u);
        strip->slope[i] = i == a || i == b ? 0 : (i > a && i < b ? -1 : 1) * r->volume / across / sqrt(u * u + v * v);
    }
    for (i = 0; i < 4; i++) {
        double p = fabs(strip->slope[i]), q = fabs(strip->slope[(i + 1) & 3]);
        if ((p > q ? p : q) * r->order > ISOGI_SH__NARROW * cos(0.5 * (strip->along[(i + 1) & 3] - strip->along[i]))) return 0;
    }
    return 1;
}

/* What lies between the circle and edge i, t the tangent of its latitude and s = t - t^3 / 2 the sine: moments 0, 1, 2 += the integrals
   of s, s^2 / 2 and s^3 / 6 times cos m p and sin m p, by four Gauss-Legendre nodes for each radian of the highest m (1e-9). */
static void isogi_sh__strip_edge(double (*moment)[2][ISOGI_SH_MAX_ORDER], const isogi_sh__strip *strip, int i, int order) {
    static const double node[4] = {0.069431844202973712, 0.330009478207571868, 0.669990521792428132, 0.930568155797026288};
    static const double weight[4] = {0.173927422568726929, 0.326072577431273071, 0.326072577431273071, 0.173927422568726929};
    int j = (i + 1) & 3, k, m, parts;
    double from = strip->along[i], angle = strip->along[j] - from, sine = sin(angle);
    if (!(fabs(angle) > 0) || !(fabs(strip->slope[i]) + fabs(strip->slope[j]) > 0)) return;
    parts = 1 + (int)(fabs(angle) * (double)(order + 2));
    for (k = 0; k < 4 * parts; k++) {
        double part = ((double)(k >> 2) + node[k & 3]) / (double)parts, x = cos(from + part * angle), y = sin(from + part * angle);
        double t = (strip->slope[i] * sin((1 - part) * angle) + strip->slope[j] * sin(part * angle)) / sine;
        double w = -weight[k & 3] * angle / (double)parts, cm = 1, sm = 0, c;
        double w0 = w * t * (1 - 0.5 * t * t), w1 = 0.5 * w * t * t, w2 = w * t * t * t / 6;
        for (m = 0; m < order; m++) {
            moment[0][0][m] += w0 * cm, moment[0][1][m] += w0 * sm;
            moment[1][0][m] += w1 * cm, moment[1][1][m] += w1 * sm;
            moment[2][0][m] += w2 * cm, moment[2][1][m] += w2 * sm;
            c = x * cm - y * sm;
            sm = x * sm + y * cm;
            cm = c;
        }
    }
}

/* About the equator f = q (1 - s^2)^(m/2) is f0 + f1 s + f2 s^2 / 2, f2 = (m^2 - l (l+1)) f0 by Legendre's equation. */
ISOGI_SH__APART void isogi_sh__add_strip(float *c, isogi_sh__rectangle *r, const isogi_sh__strip *strip) {
    double moment[3][2][ISOGI_SH_MAX_ORDER], all[ISOGI_SH__LOW * ISOGI_SH__LOW], other[2 * ISOGI_SH_MAX_ORDER], q[ISOGI_SH_MAX_ORDER],
        diagonal = 0;
    isogi_sh__turns turns;
    isogi_sh__euler frame;
    int i, l, m, low = r->order <= ISOGI_SH__LOW;
    isogi_sh__frame(&frame, strip->x, strip->z);
    if (!low) isogi_sh__turns_start(&turns, r->order, &frame);
    memset(moment, 0, sizeof moment);
    for (i = 0; i < 4; i++) isogi_sh__strip_edge(moment, strip, i, r->order);
    for (l = 0; l < r->order; l++) {
        double *band = all + (low ? l * l : 0);
        diagonal = isogi_sh__next_diagonal(diagonal, l);
        isogi_sh__equator(q, l, diagonal);
        for (m = 0; m <= l; m++) {
            double bend = (double)(m * m - l * (l + 1));
            for (i = 1; i >= 0; i--) /* the cosine last, for m = 0 */
                band[i ? l - m : l + m] = q[m] * ((l - m) & 1 ? moment[1][i][m] : moment[0][i][m] + bend * moment[2][i][m]);
        }
        if (low) continue;
        if (l > ISOGI_SH__TURNS) isogi_sh__quarter_turn_start(&turns.quarter, l);
        isogi_sh__rotate_band(band, other, l, 1, &turns);
        isogi_sh__add_degree(c, band, l, r);
    }
    if (!low) return;
    isogi_sh__turn_all_to_world(all, r->order, &frame);
    for (l = 0; l < r->order; l++) isogi_sh__add_degree(c, all + l * l, l, r);
}

static void isogi_sh__add_rectangle(float *c, int order, const isogi_light *light, const float point[3]) {
    isogi_sh__rectangle r;
    isogi_sh__strip strip;
    double centre[3], normal[3], area;
    int i, k;
    for (k = 0; k < 3; k++) {
        centre[k] = (double)light->vector[k] - (point ? (double)point[k] : 0);
        for (i = 0; i < 2; i++) r.edge[i][k] = (double)light->edge[i][k];
        for (i = 0; i < 4; i++)
            r.corner[i][k] =
                centre[k] + ((isogi_sh__corner_at[i][0] - 0.5) * r.edge[0][k] + (isogi_sh__corner_at[i][1] - 0.5) * r.edge[1][k]);
    }
    area = isogi_sh__cross3(normal, r.edge[0], r.edge[1]);
    r.volume = -isogi_sh__dot3(centre, normal);
    if (!(r.volume > 0)) return;
    for (k = 0; k < 3; k++) r.radiance[k] = (double)light->rgb[k] / area;
    r.order = order;
    if (isogi_sh__strip_start(&strip, &r)) isogi_sh__add_strip(c, &r, &strip);
    else {
        isogi_sh__add_edges_low(c, &r);
        if (order > ISOGI_SH__LOW) isogi_sh__add_edges_high(c, &r);
    }
}

/* Adds a light as it arrives at a point. A point light at the point itself adds nothing; inside a spherical one its light comes
   evenly from everywhere. */
static void isogi_sh__add_light(float *c, int order, const isogi_light *light, const float point[3]) {
    double scale[ISOGI_SH_MAX_ORDER], rgb[3], d[3], cosine = 1, factor = 1;
    int k, l;
    if (light->kind == ISOGI_LIGHT_RECTANGLE) {
        isogi_sh__add_rectangle(c, order, light, point);
        return;
    }
    for (k = 0; k < 3; k++) d[k] = (double)light->vector[k];
    if (light->kind == ISOGI_LIGHT_DIRECTIONAL) {
        cosine = cos((double)light->radius);
        cosine = cosine > 0 ? cosine : 0; /* pi / 2 as a float is beyond it */
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
    isogi_sh__dim(rgb, 1);
    isogi_sh__add_rgb_lobe(c, order, scale, isogi_sh__normalise(d[0], d[1], d[2]), rgb);
}

static int isogi_sh__identity(const double m[9]) {
    int i;
    for (i = 0; i < 9; i++)
        if (m[i] < (i % 4 ? 0 : 1) || m[i] > (i % 4 ? 0 : 1)) return 0;
    return 1;
}

/* The environment's image and coefficients, in a unit, and turned. */
static void isogi_sh__add_env(float *rgb, int order, const isogi_env *env, double unit) {
    isogi_sh__euler e;
    double m[9];
    size_t i, n = 3 * ISOGI_SH_COUNT(order), given = env->sh ? 3 * ISOGI_SH_COUNT(env->sh_order < order ? env->sh_order : order) : 0;
    if (env->rgb) isogi_sh__image(rgb, order, 3, env->rgb, env->width, env->height, unit);
    for (i = 0; i < n && !env->rgb; i++) rgb[i] = 0;
    for (i = 0; i < given; i++) rgb[i] += (float)unit * env->sh[i];
    if ((env->rgb || env->sh) && isogi_sh__env_rotation(m, env) == ISOGI_OK && !isogi_sh__identity(m) &&
        isogi_sh__euler_angles(&e, m) == ISOGI_OK)
        isogi_sh__rotate(rgb, rgb, 0, order, 3, &e);
}

ISOGI_API isogi_result isogi_sh_project(float *rgb, int order, const isogi_lighting *lighting, const float point[3]) {
    isogi_result result;
    size_t i, n = 3 * (isogi_sh__order_ok(order) ? ISOGI_SH_COUNT(order) : 0);
    if (!rgb || !isogi_sh__order_ok(order) || (point && !isogi_sh__finite_array(point, 3))) return ISOGI_INVALID;
    result = isogi_lighting_validate(lighting);
    if (result != ISOGI_OK) return result;
    isogi_sh__add_env(rgb, order, &lighting->env, 1);
    if (!isogi_sh__finite_array(rgb, n)) {
        isogi_sh__add_env(rgb, order, &lighting->env, ISOGI_SH__DIM);
        isogi_sh__undim(rgb, n);
    }
    for (i = 0; i < lighting->light_count; i++) isogi_sh__add_light(rgb, order, &lighting->lights[i], point);
    isogi_sh__clamp(rgb, n);
    return ISOGI_OK;
}

/* ==== simple environments and fits ==================================================================================== */

static void isogi_sh__clear(float *c, int order) {
    int i;
    for (i = 0; i < 3 * order * order; i++) c[i] = 0;
}

/* a finite direction of some length */
static int isogi_sh__direction_ok(const float d[3]) {
    return d && isogi_sh__finite_array(d, 3) && fabs((double)d[0]) + fabs((double)d[1]) + fabs((double)d[2]) > 0;
}

static isogi_sh__unit isogi_sh__unit_f32(const float d[3]) { return isogi_sh__normalise((double)d[0], (double)d[1], (double)d[2]); }

ISOGI_API isogi_result isogi_sh_constant(float *c, int order, const float rgb[3]) {
    int k;
    if (!c || !isogi_sh__order_ok(order) || !rgb || !isogi_sh__finite_array(rgb, 3)) return ISOGI_INVALID;
    isogi_sh__clear(c, order);
    for (k = 0; k < 3; k++) c[k] = (float)(sqrt(4 * ISOGI_SH__PI) * (double)rgb[k]);
    return ISOGI_OK;
}

/* c += radiance rgb from a cone: a disc of any size, per radiance instead of irradiance */
static void isogi_sh__add_cone(float *c, int order, const float axis[3], double half_angle, const double rgb[3]) {
    double scale[ISOGI_SH_MAX_ORDER], cosine = cos(half_angle), sine = sin(half_angle), half = sin(half_angle / 2);
    int l;
    isogi_sh__disc(scale, order, cosine);
    for (l = 1; l < order; l++) scale[l] *= ISOGI_SH__PI * sine * sine;
    scale[0] = 4 * ISOGI_SH__PI * half * half;
    isogi_sh__add_rgb_lobe(c, order, scale, isogi_sh__unit_f32(axis), rgb);
}

ISOGI_API isogi_result isogi_sh_cone(float *c, int order, const float axis[3], double half_angle, const float rgb[3]) {
    double colour[3];
    int k;
    if (!c || !isogi_sh__order_ok(order) || !isogi_sh__direction_ok(axis) || !rgb || !isogi_sh__finite_array(rgb, 3)) return ISOGI_INVALID;
    if (!isogi_sh__finite_f64(half_angle) || half_angle < 0 || half_angle > ISOGI_SH__PI + 1e-7) return ISOGI_INVALID;
    half_angle = half_angle < ISOGI_SH__PI ? half_angle : ISOGI_SH__PI;
    for (k = 0; k < 3; k++) colour[k] = (double)rgb[k];
    isogi_sh__clear(c, order);
    isogi_sh__add_cone(c, order, axis, half_angle, colour);
    return ISOGI_OK;
}

static int isogi_sh__sky_ok(const float *c, int order, const float up[3], const float sky[3], const float ground[3]) {
    return c && isogi_sh__order_ok(order) && isogi_sh__direction_ok(up) && sky && ground && isogi_sh__finite_array(sky, 3) &&
           isogi_sh__finite_array(ground, 3);
}

ISOGI_API isogi_result isogi_sh_hemisphere_sky(float *c, int order, const float up[3], const float sky[3], const float ground[3]) {
    double colour[3];
    int k;
    if (!isogi_sh__sky_ok(c, order, up, sky, ground)) return ISOGI_INVALID;
    for (k = 0; k < 3; k++) colour[k] = (double)sky[k] - (double)ground[k];
    isogi_sh_constant(c, order, ground);
    isogi_sh__add_cone(c, order, up, ISOGI_SH__PI / 2, colour);
    return ISOGI_OK;
}

/* (sky + ground) / 2 + (sky - ground) / 2 cos t: degrees 0 and 1 */
ISOGI_API isogi_result isogi_sh_gradient_sky(float *c, int order, const float up[3], const float sky[3], const float ground[3]) {
    double colour[3], scale[ISOGI_SH_MAX_ORDER];
    int k;
    if (!isogi_sh__sky_ok(c, order, up, sky, ground)) return ISOGI_INVALID;
    isogi_sh__clear(c, order);
    for (k = 0; k < order; k++) scale[k] = k == 1 ? 4 * ISOGI_SH__PI / 3 : 0;
    for (k = 0; k < 3; k++) {
        colour[k] = 0.5 * ((double)sky[k] - (double)ground[k]);
        c[k] = (float)(sqrt(4 * ISOGI_SH__PI) * 0.5 * ((double)sky[k] + (double)ground[k]));
    }
    isogi_sh__add_rgb_lobe(c, order, scale, isogi_sh__unit_f32(up), colour);
    return ISOGI_OK;
}

/* Degree 1 of the luminance is a vector: Y3, Y1, Y2 are x, y, z. */
static isogi_sh__unit isogi_sh__brightest(const float *c) {
    static const int axis[3] = {3, 1, 2};
    double d[3];
    int k;
    for (k = 0; k < 3; k++) {
        const float *rgb = c + 3 * axis[k];
        d[k] = 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
    }
    return isogi_sh__normalise(d[0], d[1], d[2]);
}

/* Least squares in irradiance, where degree l counts A_l^2: c ~ light Y(u) + ambient sqrt(4 pi) at degree 0. With
   aa, ab, bb, ac, bc the products of the two basis vectors a = Y(u), b and of c. */
static void isogi_sh__fit(double light[3], double ambient[3], const float *c, int order, isogi_sh__unit u, int with_ambient) {
    double factor[ISOGI_SH_MAX_ORDER], q[ISOGI_SH_MAX_ORDER], cm = 1, sm = 0, diagonal = 0, t, aa = 0, ab, bb, ac[3] = {0, 0, 0}, bc;
    int l, m, k;
    isogi_sh__cosine_factors(factor, order);
    for (m = 0; m < order; m++) {
        diagonal = isogi_sh__next_diagonal(diagonal, m);
        isogi_sh__column(q, order, m, diagonal, u.z, u.z_low);
        for (l = m; l < order; l++) {
            double weight = factor[l] * factor[l], plus = q[l] * cm, minus = q[l] * sm;
            aa += weight * (plus * plus + minus * minus);
            for (k = 0; k < 3; k++)
                ac[k] += weight * (plus * (double)c[3 * (l * (l + 1) + m) + k] + minus * (double)c[3 * (l * (l + 1) - m) + k]);
        }
        t = u.x * cm - u.y * sm;
        sm = u.x * sm + u.y * cm;
        cm = t;
    }
    ab = factor[0] * factor[0]; /* Y_0 sqrt(4 pi) = 1 */
    bb = ab * 4 * ISOGI_SH__PI;
    for (k = 0; k < 3; k++) {
        bc = ab * sqrt(4 * ISOGI_SH__PI) * (double)c[k];
        light[k] = with_ambient ? (ac[k] * bb - bc * ab) / (aa * bb - ab * ab) : ac[k] / aa;
        light[k] = light[k] > 0 ? light[k] : 0;
        ambient[k] = (bc - ab * light[k]) / bb;
        if (ambient[k] < 0) {
            ambient[k] = 0;
            light[k] = ac[k] > 0 ? ac[k] / aa : 0;
        }
    }
}

static isogi_result isogi_sh__fit_to(float direction[3], float rgb[3], float ambient[3], const float *c, int order) {
    double light[3], rest[3];
    isogi_sh__unit u;
    int k;
    if (!direction || !c || !isogi_sh__order_ok(order) || order < 2 || !isogi_sh__finite_array(c, 3 * ISOGI_SH_COUNT(order)))
        return ISOGI_INVALID;
    u = isogi_sh__brightest(c);
    isogi_sh__fit(light, rest, c, order, u, ambient != NULL);
    direction[0] = (float)u.x, direction[1] = (float)u.y, direction[2] = (float)(u.z + u.z_low);
    for (k = 0; k < 3; k++) {
        if (rgb) rgb[k] = (float)light[k];
        if (ambient) ambient[k] = (float)rest[k];
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_sh_dominant_direction(float direction[3], float rgb[3], const float *c, int order) {
    return isogi_sh__fit_to(direction, rgb, NULL, c, order);
}

ISOGI_API isogi_result isogi_sh_fit_directional(float direction[3], float rgb[3], float ambient[3], const float *c, int order) {
    if (!rgb || !ambient) return ISOGI_INVALID;
    return isogi_sh__fit_to(direction, rgb, ambient, c, order);
}

#undef ISOGI_SH__PI
#undef ISOGI_SH__SIMD
#undef ISOGI_SH__TABLE_ORDER
#undef ISOGI_SH__UNROLLED_ORDER
#undef ISOGI_SH__SUMS
#undef ISOGI_SH__SPLIT
#undef ISOGI_SH__AVX2
#undef ISOGI_SH__IN_ORDER
#undef ISOGI_SH__PUT_HALVES
#undef ISOGI_SH__DEFINE_TURN_FIRST
#undef ISOGI_SH__LANE
#undef ISOGI_SH__AVX512
#undef ISOGI_SH__UNROLL
#undef ISOGI_SH__DEFINE_F32
#undef ISOGI_SH__DEFINE_F64
#undef ISOGI_SH__EVEN_F16
#undef ISOGI_SH__EVEN_F8
#undef ISOGI_SH__HIGH_F16
#undef ISOGI_SH__HIGH_F8
#undef ISOGI_SH__HALF_D8
#undef ISOGI_SH__JOIN_F16
#undef ISOGI_SH__JOIN_D8
#undef ISOGI_SH__JOIN_F8
#undef ISOGI_SH__PUT_EVEN
#undef ISOGI_SH__PUT_ODD
#undef ISOGI_SH__FROM_F8
#undef ISOGI_SH__ACROSS_D8
#undef ISOGI_SH__BLEND_D8
#undef ISOGI_SH__FIRST_D8
#undef ISOGI_SH__SECOND_D8
#undef ISOGI_SH__JOIN_HALVES
#undef ISOGI_SH__LESS_D4
#undef ISOGI_SH__LESS_D8
#undef ISOGI_SH__LESS_F16
#undef ISOGI_SH__LESS_F8
#undef ISOGI_SH__LOW_F16
#undef ISOGI_SH__LOW_F8
#undef ISOGI_SH__ODD_F16
#undef ISOGI_SH__ODD_F8
#undef ISOGI_SH__PUT_F16
#undef ISOGI_SH__TWICE_F4
#undef ISOGI_SH__ROWS_F16
#undef ISOGI_SH__ROWS_F8
#undef ISOGI_SH__ROW_F4
#undef ISOGI_SH__TURN
#undef ISOGI_SH__EVEN_F4
#undef ISOGI_SH__FMA_F4
#undef ISOGI_SH__HIGH_F4
#undef ISOGI_SH__LESS_F4
#undef ISOGI_SH__LOW_F4
#undef ISOGI_SH__ODD_F4
#undef ISOGI_SH__VECTORS
#undef ISOGI_SH__REST_F4
#undef ISOGI_SH__REST_F8
#undef ISOGI_SH__REST_D4
#undef ISOGI_SH__REST_F16
#undef ISOGI_SH__REST_D8
#undef ISOGI_SH__UNROLL9
#undef ISOGI_SH__APART
#undef ISOGI_SH__MERGE
#undef ISOGI_SH__INLINE
#undef ISOGI_SH__FMA_F8
#undef ISOGI_SH__FMA_F16
#undef ISOGI_SH__FMA_D4
#undef ISOGI_SH__FMA_D8
#undef ISOGI_SH__DEFINE_EVAL
#undef ISOGI_SH__DEFINE_FUSED
#undef ISOGI_SH__LOW_ORDER
#undef ISOGI_SH__HIDE
#undef ISOGI_SH__ROW
#undef ISOGI_SH__DEFINE_ELEVEN
#undef ISOGI_SH__DEFINE_NO_ELEVEN
#undef ISOGI_SH__DEFINE_WIDE_ELEVEN
#undef ISOGI_SH__POLYNOMIALS
#undef ISOGI_SH__PUT_PAIR
#undef ISOGI_SH__PUT_TWO
#undef ISOGI_SH__STEP_TWO
#undef ISOGI_SH__SPLAT_F8
#undef ISOGI_SH__ADD_F8
#undef ISOGI_SH__PUT_ONE
#undef ISOGI_SH__UNROLL25
#undef ISOGI_SH__LANES
#undef ISOGI_SH__CHANNELS
#undef ISOGI_SH__GROUP
#undef ISOGI_SH__BASIS
#undef ISOGI_SH__LOW
#undef ISOGI_SH__NARROW
#undef ISOGI_SH__DERING_ORDER
#undef ISOGI_SH__TOGETHER
#undef ISOGI_SH__DIM
#undef ISOGI_SH__TURNS
#undef ISOGI_SH__FOLDED_ORDER
#endif /* implementation */

/* ---------------------------------------------------------------------------------------------------------------------
   This software is available under two licences: choose the one you prefer.

   A. MIT. Copyright (c) the isogi authors. Permission is hereby granted, free of charge, to any person obtaining a copy of this
   software and associated documentation files (the "Software"), to deal in the Software without restriction, including without
   limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to
   permit persons to whom the Software is furnished to do so, subject to the following conditions: the above copyright notice and
   this permission notice shall be included in all copies or substantial portions of the Software.
   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES
   OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE
   LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
   CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.

   B. Public domain (The Unlicense, https://unlicense.org): this is free and unencumbered software released into the public domain.
   Anyone is free to copy, modify, publish, use, compile, sell, or distribute it, for any purpose, and by any means.
*/
