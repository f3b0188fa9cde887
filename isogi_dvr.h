/* isogi_dvr.h - volume rendering in physical space and in data space, lit by SH visibility, for C and C++
                                                                       (part of isogi; with isogi_sh.h, isogi_vol.h)

   Quick start

       #define ISOGI_IMPLEMENTATION
       #include "isogi_dvr.h"
       #include <stdio.h>
       int main(void) {
           static const isogi_transfer_point points[] = {{0, {1, 1, 1}, 0}, {31, {1, 0.5f, 0.2f}, 0.2f}}; // value, colour, extinction
           static float data[32][32][32], image[32][32][4];
           static isogi_volume volume; static isogi_transfer transfer; static isogi_view view; static isogi_dvr_desc desc; // static: zeros
           isogi_pyramid *pyramid; isogi_dvr *dvr;
           for (int i = 0; i < 32768; i++) data[i / 1024][i / 32 % 32][i % 32] = (float)(i % 32); // f = x
           volume.data = data, volume.type = ISOGI_F32, volume.size[0] = volume.size[1] = volume.size[2] = 32;
           transfer.points = points, transfer.point_count = 2, view.width = view.height = 32;
           view.eye[0] = view.eye[1] = view.target[0] = view.target[1] = 15.5f, view.eye[2] = 100;
           if (isogi_vol_build(&pyramid, &volume, NULL)) return 1; else desc.pyramid = pyramid;
           if (isogi_dvr_create(&dvr, &desc, NULL) || isogi_dvr_set_transfer(dvr, &transfer)) return 1; // then isogi_dvr_free, _vol_free
           if (!isogi_dvr_render(dvr, &view, NULL, image[0], NULL, NULL)) printf("opacity of the centre: %g\n", (double)image[16][16][3]); }

   What it does

   Casts a ray through every pixel, samples the trilinear field along it, maps each value to a colour and an extinction by a
   transfer function (the mapping comes after the interpolation: post-classification), and composites front to back.

   Physical space. The absorption-emission model (Kronander 2011, eq. 1): extinction tau is per length, a piece of ray of length
   d has opacity 1 - exp(-tau d / unit). Scaling a volume together with its camera keeps the picture only because `unit` is by
   default a voxel and scales along; a homogeneous slab is the darker the thicker it is.

   Error bounds (isogi_dvr_desc.bound). Physical space has exact rays too, slower than samples: they walk the cells, are cut where the cubic
   that the field is along them turns and where the transfer function bends, and cut further until no colour of the function changes by
   more than the bound within a part. On a part extinction is a cubic, whose integral two points of Gauss's rule give without error:
   opacity and depth are right to the rounding of a float. The colour that arrives from a part is a mean of colours that occur in it, with
   weights that the field's course decides; any other such mean differs by less than the bound. Parts are seen with weights that
   sum up to the opacity: what an unlit pixel's colour errs by is at most the bound times its opacity. (`opaque` below 1 ends rays
   early and adds 1 - opaque. Light is looked up once for a piece within a cell: visibility as far off dense matter as the mean extinction
   in the piece says; two-sided light takes the opacity of its first part.) Errors measured on random fields and functions with bounds 1,
   .1, .01, .001: .046, .010, .0007, .00015 (test_dvr_bound --long); samples know no bound, as a cell may hold what they miss. A frame of
   the gyroid takes 11, 11 and 18 times that of samples with bounds 1, .1 and .01, and its sRGB values err by .00002 (RMSE) where theirs do
   by .003 (make bench ONLY=dvr): the time of what is cut by colour goes as 1 / bound, and every point of the function between the values
   at a cell's two ends is one more part.

   Data space. The scale-invariant integral (Kraus 2005, eq. 4): extinction is per unit of the data, a piece of ray over which
   the value changes by ds has opacity 1 - exp(-tau |ds|). Lengths cancel: no scaling of space changes any pixel. Constant data
   contributes nothing whatever its extinction; a ray that runs once from value a to b has opacity 1 - exp(-integral of tau from a
   to b), whatever its way. Three ways of evaluation, by isogi_dvr_desc.classification:

       exact           The default. In a cell the field along a ray is a cubic with at most two extrema: the ray walks the cells, is cut
                       there, and each monotone piece is integrated in closed form over the linear pieces of the transfer
                       function, colours and all, in double. There is no step size: `step` means nothing. Against long-double
                       quadrature pixels are right to the rounding of a float, from extinctions of 1e-9 to opaque, in depth too.
                       Unlit and without peaks or silhouettes, pieces of neighbouring cells are joined as long as the value goes one
                       way, and eight rays go side by side where the machine has AVX-512: two fifths of the time.
       pre-integrated  Samples a step apart; every pair is looked up in a table (eq. 5 to 7).
       post-classified Samples a step apart, each weighted by the slope grad s . dir of the trilinear field (eq. 10, 11).

   RMSE of pixels of a smooth field and transfer function against the exact ones (test_dvr_data prints it):

       step in voxels      2        1       1/2      1/4      1/8
       pre-integrated   0.0050   0.0023   0.0009   0.0006   0.0002
       post-classified  0.016    0.005    0.002    0.001    0.0005

   Light is looked up once for each piece, at its middle: shaded pictures are exact in opacity, and as fine as cells in shading.

   Peaks. Infinitely thin isosurfaces of uniform opacity, in both spaces: every crossing of the isovalue, rising or falling, is
   found and composites exactly its opacity, whatever the gradient (Kraus 2005, 4.2). In data space the walk itself divides its
   pieces at every peak between their ends, any number of them: the same crossings that the exact intersector of isogi_vol.h finds,
   which serves physical space and post-classification. Crossings stand in exact order between the samples: a sample's piece of
   ray is divided where a peak lies in it. (Pre-integrated rays see the crossings that their samples show.) A peak is not closed
   by the volume's border. A second field may colour peaks.

   Silhouettes. A surface seen aslant is longer to pass: a = 1 - (1 - a0)^f, f = |v| |n| / |v . n| (Kraus 2005, eq. 15), or its
   approximation for small opacities (eq. 16), for peaks and, with f = |grad s| / |grad s . dir| (eq. 17), for every sample in data
   space. There the exact form makes of int tau |ds| the integral of tau |grad s| along the way: what Levoy's plain gradient is
   to post-classification (eq. 18). In exact rays f is one number for a monotone piece: an RMSE of opacity of 0.001 through noise, in which
   the gradient turns within cells (test_dvr_data).

   Shading. ISOGI_DVR_UNLIT shows the transfer function's colour. ISOGI_DVR_LOCAL is diffuse shading by the smoothed gradient,
   with the normal turned towards the eye: radiance = rgb / pi * irradiance (environment convolved with the cosine at SH order 5,
   directional lights, lamps), no shadows; where the gradient vanishes, light is scattered as below but unshadowed. Lamps are points
   here, and in two-sided light: a sphere is its centre, which is never nearer than its radius, so that within it light comes
   from the centre as at its surface; a rectangle is its centre, by the cosine to its normal and to the side it shines to alone; a
   directional light has no angular radius.
   ISOGI_DVR_TWO_SIDED adds light that comes through, and highlights (Kraus 2005, eq. 19), for n of either orientation:

       ambient Cd a + sum_i I_i ( a Cd |l.n| + a Cs max(0, r.v)^e                     where l and v are on one side of the surface
                                  a (1-a) Cd |l.n| + a (1-a) Cd max(0, -l.v)^e )      where they are not

   with I_i = irradiance / pi, ambient = mean radiance of the environment, opacity a of the peak or piece of ray (so that the light that
   comes through a medium depends on how finely rays are cut), and materials for the two sides and for transmission. H(0) = 0: light along
   the surface does nothing; where there is no normal only ambient light is. Matter whose value does not change along the ray has no side:
   its ambient term is the mean of both.
   ISOGI_DVR_VISIBILITY scatters light isotropically and shadows it (Kronander 2011):

       g_s = rgb / (4 pi) * max(least, sum_i L_i V_i)     per channel

   where L are the SH coefficients of the light that arrives (environment, directional lights as deltas or discs; lamps are added at every
   sample as isogi_sh_project has them there: points and spheres with their inverse square, within a sphere evenly from everywhere,
   rectangles exactly; matter behind a lamp shadows it as matter before it does) and V those of the transmittance from the sample to the
   border of the box in all directions, interpolated between the eight nearest points of a regular grid. Where nothing casts shadows, V(w) =
   1, and a sky of radiance 1 from everywhere gives g_s = rgb / (4 pi) * 4 pi = rgb: colour is the albedo, and under a uniform sky of 1 a
   medium without shadows looks as it does unlit. A directional light of irradiance E gives g_s = rgb E V / (4 pi). The truncated series can
   be negative, most of all where matter hides the brightest of a sky, and black there is the worst error of a picture: light is at least a
   quarter (order 5: an eighth, 6: nothing) of what the mean radiance of the environment gives through V (with anisotropy times (1 - |g|) /
   (1 + |g|)^2, the least that scattering does). Shadows of directional lights and lamps may be black; a sun in an image has no shadow that
   is: where all that is bright of a sky is hidden, light is that much too high. RMSE of sRGB values at 400 places on surfaces, orders 2, 3,
   4, against light from 2048 directions, clamped at zero and so, of skies turned so that most of their light is hidden: engine under
   Uffizi's .080 .037 .075 and .043 .031 .038; bonsai under Grace's .136 .072 .064 and .117 .071 .060 (make bench ONLY=visibility).
   Within four steps of a lamp's centre pre-integrated pictures take samples seven times as densely. A frame of 512x512 of bonsai lit by a
   point takes 2.5 (4 coefficients) to 3.4 (16) times that by a directional light.
   Matter that is dense for the grid is lit as what is in front of it: in physical space V is looked up off = r x^2 / (x^2 + 16) nearer to
   the eye, where r is 1.5 grid distances, as they are along the ray, and x the optical depth of r in the matter of the sample. Of the
   grid's points the more open then count more: the trilinear weight of each times 1 + w (o - 1), o = min(1, 5 m)^2, where m >= 0.005 is the
   mean of its V over all directions, w = max(0, 2 off / r - 1), and 1 for peaks and in data space. So the light on what is opaque is that
   of the points in front of it, without the darkness of those below. Those behind a peak, by the field's value there, count as far as it
   lets light through (1 - opacity), and V is looked up r / 12 before it: what is opaque shows the light on the side that is seen, also
   where the other is as open. RMSE of sRGB values of 200x200 pixels against grids of 128^3 points (for ml256 and torus-sphere-plane of
   twice as many an axis), with weights of w = 0, as told, w = 1: bonsai .0112 .0113 .0159, engine .0319 .0319 .0323, ml256 .0120 .0120
   .0153, torus-sphere-plane .0145 .0127 .0127.

   Visibility is sampled in `directions` directions and projected to SH, by one of the methods of isogi_dvr_method. Brute force
   marches every ray from every grid point through the same transfer function (in the same space; peaks attenuate at every
   crossing). In data space its rays walk the cells as those of pictures do: against steps of a voxel 1.8 times the time, a relative error
   of 3e-5 in place of 1e-2 for a steep transfer function. Where nothing absorbs no ray is cast at all. Sweeps, the default in physical
   space without peaks, follow a bundle of parallel rays for each direction through a lattice of extinction and read it at all grid
   points on the way, as a bundle's rays are straight and nothing is interpolated twice. The paper's method (Kronander 2011) has local
   visibility on blocks of several levels, which pictures may use on its own (isogi_view.local), and global visibility pieced together
   from it. Sweeps are the default for their errors and times: with as many rays on the same grid they take 1/12, 1/28 and 1/18 of its time
   for fuel, engine and bonsai, with relative errors of 0.018, 0.076, 0.045 where it has 0.039, 0.086, 0.056 (make bench ONLY=dvr; the
   error that it has sweeps reach in 1/17 to 1/28). Frames of bonsai by either differ from light without spherical harmonics by RMSE .024
   and .025, of which .022 is truncation to 4 coefficients (make bench ONLY=visibility). A node of the lattice holds the mean extinction of
   its box, so that fine matter is a little darker: light on bonsai is 1.3 % less than by brute force, on engine 3 %, where
   `visibility_step` is 1 both .5 %; among leaves of two or three voxels behind a steep function mean light is 1 % more with 2, 14 % less
   with 1, 4 % less with 1/2 (test_dvr_visibility). The directions are a spherical Fibonacci lattice, and its weights are
   corrected so that products of spherical harmonics are integrated exactly as far as the number of rays allows (2 (degree + 1)^2 <=
   directions): with 64 rays, order 3 without shadows has V = sqrt(4 pi), 0, 0 ... to rounding. The largest
   error of a coefficient against the closed form of a half space, order 4, worst of 1000 orientations (sqrt(4 pi) is 3.5):

       rays        16     32     64    128    256    512   1024   2048
       error     0.77   0.57   0.28   0.15  0.092  0.057  0.033  0.022

   Several resolutions (isogi_dvr_desc.coarsest, sweeps). Visibility is looked up in matter and just before it. Blocks of 8^3 distances
   of the grid in which there is none of it, or which are buried in what is opaque, hold every 8th point along each axis, others those
   that their optical depth asks for, without a seam in visibility where blocks meet, nor in pictures that are pre-integrated. (In all
   others light is weighed sample by sample with how open grid points are, which may leave one beside what is buried: in V(0), of 3.54,
   up to 0.09 in a cave, above 0.02 at one in 200 places on borders of blocks; none for a ball above a floor.) Pictures are those of the
   regular grid of as many points, from less memory; coefficients that are sampled far from matter are coarse, which is why the regular
   grid is the default.
   Megabytes of visibility and RMSE of a frame against a regular grid of 129, 193, 193 points an axis (make bench ONLY=visibility):

       points an axis               33             65             97             129            193
       torus-    regular        1.3  .0209     9.9  .0143     33   .0124     77   0
       sphere    coarsest 8     1.6  .0209     7.1  .0143     18   .0128     25   .0025
       ml256     regular        1.3  .0563     9.9  .0193     33   .0091     77   .0051    259  0
                 coarsest 8     0.9  .0563     6.8  .0193     15   .0091     41   .0051    109  .0000
       bonsai    regular        0.6  .0404     4.4  .0185     15   .0094     34   .0049    115  0
                 coarsest 8     0.7  .0404     4.4  .0185     11   .0094     21   .0049     57  .0001

   Tetrahedral meshes. isogi_dvr_tets_render draws points, values and tetrahedra, unlit, in both spaces: in a tetrahedron the field
   is linear, so that both integrals are exact. Rays go from face to face, leave and enter again where the mesh has gaps; tetrahedra
   without volume are left out and counted. Parts that only touch look as one where their values agree.

   Transfer functions to begin with: presets, tables of other programs (gamma and premultiplication stated), and one suggested from
   the histogram. Everything inside is linear light and not premultiplied; pixels are linear and premultiplied.

   What it does not do

   - No light on tetrahedral meshes, no scattering beyond the first, no refraction, no glossy surfaces.
   - Pictures of physical space without a bound are pre-integrated (ISOGI_DVR_EXACT is the same there), unless they have peaks among
     the values that occur, shading by gradients (ISOGI_DVR_LOCAL, ISOGI_DVR_TWO_SIDED) or isogi_view.local, anisotropy, jitter, an axis
     of one voxel, or floats that tell too few values apart (see Limits): those are post-classified, and features narrower than the value's
     change from sample to sample need a smaller step.
     Pre-classification (colours interpolated instead of values) is left out on purpose: in data space it would depend on the view, and it
     blurs every surface to the width of a voxel.
   - The border of the volume is no surface: outside of the box is empty space.
   - It reads no files, opens no window, converts nothing to sRGB. Pixels are linear and premultiplied: put a background under
     them with  out = pixel + (1 - opacity) * background. For a display, what examples/common/picture.h does: multiply by an exposure,
     bend what is above 0.7 of the colour (pixel / opacity) by  x -> 0.7 + 0.3 (1 - exp((0.7 - x) / 0.3)), before the background is put
     under it, and code as sRGB:  12.92 x  up to 0.0031308, above it  1.055 x^(1/2.4) - 0.055.

   Options (macros, to be defined before the header is included)

   ISOGI_IMPLEMENTATION       in one file: the code of all isogi headers that this file includes
   ISOGI_DVR_IMPLEMENTATION   in one file: the code of this header alone
   ISOGI_API                  how functions are declared, in all isogi headers; default extern (extern "C" in C++)
   ISOGI_NO_THREADS           isogi_vol.h: no threads
   ISOGI_NO_SIMD              plain C only; else vectors (gcc 9 or later, clang), on x86-64 AVX2 or AVX-512 where the machine has them

   Memory, threads, determinism

   The pyramid (and the voxels below it) is borrowed and must outlive the renderer; description, context and transfer function are
   copied (not what they point to: the second field and its points are borrowed). Visibility takes grid points * order^2 floats (in several
   resolutions a third to 1.4 times as many, as blocks hold their borders each, and a third such set while sweeps finish), with light 4
   more during a picture, 8 where matter is dense for the grid; sweeps as many again (in several resolutions only until they are done),
   three floats for each node of their lattice, and during a step, for each of up to 16 directions, a float for each grid point and about 6
   m (m + 24) of scratch for m nodes on the longest axis; the paper's method 32 bytes for each node of local visibility, and before that 12
   MB, with a radius above 16 voxels 47 MB, between sheared axes up to 200. Empty blocks take four bytes for each block of the pyramid; a
   picture in work 20 bytes a pixel, and 64 kB to 1 MB of classes of values in physical space; the transfer function of exact rays, and of
   those with a bound, 160 to 220 bytes a point, of pre-integrated ones 16 table^2 and 8 a point more. All of it comes from the context's
   allocator; where that fails the call says so and changes nothing.
   Stack use stays below 32 KB (unoptimised below 70 by gcc, 140 by clang; no AVX-512 of its own is used then).
   isogi_dvr_set_transfer, _set_clip and _step are writers: one at a time, and not during another call with the same renderer. All
   other calls only read and may run at the same time. Calls divide their own work among the context's threads. Results are the
   same bits for any number of threads and however visibility was cut into steps. All promises of equal bits are for IEEE arithmetic:
   with -ffast-math pictures differ by roundings, and values must lie within 8e307.

   Samples stand at the middle of pieces of equal length, counted from where the ray enters what is shown of the box (or from the eye
   inside it; a clip plane that is moved moves them all); the last piece is what is left up to where the ray leaves the box, is cut by a
   clip plane or ends at geometry (isogi_view.until). Blocks of the pyramid in which the transfer function has no extinction are stepped
   over, largest first; the samples elsewhere stay where they are, so pictures are the same bits as without stepping over. In data space a
   block of one value, or one whose values meet neither extinction nor peak, is empty too. A block in which all values have one extinction
   and one colour is passed in one piece by brute-force visibility rays and by post-classified unlit ones (if all voxels are finite).

   Limits

   Values that are not finite: a cell with such a corner is transparent. An axis of one voxel makes a box without volume, which is
   transparent (rays within its plane do sample it; peaks there only with desc.bound, and in data space unless post-classified). For sweeps
   and the paper's method such a voxel alone does not exist: those around it keep their shadows. Up to ISOGI_DVR_MAX_PEAKS peaks (in data
   space, exact or pre-integrated, any number), 2^16 directions, 2^24 samples on the longest ray, and eyes up to 1e17 voxels away.
   Pre-integrated pictures of physical space tell up to 16384 classes of values apart, of those that occur and on which the transfer
   function depends: a piece of it that is narrower than four of them keeps its opacity, blurred over a class; regions of exactly a step's
   value, such as labels, have what begins there, and so have values less than a class below it, if no point is that close. They do where
   the span of these values is 1e-26 to 1e30 and, of floats and doubles, at least a 4096th of their distance from zero, and where no voxel
   is beyond floats; else pictures are post-classified, in double, which takes longer: subtract what values have in common, or let `scale`
   and `bias` make them of others. With spans beyond that, or voxels beyond floats, visibility is by brute force, too. Errors: ISOGI_INVALID
   for anything outside of its documented range (isogi_dvr_fault, isogi_view_fault, isogi_transfer_fault say which), ISOGI_TOO_LARGE where
   sizes overflow or pass these limits, ISOGI_NO_MEMORY, ISOGI_CANCELLED.

   How to choose. `step` 0.5 is right for smooth transfer functions, 0.25 for steep ones; each halving costs twice the time and
   leaves a quarter of the error. `order` 2 is ambient light with a direction, 3 soft shadows, 4 and more for a directional light.
   `grid`: shadows cannot be finer than its distances; time is proportional to its points; where these are less than four steps, opaque
   surfaces show the steps as rings: a smaller step then. `directions`: at least 2 order^2.

   History  1.0  first release
*/
#ifndef ISOGI_DVR_H
#define ISOGI_DVR_H

#include "isogi_sh.h"
#include "isogi_vol.h"

/* ---- transfer functions -------------------------------------------------------------------------------------------------- */

/* Piecewise linear between points of ascending value, constant beyond the ends; two points of one value make a step, whose upper
   side holds at the value itself. No points at all: nothing absorbs. */
typedef struct isogi_transfer_point {
    double value;     /* data value; finite */
    float rgb[3];     /* linear colour (albedo for scattered light), not premultiplied, 0..1; larger values, up to 1e30, glow */
    float extinction; /* >= 0: per isogi_dvr_desc.unit of length in physical space, per unit of data value in data space */
} isogi_transfer_point;

/* An isosurface of uniform opacity and colour: every crossing composites exactly `opacity`, whatever the gradient (Kraus 2005, 4.2). */
typedef struct isogi_peak {
    double isovalue;       /* finite */
    float rgb[3], opacity; /* 0..1; rgb 0..1e30 */
} isogi_peak;

#define ISOGI_DVR_MAX_PEAKS 256 /* but any number in data space, exact or pre-integrated */

typedef struct isogi_transfer {
    const isogi_transfer_point *points;
    size_t point_count;
    const isogi_peak *peaks;
    size_t peak_count;
} isogi_transfer;

/* Order, finiteness, ranges as stated above. */
ISOGI_API isogi_result isogi_transfer_validate(const isogi_transfer *transfer);
/* What is wrong with it: the member at fault and why, for whoever writes the program; NULL where it is valid. */
ISOGI_API const char *isogi_transfer_fault(const isogi_transfer *transfer);

/* rgb and extinction at a data value, for a transfer function that is valid (peaks are not part of it). All zero for a NaN. */
ISOGI_API void isogi_transfer_at(const isogi_transfer *transfer, double value, float rgb[3], float *extinction);

/* ---- a renderer ------------------------------------------------------------------------------------------------------------- */

typedef enum isogi_dvr_space {
    ISOGI_DVR_PHYSICAL = 0, /* emission and absorption per unit length (Kronander 2011, eq. 1) */
    ISOGI_DVR_DATA          /* scale-invariant: per unit of data along monotone pieces of the ray (Kraus 2005, eq. 4) */
} isogi_dvr_space;

/* How the integral along a ray is evaluated in data space. In physical space the first two mean the same: pre-integrated by four
   running integrals, where no peak or light stands in the way (see "What it does not do" above). */
typedef enum isogi_dvr_classification {
    ISOGI_DVR_EXACT = 0,      /* cell by cell, cut at the extrema of the cubic that the field is along a ray: no step size */
    ISOGI_DVR_PRE_INTEGRATED, /* samples a step apart, each pair looked up in a table (Kraus 2005, eq. 5 to 7) */
    ISOGI_DVR_POST_CLASSIFIED /* samples a step apart, each by its value and the slope of the field (Kraus 2005, eq. 10, 11) */
} isogi_dvr_classification;

typedef enum isogi_dvr_shading {
    ISOGI_DVR_UNLIT = 0,  /* the transfer function's colour is emitted as it is */
    ISOGI_DVR_VISIBILITY, /* light scattered isotropically, L . V from SH visibility (Kronander 2011) */
    ISOGI_DVR_LOCAL,      /* diffuse shading by the gradient, on the side that faces the eye, no shadows */
    ISOGI_DVR_TWO_SIDED   /* reflected and transmitted, diffuse and specular light (Kraus 2005, eq. 19), no shadows */
} isogi_dvr_shading;

/* How global visibility is computed; what each costs and how far it errs is told above. Only brute force knows data space and
   peaks: where those are asked for it is taken, whatever is said here. */
typedef enum isogi_dvr_method {
    ISOGI_DVR_METHOD_DEFAULT = 0, /* sweeps */
    ISOGI_DVR_BRUTE,              /* every ray from every grid point marched to the border */
    ISOGI_DVR_PAPER,              /* Kronander 2011: local visibility on blocks of several levels, then global from local */
    ISOGI_DVR_SWEEP               /* slice by slice for all grid points at once, a direction at a time */
} isogi_dvr_method;

/* Directions of visibility rays. The solids' are the centres of the faces of a solid whose faces are divided into k^2, projected onto
   the sphere and weighed by their area there: 4 k^2, 8 k^2 or 20 k^2 of them, the nearest such number to `directions`. */
typedef enum isogi_dvr_sphere {
    ISOGI_DVR_FIBONACCI = 0, /* any number; weights as told above */
    ISOGI_DVR_TETRAHEDRON,
    ISOGI_DVR_OCTAHEDRON,
    ISOGI_DVR_ICOSAHEDRON
} isogi_dvr_sphere;

/* How much more opaque a surface is that is seen aslant: f = |v| |n| / |v . n| (Kraus 2005, 5.1). Peaks in both spaces; samples in data
   space, by the trilinear gradient (eq. 17). Colour scales with opacity. */
typedef enum isogi_dvr_silhouette {
    ISOGI_DVR_SILHOUETTE_NONE = 0,
    ISOGI_DVR_SILHOUETTE_EXACT,       /* a = 1 - (1 - a0)^f (eq. 15); a peak that is seen edge on is opaque */
    ISOGI_DVR_SILHOUETTE_APPROXIMATE, /* a = min(1, a0 f) (eq. 16) */
    ISOGI_DVR_SILHOUETTE_GRADIENT     /* to compare with: samples weighted by the whole gradient (Levoy 1988; eq. 18), peaks as eq. 16 */
} isogi_dvr_silhouette;

/* One side of a surface, for ISOGI_DVR_TWO_SIDED. All zero: plain diffuse. */
typedef struct isogi_material {
    float diffuse[3];  /* factor on the transfer function's colour, >= 0; all zero = 1: for none, something tiny */
    float specular[3]; /* Phong highlight, >= 0; for transmission a factor on the transfer function's colour, all zero = 1 */
    float exponent;    /* of the highlight, 0..1e6; 0 = no specular part */
} isogi_material;

typedef struct isogi_dvr_desc {
    const isogi_pyramid *pyramid; /* borrowed */
    isogi_dvr_space space;
    isogi_dvr_shading shading;
    double unit;            /* world length that extinction is per; 0 = the smallest voxel spacing: here and below, the smallest world
                               distance of two neighbouring voxels, isogi_volume.spacing times the length of the axis's column of axes */
    double step;            /* sampling distance along a ray in units of the smallest voxel spacing, 0.0001..10000; 0 = 0.5, and 1 where
                               pieces of ray are pre-integrated in physical space without peaks, the default, which errs less */
    int order;              /* SH order of visibility, 1..6; 0 = 3 */
    int directions;         /* visibility rays per grid point, 1..65536; 0 = 64 */
    size_t grid[3];         /* visibility grid points along x, y, z (first and last on the border; a single one at the middle);
                               0 = about a quarter of the voxels along that axis, at least 2 (1 where there is one voxel) */
    int coarsest;           /* 1, 2, 4 or 8; 0 = 1: the regular grid. Above 1 sweeps hold visibility in several resolutions (see above):
                               grid points stand up to this many times as far apart, and the grid is rounded up to multiples of 8 distances.
                               The other methods hold the regular grid */
    float opaque;           /* a ray ends at the first piece at which it has this opacity, 0..1; 0 = 0.999; 1 = never. In data space,
                               where the function is 0 on more than six ranges of values, some end later with AVX-512 than without */
    uint32_t jitter;        /* not 0: every pixel's samples are moved by a part of a step of its own, which turns rings of large steps into
                               noise. The same number gives the same picture. Sampled rays only; physical space is post-classified then */
    double visibility_step; /* sampling distance along visibility rays, as `step`; 0 = twice `step`, or 1 where that is 0. Sweeps: distance
                               of the lattice of extinction, rounded so that grid points are on it, but half a voxel at least along
                               axes whose voxels are longer, or this times a voxel where that is less; 0 = 2. What is opaque from one
                               voxel to the next wants 1, in three times the time: with 2 its surfaces are lit in blotches (a picture
                               of torus-sphere-plane by 128 directions differs from 2048 by brute force by RMSE .015 and .006) */
    isogi_dvr_method method;
    isogi_dvr_sphere sphere;
    double anisotropy;      /* of scattering, -1..1 (both excluded): g of Henyey and Greenstein; 0 = isotropic; with visibility only */
    double tolerance;       /* pre-integrated physical space: pieces of ray across which extinction times length, times the transparency
                               before them, changes by more are sampled seven times as densely; 0 = 0.5. It limits
                               no error: `bound` does */
    double bound;           /* physical space, 1e-4..1; 0 = none: how far colours may err, in units of the largest of the transfer
                               function's, or of 1. See "Error bounds" above: rays walk cells as they do in data space, and step, tolerance,
                               classification and jitter mean nothing to pictures;
                               rays of visibility have their distance from step all the same */
    double emission;        /* share of rgb that glows by itself, besides scattering light; 0..1e6; with visibility only */
    double radius;          /* the paper's method: of local visibility, in units of the smallest voxel spacing, 1..32; 0 = 16. Sheared
                               axes along which it reaches more than 64 voxels are ISOGI_TOO_LARGE */
    double reduction;       /* the paper's method: voxels of the volume to points of its blocks, at least 1; 0 = 4. A block that is not
                               transparent holds a point whatever the budget is; those that the border cuts thin come first for more.
                               One of a single colour holds no more than its corners at any budget: in dense fog that reaches the border
                               visibility is then a third too large. One that a clip plane cuts, or the next one to it, holds local
                               visibility at every voxel */
    isogi_dvr_classification classification; /* in data space; visibility rays are exact there, unless this says post-classified */
    int table;                               /* entries along a side of the pre-integrated table, which stand where the transfer
                                                function changes, half by value, half evenly among its pieces; 2..1024; 0 = 256 */
    isogi_dvr_silhouette silhouette;
    isogi_normal_kind normals;   /* of shading and of silhouettes of peaks; 0 = smooth */
    isogi_material material[3];  /* two-sided: seen from lower values, seen from higher values, light that comes through */
    const isogi_pyramid *second; /* borrowed: a field that colours peaks; NULL = none. Its value at a crossing, through these points,
                                    gives a */
    const isogi_transfer_point *second_points; /* factor on the peak's colour; borrowed; their extinction means nothing, but is checked.
                                                  Beyond its box the second field is what it is at its border; the factor is 1 without
                                                  points, or where the field is NaN */
    size_t second_count;
} isogi_dvr_desc;

typedef struct isogi_dvr isogi_dvr;

/* Which place along a ray is its depth. */
typedef enum isogi_depth_kind {
    ISOGI_DEPTH_HALF = 0, /* where half of the pixel's final opacity is reached: what stands for a surface among rasterized geometry. It
                             only says which of both is in front: for geometry inside of matter there is isogi_view.until */
    ISOGI_DEPTH_FIRST     /* where opacity begins (a 2^-40th of the final one): geometry before it is not covered by anything; of rays that
                             are sampled up to a step off, mostly too near; of exact ones (data space, or a bound), and of
                             pre-integrated ones of physical space, right to rounding */
} isogi_depth_kind;

/* A pinhole camera. width x height pixels, row 0 on top; neither orthographic nor off its axis. Of a view matrix M and a projection P, by
   columns as in OpenGL: target = eye - r (M[2], M[6], M[10]), r the distance of what is looked at, as floats far from the origin lose
   steps of 1, up = (M[1], M[5], M[9]), fov = 2 atan(1 / P[5]) 180 / pi. */
typedef struct isogi_view {
    int width, height;              /* 1..32768 */
    float eye[3], target[3], up[3]; /* world; up: of any length; 0 = +y */
    float fov;                      /* vertical angle of view in degrees, below 180; 0 = 45 */
    int local;                      /* 0, or 1: shade by local visibility, for cut planes, and lights within. On the box's own faces it is
                                       too dark: matter fades there over one distance of nodes. ISOGI_INVALID where the paper's method
                                       is not at work (another method, peaks, data space, an axis of one voxel, voxels beyond floats,
                                       shading other than ISOGI_DVR_VISIBILITY, tetrahedra) */
    isogi_depth_kind depth;         /* what is asked for where depth is */
    const float *until;             /* [height*width], borrowed for the call; NULL = no geometry: see below */
} isogi_view;

/* Geometry among matter, isogi_view.until: how far from the eye the ray through each pixel's centre ends, at something opaque, which throws
   no shadow. INFINITY where there is nothing; 0 or less where nothing is to be seen; NaN is ISOGI_INVALID. The picture is put over that of
   the geometry as over a background (opacity and depth are those of matter alone). From a rasterizer's depth z along the line of sight: z /
   (dir . forward), dir as isogi_view_ray gives it, forward the one for x = (width - 1) / 2, y = (height - 1) / 2; from a z-buffer of 0..1
   z = near far / (far - d (far - near)), and INFINITY where d = 1. A peak at which geometry stands is on either side of it, by rounding:
   an isosurface drawn at a peak of its own value is brought nearer by a millionth. */

/* The ray through the centre of pixel (x, y); fractions are allowed: pixel x covers x-1/2 .. x+1/2. dir is a unit vector,
   rounded to floats as that of pictures is not: from 1e5 voxels away it leads .01 voxel past.
   Where up is along the line of sight, another up is chosen; where eye and target coincide, the view is along -z. */
ISOGI_API void isogi_view_ray(const isogi_view *view, double x, double y, double origin[3], float dir[3]);

/* A renderer without a transfer function (all transparent) and without shadows. context NULL = the pyramid's. ISOGI_INVALID for a
   description outside its documented ranges. *dvr is written on success alone. The paper's method, for which voxels are read, calls the
   progress callback, with a fraction of 0 throughout: ISOGI_CANCELLED where it asks for that. Where voxels change (isogi_vol_update) a new
   renderer has to be made. */
ISOGI_API isogi_result isogi_dvr_create(isogi_dvr **dvr, const isogi_dvr_desc *desc, const isogi_context *context);
/* Why isogi_dvr_create refuses a description, and pictures a view: the member at fault and why, as "order: not 0 .. 6", for whoever writes
   the program; NULL where none is, but what is too large by several together, as grids, is told by the result alone, and so is `local`
   without the paper's method. */
ISOGI_API const char *isogi_dvr_fault(const isogi_dvr_desc *desc);
ISOGI_API const char *isogi_view_fault(const isogi_view *view);
ISOGI_API void isogi_dvr_free(isogi_dvr *dvr); /* NULL is fine */

/* Copied. Visibility has to be stepped again, from the beginning, before it is right for the new function; until a grid point's
   turn comes it keeps what it had. Blocks in which nothing changes are not read again: sweeps and the paper's method then agree with
   a renderer made for this function as if values of voxels had moved by up to a 2048th of the span of values that it tells apart (two
   classes of values), not to the bit; brute force does to the bit. Where nothing but colours changes, visibility stays as it is, at no
   cost but by brute force, and so do the levels of the paper's method, though they suit the colours for which they were chosen. */
ISOGI_API isogi_result isogi_dvr_set_transfer(isogi_dvr *dvr, const isogi_transfer *transfer);

/* Computes visibility within about max_rays rays (0 = to the end), at least one grid point (brute force), block or direction (the paper's
   method), plane of the lattice or direction (sweeps). Voxels that have to be read for it, after a change, count too: four of a plane as a
   ray, a block as 64 rays for each direction; and so does the local visibility of a block, whose rays are short, but up to 4096 for each
   direction. *remaining (may be NULL): fraction still to do, 0 = finished. When cancelled, what is finished stays and the next call goes
   on; but the points, planes, blocks or directions at work are lost, about a quarter of so many is tried next, and one of them has to fit
   between two cancels: for slices of time budgets are better. Without ISOGI_DVR_VISIBILITY there is nothing to do. */
ISOGI_API isogi_result isogi_dvr_step(isogi_dvr *dvr, uint64_t max_rays, double *remaining);

/* Interpolated visibility coefficients at world points: visibility[count][order*order]. Outside of the box a point is moved to its
   nearest border point (between sheared axes, along these). ISOGI_INVALID without ISOGI_DVR_VISIBILITY. */
ISOGI_API isogi_result isogi_dvr_sample_visibility(const isogi_dvr *dvr, const float (*points)[3], size_t count, float *visibility);

/* Keeps only where plane[0] x + plane[1] y + plane[2] z + plane[3] >= 0 (world) for all planes; at most ISOGI_DVR_MAX_PLANES, a box
   is six; 0 = everything. What is cut off neither absorbs nor shadows: visibility has to be stepped again, as for a new transfer
   function, and the blocks that no plane touches keep their classification. Shade a cut by local visibility
   (isogi_view.local): the paper's advice, since the global grid is too coarse for a flat face. */
#define ISOGI_DVR_MAX_PLANES 32
ISOGI_API isogi_result isogi_dvr_set_clip(isogi_dvr *dvr, const double (*planes)[4], size_t count);

/* What is held, and where. Blocks are those of the pyramid's level 1, 16 cells a side, x fastest. Where the paper's method is not
   at work (see isogi_view.local), there is one level, and only the global part is counted. */
typedef struct isogi_dvr_report {
    size_t block_count[3];
    const uint8_t *level;      /* [blocks], valid until the next writer: 16, 8, 4, 2, 1, or 0 for dropped;
                                  NULL where the paper's method is not at work */
    size_t level_count[6];     /* blocks that are dropped, or of level 1, 2, 4, 8, 16 */
    size_t points;             /* of all blocks, not counting those repeated on their upper faces */
    double reduction;          /* voxels to points */
    size_t data_bytes, index_bytes, local_bytes, global_bytes; /* with the repeated points: data, index of blocks, coefficients */
    size_t blocks_classified;  /* so far: blocks whose classification a new transfer function or clip plane changed */
    size_t blocks_computed;    /* so far: blocks whose local visibility was computed */
    size_t grid_points;        /* of global visibility; in several resolutions those that are held, with the repeated ones */
    size_t step_count[4];      /* in several resolutions: blocks of 8^3 grid distances that hold every point, every 2nd, 4th,
                                  8th along an axis */
} isogi_dvr_report;
ISOGI_API isogi_result isogi_dvr_inspect(const isogi_dvr *dvr, isogi_dvr_report *report);

/* The data as the blocks of the paper's method hold it, and the local visibility, at world points; values[count],
   visibility[count][order*order]; where a block is dropped the lowest value, and no shadow; values beside voxels that are not finite need
   not be finite. ISOGI_INVALID where that method is not at work (see isogi_view.local). */
ISOGI_API isogi_result isogi_dvr_sample_blocks(const isogi_dvr *dvr, const float (*points)[3], size_t count, float *values,
                                               float *visibility);

/* premultiplied[height*width]: linear RGB premultiplied by opacity, opacity. depth[height*width] (NULL = not wanted): distance from the
   eye along the ray to the place that view->depth names, INFINITY where the ray meets nothing.
   lighting: environment and directional lights (point lights too, at the sample); unused, and may be NULL, when unlit. Each call looks at
   all of an environment's image (60 ms for 4096 x 2048): for many frames project it once, isogi_sh_project, into env.sh. */
ISOGI_API isogi_result isogi_dvr_render(const isogi_dvr *dvr, const isogi_view *view, const isogi_lighting *lighting,
                                        float (*premultiplied)[4], float *depth, isogi_counters *counters);
/* Adds what isogi_dvr_step did so far; samples: those of the paper's local visibility and, in data space, one for each cell of a ray. */
ISOGI_API void isogi_dvr_counters(const isogi_dvr *dvr, isogi_counters *counters);

/* ---- transfer functions to begin with ---- */

/* Colours in linear light. */
typedef enum isogi_preset {
    ISOGI_PRESET_GREY = 0,   /* one white, more of it for larger values */
    ISOGI_PRESET_HOT,        /* black, red, yellow, white: as bodies glow */
    ISOGI_PRESET_COOL_WARM,  /* blue, light grey, red about the middle */
    ISOGI_PRESET_SPECTRUM    /* violet, blue, green, yellow, red */
} isogi_preset;

#define ISOGI_PRESET_POINTS 9

/* Points at equal distances from low to high, extinction growing linearly from 0 to `extinction`. ISOGI_INVALID unless low < high, all
   finite. */
ISOGI_API isogi_result isogi_transfer_preset(isogi_preset preset, double low, double high, float extinction,
                                             isogi_transfer_point points[ISOGI_PRESET_POINTS]);

enum {
    ISOGI_TABLE_SRGB = 1,         /* colours are display light (sRGB), to be decoded; else linear */
    ISOGI_TABLE_PREMULTIPLIED = 2 /* colours are multiplied by opacity (before coding), to be divided by it */
};

/* A colour table of another program: rgba[count], 0..1, entry i for the value low + (high - low) i / (count - 1). Opacity is that of a
   path of `length`, in units of isogi_dvr_desc.unit or, in data space, of data: extinction = -ln(1 - a) / length; an opacity of 1 counts
   as 1 - 2^-24. Where opacity is 0, premultiplied tables have no colour: black; where colour exceeds opacity it is 1. ISOGI_INVALID: fewer
   than 2 entries, low >= high, length <= 0, anything not finite or outside 0..1; points[] is written on success alone. */
ISOGI_API isogi_result isogi_transfer_import(const float (*rgba)[4], size_t count, double low, double high, double length, int flags,
                                             isogi_transfer_point *points);

#define ISOGI_SUGGEST_POINTS 6

/* A transfer function for a volume of which nothing is known: values in three classes of least variance (Otsu 1979; the largest bin left
   out, which is air or padding; and up to a thousandth of the voxels at either end of the range where that halves it), the lowest
   transparent, the others ever denser and warmer. In physical space extinction is per smallest voxel spacing and makes 1/30 of the
   diagonal, as long as the voxels in a row along it, half opaque soon after the third class begins (the fifth point), twice as dense at
   the top, a fifth to a seventh of it in the second class: what is dense is seen within what is not; in data space a passage through the
   second class is a third opaque, through the third two thirds, less where they are narrow: in proportion. A volume of one value gets
   points that nothing meets. ISOGI_INVALID for a pyramid of a function, which has no voxels. threshold (may be NULL): where the second
   class begins, for an isosurface. */
ISOGI_API isogi_result isogi_transfer_suggest(const isogi_pyramid *pyramid, isogi_dvr_space space,
                                              isogi_transfer_point points[ISOGI_SUGGEST_POINTS], double *threshold);

/* ---- tetrahedral meshes ------------------------------------------------------------------------------------------------------ */

/* Points, a value at each, and four points for each tetrahedron in any order: borrowed arrays that must outlive what is built. Between the
   points of a tetrahedron the field is linear. Meshes may be non-convex, in several parts, and have gaps: a ray enters again. */
typedef struct isogi_tet_mesh {
    const float (*points)[3]; /* world; finite */
    const float *values;      /* finite */
    size_t point_count;
    const uint32_t (*tets)[4]; /* below point_count */
    size_t tet_count;          /* up to 2^29 */
} isogi_tet_mesh;

/* What was found while the mesh was built: nothing of it is an error. */
typedef struct isogi_tet_report {
    size_t degenerate; /* tetrahedra without volume, left out: det <= 1e-13 (longest edge)^3. Rays pass where they were */
    size_t crowded;    /* faces with a tetrahedron before them on the same side of the same points: of one listed twice, which is drawn
                          once, or of two that overlap: the second is joined to what is still alone across the face, else border */
    size_t border;     /* faces of one tetrahedron */
} isogi_tet_report;

/* What is drawn, unlit. All zero is fine. */
typedef struct isogi_tet_desc {
    isogi_dvr_space space;           /* both are exact: values are linear along a piece of ray */
    isogi_dvr_silhouette silhouette; /* the approximate form once for each tetrahedron */
    double unit;                     /* world length that extinction is per in physical space; 0 = 1 */
    float opaque;                    /* as in isogi_dvr_desc */
} isogi_tet_desc;

typedef struct isogi_tets isogi_tets; /* const once built: any number of threads may render it */

/* Finds which tetrahedra share faces; some 40 bytes for each and 70 for each face of the border, twice that while it works. report may be
   NULL. ISOGI_INVALID for a point that does not exist, and for anything that is not finite. */
ISOGI_API isogi_result isogi_dvr_tets_build(isogi_tets **tets, const isogi_tet_mesh *mesh, isogi_tet_report *report,
                                            const isogi_context *context);
ISOGI_API void isogi_dvr_tets_free(isogi_tets *tets); /* NULL is fine */

/* As isogi_dvr_render, by rays that go from face to face; any number of peaks. counters->cells: tetrahedra passed. */
ISOGI_API isogi_result isogi_dvr_tets_render(const isogi_tets *tets, const isogi_tet_desc *desc, const isogi_transfer *transfer,
                                             const isogi_view *view, float (*premultiplied)[4], float *depth, isogi_counters *counters);

#endif /* ISOGI_DVR_H */

/* ==================================================================================================================== */
#if (defined(ISOGI_IMPLEMENTATION) || defined(ISOGI_DVR_IMPLEMENTATION)) && !defined(ISOGI_DVR_IMPLEMENTED)
#define ISOGI_DVR_IMPLEMENTED

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ISOGI_DVR__PI 3.14159265358979323846
#define ISOGI_DVR__LEVELS 3
#define ISOGI_DVR__MAX_ORDER 6
#define ISOGI_DVR__LOCAL_ORDER 5           /* of the environment in local shading: the cosine kernel holds little beyond */
#define ISOGI_DVR__MAX_SAMPLES 16777216.0  /* on one ray */
#define ISOGI_DVR__NEGLIGIBLE 1e-4         /* transmittance at which a visibility ray ends */
#define ISOGI_DVR__MAX_REACH 4             /* blocks that local visibility may look at on each side of one */
#define ISOGI_DVR__NOT_FINITE 62           /* the bin of what is not */
#define ISOGI_DVR__TILE 16                 /* pixels a side: one task */
#define ISOGI_DVR__CHUNK 16                /* grid points: one task */
#define ISOGI_DVR__SLAB 4096               /* grid points between two looks at a cancelled step */
#define ISOGI_DVR__LANES 16                /* floats of a vector; rows are padded for them */
#define ISOGI_DVR__TABLE 4096              /* classes of values */
#define ISOGI_DVR__LOCAL_STEPS 32          /* of a ray of local visibility: its largest radius */
#define ISOGI_DVR__BATCH 16                /* directions swept at once */
#define ISOGI_DVR__GAIN 1024               /* grid points: one task of summing up */
#define ISOGI_DVR__TOWARD 8                /* directions towards which local visibility is evaluated at once */
#define ISOGI_DVR__RAYS 32                 /* of a packet: 8 by 4 pixels, two vectors */
#define ISOGI_DVR__CLASSES 1024            /* of values, for pictures; 16 times as many for a transfer function with narrow pieces */
#define ISOGI_DVR__NODES 8                 /* samples of a ray taken at once */
#define ISOGI_DVR__LEAP 6                  /* blocks of 4^3 that a ray steps over at once, to each side */
#define ISOGI_DVR__FLOATS 3.4028235e38     /* to here they go */
#define ISOGI_DVR__MARKED 8192             /* blocks in a task that marks which are empty */
#if defined(__GNUC__)
#define ISOGI_DVR__APART static __attribute__((noinline)) /* so that the stacks of several ways do not add up */
#else
#define ISOGI_DVR__APART static
#endif

/* One vector type of 16 floats: the compiler divides it into what the machine has. */
#if (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 9)) && !defined(__TINYC__) && !defined(ISOGI_NO_SIMD) && \
    !(defined(_WIN32) && !defined(__clang__)) && \
    (!defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ == 0)
#define ISOGI_DVR__VECTORS
typedef float isogi_dvr__floats __attribute__((vector_size(64), aligned(4), may_alias));
typedef int32_t isogi_dvr__ints __attribute__((vector_size(64), aligned(4), may_alias));
#define ISOGI_DVR__V(p) (*(isogi_dvr__floats *)(void *)(p))
#define ISOGI_DVR__C(p) (*(const isogi_dvr__floats *)(const void *)(p))
typedef float isogi_dvr__four __attribute__((vector_size(16), aligned(4), may_alias)); /* a colour and something */
#define ISOGI_DVR__4(p) (*(isogi_dvr__four *)(void *)(p))
#define ISOGI_DVR__C4(p) (*(const isogi_dvr__four *)(const void *)(p))
#if defined(__x86_64__)
#define ISOGI_DVR__AVX
#include <immintrin.h>
#endif
#endif

/* A ray within the volume, in grid coordinates; sample i stands at origin + i * dir. */
typedef struct isogi_dvr__fast_ray {
    float origin[3], dir[3], piece, last_piece; /* world length over unit from sample to sample */
    float end;                                  /* where the last piece ends, in samples: there its last sample is */
    float sought;                               /* optical depth whose place is looked for */
    float reach;                                /* as isogi_dvr__reach_along, in samples */
    double enter;                               /* world length from the eye to the first sample */
    int count;                                  /* of samples */
} isogi_dvr__fast_ray;

/* Rays side by side, which look for matter together. */
typedef struct isogi_dvr__packet {
    float origin[3][ISOGI_DVR__RAYS], dir[3][ISOGI_DVR__RAYS], inverse[3][ISOGI_DVR__RAYS];
    int32_t next[ISOGI_DVR__RAYS], count[ISOGI_DVR__RAYS]; /* next = count: done */
    int32_t at[ISOGI_DVR__RAYS];                           /* where a ray leaps from: next, or, once it has leapt, the sample after it */
    uint8_t found[ISOGI_DVR__RAYS];                        /* rays that are to be looked at */
} isogi_dvr__packet;

typedef struct isogi_dvr__frame isogi_dvr__frame;
typedef struct isogi_dvr__fast_run isogi_dvr__fast_run;
typedef struct isogi_dvr__fast_state isogi_dvr__fast_state;

/* Rows that lie a fixed distance apart, for the vector kernels. */
typedef struct isogi_dvr__rows {
    float *depth, *out;
    const float *from;
    size_t depth_row, out_row, from_row, rows, count, beside; /* beside: from a row of `from` to the other one that is read with it */
    size_t weight;                                            /* from transmittance to its weight,
                                                                 in what pass_out writes and between reads */
} isogi_dvr__rows;

/* A step of local visibility's rays: see "local and global visibility" below. */
typedef struct isogi_dvr__local_step {
    double way[3];    /* from a ray's node to its sample, in grid coordinates, */
    ptrdiff_t offset; /* and to the first of the eight nodes around that */
    float weight[8];  /* times the optical depth of the step */
} isogi_dvr__local_step;

/* Rays of local visibility in one direction from a row of nodes, through a window. */
typedef struct isogi_dvr__local_rays {
    const float *at;
    const isogi_dvr__local_step *step;
    const int32_t (*within)[2]; /* of each step: the nodes whose samples count, from, to; NULL: all */
    size_t steps, row, plane, count;
} isogi_dvr__local_rays;

/* Sums over directions: sum[c][i] += kernel[k][c] * from[k][i]. */
typedef struct isogi_dvr__sums {
    float *sum;
    const float *from, *kernel;
    size_t sum_row, from_row, coefficients, directions, count;
} isogi_dvr__sums;

/* Kernels of the best instruction path: 1 plain, 2 portable vectors, 3 AVX2, 4 AVX-512. */
typedef struct isogi_dvr__kernels {
    void (*pass)(const isogi_dvr__rows *a, const float w[4]);
    void (*pass_out)(const isogi_dvr__rows *a, const float w[4]);
    void (*between)(const isogi_dvr__rows *a, const float part[2]);
    void (*exp_row)(float *x, size_t count);
    int (*leap)(const isogi_dvr *d, isogi_dvr__packet *p, isogi_counters *work);
    void (*gather)(const isogi_dvr__sums *a);
    void (*local)(const isogi_dvr__local_rays *a, float *clear);
} isogi_dvr__kernels;

#ifdef ISOGI_DVR__AVX
static int isogi_dvr__machine(void) {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return 2;
#ifdef __OPTIMIZE__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl"))
        return 4; /* unoptimised it takes up to 140 KB of stack */
#endif
    return 3;
}
#endif

/* ==== numbers that survive -ffast-math =============================================================================== */

static int isogi_dvr__finite64(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7ff0000000000000u) != 0x7ff0000000000000u;
}

static int isogi_dvr__is_nan(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7fffffffffffffffu) > 0x7ff0000000000000u;
}

static int isogi_dvr__finite32(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

static int isogi_dvr__nan32(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7fffffffu) > 0x7f800000u;
}

static int isogi_dvr__finite3(const float v[3]) {
    return isogi_dvr__finite32(v[0]) && isogi_dvr__finite32(v[1]) && isogi_dvr__finite32(v[2]);
}

/* 0 .. high; NaN becomes 0. */
static double isogi_dvr__clamp(double x, double high) {
    x = x > 0 ? x : 0;
    return x < high ? x : high;
}

static double isogi_dvr__dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void isogi_dvr__cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}

static void isogi_dvr__transform(const double m[9], const double v[3], double out[3]) {
    double x = v[0], y = v[1], z = v[2];
    out[0] = m[0] * x + m[1] * y + m[2] * z;
    out[1] = m[3] * x + m[4] * y + m[5] * z;
    out[2] = m[6] * x + m[7] * y + m[8] * z;
}

/* ==== transfer functions ============================================================================================= */

/* Finite, within 0 .. 1e30. */
static int isogi_dvr__colour_ok(const float rgb[3]) {
    int a;
    if (!isogi_dvr__finite3(rgb)) return 0;
    for (a = 0; a < 3; a++)
        if (!(rgb[a] >= 0 && rgb[a] <= 1e30f)) return 0;
    return 1;
}

static const char *isogi_dvr__points_fault(const isogi_transfer_point *points, size_t count) {
    size_t i;
    if (count && !points) return "points: NULL, but their count is not 0";
    for (i = 0; i < count; i++) {
        const isogi_transfer_point *p = &points[i];
        if (!isogi_dvr__finite64(p->value)) return "points: a value is not finite";
        if (!isogi_dvr__finite32(p->extinction) || !(p->extinction >= 0)) return "points: an extinction is negative or not finite";
        if (!isogi_dvr__colour_ok(p->rgb)) return "points: an rgb is not 0 .. 1e30";
        if (i && !(p->value >= p[-1].value)) return "points: a value is below the one before it";
    }
    return NULL;
}

ISOGI_API const char *isogi_transfer_fault(const isogi_transfer *transfer) {
    const char *fault;
    size_t i;
    if (!transfer) return "transfer: NULL";
    if (transfer->peak_count && !transfer->peaks) return "peaks: NULL, but peak_count is not 0";
    fault = isogi_dvr__points_fault(transfer->points, transfer->point_count);
    for (i = 0; i < transfer->peak_count && !fault; i++) {
        const isogi_peak *p = &transfer->peaks[i];
        if (!isogi_dvr__finite64(p->isovalue)) fault = "peaks: an isovalue is not finite";
        else if (!isogi_dvr__finite32(p->opacity) || !(p->opacity >= 0 && p->opacity <= 1)) fault = "peaks: an opacity is not 0 .. 1";
        else if (!isogi_dvr__colour_ok(p->rgb)) fault = "peaks: an rgb is not 0 .. 1e30";
    }
    return fault;
}

ISOGI_API isogi_result isogi_transfer_validate(const isogi_transfer *transfer) {
    return isogi_transfer_fault(transfer) ? ISOGI_INVALID : ISOGI_OK;
}

/* How many points have a value <= x. */
static size_t isogi_dvr__points_below(const isogi_transfer_point *points, size_t count, double x) {
    size_t low = 0, high = count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (points[middle].value <= x) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* The piece that x lies on: its two points and the place between them. The upper side holds at a step. */
static double isogi_dvr__piece(const isogi_transfer_point *points, size_t count, double x, size_t *low, size_t *high) {
    size_t n = isogi_dvr__points_below(points, count, x);
    *low = n ? n - 1 : 0, *high = n < count ? n : count - 1;
    if (*low == *high) return 0;
    /* halves, so that the difference of two finite values is finite */
    return isogi_dvr__clamp((0.5 * x - 0.5 * points[*low].value) / (0.5 * points[*high].value - 0.5 * points[*low].value), 1);
}

static double isogi_dvr__extinction(const isogi_transfer_point *points, size_t count, double x) {
    size_t low, high;
    double u = isogi_dvr__piece(points, count, x, &low, &high), from = (double)points[low].extinction;
    return from + u * ((double)points[high].extinction - from);
}

static void isogi_dvr__colour(const isogi_transfer_point *points, size_t count, double x, double rgb[3]) {
    size_t low, high;
    double u = isogi_dvr__piece(points, count, x, &low, &high);
    int a;
    for (a = 0; a < 3; a++) rgb[a] = (double)points[low].rgb[a] + u * ((double)points[high].rgb[a] - (double)points[low].rgb[a]);
}

ISOGI_API void isogi_transfer_at(const isogi_transfer *transfer, double value, float rgb[3], float *extinction) {
    double colour[3];
    int a;
    for (a = 0; a < 3; a++) rgb[a] = 0;
    *extinction = 0;
    if (!transfer->point_count || isogi_dvr__is_nan(value)) return;
    if (value > 1.7976931348623157e308) value = 1.7976931348623157e308;
    if (value < -1.7976931348623157e308) value = -1.7976931348623157e308;
    isogi_dvr__colour(transfer->points, transfer->point_count, value, colour);
    for (a = 0; a < 3; a++) rgb[a] = (float)colour[a];
    *extinction = (float)isogi_dvr__extinction(transfer->points, transfer->point_count, value);
}

/* Between two such points nothing changes. */
static int isogi_dvr__alike(const isogi_transfer_point *a, const isogi_transfer_point *b) {
    if (a->extinction < b->extinction || a->extinction > b->extinction) return 0;
    return !(a->extinction > 0) || !memcmp(a->rgb, b->rgb, sizeof a->rgb);
}

/* ==== the renderer =================================================================================================== */

/* An owned transfer function. most[l * point_count + i] is the largest extinction of points i .. i + 2^l - 1, so that the largest
   over any range of values is the larger of two entries. */
typedef struct isogi_dvr__transfer {
    isogi_transfer_point *points;
    isogi_peak *peaks;
    float *most;
    size_t point_count, peak_count, most_count;
} isogi_dvr__transfer;

/* Extinction on a lattice of its own: see "matter" below. */
typedef struct isogi_dvr__matter {
    size_t size[3], every[3], first[3]; /* nodes; nodes from one grid point to the next; node of the first grid point */
    size_t row[2], count[2];            /* padded row and number of floats of the two layouts */
    double spacing[3];                  /* voxels from node to node */
    float *extinction[2];               /* [z][y][x] and [x][y][z], per desc.unit */
    double low, scale;                  /* class of a value: (value - low) * scale; see isogi_dvr__set_classes */
    double kept[2], kept_scale;         /* some block may still have been classified as coarsely as this, between these values */
    float *table, *scratch;             /* while it is brought up to date: extinction of classes; rows of values */
    size_t scratch_row, plane;          /* the first of the planes at hand */
    size_t prepared;                    /* planes brought up to date since the last change, from the lowest on */
} isogi_dvr__matter;
/* Premultiplied colour and transmittance of a piece of ray. */
typedef struct isogi_dvr__layer {
    double rgb[3], clear;
} isogi_dvr__layer;

typedef struct isogi_dvr__rank {
    double isovalue;
    size_t peak;
} isogi_dvr__rank;

/* What the values of a transfer function need to be integrated over; made when it is set. whole[0] and whole[1] hold the layers of runs
   of 2^l of its pieces, rising and falling, level after level: run i of level l goes from point i 2^l to point (i + 1) 2^l. */
typedef struct isogi_dvr__integral {
    const isogi_transfer_point *points;
    size_t count;
    isogi_dvr__layer *whole[2];
    size_t run_count;
    isogi_dvr__rank *rank; /* peaks by isovalue; those of one isovalue in the order given */
    size_t rank_count;
    double (*quiet)[2]; /* ranges of values, ascending, in which nothing absorbs and no peak is crossed */
    size_t quiet_count, quiet_capacity;
    double bias; /* magnitude of the volume's, which values are rounded with */
    float (*table)[4]; /* pre-integrated: [front][back]: mean colour, mean extinction */
    size_t side;
    double low, high;  /* values between which the table stands; the transfer function is constant before and beyond */
    double *node;      /* [side]: its values */
    double *place;     /* [count]: entries that the points below this one take beyond their share by value,
                          `by_value` for half of a value */
    double by_value;
} isogi_dvr__integral;

/* The paper's flat blocks: see "flat blocks of several levels" below. Block (i, j, k) is i + count[0] * (j + count[1] * k). */
typedef struct isogi_dvr__blocks {
    size_t count[3], total, reach; /* blocks; how many blocks a local ray reaches beyond its own */
    size_t rest[3];                /* cells along the last block, 1 .. 16 */
    float *lattice[5];             /* averages of the data, nodes 2, 4, 8, 16 voxels apart; [0] is the volume */
    size_t lattice_size[5][3];
    uint64_t *histogram;           /* bins of values that occur in each block, */
    double low, scale;             /* for these classes of values */
    uint8_t bin[ISOGI_DVR__TABLE]; /* and these bins of classes */
    uint8_t *level, *lit, *stale;  /* of each block: level of its data, of its local visibility; visibility has to be computed */
    size_t *first;                 /* [2][total]: its first node in `data` and in `sh` */
    size_t *order, due;           /* blocks to be computed */
    size_t counted;               /* blocks whose histogram holds the present bins, from the first on */
    double share;                 /* of a whole update, what follows its histograms; 1 where it needs none */
    int ready;                    /* levels, data and order are those of the last change */
    float *data;
    uint16_t *sh;                  /* [nodes][order * order], half floats */
    size_t data_count, sh_count, packing;
} isogi_dvr__blocks;

/* The grid of visibility in several resolutions: see "visibility of several resolutions" below. Block (i, j, k) of 8^3 grid distances is
   i + count[0] * (j + count[1] * k). */
typedef struct isogi_dvr__held_block { uint32_t first, log; } isogi_dvr__held_block; /* its first point; holds every
                                                                                        2^log-th along an axis */
typedef struct isogi_dvr__held {
    isogi_dvr__held_block *block; /* NULL: the regular grid */
    size_t count[3], total, points;
} isogi_dvr__held;

struct isogi_dvr {
    isogi_dvr_desc desc; /* zero defaults filled in */
    isogi_dvr_method method; /* in force */
    isogi_dvr__kernels kernels;
    isogi_context context;
    isogi_volume volume;
    isogi_dvr__transfer transfer;
    isogi_dvr__integral integral; /* where isogi_dvr__by_piece */
    double limit;                 /* with a bound: how far colours may change in a part of a piece */
    double to_grid[9]; /* world directions to grid directions */
    double spacing;    /* the smallest distance of two voxels, world */
    double range[2];   /* of values, */
    double base;       /* and what they count from in rows and blocks: little would be left in floats of values that are far from zero */
    double visibility_step, piece; /* of visibility rays; of pre-integrated pictures: voxels */
    int cells[3];
    int transparent; /* no value that occurs has any extinction */
    isogi_level level[ISOGI_DVR__LEVELS];
    uint8_t *empty[ISOGI_DVR__LEVELS]; /* one byte a block: nothing in it has any extinction; of level 0: see isogi_dvr__mark_around */
    uint8_t *steady[ISOGI_DVR__LEVELS]; /* all of it has one extinction and one colour; NULL in data space,
                                           and where voxels are not finite */
    uint8_t *empty_blocks;             /* of both */
    size_t block_count;

    double (*direction)[6]; /* of visibility rays: in grid space, in world space */
    float *kernel;          /* [directions][order * order]: weight times basis function */
    size_t coefficients, point_count, kernel_count;
    float *visibility; /* [grid points][order * order] */
    isogi_dvr__held held, coming; /* where `visibility` stands; where `gathered` stands, between the first direction and the last */
    size_t next;       /* grid point; sweeps: direction */
    size_t patience;   /* of these at a time, so that some are done before the next step is cancelled; 0: as many as may be */
    isogi_dvr__matter matter;
    uint8_t *changed;            /* one byte a block of level 1: its classification is no longer what `matter` holds */
    size_t changed_count;
    uint8_t *leap;               /* one byte a block of level 0: how many blocks around it are empty, itself first; 0 = it is not */
    float grid_scale[3];         /* grid points of visibility to a voxel */
    double distance[2];          /* of grid points of visibility, the smallest and the largest: units of `spacing` */
    size_t classified, computed; /* blocks classified anew so far; blocks whose local visibility was computed */
    isogi_dvr__blocks blocks;
    float *basis;                /* the paper's method: [directions][order * order] */
    double (*clip)[4];           /* a grid position x is kept where clip . (x, 1) >= 0 for all of them */
    size_t clip_count;
    uint8_t *cut;                /* one byte a block of level 1: 0 within all planes, 1 cut, 2 outside */
    size_t turned;               /* sweeps: how many of the first directions are along x */
    float *gathered;             /* sweeps and the paper's method: [order * order][padded_count], sums so far;
                                    points z fastest up to there */
    size_t padded_count;         /* points of `gathered`, rounded up to whole vectors */
    isogi_counters counters;
};

/* Rays of pictures walk the cells of physical space. */
static int isogi_dvr__bounded(const isogi_dvr *d) { return d->desc.space == ISOGI_DVR_PHYSICAL && d->desc.bound > 0; }

/* The largest extinction of the values low .. high, both included. */
static double isogi_dvr__most(const isogi_dvr__transfer *t, double low, double high) {
    size_t from, to, span;
    double most, end;
    int level = 0;
    if (!t->point_count) return 0;
    most = isogi_dvr__extinction(t->points, t->point_count, low);
    end = isogi_dvr__extinction(t->points, t->point_count, high);
    if (end > most) most = end;
    from = isogi_dvr__points_below(t->points, t->point_count, low);
    to = isogi_dvr__points_below(t->points, t->point_count, high);
    if (from >= to) return most;
    span = to - from;
    while ((span >> level) > 1) level++;
    end = (double)t->most[(size_t)level * t->point_count + from];
    if (end > most) most = end;
    end = (double)t->most[(size_t)level * t->point_count + to - ((size_t)1 << level)];
    return end > most ? end : most;
}

static void isogi_dvr__transfer_free(isogi_dvr__transfer *t, const isogi_context *context) {
    isogi_release(context, t->points, t->point_count, sizeof *t->points);
    isogi_release(context, t->peaks, t->peak_count, sizeof *t->peaks);
    isogi_release(context, t->most, t->most_count, sizeof *t->most);
    memset(t, 0, sizeof *t);
}

static isogi_result isogi_dvr__transfer_copy(isogi_dvr__transfer *t, const isogi_transfer *from, const isogi_context *context) {
    size_t levels = 1, level, i;
    memset(t, 0, sizeof *t);
    t->point_count = from->point_count, t->peak_count = from->peak_count;
    while (levels < 63 && (t->point_count >> levels) > 0) levels++;
    if (t->point_count > SIZE_MAX / levels) return ISOGI_TOO_LARGE;
    t->most_count = levels * t->point_count;
    t->points = (isogi_transfer_point *)isogi_allocate(context, t->point_count, sizeof *t->points);
    t->peaks = (isogi_peak *)isogi_allocate(context, t->peak_count, sizeof *t->peaks);
    t->most = (float *)isogi_allocate(context, t->most_count, sizeof *t->most);
    if ((t->point_count && (!t->points || !t->most)) || (t->peak_count && !t->peaks)) {
        isogi_dvr__transfer_free(t, context);
        return ISOGI_NO_MEMORY;
    }
    if (t->peak_count) memcpy(t->peaks, from->peaks, t->peak_count * sizeof *t->peaks);
    for (i = 0; i < t->point_count; i++) t->points[i] = from->points[i], t->most[i] = from->points[i].extinction;
    for (level = 1; level < levels; level++) {
        const float *lower = t->most + (level - 1) * t->point_count;
        float *upper = t->most + level * t->point_count;
        size_t half = (size_t)1 << (level - 1);
        for (i = 0; i < t->point_count; i++) {
            upper[i] = lower[i];
            if (i + half < t->point_count && lower[i + half] > upper[i]) upper[i] = lower[i + half];
        }
    }
    return ISOGI_OK;
}

/* The values between which a transfer function is not constant; span[0] > span[1] where there are none. */
static void isogi_dvr__transfer_span(const isogi_dvr__transfer *t, double span[2]) {
    size_t first = 0, end = t->point_count;
    while (first + 1 < end && isogi_dvr__alike(&t->points[first], &t->points[first + 1])) first++;
    while (end > first + 1 && isogi_dvr__alike(&t->points[end - 1], &t->points[end - 2])) end--;
    span[0] = end ? t->points[first].value : 1, span[1] = end ? t->points[end - 1].value : 0;
}

/* What values count from in rows of floats, if it may be `low`: differences must be floats. */
static double isogi_dvr__count_from(const isogi_dvr *d, double low) { return 0.5 * d->range[1] - 0.5 * d->range[0] < 1e38 ? low : 0; }

/* `count` classes of values, the class of a value being (value - low) * scale, kept within 0 .. count - 1. The first and the last one hold
   whatever lies before and beyond the values of the span that occur; the others divide these. So neither an outlier nor a wide range of
   values takes classes from the values that the transfer function tells apart. A thousandth of a class keeps the ends of the span, where
   a step may stand, on their upper side whatever is rounded. Where none stands at the lower end, that and a quarter of a class behind it
   belong to what lies before: air, the least value of many volumes, would else get the mean of a class in which extinction rises.
   t: NULL = as if there were a step. */
static void isogi_dvr__set_classes(const isogi_dvr *d, const isogi_dvr__transfer *t, const double span[2], size_t count, double *low,
                                   double *scale) {
    double from = span[0] > d->range[0] ? span[0] : d->range[0], to = span[1] < d->range[1] ? span[1] : d->range[1], width, least, edge;
    size_t i;
    int step = !t;
    for (i = 1; t && i < t->point_count; i++) step |= !(t->points[i - 1].value < from || t->points[i].value > from);
    edge = step ? 1.001 : 0.75;
    if (!(from < to)) to = from + (d->range[1] > d->range[0] ? 0.5 * d->range[1] - 0.5 * d->range[0] : 0);
    width = (0.5 * to - 0.5 * from) / (0.5 * ((double)count - 0.999 - edge)); /* divided by count - 2, or a little more */
    least = d->range[0] < d->range[1] ? 1e-12 * fabs(from) : 1e-7 * fabs(from) / (double)count; /* that doubles tell apart */
    if (!(width > least)) width = least;
    if (!(width > 1e-300)) width = d->range[0] < d->range[1] ? 1e-300 : 1e-30; /* all the same: classes that floats tell apart */
    *low = from - edge * width, *scale = 1 / width;
}

/* The values that a class stands for: one for the outer ones, which hold the ends of the span, too: no value that does not occur, since
   beyond the last one extinction may begin or end. */
static void isogi_dvr__class_ends(const isogi_dvr *d, double low, double scale, size_t i, size_t count, double ends[2]) {
    ends[0] = low + ((double)i + (i == 1 ? 0.001 : 0)) / scale, ends[1] = low + (double)(i + 1) / scale;
    if (i && i < count - 1) return;
    ends[0] = low + ((double)i + (i ? 0.002 : 0.749)) / scale;
    ends[0] = ends[0] > d->range[0] ? ends[0] : d->range[0], ends[0] = ends[0] < d->range[1] ? ends[0] : d->range[1], ends[1] = ends[0];
}

/* The next step of a transfer function from its point *next on, classes[0] .. classes[1] that count to its upper side as a whole: that in
   which it stands, and those before that values exactly at the step may be taken for, as floats are rounded. So labels have all that begins
   with them; what lies between samples on both sides of a step comes from sums. Not where another point is closer than a few classes. */
static int isogi_dvr__next_step(const isogi_dvr *d, double low, double scale, size_t count, size_t *next, double *value,
                                size_t classes[2]) {
    const isogi_dvr__transfer *t = &d->transfer;
    const double rounded = (fabs(low - d->volume.bias) + fabs(low - d->base)) * scale + 2 * (double)count, off = 2.4e-7 * rounded;
    while (*next + 1 < t->point_count) {
        size_t first = *next, last = first;
        double at, least = 4 + 2 * off, most = (double)count - 2;
        *value = t->points[first].value;
        while (last + 1 < t->point_count && !(t->points[last + 1].value > *value)) last++;
        *next = last + 1;
        if (first == last || isogi_dvr__alike(&t->points[first], &t->points[last])) continue;
        if (first && !((*value - t->points[first - 1].value) * scale >= least)) continue;
        if (last + 1 < t->point_count && !((t->points[last + 1].value - *value) * scale >= least)) continue;
        at = (*value - low) * scale;
        if (!(at >= 1 && at - off < most + 1)) continue;
        classes[0] = (size_t)(at - off > 1 ? at - off : 1), classes[1] = (size_t)(at < most ? at : most);
        return 1;
    }
    return 0;
}

/* The class of a value: 0 .. ISOGI_DVR__TABLE - 1. */
static size_t isogi_dvr__class(const isogi_dvr *d, double value) {
    return (size_t)isogi_dvr__clamp((value - d->matter.low) * d->matter.scale, ISOGI_DVR__TABLE - 1);
}

/* ==== integrals over values ========================================================================================== */

/* In data space the integral over a monotone piece of a ray depends on the values at its ends alone (Kraus 2005, eq. 2, 3). Within one
   linear piece of the transfer function, extinction k and colour c are linear in the place u = 0..1, and with K(u) = int_0^u k,
       int_0^1 c k exp(-K) du = c(0) W + c(1) (A - W),    A = 1 - exp(-K(1)),    W = int_0^1 (1 - exp(-K)) du
   by parts: one number W for all channels, without a difference of large numbers however opaque the piece is. */

static void isogi_dvr__behind(isogi_dvr__layer *front, const isogi_dvr__layer *back) {
    int a;
    for (a = 0; a < 3; a++) front->rgb[a] += front->clear * back->rgb[a];
    front->clear *= back->clear;
}

/* A and W for K(u) = p u + q u^2 of at most 1/2 in all. Gauss's rule with seven points (an error below 1e-12); (1 - exp(-x)) / x by the
   polynomial that interpolates it at Chebyshev's nodes of 0 .. 1/2 (1e-16). Eight lanes, for the compiler to turn into vectors. */
static void isogi_dvr__weigh_linear(double p, double q, double *opacity, double *first) {
    static const double place[8] = {0.025446043828620737737, 0.12923440720030278007, 0.29707742431130141655, 0.5,
                                    0.70292257568869858345, 0.87076559279969721993, 0.97455395617137926226, 1};
    static const double weight[8] = {0.064742483084434846635, 0.13985269574463833395, 0.19091502525255947248, 0.20897959183673469388,
                                     0.19091502525255947248, 0.13985269574463833395, 0.064742483084434846635, 0};
    double lost[8], sum = 0;
    int i;
    for (i = 0; i < 8; i++) {
        double x = place[i] * (p + q * place[i]), x2 = x * x, x4 = x2 * x2;
        double low = (1 - 0.49999999999998485 * x) + (0.16666666666566382 - 0.041666666640941714 * x) * x2;
        double middle = (0.008333332997835102 - 0.0013888863717021528 * x) + (0.0001984011727676172 - 2.4768788096264572e-05 * x) * x2;
        double high = 2.6988592921217972e-06 - 2.1985703840083692e-07 * x;
        lost[i] = x * (low + x4 * (middle + x4 * high));
    }
    for (i = 0; i < 8; i++) sum += weight[i] * lost[i];
    *opacity = lost[7], *first = sum;
}

/* The place u at which the depth k0 u + (k1 - k0) u^2 / 2 is reached; the depth of the whole is at least that. */
static double isogi_dvr__depth_place(double k0, double k1, double depth) {
    double root = k0 * k0 + 2 * (k1 - k0) * depth, u;
    u = 2 * depth / (k0 + sqrt(root > 0 ? root : 0));
    return isogi_dvr__clamp(u, 1);
}

/* Puts a piece behind the layer in which {rgb, extinction} goes linearly from one to the other; extinction is per `length`. Deep pieces
   are cut where their depth reaches 1/2, until nothing is left of the light behind them. */
static void isogi_dvr__add_linear(isogi_dvr__layer *layer, const double from[4], const double to[4], double length) {
    double k0 = isogi_dvr__clamp(from[3] * length, 1e30), k1 = isogi_dvr__clamp(to[3] * length, 1e30), depth = 0.5 * (k0 + k1), u0 = 0;
    double opacity, first, front[3];
    int a;
    if (!(depth > 0)) return;
    for (a = 0; a < 3; a++) front[a] = from[a];
    while (depth > 0.5 && layer->clear > 1e-20) {
        double step = isogi_dvr__depth_place(k0, k1, 0.5), u1 = u0 + (1 - u0) * step, k = k0 + step * (k1 - k0);
        isogi_dvr__weigh_linear(k0 * step, 0.5 * (k - k0) * step, &opacity, &first);
        for (a = 0; a < 3; a++) {
            double back = from[a] + u1 * (to[a] - from[a]);
            layer->rgb[a] += layer->clear * (front[a] * first + back * (opacity - first));
            front[a] = back;
        }
        layer->clear *= 1 - opacity;
        u0 = u1, k0 = k * (1 - step), k1 *= 1 - step, depth = 0.5 * (k0 + k1);
    }
    if (depth > 0.5) return;
    isogi_dvr__weigh_linear(k0, 0.5 * (k1 - k0), &opacity, &first);
    for (a = 0; a < 3; a++) layer->rgb[a] += layer->clear * (front[a] * first + to[a] * (opacity - first));
    layer->clear *= 1 - opacity;
}

/* {rgb, extinction} at x, on the piece between points n - 1 and n. */
static void isogi_dvr__on_piece(const isogi_dvr__integral *g, size_t n, double x, double out[4]) {
    const isogi_transfer_point *low = &g->points[n ? n - 1 : 0], *high = &g->points[n < g->count ? n : g->count - 1];
    double width = 0.5 * high->value - 0.5 * low->value, u = width > 0 ? isogi_dvr__clamp((0.5 * x - 0.5 * low->value) / width, 1) : 0;
    int a;
    for (a = 0; a < 3; a++) out[a] = (double)low->rgb[a] + u * ((double)high->rgb[a] - (double)low->rgb[a]);
    out[3] = (double)low->extinction + u * ((double)high->extinction - (double)low->extinction);
}

/* The part of one piece from x to y. */
static void isogi_dvr__add_part(const isogi_dvr__integral *g, size_t n, double x, double y, double factor, isogi_dvr__layer *layer) {
    double from[4], to[4];
    isogi_dvr__on_piece(g, n, x, from), isogi_dvr__on_piece(g, n, y, to);
    if (from[3] + to[3] > 0) isogi_dvr__add_linear(layer, from, to, fabs(y - x) * factor);
}

/* All pieces between two points, in the direction from first to last. */
static void isogi_dvr__add_whole(const isogi_dvr__integral *g, size_t first, size_t last, double factor, isogi_dvr__layer *layer) {
    int falling = last < first;
    if (factor > 1 || factor < 1) {
        while (first != last) {
            size_t next = falling ? first - 1 : first + 1;
            isogi_dvr__add_part(g, falling ? first : next, g->points[first].value, g->points[next].value, factor, layer);
            first = next;
        }
        return;
    }
    while (first != last) {
        size_t at = 0, level = 0, left = falling ? first - last : last - first;
        while (!(first >> level & 1) && left >> (level + 1)) at += (g->count - 1) >> level, level++;
        at += falling ? (first >> level) - 1 : first >> level;
        isogi_dvr__behind(layer, &g->whole[falling][at]);
        first = falling ? first - ((size_t)1 << level) : first + ((size_t)1 << level);
    }
}

/* Puts the monotone piece of ray from value x to value y behind a layer. `length` takes the place of |y - x| in the integral where it is
   not the integral of Kraus but one whose path is measured otherwise (silhouettes; physical space): then a piece of constant value
   counts too. */
static void isogi_dvr__add_values(const isogi_dvr__integral *g, double x, double y, double length, isogi_dvr__layer *layer) {
    double span = fabs(y - x), factor = 1;
    size_t from, to;
    if (!g->count) return;
    from = isogi_dvr__points_below(g->points, g->count, x);
    if (!(span > 0)) {
        double value[4];
        isogi_dvr__on_piece(g, from, x, value);
        isogi_dvr__add_linear(layer, value, value, length);
        return;
    }
    if (length > span || length < span) factor = length / span;
    if (!(factor < 1e300)) factor = 1e300;
    to = isogi_dvr__points_below(g->points, g->count, y);
    if (from == to) isogi_dvr__add_part(g, from, x, y, factor, layer);
    else if (from < to) {
        isogi_dvr__add_part(g, from, x, g->points[from].value, factor, layer);
        isogi_dvr__add_whole(g, from, to - 1, factor, layer);
        isogi_dvr__add_part(g, to, g->points[to - 1].value, y, factor, layer);
    } else {
        isogi_dvr__add_part(g, from, x, g->points[from - 1].value, factor, layer);
        isogi_dvr__add_whole(g, from - 1, to, factor, layer);
        isogi_dvr__add_part(g, to, g->points[to].value, y, factor, layer);
    }
}

/* The value between x and y up to which the piece from x has this depth: K inverted, piece by piece. There is a depth, hence points. */
static double isogi_dvr__value_at_depth(const isogi_dvr__integral *g, double x, double y, double factor, double depth) {
    size_t n = isogi_dvr__points_below(g->points, g->count, x), to = isogi_dvr__points_below(g->points, g->count, y);
    for (;;) {
        double end = n < to ? g->points[n].value : n > to ? g->points[n - 1].value : y, from[4], at[4], k0, k1;
        isogi_dvr__on_piece(g, n, x, from), isogi_dvr__on_piece(g, n, end, at);
        k0 = isogi_dvr__clamp(from[3] * fabs(end - x) * factor, 1e30), k1 = isogi_dvr__clamp(at[3] * fabs(end - x) * factor, 1e30);
        if (0.5 * (k0 + k1) >= depth && depth > 0) return x + isogi_dvr__depth_place(k0, k1, depth) * (end - x);
        if (n == to) return y;
        depth -= 0.5 * (k0 + k1), x = end;
        n = n < to ? n + 1 : n - 1;
    }
}

/* K(y) - K(x) for x <= y, exactly zero where nothing absorbs. */
static double isogi_dvr__depth_between(const isogi_dvr__integral *g, double x, double y) {
    size_t n = isogi_dvr__points_below(g->points, g->count, x), to = isogi_dvr__points_below(g->points, g->count, y);
    double depth = 0;
    for (; n <= to; n++) {
        double end = n < to ? g->points[n].value : y, from[4], at[4];
        isogi_dvr__on_piece(g, n, x, from), isogi_dvr__on_piece(g, n, end, at);
        depth += 0.5 * (from[3] + at[3]) * (end - x), x = end;
    }
    return depth;
}

static void isogi_dvr__integral_free(isogi_dvr__integral *g, const isogi_context *context) {
    isogi_release(context, g->whole[0], g->run_count, sizeof *g->whole[0]);
    isogi_release(context, g->whole[1], g->run_count, sizeof *g->whole[1]);
    isogi_release(context, g->rank, g->rank_count, sizeof *g->rank);
    isogi_release(context, g->quiet, g->quiet_capacity, sizeof *g->quiet);
    isogi_release(context, g->table, g->side * g->side, sizeof *g->table);
    isogi_release(context, g->node, g->side, sizeof *g->node);
    isogi_release(context, g->place, g->side ? g->count : 0, sizeof *g->place);
    memset(g, 0, sizeof *g);
}

static void isogi_dvr__set_whole(isogi_dvr__integral *g) {
    size_t pieces = g->count ? g->count - 1 : 0, below = 0, at = 0, i, level;
    for (i = 0; i < pieces; i++, at++) {
        isogi_dvr__layer clear = {{0, 0, 0}, 1};
        g->whole[0][at] = g->whole[1][at] = clear;
        isogi_dvr__add_part(g, i + 1, g->points[i].value, g->points[i + 1].value, 1, &g->whole[0][at]);
        isogi_dvr__add_part(g, i + 1, g->points[i + 1].value, g->points[i].value, 1, &g->whole[1][at]);
    }
    for (level = 1; pieces >> level; level++) {
        size_t above = at;
        for (i = 0; i < pieces >> level; i++, at++) {
            g->whole[0][at] = g->whole[0][below + 2 * i], g->whole[1][at] = g->whole[1][below + 2 * i + 1];
            isogi_dvr__behind(&g->whole[0][at], &g->whole[0][below + 2 * i + 1]);
            isogi_dvr__behind(&g->whole[1][at], &g->whole[1][below + 2 * i]);
        }
        below = above;
    }
}

static int isogi_dvr__rank_below(const isogi_dvr__rank *a, const isogi_dvr__rank *b) {
    return a->isovalue < b->isovalue || (!(b->isovalue < a->isovalue) && a->peak < b->peak);
}

/* Heapsort: no recursion, no memory; the number of the peak makes the order a total one. */
static void isogi_dvr__sort_ranks(isogi_dvr__rank *r, size_t count) {
    size_t start = count / 2, end = count;
    while (end > 1) {
        isogi_dvr__rank moved;
        size_t root, child;
        if (start) moved = r[root = --start];
        else moved = r[--end], r[end] = r[0], root = 0;
        while ((child = 2 * root + 1) < end) {
            if (child + 1 < end && isogi_dvr__rank_below(&r[child], &r[child + 1])) child++;
            if (!isogi_dvr__rank_below(&moved, &r[child])) break;
            r[root] = r[child], root = child;
        }
        r[root] = moved;
    }
}

/* How many peaks have an isovalue <= x. */
static size_t isogi_dvr__ranks_below(const isogi_dvr__integral *g, double x) {
    size_t low = 0, high = g->rank_count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (g->rank[middle].isovalue <= x) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* The next value below one; of zero the next that is not denormal: programs may have those flushed to zero. */
static double isogi_dvr__below(double x) {
    const double least = 2.2250738585072014e-308;
    return fabs(x) < least ? -least : nextafter(x, -1.7e308);
}

/* A stretch without extinction, cut below every peak: crossing one means going from below it to the value itself. */
static void isogi_dvr__add_quiet(isogi_dvr__integral *g, double low, double high) {
    size_t rank = isogi_dvr__ranks_below(g, low);
    for (; rank < g->rank_count && g->rank[rank].isovalue <= high; rank++) {
        double end = isogi_dvr__below(g->rank[rank].isovalue);
        if (low <= end) g->quiet[g->quiet_count][0] = low, g->quiet[g->quiet_count++][1] = end;
        low = g->rank[rank].isovalue;
    }
    g->quiet[g->quiet_count][0] = low, g->quiet[g->quiet_count++][1] = high;
}

/* Along a ray in physical space (`lengths`) a value counts that it keeps to: what is quiet ends below a step up, whose upper side holds at
   the value itself. */
static void isogi_dvr__set_quiet(isogi_dvr__integral *g, int lengths) {
    double start = 0;
    size_t n;
    int open = 0;
    for (n = 0; n <= g->count; n++) {
        double low = n ? g->points[n - 1].value : -1.7e308, high = n < g->count ? g->points[n].value : 1.7e308;
        int loud = (n && g->points[n - 1].extinction > 0) || (n < g->count && g->points[n].extinction > 0);
        if (!(low < high)) continue;
        if (!loud && !open) start = low;
        if (loud && open) isogi_dvr__add_quiet(g, start, lengths && g->points[n - 1].extinction > 0 ? isogi_dvr__below(low) : low);
        open = !loud;
    }
    if (open) isogi_dvr__add_quiet(g, start, 1.7e308);
}

/* 1 and the range of values around `low` if low .. high are all quiet. */
static int isogi_dvr__is_quiet(const isogi_dvr__integral *g, double low, double high, double range[2]) {
    size_t first = 0, end = g->quiet_count;
    if (low >= range[0] && high <= range[1]) return 1;
    while (first < end) {
        size_t middle = first + (end - first) / 2;
        if (g->quiet[middle][0] <= low) first = middle + 1;
        else end = middle;
    }
    if (!first || !(high <= g->quiet[first - 1][1])) return 0;
    range[0] = g->quiet[first - 1][0], range[1] = g->quiet[first - 1][1];
    return 1;
}

/* The pre-integrated table. Its entries divide the values among which the transfer function changes: half of them by value, half of them
   evenly among its pieces, so that neither outliers nor a wide range of values take the entries of a narrow tent. */

/* The entry, with a fraction, of a value from low to high. */
static double isogi_dvr__entry(const isogi_dvr__integral *g, double value) {
    size_t low, high;
    double u = isogi_dvr__piece(g->points, g->count, value, &low, &high), at = g->place[low] + u * (g->place[high] - g->place[low]);
    return isogi_dvr__clamp(g->by_value * (0.5 * value - 0.5 * g->low) + at, (double)(g->side - 1));
}

/* Places of the points, from the one below `low` on, and the values of the entries. */
static void isogi_dvr__set_nodes(isogi_dvr__integral *g) {
    double whole, first, last = (double)(g->side - 1), from = g->low, entry = 0, share;
    size_t i, n, below, above;
    for (i = 0; i < g->count; i++) { /* in pieces that change and are seen */
        const isogi_transfer_point *p = &g->points[i];
        int counts = i && p->value > p[-1].value && !isogi_dvr__alike(p, p - 1) && (p->extinction > 0 || p[-1].extinction > 0);
        g->place[i] = (i ? g->place[i - 1] : 0) + counts;
    }
    share = isogi_dvr__piece(g->points, g->count, g->low, &below, &above);
    first = g->place[below] + share * (g->place[above] - g->place[below]);
    share = isogi_dvr__piece(g->points, g->count, g->high, &below, &above);
    whole = g->place[below] + share * (g->place[above] - g->place[below]) - first;
    for (i = 0; i < g->count; i++) g->place[i] = whole > 0 ? 0.5 * last / whole * (g->place[i] - first) : 0; /* in entries */
    g->by_value = (whole > 0 ? 0.5 : 1) * last / (0.5 * g->high - 0.5 * g->low);
    for (i = n = 0; i < g->side; i++) {
        double to = g->high, end = last, u;
        for (; n < g->count && g->points[n].value < g->high; n++) {
            if (!(g->points[n].value > from)) continue;
            to = g->points[n].value, end = isogi_dvr__entry(g, to);
            if (end >= (double)i) break;
            from = to, entry = end, to = g->high, end = last;
        }
        u = end > entry ? isogi_dvr__clamp(((double)i - entry) / (end - entry), 1) : 0;
        g->node[i] = (1 - u) * from + u * to;
        if (i && !(g->node[i] > g->node[i - 1])) g->node[i] = g->node[i - 1];
    }
    g->node[g->side - 1] = g->high;
}

/* Eq. 6 and 7 of Kraus 2005 for all pairs of values, from pieces of one entry each that are put behind each other. Kept are mean colour
   and mean extinction, which go smoothly through front = back: interpolated between entries, equal values stay exactly transparent. */
static void isogi_dvr__set_entry(isogi_dvr__integral *g, size_t front, size_t back, const isogi_dvr__layer *layer, double depth) {
    float *entry = g->table[front * g->side + back];
    double x = g->node[front], y = g->node[back], middle = 0.5 * x + 0.5 * y, value[4], opacity = -expm1(-depth);
    int a;
    isogi_dvr__on_piece(g, isogi_dvr__points_below(g->points, g->count, middle), middle, value);
    for (a = 0; a < 3; a++) entry[a] = (float)(depth > 0 ? layer->rgb[a] / opacity : value[a]);
    entry[3] = (float)isogi_dvr__clamp(x < y || y < x ? depth / fabs(y - x) : value[3], 3e38);
}

static void isogi_dvr__set_pairs(isogi_dvr__integral *g) {
    size_t i, j;
    const isogi_dvr__layer nothing = {{0, 0, 0}, 1};
    for (j = 0; j < g->side; j++) {
        isogi_dvr__layer rising = nothing, falling = nothing;
        double depth = 0;
        isogi_dvr__set_entry(g, j, j, &nothing, 0);
        for (i = j; i-- > 0;) {
            isogi_dvr__layer front = nothing;
            isogi_dvr__add_values(g, g->node[i], g->node[i + 1], g->node[i + 1] - g->node[i], &front);
            isogi_dvr__behind(&front, &rising);
            rising = front;
            depth += isogi_dvr__depth_between(g, g->node[i], g->node[i + 1]);
            isogi_dvr__set_entry(g, i, j, &rising, depth);
        }
        for (i = j + 1, depth = 0; i < g->side; i++) {
            isogi_dvr__layer front = nothing;
            isogi_dvr__add_values(g, g->node[i], g->node[i - 1], g->node[i] - g->node[i - 1], &front);
            isogi_dvr__behind(&front, &falling);
            falling = front;
            depth += isogi_dvr__depth_between(g, g->node[i - 1], g->node[i]);
            isogi_dvr__set_entry(g, i, j, &falling, depth);
        }
    }
}

/* Puts a pair of values from low to high behind a layer. */
static void isogi_dvr__look_up(const isogi_dvr__integral *g, double front, double back, double length, isogi_dvr__layer *layer) {
    double x = isogi_dvr__entry(g, front), y = isogi_dvr__entry(g, back), value[4], opacity;
    size_t i = (size_t)x, j = (size_t)y;
    const float *at;
    int a;
    if (i + 1 >= g->side) i = g->side - 2;
    if (j + 1 >= g->side) j = g->side - 2;
    x -= (double)i, y -= (double)j, at = g->table[i * g->side + j];
    for (a = 0; a < 4; a++) {
        double low = (double)at[a] + y * ((double)at[4 + a] - (double)at[a]);
        double high =
            (double)at[4 * g->side + (size_t)a] + y * ((double)at[4 * g->side + 4 + (size_t)a] - (double)at[4 * g->side + (size_t)a]);
        value[a] = low + x * (high - low);
    }
    opacity = -expm1(-isogi_dvr__clamp(value[3] * length, 1e30));
    for (a = 0; a < 3; a++) layer->rgb[a] += layer->clear * opacity * value[a];
    layer->clear *= 1 - opacity;
}

/* The same for any pair: before and beyond the table the transfer function is constant, and integrated as it is. */
static void isogi_dvr__add_pair(const isogi_dvr__integral *g, double x, double y, double length, isogi_dvr__layer *layer) {
    double from = x < g->low ? g->low : x < g->high ? x : g->high, to = y < g->low ? g->low : y < g->high ? y : g->high;
    double span = fabs(y - x), factor = span > 0 ? length / span : 1;
    if (!g->side || (!(from < to || to < from) && (span > 0 || from < x || x < from))) { /* not in the table, or on its border */
        isogi_dvr__add_values(g, x, y, length, layer);
        return;
    }
    if (from < x || x < from) isogi_dvr__add_values(g, x, from, fabs(from - x) * factor, layer);
    isogi_dvr__look_up(g, from, to, span > 0 ? fabs(to - from) * factor : length, layer);
    if (to < y || y < to) isogi_dvr__add_values(g, to, y, fabs(y - to) * factor, layer);
}

static isogi_result isogi_dvr__integral_build(isogi_dvr__integral *g, const isogi_dvr__transfer *t, const isogi_dvr_desc *desc,
                                              const isogi_context *context) {
    size_t pieces = t->point_count ? t->point_count - 1 : 0, i;
    memset(g, 0, sizeof *g);
    g->points = t->points, g->count = t->point_count, g->rank_count = t->peak_count;
    for (i = 0; pieces >> i; i++) g->run_count += pieces >> i;
    g->quiet_capacity = t->point_count + t->peak_count + 1;
    if (desc->pyramid) g->bias = fabs(isogi_vol_volume(desc->pyramid)->bias);
    if (desc->classification == ISOGI_DVR_PRE_INTEGRATED && t->point_count) {
        double span[2], range[2];
        isogi_dvr__transfer_span(t, span), isogi_vol_range(desc->pyramid, range);
        g->low = span[0] > range[0] ? span[0] : range[0], g->high = span[1] < range[1] ? span[1] : range[1];
        if (g->low < g->high) g->side = (size_t)desc->table;
    }
    g->whole[0] = (isogi_dvr__layer *)isogi_allocate(context, g->run_count, sizeof *g->whole[0]);
    g->whole[1] = (isogi_dvr__layer *)isogi_allocate(context, g->run_count, sizeof *g->whole[1]);
    g->rank = (isogi_dvr__rank *)isogi_allocate(context, g->rank_count, sizeof *g->rank);
    g->quiet = (double(*)[2])isogi_allocate(context, g->quiet_capacity, sizeof *g->quiet);
    g->table = (float(*)[4])isogi_allocate(context, g->side * g->side, sizeof *g->table);
    g->node = (double *)isogi_allocate(context, g->side, sizeof *g->node);
    g->place = (double *)isogi_allocate(context, g->side ? g->count : 0, sizeof *g->place);
    if ((g->run_count && (!g->whole[0] || !g->whole[1])) || (g->rank_count && !g->rank) || !g->quiet ||
        (g->side && (!g->table || !g->node || !g->place))) {
        isogi_dvr__integral_free(g, context);
        return ISOGI_NO_MEMORY;
    }
    for (i = 0; i < g->rank_count; i++) g->rank[i].isovalue = t->peaks[i].isovalue, g->rank[i].peak = i;
    isogi_dvr__sort_ranks(g->rank, g->rank_count);
    isogi_dvr__set_quiet(g, desc->space == ISOGI_DVR_PHYSICAL);
    isogi_dvr__set_whole(g);
    if (g->side) isogi_dvr__set_nodes(g), isogi_dvr__set_pairs(g);
    return ISOGI_OK;
}

/* Whether rays are integrated over values, piece by monotone piece. */
static int isogi_dvr__by_value(const isogi_dvr *d) {
    return d->desc.space == ISOGI_DVR_DATA && d->desc.classification != ISOGI_DVR_POST_CLASSIFIED;
}

/* Whether rays of pictures are integrated piece by monotone piece, over values or lengths. */
static int isogi_dvr__by_piece(const isogi_dvr *d) { return isogi_dvr__by_value(d) || isogi_dvr__bounded(d); }

/* The largest colour of the transfer function, at least 1, times the bound. */
static double isogi_dvr__bounded_limit(const isogi_dvr__transfer *t, double bound) {
    double most = 1;
    size_t i;
    for (i = 0; i < 3 * t->point_count; i++) {
        double c = (double)t->points[i / 3].rgb[i % 3];
        most = c > most ? c : most;
    }
    return most * bound;
}

/* Nothing in a range of values counts for anything. */
static int isogi_dvr__range_empty(const isogi_dvr *d, const float range[2]) {
    double quiet[2] = {1, 0};
    if (range[0] > range[1] || !(d->transfer.point_count || d->transfer.peak_count)) return 1;
    if (isogi_dvr__bounded(d)) return isogi_dvr__is_quiet(&d->integral, (double)range[0], (double)range[1], quiet);
    if (!isogi_dvr__by_value(d)) return !(isogi_dvr__most(&d->transfer, (double)range[0], (double)range[1]) > 0);
    return !(range[0] < range[1]) || isogi_dvr__is_quiet(&d->integral, (double)range[0], (double)range[1], quiet);
}

/* All values of a range are classified alike. */
static int isogi_dvr__range_steady(const isogi_dvr__transfer *t, const float range[2]) {
    size_t n;
    if (!t->point_count || !(range[0] <= range[1])) return 0;
    n = isogi_dvr__points_below(t->points, t->point_count, (double)range[0]);
    if (!(range[0] < range[1])) return 1;
    if (n != isogi_dvr__points_below(t->points, t->point_count, (double)range[1])) return 0;
    return !n || n == t->point_count ||
           (!memcmp(t->points[n].rgb, t->points[n - 1].rgb, sizeof t->points[n].rgb) &&
            !(t->points[n].extinction < t->points[n - 1].extinction) && !(t->points[n].extinction > t->points[n - 1].extinction));
}

/* How far a place may lie beyond a plane and still be on it: rounding must not part the places of a layer. */
static double isogi_dvr__slack(const double plane[4]) { return 1e-9 * (fabs(plane[0]) + fabs(plane[1]) + fabs(plane[2])); }

static int isogi_dvr__kept(const isogi_dvr *d, const double grid[3]) {
    size_t i;
    for (i = 0; i < d->clip_count; i++)
        if (!(isogi_dvr__dot(d->clip[i], grid) + d->clip[i][3] + isogi_dvr__slack(d->clip[i]) >= 0)) return 0;
    return 1;
}

/* How the planes lie to the box of a block of level 1. */
static uint8_t isogi_dvr__cut(const isogi_dvr *d, size_t block) {
    const size_t *size = d->level[1].size;
    size_t at[3] = {block % size[0], block / size[0] % size[1], block / size[0] / size[1]}, i;
    uint8_t cut = 0;
    for (i = 0; i < d->clip_count; i++) {
        double low = d->clip[i][3] + isogi_dvr__slack(d->clip[i]), high = low;
        int a;
        for (a = 0; a < 3; a++) {
            double from = 16 * (double)at[a] * d->clip[i][a], to = from + 16 * d->clip[i][a];
            low += from < to ? from : to, high += from < to ? to : from;
        }
        if (high < 0) return 2;
        if (low < 0) cut = 1;
    }
    return cut;
}

/* Bytes that d->leap takes: of blocks, of a table that they come from, and three more: four bytes are read at once. */
static size_t isogi_dvr__leap_bytes(const isogi_dvr *d) {
    return 2 * d->level[0].size[0] * d->level[0].size[1] * d->level[0].size[2] + 3;
}

/* A block of level 1 that is cut off, and those of level 0 in it. */
static void isogi_dvr__mark_cut(isogi_dvr *d, size_t block) {
    const size_t *size = d->level[1].size, *fine = d->level[0].size;
    size_t c[3] = {4 * (block % size[0]), 4 * (block / size[0] % size[1]), 4 * (block / size[0] / size[1])}, i;
    d->empty[1][block] = 1;
    for (i = 0; i < 64; i++) {
        size_t x = c[0] + i % 4, y = c[1] + i / 4 % 4, z = c[2] + i / 16;
        if (x < fine[0] && y < fine[1] && z < fine[2]) d->empty[0][x + fine[0] * (y + fine[1] * z)] = 1;
    }
}

/* Empty blocks of level 0 in a slice: how many levels are empty there. Where the smallest block is not empty, no larger one is: ranges of
   values contain those of their parts, and isogi_dvr__mark_cut marks with a block what it is made of. */
static void isogi_dvr__mark_around(isogi_dvr *d, size_t z) {
    const size_t *size = d->level[0].size;
    size_t x, y, i = size[0] * size[1] * z;
    int n;
    for (y = 0; y < size[1]; y++)
        for (x = 0; x < size[0]; x++, i++)
            for (n = 0; n < ISOGI_DVR__LEVELS && d->empty[0][i]; n++) {
                const isogi_level *around = &d->level[n];
                size_t block = (x >> 2 * n) + around->size[0] * ((y >> 2 * n) + around->size[1] * (z >> 2 * n));
                if (d->empty[n][block]) d->empty[0][i] = (uint8_t)(n + 1);
            }
}

/* Blocks to the nearest one that is not empty, counted along the axis on which it is farthest: to[] with another axis, at place `at` of
   `size` along it, than from[] has. */
static void isogi_dvr__leap_along(const uint8_t *from, uint8_t *to, size_t at, size_t size, size_t stride) {
    uint8_t least = *from, k;
    for (k = 1; k < least; k++) {
        uint8_t next = at < k ? least : from[-(ptrdiff_t)(k * stride)];
        if (at + k < size && from[k * stride] < next) next = from[k * stride];
        next = next < k ? k : next;
        least = next < least ? next : least;
    }
    *to = least;
}

/* Marks blocks by their ranges, of all levels one after the other. */
static void isogi_dvr__mark_task(void *arg, size_t task) {
    const isogi_dvr *d = (const isogi_dvr *)arg;
    const size_t end = d->block_count / ISOGI_DVR__MARKED == task ? d->block_count : (task + 1) * ISOGI_DVR__MARKED;
    size_t i = task * ISOGI_DVR__MARKED, first = 0, count;
    int n;
    for (n = 0; n < ISOGI_DVR__LEVELS; n++, first += count) {
        const isogi_level *level = &d->level[n];
        count = level->size[0] * level->size[1] * level->size[2];
        for (; i < end && i - first < count; i++) {
            const float *range = level->range[i - first];
            d->empty[n][i - first] = (uint8_t)isogi_dvr__range_empty(d, range);
            if (d->steady[n]) d->steady[n][i - first] = (uint8_t)isogi_dvr__range_steady(&d->transfer, range);
        }
    }
}

/* Marks blocks of level 0 in a slice by what is around them; how far rays may leap, as far as it goes with x and y. */
static void isogi_dvr__around_task(void *arg, size_t z) {
    isogi_dvr *d = (isogi_dvr *)arg;
    const size_t *size = d->level[0].size, slice = size[0] * size[1], first = slice * z;
    uint8_t *flat = d->leap + slice * size[2] + first, *to = d->leap + first;
    size_t i;
    isogi_dvr__mark_around(d, z);
    if (d->desc.space != ISOGI_DVR_PHYSICAL) return;
    for (i = 0; i < slice; i++) flat[i] = d->empty[0][first + i] ? ISOGI_DVR__LEAP : 0;
    for (i = 0; i < slice; i++) isogi_dvr__leap_along(flat + i, to + i, i % size[0], size[0], 1);
    for (i = 0; i < slice; i++) isogi_dvr__leap_along(to + i, flat + i, i / size[0], size[1], size[0]);
}

/* How far rays may leap, z included. */
static void isogi_dvr__leap_task(void *arg, size_t z) {
    const isogi_dvr *d = (const isogi_dvr *)arg;
    const size_t *size = d->level[0].size, slice = size[0] * size[1], first = slice * z;
    const uint8_t *flat = d->leap + slice * size[2] + first;
    size_t i;
    for (i = 0; i < slice; i++) isogi_dvr__leap_along(flat + i, d->leap + first + i, z, size[2], slice);
}

/* What the transfer function and the planes leave empty. It is never done by half; of few blocks by one thread, in less time than others
   take to come. */
static void isogi_dvr__mark_empty(isogi_dvr *d) {
    isogi_context whole = d->context;
    const isogi_level *top = &d->level[ISOGI_DVR__LEVELS - 1];
    const size_t slices = d->level[0].size[2];
    isogi_thread_pool *pool;
    size_t i;
    whole.progress = NULL;
    if (d->block_count < 2 * ISOGI_DVR__MARKED) whole.parallel_for = NULL, whole.threads = 1;
    pool = isogi_thread_pool_begin(&whole);
    isogi_parallel(&whole, d->block_count / ISOGI_DVR__MARKED + 1, isogi_dvr__mark_task, d, 0, 0);
    d->transparent = 1; /* if the largest blocks are empty all others are */
    for (i = 0; i < top->size[0] * top->size[1] * top->size[2]; i++)
        if (!d->empty[ISOGI_DVR__LEVELS - 1][i]) d->transparent = 0;
    for (i = 0; i < d->changed_count; i++)
        if (d->cut[i] == 2) isogi_dvr__mark_cut(d, i);
    isogi_parallel(&whole, slices, isogi_dvr__around_task, d, 0, 0);
    if (d->desc.space == ISOGI_DVR_PHYSICAL) isogi_parallel(&whole, slices, isogi_dvr__leap_task, d, 0, 0);
    isogi_thread_pool_end(&whole, pool);
}

/* Extinction just below a value. */
static double isogi_dvr__extinction_below(const isogi_transfer_point *points, size_t count, double x) {
    size_t low = 0, high = count;
    double u, from;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (points[middle].value < x) low = middle + 1;
        else high = middle;
    }
    if (!low || low == count) return (double)points[low ? low - 1 : 0].extinction;
    u = isogi_dvr__clamp((0.5 * x - 0.5 * points[low - 1].value) / (0.5 * points[low].value - 0.5 * points[low - 1].value), 1);
    from = (double)points[low - 1].extinction;
    return from + u * ((double)points[low].extinction - from);
}

/* Marks the classes of values whose extinction is not the same in both functions. Between two points of either both are linear:
   they agree where they agree at both ends. Leaves the classes as they suit both. */
static void isogi_dvr__compare_transfers(isogi_dvr *d, const isogi_dvr__transfer *old, const isogi_dvr__transfer *now, uint32_t *marks) {
    const isogi_dvr__transfer *t[2];
    size_t next[2] = {0, 0}, i;
    double from = -1e308, to = from, span[2], other[2], both[2];
    int n;
    t[0] = old, t[1] = now;
    isogi_dvr__transfer_span(old, span), isogi_dvr__transfer_span(now, other);
    for (n = 0; n < 2; n++)
        if (!(span[0] <= span[1]) || (other[0] <= other[1] && (n ? other[n] > span[n] : other[n] < span[n]))) both[n] = other[n];
        else both[n] = span[n];
    isogi_dvr__set_classes(d, NULL, both, ISOGI_DVR__TABLE, &d->matter.low, &d->matter.scale);
    memset(marks, 0, (ISOGI_DVR__TABLE + 1) * sizeof *marks);
    for (; to < 1e308; from = to) {
        double at[2] = {0, 0}, end[2] = {0, 0};
        to = 1e308;
        for (n = 0; n < 2; n++) {
            while (next[n] < t[n]->point_count && t[n]->points[next[n]].value <= from) next[n]++;
            if (next[n] < t[n]->point_count && t[n]->points[next[n]].value < to) to = t[n]->points[next[n]].value;
        }
        for (n = 0; n < 2; n++)
            if (t[n]->point_count) {
                at[n] = isogi_dvr__extinction(t[n]->points, t[n]->point_count, from);
                end[n] = isogi_dvr__extinction_below(t[n]->points, t[n]->point_count, to);
            }
        if (at[0] >= at[1] && at[0] <= at[1] && end[0] >= end[1] && end[0] <= end[1]) continue;
        i = isogi_dvr__class(d, from);
        do marks[i + 1] = 1;
        while (i++ < isogi_dvr__class(d, to));
    }
    for (i = 0; i < ISOGI_DVR__TABLE; i++) marks[i + 1] += marks[i];
}

/* Marks the blocks in which some value is classified anew; how many there are. */
static size_t isogi_dvr__mark_changed(isogi_dvr *d, const uint32_t *marks) {
    size_t i, count = 0;
    for (i = 0; i < d->changed_count; i++) {
        const float *range = d->level[1].range[i];
        if (range[0] > range[1] || marks[isogi_dvr__class(d, (double)range[1]) + 1] == marks[isogi_dvr__class(d, (double)range[0])])
            continue;
        d->changed[i] = 1, count++;
    }
    return count;
}

/* Classes for the present function; how many blocks are marked because their values were told apart too coarsely: by the function before
   or, where many small edits narrow the span, by any since they were last marked. */
static size_t isogi_dvr__renew_classes(isogi_dvr *d) {
    isogi_dvr__matter *m = &d->matter;
    double span[2];
    size_t i, count = 0;
    isogi_dvr__transfer_span(&d->transfer, span);
    isogi_dvr__set_classes(d, &d->transfer, span, ISOGI_DVR__TABLE, &m->low, &m->scale);
    if (m->scale > 2 * m->kept_scale) {
        for (i = 0; i < d->changed_count && m->kept_scale > 0; i++) {
            const float *range = d->level[1].range[i];
            /* those marked already, too: planes may have been prepared for them since */
            if ((double)range[1] > m->kept[0] && (double)range[0] < m->kept[1]) d->changed[i] = 1, count++;
        }
        m->kept_scale = m->scale, m->kept[0] = span[0], m->kept[1] = span[1];
    } else {
        m->kept_scale = m->scale < m->kept_scale ? m->scale : m->kept_scale;
        m->kept[0] = span[0] < m->kept[0] ? span[0] : m->kept[0], m->kept[1] = span[1] > m->kept[1] ? span[1] : m->kept[1];
    }
    return count;
}

static void isogi_dvr__begin_anew(isogi_dvr *d);

/* Sweeps and the paper's method know neither data space nor peaks. */
static isogi_dvr_method isogi_dvr__method(const isogi_dvr *d) {
    if (d->desc.space != ISOGI_DVR_PHYSICAL || d->transfer.peak_count) return ISOGI_DVR_BRUTE;
    if (!d->cells[0] || !d->cells[1] || !d->cells[2]) return ISOGI_DVR_BRUTE;
    return d->desc.method;
}

/* Whether floats hold numbers of classes, and all values as they are counted in rows. */
static int isogi_dvr__float_classes(const isogi_dvr *d, double scale) {
    if (!(scale > 1e-30 && scale < 1e31)) return 0;
    return fabs(d->range[0] - d->base) <= ISOGI_DVR__FLOATS && fabs(d->range[1] - d->base) <= ISOGI_DVR__FLOATS;
}

/* Whether floats that count from `base`, as blocks of the paper's method hold values, tell these apart to a few classes. */
static int isogi_dvr__blocks_tell(const isogi_dvr *d) {
    const isogi_dvr__matter *m = &d->matter;
    const double from = fabs(m->low - d->base), to = fabs(m->low + ISOGI_DVR__TABLE / m->scale - d->base);
    if (d->volume.type != ISOGI_F64 && !(fabs(d->volume.bias) > 0)) return 1; /* integers, or floats as they are */
    return (from > to ? from : to) * m->scale <= 134217728;
}

/* The method at work: nor do these know values beyond floats. */
static isogi_dvr_method isogi_dvr__method_now(const isogi_dvr *d) {
    const isogi_dvr_method method = isogi_dvr__float_classes(d, d->matter.scale) ? isogi_dvr__method(d) : ISOGI_DVR_BRUTE;
    return method == ISOGI_DVR_PAPER && !isogi_dvr__blocks_tell(d) ? ISOGI_DVR_BRUTE : method;
}

ISOGI_API isogi_result isogi_dvr_set_transfer(isogi_dvr *dvr, const isogi_transfer *transfer) {
    isogi_dvr__transfer copy;
    isogi_dvr_method before;
    isogi_dvr__integral integral;
    isogi_result result;
    uint32_t *marks;
    size_t changed;
    if (!dvr) return ISOGI_INVALID;
    result = isogi_transfer_validate(transfer);
    if (result == ISOGI_OK && transfer->peak_count > ISOGI_DVR_MAX_PEAKS && !isogi_dvr__by_value(dvr)) result = ISOGI_TOO_LARGE;
    if (result == ISOGI_OK) result = isogi_dvr__transfer_copy(&copy, transfer, &dvr->context);
    if (result != ISOGI_OK) return result;
    memset(&integral, 0, sizeof integral);
    if (isogi_dvr__by_piece(dvr)) result = isogi_dvr__integral_build(&integral, &copy, &dvr->desc, &dvr->context);
    marks = (uint32_t *)isogi_allocate(&dvr->context, ISOGI_DVR__TABLE + 1, sizeof *marks);
    if (!marks || result != ISOGI_OK) {
        isogi_dvr__integral_free(&integral, &dvr->context);
        isogi_release(&dvr->context, marks, ISOGI_DVR__TABLE + 1, sizeof *marks);
        isogi_dvr__transfer_free(&copy, &dvr->context);
        return ISOGI_NO_MEMORY;
    }
    isogi_dvr__compare_transfers(dvr, &dvr->transfer, &copy, marks);
    isogi_dvr__integral_free(&dvr->integral, &dvr->context);
    isogi_dvr__transfer_free(&dvr->transfer, &dvr->context);
    dvr->transfer = copy, dvr->integral = integral, dvr->limit = isogi_dvr__bounded_limit(&copy, dvr->desc.bound);
    isogi_dvr__mark_empty(dvr);
    changed = isogi_dvr__mark_changed(dvr, marks);
    changed += isogi_dvr__renew_classes(dvr);
    isogi_release(&dvr->context, marks, ISOGI_DVR__TABLE + 1, sizeof *marks);
    before = dvr->method, dvr->method = isogi_dvr__method_now(dvr);
    if (changed || dvr->method == ISOGI_DVR_BRUTE || dvr->method != before) isogi_dvr__begin_anew(dvr);
    return ISOGI_OK;
}

/* ==== directions of visibility rays ================================================================================== */

/* Weights of N directions that sum spherical harmonics up to a degree L exactly: equal weights, plus the smallest correction
   (in the sense of least squares) that makes it so. For a spherical Fibonacci lattice with N >= 2 (L+1)^2 the matrix of that
   problem is near a multiple of the identity, and a few Richardson steps solve it to rounding.
   y[directions][count] are the spherical harmonics, count = (L+1)^2. */
static void isogi_dvr__weigh(const double *y, size_t count, size_t directions, double *weight) {
    double residual[4 * ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER], last = 1e300;
    size_t i, k;
    int pass;
    for (k = 0; k < directions; k++) weight[k] = 4 * ISOGI_DVR__PI / (double)directions;
    for (pass = 0; pass < 64; pass++) {
        double size = 0;
        for (i = 0; i < count; i++) residual[i] = i ? 0 : 2 * sqrt(ISOGI_DVR__PI);
        for (k = 0; k < directions; k++)
            for (i = 0; i < count; i++) residual[i] -= weight[k] * y[k * count + i];
        for (i = 0; i < count; i++) size += residual[i] * residual[i];
        if (!(size < last) || size < 1e-30) break;
        last = size;
        for (k = 0; k < directions; k++) {
            double sum = 0;
            for (i = 0; i < count; i++) sum += residual[i] * y[k * count + i];
            weight[k] += 4 * ISOGI_DVR__PI / (double)directions * sum;
        }
    }
}

/* Spherical Fibonacci lattice: equal steps of height, golden angles of longitude. */
static void isogi_dvr__fibonacci(size_t k, size_t n, double world[3]) {
    double z = 1 - (2 * (double)k + 1) / (double)n, r = sqrt(1 - z * z);
    double turn = (double)k * 0.61803398874989484820, phi = 2 * ISOGI_DVR__PI * (turn - floor(turn));
    world[0] = r * cos(phi), world[1] = r * sin(phi), world[2] = z;
}

static size_t isogi_dvr__face_count(isogi_dvr_sphere sphere) {
    return sphere == ISOGI_DVR_TETRAHEDRON ? 4 : sphere == ISOGI_DVR_OCTAHEDRON ? 8 : 20;
}

/* The corners of a face of the solid, counterclockwise or not. */
static void isogi_dvr__face(isogi_dvr_sphere sphere, size_t face, double corner[3][3]) {
    static const signed char icosahedron[20][3] = {{0, 11, 5}, {0, 5, 1}, {0, 1, 7}, {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                                   {11, 10, 2}, {10, 7, 6}, {7, 1, 8}, {3, 9, 4}, {3, 4, 2}, {3, 2, 6}, {3, 6, 8},
                                                   {3, 8, 9}, {4, 9, 5}, {2, 4, 11}, {6, 2, 10}, {8, 6, 7}, {9, 8, 1}};
    const double golden = 1.61803398874989484820;
    int i, a;
    for (i = 0; i < 3; i++)
        for (a = 0; a < 3; a++) {
            if (sphere == ISOGI_DVR_TETRAHEDRON) { /* all corners of it but number `face`: of a cube, those with an even number of -1 */
                size_t c = (size_t)i < face ? (size_t)i : (size_t)i + 1;
                corner[i][a] = c == 0 || (int)c - 1 == a ? 1 : -1;
            } else if (sphere == ISOGI_DVR_OCTAHEDRON) corner[i][a] = i == a ? (face >> a & 1 ? -1 : 1) : 0;
            else { /* corners (-+1, +-golden, 0) and its cyclic shifts, four each */
                int c = icosahedron[face][i], group = c / 4, place = (a - group + 3) % 3; /* place: 0 small, 1 golden, 2 zero */
                double sign = place == 0 ? (c & 1 ? 1 : -1) : (c & 2 ? -1 : 1);
                corner[i][a] = place == 2 ? 0 : sign * (place == 1 ? golden : 1);
            }
        }
}

/* Direction k of a solid whose faces are divided into parts^2: the centre of a small face, and its area on the sphere
   (Van Oosterom and Strackee 1983). */
static double isogi_dvr__small_face(isogi_dvr_sphere sphere, size_t k, size_t parts, double world[3]) {
    double corner[3][3], p[3][3], dot[3], cross[3], length;
    size_t rest = k % (parts * parts), row = 0, i;
    int a, down;
    isogi_dvr__face(sphere, k / (parts * parts), corner);
    while (rest >= 2 * (parts - row) - 1) rest -= 2 * (parts - row) - 1, row++;
    down = (int)(rest & 1), rest /= 2;
    for (i = 0; i < 3; i++) {
        double u = (double)rest + (down ? i < 2 : i == 1), v = (double)row + (down ? i > 0 : i == 2);
        for (a = 0; a < 3; a++) p[i][a] = ((double)parts - u - v) * corner[0][a] + u * corner[1][a] + v * corner[2][a];
        length = sqrt(isogi_dvr__dot(p[i], p[i]));
        for (a = 0; a < 3; a++) p[i][a] /= length;
    }
    for (a = 0; a < 3; a++) world[a] = p[0][a] + p[1][a] + p[2][a];
    length = sqrt(isogi_dvr__dot(world, world));
    for (a = 0; a < 3; a++) world[a] /= length;
    for (i = 0; i < 3; i++) dot[i] = isogi_dvr__dot(p[i], p[(i + 1) % 3]);
    isogi_dvr__cross(p[1], p[2], cross);
    return 2 * atan2(fabs(isogi_dvr__dot(p[0], cross)), 1 + dot[0] + dot[1] + dot[2]);
}

/* area[directions]: their shares of the sphere; unused by the Fibonacci lattice. */
static void isogi_dvr__set_directions(isogi_dvr *d, double *area) {
    size_t n = (size_t)d->desc.directions, parts = 1, k;
    int a;
    if (d->desc.sphere != ISOGI_DVR_FIBONACCI)
        while (isogi_dvr__face_count(d->desc.sphere) * parts * parts < n) parts++;
    for (k = 0; k < n; k++) {
        double *world = d->direction[k] + 3;
        if (d->desc.sphere == ISOGI_DVR_FIBONACCI) isogi_dvr__fibonacci(k, n, world);
        else area[k] = isogi_dvr__small_face(d->desc.sphere, k, parts, world);
        /* as the isosurface rays have them: crossings and samples then share one line exactly */
        for (a = 0; a < 3; a++) world[a] = (double)(float)world[a];
        isogi_dvr__transform(d->to_grid, world, d->direction[k]);
    }
}

/* The axis that a direction is nearest to, in nodes of the lattice of extinction: slices lie across it. */
static int isogi_dvr__sweep_axis(const isogi_dvr *d, const double direction[3], double w[3]) {
    double most = 0;
    int axis = 2, a;
    for (a = 0; a < 3; a++) w[a] = direction[a] / d->matter.spacing[a];
    for (a = 0; a < 3; a++)
        if (fabs(w[a]) > most) most = fabs(w[a]), axis = a;
    return axis;
}

/* Puts the directions that are swept along x before the others; their areas move along. */
static void isogi_dvr__sort_directions(isogi_dvr *d, double *area) {
    size_t k;
    double w[3];
    for (k = 0, d->turned = 0; k < (size_t)d->desc.directions; k++) {
        double direction[6], moved = area[k];
        size_t to = d->turned;
        if (isogi_dvr__sweep_axis(d, d->direction[k], w) != 0) continue;
        memcpy(direction, d->direction[k], sizeof direction);
        memcpy(d->direction[k], d->direction[to], sizeof direction), memcpy(d->direction[to], direction, sizeof direction);
        area[k] = area[to], area[to] = moved, d->turned++;
    }
}

static isogi_result isogi_dvr__set_kernel(isogi_dvr *d) {
    size_t n = (size_t)d->desc.directions, order = 1, count, k, i;
    double *y, *weight;
    while (order + 1 < 2 * (size_t)d->desc.order && 2 * (order + 1) * (order + 1) <= n) order++;
    /* the table serves the weights and then the kernel, whose order may be the larger one */
    count = order > (size_t)d->desc.order ? order : (size_t)d->desc.order;
    count *= count;
    y = (double *)isogi_allocate(&d->context, n * count, sizeof *y);
    weight = (double *)isogi_allocate(&d->context, 4 * n, sizeof *weight);
    if (!y || !weight) {
        isogi_release(&d->context, y, n * count, sizeof *y);
        isogi_release(&d->context, weight, 4 * n, sizeof *weight);
        return ISOGI_NO_MEMORY;
    }
    isogi_dvr__set_directions(d, weight);
    if (isogi_dvr__method(d) == ISOGI_DVR_SWEEP) isogi_dvr__sort_directions(d, weight);
    for (k = 0; k < n; k++) memcpy(weight + n + 3 * k, d->direction[k] + 3, 3 * sizeof *weight);
    isogi_sh_eval_f64(y, (int)order, (const double(*)[3])(weight + n), n);
    if (d->desc.sphere == ISOGI_DVR_FIBONACCI) isogi_dvr__weigh(y, order * order, n, weight);
    isogi_sh_eval_f64(y, d->desc.order, (const double(*)[3])(weight + n), n);
    for (k = 0; k < n; k++)
        for (i = 0; i < d->coefficients; i++) {
            d->kernel[k * d->coefficients + i] = (float)(weight[k] * y[k * d->coefficients + i]);
            if (d->basis) d->basis[k * d->coefficients + i] = (float)y[k * d->coefficients + i];
        }
    isogi_release(&d->context, y, n * count, sizeof *y);
    isogi_release(&d->context, weight, 4 * n, sizeof *weight);
    return ISOGI_OK;
}

/* ==== vector kernels ================================================================================================= */

/* For every row, depth[i] += extinction between four nodes of two rows, with the weights times the length of the piece in w. Vectors run
   over the end of a row: the first float there is put back, the others add padding or, in windows, what nobody reads. */
static void isogi_dvr__pass(const isogi_dvr__rows *a, const float w[4]) {
    size_t c, i;
    for (c = 0; c < a->rows; c++) {
        const float *r0 = a->from + c * a->from_row, *r1 = r0 + a->beside;
        float *depth = a->depth + c * a->depth_row;
        for (i = 0; i < a->count; i++) depth[i] += (w[0] * r0[i] + w[1] * r0[i + 1]) + (w[2] * r1[i] + w[3] * r1[i + 1]);
    }
}

/* exp(-x) for x >= 0; below 2^-80 it is that: shares of it times weights (1e-6) are still normal numbers. Relative error 2e-7. */
static float isogi_dvr__exp(float x) {
    float y = x * -1.44269504f, f, p;
    int32_t n;
    y = y > -80 ? y : -80;
    n = (int32_t)(y - 0.5f), f = y - (float)n;
    p = 1.54035304e-4f * f + 1.33335581e-3f, p = p * f + 9.61812911e-3f, p = p * f + 5.55041087e-2f;
    p = p * f + 2.40226507e-1f, p = p * f + 6.93147182e-1f, p = p * f + 1;
    n = (n + 127) << 23;
    memcpy(&f, &n, sizeof f);
    return p * f;
}

static void isogi_dvr__exp_row(float *x, size_t count) {
    size_t i;
    for (i = 0; i < count; i++) x[i] = isogi_dvr__exp(x[i]);
}

/* What a ray counts for at a grid point beside it. Where matter ends between the two, the ray within knows nothing of what arrives outside.
   depth: of half a piece of the ray; up to ISOGI_DVR__MOST_DEPTH, lest its square overflow. */
#define ISOGI_DVR__COUNTS(depth) (1.0f / (1.0f + 16.0f * (depth) * (depth)) * 0.999999f + 1e-6f)
#define ISOGI_DVR__MOST_DEPTH 1024.0f

static float isogi_dvr__counts(float depth) {
    depth = depth < ISOGI_DVR__MOST_DEPTH ? depth : ISOGI_DVR__MOST_DEPTH;
    return ISOGI_DVR__COUNTS(depth);
}

/* The same as above twice, and between the two what is left of the light, weighed, and its weight. */
static void isogi_dvr__pass_out(const isogi_dvr__rows *a, const float w[4]) {
    size_t c, i;
    for (c = 0; c < a->rows; c++) {
        const float *r0 = a->from + c * a->from_row, *r1 = r0 + a->beside;
        float *depth = a->depth + c * a->depth_row, *out = a->out + c * a->out_row;
        for (i = 0; i < a->count; i++) {
            float more = (w[0] * r0[i] + w[1] * r0[i + 1]) + (w[2] * r1[i] + w[3] * r1[i + 1]);
            float weight = isogi_dvr__counts(more);
            out[i] = weight * isogi_dvr__exp(depth[i] + more), out[a->weight + i] = weight, depth[i] += 2 * more;
        }
    }
}

/* Between the rows and columns of `from`, past the second of each by a share of `part` towards the first. */
static void isogi_dvr__between(const isogi_dvr__rows *a, const float part[2]) {
    size_t c, i;
    for (c = 0; c < a->rows; c++) {
        const float *r0 = a->from + c * a->from_row, *r1 = r0 + a->from_row;
        for (i = 0; i < a->count; i++) {
            const float *w0 = r0 + a->weight + i, *w1 = r1 + a->weight + i;
            float x0 = r0[i + 1] + part[1] * (r0[i] - r0[i + 1]), x1 = r1[i + 1] + part[1] * (r1[i] - r1[i + 1]);
            float y0 = w0[1] + part[1] * (w0[0] - w0[1]), y1 = w1[1] + part[1] * (w1[0] - w1[1]);
            a->out[c * a->out_row + i] = (x1 + part[0] * (x0 - x1)) / (y1 + part[0] * (y0 - y1));
        }
    }
}

/* For rays of a packet the first sample from `next` on that may see something: the last one before the ray leaves the empty blocks
   around it. The sample after it is what is looked at: a piece may end in matter. Returns how many rays have found it; where none has,
   all are done. Rays that have not may go on next time. */
static int isogi_dvr__leap(const isogi_dvr *d, isogi_dvr__packet *p, isogi_counters *work) {
    const isogi_level *level = &d->level[0];
    int k, found = 0;
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        int first = p->at[k], i = first, count = p->count[k];
        while (i < count) {
            float exit = (float)count;
            int c[3], a, free;
            for (a = 0; a < 3; a++) {
                float x = p->origin[a][k] + (float)i * p->dir[a][k];
                x = x > 0 ? x : 0;
                c[a] = (int)x >> 2;
                c[a] = c[a] < (int)level->size[a] ? c[a] : (int)level->size[a] - 1;
            }
            free = d->leap[(size_t)c[0] + level->size[0] * ((size_t)c[1] + level->size[1] * (size_t)c[2])];
            work->blocks++;
            if (!free) break;
            work->blocks_skipped++;
            for (a = 0; a < 3; a++) {
                float border = (float)(4 * (p->inverse[a][k] > 0 ? c[a] + free : c[a] - free + 1)),
                      t = (border - p->origin[a][k]) * p->inverse[a][k];
                exit = t < exit ? t : exit;
            }
            i = ((int)exit > i ? (int)exit : i) + 1;
        }
        p->next[k] = i >= count ? count : i > first ? i - 1 : first;
        p->at[k] = p->next[k];
        if (i < count) p->found[found++] = (uint8_t)k;
    }
    return found;
}

static void isogi_dvr__gather(const isogi_dvr__sums *a) {
    size_t c, k, i;
    for (c = 0; c < a->coefficients; c++)
        for (k = 0; k < a->directions; k++)
            for (i = 0; i < a->count; i++) a->sum[c * a->sum_row + i] += a->kernel[k * a->coefficients + c] * a->from[k * a->from_row + i];
}

/* What rays let through: clear[0 .. count - 1], and up to the end of a vector anything. */
static void isogi_dvr__local(const isogi_dvr__local_rays *a, float *clear) {
    size_t i, j;
    for (i = 0; i < a->count; i++) {
        float depth = 0;
        for (j = 0; j < a->steps; j++) {
            const float *p = a->at + a->step[j].offset + i, *q = p + a->plane, *w = a->step[j].weight;
            if (a->within && ((int32_t)i < a->within[j][0] || (int32_t)i >= a->within[j][1])) continue;
            depth += ((w[0] * p[0] + w[1] * p[1]) + (w[2] * p[a->row] + w[3] * p[a->row + 1])) +
                     ((w[4] * q[0] + w[5] * q[1]) + (w[6] * q[a->row] + w[7] * q[a->row + 1]));
        }
        clear[i] = isogi_dvr__exp(depth);
    }
}

#ifdef ISOGI_DVR__VECTORS
/* e = exp(-x) */
#define ISOGI_DVR__EXP(e, x)                                                                                    \
    {                                                                                                           \
        isogi_dvr__floats y = (x) * -1.44269504f, f, p, least = {0};                                            \
        isogi_dvr__ints n, in = y > -80.0f;                                                                     \
        least -= 80.0f;                                                                                         \
        y = (isogi_dvr__floats)(((isogi_dvr__ints)y & in) | ((isogi_dvr__ints)least & ~in));                    \
        n = __builtin_convertvector(y - 0.5f, isogi_dvr__ints), f = y - __builtin_convertvector(n, isogi_dvr__floats); \
        p = 1.54035304e-4f * f + 1.33335581e-3f, p = p * f + 9.61812911e-3f, p = p * f + 5.55041087e-2f;        \
        p = p * f + 2.40226507e-1f, p = p * f + 6.93147182e-1f, p = p * f + 1.0f;                               \
        e = p * (isogi_dvr__floats)((n + 127) << 23);                                                           \
    }
/* x >= 0, but ISOGI_DVR__MOST_DEPTH at most; bits of such floats are in their order. */
#define ISOGI_DVR__LESS(less, x)                                                                                \
    {                                                                                                           \
        isogi_dvr__floats most = {0};                                                                           \
        isogi_dvr__ints in;                                                                                     \
        most += ISOGI_DVR__MOST_DEPTH, in = ((isogi_dvr__ints)(x) - (isogi_dvr__ints)most) >> 31;               \
        less = (isogi_dvr__floats)(((isogi_dvr__ints)(x) & in) | ((isogi_dvr__ints)most & ~in));                \
    }
#define ISOGI_DVR__MORE                                                                  \
    ((w[0] * ISOGI_DVR__C(r0 + i) + w[1] * ISOGI_DVR__C(r0 + i + 1)) +                   \
     (w[2] * ISOGI_DVR__C(r0 + a->beside + i) + w[3] * ISOGI_DVR__C(r0 + a->beside + i + 1)))
#define ISOGI_DVR__CI(p) (*(const isogi_dvr__ints *)(const void *)(p))
#define ISOGI_DVR__KERNELS(SUFFIX, TARGET)                                                                                          \
    TARGET static void isogi_dvr__pass##SUFFIX(const isogi_dvr__rows *a, const float weight[4]) {                                  \
        const float w[4] = {weight[0], weight[1], weight[2], weight[3]};                                                            \
        size_t c, i;                                                                                                                \
        for (c = 0; c < a->rows; c++) {                                                                                             \
            const float *r0 = a->from + c * a->from_row;                                                                            \
            float *depth = a->depth + c * a->depth_row, outside = depth[a->count];                                                  \
            for (i = 0; i < a->count; i += ISOGI_DVR__LANES) ISOGI_DVR__V(depth + i) += ISOGI_DVR__MORE;                            \
            depth[a->count] = outside;                                                                                              \
        }                                                                                                                           \
    }                                                                                                                               \
    TARGET static void isogi_dvr__pass_out##SUFFIX(const isogi_dvr__rows *a, const float share[4]) {                               \
        const float w[4] = {share[0], share[1], share[2], share[3]};                                                                \
        size_t c, i;                                                                                                                \
        for (c = 0; c < a->rows; c++) {                                                                                             \
            const float *r0 = a->from + c * a->from_row;                                                                            \
            float *depth = a->depth + c * a->depth_row, *out = a->out + c * a->out_row, outside = depth[a->count];                  \
            for (i = 0; i < a->count; i += ISOGI_DVR__LANES) {                                                                      \
                isogi_dvr__floats more = ISOGI_DVR__MORE, x = ISOGI_DVR__C(depth + i) + more, e, less, weight;                      \
                ISOGI_DVR__LESS(less, more)                                                                                         \
                weight = ISOGI_DVR__COUNTS(less);                                                                                   \
                ISOGI_DVR__EXP(e, x)                                                                                                \
                ISOGI_DVR__V(out + i) = e * weight, ISOGI_DVR__V(out + a->weight + i) = weight, ISOGI_DVR__V(depth + i) = x + more; \
            }                                                                                                                       \
            depth[a->count] = outside;                                                                                              \
        }                                                                                                                           \
    }                                                                                                                               \
    TARGET static void isogi_dvr__between##SUFFIX(const isogi_dvr__rows *a, const float part[2]) {                                  \
        const float p0 = part[0], p1 = part[1];                                                                                     \
        size_t c, i;                                                                                                                \
        for (c = 0; c < a->rows; c++)                                                                                               \
            for (i = 0; i < a->count; i += ISOGI_DVR__LANES) {                                                                      \
                const float *r0 = a->from + c * a->from_row + i, *r1 = r0 + a->from_row;                                            \
                isogi_dvr__floats x0 = ISOGI_DVR__C(r0 + 1), x1 = ISOGI_DVR__C(r1 + 1);                                             \
                isogi_dvr__floats y0 = ISOGI_DVR__C(r0 + a->weight + 1), y1 = ISOGI_DVR__C(r1 + a->weight + 1);                     \
                x0 += p1 * (ISOGI_DVR__C(r0) - x0), x1 += p1 * (ISOGI_DVR__C(r1) - x1), x1 += p0 * (x0 - x1);                       \
                y0 += p1 * (ISOGI_DVR__C(r0 + a->weight) - y0), y1 += p1 * (ISOGI_DVR__C(r1 + a->weight) - y1);                     \
                x1 /= y1 + p0 * (y0 - y1);                                                                                          \
                if (a->count - i >= ISOGI_DVR__LANES) ISOGI_DVR__V(a->out + c * a->out_row + i) = x1;                               \
                else memcpy(a->out + c * a->out_row + i, &x1, (a->count - i) * sizeof(float));                                      \
            }                                                                                                                       \
    }                                                                                                                               \
    TARGET static void isogi_dvr__exp_row##SUFFIX(float *x, size_t count) {                                                         \
        size_t i;                                                                                                                   \
        for (i = 0; i < count; i += ISOGI_DVR__LANES) ISOGI_DVR__EXP(ISOGI_DVR__V(x + i), ISOGI_DVR__C(x + i))                      \
    }                                                                                                                               \
    TARGET static void isogi_dvr__gather##SUFFIX(const isogi_dvr__sums *a) {                                                        \
        size_t n = a->coefficients, c, k, i;                                                                                        \
        for (i = 0; i < a->count; i += ISOGI_DVR__LANES) {                                                                          \
            for (c = 0; c + 4 <= n; c += 4) { /* four sums in registers */                                                          \
                float *sum = a->sum + c * a->sum_row + i, *at1 = sum + a->sum_row, *at2 = at1 + a->sum_row, *at3 = at2 + a->sum_row; \
                isogi_dvr__floats s0 = ISOGI_DVR__C(sum), s1 = ISOGI_DVR__C(at1), s2 = ISOGI_DVR__C(at2), s3 = ISOGI_DVR__C(at3);   \
                for (k = 0; k < a->directions; k++) {                                                                               \
                    isogi_dvr__floats x = ISOGI_DVR__C(a->from + k * a->from_row + i);                                              \
                    const float *w = a->kernel + k * n + c;                                                                         \
                    s0 += w[0] * x, s1 += w[1] * x, s2 += w[2] * x, s3 += w[3] * x;                                                 \
                }                                                                                                                   \
                ISOGI_DVR__V(sum) = s0, ISOGI_DVR__V(at1) = s1, ISOGI_DVR__V(at2) = s2, ISOGI_DVR__V(at3) = s3;                     \
            }                                                                                                                       \
            for (; c < n; c++) {                                                                                                    \
                isogi_dvr__floats s0 = ISOGI_DVR__C(a->sum + c * a->sum_row + i);                                                   \
                for (k = 0; k < a->directions; k++) s0 += a->kernel[k * n + c] * ISOGI_DVR__C(a->from + k * a->from_row + i);       \
                ISOGI_DVR__V(a->sum + c * a->sum_row + i) = s0;                                                                     \
            }                                                                                                                       \
        }                                                                                                                           \
    }                                                                                                                               \
    TARGET static void isogi_dvr__local##SUFFIX(const isogi_dvr__local_rays *a, float *clear) { \
        static const int32_t lane[ISOGI_DVR__LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}; \
        size_t i, j; \
        for (i = 0; i < a->count; i += ISOGI_DVR__LANES) { \
            const isogi_dvr__ints number = ISOGI_DVR__CI(lane) + (int32_t)i; \
            isogi_dvr__floats depth = {0}; \
            for (j = 0; j < a->steps; j++) { \
                const float *p = a->at + a->step[j].offset + i, *q = p + a->plane, *p1 = p + a->row, *q1 = q + a->row, \
                    *w = a->step[j].weight; \
                isogi_dvr__floats more; \
                if (a->within && (a->within[j][1] <= (int32_t)i || a->within[j][0] >= (int32_t)i + ISOGI_DVR__LANES)) continue; \
                more = ((w[0] * ISOGI_DVR__C(p) + w[1] * ISOGI_DVR__C(p + 1)) + \
                        (w[2] * ISOGI_DVR__C(p1) + w[3] * ISOGI_DVR__C(p1 + 1))) + \
                       ((w[4] * ISOGI_DVR__C(q) + w[5] * ISOGI_DVR__C(q + 1)) + \
                        (w[6] * ISOGI_DVR__C(q1) + w[7] * ISOGI_DVR__C(q1 + 1))); \
                if (a->within && (a->within[j][0] > (int32_t)i || a->within[j][1] < (int32_t)i + ISOGI_DVR__LANES)) \
                    more = (isogi_dvr__floats)((isogi_dvr__ints)more & \
                                               (((a->within[j][0] - 1 - number) & (number - a->within[j][1])) >> 31)); \
                depth += more; \
            } \
            ISOGI_DVR__EXP(ISOGI_DVR__V(clear + i), depth) \
        } \
    } \
    static void isogi_dvr__set_kernels##SUFFIX(isogi_dvr__kernels *k) {                                                             \
        k->pass = isogi_dvr__pass##SUFFIX, k->pass_out = isogi_dvr__pass_out##SUFFIX, k->between = isogi_dvr__between##SUFFIX;      \
        k->exp_row = isogi_dvr__exp_row##SUFFIX, k->gather = isogi_dvr__gather##SUFFIX, k->local = isogi_dvr__local##SUFFIX;         \
    }
ISOGI_DVR__KERNELS(_base, )
#ifdef ISOGI_DVR__AVX
ISOGI_DVR__KERNELS(_avx2, __attribute__((target("avx2,fma"))))
ISOGI_DVR__KERNELS(_avx512, __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,fma"))))
#define ISOGI_DVR__AVX512 __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,fma"))) static
#define ISOGI_DVR__ALWAYS __attribute__((always_inline)) inline

/* One leap of the rays k .. k + 15 of a packet that are still going: what of them has to leap again. */
ISOGI_DVR__AVX512 ISOGI_DVR__ALWAYS __mmask16 isogi_dvr__leap_once_avx512(const isogi_dvr *d, const isogi_dvr__packet *p, int k,
                                                                          __mmask16 going, __m512i *sample, isogi_counters *work) {
    const isogi_level *level = &d->level[0];
    const __m512i count = _mm512_loadu_si512(p->count + k), one = _mm512_set1_epi32(1);
    const __m512 at = _mm512_maskz_cvtepi32_ps(0xffff, *sample);
    __m512i c[3], number = _mm512_setzero_si512(), free, to;
    __m512 exit = _mm512_maskz_cvtepi32_ps(0xffff, count);
    const int *leap = (const int *)(const void *)d->leap;
    __m256i half[2];
    int32_t block[16];
    __mmask16 move;
    int a;
    for (a = 2; a >= 0; a--) {
        __m512 x = _mm512_add_ps(_mm512_loadu_ps(p->origin[a] + k), _mm512_mul_ps(at, _mm512_loadu_ps(p->dir[a] + k)));
        c[a] = _mm512_maskz_cvttps_epi32(0xffff, _mm512_maskz_max_ps(0xffff, x, _mm512_setzero_ps()));
        c[a] = _mm512_maskz_min_epi32(0xffff, _mm512_maskz_srli_epi32(0xffff, c[a], 2), _mm512_set1_epi32((int)(level->size[a] - 1)));
        number = _mm512_add_epi32(c[a], _mm512_mullo_epi32(number, _mm512_set1_epi32((int)level->size[a])));
    }
    /* three bytes more are read after each, of what is behind them in the same memory */
    _mm512_storeu_si512(block, number);
    half[0] = _mm256_loadu_si256((const __m256i *)(const void *)block), half[0] = _mm256_i32gather_epi32(leap, half[0], 1);
    half[1] = _mm256_loadu_si256((const __m256i *)(const void *)(block + 8)), half[1] = _mm256_i32gather_epi32(leap, half[1], 1);
    free = _mm512_mask_broadcast_i64x4(_mm512_castsi256_si512(half[0]), 0xf0, half[1]);
    free = _mm512_and_si512(free, _mm512_set1_epi32(255));
    move = _mm512_mask_cmpgt_epi32_mask(going, free, _mm512_setzero_si512());
    for (a = 0; a < 3; a++) {
        const __m512 inverse = _mm512_loadu_ps(p->inverse[a] + k);
        const __mmask16 up = _mm512_cmp_ps_mask(inverse, _mm512_setzero_ps(), _CMP_GT_OQ);
        __m512i border = _mm512_mask_add_epi32(_mm512_add_epi32(_mm512_sub_epi32(c[a], free), one), up, c[a], free);
        __m512 t = _mm512_maskz_cvtepi32_ps(0xffff, _mm512_maskz_slli_epi32(0xffff, border, 2));
        exit = _mm512_maskz_min_ps(0xffff, _mm512_mul_ps(_mm512_sub_ps(t, _mm512_loadu_ps(p->origin[a] + k)), inverse), exit);
    }
    to = _mm512_add_epi32(_mm512_maskz_max_epi32(0xffff, _mm512_maskz_cvttps_epi32(0xffff, exit), *sample), one);
    *sample = _mm512_mask_mov_epi32(*sample, move, to);
    work->blocks += (uint64_t)__builtin_popcount(going), work->blocks_skipped += (uint64_t)__builtin_popcount(move);
    return _mm512_mask_cmplt_epi32_mask(move, *sample, count);
}

/* As isogi_dvr__leap. Two vectors side by side: each waits long for its bytes. Those rays that have found matter by then do not wait for
   the last three quarters of the others, which go on next time, beside rays that have passed some matter. */
ISOGI_DVR__AVX512 int isogi_dvr__leap_avx512(const isogi_dvr *d, isogi_dvr__packet *p, isogi_counters *work) {
    __m512i sample[2];
    __mmask16 all[2], going[2];
    uint32_t found, left;
    int k, most, count = 0;
    for (k = 0; k < 2; k++)
        sample[k] = _mm512_loadu_si512(p->at + 16 * k),
        all[k] = going[k] = _mm512_cmplt_epi32_mask(sample[k], _mm512_loadu_si512(p->count + 16 * k));
    most = __builtin_popcount((uint32_t)all[0] | (uint32_t)all[1] << 16) * 6 / 8;
    do {
        for (k = 0, found = left = 0; k < 2; k++) {
            going[k] = isogi_dvr__leap_once_avx512(d, p, 16 * k, going[k], &sample[k], work);
            found |= (uint32_t)(_mm512_cmplt_epi32_mask(sample[k], _mm512_loadu_si512(p->count + 16 * k)) & ~going[k]) << 16 * k;
            left |= (uint32_t)going[k] << 16 * k;
        }
    } while (left && (!found || __builtin_popcount(left) > most));
    for (k = 0; k < 2; k++) {
        const __m512i next = _mm512_loadu_si512(p->next + 16 * k), end = _mm512_loadu_si512(p->count + 16 * k);
        const __mmask16 moved = _mm512_cmpgt_epi32_mask(sample[k], _mm512_loadu_si512(p->at + 16 * k));
        const __m512i to = _mm512_mask_sub_epi32(next, moved, sample[k], _mm512_set1_epi32(1));
        _mm512_storeu_si512(p->next + 16 * k, _mm512_maskz_min_epi32(0xffff, to, end));
        _mm512_storeu_si512(p->at + 16 * k, sample[k]);
    }
    for (; found; found &= found - 1) p->found[count++] = (uint8_t)__builtin_ctz(found);
    return count;
}
#undef ISOGI_DVR__AVX512
#undef ISOGI_DVR__ALWAYS
#endif
#undef ISOGI_DVR__KERNELS
#undef ISOGI_DVR__MORE
#undef ISOGI_DVR__LESS
#undef ISOGI_DVR__CI
#undef ISOGI_DVR__EXP
#endif

static isogi_dvr__kernels isogi_dvr__choose_kernels(int force_path) {
    isogi_dvr__kernels k = {isogi_dvr__pass, isogi_dvr__pass_out, isogi_dvr__between, isogi_dvr__exp_row,
                            isogi_dvr__leap, isogi_dvr__gather,   isogi_dvr__local};
#ifdef ISOGI_DVR__VECTORS
    if (force_path == 1) return k;
    isogi_dvr__set_kernels_base(&k);
#ifdef ISOGI_DVR__AVX
    if (force_path == 2) return k;
    if (isogi_dvr__machine() >= 3) isogi_dvr__set_kernels_avx2(&k);
    if (force_path == 3 || isogi_dvr__machine() < 4) return k;
    isogi_dvr__set_kernels_avx512(&k);
    k.leap = isogi_dvr__leap_avx512;
#endif
#endif
    (void)force_path;
    return k;
}

/* ==== matter: extinction on a lattice ================================================================================ */

/* Sweeps read extinction from a lattice of their own, a whole number of steps to each distance of the visibility grid (so that grid
   points are nodes) and about `visibility_step` of the smallest voxels wide; two to a voxel suffice where voxels are long. A node holds
   the mean extinction of the box around it: values are interpolated first and classified after, at points about a voxel apart. Rows are
   padded with zeros, because vectors run over their ends. Two layouts: x fastest, for directions mostly along y or z, and z fastest, for
   those along x. */

/* World length of a voxel's edge along a grid axis. */
static double isogi_dvr__edge(const isogi_volume *v, int axis) {
    const double *m = v->axes + axis;
    return v->spacing[axis] * sqrt(m[0] * m[0] + m[3] * m[3] + m[6] * m[6]);
}

/* The smallest distance of neighbouring voxels; of a single voxel, which has no neighbour, what its spacing says. */
static double isogi_dvr__shortest_edge(const isogi_volume *v) {
    double shortest = 0;
    int a;
    for (a = 0; a < 3; a++) {
        double length = isogi_dvr__edge(v, a);
        if (v->size[a] > 1 && (!(shortest > 0) || length < shortest)) shortest = length;
    }
    return shortest > 0 ? shortest : isogi_dvr__edge(v, 0);
}

static isogi_result isogi_dvr__plan_matter(isogi_dvr *d) {
    isogi_dvr__matter *m = &d->matter;
    double step = d->desc.visibility_step > 0 ? d->desc.visibility_step : 2;
    int a, n;
    for (a = 0; a < 3; a++) {
        const double nodes = isogi_dvr__edge(&d->volume, a) / (step * d->spacing), most = step < 0.5 ? 1 / step : 2; /* a voxel */
        size_t points = d->desc.grid[a], intervals = points > 1 ? points - 1 : 2;
        m->every[a] = (size_t)isogi_dvr__clamp(d->cells[a] * (nodes < most ? nodes : most) / (double)intervals + 0.5, 65536);
        if (!m->every[a]) m->every[a] = 1;
        if (m->every[a] > 65536 / intervals) return ISOGI_TOO_LARGE;
        m->size[a] = intervals * m->every[a] + 1;
        m->first[a] = points > 1 ? 0 : m->every[a];
        m->spacing[a] = (double)d->cells[a] / (double)(m->size[a] - 1);
    }
    for (n = 0; n < 2; n++) {
        size_t rows = m->size[1] * m->size[n ? 0 : 2];
        m->row[n] = (m->size[n ? 2 : 0] / ISOGI_DVR__LANES + 2) * ISOGI_DVR__LANES;
        if (rows > SIZE_MAX / 64 / m->row[n]) return ISOGI_TOO_LARGE;
        m->count[n] = rows * m->row[n];
        m->extinction[n] = (float *)isogi_allocate(&d->context, m->count[n], sizeof(float));
        if (!m->extinction[n]) return ISOGI_NO_MEMORY;
        memset(m->extinction[n], 0, m->count[n] * sizeof(float));
    }
    return ISOGI_OK;
}

#define ISOGI_DVR__READ_ROW(T)                                                                                                   \
    for (i = 0; i < count; i++) out[i] = (float)(v->scale * (double)*(const T *)(const void *)(p + (ptrdiff_t)i * v->stride[0]) + \
        v->bias - low); \
    break;

/* Voxels first .. first + count - 1 of a row, as floats that count from `low`. What is not finite stays so. */
static void isogi_dvr__read_row(const isogi_volume *v, double low, size_t first, size_t count, size_t y, size_t z, float *out) {
    const char *p = (const char *)v->data + (ptrdiff_t)first * v->stride[0] + (ptrdiff_t)y * v->stride[1] + (ptrdiff_t)z * v->stride[2];
    size_t i;
    switch (v->type) {
    case ISOGI_U8: ISOGI_DVR__READ_ROW(uint8_t)
    case ISOGI_I8: ISOGI_DVR__READ_ROW(int8_t)
    case ISOGI_U16: ISOGI_DVR__READ_ROW(uint16_t)
    case ISOGI_I16: ISOGI_DVR__READ_ROW(int16_t)
    case ISOGI_F32: ISOGI_DVR__READ_ROW(float)
    case ISOGI_F64: ISOGI_DVR__READ_ROW(double)
    }
}
#undef ISOGI_DVR__READ_ROW

/* ==== flat blocks of several levels (Kronander 2011, 4.1, after Ljung et al. 2004) =================================== */

/* A block is one of the pyramid's level 1: 16^3 cells. At level n (16, 8, 4, 2 or 1) it is held at (n + 1)^3 nodes, 16 / n voxels apart,
   or where the volume's border cuts it, at those of them that surround what is left; at level 0 it is not held. It repeats the nodes of
   its upper faces from its neighbours, so that a sample never leaves its block. Where blocks of different levels meet, the nodes on
   their common face (edge, corner) take what the coarsest of them has there, between its nodes too: both sides then interpolate the
   same function, and there is no seam. Blocks are therefore finished from coarse to fine. */

/* Averages of the data on coarser lattices: nodes 2^step voxels apart, over the blocks' whole extent; each is the last one halved with
   weights 1/4, 1/2, 1/4, which keeps linear fields. At the border the field goes on by reflection in its last value where a block ends
   with the volume, else by repeating it. What is not finite is left out; where nothing else is, a node is not finite either, and
   transparent. */
static size_t isogi_dvr__lattice_index(const isogi_dvr__blocks *b, int step, const size_t c[3]) {
    const size_t *size = b->lattice_size[step];
    return c[0] + size[0] * (c[1] + size[1] * c[2]);
}

/* Intervals between the nodes of a block of level n: n, but fewer where the volume ends within it. */
static void isogi_dvr__sides(const isogi_dvr__blocks *b, size_t block, size_t n, size_t side[3]) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]};
    int a;
    for (a = 0; a < 3; a++) side[a] = at[a] + 1 < b->count[a] ? n : (b->rest[a] * n + 15) / 16;
}

/* The field at a voxel, less the base, as all data in blocks. */
static float isogi_dvr__voxel(const isogi_dvr *d, size_t x, size_t y, size_t z) {
    float value;
    isogi_dvr__read_row(&d->volume, d->base, x < d->volume.size[0] ? x : d->volume.size[0] - 1, 1,
                        y < d->volume.size[1] ? y : d->volume.size[1] - 1, z < d->volume.size[2] ? z : d->volume.size[2] - 1, &value);
    return value;
}

static float isogi_dvr__lattice_at(const isogi_dvr *d, int step, const size_t c[3]) {
    return step ? d->blocks.lattice[step][isogi_dvr__lattice_index(&d->blocks, step, c)] : isogi_dvr__voxel(d, c[0], c[1], c[2]);
}

typedef struct isogi_dvr__lattice_job {
    isogi_dvr *dvr;
    int step;
} isogi_dvr__lattice_job;

/* One plane of a lattice from the next finer one. */
static void isogi_dvr__lattice_task(void *arg, size_t z) {
    const isogi_dvr__lattice_job *job = (const isogi_dvr__lattice_job *)arg;
    isogi_dvr__blocks *b = &job->dvr->blocks;
    const size_t *size = b->lattice_size[job->step], *fine = b->lattice_size[job->step - 1];
    size_t c[3], from[3];
    int k, a;
    c[2] = z;
    for (c[1] = 0; c[1] < size[1]; c[1]++)
        for (c[0] = 0; c[0] < size[0]; c[0]++) {
            float sum = 0, weights = 0, value = 0;
            for (k = 0; k < 27; k++) {
                int o[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
                float weight = 0.125f;
                for (a = 0; a < 3; a++) {
                    if (!c[a] || 2 * c[a] + 1 >= fine[a]) { /* reflected: only the middle counts */
                        weight *= o[a] ? 0.0f : 2.0f;
                        from[a] = 2 * c[a];
                    } else weight *= o[a] ? 0.5f : 1.0f, from[a] = (size_t)((ptrdiff_t)(2 * c[a]) + o[a]);
                }
                if (!(weight > 0)) continue;
                value = isogi_dvr__lattice_at(job->dvr, job->step - 1, from);
                if (isogi_dvr__finite32(value)) sum += weight * value, weights += weight;
            }
            if (weights > 0) value = weights < 1 ? sum / weights : sum;
            b->lattice[job->step][isogi_dvr__lattice_index(b, job->step, c)] = value;
        }
}

/* Divides the classes among 64 bins but NOT_FINITE, half by their number and half by how much opacity changes across them, so that no tent
   is lost in a bin that is mostly air. A change of colours alone leaves bins as they are. */
static void isogi_dvr__set_bins(const isogi_dvr *d, uint8_t bin[ISOGI_DVR__TABLE]) {
    double sum = 0, total = 0, last = 0;
    size_t i;
    int pass;
    for (pass = 0; pass < 2; pass++)
        for (i = 0, sum = 0; i < ISOGI_DVR__TABLE; i++) {
            double opacity = -expm1(-(double)d->matter.table[i] * d->spacing / d->desc.unit);
            sum += i ? fabs(opacity - last) : 0, last = opacity;
            if (!pass) total = sum;
            else
                bin[i] = (uint8_t)isogi_dvr__clamp(
                    1 + 61 * (total > 0 ? 0.5 * (double)i / ISOGI_DVR__TABLE + 0.5 * sum / total : (double)i / ISOGI_DVR__TABLE), 61);
        }
    bin[0] = 0, bin[ISOGI_DVR__TABLE - 1] = 63; /* what lies outside of the function's span is all alike */
}

/* Which bins of values occur in a block: the piecewise constant histogram, of which the largest difference needs no counts. */
static void isogi_dvr__histogram_task(void *arg, size_t task) {
    isogi_dvr *d = (isogi_dvr *)arg;
    isogi_dvr__blocks *b = &d->blocks;
    size_t block = b->counted + task, at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]},
           count, x, y, z;
    uint64_t classes = 0;
    float row[17];
    count = d->volume.size[0] - 16 * at[0] < 17 ? d->volume.size[0] - 16 * at[0] : 17;
    for (z = 16 * at[2]; z <= 16 * at[2] + 16 && z < d->volume.size[2]; z++)
        for (y = 16 * at[1]; y <= 16 * at[1] + 16 && y < d->volume.size[1]; y++) {
            isogi_dvr__read_row(&d->volume, d->base, 16 * at[0], count, y, z, row);
            for (x = 0; x < count; x++)
                classes |= (uint64_t)1 << (isogi_dvr__finite32(row[x]) ? b->bin[isogi_dvr__class(d, d->base + (double)row[x])]
                                                                       : ISOGI_DVR__NOT_FINITE);
        }
    b->histogram[block] = classes;
}

static void isogi_dvr__free_blocks(isogi_dvr *d) {
    isogi_dvr__blocks *b = &d->blocks;
    int n;
    for (n = 1; n < 5; n++)
        isogi_release(&d->context, b->lattice[n], b->lattice_size[n][0] * b->lattice_size[n][1] * b->lattice_size[n][2], sizeof(float));
    isogi_release(&d->context, b->histogram, b->total, sizeof *b->histogram);
    isogi_release(&d->context, b->level, 3 * b->total, 1);
    isogi_release(&d->context, b->first, 2 * b->total, sizeof *b->first);
    isogi_release(&d->context, b->order, b->total, sizeof *b->order);
    isogi_release(&d->context, b->data, b->data_count, sizeof *b->data);
    isogi_release(&d->context, b->sh, b->sh_count * d->coefficients, sizeof *b->sh);
    memset(b, 0, sizeof *b);
}

/* Everything that does not depend on the transfer function. */
static isogi_result isogi_dvr__plan_blocks(isogi_dvr *d) {
    isogi_dvr__blocks *b = &d->blocks;
    isogi_dvr__lattice_job job;
    isogi_result result = ISOGI_OK;
    size_t count;
    int a, n;
    for (a = 0; a < 3; a++) b->count[a] = d->level[1].size[a], b->lattice_size[0][a] = 16 * b->count[a] + 1;
    b->total = b->count[0] * b->count[1] * b->count[2];
    for (a = 0; a < 3; a++) b->rest[a] = d->cells[a] ? (size_t)((d->cells[a] - 1) % 16) + 1 : 1;
    for (n = 1; n < 5; n++) {
        for (a = 0, count = 1; a < 3; a++) count *= b->lattice_size[n][a] = (b->count[a] << (4 - n)) + 1;
        b->lattice[n] = (float *)isogi_allocate(&d->context, count, sizeof(float));
        if (!b->lattice[n]) return ISOGI_NO_MEMORY;
    }
    b->histogram = (uint64_t *)isogi_allocate(&d->context, b->total, sizeof *b->histogram);
    b->level = (uint8_t *)isogi_allocate(&d->context, 3 * b->total, 1);
    b->first = (size_t *)isogi_allocate(&d->context, 2 * b->total, sizeof *b->first);
    b->order = (size_t *)isogi_allocate(&d->context, b->total, sizeof *b->order);
    if (!b->histogram || !b->level || !b->first || !b->order) return ISOGI_NO_MEMORY;
    memset(b->level, 0, 3 * b->total);
    memset(b->first, 0, 2 * b->total * sizeof *b->first);
    b->lit = b->level + b->total, b->stale = b->lit + b->total;
    for (a = 0; a < 3; a++) { /* between axes at right angles, the radius; sheared ones it takes further */
        const double *row = d->to_grid + 3 * a, blocks = d->desc.radius * d->spacing * sqrt(isogi_dvr__dot(row, row)) / 16;
        if (!(blocks <= ISOGI_DVR__MAX_REACH)) return ISOGI_TOO_LARGE;
        if (ceil(blocks - 1e-9) > (double)b->reach) b->reach = (size_t)ceil(blocks - 1e-9);
    }
    job.dvr = d;
    for (n = 1; n < 5 && result == ISOGI_OK; n++) {
        job.step = n;
        result = isogi_parallel(&d->context, b->lattice_size[n][2], isogi_dvr__lattice_task, &job, 0, 0);
    }
    return result;
}

/* ==== visibility of several resolutions ============================================================================== */

/* Kronander 2011 names it as work to come: global visibility coarse where it is not seen, or varies slowly, and fine near matter. Blocks of
   8^3 distances of the grid each hold every point of it, or every 2nd, 4th or 8th along an axis, with those of all their faces, so that
   looking up never leaves a block. Where blocks of different steps meet, the points on their common face (edge, corner) take what
   the coarsest of them has there, between its points too: no seam. Steps follow from the lattice of extinction. Nothing is looked up where
   there is no matter within three distances (looking up in front of dense matter, between points, between nodes), nor seen deep within
   it: the coarsest step. Elsewhere a step's optical depth is at most ISOGI_DVR__SOFT, as the error of interpolating exp(-x) over it is that
   squared over 8, and twice the step of any block beside it: shadows grow soft with the distance from what casts them. */
#define ISOGI_DVR__SOFT 0.25f   /* optical depth between points that are held */
#define ISOGI_DVR__BURIED 4.0f  /* optical depth of a distance of the grid through which nothing is seen */

/* How many points `visibility` holds. */
static size_t isogi_dvr__held_points(const isogi_dvr *d) { return d->held.block ? d->held.points : d->point_count; }

/* How many are to be gathered. */
static size_t isogi_dvr__coming_points(const isogi_dvr *d) { return d->coming.block ? d->coming.points : d->point_count; }

static void isogi_dvr__held_at(const isogi_dvr__held *h, size_t block, size_t at[3]) {
    at[0] = block % h->count[0], at[1] = block / h->count[0] % h->count[1], at[2] = block / h->count[0] / h->count[1];
}

/* All blocks with the coarsest step. */
static isogi_result isogi_dvr__plan_held(const isogi_dvr *d, isogi_dvr__held *h) {
    uint32_t log = d->desc.coarsest == 8 ? 3 : d->desc.coarsest == 4 ? 2 : 1;
    size_t i;
    int a;
    for (a = 0, h->total = 1; a < 3; a++) h->count[a] = (d->desc.grid[a] - 1) / 8, h->total *= h->count[a];
    h->block = (isogi_dvr__held_block *)isogi_allocate(&d->context, h->total, sizeof *h->block);
    if (!h->block) return ISOGI_NO_MEMORY;
    for (i = 0; i < h->total; i++) h->block[i].first = 0, h->block[i].log = log;
    return ISOGI_OK;
}

/* Where each block's points are. */
static isogi_result isogi_dvr__number_held(const isogi_dvr *d, isogi_dvr__held *h) {
    size_t i, n;
    for (i = 0, h->points = 0; i < h->total; i++) {
        n = (8u >> h->block[i].log) + 1, h->block[i].first = (uint32_t)h->points;
        h->points += n * n * n;
        if (h->points > 0x1fffffff || h->points > SIZE_MAX / 64 / d->coefficients) return ISOGI_TOO_LARGE;
    }
    return ISOGI_OK;
}

static void isogi_dvr__drop_held(const isogi_dvr *d, isogi_dvr__held *h) {
    isogi_release(&d->context, h->block, h->total, sizeof *h->block);
    memset(h, 0, sizeof *h);
}

/* Forgets what was gathered, and where. */
static void isogi_dvr__drop_coming(isogi_dvr *d) {
    if (!d->coming.block) return;
    isogi_release(&d->context, d->gathered, d->padded_count * d->coefficients, sizeof *d->gathered);
    isogi_dvr__drop_held(d, &d->coming);
    d->gathered = NULL;
}

/* Visibility has to be stepped again, from the beginning. */
static void isogi_dvr__begin_anew(isogi_dvr *d) {
    d->next = d->matter.prepared = 0, d->blocks.ready = 0, d->blocks.share = 1;
    isogi_dvr__drop_coming(d);
}

/* The step that a block's own matter asks for; first: 1 where it is seen. */
static void isogi_dvr__choose_step_task(void *arg, size_t block) {
    isogi_dvr *d = (isogi_dvr *)arg;
    const isogi_dvr__matter *m = &d->matter;
    isogi_dvr__held_block *b = &d->coming.block[block];
    float least = 1e30f, most = 0, near_by = (float)isogi_dvr__clamp(d->distance[0] * d->spacing / d->desc.unit, 1e30),
          distance = (float)isogi_dvr__clamp(d->distance[1] * d->spacing / d->desc.unit, 1e30);
    size_t at[3], low[3], high[3], x, y, z;
    uint32_t coarsest = b->log;
    int a;
    isogi_dvr__held_at(&d->coming, block, at);
    for (a = 0; a < 3; a++) {
        low[a] = (at[a] ? 8 * at[a] - 3 : 0) * m->every[a];
        high[a] = (8 * at[a] + (at[a] + 1 < d->coming.count[a] ? 11 : 8)) * m->every[a];
    }
    for (z = low[2]; z <= high[2]; z++)
        for (y = low[1]; y <= high[1]; y++) {
            const float *row = m->extinction[0] + (z * m->size[1] + y) * m->row[0];
            for (x = low[0]; x <= high[0]; x++) least = row[x] < least ? row[x] : least, most = row[x] > most ? row[x] : most;
        }
    if (!(most > 0) || least * near_by >= ISOGI_DVR__BURIED) return;
    b->first = 1, b->log = 0;
    while (b->log < coarsest && most * distance * (float)(2u << b->log) <= ISOGI_DVR__SOFT) b->log++;
}

/* Whether a block of this step is beside, at a corner too. */
static int isogi_dvr__beside_step(const isogi_dvr__held *h, size_t block, uint32_t log) {
    size_t at[3], low[3], high[3], c[3];
    int a;
    isogi_dvr__held_at(h, block, at);
    for (a = 0; a < 3; a++) low[a] = at[a] ? at[a] - 1 : 0, high[a] = at[a] + 1 < h->count[a] ? at[a] + 1 : at[a];
    for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[0] = low[0]; c[0] <= high[0]; c[0]++)
                if (h->block[c[0] + h->count[0] * (c[1] + h->count[1] * c[2])].log == log) return 1;
    return 0;
}

/* Before the first direction is swept: where to gather. */
static isogi_result isogi_dvr__plan_coming(isogi_dvr *d) {
    isogi_dvr__held *h = &d->coming;
    isogi_context whole = d->context;
    isogi_result result = isogi_dvr__plan_held(d, h);
    uint32_t log;
    size_t i;
    whole.progress = NULL;
    if (result == ISOGI_OK) result = isogi_parallel(&whole, h->total, isogi_dvr__choose_step_task, d, 0, 0);
    for (log = 0; result == ISOGI_OK && log < 2; log++)
        for (i = 0; i < h->total; i++)
            if (h->block[i].first && h->block[i].log > log + 1 && isogi_dvr__beside_step(h, i, log)) h->block[i].log = log + 1;
    if (result == ISOGI_OK) result = isogi_dvr__number_held(d, h);
    if (result == ISOGI_OK) {
        d->padded_count = (h->points + ISOGI_DVR__LANES - 1) / ISOGI_DVR__LANES * ISOGI_DVR__LANES;
        d->gathered = (float *)isogi_allocate(&d->context, d->padded_count * d->coefficients, sizeof *d->gathered);
        if (!d->gathered) result = ISOGI_NO_MEMORY;
    }
    if (result != ISOGI_OK) isogi_dvr__drop_held(d, h);
    return result;
}

/* The eight points around a place of the grid (in its distances): floats from the first one to the others along each axis, and where
   between them. */
static size_t isogi_dvr__held_cell(const isogi_dvr__held *h, const size_t cell[3], const double within[3], size_t to[3], double u[3]) {
    const isogi_dvr__held_block *b = &h->block[(cell[0] >> 3) + h->count[0] * ((cell[1] >> 3) + h->count[1] * (cell[2] >> 3))];
    size_t point = b->first, stride = 1;
    int a;
    for (a = 0; a < 3; a++) {
        size_t c = (cell[a] & 7) >> b->log;
        u[a] = ((double)((cell[a] & 7) - (c << b->log)) + within[a]) / (double)(1u << b->log);
        point += c * stride, to[a] = stride, stride *= (8u >> b->log) + 1;
    }
    return point;
}

/* Points on the border of blocks take what the coarsest of the blocks there has: of blocks of one step, those of larger steps being
   finished. */
typedef struct isogi_dvr__join_job {
    const isogi_dvr__held *held;
    float *value; /* [points][channels] */
    size_t channels;
    uint32_t log;
} isogi_dvr__join_job;

static void isogi_dvr__join_point(const isogi_dvr__join_job *job, size_t block, const size_t at[3], const size_t c[3]) {
    const isogi_dvr__held *h = job->held;
    const isogi_dvr__held_block *b = &h->block[block], *most = b;
    size_t last = 8u >> b->log, cell[3], to[3], base, i, k, other[3] = {0, 0, 0}, n = last + 1;
    double within[3], u[3];
    float *out = job->value + (b->first + c[0] + n * (c[1] + n * c[2])) * job->channels;
    int a;
    for (k = 1; k < 8; k++) { /* blocks on the other side of its faces */
        size_t p[3];
        for (a = 0; a < 3; a++) {
            p[a] = at[a];
            if (!(k >> a & 1)) continue;
            if (!c[a] && at[a]) p[a]--;
            else if (c[a] == last && at[a] + 1 < h->count[a]) p[a]++;
            else break;
        }
        if (a < 3) continue;
        b = &h->block[p[0] + h->count[0] * (p[1] + h->count[1] * p[2])];
        if (b->log > most->log) most = b, memcpy(other, p, sizeof other);
    }
    if (most->log == job->log) return;
    for (a = 0; a < 3; a++) { /* its place in that block */
        size_t x = 8 * at[a] + (c[a] << job->log);
        cell[a] = x < 8 * other[a] + 8 ? x : x - 1, within[a] = (double)(x - cell[a]);
    }
    base = isogi_dvr__held_cell(h, cell, within, to, u);
    for (i = 0; i < job->channels; i++) out[i] = 0;
    for (k = 0; k < 8; k++) {
        double w = (k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) * (k & 4 ? u[2] : 1 - u[2]);
        const float *v = job->value + (base + (k & 1 ? to[0] : 0) + (k & 2 ? to[1] : 0) + (k & 4 ? to[2] : 0)) * job->channels;
        for (i = 0; w > 0 && i < job->channels; i++) out[i] += (float)w * v[i];
    }
}

static void isogi_dvr__join_task(void *arg, size_t block) {
    const isogi_dvr__join_job *job = (const isogi_dvr__join_job *)arg;
    size_t at[3], c[3], last = 8u >> job->log;
    uint32_t log;
    int coarser = 0;
    if (job->held->block[block].log != job->log) return;
    for (log = job->log + 1; log < 4; log++) coarser |= isogi_dvr__beside_step(job->held, block, log);
    if (!coarser) return;
    isogi_dvr__held_at(job->held, block, at);
    for (c[2] = 0; c[2] <= last; c[2]++)
        for (c[1] = 0; c[1] <= last; c[1]++)
            for (c[0] = 0; c[0] <= last; c[0] += (!c[1] || !c[2] || c[1] == last || c[2] == last) ? 1 : last)
                isogi_dvr__join_point(job, block, at, c);
}

/* No seams in value[points][channels]. Not cancelled half way; nothing else can keep it from its end. */
static void isogi_dvr__join(const isogi_dvr *d, const isogi_dvr__held *h, float *value, size_t channels) {
    isogi_dvr__join_job job;
    isogi_context whole = d->context;
    whole.progress = NULL;
    job.held = h, job.value = value, job.channels = channels;
    for (job.log = 3; job.log-- > 0;) isogi_parallel(&whole, h->total, isogi_dvr__join_task, &job, 0, 0);
}

/* ==== create and free ================================================================================================ */

/* The inverse of (axes * spacing), and the smallest length of its columns. */
static void isogi_dvr__set_lattice(isogi_dvr *d) {
    const isogi_volume *v = &d->volume;
    const double *m = v->axes;
    double determinant = m[0] * (m[4] * m[8] - m[5] * m[7]) + m[1] * (m[5] * m[6] - m[3] * m[8]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
    int r, c;
    d->spacing = isogi_dvr__shortest_edge(v);
    for (r = 0; r < 3; r++) {
        d->cells[r] = (int)(v->size[r] - 1);
        for (c = 0; c < 3; c++) {
            int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3; /* cyclic: the cofactor has its sign */
            d->to_grid[3 * r + c] = (m[3 * r1 + c1] * m[3 * r2 + c2] - m[3 * r1 + c2] * m[3 * r2 + c1]) / determinant / v->spacing[r];
        }
    }
}

static int isogi_dvr__material_ok(const isogi_material *m) {
    int a;
    if (!isogi_dvr__finite3(m->diffuse) || !isogi_dvr__finite3(m->specular) || !isogi_dvr__finite32(m->exponent)) return 0;
    for (a = 0; a < 3; a++)
        if (!(m->diffuse[a] >= 0 && m->specular[a] >= 0)) return 0;
    return m->exponent >= 0 && m->exponent <= 1e6f;
}

static void isogi_dvr__resolve_material(isogi_material *m, int transmission) {
    if (!(m->diffuse[0] > 0 || m->diffuse[1] > 0 || m->diffuse[2] > 0)) m->diffuse[0] = m->diffuse[1] = m->diffuse[2] = 1;
    if (!transmission || m->specular[0] > 0 || m->specular[1] > 0 || m->specular[2] > 0) return;
    m->specular[0] = m->specular[1] = m->specular[2] = 1;
}

static int isogi_dvr__within(double x, double low, double high) { return isogi_dvr__finite64(x) && x >= low && x <= high; }

static const char *isogi_dvr__visibility_fault(const isogi_dvr_desc *d) {
    if ((int)d->method < 0 || d->method > ISOGI_DVR_SWEEP) return "method: none of isogi_dvr_method";
    if ((int)d->sphere < 0 || d->sphere > ISOGI_DVR_ICOSAHEDRON) return "sphere: none of isogi_dvr_sphere";
    if (d->order < 0 || d->order > ISOGI_DVR__MAX_ORDER) return "order: not 0 .. 6";
    if (d->directions < 0 || d->directions > 65536) return "directions: not 0 .. 65536";
    if (d->coarsest < 0 || d->coarsest > 8 || (d->coarsest & (d->coarsest - 1))) return "coarsest: not 0, 1, 2, 4 or 8";
    if (!isogi_dvr__within(d->visibility_step, 0, 2e4) || (d->visibility_step > 0 && d->visibility_step < 1e-4))
        return "visibility_step: neither 0 nor 1e-4 .. 2e4";
    if (!isogi_dvr__within(d->tolerance, 0, HUGE_VAL)) return "tolerance: negative or not finite";
    if (!isogi_dvr__within(d->bound, 0, 1) || (d->bound > 0 && d->bound < 1e-4)) return "bound: neither 0 nor 1e-4 .. 1";
    if (!isogi_dvr__within(d->radius, 0, ISOGI_DVR__LOCAL_STEPS) || (d->radius > 0 && d->radius < 1))
        return "radius: neither 0 nor 1 .. 32";
    if (!isogi_dvr__within(d->reduction, 0, HUGE_VAL) || (d->reduction > 0 && d->reduction < 1))
        return "reduction: neither 0 nor 1 or more";
    return NULL;
}

ISOGI_API const char *isogi_dvr_fault(const isogi_dvr_desc *desc) {
    const isogi_dvr_desc *d = desc;
    int a;
    if (!d) return "desc: NULL";
    if (!d->pyramid) return "pyramid: NULL";
    if (!isogi_vol_volume(d->pyramid)->data) return "pyramid: of a function, which has no voxels";
    if (d->space != ISOGI_DVR_PHYSICAL && d->space != ISOGI_DVR_DATA) return "space: none of isogi_dvr_space";
    if ((unsigned)d->shading > ISOGI_DVR_TWO_SIDED) return "shading: none of isogi_dvr_shading";
    if ((unsigned)d->classification > ISOGI_DVR_POST_CLASSIFIED) return "classification: none of isogi_dvr_classification";
    if ((unsigned)d->silhouette > ISOGI_DVR_SILHOUETTE_GRADIENT) return "silhouette: none of isogi_dvr_silhouette";
    if ((unsigned)d->normals > ISOGI_NORMAL_TRILINEAR) return "normals: none of isogi_normal_kind";
    if (d->table < 0 || d->table == 1 || d->table > 1024) return "table: neither 0 nor 2 .. 1024";
    for (a = 0; a < 3; a++)
        if (!isogi_dvr__material_ok(&d->material[a])) return "material: a colour is negative, or an exponent not 0 .. 1e6";
    if (isogi_dvr__points_fault(d->second_points, d->second_count))
        return "second_points, second_count: what isogi_transfer_fault says of such points";
    if (!isogi_dvr__within(d->unit, 0, HUGE_VAL)) return "unit: negative or not finite";
    if (!isogi_dvr__within(d->step, 0, 1e4) || (d->step > 0 && d->step < 1e-4)) return "step: neither 0 nor 1e-4 .. 1e4";
    if (!isogi_dvr__finite32(d->opaque) || !(d->opaque >= 0 && d->opaque <= 1)) return "opaque: not 0 .. 1";
    if (!isogi_dvr__finite64(d->anisotropy) || !(d->anisotropy > -1 && d->anisotropy < 1)) return "anisotropy: not between -1 and 1";
    if (!isogi_dvr__within(d->emission, 0, 1e6)) return "emission: not 0 .. 1e6";
    return isogi_dvr__visibility_fault(d);
}

static isogi_result isogi_dvr__resolve(isogi_dvr_desc *desc, const isogi_dvr_desc *given) {
    const isogi_volume *volume;
    int a;
    if (isogi_dvr_fault(given)) return ISOGI_INVALID;
    *desc = *given;
    volume = isogi_vol_volume(desc->pyramid);
    for (a = 0; a < 3; a++) isogi_dvr__resolve_material(&desc->material[a], a == 2);
    if (!desc->table) desc->table = 256;
    if (!desc->coarsest) desc->coarsest = 1;
    if (!(desc->step > 0)) desc->step = 0.5;
    if (!desc->method) desc->method = ISOGI_DVR_SWEEP;
    if (!(desc->radius > 0)) desc->radius = 16;
    if (!(desc->reduction > 0)) desc->reduction = 4;
    if (!(desc->opaque > 0)) desc->opaque = 0.999f;
    if (!desc->order) desc->order = 3;
    if (!desc->directions) desc->directions = 64;
    if (desc->sphere != ISOGI_DVR_FIBONACCI) {
        int faces = (int)isogi_dvr__face_count(desc->sphere), parts = 1;
        while (2 * desc->directions > faces * (parts * parts + (parts + 1) * (parts + 1))) parts++;
        desc->directions = faces * parts * parts;
    }
    for (a = 0; a < 3; a++) {
        if (!desc->grid[a]) desc->grid[a] = volume->size[a] > 8 ? (volume->size[a] + 3) / 4 : volume->size[a] > 1 ? 2 : 1;
        if (desc->grid[a] > 0x7fffffff) return ISOGI_TOO_LARGE;
    }
    return ISOGI_OK;
}

/* Nothing casts a shadow: V = 1 everywhere. */
static void isogi_dvr__clear_visibility(isogi_dvr *d) {
    size_t i;
    for (i = 0; i < isogi_dvr__held_points(d) * d->coefficients; i++)
        d->visibility[i] = i % d->coefficients ? 0 : (float)(2 * sqrt(ISOGI_DVR__PI));
}

/* Everything whose size is known by now. */
static isogi_result isogi_dvr__allocate_parts(isogi_dvr *d) {
    int n, lit = d->desc.shading == ISOGI_DVR_VISIBILITY;
    size_t i;
    for (n = 0; n < ISOGI_DVR__LEVELS; n++) {
        d->level[n] = isogi_vol_level(d->desc.pyramid, n);
        d->block_count += d->level[n].size[0] * d->level[n].size[1] * d->level[n].size[2];
    }
    d->empty_blocks = (uint8_t *)isogi_allocate(&d->context, d->block_count, 2);
    d->changed_count = d->level[1].size[0] * d->level[1].size[1] * d->level[1].size[2];
    d->changed = (uint8_t *)isogi_allocate(&d->context, d->changed_count, 1);
    if (!d->empty_blocks || !d->changed) return ISOGI_NO_MEMORY;
    memset(d->changed, 0, d->changed_count);
    d->cut = (uint8_t *)isogi_allocate(&d->context, d->changed_count, 1);
    d->leap = (uint8_t *)isogi_allocate(&d->context, isogi_dvr__leap_bytes(d), 1);
    if (!d->cut || !d->leap) return ISOGI_NO_MEMORY;
    memset(d->cut, 0, d->changed_count);
    for (n = 0, i = 0; n < ISOGI_DVR__LEVELS; n++) {
        d->empty[n] = d->empty_blocks + i;
        if (d->desc.space == ISOGI_DVR_PHYSICAL && isogi_vol_finite(d->desc.pyramid)) d->steady[n] = d->empty_blocks + d->block_count + i;
        i += d->level[n].size[0] * d->level[n].size[1] * d->level[n].size[2];
    }
    if (!lit) return ISOGI_OK;
    d->coefficients = ISOGI_SH_COUNT(d->desc.order);
    d->point_count = d->coefficients;
    for (n = 0; n < 3; n++) {
        if (d->desc.grid[n] > SIZE_MAX / 4 / d->point_count) return ISOGI_TOO_LARGE;
        d->point_count *= d->desc.grid[n];
    }
    d->point_count /= d->coefficients;
    d->kernel_count = (size_t)d->desc.directions * d->coefficients;
    d->direction = (double(*)[6])isogi_allocate(&d->context, (size_t)d->desc.directions, sizeof *d->direction);
    d->kernel = (float *)isogi_allocate(&d->context, d->kernel_count, sizeof *d->kernel);
    if (d->desc.coarsest > 1) {
        isogi_result result = isogi_dvr__plan_held(d, &d->held);
        if (result == ISOGI_OK) result = isogi_dvr__number_held(d, &d->held);
        if (result != ISOGI_OK) return result;
    }
    d->visibility = (float *)isogi_allocate(&d->context, isogi_dvr__held_points(d) * d->coefficients, sizeof *d->visibility);
    if (!d->direction || !d->kernel || !d->visibility) return ISOGI_NO_MEMORY;
    isogi_dvr__clear_visibility(d);
    d->padded_count = (d->point_count + ISOGI_DVR__LANES - 1) / ISOGI_DVR__LANES * ISOGI_DVR__LANES;
    if (isogi_dvr__method(d) == ISOGI_DVR_SWEEP) {
        isogi_result result = isogi_dvr__plan_matter(d);
        if (result != ISOGI_OK) return result;
    } else if (isogi_dvr__method(d) == ISOGI_DVR_PAPER) {
        isogi_result result;
        d->basis = (float *)isogi_allocate(&d->context, d->kernel_count, sizeof *d->basis);
        d->matter.table = (float *)isogi_allocate(&d->context, ISOGI_DVR__TABLE, sizeof *d->matter.table);
        if (!d->basis || !d->matter.table) return ISOGI_NO_MEMORY;
        result = isogi_dvr__plan_blocks(d);
        if (result != ISOGI_OK) return result;
    }
    if (isogi_dvr__method(d) != ISOGI_DVR_BRUTE && d->desc.coarsest == 1) {
        d->gathered = (float *)isogi_allocate(&d->context, d->padded_count * d->coefficients, sizeof *d->gathered);
        if (!d->gathered) return ISOGI_NO_MEMORY;
    }
    return isogi_dvr__set_kernel(d);
}

ISOGI_API isogi_result isogi_dvr_create(isogi_dvr **dvr, const isogi_dvr_desc *desc, const isogi_context *context) {
    isogi_dvr_desc resolved;
    isogi_result result = isogi_dvr__resolve(&resolved, desc);
    isogi_dvr *d;
    double longest = 0;
    int a, sampled;
    if (!dvr) return ISOGI_INVALID;
    if (result != ISOGI_OK) return result;
    if (!context) context = isogi_vol_context(resolved.pyramid);
    d = (isogi_dvr *)isogi_allocate(context, 1, sizeof *d);
    if (!d) return ISOGI_NO_MEMORY;
    memset(d, 0, sizeof *d);
    if (context) d->context = *context;
    d->desc = resolved, d->volume = *isogi_vol_volume(resolved.pyramid);
    isogi_dvr__set_lattice(d);
    if (!(d->desc.unit > 0)) d->desc.unit = d->spacing;
    if (isogi_dvr__method(d) != ISOGI_DVR_SWEEP) d->desc.coarsest = 1;
    for (a = 0; a < 3 && d->desc.coarsest > 1; a++) d->desc.grid[a] = d->desc.grid[a] > 1 ? (d->desc.grid[a] + 6) / 8 * 8 + 1 : 9;
    for (a = 0; a < 3; a++) longest += d->cells[a] * (isogi_dvr__edge(&d->volume, a) / d->spacing);
    for (a = 0; a < 3; a++) {
        double distance = isogi_dvr__edge(&d->volume, a) / d->spacing;
        d->grid_scale[a] = d->cells[a] ? (float)(((double)d->desc.grid[a] - 1) / d->cells[a]) : 0;
        if (!(d->grid_scale[a] > 0)) continue;
        distance /= (double)d->grid_scale[a];
        d->distance[0] = d->distance[0] > 0 && d->distance[0] < distance ? d->distance[0] : distance;
        d->distance[1] = d->distance[1] > distance ? d->distance[1] : distance;
    }
    d->piece = desc->step > 0 ? resolved.step : 1;
    d->visibility_step = resolved.visibility_step > 0 ? resolved.visibility_step : 2 * resolved.step;
    isogi_vol_range(resolved.pyramid, d->range);
    /* the value nearest to zero: one far from it that only few voxels have must not cost all others their digits */
    d->base = isogi_dvr__count_from(d, d->range[0] > 0 ? d->range[0] : d->range[1] < 0 ? d->range[1] : 0);
    isogi_dvr__set_classes(d, NULL, d->range, ISOGI_DVR__TABLE, &d->matter.low, &d->matter.scale);
    d->method = isogi_dvr__method_now(d);
    d->kernels = isogi_dvr__choose_kernels(d->context.force_path);
    resolved.step = resolved.step < d->visibility_step ? resolved.step : d->visibility_step;
    sampled = resolved.space == ISOGI_DVR_PHYSICAL || resolved.classification != ISOGI_DVR_EXACT; /* exact rays take no steps */
    result = !sampled || longest / resolved.step <= ISOGI_DVR__MAX_SAMPLES ? isogi_dvr__allocate_parts(d) : ISOGI_TOO_LARGE;
    if (result != ISOGI_OK) {
        isogi_dvr_free(d);
        return result;
    }
    isogi_dvr__mark_empty(d);
    *dvr = d;
    return ISOGI_OK;
}

ISOGI_API void isogi_dvr_free(isogi_dvr *dvr) {
    isogi_context context;
    if (!dvr) return;
    context = dvr->context;
    isogi_dvr__integral_free(&dvr->integral, &context);
    isogi_dvr__transfer_free(&dvr->transfer, &context);
    isogi_release(&context, dvr->empty_blocks, dvr->block_count, 2);
    isogi_release(&context, dvr->changed, dvr->changed_count, 1);
    isogi_release(&context, dvr->cut, dvr->changed_count, 1);
    isogi_release(&context, dvr->leap, isogi_dvr__leap_bytes(dvr), 1);
    isogi_release(&context, dvr->clip, dvr->clip_count, sizeof *dvr->clip);
    isogi_release(&context, dvr->basis, dvr->kernel_count, sizeof *dvr->basis);
    isogi_release(&context, dvr->matter.table, ISOGI_DVR__TABLE, sizeof *dvr->matter.table);
    isogi_dvr__free_blocks(dvr);
    isogi_dvr__drop_coming(dvr);
    isogi_release(&context, dvr->matter.extinction[0], dvr->matter.count[0], sizeof(float));
    isogi_release(&context, dvr->matter.extinction[1], dvr->matter.count[1], sizeof(float));
    isogi_release(&context, dvr->gathered, dvr->padded_count * dvr->coefficients, sizeof *dvr->gathered);
    isogi_release(&context, dvr->direction, (size_t)dvr->desc.directions, sizeof *dvr->direction);
    isogi_release(&context, dvr->kernel, dvr->kernel_count, sizeof *dvr->kernel);
    isogi_release(&context, dvr->visibility, isogi_dvr__held_points(dvr) * dvr->coefficients, sizeof *dvr->visibility);
    isogi_dvr__drop_held(dvr, &dvr->held);
    isogi_release(&context, dvr, 1, sizeof *dvr);
}

/* ==== samples along a ray ============================================================================================ */

/* A ray in grid coordinates, in double: world points as floats would lose whole voxels far from the origin, and the samples have
   to share one parameter with the crossings of peaks. All t count from where the ray enters the box. */
typedef struct isogi_dvr__march {
    const isogi_dvr *dvr;
    double origin[3], dir[3]; /* at the entry; grid units per t */
    double enter, length;     /* t along the ray as given; of the part within the box */
    double speed;             /* world length per t */
    isogi_dvr_silhouette silhouette; /* of viewing rays */
    double piece, scale;      /* t of one piece; optical depth per (extinction * t) in physical space, 1 in data space */
    double shift;             /* pieces by which all of them begin early: the first is cut by the entry */
    int unlit;                /* blocks in which nothing changes may be passed in one piece */
    int cut;                  /* the ray may end within the box */
    uint64_t next, count;     /* pieces */
    int cell[3], known[3];    /* the cell in `corner`; the smallest block known not to be empty */
    double corner[8], low, high;
    int finite;
    isogi_counters work;
} isogi_dvr__march;

/* A piece of ray with some extinction: all that compositing and shading ask for. */
typedef struct isogi_dvr__sample {
    double from, to; /* t */
    double depth;    /* optical depth of the whole piece */
    double value, local[3];
    int cell[3], side; /* side: +1 where the value rises along the ray */
} isogi_dvr__sample;

/* Cuts a part of a ray by the clip planes; 0 if nothing remains. */
static int isogi_dvr__clipped(const isogi_dvr *d, const double origin[3], const double dir[3], double span[2]) {
    size_t k;
    for (k = 0; k < d->clip_count; k++) {
        double rate = isogi_dvr__dot(d->clip[k], dir), at = isogi_dvr__dot(d->clip[k], origin) + d->clip[k][3];
        if (!(fabs(rate) > 1e-300)) {
            if (at < -isogi_dvr__slack(d->clip[k])) return 0;
            continue;
        }
        at = -at / rate;
        if (rate > 0 && at > span[0]) span[0] = at;
        if (rate < 0 && at < span[1]) span[1] = at;
    }
    return span[0] < span[1] && span[1] < 1e300;
}

/* The part of a ray up to `leave` that is within the box and the clip planes, in t; 0 if there is none. */
static int isogi_dvr__inside(const isogi_dvr *d, const double origin[3], const double dir[3], double leave, double span[2]) {
    double enter = 0;
    int a;
    for (a = 0; a < 3; a++) {
        double size = d->cells[a], t0, t1, swap;
        if (!isogi_dvr__finite64(origin[a]) || !isogi_dvr__finite64(dir[a])) return 0;
        if (!(fabs(dir[a]) > 1e-300)) {
            if (!(origin[a] >= 0 && origin[a] <= size)) return 0;
            continue;
        }
        t0 = -origin[a] / dir[a], t1 = (size - origin[a]) / dir[a];
        if (t0 > t1) swap = t0, t0 = t1, t1 = swap;
        if (t0 > enter) enter = t0;
        if (t1 < leave) leave = t1;
    }
    span[0] = enter, span[1] = leave;
    return isogi_dvr__clipped(d, origin, dir, span);
}

/* 0 if the ray misses the box, or ends before it. `origin` and `dir` in grid space, `world` = length of dir in the world, `until` there,
   `step` in voxels. */
static int isogi_dvr__begin(isogi_dvr__march *m, const isogi_dvr *d, const double origin[3], const double dir[3], double world,
                            double until, double step) {
    double span[2], pieces;
    int a;
    memset(m, 0, sizeof *m);
    if (!isogi_dvr__inside(d, origin, dir, until / world, span)) return 0;
    m->dvr = d, m->enter = span[0], m->length = span[1] - span[0], m->cut = d->clip_count || !(span[1] < until / world);
    for (a = 0; a < 3; a++) {
        m->dir[a] = dir[a];
        m->origin[a] = isogi_dvr__clamp(origin[a] + span[0] * dir[a], d->cells[a]);
        m->cell[a] = m->known[a] = -1;
    }
    m->piece = step * d->spacing / world, m->speed = world;
    m->scale = d->desc.space == ISOGI_DVR_PHYSICAL ? world / d->desc.unit : 1;
    pieces = ceil(m->length / m->piece);
    m->count = (uint64_t)isogi_dvr__clamp(pieces, 2 * ISOGI_DVR__MAX_SAMPLES);
    return 1;
}

/* t at which piece n begins. */
static double isogi_dvr__piece_begin(const isogi_dvr__march *m, uint64_t n) {
    double t = ((double)n - m->shift) * m->piece;
    return t > 0 ? t : 0;
}

/* A shift of its own for every pixel. */
static void isogi_dvr__jitter(isogi_dvr__march *m, uint32_t seed, int x, int y) {
    uint32_t h = seed * 0x9e3779b9u ^ ((uint32_t)x * 0x85ebca6bu + (uint32_t)y * 0xc2b2ae35u);
    if (!seed) return;
    h ^= h >> 16, h *= 0x7feb352du, h ^= h >> 15, h *= 0x846ca68bu, h ^= h >> 16;
    m->shift = (double)h / 4294967296.0;
    m->count = (uint64_t)isogi_dvr__clamp(ceil(m->length / m->piece + m->shift), 2 * ISOGI_DVR__MAX_SAMPLES);
}

/* Corner x + 2y + 4z of the present cell. */
static void isogi_dvr__fetch(isogi_dvr__march *m) {
    double low[4], high[4];
    int i;
    m->finite = isogi_vol_corners(m->dvr->desc.pyramid, m->cell, m->corner);
    for (i = 0; i < 4; i++) {
        const double *c = m->corner + 2 * i;
        low[i] = c[0] < c[1] ? c[0] : c[1], high[i] = c[0] < c[1] ? c[1] : c[0];
    }
    for (i = 0; i < 2; i++) low[i] = low[i] < low[i + 2] ? low[i] : low[i + 2], high[i] = high[i] > high[i + 2] ? high[i] : high[i + 2];
    m->low = low[0] < low[1] ? low[0] : low[1], m->high = high[0] > high[1] ? high[0] : high[1];
}

/* The trilinear value, kept within the corners' range (rounding may not carry it into extinction that the range excludes), and
   its derivative along the ray, per t. */
static double isogi_dvr__field(const isogi_dvr__march *m, const double u[3], double *slope) {
    const double *c = m->corner;
    double x00 = c[1] - c[0], x10 = c[3] - c[2], x01 = c[5] - c[4], x11 = c[7] - c[6];
    double v00 = c[0] + u[0] * x00, v10 = c[2] + u[0] * x10, v01 = c[4] + u[0] * x01, v11 = c[6] + u[0] * x11;
    double y0 = v10 - v00, y1 = v11 - v01, v0 = v00 + u[1] * y0, v1 = v01 + u[1] * y1, z = v1 - v0, value = v0 + u[2] * z;
    double x0 = x00 + u[1] * (x10 - x00), x1 = x01 + u[1] * (x11 - x01);
    *slope = m->dir[0] * (x0 + u[2] * (x1 - x0)) + m->dir[1] * (y0 + u[2] * (y1 - y0)) + m->dir[2] * z;
    value = value > m->low ? value : m->low;
    return value < m->high ? value : m->high;
}

/* The length of the trilinear gradient per unit of t as the ray goes: |grad s| |v|. */
static double isogi_dvr__steepness(const isogi_dvr__march *m, const double u[3]) {
    const double *c = m->corner, *g = m->dvr->to_grid;
    double x00 = c[1] - c[0], x10 = c[3] - c[2], x01 = c[5] - c[4], x11 = c[7] - c[6];
    double v00 = c[0] + u[0] * x00, v10 = c[2] + u[0] * x10, v01 = c[4] + u[0] * x01, v11 = c[6] + u[0] * x11;
    double x0 = x00 + u[1] * (x10 - x00), x1 = x01 + u[1] * (x11 - x01), y0 = v10 - v00, y1 = v11 - v01, sum = 0, local[3];
    int a;
    local[0] = x0 + u[2] * (x1 - x0), local[1] = y0 + u[2] * (y1 - y0);
    local[2] = v01 + u[1] * y1 - (v00 + u[1] * y0);
    for (a = 0; a < 3; a++) {
        double world = g[a] * local[0] + g[3 + a] * local[1] + g[6 + a] * local[2];
        sum += world * world;
    }
    return sqrt(sum) * m->speed;
}

/* Post-classified opacity as a depth (Kraus 2005, eq. 11), with the silhouettes of eq. 15 to 18. `depth` is per unit of slope. */
static double isogi_dvr__slope_depth(const isogi_dvr__march *m, double depth, double slope, const double u[3]) {
    isogi_dvr_silhouette kind = m->silhouette;
    double steep, opacity;
    if (kind == ISOGI_DVR_SILHOUETTE_NONE) return depth * slope;
    steep = isogi_dvr__steepness(m, u);
    if (kind != ISOGI_DVR_SILHOUETTE_APPROXIMATE) return depth * steep;
    opacity = slope > 0 ? -expm1(-depth * slope) * (steep / slope) : 0;
    return opacity < 1 ? -log1p(-opacity) : 1e30;
}

/* The block of level n that holds the cell `c`. */
static size_t isogi_dvr__block_at(const isogi_dvr *d, int n, const int c[3]) {
    const size_t *size = d->level[n].size;
    int shift = 2 + 2 * n;
    return (size_t)(c[0] >> shift) + size[0] * ((size_t)(c[1] >> shift) + size[1] * (size_t)(c[2] >> shift));
}

/* Steps over the largest empty block around the cell `c`, in which the sample at t lies: 1 if there is one. The next sample is the
   first that may lie outside: a rounding error too early does no harm, since it is looked at like any other. 2 where the block has one
   extinction and one colour, and whole pieces of the ray lie in it: those make one. */
static int isogi_dvr__skip(isogi_dvr__march *m, const int c[3], double t) {
    const isogi_dvr *d = m->dvr;
    int n, a;
    if (c[0] >> 2 == m->known[0] && c[1] >> 2 == m->known[1] && c[2] >> 2 == m->known[2]) return 0;
    for (n = ISOGI_DVR__LEVELS - 1; n >= 0; n--) {
        const isogi_level *level = &d->level[n];
        int shift = 2 + 2 * n;
        double leave = m->length, first;
        size_t block = isogi_dvr__block_at(d, n, c);
        int steady = m->unlit && d->steady[n] && d->steady[n][block];
        m->work.blocks++;
        if (!d->empty[n][block] && !steady) continue;
        for (a = 0; a < 3; a++) {
            double border = m->dir[a] > 0 ? (double)(((c[a] >> shift) + 1)) * level->cells : (double)(c[a] >> shift) * level->cells;
            double exit = fabs(m->dir[a]) > 1e-300 ? (border - m->origin[a]) / m->dir[a] : leave;
            if (exit < leave) leave = exit;
        }
        if (steady && !d->empty[n][block]) {
            first = leave >= m->length ? (double)m->count : isogi_dvr__clamp(floor(leave / m->piece + m->shift), (double)m->count);
            if (!(first > (double)m->next)) break;
            m->next = (uint64_t)first;
            return 2;
        }
        m->work.blocks_skipped++;
        if (leave >= m->length) m->next = m->count;
        first = isogi_dvr__clamp((leave > t ? leave : t) / m->piece - 0.5 - 1e-6 + m->shift, 2 * ISOGI_DVR__MAX_SAMPLES);
        if ((double)m->next < first) m->next = (uint64_t)ceil(first);
        return 1;
    }
    for (a = 0; a < 3; a++) m->known[a] = c[a] >> 2;
    return 0;
}

/* The next piece of the ray that has any extinction; 0 when there is none. */
static int isogi_dvr__next(isogi_dvr__march *m, isogi_dvr__sample *s) {
    const isogi_dvr *d = m->dvr;
    if (d->transparent || !d->transfer.point_count) return 0;
    while (m->next < m->count) {
        double extinction, slope, t;
        int a, moved = 0, skip;
        s->from = isogi_dvr__piece_begin(m, m->next);
        m->next++;
        s->to = isogi_dvr__piece_begin(m, m->next);
        if (s->to > m->length) s->to = m->length;
        t = 0.5 * (s->from + s->to);
        for (a = 0; a < 3; a++) {
            double x = isogi_dvr__clamp(m->origin[a] + t * m->dir[a], d->cells[a]);
            int c = (int)x;
            if (c > 0 && c >= d->cells[a]) c = d->cells[a] - 1;
            s->cell[a] = c, s->local[a] = x - c;
        }
        skip = isogi_dvr__skip(m, s->cell, t);
        if (skip == 1) continue;
        if (skip == 2) s->to = m->next < m->count ? isogi_dvr__piece_begin(m, m->next) : m->length;
        m->work.samples++;
        for (a = 0; a < 3; a++) moved |= m->cell[a] ^ s->cell[a], m->cell[a] = s->cell[a];
        if (moved) isogi_dvr__fetch(m);
        if (!m->finite) continue;
        s->value = isogi_dvr__field(m, s->local, &slope), s->side = slope > 0 ? 1 : slope < 0 ? -1 : 0;
        extinction = isogi_dvr__extinction(d->transfer.points, d->transfer.point_count, s->value);
        if (!(extinction > 0)) continue;
        s->depth = extinction * (s->to - s->from) * m->scale;
        if (d->desc.space == ISOGI_DVR_DATA) s->depth = isogi_dvr__slope_depth(m, s->depth, fabs(slope), s->local);
        s->depth = isogi_dvr__clamp(s->depth, 1e30);
        if (s->depth > 0) return 1;
    }
    return 0;
}

/* ==== monotone pieces of a ray ======================================================================================== */

/* A piece of ray along which the value goes one way. Between t0 and t0 + dt the field is the cubic with Bernstein coefficients b; the
   piece is the part u0..u1 of it. (Samples of pre-integration make pieces too, with a straight line for a cubic.) */
typedef struct isogi_dvr__stretch {
    double from, to, value[2]; /* t; values at its ends */
    double t0, dt, u0, u1, b[4];
    int cell[3];
} isogi_dvr__stretch;

/* The walk through the cells of a ray. Values are carried from cell to cell: what one cell ends with is what the next begins with, bit for
   bit, so that no crossing of a peak is lost or found twice in a face. */
typedef struct isogi_dvr__walk {
    isogi_dvr__march *m;
    double t, next[3], inverse[3]; /* t at which the ray leaves its cell along each axis; 1 / dir */
    int cell[3], skipped;          /* some cells lie between the last value and the present cell, in which nothing counts */
    int whole;                     /* every voxel has a value */
    double at[3];                  /* place in the cell */
    double value;                  /* the last one */
    int chained;                   /* there is one */
    double quiet[2];               /* the last range of values known to be quiet */
    double t0, t1, dt, b[4];       /* the cell whose pieces are given out */
    int owner[3], piece, pieces, gap; /* gap: there is one before the first of them, or the ray's begin */
    double cut[5], cut_value[5];      /* u */
} isogi_dvr__walk;

static void isogi_dvr__walk_to(isogi_dvr__walk *w) {
    int a;
    for (a = 0; a < 3; a++) {
        int border = w->m->dir[a] > 0 ? w->cell[a] + 1 : w->cell[a];
        w->next[a] = fabs(w->m->dir[a]) > 1e-300 ? (border - w->m->origin[a]) * w->inverse[a] : 1e300;
    }
}

static void isogi_dvr__begin_walk(isogi_dvr__walk *w, isogi_dvr__march *m) {
    int a;
    w->m = m, w->t = 0, w->skipped = 0, w->value = 0, w->chained = 0, w->piece = w->pieces = 0;
    w->quiet[0] = 1, w->quiet[1] = 0, w->whole = isogi_vol_finite(m->dvr->desc.pyramid);
    for (a = 0; a < 3; a++) {
        int c = (int)m->origin[a], last = m->dvr->cells[a] - 1;
        /* on the face between two cells the ray belongs to the one that it goes into */
        if (c > 0 && m->dir[a] < 0 && !(m->origin[a] > c)) c--;
        c = c < last ? c : last;
        w->cell[a] = c > 0 ? c : 0;
        w->at[a] = isogi_dvr__clamp(m->origin[a] - w->cell[a], 1);
        w->inverse[a] = fabs(m->dir[a]) > 1e-300 ? 1 / m->dir[a] : 0;
    }
    isogi_dvr__walk_to(w);
}

/* To where the ray leaves the block of level n around its cell. The cell it lands in follows from integers along the axis that leads out,
   and lies within the block's reach along the others, so that rounding can neither turn the ray back nor lose it. */
static void isogi_dvr__pass_block(isogi_dvr__walk *w, int n) {
    const isogi_dvr__march *m = w->m;
    const int *c = w->cell, *cells = m->dvr->cells, shift = 2 + 2 * n;
    double leave = m->length;
    int axis = -1, first[3], a;
    w->m->work.blocks_skipped++;
    for (a = 0; a < 3; a++) {
        double exit;
        first[a] = c[a] >> shift << shift;
        if (!(fabs(m->dir[a]) > 1e-300)) continue;
        exit = ((m->dir[a] > 0 ? first[a] + (1 << shift) : first[a]) - m->origin[a]) * w->inverse[a];
        if (exit < leave) leave = exit, axis = a;
    }
    w->t = axis < 0 ? m->length : leave > w->t ? leave : w->t;
    for (a = 0; a < 3 && axis >= 0; a++) {
        double x = isogi_dvr__clamp(m->origin[a] + w->t * m->dir[a], cells[a]);
        int last = first[a] + (1 << shift) - 1, to = (int)x;
        last = last < cells[a] ? last : cells[a] - 1;
        if (m->dir[a] > 0) to = to > c[a] ? to : c[a];
        else to = to < c[a] ? to : c[a];
        to = to < last ? to : last;
        to = to > first[a] ? to : first[a];
        if (a == axis) to = m->dir[a] > 0 ? first[a] + (1 << shift) : first[a] - 1;
        if (to < 0 || (to >= cells[a] && to > 0)) w->t = m->length, axis = -1;
        else w->cell[a] = to, w->at[a] = isogi_dvr__clamp(x - to, 1);
    }
}

/* The largest empty block around the cell: its level, and the values in it; -1 if there is none. */
static int isogi_dvr__empty_block(isogi_dvr__walk *w, double range[2]) {
    isogi_dvr__march *m = w->m;
    const isogi_dvr *d = m->dvr;
    const int *c = w->cell;
    int n, a;
    if (c[0] >> 2 == m->known[0] && c[1] >> 2 == m->known[1] && c[2] >> 2 == m->known[2]) return -1;
    m->work.blocks++;
    n = d->empty[0][isogi_dvr__block_at(d, 0, c)] - 1;
    if (n >= 0) {
        const float *values = d->level[n].range[isogi_dvr__block_at(d, n, c)];
        range[0] = (double)values[0], range[1] = (double)values[1];
    } else for (a = 0; a < 3; a++) m->known[a] = c[a] >> 2;
    return n;
}

/* Steps over the largest empty block around the cell: 1 if there is one. */
static int isogi_dvr__leave_block(isogi_dvr__walk *w) {
    double range[2];
    const int n = isogi_dvr__empty_block(w, range);
    if (n < 0) return 0;
    /* Where voxels have no value, a block may hold some of them, and what lies behind it need not be near to what lies before it. */
    if (!w->whole) w->chained = 0;
    else if (!isogi_dvr__is_quiet(&w->m->dvr->integral, range[0], range[1], w->quiet))
        w->quiet[0] = range[0], w->quiet[1] = range[1]; /* of one value */
    w->skipped = 1;
    isogi_dvr__pass_block(w, n), isogi_dvr__walk_to(w);
    return 1;
}

/* The cubic from `in` to `out` (places in the cell) as Bernstein coefficients: values at corners of the box between the two places. Values
   are mixed from the nearer side: exact at both ends, and between equal values, so that a face whose voxels all have the value of a peak is
   on it wherever the ray passes. */
static void isogi_dvr__cubic(const double c[8], const double in[3], const double out[3], double b[4]) {
    double u[2][3], x[2][4], y[2][2][2], z[2][2][2];
    int far_side[2][3], i, j, k, n;
    for (n = 0; n < 2; n++)
        for (k = 0; k < 3; k++) {
            double at = n ? out[k] : in[k];
            far_side[n][k] = at >= 0.5, u[n][k] = at < 0.5 ? at : 1 - at;
        }
#define ISOGI_DVR__MIX(p, n, k) ((p)[far_side[n][k]] + u[n][k] * ((p)[1 - far_side[n][k]] - (p)[far_side[n][k]]))
    for (n = 0; n < 2; n++)
        for (i = 0; i < 4; i++) x[n][i] = ISOGI_DVR__MIX(c + 2 * i, n, 0);
    for (i = 0; i < 2; i++)
        for (n = 0; n < 2; n++)
            for (k = 0; k < 2; k++) y[i][n][k] = ISOGI_DVR__MIX(x[i] + 2 * k, n, 1);
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++)
            for (n = 0; n < 2; n++) z[i][j][n] = ISOGI_DVR__MIX(y[i][j], n, 2);
#undef ISOGI_DVR__MIX
    b[0] = z[0][0][0], b[3] = z[1][1][1];
    for (i = 0; i < 2; i++) { /* means of three, of equal ones their own value: constant matter would have extrema else. Quarters and
                                 halves: three of the largest doubles are no double */
        const double p = z[1 - i][i][i], q = z[i][1 - i][i], r = z[i][i][1 - i];
        b[1 + i] = 2 * (0.5 * p + ((0.25 * q - 0.25 * p) + (0.25 * r - 0.25 * p)) * (2 / 3.0));
    }
}

static double isogi_dvr__bernstein(const double b[4], double u) {
    double v = 1 - u, v2 = v * v, u2 = u * u; /* factors first: their sum is 1, and nothing overflows */
    return (v2 * v * b[0] + 3 * u * v2 * b[1]) + (3 * v * u2 * b[2] + u2 * u * b[3]);
}

/* The extrema within 0..1, in order: where the derivative, a quadratic, changes its sign. */
static int isogi_dvr__extrema(const double b[4], double u[2]) {
    double d0 = b[1] - b[0], d1 = b[2] - b[1], d2 = b[3] - b[2], a, half, root, q, most;
    int count = 0;
    if ((d0 >= 0 && d1 >= 0 && d2 >= 0) || (d0 <= 0 && d1 <= 0 && d2 <= 0)) return 0;
    most = fabs(d0) > fabs(d1) ? fabs(d0) : fabs(d1), most = fabs(d2) > most ? fabs(d2) : most;
    if (most > 1e140 || most < 1e-140) d0 /= most, d1 /= most, d2 /= most; /* squares stay numbers */
    a = d0 - 2 * d1 + d2, half = d1 - d0, root = half * half - a * d0;
    if (!(root > 0)) return 0;
    q = half > 0 ? -(half + sqrt(root)) : sqrt(root) - half;
    if (fabs(q) < 1e300 * fabs(a) && q / a > 0 && q / a < 1) u[count++] = q / a;
    if (fabs(d0) < 1e300 * fabs(q) && d0 / q > 0 && d0 / q < 1) u[count++] = d0 / q;
    if (count == 2 && u[0] > u[1]) root = u[0], u[0] = u[1], u[1] = root;
    return count;
}

/* Cuts the cubic of the cell between t and t1. A value left behind before a gap joins on by a piece of no length, if it is in other
   company than the value now: then rounding has led the ray past a sliver of a cell, or to another side of a peak on a face. */
static void isogi_dvr__cut_cell(isogi_dvr__walk *w, const double out[3], double t1) {
    isogi_dvr__march *m = w->m;
    double u[2];
    int extrema, i, n = 0;
    isogi_dvr__cubic(m->corner, w->at, out, w->b);
    m->work.cubics++, m->work.samples++;
    extrema = isogi_dvr__extrema(w->b, u);
    w->t0 = w->t, w->t1 = t1, w->dt = t1 - w->t;
    for (i = 0; i < 3; i++) w->owner[i] = w->cell[i];
    w->gap = !w->chained || w->skipped;
    if (!w->gap) w->b[0] = w->value;
    else if (w->chained && (w->value < w->quiet[0] || w->value > w->quiet[1] || w->b[0] < w->quiet[0] || w->b[0] > w->quiet[1]))
        w->cut[n] = 0, w->cut_value[n++] = w->value;
    w->cut[n] = 0, w->cut_value[n++] = w->b[0];
    for (i = 0; i < extrema; i++) {
        double value = isogi_dvr__bernstein(w->b, u[i]);
        value = value > m->low ? value : m->low;
        w->cut[n] = u[i], w->cut_value[n++] = value < m->high ? value : m->high;
    }
    w->b[3] = w->b[3] > m->low ? w->b[3] : m->low;
    w->b[3] = w->b[3] < m->high ? w->b[3] : m->high;
    w->cut[n] = 1, w->cut_value[n] = w->b[3];
    w->piece = 0, w->pieces = n;
    w->value = w->b[3], w->chained = 1, w->skipped = 0;
}

/* To the next cell whose values count for something; 0 at the end of the ray. */
static int isogi_dvr__next_cell(isogi_dvr__walk *w) {
    isogi_dvr__march *m = w->m;
    const isogi_dvr *d = m->dvr;
    while (w->t < m->length) {
        int axis = 0, a, cut = 0;
        double t1, out[3];
        if (isogi_dvr__leave_block(w)) continue;
        if (w->next[1] < w->next[axis]) axis = 1;
        if (w->next[2] < w->next[axis]) axis = 2;
        t1 = w->next[axis] < m->length ? w->next[axis] : m->length;
        if (t1 > w->t) {
            int moved = 0;
            for (a = 0; a < 3; a++) {
                out[a] = isogi_dvr__clamp(m->origin[a] + t1 * m->dir[a] - w->cell[a], 1);
                moved |= m->cell[a] ^ w->cell[a], m->cell[a] = w->cell[a];
            }
            if (w->next[axis] <= t1) out[axis] = m->dir[axis] > 0 ? 1 : 0;
            m->work.cells++;
            if (moved) isogi_dvr__fetch(m);
            if (!m->finite) w->chained = 0, w->skipped = 1;
            else if (isogi_dvr__is_quiet(&d->integral, m->low, m->high, w->quiet)) {
                if (!w->chained) w->value = m->low;
                w->chained = w->skipped = 1;
            } else isogi_dvr__cut_cell(w, out, t1), cut = 1;
            for (a = 0; a < 3; a++) w->at[a] = out[a];
            w->t = t1;
        }
        w->cell[axis] += m->dir[axis] > 0 ? 1 : -1;
        if (w->cell[axis] < 0 || w->cell[axis] >= d->cells[axis]) w->t = m->length;
        w->at[axis] = m->dir[axis] > 0 ? 0 : 1;
        w->next[axis] = ((m->dir[axis] > 0 ? w->cell[axis] + 1 : w->cell[axis]) - m->origin[axis]) * w->inverse[axis];
        if (cut) return 1;
    }
    return 0;
}

static int isogi_dvr__next_monotone(isogi_dvr__walk *w, isogi_dvr__stretch *p) {
    int i;
    while (w->piece >= w->pieces)
        if (!isogi_dvr__next_cell(w)) return 0;
    i = w->piece++;
    p->t0 = w->t0, p->dt = w->dt, p->u0 = w->cut[i], p->u1 = w->cut[i + 1];
    /* one cell ends where the next begins */
    p->from = w->t0 + w->cut[i] * w->dt, p->to = w->cut[i + 1] < 1 ? w->t0 + w->cut[i + 1] * w->dt : w->t1;
    p->value[0] = w->cut_value[i], p->value[1] = w->cut_value[i + 1];
    memcpy(p->b, w->b, sizeof p->b), memcpy(p->cell, w->owner, sizeof p->cell);
    return 1;
}

static void isogi_dvr__locate(const isogi_dvr__march *m, double t, int cell[3], double local[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        double x = isogi_dvr__clamp(m->origin[a] + t * m->dir[a], m->dvr->cells[a]);
        int c = (int)x;
        if (c > 0 && c >= m->dvr->cells[a]) c = m->dvr->cells[a] - 1;
        cell[a] = c, local[a] = x - c;
    }
}

/* The value at t, of a cell that has one; 0 otherwise. */
static int isogi_dvr__value_at(isogi_dvr__march *m, double t, int cell[3], double local[3], double *value) {
    double slope;
    int a, moved = 0;
    isogi_dvr__locate(m, t, cell, local);
    for (a = 0; a < 3; a++) moved |= m->cell[a] ^ cell[a], m->cell[a] = cell[a];
    if (moved) isogi_dvr__fetch(m);
    m->work.samples++;
    if (m->finite) *value = isogi_dvr__field(m, local, &slope);
    return m->finite;
}

/* The last sample that is surely within the empty blocks which the ray passes one after the other from the sample at t in `cell` on, as
   long as all their values together count for nothing; beyond `count` where the ray ends in them. Sample `here` if there are none. */
static uint64_t isogi_dvr__last_empty(isogi_dvr__walk *w, const int cell[3], double t, uint64_t here) {
    const isogi_dvr__march *m = w->m;
    double joint[2] = {1.7e308, -1.7e308}, range[2];
    const double before = w->t;
    int n;
    memcpy(w->cell, cell, sizeof w->cell), w->t = t;
    while (w->t < m->length && (n = isogi_dvr__empty_block(w, range)) >= 0) {
        if (range[0] < joint[0]) joint[0] = range[0];
        if (range[1] > joint[1]) joint[1] = range[1];
        if (joint[0] < joint[1] && !isogi_dvr__is_quiet(&m->dvr->integral, joint[0], joint[1], w->quiet)) break;
        isogi_dvr__pass_block(w, n);
    }
    if (w->t >= m->length) here = m->count + 1;
    else if (w->t > t) {
        const uint64_t last = (uint64_t)isogi_dvr__clamp(w->t / m->piece + m->shift - 1e-6, (double)m->count);
        here = last > here ? last : here;
    }
    w->t = before;
    return here;
}

/* Samples a step apart (Kraus 2005, eq. 5): the pieces between them, taken as monotone. The pieces within empty blocks are left out:
   nothing that they hold counts. */
static int isogi_dvr__next_sampled(isogi_dvr__walk *w, isogi_dvr__stretch *p) {
    isogi_dvr__march *m = w->m;
    double local[3], value = 0;
    int cell[3], i;
    while (m->next <= m->count && m->count) {
        double t = isogi_dvr__piece_begin(m, m->next);
        uint64_t last;
        int had = w->chained;
        if (t > m->length) t = m->length;
        w->chained = isogi_dvr__value_at(m, t, cell, local, &value);
        p->from = p->t0 = w->t, p->to = t, p->dt = t - w->t, p->u0 = 0, p->u1 = 1;
        p->value[0] = w->value, p->value[1] = value;
        had = had && w->chained && p->dt > 0;
        if (w->chained) w->value = value;
        w->t = t, last = isogi_dvr__last_empty(w, cell, t, m->next);
        if (last > m->next++) m->next = last, w->chained = 0; /* where the piece begins that leaves them */
        if (!had) continue;
        for (i = 0; i < 4; i++) p->b[i] = p->value[0] + (p->value[1] - p->value[0]) * i / 3;
        memcpy(p->cell, cell, sizeof cell);
        return 1;
    }
    return 0;
}

/* u at which the piece has a value between those at its ends: bisection that Newton's step replaces where it stays within the bracket. */
static double isogi_dvr__place_of(const isogi_dvr__stretch *p, double value) {
    const double *b = p->b;
    double low = p->u0, high = p->u1, rising = p->value[1] > p->value[0] ? 1 : -1, u;
    int n;
    u = low + (high - low) * isogi_dvr__clamp((0.5 * value - 0.5 * p->value[0]) / (0.5 * p->value[1] - 0.5 * p->value[0]), 1);
    for (n = 0; n < 80; n++) {
        double v = 1 - u, f = rising * (isogi_dvr__bernstein(b, u) - value), next;
        double slope = 3 * rising * (v * v * (b[1] - b[0]) + 2 * u * v * (b[2] - b[1]) + u * u * (b[3] - b[2]));
        if (f < 0) low = u;
        else high = u;
        next = slope > 0 ? u - f / slope : 0.5 * (low + high);
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        if (fabs(next - u) < 1e-15) return next;
        u = next;
    }
    return u;
}

/* ==== crossings of peaks ============================================================================================= */

/* The next crossing of every peak along one ray. `left` bounds the crossings that a ray can have (three a cell). */
typedef struct isogi_dvr__crossings {
    const isogi_dvr *dvr;
    float dir[3];
    double shift;    /* the march's t minus the ray's t */
    double end;      /* where clip planes end the ray, in the march's t */
    size_t count;    /* peaks */
    uint64_t left;
    double t[ISOGI_DVR_MAX_PEAKS]; /* of the march; 1e300 = no more */
    isogi_hit hit[ISOGI_DVR_MAX_PEAKS];
    isogi_counters work;
} isogi_dvr__crossings;

/* The ray begins a voxel before it enters: its direction is rounded to floats, which from afar would lead elsewhere. */
static void isogi_dvr__begin_crossings(isogi_dvr__crossings *c, const isogi_dvr *d, const double origin[3], const double dir[3],
                                       const isogi_dvr__march *m) {
    const double before = m->enter - d->spacing / m->speed, start = before > 0 ? before : 0;
    isogi_ray ray;
    size_t i;
    int a;
    c->dvr = d, c->shift = start - m->enter, c->end = m->cut ? m->length : 1e300, c->count = d->transfer.peak_count, c->left = 1;
    memset(&c->work, 0, sizeof c->work);
    if (!c->count) return;
    memset(&ray, 0, sizeof ray);
    for (a = 0; a < 3; a++) {
        ray.origin[a] = origin[a] + start * dir[a], ray.dir[a] = c->dir[a] = (float)dir[a];
        c->left += 3 * (uint64_t)d->volume.size[a];
    }
    c->left *= c->count;
    for (i = 0; i < c->count; i++) {
        memset(&c->hit[i], 0, sizeof c->hit[i]);
        ray.isovalue = d->transfer.peaks[i].isovalue;
        if (d->clip_count) ray.tmin = m->enter - start;
        if (m->cut) ray.tmax = (m->enter + m->length - start) * (1 + 1e-6);
        if (d->transfer.peaks[i].opacity > 0) isogi_vol_intersect(d->desc.pyramid, &ray, 1, &c->hit[i], &c->work);
        c->t[i] = c->hit[i].side && c->hit[i].t + c->shift <= c->end ? c->hit[i].t + c->shift : 1e300;
    }
}

/* The first of the coming crossings; count when there is none before t. Peaks of one value come in the order given. */
static size_t isogi_dvr__first_crossing(const isogi_dvr__crossings *c, double t) {
    size_t best = c->count, i;
    for (i = 0; i < c->count; i++)
        if (c->t[i] < t) t = c->t[i], best = i;
    return best;
}

static void isogi_dvr__pass_crossing(isogi_dvr__crossings *c, size_t i) {
    isogi_hit hit;
    memset(&hit, 0, sizeof hit);
    if (c->left) {
        c->left--;
        isogi_vol_continue(c->dvr->desc.pyramid, &c->hit[i], (const float(*)[3])&c->dir, NULL, c->dvr->transfer.peaks[i].isovalue,
                           ISOGI_RAY_ONWARD, 1, &hit, &c->work);
    }
    c->t[i] = hit.side && c->t[i] + hit.t <= c->end ? c->t[i] + hit.t : 1e300;
    c->hit[i] = hit;
}

/* ==== visibility ===================================================================================================== */

static void isogi_dvr__add(isogi_counters *to, const isogi_counters *from) {
    if (!to) return;
    to->rays += from->rays, to->blocks += from->blocks, to->cells += from->cells, to->cubics += from->cubics;
    to->texels += from->texels, to->texels_skipped += from->texels_skipped;
    to->samples += from->samples, to->blocks_skipped += from->blocks_skipped;
}

/* What a grid point counts for in shading. One on a surface sees half of its surroundings, one below what is opaque hardly any, knows
   nothing of the surface beside it, and would leave a dark blotch there: it stands back behind its neighbours outside. In matter that
   lets light in, what points below see is what dims it there: those that see a fifth count in full. */
static float isogi_dvr__openness(float v0) {
    float share = v0 / 0.70898154f; /* of a fifth of sqrt(4 pi) */
    share = share > 0.025f ? share : 0.025f;
    return share < 1 ? share * share : 1;
}

/* How far along a ray visibility may be looked up in front of dense matter: one and a half distances of the grid, as it stands along this
   ray. dir: voxels for each unit of what is returned. */
static double isogi_dvr__reach_along(const isogi_dvr *d, const double dir[3]) {
    double sum = 0;
    int a;
    for (a = 0; a < 3; a++) sum += dir[a] * (double)d->grid_scale[a] * (dir[a] * (double)d->grid_scale[a]);
    return sum > 1e-280 ? 1.5 / sqrt(sum) : 0;
}

/* How far in front of a sample visibility is looked up, towards the eye; in units of the reach. Where much of the light is lost
   from one grid point to the next, what lies between two of them is not visibility but how deep each is buried: rings and blotches.
   The skin of dense matter is therefore lit as the points in front of it are. depth: optical, of the reach. */
static double isogi_dvr__stand_off(double reach, double depth) {
    depth = depth < 1e9 ? depth : 1e9;
    return reach * (depth * depth / (depth * depth + 16));
}

/* How far grid points are weighed by their openness, 0..1: in matter so dense that light is looked up more than half of the reach in front
   of it. What is less dense has no surface that the grid could miss: light falls off evenly from point to point, and dark points left out
   would be rings, one for each plane of the grid. */
static double isogi_dvr__by_openness(double reach, double off) { return off > 0.5 * reach ? 2 * off / reach - 1 : 0; }

/* out += factor * from */
static void isogi_dvr__add_scaled(float *out, const float *from, float factor, size_t count) {
    size_t i = 0;
#ifdef ISOGI_DVR__VECTORS
    for (; i + 4 <= count; i += 4) ISOGI_DVR__4(out + i) += factor * ISOGI_DVR__C4(from + i);
#endif
    for (; i < count; i++) out[i] += factor * from[i];
}

/* A peak that is looked at: light on its other side counts as far as the peak lets it through. */
typedef struct isogi_dvr__sheet {
    double isovalue, behind; /* what grid points on the other side count for */
    int side;                /* +1 where values rise along the ray, else -1 */
} isogi_dvr__sheet;

/* What a grid point counts for, by its own value. Without one (NaN) it is on no side. */
static float isogi_dvr__sheet_weight(const isogi_dvr *d, const isogi_dvr__sheet *sheet, const size_t point[3]) {
    double corner[8], u[3], value;
    int cell[3], a, i, n;
    for (a = 0; a < 3; a++) {
        const int cells = (int)d->cells[a];
        const double x = (d->desc.grid[a] > 1 ? (double)point[a] / (double)(d->desc.grid[a] - 1) : 0.5) * cells;
        cell[a] = (int)x < cells ? (int)x : cells - (cells > 0), u[a] = x - cell[a];
    }
    if (!isogi_vol_corners(d->desc.pyramid, cell, corner)) return 1;
    for (a = 0, n = 4; a < 3; a++, n /= 2) /* from the nearer side: between equal values it is those, which may be the peak's */
        for (i = 0; i < n; i++) {
            const double from = corner[2 * i], to = corner[2 * i + 1];
            corner[i] = u[a] < 0.5 ? from + u[a] * (to - from) : to + (1 - u[a]) * (from - to);
        }
    value = corner[0];
    return (value < sheet->isovalue) == (sheet->side > 0) ? 1 : (float)sheet->behind;
}

/* Trilinear in the grid of visibility: the eight points around a position given in the volume's grid coordinates; `open`, 0..1: how far
   each is weighed by what it counts for; sheet (may be NULL; brute force's regular grid alone): what is looked at there. */
static void isogi_dvr__visibility_at(const isogi_dvr *d, const double position[3], double open, const isogi_dvr__sheet *sheet, float *out) {
    float total = 0;
    size_t base = 0, cell[3], offset[3], stride = 1, i, k;
    double u[3];
    int a;
    for (a = 0; a < 3; a++) {
        size_t points = d->desc.grid[a], c;
        double x = d->cells[a] ? isogi_dvr__clamp(position[a] / d->cells[a], 1) * (double)(points - 1) : 0;
        c = (size_t)x;
        if (c && c >= points - 1) c = points - 2;
        cell[a] = c, u[a] = x - (double)c, base += c * stride, offset[a] = points > 1 ? stride : 0;
        stride *= points;
    }
    if (d->held.block) {
        double within[3];
        memcpy(within, u, sizeof u);
        base = isogi_dvr__held_cell(&d->held, cell, within, offset, u);
    }
    base *= d->coefficients;
    for (a = 0; a < 3; a++) offset[a] *= d->coefficients;
    for (i = 0; i < d->coefficients; i++) out[i] = 0;
    for (k = 0; k < 8; k++) {
        const float *v = d->visibility + base + (k & 1 ? offset[0] : 0) + (k & 2 ? offset[1] : 0) + (k & 4 ? offset[2] : 0);
        float w = (float)((k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) * (k & 4 ? u[2] : 1 - u[2]));
        if (open > 0) w *= 1 + (float)open * (isogi_dvr__openness(v[0]) - 1);
        if (sheet && v[0] > 0 && !d->held.block) {
            const size_t point[3] = {cell[0] + (k & 1), cell[1] + (k >> 1 & 1), cell[2] + (k >> 2)};
            w *= isogi_dvr__sheet_weight(d, sheet, point);
        }
        isogi_dvr__add_scaled(out, v, w, d->coefficients);
        total += w;
    }
    if (open > 0 || sheet)
        for (i = 0; i < d->coefficients; i++) out[i] /= total;
}

/* What the peaks crossed on a monotone piece let through. `touched`: the last peak that a rising piece ended on, and where it did: a
   falling one that begins there does not cross it again (as in isogi_dvr__divide_piece). */
static double isogi_dvr__clear_of_peaks(const isogi_dvr *d, const isogi_dvr__stretch *p, double touched[2]) {
    const isogi_dvr__integral *g = &d->integral;
    double clear = 1;
    size_t i = isogi_dvr__ranks_below(g, p->value[0]);
    if (p->value[0] < p->value[1])
        for (; i < g->rank_count && g->rank[i].isovalue <= p->value[1]; i++) {
            clear *= 1 - (double)d->transfer.peaks[g->rank[i].peak].opacity;
            touched[0] = g->rank[i].isovalue, touched[1] = g->rank[i].isovalue < p->value[1] ? -1 : p->to;
        }
    else
        for (; i && g->rank[i - 1].isovalue > p->value[1]; i--)
            if (g->rank[i - 1].isovalue < touched[0] || g->rank[i - 1].isovalue > touched[0] || p->from > touched[1])
                clear *= 1 - (double)d->transfer.peaks[g->rank[i - 1].peak].opacity;
    return clear;
}

/* In data space, cell by cell without a step: only the values at the ends of monotone pieces count (Kraus 2005, eq. 3). */
static double isogi_dvr__clear_of_values(isogi_dvr__march *m) {
    const isogi_dvr *d = m->dvr;
    isogi_dvr__walk walk;
    isogi_dvr__stretch p;
    double depth = 0, clear = 1, limit = -log(ISOGI_DVR__NEGLIGIBLE), touched[2] = {0, -1};
    if (d->transparent) return 1;
    isogi_dvr__begin_walk(&walk, m);
    while (clear > ISOGI_DVR__NEGLIGIBLE && depth < limit && isogi_dvr__next_monotone(&walk, &p)) {
        double low = p.value[0] < p.value[1] ? p.value[0] : p.value[1], high = p.value[0] < p.value[1] ? p.value[1] : p.value[0];
        if (isogi_dvr__is_quiet(&d->integral, low, high, walk.quiet)) continue;
        if (d->integral.count) depth += isogi_dvr__depth_between(&d->integral, low, high);
        if (d->integral.rank_count) clear *= isogi_dvr__clear_of_peaks(d, &p, touched);
    }
    return clear * exp(-depth);
}

static double isogi_dvr__transmittance(const isogi_dvr *d, const double grid[3], const double world[3], const double direction[6],
                                       isogi_dvr__crossings *crossings, isogi_counters *work) {
    isogi_dvr__march march;
    isogi_dvr__sample sample;
    double depth = 0, clear = 1, limit = -log(ISOGI_DVR__NEGLIGIBLE);
    size_t i;
    work->rays++;
    if (!isogi_dvr__begin(&march, d, grid, direction, sqrt(isogi_dvr__dot(direction + 3, direction + 3)), 1e300, d->visibility_step))
        return 1;
    march.unlit = 1;
    if (isogi_dvr__by_value(d)) {
        clear = isogi_dvr__clear_of_values(&march);
        isogi_dvr__add(work, &march.work);
        return clear > ISOGI_DVR__NEGLIGIBLE ? clear : 0;
    }
    if (d->transfer.peak_count) {
        isogi_dvr__begin_crossings(crossings, d, world, direction + 3, &march);
        while (clear > ISOGI_DVR__NEGLIGIBLE && (i = isogi_dvr__first_crossing(crossings, 1e300)) < crossings->count) {
            clear *= 1 - (double)d->transfer.peaks[i].opacity;
            isogi_dvr__pass_crossing(crossings, i);
        }
        work->blocks += crossings->work.blocks, work->cells += crossings->work.cells, work->cubics += crossings->work.cubics;
    }
    while (clear > ISOGI_DVR__NEGLIGIBLE && depth < limit && isogi_dvr__next(&march, &sample)) depth += sample.depth;
    work->blocks += march.work.blocks, work->blocks_skipped += march.work.blocks_skipped;
    clear *= exp(-depth);
    return clear > ISOGI_DVR__NEGLIGIBLE ? clear : 0;
}

typedef struct isogi_dvr__step_job {
    isogi_dvr *dvr;
    size_t first, end;
    isogi_counters *work; /* one for each task */
} isogi_dvr__step_job;

static void isogi_dvr__step_task(void *arg, size_t task) {
    const isogi_dvr__step_job *job = (const isogi_dvr__step_job *)arg;
    const isogi_dvr *d = job->dvr;
    size_t point = job->first + task * ISOGI_DVR__CHUNK, end = point + ISOGI_DVR__CHUNK, i, k;
    isogi_dvr__crossings crossings;
    memset(&job->work[task], 0, sizeof *job->work);
    for (; point < end && point < job->end; point++) {
        double sum[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER] = {0}, grid[3], world[3];
        size_t rest = point;
        int a;
        for (a = 0; a < 3; a++) {
            size_t points = d->desc.grid[a], j = rest % points;
            grid[a] = points > 1 ? (double)j * d->cells[a] / (double)(points - 1) : 0.5 * d->cells[a];
            rest /= points;
        }
        isogi_vol_to_world(d->desc.pyramid, grid, world);
        for (k = 0; k < (size_t)d->desc.directions; k++) {
            double clear = isogi_dvr__transmittance(d, grid, world, d->direction[k], &crossings, &job->work[task]);
            if (clear > 0)
                for (i = 0; i < d->coefficients; i++) sum[i] += clear * (double)d->kernel[k * d->coefficients + i];
        }
        for (i = 0; i < d->coefficients; i++) job->dvr->visibility[point * d->coefficients + i] = (float)sum[i];
        job->work[task].texels++;
    }
}

/* The mean of a transfer function's extinction over a range of values: exact, piece by piece, so that a peak narrower than a class is not
   lost. */
static float isogi_dvr__mean_extinction(const isogi_dvr__transfer *t, double from, double to) {
    double mean = 0, x = from, at;
    size_t next;
    if (!t->point_count) return 0;
    at = isogi_dvr__extinction(t->points, t->point_count, x);
    if (!(to > from)) return (float)isogi_dvr__clamp(at, 1e30);
    for (next = isogi_dvr__points_below(t->points, t->point_count, x); next < t->point_count && t->points[next].value < to; next++) {
        mean += 0.5 * (at + (double)t->points[next].extinction) * (t->points[next].value - x);
        x = t->points[next].value, at = (double)t->points[next].extinction;
    }
    mean = (mean + 0.5 * (at + isogi_dvr__extinction(t->points, t->point_count, to)) * (to - x)) / (to - from);
    return (float)isogi_dvr__clamp(mean, 1e30);
}

/* Extinction of the classes. */
static void isogi_dvr__set_table(const isogi_dvr *d, float table[ISOGI_DVR__TABLE]) {
    const double low = d->matter.low, scale = d->matter.scale;
    size_t i, next = 0, classes[2];
    double ends[2], step;
    for (i = 0; i < ISOGI_DVR__TABLE; i++) {
        isogi_dvr__class_ends(d, low, scale, i, ISOGI_DVR__TABLE, ends);
        table[i] = isogi_dvr__mean_extinction(&d->transfer, ends[0], ends[1]);
    }
    while (isogi_dvr__next_step(d, low, scale, ISOGI_DVR__TABLE, &next, &step, classes))
        for (i = classes[0]; i <= classes[1]; i++) {
            isogi_dvr__class_ends(d, low, scale, i, ISOGI_DVR__TABLE, ends);
            table[i] = isogi_dvr__mean_extinction(&d->transfer, step, ends[1]);
        }
}

/* Values between four rows of voxels; they count from `low`. */
static void isogi_dvr__mix_rows(const isogi_volume *v, double low, size_t first, size_t count, const double position[2], float *row,
                                float *scratch) {
    size_t c[2], k, i;
    double u[2];
    int a;
    for (a = 0; a < 2; a++) {
        size_t last = v->size[a + 1] - 1;
        double x = isogi_dvr__clamp(position[a], (double)last);
        c[a] = (size_t)x;
        if (c[a] && c[a] >= last) c[a] = last - 1;
        u[a] = x - (double)c[a];
    }
    memset(row, 0, count * sizeof *row);
    for (k = 0; k < 4; k++) {
        float w = (float)((k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]));
        if (!(w > 0)) continue;
        isogi_dvr__read_row(v, low, first, count, c[0] + (k & 1), c[1] + (k >> 1), scratch);
        for (i = 0; i < count; i++) row[i] += w * scratch[i];
    }
}

/* sum[i] += extinction at lattice positions from + i * distance (voxels) of a row of voxels that begins at `first`; low: where the classes
   begin in it. */
static void isogi_dvr__classify_row(const isogi_dvr *d, const float *row, size_t first, size_t last, double from, double distance,
                                    size_t count, float low, float *sum) {
    float scale = (float)d->matter.scale;
    size_t i;
    for (i = 0; i < count; i++) {
        double x = isogi_dvr__clamp(from + (double)i * distance, (double)last);
        size_t c = (size_t)x, k;
        float value, u, next;
        if (c && c >= last) c = last - 1;
        u = (float)(x - (double)c), next = row[c + (last > 0) - first];
        value = row[c - first] + u * (next - row[c - first]);
        if (!isogi_dvr__finite32(value)) /* a neighbour without weight; or floats whose difference is none */
            value = u > 0 ? u < 1 ? (float)((double)row[c - first] + (double)u * ((double)next - (double)row[c - first])) : next
                          : row[c - first];
        if (!isogi_dvr__finite32(value)) continue;
        value = (value - low) * scale;
        value = value > 0 ? value : 0;
        value = value < ISOGI_DVR__TABLE - 1 ? value : ISOGI_DVR__TABLE - 1;
        k = (size_t)value;
        sum[i] += d->matter.table[k];
    }
}

/* What a node's blocks ask for, those that its box touches: 0 = keep what it has, as none of them changed, 1 = none absorbs any more,
   2 = compute. One byte for each node of the row (y, z). Returns whether any is computed, and the span of those. */
static int isogi_dvr__row_state(const isogi_dvr *d, const size_t node[2], uint8_t *state, size_t span[2]) {
    const isogi_dvr__matter *m = &d->matter;
    const isogi_level *level = &d->level[1];
    size_t low[3], high[3], x, b[3];
    int a, any = 0;
    for (x = 0; x < m->size[0]; x++) {
        int changed = 0, absorbs = 0;
        for (a = x ? 0 : 2; a >= 0; a--) {
            double at = (double)(a ? node[a - 1] : x) * m->spacing[a], half = 0.5 * m->spacing[a], most = (double)level->size[a] - 1;
            low[a] = (size_t)isogi_dvr__clamp((at - half) / 16 - 1e-9, most), high[a] = (size_t)isogi_dvr__clamp((at + half) / 16, most);
        }
        for (b[2] = low[2]; b[2] <= high[2]; b[2]++)
            for (b[1] = low[1]; b[1] <= high[1]; b[1]++)
                for (b[0] = low[0]; b[0] <= high[0]; b[0]++) {
                    size_t block = b[0] + level->size[0] * (b[1] + level->size[1] * b[2]);
                    changed |= d->changed[block], absorbs |= !d->empty[1][block];
                }
        state[x] = (uint8_t)(changed ? 1 + absorbs : 0);
        if (state[x] < 2) continue;
        if (!any) span[0] = x;
        span[1] = x, any = 1;
    }
    return any;
}

/* The nodes of one z, the task-th of those at hand. */
static void isogi_dvr__matter_task(void *arg, size_t task) {
    isogi_dvr *d = (isogi_dvr *)arg;
    isogi_dvr__matter *m = &d->matter;
    const double base = isogi_dvr__count_from(d, m->low);
    size_t z = m->plane + task;
    float *scratch = m->scratch + task * m->scratch_row, *row = scratch + d->volume.size[0], *sum = row + d->volume.size[0];
    uint8_t *state = (uint8_t *)(sum + m->size[0]);
    size_t node[2], i, n[3], s[3], last = d->volume.size[0] - 1;
    int a;
    for (a = 0; a < 3; a++) n[a] = (size_t)ceil(m->spacing[a] - 0.1), n[a] = n[a] < 1 ? 1 : n[a];
    node[1] = z;
    for (node[0] = 0; node[0] < m->size[1]; node[0]++) {
        float *out = m->extinction[0] + (z * m->size[1] + node[0]) * m->row[0];
        size_t span[2] = {0, 0}, first, end, count;
        int any = isogi_dvr__row_state(d, node, state, span);
        for (i = 0; i < m->size[0]; i++)
            if (state[i]) out[i] = 0;
        if (!any) continue;
        count = span[1] - span[0] + 1;
        first = (size_t)isogi_dvr__clamp(((double)span[0] - 0.5) * m->spacing[0] - 1, (double)last);
        end = (size_t)isogi_dvr__clamp(((double)span[1] + 0.5) * m->spacing[0] + 2, (double)last);
        memset(sum, 0, count * sizeof *sum);
        for (s[2] = 0; s[2] < n[2]; s[2]++)
            for (s[1] = 0; s[1] < n[1]; s[1]++) {
                double position[2];
                for (a = 0; a < 2; a++)
                    position[a] = ((double)node[a] + ((double)s[a + 1] + 0.5) / (double)n[a + 1] - 0.5) * m->spacing[a + 1];
                isogi_dvr__mix_rows(&d->volume, base, first, end - first + 1, position, row, scratch);
                for (s[0] = 0; s[0] < n[0]; s[0]++) {
                    double from = ((double)span[0] + ((double)s[0] + 0.5) / (double)n[0] - 0.5) * m->spacing[0];
                    isogi_dvr__classify_row(d, row, first, last, from, m->spacing[0], count, (float)(m->low - base), sum);
                }
            }
        for (i = 0; i < count; i++) {
            double grid[3] = {(double)(span[0] + i) * m->spacing[0], (double)node[0] * m->spacing[1], (double)node[1] * m->spacing[2]};
            if (state[span[0] + i] == 2 && isogi_dvr__kept(d, grid)) out[span[0] + i] = sum[i] / (float)(n[0] * n[1] * n[2]);
        }
    }
}

/* The other layout: the plane of one x. */
static void isogi_dvr__turn_task(void *arg, size_t y) {
    const isogi_dvr__matter *m = &((const isogi_dvr *)arg)->matter;
    size_t x, z, x0;
    for (x0 = 0; x0 < m->size[0]; x0 += ISOGI_DVR__LANES)
        for (z = 0; z < m->size[2]; z++) {
            const float *from = m->extinction[0] + (z * m->size[1] + y) * m->row[0];
            for (x = x0; x < x0 + ISOGI_DVR__LANES && x < m->size[0]; x++) m->extinction[1][(x * m->size[1] + y) * m->row[1] + z] = from[x];
        }
}

/* What a plane of the lattice counts for, in rays: a quarter of the voxels that are read for it. */
static double isogi_dvr__plane_rays(const isogi_dvr *d, size_t z) {
    const isogi_level *level = &d->level[1];
    double at = (double)z * d->matter.spacing[2], half = 0.5 * d->matter.spacing[2], last = (double)level->size[2] - 1;
    size_t layer = level->size[0] * level->size[1], block = layer * (size_t)isogi_dvr__clamp((at - half) / 16 - 1e-9, last);
    size_t end = layer * ((size_t)isogi_dvr__clamp((at + half) / 16, last) + 1), count = 0;
    for (; block < end; block++) count += d->changed[block] && !d->empty[1][block];
    return (double)count * 16 * 16 * d->matter.spacing[2] / 4;
}

/* Points, blocks, directions or planes at a time, at most `count`. What is cancelled is lost, and a quarter is tried next: who gives steps
   little time by cancelling them gets on. */
static size_t isogi_dvr__portion(const isogi_dvr *d, size_t count) { return d->patience && d->patience < count ? d->patience : count; }

static isogi_result isogi_dvr__portion_end(isogi_dvr *d, size_t count, isogi_result result) {
    if (result == ISOGI_CANCELLED) d->patience = count / 4 + 1;
    else if (result == ISOGI_OK && d->patience) d->patience = d->patience < ISOGI_DVR__SLAB ? d->patience + d->patience / 2 + 1 : 0;
    return result;
}

/* Brings the lattice up to date with the transfer function, in the blocks marked as changed, plane by plane within a budget of rays (0 =
   all); at least one plane. *used: what they count for. */
static isogi_result isogi_dvr__update_matter(isogi_dvr *d, uint64_t max_rays, double *used) {
    isogi_dvr__matter *m = &d->matter;
    const size_t piece = isogi_dvr__portion(d, m->size[2] - m->prepared);
    isogi_context whole = d->context;
    isogi_result result;
    size_t end, rows, n;
    whole.progress = NULL;
    for (*used = 0, end = m->prepared; end < m->size[2] && end - m->prepared < piece; end++) {
        double rays = isogi_dvr__plane_rays(d, end);
        if (max_rays && end > m->prepared && *used + rays > (double)max_rays) break;
        *used += rays;
    }
    rows = end - m->prepared, m->plane = m->prepared;
    m->scratch_row = 2 * d->volume.size[0] + 2 * m->size[0] + ISOGI_DVR__LANES;
    if (rows > SIZE_MAX / 64 / m->scratch_row) return ISOGI_TOO_LARGE;
    m->table = (float *)isogi_allocate(&d->context, ISOGI_DVR__TABLE, sizeof *m->table);
    m->scratch = (float *)isogi_allocate(&d->context, rows * m->scratch_row, sizeof *m->scratch);
    result = m->table && m->scratch ? ISOGI_OK : ISOGI_NO_MEMORY;
    if (result == ISOGI_OK) {
        isogi_dvr__set_table(d, m->table);
        result = isogi_dvr__portion_end(d, rows, isogi_parallel(&d->context, rows, isogi_dvr__matter_task, d, 0, 0));
    }
    if (result == ISOGI_OK && end == m->size[2]) result = isogi_parallel(&whole, m->size[1], isogi_dvr__turn_task, d, 0, 0);
    isogi_release(&d->context, m->table, ISOGI_DVR__TABLE, sizeof *m->table);
    isogi_release(&d->context, m->scratch, rows * m->scratch_row, sizeof *m->scratch);
    m->table = m->scratch = NULL;
    if (result == ISOGI_OK) m->prepared = end;
    if (result != ISOGI_OK || end < m->size[2]) return result;
    for (n = 0; n < d->changed_count; n++) d->classified += d->changed[n];
    memset(d->changed, 0, d->changed_count);
    return ISOGI_OK;
}

/* ==== selection of levels ============================================================================================ */

/* CIE L*u*v* (D65) of a colour seen through one voxel over black. */
static void isogi_dvr__luv(const double rgb[3], double opacity, double luv[3]) {
    double r = rgb[0] * opacity, g = rgb[1] * opacity, b = rgb[2] * opacity;
    double x = 0.4124564 * r + 0.3575761 * g + 0.1804375 * b, y = 0.2126729 * r + 0.7151522 * g + 0.0721750 * b;
    double z = 0.0193339 * r + 0.1191920 * g + 0.9503041 * b, sum = x + 15 * y + 3 * z;
    luv[0] = y > 0.008856452 ? 116 * cbrt(y) - 16 : 903.2963 * y;
    luv[1] = sum > 1e-12 ? 13 * luv[0] * (4 * x / sum - 0.19783982) : 0;
    luv[2] = sum > 1e-12 ? 13 * luv[0] * (9 * y / sum - 0.46833630) : 0;
}

static void isogi_dvr__luv_of(const isogi_dvr *d, double value, double luv[3]) {
    double rgb[3] = {0, 0, 0}, extinction = 0;
    if (d->transfer.point_count) {
        isogi_dvr__colour(d->transfer.points, d->transfer.point_count, value, rgb);
        extinction = isogi_dvr__extinction(d->transfer.points, d->transfer.point_count, value);
    }
    isogi_dvr__luv(rgb, -expm1(-extinction * d->spacing / d->desc.unit), luv);
}

/* The largest difference between what a block holds and its average. */
static double isogi_dvr__significance(const isogi_dvr *d, size_t block, double (*luv)[3]) {
    const isogi_dvr__blocks *b = &d->blocks;
    double mean = 0, nodes = 0, at[3], most = 0;
    size_t c[3], k, i;
    for (k = 0; k < 8; k++) {
        float value;
        c[0] = block % b->count[0] + (k & 1), c[1] = block / b->count[0] % b->count[1] + (k >> 1 & 1),
        c[2] = block / b->count[0] / b->count[1] + (k >> 2);
        value = isogi_dvr__lattice_at(d, 4, c);
        if (isogi_dvr__finite32(value)) mean += (double)value, nodes++;
    }
    if (nodes > 0) isogi_dvr__luv_of(d, d->base + mean / nodes, at);
    else memset(at, 0, sizeof at);
    for (i = 0; i < 64; i++) {
        double difference[3] = {luv[i][0] - at[0], luv[i][1] - at[1], luv[i][2] - at[2]}, size = isogi_dvr__dot(difference, difference);
        if ((b->histogram[block] >> i & 1) && size > most) most = size;
    }
    return sqrt(most);
}

/* A heap of blocks; the largest gain per point on top. */
typedef struct isogi_dvr__raise {
    double gain;
    size_t block;
} isogi_dvr__raise;

static int isogi_dvr__before(const isogi_dvr__raise *a, const isogi_dvr__raise *b) {
    return a->gain > b->gain || (!(a->gain < b->gain) && a->block < b->block);
}

static void isogi_dvr__sift(isogi_dvr__raise *heap, size_t count, size_t i) {
    for (;;) {
        size_t child = 2 * i + 1;
        isogi_dvr__raise swap;
        if (child >= count) return;
        if (child + 1 < count && isogi_dvr__before(&heap[child + 1], &heap[child])) child++;
        if (!isogi_dvr__before(&heap[child], &heap[i])) return;
        swap = heap[i], heap[i] = heap[child], heap[child] = swap;
        i = child;
    }
}

/* Points of a block at a level, not counting the repeated ones. */
static size_t isogi_dvr__level_points(const isogi_dvr__blocks *b, size_t block, size_t n) {
    size_t side[3];
    isogi_dvr__sides(b, block, n, side);
    return side[0] * side[1] * side[2];
}

/* The level that a block should have: 1, or one whose nodes are no further apart than what the block holds of the volume is wide. */
static uint8_t isogi_dvr__fair_level(const isogi_dvr__blocks *b, size_t block) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, level = 1;
    int a;
    for (a = 0; a < 3; a++)
        while (at[a] + 1 == b->count[a] && level * b->rest[a] < 16) level *= 2;
    return (uint8_t)level;
}

/* Levels of all blocks: transparent ones are dropped, the others begin with one point each. Those that the border cuts thin take what
   they should have, in their order; then blocks are raised by largest significance for its cost until the budget of voxels / reduction
   points is spent. Significance is taken to halve with each raise and points to grow eightfold, from the level that a block began with. */
static isogi_result isogi_dvr__select_levels(isogi_dvr *d, uint8_t *level) {
    const isogi_dvr__blocks *b = &d->blocks;
    isogi_dvr__raise *heap = (isogi_dvr__raise *)isogi_allocate(&d->context, b->total, sizeof *heap);
    double luv[64][3], budget = (double)d->volume.size[0] * (double)d->volume.size[1] * (double)d->volume.size[2] / d->desc.reduction;
    size_t count = 0, i, end;
    if (!heap) return ISOGI_NO_MEMORY;
    for (i = 0; i < ISOGI_DVR__TABLE; i = end) { /* a bin by the class in its middle */
        for (end = i + 1; end < ISOGI_DVR__TABLE && b->bin[end] == b->bin[i];) end++;
        isogi_dvr__luv_of(d, d->matter.low + 0.5 * (double)(i + end) / d->matter.scale, luv[b->bin[i]]);
    }
    memset(luv[ISOGI_DVR__NOT_FINITE], 0, sizeof luv[0]); /* transparent */
    for (i = 0; i < b->total; i++) {
        level[i] = !d->empty[1][i];
        budget -= level[i];
    }
    for (i = 0; i < b->total; i++) {
        uint8_t fair = isogi_dvr__fair_level(b, i);
        double cost = (double)isogi_dvr__level_points(b, i, fair) - 1;
        if (!level[i]) continue;
        if (cost <= 0 || cost <= budget) budget -= cost, level[i] = fair;
        if (level[i] < 16) heap[count].block = i, heap[count++].gain = isogi_dvr__significance(d, i, luv) / 7;
    }
    for (i = count / 2; i-- > 0;) isogi_dvr__sift(heap, count, i);
    while (count && budget > 0 && heap[0].gain > 0) {
        size_t n = level[heap[0].block];
        double cost = (double)(isogi_dvr__level_points(b, heap[0].block, 2 * n) - isogi_dvr__level_points(b, heap[0].block, n));
        /* half for eight times the points */
        if (cost <= budget) budget -= cost, level[heap[0].block] = (uint8_t)(2 * n), heap[0].gain /= 16;
        else heap[0].gain = 0;
        if (2 * n >= 16 || !(heap[0].gain > 0)) heap[0] = heap[--count];
        isogi_dvr__sift(heap, count, 0);
    }
    isogi_release(&d->context, heap, b->total, sizeof *heap);
    return ISOGI_OK;
}

/* Does any block within `reach` of this one have a mark? */
static int isogi_dvr__any_near(const isogi_dvr__blocks *b, size_t block, size_t reach, const uint8_t *mark) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, low[3], high[3], c[3];
    int a;
    for (a = 0; a < 3; a++)
        low[a] = at[a] > reach ? at[a] - reach : 0, high[a] = b->count[a] - at[a] > reach ? at[a] + reach : b->count[a] - 1;
    for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[0] = low[0]; c[0] <= high[0]; c[0]++)
                if (mark[c[0] + b->count[0] * (c[1] + b->count[1] * c[2])]) return 1;
    return 0;
}

static size_t isogi_dvr__nodes(const isogi_dvr__blocks *b, size_t block, size_t n) {
    size_t side[3];
    isogi_dvr__sides(b, block, n, side);
    return n ? (side[0] + 1) * (side[1] + 1) * (side[2] + 1) : 0;
}

/* The coarsest of the blocks that touch a node of a block, and the one whose own the node is: the last of those of that level.
   at: the block; node: of its level n. */
static void isogi_dvr__touching(const isogi_dvr__blocks *b, const uint8_t *level, const size_t at[3], const size_t node[3], size_t n,
                                size_t *coarsest, size_t *owner) {
    size_t low[3], high[3], c[3];
    int a;
    for (a = 0; a < 3; a++) {
        low[a] = node[a] == 0 && at[a] ? at[a] - 1 : at[a];
        high[a] = node[a] == n && at[a] + 1 < b->count[a] ? at[a] + 1 : at[a];
    }
    *coarsest = *owner = at[0] + b->count[0] * (at[1] + b->count[1] * at[2]);
    for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[0] = low[0]; c[0] <= high[0]; c[0]++) {
                size_t i = c[0] + b->count[0] * (c[1] + b->count[1] * c[2]);
                if (!level[i]) continue;
                if (level[i] < level[*coarsest]) *coarsest = *owner = i;
                else if (level[i] == level[*coarsest]) *owner = i;
            }
}

/* A place in a block of level n: the first of its eight nodes, how far from it they are, and the weights. */
static size_t isogi_dvr__place(const isogi_dvr__blocks *b, size_t block, size_t n, const double position[3], size_t corner[8], float w[8]) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, node[3], side[3], k;
    float u[3];
    int a;
    isogi_dvr__sides(b, block, n, side);
    for (a = 0; a < 3; a++) {
        double x = isogi_dvr__clamp((position[a] - 16.0 * (double)at[a]) * (double)n / 16, (double)side[a]);
        node[a] = (size_t)x;
        if (node[a] >= side[a]) node[a] = side[a] - 1;
        u[a] = (float)(x - (double)node[a]);
    }
    for (k = 0; k < 8; k++) corner[k] = (k & 1) + (side[0] + 1) * ((k >> 1 & 1) + (side[1] + 1) * (k >> 2));
    for (k = 0; k < 8; k++) w[k] = (k & 1 ? u[0] : 1 - u[0]) * (k & 2 ? u[1] : 1 - u[1]) * (k & 4 ? u[2] : 1 - u[2]);
    return node[0] + (side[0] + 1) * (node[1] + (side[1] + 1) * node[2]);
}

static size_t isogi_dvr__block_of(const isogi_dvr__blocks *b, const double position[3]) {
    size_t c[3];
    int a;
    for (a = 0; a < 3; a++) c[a] = (size_t)isogi_dvr__clamp(position[a] / 16, (double)b->count[a] - 1);
    return c[0] + b->count[0] * (c[1] + b->count[1] * c[2]);
}

static void isogi_dvr__node_position(const isogi_dvr__blocks *b, size_t block, size_t n, const size_t node[3], double position[3]) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]};
    int a;
    for (a = 0; a < 3; a++) position[a] = 16.0 * (double)at[a] + 16.0 * (double)node[a] / (double)n;
}

/* ---- data in its blocks ---- */

/* The data that the blocks hold, interpolated, less the base; not finite beside what is not; what is not held is the lowest value. */
static float isogi_dvr__block_value(const isogi_dvr *d, size_t block, const double position[3]) {
    const isogi_dvr__blocks *b = &d->blocks;
    size_t n = b->level[block], base, corner[8], k;
    float w[8], sum = 0;
    if (!n) return (float)(d->range[0] - d->base);
    base = b->first[block] + isogi_dvr__place(b, block, n, position, corner, w);
    for (k = 0; k < 8; k++) /* a node of no weight may not be finite */
        if (w[k] > 0) sum += w[k] * b->data[base + corner[k]];
    return sum;
}

/* Blocks of one level, from coarse to fine: every node from the coarsest block that touches it, or from the data's average. */
static void isogi_dvr__pack_task(void *arg, size_t block) {
    isogi_dvr *d = (isogi_dvr *)arg;
    isogi_dvr__blocks *b = &d->blocks;
    size_t n = b->level[block], at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]},
           node[3], side[3], c[3];
    float *out;
    int step = 0, a;
    if (n != b->packing) return;
    out = b->data + b->first[block];
    while (((size_t)16 >> step) > n) step++;
    isogi_dvr__sides(b, block, n, side);
    for (node[2] = 0; node[2] <= side[2]; node[2]++)
        for (node[1] = 0; node[1] <= side[1]; node[1]++)
            for (node[0] = 0; node[0] <= side[0]; node[0]++) {
                size_t coarsest = block, owner;
                int border = 0;
                for (a = 0; a < 3; a++) border |= !node[a] || node[a] == n, c[a] = at[a] * n + node[a];
                if (border) isogi_dvr__touching(b, b->level, at, node, n, &coarsest, &owner);
                if (b->level[coarsest] < n) {
                    double position[3];
                    isogi_dvr__node_position(b, block, n, node, position);
                    *out++ = isogi_dvr__block_value(d, coarsest, position);
                } else *out++ = isogi_dvr__lattice_at(d, step, c);
            }
}

/* Room for new levels. Local visibility of blocks that stay as they are is kept; the others begin without shadows. */
static isogi_result isogi_dvr__lay_out(isogi_dvr *d, const uint8_t *level, const uint8_t *lit) {
    isogi_dvr__blocks *b = &d->blocks;
    size_t data_count = 0, sh_count = 0, i, *first = (size_t *)isogi_allocate(&d->context, 2 * b->total, sizeof *first);
    float *data;
    uint16_t *sh;
    for (i = 0; first && i < b->total; i++) {
        first[i] = data_count, first[b->total + i] = sh_count;
        data_count += isogi_dvr__nodes(b, i, level[i]), sh_count += isogi_dvr__nodes(b, i, lit[i]);
    }
    data = (float *)isogi_allocate(&d->context, data_count, sizeof *data);
    sh = sh_count > SIZE_MAX / d->coefficients ? NULL : (uint16_t *)isogi_allocate(&d->context, sh_count * d->coefficients, sizeof *sh);
    if (!first || (data_count && !data) || (sh_count && !sh)) {
        isogi_release(&d->context, first, 2 * b->total, sizeof *first);
        isogi_release(&d->context, data, data_count, sizeof *data);
        isogi_release(&d->context, sh, sh_count * d->coefficients, sizeof *sh);
        return ISOGI_NO_MEMORY;
    }
    for (i = 0; i < b->total; i++) {
        size_t count = isogi_dvr__nodes(b, i, lit[i]) * d->coefficients, k;
        uint16_t *to;
        if (!count) continue;
        to = sh + first[b->total + i] * d->coefficients;
        if (lit[i] == b->lit[i]) memcpy(to, b->sh + b->first[b->total + i] * d->coefficients, count * sizeof *to);
        else
            for (k = 0; k < count; k++) to[k] = k % d->coefficients ? 0 : isogi_float_to_half((float)(2 * sqrt(ISOGI_DVR__PI)));
    }
    isogi_release(&d->context, b->first, 2 * b->total, sizeof *first);
    isogi_release(&d->context, b->data, b->data_count, sizeof *data);
    isogi_release(&d->context, b->sh, b->sh_count * d->coefficients, sizeof *sh);
    b->first = first, b->data = data, b->sh = sh, b->data_count = data_count, b->sh_count = sh_count;
    memcpy(b->level, level, b->total), memcpy(b->lit, lit, b->total);
    return ISOGI_OK;
}

/* Histograms for the present bins, within a budget of rays (0 = all), for which a block's voxels count as much as its local rays do: a
   block at least. *used: what they count for; b->counted == b->total when they are all there. */
static isogi_result isogi_dvr__count_blocks(isogi_dvr *d, uint64_t max_rays, double *used) {
    isogi_dvr__blocks *b = &d->blocks;
    const isogi_dvr__matter *m = &d->matter;
    const uint64_t rays = 64 * (uint64_t)d->desc.directions;
    isogi_context whole = d->context;
    uint8_t bin[ISOGI_DVR__TABLE];
    isogi_result result;
    size_t count;
    whole.progress = NULL;
    *used = 0;
    isogi_dvr__set_table(d, m->table), isogi_dvr__set_bins(d, bin);
    if (memcmp(b->bin, bin, sizeof bin) || b->low < m->low || b->low > m->low || b->scale < m->scale || b->scale > m->scale) {
        memcpy(b->bin, bin, sizeof bin);
        b->low = m->low, b->scale = m->scale, b->counted = 0;
    }
    if (b->counted == b->total) return ISOGI_OK;
    b->share = (double)d->desc.directions / ((double)d->desc.directions + (double)b->total);
    count = b->total - b->counted;
    if (max_rays && max_rays / rays < count) count = max_rays / rays ? (size_t)(max_rays / rays) : 1;
    result = isogi_parallel(&whole, count, isogi_dvr__histogram_task, d, 0, 0);
    if (result == ISOGI_OK) *used = (double)count * (double)rays, b->counted += count;
    return result;
}

/* Whether data on a block's faces change, as that of a coarser block beside it does. */
static int isogi_dvr__faces_change(const isogi_dvr__blocks *b, size_t block, const uint8_t *level) {
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, low[3], high[3], c[3];
    int a;
    for (a = 0; a < 3; a++) low[a] = at[a] ? at[a] - 1 : 0, high[a] = at[a] + 1 < b->count[a] ? at[a] + 1 : at[a];
    for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[0] = low[0]; c[0] <= high[0]; c[0]++) {
                size_t i = c[0] + b->count[0] * (c[1] + b->count[1] * c[2]);
                if (level[i] == b->level[i]) continue;
                if ((level[i] && level[i] < level[block]) || (b->level[i] && b->level[i] < level[block])) return 1;
            }
    return 0;
}

/* New levels for a new classification, the data packed anew, and the list of blocks whose local visibility has to follow: those with a
   block within reach of a ray whose data or classification changed, or those of one beside it: averages on faces are of both blocks, and a
   plane makes both fine; and those beside one that holds no visibility any more, as nodes on its faces are their own now. */
static isogi_result isogi_dvr__update_blocks(isogi_dvr *d) {
    isogi_dvr__blocks *b = &d->blocks;
    uint8_t *level = (uint8_t *)isogi_allocate(&d->context, 4 * b->total, 1), *lit, *changed, *gone;
    isogi_result result;
    isogi_context whole = d->context;
    size_t i;
    if (!level) return ISOGI_NO_MEMORY;
    lit = level + b->total, changed = lit + b->total, gone = changed + b->total;
    whole.progress = NULL;
    result = isogi_dvr__select_levels(d, level);
    for (i = 0; result == ISOGI_OK && i < b->total; i++) {
        changed[i] = (level[i] ? isogi_dvr__any_near(b, i, 1, d->changed) : d->changed[i]) || level[i] != b->level[i] ||
                     isogi_dvr__faces_change(b, i, level);
        lit[i] = level[i] ? isogi_dvr__any_near(b, i, 1, d->cut) ? 16 : level[i] : isogi_dvr__any_near(b, i, b->reach, level) ? 2 : 0;
        gone[i] = b->lit[i] && !lit[i];
    }
    for (i = 0; result == ISOGI_OK && i < b->total; i++)
        b->stale[i] = b->stale[i] || lit[i] != b->lit[i] || isogi_dvr__any_near(b, i, b->reach > 1 ? b->reach : 1, changed) ||
                      isogi_dvr__any_near(b, i, 1, gone);
    if (result == ISOGI_OK) result = isogi_dvr__lay_out(d, level, lit);
    isogi_release(&d->context, level, 4 * b->total, 1);
    for (b->packing = 1; result == ISOGI_OK && b->packing <= 16; b->packing *= 2) {
        result = isogi_parallel(&whole, b->total, isogi_dvr__pack_task, d, 0, 0);
    }
    if (result != ISOGI_OK) return result;
    for (i = 0; i < d->changed_count; i++) d->classified += d->changed[i];
    memset(d->changed, 0, d->changed_count);
    for (i = 0, b->due = 0; i < b->total; i++)
        if (b->stale[i] && b->lit[i]) b->order[b->due++] = i;
    b->ready = 1;
    return ISOGI_OK;
}

/* ==== local and global visibility (Kronander 2011, 4.2 and 4.3) ====================================================== */

/* Around a block a window of extinction is laid out, as wide as local rays reach, at the finest level that occurs in it: data as the
   blocks hold it, classified at the window's nodes, 0 where it is dropped or outside. For one direction and one step all nodes of a row of
   the block look at the window at the same place between its nodes, so that whole rows advance at once. Beside clip planes those samples
   count that are not cut off, a range of each row: matter must end there, not fade from node to node. Blocks that a plane cuts, and their
   neighbours, hold local visibility at every voxel: just below a plane it changes fast. */
typedef struct isogi_dvr__local_job {
    isogi_dvr *dvr;
    size_t first, packing;
    isogi_counters *work;
    float *window;              /* of each task */
    size_t window_count;
    isogi_dvr__local_step *step; /* for levels 1, 2, 4, 8, 16: [directions][steps] */
    size_t step_count;
} isogi_dvr__local_job;

/* Nodes along a side of a window of level n; its rows are padded for vectors. */
static size_t isogi_dvr__window_side(const isogi_dvr__blocks *b, size_t n) { return (2 * b->reach + 1) * n + 1; }
static size_t isogi_dvr__window_row(const isogi_dvr__blocks *b, size_t n) { return isogi_dvr__window_side(b, n) + 2 * ISOGI_DVR__LANES; }

/* Steps of a ray at level n: a node's distance each, the last one what is left of the radius. */
static size_t isogi_dvr__local_steps(const isogi_dvr *d, size_t n) { return (size_t)ceil(d->desc.radius * (double)n / 16 - 1e-9); }

static size_t isogi_dvr__steps_before(const isogi_dvr *d, size_t n) {
    size_t sum = 0, m;
    for (m = 1; m < n; m *= 2) sum += isogi_dvr__local_steps(d, m) * (size_t)d->desc.directions;
    return sum;
}

static void isogi_dvr__set_local_steps(const isogi_dvr *d, isogi_dvr__local_step *step) {
    size_t n, k, j;
    for (n = 1; n <= 16; n *= 2)
        for (k = 0; k < (size_t)d->desc.directions; k++)
            for (j = 0; j < isogi_dvr__local_steps(d, n); j++, step++) {
                double size = 16.0 / (double)n, from = (double)j * size, to = from + size < d->desc.radius ? from + size : d->desc.radius;
                ptrdiff_t row = (ptrdiff_t)isogi_dvr__window_row(&d->blocks, n), side = (ptrdiff_t)isogi_dvr__window_side(&d->blocks, n),
                          c[3];
                double u[3], depth = (to - from) * d->spacing / d->desc.unit;
                int a;
                for (a = 0; a < 3; a++) {
                    double x, whole;
                    step->way[a] = 0.5 * (from + to) * d->spacing * d->direction[k][a], x = step->way[a] / size, whole = floor(x);
                    c[a] = (ptrdiff_t)whole, u[a] = x - whole;
                }
                step->offset = c[0] + row * (c[1] + side * c[2]);
                for (a = 0; a < 8; a++)
                    step->weight[a] = (float)(depth * (a & 1 ? u[0] : 1 - u[0]) * (a & 2 ? u[1] : 1 - u[1]) * (a & 4 ? u[2] : 1 - u[2]));
            }
}

/* Where the nodes of level n lie among those that a block holds, along an axis: the node before, and how far past it. Returns how many. */
static size_t isogi_dvr__along(const isogi_dvr *d, size_t block, size_t n, int axis, size_t before[17], float u[17]) {
    const isogi_dvr__blocks *b = &d->blocks;
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, held = b->level[block],
           side[3], i;
    isogi_dvr__sides(b, block, held, side);
    for (i = 0; i <= n && 16 * at[axis] + 16 * i / n <= (size_t)d->cells[axis]; i++) {
        before[i] = i * held / n < side[axis] ? i * held / n : side[axis] - 1;
        u[i] = (float)i * (float)held / (float)n - (float)before[i];
    }
    return i;
}

/* Between two nodes, of which one that does not count need not be finite. */
static float isogi_dvr__mix(float from, float to, float u) { return u > 0 ? u < 1 ? from + u * (to - from) : to : from; }

/* A row of the nodes that a block holds, between four of them. */
static void isogi_dvr__held_row(const float *data, size_t row, size_t plane, float v, float w, float line[17]) {
    size_t i;
    for (i = 0; i < row; i++) {
        const float x = isogi_dvr__mix(data[i], data[row + i], v);
        line[i] = w > 0 ? isogi_dvr__mix(x, isogi_dvr__mix(data[plane + i], data[plane + row + i], v), w) : x;
    }
}

/* The nodes of a window that lie in one block (with its upper faces). Returns whether anything there absorbs. */
static int isogi_dvr__fill_window(const isogi_dvr *d, size_t block, size_t n, const size_t corner[3], float *window) {
    const isogi_dvr__blocks *b = &d->blocks;
    size_t before[3][17], count[3], node[3], side[3], row = isogi_dvr__window_row(b, n), rows = isogi_dvr__window_side(b, n);
    float u[3][17], line[17];
    int any = 0, a;
    isogi_dvr__sides(b, block, b->level[block], side);
    for (a = 0; a < 3; a++) count[a] = isogi_dvr__along(d, block, n, a, before[a], u[a]);
    for (node[2] = 0; node[2] < count[2]; node[2]++)
        for (node[1] = 0; node[1] < count[1]; node[1]++) {
            const float *data = b->data + b->first[block] + (side[0] + 1) * (before[1][node[1]] + (side[1] + 1) * before[2][node[2]]);
            float *out = window + corner[0] + row * (corner[1] + node[1] + rows * (corner[2] + node[2]));
            isogi_dvr__held_row(data, side[0] + 1, (side[0] + 1) * (side[1] + 1), u[1][node[1]], u[2][node[2]], line);
            for (node[0] = 0; node[0] < count[0]; node[0]++) {
                float value = line[before[0][node[0]]], end = line[before[0][node[0]] + 1];
                value = isogi_dvr__mix(value, end, u[0][node[0]]);
                if (!isogi_dvr__finite32(value)) continue;
                out[node[0]] = d->matter.table[isogi_dvr__class(d, d->base + (double)value)];
                any |= out[node[0]] > 0;
            }
        }
    return any;
}

/* The window around a block; its level, 0 if nothing in it absorbs. parted: whether planes may cut something off in it. */
static size_t isogi_dvr__make_window(const isogi_dvr *d, size_t block, float *window, int *parted) {
    const isogi_dvr__blocks *b = &d->blocks;
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]}, n = b->lit[block], o[3], i;
    int any = 0, pass, a;
    *parted = 0;
    for (pass = 0; pass < 2; pass++) { /* first the level, then the nodes */
        if (pass)
            memset(window, 0, isogi_dvr__window_row(b, n) * isogi_dvr__window_side(b, n) * isogi_dvr__window_side(b, n) * sizeof *window);
        for (o[2] = 0; o[2] <= 2 * b->reach; o[2]++)
            for (o[1] = 0; o[1] <= 2 * b->reach; o[1]++)
                for (o[0] = 0; o[0] <= 2 * b->reach; o[0]++) {
                    size_t corner[3];
                    int within = 1;
                    for (a = 0; a < 3; a++)
                        within = within && at[a] + o[a] >= b->reach && at[a] + o[a] - b->reach < b->count[a], corner[a] = o[a] * n;
                    if (!within) continue;
                    i = at[0] + o[0] - b->reach + b->count[0] * (at[1] + o[1] - b->reach + b->count[1] * (at[2] + o[2] - b->reach));
                    *parted |= d->cut[i] != 0;
                    if (!pass) n = b->level[i] > n ? b->level[i] : n;
                    else if (b->level[i]) any |= isogi_dvr__fill_window(d, i, n, corner, window);
                }
    }
    return any ? n : 0;
}

/* The largest integer that is no more than x, within -65536 .. 65536: without what is slow in portable code. */
static double isogi_dvr__floor(double x) { return (double)(int32_t)(isogi_dvr__clamp(x + 65536, 131072)) - 65536; }

/* Which of `count` places, from `from` on, `each` to a voxel along x, no plane cuts off: within[0] .. within[1] - 1. */
static void isogi_dvr__places_within(const isogi_dvr *d, const double from[3], double each, size_t count, int32_t within[2]) {
    double low = 0, high = (double)count;
    size_t i;
    for (i = 0; i < d->clip_count; i++) {
        const double *plane = d->clip[i], slack = isogi_dvr__slack(plane), at = isogi_dvr__dot(plane, from) + plane[3] + slack;
        if (fabs(plane[0]) > slack) {
            const double end = isogi_dvr__floor(at * each / fabs(plane[0])); /* the last place before it comes to the plane */
            if (plane[0] > 0) low = -end > low ? -end : low;
            else high = end + 1 < high ? end + 1 : high;
        } else if (!(at >= 0)) high = 0;
    }
    within[0] = (int32_t)isogi_dvr__clamp(low, (double)count), within[1] = (int32_t)isogi_dvr__clamp(high, (double)count);
}

/* Lets the rays of a row that begin at `place` see samples that are not cut off alone. What is left is convex: where the rays' beginnings
   and last samples lie in it, all do. */
static void isogi_dvr__part_rays(const isogi_dvr *d, const double place[3], size_t n, int32_t (*within)[2], isogi_dvr__local_rays *rays) {
    const size_t steps = rays->steps;
    const double each = (double)n / 16;
    int32_t ends[2];
    double from[3];
    size_t j;
    int a;
    rays->within = (const int32_t(*)[2])within;
    isogi_dvr__places_within(d, place, each, rays->count, ends);
    for (j = steps, rays->steps = 0; j-- > 0;) { /* from the end, since behind the last one that counts none has to be looked at */
        for (a = 0; a < 3; a++) from[a] = place[a] + rays->step[j].way[a];
        isogi_dvr__places_within(d, from, each, rays->count, within[j]);
        if (!rays->steps && within[j][0] < within[j][1]) rays->steps = j + 1;
        if (j + 1 == steps && !ends[0] && !within[j][0] && ends[1] == (int32_t)rays->count && within[j][1] == ends[1]) {
            rays->within = NULL;
            return;
        }
    }
}

/* SH coefficients of a row of nodes: sum[c][0 .. count - 1] at the window's nodes from `at` on, as many as a vector or two hold. place: the
   first one's, where the window is parted; else NULL. */
static void isogi_dvr__local_row(const isogi_dvr__local_job *job, size_t n, const float *at, const double *place, size_t count,
                                 float (*sum)[2 * ISOGI_DVR__LANES]) {
    const isogi_dvr *d = job->dvr;
    const isogi_dvr__local_step *step = job->step + isogi_dvr__steps_before(d, n);
    size_t steps = isogi_dvr__local_steps(d, n), row = isogi_dvr__window_row(&d->blocks, n),
           plane = row * isogi_dvr__window_side(&d->blocks, n), k, c;
    float clear[2 * ISOGI_DVR__LANES];
    int32_t within[ISOGI_DVR__LOCAL_STEPS][2];
    isogi_dvr__local_rays rays = {at, step, NULL, steps, row, plane, count};
    isogi_dvr__sums sums = {sum[0], clear, NULL, 2 * ISOGI_DVR__LANES, 0, d->coefficients, 1, count};
    for (c = 0; c < d->coefficients; c++) memset(sum[c], 0, sizeof sum[c]);
    for (k = 0; k < (size_t)d->desc.directions; k++) {
        rays.steps = steps;
        if (place) isogi_dvr__part_rays(d, place, n, within, &rays);
        d->kernels.local(&rays, clear);
        rays.step += steps;
        sums.kernel = d->kernel + k * d->coefficients;
        d->kernels.gather(&sums);
    }
}

/* The own nodes of a block, rows at a time. */
static void isogi_dvr__local_task(void *arg, size_t i) {
    const isogi_dvr__local_job *job = (const isogi_dvr__local_job *)arg;
    isogi_dvr *d = job->dvr;
    isogi_dvr__blocks *b = &d->blocks;
    float *window = job->window + i * job->window_count, sum[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER][2 * ISOGI_DVR__LANES];
    int parted;
    size_t block = b->order[job->first + i], n = b->lit[block], fine = isogi_dvr__make_window(d, block, window, &parted), every = fine / n,
           node[3], side[3], c;
    size_t at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]};
    uint16_t *out = b->sh + b->first[b->total + block] * d->coefficients, clear = isogi_float_to_half((float)(2 * sqrt(ISOGI_DVR__PI)));
    memset(&job->work[i], 0, sizeof *job->work);
    job->work[i].blocks++;
    isogi_dvr__sides(b, block, n, side);
    for (node[2] = 0; node[2] <= side[2]; node[2]++)
        for (node[1] = 0; node[1] <= side[1]; node[1]++) {
            size_t row = b->reach * fine + isogi_dvr__window_row(b, fine ? fine : 1) *
                                               (b->reach * fine + node[1] * every +
                                                isogi_dvr__window_side(b, fine ? fine : 1) * (b->reach * fine + node[2] * every));
            size_t coarsest, owner, count = side[0] * every;
            double place[3];
            node[0] = 0, isogi_dvr__node_position(b, block, n, node, place);
            node[0] = side[0];
            isogi_dvr__touching(b, b->lit, at, node, n, &coarsest, &owner);
            if (owner == block && b->lit[coarsest] == n) count++; /* the row's last node is this block's own, too */
            if (fine) isogi_dvr__local_row(job, fine, window + row, parted ? place : NULL, count, sum);
            for (node[0] = 0; node[0] <= side[0]; node[0]++, out += d->coefficients) {
                isogi_dvr__touching(b, b->lit, at, node, n, &coarsest, &owner);
                if (owner != block || b->lit[coarsest] < n) continue;
                for (c = 0; c < d->coefficients; c++)
                    out[c] = fine ? isogi_float_to_half(sum[c][node[0] * every]) : (uint16_t)(c ? 0 : clear);
                job->work[i].rays += (uint64_t)d->desc.directions, job->work[i].texels++;
                if (fine) job->work[i].samples += (uint64_t)d->desc.directions * isogi_dvr__local_steps(d, fine);
            }
        }
}

/* All coefficients of local visibility at a place, given in grid coordinates. */
static void isogi_dvr__local_at(const isogi_dvr *d, size_t block, const double position[3], float *out) {
    const isogi_dvr__blocks *b = &d->blocks;
    size_t n = b->lit[block], corner[8], k, c;
    const uint16_t *base;
    float w[8];
    for (c = 0; c < d->coefficients; c++) out[c] = c || n ? 0 : (float)(2 * sqrt(ISOGI_DVR__PI));
    if (!n) return;
    base = b->sh + (b->first[b->total + block] + isogi_dvr__place(b, block, n, position, corner, w)) * d->coefficients;
    for (k = 0; k < 8; k++) {
        const uint16_t *v = base + corner[k] * d->coefficients;
        if (!(w[k] > 0)) continue; /* a node of no weight may be another thread's at work */
        for (c = 0; c < d->coefficients; c++) out[c] += w[k] * isogi_half_to_float(v[c]);
    }
}

/* Repeated nodes and those on faces of coarser blocks, from coarse to fine. */
static void isogi_dvr__finish_task(void *arg, size_t block) {
    const isogi_dvr__local_job *job = (const isogi_dvr__local_job *)arg;
    isogi_dvr *d = job->dvr;
    isogi_dvr__blocks *b = &d->blocks;
    size_t n = b->lit[block], node[3], side[3], c,
           at[3] = {block % b->count[0], block / b->count[0] % b->count[1], block / b->count[0] / b->count[1]};
    uint16_t *out;
    if (n != job->packing) return;
    out = b->sh + b->first[b->total + block] * d->coefficients;
    isogi_dvr__sides(b, block, n, side);
    for (node[2] = 0; node[2] <= side[2]; node[2]++)
        for (node[1] = 0; node[1] <= side[1]; node[1]++)
            for (node[0] = 0; node[0] <= side[0]; node[0]++, out += d->coefficients) {
                float v[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER];
                double position[3];
                size_t coarsest, owner;
                if (node[0] % n && node[1] % n && node[2] % n) continue;
                isogi_dvr__touching(b, b->lit, at, node, n, &coarsest, &owner);
                if (b->lit[coarsest] >= n && owner == block) continue;
                isogi_dvr__node_position(b, block, n, node, position);
                isogi_dvr__local_at(d, b->lit[coarsest] < n ? coarsest : owner, position, v);
                for (c = 0; c < d->coefficients; c++) out[c] = isogi_float_to_half(v[c]);
            }
}

/* One batch of directions: transmittance of all grid points towards each, then all coefficients of a few grid points each. Sums run in
   the order of the directions, whatever the batches. */
typedef struct isogi_dvr__batch {
    isogi_dvr *dvr;
    size_t first, count, scratch_count;
    float *scratch, *transmittance; /* of each direction */
} isogi_dvr__batch;

/* Local visibility of some nodes, evaluated towards each direction of the batch: what global rays interpolate. */
static void isogi_dvr__toward_task(void *arg, size_t task) {
    const isogi_dvr__batch *job = (const isogi_dvr__batch *)arg;
    const isogi_dvr *d = job->dvr;
    const isogi_dvr__blocks *b = &d->blocks;
    float basis[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER][ISOGI_DVR__TOWARD];
    size_t node = task * ISOGI_DVR__GAIN, end = b->sh_count - node < ISOGI_DVR__GAIN ? b->sh_count : node + ISOGI_DVR__GAIN, c, k;
    for (c = 0; c < d->coefficients; c++)
        for (k = 0; k < ISOGI_DVR__TOWARD; k++) basis[c][k] = k < job->count ? d->basis[(job->first + k) * d->coefficients + c] : 0;
    for (; node < end; node++) {
        float sum[ISOGI_DVR__TOWARD] = {0};
        for (c = 0; c < d->coefficients; c++) {
            float v = isogi_half_to_float(b->sh[node * d->coefficients + c]);
            for (k = 0; k < ISOGI_DVR__TOWARD; k++) sum[k] += v * basis[c][k];
        }
        for (k = 0; k < job->count; k++) job->scratch[k * job->scratch_count + node] = sum[k];
    }
}

/* A place along an axis, for every level that a block may have: the node before it, how far past that, and how many nodes there are. */
typedef struct isogi_dvr__global_axis {
    size_t block, node[17], nodes[17];
    float u[17];
} isogi_dvr__global_axis;

static void isogi_dvr__global_at(const isogi_dvr__blocks *b, int axis, double position, isogi_dvr__global_axis *out) {
    double x = isogi_dvr__clamp(position * (1.0 / 16), (double)b->count[axis]);
    size_t n, side;
    out->block = (size_t)x < b->count[axis] ? (size_t)x : b->count[axis] - 1;
    side = out->block + 1 < b->count[axis] ? 16 : b->rest[axis];
    for (n = 1; n <= 16; n *= 2) {
        double at = (x - (double)out->block) * (double)n;
        size_t last = (side * n + 15) / 16 - 1;
        out->nodes[n] = last + 2, out->node[n] = (size_t)at < last ? (size_t)at : last, out->u[n] = (float)(at - (double)out->node[n]);
    }
}

/* Local visibility at a place, already evaluated towards one direction. */
static float isogi_dvr__global_piece(const isogi_dvr__blocks *b, const float *toward, double x, const isogi_dvr__global_axis *y,
                                     const isogi_dvr__global_axis *z) {
    size_t at, block, n, node, last, row, plane;
    const float *p;
    float u, v[4];
    int a;
    x = isogi_dvr__clamp(x * (1.0 / 16), (double)b->count[0]);
    at = (size_t)x < b->count[0] ? (size_t)x : b->count[0] - 1, block = at + b->count[0] * (y->block + b->count[1] * z->block);
    n = b->lit[block];
    if (!n) return 1;
    last = at + 1 < b->count[0] ? n - 1 : (b->rest[0] * n + 15) / 16 - 1, row = last + 2, plane = row * y->nodes[n];
    x = (x - (double)at) * (double)n, node = (size_t)x < last ? (size_t)x : last, u = (float)(x - (double)node);
    p = toward + b->first[b->total + block] + node + row * y->node[n] + plane * z->node[n];
    for (a = 0; a < 4; a++) {
        const float *q = p + (a & 1 ? row : 0) + (a & 2 ? plane : 0);
        v[a] = q[0] + u * (q[1] - q[0]);
    }
    v[0] += y->u[n] * (v[1] - v[0]), v[2] += y->u[n] * (v[3] - v[2]), v[0] += z->u[n] * (v[2] - v[0]);
    return v[0] > 0 ? v[0] < 1 ? v[0] : 1 : 0;
}

/* Where point i of the visibility grid stands along an axis: the last one on the border to the bit, as what is beyond counts from there. */
static double isogi_dvr__grid_place(const isogi_dvr *d, int axis, double apart, size_t i) {
    const size_t points = d->desc.grid[axis];
    return points < 2 ? 0.5 * d->cells[axis] : i + 1 < points ? (double)i * apart : d->cells[axis];
}

/* Piecewise integration: local visibility stands for the ray's next r_s voxels; the last piece, cut by the border, is no shorter in
   what it blocks since there is nothing outside (eq. 9). A row of grid points at once: it shares places along y and z. */
static void isogi_dvr__global_row(const isogi_dvr *d, const float *toward, const double from[3], double apart, size_t count,
                                  const double direction[6], float *clear) {
    double step = d->desc.radius * d->spacing, t, limit = 1e300, across = fabs(direction[0]) > 1e-300 ? 1 / direction[0] : 0;
    isogi_dvr__global_axis y, z;
    size_t i, left = count;
    int a;
    for (a = 1; a < 3; a++) {
        double exit = fabs(direction[a]) > 1e-300 ? ((direction[a] > 0 ? d->cells[a] : 0) - from[a]) / direction[a] : limit;
        if (exit < limit) limit = exit;
    }
    for (i = 0; i < count; i++) clear[i] = 1;
    for (t = 0; t < limit && left; t += step) {
        isogi_dvr__global_at(&d->blocks, 1, from[1] + t * direction[1], &y),
            isogi_dvr__global_at(&d->blocks, 2, from[2] + t * direction[2], &z);
        for (i = 0, left = 0; i < count; i++) {
            double x = isogi_dvr__grid_place(d, 0, apart, i);
            if (!(clear[i] > (float)ISOGI_DVR__NEGLIGIBLE) ||
                (fabs(across) > 0 && !(t < ((across > 0 ? d->cells[0] : 0) - x) * across))) continue;
            clear[i] *= isogi_dvr__global_piece(&d->blocks, toward, x + t * direction[0], &y, &z), left++;
        }
    }
}

/* A plane of grid points, in one direction. */
static void isogi_dvr__global_task(void *arg, size_t task) {
    const isogi_dvr__batch *job = (const isogi_dvr__batch *)arg;
    const isogi_dvr *d = job->dvr;
    size_t k = task % job->count, z = task / job->count, y;
    double apart[3];
    int a;
    for (a = 0; a < 3; a++) apart[a] = d->desc.grid[a] > 1 ? d->cells[a] / (double)(d->desc.grid[a] - 1) : 0;
    for (y = 0; y < d->desc.grid[1]; y++) {
        double from[3];
        from[0] = 0, from[1] = isogi_dvr__grid_place(d, 1, apart[1], y), from[2] = isogi_dvr__grid_place(d, 2, apart[2], z);
        isogi_dvr__global_row(d, job->scratch_count ? job->scratch + k * job->scratch_count : NULL, from, apart[0], d->desc.grid[0],
                              d->direction[job->first + k],
                              job->transmittance + k * d->padded_count + d->desc.grid[0] * (y + d->desc.grid[1] * z));
    }
}

/* ==== sweeps ========================================================================================================= */

/* Optical depth towards one direction at every node, a slice of the lattice after the other. A bundle of parallel rays, one for
   each node of a slice, runs through the lattice against the direction. From slice to slice the bundle slips sideways by a fraction
   of a node; extinction is interpolated at the rays' places, the depth that a ray has gathered stays with the ray: nothing is
   interpolated twice, so that a shadow is as sharp after a hundred slices as after one. A ray that leaves at a side goes on in matter
   like that of the side and is forgotten when it is one node outside, and a new one enters at the other side, on which nothing is in the
   way of grid points. At the slices of the visibility grid the transmittance of the four rays around a grid point is interpolated, rays in
   dense matter counting less: across its surfaces light does not blur, and the share of each ray, another one for each direction and grid
   point, does not show as a weave. */
typedef struct isogi_dvr__sweep {
    const float *extinction;       /* node (slice, row, lane) at slice * slice_stride + row * row_stride + lane */
    size_t size[3];                /* nodes: slices, rows, lanes */
    size_t slice_stride, row_stride;
    int backwards;                 /* the first slice is the last of the lattice */
    double slip[2];                /* of the bundle from slice to slice: rows, lanes */
    float piece;                   /* half the depth that extinction 1 adds from slice to slice */
    float *depth, *row;            /* of rays; scratch */
    size_t depth_row, out_row, weight; /* weight: from a row of transmittance to its weights */
    size_t points[3], first[3], every[3], out_stride[3]; /* of the visibility grid, by slices, rows, lanes */
    const isogi_dvr__held *held;   /* in several resolutions; else NULL */
    int axis[3];                   /* of slices, rows, lanes */
    float *plane;                  /* then: of the grid */
    isogi_dvr__kernels kernels;
} isogi_dvr__sweep;

/* The bundle at one slice: how far it has slipped. Ray c of a row stands between nodes c - 1 and c, a share of `part` past the
   former (0 <= part < 1): 0 is just outside, size just outside at the other end. */
typedef struct isogi_dvr__slip {
    size_t row, lane;   /* where ray 0 of row 0 is in the buffer */
    float part[2];
} isogi_dvr__slip;

static isogi_dvr__slip isogi_dvr__slip_at(const isogi_dvr__sweep *s, size_t slice) {
    isogi_dvr__slip at;
    size_t begin[2];
    int a;
    for (a = 0; a < 2; a++) {
        double farthest = floor(s->slip[a] * (double)(s->size[0] - 1)), slipped = s->slip[a] * (double)slice, whole = floor(slipped);
        begin[a] = (size_t)(int64_t)((farthest > 0 ? farthest : 0) - whole);
        at.part[a] = (float)(slipped - whole);
        if (!(at.part[a] < 1)) at.part[a] = 0.99999994f;
    }
    at.row = begin[0], at.lane = begin[1];
    return at;
}

/* Whether rays just outside of a side have left there; which: 0 rows, 1 lanes. */
static int isogi_dvr__leaves(const isogi_dvr__sweep *s, int which, int high) { return high ? s->slip[which] > 0 : s->slip[which] < 0; }

/* Adds what rays that have left at a side, and are less than a node outside, pass of matter like that of its last nodes: between them and
   the rays within is what arrives at a grid point on the side. */
static void isogi_dvr__sweep_left(const isogi_dvr__sweep *s, const isogi_dvr__rows *within, const isogi_dvr__slip *at, const float w[4],
                                  int out) {
    isogi_dvr__rows a = *within;
    float x[4] = {0, 0, 0, 0};
    int left[2], high[2], n;
    size_t c, end, node;
    for (n = 0; n < 2; n++) high[n] = isogi_dvr__leaves(s, n, 1), left[n] = high[n] ? at->part[n] > 0 : isogi_dvr__leaves(s, n, 0);
    if (left[0]) {
        x[0] = w[0] + w[2], x[1] = w[1] + w[3], a.rows = 1, a.beside = 0, c = s->size[1] - 1;
        if (high[0]) a.from += c * a.from_row, a.depth += c * a.depth_row, a.out += c * a.out_row;
        else a.depth -= a.depth_row, a.out -= a.out_row;
        if (out) s->kernels.pass_out(&a, x);
        else s->kernels.pass(&a, x);
    }
    if (!left[1]) return;
    node = high[1] ? s->size[2] - 1 : 0;
    c = left[0] && !high[0] ? 0 : 1, end = within->rows + 1 + (left[0] && high[0]);
    x[0] = w[0] + w[1], x[1] = w[2] + w[3];
    for (; c < end; c++) {
        const float *r0 = within->from + (c ? c - 1 : 0) * within->from_row + node;
        const float *r1 = c && c <= within->rows ? r0 + within->beside : r0;
        float *depth = s->depth + (at->row + c) * s->depth_row + at->lane + (high[1] ? s->size[2] : 0);
        float more = x[0] * *r0 + x[1] * *r1;
        if (out) {
            float *e = s->row + c * s->out_row + (high[1] ? s->size[2] : 0);
            e[s->weight] = isogi_dvr__counts(more), e[0] = e[s->weight] * isogi_dvr__exp(*depth + more), more *= 2;
        }
        *depth += more;
    }
}

/* Adds `piece` times the extinction at every ray of the bundle that is within the lattice, or has just left; `out`: twice, and between the
   two all rays' transmittance goes to s->row, of every row from ray 0 on. */
static void isogi_dvr__sweep_add(const isogi_dvr__sweep *s, size_t slice, const isogi_dvr__slip *at, float piece, int out) {
    isogi_dvr__rows a;
    float w[4];
    size_t c, i;
    w[0] = piece * (1 - at->part[0]) * (1 - at->part[1]), w[1] = piece * (1 - at->part[0]) * at->part[1];
    w[2] = piece * at->part[0] * (1 - at->part[1]), w[3] = piece * at->part[0] * at->part[1];
    a.from = s->extinction + (s->backwards ? s->size[0] - 1 - slice : slice) * s->slice_stride, a.from_row = s->row_stride;
    a.beside = at->part[0] > 0 ? s->row_stride : 0;
    a.rows = s->size[1] - (at->part[0] > 0), a.count = s->size[2] - (at->part[1] > 0);
    a.depth = s->depth + (at->row + 1) * s->depth_row + at->lane + 1, a.depth_row = s->depth_row;
    a.out = s->row + s->out_row + 1, a.out_row = s->out_row, a.weight = s->weight;
    if (!out) {
        s->kernels.pass(&a, w);
        isogi_dvr__sweep_left(s, &a, at, w, 0);
        return;
    }
    s->kernels.pass_out(&a, w);
    for (c = 0; c <= s->size[1]; c++) { /* rays that are outside keep what they have, unless they have just left */
        const float *depth = s->depth + (at->row + c) * s->depth_row + at->lane;
        float *e = s->row + c * s->out_row;
        if (c && c <= a.rows) {
            e[0] = isogi_dvr__exp(depth[0]), e[s->weight] = 1;
            if (a.count < s->size[2]) e[s->size[2]] = isogi_dvr__exp(depth[s->size[2]]), e[s->weight + s->size[2]] = 1;
        } else {
            memcpy(e, depth, (s->size[2] + 1) * sizeof *e);
            s->kernels.exp_row(e, s->size[2] + 1);
            for (i = 0; i <= s->size[2]; i++) e[s->weight + i] = 1;
        }
    }
    isogi_dvr__sweep_left(s, &a, at, w, 1);
}

/* Transmittance between the two rays beside every grid point of a row of rays, weighed, and its weight. */
static void isogi_dvr__sweep_row_out(const isogi_dvr__sweep *s, size_t slice, const isogi_dvr__slip *at, size_t c, float *out,
                                     float *weight) {
    const float *depth = s->depth + (at->row + c) * s->depth_row + at->lane, *from = s->extinction + slice * s->slice_stride;
    /* the nodes beside */
    const float *low = from + (c ? c - 1 : 0) * s->row_stride, *high = from + (c < s->size[1] ? c : 0) * s->row_stride;
    float *e = s->row, part = at->part[1], share[2];
    size_t n = s->points[2], last = s->size[2] - 1, i;
    int outside = !c || (c == s->size[1] && at->part[0] > 0); /* rays outside count in full, unless they have just left: as in sweep_add */
    int left[2] = {isogi_dvr__leaves(s, 1, 0), isogi_dvr__leaves(s, 1, 1)};
    share[0] = s->piece * (1 - at->part[0]), share[1] = c < s->size[1] ? s->piece * at->part[0] : 0;
    if (c && outside) share[0] = s->piece;
    if (outside && isogi_dvr__leaves(s, 0, c > 0)) outside = 0;
    for (i = 0; i < n; i++) e[2 * i] = depth[s->first[2] + i * s->every[2]], e[2 * i + 1] = depth[s->first[2] + i * s->every[2] + 1];
    s->kernels.exp_row(e, 2 * n);
    for (i = 0; i < n; i++) {
        size_t h = s->first[2] + i * s->every[2], h0 = h ? h - 1 : 0, h2 = h == last && left[1] ? h : h + 1; /* 0 past the end */
        float x1 = share[0] * low[h] + share[1] * high[h], x2 = share[0] * low[h2] + share[1] * high[h2];
        float x0 = h || left[0] ? share[0] * low[h0] + share[1] * high[h0] : 0, e0 = e[2 * i], e1 = e[2 * i + 1];
        weight[i] = 1, out[i] = e1 + part * (e0 - e1);
        if (outside || !(x0 + x1 + x2 > 0)) continue; /* no matter beside it */
        x0 = h || left[0] ? isogi_dvr__counts(x0 + part * (x1 - x0)) : 1,
        x1 = h < last || left[1] || !(part > 0) ? isogi_dvr__counts(x1 + part * (x2 - x1)) : 1;
        e0 *= x0, e1 *= x1, weight[i] = x1 + part * (x0 - x1), out[i] = e1 + part * (e0 - e1);
    }
}

/* Grid points at some of the nodes only. */
static void isogi_dvr__sweep_points(const isogi_dvr__sweep *s, size_t slice, const isogi_dvr__slip *at, float *out) {
    size_t n = s->points[2], i, j;
    float *r0 = s->row + 2 * n + ISOGI_DVR__LANES, *r1 = r0 + n, *w0 = r1 + n, *w1 = w0 + n;
    for (j = 0; j < s->points[1]; j++) {
        size_t c = s->first[1] + j * s->every[1];
        isogi_dvr__sweep_row_out(s, slice, at, c, r0, w0);
        isogi_dvr__sweep_row_out(s, slice, at, c + 1, r1, w1);
        for (i = 0; i < n; i++)
            out[j * s->out_stride[1] + i] = (r1[i] + at->part[0] * (r0[i] - r1[i])) / (w1[i] + at->part[0] * (w0[i] - w1[i]));
    }
}

/* In several resolutions: from a plane of the grid to what blocks hold of it (out NULL: nothing). 0 = none of it is held. */
static int isogi_dvr__hold_plane(const isogi_dvr__sweep *s, size_t point, float *out) {
    const isogi_dvr__held *h = s->held;
    size_t end = point / 8 < h->count[s->axis[0]] ? point / 8 : h->count[s->axis[0]] - 1, at[3], i, j;
    int any = 0;
    for (at[s->axis[0]] = point && point % 8 == 0 ? point / 8 - 1 : point / 8; at[s->axis[0]] <= end; at[s->axis[0]]++)
        for (at[s->axis[1]] = 0; at[s->axis[1]] < h->count[s->axis[1]]; at[s->axis[1]]++)
            for (at[s->axis[2]] = 0; at[s->axis[2]] < h->count[s->axis[2]]; at[s->axis[2]]++) {
                const isogi_dvr__held_block *b = &h->block[at[0] + h->count[0] * (at[1] + h->count[1] * at[2])];
                size_t step = (size_t)1 << b->log, n = (8u >> b->log) + 1, slice = point - 8 * at[s->axis[0]], stride[3] = {1, 1, 1};
                const float *from = s->plane + 8 * (at[s->axis[1]] * s->out_stride[1] + at[s->axis[2]]);
                float *to;
                if (slice % step) continue;
                any = 1;
                if (!out) return any;
                stride[1] = n, stride[2] = n * n, to = out + b->first + slice / step * stride[s->axis[0]];
                for (j = 0; j < n; j++)
                    for (i = 0; i < n; i++)
                        to[j * stride[s->axis[1]] + i * stride[s->axis[2]]] = from[j * step * s->out_stride[1] + i * step];
            }
    return any;
}

/* Nothing is in the way of grid points on the faces at which the bundle enters: the ray beside them, which is a part of a node within,
   knows matter that is behind them. */
static void isogi_dvr__sweep_faces(const isogi_dvr__sweep *s, float *out) {
    size_t i, j, n;
    int a;
    for (a = 0; a < 2; a++) {
        n = s->slip[a] > 0 ? 0 : s->points[a + 1] - 1; /* on which face */
        if (!(s->slip[a] > 0 || s->slip[a] < 0) || s->first[a + 1] + n * s->every[a + 1] != (n ? s->size[a + 1] - 1 : 0)) continue;
        if (a)
            for (j = 0; j < s->points[1]; j++) out[j * s->out_stride[1] + n] = 1;
        else
            for (i = 0; i < s->points[2]; i++) out[n * s->out_stride[1] + i] = 1;
    }
}

/* Transmittance of all grid points towards a direction, in their order (z fastest where slices lie across x), or of all that are held. */
static void isogi_dvr__sweep_run(isogi_dvr__sweep *s, float *out) {
    size_t k, rays = (s->size[1] + s->size[0] + 2) * s->depth_row;
    int all = s->every[1] == 1 && s->every[2] == 1 && s->points[1] == s->size[1] && s->points[2] == s->size[2];
    memset(s->depth, 0, rays * sizeof *s->depth);
    for (k = 0; k < s->size[0]; k++) {
        isogi_dvr__slip at = isogi_dvr__slip_at(s, k);
        size_t slice = s->backwards ? s->size[0] - 1 - k : k, point = (slice - s->first[0]) / s->every[0];
        float *plane;
        if (slice < s->first[0] || (slice - s->first[0]) % s->every[0] || point >= s->points[0] ||
            (s->held && !isogi_dvr__hold_plane(s, point, NULL))) {
            isogi_dvr__sweep_add(s, k, &at, k ? 2 * s->piece : s->piece, 0);
            continue;
        }
        plane = s->held ? s->plane : out + point * s->out_stride[0];
        if (k && all) {
            isogi_dvr__rows a = {NULL, NULL, NULL, 0, 0, 0, 0, 0, 0, 0};
            isogi_dvr__sweep_add(s, k, &at, s->piece, 1);
            a.from = s->row, a.from_row = s->out_row, a.rows = s->points[1], a.count = s->points[2];
            a.out = plane, a.out_row = s->out_stride[1], a.weight = s->weight;
            s->kernels.between(&a, at.part);
        } else {
            if (k) isogi_dvr__sweep_add(s, k, &at, s->piece, 0);
            isogi_dvr__sweep_points(s, slice, &at, plane);
            isogi_dvr__sweep_add(s, k, &at, s->piece, 0);
        }
        isogi_dvr__sweep_faces(s, plane);
        if (s->held) isogi_dvr__hold_plane(s, point, out);
    }
}

/* The most points that a plane of the grid has. */
static size_t isogi_dvr__plane_points(const isogi_dvr *d) {
    const size_t *n = d->desc.grid;
    size_t least = n[0] < n[1] ? n[0] : n[1];
    return n[0] * n[1] * n[2] / (least < n[2] ? least : n[2]);
}

/* Floats that a sweep needs besides its result. */
static size_t isogi_dvr__sweep_scratch(const isogi_dvr *d) {
    size_t most = 0, row = 0;
    int a;
    for (a = 0; a < 3; a++) {
        if (d->matter.size[a] > most) most = d->matter.size[a];
        if (d->desc.grid[a] > row) row = d->desc.grid[a];
    }
    if (most + 2 * ISOGI_DVR__LANES + 2 > SIZE_MAX / 64 / (most + 2)) return 0; /* more than can be addressed */
    row = 6 * row + 2 * ISOGI_DVR__LANES;
    if (row < 2 * (most + 2) * (most + 1 + 2 * ISOGI_DVR__LANES)) row = 2 * (most + 2) * (most + 1 + 2 * ISOGI_DVR__LANES);
    return (2 * most + 2) * (2 * most + 2 + 2 * ISOGI_DVR__LANES) + row + (d->coming.block ? isogi_dvr__plane_points(d) : 0);
}

/* Slices across the axis that the direction is nearest to. */
static void isogi_dvr__set_sweep(isogi_dvr__sweep *s, const isogi_dvr *d, const double direction[3], float *scratch) {
    const isogi_dvr__matter *m = &d->matter;
    double w[3], most;
    size_t stride[3], out[3];
    int axis[3] = {2, 1, 0}, turned, a;
    axis[0] = isogi_dvr__sweep_axis(d, direction, w), most = fabs(w[axis[0]]);
    if (axis[0] != 2) axis[1] = axis[0] ? 2 : 1, axis[2] = axis[0] ? 0 : 2;
    turned = axis[0] == 0;
    stride[1] = m->row[turned], stride[turned ? 2 : 0] = 1, stride[turned ? 0 : 2] = m->row[turned] * m->size[1];
    out[turned ? 2 : 0] = 1, out[1] = d->desc.grid[turned ? 2 : 0], out[turned ? 0 : 2] = out[1] * d->desc.grid[1];
    for (a = 0; a < 3; a++) {
        s->size[a] = m->size[axis[a]], s->points[a] = d->desc.grid[axis[a]], s->first[a] = m->first[axis[a]],
        s->every[a] = m->every[axis[a]];
        s->out_stride[a] = out[axis[a]], s->axis[a] = axis[a];
    }
    s->extinction = m->extinction[turned], s->slice_stride = stride[axis[0]], s->row_stride = stride[axis[1]];
    s->backwards = w[axis[0]] > 0;
    s->slip[0] = -w[axis[1]] / most, s->slip[1] = -w[axis[2]] / most;
    s->piece = (float)isogi_dvr__clamp(0.5 / (most * d->desc.unit), 1e30);
    s->kernels = d->kernels;
    s->depth_row = s->size[2] + s->size[0] + 2 + 2 * ISOGI_DVR__LANES, s->weight = s->size[2] + 1 + 2 * ISOGI_DVR__LANES,
    s->out_row = 2 * s->weight;
    s->depth = scratch, s->row = scratch + (s->size[1] + s->size[0] + 2) * s->depth_row;
    if (d->coming.block) s->out_stride[1] = s->points[2]; /* within s->plane */
    s->held = d->coming.block ? &d->coming : NULL,
    s->plane = scratch + isogi_dvr__sweep_scratch(d) - (s->held ? isogi_dvr__plane_points(d) : 0);
}

static void isogi_dvr__sweep_task(void *arg, size_t i) {
    const isogi_dvr__batch *job = (const isogi_dvr__batch *)arg;
    isogi_dvr__sweep s;
    isogi_dvr__set_sweep(&s, job->dvr, job->dvr->direction[job->first + i], job->scratch + i * job->scratch_count);
    isogi_dvr__sweep_run(&s, job->transmittance + i * job->dvr->padded_count);
}

static void isogi_dvr__gain_task(void *arg, size_t task) {
    const isogi_dvr__batch *job = (const isogi_dvr__batch *)arg;
    isogi_dvr *d = job->dvr;
    size_t from = task * ISOGI_DVR__GAIN, count = d->padded_count - from, c;
    isogi_dvr__sums a;
    if (count > ISOGI_DVR__GAIN) count = ISOGI_DVR__GAIN;
    for (c = 0; c < d->coefficients && !job->first; c++) memset(d->gathered + c * d->padded_count + from, 0, count * sizeof *d->gathered);
    a.sum = d->gathered + from, a.from = job->transmittance + from, a.kernel = d->kernel + job->first * d->coefficients;
    a.sum_row = a.from_row = d->padded_count, a.coefficients = d->coefficients, a.directions = job->count, a.count = count;
    d->kernels.gather(&a);
}

/* One coefficient from "z fastest" to the order of grid points, by way of a direction's transmittance. */
static void isogi_dvr__unturn_task(void *arg, size_t i) {
    const isogi_dvr__batch *job = (const isogi_dvr__batch *)arg;
    const isogi_dvr *d = job->dvr;
    const size_t *n = d->desc.grid;
    float *plane = d->gathered + (job->first + i) * d->padded_count, *to = job->transmittance + i * d->padded_count;
    size_t x0, x, y, z;
    for (x0 = 0; x0 < n[0]; x0 += ISOGI_DVR__LANES)
        for (y = 0; y < n[1]; y++)
            for (z = 0; z < n[2]; z++)
                for (x = x0; x < x0 + ISOGI_DVR__LANES && x < n[0]; x++) to[x + n[0] * (y + n[1] * z)] = plane[z + n[2] * (y + n[1] * x)];
    memcpy(plane, to, d->point_count * sizeof *plane);
}

/* Sums up a batch. Not cancelled half way: it could not be repeated. */
static isogi_result isogi_dvr__gain(isogi_dvr__batch *job, size_t planes) {
    isogi_dvr *d = job->dvr;
    isogi_context whole = d->context;
    size_t next = job->first + job->count, c, count;
    isogi_result result;
    whole.progress = NULL;
    result = isogi_parallel(&whole, (d->padded_count + ISOGI_DVR__GAIN - 1) / ISOGI_DVR__GAIN, isogi_dvr__gain_task, job, 0, 0);
    if (next != d->turned || d->coming.block) return result;
    for (c = 0; result == ISOGI_OK && c < d->coefficients; c += count) {
        job->first = c, count = d->coefficients - c < planes ? d->coefficients - c : planes;
        result = isogi_parallel(&whole, count, isogi_dvr__unturn_task, job, 0, 0);
    }
    return result;
}

/* ==== steps of visibility =============================================================================================== */

/* Brute force, up to grid point `end`. */
static isogi_result isogi_dvr__step_brute(isogi_dvr *d, size_t end) {
    isogi_dvr__step_job job;
    isogi_result result = ISOGI_OK;
    size_t start = d->next, i;
    job.dvr = d;
    job.work = (isogi_counters *)isogi_allocate(&d->context, ISOGI_DVR__SLAB / ISOGI_DVR__CHUNK, sizeof *job.work);
    if (!job.work) return ISOGI_NO_MEMORY;
    while (d->next < end) {
        double span = (double)(end - start);
        size_t tasks;
        job.first = d->next, tasks = end - job.first < ISOGI_DVR__SLAB ? end - job.first : ISOGI_DVR__SLAB;
        job.end = job.first + isogi_dvr__portion(d, tasks);
        tasks = (job.end - job.first + ISOGI_DVR__CHUNK - 1) / ISOGI_DVR__CHUNK;
        result = isogi_parallel(&d->context, tasks, isogi_dvr__step_task, &job, (double)(job.first - start) / span,
                                (double)(job.end - start) / span);
        if (isogi_dvr__portion_end(d, job.end - job.first, result) != ISOGI_OK) break;
        for (i = 0; i < tasks; i++) isogi_dvr__add(&d->counters, &job.work[i]);
        d->next = job.end;
    }
    isogi_release(&d->context, job.work, ISOGI_DVR__SLAB / ISOGI_DVR__CHUNK, sizeof *job.work);
    return result;
}

/* What directions have gathered, once they all have. */
static isogi_result isogi_dvr__finish_gathered(isogi_dvr *d) {
    size_t i, c, points = isogi_dvr__coming_points(d);
    float *out = d->visibility;
    if (d->coming.block || d->held.block) out = (float *)isogi_allocate(&d->context, points * d->coefficients, sizeof *out);
    if (!out) return ISOGI_NO_MEMORY;
    for (i = 0; i < points; i++)
        for (c = 0; c < d->coefficients; c++) out[i * d->coefficients + c] = d->gathered[c * d->padded_count + i];
    if (out != d->visibility) {
        isogi_dvr__join(d, &d->coming, out, d->coefficients);
        isogi_release(&d->context, d->visibility, isogi_dvr__held_points(d) * d->coefficients, sizeof *d->visibility);
        isogi_dvr__drop_held(d, &d->held);
        isogi_release(&d->context, d->gathered, d->padded_count * d->coefficients, sizeof *d->gathered);
        d->visibility = out, d->held = d->coming, d->gathered = NULL;
        memset(&d->coming, 0, sizeof d->coming);
    }
    d->counters.texels += points;
    return ISOGI_OK;
}

/* The regular grid takes over what was held in several resolutions. */
static isogi_result isogi_dvr__unfold(isogi_dvr *d) {
    size_t i;
    float *out = (float *)isogi_allocate(&d->context, d->point_count * d->coefficients, sizeof *out);
    if (!out) return ISOGI_NO_MEMORY;
    for (i = 0; i < d->point_count; i++) {
        size_t c[3] = {i % d->desc.grid[0], i / d->desc.grid[0] % d->desc.grid[1], i / d->desc.grid[0] / d->desc.grid[1]};
        double position[3];
        int a;
        for (a = 0; a < 3; a++) position[a] = (double)c[a] / (double)(d->desc.grid[a] - 1) * d->cells[a];
        isogi_dvr__visibility_at(d, position, 0, NULL, out + i * d->coefficients);
    }
    isogi_release(&d->context, d->visibility, d->held.points * d->coefficients, sizeof *d->visibility);
    isogi_dvr__drop_held(d, &d->held);
    d->visibility = out;
    return ISOGI_OK;
}

/* The paper's second pass, up to `end` of first its blocks, then its directions. */
static isogi_result isogi_dvr__step_global(isogi_dvr *d, size_t end) {
    isogi_dvr__blocks *b = &d->blocks;
    isogi_dvr__batch job;
    isogi_result result = ISOGI_OK;
    size_t start = d->next - b->due, directions = (size_t)d->desc.directions, batch = end - d->next;
    double span = (double)batch;
    if (!batch) return ISOGI_OK;
    batch = batch < ISOGI_DVR__TOWARD ? batch : ISOGI_DVR__TOWARD;
    job.dvr = d, job.scratch_count = b->sh_count;
    job.scratch = (float *)isogi_allocate(&d->context, batch * b->sh_count, sizeof *job.scratch);
    job.transmittance = (float *)isogi_allocate(&d->context, batch * d->padded_count, sizeof *job.transmittance);
    if ((b->sh_count && !job.scratch) || !job.transmittance) result = ISOGI_NO_MEMORY;
    else memset(job.transmittance, 0, batch * d->padded_count * sizeof *job.transmittance);
    while (result == ISOGI_OK && d->next < end) {
        job.first = d->next - b->due, job.count = isogi_dvr__portion(d, end - d->next < batch ? end - d->next : batch);
        result = isogi_parallel(&d->context, (b->sh_count + ISOGI_DVR__GAIN - 1) / ISOGI_DVR__GAIN, isogi_dvr__toward_task, &job,
                                (double)(job.first - start) / span, (double)(job.first - start) / span);
        if (result == ISOGI_OK)
            result = isogi_parallel(&d->context, job.count * d->desc.grid[2], isogi_dvr__global_task, &job,
                                    (double)(job.first - start) / span, (double)(job.first + job.count - start) / span);
        if (isogi_dvr__portion_end(d, job.count, result) == ISOGI_OK) result = isogi_dvr__gain(&job, batch);
        if (result == ISOGI_OK) d->next += job.count, d->counters.rays += job.count * d->point_count;
    }
    isogi_release(&d->context, job.scratch, batch * b->sh_count, sizeof *job.scratch);
    isogi_release(&d->context, job.transmittance, batch * d->padded_count, sizeof *job.transmittance);
    return result == ISOGI_OK && d->next == b->due + directions ? isogi_dvr__finish_gathered(d) : result;
}

/* The paper's method, up to `end` of first its blocks, then its directions. */
static isogi_result isogi_dvr__step_paper(isogi_dvr *d, size_t end) {
    isogi_dvr__blocks *b = &d->blocks;
    isogi_dvr__local_job local;
    isogi_result result = ISOGI_OK;
    size_t i, count, batch;
    isogi_context whole = d->context;
    whole.progress = NULL;
    memset(&local, 0, sizeof local);
    local.dvr = d;
    local.work = (isogi_counters *)isogi_allocate(&d->context, ISOGI_DVR__SLAB / ISOGI_DVR__CHUNK, sizeof *local.work);
    if (!local.work) return ISOGI_NO_MEMORY;
    batch = d->next < b->due ? (end - d->next < ISOGI_DVR__BATCH ? end - d->next : ISOGI_DVR__BATCH) : 0;
    if (batch) {
        local.window_count = isogi_dvr__window_row(b, 16) * isogi_dvr__window_side(b, 16) * isogi_dvr__window_side(b, 16);
        local.step_count = isogi_dvr__steps_before(d, 32);
        local.window = (float *)isogi_allocate(&d->context, batch * local.window_count, sizeof *local.window);
        local.step = (isogi_dvr__local_step *)isogi_allocate(&d->context, local.step_count, sizeof *local.step);
        if (!local.window || !local.step) result = ISOGI_NO_MEMORY;
        else isogi_dvr__set_local_steps(d, local.step);
        isogi_dvr__set_table(d, d->matter.table); /* an edit of colours alone may have moved the classes */
    }
    while (result == ISOGI_OK && d->next < end && d->next < b->due) {
        local.first = d->next, count = (end < b->due ? end : b->due) - d->next;
        count = isogi_dvr__portion(d, count < batch ? count : batch);
        result = isogi_dvr__portion_end(d, count, isogi_parallel(&d->context, count, isogi_dvr__local_task, &local, 0, 0));
        for (i = 0; result == ISOGI_OK && i < count; i++) {
            isogi_dvr__add(&d->counters, &local.work[i]);
            b->stale[b->order[d->next++]] = 0, d->computed++;
        }
    }
    for (local.packing = 1; result == ISOGI_OK && d->next == b->due && local.packing <= 16; local.packing *= 2)
        result = isogi_parallel(&whole, b->total, isogi_dvr__finish_task, &local, 0, 0);
    isogi_release(&d->context, local.window, batch * local.window_count, sizeof *local.window);
    isogi_release(&d->context, local.step, local.step_count, sizeof *local.step);
    isogi_release(&d->context, local.work, ISOGI_DVR__SLAB / ISOGI_DVR__CHUNK, sizeof *local.work);
    return result == ISOGI_OK && d->next >= b->due ? isogi_dvr__step_global(d, end) : result;
}

/* Sweeps, up to direction `end`. The picture keeps what it had until the last one is done. */
static isogi_result isogi_dvr__step_sweeps(isogi_dvr *d, size_t end) {
    isogi_dvr__batch job;
    isogi_result result = ISOGI_OK;
    size_t batch = end - d->next < ISOGI_DVR__BATCH ? end - d->next : ISOGI_DVR__BATCH, start = d->next;
    double span = (double)(end - start);
    if (!batch) return d->coming.block ? isogi_dvr__finish_gathered(d) : ISOGI_OK;
    job.dvr = d, job.scratch_count = isogi_dvr__sweep_scratch(d);
    if (!job.scratch_count || job.scratch_count > SIZE_MAX / 4 / batch || d->padded_count > SIZE_MAX / 4 / batch)
        return ISOGI_TOO_LARGE;
    job.scratch = (float *)isogi_allocate(&d->context, batch * job.scratch_count, sizeof(float));
    job.transmittance = (float *)isogi_allocate(&d->context, batch * d->padded_count, sizeof(float));
    if (!job.scratch || !job.transmittance) result = ISOGI_NO_MEMORY;
    while (result == ISOGI_OK && d->next < end) {
        job.first = d->next, job.count = isogi_dvr__portion(d, end - d->next < batch ? end - d->next : batch);
        if (d->next < d->turned && d->turned - d->next < job.count) job.count = d->turned - d->next;
        result = isogi_parallel(&d->context, job.count, isogi_dvr__sweep_task, &job, (double)(job.first - start) / span,
                                (double)(job.first + job.count - start) / span);
        if (isogi_dvr__portion_end(d, job.count, result) == ISOGI_OK) result = isogi_dvr__gain(&job, batch);
        if (result == ISOGI_OK) d->next += job.count, d->counters.rays += job.count * isogi_dvr__coming_points(d);
    }
    isogi_release(&d->context, job.scratch, batch * job.scratch_count, sizeof(float));
    isogi_release(&d->context, job.transmittance, batch * d->padded_count, sizeof(float));
    return result == ISOGI_OK && d->next == (size_t)d->desc.directions ? isogi_dvr__finish_gathered(d) : result;
}

/* What has to be read before directions are swept, or blocks take rays: 1 in *go_on when it is done and budget is left, which *max_rays
   then holds. */
static isogi_result isogi_dvr__prepare(isogi_dvr *d, uint64_t *max_rays, double *remaining, int *go_on) {
    isogi_dvr__blocks *b = &d->blocks;
    isogi_result result = ISOGI_OK;
    double used = 0, left = 0, directions = (double)d->desc.directions;
    *go_on = 1;
    if (d->method == ISOGI_DVR_PAPER && !b->ready) {
        result = isogi_dvr__count_blocks(d, *max_rays, &used);
        left = (double)(b->total - b->counted);
        if (result == ISOGI_OK && !(left > 0)) result = isogi_dvr__update_blocks(d);
        left = (left + directions) / ((double)b->total + directions);
        *go_on = b->counted == b->total;
    } else if (d->method == ISOGI_DVR_SWEEP && d->matter.prepared < d->matter.size[2]) {
        const isogi_dvr__matter *m = &d->matter;
        do result = isogi_dvr__update_matter(d, *max_rays, &used);
        while (result == ISOGI_OK && !*max_rays && m->prepared < m->size[2]);
        left = ((double)(m->size[2] - m->prepared) + directions) / ((double)m->size[2] + directions);
        *go_on = m->prepared == m->size[2];
    }
    if (d->desc.coarsest > 1 && d->method == ISOGI_DVR_BRUTE && d->held.block) result = isogi_dvr__unfold(d);
    if (d->desc.coarsest > 1 && d->method == ISOGI_DVR_SWEEP && *go_on && result == ISOGI_OK && !d->next && !d->coming.block)
        result = isogi_dvr__plan_coming(d);
    if (*max_rays && used >= (double)*max_rays) *go_on = 0;
    if (!*go_on && result == ISOGI_OK && remaining) *remaining = left;
    if (*max_rays && *go_on) *max_rays -= (uint64_t)used;
    return result;
}

/* Units of work and the rays of each: brute force goes on by grid points, sweeps by planes of the lattice (four voxels are taken for a
   ray) and then by directions, the paper's method by blocks (whose voxels, and then whose short rays, are taken for 64 points') and then
   by directions. */
static isogi_result isogi_dvr__step(isogi_dvr *dvr, uint64_t max_rays, double *remaining) {
    isogi_result result = ISOGI_OK;
    uint64_t units, rays;
    size_t count, end;
    double share = 1; /* of all the work, that of what follows */
    int go_on = 1;
    if (dvr->transparent && dvr->point_count && (isogi_dvr__by_value(dvr) || !dvr->transfer.peak_count)) {
        /* all blocks are dropped, whatever values they hold: no voxel is read */
        if (dvr->method == ISOGI_DVR_PAPER && !dvr->blocks.ready) result = isogi_dvr__update_blocks(dvr);
        if (result != ISOGI_OK) return result;
        isogi_dvr__clear_visibility(dvr);
        if (remaining) *remaining = 0;
        return ISOGI_OK;
    }
    if (dvr->point_count) result = isogi_dvr__prepare(dvr, &max_rays, remaining, &go_on);
    if (result != ISOGI_OK || !go_on) return result;
    count = dvr->point_count, rays = (uint64_t)dvr->desc.directions;
    if (count && dvr->method == ISOGI_DVR_SWEEP) {
        count = (size_t)dvr->desc.directions, rays = isogi_dvr__coming_points(dvr);
        share = (double)count / ((double)count + (double)dvr->matter.size[2]);
    }
    if (count && dvr->method == ISOGI_DVR_PAPER) {
        rays = dvr->next < dvr->blocks.due ? 64 * rays : dvr->point_count;
        count = dvr->blocks.due + (size_t)dvr->desc.directions, share = dvr->blocks.share;
    }
    units = max_rays / rays;
    units = units ? units : 1;
    end = max_rays && units < count - dvr->next ? dvr->next + (size_t)units : count;
    if (dvr->method == ISOGI_DVR_SWEEP) result = isogi_dvr__step_sweeps(dvr, end);
    else result = dvr->method == ISOGI_DVR_PAPER && count ? isogi_dvr__step_paper(dvr, end) : isogi_dvr__step_brute(dvr, end);
    if (result == ISOGI_OK && remaining) *remaining = count ? (double)(count - dvr->next) / (double)count * share : 0;
    return result;
}

ISOGI_API isogi_result isogi_dvr_step(isogi_dvr *dvr, uint64_t max_rays, double *remaining) {
    isogi_thread_pool *pool;
    isogi_result result;
    if (!dvr) return ISOGI_INVALID;
    pool = isogi_thread_pool_begin(&dvr->context);
    result = isogi_dvr__step(dvr, max_rays, remaining);
    isogi_thread_pool_end(&dvr->context, pool);
    return result;
}

/* Whether there can be arrays of so many points, and of coefficients at each. */
static int isogi_dvr__countable(const isogi_dvr *d, size_t count) {
    return count <= SIZE_MAX / 2 / sizeof(float) / (d->coefficients > 3 ? d->coefficients : 3);
}

ISOGI_API isogi_result isogi_dvr_sample_visibility(const isogi_dvr *dvr, const float (*points)[3], size_t count, float *visibility) {
    size_t i;
    int a;
    if (!dvr || !dvr->visibility || (count && (!points || !visibility))) return ISOGI_INVALID;
    if (!isogi_dvr__countable(dvr, count)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i++) {
        double world[3], grid[3];
        for (a = 0; a < 3; a++) world[a] = (double)points[i][a];
        isogi_vol_to_grid(dvr->desc.pyramid, world, grid);
        isogi_dvr__visibility_at(dvr, grid, 0, NULL, visibility + i * dvr->coefficients);
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_dvr_set_clip(isogi_dvr *dvr, const double (*planes)[4], size_t count) {
    double(*clip)[4], zero[3] = {0, 0, 0}, origin[3], unit[3], step[3];
    size_t i;
    int a;
    if (!dvr || (count && !planes)) return ISOGI_INVALID;
    if (count > ISOGI_DVR_MAX_PLANES) return ISOGI_TOO_LARGE;
    for (i = 0; i < 4 * count; i++)
        if (!isogi_dvr__finite64(planes[i / 4][i % 4])) return ISOGI_INVALID;
    clip = (double(*)[4])isogi_allocate(&dvr->context, count, sizeof *clip);
    if (count && !clip) return ISOGI_NO_MEMORY;
    isogi_vol_to_world(dvr->desc.pyramid, zero, origin);
    for (i = 0; i < count; i++) {
        double plane[4], most = 0;
        int power = 0; /* that brings the largest component of the normal, of any length, to a half up to 1 */
        for (a = 0; a < 3; a++) most = fabs(planes[i][a]) > most ? fabs(planes[i][a]) : most;
        (void)frexp(most, &power);
        for (a = 0; a < 4; a++) plane[a] = ldexp(planes[i][a], -power);
        plane[3] = plane[3] < 1e300 ? plane[3] > -1e300 ? plane[3] : -1e300 : 1e300;
        clip[i][3] = isogi_dvr__dot(plane, origin) + plane[3];
        for (a = 0; a < 3; a++) {
            unit[0] = a == 0, unit[1] = a == 1, unit[2] = a == 2;
            isogi_vol_to_world(dvr->desc.pyramid, unit, step);
            clip[i][a] = isogi_dvr__dot(plane, step) - isogi_dvr__dot(plane, origin);
        }
    }
    isogi_release(&dvr->context, dvr->clip, dvr->clip_count, sizeof *clip);
    dvr->clip = clip, dvr->clip_count = count;
    for (i = 0; i < dvr->changed_count; i++) {
        uint8_t cut = isogi_dvr__cut(dvr, i);
        if ((cut || dvr->cut[i]) && !(cut == 2 && dvr->cut[i] == 2)) dvr->changed[i] = 1;
        dvr->cut[i] = cut;
    }
    isogi_dvr__mark_empty(dvr);
    isogi_dvr__begin_anew(dvr);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_dvr_inspect(const isogi_dvr *dvr, isogi_dvr_report *report) {
    isogi_dvr_report r;
    size_t i;
    int a;
    if (!dvr || !report) return ISOGI_INVALID;
    memset(&r, 0, sizeof r);
    for (a = 0; a < 3; a++) r.block_count[a] = dvr->level[1].size[a];
    r.blocks_classified = dvr->classified, r.blocks_computed = dvr->computed;
    r.grid_points = isogi_dvr__held_points(dvr);
    r.global_bytes = r.grid_points * dvr->coefficients * sizeof(float) + dvr->held.total * sizeof *dvr->held.block;
    for (i = 0; i < dvr->held.total; i++) r.step_count[dvr->held.block[i].log]++;
    if (dvr->blocks.total && dvr->method == ISOGI_DVR_PAPER) {
        const isogi_dvr__blocks *b = &dvr->blocks;
        r.level = b->level;
        for (i = 0; i < b->total; i++) {
            a = 0;
            while (b->level[i] >> a) a++;
            r.level_count[a]++;
            r.points += isogi_dvr__level_points(b, i, b->level[i]);
        }
        if (r.points)
            r.reduction = (double)dvr->volume.size[0] * (double)dvr->volume.size[1] * (double)dvr->volume.size[2] / (double)r.points;
        r.data_bytes = b->data_count * sizeof *b->data, r.local_bytes = b->sh_count * dvr->coefficients * sizeof *b->sh;
        r.index_bytes = b->total * (2 * sizeof *b->first + sizeof *b->order + 3);
    }
    *report = r;
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_dvr_sample_blocks(const isogi_dvr *dvr, const float (*points)[3], size_t count, float *values,
                                               float *visibility) {
    size_t i, block;
    int a;
    if (!dvr || !dvr->blocks.total || dvr->method != ISOGI_DVR_PAPER || (count && !points)) return ISOGI_INVALID;
    if (!isogi_dvr__countable(dvr, count)) return ISOGI_TOO_LARGE;
    for (i = 0; i < count; i++) {
        double world[3], grid[3];
        for (a = 0; a < 3; a++) world[a] = (double)points[i][a];
        isogi_vol_to_grid(dvr->desc.pyramid, world, grid);
        for (a = 0; a < 3; a++) grid[a] = isogi_dvr__clamp(grid[a], dvr->cells[a]);
        block = isogi_dvr__block_of(&dvr->blocks, grid);
        if (values) values[i] = (float)(dvr->base + (double)isogi_dvr__block_value(dvr, block, grid));
        if (visibility) isogi_dvr__local_at(dvr, block, grid, visibility + i * dvr->coefficients);
    }
    return ISOGI_OK;
}

ISOGI_API void isogi_dvr_counters(const isogi_dvr *dvr, isogi_counters *counters) {
    if (dvr) isogi_dvr__add(counters, &dvr->counters);
}

/* ==== shading ======================================================================================================== */

/* Lights divided into those that are the same everywhere and those that depend on the place. */
typedef struct isogi_dvr__lights {
    isogi_lighting distant, nearby;
    isogi_light *list; /* copies: the distant ones, then the nearby ones */
    size_t count;
    float sh[3 * ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER]; /* visibility: of all distant lights; local: irradiance of the environment */
    double mean[3];                                            /* of the environment's radiance */
    float least[3];                                            /* visibility: light that is scattered at least, times V(0) */
    int dark;                                                  /* the environment is black */
    int local;                                                 /* shade by local visibility */
} isogi_dvr__lights;

/* A truncated series rings below zero where V sees dim parts of a sky that is bright elsewhere, and parts that are black would be the
   darkest in the picture. No light is less than a share of what it would be if the environment were the same all around, and came from
   where the phase function is least: less with higher orders, which ring less. */
static double isogi_dvr__least_share(int order) { return order <= 4 ? 0.25 : order == 5 ? 0.125 : 0; }

/* Of all distant light, which is projected, what the environment alone has. */
static isogi_result isogi_dvr__set_least(isogi_dvr__lights *l, int order, double anisotropy) {
    isogi_lighting directional = l->distant;
    float sh[3] = {0, 0, 0};
    double g = fabs(anisotropy), share = isogi_dvr__least_share(order) * (1 - g) / ((1 + g) * (1 + g)) / (4 * ISOGI_DVR__PI);
    isogi_result result = ISOGI_OK;
    int a;
    memset(&directional.env, 0, sizeof directional.env);
    if (directional.light_count) result = isogi_sh_project(sh, 1, &directional, NULL);
    for (a = 0; a < 3; a++) /* a millionth less: what rounding leaves of directional lights is no sky */
        l->least[a] = (float)(share * isogi_dvr__clamp(0.999999 * (double)l->sh[a] - (double)sh[a], 1e30));
    return result;
}

static isogi_result isogi_dvr__set_lights(isogi_dvr__lights *l, const isogi_dvr *d, const isogi_lighting *lighting) {
    isogi_lighting environment;
    isogi_result result;
    size_t i, distant = 0, nearby = 0;
    int a;
    memset(l, 0, sizeof *l);
    if (d->desc.shading == ISOGI_DVR_UNLIT) return ISOGI_OK;
    result = isogi_lighting_validate(lighting);
    if (result != ISOGI_OK) return result;
    l->count = lighting->light_count;
    l->list = (isogi_light *)isogi_allocate(&d->context, l->count, sizeof *l->list);
    if (l->count && !l->list) return ISOGI_NO_MEMORY;
    for (i = 0; i < l->count; i++) {
        const isogi_light *light = &lighting->lights[i];
        if (light->kind == ISOGI_LIGHT_DIRECTIONAL) l->list[distant++] = *light;
        else l->list[l->count - ++nearby] = *light;
    }
    l->distant.env = lighting->env, l->distant.lights = l->list, l->distant.light_count = distant;
    if (nearby) l->nearby.lights = l->list + distant, l->nearby.light_count = nearby;
    if (d->desc.shading == ISOGI_DVR_VISIBILITY) {
        result = isogi_sh_project(l->sh, d->desc.order, &l->distant, NULL);
        return result == ISOGI_OK ? isogi_dvr__set_least(l, d->desc.order, d->desc.anisotropy) : result;
    }
    memset(&environment, 0, sizeof environment);
    environment.env = lighting->env;
    result = isogi_sh_project(l->sh, ISOGI_DVR__LOCAL_ORDER, &environment, NULL);
    for (a = 0; a < 3; a++) l->mean[a] = (double)l->sh[a] / (2 * sqrt(ISOGI_DVR__PI));
    for (i = 0, l->dark = 1; i < 3 * ISOGI_SH_COUNT(ISOGI_DVR__LOCAL_ORDER); i++) l->dark = l->dark && !(fabsf(l->sh[i]) > 0);
    if (result == ISOGI_OK) result = isogi_sh_convolve_cosine(l->sh, l->sh, ISOGI_DVR__LOCAL_ORDER, 3);
    return result;
}

/* Light scattered along a ray after Henyey and Greenstein: degree l of the product of light and visibility is scaled by g^l, and read
   in the direction from which it would go on straight (which is the ray's own). g = 0 is 1/(4 pi) L . V. */
static double isogi_dvr__scatter(const isogi_dvr *d, const float *light, const float *v, const float dir[3]) {
    float product[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER], y[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER];
    double sum = 0, power = 1;
    int l, m;
    if (isogi_sh_product(product, light, v, d->desc.order, 1) != ISOGI_OK) return 0;
    isogi_sh_eval(y, d->desc.order, (const float(*)[3])dir, 1);
    for (l = 0; l < d->desc.order; l++, power *= d->desc.anisotropy)
        for (m = -l; m <= l; m++) sum += power * (double)product[l * (l + 1) + m] * (double)y[l * (l + 1) + m];
    return sum;
}

/* 1/(4 pi) L . V at a place (Kronander 2011, section 4.4). */
static void isogi_dvr__shade_visibility(const isogi_dvr *d, const isogi_dvr__lights *l, const double grid[3], const double front[3],
                                        double open, const isogi_dvr__sheet *sheet, const float dir[3], double out[3]) {
    float v[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER], nearby[3 * ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER];
    size_t i;
    int a, here = 0;
    if (l->local) isogi_dvr__local_at(d, isogi_dvr__block_of(&d->blocks, grid), grid, v);
    else {
        double place[3];
        for (a = 0; a < 3; a++) place[a] = grid[a] + front[a];
        isogi_dvr__visibility_at(d, place, open, sheet, v);
    }
    if (l->nearby.light_count) {
        double world[3];
        float point[3];
        isogi_vol_to_world(d->desc.pyramid, grid, world);
        for (a = 0; a < 3; a++) point[a] = (float)world[a];
        here = isogi_sh_project(nearby, d->desc.order, &l->nearby, point) == ISOGI_OK;
    }
    for (a = 0; a < 3; a++) {
        float light[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER];
        double sum = 0;
        for (i = 0; i < d->coefficients; i++) {
            /* cppcheck-suppress uninitvar */
            light[i] = l->sh[3 * i + (size_t)a] + (here ? nearby[3 * i + (size_t)a] : 0);
            sum += (double)light[i] * (double)v[i];
        }
        sum /= 4 * ISOGI_DVR__PI;
        if (fabs(d->desc.anisotropy) > 0) sum = isogi_dvr__scatter(d, light, v, dir);
        if (sum < (double)(l->least[a] * v[0])) sum = (double)(l->least[a] * v[0]);
        out[a] = isogi_dvr__clamp(sum, 1e30) + d->desc.emission;
    }
}

/* Irradiance of a light, from its direction `to` (made a unit vector); 0 if there is none. */
static double isogi_dvr__reach(const isogi_light *light, const double world[3], double to[3]) {
    double length, scale = 1;
    int a;
    for (a = 0; a < 3; a++) to[a] = (double)light->vector[a] - (light->kind == ISOGI_LIGHT_DIRECTIONAL ? 0 : world[a]);
    length = sqrt(isogi_dvr__dot(to, to));
    if (!(length > 1e-30)) return 0;
    for (a = 0; a < 3; a++) to[a] /= length;
    if (light->kind == ISOGI_LIGHT_DIRECTIONAL) return 1;
    if (light->kind == ISOGI_LIGHT_SPHERE && length < (double)light->radius) length = (double)light->radius; /* inside of the lamp */
    scale = 1 / (length * length);
    if (light->kind == ISOGI_LIGHT_RECTANGLE) { /* as from its centre, by the cosine to its normal */
        const float *u = light->edge[0], *v = light->edge[1];
        double n[3], facing;
        for (a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            n[a] = (double)u[b] * (double)v[c] - (double)u[c] * (double)v[b];
        }
        facing = -isogi_dvr__dot(n, to) / sqrt(isogi_dvr__dot(n, n));
        scale *= facing > 0 ? facing : 0;
    }
    return scale < 1e30 ? scale : 0;
}

/* Diffuse, unshadowed, with the smoothed normal turned towards the eye; light from all sides where there is no normal. */
static void isogi_dvr__shade_local(const isogi_dvr *d, const isogi_dvr__lights *l, const int cell[3], const double local[3],
                                   const float dir[3], double out[3]) {
    float normal[3], sky[3];
    double n[3], world[3], grid[3], facing = 0;
    isogi_hit hit;
    size_t i;
    int a, flat;
    memset(&hit, 0, sizeof hit);
    hit.side = 1;
    for (a = 0; a < 3; a++) hit.cell[a] = (uint32_t)cell[a], hit.local[a] = local[a], grid[a] = cell[a] + local[a];
    isogi_vol_normals(d->desc.pyramid, &hit, 1, d->desc.normals, &normal);
    world[0] = world[1] = world[2] = 0;
    if (l->nearby.light_count) isogi_vol_to_world(d->desc.pyramid, grid, world);
    for (a = 0; a < 3; a++) n[a] = (double)normal[a], facing += n[a] * (double)dir[a];
    flat = !(isogi_dvr__dot(n, n) > 0.5);
    for (a = 0; a < 3; a++) {
        if (facing > 0) n[a] = -n[a], normal[a] = -normal[a];
        out[a] = flat ? l->mean[a] : 0;
    }
    if (!flat && !l->dark) {
        isogi_sh_eval_sum(sky, l->sh, ISOGI_DVR__LOCAL_ORDER, 3, (const float(*)[3])&normal, 1);
        for (a = 0; a < 3; a++) out[a] = (double)sky[a] / ISOGI_DVR__PI;
    }
    for (i = 0; i < l->count; i++) {
        double to[3], irradiance = isogi_dvr__reach(&l->list[i], world, to), cosine = isogi_dvr__dot(to, n);
        for (a = 0; a < 3; a++)
            out[a] += (double)l->list[i].rgb[a] * irradiance * (flat ? 0.25 : isogi_dvr__clamp(cosine, 1)) / ISOGI_DVR__PI;
    }
    for (a = 0; a < 3; a++) out[a] = isogi_dvr__clamp(out[a], 1e30);
}

/* Kraus 2005, eq. 19, of a place with this opacity, without the factor opacity that compositing applies: out becomes a factor on the
   transfer function's colour, `add` is the highlight. I_i is irradiance / pi. side: +1 where values rise along the ray, whatever the
   normal says: so which side the eye is on does not depend on how normals were smoothed. 0 where they stay as they are: there the normal
   does say, by what it was smoothed from. H(0) = 0: light that grazes the surface, and all light where there is no normal, neither
   comes back nor through; what remains is ambient. */
static void isogi_dvr__shade_two_sided(const isogi_dvr *d, const isogi_dvr__lights *l, const int cell[3], const double local[3],
                                       const float dir[3], int side, double opacity, double out[3], double add[3]) {
    const double direction[3] = {(double)dir[0], (double)dir[1], (double)dir[2]};
    const isogi_material *front = &d->desc.material[side > 0 ? 0 : 1], *through = &d->desc.material[2];
    float normal[3];
    double n[3], world[3], grid[3];
    isogi_hit hit;
    size_t i;
    int a;
    memset(&hit, 0, sizeof hit);
    hit.side = 1;
    for (a = 0; a < 3; a++) hit.cell[a] = (uint32_t)cell[a], hit.local[a] = local[a], grid[a] = cell[a] + local[a];
    isogi_vol_normals(d->desc.pyramid, &hit, 1, d->desc.normals, &normal);
    isogi_vol_to_world(d->desc.pyramid, grid, world);
    for (a = 0; a < 3; a++) {
        float ambient = side ? front->diffuse[a] : 0.5f * d->desc.material[0].diffuse[a] + 0.5f * d->desc.material[1].diffuse[a];
        n[a] = (double)normal[a], out[a] = l->mean[a] * (double)ambient, add[a] = 0;
    }
    if (!side) side = isogi_dvr__dot(n, direction) > 0 ? -1 : 1, front = &d->desc.material[side > 0 ? 0 : 1];
    for (a = 0; a < 3; a++) n[a] *= side;
    for (i = 0; i < l->count; i++) {
        double to[3], irradiance = isogi_dvr__reach(&l->list[i], world, to) / ISOGI_DVR__PI, cosine = isogi_dvr__dot(to, n), gloss = 0;
        const isogi_material *m = cosine > 0 ? front : through;
        double share = cosine > 0 ? 1 : 1 - opacity;
        if (!(cosine > 0 || cosine < 0)) continue;
        /* r.v and -l.v, with v = -dir */
        for (a = 0; a < 3; a++) gloss += (cosine > 0 ? to[a] - 2 * n[a] * cosine : to[a]) * (double)dir[a];
        gloss = m->exponent > 0 ? pow(isogi_dvr__clamp(gloss, 1), (double)m->exponent) : 0;
        for (a = 0; a < 3; a++) {
            double intensity = (double)l->list[i].rgb[a] * irradiance * share;
            out[a] += intensity * fabs(cosine) * (double)m->diffuse[a];
            if (cosine > 0) add[a] += intensity * gloss * (double)m->specular[a];
            else out[a] += intensity * gloss * (double)m->specular[a];
        }
    }
    for (a = 0; a < 3; a++) out[a] = isogi_dvr__clamp(out[a], 1e30), add[a] = isogi_dvr__clamp(add[a], 1e30);
}

/* ==== compositing ==================================================================================================== */

typedef struct isogi_dvr__pixel_ray {
    const isogi_dvr *dvr;
    const isogi_dvr__lights *lights;
    float dir[3];
    double along[3];      /* dir, not rounded: where the ray goes, */
    double grid_dir[3];   /* and in grid space */
    double clear, rgb[3]; /* transmittance and premultiplied colour so far */
    double end;           /* transmittance at which the ray ends */
    double front[3];      /* from a sample to where its visibility is looked up: grid */
    double plain;         /* there: 0 = grid points are weighed by their openness .. 1 = they are not */
    const isogi_dvr__sheet *sheet; /* there, NULL but for a peak */
    int probe;            /* 1: no colour; where does the transmittance pass `end`? */
    double t;             /* the answer, in the march's t */
} isogi_dvr__pixel_ray;

/* Colour as it leaves a place towards the eye: rgb is the transfer function's and is multiplied by light, highlights come on top.
   side: +1 where values rise along the ray, else -1. */
static void isogi_dvr__shade(const isogi_dvr__pixel_ray *r, const int cell[3], const double local[3], int side, double opacity,
                             double rgb[3]) {
    double light[3], grid[3], add[3] = {0, 0, 0};
    int a;
    if (r->dvr->desc.shading == ISOGI_DVR_UNLIT) return;
    for (a = 0; a < 3; a++) grid[a] = cell[a] + local[a];
    if (r->dvr->desc.shading == ISOGI_DVR_VISIBILITY)
        isogi_dvr__shade_visibility(r->dvr, r->lights, grid, r->front, 1 - r->plain, r->sheet, r->dir, light);
    else if (r->dvr->desc.shading == ISOGI_DVR_TWO_SIDED)
        isogi_dvr__shade_two_sided(r->dvr, r->lights, cell, local, r->dir, side, opacity, light, add);
    else isogi_dvr__shade_local(r->dvr, r->lights, cell, local, r->dir, light);
    for (a = 0; a < 3; a++) rgb[a] = rgb[a] * light[a] + add[a];
}

static void isogi_dvr__composite(isogi_dvr__pixel_ray *r, double opacity, const double rgb[3]) {
    int a;
    if (!r->probe)
        for (a = 0; a < 3; a++) r->rgb[a] += r->clear * opacity * rgb[a];
}

/* The part from..to of a sample's piece of ray: the medium is homogeneous there. */
static void isogi_dvr__composite_part(isogi_dvr__pixel_ray *r, const isogi_dvr__sample *s, double from, double to, const double rgb[3]) {
    double depth = s->depth * ((to - from) / (s->to - s->from));
    double clear = r->clear * exp(-depth);
    isogi_dvr__composite(r, -expm1(-depth), rgb);
    if (r->probe && r->clear > r->end && clear <= r->end) r->t = from + (to - from) * isogi_dvr__clamp(log(r->clear / r->end) / depth, 1);
    r->clear = clear;
}

/* Kraus 2005, eq. 15, 16. */
static double isogi_dvr__aslant_opacity(isogi_dvr_silhouette kind, double opacity, double cosine) {
    if (kind == ISOGI_DVR_SILHOUETTE_NONE || !(opacity > 0)) return opacity;
    if (kind == ISOGI_DVR_SILHOUETTE_EXACT) return opacity < 1 && cosine > 1e-30 ? -expm1(log1p(-opacity) / cosine) : 1;
    return cosine > opacity ? opacity / cosine : 1;
}

/* Opacity of a peak that is seen aslant. A surface without a normal is seen straight on. */
static double isogi_dvr__peak_opacity(const isogi_dvr *d, double opacity, const isogi_hit *hit, const float dir[3]) {
    float normal[3];
    double cosine = 0, length = 0;
    int a;
    if (d->desc.silhouette == ISOGI_DVR_SILHOUETTE_NONE) return opacity;
    isogi_vol_normals(d->desc.pyramid, hit, 1, d->desc.normals, &normal);
    for (a = 0; a < 3; a++) cosine += (double)normal[a] * (double)dir[a], length += (double)normal[a] * (double)normal[a];
    if (!(length > 0.5) || !(opacity > 0)) return opacity;
    return isogi_dvr__aslant_opacity(d->desc.silhouette, opacity, fabs(cosine));
}

/* The second field at a hit, in double where it has voxels; 0: it has no value there. */
static int isogi_dvr__second_value(const isogi_dvr *d, const isogi_hit *hit, double *value) {
    const isogi_volume *v = isogi_vol_volume(d->desc.second);
    double at[3], world[3], corner[8];
    float point[3], read;
    uint32_t cell[3];
    int a, i, n;
    if (!v->data) {
        isogi_vol_positions(d->desc.pyramid, hit, 1, &point);
        if (isogi_vol_sample(d->desc.second, (const float(*)[3])&point, 1, &read, NULL) != ISOGI_OK) return 0;
        *value = (double)read;
        return !isogi_dvr__is_nan(*value);
    }
    for (a = 0; a < 3; a++) at[a] = hit->cell[a] + hit->local[a];
    isogi_vol_to_world(d->desc.pyramid, at, world), isogi_vol_to_grid(d->desc.second, world, at);
    for (a = 0; a < 3; a++) {
        const size_t last = v->size[a] > 1 ? v->size[a] - 2 : 0;
        at[a] = isogi_dvr__clamp(at[a], (double)(v->size[a] - 1));
        cell[a] = at[a] < (double)last ? (uint32_t)at[a] : (uint32_t)last, at[a] -= cell[a];
    }
    if (!isogi_volume_corners(v, cell, corner)) return 0;
    for (a = 0, n = 4; a < 3; a++, n /= 2) /* what is the same at both ends is so between them */
        for (i = 0; i < n; i++) corner[i] = corner[2 * i] + at[a] * (corner[2 * i + 1] - corner[2 * i]);
    *value = corner[0];
    return 1;
}

/* A peak's colour: its own, times that of the second field. */
static void isogi_dvr__peak_colour(const isogi_dvr *d, const isogi_peak *peak, const isogi_hit *hit, double rgb[3]) {
    double factor[3], value;
    int a;
    for (a = 0; a < 3; a++) rgb[a] = (double)peak->rgb[a];
    if (!d->desc.second || !d->desc.second_count || !isogi_dvr__second_value(d, hit, &value)) return;
    isogi_dvr__colour(d->desc.second_points, d->desc.second_count, value, factor);
    for (a = 0; a < 3; a++) rgb[a] *= factor[a];
}

static void isogi_dvr__composite_peak(isogi_dvr__pixel_ray *r, const isogi_peak *peak, const isogi_hit *hit, double t) {
    double rgb[3], opacity = isogi_dvr__peak_opacity(r->dvr, (double)peak->opacity, hit, r->dir);
    int cell[3], a;
    for (a = 0; a < 3; a++) cell[a] = (int)hit->cell[a];
    if (!r->probe && opacity > 0) {
        isogi_dvr__sheet sheet;
        if (r->dvr->desc.shading == ISOGI_DVR_VISIBILITY) {
            /* a little before it, as a grid point may lie upon it */
            const double off = isogi_dvr__clamp(isogi_dvr__reach_along(r->dvr, r->grid_dir) / 12, t);
            for (a = 0; a < 3; a++) r->front[a] = -off * r->grid_dir[a];
            sheet.isovalue = peak->isovalue, sheet.side = hit->side > 0 ? 1 : -1;
            sheet.behind = opacity < 1 - 1e-6 ? 1 - opacity : 1e-6; /* far less than dark points before it */
            r->sheet = &sheet;
        }
        isogi_dvr__peak_colour(r->dvr, peak, hit, rgb);
        isogi_dvr__shade(r, cell, hit->local, hit->side > 0 ? 1 : -1, opacity, rgb);
        isogi_dvr__composite(r, opacity, rgb);
        for (a = 0, r->sheet = NULL; a < 3; a++) r->front[a] = 0;
    }
    if (r->clear > r->end) r->t = t;
    r->clear *= 1 - opacity;
}

static void isogi_dvr__composite_crossing(isogi_dvr__pixel_ray *r, isogi_dvr__crossings *c, size_t i) {
    isogi_dvr__composite_peak(r, &r->dvr->transfer.peaks[i], &c->hit[i], c->t[i]);
    isogi_dvr__pass_crossing(c, i);
}

/* ---- pieces of a ray over values ---- */

/* A piece at work. */
typedef struct isogi_dvr__span {
    isogi_dvr__walk walk;
    isogi_dvr__stretch piece;
    isogi_dvr_silhouette silhouette; /* of samples */
    int lit, sampled, flat;          /* flat: in a tetrahedron, not in the cell of a lattice */
    double aslant;                   /* flat: |grad s| |v| / |grad s . v| */
    double light[3], add[3]; /* at the middle of the piece, once it is asked for */
    double factor;           /* of silhouettes, on depth */
    double path;             /* what stands for |change of the value| where there is none */
    double touched, touched_t; /* the last peak that rose, and where: falling off it at once is no second crossing */
    double unlit[3];           /* bounded and lit by visibility: colour of the piece so far, */
    double depth, absorbing;   /* its optical depth, and the part of it that absorbs */
    int bounded;               /* in physical space, with colours of this limit: */
    double limit;
} isogi_dvr__span;

static void isogi_dvr__span_place(const isogi_dvr__span *s, double u, double local[3]) {
    const isogi_dvr__march *m = s->walk.m;
    double t = s->piece.t0 + u * s->piece.dt;
    int a;
    for (a = 0; a < 3; a++) local[a] = isogi_dvr__clamp(m->origin[a] + t * m->dir[a] - s->piece.cell[a], 1);
}

/* f of eq. 15 and 17 for the whole piece: int |grad s| |v| dt over the change of the value, by Gauss's rule with two points. */
static double isogi_dvr__span_factor(isogi_dvr__span *s) {
    const isogi_dvr__stretch *p = &s->piece;
    double change = fabs(p->value[1] - p->value[0]), sum = 0, local[3];
    int i;
    s->path = 0;
    if (s->silhouette == ISOGI_DVR_SILHOUETTE_NONE || !(p->to > p->from)) return 1;
    for (i = 0; i < 2; i++) {
        double u = p->u0 + (i ? 0.78867513459481288225 : 0.21132486540518711775) * (p->u1 - p->u0), value;
        int cell[3];
        if (s->sampled) isogi_dvr__value_at(s->walk.m, p->t0 + u * p->dt, cell, local, &value);
        else isogi_dvr__span_place(s, u, local);
        sum += 0.5 * isogi_dvr__steepness(s->walk.m, local);
    }
    sum *= p->to - p->from;
    if (s->silhouette != ISOGI_DVR_SILHOUETTE_APPROXIMATE) s->path = sum;
    return sum > change ? change > 0 && sum < 1e300 * change ? sum / change : 1e300 : 1;
}

/* Light is looked up once for a piece, at its middle. */
static void isogi_dvr__span_light(const isogi_dvr__pixel_ray *r, isogi_dvr__span *s, double opacity) {
    const isogi_dvr__stretch *p = &s->piece;
    double local[3], t = p->t0 + 0.5 * (p->u0 + p->u1) * p->dt;
    int side = p->value[1] > p->value[0] ? 1 : p->value[1] < p->value[0] ? -1 : 0, cell[3], a;
    for (a = 0; a < 3; a++) s->light[a] = 1, s->add[a] = 0;
    s->lit = 1;
    if (r->dvr->desc.shading == ISOGI_DVR_UNLIT) return;
    isogi_dvr__span_place(s, 0.5 * (p->u0 + p->u1), local);
    memcpy(cell, p->cell, sizeof cell);
    if (s->sampled) isogi_dvr__locate(s->walk.m, t, cell, local);
    if (r->dvr->desc.shading != ISOGI_DVR_TWO_SIDED) isogi_dvr__shade(r, cell, local, side, opacity, s->light);
    else isogi_dvr__shade_two_sided(r->dvr, r->lights, cell, local, r->dir, side, opacity, s->light, s->add);
}

/* Where within the part from value x to y the transmittance passes the probe's end. */
static double isogi_dvr__span_probe(const isogi_dvr__pixel_ray *r, const isogi_dvr__span *s, double x, double y, double clear) {
    const isogi_dvr__stretch *p = &s->piece;
    double depth = log(r->clear / r->end), whole = log(r->clear / clear), value;
    if (!(fabs(y - x) > 0)) return p->from + (p->to - p->from) * isogi_dvr__clamp(depth / whole, 1);
    if (s->sampled || s->silhouette == ISOGI_DVR_SILHOUETTE_APPROXIMATE) value = x + (y - x) * isogi_dvr__clamp(depth / whole, 1);
    else value = isogi_dvr__value_at_depth(&r->dvr->integral, x, y, s->factor, depth);
    return p->t0 + isogi_dvr__place_of(p, value) * p->dt;
}

static void isogi_dvr__composite_bounded(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, double x, double y);

/* The part of a piece from value x to y: the whole integral of Kraus 2005, eq. 2 and 3. */
static void isogi_dvr__composite_values(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, double x, double y) {
    const isogi_dvr__integral *g = &r->dvr->integral;
    double length = fabs(y - x), opacity, clear;
    isogi_dvr__layer layer = {{0, 0, 0}, 1};
    int a, approximate = s->silhouette == ISOGI_DVR_SILHOUETTE_APPROXIMATE;
    if (s->bounded) {
        isogi_dvr__composite_bounded(r, s, x, y);
        return;
    }
    if (!(length > 0)) length = s->piece.value[0] < s->piece.value[1] || s->piece.value[0] > s->piece.value[1] ? 0 : s->path;
    else if (!approximate) length *= s->factor;
    if (!(length > 0)) return;
    if (s->sampled) isogi_dvr__add_pair(g, x, y, length, &layer);
    else isogi_dvr__add_values(g, x, y, length, &layer);
    opacity = 1 - layer.clear;
    if (!(opacity > 0)) return;
    if (approximate) {
        double more = opacity * s->factor < 1 ? s->factor : 1 / opacity;
        for (a = 0; a < 3; a++) layer.rgb[a] *= more;
        opacity *= more, layer.clear = 1 - opacity;
    }
    clear = r->clear * layer.clear;
    if (r->probe && r->clear > r->end && clear <= r->end) r->t = isogi_dvr__span_probe(r, s, x, y, clear);
    if (!r->probe) {
        if (!s->lit) isogi_dvr__span_light(r, s, opacity);
        for (a = 0; a < 3; a++) r->rgb[a] += r->clear * (layer.rgb[a] * s->light[a] + opacity * s->add[a]);
    }
    r->clear = clear;
}

/* ---- physical space with a bound ---- */

/* Optical depth of the part u..end of a piece on which the transfer function is linear: extinction is then a cubic along the ray, which
   Gauss's rule with two points integrates exactly. */
static double isogi_dvr__bounded_depth(const isogi_dvr__span *s, const isogi_dvr__integral *g, size_t n, double u, double end) {
    const isogi_dvr__stretch *p = &s->piece;
    double low = p->value[0] < p->value[1] ? p->value[0] : p->value[1], high = p->value[0] < p->value[1] ? p->value[1] : p->value[0],
           sum = 0, node[4];
    int i;
    for (i = 0; i < 2; i++) {
        double value = isogi_dvr__bernstein(p->b, u + (i ? 0.78867513459481288225 : 0.21132486540518711775) * (end - u));
        value = value > low ? value : low;
        isogi_dvr__on_piece(g, n, value < high ? value : high, node);
        sum += 0.5 * node[3];
    }
    return isogi_dvr__clamp(sum * (end - u) * p->dt * s->walk.m->scale, 1e30);
}

/* A part so short that colours at its ends differ by less than the limit: opacity is exact, and the colour that arrives is a mean of
   colours between those. */
static void isogi_dvr__bounded_part(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, size_t n, const double value[2], double u, double end) {
    const isogi_dvr__integral *g = &r->dvr->integral;
    const isogi_dvr__march *m = s->walk.m;
    double depth = isogi_dvr__bounded_depth(s, g, n, u, end), opacity = -expm1(-depth), clear = r->clear * exp(-depth), from[4], to[4],
           share;
    isogi_dvr__layer layer = {{0, 0, 0}, 1};
    int a;
    if (!(depth > 0)) return;
    if (r->probe) {
        double low = u, high = end, sought = log(r->clear / r->end);
        for (a = 0; a < 50 && r->clear > r->end && clear <= r->end; a++) {
            double middle = 0.5 * (low + high);
            if (isogi_dvr__bounded_depth(s, g, n, u, middle) < sought) low = middle;
            else high = middle;
        }
        if (r->clear > r->end && clear <= r->end) r->t = s->piece.t0 + high * s->piece.dt;
        r->clear = clear;
        return;
    }
    isogi_dvr__on_piece(g, n, value[0], from), isogi_dvr__on_piece(g, n, value[1], to);
    isogi_dvr__add_linear(&layer, from, to, (end - u) * s->piece.dt * m->scale);
    share = layer.clear < 1 ? opacity / (1 - layer.clear) : 0; /* the field is no straight line, nor is its depth that of one */
    for (a = 0; a < 3; a++) layer.rgb[a] = layer.clear < 1 ? layer.rgb[a] * share : 0.5 * (from[a] + to[a]) * opacity;
    if (r->dvr->desc.shading == ISOGI_DVR_VISIBILITY) { /* lit once all of the piece is known */
        for (a = 0; a < 3; a++) s->unlit[a] += r->clear * layer.rgb[a];
        s->depth += depth, s->absorbing += end - u, r->clear = clear;
        return;
    }
    if (!s->lit) isogi_dvr__span_light(r, s, opacity);
    for (a = 0; a < 3; a++) r->rgb[a] += r->clear * (layer.rgb[a] * s->light[a] + opacity * s->add[a]);
    r->clear = clear;
}

/* Light of a piece whose parts are known: their number, and with it the extinction of the first, depends on the bound; the mean of all
   that absorbs, which says how far off light is looked up, does not, unless `opaque` ends the ray within. */
static void isogi_dvr__bounded_light(isogi_dvr__pixel_ray *r, isogi_dvr__span *s) {
    const double *dir = s->walk.m->dir, reach = isogi_dvr__reach_along(r->dvr, dir);
    double off = isogi_dvr__stand_off(reach, s->depth / (s->absorbing * s->piece.dt) * reach);
    int a;
    r->plain = 1 - isogi_dvr__by_openness(reach, off);
    off = isogi_dvr__clamp(off, 0.5 * (s->piece.from + s->piece.to));
    for (a = 0; a < 3; a++) r->front[a] = -off * dir[a];
    isogi_dvr__span_light(r, s, 0);
    r->plain = 0;
    for (a = 0; a < 3; a++) r->front[a] = 0, r->rgb[a] += s->unlit[a] * s->light[a];
}

static double isogi_dvr__bounded_place(const isogi_dvr__stretch *p, double value) {
    if (p->value[0] < p->value[1] ? value >= p->value[1] : value <= p->value[1]) return p->u1;
    if (p->value[0] < p->value[1] ? value <= p->value[0] : value >= p->value[0]) return p->u0;
    return isogi_dvr__place_of(p, value);
}

/* The part of a piece from value x to y: cut where the transfer function bends, and so that colours change by the limit at most. */
static void isogi_dvr__composite_bounded(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, double x, double y) {
    const isogi_dvr__integral *g = &r->dvr->integral;
    size_t n, last, k, parts;
    double u = y > x || y < x ? isogi_dvr__bounded_place(&s->piece, x) : s->piece.u0;
    if (!g->count) return;
    if (s->piece.value[0] < s->piece.value[1] || s->piece.value[0] > s->piece.value[1]) {
        if (!(x < y || y < x)) return; /* between two peaks of one value */
    }
    n = isogi_dvr__points_below(g->points, g->count, x), last = isogi_dvr__points_below(g->points, g->count, y);
    for (;; n += n < last ? 1 : (size_t)-1) {
        double to = n == last ? y : n < last ? g->points[n].value : g->points[n - 1].value, ends[2][4], change = 0;
        int a;
        isogi_dvr__on_piece(g, n, x, ends[0]), isogi_dvr__on_piece(g, n, to, ends[1]);
        for (a = 0; a < 3; a++) change = fabs(ends[1][a] - ends[0][a]) > change ? fabs(ends[1][a] - ends[0][a]) : change;
        parts = ends[0][3] > 0 || ends[1][3] > 0 ? 1 + (size_t)isogi_dvr__clamp(change / s->limit, 16384) : 0;
        for (k = 0; k < parts && r->clear > r->end; k++) {
            double share[2], value[2], end;
            share[0] = (double)k / (double)parts, share[1] = (double)(k + 1) / (double)parts;
            value[0] = (1 - share[0]) * x + share[0] * to, value[1] = k + 1 < parts ? (1 - share[1]) * x + share[1] * to : to;
            end = isogi_dvr__bounded_place(&s->piece, value[1]);
            if (end > u) isogi_dvr__bounded_part(r, s, n, value, u, end), u = end;
        }
        if (n == last || !(r->clear > r->end)) return;
        if (!parts) u = isogi_dvr__bounded_place(&s->piece, to);
        x = to;
    }
}

/* A peak in a tetrahedron: unlit. */
static void isogi_dvr__composite_facet(isogi_dvr__pixel_ray *r, const isogi_dvr__span *s, const isogi_peak *peak, double t) {
    double rgb[3], opacity = isogi_dvr__aslant_opacity(r->dvr->desc.silhouette, (double)peak->opacity, 1 / s->aslant);
    int a;
    for (a = 0; a < 3; a++) rgb[a] = (double)peak->rgb[a];
    isogi_dvr__composite(r, opacity, rgb);
    if (r->clear > r->end) r->t = t;
    r->clear *= 1 - opacity;
}

static void isogi_dvr__composite_rank(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, const isogi_dvr__rank *rank) {
    double u = isogi_dvr__place_of(&s->piece, rank->isovalue);
    isogi_hit hit;
    int a;
    if (s->flat) {
        isogi_dvr__composite_facet(r, s, &r->dvr->transfer.peaks[rank->peak], s->piece.t0 + u * s->piece.dt);
        return;
    }
    memset(&hit, 0, sizeof hit);
    isogi_dvr__span_place(s, u, hit.local);
    hit.side = s->piece.value[1] > s->piece.value[0] ? 1 : -1;
    for (a = 0; a < 3; a++) hit.cell[a] = (uint32_t)s->piece.cell[a];
    if (s->sampled) {
        int cell[3];
        isogi_dvr__locate(s->walk.m, s->piece.t0 + u * s->piece.dt, cell, hit.local);
        for (a = 0; a < 3; a++) hit.cell[a] = (uint32_t)cell[a];
    }
    isogi_dvr__composite_peak(r, &r->dvr->transfer.peaks[rank->peak], &hit, s->piece.t0 + u * s->piece.dt);
}

/* Peaks of one isovalue, in the order given: the ranks first .. end - 1. */
static void isogi_dvr__composite_ranks(isogi_dvr__pixel_ray *r, isogi_dvr__span *s, size_t first, size_t end) {
    for (; first < end && r->clear > r->end; first++) isogi_dvr__composite_rank(r, s, &r->dvr->integral.rank[first]);
}

/* A monotone piece, divided at the peaks that it crosses: those where "value >= isovalue" changes. */
static void isogi_dvr__divide_piece(isogi_dvr__pixel_ray *r, isogi_dvr__span *s) {
    const isogi_dvr__integral *g = &r->dvr->integral;
    double x = s->piece.value[0], y = s->piece.value[1];
    size_t i, end;
    if (x < y) {
        for (i = isogi_dvr__ranks_below(g, x); i < g->rank_count && g->rank[i].isovalue <= y && r->clear > r->end; i = end) {
            double isovalue = g->rank[i].isovalue;
            for (end = i + 1; end < g->rank_count && g->rank[end].isovalue <= isovalue;) end++;
            isogi_dvr__composite_values(r, s, x, isovalue);
            isogi_dvr__composite_ranks(r, s, i, end);
            x = s->touched = isovalue, s->touched_t = isovalue < y ? -1 : s->piece.to;
        }
    } else if (y < x) {
        for (end = isogi_dvr__ranks_below(g, x); end && g->rank[end - 1].isovalue > y && r->clear > r->end; end = i) {
            double isovalue = g->rank[end - 1].isovalue;
            for (i = end - 1; i && g->rank[i - 1].isovalue >= isovalue;) i--;
            isogi_dvr__composite_values(r, s, x, isovalue);
            if (isovalue < s->touched || isovalue > s->touched || s->piece.from > s->touched_t) isogi_dvr__composite_ranks(r, s, i, end);
            x = isovalue;
        }
    }
    if (r->clear > r->end) isogi_dvr__composite_values(r, s, x, y);
}

static void isogi_dvr__composite_piece(isogi_dvr__pixel_ray *r, isogi_dvr__span *s) {
    double x = s->piece.value[0], y = s->piece.value[1];
    /* along an isosurface silhouettes count, also of the value that a block just passed had throughout, which `quiet` may be */
    if ((x < y || y < x || s->silhouette == ISOGI_DVR_SILHOUETTE_NONE) &&
        isogi_dvr__is_quiet(&r->dvr->integral, x < y ? x : y, x < y ? y : x, s->walk.quiet)) return;
    s->lit = 0, s->factor = isogi_dvr__span_factor(s);
    s->unlit[0] = s->unlit[1] = s->unlit[2] = s->depth = s->absorbing = 0;
    isogi_dvr__divide_piece(r, s);
    if (s->depth > 0) isogi_dvr__bounded_light(r, s);
}

/* Whether pieces of rays count by the values at their ends alone, and may be joined as long as the value goes one way. */
static int isogi_dvr__joined(const isogi_dvr *d) {
    return d->desc.space == ISOGI_DVR_DATA && d->desc.classification == ISOGI_DVR_EXACT && d->desc.shading == ISOGI_DVR_UNLIT &&
           d->desc.silhouette == ISOGI_DVR_SILHOUETTE_NONE && !d->transfer.peak_count;
}

/* Light that arrives so far, and the values between which the ray has gone one way since, without a gap: a ray that has its opacity ends
   with such a run. */
typedef struct isogi_dvr__run { isogi_dvr__layer layer; double from, to; } isogi_dvr__run;

#define ISOGI_DVR__ROUNDING 1e-14
/* The ray goes on to a value. It turns where it goes back by more than a rounding of such values, so that all paths turn at the same
   place, unless corners of a cell are far larger than what lies between them. */
static void isogi_dvr__run_to(const isogi_dvr__integral *g, isogi_dvr__run *run, double value) {
    const int up = run->from < run->to, down = run->from > run->to;
    const double turn = ISOGI_DVR__ROUNDING * (fabs(run->to) + g->bias);
    if (up ? value < run->to - turn : down && value > run->to + turn) {
        isogi_dvr__add_values(g, run->from, run->to, fabs(run->to - run->from), &run->layer);
        run->from = run->to;
    } else if (up ? value < run->to : down && value > run->to) return;
    run->to = value;
}

static void isogi_dvr__end_run(const isogi_dvr__integral *g, isogi_dvr__run *run) {
    if (run->from < run->to || run->to < run->from) isogi_dvr__add_values(g, run->from, run->to, fabs(run->to - run->from), &run->layer);
    run->from = run->to;
}

static void isogi_dvr__cast_joined(isogi_dvr__pixel_ray *r, isogi_dvr__march *m) {
    const isogi_dvr__integral *g = &r->dvr->integral;
    isogi_dvr__walk w;
    isogi_dvr__stretch p;
    isogi_dvr__run run;
    memset(&run, 0, sizeof run);
    run.layer.clear = 1;
    isogi_dvr__begin_walk(&w, m);
    while (run.layer.clear > r->end && isogi_dvr__next_monotone(&w, &p)) {
        if (w.gap && w.piece == 1) isogi_dvr__end_run(g, &run), run.from = run.to = p.value[0];
        isogi_dvr__run_to(g, &run, p.value[1]);
    }
    if (run.layer.clear > r->end) isogi_dvr__end_run(g, &run);
    memcpy(r->rgb, run.layer.rgb, sizeof r->rgb), r->clear = run.layer.clear;
}

#ifdef ISOGI_DVR__AVX
/* ---- eight rays at once ---- */

/* Rays whose pieces are joined, side by side, in doubles: each goes its own way through the cells as isogi_dvr__walk does. Places are mixed
   in another order than there, to a rounding. */
typedef struct isogi_dvr__eight {
    double origin[3][8], dir[3][8], inverse[3][8], length[8]; /* of marches; inverse: 0 where there is no movement along an axis */
    double at[3][8];                                          /* where they are, in `cell` */
    int32_t cell[3][8];
    double from[8], to[8]; /* as isogi_dvr__run */
    isogi_dvr__layer layer[8];
    unsigned going;        /* a bit for each ray that is not yet done */
    double end;            /* transmittance at which they are */
} isogi_dvr__eight;

static void isogi_dvr__begin_eight(isogi_dvr__eight *e, int k, isogi_dvr__march *m) {
    isogi_dvr__walk w;
    int a;
    isogi_dvr__begin_walk(&w, m);
    for (a = 0; a < 3; a++) {
        e->origin[a][k] = m->origin[a], e->dir[a][k] = m->dir[a], e->inverse[a][k] = w.inverse[a];
        e->at[a][k] = w.at[a], e->cell[a][k] = w.cell[a];
    }
    e->length[k] = m->length, e->layer[k].clear = 1, e->going |= 1u << k;
}

#ifndef __clang__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized" /* gcc 12 says so of its own undefined vectors */
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wsign-conversion" /* and of masks in its own macros, at -O0 */
#endif
#define ISOGI_DVR__AVX512 __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,fma"))) static
/* Corners x + 2y + 4z of cells; kind and last_word: of isogi_dvr__sample_kind. */
ISOGI_DVR__AVX512 inline void isogi_dvr__corners_eight(const isogi_volume *v, const __m256i cell[3], __mmask8 lanes, int kind,
                                                       uint32_t last_word, __m512d c[8]) {
    const __m512d scale = _mm512_set1_pd(v->scale), bias = _mm512_set1_pd(v->bias);
    const __m256i mask = _mm256_set1_epi32(kind == 1 ? 0xff : 0xffff);
    __m256i offset = _mm256_setzero_si256();
    int a, k;
    for (a = 0; a < 3; a++) offset = _mm256_add_epi32(offset, _mm256_mullo_epi32(cell[a], _mm256_set1_epi32((int)v->stride[a])));
    for (k = 0; k < 4; k++) {
        __m256i at = _mm256_add_epi32(offset, _mm256_set1_epi32((int)((k & 1 ? v->stride[1] : 0) + (k & 2 ? v->stride[2] : 0))));
        __m512d x0, x1;
        if (!kind) { /* two floats in one word of eight bytes */
            __m512i pair = _mm512_mask_i32gather_epi64(_mm512_setzero_si512(), lanes, at, (const long long *)v->data, 1);
            x0 = _mm512_cvtps_pd(_mm256_castsi256_ps(_mm512_cvtepi64_epi32(pair)));
            x1 = _mm512_cvtps_pd(_mm256_castsi256_ps(_mm512_cvtepi64_epi32(_mm512_srli_epi64(pair, 32))));
        } else { /* two voxels in one word, which must not reach beyond the data */
            __m256i word = _mm256_min_epi32(at, _mm256_set1_epi32((int)last_word)),
                    shift = _mm256_slli_epi32(_mm256_sub_epi32(at, word), 3);
            word = _mm256_srlv_epi32(_mm256_mmask_i32gather_epi32(word, lanes, word, (const int *)v->data, 1), shift);
            x0 = _mm512_cvtepi32_pd(_mm256_and_si256(word, mask));
            x1 = _mm512_cvtepi32_pd(_mm256_and_si256(_mm256_srli_epi32(word, kind == 1 ? 8 : 16), mask));
        }
        c[2 * k] = _mm512_fmadd_pd(scale, x0, bias), c[2 * k + 1] = _mm512_fmadd_pd(scale, x1, bias);
    }
}

ISOGI_DVR__AVX512 inline __m512d isogi_dvr__mix_eight(__m512d from, __m512d to, __m512d u) {
    return _mm512_fmadd_pd(u, _mm512_sub_pd(to, from), from);
}

/* As isogi_dvr__cubic. */
ISOGI_DVR__AVX512 inline void isogi_dvr__cubic_eight(const __m512d c[8], const __m512d in[3], const __m512d out[3], __m512d b[4]) {
    const __m512d third = _mm512_set1_pd(1 / 3.0);
    __m512d x[2][4], y[2][2][2], z[2][2][2];
    int i, j, k, n;
    for (i = 0; i < 4; i++)
        x[0][i] = isogi_dvr__mix_eight(c[2 * i], c[2 * i + 1], in[0]), x[1][i] = isogi_dvr__mix_eight(c[2 * i], c[2 * i + 1], out[0]);
    for (i = 0; i < 2; i++)
        for (n = 0; n < 2; n++)
            for (k = 0; k < 2; k++) y[i][n][k] = isogi_dvr__mix_eight(x[i][2 * k], x[i][2 * k + 1], n ? out[1] : in[1]);
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++)
            for (n = 0; n < 2; n++) z[i][j][n] = isogi_dvr__mix_eight(y[i][j][0], y[i][j][1], n ? out[2] : in[2]);
    b[0] = z[0][0][0], b[3] = z[1][1][1];
    b[1] = _mm512_mul_pd(third, _mm512_add_pd(_mm512_add_pd(z[1][0][0], z[0][1][0]), z[0][0][1]));
    b[2] = _mm512_mul_pd(third, _mm512_add_pd(_mm512_add_pd(z[1][1][0], z[1][0][1]), z[0][1][1]));
}

/* Lanes in which all values low .. high are quiet; where there are many ranges, only the outermost are looked at: a cell within another one
   adds nothing, but is no gap at which a run ends. */
ISOGI_DVR__AVX512 inline __mmask8 isogi_dvr__quiet_eight(const isogi_dvr__integral *g, __m512d low, __m512d high) {
    size_t i, step = g->quiet_count > 6 ? g->quiet_count - 1 : 1;
    __mmask8 quiet = 0;
    for (i = 0; i < g->quiet_count; i += step) {
        __mmask8 above = _mm512_cmp_pd_mask(low, _mm512_set1_pd(g->quiet[i][0]), _CMP_GE_OQ);
        quiet = (__mmask8)(quiet | _mm512_mask_cmp_pd_mask(above, high, _mm512_set1_pd(g->quiet[i][1]), _CMP_LE_OQ));
    }
    return quiet;
}

/* As isogi_dvr__run_to, for some lanes; those that begin anew do so here. */
ISOGI_DVR__AVX512 inline void isogi_dvr__run_eight(const isogi_dvr__integral *g, isogi_dvr__eight *e, __mmask8 lanes, __mmask8 begins,
                                                   __m512d value) {
    __m512d from = _mm512_loadu_pd(e->from), to = _mm512_loadu_pd(e->to);
    __mmask8 up = _mm512_cmp_pd_mask(from, to, _CMP_LT_OQ), down = _mm512_cmp_pd_mask(from, to, _CMP_GT_OQ);
    const __m512d turn = _mm512_mul_pd(_mm512_set1_pd(ISOGI_DVR__ROUNDING), _mm512_add_pd(_mm512_abs_pd(to), _mm512_set1_pd(g->bias)));
    __mmask8 back = (up & _mm512_cmp_pd_mask(value, to, _CMP_LT_OQ)) | (down & _mm512_cmp_pd_mask(value, to, _CMP_GT_OQ));
    __mmask8 turns = ((up | down) & begins) | (up & _mm512_cmp_pd_mask(value, _mm512_sub_pd(to, turn), _CMP_LT_OQ)) |
                     (down & _mm512_cmp_pd_mask(value, _mm512_add_pd(to, turn), _CMP_GT_OQ));
    unsigned bits = turns & lanes;
    _mm512_mask_storeu_pd(e->to, (__mmask8)(lanes & (turns | ~back)), value);
    _mm512_mask_storeu_pd(e->from, (__mmask8)bits, to);
    _mm512_mask_storeu_pd(e->from, begins, value);
    bits &= e->going & (unsigned)~isogi_dvr__quiet_eight(g, _mm512_min_pd(from, to), _mm512_max_pd(from, to));
    for (; bits; bits &= bits - 1) {
        int k = __builtin_ctz(bits);
        double ends[2][8];
        _mm512_storeu_pd(ends[0], from), _mm512_storeu_pd(ends[1], to);
        isogi_dvr__add_values(g, ends[0][k], ends[1][k], fabs(ends[1][k] - ends[0][k]), &e->layer[k]);
        if (!(e->layer[k].clear > e->end)) e->going &= ~(1u << k);
    }
}

/* Values along cells that count: as isogi_dvr__cut_cell. */
ISOGI_DVR__AVX512 inline void isogi_dvr__cut_eight(const isogi_dvr__integral *g, isogi_dvr__eight *e, __mmask8 lanes, __mmask8 begins,
                                                   const __m512d c[8], const __m512d in[3], const __m512d out[3], __m512d low,
                                                   __m512d high) {
    const __m512d zero = _mm512_setzero_pd();
    __m512d b[4], d[3];
    __mmask8 up = lanes, down = lanes;
    unsigned bits;
    int i;
    isogi_dvr__cubic_eight(c, in, out, b);
    if (lanes & begins) isogi_dvr__run_eight(g, e, lanes & begins, lanes & begins, b[0]);
    for (i = 0; i < 3; i++) {
        d[i] = _mm512_sub_pd(b[i + 1], b[i]);
        up = _mm512_mask_cmp_pd_mask(up, d[i], zero, _CMP_GE_OQ), down = _mm512_mask_cmp_pd_mask(down, d[i], zero, _CMP_LE_OQ);
    }
    for (bits = lanes & (unsigned)~(up | down); bits; bits &= bits - 1) {
        double at[4][8], own[4], u[2], bounds[2][8];
        isogi_dvr__run run;
        int k = __builtin_ctz(bits), extrema;
        for (i = 0; i < 4; i++) _mm512_storeu_pd(at[i], b[i]), own[i] = at[i][k];
        _mm512_storeu_pd(bounds[0], low), _mm512_storeu_pd(bounds[1], high);
        extrema = isogi_dvr__extrema(own, u);
        run.layer = e->layer[k], run.from = e->from[k], run.to = e->to[k];
        for (i = 0; i < extrema && run.layer.clear > e->end; i++) {
            double value = isogi_dvr__bernstein(own, u[i]);
            value = value > bounds[0][k] ? value : bounds[0][k];
            isogi_dvr__run_to(g, &run, value < bounds[1][k] ? value : bounds[1][k]);
        }
        if (!(run.layer.clear > e->end)) e->going &= ~(1u << k);
        e->layer[k] = run.layer, e->from[k] = run.from, e->to[k] = run.to;
    }
    isogi_dvr__run_eight(g, e, lanes, 0, _mm512_min_pd(_mm512_max_pd(b[3], low), high));
}

/* Front to back, until all rays are done. Each time around rays in empty blocks go on to the next block, others to the next cell: these
   wait while those are many, as a cell costs more. */
ISOGI_DVR__AVX512 void isogi_dvr__cast_eight(const isogi_dvr *d, int kind, uint32_t last_word, isogi_dvr__eight *e, isogi_counters *work) {
    const isogi_dvr__integral *g = &d->integral;
    const __m512d length = _mm512_loadu_pd(e->length), zero = _mm512_setzero_pd(), one = _mm512_set1_pd(1);
    const __m256i ones = _mm256_set1_epi32(1), none = _mm256_setzero_si256();
    __m512d t = zero, at[3], origin[3], dir[3], inverse[3];
    __m256i cell[3];
    __mmask8 ahead[3], moves[3], begins = 0xff; /* begins: after a gap, too */
    int a, k;
    for (a = 0; a < 3; a++) {
        at[a] = _mm512_loadu_pd(e->at[a]), origin[a] = _mm512_loadu_pd(e->origin[a]), dir[a] = _mm512_loadu_pd(e->dir[a]);
        inverse[a] = _mm512_loadu_pd(e->inverse[a]), cell[a] = _mm256_loadu_si256((const __m256i *)(const void *)e->cell[a]);
        ahead[a] = _mm512_cmp_pd_mask(dir[a], zero, _CMP_GT_OQ), moves[a] = _mm512_cmp_pd_mask(inverse[a], zero, _CMP_NEQ_OQ);
    }
    while (e->going) {
        __m512d leave = _mm512_set1_pd(1e300), next[3], t1, out[3], then[3], c[8], low, high, sum;
        __m256i block = none, shift, first[3], to[3];
        __mmask8 going = (__mmask8)e->going, empty, past = 0, cells, quiet, hollow;
        for (a = 3; a-- > 0;)
            block = _mm256_add_epi32(_mm256_mullo_epi32(block, _mm256_set1_epi32((int)d->level[0].size[a])), _mm256_srli_epi32(cell[a], 2));
        block = _mm256_mmask_i32gather_epi32(none, going, block, (const int *)(const void *)d->empty[0], 1);
        shift = _mm256_slli_epi32(_mm256_and_si256(block, _mm256_set1_epi32(3)), 1);
        empty = _mm256_mask_test_epi32_mask(going, shift, shift);
        work->blocks += (uint64_t)__builtin_popcount(going), work->blocks_skipped += (uint64_t)__builtin_popcount(empty);
        if (__builtin_popcount(empty) > 3) going = empty;
        for (a = 0; a < 3; a++) {
            __m256i border;
            first[a] = _mm256_sllv_epi32(_mm256_srlv_epi32(cell[a], shift), shift);
            border = _mm256_mask_add_epi32(first[a], ahead[a], first[a], _mm256_sllv_epi32(ones, shift));
            next[a] = _mm512_mask_mul_pd(leave, moves[a], _mm512_sub_pd(_mm512_cvtepi32_pd(border), origin[a]), inverse[a]);
        }
        leave = _mm512_min_pd(_mm512_min_pd(next[0], next[1]), next[2]);
        t1 = _mm512_max_pd(t, _mm512_min_pd(leave, length));
        for (a = 0; a < 3; a++) {
            const __m256i last = _mm256_set1_epi32(d->cells[a] - 1);
            __mmask8 through = _mm512_cmp_pd_mask(next[a], leave, _CMP_LE_OQ) & _mm512_cmp_pd_mask(next[a], t1, _CMP_LE_OQ);
            __m512d x = _mm512_min_pd(_mm512_max_pd(_mm512_fmadd_pd(t1, dir[a], origin[a]), zero), _mm512_set1_pd(d->cells[a]));
            __m256i beyond = _mm256_add_epi32(first[a], _mm256_sllv_epi32(ones, shift));
            to[a] = _mm512_cvttpd_epi32(x);
            to[a] = _mm256_mask_max_epi32(_mm256_min_epi32(to[a], cell[a]), ahead[a], to[a], cell[a]);
            to[a] = _mm256_max_epi32(_mm256_min_epi32(to[a], _mm256_min_epi32(_mm256_sub_epi32(beyond, ones), last)), first[a]);
            out[a] = _mm512_min_pd(_mm512_max_pd(_mm512_sub_pd(x, _mm512_cvtepi32_pd(to[a])), zero), one);
            then[a] = _mm512_mask_blend_pd(through, out[a], _mm512_maskz_mov_pd((__mmask8)~ahead[a], one));
            out[a] = _mm512_mask_blend_pd(through, out[a], _mm512_maskz_mov_pd(ahead[a], one));
            to[a] = _mm256_mask_sub_epi32(to[a], through, first[a], ones), to[a] = _mm256_mask_mov_epi32(to[a], through & ahead[a], beyond);
            past = (__mmask8)(past | _mm256_cmplt_epi32_mask(to[a], none) | _mm256_cmpgt_epi32_mask(to[a], last));
        }
        begins |= empty;
        cells = _mm512_mask_cmp_pd_mask(going & (__mmask8)~empty, t1, t, _CMP_GT_OQ);
        if (cells) {
            isogi_dvr__corners_eight(&d->volume, cell, cells, kind, last_word, c);
            for (k = 1, low = high = sum = c[0]; k < 8; k++)
                low = _mm512_min_pd(low, c[k]), high = _mm512_max_pd(high, c[k]), sum = _mm512_add_pd(sum, c[k]);
            hollow = cells & (__mmask8)~_mm512_cmp_pd_mask(_mm512_abs_pd(sum), _mm512_set1_pd(1e300), _CMP_LE_OQ);
            quiet = cells & (hollow | isogi_dvr__quiet_eight(g, low, high));
            work->cells += (uint64_t)__builtin_popcount(cells);
            cells &= (__mmask8)~quiet, begins |= quiet;
            work->cubics += (uint64_t)__builtin_popcount(cells), work->samples += (uint64_t)__builtin_popcount(cells);
            if (cells) isogi_dvr__cut_eight(g, e, cells, begins, c, at, out, low, high);
            begins &= (__mmask8)~cells;
        }
        t = _mm512_mask_mov_pd(t, going, t1);
        for (a = 0; a < 3; a++) at[a] = _mm512_mask_mov_pd(at[a], going, then[a]), cell[a] = _mm256_mask_mov_epi32(cell[a], going, to[a]);
        e->going &= (unsigned)~(going & (past | _mm512_cmp_pd_mask(t, length, _CMP_GE_OQ)));
    }
    for (k = 0; k < 8; k++) {
        double from = e->from[k], last = e->to[k];
        if ((from < last || last < from) && e->layer[k].clear > e->end)
            isogi_dvr__add_values(g, from, last, fabs(last - from), &e->layer[k]);
    }
}
#undef ISOGI_DVR__AVX512
#ifndef __clang__
#pragma GCC diagnostic pop
#endif
#endif

static void isogi_dvr__cast_values(isogi_dvr__pixel_ray *r, isogi_dvr__march *m) {
    isogi_dvr__span s;
    if (r->dvr->transparent) return;
    if (!r->probe && isogi_dvr__joined(r->dvr)) {
        isogi_dvr__cast_joined(r, m);
        return;
    }
    isogi_dvr__begin_walk(&s.walk, m);
    s.sampled = r->dvr->desc.classification == ISOGI_DVR_PRE_INTEGRATED, s.touched = 0, s.touched_t = -1;
    s.bounded = isogi_dvr__bounded(r->dvr), s.limit = r->dvr->limit;
    if (s.bounded) s.sampled = 0;
    s.silhouette = s.bounded ? ISOGI_DVR_SILHOUETTE_NONE : m->silhouette, s.flat = 0, s.aslant = 1;
    while (r->clear > r->end && (s.sampled ? isogi_dvr__next_sampled(&s.walk, &s.piece) : isogi_dvr__next_monotone(&s.walk, &s.piece)))
        isogi_dvr__composite_piece(r, &s);
}

/* ---- samples and crossings ---- */

/* Front to back (Kraus 2005, eq. 5): every crossing in its place, dividing the sample's piece in which it lies. */
static void isogi_dvr__cast(isogi_dvr__pixel_ray *r, isogi_dvr__march *m, isogi_dvr__crossings *c) {
    isogi_dvr__sample s;
    size_t i;
    int a;
    if (isogi_dvr__by_piece(r->dvr)) {
        isogi_dvr__cast_values(r, m);
        return;
    }
    while (r->clear > r->end && isogi_dvr__next(m, &s)) {
        double rgb[3] = {0, 0, 0};
        while (r->clear > r->end && (i = isogi_dvr__first_crossing(c, s.from)) < c->count) isogi_dvr__composite_crossing(r, c, i);
        if (!(r->clear > r->end)) break;
        if (!r->probe) {
            isogi_dvr__colour(r->dvr->transfer.points, r->dvr->transfer.point_count, s.value, rgb);
            if (r->dvr->desc.space == ISOGI_DVR_PHYSICAL && r->dvr->desc.shading == ISOGI_DVR_VISIBILITY) {
                double reach = isogi_dvr__reach_along(r->dvr, m->dir), off = isogi_dvr__stand_off(reach, s.depth / (s.to - s.from) * reach);
                r->plain = 1 - isogi_dvr__by_openness(reach, off);
                off = isogi_dvr__clamp(off, 0.5 * (s.from + s.to)); /* not before the ray begins */
                for (a = 0; a < 3; a++) r->front[a] = -off * m->dir[a];
            }
            isogi_dvr__shade(r, s.cell, s.local, s.side, -expm1(-s.depth), rgb);
            r->plain = 0;
            for (a = 0; a < 3; a++) r->front[a] = 0;
        }
        {
            double from = s.from;
            while (r->clear > r->end && (i = isogi_dvr__first_crossing(c, s.to)) < c->count) {
                isogi_dvr__composite_part(r, &s, from, c->t[i], rgb);
                from = c->t[i];
                if (r->clear > r->end) isogi_dvr__composite_crossing(r, c, i);
            }
            if (r->clear > r->end) isogi_dvr__composite_part(r, &s, from, s.to, rgb);
        }
    }
    while (r->clear > r->end && (i = isogi_dvr__first_crossing(c, 1e300)) < c->count) isogi_dvr__composite_crossing(r, c, i);
}

/* ==== frames of physical space ======================================================================================= */

/* Rays in physical space without peaks run on a path of their own. Between samples a voxel apart the field is taken as linear, and what
   the transfer function holds between the two values is integrated exactly (pre-integration), which in physical space needs one table
   of four running integrals over the value: of extinction, and of extinction times colour. Of a piece from value a to b
       mean extinction (K(b) - K(a)) / (b - a),   colour (C(b) - C(a)) / (K(b) - K(a)),   opacity 1 - exp(-mean * length)
   (Kraus 2005, eq. 6, 7 with the attenuation within a piece left to its opacity). Empty space is leapt over by the distance to the
   nearest block that is not empty. Light is linear between grid points, so that L . V is summed at the grid points, once for a
   picture, and looked up as a colour once for each piece. */
typedef struct isogi_dvr__class_entry {
    int32_t before[4];      /* integrals up to a class, rgb and extinction: so many quanta, whose differences lose no digits, */
    float rest[4], mean[4]; /* and what remains, below a quantum; integrals over it */
} isogi_dvr__class_entry;

typedef struct isogi_dvr__matter_entry {
    int32_t before;
    float rest, mean, none;
} isogi_dvr__matter_entry;

struct isogi_dvr__frame {
    const isogi_dvr *dvr;
    isogi_dvr__class_entry *classes;
    float (*light)[4];  /* at grid points: scattered radiance of albedo 1, openness; NULL = unlit */
    float (*open)[4];   /* that radiance times openness; NULL where no matter is dense enough for it to matter */
    const isogi_dvr__lights *lamps; /* those whose light depends on the place, and is added at every piece; NULL = none */
    float light_scale[4]; /* grid points of light to a voxel */
    int32_t light_last[4]; /* cell of the grid */
    size_t light_stride[3], light_row[2]; /* floats to the neighbours (0 where there is one point); rows, planes */
    isogi_dvr__held held; /* where light stands, if held.block */
    size_t count;       /* of classes */
    float scale;        /* of them to a unit of values; a value's place among them goes on before the first and beyond the last,
                           both of one extinction and colour */
    float top;          /* of the last class */
    float quantum[4];   /* of their integrals */
    isogi_dvr__matter_entry *matter;  /* of the same classes, extinction alone */
    float cells[3], value_scale, value_bias; /* of voxels' values, less that where the first class begins */
    int32_t last_cell[3], stride[3];  /* bytes */
    double step;        /* voxels between samples */
    double per_piece, per_unit; /* pieces, and units of extinction, to a world length */
    float piece;        /* as isogi_dvr__fast_ray.piece */
    float end, dim;     /* transmittance at which a ray ends; at which its samples stand twice as far apart */
    int (*leap)(const isogi_dvr *d, isogi_dvr__packet *p, isogi_counters *work);
    float tolerance;    /* change of extinction times length, and of what is seen of it, from which on a piece is divided */
    float glow;         /* share of the colour that is emitted */
    void (*look)(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run, const uint8_t *ray, int count);
    void (*shade)(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_state *s, const isogi_dvr__fast_run *run,
                  isogi_counters *work);
    int eight;          /* rays begin eight at once */
    int sample_kind;    /* of isogi_dvr__sample_kind */
    uint32_t last_word; /* of the same */
};

/* Whether any peak lies within the range of values. */
static int isogi_dvr__any_peak(const isogi_dvr *d) {
    size_t i;
    for (i = 0; i < d->transfer.peak_count; i++)
        if (d->transfer.peaks[i].isovalue >= d->range[0] && d->transfer.peaks[i].isovalue <= d->range[1]) return 1;
    return 0;
}

static int isogi_dvr__fast_space(const isogi_dvr *d) {
    return d->desc.space == ISOGI_DVR_PHYSICAL && !isogi_dvr__bounded(d) && d->desc.classification != ISOGI_DVR_POST_CLASSIFIED &&
           !isogi_dvr__any_peak(d) && !d->desc.jitter && (d->desc.shading == ISOGI_DVR_UNLIT || d->desc.shading == ISOGI_DVR_VISIBILITY) &&
           !(fabs(d->desc.anisotropy) > 0) && d->cells[0] && d->cells[1] && d->cells[2];
}

/* Four classes at least to the narrowest piece of the transfer function, as far as their number allows. */
static size_t isogi_dvr__count_classes(const isogi_dvr *d, double *low, double *scale) {
    const isogi_dvr__transfer *t = &d->transfer;
    double span[2], narrow = 1e300;
    size_t i, count;
    isogi_dvr__transfer_span(t, span);
    for (i = 1; i < t->point_count; i++) {
        double width = t->points[i].value - t->points[i - 1].value;
        if (width > 0 && width < narrow && !isogi_dvr__alike(&t->points[i], &t->points[i - 1])) narrow = width;
    }
    for (count = ISOGI_DVR__CLASSES;; count *= 2) {
        isogi_dvr__set_classes(d, t, span, count, low, scale);
        if (count == 16 * ISOGI_DVR__CLASSES || narrow * *scale >= 4) return count;
    }
}

/* Whether floats hold classes, their light and voxels, and tell values of the classes' span apart, if there are any to be told. Integers
   are floats as they are; what they count from is taken off with their bias, in double. */
#define ISOGI_DVR__TOLD_APART 4096
static int isogi_dvr__floats_tell(const isogi_dvr *d, double low, double scale, double span) {
    const isogi_volume *v = &d->volume;
    const isogi_dvr__transfer *t = &d->transfer;
    double from = fabs(low - v->bias), to = fabs(low + span - v->bias), extinction = 0, colour = 0;
    size_t i;
    int a;
    for (i = 0; i < t->point_count; i++) {
        extinction = fmax(extinction, (double)t->points[i].extinction);
        for (a = 0; a < 3; a++) colour = fmax(colour, (double)t->points[i].rgb[a]);
    }
    if (fmin(extinction, 1e30) * colour > 1e32) return 0;
    if (!isogi_dvr__float_classes(d, scale) || !(fabs(v->scale) > 1e-30 && fabs(v->scale) < 1e30 && from < 1e37 && to < 1e37)) return 0;
    if (!(fabs((d->range[0] - v->bias) / v->scale) <= ISOGI_DVR__FLOATS)) return 0;
    if (!(fabs((d->range[1] - v->bias) / v->scale) <= ISOGI_DVR__FLOATS)) return 0;
    if (!((0.5 * d->range[1] - 0.5 * d->range[0]) / fabs(v->scale) <= 0.4999999 * ISOGI_DVR__FLOATS)) return 0; /* nor differences */
    return (v->type != ISOGI_F32 && v->type != ISOGI_F64) || !(d->range[0] < d->range[1]) ||
           ISOGI_DVR__TOLD_APART * span >= (from > to ? from : to);
}

/* Integrals up to each class. */
static void isogi_dvr__sum_classes(isogi_dvr__frame *f) {
    size_t i;
    int a;
    for (a = 0; a < 4; a++) {
        double sum = 0, quanta;
        for (i = 0; i < f->count; i++) sum += (double)f->classes[i].mean[a];
        f->quantum[a] = (float)(sum / 1073741824);
        for (i = 0, sum = 0; i < f->count; sum += (double)f->classes[i].mean[a], i++) {
            quanta = f->quantum[a] > 0 ? sum / (double)f->quantum[a] : 0;
            f->classes[i].before[a] = (int32_t)isogi_dvr__clamp(quanta, 2e9);
            f->classes[i].rest[a] = (float)(sum - f->classes[i].before[a] * (double)f->quantum[a]);
        }
    }
}

/* The mean over a range of values of extinction times colour, and of extinction. */
static void isogi_dvr__mean_light(const isogi_dvr__transfer *t, double from, double to, float out[4]) {
    double x = from, mean[4] = {0, 0, 0, 0};
    size_t next = t->point_count ? isogi_dvr__points_below(t->points, t->point_count, from) : 0;
    int a, half;
    while (t->point_count) { /* pieces between the function's points: the product of two linear functions, by Simpson's rule exactly */
        double end = next < t->point_count && t->points[next].value < to ? t->points[next].value : to,
               weight = to > from ? (end - x) / (to - from) : 1;
        for (half = 0; half < 3; half++) {
            double at = x + 0.5 * half * (end - x), rgb[3], extinction;
            if (half == 2 && end > x) { /* just below the end: the upper side of a step is not yet reached */
                at = x + 0.99999999 * (end - x);
            }
            extinction = isogi_dvr__extinction(t->points, t->point_count, at);
            isogi_dvr__colour(t->points, t->point_count, at, rgb);
            for (a = 0; a < 4; a++) mean[a] += weight * (half == 1 ? 4.0 : 1.0) / 6 * extinction * (a < 3 ? rgb[a] : 1);
        }
        if (!(end < to)) break;
        x = end, next++;
    }
    x = mean[3] > 1e30 ? 1e30 / mean[3] : 1; /* sums must stay floats, colours what they are */
    for (a = 0; a < 4; a++) out[a] = (float)isogi_dvr__clamp(mean[a] * x, 1e32);
}

static void isogi_dvr__frame_classes(isogi_dvr__frame *f, double low, double scale) {
    const isogi_dvr *d = f->dvr;
    size_t i, next = 0, classes[2];
    double ends[2], step;
    int a;
    for (i = 0; i < f->count; i++) {
        isogi_dvr__class_ends(d, low, scale, i, f->count, ends);
        isogi_dvr__mean_light(&d->transfer, ends[0], ends[1], f->classes[i].mean);
    }
    isogi_dvr__sum_classes(f);
    while (isogi_dvr__next_step(d, low, scale, f->count, &next, &step, classes))
        for (i = classes[1] + 1; i-- > classes[0];) { /* integrals from the step on stay what they were */
            isogi_dvr__class_entry *e = &f->classes[i];
            isogi_dvr__class_ends(d, low, scale, i, f->count, ends);
            isogi_dvr__mean_light(&d->transfer, step, ends[1] > step ? ends[1] : step, e->mean);
            for (a = 0; a < 4; a++)
                e->rest[a] = (float)(((double)e[1].before[a] - (double)e->before[a]) * (double)f->quantum[a] + (double)e[1].rest[a] -
                                     (double)e->mean[a]);
        }
    for (i = 0; i < f->count; i++) {
        const isogi_dvr__class_entry *e = &f->classes[i];
        f->matter[i].before = e->before[3], f->matter[i].rest = e->rest[3], f->matter[i].mean = e->mean[3], f->matter[i].none = 0;
    }
    f->scale = (float)scale, f->value_scale = (float)d->volume.scale, f->value_bias = (float)(d->volume.bias - low);
    if ((double)f->value_bias < d->volume.bias - low) /* the least value that occurs may stand on a step: on its upper side */
        f->value_bias = nextafterf(f->value_bias, 3e38f);
    f->top = (float)f->count - 0.01f;
}

/* out += factor * from, four numbers at once. */
static void isogi_dvr__add4(float *out, const float *from, float factor) {
#ifdef ISOGI_DVR__VECTORS
    ISOGI_DVR__4(out) += factor * ISOGI_DVR__C4(from);
#else
    int i;
    for (i = 0; i < 4; i++) out[i] += factor * from[i];
#endif
}

/* Radiance scattered at grid points: 1/(4 pi) L . V. */
typedef struct isogi_dvr__frame_job {
    isogi_dvr__frame frame;
    const isogi_dvr__lights *lights;
} isogi_dvr__frame_job;

static void isogi_dvr__frame_light(void *arg, size_t task) {
    isogi_dvr__frame_job *job = (isogi_dvr__frame_job *)arg;
    const isogi_dvr *d = job->frame.dvr;
    size_t points = isogi_dvr__held_points(d), point = task * ISOGI_DVR__GAIN,
           end = point + ISOGI_DVR__GAIN < points ? point + ISOGI_DVR__GAIN : points, c;
    float sh[ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER][4];
    memset(sh, 0, sizeof sh);
    for (c = 0; c < 3 * d->coefficients; c++) sh[c / 3][c % 3] = job->lights->sh[c] * (float)(1 / (4 * ISOGI_DVR__PI));
    for (; point < end; point++) {
        const float *v = d->visibility + point * d->coefficients;
        float sum[4] = {0, 0, 0, 0}, open = isogi_dvr__openness(v[0]);
        for (c = 0; c < d->coefficients; c++) isogi_dvr__add4(sum, sh[c], v[c]);
        for (c = 0; c < 3 && !job->frame.lamps; c++) { /* with lamps: once their light has been added, at pieces */
            float least = job->lights->least[c] * v[0];
            sum[c] = sum[c] > least ? sum[c] : least;
        }
        sum[3] = open;
        for (c = 0; c < 4; c++) job->frame.light[point][c] = sum[c];
        for (c = 0; c < 4 && job->frame.open; c++) job->frame.open[point][c] = sum[c] * open;
    }
}

/* out = from + u * (to - from), four numbers at once. */
static void isogi_dvr__mix4(float *out, const float *from, const float *to, float u) {
#ifdef ISOGI_DVR__VECTORS
    ISOGI_DVR__4(out) = ISOGI_DVR__C4(from) + u * (ISOGI_DVR__C4(to) - ISOGI_DVR__C4(from));
#else
    int i;
    for (i = 0; i < 4; i++) out[i] = from[i] + u * (to[i] - from[i]);
#endif
}

/* Some samples of a ray, the pieces between them that absorb, and how. */
struct isogi_dvr__fast_run {
    float first, stride;                      /* the first sample, and from one to the next, in samples of the ray */
    float length, last;                       /* of a piece and of the last one, as isogi_dvr__fast_ray.piece */
    float tolerance;                          /* change of depth across a piece from which on it is divided */
    int pieces;                               /* up to ISOGI_DVR__NODES - 1 */
    unsigned some;                            /* a bit for each piece that absorbs */
    float classes[ISOGI_DVR__NODES];          /* of samples: places among the frame's classes */
    float mean[ISOGI_DVR__NODES], depth[ISOGI_DVR__NODES], change[ISOGI_DVR__NODES]; /* of pieces: extinction, optical depth,
                                                                                        and its change across them */
};

/* What a ray has gathered. */
struct isogi_dvr__fast_state { float out[4], clear, depth, place; }; /* out[3]: opacity, while that is little; depth and place: of
                                                                        isogi_dvr__fast_probe */

/* Classes of a run's samples. */
static void isogi_dvr__fast_classes(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run) {
    const isogi_volume *v = &f->dvr->volume;
    int i, a, k;
    for (i = 0; i < ISOGI_DVR__NODES; i++) {
        const char *p = (const char *)v->data;
        float u[3], corner[8], value, at = run->first + run->stride * (float)i;
        at = at < r->end ? at : r->end;
        for (a = 0; a < 3; a++) {
            float x = r->origin[a] + at * r->dir[a];
            int c;
            x = x > 0 ? x : 0, x = x < (float)f->dvr->cells[a] ? x : (float)f->dvr->cells[a];
            c = (int)x, c = c < f->dvr->cells[a] ? c : f->dvr->cells[a] - 1;
            u[a] = x - (float)c, p += c * v->stride[a];
        }
        for (k = 0; k < 8; k++) {
            const char *q = p + (k & 1 ? v->stride[0] : 0) + (k & 2 ? v->stride[1] : 0) + (k & 4 ? v->stride[2] : 0);
            switch (v->type) {
            case ISOGI_U8: corner[k] = (float)*(const uint8_t *)(const void *)q; break;
            case ISOGI_I8: corner[k] = (float)*(const int8_t *)(const void *)q; break;
            case ISOGI_U16: corner[k] = (float)*(const uint16_t *)(const void *)q; break;
            case ISOGI_I16: corner[k] = (float)*(const int16_t *)(const void *)q; break;
            case ISOGI_F32: corner[k] = *(const float *)(const void *)q; break;
            case ISOGI_F64: corner[k] = (float)*(const double *)(const void *)q; break;
            }
        }
        for (k = 0; k < 4; k++) corner[k] = corner[2 * k] + u[0] * (corner[2 * k + 1] - corner[2 * k]);
        value = corner[0] + u[1] * (corner[1] - corner[0]);
        value += u[2] * (corner[2] + u[1] * (corner[3] - corner[2]) - value);
        if (!isogi_dvr__finite32(value)) {
            run->classes[i] = 1e30f; /* as AVX2 code: no piece */
            continue;
        }
        value = (value * f->value_scale + f->value_bias) * f->scale;
        value = value > -1e15f ? value : -1e15f;
        run->classes[i] = value < 1e15f ? value : 1e15f;
    }
}

/* The class of a place among them. */
static int isogi_dvr__fast_class(const isogi_dvr__frame *f, float at) {
    at = at > 0 ? at : 0;
    return (int)(at < f->top ? at : f->top);
}

/* Factors of before[] with rest[], and of mean[], of the two ends of a piece whose sum is what lies between them, over the difference of
   their places; within a class, and where places are so close that their own last digits show, the mean of both. */
#define ISOGI_DVR__CLOSE 0.125f /* classes */
static void isogi_dvr__fast_factors(const isogi_dvr__frame *f, float from, float to, const isogi_dvr__class_entry *e[2], float factor[3]) {
    float difference = to - from;
    int first = isogi_dvr__fast_class(f, from), last = isogi_dvr__fast_class(f, to);
    e[0] = &f->classes[first], e[1] = &f->classes[last];
    if (first == last || (difference < ISOGI_DVR__CLOSE && difference > -ISOGI_DVR__CLOSE)) factor[0] = 0, factor[1] = factor[2] = 0.5f;
    else factor[0] = 1 / difference, factor[1] = -(from - (float)first) * factor[0], factor[2] = (to - (float)last) * factor[0];
}

/* The mean between them of extinction (a = 3), or of it times colour. */
static float isogi_dvr__fast_mean(const isogi_dvr__frame *f, const isogi_dvr__class_entry *const e[2], const float factor[3], int a) {
    float between = (float)(e[1]->before[a] - e[0]->before[a]) * f->quantum[a] + (e[1]->rest[a] - e[0]->rest[a]);
    return between * factor[0] + e[0]->mean[a] * factor[1] + e[1]->mean[a] * factor[2];
}

/* Takes a run's samples, and looks up what lies between them. */
static void isogi_dvr__fast_look_one(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run) {
    int k;
    isogi_dvr__fast_classes(f, r, run);
    for (k = 0, run->some = 0; k < run->pieces; k++) {
        float from = run->classes[k], to = run->classes[k + 1], length = k + 1 < run->pieces ? run->length : run->last, factor[3], mean;
        const isogi_dvr__class_entry *e[2];
        if (from > 1e20f || to > 1e20f) continue;
        isogi_dvr__fast_factors(f, from, to, e, factor);
        mean = isogi_dvr__fast_mean(f, e, factor, 3);
        if (!(mean > 0)) continue;
        run->some |= 1u << k, run->mean[k] = mean;
        run->depth[k] = mean * length < 1e30f ? mean * length : 1e30f, run->change[k] = fabsf(e[1]->mean[3] - e[0]->mean[3]) * length;
    }
}

/* Of `count` rays, by their numbers. */
static void isogi_dvr__fast_look(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run, const uint8_t *ray,
                                 int count) {
    int i;
    for (i = 0; i < count; i++) isogi_dvr__fast_look_one(f, &r[ray[i]], &run[ray[i]]);
}

/* The eight points around a place: from the nearest row before it to those beside. */
typedef struct isogi_dvr__fast_cell { size_t at, to[2]; float u[3]; } isogi_dvr__fast_cell;
static void isogi_dvr__fast_between(const float *p, const isogi_dvr__fast_cell *cell, float out[4]) {
    float row[4][4];
    int a;
    for (a = 0; a < 4; a++) {
        const float *q = p + cell->at + (a & 1 ? cell->to[0] : 0) + (a & 2 ? cell->to[1] : 0);
        isogi_dvr__mix4(row[a], q, q + 4, cell->u[0]);
    }
    isogi_dvr__mix4(row[0], row[0], row[1], cell->u[1]), isogi_dvr__mix4(row[2], row[2], row[3], cell->u[1]);
    isogi_dvr__mix4(out, row[0], row[2], cell->u[2]);
}

/* Radiance of albedo 1 at a sample's place along the ray (four numbers, the last one means nothing). `open`: as
   isogi_dvr__by_openness says. */
static void isogi_dvr__fast_light(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, float at, float open, float out[4]) {
    isogi_dvr__fast_cell place;
    size_t cell[3], to[3];
    int a;
    place.at = 0;
    for (a = 0; a < 3; a++) {
        float x = (r->origin[a] + at * r->dir[a]) * f->light_scale[a];
        int c;
        x = x > 0 ? x : 0;
        c = (int)x, c = c < f->light_last[a] ? c : f->light_last[a];
        place.u[a] = x - (float)c, place.u[a] = place.u[a] < 1 ? place.u[a] : 1;
        cell[a] = (size_t)c, to[a] = f->light_stride[a];
    }
    if (!f->held.block)
        for (a = 0; a < 3; a++) place.at += (a ? f->light_row[a - 1] : 4) * cell[a];
    else {
        double within[3], u[3];
        for (a = 0; a < 3; a++) within[a] = (double)place.u[a];
        place.at = 4 * isogi_dvr__held_cell(&f->held, cell, within, to, u);
        for (a = 0; a < 3; a++) place.u[a] = (float)u[a], to[a] *= 4;
    }
    place.to[0] = to[1], place.to[1] = to[2];
    isogi_dvr__fast_between(f->light[0], &place, out);
    if (open > 0 && f->open) {
        float opened[4];
        isogi_dvr__fast_between(f->open[0], &place, opened);
        for (a = 0; a < 3; a++) out[a] = (out[a] + open * (opened[a] - out[a])) / (1 + open * (out[3] - 1));
    }
}

/* Where along the ray a piece is seen on average: its middle when it is clear, its beginning when it is dense. */
static float isogi_dvr__fast_middle(const isogi_dvr__fast_run *run, int k) {
    float half = k + 1 < run->pieces ? 0.5f : 0.5f * (run->last / run->length);
    return run->first + run->stride * ((float)k + half / (1 + run->depth[k] * (1.0f / 6)));
}

/* Where light is looked up for it: there, and off dense matter. */
static float isogi_dvr__fast_place(const isogi_dvr__fast_ray *r, const isogi_dvr__fast_run *run, int k, float *open) {
    float off = (float)isogi_dvr__stand_off((double)r->reach, (double)(run->mean[k] * (r->piece * r->reach)));
    *open = (float)isogi_dvr__by_openness((double)r->reach, (double)off);
    off = isogi_dvr__fast_middle(run, k) - off;
    return off > 0 ? off : 0;
}

/* Light of lamps at pieces of a run (a bit each), as isogi_dvr__shade_visibility has it: 1/(4 pi) L . V, and V(0) last. The directions of
   eight pieces go to isogi_sh_eval together, which is fastest so, and from order 3 on. */
static void isogi_dvr__fast_lamps(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, const isogi_dvr__fast_run *run, unsigned bits,
                                  float (*lamp)[4]) {
    enum { EIGHT = 8, MOST = ISOGI_DVR__MAX_ORDER * ISOGI_DVR__MAX_ORDER };
    const isogi_dvr *d = f->dvr;
    const int order = d->desc.order < 3 ? 3 : d->desc.order;
    const isogi_lighting *nearby = &f->lamps->nearby;
    float v[EIGHT][MOST], y[EIGHT * MOST], world[EIGHT][3], to[EIGHT][3], sh[3 * MOST];
    double factor[EIGHT];
    int piece[EIGHT], count = 0, k, a;
    size_t i, c;
    for (k = 0; k < run->pieces; k++) {
        double grid[3], place[3];
        float seen = isogi_dvr__fast_middle(run, k), open, at;
        if (!(bits >> k & 1)) continue;
        at = isogi_dvr__fast_place(r, run, k, &open);
        for (a = 0; a < 3; a++) {
            grid[a] = (double)(r->origin[a] + seen * r->dir[a]);
            place[a] = (double)(r->origin[a] + at * r->dir[a]);
        }
        isogi_dvr__visibility_at(d, place, (double)open, NULL, v[count]);
        isogi_vol_to_world(d->desc.pyramid, grid, place);
        for (a = 0; a < 3; a++) world[count][a] = (float)place[a], lamp[k][a] = 0;
        lamp[k][3] = v[count][0], piece[count++] = k;
    }
    for (i = 0; count && i < nearby->light_count; i++) {
        const isogi_light *light = &nearby->lights[i];
        for (k = 0; light->kind == ISOGI_LIGHT_POINT && k < EIGHT; k++) {
            double away[3], square, inverse;
            for (a = 0; a < 3; a++) away[a] = (double)light->vector[a] - (double)world[k < count ? k : 0][a];
            square = isogi_dvr__dot(away, away);
            factor[k] = square > 1e-30 ? 1 / (4 * ISOGI_DVR__PI * square) : 0;
            inverse = square > 1e-30 ? 1 / sqrt(square) : 0;
            for (a = 0; a < 3; a++) to[k][a] = square > 1e-30 ? (float)(away[a] * inverse) : (float)(a == 2);
        }
        if (light->kind == ISOGI_LIGHT_POINT && isogi_sh_eval(y, order, (const float(*)[3])to, EIGHT) != ISOGI_OK) continue;
        for (k = 0; k < count; k++) {
            float sum[3] = {0, 0, 0};
            if (light->kind == ISOGI_LIGHT_POINT) {
                for (c = 0; c < d->coefficients; c++) sum[0] += y[k * order * order + (int)c] * v[k][c];
                for (a = 2; a >= 0; a--) sum[a] = (float)((double)sum[0] * factor[k] * (double)light->rgb[a]);
            } else {
                isogi_lighting one;
                memset(&one, 0, sizeof one);
                one.lights = light, one.light_count = 1;
                if (isogi_sh_project(sh, d->desc.order, &one, world[k]) != ISOGI_OK) continue;
                for (c = 0; c < 3 * d->coefficients; c++) sum[c % 3] += sh[c] * v[k][c / 3] * (float)(1 / (4 * ISOGI_DVR__PI));
            }
            for (a = 0; a < 3; a++) {
                float light_here = lamp[piece[k]][a] + sum[a];
                lamp[piece[k]][a] = light_here < 1e30f ? light_here : 1e30f;
            }
        }
    }
}

/* A piece across which extinction changes much is looked at again in seven: the field between the samples is not quite linear, and
   where in the piece its surface lies decides about light. */
static void isogi_dvr__fast_divide(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_state *s,
                                   const isogi_dvr__fast_run *run, int k, isogi_counters *work) {
    const uint8_t first = 0;
    isogi_dvr__fast_run part;
    memset(&part, 0, sizeof part);
    part.pieces = ISOGI_DVR__NODES - 1, part.first = run->first + run->stride * (float)k;
    part.length = part.last = (k + 1 < run->pieces ? run->length : run->last) / (float)part.pieces;
    part.stride = part.length / run->length * run->stride;
    part.tolerance = 3e38f;
    work->samples += ISOGI_DVR__NODES - 2;
    f->look(f, r, &part, &first, 1);
    f->shade(f, r, s, &part, work);
}

/* 1 - exp(-depth), also where that has no digits left. */
static float isogi_dvr__lost(float depth, float clear) {
    return depth < 0.02f ? depth * (1 - depth * (0.5f - depth * (1.0f / 6))) : 1 - clear;
}

/* The pieces of a run, front to back. */
static void isogi_dvr__fast_shade(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_state *s,
                                  const isogi_dvr__fast_run *run, isogi_counters *work) {
    int k, a;
    for (k = 0; k < run->pieces && s->clear > f->end; k++) {
        float light[4] = {1, 1, 1, 1}, lamp[ISOGI_DVR__NODES][4], factor[3], clear;
        const isogi_dvr__class_entry *e[2];
        if (!(run->some >> k & 1)) continue;
        if (run->change[k] * s->clear > run->tolerance) {
            isogi_dvr__fast_divide(f, r, s, run, k, work);
            continue;
        }
        clear = isogi_dvr__exp(run->depth[k]);
        isogi_dvr__fast_factors(f, run->classes[k], run->classes[k + 1], e, factor);
        if (f->light) {
            float open, at = isogi_dvr__fast_place(r, run, k, &open);
            isogi_dvr__fast_light(f, r, at, open, light);
            if (f->lamps) isogi_dvr__fast_lamps(f, r, run, 1u << k, lamp);
            for (a = 0; f->lamps && a < 3; a++) {
                float least = f->lamps->least[a] * lamp[k][3];
                light[a] += lamp[k][a], light[a] = light[a] > least ? light[a] : least;
            }
        }
        for (a = 0; a < 3; a++) { /* a truncated series may ring below 0 */
            float colour = isogi_dvr__fast_mean(f, e, factor, a);
            colour = colour > 0 ? colour : 0, light[a] = light[a] > 0 ? light[a] : 0;
            s->out[a] += (light[a] + f->glow) * colour * (s->clear * isogi_dvr__lost(run->depth[k], clear) / run->mean[k]);
        }
        s->out[3] += s->clear * isogi_dvr__lost(run->depth[k], clear);
        s->clear *= clear;
    }
}

/* As isogi_dvr__fast_shade without colours: sums up depth until what is sought, and finds its place by halving: between two samples the
   value is linear, and its integral is monotone. */
static void isogi_dvr__fast_probe(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_state *s,
                                  const isogi_dvr__fast_run *run, isogi_counters *work) {
    int k, n;
    for (k = 0; k < run->pieces && s->clear > f->end; k++) {
        float from = run->classes[k], to = run->classes[k + 1], length = k + 1 < run->pieces ? run->length : run->last, low = 0, high = 1;
        if (!(run->some >> k & 1)) continue;
        if (run->change[k] * s->clear > run->tolerance) {
            isogi_dvr__fast_divide(f, r, s, run, k, work);
            continue;
        }
        if (s->depth + run->depth[k] >= r->sought) {
            for (n = 0; n < 24; n++) {
                const isogi_dvr__class_entry *e[2];
                float u = 0.5f * (low + high), factor[3], mean;
                isogi_dvr__fast_factors(f, from, from + u * (to - from), e, factor);
                mean = isogi_dvr__fast_mean(f, e, factor, 3);
                if (s->depth + mean * length * u >= r->sought) high = u;
                else low = u;
            }
            s->clear = 0;
        } else s->depth += run->depth[k], s->clear *= isogi_dvr__exp(run->depth[k]);
        s->place = run->first + run->stride * ((float)k + high * length / run->length);
    }
}

#ifdef ISOGI_DVR__AVX
#define ISOGI_DVR__AVX2 __attribute__((target("avx2,fma"))) static
#define ISOGI_DVR__ALWAYS __attribute__((always_inline)) inline
/* Words at any address. */
typedef uint16_t isogi_dvr__two_bytes __attribute__((aligned(1), may_alias));
typedef int32_t isogi_dvr__four_bytes __attribute__((aligned(1), may_alias));

/* The field along x between pairs of voxels of eight samples, by plain loads: gathers take longer, on some machines several times. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__row_f32_avx2(const char *row, const uint32_t at[8], __m256 u) {
#define ISOGI_DVR__PAIR(k, l) /* two floats each of samples k and l */ \
    _mm_loadh_pi(_mm_castsi128_ps(_mm_loadl_epi64((const __m128i *)(const void *)(row + at[k]))),          \
                 (const __m64 *)(const void *)(row + at[l]))
    const __m256 low = _mm256_insertf128_ps(_mm256_castps128_ps256(ISOGI_DVR__PAIR(0, 1)), ISOGI_DVR__PAIR(4, 5), 1),
                 high = _mm256_insertf128_ps(_mm256_castps128_ps256(ISOGI_DVR__PAIR(2, 3)), ISOGI_DVR__PAIR(6, 7), 1),
                 from = _mm256_shuffle_ps(low, high, 0x88), to = _mm256_shuffle_ps(low, high, 0xdd);
#undef ISOGI_DVR__PAIR
    return _mm256_fmadd_ps(u, _mm256_sub_ps(to, from), from);
}

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__row_u8_avx2(const char *row, const uint32_t at[8], __m256 u) {
#define ISOGI_DVR__PAIR(k) (short)*(const isogi_dvr__two_bytes *)(const void *)(row + at[k])
    const __m128i pair = _mm_setr_epi16(ISOGI_DVR__PAIR(0), ISOGI_DVR__PAIR(1), ISOGI_DVR__PAIR(2), ISOGI_DVR__PAIR(3), ISOGI_DVR__PAIR(4),
                                        ISOGI_DVR__PAIR(5), ISOGI_DVR__PAIR(6), ISOGI_DVR__PAIR(7));
    __m256 from, to;
#undef ISOGI_DVR__PAIR
    from = _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_and_si128(pair, _mm_set1_epi16(0xff))));
    to = _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_srli_epi16(pair, 8)));
    return _mm256_fmadd_ps(u, _mm256_sub_ps(to, from), from);
}

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__row_u16_avx2(const char *row, const uint32_t at[8], __m256 u) {
#define ISOGI_DVR__PAIR(k) (*(const isogi_dvr__four_bytes *)(const void *)(row + at[k]))
    const __m256i pair = _mm256_setr_epi32(ISOGI_DVR__PAIR(0), ISOGI_DVR__PAIR(1), ISOGI_DVR__PAIR(2), ISOGI_DVR__PAIR(3),
                                           ISOGI_DVR__PAIR(4), ISOGI_DVR__PAIR(5), ISOGI_DVR__PAIR(6), ISOGI_DVR__PAIR(7));
    __m256 from, to;
#undef ISOGI_DVR__PAIR
    from = _mm256_cvtepi32_ps(_mm256_and_si256(pair, _mm256_set1_epi32(0xffff))), to = _mm256_cvtepi32_ps(_mm256_srli_epi32(pair, 16));
    return _mm256_fmadd_ps(u, _mm256_sub_ps(to, from), from);
}

/* Cells of samples along an axis, and places in them. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256i isogi_dvr__cells_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, __m256 at, int a,
                                                                float *u) {
    __m256 x = _mm256_fmadd_ps(at, _mm256_set1_ps(r->dir[a]), _mm256_set1_ps(r->origin[a]));
    __m256i c;
    x = _mm256_min_ps(_mm256_max_ps(x, _mm256_setzero_ps()), _mm256_set1_ps(f->cells[a]));
    c = _mm256_min_epi32(_mm256_cvttps_epi32(x), _mm256_set1_epi32(f->last_cell[a]));
    _mm256_storeu_ps(u, _mm256_sub_ps(x, _mm256_cvtepi32_ps(c)));
    return _mm256_mullo_epi32(c, _mm256_set1_epi32(f->stride[a]));
}

/* Samples of a run: bytes from the first voxel to their cells, later their classes; places in cells; a bit for each that is not finite. */
typedef struct isogi_dvr__fast_cells {
    uint32_t at[8];
    float u[3][8];
    unsigned bad;
} isogi_dvr__fast_cells;

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS void isogi_dvr__run_cells_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r,
                                                                 const isogi_dvr__fast_run *run, isogi_dvr__fast_cells *cells) {
    __m256 at = _mm256_fmadd_ps(_mm256_set1_ps(run->stride), _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_ps(run->first));
    __m256i offset;
    at = _mm256_min_ps(at, _mm256_set1_ps(r->end));
    offset = isogi_dvr__cells_avx2(f, r, at, 0, cells->u[0]);
    offset = _mm256_add_epi32(offset, isogi_dvr__cells_avx2(f, r, at, 1, cells->u[1]));
    offset = _mm256_add_epi32(offset, isogi_dvr__cells_avx2(f, r, at, 2, cells->u[2]));
    _mm256_storeu_si256((__m256i *)(void *)cells->at, offset);
}

/* Values of a run's samples, not yet scaled. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__samples_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_cells *cells, int kind) {
    const char *data = (const char *)f->dvr->volume.data, *next = data + f->stride[1], *behind = data + f->stride[2],
               *last = behind + f->stride[1];
    const __m256 u = _mm256_loadu_ps(cells->u[0]), v = _mm256_loadu_ps(cells->u[1]), w = _mm256_loadu_ps(cells->u[2]);
    __m256 x0, x1, x2, x3;
    const uint32_t *at = cells->at;
    if (kind == 0) x0 = isogi_dvr__row_f32_avx2(data, at, u), x1 = isogi_dvr__row_f32_avx2(next, at, u);
    else if (kind == 1) x0 = isogi_dvr__row_u8_avx2(data, at, u), x1 = isogi_dvr__row_u8_avx2(next, at, u);
    else x0 = isogi_dvr__row_u16_avx2(data, at, u), x1 = isogi_dvr__row_u16_avx2(next, at, u);
    if (kind == 0) x2 = isogi_dvr__row_f32_avx2(behind, at, u), x3 = isogi_dvr__row_f32_avx2(last, at, u);
    else if (kind == 1) x2 = isogi_dvr__row_u8_avx2(behind, at, u), x3 = isogi_dvr__row_u8_avx2(last, at, u);
    else x2 = isogi_dvr__row_u16_avx2(behind, at, u), x3 = isogi_dvr__row_u16_avx2(last, at, u);
    x0 = _mm256_fmadd_ps(v, _mm256_sub_ps(x1, x0), x0), x2 = _mm256_fmadd_ps(v, _mm256_sub_ps(x3, x2), x2);
    return _mm256_fmadd_ps(w, _mm256_sub_ps(x2, x0), x0);
}

/* Lane k + 1 at lane k. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__next_avx2(__m256 x) {
    return _mm256_permutevar8x32_ps(x, _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 7));
}

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__magnitude_avx2(__m256 x) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), x); }

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256i isogi_dvr__fast_classes_avx2(const isogi_dvr__frame *f, __m256 value) {
    return _mm256_cvttps_epi32(_mm256_min_ps(_mm256_max_ps(value, _mm256_setzero_ps()), _mm256_set1_ps(f->top)));
}

/* Where isogi_dvr__fast_factors takes the mean. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS __m256 isogi_dvr__close_avx2(__m256 difference, __m256i index) {
    __m256i next = _mm256_castps_si256(isogi_dvr__next_avx2(_mm256_castsi256_ps(index)));
    __m256 close = _mm256_cmp_ps(isogi_dvr__magnitude_avx2(difference), _mm256_set1_ps(ISOGI_DVR__CLOSE), _CMP_LT_OQ);
    return _mm256_or_ps(close, _mm256_castsi256_ps(_mm256_cmpeq_epi32(index, next)));
}

/* The extinction of eight classes: integrals before them, so many quanta and the rest, and over them. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS void isogi_dvr__matter_avx2(const isogi_dvr__frame *f, const uint32_t at[8], __m256i *before,
                                                              __m256 *rest, __m256 *mean) {
#define ISOGI_DVR__TWO(k) /* classes k and k + 4 */ \
    _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps((const float *)(const void *)&f->matter[at[k]])), \
                         _mm_load_ps((const float *)(const void *)&f->matter[at[(k) + 4]]), 1)
    __m256 x0 = ISOGI_DVR__TWO(0), x1 = ISOGI_DVR__TWO(1), x2 = ISOGI_DVR__TWO(2), x3 = ISOGI_DVR__TWO(3);
    __m256 low0 = _mm256_unpacklo_ps(x0, x1), low1 = _mm256_unpacklo_ps(x2, x3);
    __m256 high0 = _mm256_unpackhi_ps(x0, x1), high1 = _mm256_unpackhi_ps(x2, x3);
    *before = _mm256_castps_si256(_mm256_shuffle_ps(low0, low1, 0x44));
    *rest = _mm256_shuffle_ps(low0, low1, 0xee), *mean = _mm256_shuffle_ps(high0, high1, 0x44);
#undef ISOGI_DVR__TWO
}

/* Places of samples among the classes, and their classes. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS void isogi_dvr__run_values_avx2(const isogi_dvr__frame *f, isogi_dvr__fast_run *run,
                                                                  isogi_dvr__fast_cells *cells, __m256 value) {
    const __m256i infinite = _mm256_set1_epi32(0x7f800000);
    __m256i bad = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_castps_si256(value), infinite), infinite);
    value = _mm256_fmadd_ps(value, _mm256_set1_ps(f->value_scale), _mm256_set1_ps(f->value_bias));
    value = _mm256_min_ps(_mm256_max_ps(_mm256_mul_ps(value, _mm256_set1_ps(f->scale)), _mm256_set1_ps(-1e15f)), _mm256_set1_ps(1e15f));
    value = _mm256_andnot_ps(_mm256_castsi256_ps(bad), value);
    cells->bad = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(bad));
    _mm256_storeu_ps(run->classes, value);
    _mm256_storeu_si256((__m256i *)(void *)cells->at, isogi_dvr__fast_classes_avx2(f, value));
}

ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS void isogi_dvr__run_classes_avx2(const isogi_dvr__frame *f, isogi_dvr__fast_run *run,
                                                                   isogi_dvr__fast_cells *cells, int kind) {
    isogi_dvr__run_values_avx2(f, run, cells, isogi_dvr__samples_avx2(f, cells, kind));
}

/* What lies between the samples of a run. */
ISOGI_DVR__AVX2 ISOGI_DVR__ALWAYS void isogi_dvr__run_matter_avx2(const isogi_dvr__frame *f, isogi_dvr__fast_run *run,
                                                                  const isogi_dvr__fast_cells *cells) {
    const __m256 value = _mm256_loadu_ps(run->classes);
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), index = _mm256_loadu_si256((const __m256i *)(const void *)cells->at);
    __m256 rest, node, sum, change, difference, mean, length, close;
    __m256i before;
    isogi_dvr__matter_avx2(f, cells->at, &before, &rest, &node);
    before = _mm256_sub_epi32(_mm256_castps_si256(isogi_dvr__next_avx2(_mm256_castsi256_ps(before))), before);
    sum = _mm256_mul_ps(_mm256_sub_ps(value, _mm256_cvtepi32_ps(index)), node);
    difference = _mm256_sub_ps(isogi_dvr__next_avx2(value), value), change = isogi_dvr__next_avx2(node);
    close = isogi_dvr__close_avx2(difference, index);
    mean = _mm256_add_ps(_mm256_sub_ps(isogi_dvr__next_avx2(rest), rest), _mm256_sub_ps(isogi_dvr__next_avx2(sum), sum));
    mean = _mm256_fmadd_ps(_mm256_cvtepi32_ps(before), _mm256_set1_ps(f->quantum[3]), mean);
    mean = _mm256_blendv_ps(_mm256_div_ps(mean, difference), _mm256_mul_ps(_mm256_set1_ps(0.5f), _mm256_add_ps(node, change)), close);
    mean = _mm256_and_ps(mean, _mm256_cmp_ps(mean, _mm256_setzero_ps(), _CMP_GT_OQ));
    mean = _mm256_and_ps(mean, _mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_set1_epi32(run->pieces), lane)));
    if (cells->bad) {
        const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128), out = _mm256_set1_epi32((int)(cells->bad | cells->bad >> 1));
        mean = _mm256_andnot_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(out, bit), bit)), mean);
    }
    length = _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_set1_epi32(run->pieces - 1), lane));
    length = _mm256_blendv_ps(_mm256_set1_ps(run->length), _mm256_set1_ps(run->last), length);
    run->some = (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(mean, _mm256_setzero_ps(), _CMP_GT_OQ));
    _mm256_storeu_ps(run->mean, mean);
    _mm256_storeu_ps(run->depth, _mm256_min_ps(_mm256_mul_ps(mean, length), _mm256_set1_ps(1e30f)));
    _mm256_storeu_ps(run->change, _mm256_mul_ps(isogi_dvr__magnitude_avx2(_mm256_sub_ps(change, node)), length));
}

/* As isogi_dvr__fast_look: cells of all runs, then values of all, then matter, since each waits long for what is before it, values for
   memory. */
#define ISOGI_DVR__EACH(what) \
    for (n = 0; n < count; n++) { \
        const int k = ray[n]; \
        what; \
    }
#define ISOGI_DVR__LOOK(classes, kind) \
    isogi_dvr__fast_cells cells[ISOGI_DVR__RAYS]; \
    const char *data = (const char *)f->dvr->volume.data; \
    int i, n; \
    ISOGI_DVR__EACH({ \
        isogi_dvr__run_cells_avx2(f, &r[k], &run[k], &cells[k]); \
        for (i = 0; i < 8; i++) __builtin_prefetch(data + cells[k].at[i]); \
    }) \
    if (kind == 0) ISOGI_DVR__EACH(classes(f, &run[k], &cells[k], 0)) \
    else if (kind == 1) ISOGI_DVR__EACH(classes(f, &run[k], &cells[k], 1)) \
    else ISOGI_DVR__EACH(classes(f, &run[k], &cells[k], 2)) \
    ISOGI_DVR__EACH(isogi_dvr__run_matter_avx2(f, &run[k], &cells[k]))
ISOGI_DVR__AVX2 void isogi_dvr__look_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run,
                                          const uint8_t *ray, int count) {
    ISOGI_DVR__LOOK(isogi_dvr__run_classes_avx2, f->sample_kind)
}

#define ISOGI_DVR__AVX512 __attribute__((target("avx2,fma,avx512f,avx512vl,avx512dq,avx512bw"))) static
/* Pairs of floats of samples k, k + 1, k + 4 and k + 5: loads put them to their places without a shuffle. */
ISOGI_DVR__AVX512 ISOGI_DVR__ALWAYS __m256 isogi_dvr__pairs_avx512(const char *row, const uint32_t at[8], int k) {
#define ISOGI_DVR__PAIR(k) _mm_castsi128_pd(_mm_loadl_epi64((const __m128i *)(const void *)(row + at[k])))
    __m256d x = _mm256_broadcastsd_pd(ISOGI_DVR__PAIR(k));
    x = _mm256_mask_broadcastsd_pd(x, 2, ISOGI_DVR__PAIR(k + 1)), x = _mm256_mask_broadcastsd_pd(x, 4, ISOGI_DVR__PAIR(k + 4));
    return _mm256_castpd_ps(_mm256_mask_broadcastsd_pd(x, 8, ISOGI_DVR__PAIR(k + 5)));
#undef ISOGI_DVR__PAIR
}

/* The same of samples 0, 1, 4, 5, 2, 3, 6 and 7. Nothing here may leave lanes undefined: gcc 12 warns of that in its own headers. */
ISOGI_DVR__AVX512 ISOGI_DVR__ALWAYS __m512 isogi_dvr__all_pairs_avx512(const char *row, const uint32_t at[8]) {
    const __m256d low = _mm256_castps_pd(isogi_dvr__pairs_avx512(row, at, 0)), high = _mm256_castps_pd(isogi_dvr__pairs_avx512(row, at, 2));
    return _mm512_castpd_ps(_mm512_mask_broadcast_f64x4(_mm512_castpd256_pd512(low), 0xf0, high));
}

/* As isogi_dvr__samples_avx2 of floats: pairs stay pairs until they stand between their rows. */
ISOGI_DVR__AVX512 ISOGI_DVR__ALWAYS __m256 isogi_dvr__floats_avx512(const isogi_dvr__frame *f, const isogi_dvr__fast_cells *cells) {
    const char *data = (const char *)f->dvr->volume.data, *next = data + f->stride[1], *behind = data + f->stride[2],
               *last = behind + f->stride[1];
    const __m512i twice = _mm512_setr_epi32(0, 0, 1, 1, 4, 4, 5, 5, 2, 2, 3, 3, 6, 6, 7, 7);
    const __m512 v = _mm512_maskz_permutexvar_ps(0xffff, twice, _mm512_castps256_ps512(_mm256_loadu_ps(cells->u[1]))),
                 w = _mm512_maskz_permutexvar_ps(0xffff, twice, _mm512_castps256_ps512(_mm256_loadu_ps(cells->u[2])));
    __m512 x0 = isogi_dvr__all_pairs_avx512(data, cells->at), x1 = isogi_dvr__all_pairs_avx512(next, cells->at),
           x2 = isogi_dvr__all_pairs_avx512(behind, cells->at), x3 = isogi_dvr__all_pairs_avx512(last, cells->at);
    float pair[16];
    __m256 low, high, from, to;
    x0 = _mm512_fmadd_ps(v, _mm512_sub_ps(x1, x0), x0), x2 = _mm512_fmadd_ps(v, _mm512_sub_ps(x3, x2), x2);
    _mm512_storeu_ps(pair, _mm512_fmadd_ps(w, _mm512_sub_ps(x2, x0), x0));
    low = _mm256_loadu_ps(pair), high = _mm256_loadu_ps(pair + 8);
    from = _mm256_shuffle_ps(low, high, 0x88), to = _mm256_shuffle_ps(low, high, 0xdd);
    return _mm256_fmadd_ps(_mm256_loadu_ps(cells->u[0]), _mm256_sub_ps(to, from), from);
}

ISOGI_DVR__AVX512 ISOGI_DVR__ALWAYS void isogi_dvr__run_classes_avx512(const isogi_dvr__frame *f, isogi_dvr__fast_run *run,
                                                                       isogi_dvr__fast_cells *cells, int kind) {
    isogi_dvr__run_values_avx2(f, run, cells, kind ? isogi_dvr__samples_avx2(f, cells, kind) : isogi_dvr__floats_avx512(f, cells));
}

ISOGI_DVR__AVX512 void isogi_dvr__look_avx512(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run,
                                              const uint8_t *ray, int count) {
    ISOGI_DVR__LOOK(isogi_dvr__run_classes_avx512, f->sample_kind)
}
#undef ISOGI_DVR__EACH
#undef ISOGI_DVR__LOOK
#undef ISOGI_DVR__AVX512

/* As isogi_dvr__exp. */
ISOGI_DVR__AVX2 inline __m256 isogi_dvr__exp_avx2(__m256 x) {
    __m256 y = _mm256_max_ps(_mm256_mul_ps(x, _mm256_set1_ps(-1.44269504f)), _mm256_set1_ps(-80)), p = _mm256_set1_ps(1.54035304e-4f);
    __m256i n = _mm256_cvttps_epi32(_mm256_sub_ps(y, _mm256_set1_ps(0.5f)));
    y = _mm256_sub_ps(y, _mm256_cvtepi32_ps(n));
    p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(1.33335581e-3f)), p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(9.61812911e-3f));
    p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(5.55041087e-2f)), p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(2.40226507e-1f));
    p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(6.93147182e-1f)), p = _mm256_fmadd_ps(p, y, _mm256_set1_ps(1));
    return _mm256_mul_ps(p, _mm256_castsi256_ps(_mm256_slli_epi32(_mm256_add_epi32(n, _mm256_set1_epi32(127)), 23)));
}

/* Products of lanes 0 .. k - 1 at lane k, times first. */
ISOGI_DVR__AVX2 inline __m256 isogi_dvr__products_avx2(__m256 x, float first) {
    __m256 shifted = _mm256_permutevar8x32_ps(x, _mm256_setr_epi32(0, 0, 1, 2, 3, 4, 5, 6));
    const __m256 one = _mm256_set1_ps(1);
    x = _mm256_blend_ps(shifted, _mm256_set1_ps(first), 1);
    x = _mm256_mul_ps(x, _mm256_blend_ps(_mm256_permutevar8x32_ps(x, _mm256_setr_epi32(0, 0, 1, 2, 3, 4, 5, 6)), one, 1));
    x = _mm256_mul_ps(x, _mm256_blend_ps(_mm256_permutevar8x32_ps(x, _mm256_setr_epi32(0, 0, 0, 1, 2, 3, 4, 5)), one, 3));
    return _mm256_mul_ps(x, _mm256_blend_ps(_mm256_permute2f128_ps(x, x, 0), one, 15));
}

/* For each piece of a run: what its colour is a sum of (see isogi_dvr__fast_factors), and where its light is. */
typedef struct isogi_dvr__fast_parts {
    float factor[3][8], u[3][8], clear[8], weight[8], open[8]; /* clear: before the piece; open: as isogi_dvr__by_openness */
    float lamp[8][4];                     /* of isogi_dvr__fast_lamps */
    int32_t entry[8], place[8], to[2][8]; /* to: points from place to the next row and plane */
} isogi_dvr__fast_parts;

/* As isogi_dvr__held_cell: points, places within cells, points to the next rows and planes. */
ISOGI_DVR__AVX2 inline __m256i isogi_dvr__held_cells_avx2(const isogi_dvr__held *h, const __m256i cell[3], __m256 u[3], __m256i *row,
                                                          __m256i *plane) {
    const __m256i seven = _mm256_set1_epi32(7), one = _mm256_set1_epi32(1);
    __m256i block = _mm256_setzero_si256(), log, point;
    __m256 part;
    int a;
    for (a = 3; a-- > 0;)
        block = _mm256_add_epi32(_mm256_mullo_epi32(block, _mm256_set1_epi32((int)h->count[a])), _mm256_srli_epi32(cell[a], 3));
    point = _mm256_i32gather_epi32((const int *)(const void *)&h->block[0].first, block, 8);
    log = _mm256_i32gather_epi32((const int *)(const void *)&h->block[0].log, block, 8);
    part = _mm256_castsi256_ps(_mm256_slli_epi32(_mm256_sub_epi32(_mm256_set1_epi32(127), log), 23)); /* 2^-log */
    *row = _mm256_add_epi32(_mm256_srlv_epi32(_mm256_set1_epi32(8), log), one), *plane = _mm256_mullo_epi32(*row, *row);
    for (a = 0; a < 3; a++) {
        __m256i within = _mm256_and_si256(cell[a], seven), c = _mm256_srlv_epi32(within, log);
        u[a] = _mm256_mul_ps(_mm256_add_ps(u[a], _mm256_cvtepi32_ps(_mm256_sub_epi32(within, _mm256_sllv_epi32(c, log)))), part);
        point = _mm256_add_epi32(point, a ? _mm256_mullo_epi32(c, a > 1 ? *plane : *row) : c);
    }
    return point;
}

ISOGI_DVR__AVX2 inline void isogi_dvr__parts_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, const isogi_dvr__fast_run *run,
                                                  isogi_dvr__fast_parts *parts) {
    const __m256 zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1), half = _mm256_set1_ps(0.5f), reach = _mm256_set1_ps(r->reach);
    __m256 value = _mm256_loadu_ps(run->classes), next = isogi_dvr__next_avx2(value), difference = _mm256_sub_ps(next, value), x, at, close,
           u[3];
    __m256i index, c[3], to, plane;
    int a;
    index = isogi_dvr__fast_classes_avx2(f, value);
    close = isogi_dvr__close_avx2(difference, index), x = _mm256_div_ps(one, difference);
    value = _mm256_sub_ps(_mm256_cvtepi32_ps(index), value), next = isogi_dvr__next_avx2(value);
    _mm256_storeu_si256((__m256i *)(void *)parts->entry, index);
    _mm256_storeu_ps(parts->factor[0], _mm256_andnot_ps(close, x));
    _mm256_storeu_ps(parts->factor[1], _mm256_blendv_ps(_mm256_mul_ps(value, x), half, close));
    _mm256_storeu_ps(parts->factor[2], _mm256_blendv_ps(_mm256_xor_ps(_mm256_mul_ps(next, x), _mm256_set1_ps(-0.0f)), half, close));
    if (!f->light) return;
    index = _mm256_setzero_si256();
    x = _mm256_min_ps(_mm256_mul_ps(_mm256_loadu_ps(run->mean), _mm256_set1_ps(r->piece * r->reach)), _mm256_set1_ps(1e15f)),
    x = _mm256_mul_ps(x, x);
    x = _mm256_div_ps(x, _mm256_add_ps(x, _mm256_set1_ps(16)));
    _mm256_storeu_ps(parts->open, _mm256_max_ps(_mm256_fmsub_ps(x, _mm256_set1_ps(2), one), zero));
    x = _mm256_mul_ps(reach, x);
    at = _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_set1_epi32(run->pieces - 1), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)));
    at = _mm256_blendv_ps(half, _mm256_set1_ps(0.5f * (run->last / run->length)), at); /* as isogi_dvr__fast_middle */
    at = _mm256_div_ps(at, _mm256_fmadd_ps(_mm256_loadu_ps(run->depth), _mm256_set1_ps(1.0f / 6), one));
    at = _mm256_add_ps(at, _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7));
    at = _mm256_max_ps(_mm256_sub_ps(_mm256_fmadd_ps(at, _mm256_set1_ps(run->stride), _mm256_set1_ps(run->first)), x), zero);
    for (a = 0; a < 3; a++) {
        x = _mm256_mul_ps(_mm256_fmadd_ps(at, _mm256_set1_ps(r->dir[a]), _mm256_set1_ps(r->origin[a])), _mm256_set1_ps(f->light_scale[a]));
        x = _mm256_max_ps(x, zero);
        c[a] = _mm256_min_epi32(_mm256_cvttps_epi32(x), _mm256_set1_epi32(f->light_last[a])),
        u[a] = _mm256_min_ps(_mm256_sub_ps(x, _mm256_cvtepi32_ps(c[a])), one);
        if (!f->held.block)
            index = _mm256_add_epi32(index, a ? _mm256_mullo_epi32(c[a], _mm256_set1_epi32((int)(f->light_row[a - 1] / 4))) : c[a]);
    }
    to = _mm256_set1_epi32((int)(f->light_stride[1] / 4)), plane = _mm256_set1_epi32((int)(f->light_stride[2] / 4));
    if (f->held.block) index = isogi_dvr__held_cells_avx2(&f->held, c, u, &to, &plane);
    for (a = 0; a < 3; a++) _mm256_storeu_ps(parts->u[a], u[a]);
    _mm256_storeu_si256((__m256i *)(void *)parts->place, index);
    _mm256_storeu_si256((__m256i *)(void *)parts->to[0], to), _mm256_storeu_si256((__m256i *)(void *)parts->to[1], plane);
}

/* As isogi_dvr__fast_between. */
ISOGI_DVR__AVX2 inline __m128 isogi_dvr__fast_between_avx2(const float *p, const isogi_dvr__fast_parts *parts, int k) {
    const size_t row = 4 * (size_t)parts->to[0][k];
    const float *q;
    __m256 u = _mm256_set1_ps(parts->u[1][k]), front, back;
    __m128 out;
    p += 4 * (size_t)parts->place[k], q = p + 4 * (size_t)parts->to[1][k];
    front = _mm256_loadu_ps(p), back = _mm256_loadu_ps(q);
    front = _mm256_fmadd_ps(u, _mm256_sub_ps(_mm256_loadu_ps(p + row), front), front);
    back = _mm256_fmadd_ps(u, _mm256_sub_ps(_mm256_loadu_ps(q + row), back), back);
    front = _mm256_fmadd_ps(_mm256_set1_ps(parts->u[2][k]), _mm256_sub_ps(back, front), front);
    out = _mm256_castps256_ps128(front);
    return _mm_fmadd_ps(_mm_set1_ps(parts->u[0][k]), _mm_sub_ps(_mm256_extractf128_ps(front, 1), out), out);
}

/* Colour times light of a piece, without its weight. */
ISOGI_DVR__AVX2 inline __m128 isogi_dvr__part_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_parts *parts, int k) {
    const isogi_dvr__class_entry *e0 = &f->classes[parts->entry[k]], *e1 = &f->classes[parts->entry[k + 1]];
    const __m128i quanta = _mm_sub_epi32(_mm_loadu_si128((const __m128i *)(const void *)e1->before),
                                         _mm_loadu_si128((const __m128i *)(const void *)e0->before));
    __m128 colour = _mm_sub_ps(_mm_loadu_ps(e1->rest), _mm_loadu_ps(e0->rest)), light;
    colour = _mm_fmadd_ps(_mm_cvtepi32_ps(quanta), _mm_loadu_ps(f->quantum), colour);
    colour = _mm_fmadd_ps(_mm_loadu_ps(e0->mean), _mm_set1_ps(parts->factor[1][k]), _mm_mul_ps(colour, _mm_set1_ps(parts->factor[0][k])));
    colour = _mm_max_ps(_mm_fmadd_ps(_mm_loadu_ps(e1->mean), _mm_set1_ps(parts->factor[2][k]), colour), _mm_setzero_ps());
    if (!f->light) return colour;
    light = isogi_dvr__fast_between_avx2(f->light[0], parts, k);
    if (parts->open[k] > 0 && f->open) {
        const __m128 one = _mm_set1_ps(1), open = _mm_set1_ps(parts->open[k]);
        __m128 total = _mm_fmadd_ps(open, _mm_sub_ps(_mm_shuffle_ps(light, light, 0xff), one), one);
        light = _mm_fmadd_ps(open, _mm_sub_ps(isogi_dvr__fast_between_avx2(f->open[0], parts, k), light), light);
        light = _mm_div_ps(light, total);
    }
    if (f->lamps) {
        const __m128 lamp = _mm_loadu_ps(parts->lamp[k]);
        const float *least = f->lamps->least;
        light = _mm_add_ps(light, lamp);
        light = _mm_max_ps(light, _mm_mul_ps(_mm_setr_ps(least[0], least[1], least[2], 0), _mm_shuffle_ps(lamp, lamp, 0xff)));
    }
    light = _mm_add_ps(_mm_max_ps(light, _mm_setzero_ps()), _mm_set1_ps(f->glow)); /* a truncated series may ring below 0 */
    return _mm_mul_ps(colour, _mm_blend_ps(light, _mm_set1_ps(1), 8));
}

/* As isogi_dvr__fast_shade. */
ISOGI_DVR__AVX2 void isogi_dvr__fast_shade_avx2(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_state *s,
                                                const isogi_dvr__fast_run *run, isogi_counters *work) {
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256 depth = _mm256_loadu_ps(run->depth), one = _mm256_set1_ps(1);
    __m256 passed = isogi_dvr__exp_avx2(depth), lost = _mm256_fnmadd_ps(depth, _mm256_set1_ps(1.0f / 6), _mm256_set1_ps(0.5f));
    isogi_dvr__fast_parts parts;
    __m128 out = _mm_loadu_ps(s->out);
    unsigned some = run->some;
    isogi_dvr__parts_avx2(f, r, run, &parts);
    lost = _mm256_mul_ps(depth, _mm256_fnmadd_ps(depth, lost, one)); /* as isogi_dvr__lost */
    lost = _mm256_blendv_ps(_mm256_sub_ps(one, passed), lost, _mm256_cmp_ps(depth, _mm256_set1_ps(0.02f), _CMP_LT_OQ));
    for (;;) {
        __m256 before = isogi_dvr__products_avx2(passed, s->clear), weight = _mm256_mul_ps(before, lost);
        __m256 change = _mm256_mul_ps(before, _mm256_loadu_ps(run->change));
        unsigned seen = (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(before, _mm256_set1_ps(f->end), _CMP_GT_OQ)), bits = some & seen;
        unsigned divided = bits & (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(change, _mm256_set1_ps(run->tolerance), _CMP_GT_OQ));
        _mm256_storeu_ps(parts.clear, before), _mm256_storeu_ps(parts.weight, _mm256_div_ps(weight, _mm256_loadu_ps(run->mean)));
        if (divided) bits &= (divided & (0 - divided)) - 1;
        if (f->lamps && bits) isogi_dvr__fast_lamps(f, r, run, bits, parts.lamp);
        for (; bits; bits &= bits - 1) {
            int k = __builtin_ctz(bits);
            out = _mm_fmadd_ps(isogi_dvr__part_avx2(f, &parts, k), _mm_set1_ps(parts.weight[k]), out);
        }
        if (!divided) {
            s->clear = parts.clear[__builtin_ctz(~seen | 1u << (ISOGI_DVR__NODES - 1))];
            break;
        } else {
            int k = __builtin_ctz(divided);
            s->clear = parts.clear[k];
            _mm_storeu_ps(s->out, out);
            isogi_dvr__fast_divide(f, r, s, run, k, work);
            out = _mm_loadu_ps(s->out), some &= ~((2u << k) - 1);
            passed = _mm256_blendv_ps(one, passed, _mm256_castsi256_ps(_mm256_cmpgt_epi32(lane, _mm256_set1_epi32(k))));
        }
    }
    _mm_storeu_ps(s->out, out);
}
#undef ISOGI_DVR__AVX2
#undef ISOGI_DVR__ALWAYS
#endif

/* Pieces within four of their length of a lamp are divided, too: light falls off with the square of the distance. */
static void isogi_dvr__fast_beside_lamps(const isogi_dvr__frame *f, const isogi_dvr__fast_ray *r, isogi_dvr__fast_run *run) {
    double grid[3], world[3], half = 0.5 * (double)run->stride * run->pieces, limit = (half + 4) * f->step * f->dvr->spacing;
    size_t i;
    int a;
    for (a = 0; a < 3; a++) grid[a] = (double)r->origin[a] + ((double)run->first + half) * (double)r->dir[a];
    isogi_vol_to_world(f->dvr->desc.pyramid, grid, world);
    for (i = 0; i < f->lamps->nearby.light_count; i++) {
        double away[3];
        for (a = 0; a < 3; a++) away[a] = (double)f->lamps->nearby.lights[i].vector[a] - world[a];
        if (isogi_dvr__dot(away, away) < limit * limit)
            for (a = 0; a < run->pieces; a++) run->change[a] = 1e30f;
    }
}

/* As isogi_dvr__leap where a piece may lead past a whole block, from one that is empty to another one: what is between their values
   counts, and no sample is left out. */
static int isogi_dvr__leap_none(const isogi_dvr *d, isogi_dvr__packet *p, isogi_counters *work) {
    int k, found = 0;
    (void)d, (void)work;
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        p->next[k] = p->at[k] < p->count[k] ? p->at[k] : p->count[k], p->at[k] = p->next[k];
        if (p->next[k] < p->count[k]) p->found[found++] = (uint8_t)k;
    }
    return found;
}

/* Front to back: all rays of a packet go to where the next matter may be, then each passes some of it. */
static void isogi_dvr__fast_cast(const isogi_dvr__frame *f, const isogi_dvr__fast_ray r[ISOGI_DVR__RAYS],
                                 isogi_dvr__fast_state s[ISOGI_DVR__RAYS], isogi_counters *work) {
    isogi_dvr__packet p;
    isogi_dvr__fast_run run[ISOGI_DVR__RAYS];
    int k, a, i, count;
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        for (a = 0; a < 3; a++) {
            float x = r[k].dir[a];
            p.origin[a][k] = r[k].origin[a], p.dir[a][k] = x, p.inverse[a][k] = fabsf(x) > 1e-20f ? x : x > 0 ? 1e-20f : -1e-20f;
        }
        p.next[k] = p.at[k] = 0, p.count[k] = r[k].count;
        memset(&s[k], 0, sizeof s[k]);
        s[k].clear = 1, run[k].tolerance = f->tolerance;
    }
    for (a = 0; a < 3; a++)
        for (k = 0; k < ISOGI_DVR__RAYS; k++) p.inverse[a][k] = 1 / p.inverse[a][k];
    while ((count = f->leap(f->dvr, &p, work)) > 0) {
        for (i = 0; i < count; i++) { /* waiting for memory together */
            int left, stride;
            k = p.found[i], left = p.count[k] - 1 - p.next[k];
            if (left <= 0) { /* the last sample of all */
                p.next[k] = p.at[k] = p.count[k], p.found[i--] = p.found[--count];
                continue;
            }
            stride = s[k].clear < f->dim && left > 2 * (ISOGI_DVR__NODES - 1) ? 2 : 1;
            run[k].first = (float)p.next[k], run[k].stride = (float)stride,
            run[k].pieces = left < ISOGI_DVR__NODES ? left : ISOGI_DVR__NODES - 1;
            run[k].length = r[k].piece * run[k].stride, run[k].last = left < ISOGI_DVR__NODES ? r[k].last_piece : run[k].length;
            p.at[k] = p.next[k] += stride * (ISOGI_DVR__NODES - 1);
        }
        work->samples += (uint64_t)(ISOGI_DVR__NODES * count);
        f->look(f, r, run, p.found, count);
        for (i = 0; i < count; i++) {
            k = p.found[i];
            if (!run[k].some) continue;
            if (f->lamps) isogi_dvr__fast_beside_lamps(f, &r[k], &run[k]);
            f->shade(f, &r[k], &s[k], &run[k], work);
            if (!(s[k].clear > f->end)) p.next[k] = p.at[k] = p.count[k];
        }
    }
}

/* Of a ray from the eye (grid) along `dir` (grid, of world length 1) that ends at `until`; 0 if it misses what is kept of the volume. */
static int isogi_dvr__fast_begin(const isogi_dvr__frame *f, const double origin[3], const double dir[3], double until,
                                 isogi_dvr__fast_ray *r) {
    const isogi_dvr *d = f->dvr;
    double span[2] = {0, until}, piece = f->step * d->spacing, pieces, step, sum = 0;
    int a;
    for (a = 0; a < 3; a++) {
        double inverse = 1 / dir[a], t0 = -origin[a] * inverse, t1 = (d->cells[a] - origin[a]) * inverse;
        if (!(fabs(dir[a]) > 1e-300)) {
            if (!(origin[a] >= 0 && origin[a] <= d->cells[a])) return 0;
            continue;
        }
        if (t0 > t1) inverse = t0, t0 = t1, t1 = inverse;
        if (t0 > span[0]) span[0] = t0;
        if (t1 < span[1]) span[1] = t1;
    }
    if (!(span[0] < span[1]) || !isogi_dvr__clipped(d, origin, dir, span)) return 0;
    pieces = ceil((span[1] - span[0]) * f->per_piece - 1e-6);
    if (!(pieces <= ISOGI_DVR__MAX_SAMPLES)) return 0;
    r->count = (int)pieces + 1;
    for (a = 0; a < 3; a++) {
        r->origin[a] = (float)isogi_dvr__clamp(origin[a] + span[0] * dir[a], d->cells[a]);
        step = dir[a] * piece, r->dir[a] = (float)step, step *= (double)d->grid_scale[a], sum += step * step;
    }
    r->enter = span[0], r->sought = 3e38f, r->reach = sum > 1e-30 ? 1.5f / sqrtf((float)sum) : 0;
    r->piece = f->piece, r->end = (float)((span[1] - span[0]) * f->per_piece);
    r->last_piece = (float)isogi_dvr__clamp((span[1] - span[0] - (pieces - 1) * piece) * f->per_unit, 1e30);
    return 1;
}

/* ==== pictures ======================================================================================================= */

static int isogi_dvr__unit(double v[3]) {
    double length = sqrt(isogi_dvr__dot(v, v));
    int a;
    if (!(length > 1e-100) || !(length < 1e100)) return 0; /* of floats: any but zero */
    for (a = 0; a < 3; a++) v[a] /= length;
    return 1;
}

/* Directions of the rays, not yet unit vectors: forward + across * right + down * under. */
typedef struct isogi_dvr__camera { double forward[3], right[3], under[3], half; } isogi_dvr__camera;

static void isogi_dvr__set_camera(isogi_dvr__camera *c, const isogi_view *view) {
    double up[3], fov = view->fov > 0 ? (double)view->fov : 45;
    int a, given = 0;
    for (a = 0; a < 3; a++) {
        c->forward[a] = (double)view->target[a] - (double)view->eye[a], up[a] = (double)view->up[a];
        given |= view->up[a] > 0 || view->up[a] < 0;
    }
    if (!given) up[1] = 1;
    if (!isogi_dvr__unit(c->forward)) c->forward[0] = c->forward[1] = 0, c->forward[2] = -1;
    isogi_dvr__unit(up);
    isogi_dvr__cross(c->forward, up, c->right);
    if (!(isogi_dvr__dot(c->right, c->right) > 1e-12)) {
        /* along the line of sight: the axis that is farthest from it */
        int axis = fabs(c->forward[1]) < 0.8 ? 1 : 2;
        for (a = 0; a < 3; a++) up[a] = a == axis;
        isogi_dvr__cross(c->forward, up, c->right);
    }
    isogi_dvr__unit(c->right);
    isogi_dvr__cross(c->forward, c->right, c->under);
    c->half = tan(fov * (ISOGI_DVR__PI / 360));
}

/* Across and down from the middle of the picture, in units of forward. */
static void isogi_dvr__camera_place(const isogi_dvr__camera *c, const isogi_view *view, double x, double y, double out[2]) {
    out[0] = (2 * (x + 0.5) - view->width) / view->height * c->half, out[1] = (2 * (y + 0.5) / view->height - 1) * c->half;
}

static void isogi_dvr__camera_ray(const isogi_dvr__camera *c, const isogi_view *view, double x, double y, double d[3]) {
    double at[2];
    int a;
    isogi_dvr__camera_place(c, view, x, y, at);
    for (a = 0; a < 3; a++) d[a] = c->forward[a] + at[0] * c->right[a] + at[1] * c->under[a];
    if (!isogi_dvr__unit(d)) memcpy(d, c->forward, 3 * sizeof *d);
}

ISOGI_API void isogi_view_ray(const isogi_view *view, double x, double y, double origin[3], float dir[3]) {
    isogi_dvr__camera camera;
    double d[3];
    int a;
    isogi_dvr__set_camera(&camera, view);
    isogi_dvr__camera_ray(&camera, view, x, y, d);
    for (a = 0; a < 3; a++) origin[a] = (double)view->eye[a], dir[a] = (float)d[a];
}

static const char *isogi_dvr__view_fault(const isogi_view *view, isogi_result *code) {
    size_t i, pixels;
    *code = ISOGI_INVALID;
    if (!view) return "view: NULL";
    if (view->width < 1 || view->height < 1) return "width, height: below 1";
    if (view->width > 32768 || view->height > 32768) return *code = ISOGI_TOO_LARGE, "width, height: above 32768";
    if (!isogi_dvr__finite3(view->eye)) return "eye: not finite";
    if (!isogi_dvr__finite3(view->target)) return "target: not finite";
    if (!isogi_dvr__finite3(view->up)) return "up: not finite";
    if (!isogi_dvr__finite32(view->fov) || !(view->fov >= 0 && view->fov < 180)) return "fov: not 0 .. below 180 (degrees)";
    if ((unsigned)view->depth > ISOGI_DEPTH_FIRST) return "depth: none of isogi_depth_kind";
    if ((unsigned)view->local > 1) return "local: not 0 or 1";
    pixels = view->until ? (size_t)view->width * (size_t)view->height : 0;
    for (i = 0; i < pixels; i++)
        if (isogi_dvr__nan32(view->until[i])) return "until: not a number";
    *code = ISOGI_OK;
    return NULL;
}

ISOGI_API const char *isogi_view_fault(const isogi_view *view) {
    isogi_result code;
    return isogi_dvr__view_fault(view, &code);
}

static isogi_result isogi_dvr__check_view(const isogi_view *view) {
    isogi_result code;
    isogi_dvr__view_fault(view, &code);
    return code;
}

/* The distance from the eye at which the ray of a pixel ends. */
static double isogi_dvr__until(const isogi_view *view, int x, int y) {
    double until = view->until ? (double)view->until[(size_t)y * (size_t)view->width + (size_t)x] : 1e300;
    return until < 1e300 ? until : 1e300;
}

/* The transmittance at whose passing the depth of a pixel is read; below 1 by the least that a double knows. */
static double isogi_dvr__depth_end(const isogi_view *view, double clear) {
    double end = 1 - (view->depth == ISOGI_DEPTH_FIRST ? 1.0 / 1099511627776.0 : 0.5) * (1 - clear), most = 1 - 1.0 / 9007199254740992.0;
    return end < most ? end : most;
}

typedef struct isogi_dvr__render_job {
    const isogi_dvr *dvr;
    const isogi_view *view;
    isogi_dvr__lights lights;
    int eight;                  /* rays go eight at once */
    isogi_dvr__frame_job fast;  /* where frame.classes */
    isogi_dvr__camera camera, grid; /* grid: directions of the same rays there */
    double eye[3]; /* grid */
    size_t across, tiles;
    float *pixels; /* [height*width][5]: colour, opacity, depth */
    int depth;     /* wanted */
    isogi_counters *work;
} isogi_dvr__render_job;

/* A pixel and its ray; 0 if it misses the volume. */
static int isogi_dvr__begin_pixel(const isogi_dvr__render_job *job, int x, int y, isogi_dvr__pixel_ray *ray, isogi_dvr__march *march,
                                  isogi_counters *work) {
    const isogi_dvr *d = job->dvr;
    float *out = job->pixels + 5 * ((size_t)y * (size_t)job->view->width + (size_t)x);
    double dir[3];
    int a;
    for (a = 0; a < 4; a++) out[a] = 0;
    out[4] = HUGE_VALF;
    work->rays++;
    memset(ray, 0, sizeof *ray);
    isogi_dvr__camera_ray(&job->camera, job->view, x, y, ray->along);
    for (a = 0; a < 3; a++) ray->dir[a] = (float)ray->along[a];
    isogi_dvr__transform(d->to_grid, ray->along, dir);
    memcpy(ray->grid_dir, dir, sizeof dir);
    if (!isogi_dvr__begin(march, d, job->eye, dir, 1, isogi_dvr__until(job->view, x, y), d->desc.step)) return 0;
    march->silhouette = d->desc.silhouette, march->unlit = d->desc.shading == ISOGI_DVR_UNLIT;
    isogi_dvr__jitter(march, d->desc.jitter, x, y);
    ray->dvr = d, ray->lights = &job->lights, ray->clear = 1, ray->end = 1 - (double)d->desc.opaque;
    return 1;
}

static void isogi_dvr__cast_pixel(const isogi_dvr__render_job *job, isogi_dvr__pixel_ray *ray, isogi_dvr__march *march,
                                  isogi_dvr__crossings *crossings) {
    double eye[3];
    int a;
    for (a = 0; a < 3; a++) eye[a] = (double)job->view->eye[a];
    if (!isogi_dvr__by_piece(job->dvr)) isogi_dvr__begin_crossings(crossings, job->dvr, eye, ray->along, march);
    isogi_dvr__cast(ray, march, crossings);
}

/* What a ray has brought; for its depth it goes once more, without colours, to the place that is asked for. */
static void isogi_dvr__end_pixel(const isogi_dvr__render_job *job, int x, int y, isogi_dvr__pixel_ray *ray, isogi_dvr__march *again,
                                 isogi_dvr__crossings *crossings) {
    float *out = job->pixels + 5 * ((size_t)y * (size_t)job->view->width + (size_t)x);
    int a;
    for (a = 0; a < 3; a++) out[a] = (float)isogi_dvr__clamp(ray->rgb[a], 3e38);
    out[3] = (float)(1 - ray->clear);
    if (!job->depth || !(ray->clear < 1)) return;
    ray->probe = 1, ray->end = isogi_dvr__depth_end(job->view, ray->clear), ray->clear = 1;
    isogi_dvr__cast_pixel(job, ray, again, crossings);
    out[4] = (float)((again->enter + ray->t) * again->speed);
}

static void isogi_dvr__render_pixel(const isogi_dvr__render_job *job, int x, int y, isogi_dvr__crossings *crossings, isogi_counters *work) {
    isogi_dvr__pixel_ray ray;
    isogi_dvr__march march, again;
    if (!isogi_dvr__begin_pixel(job, x, y, &ray, &march, work)) return;
    again = march;
    isogi_dvr__cast_pixel(job, &ray, &march, crossings);
    isogi_dvr__add(work, &march.work);
    if (!isogi_dvr__by_piece(job->dvr)) isogi_dvr__add(work, &crossings->work);
    isogi_dvr__end_pixel(job, x, y, &ray, &again, crossings);
}

#ifdef ISOGI_DVR__AVX
/* Four pixels by two. */
ISOGI_DVR__APART void isogi_dvr__render_eight(const isogi_dvr__render_job *job, int x0, int y0, isogi_dvr__crossings *crossings,
                                              isogi_counters *work) {
    isogi_dvr__pixel_ray ray[8];
    isogi_dvr__march march[8];
    isogi_dvr__eight e;
    unsigned hit;
    int k;
    memset(&e, 0, sizeof e);
    e.end = 1 - (double)job->dvr->desc.opaque;
    for (k = 0; k < 8; k++) {
        int x = x0 + k % 4, y = y0 + k / 4;
        if (x < job->view->width && y < job->view->height && isogi_dvr__begin_pixel(job, x, y, &ray[k], &march[k], work))
            isogi_dvr__begin_eight(&e, k, &march[k]);
    }
    hit = job->dvr->transparent ? 0 : e.going, e.going = hit;
    isogi_dvr__cast_eight(job->dvr, job->fast.frame.sample_kind, job->fast.frame.last_word, &e, work);
    for (k = 0; k < 8; k++) {
        if (!(hit >> k & 1)) continue;
        memcpy(ray[k].rgb, e.layer[k].rgb, sizeof ray[k].rgb), ray[k].clear = e.layer[k].clear;
        isogi_dvr__end_pixel(job, x0 + k % 4, y0 + k / 4, &ray[k], &march[k], crossings);
    }
}
#endif

/* Depth of a packet: once without a limit, for the depth in all, of which 1 - clear has no digits when it is little; and once more to the
   place that is asked for. */
static void isogi_dvr__depth_fast(const isogi_dvr__render_job *job, isogi_dvr__fast_ray ray[ISOGI_DVR__RAYS],
                                  float depth[ISOGI_DVR__RAYS], isogi_counters *work) {
    isogi_dvr__frame probe = job->fast.frame;
    isogi_dvr__fast_state state[ISOGI_DVR__RAYS];
    int k;
    probe.shade = isogi_dvr__fast_probe;
    isogi_dvr__fast_cast(&probe, ray, state, work);
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        double share = job->view->depth == ISOGI_DEPTH_FIRST ? 1.0 / 1099511627776.0 : 0.5;
        depth[k] = HUGE_VALF;
        if (!(state[k].depth > 0)) ray[k].count = 0;
        ray[k].sought = (float)-log1p(share * expm1(-(double)state[k].depth));
    }
    isogi_dvr__fast_cast(&probe, ray, state, work);
    for (k = 0; k < ISOGI_DVR__RAYS; k++)
        if (ray[k].count) depth[k] = (float)(ray[k].enter + (double)state[k].place * probe.step * job->dvr->spacing);
}

#ifdef ISOGI_DVR__AVX
#define ISOGI_DVR__AVX512 __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,fma"))) static
#define ISOGI_DVR__8(x) _mm512_set1_pd(x)
/* Directions of eight pixels in a row (grid, of world length 1). */
ISOGI_DVR__AVX512 void isogi_dvr__toward_avx512(const isogi_dvr__render_job *job, int x0, int y, double dir[3][8]) {
    const isogi_dvr__camera *c = &job->grid;
    const __m512d one = ISOGI_DVR__8(1);
    __m512d across, inverse;
    double at[2];
    int a;
    isogi_dvr__camera_place(&job->camera, job->view, x0, y, at);
    across = _mm512_add_pd(_mm512_setr_pd(0, 1, 2, 3, 4, 5, 6, 7), ISOGI_DVR__8(x0 + 0.5));
    across = _mm512_sub_pd(_mm512_mul_pd(ISOGI_DVR__8(2), across), ISOGI_DVR__8(job->view->width));
    across = _mm512_mul_pd(_mm512_div_pd(across, ISOGI_DVR__8(job->view->height)), ISOGI_DVR__8(job->camera.half));
    inverse = _mm512_add_pd(_mm512_add_pd(one, _mm512_mul_pd(across, across)), ISOGI_DVR__8(at[1] * at[1]));
    inverse = _mm512_div_pd(one, _mm512_maskz_sqrt_pd(255, inverse));
    for (a = 0; a < 3; a++) {
        __m512d x = _mm512_add_pd(ISOGI_DVR__8(c->forward[a]), _mm512_mul_pd(across, ISOGI_DVR__8(c->right[a])));
        _mm512_storeu_pd(dir[a], _mm512_mul_pd(_mm512_add_pd(x, ISOGI_DVR__8(at[1] * c->under[a])), inverse));
    }
}

/* As isogi_dvr__fast_begin of eight rays, without clip planes; others than those that hit have a count of 0. */
ISOGI_DVR__AVX512 void isogi_dvr__begin_avx512(const isogi_dvr__frame *f, const double origin[3], const double dir[3][8],
                                               const double until[8], isogi_dvr__fast_ray r[8]) {
    const isogi_dvr *d = f->dvr;
    const __m512d zero = _mm512_setzero_pd(), one = ISOGI_DVR__8(1), piece = ISOGI_DVR__8(f->step * d->spacing);
    __m512d enter = zero, leave = _mm512_loadu_pd(until), sum = zero, pieces, last;
    float place[3][8], step[3][8], reach[8], end[8], last_piece[8];
    double begin[8];
    int32_t count[8];
    __mmask8 hit = 255;
    int a, k;
    for (a = 0; a < 3; a++) {
        const __m512d along = _mm512_loadu_pd(dir[a]), inverse = _mm512_div_pd(one, along);
        const __m512d t0 = _mm512_mul_pd(ISOGI_DVR__8(-origin[a]), inverse),
                      t1 = _mm512_mul_pd(ISOGI_DVR__8(d->cells[a] - origin[a]), inverse);
        const __mmask8 goes = _mm512_cmp_pd_mask(_mm512_andnot_pd(ISOGI_DVR__8(-0.0), along), ISOGI_DVR__8(1e-300), _CMP_GT_OQ);
        if (!(origin[a] >= 0 && origin[a] <= d->cells[a])) hit = (__mmask8)(hit & goes);
        enter = _mm512_mask_max_pd(enter, goes, _mm512_maskz_min_pd(255, t0, t1), enter);
        leave = _mm512_mask_min_pd(leave, goes, _mm512_maskz_max_pd(255, t0, t1), leave);
    }
    last = _mm512_sub_pd(leave, enter), pieces = _mm512_mul_pd(last, ISOGI_DVR__8(f->per_piece));
    _mm256_storeu_ps(end, _mm512_maskz_cvtpd_ps(255, pieces));
    pieces = _mm512_ceil_pd(_mm512_sub_pd(pieces, ISOGI_DVR__8(1e-6)));
    hit = (__mmask8)(hit & _mm512_cmp_pd_mask(enter, leave, _CMP_LT_OQ) & _mm512_cmp_pd_mask(leave, ISOGI_DVR__8(1e300), _CMP_LT_OQ) &
                     _mm512_cmp_pd_mask(pieces, ISOGI_DVR__8(ISOGI_DVR__MAX_SAMPLES), _CMP_LE_OQ));
    for (a = 0; a < 3; a++) {
        __m512d x = _mm512_loadu_pd(dir[a]), at = _mm512_add_pd(ISOGI_DVR__8(origin[a]), _mm512_mul_pd(enter, x));
        at = _mm512_maskz_min_pd(255, _mm512_maskz_max_pd(255, at, zero), ISOGI_DVR__8(d->cells[a])), x = _mm512_mul_pd(x, piece);
        _mm256_storeu_ps(place[a], _mm512_maskz_cvtpd_ps(255, at)), _mm256_storeu_ps(step[a], _mm512_maskz_cvtpd_ps(255, x));
        x = _mm512_mul_pd(x, ISOGI_DVR__8((double)d->grid_scale[a])), sum = _mm512_add_pd(sum, _mm512_mul_pd(x, x));
    }
    _mm256_storeu_ps(reach, _mm256_maskz_div_ps(_mm512_cmp_pd_mask(sum, ISOGI_DVR__8(1e-30), _CMP_GT_OQ), _mm256_set1_ps(1.5f),
                                                _mm256_sqrt_ps(_mm512_maskz_cvtpd_ps(255, sum))));
    last = _mm512_sub_pd(last, _mm512_mul_pd(_mm512_sub_pd(pieces, one), piece));
    last = _mm512_maskz_max_pd(255, _mm512_mul_pd(last, ISOGI_DVR__8(f->per_unit)), zero);
    _mm256_storeu_ps(last_piece, _mm512_maskz_cvtpd_ps(255, _mm512_maskz_min_pd(255, last, ISOGI_DVR__8(1e30))));
    _mm512_storeu_pd(begin, enter);
    _mm256_storeu_si256((__m256i *)(void *)count, _mm512_maskz_cvttpd_epi32(hit, _mm512_add_pd(pieces, one)));
    for (k = 0; k < 8; k++) {
        for (a = 0; a < 3; a++) r[k].origin[a] = place[a][k], r[k].dir[a] = step[a][k];
        r[k].enter = begin[k], r[k].sought = 3e38f, r[k].reach = reach[k], r[k].piece = f->piece;
        r[k].end = end[k], r[k].last_piece = last_piece[k], r[k].count = count[k];
    }
}
#undef ISOGI_DVR__8
#undef ISOGI_DVR__AVX512
#endif

/* The rays of a packet. */
static void isogi_dvr__begin_packet(const isogi_dvr__render_job *job, int x0, int y0, isogi_dvr__fast_ray ray[ISOGI_DVR__RAYS],
                                    isogi_counters *work) {
    int k, a;
#ifdef ISOGI_DVR__AVX
    if (job->fast.frame.eight && x0 + 8 <= job->view->width && y0 + ISOGI_DVR__RAYS / 8 <= job->view->height) {
        double dir[3][8], until[8];
        for (k = 0; k < ISOGI_DVR__RAYS; k += 8) {
            for (a = 0; a < 8; a++) until[a] = isogi_dvr__until(job->view, x0 + a, y0 + k / 8);
            isogi_dvr__toward_avx512(job, x0, y0 + k / 8, dir);
            isogi_dvr__begin_avx512(&job->fast.frame, job->eye, (const double(*)[8])dir, until, ray + k);
        }
        work->rays += ISOGI_DVR__RAYS;
        return;
    }
#endif
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        int x = x0 + k % 8, y = y0 + k / 8;
        double at[2], dir[3], inverse;
        memset(&ray[k], 0, sizeof ray[k]);
        if (x >= job->view->width || y >= job->view->height) continue;
        work->rays++;
        if (job->dvr->transparent) continue;
        isogi_dvr__camera_place(&job->camera, job->view, x, y, at);
        inverse = 1 / sqrt(1 + at[0] * at[0] + at[1] * at[1]); /* the camera's directions are at right angles */
        for (a = 0; a < 3; a++) dir[a] = (job->grid.forward[a] + at[0] * job->grid.right[a] + at[1] * job->grid.under[a]) * inverse;
        if (!isogi_dvr__fast_begin(&job->fast.frame, job->eye, dir, isogi_dvr__until(job->view, x, y), &ray[k])) ray[k].count = 0;
    }
}

/* A packet: eight by four pixels. */
ISOGI_DVR__APART void isogi_dvr__render_fast(const isogi_dvr__render_job *job, int x0, int y0, isogi_counters *work) {
    isogi_dvr__fast_ray ray[ISOGI_DVR__RAYS];
    isogi_dvr__fast_state state[ISOGI_DVR__RAYS];
    float depth[ISOGI_DVR__RAYS];
    int k, a;
    isogi_dvr__begin_packet(job, x0, y0, ray, work);
    isogi_dvr__fast_cast(&job->fast.frame, ray, state, work);
    if (job->depth) isogi_dvr__depth_fast(job, ray, depth, work);
    for (k = 0; k < ISOGI_DVR__RAYS; k++) {
        int x = x0 + k % 8, y = y0 + k / 8;
        float *out = job->pixels + 5 * ((size_t)y * (size_t)job->view->width + (size_t)x);
        if (x >= job->view->width || y >= job->view->height) continue;
        for (a = 0; a < 3; a++) out[a] = state[k].out[a] < 3e38f ? state[k].out[a] : 3e38f;
        out[3] = state[k].clear < 0.999f ? 1 - state[k].clear : state[k].out[3], out[4] = job->depth ? depth[k] : HUGE_VALF;
    }
}

static void isogi_dvr__render_task(void *arg, size_t tile) {
    const isogi_dvr__render_job *job = (const isogi_dvr__render_job *)arg;
    int x0 = (int)(tile % job->across) * ISOGI_DVR__TILE, y0 = (int)(tile / job->across) * ISOGI_DVR__TILE, x, y;
    isogi_dvr__crossings crossings;
    isogi_counters work;
    int wide = job->fast.frame.classes ? 8 : job->eight ? 4 : 1, high = job->fast.frame.classes ? 4 : job->eight ? 2 : 1; /* a packet */
    memset(&work, 0, sizeof work);
    for (y = y0; y < y0 + ISOGI_DVR__TILE && y < job->view->height; y += high)
        for (x = x0; x < x0 + ISOGI_DVR__TILE && x < job->view->width; x += wide) {
            if (job->fast.frame.classes) isogi_dvr__render_fast(job, x, y, &work);
#ifdef ISOGI_DVR__AVX
            else if (job->eight) isogi_dvr__render_eight(job, x, y, &crossings, &work);
#endif
            else isogi_dvr__render_pixel(job, x, y, &crossings, &work);
        }
    job->work[tile] = work;
}

/* Voxels that vectors can read: 0 float, 1 uint8, 2 uint16; -1 another type or layout. last_word: byte offset of the last four bytes. */
static int isogi_dvr__sample_kind(const isogi_volume *v, const int cells[3], uint32_t *last_word) {
    int kind = v->type == ISOGI_F32 ? 0 : v->type == ISOGI_U8 ? 1 : v->type == ISOGI_U16 ? 2 : -1;
    double bytes =
        (double)v->stride[0] * (double)cells[0] + (double)v->stride[1] * (double)cells[1] + (double)v->stride[2] * (double)cells[2];
    if (kind < 0 || v->stride[0] != (kind ? kind : 4) || v->stride[1] <= 0 || v->stride[2] <= 0 || !(bytes > 8 && bytes < 2e9)) return -1;
    *last_word = (uint32_t)bytes + (uint32_t)v->stride[0] - 4;
    return kind;
}

/* Tables of a picture on the path of physical space; nothing where another path is asked for. */
static isogi_result isogi_dvr__begin_frame(isogi_dvr__render_job *job) {
    const isogi_dvr *d = job->dvr;
    const isogi_volume *v = &d->volume;
    isogi_dvr__frame *f = &job->fast.frame;
    double eye[3], blocks, low, scale;
    size_t points = isogi_dvr__held_points(d);
    isogi_result result;
    int a;
    isogi_dvr__set_camera(&job->camera, job->view);
    for (a = 0; a < 3; a++) eye[a] = (double)job->view->eye[a];
    isogi_vol_to_grid(d->desc.pyramid, eye, job->eye);
    isogi_dvr__transform(d->to_grid, job->camera.forward, job->grid.forward);
    isogi_dvr__transform(d->to_grid, job->camera.right, job->grid.right);
    isogi_dvr__transform(d->to_grid, job->camera.under, job->grid.under);
    blocks = (double)d->level[0].size[0] * (double)d->level[0].size[1] * (double)d->level[0].size[2];
    f->sample_kind = isogi_dvr__sample_kind(v, d->cells, &f->last_word);
#ifdef ISOGI_DVR__AVX
    if (f->sample_kind >= 0 && isogi_dvr__joined(d) && isogi_dvr__machine() >= 4 &&
        (d->context.force_path <= 0 || d->context.force_path > 3))
        job->eight = blocks < 2e9 && d->cells[0] && d->cells[1] && d->cells[2] && fabs(v->scale) < 1e200 && fabs(v->bias) < 1e200;
#endif
    f->count = isogi_dvr__count_classes(d, &low, &scale);
    if (!isogi_dvr__fast_space(d) || job->lights.local || !isogi_dvr__floats_tell(d, low, scale, (double)f->count / scale))
        return ISOGI_OK;
    f->dvr = d, f->step = d->piece, f->look = isogi_dvr__fast_look, f->shade = isogi_dvr__fast_shade, f->glow = (float)d->desc.emission;
    f->end = 1 - d->desc.opaque, f->dim = 0.125f;
    f->leap = blocks < 2e9 ? d->kernels.leap : isogi_dvr__leap;
    for (a = 0; a < 3; a++) /* voxels of a piece, at most */
        if (f->step * d->spacing * sqrt(isogi_dvr__dot(d->to_grid + 3 * a, d->to_grid + 3 * a)) > 3.999) f->leap = isogi_dvr__leap_none;
    f->tolerance = d->desc.tolerance > 0 ? (float)d->desc.tolerance : 0.5f;
    f->per_piece = 1 / (f->step * d->spacing);
    /* no infinity: that times no extinction would be no number */
    f->per_unit = isogi_dvr__clamp(1 / d->desc.unit, 1e300), f->piece = (float)isogi_dvr__clamp(f->step * d->spacing / d->desc.unit, 1e30);
#ifdef ISOGI_DVR__AVX
    if (f->sample_kind >= 0 && isogi_dvr__machine() >= 3 && (d->context.force_path <= 0 || d->context.force_path > 2) &&
        points < 0x7fffffff && d->held.total < 0x0fffffff)
        f->look = isogi_dvr__look_avx2, f->shade = isogi_dvr__fast_shade_avx2;
    if (f->look == isogi_dvr__look_avx2 && isogi_dvr__machine() >= 4 && (d->context.force_path <= 0 || d->context.force_path > 3))
        f->look = isogi_dvr__look_avx512, f->eight = !d->clip_count && !d->transparent;
#endif
    f->classes = (isogi_dvr__class_entry *)isogi_allocate(&d->context, f->count, sizeof *f->classes);
    f->matter = (isogi_dvr__matter_entry *)isogi_allocate(&d->context, f->count, sizeof *f->matter);
    if (!f->classes || !f->matter) return ISOGI_NO_MEMORY;
    isogi_dvr__frame_classes(f, low, scale);
    for (a = 0; a < 3; a++) f->cells[a] = (float)d->cells[a], f->last_cell[a] = d->cells[a] - 1;
    for (a = 0; f->sample_kind >= 0 && a < 3; a++) f->stride[a] = (int32_t)v->stride[a];
    if (d->desc.shading == ISOGI_DVR_UNLIT) {
        f->glow = 0;
        return ISOGI_OK;
    }
    f->light = (float(*)[4])isogi_allocate(&d->context, points + 1, sizeof *f->light); /* one more, for a grid of one point along x */
    if (!f->light) return ISOGI_NO_MEMORY;
    memset(f->light[points], 0, sizeof *f->light);
    scale = 1.5 * 1.7321 * d->distance[1] * d->spacing * f->per_unit; /* no reach is larger, whatever the axes, */
    for (a = 0; a < 3; a++)
        if (d->desc.grid[a] < 2) scale = 1e30; /* but along one with a single point, where it has no end */
    if (isogi_dvr__by_openness(1, isogi_dvr__stand_off(1, scale * isogi_dvr__most(&d->transfer, d->range[0], d->range[1]))) > 0) {
        f->open = (float(*)[4])isogi_allocate(&d->context, points + 1, sizeof *f->open);
        if (!f->open) return ISOGI_NO_MEMORY;
        memset(f->open[points], 0, sizeof *f->open);
    }
    f->held = d->held;
    job->fast.lights = &job->lights;
    f->lamps = job->lights.nearby.light_count ? &job->lights : NULL;
    f->light_row[0] = 4 * d->desc.grid[0], f->light_row[1] = f->light_row[0] * d->desc.grid[1];
    for (a = 0; a < 3; a++) {
        f->light_scale[a] = d->grid_scale[a], f->light_last[a] = d->desc.grid[a] > 2 ? (int32_t)(d->desc.grid[a] - 2) : 0;
        f->light_stride[a] = d->desc.grid[a] < 2 ? 0 : a ? f->light_row[a - 1] : 4;
    }
    result = isogi_parallel(&d->context, (points + ISOGI_DVR__GAIN - 1) / ISOGI_DVR__GAIN, isogi_dvr__frame_light, &job->fast, 0, 0);
    if (result == ISOGI_OK && f->held.block) isogi_dvr__join(d, &f->held, f->light[0], 4);
    if (result == ISOGI_OK && f->held.block && f->open) isogi_dvr__join(d, &f->held, f->open[0], 4);
    return result;
}

static void isogi_dvr__end_frame(isogi_dvr__render_job *job) {
    const isogi_context *context = &job->dvr->context;
    isogi_dvr__frame *f = &job->fast.frame;
    isogi_release(context, f->classes, f->count, sizeof *f->classes);
    isogi_release(context, f->matter, f->count, sizeof *f->matter);
    isogi_release(context, f->light, isogi_dvr__held_points(job->dvr) + 1, sizeof *f->light);
    isogi_release(context, f->open, isogi_dvr__held_points(job->dvr) + 1, sizeof *f->open);
}

/* The picture is finished in memory of its own: a cancelled call leaves its outputs as they were. */
ISOGI_API isogi_result isogi_dvr_render(const isogi_dvr *dvr, const isogi_view *view, const isogi_lighting *lighting,
                                        float (*premultiplied)[4], float *depth, isogi_counters *counters) {
    isogi_dvr__render_job job;
    isogi_result result = isogi_dvr__check_view(view);
    size_t pixels, i;
    if (!dvr || !premultiplied) return ISOGI_INVALID;
    if (result != ISOGI_OK) return result;
    if (view->local && !(dvr->blocks.total && dvr->method == ISOGI_DVR_PAPER)) return ISOGI_INVALID;
    memset(&job, 0, sizeof job);
    pixels = (size_t)view->width * (size_t)view->height;
    job.dvr = dvr, job.view = view, job.depth = depth != NULL;
    job.across = ((size_t)view->width + ISOGI_DVR__TILE - 1) / ISOGI_DVR__TILE;
    job.tiles = job.across * (((size_t)view->height + ISOGI_DVR__TILE - 1) / ISOGI_DVR__TILE);
    result = isogi_dvr__set_lights(&job.lights, dvr, lighting);
    job.lights.local = view->local;
    if (result == ISOGI_OK) {
        job.pixels = (float *)isogi_allocate(&dvr->context, pixels, 5 * sizeof *job.pixels);
        job.work = (isogi_counters *)isogi_allocate(&dvr->context, job.tiles, sizeof *job.work);
        if (!job.pixels || !job.work) result = ISOGI_NO_MEMORY;
    }
    if (result == ISOGI_OK) result = isogi_dvr__begin_frame(&job);
    if (result == ISOGI_OK) result = isogi_parallel(&dvr->context, job.tiles, isogi_dvr__render_task, &job, 0, 1);
    for (i = 0; result == ISOGI_OK && i < pixels; i++) {
        memcpy(premultiplied[i], job.pixels + 5 * i, 4 * sizeof(float));
        if (depth) depth[i] = job.pixels[5 * i + 4];
    }
    for (i = 0; result == ISOGI_OK && i < job.tiles; i++) {
        job.work[i].texels = 0;
        isogi_dvr__add(counters, &job.work[i]);
    }
    isogi_dvr__end_frame(&job);
    isogi_release(&dvr->context, job.pixels, pixels, 5 * sizeof *job.pixels);
    isogi_release(&dvr->context, job.work, job.tiles, sizeof *job.work);
    isogi_release(&dvr->context, job.lights.list, job.lights.count, sizeof *job.lights.list);
    return result;
}

/* ---- transfer functions to begin with ---- */

/* The value of point i of `count` that are evenly spaced: in order, too, where low and high are but a few roundings apart. */
static void isogi_dvr__space_point(isogi_transfer_point *points, size_t i, size_t count, double low, double high) {
    double u = (double)i / (double)(count - 1), value = i + 1 < count ? low * (1 - u) + high * u : high;
    value = value < high ? value : high;
    points[i].value = i && value < points[i - 1].value ? points[i - 1].value : value;
}

ISOGI_API isogi_result isogi_transfer_preset(isogi_preset preset, double low, double high, float extinction,
                                             isogi_transfer_point points[ISOGI_PRESET_POINTS]) {
    static const float colour[4][5][3] = {
        {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}},
        {{0, 0, 0}, {0.4f, 0.01f, 0}, {0.9f, 0.12f, 0.01f}, {1, 0.6f, 0.08f}, {1, 1, 0.9f}},
        {{0.05f, 0.08f, 0.55f}, {0.25f, 0.42f, 0.9f}, {0.75f, 0.75f, 0.75f}, {0.85f, 0.3f, 0.18f}, {0.45f, 0.01f, 0.02f}},
        {{0.2f, 0.03f, 0.5f}, {0.03f, 0.2f, 0.85f}, {0.05f, 0.6f, 0.25f}, {0.9f, 0.7f, 0.05f}, {0.75f, 0.05f, 0.03f}}};
    int i, a;
    if (!points || (unsigned)preset > ISOGI_PRESET_SPECTRUM || !isogi_dvr__finite64(low) || !isogi_dvr__finite64(high) ||
        !(low < high)) return ISOGI_INVALID;
    if (!isogi_dvr__finite32(extinction) || !(extinction >= 0)) return ISOGI_INVALID;
    for (i = 0; i < ISOGI_PRESET_POINTS; i++) {
        double u = (double)i / (ISOGI_PRESET_POINTS - 1);
        int at = i / 2 < 3 ? i / 2 : 3;
        float part = (float)(4 * u - at);
        isogi_dvr__space_point(points, (size_t)i, ISOGI_PRESET_POINTS, low, high);
        points[i].extinction = (float)(u * (double)extinction);
        for (a = 0; a < 3; a++) points[i].rgb[a] = colour[preset][at][a] + part * (colour[preset][at + 1][a] - colour[preset][at][a]);
    }
    return ISOGI_OK;
}

static double isogi_dvr__decode_srgb(double x) { return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4); }

ISOGI_API isogi_result isogi_transfer_import(const float (*rgba)[4], size_t count, double low, double high, double length, int flags,
                                             isogi_transfer_point *points) {
    size_t i;
    int a;
    if (!rgba || !points || count < 2 || !isogi_dvr__finite64(low) || !isogi_dvr__finite64(high) || !(low < high)) return ISOGI_INVALID;
    if (!isogi_dvr__finite64(length) || !(length > 0) || (flags & ~(ISOGI_TABLE_SRGB | ISOGI_TABLE_PREMULTIPLIED))) return ISOGI_INVALID;
    for (i = 0; i < count; i++)
        for (a = 0; a < 4; a++)
            if (!isogi_dvr__finite32(rgba[i][a]) || !(rgba[i][a] >= 0 && rgba[i][a] <= 1)) return ISOGI_INVALID;
    for (i = 0; i < count; i++) {
        double opacity = isogi_dvr__clamp((double)rgba[i][3], 1 - 1 / 16777216.0);
        isogi_dvr__space_point(points, i, count, low, high);
        points[i].extinction = (float)isogi_dvr__clamp(-log1p(-opacity) / length, 3e38);
        for (a = 0; a < 3; a++) {
            double x = (double)rgba[i][a];
            if (flags & ISOGI_TABLE_SRGB) x = isogi_dvr__decode_srgb(x);
            if (flags & ISOGI_TABLE_PREMULTIPLIED) x = rgba[i][3] > 0 ? isogi_dvr__clamp(x / (double)rgba[i][3], 1) : 0;
            points[i].rgb[a] = (float)x;
        }
    }
    return ISOGI_OK;
}

#define ISOGI_DVR__BINS 256

/* The two bins at which three classes of least variance part: the largest sum of (sum of values)^2 / count. Each is moved to the middle of
   the empty bins around it; where both fall into one gap, as between two values, the second goes halfway up from the first. The range ends
   in values, be they among those that were counted or not. */
static void isogi_dvr__three_classes(double histogram[ISOGI_DVR__BINS], int bin[2]) {
    double count[ISOGI_DVR__BINS + 1], sum[ISOGI_DVR__BINS + 1], best = -1, total = 0, air = 0;
    int i, j, largest = 0;
    for (i = 0; i < ISOGI_DVR__BINS; i++) total += histogram[i], largest = histogram[i] > histogram[largest] ? i : largest;
    if (histogram[largest] > 0.3 * total) air = histogram[largest], histogram[largest] = 0; /* or padding */
    count[0] = sum[0] = 0, bin[0] = ISOGI_DVR__BINS / 3, bin[1] = 2 * ISOGI_DVR__BINS / 3;
    for (i = 0; i < ISOGI_DVR__BINS; i++) count[i + 1] = count[i] + histogram[i], sum[i + 1] = sum[i] + i * histogram[i];
    for (i = 1; i < ISOGI_DVR__BINS - 1; i++)
        for (j = i + 1; j < ISOGI_DVR__BINS; j++) {
            double n[3], s[3], score = 0;
            int k;
            n[0] = count[i], n[1] = count[j] - count[i], n[2] = count[ISOGI_DVR__BINS] - count[j];
            s[0] = sum[i], s[1] = sum[j] - sum[i], s[2] = sum[ISOGI_DVR__BINS] - sum[j];
            for (k = 0; k < 3; k++) score += n[k] > 0 ? s[k] * s[k] / n[k] : 0;
            if (score > best * (1 + 1e-12)) best = score, bin[0] = i, bin[1] = j;
        }
    histogram[largest] += air;
    for (i = 0; i < 2; i++) {
        int low = bin[i], high = bin[i];
        while (low > 1 && !(histogram[low - 1] > 0)) low--;
        while (high < ISOGI_DVR__BINS - 1 && !(histogram[high] > 0)) high++;
        bin[i] = (low + high) / 2;
        if (i && bin[1] <= bin[0]) bin[1] = (bin[0] + high) / 2;
    }
}

/* Some million voxels of the lattice, at equal distances, of each axis the last ones, too. */
static void isogi_dvr__histogram(const isogi_pyramid *pyramid, const double range[2], double histogram[ISOGI_DVR__BINS]) {
    const isogi_volume *v = isogi_vol_volume(pyramid);
    size_t count[3], i[3];
    int a;
    double scale = ISOGI_DVR__BINS / (0.5 * range[1] - 0.5 * range[0]);
    for (a = 0; a < 3; a++) count[a] = v->size[a] < 101 ? v->size[a] : 101;
    for (a = 0; a < ISOGI_DVR__BINS; a++) histogram[a] = 0;
    for (i[2] = 0; i[2] < count[2]; i[2]++)
        for (i[1] = 0; i[1] < count[1]; i[1]++)
            for (i[0] = 0; i[0] < count[0]; i[0]++) {
                double corner[8], value;
                uint32_t cell[3];
                int which = 0;
                for (a = 0; a < 3; a++) { /* the last voxel is the far corner of the cell before it */
                    const size_t last = v->size[a] - 1, voxel = last ? (size_t)((uint64_t)i[a] * last / (count[a] - 1)) : 0;
                    const int far_corner = voxel > 0 && voxel == last;
                    cell[a] = (uint32_t)voxel - (uint32_t)far_corner, which |= far_corner << a;
                }
                isogi_volume_corners(v, cell, corner), value = corner[which];
                if (!isogi_dvr__finite64(value)) continue;
                histogram[(int)isogi_dvr__clamp((0.5 * value - 0.5 * range[0]) * scale, ISOGI_DVR__BINS - 1)]++;
            }
}

/* low + u (high - low) for 0 <= u <= 1, also where the difference is no finite number. */
static double isogi_dvr__part_way(double low, double high, double u) {
    double half = (0.5 * high - 0.5 * low) * u;
    return low + half + half;
}

/* Leaves out up to a thousandth of the voxels at either end of the range where that halves it; but not where all others have one value,
   to which the range would shrink for ever. */
static void isogi_dvr__leave_outliers(const isogi_pyramid *pyramid, double range[2]) {
    const double all[2] = {range[0], range[1]};
    double histogram[ISOGI_DVR__BINS], share, first;
    int low, high, pass;
    for (pass = 0; pass < 32 && range[0] < range[1]; pass++) {
        double total = 0, below = 0, above = 0;
        isogi_dvr__histogram(pyramid, range, histogram);
        for (low = 0; low < ISOGI_DVR__BINS; low++) total += histogram[low];
        share = 0.001 * total;
        for (low = 0; low < ISOGI_DVR__BINS - 1 && below + histogram[low] <= share; low++) below += histogram[low];
        for (high = ISOGI_DVR__BINS; high > low + 1 && above + histogram[high - 1] <= share; high--) above += histogram[high - 1];
        if (2 * (high - low) > ISOGI_DVR__BINS) return;
        first = range[0], range[0] = isogi_dvr__part_way(first, range[1], (double)low / ISOGI_DVR__BINS);
        if (high < ISOGI_DVR__BINS) range[1] = isogi_dvr__part_way(first, range[1], (double)high / ISOGI_DVR__BINS);
    }
    range[0] = all[0], range[1] = all[1];
}

ISOGI_API isogi_result isogi_transfer_suggest(const isogi_pyramid *pyramid, isogi_dvr_space space,
                                              isogi_transfer_point points[ISOGI_SUGGEST_POINTS], double *threshold) {
    static const float colour[ISOGI_SUGGEST_POINTS][3] = {{0.4f, 0.55f, 0.8f}, {0.4f, 0.55f, 0.8f}, {0.75f, 0.7f, 0.65f},
                                                          {0.85f, 0.75f, 0.6f}, {1, 0.7f, 0.35f},    {1, 0.65f, 0.3f}};
    static const double share[2][ISOGI_SUGGEST_POINTS] = {{0, 0, 0.15, 0.2, 1, 2.2}, {0, 0, 0.3, 0.4, 0.8, 1}};
    double histogram[ISOGI_DVR__BINS], range[2], at[ISOGI_SUGGEST_POINTS], diagonal[3], edge, width, most;
    const isogi_volume *v;
    int bin[2], i, a;
    if (!pyramid || !points || (unsigned)space > ISOGI_DVR_DATA || !isogi_vol_volume(pyramid)->data) return ISOGI_INVALID;
    v = isogi_vol_volume(pyramid), isogi_vol_range(pyramid, range);
    isogi_dvr__leave_outliers(pyramid, range);
    if (!(range[0] < range[1])) bin[0] = ISOGI_DVR__BINS / 3, bin[1] = 2 * bin[0];
    else isogi_dvr__histogram(pyramid, range, histogram), isogi_dvr__three_classes(histogram, bin);
    width = 0.5 * range[1] - 0.5 * range[0];
    at[0] = range[0], at[5] = range[1];
    for (i = 0; i < 2; i++) at[2 + i] = isogi_dvr__part_way(range[0], range[1], (double)bin[i] / ISOGI_DVR__BINS);
    at[1] = isogi_dvr__part_way(at[0], at[2], 0.7), at[4] = isogi_dvr__part_way(at[3], at[5], 0.15);
    edge = isogi_dvr__shortest_edge(v);
    for (a = 0; a < 3; a++) diagonal[a] = (double)v->size[a] * (isogi_dvr__edge(v, a) / edge);
    most = !(width > 0) ? 0 : space == ISOGI_DVR_PHYSICAL ? 0.69 * 30 / sqrt(isogi_dvr__dot(diagonal, diagonal)) : 2 / width;
    for (i = 0; i < ISOGI_SUGGEST_POINTS; i++) {
        points[i].value = i && !(at[i] > at[i - 1]) ? at[i] = at[i - 1] : at[i];
        points[i].extinction = (float)isogi_dvr__clamp(share[space][i] * most, 3e38);
        for (a = 0; a < 3; a++) points[i].rgb[a] = colour[i][a];
    }
    if (threshold) *threshold = at[2];
    return ISOGI_OK;
}
#undef ISOGI_DVR__BINS

/* ==== tetrahedral meshes ============================================================================================= */

#define ISOGI_DVR__NO_FACE 0xffffffffu
#define ISOGI_DVR__LEAF 8   /* faces */
#define ISOGI_DVR__DEEP 48  /* levels of the tree */

/* A box of border faces: two children, next to each other, or a leaf. */
typedef struct isogi_dvr__node {
    float low[3], high[3];
    uint32_t first, count; /* of faces; 0 = the children are nodes first and first + 1 */
} isogi_dvr__node;

/* Face f of a tetrahedron lies opposite of its point f; a face is numbered 4 * tetrahedron + f. */
struct isogi_tets {
    isogi_tet_mesh mesh;
    isogi_context context;
    uint32_t (*tet)[4]; /* positively oriented: det(b-a, c-a, d-a) > 0 */
    uint32_t *across;   /* [4 * tetrahedron + f]: the face on the other side */
    size_t count;       /* of tetrahedra that have a volume */
    uint32_t *border;   /* faces, in the order of the tree's leaves */
    size_t border_count;
    isogi_dvr__node *node;
    size_t node_count, node_capacity;
    double size; /* of the border's box */
};

/* Points of face f, counter-clockwise seen from outside. */
static void isogi_dvr__face_points(const isogi_tets *m, uint32_t face, uint32_t out[3]) {
    static const int corner[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    int i;
    for (i = 0; i < 3; i++) out[i] = m->tet[face >> 2][corner[face & 3][i]];
}

static void isogi_dvr__sub(const float a[3], const double b[3], double out[3]) {
    int i;
    for (i = 0; i < 3; i++) out[i] = (double)a[i] - b[i];
}

static double isogi_dvr__determinant(const double a[3], const double b[3], const double c[3]) {
    double n[3];
    isogi_dvr__cross(a, b, n);
    return isogi_dvr__dot(n, c);
}

/* Takes over the tetrahedra that have a volume, turned so that it is positive. */
static isogi_result isogi_dvr__take_tets(isogi_tets *m, isogi_tet_report *report) {
    const isogi_tet_mesh *mesh = &m->mesh;
    size_t i;
    int a, k;
    for (i = 0; i < mesh->point_count; i++)
        if (!isogi_dvr__finite3(mesh->points[i]) || !isogi_dvr__finite32(mesh->values[i])) return ISOGI_INVALID;
    for (i = 0; i < mesh->tet_count; i++) {
        const uint32_t *t = mesh->tets[i];
        double origin[3], edge[3][3], longest = 0, volume;
        for (k = 0; k < 4; k++)
            if (t[k] >= mesh->point_count) return ISOGI_INVALID;
        for (a = 0; a < 3; a++) origin[a] = (double)mesh->points[t[0]][a];
        for (k = 0; k < 3; k++) isogi_dvr__sub(mesh->points[t[k + 1]], origin, edge[k]);
        for (k = 0; k < 6; k++) { /* from the first point, and between the others */
            double between[3], length;
            for (a = 0; a < 3; a++) between[a] = edge[k % 3][a] - (k < 3 ? 0 : edge[(k + 1) % 3][a]);
            length = isogi_dvr__dot(between, between);
            longest = length > longest ? length : longest;
        }
        longest = sqrt(longest), volume = isogi_dvr__determinant(edge[0], edge[1], edge[2]);
        if (!(fabs(volume) > 1e-13 * longest * longest * longest)) {
            report->degenerate++;
            continue;
        }
        memcpy(m->tet[m->count], t, sizeof m->tet[0]);
        if (volume < 0) m->tet[m->count][2] = t[3], m->tet[m->count][3] = t[2];
        m->count++;
    }
    return ISOGI_OK;
}

/* The points of a face in rising order; returns on which side of them the tetrahedron lies:
   whether an odd number of exchanges were made. */
static int isogi_dvr__face_key(const isogi_tets *m, uint32_t face, uint32_t v[3]) {
    uint32_t swap;
    int odd = 0;
    isogi_dvr__face_points(m, face, v);
    if (v[0] > v[1]) swap = v[0], v[0] = v[1], v[1] = swap, odd = !odd;
    if (v[1] > v[2]) swap = v[1], v[1] = v[2], v[2] = swap, odd = !odd;
    if (v[0] > v[1]) swap = v[0], v[0] = v[1], v[1] = swap, odd = !odd;
    return odd;
}

/* Pairs of faces with the same three points and tetrahedra on either side, through a hash table of faces that are, or once were, alone. A
   tetrahedron that was there before is cut off: its faces lead to themselves. Where others overlap, eight chances are enough. */
static isogi_result isogi_dvr__join_faces(isogi_tets *m, isogi_tet_report *report) {
    size_t slots = 16, faces = 4 * m->count, i;
    uint32_t *table;
    while (slots < 2 * faces) slots *= 2;
    table = (uint32_t *)isogi_allocate(&m->context, slots, sizeof *table);
    if (!table) return ISOGI_NO_MEMORY;
    memset(table, 0xff, slots * sizeof *table);
    for (i = 0; i < faces; i++) {
        uint32_t mine[3], other[3], apex = m->tet[i >> 2][i & 3], across = ISOGI_DVR__NO_FACE;
        int side = isogi_dvr__face_key(m, (uint32_t)i, mine), crowd = 0, again = 0;
        size_t at =
            (size_t)((mine[0] * 0x9e3779b97f4a7c15u ^ mine[1] * 0xbf58476d1ce4e5b9u ^ mine[2] * 0x94d049bb133111ebu) >> 20) & (slots - 1);
        for (; table[at] != ISOGI_DVR__NO_FACE && crowd < 8; at = (at + 1) & (slots - 1)) {
            uint32_t face = table[at], same = face;
            if (isogi_dvr__face_key(m, face, other) != side) same = m->across[face];
            if (memcmp(mine, other, sizeof mine)) continue;
            if (same != ISOGI_DVR__NO_FACE) crowd++, again |= m->tet[same >> 2][same & 3] == apex;
            else if (across == ISOGI_DVR__NO_FACE) across = face;
        }
        m->across[i] = across;
        report->crowded += crowd > 0;
        if (again && !(i & 3)) {
            for (report->crowded += 3, again = 0; again < 4; again++) m->across[i + (size_t)again] = (uint32_t)i + (uint32_t)again;
            i += 3;
        } else if (across != ISOGI_DVR__NO_FACE) m->across[across] = (uint32_t)i;
        else if (table[at] == ISOGI_DVR__NO_FACE) table[at] = (uint32_t)i;
    }
    isogi_release(&m->context, table, slots, sizeof *table);
    for (i = 0; i < faces; i++) report->border += m->across[i] == ISOGI_DVR__NO_FACE;
    return ISOGI_OK;
}

static double isogi_dvr__face_middle(const isogi_tets *m, uint32_t face, int axis) {
    uint32_t p[3];
    isogi_dvr__face_points(m, face, p);
    return ((double)m->mesh.points[p[0]][axis] + (double)m->mesh.points[p[1]][axis] + (double)m->mesh.points[p[2]][axis]) / 3;
}

static void isogi_dvr__bound_faces(const isogi_tets *m, isogi_dvr__node *n) {
    uint32_t i, p[3];
    int a, k;
    for (a = 0; a < 3; a++) n->low[a] = HUGE_VALF, n->high[a] = -HUGE_VALF;
    for (i = n->first; i < n->first + n->count; i++) {
        isogi_dvr__face_points(m, m->border[i], p);
        for (k = 0; k < 3; k++)
            for (a = 0; a < 3; a++) {
                float x = m->mesh.points[p[k]][a];
                n->low[a] = x < n->low[a] ? x : n->low[a], n->high[a] = x > n->high[a] ? x : n->high[a];
            }
    }
}

/* A tree of boxes over the border's faces, cut in the middle of the longest axis; leaves that cannot be cut, or lie too
   deep, stay large. */
static void isogi_dvr__build_tree(isogi_tets *m) {
    uint32_t stack[2 * ISOGI_DVR__DEEP][2];
    int top = 0;
    m->node[0].first = 0, m->node[0].count = (uint32_t)m->border_count, m->node_count = 1;
    isogi_dvr__bound_faces(m, &m->node[0]);
    stack[top][0] = 0, stack[top++][1] = 0;
    while (top) {
        uint32_t depth = stack[--top][1], low, high, children = (uint32_t)m->node_count;
        isogi_dvr__node *n = &m->node[stack[top][0]];
        int axis = 0, a;
        double middle;
        if (n->count <= ISOGI_DVR__LEAF || depth + 2 >= ISOGI_DVR__DEEP || m->node_count + 2 > m->node_capacity) continue;
        for (a = 1; a < 3; a++)
            if (n->high[a] - n->low[a] > n->high[axis] - n->low[axis]) axis = a;
        middle = 0.5 * ((double)n->low[axis] + (double)n->high[axis]);
        for (low = n->first, high = n->first + n->count; low < high;) {
            uint32_t face = m->border[low];
            if (isogi_dvr__face_middle(m, face, axis) < middle) low++;
            else m->border[low] = m->border[--high], m->border[high] = face;
        }
        if (low == n->first || low == n->first + n->count) low = n->first + n->count / 2;
        m->node[children].first = n->first, m->node[children].count = low - n->first;
        m->node[children + 1].first = low, m->node[children + 1].count = n->first + n->count - low;
        n->first = children, n->count = 0, m->node_count += 2;
        for (a = 0; a < 2; a++) {
            isogi_dvr__bound_faces(m, &m->node[children + (uint32_t)a]);
            stack[top][0] = children + (uint32_t)a, stack[top++][1] = depth + 1;
        }
    }
}

ISOGI_API void isogi_dvr_tets_free(isogi_tets *tets) {
    isogi_context context;
    if (!tets) return;
    context = tets->context;
    isogi_release(&context, tets->tet, tets->mesh.tet_count, sizeof *tets->tet);
    isogi_release(&context, tets->across, 4 * tets->count, sizeof *tets->across);
    isogi_release(&context, tets->border, tets->border_count, sizeof *tets->border);
    isogi_release(&context, tets->node, tets->node_capacity, sizeof *tets->node);
    isogi_release(&context, tets, 1, sizeof *tets);
}

static isogi_result isogi_dvr__build_tets(isogi_tets *m, isogi_tet_report *report) {
    isogi_result result;
    size_t i, n = 0;
    int a;
    m->tet = (uint32_t(*)[4])isogi_allocate(&m->context, m->mesh.tet_count, sizeof *m->tet);
    if (m->mesh.tet_count && !m->tet) return ISOGI_NO_MEMORY;
    result = isogi_dvr__take_tets(m, report);
    if (result != ISOGI_OK || !m->count) {
        m->count = 0;
        return result;
    }
    m->across = (uint32_t *)isogi_allocate(&m->context, 4 * m->count, sizeof *m->across);
    if (!m->across) return ISOGI_NO_MEMORY;
    result = isogi_dvr__join_faces(m, report);
    if (result != ISOGI_OK) return result;
    m->border_count = report->border, m->node_capacity = 2 * report->border + 1;
    m->border = (uint32_t *)isogi_allocate(&m->context, m->border_count, sizeof *m->border);
    m->node = (isogi_dvr__node *)isogi_allocate(&m->context, m->node_capacity, sizeof *m->node);
    if ((m->border_count && !m->border) || !m->node) return ISOGI_NO_MEMORY;
    for (i = 0; i < 4 * m->count; i++)
        if (m->across[i] == ISOGI_DVR__NO_FACE) m->border[n++] = (uint32_t)i;
    isogi_dvr__build_tree(m);
    for (a = 0; a < 3 && n; a++) {
        double along = (double)m->node->high[a] - (double)m->node->low[a];
        m->size = along > m->size ? along : m->size;
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_dvr_tets_build(isogi_tets **tets, const isogi_tet_mesh *mesh, isogi_tet_report *report,
                                            const isogi_context *context) {
    isogi_tet_report found;
    isogi_result result;
    isogi_tets *m;
    if (!tets || !mesh || (mesh->point_count && (!mesh->points || !mesh->values)) || (mesh->tet_count && !mesh->tets)) return ISOGI_INVALID;
    if (mesh->tet_count > (size_t)1 << 29) return ISOGI_TOO_LARGE;
    m = (isogi_tets *)isogi_allocate(context, 1, sizeof *m);
    if (!m) return ISOGI_NO_MEMORY;
    memset(m, 0, sizeof *m), memset(&found, 0, sizeof found);
    m->mesh = *mesh;
    if (context) m->context = *context;
    result = isogi_dvr__build_tets(m, &found);
    if (result != ISOGI_OK) {
        isogi_dvr_tets_free(m);
        return result;
    }
    *tets = m;
    if (report) *report = found;
    return ISOGI_OK;
}

/* ---- rays from face to face ---- */

typedef struct isogi_dvr__tet_ray {
    const isogi_tets *mesh;
    const isogi_tet_desc *desc;
    double origin[3], dir[3], speed;
    double until;    /* t at which it ends */
    double t, value; /* where the ray is, and the field there */
    int chained; /* 2: from the tetrahedron next to this one; 1: over a seam; 0: not at all */
    int unsure;  /* whether rounding decided how it passes an edge or a point of the border */
    uint64_t passed;
} isogi_dvr__tet_ray;

/* t at which the ray passes the plane of a face, and the rate at which it does: positive on the way out. */
static double isogi_dvr__face_t(const isogi_dvr__tet_ray *r, const uint32_t p[3], double *rate) {
    const float(*points)[3] = r->mesh->mesh.points;
    double a[3], b[3], c[3], u[3], v[3], n[3];
    int i;
    isogi_dvr__sub(points[p[0]], r->origin, a), isogi_dvr__sub(points[p[1]], r->origin, b), isogi_dvr__sub(points[p[2]], r->origin, c);
    for (i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i];
    isogi_dvr__cross(u, v, n);
    *rate = isogi_dvr__dot(n, r->dir);
    return isogi_dvr__dot(n, a) / *rate;
}

/* Which side of the line from point p to point q the ray passes. Both faces of these two ask with the same numbers, and "upon it" is
   answered as for a ray turned by a little towards x, by less towards y, by yet less towards z: it hits exactly one face of a closed
   border. Where turning decides nothing, as the eye is in line with p and q, the eye is moved in the same way, by yet less. Next to a
   line it is rounding that decides, and `unsure` is set: where several meet in a point, each of them decides for itself. */
static int isogi_dvr__left_of(const isogi_dvr__tet_ray *r, uint32_t p, uint32_t q, int *unsure) {
    const float *from = r->mesh->mesh.points[p < q ? p : q], *to = r->mesh->mesh.points[p < q ? q : p];
    const int turned = p > q;
    double a[3], edge[3], n[3], side;
    int axis;
    isogi_dvr__sub(from, r->origin, a);
    for (axis = 0; axis < 3; axis++) edge[axis] = (double)to[axis] - (double)from[axis];
    isogi_dvr__cross(a, edge, n);
    side = isogi_dvr__dot(n, r->dir);
    *unsure = isogi_dvr__dot(n, n) > 0 &&
              side * side <= 1e-28 * isogi_dvr__dot(a, a) * isogi_dvr__dot(edge, edge) * isogi_dvr__dot(r->dir, r->dir);
    for (axis = 0; axis < 3 && !(side > 0 || side < 0); axis++) side = n[axis];
    if (side > 0 || side < 0) return (side > 0) != turned;
    isogi_dvr__cross(r->dir, edge, n);
    for (axis = 0; axis < 3 && !(side > 0 || side < 0); axis++) side = n[axis];
    return (side > 0) != turned;
}

static int isogi_dvr__hits_box(const isogi_dvr__tet_ray *r, const isogi_dvr__node *n, double from, double to) {
    int a;
    for (a = 0; a < 3; a++) {
        double low = (double)n->low[a] - r->origin[a], high = (double)n->high[a] - r->origin[a], slack = 1e-9 * (fabs(low) + fabs(high)),
               t0, t1;
        if (!(fabs(r->dir[a]) > 1e-300)) {
            if (low > slack || high < -slack) return 0;
            continue;
        }
        t0 = (low - slack) / r->dir[a], t1 = (high + slack) / r->dir[a];
        if (t0 > t1) low = t0, t0 = t1, t1 = low;
        from = t0 > from ? t0 : from, to = t1 < to ? t1 : to;
    }
    return from <= to;
}

/* The next border face that leads in (way -1) or out (+1) after (t, face), in the order of t, then of faces: so none is met twice. */
static uint32_t isogi_dvr__next_border(isogi_dvr__tet_ray *r, double last_t, uint32_t last, int way, double *found_t) {
    const isogi_tets *m = r->mesh;
    uint32_t stack[2 * ISOGI_DVR__DEEP], best = ISOGI_DVR__NO_FACE, i;
    int top = 0;
    double nearest = 1e300;
    if (m->border_count) stack[top++] = 0;
    while (top) {
        const isogi_dvr__node *n = &m->node[stack[--top]];
        if (!isogi_dvr__hits_box(r, n, last_t, nearest)) continue;
        if (!n->count) { /* the nearer child first: what it holds leaves less of the other to look at */
            const isogi_dvr__node *child = &m->node[n->first];
            double ahead = 0;
            for (i = 0; i < 3; i++)
                ahead += (((double)child[0].low[i] + (double)child[0].high[i]) - ((double)child[1].low[i] + (double)child[1].high[i])) *
                         r->dir[i];
            stack[top++] = n->first + (ahead > 0 ? 0 : 1), stack[top++] = n->first + (ahead > 0 ? 1 : 0);
            continue;
        }
        for (i = n->first; i < n->first + n->count; i++) {
            uint32_t p[3];
            double rate, t;
            int k, sides = 0, sure = 0, doubts = 0; /* on which sides of its edges: bit 0 right, bit 1 left; 3: not through the face */
            isogi_dvr__face_points(m, m->border[i], p);
            for (k = 0; k < 3 && sure < 3; k++) {
                int unsure, side = 1 << isogi_dvr__left_of(r, p[k], p[(k + 1) % 3], &unsure);
                sides |= side, sure |= unsure ? 0 : side, doubts |= unsure;
            }
            if (sure == 3) continue;
            r->unsure |= doubts;
            if (sides == 3) continue;
            t = isogi_dvr__face_t(r, p, &rate);
            if (!(rate * way > 0)) continue;
            if (t < last_t || (!(t > last_t) && m->border[i] <= last && last != ISOGI_DVR__NO_FACE)) continue;
            if (t < nearest || (!(t > nearest) && m->border[i] < best)) nearest = t, best = m->border[i];
        }
    }
    *found_t = nearest;
    return best;
}

/* The face by which the ray (dir * way) leaves the tetrahedron that it entered by face `in`: the first plane on the way out. Unsure where
   it leaves by an edge, on one side of which the mesh goes on (by a point: there next_border is). */
static uint32_t isogi_dvr__exit_face(isogi_dvr__tet_ray *r, uint32_t tet, uint32_t in, int way, double *exit_t) {
    uint32_t f, best = ISOGI_DVR__NO_FACE, other = ISOGI_DVR__NO_FACE;
    double nearest = 1e300, second = 1e300;
    for (f = 0; f < 4; f++) {
        uint32_t p[3];
        double rate, t;
        if (4 * tet + f == in) continue;
        isogi_dvr__face_points(r->mesh, 4 * tet + f, p);
        t = isogi_dvr__face_t(r, p, &rate) * way;
        if (!(rate * way > 0) || !(t < second)) continue;
        second = t, other = 4 * tet + f;
        if (t < nearest) second = nearest, other = best, nearest = t, best = 4 * tet + f;
    }
    if (other != ISOGI_DVR__NO_FACE && second - nearest <= 1e-13 * (fabs(nearest) + r->mesh->size / r->speed))
        r->unsure |= (r->mesh->across[best] == ISOGI_DVR__NO_FACE) != (r->mesh->across[other] == ISOGI_DVR__NO_FACE);
    *exit_t = nearest * way;
    return best;
}

/* Gradient of the linear field in a tetrahedron. */
static void isogi_dvr__tet_gradient(const isogi_tets *m, uint32_t tet, double g[3]) {
    const uint32_t *p = m->tet[tet];
    double origin[3], e[3][3], n[3][3], volume, value[3];
    int a, k;
    for (a = 0; a < 3; a++) origin[a] = (double)m->mesh.points[p[0]][a];
    for (k = 0; k < 3; k++)
        isogi_dvr__sub(m->mesh.points[p[k + 1]], origin, e[k]), value[k] = (double)m->mesh.values[p[k + 1]] - (double)m->mesh.values[p[0]];
    for (k = 0; k < 3; k++) isogi_dvr__cross(e[(k + 1) % 3], e[(k + 2) % 3], n[k]);
    volume = isogi_dvr__dot(e[0], n[0]);
    for (a = 0; a < 3; a++) g[a] = (value[0] * n[0][a] + value[1] * n[1][a] + value[2] * n[2][a]) / volume;
}

/* The value at t, kept within the values of the points of the face that the ray is on (a flat tetrahedron's gradient means little), or of
   all four points where it is on none. */
static double isogi_dvr__tet_value(const isogi_dvr__tet_ray *r, uint32_t tet, uint32_t on, const double g[3], double t) {
    const isogi_tets *m = r->mesh;
    const uint32_t face = on == ISOGI_DVR__NO_FACE ? 4 * tet : on;
    uint32_t p[3];
    double value, low, high, at[3];
    int a;
    isogi_dvr__face_points(m, face, p);
    for (a = 0; a < 3; a++) at[a] = r->origin[a] + t * r->dir[a] - (double)m->mesh.points[p[0]][a];
    value = low = high = (double)m->mesh.values[p[0]];
    value += isogi_dvr__dot(g, at);
    for (a = 1; a < 3; a++) {
        double v = (double)m->mesh.values[p[a]];
        low = v < low ? v : low, high = v > high ? v : high;
    }
    if (on == ISOGI_DVR__NO_FACE) {
        double v = (double)m->mesh.values[m->tet[tet][0]];
        low = v < low ? v : low, high = v > high ? v : high;
    }
    value = value > low ? value : low;
    return value < high ? value : high;
}

/* On to t, in a tetrahedron: one linear piece, exact in both spaces. in, out: its faces at both ends, or none where an end is within. */
static void isogi_dvr__pass_tet(isogi_dvr__pixel_ray *pixel, isogi_dvr__tet_ray *r, isogi_dvr__span *s, uint32_t tet, uint32_t in,
                                uint32_t out, double t) {
    isogi_dvr__stretch *p = &s->piece;
    double g[3], change, slope, steep;
    int i;
    isogi_dvr__tet_gradient(r->mesh, tet, g);
    if (r->chained < 2) {
        double value = isogi_dvr__tet_value(r, tet, in, g, r->t);
        if (!r->chained || fabs(value - r->value) > 1e-6 * (fabs(value) + fabs(r->value))) r->value = value;
    }
    slope = isogi_dvr__dot(g, r->dir), steep = sqrt(isogi_dvr__dot(g, g)) * r->speed;
    p->from = p->t0 = r->t, p->to = t > r->t ? t : r->t, p->dt = p->to - p->from, p->u0 = 0, p->u1 = 1;
    p->value[0] = r->value, p->value[1] = isogi_dvr__tet_value(r, tet, out, g, p->to);
    for (i = 0; i < 4; i++) p->b[i] = p->value[0] + (p->value[1] - p->value[0]) * i / 3;
    r->t = p->to, r->value = p->value[1], r->chained = 2, r->passed++;
    change = fabs(p->value[1] - p->value[0]);
    s->lit = 0, s->aslant = fabs(slope) > 1e-30 * steep ? steep / fabs(slope) : 1e30;
    s->aslant = s->aslant > 1 ? s->aslant : 1;
    s->factor = 1, s->path = 0;
    if (r->desc->space == ISOGI_DVR_PHYSICAL) s->path = p->dt * r->speed / r->desc->unit;
    else if (r->desc->silhouette == ISOGI_DVR_SILHOUETTE_EXACT || r->desc->silhouette == ISOGI_DVR_SILHOUETTE_GRADIENT)
        s->path = steep * p->dt;
    else if (r->desc->silhouette == ISOGI_DVR_SILHOUETTE_APPROXIMATE) s->factor = s->aslant;
    if (s->path > 0) s->factor = change > 0 && s->path < 1e300 * change ? s->path / change : 1e300;
    isogi_dvr__divide_piece(pixel, s);
}

/* What rounding makes of the t at which a ray passes a face, if not nearly along it: by that of doubles, from the distance of its points;
   returns what floats make of it, points being such, from their coordinates. */
static double isogi_dvr__rounding(const isogi_dvr__tet_ray *r, uint32_t face, double *doubles) {
    double distance = 0, coordinate = 0;
    uint32_t p[3];
    int a, k;
    isogi_dvr__face_points(r->mesh, face, p);
    for (k = 0; k < 3; k++)
        for (a = 0; a < 3; a++) {
            const double x = (double)r->mesh->mesh.points[p[k]][a], off = fabs(x - r->origin[a]);
            distance = off > distance ? off : distance, coordinate = fabs(x) > coordinate ? fabs(x) : coordinate;
        }
    *doubles = 1e-12 * distance / r->speed;
    return 1e-7 * coordinate / r->speed;
}

/* The tetrahedron that holds the ray's origin: the first that is found on the way back from where the ray leaves the mesh. Border that the
   origin is on counts as behind it. */
static uint32_t isogi_dvr__tet_around(isogi_dvr__tet_ray *r) {
    const isogi_dvr__node *box = r->mesh->node;
    uint32_t face = ISOGI_DVR__NO_FACE;
    double leave = 0;
    int a;
    if (!r->mesh->border_count) return ISOGI_DVR__NO_FACE;
    for (a = 0; a < 3; a++)
        if (!(r->origin[a] >= (double)box->low[a] && r->origin[a] <= (double)box->high[a])) return ISOGI_DVR__NO_FACE;
    while ((face = isogi_dvr__next_border(r, leave, face, 1, &leave)) != ISOGI_DVR__NO_FACE) {
        uint32_t at = face;
        size_t steps;
        double t;
        isogi_dvr__rounding(r, face, &t);
        if (leave <= t) continue;
        for (steps = 0; steps < r->mesh->count && at != ISOGI_DVR__NO_FACE; steps++) {
            uint32_t tet = at >> 2, back = isogi_dvr__exit_face(r, tet, at, -1, &t);
            if (back == ISOGI_DVR__NO_FACE) break;
            if (t <= 0) return tet;
            at = r->mesh->across[back];
        }
    }
    return ISOGI_DVR__NO_FACE;
}

/* Through one part of the mesh after the other, in the order in which they are entered; what lies before the end of those passed, where
   parts overlap, is walked through without being drawn. So is what lies behind the eye, in parts that are entered just there: the one
   around it may be one that ends at the eye. 0 if the ray runs in circles, which rounding may bring about next to an edge or a point. */
static int isogi_dvr__cast_tets(isogi_dvr__pixel_ray *pixel, isogi_dvr__tet_ray *r, isogi_dvr__span *s) {
    double slack = 1e-7 * r->mesh->size / r->speed, last_t = -slack, seam;
    uint32_t tet = isogi_dvr__tet_around(r), in = ISOGI_DVR__NO_FACE, last = ISOGI_DVR__NO_FACE;
    r->t = 0, r->chained = 0;
    for (;;) {
        double walked = last_t;
        int still = 0, overlaps = last_t < r->t - slack;
        r->t = last_t > r->t ? last_t : r->t;
        while (tet != ISOGI_DVR__NO_FACE && pixel->clear > pixel->end) {
            double t;
            uint32_t out = isogi_dvr__exit_face(r, tet, in, 1, &t);
            if (out == ISOGI_DVR__NO_FACE) break;
            still = t > walked ? 0 : still + 1;
            if (still > 200) return 0;
            walked = t > walked ? t : walked;
            if (!(t < r->until)) t = r->until, out = ISOGI_DVR__NO_FACE;
            if (t > r->t) isogi_dvr__pass_tet(pixel, r, s, tet, overlaps ? ISOGI_DVR__NO_FACE : in, out, t);
            if (out == ISOGI_DVR__NO_FACE) return 1;
            in = r->mesh->across[out];
            tet = in == ISOGI_DVR__NO_FACE ? in : in >> 2;
        }
        if (!(pixel->clear > pixel->end)) return 1;
        last = in = isogi_dvr__next_border(r, last_t, last, -1, &last_t);
        if (in == ISOGI_DVR__NO_FACE) return 1;
        /* over the seam of two parts that touch, the value goes on if it is the same on both sides */
        tet = in >> 2, seam = isogi_dvr__rounding(r, in, &slack), r->chained = r->chained && last_t <= r->t + seam;
    }
}

typedef struct isogi_dvr__tet_job {
    const isogi_tets *mesh;
    const isogi_tet_desc *desc;
    const isogi_view *view;
    isogi_dvr__camera camera;
    const isogi_dvr *dvr; /* what the integrals ask for: transfer function and settings */
    size_t across;
    float *pixels; /* as in isogi_dvr__render_job */
    int depth;
    isogi_counters *work;
} isogi_dvr__tet_job;

/* Tried again along a ray that differs by 1e-13, then more, where it could not find its way or may have missed the mesh. */
static void isogi_dvr__try_tets(isogi_dvr__pixel_ray *pixel, const isogi_dvr__tet_job *job, const double origin[3], double until,
                                isogi_counters *work) {
    isogi_dvr__pixel_ray fresh = *pixel;
    isogi_dvr__tet_ray ray;
    isogi_dvr__span span;
    static const double turn[4][3] = { /* each another way, along no plane of a lattice */
        {0, 0, 0}, {1e-13, 0.618e-13, -1.755e-13}, {-0.414e-11, 1.325e-11, 0.732e-11}, {0.577e-9, -1.202e-9, 2.236e-9}};
    int attempt, a;
    for (attempt = 0; attempt < 4; attempt++) {
        *pixel = fresh;
        memset(&ray, 0, sizeof ray), memset(&span, 0, sizeof span);
        ray.mesh = job->mesh, ray.desc = job->desc;
        for (a = 0; a < 3; a++) ray.origin[a] = origin[a], ray.dir[a] = pixel->along[a] + turn[attempt][a];
        ray.speed = sqrt(isogi_dvr__dot(ray.dir, ray.dir)), ray.until = until / ray.speed;
        span.silhouette = job->desc->space == ISOGI_DVR_DATA || job->desc->silhouette != ISOGI_DVR_SILHOUETTE_APPROXIMATE
                              ? job->desc->silhouette
                              : ISOGI_DVR_SILHOUETTE_NONE;
        span.flat = 1, span.touched_t = -1, span.walk.quiet[0] = 1;
        a = isogi_dvr__cast_tets(pixel, &ray, &span), work->cells += ray.passed;
        if (a && !ray.unsure) break;
    }
}

static void isogi_dvr__tet_task(void *arg, size_t tile) {
    const isogi_dvr__tet_job *job = (const isogi_dvr__tet_job *)arg;
    int x0 = (int)(tile % job->across) * ISOGI_DVR__TILE, y0 = (int)(tile / job->across) * ISOGI_DVR__TILE, x, y, a;
    memset(&job->work[tile], 0, sizeof *job->work);
    for (y = y0; y < y0 + ISOGI_DVR__TILE && y < job->view->height; y++)
        for (x = x0; x < x0 + ISOGI_DVR__TILE && x < job->view->width; x++) {
            float *out = job->pixels + 5 * ((size_t)y * (size_t)job->view->width + (size_t)x);
            const double until = isogi_dvr__until(job->view, x, y);
            isogi_dvr__pixel_ray ray;
            double origin[3];
            memset(&ray, 0, sizeof ray);
            isogi_dvr__camera_ray(&job->camera, job->view, x, y, ray.along);
            for (a = 0; a < 3; a++) origin[a] = (double)job->view->eye[a], ray.dir[a] = (float)ray.along[a];
            ray.dvr = job->dvr, ray.clear = 1, ray.end = 1 - (double)job->desc->opaque;
            isogi_dvr__try_tets(&ray, job, origin, until, &job->work[tile]);
            for (a = 0; a < 3; a++) out[a] = (float)ray.rgb[a];
            out[3] = (float)(1 - ray.clear), out[4] = HUGE_VALF;
            job->work[tile].rays++;
            if (!job->depth || !(ray.clear < 1)) continue;
            ray.probe = 1, ray.end = isogi_dvr__depth_end(job->view, ray.clear), ray.clear = 1;
            isogi_dvr__try_tets(&ray, job, origin, until, &job->work[tile]);
            out[4] = (float)ray.t;
        }
}

static isogi_result isogi_dvr__resolve_tets(isogi_tet_desc *resolved, const isogi_tet_desc *desc) {
    memset(resolved, 0, sizeof *resolved);
    if (desc) *resolved = *desc;
    if ((unsigned)resolved->space > ISOGI_DVR_DATA || (unsigned)resolved->silhouette > ISOGI_DVR_SILHOUETTE_GRADIENT) return ISOGI_INVALID;
    if (!isogi_dvr__finite64(resolved->unit) || !(resolved->unit >= 0)) return ISOGI_INVALID;
    if (!isogi_dvr__finite32(resolved->opaque) || !(resolved->opaque >= 0 && resolved->opaque <= 1)) return ISOGI_INVALID;
    if (!(resolved->unit > 0)) resolved->unit = 1;
    if (!(resolved->opaque > 0)) resolved->opaque = 0.999f;
    return ISOGI_OK;
}

static isogi_result isogi_dvr__run_tets(isogi_dvr__tet_job *job, const isogi_context *context, size_t tiles, float (*premultiplied)[4],
                                        float *depth, isogi_counters *counters) {
    size_t pixels = (size_t)job->view->width * (size_t)job->view->height, i;
    isogi_result result = ISOGI_OK;
    job->pixels = (float *)isogi_allocate(context, pixels, 5 * sizeof *job->pixels);
    job->work = (isogi_counters *)isogi_allocate(context, tiles, sizeof *job->work);
    if (!job->pixels || !job->work) result = ISOGI_NO_MEMORY;
    if (result == ISOGI_OK) result = isogi_parallel(context, tiles, isogi_dvr__tet_task, job, 0, 1);
    for (i = 0; result == ISOGI_OK && i < pixels; i++) {
        memcpy(premultiplied[i], job->pixels + 5 * i, 4 * sizeof(float));
        if (depth) depth[i] = job->pixels[5 * i + 4];
    }
    for (i = 0; result == ISOGI_OK && i < tiles; i++) isogi_dvr__add(counters, &job->work[i]);
    isogi_release(context, job->pixels, pixels, 5 * sizeof *job->pixels);
    isogi_release(context, job->work, tiles, sizeof *job->work);
    return result;
}

ISOGI_API isogi_result isogi_dvr_tets_render(const isogi_tets *tets, const isogi_tet_desc *desc, const isogi_transfer *transfer,
                                             const isogi_view *view, float (*premultiplied)[4], float *depth, isogi_counters *counters) {
    isogi_tet_desc resolved;
    isogi_dvr__tet_job job;
    isogi_dvr settings;
    isogi_result result = isogi_dvr__check_view(view);
    size_t tiles;
    if (!tets || !premultiplied || (view && view->local)) return ISOGI_INVALID;
    if (result == ISOGI_OK) result = isogi_dvr__resolve_tets(&resolved, desc);
    if (result == ISOGI_OK) result = isogi_transfer_validate(transfer);
    if (result != ISOGI_OK) return result;
    memset(&settings, 0, sizeof settings), memset(&job, 0, sizeof job);
    settings.desc.space = ISOGI_DVR_DATA, settings.desc.silhouette = resolved.silhouette;
    result = isogi_dvr__transfer_copy(&settings.transfer, transfer, &tets->context);
    if (result != ISOGI_OK) return result;
    result = isogi_dvr__integral_build(&settings.integral, &settings.transfer, &settings.desc, &tets->context);
    if (result == ISOGI_OK) {
        job.mesh = tets, job.desc = &resolved, job.view = view, job.dvr = &settings, job.depth = depth != NULL;
        isogi_dvr__set_camera(&job.camera, view);
        job.across = ((size_t)view->width + ISOGI_DVR__TILE - 1) / ISOGI_DVR__TILE;
        tiles = job.across * (((size_t)view->height + ISOGI_DVR__TILE - 1) / ISOGI_DVR__TILE);
        result = isogi_dvr__run_tets(&job, &tets->context, tiles, premultiplied, depth, counters);
        isogi_dvr__integral_free(&settings.integral, &tets->context);
    }
    isogi_dvr__transfer_free(&settings.transfer, &tets->context);
    return result;
}

#undef ISOGI_DVR__NO_FACE
#undef ISOGI_DVR__LEAF
#undef ISOGI_DVR__DEEP

#undef ISOGI_DVR__PI
#undef ISOGI_DVR__LEVELS
#undef ISOGI_DVR__MAX_ORDER
#undef ISOGI_DVR__LOCAL_ORDER
#undef ISOGI_DVR__MAX_SAMPLES
#undef ISOGI_DVR__NEGLIGIBLE
#undef ISOGI_DVR__MAX_REACH
#undef ISOGI_DVR__NOT_FINITE
#undef ISOGI_DVR__TILE
#undef ISOGI_DVR__CHUNK
#undef ISOGI_DVR__SLAB
#undef ISOGI_DVR__LANES
#undef ISOGI_DVR__RAYS
#undef ISOGI_DVR__TABLE
#undef ISOGI_DVR__LOCAL_STEPS
#undef ISOGI_DVR__BATCH
#undef ISOGI_DVR__GAIN
#undef ISOGI_DVR__TOWARD
#undef ISOGI_DVR__CLASSES
#undef ISOGI_DVR__CLOSE
#undef ISOGI_DVR__TOLD_APART
#undef ISOGI_DVR__NODES
#undef ISOGI_DVR__ROUNDING
#undef ISOGI_DVR__APART
#undef ISOGI_DVR__LEAP
#undef ISOGI_DVR__MARKED
#undef ISOGI_DVR__FLOATS
#undef ISOGI_DVR__VECTORS
#undef ISOGI_DVR__V
#undef ISOGI_DVR__C
#undef ISOGI_DVR__4
#undef ISOGI_DVR__C4
#undef ISOGI_DVR__COUNTS
#undef ISOGI_DVR__MOST_DEPTH
#undef ISOGI_DVR__SOFT
#undef ISOGI_DVR__BURIED
#undef ISOGI_DVR__AVX
#endif /* implementation */

/* Licence: MIT.

   Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation files
   (the "Software"), to deal in the Software without restriction, including without limitation the rights to use, copy, modify,
   merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is
   furnished to do so, subject to the following conditions: the above copyright notice and this permission notice shall be included
   in all copies or substantial portions of the Software.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES
   OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE
   LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
   CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE. */
