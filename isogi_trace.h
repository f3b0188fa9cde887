/* isogi_trace.h - path-traced illumination textures for isosurfaces, for C and C++

   Quick start

       #define ISOGI_IMPLEMENTATION
       #include "isogi_trace.h"
       #include <stdio.h>
       int main(void) {
           static const float sky[3] = {3.5449f, 3.5449f, 3.5449f}, point[1][3] = {{16, 8, 16}}; // radiance 1 as SH
           static float data[32][32][32], light[1][3];
           static isogi_volume volume; static isogi_trace_desc desc; // static: all zero, which is the default everywhere
           isogi_pyramid *pyramid; isogi_trace *trace;
           for (int i = 0; i < 32768; i++) data[i / 1024][i / 32 % 32][i % 32] = -(float)((i / 32 % 32 - 16) * (i / 32 % 32 - 16));
           volume.data = data, volume.type = ISOGI_F32, volume.size[0] = volume.size[1] = volume.size[2] = 32;
           if (isogi_vol_build(&pyramid, &volume, NULL)) return 1; else desc.pyramid = pyramid;
           desc.lighting.env.sh = sky, desc.lighting.env.sh_order = 1, desc.albedo[0] = desc.albedo[1] = desc.albedo[2] = 0.7f;
           if (isogi_trace_create(&trace, &desc, NULL) || isogi_trace_step(trace, 0, NULL)) return 1;
           if (!isogi_trace_sample(trace, point, 1, light, NULL)) printf("E = %g, pi\n", light[0][0]); // nothing hides the sky
           isogi_trace_free(trace), isogi_vol_free(pyramid); }

   What it does

   - Computes global illumination of isosurfaces, once, for all isovalues: every texel of a 3D lattice holds the light on the
     isosurface that passes through it (Wyman, Parker, Shirley and Hansen 2006). To light a picture, look the texture up where the
     isosurface is seen: radiance = albedo * irradiance / pi. Moving the isovalue or the camera needs no new rays.
   - ISOGI_TRACE_IRRADIANCE: RGB irradiance by an environment (image, spherical harmonics, or both), directional lights with or
     without an angular size, point, sphere and rectangle lights, and surfaces that glow; shadows, and any number of diffuse reflections, in
     colours by isovalue and by place. Seen from the low side of the surface, the high side, or both.
   - ISOGI_TRACE_TRANSFER: radiance transfer in spherical harmonics; distant light may then turn and change without new rays.
   - Bakes the whole lattice, the part that an interval of isovalues reads, or lazily what lookups ask for; in steps of a number of
     rays, on all cores, with progress and cancel.
   - Without a lattice: isogi_trace_gather lights a user's own points, such as the vertices of a mesh; without a volume, too:
     isogi_trace_gather_field asks a function of yours what rays meet (tetrahedral meshes, analytic fields).

   What it does NOT do

   - No pictures: it tells the light at points that you found by isogi_vol_intersect or on a mesh.
   - No transparency, no participating media: surfaces are opaque and diffuse. Gloss is for display alone, an approximation that
     radiance transfer allows: isogi_trace_sample_gloss.

   How to use it

     irradiance at surface points    request (if lazy), step until remaining is 0, sample
     keep a window alive             step(trace, rays that fit a frame, &remaining), sample: what is done so far can be shown
     what was refused (INVALID)      isogi_trace_fault(&desc) names the member at fault
     how good is it                  the error of isogi_trace_sample: standard error of luminance; isogi_trace_status for the whole
     good enough everywhere          desc.error, with desc.samples as the most that a texel may take
     sharper shadows                 a finer lattice (desc.lattice): the border of a hard shadow is up to one and a half texels wide;
                                     coarser ones are cheaper by the cube, desc.hierarchy is coarse where light varies slowly
     a renderer of your own          export, and the shaders below
     a bake that takes a night       save now and then, load to go on (lazily by PATHS, see there); desc.box_first to share the work
     a texture that is too dark in grooves   more bounces: each adds one reflection, -1 all of them
     a scan cut open by its border   desc.capped here and ISOGI_RAY_CAPPED for viewing rays; else one looks into the solid through
                                     the cut, at surfaces whose outer side is dark because it is shut off

   What a texel means

     Place and isovalue     texel (i,j,k) lies at lattice_min + (lattice_max - lattice_min) * i / (lattice - 1), in grid coordinates,
                            the only one along an axis in the middle; its isovalue v is the trilinear value there: it lies on its
                            own isosurface.
     Normal                 of the smoothed (B-spline) or the trilinear field there, desc.normals, towards lower values. In a plane of
                            the voxels' lattice, the mean of the trilinear ones of all cells that touch the place; this, or that of
                            one of the cells, also where the smoothed gradient vanishes (sheets and rods one voxel thick, whose
                            texels then have the light of one side) or reads voxels that are not finite.
     Start of rays          desc.offset voxels along the normal; where the trilinear field is still inside there, twice and four times
                            as far, up to one voxel; where that fails, on the surface itself, directions mirrored as at hits (within a cell
                            about its trilinear normal, if the other one points into matter). A ray that goes into matter all the same
                            counts as reflected where it starts. Lights are as far away, and seen as aslant, as from the surface: only
                            whether they are hidden is asked from the start of rays.
     Validity               A texel is left out of every lookup where no surface passes at its place: none of the voxels of the cells
                            around it is lower than v (constant air, local minima: there f >= v all around, such a texel would see the
                            sky through everything), where the field is not finite, or where all gradients vanish. With desc.capped
                            the border's texels, which face out of the box, are always valid on the low side. On the high side a texel
                            needs matter to look through: one of the places a quarter, half and a whole voxel into the matter must
                            be inside (local maxima have none).
     Lookup                 desc.lookup; trilinear unless told otherwise: among the eight texels around the point, those that are
                            valid; their weights are made to sum to 1 again. So an invalid texel neither darkens nor
                            brightens its neighbours. Where none of the eight is valid, the nearest valid one of the 4x4x4
                            around it is taken; a point without even that has zero light.
                            Beside the edge of a cap, texels of the cap and of the surface are mixed.
                            Trilinear is the one to use (as the paper found, too): the others are there to be compared with it.
                            Nearest shows the texels as blocks, closest isovalue breaks along their borders, the B-spline mixes
                            in light of isosurfaces two texels away.

   How light is gathered

     E = integral of L (n.w) dw over the hemisphere: paths start in cosine-distributed directions (a scrambled Sobol sequence) and
     are reflected at every hit by the albedo at the isovalue. A path that leaves brings the environment; at each of its vertices
     every light is tried by a shadow ray, and an uneven image by a direction drawn by its brightness, weighed against the cosine
     (balance heuristic). Vertices are hits on the exact trilinear surface, left without an epsilon. There the hemisphere is
     that of the normal of desc.normals, its part below the trilinear surface mirrored up: no ray enters matter, and no energy is
     lost (a white surface under a white sky stays white). bounces = -1: Russian roulette from the third reflection on.
     So with ISOGI_TRACE_PATHS, the reference. By default (FEEDBACK) a path ends at its first hit and takes the light there from a probe: a
     point near by on the same isosurface or one that runs closely beside it (up to .15 voxels by the gradient), in cells of 2 voxels (of
     the shortest edge, but half a voxel along every axis at least; where lights throw shadows less with more than 8 samples: 1.4 with 16,
     1 from 32 on, but without desc.error) or an eighth of the ray's length, whose own hemisphere is gathered in the same way, by as many
     samples as hits read it, but no more than 8, or its share of 64 in the hits of one texel: in a pocket those meet few probes; passes
     over the probes then bring all reflections without rays. What the sky and reflections bring is read from a plane, fitted to the light
     of texels up to three away that face the same way and whose isosurfaces run close to each other, as far as their noise could explain
     the difference (with one or two samples, of which none is known, all of them; from four on in two rounds: the second compares what the
     first has smoothed); their samples are well spread together. With each sample go two to four rays drawn by the brightness of an uneven
     image: they need no probe, and take a quarter to two fifths of the error that one of them leaves. Lights are not filtered, so that
     their shadows stay sharp (desc.unfiltered: nothing is); where one is wide, with soft shadows everywhere, all are sampled up to four
     times as often instead. Of TRANSFER all coefficients are read from that plane, in one round; the first four must be alike, and of
     each band as much is left to the texel as it differs from that by more than noise. Probes cost accuracy: half a per cent of the mean
     and 1.8 % at a point in narrow channels of albedo 0.8 (test_trace_bake --long prints it); pockets a few voxels wide may be a tenth too
     bright. Lazy and adaptive bakes take samples in
     blocks of 4, 16, 64, ... and every other texel along each axis first: soon every lookup has a value, and all are smooth when the
     first block is complete: ask for the present view alone, and for the next one when remaining is 0.
     A hit from within (only through an open border can a ray get there) is a surface too, with its normal turned.

   GLSL that lights a surface by an exported irradiance texture (GL_LINEAR, GL_CLAMP_TO_EDGE); grid: voxel coordinates, isogi_vol_to_grid of
   world ones; lattice_min, lattice_max: those of the description, or 0 and the volume's size - 1 where all six are 0

       #version 330 core
       uniform sampler3D light;
       uniform vec3 scale, lattice_min, lattice_max, albedo; // scale: isogi_trace_export_scales
       in vec3 grid;
       out vec4 colour;
       void main() {
           vec3 size = vec3(textureSize(light, 0));
           vec3 texel = (grid - lattice_min) / max(lattice_max - lattice_min, 1e-6) * (size - 1.0) + 0.5;
           vec3 irradiance = scale * texture(light, texel / size).rgb;
           colour = vec4(albedo * irradiance / 3.14159265, 1.0);
       }

   GLSL that lights it by exported radiance transfer of order 5, one channel: 7 planes, any distant lighting without new rays

       #version 400 core
       uniform sampler3D transfer[7];
       uniform vec4 scale[7];         // isogi_trace_export_scales, the last three components 0
       uniform vec3 light[28], least[28]; // isogi_trace_lighting, of this frame, the last three 0
       uniform vec3 lattice_min, lattice_max, albedo;
       in vec3 grid;
       out vec4 colour;
       void main() {
           vec3 size = vec3(textureSize(transfer[0], 0)), irradiance = vec3(0.0), bound = vec3(0.0);
           vec3 place = ((grid - lattice_min) / max(lattice_max - lattice_min, 1e-6) * (size - 1.0) + 0.5) / size;
           for (int p = 0; p < 7; p++) {
               vec4 t = scale[p] * texture(transfer[p], place);
               irradiance += t.x * light[4 * p] + t.y * light[4 * p + 1] + t.z * light[4 * p + 2] + t.w * light[4 * p + 3];
               bound += t.x * least[4 * p] + t.y * least[4 * p + 1] + t.z * least[4 * p + 2] + t.w * least[4 * p + 3];
           }
           colour = vec4(albedo * max(max(irradiance, bound), 0.0) / 3.14159265, 1.0);
       }

   Options, to be defined before the implementation

   - ISOGI_IMPLEMENTATION         implements every isogi header that the file includes
   - ISOGI_TRACE_IMPLEMENTATION   implements this one alone
   - ISOGI_NO_THREADS, ISOGI_NO_SIMD, ISOGI_API  as in isogi_vol.h

   Memory       Through the context. Bricks of 4x4x4 texels: 8 bytes for each, 112 where one of its texels is wanted, and for every
                wanted texel alone 2 + 12 bytes of irradiance, 2 + 2 order^2 channels of transfer, less in other formats; and
                180 KB. isogi_trace_memory tells. PATHS needs another 4 MB, FEEDBACK 10 (TRANSFER: 32 KB more for each coefficient),
                and while it works some 400 bytes (TRANSFER: 16 more for each coefficient), 8 MB of them at once of texels and as
                many of probes, and 4 for every hit (with desc.material 16), for each texel of one cube (ISOGI_TRACE_CUBE), for all
                that were asked for when lazy, and for each probe (168 more, TRANSFER 48 for each value, where light takes over 100
                reflections to fade): where every texel of a cube has a surface 130 MB, if these are layers, but in a gyroid 280
                with 1 sample, 560 with 16, 730 with 64, and up to twice that where there are lights.
                A request takes 12 bytes for each of 32768 points at a time.
                Any allocation may fail: the call says ISOGI_NO_MEMORY, the texture stays as it was and can go on.
                Stack use stays below 32 KB (compiled by clang, below 35; unoptimised 70 by gcc, 140 by clang), nearly all of it that
                of rays.
   Threads      Rays run on the context's threads. isogi_trace_sample and the other readers may run in any number of threads at a
                time; request, step and relight alone, without readers. Request and step keep their threads from beginning to end;
                steps of a few milliseconds on many cores go better with an isogi_thread_pool.
   Determinism  The same bits for any number of threads and any budget of steps, and in parts (desc.box_first, isogi_trace_load, which
                tells of what).
                PATHS: a texel's light depends on the description and its place alone, lazily or fully, in any order of requests.
                FEEDBACK: which probes there are depends on the interval of isovalues, and when lazy on what was asked for and in which
                order: 1 to 3 % (rms over points) where light is even, up to 10 % with few samples under a peaky sky or albedo near 1:
                about as much as light errs there.
                Instruction paths (isogi_context.force_path) give the same hits and the same bits; but a ray that grazes the surface
                within rounding, one in 100,000, may be seen either way: light then differs by what that one sample brings.
                All of this is for IEEE arithmetic: with -ffast-math light is right within its errors, and no bits are promised; where
                the compiler fuses multiply-adds (gcc without -ffp-contract=off on such targets), paths differ by roundings.
   Limits       Order 6; 2^24 samples; 2^31 - 1 texels along an axis (more: ISOGI_TOO_LARGE); paths end after 10000 reflections.
                White surfaces that enclose a light truly have infinite light: what is computed then is finite and has no meaning;
                its error says so, and isogi_trace_report.diverges. Under matter (HIGH_SIDE) of albedo above .9 narrow places may err by
                several times the error that is told; so may, with desc.reach, what is reflected in capped matter a voxel thick.
                Voxels of 1e-150 to 1e150 world units: squares of lengths must neither vanish nor overflow. Where matter is
                thinner than the lattice's spacing a lookup mixes the light of both of its sides. A chunk of a larger field
                (isogi_volume.first) is lit as if it were all there is: its halo counts for smooth normals alone.
   Cost         PATHS: samples * (1 + lights that have a size) rays for a texel, and as many for each reflection; an uneven image counts as
                a light. FEEDBACK: samples * (1 + half of these lights), each of the first four with all lights; where any light looks
                wider than 8 degrees from the middle of the volume, four rays to every light with each of the first two samples, then two;
                and for an image 2 to 4, half of which are below the horizon; for each probe as if by as many samples as hits read it, 1 (2
                where the albedo is above .9) to 8, in pockets 64, with one ray to the image for each. A request, when lazy, costs what
                it brings; what was finished before is only worked out anew where its probes are gathered anew, as in pockets, and with
                2 reflections and more that are not all of them.

   History  1.0  first release
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

/* How a lookup reads the texels around a point (Wyman et al. 2006, fig. 6). Only valid texels take part in any of them. */
typedef enum isogi_trace_lookup {
    ISOGI_TRACE_TRILINEAR = 0,    /* the eight around the point, linearly weighted */
    ISOGI_TRACE_NEAREST,          /* of those eight that it weighs, the one nearest to the point (in texels; of equals the lower) */
    ISOGI_TRACE_CLOSEST_ISOVALUE, /* of the same, the one whose isovalue is closest to that at the point (of equals the nearest) */
    ISOGI_TRACE_BSPLINE           /* 4x4x4, weighed by the uniform cubic B-spline: smooth, and blurred over two texels */
} isogi_trace_lookup;

/* Where a ray takes the light from that it meets at a hit. */
typedef enum isogi_trace_method {
    ISOGI_TRACE_FEEDBACK = 0, /* from what was gathered near the hit: all reflections for the rays of one */
    ISOGI_TRACE_PATHS         /* from a path that goes on: unbiased, the reference */
} isogi_trace_method;

/* A colour at a data value; tables of these are piecewise linear, and constant beyond their ends. */
typedef struct isogi_albedo_point {
    double value; /* data value; strictly ascending */
    float rgb[3]; /* albedo: 0..1; emission: radiance, 0 or more */
} isogi_albedo_point;

/* Which side of the surface the light is wanted for. The high side is the one that a viewer within the matter sees. */
typedef enum isogi_trace_sides {
    ISOGI_TRACE_LOW_SIDE = 0,
    ISOGI_TRACE_HIGH_SIDE,
    ISOGI_TRACE_BOTH_SIDES /* two textures in one, twice the work: see isogi_trace_high */
} isogi_trace_sides;

/* Colour that depends on the place, too: called with what the tables say for this isovalue, to change it. point: world (FEEDBACK also asks
   for isovalues near by, whose surfaces do not pass there). From any thread, at any time; the same arguments must give the same colours.
   What is beyond 0..1 (albedo) or negative (emission) is clamped, NaN is 0. */
typedef void isogi_trace_material_function(void *user, double isovalue, const double point[3], float albedo[3], float emission[3]);

/* How a texel's light is held, and exported. Bytes for a texel of RGB / of a coefficient; error of what was computed, which itself
   has an error of about 1 % with 16 samples (an engine block; README.md):
   FLOAT   12 / 4   6e-8 of the value
   HALF     6 / 2   5e-4 of the value
   RGB9E5   4 / -   2e-3 of the largest of the three channels; irradiance alone, 0 or more
   BYTE     3 / 1   irradiance: square roots, 4e-3 of sqrt(value * the most it holds); transfer: 4e-3 of the texel's largest.
                    Exported as they are, for the hardware to interpolate: 2e-3 and 4e-3 of their scales (isogi_trace_export_scales)
   `make test` prints the measured table. HALF and RGB9E5 hold up to 65000 times the irradiance of an open surface
   (measured as isogi_trace_report.unit is), BYTE two to four times that irradiance itself (twice as much with reflections), which near a
   lamp is little; brighter texels are cut off there. Below some 1e-4 of that irradiance HALF and RGB9E5 err by more than the share above:
   their steps are no finer than about 1e-7 of it. */
typedef enum isogi_trace_format {
    ISOGI_TRACE_DEFAULT = 0, /* FLOAT for irradiance, which is small enough, as nothing is kept for texels without light; HALF for
                                transfer, where it halves by far the largest part of the memory and costs nothing that can be seen */
    ISOGI_TRACE_FLOAT,
    ISOGI_TRACE_HALF,
    ISOGI_TRACE_RGB9E5,
    ISOGI_TRACE_BYTE
} isogi_trace_format;

/* All zero but `pyramid`: one texel per voxel, black surface, black sky. The volume, the lights, the environment's image and the
   albedo points are borrowed and must outlive the texture, or what took their place (isogi_trace_change); the description itself is
   copied. */
typedef struct isogi_trace_desc {
    const isogi_pyramid *pyramid; /* of voxels: one of isogi_vol_build_field is ISOGI_INVALID, see isogi_trace_gather_field */
    isogi_lighting lighting;   /* IRRADIANCE: what is baked. TRANSFER: unused while baking, but distant all the same; see
                                  isogi_trace_relight. Radiance, and what a lamp brings to a place, are dimmed to 1e30 where they are
                                  more, and so is the lighting of TRANSFER */
    isogi_trace_mode mode;
    int order;                 /* TRANSFER: 1..6; 0 = 5 */
    size_t lattice[3];         /* texels along x, y, z, up to 2^31 - 1; 0 = one per voxel along that axis. Where voxels lie further apart
                                  than along others give that axis more: else rings show */
    double lattice_min[3], lattice_max[3]; /* grid coordinates (voxels) of the first and last texel, within the volume; all zero =
                                              the whole volume */
    float albedo[3];           /* diffuse RGB reflectance, 0..1 */
    const isogi_albedo_point *albedo_points; /* piecewise linear in the isovalue, constant beyond its ends; multiplied into albedo
                                                only if albedo is not all zero, else used alone */
    size_t albedo_count;
    const isogi_albedo_point *emission_points; /* radiance that the surface itself sends out, by isovalue, up to 1e30.
                                                  TRANSFER: ISOGI_INVALID */
    size_t emission_count;
    isogi_trace_material_function *material;   /* colours by place; NULL = none. TRANSFER leaves its emission out */
    void *material_user;
    isogi_trace_sides sides;
    int no_shadows;            /* non-zero: lights and the environment reach every surface that faces them; reflections stay as they are */
    float reach;               /* surfaces further than this (world units) from the place that a ray leaves do not exist for it: with
                                  0 bounces ambient occlusion of that radius; 0 = unlimited */
    int bounces;               /* 0 = light that arrives directly; n = up to n reflections; -1 = all (Russian roulette) */
    isogi_trace_method method; /* isogi_trace_gather: always PATHS */
    int samples;               /* directions per texel; 0 = 64 */
    float error;               /* FEEDBACK: a texel is good enough once its standard error is below this fraction of the light that an
                                  open texel gets, averaged over all orientations, or once more samples would hardly lower it: light
                                  from probes is itself uncertain by 2 %; 0 = every texel gets all its samples. IRRADIANCE alone */
    int unfiltered;            /* non-zero: FEEDBACK averages no light over neighbouring texels, to see what that is worth: the same error
                                  takes four to ten times the samples, where they are few (make bench, rows filter-); of TRANSFER three
                                  to nine times */
    uint64_t seed;
    float offset;              /* rays start this many voxels (in grid coordinates: wherever voxels are longer, so is the way) along
                                  the normal, up to 1 (a wall may be that thin); 0 = 0.25;
                                  negative = on the surface; lamps are as far away as from the surface all the same */
    isogi_normal_kind normals; /* of the hemisphere that is integrated over */
    double isovalue_min, isovalue_max; /* only texels that a surface within this interval reads; both 0 = all (0 alone: -DBL_MIN to 0).
                                          Where none of a lookup's eight texels is valid, the nearest one of the 4x4x4 may be
                                          missing, unless lazy: another of these, or none, is then read there */
    int lazy;                  /* non-zero: only texels that were requested (and that the interval, if there is one, reads) */
    int capped;                /* non-zero: the volume's border closes the surface (ISOGI_RAY_CAPPED) */
    int transfer_channels;     /* TRANSFER: sets of coefficients: 1 = grey (mean albedo), 3 = RGB; 0 = 3 if albedo is coloured or there
                                  is a material function, else 1 */
    isogi_trace_lookup lookup; /* of request, sample and sample_transfer; the texels themselves do not depend on it */
    isogi_trace_format storage;
    float hierarchy;           /* 0 = a regular lattice. Else two levels: every second texel along each axis first, then all of them only
                                  in cells where light differs by more than this share of its mean (beyond three standard errors), or
                                  where a texel has no surface. 0.1 to 0.5 is sensible. Saves rays and memory where light varies
                                  slowly (in a cavity two thirds of both at 0.4), but on scans, full of edges, it takes about as
                                  many (make bench, rows lattice-). A single sample tells no errors: light makes no fine texels then.
                                  Not with lazy or a box; such a texture cannot be exported or saved */
    size_t box_first[3], box_end[3]; /* only texels box_first <= i < box_end: a part of the bake, in the bits of the whole; all six 0 = all.
                                  FEEDBACK, unless lazy: these and all others of the cubes that they lie in, see ISOGI_TRACE_CUBE */
} isogi_trace_desc;

/* FEEDBACK, unless lazy: texels along each edge of the cubes, counted from texel 0, that are baked one after the other, and the memory
   given back in between. All that texels lend each other (probes, passes over them, the filter) stays within a cube: what is baked of the
   others, where and when, changes no bit, and parts of a bake have nothing to exchange. A box takes whole cubes. So cut where cubes end;
   a lattice of up to 64 texels an axis is one part. At the borders of cubes the filter sees one side alone. */
enum { ISOGI_TRACE_CUBE = 64 };

typedef struct isogi_trace isogi_trace;

/* ---- create, request, step within a budget, read, free --------------------------------------------------------------------- */

/* context: memory, threads, progress of isogi_trace_step; NULL = the pyramid's. */
ISOGI_API isogi_result isogi_trace_create(isogi_trace **trace, const isogi_trace_desc *desc, const isogi_context *context);
/* Why isogi_trace_create refuses a description: the member at fault and why, as "samples: not 0 .. 2^24", for whoever writes the program;
   NULL where it does not (but for memory). What is wrong with lighting is told as by isogi_lighting_fault. */
ISOGI_API const char *isogi_trace_fault(const isogi_trace_desc *desc);
ISOGI_API void isogi_trace_free(isogi_trace *trace);

/* Asks for the texels that isogi_trace_sample reads at these world points. Needed when desc.lazy; else a no-op. On failure some of
   the points have been asked for. */
ISOGI_API isogi_result isogi_trace_request(isogi_trace *trace, const float (*points)[3], size_t count);

/* Works until about max_rays rays are traced (0 = to the end), whole texels, or as long as that takes in other work. *remaining (may be
   NULL): about the fraction of the work asked for that is still to do, 0 = finished; it rises only by a request or by what changes
   (change, touch, relight of IRRADIANCE); not written on failure. ISOGI_CANCELLED and ISOGI_NO_MEMORY leave a texture that can be read and
   stepped on. Not at the same time as any other call on this texture.
   Slices of a frame's time: begin with max_rays = 1000 and scale it by the time that a step took (a request takes some 2 us a point that
   is new; change and touch look at all texels, and cannot be cut). Progress callbacks that cancel after so many milliseconds get on, too;
   but by FEEDBACK what the step was at is lost, and pays for smaller pieces of the next one.
   FEEDBACK: when a block of samples is complete passes without rays carry the light over all probes to all texels at work; they are cut
   into pieces, too, as is what comes before the first ray and after the last one, and counted as the rays that take about as long.
   Meanwhile what a request adds has to wait. To the end, and where no progress callback can stop it, that is done once, after the last
   block (unless desc.error may end a texel before): a tenth less time, the same bits. Should memory run out on the way, light that has
   not been worked out is a first guess. What is read changes by about a tenth (rms over points) when a block of samples is first shared
   among neighbours, later by less: a display that refines before the eye mixes it in over some frames. */
ISOGI_API isogi_result isogi_trace_step(isogi_trace *trace, uint64_t max_rays, double *remaining);

/* Lookup (desc.lookup) among the texels that are valid and computed. irradiance[count] (RGB); error[count]: standard error of its
   luminance, NULL = not wanted; a point none of whose texels is ready gets the zero vector and error = INFINITY (so does the error
   of a single sample, which is not known, and endless light), and so does one that is not finite. Points beyond the lattice are moved to
   its border.
   TRANSFER: under the lighting last given to isogi_trace_relight or isogi_trace_change (that of the description at first); its error is
   an upper bound, but for textures of order 2 with hundreds of samples: there the spread may be twice as much in open places, as the
   order has no room for the lighting's square.
   Irradiance below 0 is handed out as it is, here and by isogi_trace_gather (0 by RGB9E5 and BYTE): a sky that SH coefficients make
   negative somewhere brings it, and so do, with TRANSFER, rings of what isogi_trace_lighting calls the least, where nearly all light is
   hidden. Before it is shown: e = e > 0 ? e : 0  a channel.
   Before a block is first shared an error is a bound, of about the light itself; with few samples, filtered, it is two to four times the
   true one. Errors cover the true ones (twice the standard error in 95 % of points, with desc.error in 90 % or more,
   tests/test_trace_bake.c): they allow for what samples that agree may all have missed, and for probes 2 % of reflected light. That is too
   little where much of the light is reflected and comes from lights without size, whose shadows are hard: at albedo 0.8, in narrow
   tunnels, twice the error told covers 60 to 90 % of points; and at any albedo in deep pits a few voxels wide under the sun or a lamp,
   where reflected light may be a fifth off however many samples there are: with 256 samples and more, or desc.error, 50 to 85 % of points,
   as in hollows with a small way out to the sky (64 samples: 90 %);
   and where colours change strongly within a few voxels, which samples too near each other may miss: in a closed room of chequers of .05
   and .95, 2 voxels wide, errors are twice those told with 16 samples, 3.5 times with 128 (4 % of the light); and close to sphere lights
   that stand half in the ground, of which few samples meet what is above it (7 % of such points lie beyond twice the error). Nor is the
   error of negative lights told in full. They know nothing of the lattice (on steep fields that adds more than samples do; closer texels
   help), and of glows only what emission_points tell: where desc.material alone makes something glow, give the brightest of it there. */
ISOGI_API isogi_result isogi_trace_sample(const isogi_trace *trace, const float (*points)[3], size_t count, float (*irradiance)[3],
                                          float *error);
/* A new lighting. TRANSFER: a distant one (environment and directional lights; point, sphere and rectangle lights are ISOGI_INVALID); no
   rays, but 18 KB for a moment. Hand over an image as it is: of its coefficients nobody can tell what bright spots it has. IRRADIANCE
   keeps nothing that could be lit anew: isogi_trace_change with this lighting, hence as many rays as all computed texels took at first. */
ISOGI_API isogi_result isogi_trace_relight(isogi_trace *trace, const isogi_lighting *lighting);
/* TRANSFER only, for display: glossy light that the surface sends along the unit vector views[i] (away from it, towards the eye),
   about the mirrored direction r, for a Phong lobe of that exponent (0 or more; the order holds lobes up to about order^2) and
   reflectance 1; normals[i]: unit, on the side that is lit. An approximation: the lighting L is blurred by the lobe G and looked up
   at r, exactly (and no less than the least of isogi_trace_lighting), but what stands in its way is judged apart from it, by the
   transfer blurred in the same way over that of an open surface: radiance = (G * L)(r) min(1, (G * T)(r) / (G * cosine)(r)). Exact where
   nothing is in the way or the light is uniform there; shadows come out as soft as the order, and light by reflections counts as
   openness. Zero where no texel is ready. */
ISOGI_API isogi_result isogi_trace_sample_gloss(const isogi_trace *trace, const float (*points)[3], const float (*normals)[3],
                                                const float (*views)[3], double exponent, size_t count, float (*radiance)[3]);
/* TRANSFER only: interpolated coefficients, transfer[count][order*order][channels], zeros where no texel is ready. */
ISOGI_API isogi_result isogi_trace_sample_transfer(const isogi_trace *trace, const float (*points)[3], size_t count, float *transfer);
/* TRANSFER only: coefficients light[order*order], least[order*order] (either may be NULL) of the lighting last given, of which a channel of
   isogi_trace_sample is E = max(sum_i transfer_i light_i, sum_i transfer_i least_i). light: isogi_sh_project of it. Where a bright spot of
   the sky, or a lamp, is hidden, in narrow places, this truncated series takes light away, often more than all else brings there; but
   bright spots bring no less than nothing, so that what is left without them is the least. least: env.sh, whatever it holds; env.rgb cut
   at 4 times its mean after the cut (in 32 x 16 blocks of equal angles; a smaller image, and a channel in which nothing is that bright,
   as it is); and lights that do take light away (negative ones). */
ISOGI_API isogi_result isogi_trace_lighting(const isogi_trace *trace, float (*light)[3], float (*least)[3]);

/* ---- when something changes: only what depends on it is computed again ----
   Texels that are to be computed again keep their light until isogi_trace_step has come to them, can be read meanwhile, and count as
   drafts in isogi_trace_report. With PATHS the result is the same bits as a new bake; FEEDBACK begins with new probes, takes samples
   of lazy texels that were not finished anew, and texels that are kept keep what a neighbour on another isosurface lent them. With
   desc.hierarchy a change that reaches all texels drops the fine ones, and decides anew where they are needed (coarse ones that another
   interval of isovalues brought still count): until then the coarse ones are read. After any other they stay where they were, also in
   cells for which a new bake would not have them: more texels than its, and not its bits.
   Both count as writers; on failure nothing has changed. */

/* A new description for the same texture. Texels computed again:
     lighting                        IRRADIANCE: all. TRANSFER: none, no rays
     albedo, emission, their tables  those on whose isovalue the tables give another colour, since a texel's paths stay on one isosurface
                                     (all, where an array's contents were changed in place, or emission changes what may be the brightest
                                     light, to which errors and the formats below FLOAT refer); none for albedo with 0 bounces
     isovalue_min, isovalue_max, lookup  none; texels that come in are computed, those that go out stay (until isogi_trace_touch
                                     comes to them)
     material, material_user, samples, bounces, seed, offset, reach, no_shadows, error (IRRADIANCE)   all
   All else must be as it was: ISOGI_INVALID. transfer_channels 0 keeps the number of channels. */
ISOGI_API isogi_result isogi_trace_change(isogi_trace *trace, const isogi_trace_desc *desc);

/* Voxels first..last (both ends included, cut to the volume) are going to change, or have changed. To be called twice, without
   isogi_trace_step in between: before they do, and after isogi_vol_update. Computed again are texels at these voxels or within two of
   them, and those whose isosurface passes there, before or after: no others can see the change. With desc.reach and n bounces, only
   those within n + 1 reaches. What a lazy texture was asked for at places where there was no surface has to be requested again; beyond
   desc.box_first..box_end light that was merged is kept up, but none is added where no surface of the interval was. A box wholly beyond
   the volume is ISOGI_INVALID. */
ISOGI_API isogi_result isogi_trace_touch(isogi_trace *trace, const size_t first[3], const size_t last[3]);

/* Texels along each axis, order (0 for IRRADIANCE), channels (3 for IRRADIANCE). Any of them may be NULL. Of no trace: zeros. */
ISOGI_API void isogi_trace_shape(const isogi_trace *trace, size_t lattice[3], int *order, int *channels);

/* What has been achieved so far, over the texels that can be read (of both sides). */
typedef struct isogi_trace_report {
    uint64_t texels;  /* that can be read, */
    uint64_t drafts;  /* of which so many will get more samples */
    uint64_t probes;  /* FEEDBACK: other points whose light was gathered because rays met the surface there */
    double light;     /* IRRADIANCE: root mean square of luminance over these texels, */
    double error;     /* of their standard errors, without what is not known (TRANSFER: under a uniform sky of radiance 1) */
    double worst;     /* the largest of these errors; INFINITY where one is not known */
    double unit;      /* IRRADIANCE: light that an open texel gets, averaged over orientations: what desc.error is a fraction of. Measured
                         at the volume's middle, but at least a quarter of its diagonal from a lamp, and before a rectangle. Where
                         emission_points are the only light: that of a surface which sees the brightest of them alone */
    int diverges;     /* FEEDBACK: reflections add the same light for ever, or so much that all of it is more than 10000 times the
                         brightest that sky and lights bring (albedo 1, closed, with a light inside; 2000 times where memory runs out):
                         no value means anything */
} isogi_trace_report;
ISOGI_API void isogi_trace_status(const isogi_trace *trace, isogi_trace_report *report);

/* Albedo at an isovalue, as the description's tables define it. */
ISOGI_API void isogi_trace_albedo(const isogi_trace_desc *desc, double isovalue, float rgb[3]);
/* The same at a place (world; NULL = tables alone), with the radiance that is emitted there; either output may be NULL.
   What a viewer sees of a surface is emission + albedo * irradiance / pi. */
ISOGI_API void isogi_trace_material(const isogi_trace_desc *desc, double isovalue, const double point[3], float albedo[3],
                                    float emission[3]);

/* The texture of the high side: the one beside `trace` for BOTH_SIDES, `trace` itself for HIGH_SIDE, else NULL. It can be requested,
   sampled, relit and exported like any other; it is stepped, and freed, with the texture it belongs to. */
ISOGI_API isogi_trace *isogi_trace_high(isogi_trace *trace);

/* ---- for a renderer of your own: the texture as a dense array ----
   IRRADIANCE: texel (i,j,k) at i + lattice[0] (j + lattice[1] k), RGB: FLOAT 12 bytes (GL_RGB32F), HALF 6 (GL_RGB16F), RGB9E5 4
   (GL_RGB9_E5 from GL_UNSIGNED_INT_5_9_9_9_REV), BYTE 3 (GL_RGB8). TRANSFER: value v = coefficient * channels + channel stands in
   component v % 4 of plane v / 4, and every plane is a whole RGBA texture: FLOAT 16 bytes a texel, HALF 8, BYTE 4 (GL_RGBA8_SNORM).
   Components are in the machine's byte order. Texels hold what lookups read there, drafts too. Those without light of their own (no
   surface, not computed) hold the mean of the up to 26 around them by 1 / distance^2, three texels deep, and beyond that the mean
   of all: plain hardware interpolation then shows no dark seams (as rounded, and rounded again: up to four times the errors below, which
   are those of the largest around where signs differ).
   Light is what the hardware reads times a scale: scales[3] of RGB, or scales[order^2 channels]; 1 for FLOAT; for HALF and RGB9E5
   another power of two where something is brighter than these hold, or nothing as bright as 0.5; for BYTE the largest value (of
   RGB, or of the coefficient), in whose 255th or 127th parts it counts: errors up to 2e-3 or 4e-3 of the scale. HALF and RGB9E5 keep to
   the errors above from 6e-5 times the scale on; what is darker has steps of 6e-8 times the scale.
   export_size: bytes that isogi_trace_export fills, 0 where the format is not for this mode. format 0 = that of the storage.
   ISOGI_INVALID where `bytes` are too few; takes a byte a texel of scratch memory. Readers: any number of threads may export. */
ISOGI_API size_t isogi_trace_export_size(const isogi_trace *trace, int format);
ISOGI_API isogi_result isogi_trace_export(const isogi_trace *trace, int format, void *texels, size_t bytes);
ISOGI_API isogi_result isogi_trace_export_scales(const isogi_trace *trace, int format, float *scales);

/* ---- save, load, merge ----
   A block of bytes holds the texels computed so far: the same bytes on every machine. Loading adds them to a texture that was created
   from the same description: so a bake is resumed, and boxes baked apart (desc.box_first) are merged by loading one after the other, to
   the bits of one bake that never stopped. FEEDBACK promises these bits of full bakes within the same interval of isovalues (whole cubes
   are saved, ISOGI_TRACE_CUBE), and of lazy ones that were asked for everything while they had nothing to do. A lazy block holds what was
   complete when remaining was last 0, and nothing (64 bytes) before that, whatever can be read already: PATHS saves texel by texel. What is
   asked for after that was finished would have shared its probes, and differs as lazy light does (see Determinism).
   Only desc.isovalue_min, isovalue_max, lazy, lookup, box and the lighting of TRANSFER may differ; else the answer is ISOGI_INVALID
   (lighting, tables and the ranges of the volume's blocks are compared by hash; a material function cannot be. Those whose arrays were
   changed in place are as they were until isogi_trace_change).
   Any bytes may be loaded: those that are damaged, cut off or of another version are ISOGI_CORRUPT and change nothing (what is left of a
   block of both sides that is cut off where the first one ends is a block of that side: ISOGI_INVALID).
   A lazy texture reads of the 4x4x4 around a point, where none of the eight is valid, what points were asked for.
   ISOGI_NO_MEMORY: none of the texels is loaded. isogi_trace_load counts as a writer. Hierarchical textures are not saved: their size is
   0, and the calls answer ISOGI_INVALID. */
ISOGI_API size_t isogi_trace_save_size(const isogi_trace *trace);
ISOGI_API isogi_result isogi_trace_save(const isogi_trace *trace, void *block, size_t bytes); /* bytes: isogi_trace_save_size or more */
ISOGI_API isogi_result isogi_trace_load(isogi_trace *trace, const void *block, size_t bytes);

/* No lattice: irradiance at a user's own world points, each on the isosurface through it, with a unit normal each (NULL = as
   desc.normals says; towards the low side, whichever side is asked for). Uses samples, bounces, seed, offset, normals, capped, sides
   (not BOTH), reach, no_shadows, material and lighting of the description; its mode must be IRRADIANCE. A point that is not finite or has
   no normal, or on the high side no matter to look through (as texels need it: see Validity), gets the zero vector and error = INFINITY.
   Points outside the volume are moved to its border; normals of other lengths are made unit. Where the surface has an edge in a plane of
   the voxels (masks, sheets one voxel thick, TRILINEAR normals) a point beside that plane, if by rounding alone, has the light of its
   cell, a texel in it that of the mean normal. error may be NULL; context NULL: that of the pyramid. */
ISOGI_API isogi_result isogi_trace_gather(const isogi_trace_desc *desc, const float (*points)[3], const float (*normals)[3], size_t count,
                                          float (*irradiance)[3], float *error, const isogi_context *context);

/* ---- surfaces of your own: tetrahedral meshes, analytic fields, anything that rays can meet ---- */

/* What a ray meets first at a t in (0, tmax]. The fields come filled in with a miss and the description's albedo. */
typedef struct isogi_trace_surface {
    double t;          /* 0 = nothing */
    float normal[3];   /* unit; either orientation: it is turned towards the ray */
    float albedo[3], emission[3]; /* clamped to 0..1, and to 0 and more */
} isogi_trace_surface;

/* For each ray (origin, dir of unit length, tmax; 0 = unlimited; the other fields are zero) its first surface. Up to 32 rays, all of
   one point or of hits of its paths; from any thread. It shall not report the surface that the ray leaves; desc.offset helps. */
typedef void isogi_trace_intersect_function(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces);

/* isogi_trace_gather on such a surface. normals are needed: unit, to the side that the light is wanted for. Uses lighting, albedo,
   samples, bounces, seed, reach and no_shadows; offset: how far off along the normal rays start, in world units, 0 or more (lamps are as
   far away as from the surface). The other fields must be valid but are not used, the pyramid may be NULL. context NULL: malloc and all
   cores. */
ISOGI_API isogi_result isogi_trace_gather_field(const isogi_trace_desc *desc, isogi_trace_intersect_function *intersect, void *user,
                                                const float (*points)[3], const float (*normals)[3], size_t count,
                                                float (*irradiance)[3], float *error, const isogi_context *context);

/* 1 where the texel lies on an isosurface of its own, 0 where there is none and it is left out of every lookup; 0 for NULL and beyond the
   lattice. */
ISOGI_API int isogi_trace_valid(const isogi_trace *trace, const size_t texel[3]);
/* 1 where isogi_trace_step has yet to compute the texel, or to refine it, on either of BOTH_SIDES; 0 where light is there already or
   none was asked for, for NULL and beyond the lattice. Of what comes before and after that, a hierarchy's coarse texels and the filter, it
   tells nothing: a bake is finished when *remaining is 0. */
ISOGI_API int isogi_trace_wanted(const isogi_trace *trace, const size_t texel[3]);
ISOGI_API void isogi_trace_counters(const isogi_trace *trace, isogi_counters *counters); /* adds what was done so far; NULL does nothing */
ISOGI_API size_t isogi_trace_memory(const isogi_trace *trace); /* bytes that the texture's light takes: bricks and their table */

#endif /* ISOGI_TRACE_H */

/* ==================================================================================================================== */
#if (defined(ISOGI_IMPLEMENTATION) || defined(ISOGI_TRACE_IMPLEMENTATION)) && !defined(ISOGI_TRACE_IMPLEMENTED)
#define ISOGI_TRACE_IMPLEMENTED

#include <float.h>
#include <math.h>
#include <string.h>

#define ISOGI_TRACE__PI 3.14159265358979323846
#define ISOGI_TRACE__SIDE 4          /* texels along a brick */
#define ISOGI_TRACE__TEXELS 64       /* in a brick */
#define ISOGI_TRACE__WAVE 32         /* paths that are traced together */
#define ISOGI_TRACE__BATCH 4096      /* texels in one parallel run, */
#define ISOGI_TRACE__TASKS 256       /* in at most so many tasks */
#define ISOGI_TRACE__POINTS 32768    /* that are requested together, at most, */
#define ISOGI_TRACE__TASK_POINTS 2048 /* and that one task looks through */
#define ISOGI_TRACE__ON_FACE 0xffffffffu /* in place of the number of a cell */
#define ISOGI_TRACE__TASK 4          /* points of the caller's own in a task */
#define ISOGI_TRACE__MAX_DEPTH 10000 /* of a path, so that nothing hangs */
#define ISOGI_TRACE__MAX_ORDER 6
#define ISOGI_TRACE__VALUES 108      /* of a texel: three channels of the largest order */
#define ISOGI_TRACE__FLAT 4          /* TRANSFER: an image has bright spots where it is so many times its mean, */
#define ISOGI_TRACE__FLAT_ROWS 16    /* looked at in so many rows of blocks, finer than the largest order, */
#define ISOGI_TRACE__FLAT_ROUNDS 20  /* and so often */
#define ISOGI_TRACE__NOT_READY HUGE_VALF
#define ISOGI_TRACE__DEPTH 0.25 /* voxels that must be matter behind the surface of a texel of the high side, at once or up to a voxel on */
#define ISOGI_TRACE__SAMPLES 32768 /* samples of a batch, */
#define ISOGI_TRACE__SPANS 8192    /* in as many spans, */
#define ISOGI_TRACE__SPAN 512      /* of at most this many; */
#define ISOGI_TRACE__PIECE_SPANS 128 /* spans in a piece, */
#define ISOGI_TRACE__PIECES 129    /* in so many pieces at most: each but the last is full, by SPAN samples or by spans; */
#define ISOGI_TRACE__CASTS 49      /* in so many tasks at most */
#define ISOGI_TRACE__HEADS 16384   /* chains of what is new in a batch; a power of two */
#define ISOGI_TRACE__ESCAPED 0xffffffffu /* in place of the number of a probe */
#define ISOGI_TRACE__FLUSH 256     /* rays in one call */
#define ISOGI_TRACE__SWEEP 256     /* nodes in a task that traces no rays, */
#define ISOGI_TRACE__PASSED 1024   /* probes in one of a pass; divides SPANS, */
#define ISOGI_TRACE__STRANDS 8     /* tasks that divide among them what is known of probes; divides CHUNK, a power of two */
#define ISOGI_TRACE__PIECE 65536   /* rays that take as long as what is done without any before progress is told of, */
#define ISOGI_TRACE__PLACING 1.5   /* samples that take as long as finding where a texel lies, */
#define ISOGI_TRACE__CARRYING 3.0  /* as what each level takes beside its texels' rays; for progress alone */
#define ISOGI_TRACE__CHUNK 2048    /* nodes that lie together; a power of two, and a multiple of SWEEP */
#define ISOGI_TRACE__SLAB 8388608  /* bytes of chunks that are allocated together: some huge pages */
#define ISOGI_TRACE__PROBE_MOST 8    /* samples of a probe: as many as there are hits that read it, but no more than this, */
#define ISOGI_TRACE__PROBE_DEEP 64   /* or as that share of this which it has of the samples of a texel, or probe, */
#define ISOGI_TRACE__PROBE_SAME 4    /* so many of which read it at least */
#define ISOGI_TRACE__WATCHED 6       /* passes that look for probes whose light has settled */
#define ISOGI_TRACE__PASSES 100      /* after which all that they would still add is worked out at once, */
#define ISOGI_TRACE__ROUNDS 2000     /* in so many rounds at most, */
#define ISOGI_TRACE__RESIDUAL 1e-9   /* until one more reflection changes no more than this share of the largest light: 1/1000 of a
                                        millionth of it, as passes are */
#define ISOGI_TRACE__PROBE_ERROR 0.02 /* standard error of light from probes */
#define ISOGI_TRACE__CELL 2.0       /* of probes that texels read, in voxels, */
#define ISOGI_TRACE__CELL_LEAST 1.0 /* down to this where lights throw shadows and there are more samples than */
#define ISOGI_TRACE__CELL_SAMPLES 8.0
#define ISOGI_TRACE__CELL_FAR 8.0   /* and of those that only probes read */
#define ISOGI_TRACE__HALF 0.5       /* of a voxel: the least extent of a cell along an axis */
#define ISOGI_TRACE__CELL_RATIO 8   /* length of rays to size of cells, */
#define ISOGI_TRACE__NEAR_RATIO 2   /* up to CELL_FAR */
#define ISOGI_TRACE__PLANE 1.0      /* voxels between the planes of a hit and its probe */
#define ISOGI_TRACE__ALIKE 0.15     /* voxels between the isosurfaces of a hit and its probe, by the gradient there */
#define ISOGI_TRACE__CLASS 1.2      /* the same for isovalues that are looked for together, by the range of values around */
#define ISOGI_TRACE__CELL_PROBES 32 /* of a cell that are passed before none is added: four times as many where there are colours */
#define ISOGI_TRACE__COLOURS 0.05   /* of albedo, less above a half, or share of the glow, by which isosurfaces of a probe may differ */
#define ISOGI_TRACE__NOISE 1.0      /* variances of the difference of two texels' light that the filter takes for noise, */
#define ISOGI_TRACE__NOISE_FEW 8.0  /* and this many more over the number of samples, since those of few are uncertain: */
#define ISOGI_TRACE__NOISE_KNOWN 3  /* with fewer than this nothing is known of it */
#define ISOGI_TRACE__PILOT_SAMPLES 4 /* from so many on the filter goes in two rounds, */
#define ISOGI_TRACE__NOISE_PILOT 2.0 /* and its second takes so many times the variance of the first for noise */
#define ISOGI_TRACE__SPREAD 1.25    /* of transfer: variance that n well spread directions leave, times n * n */
#define ISOGI_TRACE__SPREAD_FROM 16.0 /* of the higher bands: samples from which on theirs falls like that */
#define ISOGI_TRACE__RIDGE 3.0      /* samples of the texel itself, a texel away, that say that light is the same everywhere */
#define ISOGI_TRACE__SHEET 0.7      /* texels between two isosurfaces that the filter takes for one */
#define ISOGI_TRACE__FILTER 12      /* squared distance of the farthest texels of the filter, */
#define ISOGI_TRACE__REACH 3        /* along an axis, */
#define ISOGI_TRACE__ROWS 37        /* in so many rows; */
#define ISOGI_TRACE__ROW 10         /* texels of a brick, and of those around it, along an axis, */
#define ISOGI_TRACE__DENSE 1008     /* of all rows, with room for a vector behind */
#define ISOGI_TRACE__LANES 8        /* floats of a vector */
#define ISOGI_TRACE__NEAR 24        /* squared distance at which a texel counts for 1/e */
#define ISOGI_TRACE__BLURRED 0.18   /* of a texel's own variance: that of what the filter blurs */
#define ISOGI_TRACE__TURNED 16      /* texels along an axis that share a scramble of their samples */
#define ISOGI_TRACE__LIGHT_FIRST 4u /* samples of a texel with one of each light; of wide ones, half so many with four */
#define ISOGI_TRACE__WIDE 0.07      /* half the angle (radians) of lights that are wide */
#define ISOGI_TRACE__UNEVEN 1.2     /* mean square of an image over the square of its mean that makes directions be drawn from it, */
#define ISOGI_TRACE__SKY_RAYS 4     /* up to so many for each sample of a texel */
#if defined(__GNUC__) && !defined(__TINYC__)
#define ISOGI_TRACE__AHEAD(p) __builtin_prefetch(p)
#else
#define ISOGI_TRACE__AHEAD(p) ((void)(p))
#endif
#if (defined(__clang__) || (defined(__GNUC__) && __GNUC__ >= 9)) && !defined(__TINYC__) && !defined(ISOGI_NO_SIMD) && \
    (!defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ == 0)
#define ISOGI_TRACE__VECTORS
#ifdef __SSE2__
#include <immintrin.h>
#endif
#if defined(__x86_64__) && (defined(__clang__) || !defined(_WIN32)) /* gcc for Windows does not align its stack for 32-byte vectors */
#define ISOGI_TRACE__AVX2 __attribute__((target("avx2"))) /* without fused operations: the same bits */
#endif
#endif

/* ==== numbers that survive -ffast-math =============================================================================== */

static int isogi_trace__finite(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7ff0000000000000u) != 0x7ff0000000000000u;
}

static int isogi_trace__finite_point(const float p[3]) {
    return isogi_trace__finite((double)p[0]) && isogi_trace__finite((double)p[1]) && isogi_trace__finite((double)p[2]);
}

static int isogi_trace__finite3(const double v[3]) {
    return isogi_trace__finite(v[0]) && isogi_trace__finite(v[1]) && isogi_trace__finite(v[2]);
}

static int isogi_trace__zero(double x) { return x >= 0 && x <= 0; }

/* Into [0, high]; NaN gives 0. */
static double isogi_trace__clamp(double x, double high) {
    x = x > 0 ? x : 0;
    return x < high ? x : high;
}

static double isogi_trace__dot_wide(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static double isogi_trace__dot(const float a[3], const float b[3]) {
    return (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
}

static double isogi_trace__luminance(const double rgb[3]) { return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }

/* ==== random numbers ================================================================================================= */

/* Every number is a function of (seed, texel, sample, dimension) alone: that is what makes a texel's light independent of threads,
   order and slicing. The mixer is the finaliser of splitmix64 (Steele, Lea and Flood 2014). */
static uint64_t isogi_trace__mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t isogi_trace__key(uint64_t key, uint64_t index) {
    return isogi_trace__mix(key + (index + 1) * 0x9e3779b97f4a7c15u);
}

static double isogi_trace__unit(uint64_t bits) { return (double)(bits >> 11) * (1.0 / 9007199254740992.0); }

/* What a path's random numbers are for; a vertex at `depth` uses dimension depth * DIMENSIONS + purpose. */
enum {
    ISOGI_TRACE__DIRECTION = 0, /* and 1 */
    ISOGI_TRACE__ROULETTE = 2,
    ISOGI_TRACE__LIGHT = 3, /* two for each light, by a second key */
    ISOGI_TRACE__DIMENSIONS = 4
};

static double isogi_trace__random(uint64_t key, int depth, int purpose) {
    return isogi_trace__unit(isogi_trace__key(key, (uint64_t)depth * ISOGI_TRACE__DIMENSIONS + (uint64_t)purpose));
}

static uint32_t isogi_trace__reverse(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x & 0xff00ff00u) >> 8) | ((x & 0x00ff00ffu) << 8);
    x = ((x & 0xf0f0f0f0u) >> 4) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x & 0xccccccccu) >> 2) | ((x & 0x33333333u) << 2);
    return ((x & 0xaaaaaaaau) >> 1) | ((x & 0x55555555u) << 1);
}

/* A nested scramble: in the bit-reversed number x, additions, odd factors and x ^= x * even let a bit depend on lower ones only, so
   the points stay a (0,2)-net; the addition alone makes each of them uniformly distributed over the keys. */
static double isogi_trace__scramble(uint32_t x, uint64_t key) {
    x += (uint32_t)key;
    x *= (uint32_t)(key >> 32) | 1u;
    x ^= x * 0x9d5fc2b2u;
    x += (uint32_t)(key >> 16);
    x ^= x * 0x3c6ef372u;
    x *= (uint32_t)(key >> 24) | 1u;
    x ^= x * 0xa54ff53au;
    return (double)isogi_trace__reverse(x) * (1.0 / 4294967296.0);
}

/* The two-dimensional Sobol sequence, scrambled by a texel's key: the directions of a texel's first rays. */
typedef struct isogi_trace__sequence {
    uint64_t key[2];
} isogi_trace__sequence;

static isogi_trace__sequence isogi_trace__sequence_of(uint64_t texel) {
    isogi_trace__sequence s;
    s.key[0] = isogi_trace__key(texel, 0x5eed0), s.key[1] = isogi_trace__key(texel, 0x5eed1);
    return s;
}

/* Point `index`. With its binary digits as those of a polynomial in X over the numbers modulo 2, the bit-reversed second coordinate is that
   polynomial at 1 + X (Pascal's triangle): X^16 becomes 1 + X^16, then X^8, and so on. */
static void isogi_trace__sobol(const isogi_trace__sequence *s, uint32_t index, double u[2]) {
    uint32_t second = index;
    second ^= second >> 16;
    second ^= (second & 0xff00ff00u) >> 8;
    second ^= (second & 0xf0f0f0f0u) >> 4;
    second ^= (second & 0xccccccccu) >> 2;
    second ^= (second & 0xaaaaaaaau) >> 1;
    u[0] = isogi_trace__scramble(index, s->key[0]);
    u[1] = isogi_trace__scramble(second, s->key[1]);
}

/* Of samples of a light: number 0 is the environment's image, the others follow. */
static isogi_trace__sequence isogi_trace__light_sequence(uint64_t texel, size_t light) {
    return isogi_trace__sequence_of(isogi_trace__key(texel, 0x5eed2 + (uint64_t)light));
}

/* Where the path of sample `index` tries a light from its vertex at `depth`; those at the texel itself are well spread together. */
static void isogi_trace__light_sample(uint64_t texel, uint32_t index, uint64_t path, int depth, size_t light, double u[2]) {
    if (!depth) {
        const isogi_trace__sequence sequence = isogi_trace__light_sequence(texel, light);
        isogi_trace__sobol(&sequence, index, u);
        return;
    }
    path = isogi_trace__key(path, (uint64_t)depth * ISOGI_TRACE__DIMENSIONS + ISOGI_TRACE__LIGHT);
    path = isogi_trace__key(path, (uint64_t)light);
    u[0] = isogi_trace__unit(isogi_trace__key(path, 0)), u[1] = isogi_trace__unit(isogi_trace__key(path, 1));
}

/* ==== directions ===================================================================================================== */

/* Cosine and sine of 2 pi u, u in 0..1, to 1e-11: Taylor's series within an eighth of a turn of the nearest quarter. */
static void isogi_trace__circle(double u, double *cosine, double *sine) {
    int quarter = (int)(4 * u + 0.5);
    double x = 2 * ISOGI_TRACE__PI * (u - 0.25 * quarter), z = x * x, v[2];
    v[0] = 1 - z * (1.0 / 2 - z * (1.0 / 24 - z * (1.0 / 720 - z * (1.0 / 40320 - z * (1.0 / 3628800 - z * (1.0 / 479001600))))));
    v[1] = x * (1 - z * (1.0 / 6 - z * (1.0 / 120 - z * (1.0 / 5040 - z * (1.0 / 362880 - z * (1.0 / 39916800))))));
    *cosine = v[quarter & 1] * (1 - ((quarter + 1) & 2));
    *sine = v[1 - (quarter & 1)] * (1 - (quarter & 2));
}

/* A unit vector n, and two that make an orthonormal basis with it. */
typedef struct isogi_trace__basis {
    double a[3], b[3], n[3];
} isogi_trace__basis;

static void isogi_trace__basis_of(const float n[3], isogi_trace__basis *basis) {
    double x = (double)n[0], y = (double)n[1], z = (double)n[2], s, *a = basis->a, *b = basis->b;
    if (fabs(x) > fabs(y)) s = 1 / sqrt(x * x + z * z), a[0] = -z * s, a[1] = 0, a[2] = x * s;
    else s = 1 / sqrt(y * y + z * z), a[0] = 0, a[1] = z * s, a[2] = -y * s;
    b[0] = y * a[2] - z * a[1], b[1] = z * a[0] - x * a[2], b[2] = x * a[1] - y * a[0];
    basis->n[0] = x, basis->n[1] = y, basis->n[2] = z;
}

/* The direction at angle theta from n, given as cos and sin, and at azimuth 2 pi u. */
static void isogi_trace__around(const isogi_trace__basis *basis, double cosine, double sine, double u, float dir[3]) {
    double x, y;
    int i;
    isogi_trace__circle(u, &x, &y);
    x *= sine, y *= sine;
    for (i = 0; i < 3; i++) dir[i] = (float)(x * basis->a[i] + y * basis->b[i] + cosine * basis->n[i]);
}

static void isogi_trace__cosine(const isogi_trace__basis *basis, double u, double v, float dir[3]) {
    isogi_trace__around(basis, sqrt(1 - u), sqrt(u), v, dir);
}

/* ==== surface normals that light may use ============================================================================= */

/* At a hit, directions are drawn about the shading normal s (smoothed) while matter begins at the geometric one g (of the trilinear
   field). Those below g are mirrored to above it: every ray leaves into the open, nothing leaks, and no energy is lost, so that a
   white furnace stays white. The density of what results is the kernel below, which lights use as well, so that both agree. */
static void isogi_trace__mirror(const float g[3], float dir[3]) {
    double below = isogi_trace__dot(g, dir);
    int i;
    if (below >= 0) return;
    for (i = 0; i < 3; i++) dir[i] = (float)((double)dir[i] - 2 * below * (double)g[i]);
}

/* pi times the density of mirrored cosine-distributed directions; it takes the place of the clamped cosine. */
static double isogi_trace__kernel(const float s[3], const float g[3], const float dir[3]) {
    double cosine = isogi_trace__dot(s, dir), above = isogi_trace__dot(g, dir), mirrored;
    if (!(above > 0)) return 0;
    mirrored = cosine - 2 * above * isogi_trace__dot(g, s);
    return (cosine > 0 ? cosine : 0) + (mirrored > 0 ? mirrored : 0);
}

/* A normal where there is no single one: in a plane of the voxels' lattice the trilinear gradient is another on either side, and one of
   them is zero where a mask begins. The mean over the cells that touch the place; where these cancel (a sheet or rod one voxel thick), the
   smoothed one, or that of the first cell that has one. */
static void isogi_trace__normal_beside(const isogi_pyramid *pyramid, const isogi_hit *place, float normal[3]) {
    const isogi_volume *v = isogi_vol_volume(pyramid);
    isogi_hit cells[8];
    float of[8][3];
    double sum[3] = {0, 0, 0}, length;
    int count = 0, i, a;
    for (i = 0; i < 8; i++) {
        isogi_hit *c = &cells[count];
        int exists = 1;
        for (*c = *place, a = 0; a < 3; a++) {
            if (!(i >> a & 1)) continue;
            if (c->local[a] <= 0 && c->cell[a] > 0) c->cell[a]--, c->local[a] = 1;
            else if (c->local[a] >= 1 && (size_t)c->cell[a] + 2 < v->size[a]) c->cell[a]++, c->local[a] = 0;
            else exists = 0;
        }
        count += exists;
    }
    isogi_vol_normals(pyramid, cells, (size_t)count, ISOGI_NORMAL_TRILINEAR, of);
    for (i = 0; i < count; i++)
        for (a = 0; a < 3; a++) sum[a] += (double)of[i][a];
    length = sqrt(isogi_trace__dot_wide(sum, sum));
    for (a = 0; a < 3; a++) /* what rounding leaves of components that cancel would leave the plane */
        normal[a] = length > 1e-3 && fabs(sum[a]) > 1e-6 * length ? (float)(sum[a] / length) : 0;
    if (!(length > 1e-3)) isogi_vol_normals(pyramid, place, 1, ISOGI_NORMAL_SMOOTH, (float(*)[3])normal);
    for (i = 0; i < count && !(isogi_trace__dot(normal, normal) > 0); i++) memcpy(normal, of[i], sizeof of[i]);
}

/* Normals of the wanted kind, or what comes closest to them. */
static void isogi_trace__place_normals(const isogi_pyramid *pyramid, isogi_normal_kind kind, const isogi_hit *places, size_t count,
                                       float (*normals)[3]) {
    size_t i;
    int a, plane;
    isogi_vol_normals(pyramid, places, count, kind, normals);
    for (i = 0; i < count; i++) {
        for (plane = a = 0; a < 3; a++) plane |= places[i].local[a] <= 0 || places[i].local[a] >= 1;
        if (kind == ISOGI_NORMAL_TRILINEAR ? !plane : isogi_trace__dot(normals[i], normals[i]) > 0) continue;
        isogi_trace__normal_beside(pyramid, &places[i], normals[i]);
    }
}

/* Geometric and shading normals at hits, on the side that the path came from (+1: the low side). */
static void isogi_trace__normals(const isogi_pyramid *pyramid, isogi_normal_kind kind, const isogi_hit *hits,
                                 const signed char *from, size_t count, float (*s)[3], float (*g)[3]) {
    size_t i;
    int a;
    isogi_vol_normals(pyramid, hits, count, ISOGI_NORMAL_TRILINEAR, g);
    if (kind == ISOGI_NORMAL_SMOOTH) isogi_vol_normals(pyramid, hits, count, ISOGI_NORMAL_SMOOTH, s);
    for (i = 0; i < count; i++) {
        if (!(isogi_trace__dot(g[i], g[i]) > 0)) {
            /* no gradient: any plane serves, the smoothed one if there is one */
            if (kind == ISOGI_NORMAL_SMOOTH) memcpy(g[i], s[i], sizeof g[i]);
            if (!(isogi_trace__dot(g[i], g[i]) > 0)) isogi_trace__normal_beside(pyramid, &hits[i], g[i]);
            if (!(isogi_trace__dot(g[i], g[i]) > 0)) g[i][0] = 0, g[i][1] = 1, g[i][2] = 0;
        }
        if (kind != ISOGI_NORMAL_SMOOTH || !(isogi_trace__dot(s[i], g[i]) > 0)) memcpy(s[i], g[i], sizeof s[i]);
        for (a = 0; a < 3 && from[i] < 0; a++) s[i][a] = -s[i][a], g[i][a] = -g[i][a];
    }
}

/* ==== environment image: directions by brightness ==================================================================== */

/* Light of any origin is dimmed to this: whatever is summed, and reflected on and on, stays within the range of floats. */
#define ISOGI_TRACE__BRIGHTEST 1e30

/* Keeps colour and direction. Infinite light comes first to nearly the end of floats, since
   -ffast-math drops a comparison with the end itself. */
static void isogi_trace__dim(float *light, int count) {
    const float end = 3.4e38f;
    float most = 0;
    double factor;
    int i;
    for (i = 0; i < count; i++) {
        light[i] = light[i] < end ? light[i] : end, light[i] = light[i] > -end ? light[i] : -end;
        most = fabsf(light[i]) > most ? fabsf(light[i]) : most;
    }
    if (!((double)most > ISOGI_TRACE__BRIGHTEST)) return;
    factor = ISOGI_TRACE__BRIGHTEST / (double)most;
    for (i = 0; i < count; i++) light[i] = (float)(factor * (double)light[i]);
}

static void isogi_trace__env_light(const isogi_env *env, const float dir[3], float rgb[3]) {
    isogi_env_radiance(env, dir, rgb);
    isogi_trace__dim(rgb, 3);
}

/* Piecewise constant over the image's pixels: density = mean luminance of the pixel (of the bilinear radiance, hence the weights
   1/8 6/8 1/8) / total. Rows and pixels are found in cumulative sums. */
typedef struct isogi_trace__sky {
    const isogi_env *env;
    int rays;      /* directions drawn from it for each cosine-distributed one of a texel (of others 1); 0: none */
    int turned;    /* it has a rotation */
    double total;  /* integral of luminance over the sphere */
    float *mean;   /* width * height */
    double *row;   /* height + 1 cumulative sums */
    double *pixel; /* height * (width + 1) cumulative sums of a row */
    double *cosine; /* height + 1: of the angles between rows and the top */
    uint32_t *near_row, *near_pixel; /* height, height * width: intervals where searches begin, see isogi_trace__search */
    size_t width, height;
} isogi_trace__sky;

static double isogi_trace__pixel(const isogi_env *env, int x, int y) {
    const float *p;
    double rgb[3];
    x = x < 0 ? x + env->width : x >= env->width ? x - env->width : x;
    y = y < 0 ? 0 : y >= env->height ? env->height - 1 : y;
    p = env->rgb + 3 * ((size_t)x + (size_t)env->width * (size_t)y);
    rgb[0] = (double)p[0], rgb[1] = (double)p[1], rgb[2] = (double)p[2];
    return isogi_trace__clamp(isogi_trace__luminance(rgb), 1e30);
}

static double isogi_trace__pixel_mean(const isogi_env *env, int x, int y) {
    static const double weight[3] = {0.125, 0.75, 0.125};
    double sum = 0;
    int i, j;
    for (j = -1; j <= 1; j++)
        for (i = -1; i <= 1; i++) sum += weight[i + 1] * weight[j + 1] * isogi_trace__pixel(env, x + i, y + j);
    return sum;
}

static void isogi_trace__sky_free(isogi_trace__sky *sky, const isogi_context *context) {
    isogi_release(context, sky->mean, sky->width * sky->height, sizeof(float));
    isogi_release(context, sky->row, sky->height + 1, sizeof(double));
    isogi_release(context, sky->pixel, sky->height * (sky->width + 1), sizeof(double));
    isogi_release(context, sky->cosine, sky->height + 1, sizeof(double));
    isogi_release(context, sky->near_row, sky->height, sizeof(uint32_t));
    isogi_release(context, sky->near_pixel, sky->width * sky->height, sizeof(uint32_t));
    sky->mean = NULL, sky->row = sky->pixel = sky->cosine = NULL, sky->near_row = sky->near_pixel = NULL;
}

static int isogi_trace__is_identity(const float m[9]) {
    int i;
    for (i = 0; i < 9; i++)
        if (!isogi_trace__zero((double)m[i])) return 0;
    return 1;
}

/* Cumulative sums are searched from the interval that the beginning of the share u, in equal steps, falls into: on average one or two away
   from that of u itself (Chen and Asau 1974). */
static void isogi_trace__search_set(const double *sum, size_t count, uint32_t *near_to) {
    size_t i, low = 0;
    for (i = 0; i < count; i++) {
        double x = (double)i / (double)count * sum[count];
        while (low + 1 < count && sum[low + 1] <= x) low++;
        near_to[i] = (uint32_t)low;
    }
}

/* The interval that the share u of all falls into, and the place in it, 0..1. */
static size_t isogi_trace__search(const double *sum, size_t count, const uint32_t *near_to, double u, double *place) {
    double x = u * sum[count];
    size_t low = near_to[(size_t)isogi_trace__clamp(u * (double)count, (double)(count - 1))];
    while (low && sum[low] > x) low--;
    while (low + 1 < count && sum[low + 1] <= x) low++;
    *place = sum[low + 1] > sum[low] ? isogi_trace__clamp((x - sum[low]) / (sum[low + 1] - sum[low]), 1) : 0.5;
    return low;
}

/* An even image is left to the cosine-distributed rays: they find it as well, with fewer rays. The more uneven it is, the more rays are
   worth while. */
static isogi_result isogi_trace__sky_build(isogi_trace__sky *sky, const isogi_env *env, const isogi_context *context) {
    double square = 0;
    size_t x, y;
    sky->env = env, sky->turned = !isogi_trace__is_identity(env->rotation);
    if (!env->rgb) return ISOGI_OK;
    sky->width = (size_t)env->width, sky->height = (size_t)env->height;
    sky->mean = (float *)isogi_allocate(context, sky->width * sky->height, sizeof(float));
    sky->row = (double *)isogi_allocate(context, sky->height + 1, sizeof(double));
    sky->pixel = (double *)isogi_allocate(context, sky->height * (sky->width + 1), sizeof(double));
    sky->cosine = (double *)isogi_allocate(context, sky->height + 1, sizeof(double));
    sky->near_row = (uint32_t *)isogi_allocate(context, sky->height, sizeof(uint32_t));
    sky->near_pixel = (uint32_t *)isogi_allocate(context, sky->width * sky->height, sizeof(uint32_t));
    if (!sky->mean || !sky->row || !sky->pixel || !sky->cosine || !sky->near_row || !sky->near_pixel) return ISOGI_NO_MEMORY;
    for (y = 0; y <= sky->height; y++) sky->cosine[y] = cos(ISOGI_TRACE__PI * (double)y / (double)sky->height);
    sky->row[0] = 0;
    for (y = 0; y < sky->height; y++) {
        double *sum = sky->pixel + y * (sky->width + 1), step = ISOGI_TRACE__PI / (double)sky->height;
        double area = 2 * ISOGI_TRACE__PI / (double)sky->width * (cos(step * (double)y) - cos(step * (double)(y + 1)));
        sum[0] = 0;
        for (x = 0; x < sky->width; x++) {
            float mean = (float)isogi_trace__pixel_mean(env, (int)x, (int)y);
            sky->mean[x + sky->width * y] = mean;
            sum[x + 1] = sum[x] + (double)mean * area, square += (double)mean * (double)mean * area;
        }
        sky->row[y + 1] = sky->row[y] + sum[sky->width];
        isogi_trace__search_set(sum, sky->width, sky->near_pixel + y * sky->width);
    }
    isogi_trace__search_set(sky->row, sky->height, sky->near_row);
    sky->total = sky->row[sky->height];
    square *= 4 * ISOGI_TRACE__PI / (sky->total * sky->total); /* over that of the mean; NaN where all is black */
    if (square > ISOGI_TRACE__UNEVEN) sky->rays = square < ISOGI_TRACE__SKY_RAYS - 1 ? 1 + (int)square : ISOGI_TRACE__SKY_RAYS;
    return ISOGI_OK;
}

/* Directions drawn from the image for each cosine-distributed one. The rays of a texel to the sky end anywhere and need no probe: several
   of them cost little. */
static int isogi_trace__sky_rays(const isogi_trace__sky *sky, int is_texel) { return is_texel || !sky->rays ? sky->rays : 1; }

/* A direction (world) drawn from the image, and its density (per steradian); layout of isogi_env. */
static double isogi_trace__sky_direction(const isogi_trace__sky *sky, double u, double v, float dir[3]) {
    double place, d[3], sine, top, bottom;
    size_t y = isogi_trace__search(sky->row, sky->height, sky->near_row, u, &place), x;
    const double *sum = sky->pixel + y * (sky->width + 1);
    const float *m = sky->env->rotation;
    int a;
    top = sky->cosine[y], bottom = sky->cosine[y + 1];
    d[1] = top + (bottom - top) * place;
    x = isogi_trace__search(sum, sky->width, sky->near_pixel + y * sky->width, v, &place);
    sine = sqrt(isogi_trace__clamp(1 - d[1] * d[1], 1));
    isogi_trace__circle(isogi_trace__clamp(((double)x + place) / (double)sky->width, 1), &d[2], &d[0]);
    d[0] *= -sine, d[2] *= sine; /* half a turn less */
    for (a = 0; a < 3; a++)
        dir[a] = !sky->turned ? (float)d[a]
                              : (float)((double)m[3 * a] * d[0] + (double)m[3 * a + 1] * d[1] + (double)m[3 * a + 2] * d[2]);
    return (double)sky->mean[x + sky->width * y] / sky->total;
}

/* Density (per steradian) with which the above draws a world direction. */
static double isogi_trace__sky_density(const isogi_trace__sky *sky, const float dir[3]) {
    const float *m = sky->env->rotation;
    double d[3], u, v;
    size_t x, y;
    int a;
    for (a = 0; a < 3; a++)
        d[a] = !sky->turned ? (double)dir[a]
                            : (double)m[a] * (double)dir[0] + (double)m[3 + a] * (double)dir[1] + (double)m[6 + a] * (double)dir[2];
    v = acos(d[1] > 1 ? 1 : d[1] < -1 ? -1 : d[1]) / ISOGI_TRACE__PI;
    u = atan2(d[0], -d[2]) / (2 * ISOGI_TRACE__PI) + 0.5;
    x = (size_t)isogi_trace__clamp(u * (double)sky->width, (double)(sky->width - 1));
    y = (size_t)isogi_trace__clamp(v * (double)sky->height, (double)(sky->height - 1));
    return (double)sky->mean[x + sky->width * y] / sky->total;
}

/* ==== lights ========================================================================================================= */

/* A direction towards a light and what it brings along it, so that irradiance = rgb * cosine on average over u and v. */
typedef struct isogi_trace__beam {
    float dir[3];
    double tmax; /* 0 = unlimited */
    double rgb[3];
} isogi_trace__beam;

/* A light without extent: one ray decides. */
static int isogi_trace__is_delta(const isogi_light *light) {
    return light->kind == ISOGI_LIGHT_POINT || (light->kind != ISOGI_LIGHT_RECTANGLE && !(light->radius > 0));
}

/* Directions uniform in a cone about the unit vector of the basis, 1 - cos(its half angle) = opening. */
static void isogi_trace__cone(const isogi_trace__basis *basis, double opening, double u, double v, float dir[3]) {
    double low = opening * u, sine = sqrt(isogi_trace__clamp(low * (2 - low), 1));
    isogi_trace__around(basis, 1 - low, sine, v, dir);
}

/* A sphere of radiance I / (pi r^2), seen from outside through a cone of directions, from within all around. */
static double isogi_trace__sphere(const double to[3], double distance, double radius, double u, double v,
                                  isogi_trace__beam *beam) {
    double ratio = radius / distance, opening = 2, along = 0, inside;
    float axis[3];
    isogi_trace__basis basis;
    int a;
    if (ratio <= 1) opening = ratio * ratio / (1 + sqrt(1 - ratio * ratio)); /* touched, it lies on one side */
    for (a = 0; a < 3; a++) axis[a] = (float)(to[a] / distance);
    isogi_trace__basis_of(axis, &basis);
    isogi_trace__cone(&basis, opening, u, v, beam->dir);
    for (a = 0; a < 3; a++) along += to[a] * (double)beam->dir[a];
    inside = along * along - (distance * distance - radius * radius);
    inside = sqrt(inside > 0 ? inside : 0);
    beam->tmax = ratio < 1 ? along - inside : along + inside;
    return 2 * opening / (radius * radius); /* solid angle / (pi r^2) */
}

/* Side lengths, unit axes, and the corner as seen from a point, along these axes; z is away from the light's front. */
typedef struct isogi_trace__frame {
    double length[2], axis[3][3], low[3], high[2];
} isogi_trace__frame;

static void isogi_trace__frame_set(const isogi_light *light, const double point[3], isogi_trace__frame *f) {
    double skew = 0;
    int a, i;
    for (i = 0; i < 2; i++) {
        double square = 0;
        for (a = 0; a < 3; a++) square += (double)light->edge[i][a] * (double)light->edge[i][a];
        f->length[i] = sqrt(square);
        for (a = 0; a < 3; a++) f->axis[i][a] = (double)light->edge[i][a] / f->length[i];
    }
    for (a = 0; a < 3; a++) skew += f->axis[0][a] * f->axis[1][a];
    for (a = 0; a < 3; a++) f->axis[1][a] -= skew * f->axis[0][a]; /* at right angles to 1e-3 before, to 1e-6 now */
    for (a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        f->axis[2][a] = f->axis[0][b] * f->axis[1][c] - f->axis[0][c] * f->axis[1][b];
    }
    for (i = 0; i < 3; i++) {
        f->low[i] = 0;
        for (a = 0; a < 3; a++) f->low[i] += ((double)light->vector[a] - point[a]) * f->axis[i][a];
        if (i < 2) f->low[i] -= 0.5 * f->length[i], f->high[i] = f->low[i] + f->length[i];
    }
}

/* Directions uniform in the solid angle of a rectangle (Urena, Fajardo and King 2013): the x that a share u of the angle ends at,
   then y by its sine. Where the angle is so small that its excess over 2 pi is lost, uniform in its area. */
static double isogi_trace__rectangle(const isogi_light *light, const double point[3], double u, double v,
                                     isogi_trace__beam *beam) {
    isogi_trace__frame f;
    double n[4], angle, x, y, z, distance, factor;
    int a;
    isogi_trace__frame_set(light, point, &f);
    z = f.low[2];
    if (!(z < 0)) return 0;
    /* z of the normals of the planes through the sides, and the sum of the angles between these planes, less 2 pi */
    n[0] = -f.low[1] / sqrt(z * z + f.low[1] * f.low[1]), n[1] = f.high[0] / sqrt(z * z + f.high[0] * f.high[0]);
    n[2] = f.high[1] / sqrt(z * z + f.high[1] * f.high[1]), n[3] = -f.low[0] / sqrt(z * z + f.low[0] * f.low[0]);
    angle = asin(n[0] * n[1]) + asin(n[1] * n[2]) + asin(n[2] * n[3]) + asin(n[3] * n[0]);
    if (angle < 1e-4) {
        x = f.low[0] + u * f.length[0], y = f.low[1] + v * f.length[1];
        distance = sqrt(x * x + y * y + z * z);
        factor = -z / (distance * distance * distance); /* radiance rgb / area, times area cos / distance^2 */
    } else {
        double turn = u * angle + 2 * ISOGI_TRACE__PI - acos(-n[2] * n[3]) - acos(-n[3] * n[0]);
        double tangent = (cos(turn) * n[0] - n[2]) / sin(turn), c = 1 / sqrt(tangent * tangent + n[0] * n[0]), d, low, high, s;
        c = tangent > 0 ? c : -c;
        x = -c * z / sqrt(c * c < 1 ? 1 - c * c : DBL_MIN);
        x = x > f.low[0] ? x : f.low[0], x = x < f.high[0] ? x : f.high[0];
        d = x * x + z * z;
        low = f.low[1] / sqrt(d + f.low[1] * f.low[1]), high = f.high[1] / sqrt(d + f.high[1] * f.high[1]);
        s = low + v * (high - low);
        y = s * s < 1 ? s * sqrt(d) / sqrt(1 - s * s) : f.high[1];
        y = y > f.low[1] ? y : f.low[1], y = y < f.high[1] ? y : f.high[1];
        distance = sqrt(x * x + y * y + z * z);
        factor = angle / (f.length[0] * f.length[1]);
    }
    if (!(distance > 0)) return 0;
    for (a = 0; a < 3; a++)
        beam->dir[a] = (float)((x * f.axis[0][a] + y * f.axis[1][a] + z * f.axis[2][a]) / distance);
    beam->tmax = distance;
    return factor;
}

static void isogi_trace__beam_light(isogi_trace__beam *beam, const isogi_light *light, double factor) {
    double most = 0;
    int a;
    for (a = 0; a < 3; a++) most = fabs((double)light->rgb[a]) > most ? fabs((double)light->rgb[a]) : most;
    if (factor * most > ISOGI_TRACE__BRIGHTEST) factor = ISOGI_TRACE__BRIGHTEST / most;
    for (a = 0; a < 3; a++) beam->rgb[a] = factor * (double)light->rgb[a];
}

/* A directional light with an angular size, seen from anywhere. */
typedef struct isogi_trace__disc {
    isogi_trace__basis basis; /* about its middle */
    double opening, rgb[3];
} isogi_trace__disc;

/* 0: the light is of another kind. */
static int isogi_trace__disc_set(const isogi_light *light, isogi_trace__disc *disc) {
    double to[3], length = 0, angle = (double)light->radius; /* at most a right angle */
    float axis[3];
    isogi_trace__beam beam;
    int a;
    if (light->kind != ISOGI_LIGHT_DIRECTIONAL || !(light->radius > 0)) return 0;
    for (a = 0; a < 3; a++) to[a] = (double)light->vector[a], length += to[a] * to[a];
    length = sqrt(length);
    if (!(length > 0) || !isogi_trace__finite(length)) return 0;
    for (a = 0; a < 3; a++) axis[a] = (float)(to[a] / length);
    isogi_trace__basis_of(axis, &disc->basis);
    disc->opening = 2 * sin(angle / 2) * sin(angle / 2);
    isogi_trace__beam_light(&beam, light, 2 / (1 + cos(angle))); /* radiance rgb / (pi sin^2) times solid angle 2 pi (1 - cos) */
    memcpy(disc->rgb, beam.rgb, sizeof disc->rgb);
    return 1;
}

static void isogi_trace__disc_beam(const isogi_trace__disc *disc, double u, double v, isogi_trace__beam *beam) {
    isogi_trace__cone(&disc->basis, disc->opening, u, v, beam->dir);
    beam->tmax = 0;
    memcpy(beam->rgb, disc->rgb, sizeof disc->rgb);
}

/* 0 where the light does not reach `point` by nature. */
static int isogi_trace__light_beam(const isogi_light *light, const double point[3], double u, double v,
                                   isogi_trace__beam *beam) {
    double to[3], length = 0, factor = 1;
    isogi_trace__disc disc;
    int a;
    if (isogi_trace__disc_set(light, &disc)) {
        isogi_trace__disc_beam(&disc, u, v, beam);
        return 1;
    }
    if (light->kind == ISOGI_LIGHT_RECTANGLE) {
        factor = isogi_trace__rectangle(light, point, u, v, beam);
        isogi_trace__beam_light(beam, light, factor);
        return factor > 0 && isogi_trace__finite(factor);
    }
    for (a = 0; a < 3; a++) {
        to[a] = (double)light->vector[a] - (light->kind == ISOGI_LIGHT_DIRECTIONAL ? 0 : point[a]);
        length += to[a] * to[a];
    }
    length = sqrt(length);
    if (light->kind == ISOGI_LIGHT_SPHERE && !(length > 0)) to[1] = length = 1e-9 * (double)light->radius; /* from its very middle */
    if (!(length > 0) || !isogi_trace__finite(length)) return 0;
    beam->tmax = 0;
    if (light->kind == ISOGI_LIGHT_SPHERE && light->radius > 0) {
        factor = isogi_trace__sphere(to, length, (double)light->radius, u, v, beam);
    } else {
        for (a = 0; a < 3; a++) beam->dir[a] = (float)(to[a] / length);
        if (light->kind != ISOGI_LIGHT_DIRECTIONAL) beam->tmax = length, factor = 1 / (length * length);
    }
    isogi_trace__beam_light(beam, light, factor);
    return beam->tmax >= 0 && isogi_trace__finite(factor);
}

/* The beam that a lamp sends to `point`, begun at `origin` near by, where rays start: it ends at the same place of the lamp, and brings
   what it did. Were lamps seen from there, they would be closer than they are, and bring more than they send out. Distant light stays. */
static void isogi_trace__beam_from(isogi_trace__beam *beam, const double point[3], const double origin[3]) {
    double to[3], length;
    int a;
    if (!(beam->tmax > 0)) return;
    for (a = 0; a < 3; a++) to[a] = point[a] - origin[a] + beam->tmax * (double)beam->dir[a];
    length = sqrt(isogi_trace__dot_wide(to, to));
    if (!isogi_trace__finite(length)) return;
    beam->tmax = length > 0 ? length : DBL_MIN; /* 0 would be unlimited */
    for (a = 0; a < 3 && length > 0; a++) beam->dir[a] = (float)(to[a] / length);
}

/* tmax within the scene's reach; 0 is unlimited in both. Reach is measured from the place on the surface, also where the ray begins off
   it: else what is seen across a narrow gap would depend on the offset. */
static double isogi_trace__within(const isogi_trace_desc *d, const double place[3], const double origin[3], const float dir[3],
                                  double tmax) {
    const double reach = (double)d->reach;
    double off[3], along = 0, apart = 0, within;
    int a;
    if (!(reach > 0)) return tmax;
    for (a = 0; a < 3; a++) off[a] = origin[a] - place[a], along += off[a] * (double)dir[a], apart += off[a] * off[a];
    within = along * along + reach * reach - apart;
    within = within > 0 ? sqrt(within) - along : 0;
    if (!(within > 0)) within = DBL_MIN; /* 0 would be unlimited */
    return !(tmax > 0) || tmax > within ? within : tmax;
}

/* ==== voxels and texels ============================================================================================== */

/* A colour from outside: within [0, most], NaN is 0. */
static void isogi_trace__tame(float rgb[3], double most) {
    int c;
    for (c = 0; c < 3; c++) rgb[c] = (float)isogi_trace__clamp((double)rgb[c], most);
}

/* Exact at both ends, where the other value is not even looked at. */
static double isogi_trace__lerp(double a, double b, double u) { return u > 0 ? u < 1 ? (1 - u) * a + u * b : b : a; }

/* The cell of grid coordinates and the place in it. 0 if the volume has no cells. */
static int isogi_trace__locate(const isogi_volume *v, const double grid[3], isogi_hit *place) {
    int a;
    memset(place, 0, sizeof *place);
    for (a = 0; a < 3; a++) {
        double x = isogi_trace__clamp(grid[a], (double)(v->size[a] - 1));
        uint32_t last = v->size[a] > 1 ? (uint32_t)(v->size[a] - 2) : 0, i = (uint32_t)x;
        if (v->size[a] < 2) return 0;
        place->cell[a] = i < last ? i : last;
        place->local[a] = x - place->cell[a];
    }
    place->side = 1;
    return 1;
}

/* Trilinear value, kept within the values it is made of, so that a constant stays constant. *least: of the cell's voxels. */
static double isogi_trace__value_least(const isogi_volume *v, const isogi_hit *place, double *least) {
    double c[8], low = DBL_MAX, high = -DBL_MAX, value;
    int i;
    isogi_volume_corners(v, place->cell, c);
    for (i = 0; i < 8; i++) low = c[i] < low ? c[i] : low, high = c[i] > high ? c[i] : high;
    for (i = 0; i < 8; i += 2) c[i] = isogi_trace__lerp(c[i], c[i + 1], place->local[0]);
    for (i = 0; i < 8; i += 4) c[i] = isogi_trace__lerp(c[i], c[i + 2], place->local[1]);
    value = isogi_trace__lerp(c[0], c[4], place->local[2]);
    *least = low;
    return value < low ? low : value > high ? high : value;
}

static double isogi_trace__value(const isogi_volume *v, const isogi_hit *place) {
    double least;
    return isogi_trace__value_least(v, place, &least);
}

/* Bounds of the voxels in [low, high] that may be too wide: from the finest level of the pyramid at which few blocks are read. */
static void isogi_trace__block_range(const isogi_pyramid *pyramid, const size_t low[3], const size_t high[3], double range[2]) {
    size_t first[3], last[3], x, y, z;
    isogi_level level;
    int n, a;
    for (n = 0;; n++) {
        size_t blocks = 1;
        level = isogi_vol_level(pyramid, n);
        for (a = 0; a < 3; a++) {
            first[a] = low[a] / (size_t)level.cells;
            last[a] = high[a] / (size_t)level.cells;
            if (first[a] >= level.size[a]) first[a] = level.size[a] - 1;
            if (last[a] >= level.size[a]) last[a] = level.size[a] - 1;
            blocks *= last[a] - first[a] + 1;
        }
        if (blocks <= 27 || !isogi_vol_level(pyramid, n + 1).cells) break;
    }
    range[0] = DBL_MAX, range[1] = -DBL_MAX;
    for (z = first[2]; z <= last[2]; z++)
        for (y = first[1]; y <= last[1]; y++)
            for (x = first[0]; x <= last[0]; x++) {
                const float *r = level.range[x + level.size[0] * (y + level.size[1] * z)];
                if ((double)r[0] < range[0]) range[0] = (double)r[0];
                if ((double)r[1] > range[1]) range[1] = (double)r[1];
            }
}

/* ==== colours of the surface ======================================================================================== */

/* A table at a value. */
static void isogi_trace__colour(const isogi_albedo_point *p, size_t n, double isovalue, float rgb[3]) {
    size_t i = 0, end = n;
    int c;
    while (i < end) { /* the first point that is not below; all are not below what is NaN */
        size_t middle = i + (end - i) / 2;
        if (p[middle].value < isovalue) i = middle + 1;
        else end = middle;
    }
    for (c = 0; c < 3; c++)
        rgb[c] = i == 0 || i == n ? p[i ? n - 1 : 0].rgb[c]
                                  : (float)isogi_trace__lerp((double)p[i - 1].rgb[c], (double)p[i].rgb[c],
                                                             (isovalue / 2 - p[i - 1].value / 2) / (p[i].value / 2 - p[i - 1].value / 2));
}

ISOGI_API void isogi_trace_albedo(const isogi_trace_desc *desc, double isovalue, float rgb[3]) {
    int c, plain = 0;
    float table[3];
    for (c = 0; c < 3; c++) plain |= desc->albedo[c] > 0;
    for (c = 0; c < 3; c++) rgb[c] = desc->albedo[c];
    if (!desc->albedo_points || !desc->albedo_count) return;
    isogi_trace__colour(desc->albedo_points, desc->albedo_count, isovalue, table);
    for (c = 0; c < 3; c++) rgb[c] = plain ? rgb[c] * table[c] : table[c];
}

/* What the caller's function makes of the tables' colours. */
static void isogi_trace__colours(const isogi_trace_desc *desc, double isovalue, const double point[3], float albedo[3],
                                 float emission[3]) {
    desc->material(desc->material_user, isovalue, point, albedo, emission);
    isogi_trace__tame(albedo, 1), isogi_trace__tame(emission, ISOGI_TRACE__BRIGHTEST);
}

ISOGI_API void isogi_trace_material(const isogi_trace_desc *desc, double isovalue, const double point[3], float albedo[3],
                                    float emission[3]) {
    float reflected[3], sent[3] = {0, 0, 0};
    isogi_trace_albedo(desc, isovalue, reflected);
    if (desc->emission_points && desc->emission_count)
        isogi_trace__colour(desc->emission_points, desc->emission_count, isovalue, sent);
    if (point && desc->material) isogi_trace__colours(desc, isovalue, point, reflected, sent);
    if (albedo) memcpy(albedo, reflected, sizeof reflected);
    if (emission) memcpy(emission, sent, sizeof sent);
}

static void isogi_trace__to_world(const isogi_pyramid *pyramid, const isogi_hit *place, double world[3]) {
    double grid[3];
    int a;
    for (a = 0; a < 3; a++) grid[a] = place->cell[a] + place->local[a];
    isogi_vol_to_world(pyramid, grid, world);
}

/* ==== scene: what is the same for every texel ======================================================================== */

/* Cells of probes of one size, see isogi_trace__probe_key. */
typedef struct isogi_trace__cells {
    double size, along[3]; /* in the shortest voxel edges, and in voxels along each axis */
    isogi_level blocks;    /* of the pyramid, about as large */
} isogi_trace__cells;

typedef struct isogi_trace__scene {
    isogi_trace_desc desc; /* with the zero defaults filled in */
    const isogi_pyramid *pyramid;
    const isogi_volume *volume;
    uint32_t flags;
    double to_grid[9]; /* rotation and scale from world to grid */
    double voxel[3], axis[3][3]; /* how long a voxel is along each grid axis in the world, and that axis' direction */
    isogi_trace__sky sky;
    int has_env;
    double unit; /* RGB9E5, HALF and BYTE hold irradiance in units of this power of two, about that of an open surface */
    double possible;   /* what a sample that has not been taken may bring: open_light, or the brightest glow */
    double square;     /* a power of four about the square of that, or 1: in it floats hold variances of light */
    double range;      /* of the volume's values, from the least to the largest; 1 if they are all the same */
    double open_light; /* luminance of the irradiance of an open texel, averaged over orientations: the unit of desc.error */
    int high;    /* light is gathered on the high side */
    int wide;    /* some light looks wide: its half-shadows are everywhere */
    double least; /* shortest edge of a voxel */
    isogi_trace__cells cells[9];
} isogi_trace__scene;

/* Where the light is gathered. */
typedef struct isogi_trace__site {
    isogi_hit place; /* on its isosurface */
    double isovalue;
    float normal[3];
    double point[3];  /* where the light arrives: `place` in the world */
    double origin[3]; /* of its rays, world */
    int on_surface;   /* the rays leave from `place` itself */
    float geometric[3]; /* then: the trilinear normal; directions below it are mirrored, as at every later vertex */
    signed char from; /* FEEDBACK: side of the surface, 1 low, -1 high */
    int open;         /* the origin lies beyond an open border: what a ray meets first may be a surface seen from within */
    uint64_t key; /* PATHS: of its random numbers */
} isogi_trace__site;

/* The size of the smallest cells. Where lights throw shadows a probe near an edge has the light of either side, for all hits of its cell:
   noise that no more samples take away, but smaller cells do. The sky's light varies too slowly on surfaces to be worth more probes. Nor
   are they where texels may be good enough long before all samples are taken. */
static double isogi_trace__scene_cell(const isogi_trace_desc *d) {
    double size = ISOGI_TRACE__CELL;
    if (d->mode == ISOGI_TRACE_IRRADIANCE && d->lighting.light_count && !d->no_shadows && !(d->error > 0) &&
        d->samples > ISOGI_TRACE__CELL_SAMPLES)
        size *= sqrt(ISOGI_TRACE__CELL_SAMPLES / d->samples);
    return size > ISOGI_TRACE__CELL_LEAST ? size : ISOGI_TRACE__CELL_LEAST;
}

static void isogi_trace__scene_cells(isogi_trace__scene *scene) {
    const double *voxel = scene->voxel, size = isogi_trace__scene_cell(&scene->desc);
    int a, k, n;
    scene->least = voxel[0];
    for (a = 1; a < 3; a++) scene->least = voxel[a] < scene->least ? voxel[a] : scene->least;
    for (k = 0; k < 9; k++) {
        isogi_trace__cells *c = &scene->cells[k];
        isogi_level coarser;
        c->size = ldexp(size, k);
        for (a = 0; a < 3; a++) {
            double side = scene->least * c->size, half = ISOGI_TRACE__HALF * voxel[a];
            c->along[a] = (side > half ? side : half) / voxel[a];
        }
        c->blocks = isogi_vol_level(scene->pyramid, 0);
        for (n = 1; c->blocks.cells < c->size && (coarser = isogi_vol_level(scene->pyramid, n)).cells; n++) c->blocks = coarser;
    }
}

static void isogi_trace__scene_matrix(isogi_trace__scene *scene) {
    const isogi_volume *v = scene->volume;
    double reach = 0, origin[3] = {0, 0, 0};
    int a, c;
    isogi_vol_to_world(scene->pyramid, origin, origin);
    for (a = 0; a < 3; a++) {
        double length = sqrt(v->axes[a] * v->axes[a] + v->axes[3 + a] * v->axes[3 + a] + v->axes[6 + a] * v->axes[6 + a]);
        scene->voxel[a] = v->spacing[a] * length;
        for (c = 0; c < 3; c++) scene->axis[a][c] = v->axes[3 * c + a] / length;
    }
    /* one long step along each world axis, so that a far origin costs no precision */
    for (a = 0; a < 3; a++) reach += fabs(origin[a]) + v->spacing[a];
    for (c = 0; c < 3; c++) {
        double world[3], grid[3];
        for (a = 0; a < 3; a++) world[a] = origin[a] + (a == c ? reach : 0);
        isogi_vol_to_grid(scene->pyramid, world, grid);
        for (a = 0; a < 3; a++) scene->to_grid[3 * a + c] = grid[a] / reach;
    }
}

/* A capped volume's border texels face out of the box; elsewhere the gradient decides, by the normal of desc.normals.
   0 if there is no normal. */
static int isogi_trace__site_normal(const isogi_trace__scene *scene, const float gradient[3], isogi_trace__site *site) {
    double n[3] = {0, 0, 0}, length = 0;
    int a, c, border = 0, sign = scene->high ? -1 : 1;
    for (a = 0; a < 3; a++) {
        const double x = site->place.cell[a] + site->place.local[a], *row = scene->to_grid + 3 * a;
        double out = 0;
        if (x <= 0) out = -1;
        if (x >= (double)(scene->volume->size[a] - 1)) out = 1;
        if (isogi_trace__zero(out)) continue;
        border = 1;
        for (c = 0; c < 3; c++) n[c] += out * row[c] / sqrt(isogi_trace__dot_wide(row, row)); /* of that face */
    }
    if (!border || !scene->desc.capped) {
        for (c = 0; c < 3; c++) site->normal[c] = gradient[c] * (float)sign;
        return isogi_trace__dot(site->normal, site->normal) > 0;
    }
    for (c = 0; c < 3; c++) length += n[c] * n[c];
    for (c = 0; c < 3; c++) site->normal[c] = (float)(sign * n[c] / sqrt(length));
    return length > 0;
}

/* Grid coordinates of the first place `offset` voxels along the normal, twice or four times as far (up to one voxel) that is on the
   right side of the trilinear surface, which has bumps that the smoothed normal does not know of (Wyman 2006, 4.1.1). Beyond a border
   is air where the border is capped, else whatever was asked for. high: the right side is the high one. 0: there is none. */
static int isogi_trace__off_surface(const isogi_trace__scene *scene, const isogi_trace__site *site, int high, double offset,
                                    double grid[3], int *beyond) {
    const double *m = scene->to_grid;
    double n[3], speed = 0, value;
    int a, attempt;
    for (a = 0; a < 3; a++) {
        n[a] = m[3 * a] * (double)site->normal[0] + m[3 * a + 1] * (double)site->normal[1] +
               m[3 * a + 2] * (double)site->normal[2];
        speed += n[a] * n[a];
    }
    speed = sqrt(speed);
    for (a = 0; a < 3; a++) n[a] = fabs(n[a]) > 1e-6 * speed ? n[a] : 0; /* what rounding of turned axes adds decides nothing on caps */
    for (attempt = 0; attempt < 3 && offset > 0 && speed > 0; attempt++, offset *= 2) {
        isogi_hit place;
        if (attempt && offset > 1) break;
        for (*beyond = a = 0; a < 3; a++) {
            grid[a] = site->place.cell[a] + site->place.local[a] + n[a] * (offset / speed);
            *beyond |= grid[a] < 0 || grid[a] > (double)(scene->volume->size[a] - 1);
        }
        if (*beyond && high && scene->desc.capped) continue;
        isogi_trace__locate(scene->volume, grid, &place);
        if (*beyond) return 1;
        value = isogi_trace__value(scene->volume, &place); /* what is not finite is no matter */
        if ((isogi_trace__finite(value) && value >= site->isovalue) == high) return 1;
    }
    return 0;
}

/* Rays start off the surface; where that is on its other side wherever it was tried, on the surface itself. high: they are on the high
   side, as all are of a bake of that side, and probes on surfaces seen from within. */
static void isogi_trace__site_start(const isogi_trace__scene *scene, isogi_trace__site *site, int high) {
    double grid[3];
    int a, beyond, plane;
    site->on_surface = 1, site->open = 0;
    isogi_trace__to_world(scene->pyramid, &site->place, site->point);
    if (isogi_trace__off_surface(scene, site, high, (double)scene->desc.offset, grid, &beyond)) {
        isogi_vol_to_world(scene->pyramid, grid, site->origin);
        site->on_surface = 0, site->open = beyond && !scene->desc.capped;
        return;
    }
    memcpy(site->origin, site->point, sizeof site->origin);
    if (site->place.side != 2 && site->place.side != -2) site->place.side = 1; /* a probe on a cap is no place of the isosurface */
    isogi_vol_normals(scene->pyramid, &site->place, 1, ISOGI_NORMAL_TRILINEAR, &site->geometric);
    for (a = 0; a < 3 && high; a++) site->geometric[a] = -site->geometric[a];
    if (isogi_trace__dot(site->geometric, site->normal) > 0) return;
    /* As at hits: a smoothed normal that points the other way would send rays through matter. But where cells meet, as on caps, the
       gradient is that of one of them alone; isogi_trace__hold stops what goes into matter there. */
    for (plane = a = 0; a < 3; a++) plane |= site->place.local[a] <= 0 || site->place.local[a] >= 1;
    if (!plane && isogi_trace__dot(site->geometric, site->geometric) > 0) memcpy(site->normal, site->geometric, sizeof site->normal);
    else memcpy(site->geometric, site->normal, sizeof site->geometric);
}

/* The kernel of the first integral, cosine / pi for rays that begin off the surface, times pi. */
static double isogi_trace__site_kernel(const isogi_trace__site *site, const float dir[3]) {
    double cosine;
    if (site->on_surface) return isogi_trace__kernel(site->normal, site->geometric, dir);
    cosine = isogi_trace__dot(site->normal, dir);
    return cosine > 0 ? cosine : 0;
}

/* What a light's beam, as seen from the surface itself, brings there; then the beam is the ray that finds out whether it arrives. 0: it
   brings none. */
static int isogi_trace__site_beam(const isogi_trace__site *site, isogi_trace__beam *beam) {
    const double cosine = isogi_trace__site_kernel(site, beam->dir);
    int a;
    for (a = 0; a < 3; a++) beam->rgb[a] *= cosine;
    if (!site->on_surface) isogi_trace__beam_from(beam, site->point, site->origin);
    return cosine > 0;
}

/* ==== paths ========================================================================================================== */

/* Shadow rays of one round, gathered and traced together. */
typedef struct isogi_trace__shadows {
    int count;
    int path[ISOGI_TRACE__WAVE];
    float dir[ISOGI_TRACE__WAVE][3];
    double tmax[ISOGI_TRACE__WAVE];
    double rgb[ISOGI_TRACE__WAVE][3]; /* what arrives if nothing is in the way: radiance reflected towards the path */
    isogi_hit start[ISOGI_TRACE__WAVE], hit[ISOGI_TRACE__WAVE];
} isogi_trace__shadows;

/* Paths of one site, kept in step so that their rays are traced together. Radiances are those that reach the site. Too large for a
   stack: each task has its own. */
typedef struct isogi_trace__wave {
    const isogi_trace__scene *scene;
    const isogi_trace__site *site;
    isogi_counters *counters;
    float albedo[3], emission[3];       /* at the site's isovalue */
    double light[ISOGI_TRACE__WAVE][3]; /* of each sample: what its path brought */
    double transfer[ISOGI_TRACE__VALUES]; /* TRANSFER: sum over samples, coefficients x channels */
    int first;                          /* sample of slot 0 */
    int count;                          /* paths alive; the arrays below are of these */
    int slot[ISOGI_TRACE__WAVE];
    uint64_t key[ISOGI_TRACE__WAVE];
    double through[ISOGI_TRACE__WAVE][3];
    double density[ISOGI_TRACE__WAVE];   /* with which dir was drawn, times pi */
    signed char from[ISOGI_TRACE__WAVE]; /* side on which the ray travels: 1 low, -1 high, 0 not known */
    float dir[ISOGI_TRACE__WAVE][3];
    double tmax[ISOGI_TRACE__WAVE];
    isogi_hit start[ISOGI_TRACE__WAVE];
    float shading[ISOGI_TRACE__WAVE][3], geometric[ISOGI_TRACE__WAVE][3];
    isogi_hit hit[ISOGI_TRACE__WAVE];
    isogi_trace__shadows shadows;
    isogi_ray ray[ISOGI_TRACE__WAVE]; /* scratch */
} isogi_trace__wave;

/* A ray that left the surface and met nothing: where cells meet it may have gone to the wrong side, of which the gradient of one of them
   knows nothing. Then it has met the surface where it began, from there. side: 1 low, -1 high, 0 not known. Beyond a capped border is
   the low side, beyond an open one either. */
static void isogi_trace__hold(const isogi_trace__scene *scene, const isogi_hit *start, const float dir[3], double isovalue, int side,
                              isogi_hit *hit) {
    const double *m = scene->to_grid;
    double d[3], grid[3], speed = 0;
    int a, plane = 0, beyond = 0, astray;
    isogi_hit place;
    for (a = 0; a < 3; a++) plane |= start->local[a] <= 0 || start->local[a] >= 1;
    if (hit->side || !side || !plane) return;
    for (a = 0; a < 3; a++)
        d[a] = m[3 * a] * (double)dir[0] + m[3 * a + 1] * (double)dir[1] + m[3 * a + 2] * (double)dir[2], speed += d[a] * d[a];
    for (a = 0; a < 3; a++) {
        grid[a] = start->cell[a] + start->local[a] + (speed > 0 ? 1e-2 * d[a] / sqrt(speed) : 0);
        beyond |= grid[a] < 0 || grid[a] > (double)(scene->volume->size[a] - 1);
    }
    if (beyond) astray = scene->desc.capped && side < 0;
    else { /* cells that are not finite hold no matter */
        const double value = isogi_trace__locate(scene->volume, grid, &place) ? isogi_trace__value(scene->volume, &place) : HUGE_VAL;
        astray = isogi_trace__finite(value) && (value < isovalue) == (side < 0);
    }
    if (astray) *hit = *start, hit->side = -side;
}

/* Rays from the site itself, which is on that side of the surface; a miss has side 0. Rays from the surface that go to its other side have
   met it where they begin, from there. rays: scratch, as many. */
static void isogi_trace__site_rays(const isogi_trace__scene *scene, const isogi_trace__site *site, int side, const float (*dirs)[3],
                                   const double *tmax, size_t count, isogi_ray *rays, isogi_hit *hits, isogi_counters *counters) {
    size_t i;
    if (site->on_surface) {
        for (i = 0; i < count; i++) hits[i] = site->place;
        isogi_vol_continue(scene->pyramid, hits, dirs, tmax, site->isovalue, scene->flags, count, hits, counters);
        for (i = 0; i < count; i++) isogi_trace__hold(scene, &site->place, dirs[i], site->isovalue, side, &hits[i]);
        return;
    }
    for (i = 0; i < count; i++) {
        isogi_ray *ray = &rays[i];
        memset(ray, 0, sizeof *ray);
        memcpy(ray->origin, site->origin, sizeof ray->origin);
        memcpy(ray->dir, dirs[i], sizeof ray->dir);
        /* cppcheck-suppress objectIndex */
        ray->flags = scene->flags, ray->isovalue = site->isovalue, ray->tmax = tmax[i];
    }
    isogi_vol_intersect(scene->pyramid, rays, count, hits, counters);
}

/* Adds what the unblocked shadow rays bring. depth 0: they leave from the site. */
static void isogi_trace__shadows_flush(isogi_trace__wave *w, isogi_trace__shadows *s, int depth) {
    int i, c;
    if (!s->count) return;
    if (w->scene->desc.no_shadows) {
        for (i = 0; i < s->count; i++) s->hit[i].side = 0;
    } else if (!depth) {
        isogi_trace__site_rays(w->scene, w->site, w->scene->high ? -1 : 1, (const float(*)[3])s->dir, s->tmax, (size_t)s->count, w->ray,
                               s->hit, w->counters);
    } else {
        for (i = 0; i < s->count; i++) s->start[i] = w->start[s->path[i]];
        isogi_vol_continue(w->scene->pyramid, s->start, (const float(*)[3])s->dir, s->tmax, w->site->isovalue, w->scene->flags,
                           (size_t)s->count, s->hit, w->counters);
        for (i = 0; i < s->count; i++)
            isogi_trace__hold(w->scene, &s->start[i], (const float *)s->dir[i], w->site->isovalue, w->from[s->path[i]], &s->hit[i]);
    }
    for (i = 0; i < s->count; i++)
        if (!s->hit[i].side)
            for (c = 0; c < 3; c++) w->light[w->slot[s->path[i]]][c] += s->rgb[i][c];
    s->count = 0;
}

/* pi times the density of the directions that leave path i's vertex. */
static double isogi_trace__cosine_at(const isogi_trace__wave *w, int i, int depth, const float dir[3]) {
    return depth ? isogi_trace__kernel((const float *)w->shading[i], (const float *)w->geometric[i], dir)
                 : isogi_trace__site_kernel(w->site, dir);
}

static double isogi_trace__wave_within(const isogi_trace__wave *w, int depth, const float dir[3], double tmax) {
    return isogi_trace__within(&w->scene->desc, w->site->point, depth ? w->site->point : w->site->origin, dir, tmax);
}

static void isogi_trace__shadows_add(isogi_trace__wave *w, isogi_trace__shadows *s, int i, int depth, const float dir[3],
                                     double tmax, const double rgb[3]) {
    int c;
    memcpy(s->dir[s->count], dir, sizeof s->dir[0]);
    s->path[s->count] = i, s->tmax[s->count] = isogi_trace__wave_within(w, depth, dir, tmax);
    for (c = 0; c < 3; c++) s->rgb[s->count][c] = w->through[i][c] * rgb[c];
    s->count++;
}

static void isogi_trace__wave_sample(const isogi_trace__wave *w, int i, int depth, size_t light, double u[2]) {
    isogi_trace__light_sample(w->site->key, (uint32_t)(w->first + w->slot[i]), w->key[i], depth, light, u);
}

/* Next-event estimation at the vertices of all paths: the lights, one after the other. At the site, lights without extent are left
   out: isogi_trace__site_lights does them once. */
static void isogi_trace__wave_lights(isogi_trace__wave *w, isogi_trace__shadows *s, int depth, float (*positions)[3]) {
    const isogi_lighting *lighting = &w->scene->desc.lighting;
    size_t l;
    int i, c;
    for (l = 0; l < lighting->light_count; l++) {
        const isogi_light *light = &lighting->lights[l];
        if (!depth && isogi_trace__is_delta(light)) continue;
        for (i = 0; i < w->count; i++) {
            double point[3], cosine, u[2];
            isogi_trace__beam beam;
            isogi_trace__wave_sample(w, i, depth, 1 + l, u);
            for (c = 0; c < 3; c++) point[c] = depth ? (double)positions[i][c] : w->site->point[c];
            if (!isogi_trace__light_beam(light, point, u[0], u[1], &beam)) continue;
            cosine = isogi_trace__cosine_at(w, i, depth, beam.dir);
            if (!(cosine > 0)) continue;
            for (c = 0; c < 3; c++) beam.rgb[c] *= cosine / ISOGI_TRACE__PI;
            if (!depth && !w->site->on_surface) isogi_trace__beam_from(&beam, w->site->point, w->site->origin);
            isogi_trace__shadows_add(w, s, i, depth, beam.dir, beam.tmax, beam.rgb);
        }
        isogi_trace__shadows_flush(w, s, depth);
    }
}

/* The environment's image, drawn by brightness and weighed against the cosine-distributed rays by the balance heuristic (Veach and
   Guibas 1995): value / (density + their density). */
static void isogi_trace__wave_sky(isogi_trace__wave *w, isogi_trace__shadows *s, int depth) {
    const isogi_trace__sky *sky = &w->scene->sky;
    int i, c;
    if (!sky->rays) return;
    for (i = 0; i < w->count; i++) {
        double u[2], density, cosine, rgb[3];
        float dir[3], radiance[3];
        isogi_trace__wave_sample(w, i, depth, 0, u);
        density = isogi_trace__sky_direction(sky, u[0], u[1], dir);
        cosine = isogi_trace__cosine_at(w, i, depth, dir) / ISOGI_TRACE__PI;
        if (!(cosine > 0) || !(density > 0)) continue;
        isogi_trace__env_light(sky->env, dir, radiance);
        for (c = 0; c < 3; c++) rgb[c] = (double)radiance[c] * cosine / (density + cosine);
        isogi_trace__shadows_add(w, s, i, depth, dir, 0, rgb);
    }
    isogi_trace__shadows_flush(w, s, depth);
}

/* Adds what a path brings from the environment, `through` of it, by a ray drawn with the density cosine / pi. */
static void isogi_trace__escape(const isogi_trace__scene *scene, const float dir[3], double cosine, const double through[3],
                                double light[3]) {
    double weight = 1, density = 0;
    float radiance[3];
    int c;
    if (!scene->has_env) return;
    if (scene->sky.rays) density = isogi_trace__sky_density(&scene->sky, dir);
    if (density > 0) weight = cosine / (cosine + density);
    isogi_trace__env_light(&scene->desc.lighting.env, dir, radiance);
    for (c = 0; c < 3; c++) light[c] += weight * through[c] * (double)radiance[c];
}

/* Path i has left the volume. */
static void isogi_trace__wave_escape(isogi_trace__wave *w, int i) {
    const isogi_trace__scene *scene = w->scene;
    float basis[ISOGI_TRACE__MAX_ORDER * ISOGI_TRACE__MAX_ORDER];
    int c, k, channels = scene->desc.transfer_channels, count = scene->desc.order * scene->desc.order;
    if (scene->desc.mode == ISOGI_TRACE_TRANSFER) {
        isogi_sh_eval(basis, scene->desc.order, (const float(*)[3]) & w->dir[i], 1);
        for (k = 0; k < count; k++)
            for (c = 0; c < channels; c++)
                w->transfer[k * channels + c] += w->through[i][c] * (double)basis[k];
        for (c = 0; c < 3; c++) w->light[w->slot[i]][c] += w->through[i][c];
        return;
    }
    isogi_trace__escape(scene, (const float *)w->dir[i], w->density[i] / ISOGI_TRACE__PI, (const double *)w->through[i],
                        w->light[w->slot[i]]);
}

/* Grey transfer has one channel, of their mean. */
static void isogi_trace__albedo_channels(const isogi_trace_desc *desc, float albedo[3]) {
    if (desc->mode == ISOGI_TRACE_TRANSFER && desc->transfer_channels == 1)
        albedo[0] = albedo[1] = albedo[2] = (float)(((double)albedo[0] + (double)albedo[1] + (double)albedo[2]) / 3);
}

/* Colours where path i hit. What is emitted there is brought. */
static void isogi_trace__wave_material(isogi_trace__wave *w, int i, float albedo[3]) {
    const isogi_trace_desc *desc = &w->scene->desc;
    float emission[3];
    int c;
    memcpy(albedo, w->albedo, sizeof w->albedo), memcpy(emission, w->emission, sizeof emission);
    if (desc->material) {
        double point[3];
        isogi_trace__to_world(w->scene->pyramid, &w->hit[i], point);
        isogi_trace__colours(desc, w->site->isovalue, point, albedo, emission);
    }
    isogi_trace__albedo_channels(desc, albedo);
    if (desc->mode == ISOGI_TRACE_TRANSFER) return;
    for (c = 0; c < 3; c++) w->light[w->slot[i]][c] += w->through[i][c] * (double)emission[c];
}

/* The probability that a path goes on with what its reflection at `depth` leaves of its light; 0: it has ended. Russian roulette, below 1
   even for white surfaces: a path in a closed cavity lives for fifty reflections on average. */
static double isogi_trace__survive(const isogi_trace_desc *desc, uint64_t key, int depth, const double through[3]) {
    double most = through[0] > through[1] ? through[0] : through[1];
    most = most > through[2] ? most : through[2];
    if (depth == desc->bounces || depth >= ISOGI_TRACE__MAX_DEPTH || !(most > 0)) return 0;
    if (desc->bounces >= 0 || depth < 3) return 1;
    most = most < 0.98 ? most : 0.98;
    return isogi_trace__random(key, depth, ISOGI_TRACE__ROULETTE) < most ? most : 0;
}

/* Keeps path i as path j, reflected where it hit. 0: it ends there. */
static int isogi_trace__wave_reflect(isogi_trace__wave *w, int i, int j, int depth) {
    int side = w->hit[i].side > 0 ? 1 : -1, from = w->from[i], c;
    double through[3], survive;
    float albedo[3];
    isogi_trace__wave_material(w, i, albedo);
    for (c = 0; c < 3; c++) through[c] = w->through[i][c] * (double)albedo[c];
    survive = isogi_trace__survive(&w->scene->desc, w->key[i], depth, through);
    if (!(survive > 0)) return 0;
    for (c = 0; c < 3; c++) w->through[j][c] = through[c] / survive;
    w->slot[j] = w->slot[i], w->key[j] = w->key[i];
    /* A ray that meets the surface from the side where it is not has begun within matter (a corner where cells with different
       gradients meet): that is a reflection on the spot. */
    w->start[j] = !from || from == side ? w->hit[i] : w->start[i];
    w->from[j] = (signed char)(!from || from == side ? side : from);
    return 1;
}

/* New directions from every vertex. */
static void isogi_trace__wave_scatter(isogi_trace__wave *w, int depth) {
    isogi_trace__basis basis;
    int i;
    for (i = 0; i < w->count; i++) {
        double u = isogi_trace__random(w->key[i], depth, ISOGI_TRACE__DIRECTION);
        double v = isogi_trace__random(w->key[i], depth, ISOGI_TRACE__DIRECTION + 1);
        isogi_trace__basis_of((const float *)w->shading[i], &basis);
        isogi_trace__cosine(&basis, u, v, w->dir[i]);
        isogi_trace__mirror((const float *)w->geometric[i], w->dir[i]);
        w->density[i] =
            isogi_trace__kernel((const float *)w->shading[i], (const float *)w->geometric[i], (const float *)w->dir[i]);
    }
}

static void isogi_trace__wave_begin(isogi_trace__wave *w, int first, int count) {
    const isogi_trace__site *site = w->site;
    const isogi_trace__sequence sequence = isogi_trace__sequence_of(site->key);
    isogi_trace__basis basis;
    int i, c;
    isogi_trace__basis_of(site->normal, &basis);
    w->first = first, w->count = count;
    for (i = 0; i < count; i++) {
        double u[2];
        w->slot[i] = i, w->key[i] = isogi_trace__key(site->key, (uint64_t)(first + i));
        w->start[i] = site->place, w->from[i] = (signed char)(site->open ? 0 : w->scene->high ? -1 : 1);
        isogi_trace__sobol(&sequence, (uint32_t)(first + i), u);
        isogi_trace__cosine(&basis, u[0], u[1], w->dir[i]);
        if (site->on_surface) isogi_trace__mirror(site->geometric, w->dir[i]);
        w->density[i] = isogi_trace__site_kernel(site, (const float *)w->dir[i]);
        for (c = 0; c < 3; c++) w->through[i][c] = 1, w->light[i][c] = 0;
    }
}

/* Samples first .. first + count - 1 of a site; w->light holds what each brought. */
static void isogi_trace__wave_run(isogi_trace__wave *w, int first, int count) {
    const isogi_trace__scene *scene = w->scene;
    int lit = scene->desc.mode == ISOGI_TRACE_IRRADIANCE, depth, i;
    float positions[ISOGI_TRACE__WAVE][3];
    w->shadows.count = 0;
    isogi_trace__wave_begin(w, first, count);
    for (depth = 0; w->count; depth++) {
        int alive = 0;
        if (depth) {
            isogi_trace__normals(scene->pyramid, scene->desc.normals, w->start, w->from, (size_t)w->count, w->shading,
                                 w->geometric);
            if (lit && scene->desc.lighting.light_count)
                isogi_vol_positions(scene->pyramid, w->start, (size_t)w->count, positions);
            isogi_trace__wave_scatter(w, depth);
        }
        if (lit) isogi_trace__wave_lights(w, &w->shadows, depth, positions);
        if (lit) isogi_trace__wave_sky(w, &w->shadows, depth);
        for (i = 0; i < w->count; i++) w->tmax[i] = isogi_trace__wave_within(w, depth, (const float *)w->dir[i], 0);
        if (!depth)
            isogi_trace__site_rays(scene, w->site, scene->high ? -1 : 1, (const float(*)[3])w->dir, w->tmax, (size_t)w->count, w->ray,
                                   w->hit, w->counters);
        else
            isogi_vol_continue(scene->pyramid, w->start, (const float(*)[3])w->dir, w->tmax, w->site->isovalue, scene->flags,
                               (size_t)w->count, w->hit, w->counters);
        for (i = 0; i < w->count; i++) {
            if (depth) isogi_trace__hold(scene, &w->start[i], (const float *)w->dir[i], w->site->isovalue, w->from[i], &w->hit[i]);
            if (!w->hit[i].side || scene->desc.no_shadows) isogi_trace__wave_escape(w, i);
            if (w->hit[i].side && isogi_trace__wave_reflect(w, i, alive, depth)) alive++;
        }
        w->count = alive;
    }
}

/* ==== the light at a site ============================================================================================ */

/* Irradiance by lights without extent, which one ray decides. side: that of the surface on which the site is. */
static void isogi_trace__site_lights(const isogi_trace__scene *scene, const isogi_trace__site *site, int side, double rgb[3],
                                     isogi_counters *counters) {
    const isogi_lighting *lighting = &scene->desc.lighting;
    size_t l;
    int c;
    for (l = 0; l < lighting->light_count; l++) {
        isogi_trace__beam beam;
        isogi_ray ray;
        isogi_hit hit;
        if (!isogi_trace__is_delta(&lighting->lights[l])) continue;
        if (!isogi_trace__light_beam(&lighting->lights[l], site->point, 0, 0, &beam) || !isogi_trace__site_beam(site, &beam)) continue;
        beam.tmax = isogi_trace__within(&scene->desc, site->point, site->origin, beam.dir, beam.tmax), hit.side = 0;
        if (!scene->desc.no_shadows)
            isogi_trace__site_rays(scene, site, side, (const float(*)[3]) & beam.dir, &beam.tmax, 1, &ray, &hit, counters);
        for (c = 0; c < 3 && !hit.side; c++) rgb[c] += beam.rgb[c];
    }
}

/* Scene without anything that could shine: no rays are needed. */
static int isogi_trace__dark(const isogi_trace__scene *scene) {
    const isogi_trace_desc *d = &scene->desc;
    return d->mode == ISOGI_TRACE_IRRADIANCE && !scene->has_env && !d->lighting.light_count && !d->emission_count && !d->material;
}

/* Variance that n samples leave open even where all of them agree: something they have not met may have a probability of 1 / (n + 2)
   (Laplace's rule of succession), and bring or hide as much light as is possible: that of the open sky on average, what the surface
   sends out, or what the samples have met, whichever is most. */
static double isogi_trace__unseen(double possible, double met, double n) {
    double most = possible > met ? possible : met;
    return most * most / ((n + 2) * (n + 2));
}

/* What paths of one place have brought: their mean, the sum of squares of what they differ from it by (Welford's running update: no
   cancellation), and the most. */
typedef struct isogi_trace__spread {
    double mean, square, most;
} isogi_trace__spread;

static void isogi_trace__spread_add(isogi_trace__spread *s, const double rgb[3], int number) {
    double luminance = isogi_trace__luminance(rgb), before = luminance - s->mean;
    s->mean += before / (number + 1), s->square += before * (luminance - s->mean);
    if (luminance > s->most) s->most = luminance;
}

/* Standard error of irradiance by n paths. What they have not met may be as bright as the brightest of them: where most are alike and a
   few far brighter, the variance alone tells of too little whenever too few of those were met. */
static float isogi_trace__spread_error(const isogi_trace__spread *s, int n, double possible) {
    double variance = n > 1 ? ISOGI_TRACE__PI * ISOGI_TRACE__PI * s->square / ((double)n * (n - 1)) : 0;
    return n > 1 ? (float)sqrt(variance + isogi_trace__unseen(possible, ISOGI_TRACE__PI * s->most, n)) : ISOGI_TRACE__NOT_READY;
}

/* Computes one site: values[3] (RGB irradiance) or values[order*order*channels], and the standard error of the luminance (TRANSFER:
   1 / sqrt(samples), from which isogi_trace__variance works it out under the lighting). */
static void isogi_trace__gather_site(const isogi_trace__scene *scene, const isogi_trace__site *site, isogi_trace__wave *wave,
                                     float *values, float *error, isogi_counters *counters) {
    const isogi_trace_desc *desc = &scene->desc;
    isogi_trace__spread spread = {0, 0, 0};
    double sum[3] = {0, 0, 0}, direct[3] = {0, 0, 0};
    int coefficients = desc->order * desc->order * desc->transfer_channels, first, i, c;
    wave->scene = scene, wave->site = site, wave->counters = counters;
    memset(wave->transfer, 0, sizeof wave->transfer);
    isogi_trace_material(desc, site->isovalue, NULL, wave->albedo, wave->emission);
    for (first = 0; first < desc->samples && !isogi_trace__dark(scene); first += ISOGI_TRACE__WAVE) {
        int count = desc->samples - first < ISOGI_TRACE__WAVE ? desc->samples - first : ISOGI_TRACE__WAVE;
        isogi_trace__wave_run(wave, first, count);
        for (i = 0; i < count; i++) {
            isogi_trace__spread_add(&spread, wave->light[i], first + i);
            for (c = 0; c < 3; c++) sum[c] += wave->light[i][c];
        }
    }
    *error = isogi_trace__spread_error(&spread, desc->samples, scene->possible);
    if (desc->samples > 1 && desc->mode == ISOGI_TRACE_TRANSFER) *error = (float)(1 / sqrt((double)desc->samples));
    if (desc->mode == ISOGI_TRACE_TRANSFER) {
        for (i = 0; i < coefficients; i++) values[i] = (float)(ISOGI_TRACE__PI * wave->transfer[i] / desc->samples);
        return;
    }
    isogi_trace__site_lights(scene, site, scene->high ? -1 : 1, direct, counters);
    for (c = 0; c < 3; c++) values[c] = (float)(ISOGI_TRACE__PI * sum[c] / desc->samples + direct[c]);
}

/* ==== the description ================================================================================================ */

static int isogi_trace__in_range_rgb(const float rgb[3], float most) {
    int c;
    for (c = 0; c < 3; c++)
        if (!isogi_trace__finite((double)rgb[c]) || rgb[c] < 0 || rgb[c] > most) return 0;
    return 1;
}

static int isogi_trace__table_valid(const isogi_albedo_point *p, size_t count, float most) {
    size_t i;
    if (count && !p) return 0;
    for (i = 0; i < count; i++) {
        if (!isogi_trace__in_range_rgb(p[i].rgb, most) || !isogi_trace__finite(p[i].value)) return 0;
        if (i && !(p[i].value > p[i - 1].value)) return 0;
    }
    return 1;
}

/* Distant light alone can be relit without rays. */
static int isogi_trace__distant(const isogi_lighting *lighting) {
    size_t i;
    for (i = 0; i < lighting->light_count; i++)
        if (lighting->lights[i].kind != ISOGI_LIGHT_DIRECTIONAL) return 0;
    return 1;
}

static const char *isogi_trace__light_fault(const isogi_trace_desc *d) {
    const char *fault = isogi_lighting_fault(&d->lighting);
    const int transfer = d->mode == ISOGI_TRACE_TRANSFER;
    if (fault) return fault;
    if (!isogi_trace__in_range_rgb(d->albedo, 1)) return "albedo: not 0 .. 1";
    if (!isogi_trace__table_valid(d->albedo_points, d->albedo_count, 1))
        return "albedo_points, albedo_count: NULL, not ascending, or a colour not 0 .. 1";
    if (d->emission_count && transfer) return "emission_count: not 0, which is not for ISOGI_TRACE_TRANSFER";
    if (!isogi_trace__table_valid(d->emission_points, d->emission_count, 1e30f))
        return "emission_points, emission_count: NULL, not ascending, or a colour not 0 .. 1e30";
    return !transfer || isogi_trace__distant(&d->lighting) ? NULL : "lights: only directional ones for ISOGI_TRACE_TRANSFER";
}

/* What is wrong with the members that need no pyramid. */
static const char *isogi_trace__fields_fault(const isogi_trace_desc *d) {
    if (d->mode != ISOGI_TRACE_IRRADIANCE && d->mode != ISOGI_TRACE_TRANSFER) return "mode: none of isogi_trace_mode";
    if (d->method != ISOGI_TRACE_FEEDBACK && d->method != ISOGI_TRACE_PATHS) return "method: none of isogi_trace_method";
    if (!isogi_trace__finite((double)d->error) || d->error < 0) return "error: negative or not finite";
    if (d->normals != ISOGI_NORMAL_SMOOTH && d->normals != ISOGI_NORMAL_TRILINEAR) return "normals: none of isogi_normal_kind";
    if ((int)d->lookup < 0 || d->lookup > ISOGI_TRACE_BSPLINE) return "lookup: none of isogi_trace_lookup";
    if (d->order < 0 || d->order > ISOGI_TRACE__MAX_ORDER) return "order: not 0 .. 6";
    if (d->bounces < -1) return "bounces: below -1";
    if (d->samples < 0 || d->samples > 1 << 24) return "samples: not 0 .. 2^24";
    if (d->transfer_channels != 0 && d->transfer_channels != 1 && d->transfer_channels != 3) return "transfer_channels: not 0, 1 or 3";
    if (!isogi_trace__finite((double)d->offset)) return "offset: not finite";
    if (!isogi_trace__finite(d->isovalue_min) || !isogi_trace__finite(d->isovalue_max)) return "isovalue_min, isovalue_max: not finite";
    if (d->isovalue_min > d->isovalue_max) return "isovalue_min: above isovalue_max";
    if (!isogi_trace__finite3(d->lattice_min) || !isogi_trace__finite3(d->lattice_max)) return "lattice_min, lattice_max: not finite";
    if (d->sides != ISOGI_TRACE_LOW_SIDE && d->sides != ISOGI_TRACE_HIGH_SIDE && d->sides != ISOGI_TRACE_BOTH_SIDES)
        return "sides: none of isogi_trace_sides";
    if (!isogi_trace__finite((double)d->reach) || d->reach < 0) return "reach: negative or not finite";
    if (!isogi_trace__finite((double)d->hierarchy) || d->hierarchy < 0) return "hierarchy: negative or not finite";
    if (d->hierarchy > 0 && d->lazy) return "hierarchy: not for lazy textures";
    if ((int)d->storage < 0 || d->storage > ISOGI_TRACE_BYTE) return "storage: none of isogi_trace_format";
    if (d->storage == ISOGI_TRACE_RGB9E5 && d->mode == ISOGI_TRACE_TRANSFER) return "storage: ISOGI_TRACE_RGB9E5 holds no transfer";
    return isogi_trace__light_fault(d);
}

/* And with those that a gathering at points needs, too. A field given by a function has no voxels to be baked. offset: in voxels. */
static const char *isogi_trace__desc_fault(const isogi_trace_desc *d) {
    if (!d) return "desc: NULL";
    if (!d->pyramid) return "pyramid: NULL";
    if (!isogi_vol_volume(d->pyramid)->data) return "pyramid: of a function, which has no voxels: isogi_trace_gather_field";
    if (d->offset > 1) return "offset: above 1 voxel";
    return isogi_trace__fields_fault(d);
}

/* Grey surfaces need one set of coefficients. */
static int isogi_trace__grey(const isogi_trace_desc *d) {
    size_t i;
    int grey = d->albedo[0] >= d->albedo[1] && d->albedo[0] <= d->albedo[1] && d->albedo[0] >= d->albedo[2] &&
               d->albedo[0] <= d->albedo[2];
    for (i = 0; i < d->albedo_count; i++) {
        const float *c = d->albedo_points[i].rgb;
        grey = grey && c[0] >= c[1] && c[0] <= c[1] && c[0] >= c[2] && c[0] <= c[2];
    }
    return grey && !d->material;
}

/* The middle of the volume, in world space. Returns a quarter of its diagonal. */
static double isogi_trace__middle(const isogi_trace__scene *scene, double middle[3]) {
    double corner[3], end[3], zero[3] = {0, 0, 0}, square = 0;
    int a, b;
    isogi_vol_to_world(scene->pyramid, zero, corner);
    for (a = 0; a < 3; a++) {
        for (b = 0; b < 3; b++) end[b] = a == b ? (double)(scene->volume->size[b] - 1) : 0;
        middle[a] = 0.5 * (double)(scene->volume->size[a] - 1);
        isogi_vol_to_world(scene->pyramid, end, end);
        for (b = 0; b < 3; b++) square += (end[b] - corner[b]) * (end[b] - corner[b]);
    }
    isogi_vol_to_world(scene->pyramid, middle, middle);
    return 0.25 * sqrt(square);
}

static double isogi_trace__within_both(double x, double most) { return x > most ? most : x < -most ? -most : x; }

/* Where a lamp is measured: from the middle, but no closer than `least`, since a lamp there would be all that counts, and from before a
   rectangle, which has a dark side. */
static void isogi_trace__measure_from(const isogi_light *light, const double middle[3], double least, float point[3]) {
    double away[3], front[3] = {1, 0, 0}, apart, length;
    int a, rectangle = light->kind == ISOGI_LIGHT_RECTANGLE, moved;
    const float *u = light->edge[0], *v = light->edge[1];
    for (a = 0; a < 3; a++) {
        away[a] = middle[a] - (double)light->vector[a];
        point[a] = (float)isogi_trace__within_both(middle[a], (double)FLT_MAX);
    }
    for (a = 0; a < 3 && rectangle; a++)
        front[a] = (double)u[(a + 1) % 3] * (double)v[(a + 2) % 3] - (double)u[(a + 2) % 3] * (double)v[(a + 1) % 3];
    apart = sqrt(isogi_trace__dot_wide(away, away)), length = sqrt(isogi_trace__dot_wide(front, front));
    moved = apart < least || (rectangle && !(isogi_trace__dot_wide(away, front) > 0));
    if (light->kind == ISOGI_LIGHT_DIRECTIONAL || !moved || !(length > 0)) return;
    if (light->kind == ISOGI_LIGHT_SPHERE && (double)light->radius >= least) return; /* all around, or none of it is close */
    for (a = 0; a < 3; a++) {
        double dir = rectangle || !(apart > 0) ? front[a] / length : away[a] / apart;
        point[a] = (float)isogi_trace__within_both((double)light->vector[a] + (apart > least ? apart : least) * dir, (double)FLT_MAX);
    }
}

/* The lighting of an open place, lamps as far off as they are from the middle of the volume: sh[3 * order^2], order up to 3. */
static isogi_result isogi_trace__middle_light(const isogi_trace__scene *scene, int order, float *sh) {
    const isogi_lighting *all = &scene->desc.lighting;
    isogi_lighting part = *all;
    float point[3], lamp[3 * 9];
    double middle[3], least = isogi_trace__middle(scene, middle);
    isogi_result result;
    size_t k;
    int i;
    part.light_count = 0;
    result = isogi_sh_project(sh, order, &part, NULL);
    memset(&part.env, 0, sizeof part.env), part.light_count = 1;
    for (k = 0; k < all->light_count && result == ISOGI_OK; k++) {
        part.lights = &all->lights[k];
        isogi_trace__measure_from(part.lights, middle, least, point);
        result = isogi_sh_project(lamp, order, &part, point);
        for (i = 0; i < 3 * order * order && result == ISOGI_OK; i++) sh[i] += lamp[i];
    }
    return result;
}

/* Twice the irradiance of an open surface that faces most light, as the next power of two: the unit of short formats. */
static isogi_result isogi_trace__scene_unit(isogi_trace__scene *scene) {
    float sky[3 * 9], glow[3];
    double most = 0;
    isogi_result result = isogi_trace__middle_light(scene, 3, sky);
    size_t k;
    int i, a, e;
    if (result == ISOGI_OK) result = isogi_sh_convolve_cosine(sky, sky, 3, 3);
    if (result != ISOGI_OK) return result;
    for (i = 0; i < 27; i++) {
        float dir[1][3], e3[3];
        for (a = 0; a < 3; a++) dir[0][a] = (float)((a == 0 ? i : a == 1 ? i / 3 : i / 9) % 3 - 1);
        if (i == 13) continue;
        isogi_sh_eval_sum(e3, sky, 3, 3, (const float(*)[3])dir, 1);
        for (a = 0; a < 3; a++) most = (double)e3[a] > most ? (double)e3[a] : most;
    }
    for (k = 0; k < scene->desc.emission_count; k++) {
        memcpy(glow, scene->desc.emission_points[k].rgb, sizeof glow);
        for (a = 0; a < 3; a++) most = ISOGI_TRACE__PI * (double)glow[a] > most ? ISOGI_TRACE__PI * (double)glow[a] : most;
    }
    most = isogi_trace__clamp(most, 1e33); /* what short formats hold are then floats that are neither infinite nor 0 */
    frexp(most > 1e-36 ? most : 1e-36, &e);
    scene->unit = most > 0 ? ldexp(1, scene->desc.bounces ? e + 1 : e) : 1;
    return ISOGI_OK;
}

/* Luminance of the irradiance of an open surface, averaged over all orientations: pi times the mean radiance, and
   Y_0 = 1 / sqrt(4 pi). */
static double isogi_trace__open_luminance(const float light[3]) {
    double rgb[3];
    int a;
    for (a = 0; a < 3; a++) rgb[a] = (double)light[a] * 0.28209479177387814 * ISOGI_TRACE__PI;
    return isogi_trace__clamp(isogi_trace__luminance(rgb), 1e30);
}

/* The same at a point. 0 where it cannot be told. */
static isogi_result isogi_trace__open_at(const isogi_lighting *lighting, const float point[3], double *open) {
    float light[3] = {0, 0, 0};
    isogi_result result = isogi_sh_project(light, 1, lighting, point);
    *open = result == ISOGI_OK ? isogi_trace__open_luminance(light) : 0;
    return result;
}

/* The same of an open texel; and what a sample may bring, which may be a glow. */
static isogi_result isogi_trace__open_light(isogi_trace__scene *scene) {
    float light[3] = {0, 0, 0};
    double rgb[3];
    isogi_result result = isogi_trace__middle_light(scene, 1, light);
    size_t k;
    int a;
    scene->open_light = isogi_trace__open_luminance(light);
    scene->possible = scene->open_light;
    for (k = 0; k < scene->desc.emission_count; k++) {
        double glow;
        for (a = 0; a < 3; a++) rgb[a] = ISOGI_TRACE__PI * (double)scene->desc.emission_points[k].rgb[a];
        glow = isogi_trace__luminance(rgb);
        if (glow > scene->possible) scene->possible = glow;
    }
    if (!(scene->open_light > 0)) scene->open_light = scene->possible; /* glows are all the light that there is */
    if (scene->possible > 0) frexp(scene->possible, &a), scene->square = ldexp(1, 2 * a);
    return result;
}

/* Whether some light looks wide, by its area, from the middle of the volume. */
static int isogi_trace__wide_lights(const isogi_trace__scene *scene) {
    double middle[3], least = isogi_trace__middle(scene, middle);
    size_t k;
    int a;
    for (k = 0; k < scene->desc.lighting.light_count; k++) {
        const isogi_light *l = &scene->desc.lighting.lights[k];
        double to[3], u = 0, v = 0, apart = 1, size = (double)l->radius;
        float point[3];
        if (isogi_trace__is_delta(l) || !(l->rgb[0] > 0 || l->rgb[1] > 0 || l->rgb[2] > 0)) continue;
        isogi_trace__measure_from(l, middle, least, point);
        for (a = 0; a < 3; a++) {
            to[a] = (double)l->vector[a] - (double)point[a];
            u += (double)l->edge[0][a] * (double)l->edge[0][a], v += (double)l->edge[1][a] * (double)l->edge[1][a];
        }
        if (l->kind != ISOGI_LIGHT_DIRECTIONAL) apart = sqrt(isogi_trace__dot_wide(to, to));
        if (l->kind == ISOGI_LIGHT_RECTANGLE) size = sqrt(sqrt(u) * sqrt(v) / ISOGI_TRACE__PI); /* of a disc as large */
        if (size > ISOGI_TRACE__WIDE * apart) return 1;
    }
    return 0;
}

/* The scene of a valid description. What it allocates is freed by isogi_trace__sky_free, on failure too. */
static isogi_result isogi_trace__scene_set(isogi_trace__scene *scene, const isogi_trace_desc *desc,
                                           const isogi_context *context) {
    isogi_trace_desc *d = &scene->desc;
    isogi_result result;
    double range[2];
    memset(scene, 0, sizeof *scene);
    *d = *desc;
    scene->high = d->sides == ISOGI_TRACE_HIGH_SIDE;
    scene->pyramid = d->pyramid;
    scene->volume = isogi_vol_volume(d->pyramid);
    isogi_vol_range(d->pyramid, range);
    scene->range = range[1] > range[0] ? range[1] - range[0] : 1;
    scene->flags = d->capped ? (uint32_t)ISOGI_RAY_CAPPED : 0;
    scene->has_env = d->lighting.env.rgb || d->lighting.env.sh;
    if (!d->order) d->order = 5;
    if (d->mode == ISOGI_TRACE_TRANSFER) d->error = 0; /* of which light? */
    if (!d->samples) d->samples = 64;
    if (!(d->offset > 0 || d->offset < 0)) d->offset = 0.25f;
    if (!d->transfer_channels) d->transfer_channels = isogi_trace__grey(d) ? 1 : 3;
    isogi_trace__scene_matrix(scene);
    isogi_trace__scene_cells(scene);
    if (!d->storage) d->storage = d->mode == ISOGI_TRACE_TRANSFER ? ISOGI_TRACE_HALF : ISOGI_TRACE_FLOAT;
    scene->unit = scene->square = 1;
    if (d->mode == ISOGI_TRACE_IRRADIANCE && d->storage != ISOGI_TRACE_FLOAT) {
        result = isogi_trace__scene_unit(scene);
        if (result != ISOGI_OK) return result;
    }
    if (d->mode == ISOGI_TRACE_TRANSFER) return ISOGI_OK;
    result = isogi_trace__open_light(scene);
    if (result != ISOGI_OK) return result;
    scene->wide = isogi_trace__wide_lights(scene);
    return isogi_trace__sky_build(&scene->sky, &d->lighting.env, context);
}

/* TRANSFER: a lighting's coefficients, RGB interleaved: of all of it, and of what it brings at least, see isogi_trace_lighting. */
typedef struct isogi_trace__lit {
    float all[ISOGI_TRACE__VALUES], least[ISOGI_TRACE__VALUES];
} isogi_trace__lit;

/* ==== the texture: bricks of texels, there where light was asked for ================================================= */

enum {
    ISOGI_TRACE__UNKNOWN = 0,
    ISOGI_TRACE__NO_SURFACE,
    ISOGI_TRACE__NOT_ASKED,
    ISOGI_TRACE__BEYOND_EMPTY, /* lazy: not read by a surface within the interval of isovalues, and it has none itself */
    ISOGI_TRACE__BEYOND,       /* so, too, but it has one: computed only where it is the nearest one that has */
    ISOGI_TRACE__READABLE,
    ISOGI_TRACE__WANTED,
    ISOGI_TRACE__QUEUED, /* wanted, and a node has been made for it */
    ISOGI_TRACE__DRAFT,  /* readable; more samples will follow */
    ISOGI_TRACE__DONE
};

/* A brick keeps records only for the texels of `held`, in the order of their bits. A record is the standard error (the upper half of
   a float, rounded up) and the light in the format of the storage; all little-endian, so that a record is the same bytes anywhere. */
typedef struct isogi_trace__brick {
    uint8_t state[ISOGI_TRACE__TEXELS];
    int queued;
    uint32_t newest;    /* the largest number in `node`, */
    uint32_t around[2]; /* and in those of the bricks up to 1 and up to 2 away, as far as it is newer than its first */
    uint64_t held;
    uint8_t *records;   /* NULL until one of them is computed */
    uint32_t *node;     /* number + 1 of what gathers each texel's light, 0 = none; NULL = none at all */
} isogi_trace__brick;

typedef struct isogi_trace__ref {
    isogi_trace__brick *brick;
    size_t texel[3];
    uint32_t slot;
} isogi_trace__ref;

typedef struct isogi_trace__feedback isogi_trace__feedback;

struct isogi_trace {
    isogi_trace__scene scene;
    isogi_context context;
    size_t lattice[3];
    double first[3], last[3], step[3]; /* grid coordinates of texels */
    size_t box_first[3], box_end[3];   /* texels that may be computed */
    int values;                        /* floats of a texel */
    int format;                        /* isogi_trace_format of the records */
    size_t record;                     /* bytes of one */
    size_t size[3], brick_count;       /* bricks */
    isogi_trace__brick **bricks;       /* NULL: nothing known (lazy) or nothing in it */
    size_t *queue;                     /* bricks with wanted texels */
    size_t queue_first, queue_count, queue_capacity;
    uint64_t wanted, done;
    isogi_trace__ref *batch;
    isogi_trace__wave *waves; /* PATHS: of tasks */
    isogi_counters *task_counters;
    isogi_counters counters;
    isogi_trace__lit lit;             /* TRANSFER: the lighting */
    float square[ISOGI_TRACE__VALUES]; /* TRANSFER: of the lighting's square, for the error, */
    double square_unit;                /* in this unit, a power of two */
    isogi_trace *high; /* BOTH_SIDES: the other side's texture, owned */
    int wide;      /* AVX2 may be used */
    isogi_trace *coarse; /* hierarchy: the texture of every second texel, owned */
    int refined;         /* the cells in which it is not enough are wanted, */
    size_t refine_next;  /* as far as to this one */
    struct isogi_trace__feedback *feedback; /* NULL: paths are traced */
    double share[2];   /* of the progress that baking reports, from and to */
    double least;      /* hierarchy: remainder that isogi_trace_step reported last; 1 before it has */
    uint64_t lighting_hash, colours_hash; /* of what the light was gathered under: borrowed arrays may change in place */
};

/* ==== how light is held ============================================================================================== */

static uint32_t isogi_trace__float_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static float isogi_trace__bits_float(uint32_t bits) {
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void isogi_trace__put(uint8_t *to, uint64_t value, int bytes) {
    int i;
    for (i = 0; i < bytes; i++) to[i] = (uint8_t)(value >> 8 * i);
}

static uint64_t isogi_trace__get(const uint8_t *from, int bytes) {
    uint64_t value = 0;
    int i;
    for (i = 0; i < bytes; i++) value |= (uint64_t)from[i] << 8 * i;
    return value;
}

/* Three mantissas of 9 bits and a common exponent (EXT_texture_shared_exponent). Negative values and NaN are 0. */
static uint32_t isogi_trace__to_rgb9e5(const float rgb[3]) {
    float x[3], most = 0;
    uint32_t packed, q[3];
    int c, exponent;
    for (c = 0; c < 3; c++) {
        x[c] = rgb[c] > 0 ? rgb[c] : 0;
        x[c] = x[c] < 65408.0f ? x[c] : 65408.0f;
        most = x[c] > most ? x[c] : most;
    }
    exponent = (int)(isogi_trace__float_bits(most) >> 23) - 126; /* most < 2^exponent */
    exponent = exponent > -15 ? exponent : -15;
    if (floor(ldexp((double)most, 9 - exponent) + 0.5) > 511) exponent++;
    packed = (uint32_t)(exponent + 15) << 27;
    for (c = 0; c < 3; c++) {
        q[c] = (uint32_t)(ldexp((double)x[c], 9 - exponent) + 0.5);
        packed |= (q[c] < 511 ? q[c] : 511) << 9 * c;
    }
    return packed;
}

static void isogi_trace__from_rgb9e5(uint32_t packed, float rgb[3]) {
    int c, exponent = (int)(packed >> 27) - 24;
    float scale = isogi_trace__bits_float((uint32_t)(exponent + 127) << 23);
    for (c = 0; c < 3; c++) rgb[c] = (float)(packed >> 9 * c & 511) * scale;
}

/* The upper half of a float that is no less: errors are not understated. */
static uint32_t isogi_trace__to_short(float x) {
    uint32_t bits = isogi_trace__float_bits(x);
    return bits >= 0x7f800000u ? 0x7f80u : (bits + 0xffffu) >> 16; /* neither NaN nor negative occur;
                                                                      the largest float rounds to infinity */
}

static size_t isogi_trace__bits(uint64_t x) {
    x -= x >> 1 & 0x5555555555555555u;
    x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
    x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    return (size_t)((x * 0x0101010101010101u) >> 56);
}

static size_t isogi_trace__rank(uint64_t held, uint32_t slot) { return isogi_trace__bits(held & (((uint64_t)1 << slot) - 1)); }

static uint32_t isogi_trace__lowest_bit(uint64_t bits) {
#if defined(__GNUC__) && !defined(__TINYC__)
    return (uint32_t)__builtin_ctzll(bits);
#else
    uint32_t i = 0;
    while (!(bits >> i & 1)) i++;
    return i;
#endif
}

static uint8_t *isogi_trace__record(const isogi_trace *t, const isogi_trace__brick *brick, uint32_t slot) {
    return brick->records + isogi_trace__rank(brick->held, slot) * t->record;
}

/* 2 bytes of error; BYTE transfer has 2 of scale. */
static size_t isogi_trace__record_size(const isogi_trace *t) {
    size_t n = (size_t)t->values;
    switch (t->format) {
    case ISOGI_TRACE_HALF: return 2 + 2 * n;
    case ISOGI_TRACE_RGB9E5: return 2 + 4;
    case ISOGI_TRACE_BYTE: return t->scene.desc.mode == ISOGI_TRACE_TRANSFER ? 4 + n : 2 + n;
    default: return 2 + 4 * n;
    }
}

static float isogi_trace__record_error(const uint8_t *record) {
    return isogi_trace__bits_float((uint32_t)isogi_trace__get(record, 2) << 16);
}

/* BYTE: irradiance by its square root, since eyes judge ratios; transfer in 127ths of the texel's largest coefficient. */
static void isogi_trace__bytes_write(const isogi_trace *t, uint8_t *to, const float *values) {
    double most = 0, unit = 2 * t->scene.unit, scale;
    int i;
    if (t->scene.desc.mode != ISOGI_TRACE_TRANSFER) {
        for (i = 0; i < 3; i++) to[i] = (uint8_t)(255 * sqrt(isogi_trace__clamp((double)values[i] / unit, 1)) + 0.5);
        return;
    }
    for (i = 0; i < t->values; i++) most = fabs((double)values[i]) > most ? fabs((double)values[i]) : most;
    isogi_trace__put(to, isogi_trace__to_short((float)most), 2);
    scale = (double)isogi_trace__bits_float((uint32_t)isogi_trace__get(to, 2) << 16) / 127;
    for (i = 0; i < t->values; i++) to[2 + i] = (uint8_t)(128 + (scale > 0 ? (int)floor((double)values[i] / scale + 0.5) : 0));
}

static void isogi_trace__record_write(const isogi_trace *t, uint8_t *record, const float *values, float error) {
    float rgb[3];
    int i;
    isogi_trace__put(record, isogi_trace__to_short(error), 2);
    switch (t->format) {
    case ISOGI_TRACE_HALF:
        for (i = 0; i < t->values; i++)
            isogi_trace__put(record + 2 + 2 * i, isogi_float_to_half((float)((double)values[i] / t->scene.unit)), 2);
        break;
    case ISOGI_TRACE_RGB9E5:
        for (i = 0; i < 3; i++) rgb[i] = (float)((double)values[i] / t->scene.unit);
        isogi_trace__put(record + 2, isogi_trace__to_rgb9e5(rgb), 4);
        break;
    case ISOGI_TRACE_BYTE: isogi_trace__bytes_write(t, record + 2, values); break;
    default:
        for (i = 0; i < t->values; i++) isogi_trace__put(record + 2 + 4 * i, isogi_trace__float_bits(values[i]), 4);
    }
}

#if defined(ISOGI_TRACE__VECTORS) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
/* Four numbers as isogi_half_to_float reads them, lower byte first, times a unit */
static inline void isogi_trace__four_halves(float *values, const uint8_t *from, float unit) {
    typedef uint32_t four __attribute__((vector_size(16)));
    typedef int32_t signs __attribute__((vector_size(16)));
    typedef float floats __attribute__((vector_size(16)));
    typedef uint16_t shorts __attribute__((vector_size(8)));
    shorts raw;
    four half, rest, small;
    floats x;
    memcpy(&raw, from, sizeof raw);
    half = __builtin_convertvector(raw, four);
    rest = half & 0x7fffu;
    small = (four)((signs)rest < 0x400);
    x = __builtin_convertvector((signs)rest, floats) * (1.0f / 16777216); /* 2^-24 */
    x = unit * (floats)((small & (four)x) | (~small & (rest * 0x2000u + 0x38000000u)) | (half & 0x8000u) << 16);
    memcpy(values, &x, sizeof x);
}
#endif

static void isogi_trace__record_read(const isogi_trace *t, const uint8_t *record, float *values) {
    const uint8_t *from = record + 2;
    float unit = (float)t->scene.unit, scale;
    int i;
    switch (t->format) {
    case ISOGI_TRACE_HALF:
        i = 0;
#if defined(ISOGI_TRACE__VECTORS) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        for (; i + 4 <= t->values; i += 4) isogi_trace__four_halves(values + i, from + 2 * i, unit);
#endif
        for (; i < t->values; i++) values[i] = unit * isogi_half_to_float((uint16_t)(from[2 * i] | from[2 * i + 1] << 8));
        break;
    case ISOGI_TRACE_RGB9E5:
        isogi_trace__from_rgb9e5((uint32_t)isogi_trace__get(from, 4), values);
        for (i = 0; i < 3; i++) values[i] *= unit;
        break;
    case ISOGI_TRACE_BYTE:
        if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) {
            scale = isogi_trace__bits_float((uint32_t)isogi_trace__get(from, 2) << 16) / 127;
            for (i = 0; i < t->values; i++) values[i] = scale * (float)(from[2 + i] - 128);
        } else
            for (i = 0; i < 3; i++) values[i] = 2 * unit * ((float)from[i] / 255) * ((float)from[i] / 255);
        break;
    default:
        for (i = 0; i < t->values; i++) values[i] = isogi_trace__bits_float((uint32_t)isogi_trace__get(from + 4 * i, 4));
    }
}

/* ==== the texels of the lattice ====================================================================================== */

static void isogi_trace__texel_grid(const isogi_trace *t, const size_t texel[3], double grid[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        double nearest;
        grid[a] = texel[a] + 1 == t->lattice[a] && texel[a] ? t->last[a] : t->first[a] + (double)texel[a] * t->step[a];
        nearest = floor(grid[a] + 0.5);
        if (fabs(grid[a] - nearest) < 1e-9) grid[a] = nearest;
    }
}

/* Where and on which isosurface a texel lies. Its light is that at its own place, so a surface must pass there: the value at the
   texel is inside of its own surface, hence one of the cells around it must reach lower. 0: it does not. */
static int isogi_trace__texel_place(const isogi_trace *t, const size_t texel[3], isogi_trace__site *site) {
    const isogi_volume *v = t->scene.volume;
    double grid[3], range[2], least;
    size_t low[3], high[3];
    int a, border = 0;
    isogi_trace__texel_grid(t, texel, grid);
    for (a = 0; a < 3; a++) border |= grid[a] <= 0 || grid[a] >= (double)(v->size[a] - 1);
    if (!isogi_trace__locate(v, grid, &site->place)) return 0;
    site->isovalue = isogi_trace__value_least(v, &site->place, &least);
    if (!isogi_trace__finite(site->isovalue)) return 0;
    if (least < site->isovalue && isogi_trace__finite(least)) return 1;
    for (a = 0; a < 3; a++) {
        low[a] = site->place.cell[a], high[a] = low[a] + 1;
        if (site->place.local[a] <= 0 && low[a]) low[a]--;
    }
    isogi_volume_range(v, low, high, range);
    return range[0] < site->isovalue || (border && t->scene.desc.capped);
}

/* Where texels lie, and their normals; up to TEXELS of them. valid: 0 where there is no surface, or no normal; on the high side also
   where no matter lies behind the surface: rays from there would see the sky from within closed solids. */
static void isogi_trace__texel_sites(const isogi_trace *t, const size_t (*texels)[3], size_t count, isogi_trace__site *sites,
                                     uint8_t *valid) {
    double grid[3];
    int beyond;
    isogi_hit place[ISOGI_TRACE__TEXELS];
    float normal[ISOGI_TRACE__TEXELS][3];
    size_t i, n = 0;
    for (i = 0; i < count; i++) {
        valid[i] = (uint8_t)isogi_trace__texel_place(t, texels[i], &sites[i]);
        if (valid[i]) place[n++] = sites[i].place;
    }
    if (n) isogi_trace__place_normals(t->scene.pyramid, t->scene.desc.normals, place, n, normal);
    for (i = n = 0; i < count; i++)
        if (valid[i]) {
            valid[i] = (uint8_t)isogi_trace__site_normal(&t->scene, normal[n++], &sites[i]);
            if (t->scene.high && valid[i])
                valid[i] = (uint8_t)isogi_trace__off_surface(&t->scene, &sites[i], 1, ISOGI_TRACE__DEPTH, grid, &beyond);
        }
}

static int isogi_trace__texel_site(const isogi_trace *t, const size_t texel[3], isogi_trace__site *site) {
    uint8_t valid;
    isogi_trace__texel_sites(t, (const size_t(*)[3])texel, 1, site, &valid);
    return valid;
}

/* Whether a surface of the isovalue interval may read one of the texels low..high: there are values on both sides of it, or within
   it, in the lattice cells around them that lookups reach across. */
static int isogi_trace__in_range(const isogi_trace *t, const size_t low[3], const size_t high[3]) {
    const isogi_trace_desc *d = &t->scene.desc;
    const isogi_volume *v = t->scene.volume;
    size_t first[3], last[3], voxels = 1;
    double range[2];
    double reach = d->lookup == ISOGI_TRACE_BSPLINE ? 2 : 1;
    int a, cut = 0; /* the cap of the border closes surfaces without any value below them */
    if (isogi_trace__zero(d->isovalue_min) && isogi_trace__zero(d->isovalue_max)) return 1;
    for (a = 0; a < 3; a++) {
        double end = (double)(v->size[a] - 1);
        first[a] = (size_t)isogi_trace__clamp(floor(t->first[a] + ((double)low[a] - reach) * t->step[a]), end);
        last[a] = (size_t)isogi_trace__clamp(ceil(t->first[a] + ((double)high[a] + reach) * t->step[a]), end);
        if ((double)low[a] < reach || !(t->step[a] > 0)) first[a] = 0;
        if ((double)high[a] + reach >= (double)t->lattice[a] || !(t->step[a] > 0)) last[a] = v->size[a] - 1;
        cut |= d->capped && (first[a] == 0 || last[a] == v->size[a] - 1);
        voxels *= last[a] - first[a] + 1;
    }
    isogi_trace__block_range(t->scene.pyramid, first, last, range);
    if (!((cut || range[0] < d->isovalue_max) && range[1] >= d->isovalue_min)) return 0;
    if (voxels > 125) return 1;
    isogi_volume_range(v, first, last, range);
    return (cut || range[0] < d->isovalue_max) && range[1] >= d->isovalue_min;
}

static int isogi_trace__in_box(const isogi_trace *t, const size_t texel[3]) {
    int a;
    for (a = 0; a < 3; a++)
        if (texel[a] < t->box_first[a] || texel[a] >= t->box_end[a]) return 0;
    return 1;
}

/* Up to TEXELS texels: not asked for, without a surface, or wanted. any: whatever the interval of isovalues. */
static void isogi_trace__classify_texels(const isogi_trace *t, const size_t (*texels)[3], size_t count, int any, uint8_t *state) {
    size_t asked[ISOGI_TRACE__TEXELS][3], i, n = 0;
    isogi_trace__site site[ISOGI_TRACE__TEXELS];
    uint8_t valid[ISOGI_TRACE__TEXELS];
    for (i = 0; i < count; i++) {
        state[i] = ISOGI_TRACE__NOT_ASKED;
        if (!isogi_trace__in_box(t, texels[i]) || !(any || isogi_trace__in_range(t, texels[i], texels[i]))) continue;
        state[i] = ISOGI_TRACE__UNKNOWN;
        memcpy(asked[n++], texels[i], sizeof asked[0]);
    }
    isogi_trace__texel_sites(t, (const size_t(*)[3])asked, n, site, valid);
    for (i = n = 0; i < count; i++)
        if (state[i] == ISOGI_TRACE__UNKNOWN) state[i] = valid[n++] ? ISOGI_TRACE__WANTED : ISOGI_TRACE__NO_SURFACE;
}

static int isogi_trace__classify(const isogi_trace *t, const size_t texel[3], int any) {
    uint8_t state;
    isogi_trace__classify_texels(t, (const size_t(*)[3])texel, 1, any, &state);
    return state;
}

static size_t isogi_trace__brick_of(const isogi_trace *t, const size_t texel[3], uint32_t *slot) {
    size_t x = texel[0], y = texel[1], z = texel[2];
    *slot = (uint32_t)(x % ISOGI_TRACE__SIDE +
                       ISOGI_TRACE__SIDE * (y % ISOGI_TRACE__SIDE + ISOGI_TRACE__SIDE * (z % ISOGI_TRACE__SIDE)));
    return x / ISOGI_TRACE__SIDE + t->size[0] * (y / ISOGI_TRACE__SIDE + t->size[1] * (z / ISOGI_TRACE__SIDE));
}

/* 0 if the slot lies beyond the lattice. */
static int isogi_trace__texel_of(const isogi_trace *t, size_t brick, size_t slot, size_t texel[3]) {
    texel[0] = brick % t->size[0] * ISOGI_TRACE__SIDE + slot % ISOGI_TRACE__SIDE;
    texel[1] = brick / t->size[0] % t->size[1] * ISOGI_TRACE__SIDE + slot / ISOGI_TRACE__SIDE % ISOGI_TRACE__SIDE;
    texel[2] = brick / t->size[0] / t->size[1] * ISOGI_TRACE__SIDE + slot / ISOGI_TRACE__SIDE / ISOGI_TRACE__SIDE;
    return texel[0] < t->lattice[0] && texel[1] < t->lattice[1] && texel[2] < t->lattice[2];
}

/* The brick at a place in the order in which the lattice is baked: cube by cube. */
static size_t isogi_trace__in_order(const isogi_trace *t, size_t place) {
    const size_t most = ISOGI_TRACE_CUBE / ISOGI_TRACE__SIDE;
    size_t first[3], side[3], each = t->size[0] * t->size[1]; /* bricks of a cube, of a row and of a layer of them, by one along the axis */
    int a;
    for (a = 2; a >= 0; a--) {
        first[a] = place / (each * most) * most, place -= first[a] * each;
        side[a] = t->size[a] - first[a] < most ? t->size[a] - first[a] : most;
        each = a == 2 ? side[2] * t->size[0] : side[2] * side[1];
    }
    return first[0] + place % side[0] +
           t->size[0] * (first[1] + place / side[0] % side[1] + t->size[1] * (first[2] + place / side[0] / side[1]));
}

static isogi_trace__brick *isogi_trace__brick_new(const isogi_trace *t) {
    isogi_trace__brick *brick = (isogi_trace__brick *)isogi_allocate(&t->context, 1, sizeof *brick);
    if (brick) memset(brick, 0, sizeof *brick);
    return brick;
}

/* Gives back the numbers of its nodes. */
static void isogi_trace__brick_forget(const isogi_trace *t, isogi_trace__brick *brick) {
    isogi_release(&t->context, brick->node, ISOGI_TRACE__TEXELS, sizeof(uint32_t));
    brick->node = NULL, brick->newest = 0;
}

static void isogi_trace__brick_free(const isogi_trace *t, isogi_trace__brick *brick) {
    if (!brick) return;
    isogi_trace__brick_forget(t, brick);
    isogi_release(&t->context, brick->records, isogi_trace__bits(brick->held), t->record);
    isogi_release(&t->context, brick, 1, sizeof *brick);
}

/* Room for the records of these texels; those of others are kept. */
static isogi_result isogi_trace__brick_hold(const isogi_trace *t, isogi_trace__brick *brick, uint64_t texels) {
    uint64_t held = brick->held | texels;
    uint8_t *records;
    uint32_t slot;
    if (held == brick->held) return ISOGI_OK;
    records = (uint8_t *)isogi_allocate(&t->context, isogi_trace__bits(held), t->record);
    if (!records) return ISOGI_NO_MEMORY;
    for (slot = 0; slot < ISOGI_TRACE__TEXELS && brick->records; slot++)
        if (brick->held >> slot & 1)
            memcpy(records + isogi_trace__rank(held, slot) * t->record,
                   brick->records + isogi_trace__rank(brick->held, slot) * t->record, t->record);
    isogi_release(&t->context, brick->records, isogi_trace__bits(brick->held), t->record);
    brick->records = records, brick->held = held;
    return ISOGI_OK;
}

/* Room for one more brick in the queue. */
static isogi_result isogi_trace__queue_reserve(isogi_trace *t) {
    size_t capacity = t->queue_capacity ? 2 * t->queue_capacity : 64, *queue;
    if (t->queue_count < t->queue_capacity) return ISOGI_OK;
    if (t->queue_first) {
        memmove(t->queue, t->queue + t->queue_first, (t->queue_count - t->queue_first) * sizeof *t->queue);
        t->queue_count -= t->queue_first, t->queue_first = 0;
        return ISOGI_OK;
    }
    queue = (size_t *)isogi_allocate(&t->context, capacity, sizeof *queue);
    if (!queue) return ISOGI_NO_MEMORY;
    if (t->queue) memcpy(queue, t->queue, t->queue_count * sizeof *queue);
    isogi_release(&t->context, t->queue, t->queue_capacity, sizeof *queue);
    t->queue = queue, t->queue_capacity = capacity;
    return ISOGI_OK;
}

/* ==== the whole lattice or an interval of isovalues: all texels are classified at once =============================== */

static void isogi_trace__classify_task(void *arg, size_t i) {
    isogi_trace *t = (isogi_trace *)arg;
    isogi_trace__brick *brick = t->bricks[t->queue[i]];
    size_t slot, texel[ISOGI_TRACE__TEXELS][3], n = 0;
    uint8_t state[ISOGI_TRACE__TEXELS];
    for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
        int inside = isogi_trace__texel_of(t, t->queue[i], slot, texel[n]);
        brick->state[slot] = (uint8_t)(inside ? ISOGI_TRACE__UNKNOWN : ISOGI_TRACE__NOT_ASKED);
        n += inside ? 1 : 0;
    }
    isogi_trace__classify_texels(t, (const size_t(*)[3])texel, n, 0, state);
    for (slot = n = 0; slot < ISOGI_TRACE__TEXELS; slot++)
        if (brick->state[slot] == ISOGI_TRACE__UNKNOWN) brick->state[slot] = state[n++];
}

/* Bricks that hold no wanted texel are given back. */
static void isogi_trace__keep_wanted(isogi_trace *t) {
    size_t i, slot, kept = 0;
    for (i = 0; i < t->queue_count; i++) {
        isogi_trace__brick *brick = t->bricks[t->queue[i]];
        uint64_t wanted = 0;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
            wanted += brick->state[slot] == ISOGI_TRACE__WANTED;
            t->counters.texels_skipped += brick->state[slot] == ISOGI_TRACE__NO_SURFACE;
        }
        t->wanted += wanted;
        brick->queued = 1;
        if (wanted) t->queue[kept++] = t->queue[i];
        else isogi_trace__brick_free(t, brick), t->bricks[t->queue[i]] = NULL;
    }
    t->queue_count = kept;
}

static int isogi_trace__meets_box(const isogi_trace *t, const size_t low[3], const size_t high[3]) {
    int a;
    for (a = 0; a < 3; a++)
        if (high[a] < t->box_first[a] || low[a] >= t->box_end[a]) return 0;
    return 1;
}

static isogi_result isogi_trace__classify_all(isogi_trace *t) {
    isogi_context silent = t->context;
    size_t place, end[3];
    isogi_result result;
    int a;
    silent.progress = NULL;
    for (place = 0; place < t->brick_count; place++) {
        size_t texel[3], brick = isogi_trace__in_order(t, place);
        isogi_trace__texel_of(t, brick, 0, texel);
        for (a = 0; a < 3; a++) {
            end[a] = texel[a] + ISOGI_TRACE__SIDE - 1;
            if (end[a] >= t->lattice[a]) end[a] = t->lattice[a] - 1;
        }
        if (!isogi_trace__meets_box(t, texel, end) || !isogi_trace__in_range(t, texel, end)) continue;
        result = isogi_trace__queue_reserve(t);
        if (result != ISOGI_OK) return result;
        t->bricks[brick] = isogi_trace__brick_new(t);
        if (!t->bricks[brick]) return ISOGI_NO_MEMORY;
        t->queue[t->queue_count++] = brick;
    }
    result = isogi_parallel(&silent, t->queue_count, isogi_trace__classify_task, t, 0, 1);
    if (result == ISOGI_OK) isogi_trace__keep_wanted(t);
    return result;
}

static void isogi_trace__feedback_free(const isogi_trace *t);
static void isogi_trace__hash_changeable(isogi_trace *t);
static void isogi_trace__settle(const isogi_trace *t);
static isogi_result isogi_trace__feedback_new(isogi_trace *t);

/* ==== create and free ================================================================================================ */

/* Whether all texels of a cube are baked together, as those of a bake by feedback that is not lazy. */
static int isogi_trace__by_cubes(const isogi_trace_desc *d) {
    return d->method == ISOGI_TRACE_FEEDBACK && !d->lazy && !(d->hierarchy > 0);
}

/* The texels that a description means: places of the first and the last, and how many; of the box, the first and the one past the last. */
typedef struct isogi_trace__extent {
    double first[3], last[3];
    size_t lattice[3], box_first[3], box_end[3];
} isogi_trace__extent;

static void isogi_trace__extent_of(const isogi_trace_desc *d, isogi_trace__extent *f) {
    int whole = 1, boxed = 0, a;
    for (a = 0; a < 3; a++) {
        whole &= isogi_trace__zero(d->lattice_min[a]) && isogi_trace__zero(d->lattice_max[a]);
        boxed |= d->box_first[a] || d->box_end[a];
    }
    for (a = 0; a < 3; a++) {
        double span;
        f->first[a] = whole ? 0 : d->lattice_min[a];
        f->last[a] = whole ? (double)(isogi_vol_volume(d->pyramid)->size[a] - 1) : d->lattice_max[a];
        span = isogi_trace__clamp(f->last[a] - f->first[a], 0x7fffffff);
        f->lattice[a] = d->lattice[a] ? d->lattice[a] : (size_t)(span + 0.5) + 1;
        f->box_first[a] = boxed ? d->box_first[a] : 0, f->box_end[a] = boxed ? d->box_end[a] : f->lattice[a];
    }
}

/* code: what isogi_trace_create returns for it. */
static const char *isogi_trace__fault(const isogi_trace_desc *d, isogi_result *code) {
    const char *fault = isogi_trace__desc_fault(d);
    isogi_trace__extent f;
    size_t bricks = 1;
    int a;
    *code = ISOGI_INVALID;
    if (fault) return fault;
    isogi_trace__extent_of(d, &f);
    for (a = 0; a < 3; a++) {
        if (f.first[a] < 0 || f.last[a] > (double)(isogi_vol_volume(d->pyramid)->size[a] - 1))
            return "lattice_min, lattice_max: not within the volume (voxels)";
        if (f.last[a] < f.first[a]) return "lattice_min: above lattice_max";
        if (f.box_first[a] > f.box_end[a] || f.box_end[a] > f.lattice[a]) return "box_first, box_end: not ascending, or not in the lattice";
        if (d->hierarchy > 0 && (f.box_first[a] || f.box_end[a] != f.lattice[a])) return "hierarchy: not for a box";
    }
    *code = ISOGI_TOO_LARGE;
    for (a = 0; a < 3; a++) {
        const size_t size = f.lattice[a] / ISOGI_TRACE__SIDE + 1; /* bricks */
        if (f.lattice[a] > 0x7fffffff) return "lattice: above 2^31 - 1";
        if (bricks > SIZE_MAX / sizeof(void *) / ISOGI_TRACE__TEXELS / size) return "lattice: too large to be addressed";
        bricks *= size;
    }
    *code = ISOGI_OK;
    return NULL;
}

ISOGI_API const char *isogi_trace_fault(const isogi_trace_desc *desc) {
    isogi_result code;
    return isogi_trace__fault(desc, &code);
}

static void isogi_trace__set_lattice(isogi_trace *t) {
    const isogi_trace_desc *d = &t->scene.desc;
    isogi_trace__extent f;
    int a, empty;
    isogi_trace__extent_of(d, &f);
    t->brick_count = 1;
    for (a = 0; a < 3; a++) {
        t->first[a] = f.first[a], t->last[a] = f.last[a], t->lattice[a] = f.lattice[a];
        t->box_first[a] = f.box_first[a], t->box_end[a] = f.box_end[a];
        if (t->lattice[a] == 1) t->first[a] = t->last[a] = (t->first[a] + t->last[a]) / 2;
        t->step[a] = t->lattice[a] > 1 ? (t->last[a] - t->first[a]) / (double)(t->lattice[a] - 1) : 0;
        t->size[a] = (t->lattice[a] + ISOGI_TRACE__SIDE - 1) / ISOGI_TRACE__SIDE;
        t->brick_count *= t->size[a];
    }
    empty = t->box_first[0] == t->box_end[0] || t->box_first[1] == t->box_end[1] || t->box_first[2] == t->box_end[2];
    for (a = 0; a < 3 && isogi_trace__by_cubes(d) && !empty; a++) { /* texels of a cube share light: all of them, or none */
        size_t beyond = t->box_end[a] + ISOGI_TRACE_CUBE - 1;
        t->box_first[a] -= t->box_first[a] % ISOGI_TRACE_CUBE, beyond -= beyond % ISOGI_TRACE_CUBE;
        t->box_end[a] = beyond < t->lattice[a] ? beyond : t->lattice[a];
    }
}

/* TRANSFER: an environment's image by blocks, their means and these cut. */
typedef struct isogi_trace__flat {
    double mean[ISOGI_TRACE__FLAT_ROWS][2 * ISOGI_TRACE__FLAT_ROWS][3];
    float rgb[ISOGI_TRACE__FLAT_ROWS][2 * ISOGI_TRACE__FLAT_ROWS][3];
} isogi_trace__flat;

/* What a row of the image has in each column of blocks; no pixel is wider than these. */
static void isogi_trace__flat_row(const float *rgb, int width, double (*row)[3]) {
    const int columns = 2 * ISOGI_TRACE__FLAT_ROWS;
    const double share = (double)columns / width;
    int i, c;
    memset(row, 0, (size_t)columns * sizeof *row);
    for (i = 0; i < width; i++, rgb += 3) {
        const int x = (int)(i * share) < columns ? (int)(i * share) : columns - 1;
        const double after = (i + 1) * share - (x + 1), here = after > 0 && x + 1 < columns ? share - after : share;
        for (c = 0; c < 3; c++) row[x][c] += here * (double)rgb[c];
        for (c = 0; c < 3 && here < share; c++) row[x + 1][c] += after * (double)rgb[c];
    }
}

/* Means over blocks: what of a row of the image lies in a row of blocks counts by its solid angle. */
static void isogi_trace__flat_means(isogi_trace__flat *flat, const isogi_env *env) {
    const int rows = ISOGI_TRACE__FLAT_ROWS, columns = 2 * rows;
    double row[2 * ISOGI_TRACE__FLAT_ROWS][3];
    int j, x, y, c;
    memset(flat->mean, 0, sizeof flat->mean);
    for (j = 0; j < env->height; j++) {
        const double top = (double)j / env->height, bottom = (double)(j + 1) / env->height;
        isogi_trace__flat_row(env->rgb + 3 * (size_t)j * (size_t)env->width, env->width, row);
        for (y = (int)(top * rows); y < rows && (double)y / rows < bottom; y++) {
            const double above = (double)y / rows, below = (double)(y + 1) / rows;
            const double from = top > above ? top : above, to = bottom < below ? bottom : below;
            const double part = (cos(ISOGI_TRACE__PI * from) - cos(ISOGI_TRACE__PI * to)) /
                                (cos(ISOGI_TRACE__PI * above) - cos(ISOGI_TRACE__PI * below));
            for (x = 0; x < columns && part > 0; x++)
                for (c = 0; c < 3; c++) flat->mean[y][x][c] += part * row[x][c];
        }
    }
}

/* Cuts a channel at FLAT times the mean that the cut leaves, by Newton's rounds, which never fall below it: what is left is linear in the
   cut from one block's mean to the next. A lone sun in the dark is cut to nothing. 0: nothing is cut. */
static int isogi_trace__flat_cut(isogi_trace__flat *flat, int channel) {
    const int rows = ISOGI_TRACE__FLAT_ROWS, columns = 2 * rows;
    double most = DBL_MAX;
    int x, y, k, cut = 0;
    for (k = 0; k < ISOGI_TRACE__FLAT_ROUNDS; k++) {
        double sum = 0, above = 0; /* what is left below the cut; how much of the sphere is above it */
        for (y = 0; y < rows; y++) {
            const double angle = cos(ISOGI_TRACE__PI * y / rows) - cos(ISOGI_TRACE__PI * (y + 1) / rows);
            for (x = 0; x < columns; x++) {
                const double mean = flat->mean[y][x][channel];
                if (mean < most) sum += angle / (2 * columns) * mean;
                else above += angle / (2 * columns);
            }
        }
        if (!(ISOGI_TRACE__FLAT * above < 1)) break; /* what is left of that alone is more than the cut allows */
        most = sum > 0 ? ISOGI_TRACE__FLAT * sum / (1 - ISOGI_TRACE__FLAT * above) : 0;
    }
    for (y = 0; y < rows; y++)
        for (x = 0; x < columns; x++) {
            const double mean = flat->mean[y][x][channel];
            flat->rgb[y][x][channel] = (float)(mean < most ? mean : most), cut |= mean > most;
        }
    return cut;
}

/* Of a sky's coefficients, those that are left where its image is cut; channels in which nothing is stay. An image of pixels larger than
   blocks has no such spots. */
static isogi_result isogi_trace__flatten(float *sky, int order, const isogi_env *env, const isogi_context *context) {
    isogi_trace__flat *flat;
    float cut[ISOGI_TRACE__VALUES];
    isogi_lighting lighting;
    isogi_result result = ISOGI_OK;
    int c, k, cuts[3], any = 0;
    if (!env->rgb || env->height < ISOGI_TRACE__FLAT_ROWS || env->width < 2 * ISOGI_TRACE__FLAT_ROWS) return ISOGI_OK;
    flat = (isogi_trace__flat *)isogi_allocate(context, 1, sizeof *flat);
    if (!flat) return ISOGI_NO_MEMORY;
    isogi_trace__flat_means(flat, env);
    for (c = 0; c < 3; c++) cuts[c] = isogi_trace__flat_cut(flat, c), any |= cuts[c];
    memset(&lighting, 0, sizeof lighting);
    lighting.env = *env, lighting.env.rgb = flat->rgb[0][0];
    lighting.env.width = 2 * ISOGI_TRACE__FLAT_ROWS, lighting.env.height = ISOGI_TRACE__FLAT_ROWS;
    if (any) result = isogi_sh_project(cut, order, &lighting, NULL);
    isogi_release(context, flat, 1, sizeof *flat);
    for (k = 0; any && result == ISOGI_OK && k < 3 * order * order; k++)
        if (cuts[k % 3]) sky[k] = cut[k];
    return result;
}

/* A distant lighting as coefficients, and those of what it brings at least, see isogi_trace_lighting. */
static isogi_result isogi_trace__project(isogi_trace__lit *lit, int order, const isogi_lighting *lighting, const isogi_context *context) {
    float one[ISOGI_TRACE__VALUES];
    isogi_lighting part = *lighting;
    size_t i;
    int k, n = 3 * order * order;
    isogi_result result = isogi_sh_project(lit->all, order, lighting, NULL);
    part.light_count = 0;
    if (result == ISOGI_OK && !lighting->light_count) memcpy(lit->least, lit->all, (size_t)n * sizeof *lit->least);
    if (result == ISOGI_OK && lighting->light_count) result = isogi_sh_project(lit->least, order, &part, NULL);
    if (result == ISOGI_OK) result = isogi_trace__flatten(lit->least, order, &part.env, context);
    memset(&part, 0, sizeof part);
    for (i = 0; i < lighting->light_count && result == ISOGI_OK; i++) { /* what takes light away */
        isogi_light taking = lighting->lights[i];
        for (k = 0; k < 3; k++) taking.rgb[k] = taking.rgb[k] < 0 ? taking.rgb[k] : 0;
        if (!(taking.rgb[0] < 0 || taking.rgb[1] < 0 || taking.rgb[2] < 0)) continue;
        part.lights = &taking, part.light_count = 1;
        result = isogi_sh_project(one, order, &part, NULL);
        for (k = 0; k < n && result == ISOGI_OK; k++) lit->least[k] += one[k];
    }
    return result;
}

static void isogi_trace__set_light(isogi_trace *t, const isogi_trace__lit *lit) {
    int order = t->scene.desc.order, n = 3 * order * order, k, c, e = 0;
    float both[2 * ISOGI_TRACE__VALUES], most = 0;
    float one[ISOGI_TRACE__MAX_ORDER * ISOGI_TRACE__MAX_ORDER], square[ISOGI_TRACE__MAX_ORDER * ISOGI_TRACE__MAX_ORDER];
    memcpy(both, lit->all, (size_t)n * sizeof *both), memcpy(both + n, lit->least, (size_t)n * sizeof *both);
    isogi_trace__dim(both, 2 * n);
    memcpy(t->lit.all, both, (size_t)n * sizeof *both), memcpy(t->lit.least, both + n, (size_t)n * sizeof *both);
    memset(one, 0, sizeof one);
    for (k = 0; k < n; k++) most = fabsf(t->lit.all[k]) > most ? fabsf(t->lit.all[k]) : most;
    if (most > 0) frexp((double)most, &e);
    t->square_unit = ldexp(1, 2 * e);
    for (c = 0; c < 3; c++) {
        for (k = 0; k < order * order; k++) one[k] = (float)ldexp((double)t->lit.all[3 * k + c], -e);
        isogi_sh_product(square, one, one, order, 1);
        for (k = 0; k < order * order; k++) t->square[3 * k + c] = square[k];
    }
}

static isogi_result isogi_trace__set_up(isogi_trace *t, const isogi_trace_desc *desc) {
    isogi_result result = isogi_trace__scene_set(&t->scene, desc, &t->context);
    isogi_trace__lit lit;
    if (result != ISOGI_OK) return result;
    isogi_trace__set_lattice(t);
    t->values =
        desc->mode == ISOGI_TRACE_TRANSFER ? t->scene.desc.order * t->scene.desc.order * t->scene.desc.transfer_channels : 3;
    t->least = 1;
    t->format = (int)t->scene.desc.storage, t->record = isogi_trace__record_size(t);
    t->bricks = (isogi_trace__brick **)isogi_allocate(&t->context, t->brick_count, sizeof *t->bricks);
    t->batch = (isogi_trace__ref *)isogi_allocate(&t->context, ISOGI_TRACE__BATCH, sizeof *t->batch);
    t->task_counters = (isogi_counters *)isogi_allocate(&t->context, ISOGI_TRACE__TASKS, sizeof *t->task_counters);
    if (desc->method == ISOGI_TRACE_PATHS)
        t->waves = (isogi_trace__wave *)isogi_allocate(&t->context, ISOGI_TRACE__TASKS, sizeof *t->waves);
    if (t->bricks) memset(t->bricks, 0, t->brick_count * sizeof *t->bricks);
    if (!t->bricks || !t->batch || !t->task_counters || (desc->method == ISOGI_TRACE_PATHS && !t->waves)) return ISOGI_NO_MEMORY;
    if (desc->mode == ISOGI_TRACE_TRANSFER) {
        result = isogi_trace__project(&lit, t->scene.desc.order, &t->scene.desc.lighting, &t->context);
        if (result != ISOGI_OK) return result;
        isogi_trace__set_light(t, &lit);
    }
    isogi_trace__hash_changeable(t);
    if (desc->hierarchy > 0) t->scene.desc.lazy = 1; /* texels are wanted when the coarse ones are known */
    if (desc->method == ISOGI_TRACE_FEEDBACK) {
        result = isogi_trace__feedback_new(t);
        if (result != ISOGI_OK) return result;
    }
    return t->scene.desc.lazy ? ISOGI_OK : isogi_trace__classify_all(t);
}

/* The texture of every second texel. Where an axis has an even number of texels the last one has no partner: coarse texels are then
   a little further apart than two fine ones, which lookups do not mind. */
static isogi_result isogi_trace__coarse_create(isogi_trace *t, const isogi_context *context) {
    isogi_trace_desc desc = t->scene.desc;
    int a;
    for (a = 0; a < 3; a++)
        desc.lattice[a] = (t->lattice[a] + 2) / 2, desc.lattice_min[a] = t->first[a], desc.lattice_max[a] = t->last[a];
    memset(desc.box_first, 0, sizeof desc.box_first), memset(desc.box_end, 0, sizeof desc.box_end);
    desc.hierarchy = 0, desc.lazy = 0, desc.sides = t->scene.high ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE;
    return isogi_trace_create(&t->coarse, &desc, context);
}

/* The part of the progress that this texture's baking is; of a hierarchy, the coarse texels are the first half. */
static void isogi_trace__share(isogi_trace *t, double from, double to) {
    double middle = t->coarse ? (from + to) / 2 : from;
    t->share[0] = middle, t->share[1] = to;
    if (t->coarse) t->coarse->share[0] = from, t->coarse->share[1] = middle;
}

ISOGI_API isogi_result isogi_trace_create(isogi_trace **trace, const isogi_trace_desc *desc, const isogi_context *context) {
    isogi_trace *t;
    isogi_result result;
    if (!trace) return ISOGI_INVALID;
    if (isogi_trace__fault(desc, &result)) return result;
    if (!context) context = isogi_vol_context(desc->pyramid);
    t = (isogi_trace *)isogi_allocate(context, 1, sizeof *t);
    if (!t) return ISOGI_NO_MEMORY;
    memset(t, 0, sizeof *t);
    t->context = *context;
    result = isogi_trace__set_up(t, desc);
    if (result == ISOGI_OK && desc->hierarchy > 0) result = isogi_trace__coarse_create(t, context);
    isogi_trace__share(t, 0, 1);
    if (result == ISOGI_OK && desc->sides == ISOGI_TRACE_BOTH_SIDES) {
        isogi_trace_desc other = *desc;
        other.sides = ISOGI_TRACE_HIGH_SIDE;
        result = isogi_trace_create(&t->high, &other, context);
        if (result == ISOGI_OK) isogi_trace__share(t, 0, 0.5), isogi_trace__share(t->high, 0.5, 1);
    }
    if (result == ISOGI_OK) *trace = t;
    else isogi_trace_free(t);
    return result;
}

/* Around calls of some hundred parts: threads that stay, also for the textures below this one. */
static void isogi_trace__pool_share(isogi_trace *t, isogi_thread_pool *pool) {
    t->context.thread_pool = pool;
    if (t->coarse) isogi_trace__pool_share(t->coarse, pool);
    if (t->high) isogi_trace__pool_share(t->high, pool);
}

static isogi_thread_pool *isogi_trace__pool_begin(isogi_trace *t) {
    isogi_thread_pool *pool = isogi_thread_pool_begin(&t->context);
    isogi_trace__pool_share(t, t->context.thread_pool);
    return pool;
}

static void isogi_trace__pool_end(isogi_trace *t, isogi_thread_pool *pool) {
    isogi_thread_pool_end(&t->context, pool);
    isogi_trace__pool_share(t, t->context.thread_pool);
}

ISOGI_API isogi_trace *isogi_trace_high(isogi_trace *trace) {
    return trace ? trace->scene.high ? trace : trace->high : NULL;
}

ISOGI_API void isogi_trace_free(isogi_trace *trace) {
    isogi_context context;
    size_t i;
    if (!trace) return;
    isogi_trace_free(trace->high);
    isogi_trace_free(trace->coarse);
    context = trace->context;
    for (i = 0; trace->bricks && i < trace->brick_count; i++) isogi_trace__brick_free(trace, trace->bricks[i]);
    isogi_release(&context, trace->bricks, trace->brick_count, sizeof *trace->bricks);
    isogi_release(&context, trace->queue, trace->queue_capacity, sizeof *trace->queue);
    isogi_release(&context, trace->batch, ISOGI_TRACE__BATCH, sizeof *trace->batch);
    isogi_release(&context, trace->task_counters, ISOGI_TRACE__TASKS, sizeof *trace->task_counters);
    isogi_release(&context, trace->waves, ISOGI_TRACE__TASKS, sizeof *trace->waves);
    isogi_trace__feedback_free(trace);
    isogi_trace__sky_free(&trace->scene.sky, &context);
    isogi_release(&context, trace, 1, sizeof *trace);
}

/* ==== lookups ======================================================================================================== */

/* The lattice cell of a world point and the place in it; points beyond the lattice are moved to its border. */
static void isogi_trace__cell(const isogi_trace *t, const float point[3], size_t cell[3], double local[3]) {
    double world[3], grid[3];
    int a;
    for (a = 0; a < 3; a++) world[a] = (double)point[a];
    isogi_vol_to_grid(t->scene.pyramid, world, grid);
    for (a = 0; a < 3; a++) {
        size_t last = t->lattice[a] > 1 ? t->lattice[a] - 2 : 0;
        double x = t->step[a] > 0 ? (grid[a] - t->first[a]) / t->step[a] : 0;
        x = isogi_trace__clamp(x, (double)(t->lattice[a] - 1));
        cell[a] = (size_t)x < last ? (size_t)x : last;
        local[a] = x - (double)cell[a];
    }
}

/* Corner i of a lattice cell and its weight; 0 where that is nothing. */
static double isogi_trace__corner(const isogi_trace *t, const size_t cell[3], const double local[3], int i, size_t texel[3]) {
    double weight = 1;
    int a;
    for (a = 0; a < 3; a++) {
        int upper = i >> a & 1;
        texel[a] = cell[a] + (size_t)upper;
        if (texel[a] >= t->lattice[a]) return 0;
        weight *= upper ? local[a] : 1 - local[a];
    }
    return weight;
}

/* What is known of a texel without working it out. */
static int isogi_trace__state(const isogi_trace *t, const size_t texel[3]) {
    uint32_t slot;
    const isogi_trace__brick *brick = t->bricks[isogi_trace__brick_of(t, texel, &slot)];
    if (!brick) return t->scene.desc.lazy ? ISOGI_TRACE__UNKNOWN : ISOGI_TRACE__NO_SURFACE;
    return brick->state[slot];
}

/* Texel i of the 4x4x4 around a lattice cell; 0 where it lies beyond the lattice. */
static int isogi_trace__texel_around(const isogi_trace *t, const size_t cell[3], int i, size_t texel[3]) {
    int a, inside = 1;
    for (a = 0; a < 3; a++) texel[a] = cell[a] + (size_t)(i >> 2 * a & 3) - 1, inside &= texel[a] < t->lattice[a]; /* wraps */
    return inside;
}

/* Among the 4x4x4 texels around a lattice cell, the one nearest to the point (in texels; of equals the first) with that state or a
   later one. 0 if there is none. */
static int isogi_trace__nearest(const isogi_trace *t, const size_t cell[3], const double local[3], int state,
                                size_t nearest[3]) {
    double best = DBL_MAX;
    int i, a;
    for (i = 0; i < 64; i++) {
        double distance = 0, d;
        size_t texel[3];
        for (a = 0; a < 3; a++) d = (i >> 2 * a & 3) - 1 - local[a], distance += d * d;
        if (!isogi_trace__texel_around(t, cell, i, texel) || !(distance < best) || isogi_trace__state(t, texel) < state) continue;
        best = distance;
        memcpy(nearest, texel, 3 * sizeof *nearest);
    }
    return best < DBL_MAX;
}

/* Texel i of the 4x4x4 around a lattice cell and its weight by the uniform cubic B-spline; 0 where that is nothing. */
static double isogi_trace__spline(const isogi_trace *t, const size_t cell[3], const double local[3], int i, size_t texel[3]) {
    double weight = 1;
    int a;
    if (!isogi_trace__texel_around(t, cell, i, texel)) return 0;
    for (a = 0; a < 3; a++) {
        double d = fabs((i >> 2 * a & 3) - 1 - local[a]), rest = 2 - d;
        weight *= d < 1 ? (4 - 6 * d * d + 3 * d * d * d) / 6 : rest > 0 ? rest * rest * rest / 6 : 0;
    }
    return weight;
}

/* Texel i among those that desc.lookup reads or chooses from, and its weight. */
static double isogi_trace__tap(const isogi_trace *t, const size_t cell[3], const double local[3], int i, size_t texel[3]) {
    return t->scene.desc.lookup == ISOGI_TRACE_BSPLINE ? isogi_trace__spline(t, cell, local, i, texel)
                                                       : isogi_trace__corner(t, cell, local, i, texel);
}

static int isogi_trace__tap_count(const isogi_trace *t) { return t->scene.desc.lookup == ISOGI_TRACE_BSPLINE ? 64 : 8; }

static double isogi_trace__grid_value(const isogi_trace *t, const double grid[3]) {
    isogi_hit place;
    return isogi_trace__locate(t->scene.volume, grid, &place) ? isogi_trace__value(t->scene.volume, &place) : 0;
}

/* How far a texel is from the point, by isovalue or by place (squared, in texels), as the lookup chooses. */
static void isogi_trace__apart(const isogi_trace *t, const size_t cell[3], const double local[3], const size_t texel[3],
                               double apart[2]) {
    double point[3], place[3], d;
    int a;
    apart[0] = apart[1] = 0;
    for (a = 0; a < 3; a++) {
        d = (double)(texel[a] - cell[a]) - local[a];
        apart[1] += d * d;
        point[a] = t->first[a] + t->step[a] * ((double)cell[a] + local[a]), place[a] = t->first[a] + t->step[a] * (double)texel[a];
    }
    if (t->scene.desc.lookup == ISOGI_TRACE_CLOSEST_ISOVALUE)
        apart[0] = fabs(isogi_trace__grid_value(t, place) - isogi_trace__grid_value(t, point));
}

typedef struct isogi_trace__reading {
    const uint8_t *record[64];
    double weight[64]; /* they sum to 1 */
} isogi_trace__reading;

/* The texels and weights of a lookup: those around the point that are computed; where none of them has a surface, the nearest that
   has one. The number of them; 0: the lookup is not ready. */
static int isogi_trace__taps(const isogi_trace *t, const float point[3], isogi_trace__reading *r) {
    size_t cell[3], texel[3];
    double local[3], total = 0, best[2] = {DBL_MAX, DBL_MAX};
    int i, count = 0, pending = 0, taps = isogi_trace__tap_count(t);
    int one = t->scene.desc.lookup == ISOGI_TRACE_NEAREST || t->scene.desc.lookup == ISOGI_TRACE_CLOSEST_ISOVALUE;
    if (!isogi_trace__finite_point(point)) return 0;
    isogi_trace__cell(t, point, cell, local);
    for (i = 0; i <= taps; i++) {
        const isogi_trace__brick *brick;
        uint32_t slot;
        double w = 1;
        int state;
        if (i < taps) {
            w = isogi_trace__tap(t, cell, local, i, texel);
            if (!(w > 0)) continue;
            state = isogi_trace__state(t, texel);
            if (state < ISOGI_TRACE__DRAFT) { /* nobody can ask for what lies beyond the box */
                pending |= state != ISOGI_TRACE__NO_SURFACE &&
                           (t->scene.desc.lazy ? isogi_trace__in_box(t, texel) : state != ISOGI_TRACE__NOT_ASKED);
                continue;
            }
        } else if (t->coarse && pending) return isogi_trace__taps(t->coarse, point, r); /* not a cell of the fine level */
        else if (count || (pending && !t->feedback) || !isogi_trace__nearest(t, cell, local, ISOGI_TRACE__DRAFT, texel)) break;
        if (one && i < taps) {
            double apart[2];
            isogi_trace__apart(t, cell, local, texel, apart);
            if (apart[0] > best[0] || (apart[0] >= best[0] && apart[1] >= best[1])) continue;
            best[0] = apart[0], best[1] = apart[1], count = 0, total = 0;
        }
        brick = t->bricks[isogi_trace__brick_of(t, texel, &slot)];
        r->record[count] = isogi_trace__record(t, brick, slot), r->weight[count] = w;
        total += w, count++;
    }
    for (i = 0; i < count; i++) r->weight[i] /= total;
    return count;
}

/* TRANSFER: what a lighting's coefficients bring. */
static void isogi_trace__series_sum(const isogi_trace *t, const double *values, const float *light, double rgb[3]) {
    int count = t->scene.desc.order * t->scene.desc.order, channels = t->scene.desc.transfer_channels, k, c;
    for (c = 0; c < 3; c++)
        for (rgb[c] = 0, k = 0; k < count; k++) rgb[c] += values[k * channels + (channels == 1 ? 0 : c)] * (double)light[3 * k + c];
}

/* Irradiance out of the values of a texel, or of several. */
static void isogi_trace__irradiance(const isogi_trace *t, const double *values, double rgb[3]) {
    double least[3];
    int c;
    if (t->scene.desc.mode != ISOGI_TRACE_TRANSFER) {
        memcpy(rgb, values, 3 * sizeof *rgb);
        return;
    }
    isogi_trace__series_sum(t, values, t->lit.all, rgb), isogi_trace__series_sum(t, values, t->lit.least, least);
    for (c = 0; c < 3; c++) rgb[c] = rgb[c] > least[c] ? rgb[c] : least[c];
}

/* Where a channel begins. */
static int isogi_trace__first_value(const isogi_trace *t, int channel) {
    return t->scene.desc.mode == ISOGI_TRACE_TRANSFER && t->scene.desc.transfer_channels == 1 ? 0 : channel;
}

/* TRANSFER: what the throughputs of a sample sum up to, squared, over their mean. 1 where a path ends when it escapes; with no_shadows it
   brings light at every reflection: as many terms as there may be, or twice their mean, as where lengths of paths are geometric. */
static double isogi_trace__repeats(const isogi_trace *t, double first) {
    const double most = 2 * 3.5449077018110318 * first / ISOGI_TRACE__PI, terms = (double)t->scene.desc.bounces + 1;
    if (!t->scene.desc.no_shadows || !(most > 2)) return 1 + (t->scene.desc.no_shadows && t->scene.desc.bounces);
    return terms > 0 && terms < most ? terms : most;
}

/* Variance of a texel's luminance. TRANSFER: a sample is X = pi * throughput * L(direction it left in), throughput at most 1, so that
   E[X^2] <= pi * (E under the lighting's square), and the luminance of a square is no less than the square of the luminance; its
   record holds 1 / sqrt(samples), of as many samples as what it shares is as good as, and of what the filter blurs. */
static double isogi_trace__variance(const isogi_trace *t, const double *values, double error) {
    double square[3], rgb[3], sky[3], first[3], spread;
    int c;
    if (t->scene.desc.mode != ISOGI_TRACE_TRANSFER || !isogi_trace__finite(error)) return error * error;
    isogi_trace__series_sum(t, values, t->square, square), isogi_trace__series_sum(t, values, t->lit.all, rgb);
    for (c = 0; c < 3; c++) first[c] = values[isogi_trace__first_value(t, c)];
    spread = ISOGI_TRACE__PI * isogi_trace__repeats(t, isogi_trace__luminance(first)) * t->square_unit * isogi_trace__luminance(square) -
             isogi_trace__luminance(rgb) * isogi_trace__luminance(rgb);
    for (c = 0; c < 3; c++) sky[c] = ISOGI_TRACE__PI * 0.28209479177387814 * (double)t->lit.all[c];
    return error * error * (spread > 0 ? spread : 0) +
           isogi_trace__unseen(isogi_trace__luminance(sky), isogi_trace__luminance(rgb), error > 0 ? 1 / (error * error) : 1e9);
}

ISOGI_API isogi_result isogi_trace_sample(const isogi_trace *trace, const float (*points)[3], size_t count,
                                          float (*irradiance)[3], float *error) {
    size_t i;
    int k, n, c;
    if (!trace || (count && (!points || !irradiance))) return ISOGI_INVALID;
    for (i = 0; i < count; i++) {
        isogi_trace__reading r;
        double sum[ISOGI_TRACE__VALUES], values[ISOGI_TRACE__VALUES], variance = 0, shared = 0, rgb[3];
        float stored[ISOGI_TRACE__VALUES];
        n = isogi_trace__taps(trace, points[i], &r);
        for (c = 0; c < trace->values; c++) sum[c] = 0;
        for (k = 0; k < n; k++) {
            double part;
            isogi_trace__record_read(trace, r.record[k], stored);
            for (c = 0; c < trace->values; c++) values[c] = (double)stored[c], sum[c] += r.weight[k] * values[c];
            if (!error) continue;
            part = isogi_trace__variance(trace, values, (double)isogi_trace__record_error(r.record[k]));
            /* paths at texels are independent of each other; filtered ones and probes are shared */
            if (trace->feedback) shared += r.weight[k] * sqrt(part);
            else variance += r.weight[k] * r.weight[k] * part;
        }
        variance += shared * shared;
        isogi_trace__irradiance(trace, sum, rgb);
        for (c = 0; c < 3; c++) irradiance[i][c] = (float)rgb[c];
        if (error) error[i] = n ? (float)sqrt(variance) : ISOGI_TRACE__NOT_READY;
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_trace_sample_transfer(const isogi_trace *trace, const float (*points)[3], size_t count,
                                                   float *transfer) {
    size_t i;
    int k, n, j;
    if (!trace || trace->scene.desc.mode != ISOGI_TRACE_TRANSFER || (count && (!points || !transfer))) return ISOGI_INVALID;
    for (i = 0; i < count; i++) {
        isogi_trace__reading r;
        float values[ISOGI_TRACE__VALUES];
        double sum[ISOGI_TRACE__VALUES] = {0};
        n = isogi_trace__taps(trace, points[i], &r);
        for (k = 0; k < n; k++) {
            isogi_trace__record_read(trace, r.record[k], values);
            for (j = 0; j < trace->values; j++) sum[j] += r.weight[k] * (double)values[j];
        }
        for (j = 0; j < trace->values; j++) transfer[i * (size_t)trace->values + (size_t)j] = (float)sum[j];
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_trace_lighting(const isogi_trace *trace, float (*light)[3], float (*least)[3]) {
    size_t bytes;
    if (!trace || trace->scene.desc.mode != ISOGI_TRACE_TRANSFER) return ISOGI_INVALID;
    bytes = 3 * sizeof(float) * (size_t)(trace->scene.desc.order * trace->scene.desc.order);
    if (light) memcpy(light, trace->lit.all, bytes);
    if (least) memcpy(least, trace->lit.least, bytes);
    return ISOGI_OK;
}

/* Factors g_l by which a Phong lobe of integral 1 blurs degree l: (s + 1) times the integral of x^s P_l(x) over [0,1]. */
static void isogi_trace__lobe(double exponent, int order, double *g) {
    int l;
    g[0] = 1, g[1] = (exponent + 1) / (exponent + 2);
    for (l = 2; l < order; l++) g[l] = g[l - 2] * (exponent - l + 2) / (exponent + l + 1);
}

/* One point of isogi_trace_sample_gloss; transfer: T there; t->lit: L; g: the factors of the lobe. */
static void isogi_trace__gloss(const isogi_trace *t, const float *transfer, const float normal[3], const float view[3],
                               const double *g, float rgb[3]) {
    static const double cosine[6] = {3.14159265358979323846, 2.0943951023931953, 0.78539816339744831, 0, -0.13089969389957472, 0};
    float dirs[2][3], y[2][ISOGI_TRACE__MAX_ORDER * ISOGI_TRACE__MAX_ORDER];
    double open = 0, light[3] = {0, 0, 0}, least[3] = {0, 0, 0}, seen[3] = {0, 0, 0};
    const double facing = 2 * isogi_trace__dot(normal, view);
    int order = t->scene.desc.order, channels = t->scene.desc.transfer_channels, k, c, l;
    for (c = 0; c < 3; c++) dirs[0][c] = (float)(facing * (double)normal[c]) - view[c], dirs[1][c] = normal[c];
    isogi_sh_eval(y[0], order, (const float(*)[3])dirs, 1);
    isogi_sh_eval(y[1], order, (const float(*)[3])(dirs + 1), 1);
    for (k = l = 0; k < order * order; k++) {
        double blurred;
        if (k >= (l + 1) * (l + 1)) l++;
        blurred = g[l] * (double)y[0][k];
        open += cosine[l] * blurred * (double)y[1][k];
        for (c = 0; c < 3; c++) {
            light[c] += blurred * (double)t->lit.all[3 * k + c], least[c] += blurred * (double)t->lit.least[3 * k + c];
            seen[c] += blurred * (double)transfer[k * channels + (channels == 1 ? 0 : c)];
        }
    }
    for (c = 0; c < 3; c++)
        rgb[c] = (float)(isogi_trace__clamp(light[c] > least[c] ? light[c] : least[c], 1e30) *
                         isogi_trace__clamp(seen[c] / (open > 1e-3 ? open : 1e-3), 1));
}

ISOGI_API isogi_result isogi_trace_sample_gloss(const isogi_trace *trace, const float (*points)[3], const float (*normals)[3],
                                                const float (*views)[3], double exponent, size_t count, float (*radiance)[3]) {
    float transfer[ISOGI_TRACE__VALUES];
    double g[ISOGI_TRACE__MAX_ORDER + 1];
    size_t i;
    isogi_result result = ISOGI_OK;
    if (!trace || trace->scene.desc.mode != ISOGI_TRACE_TRANSFER || (count && (!points || !normals || !views || !radiance)))
        return ISOGI_INVALID;
    if (!isogi_trace__finite(exponent) || exponent < 0) return ISOGI_INVALID;
    isogi_trace__lobe(exponent, trace->scene.desc.order, g);
    for (i = 0; i < count && result == ISOGI_OK; i++) {
        result = isogi_trace_sample_transfer(trace, points + i, 1, transfer);
        isogi_trace__gloss(trace, transfer, normals[i], views[i], g, radiance[i]);
    }
    return result;
}

ISOGI_API void isogi_trace_shape(const isogi_trace *trace, size_t lattice[3], int *order, int *channels) {
    if (!trace) {
        if (lattice) memset(lattice, 0, sizeof trace->lattice);
        if (order) *order = 0;
        if (channels) *channels = 0;
        return;
    }
    if (lattice) memcpy(lattice, trace->lattice, sizeof trace->lattice);
    if (order) *order = trace->scene.desc.mode == ISOGI_TRACE_TRANSFER ? trace->scene.desc.order : 0;
    if (channels) *channels = trace->scene.desc.mode == ISOGI_TRACE_TRANSFER ? trace->scene.desc.transfer_channels : 3;
}

ISOGI_API int isogi_trace_valid(const isogi_trace *trace, const size_t texel[3]) {
    isogi_trace__site site;
    int a;
    if (!trace || !texel) return 0;
    for (a = 0; a < 3; a++)
        if (texel[a] >= trace->lattice[a]) return 0;
    return isogi_trace__texel_site(trace, texel, &site);
}

ISOGI_API int isogi_trace_wanted(const isogi_trace *trace, const size_t texel[3]) {
    int a, state;
    if (!trace || !texel) return 0;
    for (a = 0; a < 3; a++)
        if (texel[a] >= trace->lattice[a]) return 0;
    state = isogi_trace__state(trace, texel);
    return (state >= ISOGI_TRACE__WANTED && state < ISOGI_TRACE__DONE) || isogi_trace_wanted(trace->high, texel);
}

static void isogi_trace__add(isogi_counters *to, const isogi_counters *from) {
    to->rays += from->rays, to->blocks += from->blocks, to->cells += from->cells, to->cubics += from->cubics;
    to->texels += from->texels, to->texels_skipped += from->texels_skipped;
}

ISOGI_API void isogi_trace_counters(const isogi_trace *trace, isogi_counters *counters) {
    if (!trace || !counters) return;
    isogi_trace__add(counters, &trace->counters);
    isogi_trace_counters(trace->high, counters);
    isogi_trace_counters(trace->coarse, counters);
}

ISOGI_API size_t isogi_trace_memory(const isogi_trace *trace) {
    size_t sum, i;
    if (!trace) return 0;
    sum = trace->brick_count * sizeof *trace->bricks;
    for (i = 0; i < trace->brick_count; i++)
        if (trace->bricks[i]) sum += sizeof *trace->bricks[i] + isogi_trace__bits(trace->bricks[i]->held) * trace->record;
    if (trace->coarse) sum += isogi_trace_memory(trace->coarse);
    return sum + (trace->high ? isogi_trace_memory(trace->high) : 0);
}

/* ==== requests ======================================================================================================= */

/* A texel that has a surface is asked for only by the lookup that reads it. */
static void isogi_trace__learn(isogi_trace *t, isogi_trace__brick *brick, uint32_t slot, int state) {
    brick->state[slot] = (uint8_t)(state == ISOGI_TRACE__WANTED ? ISOGI_TRACE__READABLE : state);
    t->counters.texels_skipped += state == ISOGI_TRACE__NO_SURFACE;
}

/* A texel is to be computed: its brick goes on the list. */
static isogi_result isogi_trace__want_slot(isogi_trace *t, size_t index, uint32_t slot) {
    isogi_trace__brick *brick = t->bricks[index];
    isogi_result result = brick->queued ? ISOGI_OK : isogi_trace__queue_reserve(t);
    if (result != ISOGI_OK) return result;
    isogi_trace__settle(t);
    brick->state[slot] = ISOGI_TRACE__WANTED, t->wanted++;
    if (!brick->queued) t->queue[t->queue_count++] = index, brick->queued = 1;
    return ISOGI_OK;
}

/* Classifies a texel and puts it on the list if it is to be computed. Whatever the interval of isovalues, but so that no later lookup
   finds another answer: nearest = 1: it is only looked at; 2: it has been found to be the nearest. */
static isogi_result isogi_trace__want(isogi_trace *t, const size_t texel[3], int nearest) {
    uint32_t slot;
    int state;
    size_t index = isogi_trace__brick_of(t, texel, &slot);
    isogi_trace__brick *brick = t->bricks[index];
    if (!brick) brick = t->bricks[index] = isogi_trace__brick_new(t);
    if (!brick) return ISOGI_NO_MEMORY;
    if (brick->state[slot] == ISOGI_TRACE__UNKNOWN) isogi_trace__learn(t, brick, slot, isogi_trace__classify(t, texel, 0));
    if (nearest && brick->state[slot] == ISOGI_TRACE__NOT_ASKED) {
        state = isogi_trace__classify(t, texel, 1);
        if (state == ISOGI_TRACE__WANTED) brick->state[slot] = ISOGI_TRACE__BEYOND;
        if (state == ISOGI_TRACE__NO_SURFACE) brick->state[slot] = ISOGI_TRACE__BEYOND_EMPTY;
    }
    if (nearest == 1 || (brick->state[slot] != ISOGI_TRACE__READABLE && !(nearest && brick->state[slot] == ISOGI_TRACE__BEYOND)))
        return ISOGI_OK;
    return isogi_trace__want_slot(t, index, slot);
}

/* All texels around the point lack a surface: the lookup will read the nearest that has one. */
static isogi_result isogi_trace__want_nearest(isogi_trace *t, const size_t cell[3], const double local[3]) {
    size_t texel[3];
    isogi_result result = ISOGI_OK;
    int i;
    for (i = 0; i < 64 && result == ISOGI_OK; i++)
        if (isogi_trace__texel_around(t, cell, i, texel)) result = isogi_trace__want(t, texel, 1);
    if (result == ISOGI_OK && isogi_trace__nearest(t, cell, local, ISOGI_TRACE__BEYOND, texel)) result = isogi_trace__want(t, texel, 2);
    return result;
}

typedef struct isogi_trace__job {
    isogi_trace *trace;
    size_t first, count, each; /* each: texels of a task */
} isogi_trace__job;

/* Points asked for, of which those are told apart that lie in a cell of others before them: the next pixels, and those of the next lines,
   mostly do. */
typedef struct isogi_trace__asked {
    const isogi_trace *trace;
    const float (*points)[3];
    size_t count;
    uint64_t again[ISOGI_TRACE__POINTS / 64]; /* bits of those */
    uint32_t (*cells)[3]; /* of the others that lie on no face, where lookups read the corners; else the first is ON_FACE */
    int lacking; /* around some point no texel had a surface: of others the nearest that has one may be another */
} isogi_trace__asked;

/* On faces of its cell a lookup reads fewer texels. */
static int isogi_trace__inner(const double local[3]) {
    return local[0] > 0 && local[0] < 1 && local[1] > 0 && local[1] < 1 && local[2] > 0 && local[2] < 1;
}

static void isogi_trace__learn_task(void *arg, size_t task) {
    const isogi_trace__job *job = (const isogi_trace__job *)arg;
    isogi_trace__ref *ref = job->trace->batch + task * ISOGI_TRACE__TEXELS;
    size_t i, left = job->count - task * ISOGI_TRACE__TEXELS, count = left < ISOGI_TRACE__TEXELS ? left : ISOGI_TRACE__TEXELS,
              texel[ISOGI_TRACE__TEXELS][3];
    uint8_t state[ISOGI_TRACE__TEXELS];
    for (i = 0; i < count; i++) memcpy(texel[i], ref[i].texel, sizeof texel[i]);
    isogi_trace__classify_texels(job->trace, (const size_t(*)[3])texel, count, 0, state);
    for (i = 0; i < count; i++) ref[i].brick->state[ref[i].slot] = state[i]; /* each by one task alone */
}

/* Texels that a lookup reads: of each the number of its tap, of its brick, and its slot. inner: the point is on no face of the cell.
   Returns how many. */
static int isogi_trace__corners(const isogi_trace *t, const size_t cell[3], const double local[3], int inner, uint8_t *tap, size_t *brick,
                                uint32_t *slot) {
    int k, a, count = 0;
    if (inner && t->scene.desc.lookup != ISOGI_TRACE_BSPLINE) { /* all corners */
        size_t first[2][3];
        uint32_t part[2][3];
        for (k = 0; k < 2; k++)
            for (a = 0; a < 3; a++) {
                first[k][a] = (cell[a] + (size_t)k) / ISOGI_TRACE__SIDE;
                part[k][a] = (uint32_t)((cell[a] + (size_t)k) % ISOGI_TRACE__SIDE) << 2 * a;
            }
        for (k = 0; k < 8; k++) {
            brick[k] = first[k & 1][0] + t->size[0] * (first[k >> 1 & 1][1] + t->size[1] * first[k >> 2][2]);
            slot[k] = part[k & 1][0] + part[k >> 1 & 1][1] + part[k >> 2][2], tap[k] = (uint8_t)k;
        }
        return 8;
    }
    for (k = 0; k < isogi_trace__tap_count(t); k++) {
        size_t texel[3];
        if (!(isogi_trace__tap(t, cell, local, k, texel) > 0)) continue;
        brick[count] = isogi_trace__brick_of(t, texel, &slot[count]), tap[count++] = (uint8_t)k;
    }
    return count;
}

/* Of a task's points, by the cells that it has met last. */
static void isogi_trace__again_task(void *arg, size_t task) {
    isogi_trace__asked *asked = (isogi_trace__asked *)arg;
    const isogi_trace *t = asked->trace;
    uint32_t known[256][3];
    size_t i = task * ISOGI_TRACE__TASK_POINTS,
           end = i + ISOGI_TRACE__TASK_POINTS < asked->count ? i + ISOGI_TRACE__TASK_POINTS : asked->count;
    memset(known, 0xff, sizeof known); /* no cell has that number */
    memset(asked->again + i / 64, 0, ISOGI_TRACE__TASK_POINTS / 8);
    for (; i < end; i++) {
        size_t cell[3], brick[64];
        uint32_t *kept, slot[64];
        uint8_t tap[64];
        double local[3];
        int a, taps;
        isogi_trace__cell(t, asked->points[i], cell, local);
        asked->cells[i][0] = ISOGI_TRACE__ON_FACE;
        if (!isogi_trace__inner(local)) continue;
        kept = known[(cell[0] + 7 * cell[1] + 61 * cell[2]) & 255];
        if (kept[0] == cell[0] && kept[1] == cell[1] && kept[2] == cell[2]) {
            asked->again[i / 64] |= (uint64_t)1 << i % 64;
            continue;
        }
        taps = t->scene.desc.lookup == ISOGI_TRACE_BSPLINE ? isogi_trace__corners(t, cell, local, 1, tap, brick, slot) : 8;
        for (a = 0; a < 3 && taps == isogi_trace__tap_count(t); a++) kept[a] = (uint32_t)cell[a];
        for (a = 0; a < 3 && t->scene.desc.lookup != ISOGI_TRACE_BSPLINE; a++) asked->cells[i][a] = (uint32_t)cell[a];
    }
}

/* The texels that the lookup at point i reads, and its cell and place in it; of a cell that is kept any place within: all read the same.
   None, where it is not finite. */
static int isogi_trace__asked_taps(const isogi_trace *t, const isogi_trace__asked *asked, size_t i, size_t cell[3], double local[3],
                                   uint8_t *tap, size_t *brick, uint32_t *slot) {
    int a;
    if (!isogi_trace__finite_point(asked->points[i])) return 0;
    if (asked->cells[i][0] == ISOGI_TRACE__ON_FACE) isogi_trace__cell(t, asked->points[i], cell, local);
    else for (a = 0; a < 3; a++) cell[a] = asked->cells[i][a], local[a] = 0.5;
    return isogi_trace__corners(t, cell, local, isogi_trace__inner(local), tap, brick, slot);
}

/* Classifies the texels that lookups at the points from `first` on will read, as many as a batch holds, on all cores. *end: of these
   points. */
static isogi_result isogi_trace__learn_points(isogi_trace *t, const isogi_trace__asked *asked, size_t first, size_t *end) {
    isogi_context silent = t->context;
    isogi_trace__job job;
    isogi_result result = ISOGI_OK;
    size_t i;
    job.trace = t, job.first = job.count = 0;
    for (i = first; i < asked->count && job.count + 64 <= ISOGI_TRACE__BATCH && result == ISOGI_OK; i++) {
        size_t cell[3];
        double local[3];
        size_t brick[64];
        uint32_t slot[64];
        uint8_t tap[64];
        int k, taps;
        if (asked->again[i / 64] >> i % 64 & 1) continue;
        taps = isogi_trace__asked_taps(t, asked, i, cell, local, tap, brick, slot);
        for (k = 0; k < taps && result == ISOGI_OK; k++) {
            isogi_trace__ref *ref = &t->batch[job.count];
            if (!t->bricks[brick[k]]) t->bricks[brick[k]] = isogi_trace__brick_new(t);
            if (!t->bricks[brick[k]]) result = ISOGI_NO_MEMORY;
            else if (t->bricks[brick[k]]->state[slot[k]] == ISOGI_TRACE__UNKNOWN) {
                ref->brick = t->bricks[brick[k]], ref->slot = slot[k], job.count++;
                ref->brick->state[slot[k]] = ISOGI_TRACE__NOT_ASKED;
                isogi_trace__tap(t, cell, local, tap[k], ref->texel);
            }
        }
    }
    *end = i, silent.progress = NULL;
    isogi_parallel(&silent, (job.count + ISOGI_TRACE__TEXELS - 1) / ISOGI_TRACE__TEXELS, isogi_trace__learn_task, &job, 0, 1);
    for (i = 0; i < job.count; i++) isogi_trace__learn(t, t->batch[i].brick, t->batch[i].slot, t->batch[i].brick->state[t->batch[i].slot]);
    return result;
}

static isogi_result isogi_trace__want_points(isogi_trace *t, isogi_trace__asked *asked, size_t first, size_t end) {
    size_t i;
    for (i = first; i < end; i++) {
        size_t cell[3], texel[3], brick[64];
        uint32_t slot[64];
        uint8_t tap[64];
        double local[3];
        isogi_result result = ISOGI_OK;
        int k, taps, lacking = 1;
        if (!asked->lacking && (asked->again[i / 64] >> i % 64 & 1)) continue;
        taps = isogi_trace__asked_taps(t, asked, i, cell, local, tap, brick, slot);
        if (!taps) continue;
        for (k = 0; k < taps && result == ISOGI_OK; k++) {
            int state = t->bricks[brick[k]]->state[slot[k]];
            int within = isogi_trace__texel_of(t, brick[k], slot[k], texel) && isogi_trace__in_box(t, texel);
            if (state == ISOGI_TRACE__READABLE) result = isogi_trace__want_slot(t, brick[k], slot[k]);
            /* beyond the box, only what was loaded is read */
            lacking = lacking && (state == ISOGI_TRACE__NO_SURFACE || (!within && state < ISOGI_TRACE__DRAFT));
        }
        asked->lacking |= lacking;
        if (result == ISOGI_OK && lacking) {
            isogi_trace__cell(t, asked->points[i], cell, local);
            result = isogi_trace__want_nearest(t, cell, local);
        }
        if (result != ISOGI_OK) return result;
    }
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_trace_request(isogi_trace *trace, const float (*points)[3], size_t count) {
    isogi_result result = ISOGI_OK;
    isogi_trace__asked asked;
    isogi_context silent;
    isogi_thread_pool *pool;
    size_t first, i, end, most = count < ISOGI_TRACE__POINTS ? count : ISOGI_TRACE__POINTS;
    if (!trace || (count && !points)) return ISOGI_INVALID;
    if (!trace->scene.desc.lazy || trace->coarse || !count) return ISOGI_OK;
    asked.trace = trace, asked.lacking = 0;
    asked.cells = (uint32_t(*)[3])isogi_allocate(&trace->context, most, sizeof *asked.cells);
    if (!asked.cells) return ISOGI_NO_MEMORY;
    pool = isogi_trace__pool_begin(trace);
    silent = trace->context, silent.progress = NULL;
    for (first = 0; first < count && result == ISOGI_OK; first += asked.count) {
        asked.points = points + first, asked.count = count - first < ISOGI_TRACE__POINTS ? count - first : ISOGI_TRACE__POINTS;
        isogi_parallel(&silent, (asked.count - 1) / ISOGI_TRACE__TASK_POINTS + 1, isogi_trace__again_task, &asked, 0, 1);
        for (i = 0; i < asked.count && result == ISOGI_OK; i = end) {
            result = isogi_trace__learn_points(trace, &asked, i, &end);
            if (result == ISOGI_OK) result = isogi_trace__want_points(trace, &asked, i, end);
        }
    }
    isogi_trace__pool_end(trace, pool);
    isogi_release(&trace->context, asked.cells, most, sizeof *asked.cells);
    return result;
}

/* ==== baking within a budget ========================================================================================= */

static void isogi_trace__bake_task(void *arg, size_t task) {
    const isogi_trace__job *job = (const isogi_trace__job *)arg;
    isogi_trace *t = job->trace;
    isogi_counters *counters = &t->task_counters[task];
    size_t i = task * job->each, end = i + job->each < job->count ? i + job->each : job->count;
    for (; i < end; i++) {
        const isogi_trace__ref *ref = &t->batch[i];
        const size_t *x = ref->texel;
        isogi_trace__site site;
        float values[ISOGI_TRACE__VALUES], error;
        if (!isogi_trace__texel_site(t, x, &site)) {
            /* only where the voxels were changed after they were classified, which breaks the contract but must not hang */
            ref->brick->state[ref->slot] = ISOGI_TRACE__NO_SURFACE;
            counters->texels++;
            continue;
        }
        site.key = isogi_trace__key(isogi_trace__key(t->scene.desc.seed, 0),
                                    (uint64_t)x[0] +
                                        (uint64_t)t->lattice[0] * ((uint64_t)x[1] + (uint64_t)t->lattice[1] * (uint64_t)x[2]));
        isogi_trace__site_start(&t->scene, &site, t->scene.high);
        isogi_trace__gather_site(&t->scene, &site, &t->waves[task], values, &error, counters);
        isogi_trace__record_write(t, isogi_trace__record(t, ref->brick, ref->slot), values, error);
        ref->brick->state[ref->slot] = ISOGI_TRACE__DONE;
        counters->texels++;
    }
}

/* Wanted, or readable from a time before something changed. */
static int isogi_trace__to_do(const isogi_trace__brick *brick, size_t slot) {
    return brick->state[slot] == ISOGI_TRACE__WANTED || (brick->state[slot] == ISOGI_TRACE__DRAFT && !(brick->node && brick->node[slot]));
}

/* Bits of all that are. */
static uint64_t isogi_trace__all_to_do(const isogi_trace__brick *brick) {
    uint64_t wanted = 0, draft = 0;
    uint32_t slot;
    for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
        wanted |= (uint64_t)(brick->state[slot] == ISOGI_TRACE__WANTED) << slot;
        draft |= (uint64_t)(brick->state[slot] == ISOGI_TRACE__DRAFT) << slot;
    }
    for (slot = 0; slot < ISOGI_TRACE__TEXELS && draft; slot++)
        wanted |= (uint64_t)isogi_trace__to_do(brick, slot) << slot;
    return wanted;
}

/* The next texels to compute, at most `limit`, with room for their values. Bricks stay in the queue until they are done. */
static isogi_result isogi_trace__fill_batch(isogi_trace *t, size_t limit, size_t *count) {
    size_t i, slot;
    *count = 0;
    for (i = t->queue_first; i < t->queue_count && *count < limit; i++) {
        isogi_trace__brick *brick = t->bricks[t->queue[i]];
        if (isogi_trace__brick_hold(t, brick, isogi_trace__all_to_do(brick)) != ISOGI_OK) return *count ? ISOGI_OK : ISOGI_NO_MEMORY;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS && *count < limit; slot++) {
            isogi_trace__ref *ref = &t->batch[*count];
            if (!isogi_trace__to_do(brick, slot)) continue;
            ref->brick = brick, ref->slot = (uint32_t)slot;
            isogi_trace__texel_of(t, t->queue[i], slot, ref->texel);
            ++*count;
        }
    }
    return ISOGI_OK;
}

/* Takes bricks without wanted texels off the head of the queue. */
static void isogi_trace__queue_advance(isogi_trace *t) {
    for (; t->queue_first < t->queue_count; t->queue_first++) {
        isogi_trace__brick *brick = t->bricks[t->queue[t->queue_first]];
        if (isogi_trace__all_to_do(brick)) return;
        brick->queued = 0;
    }
    t->queue_first = t->queue_count = 0;
}

/* One parallel run over the batch. */
static isogi_result isogi_trace__bake_batch(isogi_trace *t, size_t count) {
    isogi_trace__job job;
    uint64_t total = t->wanted + t->done, before = t->counters.texels;
    size_t each = (count + ISOGI_TRACE__TASKS - 1) / ISOGI_TRACE__TASKS, tasks = (count + each - 1) / each, i;
    isogi_result result;
    job.trace = t, job.first = 0, job.count = count, job.each = each;
    memset(t->task_counters, 0, tasks * sizeof *t->task_counters);
    result = isogi_parallel(&t->context, tasks, isogi_trace__bake_task, &job,
                            isogi_trace__lerp(t->share[0], t->share[1], (double)t->done / (double)total),
                            isogi_trace__lerp(t->share[0], t->share[1], (double)(t->done + count) / (double)total));
    for (i = 0; i < tasks; i++) isogi_trace__add(&t->counters, &t->task_counters[i]);
    t->done += t->counters.texels - before, t->wanted -= t->counters.texels - before;
    return result;
}

/* ==== light at hits: probes ========================================================================================= */

/* By default a ray that meets the surface takes the light there from a probe (the records of Ward, Rubinstein and Clear 1988): a point
   on the surface near the hit whose own hemisphere is gathered in the same way. Probes are found by place and normal (Binder,
   Fricke and Keller 2018), in cells that grow with the ray's length, since a far ray stands for much surface. Light at probes obeys
   E = D + R A E, with D from sky and lights and A the means over hits: n - 1 passes over the probes are n reflections, and they cost no
   rays. */

/* What is gathered at one point: a texel (brick set) or a probe. Sums are over samples, in units of irradiance / pi but for light. */
typedef struct isogi_trace__node {
    uint64_t cell;   /* probe: key of its cell; first what is read where a probe is looked for */
    double isovalue;
    float normal[3];
    float alike;     /* probe: tells the light of isovalues that differ from its own by less than this share of the volume's range */
    isogi_hit place; /* where */
    uint64_t key;    /* probe: of its random numbers */
    isogi_trace__brick *brick; /* texel: where its light goes; NULL of probes */
    uint32_t texel[3], slot; /* slot, of a probe: the batch of its samples */
    uint32_t samples, light_samples, hits;
    signed char from; /* side of the surface: 1 low, -1 high */
    float albedo[3], error;
    double steady[3];     /* irradiance by lights without extent */
    double light[3], light_spread;   /* by other lights; sum of squared deviations of its luminance */
    double bright[3], bright_spread; /* by directions drawn by brightness */
    double square, bounce_square;    /* squared luminance of rays that escaped, and of those that hit */
} isogi_trace__node;

/* The hits of one batch, or of PASSED probes of it: node[i] has probe[begin[i]] .. probe[begin[i+1] - 1]. */
typedef struct isogi_trace__segment {
    size_t entries, hits;
    size_t numbers; /* in the block of memory that begins at `node`; 0: it lies in that of a segment before */
    uint32_t batch; /* of probes: of those that were gathered anew, the slot of the node tells which has its hits */
    uint32_t *node, *begin, *probe;
    float (*albedo)[3];     /* of each hit, where colours go by place; else NULL: it is the node's, by isovalue */
    uint32_t *order;        /* of probes: the first `open` are the entries that passes still change; NULL of texels */
    size_t open;
    double share;           /* the largest change as a share of the probe's own light */
    double change, largest; /* by the last pass, of probes, */
    double settled;         /* the largest value of the other entries */
} isogi_trace__segment;

/* What the filter compares; of transfer see isogi_trace__guide_series. pilot: luminance by its first round, and the variance of that.
   lights: variance of the light that is not filtered. Variances are in scene.square. albedo, glow: of the surface through the texel,
   which is the one that its rays meet. steep: by how much the field changes from texel to texel, along its gradient. */
typedef struct isogi_trace__guide {
    double isovalue, steep;
    float normal[3], mean[3], luminance, variance, pilot, pilot_variance, lights;
    uint32_t samples; /* 0: nothing was gathered */
    float albedo[3], glow[3];
    float spread;            /* of transfer: variance of a coefficient of higher bands */
    float hidden, reflected; /* share of rays that hit, and luminance of what was reflected there */
} isogi_trace__guide;

/* What passes read of a probe beside its values: albedo by channel where its rays hit (1 if they bring their own), and 1 / samples. */
typedef struct isogi_trace__reflector {
    float albedo[3], one;
} isogi_trace__reflector;

/* The next probe of a chain, number + 1, 0 = none; and of its own cell that part of the key which tells one chain from another. */
typedef struct isogi_trace__link {
    uint32_t next, tag;
} isogi_trace__link;

/* How far a node has come. */
typedef struct isogi_trace__stage {
    signed char level;    /* blocks of samples that are complete */
    signed char begun;    /* the next one has samples */
    signed char finished; /* texel: 1: no more samples are wanted; 2: its light was loaded */
    uint8_t readers;      /* probe: hits that take their light from it, those that texels are still to make included */
    uint8_t wanted;       /* probe: samples; until its generation begins, the least of them */
    uint8_t deep;         /* probe: samples that a node which reads it often asks for; */
    uint16_t same;        /* hits of the last one that read it, in one block or in several that no other read between, */
    uint32_t reader;      /* which is this one: its number, twice, and 1 for a probe */
} isogi_trace__stage;

/* Nodes that stay where they are once they are made. guides: of texels; reflectors, links: of probes. values: their four kinds (below), one
   after the other. heads: where chains of probes begin, number + 1, 0 = nowhere; NULL of texels. stages: in few bytes
   what one thread goes through. settled: of probes, whether the values (of either kind, one after the other) stay.
   where: of texels, 64 times the number of the brick, and the slot. All lie in one block of memory, with those of the next chunks:
   block, bytes: of the first of these. */
typedef struct isogi_trace__chunk {
    uint8_t *block;
    size_t bytes;
    float *values;
    isogi_trace__node *nodes;
    isogi_trace__guide *guides;
    isogi_trace__reflector *reflectors;
    isogi_trace__link *links;
    uint32_t *heads;
    isogi_trace__stage *stages;
    uint8_t *settled;
    size_t *where;
} isogi_trace__chunk;

/* What a node's values are. DIRECT: sums over rays that escaped; BOUNCE: of texels over rays that hit, of probes what comes from sky and
   lights; OUT, and the one after it: irradiance or transfer. */
enum {
    ISOGI_TRACE__DIRECT_VALUES = 0,
    ISOGI_TRACE__BOUNCE_VALUES,
    ISOGI_TRACE__OUT_VALUES,
    ISOGI_TRACE__KINDS = 4
};

/* Texels, or probes. */
typedef struct isogi_trace__set {
    isogi_trace__chunk *chunks;
    size_t count, chunk_count, chunk_made, chunk_capacity; /* chunk_made: those in use, and more that lie in the last block */
    size_t headed;   /* chunks whose chains are in use */
    size_t head_bit; /* the largest power of two that is no more than the number of these chains */
    int out; /* 0 or 1: where the light is that was worked out last */
    isogi_trace__segment *segments;
    size_t segment_count, segment_capacity;
} isogi_trace__set;

/* Samples first .. first + count - 1 of a node, and what they brought, as the node has it. */
typedef struct isogi_trace__span {
    uint32_t node, first, count, offset; /* offset: of its samples in the batch */
    const isogi_trace__node *of;
    int nowhere;   /* there is no place for its rays to begin */
    uint32_t hits; /* that are to be lit */
    double steady[3], light[3], light_spread, bright[3], bright_spread, square;
} isogi_trace__span;

/* Which samples a span has; offset: of the first of them in the batch. */
typedef struct isogi_trace__plan {
    uint32_t node, first, count, offset;
} isogi_trace__plan;

/* A piece of a batch: its first span and sample; its hits, the place of the first among those of the batch, and how many of them found no
   probe. */
typedef struct isogi_trace__piece {
    uint32_t span, offset, hits, first_hit, fresh;
} isogi_trace__piece;

/* How far a search for a hit's probe has come: probes of its cell that it has passed, and of those in the hit's plane that have its
   colours, then of all in the plane, the one whose isovalue is nearest, number + 1, with the difference. */
typedef struct isogi_trace__quest {
    double least[2];
    uint32_t nearest[2];
    int tries;
} isogi_trace__quest;

/* What became of one cosine-distributed ray; key 0: it escaped. */
typedef struct isogi_trace__catch {
    uint64_t key;
    double isovalue; /* of the ray */
    isogi_hit hit;
    float normal[3], albedo[3];
    uint32_t probe; /* number + 1 of the probe of this hit; 0: none was there when the ray was traced, */
    float alike;    /* and one that is made has this; */
    signed char from;
    isogi_trace__quest search; /* it passed those that there were */
} isogi_trace__catch;

/* The hits of a probe's rays; albedo: as a segment has it. */
typedef struct isogi_trace__row {
    const uint32_t *probe;
    const float (*albedo)[3];
    size_t count;
} isogi_trace__row;

/* What works out the light of probes where it fades slowly, see there: vectors, of each value of each probe; sums over the probes of a
   chunk, SUMS for each value. */
typedef struct isogi_trace__solver {
    size_t bytes; /* of the block of memory in which all of this lies */
    int stage, round;
    isogi_trace__row *rows;
    double *light, *rest, *shadow, *way, *image, *second, *sums;
    double product[ISOGI_TRACE__VALUES], along[ISOGI_TRACE__VALUES], across[ISOGI_TRACE__VALUES], turn[ISOGI_TRACE__VALUES];
    double most[ISOGI_TRACE__VALUES]; /* the largest that comes from sky and lights */
} isogi_trace__solver;

struct isogi_trace__feedback {
    isogi_trace__set texels, probes;
    isogi_trace__solver *solver; /* while it is at work */
    uint8_t *block; /* of memory, in which the buffers lie: */
    size_t block_bytes;
    isogi_trace__plan *plans; /* of the spans, which each task writes itself */
    isogi_trace__span *spans;
    isogi_trace__catch *catches;
    struct isogi_trace__cast *casts; /* of tasks */
    float *direct; /* of spans */
    isogi_trace__piece *pieces; /* and one behind them */
    uint32_t *found; /* of each catch, number + 1 of its probe; ESCAPED where there was no hit */
    uint32_t *fresh; /* catches that found no probe: of a piece, from the place of its first sample on */
    uint32_t *makers, *tags;         /* catches that get the new probes; the tags of their cells; */
    uint32_t *next, *heads;          /* chains of these, place + 1, and where they begin */
    size_t span_count, sample_count, piece_count;
    size_t patience; /* samples of a batch, so that one is done before the next step is cancelled; 0: as many as fit */
    size_t cursor, probe_cursor; /* nodes before these have nothing to do at this level */
    size_t probe_end;            /* of the generation of probes at work: later ones were made by its rays, */
    size_t probe_counted;        /* of which those before this one know how many samples they want */
    size_t probe_checked;        /* since the last batch: those before this one have been asked whether they want to be gathered anew, */
    size_t probe_again;          /* of which this is the first that does, number + 1; 0: none */
    uint32_t batches;            /* traced so far: the number of the one at work */
    int renewed;                 /* some probes have been */
    int level;
    int on_probes; /* the batch is of probes */
    int diverges;   /* no light would be all of it */
    int unpublished; /* nodes have changed since the light was worked out last */
    int phase;       /* of carrying the light over, */
    size_t carried;  /* tasks of it that are done, */
    size_t sweeps;   /* and at work, */
    size_t segment, pass; /* texels' segment, pass over the probes */
    double before, middle; /* largest share changed by the pass before, and largest change 500 passes before */
    double dark;           /* a millionth of the largest light of the pass before */
    int making;      /* nodes: 1 of every other texel along each axis, 2 of the others; 0 when they are made */
    size_t made, made_bricks; /* of the queue: bricks that are done, and to do */
    size_t placed;   /* texels before this one know where they lie; */
    size_t settled;  /* those before this one were finished when the texture last had nothing to do; */
    size_t settled_probes, settled_segments[2]; /* probes, and segments of texels and of probes, that there were then */
    int stirred; /* the light of some of these probes may be another one now */
    size_t open;     /* texels that want more samples than they have at the end of a level */
    int bounced;     /* sums over texels' hits are of a level before */
    uint64_t partial; /* samples of texels that are not finished, */
    uint64_t unfinished; /* of which there are so many */
    double most; /* texels that were ever done, with the parts of those that were begun: for progress */
    double probe_part; /* of the probes at this level that are known, those whose rays are traced */
    uint64_t probes_before; /* of groups of texels that are finished, */
    int diverged;           /* one of which diverges */
};

/* When a block of samples is complete the light at probes is worked out, then that of the texels. That takes no rays, but as long as many:
   it is cut into tasks, each of which counts as the rays that take about as long. */
enum {
    ISOGI_TRACE__AT_REST = 0,
    ISOGI_TRACE__DIRECT,
    ISOGI_TRACE__PASS,
    ISOGI_TRACE__SOLVE, /* if passes bring it on too slowly */
    ISOGI_TRACE__CLEAR,
    ISOGI_TRACE__BOUNCE,
    ISOGI_TRACE__GUIDE,
    ISOGI_TRACE__PILOT,
    ISOGI_TRACE__PUBLISH,
    ISOGI_TRACE__FINISH,
    ISOGI_TRACE__FORGET /* only when all texels are finished */
};

/* Rays of a task, gathered so that they are traced together. Too large for a stack: each task has its own. */
typedef struct isogi_trace__cast {
    isogi_trace *trace;
    isogi_counters *counters;
    isogi_trace__span *span; /* of this piece */
    isogi_trace__site site[ISOGI_TRACE__PIECE_SPANS];
    uint64_t sequence[ISOGI_TRACE__PIECE_SPANS];
    double turn[ISOGI_TRACE__PIECE_SPANS][2]; /* of the sequence */
    double sum[ISOGI_TRACE__PIECE_SPANS], square[ISOGI_TRACE__PIECE_SPANS]; /* of luminance by one light */
    int shadow; /* rays towards lights; else cosine-distributed ones */
    int bright; /* the light is the sky */
    int distant; /* the light is */
    isogi_trace__disc disc;
    int count;
    isogi_ray ray[ISOGI_TRACE__FLUSH];
    isogi_hit hit[ISOGI_TRACE__FLUSH];
    uint8_t blocked[ISOGI_TRACE__FLUSH]; /* shadow: in place of the hits */
    float normal[ISOGI_TRACE__FLUSH][3];
    uint32_t owner[ISOGI_TRACE__FLUSH], sample[ISOGI_TRACE__FLUSH];
    double weight[ISOGI_TRACE__FLUSH]; /* pi times the density of cosine-distributed rays; of the sky's radiance, for those drawn by it */
    double rgb[ISOGI_TRACE__FLUSH][3]; /* shadow: what arrives if nothing is in the way */
} isogi_trace__cast;

/* ---- memory ---- */

static isogi_trace__node *isogi_trace__node_at(const isogi_trace__set *s, size_t i) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].nodes[i % ISOGI_TRACE__CHUNK];
}

static isogi_trace__guide *isogi_trace__guide_at(const isogi_trace__set *s, size_t i) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].guides[i % ISOGI_TRACE__CHUNK];
}

static isogi_trace__reflector *isogi_trace__reflector_at(const isogi_trace__set *s, size_t i) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].reflectors[i % ISOGI_TRACE__CHUNK];
}

/* Of the values of one kind, 0 or 1. */
static uint8_t *isogi_trace__settled_at(const isogi_trace__set *s, size_t i, int out) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].settled[(size_t)out * ISOGI_TRACE__CHUNK + i % ISOGI_TRACE__CHUNK];
}

static isogi_trace__link *isogi_trace__link_at(const isogi_trace__set *s, size_t i) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].links[i % ISOGI_TRACE__CHUNK];
}

static isogi_trace__stage *isogi_trace__stage_at(const isogi_trace__set *s, size_t i) {
    return &s->chunks[i / ISOGI_TRACE__CHUNK].stages[i % ISOGI_TRACE__CHUNK];
}

/* v: values of a node. */
static float *isogi_trace__values_at(const isogi_trace__set *s, size_t i, int kind, size_t v) {
    return s->chunks[i / ISOGI_TRACE__CHUNK].values + ((size_t)kind * ISOGI_TRACE__CHUNK + i % ISOGI_TRACE__CHUNK) * v;
}

/* The light that was worked out last. */
static float *isogi_trace__light_at(const isogi_trace__set *s, size_t i, size_t v) {
    return isogi_trace__values_at(s, i, ISOGI_TRACE__OUT_VALUES + s->out, v);
}

/* The next `count` elements of a block of memory, of which `used` bytes are; block NULL: the block is only measured. */
static void *isogi_trace__part(uint8_t *block, size_t *used, size_t count, size_t size) {
    void *part = block ? block + *used : NULL;
    *used += (count * size + 63) / 64 * 64;
    return part;
}

/* Where the arrays of a chunk lie; bytes. */
static size_t isogi_trace__chunk_set(const isogi_trace *t, isogi_trace__chunk *c, uint8_t *at, int chains) {
    const size_t n = ISOGI_TRACE__CHUNK;
    size_t used = 0;
    memset(c, 0, sizeof *c);
    c->nodes = (isogi_trace__node *)isogi_trace__part(at, &used, n, sizeof *c->nodes);
    c->values = (float *)isogi_trace__part(at, &used, ISOGI_TRACE__KINDS * n, (size_t)t->values * sizeof(float));
    c->stages = (isogi_trace__stage *)isogi_trace__part(at, &used, n, sizeof *c->stages);
    if (chains) {
        c->reflectors = (isogi_trace__reflector *)isogi_trace__part(at, &used, n, sizeof *c->reflectors);
        c->links = (isogi_trace__link *)isogi_trace__part(at, &used, n, sizeof *c->links);
        c->heads = (uint32_t *)isogi_trace__part(at, &used, n, sizeof *c->heads);
        c->settled = (uint8_t *)isogi_trace__part(at, &used, n, 2 * sizeof *c->settled);
    } else {
        c->guides = (isogi_trace__guide *)isogi_trace__part(at, &used, n, sizeof *c->guides);
        c->where = (size_t *)isogi_trace__part(at, &used, n, sizeof *c->where);
    }
    return used;
}

/* The last one; its block goes with the first chunk that lies in it. While a group is forgotten some may still be in use. */
static void isogi_trace__chunk_free(const isogi_trace *t, isogi_trace__set *s) {
    const isogi_trace__chunk *c = &s->chunks[--s->chunk_made];
    if (s->chunk_count > s->chunk_made) s->chunk_count = s->chunk_made;
    isogi_release(&t->context, c->block, 1, c->bytes);
}

static void isogi_trace__segment_free(const isogi_trace *t, isogi_trace__segment *s) {
    if (s->numbers) isogi_release(&t->context, s->node, s->numbers, sizeof(uint32_t));
}

static void isogi_trace__set_free(const isogi_trace *t, isogi_trace__set *s) {
    size_t i;
    for (i = 0; i < s->segment_count; i++) isogi_trace__segment_free(t, &s->segments[i]);
    isogi_release(&t->context, s->segments, s->segment_capacity, sizeof *s->segments);
    while (s->chunk_made) isogi_trace__chunk_free(t, s);
    isogi_release(&t->context, s->chunks, s->chunk_capacity, sizeof *s->chunks);
    memset(s, 0, sizeof *s);
}

/* Room for `more` chunks in the list. */
static isogi_result isogi_trace__chunks_reserve(const isogi_trace *t, isogi_trace__set *s, size_t more) {
    size_t capacity = s->chunk_capacity ? 2 * s->chunk_capacity : 16;
    isogi_trace__chunk *chunks;
    if (s->chunk_made + more <= s->chunk_capacity) return ISOGI_OK;
    while (capacity < s->chunk_made + more) capacity *= 2;
    chunks = (isogi_trace__chunk *)isogi_allocate(&t->context, capacity, sizeof *chunks);
    if (!chunks) return ISOGI_NO_MEMORY;
    if (s->chunk_made) memcpy(chunks, s->chunks, s->chunk_made * sizeof *chunks);
    isogi_release(&t->context, s->chunks, s->chunk_capacity, sizeof *chunks);
    s->chunks = chunks, s->chunk_capacity = capacity;
    return ISOGI_OK;
}

/* Another block of chunks: the first has one, the next as many as SLAB bytes hold. */
static isogi_result isogi_trace__chunks_new(const isogi_trace *t, isogi_trace__set *s, int chains) {
    isogi_trace__chunk c;
    const size_t each = isogi_trace__chunk_set(t, &c, NULL, chains), most = ISOGI_TRACE__SLAB / each;
    const size_t n = s->chunk_made && most > 1 ? most : 1, bytes = n > 1 ? ISOGI_TRACE__SLAB : each;
    size_t i;
    uint8_t *block;
    if (s->chunk_made + n > 0xffffffffu / ISOGI_TRACE__CHUNK) return ISOGI_TOO_LARGE;
    if (isogi_trace__chunks_reserve(t, s, n) != ISOGI_OK) return ISOGI_NO_MEMORY;
    block = (uint8_t *)isogi_allocate(&t->context, 1, bytes);
    if (!block) return ISOGI_NO_MEMORY;
    for (i = 0; i < n; i++) isogi_trace__chunk_set(t, &s->chunks[s->chunk_made + i], block + i * each, chains);
    s->chunks[s->chunk_made].block = block, s->chunks[s->chunk_made].bytes = bytes;
    s->chunk_made += n;
    return ISOGI_OK;
}

/* Room for `more` nodes; those that there are stay in their places. chains: they are probes. */
static isogi_result isogi_trace__set_reserve(const isogi_trace *t, isogi_trace__set *s, size_t more, int chains) {
    while (s->count + more > s->chunk_count * ISOGI_TRACE__CHUNK) {
        isogi_result result = s->chunk_count < s->chunk_made ? ISOGI_OK : isogi_trace__chunks_new(t, s, chains);
        if (result != ISOGI_OK) return result;
        s->chunk_count++;
    }
    return ISOGI_OK;
}

/* Where the buffers of a batch lie, in one block of memory; bytes. */
static size_t isogi_trace__buffers_set(const isogi_trace *t, isogi_trace__feedback *f, uint8_t *block) {
    size_t used = 0;
    f->plans = (isogi_trace__plan *)isogi_trace__part(block, &used, ISOGI_TRACE__SPANS, sizeof *f->plans);
    f->spans = (isogi_trace__span *)isogi_trace__part(block, &used, ISOGI_TRACE__SPANS, sizeof *f->spans);
    f->catches = (isogi_trace__catch *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->catches);
    f->casts = (isogi_trace__cast *)isogi_trace__part(block, &used, ISOGI_TRACE__CASTS, sizeof *f->casts);
    f->direct = (float *)isogi_trace__part(block, &used, ISOGI_TRACE__SPANS, (size_t)t->values * sizeof(float));
    f->pieces = (isogi_trace__piece *)isogi_trace__part(block, &used, ISOGI_TRACE__PIECES + 1, sizeof *f->pieces);
    f->found = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->found);
    f->fresh = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->fresh);
    f->makers = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->makers);
    f->tags = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->tags);
    f->next = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__SAMPLES, sizeof *f->next);
    f->heads = (uint32_t *)isogi_trace__part(block, &used, ISOGI_TRACE__HEADS, sizeof *f->heads);
    return used;
}

static void isogi_trace__solver_free(const isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    if (f->solver) isogi_release(&t->context, f->solver, 1, f->solver->bytes);
    f->solver = NULL;
}

static void isogi_trace__feedback_free(const isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    if (!f) return;
    isogi_trace__solver_free(t);
    isogi_trace__set_free(t, &f->texels);
    isogi_trace__set_free(t, &f->probes);
    isogi_release(&t->context, f->block, 1, f->block_bytes);
    isogi_release(&t->context, f, 1, sizeof *f);
}

static isogi_result isogi_trace__feedback_new(isogi_trace *t) {
    isogi_trace__feedback *f = (isogi_trace__feedback *)isogi_allocate(&t->context, 1, sizeof *f);
    t->feedback = f;
    if (!f) return ISOGI_NO_MEMORY;
    memset(f, 0, sizeof *f);
#ifdef ISOGI_TRACE__AVX2
    __builtin_cpu_init();
    t->wide = __builtin_cpu_supports("avx2") && (t->context.force_path <= 0 || t->context.force_path >= 3);
#endif
    f->block_bytes = isogi_trace__buffers_set(t, f, NULL);
    f->block = (uint8_t *)isogi_allocate(&t->context, 1, f->block_bytes);
    if (!f->block) return ISOGI_NO_MEMORY;
    isogi_trace__buffers_set(t, f, f->block);
    return ISOGI_OK;
}

/* ---- the table of probes ---- */

/* Isovalues that are many voxels apart have other keys, or there would be too many probes of one key: the number of such a class, out of
   the range of values in a block about as large as the cell, at its middle. */
static uint64_t isogi_trace__class(const isogi_level *level, const double middle[3], double isovalue) {
    const float *range;
    size_t block[3];
    double width;
    int a;
    for (a = 0; a < 3; a++) block[a] = (size_t)isogi_trace__clamp(middle[a] / level->cells, (double)(level->size[a] - 1));
    range = level->range[block[0] + level->size[0] * (block[1] + level->size[1] * block[2])];
    width = ISOGI_TRACE__CLASS * ((double)range[1] - (double)range[0]) / level->cells;
    return (uint64_t)isogi_trace__clamp(width > 0 ? (isovalue - (double)range[0]) / width : 0, 4e9);
}

/* Cells of isogi_trace__scene_cell voxels, twice as large for rays longer than eight times that, and so on: an eighth of the length at
   most. Rays of probes, whose light matters less, take half of their length up to `cell` voxels; no more, or what stands beside a narrow
   gap would light it. In units of the shortest voxel edge, so that they are cubes in the world, but half a voxel along every axis at
   least: flat or long voxels would be cut into very many. Isovalues are apart, see isogi_trace__alike. */
static uint64_t isogi_trace__probe_key(const isogi_trace__scene *scene, const isogi_hit *hit, const float normal[3], double t,
                                       double cell, double isovalue) {
    const isogi_trace__cells *cells;
    double middle[3], length = t / scene->least;
    uint64_t key = 0;
    int a, axis = 0, level = 0;
    for (a = 1; a < 3; a++)
        if (fabsf(normal[a]) > fabsf(normal[axis])) axis = a;
    for (cells = scene->cells; level < 8; level++, cells++)
        if (!(cells->size * (cells->size < cell ? ISOGI_TRACE__NEAR_RATIO : ISOGI_TRACE__CELL_RATIO) < length)) break;
    for (a = 0; a < 3; a++) {
        double x = (hit->cell[a] + hit->local[a]) / cells->along[a] + 1;
        key = isogi_trace__key(key, (uint64_t)isogi_trace__clamp(x, 4e9));
        middle[a] = (floor(x) - 0.5) * cells->along[a];
    }
    key = isogi_trace__key(key, isogi_trace__class(&cells->blocks, middle, isovalue));
    return isogi_trace__key(key, (uint64_t)(16 * level + 2 * axis + (normal[axis] < 0))) | 1;
}

static uint32_t isogi_trace__tag(uint64_t cell) { return (uint32_t)(cell >> 20); }

/* Where the chain of a tag begins: as many chains as there is room for probes, numbered by its low bits; those beyond the end
   by one bit less (linear hashing, Litwin 1980). */
static uint32_t *isogi_trace__head(const isogi_trace__set *s, uint32_t tag) {
    size_t heads = s->headed * ISOGI_TRACE__CHUNK, bit = s->head_bit, i;
    i = tag & (2 * bit - 1);
    if (i >= heads) i -= bit;
    return &s->chunks[i / ISOGI_TRACE__CHUNK].heads[i % ISOGI_TRACE__CHUNK];
}

/* All chunks' chains come into use; returns how many chunks' were. */
static size_t isogi_trace__heads_use(isogi_trace__set *s) {
    const size_t before = s->headed;
    s->headed = s->chunk_count;
    for (s->head_bit = ISOGI_TRACE__CHUNK; 2 * s->head_bit <= s->headed * ISOGI_TRACE__CHUNK;) s->head_bit *= 2;
    return before;
}

/* The chains of chunk `last` at first .. end - 1 take over, in their order, what is theirs by the next bit of the key. So no step has to
   find a new place for all; and what a chain passes on stays at the same place within a chunk. */
static void isogi_trace__heads_new(const isogi_trace__set *s, size_t last, size_t first, size_t end) {
    uint32_t *heads = s->chunks[last].heads, *old;
    size_t from = 1, i;
    memset(heads + first, 0, (end - first) * sizeof *heads);
    if (!last) return;
    while (2 * from <= last) from *= 2;
    old = s->chunks[last - from].heads;
    for (i = first; i < end; i++) {
        uint32_t *stay = &old[i], *go = &heads[i], probe = *stay;
        if (i + 8 < end && old[i + 8]) ISOGI_TRACE__AHEAD(isogi_trace__link_at(s, old[i + 8] - 1));
        while (probe) {
            isogi_trace__link *link = isogi_trace__link_at(s, probe - 1);
            if (link->tag / ISOGI_TRACE__CHUNK & from) *go = probe, go = &link->next;
            else *stay = probe, stay = &link->next;
            probe = link->next;
        }
        *stay = *go = 0;
    }
}

/* A new node: without a place and without samples; but for its stage. */
static isogi_trace__node *isogi_trace__node_begin(const isogi_trace *t, isogi_trace__set *s, size_t i) {
    isogi_trace__node *n = isogi_trace__node_at(s, i);
    size_t v = (size_t)t->values;
    memset(n, 0, sizeof *n);
    n->from = (signed char)(t->scene.high ? -1 : 1);
    memset(isogi_trace__values_at(s, i, ISOGI_TRACE__DIRECT_VALUES, v), 0, v * sizeof(float));
    memset(isogi_trace__values_at(s, i, ISOGI_TRACE__BOUNCE_VALUES, v), 0, v * sizeof(float));
    memset(isogi_trace__light_at(s, i, v), 0, v * sizeof(float));
    return n;
}

/* Whether a probe may stand for a hit: it faces the same way and lies in the hit's plane, or nearly so: half as far from it as the
   smallest cells reach along the normal. */
static int isogi_trace__same_place(const isogi_trace *t, const isogi_trace__catch *c, const isogi_hit *place, const float normal[3]) {
    const double *voxel = t->scene.voxel;
    double apart = 0, reach = ISOGI_TRACE__PLANE * t->scene.least;
    int a;
    for (a = 0; a < 3; a++) {
        const double *axis = t->scene.axis[a];
        double facing = axis[0] * (double)normal[0] + axis[1] * (double)normal[1] + axis[2] * (double)normal[2];
        double d = ((double)c->hit.cell[a] - (double)place->cell[a] + c->hit.local[a] - place->local[a]) * voxel[a];
        double along = 0.5 * ISOGI_TRACE__HALF * voxel[a] * fabs(facing);
        apart += d * facing;
        if (along > reach) reach = along;
    }
    return fabs(apart) < reach && isogi_trace__dot(c->normal, normal) > 0.5;
}

static int isogi_trace__coloured(const isogi_trace_desc *d) { return d->albedo_count || d->emission_count || d->material; }

/* Whether an isosurface has nearly the same colours as that of c, where c hit: if not, neither's light tells that of the other. Where walls
   are all that is seen light goes as 1 / (1 - albedo). */
static int isogi_trace__same_colours(const isogi_trace *t, const isogi_trace__catch *c, double isovalue) {
    const isogi_trace_desc *d = &t->scene.desc;
    double point[3];
    float albedo[2][3], glow[2][3];
    int a, same = 1;
    if (isogi_trace__zero(isovalue - c->isovalue) || !isogi_trace__coloured(d)) return 1;
    isogi_trace__to_world(t->scene.pyramid, &c->hit, point);
    isogi_trace_material(d, isovalue, point, albedo[0], glow[0]);
    isogi_trace_material(d, c->isovalue, point, albedo[1], glow[1]);
    for (a = 0; a < 3; a++) {
        const double most = (double)(glow[0][a] > glow[1][a] ? glow[0][a] : glow[1][a]);
        const double lost = 1 - (double)(albedo[0][a] > albedo[1][a] ? albedo[0][a] : albedo[1][a]);
        same = same && fabs((double)albedo[0][a] - (double)albedo[1][a]) <= ISOGI_TRACE__COLOURS * (lost < 0.5 ? 2 * lost : 1);
        same = same && fabs((double)glow[0][a] - (double)glow[1][a]) <= ISOGI_TRACE__COLOURS * most;
    }
    return same;
}

/* How much the trilinear field changes over a voxel along each grid axis: along one after the other, differences of what there is and means
   by the place of both. */
static void isogi_trace__slopes(const isogi_trace__scene *scene, const isogi_hit *place, double slope[3]) {
    const double u = place->local[0], v = place->local[1], w = place->local[2];
    double corner[8], x[4], dx[4], y[2], dy[2];
    int i;
    isogi_volume_corners(scene->volume, place->cell, corner);
    for (i = 0; i < 4; i++) dx[i] = corner[2 * i + 1] - corner[2 * i], x[i] = corner[2 * i] * (1 - u) + corner[2 * i + 1] * u;
    for (i = 0; i < 2; i++) dy[i] = x[2 * i + 1] - x[2 * i], y[i] = x[2 * i] * (1 - v) + x[2 * i + 1] * v;
    slope[0] = (dx[0] * (1 - v) + dx[1] * v) * (1 - w) + (dx[2] * (1 - v) + dx[3] * v) * w;
    slope[1] = dy[0] * (1 - w) + dy[1] * w;
    slope[2] = y[1] - y[0];
}

/* Length of a vector whose squares need not be numbers: values may be of any size. */
static double isogi_trace__magnitude(const double v[3]) {
    double most = 0, square = 0;
    int a;
    for (a = 0; a < 3; a++) most = fabs(v[a]) > most ? fabs(v[a]) : most;
    for (a = 0; a < 3 && most > 0; a++) square += v[a] / most * (v[a] / most);
    return most * sqrt(square);
}

/* How far isovalues may lie from that of a probe that tells their light, as a share of the volume's range: as much as the field changes
   in ALIKE voxels there. Where a skin of some value shuts a hollow, isosurfaces next to each other are dark and bright. */
static double isogi_trace__alike(const isogi_trace__scene *scene, const isogi_hit *hit) {
    double slope[3];
    int a;
    isogi_trace__slopes(scene, hit, slope);
    for (a = 0; a < 3; a++) slope[a] /= scene->voxel[a];
    return ISOGI_TRACE__ALIKE * scene->least * (isogi_trace__magnitude(slope) / scene->range);
}

/* Passes the next probe of the cell: 1: the search ends, with nearest[0]. Of more than so many probes of a cell none is added: the one in
   the hit's plane whose isovalue is nearest stands for it, of its colours if there is one, or the last, whatever its place: else colours
   that differ at every point would need ever more probes, and time to search them. */
static int isogi_trace__search_on(const isogi_trace *t, const isogi_trace__catch *c, isogi_trace__quest *s, uint32_t number,
                                  const isogi_hit *place, const float normal[3], double isovalue, float alike) {
    double other = fabs(isovalue - c->isovalue) / t->scene.range;
    if (other < s->least[0] && isogi_trace__same_place(t, c, place, normal)) {
        if (other < s->least[1]) s->nearest[1] = number, s->least[1] = other;
        if (isogi_trace__same_colours(t, c, isovalue)) {
            s->nearest[0] = number, s->least[0] = other;
            if (other < (double)alike || isogi_trace__zero(other)) return 1;
        }
    }
    if (s->tries++ < (isogi_trace__coloured(&t->scene.desc) ? 4 : 1) * ISOGI_TRACE__CELL_PROBES) return 0;
    if (!s->nearest[0]) s->nearest[0] = s->nearest[1] ? s->nearest[1] : number;
    return 1;
}

/* The number + 1 of the probe of a hit; 0: there is none. Probes are only ever added to the end of a chain, so what was found once is
   found again. */
static uint32_t isogi_trace__probe_find(const isogi_trace *t, isogi_trace__catch *c) {
    const isogi_trace__set *set = &t->feedback->probes;
    isogi_trace__quest search = {{HUGE_VAL, HUGE_VAL}, {0, 0}, 0};
    uint32_t at = set->headed ? *isogi_trace__head(set, isogi_trace__tag(c->key)) : 0, found = 0;
    while (at && !found) {
        const isogi_trace__link *link = isogi_trace__link_at(set, at - 1);
        const isogi_trace__node *n = link->tag == isogi_trace__tag(c->key) ? isogi_trace__node_at(set, at - 1) : NULL;
        if (n && n->cell == c->key && isogi_trace__search_on(t, c, &search, at, &n->place, n->normal, n->isovalue, n->alike))
            found = search.nearest[0];
        at = link->next;
    }
    c->search = search;
    return found;
}

/* What a search will read first: where the chain begins, the link of its first probe, and that probe where it is of the cell. To be sent
   for by the caller: a function that does nothing else would be left out by compilers. */
static const void *isogi_trace__probe_ahead(const isogi_trace__set *set, const isogi_trace__catch *c, int what) {
    const uint32_t *head;
    if (!set->headed) return c;
    head = isogi_trace__head(set, isogi_trace__tag(c->key));
    if (what == 0) return head;
    if (!*head) return c;
    if (what == 1) return isogi_trace__link_at(set, *head - 1);
    return isogi_trace__link_at(set, *head - 1)->tag == isogi_trace__tag(c->key) ? (const void *)isogi_trace__node_at(set, *head - 1) : c;
}

/* Probes for hits that found none; those that get a new one are `makers`. Chains of these, in the order of samples, are searched like those
   of probes. Returns how many are new. */
static size_t isogi_trace__probes_meet(const isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    const size_t late = 8; /* hits ahead */
    size_t piece, made = 0;
    memset(f->heads, 0, ISOGI_TRACE__HEADS * sizeof *f->heads);
    for (piece = 0; piece < f->piece_count; piece++) {
        const uint32_t *fresh = f->fresh + f->pieces[piece].offset;
        size_t i, count = f->pieces[piece].fresh;
        for (i = 0; i < count; i++) {
            isogi_trace__catch *c = &f->catches[fresh[i]];
            uint32_t *at = &f->heads[isogi_trace__tag(c->key) & (ISOGI_TRACE__HEADS - 1)];
            if (i + late < count) ISOGI_TRACE__AHEAD(&f->catches[fresh[i + late]].key);
            if (i + late < count) ISOGI_TRACE__AHEAD(&f->catches[fresh[i + late]].search);
            for (; *at && !c->probe; at = &f->next[*at - 1]) {
                const isogi_trace__catch *o = &f->catches[f->makers[*at - 1]];
                if (o->key != c->key) continue;
                if (isogi_trace__search_on(t, c, &c->search, o->probe, &o->hit, o->normal, o->isovalue, o->alike))
                    c->probe = c->search.nearest[0];
            }
            if (!c->probe) {
                f->makers[made] = fresh[i], f->tags[made] = isogi_trace__tag(c->key), f->next[made] = 0, *at = (uint32_t)++made;
                c->probe = (uint32_t)(f->probes.count + made);
            }
            f->found[fresh[i]] = c->probe;
        }
    }
    return made;
}

/* Puts the new probes whose chains are at first .. end - 1 of a chunk at the ends of these. There is room for them. */
static void isogi_trace__probes_link(const isogi_trace *t, size_t made, size_t first, size_t end) {
    const isogi_trace__feedback *f = t->feedback;
    const isogi_trace__set *set = &f->probes;
    uint32_t some[64], *at;
    size_t i = 0, k, n;
    while (i < made) { /* memory is sent for ahead */
        for (n = 0; i < made && n < 64; i++)
            if (f->tags[i] % ISOGI_TRACE__CHUNK - first < end - first) some[n++] = (uint32_t)i;
        for (k = 0; k < n; k++) ISOGI_TRACE__AHEAD(isogi_trace__head(set, f->tags[some[k]]));
        for (k = 0; k < n; k++) {
            at = isogi_trace__head(set, f->tags[some[k]]);
            if (*at) ISOGI_TRACE__AHEAD(isogi_trace__link_at(set, *at - 1));
        }
        for (k = 0; k < n; k++) {
            isogi_trace__link *link = isogi_trace__link_at(set, set->count + some[k]);
            for (at = isogi_trace__head(set, f->tags[some[k]]); *at;) at = &isogi_trace__link_at(set, *at - 1)->next;
            link->tag = f->tags[some[k]], link->next = 0;
            *at = (uint32_t)(set->count + some[k] + 1);
        }
    }
}

/* The rest of a new probe, apart: it can be done by many at a time. */
static void isogi_trace__probe_finish(const isogi_trace *t, size_t i, const isogi_trace__catch *c) {
    isogi_trace__set *set = &t->feedback->probes;
    isogi_trace__node *n = isogi_trace__node_begin(t, set, i);
    isogi_trace__stage *stage = isogi_trace__stage_at(set, i);
    double point[3];
    int a;
    n->isovalue = c->isovalue;
    n->place = c->hit, n->cell = n->key = c->key, n->from = c->from, n->alike = c->alike;
    for (a = 0; a < c->search.tries; a++) n->key = isogi_trace__key(n->key, 1);
    memcpy(n->normal, c->normal, sizeof n->normal);
    isogi_trace__to_world(t->scene.pyramid, &n->place, point);
    isogi_trace_material(&t->scene.desc, n->isovalue, point, n->albedo, NULL);
    stage->level = stage->begun = stage->finished = 0; /* readers are another task's */
    stage->wanted = n->albedo[0] > 0.9f || n->albedo[1] > 0.9f || n->albedo[2] > 0.9f ? 2 : 1;
}

/* ---- blocks of samples ---- */

/* With lazy or adaptive baking a texel's samples come in blocks of 4, 16, 64, ...: coarse first. */
static int isogi_trace__in_blocks(const isogi_trace_desc *d) { return d->lazy || d->error > 0; }

/* Samples of a texel's blocks before number `level`. */
static uint32_t isogi_trace__block(const isogi_trace *t, int level) {
    uint32_t samples = (uint32_t)t->scene.desc.samples, sum;
    if (!isogi_trace__in_blocks(&t->scene.desc)) return level ? samples : 0;
    sum = level > 12 ? samples : (((uint32_t)1 << (2 * level + 2)) - 4) / 3;
    return sum < samples ? sum : samples;
}

/* Samples of a node are one stretch of a Sobol sequence. Texels near each other share its scramble, and each turns it (Cranley and
   Patterson 1976) by this much for a step along each axis, so that those around a texel, which the filter averages, are well spread
   together: on surfaces of all directions, with 1, 2 and 4 samples, by a search at random for the least low frequencies of their sum.
   The first probe of a probes' cell is turned by the voxels' cell in which it lies. */
static void isogi_trace__turn(const size_t texel[3], double turn[2]) {
    static const double step[2][3] = {{0.22891, 0.49289, 0.10247}, {0.85142, 0.83062, 0.54863}};
    int a;
    for (a = 0; a < 2; a++) {
        double x = step[a][0] * (double)texel[0] + step[a][1] * (double)texel[1] + step[a][2] * (double)texel[2];
        turn[a] = x - floor(x);
    }
}

/* Number `sample` of the sequence. */
static void isogi_trace__turned(const isogi_trace__sequence *s, uint32_t sample, const double turn[2], double u[2]) {
    int a;
    isogi_trace__sobol(s, sample, u);
    for (a = 0; a < 2; a++) u[a] += turn[a], u[a] -= u[a] >= 1 ? 1 : 0;
}

static uint64_t isogi_trace__turned_key(const size_t texel[3]) {
    const size_t side = ISOGI_TRACE__TURNED;
    return isogi_trace__key(isogi_trace__key(texel[0] / side, texel[1] / side), texel[2] / side);
}

/* ---- rays of a task, gathered into batches ---- */

static float *isogi_trace__span_direct(const isogi_trace *t, const isogi_trace__span *span) {
    return t->feedback->direct + (size_t)(span - t->feedback->spans) * (size_t)t->values;
}

/* Radiance that a cosine-distributed ray brings. */
static void isogi_trace__span_bring(const isogi_trace *t, isogi_trace__span *span, const double rgb[3]) {
    float *direct = isogi_trace__span_direct(t, span);
    double luminance = isogi_trace__luminance(rgb);
    int a;
    for (a = 0; a < 3; a++) direct[a] += (float)rgb[a];
    span->square += luminance * luminance;
}

/* It left the volume. */
static void isogi_trace__cast_escape(isogi_trace__cast *c, int i) {
    const isogi_trace *t = c->trace;
    const isogi_trace__scene *scene = &t->scene;
    isogi_trace__span *span = &c->span[c->owner[i]];
    float *direct = isogi_trace__span_direct(t, span);
    const float *dir = c->ray[i].dir;
    double weight = 1, density = 0, rgb[3];
    float basis[ISOGI_TRACE__MAX_ORDER * ISOGI_TRACE__MAX_ORDER], radiance[3];
    int k, a, channels = scene->desc.transfer_channels, count = scene->desc.order * scene->desc.order;
    if (scene->desc.mode == ISOGI_TRACE_TRANSFER) {
        isogi_sh_eval(basis, scene->desc.order, (const float(*)[3])dir, 1);
        for (k = 0; k < count; k++)
            for (a = 0; a < channels; a++) direct[k * channels + a] += basis[k];
        return;
    }
    if (!scene->has_env) return;
    if (scene->sky.rays) density = ISOGI_TRACE__PI * isogi_trace__sky_density(&scene->sky, dir);
    if (density > 0) weight = c->weight[i] / (c->weight[i] + isogi_trace__sky_rays(&scene->sky, span->of->brick != NULL) * density);
    isogi_trace__env_light(&scene->desc.lighting.env, dir, radiance);
    for (a = 0; a < 3; a++) rgb[a] = weight * (double)radiance[a];
    isogi_trace__span_bring(t, span, rgb);
}

/* Colours where a ray hit. Light that the surface sends out there is brought. */
static void isogi_trace__cast_material(isogi_trace__cast *c, isogi_trace__span *span, isogi_trace__catch *at) {
    const isogi_trace *t = c->trace;
    float emission[3];
    double point[3], rgb[3];
    int a;
    isogi_trace__to_world(t->scene.pyramid, &at->hit, point);
    isogi_trace_material(&t->scene.desc, span->of->isovalue, point, at->albedo, emission);
    isogi_trace__albedo_channels(&t->scene.desc, at->albedo);
    if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) return;
    for (a = 0; a < 3; a++) rgb[a] = (double)emission[a];
    isogi_trace__span_bring(t, span, rgb);
}

/* It hit: the key of the probe that will tell the light there. A ray that meets the surface from the side where it is not has begun
   within matter, and counts as reflected where it starts. */
static void isogi_trace__cast_hit(isogi_trace__cast *c, int i) {
    const isogi_trace *t = c->trace;
    isogi_trace__span *span = &c->span[c->owner[i]];
    const isogi_trace__site *site = &c->site[c->owner[i]];
    isogi_trace__catch *to = &t->feedback->catches[span->offset + (c->sample[i] - span->first)];
    int side = c->hit[i].side > 0 ? 1 : -1, a;
    double length = c->hit[i].t;
    to->from = (signed char)side;
    to->hit = c->hit[i], to->isovalue = span->of->isovalue;
    memcpy(to->normal, c->normal[i], sizeof to->normal);
    if (!(isogi_trace__dot(to->normal, to->normal) > 0)) memcpy(to->normal, site->normal, sizeof to->normal);
    else for (a = 0; a < 3 && side < 0; a++) to->normal[a] = -to->normal[a];
    if (!site->open && site->from != side) {
        to->hit = site->place, to->from = site->from, length = 0;
        memcpy(to->normal, site->normal, sizeof to->normal);
    }
    if (t->scene.desc.emission_count || t->scene.desc.material) isogi_trace__cast_material(c, span, to);
    if (!t->scene.desc.bounces) return;
    to->key = isogi_trace__probe_key(&t->scene, &to->hit, to->normal, length,
                                     span->of->brick ? t->scene.cells[0].size : ISOGI_TRACE__CELL_FAR, span->of->isovalue);
    to->probe = 0;
}

/* The probes of hits that rays first .. first + count - 1 have made, as far as they are known. */
static void isogi_trace__cast_probes(isogi_trace__cast *c, int first, int count) {
    const isogi_trace *t = c->trace;
    isogi_trace__catch *hit[ISOGI_TRACE__FLUSH];
    int i, n = 0;
    for (i = first; i < first + count; i++) {
        const isogi_trace__span *span = &c->span[c->owner[i]];
        hit[n] = &t->feedback->catches[span->offset + (c->sample[i] - span->first)];
        if (!hit[n]->key) continue;
        ISOGI_TRACE__AHEAD(isogi_trace__probe_ahead(&t->feedback->probes, hit[n], 0));
        n++;
    }
    for (i = 0; i < n; i++) ISOGI_TRACE__AHEAD(isogi_trace__probe_ahead(&t->feedback->probes, hit[i], 1));
    for (i = 0; i < n; i++) {
        const char *probe = (const char *)isogi_trace__probe_ahead(&t->feedback->probes, hit[i], 2);
        ISOGI_TRACE__AHEAD(probe);
        ISOGI_TRACE__AHEAD(probe + 64);
    }
    for (i = 0; i < n; i++) {
        hit[i]->probe = isogi_trace__probe_find(t, hit[i]);
        if (!hit[i]->probe) hit[i]->alike = (float)isogi_trace__alike(&t->scene, &hit[i]->hit);
    }
}

/* Takes in the results of rays first .. first + count - 1. */
static void isogi_trace__cast_land(isogi_trace__cast *c, int first, int count) {
    int i, a;
    for (i = first; i < first + count; i++) {
        isogi_trace__span *span = &c->span[c->owner[i]];
        if (c->shadow) {
            double luminance;
            float radiance[3];
            if (c->blocked[i]) continue;
            if (c->bright) {
                isogi_trace__env_light(&c->trace->scene.desc.lighting.env, c->ray[i].dir, radiance);
                for (a = 0; a < 3; a++) c->rgb[i][a] = c->weight[i] * (double)radiance[a];
            }
            luminance = isogi_trace__luminance(c->rgb[i]);
            for (a = 0; a < 3; a++) *(c->bright ? &span->bright[a] : &span->light[a]) += c->rgb[i][a];
            c->sum[c->owner[i]] += luminance, c->square[c->owner[i]] += luminance * luminance;
            continue;
        }
        if (!c->hit[i].side || c->trace->scene.desc.no_shadows) isogi_trace__cast_escape(c, i);
        if (c->hit[i].side) isogi_trace__cast_hit(c, i);
    }
    if (!c->shadow) isogi_trace__cast_probes(c, first, count);
}

static void isogi_trace__cast_flush(isogi_trace__cast *c) {
    const isogi_trace__scene *scene = &c->trace->scene;
    if (!c->count) return;
    if (c->shadow) {
        memset(c->blocked, 0, sizeof c->blocked);
        if (!scene->desc.no_shadows) isogi_vol_occluded(scene->pyramid, c->ray, (size_t)c->count, c->blocked, c->counters);
    } else {
        isogi_vol_intersect(scene->pyramid, c->ray, (size_t)c->count, c->hit, c->counters);
        isogi_vol_normals(scene->pyramid, c->hit, (size_t)c->count, ISOGI_NORMAL_TRILINEAR, c->normal);
    }
    isogi_trace__cast_land(c, 0, c->count);
    c->count = 0;
}

/* The ray whose owner, sample and weights have been written to place c->count. Sites on the surface itself are rare: their rays go
   one by one. */
static void isogi_trace__cast_add(isogi_trace__cast *c, const float dir[3], double tmax) {
    const isogi_trace__scene *scene = &c->trace->scene;
    const isogi_trace__site *site = &c->site[c->owner[c->count]];
    int i = c->count;
    isogi_ray *ray = &c->ray[i];
    memcpy(ray->dir, dir, sizeof ray->dir);
    tmax = isogi_trace__within(&scene->desc, site->point, site->origin, dir, tmax);
    if (site->on_surface) {
        if (c->shadow && scene->desc.no_shadows) memset(&c->hit[i], 0, sizeof c->hit[i]);
        else isogi_trace__site_rays(scene, site, site->from, (const float(*)[3])dir, &tmax, 1, ray, &c->hit[i], c->counters);
        c->blocked[i] = c->hit[i].side != 0;
        if (!c->shadow) isogi_vol_normals(scene->pyramid, &c->hit[i], 1, ISOGI_NORMAL_TRILINEAR, &c->normal[i]);
        isogi_trace__cast_land(c, i, 1);
        return;
    }
    memcpy(ray->origin, site->origin, sizeof ray->origin);
    ray->flags = scene->flags, ray->tmin = 0, ray->tmax = tmax, ray->isovalue = site->isovalue;
    if (++c->count == ISOGI_TRACE__FLUSH) isogi_trace__cast_flush(c);
}

/* ---- the rays of one span ---- */

static void isogi_trace__span_hemisphere(isogi_trace__cast *c, uint32_t k) {
    const isogi_trace__span *span = &c->span[k];
    const isogi_trace__site *site = &c->site[k];
    const isogi_trace__sequence sequence = isogi_trace__sequence_of(c->sequence[k]);
    isogi_trace__basis basis;
    uint32_t i;
    isogi_trace__basis_of(site->normal, &basis);
    for (i = span->first; i < span->first + span->count; i++) {
        double u[2];
        float dir[3];
        isogi_trace__turned(&sequence, i, c->turn[k], u);
        isogi_trace__cosine(&basis, u[0], u[1], dir);
        if (site->on_surface) isogi_trace__mirror(site->geometric, dir);
        c->owner[c->count] = k, c->sample[c->count] = i;
        c->weight[c->count] = isogi_trace__site_kernel(site, dir);
        isogi_trace__cast_add(c, dir, 0);
    }
}

/* Directions drawn by the brightness of the environment's image, weighed against the others by the balance heuristic. */
static void isogi_trace__span_sky(isogi_trace__cast *c, uint32_t k) {
    const isogi_trace__sky *sky = &c->trace->scene.sky;
    const isogi_trace__span *span = &c->span[k];
    const isogi_trace__sequence sequence = isogi_trace__light_sequence(c->sequence[k], 0);
    const uint32_t rays = (uint32_t)isogi_trace__sky_rays(sky, span->of->brick != NULL);
    uint32_t i;
    for (i = rays * span->first; i < rays * (span->first + span->count); i++) {
        double u[2], cosine, density;
        float dir[3];
        isogi_trace__turned(&sequence, i, c->turn[k], u);
        density = isogi_trace__sky_direction(sky, u[0], u[1], dir);
        cosine = isogi_trace__site_kernel(&c->site[k], dir) / ISOGI_TRACE__PI;
        if (!(cosine > 0) || !(density > 0)) continue;
        c->weight[c->count] = cosine / (rays * density + cosine);
        c->owner[c->count] = k;
        isogi_trace__cast_add(c, dir, 0);
    }
}

/* Samples of each light that go with the first so many others: one with every second, but more at texels, as what lights bring is not
   filtered: one with each of the first four; of wide lights four with each of the first two, then two. */
static uint32_t isogi_trace__light_samples(const isogi_trace__scene *scene, uint32_t samples, int is_texel) {
    const uint32_t first = ISOGI_TRACE__LIGHT_FIRST;
    if (!is_texel) return (samples + 1) / 2;
    if (scene->wide) return samples <= first / 2 ? first * samples : 2 * samples + first;
    return samples <= first ? samples : (samples + 1 + first) / 2;
}

static void isogi_trace__span_light(isogi_trace__cast *c, uint32_t k, size_t number) {
    const isogi_light *light = &c->trace->scene.desc.lighting.lights[number];
    const isogi_trace__span *span = &c->span[k];
    const isogi_trace__sequence sequence = isogi_trace__light_sequence(c->sequence[k], 1 + number);
    uint32_t i = isogi_trace__light_samples(&c->trace->scene, span->first, span->of->brick != NULL);
    const uint32_t end = isogi_trace__light_samples(&c->trace->scene, span->first + span->count, span->of->brick != NULL);
    for (; i < end; i++) {
        double u[2];
        isogi_trace__beam beam;
        isogi_trace__turned(&sequence, i, c->turn[k], u);
        if (c->distant) isogi_trace__disc_beam(&c->disc, u[0], u[1], &beam);
        else if (!isogi_trace__light_beam(light, c->site[k].point, u[0], u[1], &beam)) continue;
        if (!isogi_trace__site_beam(&c->site[k], &beam)) continue;
        memcpy(c->rgb[c->count], beam.rgb, sizeof beam.rgb);
        c->owner[c->count] = k;
        isogi_trace__cast_add(c, beam.dir, beam.tmax);
    }
}

/* Begins a round of rays; ends the one before, by one light: its spread goes to the spans. */
static void isogi_trace__cast_round(isogi_trace__cast *c, uint32_t spans) {
    uint32_t k;
    isogi_trace__cast_flush(c);
    for (k = 0; k < spans && c->shadow; k++) {
        const isogi_trace__span *s = &c->span[k];
        const isogi_trace__scene *scene = &c->trace->scene;
        const int texel = s->of->brick != NULL;
        const uint32_t before = isogi_trace__light_samples(scene, s->first, texel),
                       after = isogi_trace__light_samples(scene, s->first + s->count, texel),
                       n = c->bright ? s->count * (uint32_t)isogi_trace__sky_rays(&scene->sky, texel) : after - before;
        double spread = n ? c->square[k] - c->sum[k] * c->sum[k] / n : 0;
        *(c->bright ? &c->span[k].bright_spread : &c->span[k].light_spread) += spread > 0 ? spread : 0;
    }
    memset(c->sum, 0, sizeof c->sum);
    memset(c->square, 0, sizeof c->square);
}

/* Normals of the probes among spans first .. end - 1 of a task, WAVE at most. */
static void isogi_trace__span_normals(isogi_trace__cast *c, uint32_t first, uint32_t end) {
    const isogi_trace *t = c->trace;
    isogi_hit place[ISOGI_TRACE__WAVE];
    signed char from[ISOGI_TRACE__WAVE];
    float shading[ISOGI_TRACE__WAVE][3], geometric[ISOGI_TRACE__WAVE][3];
    uint32_t owner[ISOGI_TRACE__WAVE], k, n = 0;
    for (k = first; k < end; k++) {
        const isogi_trace__node *probe = c->span[k].of;
        if (probe->brick) continue;
        memcpy(c->site[k].normal, probe->normal, sizeof probe->normal); /* of a cap */
        if (probe->place.side != 1 && probe->place.side != -1) continue;
        place[n] = probe->place, from[n] = probe->from, owner[n++] = k;
    }
    if (n) isogi_trace__normals(t->scene.pyramid, t->scene.desc.normals, place, from, n, shading, geometric);
    for (k = 0; k < n; k++) memcpy(c->site[owner[k]].normal, shading[k], sizeof shading[k]);
}

/* Where span k's rays begin; 0: nowhere (the voxels were changed after the texel was classified, which breaks the contract). */
static int isogi_trace__span_site(isogi_trace__cast *c, uint32_t k) {
    const isogi_trace *t = c->trace;
    const isogi_trace__node *n = c->span[k].of;
    isogi_trace__site *site = &c->site[k];
    uint64_t seed = t->scene.desc.seed;
    if (n->brick) {
        const size_t x[3] = {n->texel[0], n->texel[1], n->texel[2]};
        if (!(isogi_trace__dot(n->normal, n->normal) > 0)) return 0;
        memcpy(site->normal, n->normal, sizeof site->normal);
        c->sequence[k] = isogi_trace__key(isogi_trace__key(seed, 6), isogi_trace__turned_key(x));
        isogi_trace__turn(x, c->turn[k]);
    } else if (n->key == n->cell) { /* the first probe of its cell: turned like a texel, since hits of one texel read many of a wall */
        const size_t x[3] = {n->place.cell[0], n->place.cell[1], n->place.cell[2]};
        c->sequence[k] = isogi_trace__key(isogi_trace__key(seed, 5), isogi_trace__turned_key(x));
        isogi_trace__turn(x, c->turn[k]);
    } else c->sequence[k] = isogi_trace__key(isogi_trace__key(seed, 4), n->key), c->turn[k][0] = c->turn[k][1] = 0;
    site->place = n->place, site->isovalue = n->isovalue, site->from = n->from;
    isogi_trace__site_start(&t->scene, site, n->from < 0);
    return 1;
}

/* Counts the hits of a piece, and lists those that found no probe. */
static void isogi_trace__piece_hits(const isogi_trace *t, isogi_trace__piece *piece) {
    isogi_trace__feedback *f = t->feedback;
    uint32_t *fresh = f->fresh + piece->offset, i, k;
    piece->hits = piece->fresh = 0;
    for (i = piece->span; i < piece[1].span; i++) {
        isogi_trace__span *s = &f->spans[i];
        for (k = s->offset; k < s->offset + s->count; k++) {
            const int hit = f->catches[k].key != 0;
            s->hits += (uint32_t)hit, f->found[k] = hit ? f->catches[k].probe : ISOGI_TRACE__ESCAPED;
            if (!f->found[k]) fresh[piece->fresh++] = k;
        }
        piece->hits += s->hits;
    }
}

static void isogi_trace__cast_piece(isogi_trace__cast *c, isogi_trace__piece *piece) {
    isogi_trace *t = c->trace;
    isogi_trace__feedback *f = t->feedback;
    const isogi_lighting *lighting = &t->scene.desc.lighting;
    uint32_t k, spans = piece[1].span - piece->span;
    size_t l;
    c->span = f->spans + piece->span, c->count = 0, c->shadow = 0, c->bright = 0;
    memset(f->direct + piece->span * (size_t)t->values, 0, spans * (size_t)t->values * sizeof(float));
    for (k = 0; k < spans; k++) {
        const isogi_trace__plan *plan = &f->plans[piece->span + k];
        isogi_trace__span *s = &c->span[k];
        memset(s, 0, sizeof *s);
        s->node = plan->node, s->first = plan->first, s->count = plan->count, s->offset = plan->offset;
        s->of = isogi_trace__node_at(f->on_probes ? &f->probes : &f->texels, s->node);
    }
    for (k = 0; k < spans; k += ISOGI_TRACE__WAVE)
        isogi_trace__span_normals(c, k, spans - k < ISOGI_TRACE__WAVE ? spans : k + ISOGI_TRACE__WAVE);
    for (k = 0; k < spans; k++) {
        isogi_trace__span *s = &c->span[k];
        uint32_t i;
        c->counters->texels += !f->on_probes && !s->first;
        for (i = 0; i < s->count; i++) f->catches[s->offset + i].key = 0;
        if (!isogi_trace__span_site(c, k) || isogi_trace__dark(&t->scene)) s->nowhere = 1, c->site[k].isovalue = 0;
    }
    for (k = 0; k < spans; k++)
        if (!c->span[k].nowhere) isogi_trace__span_hemisphere(c, k);
    isogi_trace__cast_round(c, spans);
    isogi_trace__piece_hits(t, piece);
    if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) return;
    c->shadow = c->bright = 1;
    for (k = 0; k < spans && t->scene.sky.rays; k++)
        if (!c->span[k].nowhere) isogi_trace__span_sky(c, k);
    isogi_trace__cast_round(c, spans);
    c->bright = 0;
    for (l = 0; l < lighting->light_count; l++) {
        if (isogi_trace__is_delta(&lighting->lights[l])) continue;
        c->distant = isogi_trace__disc_set(&lighting->lights[l], &c->disc);
        for (k = 0; k < spans; k++)
            if (!c->span[k].nowhere) isogi_trace__span_light(c, k, l);
        isogi_trace__cast_round(c, spans);
    }
    for (k = 0; k < spans; k++)
        if (!c->span[k].nowhere && !c->span[k].first)
            isogi_trace__site_lights(&t->scene, &c->site[k], c->site[k].from, c->span[k].steady, c->counters);
}

/* Tasks of the batch. */
static size_t isogi_trace__cast_tasks(const isogi_trace__feedback *f) {
    return f->piece_count < ISOGI_TRACE__CASTS ? f->piece_count : ISOGI_TRACE__CASTS;
}

/* Where a task begins that has a share of `count` things: the first tasks have most, since the memory that they work in stays in the
   cache, the last ones least, so that all threads end together. */
static size_t isogi_trace__portion(size_t count, size_t tasks, size_t task) {
    const uint64_t left = tasks - task;
    return count > tasks ? count - (size_t)((uint64_t)count * left * left / ((uint64_t)tasks * tasks)) : task;
}

static void isogi_trace__cast_task(void *arg, size_t task) {
    isogi_trace *t = (isogi_trace *)arg;
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__cast *c = &f->casts[task];
    size_t tasks = isogi_trace__cast_tasks(f), i, end = isogi_trace__portion(f->piece_count, tasks, task + 1);
    c->trace = t, c->counters = &t->task_counters[task];
    memset(c->counters, 0, sizeof *c->counters);
    for (i = isogi_trace__portion(f->piece_count, tasks, task); i < end; i++) isogi_trace__cast_piece(c, &f->pieces[i]);
}

/* ---- a batch: filled, traced, taken over ---- */

/* Spans of the node's current block, as many as fit. 0: full. */
static int isogi_trace__spans_add(isogi_trace *t, const isogi_trace__set *set, size_t node, uint64_t limit) {
    isogi_trace__feedback *f = t->feedback;
    const isogi_trace__stage *stage = isogi_trace__stage_at(set, node);
    uint32_t first = set == &f->probes ? 0 : isogi_trace__block(t, stage->level),
             end = set == &f->probes ? stage->wanted : isogi_trace__block(t, stage->level + 1);
    if (stage->begun) first = isogi_trace__node_at(set, node)->samples;
    while (first < end) {
        isogi_trace__plan *plan = &f->plans[f->span_count];
        isogi_trace__piece *piece = &f->pieces[f->piece_count - 1];
        uint32_t count = end - first < ISOGI_TRACE__SPAN ? end - first : ISOGI_TRACE__SPAN;
        if (f->span_count == ISOGI_TRACE__SPANS || f->sample_count + count > ISOGI_TRACE__SAMPLES) return 0;
        if (f->span_count && f->sample_count >= limit) return 0;
        if (f->span_count > piece->span && /* the piece has a span: is it full? */
            (f->span_count - piece->span == ISOGI_TRACE__PIECE_SPANS || f->sample_count - piece->offset >= ISOGI_TRACE__SPAN)) {
            f->piece_count++, piece++;
            piece->span = (uint32_t)f->span_count, piece->offset = (uint32_t)f->sample_count;
        }
        plan->node = (uint32_t)node, plan->first = first, plan->count = count, plan->offset = (uint32_t)f->sample_count;
        f->span_count++, f->sample_count += count, first += count;
    }
    return 1;
}

/* The probes that rays have met since are the next generation. A hit is worth one path that goes on from there, so each has as many
   samples as there are hits that read it: few are read by more than two, and with more samples than readers in a room that is closed,
   probes would breed probes until they fill it. Two at least where nearly all light is reflected, also where texels have one: probes whose
   only rays meet one another are a room without a way out. Counted once, between generations, so that slices of a bake do not matter.
   Returns how many of `limit` probes were left. */
static uint64_t isogi_trace__generation(isogi_trace *t, uint64_t limit) {
    isogi_trace__feedback *f = t->feedback;
    uint32_t most = (uint32_t)t->scene.desc.samples < ISOGI_TRACE__PROBE_MOST ? (uint32_t)t->scene.desc.samples : ISOGI_TRACE__PROBE_MOST;
    most = most > 1 ? most : 2;
    for (; f->probe_counted < f->probes.count && limit; f->probe_counted++, limit--) {
        isogi_trace__stage *stage = isogi_trace__stage_at(&f->probes, f->probe_counted);
        uint32_t wanted = stage->readers > stage->wanted ? stage->readers : stage->wanted; /* that was the least */
        wanted = wanted < most ? wanted : most;
        stage->wanted = (uint8_t)(wanted > stage->deep ? wanted : stage->deep);
    }
    if (f->probe_counted == f->probes.count) f->probe_end = f->probes.count;
    return limit;
}

/* Where a texel's rays meet but few probes, as in a pocket, it has their light, and what their few samples do not know its own never
   would: most often they see no way out at all. Such a probe has more samples, by its share of the texel's; it is gathered anew when it
   should have twice as many, and its hits before that lie in a segment that passes leave out. (By what its samples brought, as that hardly
   any has escaped, it must not be: those that chance made bright would stay, and light with them.) Asked for when no probe is left to be
   gathered, so that slices of a bake do not matter. */
static uint64_t isogi_trace__renewals(isogi_trace *t, uint64_t limit) {
    isogi_trace__feedback *f = t->feedback;
    /* one of limit for 64 of them: each look is short */
    for (; f->probe_checked < f->probes.count && limit; f->probe_checked++, limit -= f->probe_checked % 64 == 0) {
        isogi_trace__stage *stage = isogi_trace__stage_at(&f->probes, f->probe_checked);
        if (stage->deep >= 2 * stage->wanted) stage->level = 0, stage->wanted = stage->deep, f->renewed = 1;
        if (!stage->level && !f->probe_again) f->probe_again = f->probe_checked + 1;
    }
    if (f->probe_checked == f->probes.count && f->probe_again) f->probe_cursor = f->probe_again - 1, f->probe_again = 0;
    return limit;
}

/* Texels at the current level come first, then probes, one generation after the other. limit: samples, about; as many nodes are looked
   at as take that long, which is added to *spent. 1: none at this level is left. */
static int isogi_trace__spans_fill(isogi_trace *t, uint64_t limit, uint64_t *spent) {
    isogi_trace__feedback *f = t->feedback;
    const uint64_t most = limit < UINT64_MAX / 8 ? 8 * limit : limit;
    uint64_t look = most;
    f->span_count = f->sample_count = 0;
    f->piece_count = 1, f->pieces[0].span = f->pieces[0].offset = 0, f->on_probes = 0;
    for (; f->cursor < f->texels.count && look; f->cursor++, look--) {
        const isogi_trace__stage *stage = isogi_trace__stage_at(&f->texels, f->cursor);
        if (stage->finished || stage->level != f->level) continue;
        if (!isogi_trace__spans_add(t, &f->texels, f->cursor, limit)) break;
    }
    if (!f->span_count && f->cursor == f->texels.count) {
        f->on_probes = 1;
        if (f->probe_cursor == f->probe_end) look = isogi_trace__generation(t, look);
        if (f->probe_cursor == f->probes.count) look = isogi_trace__renewals(t, look);
        for (; f->probe_cursor < f->probe_end; f->probe_cursor++) {
            const isogi_trace__stage *stage = isogi_trace__stage_at(&f->probes, f->probe_cursor);
            if (!stage->level && !isogi_trace__spans_add(t, &f->probes, f->probe_cursor, limit)) break;
        }
    }
    f->pieces[f->piece_count].span = (uint32_t)f->span_count, *spent += (most - look) / 8;
    if (f->span_count) return 0;
    f->piece_count = 0;
    return look && f->cursor == f->texels.count;
}

/* Room for the segments of one more batch. */
static isogi_result isogi_trace__segments_reserve(const isogi_trace *t, isogi_trace__set *set) {
    size_t capacity = set->segment_capacity ? 2 * set->segment_capacity : 32;
    isogi_trace__segment *segments;
    if (set->segment_count + ISOGI_TRACE__SPANS / ISOGI_TRACE__PASSED <= set->segment_capacity) return ISOGI_OK;
    segments = (isogi_trace__segment *)isogi_allocate(&t->context, capacity, sizeof *segments);
    if (!segments) return ISOGI_NO_MEMORY;
    if (set->segment_count) memcpy(segments, set->segments, set->segment_count * sizeof *segments);
    isogi_release(&t->context, set->segments, set->segment_capacity, sizeof *segments);
    set->segments = segments, set->segment_capacity = capacity;
    return ISOGI_OK;
}

/* The segment of the batch's hits, not yet filled, and room for the probes that it lacks. */
static isogi_result isogi_trace__segment_new(isogi_trace *t, isogi_trace__segment *s, size_t *made) {
    isogi_trace__feedback *f = t->feedback;
    size_t i, hits = 0;
    isogi_result result;
    for (i = 0; i < f->piece_count; i++) f->pieces[i].first_hit = (uint32_t)hits, hits += f->pieces[i].hits;
    *made = isogi_trace__probes_meet(t);
    memset(s, 0, sizeof *s);
    s->entries = f->span_count, s->hits = hits, s->batch = f->batches;
    s->numbers = (f->on_probes ? 3 : 2) * s->entries + 1 + (t->scene.desc.material ? 4 : 1) * hits;
    s->node = (uint32_t *)isogi_allocate(&t->context, s->numbers, sizeof(uint32_t));
    if (!s->node) return ISOGI_NO_MEMORY;
    s->begin = s->node + s->entries, s->probe = s->begin + s->entries + 1, s->begin[s->entries] = (uint32_t)hits;
    if (f->on_probes) s->order = s->probe + hits;
    if (t->scene.desc.material) s->albedo = (float(*)[3])(s->probe + hits + (f->on_probes ? s->entries : 0));
    result = isogi_trace__set_reserve(t, &f->probes, *made, 1);
    if (result != ISOGI_OK) isogi_trace__segment_free(t, s);
    return result;
}

/* The part of a piece. */
static void isogi_trace__segment_fill(const isogi_trace *t, const isogi_trace__segment *s, const isogi_trace__piece *piece) {
    const isogi_trace__feedback *f = t->feedback;
    uint32_t i, k, at = piece->first_hit;
    for (i = piece->span; i < piece[1].span; i++) {
        const isogi_trace__span *span = &f->spans[i];
        s->node[i] = span->node, s->begin[i] = at;
        for (k = span->offset; k < span->offset + span->count && span->hits; k++) {
            if (f->found[k] == ISOGI_TRACE__ESCAPED) continue;
            if (s->albedo) memcpy(s->albedo[at], f->catches[k].albedo, sizeof *s->albedo);
            s->probe[at++] = f->found[k] - 1;
        }
    }
}

/* What comes from sky and lights, as irradiance or transfer. */
static double isogi_trace__node_direct(const isogi_trace *t, const isogi_trace__set *set, size_t node, int value) {
    const isogi_trace__node *n = isogi_trace__node_at(set, node);
    const float *direct = isogi_trace__values_at(set, node, ISOGI_TRACE__DIRECT_VALUES, (size_t)t->values);
    double e = n->samples ? ISOGI_TRACE__PI / n->samples * (double)direct[value] : 0;
    if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) return e;
    if (n->samples) e += ISOGI_TRACE__PI / n->samples * n->bright[value];
    return e + n->steady[value] + (n->light_samples ? n->light[value] / n->light_samples : 0);
}

/* A first answer, before any probe is known: the surroundings that its rays met are taken to be as bright as the texel itself. */
static void isogi_trace__texel_guess(isogi_trace *t, size_t node) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__node *n = isogi_trace__node_at(&f->texels, node);
    float to[ISOGI_TRACE__VALUES], error = (float)(1 / sqrt((double)n->samples));
    double hidden = (double)n->hits / n->samples, most = 0;
    int i, channels = t->scene.desc.mode == ISOGI_TRACE_TRANSFER ? t->scene.desc.transfer_channels : 3;
    for (i = 0; i < t->values; i++) {
        double lost = (double)n->albedo[i % channels] * hidden;
        to[i] = (float)(isogi_trace__node_direct(t, &f->texels, node, i) / (1 - (lost < 0.9 ? lost : 0.9)));
        most = (double)to[i] > most ? (double)to[i] : most;
    }
    if (t->scene.desc.mode == ISOGI_TRACE_IRRADIANCE) /* nothing is known of its spread yet */
        error = (float)sqrt(most * most + isogi_trace__unseen(t->scene.possible, most, n->samples));
    isogi_trace__record_write(t, isogi_trace__record(t, n->brick, n->slot), to, error);
    n->brick->state[n->slot] = ISOGI_TRACE__DRAFT;
}

/* A probe is gathered anew. */
static void isogi_trace__node_clear(isogi_trace__node *n) {
    memset(n->steady, 0, sizeof n->steady), memset(n->light, 0, sizeof n->light), memset(n->bright, 0, sizeof n->bright);
    n->light_spread = n->bright_spread = n->square = 0, n->samples = n->light_samples = n->hits = 0;
}

/* Takes over what a span brought; a texel that had nothing is given a first answer. */
static void isogi_trace__span_commit(isogi_trace *t, isogi_trace__set *set, const isogi_trace__span *s) {
    isogi_trace__node *n = isogi_trace__node_at(set, s->node);
    isogi_trace__stage *stage = isogi_trace__stage_at(set, s->node);
    float *direct = isogi_trace__values_at(set, s->node, ISOGI_TRACE__DIRECT_VALUES, (size_t)t->values);
    const float *from = isogi_trace__span_direct(t, s);
    int a, fresh = n->brick && !n->samples;
    if (!n->brick && !s->first) isogi_trace__node_clear(n), memset(direct, 0, (size_t)t->values * sizeof *direct);
    if (!n->brick) n->slot = t->feedback->batches;
    for (a = 0; a < t->values; a++) direct[a] += from[a];
    for (a = 0; a < 3; a++)
        n->steady[a] += s->steady[a], n->light[a] += s->light[a], n->bright[a] += s->bright[a];
    n->light_spread += s->light_spread, n->bright_spread += s->bright_spread, n->square += s->square;
    n->samples = s->first + s->count, n->hits += s->hits;
    n->light_samples = isogi_trace__light_samples(&t->scene, n->samples, n->brick != NULL);
    stage->begun = n->samples != (n->brick ? isogi_trace__block(t, stage->level + 1) : stage->wanted);
    if (!stage->begun) stage->level++;
    if (fresh) isogi_trace__texel_guess(t, s->node);
}

/* Counts the batch's hits at the probes of a strand, 64 of every so many. One of a texel counts twice while blocks of samples are to come,
   whose hits will read the same probes. As often as there are samples to come costs more rays, at no smaller error. */
static void isogi_trace__readers_count(isogi_trace *t, size_t made, size_t strand, size_t strands) {
    isogi_trace__feedback *f = t->feedback;
    const uint32_t most = isogi_trace__block(t, f->level + 1), block = most - isogi_trace__block(t, f->level);
    const uint32_t weight = !f->on_probes && most < (uint32_t)t->scene.desc.samples ? 2 : 1;
    size_t i, k;
    for (i = f->probes.count; i < f->probes.count + made; i++) {
        isogi_trace__stage *stage = isogi_trace__stage_at(&f->probes, i);
        if ((i / 64 & (strands - 1)) == strand) stage->readers = stage->deep = 0, stage->same = 0, stage->reader = 0;
    }
    for (i = 0; i < f->span_count; i++) {
        const isogi_trace__plan *plan = &f->plans[i];
        const uint32_t reader = 2 * plan->node + (uint32_t)f->on_probes, samples = f->on_probes ? plan->count : block;
        for (k = plan->offset; k < plan->offset + plan->count; k++) {
            isogi_trace__stage *stage;
            uint32_t deep;
            if (f->found[k] == ISOGI_TRACE__ESCAPED || ((f->found[k] - 1) / 64 & (strands - 1)) != strand) continue;
            stage = isogi_trace__stage_at(&f->probes, f->found[k] - 1);
            if (stage->readers < ISOGI_TRACE__PROBE_MOST) stage->readers = (uint8_t)(stage->readers + weight);
            if (stage->reader != reader) stage->reader = reader, stage->same = 0;
            if (stage->same < 65535) stage->same++;
            if (stage->same < ISOGI_TRACE__PROBE_SAME) continue;
            deep = stage->same < samples ? ISOGI_TRACE__PROBE_DEEP * stage->same / samples : ISOGI_TRACE__PROBE_DEEP;
            deep = deep < most ? deep : most; /* no more than texels have so far */
            if (deep > stage->deep && deep > ISOGI_TRACE__PROBE_MOST) stage->deep = (uint8_t)deep;
        }
    }
}

typedef struct isogi_trace__taken {
    isogi_trace *trace;
    const isogi_trace__segment *segment;
    size_t made;    /* new probes */
    size_t headed;  /* chunks whose chains were in use */
    size_t strands; /* tasks by which chains and readers are divided */
} isogi_trace__taken;

/* First the spans of a piece, those of its last node also where they go on in the next one, which leaves them out; then the new probes,
   which many threads so are the first to touch; then chains of probes and hits that read them, by strands. */
static void isogi_trace__take_task(void *arg, size_t task) {
    const isogi_trace__taken *taken = (const isogi_trace__taken *)arg;
    isogi_trace *t = taken->trace;
    isogi_trace__feedback *f = t->feedback;
    size_t i, first, end;
    if (task < f->piece_count) {
        const isogi_trace__piece *piece = &f->pieces[task];
        isogi_trace__segment_fill(t, taken->segment, piece);
        for (i = piece->span; i && i < piece[1].span && f->spans[i].node == f->spans[i - 1].node;) i++;
        end = piece[1].span;
        while (i < end && end < f->span_count && f->spans[end].node == f->spans[end - 1].node) end++;
        for (; i < end; i++) isogi_trace__span_commit(t, f->on_probes ? &f->probes : &f->texels, &f->spans[i]);
        return;
    }
    task -= f->piece_count, i = task * ISOGI_TRACE__SWEEP;
    if (i < taken->made) {
        end = i + ISOGI_TRACE__SWEEP < taken->made ? i + ISOGI_TRACE__SWEEP : taken->made;
        for (; i < end; i++) isogi_trace__probe_finish(t, f->probes.count + i, &f->catches[f->makers[i]]);
        return;
    }
    task -= (taken->made + ISOGI_TRACE__SWEEP - 1) / ISOGI_TRACE__SWEEP;
    first = task * ISOGI_TRACE__CHUNK / taken->strands, end = (task + 1) * ISOGI_TRACE__CHUNK / taken->strands;
    for (i = taken->headed; i < f->probes.headed; i++) isogi_trace__heads_new(&f->probes, i, first, end);
    isogi_trace__probes_link(t, taken->made, first, end);
    isogi_trace__readers_count(t, taken->made, task, taken->strands);
}

/* Adds a batch's segment; of probes, cut into those that tasks of a pass have. There is room for them. */
static void isogi_trace__segment_add(isogi_trace__set *set, const isogi_trace__segment *batch) {
    const size_t most = batch->order ? ISOGI_TRACE__PASSED : batch->entries;
    size_t i;
    for (i = 0; i < batch->entries; i += most) {
        isogi_trace__segment *s = &set->segments[set->segment_count++];
        *s = *batch;
        s->entries = batch->entries - i < most ? batch->entries - i : most, s->numbers = i ? 0 : batch->numbers;
        s->node += i, s->begin += i, s->hits = s->begin[s->entries] - s->begin[0];
        if (s->order) s->order += i;
    }
}

/* Traces the batch and takes it over; on failure nothing has been added. */
static isogi_result isogi_trace__spans_run(isogi_trace *t, double from, double to) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__set *set = f->on_probes ? &f->probes : &f->texels;
    isogi_trace__segment segment;
    isogi_context silent = t->context;
    isogi_trace__taken taken;
    isogi_result result = isogi_parallel(&t->context, isogi_trace__cast_tasks(f), isogi_trace__cast_task, t, from, to);
    size_t i, tasks;
    taken.trace = t, taken.segment = &segment, taken.made = 0, silent.progress = NULL;
    if (result == ISOGI_OK) result = isogi_trace__segments_reserve(t, set);
    if (result == ISOGI_OK) result = isogi_trace__segment_new(t, &segment, &taken.made);
    if (result != ISOGI_OK) return result;
    taken.headed = isogi_trace__heads_use(&f->probes);
    tasks = f->piece_count + (taken.made + ISOGI_TRACE__SWEEP - 1) / ISOGI_TRACE__SWEEP;
    taken.strands = tasks < 16 ? 1 : ISOGI_TRACE__STRANDS, tasks += taken.strands;
    if (taken.strands > 1) isogi_parallel(&silent, tasks, isogi_trace__take_task, &taken, 0, 1);
    else for (i = 0; i < tasks; i++) isogi_trace__take_task(&taken, i); /* not worth a thread */
    if (f->on_probes && f->plans[0].node < f->settled_probes) f->stirred = 1; /* the first of the batch */
    f->probes.count += taken.made, f->probe_checked = f->probe_again = 0, f->batches++;
    isogi_trace__segment_add(set, &segment);
    for (i = 0; i < isogi_trace__cast_tasks(f); i++) isogi_trace__add(&t->counters, &t->task_counters[i]);
    if (!f->on_probes) f->partial += f->sample_count;
    return ISOGI_OK;
}

/* ---- passes over probes ---- */

/* A request brings texels to those that there were. What is finished does not read the new ones' probes, which are made where there were
   none: it rests, unless probes that it reads are gathered anew, or more. How many texels do, and probes. */
static size_t isogi_trace__resting(const isogi_trace__feedback *f) { return f->stirred ? 0 : f->settled; }
static size_t isogi_trace__resting_probes(const isogi_trace__feedback *f) { return f->stirred ? 0 : f->settled_probes; }
static size_t isogi_trace__resting_segments(const isogi_trace__feedback *f, int probes) {
    return f->stirred ? 0 : f->settled_segments[probes];
}

/* Where a task's nodes begin and end. */
static size_t isogi_trace__sweep(const isogi_trace *t, size_t task, size_t count, size_t *begin) {
    *begin = (t->feedback->carried + task) * ISOGI_TRACE__SWEEP;
    return *begin + ISOGI_TRACE__SWEEP < count ? *begin + ISOGI_TRACE__SWEEP : count;
}

static int isogi_trace__channel(const isogi_trace *t, int value) {
    return t->scene.desc.mode == ISOGI_TRACE_TRANSFER ? value % t->scene.desc.transfer_channels : value;
}

/* What passes read of probes, in few bytes. The first pass begins with what comes from sky and lights; a probe that reads no other has
   settled, as one that rests has. */
static void isogi_trace__direct_task(void *arg, size_t task) {
    const isogi_trace *t = (const isogi_trace *)arg;
    isogi_trace__set *set = &t->feedback->probes;
    const size_t resting = isogi_trace__resting_probes(t->feedback);
    size_t v = (size_t)t->values, i, end = isogi_trace__sweep(t, task, set->count, &i);
    int a;
    for (; i < end && i < resting; i++) {
        memcpy(isogi_trace__values_at(set, i, ISOGI_TRACE__OUT_VALUES + 1 - set->out, v), isogi_trace__light_at(set, i, v),
               v * sizeof(float));
        *isogi_trace__settled_at(set, i, 0) = *isogi_trace__settled_at(set, i, 1) = 1;
    }
    for (; i < end; i++) {
        const isogi_trace__node *n = isogi_trace__node_at(set, i);
        isogi_trace__reflector *r = isogi_trace__reflector_at(set, i);
        float *bounce = isogi_trace__values_at(set, i, ISOGI_TRACE__BOUNCE_VALUES, v), *out = isogi_trace__light_at(set, i, v);
        for (a = 0; a < t->values; a++) {
            bounce[a] = (float)isogi_trace__node_direct(t, set, i, a);
            out[a] = bounce[a];
        }
        for (a = 0; a < 3; a++) r->albedo[a] = t->scene.desc.material ? 1 : n->albedo[a];
        isogi_trace__albedo_channels(&t->scene.desc, r->albedo);
        r->one = n->samples ? 1.0f / (float)n->samples : 0;
        *isogi_trace__settled_at(set, i, 0) = *isogi_trace__settled_at(set, i, 1) = !n->hits;
    }
}

/* One pass over the probes of a segment, each of which has one entry: from one kind of OUT_VALUES to the other. A probe that reads none, or
   none that will change, has settled with this pass; the next one copies its light to the other kind, and later ones leave it out. watch:
   that is looked at. albedo: the segment's. */
static void isogi_trace__pass_segment(isogi_trace__set *set, isogi_trace__segment *s, size_t values, size_t channels,
                                      const float (*albedo)[3], double dark, int watch) {
    const int out = set->out, from = ISOGI_TRACE__OUT_VALUES + out, to = ISOGI_TRACE__OUT_VALUES + 1 - out;
    const size_t late = 8; /* entries ahead */
    size_t i, j, k, a, open = 0;
    double largest = 0, most = 0, part = 0;
    for (j = 0; j < s->open; j++) {
        size_t node;
        const isogi_trace__reflector *r;
        const float *bounce, *before;
        float *after;
        uint8_t settled = (uint8_t)watch;
        double sum[ISOGI_TRACE__VALUES], own[3], moved[3]; /* own: the largest value of each channel, down to `dark` */
        i = s->order[j], node = s->node[i], r = isogi_trace__reflector_at(set, node);
        before = isogi_trace__values_at(set, node, from, values), after = isogi_trace__values_at(set, node, to, values);
        if (j + late < s->open)
            for (k = s->begin[s->order[j + late]]; k < s->begin[s->order[j + late] + 1]; k++)
                ISOGI_TRACE__AHEAD(isogi_trace__values_at(set, s->probe[k], from, values));
        if (*isogi_trace__settled_at(set, node, out)) {
            for (a = 0; a < values; a++) {
                after[a] = before[a];
                if (fabs((double)after[a]) > s->settled) s->settled = fabs((double)after[a]);
            }
            *isogi_trace__settled_at(set, node, 1 - out) = 1;
            continue;
        }
        bounce = isogi_trace__values_at(set, node, ISOGI_TRACE__BOUNCE_VALUES, values);
        for (a = 0; a < values; a++) sum[a] = 0;
        for (a = 0; a < channels; a++) own[a] = dark, moved[a] = 0;
        for (k = s->begin[i]; k < s->begin[i + 1]; k++) {
            const float *e = isogi_trace__values_at(set, s->probe[k], from, values);
            if (watch) settled &= *isogi_trace__settled_at(set, s->probe[k], out);
            if (albedo)
                for (a = 0; a < values; a++) sum[a] += (double)albedo[k][a % channels] * (double)e[a];
            else
                for (a = 0; a < values; a++) sum[a] += (double)e[a];
        }
        for (a = 0; a < values; a++) {
            double share = (double)r->one * (double)r->albedo[a % channels];
            double e = (double)bounce[a] + share * sum[a], change = fabs(e - (double)before[a]);
            after[a] = (float)e, e = fabs(e);
            if (change > moved[a % channels]) moved[a % channels] = change;
            if (e > own[a % channels]) own[a % channels] = e;
            most = change > most ? change : most, largest = e > largest ? e : largest;
        }
        for (a = 0; a < channels; a++)
            if (moved[a] > part * own[a]) part = moved[a] / own[a];
        *isogi_trace__settled_at(set, node, 1 - out) = settled, s->order[open++] = (uint32_t)i;
    }
    s->open = open, s->change = most, s->share = part, s->largest = largest > s->settled ? largest : s->settled;
}

static void isogi_trace__pass_task(void *arg, size_t segment) {
    const isogi_trace *t = (const isogi_trace *)arg;
    isogi_trace__set *set = &t->feedback->probes;
    isogi_trace__segment *s = &set->segments[t->feedback->carried + segment];
    size_t channels = t->scene.desc.mode == ISOGI_TRACE_TRANSFER ? (size_t)t->scene.desc.transfer_channels : 3, i;
    if (t->feedback->pass == 1) {
        for (i = s->open = 0; i < s->entries; i++)
            if (!t->feedback->renewed || isogi_trace__node_at(set, s->node[i])->slot == s->batch) s->order[s->open++] = (uint32_t)i;
        s->settled = 0;
    }
    /* the compiler unrolls it; after a few passes nearly all of the probes that are left read each other in a circle */
    if (t->values == 3 && channels == 3 && !s->albedo)
        isogi_trace__pass_segment(set, s, 3, 3, NULL, t->feedback->dark, t->feedback->pass < ISOGI_TRACE__WATCHED);
    else
        isogi_trace__pass_segment(set, s, (size_t)t->values, channels, (const float(*)[3])s->albedo, t->feedback->dark,
                                  t->feedback->pass < ISOGI_TRACE__WATCHED);
}

/* A pass over all probes has ended: whether it was the last. There is one less than reflections (what comes from sky and lights is
   there before them), or there are passes until all that later ones would add, by the ratio of the last two changes, is below 1/1000
   of every probe's own light: a spot beside a lamp, ever so bright, must not end what is reflected elsewhere (down to a millionth of it).
   The solver comes before that where light fades slowly. Only without memory for it, and where there are ever so many reflections:
   light grows by the same step for ever when 500 passes have not made the step smaller by a fifth. Steps that fall faster, as in rooms
   with a narrow way out, are a series of which MAX_DEPTH passes leave out about 1 % at most. */
static int isogi_trace__pass_end(isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__set *set = &f->probes;
    double change = 0, largest = 0, share = 0;
    size_t i;
    for (i = isogi_trace__resting_segments(f, 1); i < set->segment_count; i++) {
        if (set->segments[i].share > share) share = set->segments[i].share;
        if (set->segments[i].change > change) change = set->segments[i].change;
        if (set->segments[i].largest > largest) largest = set->segments[i].largest;
    }
    set->out = 1 - set->out;
    if (share <= 1e-6) return 1;
    if (f->pass > 2 && share < f->before && share * share < 1e-3 * (f->before - share)) return 1;
    f->before = share, f->dark = 1e-6 * largest > 1e-37 ? 1e-6 * largest : 1e-37;
    if (f->pass % 500 == 499) {
        f->diverges = t->scene.desc.bounces < 0 && f->pass > 500 && change > 0.8 * f->middle;
        f->middle = change;
        if (f->diverges || f->pass > ISOGI_TRACE__MAX_DEPTH) return 1;
    }
    return ++f->pass == (size_t)t->scene.desc.bounces; /* never for all */
}

/* ---- where light fades slowly ----

   The light x of all probes solves  x = b + R x:  b comes from sky and lights, R reflects it once. Passes bring it nearer by the share that
   is not reflected: at albedo .99 a hundred of them change little, at albedo 1 thousands, where light has to find its way out of narrow
   channels. What is left after PASSES of them is worked out by BiCGStab (van der Vorst 1992), each value by itself: a round of two
   reflections and two steps, one along `way`, one along what is then the rest. In double: with float vectors it does not get there.
   Where albedo 1 meets a closed cavity with a light inside no x solves that: light grows beyond what MAX_DEPTH reflections could bring, or
   the rest stays; then that of the last pass is kept. */
enum {
    ISOGI_TRACE__SOLVE_REST = 0, /* rest = shadow = b - (x - R x) */
    ISOGI_TRACE__SOLVE_WAY,      /* way = rest + turn (way - across image) */
    ISOGI_TRACE__SOLVE_IMAGE,    /* image = way - R way */
    ISOGI_TRACE__SOLVE_HALF,     /* rest = rest - along image */
    ISOGI_TRACE__SOLVE_SECOND,   /* second = rest - R rest */
    ISOGI_TRACE__SOLVE_STEP,     /* x = x + along way + across rest, rest = rest - across second */
    ISOGI_TRACE__SUMS = 4        /* two products of vectors (REST: the largest b in place of the second), the largest rest and x */
};

/* Its tasks: a chunk of probes each, so that sums are the same whatever the batches were. */
static size_t isogi_trace__solve_tasks(const isogi_trace__feedback *f) {
    return (f->probes.count + ISOGI_TRACE__CHUNK - 1) / ISOGI_TRACE__CHUNK;
}

/* Where its arrays lie, behind it in one block of memory; bytes. */
static size_t isogi_trace__solver_set(const isogi_trace *t, isogi_trace__solver *s, uint8_t *block) {
    const size_t n = t->feedback->probes.count, each = (size_t)t->values * sizeof(double);
    size_t used = 0;
    isogi_trace__part(block, &used, 1, sizeof *s);
    s->rows = (isogi_trace__row *)isogi_trace__part(block, &used, n, sizeof *s->rows);
    s->light = (double *)isogi_trace__part(block, &used, n, each), s->rest = (double *)isogi_trace__part(block, &used, n, each);
    s->shadow = (double *)isogi_trace__part(block, &used, n, each), s->way = (double *)isogi_trace__part(block, &used, n, each);
    s->image = (double *)isogi_trace__part(block, &used, n, each), s->second = (double *)isogi_trace__part(block, &used, n, each);
    s->sums = (double *)isogi_trace__part(block, &used, isogi_trace__solve_tasks(t->feedback) * ISOGI_TRACE__SUMS, each);
    return used;
}

/* Light of the probes, which the solver begins with, and ends with: that of those that rest stays as it is, however often it is at work. */
static void isogi_trace__solver_light(const isogi_trace *t, int ends) {
    const isogi_trace__set *set = &t->feedback->probes;
    const size_t v = (size_t)t->values;
    size_t i, a;
    for (i = ends ? isogi_trace__resting_probes(t->feedback) : 0; i < set->count; i++) {
        float *out = isogi_trace__light_at(set, i, v);
        double *light = t->feedback->solver->light + i * v;
        for (a = 0; a < v; a++)
            if (ends) out[a] = (float)light[a];
            else light[a] = (double)out[a];
    }
}

/* Without memory for it passes go on. */
static int isogi_trace__solver_new(isogi_trace *t) {
    const isogi_trace__set *set = &t->feedback->probes;
    const size_t each = sizeof(isogi_trace__row) + 8 * (size_t)t->values * sizeof(double); /* more than a probe takes */
    isogi_trace__solver none, *s;
    uint8_t *block = NULL;
    size_t bytes = 0, k, i;
    if (set->count < SIZE_MAX / 2 / each) {
        bytes = isogi_trace__solver_set(t, &none, NULL);
        block = (uint8_t *)isogi_allocate(&t->context, 1, bytes);
    }
    if (!block) return 0;
    memset(block, 0, bytes);
    s = t->feedback->solver = (isogi_trace__solver *)(void *)block;
    isogi_trace__solver_set(t, s, block), s->bytes = bytes;
    for (k = 0; k < set->segment_count; k++) {
        const isogi_trace__segment *g = &set->segments[k];
        for (i = 0; i < g->entries; i++) {
            isogi_trace__row *row = &s->rows[g->node[i]];
            row->probe = g->probe + g->begin[i], row->count = g->begin[i + 1] - g->begin[i];
            if (g->albedo) row->albedo = (const float(*)[3])(g->albedo + g->begin[i]);
        }
    }
    isogi_trace__solver_light(t, 0);
    return 1;
}

/* image = vector - R vector, of a probe. */
static void isogi_trace__solve_image(const isogi_trace *t, size_t probe, const double *vector, double *image) {
    const isogi_trace__set *set = &t->feedback->probes;
    const isogi_trace__row *row = &t->feedback->solver->rows[probe];
    const isogi_trace__reflector *own = isogi_trace__reflector_at(set, probe);
    const size_t v = (size_t)t->values;
    size_t a, k;
    if (v == 3 && !row->albedo) { /* what is asked for most */
        double sum[3] = {0, 0, 0};
        for (k = 0; k < row->count; k++)
            for (a = 0; a < 3; a++) sum[a] += vector[row->probe[k] * 3 + a];
        for (a = 0; a < 3; a++) image[a] = vector[probe * 3 + a] - (double)own->one * (double)own->albedo[a] * sum[a];
        return;
    }
    for (a = 0; a < v; a++) {
        const int c = isogi_trace__channel(t, (int)a);
        double sum = 0;
        for (k = 0; k < row->count; k++)
            sum += (double)(row->albedo ? row->albedo[k] : own->albedo)[c] * vector[row->probe[k] * v + a];
        image[a] = vector[probe * v + a] - (double)own->one * sum;
    }
}

/* One stage of one value, element begin, begin + step, ...: its sums. b: of the first. */
static void isogi_trace__solve_value(const isogi_trace__solver *s, size_t begin, size_t end, size_t step, size_t a, const float *b,
                                     double *sum) {
    const double along = s->along[a], across = s->across[a], turn = s->turn[a];
    double *light = s->light, *rest = s->rest, *shadow = s->shadow, *way = s->way, *image = s->image, *second = s->second;
    size_t k;
    switch (s->stage) {
    case ISOGI_TRACE__SOLVE_WAY:
        for (k = begin; k < end; k += step) way[k] = rest[k] + turn * (way[k] - across * image[k]);
        return;
    case ISOGI_TRACE__SOLVE_IMAGE:
        for (k = begin; k < end; k += step) sum[0] += shadow[k] * image[k];
        return;
    case ISOGI_TRACE__SOLVE_HALF:
        for (k = begin; k < end; k += step) rest[k] -= along * image[k];
        return;
    case ISOGI_TRACE__SOLVE_SECOND:
        for (k = begin; k < end; k += step) sum[0] += second[k] * rest[k], sum[1] += second[k] * second[k];
        return;
    case ISOGI_TRACE__SOLVE_REST:
        for (k = begin; k < end; k += step, b += step) {
            rest[k] = shadow[k] = (double)*b - image[k];
            if (sum[1] < fabs((double)*b)) sum[1] = fabs((double)*b);
        }
        break;
    default:
        for (k = begin; k < end; k += step) light[k] += along * way[k] + across * rest[k], rest[k] -= across * second[k];
    }
    for (k = begin; k < end; k += step) {
        sum[0] += shadow[k] * rest[k];
        if (sum[2] < fabs(rest[k])) sum[2] = fabs(rest[k]);
        if (sum[3] < fabs(light[k])) sum[3] = fabs(light[k]);
    }
}

/* One stage, for the probes of a chunk. */
static void isogi_trace__solve_task(void *arg, size_t task) {
    const isogi_trace *t = (const isogi_trace *)arg;
    const isogi_trace__set *set = &t->feedback->probes;
    const size_t number = t->feedback->carried + task, first = number * ISOGI_TRACE__CHUNK, v = (size_t)t->values, late = 8;
    const size_t end = first + ISOGI_TRACE__CHUNK < set->count ? first + ISOGI_TRACE__CHUNK : set->count;
    isogi_trace__solver *s = t->feedback->solver;
    const int second = s->stage == ISOGI_TRACE__SOLVE_SECOND;
    const double *vector = second ? s->rest : s->stage == ISOGI_TRACE__SOLVE_IMAGE ? s->way : s->light;
    double *sums = s->sums + number * v * ISOGI_TRACE__SUMS;
    size_t i, k;
    if (second || s->stage == ISOGI_TRACE__SOLVE_IMAGE || s->stage == ISOGI_TRACE__SOLVE_REST)
        for (i = first; i < end; i++) {
            if (i + late < end)
                for (k = 0; k < s->rows[i + late].count; k++) ISOGI_TRACE__AHEAD(vector + s->rows[i + late].probe[k] * v);
            isogi_trace__solve_image(t, i, vector, (second ? s->second : s->image) + i * v);
        }
    memset(sums, 0, v * ISOGI_TRACE__SUMS * sizeof *sums);
    for (k = 0; k < v; k++)
        isogi_trace__solve_value(s, first * v + k, end * v, v, k, isogi_trace__values_at(set, first, ISOGI_TRACE__BOUNCE_VALUES, v) + k,
                                 sums + k * ISOGI_TRACE__SUMS);
}

/* x / y where that means something, else 0. */
static double isogi_trace__quotient(double x, double y) {
    const double q = x / y;
    return isogi_trace__finite(q) ? q : 0;
}

/* A stage has ended for all probes: whether it was the last. */
static int isogi_trace__solve_end(isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__solver *s = f->solver;
    const size_t v = (size_t)t->values;
    int open = 0, endless = 0;
    size_t a, i;
    for (a = 0; a < v; a++) {
        double sum[ISOGI_TRACE__SUMS] = {0};
        for (i = 0; i < isogi_trace__solve_tasks(f); i++) {
            const double *part = s->sums + (i * v + a) * ISOGI_TRACE__SUMS;
            sum[0] += part[0], sum[1] = s->stage ? sum[1] + part[1] : sum[1] < part[1] ? part[1] : sum[1];
            sum[2] = sum[2] < part[2] ? part[2] : sum[2], sum[3] = sum[3] < part[3] ? part[3] : sum[3];
        }
        if (s->stage == ISOGI_TRACE__SOLVE_IMAGE) s->along[a] = isogi_trace__quotient(s->product[a], sum[0]);
        if (s->stage == ISOGI_TRACE__SOLVE_SECOND) s->across[a] = isogi_trace__quotient(sum[0], sum[1]);
        if (s->stage != ISOGI_TRACE__SOLVE_REST && s->stage != ISOGI_TRACE__SOLVE_STEP) continue;
        s->turn[a] = s->stage ? isogi_trace__quotient(sum[0] * s->along[a], s->product[a] * s->across[a]) : 0;
        s->product[a] = sum[0];
        if (s->stage == ISOGI_TRACE__SOLVE_REST) s->most[a] = sum[1];
        open |= !(sum[2] <= ISOGI_TRACE__RESIDUAL * sum[3]);
        endless |= !(sum[3] <= ISOGI_TRACE__MAX_DEPTH * s->most[a]) || !isogi_trace__finite(sum[0]); /* NaN is no maximum */
    }
    f->diverges = endless || (s->stage == ISOGI_TRACE__SOLVE_REST && open && s->round >= ISOGI_TRACE__ROUNDS);
    if (f->diverges) return 1;
    if (s->stage == ISOGI_TRACE__SOLVE_REST && !open) {
        isogi_trace__solver_light(t, 1);
        return 1;
    }
    if (s->stage < ISOGI_TRACE__SOLVE_STEP) s->stage++;
    else f->pass++, s->round++, s->stage = open && s->round < ISOGI_TRACE__ROUNDS ? ISOGI_TRACE__SOLVE_WAY : ISOGI_TRACE__SOLVE_REST;
    return 0;
}

/* ---- what a texel ends up with ---- */

/* Sums over the texels' hits: none yet, */
static void isogi_trace__clear_task(void *arg, size_t task) {
    const isogi_trace *t = (const isogi_trace *)arg;
    isogi_trace__set *set = &t->feedback->texels;
    size_t v = (size_t)t->values, i, end = isogi_trace__sweep(t, task, set->count, &i), resting = isogi_trace__resting(t->feedback);
    for (i = i > resting ? i : resting; i < end; i++) {
        memset(isogi_trace__values_at(set, i, ISOGI_TRACE__BOUNCE_VALUES, v), 0, v * sizeof(float));
        isogi_trace__node_at(set, i)->bounce_square = 0;
    }
}

/* and those of a segment. */
static void isogi_trace__bounce_task(void *arg, size_t task) {
    const isogi_trace *t = (const isogi_trace *)arg;
    const isogi_trace__segment *s = &t->feedback->texels.segments[t->feedback->segment];
    const isogi_trace__set *probes = &t->feedback->probes, *texels = &t->feedback->texels;
    size_t i, end = isogi_trace__sweep(t, task, s->entries, &i), v = (size_t)t->values, k;
    for (; i < end; i++) {
        isogi_trace__node *n = isogi_trace__node_at(texels, s->node[i]);
        float *bounce = isogi_trace__values_at(texels, s->node[i], ISOGI_TRACE__BOUNCE_VALUES, v);
        float own[3] = {n->albedo[0], n->albedo[1], n->albedo[2]};
        int a;
        isogi_trace__albedo_channels(&t->scene.desc, own);
        for (k = s->begin[i]; k < s->begin[i + 1]; k++) {
            const float *e = isogi_trace__light_at(probes, s->probe[k], v), *albedo = s->albedo ? s->albedo[k] : own;
            double rgb[3], luminance;
            for (a = 0; a < t->values; a++) bounce[a] += (float)((double)albedo[isogi_trace__channel(t, a)] * (double)e[a]);
            for (a = 0; a < 3; a++)
                rgb[a] = (double)albedo[a] * (double)e[isogi_trace__first_value(t, a)] / ISOGI_TRACE__PI;
            luminance = isogi_trace__luminance(rgb);
            n->bounce_square += luminance * luminance;
        }
    }
}

/* Variance of a mean of n samples out of their sum and their sum of squares. */
static double isogi_trace__mean_variance(double sum, double square, double n) {
    double spread = square - sum * sum / n;
    return n > 1 && spread > 0 ? spread / (n * (n - 1)) : 0;
}

/* What stays the same for all levels: other colours begin with other nodes. Colours by place are those at the texel: which of its own
   its rays will meet is not known. */
static void isogi_trace__guide_begin(const isogi_trace *t, const isogi_trace__node *n, isogi_trace__guide *g) {
    const isogi_trace_desc *d = &t->scene.desc;
    double point[3], slope[3];
    size_t texel[3];
    int a;
    isogi_trace__slopes(&t->scene, &n->place, slope);
    for (a = 0; a < 3; a++) slope[a] *= t->step[a];
    memset(g, 0, sizeof *g); /* until it has samples; it may never, where a block is loaded that has its light */
    g->isovalue = n->isovalue, g->steep = isogi_trace__magnitude(slope);
    if (!isogi_trace__coloured(d)) return;
    for (a = 0; a < 3; a++) texel[a] = n->texel[a];
    isogi_trace__texel_grid(t, texel, point);
    isogi_vol_to_world(t->scene.pyramid, point, point);
    isogi_trace_material(d, n->isovalue, point, g->albedo, g->glow);
    for (a = 0; a < 3 && d->mode == ISOGI_TRACE_TRANSFER; a++) g->glow[a] = 0; /* as nodes have it */
}

/* Variance of the light that is not filtered. */
static double isogi_trace__light_variance(const isogi_trace__node *n) {
    double l = (double)n->light_samples;
    return l > 1 ? n->light_spread / (l * (l - 1)) : 0;
}

/* What the filter compares of transfer: the first four coefficients, how much light in `luminance` and from where in `mean`. Their variance
   is that of whether rays escape, of which the first one shows a fourth, and what directions leave that are well spread. Directions being
   that, noise falls faster than with the number of samples; these rules, by trial, are above it, by up to two. */
static void isogi_trace__guide_series(const isogi_trace *t, const isogi_trace__node *n, const float *direct, const float *out,
                                      isogi_trace__guide *g) {
    const double escaped = (double)direct[0], one = 0.28209479177387814; /* each of the rays that did adds that */
    const double samples = n->samples ? (double)n->samples : 1;
    double rgb[3], variance;
    int a, k, channels = t->scene.desc.transfer_channels;
    for (k = 0; k < 4 && k < t->scene.desc.order * t->scene.desc.order; k++) {
        for (a = 0; a < 3; a++) rgb[a] = (double)out[k * channels + isogi_trace__first_value(t, a)];
        if (k) g->mean[k - 1] = (float)isogi_trace__luminance(rgb);
        else g->luminance = (float)isogi_trace__luminance(rgb);
    }
    if (t->scene.desc.order < 2) g->mean[0] = g->mean[1] = g->mean[2] = 0;
    variance = ISOGI_TRACE__PI * ISOGI_TRACE__PI *
               isogi_trace__mean_variance((double)g->luminance * samples / ISOGI_TRACE__PI, escaped * one + n->bounce_square, samples);
    if (samples > 3) variance /= sqrt(samples);
    if (samples < ISOGI_TRACE__NOISE_KNOWN) variance = (double)g->luminance * (double)g->luminance / samples;
    g->variance = (float)((t->scene.desc.order < 2 ? 1 : 4) * (variance + ISOGI_TRACE__SPREAD / (samples * samples)));
    g->spread = (float)(ISOGI_TRACE__PI * ISOGI_TRACE__PI * (escaped * one + n->bounce_square) / (samples * samples));
    if (samples > ISOGI_TRACE__SPREAD_FROM) g->spread *= (float)(ISOGI_TRACE__SPREAD_FROM / samples);
}

/* Variance of the mean of what rays of the hemisphere bring, over pi squared; rgb: its sum. A ray that hits brings what glows there (where
   it is not known, as the texel itself) and what is reflected there: neither is without the other. With no_shadows it brings the sky's
   light, too: that is taken as if all of it came together (standard errors add up, Cauchy and Schwarz). */
static double isogi_trace__shared_spread(const isogi_trace *t, const isogi_trace__node *n, const isogi_trace__guide *g, const float *direct,
                                         const float *bounce, const double rgb[3]) {
    const double samples = (double)n->samples;
    double part[3], both = 0, error;
    int a;
    if (t->scene.desc.no_shadows) {
        for (a = 0; a < 3; a++) part[a] = (double)direct[a];
        error = sqrt(isogi_trace__mean_variance(isogi_trace__luminance(part), n->square, samples));
        for (a = 0; a < 3; a++) part[a] = (double)bounce[a] / ISOGI_TRACE__PI;
        error += sqrt(isogi_trace__mean_variance(isogi_trace__luminance(part), n->bounce_square, samples));
        return error * error;
    }
    for (a = 0; a < 3; a++) part[a] = (double)g->glow[a];
    if (isogi_trace__coloured(&t->scene.desc)) both = 2 * isogi_trace__luminance(part) * (samples * (double)g->reflected / ISOGI_TRACE__PI);
    return isogi_trace__mean_variance(isogi_trace__luminance(rgb), n->square + n->bounce_square + both, samples);
}

/* The part of a texel's irradiance that neighbours may share, and its variance: what comes from the sky, by both kinds of rays, and by
   reflection. Lights keep sharp shadows: they are not filtered. */
static void isogi_trace__guide_task(void *arg, size_t task) {
    isogi_trace *t = (isogi_trace *)arg;
    isogi_trace__set *set = &t->feedback->texels;
    size_t i, end = isogi_trace__sweep(t, task, set->count, &i), v = (size_t)t->values, resting = isogi_trace__resting(t->feedback);
    const double rays = isogi_trace__sky_rays(&t->scene.sky, 1), square = t->scene.square;
    for (i = i > resting ? i : resting; i < end; i++) {
        const isogi_trace__node *n = isogi_trace__node_at(set, i);
        isogi_trace__guide *g = isogi_trace__guide_at(set, i);
        const float *direct = isogi_trace__values_at(set, i, ISOGI_TRACE__DIRECT_VALUES, v),
                    *bounce = isogi_trace__values_at(set, i, ISOGI_TRACE__BOUNCE_VALUES, v);
        float *out = isogi_trace__light_at(set, i, v);
        double scale = n->samples ? 1.0 / n->samples : 0, rgb[3] = {0, 0, 0}, reflected[3], spread;
        int a;
        memcpy(g->normal, n->normal, sizeof g->normal);
        g->samples = n->samples, g->lights = (float)(isogi_trace__light_variance(n) / square);
        for (a = 0; a < t->values; a++)
            out[a] = (float)(ISOGI_TRACE__PI * scale * (double)direct[a] + scale * (double)bounce[a]);
        for (a = 0; a < 3 && t->scene.desc.mode == ISOGI_TRACE_IRRADIANCE; a++) {
            rgb[a] = (double)direct[a] + (double)bounce[a] / ISOGI_TRACE__PI;
            g->mean[a] = out[a] + (float)(ISOGI_TRACE__PI * scale * n->bright[a]);
        }
        for (a = 0; a < 3; a++) reflected[a] = scale * (double)bounce[isogi_trace__first_value(t, a)];
        g->hidden = (float)(scale * (t->scene.desc.bounces ? n->hits : n->samples)); /* hits are counted if they reflect */
        g->reflected = (float)isogi_trace__luminance(reflected);
        if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) {
            isogi_trace__guide_series(t, n, direct, out, g);
            continue;
        }
        g->luminance = (float)(ISOGI_TRACE__PI * scale * (isogi_trace__luminance(rgb) + isogi_trace__luminance(n->bright)));
        spread = isogi_trace__shared_spread(t, n, g, direct, bounce, rgb);
        if (n->samples * rays > 1) spread += n->bright_spread * scale * rays / (n->samples * rays - 1);
        g->variance = (float)(ISOGI_TRACE__PI * ISOGI_TRACE__PI * spread / square);
    }
}

/* ---- what neighbours share: the filter ---- */

/* A brick's texels and those around them, dense: number x + ROW (y + ROW z), as one vector is read along x. Arrays hold numbers everywhere,
   samples 0 where there is no texel. Isovalues count from one of them in the steepest step from texel to texel, in two floats; luminance
   in the largest one, its variance in the square of that: squares of either need not be numbers. */
typedef struct isogi_trace__dense {
    double unit; /* of luminance */
    size_t filtered; /* texels, by this task */
    int count;
    int tinted; /* colours differ by isovalue or by place */
    int series; /* light is transfer: its first coefficient is the luminance, the next three are the mean, in the same unit, */
    const float *light[ISOGI_TRACE__ROW * ISOGI_TRACE__ROW * ISOGI_TRACE__ROW]; /* and this is all of it */
    uint16_t at[ISOGI_TRACE__ROW * ISOGI_TRACE__ROW * ISOGI_TRACE__ROW], filled[ISOGI_TRACE__ROW * ISOGI_TRACE__ROW]; /* bits of x */
    const isogi_trace__guide *guide[ISOGI_TRACE__ROW * ISOGI_TRACE__ROW * ISOGI_TRACE__ROW];
    float samples[ISOGI_TRACE__DENSE], share[ISOGI_TRACE__DENSE]; /* share: 1 / samples */
    float high[ISOGI_TRACE__DENSE], low[ISOGI_TRACE__DENSE];
    float steps[ISOGI_TRACE__DENSE]; /* SHEETs per unit of isovalues */
    float normal[3][ISOGI_TRACE__DENSE], luminance[ISOGI_TRACE__DENSE];
    float guessed[ISOGI_TRACE__DENSE]; /* variance, as the filter takes it to be: that of few samples tells nothing, */
    float noise[ISOGI_TRACE__DENSE];   /* and half of what counts as noise for it */
    float mean[3][ISOGI_TRACE__DENSE], variance[ISOGI_TRACE__DENSE], lights[ISOGI_TRACE__DENSE];
    float albedo[3][ISOGI_TRACE__DENSE], glow[3][ISOGI_TRACE__DENSE], hidden[ISOGI_TRACE__DENSE], reflected[ISOGI_TRACE__DENSE];
} isogi_trace__dense;

/* What texels share with one of them. */
typedef struct isogi_trace__blend {
    double rgb[3];
    double variance, lights; /* of what is shared, of other light averaged over the same texels */
    double alike;            /* the number of samples that it is as good as; 0: nothing is shared */
    size_t start[ISOGI_TRACE__ROWS + 1]; /* rows of texels: the number of the first, */
    float weight[ISOGI_TRACE__ROWS][ISOGI_TRACE__LANES]; /* and what each counts */
    int rows;
    float series[ISOGI_TRACE__VALUES]; /* of transfer */
} isogi_trace__blend;

/* Sums of weights, by place: 1, x, y, z, xx, yy, zz, xy, xz, yz. */
enum { ISOGI_TRACE__MOMENTS = 10 };

/* Solves m x = b, m symmetric and positive definite: xx, yy, zz, xy, xz, yz. */
static void isogi_trace__solve3(const double m[6], const double b[3], double x[3]) {
    double c0 = m[1] * m[2] - m[5] * m[5], c1 = m[4] * m[5] - m[3] * m[2], c2 = m[3] * m[5] - m[4] * m[1],
           c3 = m[0] * m[2] - m[4] * m[4], c4 = m[3] * m[4] - m[0] * m[5], c5 = m[0] * m[1] - m[3] * m[3],
           scale = 1 / (m[0] * c0 + m[3] * c1 + m[4] * c2);
    x[0] = scale * (c0 * b[0] + c1 * b[1] + c2 * b[2]);
    x[1] = scale * (c1 * b[0] + c3 * b[1] + c4 * b[2]);
    x[2] = scale * (c2 * b[0] + c4 * b[1] + c5 * b[2]);
}

/* Weights of the texels around become those of a plane that is fitted to their light by least squares, read at the texel itself: local
   linear regression (Moon, Carr and Yoon 2014), with a penalty on slopes (ridge) that `own` scales. By plane[0] + plane[1] x + plane[2] y +
   plane[3] z; they then sum to 1; some may be negative. */
static void isogi_trace__fit(const double moment[ISOGI_TRACE__MOMENTS], double own, double plane[4]) {
    double total = moment[0], mean[3], square[6], slope[3];
    int a;
    for (a = 0; a < 3; a++) mean[a] = moment[1 + a] / total;
    for (a = 0; a < 3; a++) square[a] = moment[4 + a] + ISOGI_TRACE__RIDGE * own - total * mean[a] * mean[a];
    square[3] = moment[7] - total * mean[0] * mean[1];
    square[4] = moment[8] - total * mean[0] * mean[2], square[5] = moment[9] - total * mean[1] * mean[2];
    isogi_trace__solve3(square, mean, slope);
    plane[0] = 1 / total;
    for (a = 0; a < 3; a++) plane[0] += slope[a] * mean[a], plane[1 + a] = -slope[a];
}

/* Of a row, where the texel itself is the fourth. */
static const float isogi_trace__along[ISOGI_TRACE__LANES] = {-3, -2, -1, 0, 1, 2, 3, 99}, isogi_trace__nought[ISOGI_TRACE__LANES] = {0};

/* Rows within FILTER of the texel: y, z. */
static const int isogi_trace__rows[ISOGI_TRACE__ROWS][2] = {{-1, -3}, {0, -3}, {1, -3}, {-2, -2}, {-1, -2}, {0, -2}, {1, -2}, {2, -2},
    {-3, -1}, {-2, -1}, {-1, -1}, {0, -1}, {1, -1}, {2, -1}, {3, -1}, {-3, 0}, {-2, 0}, {-1, 0}, {0, 0}, {1, 0}, {2, 0}, {3, 0}, {-3,
    1}, {-2, 1}, {-1, 1}, {0, 1}, {1, 1}, {2, 1}, {3, 1}, {-2, 2}, {-1, 2}, {0, 2}, {1, 2}, {2, 2}, {-1, 3}, {0, 3}, {1, 3}};

#define ISOGI_TRACE__FLOATS(F, p) (*(const F *)(const void *)(p))

/* The blend of the texel at a number of the block. A texel's light counts for another, 0 to 1, less the farther it is, by place and by
   what lies between their isosurfaces, the more it faces another way, and the more their light differs beyond its noise (and by what
   their colours must make it differ, which no sample has to show): near exp(-those squares). Weights are kept for all rows; then they
   become those of the plane. Vectors of W floats; all sums are by lane, so that they are the same bits for all W. F: of floats. */
#define ISOGI_TRACE__DEFINE_BLEND(name, attribute, F, W, KEEP, PICK, LESS, MORE)                                                           \
    attribute static void name(const isogi_trace__dense *b, size_t centre, isogi_trace__blend *to) {                                       \
        const int reach = ISOGI_TRACE__REACH, parts = ISOGI_TRACE__LANES / W;                                                              \
        const int middle[3] = {(int)centre % ISOGI_TRACE__ROW, (int)centre / ISOGI_TRACE__ROW % ISOGI_TRACE__ROW,                          \
                               (int)centre / ISOGI_TRACE__ROW / ISOGI_TRACE__ROW};                                                         \
        float (*kept)[ISOGI_TRACE__LANES] = to->weight, sum[ISOGI_TRACE__MOMENTS][ISOGI_TRACE__LANES];                                     \
        float place[ISOGI_TRACE__ROWS + 1][2];                                                                                             \
        int rows = 0, i, l;                                                                                                                \
        size_t *start = to->start;                                                                                                         \
        double moment[ISOGI_TRACE__MOMENTS], plane[4], squares = 0;                                                                        \
        const float most = 1e4f * b->samples[centre];                                                                                      \
        F total[ISOGI_TRACE__LANES / W], m[9][ISOGI_TRACE__LANES / W];                                                                     \
        F blend[6][ISOGI_TRACE__LANES / W], least[3][ISOGI_TRACE__LANES / W], largest[3][ISOGI_TRACE__LANES / W];                          \
        to->alike = to->variance = 0;                                                                                                      \
        for (l = 0; l < parts; l++) {                                                                                                      \
            const F none = ISOGI_TRACE__FLOATS(F, isogi_trace__nought);                                                                    \
            total[l] = none, m[0][l] = none, m[1][l] = none, m[2][l] = none, m[3][l] = none, m[4][l] = none, m[5][l] = none;               \
            m[6][l] = none, m[7][l] = none, m[8][l] = none;                                                                                \
        }                                                                                                                                  \
        for (i = 0; i < ISOGI_TRACE__ROWS; i++) {                                                                                          \
            const int *x = isogi_trace__rows[i];                                                                                           \
            const size_t row = (size_t)(middle[1] + x[0] + ISOGI_TRACE__ROW * (middle[2] + x[1]));                                         \
            place[rows][0] = (float)x[0], place[rows][1] = (float)x[1];                                                                    \
            start[rows] = row * ISOGI_TRACE__ROW + (size_t)(middle[0] - reach);                                                            \
            rows += ((uint32_t)b->filled[row] >> (middle[0] - reach) & 0x7f) != 0;                                                         \
        }                                                                                                                                  \
        for (i = 0; i < rows; i++) {                                                                                                       \
            const float y = place[i][0], z = place[i][1], yz = y * y + z * z;                                                              \
            for (l = 0; l < parts; l++) {                                                                                                  \
                const size_t k = start[i] + (size_t)(l * W);                                                                               \
                const F none = ISOGI_TRACE__FLOATS(F, isogi_trace__nought), along = ISOGI_TRACE__FLOATS(F, isogi_trace__along + l * W),    \
                        square = along * along + yz, samples = ISOGI_TRACE__FLOATS(F, b->samples + k), limit = none + most,                \
                        own = none + b->steps[centre], steps = ISOGI_TRACE__FLOATS(F, b->steps + k),                                       \
                        between = ((b->high[centre] - ISOGI_TRACE__FLOATS(F, b->high + k)) +                                               \
                                   (b->low[centre] - ISOGI_TRACE__FLOATS(F, b->low + k))) *                                                \
                                  PICK(steps < own, steps, own),                                                                           \
                        facing = ISOGI_TRACE__FLOATS(F, b->normal[0] + k) * b->normal[0][centre] +                                         \
                                 ISOGI_TRACE__FLOATS(F, b->normal[1] + k) * b->normal[1][centre] +                                         \
                                 ISOGI_TRACE__FLOATS(F, b->normal[2] + k) * b->normal[2][centre],                                          \
                        differ = ISOGI_TRACE__FLOATS(F, b->luminance + k) - b->luminance[centre];                                          \
                F noise = (ISOGI_TRACE__FLOATS(F, b->guessed + k) + b->guessed[centre]) *                                                  \
                          (ISOGI_TRACE__FLOATS(F, b->noise + k) + b->noise[centre]),                                                       \
                  apart = differ * differ - noise, w;                                                                                      \
                if (b->series) {                                                                                                           \
                    int a;                                                                                                                 \
                    for (a = 0; a < 3; a++) {                                                                                              \
                        const F more = ISOGI_TRACE__FLOATS(F, b->mean[a] + k) - b->mean[a][centre];                                        \
                        apart += more * more;                                                                                              \
                    }                                                                                                                      \
                }                                                                                                                          \
                apart = KEEP(apart > 0.0f, apart);                                                                                         \
                if (b->tinted) {                                                                                                           \
                    const F reflected = ISOGI_TRACE__FLOATS(F, b->reflected + k), mine = none + b->reflected[centre];                      \
                    F glow = none, albedo = none, more;                                                                                    \
                    int a;                                                                                                                 \
                    for (a = 0; a < 3; a++) {                                                                                              \
                        const float part = a == 0 ? 0.2126f : a == 1 ? 0.7152f : 0.0722f;                                                  \
                        const F one = ISOGI_TRACE__FLOATS(F, b->albedo[a] + k), two = none + b->albedo[a][centre],                         \
                                step = ISOGI_TRACE__FLOATS(F, b->glow[a] + k) - b->glow[a][centre],                                        \
                                larger = PICK(one > two, one, two), other = PICK(one > two, two, one), tiny = none + 1e-30f;               \
                        glow += part * PICK(step < 0.0f, -step, step);                                                                     \
                        albedo += part * ((larger - other) / PICK(larger > tiny, larger, tiny));                                           \
                    }                                                                                                                      \
                    more = (float)ISOGI_TRACE__PI / 2 * (ISOGI_TRACE__FLOATS(F, b->hidden + k) + b->hidden[centre]) * glow +               \
                           PICK(reflected > mine, reflected, mine) * albedo;                                                               \
                    apart += (float)(4 * ISOGI_TRACE__NOISE) * more * more;                                                                \
                }                                                                                                                          \
                noise += 1e-30f;                                                                                                           \
                w = facing * facing * (8.0f * noise) /                                                                                     \
                    (noise * (8.0f + square * (float)(1.0 / ISOGI_TRACE__NEAR) + between * between) + apart);                              \
                w = KEEP((w > 0.01f) & (facing > 0.5f) & (between < 4.0f) & (between > -4.0f) & (square <= (float)ISOGI_TRACE__FILTER), w);\
                w *= w, w *= w, w *= w;                                                                                                    \
                w = KEEP(samples > 0.0f, w * PICK(samples < limit, samples, limit)); /* what the fit can solve */                          \
                *(F *)(void *)(kept[i] + l * W) = w;                                                                                       \
            }                                                                                                                              \
        }                                                                                                                                  \
        for (i = 0; i < rows; i++) {                                                                                                       \
            const float y = place[i][0], z = place[i][1];                                                                                  \
            for (l = 0; l < parts; l++) {                                                                                                  \
                const F along = ISOGI_TRACE__FLOATS(F, isogi_trace__along + l * W);                                                        \
                F w = ISOGI_TRACE__FLOATS(F, kept[i] + l * W), part = w * y;                                                               \
                total[l] += w, m[1][l] += part, m[4][l] += part * y, part = w * z;                                                         \
                m[2][l] += part, m[5][l] += part * z, m[8][l] += part * y;                                                                 \
                w *= along, m[0][l] += w, m[6][l] += w * y, m[7][l] += w * z, m[3][l] += w * along;                                        \
            }                                                                                                                              \
        }                                                                                                                                  \
        for (l = 0; l < parts; l++) {                                                                                                      \
            int a;                                                                                                                         \
            *(F *)(void *)(sum[0] + l * W) = total[l];                                                                                     \
            for (a = 0; a < 9; a++) *(F *)(void *)(sum[1 + a] + l * W) = m[a][l];                                                          \
        }                                                                                                                                  \
        isogi_trace__lanes(sum, ISOGI_TRACE__MOMENTS, moment);                                                                             \
        if (!(moment[0] > 0)) return;                                                                                                      \
        isogi_trace__fit(moment, (double)b->samples[centre], plane);                                                                       \
        for (l = 0; l < parts; l++) {                                                                                                      \
            const F none = ISOGI_TRACE__FLOATS(F, isogi_trace__nought);                                                                    \
            int a;                                                                                                                         \
            for (a = 0; a < 6; a++) blend[a][l] = none;                                                                                    \
            for (a = 0; a < 3; a++) least[a][l] = largest[a][l] = none + b->mean[a][centre];                                               \
        }                                                                                                                                  \
        for (i = 0; i < rows; i++) {                                                                                                       \
            const float y = place[i][0], z = place[i][1];                                                                                  \
            const float constant = (float)plane[0] + (float)plane[2] * y + (float)plane[3] * z, rising = (float)plane[1];                  \
            for (l = 0; l < parts; l++) {                                                                                                  \
                const size_t k = start[i] + (size_t)(l * W);                                                                               \
                const F along = ISOGI_TRACE__FLOATS(F, isogi_trace__along + l * W), none = ISOGI_TRACE__FLOATS(F, isogi_trace__nought),    \
                        before = ISOGI_TRACE__FLOATS(F, kept[i] + l * W), w = before * (constant + rising * along), ww = w * w;            \
                if (b->series) *(F *)(void *)(kept[i] + l * W) = w;                                                                        \
                blend[3][l] += ww * ISOGI_TRACE__FLOATS(F, b->share + k);                                                                  \
                blend[4][l] += ww * ISOGI_TRACE__FLOATS(F, b->variance + k), blend[5][l] += w * ISOGI_TRACE__FLOATS(F, b->lights + k);     \
                ISOGI_TRACE__BLEND_CHANNEL(F, PICK, LESS, MORE, 0)                                                                         \
                ISOGI_TRACE__BLEND_CHANNEL(F, PICK, LESS, MORE, 1)                                                                         \
                ISOGI_TRACE__BLEND_CHANNEL(F, PICK, LESS, MORE, 2)                                                                         \
            }                                                                                                                              \
        }                                                                                                                                  \
        for (l = 0; l < parts; l++) {                                                                                                      \
            int a;                                                                                                                         \
            for (a = 0; a < 6; a++) *(F *)(void *)(sum[a] + l * W) = blend[a][l];                                                          \
        }                                                                                                                                  \
        isogi_trace__lanes(sum, 6, moment);                                                                                                \
        for (l = 0; l < parts; l++) {                                                                                                      \
            int a;                                                                                                                         \
            for (a = 0; a < 3; a++)                                                                                                        \
                *(F *)(void *)(sum[a] + l * W) = least[a][l], *(F *)(void *)(sum[3 + a] + l * W) = largest[a][l];                          \
        }                                                                                                                                  \
        for (i = 0; i < 3; i++) {                                                                                                          \
            double low = (double)sum[i][0], high = (double)sum[3 + i][0];                                                                  \
            for (l = 1; l < ISOGI_TRACE__LANES; l++) {                                                                                     \
                low = (double)sum[i][l] < low ? (double)sum[i][l] : low;                                                                   \
                high = (double)sum[3 + i][l] > high ? (double)sum[3 + i][l] : high;                                                        \
            }                                                                                                                              \
            to->rgb[i] = moment[i] < low ? low : moment[i] > high ? high : moment[i];                                                      \
        }                                                                                                                                  \
        squares = moment[3], to->variance = moment[4], to->lights = moment[5] > 0 ? moment[5] : 0, to->alike = 1 / squares;                \
        to->rows = rows;                                                                                                                   \
    }

#define ISOGI_TRACE__BLEND_CHANNEL(F, PICK, LESS, MORE, a)                                         \
    {                                                                                              \
        const F light = ISOGI_TRACE__FLOATS(F, b->mean[a] + k),                                    \
                met = PICK(before > 0.0f, light, none + b->mean[a][centre]);                       \
        blend[a][l] += w * light;                                                                  \
        least[a][l] = LESS(met, least[a][l]), largest[a][l] = MORE(met, largest[a][l]);            \
    }

static void isogi_trace__lanes(float (*lane)[ISOGI_TRACE__LANES], int count, double *sum) {
    int i;
    for (i = 0; i < count; i++) {
        const float *x = lane[i];
        sum[i] = ((double)x[0] + (double)x[1]) + ((double)x[2] + (double)x[3]);
        sum[i] += ((double)x[4] + (double)x[5]) + ((double)x[6] + (double)x[7]);
    }
}

#define ISOGI_TRACE__KEEP(mask, x) ((mask) ? (x) : 0)
#define ISOGI_TRACE__PICK(mask, x, y) ((mask) ? (x) : (y))
#define ISOGI_TRACE__LESS(x, y) ((x) < (y) ? (x) : (y))
#define ISOGI_TRACE__MORE(x, y) ((x) > (y) ? (x) : (y))
ISOGI_TRACE__DEFINE_BLEND(isogi_trace__blend_plain, , float, 1, ISOGI_TRACE__KEEP, ISOGI_TRACE__PICK, ISOGI_TRACE__LESS, ISOGI_TRACE__MORE)

#ifdef ISOGI_TRACE__VECTORS
typedef float isogi_trace__f4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t isogi_trace__i4 __attribute__((vector_size(16), aligned(4), may_alias));
#define ISOGI_TRACE__KEEP_F4(mask, x) ((isogi_trace__f4)((isogi_trace__i4)(mask) & (isogi_trace__i4)(x)))
#define ISOGI_TRACE__PICK_F4(mask, x, y) \
    ((isogi_trace__f4)(((isogi_trace__i4)(mask) & (isogi_trace__i4)(x)) | (~(isogi_trace__i4)(mask) & (isogi_trace__i4)(y))))
#ifdef __SSE2__
#define ISOGI_TRACE__LESS_F4(x, y) ((isogi_trace__f4)_mm_min_ps((__m128)(x), (__m128)(y)))
#define ISOGI_TRACE__MORE_F4(x, y) ((isogi_trace__f4)_mm_max_ps((__m128)(x), (__m128)(y)))
#else
#define ISOGI_TRACE__LESS_F4(x, y) ISOGI_TRACE__PICK_F4((x) < (y), x, y)
#define ISOGI_TRACE__MORE_F4(x, y) ISOGI_TRACE__PICK_F4((x) > (y), x, y)
#endif
ISOGI_TRACE__DEFINE_BLEND(isogi_trace__blend_f4, , isogi_trace__f4, 4, ISOGI_TRACE__KEEP_F4, ISOGI_TRACE__PICK_F4, ISOGI_TRACE__LESS_F4,
                          ISOGI_TRACE__MORE_F4)
#endif

#ifdef ISOGI_TRACE__AVX2
typedef float isogi_trace__f8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef int32_t isogi_trace__i8 __attribute__((vector_size(32), aligned(4), may_alias));
#define ISOGI_TRACE__KEEP_F8(mask, x) ((isogi_trace__f8)((isogi_trace__i8)(mask) & (isogi_trace__i8)(x)))
#define ISOGI_TRACE__PICK_F8(mask, x, y) \
    ((isogi_trace__f8)(((isogi_trace__i8)(mask) & (isogi_trace__i8)(x)) | (~(isogi_trace__i8)(mask) & (isogi_trace__i8)(y))))
#define ISOGI_TRACE__LESS_F8(x, y) ((isogi_trace__f8)_mm256_min_ps((__m256)(x), (__m256)(y)))
#define ISOGI_TRACE__MORE_F8(x, y) ((isogi_trace__f8)_mm256_max_ps((__m256)(x), (__m256)(y)))
ISOGI_TRACE__DEFINE_BLEND(isogi_trace__blend_f8, ISOGI_TRACE__AVX2, isogi_trace__f8, 8, ISOGI_TRACE__KEEP_F8, ISOGI_TRACE__PICK_F8,
                          ISOGI_TRACE__LESS_F8, ISOGI_TRACE__MORE_F8)
#endif

/* By the best instruction path; all give the same bits. */
static void isogi_trace__blend_of(const isogi_trace *t, const isogi_trace__dense *b, size_t centre, isogi_trace__blend *to) {
#ifdef ISOGI_TRACE__AVX2
    if (t->wide) {
        isogi_trace__blend_f8(b, centre, to);
        return;
    }
#endif
#ifdef ISOGI_TRACE__VECTORS
    if (t->context.force_path != 1) {
        isogi_trace__blend_f4(b, centre, to);
        return;
    }
#endif
    (void)t;
    isogi_trace__blend_plain(b, centre, to);
}

/* Texels of a brick within REACH of its neighbour at -1, 0, 1 along an axis: bits. */
static uint64_t isogi_trace__within_reach(const int d[3]) {
    static const uint64_t line[3][3] = {{0xeeeeeeeeeeeeeeeeu, 0xffffffffffffffffu, 0x7777777777777777u},
                                        {0xfff0fff0fff0fff0u, 0xffffffffffffffffu, 0x0fff0fff0fff0fffu},
                                        {0xffffffffffff0000u, 0xffffffffffffffffu, 0x0000ffffffffffffu}};
    return line[0][d[0] + 1] & line[1][d[1] + 1] & line[2][d[2] + 1];
}

/* The guides of a brick's texels and of those around them, and where they stand. */
static void isogi_trace__block_find(const isogi_trace *t, const size_t brick[3], isogi_trace__dense *b) {
    const isogi_trace__set *set = &t->feedback->texels;
    int d[3], a;
    b->count = 0;
    memset(b->filled, 0, sizeof b->filled);
    for (d[2] = -1; d[2] <= 1; d[2]++)
        for (d[1] = -1; d[1] <= 1; d[1]++)
            for (d[0] = -1; d[0] <= 1; d[0]++) {
                const isogi_trace__brick *other;
                size_t at[3];
                uint64_t held;
                uint32_t first[3]; /* place of the brick's first texel; wraps */
                int beyond = 0;
                for (a = 0; a < 3; a++) {
                    at[a] = brick[a] + (size_t)d[a], beyond |= at[a] >= t->size[a]; /* wraps */
                    first[a] = (uint32_t)(ISOGI_TRACE__REACH + ISOGI_TRACE__SIDE * d[a]);
                }
                other = beyond ? NULL : t->bricks[at[0] + t->size[0] * (at[1] + t->size[1] * at[2])];
                if (!other || !other->node) continue;
                for (held = other->held & isogi_trace__within_reach(d); held; held &= held - 1) {
                    const uint32_t slot = isogi_trace__lowest_bit(held), node = other->node[slot], x = first[0] + slot % 4,
                                   row = first[1] + slot / 4 % 4 + ISOGI_TRACE__ROW * (first[2] + slot / 16);
                    if (!node) continue;
                    if (b->series) b->light[row * ISOGI_TRACE__ROW + x] = isogi_trace__light_at(set, node - 1, (size_t)t->values);
                    b->guide[b->count] = isogi_trace__guide_at(set, node - 1);
                    ISOGI_TRACE__AHEAD(b->guide[b->count]);
                    ISOGI_TRACE__AHEAD((const char *)b->guide[b->count] + sizeof(isogi_trace__guide) - 1);
                    b->at[b->count++] = (uint16_t)(row * ISOGI_TRACE__ROW + x);
                    b->filled[row] = (uint16_t)(b->filled[row] | 1u << x);
                }
            }
}

/* Finite: what is infinite is as good as a large number. */
static float isogi_trace__bounded(double x) { return (float)(x < 1e30 ? x : 1e30); }

/* Whether the filter goes in two rounds: the second tells light that differs from light that is noisy by what the first has found. Of few
   samples that brings nothing, and transfer tells by its bands. */
static int isogi_trace__piloted(const isogi_trace *t) {
    return t->scene.desc.mode == ISOGI_TRACE_IRRADIANCE && !t->scene.desc.unfiltered && t->scene.desc.samples >= ISOGI_TRACE__PILOT_SAMPLES;
}

/* The block around a brick. */
static void isogi_trace__block_fill(const isogi_trace *t, const size_t brick[3], isogi_trace__dense *b) {
    const isogi_trace_desc *d = &t->scene.desc;
    const int second = t->feedback->phase == ISOGI_TRACE__PUBLISH && isogi_trace__piloted(t);
    double most = 0, steepest = 0, base = 0, square;
    int i, a;
    b->series = d->mode == ISOGI_TRACE_TRANSFER;
    memset(b->samples, 0, sizeof b->samples);
    isogi_trace__block_find(t, brick, b);
    for (i = 0; i < b->count; i++) {
        const isogi_trace__guide *g = b->guide[i];
        most = fabs((double)g->luminance) > most ? fabs((double)g->luminance) : most;
        if (second) most = fabs((double)g->pilot) > most ? fabs((double)g->pilot) : most;
        steepest = g->steep > steepest ? g->steep : steepest;
    }
    most = most > 0 ? 1 / most : 1, steepest = 1 / (steepest > 1e-300 ? steepest : 1e-300);
    if (b->count) base = b->guide[0]->isovalue;
    square = most * most * t->scene.square;
    b->unit = 1 / most, b->tinted = isogi_trace__coloured(d);
    for (i = 0; i < b->count; i++) {
        const isogi_trace__guide *g = b->guide[i];
        const size_t at = b->at[i];
        const double one = g->samples ? 1.0 / g->samples : 0, iso = (g->isovalue - base) * steepest;
        const double luminance = (double)(second ? g->pilot : g->luminance) * most;
        const double variance = (double)isogi_trace__bounded((double)g->variance) * square;
        const double noise = second ? (double)g->pilot_variance * square : variance;
        b->samples[at] = (float)g->samples, b->share[at] = (float)one;
        b->high[at] = (float)isogi_trace__within_both(iso, 1e30);
        b->low[at] = (float)isogi_trace__within_both(iso - (double)b->high[at], 1e30);
        b->steps[at] = isogi_trace__bounded(1 / (ISOGI_TRACE__SHEET * (g->steep * steepest) + 1e-30));
        b->luminance[at] = (float)luminance, b->variance[at] = isogi_trace__bounded(variance);
        b->guessed[at] = isogi_trace__bounded(g->samples < ISOGI_TRACE__NOISE_KNOWN ? luminance * luminance * one : noise);
        b->noise[at] = (float)((second ? ISOGI_TRACE__NOISE_PILOT : 1) * (ISOGI_TRACE__NOISE / 2 + ISOGI_TRACE__NOISE_FEW / 2 * one));
        b->lights[at] = isogi_trace__bounded((double)g->lights);
        for (a = 0; a < 3; a++) {
            b->normal[a][at] = g->normal[a];
            b->mean[a][at] = b->series ? (float)((double)g->mean[a] * most) : g->mean[a];
        }
        if (!b->tinted) continue;
        b->hidden[at] = g->hidden, b->reflected[at] = (float)((double)g->reflected * most);
        for (a = 0; a < 3; a++) b->albedo[a][at] = g->albedo[a], b->glow[a][at] = isogi_trace__bounded((double)g->glow[a] * most);
    }
}

/* Transfer of a texel with what it shares; of that less, band by band, where it differs from what the texel has gathered itself by more
   than noise does (shrinkage, James and Stein 1961): higher bands have not been compared before. The first two bands go together. */
static void isogi_trace__blend_series(const isogi_trace *t, const isogi_trace__dense *b, size_t node, isogi_trace__blend *blend) {
    const isogi_trace__set *set = &t->feedback->texels;
    const isogi_trace__guide *g = isogi_trace__guide_at(set, node);
    const size_t v = (size_t)t->values, channels = (size_t)t->scene.desc.transfer_channels;
    const float *own = isogi_trace__light_at(set, node, v), *light[ISOGI_TRACE__ROWS * ISOGI_TRACE__LANES];
    float weight[ISOGI_TRACE__ROWS * ISOGI_TRACE__LANES];
    size_t count = 0, i, l, a, band, begin, end;
    for (i = 0; i < (size_t)blend->rows; i++)
        for (l = 0; l < ISOGI_TRACE__LANES; l++)
            if (blend->weight[i][l] < 0 || blend->weight[i][l] > 0)
                weight[count] = blend->weight[i][l], light[count++] = b->light[blend->start[i] + l];
    for (a = 0; a + ISOGI_TRACE__LANES <= v; a += ISOGI_TRACE__LANES) { /* the compiler makes vectors of them */
        float sum[ISOGI_TRACE__LANES] = {0};
        for (i = 0; i < count; i++)
            for (l = 0; l < ISOGI_TRACE__LANES; l++) sum[l] += weight[i] * light[i][a + l];
        memcpy(blend->series + a, sum, sizeof sum);
    }
    for (; a < v; a++)
        for (i = 0, blend->series[a] = 0; i < count; i++) blend->series[a] += weight[i] * light[i][a];
    for (band = t->scene.desc.order > 1, begin = 0; begin < v; band++, begin = end) {
        double apart = 0, noise = band < 2 ? (double)g->variance : (double)(2 * band + 1) * (double)g->spread, own_part;
        end = (band + 1) * (band + 1) * channels;
        for (a = begin; a < end; a++) apart += ((double)own[a] - (double)blend->series[a]) * ((double)own[a] - (double)blend->series[a]);
        apart /= (double)channels, own_part = apart > noise ? 1 - noise / apart : 0;
        for (a = begin; a < end; a++) blend->series[a] += (float)(own_part * ((double)own[a] - (double)blend->series[a]));
    }
}

/* Light and error of a texel into its brick. blend: what it shares with those around; NULL where nothing is filtered. */
static void isogi_trace__publish(isogi_trace *t, size_t i, const isogi_trace__blend *blend) {
    isogi_trace__set *set = &t->feedback->texels;
    isogi_trace__node *n = isogi_trace__node_at(set, i);
    const isogi_trace__guide *g = isogi_trace__guide_at(set, i);
    const float *reflected = isogi_trace__values_at(set, i, ISOGI_TRACE__BOUNCE_VALUES, (size_t)t->values);
    const int known = n->samples > 1 && !t->feedback->diverges;
    const double square = t->scene.square;
    double probes = 0, variance = (double)g->variance * square, lights = (double)g->lights, alike = (double)g->samples, bounce[3];
    float to[3], error;
    int a;
    if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) {
        const float *light = blend ? blend->series : isogi_trace__light_at(set, i, (size_t)t->values);
        variance = 1 / (double)n->samples;
        if (blend) variance = 1 / blend->alike + ISOGI_TRACE__BLURRED * variance;
        error = known ? (float)sqrt(variance) : ISOGI_TRACE__NOT_READY;
        isogi_trace__record_write(t, isogi_trace__record(t, n->brick, n->slot), light, error);
    } else {
        if (blend) {
            variance = blend->variance + ISOGI_TRACE__BLURRED * variance, alike = blend->alike;
            lights = lights < 1e30 ? blend->lights : lights;
        }
        for (a = 0; a < 3; a++) {
            double light = blend ? blend->rgb[a] : (double)g->mean[a];
            to[a] = (float)(light + n->steady[a] + (n->light_samples ? n->light[a] / n->light_samples : 0));
            bounce[a] = (double)reflected[a] / n->samples;
        }
        variance += isogi_trace__unseen(t->scene.possible, (double)g->luminance, alike) + lights * square;
        probes = ISOGI_TRACE__PROBE_ERROR * isogi_trace__luminance(bounce);
        error = known ? (float)sqrt(variance + probes * probes) : ISOGI_TRACE__NOT_READY;
        isogi_trace__record_write(t, isogi_trace__record(t, n->brick, n->slot), to, error);
    }
    n->error = 9 * (double)error * (double)error < 10 * probes * probes ? 0 : error; /* more samples would not lower it */
}

/* What the filter's second round compares in place of what the texel itself has gathered. */
static void isogi_trace__pilot(isogi_trace *t, size_t i, const isogi_trace__blend *blend) {
    isogi_trace__guide *g = isogi_trace__guide_at(&t->feedback->texels, i);
    g->pilot = blend ? (float)isogi_trace__luminance(blend->rgb) : g->luminance;
    g->pilot_variance = isogi_trace__bounded(blend ? blend->variance / t->scene.square : (double)g->variance);
}

/* Whether it has new light to publish. Where its error was low enough before the last sample, it stays so. */
static int isogi_trace__unpublished(const isogi_trace *t, size_t i) {
    const uint32_t samples = isogi_trace__node_at(&t->feedback->texels, i)->samples;
    const int finished = isogi_trace__stage_at(&t->feedback->texels, i)->finished;
    return samples && finished != 2 && !(finished && samples < (uint32_t)t->scene.desc.samples);
}

/* All texels of a brick, filtered. */
static void isogi_trace__publish_brick(isogi_trace *t, size_t i, isogi_trace__dense *b) {
    const isogi_trace__set *set = &t->feedback->texels;
    const isogi_trace__node *any = isogi_trace__node_at(set, i);
    const size_t first = ISOGI_TRACE__REACH * (1 + ISOGI_TRACE__ROW * (1 + ISOGI_TRACE__ROW));
    const int first_round = t->feedback->phase == ISOGI_TRACE__PILOT; /* of all that have samples: others compare with them */
    size_t brick[3];
    uint32_t slot;
    int a, filled = 0;
    for (a = 0; a < 3; a++) brick[a] = any->texel[a] / ISOGI_TRACE__SIDE;
    for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
        const uint32_t node = any->brick->node[slot];
        isogi_trace__blend blend;
        if (!node || !(first_round ? isogi_trace__node_at(set, node - 1)->samples > 0 : isogi_trace__unpublished(t, node - 1))) continue;
        if (!filled) isogi_trace__block_fill(t, brick, b);
        filled = 1, b->filtered++;
        isogi_trace__blend_of(t, b, first + slot % 4 + ISOGI_TRACE__ROW * (slot / 4 % 4 + ISOGI_TRACE__ROW * (slot / 16)), &blend);
        if (b->series && blend.alike > 0) isogi_trace__blend_series(t, b, node - 1, &blend);
        blend.variance *= b->unit * b->unit;
        if (first_round) isogi_trace__pilot(t, node - 1, blend.alike > 0 ? &blend : NULL);
        else isogi_trace__publish(t, node - 1, blend.alike > 0 ? &blend : NULL);
    }
}

/* Whether a brick's light stays as it is: no texel that does not rest is in one of the bricks around, which the filter reads, or, where it
   goes in two rounds, in one of those around them. */
static int isogi_trace__brick_rests(const isogi_trace *t, const isogi_trace__brick *brick) {
    const size_t resting = isogi_trace__resting(t->feedback);
    const int two = t->feedback->phase == ISOGI_TRACE__PUBLISH && isogi_trace__piloted(t);
    return brick->newest <= resting && brick->around[two] <= resting;
}

/* Nodes of a sweep. Where the filter is at work, bricks at a time: each with the sweep that has the last of its nodes. */
static void isogi_trace__publish_sweep(isogi_trace *t, size_t sweep, isogi_trace__dense *block) {
    isogi_trace__set *set = &t->feedback->texels;
    size_t i, end = isogi_trace__sweep(t, sweep, set->count, &i);
    for (; i < end; i++) {
        const isogi_trace__node *n = isogi_trace__node_at(set, i);
        if (!block) {
            if (i >= isogi_trace__resting(t->feedback) && isogi_trace__unpublished(t, i)) isogi_trace__publish(t, i, NULL);
        } else if (n->brick->newest == i + 1 && !isogi_trace__brick_rests(t, n->brick)) isogi_trace__publish_brick(t, i, block);
    }
}

/* Tasks that publish: their blocks lie where rays did. */
static size_t isogi_trace__publish_tasks(const isogi_trace__feedback *f) {
    const size_t blocks = ISOGI_TRACE__CASTS * sizeof *f->casts / sizeof(isogi_trace__dense);
    return f->sweeps < blocks ? f->sweeps : blocks;
}

static void isogi_trace__publish_task(void *arg, size_t task) {
    isogi_trace *t = (isogi_trace *)arg;
    isogi_trace__dense *block = NULL;
    const size_t sweeps = t->feedback->sweeps, tasks = isogi_trace__publish_tasks(t->feedback);
    size_t i = isogi_trace__portion(sweeps, tasks, task), end = isogi_trace__portion(sweeps, tasks, task + 1);
    if (!t->scene.desc.unfiltered) {
        block = (isogi_trace__dense *)(void *)t->feedback->casts + task;
        memset(block, 0, sizeof *block); /* rays were here before */
    }
    for (; i < end; i++) isogi_trace__publish_sweep(t, i, block);
}

/* ---- the end of a level ---- */

typedef struct isogi_trace__finished {
    uint64_t samples;
    uint32_t finished, open;
} isogi_trace__finished;

/* What a task counts lies where rays did. */
static isogi_trace__finished *isogi_trace__finished_of(const isogi_trace__feedback *f, size_t task) {
    return (isogi_trace__finished *)(void *)f->casts + task;
}

/* Its light is carried over: texels that are good enough are finished, the others go on. */
static void isogi_trace__finish_task(isogi_trace *t, size_t task) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__finished sum = {0, 0, 0};
    double target = (double)t->scene.desc.error * t->scene.open_light;
    size_t i, end = isogi_trace__sweep(t, task, f->texels.count, &i);
    for (; i < end; i++) {
        isogi_trace__node *n = isogi_trace__node_at(&f->texels, i);
        isogi_trace__stage *stage = isogi_trace__stage_at(&f->texels, i);
        if (stage->finished) continue;
        if (n->samples >= (uint32_t)t->scene.desc.samples || (target > 0 && (double)n->error <= target)) {
            stage->finished = 1, n->brick->state[n->slot] = ISOGI_TRACE__DONE;
            sum.samples += n->samples, sum.finished++;
        } else sum.open++;
    }
    *isogi_trace__finished_of(f, task) = sum;
}

static void isogi_trace__finish_count(isogi_trace *t, size_t tasks) {
    isogi_trace__feedback *f = t->feedback;
    size_t i;
    for (i = 0; i < tasks; i++) {
        const isogi_trace__finished *sum = isogi_trace__finished_of(f, i);
        f->partial -= sum->samples, f->unfinished -= sum->finished, f->open += sum->open;
        t->wanted -= sum->finished, t->done += sum->finished;
    }
}

/* The last chunks and segments of a set, its share of what is left when `tasks` are. */
static void isogi_trace__set_shrink(const isogi_trace *t, isogi_trace__set *s, size_t tasks, int chunks) {
    size_t n = chunks ? (s->chunk_made + tasks - 1) / tasks : 0;
    for (; n; n--) isogi_trace__chunk_free(t, s);
    for (n = (s->segment_count + tasks - 1) / tasks; n; n--) isogi_trace__segment_free(t, &s->segments[--s->segment_count]);
}

/* Where all texels of a group are finished their nodes, and the probes, are given back. */
static void isogi_trace__forget_task(isogi_trace *t, size_t task) {
    isogi_trace__feedback *f = t->feedback;
    size_t i, end = isogi_trace__sweep(t, task, f->texels.count, &i), left = (f->texels.count - i - 1) / ISOGI_TRACE__SWEEP + 1;
    isogi_trace__set_shrink(t, &f->probes, left, 1), isogi_trace__set_shrink(t, &f->texels, left, 0);
    for (; i < end; i++) isogi_trace__brick_forget(t, isogi_trace__node_at(&f->texels, i)->brick);
}

/* The next group begins anew, so that a bake that was saved in between goes on to the same bits. */
static void isogi_trace__group_free(isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    f->probes_before += f->probes.count, f->diverged |= f->diverges;
    isogi_trace__solver_free(t);
    isogi_trace__set_free(t, &f->texels);
    isogi_trace__set_free(t, &f->probes);
    f->cursor = f->probe_cursor = f->probe_end = f->probe_counted = f->placed = f->carried = f->span_count = 0;
    f->settled = f->settled_probes = f->settled_segments[0] = f->settled_segments[1] = 0, f->stirred = 0;
    f->phase = ISOGI_TRACE__AT_REST, f->unpublished = f->making = f->level = f->bounced = f->renewed = 0, f->partial = f->unfinished = 0;
    f->probe_checked = f->probe_again = 0;
    f->probe_part = f->most = 0;
}

/* ---- carrying the light over ---- */

/* Whether bricks are filtered. */
static int isogi_trace__publishing(const isogi_trace__feedback *f) {
    return f->phase == ISOGI_TRACE__PILOT || f->phase == ISOGI_TRACE__PUBLISH;
}

/* Tasks of the phase at work. */
static size_t isogi_trace__phase_tasks(const isogi_trace__feedback *f) {
    size_t nodes = f->texels.count;
    if (f->phase == ISOGI_TRACE__PASS) return f->probes.segment_count;
    if (f->phase == ISOGI_TRACE__SOLVE) return isogi_trace__solve_tasks(f);
    if (f->phase == ISOGI_TRACE__DIRECT) nodes = f->probes.count;
    if (f->phase == ISOGI_TRACE__CLEAR && !f->bounced) nodes = 0;
    if (f->phase == ISOGI_TRACE__BOUNCE) nodes = f->segment < f->texels.segment_count ? f->texels.segments[f->segment].entries : 0;
    return (nodes + ISOGI_TRACE__SWEEP - 1) / ISOGI_TRACE__SWEEP;
}

/* Rays that take as long as one of them: one for 64 hits, for 8 nodes that are read in passing, for 2 that are filtered (of transfer for
   8 of their values, too) or given back, for 64 that rest; bricks are filtered as if none rested, see isogi_trace__carry. */
static uint64_t isogi_trace__phase_cost(const isogi_trace *t, size_t task) {
    const isogi_trace__feedback *f = t->feedback;
    const isogi_trace__segment *s = f->phase == ISOGI_TRACE__PASS ? f->probes.segments : f->texels.segments; /* NULL without hits */
    if (f->phase == ISOGI_TRACE__SOLVE) return ISOGI_TRACE__CHUNK / 4;
    if (f->phase == ISOGI_TRACE__PASS) return s[task].entries / 8 + s[task].hits / 64 + 1;
    if (f->phase == ISOGI_TRACE__BOUNCE)
        return ISOGI_TRACE__SWEEP / 8 + s[f->segment].hits * ISOGI_TRACE__SWEEP / s[f->segment].entries / 64;
    if (f->phase != ISOGI_TRACE__DIRECT && f->phase != ISOGI_TRACE__FORGET && (task + 1) * ISOGI_TRACE__SWEEP <= isogi_trace__resting(f) &&
        (!isogi_trace__publishing(f) || t->scene.desc.unfiltered))
        return ISOGI_TRACE__SWEEP / 64;
    if (isogi_trace__publishing(f) && t->scene.desc.mode == ISOGI_TRACE_TRANSFER && !t->scene.desc.unfiltered)
        return ISOGI_TRACE__SWEEP / 2 + ISOGI_TRACE__SWEEP / 8 * (uint64_t)t->values;
    return isogi_trace__publishing(f) || f->phase == ISOGI_TRACE__FORGET ? ISOGI_TRACE__SWEEP / 2 : ISOGI_TRACE__SWEEP / 8;
}

static void isogi_trace__phase_task(void *arg, size_t task) {
    switch (((const isogi_trace *)arg)->feedback->phase) {
    case ISOGI_TRACE__DIRECT: isogi_trace__direct_task(arg, task); break;
    case ISOGI_TRACE__PASS: isogi_trace__pass_task(arg, task); break;
    case ISOGI_TRACE__SOLVE: isogi_trace__solve_task(arg, task); break;
    case ISOGI_TRACE__CLEAR: isogi_trace__clear_task(arg, task); break;
    case ISOGI_TRACE__BOUNCE: isogi_trace__bounce_task(arg, task); break;
    case ISOGI_TRACE__GUIDE: isogi_trace__guide_task(arg, task); break;
    case ISOGI_TRACE__PILOT:
    case ISOGI_TRACE__PUBLISH: isogi_trace__publish_task(arg, task); break;
    case ISOGI_TRACE__FINISH: isogi_trace__finish_task((isogi_trace *)arg, task); break;
    default: isogi_trace__forget_task((isogi_trace *)arg, task);
    }
}

/* On to the next block of samples. */
static void isogi_trace__level_next(isogi_trace__feedback *f) { f->level++, f->cursor = 0, f->probe_part = 0; }

/* All tasks of the phase are done. */
static void isogi_trace__phase_end(isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    f->carried = 0;
    switch (f->phase) {
    case ISOGI_TRACE__DIRECT:
        f->phase = t->scene.desc.bounces && t->scene.desc.bounces != 1 ? ISOGI_TRACE__PASS : ISOGI_TRACE__CLEAR;
        f->pass = 1, f->before = f->middle = 0, f->dark = 1e-37, f->diverges = 0;
        f->carried = f->phase == ISOGI_TRACE__PASS ? isogi_trace__resting_segments(f, 1) : 0;
        break;
    case ISOGI_TRACE__PASS:
        if (isogi_trace__pass_end(t)) f->phase = ISOGI_TRACE__CLEAR;
        else if (f->pass == ISOGI_TRACE__PASSES && t->scene.desc.bounces < 0 && isogi_trace__solver_new(t)) f->phase = ISOGI_TRACE__SOLVE;
        else f->carried = isogi_trace__resting_segments(f, 1);
        break;
    case ISOGI_TRACE__SOLVE:
        if (isogi_trace__solve_end(t)) f->phase = ISOGI_TRACE__CLEAR, isogi_trace__solver_free(t);
        break;
    case ISOGI_TRACE__CLEAR:
        f->phase = ISOGI_TRACE__BOUNCE, f->segment = isogi_trace__resting_segments(f, 0), f->bounced = 1;
        break;
    case ISOGI_TRACE__BOUNCE:
        if (++f->segment >= f->texels.segment_count) f->phase = ISOGI_TRACE__GUIDE;
        break;
    case ISOGI_TRACE__GUIDE: f->phase = isogi_trace__piloted(t) ? ISOGI_TRACE__PILOT : ISOGI_TRACE__PUBLISH; break;
    case ISOGI_TRACE__PILOT: f->phase = ISOGI_TRACE__PUBLISH; break;
    case ISOGI_TRACE__PUBLISH: f->phase = ISOGI_TRACE__FINISH, f->open = 0; break;
    case ISOGI_TRACE__FINISH:
        f->phase = f->open || t->scene.desc.lazy ? ISOGI_TRACE__AT_REST : ISOGI_TRACE__FORGET;
        isogi_trace__level_next(f), f->unpublished = f->phase == ISOGI_TRACE__FORGET;
        break;
    default: isogi_trace__group_free(t);
    }
}

/* What sweeps of bricks took that are filtered, of which some rested: known when they are done. */
static uint64_t isogi_trace__filtered_cost(const isogi_trace *t) {
    const isogi_trace__feedback *f = t->feedback;
    const isogi_trace__dense *blocks = (const isogi_trace__dense *)(const void *)f->casts;
    uint64_t cost = ISOGI_TRACE__SWEEP / 64 * (uint64_t)f->sweeps, filtered = 0;
    size_t i;
    for (i = 0; i < isogi_trace__publish_tasks(f); i++) filtered += blocks[i].filtered;
    return cost + filtered / 2 + (t->scene.desc.mode == ISOGI_TRACE_TRANSFER ? filtered / 8 * (uint64_t)t->values : 0);
}

/* The next tasks of the phase at work, about as long as `limit` rays or, where bricks may rest, shorter; at least one. Returns what they
   count as. */
static uint64_t isogi_trace__carry(isogi_trace *t, uint64_t limit) {
    isogi_trace__feedback *f = t->feedback;
    const size_t counts = ISOGI_TRACE__CASTS * sizeof *f->casts / sizeof(isogi_trace__finished); /* that lie where rays did */
    size_t tasks = isogi_trace__phase_tasks(f), count = 0, i;
    uint64_t cost = 0;
    isogi_context silent = t->context;
    silent.progress = NULL;
    if (f->phase == ISOGI_TRACE__FINISH && tasks > f->carried + counts) tasks = f->carried + counts;
    while (f->carried + count < tasks && cost < limit) cost += isogi_trace__phase_cost(t, f->carried + count++);
    if (f->phase == ISOGI_TRACE__FORGET) /* memory is given back one by one */
        for (i = 0; i < count; i++) isogi_trace__phase_task(t, i);
    else if (count) {
        f->sweeps = count;
        isogi_parallel(&silent, isogi_trace__publishing(f) ? isogi_trace__publish_tasks(f) : count, isogi_trace__phase_task, t, 0, 1);
        if (isogi_trace__publishing(f) && !t->scene.desc.unfiltered && isogi_trace__resting(f)) cost = isogi_trace__filtered_cost(t);
    }
    if (f->phase == ISOGI_TRACE__FINISH) isogi_trace__finish_count(t, count);
    f->carried += count;
    if (f->carried >= isogi_trace__phase_tasks(f)) isogi_trace__phase_end(t);
    return cost;
}

/* ---- progress ---- */

/* The part of a level after its texels' rays that is done: rays of probes, passes, whose number is not known, and what is written. */
static double isogi_trace__carried(const isogi_trace__feedback *f) {
    size_t tasks = isogi_trace__phase_tasks(f);
    double done = tasks ? (double)f->carried / (double)tasks : 0;
    switch (f->phase) {
    case ISOGI_TRACE__AT_REST: return 0.4 * f->probe_part;
    case ISOGI_TRACE__DIRECT: return 0.4 + 0.05 * done;
    case ISOGI_TRACE__PASS:
    case ISOGI_TRACE__SOLVE: return 0.65 - 0.2 / (1 + 0.2 * ((double)f->pass + done));
    case ISOGI_TRACE__CLEAR: return 0.65 + 0.02 * done;
    case ISOGI_TRACE__BOUNCE: return 0.67 + 0.08 * ((double)f->segment + done) / ((double)f->texels.segment_count + 1);
    case ISOGI_TRACE__GUIDE: return 0.75 + 0.05 * done;
    case ISOGI_TRACE__PILOT: return 0.8 + 0.09 * done;
    case ISOGI_TRACE__PUBLISH: return 0.89 + 0.09 * done;
    default: return 0.98 + 0.02 * done;
    }
}

/* Work that is done for texels that are not finished, in texels. What was begun stays so: levels begin anew where a request brings more
   texels, which the others have behind them. */
static double isogi_trace__begun(const isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    double all = ISOGI_TRACE__PLACING + t->scene.desc.samples, placed, begun;
    int level;
    for (level = 0; isogi_trace__block(t, level) < (uint32_t)t->scene.desc.samples; level++) all += ISOGI_TRACE__CARRYING;
    placed = f->texels.count ? ISOGI_TRACE__PLACING * (double)f->placed / (double)f->texels.count : 0;
    begun = ((double)f->partial + (double)f->unfinished * (placed + ISOGI_TRACE__CARRYING * (f->level + isogi_trace__carried(f)))) / all;
    if (f->most < (double)t->done + begun) f->most = (double)t->done + begun;
    return f->most - (double)t->done;
}

/* What the context's progress is told: 0 to 1 for all that this texture was asked for, as a part of what is baked with it. */
static double isogi_trace__told(const isogi_trace *t) {
    double all = (double)t->wanted + (double)t->done;
    return isogi_trace__lerp(t->share[0], t->share[1], all > 0 ? ((double)t->done + isogi_trace__begun(t)) / all : 0);
}

/* ---- stepping ---- */

/* Texels' nodes: where they lie, and on which isosurface. Without a normal there is no surface: only where the voxels were changed after
   the texel was classified, which breaks the contract but must not hang. */
static void isogi_trace__place_task(void *arg, size_t task) {
    const isogi_trace__job *job = (const isogi_trace__job *)arg;
    const isogi_trace *t = job->trace;
    size_t i = task * ISOGI_TRACE__SWEEP, end = i + ISOGI_TRACE__SWEEP < job->count ? i + ISOGI_TRACE__SWEEP : job->count;
    while (i < end) {
        isogi_trace__set *set = &t->feedback->texels;
        size_t count = end - i < ISOGI_TRACE__TEXELS ? end - i : ISOGI_TRACE__TEXELS, texel[ISOGI_TRACE__TEXELS][3], k;
        isogi_trace__site site[ISOGI_TRACE__TEXELS];
        uint8_t valid[ISOGI_TRACE__TEXELS];
        int a;
        for (k = 0; k < count; k++) {
            const size_t number = job->first + i + k,
                         where = set->chunks[number / ISOGI_TRACE__CHUNK].where[number % ISOGI_TRACE__CHUNK];
            isogi_trace__node *n = isogi_trace__node_begin(t, set, number);
            n->brick = t->bricks[where / ISOGI_TRACE__TEXELS], n->slot = (uint32_t)(where % ISOGI_TRACE__TEXELS);
            isogi_trace__texel_of(t, where / ISOGI_TRACE__TEXELS, n->slot, texel[k]);
            for (a = 0; a < 3; a++) n->texel[a] = (uint32_t)texel[k][a];
        }
        isogi_trace__texel_sites(t, (const size_t(*)[3])texel, count, site, valid);
        for (k = 0; k < count; k++) {
            isogi_trace__node *n = isogi_trace__node_at(set, job->first + i + k);
            if (valid[k]) {
                n->place = site[k].place, n->isovalue = site[k].isovalue;
                memcpy(n->normal, site[k].normal, sizeof n->normal);
            }
            isogi_trace_albedo(&t->scene.desc, n->isovalue, n->albedo);
            isogi_trace__guide_begin(t, n, isogi_trace__guide_at(set, job->first + i + k));
        }
        i += count;
    }
}

/* Of the next nodes; returns the rays that take as long, about `limit`. */
static uint64_t isogi_trace__place(isogi_trace *t, uint64_t limit) {
    isogi_trace__feedback *f = t->feedback;
    size_t left = f->texels.count - f->placed;
    isogi_context silent = t->context;
    isogi_trace__job fresh;
    fresh.trace = t, fresh.first = f->placed, fresh.count = left / 2 <= limit ? left : (size_t)(2 * limit);
    silent.progress = NULL;
    isogi_parallel(&silent, (fresh.count + ISOGI_TRACE__SWEEP - 1) / ISOGI_TRACE__SWEEP, isogi_trace__place_task, &fresh, 0, 1);
    f->placed += fresh.count;
    return fresh.count / 2 + 1;
}

/* Tells the bricks around one of its newest node. Those that have no nodes yet need not know: theirs will be newer. */
static void isogi_trace__tell_around(isogi_trace *t, size_t index) {
    const size_t at[3] = {index % t->size[0], index / t->size[0] % t->size[1], index / t->size[0] / t->size[1]};
    size_t low[3], high[3], x, y, z;
    int a;
    for (a = 0; a < 3; a++) low[a] = at[a] > 2 ? at[a] - 2 : 0, high[a] = at[a] + 2 < t->size[a] ? at[a] + 2 : t->size[a] - 1;
    for (z = low[2]; z <= high[2]; z++)
        for (y = low[1]; y <= high[1]; y++)
            for (x = low[0]; x <= high[0]; x++) {
                isogi_trace__brick *other = t->bricks[x + t->size[0] * (y + t->size[1] * z)];
                if (!other || !other->node) continue;
                other->around[1] = t->bricks[index]->newest;
                if (x + 1 >= at[0] && x <= at[0] + 1 && y + 1 >= at[1] && y <= at[1] + 1 && z + 1 >= at[2] && z <= at[2] + 1)
                    other->around[0] = other->around[1];
            }
}

/* Numbers of nodes for the wanted texels of a brick; even: of those that are even along all axes. */
static isogi_result isogi_trace__nodes_of(isogi_trace *t, size_t index, int even) {
    isogi_trace__set *set = &t->feedback->texels;
    isogi_trace__brick *brick = t->bricks[index];
    uint64_t wanted = isogi_trace__all_to_do(brick), left = even ? wanted & 0x0000050500000505u : wanted;
    uint32_t slot;
    if (isogi_trace__brick_hold(t, brick, wanted) != ISOGI_OK) return ISOGI_NO_MEMORY;
    if (isogi_trace__set_reserve(t, set, isogi_trace__bits(wanted), 0) != ISOGI_OK) return ISOGI_NO_MEMORY;
    if (!brick->node && left) { /* given back with its nodes: not without any */
        brick->node = (uint32_t *)isogi_allocate(&t->context, ISOGI_TRACE__TEXELS, sizeof(uint32_t));
        if (!brick->node) return ISOGI_NO_MEMORY;
        memset(brick->node, 0, ISOGI_TRACE__TEXELS * sizeof(uint32_t));
        brick->around[0] = brick->around[1] = 0;
    }
    if (!left) return ISOGI_OK;
    for (; left; left &= left - 1) {
        slot = isogi_trace__lowest_bit(left);
        memset(isogi_trace__stage_at(set, set->count), 0, sizeof(isogi_trace__stage));
        set->chunks[set->count / ISOGI_TRACE__CHUNK].where[set->count % ISOGI_TRACE__CHUNK] = ISOGI_TRACE__TEXELS * index + slot;
        brick->node[slot] = brick->newest = (uint32_t)++set->count, t->feedback->unfinished++;
        if (brick->state[slot] == ISOGI_TRACE__WANTED) brick->state[slot] = ISOGI_TRACE__QUEUED;
    }
    isogi_trace__tell_around(t, index);
    return ISOGI_OK;
}

/* Whether wanted texels are to get nodes: when lazy at once, else when the group before is done; but not while light is carried over. */
static int isogi_trace__nodes_wanted(const isogi_trace *t) {
    const isogi_trace__feedback *f = t->feedback;
    if (f->phase != ISOGI_TRACE__AT_REST) return 0;
    return f->making || (t->queue_first < t->queue_count && (!f->texels.count || t->scene.desc.lazy));
}

/* Rays that take as long. */
static uint64_t isogi_trace__made_cost(size_t bricks, size_t nodes) { return bricks / 2 + nodes / 4; }

/* Whether two bricks are of one group: when lazy all are, else those of a cube, which come one after the other. */
static int isogi_trace__together(const isogi_trace *t, size_t one, size_t two) {
    const size_t side = ISOGI_TRACE_CUBE / ISOGI_TRACE__SIDE, rows = t->size[1];
    if (t->scene.desc.lazy) return 1;
    return one % t->size[0] / side == two % t->size[0] / side && one / t->size[0] % rows / side == two / t->size[0] % rows / side &&
           one / t->size[0] / rows / side == two / t->size[0] / rows / side;
}

/* Makes them: of all bricks in the queue when lazy, else of a group; every other texel along each axis first. As many as take about as
   long as `limit` rays, which are added to *spent. */
static isogi_result isogi_trace__nodes_make(isogi_trace *t, uint64_t limit, uint64_t *spent) {
    isogi_trace__feedback *f = t->feedback;
    isogi_result result = ISOGI_OK;
    size_t before = f->texels.count, bricks = 0;
    if (!f->making) {
        f->making = 1, f->made = 0, f->made_bricks = t->queue_count - t->queue_first;
        f->level = 0, f->probe_part = 0;
    }
    for (; f->making == 1 && isogi_trace__made_cost(bricks, f->texels.count - before) < limit; bricks++) {
        result = isogi_trace__nodes_of(t, t->queue[t->queue_first + f->made], 1);
        if (result != ISOGI_OK) break;
        if (++f->made < f->made_bricks && isogi_trace__together(t, t->queue[t->queue_first], t->queue[t->queue_first + f->made])) continue;
        f->making = 2;
    }
    for (; f->making == 2 && result == ISOGI_OK && isogi_trace__made_cost(bricks, f->texels.count - before) < limit; bricks++) {
        result = isogi_trace__nodes_of(t, t->queue[t->queue_first], 0);
        if (result != ISOGI_OK) break;
        t->bricks[t->queue[t->queue_first++]]->queued = 0;
        if (--f->made) continue;
        f->making = f->level = 0, f->cursor = 0;
        if (t->queue_first == t->queue_count) t->queue_first = t->queue_count = 0;
    }
    *spent += isogi_trace__made_cost(bricks, f->texels.count - before);
    return result;
}

/* To be called before there is something to do: all nodes that there are have been finished, unless a block that was loaded has what they
   were for, while their light was not yet carried over. */
static void isogi_trace__settle(const isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    if (!f || t->wanted || f->unpublished) return;
    f->settled = f->texels.count, f->settled_probes = f->probes.count;
    f->settled_segments[0] = f->texels.segment_count, f->settled_segments[1] = f->probes.segment_count;
    f->stirred = f->diverges || t->scene.desc.bounces > 1; /* they have no more reflections than those have to come */
}

/* All nodes are forgotten, also where the memory for a group's ran out half way. */
static void isogi_trace__feedback_rest(isogi_trace *t) {
    size_t i;
    for (i = 0; i < t->brick_count; i++)
        if (t->bricks[i]) isogi_trace__brick_forget(t, t->bricks[i]);
    isogi_trace__group_free(t);
}

/* Whether nobody can look at the light before the next block of samples: the step goes on to its end, and no texel may be good enough. */
static int isogi_trace__level_unseen(const isogi_trace *t, int to_the_end) {
    return to_the_end && !t->context.progress && !(t->scene.desc.error > 0) &&
           isogi_trace__block(t, t->feedback->level + 1) < (uint32_t)t->scene.desc.samples;
}

/* Traces the next batch; where nothing is left to trace at this level its light is to be carried over. to_the_end: the step has no
   other limit. A batch that is cancelled is lost, and the next one a quarter of it: who gives steps little time by cancelling them gets
   on. */
static isogi_result isogi_trace__trace_batch(isogi_trace *t, uint64_t limit, int to_the_end, uint64_t *spent) {
    isogi_trace__feedback *f = t->feedback;
    const size_t cursor = f->cursor, probe_cursor = f->probe_cursor;
    double from = isogi_trace__told(t), to, part;
    isogi_result result;
    int none = isogi_trace__spans_fill(t, f->patience && f->patience < limit ? f->patience : limit, spent);
    f->unpublished |= f->span_count != 0;
    if (none && isogi_trace__level_unseen(t, to_the_end)) isogi_trace__level_next(f);
    else if (none) f->phase = ISOGI_TRACE__DIRECT;
    if (!f->span_count) return ISOGI_OK;
    part = f->on_probes ? (double)f->probe_cursor / (double)f->probes.count : 0;
    f->probe_part = part > f->probe_part ? part : f->probe_part;
    f->partial += f->on_probes ? 0 : f->sample_count, to = isogi_trace__told(t);
    f->partial -= f->on_probes ? 0 : f->sample_count;
    result = isogi_trace__spans_run(t, from, to);
    if (result == ISOGI_CANCELLED) f->patience = f->sample_count / 4 + 1;
    else if (result == ISOGI_OK && f->patience) f->patience = f->patience < ISOGI_TRACE__SAMPLES ? f->patience + f->patience / 2 + 1 : 0;
    if (result != ISOGI_OK) /* it is still to come */
        f->cursor = cursor, f->probe_cursor = probe_cursor, f->probe_checked = f->probe_again = 0;
    return result;
}

static isogi_result isogi_trace__feedback_step(isogi_trace *t, uint64_t max_rays, uint64_t *spent) {
    isogi_trace__feedback *f = t->feedback;
    const uint64_t lights = (uint64_t)t->scene.desc.lighting.light_count,
                   each = 1 + (uint64_t)t->scene.sky.rays + isogi_trace__light_samples(&t->scene, 1, 1) * lights;
    uint64_t begin = t->counters.rays, other = 0;
    isogi_result result = ISOGI_OK;
    while (result == ISOGI_OK && (t->wanted || f->unpublished)) {
        uint64_t used = t->counters.rays - begin + other, left = max_rays ? max_rays - used : SIZE_MAX / 4;
        const uint64_t piece = left < ISOGI_TRACE__PIECE || !t->context.progress ? left : ISOGI_TRACE__PIECE;
        int silent = f->phase != ISOGI_TRACE__AT_REST || f->placed < f->texels.count;
        if (max_rays && used >= max_rays) break;
        if (isogi_trace__nodes_wanted(t)) result = isogi_trace__nodes_make(t, left, &other);
        else if (f->placed < f->texels.count) other += isogi_trace__place(t, piece);
        else if (f->phase == ISOGI_TRACE__AT_REST)
            result = isogi_trace__trace_batch(t, max_rays ? (left - 1) / each + 1 : UINT64_MAX, !max_rays, &other);
        else other += isogi_trace__carry(t, piece);
        if (silent && result == ISOGI_OK && t->context.progress && t->context.progress(t->context.user, isogi_trace__told(t)))
            result = ISOGI_CANCELLED;
    }
    *spent += t->counters.rays - begin + other;
    return result;
}

/* ==== stepping ======================================================================================================= */

/* Adds to *spent what has been done of the budget: rays, and other work in as many rays as take so long. */
static isogi_result isogi_trace__step_side(isogi_trace *trace, uint64_t max_rays, uint64_t *spent) {
    isogi_result result = ISOGI_OK;
    uint64_t begin = trace->counters.rays;
    if (trace->feedback) return isogi_trace__feedback_step(trace, max_rays, spent);
    while (trace->wanted && result == ISOGI_OK) {
        uint64_t used = trace->counters.rays - begin, each = (uint64_t)trace->scene.desc.samples * 2,
                 limit = ISOGI_TRACE__BATCH;
        size_t count;
        if (max_rays && used >= max_rays) break;
        if (trace->counters.texels) each = trace->counters.rays / trace->counters.texels + 1;
        if (max_rays && (max_rays - used) / each < limit) limit = (max_rays - used) / each;
        result = isogi_trace__fill_batch(trace, limit ? (size_t)limit : 1, &count);
        if (result == ISOGI_OK) result = isogi_trace__bake_batch(trace, count);
        isogi_trace__queue_advance(trace);
    }
    *spent += trace->counters.rays - begin;
    return result;
}

/* Light at the eight corners of a coarse cell, and the largest of its errors. 0: one of them has none. */
static int isogi_trace__cell_light(const isogi_trace *c, const size_t cell[3],
                                   float (*light)[ISOGI_TRACE__VALUES], double *error) {
    int i, a;
    for (i = 0; i < 8; i++) {
        const isogi_trace__brick *brick;
        const uint8_t *record;
        uint32_t slot;
        size_t texel[3];
        for (a = 0; a < 3; a++) {
            texel[a] = cell[a] + (size_t)(i >> a & 1);
            if (texel[a] >= c->lattice[a]) texel[a] = c->lattice[a] - 1;
        }
        if (isogi_trace__state(c, texel) < ISOGI_TRACE__DRAFT) return 0;
        brick = c->bricks[isogi_trace__brick_of(c, texel, &slot)];
        record = isogi_trace__record(c, brick, slot);
        isogi_trace__record_read(c, record, light[i]);
        if ((double)isogi_trace__record_error(record) > *error) *error = (double)isogi_trace__record_error(record);
    }
    return 1;
}

/* Whether the light at the corners of a coarse cell differs too much to leave out what lies between them: by the norm of the difference
   of two corners' colours, or of all their coefficients. The error is of luminance, or that of a single coefficient (1 / sqrt(4 pi)). */
static int isogi_trace__cell_varies(const isogi_trace *c, const size_t cell[3], double tolerance) {
    float light[8][ISOGI_TRACE__VALUES];
    double mean[3] = {0, 0, 0}, apart = 0, size = 0, error = 0, luminance;
    int i, k, a;
    if (!isogi_trace__cell_light(c, cell, light, &error)) return 1;
    for (i = 0; i < 8; i++)
        for (k = 0; k < i; k++) {
            double square = 0;
            for (a = 0; a < c->values; a++)
                square += ((double)light[i][a] - (double)light[k][a]) * ((double)light[i][a] - (double)light[k][a]);
            apart = square > apart ? square : apart;
        }
    for (a = 0; a < c->values; a++) {
        double sum = 0;
        for (i = 0; i < 8; i++) sum += (double)light[i][a] / 8;
        size += sum * sum;
        if (a < 3) mean[a] = sum;
    }
    luminance = isogi_trace__luminance(mean), size = sqrt(size);
    if (c->scene.desc.mode == ISOGI_TRACE_TRANSFER) error *= 0.28209479177387814 * sqrt((double)c->values);
    else error = luminance > 0 ? error * size / luminance : 0;
    return sqrt(apart) > tolerance * size + 3 * error;
}

/* Wants the fine texels of a coarse cell if it varies: all that a lookup in it reads. Adds to *spent the rays that take as long. */
static isogi_result isogi_trace__refine_cell(isogi_trace *t, const size_t cell[3], uint64_t *spent) {
    const isogi_trace *c = t->coarse;
    size_t texel[3], low[3], high[3];
    isogi_result result = ISOGI_OK;
    int a;
    *spent += 1;
    if (!isogi_trace__cell_varies(c, cell, (double)t->scene.desc.hierarchy)) return ISOGI_OK;
    for (a = 0; a < 3; a++) {
        double scale = t->step[a] > 0 ? c->step[a] / t->step[a] : 0;
        low[a] = (size_t)(scale * (double)cell[a] + 1e-9);
        high[a] = (size_t)isogi_trace__clamp(ceil(scale * (double)(cell[a] + 1) - 1e-9), (double)(t->lattice[a] - 1));
    }
    if (!isogi_trace__in_range(t, low, high)) return ISOGI_OK;
    *spent += 8;
    for (texel[2] = low[2]; texel[2] <= high[2]; texel[2]++)
        for (texel[1] = low[1]; texel[1] <= high[1]; texel[1]++)
            for (texel[0] = low[0]; texel[0] <= high[0] && result == ISOGI_OK; texel[0]++)
                result = isogi_trace__want(t, texel, 0);
    return result;
}

/* The next coarse cells, about as long as `limit` rays (0: all). */
static isogi_result isogi_trace__refine(isogi_trace *t, uint64_t limit, uint64_t *spent) {
    const isogi_trace *c = t->coarse;
    size_t cell[3], count[3];
    uint64_t cost = 0;
    isogi_result result = ISOGI_OK;
    int a;
    for (a = 0; a < 3; a++) count[a] = c->lattice[a] > 1 ? c->lattice[a] - 1 : 1;
    while (t->refine_next < count[0] * count[1] * count[2] && result == ISOGI_OK && (!limit || cost < limit)) {
        cell[0] = t->refine_next % count[0], cell[1] = t->refine_next / count[0] % count[1], cell[2] = t->refine_next / count[0] / count[1];
        result = isogi_trace__refine_cell(t, cell, &cost);
        t->refine_next += result == ISOGI_OK;
    }
    t->refined = t->refine_next == count[0] * count[1] * count[2];
    *spent += cost;
    return result;
}

/* One side, its coarse texels first. */
static isogi_result isogi_trace__step_levels(isogi_trace *trace, uint64_t max_rays, uint64_t *spent) {
    isogi_result result = ISOGI_OK;
    uint64_t used = 0;
    if (trace->coarse) {
        result = isogi_trace__step_side(trace->coarse, max_rays, &used);
        *spent += used;
        if (result != ISOGI_OK || trace->coarse->wanted || (max_rays && used >= max_rays)) return result;
        if (!trace->refined) {
            uint64_t cells = 0;
            result = isogi_trace__refine(trace, max_rays ? max_rays - used : 0, &cells);
            used += cells, *spent += cells;
        }
        if (!trace->refined) return result;
    }
    if (result != ISOGI_OK || (max_rays && used >= max_rays)) return result;
    return isogi_trace__step_side(trace, max_rays ? max_rays - used : 0, spent);
}

/* Texels to do, less the parts of them that are done, and done; what a hierarchy may want while it is not refined is taken to be eight
   for each of the coarse ones. */
static void isogi_trace__progress(const isogi_trace *t, double *wanted, double *done) {
    double left = (double)t->wanted, all = (double)t->wanted + (double)t->done;
    if (t->feedback && (t->wanted || t->feedback->unpublished)) {
        left -= isogi_trace__begun(t);
        left = left > 1e-6 ? left : 1e-6;
    }
    if (t->coarse && !t->refined) {
        double guess = fmax(left, 8 * ((double)t->coarse->wanted + (double)t->coarse->done) + 1);
        all += guess - left, left = guess;
    }
    *wanted += left, *done += all - left;
    if (t->coarse) isogi_trace__progress(t->coarse, wanted, done);
}

/* The high side has its turn with the rays that the low side leaves, or when that has none to trace. */
ISOGI_API isogi_result isogi_trace_step(isogi_trace *trace, uint64_t max_rays, double *remaining) {
    isogi_thread_pool *pool;
    isogi_result result;
    uint64_t used = 0;
    double wanted = 0, done = 0;
    if (!trace) return ISOGI_INVALID;
    pool = isogi_trace__pool_begin(trace);
    result = isogi_trace__step_levels(trace, max_rays, &used);
    if (result == ISOGI_OK && trace->high && (!max_rays || used < max_rays))
        result = isogi_trace__step_levels(trace->high, max_rays ? max_rays - used : 0, &used);
    isogi_trace__pool_end(trace, pool);
    isogi_trace__progress(trace, &wanted, &done);
    if (trace->high) isogi_trace__progress(trace->high, &wanted, &done);
    if (!remaining || result != ISOGI_OK) return result;
    *remaining = wanted > 0 ? wanted / (wanted + done) : 0;
    if (trace->coarse) trace->least = *remaining = fmin(*remaining, trace->least); /* what a hierarchy may want was a guess */
    return result;
}

/* ==== what has been achieved ========================================================================================= */

/* Error of a texel of TRANSFER under a uniform sky of radiance 1, whose square is that sky. */
static double isogi_trace__open_error(const isogi_trace *t, const float *values, double error) {
    double rgb[3], light, spread;
    int c;
    if (!isogi_trace__finite(error)) return error;
    for (c = 0; c < 3; c++) rgb[c] = 3.5449077018110318 * (double)values[t->scene.desc.transfer_channels == 1 ? 0 : c];
    light = isogi_trace__luminance(rgb);
    spread = light * (ISOGI_TRACE__PI * isogi_trace__repeats(t, light / 3.5449077018110318) - light);
    return sqrt(error * error * (spread > 0 ? spread : 0) +
                isogi_trace__unseen(ISOGI_TRACE__PI, light, error > 0 ? 1 / (error * error) : 1e9));
}

/* known: texels of known errors. */
static void isogi_trace__status_add(const isogi_trace *t, isogi_trace_report *r, uint64_t *known) {
    float values[ISOGI_TRACE__VALUES];
    size_t i;
    uint32_t slot;
    for (i = 0; i < t->brick_count; i++)
        for (slot = 0; t->bricks[i] && slot < ISOGI_TRACE__TEXELS; slot++) {
            const uint8_t *record;
            double error, rgb[3];
            int a;
            if (t->bricks[i]->state[slot] < ISOGI_TRACE__DRAFT) continue;
            record = isogi_trace__record(t, t->bricks[i], slot);
            isogi_trace__record_read(t, record, values);
            error = (double)isogi_trace__record_error(record);
            for (a = 0; a < 3; a++) rgb[a] = (double)values[a];
            r->texels++, r->drafts += t->bricks[i]->state[slot] == ISOGI_TRACE__DRAFT;
            if (t->scene.desc.mode == ISOGI_TRACE_IRRADIANCE) r->light += isogi_trace__luminance(rgb) * isogi_trace__luminance(rgb);
            else error = isogi_trace__open_error(t, values, error);
            if (error > r->worst) r->worst = error;
            if (isogi_trace__finite(error)) r->error += error * error, ++*known;
        }
    if (t->coarse) isogi_trace__status_add(t->coarse, r, known);
    if (!t->feedback) return;
    r->probes += t->feedback->probes_before + t->feedback->probes.count;
    r->diverges |= t->feedback->diverges | t->feedback->diverged;
}

ISOGI_API void isogi_trace_status(const isogi_trace *trace, isogi_trace_report *report) {
    uint64_t known = 0;
    if (!report) return;
    memset(report, 0, sizeof *report);
    if (!trace) return;
    isogi_trace__status_add(trace, report, &known);
    if (trace->high) isogi_trace__status_add(trace->high, report, &known);
    report->unit = trace->scene.open_light;
    if (!report->texels) return;
    report->light = sqrt(report->light / (double)report->texels);
    report->error = known ? sqrt(report->error / (double)known) : HUGE_VAL;
}

/* ==== export ========================================================================================================= */

typedef struct isogi_trace__export {
    const isogi_trace *trace;
    int format, transfer, values;
    size_t texels;           /* in the lattice */
    size_t component, texel; /* bytes */
    uint8_t *out, *filled;   /* filled: 0 = not yet, 1 = computed, n = by pass n - 1 */
    float scale[ISOGI_TRACE__VALUES];
    double mean[ISOGI_TRACE__VALUES];
} isogi_trace__export;

/* Calls for every texel that can be read, drafts too, in a fixed order. */
static void isogi_trace__each_texel(isogi_trace__export *e, void (*visit)(isogi_trace__export *e, size_t texel, const float *values)) {
    const isogi_trace *t = e->trace;
    float values[ISOGI_TRACE__VALUES];
    size_t i, at[3];
    uint32_t slot;
    for (i = 0; i < t->brick_count; i++) {
        const isogi_trace__brick *brick = t->bricks[i];
        for (slot = 0; brick && slot < ISOGI_TRACE__TEXELS; slot++) {
            if (brick->state[slot] < ISOGI_TRACE__DRAFT || !isogi_trace__texel_of(t, i, slot, at)) continue;
            isogi_trace__record_read(t, isogi_trace__record(t, brick, slot), values);
            visit(e, at[0] + t->lattice[0] * (at[1] + t->lattice[1] * at[2]), values);
        }
    }
}

static void isogi_trace__export_most(isogi_trace__export *e, size_t texel, const float *values) {
    int v;
    (void)texel;
    for (v = 0; v < e->values; v++) e->scale[v] = fabsf(values[v]) > e->scale[v] ? fabsf(values[v]) : e->scale[v];
}

/* Out of the largest values: BYTE has one scale for all colours, so that white stays white. */
static void isogi_trace__export_set_scales(isogi_trace__export *e) {
    float most = 0;
    int v, exponent, shift;
    memset(e->scale, 0, sizeof e->scale);
    if (e->format != ISOGI_TRACE_FLOAT) isogi_trace__each_texel(e, isogi_trace__export_most);
    for (v = 0; v < e->values; v++) most = e->scale[v] > most ? e->scale[v] : most;
    frexp((double)most, &exponent);
    shift = exponent > 15 ? exponent - 15 : exponent > 0 ? 0 : exponent > -120 ? exponent : -120; /* dim light is brought up to 0.5..1 */
    for (v = 0; v < e->values; v++) {
        if (e->format != ISOGI_TRACE_BYTE) e->scale[v] = (float)ldexp(1, shift);
        else if (!e->transfer) e->scale[v] = most;
        e->scale[v] = e->scale[v] > 0 ? e->scale[v] : 1;
    }
}

static int isogi_trace__export_begin(isogi_trace__export *e, const isogi_trace *t, int format) {
    memset(e, 0, sizeof *e);
    if (!t || t->coarse) return 0;
    e->trace = t, e->format = format ? format : t->format, e->values = t->values;
    e->transfer = t->scene.desc.mode == ISOGI_TRACE_TRANSFER;
    if (e->format < ISOGI_TRACE_FLOAT || e->format > ISOGI_TRACE_BYTE || (e->transfer && e->format == ISOGI_TRACE_RGB9E5)) return 0;
    e->component = e->format == ISOGI_TRACE_FLOAT ? 4 : e->format == ISOGI_TRACE_HALF ? 2 : 1;
    e->texel = e->format == ISOGI_TRACE_RGB9E5 ? 4 : e->component * (e->transfer ? 4 : 3);
    e->texels = t->lattice[0] * t->lattice[1] * t->lattice[2]; /* brick_count was checked */
    return e->texels <= SIZE_MAX / e->texel / (size_t)((e->values + 3) / 4);
}

static uint8_t *isogi_trace__export_at(const isogi_trace__export *e, size_t texel, int v) {
    return e->out + (size_t)(v / 4) * e->texels * e->texel + texel * e->texel + (size_t)(v % 4) * e->component;
}

static void isogi_trace__export_write(isogi_trace__export *e, size_t texel, const float *values) {
    float x[ISOGI_TRACE__VALUES];
    int v;
    for (v = 0; v < e->values; v++) x[v] = (float)((double)values[v] / (double)e->scale[v]);
    if (e->format == ISOGI_TRACE_RGB9E5) {
        uint32_t packed = isogi_trace__to_rgb9e5(x);
        memcpy(e->out + 4 * texel, &packed, 4);
        return;
    }
    for (v = 0; v < e->values; v++) {
        uint8_t *at = isogi_trace__export_at(e, texel, v);
        uint16_t half = isogi_float_to_half(x[v]);
        if (e->format == ISOGI_TRACE_FLOAT) memcpy(at, &x[v], 4);
        else if (e->format == ISOGI_TRACE_HALF) memcpy(at, &half, 2);
        else if (!e->transfer) *at = (uint8_t)(255 * isogi_trace__clamp((double)x[v], 1) + 0.5);
        else *at = (uint8_t)(int8_t)floor(127 * isogi_trace__clamp((double)x[v] + 1, 2) - 127 + 0.5);
    }
}

static void isogi_trace__export_read(const isogi_trace__export *e, size_t texel, float *values) {
    uint32_t packed;
    uint16_t half;
    int v;
    if (e->format == ISOGI_TRACE_RGB9E5) memcpy(&packed, e->out + 4 * texel, 4), isogi_trace__from_rgb9e5(packed, values);
    for (v = 0; v < e->values; v++) {
        const uint8_t *at = isogi_trace__export_at(e, texel, v);
        if (e->format == ISOGI_TRACE_FLOAT) memcpy(&values[v], at, 4);
        else if (e->format == ISOGI_TRACE_HALF) memcpy(&half, at, 2), values[v] = isogi_half_to_float(half);
        else if (e->format == ISOGI_TRACE_BYTE) values[v] = e->transfer ? (float)(*at < 128 ? *at : *at - 256) / 127 : (float)*at / 255;
        values[v] *= e->scale[v];
    }
}

static void isogi_trace__export_computed(isogi_trace__export *e, size_t texel, const float *values) {
    int v;
    isogi_trace__export_write(e, texel, values);
    e->filled[texel] = 1;
    for (v = 0; v < e->values; v++) e->mean[v] += (double)values[v];
}

/* Mean of the neighbours that were filled before this pass, by 1 / distance^2. 0: there are none. */
static int isogi_trace__export_around(const isogi_trace__export *e, const size_t at[3], int pass, float *values) {
    const size_t *size = e->trace->lattice;
    double sum[ISOGI_TRACE__VALUES], total = 0;
    int i, v;
    for (i = 0; i < 27; i++) {
        int d[3], outside = 0, a;
        size_t texel;
        double w;
        d[0] = i % 3 - 1, d[1] = i / 3 % 3 - 1, d[2] = i / 9 - 1;
        for (a = 0; a < 3; a++) outside |= (d[a] < 0 && !at[a]) || (d[a] > 0 && at[a] + 1 >= size[a]);
        if (outside || i == 13) continue;
        texel = at[0] + (size_t)(d[0] + 1) - 1 + size[0] * (at[1] + (size_t)(d[1] + 1) - 1 + size[1] * (at[2] + (size_t)(d[2] + 1) - 1));
        if (!e->filled[texel] || e->filled[texel] > pass) continue;
        if (!(total > 0)) memset(sum, 0, sizeof sum);
        w = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), total += w;
        isogi_trace__export_read(e, texel, values);
        for (v = 0; v < e->values; v++) sum[v] += w * (double)values[v];
    }
    for (v = 0; v < e->values && total > 0; v++) values[v] = (float)(sum[v] / total);
    return total > 0;
}

#define ISOGI_TRACE__APART 16
/* Whether the texels from `at` on, ISOGI_TRACE__APART along x, have nothing filled among them and their neighbours. */
static int isogi_trace__export_alone(const isogi_trace__export *e, const size_t at[3]) {
    static const uint8_t none[ISOGI_TRACE__APART + 2] = {0};
    const size_t *size = e->trace->lattice;
    size_t low[3], end[3], y, z;
    int a;
    for (a = 0; a < 3; a++) {
        low[a] = at[a] ? at[a] - 1 : 0, end[a] = at[a] + (a ? 2 : ISOGI_TRACE__APART + 1);
        end[a] = end[a] < size[a] ? end[a] : size[a];
    }
    for (z = low[2]; z < end[2]; z++)
        for (y = low[1]; y < end[1]; y++)
            if (memcmp(e->filled + low[0] + size[0] * (y + size[1] * z), none, end[0] - low[0])) return 0;
    return 1;
}

/* Three passes outwards, then the mean of all. */
static void isogi_trace__export_fill(isogi_trace__export *e) {
    const size_t *size = e->trace->lattice;
    float values[ISOGI_TRACE__VALUES];
    size_t at[3], texel, computed = 0;
    int pass, v;
    for (texel = 0; texel < e->texels; texel++) computed += e->filled[texel];
    for (pass = 1; pass <= 3 && computed; pass++)
        for (texel = 0, at[2] = 0; at[2] < size[2]; at[2]++)
            for (at[1] = 0; at[1] < size[1]; at[1]++)
                for (at[0] = 0; at[0] < size[0]; at[0]++, texel++) {
                    if (at[0] % ISOGI_TRACE__APART == 0 && isogi_trace__export_alone(e, at)) {
                        v = ISOGI_TRACE__APART - 1, texel += (size_t)v, at[0] += (size_t)v;
                        if (at[0] >= size[0]) texel -= at[0] - (size[0] - 1);
                        continue;
                    }
                    if (e->filled[texel] || !isogi_trace__export_around(e, at, pass, values)) continue;
                    isogi_trace__export_write(e, texel, values);
                    e->filled[texel] = (uint8_t)(pass + 1);
                }
    for (v = 0; v < e->values; v++) values[v] = computed ? (float)(e->mean[v] / (double)computed) : 0;
    for (texel = 0; texel < e->texels; texel++)
        if (!e->filled[texel]) isogi_trace__export_write(e, texel, values);
}
#undef ISOGI_TRACE__APART

ISOGI_API size_t isogi_trace_export_size(const isogi_trace *trace, int format) {
    isogi_trace__export e;
    if (!isogi_trace__export_begin(&e, trace, format)) return 0;
    return e.texels * e.texel * (size_t)((e.values + 3) / 4);
}

ISOGI_API isogi_result isogi_trace_export(const isogi_trace *trace, int format, void *texels, size_t bytes) {
    isogi_trace__export e;
    if (!isogi_trace__export_begin(&e, trace, format) || !texels || bytes < isogi_trace_export_size(trace, format)) return ISOGI_INVALID;
    e.filled = (uint8_t *)isogi_allocate(&trace->context, e.texels, 1);
    if (!e.filled) return ISOGI_NO_MEMORY;
    memset(e.filled, 0, e.texels);
    e.out = (uint8_t *)texels;
    memset(texels, 0, isogi_trace_export_size(trace, format));
    isogi_trace__export_set_scales(&e);
    isogi_trace__each_texel(&e, isogi_trace__export_computed);
    isogi_trace__export_fill(&e);
    isogi_release(&trace->context, e.filled, e.texels, 1);
    return ISOGI_OK;
}

ISOGI_API isogi_result isogi_trace_export_scales(const isogi_trace *trace, int format, float *scales) {
    isogi_trace__export e;
    if (!isogi_trace__export_begin(&e, trace, format) || !scales) return ISOGI_INVALID;
    isogi_trace__export_set_scales(&e);
    memcpy(scales, e.scale, (size_t)e.values * sizeof *scales);
    return ISOGI_OK;
}

/* ==== save and load ================================================================================================== */

/* Header: "isogi tr", version and bytes of a record (4 each), description's hash, lattice, number of bricks (8 each). Bricks, ascending:
   number, mask of its texels (8 each), their records. Then the hash of all that. Integers are little-endian. With BOTH_SIDES the
   block of the low side is followed by that of the high side. */
#define ISOGI_TRACE__VERSION 1
#define ISOGI_TRACE__HEADER 56

/* FNV-1a. */
static uint64_t isogi_trace__hash(uint64_t hash, const uint8_t *bytes, size_t count) {
    size_t i;
    for (i = 0; i < count; i++) hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

static uint64_t isogi_trace__hash_number(uint64_t hash, uint64_t x) {
    uint8_t bytes[8];
    isogi_trace__put(bytes, x, 8);
    return isogi_trace__hash(hash, bytes, 8);
}

static uint64_t isogi_trace__hash_floats(uint64_t hash, const float *x, size_t count) {
    uint8_t bytes[4];
    size_t i;
    for (i = 0; i < count; i++) {
        isogi_trace__put(bytes, isogi_trace__float_bits(x[i]), 4);
        hash = isogi_trace__hash(hash, bytes, 4);
    }
    return hash;
}

static uint64_t isogi_trace__hash_doubles(uint64_t hash, const double *x, size_t count) {
    uint64_t bits;
    size_t i;
    for (i = 0; i < count; i++) memcpy(&bits, &x[i], 8), hash = isogi_trace__hash_number(hash, bits);
    return hash;
}

static uint64_t isogi_trace__hash_table(uint64_t hash, const isogi_albedo_point *p, size_t count) {
    size_t i;
    hash = isogi_trace__hash_number(hash, count);
    for (i = 0; i < count; i++) hash = isogi_trace__hash_floats(isogi_trace__hash_doubles(hash, &p[i].value, 1), p[i].rgb, 3);
    return hash;
}

static uint64_t isogi_trace__hash_lighting(uint64_t hash, const isogi_lighting *l) {
    size_t i;
    hash = isogi_trace__hash_number(isogi_trace__hash_number(hash, (uint64_t)l->env.width), (uint64_t)l->env.height);
    if (l->env.rgb) hash = isogi_trace__hash_floats(hash, l->env.rgb, 3 * (size_t)l->env.width * (size_t)l->env.height);
    hash = isogi_trace__hash_number(hash, (uint64_t)l->env.sh_order);
    if (l->env.sh) hash = isogi_trace__hash_floats(hash, l->env.sh, 3 * ISOGI_SH_COUNT((size_t)l->env.sh_order));
    hash = isogi_trace__hash_number(isogi_trace__hash_floats(hash, l->env.rotation, 9), l->light_count);
    for (i = 0; i < l->light_count; i++) {
        const isogi_light *light = &l->lights[i];
        hash = isogi_trace__hash_number(hash, (uint64_t)light->kind);
        hash = isogi_trace__hash_floats(isogi_trace__hash_floats(hash, light->vector, 3), light->rgb, 3);
        hash = isogi_trace__hash_floats(isogi_trace__hash_floats(hash, &light->radius, 1), light->edge[0], 6);
    }
    return hash;
}

static uint64_t isogi_trace__hash_volume(uint64_t hash, const isogi_pyramid *pyramid) {
    const isogi_volume *v = isogi_vol_volume(pyramid);
    isogi_level level = isogi_vol_level(pyramid, 0);
    int a;
    for (a = 0; a < 2 && level.size[0] * level.size[1] * level.size[2] > (size_t)1 << 20; a++) level = isogi_vol_level(pyramid, a + 1);
    for (a = 0; a < 3; a++) hash = isogi_trace__hash_number(hash, v->size[a]);
    hash = isogi_trace__hash_number(hash, (uint64_t)v->type);
    hash = isogi_trace__hash_doubles(isogi_trace__hash_doubles(hash, v->spacing, 3), v->origin, 3);
    hash = isogi_trace__hash_doubles(isogi_trace__hash_doubles(hash, v->axes, 9), &v->scale, 1);
    hash = isogi_trace__hash_doubles(hash, &v->bias, 1);
    for (a = 0; a < 3; a++) /* of a part of a volume: where it is, and what it knows beyond its border */
        if (v->first[a] || v->halo_low[a] || v->halo_high[a])
            hash = isogi_trace__hash_number(
                isogi_trace__hash_number(isogi_trace__hash_number(hash + (uint64_t)a, v->first[a]), v->halo_low[a]), v->halo_high[a]);
    if (!level.cells) return hash;
    return isogi_trace__hash_floats(hash, level.range[0], 2 * level.size[0] * level.size[1] * level.size[2]);
}

/* Everything that a texel's light depends on. Lighting is left out for TRANSFER. */
static uint64_t isogi_trace__hash_trace(const isogi_trace *t) {
    const isogi_trace_desc *d = &t->scene.desc;
    const int transfer = d->mode == ISOGI_TRACE_TRANSFER;
    const int numbers[13] = {(int)d->mode, transfer ? d->order : 0, d->bounces, d->samples, (int)d->normals, d->capped != 0,
                             t->scene.high, !!d->no_shadows, transfer ? d->transfer_channels : 0, t->format, d->material != 0,
                             t->values, (int)d->method};
    uint64_t hash = 0xcbf29ce484222325u;
    int i;
    for (i = 0; i < 13; i++) hash = isogi_trace__hash_number(hash, (uint64_t)(int64_t)numbers[i]);
    hash = isogi_trace__hash_number(hash, d->seed);
    hash = isogi_trace__hash_floats(isogi_trace__hash_floats(isogi_trace__hash_floats(hash, d->albedo, 3), &d->offset, 1), &d->reach, 1);
    if (d->method == ISOGI_TRACE_FEEDBACK) hash = isogi_trace__hash_floats(hash, &d->error, 1);
    if (d->method == ISOGI_TRACE_FEEDBACK && d->unfiltered) hash = isogi_trace__hash_number(hash, 1);
    hash = isogi_trace__hash_number(isogi_trace__hash_number(hash, t->colours_hash), t->lighting_hash);
    hash =
        isogi_trace__hash_doubles(isogi_trace__hash_doubles(isogi_trace__hash_doubles(hash, t->first, 3), t->last, 3), &t->scene.unit, 1);
    return isogi_trace__hash_volume(hash, t->scene.pyramid);
}

/* Texels' nodes before this one are saved. A group of full feedback, and what a lazy texture was asked for while it had nothing to do, is
   saved as a whole: what is left of it would be gathered with other probes. */
static size_t isogi_trace__settled_nodes(const isogi_trace *t) {
    const isogi_trace__feedback *f = t->feedback;
    if (!f || f->phase == ISOGI_TRACE__FORGET || (t->scene.desc.lazy && !t->wanted)) return SIZE_MAX;
    return t->scene.desc.lazy ? f->settled : 0;
}

/* Texels to be saved: those that are done, but for nodes that are not settled, unless their light was loaded. */
static uint64_t isogi_trace__done_texels(const isogi_trace *t, const isogi_trace__brick *brick) {
    const size_t settled = isogi_trace__settled_nodes(t);
    uint64_t done = 0;
    uint32_t slot;
    for (slot = 0; brick && slot < ISOGI_TRACE__TEXELS; slot++) {
        const size_t node = brick->node ? brick->node[slot] : 0;
        if (brick->state[slot] != ISOGI_TRACE__DONE) continue;
        done |= (uint64_t)(node <= settled || isogi_trace__stage_at(&t->feedback->texels, node - 1)->finished == 2) << slot;
    }
    return done;
}

static size_t isogi_trace__side_size(const isogi_trace *t, size_t *bricks) {
    size_t i, bytes = ISOGI_TRACE__HEADER + 8;
    *bricks = 0;
    for (i = 0; i < t->brick_count; i++) {
        size_t texels = isogi_trace__bits(isogi_trace__done_texels(t, t->bricks[i]));
        if (texels) bytes += 16 + texels * t->record, ++*bricks;
    }
    return bytes;
}

ISOGI_API size_t isogi_trace_save_size(const isogi_trace *trace) {
    size_t bricks;
    return trace && !trace->coarse ? isogi_trace__side_size(trace, &bricks) + isogi_trace_save_size(trace->high) : 0;
}

ISOGI_API isogi_result isogi_trace_save(const isogi_trace *trace, void *block, size_t bytes) {
    uint8_t *begin = (uint8_t *)block, *to;
    size_t i, bricks, size;
    uint32_t slot;
    int a;
    if (!trace || trace->coarse || !block || bytes < isogi_trace_save_size(trace)) return ISOGI_INVALID;
    size = isogi_trace__side_size(trace, &bricks);
    memcpy(begin, "isogi tr", 8);
    isogi_trace__put(begin + 8, ISOGI_TRACE__VERSION, 4), isogi_trace__put(begin + 12, trace->record, 4);
    isogi_trace__put(begin + 16, isogi_trace__hash_trace(trace), 8);
    for (a = 0; a < 3; a++) isogi_trace__put(begin + 24 + 8 * a, trace->lattice[a], 8);
    isogi_trace__put(begin + 48, bricks, 8);
    to = begin + ISOGI_TRACE__HEADER;
    for (i = 0; i < trace->brick_count; i++) {
        uint64_t done = isogi_trace__done_texels(trace, trace->bricks[i]);
        if (!done) continue;
        isogi_trace__put(to, i, 8), isogi_trace__put(to + 8, done, 8), to += 16;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++)
            if (done >> slot & 1) memcpy(to, isogi_trace__record(trace, trace->bricks[i], slot), trace->record), to += trace->record;
    }
    isogi_trace__put(to, isogi_trace__hash(0xcbf29ce484222325u, begin, size - 8), 8);
    return trace->high ? isogi_trace_save(trace->high, begin + size, bytes - size) : ISOGI_OK;
}

/* Whether a record can be what was written: finite numbers, an error that is no NaN. */
static int isogi_trace__record_ok(const isogi_trace *t, const uint8_t *record) {
    int i;
    if (isogi_trace__get(record, 2) > 0x7f80u) return 0;
    if (t->format == ISOGI_TRACE_FLOAT)
        for (i = 0; i < t->values; i++)
            if ((isogi_trace__get(record + 2 + 4 * i, 4) & 0x7f800000u) == 0x7f800000u) return 0;
    if (t->format == ISOGI_TRACE_HALF)
        for (i = 0; i < t->values; i++)
            if ((isogi_trace__get(record + 2 + 2 * i, 2) & 0x7c00u) == 0x7c00u) return 0;
    return t->format != ISOGI_TRACE_BYTE || t->scene.desc.mode != ISOGI_TRACE_TRANSFER || isogi_trace__get(record + 2, 2) < 0x7f80u;
}

/* One side's block from its first byte: checks all of it; *used: its bytes. */
static isogi_result isogi_trace__block_check(const isogi_trace *t, const uint8_t *block, size_t bytes, size_t *used) {
    uint64_t bricks, k, before = 0;
    size_t at = ISOGI_TRACE__HEADER, texel[3];
    uint32_t slot;
    int a;
    if (bytes < ISOGI_TRACE__HEADER + 8 || memcmp(block, "isogi tr", 8) || isogi_trace__get(block + 8, 4) != ISOGI_TRACE__VERSION)
        return ISOGI_CORRUPT;
    bricks = isogi_trace__get(block + 48, 8);
    for (k = 0; k < bricks; k++) { /* first the sizes alone, so that the hash can be found: another description has other records */
        uint64_t texels, record = isogi_trace__get(block + 12, 4);
        if (bytes - at < 16 + 8) return ISOGI_CORRUPT;
        texels = isogi_trace__bits(isogi_trace__get(block + at + 8, 8));
        at += 16;
        if (record > 4 * ISOGI_TRACE__VALUES + 4 || bytes - at < texels * record + 8) return ISOGI_CORRUPT;
        at += (size_t)(texels * record);
    }
    if (isogi_trace__get(block + at, 8) != isogi_trace__hash(0xcbf29ce484222325u, block, at)) return ISOGI_CORRUPT;
    if (isogi_trace__get(block + 16, 8) != isogi_trace__hash_trace(t) || isogi_trace__get(block + 12, 4) != t->record) return ISOGI_INVALID;
    for (a = 0; a < 3; a++)
        if (isogi_trace__get(block + 24 + 8 * a, 8) != t->lattice[a]) return ISOGI_INVALID;
    *used = at + 8, at = ISOGI_TRACE__HEADER;
    for (k = 0; k < bricks; k++) {
        uint64_t index = isogi_trace__get(block + at, 8), mask = isogi_trace__get(block + at + 8, 8);
        at += 16;
        if (index >= t->brick_count || (k && index <= before)) return ISOGI_CORRUPT;
        before = index;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
            if (!(mask >> slot & 1)) continue;
            if (!isogi_trace__texel_of(t, (size_t)index, slot, texel) || !isogi_trace__record_ok(t, block + at)) return ISOGI_CORRUPT;
            at += t->record;
        }
    }
    return ISOGI_OK;
}

/* The texel's light came with a block: what is gathered for it is not wanted any more. */
static void isogi_trace__node_loaded(isogi_trace *t, const isogi_trace__brick *brick, uint32_t slot) {
    isogi_trace__feedback *f = t->feedback;
    isogi_trace__stage *stage;
    if (!brick->node || !brick->node[slot]) return;
    stage = isogi_trace__stage_at(&f->texels, brick->node[slot] - 1);
    if (!stage->finished) {
        f->unfinished--;
        if (brick->node[slot] <= f->placed) f->partial -= isogi_trace__node_at(&f->texels, brick->node[slot] - 1)->samples;
    }
    stage->finished = 2;
}

/* Room for the texels of a block that was checked: all that loading it takes. */
static isogi_result isogi_trace__block_hold(isogi_trace *t, const uint8_t *block) {
    uint64_t bricks = isogi_trace__get(block + 48, 8), k;
    const uint8_t *at = block + ISOGI_TRACE__HEADER;
    for (k = 0; k < bricks; k++) {
        const uint64_t mask = isogi_trace__get(at + 8, 8);
        isogi_trace__brick **brick = &t->bricks[(size_t)isogi_trace__get(at, 8)];
        at += 16 + isogi_trace__bits(mask) * t->record;
        if (!*brick) {
            *brick = isogi_trace__brick_new(t);
            if (!*brick) return ISOGI_NO_MEMORY;
            if (!t->scene.desc.lazy) memset((*brick)->state, ISOGI_TRACE__NOT_ASKED, sizeof (*brick)->state);
        }
        if (isogi_trace__brick_hold(t, *brick, mask) != ISOGI_OK) return ISOGI_NO_MEMORY;
    }
    return ISOGI_OK;
}

static void isogi_trace__block_load(isogi_trace *t, const uint8_t *block) {
    uint64_t bricks = isogi_trace__get(block + 48, 8), k;
    const uint8_t *at = block + ISOGI_TRACE__HEADER;
    uint32_t slot;
    for (k = 0; k < bricks; k++) {
        isogi_trace__brick *brick = t->bricks[(size_t)isogi_trace__get(at, 8)];
        uint64_t mask = isogi_trace__get(at + 8, 8);
        at += 16;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
            if (!(mask >> slot & 1)) continue;
            memcpy(isogi_trace__record(t, brick, slot), at, t->record);
            at += t->record;
            t->wanted -= brick->state[slot] >= ISOGI_TRACE__WANTED && brick->state[slot] < ISOGI_TRACE__DONE;
            t->done += brick->state[slot] != ISOGI_TRACE__DONE;
            brick->state[slot] = ISOGI_TRACE__DONE;
            isogi_trace__node_loaded(t, brick, slot);
        }
    }
    if (t->feedback && !t->scene.desc.lazy && !t->wanted) isogi_trace__feedback_rest(t);
}

ISOGI_API isogi_result isogi_trace_load(isogi_trace *trace, const void *block, size_t bytes) {
    const uint8_t *from = (const uint8_t *)block;
    size_t used = 0, used_high = 0;
    isogi_result result;
    if (!trace || trace->coarse || !block) return ISOGI_INVALID;
    result = isogi_trace__block_check(trace, from, bytes, &used);
    if (result == ISOGI_OK && trace->high) {
        if (used == bytes) return ISOGI_INVALID; /* of one side: a block of another description */
        result = isogi_trace__block_check(trace->high, from + used, bytes - used, &used_high);
    } else if (result == ISOGI_OK && used != bytes) /* so is one of both sides */
        return isogi_trace__block_check(trace, from + used, bytes - used, &used_high) == ISOGI_CORRUPT ? ISOGI_CORRUPT : ISOGI_INVALID;
    if (result == ISOGI_OK && used + used_high != bytes) result = ISOGI_CORRUPT;
    if (result == ISOGI_OK) result = isogi_trace__block_hold(trace, from);
    if (result == ISOGI_OK && trace->high) result = isogi_trace__block_hold(trace->high, from + used);
    if (result != ISOGI_OK) return result;
    isogi_trace__block_load(trace, from);
    if (trace->high) isogi_trace__block_load(trace->high, from + used);
    return ISOGI_OK;
}

/* ==== changes ======================================================================================================== */

/* What changes in one texture. The texture's scene is exchanged with `scene` before anything is marked, and back where memory runs out. */
typedef struct isogi_trace__change {
    isogi_trace *trace;
    const isogi_trace_desc *desc; /* NULL: voxels change */
    isogi_trace__scene scene;     /* afterwards: as it was */
    isogi_trace__lit lit;
    uint64_t lighting_hash;
    int all, colours, choice; /* to be computed again: all; where colours differ. Texels are chosen anew */
    double low[3], high[3];   /* voxels: grid coordinates of what texels and hits there read */
    double range[2];          /* isovalues of surfaces there */
    size_t *queue, capacity;
} isogi_trace__change;

static uint64_t isogi_trace__hash_colours(const isogi_trace_desc *d) {
    return isogi_trace__hash_table(isogi_trace__hash_table(0, d->albedo_points, d->albedo_count), d->emission_points, d->emission_count);
}

static void isogi_trace__hash_changeable(isogi_trace *t) {
    t->colours_hash = isogi_trace__hash_colours(&t->scene.desc);
    t->lighting_hash = t->scene.desc.mode == ISOGI_TRACE_IRRADIANCE ? isogi_trace__hash_lighting(0, &t->scene.desc.lighting) : 0;
}

/* Whether a new description is of the same texels. */
static int isogi_trace__same_texels(const isogi_trace *t, const isogi_trace_desc *d) {
    const isogi_trace_desc *b = &t->scene.desc;
    int order = d->order ? d->order : 5, lazy = d->lazy != 0 || d->hierarchy > 0, a;
    isogi_trace_format storage = d->storage ? d->storage : d->mode == ISOGI_TRACE_TRANSFER ? ISOGI_TRACE_HALF : ISOGI_TRACE_FLOAT;
    for (a = 0; a < 3; a++) {
        if (d->lattice[a] != b->lattice[a] || d->box_first[a] != b->box_first[a] || d->box_end[a] != b->box_end[a]) return 0;
        if (!isogi_trace__zero(d->lattice_min[a] - b->lattice_min[a]) || !isogi_trace__zero(d->lattice_max[a] - b->lattice_max[a]))
            return 0;
    }
    return d->pyramid == b->pyramid && d->mode == b->mode && order == b->order && d->method == b->method && d->normals == b->normals &&
           lazy == (b->lazy != 0) && !d->capped == !b->capped && !d->unfiltered == !b->unfiltered && d->sides == b->sides &&
           storage == b->storage && isogi_trace__zero((double)d->hierarchy - (double)b->hierarchy) &&
           (!d->transfer_channels || d->transfer_channels == b->transfer_channels);
}

static void isogi_trace__scene_swap(isogi_trace__change *c) {
    isogi_trace__scene before = c->trace->scene;
    c->trace->scene = c->scene, c->scene = before;
    c->trace->scene.sky.env = &c->trace->scene.desc.lighting.env, c->scene.sky.env = &c->scene.desc.lighting.env;
}

/* The scene of the new description, and what it means for the texels. On success the texture has it. */
static isogi_result isogi_trace__change_scene(isogi_trace__change *c) {
    isogi_trace *t = c->trace;
    const isogi_trace_desc *n = c->desc, *b = &t->scene.desc;
    isogi_trace_desc d = t->scene.desc;
    isogi_result result;
    int a, paints;
    d.lighting = n->lighting, d.material = n->material, d.material_user = n->material_user;
    d.albedo_points = n->albedo_points, d.albedo_count = n->albedo_count;
    d.emission_points = n->emission_points, d.emission_count = n->emission_count;
    d.isovalue_min = n->isovalue_min, d.isovalue_max = n->isovalue_max, d.lookup = n->lookup;
    d.samples = n->samples, d.bounces = n->bounces, d.error = n->error, d.seed = n->seed, d.offset = n->offset, d.reach = n->reach;
    d.no_shadows = n->no_shadows;
    for (a = 0; a < 3; a++) d.albedo[a] = n->albedo[a];
    result = isogi_trace__scene_set(&c->scene, &d, &t->context);
    if (result == ISOGI_OK && d.mode == ISOGI_TRACE_TRANSFER) result = isogi_trace__project(&c->lit, d.order, &d.lighting, &t->context);
    if (result != ISOGI_OK) {
        isogi_trace__sky_free(&c->scene.sky, &t->context);
        return result;
    }
    c->lighting_hash = d.mode == ISOGI_TRACE_IRRADIANCE ? isogi_trace__hash_lighting(0, &d.lighting) : 0;
    c->choice = !isogi_trace__zero(d.isovalue_min - b->isovalue_min) || !isogi_trace__zero(d.isovalue_max - b->isovalue_max) ||
                d.lookup != b->lookup;
    n = &c->scene.desc; /* zero defaults filled in */
    c->all = c->lighting_hash != t->lighting_hash || n->samples != b->samples || n->bounces != b->bounces || n->seed != b->seed ||
             !n->no_shadows != !b->no_shadows || !isogi_trace__zero((double)n->error - (double)b->error) ||
             !isogi_trace__zero((double)n->offset - (double)b->offset) || !isogi_trace__zero((double)n->reach - (double)b->reach);
    c->colours = n->albedo_points != b->albedo_points || n->emission_points != b->emission_points ||
                 n->albedo_count != b->albedo_count || n->emission_count != b->emission_count;
    for (a = 0; a < 3; a++) c->colours |= !isogi_trace__zero((double)n->albedo[a] - (double)b->albedo[a]);
    paints = n->material != b->material || n->material_user != b->material_user || (n->material && c->colours);
    /* arrays changed in place: how they were is not known */
    c->all |= paints || isogi_trace__hash_colours(b) != t->colours_hash;
    /* what errors and coarse formats refer to */
    c->all |= d.mode == ISOGI_TRACE_IRRADIANCE && (!isogi_trace__zero(c->scene.possible - t->scene.possible) ||
                                                   !isogi_trace__zero(c->scene.unit - t->scene.unit));
    isogi_trace__scene_swap(c);
    return ISOGI_OK;
}

/* Texels read voxels up to two away; so do smoothed normals at hits. The field's values there are those of all surfaces there. A place
   that goes from outside to inside is crossed by the isovalue: voxels around it that do not change are on one of both sides. */
static isogi_result isogi_trace__change_box(isogi_trace__change *c, const size_t first[3], const size_t last[3]) {
    const isogi_volume *v = c->trace->scene.volume;
    size_t low[3], high[3];
    int a, border = 0;
    for (a = 0; a < 3; a++) {
        if (first[a] > last[a] || first[a] >= v->size[a]) return ISOGI_INVALID;
        low[a] = first[a] > 2 ? first[a] - 2 : 0;
        high[a] = v->size[a] - 1 - first[a] > 2 && last[a] < v->size[a] - 3 ? last[a] + 2 : v->size[a] - 1;
        c->low[a] = (double)low[a], c->high[a] = (double)high[a];
        border |= low[a] == 0 || high[a] == v->size[a] - 1;
    }
    isogi_volume_range(v, low, high, c->range);
    /* the cap is open at voxels that are not finite, which the range leaves out: for every isovalue that it is drawn for */
    if (border && c->trace->scene.desc.capped && !isogi_vol_finite(c->trace->scene.pyramid)) c->range[0] = -DBL_MAX;
    return ISOGI_OK;
}

static int isogi_trace__colours_differ(const isogi_trace_desc *a, const isogi_trace_desc *b, double isovalue) {
    float albedo[2][3], emission[2][3];
    int c, differ = 0;
    isogi_trace_material(a, isovalue, NULL, albedo[0], emission[0]);
    isogi_trace_material(b, isovalue, NULL, albedo[1], emission[1]);
    for (c = 0; c < 3; c++) {
        differ |= !isogi_trace__zero((double)emission[0][c] - (double)emission[1][c]);
        differ |= a->bounces && !isogi_trace__zero((double)albedo[0][c] - (double)albedo[1][c]);
    }
    return differ;
}

static int isogi_trace__in_change(const isogi_trace__change *c, const double grid[3], const double margin[3]) {
    int a;
    for (a = 0; a < 3; a++)
        if (grid[a] < c->low[a] - margin[a] || grid[a] > c->high[a] + margin[a]) return 0;
    return 1;
}

static int isogi_trace__in_reach(const isogi_trace__change *c, const double grid[3]) {
    const isogi_trace__scene *scene = &c->trace->scene;
    double apart = 0, most = 0;
    int a;
    if (!(scene->desc.reach > 0) || scene->desc.bounces < 0) return 1;
    for (a = 0; a < 3; a++) { /* no closer than the planes between which a coordinate lies, however axes lie */
        const double *slope = scene->to_grid + 3 * a;
        double voxels = grid[a] < c->low[a] ? c->low[a] - grid[a] : grid[a] > c->high[a] ? grid[a] - c->high[a] : 0;
        double away = voxels / sqrt(isogi_trace__dot_wide(slope, slope));
        apart = away > apart ? away : apart, most = scene->voxel[a] > most ? scene->voxel[a] : most;
    }
    return apart <= (double)scene->desc.reach * (scene->desc.bounces + 1) + 2 * most; /* rays start up to a voxel off the texel */
}

/* Whether a computed texel that is not at the changed voxels depends on the change. */
static int isogi_trace__depends(const isogi_trace__change *c, const double grid[3]) {
    isogi_hit place;
    double isovalue;
    if (c->all) return 1;
    if (c->desc && !c->colours) return 0;
    if (!isogi_trace__locate(c->trace->scene.volume, grid, &place)) return 0;
    isovalue = isogi_trace__value(c->trace->scene.volume, &place);
    if (c->desc) return isogi_trace__colours_differ(&c->scene.desc, &c->trace->scene.desc, isovalue);
    return isovalue >= c->range[0] && isovalue <= c->range[1] && isogi_trace__in_reach(c, grid);
}

/* How far from changed voxels the choice of texels by an interval of isovalues depends on them: the lattice's outermost texels serve
   lookups up to the volume's border. */
static void isogi_trace__choice_margin(const isogi_trace *t, double margin[3]) {
    int a, chosen = !isogi_trace__zero(t->scene.desc.isovalue_min) || !isogi_trace__zero(t->scene.desc.isovalue_max);
    for (a = 0; a < 3; a++) {
        double below = t->first[a], above = (double)(t->scene.volume->size[a] - 1) - (t->lattice[a] > 1 ? t->last[a] : t->first[a]);
        margin[a] = chosen ? 2 * t->step[a] + 1 + (below > above ? below : above) : 0;
    }
}

/* Whether a brick without texels may get some. */
static int isogi_trace__may_hold(const isogi_trace__change *c, size_t brick) {
    const isogi_trace *t = c->trace;
    size_t low[3], high[3];
    double margin[3], end;
    int a;
    isogi_trace__texel_of(t, brick, 0, low);
    isogi_trace__choice_margin(t, margin);
    for (a = 0; a < 3; a++) {
        high[a] = low[a] + ISOGI_TRACE__SIDE < t->lattice[a] ? low[a] + ISOGI_TRACE__SIDE - 1 : t->lattice[a] - 1;
        if (c->desc) continue;
        end = t->first[a] + (double)high[a] * t->step[a];
        if (end < c->low[a] - margin[a] - 1 || t->first[a] + (double)low[a] * t->step[a] > c->high[a] + margin[a]) return 0;
    }
    return (!c->desc || c->choice) && isogi_trace__meets_box(t, low, high) && isogi_trace__in_range(t, low, high);
}

/* All memory that marking takes. Bricks that stay empty say what no brick says. */
static isogi_result isogi_trace__change_reserve(isogi_trace__change *c) {
    isogi_trace *t = c->trace;
    size_t i;
    for (i = 0; i < t->brick_count; i++) {
        if (!t->bricks[i] && !t->scene.desc.lazy && isogi_trace__may_hold(c, i)) {
            t->bricks[i] = isogi_trace__brick_new(t);
            if (!t->bricks[i]) return ISOGI_NO_MEMORY;
            memset(t->bricks[i]->state, c->desc ? ISOGI_TRACE__NOT_ASKED : ISOGI_TRACE__UNKNOWN, sizeof t->bricks[i]->state);
        }
        c->capacity += t->bricks[i] != NULL;
    }
    if (!c->capacity) c->capacity = 1;
    c->queue = (size_t *)isogi_allocate(&t->context, c->capacity, sizeof *c->queue);
    return c->queue ? ISOGI_OK : ISOGI_NO_MEMORY;
}

static void isogi_trace__change_undo(isogi_trace__change *c) {
    isogi_trace *t = c->trace;
    size_t i, slot;
    for (i = 0; i < t->brick_count && !t->scene.desc.lazy; i++) { /* bricks that have just come, of which nothing is known */
        int known = !t->bricks[i] || t->bricks[i]->held;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS && !known; slot++) known = t->bricks[i]->state[slot] > ISOGI_TRACE__NOT_ASKED;
        if (!known) isogi_trace__brick_free(t, t->bricks[i]), t->bricks[i] = NULL;
    }
    isogi_release(&c->trace->context, c->queue, c->capacity, sizeof *c->queue);
    if (!c->desc) return;
    isogi_trace__scene_swap(c);
    isogi_trace__sky_free(&c->scene.sky, &c->trace->context);
}

/* What a texel is, after a change: one that can be read may have come from another box. */
static int isogi_trace__classify_again(const isogi_trace *t, const size_t texel[3], int state) {
    isogi_trace__site site;
    if (state < ISOGI_TRACE__DRAFT || isogi_trace__in_box(t, texel)) return isogi_trace__classify(t, texel, 0);
    if (!isogi_trace__in_range(t, texel, texel)) return ISOGI_TRACE__NOT_ASKED;
    return isogi_trace__texel_site(t, texel, &site) ? ISOGI_TRACE__WANTED : ISOGI_TRACE__NO_SURFACE;
}

/* The new state of a texel. What can be read stays readable, where it still has a surface. chosen: by the interval of isovalues, or not. */
static uint8_t isogi_trace__changed_state(const isogi_trace__change *c, const size_t texel[3], int state) {
    const isogi_trace *t = c->trace;
    double grid[3], margin[3], none[3] = {0, 0, 0};
    int again, lazy = t->scene.desc.lazy, now, chosen = state >= ISOGI_TRACE__NOT_ASKED && state <= ISOGI_TRACE__READABLE;
    isogi_trace__texel_grid(t, texel, grid);
    isogi_trace__choice_margin(t, margin);
    if (c->desc) again = c->choice && (chosen || (state == ISOGI_TRACE__WANTED && !lazy));
    else again = isogi_trace__in_change(c, grid, none) || (chosen && isogi_trace__in_change(c, grid, margin));
    again |= !lazy && state == ISOGI_TRACE__UNKNOWN; /* its brick has just come */
    if (!again && !c->desc && !lazy && state >= ISOGI_TRACE__WANTED && isogi_trace__in_change(c, grid, margin)) {
        now = isogi_trace__classify_again(t, texel, state); /* no surface of the interval reads it any more */
        if (now != ISOGI_TRACE__WANTED) return (uint8_t)now;
    }
    if (!again) return (uint8_t)(state == ISOGI_TRACE__DONE && isogi_trace__depends(c, grid) ? ISOGI_TRACE__DRAFT : state);
    if (lazy && state < ISOGI_TRACE__WANTED) return ISOGI_TRACE__UNKNOWN;
    now = isogi_trace__classify_again(t, texel, state);
    return (uint8_t)(now == ISOGI_TRACE__WANTED && state >= ISOGI_TRACE__DRAFT ? ISOGI_TRACE__DRAFT : now);
}

/* Light that is kept, in the unit of the new scene. */
static void isogi_trace__change_unit(const isogi_trace__change *c, const isogi_trace__brick *brick, uint32_t slot) {
    isogi_trace *t = c->trace;
    uint8_t *record = isogi_trace__record(t, brick, slot);
    float values[ISOGI_TRACE__VALUES];
    double unit = t->scene.unit;
    t->scene.unit = c->scene.unit;
    isogi_trace__record_read(t, record, values);
    t->scene.unit = unit;
    isogi_trace__record_write(t, record, values, isogi_trace__record_error(record));
}

/* All nodes are forgotten: what was gathered belongs to another scene. */
static void isogi_trace__feedback_reset(isogi_trace *t) {
    isogi_trace__feedback *f = t->feedback;
    if (!f) return;
    isogi_trace__feedback_rest(t);
    f->level = f->diverges = f->diverged = 0, f->probes_before = 0;
}

/* The queue has become another one, of `bricks` bricks: nodes that are being made go on with those it holds. */
static void isogi_trace__making_anew(isogi_trace__feedback *f, size_t bricks) {
    if (!f->making) return;
    f->making = bricks > 0, f->made = 0, f->made_bricks = bricks;
    if (!bricks) f->level = 0, f->cursor = 0;
}

/* Where all light changes, the coarse texels say anew which fine ones are needed. */
static void isogi_trace__drop_fine(isogi_trace *t) {
    size_t i;
    if (!t->coarse) return;
    for (i = 0; i < t->brick_count; i++) {
        isogi_trace__brick_free(t, t->bricks[i]);
        t->bricks[i] = NULL;
    }
}

/* Marks the texels and queues their bricks; needs no memory. */
static void isogi_trace__change_commit(isogi_trace__change *c) {
    isogi_trace *t = c->trace;
    int begin = !c->desc || c->all || c->colours, converts = c->desc && !isogi_trace__zero(c->scene.unit - t->scene.unit);
    size_t place, texel[3], count = 0;
    uint32_t slot;
    if (begin) isogi_trace__feedback_reset(t);
    if (c->desc && c->all) isogi_trace__drop_fine(t);
    isogi_trace__settle(t);
    t->wanted = t->done = 0;
    for (place = 0; place < t->brick_count; place++) {
        const size_t i = isogi_trace__in_order(t, place);
        isogi_trace__brick *brick = t->bricks[i];
        if (!brick) continue;
        brick->queued = 0;
        for (slot = 0; slot < ISOGI_TRACE__TEXELS; slot++) {
            uint8_t *state = &brick->state[slot];
            if (!isogi_trace__texel_of(t, i, slot, texel)) continue;
            if (converts && *state >= ISOGI_TRACE__DRAFT) isogi_trace__change_unit(c, brick, slot);
            if (begin && *state == ISOGI_TRACE__QUEUED) *state = ISOGI_TRACE__WANTED;
            *state = isogi_trace__changed_state(c, texel, *state);
            t->done += *state == ISOGI_TRACE__DONE, t->wanted += *state >= ISOGI_TRACE__WANTED && *state < ISOGI_TRACE__DONE;
            brick->queued |= isogi_trace__to_do(brick, slot);
        }
        if (brick->queued) c->queue[count++] = i;
    }
    isogi_release(&t->context, t->queue, t->queue_capacity, sizeof *t->queue);
    t->queue = c->queue, t->queue_capacity = c->capacity, t->queue_first = 0, t->queue_count = count;
    t->refined = 0, t->refine_next = 0, t->least = 1;
    if (t->feedback) isogi_trace__making_anew(t->feedback, count), t->feedback->most = 0;
    if (!c->desc) return;
    isogi_trace__sky_free(&c->scene.sky, &t->context);
    t->lighting_hash = c->lighting_hash, t->colours_hash = isogi_trace__hash_colours(&t->scene.desc);
    if (t->scene.desc.mode == ISOGI_TRACE_TRANSFER) isogi_trace__set_light(t, &c->lit);
}

/* The same change to both sides and both levels: all of them or none. */
static isogi_result isogi_trace__apply(isogi_trace *trace, const isogi_trace_desc *desc, const size_t *first, const size_t *last) {
    const isogi_context context = trace->context;
    isogi_trace__change *change = (isogi_trace__change *)isogi_allocate(&context, 4, sizeof *change); /* large for a stack */
    isogi_trace *side;
    isogi_result result = ISOGI_OK;
    int count = 0, ready = 0, i;
    if (!change) return ISOGI_NO_MEMORY;
    memset(change, 0, 4 * sizeof *change);
    for (side = trace; side; side = side->high) {
        change[count++].trace = side;
        if (side->coarse) change[count++].trace = side->coarse;
    }
    while (ready < count && result == ISOGI_OK) {
        isogi_trace__change *c = &change[ready];
        c->desc = desc;
        result = desc ? isogi_trace__change_scene(c) : isogi_trace__change_box(c, first, last);
        if (result != ISOGI_OK) break;
        ready++;
        result = isogi_trace__change_reserve(c);
    }
    for (i = 0; i < ready; i++) {
        if (result == ISOGI_OK) isogi_trace__change_commit(&change[i]);
        else isogi_trace__change_undo(&change[i]);
    }
    isogi_release(&context, change, 4, sizeof *change);
    return result;
}

ISOGI_API isogi_result isogi_trace_change(isogi_trace *trace, const isogi_trace_desc *desc) {
    if (!trace || isogi_trace__desc_fault(desc) || !isogi_trace__same_texels(trace, desc)) return ISOGI_INVALID;
    return isogi_trace__apply(trace, desc, NULL, NULL);
}

ISOGI_API isogi_result isogi_trace_touch(isogi_trace *trace, const size_t first[3], const size_t last[3]) {
    if (!trace || !first || !last) return ISOGI_INVALID;
    return isogi_trace__apply(trace, NULL, first, last);
}

ISOGI_API isogi_result isogi_trace_relight(isogi_trace *trace, const isogi_lighting *lighting) {
    isogi_trace__lit lit;
    isogi_trace_desc desc;
    isogi_trace *side;
    isogi_result result;
    if (!trace || !lighting || isogi_lighting_validate(lighting) != ISOGI_OK) return ISOGI_INVALID;
    if (trace->scene.desc.mode == ISOGI_TRACE_IRRADIANCE) {
        desc = trace->scene.desc, desc.lighting = *lighting;
        return isogi_trace__apply(trace, &desc, NULL, NULL);
    }
    if (!isogi_trace__distant(lighting)) return ISOGI_INVALID;
    result = isogi_trace__project(&lit, trace->scene.desc.order, lighting, &trace->context);
    for (side = trace; side && result == ISOGI_OK; side = side->high) {
        isogi_trace__set_light(side, &lit);
        if (side->coarse) isogi_trace__set_light(side->coarse, &lit);
    }
    return result;
}

/* ==== a user's own points ============================================================================================ */

typedef struct isogi_trace__points {
    isogi_trace__scene scene;
    const float (*points)[3], (*normals)[3];
    size_t first, count; /* of the points that are at work */
    float (*irradiance)[3], *error; /* scratch, so that cancelling leaves the caller's arrays alone */
    isogi_trace__wave *waves;
} isogi_trace__points;

/* World points are floats: one that cannot be told from a point on the border is on it. */
static void isogi_trace__snap_to_border(const isogi_trace__scene *scene, const double world[3], double grid[3]) {
    int a, c;
    for (a = 0; a < 3; a++) {
        double last = (double)(scene->volume->size[a] - 1), slack = 1e-9; /* of what is worked out in double */
        for (c = 0; c < 3; c++) slack += 0.51 * (double)FLT_EPSILON * fabs(scene->to_grid[3 * a + c] * world[c]);
        if (fabs(grid[a] - last) <= slack) grid[a] = last;
        if (fabs(grid[a]) <= slack) grid[a] = 0;
    }
}

static void isogi_trace__gather_task(void *arg, size_t task) {
    isogi_trace__points *job = (isogi_trace__points *)arg;
    size_t i = job->first + task * ISOGI_TRACE__TASK, end = i + ISOGI_TRACE__TASK < job->count ? i + ISOGI_TRACE__TASK : job->count;
    for (; i < end; i++) {
        double world[3], grid[3], length;
        isogi_trace__site site;
        isogi_counters counters;
        int a, beyond;
        memset(&counters, 0, sizeof counters);
        memset(job->irradiance[i], 0, sizeof job->irradiance[i]);
        job->error[i] = ISOGI_TRACE__NOT_READY;
        for (a = 0; a < 3; a++) world[a] = (double)job->points[i][a];
        isogi_vol_to_grid(job->scene.pyramid, world, grid);
        if (!isogi_trace__finite3(grid)) continue;
        if (!job->normals && job->scene.desc.capped) isogi_trace__snap_to_border(&job->scene, world, grid);
        if (!isogi_trace__locate(job->scene.volume, grid, &site.place)) continue;
        site.isovalue = isogi_trace__value(job->scene.volume, &site.place);
        if (!isogi_trace__finite(site.isovalue)) continue;
        if (job->normals) {
            length = sqrt(isogi_trace__dot(job->normals[i], job->normals[i]));
            if (!(length > 0) || !isogi_trace__finite(length)) continue;
            if (job->scene.high) length = -length;
            for (a = 0; a < 3; a++) site.normal[a] = (float)((double)job->normals[i][a] / length);
        } else {
            float gradient[1][3];
            isogi_trace__place_normals(job->scene.pyramid, job->scene.desc.normals, &site.place, 1, gradient);
            if (!isogi_trace__site_normal(&job->scene, gradient[0], &site)) continue;
        }
        if (job->scene.high && !isogi_trace__off_surface(&job->scene, &site, 1, ISOGI_TRACE__DEPTH, grid, &beyond)) continue;
        site.key = isogi_trace__key(isogi_trace__key(job->scene.desc.seed, 1), (uint64_t)i);
        isogi_trace__site_start(&job->scene, &site, job->scene.high);
        isogi_trace__gather_site(&job->scene, &site, &job->waves[task], job->irradiance[i], &job->error[i], &counters);
    }
}

ISOGI_API isogi_result isogi_trace_gather(const isogi_trace_desc *desc, const float (*points)[3], const float (*normals)[3],
                                          size_t count, float (*irradiance)[3], float *error, const isogi_context *context) {
    isogi_trace__points job;
    isogi_result result;
    size_t tasks, waves = count ? (count - 1) / ISOGI_TRACE__TASK + 1 : 0;
    if (isogi_trace__desc_fault(desc) || desc->mode != ISOGI_TRACE_IRRADIANCE || (count && (!points || !irradiance)))
        return ISOGI_INVALID;
    if (desc->sides == ISOGI_TRACE_BOTH_SIDES) return ISOGI_INVALID;
    if (!count) return ISOGI_OK;
    if (!context) context = isogi_vol_context(desc->pyramid);
    memset(&job, 0, sizeof job);
    job.points = points, job.normals = normals, job.count = count;
    waves = waves < ISOGI_TRACE__TASKS ? waves : ISOGI_TRACE__TASKS;
    job.waves = (isogi_trace__wave *)isogi_allocate(context, waves, sizeof *job.waves);
    job.irradiance = (float(*)[3])isogi_allocate(context, count, sizeof *job.irradiance);
    job.error = (float *)isogi_allocate(context, count, sizeof *job.error);
    result = isogi_trace__scene_set(&job.scene, desc, context);
    if (!job.irradiance || !job.error || !job.waves) result = ISOGI_NO_MEMORY;
    for (; job.first < count && result == ISOGI_OK; job.first += tasks * ISOGI_TRACE__TASK) {
        double from = (double)job.first / (double)count, to;
        tasks = (count - job.first - 1) / ISOGI_TRACE__TASK + 1, tasks = tasks < waves ? tasks : waves;
        to = (double)(job.first + tasks * ISOGI_TRACE__TASK) / (double)count;
        result = isogi_parallel(context, tasks, isogi_trace__gather_task, &job, from, to < 1 ? to : 1);
    }
    if (result == ISOGI_OK) memcpy(irradiance, job.irradiance, count * sizeof *irradiance);
    if (result == ISOGI_OK && error) memcpy(error, job.error, count * sizeof *error);
    isogi_trace__sky_free(&job.scene.sky, context);
    isogi_release(context, job.waves, waves, sizeof *job.waves);
    isogi_release(context, job.irradiance, count, sizeof *job.irradiance);
    isogi_release(context, job.error, count, sizeof *job.error);
    return result;
}

/* ==== surfaces of the caller's own ===================================================================================== */

/* The paths of isogi_trace__wave in their plainest form: the caller's function finds what they meet. */
typedef struct isogi_trace__field {
    isogi_trace__scene scene;
    isogi_trace_intersect_function *intersect;
    void *user;
    const float (*points)[3], (*normals)[3];
    size_t count;
    float (*irradiance)[3], *error;
} isogi_trace__field;

typedef struct isogi_trace__walk {
    const isogi_trace__field *field;
    int count; /* of paths alive */
    int slot[ISOGI_TRACE__WAVE];
    uint64_t key[ISOGI_TRACE__WAVE];
    double point[ISOGI_TRACE__WAVE][3], place[ISOGI_TRACE__WAVE][3]; /* of vertices, and where their rays start */
    double through[ISOGI_TRACE__WAVE][3], light[ISOGI_TRACE__WAVE][3]; /* light: by slot */
    float normal[ISOGI_TRACE__WAVE][3];
    isogi_ray ray[ISOGI_TRACE__WAVE];
    isogi_trace_surface met[ISOGI_TRACE__WAVE];
    double gain[ISOGI_TRACE__WAVE][3];
    int owner[ISOGI_TRACE__WAVE];
} isogi_trace__walk;

static void isogi_trace__field_rays(isogi_trace__walk *w, int count) {
    const isogi_trace__field *f = w->field;
    int i, c;
    if (!count) return;
    for (i = 0; i < count; i++) {
        memset(&w->met[i], 0, sizeof w->met[i]);
        memcpy(w->met[i].albedo, f->scene.desc.albedo, sizeof w->met[i].albedo);
    }
    f->intersect(f->user, w->ray, (size_t)count, w->met);
    for (i = 0; i < count; i++) {
        isogi_trace_surface *s = &w->met[i];
        double length = sqrt(isogi_trace__dot(s->normal, s->normal)), facing = isogi_trace__dot(s->normal, w->ray[i].dir);
        if (!(s->t > 0) || !isogi_trace__finite(s->t) || (w->ray[i].tmax > 0 && s->t > w->ray[i].tmax)) s->t = 0;
        if (!(length > 0) || !isogi_trace__finite(length))
            for (c = 0, facing = 1, length = 1; c < 3; c++) s->normal[c] = w->ray[i].dir[c];
        for (c = 0; c < 3; c++) s->normal[c] = (float)((double)s->normal[c] / (facing > 0 ? -length : length));
        isogi_trace__tame(s->albedo, 1), isogi_trace__tame(s->emission, ISOGI_TRACE__BRIGHTEST);
    }
}

static void isogi_trace__field_ray(isogi_trace__walk *w, int at, int path, const float dir[3], double tmax) {
    memset(&w->ray[at], 0, sizeof w->ray[at]);
    memcpy(w->ray[at].origin, w->place[path], sizeof w->ray[at].origin);
    memcpy(w->ray[at].dir, dir, sizeof w->ray[at].dir);
    w->ray[at].tmax = isogi_trace__within(&w->field->scene.desc, w->point[path], w->place[path], dir, tmax), w->owner[at] = path;
}

/* Shadow rays that were gathered: what arrives where nothing is in the way. */
static void isogi_trace__field_flush(isogi_trace__walk *w, int count) {
    int i, c;
    if (!w->field->scene.desc.no_shadows) isogi_trace__field_rays(w, count);
    for (i = 0; i < count; i++)
        for (c = 0; c < 3 && (w->field->scene.desc.no_shadows || !(w->met[i].t > 0)); c++)
            w->light[w->slot[w->owner[i]]][c] += w->through[w->owner[i]][c] * w->gain[i][c];
}

static void isogi_trace__field_lights(isogi_trace__walk *w, uint64_t site, int first, int depth) {
    const isogi_lighting *lighting = &w->field->scene.desc.lighting;
    const isogi_trace__sky *sky = &w->field->scene.sky;
    size_t l;
    int i, c, count;
    for (l = sky->rays ? 0 : 1; l <= lighting->light_count; l++) {
        for (count = i = 0; i < w->count; i++) {
            double u[2], cosine;
            isogi_trace__beam beam;
            isogi_trace__light_sample(site, (uint32_t)(first + w->slot[i]), w->key[i], depth, l, u);
            beam.tmax = 0;
            if (l) {
                if (!isogi_trace__light_beam(&lighting->lights[l - 1], w->point[i], u[0], u[1], &beam)) continue;
                cosine = isogi_trace__dot(w->normal[i], beam.dir) / ISOGI_TRACE__PI;
                isogi_trace__beam_from(&beam, w->point[i], w->place[i]);
            } else { /* the environment's image by brightness, weighed against the cosine */
                float radiance[3];
                double density = isogi_trace__sky_direction(sky, u[0], u[1], beam.dir);
                cosine = isogi_trace__dot(w->normal[i], beam.dir) / ISOGI_TRACE__PI;
                density += cosine;
                isogi_trace__env_light(sky->env, beam.dir, radiance);
                for (c = 0; c < 3; c++) beam.rgb[c] = density > 0 ? (double)radiance[c] / density : 0;
            }
            if (!(cosine > 0)) continue;
            for (c = 0; c < 3; c++) w->gain[count][c] = beam.rgb[c] * cosine;
            isogi_trace__field_ray(w, count++, i, beam.dir, beam.tmax);
        }
        isogi_trace__field_flush(w, count);
    }
}

/* Path i goes on as path j from where it met something; 0: it ends. */
static int isogi_trace__field_reflect(isogi_trace__walk *w, int i, int j, int depth) {
    const isogi_trace_desc *d = &w->field->scene.desc;
    double survive, through[3];
    int c;
    for (c = 0; c < 3; c++) {
        w->light[w->slot[i]][c] += w->through[i][c] * (double)w->met[i].emission[c];
        through[c] = w->through[i][c] * (double)w->met[i].albedo[c];
    }
    survive = isogi_trace__survive(d, w->key[i], depth, through);
    if (!(survive > 0)) return 0;
    for (c = 0; c < 3; c++) {
        w->through[j][c] = through[c] / survive;
        w->point[j][c] = w->ray[i].origin[c] + w->met[i].t * (double)w->ray[i].dir[c], w->normal[j][c] = w->met[i].normal[c];
        w->place[j][c] = w->point[j][c] + (double)d->offset * (double)w->normal[j][c];
    }
    w->slot[j] = w->slot[i], w->key[j] = w->key[i];
    return 1;
}

/* Samples first .. first + count - 1 of a point, which is set in point[0], place[0], normal[0]. */
static void isogi_trace__field_run(isogi_trace__walk *w, uint64_t key, int first, int count) {
    const isogi_trace__sequence sequence = isogi_trace__sequence_of(key);
    isogi_trace__basis basis;
    double cosine[ISOGI_TRACE__WAVE];
    int i, c, depth, alive;
    w->count = count;
    for (i = 0; i < count; i++) {
        w->slot[i] = i, w->key[i] = isogi_trace__key(key, (uint64_t)(first + i));
        for (c = 0; c < 3; c++) w->point[i][c] = w->point[0][c], w->place[i][c] = w->place[0][c], w->normal[i][c] = w->normal[0][c];
        for (c = 0; c < 3; c++) w->through[i][c] = 1, w->light[i][c] = 0;
    }
    for (depth = 0; w->count; depth++, w->count = alive) {
        isogi_trace__field_lights(w, key, first, depth);
        for (i = 0; i < w->count; i++) {
            float dir[3];
            double u[2];
            u[0] = isogi_trace__random(w->key[i], depth, ISOGI_TRACE__DIRECTION);
            u[1] = isogi_trace__random(w->key[i], depth, ISOGI_TRACE__DIRECTION + 1);
            if (!depth) isogi_trace__sobol(&sequence, (uint32_t)(first + i), u);
            isogi_trace__basis_of(w->normal[i], &basis);
            isogi_trace__cosine(&basis, u[0], u[1], dir);
            cosine[i] = isogi_trace__dot(w->normal[i], dir) / ISOGI_TRACE__PI;
            isogi_trace__field_ray(w, i, i, dir, 0);
        }
        isogi_trace__field_rays(w, w->count);
        for (alive = i = 0; i < w->count; i++) {
            int met = w->met[i].t > 0;
            if (!met || w->field->scene.desc.no_shadows)
                isogi_trace__escape(&w->field->scene, w->ray[i].dir, cosine[i], (const double *)w->through[i], w->light[w->slot[i]]);
            if (met && isogi_trace__field_reflect(w, i, alive, depth)) alive++;
        }
    }
}

/* What a sample at a point may bring: the sky on average, and the lights from there. What glows is known where it was met. */
static double isogi_trace__field_open(const isogi_trace__field *f, const float point[3]) {
    isogi_lighting lights = f->scene.desc.lighting;
    double open = 0;
    memset(&lights.env, 0, sizeof lights.env);
    if (lights.light_count) isogi_trace__open_at(&lights, point, &open);
    return open + f->scene.possible;
}

static void isogi_trace__field_point(const isogi_trace__field *f, size_t index) {
    const isogi_trace_desc *d = &f->scene.desc;
    isogi_trace__walk w;
    uint64_t key = isogi_trace__key(isogi_trace__key(d->seed, 2), (uint64_t)index);
    isogi_trace__spread spread = {0, 0, 0};
    double sum[3] = {0, 0, 0}, point[3], place[3], length = sqrt(isogi_trace__dot(f->normals[index], f->normals[index]));
    float normal[3];
    int first, i, c;
    memset(f->irradiance[index], 0, sizeof f->irradiance[index]);
    f->error[index] = ISOGI_TRACE__NOT_READY;
    if (!(length > 0) || !isogi_trace__finite(length)) return;
    for (c = 0; c < 3; c++) {
        normal[c] = (float)((double)f->normals[index][c] / length);
        point[c] = (double)f->points[index][c], place[c] = point[c] + (double)d->offset * (double)normal[c];
    }
    if (!isogi_trace__finite3(place)) return;
    w.field = f;
    for (first = 0; first < d->samples; first += ISOGI_TRACE__WAVE) {
        int count = d->samples - first < ISOGI_TRACE__WAVE ? d->samples - first : ISOGI_TRACE__WAVE;
        memcpy(w.point[0], point, sizeof point), memcpy(w.place[0], place, sizeof place), memcpy(w.normal[0], normal, sizeof normal);
        isogi_trace__field_run(&w, key, first, count);
        for (i = 0; i < count; i++) {
            isogi_trace__spread_add(&spread, w.light[i], first + i);
            for (c = 0; c < 3; c++) sum[c] += w.light[i][c];
        }
    }
    for (c = 0; c < 3; c++) f->irradiance[index][c] = (float)(ISOGI_TRACE__PI * sum[c] / d->samples);
    f->error[index] = isogi_trace__spread_error(&spread, d->samples, isogi_trace__field_open(f, f->points[index]));
}

static void isogi_trace__field_task(void *arg, size_t task) {
    const isogi_trace__field *f = (const isogi_trace__field *)arg;
    size_t i = task * ISOGI_TRACE__TASK, end = i + ISOGI_TRACE__TASK < f->count ? i + ISOGI_TRACE__TASK : f->count;
    for (; i < end; i++) isogi_trace__field_point(f, i);
}

ISOGI_API isogi_result isogi_trace_gather_field(const isogi_trace_desc *desc, isogi_trace_intersect_function *intersect, void *user,
                                                const float (*points)[3], const float (*normals)[3], size_t count,
                                                float (*irradiance)[3], float *error, const isogi_context *context) {
    isogi_trace__field f;
    isogi_lighting sky;
    isogi_result result;
    if (!desc || !intersect || (count && (!points || !normals || !irradiance)) || isogi_trace__fields_fault(desc)) return ISOGI_INVALID;
    if (desc->mode != ISOGI_TRACE_IRRADIANCE || desc->offset < 0) return ISOGI_INVALID;
    if (!count) return ISOGI_OK;
    memset(&f, 0, sizeof f);
    f.intersect = intersect, f.user = user, f.points = points, f.normals = normals, f.count = count;
    f.scene.desc = *desc, f.scene.has_env = desc->lighting.env.rgb || desc->lighting.env.sh;
    if (!desc->samples) f.scene.desc.samples = 64;
    f.irradiance = (float(*)[3])isogi_allocate(context, count, sizeof *f.irradiance);
    f.error = (float *)isogi_allocate(context, count, sizeof *f.error);
    sky = f.scene.desc.lighting, sky.lights = NULL, sky.light_count = 0;
    result = isogi_trace__open_at(&sky, NULL, &f.scene.possible);
    if (result == ISOGI_OK) result = isogi_trace__sky_build(&f.scene.sky, &f.scene.desc.lighting.env, context);
    if (!f.irradiance || !f.error) result = ISOGI_NO_MEMORY;
    if (result == ISOGI_OK) result = isogi_parallel(context, (count - 1) / ISOGI_TRACE__TASK + 1, isogi_trace__field_task, &f, 0, 1);
    if (result == ISOGI_OK) memcpy(irradiance, f.irradiance, count * sizeof *irradiance);
    if (result == ISOGI_OK && error) memcpy(error, f.error, count * sizeof *error);
    isogi_trace__sky_free(&f.scene.sky, context);
    isogi_release(context, f.irradiance, count, sizeof *f.irradiance);
    isogi_release(context, f.error, count, sizeof *f.error);
    return result;
}

#undef ISOGI_TRACE__PI
#undef ISOGI_TRACE__SIDE
#undef ISOGI_TRACE__TEXELS
#undef ISOGI_TRACE__WAVE
#undef ISOGI_TRACE__TASK
#undef ISOGI_TRACE__TASKS
#undef ISOGI_TRACE__BATCH
#undef ISOGI_TRACE__MAX_DEPTH
#undef ISOGI_TRACE__MAX_ORDER
#undef ISOGI_TRACE__VALUES
#undef ISOGI_TRACE__FLAT
#undef ISOGI_TRACE__FLAT_ROWS
#undef ISOGI_TRACE__FLAT_ROUNDS
#undef ISOGI_TRACE__NOT_READY
#undef ISOGI_TRACE__BRIGHTEST
#undef ISOGI_TRACE__DEPTH
#undef ISOGI_TRACE__NOISE
#undef ISOGI_TRACE__NOISE_FEW
#undef ISOGI_TRACE__UNEVEN
#undef ISOGI_TRACE__SKY_RAYS
#undef ISOGI_TRACE__NOISE_KNOWN
#undef ISOGI_TRACE__PILOT_SAMPLES
#undef ISOGI_TRACE__NOISE_PILOT
#undef ISOGI_TRACE__SPREAD
#undef ISOGI_TRACE__SPREAD_FROM
#undef ISOGI_TRACE__RIDGE
#undef ISOGI_TRACE__SHEET
#undef ISOGI_TRACE__FILTER
#undef ISOGI_TRACE__REACH
#undef ISOGI_TRACE__ROWS
#undef ISOGI_TRACE__ROW
#undef ISOGI_TRACE__DENSE
#undef ISOGI_TRACE__LANES
#undef ISOGI_TRACE__NEAR
#undef ISOGI_TRACE__VECTORS
#undef ISOGI_TRACE__AVX2
#undef ISOGI_TRACE__FLOATS
#undef ISOGI_TRACE__DEFINE_BLEND
#undef ISOGI_TRACE__BLEND_CHANNEL
#undef ISOGI_TRACE__KEEP
#undef ISOGI_TRACE__PICK
#undef ISOGI_TRACE__LESS
#undef ISOGI_TRACE__MORE
#undef ISOGI_TRACE__KEEP_F4
#undef ISOGI_TRACE__PICK_F4
#undef ISOGI_TRACE__LESS_F4
#undef ISOGI_TRACE__MORE_F4
#undef ISOGI_TRACE__KEEP_F8
#undef ISOGI_TRACE__PICK_F8
#undef ISOGI_TRACE__LESS_F8
#undef ISOGI_TRACE__MORE_F8
#undef ISOGI_TRACE__BLURRED
#undef ISOGI_TRACE__TURNED
#undef ISOGI_TRACE__LIGHT_FIRST
#undef ISOGI_TRACE__WIDE
#undef ISOGI_TRACE__AHEAD
#undef ISOGI_TRACE__PLANE
#undef ISOGI_TRACE__CELL_PROBES
#undef ISOGI_TRACE__COLOURS
#undef ISOGI_TRACE__ALIKE
#undef ISOGI_TRACE__CLASS
#undef ISOGI_TRACE__CELL_RATIO
#undef ISOGI_TRACE__HALF
#undef ISOGI_TRACE__CELL_FAR
#undef ISOGI_TRACE__CELL
#undef ISOGI_TRACE__CELL_LEAST
#undef ISOGI_TRACE__CELL_SAMPLES
#undef ISOGI_TRACE__PROBE_ERROR
#undef ISOGI_TRACE__PROBE_MOST
#undef ISOGI_TRACE__PROBE_DEEP
#undef ISOGI_TRACE__PROBE_SAME
#undef ISOGI_TRACE__NEAR_RATIO
#undef ISOGI_TRACE__CHUNK
#undef ISOGI_TRACE__SLAB
#undef ISOGI_TRACE__SWEEP
#undef ISOGI_TRACE__PASSED
#undef ISOGI_TRACE__STRANDS
#undef ISOGI_TRACE__FLUSH
#undef ISOGI_TRACE__PIECE_SPANS
#undef ISOGI_TRACE__PIECES
#undef ISOGI_TRACE__HEADS
#undef ISOGI_TRACE__ESCAPED
#undef ISOGI_TRACE__CASTS
#undef ISOGI_TRACE__SPAN
#undef ISOGI_TRACE__SPANS
#undef ISOGI_TRACE__SAMPLES
#undef ISOGI_TRACE__VERSION
#undef ISOGI_TRACE__HEADER
#undef ISOGI_TRACE__CARRYING
#undef ISOGI_TRACE__PIECE
#undef ISOGI_TRACE__PLACING
#undef ISOGI_TRACE__POINTS
#undef ISOGI_TRACE__TASK_POINTS
#undef ISOGI_TRACE__ON_FACE
#undef ISOGI_TRACE__WATCHED
#undef ISOGI_TRACE__PASSES
#undef ISOGI_TRACE__ROUNDS
#undef ISOGI_TRACE__RESIDUAL
#endif /* ISOGI_TRACE_IMPLEMENTATION */

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
