/* isogi_trace.h - path-traced illumination textures for isosurfaces, for C and C++   (part of isogi; with isogi_sh.h, isogi_vol.h)

   (The helper text of this header is written with its implementation.)
*/
#ifndef ISOGI_TRACE_H
#define ISOGI_TRACE_H

#include "isogi_sh.h"
#include "isogi_vol.h"

/* ---- what to bake ------------------------------------------------------------------------------------------------------ */

typedef enum isogi_trace_mode {
    ISOGI_TRACE_IRRADIANCE = 0, /* RGB irradiance under the lighting of the description */
    ISOGI_TRACE_TRANSFER        /* SH radiance transfer: relit under any distant environment without new rays */
} isogi_trace_mode;

typedef struct isogi_albedo_point {
    double value; /* data value; ascending */
    float rgb[3]; /* 0..1 */
} isogi_albedo_point;

/* All zero but `pyramid`: one texel per voxel, black surface, black sky. The volume, the lights, the environment's image and the
   albedo points are borrowed and must outlive the texture; the description itself is copied. */
typedef struct isogi_trace_desc {
    const isogi_pyramid *pyramid;
    isogi_lighting lighting;   /* IRRADIANCE: what is baked. TRANSFER: unused while baking; see isogi_trace_relight */
    isogi_trace_mode mode;
    int order;                 /* TRANSFER: 1..6; 0 = 5 */
    size_t lattice[3];         /* texels along x, y, z; 0 = as many as voxels along that axis */
    double lattice_min[3], lattice_max[3]; /* grid coordinates (voxels) of the first and last texel; both all zero = the whole volume */
    float albedo[3];           /* diffuse RGB reflectance, 0..1 */
    const isogi_albedo_point *albedo_points; /* piecewise linear in the isovalue, constant beyond its ends; multiplied into albedo
                                                only if albedo is not all zero, else used alone */
    size_t albedo_count;
    int bounces;               /* 0 = light that arrives directly; n = up to n reflections; -1 = all (Russian roulette) */
    int samples;               /* paths per texel; 0 = 64 */
    uint64_t seed;
    float offset;              /* rays start this many voxels along the normal; 0 = the default of 0.25; negative = on the surface itself */
    isogi_normal_kind normals; /* of the hemisphere that is integrated over */
    double isovalue_min, isovalue_max; /* only texels that a surface within this interval reads; both 0 = all */
    int lazy;                  /* non-zero: only texels that were requested */
    int capped;                /* non-zero: the volume's border closes the surface (ISOGI_RAY_CAPPED) */
    int transfer_channels;     /* TRANSFER: 1 = one set of coefficients (grey albedo, the mean), 3 = one per RGB; 0 = 3 if albedo is coloured, else 1 */
} isogi_trace_desc;

typedef struct isogi_trace isogi_trace;

/* ---- create, request, step within a budget, read, free --------------------------------------------------------------------- */

/* context: memory, threads, progress of isogi_trace_step; NULL = the pyramid's. */
ISOGI_API isogi_result isogi_trace_create(isogi_trace **trace, const isogi_trace_desc *desc, const isogi_context *context);
ISOGI_API void isogi_trace_free(isogi_trace *trace);

/* Asks for the texels that isogi_trace_sample reads at these world points. Needed when desc.lazy; else a no-op. */
ISOGI_API isogi_result isogi_trace_request(isogi_trace *trace, const float (*points)[3], size_t count);

/* Works until about max_rays rays are traced (0 = to the end). *remaining (may be NULL): fraction of the work asked for that is
   still to do, 0 = finished. The only writer: not at the same time as any other call on this texture. */
ISOGI_API isogi_result isogi_trace_step(isogi_trace *trace, uint64_t max_rays, double *remaining);

/* Trilinear lookup among the texels that are valid and computed. irradiance[count] (RGB); error[count]: standard error of its
   luminance, NULL = not wanted; a point none of whose texels is ready gets the zero vector and error = INFINITY.
   TRANSFER: under the lighting last given to isogi_trace_relight (that of the description at first). */
ISOGI_API isogi_result isogi_trace_sample(const isogi_trace *trace, const float (*points)[3], size_t count, float (*irradiance)[3],
                                          float *error);
/* TRANSFER only: a new distant lighting (environment and directional lights; point lights are ISOGI_INVALID). No rays. */
ISOGI_API isogi_result isogi_trace_relight(isogi_trace *trace, const isogi_lighting *lighting);
/* TRANSFER only: interpolated coefficients, transfer[count][order*order][channels]; E = sum_i transfer_i light_i. */
ISOGI_API isogi_result isogi_trace_sample_transfer(const isogi_trace *trace, const float (*points)[3], size_t count, float *transfer);
ISOGI_API void isogi_trace_shape(const isogi_trace *trace, size_t lattice[3], int *order, int *channels);

/* Albedo at an isovalue, as the description defines it. */
ISOGI_API void isogi_trace_albedo(const isogi_trace_desc *desc, double isovalue, float rgb[3]);

/* No lattice: irradiance at a user's own world points, each on the isosurface through it, with a unit normal each (NULL = as
   desc.normals says). Uses samples, bounces, seed, offset, albedo, lighting of the description. */
ISOGI_API isogi_result isogi_trace_gather(const isogi_trace_desc *desc, const float (*points)[3], const float (*normals)[3], size_t count,
                                          float (*irradiance)[3], float *error, const isogi_context *context);

/* 1 where the texel has an isosurface of its own, 0 where it has none and is left out of every lookup. texel < lattice. */
ISOGI_API int isogi_trace_valid(const isogi_trace *trace, const size_t texel[3]);
ISOGI_API void isogi_trace_counters(const isogi_trace *trace, isogi_counters *counters); /* adds what was done so far */

#endif /* ISOGI_TRACE_H */
