/* isogi_dvr.h - volume rendering in physical space and in data space, lit by SH visibility, for C and C++
                                                                       (part of isogi; with isogi_sh.h, isogi_vol.h)

   (The helper text of this header is written with its implementation.)
*/
#ifndef ISOGI_DVR_H
#define ISOGI_DVR_H

#include "isogi_sh.h"
#include "isogi_vol.h"

/* ---- transfer functions -------------------------------------------------------------------------------------------------- */

/* Piecewise linear between points of ascending value, constant beyond the ends; two points of one value make a step. */
typedef struct isogi_transfer_point {
    double value;     /* data value */
    float rgb[3];     /* linear colour (albedo for scattered light), not premultiplied, 0..1 */
    float extinction; /* >= 0: per isogi_dvr_desc.unit of length in physical space, per unit of data value in data space */
} isogi_transfer_point;

/* An isosurface of uniform opacity and colour: every crossing composites exactly `opacity`, whatever the gradient (Kraus 2005, 4.2). */
typedef struct isogi_peak {
    double isovalue;
    float rgb[3], opacity; /* 0..1 */
} isogi_peak;

typedef struct isogi_transfer {
    const isogi_transfer_point *points;
    size_t point_count;
    const isogi_peak *peaks;
    size_t peak_count;
} isogi_transfer;

/* rgb and extinction at a data value. */
ISOGI_API void isogi_transfer_at(const isogi_transfer *transfer, double value, float rgb[3], float *extinction);

/* ---- a renderer ------------------------------------------------------------------------------------------------------------- */

typedef enum isogi_dvr_space {
    ISOGI_DVR_PHYSICAL = 0, /* emission and absorption per unit length (Kronander 2011, eq. 1) */
    ISOGI_DVR_DATA          /* scale-invariant: per unit of data along monotone pieces of the ray (Kraus 2005, eq. 4) */
} isogi_dvr_space;

typedef enum isogi_dvr_shading {
    ISOGI_DVR_UNLIT = 0,  /* the transfer function's colour is emitted as it is */
    ISOGI_DVR_VISIBILITY, /* light scattered isotropically, L . V from SH visibility (Kronander 2011) */
    ISOGI_DVR_LOCAL       /* two-sided diffuse shading by the gradient, no shadows */
} isogi_dvr_shading;

typedef struct isogi_dvr_desc {
    const isogi_pyramid *pyramid; /* borrowed */
    isogi_dvr_space space;
    isogi_dvr_shading shading;
    double unit;      /* world length that extinction is per; 0 = the smallest voxel spacing */
    double step;      /* sampling distance along a ray in units of the smallest voxel spacing; 0 = 0.5 */
    int order;        /* SH order of visibility, 1..6; 0 = 3 */
    int directions;   /* visibility rays per grid point; 0 = 64 */
    size_t grid[3];   /* visibility grid points along x, y, z; 0 = about a quarter of the voxels along that axis, at least 2 */
    float opaque;     /* a ray ends at this opacity; 0 = 0.999; 1 = never */
} isogi_dvr_desc;

typedef struct isogi_dvr isogi_dvr;

/* A pinhole camera. width x height pixels, row 0 on top. */
typedef struct isogi_view {
    int width, height;
    float eye[3], target[3], up[3]; /* world; up 0 = +y */
    float fov;                      /* vertical angle of view in degrees; 0 = 45 */
} isogi_view;

/* The ray through the centre of pixel (x, y); fractions are allowed: pixel x covers x-1/2 .. x+1/2. dir is a unit vector. */
ISOGI_API void isogi_view_ray(const isogi_view *view, double x, double y, double origin[3], float dir[3]);

ISOGI_API isogi_result isogi_dvr_create(isogi_dvr **dvr, const isogi_dvr_desc *desc, const isogi_context *context);
ISOGI_API void isogi_dvr_free(isogi_dvr *dvr);

/* Copied. Visibility has to be stepped again before it is right for the new function. */
ISOGI_API isogi_result isogi_dvr_set_transfer(isogi_dvr *dvr, const isogi_transfer *transfer);

/* Computes visibility within about max_rays rays (0 = to the end). *remaining (may be NULL): fraction still to do, 0 = finished. */
ISOGI_API isogi_result isogi_dvr_step(isogi_dvr *dvr, uint64_t max_rays, double *remaining);

/* Interpolated visibility coefficients at world points: visibility[count][order*order]. */
ISOGI_API isogi_result isogi_dvr_sample_visibility(const isogi_dvr *dvr, const float (*points)[3], size_t count, float *visibility);

/* premultiplied[height*width]: linear RGB premultiplied by opacity, opacity. depth[height*width] (NULL = not wanted): distance along
   the ray at which half of the pixel's final opacity is reached, INFINITY where the ray meets nothing.
   lighting: environment and directional lights (point lights too, at the sample); unused when unlit. */
ISOGI_API isogi_result isogi_dvr_render(const isogi_dvr *dvr, const isogi_view *view, const isogi_lighting *lighting,
                                        float (*premultiplied)[4], float *depth, isogi_counters *counters);
ISOGI_API void isogi_dvr_counters(const isogi_dvr *dvr, isogi_counters *counters); /* adds what isogi_dvr_step did so far */

#endif /* ISOGI_DVR_H */
