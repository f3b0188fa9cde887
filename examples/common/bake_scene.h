/* bake_scene.h - the part that bake and bake_mpi share: a volume, a light and a material from the command line, as a description of
   an illumination texture. Both programs make the same description of the same words, so their textures are the same bits. */
#ifndef BAKE_SCENE_H
#define BAKE_SCENE_H

#include "isogi_trace.h"

#include "daylight.h"
#include "hdr.h"
#include "option_text.h"
#include "procedural.h"
#include "volume_file.h"

#include <float.h>
#include <time.h>

#define BAKE_LIGHTS 16

typedef struct bake_scene {
    const char *volume_name, *env_name, *out;
    isogi_volume volume;
    isogi_pyramid *pyramid;
    isogi_context context;
    hdr_image env;
    isogi_light lights[BAKE_LIGHTS];
    float sky[4][3];
    double spacing[3], save_every; /* seconds */
    isogi_trace_desc desc;
    char error[FILE_ERROR_SIZE];
} bake_scene;

static const char *const bake_scene_help =
    "  --out FILE                 the texture computed so far, to be resumed, merged or exported; needed\n"
    "  --mode NAME                irradiance, the default, or transfer (order 5)\n"
    "  --isovalues LOW,HIGH       only texels that isosurfaces between these (both included) read; default all\n"
    "  --spacing X,Y,Z            size of a voxel; default 1,1,1\n"
    "  --env FILE.hdr             environment: equirectangular Radiance picture; default a sky and a sun\n"
    "  --light KIND:X,Y,Z:...     as build/viewer --help says; may be repeated, 16 times at most\n"
    "  --albedo R,G,B             diffuse reflectance; default 0.7,0.7,0.7\n"
    "  --bounces N                reflections; -1 = all, the default\n"
    "  --feedback                 the light that rays meet is that of points near by, all reflections for the rays of one: faster, and\n"
    "                             less noise, but not unbiased as the whole paths are that are followed by default\n"
    "  --samples N                paths per texel; default 64\n"
    "  --lattice X,Y,Z            texels; default one per voxel\n"
    "  --storage NAME             float, half, rgb9e5 or byte; default float for irradiance, half for transfer\n"
    "  --both-sides               the high side of the surface, too\n"
    "  --save-every S             seconds until FILE is written again while work goes on; default 60\n"
    "  --threads N                0 = one per core, the default\n";

static const char *const bake_formats[5] = {"default", "float", "half", "rgb9e5", "byte"};

static inline void bake_scene_begin(bake_scene *s) {
    memset(s, 0, sizeof *s);
    s->spacing[0] = s->spacing[1] = s->spacing[2] = 1, s->save_every = 60;
    s->desc.bounces = -1, s->desc.albedo[0] = s->desc.albedo[1] = s->desc.albedo[2] = 0.7f;
    s->desc.method = ISOGI_TRACE_PATHS; /* the reference */
}

static inline int bake_integer(const char *text, double low, double high, int *out) {
    double x;
    if (!whole_numbers(text, ',', 1, low, high, &x)) return 0;
    return *out = (int)x, 1;
}

/* The option at argv[*i], if it is one of those above: 1, and *i on its value. 0: it is not. -1: its value is not allowed. */
static inline int bake_scene_option(bake_scene *s, int argc, char **argv, int *i) {
    static const char *const names[13] = {"--out",     "--mode",    "--isovalues", "--spacing", "--env",        "--light",  "--albedo",
                                          "--bounces", "--samples", "--lattice",   "--storage", "--save-every", "--threads"};
    static const char *const modes[2] = {"irradiance", "transfer"};
    static const char *const allowed[13] = {
        "a file's name", "irradiance or transfer", "two numbers, the smaller one first", "three numbers above 0", "a Radiance .hdr file",
        "KIND:X,Y,Z:R,G,B and more, see build/viewer --help", "three numbers, 0 to 1", "a whole number, -1 to 1000",
        "a whole number, 1 to 16777216", "three whole numbers, 1 to 65536", "a format that --help names", "seconds, 0 or more",
        "a whole number, 0 to 256"};
    isogi_trace_desc *d = &s->desc;
    const char *text;
    double x[3] = {0, 0, 0};
    int which, k, ok = 1;
    if (!strcmp(argv[*i], "--both-sides")) return d->sides = ISOGI_TRACE_BOTH_SIDES, 1;
    if (!strcmp(argv[*i], "--feedback")) return d->method = ISOGI_TRACE_FEEDBACK, 1;
    if (!parse_name(argv[*i], names, 13, &which)) return 0;
    if (*i + 1 >= argc || !strncmp(argv[*i + 1], "--", 2)) return file_fail(s->error, "%s: needs a value", argv[*i]), -1;
    text = argv[++*i];
    switch (which) {
    case 0: s->out = text; break;
    case 1: ok = parse_name(text, modes, 2, &k), d->mode = (isogi_trace_mode)(ok ? k : 0); break;
    case 2:
        ok = numbers(text, ',', 2, -1e300, 1e300, x) && x[0] <= x[1];
        /* 0 and 0 mean all to the library; a surface at 0 is all that there is from a hair below it to 0 */
        d->isovalue_min = x[0] < 0 || x[1] > 0 ? x[0] : -DBL_MIN, d->isovalue_max = x[1];
        break;
    case 3: ok = numbers(text, ',', 3, 1e-9, 1e9, s->spacing); break;
    case 4:
        free(s->env.rgb), s->env.rgb = NULL, s->env_name = text;
        if (!hdr_read(text, &s->env, s->error)) return -1;
        break;
    case 5: ok = d->lighting.light_count < BAKE_LIGHTS && light_parse(text, &s->lights[d->lighting.light_count]),
        d->lighting.light_count += (size_t)ok; break;
    case 6: ok = numbers(text, ',', 3, 0, 1, x); for (k = 0; ok && k < 3; k++) d->albedo[k] = (float)x[k]; break;
    case 7: ok = bake_integer(text, -1, 1000, &d->bounces); break;
    case 8: ok = bake_integer(text, 1, 1 << 24, &d->samples); break;
    case 9: ok = whole_numbers(text, ',', 3, 1, 65536, x); for (k = 0; ok && k < 3; k++) d->lattice[k] = (size_t)x[k]; break;
    case 10: ok = parse_name(text, bake_formats, 5, &k), d->storage = (isogi_trace_format)(ok ? k : 0); break;
    case 11: ok = numbers(text, ',', 1, 0, 1e9, &s->save_every); break;
    default: ok = bake_integer(text, 0, 256, &s->context.threads);
    }
    return ok ? 1 : (file_fail(s->error, "%s: \"%.80s\" is not allowed; allowed: %s", argv[*i - 1], text, allowed[which]), -1);
}

/* The volume is read, the light is put together. 0 with a message on failure. */
static inline int bake_scene_make(bake_scene *s) {
    isogi_lighting *l = &s->desc.lighting;
    const procedural_shape *shape;
    isogi_result result = ISOGI_OK;
    char name[64];
    double longest = 0;
    size_t length;
    if (!s->volume_name || !s->out) return file_fail(s->error, "VOLUME and --out are needed; --help explains");
    if (s->desc.mode == ISOGI_TRACE_TRANSFER && (s->env.rgb || l->light_count))
        return file_fail(s->error, "%s: --mode transfer bakes for any light, which is given when the texture is relit",
                         s->env.rgb ? "--env" : "--light");
    if (s->desc.mode == ISOGI_TRACE_TRANSFER && s->desc.storage == ISOGI_TRACE_RGB9E5)
        return file_fail(s->error, "--storage: rgb9e5 holds colours, not the coefficients of --mode transfer");
    if (!strncmp(s->volume_name, "procedural:", 11)) {
        length = strcspn(s->volume_name + 11, ":");
        snprintf(name, sizeof name, "%.*s", length < 60 ? (int)length : 0, s->volume_name + 11);
        shape = procedural_find(name);
        if (!shape) return file_fail(s->error, "%.60s: no such volume", s->volume_name);
        if (s->volume_name[11 + length] && !whole_numbers(s->volume_name + 12 + length, ',', 1, 2, 2048, &longest))
            return file_fail(s->error, "%.60s: the size is a whole number, 2 to 2048", s->volume_name);
        result = procedural_make(shape, (size_t)longest, &s->volume, &s->context);
    } else if (!volume_read(s->volume_name, &s->volume, s->error)) return 0;
    memcpy(s->volume.spacing, s->spacing, sizeof s->spacing);
    if (result == ISOGI_OK) result = isogi_vol_build(&s->pyramid, &s->volume, &s->context);
    if (result != ISOGI_OK) return file_fail(s->error, "%s: %s", s->volume_name, isogi_result_string(result));
    for (int a = 0; a < 3; a++)
        if (s->desc.box_end[a] > (s->desc.lattice[a] ? s->desc.lattice[a] : s->volume.size[a]))
            return file_fail(s->error, "--box: reaches beyond the lattice along %c", "xyz"[a]);
    if (s->env.rgb) l->env.rgb = s->env.rgb, l->env.width = s->env.width, l->env.height = s->env.height;
    if (!s->env.rgb && !l->light_count) daylight_make(l, s->sky, &s->lights[0]);
    l->lights = s->lights, s->desc.pyramid = s->pyramid;
    if (s->desc.mode == ISOGI_TRACE_TRANSFER) memset(l, 0, sizeof *l);
    return 1;
}

static inline void bake_scene_free(bake_scene *s) { isogi_vol_free(s->pyramid), volume_free(&s->volume), free(s->env.rgb); }

/* The texture's block into a file. */
static inline int bake_scene_save(bake_scene *s, const isogi_trace *trace, const char *path) {
    size_t size = isogi_trace_save_size(trace);
    void *block = malloc(size);
    int ok = block && isogi_trace_save(trace, block, size) == ISOGI_OK ? file_write(path, block, size, s->error)
                                                                      : file_fail(s->error, "%s: out of memory", path);
    free(block);
    return ok;
}

static inline double bake_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* When work began, and when something was said or saved last. */
typedef struct bake_clock { double begun, said, saved; } bake_clock;

static inline bake_clock bake_clock_start(void) {
    double now = bake_seconds();
    bake_clock c = {now, now, now};
    return c;
}

/* A part of 0..1 is done. On a terminal a bar that is rewritten, elsewhere a line every few seconds. */
static inline void bake_say(bake_clock *c, double done) {
    int terminal = isatty(STDERR_FILENO), filled = (int)(30 * done);
    double now = bake_seconds(), left = done > 0 ? (now - c->begun) * (1 - done) / done : 0;
    if (now - c->said < (terminal ? 0.1 : 5)) return;
    c->said = now;
    if (terminal)
        fprintf(stderr, "\r[%.*s%.*s] %3.0f %%, %.0f s left \033[K", filled, "##############################", 30 - filled,
                "..............................", 100 * done, left);
    else fprintf(stderr, "%.0f %%, %.0f s left\n", 100 * done, left);
}

static inline void bake_say_end(void) {
    if (isatty(STDERR_FILENO)) fputs("\r\033[K", stderr);
}

/* Saves what is done every --save-every seconds, so that no more is lost whatever happens; less often where that would take more than
   a tenth of the time. A disk that is full now may not be at the end: work goes on. */
static inline void bake_save_now_and_then(bake_scene *s, const isogi_trace *trace, bake_clock *c) {
    double begun = bake_seconds();
    if (begun - c->saved < s->save_every) return;
    if (!bake_scene_save(s, trace, s->out)) fprintf(stderr, "%s; baking goes on\n", s->error), s->error[0] = 0;
    c->saved = bake_seconds() + 9 * (bake_seconds() - begun);
}

/* Reads a file of texels into the texture. */
static inline int bake_scene_load(bake_scene *s, isogi_trace *trace, const char *path) {
    unsigned char *block;
    size_t size;
    isogi_result result;
    if (!file_read(path, (size_t)-1, &block, &size, s->error)) return 0;
    result = isogi_trace_load(trace, block, size);
    free(block);
    if (result == ISOGI_INVALID) return file_fail(s->error, "%s: holds another texture: volume, light and options must be the same", path);
    if (result == ISOGI_CORRUPT) return file_fail(s->error, "%s: is no file of a texture, or is damaged", path);
    return result == ISOGI_OK || file_fail(s->error, "%s: %s", path, isogi_result_string(result));
}

#endif
