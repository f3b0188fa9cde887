/* isogi_vol.h - volumes, isosurface rays, smoothed normals and meshes, for C and C++

   Quick start

       #define ISOGI_IMPLEMENTATION
       #include "isogi_vol.h"
       #include <stdio.h>
       int main(void) {
           static float data[32][32][32];
           static isogi_volume volume; // static: all zero, which is the default everywhere
           static isogi_ray ray;
           isogi_pyramid *pyramid; isogi_hit hit;
           for (int i = 0; i < 32768; i++) data[i / 1024][i / 32 % 32][i % 32] = (float)(i % 32 - i / 1024); // f = x - z
           volume.data = data, volume.type = ISOGI_F32, volume.size[0] = volume.size[1] = volume.size[2] = 32;
           ray.origin[0] = ray.origin[1] = 16, ray.origin[2] = 40, ray.dir[2] = -1, ray.isovalue = 4.5;
           if (isogi_vol_build(&pyramid, &volume, NULL) || isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL)) return 1;
           printf("the surface f = 4.5 is met after %g\n", hit.t); // at z = 11.5: after 28.5
           isogi_vol_free(pyramid);
       }

   What it does

   - Looks at voxels that you own, of any common type, stride, spacing and orientation, without copying them.
   - Finds where rays meet the exact trilinear isosurface of ANY isovalue, without extracting anything: first hits, all
     hits, shadows, bundles from one point, and rays that go on from a hit without an epsilon. One min-max pyramid, built once,
     serves every isovalue; where voxels change, it is updated at the cost of what has changed.
   - Says what boxes and pieces of rays can hold, for renderers with transfer functions to skip the rest.
   - Looks at chunks of larger fields, whose surfaces, normals and meshes meet without a seam.
   - The same rays against functions with gradients (isogi_vol_build_field): no voxels, no step size.
   - Values and gradients: trilinear, smoothed by the cubic B-spline (Wyman 2006, 4.1.1) for normals that do not show voxels, or
     interpolated by cubic splines.
   - Indexed, watertight triangle meshes of isosurfaces, with smoothed normals.

   What it does NOT do

   - No files, no windows, no images. No copy of the voxels: keep them alive while a pyramid looks at them, and
     unchanged until isogi_vol_update has been told.
   - No time steps, no unstructured meshes, no level sets.

   Options, to be defined before the implementation

   - ISOGI_IMPLEMENTATION       implements every isogi header that the file includes
   - ISOGI_VOL_IMPLEMENTATION   implements this one alone
   - ISOGI_NO_THREADS           everything runs on the calling thread (Windows before Vista needs it)
   - ISOGI_NO_HUGE_PAGES        blocks of 4 MB and more do not ask Linux for huge pages (nor do they where libc hides madvise:
                                -std=c99 without _DEFAULT_SOURCE)
   - ISOGI_NO_SIMD              plain C only; else SSE2 or NEON, and on x86-64 AVX2 or AVX-512, chosen at run time (gcc, clang)
   - ISOGI_API                  linkage of public functions, if extern does not suit

   Memory       Through isogi_context, or malloc. A pyramid takes about 2.2 bytes for every voxel: bounds of blocks, and all voxels
                in 8 bits of their block's range; and 31 KB. Of a volume that is marked compact it keeps the bounds alone, 1/5 byte for
                every voxel, and rays are slower. Blocks of blocks are whole, so small and thin volumes take more: 3 bytes a voxel with
                100^3 of them, 7 (compact 0.6) where they are 5 voxels thick along one axis, 17 (1.4) with 2, along two axes more:
                cut large fields into thick chunks.
                From malloc, blocks of 4 MB and more ask Linux for huge pages: a pyramid is then built in 1/5 (virtual machines) to 7/10
                of the time. Where your voxels lie in such pages, too (madvise, or isogi_allocate), many rays are 5 to 10 % faster.
                A mesh keeps about a byte of scratch memory for every voxel until it is freed (1 to 2 where rows along x are long
                but no multiple of 64 voxels, 4 where they have 17, 36 where they have 2).
                Stack use stays below 32 KB; where the compiler does not optimise, below 70 (gcc) and 140 (clang), and AVX-512 is not
                used then, which would take more.
   Threads      A pyramid is const once built: any number of threads may read it. Building, updating, prefiltering and meshing use the
                context's threads; rays, samples and normals run on the thread that calls. isogi_thread_pool keeps threads from call
                to call.
   Determinism  The same input gives the same bits for any number of threads. With -ffast-math hits of ordinary numbers are right but for
                more rounding, those of denormal or huge ones (1e300) may be NaN, and nothing that this header says to be the same
                bits on two ways need be so. These bits may differ, too, where the compiler fuses multiply-adds, as gcc does with
                -march=native unless told -ffp-contract=off: hits are then the same, their t and place but for roundings.
                Where a program has denormal numbers flushed to zero (FTZ, DAZ), values that differ by less than 1e-37 are equal; all else
                holds. Any rounding mode will do. Threads of a pool keep the modes of the thread that made them come: set these before.
                Floating-point exceptions must not trap (feenableexcept): what is divided by zero, or is no number, is masked later.
   Accuracy     Rays are solved in double: against a long double reference no hit is missed or added, and t is right to 1e-12 cell, or
                to its own rounding where the origin is far, but for grazing rays, whose t is ill-conditioned by nature. A ray that runs
                within the surface, where the field is the isovalue along a stretch of it, has the side that rounding gives it, and
                may seem to cross. `make test` and `make check` show it.
   Limits       2^31-1 voxels along an axis. Values up to 1e300. Origins of rays within 1e13 cells of the box: from further away,
                whether a ray hits may depend on which call is asked. isogi_vol_sample takes float points: for volumes far from the
                origin use isogi_vol_sample_grid, or hits, which hold cell and place in double.

   How rays work: in a cell the field along a ray is a cubic. Its Bernstein coefficients come from the corners by convex sums, so
   their hull rejects most cells without solving anything; else the first root is bracketed between extrema and refined by Newton
   steps that never leave the bracket. A walk carries the side it is on from cell to cell, and any change of side is a hit: that is
   why nothing leaks through the faces that cells share.
   Hand over many rays at a time. Those of one isovalue that nearly coincide, up to sixteen in a row as in a tile of pixels, go as one,
   twice to five times as fast as alone. Others go through a pool of 64, eight to an instruction, where there is AVX-512: from 64 on
   all are faster than alone (twice to four times), from 500 on nothing is left to gain. There, rays that follow each other from one
   place come down to its leaf together, and where they are many (12 from a surface, 48 from elsewhere), they pass the cells round
   it at once, as far as slopes there let none of them meet the surface; and where any hit will do, and all voxels are finite, a ray is
   done once it is known to pass a block that lies inside and one that lies outside. Without AVX-512 sixteen rays of a batch go in rounds:
   all that do the same, such as to open a node, do it one after the other. Everywhere cells are looked at in float first, from 8-bit
   voxels that lie together in two cache lines for 4x4x4 cells, with an error bound: what is certain needs nothing else, and only cells in
   doubt, the hits and one cell for every 25 rays besides, read your voxels and are solved in double. Of compact volumes there are no such
   voxels: rays go as without AVX-512, and read yours in every cell that they pass in blocks that hold the isovalue.

   History  1.0  first release
*/
#ifndef ISOGI_VOL_H
#define ISOGI_VOL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

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

/* Threads that stay and wait for work, see isogi_thread_pool_create. */
typedef struct isogi_thread_pool isogi_thread_pool;

/* All zero, or NULL wherever one is asked for: malloc, one thread per core created and joined per call, silent.
   A context is copied into what is built with it; `user` and `thread_pool` must outlive that. */
typedef struct isogi_context {
    void *(*alloc)(void *user, size_t size, size_t align); /* align: a power of two up to 64; NULL result = no memory */
    void (*release)(void *user, void *p, size_t size);     /* never called with NULL; set both or neither */
    void (*parallel_for)(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg); /* runs task(arg, 0..n-1) in any
                                                              order, on any threads, and returns when all are done */
    int (*progress)(void *user, double fraction); /* 0..1; non-zero cancels; called on the caller's thread only */
    void *user;
    int threads;    /* 0 or less = all cores, 1 = serial; ignored where parallel_for is set */
    int force_path; /* instruction path of what is built: 0 = best, 1 = plain reference, 2 = portable, 3 = AVX2, 4 = AVX-512 (Ice Lake,
                       Zen 4), and single rays like batches; no more than the machine has; other numbers: the best */
    isogi_thread_pool *thread_pool; /* NULL: threads are created for each call; ignored where parallel_for is set */
} isogi_context;

/* What work was done, for tests and tuning: it depends on which rays go together, what they hit does not. Every call ADDS to the fields it
   knows; NULL is allowed wherever one is asked for. */
typedef struct isogi_counters {
    uint64_t rays;           /* rays traced; to the next hit counts anew */
    uint64_t blocks;         /* pyramid blocks looked at */
    uint64_t cells;          /* cells whose corner range was read */
    uint64_t cubics;         /* cells whose cubic was set up in double */
    uint64_t texels;         /* texels (trace) or grid points (dvr) computed */
    uint64_t texels_skipped; /* of those asked for, the ones that need no rays */
    uint64_t samples;        /* volume samples taken along viewing rays; in isogi_dvr_counters as told there */
    uint64_t blocks_skipped; /* blocks stepped over because nothing in them is visible */
} isogi_counters;

/* For code that stands on this header (isogi_trace.h, isogi_dvr.h, your own): the context's memory and threads.
   isogi_allocate: count * size bytes, 64-byte aligned, checked for overflow; NULL on failure and for 0 bytes.
   isogi_release: NULL is fine; count and size as allocated.
   isogi_parallel: task(arg, i) for i < n on the context's threads; progress runs from `from` to `to`; ISOGI_CANCELLED when the
   progress callback has asked for it, be it at the very end (tasks that have begun are finished first). */
ISOGI_API void *isogi_allocate(const isogi_context *context, size_t count, size_t size);
ISOGI_API void isogi_release(const isogi_context *context, void *p, size_t count, size_t size);
ISOGI_API isogi_result isogi_parallel(const isogi_context *context, size_t n, void (*task)(void *arg, size_t i), void *arg,
                                      double from, double to);

/* A thread pool, for the contexts of programs that make many short calls on many cores: to create and to join a thread takes 15 to 60 us,
   for each of them and every time. threads: as in a context, the calling thread included; a context's own `threads`, where it is not 0, is
   a limit within the pool. They are created when work first wants them; between calls they sleep, after some 20 us of waiting for more.
   Any number of contexts and of threads may use a pool: for a call that finds it at work for another, or that is made by a task of its own,
   as many threads are created and joined. Results do not depend on it.
   ISOGI_INVALID: threads below 0. context: whose memory it takes, 3 KB; NULL = malloc. To be freed when no call is at work that uses it. */
ISOGI_API isogi_result isogi_thread_pool_create(isogi_thread_pool **pool, int threads, const isogi_context *context);
ISOGI_API void isogi_thread_pool_free(isogi_thread_pool *pool); /* NULL is fine */
/* For code that stands on this header and makes many isogi_parallel calls in one of its own: from begin to end the context has a pool,
   if it had none, runs more than one thread, and there is memory for it. Hand on what begin returns, which may be NULL. */
ISOGI_API isogi_thread_pool *isogi_thread_pool_begin(isogi_context *context);
ISOGI_API void isogi_thread_pool_end(isogi_context *context, isogi_thread_pool *pool);

/* Numbers in 16 bits (IEEE binary16), for the same: to nearest, ties to even; beyond the range, 65504, the largest finite one; NaN is 0;
   patterns of infinities and NaN are read as the numbers after 65504.
   All in integers, but for what is below 2^-14 on the way back: no denormal float is touched, which would take a hundred times as long. */
static inline uint16_t isogi_float_to_half(float x) { /* masks, not casts, which some have C++ warn of */
    const uint32_t one = 1;
    uint32_t bits, sign, shift, rest, half;
    memcpy(&bits, &x, sizeof bits);
    sign = bits >> 16 & 0x8000u, bits &= 0x7fffffffu;
    if (bits > 0x7f800000u) return 0;
    if (bits >= 0x477fe000u) half = 0x7bffu; /* 65504 */
    else if (bits < 0x33000000u) half = 0;   /* below 2^-25 */
    else if (bits >= 0x38800000u) half = (bits - 0x38000000u + 0xfffu + (bits >> 13 & 1)) >> 13; /* from 2^-14: normal */
    else { /* denormal: the mantissa with its leading 1, shifted */
        shift = 126 - (bits >> 23), bits = (bits & 0x7fffffu) | 0x800000u;
        rest = bits & ((one << shift) - 1), bits >>= shift;
        half = bits + (rest > one << (shift - 1) || (rest == one << (shift - 1) && (bits & 1)));
    }
    return (sign | half) & 0xffffu;
}

static inline float isogi_half_to_float(uint16_t half) {
    const uint16_t rest = half & 0x7fffu;
    uint32_t bits = rest * 0x2000u + 0x38000000u;
    float x;
    memcpy(&x, &bits, sizeof x);
    if (rest < 0x400u) x = rest * (1.0f / 16777216); /* 2^-24 */
    return half & 0x8000u ? -x : x;
}

/* ---- volumes ------------------------------------------------------------------------------------------------------- */

typedef enum isogi_type { ISOGI_U8 = 0, ISOGI_I8, ISOGI_U16, ISOGI_I16, ISOGI_F32, ISOGI_F64 } isogi_type;

/* A borrowed view of voxels on a regular lattice: data must outlive everything built from it. value = scale * raw + bias.
   Voxel (i,j,k) lies at origin + axes * (i spacing[0], j spacing[1], k spacing[2]): voxels are points at the corners of cells, so
   the volume's box reaches from voxel 0 to voxel size-1. "Grid coordinates" are (i,j,k) as real numbers.
   An axis of size 1 has no cells: such a volume can be sampled, and holds no surface.

   Voxels that are not finite: a cell with one at a corner holds no surface for rays and meshes, no ray hits it, no mesh has a triangle
   in it, and what a ray knew of its side is forgotten in it; all other cells are as if it were not there. Ranges leave such voxels out;
   rays and meshes skip regions that have no others.
   Trilinear samples next to one, and smooth samples within two voxels of one (at two, some), are not finite themselves. Smooth normals
   of hits and of meshes are trilinear within two.

   Chunks: a larger field may be looked at in parts, each a volume of its own. Neighbours share the voxels of one plane, and every part
   owns the cells between its own voxels. halo_low and halo_high say how many voxels of the larger field lie in memory before
   and behind those, at the same strides: rays and meshes do not enter them, only the smoothed values and gradients read them (one on
   each side is enough). `first` says where in the larger field voxel (0,0,0) lies. Then the parts have the hits, samples and normals of
   the whole (to within the rounding of coordinates), and mesh vertices on the plane that two parts share are the same bits in both.
   Where such a plane is itself a sheet of the isovalue without thickness, which the whole reports once, each part reports its own side. */
typedef struct isogi_volume {
    const void *data;    /* voxel (0,0,0), aligned for its type */
    isogi_type type;
    size_t size[3];      /* voxels along x, y, z; each 1 .. 2^31-1 */
    ptrdiff_t stride[3]; /* bytes from voxel to voxel along x, y, z, multiples of the type's size; all 0 = packed, x fastest,
                            halo included; a single 0 repeats one voxel along that axis. Where another axis than x is contiguous in
                            memory pyramids take six to eleven times as long to build: let that one be x, and `axes` turn it */
    double spacing[3];   /* > 0; 0 = 1 */
    double origin[3];    /* world position of voxel (0,0,0), of that of the larger field for a chunk */
    double axes[9];      /* row-major 3x3, column a = world direction of grid axis a; all 0 = identity; its determinant finite and above
                            1e-9 of the product of the columns' lengths, and with spacing its inverse finite */
    double scale, bias;  /* scale 0 = 1; up to 1e300, and so is |scale raw| + |bias| for every finite number that the type holds; of
                            ISOGI_F64, for those that are in data */
    /* of a chunk: see above; first up to 2^53, halos up to 2^31-1, without use along an axis of one voxel */
    size_t first[3], halo_low[3], halo_high[3];
    int compact; /* not 0: a pyramid keeps bounds alone, in 1/5 byte for every voxel instead of 2.2, and is built in half the time. Rays
                    have the same hits, but look at four times as many cells, read the voxels of each, and do without AVX-512: where
                    there is that, single ones take twice as long, batches five times; else up to two thirds as long again. Nothing
                    but rays is slower. 0: for speed */
} isogi_volume;

/* Checks a description, but for the voxels themselves, which are not read. */
ISOGI_API isogi_result isogi_volume_validate(const isogi_volume *volume);
/* What is wrong with it: the member at fault and why, as "spacing: negative", for whoever writes the program; NULL where it is valid. */
ISOGI_API const char *isogi_volume_fault(const isogi_volume *volume);

/* Voxels as all of the library reads them, in double; for a volume whose zero defaults are filled in: that of isogi_vol_volume.
   isogi_volume_corners: the eight values of a cell, corner x + 2y + 4z; an axis of one voxel repeats it. 1 if all are finite. A cell
   that the volume does not have: zeros, and 0.
   isogi_volume_range: {least, largest} finite voxel of the box first..last, both ends included and cut to the volume; exact, voxel by
   voxel. least > largest where there is none. */
ISOGI_API int isogi_volume_corners(const isogi_volume *volume, const uint32_t cell[3], double corner[8]);
ISOGI_API void isogi_volume_range(const isogi_volume *volume, const size_t first[3], const size_t last[3], double range[2]);

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
/* After voxels first..last (both ends included, cut to the volume) have changed: brings the pyramid to what a new build would give, bit
   by bit, at a cost that goes with the box. Only where the range of the whole volume changes the 8-bit bounds are made anew, which costs
   about half a build; a lost extreme may have to be looked for in other blocks. The only call that writes to a pyramid: nobody may read
   it meanwhile. Things built from the pyramid (isogi_trace, isogi_dvr) do not notice. counters->blocks: blocks of 4^3 cells whose voxels
   were read. Reports no progress, cannot be cancelled. ISOGI_INVALID for an empty box or one beyond the volume; ISOGI_NO_MEMORY: the
   pyramid is as it was. */
ISOGI_API isogi_result isogi_vol_update(isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], isogi_counters *counters);
ISOGI_API void isogi_vol_free(isogi_pyramid *pyramid); /* NULL is fine */
/* Of no pyramid, these give NULL, zeros, or do nothing. */
ISOGI_API const isogi_volume *isogi_vol_volume(const isogi_pyramid *pyramid); /* as given, with the zero defaults filled in */
ISOGI_API const isogi_context *isogi_vol_context(const isogi_pyramid *pyramid);
ISOGI_API isogi_level isogi_vol_level(const isogi_pyramid *pyramid, int level); /* all zero beyond the last */
ISOGI_API int isogi_vol_finite(const isogi_pyramid *pyramid); /* 1 if every voxel is a finite number */
/* isogi_volume_corners for inner loops: nothing is checked; the cell must be one of the pyramid's volume, which must hold voxels. */
ISOGI_API int isogi_vol_corners(const isogi_pyramid *pyramid, const int cell[3], double corner[8]);
ISOGI_API void isogi_vol_range(const isogi_pyramid *pyramid, double range[2]);  /* of the finite values; {0,0} if there are none */
/* What the field can be in the box of voxels first..last, both ends included and cut to the volume, and in all cells between them; by
   way of the pyramid, so that large boxes are no dearer than small ones but for their rim.
   isogi_vol_box_range: {least, largest} finite value, rounded outwards to float where whole blocks lie in the box; least > largest where
   there is none.
   isogi_vol_may_hold: 0 if the field takes no value of any of the closed intervals ranges[n] = {low, high}, else 1. */
ISOGI_API isogi_result isogi_vol_box_range(const isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], double range[2]);
ISOGI_API int isogi_vol_may_hold(const isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], const double (*ranges)[2],
                                 size_t range_count);
ISOGI_API void isogi_vol_to_world(const isogi_pyramid *pyramid, const double grid[3], double world[3]);
ISOGI_API void isogi_vol_to_grid(const isogi_pyramid *pyramid, const double world[3], double grid[3]);

/* ---- fields given by a function -------------------------------------------------------------------------------------------- */

/* A field that nobody has sampled: f(point) and its gradient in the world's box low..high. Its pyramid serves rays as any other does
   (intersect, intersect_all, occluded, continue, bundle, bundle_all, next_interval, positions, normals, sample), for every isovalue at
   once. Hits carry cells of a lattice that only serves skipping: 2, 64 or 1000 cells a side give the same hits. Both kinds of normals, and
   both kinds of samples, are those of the function. isogi_vol_volume tells the lattice, with data = NULL; there is nothing to be meshed,
   updated, baked or volume-rendered: ISOGI_INVALID.

   What is guaranteed rests on one bound, of how fast the gradient turns: in a piece of ray that begins with value g and slope g', there
   is no root within (g' + sqrt(g'^2 + 2 M |g|)) / M if the slope leads away from the surface (with -g' if it leads there), and at most
   one within |g'| / M, M = hessian |dir|^2 (Taylor). The search goes from one such end to the next, so it has no step size and misses
   no crossing, however close two of them are, but for one kind: where value and slope vanish together (tangents), it goes on by steps
   of at least 2^-16 cell, and may overlook a dip through the surface that is shorter than that, hence shallower than
   hessian * (2^-16 cell)^2. Where a ray runs along the surface these steps grow by a tenth each, so that no ray takes more than some
   hundred of them in a cell. All of this in double, hence to within the rounding errors of the function itself. t is right to those.
   A function that is not as smooth as `hessian` claims loses hits, but nothing else; so does one whose values, or hessian |dir|^2, are
   beyond 1e148, or below 1e-160.
   counters: blocks as for volumes, cubics = calls of the function. */
typedef struct isogi_field {
    /* gradient per world unit, never NULL; called from any thread; a result that is not finite: no surface in the rest of that cell;
       where it is met between two ends of a step that lie on different sides, the hit is there */
    double (*value)(void *user, const double point[3], double gradient[3]);
    void *user;            /* must outlive the pyramid */
    double hessian;        /* > 0: |gradient f(p) - gradient f(q)| <= hessian |p - q| in the whole box: a bound of the Hessian's norm */
    /* the same for a smaller box, where that is less; NULL = hessian everywhere */
    double (*hessian_in)(void *user, const double low[3], const double high[3]);
    double low[3], high[3]; /* low < high */
    size_t cells[3];        /* of the lattice, along x, y, z; 0 = 64; some 1/8 byte for each */
} isogi_field;

ISOGI_API isogi_result isogi_vol_build_field(isogi_pyramid **pyramid, const isogi_field *field, const isogi_context *context);

/* ---- values and gradients ---------------------------------------------------------------------------------------------- */

/* What lies between the voxels. Value and gradient of the cubic filters come from 4x4x4 voxels, which continue linearly beyond the border.
   On the Marschner-Lobb signal at 81^3 voxels: RMS error of values (of a range of 1), mean angle between gradients, and by how much
   samples leave the range of their voxels, all but for two voxels at the border (where the cubic ones err twice as much, and that of
   prefiltered voxels ten times): trilinear 0.010, 17 degrees, 0; B-spline 0.017, 3.2 degrees, 0; Catmull-Rom 0.0025, 4.4 degrees, 0.006;
   B-spline of prefiltered voxels (isogi_vol_prefilter) 0.0004, 0.7 degrees, 0.012. At 41^3: 0.034, 32, 0; 0.046, 20, 0; 0.025, 22, 0;
   0.016, 12, 0.003. */
typedef enum isogi_filter {
    ISOGI_FILTER_LINEAR = 0, /* trilinear: what rays and meshes see. Its gradient jumps at cell faces: the cell on the higher side counts */
    ISOGI_FILTER_BSPLINE,    /* uniform cubic B-spline with the voxels as control points: smooths; continuous second derivatives; the
                                gradient is exact for quadratics (Wyman 2006, 4.1.1) */
    ISOGI_FILTER_CATMULL_ROM /* Catmull-Rom spline (Catmull and Rom 1974): passes through the voxels, hence overshoots between them;
                                continuous gradient; value and gradient are exact for quadratics */
} isogi_filter;

/* At world points; values[count], gradients[count] (per world unit, in world axes); either may be NULL. Outside the box a point
   is moved to its nearest border point (between sheared axes, along these); a coordinate that is not finite leaves it somewhere in the
   box. Many points a call go several times faster than one, and fastest where neighbours follow each other: points far apart wait for
   memory. Points are located in double, or to 2^-24 cell where floats can; the rest is float: values err by at most 2^-21 (those of cubic
   filters by 2^-19) of the largest number that enters them (a voxel, the bias), gradients by 2^-21 (those of cubic filters by 2^-20) of
   the largest difference between voxels that enter them, per spacing; doubles are sampled in double. The path of instructions may change
   results within that; the size of a call does not. */
ISOGI_API isogi_result isogi_vol_sample(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                        float (*gradients)[3]); /* trilinear */
ISOGI_API isogi_result isogi_vol_sample_smooth(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                               float (*gradients)[3]); /* B-spline */
ISOGI_API isogi_result isogi_vol_sample_filtered(const isogi_pyramid *pyramid, isogi_filter filter, const float (*points)[3], size_t count,
                                                 float *values, float (*gradients)[3]);
/* The same at grid coordinates, in double: for volumes far from the origin. Gradients are per world unit all the same. */
ISOGI_API isogi_result isogi_vol_sample_grid(const isogi_pyramid *pyramid, isogi_filter filter, const double (*points)[3], size_t count,
                                             float *values, float (*gradients)[3]);
/* Coefficients with which the B-spline filter interpolates: make a volume of them (float, packed, no scale or bias, else as before),
   build its pyramid and sample it by ISOGI_FILTER_BSPLINE. That is the natural cubic spline: smoother than Catmull-Rom and nearer
   to smooth fields, for 4 bytes a voxel and a pass over the volume; rays and meshes should go on with the voxels themselves.
   coefficients: size[0] * size[1] * size[2] floats, x fastest. A halo is not read; a voxel that is not finite, or beyond 1e36, counts
   as 0. After ISOGI_CANCELLED the coefficients are of no use. */
ISOGI_API isogi_result isogi_vol_prefilter(const isogi_volume *volume, float *coefficients, const isogi_context *context);

/* ---- rays ---------------------------------------------------------------------------------------------------------------- */

enum {
    ISOGI_RAY_CAPPED = 1, /* flag: outside of the volume's box counts as outside of the surface, so the border closes it, but for cells that
                             are not finite: no ray hits their border */
    ISOGI_RAY_ONWARD = 2  /* of isogi_vol_continue: every ray goes on in the direction in which it met its start, so that start.side tells
                             on which side of the surface it is now */
};

/* Inside is f >= isovalue. Points are origin + t * dir, t in [tmin, tmax], world units if dir is a unit vector (any length is
   fine). A hit is the smallest t at which inside changes; the side that the ray finds where it begins, or where it enters the box, is
   no hit (unless capped). The point of a crossing is inside itself: a ray that ends on the surface, at tmax, meets it if it goes in
   there, not if it comes out; one that begins there, if it comes out. Each ray has its own isovalue. A miss: NaN anywhere, an infinite
   isovalue, a zero dir, tmin > tmax.
   A ray that runs in a face between cells goes through one of the two, and rounding may choose another one for another tmin: the same
   values, hence the same hits, but where one of the cells is not finite. Likewise a crossing that lies in the volume's border may be -1
   or -2 to a capped ray, and none to another. */
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
    int32_t side;     /* +1: the ray goes in (values rise); -1: it comes out; +2, -2: the same through the volume's border
                         (capped rays only); 0: a miss, the other fields are zero. A field
                         that touches the isovalue from below in a point and goes back is no hit unless a voxel or
                         rounding puts that point inside, and then two, or one of +1 for a layer without thickness */
} isogi_hit;

ISOGI_API isogi_result isogi_vol_intersect(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, isogi_hit *hits,
                                           isogi_counters *counters);
/* 1 where there is any hit, else 0: cheaper than the hit itself. */
ISOGI_API isogi_result isogi_vol_occluded(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, uint8_t *occluded,
                                          isogi_counters *counters);
/* Rays that leave from hits, or from any other place given as cell + local that lies ON the surface of this isovalue (its t is not read;
   of its side, only whether it is a cap, unless with ISOGI_RAY_ONWARD). The root they start from is divided out of the cell's cubic: no
   epsilon, no self-hit, no leak. Cells end at size - 2, where local is 1 at the border, and a miss is no start: its ray would leave from
   voxel 0. A start may be 1e-9 cell off the surface. So where the surface comes back within as much, through the face of a cell that lies
   between, it is not told from the start, but for rays that go onward: they miss no crossing, however close it follows. t of the new hit
   counts from the start. Where the surface has no thickness (a single layer of voxels that equal the isovalue) a ray touches it in one
   point: that is a hit with side +1, and the ray goes on outside. tmax[count] (0 = unlimited), or NULL. flags as in isogi_ray. hits may be
   starts. */
ISOGI_API isogi_result isogi_vol_continue(const isogi_pyramid *pyramid, const isogi_hit *starts, const float (*dirs)[3],
                                          const double *tmax, double isovalue, uint32_t flags, size_t count, isogi_hit *hits,
                                          isogi_counters *counters);

/* Every hit of each ray, in order: those of ray i are hits[i * capacity + n], n < counts[i]. counts[i] = capacity + 1 where there are
   more than fit; hits[i * capacity + capacity - 1] with isogi_vol_continue and ISOGI_RAY_ONWARD leads to them. The same as
   isogi_vol_intersect and then isogi_vol_continue, with ISOGI_RAY_ONWARD, along the ray until it misses, with t from the ray's own origin
   throughout. hits may be NULL if capacity is 0. Sides alternate, but for touched layers without thickness, which leave the ray outside,
   and for cells that are not finite, after which the side is not known. ISOGI_TOO_LARGE if count * capacity hits cannot be addressed. */
ISOGI_API isogi_result isogi_vol_intersect_all(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, size_t capacity,
                                               isogi_hit *hits, size_t *counts, isogi_counters *counters);

/* What a renderer may not skip: the next piece of the ray, at or behind t = from, that runs through blocks of 4^3 cells in which the
   field may take a value of one of the closed intervals ranges[n] = {low, high}; pieces of neighbouring blocks are one. 1 and
   interval = {begin, end} within the ray's tmin and tmax, or 0 and no change if there is none. Between the pieces the field takes none
   of these values, but for roundings of 1e-12 of the way from its origin. The ray's isovalue and flags are not read.
       for (t = ray.tmin; isogi_vol_next_interval(pyramid, &ray, ranges, n, t, piece, NULL); t = piece[1]) ...
   counters->blocks: blocks looked at. */
ISOGI_API int isogi_vol_next_interval(const isogi_pyramid *pyramid, const isogi_ray *ray, const double (*ranges)[2], size_t range_count,
                                      double from, double interval[2], isogi_counters *counters);

/* Rays that share everything but the direction: what gathering light at a point needs. The same bits as rays of their own, but for rays
   that begin or end in a voxel which has the isovalue itself, as they do in batches: what is decided there by rounding may differ. And but
   for starts a little off the surface, which a ray of its own may meet again right behind them (isogi_vol_continue), and a bundle not. */
typedef struct isogi_bundle {
    const isogi_hit *start; /* the rays leave from this hit as in isogi_vol_continue, and origin and tmin are not read; NULL: from origin */
    double origin[3];
    double tmin, tmax; /* tmax 0 = unlimited */
    double isovalue;
    uint32_t flags; /* as in isogi_ray; ISOGI_RAY_ONWARD for rays from a start, which all leave it on the side that its ray went to */
} isogi_bundle;

ISOGI_API isogi_result isogi_vol_bundle(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3], size_t count,
                                        isogi_hit *hits, isogi_counters *counters);
ISOGI_API isogi_result isogi_vol_bundle_occluded(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3],
                                                 size_t count, uint8_t *occluded, isogi_counters *counters);
/* Many bundles of `each` rays in one call, with the same bits: ray i of bundle n has dirs[n * each + i] and hits[n * each + i]. Rays of the
   next bundle come as soon as those of one have ended, which makes bundles of a few dozen rays a third faster. Starts must not lie among
   the hits. ISOGI_TOO_LARGE if bundle_count * each rays cannot be addressed. */
ISOGI_API isogi_result isogi_vol_bundles(const isogi_pyramid *pyramid, const isogi_bundle *bundles, size_t bundle_count,
                                         const float (*dirs)[3], size_t each, isogi_hit *hits, isogi_counters *counters);
ISOGI_API isogi_result isogi_vol_bundles_occluded(const isogi_pyramid *pyramid, const isogi_bundle *bundles, size_t bundle_count,
                                                  const float (*dirs)[3], size_t each, uint8_t *occluded, isogi_counters *counters);
/* Every hit of each ray, in order, as isogi_vol_intersect_all gives them. */
ISOGI_API isogi_result isogi_vol_bundle_all(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3], size_t count,
                                            size_t capacity, isogi_hit *hits, size_t *counts, isogi_counters *counters);

typedef enum isogi_normal_kind {
    ISOGI_NORMAL_SMOOTH = 0, /* gradient of the cubic B-spline: what to shade with; trilinear within two voxels of one not finite */
    ISOGI_NORMAL_TRILINEAR   /* gradient of the trilinear field: what the ray hit */
} isogi_normal_kind;

/* World positions of hits; unit normals there, towards lower values, zero where the gradient vanishes (the smoothed one: but for
   rounding). For a miss: zeros. */
ISOGI_API isogi_result isogi_vol_positions(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, float (*positions)[3]);
ISOGI_API isogi_result isogi_vol_normals(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, isogi_normal_kind kind,
                                         float (*normals)[3]);

/* ---- meshes ---------------------------------------------------------------------------------------------------------------- */

typedef struct isogi_mesh_desc {
    double isovalue; /* NaN, infinite: ISOGI_INVALID */
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
    void *scratch; /* the library's own, kept for the next call */
    size_t scratch_size;
} isogi_mesh;

/* Indexed and watertight: every edge inside the box belongs to exactly two triangles, which run along it in opposite directions. The mesh
   is a manifold with the topology of the trilinear surface, tunnels through cells included. Vertices lie on lattice edges, and a few
   inside of cells where the topology asks for them, on the surface to within the rounding of a float. Where a voxel equals the isovalue,
   several vertices meet in it and triangles may have no area, an eighth of all in a scan of bytes: take 39.5 for 40. Cells that touch a
   voxel that is not finite have no surface: the mesh is open there. Closed: the parts of the border that are inside belong to it, with
   outward normals at the voxels.
   Same input, same bits, for any number of threads. ISOGI_TOO_LARGE for more than 2^32-1 vertices. Only the passes that come before
   the writing of the mesh (half of the work) can be cancelled; on any failure the mesh stays as it was.
   A mesh may be used for several volumes, one after the other, if their contexts have the same allocator. */
ISOGI_API isogi_result isogi_vol_mesh(const isogi_pyramid *pyramid, const isogi_mesh_desc *desc, isogi_mesh *mesh);
/* Any pyramid whose context has the allocator of the mesh; afterwards the mesh is zero and ready for use again. */
ISOGI_API void isogi_vol_mesh_free(const isogi_pyramid *pyramid, isogi_mesh *mesh);

#endif /* ISOGI_VOL_H */

/* ==================================================================================================================== */
#if (defined(ISOGI_IMPLEMENTATION) || defined(ISOGI_VOL_IMPLEMENTATION)) && !defined(ISOGI_VOL_IMPLEMENTED)
#define ISOGI_VOL_IMPLEMENTED

#include <float.h>
#include <math.h>
#include <stdlib.h>
#ifndef ISOGI_NO_THREADS
#ifdef _WIN32
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#include <windows.h>
#else
#include <pthread.h>
#include <unistd.h>
#endif
#endif
#if defined(__linux__) && !defined(ISOGI_NO_HUGE_PAGES)
#include <sys/mman.h>
#ifdef MADV_HUGEPAGE /* else libc hides it */
#define ISOGI_VOL__HUGE_PAGE 2097152
#endif
#endif

#define ISOGI_VOL__ON_SURFACE 1e-9 /* cell: how far off the surface a start may be */
#define ISOGI_VOL__ROUNDING (1.0 / 562949953421312) /* 2^-49, 16 roundings: of places along rays, relative to the way there */
#define ISOGI_VOL__UNLIMITED 1e300 /* stands for infinity, which -ffast-math does not promise to keep */
#define ISOGI_VOL__LEVELS 3
#define ISOGI_VOL__NODE_LEVELS 7 /* 4^7 cells a side */
#define ISOGI_VOL__FAST_SIZE 8192 /* voxels along an axis up to which rays and samples go fast */
#if (defined(__GNUC__) || defined(__clang__)) && !defined(__TINYC__)
#define ISOGI_VOL__INLINE static inline __attribute__((always_inline))
#define ISOGI_VOL__NOINLINE __attribute__((noinline))
#define ISOGI_VOL__COLD __attribute__((cold, noinline)) /* small rather than fast: quick to compile */
#define ISOGI_VOL__UNLIKELY(x) __builtin_expect(!!(x), 0)
#define ISOGI_VOL__PREFETCH(address) __builtin_prefetch((const void *)(address))
#define ISOGI_VOL__PRAGMA(text) _Pragma(#text)
#define ISOGI_VOL__UNROLL(times) ISOGI_VOL__PRAGMA(GCC unroll times)
#else
#define ISOGI_VOL__UNROLL(times)
#define ISOGI_VOL__NOINLINE
#define ISOGI_VOL__COLD
#define ISOGI_VOL__INLINE static inline
#define ISOGI_VOL__UNLIKELY(x) (x)
#define ISOGI_VOL__PREFETCH(address) ((void)(address))
#endif
#if (defined(__SSE2__) || defined(_M_X64)) && !defined(ISOGI_NO_SIMD)
#define ISOGI_VOL__SSE2
#include <emmintrin.h>
#endif
/* gcc for Windows does not align its stack for 32-byte vectors: no wide paths there */
#if defined(ISOGI_VOL__SSE2) && defined(__x86_64__) && (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 8 && !defined(_WIN32))) && \
    !defined(__TINYC__)
#define ISOGI_VOL__AVX
#define ISOGI_VOL__TARGET(features) __attribute__((target(features)))
#define ISOGI_VOL__AVX512 \
    ISOGI_VOL__TARGET("avx512f,avx512bw,avx512dq,avx512vl,avx512bitalg,avx512vbmi,avx512vbmi2,avx512vpopcntdq,gfni,fma,bmi,bmi2")
#include <immintrin.h>
#endif
#if defined(__aarch64__) && defined(__ARM_NEON) && !defined(__ARM_BIG_ENDIAN) && !defined(ISOGI_NO_SIMD) && !defined(__TINYC__)
#define ISOGI_VOL__NEON
#include <arm_neon.h>
#endif
enum { ISOGI_VOL__PATH_PLAIN = 1, ISOGI_VOL__PATH_BASE, ISOGI_VOL__PATH_AVX2, ISOGI_VOL__PATH_AVX512 };

/* ==== memory ========================================================================================================= */

/* The allocator's own pointer is kept just below the aligned block, so that malloc serves any alignment. Large blocks ask for huge pages:
   the first touch of a small one costs .1 to 8 us, which for a pyramid is more than the rest of its making. */
static void *isogi_vol__default_alloc(size_t size, size_t align) {
    char *base, *aligned;
#ifdef ISOGI_VOL__HUGE_PAGE
    const int huge = size >= 2 * ISOGI_VOL__HUGE_PAGE;
    if (huge) align = ISOGI_VOL__HUGE_PAGE;
#endif
    if (size > SIZE_MAX - align - sizeof(void *)) return NULL;
    base = (char *)malloc(size + align + sizeof(void *));
    if (!base) return NULL;
    aligned = base + sizeof(void *);
    aligned += (align - (uintptr_t)aligned % align) % align;
    memcpy(aligned - sizeof(void *), &base, sizeof base);
#ifdef ISOGI_VOL__HUGE_PAGE
    if (huge) (void)madvise(aligned, size - size % ISOGI_VOL__HUGE_PAGE, MADV_HUGEPAGE); /* refused, it is as good, but slower */
#endif
    return aligned;
}

static void isogi_vol__default_release(void *p) {
    char *base;
    memcpy(&base, (char *)p - sizeof(void *), sizeof base);
    free(base);
}

ISOGI_API void *isogi_allocate(const isogi_context *context, size_t count, size_t size) {
    if (!count || !size || count > SIZE_MAX / size) return NULL;
    if (context && context->alloc && context->release) return context->alloc(context->user, count * size, 64);
    return isogi_vol__default_alloc(count * size, 64);
}

ISOGI_API void isogi_release(const isogi_context *context, void *p, size_t count, size_t size) {
    if (!p) return;
    if (context && context->alloc && context->release) context->release(context->user, p, count * size);
    else isogi_vol__default_release(p);
}

/* ==== threads ======================================================================================================== */

#define ISOGI_VOL__MAX_THREADS 256
#if defined(ISOGI_NO_THREADS)
typedef int isogi_vol__lock;
#define ISOGI_VOL__LOCK(lock) ((void)(lock))
#define ISOGI_VOL__UNLOCK(lock) ((void)(lock))
#elif defined(_WIN32)
typedef HANDLE isogi_vol__thread;
typedef CRITICAL_SECTION isogi_vol__lock;
typedef CONDITION_VARIABLE isogi_vol__signal;
#define ISOGI_VOL__WORKER(name) DWORD WINAPI name(LPVOID p)
#define ISOGI_VOL__LOCK_SET(lock) InitializeCriticalSection(lock)
#define ISOGI_VOL__LOCK_END(lock) DeleteCriticalSection(lock)
#define ISOGI_VOL__LOCK(lock) EnterCriticalSection(lock)
#define ISOGI_VOL__UNLOCK(lock) LeaveCriticalSection(lock)
#define ISOGI_VOL__SIGNAL_SET(signal) InitializeConditionVariable(signal)
#define ISOGI_VOL__SIGNAL_END(signal) ((void)(signal))
#define ISOGI_VOL__WAIT(signal, lock) SleepConditionVariableCS(signal, lock, INFINITE)
#define ISOGI_VOL__WAKE_ONE(signal) WakeConditionVariable(signal)
#define ISOGI_VOL__WAKE_ALL(signal) WakeAllConditionVariable(signal)
static int isogi_vol__start(isogi_vol__thread *thread, DWORD(WINAPI *worker)(LPVOID), void *p) {
    *thread = CreateThread(NULL, 0, worker, p, 0, NULL);
    return *thread != NULL;
}
static void isogi_vol__join(isogi_vol__thread thread) {
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
}
static long isogi_vol__processors(void) {
    SYSTEM_INFO info;
    GetSystemInfo(&info);
    return (long)info.dwNumberOfProcessors;
}
#else
typedef pthread_t isogi_vol__thread;
typedef pthread_mutex_t isogi_vol__lock;
typedef pthread_cond_t isogi_vol__signal;
#define ISOGI_VOL__WORKER(name) void *name(void *p)
#define ISOGI_VOL__LOCK_SET(lock) pthread_mutex_init(lock, NULL)
#define ISOGI_VOL__LOCK_END(lock) pthread_mutex_destroy(lock)
#define ISOGI_VOL__LOCK(lock) pthread_mutex_lock(lock)
#define ISOGI_VOL__UNLOCK(lock) pthread_mutex_unlock(lock)
#define ISOGI_VOL__SIGNAL_SET(signal) pthread_cond_init(signal, NULL)
#define ISOGI_VOL__SIGNAL_END(signal) pthread_cond_destroy(signal)
#define ISOGI_VOL__WAIT(signal, lock) pthread_cond_wait(signal, lock)
#define ISOGI_VOL__WAKE_ONE(signal) pthread_cond_signal(signal)
#define ISOGI_VOL__WAKE_ALL(signal) pthread_cond_broadcast(signal)
static int isogi_vol__start(isogi_vol__thread *thread, void *(*worker)(void *), void *p) {
    return pthread_create(thread, NULL, worker, p) == 0;
}
static void isogi_vol__join(isogi_vol__thread thread) { pthread_join(thread, NULL); }
static long isogi_vol__processors(void) { return sysconf(_SC_NPROCESSORS_ONLN); }
#endif

typedef struct isogi_vol__job {
    void (*task)(void *arg, size_t i);
    void *arg;
    size_t next, count;
    int cancelled;
    isogi_vol__lock lock;
} isogi_vol__job;

/* Runs one task; 0 when there is none left. *begun counts the tasks that any thread has begun. */
static int isogi_vol__job_step(isogi_vol__job *job, size_t *begun) {
    size_t i;
    int run;
    ISOGI_VOL__LOCK(&job->lock);
    run = !job->cancelled && job->next < job->count;
    i = job->next;
    if (run) job->next++;
    ISOGI_VOL__UNLOCK(&job->lock);
    if (run) job->task(job->arg, i);
    *begun = i + 1;
    return run;
}

static int isogi_vol__report(const isogi_context *context, double from, double to, size_t done, size_t count) {
    if (!context || !context->progress) return 0;
    return context->progress(context->user, done < count ? from + (to - from) * ((double)done / (double)count) : to);
}

/* The calling thread's share of the work; it alone calls the progress callback. */
ISOGI_VOL__INLINE void isogi_vol__job_lead(isogi_vol__job *job, const isogi_context *context, double from, double to) {
    size_t begun;
    int more = 1;
    while (more && !job->cancelled) { /* only this thread writes `cancelled` */
        more = isogi_vol__job_step(job, &begun);
        if (isogi_vol__report(context, from, to, more ? begun : job->count, job->count)) {
            ISOGI_VOL__LOCK(&job->lock);
            job->cancelled = 1;
            ISOGI_VOL__UNLOCK(&job->lock);
        }
    }
}

#ifdef ISOGI_NO_THREADS
struct isogi_thread_pool { isogi_context context; };

static void isogi_vol__job_run(isogi_vol__job *job, const isogi_context *context, double from, double to) {
    isogi_vol__job_lead(job, context, from, to);
}

static void isogi_vol__thread_pool_set(isogi_thread_pool *pool, int threads) { (void)pool, (void)threads; }
static void isogi_vol__thread_pool_end(isogi_thread_pool *pool) { (void)pool; }
#else
static int isogi_vol__cores(void) {
    const long cores = isogi_vol__processors();
    return cores < 1 ? 1 : cores > ISOGI_VOL__MAX_THREADS ? ISOGI_VOL__MAX_THREADS : (int)cores;
}

static ISOGI_VOL__WORKER(isogi_vol__worker) {
    size_t begun;
    while (isogi_vol__job_step((isogi_vol__job *)p, &begun)) {}
    return 0;
}

/* What is read without the lock is a hint, after which it is looked at again. */
#if (defined(__GNUC__) || defined(__clang__)) && !defined(__TINYC__)
#define ISOGI_VOL__PEEK(x) __atomic_load_n(&(x), __ATOMIC_RELAXED)
#define ISOGI_VOL__POKE(x, value) __atomic_store_n(&(x), value, __ATOMIC_RELAXED)
#if defined(__x86_64__) || defined(__i386__)
#define ISOGI_VOL__PAUSE() __builtin_ia32_pause()
#else
#define ISOGI_VOL__PAUSE() ((void)0)
#endif
#define ISOGI_VOL__SPINS 1000
#else
#define ISOGI_VOL__PEEK(x) (x)
#define ISOGI_VOL__POKE(x, value) ((x) = (value))
#define ISOGI_VOL__PAUSE() ((void)0)
#define ISOGI_VOL__SPINS 0
#endif

/* One job at a time. Its threads sleep by `work`; the one that calls waits by `done` until those that joined it are. */
struct isogi_thread_pool {
    isogi_context context; /* whose memory it is */
    isogi_vol__lock lock;
    isogi_vol__signal work, done;
    isogi_vol__job *job; /* at work; NULL: none */
    unsigned number;     /* of the job: a thread looks at each once */
    int wanted, active;  /* threads that may still join it; that are at it */
    int asleep, leave;
    int threads, started; /* with the one that calls, 0 = all cores until it is `sized`; without it */
    int sized, spins;
    isogi_vol__thread thread[ISOGI_VOL__MAX_THREADS];
};

static ISOGI_VOL__WORKER(isogi_vol__thread_pool_worker) {
    isogi_thread_pool *pool = (isogi_thread_pool *)p;
    unsigned seen = 0;
    size_t begun;
    for (;;) {
        isogi_vol__job *job = NULL;
        int i;
        for (i = 0; i < pool->spins && ISOGI_VOL__PEEK(pool->number) == seen && !ISOGI_VOL__PEEK(pool->leave); i++) ISOGI_VOL__PAUSE();
        ISOGI_VOL__LOCK(&pool->lock);
        pool->asleep++;
        while (pool->number == seen && !pool->leave) ISOGI_VOL__WAIT(&pool->work, &pool->lock);
        pool->asleep--;
        seen = pool->number;
        if (!pool->leave && pool->wanted > 0) {
            pool->wanted--, job = pool->job;
            ISOGI_VOL__POKE(pool->active, pool->active + 1);
        }
        i = pool->leave;
        ISOGI_VOL__UNLOCK(&pool->lock);
        if (i) return 0;
        if (!job) continue;
        while (isogi_vol__job_step(job, &begun)) {}
        ISOGI_VOL__LOCK(&pool->lock);
        ISOGI_VOL__POKE(pool->active, pool->active - 1);
        if (!pool->active) ISOGI_VOL__WAKE_ONE(&pool->done);
        ISOGI_VOL__UNLOCK(&pool->lock);
    }
}

/* 0: it is at work for another. A thread that cannot be had is done without. */
ISOGI_VOL__NOINLINE static int isogi_vol__thread_pool_run(isogi_thread_pool *pool, isogi_vol__job *job, int wanted,
                                                   const isogi_context *context, double from, double to) {
    int busy, i;
    ISOGI_VOL__LOCK(&pool->lock);
    busy = pool->job != NULL;
    if (!busy) {
        pool->job = job, pool->wanted = wanted - 1;
        ISOGI_VOL__POKE(pool->number, pool->number + 1);
        for (i = 0; i < pool->asleep && i < wanted - 1; i++) ISOGI_VOL__WAKE_ONE(&pool->work);
    }
    ISOGI_VOL__UNLOCK(&pool->lock);
    if (busy) return 0;
    for (; pool->started < wanted - 1; pool->started++)
        if (!isogi_vol__start(&pool->thread[pool->started], isogi_vol__thread_pool_worker, pool)) break;
    isogi_vol__job_lead(job, context, from, to);
    for (i = 0; i < pool->spins && ISOGI_VOL__PEEK(pool->active); i++) ISOGI_VOL__PAUSE();
    ISOGI_VOL__LOCK(&pool->lock);
    pool->wanted = 0;
    while (pool->active) ISOGI_VOL__WAIT(&pool->done, &pool->lock);
    pool->job = NULL;
    ISOGI_VOL__UNLOCK(&pool->lock);
    return 1;
}

static void isogi_vol__thread_pool_set(isogi_thread_pool *pool, int threads) {
    pool->threads = threads;
    ISOGI_VOL__LOCK_SET(&pool->lock);
    ISOGI_VOL__SIGNAL_SET(&pool->work), ISOGI_VOL__SIGNAL_SET(&pool->done);
}

/* With the one that calls. Cores are counted by the first job that has tasks for several, since that takes 10 us. */
static int isogi_vol__thread_pool_size(isogi_thread_pool *pool) {
    ISOGI_VOL__LOCK(&pool->lock);
    if (!pool->sized) {
        const int cores = isogi_vol__cores();
        pool->threads = pool->threads > ISOGI_VOL__MAX_THREADS ? ISOGI_VOL__MAX_THREADS : pool->threads ? pool->threads : cores;
        pool->spins = pool->threads <= cores ? ISOGI_VOL__SPINS : 0; /* who waits must not keep others from their work */
        pool->sized = 1;
    }
    ISOGI_VOL__UNLOCK(&pool->lock);
    return pool->threads;
}

static void isogi_vol__thread_pool_end(isogi_thread_pool *pool) {
    ISOGI_VOL__LOCK(&pool->lock);
    ISOGI_VOL__POKE(pool->leave, 1);
    ISOGI_VOL__WAKE_ALL(&pool->work);
    ISOGI_VOL__UNLOCK(&pool->lock);
    while (pool->started) isogi_vol__join(pool->thread[--pool->started]);
    ISOGI_VOL__SIGNAL_END(&pool->work), ISOGI_VOL__SIGNAL_END(&pool->done);
    ISOGI_VOL__LOCK_END(&pool->lock);
}

/* A thread that cannot be had is done without: the calling thread finishes the work. */
ISOGI_VOL__NOINLINE static void isogi_vol__new_threads_run(isogi_vol__job *job, int wanted, const isogi_context *context, double from,
                                                           double to) {
    isogi_vol__thread threads[ISOGI_VOL__MAX_THREADS];
    int started = 0;
    while (started < wanted - 1 && isogi_vol__start(&threads[started], isogi_vol__worker, job)) started++;
    isogi_vol__job_lead(job, context, from, to);
    while (started) isogi_vol__join(threads[--started]);
}

static void isogi_vol__job_run(isogi_vol__job *job, const isogi_context *context, double from, double to) {
    isogi_thread_pool *pool = context ? context->thread_pool : NULL;
    int wanted = context && context->threads > 0 ? context->threads : 0;
    if (job->count == 1) wanted = 1;
    if (wanted != 1) {
        const int most = pool ? isogi_vol__thread_pool_size(pool) : wanted ? ISOGI_VOL__MAX_THREADS : isogi_vol__cores();
        wanted = wanted && wanted < most ? wanted : most;
    }
    if ((size_t)wanted > job->count) wanted = (int)job->count;
    ISOGI_VOL__LOCK_SET(&job->lock);
    if (wanted == 1) isogi_vol__job_lead(job, context, from, to);
    else if (!pool || !isogi_vol__thread_pool_run(pool, job, wanted, context, from, to))
        isogi_vol__new_threads_run(job, wanted, context, from, to);
    ISOGI_VOL__LOCK_END(&job->lock);
}
#endif

ISOGI_API isogi_result isogi_thread_pool_create(isogi_thread_pool **pool, int threads, const isogi_context *context) {
    isogi_thread_pool *p;
    if (!pool || threads < 0) return ISOGI_INVALID;
    p = (isogi_thread_pool *)isogi_allocate(context, 1, sizeof *p);
    if (!p) return ISOGI_NO_MEMORY;
    memset(p, 0, sizeof *p);
    if (context) p->context = *context;
    isogi_vol__thread_pool_set(p, threads);
    *pool = p;
    return ISOGI_OK;
}

ISOGI_API void isogi_thread_pool_free(isogi_thread_pool *pool) {
    isogi_context context;
    if (!pool) return;
    isogi_vol__thread_pool_end(pool);
    context = pool->context;
    isogi_release(&context, pool, 1, sizeof *pool);
}

ISOGI_API isogi_thread_pool *isogi_thread_pool_begin(isogi_context *context) {
    isogi_thread_pool *pool = NULL;
#ifdef ISOGI_NO_THREADS
    (void)context;
#else
    if (!context || context->thread_pool || context->parallel_for || context->threads == 1) return NULL;
    if (isogi_thread_pool_create(&pool, context->threads > 0 ? context->threads : 0, context) == ISOGI_OK) context->thread_pool = pool;
#endif
    return pool;
}

ISOGI_API void isogi_thread_pool_end(isogi_context *context, isogi_thread_pool *pool) {
    if (!pool) return;
    context->thread_pool = NULL;
    isogi_thread_pool_free(pool);
}

typedef struct isogi_vol__slice {
    void (*task)(void *arg, size_t i);
    void *arg;
    size_t first;
} isogi_vol__slice;

static void isogi_vol__slice_task(void *p, size_t i) {
    const isogi_vol__slice *slice = (const isogi_vol__slice *)p;
    slice->task(slice->arg, slice->first + i);
}

ISOGI_API isogi_result isogi_parallel(const isogi_context *context, size_t n, void (*task)(void *arg, size_t i), void *arg,
                                      double from, double to) {
    if (!task) return ISOGI_INVALID;
    if (!n) return ISOGI_OK;
    if (context && context->parallel_for) {
        /* A foreign scheduler is given the work in slices, so that progress and cancelling have their turn in between. */
        size_t slices = context->progress ? (n < 32 ? n : 32) : 1, s;
        isogi_vol__slice slice;
        slice.task = task, slice.arg = arg;
        for (s = 0; s < slices; s++) {
            size_t end = n / slices * (s + 1) + n % slices * (s + 1) / slices;
            slice.first = n / slices * s + n % slices * s / slices;
            if (end > slice.first) context->parallel_for(context->user, end - slice.first, isogi_vol__slice_task, &slice);
            if (isogi_vol__report(context, from, to, end, n)) return ISOGI_CANCELLED;
        }
        return ISOGI_OK;
    } else {
        isogi_vol__job job;
        memset(&job, 0, sizeof job);
        job.task = task, job.arg = arg, job.count = n;
        isogi_vol__job_run(&job, context, from, to);
        return job.cancelled ? ISOGI_CANCELLED : ISOGI_OK;
    }
}

/* ==== numbers that survive -ffast-math =============================================================================== */

static int isogi_vol__finite64(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7ff0000000000000u) != 0x7ff0000000000000u;
}

static int isogi_vol__finite3(const double v[3]) {
    return isogi_vol__finite64(v[0]) && isogi_vol__finite64(v[1]) && isogi_vol__finite64(v[2]);
}

static double isogi_vol__min(double a, double b) { return a < b ? a : b; }
static double isogi_vol__max(double a, double b) { return a > b ? a : b; }
static double isogi_vol__largest(double a, double b, double c) { return isogi_vol__max(isogi_vol__max(fabs(a), fabs(b)), fabs(c)); }

/* The length of a vector, 0 if it has none or is not finite. One whose squares are out of a double's range is brought near 1 first. */
static double isogi_vol__length(double v[3]) {
    double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], largest;
    int a;
    if (!(square > 1e-280 && square < 1e300)) {
        largest = isogi_vol__largest(v[0], v[1], v[2]);
        if (!isogi_vol__finite3(v) || !(largest > 0)) return 0;
        for (a = 0; a < 3; a++) v[a] /= largest;
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    }
    return isogi_vol__finite64(square) ? sqrt(square) : 0;
}

/* Into [0, high]; NaN gives 0. */
static double isogi_vol__clamp(double x, double high) {
    x = x > 0 ? x : 0;
    return x < high ? x : high;
}

static size_t isogi_vol__min_size(size_t a, size_t b) { return a < b ? a : b; }

/* The cell of a grid coordinate that lies in [0, voxels - 1], and the place in it; the last cell is closed. */
static int isogi_vol__cell(double x, size_t voxels, double *local) {
    const int end = (int)voxels - 1, last = end > 0 ? end - 1 : 0;
    int i;
    x = isogi_vol__clamp(x, end);
    i = (int)x;
    i = i > last ? last : i;
    i = i < 0 ? 0 : i;
    *local = x - i;
    return i;
}

/* ==== volumes ======================================================================================================== */

typedef struct isogi_vol__node_level { size_t first, size[3], parents[3]; } isogi_vol__node_level; /* parents: size of the level above */

/* Grid coordinates of world points w in floats, to 2^-24 of a cell: (high + low) w + (at_high + at_low). at_high is a multiple of 2^-10, so
   that the number of a cell is subtracted from it exactly; what is left of the sum is small. */
typedef struct isogi_vol__float_grid {
    float high[4], low[4], at_high[4], at_low[4]; /* the fourth is 0 */
    int32_t stride[3];                            /* in voxels, hence 2^shift bytes */
    int shift, usable;
} isogi_vol__float_grid;

struct isogi_pyramid {
    isogi_volume volume;
    isogi_field field; /* instead of voxels, if it has a function */
    isogi_context context;
    double to_world[9]; /* world = origin + to_world * grid */
    double to_grid[9];  /* its inverse */
    double origin[3];   /* world position of voxel (0,0,0) */
    double range[2];
    int cells[4]; /* size - 1; the fourth is 0 */
    isogi_vol__float_grid float_grid;
    double box[4], grid_axis[3][4]; /* cells and the columns of to_grid, for vectors of four; the fourth is 0 */
    isogi_level level[ISOGI_VOL__LEVELS];
    size_t block_count; /* of all levels */
    uint8_t *broken;    /* of each block of level 0: whether it has a voxel that is not finite */
    size_t broken_count;
    float (*blocks)[2];
    /* bounds for fast rays: nodes of 64 children, least[64] then largest[64], in 8 bits over the volume's range; node n of level 0
       stands for block n and is a leaf, which holds voxels instead; a compact volume has no leaves */
    uint8_t (*nodes)[128];
    size_t node_count;
    isogi_vol__node_level node_level[ISOGI_VOL__NODE_LEVELS];
    int node_levels; /* the last one has a single node */
    double node_scale; /* 8-bit value = floor((value - range[0]) * node_scale) */
    struct isogi_vol__ways *ways; /* for fast rays, else NULL */
    int all_finite;
    int fast; /* 0: only the plain walk is right for this volume */
    int path; /* ISOGI_VOL__PATH_... */
};

static size_t isogi_vol__type_size(isogi_type type) {
    switch (type) {
    case ISOGI_U8:
    case ISOGI_I8: return 1;
    case ISOGI_U16:
    case ISOGI_I16: return 2;
    case ISOGI_F32: return 4;
    case ISOGI_F64: return 8;
    }
    return 0;
}

static double isogi_vol__determinant(const double m[9]) {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) + m[1] * (m[5] * m[6] - m[3] * m[8]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

static int isogi_vol__all_zero(const double *v, int n) {
    while (n--)
        if (!(v[n] >= 0 && v[n] <= 0)) return 0;
    return 1;
}

/* Fills in the zero defaults of a volume whose sizes and type are right. */
static isogi_volume isogi_vol__resolve(const isogi_volume *volume) {
    isogi_volume v = *volume;
    ptrdiff_t stride = (ptrdiff_t)isogi_vol__type_size(v.type);
    int packed = !v.stride[0] && !v.stride[1] && !v.stride[2], identity = isogi_vol__all_zero(v.axes, 9), a;
    for (a = 0; a < 3; a++) {
        if (packed) v.stride[a] = stride, stride *= (ptrdiff_t)(v.halo_low[a] + v.size[a] + v.halo_high[a]);
        if (isogi_vol__all_zero(&v.spacing[a], 1)) v.spacing[a] = 1;
        if (identity) v.axes[4 * a] = 1;
    }
    if (isogi_vol__all_zero(&v.scale, 1)) v.scale = 1;
    return v;
}

/* Sizes within range, and every voxel's byte offset within ptrdiff_t. code: what a call returns for what is not. */
static const char *isogi_vol__layout_fault(const isogi_volume *v, size_t type_size, isogi_result *code) {
    size_t reach = type_size; /* of the axes so far: the stride of the next one, where voxels are packed */
    int zero = !v->stride[0] && !v->stride[1] && !v->stride[2], a;
    for (a = 0; a < 3; a++) {
        ptrdiff_t stride = zero ? (ptrdiff_t)reach : v->stride[a];
        size_t step, span = v->size[a] - 1;
        if (!v->size[a]) return "size: 0";
        *code = ISOGI_TOO_LARGE;
        if (v->size[a] > 0x7fffffff) return "size: above 2^31 - 1";
        if (v->halo_low[a] > 0x7fffffff || v->halo_high[a] > 0x7fffffff) return "halo_low, halo_high: above 2^31 - 1";
        if (v->first[a] > 0 && (double)(v->first[a] - 1) >= 9007199254740992.0) return "first: above 2^53";
        if (v->halo_low[a] + v->halo_high[a] > SIZE_MAX / 2 - span) return "size, halo_low, halo_high: too large";
        *code = ISOGI_INVALID;
        span += v->halo_low[a] + v->halo_high[a];
        if (stride == PTRDIFF_MIN || stride % (ptrdiff_t)type_size) return "stride: no multiple of the size of a voxel's type";
        step = (size_t)(stride < 0 ? -stride : stride);
        if (span && step > ((size_t)PTRDIFF_MAX - reach) / span) return *code = ISOGI_TOO_LARGE, "size, stride: too large to be addressed";
        reach += step * span;
    }
    return NULL;
}

/* From steps of the grid to the world and back, for a volume whose defaults are filled in. */
static void isogi_vol__transforms(const isogi_volume *v, double to_world[9], double to_grid[9]) {
    const double *m = v->axes, inverse = 1 / isogi_vol__determinant(m);
    int r, c;
    for (r = 0; r < 3; r++)
        for (c = 0; c < 3; c++) {
            /* cofactor of element (c, r), indices taken cyclically so that the sign comes out right */
            int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
            double cofactor = m[3 * r1 + c1] * m[3 * r2 + c2] - m[3 * r1 + c2] * m[3 * r2 + c1];
            to_world[3 * r + c] = m[3 * r + c] * v->spacing[c];
            to_grid[3 * r + c] = cofactor * inverse / v->spacing[r];
        }
}

static const char *isogi_vol__geometry_fault(const isogi_volume *volume) {
    static const double largest[6] = {255, 128, 65535, 32768, (double)FLT_MAX, 1};
    double length = 1, determinant, to_world[9], to_grid[9];
    isogi_volume v;
    int a;
    for (a = 0; a < 9; a++)
        if (!isogi_vol__finite64(volume->axes[a])) return "axes: not finite";
    if (!isogi_vol__finite64(volume->scale) || !isogi_vol__finite64(volume->bias)) return "scale, bias: not finite";
    if (!isogi_vol__finite3(volume->origin)) return "origin: not finite";
    if (!isogi_vol__finite3(volume->spacing)) return "spacing: not finite";
    v = isogi_vol__resolve(volume);
    if (!(fabs(v.scale) <= 1e300 && fabs(v.bias) <= 1e300 && fabs(v.scale) * largest[v.type] + fabs(v.bias) <= 1e300))
        return "scale, bias: values beyond 1e300";
    for (a = 0; a < 3; a++) {
        double x = v.axes[a], y = v.axes[3 + a], z = v.axes[6 + a];
        if (!(v.spacing[a] > 0)) return "spacing: negative";
        length *= sqrt(x * x + y * y + z * z);
    }
    determinant = isogi_vol__determinant(v.axes);
    if (!(fabs(determinant) > 1e-9 * length) || !isogi_vol__finite64(determinant)) return "axes: (nearly) in one plane, or too long";
    isogi_vol__transforms(&v, to_world, to_grid);
    for (a = 0; a < 9; a++)
        if (!isogi_vol__finite64(to_world[a]) || !isogi_vol__finite64(to_grid[a]))
            return "axes, spacing: too small or too large to be inverted";
    return NULL;
}

static const char *isogi_vol__fault(const isogi_volume *volume, isogi_result *code) {
    const char *fault;
    size_t type_size;
    *code = ISOGI_INVALID;
    if (!volume) return "volume: NULL";
    if (!volume->data) return "data: NULL";
    type_size = isogi_vol__type_size(volume->type);
    if (!type_size) return "type: none of isogi_type";
    if ((uintptr_t)volume->data % type_size) return "data: not aligned to its type";
    fault = isogi_vol__layout_fault(volume, type_size, code);
    if (!fault) fault = isogi_vol__geometry_fault(volume);
    if (!fault) *code = ISOGI_OK;
    return fault;
}

ISOGI_API isogi_result isogi_volume_validate(const isogi_volume *volume) {
    isogi_result code;
    isogi_vol__fault(volume, &code);
    return code;
}

ISOGI_API const char *isogi_volume_fault(const isogi_volume *volume) {
    isogi_result code;
    return isogi_vol__fault(volume, &code);
}

static void isogi_vol__transform(const double m[9], const double v[3], double out[3]) {
    double x = v[0], y = v[1], z = v[2];
    out[0] = m[0] * x + m[1] * y + m[2] * z;
    out[1] = m[3] * x + m[4] * y + m[5] * z;
    out[2] = m[6] * x + m[7] * y + m[8] * z;
}

ISOGI_VOL__COLD static void isogi_vol__set_transform(isogi_pyramid *p) {
    const isogi_volume *v = &p->volume;
    double first[3];
    int r, c;
    isogi_vol__transforms(v, p->to_world, p->to_grid);
    for (r = 0; r < 3; r++) {
        for (c = 0; c < 3; c++) p->grid_axis[c][r] = p->to_grid[3 * r + c];
        p->box[r] = p->cells[r], first[r] = (double)v->first[r];
    }
    isogi_vol__transform(p->to_world, first, p->origin);
    for (r = 0; r < 3; r++) p->origin[r] += v->origin[r];
}

/* Floats do for volumes whose axes are the world's, of at most 8192 voxels along an axis, no further than that from the world's origin. */
static void isogi_vol__plan_float_grid(isogi_pyramid *p) {
    const isogi_volume *v = &p->volume;
    const ptrdiff_t size = (ptrdiff_t)isogi_vol__type_size(v->type);
    isogi_vol__float_grid *g = &p->float_grid;
    double reach = 0;
    int a;
    g->usable = isogi_vol__all_zero(p->to_grid + 1, 3) && isogi_vol__all_zero(p->to_grid + 5, 3);
    for (g->shift = 0; size >> g->shift > 1; g->shift++) {}
    for (a = 0; a < 3; a++) {
        const double m = p->to_grid[4 * a], at = -p->origin[a] * m;
        reach += fabs((double)(v->stride[a] / size)) * p->cells[a];
        if (!(fabs(m) > 1e-7 && fabs(m) < 1e7 && fabs(at) < ISOGI_VOL__FAST_SIZE) || p->cells[a] >= ISOGI_VOL__FAST_SIZE ||
            !(reach < 2e9)) {
            g->usable = 0;
            return;
        }
        g->high[a] = (float)m, g->low[a] = (float)(m - (double)g->high[a]);
        g->at_high[a] = (float)((double)(int)(at * 1024) / 1024), g->at_low[a] = (float)(at - (double)g->at_high[a]);
        g->stride[a] = p->cells[a] ? (int32_t)(v->stride[a] / size) : 0;
    }
}

/* A gradient per grid unit becomes one per world unit: the transposed inverse. */
static void isogi_vol__gradient_to_world(const isogi_pyramid *p, const double g[3], double out[3]) {
    const double *m = p->to_grid;
    double x = g[0], y = g[1], z = g[2];
    out[0] = m[0] * x + m[3] * y + m[6] * z;
    out[1] = m[1] * x + m[4] * y + m[7] * z;
    out[2] = m[2] * x + m[5] * y + m[8] * z;
}

/* Chunks of one field take the same number of the field to the same place, bit by bit. */
ISOGI_API void isogi_vol_to_world(const isogi_pyramid *pyramid, const double grid[3], double world[3]) {
    double field[3];
    int a;
    if (!pyramid || !grid) {
        for (a = 0; a < 3 && world; a++) world[a] = 0;
        return;
    }
    for (a = 0; a < 3; a++) field[a] = (double)pyramid->volume.first[a] + grid[a];
    isogi_vol__transform(pyramid->to_world, field, world);
    for (a = 0; a < 3; a++) world[a] += pyramid->volume.origin[a];
}

ISOGI_API void isogi_vol_to_grid(const isogi_pyramid *pyramid, const double world[3], double grid[3]) {
    double v[3];
    int a;
    if (!pyramid || !world) {
        for (a = 0; a < 3 && grid; a++) grid[a] = 0;
        return;
    }
    for (a = 0; a < 3; a++) v[a] = world[a] - pyramid->origin[a];
    isogi_vol__transform(pyramid->to_grid, v, grid);
}

/* ==== voxels ========================================================================================================= */

/* The voxel at an address. */
ISOGI_VOL__INLINE double isogi_vol__voxel(const isogi_volume *v, const char *p) {
    double raw = 0;
    switch (v->type) {
    case ISOGI_U8: raw = *(const uint8_t *)(const void *)p; break;
    case ISOGI_I8: raw = *(const int8_t *)(const void *)p; break;
    case ISOGI_U16: raw = *(const uint16_t *)(const void *)p; break;
    case ISOGI_I16: raw = *(const int16_t *)(const void *)p; break;
    case ISOGI_F32: raw = (double)*(const float *)(const void *)p; break;
    case ISOGI_F64: raw = *(const double *)(const void *)p; break;
    }
    return v->scale * raw + v->bias;
}

/* Reads `count` voxels along x. One switch a row. */
ISOGI_VOL__NOINLINE static void isogi_vol__row(const isogi_volume *v, int x, int y, int z, int count, double *out) {
    const char *p = (const char *)v->data + x * v->stride[0] + y * v->stride[1] + z * v->stride[2];
    ptrdiff_t step = v->stride[0];
    double scale = v->scale, bias = v->bias;
    int i;
#define ISOGI_VOL__READ(T)                                                                                                       \
    for (i = 0; i < count; i++, p += step) out[i] = scale * (double)*(const T *)(const void *)p + bias;                          \
    break;
    switch (v->type) {
    case ISOGI_U8: ISOGI_VOL__READ(uint8_t)
    case ISOGI_I8: ISOGI_VOL__READ(int8_t)
    case ISOGI_U16: ISOGI_VOL__READ(uint16_t)
    case ISOGI_I16: ISOGI_VOL__READ(int16_t)
    case ISOGI_F32: ISOGI_VOL__READ(float)
    case ISOGI_F64: ISOGI_VOL__READ(double)
    }
#undef ISOGI_VOL__READ
}

/* The eight corners of a cell: corner x + 2y + 4z. An axis of one voxel repeats it. */
ISOGI_VOL__INLINE void isogi_vol__read_corners(const isogi_volume *v, const int cell[3], double corner[8]) {
    const char *p = (const char *)v->data + cell[0] * v->stride[0] + cell[1] * v->stride[1] + cell[2] * v->stride[2];
    ptrdiff_t dx = v->size[0] > 1 ? v->stride[0] : 0, dy = v->size[1] > 1 ? v->stride[1] : 0;
    ptrdiff_t dz = v->size[2] > 1 ? v->stride[2] : 0;
    double scale = v->scale, bias = v->bias;
#define ISOGI_VOL__AT(T, offset) (scale * (double)*(const T *)(const void *)(p + (offset)) + bias)
#define ISOGI_VOL__READ(T)                                                                                                       \
    corner[0] = ISOGI_VOL__AT(T, 0), corner[1] = ISOGI_VOL__AT(T, dx), corner[2] = ISOGI_VOL__AT(T, dy);                         \
    corner[3] = ISOGI_VOL__AT(T, dx + dy), corner[4] = ISOGI_VOL__AT(T, dz), corner[5] = ISOGI_VOL__AT(T, dx + dz);              \
    corner[6] = ISOGI_VOL__AT(T, dy + dz), corner[7] = ISOGI_VOL__AT(T, dx + dy + dz);                                           \
    break;
    switch (v->type) {
    case ISOGI_U8: ISOGI_VOL__READ(uint8_t)
    case ISOGI_I8: ISOGI_VOL__READ(int8_t)
    case ISOGI_U16: ISOGI_VOL__READ(uint16_t)
    case ISOGI_I16: ISOGI_VOL__READ(int16_t)
    case ISOGI_F32: ISOGI_VOL__READ(float)
    case ISOGI_F64: ISOGI_VOL__READ(double)
    }
#undef ISOGI_VOL__AT
#undef ISOGI_VOL__READ
}

ISOGI_API int isogi_vol_corners(const isogi_pyramid *pyramid, const int cell[3], double corner[8]) {
    int i, finite = 1;
    isogi_vol__read_corners(&pyramid->volume, cell, corner);
    if (!pyramid->all_finite)
        for (i = 0; i < 8; i++) finite &= isogi_vol__finite64(corner[i]);
    return finite;
}

/* The same minus the isovalue (subtraction keeps the sign exact). */
static int isogi_vol__corners(const isogi_pyramid *pyramid, const int cell[3], double isovalue, double corner[8]) {
    int i, finite = isogi_vol_corners(pyramid, cell, corner);
    for (i = 0; i < 8; i++) corner[i] -= isovalue;
    return finite;
}

ISOGI_API int isogi_volume_corners(const isogi_volume *volume, const uint32_t cell[3], double corner[8]) {
    int at[3], i, inside = volume && volume->data && cell && corner, finite = 1;
    for (i = 0; i < 3 && inside; i++) {
        inside = volume->size[i] > 1 ? cell[i] < volume->size[i] - 1 : !cell[i];
        at[i] = (int)cell[i];
    }
    if (!inside) {
        if (corner) memset(corner, 0, 8 * sizeof *corner);
        return 0;
    }
    isogi_vol__read_corners(volume, at, corner);
    for (i = 0; i < 8; i++) finite &= isogi_vol__finite64(corner[i]);
    return finite;
}

ISOGI_API void isogi_volume_range(const isogi_volume *volume, const size_t first[3], const size_t last[3], double range[2]) {
    size_t end[3], x, y, z;
    double row[64];
    int a, i;
    if (!range) return;
    range[0] = DBL_MAX, range[1] = -DBL_MAX;
    if (!volume || !volume->data || !first || !last) return;
    for (a = 0; a < 3; a++) end[a] = last[a] < volume->size[a] ? last[a] + 1 : volume->size[a];
    for (z = first[2]; z < end[2]; z++)
        for (y = first[1]; y < end[1]; y++)
            for (x = first[0]; x < end[0]; x += 64) {
                const int count = end[0] - x < 64 ? (int)(end[0] - x) : 64;
                isogi_vol__row(volume, (int)x, (int)y, (int)z, count, row);
                for (i = 0; i < count; i++) {
                    if (!isogi_vol__finite64(row[i])) continue;
                    range[0] = isogi_vol__min(range[0], row[i]), range[1] = isogi_vol__max(range[1], row[i]);
                }
            }
}

/* ==== pyramid ======================================================================================================== */

/* The nearest floats that do not cut the interval. */
static float isogi_vol__float_below(double x) {
    float f = x < -(double)FLT_MAX ? -HUGE_VALF : x > (double)FLT_MAX ? FLT_MAX : (float)x;
    return (double)f > x ? nextafterf(f, -HUGE_VALF) : f;
}
static float isogi_vol__float_above(double x) { return -isogi_vol__float_below(-x); }

/* Volumes are reduced in strips: a row of level-0 blocks, ISOGI_VOL__STRIP cells at a time along x, so that all scratch memory is on
   the stack. Raw values of all types but double are exact as float. */
#define ISOGI_VOL__STRIP 256
#define ISOGI_VOL__STRIP_VOXELS (ISOGI_VOL__STRIP + 16) /* one more than cells, and room for whole vectors */

typedef struct isogi_vol__build_job {
    isogi_pyramid *pyramid;
    size_t first[3], last[3]; /* level-0 blocks to be done */
    double (*range)[2];       /* of each z of blocks */
    size_t *broken;           /* blocks of each z that are not all finite */
    float raw_low, raw_scale; /* 8-bit value = floor((raw - raw_low) * raw_scale) */
} isogi_vol__build_job;

static int isogi_vol__last_voxel(size_t block, int cells, size_t voxels) {
    size_t end = (block + 1) * (size_t)cells;
    return (int)(end < voxels ? end : voxels - 1);
}

#ifdef ISOGI_VOL__AVX
/* Integers that lie side by side as floats, eight at a time; returns how many. */
ISOGI_VOL__TARGET("avx2") static int isogi_vol__raw_eights(isogi_type type, const char *p, int count, float *out) {
    int i = 0;
#define ISOGI_VOL__CONVERT(CONVERT, LOAD, BYTES)                                                                                 \
    for (; i + 8 <= count; i += 8) _mm256_storeu_ps(out + i, _mm256_cvtepi32_ps(CONVERT(LOAD((const __m128i *)(const void *)(p + \
        i * (BYTES)))))); \
    break;
    switch (type) {
    case ISOGI_U8: ISOGI_VOL__CONVERT(_mm256_cvtepu8_epi32, _mm_loadl_epi64, 1)
    case ISOGI_I8: ISOGI_VOL__CONVERT(_mm256_cvtepi8_epi32, _mm_loadl_epi64, 1)
    case ISOGI_U16: ISOGI_VOL__CONVERT(_mm256_cvtepu16_epi32, _mm_loadu_si128, 2)
    case ISOGI_I16: ISOGI_VOL__CONVERT(_mm256_cvtepi16_epi32, _mm_loadu_si128, 2)
    case ISOGI_F32:
    case ISOGI_F64: break;
    }
#undef ISOGI_VOL__CONVERT
    return i;
}
#endif

/* Raw voxels x .. x + count - 1 of a row as floats, in place where they are; not for double. */
static const float *isogi_vol__raw_row(const isogi_pyramid *pyramid, size_t x, size_t y, size_t z, int count, float *buffer) {
    const isogi_volume *v = &pyramid->volume;
    const char *p = (const char *)v->data + (ptrdiff_t)x * v->stride[0] + (ptrdiff_t)y * v->stride[1] + (ptrdiff_t)z * v->stride[2];
    ptrdiff_t step = v->stride[0];
    int i = 0;
    if (v->type == ISOGI_F32 && step == 4) return (const float *)(const void *)p;
#ifdef ISOGI_VOL__AVX
    if (pyramid->path >= ISOGI_VOL__PATH_AVX2 && step == (ptrdiff_t)isogi_vol__type_size(v->type))
        i = isogi_vol__raw_eights(v->type, p, count, buffer), p += i * step;
#endif
#define ISOGI_VOL__READ(T)                                                                                                       \
    for (; i < count; i++, p += step) buffer[i] = (float)*(const T *)(const void *)p;                                       \
    break;
    switch (v->type) {
    case ISOGI_U8: ISOGI_VOL__READ(uint8_t)
    case ISOGI_I8: ISOGI_VOL__READ(int8_t)
    case ISOGI_U16: ISOGI_VOL__READ(uint16_t)
    case ISOGI_I16: ISOGI_VOL__READ(int16_t)
    case ISOGI_F32: ISOGI_VOL__READ(float)
    case ISOGI_F64: break;
    }
#undef ISOGI_VOL__READ
    return buffer;
}

/* Takes a row into the running bounds of its columns; 0 if one of its numbers is not finite. */
static int isogi_vol__bound_row(const float *row, int count, float *least, float *largest) {
    int i = 0, finite = 1;
#ifdef ISOGI_VOL__SSE2
    const __m128i exponent = _mm_set1_epi32(0x7f800000);
    __m128i bad = _mm_setzero_si128();
    for (; i + 4 <= count; i += 4) {
        const __m128 x = _mm_loadu_ps(row + i);
        bad = _mm_or_si128(bad, _mm_cmpeq_epi32(_mm_and_si128(_mm_castps_si128(x), exponent), exponent));
        _mm_storeu_ps(least + i, _mm_min_ps(x, _mm_loadu_ps(least + i)));
        _mm_storeu_ps(largest + i, _mm_max_ps(x, _mm_loadu_ps(largest + i)));
    }
    finite = !_mm_movemask_epi8(bad);
#endif
    for (; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &row[i], sizeof bits);
        finite &= (bits & 0x7f800000) != 0x7f800000;
        least[i] = row[i] < least[i] ? row[i] : least[i];
        largest[i] = row[i] > largest[i] ? row[i] : largest[i];
    }
    return finite;
}

#ifdef ISOGI_VOL__AVX
/* The same for the first numbers of up to five rows, eight columns at a time; returns how many. The rows after these, `ahead` bytes further
   on, are sent for: mostly this waits for memory. */
ISOGI_VOL__TARGET("avx2")
static int isogi_vol__bound_eights(const float *const *row, int rows, int count, ptrdiff_t ahead, float *least, float *largest,
                                   int *finite) {
    const __m256i unsign = _mm256_set1_epi32(0x7fffffff);
    __m256i most = _mm256_setzero_si256(); /* as integers, what is not finite is at least as large as infinity */
    int i, k;
    for (i = 0; i + 8 <= count; i += 8) {
        __m256 low = _mm256_loadu_ps(least + i), high = _mm256_loadu_ps(largest + i);
        for (k = 0; k < rows; k++) {
            const __m256 x = _mm256_loadu_ps(row[k] + i);
            _mm_prefetch((const char *)((uintptr_t)(row[k] + i) + (uintptr_t)ahead), _MM_HINT_T0);
            most = _mm256_max_epi32(most, _mm256_and_si256(_mm256_castps_si256(x), unsign));
            low = _mm256_min_ps(x, low), high = _mm256_max_ps(x, high);
        }
        _mm256_storeu_ps(least + i, low), _mm256_storeu_ps(largest + i, high);
    }
    *finite &= !_mm256_movemask_epi8(_mm256_cmpgt_epi32(most, _mm256_set1_epi32(0x7f7fffff)));
    return i;
}
#endif

/* Values x .. x + count - 1 of a row, in place where they are. */
static const double *isogi_vol__value_row(const isogi_volume *v, size_t x, size_t y, size_t z, int count, double *buffer) {
    const char *p = (const char *)v->data + (ptrdiff_t)x * v->stride[0] + (ptrdiff_t)y * v->stride[1] + (ptrdiff_t)z * v->stride[2];
    const int plain = v->scale >= 1 && v->scale <= 1 && v->bias >= 0 && v->bias <= 0;
    if (v->type == ISOGI_F64 && v->stride[0] == 8 && plain) return (const double *)(const void *)p;
    isogi_vol__row(v, (int)x, (int)y, (int)z, count, buffer);
    return buffer;
}

/* Columns of a strip of blocks, in values, for doubles and where numbers are not finite; holed: columns that have one that is not. */
static void isogi_vol__bound_values(const isogi_volume *v, size_t x, int count, size_t by, size_t bz, double *least, double *largest,
                                    uint8_t *holed) {
    const int y1 = isogi_vol__last_voxel(by, 4, v->size[1]), z1 = isogi_vol__last_voxel(bz, 4, v->size[2]);
    double buffer[ISOGI_VOL__STRIP_VOXELS];
    int i, y, z;
    for (i = 0; i < count; i++) least[i] = DBL_MAX, largest[i] = -DBL_MAX, holed[i] = 0;
    for (z = (int)(4 * bz); z <= z1; z++)
        for (y = (int)(4 * by); y <= y1; y++) {
            const double *row = isogi_vol__value_row(v, x, (size_t)y, (size_t)z, count, buffer);
            for (i = 0; i < count; i++) {
                const int finite = isogi_vol__finite64(row[i]);
                least[i] = finite && row[i] < least[i] ? row[i] : least[i];
                largest[i] = finite && row[i] > largest[i] ? row[i] : largest[i];
                holed[i] |= (uint8_t)!finite;
            }
        }
}

/* Columns of a strip of blocks, for all types but double; 0 if a number is not finite. */
static int isogi_vol__bound_strip(const isogi_pyramid *p, size_t x, int count, size_t by, size_t bz, float *least, float *largest) {
    const isogi_volume *v = &p->volume;
    const float *row[5];
    float buffer[5][ISOGI_VOL__STRIP_VOXELS];
    int rows = isogi_vol__last_voxel(by, 4, v->size[1]) - (int)(4 * by) + 1, z1 = isogi_vol__last_voxel(bz, 4, v->size[2]), z, i,
        finite = 1;
    for (i = 0; i < count; i++) least[i] = FLT_MAX, largest[i] = -FLT_MAX;
    for (z = (int)(4 * bz); z <= z1; z++) {
        int done = 0;
        for (i = 0; i < rows; i++) row[i] = isogi_vol__raw_row(p, x, 4 * by + (size_t)i, (size_t)z, count, buffer[i]);
#ifdef ISOGI_VOL__AVX
        if (p->path >= ISOGI_VOL__PATH_AVX2)
            done = isogi_vol__bound_eights(row, rows, count, row[0] == buffer[0] ? 0 : 4 * v->stride[1], least, largest, &finite);
#endif
        for (i = 0; i < rows; i++) finite &= isogi_vol__bound_row(row[i] + done, count - done, least + done, largest + done);
    }
    return finite;
}

/* One task: the level-0 blocks of one z. */
static void isogi_vol__build_task(void *arg, size_t task) {
    isogi_vol__build_job *job = (isogi_vol__build_job *)arg;
    const isogi_volume *v = &job->pyramid->volume;
    const isogi_level *level = &job->pyramid->level[0];
    float least[ISOGI_VOL__STRIP_VOXELS], largest[ISOGI_VOL__STRIP_VOXELS];
    double low[ISOGI_VOL__STRIP_VOXELS], high[ISOGI_VOL__STRIP_VOXELS], range[2] = {DBL_MAX, -DBL_MAX};
    uint8_t holed[ISOGI_VOL__STRIP_VOXELS];
    const size_t bz = job->first[2] + task;
    size_t bx, by, broken = 0;
    for (by = job->first[1]; by <= job->last[1]; by++) {
        const size_t row = level->size[0] * (by + level->size[1] * bz);
        float(*block)[2] = job->pyramid->blocks + row;
        size_t strip = ISOGI_VOL__STRIP / 4, first = 0;
        int raw = 0;
        for (bx = job->first[0]; bx <= job->last[0]; bx++) {
            double bound[2] = {DBL_MAX, -DBL_MAX};
            size_t x, last;
            int finite = 1;
            if ((bx - job->first[0]) % strip == 0) {
                const size_t rest = isogi_vol__min_size(v->size[0], 4 * job->last[0] + 5) - 4 * bx;
                const int count = rest < ISOGI_VOL__STRIP + 1 ? (int)rest : ISOGI_VOL__STRIP + 1;
                first = 4 * bx;
                raw = v->type != ISOGI_F64 && isogi_vol__bound_strip(job->pyramid, first, count, by, bz, least, largest);
                if (!raw) isogi_vol__bound_values(v, first, count, by, bz, low, high, holed);
            }
            x = 4 * bx - first, last = (size_t)isogi_vol__last_voxel(bx, 4, v->size[0]) - first;
            if (raw) {
                float a = least[x], b = largest[x];
                while (x++ < last) a = least[x] < a ? least[x] : a, b = largest[x] > b ? largest[x] : b;
                bound[v->scale < 0] = v->scale * (double)a + v->bias, bound[!(v->scale < 0)] = v->scale * (double)b + v->bias;
            } else
                for (; x <= last; x++)
                    bound[0] = isogi_vol__min(bound[0], low[x]), bound[1] = isogi_vol__max(bound[1], high[x]), finite &= !holed[x];
            job->pyramid->broken[row + bx] = (uint8_t)!finite, broken += !finite;
            block[bx][0] = isogi_vol__float_below(bound[0]), block[bx][1] = isogi_vol__float_above(bound[1]);
            range[0] = isogi_vol__min(range[0], bound[0]), range[1] = isogi_vol__max(range[1], bound[1]);
        }
    }
    job->range[task][0] = range[0], job->range[task][1] = range[1];
    job->broken[task] = broken;
}

/* Level n over these blocks of level 0, from level n-1: four blocks a side. Every `step`th slice of it, from one on. */
static void isogi_vol__build_level(isogi_pyramid *p, int n, const size_t first[3], const size_t last[3], size_t slice, size_t step) {
    const isogi_level *from = &p->level[n - 1], *to = &p->level[n];
    size_t x, y, z, i, j, k;
    for (z = (first[2] >> 2 * n) + slice; z <= last[2] >> 2 * n; z += step)
        for (y = first[1] >> 2 * n; y <= last[1] >> 2 * n; y++)
            for (x = first[0] >> 2 * n; x <= last[0] >> 2 * n; x++) {
                float(*out)[2] = p->blocks + (to->range - (const float(*)[2])p->blocks) + x + to->size[0] * (y + to->size[1] * z);
                (*out)[0] = FLT_MAX, (*out)[1] = -FLT_MAX;
                for (k = 4 * z; k < 4 * z + 4 && k < from->size[2]; k++)
                    for (j = 4 * y; j < 4 * y + 4 && j < from->size[1]; j++)
                        for (i = 4 * x; i < 4 * x + 4 && i < from->size[0]; i++) {
                            const float *r = from->range[i + from->size[0] * (j + from->size[1] * k)];
                            if (r[0] < (*out)[0]) (*out)[0] = r[0];
                            if (r[1] > (*out)[1]) (*out)[1] = r[1];
                        }
            }
}

/* Tasks in which slices of 64 children are brought together: one where they are too few to be worth a thread. */
static size_t isogi_vol__gathering_tasks(const isogi_vol__build_job *job) {
    size_t slice = 1;
    int a;
    for (a = 0; a < 2; a++) slice *= (job->last[a] >> 2) - (job->first[a] >> 2) + 1;
    return slice < 64 ? 1 : (job->last[2] >> 2) - (job->first[2] >> 2) + 1;
}

static void isogi_vol__level_task(void *arg, size_t task) {
    const isogi_vol__build_job *job = (const isogi_vol__build_job *)arg;
    isogi_vol__build_level(job->pyramid, 1, job->first, job->last, task, isogi_vol__gathering_tasks(job));
}

/* Sizes of all levels; the number of blocks, or 0 on overflow. */
ISOGI_VOL__COLD static size_t isogi_vol__plan_levels(isogi_pyramid *p) {
    size_t total = 0;
    int n, a;
    for (n = 0; n < ISOGI_VOL__LEVELS; n++) {
        isogi_level *level = &p->level[n];
        size_t blocks = 1;
        level->cells = 4 << (2 * n);
        for (a = 0; a < 3; a++) {
            size_t cells = p->volume.size[a] > 1 ? p->volume.size[a] - 1 : 1;
            level->size[a] = (cells + (size_t)level->cells - 1) / (size_t)level->cells;
            if (blocks > SIZE_MAX / 64 / level->size[a]) return 0;
            blocks *= level->size[a];
        }
        total += blocks;
    }
    return total;
}

/* Bounds of the blocks of a job on all levels; *range: of their finite values, *broken: how many of them are not all finite. */
static isogi_result isogi_vol__bound_blocks(isogi_vol__build_job *job, const isogi_context *context, double range[2], size_t *broken) {
    isogi_pyramid *p = job->pyramid;
    const size_t tasks = job->last[2] - job->first[2] + 1;
    isogi_result result = ISOGI_NO_MEMORY;
    size_t i;
    job->range = (double(*)[2])isogi_allocate(&p->context, tasks, sizeof *job->range);
    job->broken = (size_t *)isogi_allocate(&p->context, tasks, sizeof *job->broken);
    if (job->range && job->broken) result = isogi_parallel(context, tasks, isogi_vol__build_task, job, 0, 0.45);
    if (result == ISOGI_OK) {
        range[0] = DBL_MAX, range[1] = -DBL_MAX, *broken = 0;
        for (i = 0; i < tasks; i++) {
            range[0] = isogi_vol__min(range[0], job->range[i][0]), range[1] = isogi_vol__max(range[1], job->range[i][1]);
            *broken += job->broken[i];
        }
        result = isogi_parallel(context, isogi_vol__gathering_tasks(job), isogi_vol__level_task, job, 0.45, 0.5);
        if (result == ISOGI_OK) isogi_vol__build_level(p, 2, job->first, job->last, 0, 1);
    }
    isogi_release(&p->context, job->range, tasks, sizeof *job->range);
    isogi_release(&p->context, job->broken, tasks, sizeof *job->broken);
    return result;
}

static void isogi_vol__set_range(isogi_pyramid *p, double low, double high) {
    p->range[0] = low <= high ? low + 0.0 : 0, p->range[1] = low <= high ? high + 0.0 : 0; /* not -0 */
}

static isogi_result isogi_vol__build_blocks(isogi_pyramid *p) {
    isogi_vol__build_job job;
    isogi_result result;
    double range[2];
    int a;
    memset(&job, 0, sizeof job);
    job.pyramid = p;
    for (a = 0; a < 3; a++) job.last[a] = p->level[0].size[a] - 1;
    result = isogi_vol__bound_blocks(&job, &p->context, range, &p->broken_count);
    if (result != ISOGI_OK) return result;
    isogi_vol__set_range(p, range[0], range[1]);
    p->all_finite = !p->broken_count;
    return ISOGI_OK;
}

/* ---- the same ranges in 8 bits, for fast rays ----

   Voxels that are not finite count as above all others here, hence as inside, and what rays skip for lying on one side hides nothing: a
   cell with such a voxel and one that is outside is looked at in double where the ray may cross from side to side, and forgets what was
   known; one whose other voxels are all inside is left through a face that is inside, too, or not finite itself. */
#define ISOGI_VOL__BROKEN 255

/* Monotone, so that comparing 8-bit values never hides a block that holds the isovalue. */
static int isogi_vol__quantise(const isogi_pyramid *p, double value) {
    double q = (value - p->range[0]) * p->node_scale;
    return q > 0 ? q < 253 ? (int)q : 253 : 0;
}

/* What an isovalue can be in 8 bits. The margin covers other roundings of the same formula: voxels are quantised in float, whose
   error is below 255 * 2^-22. low > high: no surface anywhere. Returns it unrounded. */
static float isogi_vol__quantise_isovalue(const isogi_pyramid *p, double isovalue, int *low, int *high) {
    double q = (isovalue - p->range[0]) * p->node_scale;
    *low = 1, *high = 0;
    if (!(isovalue >= p->range[0] && isovalue <= p->range[1])) return 0;
    *low = q > 0.01 ? (int)(q - 0.01) : 0;
    *high = q < 252 ? (int)(q + 0.01) : 253;
    return (float)q;
}

/* Bounds of the finite values of block `at` of level 0. */
static void isogi_vol__quantise_block(const isogi_pyramid *p, size_t at, uint8_t bound[2]) {
    const float *range = p->level[0].range[at];
    const int empty = range[0] > range[1];
    bound[0] = empty ? ISOGI_VOL__BROKEN : (uint8_t)isogi_vol__quantise(p, (double)range[0]);
    bound[1] = empty ? ISOGI_VOL__BROKEN : (uint8_t)isogi_vol__quantise(p, (double)range[1]);
}

/* Siblings are stored together, since a ray that looks at one soon looks at the next. */
ISOGI_VOL__INLINE size_t isogi_vol__node_at(const isogi_pyramid *p, int n, size_t x, size_t y, size_t z) {
    const isogi_vol__node_level *level = &p->node_level[n];
    return level->first + 64 * ((x >> 2) + level->parents[0] * ((y >> 2) + level->parents[1] * (z >> 2))) + (x & 3) + 4 * (y & 3) +
           16 * (z & 3);
}

/* A node over nodes of the level below. */
static void isogi_vol__build_node(const isogi_pyramid *p, int n, const size_t node[3]) {
    const isogi_vol__node_level *children = &p->node_level[n - 1];
    uint8_t *out = p->nodes[isogi_vol__node_at(p, n, node[0], node[1], node[2])];
    size_t i, k;
    for (i = 0; i < 64; i++) {
        size_t x = 4 * node[0] + (i & 3), y = 4 * node[1] + (i >> 2 & 3), z = 4 * node[2] + (i >> 4);
        const uint8_t *child;
        out[i] = 255, out[64 + i] = 0; /* beyond the volume: never entered */
        if (x >= children->size[0] || y >= children->size[1] || z >= children->size[2]) continue;
        if (n == 1) {
            const size_t at = x + children->size[0] * (y + children->size[1] * z);
            uint8_t bound[2];
            isogi_vol__quantise_block(p, at, bound);
            out[i] = bound[0], out[64 + i] = p->broken[at] ? ISOGI_VOL__BROKEN : bound[1];
            continue;
        }
        child = p->nodes[isogi_vol__node_at(p, n - 1, x, y, z)];
        for (k = 0; k < 64; k++) {
            if (child[k] < out[i]) out[i] = child[k];
            if (child[64 + k] > out[64 + i]) out[64 + i] = child[64 + k];
        }
    }
}

/* A row of voxels in units of the 8-bit values of nodes, not rounded; the last one is repeated to fill the vectors. */
static void isogi_vol__unit_row(const isogi_vol__build_job *job, size_t x, size_t y, size_t z, int count, float *out) {
    const isogi_pyramid *p = job->pyramid;
    const isogi_volume *v = &p->volume;
    int i = 0;
    if (v->type == ISOGI_F64) {
        double buffer[ISOGI_VOL__STRIP_VOXELS];
        const double *value = isogi_vol__value_row(v, x, y, z, count, buffer);
        for (; i < count; i++) out[i] = (float)((value[i] - p->range[0]) * p->node_scale);
    } else {
        const float *row = isogi_vol__raw_row(p, x, y, z, count, out);
#ifdef ISOGI_VOL__SSE2
        const __m128 low = _mm_set1_ps(job->raw_low), scale = _mm_set1_ps(job->raw_scale);
        for (; i + 4 <= count; i += 4) _mm_storeu_ps(out + i, _mm_mul_ps(_mm_sub_ps(_mm_loadu_ps(row + i), low), scale));
#endif
        for (; i < count; i++) out[i] = (row[i] - job->raw_low) * job->raw_scale;
    }
    for (; i < count + 8; i++) out[i] = out[count - 1];
}

/* A leaf is the node of 4x4x4 cells. It holds no bounds but its voxels: voxel (x,y,z), 0..4 each, at byte x + 5y + 25z, in steps of
   1/254 of what lies between the leaf's own 8-bit bounds, rounded down. So the same two cache lines tell which cells hold the surface,
   and what it does in them to some 2 % of what the field changes by in a cell: enough to see that most rays miss it there. A voxel that is
   not finite is BROKEN. */
enum { ISOGI_VOL__LEAF_LOW = 125, ISOGI_VOL__LEAF_HIGH, ISOGI_VOL__LEAF_CUT }; /* bounds; see cut_of */
#define ISOGI_VOL__CODES 254.0f
#define ISOGI_VOL__DOUBT 0.625f /* error of a value made of codes + 0.5, in steps */
#define ISOGI_VOL__ABOVE 255.1f /* isovalues in steps are no larger: all codes are certainly outside, but BROKEN is not */

/* How many cells of a block are beyond the volume along each axis, 2 bits each. */
ISOGI_VOL__INLINE int isogi_vol__cut_of(const isogi_pyramid *p, const size_t block[3]) {
    int cut = 0, a;
    for (a = 0; a < 3; a++) {
        const size_t cells = (size_t)p->cells[a] - 4 * block[a];
        cut |= (int)(cells < 4 ? 4 - cells : 0) << 2 * a;
    }
    return cut;
}

/* Five voxels of a row for each of a strip's leaves; eight bytes are written, of which later rows overwrite three. */
ISOGI_VOL__INLINE void isogi_vol__code_row(const float *row, int leaves, const float *low, const float *scale, uint8_t (*out)[128],
                                           int at) {
    int i;
    for (i = 0; i < leaves; i++, row += 4) {
#ifdef ISOGI_VOL__SSE2
        const __m128 l = _mm_set1_ps(low[i]), k = _mm_set1_ps(scale[i]);
        const __m128i a = _mm_cvttps_epi32(_mm_mul_ps(_mm_sub_ps(_mm_loadu_ps(row), l), k));
        const __m128i b = _mm_cvttps_epi32(_mm_mul_ps(_mm_sub_ps(_mm_loadu_ps(row + 4), l), k));
        const __m128i words = _mm_packs_epi32(a, b);
        _mm_storel_epi64((__m128i *)(void *)(out[i] + at), _mm_packus_epi16(words, words));
#else
        int x;
        for (x = 0; x < 5; x++) {
            /* cppcheck-suppress uninitvar */
            const float q = (row[x] - low[i]) * scale[i];
            out[i][at + x] = (uint8_t)(q > 0 ? q < ISOGI_VOL__CODES ? (int)q : (int)ISOGI_VOL__CODES : 0);
        }
#endif
    }
}

#ifdef ISOGI_VOL__AVX
/* unit_row and code_row in one, bit by bit the same, for a row of at least eight raw numbers: a compiler that may contract must not join
   the two. What lies `ahead` bytes on will soon be wanted, too. */
ISOGI_VOL__TARGET("avx2")
static void isogi_vol__code_eights(const isogi_vol__build_job *job, const float *row, int count, ptrdiff_t ahead, int leaves,
                                   const float *low, const float *scale, uint8_t (*out)[128], int at) {
    const __m256 raw_low = _mm256_set1_ps(job->raw_low), raw_scale = _mm256_set1_ps(job->raw_scale);
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    int i;
    for (i = 0; i < leaves; i++) {
        const int beyond = 4 * i + 8 - count; /* of the last leaves: voxels after the row, which repeat its last one */
        __m256 unit;
        __m256i codes;
        __m128i words;
        if (beyond <= 0) unit = _mm256_loadu_ps(row + 4 * i);
        else unit = _mm256_permutevar8x32_ps(_mm256_loadu_ps(row + count - 8), /* not by way of memory: a load after shorter stores waits */
                                             _mm256_min_epi32(_mm256_add_epi32(lane, _mm256_set1_epi32(beyond)), _mm256_set1_epi32(7)));
        unit = _mm256_mul_ps(_mm256_sub_ps(unit, raw_low), raw_scale);
        _mm_prefetch((const char *)((uintptr_t)(row + 4 * i) + (uintptr_t)ahead), _MM_HINT_T0);
        __asm__("" : "+x"(unit));
        codes = _mm256_cvttps_epi32(_mm256_mul_ps(_mm256_sub_ps(unit, _mm256_broadcast_ss(low + i)), _mm256_broadcast_ss(scale + i)));
        words = _mm_packs_epi32(_mm256_castsi256_si128(codes), _mm256_extracti128_si256(codes, 1));
        _mm_storel_epi64((__m128i *)(void *)(out[i] + at), _mm_packus_epi16(words, words));
    }
}

#ifndef __clang__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized" /* gcc 12 says so of its own undefined vectors */
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wsign-conversion" /* and of masks in its own macros, at -O0 */
#endif
/* Sixteen numbers of a row of `count` from number `at` on; its last one is repeated. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__row_from(const float *row, int at, int count) {
    const __m512i lane = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const int beyond = at + 16 - count;
    if (beyond <= 0) return _mm512_loadu_ps(row + at);
    return _mm512_permutexvar_ps(_mm512_min_epi32(_mm512_add_epi32(lane, _mm512_set1_epi32(beyond)), _mm512_set1_epi32(15)),
                                 _mm512_loadu_ps(row + count - 16));
}

/* The same for five rows at a time, of at least sixteen numbers: the 25 voxels of one z of four leaves, one leaf in each quarter of a
   vector. A row gives a leaf four voxels; its fifth ones are the first ones of the next leaf, four rows of which make one vector. */
ISOGI_VOL__AVX512
static void isogi_vol__code_sixteens(const isogi_vol__build_job *job, const float *const *row, int count, ptrdiff_t ahead, int leaves,
                                     const float *low, const float *scale, uint8_t (*out)[128], int at) {
    /* 5 voxels of each row: bytes of the first vector below are 0, of the second one 64 and on */
    static const uint8_t order[32] = {0,  1,  2,  3,  68, 4,  5,  6,  7,  69, 8,  9,  10, 11, 70, 12,
                                      13, 14, 15, 71, 64, 65, 66, 67, 72, 0,  0,  0,  0,  0,  0,  0};
    const __m512i quarter = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    const __m512i leaf0 = _mm512_broadcast_i64x4(_mm256_loadu_si256((const __m256i *)(const void *)order));
    const __m512i from01 = _mm512_mask_add_epi8(leaf0, 0xffffffff00000000u, leaf0, _mm512_set1_epi8(16)),
                  from23 = _mm512_add_epi8(from01, _mm512_set1_epi8(32));
    const __m512 raw_low = _mm512_set1_ps(job->raw_low), raw_scale = _mm512_set1_ps(job->raw_scale);
    int i, y;
    for (i = 0; i < leaves; i += 4) {
        const __m512 least = _mm512_permutexvar_ps(quarter, _mm512_castps128_ps512(_mm_loadu_ps(low + i))),
                     steps = _mm512_permutexvar_ps(quarter, _mm512_castps128_ps512(_mm_loadu_ps(scale + i)));
        __m512 x[7], next[5];
        __m512i code[7], rows, rest;
#pragma GCC unroll 5
        for (y = 0; y < 5; y++) {
            x[y] = isogi_vol__row_from(row[y], 4 * i, count);
            _mm_prefetch((const char *)((uintptr_t)(row[y] + 4 * i) + (uintptr_t)ahead), _MM_HINT_T0);
        }
#pragma GCC unroll 5
        for (y = 0; y < 5; y++) next[y] = isogi_vol__row_from(row[y], 4 * i + 4, count);
        x[5] = _mm512_castpd_ps(_mm512_unpacklo_pd(_mm512_castps_pd(_mm512_unpacklo_ps(next[0], next[1])),
                                                   _mm512_castps_pd(_mm512_unpacklo_ps(next[2], next[3]))));
        x[6] = next[4];
#pragma GCC unroll 7
        for (y = 0; y < 7; y++) {
            __m512 unit = _mm512_mul_ps(_mm512_sub_ps(x[y], raw_low), raw_scale);
            __asm__("" : "+v"(unit));
            code[y] = _mm512_cvttps_epi32(_mm512_mul_ps(_mm512_sub_ps(unit, least), steps));
        }
        rows = _mm512_packus_epi16(_mm512_packs_epi32(code[0], code[1]), _mm512_packs_epi32(code[2], code[3]));
        rest = _mm512_packus_epi16(_mm512_packs_epi32(code[4], code[5]), _mm512_packs_epi32(code[6], code[6]));
        code[0] = _mm512_permutex2var_epi8(rows, from01, rest), code[1] = _mm512_permutex2var_epi8(rows, from23, rest);
        _mm256_mask_storeu_epi32(out[i] + at, 0x7f, _mm512_castsi512_si256(code[0])); /* 28 bytes: the last ones end with the leaf */
        _mm256_mask_storeu_epi32(out[i + 1] + at, 0x7f, _mm512_extracti64x4_epi64(code[0], 1));
        _mm256_mask_storeu_epi32(out[i + 2] + at, 0x7f, _mm512_castsi512_si256(code[1]));
        _mm256_mask_storeu_epi32(out[i + 3] + at, 0x7f, _mm512_extracti64x4_epi64(code[1], 1));
    }
}
#ifndef __clang__
#pragma GCC diagnostic pop
#endif
#endif

/* The voxels of a strip of leaves. */
static void isogi_vol__code_strip(const isogi_vol__build_job *job, size_t x0, int count, size_t by, size_t bz, int leaves,
                                  const float *low, const float *scale, uint8_t (*leaf)[128]) {
    const isogi_pyramid *p = job->pyramid;
    const isogi_volume *v = &p->volume;
    float row[5][ISOGI_VOL__STRIP_VOXELS];
    int y, z;
    for (z = 0; z < 5; z++) {
        const size_t at_z = isogi_vol__min_size(4 * bz + (size_t)z, v->size[2] - 1);
        size_t at_y[5];
        for (y = 0; y < 5; y++) at_y[y] = isogi_vol__min_size(4 * by + (size_t)y, v->size[1] - 1);
#ifdef ISOGI_VOL__AVX
        if (p->path == ISOGI_VOL__PATH_AVX512 && v->type != ISOGI_F64 && count >= 16) {
            const float *from[5];
            const ptrdiff_t ahead = z < 4 ? v->stride[2] : 4 * v->stride[1] - 4 * v->stride[2]; /* next to be read */
            for (y = 0; y < 5; y++) from[y] = isogi_vol__raw_row(p, x0, at_y[y], at_z, count, row[y]);
            isogi_vol__code_sixteens(job, from, count, from[0] == row[0] ? 0 : ahead, leaves, low, scale, leaf, 25 * z);
            continue;
        }
        if (p->path >= ISOGI_VOL__PATH_AVX2 && v->type != ISOGI_F64 && count >= 8) {
            for (y = 0; y < 5; y++) {
                const float *from = isogi_vol__raw_row(p, x0, at_y[y], at_z, count, row[0]);
                isogi_vol__code_eights(job, from, count, from == row[0] ? 0 : 2 * v->stride[1], leaves, low, scale, leaf, 5 * y + 25 * z);
            }
            continue;
        }
#endif
        for (y = 0; y < 5; y++) {
            isogi_vol__unit_row(job, x0, at_y[y], at_z, count, row[0]);
            isogi_vol__code_row(row[0], leaves, low, scale, leaf, 5 * y + 25 * z);
        }
    }
}

/* Marks the voxels of a leaf that are not finite, which all are where it has no range. */
static void isogi_vol__mark_broken(const isogi_volume *v, const size_t block[3], const float range[2], uint8_t leaf[128]) {
    const size_t first = 4 * block[0], rest = v->size[0] - first;
    const int count = rest < 5 ? (int)rest : 5;
    int x, y, z;
    if (range[0] > range[1]) {
        memset(leaf, ISOGI_VOL__BROKEN, 125);
        return;
    }
    for (z = 0; z < 5; z++)
        for (y = 0; y < 5; y++, leaf += 5) {
            double row[5];
            isogi_vol__row(v, (int)first, (int)isogi_vol__min_size(4 * block[1] + (size_t)y, v->size[1] - 1),
                           (int)isogi_vol__min_size(4 * block[2] + (size_t)z, v->size[2] - 1), count, row);
            for (x = 0; x < count; x++)
                if (!isogi_vol__finite64(row[x])) leaf[x] = ISOGI_VOL__BROKEN;
        }
}

/* One row of leaves, a strip of it; `end`: cells along x up to which the job goes. */
static void isogi_vol__build_strip(const isogi_vol__build_job *job, size_t x0, size_t end, size_t by, size_t bz) {
    const isogi_pyramid *p = job->pyramid;
    const isogi_level *level = &p->level[0];
    const size_t rest = end + 1 - x0, first = x0 / 4 + level->size[0] * (by + level->size[1] * bz);
    const int count = rest < ISOGI_VOL__STRIP + 1 ? (int)rest : ISOGI_VOL__STRIP + 1, leaves = (count - 1 + 3) / 4;
    float low[ISOGI_VOL__STRIP / 4], scale[ISOGI_VOL__STRIP / 4];
    uint8_t leaf[ISOGI_VOL__STRIP / 4][128], bound[ISOGI_VOL__STRIP / 4][2];
    int i;
    for (i = leaves; i & 3; i++) low[i] = scale[i] = 0; /* vectors hold four leaves */
    for (i = 0; i < leaves; i++) {
        isogi_vol__quantise_block(p, first + (size_t)i, bound[i]);
        low[i] = (float)bound[i][0], scale[i] = ISOGI_VOL__CODES / (float)(bound[i][1] + 1 - bound[i][0]);
    }
    isogi_vol__code_strip(job, x0, count, by, bz, leaves, low, scale, leaf);
    for (i = 0; i < leaves; i++) {
        size_t block[3];
        block[0] = x0 / 4 + (size_t)i, block[1] = by, block[2] = bz;
        leaf[i][ISOGI_VOL__LEAF_LOW] = bound[i][0], leaf[i][ISOGI_VOL__LEAF_HIGH] = bound[i][1];
        leaf[i][ISOGI_VOL__LEAF_CUT] = (uint8_t)isogi_vol__cut_of(p, block);
        if (p->broken[first + (size_t)i]) isogi_vol__mark_broken(&p->volume, block, level->range[first + (size_t)i], leaf[i]);
        memcpy(p->nodes[isogi_vol__node_at(p, 0, block[0], by, bz)], leaf[i], sizeof leaf[i]);
    }
}

/* One task: the leaves of one z. */
static void isogi_vol__build_leaves(void *arg, size_t task) {
    const isogi_vol__build_job *job = (const isogi_vol__build_job *)arg;
    const size_t bz = job->first[2] + task, end = isogi_vol__min_size((size_t)job->pyramid->cells[0], 4 * job->last[0] + 4);
    size_t by, x0;
    for (x0 = 4 * job->first[0]; x0 < end; x0 += ISOGI_VOL__STRIP)
        for (by = job->first[1]; by <= job->last[1]; by++) isogi_vol__build_strip(job, x0, end, by, bz);
}

#ifdef ISOGI_VOL__AVX
static int isogi_vol__machine(void);
#endif

/* Whether the volume's shape and the path allow fast rays, whatever its voxels are. */
static int isogi_vol__may_be_fast(const isogi_pyramid *p) {
    int a;
    for (a = 0; a < 3; a++)
        if (!p->cells[a] || p->volume.size[a] > ISOGI_VOL__FAST_SIZE) return 0;
    return p->path != ISOGI_VOL__PATH_PLAIN;
}

/* Whether fast rays are right for this volume, and how its raw values become 8-bit ones. */
ISOGI_VOL__COLD static int isogi_vol__plan_nodes(isogi_pyramid *p, isogi_vol__build_job *job) {
    const double range = p->range[1] - p->range[0], scale = p->volume.scale;
    int a;
    memset(job, 0, sizeof *job);
    job->pyramid = p;
    for (a = 0; a < 3; a++) job->last[a] = p->level[0].size[a] - 1;
    if (!isogi_vol__may_be_fast(p) || !(range > 0) || !(range < 1e300)) return 0;
    p->node_scale = 253 / range; /* odd: isovalues in the middle of the range lie in the middle of a step */
    if (!(p->node_scale < 1e300)) return 0;
    /* the float formula must stay within its margin of the double one, and double roundings far below the steps of leaves */
    if (!(range > 1e-6 * isogi_vol__largest(p->range[0], p->range[1], 0))) return 0;
    if (p->volume.type == ISOGI_F64) return 1;
    if (!(fabs(p->node_scale * scale) < 1e30) || !(fabs(p->node_scale * scale) > 1e-30)) return 0;
    job->raw_low = (float)((p->range[0] - p->volume.bias) / scale), job->raw_scale = (float)(p->node_scale * scale);
    return 1;
}

/* Sizes of all levels of nodes; their number in all. */
ISOGI_VOL__COLD static size_t isogi_vol__plan_node_levels(isogi_pyramid *p) {
    size_t count = 0, nodes = 2;
    int n, a;
    for (n = 0; n < ISOGI_VOL__LEVELS || nodes > 1; n++) {
        isogi_vol__node_level *level = &p->node_level[n];
        level->first = count, nodes = 1;
        for (a = 0; a < 3; a++) {
            level->size[a] = (((size_t)p->cells[a] - 1) >> (2 * n + 2)) + 1, level->parents[a] = (level->size[a] + 3) / 4;
            nodes *= level->size[a];
        }
        if (n || !p->volume.compact) count += 64 * level->parents[0] * level->parents[1] * level->parents[2];
    }
    p->node_levels = n;
    return count;
}

/* Nodes of level n, every `step`th slice from one on. */
static void isogi_vol__build_node_level(const isogi_vol__build_job *job, int n, size_t slice, size_t step) {
    size_t node[3];
    for (node[2] = (job->first[2] >> 2 * n) + slice; node[2] <= job->last[2] >> 2 * n; node[2] += step)
        for (node[1] = job->first[1] >> 2 * n; node[1] <= job->last[1] >> 2 * n; node[1]++)
            for (node[0] = job->first[0] >> 2 * n; node[0] <= job->last[0] >> 2 * n; node[0]++)
                isogi_vol__build_node(job->pyramid, n, node);
}

static void isogi_vol__nodes_task(void *arg, size_t task) {
    const isogi_vol__build_job *job = (const isogi_vol__build_job *)arg;
    isogi_vol__build_node_level(job, 1, task, isogi_vol__gathering_tasks(job));
}

/* The nodes over the blocks of a job, on all levels. */
static isogi_result isogi_vol__fill_nodes(isogi_vol__build_job *job, const isogi_context *context) {
    const isogi_pyramid *p = job->pyramid;
    const size_t tasks = p->volume.compact ? 0 : job->last[2] - job->first[2] + 1;
    const double leaves = p->volume.compact ? 0.5 : 0.95; /* when they are done */
    isogi_result result = isogi_parallel(context, tasks, isogi_vol__build_leaves, job, 0.5, leaves);
    int n;
    if (result == ISOGI_OK) result = isogi_parallel(context, isogi_vol__gathering_tasks(job), isogi_vol__nodes_task, job, leaves, 1);
    for (n = 2; n < p->node_levels && result == ISOGI_OK; n++) isogi_vol__build_node_level(job, n, 0, 1);
    return result;
}

/* What fast rays look up, rides only within, inner, turn, size, wider and reach: see fast traversal. */
struct isogi_vol__ways {
    int32_t lane[ISOGI_VOL__NODE_LEVELS][16], row[ISOGI_VOL__NODE_LEVELS][16]; /* 0 1 2 3 children of a level, in cells, along rows of four
                                                                                  lanes, and down those rows */
    float within[64][16];                /* a child's children by its digits i: 4 i + 0 1 2 3 in a row of four lanes for each axis */
    uint8_t corner[8][8][64];            /* a leaf's voxels at the corners of its cells, and at the lowest one; axes counted backwards */
    uint8_t lowest[8][64], beside[8][64]; /* as in voxel; from the lowest to eight times each corner, counted backwards likewise */
    int32_t inner[64][4];                /* the digits */
    uint8_t turn[8][3][16];              /* what counts a mask of children backwards, by axes: where its bytes come from; what becomes
                                            of their lower and their upper four bits */
    uint8_t child[8][64], voxel[8][128]; /* children of nodes and voxels of leaves with axes counted backwards: bit a of the index */
    int32_t stride[ISOGI_VOL__NODE_LEVELS][4]; /* from a node's coordinates to the number of the 64 that hold its children, which are of
                                                  this level */
    uint64_t first[ISOGI_VOL__NODE_LEVELS]; /* of those nodes, in bytes */
    float size[ISOGI_VOL__NODE_LEVELS];  /* of a child, in cells */
    float wide[ISOGI_VOL__NODE_LEVELS];  /* the same, with what rays alone widen it by on both sides (AVX-512), */
    float wider[ISOGI_VOL__NODE_LEVELS]; /* and with what rides do */
    float reach;                         /* that of rays alone, on one side */
    float scale[256];                    /* steps of a leaf in a unit of nodes, by how far its bounds are apart */
    uint64_t above[ISOGI_VOL__NODE_LEVELS], digit[ISOGI_VOL__NODE_LEVELS]; /* digits of packed cells above children of a level;
                                                                              where those have theirs */
};

/* What a child is widened by on each side, in cells, for a root of `levels` levels, if times are rounded once for each; else twice this. */
#define ISOGI_VOL__NEAR(levels) ((float)(1 << 2 * (levels)) * 1e-6f)

ISOGI_VOL__COLD static void isogi_vol__set_ways(struct isogi_vol__ways *ways, const isogi_vol__node_level *level, int levels) {
    int i, f, a;
    for (i = 0; i < levels; i++) {
        ways->stride[i][0] = 1, ways->stride[i][1] = (int32_t)level[i].parents[0], ways->stride[i][3] = 0;
        ways->stride[i][2] = (int32_t)(level[i].parents[0] * level[i].parents[1]);
        ways->first[i] = 128 * (uint64_t)level[i].first;
    }
    ways->reach = ISOGI_VOL__NEAR(levels);
    for (i = 0; i < ISOGI_VOL__NODE_LEVELS; i++) {
        for (a = 0; a < 16; a++) ways->lane[i][a] = (a & 3) << 2 * i, ways->row[i][a] = a >> 2 << 2 * i;
        ways->size[i] = (float)(1 << 2 * i);
        ways->wide[i] = ways->size[i] + 2 * ISOGI_VOL__NEAR(levels), ways->wider[i] = ways->size[i] + 4 * ISOGI_VOL__NEAR(levels);
        ways->above[i] = 0x0000ffffffffffffu & ~(0x000100010001u * (((uint64_t)4 << 2 * i) - 1)),
        ways->digit[i] = (uint64_t)0x000300030003u << 2 * i;
    }
    for (i = 0; i < 64; i++) {
        for (a = 0; a < 16; a++) ways->within[i][a] = a < 12 ? (float)(4 * (i >> (a >> 2 << 1) & 3) + (a & 3)) : 0;
        for (a = 0; a < 3; a++) ways->inner[i][a] = i >> 2 * a & 3;
        ways->inner[i][3] = 0;
    }
    memset(ways->voxel, 0, sizeof ways->voxel);
    for (i = 0; i < 256; i++) ways->scale[i] = ISOGI_VOL__CODES / (float)(i + 1);
    for (f = 0; f < 8; f++) {
        const int x = f & 1, y = f >> 1 & 1, z = f >> 2;
        for (i = 0; i < 16; i++) {
            const int row = x ? i >> 3 | (i >> 1 & 2) | (i << 1 & 4) | (i << 3 & 8) : i;
            ways->turn[f][0][i] = (uint8_t)(i ^ (y | 6 * z)), ways->turn[f][1][i] = (uint8_t)(y ? row << 4 : row);
            ways->turn[f][2][i] = (uint8_t)(y ? row : row << 4);
        }
        for (i = 0; i < 64; i++) {
            const int child = i ^ (3 * x | 12 * y | 48 * z), lowest = (child & 3) + 5 * (child >> 2 & 3) + 25 * (child >> 4);
            ways->child[f][i] = (uint8_t)child, ways->lowest[f][i] = (uint8_t)lowest;
            for (a = 0; a < 8; a++) ways->corner[f][a][i] = (uint8_t)(lowest + (a & 1) + 5 * (a >> 1 & 1) + 25 * (a >> 2));
            a = i >> 3 ^ f, ways->beside[f][i] = (uint8_t)((a & 1) + 5 * (a >> 1 & 1) + 25 * (a >> 2));
        }
        for (i = 0; i < 125; i++)
            ways->voxel[f][i] = (uint8_t)((x ? 4 - i % 5 : i % 5) + 5 * (y ? 4 - i / 5 % 5 : i / 5 % 5) + 25 * (z ? 4 - i / 25 : i / 25));
    }
}

ISOGI_VOL__COLD static isogi_result isogi_vol__reserve_nodes(isogi_pyramid *p) {
    p->node_count = isogi_vol__plan_node_levels(p);
    if (!p->ways) {
        p->ways = (struct isogi_vol__ways *)isogi_allocate(&p->context, 1, sizeof *p->ways);
        if (!p->ways) return ISOGI_NO_MEMORY;
        isogi_vol__set_ways(p->ways, p->node_level, p->node_levels);
    }
    p->nodes = (uint8_t(*)[128])isogi_allocate(&p->context, p->node_count, sizeof *p->nodes);
    return p->nodes ? ISOGI_OK : ISOGI_NO_MEMORY;
}

static isogi_result isogi_vol__build_nodes(isogi_pyramid *p) {
    isogi_vol__build_job job;
    isogi_result result;
    p->fast = isogi_vol__plan_nodes(p, &job);
    result = p->fast ? isogi_vol__reserve_nodes(p) : ISOGI_OK;
    if (result == ISOGI_OK && p->fast) result = isogi_vol__fill_nodes(&job, &p->context);
    if (result != ISOGI_OK || p->fast) return result;
    return isogi_vol__report(&p->context, 0.5, 1, 1, 1) ? ISOGI_CANCELLED : ISOGI_OK; /* without nodes all is done */
}

ISOGI_API isogi_result isogi_vol_build(isogi_pyramid **pyramid, const isogi_volume *volume, const isogi_context *context) {
    isogi_result result = isogi_volume_validate(volume);
    isogi_pyramid *p;
    isogi_thread_pool *pool;
    size_t blocks, first = 0;
    int n, a;
    if (!pyramid) return ISOGI_INVALID;
    if (result != ISOGI_OK) return result;
    p = (isogi_pyramid *)isogi_allocate(context, 1, sizeof *p);
    if (!p) return ISOGI_NO_MEMORY;
    memset(p, 0, sizeof *p);
    if (context) p->context = *context;
    p->volume = isogi_vol__resolve(volume);
    p->path = ISOGI_VOL__PATH_BASE;
#ifdef ISOGI_VOL__AVX
    p->path = isogi_vol__machine();
#endif
    if (p->context.force_path > 0 && p->context.force_path < p->path) p->path = p->context.force_path;
    for (a = 0; a < 3; a++) p->cells[a] = (int)(p->volume.size[a] - 1);
    isogi_vol__set_transform(p);
    isogi_vol__plan_float_grid(p);
    blocks = isogi_vol__plan_levels(p);
    p->blocks = (float(*)[2])isogi_allocate(context, blocks, sizeof *p->blocks);
    p->block_count = blocks;
    if (p->blocks) p->broken = (uint8_t *)isogi_allocate(context, blocks, 1);
    result = p->broken ? ISOGI_OK : blocks ? ISOGI_NO_MEMORY : ISOGI_TOO_LARGE;
    if (result == ISOGI_OK) {
        for (n = 0; n < ISOGI_VOL__LEVELS; n++) {
            p->level[n].range = (const float(*)[2])p->blocks + first;
            first += p->level[n].size[0] * p->level[n].size[1] * p->level[n].size[2];
        }
        pool = isogi_thread_pool_begin(&p->context);
        result = isogi_vol__build_blocks(p);
        if (result == ISOGI_OK) result = isogi_vol__build_nodes(p);
        isogi_thread_pool_end(&p->context, pool);
    }
    if (result == ISOGI_OK) *pyramid = p;
    else isogi_vol_free(p);
    return result;
}

/* ---- changed voxels ---- */

/* The least (end 0) or largest (end 1) finite value of the volume, exactly, by way of the blocks whose rounded bounds are extreme; no
   value is beyond what p->range says. Stops as soon as nothing can be beyond what was found: that, the bound itself, or, among raw
   integers, less than a step from it. */
ISOGI_VOL__COLD static double isogi_vol__find_extreme(const isogi_pyramid *p, int end, uint64_t *blocks) {
    const isogi_level *level = p->level;
    const double step = p->volume.type < ISOGI_F32 ? fabs(p->volume.scale) : 0;
    double found = end ? -DBL_MAX : DBL_MAX;
    float extreme = end ? -FLT_MAX : FLT_MAX;
    size_t n = level[2].size[0] * level[2].size[1] * level[2].size[2], i, x, y, z;
    for (i = 0; i < n; i++)
        if (level[2].range[i][0] <= level[2].range[i][1] && (end ? level[2].range[i][1] > extreme : level[2].range[i][0] < extreme))
            extreme = level[2].range[i][end];
    for (z = 0; z < level[0].size[2]; z++)
        for (y = 0; y < level[0].size[1]; y++)
            for (x = 0; x < level[0].size[0]; x++) {
                const size_t at = x + level[0].size[0] * (y + level[0].size[1] * z);
                const size_t first[3] = {4 * x, 4 * y, 4 * z}, last[3] = {4 * x + 4, 4 * y + 4, 4 * z + 4};
                double bound[2], beyond;
                if (!(x & 15)) i = x / 16 + level[2].size[0] * (y / 16 + level[2].size[1] * (z / 16));
                if (level[2].range[i][0] > level[2].range[i][1] ||
                    (end ? level[2].range[i][1] < extreme : level[2].range[i][0] > extreme)) {
                    x |= 15;
                    continue;
                }
                if (level[0].range[at][0] > level[0].range[at][1] ||
                    (end ? level[0].range[at][1] < extreme : level[0].range[at][0] > extreme))
                    continue;
                isogi_volume_range(&p->volume, first, last, bound), ++*blocks;
                found = end ? isogi_vol__max(found, bound[1]) : isogi_vol__min(found, bound[0]);
                beyond = fabs(found - (double)extreme);
                if (!(beyond > 0) || beyond < 0.5 * step || (end ? found >= p->range[1] : found <= p->range[0])) return found;
            }
    return found;
}

/* What an update has to know of its blocks before they change. */
typedef struct isogi_vol__before {
    size_t broken;
    int extreme[2]; /* whether the volume's least, largest value may lie in them */
} isogi_vol__before;

static isogi_vol__before isogi_vol__look_before(const isogi_pyramid *p, const isogi_vol__build_job *job) {
    const isogi_level *level = &p->level[0];
    const float low = isogi_vol__float_below(p->range[0]), high = isogi_vol__float_above(p->range[1]);
    isogi_vol__before before;
    size_t x, y, z;
    memset(&before, 0, sizeof before);
    for (z = job->first[2]; z <= job->last[2]; z++)
        for (y = job->first[1]; y <= job->last[1]; y++)
            for (x = job->first[0]; x <= job->last[0]; x++) {
                const size_t at = x + level->size[0] * (y + level->size[1] * z);
                before.broken += p->broken[at];
                before.extreme[0] |= level->range[at][0] <= low, before.extreme[1] |= level->range[at][1] >= high;
            }
    return before;
}

/* The volume's range, from what it was, what the changed blocks have now, and a look elsewhere where an extreme may be gone. */
static void isogi_vol__renew_range(isogi_pyramid *p, const isogi_vol__before *before, const double changed[2], int was_empty,
                                   uint64_t *blocks) {
    double low = isogi_vol__min(p->range[0], changed[0]), high = isogi_vol__max(p->range[1], changed[1]);
    if (was_empty) low = changed[0], high = changed[1];
    else {
        if (before->extreme[0] && changed[0] > p->range[0]) low = isogi_vol__find_extreme(p, 0, blocks);
        if (before->extreme[1] && changed[1] < p->range[1]) high = isogi_vol__find_extreme(p, 1, blocks);
    }
    isogi_vol__set_range(p, low, high);
}

static int isogi_vol__is_empty(const isogi_pyramid *p) {
    const isogi_level *top = &p->level[2];
    size_t n = top->size[0] * top->size[1] * top->size[2], i;
    for (i = 0; i < n; i++)
        if (top->range[i][0] <= top->range[i][1]) return 0;
    return 1;
}

/* The 8-bit bounds of the changed blocks, or all of them where their unit has changed. Memory for them is there. */
static void isogi_vol__renew_nodes(isogi_pyramid *p, const isogi_vol__build_job *changed, const isogi_context *context, int same_unit) {
    isogi_context whole = p->context;
    isogi_vol__build_job job;
    whole.progress = NULL, whole.thread_pool = context->thread_pool;
    p->fast = isogi_vol__plan_nodes(p, &job);
    if (!p->fast) return;
    if (same_unit) memcpy(job.first, changed->first, sizeof job.first), memcpy(job.last, changed->last, sizeof job.last);
    isogi_vol__fill_nodes(&job, same_unit ? context : &whole);
}

/* The blocks that voxels first..last belong to; 0 if the volume has no such voxels. */
static int isogi_vol__blocks_of(const isogi_pyramid *p, const size_t first[3], const size_t last[3], isogi_vol__build_job *job) {
    int a;
    memset(job, 0, sizeof *job);
    for (a = 0; a < 3; a++) {
        if (first[a] > last[a] || first[a] >= p->volume.size[a]) return 0;
        job->first[a] = first[a] ? (first[a] - 1) / 4 : 0;
        job->last[a] = isogi_vol__min_size(last[a] / 4, p->level[0].size[a] - 1);
        job->first[a] = isogi_vol__min_size(job->first[a], job->last[a]);
    }
    return 1;
}

ISOGI_API isogi_result isogi_vol_update(isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], isogi_counters *counters) {
    isogi_pyramid *p = pyramid;
    isogi_vol__build_job job;
    isogi_vol__before before;
    isogi_context context;
    isogi_thread_pool *pool;
    isogi_result result = ISOGI_OK;
    double changed[2], range[2];
    size_t broken;
    uint64_t blocks;
    int was_fast, was_empty;
    if (!p || p->field.value || !first || !last || !isogi_vol__blocks_of(p, first, last, &job)) return ISOGI_INVALID;
    job.pyramid = p, context = p->context, context.progress = NULL;
    blocks = (uint64_t)(job.last[0] - job.first[0] + 1) * (job.last[1] - job.first[1] + 1) * (job.last[2] - job.first[2] + 1);
    if (blocks < 4096) context.parallel_for = NULL, context.threads = 1; /* threads would cost more than they bring */
    before = isogi_vol__look_before(p, &job);
    was_fast = p->fast, was_empty = isogi_vol__is_empty(p);
    memcpy(range, p->range, sizeof range);
    if (!p->nodes && isogi_vol__may_be_fast(p)) result = isogi_vol__reserve_nodes(p);
    if (result != ISOGI_OK) return result;
    pool = isogi_thread_pool_begin(&context);
    result = isogi_vol__bound_blocks(&job, &context, changed, &broken);
    if (result == ISOGI_OK) {
        p->broken_count = p->broken_count - before.broken + broken, p->all_finite = !p->broken_count;
        isogi_vol__renew_range(p, &before, changed, was_empty, &blocks);
        isogi_vol__renew_nodes(p, &job, &context, was_fast && !memcmp(range, p->range, sizeof range));
        if (counters) counters->blocks += blocks;
    }
    isogi_thread_pool_end(&context, pool);
    return result;
}

ISOGI_API void isogi_vol_free(isogi_pyramid *pyramid) {
    isogi_context context;
    if (!pyramid) return;
    context = pyramid->context;
    isogi_release(&context, pyramid->blocks, pyramid->block_count, sizeof *pyramid->blocks);
    isogi_release(&context, pyramid->broken, pyramid->block_count, 1);
    isogi_release(&context, pyramid->nodes, pyramid->node_count, sizeof *pyramid->nodes);
    isogi_release(&context, pyramid->ways, 1, sizeof *pyramid->ways);
    isogi_release(&context, pyramid, 1, sizeof *pyramid);
}

ISOGI_API const isogi_volume *isogi_vol_volume(const isogi_pyramid *pyramid) { return pyramid ? &pyramid->volume : NULL; }
ISOGI_API const isogi_context *isogi_vol_context(const isogi_pyramid *pyramid) { return pyramid ? &pyramid->context : NULL; }

ISOGI_API isogi_level isogi_vol_level(const isogi_pyramid *pyramid, int level) {
    isogi_level none;
    memset(&none, 0, sizeof none);
    return pyramid && level >= 0 && level < ISOGI_VOL__LEVELS ? pyramid->level[level] : none;
}

ISOGI_API int isogi_vol_finite(const isogi_pyramid *pyramid) { return pyramid && pyramid->all_finite; }

ISOGI_API void isogi_vol_range(const isogi_pyramid *pyramid, double range[2]) {
    if (!range) return;
    range[0] = pyramid ? pyramid->range[0] : 0, range[1] = pyramid ? pyramid->range[1] : 0;
}

/* ---- what a box can hold ---- */

static int isogi_vol__any_overlaps(const double (*ranges)[2], size_t count, double low, double high) {
    size_t i;
    for (i = 0; i < count; i++)
        if (ranges[i][0] <= ranges[i][1] && ranges[i][0] <= high && ranges[i][1] >= low) return 1;
    return 0;
}

typedef struct isogi_vol__box_query {
    const isogi_pyramid *pyramid;
    size_t first[3], last[3];
    const double (*ranges)[2]; /* NULL: the range is asked for */
    size_t count;
    double range[2];
} isogi_vol__box_query;

/* Takes a block into the answer, from its bounds or from those within it; 1 if nothing more has to be known. */
static int isogi_vol__query_block(isogi_vol__box_query *q, int n, const size_t block[3]) {
    const isogi_level *level = &q->pyramid->level[n];
    const float *bound = level->range[block[0] + level->size[0] * (block[1] + level->size[1] * block[2])];
    double range[2];
    size_t low[3], high[3], child[3];
    int a, within = 1;
    range[0] = (double)bound[0], range[1] = (double)bound[1];
    if (range[0] > range[1]) return 0;
    if (q->ranges ? !isogi_vol__any_overlaps(q->ranges, q->count, range[0], range[1]) : range[0] >= q->range[0] && range[1] <= q->range[1])
        return 0;
    for (a = 0; a < 3; a++) {
        low[a] = block[a] * (size_t)level->cells,
        high[a] = (size_t)isogi_vol__last_voxel(block[a], level->cells, q->pyramid->volume.size[a]);
        within = within && low[a] >= q->first[a] && high[a] <= q->last[a];
        low[a] = low[a] > q->first[a] ? low[a] : q->first[a], high[a] = isogi_vol__min_size(high[a], q->last[a]);
    }
    if (!within && n) {
        const isogi_level *below = level - 1;
        const size_t c = (size_t)below->cells;
        for (a = 0; a < 3; a++) { /* the children that cover the voxels low..high; neighbours share voxels */
            low[a] = isogi_vol__min_size(low[a] / c, below->size[a] - 1);
            high[a] = high[a] > low[a] * c ? (high[a] - 1) / c : low[a];
            high[a] = isogi_vol__min_size(high[a], below->size[a] - 1);
        }
        for (child[2] = low[2]; child[2] <= high[2]; child[2]++)
            for (child[1] = low[1]; child[1] <= high[1]; child[1]++)
                for (child[0] = low[0]; child[0] <= high[0]; child[0]++)
                    if (isogi_vol__query_block(q, n - 1, child)) return 1;
        return 0;
    }
    if (!within && !q->pyramid->field.value) isogi_volume_range(&q->pyramid->volume, low, high, range);
    if (q->ranges) return range[0] <= range[1] && isogi_vol__any_overlaps(q->ranges, q->count, range[0], range[1]);
    q->range[0] = isogi_vol__min(q->range[0], range[0]), q->range[1] = isogi_vol__max(q->range[1], range[1]);
    return 0;
}

static int isogi_vol__query_box(isogi_vol__box_query *q, const size_t first[3], const size_t last[3]) {
    const isogi_level *top = &q->pyramid->level[2];
    const size_t c = (size_t)top->cells;
    size_t block[3], end[3], begin[3];
    int a;
    for (a = 0; a < 3; a++) {
        q->first[a] = first[a], q->last[a] = isogi_vol__min_size(last[a], q->pyramid->volume.size[a] - 1);
        if (first[a] > q->last[a]) return 0;
        begin[a] = isogi_vol__min_size(first[a] / c, top->size[a] - 1), end[a] = isogi_vol__min_size(q->last[a] / c, top->size[a] - 1);
    }
    for (block[2] = begin[2]; block[2] <= end[2]; block[2]++)
        for (block[1] = begin[1]; block[1] <= end[1]; block[1]++)
            for (block[0] = begin[0]; block[0] <= end[0]; block[0]++)
                if (isogi_vol__query_block(q, 2, block)) return 1;
    return 0;
}

ISOGI_API isogi_result isogi_vol_box_range(const isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], double range[2]) {
    isogi_vol__box_query q;
    if (!pyramid || !first || !last || !range) return ISOGI_INVALID;
    memset(&q, 0, sizeof q);
    q.pyramid = pyramid, q.range[0] = DBL_MAX, q.range[1] = -DBL_MAX;
    isogi_vol__query_box(&q, first, last);
    range[0] = q.range[0], range[1] = q.range[1];
    return ISOGI_OK;
}

ISOGI_API int isogi_vol_may_hold(const isogi_pyramid *pyramid, const size_t first[3], const size_t last[3], const double (*ranges)[2],
                                 size_t range_count) {
    isogi_vol__box_query q;
    if (!pyramid || !first || !last || !ranges) return 0;
    memset(&q, 0, sizeof q);
    q.pyramid = pyramid, q.ranges = ranges, q.count = range_count;
    return isogi_vol__query_box(&q, first, last);
}

/* ==== four floats, and 64 bytes, on any machine ====================================================================== */

#if defined(ISOGI_VOL__SSE2)
typedef __m128 isogi_vol__four;
#define ISOGI_VOL__FOUR(operation) _mm_##operation
#define ISOGI_VOL__EVEN(a, b) _mm_shuffle_ps(a, b, 0x88) /* lanes 0 and 2 of both */
#define ISOGI_VOL__ODD(a, b) _mm_shuffle_ps(a, b, 0xdd)
#define ISOGI_VOL__LANE_base(v, i) _mm_shuffle_ps(v, v, 0x55 * (i))
#elif defined(ISOGI_VOL__NEON)
typedef float32x4_t isogi_vol__four;
#define ISOGI_VOL__FOUR(operation) isogi_vol__neon_##operation
#define isogi_vol__neon_add_ps vaddq_f32
#define isogi_vol__neon_sub_ps vsubq_f32
#define isogi_vol__neon_mul_ps vmulq_f32
#define isogi_vol__neon_min_ps vminq_f32
#define isogi_vol__neon_max_ps vmaxq_f32
#define isogi_vol__neon_set1_ps vdupq_n_f32
#define isogi_vol__neon_setzero_ps() vdupq_n_f32(0)
#define isogi_vol__neon_loadu_ps vld1q_f32
#define isogi_vol__neon_storeu_ps vst1q_f32
ISOGI_VOL__INLINE float32x4_t isogi_vol__neon_setr_ps(float a, float b, float c, float d) {
    const float32x4_t v = {a, b, c, d};
    return v;
}
#define ISOGI_VOL__EVEN(a, b) vuzp1q_f32(a, b)
#define ISOGI_VOL__ODD(a, b) vuzp2q_f32(a, b)
#define ISOGI_VOL__LANE_base(v, i) vdupq_laneq_f32(v, i)
#else
typedef struct isogi_vol__four { float f[4]; } isogi_vol__four;
#define ISOGI_VOL__FOUR(operation) isogi_vol__plain_##operation
#define ISOGI_VOL__EVEN(a, b) isogi_vol__plain_setr_ps((a).f[0], (a).f[2], (b).f[0], (b).f[2])
#define ISOGI_VOL__ODD(a, b) isogi_vol__plain_setr_ps((a).f[1], (a).f[3], (b).f[1], (b).f[3])
#define ISOGI_VOL__LANE_base(v, i) isogi_vol__plain_set1_ps((v).f[i])
static isogi_vol__four isogi_vol__plain_setr_ps(float a, float b, float c, float d) {
    isogi_vol__four v;
    v.f[0] = a, v.f[1] = b, v.f[2] = c, v.f[3] = d;
    return v;
}
static isogi_vol__four isogi_vol__plain_set1_ps(float a) { return isogi_vol__plain_setr_ps(a, a, a, a); }
static isogi_vol__four isogi_vol__plain_loadu_ps(const float *p) { return isogi_vol__plain_setr_ps(p[0], p[1], p[2], p[3]); }
static void isogi_vol__plain_storeu_ps(float *p, isogi_vol__four a) { memcpy(p, a.f, sizeof a.f); }
#define ISOGI_VOL__EACH(name, result) \
    static isogi_vol__four isogi_vol__plain_##name(isogi_vol__four a, isogi_vol__four b) { \
        int i; \
        for (i = 0; i < 4; i++) a.f[i] = result; \
        return a; \
    }
ISOGI_VOL__EACH(add_ps, a.f[i] + b.f[i])
ISOGI_VOL__EACH(sub_ps, a.f[i] - b.f[i])
ISOGI_VOL__EACH(mul_ps, a.f[i] * b.f[i])
ISOGI_VOL__EACH(min_ps, a.f[i] < b.f[i] ? a.f[i] : b.f[i])
ISOGI_VOL__EACH(max_ps, a.f[i] > b.f[i] ? a.f[i] : b.f[i])
#undef ISOGI_VOL__EACH
#endif

/* Bit a + 4 b: interval a of four and b of four others meet. */
ISOGI_VOL__INLINE uint64_t isogi_vol__met(isogi_vol__four in_a, isogi_vol__four out_a, isogi_vol__four in_b, isogi_vol__four out_b) {
#if defined(ISOGI_VOL__SSE2)
#define ISOGI_VOL__MET(b) _mm_castps_si128( \
    _mm_and_ps(_mm_cmple_ps(in_a, ISOGI_VOL__LANE_base(out_b, b)), _mm_cmple_ps(ISOGI_VOL__LANE_base(in_b, b), out_a)))
    const __m128i low = _mm_packs_epi32(ISOGI_VOL__MET(0), ISOGI_VOL__MET(1)), high = _mm_packs_epi32(ISOGI_VOL__MET(2), ISOGI_VOL__MET(3));
    return (unsigned)_mm_movemask_epi8(_mm_packs_epi16(low, high));
#undef ISOGI_VOL__MET
#elif defined(ISOGI_VOL__NEON)
    static const uint32_t bit[4] = {1, 2, 4, 8};
#define ISOGI_VOL__MET(b) vandq_u32(vshlq_n_u32(bits, 4 * (b)), \
    vandq_u32(vcleq_f32(in_a, ISOGI_VOL__LANE_base(out_b, b)), vcleq_f32(ISOGI_VOL__LANE_base(in_b, b), out_a)))
    const uint32x4_t bits = vld1q_u32(bit);
    return vaddvq_u32(vorrq_u32(vorrq_u32(ISOGI_VOL__MET(0), ISOGI_VOL__MET(1)), vorrq_u32(ISOGI_VOL__MET(2), ISOGI_VOL__MET(3))));
#undef ISOGI_VOL__MET
#else
    unsigned bits = 0;
    int i;
    for (i = 0; i < 16; i++) bits |= (unsigned)(in_a.f[i & 3] <= out_b.f[i >> 2] && in_b.f[i >> 2] <= out_a.f[i & 3]) << i;
    return bits;
#endif
}

/* Lanes in which a is at most b, a bit each. */
ISOGI_VOL__INLINE unsigned isogi_vol__at_most_base(isogi_vol__four a, isogi_vol__four b) {
#if defined(ISOGI_VOL__SSE2)
    return (unsigned)_mm_movemask_ps(_mm_cmple_ps(a, b));
#elif defined(ISOGI_VOL__NEON)
    static const uint32_t bit[4] = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(vcleq_f32(a, b), vld1q_u32(bit)));
#else
    return (unsigned)(a.f[0] <= b.f[0]) | (unsigned)(a.f[1] <= b.f[1]) << 1 | (unsigned)(a.f[2] <= b.f[2]) << 2 |
           (unsigned)(a.f[3] <= b.f[3]) << 3;
#endif
}

/* Which of 64 bytes, aligned to 16, are at least `least`, 0..255. */
ISOGI_VOL__INLINE uint64_t isogi_vol__at_least_base(const uint8_t *byte, int least) {
#if defined(ISOGI_VOL__SSE2)
    const __m128i *v = (const __m128i *)(const void *)byte, l = _mm_set1_epi8((char)least);
#define ISOGI_VOL__LEAST(i) \
    (uint64_t)(unsigned)_mm_movemask_epi8(_mm_cmpeq_epi8(_mm_max_epu8(_mm_load_si128(v + (i)), l), _mm_load_si128(v + (i)))) << 16 * (i)
    return ISOGI_VOL__LEAST(0) | ISOGI_VOL__LEAST(1) | ISOGI_VOL__LEAST(2) | ISOGI_VOL__LEAST(3);
#undef ISOGI_VOL__LEAST
#elif defined(ISOGI_VOL__NEON)
    const uint8x16_t l = vdupq_n_u8((uint8_t)least), bits = vreinterpretq_u8_u64(vdupq_n_u64(0x8040201008040201u));
#define ISOGI_VOL__LEAST(i) vandq_u8(vcgeq_u8(vld1q_u8(byte + 16 * (i)), l), bits)
    const uint8x16_t low = vpaddq_u8(ISOGI_VOL__LEAST(0), ISOGI_VOL__LEAST(1)), high = vpaddq_u8(ISOGI_VOL__LEAST(2), ISOGI_VOL__LEAST(3));
    const uint8x16_t all = vpaddq_u8(low, high);
    return vgetq_lane_u64(vreinterpretq_u64_u8(vpaddq_u8(all, all)), 0);
#undef ISOGI_VOL__LEAST
#else
    uint64_t mask = 0;
    int i;
    for (i = 0; i < 64; i++) mask |= (uint64_t)(byte[i] >= least) << i;
    return mask;
#endif
}

/* The number of the lowest bit that is set. */
ISOGI_VOL__INLINE int isogi_vol__lowest_bit(uint64_t x) {
#if (defined(__GNUC__) || defined(__clang__)) && !defined(__TINYC__)
    return __builtin_ctzll(x);
#else
    int n = 0, half;
    for (half = 32; half; half /= 2)
        if (!(x & (((uint64_t)1 << half) - 1))) n += half, x >>= half;
    return n;
#endif
}

/* How many of 16 bits are set. */
ISOGI_VOL__INLINE unsigned isogi_vol__count_bits(unsigned x) {
    x -= x >> 1 & 0x5555;
    x = (x & 0x3333) + (x >> 2 & 0x3333);
    return ((x + (x >> 4)) & 0x0f0f) * 0x0101 >> 8 & 255;
}

/* ==== values and gradients =========================================================================================== */

/* (1-u) a + u b: exact at both ends, so that two cells that share a face see the same values on it, bit by bit. */
static double isogi_vol__lerp(double a, double b, double u) { return (1 - u) * a + u * b; }

static double isogi_vol__trilinear(const double c[8], const double u[3], double gradient[3]) {
    double y0 = isogi_vol__lerp(c[0], c[1], u[0]), y1 = isogi_vol__lerp(c[2], c[3], u[0]);
    double y2 = isogi_vol__lerp(c[4], c[5], u[0]), y3 = isogi_vol__lerp(c[6], c[7], u[0]);
    double z0 = isogi_vol__lerp(y0, y1, u[1]), z1 = isogi_vol__lerp(y2, y3, u[1]);
    if (gradient) {
        gradient[0] = isogi_vol__lerp(isogi_vol__lerp(c[1] - c[0], c[3] - c[2], u[1]),
                                      isogi_vol__lerp(c[5] - c[4], c[7] - c[6], u[1]), u[2]);
        gradient[1] = isogi_vol__lerp(y1 - y0, y3 - y2, u[2]);
        gradient[2] = z1 - z0;
    }
    return isogi_vol__lerp(z0, z1, u[2]);
}

/* Weights of the taps i-1 .. i+2 at i + u as polynomials: [filter][power of u][tap]. Uniform cubic B-spline (methods, section 2) and
   Catmull-Rom (Catmull and Rom 1974, tension 1/2). */
static const double isogi_vol__taps[2][4][4] = {
    {{1.0 / 6, 4.0 / 6, 1.0 / 6, 0}, {-0.5, 0, 0.5, 0}, {0.5, -1, 0.5, 0}, {-1.0 / 6, 0.5, -0.5, 1.0 / 6}},
    {{0, 1, 0, 0}, {-0.5, 0, 0.5, 0}, {1, -2.5, 2, -0.5}, {-0.5, 1.5, -1.5, 0.5}}};

/* The weights and their derivatives, with linear continuation past the border folded into the weights of the voxels that exist:
   f(-1) = 2 f(0) - f(1). A halo moves the border outwards. */
static void isogi_vol__tap_weights(isogi_filter filter, const isogi_volume *volume, int axis, int i, double u, double w[4], double d[4],
                                   int tap[4]) {
    const double(*c)[4] = isogi_vol__taps[filter == ISOGI_FILTER_CATMULL_ROM];
    const int n = (int)volume->size[axis], low = volume->halo_low[axis] ? -1 : 0, high = volume->halo_high[axis] ? n : n - 1;
    int k;
    for (k = 0; k < 4; k++) {
        w[k] = ((c[3][k] * u + c[2][k]) * u + c[1][k]) * u + c[0][k], d[k] = (3 * c[3][k] * u + 2 * c[2][k]) * u + c[1][k];
        tap[k] = i + k - 1 < low ? low : i + k - 1 > high ? high : i + k - 1;
    }
    if (n == 1) {
        for (k = 0; k < 4; k++) tap[k] = 0;
        w[0] = w[2] = w[3] = 0, w[1] = 1;
        d[0] = d[1] = d[2] = d[3] = 0;
        return;
    }
    if (i == low) {
        w[1] += 2 * w[0], w[2] -= w[0], w[0] = 0;
        d[1] += 2 * d[0], d[2] -= d[0], d[0] = 0;
    }
    if (i == high - 1) {
        w[2] += 2 * w[3], w[1] -= w[3], w[3] = 0;
        d[2] += 2 * d[3], d[1] -= d[3], d[3] = 0;
    }
}

#ifdef ISOGI_VOL__AVX
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE double isogi_vol__dot4(__m256d a, __m256d b) {
    const __m256d p = _mm256_mul_pd(a, b);
    const __m128d q = _mm_add_pd(_mm256_castpd256_pd128(p), _mm256_extractf128_pd(p, 1));
    return _mm_cvtsd_f64(_mm_add_sd(q, _mm_unpackhi_pd(q, q)));
}

/* The four weights of an axis, and their derivatives, at once. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__weights4(const double c[4][4], double at, __m256d *slopes) {
    const __m256d u = _mm256_set1_pd(at), c0 = _mm256_loadu_pd(c[0]), c1 = _mm256_loadu_pd(c[1]), c2 = _mm256_loadu_pd(c[2]),
                  c3 = _mm256_loadu_pd(c[3]);
    const __m256d two = _mm256_set1_pd(2), three = _mm256_set1_pd(3);
    *slopes = _mm256_add_pd(_mm256_mul_pd(_mm256_add_pd(_mm256_mul_pd(_mm256_mul_pd(three, c3), u), _mm256_mul_pd(two, c2)), u), c1);
    return _mm256_add_pd(_mm256_mul_pd(_mm256_add_pd(_mm256_mul_pd(_mm256_add_pd(_mm256_mul_pd(c3, u), c2), u), c1), u), c0);
}

/* Four packed voxels as they are stored; of doubles a quarter. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__raw4(isogi_type type, const char *p) {
    int32_t bytes;
    if (type == ISOGI_F32) return _mm256_cvtps_pd(_mm_loadu_ps((const float *)(const void *)p));
    if (type == ISOGI_F64) return _mm256_mul_pd(_mm256_set1_pd(0.25), _mm256_loadu_pd((const double *)(const void *)p));
    if (type == ISOGI_U16) return _mm256_cvtepi32_pd(_mm_cvtepu16_epi32(_mm_loadl_epi64((const __m128i *)(const void *)p)));
    if (type == ISOGI_I16) return _mm256_cvtepi32_pd(_mm_cvtepi16_epi32(_mm_loadl_epi64((const __m128i *)(const void *)p)));
    memcpy(&bytes, p, sizeof bytes);
    return _mm256_cvtepi32_pd(type == ISOGI_U8 ? _mm_cvtepu8_epi32(_mm_cvtsi32_si128(bytes)) : _mm_cvtepi8_epi32(_mm_cvtsi32_si128(bytes)));
}

/* The sums below where all taps exist, a row at a time: rows are weighted along y and z first, x comes last. Packed voxels. */
ISOGI_VOL__TARGET("avx2")
static double isogi_vol__cubic_sum_avx2(const isogi_volume *v, const double powers[4][4], const int cell[3], const double local[3],
                                        double gradient[3]) {
    __m256d dx, dy, dz;
    const __m256d wx = isogi_vol__weights4(powers, local[0], &dx), wy = isogi_vol__weights4(powers, local[1], &dy);
    const __m256d wz = isogi_vol__weights4(powers, local[2], &dz);
    const isogi_type type = v->type;
    const double scale = type == ISOGI_F64 ? 4 * v->scale : v->scale;
    __m256d all = _mm256_setzero_pd(), by_y = all, by_z = all, base;
    const char *p = (const char *)v->data + (cell[0] - 1) * v->stride[0] + (cell[1] - 1) * v->stride[1] + (cell[2] - 1) * v->stride[2];
#define ISOGI_VOL__LANE(m, i) _mm256_permute4x64_pd(m, 0x55 * (i))
#define ISOGI_VOL__ROW(j) _mm256_sub_pd(isogi_vol__raw4(type, p + (j) * v->stride[1]), base)
#define ISOGI_VOL__SLICE(k)                                                                                                                \
    do {                                                                                                                                   \
        const __m256d row0 = ISOGI_VOL__ROW(0), row1 = ISOGI_VOL__ROW(1), row2 = ISOGI_VOL__ROW(2), row3 = ISOGI_VOL__ROW(3);              \
        const __m256d slice = _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(wy0, row0), _mm256_mul_pd(wy1, row1)),                             \
                                            _mm256_add_pd(_mm256_mul_pd(wy2, row2), _mm256_mul_pd(wy3, row3)));                            \
        const __m256d slope = _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(dy0, row0), _mm256_mul_pd(dy1, row1)),                             \
                                            _mm256_add_pd(_mm256_mul_pd(dy2, row2), _mm256_mul_pd(dy3, row3)));                            \
        all = _mm256_add_pd(all, _mm256_mul_pd(ISOGI_VOL__LANE(wz, k), slice));                                                            \
        by_y = _mm256_add_pd(by_y, _mm256_mul_pd(ISOGI_VOL__LANE(wz, k), slope));                                                          \
        by_z = _mm256_add_pd(by_z, _mm256_mul_pd(ISOGI_VOL__LANE(dz, k), slice));                                                          \
        p += v->stride[2];                                                                                                                 \
    } while (0)
    base = ISOGI_VOL__LANE(isogi_vol__raw4(type, p + v->stride[1] + v->stride[2]), 1);
    {
        const __m256d wy0 = ISOGI_VOL__LANE(wy, 0), wy1 = ISOGI_VOL__LANE(wy, 1), wy2 = ISOGI_VOL__LANE(wy, 2),
                      wy3 = ISOGI_VOL__LANE(wy, 3);
        const __m256d dy0 = ISOGI_VOL__LANE(dy, 0), dy1 = ISOGI_VOL__LANE(dy, 1), dy2 = ISOGI_VOL__LANE(dy, 2),
                      dy3 = ISOGI_VOL__LANE(dy, 3);
        ISOGI_VOL__SLICE(0);
        ISOGI_VOL__SLICE(1);
        ISOGI_VOL__SLICE(2);
        ISOGI_VOL__SLICE(3);
    }
#undef ISOGI_VOL__LANE
#undef ISOGI_VOL__ROW
#undef ISOGI_VOL__SLICE
    gradient[0] = scale * isogi_vol__dot4(all, dx), gradient[1] = scale * isogi_vol__dot4(by_y, wx);
    gradient[2] = scale * isogi_vol__dot4(by_z, wx);
    return scale * (_mm256_cvtsd_f64(base) + isogi_vol__dot4(all, wx)) + v->bias;
}
#endif

/* Value and gradient (per grid unit) at a cell and a place in it: 64 taps in one pass, row by row. The plain reference. Slopes sum to
   0 but for rounding, so taps count relative to the cell's first voxel: nothing is left of what all of them share, and constant voxels
   have no gradient. Scale and bias come last; a quarter of each voxel is exact and its differences do not overflow. */
static double isogi_vol__cubic_sum(const isogi_pyramid *p, isogi_filter filter, const int cell[3], const double local[3],
                                   double gradient[3]) {
    const isogi_volume *v = &p->volume;
    isogi_volume quarter;
    const double scale = 4 * v->scale;
    double w[3][4], d[3][4], base, value = 0, gx = 0, gy = 0, gz = 0;
    int tap[3][4], a, j, k;
#ifdef ISOGI_VOL__AVX
    if (p->path >= ISOGI_VOL__PATH_AVX2 && v->stride[0] == (ptrdiff_t)isogi_vol__type_size(v->type)) {
        int inner = 1;
        for (a = 0; a < 3; a++)
            inner &= (cell[a] > 0 || v->halo_low[a]) && (size_t)cell[a] + 2 < v->size[a] + v->halo_high[a] && v->size[a] > 1;
        if (inner) return isogi_vol__cubic_sum_avx2(v, isogi_vol__taps[filter == ISOGI_FILTER_CATMULL_ROM], cell, local, gradient);
    }
#endif
    for (a = 0; a < 3; a++) isogi_vol__tap_weights(filter, v, a, cell[a], local[a], w[a], d[a], tap[a]);
    quarter = *v, quarter.scale = 0.25, quarter.bias = 0;
    isogi_vol__row(&quarter, tap[0][1], tap[1][1], tap[2][1], 1, &base);
    for (k = 0; k < 4; k++) {
        double slice = 0, slice_x = 0, slice_y = 0;
        for (j = 0; j < 4; j++) {
            double f[4], row, row_x;
            int x0 = tap[0][0], count = tap[0][3] - x0 + 1;
            isogi_vol__row(&quarter, x0, tap[1][j], tap[2][k], count, f);
            for (a = 0; a < count; a++) f[a] -= base;
            /* taps past a border have weight 0: any finite voxel of the row stands in for them */
            row = w[0][0] * f[0] + w[0][1] * f[tap[0][1] - x0] + w[0][2] * f[tap[0][2] - x0] + w[0][3] * f[count - 1];
            row_x = d[0][0] * f[0] + d[0][1] * f[tap[0][1] - x0] + d[0][2] * f[tap[0][2] - x0] + d[0][3] * f[count - 1];
            slice += w[1][j] * row, slice_x += w[1][j] * row_x, slice_y += d[1][j] * row;
        }
        value += w[2][k] * slice, gx += w[2][k] * slice_x, gy += w[2][k] * slice_y, gz += d[2][k] * slice;
    }
    gradient[0] = scale * gx, gradient[1] = scale * gy, gradient[2] = scale * gz;
    return scale * (base + value) + v->bias;
}

/* ---- many points at once ----

   Points go in blocks: all of a block are located, then taken through float arithmetic side by side. A point's result
   does not depend on the others, whatever the size of a call. Against the plain code, values err by at most 2^-21 of the largest
   number that enters them: |voxel|, |bias|. */

#define ISOGI_VOL__BLOCK 64

typedef struct isogi_vol__block {
    int32_t cell[3][ISOGI_VOL__BLOCK];
    float local[3][ISOGI_VOL__BLOCK];
    ptrdiff_t offset[ISOGI_VOL__BLOCK]; /* of the cell's first voxel, in bytes */
    /* results for raw voxels, per grid unit */
    float value[ISOGI_VOL__BLOCK], gradient[3][ISOGI_VOL__BLOCK]; /* of the trilinear filter */
    float sum[4 * ISOGI_VOL__BLOCK];                              /* of cubic filters: value and gradient of each point */
    const struct isogi_vol__block *next; /* the whole block that follows, located already, or NULL: its voxels are asked for in time */
} isogi_vol__block;

/* Where the points of a call are: one of the two is NULL. */
typedef struct isogi_vol__points {
    const float (*world)[3];
    const double (*grid)[3];
} isogi_vol__points;

/* The grid coordinates of point i, anywhere. */
static void isogi_vol__grid_point(const isogi_pyramid *p, const isogi_vol__points *at, size_t i, double grid[3]) {
    double world[3];
    int a;
    if (at->grid) {
        for (a = 0; a < 3; a++) grid[a] = at->grid[i][a];
        return;
    }
    for (a = 0; a < 3; a++) world[a] = (double)at->world[i][a];
    isogi_vol_to_grid(p, world, grid);
}

#if defined(ISOGI_VOL__SSE2) || defined(ISOGI_VOL__NEON)
#if defined(ISOGI_VOL__AVX) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized" /* gcc 12 says so of its own undefined vectors */
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wsign-conversion" /* and of masks and shorts in its own macros, at -O0 */
#pragma GCC diagnostic ignored "-Wconversion"
#endif

/* A block of few points is 8; else sixteens, as voxels are asked for by them. */
static int isogi_vol__filled(int n) { return n <= 8 ? 8 : (n + 15) & ~15; }

/* Cell and place in it of points first .. first + n - 1, moved to the border if outside; isogi_vol__filled(n) are filled in. */
static void isogi_vol__locate(const isogi_pyramid *p, const isogi_vol__points *at, size_t first, int n, isogi_vol__block *b) {
    const isogi_volume *v = &p->volume;
    const int filled = isogi_vol__filled(n);
    int i, a;
    for (i = 0; i < filled; i++) {
        double grid[3] = {0, 0, 0}, local;
        if (i < n) isogi_vol__grid_point(p, at, first + (size_t)i, grid);
        b->offset[i] = 0;
        for (a = 0; a < 3; a++) {
            b->cell[a][i] = isogi_vol__cell(grid[a], v->size[a], &local);
            b->local[a][i] = (float)local, b->offset[i] += b->cell[a][i] * v->stride[a];
        }
    }
}

#ifdef ISOGI_VOL__AVX
#define ISOGI_VOL__AVX2 ISOGI_VOL__TARGET("avx2,fma")
/* The coordinates of four points that follow each other, and zeros after the last. */
static void isogi_vol__copy_points(const isogi_vol__points *at, size_t first, int n, double out[12]) {
    int r;
    for (r = 0; r < 12; r++)
        out[r] = r >= 3 * n ? 0 : at->grid ? at->grid[first + (size_t)(r / 3)][r % 3] : (double)at->world[first + (size_t)(r / 3)][r % 3];
}

/* The same for four points at a time. Coordinates x, y, z are parted from the numbers a, b, c; then axis by axis. */
ISOGI_VOL__AVX2 static void isogi_vol__locate_avx2(const isogi_pyramid *p, const isogi_vol__points *at, size_t first, int n,
                                                   isogi_vol__block *b) {
    const double *m = p->to_grid, *o = p->origin;
    const __m256d magic = _mm256_set1_pd(6755399441055744.0); /* 1.5 * 2^52: added to a number,
                                                                 it leaves it as an integer in the low bits */
    const int filled = isogi_vol__filled(n);
    int i, r;
    for (i = 0; i < filled; i += 4) {
        __m256d k0, k1, k2, g[3], offset = _mm256_setzero_pd();
        if (at->world && i + 4 <= n) {
            const float *w = at->world[first + (size_t)i];
            k0 = _mm256_cvtps_pd(_mm_loadu_ps(w)), k1 = _mm256_cvtps_pd(_mm_loadu_ps(w + 4)), k2 = _mm256_cvtps_pd(_mm_loadu_ps(w + 8));
        } else {
            double some[12];
            isogi_vol__copy_points(at, first + (size_t)i, n - i, some);
            k0 = _mm256_loadu_pd(some), k1 = _mm256_loadu_pd(some + 4), k2 = _mm256_loadu_pd(some + 8);
        }
        g[0] = _mm256_permute4x64_pd(_mm256_blend_pd(_mm256_blend_pd(k0, k1, 4), k2, 2), 0x6c);
        g[1] = _mm256_permute4x64_pd(_mm256_blend_pd(_mm256_blend_pd(k0, k1, 9), k2, 4), 0xb1);
        g[2] = _mm256_permute4x64_pd(_mm256_blend_pd(_mm256_blend_pd(k0, k1, 2), k2, 9), 0xc6);
        if (at->world) {
            for (r = 0; r < 3; r++) g[r] = _mm256_sub_pd(g[r], _mm256_set1_pd(o[r]));
            k0 = g[0], k1 = g[1], k2 = g[2];
            for (r = 0; r < 3; r++)
                g[r] = _mm256_fmadd_pd(_mm256_set1_pd(m[3 * r + 2]), k2,
                                       _mm256_fmadd_pd(_mm256_set1_pd(m[3 * r + 1]), k1, _mm256_mul_pd(_mm256_set1_pd(m[3 * r]), k0)));
        }
        for (r = 0; r < 3; r++) {
            __m256d whole;
            __m128i cell;
            g[r] = _mm256_min_pd(_mm256_max_pd(g[r], _mm256_setzero_pd()), _mm256_set1_pd(p->box[r])); /* NaN gives 0 */
            /* in any case */
            cell = _mm_max_epi32(_mm_min_epi32(_mm256_cvttpd_epi32(g[r]), _mm_set1_epi32(p->cells[r] - 1)), _mm_setzero_si128());
            whole = _mm256_cvtepi32_pd(cell);
            _mm_storeu_si128((__m128i *)(void *)&b->cell[r][i], cell);
            _mm_storeu_ps(&b->local[r][i], _mm256_cvtpd_ps(_mm256_sub_pd(g[r], whole)));
            offset = _mm256_fmadd_pd(whole, _mm256_set1_pd((double)p->volume.stride[r]), offset);
        }
        _mm256_storeu_si256((__m256i *)(void *)&b->offset[i],
                            _mm256_sub_epi64(_mm256_castpd_si256(_mm256_add_pd(offset, magic)), _mm256_castpd_si256(magic)));
    }
}

/* The same in floats, for eight world points at a time where isogi_vol__plan_float_grid allows it. A first guess of the cell is never too
   high and at most one too low, as 2^-8 is more than its error; from there the place in the cell is right to 2^-24. */
ISOGI_VOL__AVX2 static void isogi_vol__locate_floats(const isogi_pyramid *p, const float (*world)[3], int n, isogi_vol__block *b) {
    const isogi_vol__float_grid *g = &p->float_grid;
    const __m256 zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1);
    const __m128i width = _mm_cvtsi32_si128(g->shift);
    const int filled = isogi_vol__filled(n);
    float some[24];
    int i;
    for (i = 0; i < filled; i += 8) {
        const float *points = (const float *)world + 3 * (size_t)i;
        __m256 k0, k1, k2;
        __m256i voxel = _mm256_setzero_si256();
        if (n - i < 8) {
            memset(some, 0, sizeof some);
            if (n > i) memcpy(some, points, 3 * (size_t)(n - i) * sizeof *some);
            points = some;
        }
        k0 = _mm256_loadu_ps(points), k1 = _mm256_loadu_ps(points + 8), k2 = _mm256_loadu_ps(points + 16);
        /* coordinates r of all points, in lanes of k1 and k2, then in order; what is far below becomes the least integer */
#define ISOGI_VOL__AXIS(r, in1, in2)                                                                                             \
    do {                                                                                                                         \
        const __m256 mixed = _mm256_blend_ps(_mm256_blend_ps(k0, k1, in1), k2, in2);                                             \
        const __m256 w = _mm256_permutevar8x32_ps(mixed, _mm256_setr_epi32(r, (3 + r) & 7, (6 + r) & 7, (1 + r) & 7, (4 + r) & 7, \
                                                                           (7 + r) & 7, (2 + r) & 7, (5 + r) & 7));              \
        const __m256i end = _mm256_set1_epi32(p->cells[r] - 1);                                                                  \
        const __m256 high = _mm256_set1_ps(g->high[r]), at_high = _mm256_set1_ps(g->at_high[r]);                                 \
        const __m256 guess = _mm256_fmadd_ps(high, w, _mm256_sub_ps(at_high, _mm256_set1_ps(1.0f / 256)));                       \
        __m256i cell = _mm256_cvttps_epi32(_mm256_min_ps(guess, _mm256_cvtepi32_ps(end)));                                       \
        __m256 local, next;                                                                                                      \
        cell = _mm256_max_epi32(cell, _mm256_setzero_si256());                                                                   \
        local = _mm256_add_ps(_mm256_fmadd_ps(high, w, _mm256_sub_ps(at_high, _mm256_cvtepi32_ps(cell))),                        \
                              _mm256_fmadd_ps(_mm256_set1_ps(g->low[r]), w, _mm256_set1_ps(g->at_low[r])));                      \
        next = _mm256_and_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(end, cell)), _mm256_cmp_ps(local, one, _CMP_GE_OQ));         \
        cell = _mm256_sub_epi32(cell, _mm256_castps_si256(next)), local = _mm256_sub_ps(local, _mm256_and_ps(next, one));        \
        _mm256_storeu_si256((__m256i *)(void *)&b->cell[r][i], cell);                                                            \
        _mm256_storeu_ps(&b->local[r][i], _mm256_min_ps(_mm256_max_ps(local, zero), one)); /* of points outside; NaN gives 0 */  \
        voxel = _mm256_add_epi32(voxel, _mm256_mullo_epi32(cell, _mm256_set1_epi32(g->stride[r])));                              \
    } while (0)
        ISOGI_VOL__AXIS(0, 0x92, 0x24);
        ISOGI_VOL__AXIS(1, 0x24, 0x49);
        ISOGI_VOL__AXIS(2, 0x49, 0x92);
#undef ISOGI_VOL__AXIS
        _mm256_storeu_si256((__m256i *)(void *)&b->offset[i],
                            _mm256_sll_epi64(_mm256_cvtepi32_epi64(_mm256_castsi256_si128(voxel)), width));
        _mm256_storeu_si256((__m256i *)(void *)&b->offset[i + 4],
                            _mm256_sll_epi64(_mm256_cvtepi32_epi64(_mm256_extracti128_si256(voxel, 1)), width));
    }
}
#endif

/* Whether the points of a block, by the first of them, are more than a cell apart. */
ISOGI_VOL__INLINE int isogi_vol__far_apart(const isogi_vol__block *b) {
    int a, k, apart = 0;
    for (a = 0; a < 3; a++)
        for (k = 0; k < 3; k++) apart |= b->cell[a][k + 1] - b->cell[a][k] > 1 || b->cell[a][k + 1] - b->cell[a][k] < -1;
    return apart;
}

/* ---- trilinear values of a block ---- */

/* Corners x + 2y + 4z side by side, integers or the bits of floats, so that no level of instructions needs gathers, which are slow on many
   processors. */
static void isogi_vol__fetch(const isogi_volume *v, int n, const isogi_vol__block *b, int32_t raw[8][ISOGI_VOL__BLOCK]) {
    const char *data = (const char *)v->data;
    const ptrdiff_t dx = v->size[0] > 1 ? v->stride[0] : 0, dy = v->size[1] > 1 ? v->stride[1] : 0, dz = v->size[2] > 1 ? v->stride[2] : 0;
    int i;
#define ISOGI_VOL__TAKE_INTEGER(T, k, from) raw[k][i] = *(const T *)(const void *)(from)
#define ISOGI_VOL__TAKE_FLOAT(T, k, from) memcpy(&raw[k][i], from, sizeof(T))
#define ISOGI_VOL__READ(TAKE, T)                                                                                                 \
    for (i = 0; i < n; i++) {                                                                                                    \
        const char *p = data + b->offset[i], *q = p + dy, *r = p + dz, *s = q + dz;                                              \
        TAKE(T, 0, p), TAKE(T, 1, p + dx), TAKE(T, 2, q), TAKE(T, 3, q + dx);                                                    \
        TAKE(T, 4, r), TAKE(T, 5, r + dx), TAKE(T, 6, s), TAKE(T, 7, s + dx);                                                    \
    }                                                                                                                            \
    break;
    switch (v->type) {
    case ISOGI_U8: ISOGI_VOL__READ(ISOGI_VOL__TAKE_INTEGER, uint8_t)
    case ISOGI_I8: ISOGI_VOL__READ(ISOGI_VOL__TAKE_INTEGER, int8_t)
    case ISOGI_U16: ISOGI_VOL__READ(ISOGI_VOL__TAKE_INTEGER, uint16_t)
    case ISOGI_I16: ISOGI_VOL__READ(ISOGI_VOL__TAKE_INTEGER, int16_t)
    case ISOGI_F32: ISOGI_VOL__READ(ISOGI_VOL__TAKE_FLOAT, float)
    case ISOGI_F64: break;
    }
#undef ISOGI_VOL__TAKE_INTEGER
#undef ISOGI_VOL__TAKE_FLOAT
#undef ISOGI_VOL__READ
}

/* Trilinear values, and gradients if asked for, of the vector of points from i on with corners c; for any width: V and the operations
   L##mul_ps ... of the width. Differences of corners come first, so that the error of a gradient is relative to it. */
#define ISOGI_VOL__BLEND(NAME, L, a, b, axis) ISOGI_VOL__MADD_##NAME(at##axis, b, L##mul_ps(rest##axis, a))
#define ISOGI_VOL__SLOPE(NAME, L, k, a0, a1, b0, b1, c0, c1, d0, d1, e, f)                                                       \
    z0 = ISOGI_VOL__BLEND(NAME, L, L##sub_ps(c[a1], c[a0]), L##sub_ps(c[b1], c[b0]), e);                                         \
    z1 = ISOGI_VOL__BLEND(NAME, L, L##sub_ps(c[c1], c[c0]), L##sub_ps(c[d1], c[d0]), e);                                         \
    L##storeu_ps(&b->gradient[k][i], ISOGI_VOL__BLEND(NAME, L, z0, z1, f))
#define ISOGI_VOL__TRILINEAR(NAME, ATTRIBUTES, V, L)                                                                             \
    ATTRIBUTES ISOGI_VOL__INLINE void isogi_vol__trilinear_##NAME(isogi_vol__block *b, int i, const V c[8], int gradients) {     \
        const V at0 = L##loadu_ps(&b->local[0][i]), at1 = L##loadu_ps(&b->local[1][i]), at2 = L##loadu_ps(&b->local[2][i]);      \
        const V one = L##set1_ps(1), rest0 = L##sub_ps(one, at0), rest1 = L##sub_ps(one, at1), rest2 = L##sub_ps(one, at2);      \
        V z0, z1;                                                                                                                \
        z0 = ISOGI_VOL__BLEND(NAME, L, ISOGI_VOL__BLEND(NAME, L, c[0], c[1], 0), ISOGI_VOL__BLEND(NAME, L, c[2], c[3], 0), 1);   \
        z1 = ISOGI_VOL__BLEND(NAME, L, ISOGI_VOL__BLEND(NAME, L, c[4], c[5], 0), ISOGI_VOL__BLEND(NAME, L, c[6], c[7], 0), 1);   \
        L##storeu_ps(&b->value[i], ISOGI_VOL__BLEND(NAME, L, z0, z1, 2));                                                        \
        if (!gradients) return;                                                                                                  \
        ISOGI_VOL__SLOPE(NAME, L, 0, 0, 1, 2, 3, 4, 5, 6, 7, 1, 2);                                                              \
        ISOGI_VOL__SLOPE(NAME, L, 1, 0, 2, 1, 3, 4, 6, 5, 7, 0, 2);                                                              \
        ISOGI_VOL__SLOPE(NAME, L, 2, 0, 4, 1, 5, 2, 6, 3, 7, 0, 1);                                                              \
    }
/* A whole block from fetched corners. */
#define ISOGI_VOL__TRILINEAR_BLOCK(NAME, ATTRIBUTES, V, L, WIDTH)                                                                \
    ATTRIBUTES static void isogi_vol__trilinear_block_##NAME(const isogi_volume *v, isogi_vol__block *b, int n, int gradients) { \
        int32_t raw[8][ISOGI_VOL__BLOCK];                                                                                        \
        int i, k;                                                                                                                \
        isogi_vol__fetch(v, n, b, raw);                                                                                          \
        for (i = 0; i < n; i += WIDTH) {                                                                                         \
            V c[8];                                                                                                              \
            if (v->type == ISOGI_F32)                                                                                            \
                for (k = 0; k < 8; k++) c[k] = L##loadu_ps((const float *)(const void *)&raw[k][i]);                             \
            else                                                                                                                 \
                for (k = 0; k < 8; k++) c[k] = ISOGI_VOL__INTEGERS_##NAME(&raw[k][i]);                                           \
            isogi_vol__trilinear_##NAME(b, i, c, gradients);                                                                     \
        }                                                                                                                        \
    }

/* ---- cubic filters ---- */

/* x, read as if it had no sign, is (x ^ flip) - flip. */
static int32_t isogi_vol__flip_of(isogi_type type) { return type == ISOGI_I8 ? 0x80 : type == ISOGI_I16 ? 0x8000 : 0; }

/* Taps of points as floats: point n's begin offset[n] bytes from `first`, rows and slices follow at y and z; powers: of the filter, and
   {1, 0, 0, 0}. flip: see above. */
typedef struct isogi_vol__taps_at {
    const char *first;
    const ptrdiff_t *offset;
    ptrdiff_t y, z;
    float powers[5][4];
    int32_t flip;
} isogi_vol__taps_at;

/* The first tap of a point. */
ISOGI_VOL__INLINE const char *isogi_vol__first_tap(const isogi_volume *v, ptrdiff_t offset) {
    return (const char *)v->data + offset - v->stride[0] - v->stride[1] - v->stride[2];
}

/* Cubic filters for n points all of whose taps exist. Every four lanes are a point of their own and hold four taps of a row; rows are
   summed along y, then z, and x comes last. Taps count relative to the cell's first voxel, so that rounding is relative to the variation
   among them: hence the slices go 1, 2, 3, 0. What a width has to offer: SPREAD, a number for each point; TILE, four numbers for every
   point; LANE, the number of one lane of four in all of them; SUMS, the sums of four vectors over lanes, side by side. ROW: a row of each
   point as floats, r bytes from at0, at1 ...; KIND: of what voxels. sum is a parameter of its own since gcc 12 forgets calls that only
   write into b. */
#define ISOGI_VOL__WEIGHTS(NAME, L, axis, w, d)                                                                                  \
    u = ISOGI_VOL__SPREAD_##NAME(&b->local[axis][i]), half = ISOGI_VOL__MADD_##NAME(c3, u, c2);                                  \
    w = ISOGI_VOL__MADD_##NAME(ISOGI_VOL__MADD_##NAME(half, u, c1), u, c0);                                                      \
    d = ISOGI_VOL__MADD_##NAME(ISOGI_VOL__MADD_##NAME(c3, u, L##add_ps(half, half)), u, c1)
#define ISOGI_VOL__ALONG_Y(NAME, L, w)                                                                                           \
    ISOGI_VOL__MADD_##NAME(w##3, row3, ISOGI_VOL__MADD_##NAME(w##2, row2, ISOGI_VOL__MADD_##NAME(w##1, row1, L##mul_ps(w##0, row0))))
#define ISOGI_VOL__SLICE(NAME, L, ROW, k, to_next)                                                                               \
    row0 = ROW(0), row1 = ROW(sy), row2 = ROW(2 * sy), row3 = ROW(sy3), at0 += to_next, at1 += to_next, at2 += to_next, at3 += to_next; \
    if ((k) == 1) base = ISOGI_VOL__LANE_##NAME(row1, 1);                                                                        \
    row0 = L##sub_ps(row0, base), row1 = L##sub_ps(row1, base), row2 = L##sub_ps(row2, base), row3 = L##sub_ps(row3, base);      \
    slice = ISOGI_VOL__ALONG_Y(NAME, L, wy), slope = ISOGI_VOL__ALONG_Y(NAME, L, dy), u = ISOGI_VOL__LANE_##NAME(wz, k);         \
    value = ISOGI_VOL__MADD_##NAME(u, slice, value), by_y = ISOGI_VOL__MADD_##NAME(u, slope, by_y);                              \
    by_z = ISOGI_VOL__MADD_##NAME(ISOGI_VOL__LANE_##NAME(dz, k), slice, by_z)
#define ISOGI_VOL__CUBIC(NAME, ATTRIBUTES, V, L, WIDTH, KIND, ROW)                                                               \
    ATTRIBUTES static void isogi_vol__cubic_##KIND##_##NAME(const isogi_vol__taps_at *taps, const isogi_vol__block *b, int from, int n, \
                                                            float *sum) {                                                        \
        const float(*powers)[4] = taps->powers;                                                                                  \
        const V c0 = ISOGI_VOL__TILE_##NAME(powers[0]), c1 = ISOGI_VOL__TILE_##NAME(powers[1]), c2 = ISOGI_VOL__TILE_##NAME(powers[2]); \
        const V c3 = ISOGI_VOL__TILE_##NAME(powers[3]), to_value = ISOGI_VOL__TILE_##NAME(powers[4]);                            \
        const ptrdiff_t sy = taps->y, sz = taps->z, sy3 = 3 * sy, back = -3 * sz;                                                \
        int i;                                                                                                                   \
        for (i = from; i < n; i += WIDTH / 4) {                                                                                  \
            const ptrdiff_t *q = taps->offset + (i - from);                                                                      \
            const char *first = taps->first + sz, *at0 = first + q[0], *at1 = WIDTH > 4 ? first + q[1] : at0;                    \
            const char *at2 = WIDTH > 8 ? first + q[2] : at0, *at3 = WIDTH > 8 ? first + q[3] : at0;                             \
            V u, half, wx, dx, wy, dy, wz, dz, wy0, wy1, wy2, wy3, dy0, dy1, dy2, dy3, slice, slope, base, row0, row1, row2, row3; \
            V value = L##setzero_ps(), by_y = value, by_z = value;                                                               \
            ISOGI_VOL__WEIGHTS(NAME, L, 1, wy, dy);                                                                              \
            wy0 = ISOGI_VOL__LANE_##NAME(wy, 0), wy1 = ISOGI_VOL__LANE_##NAME(wy, 1);                                            \
            wy2 = ISOGI_VOL__LANE_##NAME(wy, 2), wy3 = ISOGI_VOL__LANE_##NAME(wy, 3);                                            \
            dy0 = ISOGI_VOL__LANE_##NAME(dy, 0), dy1 = ISOGI_VOL__LANE_##NAME(dy, 1);                                            \
            dy2 = ISOGI_VOL__LANE_##NAME(dy, 2), dy3 = ISOGI_VOL__LANE_##NAME(dy, 3);                                            \
            ISOGI_VOL__WEIGHTS(NAME, L, 2, wz, dz);                                                                              \
            ISOGI_VOL__SLICE(NAME, L, ROW, 1, sz);                                                                               \
            ISOGI_VOL__SLICE(NAME, L, ROW, 2, sz);                                                                               \
            ISOGI_VOL__SLICE(NAME, L, ROW, 3, back);                                                                             \
            ISOGI_VOL__SLICE(NAME, L, ROW, 0, 0);                                                                                \
            ISOGI_VOL__WEIGHTS(NAME, L, 0, wx, dx);                                                                              \
            slice = ISOGI_VOL__SUMS_##NAME(L##mul_ps(value, wx), L##mul_ps(value, dx), L##mul_ps(by_y, wx), L##mul_ps(by_z, wx)); \
            L##storeu_ps(sum + 4 * i, ISOGI_VOL__MADD_##NAME(base, to_value, slice));                                            \
        }                                                                                                                        \
    }

/* The 64 taps of a point side by side as floats, so that the filters need but one form. */
#define ISOGI_VOL__WIDEN_ROWS(L, ROW)                                                                                            \
    for (; out < end; p += v->stride[2] - 4 * v->stride[1])                                                                      \
        for (y = 0; y < 4; y++, p += v->stride[1], out += 4) L##storeu_ps(out, ROW(p));                                          \
    break
#define ISOGI_VOL__WIDEN(NAME, ATTRIBUTES, L)                                                                                    \
    ATTRIBUTES static void isogi_vol__widen_##NAME(const isogi_volume *v, const char *p, float *out) {                           \
        const float *end = out + 64;                                                                                             \
        int y;                                                                                                                   \
        switch (v->type) {                                                                                                       \
        case ISOGI_U8: ISOGI_VOL__WIDEN_ROWS(L, ISOGI_VOL__U8_##NAME);                                                           \
        case ISOGI_I8: ISOGI_VOL__WIDEN_ROWS(L, ISOGI_VOL__I8_##NAME);                                                           \
        case ISOGI_U16: ISOGI_VOL__WIDEN_ROWS(L, ISOGI_VOL__U16_##NAME);                                                         \
        case ISOGI_I16: ISOGI_VOL__WIDEN_ROWS(L, ISOGI_VOL__I16_##NAME);                                                         \
        case ISOGI_F32: ISOGI_VOL__WIDEN_ROWS(L, ISOGI_VOL__F32_##NAME);                                                         \
        case ISOGI_F64: break;                                                                                                   \
        }                                                                                                                        \
    }

#ifdef ISOGI_VOL__SSE2
#define ISOGI_VOL__MADD_base(a, b, c) _mm_add_ps(_mm_mul_ps(a, b), c)
#define ISOGI_VOL__INTEGERS_base(p) _mm_cvtepi32_ps(_mm_loadu_si128((const __m128i *)(const void *)(p)))
#define ISOGI_VOL__SPREAD_base(p) _mm_set1_ps(*(p))
#define ISOGI_VOL__TILE_base(p) _mm_loadu_ps(p)
/* sums of a and b in turn, of c and d, then of all; S: vectors */
#define ISOGI_VOL__HALVES(L, a, b) L##add_ps(L##unpacklo_ps(a, b), L##unpackhi_ps(a, b))
#define ISOGI_VOL__WHOLES(L, s, t) L##add_ps(L##shuffle_ps(s, t, 0x44), L##shuffle_ps(s, t, 0xee))
#define ISOGI_VOL__SUMS_base(a, b, c, d) ISOGI_VOL__WHOLES(_mm_, ISOGI_VOL__HALVES(_mm_, a, b), ISOGI_VOL__HALVES(_mm_, c, d))
ISOGI_VOL__INLINE __m128i isogi_vol__four_bytes(const char *p) {
    int32_t x;
    memcpy(&x, p, 4);
    return _mm_cvtsi32_si128(x);
}
#define ISOGI_VOL__EIGHT(p) _mm_loadl_epi64((const __m128i *)(const void *)(p))
/* Numbers are moved to the upper end of 32 bits, then shifted back with or without their sign. */
#define ISOGI_VOL__BYTES(p) _mm_unpacklo_epi16(_mm_setzero_si128(), _mm_unpacklo_epi8(_mm_setzero_si128(), isogi_vol__four_bytes(p)))
#define ISOGI_VOL__SHORTS(p) _mm_unpacklo_epi16(_mm_setzero_si128(), ISOGI_VOL__EIGHT(p))
#define ISOGI_VOL__U8_base(p) _mm_cvtepi32_ps(_mm_srli_epi32(ISOGI_VOL__BYTES(p), 24))
#define ISOGI_VOL__I8_base(p) _mm_cvtepi32_ps(_mm_srai_epi32(ISOGI_VOL__BYTES(p), 24))
#define ISOGI_VOL__U16_base(p) _mm_cvtepi32_ps(_mm_srli_epi32(ISOGI_VOL__SHORTS(p), 16))
#define ISOGI_VOL__I16_base(p) _mm_cvtepi32_ps(_mm_srai_epi32(ISOGI_VOL__SHORTS(p), 16))
#define ISOGI_VOL__F32_base(p) _mm_loadu_ps((const float *)(const void *)(p))
#define ISOGI_VOL__ROW_base(r) ISOGI_VOL__F32_base(at0 + (r))
ISOGI_VOL__TRILINEAR(base, , __m128, _mm_)
ISOGI_VOL__TRILINEAR_BLOCK(base, , __m128, _mm_, 4)
ISOGI_VOL__WIDEN(base, , _mm_)
ISOGI_VOL__CUBIC(base, , __m128, _mm_, 4, f32, ISOGI_VOL__ROW_base)
#endif

#ifdef ISOGI_VOL__AVX
#define ISOGI_VOL__MADD_avx2 _mm256_fmadd_ps
#define ISOGI_VOL__INTEGERS_avx2(p) _mm256_cvtepi32_ps(_mm256_loadu_si256((const __m256i *)(const void *)(p)))
#define ISOGI_VOL__SPREAD_avx2(p) _mm256_set_m128(_mm_set1_ps((p)[1]), _mm_set1_ps((p)[0]))
#define ISOGI_VOL__TILE_avx2(p) _mm256_broadcast_ps((const __m128 *)(const void *)(p))
#define ISOGI_VOL__LANE_avx2(v, i) _mm256_permute_ps(v, 0x55 * (i))
#define ISOGI_VOL__SUMS_avx2(a, b, c, d) ISOGI_VOL__WHOLES(_mm256_, ISOGI_VOL__HALVES(_mm256_, a, b), ISOGI_VOL__HALVES(_mm256_, c, d))
#define ISOGI_VOL__ROW_avx2(r) _mm256_set_m128(ISOGI_VOL__F32_base(at1 + (r)), ISOGI_VOL__F32_base(at0 + (r)))
#define ISOGI_VOL__BYTES_avx2(r) _mm_unpacklo_epi32(isogi_vol__four_bytes(at0 + (r)), isogi_vol__four_bytes(at1 + (r)))
#define ISOGI_VOL__SHORTS_avx2(r) _mm_unpacklo_epi64(ISOGI_VOL__EIGHT(at0 + (r)), ISOGI_VOL__EIGHT(at1 + (r)))
#define ISOGI_VOL__FLIPPED_avx2(x) \
    _mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_xor_si256(x, _mm256_set1_epi32(taps->flip)), _mm256_set1_epi32(taps->flip)))
#define ISOGI_VOL__ROW_BYTES_avx2(r) ISOGI_VOL__FLIPPED_avx2(_mm256_cvtepu8_epi32(ISOGI_VOL__BYTES_avx2(r)))
#define ISOGI_VOL__ROW_SHORTS_avx2(r) ISOGI_VOL__FLIPPED_avx2(_mm256_cvtepu16_epi32(ISOGI_VOL__SHORTS_avx2(r)))
#define ISOGI_VOL__U8_avx2(p) _mm_cvtepi32_ps(_mm_cvtepu8_epi32(isogi_vol__four_bytes(p)))
#define ISOGI_VOL__I8_avx2(p) _mm_cvtepi32_ps(_mm_cvtepi8_epi32(isogi_vol__four_bytes(p)))
#define ISOGI_VOL__U16_avx2(p) _mm_cvtepi32_ps(_mm_cvtepu16_epi32(ISOGI_VOL__EIGHT(p)))
#define ISOGI_VOL__I16_avx2(p) _mm_cvtepi32_ps(_mm_cvtepi16_epi32(ISOGI_VOL__EIGHT(p)))
#define ISOGI_VOL__F32_avx2(p) ISOGI_VOL__F32_base(p)
ISOGI_VOL__TRILINEAR(avx2, ISOGI_VOL__AVX2, __m256, _mm256_)
ISOGI_VOL__TRILINEAR_BLOCK(avx2, ISOGI_VOL__AVX2, __m256, _mm256_, 8)
ISOGI_VOL__WIDEN(avx2, ISOGI_VOL__AVX2, _mm_)
ISOGI_VOL__CUBIC(avx2, ISOGI_VOL__AVX2, __m256, _mm256_, 8, f32, ISOGI_VOL__ROW_avx2)
ISOGI_VOL__CUBIC(avx2, ISOGI_VOL__AVX2, __m256, _mm256_, 8, bytes, ISOGI_VOL__ROW_BYTES_avx2)
ISOGI_VOL__CUBIC(avx2, ISOGI_VOL__AVX2, __m256, _mm256_, 8, shorts, ISOGI_VOL__ROW_SHORTS_avx2)

/* Corners of eight points in a row of voxels that follow each other, and their neighbours along x. Two neighbours are one load: gathers are
   slower on many processors. */
ISOGI_VOL__AVX2 ISOGI_VOL__INLINE void isogi_vol__float_pairs(const char *row, const ptrdiff_t *q, __m256 c[2]) {
    __m256 even, odd;
#define ISOGI_VOL__TWO(k) \
    _mm_loadh_pi(_mm_castsi128_ps(ISOGI_VOL__EIGHT(row + q[k])), (const __m64 *)(const void *)(row + q[k + 1]))
    even = _mm256_set_m128(ISOGI_VOL__TWO(4), ISOGI_VOL__TWO(0)), odd = _mm256_set_m128(ISOGI_VOL__TWO(6), ISOGI_VOL__TWO(2));
#undef ISOGI_VOL__TWO
    c[0] = _mm256_shuffle_ps(even, odd, 0x88), c[1] = _mm256_shuffle_ps(even, odd, 0xdd);
}

ISOGI_VOL__INLINE int32_t isogi_vol__two_bytes(const char *p) {
    uint16_t x;
    memcpy(&x, p, 2);
    return x;
}

ISOGI_VOL__AVX2 ISOGI_VOL__INLINE void isogi_vol__byte_pairs(const char *row, const ptrdiff_t *q, int is_signed, __m256 c[2]) {
    __m128i x = _mm_cvtsi32_si128(isogi_vol__two_bytes(row + q[0])), y = _mm_cvtsi32_si128(isogi_vol__two_bytes(row + q[4])), second;
    x = _mm_insert_epi16(x, isogi_vol__two_bytes(row + q[1]), 1), y = _mm_insert_epi16(y, isogi_vol__two_bytes(row + q[5]), 1);
    x = _mm_insert_epi16(x, isogi_vol__two_bytes(row + q[2]), 2), y = _mm_insert_epi16(y, isogi_vol__two_bytes(row + q[6]), 2);
    x = _mm_insert_epi16(x, isogi_vol__two_bytes(row + q[3]), 3), y = _mm_insert_epi16(y, isogi_vol__two_bytes(row + q[7]), 3);
    x = _mm_unpacklo_epi64(x, y);
    second = is_signed ? _mm_srai_epi16(x, 8) : _mm_srli_epi16(x, 8);
    x = _mm_slli_epi16(x, 8);
    x = is_signed ? _mm_srai_epi16(x, 8) : _mm_srli_epi16(x, 8);
    c[0] = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(x)), c[1] = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(second));
}

ISOGI_VOL__AVX2 ISOGI_VOL__INLINE void isogi_vol__short_pairs(const char *row, const ptrdiff_t *q, int is_signed, __m256 c[2]) {
    __m128i x = isogi_vol__four_bytes(row + q[0]), y = isogi_vol__four_bytes(row + q[4]);
    __m256i all, first;
#define ISOGI_VOL__INSERT(v, i, k) v = _mm_insert_epi32(v, _mm_cvtsi128_si32(isogi_vol__four_bytes(row + q[i])), k)
    ISOGI_VOL__INSERT(x, 1, 1), ISOGI_VOL__INSERT(x, 2, 2), ISOGI_VOL__INSERT(x, 3, 3);
    ISOGI_VOL__INSERT(y, 5, 1), ISOGI_VOL__INSERT(y, 6, 2), ISOGI_VOL__INSERT(y, 7, 3);
#undef ISOGI_VOL__INSERT
    all = _mm256_set_m128i(y, x), first = _mm256_slli_epi32(all, 16);
    c[0] = _mm256_cvtepi32_ps(is_signed ? _mm256_srai_epi32(first, 16) : _mm256_srli_epi32(first, 16));
    c[1] = _mm256_cvtepi32_ps(is_signed ? _mm256_srai_epi32(all, 16) : _mm256_srli_epi32(all, 16));
}

/* Asks for the voxels of eight points of the block that follows: the memory of a whole block is to come while another is computed, as
   processors do not look so far ahead themselves. Every second point serves its neighbour, unless points are further apart. Into the second
   level, since a block may lie in few sets of the first. */
ISOGI_VOL__AVX2 ISOGI_VOL__INLINE void isogi_vol__ask_for_eight(const char *const rows[4], const ptrdiff_t *q, int every) {
    int k;
#define ISOGI_VOL__ASK(k)                                                                                                        \
    _mm_prefetch(rows[0] + q[k], _MM_HINT_T1), _mm_prefetch(rows[1] + q[k], _MM_HINT_T1), _mm_prefetch(rows[2] + q[k], _MM_HINT_T1), \
        _mm_prefetch(rows[3] + q[k], _MM_HINT_T1)
    ISOGI_VOL__ASK(0), ISOGI_VOL__ASK(2), ISOGI_VOL__ASK(4), ISOGI_VOL__ASK(6);
    for (k = 1; k < 8 && every; k += 2) ISOGI_VOL__ASK(k);
#undef ISOGI_VOL__ASK
}

/* A whole block where voxels follow each other along x, which has more than one. */
ISOGI_VOL__AVX2 static void isogi_vol__trilinear_pairs(const isogi_volume *v, isogi_vol__block *b, int n, int gradients) {
    const ptrdiff_t dy = v->size[1] > 1 ? v->stride[1] : 0, dz = v->size[2] > 1 ? v->stride[2] : 0;
    const int every = b->next && isogi_vol__far_apart(b->next);
    const char *rows[4];
    __m256 c[8];
    int i;
    rows[0] = (const char *)v->data, rows[1] = rows[0] + dy, rows[2] = rows[0] + dz, rows[3] = rows[1] + dz;
#define ISOGI_VOL__EIGHTS(PAIRS)                                                        \
    for (i = 0; i < n; i += 8) {                                                        \
        const ptrdiff_t *q = b->offset + i;                                             \
        if (b->next) isogi_vol__ask_for_eight(rows, b->next->offset + i, every);        \
        PAIRS(rows[0], 0), PAIRS(rows[1], 2), PAIRS(rows[2], 4), PAIRS(rows[3], 6);     \
        isogi_vol__trilinear_avx2(b, i, c, gradients);                                  \
    }                                                                                   \
    break
#define ISOGI_VOL__U8_PAIRS(row, k) isogi_vol__byte_pairs(row, q, 0, c + k)
#define ISOGI_VOL__I8_PAIRS(row, k) isogi_vol__byte_pairs(row, q, 1, c + k)
#define ISOGI_VOL__U16_PAIRS(row, k) isogi_vol__short_pairs(row, q, 0, c + k)
#define ISOGI_VOL__I16_PAIRS(row, k) isogi_vol__short_pairs(row, q, 1, c + k)
#define ISOGI_VOL__F32_PAIRS(row, k) isogi_vol__float_pairs(row, q, c + k)
    switch (v->type) {
    case ISOGI_U8: ISOGI_VOL__EIGHTS(ISOGI_VOL__U8_PAIRS);
    case ISOGI_I8: ISOGI_VOL__EIGHTS(ISOGI_VOL__I8_PAIRS);
    case ISOGI_U16: ISOGI_VOL__EIGHTS(ISOGI_VOL__U16_PAIRS);
    case ISOGI_I16: ISOGI_VOL__EIGHTS(ISOGI_VOL__I16_PAIRS);
    case ISOGI_F32: ISOGI_VOL__EIGHTS(ISOGI_VOL__F32_PAIRS);
    case ISOGI_F64: break;
    }
#undef ISOGI_VOL__EIGHTS
#undef ISOGI_VOL__U8_PAIRS
#undef ISOGI_VOL__I8_PAIRS
#undef ISOGI_VOL__U16_PAIRS
#undef ISOGI_VOL__I16_PAIRS
#undef ISOGI_VOL__F32_PAIRS
}

/* ---- trilinear values of few points ----

   Where voxels follow each other along x, few points go one after the other, axes side by side. A lane does what the lanes of a block do,
   so that the size of a call changes no bit. */

#define ISOGI_VOL__FEW 4 /* up to here they are faster than a block */

/* Cell and place in it of a point; lanes x, y, z, 0: as isogi_vol__locate_floats does, then as isogi_vol__locate_avx2. */
ISOGI_VOL__AVX2 ISOGI_VOL__INLINE __m128 isogi_vol__locate_float(const isogi_pyramid *p, const float world[3], __m128i *found) {
    const isogi_vol__float_grid *g = &p->float_grid;
    const __m128 zero = _mm_setzero_ps(), one = _mm_set1_ps(1), w = _mm_setr_ps(world[0], world[1], world[2], 0);
    const __m128 high = _mm_loadu_ps(g->high), at_high = _mm_loadu_ps(g->at_high);
    const __m128i end = _mm_sub_epi32(_mm_loadu_si128((const __m128i *)(const void *)p->cells), _mm_set1_epi32(1));
    const __m128 guess = _mm_fmadd_ps(high, w, _mm_sub_ps(at_high, _mm_set1_ps(1.0f / 256)));
    __m128i cell = _mm_cvttps_epi32(_mm_min_ps(guess, _mm_cvtepi32_ps(end)));
    __m128 local, next;
    cell = _mm_max_epi32(cell, _mm_setzero_si128());
    local = _mm_add_ps(_mm_fmadd_ps(high, w, _mm_sub_ps(at_high, _mm_cvtepi32_ps(cell))),
                       _mm_fmadd_ps(_mm_loadu_ps(g->low), w, _mm_loadu_ps(g->at_low)));
    next = _mm_and_ps(_mm_castsi128_ps(_mm_cmpgt_epi32(end, cell)), _mm_cmpge_ps(local, one));
    *found = _mm_sub_epi32(cell, _mm_castps_si128(next));
    return _mm_min_ps(_mm_max_ps(_mm_sub_ps(local, _mm_and_ps(next, one)), zero), one);
}

ISOGI_VOL__AVX2 ISOGI_VOL__INLINE __m128 isogi_vol__locate_double(const isogi_pyramid *p, const isogi_vol__points *at, size_t i,
                                                                  __m128i *found) {
    __m256d g;
    __m128i cell;
    if (at->grid) g = _mm256_setr_pd(at->grid[i][0], at->grid[i][1], at->grid[i][2], 0);
    else {
        const float *w = at->world[i];
        const double *o = p->origin;
        g = _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[0]), _mm256_set1_pd((double)w[0] - o[0]));
        g = _mm256_fmadd_pd(_mm256_loadu_pd(p->grid_axis[1]), _mm256_set1_pd((double)w[1] - o[1]), g);
        g = _mm256_fmadd_pd(_mm256_loadu_pd(p->grid_axis[2]), _mm256_set1_pd((double)w[2] - o[2]), g);
    }
    g = _mm256_min_pd(_mm256_max_pd(g, _mm256_setzero_pd()), _mm256_loadu_pd(p->box)); /* NaN gives 0 */
    cell = _mm_sub_epi32(_mm_loadu_si128((const __m128i *)(const void *)p->cells), _mm_set1_epi32(1));
    *found = cell = _mm_max_epi32(_mm_min_epi32(_mm256_cvttpd_epi32(g), cell), _mm_setzero_si128()); /* in any case */
    return _mm256_cvtpd_ps(_mm256_sub_pd(g, _mm256_cvtepi32_pd(cell)));
}

/* Corners x + 2y + 4z of the cell whose first voxel is at p. */
ISOGI_VOL__AVX2 ISOGI_VOL__INLINE __m256 isogi_vol__corners_of(const isogi_volume *v, const char *p) {
    const char *p1 = v->size[1] > 1 ? p + v->stride[1] : p, *p2 = v->size[2] > 1 ? p + v->stride[2] : p, *p3 = p2 + (p1 - p);
    __m128i all;
    if (v->type == ISOGI_F32) {
        const __m128 low = _mm_loadh_pi(_mm_castsi128_ps(ISOGI_VOL__EIGHT(p)), (const __m64 *)(const void *)p1);
        return _mm256_set_m128(_mm_loadh_pi(_mm_castsi128_ps(ISOGI_VOL__EIGHT(p2)), (const __m64 *)(const void *)p3), low);
    }
    if (v->type == ISOGI_U16 || v->type == ISOGI_I16) {
        all = _mm_unpacklo_epi64(_mm_unpacklo_epi32(isogi_vol__four_bytes(p), isogi_vol__four_bytes(p1)),
                                 _mm_unpacklo_epi32(isogi_vol__four_bytes(p2), isogi_vol__four_bytes(p3)));
        return _mm256_cvtepi32_ps(v->type == ISOGI_U16 ? _mm256_cvtepu16_epi32(all) : _mm256_cvtepi16_epi32(all));
    }
    all = _mm_cvtsi32_si128(isogi_vol__two_bytes(p));
    all = _mm_insert_epi16(all, isogi_vol__two_bytes(p1), 1), all = _mm_insert_epi16(all, isogi_vol__two_bytes(p2), 2);
    all = _mm_insert_epi16(all, isogi_vol__two_bytes(p3), 3);
    return _mm256_cvtepi32_ps(v->type == ISOGI_U8 ? _mm256_cvtepu8_epi32(all) : _mm256_cvtepi8_epi32(all));
}

/* Lanes: gradient of raw voxels per grid unit, if asked for, and value. A lane blends twice; where it is the gradient's, differences of
   corners, where it is the value's, the four edges along x, blended already. */
ISOGI_VOL__AVX2 ISOGI_VOL__INLINE __m128 isogi_vol__blend_corners(__m256 c, __m128 at, int gradients) {
    const __m128 low = _mm256_castps256_ps128(c), high = _mm256_extractf128_ps(c, 1), one = _mm_set1_ps(1);
    const __m128 x = _mm_permute_ps(at, 0), rest = _mm_sub_ps(one, x);
    const __m128 edges = _mm_fmadd_ps(x, ISOGI_VOL__ODD(low, high), _mm_mul_ps(rest, ISOGI_VOL__EVEN(low, high)));
    const __m128 once = _mm_permute_ps(at, 0x41), twice = _mm_permute_ps(at, 0x9a), rest1 = _mm_sub_ps(one, once);
    const __m128 rest2 = _mm_sub_ps(one, twice), back = _mm_movehl_ps(edges, edges);
    __m128 near = _mm_permute_ps(edges, 0), far = _mm_permute_ps(back, 0);
    __m256 from, to;
    if (!gradients) {
        near = _mm_fmadd_ps(once, _mm_permute_ps(edges, 0x55), _mm_mul_ps(rest1, near));
        far = _mm_fmadd_ps(once, _mm_permute_ps(back, 0x55), _mm_mul_ps(rest1, far));
        return _mm_fmadd_ps(twice, far, _mm_mul_ps(rest2, near));
    }
#define ISOGI_VOL__PICK(...) _mm256_permutevar8x32_ps(c, _mm256_setr_epi32(__VA_ARGS__))
    from = _mm256_sub_ps(ISOGI_VOL__PICK(1, 2, 4, 0, 5, 6, 6, 0), ISOGI_VOL__PICK(0, 0, 0, 0, 4, 4, 2, 0));
    to = _mm256_sub_ps(ISOGI_VOL__PICK(3, 3, 5, 0, 7, 7, 7, 0), ISOGI_VOL__PICK(2, 1, 1, 0, 6, 5, 3, 0));
#undef ISOGI_VOL__PICK
    from = _mm256_blend_ps(from, _mm256_set_m128(far, near), 0x88);
    to = _mm256_blend_ps(to, _mm256_permute_ps(_mm256_set_m128(back, edges), 0x55), 0x88);
    to = _mm256_fmadd_ps(_mm256_set_m128(once, once), to, _mm256_mul_ps(_mm256_set_m128(rest1, rest1), from));
    return _mm_fmadd_ps(twice, _mm256_extractf128_ps(to, 1), _mm_mul_ps(rest2, _mm256_castps256_ps128(to)));
}

ISOGI_VOL__AVX2 static void isogi_vol__trilinear_few(const isogi_pyramid *p, const isogi_vol__points *at, int n, int gradients,
                                                     float raw[ISOGI_VOL__FEW][4]) {
    const isogi_volume *v = &p->volume;
    int i;
    for (i = 0; i < n; i++) {
        __m128i cell;
        const __m128 local = at->world && p->float_grid.usable ? isogi_vol__locate_float(p, at->world[i], &cell)
                                                               : isogi_vol__locate_double(p, at, (size_t)i, &cell);
        const char *first = (const char *)v->data + _mm_cvtsi128_si32(cell) * v->stride[0] + _mm_extract_epi32(cell, 1) * v->stride[1] +
                            _mm_extract_epi32(cell, 2) * v->stride[2];
        _mm_storeu_ps(raw[i], isogi_vol__blend_corners(isogi_vol__corners_of(v, first), local, gradients));
    }
}

#define ISOGI_VOL__MADD_avx512 _mm512_fmadd_ps
#define ISOGI_VOL__SPREAD_avx512(p) \
    _mm512_permutexvar_ps(_mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3), _mm512_castps128_ps512(_mm_loadu_ps(p)))
#define ISOGI_VOL__TILE_avx512(p) _mm512_broadcast_f32x4(_mm_loadu_ps(p))
#define ISOGI_VOL__LANE_avx512(v, i) _mm512_permute_ps(v, 0x55 * (i))
#define ISOGI_VOL__SUMS_avx512(a, b, c, d) ISOGI_VOL__WHOLES(_mm512_, ISOGI_VOL__HALVES(_mm512_, a, b), ISOGI_VOL__HALVES(_mm512_, c, d))
ISOGI_VOL__INLINE int32_t isogi_vol__four_bytes_of(const char *p) {
    int32_t x;
    memcpy(&x, p, sizeof x);
    return x;
}

ISOGI_VOL__INLINE int64_t isogi_vol__eight_bytes_of(const char *p) {
    int64_t x;
    memcpy(&x, p, sizeof x);
    return x;
}

/* A row of each of four points; what is loaded fills a vector of which a quarter is kept. */
#define ISOGI_VOL__FOUR_ROWS(KEEP, first, m1, m2, m3, r) KEEP(KEEP(KEEP(first, m1, at1 + (r)), m2, at2 + (r)), m3, at3 + (r))
#define ISOGI_VOL__FLOATS(v, m, p) _mm512_mask_broadcast_f32x4(v, m, ISOGI_VOL__F32_base(p))
#define ISOGI_VOL__BYTES_KEPT(v, m, p) _mm_mask_mov_epi32(v, m, _mm_set1_epi32(isogi_vol__four_bytes_of(p)))
#define ISOGI_VOL__SHORTS_KEPT(v, m, p) _mm256_mask_mov_epi64(v, m, _mm256_set1_epi64x(isogi_vol__eight_bytes_of(p)))
#define ISOGI_VOL__ROW_avx512(r)                                                                                                 \
    ISOGI_VOL__FOUR_ROWS(ISOGI_VOL__FLOATS, _mm512_broadcast_f32x4(ISOGI_VOL__F32_base(at0 + (r))), 0x00f0, 0x0f00, 0xf000, r)
#define ISOGI_VOL__BYTES_avx512(r) ISOGI_VOL__FOUR_ROWS(ISOGI_VOL__BYTES_KEPT, isogi_vol__four_bytes(at0 + (r)), 2, 4, 8, r)
#define ISOGI_VOL__SHORTS_avx512(r)                                                                                              \
    ISOGI_VOL__FOUR_ROWS(ISOGI_VOL__SHORTS_KEPT, _mm256_castsi128_si256(ISOGI_VOL__EIGHT(at0 + (r))), 2, 4, 8, r)
#define ISOGI_VOL__FLIPPED_avx512(x) \
    _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_xor_si512(x, _mm512_set1_epi32(taps->flip)), _mm512_set1_epi32(taps->flip)))
#define ISOGI_VOL__ROW_BYTES_avx512(r) ISOGI_VOL__FLIPPED_avx512(_mm512_cvtepu8_epi32(ISOGI_VOL__BYTES_avx512(r)))
#define ISOGI_VOL__ROW_SHORTS_avx512(r) ISOGI_VOL__FLIPPED_avx512(_mm512_cvtepu16_epi32(ISOGI_VOL__SHORTS_avx512(r)))
ISOGI_VOL__CUBIC(avx512, ISOGI_VOL__AVX512, __m512, _mm512_, 16, f32, ISOGI_VOL__ROW_avx512)
ISOGI_VOL__CUBIC(avx512, ISOGI_VOL__AVX512, __m512, _mm512_, 16, bytes, ISOGI_VOL__ROW_BYTES_avx512)
ISOGI_VOL__CUBIC(avx512, ISOGI_VOL__AVX512, __m512, _mm512_, 16, shorts, ISOGI_VOL__ROW_SHORTS_avx512)

/* ---- trilinear values and gradients in sixteens ----

   For world points in floats, of volumes whose voxels follow each other along x: sixteen points are located, and their memory is asked
   for, while sixteen others, ISOGI_VOL__AHEAD sixteens in front of them, are computed, so that loads and arithmetic overlap. */

#define ISOGI_VOL__RING 8  /* a power of two */
#define ISOGI_VOL__AHEAD 4 /* less than that */

typedef struct __attribute__((aligned(64))) isogi_vol__sixteen {
    float local[3][16];
    uint64_t bytes[16]; /* all corners of a point, if they are bytes */
    int32_t voxel[16];  /* a cell's first */
    int apart;          /* most points are far from those next to them */
} isogi_vol__sixteen;

typedef struct isogi_vol__sampling {
    const char *rows[4]; /* of the volume's first cell */
    const float *points;
    float *values, *gradients; /* or NULL */
    size_t count;
    float high[3], low[3], at_high[3], at_low[3], at_guess[3], last[3]; /* as in isogi_vol__float_grid; first guess; the last cell */
    int32_t stride[3], reach;                                           /* in voxels; that of all axes together */
    float slope[3];                                                     /* gradients of raw voxels per grid unit times this are right */
    double scale, bias;
    int32_t flip; /* of integers */
    int identity; /* scale and bias change nothing */
} isogi_vol__sampling;

/* Points 16 i .. 16 i + 15, as isogi_vol__locate_floats does; zeros after the last. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__locate16(const isogi_vol__sampling *s, size_t i, isogi_vol__sixteen *out) {
    const size_t n = s->count - 16 * i;
    const float *points = s->points + 48 * i;
    const __m512 zero = _mm512_setzero_ps(), one = _mm512_set1_ps(1);
    __m512 k0, k1, k2;
    const __m512i first = _mm512_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 33, 36, 39, 42, 45);
    __m512i voxel = _mm512_setzero_si512(), step;
    if (n >= 16) k0 = _mm512_loadu_ps(points), k1 = _mm512_loadu_ps(points + 16), k2 = _mm512_loadu_ps(points + 32);
    else {
        const uint64_t some = ((uint64_t)1 << 3 * n) - 1;
        k0 = _mm512_maskz_loadu_ps((__mmask16)some, points), k1 = _mm512_maskz_loadu_ps((__mmask16)(some >> 16), points + 16);
        k2 = _mm512_maskz_loadu_ps((__mmask16)(some >> 32), points + 32);
    }
    /* coordinates r; those in k2 are the last ones */
#define ISOGI_VOL__AXIS(r, in2) \
    do { \
        const __m512i from = _mm512_add_epi32(first, _mm512_set1_epi32(r)); \
        const __m512 w = _mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(k0, from, k1), in2, from, k2); \
        const __m512 high = _mm512_set1_ps(s->high[r]), last = _mm512_set1_ps(s->last[r]); \
        const __m512 guess = _mm512_fmadd_ps(high, w, _mm512_set1_ps(s->at_guess[r])); \
        __m512 cell = _mm512_roundscale_ps(_mm512_min_ps(_mm512_max_ps(guess, zero), last), _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC); \
        __m512 local = _mm512_add_ps(_mm512_fmadd_ps(high, w, _mm512_sub_ps(_mm512_set1_ps(s->at_high[r]), cell)), \
                                     _mm512_fmadd_ps(_mm512_set1_ps(s->low[r]), w, _mm512_set1_ps(s->at_low[r]))); \
        const __mmask16 next = _mm512_mask_cmp_ps_mask(_mm512_cmp_ps_mask(cell, last, _CMP_LT_OQ), local, one, _CMP_GE_OQ); \
        cell = _mm512_mask_add_ps(cell, next, cell, one), local = _mm512_mask_sub_ps(local, next, local, one); \
        _mm512_store_ps(out->local[r], _mm512_min_ps(_mm512_max_ps(local, zero), one)); /* of points outside; NaN gives 0 */ \
        voxel = _mm512_add_epi32(voxel, _mm512_mullo_epi32(_mm512_cvtps_epi32(cell), _mm512_set1_epi32(s->stride[r]))); \
    } while (0)
    ISOGI_VOL__AXIS(0, 0xf800);
    ISOGI_VOL__AXIS(1, 0xf800);
    ISOGI_VOL__AXIS(2, 0xfc00);
#undef ISOGI_VOL__AXIS
    _mm512_store_si512(out->voxel, voxel);
    step = _mm512_abs_epi32(_mm512_sub_epi32(voxel, _mm512_alignr_epi32(voxel, voxel, 1)));
    out->apart = __builtin_popcount(_mm512_cmpgt_epi32_mask(step, _mm512_set1_epi32(s->reach))) > 8;
}

/* Asks for the voxels of located points, as isogi_vol__ask_for_eight does. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__ask_for_sixteen(const char *const rows[4], ptrdiff_t size,
                                                                    const isogi_vol__sixteen *at) {
    ptrdiff_t q;
    int k;
#define ISOGI_VOL__ASK(k) \
    q = size * at->voxel[k], _mm_prefetch(rows[0] + q, _MM_HINT_T1), _mm_prefetch(rows[1] + q, _MM_HINT_T1), \
    _mm_prefetch(rows[2] + q, _MM_HINT_T1), _mm_prefetch(rows[3] + q, _MM_HINT_T1)
    ISOGI_VOL__ASK(0), ISOGI_VOL__ASK(2), ISOGI_VOL__ASK(4), ISOGI_VOL__ASK(6);
    ISOGI_VOL__ASK(8), ISOGI_VOL__ASK(10), ISOGI_VOL__ASK(12), ISOGI_VOL__ASK(14);
    for (k = 1; k < 16 && at->apart; k += 2) ISOGI_VOL__ASK(k);
#undef ISOGI_VOL__ASK
}

/* Corners of sixteen points. Two neighbours along x are one load, which fills a vector of which one lane is kept: there are more loads to
   be had than shuffles. Four points i, j, k, l of a kind of voxels make vectors v0 .. v3, one for each row. */
#define ISOGI_VOL__LOAD_FLOATS(p) _mm256_set1_epi64x(isogi_vol__eight_bytes_of(p))
#define ISOGI_VOL__LOAD_SHORTS(p) _mm_set1_epi32(isogi_vol__four_bytes_of(p))
#define ISOGI_VOL__KEEP_FLOATS _mm256_mask_mov_epi64
#define ISOGI_VOL__KEEP_SHORTS _mm_mask_mov_epi32
#define ISOGI_VOL__ADD(KIND, v, m) \
    v##0 = ISOGI_VOL__KEEP_##KIND(v##0, m, ISOGI_VOL__LOAD_##KIND(rows[0] + q)), \
    v##1 = ISOGI_VOL__KEEP_##KIND(v##1, m, ISOGI_VOL__LOAD_##KIND(rows[1] + q)), \
    v##2 = ISOGI_VOL__KEEP_##KIND(v##2, m, ISOGI_VOL__LOAD_##KIND(rows[2] + q)), \
    v##3 = ISOGI_VOL__KEEP_##KIND(v##3, m, ISOGI_VOL__LOAD_##KIND(rows[3] + q))
#define ISOGI_VOL__LOAD_FOUR(KIND, v, size, i, j, k, l) \
    q = size * (ptrdiff_t)voxel[i], v##0 = ISOGI_VOL__LOAD_##KIND(rows[0] + q), v##1 = ISOGI_VOL__LOAD_##KIND(rows[1] + q); \
    v##2 = ISOGI_VOL__LOAD_##KIND(rows[2] + q), v##3 = ISOGI_VOL__LOAD_##KIND(rows[3] + q); \
    q = size * (ptrdiff_t)voxel[j], ISOGI_VOL__ADD(KIND, v, 2); \
    q = size * (ptrdiff_t)voxel[k], ISOGI_VOL__ADD(KIND, v, 4); \
    q = size * (ptrdiff_t)voxel[l], ISOGI_VOL__ADD(KIND, v, 8)

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__float_corners(const char *const rows[4], const int32_t voxel[16], __m512 out[8]) {
    __m256i a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, d0, d1, d2, d3;
    ptrdiff_t q;
    ISOGI_VOL__LOAD_FOUR(FLOATS, a, 4, 0, 1, 4, 5);
    ISOGI_VOL__LOAD_FOUR(FLOATS, b, 4, 2, 3, 6, 7);
    ISOGI_VOL__LOAD_FOUR(FLOATS, c, 4, 8, 9, 12, 13);
    ISOGI_VOL__LOAD_FOUR(FLOATS, d, 4, 10, 11, 14, 15);
#define ISOGI_VOL__PART(r) \
    do { \
        const __m512 even = _mm512_castsi512_ps(_mm512_inserti64x4(_mm512_castsi256_si512(a##r), c##r, 1)); \
        const __m512 odd = _mm512_castsi512_ps(_mm512_inserti64x4(_mm512_castsi256_si512(b##r), d##r, 1)); \
        out[2 * r] = _mm512_shuffle_ps(even, odd, 0x88), out[2 * r + 1] = _mm512_shuffle_ps(even, odd, 0xdd); \
    } while (0)
    ISOGI_VOL__PART(0);
    ISOGI_VOL__PART(1);
    ISOGI_VOL__PART(2);
    ISOGI_VOL__PART(3);
#undef ISOGI_VOL__PART
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__short_corners(const char *const rows[4], const int32_t voxel[16], int32_t flip,
                                                                  __m512 out[8]) {
    const __m512i sign = _mm512_set1_epi32(flip);
    __m128i a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, d0, d1, d2, d3;
    ptrdiff_t q;
    ISOGI_VOL__LOAD_FOUR(SHORTS, a, 2, 0, 1, 2, 3);
    ISOGI_VOL__LOAD_FOUR(SHORTS, b, 2, 4, 5, 6, 7);
    ISOGI_VOL__LOAD_FOUR(SHORTS, c, 2, 8, 9, 10, 11);
    ISOGI_VOL__LOAD_FOUR(SHORTS, d, 2, 12, 13, 14, 15);
#define ISOGI_VOL__PART(r) \
    do { \
        const __m512i all = _mm512_inserti64x4(_mm512_castsi256_si512(_mm256_set_m128i(b##r, a##r)), _mm256_set_m128i(d##r, c##r), 1); \
        const __m512i first = _mm512_and_si512(all, _mm512_set1_epi32(0xffff)), second = _mm512_srli_epi32(all, 16); \
        out[2 * r] = _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_xor_si512(first, sign), sign)); \
        out[2 * r + 1] = _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_xor_si512(second, sign), sign)); \
    } while (0)
    ISOGI_VOL__PART(0);
    ISOGI_VOL__PART(1);
    ISOGI_VOL__PART(2);
    ISOGI_VOL__PART(3);
#undef ISOGI_VOL__PART
}
#undef ISOGI_VOL__LOAD_FLOATS
#undef ISOGI_VOL__LOAD_SHORTS
#undef ISOGI_VOL__KEEP_FLOATS
#undef ISOGI_VOL__KEEP_SHORTS
#undef ISOGI_VOL__ADD
#undef ISOGI_VOL__LOAD_FOUR

/* Bytes are gathered a sixteen ahead of their use: a vector cannot be loaded from numbers that were stored just now. */
ISOGI_VOL__INLINE void isogi_vol__gather_bytes(const char *const rows[4], isogi_vol__sixteen *at) {
    int k;
    for (k = 0; k < 16; k++) {
        const ptrdiff_t q = at->voxel[k];
        uint16_t x[4];
        memcpy(&x[0], rows[0] + q, 2), memcpy(&x[1], rows[1] + q, 2), memcpy(&x[2], rows[2] + q, 2), memcpy(&x[3], rows[3] + q, 2);
        at->bytes[k] = (x[0] | (uint32_t)x[1] << 16) | (uint64_t)(x[2] | (uint32_t)x[3] << 16) << 32;
    }
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__byte_corners(const isogi_vol__sixteen *at, int32_t flip, __m512 out[8]) {
    const __m512i low = _mm512_load_si512(&at->bytes[0]), high = _mm512_load_si512(&at->bytes[8]), one = _mm512_set1_epi32(1 << 24);
    const __m512i sign = _mm512_set1_epi32(flip);
    __m512i from = _mm512_slli_epi32(_mm512_setr_epi32(0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96, 104, 112, 120), 24);
    int k;
    for (k = 0; k < 8; k++, from = _mm512_add_epi32(from, one)) { /* to the upper end of 32 bits */
        const __m512i x = _mm512_maskz_permutex2var_epi8(0x8888888888888888u, low, from, high);
        out[k] = _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_xor_si512(_mm512_srli_epi32(x, 24), sign), sign));
    }
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__store16(float *out, size_t n, __m512 v) {
    if (n >= 16) _mm512_storeu_ps(out, v);
    else _mm512_mask_storeu_ps(out, (__mmask16)((1u << n) - 1), v);
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__halves(__m512d low, __m512d high) {
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high), 1);
}

ISOGI_VOL__AVX512 static __m512 isogi_vol__scaled16(const isogi_vol__sampling *s, __m512 v) {
    const __m512d scale = _mm512_set1_pd(s->scale), bias = _mm512_set1_pd(s->bias);
    return isogi_vol__halves(_mm512_fmadd_pd(scale, _mm512_cvtps_pd(_mm512_castps512_ps256(v)), bias),
                             _mm512_fmadd_pd(scale, _mm512_cvtps_pd(_mm512_extractf32x8_ps(v, 1)), bias));
}

/* Coordinates x, y, z of the gradients of points 16 i and on, one after the other; in2: where z is. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__gradients16(const isogi_vol__sampling *s, size_t i, __m512 x, __m512 y, __m512 z) {
    float *out = s->gradients + 48 * i;
    const size_t n = 3 * (s->count - 16 * i);
    x = _mm512_mul_ps(x, _mm512_set1_ps(s->slope[0])), y = _mm512_mul_ps(y, _mm512_set1_ps(s->slope[1]));
    z = _mm512_mul_ps(z, _mm512_set1_ps(s->slope[2]));
#define ISOGI_VOL__THIRD(r, in2, ...) \
    do { \
        const __m512i from = _mm512_setr_epi32(__VA_ARGS__); \
        const __m512 all = _mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(x, from, y), in2, from, z); \
        if (n > 16 * r) isogi_vol__store16(out + 16 * r, n - 16 * r, all); \
    } while (0)
    ISOGI_VOL__THIRD(0, 0x4924, 0, 16, 0, 1, 17, 1, 2, 18, 2, 3, 19, 3, 4, 20, 4, 5);
    ISOGI_VOL__THIRD(1, 0x2492, 21, 5, 6, 22, 6, 7, 23, 7, 8, 24, 8, 9, 25, 9, 10, 26);
    ISOGI_VOL__THIRD(2, 0x9249, 10, 11, 27, 11, 12, 28, 12, 13, 29, 13, 14, 30, 14, 15, 31, 15);
#undef ISOGI_VOL__THIRD
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__trilinear16(const isogi_vol__sampling *s, ptrdiff_t size) {
    isogi_vol__sixteen ring[ISOGI_VOL__RING];
    const char *const rows[4] = {s->rows[0], s->rows[1], s->rows[2], s->rows[3]};
    const size_t sixteens = s->count / 16 + (s->count % 16 > 0);
    size_t next, i;
    for (next = 0; next < sixteens + ISOGI_VOL__AHEAD; next++) {
        const isogi_vol__sixteen *now;
        const __m512 one = _mm512_set1_ps(1);
        __m512 c[8], z0, z1, at0, at1, at2, rest0, rest1, rest2;
        if (next < sixteens) isogi_vol__locate16(s, next, &ring[next % ISOGI_VOL__RING]);
        if (next && next < sixteens) isogi_vol__ask_for_sixteen(rows, size, &ring[(next - 1) % ISOGI_VOL__RING]);
        i = next - ISOGI_VOL__AHEAD; /* wraps: the ring is a power of two */
        if (size == 1 && i + 1 < sixteens) isogi_vol__gather_bytes(rows, &ring[(i + 1) % ISOGI_VOL__RING]);
        if (next < ISOGI_VOL__AHEAD) continue;
        now = &ring[i % ISOGI_VOL__RING];
        if (size == 1) isogi_vol__byte_corners(now, s->flip, c);
        else if (size == 2) isogi_vol__short_corners(rows, now->voxel, s->flip, c);
        else isogi_vol__float_corners(rows, now->voxel, c);
        at0 = _mm512_load_ps(now->local[0]), at1 = _mm512_load_ps(now->local[1]), at2 = _mm512_load_ps(now->local[2]);
        rest0 = _mm512_sub_ps(one, at0), rest1 = _mm512_sub_ps(one, at1), rest2 = _mm512_sub_ps(one, at2);
#define ISOGI_VOL__MIX(axis, a, b) ISOGI_VOL__BLEND(avx512, _mm512_, a, b, axis)
#define ISOGI_VOL__RISE(a, b) _mm512_sub_ps(c[b], c[a])
        if (s->values) {
            z0 = ISOGI_VOL__MIX(1, ISOGI_VOL__MIX(0, c[0], c[1]), ISOGI_VOL__MIX(0, c[2], c[3]));
            z1 = ISOGI_VOL__MIX(1, ISOGI_VOL__MIX(0, c[4], c[5]), ISOGI_VOL__MIX(0, c[6], c[7]));
            z0 = ISOGI_VOL__MIX(2, z0, z1);
            isogi_vol__store16(s->values + 16 * i, s->count - 16 * i, s->identity ? z0 : isogi_vol__scaled16(s, z0));
        }
        if (s->gradients) {
            const __m512 x0 = ISOGI_VOL__MIX(1, ISOGI_VOL__RISE(0, 1), ISOGI_VOL__RISE(2, 3));
            const __m512 x1 = ISOGI_VOL__MIX(1, ISOGI_VOL__RISE(4, 5), ISOGI_VOL__RISE(6, 7));
            const __m512 y0 = ISOGI_VOL__MIX(0, ISOGI_VOL__RISE(0, 2), ISOGI_VOL__RISE(1, 3));
            const __m512 y1 = ISOGI_VOL__MIX(0, ISOGI_VOL__RISE(4, 6), ISOGI_VOL__RISE(5, 7));
            z0 = ISOGI_VOL__MIX(0, ISOGI_VOL__RISE(0, 4), ISOGI_VOL__RISE(1, 5));
            z1 = ISOGI_VOL__MIX(0, ISOGI_VOL__RISE(2, 6), ISOGI_VOL__RISE(3, 7));
            isogi_vol__gradients16(s, i, ISOGI_VOL__MIX(2, x0, x1), ISOGI_VOL__MIX(2, y0, y1), ISOGI_VOL__MIX(1, z0, z1));
        }
#undef ISOGI_VOL__MIX
#undef ISOGI_VOL__RISE
    }
}

/* A whole call, if it is of the kind that this serves. */
ISOGI_VOL__AVX512 static int isogi_vol__sample16(const isogi_pyramid *p, const float (*world)[3], size_t count, float *values,
                                                 float (*gradients)[3]) {
    const isogi_volume *v = &p->volume;
    const isogi_vol__float_grid *g = &p->float_grid;
    const ptrdiff_t dy = v->size[1] > 1 ? v->stride[1] : 0, dz = v->size[2] > 1 ? v->stride[2] : 0;
    isogi_vol__sampling s;
    int a;
    if (!g->usable || v->size[0] < 2 || v->stride[0] != (ptrdiff_t)isogi_vol__type_size(v->type)) return 0;
    s.rows[0] = (const char *)v->data, s.rows[1] = s.rows[0] + dy, s.rows[2] = s.rows[0] + dz, s.rows[3] = s.rows[1] + dz;
    s.points = (const float *)world, s.count = count, s.values = values, s.gradients = (float *)gradients, s.reach = 0;
    s.flip = isogi_vol__flip_of(v->type), s.scale = v->scale, s.bias = v->bias;
    s.identity = v->scale >= 1 && v->scale <= 1 && v->bias >= 0 && v->bias <= 0;
    for (a = 0; a < 3; a++) {
        const double slope = v->scale * p->to_grid[4 * a];
        if (gradients && !(fabs(slope) > 1e-30 && fabs(slope) < 1e30)) return 0;
        s.high[a] = g->high[a], s.low[a] = g->low[a], s.at_high[a] = g->at_high[a], s.at_low[a] = g->at_low[a];
        s.at_guess[a] = g->at_high[a] - 1.0f / 256, s.last[a] = (float)(p->cells[a] - 1), s.slope[a] = (float)slope;
        s.stride[a] = g->stride[a], s.reach += abs(g->stride[a]);
    }
    switch (v->type) {
    case ISOGI_U8:
    case ISOGI_I8: isogi_vol__trilinear16(&s, 1); break;
    case ISOGI_U16:
    case ISOGI_I16: isogi_vol__trilinear16(&s, 2); break;
    case ISOGI_F32: isogi_vol__trilinear16(&s, 4); break;
    case ISOGI_F64: return 0;
    }
    return 1;
}
#endif

#ifdef ISOGI_VOL__NEON
#define ISOGI_VOL__MADD_base(a, b, c) vfmaq_f32(c, a, b)
#define ISOGI_VOL__INTEGERS_base(p) vcvtq_f32_s32(vld1q_s32(p))
#define ISOGI_VOL__SPREAD_base(p) vdupq_n_f32(*(p))
#define ISOGI_VOL__TILE_base(p) vld1q_f32(p)
#define ISOGI_VOL__SUMS_base(a, b, c, d) vpaddq_f32(vpaddq_f32(a, b), vpaddq_f32(c, d))
ISOGI_VOL__INLINE uint8x8_t isogi_vol__four_bytes(const char *p) {
    uint32_t x;
    memcpy(&x, p, 4);
    return vcreate_u8(x);
}
ISOGI_VOL__INLINE uint16x4_t isogi_vol__four_shorts(const char *p) {
    uint64_t x;
    memcpy(&x, p, 8);
    return vcreate_u16(x);
}
#define ISOGI_VOL__U8_base(p) vcvtq_f32_u32(vmovl_u16(vget_low_u16(vmovl_u8(isogi_vol__four_bytes(p)))))
#define ISOGI_VOL__I8_base(p) vcvtq_f32_s32(vmovl_s16(vget_low_s16(vmovl_s8(vreinterpret_s8_u8(isogi_vol__four_bytes(p))))))
#define ISOGI_VOL__U16_base(p) vcvtq_f32_u32(vmovl_u16(isogi_vol__four_shorts(p)))
#define ISOGI_VOL__I16_base(p) vcvtq_f32_s32(vmovl_s16(vreinterpret_s16_u16(isogi_vol__four_shorts(p))))
#define ISOGI_VOL__F32_base(p) vld1q_f32((const float *)(const void *)(p))
#define ISOGI_VOL__ROW_base(r) ISOGI_VOL__F32_base(at0 + (r))
ISOGI_VOL__TRILINEAR(base, , float32x4_t, isogi_vol__neon_)
ISOGI_VOL__TRILINEAR_BLOCK(base, , float32x4_t, isogi_vol__neon_, 4)
ISOGI_VOL__WIDEN(base, , isogi_vol__neon_)
ISOGI_VOL__CUBIC(base, , float32x4_t, isogi_vol__neon_, 4, f32, ISOGI_VOL__ROW_base)
#endif

#if defined(ISOGI_VOL__AVX) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif

/* Cells [low, high) of every axis have all 64 voxels of a cubic filter around them. */
static void isogi_vol__inner_cells(const isogi_pyramid *p, int32_t low[3], int32_t high[3]) {
    int a;
    for (a = 0; a < 3; a++) low[a] = p->volume.halo_low[a] ? 0 : 1, high[a] = p->cells[a] - (p->volume.halo_high[a] ? 0 : 1);
}

/* Whether blocks serve this volume; the plain code does where not. */
static int isogi_vol__blockwise(const isogi_pyramid *p, isogi_filter filter) {
    const isogi_volume *v = &p->volume;
    int32_t low[3], high[3];
    if (p->path == ISOGI_VOL__PATH_PLAIN || v->type == ISOGI_F64 || p->field.value) return 0;
    /* linear continuation at a corner, and gradients, may take floats of this size beyond their range */
    if (v->type == ISOGI_F32 && !(isogi_vol__largest(p->range[0], p->range[1], v->bias) < 1e36 * fabs(v->scale))) return 0;
    if (filter == ISOGI_FILTER_LINEAR) return 1;
    isogi_vol__inner_cells(p, low, high);
    return (v->stride[0] == (ptrdiff_t)isogi_vol__type_size(v->type) && low[0] < high[0] && low[1] < high[1] && low[2] < high[2]);
}

/* type: of the taps. */
static void isogi_vol__cubic_points(const isogi_pyramid *p, isogi_type type, const isogi_vol__taps_at *taps, isogi_vol__block *b, int from,
                                    int n) {
#ifdef ISOGI_VOL__AVX
#define ISOGI_VOL__PATHS(KIND)                                                                                                   \
    if (p->path >= ISOGI_VOL__PATH_AVX512) isogi_vol__cubic_##KIND##_avx512(taps, b, from, n, b->sum);                           \
    else isogi_vol__cubic_##KIND##_avx2(taps, b, from, n, b->sum);                                                               \
    return
    if (p->path >= ISOGI_VOL__PATH_AVX2) {
        switch (type) {
        case ISOGI_U8:
        case ISOGI_I8: ISOGI_VOL__PATHS(bytes);
        case ISOGI_U16:
        case ISOGI_I16: ISOGI_VOL__PATHS(shorts);
        case ISOGI_F32: ISOGI_VOL__PATHS(f32);
        case ISOGI_F64: break;
        }
    }
#undef ISOGI_VOL__PATHS
#endif
    isogi_vol__cubic_f32_base(taps, b, from, n, b->sum);
    (void)p, (void)type;
}

/* The 64 taps of point i side by side. At the border they are those of the nearest inner cell, moved by one along each axis concerned;
   what is missing then continues linearly. Floats are less one of the voxels there, which is returned: rounding goes with their
   differences. */
static float isogi_vol__copy_taps(const isogi_pyramid *p, const isogi_vol__block *b, int i, const int32_t low[3], const int32_t high[3],
                                  float taps[64]) {
    const isogi_volume *v = &p->volume;
    ptrdiff_t offset = b->offset[i];
    float base = 0;
    int move[3], a, k;
    for (a = 0; a < 3; a++) {
        move[a] = (b->cell[a][i] >= high[a]) - (b->cell[a][i] < low[a]);
        offset -= move[a] * v->stride[a];
    }
#ifdef ISOGI_VOL__AVX
    if (p->path >= ISOGI_VOL__PATH_AVX2) isogi_vol__widen_avx2(v, isogi_vol__first_tap(v, offset), taps);
    else
#endif
        isogi_vol__widen_base(v, isogi_vol__first_tap(v, offset), taps);
    if (v->type == ISOGI_F32 && (move[0] || move[1] || move[2]))
        for (base = taps[21], k = 0; k < 64; k++) taps[k] -= base;
    for (a = 0; a < 3; a++) {
        const int step = move[a] * (1 << 2 * a); /* from tap to tap, away from the border for those that move down */
        for (k = 0; k < 16 && step; k++) {
            float *t = taps + (a == 0 ? 4 * k : a == 1 ? 16 * (k / 4) + k % 4 : k) + (step < 0 ? -3 * step : 0);
            t[0] = t[step], t[step] = t[2 * step], t[2 * step] = t[3 * step];
            t[3 * step] = t[2 * step] + (t[2 * step] - t[step]);
        }
    }
    return base;
}

/* Asks for the taps of points that follow points i .. i + 15 of n. Along a ray, neighbours of every second of the next sixteen need little
   else; points further apart need all of theirs, into the second level and a block ahead, as they are many. */
ISOGI_VOL__INLINE void isogi_vol__ask_for_taps(const isogi_volume *v, const isogi_vol__block *b, int i, int n, int apart) {
#ifdef ISOGI_VOL__SSE2
    const ptrdiff_t *q = !apart && i + 16 < n ? b->offset + i + 16 : b->next ? b->next->offset + (apart ? i : 0) : NULL;
    int k, z;
#define ISOGI_VOL__ASK(STEP, LEVEL)                                                                                              \
    for (k = 0; k < 16; k += STEP) {                                                                                             \
        const char *p = isogi_vol__first_tap(v, q[k]);                                                                           \
        for (z = 0; z < 4; z++, p += v->stride[2]) {                                                                             \
            _mm_prefetch(p, LEVEL), _mm_prefetch(p + v->stride[1], LEVEL);                                                       \
            _mm_prefetch(p + 2 * v->stride[1], LEVEL), _mm_prefetch(p + 3 * v->stride[1], LEVEL);                                \
        }                                                                                                                        \
    }
    if (!q) return;
    if (apart) ISOGI_VOL__ASK(1, _MM_HINT_T1)
    else ISOGI_VOL__ASK(2, _MM_HINT_T0)
#undef ISOGI_VOL__ASK
#else
    (void)v, (void)b, (void)i, (void)n, (void)apart;
#endif
}

/* Raw values and gradients of a block. Voxels are taken where they lie; points at the border, and integers in portable code, are copied
   first, as floats. */
static void isogi_vol__cubic_block(const isogi_pyramid *p, isogi_filter filter, isogi_vol__block *b, int n) {
    const isogi_volume *v = &p->volume;
    const double(*c)[4] = isogi_vol__taps[filter == ISOGI_FILTER_CATMULL_ROM];
    isogi_vol__taps_at taps;
    float room[17 * 64], *some = room + (64 - (uintptr_t)room % 64) % 64 / sizeof *room; /* aligned for what is stored into it */
    float base[16] = {0};
    ptrdiff_t offset[16];
    int32_t low[3], high[3];
    int i, k, a, apart = b->next && isogi_vol__far_apart(b->next);
    memset(&taps, 0, sizeof taps);
    for (i = 0; i < 16; i++) taps.powers[i / 4][i % 4] = (float)c[i / 4][i % 4], offset[i] = i * 64 * (ptrdiff_t)sizeof *some;
    taps.powers[4][0] = 1, taps.flip = isogi_vol__flip_of(v->type);
    isogi_vol__inner_cells(p, low, high);
    for (i = 0; i < n; i += 16) {
        const int end = i + 16 < n ? i + 16 : n, whole = (end + 3) & ~3;
        int32_t beyond = v->type == ISOGI_F32 || p->path >= ISOGI_VOL__PATH_AVX2 ? 0 : -1;
        for (k = end; k < i + 16; k++) { /* the last point again */
            for (a = 0; a < 3; a++) b->cell[a][k] = b->cell[a][end - 1];
            b->offset[k] = b->offset[end - 1];
        }
        for (k = 0; k < 16; k++) /* no difference is negative */
            beyond |= (b->cell[0][i + k] - low[0]) | (b->cell[1][i + k] - low[1]) | (b->cell[2][i + k] - low[2]) |
                      (high[0] - 1 - b->cell[0][i + k]) | (high[1] - 1 - b->cell[1][i + k]) | (high[2] - 1 - b->cell[2][i + k]);
        taps.first = isogi_vol__first_tap(v, 0), taps.offset = b->offset + i, taps.y = v->stride[1], taps.z = v->stride[2];
        if (beyond < 0) {
            for (k = i; k < whole; k++) base[k - i] = isogi_vol__copy_taps(p, b, k, low, high, some + 64 * (k - i));
            taps.first = (const char *)(const void *)some, taps.offset = offset, taps.y = 4 * sizeof(float), taps.z = 16 * sizeof(float);
        }
        isogi_vol__ask_for_taps(v, b, i, n, apart);
        isogi_vol__cubic_points(p, beyond < 0 ? ISOGI_F32 : v->type, &taps, b, i, end);
        for (k = i; k < end && beyond < 0 && v->type == ISOGI_F32; k++) b->sum[4 * k] += base[k - i];
    }
}

#ifdef ISOGI_VOL__AVX
/* Whether two voxels along x are one load. */
static int isogi_vol__in_pairs(const isogi_pyramid *p) {
    const isogi_volume *v = &p->volume;
    return p->path >= ISOGI_VOL__PATH_AVX2 && v->size[0] > 1 && v->stride[0] == (ptrdiff_t)isogi_vol__type_size(v->type);
}
#endif

static void isogi_vol__trilinear_block(const isogi_pyramid *p, isogi_vol__block *b, int n, int gradients) {
    const isogi_volume *v = &p->volume;
    n = isogi_vol__filled(n);
#ifdef ISOGI_VOL__AVX
    if (isogi_vol__in_pairs(p)) {
        isogi_vol__trilinear_pairs(v, b, n, gradients);
        return;
    }
    if (p->path >= ISOGI_VOL__PATH_AVX2) {
        isogi_vol__trilinear_block_avx2(v, b, n, gradients);
        return;
    }
#endif
    isogi_vol__trilinear_block_base(v, b, n, gradients);
}

static void isogi_vol__locate_block(const isogi_pyramid *p, const isogi_vol__points *at, size_t first, int n, isogi_vol__block *b) {
#ifdef ISOGI_VOL__AVX
    if (p->path >= ISOGI_VOL__PATH_AVX2 && at->world && p->float_grid.usable) {
        isogi_vol__locate_floats(p, at->world + first, n, b);
        return;
    }
    if (p->path >= ISOGI_VOL__PATH_AVX2) {
        isogi_vol__locate_avx2(p, at, first, n, b);
        return;
    }
#endif
    isogi_vol__locate(p, at, first, n, b);
}
#endif

/* A gradient of raw voxels per grid unit becomes one per world unit; m: the transposed inverse, scaled. */
ISOGI_VOL__INLINE void isogi_vol__gradient_out(const double m[9], float gx, float gy, float gz, float out[3]) {
    const double x = (double)gx, y = (double)gy, z = (double)gz;
    out[0] = (float)(m[0] * x + m[3] * y + m[6] * z);
    out[1] = (float)(m[1] * x + m[4] * y + m[7] * z);
    out[2] = (float)(m[2] * x + m[5] * y + m[8] * z);
}

#ifdef ISOGI_VOL__AVX
/* n points, at most ISOGI_VOL__FEW. No compiler fuses what comes last, as it might in code for AVX2. */
static void isogi_vol__sample_few(const isogi_pyramid *p, const isogi_vol__points *at, int n, float *values, float (*gradients)[3]) {
    const double scale = p->volume.scale, bias = p->volume.bias;
    const int identity = scale >= 1 && scale <= 1 && bias >= 0 && bias <= 0;
    float raw[ISOGI_VOL__FEW][4];
    double m[9];
    int i;
    isogi_vol__trilinear_few(p, at, n, gradients != NULL, raw);
    for (i = 0; i < n && values; i++) values[i] = identity ? raw[i][3] : (float)(scale * (double)raw[i][3] + bias);
    for (i = 0; i < 9 && gradients; i++) m[i] = scale * p->to_grid[i];
    for (i = 0; i < n && gradients; i++) isogi_vol__gradient_out(m, raw[i][0], raw[i][1], raw[i][2], gradients[i]);
}

/* Values and gradients from sums of raw voxels: {value, x, y, z} of n points. */
ISOGI_VOL__AVX2 static void isogi_vol__sums_out_avx2(const isogi_pyramid *p, const double m[9], const float *sum, int n, float *values,
                                                     float (*gradients)[3]) {
    const __m256d scale = _mm256_setr_pd(p->volume.scale, m[0], m[4], m[8]), bias = _mm256_setr_pd(p->volume.bias, 0, 0, 0);
    const __m256d x = _mm256_setr_pd(0, m[0], m[1], m[2]), y = _mm256_setr_pd(0, m[3], m[4], m[5]), z = _mm256_setr_pd(0, m[6], m[7], m[8]);
    const int straight = isogi_vol__all_zero(m + 1, 3) && isogi_vol__all_zero(m + 5, 3);
    int i;
    for (i = 0; i < n; i++) {
        const __m256d raw = _mm256_cvtps_pd(_mm_loadu_ps(sum + 4 * i));
        __m256d all = _mm256_fmadd_pd(raw, scale, bias);
        __m128 out;
        if (!straight)
            all = _mm256_blend_pd(
                _mm256_fmadd_pd(_mm256_permute4x64_pd(raw, 0xff), z,
                                _mm256_fmadd_pd(_mm256_permute4x64_pd(raw, 0xaa), y, _mm256_mul_pd(_mm256_permute4x64_pd(raw, 0x55), x))),
                all, 1);
        out = _mm256_cvtpd_ps(all);
        if (values) _mm_store_ss(values + i, out);
        if (!gradients) continue;
        out = _mm_shuffle_ps(out, out, 0xf9); /* {x, y, z, z}: the last one is overwritten by the next point */
        if (i + 1 < n) _mm_storeu_ps(gradients[i], out);
        else _mm_storel_pi((__m64 *)(void *)gradients[i], out), _mm_store_ss(&gradients[i][2], _mm_movehl_ps(out, out));
    }
}
#endif

/* The field's value at a place in grid coordinates, and its gradient per world unit. */
static double isogi_vol__field_at(const isogi_pyramid *p, const double grid[3], double gradient[3]) {
    double world[3];
    isogi_vol_to_world(p, grid, world);
    gradient[0] = gradient[1] = gradient[2] = 0;
    return p->field.value(p->field.user, world, gradient);
}

/* Value and gradient (per grid unit) of the trilinear filter, by corners relative to the first as in isogi_vol__cubic_sum. */
static double isogi_vol__linear_sum(const isogi_pyramid *p, const int cell[3], const double local[3], double gradient[3]) {
    const double scale = 4 * p->volume.scale;
    isogi_volume quarter = p->volume;
    double corner[8] = {0}, base, value;
    int i;
    quarter.scale = 0.25, quarter.bias = 0;
    isogi_vol__read_corners(&quarter, cell, corner);
    base = corner[0];
    for (i = 0; i < 8; i++) corner[i] -= base;
    value = isogi_vol__trilinear(corner, local, gradient);
    for (i = 0; i < 3; i++) gradient[i] *= scale;
    return scale * (base + value) + p->volume.bias;
}

/* One point by the plain code. */
static void isogi_vol__sample_one(const isogi_pyramid *p, isogi_filter filter, const double grid[3], float *value, float *gradient) {
    double local[3], slope[3], result;
    int cell[3], a;
    for (a = 0; a < 3; a++) cell[a] = isogi_vol__cell(grid[a], p->volume.size[a], &local[a]);
    if (p->field.value) {
        for (a = 0; a < 3; a++) local[a] += cell[a];
        result = isogi_vol__field_at(p, local, slope);
    } else if (filter != ISOGI_FILTER_LINEAR) result = isogi_vol__cubic_sum(p, filter, cell, local, slope);
    else result = isogi_vol__linear_sum(p, cell, local, slope);
    if (value) *value = (float)result;
    if (!gradient) return;
    if (!p->field.value) isogi_vol__gradient_to_world(p, slope, slope);
    for (a = 0; a < 3; a++) gradient[a] = (float)slope[a];
}

#if defined(ISOGI_VOL__SSE2) || defined(ISOGI_VOL__NEON)
/* The n points of a block that has been located. */
static void isogi_vol__sample_block(const isogi_pyramid *p, isogi_filter filter, isogi_vol__block *b, int n, float *values,
                                    float (*gradients)[3]) {
    const double scale = p->volume.scale, bias = p->volume.bias;
    double m[9];
    int i;
    if (filter == ISOGI_FILTER_LINEAR) isogi_vol__trilinear_block(p, b, n, gradients != NULL);
    else isogi_vol__cubic_block(p, filter, b, n);
    for (i = 0; i < 9; i++) m[i] = scale * p->to_grid[i];
    if (filter == ISOGI_FILTER_LINEAR) {
        if (values && scale >= 1 && scale <= 1 && bias >= 0 && bias <= 0) memcpy(values, b->value, (size_t)n * sizeof *values);
        else for (i = 0; i < n && values; i++) values[i] = (float)(scale * (double)b->value[i] + bias);
        for (i = 0; i < n && gradients; i++)
            isogi_vol__gradient_out(m, b->gradient[0][i], b->gradient[1][i], b->gradient[2][i], gradients[i]);
        return;
    }
#ifdef ISOGI_VOL__AVX
    if (p->path >= ISOGI_VOL__PATH_AVX2) isogi_vol__sums_out_avx2(p, m, b->sum, n, values, gradients);
    else
#endif
        for (i = 0; i < n; i++) {
            if (values) values[i] = (float)(scale * (double)b->sum[4 * i] + bias);
            if (gradients) isogi_vol__gradient_out(m, b->sum[4 * i + 1], b->sum[4 * i + 2], b->sum[4 * i + 3], gradients[i]);
        }
}

/* A block is located before the one in front of it is computed. */
static void isogi_vol__sample_blocks(const isogi_pyramid *p, isogi_filter filter, const isogi_vol__points *at, size_t count, float *values,
                                     float (*gradients)[3]) {
    isogi_vol__block blocks[2], *b = blocks, *next = blocks + 1, *swap;
    int n = count < ISOGI_VOL__BLOCK ? (int)count : ISOGI_VOL__BLOCK, m;
    size_t i;
    isogi_vol__locate_block(p, at, 0, n, b);
    for (i = 0; i < count; i += ISOGI_VOL__BLOCK) {
        const size_t rest = count - i - (size_t)n;
        m = rest < ISOGI_VOL__BLOCK ? (int)rest : ISOGI_VOL__BLOCK, b->next = m == ISOGI_VOL__BLOCK ? next : NULL;
        if (m) isogi_vol__locate_block(p, at, i + ISOGI_VOL__BLOCK, m, next);
        isogi_vol__sample_block(p, filter, b, n, values ? values + i : NULL, gradients ? gradients + i : NULL);
        swap = b, b = next, next = swap, n = m;
    }
}
#endif

static isogi_result isogi_vol__sample(const isogi_pyramid *p, isogi_filter filter, const float (*world)[3], const double (*grid)[3],
                                      size_t count, float *values, float (*gradients)[3]) {
    isogi_vol__points at;
    double point[3];
    size_t i;
    at.world = world, at.grid = grid;
    if (!p || (count && !world && !grid) || filter < ISOGI_FILTER_LINEAR || filter > ISOGI_FILTER_CATMULL_ROM) return ISOGI_INVALID;
#if defined(ISOGI_VOL__SSE2) || defined(ISOGI_VOL__NEON)
    if (isogi_vol__blockwise(p, filter)) {
#ifdef ISOGI_VOL__AVX
        if (filter == ISOGI_FILTER_LINEAR && world && p->path >= ISOGI_VOL__PATH_AVX512 &&
            isogi_vol__sample16(p, world, count, values, gradients))
            return ISOGI_OK;
        if (filter == ISOGI_FILTER_LINEAR && count <= ISOGI_VOL__FEW && isogi_vol__in_pairs(p)) {
            isogi_vol__sample_few(p, &at, (int)count, values, gradients);
            return ISOGI_OK;
        }
#endif
        isogi_vol__sample_blocks(p, filter, &at, count, values, gradients);
        return ISOGI_OK;
    }
#endif
    for (i = 0; i < count; i++) {
        isogi_vol__grid_point(p, &at, i, point);
        isogi_vol__sample_one(p, filter, point, values ? values + i : NULL, gradients ? gradients[i] : NULL);
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_vol_sample(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                        float (*gradients)[3]) {
    return isogi_vol__sample(pyramid, ISOGI_FILTER_LINEAR, points, NULL, count, values, gradients);
}

ISOGI_API isogi_result isogi_vol_sample_smooth(const isogi_pyramid *pyramid, const float (*points)[3], size_t count, float *values,
                                               float (*gradients)[3]) {
    return isogi_vol__sample(pyramid, ISOGI_FILTER_BSPLINE, points, NULL, count, values, gradients);
}

ISOGI_API isogi_result isogi_vol_sample_filtered(const isogi_pyramid *pyramid, isogi_filter filter, const float (*points)[3], size_t count,
                                                 float *values, float (*gradients)[3]) {
    return isogi_vol__sample(pyramid, filter, points, NULL, count, values, gradients);
}

ISOGI_API isogi_result isogi_vol_sample_grid(const isogi_pyramid *pyramid, isogi_filter filter, const double (*points)[3], size_t count,
                                             float *values, float (*gradients)[3]) {
    return isogi_vol__sample(pyramid, filter, NULL, points, count, values, gradients);
}

/* ---- coefficients of the interpolating B-spline ---- */

#define ISOGI_VOL__PIVOTS 32

typedef struct isogi_vol__prefilter_job {
    isogi_volume volume;
    float *out;
    double pivot[ISOGI_VOL__PIVOTS]; /* they converge to 2 - sqrt(3) */
} isogi_vol__prefilter_job;

/* Solves c[i-1] + 4 c[i] + c[i+1] = 6 f[i] between c = f at both ends, in place: n numbers `step` apart, for `count` lines side by side
   `beside` apart (Gauss without pivoting; the matrix is dominated by its diagonal). */
static void isogi_vol__solve_lines(const double pivot[ISOGI_VOL__PIVOTS], float *c, size_t n, size_t step, size_t count, size_t beside) {
    size_t i, k;
    for (i = 1; i + 1 < n; i++) {
        const float m = (float)pivot[i < ISOGI_VOL__PIVOTS ? i : ISOGI_VOL__PIVOTS - 1];
        for (k = 0; k < count; k++) c[i * step + k * beside] = (6 * c[i * step + k * beside] - c[(i - 1) * step + k * beside]) * m;
    }
    for (i = n; i-- > 1;) {
        const float m = (float)pivot[i < ISOGI_VOL__PIVOTS ? i : ISOGI_VOL__PIVOTS - 1];
        if (i + 1 < n)
            for (k = 0; k < count; k++) c[i * step + k * beside] -= m * c[(i + 1) * step + k * beside];
    }
}

/* One task: the lines along x and y of one z. */
static void isogi_vol__prefilter_slice(void *arg, size_t z) {
    const isogi_vol__prefilter_job *job = (const isogi_vol__prefilter_job *)arg;
    const isogi_volume *v = &job->volume;
    float *out = job->out + v->size[0] * v->size[1] * z;
    size_t x, y, k;
    for (y = 0; y < v->size[1]; y++)
        for (x = 0; x < v->size[0]; x += 64) {
            const size_t count = v->size[0] - x < 64 ? v->size[0] - x : 64;
            double row[64];
            isogi_vol__row(v, (int)x, (int)y, (int)z, (int)count, row);
            for (k = 0; k < count; k++)
                out[v->size[0] * y + x + k] = isogi_vol__finite64(row[k]) && fabs(row[k]) <= 1e36 ? (float)row[k] : 0;
        }
    isogi_vol__solve_lines(job->pivot, out, v->size[0], 1, v->size[1], v->size[0]);
    isogi_vol__solve_lines(job->pivot, out, v->size[1], v->size[0], v->size[0], 1);
}

/* One task: the lines along z of one y. */
static void isogi_vol__prefilter_wall(void *arg, size_t y) {
    const isogi_vol__prefilter_job *job = (const isogi_vol__prefilter_job *)arg;
    const size_t *size = job->volume.size;
    isogi_vol__solve_lines(job->pivot, job->out + size[0] * y, size[2], size[0] * size[1], size[0], 1);
}

ISOGI_API isogi_result isogi_vol_prefilter(const isogi_volume *volume, float *coefficients, const isogi_context *context) {
    const isogi_result valid = isogi_volume_validate(volume);
    isogi_vol__prefilter_job job;
    isogi_result result;
    int i;
    if (valid != ISOGI_OK) return valid;
    if (!coefficients) return ISOGI_INVALID;
    job.volume = isogi_vol__resolve(volume), job.out = coefficients;
    if (job.volume.size[0] > SIZE_MAX / 4 / job.volume.size[1] / job.volume.size[2]) return ISOGI_TOO_LARGE;
    for (i = 1, job.pivot[0] = 0; i < ISOGI_VOL__PIVOTS; i++) job.pivot[i] = 1 / (4 - job.pivot[i - 1]);
    result = isogi_parallel(context, job.volume.size[2], isogi_vol__prefilter_slice, &job, 0, 0.7);
    return result == ISOGI_OK ? isogi_parallel(context, job.volume.size[1], isogi_vol__prefilter_wall, &job, 0.7, 1) : result;
}

/* ==== cell cubic ===================================================================================================== */

/* Along a segment inside a cell the trilinear field is a cubic. It is kept as Bernstein coefficients, which are convex sums of the
   corners: the cubic lies in their hull, so equal signs mean no root, and rounding errors stay within a few ulp of the corners. */
typedef struct isogi_vol__cubic {
    double b[4], scale; /* what the coefficients were multiplied by */
} isogi_vol__cubic;

/* What code for AVX calls is inlined there: compiled for SSE it would cost hundreds of cycles at each change between the two, since
   compilers that see all of a function may call it without clearing the registers' upper halves. */

/* Only signs and ratios matter from here on: values whose squares leave the range of double are brought back into it. */
ISOGI_VOL__INLINE void isogi_vol__cubic_rescale(isogi_vol__cubic *cubic) {
    double most = 0;
    int i;
    for (i = 0; i < 4; i++) most = isogi_vol__max(most, fabs(cubic->b[i]));
    cubic->scale = 1;
    if (most > 1e-100 && most < 1e100) return;
    cubic->scale = most < 1 ? 1e200 : 1e-180;
    for (i = 0; i < 4; i++) cubic->b[i] *= cubic->scale;
}

/* Blossom of the trilinear form: b[1] and b[2] are means over the choices of which coordinate is taken at which end. */
#ifdef ISOGI_VOL__SSE2
ISOGI_VOL__INLINE __m128d isogi_vol__lerp2(__m128d a, __m128d b, double u) {
    return _mm_add_pd(_mm_mul_pd(_mm_set1_pd(1 - u), a), _mm_mul_pd(_mm_set1_pd(u), b));
}

/* Two at a time, operation by operation as the plain version below: the same bits. */
static void isogi_vol__cubic_set(isogi_vol__cubic *cubic, const double c[8], const double from[3], const double to[3]) {
    __m128d p = _mm_loadu_pd(c), q = _mm_loadu_pd(c + 2), r = _mm_loadu_pd(c + 4), s = _mm_loadu_pd(c + 6);
    __m128d even0 = _mm_unpacklo_pd(p, q), odd0 = _mm_unpackhi_pd(p, q), even1 = _mm_unpacklo_pd(r, s), odd1 = _mm_unpackhi_pd(r, s);
    /* x taken at its start (0) and end (1): {y0, y1} for z0, z1 */
    __m128d x00 = isogi_vol__lerp2(even0, odd0, from[0]), x01 = isogi_vol__lerp2(even1, odd1, from[0]);
    __m128d x10 = isogi_vol__lerp2(even0, odd0, to[0]), x11 = isogi_vol__lerp2(even1, odd1, to[0]);
    /* x and y taken: {z0, z1} */
    __m128d low0 = _mm_unpacklo_pd(x00, x01), high0 = _mm_unpackhi_pd(x00, x01);
    __m128d low1 = _mm_unpacklo_pd(x10, x11), high1 = _mm_unpackhi_pd(x10, x11);
    __m128d y00 = isogi_vol__lerp2(low0, high0, from[1]), y01 = isogi_vol__lerp2(low0, high0, to[1]);
    __m128d y10 = isogi_vol__lerp2(low1, high1, from[1]), y11 = isogi_vol__lerp2(low1, high1, to[1]);
    /* all taken: {x at start, x at end} */
    __m128d a0 = _mm_unpacklo_pd(y00, y10), a1 = _mm_unpackhi_pd(y00, y10), b0 = _mm_unpacklo_pd(y01, y11), b1 = _mm_unpackhi_pd(y01, y11);
    double f[8];
    _mm_storeu_pd(f + 0, isogi_vol__lerp2(a0, a1, from[2])); /* f[x + 2y + 4z] */
    _mm_storeu_pd(f + 2, isogi_vol__lerp2(b0, b1, from[2]));
    _mm_storeu_pd(f + 4, isogi_vol__lerp2(a0, a1, to[2]));
    _mm_storeu_pd(f + 6, isogi_vol__lerp2(b0, b1, to[2]));
    cubic->b[0] = f[0];
    cubic->b[1] = (f[1] + f[2] + f[4]) * (1.0 / 3);
    cubic->b[2] = (f[6] + f[5] + f[3]) * (1.0 / 3);
    cubic->b[3] = f[7];
    isogi_vol__cubic_rescale(cubic);
}
#else
static void isogi_vol__cubic_set(isogi_vol__cubic *cubic, const double c[8], const double from[3], const double to[3]) {
    double x[2][4], xy[2][2][2], f[2][2][2];
    const double *end[2];
    int i, j, k, e;
    end[0] = from, end[1] = to;
    for (i = 0; i < 2; i++) {
        double u = end[i][0];
        for (e = 0; e < 4; e++) x[i][e] = isogi_vol__lerp(c[2 * e], c[2 * e + 1], u);
    }
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++) {
            double u = end[j][1];
            xy[i][j][0] = isogi_vol__lerp(x[i][0], x[i][1], u);
            xy[i][j][1] = isogi_vol__lerp(x[i][2], x[i][3], u);
            for (k = 0; k < 2; k++) f[i][j][k] = isogi_vol__lerp(xy[i][j][0], xy[i][j][1], end[k][2]);
        }
    cubic->b[0] = f[0][0][0];
    cubic->b[1] = (f[1][0][0] + f[0][1][0] + f[0][0][1]) * (1.0 / 3);
    cubic->b[2] = (f[0][1][1] + f[1][0][1] + f[1][1][0]) * (1.0 / 3);
    cubic->b[3] = f[1][1][1];
    isogi_vol__cubic_rescale(cubic);
}
#endif

ISOGI_VOL__INLINE double isogi_vol__cubic_at(const isogi_vol__cubic *cubic, double s) {
    const double *b = cubic->b;
    double p = isogi_vol__lerp(b[0], b[1], s), q = isogi_vol__lerp(b[1], b[2], s), r = isogi_vol__lerp(b[2], b[3], s);
    return isogi_vol__lerp(isogi_vol__lerp(p, q, s), isogi_vol__lerp(q, r, s), s);
}

/* Real roots of a + b s + c s^2, ascending, by the formula that does not cancel; their number. A vanishing polynomial has none. */
ISOGI_VOL__INLINE int isogi_vol__quadratic_roots(double a, double b, double c, double root[2]) {
    double discriminant = b * b - 4 * a * c, q;
    int n = 0;
    if (!(discriminant >= 0)) return 0;
    q = -0.5 * (b < 0 ? b - sqrt(discriminant) : b + sqrt(discriminant));
    if (c > 0 || c < 0) root[n++] = q / c;
    if (q > 0 || q < 0) root[n++] = a / q;
    if (n == 2 && root[0] > root[1]) {
        double t = root[0];
        root[0] = root[1], root[1] = t;
    }
    return n;
}

/* The root in [low, high], the only one there, with different sides at its ends: Newton from the secant's root, kept inside a shrinking
   bracket; every third step bisects once Newton has had its chance. The first steps go without the bracket and end when the error
   left, at most |f''| step^2 / (2 |f'|) (Taylor), is below 1e-13; not where the cubic is 0 at an end, which is another root, nor where
   it turns back: there, an end nearly 0 is near another root, which lies behind it. */
ISOGI_VOL__INLINE double isogi_vol__cubic_refine(const isogi_vol__cubic *cubic, double low, double high, double at_low, double at_high,
                                                 int rising) {
    const double *b = cubic->b;
    const double c1 = 3 * (b[1] - b[0]), c2 = 3 * ((b[0] - b[1]) + (b[2] - b[1])), c3 = (b[3] - b[0]) + 3 * (b[1] - b[2]);
    const double bend = 1e13 * (fabs(c2) + 3 * fabs(c3));
    double s = low + (high - low) * (at_low / (at_low - at_high)), next = s, first = s;
    int i;
    for (i = 0; i < 4 && ((at_low < 0 && at_high > 0) || (at_low > 0 && at_high < 0)); i++) {
        double value = (b[0] + s * c1) + s * s * (c2 + s * c3), slope = (c1 + 2 * s * c2) + s * s * (3 * c3), step = value / slope;
        next = s - step;
        if ((slope > 0) != rising && !i) first = high;
        if (!(next >= low && next <= high) || (slope > 0) != rising) break;
        if (bend * step * step <= fabs(slope)) return next;
        s = next;
    }
    s = first > low && first < high ? first : 0.5 * (low + high);
    for (i = 0; i < 64; i++) {
        double value = b[0] + s * (c1 + s * (c2 + s * c3)), slope = c1 + s * (2 * c2 + s * 3 * c3);
        if ((value >= 0) == rising) high = s;
        else low = s;
        next = s - value / slope;
        if (!(next > low && next < high) || (i > 8 && i % 3 == 0)) next = 0.5 * (low + high); /* also catches slope 0 */
        if (fabs(next - s) < 1e-14) return next;
        s = next;
    }
    return s;
}

/* First place in [0, 1] where inside (value >= 0) differs from `inside` at 0; 0 if there is none. `exact` 0: any bound will do. */
ISOGI_VOL__INLINE int isogi_vol__cubic_first(const isogi_vol__cubic *cubic, int inside, int exact, double *root) {
    const double *b = cubic->b;
    double extremum[2], low = 0, high = 1, at_low = b[0], at_high = b[3];
    int layer = 1, n, i;
    if ((b[1] >= 0) == inside && (b[2] >= 0) == inside && (b[3] >= 0) == inside) return 0;
    if ((b[3] >= 0) != inside && ((b[1] >= 0) == inside || (b[2] >= 0) != inside)) {
        layer = !(b[1] > 0 || b[2] > 0); /* the control polygon changes sides once: so does the cubic */
    } else {
        n = isogi_vol__quadratic_roots(b[1] - b[0], 2 * ((b[0] - b[1]) + (b[2] - b[1])), (b[3] - b[0]) + 3 * (b[1] - b[2]), extremum);
        for (i = 0;; i++) { /* from extremum to extremum */
            if (i > n) return 0;
            high = i < n ? extremum[i] : 1;
            if (!(high > low)) continue;
            if (high > 1) high = 1;
            at_high = high < 1 ? isogi_vol__cubic_at(cubic, high) : b[3];
            if ((at_high >= 0) != inside) break;
            if (high >= 1) return 0;
            low = high, at_low = at_high;
        }
    }
    /* zero at an end is the root itself: a layer without thickness in a face is touched in one point, not passed in two */
    if (!exact || (layer && !(at_high > 0 || at_high < 0))) *root = high;
    else if (layer && !(at_low > 0 || at_low < 0)) *root = low;
    else *root = isogi_vol__cubic_refine(cubic, low, high, at_low, at_high, !inside);
    return 1;
}

/* The same for a segment that begins on the surface: b[0] is 0 up to rounding and is divided out. *inside: the side on which the
   segment leaves, -1 if the field vanishes all along it. */
static int isogi_vol__cubic_deflated(const isogi_vol__cubic *cubic, int *inside, double *root) {
    const double *b = cubic->b;
    double c1 = 3 * (b[1] - b[0]), c2 = 3 * ((b[0] - b[1]) + (b[2] - b[1])), c3 = (b[3] - b[0]) + 3 * (b[1] - b[2]), r[2] = {0, 0};
    double first = c1 > 0 || c1 < 0 ? c1 : c2 > 0 || c2 < 0 ? c2 : c3;
    int n, i;
    *inside = first > 0 ? 1 : first < 0 ? 0 : -1;
    if (*inside < 0) return 0;
    if (!(b[3] > 0 || b[3] < 0)) { /* 1 is a root of what is left, c1 + c2 s + c3 s^2; their product is c1 / c3 */
        const int between = c1 * c3 > 0 && fabs(c1) < fabs(c3);
        *root = between ? c1 / c3 : 1;
        return between || !*inside;
    }
    /* the Bernstein coefficients of what is left on one side: no root */
    if (*inside ? c1 > 0 && c1 + 0.5 * c2 > 0 && c1 + c2 + c3 > 0 : c1 < 0 && c1 + 0.5 * c2 < 0 && c1 + c2 + c3 < 0) return 0;
    n = isogi_vol__quadratic_roots(c1, c2, c3, r);
    for (i = 0; i < n; i++) {
        /* a double root touches and does not cross */
        if (r[i] > 0 && r[i] <= 1 && !(n == 2 && r[1] - r[0] <= 0)) {
            *root = r[i];
            return 1;
        }
    }
    return 0;
}

/* ==== traversal ====================================================================================================== */

/* A ray in grid coordinates, walked cell by cell and block by block. The walk carries whether the ray is inside: every block, cell
   face and cubic states it anew, and any change is a hit. So nothing slips between two cells, whatever rounding does: a ray that
   began inside cannot be outside later without having reported its way out. */
typedef struct isogi_vol__walk {
    const isogi_pyramid *pyramid;
    double origin[4], dir[4], inverse[4]; /* t counts from `origin`, which lies in the box; the fourth is 0 */
    double base, t, end;                  /* ray's t = base + t; the segment still to walk is [t, end] */
    double isovalue;
    int cell[3];
    int entry_axis; /* of the face through which the present cell was entered, -1 if none */
    int inside;     /* 1, 0, -1 = not known */
    int deflate;    /* the walk begins on the surface and has not left it so far */
    double deflated; /* up to where; a cell that begins later is not next to it */
    int exact;      /* 0: any_will_do */
    int end_is_border;
    int cap; /* what a hit in the present cell says of its side: 2 right behind the border of a capped volume, else 1 */
    isogi_counters count;
} isogi_vol__walk;

/* A hit at t, `local` in the present cell. */
static void isogi_vol__emit(const isogi_vol__walk *w, double t, const double local[3], int side, isogi_hit *hit) {
    int a;
    hit->t = w->base + t;
    for (a = 0; a < 3; a++) hit->local[a] = local[a], hit->cell[a] = (uint32_t)w->cell[a];
    hit->side = side;
}

/* Where the ray is at t in the present cell. What rounding has moved off a face is put back on it, so that a ray through a corner or an
   edge of the lattice meets the values there, whichever of the cells around it comes next. `base` tells how far the ray has come. */
static void isogi_vol__local(const isogi_vol__walk *w, double t, double local[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        const double slack = ISOGI_VOL__ROUNDING * (fabs(w->base * w->dir[a]) + w->pyramid->box[a]);
        const double at = isogi_vol__clamp(w->origin[a] + t * w->dir[a] - w->cell[a], 1);
        local[a] = at < slack ? 0 : at > 1 - slack ? 1 : at;
    }
}

/* Takes note of the side on which the field is where the present cell was entered; 1 if that is a change, which is a hit there. */
static int isogi_vol__state(isogi_vol__walk *w, int inside, isogi_hit *hit) {
    double local[3];
    int before = w->inside;
    w->inside = inside;
    if (before < 0 || inside < 0 || before == inside) return 0;
    isogi_vol__local(w, w->t, local);
    if (w->entry_axis >= 0) local[w->entry_axis] = w->dir[w->entry_axis] > 0 ? 0 : 1;
    isogi_vol__emit(w, w->t, local, inside ? w->cap : -1, hit);
    return 1;
}

/* Where the ray leaves the box of cells [low, high): t, and through which axis. */
static double isogi_vol__exit(const isogi_vol__walk *w, const int low[3], const int high[3], int *axis) {
    double t = ISOGI_VOL__UNLIMITED;
    int a;
    *axis = -1;
    for (a = 0; a < 3; a++) {
        double plane = w->dir[a] > 0 ? high[a] : low[a], at;
        if (!(w->dir[a] > 0 || w->dir[a] < 0)) continue;
        at = (plane - w->origin[a]) * w->inverse[a];
        if (at < t) t = at, *axis = a;
    }
    return t > w->t ? t : w->t;
}

/* Steps to the cell behind the box of cells that the ray leaves at t through `axis`. The cell on that axis is known exactly; on
   the others it follows from t, kept within the box and never turning back, so that every step makes progress. 0: out of the volume. */
static int isogi_vol__advance(isogi_vol__walk *w, const int low[3], const int high[3], double t, int axis) {
    int a;
    w->t = t;
    for (a = 0; a < 3; a++) {
        int c;
        if (a == axis) continue;
        c = (int)isogi_vol__clamp(w->origin[a] + t * w->dir[a], (double)w->pyramid->cells[a]);
        if (w->dir[a] > 0) w->cell[a] = c < w->cell[a] ? w->cell[a] : c >= high[a] ? high[a] - 1 : c;
        if (w->dir[a] < 0) w->cell[a] = c > w->cell[a] ? w->cell[a] : c < low[a] ? low[a] : c;
    }
    if (axis < 0) return 0;
    w->cell[axis] = w->dir[axis] > 0 ? high[axis] : low[axis] - 1;
    w->entry_axis = axis;
    return w->cell[axis] >= 0 && w->cell[axis] < w->pyramid->cells[axis];
}

/* The largest block around the present cell, no larger than level `top`, in which the surface cannot be: its bounds and the side
   that all of it is on (-1 = it has no finite value). 0 if there is none. */
static int isogi_vol__uniform_block(isogi_vol__walk *w, int top, int low[3], int high[3], int *inside) {
    int n, a;
    for (n = top; n >= 0; n--) {
        const isogi_level *level = &w->pyramid->level[n];
        int shift = 2 + 2 * n, b[3];
        const float *range;
        for (a = 0; a < 3; a++) b[a] = w->cell[a] >> shift;
        range = level->range[(size_t)b[0] + level->size[0] * ((size_t)b[1] + level->size[1] * (size_t)b[2])];
        w->count.blocks++;
        if ((double)range[0] < w->isovalue && (double)range[1] >= w->isovalue) continue;
        *inside = range[0] > range[1] ? -1 : (double)range[0] >= w->isovalue;
        for (a = 0; a < 3; a++) {
            low[a] = b[a] << shift;
            high[a] = w->pyramid->cells[a] - low[a] < level->cells ? w->pyramid->cells[a] : low[a] + level->cells;
        }
        return 1;
    }
    return 0;
}

/* A cell in which the ray leaves the surface that it starts from; 1 and the root if it comes back to it in the same cell. Still on
   the surface at the exit, because the start lies within rounding of it, or because the ray runs along the surface: the next cell
   divides the root out. A ray that goes on as it came knows its side: where the field has another one, the ray has crossed the surface
   again, too near to the start to be told from it; only a layer without thickness, where the field is 0, changes the side in silence.
   Behind the start's cell, where the field has left the surface by more than rounding, to the known side, nothing is divided out. */
static int isogi_vol__leave_surface(isogi_vol__walk *w, const isogi_vol__cubic *cubic, const double corner[8], const double from[3],
                                    const double to[3], int axis, double *root) {
    const double length = isogi_vol__largest(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    const double reach = isogi_vol__largest(cubic->b[1] - cubic->b[0], cubic->b[2] - cubic->b[0], cubic->b[3] - cubic->b[0]);
    const int before = w->inside;
    double steepest = 0;
    int i, found, layer, on_face = 0;
    for (i = 0; i < 8; i++) steepest = isogi_vol__max(steepest, fabs(corner[i]));
    if (before >= 0 && w->t > 0 && reach >= 1e-12 * steepest * cubic->scale &&
        (before ? cubic->b[0] : -cubic->b[0]) > 1e-14 * steepest * cubic->scale) {
        w->deflate = 0;
        return isogi_vol__cubic_first(cubic, before, w->exact, root);
    }
    if (axis >= 0 && (length < ISOGI_VOL__ON_SURFACE || reach < 1e-12 * steepest * cubic->scale)) return 0;
    if (reach < 1e-15 * steepest * cubic->scale) return 0; /* nothing but rounding, up to the end of the ray */
    w->deflate = 0;
    found = isogi_vol__cubic_deflated(cubic, &w->inside, root);
    for (i = 0; i < 3; i++) on_face |= !(from[i] > 0) || !(from[i] < 1);
    layer = before && !w->inside && on_face && !(w->t > 0) && !(cubic->b[0] > 0 || cubic->b[0] < 0);
    if (before < 0 || before == w->inside || layer) return found;
    w->inside = before;
    if ((cubic->b[0] >= 0) == before) return isogi_vol__cubic_first(cubic, before, w->exact, root);
    *root = 0;
    return 1;
}

static int isogi_vol__visit_field(isogi_vol__walk *w, double t_out, isogi_hit *hit); /* see "fields given by a function" */

/* The part [t, t_out] of the ray in the present cell, which it leaves through `axis` (-1: the segment ends in it). 1 = hit. */
static int isogi_vol__visit_cell(isogi_vol__walk *w, double t_out, int axis, isogi_hit *hit) {
    double corner[8], from[3], to[3], root = 0, local[3];
    isogi_vol__cubic cubic;
    int low_side = 0, i, found, inside;
    w->count.cells++;
    if (w->pyramid->field.value) return isogi_vol__visit_field(w, t_out, hit);
    if (!isogi_vol__corners(w->pyramid, w->cell, w->isovalue, corner)) {
        w->inside = -1, w->deflate = 0;
        return 0;
    }
    for (i = 0; i < 8; i++) low_side += corner[i] < 0;
    if (!low_side || low_side == 8) {
        w->deflate = 0;
        return isogi_vol__state(w, !low_side, hit);
    }
    isogi_vol__local(w, w->t, from);
    isogi_vol__local(w, t_out, to);
    if (w->entry_axis >= 0) from[w->entry_axis] = w->dir[w->entry_axis] > 0 ? 0 : 1;
    if (axis >= 0) to[axis] = w->dir[axis] > 0 ? 1 : 0;
    w->count.cubics++;
    isogi_vol__cubic_set(&cubic, corner, from, to);
    if (w->deflate) {
        found = isogi_vol__leave_surface(w, &cubic, corner, from, to, axis, &root), inside = w->inside;
    } else {
        inside = cubic.b[0] >= 0;
        if (isogi_vol__state(w, inside, hit)) return 1;
        found = isogi_vol__cubic_first(&cubic, inside, w->exact, &root);
    }
    if (!found) return 0;
    w->inside = !inside;
    for (i = 0; i < 3; i++) local[i] = isogi_vol__lerp(from[i], to[i], root);
    isogi_vol__emit(w, w->t + root * (t_out - w->t), local, inside ? -1 : 1, hit);
    return 1;
}

/* Whether the present cell has a cap, hence a field: blocks on one side may hide cells that are not finite. */
static int isogi_vol__has_cap(const isogi_vol__walk *w, const double local[3]) {
    double corner[8], grid[3], gradient[3];
    int a;
    if (!w->pyramid->field.value) return w->pyramid->all_finite || isogi_vol__corners(w->pyramid, w->cell, 0, corner);
    for (a = 0; a < 3; a++) grid[a] = w->cell[a] + local[a];
    return isogi_vol__finite64(isogi_vol__field_at(w->pyramid, grid, gradient));
}

/* The cell in which the ray ends: of those that touch the place, the one that it has come through. */
static void isogi_vol__last_cell(isogi_vol__walk *w, double local[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        const double slack = ISOGI_VOL__ROUNDING * (fabs(w->base * w->dir[a]) + w->pyramid->box[a]);
        w->cell[a] = isogi_vol__cell(w->origin[a] + w->end * w->dir[a], w->pyramid->volume.size[a], &local[a]);
        if (w->dir[a] > 0 && w->cell[a] > 0 && local[a] < slack) w->cell[a]--, local[a] = 1;
        if (w->dir[a] < 0 && w->cell[a] + 1 < w->pyramid->cells[a] && local[a] > 1 - slack) w->cell[a]++, local[a] = 0;
    }
}

/* Where the ray leaves a capped volume while inside. */
static int isogi_vol__cap_exit(isogi_vol__walk *w, isogi_hit *hit) {
    double local[3];
    isogi_vol__last_cell(w, local);
    if (!isogi_vol__has_cap(w, local)) return 0;
    isogi_vol__emit(w, w->end, local, -2, hit);
    return 1;
}

/* Walks to the first hit; 0 if there is none. */
static int isogi_vol__walk_on(isogi_vol__walk *w, uint32_t flags, isogi_hit *hit) {
    int top = ISOGI_VOL__LEVELS - 1, low[3], high[3], axis, inside, a;
    double local[3], corner[8];
    if (w->cap == 2) {
        isogi_vol__local(w, 0, local);
        if (!isogi_vol__has_cap(w, local)) w->inside = -1, w->cap = 1;
    }
    for (;;) {
        int before[3], changed = 0;
        double t;
        if (isogi_vol__uniform_block(w, top, low, high, &inside)) {
            /* Blocks share their faces' voxels, so neighbours that lie on different sides share a face without a finite value: no surface
               there, and the side is forgotten. Else only rounding, or a cap, makes another side of one that is known. */
            if (!w->pyramid->all_finite && inside >= 0 && w->inside == !inside && !isogi_vol_corners(w->pyramid, w->cell, corner))
                w->inside = -1;
            if (isogi_vol__state(w, inside, hit)) return 1;
            w->deflate = 0;
            t = isogi_vol__exit(w, low, high, &axis);
        } else {
            for (a = 0; a < 3; a++) low[a] = w->cell[a], high[a] = w->cell[a] + 1;
            t = isogi_vol__exit(w, low, high, &axis);
            if (isogi_vol__visit_cell(w, t < w->end ? t : w->end, t <= w->end ? axis : -1, hit)) return 1;
        }
        if (t >= w->end) break;
        w->cap = 1;
        for (a = 0; a < 3; a++) before[a] = w->cell[a];
        if (!isogi_vol__advance(w, low, high, t, axis)) break;
        /* blocks whose bounds were not crossed are known to hold the surface */
        for (a = 0; a < 3; a++) changed |= before[a] ^ w->cell[a];
        top = changed >= 64 ? 2 : changed >= 16 ? 1 : changed >= 4 ? 0 : -1;
    }
    return flags & ISOGI_RAY_CAPPED && w->end_is_border && w->inside == 1 && isogi_vol__cap_exit(w, hit);
}

/* ==== leaves ========================================================================================================= */

/* A leaf as one isovalue sees it. Numbers of voxels are x + step (c ... c + 1) with errors below 1/32 of a step, and so is the isovalue:
   codes >= inside are certainly inside, codes < outside certainly outside. */
typedef struct isogi_vol__leaf {
    const uint8_t *code; /* NULL where there are no leaves: nothing is known of cells but that the block holds the isovalue */
    float isovalue; /* in steps, for voxels of code + 0.5 */
    int inside, outside;
} isogi_vol__leaf;

ISOGI_VOL__INLINE void isogi_vol__open_leaf(isogi_vol__leaf *leaf, const uint8_t node[128], float level) {
    const float low = (float)node[ISOGI_VOL__LEAF_LOW], high = (float)node[ISOGI_VOL__LEAF_HIGH];
    float x = (level - low) * (ISOGI_VOL__CODES / (high + 1 - low));
    x = x > -2 ? x : -2, x = x < ISOGI_VOL__ABOVE ? x : ISOGI_VOL__ABOVE;
    leaf->code = node, leaf->isovalue = x - 0.5f;
    leaf->inside = (int)(x + 3.0625f) - 2, leaf->outside = (int)(x + 2.9375f) - 3;
    leaf->inside = leaf->inside > 0 ? leaf->inside < 255 ? leaf->inside : 255 : 0;
    leaf->outside = leaf->outside > 0 ? leaf->outside < 255 ? leaf->outside : 255 : 0;
}

/* Where all eight corners of a cell have their bits set, at bit x + 5y + 25z. */
ISOGI_VOL__INLINE void isogi_vol__all_corners(uint64_t *low, uint64_t *high) {
    uint64_t l = *low, h = *high;
    l &= l >> 1 | h << 63, h &= h >> 1;
    l &= l >> 5 | h << 59, h &= h >> 5;
    *low = l & (l >> 25 | h << 39), *high = h & h >> 25;
}

/* Bits at x + 5y + 25z to x + 4y + 16z. */
ISOGI_VOL__INLINE uint64_t isogi_vol__pack_cells(uint64_t low, uint64_t high) {
    const uint64_t slices = 0x0007ffff0007ffffu; /* of 4x4 bits each in 5x5, two at a time */
    uint64_t a = ((low & 0x1ffffff) | low >> 25 << 32) & slices, b = ((low >> 50 | (high << 14 & 0x1ffffff)) | high >> 11 << 32) & slices;
#define ISOGI_VOL__ROWS(v) (((v) & 0x0000000f0000000fu) | ((v) >> 1 & 0x000000f0000000f0u) | ((v) >> 2 & 0x00000f0000000f00u) | \
    ((v) >> 3 & 0x0000f0000000f000u))
    a = ISOGI_VOL__ROWS(a), b = ISOGI_VOL__ROWS(b);
    return (a & 0xffff) | a >> 16 | (b & 0xffff) << 32 | b >> 32 << 48;
}

/* Without the cells beyond the volume. */
ISOGI_VOL__INLINE uint64_t isogi_vol__cut_cells(int cut, uint64_t mask) {
    if (ISOGI_VOL__UNLIKELY(cut)) {
        mask &= 0x1111111111111111u * (15u >> (cut & 3));
        mask &= 0x0001000100010001u * (0xffffu >> 4 * (cut >> 2 & 3));
        mask &= ~(uint64_t)0 >> 16 * (cut >> 4);
    }
    return mask;
}

/* Where there are no leaves: any cell of the block can hold the surface. */
ISOGI_VOL__INLINE uint64_t isogi_vol__no_leaf(const isogi_pyramid *p, size_t x, size_t y, size_t z, isogi_vol__leaf *leaf) {
    size_t block[3];
    block[0] = x, block[1] = y, block[2] = z, leaf->code = NULL;
    return isogi_vol__cut_cells(isogi_vol__cut_of(p, block), ~(uint64_t)0);
}

/* Which of the 64 cells (x + 4y + 16z) can hold the surface, from the voxels that are certainly inside and outside. */
ISOGI_VOL__INLINE uint64_t isogi_vol__mixed_cells(const isogi_vol__leaf *leaf, uint64_t in_low, uint64_t in_high, uint64_t out_low,
                                                  uint64_t out_high) {
    isogi_vol__all_corners(&in_low, &in_high);
    isogi_vol__all_corners(&out_low, &out_high);
    return isogi_vol__cut_cells(leaf->code[ISOGI_VOL__LEAF_CUT], ~isogi_vol__pack_cells(in_low | out_low, in_high | out_high));
}

/* ==== AVX2 and AVX-512 =============================================================================================== */

/* Chosen when a pyramid is built. AVX2 does the plain code's operations in the plain code's order, four at a time and without fused
   multiply-adds, hence gives its bits. What AVX-512 adds stands in sections of its own. */
#ifdef ISOGI_VOL__AVX
static int isogi_vol__machine(void) {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return ISOGI_VOL__PATH_BASE;
#ifdef __OPTIMIZE__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bitalg") && __builtin_cpu_supports("avx512vbmi") &&
        __builtin_cpu_supports("avx512vbmi2") && __builtin_cpu_supports("avx512vpopcntdq") && __builtin_cpu_supports("gfni") &&
        __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))
        return ISOGI_VOL__PATH_AVX512; /* unoptimised, with each of its values in a place of its own, it takes up to 350 KB of stack */
#endif
    return ISOGI_VOL__PATH_AVX2;
}

/* What at_least_base does. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE uint64_t isogi_vol__at_least_avx2(const uint8_t *byte, int least) {
    const __m256i *v = (const __m256i *)(const void *)byte, l = _mm256_set1_epi8((char)least);
    const __m256i low = _mm256_loadu_si256(v), high = _mm256_loadu_si256(v + 1);
    return (uint64_t)(uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(_mm256_max_epu8(low, l), low)) |
           (uint64_t)(uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(_mm256_max_epu8(high, l), high)) << 32;
}

ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__lerp4(__m256d a, __m256d b, __m256d u, __m256d rest) {
    return _mm256_add_pd(_mm256_mul_pd(rest, a), _mm256_mul_pd(u, b));
}

/* Whether eight numbers are finite. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE int isogi_vol__finite8(__m256d a, __m256d b) {
    const __m256i infinite = _mm256_set1_epi64x(0x7ff0000000000000);
    const __m256i bad_a = _mm256_cmpeq_epi64(_mm256_and_si256(_mm256_castpd_si256(a), infinite), infinite);
    const __m256i bad_b = _mm256_cmpeq_epi64(_mm256_and_si256(_mm256_castpd_si256(b), infinite), infinite);
    return !_mm256_movemask_epi8(_mm256_or_si256(bad_a, bad_b));
}

/* All bits of one of four lanes set; -1: of none. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__lane(int i) {
    static const uint64_t lane[5][4] = {
        {0, 0, 0, 0}, {~(uint64_t)0, 0, 0, 0}, {0, ~(uint64_t)0, 0, 0}, {0, 0, ~(uint64_t)0, 0}, {0, 0, 0, ~(uint64_t)0}};
    return _mm256_castsi256_pd(_mm256_loadu_si256((const __m256i *)(const void *)lane[i + 1]));
}

/* The corners x + 2y of one z, raw. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__corners4(const isogi_volume *v, const char *p, ptrdiff_t dx, ptrdiff_t dy) {
    const char *q = p + dy;
#define ISOGI_VOL__RAW(T) \
    _mm256_set_pd((double)*(const T *)(const void *)(q + dx), (double)*(const T *)(const void *)q, \
        (double)*(const T *)(const void *)(p + dx), \
                  (double)*(const T *)(const void *)p)
    switch (v->type) {
    case ISOGI_U8: return ISOGI_VOL__RAW(uint8_t);
    case ISOGI_I8: return ISOGI_VOL__RAW(int8_t);
    case ISOGI_U16: return ISOGI_VOL__RAW(uint16_t);
    case ISOGI_I16: return ISOGI_VOL__RAW(int16_t);
    case ISOGI_F64: return ISOGI_VOL__RAW(double);
    case ISOGI_F32: break;
    }
    if (dx != 4) return ISOGI_VOL__RAW(float);
#undef ISOGI_VOL__RAW
    return _mm256_cvtps_pd(
        _mm_loadh_pi(_mm_castsi128_ps(_mm_loadl_epi64((const __m128i *)(const void *)p)), (const __m64 *)(const void *)q));
}

/* Places in the cell, on its faces where they are within rounding of them. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__snap4(__m256d at, __m256d slack) {
    const __m256d one = _mm256_set1_pd(1);
    at = _mm256_min_pd(_mm256_max_pd(at, _mm256_setzero_pd()), one);
    at = _mm256_andnot_pd(_mm256_cmp_pd(at, slack, _CMP_LT_OQ), at);
    return _mm256_blendv_pd(at, one, _mm256_cmp_pd(at, _mm256_sub_pd(one, slack), _CMP_GT_OQ));
}

/* Does what mixed_cell_base does. */
ISOGI_VOL__TARGET("avx2") static int isogi_vol__mixed_cell_avx2(isogi_vol__walk *w, int x, int y, int z, int in, int axis, isogi_hit *hit) {
    const isogi_volume *v = &w->pyramid->volume;
    const ptrdiff_t dx = v->stride[0], dy = v->stride[1], dz = v->stride[2];
    const char *p = (const char *)v->data + x * dx + y * dy + z * dz;
    const __m256d zero = _mm256_setzero_pd(), one = _mm256_set1_pd(1), isovalue = _mm256_set1_pd(w->isovalue);
    const __m256d scale = _mm256_set1_pd(v->scale), bias = _mm256_set1_pd(v->bias);
    const __m256d origin = _mm256_loadu_pd(w->origin), dir = _mm256_loadu_pd(w->dir), inverse = _mm256_loadu_pd(w->inverse);
    const __m256d in_lane = isogi_vol__lane(in), out_lane = isogi_vol__lane(axis < 0 ? 3 : axis);
    const __m256d cell = _mm256_cvtepi32_pd(_mm_setr_epi32(x, y, z, 0));
    const __m256d enter = _mm256_and_pd(_mm256_cmp_pd(dir, zero, _CMP_LT_OQ), one),
                  leave = _mm256_and_pd(_mm256_cmp_pd(dir, zero, _CMP_GT_OQ), one);
    const __m256d segment_end = _mm256_set1_pd(w->end),
                  way = _mm256_andnot_pd(_mm256_set1_pd(-0.0), _mm256_mul_pd(_mm256_set1_pd(w->base), dir));
    const __m256d slack = _mm256_mul_pd(_mm256_set1_pd(ISOGI_VOL__ROUNDING), _mm256_add_pd(way, _mm256_loadu_pd(w->pyramid->box)));
    __m256d c0 = isogi_vol__corners4(v, p, dx, dy), c1 = isogi_vol__corners4(v, p + dz, dx, dy), begin, end, from, to, rest0, rest1;
    __m256d even, odd, low, high, near_x, far_x, near_y, far_y, f0, f1, b;
    int sides, inside;
    double root;
    isogi_vol__cubic cubic;
    w->count.cells++;
    w->cell[0] = x, w->cell[1] = y, w->cell[2] = z, w->entry_axis = in;
    c0 = _mm256_sub_pd(_mm256_add_pd(_mm256_mul_pd(c0, scale), bias), isovalue);
    c1 = _mm256_sub_pd(_mm256_add_pd(_mm256_mul_pd(c1, scale), bias), isovalue);
    if (ISOGI_VOL__UNLIKELY(!w->pyramid->all_finite) && !isogi_vol__finite8(c0, c1)) {
        w->inside = -1, w->deflate = 0;
        return 0;
    }
    /* when the ray passes the faces; every lane gets the number of the one that counts */
    begin = _mm256_and_pd(_mm256_mul_pd(_mm256_sub_pd(_mm256_add_pd(cell, enter), origin), inverse), in_lane);
    end = _mm256_blend_pd(_mm256_mul_pd(_mm256_sub_pd(_mm256_add_pd(cell, leave), origin), inverse), segment_end, 8);
    end = _mm256_and_pd(end, out_lane);
    begin = _mm256_or_pd(begin, _mm256_permute2f128_pd(begin, begin, 1)), end = _mm256_or_pd(end, _mm256_permute2f128_pd(end, end, 1));
    begin = _mm256_or_pd(begin, _mm256_permute_pd(begin, 5)), end = _mm256_or_pd(end, _mm256_permute_pd(end, 5));
    begin = _mm256_max_pd(begin, zero), end = _mm256_max_pd(_mm256_min_pd(end, segment_end), begin);
    w->t = _mm256_cvtsd_f64(begin);
    sides = _mm256_movemask_pd(_mm256_cmp_pd(c0, zero, _CMP_GE_OQ)) | _mm256_movemask_pd(_mm256_cmp_pd(c1, zero, _CMP_GE_OQ)) << 4;
    w->deflate &= w->t <= w->deflated;
    w->deflated = _mm256_cvtsd_f64(end);
    if (sides == 0 || sides == 255) {
        w->deflate = 0;
        return isogi_vol__state(w, sides != 0, hit);
    }
    w->count.cubics++;
    from = _mm256_sub_pd(_mm256_add_pd(origin, _mm256_mul_pd(begin, dir)), cell);
    to = _mm256_sub_pd(_mm256_add_pd(origin, _mm256_mul_pd(end, dir)), cell);
    from = _mm256_blendv_pd(isogi_vol__snap4(from, slack), enter, in_lane);
    to = _mm256_blendv_pd(isogi_vol__snap4(to, slack), leave, out_lane);
    rest0 = _mm256_sub_pd(one, from), rest1 = _mm256_sub_pd(one, to);
    /* Blossom, as cubic_set has it. */
#define ISOGI_VOL__LANE(v, i) _mm256_permute4x64_pd(v, 0x55 * (i))
    even = _mm256_unpacklo_pd(c0, c1), odd = _mm256_unpackhi_pd(c0, c1); /* {y0 z0, y0 z1, y1 z0, y1 z1} */
    near_x = isogi_vol__lerp4(even, odd, ISOGI_VOL__LANE(from, 0), ISOGI_VOL__LANE(rest0, 0));
    far_x = isogi_vol__lerp4(even, odd, ISOGI_VOL__LANE(to, 0), ISOGI_VOL__LANE(rest1, 0));
    low = _mm256_permute2f128_pd(near_x, far_x, 0x20), high = _mm256_permute2f128_pd(near_x, far_x, 0x31);
    near_y = isogi_vol__lerp4(low, high, ISOGI_VOL__LANE(from, 1), ISOGI_VOL__LANE(rest0, 1));
    far_y = isogi_vol__lerp4(low, high, ISOGI_VOL__LANE(to, 1), ISOGI_VOL__LANE(rest1, 1));
    low = _mm256_unpacklo_pd(near_y, far_y), high = _mm256_unpackhi_pd(near_y, far_y);
    f0 = isogi_vol__lerp4(low, high, ISOGI_VOL__LANE(from, 2), ISOGI_VOL__LANE(rest0, 2)); /* what is taken at its end: {none, y, x, xy} */
    f1 = isogi_vol__lerp4(low, high, ISOGI_VOL__LANE(to, 2), ISOGI_VOL__LANE(rest1, 2));   /* {z, yz, xz, xyz} */
#undef ISOGI_VOL__LANE
    /* none, x, yz, xyz */
    b = _mm256_blend_pd(_mm256_permute4x64_pd(f0, 0x08), _mm256_permute4x64_pd(f1, 0xd0), 12);
    b = _mm256_add_pd(b, _mm256_blend_pd(_mm256_blend_pd(f0, f1, 4), zero, 9));                                            /* y, xz */
    /* z, xy */
    b = _mm256_add_pd(b, _mm256_blend_pd(_mm256_blend_pd(_mm256_permute4x64_pd(f1, 0), _mm256_permute4x64_pd(f0, 0xff), 4), zero, 9));
    b = _mm256_mul_pd(b, _mm256_setr_pd(1, 1.0 / 3, 1.0 / 3, 1));
    _mm256_storeu_pd(cubic.b, b);
    if (w->deflate) {
        double corner[8], ends[8];
        _mm256_storeu_pd(corner, c0), _mm256_storeu_pd(corner + 4, c1), _mm256_storeu_pd(ends, from), _mm256_storeu_pd(ends + 4, to);
        isogi_vol__cubic_rescale(&cubic);
        if (!isogi_vol__leave_surface(w, &cubic, corner, ends, ends + 4, axis, &root)) return 0;
        inside = w->inside;
    } else {
        sides = _mm256_movemask_pd(_mm256_cmp_pd(b, zero, _CMP_GE_OQ)), inside = sides & 1;
        if (ISOGI_VOL__UNLIKELY(w->inside == !inside)) return isogi_vol__state(w, inside, hit);
        w->inside = inside;
        if (sides == 0 || sides == 15) return 0;
        isogi_vol__cubic_rescale(&cubic);
        if (!isogi_vol__cubic_first(&cubic, inside, w->exact, &root)) return 0;
    }
    w->inside = !inside;
    begin = _mm256_add_pd(begin, _mm256_mul_pd(_mm256_set1_pd(root), _mm256_sub_pd(end, begin)));
    hit->t = w->base + _mm256_cvtsd_f64(begin);
    _mm256_storeu_pd(hit->local, isogi_vol__lerp4(from, to, _mm256_set1_pd(root), _mm256_set1_pd(1 - root))); /* and 8 bytes of cell */
    hit->cell[0] = (uint32_t)x, hit->cell[1] = (uint32_t)y, hit->cell[2] = (uint32_t)z;
    hit->side = inside ? -1 : 1;
    return 1;
}
#endif

/* ==== thresholds ===================================================================================================== */

/* The smallest raw value that is inside, for code that looks at raw voxels: inside is raw >= threshold. */
typedef struct isogi_vol__raw_isovalue {
    union { int i; float f; double d; } threshold;
} isogi_vol__raw_isovalue;

/* Raw integers are tried around the quotient, since scale * raw + bias rounds. 0: not known. */
static int isogi_vol__threshold(isogi_vol__raw_isovalue *k, const isogi_volume *v, double isovalue) {
    static const int least[4] = {0, -128, 0, -32768}, largest[4] = {255, 127, 65535, 32767};
    int plain = v->scale >= 1 && v->scale <= 1 && v->bias >= 0 && v->bias <= 0, i;
    double raw;
    if (v->type == ISOGI_F64) return k->threshold.d = isovalue, plain;
    if (v->type == ISOGI_F32) {
        k->threshold.f = isogi_vol__float_above(isovalue);
        return plain;
    }
    raw = plain ? isovalue : (isovalue - v->bias) / v->scale;
    if (!(raw > least[v->type] - 2.0)) raw = least[v->type] - 2.0;
    if (!(raw < largest[v->type] + 2.0)) raw = largest[v->type] + 2.0;
    i = (int)ceil(raw);
    for (; i > least[v->type] && v->scale * (i - 1) + v->bias >= isovalue; i--) {} /* many where bias leaves scale little room */
    for (; i <= largest[v->type] && v->scale * i + v->bias < isovalue; i++) {}
    k->threshold.i = i;
    return 1;
}

/* ==== where rays begin =============================================================================================== */

/* Direction components that cannot matter are set to zero, so that reciprocals stay finite. 0: no direction. */
static int isogi_vol__set_direction(isogi_vol__walk *w, const float dir[3]) {
    double world[3], most = 0;
    int a;
    for (a = 0; a < 3; a++) world[a] = (double)dir[a];
    isogi_vol__transform(w->pyramid->to_grid, world, w->dir);
    if (!isogi_vol__finite3(world) || !isogi_vol__finite3(w->dir)) return 0;
    for (a = 0; a < 3; a++) most = isogi_vol__max(most, fabs(w->dir[a]));
    if (!(most > 0)) return 0;
    for (a = 0; a < 3; a++) {
        if (fabs(w->dir[a]) <= 1e-30 * most) w->dir[a] = 0;
        w->inverse[a] = w->dir[a] > 0 || w->dir[a] < 0 ? 1 / w->dir[a] : 0;
        if (!w->pyramid->cells[a]) return 0;
    }
    w->dir[3] = w->inverse[3] = w->origin[3] = 0;
    return 1;
}

/* Clips [tmin, tmax] to the box and moves the origin to where the walk begins, so that a far origin costs no precision later. */
static int isogi_vol__clip(isogi_vol__walk *w, double tmin, double tmax) {
    double enter = tmin, leave = tmax;
    int a;
    for (a = 0; a < 3; a++) {
        double size = w->pyramid->cells[a], t0, t1;
        if (!(w->dir[a] > 0 || w->dir[a] < 0)) {
            if (!(w->origin[a] >= 0 && w->origin[a] <= size)) return 0;
            continue;
        }
        t0 = ((w->dir[a] > 0 ? 0 : size) - w->origin[a]) * w->inverse[a];
        t1 = ((w->dir[a] > 0 ? size : 0) - w->origin[a]) * w->inverse[a];
        if (t0 > enter) enter = t0, w->entry_axis = a;
        leave = isogi_vol__min(leave, t1);
    }
    if (!(enter <= leave)) return 0;
    for (a = 0; a < 3; a++) w->origin[a] = isogi_vol__clamp(w->origin[a] + enter * w->dir[a], (double)w->pyramid->cells[a]);
    /* on the face, whatever rounding says */
    if (w->entry_axis >= 0) w->origin[w->entry_axis] = w->dir[w->entry_axis] > 0 ? 0 : w->pyramid->cells[w->entry_axis];
    w->base = enter, w->t = 0, w->end = ISOGI_VOL__UNLIMITED;
    for (a = 0; a < 3; a++)
        if (w->dir[a] > 0 || w->dir[a] < 0)
            w->end = isogi_vol__min(w->end, ((w->dir[a] > 0 ? w->pyramid->cells[a] : 0) - w->origin[a]) * w->inverse[a]);
    w->end_is_border = tmax - enter > w->end; /* one that ends there does not come out */
    w->end = isogi_vol__min(w->end, tmax - enter);
    return 1;
}

#ifdef ISOGI_VOL__AVX
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE double isogi_vol__least4(__m256d v) {
    v = _mm256_min_pd(v, _mm256_permute2f128_pd(v, v, 1));
    return _mm256_cvtsd_f64(_mm256_min_pd(v, _mm256_permute_pd(v, 5)));
}

/* set_direction and clip, four at a time: the same operations in the same order. */
ISOGI_VOL__TARGET("avx2") static int isogi_vol__aim_avx2(isogi_vol__walk *w, const float dir[3], double tmin, double tmax) {
    const isogi_pyramid *p = w->pyramid;
    const __m256d zero = _mm256_setzero_pd(), unlimited = _mm256_set1_pd(ISOGI_VOL__UNLIMITED), minus = _mm256_set1_pd(-0.0);
    const __m256d box = _mm256_loadu_pd(p->box);
    const __m256i infinite = _mm256_set1_epi64x(0x7ff0000000000000);
    __m256d d, size, keep, inverse, rising, front, back, still, t0, t1, origin = _mm256_loadu_pd(w->origin);
    double enter, leave;
    d = _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[0]), _mm256_set1_pd((double)dir[0]));
    d = _mm256_add_pd(d, _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[1]), _mm256_set1_pd((double)dir[1])));
    d = _mm256_add_pd(d, _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[2]), _mm256_set1_pd((double)dir[2])));
    size = _mm256_andnot_pd(minus, d);
    if (_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(_mm256_castpd_si256(d), infinite), infinite)))) return 0;
    keep = _mm256_max_pd(size, _mm256_permute2f128_pd(size, size, 1));
    keep = _mm256_max_pd(keep, _mm256_permute_pd(keep, 5));
    if (!(_mm256_cvtsd_f64(keep) > 0)) return 0;
    keep = _mm256_cmp_pd(size, _mm256_mul_pd(_mm256_set1_pd(1e-30), keep), _CMP_GT_OQ);
    d = _mm256_and_pd(d, keep), inverse = _mm256_and_pd(_mm256_div_pd(_mm256_set1_pd(1), d), keep);
    rising = _mm256_cmp_pd(d, zero, _CMP_GT_OQ), still = _mm256_cmp_pd(d, zero, _CMP_EQ_OQ);
    front = _mm256_andnot_pd(rising, box), back = _mm256_and_pd(rising, box);
    t0 = _mm256_mul_pd(_mm256_sub_pd(front, origin), inverse), t1 = _mm256_mul_pd(_mm256_sub_pd(back, origin), inverse);
    keep = _mm256_and_pd(_mm256_cmp_pd(origin, zero, _CMP_GE_OQ), _mm256_cmp_pd(origin, box, _CMP_LE_OQ));
    if (_mm256_movemask_pd(_mm256_andnot_pd(keep, still))) return 0;
    t0 = _mm256_blendv_pd(t0, _mm256_xor_pd(unlimited, minus), still), t1 = _mm256_blendv_pd(t1, unlimited, still);
    enter = -isogi_vol__least4(_mm256_xor_pd(t0, minus)), leave = isogi_vol__min(tmax, isogi_vol__least4(t1));
    if (enter > tmin) w->entry_axis = __builtin_ctz((unsigned)_mm256_movemask_pd(_mm256_cmp_pd(t0, _mm256_set1_pd(enter), _CMP_EQ_OQ)));
    else enter = tmin;
    if (!(enter <= leave)) return 0;
    origin = _mm256_add_pd(origin, _mm256_mul_pd(_mm256_set1_pd(enter), d));
    origin = _mm256_min_pd(_mm256_max_pd(origin, zero), box);
    origin = _mm256_blendv_pd(origin, front, isogi_vol__lane(w->entry_axis));
    t1 = _mm256_blendv_pd(_mm256_mul_pd(_mm256_sub_pd(back, origin), inverse), unlimited, still);
    w->base = enter, w->t = 0, w->end = isogi_vol__least4(t1);
    w->end_is_border = tmax - enter > w->end; /* one that ends there does not come out */
    w->end = isogi_vol__min(w->end, tmax - enter);
    _mm256_storeu_pd(w->origin, origin), _mm256_storeu_pd(w->dir, d), _mm256_storeu_pd(w->inverse, inverse);
    return 1;
}
#endif

#ifdef ISOGI_VOL__AVX
/* A ray's origin in grid coordinates, stored as it will be loaded; 0: not finite. The sums are those of isogi_vol__transform. */
ISOGI_VOL__TARGET("avx2") static int isogi_vol__place_avx2(isogi_vol__walk *w, const double origin[3]) {
    const isogi_pyramid *p = w->pyramid;
    const __m256i infinite = _mm256_set1_epi64x(0x7ff0000000000000);
    __m256d at = _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[0]), _mm256_set1_pd(origin[0] - p->origin[0]));
    at = _mm256_add_pd(at, _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[1]), _mm256_set1_pd(origin[1] - p->origin[1])));
    at = _mm256_add_pd(at, _mm256_mul_pd(_mm256_loadu_pd(p->grid_axis[2]), _mm256_set1_pd(origin[2] - p->origin[2])));
    _mm256_storeu_pd(w->origin, at);
    return !_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(_mm256_castpd_si256(at), infinite), infinite)));
}
#endif

static int isogi_vol__aim(isogi_vol__walk *w, const float dir[3], double tmin, double tmax) {
#ifdef ISOGI_VOL__AVX
    if (w->pyramid->fast && w->pyramid->path >= ISOGI_VOL__PATH_AVX2) return isogi_vol__aim_avx2(w, dir, tmin, tmax);
#endif
    return isogi_vol__set_direction(w, dir) && isogi_vol__clip(w, tmin, tmax);
}

/* The cell in which the walk begins: of those that touch the origin, the one that the ray goes on in. */
static void isogi_vol__first_cell(isogi_vol__walk *w) {
    double local;
    int a;
    for (a = 0; a < 3; a++) {
        w->cell[a] = isogi_vol__cell(w->origin[a], w->pyramid->volume.size[a], &local);
        if (w->dir[a] < 0 && w->cell[a] > 0 && !(local > 0)) w->cell[a]--;
    }
}

static int isogi_vol__is_nan(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7fffffffffffffffu) > 0x7ff0000000000000u;
}

/* tmax as given, with 0 and anything beyond standing for unlimited. */
static double isogi_vol__tmax(double tmax) {
    return (tmax >= 0 && tmax <= 0) || tmax > ISOGI_VOL__UNLIMITED ? ISOGI_VOL__UNLIMITED : tmax;
}

/* What a call was given: rays, or starts on a surface. */
typedef struct isogi_vol__batch {
    const isogi_pyramid *pyramid;
    const isogi_ray *rays; /* NULL: the next five instead */
    const isogi_hit *starts;
    const float (*dirs)[3];
    const double *tmax; /* NULL = unlimited */
    double isovalue;
    uint32_t flags;
    const isogi_bundle *bundles; /* or bundles of `each` rays, of which the present one stands in what is above */
    size_t each, bundle_count, opened;
    isogi_ray bundle_ray;
    isogi_hit bundle_start;
    int bundle;        /* all rays are the first one, or leave from the first start, but for dirs[i] */
    size_t count;      /* of all rays */
    isogi_hit *hits;   /* either this */
    uint8_t *occluded; /* or this */
    isogi_counters work;
} isogi_vol__batch;

/* Member by member: of one memset compilers make an instruction that is slow to start. */
ISOGI_VOL__INLINE void isogi_vol__clear_batch(isogi_vol__batch *b, const isogi_pyramid *pyramid) {
    b->pyramid = pyramid, b->rays = NULL, b->starts = NULL, b->dirs = NULL, b->tmax = NULL, b->isovalue = 0, b->flags = 0, b->bundle = 0;
    b->bundles = NULL, b->each = b->bundle_count = b->opened = b->count = 0;
    b->hits = NULL, b->occluded = NULL;
    b->work.rays = b->work.blocks = b->work.cells = b->work.cubics = 0;
}

/* Bundle n becomes the present one. */
static void isogi_vol__open_bundle(isogi_vol__batch *b, size_t n) {
    const isogi_bundle *bundle = &b->bundles[n];
    b->opened = n, b->isovalue = bundle->isovalue, b->flags = bundle->flags;
    b->rays = NULL, b->starts = NULL;
    if (bundle->start) b->bundle_start = *bundle->start, b->starts = &b->bundle_start, b->tmax = &bundle->tmax;
    else {
        memcpy(b->bundle_ray.origin, bundle->origin, sizeof b->bundle_ray.origin);
        b->bundle_ray.tmin = bundle->tmin, b->bundle_ray.tmax = bundle->tmax;
        b->bundle_ray.isovalue = bundle->isovalue, b->bundle_ray.flags = bundle->flags;
        b->rays = &b->bundle_ray;
    }
}

/* Whether a ray is done where it is known to come to both sides. Past a voxel that is not finite it may do so without a hit. */
static int isogi_vol__any_will_do(const isogi_vol__batch *b) { return b->occluded && b->pyramid->all_finite; }

static uint32_t isogi_vol__flags(const isogi_vol__batch *b, size_t i) { return b->rays ? b->rays[b->bundle ? 0 : i].flags : b->flags; }

/* Whether the field is inside where the ray ends. */
static int isogi_vol__ends_inside(isogi_vol__walk *w) {
    double corner[8], local[3];
    isogi_vol__last_cell(w, local);
    return isogi_vol__corners(w->pyramid, w->cell, w->isovalue, corner) && isogi_vol__trilinear(corner, local, NULL) >= 0;
}

static int isogi_vol__begin_ray(const isogi_vol__batch *b, size_t i, isogi_vol__walk *w) {
    const isogi_pyramid *p = b->pyramid;
    const isogi_ray *ray = &b->rays[b->bundle ? 0 : i];
    const double tmax = isogi_vol__tmax(ray->tmax);
    double relative[3];
    int a;
    w->isovalue = ray->isovalue;
#ifdef ISOGI_VOL__AVX
    if (p->fast && p->path >= ISOGI_VOL__PATH_AVX2) {
        if (!isogi_vol__place_avx2(w, ray->origin)) return 0;
    } else
#endif
    {
        for (a = 0; a < 3; a++) relative[a] = ray->origin[a] - p->origin[a];
        isogi_vol__transform(p->to_grid, relative, w->origin);
        if (!isogi_vol__finite3(w->origin) || !isogi_vol__finite3(ray->origin)) return 0;
    }
    if (!isogi_vol__finite64(ray->isovalue)) return 0;
    if (isogi_vol__is_nan(ray->tmin) || isogi_vol__is_nan(ray->tmax) || !(ray->tmin <= tmax)) return 0;
    if (!isogi_vol__aim(w, b->bundle ? b->dirs[i] : ray->dir, isogi_vol__max(ray->tmin, -ISOGI_VOL__UNLIMITED), tmax)) return 0;
    if (w->entry_axis >= 0 && (ray->flags & ISOGI_RAY_CAPPED)) w->inside = 0, w->cap = 2;
    return 1;
}

static int isogi_vol__begin_start(const isogi_vol__batch *b, size_t i, isogi_vol__walk *w) {
    const isogi_hit *start = &b->starts[b->bundle ? 0 : i];
    const double tmax = isogi_vol__tmax(b->tmax ? b->tmax[b->bundle ? 0 : i] : 0);
    int a;
    /* the cap of a border lies where the field is not at the isovalue: nothing to divide out */
    w->deflate = start->side != 2 && start->side != -2;
    if (b->flags & ISOGI_RAY_ONWARD && start->side) w->inside = start->side > 0;
    w->isovalue = b->isovalue;
    for (a = 0; a < 3; a++) {
        if (start->cell[a] >= (uint32_t)b->pyramid->cells[a] || !isogi_vol__finite64(start->local[a])) return 0;
        w->origin[a] = start->cell[a] + isogi_vol__clamp(start->local[a], 1);
    }
    if (!isogi_vol__finite64(b->isovalue) || isogi_vol__is_nan(tmax) || !(tmax >= 0) || !isogi_vol__aim(w, b->dirs[i], 0, tmax)) return 0;
    w->entry_axis = -1;
    /* not a cap that is left outwards */
    return w->deflate || w->inside > 0 ||
           (w->inside < 0 && !(w->end * isogi_vol__largest(w->dir[0], w->dir[1], w->dir[2]) < ISOGI_VOL__ON_SURFACE));
}

/* Sets a walk up; 0: there is nothing to walk. */
static int isogi_vol__begin(isogi_vol__batch *b, size_t i, isogi_vol__walk *w) {
    w->pyramid = b->pyramid, w->inside = -1, w->entry_axis = -1, w->cap = 1, w->deflate = 0;
    w->exact = !isogi_vol__any_will_do(b);
    w->origin[3] = w->deflated = 0;
    w->count.blocks = w->count.cells = w->count.cubics = 0;
    b->work.rays++;
    return b->rays ? isogi_vol__begin_ray(b, i, w) : isogi_vol__begin_start(b, i, w);
}

/* ==== fast traversal ================================================================================================= */

/* Blocks and cells that cannot hold the surface lie strictly on one side, and so do the faces they share with others (a convex sum of
   numbers of one sign has that sign in floating point too): passing over them keeps the side. The way through a node's 64 children is not
   walked but found all at once, in float: a ray passes a child if it enters it by no axis later than it leaves it by another, sixteen pairs
   of layers for every two axes. Axes along which the ray falls are counted backwards, so that it meets children in the order of their
   numbers x + 4y + 16z. Times of a node follow from its parent's by a multiple of what a child takes, so that those of its children wait
   for no more than its number. Roundings, two for each of seven levels and a few more, put them off by less than 2^-20 of what the root
   measures; children are widened by twice as much, so none is left out, and some are kept that the ray only comes near. Which cells of a
   leaf a ray passes is told in the end by the times that pools go by, see many rays at once. */

/* A cell that may have corners on both sides, entered and left through the axes `in` and `axis` (-1: the segment begins, ends in it). */
static int isogi_vol__mixed_cell_base(isogi_vol__walk *w, int x, int y, int z, int in, int axis, isogi_hit *hit) {
    double out = w->end;
    w->cell[0] = x, w->cell[1] = y, w->cell[2] = z;
    w->entry_axis = in;
    w->t = in < 0 ? 0 : isogi_vol__max(0, (w->cell[in] + (w->dir[in] > 0 ? 0 : 1) - w->origin[in]) * w->inverse[in]);
    if (axis >= 0) out = isogi_vol__min(out, (w->cell[axis] + (w->dir[axis] > 0 ? 1 : 0) - w->origin[axis]) * w->inverse[axis]);
    out = isogi_vol__max(out, w->t);
    /* what was skipped since lies on one side; times that are the same differ where registers are longer than a double (x87) */
    w->deflate &= w->t <= w->deflated * (1 + 1e-15);
    w->deflated = out;
    return isogi_vol__visit_cell(w, out, axis, hit);
}

/* ---- rides ---- */

/* Where a ray is among children of nodes. */
typedef struct isogi_vol__trip {
    double inverse[4];            /* as in a pool; the fourth is 0 */
    int32_t lead[4];              /* 1 on axes along which the ray falls, else 0 */
    int64_t stop;                 /* where the ray ends, as in a pool */
    float cell[12];               /* time that a cell takes by each axis, four times each; on its fastest axis a ray takes 1 */
    float enter[ISOGI_VOL__NODE_LEVELS][12]; /* when the node of the next level is entered, widened: by each axis for itself */
    float last, level;            /* where it ends, or a little more; the isovalue in 8 bits, unrounded */
    int flip, octant, low, high;  /* children and axes that are counted backwards; what the isovalue can be in 8 bits */
    int entry_axis, in, out;      /* axes by which the ray enters the volume (-1), and enters and leaves the present cell (3); or none */
    const uint8_t *children[ISOGI_VOL__NODE_LEVELS]; /* of the node of each level (NULL: leaves, and there are none), */
    uint64_t left[ISOGI_VOL__NODE_LEVELS], cells;    /* those still to come, in the ray's order; of the leaf */
    int32_t place[ISOGI_VOL__NODE_LEVELS][4], child; /* the nodes' coordinates; the last one's number in its parent */
    unsigned pending;                                /* levels that have any left */
} isogi_vol__trip;

/* A ray on its way from node to node, which can be left where it is going to read memory, and taken up again. */
typedef struct isogi_vol__ride {
    isogi_vol__walk walk;
    const uint8_t *open; /* the node that is to be opened next */
    isogi_vol__leaf leaf;
    size_t number;  /* the ray's in its batch, */
    uint32_t flags; /* and its flags */
    int at;         /* level of the node among whose children it is: level n has children of 4^n cells */
    isogi_vol__trip trip;
} isogi_vol__ride;

/* Sends for a node. */
ISOGI_VOL__INLINE void isogi_vol__ride_to(isogi_vol__ride *r, const uint8_t *node) {
    r->open = node;
    ISOGI_VOL__PREFETCH(node);
    ISOGI_VOL__PREFETCH(node + 64);
}

/* Sends for the voxels of a cell. */
ISOGI_VOL__INLINE void isogi_vol__ride_to_cell(const isogi_vol__ride *r, int x, int y, int z) {
    const isogi_volume *v = &r->walk.pyramid->volume;
    const char *at = (const char *)v->data + x * v->stride[0] + y * v->stride[1] + z * v->stride[2];
    ISOGI_VOL__PREFETCH(at);
    ISOGI_VOL__PREFETCH(at + v->stride[1]);
    ISOGI_VOL__PREFETCH(at + v->stride[2]);
    ISOGI_VOL__PREFETCH(at + v->stride[1] + v->stride[2]);
}

/* What is certain of the ray in a cell by the hull of Bernstein coefficients in float, from the leaf's voxels: 1: it stays on its side all
   along; 2: it is on the other one where it leaves the cell, and any hit will do; 0: nothing. f: values where by each axis (a bit) it
   enters the cell, 0, or leaves it, 1. */
ISOGI_VOL__INLINE int isogi_vol__told(isogi_vol__walk *w, const isogi_vol__leaf *leaf, const float f[8]) {
    const float high = leaf->isovalue + ISOGI_VOL__DOUBT, low = leaf->isovalue - ISOGI_VOL__DOUBT;
    const float sum1 = f[1] + f[2] + f[4], sum2 = f[3] + f[5] + f[6]; /* three coefficients each */
    const int in = (f[0] > high) & (f[7] > high) & (sum1 > 3 * high) & (sum2 > 3 * high);
    const int out = (f[0] < low) & (f[7] < low) & (sum1 < 3 * low) & (sum2 < 3 * low);
    if (w->inside < 0) w->inside = in ? 1 : out ? 0 : -1;
    if (w->inside > 0 ? in : out) return 1;
    return !w->exact && (w->inside > 0 ? f[7] < low : !w->inside && f[7] > high) ? 2 : 0;
}

/* What is told of a cell; begin, end: when the ray enters it and leaves it. First x, then y, then z is taken there. */
static int isogi_vol__cell_told_base(isogi_vol__walk *w, const isogi_vol__leaf *leaf, const int32_t cell[4], double begin, double end) {
    const uint8_t *code = leaf->code + (cell[0] & 3) + 5 * (cell[1] & 3) + 25 * (cell[2] & 3);
    const isogi_vol__four zero = ISOGI_VOL__FOUR(set1_ps)(0), one = ISOGI_VOL__FOUR(set1_ps)(1);
    isogi_vol__four low, high, enters, leaves, in, out;
    float from[3], to[3], f[8];
    int a;
    for (a = 0; a < 3; a++) {
        const double at = w->origin[a] - cell[a];
        from[a] = (float)(at + begin * w->dir[a]), to[a] = (float)(at + end * w->dir[a]);
    }
    in = ISOGI_VOL__FOUR(min_ps)(ISOGI_VOL__FOUR(max_ps)(ISOGI_VOL__FOUR(setr_ps)(from[0], from[1], from[2], 0), zero), one);
    out = ISOGI_VOL__FOUR(min_ps)(ISOGI_VOL__FOUR(max_ps)(ISOGI_VOL__FOUR(setr_ps)(to[0], to[1], to[2], 0), zero), one);
    low = ISOGI_VOL__FOUR(setr_ps)(code[0], code[5], code[25], code[30]);
    high = ISOGI_VOL__FOUR(setr_ps)(code[1], code[6], code[26], code[31]);
#define ISOGI_VOL__TAKEN(axis) \
    high = ISOGI_VOL__FOUR(sub_ps)(high, low); \
    enters = ISOGI_VOL__FOUR(add_ps)(low, ISOGI_VOL__FOUR(mul_ps)(ISOGI_VOL__LANE_base(in, axis), high)); \
    leaves = ISOGI_VOL__FOUR(add_ps)(low, ISOGI_VOL__FOUR(mul_ps)(ISOGI_VOL__LANE_base(out, axis), high)); \
    low = ISOGI_VOL__EVEN(enters, leaves), high = ISOGI_VOL__ODD(enters, leaves)
    ISOGI_VOL__TAKEN(0);
    ISOGI_VOL__TAKEN(1);
    ISOGI_VOL__TAKEN(2);
#undef ISOGI_VOL__TAKEN
    ISOGI_VOL__FOUR(storeu_ps)(f, enters), ISOGI_VOL__FOUR(storeu_ps)(f + 4, leaves);
    return isogi_vol__told(w, leaf, f);
}

/* Takes the ray's directions; 0: it has to be walked plainly. */
static int isogi_vol__ride_set(isogi_vol__ride *r) {
    const isogi_vol__walk *w = &r->walk;
    isogi_vol__trip *c = &r->trip;
    int a;
    if (!(w->end > 1e-150) || !(w->end < 1e150)) return 0;
    c->octant = 0, c->inverse[3] = 0, c->lead[3] = 0;
    for (a = 0; a < 3; a++) {
        const int still = !(w->dir[a] > 0 || w->dir[a] < 0);
        /* one that stands still keeps below the upper border */
        const int fall = w->dir[a] < 0 || (still && w->origin[a] >= w->pyramid->box[a]);
        c->octant |= fall << a, c->lead[a] = fall;
        c->inverse[a] = still ? fall ? -1e200 : 1e200 : w->inverse[a];
    }
    c->flip = 3 * (c->octant & 1) + 6 * (c->octant & 2) + 12 * (c->octant & 4);
    memcpy(&c->stop, &w->end, sizeof c->stop), c->stop |= 3;
    c->entry_axis = w->entry_axis;
    return 1;
}

/* Sends it to the root. */
static void isogi_vol__ride_start(isogi_vol__ride *r) {
    const isogi_vol__walk *w = &r->walk;
    const isogi_pyramid *p = w->pyramid;
    isogi_vol__trip *c = &r->trip;
    const int top = p->node_levels - 1;
    const double most = isogi_vol__largest(w->dir[0], w->dir[1], w->dir[2]);
    int a;
    c->level = isogi_vol__quantise_isovalue(p, w->isovalue, &c->low, &c->high);
    for (a = 0; a < 3; a++) {
        const double start = c->lead[a] ? (4 << 2 * top) - w->origin[a] : w->origin[a]; /* counted like cells */
        const float cell = (float)isogi_vol__min(fabs(c->inverse[a]) * most, 1e30);
        ISOGI_VOL__FOUR(storeu_ps)(c->cell + 4 * a, ISOGI_VOL__FOUR(set1_ps)(cell));
        ISOGI_VOL__FOUR(storeu_ps)(c->enter[top] + 4 * a, ISOGI_VOL__FOUR(set1_ps)((-2 * p->ways->reach - (float)start) * cell));
    }
    c->last = (float)(isogi_vol__min(w->end * most, 1e30) * 1.000001);
    memset(c->place[top], 0, sizeof c->place[top]);
    c->child = 0, c->pending = 0, c->cells = 0, r->at = top;
    isogi_vol__ride_to(r, p->nodes[p->node_level[top].first]);
}

/* When the ray is in each layer of a node's children, by each axis. */
ISOGI_VOL__INLINE void isogi_vol__trip_layers(isogi_vol__trip *c, const struct isogi_vol__ways *ways, int n, isogi_vol__four in[3],
                                              isogi_vol__four out[3]) {
    const isogi_vol__four last = ISOGI_VOL__FOUR(set1_ps)(c->last), zero = ISOGI_VOL__FOUR(set1_ps)(0);
    const isogi_vol__four size = ISOGI_VOL__FOUR(set1_ps)(ways->size[n]), wide = ISOGI_VOL__FOUR(set1_ps)(ways->wider[n]);
    int a;
    ISOGI_VOL__UNROLL(3)
    for (a = 0; a < 3; a++) {
        const isogi_vol__four cell = ISOGI_VOL__FOUR(loadu_ps)(c->cell + 4 * a), begin = ISOGI_VOL__FOUR(loadu_ps)(c->enter[n] + 4 * a);
        const isogi_vol__four layers = ISOGI_VOL__FOUR(loadu_ps)(ways->within[c->child] + 4 * a);
        const isogi_vol__four times = ISOGI_VOL__FOUR(add_ps)(begin, ISOGI_VOL__FOUR(mul_ps)(layers, ISOGI_VOL__FOUR(mul_ps)(cell, size)));
        in[a] = ISOGI_VOL__FOUR(max_ps)(times, zero);
        out[a] = ISOGI_VOL__FOUR(min_ps)(ISOGI_VOL__FOUR(add_ps)(times, ISOGI_VOL__FOUR(mul_ps)(cell, wide)), last);
        if (n) ISOGI_VOL__FOUR(storeu_ps)(c->enter[n - 1] + 4 * a, ISOGI_VOL__LANE_base(times, 0));
    }
}

/* The beam that holds rays which nearly coincide (see there). Its time is its way on the axis on which they are fastest: it enters a layer
   at in * where that begins + in_base, and leaves it at out * where that ends + out_base. All is counted backwards where rays fall. */
typedef struct isogi_vol__beam {
    float in[3], in_base[3], out[3], out_base[3], from, to;
    float corner[3]; /* lowest of the node that is to be opened */
} isogi_vol__beam;

/* What trip_layers finds, of a beam. */
ISOGI_VOL__INLINE void isogi_vol__beam_layers(const isogi_vol__beam *beam, const struct isogi_vol__ways *ways, int n, isogi_vol__four in[3],
                                              isogi_vol__four out[3]) {
    const isogi_vol__four from = ISOGI_VOL__FOUR(set1_ps)(beam->from), to = ISOGI_VOL__FOUR(set1_ps)(beam->to);
    const isogi_vol__four size = ISOGI_VOL__FOUR(set1_ps)(ways->size[n]);
    const isogi_vol__four layers = ISOGI_VOL__FOUR(mul_ps)(ISOGI_VOL__FOUR(loadu_ps)(ways->within[0]), size);
    int a;
    ISOGI_VOL__UNROLL(3)
    for (a = 0; a < 3; a++) {
        const isogi_vol__four begin = ISOGI_VOL__FOUR(add_ps)(layers, ISOGI_VOL__FOUR(set1_ps)(beam->corner[a]));
        in[a] = ISOGI_VOL__FOUR(mul_ps)(begin, ISOGI_VOL__FOUR(set1_ps)(beam->in[a]));
        in[a] = ISOGI_VOL__FOUR(max_ps)(ISOGI_VOL__FOUR(add_ps)(in[a], ISOGI_VOL__FOUR(set1_ps)(beam->in_base[a])), from);
        out[a] = ISOGI_VOL__FOUR(mul_ps)(ISOGI_VOL__FOUR(add_ps)(begin, size), ISOGI_VOL__FOUR(set1_ps)(beam->out[a]));
        out[a] = ISOGI_VOL__FOUR(min_ps)(ISOGI_VOL__FOUR(add_ps)(out[a], ISOGI_VOL__FOUR(set1_ps)(beam->out_base[a])), to);
    }
}

/* Bits 0..15 in groups of four that are 16 apart. */
ISOGI_VOL__INLINE uint64_t isogi_vol__spread_rows(uint64_t x) {
    x = (x | x << 24) & 0x000000ff000000ffu;
    return (x | x << 12) & 0x000f000f000f000fu;
}

/* Which children of a node the ray passes or comes near, in its own order, from which layers of every two axes it is in at once. */
ISOGI_VOL__INLINE uint64_t isogi_vol__way_base(const isogi_vol__four in[3], const isogi_vol__four out[3]) {
    const uint64_t xy = isogi_vol__met(in[0], out[0], in[1], out[1]), xz = isogi_vol__met(in[0], out[0], in[2], out[2]);
    uint64_t yz = isogi_vol__spread_rows(isogi_vol__met(in[1], out[1], in[2], out[2]));
    yz = (yz | yz << 6) & 0x0303030303030303u, yz = (yz | yz << 3) & 0x1111111111111111u;
    return xy * 0x0001000100010001u & isogi_vol__spread_rows(xz) * 0x1111u & yz * 15;
}

ISOGI_VOL__INLINE uint64_t isogi_vol__beam_way_base(const isogi_vol__beam *beam, const struct isogi_vol__ways *ways, int n) {
    isogi_vol__four in[3], out[3];
    isogi_vol__beam_layers(beam, ways, n, in, out);
    return isogi_vol__way_base(in, out);
}

ISOGI_VOL__INLINE uint64_t isogi_vol__trip_way_base(isogi_vol__trip *c, const struct isogi_vol__ways *ways, int n) {
    isogi_vol__four in[3], out[3];
    isogi_vol__trip_layers(c, ways, n, in, out);
    return isogi_vol__way_base(in, out);
}

/* Children counted backwards along the axes of `octant`. */
ISOGI_VOL__INLINE uint64_t isogi_vol__turn_mask_base(uint64_t m, const struct isogi_vol__ways *ways, int octant) {
#ifdef ISOGI_VOL__NEON
    const uint8_t(*turn)[16] = ways->turn[octant];
    const uint8x16_t rows = vqtbl1q_u8(vreinterpretq_u8_u64(vdupq_n_u64(m)), vld1q_u8(turn[0]));
    const uint8x16_t low = vqtbl1q_u8(vld1q_u8(turn[1]), vandq_u8(rows, vdupq_n_u8(15)));
    return vgetq_lane_u64(vreinterpretq_u64_u8(vorrq_u8(low, vqtbl1q_u8(vld1q_u8(turn[2]), vshrq_n_u8(rows, 4)))), 0);
#else
    (void)ways;
    if (octant & 1) {
        m = (m >> 1 & 0x5555555555555555u) | (m & 0x5555555555555555u) << 1;
        m = (m >> 2 & 0x3333333333333333u) | (m & 0x3333333333333333u) << 2;
    }
    if (octant & 2) {
        m = (m >> 4 & 0x0f0f0f0f0f0f0f0fu) | (m & 0x0f0f0f0f0f0f0f0fu) << 4;
        m = (m >> 8 & 0x00ff00ff00ff00ffu) | (m & 0x00ff00ff00ff00ffu) << 8;
    }
    if (octant & 4) {
        m = (m >> 16 & 0x0000ffff0000ffffu) | (m & 0x0000ffff0000ffffu) << 16;
        m = m >> 32 | m << 32;
    }
    return m;
#endif
}

/* The coordinates of a node's child among nodes of its level. */
ISOGI_VOL__INLINE void isogi_vol__child_place(int32_t to[4], const int32_t node[4], const int32_t digits[4]) {
#if defined(ISOGI_VOL__SSE2)
    const __m128i *at = (const __m128i *)(const void *)node, *add = (const __m128i *)(const void *)digits;
    _mm_storeu_si128((__m128i *)(void *)to, _mm_add_epi32(_mm_slli_epi32(_mm_loadu_si128(at), 2), _mm_loadu_si128(add)));
#else
    int a;
    for (a = 0; a < 4; a++) to[a] = 4 * node[a] + digits[a];
#endif
}

/* Sends for the next node, of the lowest level that has any left; 0: there is none. */
ISOGI_VOL__INLINE int isogi_vol__trip_next(isogi_vol__ride *r) {
    isogi_vol__trip *c = &r->trip;
    int n, here;
    if (!c->pending) return 0;
    n = isogi_vol__lowest_bit(c->pending), c->child = isogi_vol__lowest_bit(c->left[n]), here = c->child ^ c->flip;
    c->left[n] &= c->left[n] - 1;
    if (!c->left[n]) c->pending &= c->pending - 1;
    isogi_vol__child_place(c->place[n - 1], c->place[n], r->walk.pyramid->ways->inner[here]);
    if (c->children[n]) isogi_vol__ride_to(r, c->children[n] + 128 * here);
    else r->open = r->walk.pyramid->nodes[0]; /* there is nothing to be read */
    r->at = n - 1;
    return 1;
}

/* Whether the ray passes a cell as pools have it, when it enters and leaves it, and by which axes; 3: none. Times as integers, in whose two
   lowest bits stands the axis. */
static int isogi_vol__passes_base(isogi_vol__ride *r, const int32_t cell[4], double *begin, double *end) {
    isogi_vol__trip *c = &r->trip;
    const double *origin = r->walk.origin;
    int64_t first = 3, last = c->stop;
    int a;
    for (a = 0; a < 3; a++) {
        const double t0 = (cell[a] + c->lead[a] - origin[a]) * c->inverse[a];
        const double t1 = (cell[a] + 1 - c->lead[a] - origin[a]) * c->inverse[a];
        int64_t in, out;
        memcpy(&in, &t0, sizeof in), memcpy(&out, &t1, sizeof out);
        /* what is negative is so as an integer, too */
        in = ((in > 0 ? in : 0) & ~(int64_t)3) | a, out = ((out > 0 ? out : 0) & ~(int64_t)3) | a;
        first = in > first ? in : first, last = out < last ? out : last;
    }
    c->in = (int)(first & 3), c->out = (int)(last & 3);
    if (first >= last) return 0;
    first &= ~(int64_t)3, last &= ~(int64_t)3;
    memcpy(begin, &first, sizeof first), memcpy(end, &last, sizeof last);
    return 1;
}

/* The same by every path.
   leaf_mask: which of the 64 cells (x + 4y + 16z) of a leaf can hold the surface.
   open_node, open_leaf: opens the node that was sent for: of the children on the way those that can hold the surface are the next ones;
   open_any: one or the other.
   trip_look: the next cell of the leaf: 0: nothing is there; -1: it is in doubt, and its voxels are sent for; 1: any hit will do, and there
   is one. trip_decide: the cell that is in doubt: 1: hit; 0: none.
   ride_on: to the first hit: 1, or to the end: 0. */
#define ISOGI_VOL__TRIP(path, target) \
    target ISOGI_VOL__INLINE uint64_t isogi_vol__leaf_mask_##path(const uint8_t node[128], float level, isogi_vol__leaf *leaf) { \
        isogi_vol__open_leaf(leaf, node, level); \
        return isogi_vol__mixed_cells(leaf, isogi_vol__at_least_##path(node, leaf->inside), \
                                      isogi_vol__at_least_##path(node + 64, leaf->inside), \
                                      ~isogi_vol__at_least_##path(node, leaf->outside), \
                                      ~isogi_vol__at_least_##path(node + 64, leaf->outside)); \
    } \
    target ISOGI_VOL__INLINE void isogi_vol__open_node_##path(isogi_vol__ride *r, uint64_t way) { \
        isogi_vol__trip *c = &r->trip; \
        const isogi_pyramid *p = r->walk.pyramid; \
        const int n = r->at; \
        const size_t x = (size_t)c->place[n][0], y = (size_t)c->place[n][1], z = (size_t)c->place[n][2]; \
        const uint64_t held = isogi_vol__at_least_##path(r->open + 64, c->low) & ~isogi_vol__at_least_##path(r->open, c->high + 1); \
        c->left[n] = isogi_vol__turn_mask_##path(held, p->ways, c->octant) & way, c->pending |= (unsigned)(c->left[n] != 0) << n; \
        c->children[n] = n > 1 || !p->volume.compact ? p->nodes[isogi_vol__node_at(p, n - 1, 4 * x, 4 * y, 4 * z)] : NULL; \
        r->walk.count.blocks++; \
    } \
    target ISOGI_VOL__INLINE void isogi_vol__open_leaf_##path(isogi_vol__ride *r, uint64_t way) { \
        isogi_vol__trip *c = &r->trip; \
        const isogi_pyramid *p = r->walk.pyramid; \
        const int32_t *place = c->place[0]; \
        const uint64_t held = \
            p->volume.compact ? isogi_vol__no_leaf(p, (size_t)place[0], (size_t)place[1], (size_t)place[2], &r->leaf) \
                              : isogi_vol__leaf_mask_##path(r->open, c->level, &r->leaf); \
        c->cells = isogi_vol__turn_mask_##path(held, p->ways, c->octant) & way; \
        r->walk.count.blocks++; \
    } \
    target ISOGI_VOL__INLINE void isogi_vol__open_any_##path(isogi_vol__ride *r, uint64_t way) { \
        if (r->at) isogi_vol__open_node_##path(r, way); \
        else isogi_vol__open_leaf_##path(r, way); \
    } \
    target ISOGI_VOL__INLINE int isogi_vol__trip_look_##path(isogi_vol__ride *r) { \
        isogi_vol__trip *c = &r->trip; \
        isogi_vol__walk *w = &r->walk; \
        double begin, end; \
        int32_t cell[4]; \
        int told = 0; \
        isogi_vol__child_place(cell, c->place[0], w->pyramid->ways->inner[isogi_vol__lowest_bit(c->cells) ^ c->flip]); \
        if (isogi_vol__passes_##path(r, cell, &begin, &end)) { \
            if (!w->deflate && r->leaf.code) told = isogi_vol__cell_told_##path(w, &r->leaf, cell, begin, end); \
            w->count.cells += told != 0; \
            if (!told) { \
                isogi_vol__ride_to_cell(r, cell[0], cell[1], cell[2]); \
                return -1; \
            } \
        } \
        c->cells &= c->cells - 1; \
        return told > 1; \
    } \
    target ISOGI_VOL__INLINE int isogi_vol__trip_decide_##path(isogi_vol__ride *r, isogi_hit *hit) { \
        isogi_vol__trip *c = &r->trip; \
        int32_t cell[4]; \
        isogi_vol__child_place(cell, c->place[0], r->walk.pyramid->ways->inner[isogi_vol__lowest_bit(c->cells) ^ c->flip]); \
        c->cells &= c->cells - 1; \
        return isogi_vol__mixed_cell_##path(&r->walk, cell[0], cell[1], cell[2], c->in == 3 ? c->entry_axis : c->in, \
                                            c->out == 3 ? -1 : c->out, hit); \
    } \
    target static int isogi_vol__ride_on_##path(isogi_vol__ride *r, isogi_hit *hit) { \
        isogi_vol__trip *c = &r->trip; \
        if (c->low > c->high) return 0; \
        do { \
            isogi_vol__open_any_##path(r, isogi_vol__trip_way_##path(c, r->walk.pyramid->ways, r->at)); \
            while (c->cells) { \
                const int found = isogi_vol__trip_look_##path(r); \
                if (found > 0 || (found && isogi_vol__trip_decide_##path(r, hit))) return 1; \
            } \
        } while (isogi_vol__trip_next(r)); \
        return 0; \
    }

ISOGI_VOL__TRIP(base, )

#ifdef ISOGI_VOL__AVX
/* What way_base finds, from all three axes together: a vector has two rows of four children. in, out: of x and y; of z, twice. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE uint64_t isogi_vol__way_avx2(__m256 in, __m256 out, __m256 in_z, __m256 out_z) {
    const __m256i row[2] = {_mm256_setr_epi32(4, 4, 4, 4, 5, 5, 5, 5), _mm256_setr_epi32(6, 6, 6, 6, 7, 7, 7, 7)};
    const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    const __m256 in_x = _mm256_permute2f128_ps(in, in, 0), out_x = _mm256_permute2f128_ps(out, out, 0);
    const __m256 enter0 = _mm256_max_ps(in_x, _mm256_permutevar8x32_ps(in, row[0])),
                 enter1 = _mm256_max_ps(in_x, _mm256_permutevar8x32_ps(in, row[1])),
                 leave0 = _mm256_min_ps(out_x, _mm256_permutevar8x32_ps(out, row[0])),
                 leave1 = _mm256_min_ps(out_x, _mm256_permutevar8x32_ps(out, row[1]));
#define ISOGI_VOL__MET(i, z) \
    _mm256_castps_si256(_mm256_cmp_ps(_mm256_max_ps(enter##i, _mm256_permute_ps(in_z, 0x55 * (z))), \
                                      _mm256_min_ps(leave##i, _mm256_permute_ps(out_z, 0x55 * (z))), _CMP_LE_OQ))
#define ISOGI_VOL__LAYER(z) _mm256_packs_epi32(ISOGI_VOL__MET(0, z), ISOGI_VOL__MET(1, z))
#define ISOGI_VOL__LAYERS(z) \
    (uint64_t)(uint32_t)_mm256_movemask_epi8( \
        _mm256_permutevar8x32_epi32(_mm256_packs_epi16(ISOGI_VOL__LAYER(z), ISOGI_VOL__LAYER((z) + 1)), order))
    return ISOGI_VOL__LAYERS(0) | ISOGI_VOL__LAYERS(2) << 32;
#undef ISOGI_VOL__LAYERS
#undef ISOGI_VOL__LAYER
#undef ISOGI_VOL__MET
}

ISOGI_VOL__TARGET("avx2")
ISOGI_VOL__INLINE uint64_t isogi_vol__beam_way_avx2(const isogi_vol__beam *beam, const struct isogi_vol__ways *ways, int n) {
    __m128 in[3], out[3];
    isogi_vol__beam_layers(beam, ways, n, in, out);
    return isogi_vol__way_avx2(_mm256_set_m128(in[1], in[0]), _mm256_set_m128(out[1], out[0]), _mm256_set_m128(in[2], in[2]),
                               _mm256_set_m128(out[2], out[2]));
}

/* As trip_layers and way_base. */
ISOGI_VOL__TARGET("avx2")
ISOGI_VOL__INLINE uint64_t isogi_vol__trip_way_avx2(isogi_vol__trip *c, const struct isogi_vol__ways *ways, int n) {
    const __m256 last = _mm256_set1_ps(c->last), zero = _mm256_setzero_ps();
    const __m256 size = _mm256_set1_ps(ways->size[n]), wide = _mm256_set1_ps(ways->wider[n]);
#define ISOGI_VOL__Z(from) _mm256_broadcast_ps((const __m128 *)(const void *)((from) + 8))
    const float *within = ways->within[c->child];
    const __m256 cell = _mm256_loadu_ps(c->cell), cell_z = ISOGI_VOL__Z(c->cell);
    const __m256 times = _mm256_add_ps(_mm256_loadu_ps(c->enter[n]), _mm256_mul_ps(_mm256_loadu_ps(within), _mm256_mul_ps(cell, size)));
    const __m256 times_z = _mm256_add_ps(ISOGI_VOL__Z(c->enter[n]), _mm256_mul_ps(ISOGI_VOL__Z(within), _mm256_mul_ps(cell_z, size)));
#undef ISOGI_VOL__Z
    if (n) {
        _mm256_storeu_ps(c->enter[n - 1], _mm256_permute_ps(times, 0));
        _mm_storeu_ps(c->enter[n - 1] + 8, _mm256_castps256_ps128(_mm256_permute_ps(times_z, 0)));
    }
    return isogi_vol__way_avx2(_mm256_max_ps(times, zero), _mm256_min_ps(_mm256_add_ps(times, _mm256_mul_ps(cell, wide)), last),
                               _mm256_max_ps(times_z, zero), _mm256_min_ps(_mm256_add_ps(times_z, _mm256_mul_ps(cell_z, wide)), last));
}

/* What turn_mask_base does. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE uint64_t isogi_vol__turn_mask_avx2(uint64_t m, const struct isogi_vol__ways *ways, int octant) {
    const __m128i *turn = (const __m128i *)(const void *)ways->turn[octant], half = _mm_set1_epi8(15);
    const __m128i rows = _mm_shuffle_epi8(_mm_cvtsi64_si128((int64_t)m), _mm_loadu_si128(turn));
    const __m128i low = _mm_shuffle_epi8(_mm_loadu_si128(turn + 1), _mm_and_si128(rows, half));
    const __m128i high = _mm_shuffle_epi8(_mm_loadu_si128(turn + 2), _mm_and_si128(_mm_srli_epi16(rows, 4), half));
    return (uint64_t)_mm_cvtsi128_si64(_mm_or_si128(low, high));
}

ISOGI_VOL__TARGET("avx2")
ISOGI_VOL__INLINE int isogi_vol__passes_avx2(isogi_vol__ride *r, const int32_t cell[4], double *begin, double *end) {
    isogi_vol__trip *c = &r->trip;
    const __m128i at = _mm_loadu_si128((const __m128i *)(const void *)cell);
    const __m128i lead = _mm_loadu_si128((const __m128i *)(const void *)c->lead);
    const __m128i near_face = _mm_add_epi32(at, lead), far_face = _mm_sub_epi32(_mm_add_epi32(at, _mm_set1_epi32(1)), lead);
    const __m256d origin = _mm256_loadu_pd(r->walk.origin), inverse = _mm256_loadu_pd(c->inverse), zero = _mm256_setzero_pd();
    const __m256d axes = _mm256_castsi256_pd(_mm256_setr_epi64x(0, 1, 2, 3));
    const __m256d time = _mm256_castsi256_pd(_mm256_set1_epi64x(~(int64_t)3));
    const __m256d t0 = _mm256_mul_pd(_mm256_sub_pd(_mm256_cvtepi32_pd(near_face), origin), inverse);
    const __m256d t1 = _mm256_mul_pd(_mm256_sub_pd(_mm256_cvtepi32_pd(far_face), origin), inverse);
    /* as integers: the number of an axis alone is a denormal, which processors may be told to take for 0 */
    __m256i in = _mm256_castpd_si256(_mm256_or_pd(_mm256_and_pd(_mm256_max_pd(t0, zero), time), axes)), other;
    __m256i out = _mm256_castpd_si256(_mm256_or_pd(_mm256_and_pd(_mm256_max_pd(t1, zero), time), axes));
    int64_t first, last;
    out = _mm256_blend_epi32(out, _mm256_set1_epi64x(c->stop), 0xc0);
    other = _mm256_permute4x64_epi64(in, 0x4e), in = _mm256_blendv_epi8(in, other, _mm256_cmpgt_epi64(other, in));
    other = _mm256_permute4x64_epi64(in, 0xb1), in = _mm256_blendv_epi8(in, other, _mm256_cmpgt_epi64(other, in));
    other = _mm256_permute4x64_epi64(out, 0x4e), out = _mm256_blendv_epi8(out, other, _mm256_cmpgt_epi64(out, other));
    other = _mm256_permute4x64_epi64(out, 0xb1), out = _mm256_blendv_epi8(out, other, _mm256_cmpgt_epi64(out, other));
    first = _mm_cvtsi128_si64(_mm256_castsi256_si128(in)), last = _mm_cvtsi128_si64(_mm256_castsi256_si128(out));
    c->in = (int)(first & 3), c->out = (int)(last & 3);
    if (first >= last) return 0;
    first &= ~(int64_t)3, last &= ~(int64_t)3;
    memcpy(begin, &first, sizeof first), memcpy(end, &last, sizeof last);
    return 1;
}

/* As cell_told_base, eight values at a time: x, then y, then z is taken where the ray enters the cell and where it leaves it. */
ISOGI_VOL__TARGET("avx2")
ISOGI_VOL__INLINE int isogi_vol__cell_told_avx2(isogi_vol__walk *w, const isogi_vol__leaf *leaf, const int32_t cell[4],
                                                double begin, double end) {
    const uint8_t *code = leaf->code + (cell[0] & 3) + 5 * (cell[1] & 3) + 25 * (cell[2] & 3);
    const __m256d at = _mm256_sub_pd(_mm256_loadu_pd(w->origin), _mm256_cvtepi32_pd(_mm_loadu_si128((const __m128i *)(const void *)cell)));
    const __m256d dir = _mm256_loadu_pd(w->dir), zero = _mm256_setzero_pd(), one = _mm256_set1_pd(1);
    const __m256d in = _mm256_add_pd(at, _mm256_mul_pd(_mm256_set1_pd(begin), dir));
    const __m256d out = _mm256_add_pd(at, _mm256_mul_pd(_mm256_set1_pd(end), dir));
    const __m128 from = _mm256_cvtpd_ps(_mm256_min_pd(_mm256_max_pd(in, zero), one));
    const __m128 to = _mm256_cvtpd_ps(_mm256_min_pd(_mm256_max_pd(out, zero), one));
    const __m256 ends = _mm256_insertf128_ps(_mm256_castps128_ps256(from), to, 1);
    const __m256 from2 = _mm256_permute2f128_ps(ends, ends, 0x00), to2 = _mm256_permute2f128_ps(ends, ends, 0x11);
    const __m256i even = _mm256_setr_epi32(0, 2, 4, 6, 0, 2, 4, 6), odd = _mm256_setr_epi32(1, 3, 5, 7, 1, 3, 5, 7);
    int16_t pair[4];
    __m256 c, low;
    float f[8];
    memcpy(&pair[0], code, 2), memcpy(&pair[1], code + 5, 2), memcpy(&pair[2], code + 25, 2), memcpy(&pair[3], code + 30, 2);
    c = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_setr_epi16(pair[0], pair[1], pair[2], pair[3], 0, 0, 0, 0)));
    low = _mm256_permutevar8x32_ps(c, even);
    c = _mm256_add_ps(low, _mm256_mul_ps(_mm256_permute_ps(ends, 0x00), _mm256_sub_ps(_mm256_permutevar8x32_ps(c, odd), low)));
    low = _mm256_permute_ps(c, 0x88);
    c = _mm256_add_ps(low, _mm256_mul_ps(_mm256_shuffle_ps(from2, to2, 0x55), _mm256_sub_ps(_mm256_permute_ps(c, 0xdd), low)));
    low = _mm256_permute_ps(c, 0x88);
    c = _mm256_add_ps(low, _mm256_mul_ps(_mm256_shuffle_ps(from2, to2, 0xaa), _mm256_sub_ps(_mm256_permute_ps(c, 0xdd), low)));
    _mm256_storeu_ps(f, c);
    return isogi_vol__told(w, leaf, f);
}

ISOGI_VOL__TRIP(avx2, ISOGI_VOL__TARGET("avx2"))
#endif
#undef ISOGI_VOL__TRIP

static int isogi_vol__ride_on(isogi_vol__ride *r, isogi_hit *hit) {
#ifdef ISOGI_VOL__AVX
    if (r->walk.pyramid->path >= ISOGI_VOL__PATH_AVX2) return isogi_vol__ride_on_avx2(r, hit);
#endif
    return isogi_vol__ride_on_base(r, hit);
}

/* ==== many rays at once ============================================================================================== */

/* A walk is a chain of decisions that no processor can foresee, and waits for each. So ISOGI_VOL__POOL rays go together, in turns of
   three stages, each of which does one thing for eight rays at once:
   - Nodes. Every ray answers one node: which of its 64 children does it pass, and which of those can hold the surface? A ray passes
     child (i,j,k) unless the order in which it meets the planes between children forbids it. Along axes on which the ray falls
     children are counted backwards, so that it meets children in the order of their numbers x + 4y + 16z. Times of planes come from
     the one formula that cells use; the lowest two bits are replaced by the axis, which makes all of them different: a strict order,
     the same for all nodes and levels, hence face by face connected.
   - Cells, in float, from the voxels in the leaf: the Bernstein coefficients with their error bound. Nearly all cells are certainly
     all on the side on which the ray is, and done with.
   - Cells that are not, in double from the volume's own voxels, by the very code that a ray alone runs: what is found, and all its
     bits, do not depend on the stage before.
   What a ray needs next is sent for before the others have their turns, and arrives meanwhile. A processor waits for so few lines at a
   time that all of them at once would hold it up: half of the nodes are sent for at the end of a turn, the others one group after the
   other while the first ones are answered. */
#ifdef ISOGI_VOL__AVX
#ifndef __clang__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized" /* gcc 12 says so of its own undefined vectors */
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wsign-conversion" /* and of masks in its own macros, at -O0 */
#endif
#define ISOGI_VOL__POOL 64
#define ISOGI_VOL__PACKET 16 /* see sixteen rays side by side */

/* Rays of a packet as they go through cells that are counted backwards where they fall, hence upwards along all axes. */
typedef struct __attribute__((aligned(64))) isogi_vol__packet {
    double place[3][ISOGI_VOL__PACKET], way[3][ISOGI_VOL__PACKET];
    __m512 at[3], dir[3], inverse[3], stop; /* the same in float; stop: a little more */
    __m512 enter[3], leave[3];              /* planes of nodes are met at place * inverse - these: nodes are wider than they are */
    float padded;                           /* cells of the root */
    int axis;                               /* on which they are fastest */
} isogi_vol__packet;

/* One number for each ray of the pool. What stays the same all along comes last, behind the levels that are not needed. */
typedef struct __attribute__((aligned(64))) isogi_vol__pool {
    double dir[3][ISOGI_VOL__POOL];
    double inverse[3][ISOGI_VOL__POOL]; /* of dir; huge on axes on which the ray stands still; its sign bit:
                                           children are counted backwards */
    int64_t end[ISOGI_VOL__POOL];       /* of the segment, as a time of a plane, axis 3 */
    uint64_t pending[ISOGI_VOL__POOL];  /* levels above the leaves that have any */
    int64_t level[ISOGI_VOL__POOL];     /* of the node to be answered next; -1: none */
    uint64_t address[ISOGI_VOL__POOL];  /* of that node, or of the leaf whose cells are being looked at */
    int64_t cell[ISOGI_VOL__POOL];      /* x | y << 16 | z << 32 of the last cell of the way; nodes are what its leading digits say */
    int64_t flip[ISOGI_VOL__POOL];      /* child = child counted backwards ^ flip */
    int64_t begin[ISOGI_VOL__POOL];     /* nothing is there before: a time of a plane, axis 3 */
    double step[ISOGI_VOL__POOL];       /* the isovalue in steps of the leaf, for voxels of code + 0.5 */
    int64_t side[ISOGI_VOL__POOL];      /* 1 inside, 0 outside, -1 not known; of these 2 side - 4 while leaving a surface:
                                           only to be looked at in double */
    double stop[ISOGI_VOL__POOL], deflated[ISOGI_VOL__POOL]; /* of the walk; stop: its end */
    uint64_t ray[ISOGI_VOL__POOL];
    union {
        uint64_t mask[ISOGI_VOL__NODE_LEVELS][ISOGI_VOL__POOL]; /* children still to come of the node of each level,
                                                                   counted backwards on falling axes */
        isogi_vol__packet packet; /* which is alone in the pool */
    } of;
    /* the same for all rays of a bundle that begins within the box */
    double origin[3][ISOGI_VOL__POOL], base[ISOGI_VOL__POOL], isovalue[ISOGI_VOL__POOL]; /* of the walk */
    int64_t low[ISOGI_VOL__POOL], beyond[ISOGI_VOL__POOL]; /* what the isovalue can be in 8 bits: low .. beyond - 1 */
    double level_units[ISOGI_VOL__POOL]; /* and unrounded */
    int64_t entry_axis[ISOGI_VOL__POOL];
} isogi_vol__pool;

/* What is known of the field round the cell in which rays begin: by how much it rises at most, a cell along an axis, towards the isovalue
   and beyond. Entry n holds for cells up to n away, by axes and by octants of directions (bit a: falls along axis a). */
#define ISOGI_VOL__CLEARED 3
#define ISOGI_VOL__ROUND (2 * ISOGI_VOL__CLEARED) /* voxels along an axis */
typedef struct __attribute__((aligned(32))) isogi_vol__clearing {
    float rise[ISOGI_VOL__CLEARED][3][8]; /* these in raw voxels */
    double corner[3];   /* of that cell */
    double value, sure; /* the field where the rays begin, relative to the isovalue, negative on their side; what is certainly there */
    int side;           /* theirs; -1: nothing is known */
} isogi_vol__clearing;

/* The way from the root to the leaf in which rays begin. */
typedef struct isogi_vol__descent {
    double origin[3], isovalue, step;
    int64_t cell; /* in which they begin; -1: not prepared */
    int on_surface; /* whether they leave one there */
    const uint8_t *leaf;
    uint64_t held[ISOGI_VOL__NODE_LEVELS]; /* children on the way that can hold the surface, not counted backwards */
    isogi_vol__clearing clearing;
} isogi_vol__descent;

/* The root and its children as one isovalue sees them, for rays that begin anywhere. */
typedef struct isogi_vol__summit {
    double isovalue;
    int low, high;      /* what it can be in 8 bits */
    uint64_t known;     /* children whose own children are known */
    uint64_t of[65][2]; /* of the root's children and, last, of the root: those of their children that reach up to the isovalue, and that
                           reach down to it */
    int ready;
} isogi_vol__summit;

/* What the loops share. */
typedef struct isogi_vol__turn {
    const isogi_pyramid *p;
    __m512i first, parents0, parents1; /* of node level n - 1 at n; first: its address */
    __m512i above;                     /* a cell's digits that children of level n have in common */
    int levels, any;
    int shared;                        /* the rays are a bundle that begins within the box */
    uint64_t choosing;                 /* rays that need their next node, a bit each */
    uint64_t ahead[2];                 /* rays that pass blocks which lie outside altogether, or inside; kept where any hit will do */
    int leaves, doubts;
    uint8_t at_leaf[ISOGI_VOL__POOL + 8], in_doubt[ISOGI_VOL__POOL + 8];
    uint64_t cells;
    isogi_vol__descent descent; /* the last one */
    isogi_vol__summit summit;
} isogi_vol__turn;

/* What is left of 64 children if planes a and b are met in either order: children on the far side of the one that comes later and on
   the near side of the one that comes first are not met. */
#define ISOGI_VOL__BELOW_0(a) (0x1111111111111111u * (uint64_t)((1 << (a)) - 1))
#define ISOGI_VOL__BELOW_1(a) (0x0001000100010001u * (uint64_t)((1 << (4 * (a))) - 1))
#define ISOGI_VOL__BELOW_2(a) (((uint64_t)1 << (16 * (a))) - 1)
#define ISOGI_VOL__FIRST(f, a, s, b) ~(ISOGI_VOL__BELOW_##f(a) & ~ISOGI_VOL__BELOW_##s(b))
#define ISOGI_VOL__LATER(f, a, s, b) ~(~ISOGI_VOL__BELOW_##f(a) & ISOGI_VOL__BELOW_##s(b))
#define ISOGI_VOL__ALL64(x) _mm512_set1_epi64((int64_t)(x))
#define ISOGI_VOL__PAIR(f, a, g, b) ISOGI_VOL__FIRST(f, a, g, b), ISOGI_VOL__LATER(f, a, g, b)
#define ISOGI_VOL__ROW(f, a, g) ISOGI_VOL__PAIR(f, a, g, 1), ISOGI_VOL__PAIR(f, a, g, 2), ISOGI_VOL__PAIR(f, a, g, 3)
#define ISOGI_VOL__ENDS(f) \
    ~ISOGI_VOL__BELOW_##f(1), ISOGI_VOL__BELOW_##f(1), ~ISOGI_VOL__BELOW_##f(2), ISOGI_VOL__BELOW_##f(2), ~ISOGI_VOL__BELOW_##f(3), \
        ISOGI_VOL__BELOW_##f(3)
/* For axes f, g = (x, y), (y, z), (z, x) and planes a, b = 1..3: what is left if a of f comes before b of g, and what if it comes
   later. Then for each plane: if it lies before the entry, and if it lies behind the exit. */
static const uint64_t isogi_vol__orders[72] = {ISOGI_VOL__ROW(0, 1, 1), ISOGI_VOL__ROW(0, 2, 1), ISOGI_VOL__ROW(0, 3, 1),
                                               ISOGI_VOL__ROW(1, 1, 2), ISOGI_VOL__ROW(1, 2, 2), ISOGI_VOL__ROW(1, 3, 2),
                                               ISOGI_VOL__ROW(2, 1, 0), ISOGI_VOL__ROW(2, 2, 0), ISOGI_VOL__ROW(2, 3, 0),
                                               ISOGI_VOL__ENDS(0),      ISOGI_VOL__ENDS(1),      ISOGI_VOL__ENDS(2)};
#undef ISOGI_VOL__PAIR
#undef ISOGI_VOL__ROW
#undef ISOGI_VOL__ENDS

/* Sums and differences that -ffast-math leaves in their order: (cell + step) - origin is right where (cell - origin) + step is not. That
   costs rays 10 % of their speed. */
#ifdef __FAST_MATH__
#define ISOGI_VOL__SUM(a, b) _mm512_add_round_pd(a, b, _MM_FROUND_CUR_DIRECTION)
#define ISOGI_VOL__DIFFERENCE(a, b) _mm512_sub_round_pd(a, b, _MM_FROUND_CUR_DIRECTION)
#else
#define ISOGI_VOL__SUM(a, b) _mm512_add_pd(a, b)
#define ISOGI_VOL__DIFFERENCE(a, b) _mm512_sub_pd(a, b)
#endif

/* Times of a plane as integers, axis in the lowest two bits. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__when(__m512d plane, __m512d origin, __m512d inverse, int axis) {
    const __m512d t = _mm512_max_pd(_mm512_mul_pd(ISOGI_VOL__DIFFERENCE(plane, origin), inverse), _mm512_setzero_pd());
    return _mm512_ternarylogic_epi64(_mm512_castpd_si512(t), ISOGI_VOL__ALL64(~(uint64_t)3), _mm512_set1_epi64(axis), 0xea);
}

/* Where planes that lie before the ray begins are cut off anyway, their times may be negative, and in whatever order. 0 is added, so that
   a plane in which the ray begins comes at 0, not at -0, which would be the earliest of all. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__time_of(__m512d plane, __m512d origin, __m512d inverse, int axis) {
    const __m512i t = _mm512_castpd_si512(_mm512_fmadd_pd(ISOGI_VOL__DIFFERENCE(plane, origin), inverse, _mm512_setzero_pd()));
    return _mm512_ternarylogic_epi64(t, ISOGI_VOL__ALL64(~(uint64_t)3), _mm512_set1_epi64(axis), 0xea);
}

/* Which children of their nodes eight rays pass from `begin` to `end`, in their own order; cell: the nodes' corners. origin and inverse: of
   the rays, `stride` numbers from axis to axis. */
ISOGI_VOL__AVX512 static __m512i isogi_vol__passed(const double *origin, const double *inverse, size_t stride, __m512i begin,
                                                   __m512i end, __m512i level, __m512i cell) {
    /* children measure 4 to the power of level; on axes on which a ray falls planes go from the node's far border downwards */
    const __m512d child = _mm512_castsi512_pd(_mm512_slli_epi64(_mm512_add_epi64(_mm512_add_epi64(level, level), _mm512_set1_epi64(1023)),
                                                                52));
    const __m512d whole = _mm512_mul_pd(child, _mm512_set1_pd(4));
    const __m512i field = _mm512_set1_epi64(0xffff);
    __m512i in, out;
#define ISOGI_VOL__AXIS(a) \
    const __m512d origin##a = _mm512_load_pd(origin + stride * a), inverse##a = _mm512_load_pd(inverse + stride * a); \
    const __m512d corner##a = _mm512_cvtepi64_pd(_mm512_and_si512(_mm512_srli_epi64(cell, 16 * a), field)); \
    const __m512d step##a = _mm512_castsi512_pd(_mm512_ternarylogic_epi64(_mm512_castpd_si512(child), _mm512_castpd_si512(inverse##a), \
        ISOGI_VOL__ALL64((uint64_t)1 << 63), 0xf8)); \
    const __m512d plane##a##0 = _mm512_mask_add_pd(corner##a, _mm512_movepi64_mask(_mm512_castpd_si512(inverse##a)), corner##a, whole); \
    const __m512d plane##a##1 = ISOGI_VOL__SUM(plane##a##0, step##a), plane##a##2 = ISOGI_VOL__SUM(plane##a##1, step##a); \
    const __m512d plane##a##3 = ISOGI_VOL__SUM(plane##a##2, step##a), plane##a##4 = ISOGI_VOL__SUM(plane##a##3, step##a); \
    const __m512i t##a##0 = isogi_vol__time_of(plane##a##0, origin##a, inverse##a, a), \
        t##a##1 = isogi_vol__time_of(plane##a##1, origin##a, inverse##a, a); \
    const __m512i t##a##2 = isogi_vol__time_of(plane##a##2, origin##a, inverse##a, a), \
        t##a##3 = isogi_vol__time_of(plane##a##3, origin##a, inverse##a, a); \
    const __m512i t##a##4 = isogi_vol__time_of(plane##a##4, origin##a, inverse##a, a);
    ISOGI_VOL__AXIS(0)
    ISOGI_VOL__AXIS(1)
    ISOGI_VOL__AXIS(2)
#undef ISOGI_VOL__AXIS
    /* planes behind the origin come before */
    in = _mm512_max_epi64(_mm512_max_epi64(t00, t10), _mm512_max_epi64(t20, begin));
    out = _mm512_min_epi64(_mm512_min_epi64(t04, t14), _mm512_min_epi64(t24, end));
    {
        const uint64_t *order = isogi_vol__orders;
        __m512i all = ISOGI_VOL__ALL64(~(uint64_t)0), other = all;
        __asm__("" : "+r"(order)); /* constants come from memory: put together in registers they would cost as much as all comparisons */
#define ISOGI_VOL__PAIR(f, a, g, b) \
    _mm512_mask_blend_epi64(_mm512_cmplt_epi64_mask(t##f##a, t##g##b), ISOGI_VOL__ALL64(order[18 * f + 6 * (a - 1) + 2 * (b - 1) + 1]), \
                            ISOGI_VOL__ALL64(order[18 * f + 6 * (a - 1) + 2 * (b - 1)]))
#define ISOGI_VOL__KEEP(to, one, two) to = _mm512_ternarylogic_epi64(to, one, two, 0x80)
#define ISOGI_VOL__TWO_ROWS(f, a, g, i, b, j) \
    ISOGI_VOL__KEEP(all, ISOGI_VOL__PAIR(f, a, g, 1), ISOGI_VOL__PAIR(f, a, g, 2)); \
    ISOGI_VOL__KEEP(other, ISOGI_VOL__PAIR(f, a, g, 3), ISOGI_VOL__PAIR(i, b, j, 1)); \
    ISOGI_VOL__KEEP(all, ISOGI_VOL__PAIR(i, b, j, 2), ISOGI_VOL__PAIR(i, b, j, 3));
#define ISOGI_VOL__ENDS(f, a)                                                                                                            \
    all = _mm512_mask_and_epi64(all, _mm512_cmplt_epi64_mask(t##f##a, in), all, ISOGI_VOL__ALL64(order[54 + 6 * f + 2 * (a - 1)]));      \
    other = _mm512_mask_and_epi64(other, _mm512_cmplt_epi64_mask(out, t##f##a), other, \
        ISOGI_VOL__ALL64(order[54 + 6 * f + 2 * (a - 1) + 1]));
        ISOGI_VOL__TWO_ROWS(0, 1, 1, 0, 2, 1) ISOGI_VOL__TWO_ROWS(0, 3, 1, 1, 1, 2) ISOGI_VOL__TWO_ROWS(1, 2, 2, 1, 3, 2)
        ISOGI_VOL__TWO_ROWS(2, 1, 0, 2, 2, 0)
        ISOGI_VOL__KEEP(all, ISOGI_VOL__PAIR(2, 3, 0, 1), ISOGI_VOL__PAIR(2, 3, 0, 2));
        other = _mm512_and_si512(other, ISOGI_VOL__PAIR(2, 3, 0, 3));
        ISOGI_VOL__ENDS(0, 1) ISOGI_VOL__ENDS(0, 2) ISOGI_VOL__ENDS(0, 3)
        ISOGI_VOL__ENDS(1, 1) ISOGI_VOL__ENDS(1, 2) ISOGI_VOL__ENDS(1, 3)
        ISOGI_VOL__ENDS(2, 1) ISOGI_VOL__ENDS(2, 2) ISOGI_VOL__ENDS(2, 3)
#undef ISOGI_VOL__PAIR
#undef ISOGI_VOL__KEEP
#undef ISOGI_VOL__TWO_ROWS
#undef ISOGI_VOL__ENDS
        return _mm512_and_si512(all, other);
    }
}

/* Where all eight corners of cells have their bits set, of 128 bits in two vectors. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__all_corners8(__m512i *low, __m512i *high) {
    __m512i l = *low, h = *high;
    l = _mm512_and_si512(l, _mm512_shrdi_epi64(l, h, 1)), h = _mm512_and_si512(h, _mm512_srli_epi64(h, 1));
    l = _mm512_and_si512(l, _mm512_shrdi_epi64(l, h, 5)), h = _mm512_and_si512(h, _mm512_srli_epi64(h, 5));
    *low = _mm512_and_si512(l, _mm512_shrdi_epi64(l, h, 25)), *high = _mm512_and_si512(h, _mm512_srli_epi64(h, 25));
}

/* Rows of four bits at x + 5y + 25z become x + 4y + 16z: even rows from their own places, odd ones from four bits before. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__pack_cells8(__m512i low, __m512i high) {
    const __m512i even_at = ISOGI_VOL__ALL64(0x150b3c3223190a00), odd_at = ISOGI_VOL__ALL64(0x160c3d33241a0b01);
    __m512i even = _mm512_multishift_epi64_epi8(even_at, low), odd = _mm512_multishift_epi64_epi8(odd_at, low);
    even = _mm512_mask_multishift_epi64_epi8(even, 0xc0c0c0c0c0c0c0c0u, even_at, high);
    odd = _mm512_mask_multishift_epi64_epi8(odd, 0xe0e0e0e0e0e0e0e0u, odd_at, high);
    return _mm512_ternarylogic_epi64(_mm512_set1_epi8(0x0f), even, odd, 0xca);
}

/* Numbers of children with the axes in `flip` counted backwards. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__mirror8(__m512i mask, __m512i flip) {
    const __m512i words = _mm512_set_epi64(0x0e0f0c0d0a0b0809, 0x0607040502030001, 0x0e0f0c0d0a0b0809, 0x0607040502030001,
                                           0x0e0f0c0d0a0b0809, 0x0607040502030001, 0x0e0f0c0d0a0b0809, 0x0607040502030001);
    const __m512i quads = _mm512_set_epi64(0x09080b0a0d0c0f0e, 0x0100030205040706, 0x09080b0a0d0c0f0e, 0x0100030205040706,
                                           0x09080b0a0d0c0f0e, 0x0100030205040706, 0x09080b0a0d0c0f0e, 0x0100030205040706);
    mask = _mm512_mask_mov_epi64(mask, _mm512_test_epi64_mask(flip, _mm512_set1_epi64(3)),
                                 _mm512_gf2p8affine_epi64_epi8(mask, ISOGI_VOL__ALL64(0x0804020180402010), 0));
    mask = _mm512_mask_mov_epi64(mask, _mm512_test_epi64_mask(flip, _mm512_set1_epi64(12)),
                                 _mm512_shuffle_epi8(_mm512_gf2p8affine_epi64_epi8(mask, ISOGI_VOL__ALL64(0x1020408001020408), 0), words));
    return _mm512_mask_mov_epi64(mask, _mm512_test_epi64_mask(flip, _mm512_set1_epi64(48)), _mm512_shuffle_epi8(mask, quads));
}

/* The last four bytes of eight nodes. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m256i isogi_vol__tails8(const uint64_t address[8]) {
    __m256i tail[8];
    int k;
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) {
        int32_t last;
        memcpy(&last, (const char *)(uintptr_t)address[k] + 124, sizeof last);
        tail[k] = _mm256_set1_epi32(last);
    }
#pragma GCC unroll 4
    for (k = 0; k < 8; k += 2) tail[k] = _mm256_blend_epi32(tail[k], tail[k + 1], 0xaa);
    return _mm256_blend_epi32(_mm256_blend_epi32(tail[0], tail[2], 0x0c), _mm256_blend_epi32(tail[4], tail[6], 0xc0), 0xf0);
}

/* Bounds of nodes and voxels of leaves are compared alike, byte by byte, and mean different things: whether the two halves of the node
   are at least `low` (0, 1), and below `beyond` (2, 3), of eight rays. Returns the last four bytes of leaves. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m256i isogi_vol__compare(isogi_vol__pool *s, int i, __mmask8 leaf, uint64_t mask[4][8]) {
    const __m256i tail = _mm256_maskz_mov_epi32(leaf, isogi_vol__tails8(&s->address[i]));
    const __m256 low = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(tail, 8), _mm256_set1_epi32(255)));
    const __m256 high = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(tail, 16), _mm256_set1_epi32(255)));
    const __m256 scale = _mm256_div_ps(_mm256_set1_ps(ISOGI_VOL__CODES), _mm256_sub_ps(_mm256_add_ps(high, _mm256_set1_ps(1)), low));
    const __m256i zero = _mm256_setzero_si256(), most = _mm256_set1_epi32(255);
    __m256 x = _mm256_mul_ps(_mm256_sub_ps(_mm512_cvtpd_ps(_mm512_load_pd(&s->level_units[i])), low), scale);
    __m256i least = _mm512_cvtepi64_epi32(_mm512_load_si512(&s->low[i])), beyond = _mm512_cvtepi64_epi32(_mm512_load_si512(&s->beyond[i]));
    __m256i inside, outside;
    __attribute__((aligned(32))) uint32_t bound[2][8];
    int k;
    x = _mm256_min_ps(_mm256_max_ps(x, _mm256_set1_ps(-2)), _mm256_set1_ps(ISOGI_VOL__ABOVE));
    _mm512_mask_store_pd(&s->step[i], leaf, _mm512_cvtps_pd(_mm256_sub_ps(x, _mm256_set1_ps(0.5f))));
    inside = _mm256_sub_epi32(_mm256_cvttps_epi32(_mm256_add_ps(x, _mm256_set1_ps(3.0625f))), _mm256_set1_epi32(2));
    outside = _mm256_sub_epi32(_mm256_cvttps_epi32(_mm256_add_ps(x, _mm256_set1_ps(2.9375f))), _mm256_set1_epi32(3));
    least = _mm256_mask_mov_epi32(least, leaf, _mm256_min_epi32(_mm256_max_epi32(inside, zero), most));
    beyond = _mm256_mask_mov_epi32(beyond, leaf, _mm256_min_epi32(_mm256_max_epi32(outside, zero), most));
    _mm256_store_si256((__m256i *)(void *)bound[0], _mm256_mullo_epi32(least, _mm256_set1_epi32(0x01010101)));
    _mm256_store_si256((__m256i *)(void *)bound[1], _mm256_mullo_epi32(beyond, _mm256_set1_epi32(0x01010101)));
    __asm__("" : "+m"(bound)); /* bounds come from memory: broadcast from registers they would cost as much as the comparisons */
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) {
        const char *node = (const char *)(uintptr_t)s->address[i + k];
        const __m512i a = _mm512_load_si512((const void *)node), b = _mm512_load_si512((const void *)(node + 64));
        const __m512i l = _mm512_set1_epi32((int)bound[0][k]), h = _mm512_set1_epi32((int)bound[1][k]);
        mask[0][k] = _mm512_cmpge_epu8_mask(a, l), mask[1][k] = _mm512_cmpge_epu8_mask(b, l);
        mask[2][k] = _mm512_cmplt_epu8_mask(a, h), mask[3][k] = _mm512_cmplt_epu8_mask(b, h);
        __asm__("" : "+m"(mask[0][k]), "+m"(mask[1][k]), "+m"(mask[2][k]), "+m"(mask[3][k])); /* clang would gather them in registers */
    }
    return tail;
}

/* Which children can hold the surface. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__marked(const isogi_vol__pool *s, int i, __mmask8 leaf, const uint64_t mask[4][8],
                                                              __m256i tail) {
    __m512i in0, in1, out0, out1, inner;
    in0 = _mm512_load_si512(mask[0]), in1 = _mm512_load_si512(mask[1]), out0 = _mm512_load_si512(mask[2]),
    out1 = _mm512_load_si512(mask[3]);
    inner = _mm512_and_si512(in1, out0); /* largest >= low, least < beyond */
    isogi_vol__all_corners8(&in0, &in1);
    isogi_vol__all_corners8(&out0, &out1);
    in0 = isogi_vol__pack_cells8(_mm512_or_si512(in0, out0), _mm512_or_si512(in1, out1));
    inner = _mm512_mask_andnot_epi64(inner, leaf, in0, ISOGI_VOL__ALL64(~(uint64_t)0));
    if (ISOGI_VOL__UNLIKELY(_mm256_movemask_epi8(_mm256_cmpgt_epi32(_mm256_srli_epi32(tail, 24), _mm256_setzero_si256())))) {
        /* leaves that reach beyond the volume */
        const __m512i cut = _mm512_cvtepu32_epi64(_mm256_srli_epi32(tail, 24)), three = _mm512_set1_epi64(3);
#define ISOGI_VOL__CUT(a) _mm512_setr_epi64(-1, (int64_t)ISOGI_VOL__BELOW_##a(3), (int64_t)ISOGI_VOL__BELOW_##a(2), \
    (int64_t)ISOGI_VOL__BELOW_##a(1), -1, -1, -1, -1)
        inner = _mm512_and_si512(inner, _mm512_permutexvar_epi64(_mm512_and_si512(cut, three), ISOGI_VOL__CUT(0)));
        inner = _mm512_and_si512(inner, _mm512_permutexvar_epi64(_mm512_and_si512(_mm512_srli_epi64(cut, 2), three), ISOGI_VOL__CUT(1)));
        inner = _mm512_and_si512(inner, _mm512_permutexvar_epi64(_mm512_and_si512(_mm512_srli_epi64(cut, 4), three), ISOGI_VOL__CUT(2)));
#undef ISOGI_VOL__CUT
    }
    return isogi_vol__mirror8(inner, _mm512_load_si512(&s->flip[i]));
}

/* Where any hit will do: which rays pass children, other than cells, that lie inside or outside altogether. Children beyond the volume are
   neither, but where the isovalue is among the least of codes: nothing is then said. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__look_ahead(isogi_vol__turn *turn, const isogi_vol__pool *s, int i, __mmask8 rays,
                                                               const uint64_t mask[4][8], __m512i passed) {
    const __m512i inside = _mm512_load_si512(mask[1]), outside = _mm512_load_si512(mask[2]); /* largest >= low, least < beyond */
    const __m512i low = _mm512_load_si512(&s->low[i]);
    passed = isogi_vol__mirror8(passed, _mm512_load_si512(&s->flip[i]));
    turn->ahead[0] |= (uint64_t)_mm512_mask_test_epi64_mask(rays, passed, _mm512_andnot_si512(inside, outside)) << i;
    turn->ahead[1] |= (uint64_t)_mm512_mask_test_epi64_mask(_mm512_mask_test_epi64_mask(rays, low, low), passed,
                                                            _mm512_andnot_si512(outside, inside)) << i;
}

/* Rays that cross the surface somewhere: the field is continuous, and they come to both of its sides. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE unsigned isogi_vol__between(const isogi_vol__turn *turn, const isogi_vol__pool *s, int i) {
    const __m512i side = _mm512_load_si512(&s->side[i]);
    const unsigned outside = _mm512_testn_epi64_mask(side, side), inside = _mm512_cmpeq_epi64_mask(side, _mm512_set1_epi64(1));
    return (outside | (unsigned)(turn->ahead[0] >> i)) & (inside | (unsigned)(turn->ahead[1] >> i)) & 255;
}

/* Answers the nodes of the rays from slot i on. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__answer(isogi_vol__turn *turn, isogi_vol__pool *s, int i) {
    const __m512i level = _mm512_load_si512(&s->level[i]), zero = _mm512_setzero_si512();
    const __mmask8 lives = _mm512_cmpge_epi64_mask(level, zero), leaf = _mm512_cmpeq_epi64_mask(level, zero);
    __attribute__((aligned(64))) uint64_t mask[4][8];
    const __m256i tail = isogi_vol__compare(s, i, leaf, mask);
    /* meanwhile the masks get to where they can be read as vectors */
    const __m512i passed = isogi_vol__passed(&s->origin[0][i], &s->inverse[0][i], ISOGI_VOL__POOL, _mm512_load_si512(&s->begin[i]),
                                             _mm512_load_si512(&s->end[i]), level, _mm512_load_si512(&s->cell[i]));
    const __m512i marked = _mm512_maskz_and_epi64(lives, passed, isogi_vol__marked(s, i, leaf, (const uint64_t(*)[8])mask, tail));
    if (turn->any) isogi_vol__look_ahead(turn, s, i, (__mmask8)(lives & ~leaf), (const uint64_t(*)[8])mask, passed);
    const __mmask8 some = _mm512_test_epi64_mask(marked, marked);
    const unsigned cells = (unsigned)(some & leaf);
    int n;
#pragma GCC unroll 8
    for (n = 0; n < turn->levels; n++)
        _mm512_mask_store_epi64(s->of.mask[n] + i, _mm512_cmpeq_epi64_mask(level, _mm512_set1_epi64(n)), marked);
    _mm512_store_si512(&s->pending[i],
                       _mm512_mask_or_epi64(_mm512_load_si512(&s->pending[i]), (__mmask8)(some & ~leaf), _mm512_load_si512(&s->pending[i]),
                                            _mm512_sllv_epi64(_mm512_set1_epi64(1), level)));
    turn->choosing |= (uint64_t)(lives & ~cells) << i;
    _mm512_store_si512(&s->level[i], _mm512_set1_epi64(-1));
    _mm_storel_epi64(
        (__m128i *)(void *)(turn->at_leaf + turn->leaves),
        _mm_maskz_compress_epi8((__mmask16)cells, _mm_add_epi8(_mm_set1_epi8((char)i), _mm_set_epi64x(0, 0x0706050403020100))));
    turn->leaves += __builtin_popcount(cells);
}

/* The number, not counted backwards, of the first child of masks; without any: above 63. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__first_child8(__m512i mask, __m512i flip) {
    return _mm512_xor_si512(_mm512_popcnt_epi64(_mm512_andnot_si512(mask, _mm512_sub_epi64(mask, _mm512_set1_epi64(1)))), flip);
}

/* The digits x | y << 16 | z << 32 of children's numbers. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__digits8(__m512i child) {
    return _mm512_and_si512(_mm512_multishift_epi64_epi8(ISOGI_VOL__ALL64(0x2020200420022000), child), ISOGI_VOL__ALL64(0x000300030003));
}

/* Takes the next child of the lowest level that has any; returns the rays that have none left. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE unsigned isogi_vol__choose(const isogi_vol__turn *turn, isogi_vol__pool *s, int i, __mmask8 choosing) {
    const __m512i one = _mm512_set1_epi64(1);
    __m512i pending = _mm512_load_si512(&s->pending[i]), mask = _mm512_setzero_si512(), cell = _mm512_load_si512(&s->cell[i]);
    const __mmask8 some = _mm512_mask_test_epi64_mask(choosing, pending, pending);
    const __m512i n = _mm512_popcnt_epi64(_mm512_andnot_si512(pending, _mm512_sub_epi64(pending, one))), shift = _mm512_add_epi64(n, n);
    __m512i rest, child, address;
    int k;
#pragma GCC unroll 8
    for (k = 1; k < turn->levels; k++)
        mask = _mm512_mask_load_epi64(mask, _mm512_cmpeq_epi64_mask(n, _mm512_set1_epi64(k)), s->of.mask[k] + i);
    rest = _mm512_and_si512(mask, _mm512_sub_epi64(mask, one));
#pragma GCC unroll 8
    for (k = 1; k < turn->levels; k++)
        _mm512_mask_store_epi64(s->of.mask[k] + i, _mm512_mask_cmpeq_epi64_mask(some, n, _mm512_set1_epi64(k)), rest);
    child = isogi_vol__first_child8(mask, _mm512_load_si512(&s->flip[i]));
    pending =
        _mm512_mask_and_epi64(pending, (__mmask8)(some & _mm512_testn_epi64_mask(rest, rest)), pending, _mm512_sub_epi64(pending, one));
    _mm512_store_si512(&s->pending[i], pending);
    /* the cell's digits above the child's, then the child's */
    {
        const __m512i ffff = _mm512_set1_epi64(0xffff), parent = _mm512_add_epi64(shift, _mm512_set1_epi64(2));
        __m512i x, y, z;
        cell = _mm512_and_si512(cell, _mm512_permutexvar_epi64(n, turn->above));
        x = _mm512_and_si512(_mm512_srlv_epi64(cell, parent), ffff);
        y = _mm512_and_si512(_mm512_srlv_epi64(cell, _mm512_add_epi64(parent, _mm512_set1_epi64(16))), ffff);
        z = _mm512_srlv_epi64(cell, _mm512_add_epi64(parent, _mm512_set1_epi64(32)));
        address = _mm512_add_epi64(y, _mm512_mul_epu32(z, _mm512_permutexvar_epi64(n, turn->parents1)));
        address = _mm512_add_epi64(x, _mm512_mul_epu32(address, _mm512_permutexvar_epi64(n, turn->parents0)));
        address = _mm512_add_epi64(_mm512_slli_epi64(address, 13), _mm512_slli_epi64(child, 7));
        address = _mm512_add_epi64(address, _mm512_permutexvar_epi64(n, turn->first));
        cell = _mm512_or_si512(cell, _mm512_sllv_epi64(isogi_vol__digits8(child), shift));
    }
    _mm512_mask_store_epi64(&s->cell[i], some, cell);
    _mm512_mask_store_epi64(&s->level[i], some, _mm512_sub_epi64(n, one));
    /* whole, so that it can be read at once */
    _mm512_store_si512(&s->address[i], _mm512_mask_mov_epi64(_mm512_load_si512(&s->address[i]), some, address));
    return (unsigned)(choosing & ~some);
}

/* Sends for the nodes of the rays from slot i on, with no haste: a loop takes less time here than its rounds one after the other. */
ISOGI_VOL__INLINE void isogi_vol__send_for_nodes(const isogi_vol__pool *s, int i) {
    int k;
    for (k = 0; k < 8; k++) {
        const char *node = (const char *)(uintptr_t)s->address[i + k];
        _mm_prefetch(node, _MM_HINT_T0), _mm_prefetch(node + 64, _MM_HINT_T0);
    }
}

/* Places of eight slots in a pool's first row, and eight numbers from there by plain loads, which take half the time of a gather on
   processors that make many steps of one (Zen 4). */
typedef struct isogi_vol__spots { char *at[8]; } isogi_vol__spots;

ISOGI_VOL__INLINE isogi_vol__spots isogi_vol__spots8(isogi_vol__pool *s, const uint8_t *seats) {
    isogi_vol__spots spots;
    int k;
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) spots.at[k] = (char *)s + 8 * (size_t)seats[k];
    return spots;
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m256i isogi_vol__load_each(const void *at) {
    int64_t value;
    __m256i each;
    memcpy(&value, at, sizeof value);
    each = _mm256_set1_epi64x(value);
    __asm__("" : "+x"(each)); /* clang would make a shuffle of two of them again */
    return each;
}

/* Loads that repeat a number need no shuffle, and any port blends. Strides may be negative: as offsets they wrap round. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m256i isogi_vol__load_four(const char *const *at, size_t offset) {
#define ISOGI_VOL__EACH(k) isogi_vol__load_each((const void *)((uintptr_t)at[k] + offset))
    const __m256i low = _mm256_blend_epi32(ISOGI_VOL__EACH(0), ISOGI_VOL__EACH(1), 0xcc);
    const __m256i high = _mm256_blend_epi32(ISOGI_VOL__EACH(2), ISOGI_VOL__EACH(3), 0xcc);
#undef ISOGI_VOL__EACH
    return _mm256_blend_epi32(low, high, 0xf0);
}

/* Numbers of eight bytes at eight places. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__load_eight(const char *const at[8], size_t offset) {
    const __m256i low = isogi_vol__load_four(at, offset), high = isogi_vol__load_four(at + 4, offset);
    return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__load_one(const void *at) {
    int64_t value;
    memcpy(&value, at, sizeof value);
    return _mm512_set1_epi64(value);
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__pick8(const isogi_vol__spots *spots, size_t row) {
    return isogi_vol__load_eight((const char *const *)spots->at, row);
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__put8(const isogi_vol__spots *spots, size_t row, __m512i value) {
    int k;
#pragma GCC unroll 4
    for (k = 0; k < 4; k++) {
        const __m128i two = k == 0   ? _mm512_castsi512_si128(value)
                            : k == 1 ? _mm512_extracti64x2_epi64(value, 1)
                            : k == 2 ? _mm512_extracti64x2_epi64(value, 2)
                                     : _mm512_extracti64x2_epi64(value, 3);
        _mm_storel_epi64((__m128i *)(void *)(spots->at[2 * k] + row), two);
        _mm_storeh_pi((__m64 *)(void *)(spots->at[2 * k + 1] + row), _mm_castsi128_ps(two));
    }
}

/* Where a row of the pool begins. */
#define ISOGI_VOL__ROW_OF(member) ((size_t)((const char *)(s->member) - (const char *)s))

/* The slots of a list as numbers; beyond its end there are others, or 0. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__slots8(const uint8_t *seats) {
    return _mm512_cvtepu8_epi64(_mm_loadl_epi64((const __m128i *)(const void *)seats));
}

/* One lane of eight corners after the other, of x, then y, then z, at the begin and end of the way through the cell. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m256 isogi_vol__mix8(__m256 a, __m256 b, __m256 u) {
    return _mm256_fmadd_ps(u, _mm256_sub_ps(b, a), a);
}

/* Cells as x | y << 16 | z << 32, the times at which rays enter and leave them (rounded down to the axis, whose number they carry), and
   where in the cell that is. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__way8(__m512i cell, const __m512d origin[3], const __m512d inverse[3],
                                                         const __m512d dir[3], __m512i *begin, __m512i *end, __m256 from[3], __m256 to[3]) {
    const __m256 zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1);
    __m512d local[3], t0, t1;
    int a;
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        const __m512d at = _mm512_cvtepi64_pd(_mm512_and_si512(_mm512_srli_epi64(cell, (unsigned)(16 * a)), _mm512_set1_epi64(0xffff)));
        const __m512d next = _mm512_add_pd(at, _mm512_set1_pd(1));
        const __mmask8 fall = _mm512_movepi64_mask(_mm512_castpd_si512(inverse[a]));
        *begin = _mm512_max_epi64(*begin, isogi_vol__when(_mm512_mask_mov_pd(at, fall, next), origin[a], inverse[a], a));
        *end = _mm512_min_epi64(*end, isogi_vol__when(_mm512_mask_mov_pd(next, fall, at), origin[a], inverse[a], a));
        local[a] = _mm512_sub_pd(origin[a], at);
    }
    /* an axis alone is a denormal number, on which processors spend a hundred cycles */
    t0 = _mm512_castsi512_pd(_mm512_andnot_si512(_mm512_set1_epi64(3), *begin)), t1 = _mm512_castsi512_pd(*end);
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        from[a] = _mm256_min_ps(_mm256_max_ps(_mm512_cvtpd_ps(_mm512_fmadd_pd(t0, dir[a], local[a])), zero), one);
        to[a] = _mm256_min_ps(_mm256_max_ps(_mm512_cvtpd_ps(_mm512_fmadd_pd(t1, dir[a], local[a])), zero), one);
    }
}

/* What is certain of cells: that the ray is inside all along, or outside; that it is so where the way begins, and where it ends. */
typedef struct isogi_vol__sides { __mmask8 in, out, in0, out0, in1, out1; } isogi_vol__sides;

/* By the hull of Bernstein coefficients in float. corners: bytes of the leaf, eight cells' lowest ones, then those of corner 1, and so on;
   step: the isovalue. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE isogi_vol__sides isogi_vol__sides8(__m512i corners, __m256 step, const __m256 from[3],
                                                                       const __m256 to[3]) {
    const __m256 low = _mm256_sub_ps(step, _mm256_set1_ps(ISOGI_VOL__DOUBT)), high = _mm256_add_ps(step, _mm256_set1_ps(ISOGI_VOL__DOUBT));
    const __m256 third_low = _mm256_mul_ps(low, _mm256_set1_ps(3)), third_high = _mm256_mul_ps(high, _mm256_set1_ps(3));
    __m256 x[2][4], f[2][2][2], sum1, sum2;
    isogi_vol__sides sides;
    int k, e;
#pragma GCC unroll 8
    for (k = 0; k < 4; k++) {
        const __m512 pair =
            _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(k == 0   ? _mm512_castsi512_si128(corners)
                                                    : k == 1 ? _mm512_extracti32x4_epi32(corners, 1)
                                                    : k == 2 ? _mm512_extracti32x4_epi32(corners, 2)
                                                             : _mm512_extracti32x4_epi32(corners, 3)));
        const __m256 a = _mm512_castps512_ps256(pair), b = _mm512_extractf32x8_ps(pair, 1);
        x[0][k] = isogi_vol__mix8(a, b, from[0]), x[1][k] = isogi_vol__mix8(a, b, to[0]);
    }
#pragma GCC unroll 8
    for (e = 0; e < 2; e++) {
        const __m256 near0 = isogi_vol__mix8(x[e][0], x[e][1], from[1]), near1 = isogi_vol__mix8(x[e][2], x[e][3], from[1]);
        const __m256 far0 = isogi_vol__mix8(x[e][0], x[e][1], to[1]), far1 = isogi_vol__mix8(x[e][2], x[e][3], to[1]);
        f[e][0][0] = isogi_vol__mix8(near0, near1, from[2]), f[e][0][1] = isogi_vol__mix8(near0, near1, to[2]);
        f[e][1][0] = isogi_vol__mix8(far0, far1, from[2]), f[e][1][1] = isogi_vol__mix8(far0, far1, to[2]);
    }
    sum1 = _mm256_add_ps(f[1][0][0], _mm256_add_ps(f[0][1][0], f[0][0][1])),
    sum2 = _mm256_add_ps(f[0][1][1], _mm256_add_ps(f[1][0][1], f[1][1][0]));
    sides.in0 = _mm256_cmp_ps_mask(f[0][0][0], high, _CMP_GT_OQ), sides.out0 = _mm256_cmp_ps_mask(f[0][0][0], low, _CMP_LT_OQ);
    sides.in1 = _mm256_cmp_ps_mask(f[1][1][1], high, _CMP_GT_OQ), sides.out1 = _mm256_cmp_ps_mask(f[1][1][1], low, _CMP_LT_OQ);
    sides.in = _mm256_mask_cmp_ps_mask((__mmask8)(sides.in0 & sides.in1), _mm256_min_ps(sum1, sum2), third_high, _CMP_GT_OQ);
    sides.out = _mm256_mask_cmp_ps_mask((__mmask8)(sides.out0 & sides.out1), _mm256_max_ps(sum1, sum2), third_low, _CMP_LT_OQ);
    return sides;
}

/* Cells of leaves by their children's numbers: their own numbers, given any cell of the leaf, and where in the leaf their lowest corners
   are. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__cells8(__m512i child, __m512i corner, __m512i *offset) {
    const __m512i three = _mm512_set1_epi64(3);
    const __m512i dx = _mm512_and_si512(child, three), dy = _mm512_and_si512(_mm512_srli_epi64(child, 2), three),
                  dz = _mm512_and_si512(_mm512_srli_epi64(child, 4), three);
    *offset = _mm512_add_epi64(_mm512_mul_epu32(dy, _mm512_set1_epi64(5)), _mm512_mul_epu32(dz, _mm512_set1_epi64(25)));
    *offset = _mm512_add_epi64(*offset, dx);
    return _mm512_or_si512(_mm512_and_si512(corner, _mm512_set1_epi64(0xfffcfffcfffc)),
                           _mm512_or_si512(dx, _mm512_or_si512(_mm512_slli_epi64(dy, 16), _mm512_slli_epi64(dz, 32))));
}

/* Bytes of the corners of one cell of each of eight leaves, as sides8 takes them; offset: of the cells' lowest corners in their leaves. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__corners_of8(const isogi_vol__spots *spots, size_t row, __m512i offset) {
    __attribute__((aligned(64))) uint64_t address[8];
    const char *at[8];
    int k;
    _mm512_store_si512(address, _mm512_add_epi64(isogi_vol__pick8(spots, row), offset));
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) at[k] = (const char *)(uintptr_t)address[k];
    return _mm512_permutex2var_epi8(isogi_vol__load_eight(at, 0),
                                    _mm512_add_epi8(_mm512_set1_epi64(0x3830282018100800),
                                                    _mm512_setr_epi64(0, 0x0101010101010101, 0x0505050505050505, 0x0606060606060606,
                                                                      0x4040404040404040, 0x4141414141414141, 0x4545454545454545,
                                                                      0x4646464646464646)),
                                    isogi_vol__load_eight(at, 25));
}

/* The next cells of up to eight rays, in float. Rays that are certainly on one side all along are done with theirs; the others are in
   doubt, and hits are among them. `any`: certain hits are reported at once instead; returns them. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE unsigned isogi_vol__look(isogi_vol__turn *turn, isogi_vol__pool *s, const uint8_t *seats, int count,
                                                             int *again) {
    const __mmask8 lanes = (__mmask8)((1u << count) - 1);
    const __m512i slot = isogi_vol__slots8(seats);
#define ISOGI_VOL__TAKE(member) isogi_vol__pick8(&spots, ISOGI_VOL__ROW_OF(member))
#define ISOGI_VOL__TAKE_REAL(member) _mm512_castsi512_pd(ISOGI_VOL__TAKE(member))
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    const __m512i mask = ISOGI_VOL__TAKE(of.mask[0]), below = _mm512_sub_epi64(mask, _mm512_set1_epi64(1)),
                  rest = _mm512_and_si512(mask, below);
    const __m512i child = _mm512_xor_si512(_mm512_popcnt_epi64(_mm512_andnot_si512(mask, below)), ISOGI_VOL__TAKE(flip));
    const __m512i side = ISOGI_VOL__TAKE(side);
    __m512i offset, cell = isogi_vol__cells8(child, ISOGI_VOL__TAKE(cell), &offset);
    __m512i begin = _mm512_set1_epi64(3), end = ISOGI_VOL__TAKE(end);
    __m512d origin[3], inverse[3], dir[3];
    __m256 from[3], to[3];
    isogi_vol__sides sides;
    __mmask8 sure, hit = 0;
    int a;
    if (count == 8) isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(of.mask[0]), rest);
    else _mm512_mask_i64scatter_epi64(s->of.mask[0], lanes, slot, rest, 8);
#pragma GCC unroll 8
    for (a = 0; a < 3; a++)
        inverse[a] = ISOGI_VOL__TAKE_REAL(inverse[a]), dir[a] = ISOGI_VOL__TAKE_REAL(dir[a]),
        origin[a] = turn->shared ? _mm512_set1_pd(s->origin[a][seats[0]]) : ISOGI_VOL__TAKE_REAL(origin[a]);
    isogi_vol__way8(cell, origin, inverse, dir, &begin, &end, from, to);
    sides = isogi_vol__sides8(isogi_vol__corners_of8(&spots, ISOGI_VOL__ROW_OF(address), offset),
                              _mm512_cvtpd_ps(ISOGI_VOL__TAKE_REAL(step)), from, to);
    sides.in = (__mmask8)(sides.in & _mm512_test_epi64_mask(_mm512_set1_epi64(1), side));                  /* 1 or -1 */
    /* 0 or -1 */
    sides.out = (__mmask8)(sides.out & _mm512_testn_epi64_mask(_mm512_add_epi64(side, _mm512_set1_epi64(1)), _mm512_set1_epi64(~1)));
    sure = (__mmask8)((sides.in | sides.out) & lanes);
    if (turn->any) {
        const __mmask8 unknown = _mm512_cmpeq_epi64_mask(side, _mm512_set1_epi64(-1)),
                       was_in = _mm512_cmpeq_epi64_mask(side, _mm512_set1_epi64(1));
        const __mmask8 was_out = _mm512_testn_epi64_mask(side, side);
        hit = (__mmask8)(lanes & ((sides.out1 & (was_in | (unknown & sides.in0))) | (sides.in1 & (was_out | (unknown & sides.out0)))));
        sure = (__mmask8)(sure & ~hit);
    }
    if (count == 8)
        isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(side), _mm512_mask_mov_epi64(side, sure, _mm512_maskz_set1_epi64(sides.in, 1)));
    else _mm512_mask_i64scatter_epi64(s->side, sure, slot, _mm512_maskz_set1_epi64(sides.in, 1), 8);
    {
        const __m512i three = _mm512_set1_epi64(3);
        const __mmask8 more = _mm512_test_epi64_mask(rest, rest), doubt = (__mmask8)(lanes & ~sure & ~hit);
        const __m128i list = _mm_loadl_epi64((const __m128i *)(const void *)seats);
        __m512i bit = _mm512_sllv_epi64(_mm512_set1_epi64(1), slot);
        turn->cells += (uint64_t)count;
        /* which axes it enters and leaves by goes along */
        cell = _mm512_or_si512(cell, _mm512_or_si512(_mm512_slli_epi64(_mm512_and_si512(begin, three), 48),
                                                     _mm512_slli_epi64(_mm512_and_si512(end, three), 50)));
        if (count == 8) isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(cell), cell);
        else _mm512_mask_i64scatter_epi64(s->cell, doubt, slot, cell, 8);
        _mm_storel_epi64((__m128i *)(void *)(turn->at_leaf + *again), _mm_maskz_compress_epi8((__mmask16)(sure & more), list));
        *again += __builtin_popcount((unsigned)(sure & more));
        _mm_storel_epi64((__m128i *)(void *)(turn->in_doubt + turn->doubts), _mm_maskz_compress_epi8((__mmask16)doubt, list));
        turn->doubts += __builtin_popcount(doubt);
        turn->choosing |= (uint64_t)_mm512_mask_reduce_or_epi64((__mmask8)(sure & ~more), bit);
    }
#undef ISOGI_VOL__TAKE
#undef ISOGI_VOL__TAKE_REAL
    return hit;
}

/* Puts a walk that is set up and clipped into a slot; 0: it has to be walked alone. */
static int isogi_vol__seat(isogi_vol__pool *s, int i, const isogi_vol__walk *w) {
    const isogi_pyramid *p = w->pyramid;
    int low, high, a, flip = 0;
    double end = w->end;
    s->level_units[i] = (double)isogi_vol__quantise_isovalue(p, w->isovalue, &low, &high);
    if (!(end > 1e-150) || !(end < 1e150) || low > high) return 0;
    for (a = 0; a < 3; a++) {
        const int still = !(w->dir[a] < 0 || w->dir[a] > 0);
        /* a ray that stands still on an axis keeps below the volume's upper border */
        const int fall = still ? w->origin[a] >= p->cells[a] : w->dir[a] < 0;
        s->origin[a][i] = w->origin[a], s->dir[a][i] = w->dir[a];
        s->inverse[a][i] = still ? fall ? -1e200 : 1e200 : w->inverse[a];
        flip |= fall ? 3 << 2 * a : 0;
    }
    memcpy(&s->end[i], &end, sizeof end);
    s->end[i] |= 3, s->begin[i] = 3;
    s->flip[i] = flip, s->low[i] = low, s->beyond[i] = high + 1;
    s->level[i] = p->node_levels - 1, s->pending[i] = 0, s->cell[i] = 0;
    s->address[i] = (uint64_t)(uintptr_t)p->nodes[p->node_level[p->node_levels - 1].first];
    s->side[i] = w->deflate ? 2 * w->inside - 4 : w->inside;
    s->base[i] = w->base, s->stop[i] = end, s->isovalue[i] = w->isovalue, s->deflated[i] = w->deflated, s->entry_axis[i] = w->entry_axis;
    return 1;
}

/* A cell in doubt, in double; 1: hit. */
ISOGI_VOL__TARGET("avx2") static int isogi_vol__decide(isogi_vol__batch *b, isogi_vol__pool *s, int i, isogi_hit *hit) {
    const int64_t cell = s->cell[i];
    const int in = (int)(cell >> 48 & 3), out = (int)(cell >> 50 & 3);
    isogi_vol__walk w;
    int a, found;
    for (a = 0; a < 3; a++) w.origin[a] = s->origin[a][i], w.dir[a] = s->dir[a][i], w.inverse[a] = s->inverse[a][i];
    w.origin[3] = w.dir[3] = w.inverse[3] = 0;
    w.pyramid = b->pyramid, w.base = s->base[i], w.t = 0, w.end = s->stop[i], w.isovalue = s->isovalue[i];
    w.deflate = s->side[i] < -1, w.inside = w.deflate ? (int)s->side[i] / 2 + 2 : (int)s->side[i], w.deflated = s->deflated[i];
    w.exact = !isogi_vol__any_will_do(b), w.cap = 1, w.end_is_border = 0;
    w.count.cubics = w.count.cells = 0;
    found = isogi_vol__mixed_cell_avx2(&w, (int)(cell & 0xffff), (int)(cell >> 16 & 0xffff), (int)(cell >> 32 & 0xffff),
                                       in == 3 ? (int)s->entry_axis[i] : in, out == 3 ? -1 : out, hit);
    b->work.cubics += w.count.cubics;
    s->side[i] = w.deflate ? 2 * w.inside - 4 : w.inside, s->deflated[i] = w.deflated;
    return found;
}

/* Eight cells in doubt at once: the operations of the code for one, in its order and without contraction, hence its bits. Returns the
   hits; *alone: those that are not an everyday crossing and are left to that code. */
#define ISOGI_VOL__ADD(a, b) _mm512_add_round_pd(a, b, _MM_FROUND_CUR_DIRECTION)
#define ISOGI_VOL__SUB(a, b) _mm512_sub_round_pd(a, b, _MM_FROUND_CUR_DIRECTION)
#define ISOGI_VOL__MUL(a, b) _mm512_mul_round_pd(a, b, _MM_FROUND_CUR_DIRECTION)
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512d isogi_vol__lerp8(__m512d a, __m512d b, __m512d u, __m512d rest) {
    return ISOGI_VOL__ADD(ISOGI_VOL__MUL(rest, a), ISOGI_VOL__MUL(u, b));
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512d isogi_vol__snap8(__m512d at, __m512d slack) {
    const __m512d one = _mm512_set1_pd(1);
    at = _mm512_min_pd(_mm512_max_pd(at, _mm512_setzero_pd()), one);
    at = _mm512_maskz_mov_pd(_mm512_cmp_pd_mask(at, slack, _CMP_NLT_UQ), at);
    return _mm512_mask_mov_pd(at, _mm512_cmp_pd_mask(at, _mm512_sub_pd(one, slack), _CMP_GT_OQ), one);
}

/* What eight rays find in cells: those that stay on their side, that cross the surface, whose cell is not finite, and that are left to the
   code for one; the cell's cubic, where they enter and leave it, and when. */
typedef struct isogi_vol__decision {
    __m512d bezier[4], from[3], to[3], begin, end, base, root;
    __m512i cell;
    __mmask8 same, cross, broken, odd, inside;
} isogi_vol__decision;

/* The roots of everyday cubics: cubic_refine's first loop, for one or two groups of eight, whose steps wait for each other if they go one
   by one. Those that need its second loop are odd. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__refine8(isogi_vol__batch *b, isogi_vol__decision *k, int groups) {
    const __m512d zero = _mm512_setzero_pd(), one = _mm512_set1_pd(1), three = _mm512_set1_pd(3), two = _mm512_set1_pd(2);
    __m512d c1[2], c2[2], c3[2], bend[2], s[2];
    __mmask8 due[2] = {0, 0}, slow[2];
    int i, g;
#pragma GCC unroll 2
    for (g = 0; g < groups; g++) {
        const __m512d *const p = k[g].bezier;
        c1[g] = ISOGI_VOL__MUL(three, ISOGI_VOL__SUB(p[1], p[0]));
        c2[g] = ISOGI_VOL__MUL(three, ISOGI_VOL__ADD(ISOGI_VOL__SUB(p[0], p[1]), ISOGI_VOL__SUB(p[2], p[1])));
        c3[g] = ISOGI_VOL__ADD(ISOGI_VOL__SUB(p[3], p[0]), ISOGI_VOL__MUL(three, ISOGI_VOL__SUB(p[1], p[2])));
        bend[g] = ISOGI_VOL__MUL(_mm512_set1_pd(1e13), ISOGI_VOL__ADD(_mm512_abs_pd(c2[g]), ISOGI_VOL__MUL(three, _mm512_abs_pd(c3[g]))));
        k[g].root = s[g] = _mm512_div_pd(p[0], ISOGI_VOL__SUB(p[0], p[3]));
        slow[g] = (__mmask8)(k[g].cross & (_mm512_cmp_pd_mask(p[0], zero, _CMP_EQ_OQ) | _mm512_cmp_pd_mask(p[3], zero, _CMP_EQ_OQ)));
        due[g] = (__mmask8)(k[g].cross & ~slow[g]);
    }
    for (i = 0; i < 4 && due[0] | due[1]; i++) {
#pragma GCC unroll 2
        for (g = 0; g < groups; g++) {
            const __m512d ss = ISOGI_VOL__MUL(s[g], s[g]);
            const __m512d value = ISOGI_VOL__ADD(ISOGI_VOL__ADD(k[g].bezier[0], ISOGI_VOL__MUL(s[g], c1[g])),
                                                 ISOGI_VOL__MUL(ss, ISOGI_VOL__ADD(c2[g], ISOGI_VOL__MUL(s[g], c3[g]))));
            const __m512d slope = ISOGI_VOL__ADD(ISOGI_VOL__ADD(c1[g], ISOGI_VOL__MUL(ISOGI_VOL__MUL(two, s[g]), c2[g])),
                                                 ISOGI_VOL__MUL(ss, ISOGI_VOL__MUL(three, c3[g])));
            const __m512d step = _mm512_div_pd(value, slope), at = ISOGI_VOL__SUB(s[g], step);
            const __mmask8 back = _mm512_movepi64_mask(_mm512_castpd_si512(_mm512_xor_pd(slope, k[g].bezier[3])));
            const __mmask8 ahead = _mm512_mask_cmp_pd_mask((__mmask8)~back, at, zero, _CMP_GE_OQ);
            const __mmask8 kept = _mm512_mask_cmp_pd_mask(ahead, at, one, _CMP_LE_OQ);
            const __mmask8 done =
                _mm512_cmp_pd_mask(ISOGI_VOL__MUL(ISOGI_VOL__MUL(bend[g], step), step), _mm512_abs_pd(slope), _CMP_LE_OQ);
            slow[g] = (__mmask8)(slow[g] | (due[g] & ~kept));
            due[g] = (__mmask8)(due[g] & kept);
            k[g].root = _mm512_mask_mov_pd(k[g].root, (__mmask8)(due[g] & done), at);
            due[g] = (__mmask8)(due[g] & ~done);
            s[g] = at;
        }
    }
#pragma GCC unroll 2
    for (g = 0; g < groups; g++) {
        slow[g] = (__mmask8)(slow[g] | due[g]);
        b->work.cubics -= (uint64_t)__builtin_popcount(slow[g]);
        k[g].odd = (__mmask8)(k[g].odd | slow[g]), k[g].cross = (__mmask8)(k[g].cross & ~slow[g]);
    }
}

/* Hits of rays that cross; slots: of the eight. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__write8(isogi_vol__batch *b, const isogi_vol__pool *s, const uint8_t *slots,
                                                           const isogi_vol__decision *k) {
    const __m512d one = _mm512_set1_pd(1), rest = _mm512_sub_pd(one, k->root);
    const __m512i field = _mm512_set1_epi64(0xffff), z = _mm512_and_si512(_mm512_srli_epi64(k->cell, 32), field);
    const __m512d t = ISOGI_VOL__ADD(k->base, ISOGI_VOL__ADD(k->begin, ISOGI_VOL__MUL(k->root, ISOGI_VOL__SUB(k->end, k->begin))));
    const __m512d x = isogi_vol__lerp8(k->from[0], k->to[0], k->root, rest), y = isogi_vol__lerp8(k->from[1], k->to[1], k->root, rest);
    const __m512d w = isogi_vol__lerp8(k->from[2], k->to[2], k->root, rest);
    const __m512i side = _mm512_mask_mov_epi64(_mm512_set1_epi64((int64_t)1 << 32), k->inside, _mm512_set1_epi64(-((int64_t)1 << 32)));
    const __m512i low = _mm512_or_si512(_mm512_and_si512(k->cell, field),
                                        _mm512_slli_epi64(_mm512_and_si512(_mm512_srli_epi64(k->cell, 16), field), 32)),
                  high = _mm512_or_si512(z, side);
    __attribute__((aligned(64))) double part[2][3][8]; /* of even lanes, then of odd ones: pairs of eight bytes */
    unsigned lanes;
    _mm512_store_pd(part[0][0], _mm512_unpacklo_pd(t, x)), _mm512_store_pd(part[1][0], _mm512_unpackhi_pd(t, x));
    _mm512_store_pd(part[0][1], _mm512_unpacklo_pd(y, w)), _mm512_store_pd(part[1][1], _mm512_unpackhi_pd(y, w));
    _mm512_store_si512(part[0][2], _mm512_unpacklo_epi64(low, high)), _mm512_store_si512(part[1][2], _mm512_unpackhi_epi64(low, high));
    for (lanes = k->cross; lanes; lanes &= lanes - 1) {
        const int i = __builtin_ctz(lanes);
        isogi_hit *hit = &b->hits[s->ray[slots[i]]];
        double(*from)[8] = part[i & 1];
        _mm_storeu_pd(&hit->t, _mm_load_pd(from[0] + (i & 6))), _mm_storeu_pd(&hit->local[1], _mm_load_pd(from[1] + (i & 6)));
        _mm_storeu_si128((__m128i *)(void *)hit->cell, _mm_load_si128((const __m128i *)(const void *)(from[2] + (i & 6))));
    }
}

/* Corner x + 2y + 4z of eight cells, minus the isovalue. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__corners8(const isogi_pyramid *p, __m512i cell, __mmask8 lanes, __m512d isovalue,
                                                             __m512d c[8]) {
    const isogi_volume *v = &p->volume;
    const __m512i field = _mm512_set1_epi64(0xffff);
    const __m512i x = _mm512_and_si512(cell, field), y = _mm512_and_si512(_mm512_srli_epi64(cell, 16), field),
                  z = _mm512_and_si512(_mm512_srli_epi64(cell, 32), field);
    int k;
    const __m512d scale = _mm512_set1_pd(v->scale), bias = _mm512_set1_pd(v->bias);
    if (v->type == ISOGI_F32 && v->stride[0] == 4) {
        __m512i at = _mm512_add_epi64(_mm512_slli_epi64(x, 2), _mm512_set1_epi64((int64_t)(intptr_t)v->data));
        at = _mm512_add_epi64(at, _mm512_add_epi64(_mm512_mullo_epi64(y, _mm512_set1_epi64(v->stride[1])),
                                                   _mm512_mullo_epi64(z, _mm512_set1_epi64(v->stride[2]))));
        __attribute__((aligned(64))) uint64_t place[8];
        const char *from[8];
        /* lanes without a cell read a voxel pair that there is */
        _mm512_store_si512(place, _mm512_mask_mov_epi64(_mm512_set1_epi64((int64_t)(intptr_t)v->data), lanes, at));
#pragma GCC unroll 8
        for (k = 0; k < 8; k++) from[k] = (const char *)(uintptr_t)place[k];
#pragma GCC unroll 8
        for (k = 0; k < 4; k++) {
            const __m512i pair = isogi_vol__load_eight(from, (size_t)((k & 1 ? v->stride[1] : 0) + (k & 2 ? v->stride[2] : 0)));
            c[2 * k] = _mm512_cvtps_pd(_mm256_castsi256_ps(_mm512_cvtepi64_epi32(pair)));
            c[2 * k + 1] = _mm512_cvtps_pd(_mm256_castsi256_ps(_mm512_cvtepi64_epi32(_mm512_srli_epi64(pair, 32))));
        }
    } else {
        __attribute__((aligned(64))) double corner[8][8];
        __attribute__((aligned(64))) int64_t at[8];
        unsigned left;
        memset(corner, 0, sizeof corner);
        _mm512_store_si512(at, cell);
        for (left = lanes; left; left &= left - 1) {
            const int i = __builtin_ctz(left);
            const char *q = (const char *)v->data + (at[i] & 0xffff) * v->stride[0] + (at[i] >> 16 & 0xffff) * v->stride[1] +
                            (at[i] >> 32 & 0xffff) * v->stride[2];
            double one[8];
            _mm256_storeu_pd(one, isogi_vol__corners4(v, q, v->stride[0], v->stride[1]));
            _mm256_storeu_pd(one + 4, isogi_vol__corners4(v, q + v->stride[2], v->stride[0], v->stride[1]));
#pragma GCC unroll 8
            for (k = 0; k < 8; k++) corner[k][i] = one[k];
        }
#pragma GCC unroll 8
        for (k = 0; k < 8; k++) c[k] = _mm512_load_pd(corner[k]);
    }
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) c[k] = ISOGI_VOL__SUB(ISOGI_VOL__ADD(ISOGI_VOL__MUL(c[k], scale), bias), isovalue);
}

/* Rays that leave a surface and do not come back to it in the same cell: what leave_surface and cubic_deflated find. *inside: the side on
   which they do. passes: those that do not end in the cell. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __mmask8 isogi_vol__left8(const __m512d b[4], const __m512d from[3], const __m512d to[3],
                                                              __m512d steepest, __mmask8 passes, __mmask8 *inside, __mmask8 lanes) {
    const __m512d zero = _mm512_setzero_pd(), three = _mm512_set1_pd(3);
    const __m512d c1 = ISOGI_VOL__MUL(three, ISOGI_VOL__SUB(b[1], b[0]));
    const __m512d c2 = ISOGI_VOL__MUL(three, ISOGI_VOL__ADD(ISOGI_VOL__SUB(b[0], b[1]), ISOGI_VOL__SUB(b[2], b[1])));
    const __m512d c3 = ISOGI_VOL__ADD(ISOGI_VOL__SUB(b[3], b[0]), ISOGI_VOL__MUL(three, ISOGI_VOL__SUB(b[1], b[2])));
    const __m512d half = ISOGI_VOL__ADD(c1, ISOGI_VOL__MUL(_mm512_set1_pd(0.5), c2)), sum = ISOGI_VOL__ADD(ISOGI_VOL__ADD(c1, c2), c3);
    const __m512d length =
        _mm512_max_pd(_mm512_max_pd(_mm512_abs_pd(ISOGI_VOL__SUB(to[0], from[0])), _mm512_abs_pd(ISOGI_VOL__SUB(to[1], from[1]))),
                      _mm512_abs_pd(ISOGI_VOL__SUB(to[2], from[2])));
    const __m512d reach = _mm512_max_pd(_mm512_max_pd(_mm512_abs_pd(ISOGI_VOL__SUB(b[1], b[0])), _mm512_abs_pd(ISOGI_VOL__SUB(b[2], b[0]))),
                                        _mm512_abs_pd(ISOGI_VOL__SUB(b[3], b[0])));
    const __mmask8 stays = (__mmask8)(passes & (_mm512_cmp_pd_mask(length, _mm512_set1_pd(ISOGI_VOL__ON_SURFACE), _CMP_LT_OQ) |
                                                _mm512_cmp_pd_mask(reach, ISOGI_VOL__MUL(_mm512_set1_pd(1e-12), steepest), _CMP_LT_OQ)));
    const __mmask8 rises = _mm512_mask_cmp_pd_mask(
        _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(c1, zero, _CMP_GT_OQ), half, zero, _CMP_GT_OQ), sum, zero, _CMP_GT_OQ);
    const __mmask8 falls = _mm512_mask_cmp_pd_mask(
        _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(c1, zero, _CMP_LT_OQ), half, zero, _CMP_LT_OQ), sum, zero, _CMP_LT_OQ);
    *inside = (__mmask8)((*inside & ~lanes) | (rises & lanes));
    return (__mmask8)(lanes & (rises | falls) & ~stays & _mm512_cmp_pd_mask(b[3], zero, _CMP_NEQ_OQ));
}

/* row: the slots are eight in a row; cell, side: of them. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__decide_some(isogi_vol__batch *b, isogi_vol__pool *s, const uint8_t *seats, int row,
                                                                __mmask8 lanes, __m512i cell, __m512i side, isogi_vol__decision *d) {
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    char *const begins = spots.at[0];
#define ISOGI_VOL__TAKE(member) \
    (row ? _mm512_load_si512(begins + ISOGI_VOL__ROW_OF(member)) : isogi_vol__pick8(&spots, ISOGI_VOL__ROW_OF(member)))
#define ISOGI_VOL__TAKE_REAL(member) _mm512_castsi512_pd(ISOGI_VOL__TAKE(member))
    const __m512i three = _mm512_set1_epi64(3);
    const __m512i in = _mm512_and_si512(_mm512_srli_epi64(cell, 48), three), out = _mm512_and_si512(_mm512_srli_epi64(cell, 50), three);
    const __m512d zero = _mm512_setzero_pd(), one = _mm512_set1_pd(1), stop = ISOGI_VOL__TAKE_REAL(stop);
    /* rays that leave a surface, which most do without coming back to it in the same cell; a ray's first cell behind a border of the
       volume, and a second one next to the surface, are matters for themselves */
    const __mmask8 first = _mm512_cmpeq_epi64_mask(in, three), starts = _mm512_cmplt_epi64_mask(side, _mm512_set1_epi64(-1)),
                   leaving = (__mmask8)(starts & first & lanes);
    __mmask8 odd = (__mmask8)((starts & ~first) | _mm512_mask_cmpge_epi64_mask(first, ISOGI_VOL__TAKE(entry_axis), _mm512_setzero_si512())),
             low, high, b_low, b_high, inside, same, cross, broken;
    __mmask8 left = 0;
    const __m512d base = ISOGI_VOL__TAKE_REAL(base);
    __m512d c[8], from[3], to[3], bezier[4], begin = zero, end = stop, steepest = zero;
    int a;
    isogi_vol__corners8(b->pyramid, cell, lanes, ISOGI_VOL__TAKE_REAL(isovalue), c);
    {
        __m512d origin[3], dir[3], at[3];
        __mmask8 fall[3];
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            const __mmask8 enters = _mm512_cmpeq_epi64_mask(in, _mm512_set1_epi64(a)),
                           leaves = _mm512_cmpeq_epi64_mask(out, _mm512_set1_epi64(a));
            const __m512d inverse = ISOGI_VOL__TAKE_REAL(inverse[a]);
            origin[a] = ISOGI_VOL__TAKE_REAL(origin[a]), dir[a] = ISOGI_VOL__TAKE_REAL(dir[a]);
            at[a] = _mm512_cvtepi64_pd(_mm512_and_si512(_mm512_srli_epi64(cell, (unsigned)(16 * a)), _mm512_set1_epi64(0xffff)));
            fall[a] = _mm512_movepi64_mask(_mm512_castpd_si512(inverse));
            begin = _mm512_mask_mul_pd(begin, enters, _mm512_sub_pd(_mm512_mask_add_pd(at[a], fall[a], at[a], one), origin[a]), inverse);
            end = _mm512_mask_mul_pd(end, leaves, _mm512_sub_pd(_mm512_mask_add_pd(at[a], (__mmask8)~fall[a], at[a], one), origin[a]),
                                     inverse);
        }
        begin = _mm512_max_pd(begin, zero), end = _mm512_max_pd(_mm512_min_pd(end, stop), begin);
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            const __mmask8 enters = _mm512_cmpeq_epi64_mask(in, _mm512_set1_epi64(a)),
                           leaves = _mm512_cmpeq_epi64_mask(out, _mm512_set1_epi64(a));
            const __m512d way = _mm512_abs_pd(ISOGI_VOL__MUL(base, dir[a]));
            const __m512d slack =
                ISOGI_VOL__MUL(_mm512_set1_pd(ISOGI_VOL__ROUNDING), ISOGI_VOL__ADD(way, _mm512_set1_pd(b->pyramid->box[a])));
            from[a] = ISOGI_VOL__SUB(ISOGI_VOL__ADD(origin[a], ISOGI_VOL__MUL(begin, dir[a])), at[a]);
            to[a] = ISOGI_VOL__SUB(ISOGI_VOL__ADD(origin[a], ISOGI_VOL__MUL(end, dir[a])), at[a]);
            from[a] = isogi_vol__snap8(from[a], slack), to[a] = isogi_vol__snap8(to[a], slack);
            from[a] = _mm512_mask_mov_pd(from[a], enters, _mm512_maskz_mov_pd(fall[a], one));
            to[a] = _mm512_mask_mov_pd(to[a], leaves, _mm512_maskz_mov_pd((__mmask8)~fall[a], one));
        }
    }
    {
        const __m512d rest0[3] = {_mm512_sub_pd(one, from[0]), _mm512_sub_pd(one, from[1]), _mm512_sub_pd(one, from[2])};
        const __m512d rest1[3] = {_mm512_sub_pd(one, to[0]), _mm512_sub_pd(one, to[1]), _mm512_sub_pd(one, to[2])},
                      third = _mm512_set1_pd(1.0 / 3);
        __m512d x[2][4], f[2][2][2]; /* [x][y][z] taken at its end */
        int k;
        low = high = 0xff;
#pragma GCC unroll 8
        for (k = 0; k < 8; k++) {
            const __mmask8 least = _mm512_cmp_pd_mask(c[k], zero, _CMP_GE_OQ);
            high &= least, low = (__mmask8)(low & ~least);
            steepest = _mm512_max_pd(steepest, _mm512_abs_pd(c[k]));
        }
        odd = (__mmask8)(odd | high | low);
#pragma GCC unroll 8
        for (k = 0; k < 4; k++)
            x[0][k] = isogi_vol__lerp8(c[2 * k], c[2 * k + 1], from[0], rest0[0]),
            x[1][k] = isogi_vol__lerp8(c[2 * k], c[2 * k + 1], to[0], rest1[0]);
#pragma GCC unroll 8
        for (k = 0; k < 2; k++) {
            const __m512d near0 = isogi_vol__lerp8(x[k][0], x[k][1], from[1], rest0[1]),
                          near1 = isogi_vol__lerp8(x[k][2], x[k][3], from[1], rest0[1]);
            const __m512d far0 = isogi_vol__lerp8(x[k][0], x[k][1], to[1], rest1[1]),
                          far1 = isogi_vol__lerp8(x[k][2], x[k][3], to[1], rest1[1]);
            f[k][0][0] = isogi_vol__lerp8(near0, near1, from[2], rest0[2]), f[k][0][1] = isogi_vol__lerp8(near0, near1, to[2], rest1[2]);
            f[k][1][0] = isogi_vol__lerp8(far0, far1, from[2], rest0[2]), f[k][1][1] = isogi_vol__lerp8(far0, far1, to[2], rest1[2]);
        }
        bezier[0] = f[0][0][0], bezier[3] = f[1][1][1];
        bezier[1] = ISOGI_VOL__MUL(ISOGI_VOL__ADD(ISOGI_VOL__ADD(f[1][0][0], f[0][1][0]), f[0][0][1]), third);
        bezier[2] = ISOGI_VOL__MUL(ISOGI_VOL__ADD(ISOGI_VOL__ADD(f[0][1][1], f[1][0][1]), f[1][1][0]), third);
#pragma GCC unroll 8
        for (k = 1, b_low = b_high = 0; k < 3; k++) {
            const __mmask8 least = _mm512_cmp_pd_mask(bezier[k], zero, _CMP_GE_OQ);
            if (k == 1) b_low = least;
            else b_high = least;
        }
    }
    {
        const __m512d most = _mm512_max_pd(_mm512_max_pd(_mm512_abs_pd(bezier[0]), _mm512_abs_pd(bezier[1])),
                                           _mm512_max_pd(_mm512_abs_pd(bezier[2]), _mm512_abs_pd(bezier[3])));
        const __mmask8 plain =
            _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(most, _mm512_set1_pd(1e-100), _CMP_GT_OQ), most, _mm512_set1_pd(1e100), _CMP_LT_OQ);
        const __mmask8 last = _mm512_cmp_pd_mask(bezier[3], zero, _CMP_GE_OQ),
                       known = _mm512_cmpge_epi64_mask(side, _mm512_setzero_si512());
        inside = _mm512_cmp_pd_mask(bezier[0], zero, _CMP_GE_OQ);
        odd = (__mmask8)(odd | ~plain | (known & (inside ^ _mm512_test_epi64_mask(side, side))));
        if (leaving) {
            left = (__mmask8)(isogi_vol__left8(bezier, from, to, steepest, _mm512_cmpneq_epi64_mask(out, three), &inside, leaving) & ~odd);
            /* and not those that go onward and would have changed sides */
            left = (__mmask8)(left & ~(_mm512_mask_cmpeq_epi64_mask(inside, side, _mm512_set1_epi64(-4)) |
                                       _mm512_mask_cmpeq_epi64_mask((__mmask8)~inside, side, _mm512_set1_epi64(-2))));
            odd = (__mmask8)(odd | (leaving & ~left));
        }
        same = (__mmask8) ~((inside ^ b_low) | (inside ^ b_high) | (inside ^ last));
        cross = (__mmask8)((inside ^ last) & (~(inside ^ b_low) | (inside ^ b_high)));
        same = (__mmask8)(same & ~leaving), cross = (__mmask8)(cross & ~leaving);
        odd = (__mmask8)((odd | ~(same | cross | left)) & lanes);
        /* of a corner that is not finite no coefficient is */
        broken = _mm512_mask_cmp_pd_mask(lanes, most, _mm512_set1_pd(DBL_MAX), _CMP_NLE_UQ), odd = (__mmask8)(odd & ~broken);
        cross = (__mmask8)(cross & lanes & ~(odd | broken)), same = (__mmask8)(((same & lanes & ~odd) | left) & ~broken);
    }
    b->work.cubics += (uint64_t)__builtin_popcount((unsigned)(same | cross));
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) d->from[a] = from[a], d->to[a] = to[a];
#pragma GCC unroll 4
    for (a = 0; a < 4; a++) d->bezier[a] = bezier[a];
    d->begin = begin, d->end = end, d->base = base, d->cell = cell;
    d->same = same, d->cross = cross, d->broken = broken, d->odd = odd, d->inside = inside;
#undef ISOGI_VOL__TAKE
#undef ISOGI_VOL__TAKE_REAL
}

ISOGI_VOL__AVX512 static unsigned isogi_vol__decide8(isogi_vol__batch *b, isogi_vol__pool *s, const uint8_t *seats, unsigned some,
                                                     unsigned *alone) {
    const __m128i list = _mm_loadl_epi64((const __m128i *)(const void *)seats);
    /* can be loaded at once */
    const int row = seats[0] % 8 == 0 && _mm_cvtsi128_si64(list) == (int64_t)(0x0706050403020100u + seats[0] * 0x0101010101010101u);
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    isogi_vol__decision k;
    isogi_vol__decide_some(b, s, seats, row, (__mmask8)some, isogi_vol__pick8(&spots, ISOGI_VOL__ROW_OF(cell)),
                           isogi_vol__pick8(&spots, ISOGI_VOL__ROW_OF(side)), &k);
    if (k.same) _mm512_mask_i64scatter_epi64(s->side, k.same, isogi_vol__slots8(seats), _mm512_maskz_set1_epi64(k.inside, 1), 8);
    if (k.broken) _mm512_mask_i64scatter_epi64(s->side, k.broken, isogi_vol__slots8(seats), _mm512_set1_epi64(-1), 8);
    if (b->hits && k.cross) isogi_vol__refine8(b, &k, 1), isogi_vol__write8(b, s, seats, &k);
    *alone = k.odd;
    return k.cross;
}

/* Sends for the voxels of a cell in doubt; soon: they are needed at once. */
ISOGI_VOL__INLINE void isogi_vol__send_for(const isogi_volume *v, int64_t cell, int soon) {
    const char *p = (const char *)v->data + (ptrdiff_t)(cell & 0xffff) * v->stride[0] + (ptrdiff_t)(cell >> 16 & 0xffff) * v->stride[1] +
                    (ptrdiff_t)(cell >> 32 & 0xffff) * v->stride[2];
    const ptrdiff_t dy = v->stride[1], dz = v->stride[2];
    if (soon) {
        _mm_prefetch(p, _MM_HINT_T0), _mm_prefetch(p + dy, _MM_HINT_T0), _mm_prefetch(p + dz, _MM_HINT_T0),
            _mm_prefetch(p + dy + dz, _MM_HINT_T0);
    } else {
        _mm_prefetch(p, _MM_HINT_T1), _mm_prefetch(p + dy, _MM_HINT_T1), _mm_prefetch(p + dz, _MM_HINT_T1),
            _mm_prefetch(p + dy + dz, _MM_HINT_T1);
    }
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__open_turn(isogi_vol__turn *turn, const isogi_pyramid *p) {
    __attribute__((aligned(64))) uint64_t first[8], parents0[8], parents1[8];
    int n;
    memset(turn, 0, sizeof *turn);
    memset(first, 0, sizeof first), memset(parents0, 0, sizeof parents0), memset(parents1, 0, sizeof parents1);
    for (n = 1; n < p->node_levels; n++)
        first[n] = (uint64_t)(uintptr_t)p->nodes[p->node_level[n - 1].first], parents0[n] = p->node_level[n - 1].parents[0],
        parents1[n] = p->node_level[n - 1].parents[1];
    turn->p = p, turn->levels = p->node_levels, turn->descent.cell = -1;
    turn->first = _mm512_load_si512(first), turn->parents0 = _mm512_load_si512(parents0), turn->parents1 = _mm512_load_si512(parents1);
    turn->above = _mm512_maskz_loadu_epi64((1 << ISOGI_VOL__NODE_LEVELS) - 1, p->ways->above);
}

/* ---- one ray alone ---- */

/* A ray alone has nothing to do while it waits, so what counts are waits and branches that are foretold wrongly. It goes as rides do, with
   one rounding for each level, hence by half as wide children; all cells of a leaf are looked at together. */
typedef struct __attribute__((aligned(64))) isogi_vol__course {
    double origin[4], inverse[4];          /* as in a pool; the fourth is 0 */
    double sign[4], lead[4];               /* -0 on axes along which the ray falls, else 0; there 1, else 0 */
    double pace[4], rate[4];               /* units of time a cell, all positive, and cells a unit: on its fastest axis a ray takes 1 */
    __m512 cell;                           /* time that a cell takes, in a row of four lanes for each axis */
    __m512 enter[ISOGI_VOL__NODE_LEVELS];  /* when the node of the next level is entered, widened: by each axis for itself, likewise */
    double end;              /* where the ray ends, in these units */
    float last;              /* a little more */
    int64_t stop;            /* as in a pool */
    int flip, octant;        /* children; axes */
    int low, high;           /* what the isovalue can be in 8 bits */
    float level;             /* and unrounded */
    int entry_axis;
    uint64_t cells;
} isogi_vol__course;

/* Sets up the course of a walk that is ready to go; 0 if it has to be walked plainly. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE int isogi_vol__set_course(isogi_vol__course *c, const isogi_vol__walk *w) {
    const isogi_pyramid *p = w->pyramid;
    const struct isogi_vol__ways *ways = p->ways;
    const int top = p->node_levels - 1, padded = 4 << 2 * top;
    const __m256d origin = _mm256_loadu_pd(w->origin), dir = _mm256_loadu_pd(w->dir), box = _mm256_loadu_pd(p->box);
    const __mmask8 still = _mm256_cmp_pd_mask(dir, _mm256_setzero_pd(), _CMP_EQ_OQ);
    /* a ray that stands still keeps below the upper border */
    const __mmask8 fall =
        (__mmask8)((_mm256_cmp_pd_mask(dir, _mm256_setzero_pd(), _CMP_LT_OQ) | _mm256_mask_cmp_pd_mask(still, origin, box, _CMP_GE_OQ)) &
                   7);
    const __m256d minus = _mm256_set1_pd(-0.0), sign = _mm256_maskz_mov_pd(fall, minus);
    const __m256d inverse = _mm256_mask_or_pd(_mm256_loadu_pd(w->inverse), still & 7, sign, _mm256_set1_pd(1e200));
    const __m256d start = _mm256_mask_sub_pd(origin, fall, _mm256_set1_pd(padded), origin); /* counted like cells */
    const __m256d size = _mm256_andnot_pd(minus, dir), pairs = _mm256_max_pd(size, _mm256_permute2f128_pd(size, size, 1));
    const __m256d most = _mm256_max_pd(pairs, _mm256_permute_pd(pairs, 5));
    const __m256d pace = _mm256_min_pd(_mm256_mul_pd(_mm256_andnot_pd(minus, inverse), most), _mm256_set1_pd(1e30));
    const __m128 per = _mm256_cvtpd_ps(pace), at = _mm256_cvtpd_ps(start), reach = _mm_set1_ps(ways->reach);
    const __m128 enter = _mm_mul_ps(_mm_sub_ps(_mm_sub_ps(_mm_setzero_ps(), reach), at), per);
    const __m512i rows = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    if (!(w->end > 1e-150) || !(w->end < 1e150)) return 0;
    c->level = isogi_vol__quantise_isovalue(p, w->isovalue, &c->low, &c->high);
    c->octant = fall, c->flip = (int)(3 * _pdep_u32(fall, 0x15));
    c->entry_axis = w->entry_axis, c->cells = 0;
    memcpy(&c->stop, &w->end, sizeof c->stop), c->stop |= 3;
    _mm256_store_pd(c->origin, origin), _mm256_store_pd(c->inverse, inverse), _mm256_store_pd(c->sign, sign);
    _mm256_store_pd(c->lead, _mm256_maskz_mov_pd(fall, _mm256_set1_pd(1)));
    _mm256_store_pd(c->pace, pace), _mm256_store_pd(c->rate, _mm256_div_pd(size, most));
    c->cell = _mm512_permutexvar_ps(rows, _mm512_castps128_ps512(per));
    c->enter[top] = _mm512_permutexvar_ps(rows, _mm512_castps128_ps512(enter));
    c->end = isogi_vol__min(w->end * _mm256_cvtsd_f64(most), 1e30);
    c->last = (float)(c->end * 1.000001);
    return 1;
}

/* The digits x, y, z of a child's number. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m128i isogi_vol__digits(const struct isogi_vol__ways *ways, int child) {
    return _mm_load_si128((const __m128i *)(const void *)ways->inner[child]);
}

/* As child_place, in registers. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m128i isogi_vol__inner(const struct isogi_vol__ways *ways, __m128i node, int child) {
    return _mm_add_epi32(_mm_slli_epi32(node, 2), isogi_vol__digits(ways, child));
}

/* The 64 children of a node of level n, from its coordinates. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE const uint8_t *isogi_vol__children(const isogi_pyramid *p, int n, __m128i node) {
    __m128i number = _mm_mullo_epi32(node, _mm_load_si128((const __m128i *)(const void *)p->ways->stride[n - 1]));
    number = _mm_add_epi32(number, _mm_shuffle_epi32(number, 0x4e));
    number = _mm_add_epi32(number, _mm_shuffle_epi32(number, 0xb1));
    return (const uint8_t *)p->nodes + p->ways->first[n - 1] + ((size_t)(uint32_t)_mm_cvtsi128_si32(number) << 13);
}

/* Where the layers of a node's children begin on an axis; layer: those of lanes. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__layers16(__m512i corner, int axis, const int32_t layer[16]) {
    const __m512i field = _mm512_set1_epi32(0x0100 + 0x0202 * axis); /* two bytes of a packed cell */
    const __m512i first = _mm512_maskz_permutexvar_epi8(0x3333333333333333u, field, corner);
    return _mm512_cvtepi32_ps(_mm512_add_epi32(first, _mm512_load_si512(layer)));
}

/* Which children of a node the ray passes or comes near, in its own order; the node is child `child` of one whose times are known. By
   every two axes: rows of four lanes are layers of one of them, each lane in a row a layer of the other. It enters no child before it
   begins, nor leaves one after it ends: one bound on each side of every axis does. Above leaves, the node's own times are kept. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__way(isogi_vol__course *c, const struct isogi_vol__ways *ways, int level,
                                                            int child) {
    const __m512i down = _mm512_setr_epi32(4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6, 6, 7, 7, 7, 7), four = _mm512_set1_epi32(4);
    const __m512 step = _mm512_mul_ps(c->cell, _mm512_set1_ps(ways->size[level]));
    const __m512 times = _mm512_fmadd_ps(_mm512_load_ps(ways->within[child]), step, c->enter[level]);
    const __m512 leave = _mm512_min_ps(_mm512_fmadd_ps(c->cell, _mm512_set1_ps(ways->wide[level]), times), _mm512_set1_ps(c->last));
    const __m512 enter = _mm512_max_ps(times, _mm512_setzero_ps());
    const __m512 x_in = _mm512_shuffle_f32x4(enter, enter, 0), x_out = _mm512_shuffle_f32x4(leave, leave, 0);
    const __m512 y_in = _mm512_permutexvar_ps(down, enter), y_out = _mm512_permutexvar_ps(down, leave);
    const __m512 y_in_row = _mm512_shuffle_f32x4(enter, enter, 0x55), y_out_row = _mm512_shuffle_f32x4(leave, leave, 0x55);
    const __m512 z_in = _mm512_permutexvar_ps(_mm512_add_epi32(down, four), enter),
                 z_out = _mm512_permutexvar_ps(_mm512_add_epi32(down, four), leave);
    const __mmask16 xy = _mm512_cmp_ps_mask(x_in, y_out, _CMP_LE_OQ) & _mm512_cmp_ps_mask(y_in, x_out, _CMP_LE_OQ);
    const __mmask16 xz = _mm512_cmp_ps_mask(x_in, z_out, _CMP_LE_OQ) & _mm512_cmp_ps_mask(z_in, x_out, _CMP_LE_OQ);
    const __mmask16 yz = _mm512_cmp_ps_mask(y_in_row, z_out, _CMP_LE_OQ) & _mm512_cmp_ps_mask(z_in, y_out_row, _CMP_LE_OQ);
    if (level) c->enter[level - 1] = _mm512_permute_ps(times, 0);
    return xy * 0x0001000100010001u & _pdep_u64(xz, 0x000f000f000f000fu) * 0x1111u & _pdep_u64(yz, 0x1111111111111111u) * 0xfu;
}

/* Which children of a node can hold the surface, in the ray's order. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__held(const struct isogi_vol__ways *ways, int octant, int isovalue_low,
                                                             int isovalue_high, const uint8_t *node) {
    const __m512i order = _mm512_load_si512(ways->child[octant]);
    const __m512i least = _mm512_permutexvar_epi8(order, _mm512_load_si512(node)),
                  most = _mm512_permutexvar_epi8(order, _mm512_load_si512(node + 64));
    return _mm512_mask_cmpge_epu8_mask(_mm512_cmple_epu8_mask(least, _mm512_set1_epi8((char)isovalue_high)), most,
                                       _mm512_set1_epi8((char)isovalue_low));
}

/* open_leaf without leaving the vector registers; the isovalue is not below the leaf's bounds, since it was not below its parent's. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__unlock_leaf(const struct isogi_vol__ways *ways, isogi_vol__leaf *leaf,
                                                                const uint8_t *node, float level, __m512i *inside, __m512i *outside) {
    const int low = node[ISOGI_VOL__LEAF_LOW], high = node[ISOGI_VOL__LEAF_HIGH];
    const float steps = (level - (float)low) * ways->scale[(high - low) & 255], x = steps < ISOGI_VOL__ABOVE ? steps : ISOGI_VOL__ABOVE;
    /* what is below 0 becomes 0 either way */
    __m128i bound = _mm_cvttps_epi32(_mm_add_ps(_mm_set1_ps(x), _mm_setr_ps(1.0625f, -0.0625f, 0, 0)));
    bound = _mm_packs_epi32(bound, bound), bound = _mm_packus_epi16(bound, bound);
    *inside = _mm512_broadcastb_epi8(bound), *outside = _mm512_broadcastb_epi8(_mm_srli_epi32(bound, 8));
    leaf->code = node, leaf->isovalue = x - 0.5f;
}

/* Without the cells of a leaf that lie beyond the volume; they are counted backwards along the axes of `octant`. */
static uint64_t isogi_vol__cut_order(const isogi_vol__leaf *leaf, int octant, uint64_t mask) {
    const int cut = leaf->code[ISOGI_VOL__LEAF_CUT], x = cut & 3, y = cut >> 2 & 3, z = cut >> 4;
    mask &= 0x1111111111111111u * (octant & 1 ? 15u << x & 15 : 15u >> x);
    mask &= 0x0001000100010001u * (octant & 2 ? 0xffffu << 4 * y & 0xffff : 0xffffu >> 4 * y);
    return mask & (octant & 4 ? ~(uint64_t)0 << 16 * z : ~(uint64_t)0 >> 16 * z);
}

/* Whether a ray passes a cell as pools have it, and the axes by which it enters and leaves it; 3: none. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE int isogi_vol__passes(const isogi_vol__course *c, __m128i cell, int *in, int *out) {
    const __m256d at = _mm256_cvtepi32_pd(cell), next = _mm256_add_pd(at, _mm256_set1_pd(1)), lead = _mm256_load_pd(c->lead);
    __m256d front = _mm256_add_pd(at, lead), back = _mm256_sub_pd(next, lead);
    const __m256d origin = _mm256_load_pd(c->origin), inverse = _mm256_load_pd(c->inverse), zero = _mm256_setzero_pd();
    const __m256i axes = _mm256_setr_epi64x(0, 1, 2, 3), time = _mm256_set1_epi64x(~(int64_t)3);
    __m256d t0, t1;
    __m256i begin, end;
#ifdef __FAST_MATH__
    __asm__("" : "+x"(front), "+x"(back)); /* or the origin is taken off first */
#endif
    t0 = _mm256_mul_pd(_mm256_sub_pd(front, origin), inverse), t1 = _mm256_mul_pd(_mm256_sub_pd(back, origin), inverse);
    begin = _mm256_ternarylogic_epi64(_mm256_castpd_si256(_mm256_max_pd(t0, zero)), time, axes, 0xea);
    end = _mm256_ternarylogic_epi64(_mm256_castpd_si256(_mm256_max_pd(t1, zero)), time, axes, 0xea);
    end = _mm256_mask_set1_epi64(end, 8, c->stop);
    begin = _mm256_max_epi64(begin, _mm256_permute4x64_epi64(begin, 0x4e));
    begin = _mm256_max_epi64(begin, _mm256_permute4x64_epi64(begin, 0xb1));
    end = _mm256_min_epi64(end, _mm256_permute4x64_epi64(end, 0x4e));
    end = _mm256_min_epi64(end, _mm256_permute4x64_epi64(end, 0xb1));
    *in = (int)_mm_cvtsi128_si32(_mm256_castsi256_si128(begin)) & 3, *out = (int)_mm_cvtsi128_si32(_mm256_castsi256_si128(end)) & 3;
    return _mm_cvtsi128_si64(_mm256_castsi256_si128(begin)) < _mm_cvtsi128_si64(_mm256_castsi256_si128(end));
}

/* Goes through cells of a leaf, numbered backwards where the ray falls; corner: its lowest cell. Eight
   at a time: where the ray enters and leaves them in float, but reckoned from where it enters the leaf, which is known in double. Times
   are right to 2e-6 of what a cell takes. 1: hit. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE int isogi_vol__walk_cells(isogi_vol__walk *w, isogi_vol__course *c, const isogi_vol__leaf *leaf,
                                                              uint64_t mask, __m128i corner, isogi_hit *hit) {
    const struct isogi_vol__ways *ways = w->pyramid->ways;
    const __m256d pace = _mm256_load_pd(c->pace);
    const __m256d base = _mm256_fmadd_pd(_mm256_load_pd(c->lead), _mm256_set1_pd(4), _mm256_cvtepi32_pd(corner));
    /* how far beyond the faces by which it enters the leaf the ray is when it begins; when it passes them; where it then is in the leaf */
    const __m256d ahead = _mm256_xor_pd(_mm256_sub_pd(_mm256_load_pd(c->origin), base), _mm256_load_pd(c->sign));
    const __m512i code0 = _mm512_load_si512(leaf->code), code1 = _mm512_load_si512(leaf->code + 64);
    __m256d enter = _mm256_max_pd(_mm256_fnmadd_pd(ahead, pace, _mm256_setzero_pd()), _mm256_setzero_pd());
    const __m512d layer = _mm512_setr_pd(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256 number = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    __m256 time[3], place[3], rate[3], last;
    __m128 begins_at;
    int a;
    enter = _mm256_max_pd(enter, _mm256_permute4x64_pd(enter, 0x4e)), enter = _mm256_max_pd(enter, _mm256_permute_pd(enter, 5));
    begins_at = _mm256_cvtpd_ps(_mm256_fmadd_pd(enter, _mm256_load_pd(c->rate), ahead));
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        const __m512d sign = _mm512_set1_pd(c->sign[a]);
        const __m512d from = _mm512_permutexvar_pd(_mm512_set1_epi64(a), _mm512_castpd256_pd512(base));
        const __m512d plane = ISOGI_VOL__SUM(from, _mm512_xor_pd(layer, sign));
        const __m512d way = _mm512_xor_pd(ISOGI_VOL__DIFFERENCE(plane, _mm512_set1_pd(c->origin[a])), sign);
        time[a] = _mm512_cvtpd_ps(
            _mm512_fmsub_pd(way, _mm512_set1_pd(c->pace[a]), _mm512_broadcastsd_pd(_mm256_castpd256_pd128(enter))));
        place[a] = _mm256_sub_ps(_mm256_permutevar8x32_ps(_mm256_castps128_ps256(begins_at), _mm256_set1_epi32(a)), number);
        rate[a] = _mm256_set1_ps((float)c->rate[a]);
    }
    last = _mm256_set1_ps((float)(c->end - _mm256_cvtsd_f64(enter)));
    do {
        const int count = __builtin_popcountll(mask);
        const __m128i list = _mm512_castsi512_si128(_mm512_maskz_compress_epi8(mask, _mm512_load_si512(ways->child[0])));
        const __m128i low = _mm512_castsi512_si128(_mm512_maskz_compress_epi8(mask, _mm512_load_si512(ways->lowest[c->octant])));
        const __m256i child = _mm256_cvtepu8_epi32(list), three = _mm256_set1_epi32(3), one = _mm256_set1_epi32(1);
        const __m512i offset = _mm512_add_epi8(_mm512_broadcastq_epi64(low), _mm512_load_si512(ways->beside[c->octant]));
        const __m512i corners = _mm512_permutex2var_epi8(code0, offset, code1);
        __m256i digit[3];
        __m256 begin = _mm256_setzero_ps(), end = last, from[3], to[3];
        isogi_vol__sides sides;
        unsigned lanes = count < 8 ? (1u << count) - 1 : 255;
        digit[0] = _mm256_and_si256(child, three), digit[1] = _mm256_and_si256(_mm256_srli_epi32(child, 2), three),
        digit[2] = _mm256_srli_epi32(child, 4);
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            begin = _mm256_max_ps(begin, _mm256_permutevar8x32_ps(time[a], digit[a]));
            end = _mm256_min_ps(end, _mm256_permutevar8x32_ps(time[a], _mm256_add_epi32(digit[a], one)));
        }
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            const __m256 local = _mm256_permutevar8x32_ps(place[a], digit[a]);
            from[a] = _mm256_fmadd_ps(begin, rate[a], local), to[a] = _mm256_fmadd_ps(end, rate[a], local);
        }
        /* others are certainly not passed */
        lanes &= _mm256_cmp_ps_mask(begin, _mm256_add_ps(end, _mm256_set1_ps(4e-6f)), _CMP_LE_OQ);
        sides = isogi_vol__sides8(corners, _mm256_set1_ps(leaf->isovalue), from, to);
        c->cells += (uint64_t)__builtin_popcount(lanes);
        while (lanes) {
            const unsigned first = lanes & (0 - lanes);
            unsigned doubt = lanes;
            if (!w->deflate) {
                if (w->inside < 0) w->inside = sides.in & first ? 1 : sides.out & first ? 0 : -1;
                doubt &= ~(unsigned)(w->inside > 0 ? sides.in : w->inside == 0 ? sides.out : 0);
                if (!doubt) break;
                doubt &= 0 - doubt;
                /* any hit will do, and this one is certain */
                if (!w->exact && doubt & (w->inside > 0    ? sides.out1
                                          : w->inside == 0 ? sides.in1
                                                           : (sides.in0 & sides.out1) | (sides.out0 & sides.in1)))
                    return 1;
            } else doubt = first;
            {
                const int which = (int)((uint64_t)_mm_cvtsi128_si64(list) >> 8 * __builtin_ctz(doubt) & 255) ^ c->flip;
                const __m128i cell = _mm_add_epi32(corner, isogi_vol__digits(ways, which));
                int in, out;
                if (isogi_vol__passes(c, cell, &in, &out) &&
                    isogi_vol__mixed_cell_avx2(w, _mm_cvtsi128_si32(cell), _mm_extract_epi32(cell, 1), _mm_extract_epi32(cell, 2),
                                               in == 3 ? c->entry_axis : in, out == 3 ? -1 : out, hit))
                    return 1;
            }
            lanes &= ~(doubt | (doubt - 1));
        }
        mask = _pdep_u64(~(uint64_t)255, mask);
    } while (mask);
    return 0;
}

ISOGI_VOL__INLINE void isogi_vol__fetch_node(const uint8_t *node) {
    _mm_prefetch((const char *)node, _MM_HINT_T0), _mm_prefetch((const char *)node + 64, _MM_HINT_T0);
}

/* Which cells of a leaf can hold the surface, in the ray's order. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__split_cells(const struct isogi_vol__ways *ways, int octant, isogi_vol__leaf *leaf,
                                                                   const uint8_t *node, float level) {
    const __m512i code0 = _mm512_load_si512(node), code1 = _mm512_load_si512(node + 64);
#define ISOGI_VOL__CORNER(k) _mm512_permutex2var_epi8(code0, _mm512_load_si512(ways->corner[octant][k]), code1)
    const __m512i a = ISOGI_VOL__CORNER(0), b = ISOGI_VOL__CORNER(1), c = ISOGI_VOL__CORNER(2), d = ISOGI_VOL__CORNER(3);
    const __m512i e = ISOGI_VOL__CORNER(4), f = ISOGI_VOL__CORNER(5), g = ISOGI_VOL__CORNER(6), h = ISOGI_VOL__CORNER(7);
#undef ISOGI_VOL__CORNER
    const __m512i least = _mm512_min_epu8(_mm512_min_epu8(_mm512_min_epu8(a, b), _mm512_min_epu8(c, d)),
                                          _mm512_min_epu8(_mm512_min_epu8(e, f), _mm512_min_epu8(g, h)));
    const __m512i most = _mm512_max_epu8(_mm512_max_epu8(_mm512_max_epu8(a, b), _mm512_max_epu8(c, d)),
                                         _mm512_max_epu8(_mm512_max_epu8(e, f), _mm512_max_epu8(g, h)));
    __m512i inside, outside;
    uint64_t mask;
    isogi_vol__unlock_leaf(ways, leaf, node, level, &inside, &outside);
    mask = _mm512_mask_cmpge_epu8_mask(_mm512_cmplt_epu8_mask(least, inside), most, outside);
    return ISOGI_VOL__UNLIKELY(node[ISOGI_VOL__LEAF_CUT]) ? isogi_vol__cut_order(leaf, octant, mask) : mask;
}

/* The voxels of a leaf in the ray's order. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__order_voxels(const struct isogi_vol__ways *ways, int octant, const uint8_t *node,
                                                                 __m512i voxel[2]) {
    const __m512i code0 = _mm512_load_si512(node), code1 = _mm512_load_si512(node + 64);
    voxel[0] = _mm512_permutex2var_epi8(code0, _mm512_load_si512(ways->voxel[octant]), code1);
    voxel[1] = _mm512_permutex2var_epi8(code0, _mm512_load_si512(ways->voxel[octant] + 64), code1);
}

/* The voxels of a cell will soon be wanted. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__fetch_cell(const isogi_volume *v, __m128i cell) {
    const ptrdiff_t dy = v->stride[1], dz = v->stride[2];
    const char *at = (const char *)v->data + _mm_cvtsi128_si32(cell) * v->stride[0] + _mm_extract_epi32(cell, 1) * dy +
                     _mm_extract_epi32(cell, 2) * dz;
    _mm_prefetch(at, _MM_HINT_T0), _mm_prefetch(at + dy, _MM_HINT_T0), _mm_prefetch(at + dz, _MM_HINT_T0),
        _mm_prefetch(at + dy + dz, _MM_HINT_T0);
}

/* Goes through the leaves of a node that the ray passes, `mask` of its children, which begin at `leaves`; parent: its coordinates.
   1: hit. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE int isogi_vol__walk_leaves(isogi_vol__walk *w, isogi_vol__course *c, const uint8_t *leaves,
                                                               uint64_t mask, __m128i parent, isogi_hit *hit) {
    const struct isogi_vol__ways *ways = w->pyramid->ways;
    do {
        const int child = __builtin_ctzll(mask), here = child ^ c->flip;
        isogi_vol__leaf leaf;
        const uint64_t cells =
            isogi_vol__way(c, ways, 0, child) & isogi_vol__split_cells(ways, c->octant, &leaf, leaves + 128 * here, c->level);
        mask &= mask - 1;
        isogi_vol__fetch_node(leaves + 128 * ((mask ? __builtin_ctzll(mask) : child) ^ c->flip)); /* the next */
        w->count.blocks++;
        if (cells) {
            const __m128i corner = _mm_slli_epi32(isogi_vol__inner(ways, parent, here), 2);
            isogi_vol__fetch_cell(&w->pyramid->volume,
                                  _mm_add_epi32(corner, isogi_vol__digits(ways, __builtin_ctzll(cells) ^ c->flip)));
            if (isogi_vol__walk_cells(w, c, &leaf, cells, corner, hit)) return 1;
        }
    } while (mask);
    return 0;
}

/* From node to node, the lowest level that has children left first. What will be needed soon is sent for. */
ISOGI_VOL__AVX512 static int isogi_vol__walk_one(isogi_vol__walk *w, isogi_hit *hit) {
    const isogi_pyramid *p = w->pyramid;
    const struct isogi_vol__ways *ways = p->ways;
    const uint8_t *children[ISOGI_VOL__NODE_LEVELS], *node = p->nodes[p->node_level[p->node_levels - 1].first];
    uint64_t left[ISOGI_VOL__NODE_LEVELS];
    __m128i place[ISOGI_VOL__NODE_LEVELS]; /* coordinates of nodes */
    unsigned pending = 0;
    int n = p->node_levels - 1, child = 0, found = 0, here;
    isogi_vol__course c;
    if (!isogi_vol__set_course(&c, w)) return -1;
    if (c.low > c.high) return 0;
    place[n] = _mm_setzero_si128();
    for (;;) {
        uint64_t mask = isogi_vol__way(&c, ways, n, child) & isogi_vol__held(ways, c.octant, c.low, c.high, node);
        w->count.blocks++;
        if (mask) {
            children[n] = isogi_vol__children(p, n, place[n]);
            if (n == 1) {
                found = isogi_vol__walk_leaves(w, &c, children[1], mask, place[1], hit);
                if (found) break;
                mask = 0;
            } else pending |= 1u << n;
        }
        if (!mask) {
            if (!pending) break;
            n = __builtin_ctz(pending), mask = left[n];
        }
        child = __builtin_ctzll(mask), here = child ^ c.flip;
        left[n] = mask & (mask - 1);
        if (!left[n]) pending &= pending - 1;
        node = children[n] + 128 * here;
        isogi_vol__fetch_node(children[n] + 128 * (__builtin_ctzll(left[n] ? left[n] : mask) ^ c.flip)); /* its successor */
        place[n - 1] = isogi_vol__inner(ways, place[n], here);
        n--;
    }
    w->count.cells = c.cells;
    return found;
}

#endif

/* ==== rays =========================================================================================================== */

/* Whether rays go by AVX-512: those look into leaves. */
ISOGI_VOL__INLINE int isogi_vol__is_wide(const isogi_pyramid *p) {
    return p->fast && p->path == ISOGI_VOL__PATH_AVX512 && !p->volume.compact;
}

/* Fast rays look only at cells that may hold the surface. So a capped ray asks first whether it enters the box inside, by the arithmetic
   of visit_cell: what it says must not be taken back by a cell. */
static int isogi_vol__enters_inside(isogi_vol__walk *w, isogi_hit *hit) {
    double corner[8], local[3];
    isogi_vol__cubic cubic;
    if (w->cap != 2) return 0;
    w->cap = 1;
    isogi_vol__first_cell(w);
    isogi_vol__local(w, 0, local);
    if (w->entry_axis >= 0) local[w->entry_axis] = w->dir[w->entry_axis] > 0 ? 0 : 1;
    if (!isogi_vol__corners(w->pyramid, w->cell, w->isovalue, corner)) {
        w->inside = -1;
        return 0;
    }
    isogi_vol__cubic_set(&cubic, corner, local, local);
    if (!(cubic.b[0] >= 0)) return 0;
    isogi_vol__emit(w, 0, local, 2, hit);
    return 1;
}

/* And one that has found nothing asks whether it leaves the box inside; `inside` is known unless nothing was looked at on the way. What was
   skipped behind the last cell lies on one side. */
static int isogi_vol__leaves_inside(isogi_vol__walk *w, uint32_t flags, isogi_hit *hit) {
    if (!(w->deflated >= w->end)) w->deflate = 0;
    if (!(flags & ISOGI_RAY_CAPPED) || !w->end_is_border) return 0;
    if (w->inside < 0 && !w->deflate) w->inside = isogi_vol__ends_inside(w);
    return w->inside == 1 && isogi_vol__cap_exit(w, hit);
}

static int isogi_vol__walk_plainly(isogi_vol__ride *r, isogi_hit *hit) {
    isogi_vol__first_cell(&r->walk);
    return isogi_vol__walk_on(&r->walk, r->flags, hit);
}

/* Walks a ray that is set up: fast where that is right, else plainly. */
static int isogi_vol__walk_ray(isogi_vol__ride *r, isogi_hit *hit) {
    isogi_vol__walk *w = &r->walk;
#ifdef ISOGI_VOL__AVX
    if (isogi_vol__is_wide(w->pyramid)) {
        const int found = isogi_vol__enters_inside(w, hit) ? 1 : isogi_vol__walk_one(w, hit);
        if (found >= 0) return found || isogi_vol__leaves_inside(w, r->flags, hit);
    } else
#endif
    if (w->pyramid->fast && isogi_vol__ride_set(r)) {
        isogi_vol__ride_start(r);
        return isogi_vol__enters_inside(w, hit) || isogi_vol__ride_on(r, hit) || isogi_vol__leaves_inside(w, r->flags, hit);
    }
    return isogi_vol__walk_plainly(r, hit);
}

static void isogi_vol__finish(isogi_vol__batch *b, size_t i, const isogi_vol__walk *w, int found) {
    b->work.blocks += w->count.blocks, b->work.cells += w->count.cells, b->work.cubics += w->count.cubics;
    if (b->occluded) b->occluded[i] = (uint8_t)found;
    else if (!found) memset(&b->hits[i], 0, sizeof b->hits[i]);
}

ISOGI_VOL__NOINLINE static void isogi_vol__trace_one(isogi_vol__batch *b, size_t i) {
    isogi_vol__ride r;
    isogi_hit any;
    const int walks = isogi_vol__begin(b, i, &r.walk);
    r.flags = isogi_vol__flags(b, i);
    isogi_vol__finish(b, i, &r.walk, walks && isogi_vol__walk_ray(&r, b->hits ? &b->hits[i] : &any));
}

/* ---- rays that nearly coincide ---- */

/* Neighbours in a picture, a packet of coherent rays in the field's terms, go from node to node together: a node is opened once for all
   of them, by the beam that holds them, and a child or cell costs two times for each ray in float, when it enters and when it leaves. Cells
   are widened by ISOGI_VOL__REACH, more than floats err by, hence none is left out; those that are certainly on a ray's side all along are
   done with. A cell in doubt is decided as a ray alone does, in the ray's own order: hits are the same, bit by bit. All rays fall along the
   same axes and count backwards there, so one order of children suits them all. Their time is their way on the axis on which they are
   fastest. */
#define ISOGI_VOL__CONVOY 16
#define ISOGI_VOL__REACH 4e-6f /* times below are sums of a few numbers up to 4 children, with errors below 1e-6 */

typedef struct isogi_vol__convoy {
    isogi_vol__ride *ride;
    int count, axis;                           /* axis: on which they are fastest */
    unsigned active, leaving, inside, outside; /* rays, a bit each: going on; about to leave a surface; else known to be on this side */
    /* where they begin, how far they go a unit of time, and when they end */
    double place[3][ISOGI_VOL__CONVOY], way[3][ISOGI_VOL__CONVOY], stop[ISOGI_VOL__CONVOY];
    float rate[3][ISOGI_VOL__CONVOY], per[3][ISOGI_VOL__CONVOY]; /* way, and what a cell takes by each axis */
    /* they enter nodes at place * per - begin, and leave them at place * per - finish: nodes are wider than they are; end: a little more */
    float begin[3][ISOGI_VOL__CONVOY], finish[3][ISOGI_VOL__CONVOY], end[ISOGI_VOL__CONVOY];
    /* where they are in a leaf when they come to it; from there on they enter layer i of cells at i * per - first, leave it at
       (i + 1) * per - last, and end at left */
    float local[3][ISOGI_VOL__CONVOY], first[3][ISOGI_VOL__CONVOY], last[3][ISOGI_VOL__CONVOY], left[ISOGI_VOL__CONVOY];
    float bound[4];    /* values that are certainly outside and inside in that leaf, and three times these */
    uint8_t corner[8]; /* from a cell's first voxel in its leaf to its corners, counted backwards likewise */
    isogi_vol__beam beam;
    isogi_vol__ride lead; /* the beam's: its trip alone */
} isogi_vol__convoy;

/* Whether all fall along the same axes, have one isovalue, and are not far apart. */
static int isogi_vol__rides_coincide(const isogi_vol__ride *ride, int count) {
    const isogi_vol__walk *first = &ride[0].walk;
    const double most = isogi_vol__largest(first->dir[0], first->dir[1], first->dir[2]);
    int i, a;
    if (!(most > 1e-12 && most < 1e12)) return 0;
    for (i = 1; i < count; i++) {
        const isogi_vol__walk *w = &ride[i].walk;
        if (ride[i].trip.octant != ride[0].trip.octant || !(w->isovalue <= first->isovalue && w->isovalue >= first->isovalue)) return 0;
        for (a = 0; a < 3; a++)
            if (fabs(w->dir[a] - first->dir[a]) > 0.06 * most || fabs(w->origin[a] - first->origin[a]) > 8) return 0;
    }
    return 1;
}

/* The beam: on each of the two other axes all rays lie between two lines, which go through the bounds of their places where the first ray
   begins and where the last one ends. (The largest of linear functions lies below its chord.) */
static void isogi_vol__set_beam(isogi_vol__convoy *v, double padded) {
    isogi_vol__beam *beam = &v->beam;
    const double slack = 2e-6 * padded; /* floats are off by less than half of this */
    const int axis = v->axis;
    double from = v->place[axis][0], to = from, length;
    int a, i;
    for (i = 0; i < v->count; i++)
        from = isogi_vol__min(from, v->place[axis][i]), to = isogi_vol__max(to, v->place[axis][i] + v->stop[i]);
    length = isogi_vol__max(to - from, 1e-3);
    beam->corner[0] = beam->corner[1] = beam->corner[2] = 0;
    beam->from = (float)(from - slack), beam->to = (float)(to + slack);
    for (a = 0; a < 3; a++) {
        double upper[2] = {-1e300, -1e300}, lower[2] = {1e300, 1e300};
        if (a == axis) {
            beam->in[a] = beam->out[a] = 1, beam->in_base[a] = -(float)slack, beam->out_base[a] = (float)slack;
            continue;
        }
        for (i = 0; i < v->count; i++) {
            const double begin = v->place[a][i] + (from - v->place[axis][i]) * v->way[a][i], end = begin + length * v->way[a][i];
            upper[0] = isogi_vol__max(upper[0], begin), upper[1] = isogi_vol__max(upper[1], end);
            lower[0] = isogi_vol__min(lower[0], begin), lower[1] = isogi_vol__min(lower[1], end);
        }
        beam->in[a] = (float)isogi_vol__min(length / isogi_vol__max(upper[1] - upper[0], 1e-200), 1e28);
        beam->out[a] = (float)isogi_vol__min(length / isogi_vol__max(lower[1] - lower[0], 1e-200), 1e28);
        beam->in_base[a] = (float)(from - (upper[0] + slack) * (double)beam->in[a]);
        beam->out_base[a] = (float)(from - (lower[0] - slack) * (double)beam->out[a]);
    }
}

/* Takes note of the side on which ray i is. */
ISOGI_VOL__INLINE void isogi_vol__take_side(isogi_vol__convoy *v, const isogi_vol__walk *w, int i) {
    const unsigned bit = 1u << i;
    v->leaving &= ~bit, v->inside &= ~bit, v->outside &= ~bit;
    if (w->deflate) v->leaving |= bit;
    else if (w->inside > 0) v->inside |= bit;
    else if (!w->inside) v->outside |= bit;
}

/* From a cell's first voxel in its leaf to its corner with bits x, y, z. */
ISOGI_VOL__INLINE int isogi_vol__leaf_corner(int bits) { return (bits & 1) + 5 * (bits >> 1 & 1) + 25 * (bits >> 2); }

/* Sets up the convoy of rays that coincide. Places of rays that there are not are those of the first one. */
static void isogi_vol__set_convoy(isogi_vol__convoy *v, isogi_vol__ride *ride, int count) {
    const isogi_vol__trip *c = &ride[0].trip;
    const double *dir = ride[0].walk.dir;
    const int levels = ride[0].walk.pyramid->node_levels, y = fabs(dir[1]) > fabs(dir[0]), axis = fabs(dir[2]) > fabs(dir[y]) ? 2 : y;
    const double padded = 1 << 2 * levels;
    const float reach = (float)(1e-6 * padded); /* floats are off by half of this, of what the root measures */
    int i, a;
    v->ride = ride, v->count = count, v->axis = axis, v->lead = ride[0];
    isogi_vol__ride_start(&v->lead);
    v->active = (1u << count) - 1, v->inside = v->outside = v->leaving = 0;
    for (i = 0; i < ISOGI_VOL__CONVOY; i++) {
        const isogi_vol__walk *w = &ride[i < count ? i : 0].walk;
        const double *inverse = ride[i < count ? i : 0].trip.inverse, most = fabs(w->dir[axis]), pace = 1 / most;
        for (a = 0; a < 3; a++) {
            const double place = c->lead[a] ? padded - w->origin[a] : w->origin[a];
            const float at = (float)place, per = (float)isogi_vol__min(fabs(inverse[a]) * most, 1e28);
            v->place[a][i] = place, v->way[a][i] = fabs(w->dir[a]) * pace;
            v->rate[a][i] = (float)v->way[a][i], v->per[a][i] = per;
            v->begin[a][i] = (at + reach) * per, v->finish[a][i] = (at - reach) * per;
        }
        v->stop[i] = w->end * most, v->end[i] = (float)(v->stop[i] * 1.000001);
        if (i < count) isogi_vol__take_side(v, w, i);
    }
    isogi_vol__set_beam(v, padded);
    for (a = 0; a < 8; a++) v->corner[a] = (uint8_t)isogi_vol__leaf_corner(a ^ c->octant);
}

/* Corners of a cell relative to the isovalue, the largest of them 1, counted backwards likewise. 1: all of it is inside; 0: outside; -1: it
   has some on both sides, or one that is not finite: all are then 0, of which nothing is certain. */
#define ISOGI_VOL__UNSURE 4e-5f /* more than what a cell's width times REACH, and rounding, change a value by */
static int isogi_vol__convoy_corners(const isogi_vol__convoy *v, const int32_t cell[4], float f[8]) {
    const isogi_vol__walk *w = &v->lead.walk;
    double corner[8], most = DBL_MIN;
    int at[3], i, inside = 0;
    for (i = 0; i < 3; i++) at[i] = cell[i];
    if (!isogi_vol__corners(w->pyramid, at, w->isovalue, corner)) {
        memset(f, 0, 8 * sizeof *f);
        return -1;
    }
    for (i = 0; i < 8; i++) most = isogi_vol__max(most, fabs(corner[i]));
    for (i = 0; i < 8; i++) f[i] = (float)(corner[i ^ v->lead.trip.octant] / most);
    for (i = 0; i < 8; i++) inside += corner[i] >= 0;
    return inside == 8 ? 1 : inside ? -1 : 0;
}

/* The same by every path, four or eight rays at once.
   convoy_layers: the layers of cells of a leaf, from where the rays come to its first plane on the axis on which they are fastest: rays
   that meet it are then next to it, and their places in cells are exact. Loops that compilers can make vectors of.
   convoy_span: when rays enter and leave a box; low: its corner; size: of its sides; in, out: begin and finish, or first and last; i: the
   first of the rays.
   convoy_meets: which rays meet the node at the beam's corner, or come near it; size: of its sides.
   convoy_sides: which of the rays `met` pass a cell of a leaf or come near it, and for which of them it is certain that they are inside, or
   outside, all along, as told has it (on the bounds themselves, too: they are wider than errors); layer: the cell's place; f: its corners,
   or NULL.
   convoy_look: the same from the leaf's voxels, or where there is none from the volume's; here: the cell's number, not counted backwards.
   convoy_within: which rays certainly pass it, of those that were said to.
   convoy_leaf: goes through cells of a leaf, those of lead.
   convoy_on: all rays to their hits or ends. */
#define ISOGI_VOL__CONVOY_ON(path, target) \
    target ISOGI_VOL__INLINE void isogi_vol__convoy_layers_##path(isogi_vol__convoy *v, const float corner[3]) { \
        const double plane = (double)corner[v->axis], *main = v->place[v->axis]; \
        double zero[ISOGI_VOL__CONVOY]; \
        int i, a; \
        for (i = 0; i < ISOGI_VOL__CONVOY; i++) { \
            const double way = plane - main[i] > 0 ? plane - main[i] : 0; \
            zero[i] = way < v->stop[i] ? way : v->stop[i]; \
        } \
        for (i = 0; i < ISOGI_VOL__CONVOY; i++) v->left[i] = (float)((v->stop[i] - zero[i]) * 1.000001); \
        for (a = 0; a < 3; a++) { \
            const double low = (double)corner[a]; \
            for (i = 0; i < ISOGI_VOL__CONVOY; i++) v->local[a][i] = (float)(v->place[a][i] + zero[i] * v->way[a][i] - low); \
            for (i = 0; i < ISOGI_VOL__CONVOY; i++) { \
                v->first[a][i] = (v->local[a][i] + ISOGI_VOL__REACH) * v->per[a][i]; \
                v->last[a][i] = (v->local[a][i] - ISOGI_VOL__REACH) * v->per[a][i]; \
            } \
        } \
    } \
    target ISOGI_VOL__INLINE void isogi_vol__convoy_span_##path( \
        const isogi_vol__convoy *v, const float low[3], float size, const float (*in)[ISOGI_VOL__CONVOY], \
        const float (*out)[ISOGI_VOL__CONVOY], isogi_vol__wide_##path *enter, isogi_vol__wide_##path *leave, int i) { \
        int a; \
        ISOGI_VOL__UNROLL(3) \
        for (a = 0; a < 3; a++) { \
            const isogi_vol__wide_##path per = ISOGI_VOL__WIDE_##path(loadu_ps)(v->per[a] + i); \
            const isogi_vol__wide_##path first = ISOGI_VOL__WIDE_##path(mul_ps)(ISOGI_VOL__WIDE_##path(set1_ps)(low[a]), per); \
            const isogi_vol__wide_##path last = ISOGI_VOL__WIDE_##path(mul_ps)(ISOGI_VOL__WIDE_##path(set1_ps)(low[a] + size), per); \
            *enter = ISOGI_VOL__WIDE_##path(max_ps)( \
                *enter, ISOGI_VOL__WIDE_##path(sub_ps)(first, ISOGI_VOL__WIDE_##path(loadu_ps)(in[a] + i))); \
            *leave = ISOGI_VOL__WIDE_##path(min_ps)( \
                *leave, ISOGI_VOL__WIDE_##path(sub_ps)(last, ISOGI_VOL__WIDE_##path(loadu_ps)(out[a] + i))); \
        } \
    } \
    target ISOGI_VOL__INLINE unsigned isogi_vol__convoy_meets_##path(const isogi_vol__convoy *v, float size) { \
        unsigned lanes = 0; \
        int i; \
        ISOGI_VOL__UNROLL(4) \
        for (i = 0; i < ISOGI_VOL__CONVOY; i += ISOGI_VOL__LANES_##path) { \
            isogi_vol__wide_##path enter = ISOGI_VOL__WIDE_##path(set1_ps)(0), leave = ISOGI_VOL__WIDE_##path(loadu_ps)(v->end + i); \
            isogi_vol__convoy_span_##path(v, v->beam.corner, size, v->begin, v->finish, &enter, &leave, i); \
            lanes |= isogi_vol__at_most_##path(enter, leave) << i; \
        } \
        return lanes; \
    } \
    target ISOGI_VOL__INLINE unsigned isogi_vol__convoy_within_##path(const isogi_vol__convoy *v, const float layer[3]) { \
        unsigned lanes = 0; \
        int i; \
        for (i = 0; i < ISOGI_VOL__CONVOY; i += ISOGI_VOL__LANES_##path) { \
            isogi_vol__wide_##path enter = ISOGI_VOL__WIDE_##path(set1_ps)(0), leave = ISOGI_VOL__WIDE_##path(loadu_ps)(v->left + i); \
            isogi_vol__convoy_span_##path(v, layer, 1, v->last, v->first, &enter, &leave, i); \
            enter = ISOGI_VOL__WIDE_##path(add_ps)(enter, ISOGI_VOL__WIDE_##path(set1_ps)(1e-5f)); \
            lanes |= isogi_vol__at_most_##path(enter, leave) << i; \
        } \
        return lanes; \
    } \
    target ISOGI_VOL__INLINE isogi_vol__wide_##path isogi_vol__mix_##path(isogi_vol__wide_##path a, isogi_vol__wide_##path b, \
                                                                         isogi_vol__wide_##path u) { \
        return ISOGI_VOL__WIDE_##path(add_ps)(a, ISOGI_VOL__WIDE_##path(mul_ps)(u, ISOGI_VOL__WIDE_##path(sub_ps)(b, a))); \
    } \
    target ISOGI_VOL__INLINE unsigned isogi_vol__convoy_sides_##path(const isogi_vol__convoy *v, unsigned met, const float layer[3], \
                                                                    const float f[8], unsigned *inside, unsigned *outside) { \
        const isogi_vol__wide_##path zero = ISOGI_VOL__WIDE_##path(set1_ps)(0), one = ISOGI_VOL__WIDE_##path(set1_ps)(1); \
        const isogi_vol__wide_##path low = ISOGI_VOL__WIDE_##path(set1_ps)(v->bound[0]); \
        const isogi_vol__wide_##path high = ISOGI_VOL__WIDE_##path(set1_ps)(v->bound[1]); \
        const isogi_vol__wide_##path low3 = ISOGI_VOL__WIDE_##path(set1_ps)(v->bound[2]); \
        const isogi_vol__wide_##path high3 = ISOGI_VOL__WIDE_##path(set1_ps)(v->bound[3]); \
        unsigned passed = 0, in = 0, out = 0; \
        int i, a, k; \
        for (i = 0; i < ISOGI_VOL__CONVOY; i += ISOGI_VOL__LANES_##path) { \
            isogi_vol__wide_##path enter = zero, leave = ISOGI_VOL__WIDE_##path(loadu_ps)(v->left + i), from[3], to[3]; \
            isogi_vol__wide_##path c[2][4], value[2][2][2], sum1, sum2; \
            unsigned lanes = met >> i & ((1u << ISOGI_VOL__LANES_##path) - 1); \
            if (!lanes) continue; \
            isogi_vol__convoy_span_##path(v, layer, 1, v->first, v->last, &enter, &leave, i); \
            lanes &= isogi_vol__at_most_##path(enter, leave); \
            passed |= lanes << i; \
            if (!lanes || !f) continue; \
            ISOGI_VOL__UNROLL(3) \
            for (a = 0; a < 3; a++) { \
                const isogi_vol__wide_##path rate = ISOGI_VOL__WIDE_##path(loadu_ps)(v->rate[a] + i); \
                const isogi_vol__wide_##path base = ISOGI_VOL__WIDE_##path(sub_ps)( \
                    ISOGI_VOL__WIDE_##path(loadu_ps)(v->local[a] + i), ISOGI_VOL__WIDE_##path(set1_ps)(layer[a])); \
                from[a] = ISOGI_VOL__WIDE_##path(add_ps)(base, ISOGI_VOL__WIDE_##path(mul_ps)(enter, rate)); \
                to[a] = ISOGI_VOL__WIDE_##path(add_ps)(base, ISOGI_VOL__WIDE_##path(mul_ps)(leave, rate)); \
                from[a] = ISOGI_VOL__WIDE_##path(min_ps)(ISOGI_VOL__WIDE_##path(max_ps)(from[a], zero), one); \
                to[a] = ISOGI_VOL__WIDE_##path(min_ps)(ISOGI_VOL__WIDE_##path(max_ps)(to[a], zero), one); \
            } \
            ISOGI_VOL__UNROLL(4) \
            for (k = 0; k < 4; k++) { \
                const isogi_vol__wide_##path f0 = ISOGI_VOL__WIDE_##path(set1_ps)(f[2 * k]); \
                const isogi_vol__wide_##path f1 = ISOGI_VOL__WIDE_##path(set1_ps)(f[2 * k + 1]); \
                c[0][k] = isogi_vol__mix_##path(f0, f1, from[0]), c[1][k] = isogi_vol__mix_##path(f0, f1, to[0]); \
            } \
            ISOGI_VOL__UNROLL(2) \
            for (k = 0; k < 2; k++) { \
                const isogi_vol__wide_##path near0 = isogi_vol__mix_##path(c[k][0], c[k][1], from[1]); \
                const isogi_vol__wide_##path near1 = isogi_vol__mix_##path(c[k][2], c[k][3], from[1]); \
                const isogi_vol__wide_##path far0 = isogi_vol__mix_##path(c[k][0], c[k][1], to[1]); \
                const isogi_vol__wide_##path far1 = isogi_vol__mix_##path(c[k][2], c[k][3], to[1]); \
                value[k][0][0] = isogi_vol__mix_##path(near0, near1, from[2]); \
                value[k][0][1] = isogi_vol__mix_##path(near0, near1, to[2]); \
                value[k][1][0] = isogi_vol__mix_##path(far0, far1, from[2]); \
                value[k][1][1] = isogi_vol__mix_##path(far0, far1, to[2]); \
            } \
            sum1 = ISOGI_VOL__WIDE_##path(add_ps)(ISOGI_VOL__WIDE_##path(add_ps)(value[1][0][0], value[0][1][0]), value[0][0][1]); \
            sum2 = ISOGI_VOL__WIDE_##path(add_ps)(ISOGI_VOL__WIDE_##path(add_ps)(value[0][1][1], value[1][0][1]), value[1][1][0]); \
            in |= (lanes & isogi_vol__at_most_##path(high, ISOGI_VOL__WIDE_##path(min_ps)(value[0][0][0], value[1][1][1])) & \
                   isogi_vol__at_most_##path(high3, ISOGI_VOL__WIDE_##path(min_ps)(sum1, sum2))) \
                  << i; \
            out |= (lanes & isogi_vol__at_most_##path(ISOGI_VOL__WIDE_##path(max_ps)(value[0][0][0], value[1][1][1]), low) & \
                    isogi_vol__at_most_##path(ISOGI_VOL__WIDE_##path(max_ps)(sum1, sum2), low3)) \
                   << i; \
        } \
        *inside = in, *outside = out; \
        return passed; \
    } \
    target ISOGI_VOL__INLINE unsigned isogi_vol__convoy_look_##path(const isogi_vol__convoy *v, unsigned met, const float layer[3], \
                                                                   int here, const int32_t cell[4], unsigned *in, unsigned *out) { \
        float f[8]; \
        int i; \
        if (v->lead.leaf.code) { \
            const uint8_t *code = v->lead.leaf.code + (here & 3) + 5 * (here >> 2 & 3) + 25 * (here >> 4); \
            ISOGI_VOL__UNROLL(8) \
            for (i = 0; i < 8; i++) f[i] = code[v->corner[i]]; \
            return isogi_vol__convoy_sides_##path(v, met, layer, f, in, out); \
        } \
        met = isogi_vol__convoy_sides_##path(v, met, layer, NULL, in, out); \
        i = met ? isogi_vol__convoy_corners(v, cell, f) : 0; \
        *in = i > 0 ? met : 0, *out = i ? 0 : met; \
        return i < 0 ? isogi_vol__convoy_sides_##path(v, met, layer, f, in, out) : met; \
    } \
    target static void isogi_vol__convoy_leaf_##path(isogi_vol__convoy *v, isogi_vol__batch *b, unsigned met) { \
        const isogi_vol__ride *lead = &v->lead; \
        const float at = lead->leaf.code ? lead->leaf.isovalue : 0, doubt = lead->leaf.code ? ISOGI_VOL__DOUBT : ISOGI_VOL__UNSURE; \
        uint64_t cells = lead->trip.cells; \
        v->bound[0] = at - doubt, v->bound[1] = at + doubt, v->bound[2] = 3 * v->bound[0], v->bound[3] = 3 * v->bound[1]; \
        isogi_vol__convoy_layers_##path(v, v->beam.corner); \
        for (; cells && met & v->active; cells &= cells - 1) { \
            const int child = isogi_vol__lowest_bit(cells), here = child ^ lead->trip.flip; \
            unsigned in, out, same, passed, found; \
            float layer[3]; \
            int32_t cell[4]; \
            int i; \
            layer[0] = (float)(child & 3), layer[1] = (float)(child >> 2 & 3), layer[2] = (float)(child >> 4); \
            isogi_vol__child_place(cell, lead->trip.place[0], lead->walk.pyramid->ways->inner[here]); \
            passed = isogi_vol__convoy_look_##path(v, met & v->active, layer, here, cell, &in, &out); \
            found = (in | out) & ~(v->inside | v->outside | v->leaving); \
            if (found) { \
                found &= isogi_vol__convoy_within_##path(v, layer); \
                v->inside |= found & in, v->outside |= found & out; \
                for (; found; found &= found - 1) { \
                    i = isogi_vol__lowest_bit(found); \
                    v->ride[i].walk.inside = (int)(in >> i & 1); \
                } \
            } \
            same = (in & v->inside) | (out & v->outside); \
            b->work.cells += isogi_vol__count_bits(same); \
            for (passed &= ~same; passed; passed &= passed - 1) { \
                isogi_vol__ride *r = &v->ride[i = isogi_vol__lowest_bit(passed)]; \
                isogi_vol__trip *c = &r->trip; \
                double begin, end; \
                isogi_hit any; \
                if (!isogi_vol__passes_##path(r, cell, &begin, &end)) continue; \
                if (isogi_vol__mixed_cell_##path(&r->walk, cell[0], cell[1], cell[2], c->in == 3 ? c->entry_axis : c->in, \
                                                 c->out == 3 ? -1 : c->out, b->hits ? &b->hits[r->number] : &any)) { \
                    v->active &= ~(1u << i); \
                    isogi_vol__finish(b, r->number, &r->walk, 1); \
                } else isogi_vol__take_side(v, &r->walk, i); \
            } \
        } \
    } \
    target static void isogi_vol__convoy_on_##path(isogi_vol__convoy *v, isogi_vol__batch *b) { \
        isogi_vol__ride *lead = &v->lead; \
        const isogi_pyramid *p = lead->walk.pyramid; \
        unsigned met[ISOGI_VOL__NODE_LEVELS], lanes = v->active; \
        if (lead->trip.low > lead->trip.high) return; \
        for (;;) { \
            met[lead->at] = lanes; \
            b->work.blocks += isogi_vol__count_bits(lanes); \
            isogi_vol__open_any_##path(lead, isogi_vol__beam_way_##path(&v->beam, p->ways, lead->at)); \
            if (!lead->at && lead->trip.cells) isogi_vol__convoy_leaf_##path(v, b, lanes); \
            do { \
                int a; \
                if (!v->active || !isogi_vol__trip_next(lead)) return; \
                for (a = 0; a < 3; a++) { /* counted backwards within the root */ \
                    const int32_t all = (1 << 2 * (p->node_levels - 1 - lead->at)) - 1; \
                    v->beam.corner[a] = (float)((lead->trip.place[lead->at][a] ^ (all & -lead->trip.lead[a])) << (2 * lead->at + 2)); \
                } \
                lanes = met[lead->at + 1] & v->active; \
                if (lanes) lanes &= isogi_vol__convoy_meets_##path(v, 4 * p->ways->size[lead->at]); \
            } while (!lanes); \
        } \
    }

#define ISOGI_VOL__LANES_base 4
#define ISOGI_VOL__WIDE_base(operation) ISOGI_VOL__FOUR(operation)
typedef isogi_vol__four isogi_vol__wide_base;
ISOGI_VOL__CONVOY_ON(base, )

#ifdef ISOGI_VOL__AVX
#define ISOGI_VOL__LANES_avx2 8
#define ISOGI_VOL__WIDE_avx2(operation) _mm256_##operation
typedef __m256 isogi_vol__wide_avx2;
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE unsigned isogi_vol__at_most_avx2(__m256 a, __m256 b) {
    return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ));
}
ISOGI_VOL__CONVOY_ON(avx2, ISOGI_VOL__TARGET("avx2"))
#endif
#undef ISOGI_VOL__CONVOY_ON
#undef ISOGI_VOL__WIDE_base
#undef ISOGI_VOL__WIDE_avx2
#undef ISOGI_VOL__LANES_base
#undef ISOGI_VOL__LANES_avx2

/* Takes rays that coincide to their hits or ends. Not inlined, so that its stack does not add to that of a ray alone. */
ISOGI_VOL__NOINLINE static void isogi_vol__trace_convoy(isogi_vol__batch *b, isogi_vol__ride *ride, int count) {
    isogi_vol__convoy v;
    int i;
    isogi_vol__set_convoy(&v, ride, count);
#ifdef ISOGI_VOL__AVX
    if (b->pyramid->path >= ISOGI_VOL__PATH_AVX2) isogi_vol__convoy_on_avx2(&v, b);
    else
#endif
    isogi_vol__convoy_on_base(&v, b);
    for (i = 0; i < count; i++) {
        isogi_vol__walk *w = &ride[i].walk;
        isogi_hit any;
        if (!(v.active >> i & 1)) continue;
        isogi_vol__finish(b, ride[i].number, w,
                          isogi_vol__leaves_inside(w, ride[i].flags, b->hits ? &b->hits[ride[i].number] : &any));
    }
}

/* ---- rays in turns ---- */

/* The next ray before ray `end` that goes from node to node gets on; those before it that do not are done with. 0: there is none. */
static int isogi_vol__ride_begin(isogi_vol__batch *b, isogi_vol__ride *r, size_t *next, size_t end) {
    while (*next < end) {
        const size_t i = (*next)++;
        isogi_hit any;
        int found = 0;
        if (b->bundles && i / b->each != b->opened) isogi_vol__open_bundle(b, i / b->each);
        r->number = i, r->flags = isogi_vol__flags(b, i);
        if (isogi_vol__begin(b, i, &r->walk)) {
            if (!isogi_vol__ride_set(r)) found = isogi_vol__walk_plainly(r, b->hits ? &b->hits[i] : &any);
            else if (!isogi_vol__enters_inside(&r->walk, b->hits ? &b->hits[i] : &any)) return 1;
            else found = 1;
        }
        isogi_vol__finish(b, i, &r->walk, found);
    }
    return 0;
}

/* What rays are to do next: open a node, or a leaf, look at a cell, decide about one, or go on to the next node. */
enum { ISOGI_VOL__OPEN_NODE, ISOGI_VOL__OPEN_LEAF, ISOGI_VOL__LOOK, ISOGI_VOL__DECIDE, ISOGI_VOL__GO_ON, ISOGI_VOL__DEEDS };

/* Rays, by what they do next. */
typedef struct isogi_vol__agenda {
    int count[ISOGI_VOL__DEEDS];
    uint8_t ride[ISOGI_VOL__DEEDS][ISOGI_VOL__CONVOY];
} isogi_vol__agenda;

ISOGI_VOL__INLINE void isogi_vol__agenda_add(isogi_vol__agenda *agenda, int deed, int i) {
    agenda->ride[deed][agenda->count[deed]++] = (uint8_t)i;
}

/* To the root. */
ISOGI_VOL__INLINE void isogi_vol__agenda_begin(isogi_vol__agenda *agenda, isogi_vol__ride *r, int i) {
    isogi_vol__ride_start(r);
    isogi_vol__agenda_add(agenda, r->trip.low > r->trip.high ? ISOGI_VOL__GO_ON : r->at ? ISOGI_VOL__OPEN_NODE : ISOGI_VOL__OPEN_LEAF, i);
}

/* Done with ride i, whose place the next ray takes; 0: there is none. */
static int isogi_vol__agenda_renew(isogi_vol__batch *b, isogi_vol__agenda *agenda, isogi_vol__ride *ride, int i, int found, size_t *next,
                                   size_t end) {
    isogi_vol__ride *r = &ride[i];
    isogi_hit any;
    found = found || isogi_vol__leaves_inside(&r->walk, r->flags, b->hits ? &b->hits[r->number] : &any);
    isogi_vol__finish(b, r->number, &r->walk, found);
    if (!isogi_vol__ride_begin(b, r, next, end)) return 0;
    isogi_vol__agenda_begin(agenda, r, i);
    return 1;
}

/* n rays, and those that come after them, go on together, in rounds; in each all that do the same do it one after the other: then few
   branches are hard to foretell, one ray's arithmetic overlaps the next one's, and memory arrives while others have their turn. What
   needs none of its own is done in the same round. */
#define ISOGI_VOL__TAKE_TURNS(path, target) \
    ISOGI_VOL__NOINLINE target static void isogi_vol__take_turns_##path(isogi_vol__batch *b, isogi_vol__ride *ride, int n, size_t *next, \
                                                                        size_t end) { \
        const struct isogi_vol__ways *ways = b->pyramid->ways; \
        isogi_vol__agenda agenda[2]; \
        isogi_hit any; \
        int now = 0, i, k; \
        memset(agenda, 0, sizeof agenda); \
        for (i = 0; i < n; i++) isogi_vol__agenda_begin(&agenda[0], &ride[i], i); \
        for (; n; now = !now) { \
            isogi_vol__agenda *these = &agenda[now], *then = &agenda[!now]; \
            memset(then->count, 0, sizeof then->count); \
            for (k = 0; k < these->count[ISOGI_VOL__OPEN_NODE]; k++) { \
                isogi_vol__ride *r = &ride[i = these->ride[ISOGI_VOL__OPEN_NODE][k]]; \
                isogi_vol__open_node_##path(r, isogi_vol__trip_way_##path(&r->trip, ways, r->at)); \
                isogi_vol__agenda_add(these, ISOGI_VOL__GO_ON, i); \
            } \
            for (k = 0; k < these->count[ISOGI_VOL__OPEN_LEAF]; k++) { \
                isogi_vol__ride *r = &ride[i = these->ride[ISOGI_VOL__OPEN_LEAF][k]]; \
                isogi_vol__open_leaf_##path(r, isogi_vol__trip_way_##path(&r->trip, ways, 0)); \
                isogi_vol__agenda_add(these, r->trip.cells ? ISOGI_VOL__LOOK : ISOGI_VOL__GO_ON, i); \
            } \
            for (k = 0; k < these->count[ISOGI_VOL__DECIDE]; k++) { \
                isogi_vol__ride *r = &ride[i = these->ride[ISOGI_VOL__DECIDE][k]]; \
                if (isogi_vol__trip_decide_##path(r, b->hits ? &b->hits[r->number] : &any)) \
                    n -= !isogi_vol__agenda_renew(b, then, ride, i, 1, next, end); \
                else isogi_vol__agenda_add(these, r->trip.cells ? ISOGI_VOL__LOOK : ISOGI_VOL__GO_ON, i); \
            } \
            for (k = 0; k < these->count[ISOGI_VOL__LOOK]; k++) { \
                isogi_vol__ride *r = &ride[i = these->ride[ISOGI_VOL__LOOK][k]]; \
                const int found = isogi_vol__trip_look_##path(r); \
                if (found > 0) n -= !isogi_vol__agenda_renew(b, then, ride, i, 1, next, end); \
                else if (found < 0 || r->trip.cells) isogi_vol__agenda_add(then, found < 0 ? ISOGI_VOL__DECIDE : ISOGI_VOL__LOOK, i); \
                else isogi_vol__agenda_add(these, ISOGI_VOL__GO_ON, i); \
            } \
            for (k = 0; k < these->count[ISOGI_VOL__GO_ON]; k++) { \
                isogi_vol__ride *r = &ride[i = these->ride[ISOGI_VOL__GO_ON][k]]; \
                if (isogi_vol__trip_next(r)) isogi_vol__agenda_add(then, r->at ? ISOGI_VOL__OPEN_NODE : ISOGI_VOL__OPEN_LEAF, i); \
                else n -= !isogi_vol__agenda_renew(b, then, ride, i, 0, next, end); \
            } \
        } \
    }

ISOGI_VOL__TAKE_TURNS(base, )
#ifdef ISOGI_VOL__AVX
ISOGI_VOL__TAKE_TURNS(avx2, ISOGI_VOL__TARGET("avx2"))
#endif
#undef ISOGI_VOL__TAKE_TURNS

/* Sixteen rays at a time that nearly coincide; where they do not, they and the next ones go in turns, ever more of them each time. */
ISOGI_VOL__NOINLINE static void isogi_vol__trace_rides(isogi_vol__batch *b) {
    const int may_coincide = !b->bundles || b->bundle_count == 1;
    isogi_vol__ride ride[ISOGI_VOL__CONVOY];
    size_t next = 0, run = 64;
    while (next < b->count) {
        size_t end = b->count;
        int n = 0;
        while (n < ISOGI_VOL__CONVOY && isogi_vol__ride_begin(b, &ride[n], &next, end)) n++;
        if (may_coincide && n >= ISOGI_VOL__CONVOY / 4) {
            if (isogi_vol__rides_coincide(ride, n)) {
                isogi_vol__trace_convoy(b, ride, n);
                run = 64;
                continue;
            }
            if (end - next > run) end = next + run, run *= 4;
        }
#ifdef ISOGI_VOL__AVX
        if (b->pyramid->path >= ISOGI_VOL__PATH_AVX2) isogi_vol__take_turns_avx2(b, ride, n, &next, end);
        else
#endif
        isogi_vol__take_turns_base(b, ride, n, &next, end);
    }
}

#ifdef ISOGI_VOL__AVX
/* ---- sixteen rays side by side ---- */

/* Rays that nearly coincide, as neighbours in a picture do, go from node to node together, in a pool's first slots: a node is opened once
   for all of them, and a child or cell costs two times for each ray in float, when it enters and when it leaves. These are widened by
   ISOGI_VOL__REACH of a child, more than floats err by, hence no child is left out. Cells that are certainly on one side all along are done
   with; a cell in doubt is left to the times and numbers in double that a pool goes by, by which a ray may only have come near: hits are
   the same. What a ray's side is comes from there alone, since cells that it comes near may be out of its order. All rays fall along the
   same axes and count backwards there, so one order of children suits them all. */
typedef struct __attribute__((aligned(64))) isogi_vol__layers {
    __m512 per[3], first[3], last[3], stop; /* from somewhere on, the rays enter layer i of cells at i per - first,
                                               leave it at (i + 1) per - last */
} isogi_vol__layers;

ISOGI_VOL__AVX512 static void isogi_vol__set_packet(isogi_vol__packet *k, const isogi_vol__pool *s, int first, int64_t backwards,
                                                    int levels) {
    const __m512d most = _mm512_set1_pd(1e28); /* finite in float times all cells squared */
    int a, h;
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        const int64_t back = backwards >> 16 * a & 0xffff;
        const __m512d unit = _mm512_set1_pd(back ? -1 : 1), corner = _mm512_set1_pd(back ? (double)(back + 1) : 0);
        __m512d place[2], way[2], inverse[2];
#pragma GCC unroll 2
        for (h = 0; h < 2; h++) {
            place[h] = _mm512_fmadd_pd(_mm512_load_pd(&s->origin[a][8 * h]), unit, corner);
            way[h] = _mm512_abs_pd(_mm512_load_pd(&s->dir[a][8 * h]));
            inverse[h] = _mm512_min_pd(_mm512_abs_pd(_mm512_load_pd(&s->inverse[a][8 * h])), most);
            _mm512_store_pd(&k->place[a][8 * h], place[h]), _mm512_store_pd(&k->way[a][8 * h], way[h]);
        }
        k->at[a] = isogi_vol__halves(place[0], place[1]), k->dir[a] = isogi_vol__halves(way[0], way[1]);
        k->inverse[a] = isogi_vol__halves(inverse[0], inverse[1]);
    }
    k->stop = _mm512_mul_ps(isogi_vol__halves(_mm512_load_pd(&s->stop[0]), _mm512_load_pd(&s->stop[8])), _mm512_set1_ps(1.000001f));
    k->padded = (float)(1 << 2 * levels);
    /* floats are off by less than 2^-21 of what the root measures; nodes are widened by twice as much */
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        const __m512 reach = _mm512_set1_ps(1e-6f * k->padded);
        k->enter[a] = _mm512_mul_ps(_mm512_add_ps(k->at[a], reach), k->inverse[a]);
        k->leave[a] = _mm512_mul_ps(_mm512_sub_ps(k->at[a], reach), k->inverse[a]);
    }
    k->axis = k->way[1][first] > k->way[0][first];
    if (k->way[2][first] > k->way[k->axis][first]) k->axis = 2;
}

/* Which rays meet a node or come near it; size: of its sides; cell: its corner. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __mmask16 isogi_vol__meet_node(const isogi_vol__packet *k, int64_t cell, float size) {
    const __m128 corner = _mm_cvtepi32_ps(_mm_cvtepu16_epi32(_mm_cvtsi64_si128(cell)));
    __attribute__((aligned(16))) float low[4], high[4];
    __m512 enter = _mm512_setzero_ps(), leave = k->stop;
    int a;
    _mm_store_ps(low, corner), _mm_store_ps(high, _mm_add_ps(corner, _mm_set1_ps(size)));
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        enter = _mm512_max_ps(enter, _mm512_fmsub_ps(_mm512_set1_ps(low[a]), k->inverse[a], k->enter[a]));
        leave = _mm512_min_ps(leave, _mm512_fmsub_ps(_mm512_set1_ps(high[a]), k->inverse[a], k->leave[a]));
    }
    return _mm512_cmp_ps_mask(enter, leave, _CMP_LE_OQ);
}

/* The layers of cells of a leaf, from where the rays come to its first plane on the axis on which they are fastest: rays that meet it
   are then next to it, and their places in cells are exact. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__open_cells(isogi_vol__layers *l, __m512 place[3], const isogi_vol__packet *k,
                                                               const isogi_vol__pool *s, int64_t cell) {
    const __m512 reach = _mm512_set1_ps(ISOGI_VOL__REACH);
    const __m512d plane = _mm512_set1_pd((double)(cell >> 16 * k->axis & 0xffff));
    __m512d zero[2], left[2];
    int a, h;
#pragma GCC unroll 2
    for (h = 0; h < 2; h++) {
        const __m512d stop = _mm512_load_pd(&s->stop[8 * h]), inverse = _mm512_abs_pd(_mm512_load_pd(&s->inverse[k->axis][8 * h]));
        zero[h] = _mm512_mul_pd(_mm512_sub_pd(plane, _mm512_load_pd(&k->place[k->axis][8 * h])), inverse);
        zero[h] = _mm512_min_pd(_mm512_max_pd(zero[h], _mm512_setzero_pd()), stop);
        left[h] = _mm512_sub_pd(stop, zero[h]);
    }
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        const __m512d corner = _mm512_set1_pd((double)(cell >> 16 * a & 0xffff));
        const __m512d p0 = _mm512_fmadd_pd(zero[0], _mm512_load_pd(&k->way[a][0]), _mm512_load_pd(&k->place[a][0]));
        const __m512d p1 = _mm512_fmadd_pd(zero[1], _mm512_load_pd(&k->way[a][8]), _mm512_load_pd(&k->place[a][8]));
        const __m512 at = isogi_vol__halves(_mm512_sub_pd(p0, corner), _mm512_sub_pd(p1, corner)), per = k->inverse[a];
        l->per[a] = per, l->first[a] = _mm512_mul_ps(_mm512_add_ps(at, reach), per),
        l->last[a] = _mm512_mul_ps(_mm512_sub_ps(at, reach), per);
        place[a] = at;
    }
    l->stop = _mm512_mul_ps(isogi_vol__halves(left[0], left[1]), _mm512_set1_ps(1.000001f));
}

/* A layer's number comes from memory, which spreads it in passing. */
static const float isogi_vol__layer_numbers[5] = {0, 1, 2, 3, 4};

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__enter16(const isogi_vol__layers *l, int axis, size_t layer) {
    return _mm512_fmsub_ps(_mm512_set1_ps(isogi_vol__layer_numbers[layer]), l->per[axis], l->first[axis]);
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__leave16(const isogi_vol__layers *l, int axis, size_t layer) {
    return _mm512_fmsub_ps(_mm512_set1_ps(isogi_vol__layer_numbers[layer + 1]), l->per[axis], l->last[axis]);
}

/* When the rays enter a cell, and when they leave it. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__enter_child(const isogi_vol__layers *l, const size_t at[3]) {
    return _mm512_max_ps(_mm512_max_ps(isogi_vol__enter16(l, 0, at[0]), _mm512_setzero_ps()),
                         _mm512_max_ps(isogi_vol__enter16(l, 1, at[1]), isogi_vol__enter16(l, 2, at[2])));
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__leave_child(const isogi_vol__layers *l, const size_t at[3]) {
    return _mm512_min_ps(_mm512_min_ps(isogi_vol__leave16(l, 0, at[0]), l->stop),
                         _mm512_min_ps(isogi_vol__leave16(l, 1, at[1]), isogi_vol__leave16(l, 2, at[2])));
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__mix16(__m512 a, __m512 b, __m512 u) {
    return _mm512_fmadd_ps(u, _mm512_sub_ps(b, a), a);
}

/* Cells of a leaf: for which rays it is certain that they stay on one side. Like sides8, for one cell and many rays. */
typedef struct isogi_vol__sides16 { unsigned in, out, in0, out0, in1, out1; } isogi_vol__sides16;

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__look16(isogi_vol__sides16 *sides, const __m512 place[3], const __m512 dir[3],
                                                           __m512 enter, __m512 leave, const size_t at[3], uint8_t lowest,
                                                           const __m512i voxel[2], const float bound[4]) {
    static const uint8_t corners[16] = {0, 1, 5, 6, 25, 26, 30, 31};
    const __m512 zero = _mm512_setzero_ps(), one = _mm512_set1_ps(1);
    const __m512 low = _mm512_set1_ps(bound[0]), high = _mm512_set1_ps(bound[1]);
    const __m512 low3 = _mm512_set1_ps(bound[2]), high3 = _mm512_set1_ps(bound[3]);
    const __m128i index = _mm_add_epi8(_mm_loadu_si128((const __m128i *)(const void *)corners), _mm_set1_epi8((char)lowest));
    __attribute__((aligned(32))) float corner[8];
    __m512 from[3], to[3], c[2][4], f[2][2][2], sum1, sum2;
    int k, e;
    _mm256_store_ps(corner, _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(
                                _mm512_castsi512_si128(_mm512_permutex2var_epi8(voxel[0], _mm512_castsi128_si512(index), voxel[1])))));
#pragma GCC unroll 3
    for (k = 0; k < 3; k++) {
        const __m512 base = _mm512_sub_ps(place[k], _mm512_set1_ps(isogi_vol__layer_numbers[at[k]]));
        from[k] = _mm512_min_ps(_mm512_max_ps(_mm512_fmadd_ps(enter, dir[k], base), zero), one);
        to[k] = _mm512_min_ps(_mm512_max_ps(_mm512_fmadd_ps(leave, dir[k], base), zero), one);
    }
#pragma GCC unroll 4
    for (k = 0; k < 4; k++) {
        const __m512 a = _mm512_set1_ps(corner[2 * k]), rise = _mm512_sub_ps(_mm512_set1_ps(corner[2 * k + 1]), a);
        c[0][k] = _mm512_fmadd_ps(from[0], rise, a), c[1][k] = _mm512_fmadd_ps(to[0], rise, a);
    }
#pragma GCC unroll 2
    for (e = 0; e < 2; e++) {
        const __m512 near0 = isogi_vol__mix16(c[e][0], c[e][1], from[1]), near1 = isogi_vol__mix16(c[e][2], c[e][3], from[1]);
        const __m512 far0 = isogi_vol__mix16(c[e][0], c[e][1], to[1]), far1 = isogi_vol__mix16(c[e][2], c[e][3], to[1]);
        f[e][0][0] = isogi_vol__mix16(near0, near1, from[2]), f[e][0][1] = isogi_vol__mix16(near0, near1, to[2]);
        f[e][1][0] = isogi_vol__mix16(far0, far1, from[2]), f[e][1][1] = isogi_vol__mix16(far0, far1, to[2]);
    }
    sum1 = _mm512_add_ps(f[1][0][0], _mm512_add_ps(f[0][1][0], f[0][0][1])),
    sum2 = _mm512_add_ps(f[0][1][1], _mm512_add_ps(f[1][0][1], f[1][1][0]));
    sides->in0 = _mm512_cmp_ps_mask(f[0][0][0], high, _CMP_GT_OQ), sides->out0 = _mm512_cmp_ps_mask(f[0][0][0], low, _CMP_LT_OQ);
    sides->in1 = _mm512_cmp_ps_mask(f[1][1][1], high, _CMP_GT_OQ), sides->out1 = _mm512_cmp_ps_mask(f[1][1][1], low, _CMP_LT_OQ);
    sides->in = sides->in0 & sides->in1 & _mm512_cmp_ps_mask(_mm512_min_ps(sum1, sum2), high3, _CMP_GT_OQ);
    sides->out = sides->out0 & sides->out1 & _mm512_cmp_ps_mask(_mm512_max_ps(sum1, sum2), low3, _CMP_LT_OQ);
}

/* Rays in doubt, each of its slot's cell: those that pass it are decided in double. Returns hits; in, known: the sides on which rays are;
   *alone: those that are left to the code for one. Not inlined, so that its stack does not add to that of that code. */
ISOGI_VOL__AVX512 ISOGI_VOL__NOINLINE static unsigned isogi_vol__settle16(isogi_vol__batch *b, isogi_vol__pool *s, unsigned doubt,
                                                                          unsigned in, unsigned known, unsigned *alone) {
    static const uint8_t slots[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const __m512i three = _mm512_set1_epi64(3), none = _mm512_set1_epi64(-1);
    isogi_vol__decision k[2];
    unsigned hits = 0, lone = 0;
    int h, g, first[2], groups = 0;
    for (h = 0; h < 16; h += 8) {
        const __m512i old = _mm512_load_si512(&s->cell[h]);
        const __m512i side = _mm512_mask_mov_epi64(none, (__mmask8)(known >> h), _mm512_maskz_set1_epi64((__mmask8)(in >> h), 1));
        __m512i cell = old, begin = three, end = _mm512_load_si512(&s->end[h]);
        __m512d origin[3], inverse[3], dir[3];
        __m256 from[3], to[3];
        __mmask8 passed;
        int a;
        _mm512_store_si512(&s->side[h], side);
        if (!(doubt >> h & 255)) continue;
#pragma GCC unroll 3
        for (a = 0; a < 3; a++)
            origin[a] = _mm512_load_pd(&s->origin[a][h]), inverse[a] = _mm512_load_pd(&s->inverse[a][h]),
            dir[a] = _mm512_load_pd(&s->dir[a][h]);
        isogi_vol__way8(cell, origin, inverse, dir, &begin, &end, from, to);
        passed = _mm512_mask_cmplt_epi64_mask((__mmask8)(doubt >> h), begin, end);
        if (!passed) continue;
        cell = _mm512_or_si512(cell, _mm512_or_si512(_mm512_slli_epi64(_mm512_and_si512(begin, three), 48),
                                                     _mm512_slli_epi64(_mm512_and_si512(end, three), 50)));
        cell = _mm512_mask_mov_epi64(old, passed, cell);
        _mm512_store_si512(&s->cell[h], cell);
        if (!(passed & (passed - 1))) { /* one ray costs less by itself */
            lone |= (unsigned)passed << h;
            continue;
        }
        isogi_vol__decide_some(b, s, slots + h, 1, passed, cell, side, &k[groups]);
        _mm512_store_si512(&s->side[h],
                           _mm512_mask_mov_epi64(_mm512_mask_mov_epi64(side, k[groups].same, _mm512_maskz_set1_epi64(k[groups].inside, 1)),
                                                 k[groups].broken, none));
        first[groups++] = h;
    }
    if (b->hits && groups == 1 && k[0].cross) isogi_vol__refine8(b, k, 1);
    else if (b->hits && groups == 2 && k[0].cross | k[1].cross) isogi_vol__refine8(b, k, 2);
    for (g = 0, *alone = lone; g < groups; g++) {
        if (b->hits && k[g].cross) isogi_vol__write8(b, s, slots + first[g], &k[g]);
        hits |= (unsigned)k[g].cross << first[g], *alone |= (unsigned)k[g].odd << first[g];
    }
    return hits;
}

ISOGI_VOL__AVX512 static unsigned isogi_vol__settle(isogi_vol__batch *b, isogi_vol__pool *s, unsigned doubt, unsigned *in, unsigned *out) {
    unsigned alone, hits = isogi_vol__settle16(b, s, doubt, *in, *in | *out, &alone);
    int h;
    for (; alone; alone &= alone - 1) {
        const int slot = __builtin_ctz(alone);
        isogi_hit any;
        hits |= (unsigned)isogi_vol__decide(b, s, slot, b->hits ? &b->hits[s->ray[slot]] : &any) << slot;
    }
    for (h = 0, *in = *out = 0; h < 16; h += 8) {
        const __m512i side = _mm512_load_si512(&s->side[h]);
        *in |= (unsigned)_mm512_cmpgt_epi64_mask(side, _mm512_setzero_si512()) << h;
        *out |= (unsigned)_mm512_testn_epi64_mask(side, side) << h;
    }
    return hits;
}

/* Whether the rays in a pool's first slots nearly coincide. */
ISOGI_VOL__AVX512 static int isogi_vol__seats_coincide(const isogi_vol__pool *s, unsigned rays) {
    const int first = __builtin_ctz(rays);
    double most = 0;
    int a, h;
    for (a = 0; a < 3; a++) most = isogi_vol__max(most, fabs(s->dir[a][first]));
    if (!(most > 1e-12 && most < 1e12)) return 0;
    for (h = 0; h < 2; h++) {
        const __m512d isovalue = _mm512_sub_pd(_mm512_load_pd(&s->isovalue[8 * h]), _mm512_set1_pd(s->isovalue[first]));
        const __mmask8 here = (__mmask8)(rays >> 8 * h);
        __m512d turned = _mm512_setzero_pd(), apart = turned;
        __mmask8 off;
#pragma GCC unroll 3
        for (a = 0; a < 3; a++) {
            turned = _mm512_max_pd(
                turned, _mm512_abs_pd(_mm512_sub_pd(_mm512_load_pd(&s->dir[a][8 * h]), _mm512_set1_pd(s->dir[a][first]))));
            apart = _mm512_max_pd(
                apart, _mm512_abs_pd(_mm512_sub_pd(_mm512_load_pd(&s->origin[a][8 * h]), _mm512_set1_pd(s->origin[a][first]))));
        }
        off = _mm512_cmp_pd_mask(isovalue, _mm512_setzero_pd(), _CMP_NEQ_UQ);
        off |= _mm512_cmpneq_epi64_mask(_mm512_load_si512(&s->flip[8 * h]), _mm512_set1_epi64(s->flip[first]));
        off |= _mm512_cmp_pd_mask(turned, _mm512_set1_pd(0.06 * most), _CMP_GT_OQ);
        off |= _mm512_cmp_pd_mask(apart, _mm512_set1_pd(8), _CMP_GT_OQ);
        if (off & here) return 0;
    }
    return 1;
}

/* The beam that holds all rays of a packet: along the axis on which they are fastest, bounds of their places on the next two axes, linear
   between its ends. (The least of linear functions lies above its chord.) */
typedef struct __attribute__((aligned(64))) isogi_vol__packet_beam {
    float base[16], slope[16];                 /* lower bounds on the next axis at 0, on the one after it at 4, then upper ones */
    float from, to;                            /* on the main axis */
    int axis, side[2];
    const int32_t (*main[2])[16], (*other[2])[16]; /* layers of children in 16 lanes, of both pairs of axes */
    uint64_t places[2], copies[2];             /* where children are whose two layers a lane stands for */
} isogi_vol__packet_beam;

/* The largest of each of eight vectors: of the first four in lane 0 of a row of four each, of the others in lane 1. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512 isogi_vol__largest_of(const __m512 v[8]) {
    __m512 two[4], four[2], eight;
    int i;
#pragma GCC unroll 4
    for (i = 0; i < 4; i++)
        two[i] = _mm512_max_ps(_mm512_shuffle_f32x4(v[2 * i], v[2 * i + 1], 0x44), _mm512_shuffle_f32x4(v[2 * i], v[2 * i + 1], 0xee));
#pragma GCC unroll 2
    for (i = 0; i < 2; i++)
        four[i] = _mm512_max_ps(_mm512_shuffle_f32x4(two[2 * i], two[2 * i + 1], 0x88),
                                _mm512_shuffle_f32x4(two[2 * i], two[2 * i + 1], 0xdd));
    eight = _mm512_max_ps(_mm512_unpacklo_ps(four[0], four[1]), _mm512_unpackhi_ps(four[0], four[1]));
    return _mm512_max_ps(eight, _mm512_permute_ps(eight, 0x4e));
}

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__set_packet_beam(isogi_vol__packet_beam *beam, const isogi_vol__packet *k,
                                                                const struct isogi_vol__ways *ways, unsigned rays) {
    static const int after[5] = {0, 1, 2, 0, 1};
    static const uint64_t places[3] = {0xffff, 0x000f000f000f000fu, 0x1111111111111111u}, copies[3] = {0x0001000100010001u, 0x1111, 0xf};
    const __m512 slack = _mm512_set1_ps(k->padded * 2e-6f), sign = _mm512_set1_ps(-0.0f); /* floats are off by less than half of this */
    const __m512i lane = _mm512_mask_mov_epi32(_mm512_set1_epi32(__builtin_ctz(rays)), (__mmask16)rays,
                                               _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
    const int axis = k->axis;
    const __m512 main = _mm512_permutexvar_ps(lane, k->at[axis]), way = _mm512_permutexvar_ps(lane, k->dir[axis]);
    const __m512 to = _mm512_fmadd_ps(_mm512_permutexvar_ps(lane, k->stop), way, main), per = _mm512_div_ps(_mm512_set1_ps(1), way);
    const float from = _mm512_reduce_min_ps(main), end = _mm512_reduce_max_ps(to);
    const float length = end - from > 1e-3f ? end - from : 1e-3f;
    const __m512 begins = _mm512_sub_ps(_mm512_set1_ps(from), main), ends = _mm512_add_ps(begins, _mm512_set1_ps(length));
    __m512 bound[8], base, slope;
    int a;
    beam->axis = axis, beam->from = from, beam->to = end;
#pragma GCC unroll 2
    for (a = 0; a < 2; a++) {
        const __m512 at = _mm512_permutexvar_ps(lane, k->at[after[axis + 1 + a]]);
        const int rows = axis > 1 - a; /* layers of the main axis are in rows of four lanes, those of the other down these, or vice versa */
        beam->side[a] = after[axis + 1 + a], beam->main[a] = rows ? ways->row : ways->lane, beam->other[a] = rows ? ways->lane : ways->row;
        beam->places[a] = places[axis + beam->side[a] - 1], beam->copies[a] = copies[axis + beam->side[a] - 1];
        slope = _mm512_mul_ps(_mm512_permutexvar_ps(lane, k->dir[beam->side[a]]), per);
        bound[2 + a] = _mm512_fmadd_ps(slope, begins, at), bound[6 + a] = _mm512_fmadd_ps(slope, ends, at);
        bound[a] = _mm512_xor_ps(bound[2 + a], sign), bound[4 + a] = _mm512_xor_ps(bound[6 + a], sign);
    }
    base = isogi_vol__largest_of(bound);
    slope = _mm512_mul_ps(_mm512_sub_ps(_mm512_permute_ps(base, 0x55), _mm512_permute_ps(base, 0)), _mm512_set1_ps(1 / length));
    base = _mm512_add_ps(_mm512_fnmadd_ps(slope, _mm512_set1_ps(from), _mm512_permute_ps(base, 0)), slack);
    _mm512_store_ps(beam->base, _mm512_mask_xor_ps(base, 0x00ff, base, sign));
    _mm512_store_ps(beam->slope, _mm512_mask_xor_ps(slope, 0x00ff, slope, sign));
}

/* Children of a node of level n that the beam may meet; cell: its corner, counted backwards. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__in_beam(const isogi_vol__packet_beam *beam, const struct isogi_vol__ways *ways,
                                                                int n, int64_t cell) {
    const __m512i corner = _mm512_castsi128_si512(_mm_cvtsi64_si128(cell));
    const __m512 size = _mm512_set1_ps(ways->size[n]), from = _mm512_set1_ps(beam->from), to = _mm512_set1_ps(beam->to);
    uint64_t met[2];
    int a;
#pragma GCC unroll 2
    for (a = 0; a < 2; a++) {
        const __m512 begin = isogi_vol__layers16(corner, beam->axis, beam->main[a][n]), end = _mm512_add_ps(begin, size);
        const __m512 side = isogi_vol__layers16(corner, beam->side[a], beam->other[a][n]);
        const __m512 lower = _mm512_fmadd_ps(_mm512_min_ps(_mm512_max_ps(begin, from), to), _mm512_set1_ps(beam->slope[4 * a]),
                                             _mm512_set1_ps(beam->base[4 * a]));
        const __m512 upper = _mm512_fmadd_ps(_mm512_min_ps(_mm512_max_ps(end, from), to), _mm512_set1_ps(beam->slope[8 + 4 * a]),
                                             _mm512_set1_ps(beam->base[8 + 4 * a]));
        const unsigned lanes = _mm512_cmp_ps_mask(lower, _mm512_add_ps(side, size), _CMP_LE_OQ) &
                               _mm512_cmp_ps_mask(upper, side, _CMP_GE_OQ);
        met[a] = _pdep_u64(lanes, beam->places[a]) * beam->copies[a];
    }
    return met[0] & met[1];
}

/* What is known of rays that go together, a bit each. */
typedef struct __attribute__((aligned(64))) isogi_vol__known {
    int64_t doubted[ISOGI_VOL__PACKET]; /* cells of those in doubt; those of hits stand in the slots */
    unsigned active, doubts, hits;      /* going on; that have come to a cell in doubt, without waiting for what it says; that have
                                           certainly passed the surface */
    unsigned alone;                     /* have not, though: they only came near the cell in which they did */
    unsigned in, out;                   /* the side on which they are; what is certain of cells that they came near */
    unsigned seen_in, seen_out;
} isogi_vol__known;

/* Works out what rays in doubt find in their cells, and the hits, each ray's first one first. */
ISOGI_VOL__AVX512 static void isogi_vol__settle_all(isogi_vol__batch *b, isogi_vol__pool *s, isogi_vol__known *k, unsigned hits) {
    const unsigned doubts = isogi_vol__any_will_do(b) ? k->doubts & ~k->hits : k->doubts, both = doubts & hits;
    __m512i later[2];
    unsigned found;
    int h;
    k->doubts = 0, k->hits &= ~hits;
    if (!(doubts | hits)) return;
    for (h = 0; h < 2; h++) {
        later[h] = _mm512_load_si512(&s->cell[8 * h]);
        _mm512_store_si512(&s->cell[8 * h], _mm512_mask_mov_epi64(later[h], (__mmask8)(doubts >> 8 * h),
                                                                  _mm512_load_si512(&k->doubted[8 * h])));
    }
    found = isogi_vol__settle(b, s, doubts | hits, &k->in, &k->out);
    if (k->hits & ~hits || both & ~found)
        for (h = 0; h < 2; h++) _mm512_store_si512(&s->cell[8 * h], later[h]);
    if (both & ~found) found |= isogi_vol__settle(b, s, both & ~found, &k->in, &k->out);
    k->active &= ~found, k->alone |= hits & ~found, k->hits &= ~found;
}

/* Goes through the cells of a leaf that can hold the surface; cell: its corner. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__look_in_leaf(isogi_vol__batch *b, isogi_vol__pool *s, const isogi_vol__packet *p,
                                                                 isogi_vol__known *k, const isogi_vol__leaf *leaf, const __m512i voxel[2],
                                                                 uint64_t mask, unsigned met, int64_t cell, int64_t backwards) {
    const float low = leaf->isovalue - ISOGI_VOL__DOUBT, high = leaf->isovalue + ISOGI_VOL__DOUBT;
    const float bound[4] = {low, high, 3 * low, 3 * high};
    isogi_vol__layers l;
    __m512 place[3];
    isogi_vol__open_cells(&l, place, p, s, cell);
    for (; mask; mask &= mask - 1) {
        const size_t child = (size_t)__builtin_ctzll(mask), at[3] = {child & 3, child >> 2 & 3, child >> 4};
        const int64_t here = (cell | (int64_t)_pdep_u64((uint64_t)child, 0x000300030003u)) ^ backwards;
        const __m512 enter = isogi_vol__enter_child(&l, at), leave = isogi_vol__leave_child(&l, at);
        unsigned lanes = met & k->active, hit, doubt;
        isogi_vol__sides16 sides;
        if (!lanes) return;
        lanes &= _mm512_cmp_ps_mask(enter, leave, _CMP_LE_OQ);
        isogi_vol__look16(&sides, place, p->dir, enter, leave, at, b->pyramid->ways->lowest[0][child], voxel, bound);
        hit = lanes & ((sides.out1 & (k->seen_in | sides.in0)) | (sides.in1 & (k->seen_out | sides.out0)));
        sides.in &= lanes & ~k->out, sides.out &= lanes & ~k->in, doubt = lanes & ~(hit | sides.in | sides.out);
        k->seen_in |= sides.in, k->seen_out |= sides.out;
        b->work.cells += (uint64_t)__builtin_popcount(lanes);
        if (b->hits) isogi_vol__send_for(&b->pyramid->volume, here, 1);
        if (ISOGI_VOL__UNLIKELY(doubt & k->doubts)) isogi_vol__settle_all(b, s, k, 0), hit &= k->active, doubt &= k->active;
        _mm512_mask_store_epi64(&s->cell[0], (__mmask8)hit, _mm512_set1_epi64(here));
        _mm512_mask_store_epi64(&s->cell[8], (__mmask8)(hit >> 8), _mm512_set1_epi64(here));
        k->hits |= hit, k->active &= ~hit;
        _mm512_mask_store_epi64(&k->doubted[0], (__mmask8)doubt, _mm512_set1_epi64(here));
        _mm512_mask_store_epi64(&k->doubted[8], (__mmask8)(doubt >> 8), _mm512_set1_epi64(here));
        k->doubts |= doubt;
        if (!(k->active & ~k->doubts)) isogi_vol__settle_all(b, s, k, isogi_vol__any_will_do(b) ? 0 : k->hits);
    }
}

/* Traces the rays in a pool's first slots, which coincide; the lowest level that has children left first, as walk_one does. */
ISOGI_VOL__AVX512 ISOGI_VOL__NOINLINE static void isogi_vol__trace_packet(isogi_vol__batch *b, isogi_vol__pool *s, unsigned rays) {
    const isogi_pyramid *p = b->pyramid;
    const struct isogi_vol__ways *ways = p->ways;
    const int first = __builtin_ctz(rays), flip = (int)s->flip[first], octant = (int)_pext_u32((unsigned)flip, 0x15),
              low = (int)s->low[first], high = (int)s->beyond[first] - 1;
    const float level = (float)s->level_units[first];
    const int64_t backwards = (int64_t)((_pdep_u64((uint64_t)octant, 0x000100010001u)) * (((uint64_t)1 << 2 * p->node_levels) - 1));
    const uint8_t *children[ISOGI_VOL__NODE_LEVELS], *node = p->nodes[p->node_level[p->node_levels - 1].first];
    uint64_t left[ISOGI_VOL__NODE_LEVELS];
    unsigned met[ISOGI_VOL__NODE_LEVELS], lanes = rays, pending = 0;
    isogi_vol__packet *packet = &s->of.packet;
    isogi_vol__packet_beam beam;
    isogi_vol__known known;
    int64_t cell = 0; /* corner of the node, counted backwards */
    int n = p->node_levels - 1;
    known.active = rays, known.doubts = known.hits = known.alone = known.in = known.out = known.seen_in = known.seen_out = 0;
    isogi_vol__set_packet(packet, s, first, backwards, p->node_levels);
    isogi_vol__set_packet_beam(&beam, packet, ways, rays);
    for (;;) {
        /* a node is opened */
        uint64_t mask = isogi_vol__in_beam(&beam, ways, n, cell);
        b->work.blocks += (uint64_t)__builtin_popcount(lanes);
        if (n) {
            const isogi_vol__node_level *below = &p->node_level[n - 1];
            const int64_t at = cell ^ backwards;
            const int shift = 2 * n + 2;
            mask &= isogi_vol__held(ways, octant, low, high, node);
            if (mask) {
                met[n] = lanes, left[n] = mask, pending |= 1u << n;
                children[n] = p->nodes[below->first + 64 * ((size_t)(at & 0xffff) >> shift) +
                                       64 * below->parents[0] *
                                           (((size_t)(at >> 16 & 0xffff) >> shift) + below->parents[1] * ((size_t)(at >> 32) >> shift))];
            }
        } else {
            isogi_vol__leaf leaf;
            __m512i voxel[2];
            mask &= isogi_vol__split_cells(ways, octant, &leaf, node, level);
            if (mask) {
                isogi_vol__order_voxels(ways, octant, node, voxel);
                isogi_vol__look_in_leaf(b, s, packet, &known, &leaf, voxel, mask, lanes, cell, backwards);
            }
        }
        /* on to the next child that some rays meet */
        for (lanes = 0; !lanes;) {
            int child;
            if (!pending || !known.active) goto out;
            n = __builtin_ctz(pending), lanes = met[n] & known.active;
            child = __builtin_ctzll(left[n]), left[n] &= left[n] - 1;
            if (!left[n] || !lanes) pending &= pending - 1;
            cell = (int64_t)(((uint64_t)cell & ways->above[n]) | _pdep_u64((uint64_t)child, ways->digit[n]));
            lanes &= isogi_vol__meet_node(packet, cell, ways->size[n]);
            node = children[n] + 128 * (child ^ flip);
            isogi_vol__fetch_node(children[n] + 128 * (__builtin_ctzll(left[n] ? left[n] : (uint64_t)1 << child) ^ flip));
        }
        n--;
    }
out:
    isogi_vol__settle_all(b, s, &known, isogi_vol__any_will_do(b) ? 0 : known.hits);
    _mm512_store_si512(&s->level[0], _mm512_set1_epi64(-1)), _mm512_store_si512(&s->level[8], _mm512_set1_epi64(-1));
    for (lanes = rays; b->occluded && lanes; lanes &= lanes - 1)
        b->occluded[s->ray[__builtin_ctz(lanes)]] = !(known.active >> __builtin_ctz(lanes) & 1);
    for (lanes = rays & known.active; b->hits && lanes; lanes &= lanes - 1)
        memset(&b->hits[s->ray[__builtin_ctz(lanes)]], 0, sizeof b->hits[0]);
    for (lanes = known.alone; lanes; lanes &= lanes - 1) /* what they hit is next to that cell */
        b->work.rays--, isogi_vol__trace_one(b, s->ray[__builtin_ctz(lanes)]);
}

/* ---- rays that begin in one place ----

   Rays of a bundle, and any others that follow each other from one place and for one isovalue, come from the root to the leaf in which they
   begin on one way. Its nodes are looked at once for all of them. */

ISOGI_VOL__AVX512 static void isogi_vol__prepare_descent(isogi_vol__descent *d, const isogi_pyramid *p, const double origin[3],
                                                         double isovalue) {
    int low, high, a, n;
    const float units = isogi_vol__quantise_isovalue(p, isovalue, &low, &high);
    size_t at[3];
    for (a = 0; a < 3; a++) {
        const int cell = (int)origin[a]; /* within the box */
        d->origin[a] = origin[a], at[a] = (size_t)(cell < p->cells[a] ? cell : p->cells[a] - 1);
    }
    d->isovalue = isovalue, d->leaf = p->nodes[0], d->step = 0;
    memset(d->held, 0, sizeof d->held);
    d->cell = (int64_t)(at[0] | (uint64_t)at[1] << 16 | (uint64_t)at[2] << 32);
    for (n = p->node_levels - 1; n >= 0; n--) {
        const uint8_t *node = p->nodes[isogi_vol__node_at(p, n, at[0] >> (2 * n + 2), at[1] >> (2 * n + 2), at[2] >> (2 * n + 2))];
        if (n) {
            const size_t child = (at[0] >> 2 * n & 3) | (at[1] >> 2 * n & 3) << 2 | (at[2] >> 2 * n & 3) << 4;
            d->held[n] = isogi_vol__held(p->ways, 0, low, high, node);
            if (!(d->held[n] >> child & 1)) break; /* none goes on: this node's mask is its last one */
        } else {
            isogi_vol__leaf leaf;
            d->held[0] = isogi_vol__split_cells(p->ways, 0, &leaf, node, units), d->leaf = node, d->step = (double)leaf.isovalue;
        }
    }
}

/* Rays that begin in one place first come through the same few cells. How steep the field is there is bounded once for all of them; each
   learns from its direction how far it certainly stays on its side: its way through cells and nodes begins behind.

   Within a cell a slope along an axis lies between the differences along its four edges, so the largest difference of all edges in reach
   bounds it. Lanes stand for places upwards and downwards from the first cell: x in fours, z in halves; rows go outwards along y,
   ring by ring of y and z. Bounds are widened by more than floats err by. way: of the rays, roughly; if they begin on a surface, bounds
   hold for the side to which it goes. Not inlined, for the sake of the stack. */
ISOGI_VOL__AVX512 ISOGI_VOL__NOINLINE
static void isogi_vol__look_round(isogi_vol__descent *d, const isogi_pyramid *p, const double way[3]) {
    enum { REACH = ISOGI_VOL__CLEARED };
    isogi_vol__clearing *const c = &d->clearing;
    const isogi_volume *v = &p->volume;
    const __m512i octants = _mm512_setr_epi32(0, 4, 16, 20, 8, 12, 24, 28, 0, 0, 0, 0, 0, 0, 0, 0);
    const __m256i spread = _mm256_setr_epi32(2, 3, 4, 5, 3, 2, 1, 0);
    const __m256i infinite = _mm256_set1_epi32(0x7f800000);
    __attribute__((aligned(32))) float row[ISOGI_VOL__ROUND][ISOGI_VOL__ROUND][8];
    double corner[8], local[3], slope[3], least = 1e300, most = -1e300, error;
    __m512 rise[2][3];
    __m256 sign;
    __m256i bad = _mm256_setzero_si256();
    int at[3], a, i, k, n, inside;
    c->side = -1;
    if (v->type == ISOGI_F64) return;
    for (a = 0; a < 3; a++) {
        at[a] = (int)(d->cell >> 16 * a & 0xffff);
        if (at[a] < REACH - 1 || at[a] + (a ? REACH : 5) > p->cells[a]) return;
        c->corner[a] = (double)at[a], local[a] = d->origin[a] - c->corner[a];
    }
    isogi_vol__read_corners(v, at, corner);
    for (i = 0; i < 8; i++) least = isogi_vol__min(least, corner[i]), most = isogi_vol__max(most, corner[i]);
    c->value = isogi_vol__trilinear(corner, local, slope) - d->isovalue;
    error = 1e-13 * (fabs(v->bias) + fabs(d->isovalue) + isogi_vol__max(fabs(least), fabs(most)));
    error /= fabs(v->scale), c->value /= fabs(v->scale); /* from here on in raw voxels */
    most /= fabs(v->scale), least /= fabs(v->scale);
    c->sure = -1e-8 * (most - least) - error;
    inside = d->on_surface ? slope[0] * way[0] + slope[1] * way[1] + slope[2] * way[2] > 0 : c->value > 0;
    if (!(most - least > 1e-30)) return; /* no denormal floats */
    if (d->on_surface ? !(fabs(c->value) < -c->sure) : !(fabs(c->value) > error)) return;
    c->value = d->on_surface ? 0 : error - fabs(c->value);
    sign = _mm256_castsi256_ps(_mm256_set1_epi32(inside == (v->scale > 0) ? INT32_MIN : 0)); /* -ffast-math would take -0 for 0 */
    for (k = 0; k < ISOGI_VOL__ROUND; k++)
        for (i = 0; i < ISOGI_VOL__ROUND; i++) {
            float buffer[8];
            const float *from = isogi_vol__raw_row(p, (size_t)(at[0] - REACH + 1), (size_t)(at[1] - REACH + 1 + i),
                                                   (size_t)(at[2] - REACH + 1 + k), 8, buffer);
            const __m256 voxels = _mm256_loadu_ps(from);
            _mm256_store_ps(row[k][i], _mm256_xor_ps(_mm256_permutevar8x32_ps(voxels, spread), sign));
            bad = _mm256_or_si256(bad, _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_castps_si256(voxels), infinite), infinite));
        }
    if (_mm256_movemask_epi8(bad)) return;
    for (i = 0; i < 6; i++) rise[i % 2][i / 2] = _mm512_set1_ps(-3e38f);
    for (n = 0; n <= REACH; n++) {
        for (i = 0; i <= 2 * n; i++) {
            const int y = i < n ? i : n, z = i < n ? n : 2 * n - i;
#pragma GCC unroll 2
            for (k = 0; k < 2; k++) {
                const int up = REACH - 1 + z, down = REACH - z, across = k ? REACH - y : REACH - 1 + y,
                          before = k ? across + 1 : across - 1;
#define ISOGI_VOL__BOTH(up, down, y) \
    _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_load_ps(row[up][y])), _mm256_load_ps(row[down][y]), 1)
                const __m512 here = ISOGI_VOL__BOTH(up, down, across);
                rise[k][0] = _mm512_max_ps(rise[k][0], _mm512_sub_ps(_mm512_permute_ps(here, 0x39), here));
                if (y) rise[k][1] = _mm512_max_ps(rise[k][1], _mm512_sub_ps(here, ISOGI_VOL__BOTH(up, down, before)));
                if (z) rise[k][2] = _mm512_max_ps(rise[k][2], _mm512_sub_ps(here, ISOGI_VOL__BOTH(up - 1, down + 1, across)));
#undef ISOGI_VOL__BOTH
            }
        }
#pragma GCC unroll 3
        for (a = 0; a < 3; a++) {
            const __mmask16 lanes = (__mmask16)(0x1111 * ((1 << (a ? n + 1 : n)) - 1)); /* edges within reach */
            __m512 largest[2];
            __m256 eight;
            if (!n) break;
#pragma GCC unroll 2
            for (k = 0; k < 2; k++) {
                largest[k] = _mm512_mask_mov_ps(_mm512_set1_ps(-3e38f), lanes, rise[k][a]);
                largest[k] = _mm512_max_ps(largest[k], _mm512_permute_ps(largest[k], 0xb1));
                largest[k] = _mm512_max_ps(largest[k], _mm512_permute_ps(largest[k], 0x4e));
            }
            eight = _mm512_castps512_ps256(_mm512_permutex2var_ps(largest[0], octants, largest[1]));
            eight = _mm256_fmadd_ps(_mm256_andnot_ps(_mm256_set1_ps(-0.0f), eight), _mm256_set1_ps(1e-6f),
                                    _mm256_add_ps(eight, _mm256_set1_ps((float)error)));
            _mm256_store_ps(c->rise[n - 1][a], eight);
        }
    }
    c->side = inside;
}

/* Up to which time of a plane eight rays certainly stay on their side; *lanes: those that do. What bounds the field is linear from where a
   ray leaves the cells within n of the first one to where it leaves those within n + 1, so it is enough to look there; and it never falls
   again after a rise, as bounds of more cells are no less. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__cleared8(const isogi_vol__descent *d, const double place[9][8], __mmask8 *lanes) {
    const isogi_vol__clearing *c = &d->clearing;
    const __m512d zero = _mm512_setzero_pd();
    __m512d origin[3], inverse[3], way[3], t[3], value = _mm512_set1_pd(c->value), before = zero, reach = zero;
    __m256i number = _mm256_setzero_si256();
    __m512i until = ISOGI_VOL__ALL64(0x7fffffffffffffffu);
    __mmask8 fall[3], sure = 0;
    int a, n;
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        origin[a] = _mm512_set1_pd(d->origin[a]), inverse[a] = _mm512_load_pd(place[3 + a]);
        way[a] = _mm512_abs_pd(_mm512_load_pd(place[6 + a]));
        fall[a] = _mm512_movepi64_mask(_mm512_castpd_si512(inverse[a]));
        number = _mm256_mask_or_epi32(number, fall[a], number, _mm256_set1_epi32(1 << a));
        t[a] = _mm512_sub_pd(_mm512_mask_mov_pd(_mm512_set1_pd(c->corner[a] + 1), fall[a], _mm512_set1_pd(c->corner[a])), origin[a]);
        t[a] = _mm512_mul_pd(t[a], inverse[a]), inverse[a] = _mm512_abs_pd(inverse[a]);
    }
    for (n = 0; n < ISOGI_VOL__CLEARED; n++) {
#define ISOGI_VOL__RISE(a) _mm512_cvtps_pd(_mm256_permutevar8x32_ps(_mm256_load_ps(c->rise[n][a]), number))
        const __m512d out = _mm512_min_pd(_mm512_min_pd(t[0], t[1]), t[2]);
        __m512d rise = _mm512_mul_pd(way[0], ISOGI_VOL__RISE(0));
        __mmask8 here;
        rise = _mm512_fmadd_pd(way[1], ISOGI_VOL__RISE(1), rise);
        rise = _mm512_fmadd_pd(way[2], ISOGI_VOL__RISE(2), rise);
#undef ISOGI_VOL__RISE
        value = _mm512_fmadd_pd(rise, _mm512_sub_pd(out, before), value), before = out;
        here = _mm512_cmp_pd_mask(value, _mm512_set1_pd(c->sure), _CMP_LT_OQ);
        sure = (__mmask8)(sure | here), reach = _mm512_mask_mov_pd(reach, here, _mm512_set1_pd(n));
#pragma GCC unroll 3
        for (a = 0; a < 3; a++) t[a] = _mm512_add_pd(t[a], inverse[a]);
    }
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        const __m512d corner = _mm512_set1_pd(c->corner[a]);
        const __m512d plane = _mm512_mask_sub_pd(_mm512_add_pd(corner, _mm512_add_pd(reach, _mm512_set1_pd(1))), fall[a], corner, reach);
        until = _mm512_min_epi64(until, isogi_vol__time_of(plane, origin[a], _mm512_load_pd(place[3 + a]), a));
    }
    *lanes = sure;
    return _mm512_mask_or_epi64(_mm512_set1_epi64(3), sure, until, _mm512_set1_epi64(3));
}

/* Takes rays that stand at the root to the leaf in which they begin, or as far as children can hold the surface. row: the slots are eight
   in a row; else what is written of the others does no harm. */
ISOGI_VOL__AVX512 static void isogi_vol__descend8(isogi_vol__turn *turn, isogi_vol__pool *s, const uint8_t *seats, int row, __mmask8 lanes,
                                                  const double place[9][8], __m512i end, __m512i flip) {
    const isogi_vol__descent *d = &turn->descent;
    const __m512i one = _mm512_set1_epi64(1), zero = _mm512_setzero_si512();
    const __m128i list = _mm_loadl_epi64((const __m128i *)(const void *)seats);
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    __m512i pending = zero, mask = zero, begin = _mm512_set1_epi64(3);
    __mmask8 going = 0xff;
    unsigned cells;
    int n;
#define ISOGI_VOL__PUT(member, value)                                                           \
    do {                                                                                        \
        if (row) _mm512_mask_store_epi64(&s->member[seats[0]], lanes, value);                   \
        else isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(member), value);                         \
    } while (0)
    if (d->clearing.side >= 0) {
        const __m512i side = row ? _mm512_load_si512(&s->side[seats[0]]) : isogi_vol__pick8(&spots, ISOGI_VOL__ROW_OF(side));
        const __m512i free = _mm512_set1_epi64(d->clearing.side);
        __mmask8 sure;
        begin = isogi_vol__cleared8(d, place, &sure);
        /* but for rays that go onward from the other side */
        sure = _mm512_mask_cmpneq_epi64_mask(sure, side, _mm512_set1_epi64(2 * !d->clearing.side - 4));
        begin = _mm512_mask_mov_epi64(_mm512_set1_epi64(3), sure, begin);
        ISOGI_VOL__PUT(side, _mm512_mask_mov_epi64(side, sure, free));
        ISOGI_VOL__PUT(begin, begin);
    }
    for (n = turn->levels - 1; going & lanes && n >= 0; n--) {
        const uint64_t digits = 0x000100010001u * (((uint64_t)4 << 2 * n) - 1);
        const __m512i held = isogi_vol__mirror8(_mm512_set1_epi64((int64_t)d->held[n]), flip);
        const __m512i child = _mm512_set1_epi64((int64_t)_pext_u64((uint64_t)d->cell >> 2 * n, 0x000300030003u));
        mask = _mm512_and_si512(isogi_vol__passed(place[0], place[3], 8, begin, end, _mm512_set1_epi64(n),
                                                  _mm512_set1_epi64((int64_t)((uint64_t)d->cell & ~digits))),
                                held);
        if (n) {
            const __m512i bit = _mm512_sllv_epi64(one, _mm512_xor_si512(child, flip)), rest = _mm512_andnot_si512(bit, mask);
            ISOGI_VOL__PUT(of.mask[n], rest);
            pending = _mm512_mask_or_epi64(pending, _mm512_mask_test_epi64_mask(going, rest, rest), pending, _mm512_set1_epi64(1 << n));
            going = _mm512_mask_test_epi64_mask(going, mask, bit);
        }
    }
    cells = _mm512_mask_test_epi64_mask((__mmask8)(going & lanes), mask, mask);
    ISOGI_VOL__PUT(of.mask[0], mask);
    ISOGI_VOL__PUT(pending, pending);
    ISOGI_VOL__PUT(cell, _mm512_set1_epi64(d->cell));
    ISOGI_VOL__PUT(level, _mm512_set1_epi64(-1));
    ISOGI_VOL__PUT(address, _mm512_set1_epi64((int64_t)(uintptr_t)d->leaf));
    ISOGI_VOL__PUT(step, _mm512_castpd_si512(_mm512_set1_pd(d->step)));
#undef ISOGI_VOL__PUT
    turn->choosing |= (uint64_t)_mm512_mask_reduce_or_epi64((__mmask8)(lanes & ~cells),
                                                            _mm512_sllv_epi64(one, isogi_vol__slots8(seats)));
    _mm_storel_epi64((__m128i *)(void *)(turn->at_leaf + turn->leaves), _mm_maskz_compress_epi8((__mmask16)cells, list));
    turn->leaves += __builtin_popcount(cells);
}

/* ---- rays that begin anywhere ----

   The first two nodes of a ray are the root and one of its children: so few that their bounds are compared with an isovalue once for all
   rays that have it. Rays come into the pool behind them, with a node of the next level to be answered. */

ISOGI_VOL__AVX512 ISOGI_VOL__INLINE void isogi_vol__survey(isogi_vol__summit *summit, int i, const uint8_t *node) {
    summit->of[i][0] = _mm512_cmpge_epu8_mask(_mm512_load_si512(node + 64), _mm512_set1_epi8((char)summit->low));
    summit->of[i][1] = _mm512_cmple_epu8_mask(_mm512_load_si512(node), _mm512_set1_epi8((char)summit->high));
}

/* Children which eight rays pass and which can hold the surface, of nodes whose children reach up to the isovalue, and down to it; as
   look_ahead says, where any hit will do. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__held_at_top(isogi_vol__turn *turn, __m512i passed, __m512i up, __m512i down,
                                                                   __m512i flip, __m512i bit, __mmask8 lanes) {
    if (turn->any) {
        const __m512i mirrored = isogi_vol__mirror8(passed, flip);
        const __mmask8 out = _mm512_mask_test_epi64_mask(lanes, mirrored, _mm512_andnot_si512(up, down)),
                       in = _mm512_mask_test_epi64_mask(lanes, mirrored, _mm512_andnot_si512(down, up));
        if (out) turn->ahead[0] |= (uint64_t)_mm512_mask_reduce_or_epi64(out, bit);
        if (in && turn->summit.low) turn->ahead[1] |= (uint64_t)_mm512_mask_reduce_or_epi64(in, bit);
    }
    return _mm512_and_si512(passed, isogi_vol__mirror8(_mm512_and_si512(up, down), flip));
}

/* Where nodes of a level are: children of nodes at x | y << 16 | z << 32 among those of the level above. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE __m512i isogi_vol__address8(const isogi_pyramid *p, int n, __m512i parent, __m512i child) {
    const isogi_vol__node_level *const level = &p->node_level[n];
    const __m512i field = _mm512_set1_epi64(0xffff), width = _mm512_set1_epi64((int64_t)level->parents[0]);
    const __m512i x = _mm512_and_si512(parent, field), y = _mm512_and_si512(_mm512_srli_epi64(parent, 16), field);
    const __m512i z = _mm512_mul_epu32(_mm512_srli_epi64(parent, 32), _mm512_set1_epi64((int64_t)level->parents[1]));
    const __m512i family = _mm512_add_epi64(x, _mm512_mul_epu32(_mm512_add_epi64(y, z), width));
    return _mm512_add_epi64(_mm512_add_epi64(_mm512_slli_epi64(family, 13), _mm512_slli_epi64(child, 7)),
                            _mm512_set1_epi64((int64_t)(uintptr_t)p->nodes[level->first]));
}

/* Takes rays of one isovalue past the root and the first of its children that can hold the surface. meets: those that meet the box; lanes:
   and are no copies; place: their origins, then inverses. */
ISOGI_VOL__AVX512 static void isogi_vol__enter8(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s, const uint8_t *seats,
                                                int row, __mmask8 meets, __mmask8 lanes, const double place[6][8], double isovalue,
                                                __m512i end, __m512i flip) {
    const isogi_pyramid *p = b->pyramid;
    isogi_vol__summit *const summit = &turn->summit;
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    const int top = turn->levels - 1;
    const uint8_t *const children = p->nodes[p->node_level[top - 1].first];
    const __m512i one = _mm512_set1_epi64(1), bit = _mm512_sllv_epi64(one, isogi_vol__slots8(seats));
    __attribute__((aligned(64))) uint64_t which[8];
    __m512i mask, rest, child, group, cell, up, down, pending, address;
    __mmask8 some, more;
    uint64_t fresh;
    int k;
#define ISOGI_VOL__PUT(member, value)                                                           \
    do {                                                                                        \
        if (row) _mm512_mask_store_epi64(&s->member[seats[0]], lanes, value);                   \
        else isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(member), value);                         \
    } while (0)
    if (!summit->ready || memcmp(&summit->isovalue, &isovalue, sizeof isovalue)) {
        (void)isogi_vol__quantise_isovalue(p, isovalue, &summit->low, &summit->high);
        summit->isovalue = isovalue, summit->known = 0, summit->ready = 1;
        isogi_vol__survey(summit, 64, p->nodes[p->node_level[top].first]);
    }
    mask = isogi_vol__passed(place[0], place[3], 8, _mm512_set1_epi64(3), end, _mm512_set1_epi64(top), _mm512_setzero_si512());
    mask = isogi_vol__held_at_top(turn, mask, _mm512_set1_epi64((int64_t)summit->of[64][0]),
                                  _mm512_set1_epi64((int64_t)summit->of[64][1]), flip, bit, lanes);
    some = _mm512_mask_test_epi64_mask(meets, mask, mask), rest = _mm512_and_si512(mask, _mm512_sub_epi64(mask, one));
    pending = _mm512_mask_set1_epi64(_mm512_setzero_si512(), _mm512_mask_test_epi64_mask(some, rest, rest), 1 << top);
    ISOGI_VOL__PUT(of.mask[top], rest);
    child = _mm512_and_si512(isogi_vol__first_child8(mask, flip), _mm512_set1_epi64(63));
    group = isogi_vol__digits8(child);
    cell = _mm512_sll_epi64(group, _mm_cvtsi32_si128(2 * top));
    mask = isogi_vol__passed(place[0], place[3], 8, _mm512_set1_epi64(3), end, _mm512_set1_epi64(top - 1), cell);
    fresh = (uint64_t)_mm512_mask_reduce_or_epi64(some, _mm512_sllv_epi64(one, child)) & ~summit->known;
    for (summit->known |= fresh; fresh; fresh &= fresh - 1)
        isogi_vol__survey(summit, __builtin_ctzll(fresh), children + 128 * __builtin_ctzll(fresh));
    b->work.blocks += (uint64_t)(__builtin_popcount((unsigned)lanes) + __builtin_popcount((unsigned)(some & lanes)));
    _mm512_store_si512(which, child);
    {
        const char *at[8];
#pragma GCC unroll 8
        for (k = 0; k < 8; k++) at[k] = (const char *)summit->of[which[k]];
        up = isogi_vol__load_eight(at, 0), down = isogi_vol__load_eight(at, 8);
    }
    mask = isogi_vol__held_at_top(turn, mask, up, down, flip, bit, (__mmask8)(some & lanes));
    more = _mm512_mask_test_epi64_mask(some, mask, mask), rest = _mm512_and_si512(mask, _mm512_sub_epi64(mask, one));
    pending = _mm512_mask_or_epi64(pending, _mm512_mask_test_epi64_mask(more, rest, rest), pending, _mm512_set1_epi64(1 << (top - 1)));
    child = _mm512_and_si512(isogi_vol__first_child8(mask, flip), _mm512_set1_epi64(63));
    cell = _mm512_or_si512(cell, _mm512_sll_epi64(isogi_vol__digits8(child), _mm_cvtsi32_si128(2 * top - 2)));
    address = _mm512_mask_mov_epi64(_mm512_set1_epi64((int64_t)(uintptr_t)p->nodes), more, isogi_vol__address8(p, top - 2, group, child));
    _mm512_store_si512(which, address);
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) {
        const char *node = (const char *)(uintptr_t)which[k];
        _mm_prefetch(node, _MM_HINT_T0), _mm_prefetch(node + 64, _MM_HINT_T0);
    }
    ISOGI_VOL__PUT(address, address);
    ISOGI_VOL__PUT(of.mask[top - 1], rest);
    ISOGI_VOL__PUT(pending, pending);
    ISOGI_VOL__PUT(cell, cell);
    ISOGI_VOL__PUT(level, _mm512_mask_set1_epi64(_mm512_set1_epi64(-1), more, top - 2));
#undef ISOGI_VOL__PUT
    if (lanes & ~more) turn->choosing |= (uint64_t)_mm512_mask_reduce_or_epi64((__mmask8)(lanes & ~more), bit);
}

/* Whether the ray and those after it that begin in the same place are so many that it pays to look round; on a surface each would have to
   leave it in double. */
static int isogi_vol__are_many(const isogi_vol__batch *b, size_t number) {
    const size_t enough = b->starts ? 12 : 48, last = number + enough - 1;
    if (b->bundle) return b->each >= enough;
    if (last >= b->count) return 0;
    if (b->rays) return !memcmp(b->rays[number].origin, b->rays[last].origin, sizeof b->rays->origin);
    return !memcmp(b->starts[number].cell, b->starts[last].cell, sizeof b->starts->cell) &&
           !memcmp(b->starts[number].local, b->starts[last].local, sizeof b->starts->local);
}

/* Rays of eight that stand at the root are taken down from there if they have one isovalue, and are not few; whether they are. number: of
   the first. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE int isogi_vol__take_down(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                             size_t number, const uint8_t *seats, int row, __mmask8 meets,
                                                             __mmask8 lanes, const __m512d origin[3], const __m512d inverse[3],
                                                             const __m512d dir[3], __m512d isovalue, __m512i end, __m512i flip) {
    __attribute__((aligned(64))) double place[9][8]; /* origins, inverses, directions */
    __m512i first;
    __mmask8 off = 0;
    double at[3], value;
    int a;
    if (__builtin_popcount((unsigned)lanes) < 4) return 0;
    first = _mm512_set1_epi64(__builtin_ctz((unsigned)lanes));
    if (_mm512_mask_cmp_pd_mask(lanes, isovalue, _mm512_permutexvar_pd(first, isovalue), _CMP_NEQ_UQ)) return 0;
    value = _mm512_cvtsd_f64(_mm512_permutexvar_pd(first, isovalue));
#pragma GCC unroll 3
    for (a = 0; a < 3; a++) {
        const __m512d same = _mm512_permutexvar_pd(first, origin[a]);
        off = (__mmask8)(off | _mm512_mask_cmp_pd_mask(lanes, origin[a], same, _CMP_NEQ_UQ));
        at[a] = _mm512_cvtsd_f64(same), _mm512_store_pd(place[a], origin[a]), _mm512_store_pd(place[3 + a], inverse[a]);
        _mm512_store_pd(place[6 + a], dir[a]);
    }
    if (off) {
        isogi_vol__enter8(b, turn, s, seats, row, meets, lanes, (const double(*)[8])place, value, end, flip);
        return 1;
    }
    if (turn->descent.cell < 0 || memcmp(turn->descent.origin, at, sizeof at) || memcmp(&turn->descent.isovalue, &value, sizeof value) ||
        turn->descent.on_surface != (b->starts != NULL)) {
        isogi_vol__prepare_descent(&turn->descent, b->pyramid, at, value);
        turn->descent.on_surface = b->starts != NULL, turn->descent.clearing.side = -1;
        if (isogi_vol__are_many(b, number)) {
            double way[3];
#pragma GCC unroll 3
            for (a = 0; a < 3; a++) way[a] = _mm512_mask_reduce_add_pd(lanes, dir[a]);
            isogi_vol__look_round(&turn->descent, b->pyramid, way);
        }
        b->work.blocks += (uint64_t)turn->levels; /* at most */
    }
    isogi_vol__descend8(turn, s, seats, row, lanes, (const double(*)[8])place, end, flip);
    return 1;
}

/* Sends for rays that come after the next ones; soon: they are needed at once. */
ISOGI_VOL__INLINE void isogi_vol__send_for_rays(const char *from, size_t element, int soon) {
    size_t k;
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) {
        if (soon) __builtin_prefetch((const void *)((uintptr_t)from + (16 + k) * element), 0);
        else __builtin_prefetch((const void *)((uintptr_t)from + (16 + k) * element), 0, 2);
    }
}

/* Sends for where the hits of the next rays will be written: stores wait for each other, so that one without its line holds all up. */
ISOGI_VOL__INLINE void isogi_vol__send_for_hits(const isogi_hit *hits, int soon) {
    size_t k;
#pragma GCC unroll 6
    for (k = 0; k < 6; k++) {
        if (soon) __builtin_prefetch((const void *)((uintptr_t)hits + 64 * k), 1);
        else __builtin_prefetch((const void *)((uintptr_t)hits + 64 * k), 1, 2);
    }
}

/* Sets up to eight rays up at once and puts them into slots (beyond `count` the first one again; what is written of rays that get none does
   no harm): the operations of begin and aim, in their order and without contraction.
   Returns the rays that have a slot now; *odd: those that are left to the code for one. The others miss the box. turn: of a pool, in
   which rays do not stay at the root if they have one isovalue, or NULL. alike: rays differ in nothing but direction, as in a bundle. A
   kernel, longer than a screen: nothing in it is worth a name of its own. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE unsigned isogi_vol__seat_some(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                                  size_t first, int count, const uint8_t *seats, int whole, int alike,
                                                                  unsigned *odd) {
    const isogi_pyramid *p = b->pyramid;
    const __mmask8 lanes = (__mmask8)((1u << count) - 1);
    const __m512i lane = _mm512_maskz_mov_epi64(lanes, _mm512_set_epi64(7, 6, 5, 4, 3, 2, 1, 0)), none = _mm512_setzero_si512();
    const isogi_vol__spots spots = isogi_vol__spots8(s, seats);
    char *const row = spots.at[0];
    const size_t element = b->rays ? sizeof *b->rays : sizeof *b->starts,
                 dir_bytes = b->bundle || !b->rays ? sizeof *b->dirs : sizeof *b->rays;
    const char *from = b->rays ? (const char *)(b->rays + (b->bundle ? 0 : first)) : (const char *)(b->starts + (b->bundle ? 0 : first));
    const char *to = b->bundle || !b->rays ? (const char *)b->dirs[first] : (const char *)b->rays[first].dir;
    const __m512d zero = _mm512_setzero_pd(), unlimited = _mm512_set1_pd(ISOGI_VOL__UNLIMITED), finite = _mm512_set1_pd(DBL_MAX);
    const char *at[8], *dir_at[8];
    __m512d origin[3], d[3], inverse[3], tmin, tmax, isovalue, enter, leave, stop, q;
    __m512i axis = _mm512_set1_epi64(-1), flip = none, inside = axis;
    __mmask8 good = 0xff, meets, rising[3], still[3]; /* lanes beyond `count` are copies of the first one */
    int a, k;
/* a bundle has one ray or start */
#define ISOGI_VOL__TAKE_BITS(member) (alike ? isogi_vol__load_one(from + (member)) : isogi_vol__load_eight(at, member))
#define ISOGI_VOL__TAKE(member) _mm512_castsi512_pd(ISOGI_VOL__TAKE_BITS(member))
#pragma GCC unroll 8
    for (k = 0; k < 8; k++) {
        const size_t ray = k < count ? (size_t)k : 0;
        at[k] = from + (b->bundle ? 0 : ray * element), dir_at[k] = to + ray * dir_bytes;
    }
    if (!b->bundle) isogi_vol__send_for_rays(from, element, !turn);
    if (b->hits) isogi_vol__send_for_hits(b->hits + first, !turn);
    if (b->rays) {
        __m512d relative[3];
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            origin[a] = ISOGI_VOL__TAKE(offsetof(isogi_ray, origin) + 8 * (size_t)a);
            good = _mm512_mask_cmp_pd_mask(good, _mm512_abs_pd(origin[a]), finite, _CMP_LE_OQ);
            relative[a] = ISOGI_VOL__SUB(origin[a], _mm512_set1_pd(p->origin[a]));
        }
#pragma GCC unroll 8
        for (a = 0; a < 3; a++)
            origin[a] = ISOGI_VOL__ADD(ISOGI_VOL__ADD(ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a]), relative[0]),
                                                      ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a + 1]), relative[1])),
                                       ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a + 2]), relative[2]));
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) good = _mm512_mask_cmp_pd_mask(good, _mm512_abs_pd(origin[a]), finite, _CMP_LE_OQ);
        tmin = ISOGI_VOL__TAKE(offsetof(isogi_ray, tmin)), tmax = ISOGI_VOL__TAKE(offsetof(isogi_ray, tmax)),
        isovalue = ISOGI_VOL__TAKE(offsetof(isogi_ray, isovalue));
        good = _mm512_mask_testn_epi64_mask(good, ISOGI_VOL__TAKE_BITS(offsetof(isogi_ray, flags) - 4),
                                            _mm512_set1_epi64((int64_t)ISOGI_RAY_CAPPED << 32));
    } else {
        const __m512i low_cells = ISOGI_VOL__TAKE_BITS(offsetof(isogi_hit, cell)),
                      high_cell = ISOGI_VOL__TAKE_BITS(offsetof(isogi_hit, cell) + 8);
        const __m256i side = _mm512_cvtepi64_epi32(_mm512_srli_epi64(high_cell, 32));
        good = b->flags & ISOGI_RAY_CAPPED ? 0 : _mm256_mask_cmpneq_epi32_mask(good, _mm256_abs_epi32(side), _mm256_set1_epi32(2));
        if (b->flags & ISOGI_RAY_ONWARD)
            inside = _mm512_mask_set1_epi64(_mm512_mask_set1_epi64(inside, _mm256_cmpgt_epi32_mask(side, _mm256_setzero_si256()), 1),
                                            _mm256_cmplt_epi32_mask(side, _mm256_setzero_si256()), 0);
        inside = _mm512_sub_epi64(_mm512_add_epi64(inside, inside), _mm512_set1_epi64(4));
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            const __m256i cell = _mm512_cvtepi64_epi32(a == 0 ? low_cells : a == 1 ? _mm512_srli_epi64(low_cells, 32) : high_cell);
            const __m512d local = ISOGI_VOL__TAKE(offsetof(isogi_hit, local) + 8 * (size_t)a);
            good = _mm256_mask_cmplt_epu32_mask(good, cell, _mm256_set1_epi32(p->cells[a]));
            good = _mm512_mask_cmp_pd_mask(good, _mm512_abs_pd(local), finite, _CMP_LE_OQ);
            origin[a] = ISOGI_VOL__ADD(_mm512_cvtepu32_pd(cell), _mm512_min_pd(_mm512_max_pd(local, zero), _mm512_set1_pd(1)));
        }
        isovalue = _mm512_set1_pd(b->isovalue), tmin = tmax = zero;
        if (b->tmax)
            tmax = b->bundle ? _mm512_set1_pd(*b->tmax) : _mm512_permutexvar_pd(lane, _mm512_maskz_loadu_pd(lanes, b->tmax + first));
    }
#undef ISOGI_VOL__TAKE
#undef ISOGI_VOL__TAKE_BITS
    good = _mm512_mask_cmp_pd_mask(_mm512_mask_cmp_pd_mask(good, tmax, tmax, _CMP_ORD_Q), tmin, tmin, _CMP_ORD_Q);
    tmax = _mm512_min_pd(_mm512_mask_mov_pd(tmax, _mm512_cmp_pd_mask(tmax, zero, _CMP_EQ_OQ), unlimited), unlimited);
    good = _mm512_mask_cmp_pd_mask(good, tmin, tmax, _CMP_LE_OQ);
    tmin = _mm512_max_pd(tmin, ISOGI_VOL__SUB(zero, unlimited));
    good = _mm512_mask_cmp_pd_mask(_mm512_mask_cmp_pd_mask(good, isovalue, _mm512_set1_pd(p->range[0]), _CMP_GE_OQ), isovalue,
                                   _mm512_set1_pd(p->range[1]), _CMP_LE_OQ);
    {
        const __m512i two = isogi_vol__load_eight(dir_at, 0), last = isogi_vol__load_eight(dir_at, 4);
        __m512d world[3], most;
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            world[a] = _mm512_cvtps_pd(_mm256_castsi256_ps(
                _mm512_cvtepi64_epi32(a == 0 ? two : _mm512_srli_epi64(a == 1 ? two : last, 32))));
            good = _mm512_mask_cmp_pd_mask(good, _mm512_abs_pd(world[a]), finite, _CMP_LE_OQ);
        }
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            d[a] = ISOGI_VOL__ADD(ISOGI_VOL__ADD(ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a]), world[0]),
                                                 ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a + 1]), world[1])),
                                  ISOGI_VOL__MUL(_mm512_set1_pd(p->to_grid[3 * a + 2]), world[2]));
            good = _mm512_mask_cmp_pd_mask(good, _mm512_abs_pd(d[a]), finite, _CMP_LE_OQ);
        }
        most = _mm512_max_pd(_mm512_max_pd(_mm512_abs_pd(d[0]), _mm512_abs_pd(d[1])), _mm512_abs_pd(d[2]));
        good = _mm512_mask_cmp_pd_mask(good, most, zero, _CMP_GT_OQ);
        most = ISOGI_VOL__MUL(_mm512_set1_pd(1e-30), most);
#pragma GCC unroll 8
        for (a = 0; a < 3; a++) {
            const __mmask8 keep = _mm512_cmp_pd_mask(_mm512_abs_pd(d[a]), most, _CMP_GT_OQ);
            d[a] = _mm512_maskz_mov_pd(keep, d[a]), inverse[a] = _mm512_maskz_div_pd(keep, _mm512_set1_pd(1), d[a]);
            still[a] = (__mmask8)~keep, rising[a] = _mm512_cmp_pd_mask(d[a], zero, _CMP_GT_OQ);
        }
    }
    /* the box */
    meets = 0xff, enter = _mm512_sub_pd(zero, unlimited), leave = unlimited;
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        const __m512d box = _mm512_set1_pd(p->box[a]);
        const __m512d t0 = ISOGI_VOL__MUL(ISOGI_VOL__SUB(_mm512_mask_mov_pd(box, rising[a], zero), origin[a]), inverse[a]);
        const __m512d t1 = ISOGI_VOL__MUL(ISOGI_VOL__SUB(_mm512_maskz_mov_pd(rising[a], box), origin[a]), inverse[a]);
        const __mmask8 within = _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(origin[a], zero, _CMP_GE_OQ), origin[a], box, _CMP_LE_OQ);
        const __mmask8 later = _mm512_mask_cmp_pd_mask((__mmask8)~still[a], t0, enter, _CMP_GT_OQ);
        meets = (__mmask8)(meets & (~still[a] | within));
        enter = _mm512_mask_mov_pd(enter, later, t0), axis = _mm512_mask_set1_epi64(axis, later, a);
        leave = _mm512_mask_min_pd(leave, (__mmask8)~still[a], leave, t1);
    }
    axis = _mm512_mask_set1_epi64(axis, (__mmask8)~_mm512_cmp_pd_mask(enter, tmin, _CMP_GT_OQ), -1);
    enter = _mm512_max_pd(enter, tmin);
    meets = _mm512_mask_cmp_pd_mask(meets, enter, _mm512_min_pd(tmax, leave), _CMP_LE_OQ);
    stop = unlimited;
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        const __m512d box = _mm512_set1_pd(p->box[a]);
        origin[a] = _mm512_min_pd(_mm512_max_pd(ISOGI_VOL__ADD(origin[a], ISOGI_VOL__MUL(enter, d[a])), zero), box);
        origin[a] =
            _mm512_mask_mov_pd(origin[a], _mm512_cmpeq_epi64_mask(axis, _mm512_set1_epi64(a)), _mm512_mask_mov_pd(box, rising[a], zero));
        stop = _mm512_mask_min_pd(stop, (__mmask8)~still[a], stop,
                                  ISOGI_VOL__MUL(ISOGI_VOL__SUB(_mm512_maskz_mov_pd(rising[a], box), origin[a]), inverse[a]));
    }
    stop = _mm512_min_pd(stop, ISOGI_VOL__SUB(tmax, enter));
    good = (__mmask8)(good & (~meets | _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(stop, _mm512_set1_pd(1e-150), _CMP_GT_OQ), stop,
                                                               _mm512_set1_pd(1e150), _CMP_LT_OQ)));
    meets = (__mmask8)(meets & good);
#define ISOGI_VOL__PUT(member, value)                                                           \
    do {                                                                                        \
        if (whole) _mm512_mask_store_epi64(row + ISOGI_VOL__ROW_OF(member), lanes, value);      \
        else isogi_vol__put8(&spots, ISOGI_VOL__ROW_OF(member), value);                         \
    } while (0)
#define ISOGI_VOL__PUT_REAL(member, value) ISOGI_VOL__PUT(member, _mm512_castpd_si512(value))
#pragma GCC unroll 8
    for (a = 0; a < 3; a++) {
        /* a ray that stands still on an axis keeps below the volume's upper border */
        const __mmask8 upper = _mm512_mask_cmp_pd_mask(still[a], origin[a], _mm512_set1_pd(p->box[a]), _CMP_GE_OQ),
                       fall = (__mmask8)(upper | ~(still[a] | rising[a]));
        inverse[a] = _mm512_mask_mov_pd(_mm512_mask_mov_pd(inverse[a], still[a], _mm512_set1_pd(1e200)), upper, _mm512_set1_pd(-1e200));
        flip = _mm512_mask_or_epi64(flip, fall, flip, _mm512_set1_epi64(3 << 2 * a));
        ISOGI_VOL__PUT_REAL(origin[a], origin[a]);
        ISOGI_VOL__PUT_REAL(dir[a], d[a]);
        ISOGI_VOL__PUT_REAL(inverse[a], inverse[a]);
    }
    /* as quantise_isovalue has it, up to the last code */
    q = ISOGI_VOL__MUL(ISOGI_VOL__SUB(isovalue, _mm512_set1_pd(p->range[0])), _mm512_set1_pd(p->node_scale));
    ISOGI_VOL__PUT_REAL(level_units, _mm512_cvtps_pd(_mm512_cvtpd_ps(q)));
    ISOGI_VOL__PUT(low, _mm512_cvttpd_epi64(_mm512_max_pd(ISOGI_VOL__SUB(q, _mm512_set1_pd(0.01)), zero)));
    ISOGI_VOL__PUT(beyond,
                   _mm512_add_epi64(_mm512_min_epi64(_mm512_cvttpd_epi64(ISOGI_VOL__ADD(q, _mm512_set1_pd(0.01))), _mm512_set1_epi64(253)),
                                    _mm512_set1_epi64(1)));
    ISOGI_VOL__PUT(end, _mm512_or_si512(_mm512_castpd_si512(stop), _mm512_set1_epi64(3)));
    if (turn) ISOGI_VOL__PUT(begin, _mm512_set1_epi64(3)); /* packets need none */
    ISOGI_VOL__PUT(flip, flip);
    ISOGI_VOL__PUT(side, inside);
    ISOGI_VOL__PUT(entry_axis, b->rays ? axis : _mm512_set1_epi64(-1));
    ISOGI_VOL__PUT_REAL(base, enter);
    ISOGI_VOL__PUT_REAL(stop, stop);
    ISOGI_VOL__PUT_REAL(isovalue, isovalue);
    ISOGI_VOL__PUT(deflated, none);
    ISOGI_VOL__PUT(ray, _mm512_add_epi64(_mm512_set1_epi64((int64_t)first), lane));
    *odd = (unsigned)(lanes & ~good);
    if (!turn || !isogi_vol__take_down(b, turn, s, first, seats, whole, meets, (__mmask8)(meets & lanes), origin, inverse, d, isovalue,
                                       _mm512_or_si512(_mm512_castpd_si512(stop), _mm512_set1_epi64(3)), flip)) {
        ISOGI_VOL__PUT(pending, none);
        ISOGI_VOL__PUT(cell, none);
        ISOGI_VOL__PUT(level, _mm512_mask_set1_epi64(_mm512_set1_epi64(-1), meets, p->node_levels - 1));
        ISOGI_VOL__PUT(address, _mm512_set1_epi64((int64_t)(uintptr_t)p->nodes[p->node_level[p->node_levels - 1].first]));
    }
#undef ISOGI_VOL__PUT
#undef ISOGI_VOL__PUT_REAL
    b->work.rays += (uint64_t)__builtin_popcount((unsigned)(lanes & good));
    return (unsigned)(meets & lanes);
}

ISOGI_VOL__AVX512 static unsigned isogi_vol__seat8(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s, size_t first, int count,
                                                   const uint8_t *seats, unsigned *odd) {
    const int whole = seats[0] % 8 == 0 && seats[count - 1] == seats[0] + count - 1; /* a row of slots is stored at once */
    return isogi_vol__seat_some(b, turn, s, first, count, seats, whole, b->bundle, odd);
}

/* Sixteen rays that differ in nothing but direction, into the first slots. Not inlined, for the sake of the stack. */
ISOGI_VOL__AVX512 ISOGI_VOL__NOINLINE static unsigned isogi_vol__seat_alike(isogi_vol__batch *b, isogi_vol__pool *s, size_t first,
                                                                            unsigned odd[2]) {
    static const uint8_t seats[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const unsigned low = isogi_vol__seat_some(b, NULL, s, first, 8, seats, 1, 1, &odd[0]);
    return low | isogi_vol__seat_some(b, NULL, s, first + 8, 8, seats + 8, 1, 1, &odd[1]) << 8;
}

/* ---- a pool of rays ---- */

/* If the ray in a slot begins where its bundle does, all others do: what they have in common is given to all slots, and need not move. */
ISOGI_VOL__AVX512 static void isogi_vol__share(isogi_vol__turn *turn, isogi_vol__pool *s, int groups, int slot) {
    char *row = (char *)s->origin;
    int i, k;
    turn->shared = s->entry_axis[slot] < 0 && !(s->base[slot] > 0 || s->base[slot] < 0);
    if (!turn->shared) return;
    for (i = (int)(offsetof(isogi_vol__pool, origin) / sizeof s->ray); i < (int)(sizeof *s / sizeof s->ray); i++, row += sizeof s->ray) {
        int64_t value;
        memcpy(&value, row + 8 * slot, sizeof value);
        for (k = 0; k < groups; k++) _mm512_store_si512(row + 64 * k, _mm512_set1_epi64(value));
    }
}

/* Moves up to eight rays from one group of slots to another; the masks have as many bits. All members of a pool are rows of numbers of
   eight bytes. */
ISOGI_VOL__AVX512 static void isogi_vol__move(isogi_vol__pool *s, isogi_vol__turn *turn, int from, __mmask8 leave, int to, __mmask8 take) {
    __attribute__((aligned(64))) uint8_t place[64];
    const int last = (int)(offsetof(isogi_vol__pool, of) / sizeof s->ray) + turn->levels,
              rest = (int)(offsetof(isogi_vol__pool, origin) / sizeof s->ray);
    char *row = (char *)s;
    unsigned l = leave, t = take;
    int i;
#define ISOGI_VOL__MOVE_ROW(i)                                                                                                    \
    _mm512_store_si512(row + sizeof s->ray * (size_t)(i) + 64 * to,                                                               \
                       _mm512_mask_expand_epi64(_mm512_load_si512(row + sizeof s->ray * (size_t)(i) + 64 * to), take,             \
                                                _mm512_maskz_compress_epi64(leave, \
                                                    _mm512_load_si512(row + sizeof s->ray * (size_t)(i) + 64 * from))))
    for (i = 0; i < last; i++) ISOGI_VOL__MOVE_ROW(i);
    if (!turn->shared)
        for (i = rest; i < (int)(sizeof *s / sizeof s->ray); i++) ISOGI_VOL__MOVE_ROW(i);
#undef ISOGI_VOL__MOVE_ROW
    _mm512_mask_store_epi64(&s->level[8 * from], leave, _mm512_set1_epi64(-1));
    _mm512_store_si512(place, _mm512_load_si512(turn->p->ways->child[0]));
    for (i = 0; i < 2; i++)
        turn->ahead[i] = (turn->ahead[i] & ~((uint64_t)take << 8 * to)) |
                         (uint64_t)_pdep_u32(_pext_u32((unsigned)(turn->ahead[i] >> 8 * from), leave), take) << 8 * to;
    for (; l; l &= l - 1, t &= t - 1) place[8 * from + __builtin_ctz(l)] = (uint8_t)(8 * to + __builtin_ctz(t));
    _mm512_storeu_si512(turn->at_leaf, _mm512_permutexvar_epi8(_mm512_loadu_si512(turn->at_leaf), _mm512_load_si512(place)));
    _mm512_storeu_si512(turn->in_doubt, _mm512_permutexvar_epi8(_mm512_loadu_si512(turn->in_doubt), _mm512_load_si512(place)));
}

/* With no more rays to come, a group of eight slots is cleared whenever the others can take its rays. `open`: the slots without a ray. */
ISOGI_VOL__AVX512 static uint64_t isogi_vol__close_ranks(isogi_vol__pool *s, isogi_vol__turn *turn, int groups, uint64_t open) {
    for (;;) {
        int occupied = 0, rays = 0, least = 9, which = 0, i;
        unsigned leave;
        for (i = 0; i < groups; i++) {
            const int n = 8 - __builtin_popcount((unsigned)(open >> 8 * i & 255));
            if (!n) continue;
            occupied++, rays += n;
            if (n < least) least = n, which = i;
        }
        if (rays > 8 * (occupied - 1)) return open;
        leave = (unsigned)(~open >> 8 * which & 255);
        for (i = 0; leave; i++) {
            const unsigned room = (unsigned)(open >> 8 * i & 255);
            unsigned take, some;
            if (i == which || !room || room == 255) continue;
            some = _pdep_u32((1u << __builtin_popcount(room)) - 1, leave), take = _pdep_u32((1u << __builtin_popcount(leave)) - 1, room);
            isogi_vol__move(s, turn, which, (__mmask8)some, i, (__mmask8)take);
            leave &= ~some, open ^= (uint64_t)take << 8 * i | (uint64_t)some << 8 * which;
        }
    }
}

/* A ray that cannot be set up with seven others; whether it takes the slot. */
static int isogi_vol__seat_odd(isogi_vol__batch *b, isogi_vol__pool *s, size_t i, int slot) {
    isogi_vol__ride r;
    isogi_hit any, *hit = b->hits ? &b->hits[i] : &any;
    r.flags = isogi_vol__flags(b, i);
    if (!isogi_vol__begin(b, i, &r.walk)) isogi_vol__finish(b, i, &r.walk, 0);
    else if (r.flags & ISOGI_RAY_CAPPED || !isogi_vol__seat(s, slot, &r.walk))
        isogi_vol__finish(b, i, &r.walk, isogi_vol__walk_ray(&r, hit));
    else {
        s->ray[slot] = i;
        return 1;
    }
    return 0;
}

/* Sends for the nodes in which the rays of a bundle begin; round: for the voxels round that place, too. */
ISOGI_VOL__INLINE void isogi_vol__send_for_bundle(const isogi_pyramid *p, const isogi_bundle *bundle, int round) {
    const ptrdiff_t *const stride = p->volume.stride;
    double grid[3];
    size_t at[3];
    int a;
    for (a = 0; a < 3; a++) grid[a] = bundle->start ? (double)bundle->start->cell[a] : bundle->origin[a] - p->origin[a];
    if (!bundle->start) isogi_vol__transform(p->to_grid, grid, grid);
    for (a = 0; a < 3; a++) at[a] = grid[a] > 0 ? grid[a] < p->cells[a] ? (size_t)grid[a] : (size_t)p->cells[a] - 1 : 0;
    for (a = 0; a < 2; a++) {
        const uint8_t *node = p->nodes[isogi_vol__node_at(p, a, at[0] >> (2 * a + 2), at[1] >> (2 * a + 2), at[2] >> (2 * a + 2))];
        _mm_prefetch((const char *)node, _MM_HINT_T1), _mm_prefetch((const char *)node + 64, _MM_HINT_T1);
    }
    for (a = 0; round && a < ISOGI_VOL__ROUND * ISOGI_VOL__ROUND; a++) {
        const uintptr_t row = (uintptr_t)p->volume.data + (uintptr_t)(((ptrdiff_t)at[0] - ISOGI_VOL__CLEARED + 1) * stride[0]) +
                              (uintptr_t)(((ptrdiff_t)at[1] + a % ISOGI_VOL__ROUND - ISOGI_VOL__CLEARED + 1) * stride[1]) +
                              (uintptr_t)(((ptrdiff_t)at[2] + a / ISOGI_VOL__ROUND - ISOGI_VOL__CLEARED + 1) * stride[2]);
        _mm_prefetch((const char *)row, _MM_HINT_T1);
        _mm_prefetch((const char *)(row + (uintptr_t)((ISOGI_VOL__ROUND - 1) * stride[0])), _MM_HINT_T1);
    }
}

/* Takes rays into open slots until there are none of either, but not for the sake of a few slots. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__fill_pool(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                                  uint64_t seats, uint64_t open, size_t *next, size_t count) {
    while (open && *next < count) {
        const size_t rays = count - *next;
        const int room = __builtin_popcountll(open);
        int n = rays < 8 ? room < (int)rays ? room : (int)rays : room < 8 ? room : 8;
        uint8_t list[16];
        unsigned odd, seated;
        int k;
        if (room < 6 && open != seats && rays > (size_t)room) break;
        if (b->bundle_count > 1) {
            const size_t bundle = *next / b->each, left = (bundle + 1) * b->each - *next;
            if (bundle != b->opened) isogi_vol__open_bundle(b, bundle);
            if (*next == bundle * b->each && bundle + 1 < b->bundle_count)
                isogi_vol__send_for_bundle(b->pyramid, b->bundles + bundle + 1, isogi_vol__are_many(b, *next));
            n = left < (size_t)n ? (int)left : n;
        }
        {
            const __m128i all = _mm512_castsi512_si128(_mm512_maskz_compress_epi8(open, _mm512_load_si512(b->pyramid->ways->child[0])));
            _mm_storeu_si128((__m128i *)(void *)list, _mm_mask_mov_epi8(_mm_broadcastb_epi8(all), (__mmask16)((1u << n) - 1), all));
        }
        turn->ahead[0] &= ~open, turn->ahead[1] &= ~open;
        seated = isogi_vol__seat8(b, turn, s, *next, n, list, &odd);
        for (k = 0; k < n; k++, ++*next) {
            if (seated >> k & 1 || (odd >> k & 1 && isogi_vol__seat_odd(b, s, *next, list[k]))) open &= ~((uint64_t)1 << list[k]);
            else if (odd >> k & 1) continue;
            else if (b->occluded) b->occluded[*next] = 0;
            else memset(&b->hits[*next], 0, sizeof b->hits[0]);
        }
    }
    return open;
}

/* The stage in double, for `waits` rays or more at a time; returns the slots that it leaves open. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__decide_all(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                                   int waits) {
    uint64_t open = 0;
    int first, n, k;
    for (first = 0; turn->doubts - first >= waits; first += n) {
        unsigned alone, hits;
        n = turn->doubts - first < 8 ? turn->doubts - first : 8;
        hits = isogi_vol__decide8(b, s, turn->in_doubt + first, (1u << n) - 1, &alone);
        for (k = 0; k < n; k++) {
            const int slot = turn->in_doubt[first + k];
            isogi_hit any;
            if (alone >> k & 1) hits |= (unsigned)isogi_vol__decide(b, s, slot, b->hits ? &b->hits[s->ray[slot]] : &any) << k;
            if (hits >> k & 1) {
                if (b->occluded) b->occluded[s->ray[slot]] = 1;
                open |= (uint64_t)1 << slot;
            } else if (s->of.mask[0][slot]) turn->at_leaf[turn->leaves++] = (uint8_t)slot;
            else turn->choosing |= (uint64_t)1 << slot;
        }
    }
    memmove(turn->in_doubt, turn->in_doubt + first, (size_t)(turn->doubts - first));
    turn->doubts -= first;
    return open;
}

/* The stage in float, likewise. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE uint64_t isogi_vol__look_all(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                                 int waits) {
    const int before = turn->doubts;
    uint64_t open = 0;
    int first, n, again;
    while (turn->leaves >= waits) {
        for (first = again = 0; turn->leaves - first >= waits; first += n) {
            uint64_t seats;
            unsigned hits;
            n = turn->leaves - first < 8 ? turn->leaves - first : 8;
            memcpy(&seats, turn->at_leaf + first, 8);
            for (hits = isogi_vol__look(turn, s, turn->at_leaf + first, n, &again); hits; hits &= hits - 1) {
                const int slot = (int)(seats >> 8 * __builtin_ctz(hits) & 255);
                b->occluded[s->ray[slot]] = 1;
                open |= (uint64_t)1 << slot;
            }
        }
        memmove(turn->at_leaf + again, turn->at_leaf + first, (size_t)(turn->leaves - first));
        turn->leaves += again - first;
    }
    for (n = before; n < turn->doubts; n++) isogi_vol__send_for(&b->pyramid->volume, s->cell[turn->in_doubt[n]], 0);
    return open;
}

/* Slots without a ray take part in all stages, with zeros, and are left out at their ends. first: slots before have rays, to
   which only what rays do not begin with is new. */
ISOGI_VOL__AVX512 static void isogi_vol__clear_pool(isogi_vol__pool *s, int first, int groups, const isogi_pyramid *p) {
    char *row = (char *)s;
    int i, k;
    for (i = 0; i < (int)(sizeof *s / sizeof s->ray); i++, row += sizeof s->ray)
        for (k = first; k < groups; k++) _mm512_store_si512(row + 64 * k, _mm512_setzero_si512());
    for (k = 0; k < first; k++) {
        _mm512_store_pd(s->step + 8 * k, _mm512_setzero_pd());
        for (i = 0; i < ISOGI_VOL__NODE_LEVELS; i++) _mm512_store_si512(s->of.mask[i] + 8 * k, _mm512_setzero_si512());
    }
    for (i = 8 * first; i < 8 * groups; i++) s->level[i] = -1, s->address[i] = (uint64_t)(uintptr_t)p->nodes;
}

/* Whether sixteen rays differ in nothing but direction. */
ISOGI_VOL__AVX512 static int isogi_vol__alike(const isogi_ray *rays) {
    const __m512i first = _mm512_loadu_si512(rays);
    __m512i other = _mm512_setzero_si512();
    int i;
    if (sizeof *rays != 64 || offsetof(isogi_ray, dir) != 24) return 0;
#pragma GCC unroll 15
    for (i = 1; i < ISOGI_VOL__PACKET; i++) other = _mm512_ternarylogic_epi64(other, first, _mm512_loadu_si512(rays + i), 0xf6);
    return !(_mm512_test_epi32_mask(other, other) & ~0x01c0);
}

/* The next eight to sixteen rays into the first slots of a pool without rays; returns those that have one. */
ISOGI_VOL__AVX512 ISOGI_VOL__INLINE unsigned isogi_vol__seat_packet(isogi_vol__batch *b, isogi_vol__pool *s, size_t next, int count) {
    static const uint8_t list[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    unsigned odd[2] = {0, 0}, rays, rest;
    if (count == ISOGI_VOL__PACKET && !b->bundle && isogi_vol__alike(b->rays + next)) rays = isogi_vol__seat_alike(b, s, next, odd);
    else {
        rays = isogi_vol__seat8(b, NULL, s, next, 8, list, &odd[0]);
        if (count > 8) rays |= isogi_vol__seat8(b, NULL, s, next + 8, count - 8, list + 8, &odd[1]) << 8;
    }
    for (rest = ~rays & ((1u << count) - 1); rest; rest &= rest - 1) {
        const int k = __builtin_ctz(rest);
        if ((odd[0] | odd[1] << 8) >> k & 1) rays |= (unsigned)isogi_vol__seat_odd(b, s, next + (size_t)k, k) << k;
        else if (b->occluded) b->occluded[next + (size_t)k] = 0;
        else memset(&b->hits[next + (size_t)k], 0, sizeof b->hits[0]);
    }
    return rays;
}

/* Rays that stand at the root are taken down from there, a row of eight at a time. */
ISOGI_VOL__AVX512 static void isogi_vol__take_rows_down(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s, uint64_t rays) {
    int i;
    for (i = 0; i < ISOGI_VOL__POOL && rays >> i; i += 8) {
        const __m512d origin[3] = {_mm512_load_pd(&s->origin[0][i]), _mm512_load_pd(&s->origin[1][i]), _mm512_load_pd(&s->origin[2][i])};
        const __m512d inverse[3] = {_mm512_load_pd(&s->inverse[0][i]), _mm512_load_pd(&s->inverse[1][i]),
                                    _mm512_load_pd(&s->inverse[2][i])};
        const __m512d dir[3] = {_mm512_load_pd(&s->dir[0][i]), _mm512_load_pd(&s->dir[1][i]), _mm512_load_pd(&s->dir[2][i])};
        uint8_t seats[16];
        _mm_storeu_si128((__m128i *)(void *)seats, _mm_add_epi8(_mm_set1_epi8((char)i), _mm_set_epi64x(0, 0x0706050403020100)));
        _mm512_store_si512(&s->begin[i], _mm512_set1_epi64(3));
        (void)isogi_vol__take_down(b, turn, s, (size_t)s->ray[i + __builtin_ctzll(rays >> i)], seats, 1, (__mmask8)(rays >> i),
                                   (__mmask8)(rays >> i), origin, inverse, dir, _mm512_load_pd(&s->isovalue[i]),
                                   _mm512_load_si512(&s->end[i]), _mm512_load_si512(&s->flip[i]));
    }
}

/* The rays from *next on, up to `end`, through the slots of a pool, each taken again as soon as it is free; `open`: those without a ray.
   Not inlined, nor are packets, so that the stacks of the two do not add up. */
ISOGI_VOL__AVX512 ISOGI_VOL__NOINLINE static void isogi_vol__run_pool(isogi_vol__batch *b, isogi_vol__turn *turn, isogi_vol__pool *s,
                                                                      int groups, uint64_t open, size_t *next, size_t end) {
    const uint64_t seats = ~(uint64_t)0 >> (64 - 8 * groups);
    int i, half = (groups + 1) / 2, share = b->bundle && b->bundle_count == 1;
    turn->choosing = turn->ahead[0] = turn->ahead[1] = 0;
    isogi_vol__take_rows_down(b, turn, s, seats & ~open);
    for (;;) {
        uint64_t alive = 0;
        int answered, waits;
        /* rays of a bundle begin with cells to be looked at, so they come in before that stage; others begin with a node, which is
           sent for at the end of a turn */
        if (open == seats) open = isogi_vol__fill_pool(b, turn, s, seats, open, next, end);
        if (open == seats) return;
        if (share) isogi_vol__share(turn, s, groups, __builtin_ctzll(seats & ~open)), share = 0;
        /* those that choose stay where they are */
        if (open && groups > 1 && *next == end && !turn->choosing) open = isogi_vol__close_ranks(s, turn, groups, open);
        for (i = 0; i < groups; i++) {
            const __mmask8 lives = _mm512_cmpge_epi64_mask(_mm512_load_si512(&s->level[8 * i]), _mm512_setzero_si512());
            alive |= (uint64_t)lives << 8 * i; /* counted below: gcc 12 may read beyond a mask that it has put by */
            if (i + half < groups) isogi_vol__send_for_nodes(s, 8 * (i + half));
            if (lives) isogi_vol__answer(turn, s, 8 * i);
        }
        answered = __builtin_popcountll(alive);
        b->work.blocks += (uint64_t)answered;
        /* the other stages wait for five rays, of eight at most, unless hardly any is to come: rays that wait take a turn off */
        waits = answered < 8 ? 1 : 5;
        open |= isogi_vol__decide_all(b, turn, s, waits);
        if (b->bundle) open = isogi_vol__fill_pool(b, turn, s, seats, open, next, end);
        open |= isogi_vol__look_all(b, turn, s, waits);
        for (i = 0; i < groups; i++) {
            unsigned choosing = (unsigned)(turn->choosing >> 8 * i & 255), crossing, done;
            for (crossing = turn->any ? choosing & isogi_vol__between(turn, s, 8 * i) : 0; crossing; crossing &= crossing - 1) {
                const int slot = 8 * i + __builtin_ctz(crossing);
                b->occluded[s->ray[slot]] = 1, open |= (uint64_t)1 << slot, choosing ^= crossing & (0u - crossing);
            }
            done = choosing ? isogi_vol__choose(turn, s, 8 * i, (__mmask8)choosing) : 0;
            if (choosing && i < half) isogi_vol__send_for_nodes(s, 8 * i);
            open |= (uint64_t)done << 8 * i;
            for (; done; done &= done - 1) {
                const uint64_t ray = s->ray[8 * i + __builtin_ctz(done)];
                if (b->occluded) b->occluded[ray] = 0;
                else memset(&b->hits[ray], 0, sizeof b->hits[0]);
            }
        }
        turn->choosing = 0;
        if (!b->bundle) open = isogi_vol__fill_pool(b, turn, s, seats, open, next, end);
    }
}

/* Sixteen rays at a time that nearly coincide; where they do not, a pool takes the next ones, and ever more of them each time. */
ISOGI_VOL__AVX512 static void isogi_vol__trace_pool(isogi_vol__batch *b, size_t count) {
    const int groups = count < ISOGI_VOL__POOL ? (int)(count + 7) / 8 : ISOGI_VOL__POOL / 8;
    const uint64_t seats = ~(uint64_t)0 >> (64 - 8 * groups);
    isogi_vol__pool s;
    isogi_vol__turn turn;
    size_t next = 0, run = ISOGI_VOL__POOL;
    int opened = 0;
    while (next < count) {
        uint64_t open = seats;
        size_t end = count;
        int taken = 0;
        if (b->rays && b->bundle_count <= 1 && count - next >= ISOGI_VOL__PACKET / 2) {
            const int n = count - next < ISOGI_VOL__PACKET ? (int)(count - next) : ISOGI_VOL__PACKET;
            unsigned rays;
            if (!opened && n < ISOGI_VOL__PACKET) isogi_vol__clear_pool(&s, 0, ISOGI_VOL__PACKET / 8, b->pyramid);
            rays = isogi_vol__seat_packet(b, &s, next, n);
            next += (size_t)n;
            if (!rays) continue;
            if (__builtin_popcount(rays) >= ISOGI_VOL__PACKET / 4 && isogi_vol__seats_coincide(&s, rays)) {
                isogi_vol__trace_packet(b, &s, rays);
                run = ISOGI_VOL__POOL;
                continue;
            }
            open ^= rays, taken = ISOGI_VOL__PACKET / 8;
            end = count - next > run ? next + run : count;
            run = count - next > run ? 4 * run : run;
        }
        if (!opened) {
            isogi_vol__open_turn(&turn, b->pyramid);
            turn.any = isogi_vol__any_will_do(b), opened = 1;
            isogi_vol__clear_pool(&s, taken, groups, b->pyramid);
        }
        isogi_vol__run_pool(b, &turn, &s, groups, open, &next, end);
    }
    if (opened) b->work.cells += turn.cells;
}
#ifndef __clang__
#pragma GCC diagnostic pop
#endif
#endif

static isogi_result isogi_vol__trace(isogi_vol__batch *b, size_t count, isogi_counters *counters) {
    size_t i = 0;
    b->count = count;
#ifdef ISOGI_VOL__AVX
    if (isogi_vol__is_wide(b->pyramid) && count && (count > 3 || b->pyramid->context.force_path == ISOGI_VOL__PATH_AVX512))
        isogi_vol__trace_pool(b, count), i = count;
    else
#endif
    if (b->pyramid->fast && !isogi_vol__is_wide(b->pyramid) && count > 1) isogi_vol__trace_rides(b), i = count;
    for (; i < count; i++) {
        if (b->bundles && i / b->each != b->opened) isogi_vol__open_bundle(b, i / b->each);
        isogi_vol__trace_one(b, i);
    }
    if (counters) {
        counters->rays += b->work.rays, counters->blocks += b->work.blocks;
        counters->cells += b->work.cells, counters->cubics += b->work.cubics;
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_vol_intersect(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, isogi_hit *hits,
                                           isogi_counters *counters) {
    isogi_vol__batch b;
    if (!pyramid || (count && (!rays || !hits))) return ISOGI_INVALID;
    isogi_vol__clear_batch(&b, pyramid);
    b.rays = rays, b.hits = hits;
    return isogi_vol__trace(&b, count, counters);
}

ISOGI_API isogi_result isogi_vol_occluded(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, uint8_t *occluded,
                                          isogi_counters *counters) {
    isogi_vol__batch b;
    if (!pyramid || (count && (!rays || !occluded))) return ISOGI_INVALID;
    isogi_vol__clear_batch(&b, pyramid);
    b.rays = rays, b.occluded = occluded;
    return isogi_vol__trace(&b, count, counters);
}

ISOGI_API isogi_result isogi_vol_continue(const isogi_pyramid *pyramid, const isogi_hit *starts, const float (*dirs)[3],
                                          const double *tmax, double isovalue, uint32_t flags, size_t count, isogi_hit *hits,
                                          isogi_counters *counters) {
    isogi_vol__batch b;
    if (!pyramid || (count && (!starts || !dirs || !hits))) return ISOGI_INVALID;
    isogi_vol__clear_batch(&b, pyramid);
    b.starts = starts, b.dirs = dirs, b.tmax = tmax, b.isovalue = isovalue, b.flags = flags, b.hits = hits;
    return isogi_vol__trace(&b, count, counters);
}

/* ---- all hits: groups of rays go on from hit to hit together ---- */

#define ISOGI_VOL__GROUP 32

typedef struct isogi_vol__followers {
    isogi_hit start[ISOGI_VOL__GROUP], hit[ISOGI_VOL__GROUP];
    float dir[ISOGI_VOL__GROUP][3];
    double tmax[ISOGI_VOL__GROUP];
    size_t ray[ISOGI_VOL__GROUP]; /* which rays of the group are under way */
    size_t count, size;           /* their number; of the group */
} isogi_vol__followers;

/* Notes what the rays under way have found, and sets those up that go on. */
static void isogi_vol__follow(isogi_vol__followers *f, const isogi_ray *rays, size_t capacity, isogi_hit *hits, size_t *counts) {
    size_t i, kept = 0, n;
    for (i = 0; i < f->count; i++) {
        const size_t ray = f->ray[i];
        const isogi_hit hit = f->hit[i];
        double left;
        if (!hit.side) continue;
        n = counts[ray]++;
        if (n < capacity) hits[ray * capacity + n] = hit;
        left = isogi_vol__tmax(rays[ray].tmax) - hit.t;
        if (n >= capacity || !(left > 0)) continue;
        memcpy(f->dir[kept], rays[ray].dir, sizeof f->dir[kept]);
        f->start[kept] = hit, f->tmax[kept] = left, f->ray[kept++] = ray;
    }
    f->count = kept;
}

/* From the last hits to the next ones: runs of rays with one isovalue in one call. */
static void isogi_vol__follow_on(const isogi_pyramid *pyramid, isogi_vol__followers *f, const isogi_ray *rays, isogi_counters *counters) {
    size_t i, first, end;
    for (first = 0; first < f->count; first = end) {
        const isogi_ray *ray = &rays[f->ray[first]];
        for (end = first + 1; end < f->count; end++) {
            const isogi_ray *other = &rays[f->ray[end]];
            if (other->isovalue < ray->isovalue || other->isovalue > ray->isovalue || other->flags != ray->flags) break;
        }
        isogi_vol_continue(pyramid, f->start + first, (const float(*)[3])f->dir + first, f->tmax + first, ray->isovalue,
                           ray->flags | ISOGI_RAY_ONWARD, end - first, f->hit + first, counters);
    }
    for (i = 0; i < f->count; i++) f->hit[i].t += f->start[i].t;
}

/* All further hits of a group that has its first ones. */
static void isogi_vol__follow_all(const isogi_pyramid *pyramid, isogi_vol__followers *f, const isogi_ray *rays, size_t capacity,
                                  isogi_hit *hits, size_t *counts, isogi_counters *counters) {
    size_t i;
    for (i = 0; i < f->count; i++) f->ray[i] = i, counts[i] = 0;
    for (isogi_vol__follow(f, rays, capacity, hits, counts); f->count; isogi_vol__follow(f, rays, capacity, hits, counts))
        isogi_vol__follow_on(pyramid, f, rays, counters);
}

ISOGI_API isogi_result isogi_vol_intersect_all(const isogi_pyramid *pyramid, const isogi_ray *rays, size_t count, size_t capacity,
                                               isogi_hit *hits, size_t *counts, isogi_counters *counters) {
    isogi_vol__followers f;
    size_t first;
    if (!pyramid || (count && (!rays || !counts || (capacity && !hits)))) return ISOGI_INVALID;
    if (count && capacity > SIZE_MAX / sizeof *hits / count) return ISOGI_TOO_LARGE;
    for (first = 0; first < count; first += f.size) {
        f.size = f.count = count - first < ISOGI_VOL__GROUP ? count - first : ISOGI_VOL__GROUP;
        isogi_vol_intersect(pyramid, rays + first, f.count, f.hit, counters);
        isogi_vol__follow_all(pyramid, &f, rays + first, capacity, capacity ? hits + first * capacity : NULL, counts + first, counters);
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_vol_bundle_all(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3], size_t count,
                                            size_t capacity, isogi_hit *hits, size_t *counts, isogi_counters *counters) {
    isogi_ray rays[ISOGI_VOL__GROUP];
    isogi_vol__followers f;
    isogi_bundle own;
    isogi_hit start;
    size_t first, i;
    if (!pyramid || !bundle || (count && (!dirs || !counts || (capacity && !hits)))) return ISOGI_INVALID;
    if (count && capacity > SIZE_MAX / sizeof *hits / count) return ISOGI_TOO_LARGE;
    own = *bundle; /* its start may lie among the hits */
    if (bundle->start) start = *bundle->start, own.start = &start;
    memset(rays, 0, sizeof rays);
    for (i = 0; i < ISOGI_VOL__GROUP; i++) rays[i].tmax = bundle->tmax, rays[i].isovalue = bundle->isovalue, rays[i].flags = bundle->flags;
    for (first = 0; first < count; first += f.size) {
        f.size = f.count = count - first < ISOGI_VOL__GROUP ? count - first : ISOGI_VOL__GROUP;
        for (i = 0; i < f.count; i++) memcpy(rays[i].dir, dirs[first + i], sizeof rays[i].dir);
        isogi_vol_bundle(pyramid, &own, dirs + first, f.count, f.hit, counters);
        isogi_vol__follow_all(pyramid, &f, rays, capacity, capacity ? hits + first * capacity : NULL, counts + first, counters);
    }
    return ISOGI_OK;
}

/* ---- pieces of a ray that can hold given values ---- */

/* The largest block around the present cell, no larger than level `top`, that holds none of the values, else the smallest one: its
   bounds; whether it may hold some. */
static int isogi_vol__holding_block(isogi_vol__walk *w, const double (*ranges)[2], size_t count, int top, int low[3], int high[3]) {
    int n, a, holds = 1;
    for (n = top; n >= 0; n--) {
        const isogi_level *level = &w->pyramid->level[n];
        const int shift = 2 + 2 * n;
        size_t b[3];
        const float *range;
        for (a = 0; a < 3; a++) {
            b[a] = (size_t)(w->cell[a] >> shift), low[a] = (w->cell[a] >> shift) << shift;
            high[a] = w->pyramid->cells[a] - low[a] < level->cells ? w->pyramid->cells[a] : low[a] + level->cells;
        }
        range = level->range[b[0] + level->size[0] * (b[1] + level->size[1] * b[2])];
        w->count.blocks++;
        holds = range[0] <= range[1] && isogi_vol__any_overlaps(ranges, count, (double)range[0], (double)range[1]);
        if (!holds) break;
    }
    return holds;
}

/* From where the walk stands to the end of the next piece; t of its two ends. */
static int isogi_vol__walk_interval(isogi_vol__walk *w, const double (*ranges)[2], size_t count, double interval[2]) {
    int top = ISOGI_VOL__LEVELS - 1, low[3], high[3], axis, open = 0, a;
    for (;;) {
        int before[3], changed = 0;
        const int holds = isogi_vol__holding_block(w, ranges, count, top, low, high);
        const double t = isogi_vol__exit(w, low, high, &axis);
        if (open && !holds) break;
        if (holds && !open) interval[0] = w->t, open = 1;
        interval[1] = isogi_vol__min(t, w->end);
        if (t >= w->end) break;
        for (a = 0; a < 3; a++) before[a] = w->cell[a];
        if (!isogi_vol__advance(w, low, high, t, axis)) break;
        for (a = 0; a < 3; a++) changed |= before[a] ^ w->cell[a];
        top = changed >= 64 ? 2 : changed >= 16 ? 1 : 0; /* larger blocks whose bounds were not crossed are known to hold some */
    }
    return open;
}

ISOGI_API int isogi_vol_next_interval(const isogi_pyramid *pyramid, const isogi_ray *ray, const double (*ranges)[2], size_t range_count,
                                      double from, double interval[2], isogi_counters *counters) {
    isogi_vol__batch b;
    isogi_vol__walk w;
    isogi_hit none;
    isogi_ray rest;
    double piece[2] = {0, 0}, begin, end, slack;
    int found;
    if (!pyramid || !ray || !ranges || !interval) return 0;
    isogi_vol__clear_batch(&b, pyramid);
    rest = *ray, rest.flags = 0, rest.isovalue = 0;
    if (from > rest.tmin) rest.tmin = from;
    b.pyramid = pyramid, b.rays = &rest, b.hits = &none;
    if (isogi_vol__is_nan(from) || !isogi_vol__begin(&b, 0, &w)) return 0;
    isogi_vol__first_cell(&w);
    found = isogi_vol__walk_interval(&w, ranges, range_count, piece);
    if (counters) counters->blocks += w.count.blocks;
    /* what rounding may have moved */
    slack = 1e-12 * (fabs(w.base) + piece[1] + 1 / isogi_vol__largest(w.dir[0], w.dir[1], w.dir[2]));
    begin = isogi_vol__max(w.base + piece[0] - slack, w.base), end = isogi_vol__min(piece[1] + slack, w.end) + w.base;
    begin = isogi_vol__max(begin, rest.tmin), end = isogi_vol__min(end, isogi_vol__tmax(rest.tmax));
    if (!found || !(end > begin) || !(w.end > 1e-3 * slack)) return 0; /* what little rounding leaves at a ray's end is no piece */
    interval[0] = begin, interval[1] = end;
    return 1;
}

/* ---- bundles ---- */

/* hits or occluded, the other is NULL. */
static isogi_result isogi_vol__bundles(const isogi_pyramid *pyramid, const isogi_bundle *bundles, size_t bundle_count,
                                       const float (*dirs)[3], size_t each, isogi_hit *hits, uint8_t *occluded, isogi_counters *counters) {
    isogi_vol__batch b;
    if (!pyramid || (bundle_count && !bundles) || (bundle_count && each && (!dirs || (!hits && !occluded)))) return ISOGI_INVALID;
    if (each && bundle_count > SIZE_MAX / sizeof *hits / each) return ISOGI_TOO_LARGE;
    if (!bundle_count || !each) return ISOGI_OK;
    isogi_vol__clear_batch(&b, pyramid);
    b.bundle = 1, b.bundles = bundles, b.each = each, b.bundle_count = bundle_count, b.dirs = dirs, b.hits = hits, b.occluded = occluded;
    isogi_vol__open_bundle(&b, 0); /* hits may hold its start */
    return isogi_vol__trace(&b, bundle_count * each, counters);
}

ISOGI_API isogi_result isogi_vol_bundles(const isogi_pyramid *pyramid, const isogi_bundle *bundles, size_t bundle_count,
                                         const float (*dirs)[3], size_t each, isogi_hit *hits, isogi_counters *counters) {
    return isogi_vol__bundles(pyramid, bundles, bundle_count, dirs, each, hits, NULL, counters);
}

ISOGI_API isogi_result isogi_vol_bundles_occluded(const isogi_pyramid *pyramid, const isogi_bundle *bundles, size_t bundle_count,
                                                  const float (*dirs)[3], size_t each, uint8_t *occluded, isogi_counters *counters) {
    return isogi_vol__bundles(pyramid, bundles, bundle_count, dirs, each, NULL, occluded, counters);
}

ISOGI_API isogi_result isogi_vol_bundle(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3], size_t count,
                                        isogi_hit *hits, isogi_counters *counters) {
    return isogi_vol__bundles(pyramid, bundle, 1, dirs, count, hits, NULL, counters);
}

ISOGI_API isogi_result isogi_vol_bundle_occluded(const isogi_pyramid *pyramid, const isogi_bundle *bundle, const float (*dirs)[3],
                                                 size_t count, uint8_t *occluded, isogi_counters *counters) {
    return isogi_vol__bundles(pyramid, bundle, 1, dirs, count, NULL, occluded, counters);
}

/* ---- what is at hits ---- */

ISOGI_API isogi_result isogi_vol_positions(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, float (*positions)[3]) {
    size_t i;
    int a;
    if (!pyramid || (count && (!hits || !positions))) return ISOGI_INVALID;
    for (i = 0; i < count; i++) {
        double grid[3], world[3] = {0, 0, 0};
        for (a = 0; a < 3; a++) grid[a] = hits[i].cell[a] + hits[i].local[a];
        if (hits[i].side) isogi_vol_to_world(pyramid, grid, world);
        for (a = 0; a < 3; a++) positions[i][a] = (float)world[a];
    }
    return ISOGI_OK;
}

/* Within two voxels of one that is not finite: the mean of the trilinear gradients of the cells that touch the place and hold the field;
   where these cancel (a sheet one voxel thick), that of the first one. */
static void isogi_vol__gradient_beside(const isogi_pyramid *p, const int cell[3], const double local[3], double gradient[3]) {
    double first[3] = {0, 0, 0}, most = 0;
    int i, a, found = 0;
    for (a = 0; a < 3; a++) gradient[a] = 0;
    for (i = 0; i < 8; i++) {
        double at[3], corner[8], g[3];
        int beside[3], exists = 1;
        for (a = 0; a < 3; a++) {
            const int lower = local[a] <= 0 && (cell[a] > 0 || p->volume.halo_low[a]),
                      upper = local[a] >= 1 && (cell[a] + 1 < p->cells[a] || p->volume.halo_high[a]);
            beside[a] = cell[a], at[a] = local[a];
            if (!(i >> a & 1)) continue;
            beside[a] += upper - lower, at[a] = lower;
            exists &= lower | upper;
        }
        if (!exists) continue;
        isogi_vol__corners(p, beside, 0, corner), isogi_vol__trilinear(corner, at, g);
        if (!isogi_vol__finite3(g)) continue; /* of voxels in the halo only the numbers tell */
        most = isogi_vol__max(most, isogi_vol__largest(g[0], g[1], g[2]));
        for (a = 0; a < 3; a++) gradient[a] += g[a], first[a] = found ? first[a] : g[a];
        found = 1;
    }
    for (a = 0; a < 3; a++) gradient[a] = fabs(gradient[a]) > 1e-6 * most ? gradient[a] : 0; /* what rounding has left */
    if (!(isogi_vol__largest(gradient[0], gradient[1], gradient[2]) > 1e-3 * most)) memcpy(gradient, first, sizeof first);
}

/* The B-spline's gradient from those of its 64 taps that have weight; returns how far apart these are. On the plane that two parts of a
   field share, one counts taps on its other side in which the other has none, and one of these may not be finite. */
static double isogi_vol__weighty_taps(const isogi_pyramid *p, const int cell[3], const double local[3], double gradient[3]) {
    const double scale = 4 * p->volume.scale;
    isogi_volume quarter = p->volume;
    double w[3][4], d[3][4], base = 0, low = DBL_MAX, high = -DBL_MAX;
    int tap[3][4], a, i;
    quarter.scale = 0.25, quarter.bias = 0;
    for (a = 0; a < 3; a++) isogi_vol__tap_weights(ISOGI_FILTER_BSPLINE, &p->volume, a, cell[a], local[a], w[a], d[a], tap[a]);
    gradient[0] = gradient[1] = gradient[2] = 0;
    for (i = 0; i < 64; i++) {
        const int x = i & 3, y = i >> 2 & 3, z = i >> 4;
        double value;
        /* at the upper end of a cell the lowest weight is what rounding leaves of it */
        if (!(fabs(w[0][x]) + fabs(d[0][x]) > 1e-15 && fabs(w[1][y]) + fabs(d[1][y]) > 1e-15 && fabs(w[2][z]) + fabs(d[2][z]) > 1e-15))
            continue;
        isogi_vol__row(&quarter, tap[0][x], tap[1][y], tap[2][z], 1, &value);
        if (low > high) base = value;
        low = isogi_vol__min(low, value), high = isogi_vol__max(high, value), value -= base;
        gradient[0] += d[0][x] * w[1][y] * w[2][z] * value, gradient[1] += w[0][x] * d[1][y] * w[2][z] * value;
        gradient[2] += w[0][x] * w[1][y] * d[2][z] * value;
    }
    for (a = 0; a < 3; a++) gradient[a] *= scale;
    return fabs(scale) * (high - low);
}

/* The gradient of the smoothed field, per grid unit; zero where it is nothing but what rounding has left of voxels that cancel, as in the
   middle of a sheet: it would point anywhere, on each instruction path elsewhere. Hardly ever near enough to that to look at the voxels. */
static void isogi_vol__smooth_gradient(const isogi_pyramid *p, const int cell[3], const double local[3], double gradient[3]) {
    const double noise = 1e-14;
    double most, range, sums[3];
    isogi_vol__cubic_sum(p, ISOGI_FILTER_BSPLINE, cell, local, gradient);
    if (!isogi_vol__finite3(gradient)) {
        range = isogi_vol__weighty_taps(p, cell, local, gradient);
        if (!isogi_vol__finite3(gradient) || !(isogi_vol__largest(gradient[0], gradient[1], gradient[2]) > noise * range))
            isogi_vol__gradient_beside(p, cell, local, gradient);
        return;
    }
    most = isogi_vol__largest(gradient[0], gradient[1], gradient[2]);
    if (!(most > 0 && most < noise * (p->range[1] - p->range[0]))) return;
    range = isogi_vol__weighty_taps(p, cell, local, sums);
    if (most < noise * range) gradient[0] = gradient[1] = gradient[2] = 0;
}

/* Minus the gradient (per grid unit) at a hit; at the cap of a border, a vector out of the nearest face of the box. */
static void isogi_vol__outward(const isogi_pyramid *p, const isogi_hit *hit, isogi_normal_kind kind, double out[3]) {
    double corner[8], nearest = 2;
    int cell[3], a, axis = 0, upper = 0;
    for (a = 0; a < 3; a++) {
        double low = hit->cell[a] + hit->local[a], high = p->cells[a] - low;
        cell[a] = (int)hit->cell[a];
        if (low < nearest) nearest = low, axis = a, upper = 0;
        if (high < nearest) nearest = high, axis = a, upper = 1;
        out[a] = 0;
    }
    if (hit->side == 2 || hit->side == -2) {
        out[axis] = upper ? 1 : -1;
        return;
    }
    if (p->field.value) {
        double grid[3];
        for (a = 0; a < 3; a++) grid[a] = hit->cell[a] + hit->local[a];
        isogi_vol__field_at(p, grid, out);
        for (a = 0; a < 3; a++) out[a] *= p->volume.spacing[a]; /* per grid unit; the axes are the world's */
    } else if (kind == ISOGI_NORMAL_SMOOTH) isogi_vol__smooth_gradient(p, cell, hit->local, out);
    else isogi_vol__corners(p, cell, 0, corner), isogi_vol__trilinear(corner, hit->local, out);
    for (a = 0; a < 3; a++) out[a] = -out[a];
}

ISOGI_API isogi_result isogi_vol_normals(const isogi_pyramid *pyramid, const isogi_hit *hits, size_t count, isogi_normal_kind kind,
                                         float (*normals)[3]) {
    size_t i;
    int a;
    if (!pyramid || (count && (!hits || !normals)) || (kind != ISOGI_NORMAL_SMOOTH && kind != ISOGI_NORMAL_TRILINEAR)) return ISOGI_INVALID;
    for (i = 0; i < count; i++) {
        double n[3] = {0, 0, 0}, length = 0;
        int usable = hits[i].side != 0;
        for (a = 0; a < 3; a++) usable = usable && hits[i].cell[a] < (uint32_t)pyramid->cells[a];
        if (usable) {
            isogi_vol__outward(pyramid, &hits[i], kind, n);
            isogi_vol__gradient_to_world(pyramid, n, n);
            length = isogi_vol__length(n);
        }
        for (a = 0; a < 3; a++) normals[i][a] = length > 0 ? (float)(n[a] / length) : 0;
    }
    return ISOGI_OK;
}

/* ==== fields given by a function ======================================================================================== */

/* A field's pyramid has a lattice without voxels; its blocks are bounded by the field's first two Taylor terms at their middles. The
   plain walk leads rays to the cells that may hold the surface. */

/* A bound of the Hessian's norm in a box of the world, times square; as good as infinite where the callback gives no sensible one. */
static double isogi_vol__hessian(const isogi_field *f, const double low[3], const double high[3], double square) {
    double bound = f->hessian_in ? f->hessian_in(f->user, low, high) : f->hessian;
    if (!isogi_vol__finite64(bound) || !(bound >= 0)) return 1e150;
    return isogi_vol__min(isogi_vol__max(bound * square, 1e-300), 1e150);
}

/* The box of cells low..high in the world. */
ISOGI_VOL__COLD static void isogi_vol__world_box(const isogi_pyramid *p, const int low[3], const int high[3], double from[3],
                                                 double to[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        from[a] = p->volume.origin[a] + p->volume.spacing[a] * low[a];
        to[a] = p->volume.origin[a] + p->volume.spacing[a] * high[a];
    }
}

/* f(c + h) = f(c) + g h + r with |r| <= hessian |h|^2 / 2. */
static void isogi_vol__bound_field(const isogi_pyramid *p, size_t x, size_t y, size_t z, float bound[2]) {
    const size_t block[3] = {x, y, z};
    double from[3], to[3], middle[3], gradient[3] = {0, 0, 0}, value, error = 0, square = 0;
    int low[3], high[3], a;
    for (a = 0; a < 3; a++) low[a] = (int)(4 * block[a]), high[a] = p->cells[a] - low[a] < 4 ? p->cells[a] : low[a] + 4;
    isogi_vol__world_box(p, low, high, from, to);
    for (a = 0; a < 3; a++) middle[a] = from[a] + 0.5 * (to[a] - from[a]);
    value = p->field.value(p->field.user, middle, gradient);
    for (a = 0; a < 3; a++) {
        const double half = 0.5 * (to[a] - from[a]);
        error += fabs(gradient[a]) * half, square += half * half;
    }
    error = (error + 0.5 * isogi_vol__hessian(&p->field, from, to, square)) * (1 + 1e-9) + 1e-12 * fabs(value); /* and what rounding adds */
    bound[0] = -HUGE_VALF, bound[1] = HUGE_VALF;
    if (isogi_vol__finite64(value) && isogi_vol__finite64(error) && isogi_vol__finite3(gradient))
        bound[0] = isogi_vol__float_below(value - error), bound[1] = isogi_vol__float_above(value + error);
}

static void isogi_vol__field_task(void *arg, size_t z) {
    isogi_pyramid *p = (isogi_pyramid *)arg;
    const isogi_level *level = &p->level[0];
    size_t x, y;
    for (y = 0; y < level->size[1]; y++)
        for (x = 0; x < level->size[0]; x++)
            isogi_vol__bound_field(p, x, y, z, p->blocks[x + level->size[0] * (y + level->size[1] * z)]);
}

/* ---- the search along a piece of ray ---- */

typedef struct isogi_vol__probe { double t, value, slope; } isogi_vol__probe; /* value minus the isovalue; slope per t */

static int isogi_vol__probe_at(isogi_vol__walk *w, double t, isogi_vol__probe *probe) {
    const double *m = w->pyramid->to_world;
    double grid[3], gradient[3], dir[3];
    int a;
    for (a = 0; a < 3; a++) grid[a] = w->origin[a] + t * w->dir[a];
    isogi_vol__transform(m, w->dir, dir);
    w->count.cubics++;
    probe->t = t, probe->value = isogi_vol__field_at(w->pyramid, grid, gradient) - w->isovalue;
    probe->slope = gradient[0] * dir[0] + gradient[1] * dir[1] + gradient[2] * dir[2];
    return isogi_vol__finite64(probe->value) && isogi_vol__finite64(probe->slope);
}

/* The only root between two probes of different sides: Newton within a bracket that shrinks. */
static double isogi_vol__field_root(isogi_vol__walk *w, const isogi_vol__probe *from, const isogi_vol__probe *to, int inside) {
    double low = from->t, high = to->t, least = 1e-16 * (fabs(low) + fabs(high)),
           t = low + (high - low) * (from->value / (from->value - to->value)), next;
    isogi_vol__probe at;
    int i;
    if (!(t > low && t < high)) t = 0.5 * (low + high);
    for (i = 0; i < 128; i++) {
        if (!isogi_vol__probe_at(w, t, &at)) return t;
        if ((at.value >= 0) == inside) low = t;
        else high = t;
        next = t - at.value / at.slope;
        if (!(next > low && next < high) || (i > 8 && i % 3 == 0)) next = 0.5 * (low + high);
        if (fabs(next - t) <= least || !(high - low > least)) return next;
        t = next;
    }
    return t;
}

/* How far behind a probe the next one may be: no crossing, or one at most and no other, lies between. m bounds |d slope / dt|. */
static double isogi_vol__safe_step(const isogi_vol__probe *at, int inside, double m) {
    const double away = inside ? at->slope : -at->slope, root = sqrt(away * away + 2 * m * fabs(at->value));
    return away < 0 ? isogi_vol__max(2 * fabs(at->value) / (root - away), -away / m) : (away + root) / m;
}

/* Leaves the surface: the root at the start divided out, the field has the sign of its slope as far as 2 |slope| / m. The side is
   looked at half-way there; 0 if the piece ends before. */
static int isogi_vol__leave_field(isogi_vol__walk *w, isogi_vol__probe *at, double t_out, double m, double least) {
    const double step = isogi_vol__max(fabs(at->slope) / m, least);
    w->deflate = 0, w->inside = at->slope > 0;
    if (!(at->t + step < t_out)) return 0;
    if (!isogi_vol__probe_at(w, at->t + step, at)) {
        w->inside = -1;
        return 0;
    }
    w->inside = at->value >= 0;
    return 1;
}

/* What visit_cell does, for a field without voxels. */
static int isogi_vol__visit_field(isogi_vol__walk *w, double t_out, isogi_hit *hit) {
    const isogi_pyramid *p = w->pyramid;
    double from[3], to[3], dir[3], m, least = 1 / (65536 * isogi_vol__largest(w->dir[0], w->dir[1], w->dir[2]));
    isogi_vol__probe at, next;
    int above[3], a;
    for (a = 0; a < 3; a++) above[a] = w->cell[a] + 1;
    isogi_vol__world_box(p, w->cell, above, from, to);
    isogi_vol__transform(p->to_world, w->dir, dir);
    m = isogi_vol__hessian(&p->field, from, to, dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);
    if (!isogi_vol__probe_at(w, w->t, &at)) {
        w->inside = -1, w->deflate = 0;
        return 0;
    }
    if (w->deflate) {
        const int before = w->inside;
        /* a cell that ends at once tells nothing: the next one divides the root out */
        if (t_out < w->end && t_out < 65536 * ISOGI_VOL__ON_SURFACE * least) return 0;
        next = at;
        if (!isogi_vol__leave_field(w, &at, t_out, m, least)) {
            if (before >= 0 && w->inside >= 0) w->inside = before;
            return 0;
        }
        if (before == !w->inside) { /* goes on as it came, and has crossed the surface again right behind the start */
            const double t = w->exact && (next.value >= 0) == before ? isogi_vol__field_root(w, &next, &at, before) : next.t;
            isogi_vol__local(w, t, from);
            isogi_vol__emit(w, t, from, before ? -1 : 1, hit);
            return 1;
        }
    } else if (isogi_vol__state(w, at.value >= 0, hit)) return 1;
    while (at.t < t_out) {
        double step = isogi_vol__safe_step(&at, w->inside, m);
        if (!(step >= least)) step = least, least *= 1.1;
        if (!isogi_vol__probe_at(w, at.t + step < t_out ? at.t + step : t_out, &next)) {
            w->inside = -1;
            return 0;
        }
        if ((next.value >= 0) != w->inside) {
            const double t = w->exact ? isogi_vol__field_root(w, &at, &next, w->inside) : next.t;
            isogi_vol__local(w, t, from);
            isogi_vol__emit(w, t, from, w->inside ? -1 : 1, hit);
            w->inside = !w->inside;
            return 1;
        }
        if (!(next.t > at.t)) return 0; /* a step below the resolution of t */
        at = next;
    }
    return 0;
}

/* ---- building ---- */

static isogi_result isogi_vol__check_field(const isogi_field *f) {
    int a;
    if (!f || !f->value || !isogi_vol__finite3(f->low) || !isogi_vol__finite3(f->high)) return ISOGI_INVALID;
    if (!f->hessian_in && (!(f->hessian > 0) || !isogi_vol__finite64(f->hessian))) return ISOGI_INVALID;
    for (a = 0; a < 3; a++) {
        if (!(f->low[a] < f->high[a]) || !isogi_vol__finite64(f->high[a] - f->low[a])) return ISOGI_INVALID;
        if (f->cells[a] > 0x7ffffffe) return ISOGI_TOO_LARGE;
    }
    return ISOGI_OK;
}

/* The lattice of a field, the bounds of its blocks, and from these the range. */
static isogi_result isogi_vol__fill_field(isogi_pyramid *p) {
    const isogi_field *f = &p->field;
    size_t blocks, first[3] = {0, 0, 0}, last[3], i;
    isogi_result result;
    double low = 1e300, high = -1e300;
    int a, n;
    for (a = 0; a < 3; a++) {
        p->cells[a] = f->cells[a] ? (int)f->cells[a] : 64;
        p->volume.size[a] = (size_t)p->cells[a] + 1, p->volume.origin[a] = f->low[a], p->volume.axes[4 * a] = 1;
        p->volume.spacing[a] = (f->high[a] - f->low[a]) / p->cells[a];
        if (!(p->volume.spacing[a] > 0)) return ISOGI_INVALID;
    }
    p->volume.type = ISOGI_F64, p->volume.scale = 1, p->path = ISOGI_VOL__PATH_PLAIN, p->all_finite = 1;
    isogi_vol__set_transform(p);
    blocks = isogi_vol__plan_levels(p);
    p->blocks = (float(*)[2])isogi_allocate(&p->context, blocks, sizeof *p->blocks);
    if (!p->blocks) return blocks ? ISOGI_NO_MEMORY : ISOGI_TOO_LARGE;
    p->block_count = blocks;
    for (n = 0, i = 0; n < ISOGI_VOL__LEVELS; n++) {
        p->level[n].range = (const float(*)[2])p->blocks + i;
        i += p->level[n].size[0] * p->level[n].size[1] * p->level[n].size[2];
    }
    result = isogi_parallel(&p->context, p->level[0].size[2], isogi_vol__field_task, p, 0, 1);
    if (result != ISOGI_OK) return result;
    for (a = 0; a < 3; a++) last[a] = p->level[0].size[a] - 1;
    isogi_vol__build_level(p, 1, first, last, 0, 1), isogi_vol__build_level(p, 2, first, last, 0, 1);
    for (i = 0; i < p->level[2].size[0] * p->level[2].size[1] * p->level[2].size[2]; i++)
        low = isogi_vol__min(low, (double)p->level[2].range[i][0]), high = isogi_vol__max(high, (double)p->level[2].range[i][1]);
    p->range[0] = isogi_vol__max(low, -1e300), p->range[1] = isogi_vol__min(high, 1e300);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_vol_build_field(isogi_pyramid **pyramid, const isogi_field *field, const isogi_context *context) {
    isogi_result result = isogi_vol__check_field(field);
    isogi_pyramid *p;
    if (!pyramid) return ISOGI_INVALID;
    if (result != ISOGI_OK) return result;
    p = (isogi_pyramid *)isogi_allocate(context, 1, sizeof *p);
    if (!p) return ISOGI_NO_MEMORY;
    memset(p, 0, sizeof *p);
    if (context) p->context = *context;
    p->field = *field;
    result = isogi_vol__fill_field(p);
    if (result == ISOGI_OK) *pyramid = p;
    else isogi_vol_free(p);
    return result;
}

/* ==== surface inside a cell ========================================================================================== */

/* Corner x + 2y + 4z. Edge 4a + n runs along axis a from the corner whose bits on axes a+1 and a+2 (cyclic) are those of n.
   Face 2a + s is the side s of axis a. All of the topology below follows from these numbers: there is no table to be believed. */
static int isogi_vol__edge_corner(int edge, int end) {
    int axis = edge >> 2;
    return (edge & 1) << ((axis + 1) % 3) | (edge >> 1 & 1) << ((axis + 2) % 3) | end << axis;
}

static int isogi_vol__edge_between(int corner, int other) {
    int axis = (corner ^ other) >> 1;
    return 4 * axis + (corner >> ((axis + 1) % 3) & 1) + 2 * (corner >> ((axis + 2) % 3) & 1);
}

/* The two faces that an edge lies on, as bits. */
static unsigned isogi_vol__edge_faces(int edge) {
    int axis = edge >> 2;
    return 1u << (2 * ((axis + 1) % 3) + (edge & 1)) | 1u << (2 * ((axis + 2) % 3) + (edge >> 1 & 1));
}

/* The corners of a face, i = 0..3, counter-clockwise seen from outside of the cell; any i is taken modulo 4. */
static int isogi_vol__face_corner(int face, int i) {
    static const uint8_t corner[6][4] = {{4, 6, 2, 0}, {1, 3, 7, 5}, {1, 5, 4, 0}, {2, 6, 7, 3}, {2, 3, 1, 0}, {4, 5, 7, 6}};
    return corner[face][i & 3];
}

/* A power of two that brings numbers of the size `most` to where their products neither overflow nor vanish; 1 if they are there. */
static double isogi_vol__scale_for(double most) {
    int exponent;
    if ((most > 1e-60 && most < 1e60) || !(most > 0)) return 1;
    frexp(most, &exponent);
    return ldexp(1, exponent < -1000 ? 1000 : -exponent);
}

/* Asymptotic decider (Nielson and Hamann 1991): on a face whose corners alternate, are the two inside ones joined? The bilinear
   saddle has the sign of the difference of the diagonals' products; on the surface is inside. Both cells of the face form the
   same products of the same four values, so they agree whatever rounding does. */
static int isogi_vol__face_joins(const double f[8], unsigned code, int face) {
    int first = code >> isogi_vol__face_corner(face, 0) & 1 ? 0 : 1;
    double a = f[isogi_vol__face_corner(face, first)], c = f[isogi_vol__face_corner(face, first + 2)];
    double b = f[isogi_vol__face_corner(face, first + 1)], d = f[isogi_vol__face_corner(face, first + 3)];
    double s = isogi_vol__scale_for(isogi_vol__max(isogi_vol__max(fabs(a), fabs(b)), isogi_vol__max(fabs(c), fabs(d))));
    return a * s * (c * s) >= b * s * (d * s);
}

static int isogi_vol__face_alternates(unsigned code, int face) {
    int i, changes = 0;
    for (i = 0; i < 4; i++)
        changes += (int)((code >> isogi_vol__face_corner(face, i) ^ code >> isogi_vol__face_corner(face, i + 1)) & 1);
    return changes == 4;
}

static void isogi_vol__merge(int region[8], int a, int b) {
    int from = region[a], to = region[b], i;
    for (i = 0; from != to && i < 8; i++)
        if (region[i] == from) region[i] = to;
}

/* Where the surface crosses the six faces: from crossed edge e its line leads to edge next[e], inside being on its right as seen
   from outside of the cell. Each edge is left once and reached once, so the lines form loops. Corners of one region are connected on
   the surface of the cell. */
static void isogi_vol__trace_faces(const double f[8], unsigned code, int next[12], int region[8]) {
    int face, i, n;
    for (i = 0; i < 8; i++) region[i] = i;
    for (i = 0; i < 12; i++) next[i] = -1;
    for (face = 0; face < 6; face++) {
        int alternates = isogi_vol__face_alternates(code, face), joins = alternates && isogi_vol__face_joins(f, code, face);
        for (i = 0; i < 4; i++) {
            int a = isogi_vol__face_corner(face, i), b = isogi_vol__face_corner(face, i + 1), in_a = code >> a & 1, in_b = code >> b & 1;
            if (in_a == in_b) isogi_vol__merge(region, a, b);
            if (alternates && in_a == joins) isogi_vol__merge(region, a, isogi_vol__face_corner(face, i + 2));
            if (in_a || !in_b) continue;
            /* this edge leads in: on to the one that leads out, around the inside corners, or around the outside one if joined */
            for (n = i + 1; n < i + 3 && code >> isogi_vol__face_corner(face, n + 1) & 1; n++) {}
            if (joins) n = i + 3;
            next[isogi_vol__edge_between(a, b)] =
                isogi_vol__edge_between(isogi_vol__face_corner(face, n), isogi_vol__face_corner(face, n + 1));
        }
    }
}

typedef struct isogi_vol__loop {
    int count, inside, outside; /* the regions on its two sides */
    uint8_t edge[12];
} isogi_vol__loop;

/* At most four loops, since each has three edges or more. */
static int isogi_vol__trace_loops(const double f[8], unsigned code, isogi_vol__loop loop[4]) {
    int next[12], region[8], loops = 0, first;
    isogi_vol__trace_faces(f, code, next, region);
    for (first = 0; first < 12; first++) {
        isogi_vol__loop *l = &loop[loops & 3];
        int edge = first, end = code >> isogi_vol__edge_corner(first, 1) & 1;
        if (next[first] < 0) continue;
        l->count = 0;
        l->inside = region[isogi_vol__edge_corner(first, end)], l->outside = region[isogi_vol__edge_corner(first, !end)];
        while (next[edge] >= 0 && l->count < 12) {
            int to = next[edge];
            l->edge[l->count++] = (uint8_t)edge;
            next[edge] = -1;
            edge = to;
        }
        loops++;
    }
    return loops;
}

/* A point on the surface between p, which is inside or not, and q, which is on the other side. The caller knows it of p: where a passage
   has no width p lies on the surface, and rounding would say either. */
static void isogi_vol__surface_between(const double f[8], const double p[3], const double q[3], int inside, double out[3]) {
    double low = 0, high = 1, s = 0.5;
    int i, a;
    for (i = 0; i < 54; i++) {
        s = 0.5 * (low + high);
        for (a = 0; a < 3; a++) out[a] = isogi_vol__lerp(p[a], q[a], s);
        if ((isogi_vol__trilinear(f, out, NULL) >= 0) == inside) low = s;
        else high = s;
    }
}

/* A passage between two loops through the inside of the cell, or between none. In a slice of constant z the field is bilinear, and
   the product difference g(z) of the slice's diagonals decides as on a face. g is quadratic: columns a, d (or b, c) that neither
   end of their interval joins can be joined around its vertex only, and no second time. That is all that the inside of a cell can
   add to what its faces show. Half-open inside means the surface of f + e for a vanishing e > 0: every sign below is that of a
   polynomial in e, taken from its first coefficient that is not zero, and whole numbers up to 2^12 are decided exactly. */
typedef struct isogi_vol__passage {
    int inside;          /* of the passage: 1 or 0 */
    int joined[2], cut;  /* columns x + 2y: those it joins, and one of those it separates */
    double z[3];         /* where it begins, its middle, its end */
} isogi_vol__passage;

static int isogi_vol__sign(double first, double second, double third) {
    double x = first > 0 || first < 0 ? first : second > 0 || second < 0 ? second : third;
    return (x > 0) - (x < 0);
}

static int isogi_vol__find_passage(const double f[8], isogi_vol__passage *passage) {
    double d[4], a, b, c, slope, sum, root[2];
    int sign[4], down, i, p, q;
    for (i = 0; i < 4; i++) d[i] = f[i + 4] - f[i];
    a = d[0] * d[3] - d[1] * d[2];
    b = (f[0] * d[3] + f[3] * d[0]) - (f[1] * d[2] + f[2] * d[1]);
    c = f[0] * f[3] - f[1] * f[2];
    slope = (d[0] + d[3]) - (d[1] + d[2]), sum = (f[0] + f[3]) - (f[1] + f[2]);
    if (!(a > 0 || a < 0) || isogi_vol__sign(b * b - 4 * a * c, 2 * b * slope - 4 * a * sum, slope * slope) <= 0) return 0;
    down = a < 0 ? -1 : 1;
    if (isogi_vol__sign(-b, -slope, 0) * down <= 0 || isogi_vol__sign(2 * a + b, slope, 0) * down <= 0) return 0;
    for (i = 0; i < 4; i++) sign[i] = isogi_vol__sign(2 * a * f[i] - b * d[i], 2 * a - slope * d[i], 0) * down >= 0;
    p = a < 0 ? 0 : 1, q = 1 - p;
    if (sign[p] != sign[3 - p] || sign[q] != sign[3 - q] || sign[p] == sign[q]) return 0;
    passage->inside = sign[p];
    passage->joined[0] = p, passage->joined[1] = 3 - p, passage->cut = q;
    passage->z[1] = isogi_vol__clamp(-b / (2 * a), 1);
    if (isogi_vol__quadratic_roots(c, b, a, root) < 2) root[0] = root[1] = passage->z[1];
    passage->z[0] = isogi_vol__clamp(root[0], passage->z[1]);
    passage->z[2] = isogi_vol__max(isogi_vol__clamp(root[1], 1), passage->z[1]);
    return 1;
}

/* The two loops that a passage connects: each separates one of the regions it joins from the region it cuts. */
static int isogi_vol__passage_loops(const double f[8], unsigned code, const isogi_vol__passage *passage, const isogi_vol__loop *loop,
                                    int loops, int ends[2]) {
    int next[12], region[8], n, i, cut = passage->cut;
    isogi_vol__trace_faces(f, code, next, region);
    if ((int)(code >> cut & 1) == passage->inside) cut += 4;
    for (n = 0; n < 2; n++) {
        int end = passage->joined[n];
        if ((int)(code >> end & 1) != passage->inside) end += 4;
        ends[n] = -1;
        for (i = 0; i < loops; i++)
            if ((passage->inside ? loop[i].inside : loop[i].outside) == region[end] &&
                (passage->inside ? loop[i].outside : loop[i].inside) == region[cut])
                ends[n] = i;
    }
    return ends[0] >= 0 && ends[1] >= 0 && ends[0] != ends[1];
}

/* Triangles of one cell. Vertices 0..11 are on its edges, the others in its inside; all of them on the surface. */
typedef struct isogi_vol__patch {
    int triangles, extras;
    uint8_t triangle[24][3]; /* 12 edges and 4 inner vertices in a passage: at most 20 */
    double extra[8][3];
} isogi_vol__patch;

static void isogi_vol__patch_add(isogi_vol__patch *patch, int a, int b, int c) {
    uint8_t *t = patch->triangle[patch->triangles++];
    t[0] = (uint8_t)a, t[1] = (uint8_t)b, t[2] = (uint8_t)c;
}

/* Cuts a loop into triangles by chords that run through the inside of the cell: a chord in a face could be the neighbour's chord
   too, and then four triangles would meet there. 0 if there is no such way. */
static int isogi_vol__patch_chords(isogi_vol__patch *patch, const isogi_vol__loop *loop) {
    uint8_t split[12][12], stack[12][2]; /* split[i][j]: the third corner of the triangle on chord i-j, 0 if it cannot be */
    int n = loop->count, length, i, j, k, depth = 1;
    memset(split, 0, sizeof split);
    for (length = 2; length < n; length++)
        for (i = 0; i + length < n; i++) {
            j = i + length;
            if (length < n - 1 && isogi_vol__edge_faces(loop->edge[i]) & isogi_vol__edge_faces(loop->edge[j])) continue;
            for (k = i + 1; k < j && !split[i][j]; k++)
                if ((k == i + 1 || split[i][k]) && (j == k + 1 || split[k][j])) split[i][j] = (uint8_t)k;
        }
    if (!split[0][n - 1]) return 0;
    stack[0][0] = 0, stack[0][1] = (uint8_t)(n - 1);
    while (depth) {
        i = stack[--depth][0], j = stack[depth][1], k = split[i][j];
        isogi_vol__patch_add(patch, loop->edge[i], loop->edge[k], loop->edge[j]);
        if (k > i + 1) stack[depth][0] = (uint8_t)i, stack[depth++][1] = (uint8_t)k;
        if (j > k + 1) stack[depth][0] = (uint8_t)k, stack[depth++][1] = (uint8_t)j;
    }
    return 1;
}

static void isogi_vol__edge_point(const double f[8], int edge, double out[3]) {
    int corner = isogi_vol__edge_corner(edge, 0), a;
    double from = f[corner], to = f[isogi_vol__edge_corner(edge, 1)];
    for (a = 0; a < 3; a++) out[a] = corner >> a & 1;
    out[edge >> 2] = isogi_vol__clamp(from / (from - to), 1);
}

/* A fan around a point of the surface: from the middle of the loop along the gradient, or, where that does not meet the surface,
   towards the corner that lies deepest on the other side. */
static void isogi_vol__patch_fan(isogi_vol__patch *patch, const double f[8], const isogi_vol__loop *loop) {
    double middle[3] = {0, 0, 0}, gradient[3], to[3], point[3], reach = ISOGI_VOL__UNLIMITED, most = -1, sign;
    int i, a, centre = 12 + patch->extras, inside;
    for (i = 0; i < loop->count; i++) {
        isogi_vol__edge_point(f, loop->edge[i], point);
        for (a = 0; a < 3; a++) middle[a] += point[a] / loop->count;
        isogi_vol__patch_add(patch, loop->edge[i], loop->edge[(i + 1) % loop->count], centre);
    }
    inside = isogi_vol__trilinear(f, middle, gradient) >= 0, sign = inside ? -1 : 1;
    for (a = 0; a < 3; a++) {
        double g = sign * gradient[a], room = g > 0 ? 1 - middle[a] : middle[a];
        if (g > 0 || g < 0) reach = isogi_vol__min(reach, room / fabs(g));
    }
    for (a = 0; a < 3; a++) to[a] = isogi_vol__clamp(reach < 1e200 ? middle[a] + reach * sign * gradient[a] : middle[a], 1);
    if ((isogi_vol__trilinear(f, to, NULL) >= 0) == inside)
        for (i = 0; i < 8; i++)
            if ((f[i] >= 0) != inside && fabs(f[i]) > most)
                for (most = fabs(f[i]), a = 0; a < 3; a++) to[a] = i >> a & 1;
    isogi_vol__surface_between(f, middle, to, inside, patch->extra[patch->extras++]);
}

/* The saddle of the slice at z. */
static void isogi_vol__slice_saddle(const double f[8], double z, double out[3]) {
    double v[4], scale;
    int i;
    for (i = 0; i < 4; i++) v[i] = isogi_vol__lerp(f[i], f[i + 4], z);
    scale = (v[0] + v[3]) - (v[1] + v[2]);
    scale = scale > 0 || scale < 0 ? 1 / scale : 0;
    out[0] = isogi_vol__clamp((v[0] - v[2]) * scale, 1), out[1] = isogi_vol__clamp((v[0] - v[1]) * scale, 1), out[2] = z;
}

/* Twice the area that a closed polygon spans. */
static void isogi_vol__span(const double (*p)[3], int n, double area[3]) {
    int i, a;
    area[0] = area[1] = area[2] = 0;
    for (i = 0; i < n; i++) {
        const double *u = p[i], *v = p[(i + 1) % n];
        for (a = 0; a < 3; a++) area[a] += u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
    }
}

/* Triangles between a loop and the four inner vertices of a passage, which are taken in steps of `step` (1 or 3). */
static void isogi_vol__patch_band(isogi_vol__patch *patch, const double (*points)[3], const isogi_vol__loop *loop, int ring, int step) {
    int n = loop->count, start = 0, i = 0, j = 0, a, r;
    double nearest = 4;
    for (r = 0; r < 4; r++) {
        double distance = 0;
        for (a = 0; a < 3; a++) distance += fabs(points[0][a] - patch->extra[ring + r][a]);
        if (distance < nearest) nearest = distance, start = r;
    }
    ring += 12;
    while (i < n || j < 4) {
        int at = ring + (start + j * step) % 4;
        if (j * n < i * 4) {
            isogi_vol__patch_add(patch, loop->edge[i % n], ring + (start + (j + 1) * step) % 4, at);
            j++;
        } else {
            isogi_vol__patch_add(patch, loop->edge[i], loop->edge[(i + 1) % n], at);
            i++;
        }
    }
}

/* Two loops and a ring around the narrowest part of the passage between them: where its slices begin and end the saddle itself is
   on the surface, and in its middle slice so is a point on either side, on the way from the saddle to the separated corners. */
static void isogi_vol__patch_passage(isogi_vol__patch *patch, const double f[8], const isogi_vol__passage *passage,
                                     const isogi_vol__loop *one, const isogi_vol__loop *two) {
    int ring = patch->extras, n, i, step;
    double (*extra)[3] = patch->extra + ring, saddle[3], corner[3], points[2][12][3], area[3][3], turn = 0;
    isogi_vol__slice_saddle(f, passage->z[0], extra[0]);
    isogi_vol__slice_saddle(f, passage->z[2], extra[2]);
    isogi_vol__slice_saddle(f, passage->z[1], saddle);
    for (n = 0; n < 2; n++) {
        int column = n ? 3 - passage->cut : passage->cut;
        corner[0] = column & 1, corner[1] = column >> 1, corner[2] = passage->z[1];
        isogi_vol__surface_between(f, saddle, corner, passage->inside, extra[1 + 2 * n]);
    }
    patch->extras += 4;
    for (i = 0; i < one->count; i++) isogi_vol__edge_point(f, one->edge[i], points[0][i]);
    for (i = 0; i < two->count; i++) isogi_vol__edge_point(f, two->edge[i], points[1][i]);
    isogi_vol__span((const double(*)[3])points[0], one->count, area[0]);
    isogi_vol__span((const double(*)[3])points[1], two->count, area[1]);
    isogi_vol__span((const double(*)[3])extra, 4, area[2]);
    for (i = 0; i < 3; i++) turn += (area[0][i] - area[1][i]) * area[2][i];
    /* the ends of a tube turn against each other; which way the ring goes with the first is a matter of looks, not of topology */
    step = turn < 0 ? 3 : 1;
    isogi_vol__patch_band(patch, (const double(*)[3])points[0], one, ring, step);
    isogi_vol__patch_band(patch, (const double(*)[3])points[1], two, ring, 4 - step);
}

/* The surface of one cell: every loop bounds a disk, but for two that a passage connects. */
static void isogi_vol__patch_cell(isogi_vol__patch *patch, const double corner[8], unsigned code) {
    isogi_vol__loop loop[4];
    isogi_vol__passage passage;
    double f[8], most = 0, scale;
    int loops, ends[2] = {-1, -1}, i;
    for (i = 0; i < 8; i++) most = isogi_vol__max(most, fabs(corner[i]));
    scale = isogi_vol__scale_for(most);
    for (i = 0; i < 8; i++) f[i] = corner[i] * scale;
    patch->triangles = patch->extras = 0;
    loops = isogi_vol__trace_loops(corner, code, loop);
    if (loops < 2 || !isogi_vol__find_passage(f, &passage) || !isogi_vol__passage_loops(corner, code, &passage, loop, loops, ends))
        ends[0] = ends[1] = -1;
    else isogi_vol__patch_passage(patch, f, &passage, &loop[ends[0]], &loop[ends[1]]);
    for (i = 0; i < loops; i++)
        if (i != ends[0] && i != ends[1] && !isogi_vol__patch_chords(patch, &loop[i])) isogi_vol__patch_fan(patch, f, &loop[i]);
}

/* What a border closes with: the inside part of a face, a convex polygon or two triangles. Vertices 0..11 on edges, 12..19 corners. */
static void isogi_vol__patch_cap(isogi_vol__patch *patch, const double f[8], unsigned code, int face) {
    int polygon[8], n = 0, i;
    patch->triangles = patch->extras = 0;
    for (i = 0; i < 4; i++) {
        int a = isogi_vol__face_corner(face, i), b = isogi_vol__face_corner(face, i + 1);
        if (code >> a & 1) polygon[n++] = 12 + a;
        if ((code >> a ^ code >> b) & 1) polygon[n++] = isogi_vol__edge_between(a, b);
    }
    if (isogi_vol__face_alternates(code, face) && !isogi_vol__face_joins(f, code, face)) {
        int first = polygon[0] >= 12 ? 0 : 1;
        isogi_vol__patch_add(patch, polygon[(first + 5) % 6], polygon[first], polygon[first + 1]);
        isogi_vol__patch_add(patch, polygon[first + 2], polygon[first + 3], polygon[(first + 4) % 6]);
        return;
    }
    for (i = 2; i < n; i++) isogi_vol__patch_add(patch, polygon[0], polygon[i - 1], polygon[i]);
}

/* ==== meshes ========================================================================================================= */

/* Everything is done on bits, 64 cells at a time. Passes over the lattice's rows of voxels along x: which voxels are inside (read only
   where the pyramid says that the surface may be); which cells may hold surface; which edges carry vertices, and how many of each kind
   and how many triangles a row has; then, offsets known, every row writes its own part. Vertices are numbered row by row: x-edges,
   y-edges and z-edges that begin in the row, inside voxels of a closed border, inner vertices of the row's cells. So a cell finds the
   numbers of its vertices by counting along its four rows, and the order owes nothing to threads. */
enum {
    ISOGI_VOL__CORNERS = 3,  /* kinds 0..2 are the axes of edges */
    ISOGI_VOL__INNER = 4,
    ISOGI_VOL__KINDS = 5
};

/* Triangles of the 256 cells of unlike corner signs, if they follow from the signs alone. */
typedef struct isogi_vol__case {
    uint8_t triangles, undecided;
    uint8_t triangle[5][3];
} isogi_vol__case;

/* First what a row has of each kind, then where these begin. */
typedef struct isogi_vol__mesh_row {
    size_t triangle;
    uint32_t vertex[ISOGI_VOL__KINDS];
} isogi_vol__mesh_row;

typedef struct isogi_vol__mesher {
    const isogi_pyramid *pyramid;
    double isovalue;
    int closed, mirrored, nx, ny, nz;
    int compares_raw; /* raw.threshold tells what is inside */
    isogi_vol__raw_isovalue raw;
    size_t words, rows, rows_per_task, block_words; /* 64-bit words for a row of voxels, of blocks */
    isogi_vol__case *cases;
    isogi_vol__mesh_row *row;
    uint64_t *block, *none, *inside, *valid;
    uint64_t *carries[4]; /* vertices of the first four kinds; until they are known, [0] says which voxels are known and finite */
    void (*pass)(const struct isogi_vol__mesher *m, int j, int k);
    float (*positions)[3], (*normals)[3];
    uint32_t (*triangles)[3];
} isogi_vol__mesher;

static uint32_t isogi_vol__bits(uint64_t x) {
    x -= x >> 1 & 0x5555555555555555u;
    x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
    x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    return (uint32_t)(x * 0x0101010101010101u >> 56);
}

/* A row's words; rows that do not exist are empty. */
static uint64_t *isogi_vol__bit_row(const isogi_vol__mesher *m, uint64_t *bits, int j, int k) {
    if (j < 0 || k < 0 || j >= m->ny || k >= m->nz) return m->none;
    return bits + ((size_t)j + (size_t)m->ny * (size_t)k) * m->words;
}

/* Word w of a row moved so that bit i says what voxel i + 1 is. */
static uint64_t isogi_vol__ahead(const uint64_t *row, size_t w, size_t words) {
    return row[w] >> 1 | (w + 1 < words ? row[w + 1] << 63 : 0);
}

static int isogi_vol__border_row(const isogi_vol__mesher *m, int j, int k, int last) {
    return j == 0 || k == 0 || j == m->ny - last || k == m->nz - last;
}

/* ---- first pass: blocks that matter ---- */

static void isogi_vol__mesh_blocks(void *arg, size_t bz) {
    const isogi_vol__mesher *m = (const isogi_vol__mesher *)arg;
    const isogi_level *level = &m->pyramid->level[0];
    size_t bx, by;
    for (by = 0; by < level->size[1]; by++) {
        uint64_t *bits = m->block + (by + level->size[1] * bz) * m->block_words;
        const float(*range)[2] = level->range + level->size[0] * (by + level->size[1] * bz);
        int border = m->closed && (by == 0 || bz == 0 || by == level->size[1] - 1 || bz == level->size[2] - 1);
        memset(bits, 0, m->block_words * sizeof *bits);
        for (bx = 0; bx < level->size[0]; bx++) {
            int capped = border || (m->closed && (bx == 0 || bx == level->size[0] - 1));
            int matters = (double)range[bx][1] >= m->isovalue && (capped || (double)range[bx][0] < m->isovalue);
            bits[bx / 64] |= (uint64_t)matters << bx % 64;
        }
    }
}

/* ---- second pass: voxels ---- */

/* Voxels of one word: raw values against a raw threshold where that is the same thing, else converted and looked at one by one. */
static void isogi_vol__mesh_bits(const isogi_vol__mesher *m, int first, int count, int j, int k, uint64_t *inside, uint64_t *finite) {
    const isogi_volume *v = &m->pyramid->volume;
    const char *p = (const char *)v->data + first * v->stride[0] + j * v->stride[1] + k * v->stride[2];
    const ptrdiff_t step = v->stride[0];
    uint64_t in = 0, known = 0;
    double value[64];
    int i;
#define ISOGI_VOL__COMPARE(T, THRESHOLD, MEMBER)                                                                                 \
    {                                                                                                                            \
        const THRESHOLD threshold = m->raw.threshold.MEMBER;                                                                     \
        for (i = 0; i < count; i++, p += step) in |= (uint64_t)(*(const T *)(const void *)p >= threshold) << i;                  \
        break;                                                                                                                   \
    }
    *finite |= (~(uint64_t)0 >> (64 - count)) << first % 64;
    if (m->compares_raw) switch (v->type) {
        case ISOGI_U8: ISOGI_VOL__COMPARE(uint8_t, int, i)
        case ISOGI_I8: ISOGI_VOL__COMPARE(int8_t, int, i)
        case ISOGI_U16: ISOGI_VOL__COMPARE(uint16_t, int, i)
        case ISOGI_I16: ISOGI_VOL__COMPARE(int16_t, int, i)
        case ISOGI_F32: ISOGI_VOL__COMPARE(float, float, f)
        case ISOGI_F64: ISOGI_VOL__COMPARE(double, double, d)
        }
#undef ISOGI_VOL__COMPARE
    else {
        isogi_vol__row(v, first, j, k, count, value);
        for (i = 0; i < count; i++) {
            uint64_t good = (uint64_t)isogi_vol__finite64(value[i]);
            in |= ((uint64_t)(value[i] >= m->isovalue) & good) << i, known |= good << i;
        }
        *finite &= ~((~known & ~(uint64_t)0 >> (64 - count)) << first % 64);
    }
    *inside |= in << first % 64;
}

/* Runs of blocks that matter, in any of the up to four rows of blocks that share this row of voxels. */
static void isogi_vol__mesh_voxels(const isogi_vol__mesher *m, int j, int k) {
    const isogi_level *level = &m->pyramid->level[0];
    uint64_t *inside = isogi_vol__bit_row(m, m->inside, j, k), *finite = isogi_vol__bit_row(m, m->carries[0], j, k);
    size_t w, y, z, y1 = (size_t)j / 4, z1 = (size_t)k / 4;
    memset(inside, 0, m->words * sizeof *inside);
    memset(finite, 0, m->words * sizeof *finite);
    for (w = 0; w < m->block_words; w++) {
        uint64_t blocks = 0;
        for (z = k % 4 || !k ? z1 : z1 - 1; z <= z1 && z < level->size[2]; z++)
            for (y = j % 4 || !j ? y1 : y1 - 1; y <= y1 && y < level->size[1]; y++)
                blocks |= m->block[(y + level->size[1] * z) * m->block_words + w];
        while (blocks) {
            int first = isogi_vol__lowest_bit(blocks), run = ~(blocks >> first) ? isogi_vol__lowest_bit(~(blocks >> first)) : 64, x, count;
            blocks &= first + run < 64 ? ~(uint64_t)0 << (first + run) : 0;
            x = 4 * ((int)(64 * w) + first), count = 4 * run + 1 < m->nx - x ? 4 * run + 1 : m->nx - x;
            while (count > 0) {
                int n = 64 - x % 64 < count ? 64 - x % 64 : count;
                isogi_vol__mesh_bits(m, x, n, j, k, &inside[x / 64], &finite[x / 64]);
                x += n, count -= n;
            }
        }
    }
}

/* ---- third pass: cells all of whose corners are known and finite ---- */

static void isogi_vol__mesh_valid(const isogi_vol__mesher *m, int j, int k) {
    uint64_t *valid = isogi_vol__bit_row(m, m->valid, j, k), here = 0, next;
    const uint64_t *f[4];
    size_t w;
    int r, row = j < m->ny - 1 && k < m->nz - 1;
    for (r = 0; r < 4; r++) f[r] = row ? isogi_vol__bit_row(m, m->carries[0], j + (r & 1), k + (r >> 1)) : m->none;
    here = f[0][0] & f[1][0] & f[2][0] & f[3][0];
    for (w = 0; w < m->words; w++, here = next) {
        next = w + 1 < m->words ? f[0][w + 1] & f[1][w + 1] & f[2][w + 1] & f[3][w + 1] : 0;
        valid[w] = here & (here >> 1 | next << 63);
    }
}

/* ---- fourth and fifth pass: walking the cells of a row ---- */

/* The cells from 64 w on, in the row of cells that begins at row (j,k) of the lattice, and the counters of their vertices: x-edges of
   its four rows (y, z), y-edges of two (z), z-edges of two (y), corners of four. */
typedef struct isogi_vol__cell_walk {
    uint64_t corner[8], surface, cap, carries[12]; /* corner: x + 2y + 4z */
    const uint64_t *inside[4], *valid, *carry_row[12];
    uint32_t vertex[12], inner;
    int kinds, j, k, border;
} isogi_vol__cell_walk;

static void isogi_vol__walk_start(const isogi_vol__mesher *m, isogi_vol__cell_walk *walk, int j, int k) {
    int n;
    walk->j = j, walk->k = k, walk->border = m->closed && isogi_vol__border_row(m, j, k, 2);
    for (n = 0; n < 4; n++) walk->inside[n] = isogi_vol__bit_row(m, m->inside, j + (n & 1), k + (n >> 1));
    walk->valid = isogi_vol__bit_row(m, m->valid, j, k);
}

/* Sets the counters to where the vertices of the rows begin. */
static void isogi_vol__walk_number(const isogi_vol__mesher *m, isogi_vol__cell_walk *walk) {
    static const uint8_t kind[12] = {0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 3, 3}, row[12] = {0, 1, 2, 3, 0, 2, 0, 1, 0, 1, 2, 3};
    int n;
    walk->kinds = m->closed ? 12 : 8;
    for (n = 0; n < walk->kinds; n++) {
        int y = walk->j + (row[n] & 1), z = walk->k + (row[n] >> 1);
        walk->carry_row[n] = isogi_vol__bit_row(m, m->carries[kind[n]], y, z);
        walk->vertex[n] = m->row[(size_t)y + (size_t)m->ny * (size_t)z].vertex[kind[n]];
    }
    walk->inner = m->row[(size_t)walk->j + (size_t)m->ny * (size_t)walk->k].vertex[ISOGI_VOL__INNER];
}

/* Cells of word w that hold surface, and those with a face on a closed border that is not all outside. */
static void isogi_vol__walk_word(const isogi_vol__mesher *m, isogi_vol__cell_walk *walk, size_t w) {
    uint64_t *c = walk->corner, some, all;
    int n;
    for (n = 0; n < 4; n++) c[2 * n] = walk->inside[n][w], c[2 * n + 1] = isogi_vol__ahead(walk->inside[n], w, m->words);
    some = c[0] | c[1] | c[2] | c[3] | c[4] | c[5] | c[6] | c[7], all = c[0] & c[1] & c[2] & c[3] & c[4] & c[5] & c[6] & c[7];
    walk->surface = walk->valid[w] & some & ~all;
    walk->cap = 0;
    if (!m->closed) return;
    if (walk->border) walk->cap = ~(uint64_t)0;
    if (w == 0) walk->cap |= 1;
    if (w == (size_t)(m->nx - 2) / 64) walk->cap |= (uint64_t)1 << (m->nx - 2) % 64;
    walk->cap &= walk->valid[w] & some;
}

/* Bit `bit` of eight words, side by side. */
ISOGI_VOL__INLINE unsigned isogi_vol__walk_bits(const uint64_t words[8], int bit) {
#ifdef ISOGI_VOL__SSE2
    const __m128i *w = (const __m128i *)(const void *)words, up = _mm_cvtsi32_si128(63 - bit);
#define ISOGI_VOL__TWO(n) (unsigned)_mm_movemask_pd(_mm_castsi128_pd(_mm_sll_epi64(_mm_loadu_si128(w + (n)), up))) << 2 * (n)
    return ISOGI_VOL__TWO(0) | ISOGI_VOL__TWO(1) | ISOGI_VOL__TWO(2) | ISOGI_VOL__TWO(3);
#undef ISOGI_VOL__TWO
#else
    unsigned bits = 0;
    int n;
    for (n = 0; n < 8; n++) bits |= (unsigned)(words[n] >> bit & 1) << n;
    return bits;
#endif
}

/* Adds each of eight bits to a counter. */
ISOGI_VOL__INLINE void isogi_vol__walk_count(uint32_t counter[8], unsigned bits) {
    int n;
#ifdef ISOGI_VOL__SSE2
    const __m128i all = _mm_set1_epi32((int)bits);
    for (n = 0; n < 2; n++) {
        __m128i *four = (__m128i *)(void *)(counter + 4 * n), bit = n ? _mm_setr_epi32(16, 32, 64, 128) : _mm_setr_epi32(1, 2, 4, 8);
        _mm_storeu_si128(four, _mm_sub_epi32(_mm_loadu_si128(four), _mm_cmpeq_epi32(_mm_and_si128(all, bit), bit)));
    }
#else
    for (n = 0; n < 8; n++) counter[n] += bits >> n & 1;
#endif
}

/* The corner values of a cell; their signs are what the bits say, even where a compiler flushes small differences to zero. */
static void isogi_vol__walk_corners(const isogi_vol__mesher *m, const isogi_vol__cell_walk *walk, int i, unsigned code, double corner[8]) {
    int cell[3], n;
    cell[0] = i, cell[1] = walk->j, cell[2] = walk->k;
    isogi_vol__corners(m->pyramid, cell, m->isovalue, corner);
    for (n = 0; n < 8; n++) {
        if (code >> n & 1) corner[n] = isogi_vol__max(corner[n], 0);
        else if (!(corner[n] < 0)) corner[n] = -DBL_MIN;
    }
}

/* The border faces of a cell on which something is inside, as bits. */
ISOGI_VOL__COLD static unsigned isogi_vol__capped_faces(const isogi_vol__mesher *m, const isogi_vol__cell_walk *walk, int i,
                                                        unsigned code) {
    unsigned faces = (i == 0 ? 1u : 0u) | (i == m->nx - 2 ? 2u : 0u) | (walk->j == 0 ? 4u : 0u) | (walk->j == m->ny - 2 ? 8u : 0u) |
                     (walk->k == 0 ? 16u : 0u) | (walk->k == m->nz - 2 ? 32u : 0u);
    static const uint8_t corners[6] = {0x55, 0xaa, 0x33, 0xcc, 0x0f, 0xf0};
    int f;
    for (f = 0; f < 6; f++)
        if (!(code & corners[f])) faces &= ~(1u << f);
    return faces;
}

/* Triangles and inner vertices of the cells of a row. */
static void isogi_vol__count_cells(const isogi_vol__mesher *m, int j, int k, isogi_vol__mesh_row *row) {
    isogi_vol__cell_walk walk;
    isogi_vol__patch patch;
    double corner[8];
    size_t w;
    isogi_vol__walk_start(m, &walk, j, k);
    for (w = 0; w < m->words; w++) {
        uint64_t cells;
        isogi_vol__walk_word(m, &walk, w);
        for (cells = walk.surface | walk.cap; cells; cells &= cells - 1) {
            int bit = isogi_vol__lowest_bit(cells), i = (int)(64 * w) + bit, f;
            unsigned code = isogi_vol__walk_bits(walk.corner, bit), caps = 0;
            row->triangle += m->cases[code].triangles;
            if (walk.cap >> bit & 1) caps = isogi_vol__capped_faces(m, &walk, i, code);
            if (!m->cases[code].undecided && !caps) continue;
            isogi_vol__walk_corners(m, &walk, i, code, corner);
            if (m->cases[code].undecided) {
                isogi_vol__patch_cell(&patch, corner, code);
                row->triangle += (size_t)patch.triangles, row->vertex[ISOGI_VOL__INNER] += (uint32_t)patch.extras;
            }
            for (f = 0; f < 6; f++) {
                if (!(caps >> f & 1)) continue;
                isogi_vol__patch_cap(&patch, corner, code, f);
                row->triangle += (size_t)patch.triangles;
            }
        }
    }
}

/* Which edges and border voxels carry vertices: those of a crossing that some valid cell has. */
static void isogi_vol__mesh_count(const isogi_vol__mesher *m, int j, int k) {
    isogi_vol__mesh_row *row = &m->row[(size_t)j + (size_t)m->ny * (size_t)k];
    const uint64_t *in = isogi_vol__bit_row(m, m->inside, j, k), *in_y = isogi_vol__bit_row(m, m->inside, j + 1, k);
    const uint64_t *in_z = isogi_vol__bit_row(m, m->inside, j, k + 1), *v[4];
    uint64_t *carries[4], before[3] = {0, 0, 0};
    size_t w;
    int n, border = m->closed && isogi_vol__border_row(m, j, k, 1);
    memset(row, 0, sizeof *row);
    for (n = 0; n < 4; n++) {
        v[n] = isogi_vol__bit_row(m, m->valid, j - (n & 1), k - (n >> 1));
        carries[n] = isogi_vol__bit_row(m, m->carries[n], j, k);
    }
    for (w = 0; w < m->words; w++) {
        uint64_t y = v[0][w] | v[2][w], z = v[0][w] | v[1][w], x = y | z | v[3][w], touched = x | x << 1 | before[0];
        carries[0][w] = (in[w] ^ isogi_vol__ahead(in, w, m->words)) & x;
        carries[1][w] = (in[w] ^ in_y[w]) & (y | y << 1 | before[1]);
        carries[2][w] = (in[w] ^ in_z[w]) & (z | z << 1 | before[2]);
        before[0] = x >> 63, before[1] = y >> 63, before[2] = z >> 63;
        if (m->closed) {
            uint64_t ends = (w == 0 ? 1 : 0) | (w == (size_t)(m->nx - 1) / 64 ? (uint64_t)1 << (m->nx - 1) % 64 : 0);
            carries[3][w] = in[w] & touched & (border ? ~(uint64_t)0 : ends);
        }
        for (n = 0; n < (m->closed ? 4 : 3); n++)
            if (carries[n][w]) row->vertex[n] += isogi_vol__bits(carries[n][w]);
    }
    if (j < m->ny - 1 && k < m->nz - 1) isogi_vol__count_cells(m, j, k, row);
}

/* ---- last pass: vertices ---- */

/* On a lattice edge two of the B-spline's coordinates are whole, where its weights are (1 4 1)/6 and (-1 0 1)/2: 36 taps instead of
   64. p: the voxel where the edge begins, stride[0] its direction; every tap must exist. Gradient in the order of the strides. The
   sums of doubles are of differences to one of them, which would drown in the rounding of values far from zero. */
static void isogi_vol__edge_gradient(const isogi_volume *v, const char *p, const ptrdiff_t stride[3], double u, double gradient[3]) {
    const ptrdiff_t y = stride[1], z = stride[2];
    double w[4], d[4], gx = 0, gy = 0, gz = 0, c = 1 - u;
    int q;
    w[0] = c * c * c, w[1] = (3 * u - 6) * u * u + 4, w[2] = (3 * c - 6) * c * c + 4, w[3] = u * u * u;
    d[0] = -c * c, d[1] = (3 * u - 4) * u, d[2] = -(3 * c - 4) * c, d[3] = u * u;
    p -= stride[0] + y + z;
#define ISOGI_VOL__AT(T, offset) ((double)*(const T *)(const void *)(p + (offset)) - base)
#define ISOGI_VOL__TAPS(T, BASE)                                                                                                 \
    const double base = BASE;                                                                                                    \
    for (q = 0; q < 4; q++, p += stride[0]) {                                                                                    \
        const double a0 = ISOGI_VOL__AT(T, 0), a1 = ISOGI_VOL__AT(T, y), a2 = ISOGI_VOL__AT(T, 2 * y);                           \
        const double b0 = ISOGI_VOL__AT(T, z), b1 = ISOGI_VOL__AT(T, y + z), b2 = ISOGI_VOL__AT(T, 2 * y + z);                   \
        const double c0 = ISOGI_VOL__AT(T, 2 * z), c1 = ISOGI_VOL__AT(T, y + 2 * z), c2 = ISOGI_VOL__AT(T, 2 * y + 2 * z);       \
        const double as = (a0 + a2) + 4 * a1, bs = (b0 + b2) + 4 * b1, cs = (c0 + c2) + 4 * c1;                                  \
        gx += d[q] * ((as + cs) + 4 * bs);                                                                                       \
        gy += w[q] * (((a2 - a0) + (c2 - c0)) + 4 * (b2 - b0));                                                                  \
        gz += w[q] * (cs - as);                                                                                                  \
    }                                                                                                                            \
    break;
    switch (v->type) {
    case ISOGI_U8: { ISOGI_VOL__TAPS(uint8_t, 0) }
    case ISOGI_I8: { ISOGI_VOL__TAPS(int8_t, 0) }
    case ISOGI_U16: { ISOGI_VOL__TAPS(uint16_t, 0) }
    case ISOGI_I16: { ISOGI_VOL__TAPS(int16_t, 0) }
    case ISOGI_F32: { ISOGI_VOL__TAPS(float, 0) }
    case ISOGI_F64: { ISOGI_VOL__TAPS(double, *(const double *)(const void *)(p + y + z)) }
    }
#undef ISOGI_VOL__TAPS
#undef ISOGI_VOL__AT
    gradient[0] = v->scale * gx / 72, gradient[1] = v->scale * gy / 72, gradient[2] = v->scale * gz / 72;
}

#ifdef ISOGI_VOL__AVX
/* Lane q of vector k becomes lane k of vector q. */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE void isogi_vol__transpose4(const __m256d in[4], __m256d out[4]) {
    const __m256d a = _mm256_unpacklo_pd(in[0], in[1]), b = _mm256_unpackhi_pd(in[0], in[1]);
    const __m256d c = _mm256_unpacklo_pd(in[2], in[3]), d = _mm256_unpackhi_pd(in[2], in[3]);
    out[0] = _mm256_permute2f128_pd(a, c, 0x20), out[1] = _mm256_permute2f128_pd(b, d, 0x20);
    out[2] = _mm256_permute2f128_pd(a, c, 0x31), out[3] = _mm256_permute2f128_pd(b, d, 0x31);
}

/* (first + last) + 4 middle */
ISOGI_VOL__TARGET("avx2") ISOGI_VOL__INLINE __m256d isogi_vol__one_four_one(__m256d first, __m256d middle, __m256d last) {
    return _mm256_add_pd(_mm256_add_pd(first, last), _mm256_mul_pd(_mm256_set1_pd(4), middle));
}

/* The same for floats next to each other, bit by bit: the steps q of the sums side by side, added up in their order. */
ISOGI_VOL__TARGET("avx2")
static void isogi_vol__edge_gradient_avx2(const isogi_volume *v, const char *p, int axis, const ptrdiff_t stride[3], double u,
                                          double gradient[3]) {
    const __m128i three = _mm_setr_epi32(-1, -1, -1, 0); /* a fourth float need not exist */
    const ptrdiff_t step = stride[0], y = stride[1], z = stride[2];
    const double c = 1 - u;
    const __m256d w = _mm256_setr_pd(c * c * c, (3 * u - 6) * u * u + 4, (3 * c - 6) * c * c + 4, u * u * u);
    const __m256d d = _mm256_setr_pd(-c * c, (3 * u - 4) * u, -(3 * c - 4) * c, u * u);
    __m256d sum[4], rise[4], slope[4], r[3][4], lane[3][4]; /* as bs cs; a2 - a0 and so on; what is added to gx gy gz */
    double out[4];
    int q, k;
    p -= step + y + z;
#define ISOGI_VOL__ROW4(offset) _mm256_cvtps_pd(_mm_loadu_ps((const float *)(const void *)(p + (offset))))
#define ISOGI_VOL__ROW3(offset) _mm256_cvtps_pd(_mm_maskload_ps((const float *)(const void *)(p + (offset)), three))
    if (axis == 0) {
#pragma GCC unroll 3
        for (k = 0; k < 3; k++) {
            const __m256d v0 = ISOGI_VOL__ROW4(k * z), v1 = ISOGI_VOL__ROW4(k * z + y), v2 = ISOGI_VOL__ROW4(k * z + 2 * y);
            sum[k] = isogi_vol__one_four_one(v0, v1, v2), rise[k] = _mm256_sub_pd(v2, v0);
        }
    } else if (axis == 1) {
#pragma GCC unroll 4
        for (q = 0; q < 4; q++, p += step) {
            const __m256d v0 = ISOGI_VOL__ROW3(0), v1 = ISOGI_VOL__ROW3(y), v2 = ISOGI_VOL__ROW3(2 * y);
            r[0][q] = isogi_vol__one_four_one(v0, v1, v2), r[1][q] = _mm256_sub_pd(v2, v0);
        }
        isogi_vol__transpose4(r[0], sum), isogi_vol__transpose4(r[1], rise);
    } else {
#pragma GCC unroll 4
        for (q = 0; q < 4; q++, p += step) r[0][q] = ISOGI_VOL__ROW3(0), r[1][q] = ISOGI_VOL__ROW3(z), r[2][q] = ISOGI_VOL__ROW3(2 * z);
#pragma GCC unroll 3
        for (k = 0; k < 3; k++) {
            isogi_vol__transpose4(r[k], lane[k]);
            sum[k] = isogi_vol__one_four_one(lane[k][0], lane[k][1], lane[k][2]), rise[k] = _mm256_sub_pd(lane[k][2], lane[k][0]);
        }
    }
#undef ISOGI_VOL__ROW4
#undef ISOGI_VOL__ROW3
    slope[0] = _mm256_mul_pd(d, isogi_vol__one_four_one(sum[0], sum[1], sum[2]));
    slope[1] = _mm256_mul_pd(w, isogi_vol__one_four_one(rise[0], rise[1], rise[2]));
    slope[2] = _mm256_mul_pd(w, _mm256_sub_pd(sum[2], sum[0])), slope[3] = _mm256_setzero_pd();
    isogi_vol__transpose4(slope, sum);
    sum[0] = _mm256_add_pd(_mm256_add_pd(_mm256_add_pd(_mm256_add_pd(slope[3], sum[0]), sum[1]), sum[2]), sum[3]);
    _mm256_storeu_pd(out, _mm256_div_pd(_mm256_mul_pd(_mm256_set1_pd(v->scale), sum[0]), _mm256_set1_pd(72)));
    for (k = 0; k < 3; k++) gradient[k] = out[k];
}
#endif

/* A normal from a vector per grid unit; zero where there is none. */
static void isogi_vol__mesh_normal(const isogi_vol__mesher *m, size_t at, double n[3]) {
    double length;
    int a, usable;
    isogi_vol__gradient_to_world(m->pyramid, n, n);
    length = isogi_vol__length(n), usable = length > 0;
    length = usable ? 1 / length : 0;
    for (a = 0; a < 3; a++) m->normals[at][a] = usable ? (float)(n[a] * length) : 0;
}

static void isogi_vol__smoothed_normal(const isogi_vol__mesher *m, size_t at, const double grid[3]) {
    double n[3], local[3];
    int cell[3], a;
    for (a = 0; a < 3; a++) cell[a] = isogi_vol__cell(grid[a], m->pyramid->volume.size[a], &local[a]);
    isogi_vol__smooth_gradient(m->pyramid, cell, local, n);
    for (a = 0; a < 3; a++) n[a] = -n[a];
    isogi_vol__mesh_normal(m, at, n);
}

/* A vertex in the inside of a cell. */
static void isogi_vol__inner_vertex(const isogi_vol__mesher *m, size_t at, const double grid[3]) {
    double world[3];
    int a;
    isogi_vol_to_world(m->pyramid, grid, world);
    for (a = 0; a < 3; a++) m->positions[at][a] = (float)world[a];
    if (m->normals) isogi_vol__smoothed_normal(m, at, grid);
}

/* The normal of a vertex on the edge of direction `axis` from (i,j,k), at u of it; p: that voxel. */
static void isogi_vol__edge_normal(const isogi_vol__mesher *m, size_t at, int axis, const int voxel[3], double u, const char *p) {
    const isogi_volume *v = &m->pyramid->volume;
    ptrdiff_t stride[3];
    double n[3], gradient[3];
    int a, whole = 1;
    for (a = 0; a < 3; a++) {
        whole = whole && (voxel[a] >= 1 || v->halo_low[a]) &&
                voxel[a] + (a == axis ? 2 : 1) <= m->pyramid->cells[a] + (v->halo_high[a] ? 1 : 0);
        stride[a] = v->stride[(axis + a) % 3];
    }
    if (whole) {
#ifdef ISOGI_VOL__AVX
        if (m->pyramid->path >= ISOGI_VOL__PATH_AVX2 && v->type == ISOGI_F32 && v->stride[0] == 4)
            isogi_vol__edge_gradient_avx2(v, p, axis, stride, u, gradient);
        else
#endif
            isogi_vol__edge_gradient(v, p, stride, u, gradient);
        for (a = 0; a < 3; a++) n[(axis + a) % 3] = -gradient[a];
    }
    if (whole && isogi_vol__finite3(n)) isogi_vol__mesh_normal(m, at, n);
    else {
        for (a = 0; a < 3; a++) gradient[a] = voxel[a] + (a == axis ? u : 0);
        isogi_vol__smoothed_normal(m, at, gradient);
    }
}

/* Outward from the faces of the box that a voxel lies on. */
ISOGI_VOL__COLD static void isogi_vol__corner_normal(const isogi_vol__mesher *m, size_t at, const int voxel[3]) {
    double n[3];
    int a;
    for (a = 0; a < 3; a++) n[a] = (voxel[a] == m->pyramid->cells[a]) - (voxel[a] == 0);
    isogi_vol__mesh_normal(m, at, n);
}

static void isogi_vol__emit_vertices(const isogi_vol__mesher *m, int j, int k) {
    const isogi_volume *v = &m->pyramid->volume;
    const double *t = m->pyramid->to_world;
    const char *row = (const char *)v->data + j * v->stride[1] + k * v->stride[2];
    const uintptr_t ahead = (uintptr_t)(2 * v->stride[1] + (m->normals ? 2 : 1) * v->stride[2]);
    double begin[3], grid[3];
    int kind, a;
    grid[0] = -(double)v->first[0], grid[1] = j, grid[2] = k; /* the row's beginning in the larger field */
    isogi_vol_to_world(m->pyramid, grid, begin);
    for (kind = 0; kind < (m->closed ? 4 : 3); kind++) {
        const uint64_t *carries = isogi_vol__bit_row(m, m->carries[kind], j, k);
        size_t at = m->row[(size_t)j + (size_t)m->ny * (size_t)k].vertex[kind], w;
        const int axis = kind < 3 ? kind : 0;
        for (w = 0; w < m->words; w++) {
            uint64_t bits;
            for (bits = carries[w]; bits; bits &= bits - 1, at++) {
                const int i = (int)(64 * w) + isogi_vol__lowest_bit(bits);
                const char *p = row + i * v->stride[0];
                int voxel[3];
                double u = 0;
                ISOGI_VOL__PREFETCH((uintptr_t)p + ahead); /* the surface goes on nearby */
                if (kind < 3) {
                    double from = isogi_vol__voxel(v, p), to = isogi_vol__voxel(v, p + v->stride[axis]);
                    u = isogi_vol__clamp((m->isovalue - from) / (to - from), 1);
                }
                for (a = 0; a < 3; a++)
                    m->positions[at][a] = (float)(begin[a] + (((double)v->first[0] + i) * t[3 * a] + u * t[3 * a + axis]));
                if (!m->normals) continue;
                voxel[0] = i, voxel[1] = j, voxel[2] = k;
                if (kind < 3) isogi_vol__edge_normal(m, at, kind, voxel, u, p);
                else isogi_vol__corner_normal(m, at, voxel);
            }
        }
    }
}

/* ---- last pass: triangles ---- */

ISOGI_VOL__INLINE void isogi_vol__emit_triangle(const isogi_vol__mesher *m, size_t *at, const uint32_t *id, const uint8_t t[3]) {
    uint32_t *out = m->triangles[(*at)++];
    out[0] = id[t[0]], out[1] = id[t[1 + m->mirrored]], out[2] = id[t[2 - m->mirrored]];
}

/* A cell whose signs do not tell all, and caps. id has room for 12 edges and 8 more: inner vertices or corners. */
static void isogi_vol__emit_undecided(const isogi_vol__mesher *m, isogi_vol__cell_walk *walk, int i, unsigned code, unsigned caps,
                                      size_t *at, uint32_t id[20]) {
    isogi_vol__patch patch;
    double corner[8], grid[3];
    int n, a, f, bit = i % 64;
    isogi_vol__walk_corners(m, walk, i, code, corner);
    if (m->cases[code].undecided) {
        isogi_vol__patch_cell(&patch, corner, code);
        for (n = 0; n < patch.extras; n++) {
            for (a = 0; a < 3; a++) grid[a] = (a == 0 ? i : a == 1 ? walk->j : walk->k) + patch.extra[n][a];
            isogi_vol__inner_vertex(m, walk->inner, grid);
            id[12 + n] = walk->inner++;
        }
        for (n = 0; n < patch.triangles; n++) isogi_vol__emit_triangle(m, at, id, patch.triangle[n]);
    }
    if (!caps) return;
    for (n = 0; n < 4; n++)
        id[12 + 2 * n] = walk->vertex[8 + n], id[13 + 2 * n] = walk->vertex[8 + n] + (uint32_t)(walk->carries[8 + n] >> bit & 1);
    for (f = 0; f < 6; f++) {
        if (!(caps >> f & 1)) continue;
        isogi_vol__patch_cap(&patch, corner, code, f);
        for (n = 0; n < patch.triangles; n++) isogi_vol__emit_triangle(m, at, id, patch.triangle[n]);
    }
}

static void isogi_vol__emit_cell(const isogi_vol__mesher *m, isogi_vol__cell_walk *walk, int i, unsigned carries, size_t *at) {
    const uint32_t *v = walk->vertex;
    uint32_t id[20];
    int n, bit = i % 64;
    unsigned code = isogi_vol__walk_bits(walk->corner, bit), caps = 0;
    const isogi_vol__case *one = &m->cases[code];
    for (n = 0; n < 4; n++) id[n] = v[n];
    id[4] = v[4], id[5] = v[5], id[6] = v[4] + (carries >> 4 & 1), id[7] = v[5] + (carries >> 5 & 1);
    id[8] = v[6], id[9] = v[6] + (carries >> 6 & 1), id[10] = v[7], id[11] = v[7] + (carries >> 7);
    for (n = 0; n < one->triangles; n++) isogi_vol__emit_triangle(m, at, id, one->triangle[n]);
    if (walk->cap >> bit & 1) caps = isogi_vol__capped_faces(m, walk, i, code);
    if (one->undecided || caps) isogi_vol__emit_undecided(m, walk, i, code, caps, at, id);
}

/* Walks from event to event: a cell with triangles, or a vertex of the row that the counters have to pass. */
static void isogi_vol__mesh_emit(const isogi_vol__mesher *m, int j, int k) {
    isogi_vol__cell_walk walk;
    size_t at = m->row[(size_t)j + (size_t)m->ny * (size_t)k].triangle, w;
    isogi_vol__emit_vertices(m, j, k);
    if (j >= m->ny - 1 || k >= m->nz - 1 || m->row[(size_t)j + (size_t)m->ny * (size_t)k + 1].triangle == at) return;
    isogi_vol__walk_start(m, &walk, j, k);
    isogi_vol__walk_number(m, &walk);
    for (w = 0; w < m->words; w++) {
        uint64_t events;
        int n;
        isogi_vol__walk_word(m, &walk, w);
        events = walk.surface | walk.cap;
        for (n = 0; n < walk.kinds; n++) events |= walk.carries[n] = walk.carry_row[n][w];
        for (; events; events &= events - 1) {
            int bit = isogi_vol__lowest_bit(events);
            const unsigned carries = isogi_vol__walk_bits(walk.carries, bit);
            if ((walk.surface | walk.cap) >> bit & 1) isogi_vol__emit_cell(m, &walk, (int)(64 * w) + bit, carries, &at);
            isogi_vol__walk_count(walk.vertex, carries);
            for (n = 8; n < walk.kinds; n++) walk.vertex[n] += (uint32_t)(walk.carries[n] >> bit & 1);
        }
    }
}

/* ---- memory and order of passes ---- */

static void isogi_vol__mesh_task(void *arg, size_t task) {
    const isogi_vol__mesher *m = (const isogi_vol__mesher *)arg;
    size_t row = task * m->rows_per_task, end = row + m->rows_per_task < m->rows ? row + m->rows_per_task : m->rows;
    for (; row < end; row++) m->pass(m, (int)(row % (size_t)m->ny), (int)(row / (size_t)m->ny));
}

static isogi_result isogi_vol__mesh_pass(isogi_vol__mesher *m, const isogi_context *context, double from, double to,
                                         void (*pass)(const isogi_vol__mesher *m, int j, int k)) {
    m->pass = pass;
    return isogi_parallel(context, (m->rows + m->rows_per_task - 1) / m->rows_per_task, isogi_vol__mesh_task, m, from, to);
}

ISOGI_VOL__COLD static void isogi_vol__mesh_cases(isogi_vol__case cases[256]) {
    isogi_vol__patch patch;
    double corner[8];
    int code, i, alternates;
    memset(cases, 0, 256 * sizeof *cases);
    for (code = 1; code < 255; code++) {
        isogi_vol__loop loop[4];
        for (i = 0; i < 8; i++) corner[i] = code >> i & 1 ? 1 : -1;
        for (i = 0, alternates = 0; i < 6; i++) alternates |= isogi_vol__face_alternates((unsigned)code, i);
        if (!alternates && isogi_vol__trace_loops(corner, (unsigned)code, loop) == 1)
            isogi_vol__patch_cell(&patch, corner, (unsigned)code);
        else patch.extras = 1;
        if (patch.extras || patch.triangles > 5) {
            cases[code].undecided = 1;
            continue;
        }
        cases[code].triangles = (uint8_t)patch.triangles;
        memcpy(cases[code].triangle, patch.triangle, (size_t)patch.triangles * sizeof *patch.triangle);
    }
}

/* One block of scratch memory: the cases, which stay from call to call, then rows, then bits. */
ISOGI_VOL__COLD static isogi_result isogi_vol__mesh_scratch(isogi_vol__mesher *m, isogi_mesh *mesh) {
    const isogi_pyramid *p = m->pyramid;
    const isogi_level *level = &p->level[0];
    size_t planes = m->closed ? 6 : 5, per_row, blocks, size, n;
    uint64_t *bits;
    m->words = ((size_t)m->nx + 63) / 64, m->block_words = (level->size[0] + 63) / 64;
    per_row = sizeof *m->row + planes * m->words * 8;
    if ((size_t)m->ny > SIZE_MAX / 4 / per_row / (size_t)m->nz) return ISOGI_TOO_LARGE;
    m->rows = (size_t)m->ny * (size_t)m->nz, blocks = m->block_words * level->size[1] * level->size[2];
    m->rows_per_task = m->rows / 4096 + 1;
    size = 256 * sizeof *m->cases + (m->rows + 1) * sizeof *m->row + (planes * m->rows * m->words + m->words + blocks) * 8;
    if (mesh->scratch_size < size) {
        void *scratch = isogi_allocate(&p->context, 1, size);
        if (!scratch) return ISOGI_NO_MEMORY;
        isogi_release(&p->context, mesh->scratch, 1, mesh->scratch_size);
        mesh->scratch = scratch, mesh->scratch_size = size;
        isogi_vol__mesh_cases((isogi_vol__case *)scratch);
    }
    m->cases = (isogi_vol__case *)mesh->scratch;
    m->row = (isogi_vol__mesh_row *)(void *)(m->cases + 256);
    bits = (uint64_t *)(void *)(m->row + m->rows + 1);
    m->none = bits, bits += m->words;
    memset(m->none, 0, m->words * 8);
    m->block = bits, bits += blocks;
    m->inside = bits, bits += m->rows * m->words;
    m->valid = bits, bits += m->rows * m->words;
    for (n = 0; n < 4; n++) m->carries[n] = bits + (n < planes - 2 ? n : 0) * m->rows * m->words; /* the fourth only if closed */
    return ISOGI_OK;
}

/* Counts become places; the totals stand behind the last row. */
ISOGI_VOL__COLD static isogi_result isogi_vol__mesh_offsets(isogi_vol__mesh_row *row, size_t rows) {
    uint64_t vertices = 0, triangles = 0;
    size_t r;
    int n;
    for (r = 0; r < rows; r++) {
        uint64_t here = row[r].triangle;
        for (n = 0; n < ISOGI_VOL__KINDS; n++) {
            uint32_t count = row[r].vertex[n];
            row[r].vertex[n] = (uint32_t)vertices;
            vertices += count;
            if (vertices > UINT32_MAX) return ISOGI_TOO_LARGE;
        }
        row[r].triangle = (size_t)triangles;
        triangles += here;
        if (triangles > SIZE_MAX / 64) return ISOGI_TOO_LARGE;
    }
    memset(&row[rows], 0, sizeof *row);
    row[rows].vertex[0] = (uint32_t)vertices, row[rows].triangle = (size_t)triangles;
    return vertices > SIZE_MAX / 64 ? ISOGI_TOO_LARGE : ISOGI_OK;
}

/* A larger buffer, with room to grow on; what is there when it is large enough. NULL when there is no memory. */
ISOGI_VOL__COLD static void *isogi_vol__mesh_room(const isogi_context *context, void *old, size_t capacity, size_t need, size_t *room) {
    *room = capacity >= need ? capacity : need + need / 2;
    return capacity >= need ? old : isogi_allocate(context, *room, 12);
}

/* All or nothing: the old buffers go when all of the new ones are there. */
ISOGI_VOL__COLD static isogi_result isogi_vol__mesh_reserve(const isogi_context *context, isogi_mesh *mesh, size_t vertices,
                                                            size_t triangles, int normals) {
    size_t room[3], need[3];
    void *old[3], *got[3];
    int n, complete = 1;
    need[0] = vertices, need[1] = normals ? vertices : 0, need[2] = triangles;
    old[0] = mesh->positions, old[1] = mesh->normals, old[2] = mesh->triangles;
    got[0] = isogi_vol__mesh_room(context, old[0], mesh->vertex_capacity, need[0], &room[0]);
    got[1] = isogi_vol__mesh_room(context, old[1], mesh->normal_capacity, need[1], &room[1]);
    got[2] = isogi_vol__mesh_room(context, old[2], mesh->triangle_capacity, need[2], &room[2]);
    for (n = 0; n < 3; n++) complete = complete && (got[n] || !need[n]);
    if (!complete) {
        for (n = 0; n < 3; n++)
            if (got[n] != old[n]) isogi_release(context, got[n], room[n], 12);
        return ISOGI_NO_MEMORY;
    }
    if (got[0] != old[0]) isogi_release(context, old[0], mesh->vertex_capacity, 12);
    if (got[1] != old[1]) isogi_release(context, old[1], mesh->normal_capacity, 12);
    if (got[2] != old[2]) isogi_release(context, old[2], mesh->triangle_capacity, 12);
    if (!normals) {
        isogi_release(context, got[1], room[1], 12);
        got[1] = NULL, room[1] = 0;
    }
    mesh->positions = (float(*)[3])got[0], mesh->normals = (float(*)[3])got[1], mesh->triangles = (uint32_t(*)[3])got[2];
    mesh->vertex_capacity = room[0], mesh->normal_capacity = room[1], mesh->triangle_capacity = room[2];
    mesh->vertex_count = vertices, mesh->triangle_count = triangles;
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_vol_mesh(const isogi_pyramid *pyramid, const isogi_mesh_desc *desc, isogi_mesh *mesh) {
    isogi_vol__mesher m;
    isogi_context context;
    isogi_result result;
    int a, empty;
    if (!pyramid || pyramid->field.value || !desc || !mesh || !isogi_vol__finite64(desc->isovalue)) return ISOGI_INVALID;
    context = pyramid->context;
    empty = !(pyramid->range[1] >= desc->isovalue) || (!desc->closed && pyramid->range[0] >= desc->isovalue);
    for (a = 0; a < 3; a++) empty = empty || pyramid->cells[a] < 1;
    if (empty) return isogi_vol__mesh_reserve(&context, mesh, 0, 0, desc->normals != 0);
    memset(&m, 0, sizeof m);
    m.pyramid = pyramid, m.isovalue = desc->isovalue, m.closed = desc->closed != 0;
    m.mirrored = isogi_vol__determinant(pyramid->volume.axes) < 0;
    m.nx = pyramid->cells[0] + 1, m.ny = pyramid->cells[1] + 1, m.nz = pyramid->cells[2] + 1;
    m.compares_raw = pyramid->all_finite && pyramid->volume.scale > 0 && isogi_vol__threshold(&m.raw, &pyramid->volume, desc->isovalue);
    result = isogi_vol__mesh_scratch(&m, mesh);
    if (result == ISOGI_OK) result = isogi_parallel(&context, pyramid->level[0].size[2], isogi_vol__mesh_blocks, &m, 0, 0.05);
    if (result == ISOGI_OK) result = isogi_vol__mesh_pass(&m, &context, 0.05, 0.3, isogi_vol__mesh_voxels);
    if (result == ISOGI_OK) result = isogi_vol__mesh_pass(&m, &context, 0.3, 0.35, isogi_vol__mesh_valid);
    if (result == ISOGI_OK) result = isogi_vol__mesh_pass(&m, &context, 0.35, 0.5, isogi_vol__mesh_count);
    if (result == ISOGI_OK) result = isogi_vol__mesh_offsets(m.row, m.rows);
    if (result == ISOGI_OK)
        result = isogi_vol__mesh_reserve(&context, mesh, m.row[m.rows].vertex[0], m.row[m.rows].triangle, desc->normals != 0);
    if (result != ISOGI_OK) return result;
    m.positions = mesh->positions, m.normals = mesh->normals, m.triangles = mesh->triangles;
    /* From here on the mesh is written: there is no way back, hence nobody to ask for one. */
    context.progress = NULL;
    result = isogi_vol__mesh_pass(&m, &context, 0.5, 1, isogi_vol__mesh_emit);
    isogi_vol__report(&pyramid->context, 0, 1, 1, 1);
    return result;
}

ISOGI_API void isogi_vol_mesh_free(const isogi_pyramid *pyramid, isogi_mesh *mesh) {
    const isogi_context *context = pyramid ? &pyramid->context : NULL;
    if (!mesh) return;
    isogi_release(context, mesh->positions, mesh->vertex_capacity, 12);
    isogi_release(context, mesh->normals, mesh->normal_capacity, 12);
    isogi_release(context, mesh->triangles, mesh->triangle_capacity, 12);
    isogi_release(context, mesh->scratch, 1, mesh->scratch_size);
    memset(mesh, 0, sizeof *mesh);
}

#undef ISOGI_VOL__ADD
#undef ISOGI_VOL__ALL64
#undef ISOGI_VOL__BROKEN
#undef ISOGI_VOL__CODES
#undef ISOGI_VOL__DOUBT
#undef ISOGI_VOL__ABOVE
#undef ISOGI_VOL__MUL
#undef ISOGI_VOL__NEAR
#undef ISOGI_VOL__POOL
#undef ISOGI_VOL__CLEARED
#undef ISOGI_VOL__ROUND
#undef ISOGI_VOL__ROW_OF
#undef ISOGI_VOL__SLOPE
#undef ISOGI_VOL__SUB
#undef ISOGI_VOL__GROUP
#undef ISOGI_VOL__BLOCK
#undef ISOGI_VOL__PIVOTS
#undef ISOGI_VOL__WIDEN
#undef ISOGI_VOL__WIDEN_ROWS
#undef ISOGI_VOL__ROW_base
#undef ISOGI_VOL__ROW_avx2
#undef ISOGI_VOL__ROW_avx512
#undef ISOGI_VOL__ROWS
#undef ISOGI_VOL__ALONG_Y
#undef ISOGI_VOL__FLOATS
#undef ISOGI_VOL__HALVES
#undef ISOGI_VOL__LANE_avx2
#undef ISOGI_VOL__LANE_avx512
#undef ISOGI_VOL__LANE_base
#undef ISOGI_VOL__MADD_avx2
#undef ISOGI_VOL__MADD_avx512
#undef ISOGI_VOL__SPREAD_avx512
#undef ISOGI_VOL__SUMS_avx2
#undef ISOGI_VOL__SUMS_avx512
#undef ISOGI_VOL__SUMS_base
#undef ISOGI_VOL__TILE_avx512
#undef ISOGI_VOL__TRILINEAR_BLOCK
#undef ISOGI_VOL__WEIGHTS
#undef ISOGI_VOL__WHOLES
#undef ISOGI_VOL__BLEND
#undef ISOGI_VOL__TRILINEAR
#undef ISOGI_VOL__CUBIC
#undef ISOGI_VOL__MADD_base
#undef ISOGI_VOL__TILE_base
#undef ISOGI_VOL__SPREAD_base
#undef ISOGI_VOL__INTEGERS_base
#undef ISOGI_VOL__BYTES
#undef ISOGI_VOL__SHORTS
#undef ISOGI_VOL__F32_base
#undef ISOGI_VOL__F32_avx2
#undef ISOGI_VOL__U8_base
#undef ISOGI_VOL__I8_base
#undef ISOGI_VOL__U16_base
#undef ISOGI_VOL__I16_base
#undef ISOGI_VOL__AVX2
#undef ISOGI_VOL__TILE_avx2
#undef ISOGI_VOL__SPREAD_avx2
#undef ISOGI_VOL__INTEGERS_avx2
#undef ISOGI_VOL__EIGHT
#undef ISOGI_VOL__U8_avx2
#undef ISOGI_VOL__I8_avx2
#undef ISOGI_VOL__U16_avx2
#undef ISOGI_VOL__I16_avx2
#undef ISOGI_VOL__NEON
#undef ISOGI_VOL__LEVELS
#undef ISOGI_VOL__NODE_LEVELS
#undef ISOGI_VOL__STRIP
#undef ISOGI_VOL__SUM
#undef ISOGI_VOL__DIFFERENCE
#undef ISOGI_VOL__STRIP_VOXELS
#undef ISOGI_VOL__HUGE_PAGE
#undef ISOGI_VOL__FAST_SIZE
#undef ISOGI_VOL__FEW
#undef ISOGI_VOL__FOUR
#undef ISOGI_VOL__EVEN
#undef ISOGI_VOL__ODD
#undef isogi_vol__neon_add_ps
#undef isogi_vol__neon_sub_ps
#undef isogi_vol__neon_mul_ps
#undef isogi_vol__neon_min_ps
#undef isogi_vol__neon_max_ps
#undef isogi_vol__neon_set1_ps
#undef isogi_vol__neon_setzero_ps
#undef isogi_vol__neon_loadu_ps
#undef isogi_vol__neon_storeu_ps
#undef ISOGI_VOL__TARGET
#undef ISOGI_VOL__AVX512
#undef ISOGI_VOL__AVX
#undef ISOGI_VOL__BELOW_0
#undef ISOGI_VOL__BELOW_1
#undef ISOGI_VOL__BELOW_2
#undef ISOGI_VOL__FIRST
#undef ISOGI_VOL__LATER
#undef ISOGI_VOL__INLINE
#undef ISOGI_VOL__COLD
#undef ISOGI_VOL__NOINLINE
#undef ISOGI_VOL__UNLIKELY
#undef ISOGI_VOL__PREFETCH
#undef ISOGI_VOL__PRAGMA
#undef ISOGI_VOL__UNROLL
#undef ISOGI_VOL__CONVOY
#undef ISOGI_VOL__UNSURE
#undef ISOGI_VOL__SSE2
#undef ISOGI_VOL__UNLIMITED
#undef ISOGI_VOL__ON_SURFACE
#undef ISOGI_VOL__ROUNDING
#undef ISOGI_VOL__LOCK
#undef ISOGI_VOL__UNLOCK
#undef ISOGI_VOL__MAX_THREADS
#undef ISOGI_VOL__WORKER
#undef ISOGI_VOL__LOCK_SET
#undef ISOGI_VOL__LOCK_END
#undef ISOGI_VOL__SIGNAL_SET
#undef ISOGI_VOL__SIGNAL_END
#undef ISOGI_VOL__WAIT
#undef ISOGI_VOL__WAKE_ONE
#undef ISOGI_VOL__WAKE_ALL
#undef ISOGI_VOL__PEEK
#undef ISOGI_VOL__POKE
#undef ISOGI_VOL__PAUSE
#undef ISOGI_VOL__SPINS
#undef ISOGI_VOL__PACKET
#undef ISOGI_VOL__REACH
#undef ISOGI_VOL__AHEAD
#undef ISOGI_VOL__BYTES_KEPT
#undef ISOGI_VOL__BYTES_avx2
#undef ISOGI_VOL__BYTES_avx512
#undef ISOGI_VOL__FOUR_ROWS
#undef ISOGI_VOL__RING
#undef ISOGI_VOL__ROW_BYTES_avx2
#undef ISOGI_VOL__ROW_BYTES_avx512
#undef ISOGI_VOL__ROW_SHORTS_avx2
#undef ISOGI_VOL__ROW_SHORTS_avx512
#undef ISOGI_VOL__FLIPPED_avx2
#undef ISOGI_VOL__FLIPPED_avx512
#undef ISOGI_VOL__SHORTS_KEPT
#undef ISOGI_VOL__SHORTS_avx2
#undef ISOGI_VOL__SHORTS_avx512
#endif /* ISOGI_VOL_IMPLEMENTATION */
