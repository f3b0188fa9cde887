/* viewer.c - volume in, globally lit picture out

   One run is one picture: read the volume, find what every pixel sees (a rasterized mesh, or exact rays), bake light for the texels
   that those points read, look it up per pixel, tone-map, write. build/viewer --help tells every option. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "isogi_dvr.h"

#include "camera.h"
#include "daylight.h"
#include "hdr.h"
#include "option_text.h"
#include "picture.h"
#include "png.h"
#include "procedural.h"
#include "raster.h"
#include "transfer_file.h"
#include "volume_file.h"

#include <sys/resource.h>
#include <time.h>

#define PI 3.14159265358979323846
#define MAX_LIGHTS 64
#define MAX_SIDE 16384
#define SECTION 0xfffffffeu /* where the view enters matter through the box or the clip plane */

/* ---- what the command line says -------------------------------------------------------------------------------------------------- */

enum { LAMBERT, PHONG, VICINITY, IRRADIANCE, TRANSFER, PATHTRACE, DVR, SCALE_INVARIANT, MODE_COUNT };
static const char *const mode_name[MODE_COUNT] = {"lambert", "phong", "vicinity", "irradiance", "transfer", "pathtrace", "dvr",
    "scale-invariant"};
static const char *const lookup_name[] = {"trilinear", "nearest", "closest-isovalue", "bspline"};
static const char *const shading_name[4] = {"unlit", "visibility", "local", "two-sided"};
static const char *const classification_name[3] = {"exact", "pre-integrated", "post-classified"};
static const char *const silhouette_name[4] = {"none", "exact", "approximate", "gradient"};
static const char *const transmission_name[3] = {"none", "diffuse", "specular"};
static const char *const method_name[4] = {"default", "brute", "paper", "sweep"};
static const char *const coarsest_name[4] = {"1", "2", "4", "8"};
static const char *const preset_name[4] = {"grey", "hot", "cool-warm", "spectrum"};
static const char *const switch_name[2] = {"off", "on"};
static const char *const ambient_name[2] = {"constant", "normal"};
static const char *const normals_name[2] = {"smooth", "trilinear"};
static const char *const storage_name[5] = {"default", "float", "half", "rgb9e5", "byte"};

typedef struct scene {
    const char *name, *volume; /* "procedural:..." or a file below ISOGI_DATA */
    int lit, rendered;         /* which of the two tables of scenes it stands in */
    double spacing[3], isovalue;
    float albedo[3];
    const char *env;       /* of the lit isosurface */
    int uniform_sky;       /* radiance 1 from everywhere */
    double up[3];          /* 0 = +y */
    const char *transfer;  /* NULL = the shape's own */
    const char *dvr_env;
    float sun[3], dvr_sky; /* irradiance of a directional light from (1 1 1); radiance of a uniform sky */
    int order, directions;
    size_t grid[3];
} scene;

#define TENT "-1.49989 0 .2 .3 .9\n-0.15 0 .2 .3 .9\n0 0.357 .9 .8 .6\n0.15 0 .9 .2 .2\n1.49989 0 .9 .2 .2\n"
static const scene scenes[] = {
    {.name = "engine", .volume = "engine_256x256x128_uint8.raw", .lit = 1, .rendered = 1, .isovalue = 80, .albedo = {.7f, .7f, .7f},
     .env = "hdr/grace_256x128.hdr", .dvr_env = "hdr/grace_256x128.hdr", .order = 3, .directions = 32, .grid = {32, 32, 32},
     .transfer = "0 0 .8 .8 .8\n70 0 .8 .8 .8\n100 .02 .8 .8 .8\n150 .05 .8 .8 .8\n180 .4 1 .7 .3\n255 .8 1 .6 .2\n"},
    {.name = "bonsai", .volume = "bonsai_256x256x256_uint8.raw", .lit = 1, .rendered = 1, .isovalue = 40, .albedo = {.6f, .7f, .5f},
     .env = "hdr/uffizi_256x128.hdr", .dvr_env = "hdr/grace_256x128.hdr", .up = {0, 0, -1}, .order = 2, .directions = 64,
     .grid = {64, 64, 32},
     .transfer = "0 0 .3 .7 .2\n25 0 .3 .7 .2\n40 .15 .3 .7 .2\n80 .2 .5 .35 .2\n160 .6 .6 .6 .6\n255 .9 .7 .7 .7\n"},
    {.name = "cthead", .volume = "cthead8_256x256x99_uint8.raw", .lit = 1, .spacing = {1, 1, 2}, .isovalue = 130, .albedo = {.8f, .8f, .8f},
     .env = "hdr/grace_256x128.hdr"},
    {.name = "engine-block", .volume = "procedural:engine-block", .lit = 1, .isovalue = 90, .albedo = {.7f, .7f, .7f}},
    {.name = "cavity", .volume = "procedural:cavity", .lit = 1, .isovalue = 0, .albedo = {.5f, .5f, .5f}, .uniform_sky = 1},
    {.name = "furnace", .volume = "procedural:engine-block", .lit = 1, .isovalue = 90, .albedo = {1, 1, 1}, .uniform_sky = 1},
    {.name = "ml256", .volume = "procedural:marschner-lobb:256", .rendered = 1, .isovalue = .5, .sun = {2, 2, 2}, .dvr_sky = 1, .order = 3,
     .directions = 32, .grid = {64, 64, 64}},
    {.name = "gyroid256", .volume = "procedural:gyroid:256", .rendered = 1, .isovalue = 0, .sun = {2, 2, 2}, .dvr_sky = 1, .order = 3,
     .directions = 32, .grid = {64, 64, 64}, .transfer = TENT},
    {.name = "fuel", .volume = "fuel_64x64x64_uint8.raw", .rendered = 1, .isovalue = 30, .sun = {3, 3, 3}, .order = 4, .directions = 128,
     .grid = {64, 64, 64}, .transfer = "0 0 .2 .4 1\n10 0 .2 .4 1\n40 .1 .2 .4 1\n120 .5 1 .8 .2\n255 1 1 .2 .1\n"},
    {.name = "torus-sphere-plane", .volume = "procedural:torus-sphere-plane", .rendered = 1, .isovalue = .5, .sun = {3, 3, 3}, .order = 4,
     .directions = 256, .grid = {64, 64, 64}}};
#define SCENE_COUNT (sizeof scenes / sizeof scenes[0])

typedef struct options {
    uint64_t given; /* a bit for each of option_list */
    const char *volume, *env, *tf, *out, *compare, *depth;
    const scene *scene;
    int width, height, mode, raycast, bounces, samples, threads, compact, stats, antialias, classification, silhouette, transmission, order,
        directions;
    int lookup, shadows, ambient, normals, storage, method, shading, coarsest, local, preset;
    int has_size, has_iso, has_mode, has_spacing, has_albedo, has_preset, has_camera, has_up, has_nan, has_shading, has_shadows,
        has_ambient, has_gloss, has_step, has_transmission, has_method, has_coarsest, has_silhouette, has_classification, has_surface,
        has_offset;
    double surface, step, bound, fog, gloss, offset, reach, isovalue, spacing[3], clip[ISOGI_DVR_MAX_PLANES][4], azimuth, elevation,
        distance, up[3], exposure, nan_value;
    float albedo[3];
    isogi_light lights[MAX_LIGHTS];
    size_t light_count, clip_count, lattice[3], grid[3];
} options;

typedef struct viewer {
    options o;
    isogi_context context;
    isogi_volume volume;
    isogi_pyramid *pyramid;
    double range[2], isovalue, rotation[9], radius, centre_distance;
    float albedo[3];
    const procedural_shape *shape;
    camera view;
    hdr_image env;
    float sky[4][3]; /* SH of the default sky */
    isogi_lighting lighting;
    float ambient[9][3]; /* SH of the unshadowed irradiance of the environment alone */
    double key[3], key_light[3], mean_light[3];
    transfer_file transfer;
    isogi_mesh mesh;
    float **inverse; /* [antialias][pixels]: 1 / depth; and what is seen there */
    uint32_t **seen;
    isogi_trace *trace;
    float (*picture)[4];
    isogi_counters counters;
    double started, said, tracing_begun, stage_begun;
    const char *stage; /* what the library's own progress is told as; NULL = silently */
    uint64_t covered, surface, traced; /* samples that show anything, the surface, and those whose light is known */
    char saying;
    unsigned char *compared;  /* the picture to compare with */
    uint64_t memory, memory_peak;
    char error[FILE_ERROR_SIZE];
    char path[PATH_MAX];
} viewer;

static int fail(viewer *v, const char *what, isogi_result result) {
    return file_fail(v->error, "%s: %s", what, isogi_result_string(result));
}

typedef struct option {
    const char *name, *argument;
    unsigned use; /* the modes that it changes something in, a bit each: in the others it is refused, not ignored */
    const char *help;
    enum { FLAG, INTEGER, NUMBERS, FLOATS, SIZES, NAME, TEXT, OTHER } kind;
    size_t offset, has; /* of the value and of its "was given" in options; has 0 = not asked */
    int count;          /* of numbers, or of names */
    double low, high;
    int (*parse)(viewer *, const char *); /* OTHER: 1 = understood */
    const char *const *names;
    const char *allowed; /* in words; NAME: its names are */
} option;

static int parse_scene(viewer *v, const char *text) {
    for (size_t i = 0; i < SCENE_COUNT; i++)
        if (!strcmp(text, scenes[i].name)) v->o.scene = &scenes[i];
    return v->o.scene && !strcmp(text, v->o.scene->name);
}

static int parse_size(viewer *v, const char *text) {
    double x[2];
    if (!whole_numbers(text, 'x', 2, 1, MAX_SIDE, x)) return 0;
    v->o.width = (int)x[0], v->o.height = (int)x[1];
    return 1;
}

static int parse_camera(viewer *v, const char *text) {
    double x[3];
    if (!numbers(text, ',', 3, -1e4, 1e4, x) || fabs(x[1]) > 90 || !(x[2] > 0)) return 0;
    v->o.azimuth = x[0], v->o.elevation = x[1], v->o.distance = x[2];
    return 1;
}

static int parse_up(viewer *v, const char *text) {
    double x[3];
    if (!numbers(text, ',', 3, -1e6, 1e6, x) || !vector_normalize(x)) return 0;
    memcpy(v->o.up, x, sizeof x);
    return 1;
}

static int parse_clip(viewer *v, const char *text) {
    double x[4];
    if (v->o.clip_count >= ISOGI_DVR_MAX_PLANES || !numbers(text, ',', 4, -1e9, 1e9, x) || !(vector_dot(x, x) > 1e-18)) return 0;
    memcpy(v->o.clip[v->o.clip_count++], x, sizeof x);
    return 1;
}

static int parse_light(viewer *v, const char *text) {
    if (v->o.light_count >= MAX_LIGHTS || !light_parse(text, &v->o.lights[v->o.light_count])) return 0;
    v->o.light_count++;
    return 1;
}

#define AT(field) offsetof(options, field)
#define VALUE(field) AT(field), AT(has_##field)
#define NAMED(names_of, field) NAME, AT(field), .names = names_of, .count = (int)(sizeof names_of / sizeof *names_of)
#define PARSED(by, words) OTHER, .parse = by, .allowed = words
enum {
    VOLUMES = 1 << DVR | 1 << SCALE_INVARIANT,
    REFLECTED = 1 << IRRADIANCE | 1 << TRANSFER | 1 << PATHTRACE,
    GATHERED = REFLECTED | 1 << VICINITY,
    BAKED = GATHERED & ~(1 << PATHTRACE),
    BY_NORMAL = 1 << LAMBERT | 1 << PHONG,
    SURFACES = GATHERED | BY_NORMAL,
    ANY = SURFACES | VOLUMES,
    LIT = ANY & ~(1 << VICINITY)
};
static const option option_list[] = {
    {"--scene", "NAME", ANY, "a canonical scene in place of VOLUME: volume, isovalue, light and material belong to it",
     PARSED(parse_scene, "engine bonsai cthead engine-block cavity furnace ml256 gyroid256 fuel torus-sphere-plane")},
    {"--mode", "NAME", ANY, "what light does (below); default irradiance", NAMED(mode_name, mode), .has = AT(has_mode)},
    {"--out", "FILE.png", ANY, "the picture; default isogi.png", TEXT, .offset = AT(out)},
    {"--size", "WxH", ANY, "pixels; default 900x900, 512x512 for dvr and scale-invariant", PARSED(parse_size, "WxH, each 1 to 16384"),
     .has = AT(has_size)},
    {"--iso", "V", ANY & ~(1 << DVR),
     "isovalue; default the shape's own, or a threshold found in the histogram; for scale-invariant, of the "
     "peak that is suggested",
     NUMBERS, AT(isovalue), AT(has_iso), 1, -1e300, 1e300, .allowed = "a number"},
    {"--raycast", 0, SURFACES, "exact rays instead of the rasterized mesh", FLAG, .offset = AT(raycast)},
    {"--clip", "A,B,C,D", ANY,
     "keep only a x + b y + c z + d >= 0 (world); what is cut shows the data; what is cut away of a surface still throws its shadow; may "
     "be repeated",
     PARSED(parse_clip, "four numbers from -1e9 to 1e9, the first three not all zero (at least 1e-9 in length), at most 32 times")},
    {"--spacing", "X,Y,Z", ANY, "size of a voxel; default 1,1,1", NUMBERS, VALUE(spacing), 3, 1e-9, 1e9,
     .allowed = "three numbers, 1e-9 to 1e9"},
    {"--nan", "V", ANY, "put this value in place of voxels that are not finite", NUMBERS, AT(nan_value), AT(has_nan), 1, -1e300, 1e300,
     .allowed = "a number"},
    {"--camera", "AZ,EL,DIST", ANY, "degrees about and above the horizon of --up (-90 to 90); distance in radii of the box's sphere",
     PARSED(parse_camera, "azimuth in degrees, elevation -90 to 90, distance above 0, neither beyond 10000"), .has = AT(has_camera)},
    {"--up", "X,Y,Z", ANY, "which way is up, for the camera and the environment; default 0,1,0",
     PARSED(parse_up, "three numbers, not all zero"), .has = AT(has_up)},
    {"--env", "FILE.hdr", LIT, "environment: equirectangular Radiance picture; sky: the default's sky, to go with --light", TEXT,
     .offset = AT(env)},
    {"--light", "KIND:X,Y,Z:R,G,B[:RADIUS]", LIT,
     "directional (towards the light; irradiance; radius in degrees), point (place; "
     "intensity), sphere (centre; intensity; radius), rectangle:X,Y,Z:R,G,B:UX,UY,UZ:VX,VY,VZ (centre; intensity; two sides at right "
     "angles; it shines towards U x V); may be repeated",
     PARSED(parse_light, "directional|point|sphere:X,Y,Z:R,G,B with an optional :RADIUS (up to 90 degrees; needed for a sphere), or "
                         "rectangle:X,Y,Z:R,G,B:UX,UY,UZ:VX,VY,VZ, at most 64 times")},
    {"--albedo", "R,G,B", ANY, "diffuse reflectance, in volume rendering that of --surface; default 0.7,0.7,0.7", FLOATS, VALUE(albedo), 3,
     0, 1, .allowed = "three numbers, 0 to 1"},
    {"--bounces", "N", REFLECTED, "reflections of light; -1 = all, the default", INTEGER, AT(bounces), 0, 1, -1, 1000,
     .allowed = "a whole number, -1 to 1000"},
    {"--samples", "N", GATHERED,
     "paths per texel, or per pixel for pathtrace, there rounded up to a multiple of --aa; default "
     "64",
     INTEGER, AT(samples), 0, 1, 1, 1000000, .allowed = "a whole number, 1 to 1000000"},
    {"--lattice", "X,Y,Z", BAKED,
     "texels of the illumination texture; default one per voxel, more along axes on which voxels lie further "
     "apart, and two where voxels are more than five pixels wide",
     SIZES, AT(lattice), 0, 3, 2, 4096, .allowed = "three whole numbers, 2 to 4096"},
    {"--lookup", "NAME", BAKED, "how the texture is read: trilinear, nearest, closest-isovalue, bspline", NAMED(lookup_name, lookup)},
    {"--shadows", "on|off", SURFACES,
     "shadows of lights and sky; for lambert and phong, where off is the default, those of lights, per "
     "pixel",
     NAMED(switch_name, shadows), .has = AT(has_shadows)},
    {"--ambient", "constant|normal", BY_NORMAL,
     "the sky's light, the same for all or by normal; default normal, constant for phong without --env",
     NAMED(ambient_name, ambient), .has = AT(has_ambient)},
    {"--fog", "X", SURFACES, "fade to the sky's mean light with distance: by exp(-X) from the front of the box's sphere to its back",
     NUMBERS, AT(fog), 0, 1, 0, 100, .allowed = "a number, 0 to 100"},
    {"--gloss", "EXPONENT", 1 << TRANSFER,
     "gloss as well, a Phong lobe that reflects a fifth; its highlights are as soft "
     "as the order of the texture, which holds exponents up to about 25",
     NUMBERS, VALUE(gloss), 1, 0, 1000, .allowed = "a number, 0 to 1000"},
    {"--normals", "smooth|trilinear", GATHERED, "of the light that is gathered; default smooth", NAMED(normals_name, normals)},
    {"--offset", "X", GATHERED, "rays of light start this many voxels above the surface, 0 or negative: on it; default 0.25", NUMBERS,
     VALUE(offset), 1, -1, 1, .allowed = "a number, -1 to 1"},
    {"--reach", "R", GATHERED, "surfaces further away than this (world units) cast no shadow; default 0 = unlimited", NUMBERS, AT(reach), 0,
     1, 0, 1e9, .allowed = "a number, 0 or more"},
    {"--storage", "NAME", BAKED, "how the texture is held: default, float, half, rgb9e5, byte", NAMED(storage_name, storage)},
    {"--compare", "FILE.png", ANY,
     "tell how far the picture is from this one: difference_rms, of what is seen, in sRGB values of 0 to 1; the automatic "
     "exposure is then one at which both have the same mean",
     TEXT, .offset = AT(compare)},
    {"--tf", "FILE", VOLUMES,
     "transfer function: lines \"value extinction r g b\" or \"peak value opacity r g b\", colours 0 to 1; # begins a remark; "
     "default the scene's or shape's own, else one suggested by the histogram",
     TEXT, .offset = AT(tf)},
    {"--surface", "V", VOLUMES,
     "an opaque isosurface as well, which hides the matter behind it; lit as by lambert, in the shadows that it throws of lights, but "
     "not in those of the matter",
     NUMBERS, VALUE(surface), 1, -1e300, 1e300, .allowed = "a number"},
    {"--shading", "NAME", VOLUMES, "unlit, visibility, local, two-sided; default visibility, for scale-invariant local",
     NAMED(shading_name, shading), .has = AT(has_shading)},
    {"--preset", "NAME", VOLUMES,
     "transfer function of these colours, denser the larger the value, where the histogram has something: "
     "grey, hot, cool-warm, spectrum",
     NAMED(preset_name, preset), .has = AT(has_preset)},
    {"--method", "NAME", 1 << DVR, "how visibility is computed: default, brute, paper, sweep", NAMED(method_name, method),
     .has = AT(has_method)},
    {"--order", "N", VOLUMES,
     "with visibility, as the next two: spherical harmonics of shadows, 1 to 6: 2 the side light comes "
     "from, 3 soft shadows, more for directional lights; default 4 (a scene: its own; without sweeps, for peaks or by --method, 3)",
     INTEGER, AT(order), 0, 1, 1, 6, .allowed = "a whole number, 1 to 6"},
    {"--directions", "N", VOLUMES,
     "rays from each grid point of visibility, better no fewer than 2 order^2; default 256 (a scene: its own; without "
     "sweeps 64)",
     INTEGER, AT(directions), 0, 1, 1, 65536, .allowed = "a whole number, 1 to 65536"},
    {"--grid", "X,Y,Z", VOLUMES,
     "points of visibility: no shadow is finer; default one per voxel, of more than 4 million half as many along "
     "each axis, at most 128 (a scene: its own; without sweeps a quarter)",
     SIZES, AT(grid), 0, 3, 1, 1024, .allowed = "three whole numbers, 1 to 1024"},
    {"--coarsest", "N", 1 << DVR,
     "by sweeps: points of visibility stand up to N times as far apart where nothing is seen of them, "
     "which saves memory for a finer --grid: 1, 2, 4, 8; default 1",
     NAMED(coarsest_name, coarsest), .has = AT(has_coarsest)},
    {"--local", 0, 1 << DVR, "light by local visibility, of --method paper: for clip planes and lights within", FLAG, .offset = AT(local)},
    {"--depth", "FILE.pfm", VOLUMES,
     "as well: distance from the eye to half of the matter's opacity in a pixel, or to --surface where that is less than a half; where "
     "nothing is seen infinity; as floats (the nearest of a pixel's samples)",
     TEXT, .offset = AT(depth)},
    {"--classification", "NAME", VOLUMES, "exact, pre-integrated, post-classified; dvr knows the last one and, for both others, its own",
     NAMED(classification_name, classification), .has = AT(has_classification)},
    {"--silhouette", "NAME", VOLUMES, "surfaces seen aslant are more opaque, in dvr those of peaks: none, exact, approximate, gradient",
     NAMED(silhouette_name, silhouette), .has = AT(has_silhouette)},
    {"--transmission", "NAME", VOLUMES, "light that --shading two-sided lets through: none, diffuse, specular (both, the default)",
     NAMED(transmission_name, transmission), .has = AT(has_transmission)},
    {"--step", "S", VOLUMES,
     "of sampled rays (all of dvr but those of --bound, and by --classification): distance of samples in voxels; "
     "default 0.5, 1 for dvr unlit or by visibility, without peaks",
     NUMBERS, VALUE(step), 1, 1e-3, 1e3, .allowed = "a number, 0.001 to 1000"},
    {"--bound", "X", 1 << DVR, "exact opacity, and unlit colours that err by less than this, in place of samples; 0.0001 to 1", NUMBERS,
     AT(bound), 0, 1, 1e-4, 1, .allowed = "a number, 0.0001 to 1"},
    {"--exposure", "X", ANY, "factor on the light, in place of the automatic exposure", NUMBERS, AT(exposure), 0, 1, 1e-12, 1e12,
     .allowed = "a number above 0"},
    {"--aa", "N", ANY,
     "samples per pixel; default 4, for pathtrace at most --samples, for dvr 1; for dvr and scale-invariant rounded "
     "down to a square",
     INTEGER, AT(antialias), 0, 1, 1, 64, .allowed = "a whole number, 1 to 64"},
    {"--threads", "N", ANY, "0 = one per core, the default", INTEGER, AT(threads), 0, 1, 0, 256, .allowed = "a whole number, 0 to 256"},
    {"--compact", 0, ANY, "the volume's pyramid takes 1/5 byte a voxel instead of 2.2; rays are slower", FLAG, .offset = AT(compact)},
    {"--stats", 0, ANY, "\"key value\" lines on the standard output", FLAG, .offset = AT(stats)}};
#define OPTION_COUNT (sizeof option_list / sizeof option_list[0])
typedef char a_bit_of_given_for_each[OPTION_COUNT <= 64 ? 1 : -1];

/* The names joined: by spaces, or as in a sentence. */
static void list_names(const char *const *names, int count, unsigned which, int sentence, char text[256]) {
    const char *between = "";
    for (int i = 0; i < count; i++) {
        unsigned after = which >> 1 >> i & ((1u << (count - 1 - i)) - 1);
        if (!(which >> i & 1)) continue;
        strcat(strcat(text, between), names[i]);
        between = !sentence ? " " : after & (after - 1) ? ", " : " and ";
    }
}

/* The modes that an option is for, in words. */
static void list_modes(unsigned use, char text[256]) {
    *text = 0;
    if (use == LIT) {
        strcpy(text, "modes that have no light of their own");
        return;
    }
    if ((use & SURFACES) == SURFACES) strcpy(text, "surfaces"), use &= ~(unsigned)SURFACES, strcat(text, use ? " and " : "");
    if (use) strcat(text, "--mode "), list_names(mode_name, MODE_COUNT, use, 1, text + strlen(text));
}

/* What an option is called and what it does, in lines of at most 100 columns. */
static void print_option(const char *left, const char *text) {
    size_t column = (size_t)printf("  %-28s", left);
    if (column > 30) printf("\n%30s", ""), column = 30;
    while (*text) {
        size_t word = strcspn(text, " ");
        if (column + 1 + word > 100) printf("\n%30s", ""), column = 30;
        printf(" %.*s", (int)word, text);
        column += 1 + word, text += word + (text[word] == ' ');
    }
    putchar('\n');
}

static void print_help(void) {
    puts("build/viewer VOLUME [options]      volume in, globally lit picture out\n\n"
         "VOLUME is a raw file named like engine_256x256x128_uint8.raw (x fastest, little-endian; uint8 int8\n"
         "uint16 int16 float32 float64), or procedural:NAME[:N] with N voxels along the longest axis:");
    for (size_t i = 0; i < PROCEDURAL_SHAPE_COUNT; i++) printf("  %-20s %s\n", procedural_shapes[i].name, procedural_shapes[i].summary);
    puts("\nOptions");
    for (size_t i = 0; i < OPTION_COUNT; i++) {
        char left[64], modes[256], text[1024];
        snprintf(left, sizeof left, "%s %s", option_list[i].name, option_list[i].argument ? option_list[i].argument : "");
        list_modes(option_list[i].use, modes);
        if (option_list[i].use == ANY) snprintf(text, sizeof text, "%s", option_list[i].help);
        else snprintf(text, sizeof text, "%s (%s)", option_list[i].help, modes);
        print_option(left, text);
        if (option_list[i].parse == parse_scene) print_option("", option_list[i].allowed);
    }
    puts("  --help                       this text\n\n"
         "Of an option that is given twice the last one counts, but for those that may be repeated.\n\n"
         "Modes\n"
         "  lambert, phong               light by the normal alone, no shadows: to compare with\n"
         "  vicinity                     a uniform sky of its own, no reflections: how open each place is\n"
         "  irradiance                   global light baked into a texture, only where this view looks\n"
         "  transfer                     the same by spherical harmonics, which can be relit without new rays\n"
         "  pathtrace                    no texture: paths from every pixel, the reference\n"
         "  dvr                          volume rendering, lit by spherical-harmonics visibility\n"
         "  scale-invariant              volume rendering per unit of data: the same at any scale of space\n\n"
         "Light: without --env and --light a sky (radiance 1 above to 0.3 below) and a sun. The exposure is\n"
         "set so that nine tenths of what is seen are below 0.6 of white; up to 0.7 the picture is linear,\n"
         "above it bends to white; then it is coded as sRGB.\n"
         "The variable ISOGI_DATA names the folder of the volumes that --scene asks for.\n\n"
         "Examples\n"
         "  build/viewer procedural:engine-block --out engine.png\n"
         "  build/viewer head_256x256x99_uint8.raw --spacing 1,1,2 --iso 130 --env studio.hdr --out head.png\n"
         "  build/viewer procedural:gyroid --mode vicinity --clip 1,0,0,-40 --clip 0,-1,0,100 --stats\n"
         "  build/viewer --scene engine --mode pathtrace --samples 256 --out reference.png\n"
         "  build/viewer procedural:skull --light directional:1,2,3:4,3.8,3.5:3 --camera 20,10,2.4");
}

static int check_use(viewer *v) {
    int mode = v->o.mode;
    char modes[256];
    for (size_t k = 0; k < OPTION_COUNT; k++) {
        const option *p = &option_list[k];
        if (!(v->o.given >> k & 1) || p->use >> mode & 1) continue;
        list_modes(p->use, modes);
        return file_fail(v->error, "%s: works with %s, not with --mode %s", p->name, modes, mode_name[mode]);
    }
    return 1;
}

static const char without_step[] = "--step: rays with --bound have none, but those of visibility by --method brute";
static int is_shadowed(const options *o) { return o->has_shading ? o->shading == ISOGI_DVR_VISIBILITY : o->mode == DVR; }

/* What volume rendering cannot do together: whatever would change nothing is refused. */
static int check_volume(viewer *v) {
    const options *o = &v->o;
    int shadowed = is_shadowed(o);
    if (o->mode < DVR) return 1;
    if (o->tf && o->has_preset) return file_fail(v->error, "give --tf or --preset, not both");
    if (o->has_albedo && !o->has_surface) return file_fail(v->error, "--albedo: is that of --surface here; matter has its colours");
    if (o->has_iso && (o->tf || o->has_preset))
        return file_fail(v->error, "--iso: is for surfaces and for the transfer function that --mode scale-invariant is suggested; a "
                                   "transfer function has its own values");
    if ((o->has_method || o->order || o->directions || o->grid[0]) && !shadowed)
        return file_fail(v->error, "%s: needs --shading visibility", o->has_method ? "--method" : o->order ? "--order" : o->directions
            ? "--directions" : "--grid");
    if (o->has_coarsest && (!shadowed || (o->method != ISOGI_DVR_METHOD_DEFAULT && o->method != ISOGI_DVR_SWEEP)))
        return file_fail(v->error, "--coarsest: needs --shading visibility and --method sweep, the default");
    if (o->local && !(shadowed && o->method == ISOGI_DVR_PAPER))
        return file_fail(v->error, "--local: needs --shading visibility and --method paper");
    if (o->has_transmission && !(o->has_shading && o->shading == ISOGI_DVR_TWO_SIDED))
        return file_fail(v->error, "--transmission: needs --shading two-sided");
    if (o->has_shading && o->shading == ISOGI_DVR_UNLIT && (o->env || o->light_count) && !o->has_surface)
        return file_fail(v->error, "%s: --shading unlit has no light", o->env ? "--env" : "--light");
    if (o->bound > 0 && o->has_step && (!shadowed || o->method > ISOGI_DVR_BRUTE)) return file_fail(v->error, "%s", without_step);
    if (o->bound > 0 && o->has_classification) return file_fail(v->error, "--classification: rays with --bound are exact");
    if (o->has_step && o->mode == SCALE_INVARIANT && o->classification == ISOGI_DVR_EXACT)
        return file_fail(v->error, "--step: exact rays have none; --classification pre-integrated and post-classified have");
    return 1;
}

/* What it cannot do with this transfer function. */
static int check_transfer(viewer *v, int suggested) {
    const options *o = &v->o;
    size_t peaks = v->transfer.peak_count;
    if (o->has_iso && !suggested)
        return file_fail(v->error, "--iso: the transfer function is not a suggested one and has values of its own");
    if (o->local && peaks) return file_fail(v->error, "--local: knows no peaks, and the transfer function has some");
    if (o->has_coarsest && peaks) return file_fail(v->error, "--coarsest: knows no peaks, and the transfer function has some");
    if (o->method > ISOGI_DVR_BRUTE && peaks)
        return file_fail(v->error, "--method: %s knows no peaks, and the transfer function has some", method_name[o->method]);
    if (o->bound > 0 && o->has_step && ((!o->method && !peaks) || !v->transfer.point_count)) /* crossings of peaks are exact */
        return file_fail(v->error, "%s", without_step);
    if (o->has_silhouette && o->mode == DVR && !peaks)
        return file_fail(v->error, "--silhouette: is for peaks in --mode dvr, and the transfer function has none");
    return 1;
}

/* No picture takes the place of another one, or of what it is made from. (That of --compare is read first, and
   may be replaced by --out.) */
static int check_files(viewer *v) {
    const options *o = &v->o;
    const scene *s = o->scene;
    const char *const folder = getenv("ISOGI_DATA"), *const of_scene[] = {s ? s->volume : NULL, s ? s->env : NULL, s ? s->dvr_env : NULL};
    const char *names[] = {o->volume, o->tf, o->env, NULL, NULL, NULL},
               *const options_of[] = {"VOLUME", "--tf", "--env", "--scene", "--scene", "--scene"};
    char paths[3][PATH_MAX];
    for (int i = 0; i < 3 && folder; i++)
        if (of_scene[i] && (size_t)snprintf(paths[i], sizeof paths[i], "%s/%s", folder, of_scene[i]) < sizeof paths[i])
            names[3 + i] = paths[i];
    if (file_same(o->out, o->depth)) return file_fail(v->error, "--depth: %.200s is the file of --out", o->depth);
    if (file_same(o->depth, o->compare)) return file_fail(v->error, "--depth: %.200s is the file of --compare", o->depth);
    for (int i = 0; i < 6; i++)
        if (file_same(o->out, names[i]) || file_same(o->depth, names[i]))
            return file_fail(v->error, "%s: %.200s is the file of %s", file_same(o->out, names[i]) ? "--out" : "--depth", names[i],
                             options_of[i]);
    return 1;
}

static int parse_value(viewer *v, const option *p, const char *text) {
    char *at = (char *)&v->o + p->offset, names[256] = "";
    double x[4];
    int ok = 0;
    if (p->kind == TEXT)
        return *text ? (memcpy(at, &text, sizeof text), 1) : file_fail(v->error, "%s: the name of a file is missing", p->name);
    if (p->kind == NAME) ok = parse_name(text, p->names, p->count, (int *)(void *)at);
    else if (p->kind == OTHER) ok = p->parse(v, text);
    else ok = (p->kind == INTEGER || p->kind == SIZES ? whole_numbers : numbers)(text, ',', p->count, p->low, p->high, x);
    for (int i = 0; ok && p->kind < NAME && i < p->count; i++) {
        if (p->kind == INTEGER) ((int *)(void *)at)[i] = (int)x[i];
        else if (p->kind == SIZES) ((size_t *)(void *)at)[i] = (size_t)x[i];
        else if (p->kind == FLOATS) ((float *)(void *)at)[i] = (float)x[i];
        else ((double *)(void *)at)[i] = x[i];
    }
    if (p->kind == NAME) list_names(p->names, p->count, ~0u, 0, names);
    return ok || file_fail(v->error, "%s: \"%.80s\" is not allowed; allowed: %s", p->name, text, p->kind == NAME ? names : p->allowed);
}

static int parse_arguments(viewer *v, int argc, char **argv) {
    options *o = &v->o;
    const int one = 1;
    o->bounces = -1, o->mode = IRRADIANCE, o->up[1] = 1, o->transmission = 2;
    for (int i = 1; i < argc; i++) {
        const option *p = NULL;
        for (size_t k = 0; k < OPTION_COUNT; k++)
            if (!strcmp(argv[i], option_list[k].name)) p = &option_list[k];
        if (!p && argv[i][0] == '-') return file_fail(v->error, "%.80s: no such option; --help lists them", argv[i]);
        if (!p) {
            if (o->volume) return file_fail(v->error, "%.200s: a second volume after %.200s", argv[i], o->volume);
            if (!*argv[i]) return file_fail(v->error, "the name of the volume is empty");
            o->volume = argv[i];
            continue;
        }
        if (p->kind == FLAG) memcpy((char *)o + p->offset, &one, sizeof one);
        else if (i + 1 >= argc || !strncmp(argv[i + 1], "--", 2)) /* an option is no value */
            return file_fail(v->error, "%s: needs a value: %s", p->name, p->argument);
        else if (!parse_value(v, p, argv[++i])) return 0;
        if (p->has) memcpy((char *)o + p->has, &one, sizeof one);
        o->given |= (uint64_t)1 << (p - option_list);
    }
    if (!o->volume == !o->scene)
        return file_fail(v->error,
                         o->volume ? "give VOLUME or --scene, not both" : "no volume: build/viewer VOLUME [options], --help explains");
    if (!o->out) o->out = "isogi.png";
    if (o->scene && !o->has_mode) o->mode = o->scene->lit ? IRRADIANCE : DVR;
    if (o->scene && o->mode >= DVR && !o->scene->rendered && !o->tf && !o->has_preset)
        return file_fail(v->error, "--scene %s has no transfer function: give one by --tf or --preset, or another --mode", o->scene->name);
    if (!check_use(v) || !check_volume(v) || !check_files(v)) return 0;
    if (!o->has_size) o->width = o->height = o->mode >= DVR ? 512 : 900;
    if ((double)o->width * o->height > 100e6)
        return file_fail(v->error, "--size: %dx%d is too large; at most 100 million pixels", o->width, o->height);
    if (!o->samples) o->samples = 64;
    if (!o->has_shadows) o->shadows = o->mode > PHONG;
    if (!o->has_ambient) o->ambient = o->mode != PHONG || o->env; /* a constant one is Phong's, but flat under uneven skies */
    if (o->storage == ISOGI_TRACE_RGB9E5 && o->mode == TRANSFER)
        return file_fail(v->error, "--storage: rgb9e5 holds colours, not the coefficients of --mode transfer");
    return 1;
}

/* ---- memory, clock, progress, stats ------------------------------------------------------------------------------------------------ */

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void *counted_alloc(void *user, size_t size, size_t align) {
    viewer *v = (viewer *)user;
    void *p = isogi_allocate(NULL, 1, size); /* aligned to 64 bytes, which is as much as is ever asked for */
    uint64_t now, peak;
    (void)align;
    if (!p) return NULL;
    now = __atomic_add_fetch(&v->memory, size, __ATOMIC_RELAXED);
    peak = __atomic_load_n(&v->memory_peak, __ATOMIC_RELAXED);
    while (now > peak && !__atomic_compare_exchange_n(&v->memory_peak, &peak, now, 1, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {}
    return p;
}
static void counted_release(void *user, void *p, size_t size) {
    __atomic_sub_fetch(&((viewer *)user)->memory, size, __ATOMIC_RELAXED);
    isogi_release(NULL, p, 1, size);
}

/* A line that is rewritten on a terminal; elsewhere a new line now and then, and none for what is done within a second or two. */
static void say(viewer *v, const char *what, double fraction, double begun) {
    int terminal = isatty(STDERR_FILENO);
    double now = seconds();
    if (now - v->said < (terminal ? 0.1 : 5) && !(terminal && fraction >= 1)) return;
    if (!terminal && now - begun < 5) return;
    v->said = now;
    if (terminal) fprintf(stderr, fraction >= 1 ? "\r\033[K" : "\r%s %3.0f %%, %.1f s \033[K", what, 100 * fraction, now - begun);
    else fprintf(stderr, "%s %.0f %%, %.1f s\n", what, 100 * fraction, now - begun);
}

__attribute__((format(printf, 3, 4))) static void stat_line(const viewer *v, const char *key, const char *format, ...) {
    va_list values;
    if (!v->o.stats) return;
    va_start(values, format);
    printf("%s ", key);
    vprintf(format, values);
    putchar('\n');
    va_end(values);
}

static double stat_seconds(const viewer *v, const char *stage, double begun) {
    double now = seconds();
    char key[64];
    snprintf(key, sizeof key, "seconds_%s", stage);
    stat_line(v, key, "%.4f", now - begun);
    return now;
}

/* ---- the volume -------------------------------------------------------------------------------------------------------------- */

static int make_procedural(viewer *v, const char *text) {
    char name[64];
    const char *colon = strchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : strlen(text);
    double longest = 0;
    isogi_result result;
    if (length < sizeof name) memcpy(name, text, length), name[length] = 0;
    v->shape = length < sizeof name ? procedural_find(name) : NULL;
    if (!v->shape) {
        char list[256] = "";
        for (size_t i = 0; i < PROCEDURAL_SHAPE_COUNT; i++) strcat(strcat(list, " "), procedural_shapes[i].name);
        return file_fail(v->error, "procedural:%.40s: no such volume; there are:%s", text, list);
    }
    if (colon && !whole_numbers(colon + 1, ',', 1, 2, 2048, &longest))
        return file_fail(v->error, "procedural:%.60s: the size is a whole number, 2 to 2048", text);
    result = procedural_make(v->shape, (size_t)longest, &v->volume, &v->context);
    return result == ISOGI_OK || fail(v, "the volume", result);
}

static int data_path(viewer *v, const char *name) {
    const char *folder = getenv("ISOGI_DATA");
    if (!folder || !*folder)
        return file_fail(v->error, "--scene %s needs %s: set ISOGI_DATA to the folder it is in", v->o.scene->name, name);
    if ((size_t)snprintf(v->path, sizeof v->path, "%s/%s", folder, name) >= sizeof v->path)
        return file_fail(v->error, "ISOGI_DATA: the name is too long");
    return 1;
}

static int load_volume(viewer *v) {
    const scene *s = v->o.scene;
    const char *name = s ? s->volume : v->o.volume;
    double begun = seconds();
    isogi_result result;
    size_t bad, at = 0;
    if (!strncmp(name, "procedural:", 11)) {
        if (!make_procedural(v, name + 11)) return 0;
    } else {
        if (s && !data_path(v, name)) return 0;
        if (s) name = v->path;
        if (!volume_read(name, &v->volume, v->error)) return 0;
    }
    if (v->o.has_nan && v->volume.type == ISOGI_F32 && fabs(v->o.nan_value) > 3.4e38)
        return file_fail(v->error, "--nan %g is too large for voxels of type float32", v->o.nan_value);
    bad = volume_not_finite(&v->volume, v->o.has_nan ? &v->o.nan_value : NULL, &at);
    if (bad && !v->o.has_nan)
        return file_fail(v->error, "%s: voxel %zu,%zu,%zu and %zu others are not finite numbers; --nan V puts a value in their place", name,
                         at % v->volume.size[0], at / v->volume.size[0] % v->volume.size[1], at / v->volume.size[0] / v->volume.size[1],
                         bad - 1);
    for (int a = 0; a < 3; a++) {
        v->volume.spacing[a] = v->o.has_spacing ? v->o.spacing[a] : s && s->spacing[a] > 0 ? s->spacing[a] : 1;
        if (v->volume.size[a] < 2)
            return file_fail(v->error, "%s: has only one layer of voxels along %c: nothing to look at", name, "xyz"[a]);
    }
    begun = stat_seconds(v, "volume", begun);
    v->volume.compact = v->o.compact;
    result = isogi_vol_build(&v->pyramid, &v->volume, &v->context);
    if (result != ISOGI_OK) return fail(v, "the volume", result);
    isogi_vol_range(v->pyramid, v->range);
    for (int k = 0; k < 2; k++)
        if (fabs(v->range[k]) > 1e300) return file_fail(v->error, "%s: values reach %.3g; up to 1e300 can be used", name, v->range[k]);
    stat_seconds(v, "pyramid", begun);
    stat_line(v, "volume", "%s", name);
    stat_line(v, "size", "%zux%zux%zu", v->volume.size[0], v->volume.size[1], v->volume.size[2]);
    stat_line(v, "type", "%s", volume_type_name(v->volume.type));
    stat_line(v, "range", "%.9g %.9g", v->range[0], v->range[1]);
    return 1;
}

static void choose_surface(viewer *v) {
    const scene *s = v->o.scene;
    static const float grey[3] = {0.7f, 0.7f, 0.7f};
    const float *albedo = v->o.has_albedo ? v->o.albedo : s && s->lit ? s->albedo : v->shape ? v->shape->albedo : grey;
    memcpy(v->albedo, albedo, sizeof v->albedo);
    if (v->o.has_iso) v->isovalue = v->o.isovalue;
    else if (s) v->isovalue = s->isovalue;
    else if (v->shape) v->isovalue = v->shape->isovalue;
    else v->isovalue = volume_guess_isovalue(&v->volume, v->range);
    stat_line(v, "isovalue", "%.9g", v->isovalue);
}

/* ---- the camera and the lights ----------------------------------------------------------------------------------------------- */

static void place_camera(viewer *v) {
    const scene *s = v->o.scene;
    double toward[3] = {1.5, 1.2, 2.0}, up[3] = {0, 1, 0}, centre[3], corner[3], grid[3], eye[3], distance = 1 / sin(22.5 * PI / 180);
    if (v->o.has_up) memcpy(up, v->o.up, sizeof up);
    else if (s && vector_dot(s->up, s->up) > 0) memcpy(up, s->up, sizeof up);
    else if (!s && v->shape) memcpy(up, v->shape->up, sizeof up);
    vector_normalize(up);
    rotation_from_up(up, v->rotation);
    if (v->o.has_camera) {
        double azimuth = v->o.azimuth * PI / 180, elevation = v->o.elevation * PI / 180;
        toward[0] = sin(azimuth) * cos(elevation), toward[1] = sin(elevation), toward[2] = cos(azimuth) * cos(elevation);
        distance = v->o.distance;
    } else if (!s && v->shape) memcpy(toward, v->shape->toward, sizeof toward), distance = v->shape->distance;
    vector_normalize(toward);
    rotation_apply(v->rotation, toward, toward);
    for (int a = 0; a < 3; a++) grid[a] = 0.5 * (double)(v->volume.size[a] - 1);
    isogi_vol_to_world(v->pyramid, grid, centre);
    for (int a = 0; a < 3; a++) grid[a] = 0;
    isogi_vol_to_world(v->pyramid, grid, corner);
    for (int a = 0; a < 3; a++) corner[a] -= centre[a];
    v->radius = sqrt(vector_dot(corner, corner));
    for (int a = 0; a < 3; a++) eye[a] = centre[a] + toward[a] * distance * v->radius;
    v->centre_distance = distance * v->radius;
    camera_look(&v->view, v->o.width, v->o.height, eye, centre, up, 45);
}

static void add_light(viewer *v, const double toward[3], const float rgb[3], double degrees) {
    isogi_light *light = &v->o.lights[v->o.light_count++];
    double d[3];
    rotation_apply(v->rotation, toward, d);
    light->kind = ISOGI_LIGHT_DIRECTIONAL, light->radius = (float)(degrees * PI / 180);
    for (int i = 0; i < 3; i++) light->vector[i] = (float)d[i], light->rgb[i] = rgb[i];
}

static void set_sky(viewer *v, const float above[3], const float below[3]) {
    daylight_sky(v->sky, above, below);
    v->lighting.env.sh = v->sky[0], v->lighting.env.sh_order = 2;
}

static const float sky_above[3] = {0.90f, 1.0f, 1.15f}, sky_below[3] = {0.33f, 0.3f, 0.27f}; /* a slightly coloured sky */

static void set_default_light(viewer *v) {
    /* the neutral sky of the scene engine-block, and the coloured one for everything else */
    static const float sun[3] = {3.25f, 2.95f, 2.5f}, one[3] = {1, 1, 1};
    static const double diagonal[3] = {1, 1, 1};
    const scene *s = v->o.scene;
    if (s && s->lit && s->uniform_sky) set_sky(v, one, one);
    else if (s && s->rendered && v->o.mode >= DVR) {
        const float sky[3] = {s->dvr_sky, s->dvr_sky, s->dvr_sky};
        set_sky(v, sky, sky);
        if (s->sun[0] > 0) add_light(v, diagonal, s->sun, 0);
    } else if (s) set_sky(v, daylight_above, daylight_below), add_light(v, daylight_to_sun, daylight_sun, 1);
    else set_sky(v, sky_above, sky_below), add_light(v, daylight_to_sun, sun, 1);
}

static void add_scaled(double to[3], const float rgb[3], double factor) {
    for (int c = 0; c < 3; c++) to[c] += factor * (double)rgb[c];
}

/* Irradiance on a surface that faces n, with nothing in the way, from the environment alone. */
static void ambient_at(const viewer *v, const double n[3], double out[3]) {
    const double y[9] = {0.28209479177, 0.48860251190 * n[1], 0.48860251190 * n[2], 0.48860251190 * n[0], 1.09254843059 * n[0] * n[1],
                         1.09254843059 * n[1] * n[2], 0.31539156525 * (3 * n[2] * n[2] - 1), 1.09254843059 * n[0] * n[2],
                         0.54627421530 * (n[0] * n[0] - n[1] * n[1])};
    out[0] = out[1] = out[2] = 0;
    for (int i = 0; i < 9; i++) add_scaled(out, v->ambient[i], y[i]);
    for (int c = 0; c < 3; c++) out[c] = out[c] > 0 ? out[c] : 0;
}

/* What lambert and phong know of the environment: three bands, and the direction most light comes from. */
static int summarize_light(viewer *v) {
    isogi_lighting env = v->lighting;
    isogi_result result;
    env.lights = NULL, env.light_count = 0;
    result = isogi_sh_project(v->ambient[0], 3, &env, NULL);
    if (result != ISOGI_OK) return fail(v, "the light", result);
    for (int c = 0; c < 3; c++) v->key[c] = 0;
    for (int c = 0; c < 3; c++) v->mean_light[c] = (double)v->ambient[0][c] * 0.28209479177; /* radiance */
    for (int i = 1; i < 4; i++) v->key[i == 3 ? 0 : i] = picture_luminance(v->ambient[i]);
    if (!vector_normalize(v->key)) memcpy(v->key, v->view.up, sizeof v->key);
    result = isogi_sh_convolve_cosine(v->ambient[0], v->ambient[0], 3, 3);
    ambient_at(v, v->key, v->key_light);
    return result == ISOGI_OK || fail(v, "the light", result);
}

static int set_light(viewer *v) {
    const scene *s = v->o.scene;
    const char *env = v->o.env, *scene_env = s && v->o.mode != VICINITY ? (v->o.mode >= DVR && s->rendered ? s->dvr_env : s->env) : NULL;
    isogi_env *e = &v->lighting.env;
    int sky = env && !strcmp(env, "sky");
    isogi_result result;
    if (!env && !v->o.light_count && scene_env) {
        if (!data_path(v, scene_env)) return 0;
        env = v->path;
    }
    if (sky) set_sky(v, sky_above, sky_below);
    else if (env) {
        if (!hdr_read(env, &v->env, v->error)) return 0;
        if (v->env.width != 2 * v->env.height)
            fprintf(stderr, "note: %s is %d x %d, not twice as wide as high: it is taken for equirectangular all the same\n", env,
                    v->env.width, v->env.height);
        e->rgb = v->env.rgb, e->width = v->env.width, e->height = v->env.height;
    }
    for (int i = 0; i < 9; i++) e->rotation[i] = (float)v->rotation[i];
    if (v->o.mode == VICINITY) {
        static const float one[3] = {1, 1, 1};
        set_sky(v, one, one);
    } else if (!env && !v->o.light_count) set_default_light(v);
    v->lighting.lights = v->o.lights, v->lighting.light_count = v->o.light_count;
    result = isogi_lighting_validate(&v->lighting);
    if (result != ISOGI_OK) return fail(v, env ? env : "--light", result);
    for (size_t i = 0; v->o.mode == TRANSFER && i < v->o.light_count; i++)
        if (v->o.lights[i].kind != ISOGI_LIGHT_DIRECTIONAL)
            return file_fail(v->error, "--light: transfer knows distant light only: directional, or --env");
    return summarize_light(v);
}

/* ---- what every sample sees -------------------------------------------------------------------------------------------------- */

/* Places of the samples within a pixel: stratified in x and, by reversed bits, in y. */
static void sample_offset(const viewer *v, int sample, double *x, double *y) {
    double reversed = 0, half = 0.5, n = v->o.antialias;
    for (int i = sample; i; i >>= 1, half *= 0.5) reversed += half * (i & 1);
    *x = (sample + 0.5) / n - 0.5, *y = reversed + 0.5 / n - 0.5;
    if (v->o.antialias == 1) *x = *y = 0;
}

typedef struct view_job {
    viewer *v;
    int sample, trace; /* trace: rays find the surface; else it has been rasterized, and only sections are missing */
    double x_offset, y_offset, near_plane;
    isogi_counters *row_counters;
} view_job;

static void sample_ray(const view_job *job, int x, int y, float dir[3]) {
    double d[3];
    camera_direction(&job->v->view, x + job->x_offset, y + job->y_offset, d);
    for (int i = 0; i < 3; i++) dir[i] = (float)d[i];
}

/* Part of the ray within the box and the kept half space; 0 if there is none. */
static int visible_range(const view_job *job, const float dir[3], double *from, double *to) {
    const viewer *v = job->v;
    double far[3], a[3], b[3];
    *from = job->near_plane, *to = 1e30;
    for (int i = 0; i < 3; i++) far[i] = v->view.eye[i] + (double)dir[i];
    isogi_vol_to_grid(v->pyramid, v->view.eye, a);
    isogi_vol_to_grid(v->pyramid, far, b);
    for (int i = 0; i < 3; i++) {
        double d = b[i] - a[i], end = (double)(v->volume.size[i] - 1), near_t, far_t;
        if (fabs(d) < 1e-12) {
            if (a[i] < 0 || a[i] > end) return 0;
            continue;
        }
        near_t = (d > 0 ? -a[i] : end - a[i]) / d, far_t = (d > 0 ? end - a[i] : -a[i]) / d;
        *from = near_t > *from ? near_t : *from, *to = far_t < *to ? far_t : *to;
    }
    for (size_t k = 0; k < v->o.clip_count; k++) {
        const double *clip = v->o.clip[k];
        double rate = 0, start = vector_dot(clip, v->view.eye) + clip[3];
        for (int i = 0; i < 3; i++) rate += clip[i] * (double)dir[i];
        if (fabs(rate) < 1e-12 && start < 0) return 0;
        if (fabs(rate) < 1e-12) continue;
        if (rate > 0) *from = -start / rate > *from ? -start / rate : *from;
        else *to = -start / rate < *to ? -start / rate : *to;
    }
    return *from < *to;
}

static void point_at(const viewer *v, const float dir[3], double t, float p[3]) {
    for (int i = 0; i < 3; i++) p[i] = (float)(v->view.eye[i] + (double)dir[i] * t);
}

/* The field in double, as rays see it: a float holds neither 1e300 nor 1e9 + 1e-3. */
static double value_at(const viewer *v, const double world[3]) {
    double grid[3], corner[8];
    int cell[3];
    isogi_vol_to_grid(v->pyramid, world, grid);
    for (int a = 0; a < 3; a++) {
        const double last = (double)(v->volume.size[a] - 1);
        grid[a] = grid[a] > 0 ? grid[a] < last ? grid[a] : last : 0;
        cell[a] = grid[a] < last || !(last > 0) ? (int)grid[a] : (int)last - 1, grid[a] -= cell[a];
    }
    isogi_vol_corners(v->pyramid, cell, corner);
    for (int a = 0, n = 4; a < 3; a++, n /= 2)
        for (int k = 0; k < n; k++) corner[k] = (1 - grid[a]) * corner[2 * k] + grid[a] * corner[2 * k + 1];
    return corner[0];
}

static void view_row(void *arg, size_t row) {
    view_job *job = (view_job *)arg;
    viewer *v = job->v;
    int width = v->o.width;
    float *inverse = v->inverse[job->sample] + row * (size_t)width;
    uint32_t *seen = v->seen[job->sample] + row * (size_t)width;
    for (int x0 = 0; x0 < width; x0 += 64) {
        int n = width - x0 < 64 ? width - x0 : 64;
        isogi_ray rays[64];
        isogi_hit hits[64];
        double from[64], value[64];
        memset(rays, 0, sizeof rays);
        for (int i = 0; i < n; i++) {
            isogi_ray *r = &rays[i];
            double to;
            sample_ray(job, x0 + i, (int)row, r->dir);
            memcpy(r->origin, v->view.eye, sizeof r->origin);
            from[i] = -1, r->tmin = 1, r->tmax = 0.5, r->isovalue = v->isovalue; /* an empty range: a miss */
            if (!visible_range(job, r->dir, &from[i], &to)) from[i] = -1;
            else {
                double entry[3];
                r->tmin = from[i], r->tmax = to;
                for (int a = 0; a < 3; a++) entry[a] = v->view.eye[a] + (double)r->dir[a] * from[i];
                value[i] = value_at(v, entry);
            }
        }
        if (job->trace) isogi_vol_intersect(v->pyramid, rays, (size_t)n, hits, &job->row_counters[row]);
        for (int i = 0; i < n; i++) {
            if (job->trace) {
                inverse[x0 + i] = hits[i].side ? (float)(1 / hits[i].t) : 0;
                seen[x0 + i] = hits[i].side ? 0 : RASTER_NONE;
            }
            if (from[i] > job->near_plane && value[i] >= v->isovalue)
                inverse[x0 + i] = (float)(1 / from[i]), seen[x0 + i] = SECTION;
        }
    }
}

static int view_sample(viewer *v, int sample) {
    size_t rows = (size_t)v->o.height;
    view_job job = {.v = v, .sample = sample, .trace = v->o.raycast, .near_plane = 1e-4 * v->radius};
    isogi_result result = ISOGI_OK;
    job.row_counters = (isogi_counters *)calloc(rows, sizeof *job.row_counters);
    if (!job.row_counters) return fail(v, "the picture", ISOGI_NO_MEMORY);
    sample_offset(v, sample, &job.x_offset, &job.y_offset);
    if (!job.trace)
        result = raster_draw(&v->mesh, &v->view, job.x_offset, job.y_offset, (const double(*)[4])v->o.clip, v->o.clip_count, job.near_plane,
                             v->inverse[sample], v->seen[sample], &v->context);
    if (result == ISOGI_OK) result = isogi_parallel(&v->context, rows, view_row, &job, 0, 0);
    for (size_t i = 0; i < rows; i++) v->counters.rays += job.row_counters[i].rays;
    free(job.row_counters);
    return result == ISOGI_OK || fail(v, "the picture", result);
}

/* What a picture needs must leave half of the machine's memory. */
static int check_memory(viewer *v, double bytes_a_sample) {
    double bytes = (double)v->o.width * v->o.height * v->o.antialias * bytes_a_sample;
    double machine = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    return !(machine > 0 && bytes > machine / 2) ||
           file_fail(v->error, "--size %dx%d with --aa %d needs %.1f GiB of this machine's %.1f GiB", v->o.width, v->o.height,
                     v->o.antialias, bytes / 0x1p30, machine / 0x1p30);
}

static int view_surface(viewer *v) {
    size_t pixels = (size_t)v->o.width * (size_t)v->o.height;
    double begun = seconds();
    if (!check_memory(v, sizeof **v->inverse + sizeof **v->seen)) return 0;
    if (!v->o.raycast) {
        isogi_mesh_desc desc = {.isovalue = v->isovalue, .normals = 1};
        isogi_result result = isogi_vol_mesh(v->pyramid, &desc, &v->mesh);
        if (result != ISOGI_OK) return fail(v, "the mesh", result);
        begun = stat_seconds(v, "mesh", begun);
        stat_line(v, "vertices", "%zu", v->mesh.vertex_count);
        stat_line(v, "triangles", "%zu", v->mesh.triangle_count);
    }
    v->inverse = (float **)calloc((size_t)v->o.antialias, sizeof *v->inverse);
    v->seen = (uint32_t **)calloc((size_t)v->o.antialias, sizeof *v->seen);
    if (!v->inverse || !v->seen) return fail(v, "the picture", ISOGI_NO_MEMORY);
    for (int s = 0; s < v->o.antialias; s++) {
        v->inverse[s] = (float *)malloc(pixels * sizeof **v->inverse), v->seen[s] = (uint32_t *)malloc(pixels * sizeof **v->seen);
        if (!v->inverse[s] || !v->seen[s]) return fail(v, "the picture", ISOGI_NO_MEMORY);
        if (!view_sample(v, s)) return 0;
    }
    begun = stat_seconds(v, "view", begun);
    stat_line(v, "rays_view", "%llu", (unsigned long long)v->counters.rays);
    return 1;
}

/* ---- light baked into a texture, where the view looks ------------------------------------------------------------------------ */

/* Texels as close along every axis as voxels are along the one on which they are closest, up to four for a voxel: between slices that
   lie further apart the shadows of one would show as rings in the light of the next. Twice as close where voxels are so large in the
   picture that the steps of a shadow's edge, from texel to texel, would be seen. Scenes have their own. */
#define WIDE_VOXEL 5 /* pixels */
static void choose_lattice(const viewer *v, size_t lattice[3]) {
    const double pixel = 2 * v->view.scale * v->centre_distance / v->o.height; /* in the middle of the box */
    double spacing[3], least = HUGE_VAL;
    memcpy(lattice, v->o.lattice, sizeof v->o.lattice);
    if (lattice[0] || v->o.scene) return;
    for (int a = 0; a < 3; a++) {
        spacing[a] = v->volume.spacing[a] > 0 ? v->volume.spacing[a] : 1;
        if (v->volume.size[a] > 1 && spacing[a] < least) least = spacing[a];
    }
    if (least > WIDE_VOXEL * pixel) least /= 2;
    for (int a = 0; a < 3; a++)
        if (spacing[a] > least)
            lattice[a] = (size_t)ceil((double)(v->volume.size[a] - 1) * fmin(spacing[a] / least, 4)) + 1;
}

static isogi_trace_desc describe_trace(const viewer *v) {
    isogi_trace_desc desc = {.pyramid = v->pyramid, .lighting = v->lighting, .bounces = v->o.mode == VICINITY ? 0 : v->o.bounces,
                             .samples = v->o.samples, .lazy = 1};
    desc.lookup = (isogi_trace_lookup)v->o.lookup, desc.normals = (isogi_normal_kind)v->o.normals; /* names in the order of the enums */
    desc.storage = (isogi_trace_format)v->o.storage, desc.offset = (float)v->o.offset, desc.no_shadows = !v->o.shadows;
    if (v->o.has_offset && !(desc.offset > 0)) desc.offset = -1; /* on the surface; 0 would be the default */
    desc.reach = v->o.reach > 0 && v->o.reach < 1e-30 ? 1e-30f : (float)v->o.reach; /* 0 would be unlimited */
    desc.mode = v->o.mode == TRANSFER ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE;
    if (v->o.mode == TRANSFER) memset(&desc.lighting, 0, sizeof desc.lighting);
    memcpy(desc.albedo, v->albedo, sizeof desc.albedo);
    choose_lattice(v, desc.lattice);
    return desc;
}

static int request_seen(viewer *v) {
    float points[1024][3];
    size_t n = 0;
    isogi_result result = ISOGI_OK;
    for (int s = 0; s < v->o.antialias; s++) {
        view_job job = {.v = v, .sample = s};
        sample_offset(v, s, &job.x_offset, &job.y_offset);
        for (int y = 0; y < v->o.height; y++)
            for (int x = 0; x < v->o.width; x++) {
                size_t at = (size_t)y * (size_t)v->o.width + (size_t)x;
                float dir[3];
                if (v->seen[s][at] >= SECTION) continue;
                sample_ray(&job, x, y, dir);
                point_at(v, dir, 1 / (double)v->inverse[s][at], points[n++]);
                if (n == 1024) result = result == ISOGI_OK ? isogi_trace_request(v->trace, (const float(*)[3])points, n) : result, n = 0;
            }
    }
    if (n && result == ISOGI_OK) result = isogi_trace_request(v->trace, (const float(*)[3])points, n);
    return result == ISOGI_OK || fail(v, "the illumination texture", result);
}

static int bake(viewer *v) {
    isogi_trace_desc desc = describe_trace(v);
    isogi_counters done = {0};
    double begun = seconds(), remaining = 1, spent;
    uint64_t budget = 100000;
    isogi_result result;
    double bytes = sizeof(void *) / 64.0, machine = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    for (int a = 0; a < 3; a++) bytes *= (double)(desc.lattice[a] ? desc.lattice[a] : v->volume.size[a]);
    if (machine > 0 && bytes > machine / 8 && !v->o.lattice[0]) /* one per voxel has to do */
        for (int a = 0; a < 3; a++) bytes *= (double)v->volume.size[a] / (double)(desc.lattice[a] ? desc.lattice[a] : v->volume.size[a]),
                                    desc.lattice[a] = 0;
    if (machine > 0 && bytes > machine / 4)
        return file_fail(v->error, "--lattice: the table of its bricks alone needs %.1f GiB of this machine's %.1f GiB", bytes / 0x1p30,
                         machine / 0x1p30);
    result = isogi_trace_create(&v->trace, &desc, &v->context);
    if (result != ISOGI_OK) return fail(v, "the illumination texture", result);
    if (!request_seen(v)) return 0;
    begun = stat_seconds(v, "request", begun);
    while (result == ISOGI_OK && remaining > 0) {
        double step = seconds();
        result = isogi_trace_step(v->trace, budget, &remaining);
        step = seconds() - step;
        if (step < 0.1 && budget < (uint64_t)1 << 40) budget *= 2; /* between two looks at the clock: 0.1 to 0.3 s */
        else if (step > 0.3 && budget > 10000) budget /= 2;
        say(v, "baking light", 1 - remaining, begun);
    }
    if (result == ISOGI_OK && v->o.mode == TRANSFER) result = isogi_trace_relight(v->trace, &v->lighting);
    if (result != ISOGI_OK) return fail(v, "the illumination texture", result);
    isogi_trace_counters(v->trace, &done);
    spent = seconds() - begun;
    stat_seconds(v, "bake", begun);
    stat_line(v, "rays_light", "%llu", (unsigned long long)done.rays);
    stat_line(v, "rays_per_second", "%.6g", spent > 0 ? (double)done.rays / spent : 0);
    stat_line(v, "texels_requested", "%llu", (unsigned long long)(done.texels + done.texels_skipped));
    stat_line(v, "texels_computed", "%llu", (unsigned long long)done.texels);
    stat_line(v, "texels_skipped", "%llu", (unsigned long long)done.texels_skipped);
    stat_line(v, "texture_bytes", "%zu", isogi_trace_memory(v->trace));
    if (!done.texels && v->surface)
        fprintf(stderr, "note: no texel has a surface: the lattice is too coarse for this one, which stays black; see --lattice\n");
    return 1;
}

/* ---- colours of what is seen ------------------------------------------------------------------------------------------------- */

enum { BATCH = 4096, BAND = 16 }; /* samples shaded at once; rows of a task: a batch for path tracing sets up the light anew */
typedef struct shade_batch {
    size_t count, pixel[BATCH];
    uint32_t seen[BATCH];
    float point[BATCH][3], normal[BATCH][3], dir[BATCH][3], irradiance[BATCH][3], error[BATCH], gloss[BATCH][3],
        view[BATCH][3]; /* view: unit, to the eye */
} shade_batch;

typedef struct shade_job {
    view_job view;
    double *band_error, *band_light; /* sums over the lit samples of a band of rows, for the error estimate */
    isogi_result *band_result;
} shade_job;

static void mesh_normal(const viewer *v, uint32_t triangle, const float point[3], float n[3]) {
    double p[3] = {(double)point[0], (double)point[1], (double)point[2]}, w[3], sum[3] = {0, 0, 0};
    raster_weights(&v->mesh, triangle, p, w);
    for (int k = 0; k < 3; k++) add_scaled(sum, v->mesh.normals[v->mesh.triangles[triangle][k]], w[k]);
    if (!vector_normalize(sum)) memset(sum, 0, sizeof sum);
    for (int i = 0; i < 3; i++) n[i] = (float)sum[i];
}

/* Normal of the plane through which the view entered: a clip plane or a side of the box. */
static void section_normal(const viewer *v, const float point[3], double n[3]) {
    double p[3] = {(double)point[0], (double)point[1], (double)point[2]}, grid[3], nearest = 1e30;
    for (size_t k = 0; k < v->o.clip_count; k++) {
        const double *clip = v->o.clip[k];
        double length = sqrt(vector_dot(clip, clip)), distance = fabs(vector_dot(clip, p) + clip[3]) / length / v->radius * 100;
        if (!(distance < nearest)) continue;
        nearest = distance;
        for (int i = 0; i < 3; i++) n[i] = -clip[i] / length;
    }
    isogi_vol_to_grid(v->pyramid, p, grid);
    for (int i = 0; i < 3; i++) {
        double end = (double)(v->volume.size[i] - 1), distance[2] = {fabs(grid[i]) / end * 100, fabs(grid[i] - end) / end * 100};
        for (int side = 0; side < 2; side++)
            if (distance[side] < nearest) {
                nearest = distance[side];
                n[0] = n[1] = n[2] = 0, n[i] = side ? 1 : -1;
            }
    }
}

static void surface_normals(const viewer *v, shade_batch *b) {
    if (v->o.raycast) {
        isogi_vol_sample_smooth(v->pyramid, (const float(*)[3])b->point, b->count, NULL, b->normal);
        for (size_t i = 0; i < b->count; i++) {
            double n[3] = {-(double)b->normal[i][0], -(double)b->normal[i][1], -(double)b->normal[i][2]};
            if (!isfinite(n[0] + n[1] + n[2])) { /* beside voxels that are not finite */
                isogi_vol_sample(v->pyramid, (const float(*)[3])&b->point[i], 1, NULL, &b->normal[i]);
                for (int k = 0; k < 3; k++) n[k] = -(double)b->normal[i][k];
            }
            if (!vector_normalize(n)) memset(n, 0, sizeof n);
            for (int k = 0; k < 3; k++) b->normal[i][k] = (float)n[k];
        }
        return;
    }
    for (size_t i = 0; i < b->count; i++)
        if (b->seen[i] < SECTION) mesh_normal(v, b->seen[i], b->point[i], b->normal[i]);
}

/* Direction from a point to a light, and the irradiance on a surface that faces it. */
static void toward_light(const isogi_light *light, const float point[3], double to[3], double *strength) {
    *strength = 1;
    for (int i = 0; i < 3; i++) to[i] = (double)light->vector[i] - (light->kind == ISOGI_LIGHT_DIRECTIONAL ? 0 : (double)point[i]);
    if (light->kind != ISOGI_LIGHT_DIRECTIONAL) *strength = 1 / (vector_dot(to, to) + 1e-30);
    vector_normalize(to);
    if (light->kind == ISOGI_LIGHT_RECTANGLE) { /* as from its centre */
        double facing = 0, area = 0;
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            double n = (double)light->edge[0][j] * (double)light->edge[1][k] - (double)light->edge[0][k] * (double)light->edge[1][j];
            facing -= n * to[i], area += n * n;
        }
        *strength *= facing > 0 ? facing / sqrt(area) : 0;
    }
}

/* The same with the light's shadow on a surface of that normal, where shadows are asked for: one ray, half a voxel above the surface. */
static void shadowed_light(const viewer *v, const isogi_light *light, const float point[3], const double n[3], double to[3],
                           double *strength) {
    isogi_ray ray = {.isovalue = v->isovalue};
    double distance = 0, voxel = fmin(v->volume.spacing[0], fmin(v->volume.spacing[1], v->volume.spacing[2]));
    uint8_t blocked = 0;
    toward_light(light, point, to, strength);
    if (!v->o.shadows || !(vector_dot(to, n) > 0)) return;
    for (int i = 0; i < 3; i++) {
        double d = (double)light->vector[i] - (double)point[i];
        ray.origin[i] = (double)point[i] + 0.5 * voxel * n[i], ray.dir[i] = (float)to[i], distance += d * d;
    }
    if (light->kind != ISOGI_LIGHT_DIRECTIONAL) ray.tmax = sqrt(distance);
    isogi_vol_occluded(v->pyramid, &ray, 1, &blocked, NULL);
    if (blocked) *strength = 0;
}

static double clamped_cosine(const double a[3], const double b[3]) {
    double c = vector_dot(a, b);
    return c > 0 ? c : 0;
}

/* Light by the normal alone: the environment as it would arrive unshadowed, every light by Lambert's law. */
static void lambert(const viewer *v, const float point[3], const double n[3], int by_normal, int shadows, double irradiance[3]) {
    ambient_at(v, n, irradiance);
    for (int i = 0; i < 3 && !by_normal; i++) irradiance[i] = PI * v->mean_light[i];
    for (size_t k = 0; k < v->o.light_count; k++) {
        double to[3], strength;
        if (shadows) shadowed_light(v, &v->o.lights[k], point, n, to, &strength);
        else toward_light(&v->o.lights[k], point, to, &strength);
        add_scaled(irradiance, v->o.lights[k].rgb, strength * clamped_cosine(n, to));
    }
}

/* Phong 1975: a constant ambient term, half the mean light (or one by normal), the lights (or where there are none, the direction most of
   the environment comes from), and a highlight of exponent 32 that reflects a fifth. Adds the highlight to specular. */
static void phong(const viewer *v, const float point[3], const double n[3], const float dir[3], double irradiance[3], double specular[3]) {
    double view[3] = {-(double)dir[0], -(double)dir[1], -(double)dir[2]}, reflected[3], facing;
    size_t count = v->o.light_count ? v->o.light_count : 1;
    vector_normalize(view);
    facing = 2 * vector_dot(n, view);
    for (int i = 0; i < 3; i++) reflected[i] = facing * n[i] - view[i], irradiance[i] = 0.5 * PI * v->mean_light[i];
    if (v->o.ambient) ambient_at(v, n, irradiance);
    for (size_t k = 0; k < count; k++) {
        double to[3], strength = 1, cosine, highlight;
        float rgb[3];
        isogi_light key = {.kind = ISOGI_LIGHT_DIRECTIONAL};
        const isogi_light *light = v->o.light_count ? &v->o.lights[k] : &key;
        for (int i = 0; i < 3; i++) key.vector[i] = (float)v->key[i], key.rgb[i] = (float)v->key_light[i];
        shadowed_light(v, light, point, n, to, &strength), memcpy(rgb, light->rgb, sizeof rgb);
        cosine = clamped_cosine(n, to);
        if (!v->o.ambient || light != &key) add_scaled(irradiance, rgb, strength * cosine); /* else it is in the ambient light already */
        highlight = cosine > 0 ? pow(clamped_cosine(reflected, to), 32) : 0;
        add_scaled(specular, rgb, strength * 0.2 * highlight * (32 + 2) / (2 * PI));
    }
}

/* Where matter is cut, its inside has no light of its own: it shows the data, from the isovalue up, under unshadowed light. */
static void section_colour(const viewer *v, const float point[3], float rgb[3]) {
    const double world[3] = {(double)point[0], (double)point[1], (double)point[2]};
    double n[3], light[3], top = v->range[1] - v->isovalue, s;
    section_normal(v, point, n);
    s = top > 0 ? (value_at(v, world) - v->isovalue) / top : 1;
    s = s > 0 ? (s < 1 ? s : 1) : 0;
    if (v->o.mode == VICINITY) light[0] = light[1] = light[2] = PI;
    else lambert(v, point, n, 1, 0, light);
    for (int c = 0; c < 3; c++) {
        /* half of the light's colour and of the surface's colour: a section is drawn, not photographed */
        double grey = (light[0] + light[1] + light[2]) / 3, mean = (double)(v->albedo[0] + v->albedo[1] + v->albedo[2]) / 3;
        rgb[c] = (float)((0.5 * light[c] + 0.5 * grey) / PI * (0.5 * (double)v->albedo[c] + 0.5 * mean) * (0.4 + 0.5 * s));
    }
}

/* OpenGL's exponential fog, in the colour of the sky's mean light. */
static void fog(const viewer *v, const float point[3], float rgb[3]) {
    double to[3], distance = 0, clear;
    for (int i = 0; i < 3; i++) to[i] = (double)point[i] - v->view.eye[i], distance += to[i] * v->view.forward[i];
    clear = exp(-v->o.fog * fmax(0, distance - v->centre_distance + v->radius) / (2 * v->radius));
    for (int i = 0; i < 3; i++) rgb[i] = (float)(clear * (double)rgb[i] + (1 - clear) * v->mean_light[i]);
}

static void shade_sample(const viewer *v, shade_batch *b, size_t i, float rgb[3]) {
    double n[3] = {(double)b->normal[i][0], (double)b->normal[i][1], (double)b->normal[i][2]}, light[3], specular[3] = {0, 0, 0};
    if (b->seen[i] == SECTION) {
        section_colour(v, b->point[i], rgb);
        if (v->o.fog > 0) fog(v, b->point[i], rgb);
        return;
    }
    if (v->o.mode == LAMBERT) lambert(v, b->point[i], n, v->o.ambient, v->o.shadows, light);
    else if (v->o.mode == PHONG) phong(v, b->point[i], n, b->dir[i], light, specular);
    else for (int c = 0; c < 3; c++) light[c] = (double)b->irradiance[i][c] > 0 ? (double)b->irradiance[i][c] : 0;
    for (int c = 0; c < 3 && v->o.has_gloss; c++) specular[c] = 0.2 * (double)b->gloss[i][c];
    for (int c = 0; c < 3; c++) rgb[c] = (float)((double)v->albedo[c] * light[c] / PI + specular[c]);
    if (v->o.fog > 0) fog(v, b->point[i], rgb);
}

static isogi_result gloss_batch(const viewer *v, shade_batch *b) {
    surface_normals(v, b);
    for (size_t i = 0; i < b->count; i++) {
        double to[3] = {-(double)b->dir[i][0], -(double)b->dir[i][1], -(double)b->dir[i][2]};
        vector_normalize(to);
        for (int c = 0; c < 3; c++) b->view[i][c] = (float)to[c];
    }
    return isogi_trace_sample_gloss(v->trace, (const float(*)[3])b->point, (const float(*)[3])b->normal, (const float(*)[3])b->view,
                                    v->o.gloss, b->count, b->gloss);
}

static isogi_result light_batch(const shade_job *job, shade_batch *b) {
    const viewer *v = job->view.v;
    isogi_trace_desc desc;
    isogi_context serial = v->context;
    if (v->o.mode <= PHONG) return ISOGI_OK;
    if (v->trace) {
        isogi_result result = isogi_trace_sample(v->trace, (const float(*)[3])b->point, b->count, b->irradiance, b->error);
        return v->o.has_gloss && result == ISOGI_OK ? gloss_batch(v, b) : result;
    }
    desc = describe_trace(v);
    serial.threads = 1, serial.progress = NULL;
    desc.seed = ((uint64_t)job->view.sample << 32) + b->pixel[0]; /* each batch its own random numbers */
    desc.samples = (v->o.samples + v->o.antialias - 1) / v->o.antialias;
    return isogi_trace_gather(&desc, (const float(*)[3])b->point, NULL, b->count, b->irradiance, b->error, &serial);
}

/* So many samples of points are done; whoever comes while another thread tells of it goes on. */
static void say_traced(viewer *v, size_t count) {
    uint64_t done = __atomic_add_fetch(&v->traced, count, __ATOMIC_RELAXED);
    if (v->o.mode != PATHTRACE || __atomic_test_and_set(&v->saying, __ATOMIC_ACQUIRE)) return;
    say(v, "tracing paths", (double)done / (double)(v->covered ? v->covered : 1), v->tracing_begun);
    __atomic_clear(&v->saying, __ATOMIC_RELEASE);
}

static isogi_result shade_batch_now(shade_job *job, shade_batch *b, size_t band) {
    viewer *v = job->view.v;
    isogi_result result;
    if (!b->count) return ISOGI_OK;
    if (v->o.mode <= PHONG) surface_normals(v, b);
    result = light_batch(job, b);
    for (size_t i = 0; result == ISOGI_OK && i < b->count; i++) {
        float rgb[3], *out = v->picture[b->pixel[i]];
        shade_sample(v, b, i, rgb);
        for (int c = 0; c < 3; c++) out[c] += rgb[c] / (float)v->o.antialias;
        out[3] += 1 / (float)v->o.antialias;
        if (v->o.mode <= PHONG || b->seen[i] == SECTION || !(b->error[i] < 1e30f)) continue;
        job->band_error[band] += (double)b->error[i];
        job->band_light[band] += picture_luminance(b->irradiance[i]);
    }
    say_traced(v, b->count);
    b->count = 0;
    return result;
}

static void shade_band(void *arg, size_t band) {
    shade_job *job = (shade_job *)arg;
    const viewer *v = job->view.v;
    const float *inverse = v->inverse[job->view.sample];
    const uint32_t *seen = v->seen[job->view.sample];
    size_t width = (size_t)v->o.width, at = band * BAND * width, end = at + BAND * width;
    /* where a point takes long, fewer at a time, so that there is progress to tell of */
    size_t most = ((size_t)1 << 20) / (size_t)(v->o.samples / v->o.antialias + 1), batch = v->o.mode != PATHTRACE || most > BATCH ? BATCH
        : most > 4 ? most : 4;
    isogi_result result = ISOGI_OK;
    shade_batch *b = (shade_batch *)malloc(sizeof *b);
    if (!b) {
        job->band_result[band] = ISOGI_NO_MEMORY;
        return;
    }
    if (end > width * (size_t)v->o.height) end = width * (size_t)v->o.height;
    b->count = 0;
    for (; at < end && result == ISOGI_OK; at++) {
        size_t i = b->count;
        if (seen[at] == RASTER_NONE) continue;
        sample_ray(&job->view, (int)(at % width), (int)(at / width), b->dir[i]);
        point_at(v, b->dir[i], 1 / (double)inverse[at], b->point[i]);
        b->pixel[i] = at, b->seen[i] = seen[at], b->count++;
        if (b->count == batch) result = shade_batch_now(job, b, band);
    }
    if (result == ISOGI_OK) result = shade_batch_now(job, b, band);
    job->band_result[band] = result;
    free(b);
}

static int shade_surface(viewer *v) {
    size_t bands = ((size_t)v->o.height + BAND - 1) / BAND;
    double begun = seconds(), error = 0, light = 0;
    isogi_result result = ISOGI_OK;
    shade_job job = {.view = {.v = v}};
    v->tracing_begun = begun;
    job.band_error = (double *)calloc(bands, sizeof *job.band_error), job.band_light = (double *)calloc(bands, sizeof *job.band_light);
    job.band_result = (isogi_result *)calloc(bands, sizeof *job.band_result);
    if (!job.band_error || !job.band_light || !job.band_result) result = ISOGI_NO_MEMORY;
    for (int s = 0; s < v->o.antialias && result == ISOGI_OK; s++) {
        job.view.sample = s;
        sample_offset(v, s, &job.view.x_offset, &job.view.y_offset);
        result = isogi_parallel(&v->context, bands, shade_band, &job, 0, 0);
    }
    for (size_t band = 0; band < bands && result == ISOGI_OK; band++)
        result = job.band_result[band], error += job.band_error[band], light += job.band_light[band];
    free(job.band_error), free(job.band_light), free(job.band_result);
    if (result != ISOGI_OK) return fail(v, "the light", result);
    stat_seconds(v, "shade", begun);
    /* one path tells nothing about its own error: then nothing is known */
    if (v->o.mode > PHONG && light > 0)
        stat_line(v, "error_relative", "%.4g", error / light / (v->o.mode == PATHTRACE ? sqrt((double)v->o.antialias) : 1));
    else if (v->o.mode > PHONG) stat_line(v, "error_relative", "unknown");
    return 1;
}

/* ---- volume rendering -------------------------------------------------------------------------------------------------------- */

/* As a transfer file has them. Returns the text's end. */
static char *points_as_text(const isogi_transfer_point *points, int count, char *at, const char *end) {
    for (int i = 0; i < count; i++)
        at += snprintf(at, (size_t)(end - at), "%.17g %.9g %.6f %.6f %.6f\n", points[i].value, (double)points[i].extinction,
                       (double)points[i].rgb[0], (double)points[i].rgb[1], (double)points[i].rgb[2]);
    return at;
}

static const double DENSEST = 9.9e29; /* a file may say 1e30, and as a float that is more */

/* For a volume of which nothing is known: what its histogram suggests. In data space with the isosurface that is asked for, or the one that
   bounds the second class of values; what stands between surfaces is thin then. */
static int default_transfer(viewer *v) {
    isogi_transfer_point points[ISOGI_SUGGEST_POINTS];
    isogi_dvr_space space = v->o.mode == DVR ? ISOGI_DVR_PHYSICAL : ISOGI_DVR_DATA;
    char text[4096], *at, *end = text + sizeof text;
    double threshold;
    isogi_result result = isogi_transfer_suggest(v->pyramid, space, points, &threshold);
    if (result != ISOGI_OK) return fail(v, "a transfer function", result);
    if (v->o.has_iso || v->shape) threshold = v->isovalue;
    for (int i = 0; i < ISOGI_SUGGEST_POINTS; i++)
        points[i].extinction = (float)fmin((double)points[i].extinction * (space ? 0.4 : 1), DENSEST);
    at = points_as_text(points, ISOGI_SUGGEST_POINTS, text, end);
    if (space == ISOGI_DVR_DATA) snprintf(at, (size_t)(end - at), "peak %.17g .6 .95 .88 .75\n", threshold);
    return transfer_parse(text, &v->transfer, v->error);
}

/* A preset's colours from where the second class of values is suggested to begin; as dense as what is suggested. */
static int preset_transfer(viewer *v) {
    isogi_transfer_point points[ISOGI_SUGGEST_POINTS > ISOGI_PRESET_POINTS ? ISOGI_SUGGEST_POINTS : ISOGI_PRESET_POINTS];
    char text[4096];
    isogi_result result = isogi_transfer_suggest(v->pyramid, v->o.mode == DVR ? ISOGI_DVR_PHYSICAL : ISOGI_DVR_DATA, points, NULL);
    if (result != ISOGI_OK) return fail(v, "--preset: what the volume's values suggest", result);
    result = isogi_transfer_preset((isogi_preset)v->o.preset, points[1].value, points[5].value,
                                   (float)fmin((double)points[v->o.mode == DVR ? 4 : 5].extinction, DENSEST), points);
    if (result != ISOGI_OK) return file_fail(v->error, "--preset: the volume has a single value");
    points_as_text(points, ISOGI_PRESET_POINTS, text, text + sizeof text);
    return transfer_parse(text, &v->transfer, v->error);
}

static int set_transfer(viewer *v) {
    const scene *s = v->o.scene;
    int ok, suggested = 0;
    const char *text = s && s->transfer ? s->transfer : v->shape && (v->o.mode == DVR || !strncmp(v->shape->transfer, "peak", 4))
        ? v->shape->transfer : NULL;
    if (v->o.tf) ok = transfer_read(v->o.tf, &v->transfer, v->error);
    else if (v->o.has_preset) ok = preset_transfer(v);
    else if (text && (v->o.mode == DVR || !strncmp(text, "peak", 4))) ok = transfer_parse(text, &v->transfer, v->error);
    else ok = default_transfer(v), suggested = 1;
    return ok && check_transfer(v, suggested);
}

/* Portable float map: the lowest row first, little-endian. Of the factor * factor samples of a pixel the nearest. */
static int write_depth(viewer *v, const float *depth, int factor) {
    size_t width = (size_t)v->o.width, height = (size_t)v->o.height, f = (size_t)factor, size;
    unsigned char *file = (unsigned char *)malloc(64 + 4 * width * height), *at;
    int ok;
    if (!file) return fail(v, "--depth", ISOGI_NO_MEMORY);
    at = file + sprintf((char *)file, "Pf\n%zu %zu\n-1.0\n", width, height);
    for (size_t y = height; y-- > 0;)
        for (size_t x = 0; x < width; x++, at += 4) {
            float nearest = INFINITY;
            uint32_t bits;
            for (size_t i = 0; i < f * f; i++) nearest = fminf(nearest, depth[(y * f + i / f) * width * f + x * f + i % f]);
            memcpy(&bits, &nearest, sizeof bits);
            for (int i = 0; i < 4; i++) at[i] = (unsigned char)(bits >> 8 * i);
        }
    size = (size_t)(at - file);
    ok = file_write(v->o.depth, file, size, v->error);
    free(file);
    return ok;
}

/* Shadows of the sun want more than the header's defaults, which are for pictures in motion; sweeps have it in about a second. Of few
   voxels the lattice of sweeps holds each, and so does the grid: with every second one surfaces that are opaque from voxel to voxel are lit
   in blotches, and smooth ones in rings. */
static void set_visibility(const viewer *v, isogi_dvr_desc *desc) {
    const scene *s = v->o.scene && v->o.scene->order ? v->o.scene : NULL;
    int swept = v->o.mode == DVR && !v->transfer.peak_count && v->o.method != ISOGI_DVR_BRUTE && v->o.method != ISOGI_DVR_PAPER;
    desc->order = v->o.order ? v->o.order : s ? s->order : swept ? 4 : 0;
    desc->directions = v->o.directions ? v->o.directions : s ? s->directions : swept ? 256 : 0;
    desc->coarsest = 1 << v->o.coarsest;
    int few = v->volume.size[0] * v->volume.size[1] * v->volume.size[2] <= (size_t)1 << 22;
    if (swept && few) desc->visibility_step = 1;
    for (int a = 0; a < 3; a++) {
        size_t points = few ? v->volume.size[a] : (v->volume.size[a] + 1) / 2;
        desc->grid[a] = v->o.grid[a] ? v->o.grid[a] : s ? s->grid[a] : !swept ? 0 : points < 128 ? points : 128;
    }
}

static int tell_stage(void *user, double fraction) {
    viewer *v = (viewer *)user;
    if (v->stage) say(v, v->stage, fraction, v->stage_begun);
    return 0;
}

static void forget_view(viewer *v) {
    for (int s = 0; s < v->o.antialias; s++) {
        if (v->inverse) free(v->inverse[s]);
        if (v->seen) free(v->seen[s]);
    }
    free(v->inverse), free(v->seen), v->inverse = NULL, v->seen = NULL;
}

/* The opaque isosurface among the matter, a sample in each pixel of a picture that is `factor` times as large, and how far off it is. */
static int draw_surface(viewer *v, int factor, float (*picture)[4], float *until) {
    const options given = v->o;
    const camera view = v->view;
    const double isovalue = v->isovalue;
    const uint64_t rays = v->counters.rays;
    float(*const small)[4] = v->picture;
    size_t seen = 0;
    int ok;
    v->counters.rays = 0;
    v->o.mode = LAMBERT, v->o.antialias = v->o.shadows = v->o.ambient = v->o.raycast = 1, v->isovalue = v->o.surface, v->picture = picture;
    v->o.width *= factor, v->o.height *= factor, v->view.width *= factor, v->view.height *= factor;
    ok = view_surface(v) && shade_surface(v);
    for (int y = 0; ok && y < v->o.height; y++)
        for (int x = 0; x < v->o.width; x++) {
            size_t i = (size_t)y * (size_t)v->o.width + (size_t)x;
            double d[3];
            camera_direction(&v->view, x, y, d);
            until[i] = v->seen[0][i] == RASTER_NONE ? INFINITY : (float)(sqrt(vector_dot(d, d)) / (double)v->inverse[0][i]);
            until[i] *= 1 - 1e-6f; /* rounded away, it would let matter be seen that begins there */
            seen += v->seen[0][i] != RASTER_NONE;
        }
    if (ok && !seen) fprintf(stderr, "note: no surface is in view at --surface %.9g (the data range from %.9g to %.9g)\n", v->isovalue,
                             v->range[0], v->range[1]);
    forget_view(v);
    v->counters.rays += rays, v->o = given, v->view = view, v->isovalue = isovalue, v->picture = small;
    return ok;
}

/* Matter over the surface behind it. */
static void put_over(float (*matter)[4], float *depth, const float (*surface)[4], const float *until, size_t pixels) {
    for (size_t i = 0; i < pixels; i++) {
        if (depth && matter[i][3] < 0.5f && until[i] < 1e30f) depth[i] = until[i];
        for (int c = 0; c < 4; c++) matter[i][c] += (1 - matter[i][3]) * surface[i][c]; /* opacity last */
    }
}

static int render_volume(viewer *v) {
    isogi_dvr_desc desc = {.pyramid = v->pyramid, .space = v->o.mode == DVR ? ISOGI_DVR_PHYSICAL : ISOGI_DVR_DATA,
                           .shading = v->o.mode == DVR ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_LOCAL};
    int factor = (int)(sqrt((double)v->o.antialias) + 1e-9);
    isogi_view view = {.width = v->o.width * factor, .height = v->o.height * factor, .local = v->o.local};
    size_t pixels = (size_t)view.width * (size_t)view.height;
    float(*large)[4] = NULL, (*surface)[4] = NULL, *depth = NULL, *until = NULL;
    int ok = 1;
    isogi_dvr *dvr = NULL;
    double begun = seconds(), remaining = 1;
    isogi_result result;
    isogi_context context = v->context;
    isogi_dvr_report report;
    const char *at_fault = "volume rendering";
    if (view.width > 32768 || view.height > 32768)
        return file_fail(v->error, "--size %dx%d with --aa %d is %dx%d samples; at most 32768 along a side", v->o.width, v->o.height,
                         v->o.antialias, view.width, view.height);
    /* our pixels and those of the library, with depth, and what is behind them */
    if (!check_memory(v, (double)(factor * factor) / v->o.antialias *
                             ((1.0 + v->o.has_surface) * (double)(sizeof *large + sizeof *depth) + 20))) return 0;
    context.progress = tell_stage;
    if (v->o.has_shading) desc.shading = (isogi_dvr_shading)v->o.shading;
    desc.classification = (isogi_dvr_classification)v->o.classification, desc.silhouette = (isogi_dvr_silhouette)v->o.silhouette,
    desc.step = v->o.step, desc.bound = v->o.bound;
    desc.method = (isogi_dvr_method)v->o.method;
    for (int i = 0; i < 3; i++) {
        desc.material[i].exponent = i < 2 || v->o.transmission == 2 ? 30 : 0;
        for (int c = 0; c < 3; c++) desc.material[i].specular[c] = 1, desc.material[i].diffuse[c] = i < 2 || v->o.transmission ? 1 : 1e-20f;
    }
    for (int i = 0; i < 3; i++)
        view.eye[i] = (float)v->view.eye[i], view.target[i] = (float)v->view.target[i], view.up[i] = (float)v->view.up[i];
    if (!set_transfer(v)) return 0;
    set_visibility(v, &desc);
    result = isogi_dvr_create(&dvr, &desc, &context);
    if (v->o.has_spacing && result == ISOGI_TOO_LARGE) at_fault = "steps of the shortest --spacing on a ray";
    if (v->o.has_step && result == ISOGI_TOO_LARGE) at_fault = v->o.grid[0] ? "--step or --grid" : "--step: samples on a ray";
    if (result == ISOGI_OK) result = isogi_dvr_set_transfer(dvr, &v->transfer.transfer);
    if (result == ISOGI_OK) result = isogi_dvr_set_clip(dvr, (const double(*)[4])v->o.clip, v->o.clip_count);
    for (uint64_t budget = 20000; result == ISOGI_OK && remaining > 0 && desc.shading == ISOGI_DVR_VISIBILITY; budget += budget / 4) {
        result = isogi_dvr_step(dvr, budget, &remaining);
        say(v, "visibility", 1 - remaining, begun);
    }
    if (v->o.grid[0] && (result == ISOGI_NO_MEMORY || (result == ISOGI_TOO_LARGE && !v->o.has_step))) at_fault = "--grid";
    begun = stat_seconds(v, "visibility", begun);
    if (result == ISOGI_OK) isogi_dvr_counters(dvr, &v->counters);
    stat_line(v, "rays_light", "%llu", (unsigned long long)v->counters.rays);
    if (result == ISOGI_OK && isogi_dvr_inspect(dvr, &report) == ISOGI_OK && report.grid_points)
        stat_line(v, "visibility_points", "%zu", report.grid_points);
    large = (float(*)[4])malloc(pixels * sizeof *large);
    if (v->o.depth) depth = (float *)malloc(pixels * sizeof *depth);
    if (v->o.has_surface) surface = (float(*)[4])calloc(pixels, sizeof *surface), until = (float *)malloc(pixels * sizeof *until);
    if (result == ISOGI_OK && (!large || (v->o.depth && !depth) || (v->o.has_surface && (!surface || !until)))) result = ISOGI_NO_MEMORY;
    if (surface) stat_line(v, "surface", "%.9g", v->o.surface);
    if (result == ISOGI_OK && surface) ok = draw_surface(v, factor, surface, until), view.until = until, begun = seconds();
    v->stage = "picture", v->stage_begun = begun;
    if (result == ISOGI_OK && ok) result = isogi_dvr_render(dvr, &view, &v->lighting, large, depth, &v->counters);
    if (result == ISOGI_OK && ok && surface) put_over(large, depth, (const float(*)[4])surface, until, pixels);
    for (size_t i = 0; ok && result == ISOGI_OK && i < pixels; i++) {
        size_t x = i % (size_t)view.width / (size_t)factor, y = i / (size_t)view.width / (size_t)factor;
        for (int c = 0; c < 4; c++) v->picture[y * (size_t)v->o.width + x][c] += large[i][c] / (float)(factor * factor);
    }
    if (result == ISOGI_OK && ok && depth) ok = write_depth(v, depth, factor);
    free(large), free(surface), free(depth), free(until);
    isogi_dvr_free(dvr);
    if (!ok) return 0;
    stat_seconds(v, "render", begun);
    stat_line(v, "samples_view", "%llu", (unsigned long long)v->counters.samples);
    return result == ISOGI_OK || fail(v, at_fault, result);
}

/* ---- the picture ------------------------------------------------------------------------------------------------------------- */

/* A studio backdrop in display light: darker below, lighter behind the object, tinted by the environment. */
static void backdrop(const viewer *v, int x, int y, double out[3]) {
    double d[3], above, aside, strength, tint = (v->mean_light[0] + v->mean_light[1] + v->mean_light[2]) / 3;
    camera_direction(&v->view, x, y, d);
    above = (vector_dot(d, v->view.up) / v->view.scale), aside = vector_dot(d, v->view.right) / v->view.scale;
    strength = 0.03 + 0.075 * exp(-0.8 * ((above + 0.1) * (above + 0.1) + 0.6 * aside * aside)) + 0.015 * above;
    for (int c = 0; c < 3; c++) {
        static const double slate[3] = {0.94, 1.0, 1.1};
        double colour = tint > 0 ? v->mean_light[c] / tint : 1;
        out[c] = strength * slate[c] * (0.75 + 0.25 * (colour < 2 ? colour : 2));
    }
}

/* The picture to compare with: read before the work, so that one that cannot be used is known at once. */
static int read_compared(viewer *v) {
    unsigned char *file;
    int shape[3] = {0}, ok;
    size_t size;
    char why[FILE_ERROR_SIZE];
    if (!file_read(v->o.compare, (size_t)1 << 30, &file, &size, v->error)) return 0;
    ok = png_decode(file, size, &v->compared, shape, why) || file_fail(v->error, "%.200s: %.250s", v->o.compare, why);
    free(file);
    if (!ok) return v->compared = NULL, 0;
    return (shape[0] == v->o.width && shape[1] == v->o.height && shape[2] == 3) ||
           file_fail(v->error, "%s: is not %dx%d in colour", v->o.compare, v->o.width, v->o.height);
}

/* How far the picture is from it, over the pixels that show something. */
static void compare_picture(const viewer *v, const unsigned char *bytes) {
    const unsigned char *other = v->compared;
    size_t seen = 0;
    double sum = 0;
    for (size_t i = 0; i < (size_t)v->o.width * (size_t)v->o.height; i++) {
        if (!(v->picture[i][3] > 0)) continue;
        seen++;
        for (int c = 0; c < 3; c++) sum += pow((bytes[3 * i + (size_t)c] - other[3 * i + (size_t)c]) / 255.0, 2) / 3;
    }
    printf("difference_rms %.6f\n", seen ? sqrt(sum / (double)seen) : 0);
}

/* Into bytes; how much brighter what is seen is than what the picture to compare with, if any, has there: the sum of all values. */
static double expose_picture(const viewer *v, double exposure, unsigned char *bytes) {
    double sum = 0;
    for (size_t i = 0; i < (size_t)v->o.width * (size_t)v->o.height; i++) {
        double behind[3];
        backdrop(v, (int)(i % (size_t)v->o.width), (int)(i / (size_t)v->o.width), behind);
        picture_pixel(v->picture[i], exposure, behind, bytes + 3 * i);
        for (size_t c = 3 * i; v->compared && v->picture[i][3] > 0 && c < 3 * i + 3; c++) sum += bytes[c] - v->compared[c];
    }
    return sum;
}

/* A picture in which everything is black has the wrong light; rendered matter of which nothing is seen, something else that is wrong. */
static void note_darkness(const viewer *v) {
    size_t seen = 0;
    for (size_t i = 0; i < (size_t)v->o.width * (size_t)v->o.height; i++) {
        const float *p = v->picture[i];
        if (p[0] > 0 || p[1] > 0 || p[2] > 0) return;
        seen += p[3] > 0;
    }
    if (seen) fprintf(stderr, "note: all that is seen is black: no light reaches it, or its colour is black\n");
    else if (v->o.mode >= DVR && !v->o.has_surface)
        fprintf(stderr, "note: nothing is in view: the transfer function%s all of it transparent, or the camera looks elsewhere\n",
                v->o.clip_count ? " leaves, or --clip makes," : " leaves");
}

static int write_picture(viewer *v) {
    size_t pixels = (size_t)v->o.width * (size_t)v->o.height;
    double begun = seconds(), exposure = v->o.exposure;
    unsigned char *bytes = (unsigned char *)malloc(pixels * 3);
    int ok;
    if (!bytes) return fail(v, "the picture", ISOGI_NO_MEMORY);
    note_darkness(v);
    if (!(exposure > 0)) {
        exposure = picture_exposure((const float(*)[4])v->picture, pixels, 0.9, 0.6);
        for (double factor = 64; v->compared && factor > 1.0005; factor = sqrt(factor)) {
            const double brighter = expose_picture(v, exposure, bytes);
            if (brighter < 0 || brighter > 0) exposure *= brighter < 0 ? factor : 1 / factor;
            else break;
        }
    }
    expose_picture(v, exposure, bytes);
    if (v->compared) compare_picture(v, bytes);
    ok = png_write(v->o.out, bytes, v->o.width, v->o.height, 3, v->error);
    free(bytes);
    stat_line(v, "exposure", "%.6g", exposure);
    stat_seconds(v, "picture", begun);
    return ok;
}

static int check_surface(viewer *v) {
    size_t covered = 0, surface = 0, pixels = (size_t)v->o.width * (size_t)v->o.height;
    for (int s = 0; s < v->o.antialias; s++)
        for (size_t i = 0; i < pixels; i++) covered += v->seen[s][i] != RASTER_NONE, surface += v->seen[s][i] < SECTION;
    v->covered = covered, v->surface = surface;
    stat_line(v, "coverage", "%.6f", (double)covered / (double)pixels / v->o.antialias);
    if (!surface)
        fprintf(stderr, "note: no surface is in view at isovalue %.9g (the data range from %.9g to %.9g)%s\n", v->isovalue, v->range[0],
                v->range[1], covered ? ": what is seen are the sides of the volume, or of a cut" : "");
    return 1;
}

static int run(viewer *v, int argc, char **argv) {
    struct rusage usage;
    if (!parse_arguments(v, argc, argv) || !file_writable(v->o.out, v->error) || (v->o.depth && !file_writable(v->o.depth, v->error)))
        return 0;
    if (v->o.compare && !read_compared(v)) return 0;
    if (!v->o.antialias) v->o.antialias = v->o.mode == DVR ? 1 : v->o.mode == PATHTRACE && v->o.samples < 4 ? v->o.samples : 4;
    v->context.alloc = counted_alloc, v->context.release = counted_release, v->context.user = v, v->context.threads = v->o.threads;
    isogi_thread_pool_create(&v->context.thread_pool, v->o.threads, NULL); /* where it fails there is none, which is as good, but slower */
    stat_line(v, "mode", "%s", mode_name[v->o.mode]);
    if (!load_volume(v)) return 0;
    choose_surface(v);
    place_camera(v);
    if (!set_light(v)) return 0;
    v->picture = (float(*)[4])calloc((size_t)v->o.width * (size_t)v->o.height, sizeof *v->picture);
    if (!v->picture) return fail(v, "the picture", ISOGI_NO_MEMORY);
    if (v->o.mode >= DVR) {
        if (!render_volume(v)) return 0;
    } else {
        if (!view_surface(v) || !check_surface(v)) return 0;
        if (v->o.mode >= VICINITY && v->o.mode <= TRANSFER && !bake(v)) return 0;
        if (!shade_surface(v)) return 0;
    }
    if (!write_picture(v)) return 0;
    stat_line(v, "picture", "%dx%d", v->o.width, v->o.height);
    stat_line(v, "memory_bytes", "%llu", (unsigned long long)v->memory_peak);
    if (getrusage(RUSAGE_SELF, &usage) == 0) stat_line(v, "process_bytes", "%llu", (unsigned long long)usage.ru_maxrss * 1024u);
    stat_seconds(v, "total", v->started);
    return 1;
}

static void release(viewer *v) {
    forget_view(v);
    free(v->picture), free(v->compared), free(v->env.rgb);
    isogi_trace_free(v->trace);
    if (v->pyramid) isogi_vol_mesh_free(v->pyramid, &v->mesh);
    isogi_vol_free(v->pyramid);
    isogi_thread_pool_free(v->context.thread_pool);
    transfer_file_free(&v->transfer);
    volume_free(&v->volume);
}

int main(int argc, char **argv) {
    static viewer v;
    int ok;
    int help = 0;
    for (int i = 1; i < argc; i++) help |= !strcmp(argv[i], "--help") || !strcmp(argv[i], "-h");
    v.started = seconds();
    if (help) print_help();
    ok = (help || run(&v, argc, argv)) && file_printed(v.error);
    if (!ok) fprintf(stderr, "viewer: %s\n", v.error);
    release(&v);
    return ok ? 0 : 1;
}
