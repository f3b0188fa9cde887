/* isogi_vol.h - volumes, isosurface rays, smoothed normals and meshes for C and C++   (part of isogi; needs libc, libm, threads)

   (The helper text of this header is written with its implementation.)
*/
#ifndef ISOGI_VOL_H
#define ISOGI_VOL_H

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

/* ---- memory, threads, progress ----------------------------------------------------------------------------------- */

/* All zero, or NULL wherever one is asked for: malloc, one thread per core created and joined per call, silent.
   A context is copied into what is built with it; `user` must outlive that. */
typedef struct isogi_context {
    void *(*alloc)(void *user, size_t size, size_t align); /* align: a power of two up to 64; NULL result = no memory */
    void (*release)(void *user, void *p, size_t size);     /* never called with NULL; set both or neither */
    void (*parallel_for)(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg); /* runs task(arg, 0..n-1) in any
                                                              order, on any threads, and returns when all are done */
    int (*progress)(void *user, double fraction); /* 0..1; non-zero cancels; called on the caller's thread only */
    void *user;
    int threads;    /* 0 = all cores, 1 = serial; ignored where parallel_for is set */
    int force_path; /* instruction path: 0 = best, 1 = scalar */
} isogi_context;

/* What work was done, for tests and tuning. Every call ADDS to the fields it knows; NULL is allowed wherever one is asked for. */
typedef struct isogi_counters {
    uint64_t rays;           /* rays traced */
    uint64_t blocks;         /* pyramid blocks looked at */
    uint64_t cells;          /* cells whose corner range was read */
    uint64_t cubics;         /* cells whose cubic was set up */
    uint64_t texels;         /* texels (trace) or grid points (dvr) computed */
    uint64_t texels_skipped; /* of those asked for, the ones that need no rays */
    uint64_t samples;        /* volume samples taken along viewing rays */
    uint64_t blocks_skipped; /* blocks stepped over because nothing in them is visible */
} isogi_counters;

/* For code that stands on this header (isogi_trace.h, isogi_dvr.h, your own): the context's memory and threads.
   isogi_allocate: count * size bytes, 64-byte aligned, checked for overflow; NULL on failure and for 0 bytes.
   isogi_release: NULL is fine; count and size as allocated.
   isogi_parallel: task(arg, i) for i < n on the context's threads; progress runs from `from` to `to`; ISOGI_CANCELLED when the
   progress callback asks for it (tasks that have begun are finished first). */
ISOGI_API void *isogi_allocate(const isogi_context *context, size_t count, size_t size);
ISOGI_API void isogi_release(const isogi_context *context, void *p, size_t count, size_t size);
ISOGI_API isogi_result isogi_parallel(const isogi_context *context, size_t n, void (*task)(void *arg, size_t i), void *arg,
                                      double from, double to);

/* ---- volumes ------------------------------------------------------------------------------------------------------- */

typedef enum isogi_type { ISOGI_U8 = 0, ISOGI_I8, ISOGI_U16, ISOGI_I16, ISOGI_F32, ISOGI_F64 } isogi_type;

/* A borrowed view of voxels on a regular lattice: data must outlive everything built from it. value = scale * raw + bias.
   Voxel (i,j,k) lies at origin + axes * (i spacing[0], j spacing[1], k spacing[2]): voxels are points at the corners of cells, so
   the volume's box reaches from voxel 0 to voxel size-1. "Grid coordinates" are (i,j,k) as real numbers.
   An axis of size 1 has no cells: such a volume can be sampled, and holds no surface.
   A voxel that is not finite makes the cells around it hold no surface. */
typedef struct isogi_volume {
    const void *data;    /* voxel (0,0,0), aligned for its type */
    isogi_type type;
    size_t size[3];      /* voxels along x, y, z; each 1 .. 2^31-1 */
    ptrdiff_t stride[3]; /* bytes from voxel to voxel along x, y, z, multiples of the type's size; all 0 = packed, x fastest */
    double spacing[3];   /* > 0; 0 = 1 */
    double origin[3];    /* world position of voxel (0,0,0) */
    double axes[9];      /* row-major 3x3, column a = world direction of grid axis a, invertible; all 0 = identity */
    double scale, bias;  /* scale 0 = 1 */
} isogi_volume;

ISOGI_API isogi_result isogi_volume_validate(const isogi_volume *volume);

/* ---- the min-max pyramid: what rays, meshes and renderers skip with --------------------------------------------------- */

typedef struct isogi_pyramid isogi_pyramid; /* const after build: share it between any number of threads */

/* Level 0, 1, 2 have blocks of 4, 16, 64 cells a side. Block (a,b,c) covers voxels cells*a .. min(cells*(a+1), size-1), both
   ends included, and so on; range[a + size[0] * (b + size[1] * c)] = {least, largest} of its finite values, rounded outwards;
   least > largest where there is none. */
typedef struct isogi_level {
    size_t size[3];
    int cells;
    const float (*range)[2];
} isogi_level;

/* One pass over the voxels; right for every isovalue and every transfer function. */
ISOGI_API isogi_result isogi_vol_build(isogi_pyramid **pyramid, const isogi_volume *volume, const isogi_context *context);
ISOGI_API void isogi_vol_free(isogi_pyramid *pyramid); /* NULL is fine */
ISOGI_API const isogi_volume *isogi_vol_volume(const isogi_pyramid *pyramid); /* as given, with the zero defaults filled in */
ISOGI_API const isogi_context *isogi_vol_context(const isogi_pyramid *pyramid);
ISOGI_API isogi_level isogi_vol_level(const isogi_pyramid *pyramid, int level); /* all zero beyond the last */
ISOGI_API void isogi_vol_range(const isogi_pyramid *pyramid, double range[2]);  /* of the finite values; {0,0} if there are none */
ISOGI_API void isogi_vol_to_world(const isogi_pyramid *pyramid, const double grid[3], double world[3]);
ISOGI_API void isogi_vol_to_grid(const isogi_pyramid *pyramid, const double world[3], double grid[3]);

/* ---- values and gradients ---------------------------------------------------------------------------------------------- */

/* At world points; values[count], gradients[count] (per world unit, in world axes); either may be NULL. Outside the box a point
   is moved to its nearest border point. The trilinear gradient jumps at cell faces: the cell on the higher side counts.
   The smooth pair is the uniform cubic B-spline with the voxels as control points over 4x4x4 (continuous second derivatives;
   exact gradient for quadratics; the value is smoothed, not interpolated), continued linearly beyond the border. */
ISOGI_API isogi_result isogi_vol_sample(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                        float (*gradients)[3]);
ISOGI_API isogi_result isogi_vol_sample_smooth(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                               float (*gradients)[3]);

/* ---- rays ---------------------------------------------------------------------------------------------------------------- */

enum { ISOGI_RAY_CAPPED = 1 }; /* flag: outside of the volume's box counts as outside of the surface, so the border closes it */

/* Inside is f >= isovalue. Points are origin + t * dir, t in [tmin, tmax], world units if dir is a unit vector (any length is
   fine). A hit is the smallest t at which inside changes; what the ray finds where it begins, or where it enters the box, is
   no hit (unless capped). Each ray has its own isovalue. NaN anywhere, a zero dir, tmin > tmax: a miss. */
typedef struct isogi_ray {
    double origin[3];
    float dir[3];
    uint32_t flags;
    double tmin, tmax; /* tmax 0 = unlimited */
    double isovalue;
} isogi_ray;

/* cell and place in the cell, so that a ray can go on from a hit without an epsilon. */
typedef struct isogi_hit {
    double t;
    double local[3];  /* position in the cell, 0..1 */
    uint32_t cell[3]; /* grid coordinates are cell + local */
    int32_t side;     /* +1: the ray goes in (values rise); -1: it comes out; 0: a miss, the other fields are zero */
} isogi_hit;

ISOGI_API isogi_result isogi_vol_intersect(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, isogi_hit *hits,
                                           isogi_counters *counters);
/* 1 where there is any hit, else 0: cheaper than the hit itself. */
ISOGI_API isogi_result isogi_vol_occluded(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, uint8_t *occluded,
                                          isogi_counters *counters);
/* Rays that leave from hits, or from any other place given as cell + local that lies ON the surface of this isovalue (its t and
   side are not read). The root they start from is divided out of the cell's cubic: no epsilon, no self-hit, no leak. t of the new
   hit counts from the start. tmax[count], or NULL = unlimited. flags as in isogi_ray. hits may be starts. */
ISOGI_API isogi_result isogi_vol_continue(const isogi_pyramid *pyramid, const isogi_hit *starts, const float (*dirs)[3],
                                          const double *tmax, double isovalue, uint32_t flags, size_t count, isogi_hit *hits,
                                          isogi_counters *counters);

typedef enum isogi_normal_kind {
    ISOGI_NORMAL_SMOOTH = 0, /* gradient of the cubic B-spline: what to shade with */
    ISOGI_NORMAL_TRILINEAR   /* gradient of the trilinear field: what the ray hit */
} isogi_normal_kind;

/* World positions of hits; unit normals there, towards lower values, zero where the gradient vanishes. For a miss: zeros. */
ISOGI_API isogi_result isogi_vol_positions(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, float (*positions)[3]);
ISOGI_API isogi_result isogi_vol_normals(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, isogi_normal_kind kind,
                                         float (*normals)[3]);

/* ---- meshes ---------------------------------------------------------------------------------------------------------------- */

typedef struct isogi_mesh_desc {
    double isovalue;
    int normals; /* non-zero: smoothed normals too */
    int closed;  /* non-zero: the volume's border closes the surface, as ISOGI_RAY_CAPPED does */
} isogi_mesh_desc;

/* Zero it before the first call. Buffers grow and are kept, so that an isovalue slider soon allocates nothing. */
typedef struct isogi_mesh {
    float (*positions)[3];    /* world */
    float (*normals)[3];      /* unit, towards lower values; NULL unless asked for */
    uint32_t (*triangles)[3]; /* counter-clockwise seen from the low side */
    size_t vertex_count, triangle_count;
    size_t vertex_capacity, normal_capacity, triangle_capacity; /* as allocated */
} isogi_mesh;

/* Indexed and watertight: every edge inside the box belongs to exactly two triangles. Vertices lie on lattice edges, exactly on
   the surface. Same input, same bits, for any number of threads. */
ISOGI_API isogi_result isogi_vol_mesh(const isogi_pyramid *pyramid, const isogi_mesh_desc *desc, isogi_mesh *mesh);
ISOGI_API void isogi_vol_mesh_free(const isogi_pyramid *pyramid, isogi_mesh *mesh);

#endif /* ISOGI_VOL_H */
