/* bake.c - volume in, illumination texture out: in parts, with pauses, on several machines, always to the same bits

       build/bake VOLUME --out FILE [options]       bakes, or goes on where FILE stopped
       build/bake VOLUME --merge A B ... --out FILE puts parts together that were baked with --box */
#define ISOGI_IMPLEMENTATION
#include "bake_scene.h"

#include <signal.h>

static volatile sig_atomic_t interrupted;
static void interrupt(int number) { (void)number, interrupted = 1; }

typedef struct program {
    bake_scene scene;
    char **merge;
    int merge_count, format;
    const char *raw;
    isogi_trace *trace;
} program;

static void help(void) {
    puts("build/bake VOLUME --out FILE [options]      volume in, illumination texture out\n\n"
         "VOLUME is a raw file named like engine_256x256x128_uint8.raw, or procedural:NAME[:N]. Where FILE exists and holds a part of\n"
         "this very texture, baking goes on there. It is written at the end, every minute meanwhile, and when Ctrl-C or SIGTERM stops the "
         "work (status 3).\n"
         "The result is the same bits in any case.\n\nOptions");
    fputs(bake_scene_help, stdout);
    puts("  --box X,Y,Z,X,Y,Z          only texels from the first three numbers to before the last three\n"
         "                             (by feedback all of the cubes of 64 texels a side, counted from 0, that these lie in)\n"
         "  --merge FILE...            puts parts together (up to the next option); what none of them holds is baked\n"
         "  --raw FILE                 the dense texture as well, ready for a GPU: isogi_trace_export\n"
         "  --format NAME              of --raw: float, half, rgb9e5 or byte; default that of the storage\n"
         "  --help                     this text\n\n"
         "Example, in two parts\n"
         "  build/bake procedural:gyroid:32 --box 0,0,0,32,32,16 --out low.bake\n"
         "  build/bake procedural:gyroid:32 --box 0,0,16,32,32,32 --out high.bake\n"
         "  build/bake procedural:gyroid:32 --merge low.bake high.bake --out gyroid.bake --raw gyroid.rgb");
}

static int parse(program *p, int argc, char **argv) {
    bake_scene *s = &p->scene;
    bake_scene_begin(s);
    for (int i = 1; i < argc; i++) {
        int known = bake_scene_option(s, argc, argv, &i);
        double x[6];
        if (known < 0) return 0;
        if (known) continue;
        if (!strcmp(argv[i], "--merge")) {
            p->merge = argv + i + 1;
            while (i + 1 < argc && strncmp(argv[i + 1], "--", 2)) i++, p->merge_count++;
            if (!p->merge_count) return file_fail(s->error, "--merge: needs names of files");
        } else if (!strcmp(argv[i], "--box") && i + 1 < argc) {
            if (!whole_numbers(argv[++i], ',', 6, 0, 65536, x) || !(x[0] < x[3] && x[1] < x[4] && x[2] < x[5]))
                return file_fail(s->error, "--box: \"%.80s\" is not allowed: six whole numbers, the last three above the first", argv[i]);
            for (int k = 0; k < 3; k++) s->desc.box_first[k] = (size_t)x[k], s->desc.box_end[k] = (size_t)x[k + 3];
        } else if (!strcmp(argv[i], "--raw") && i + 1 < argc && strncmp(argv[i + 1], "--", 2)) p->raw = argv[++i];
        else if (!strcmp(argv[i], "--format") && i + 1 < argc) {
            if (!parse_name(argv[++i], bake_formats, 5, &p->format))
                return file_fail(s->error, "--format: \"%.80s\" is not allowed", argv[i]);
        } else if (argv[i][0] == '-')
            return file_fail(s->error, "%.80s: no such option, or its value is missing; --help lists them", argv[i]);
        else if (s->volume_name) return file_fail(s->error, "%.80s: a second volume", argv[i]);
        else s->volume_name = argv[i];
    }
    return 1;
}

static int bake(program *p) {
    double remaining = 1, first = -1;
    bake_clock clock = bake_clock_start();
    uint64_t budget = 100000;
    isogi_result result = ISOGI_OK;
    while (result == ISOGI_OK && remaining > 0 && !interrupted) {
        double step = bake_seconds();
        result = isogi_trace_step(p->trace, budget, &remaining);
        step = bake_seconds() - step;
        if (first < 0) first = remaining; /* what was loaded took no time */
        if (step < 0.1 && budget < (uint64_t)1 << 40) budget *= 2;
        else if (step > 0.3 && budget > 10000) budget /= 2;
        if (first > 0) bake_say(&clock, (first - remaining) / first);
        if (result == ISOGI_OK) bake_save_now_and_then(&p->scene, p->trace, &clock);
    }
    bake_say_end();
    if (result != ISOGI_OK) return file_fail(p->scene.error, "baking: %s", isogi_result_string(result));
    if (interrupted && first < 0) fprintf(stderr, "stopped before it began; the same command goes on\n");
    else if (interrupted) fprintf(stderr, "stopped with %.1f %% to do; the same command goes on\n", 100 * remaining);
    return 1;
}

static int write_raw(program *p) {
    size_t size = isogi_trace_export_size(p->trace, p->format), lattice[3];
    void *texels = size ? malloc(size) : NULL;
    int values, channels, ok = texels && isogi_trace_export(p->trace, p->format, texels, size) == ISOGI_OK;
    float scales[108];
    ok = ok ? file_write(p->raw, texels, size, p->scene.error) : file_fail(p->scene.error, "%s: out of memory", p->raw);
    free(texels);
    if (!ok) return 0;
    isogi_trace_shape(p->trace, lattice, &values, &channels);
    isogi_trace_export_scales(p->trace, p->format, scales);
    printf("%zux%zux%zu texels, scales", lattice[0], lattice[1], lattice[2]);
    for (int i = 0, n = values ? values * values * channels : 3; i < n; i++) printf(" %.9g", (double)scales[i]);
    putchar('\n');
    return 1;
}

/* Neither texture takes the place of what it is made from, nor the dense one that of the other. */
static int check_files(program *p) {
    bake_scene *s = &p->scene;
    if (file_same(p->raw, s->out)) return file_fail(s->error, "--raw: %.200s is the file of --out", p->raw);
    if (file_same(s->out, s->volume_name)) return file_fail(s->error, "--out: %.200s is the file of VOLUME", s->out);
    if (file_same(p->raw, s->volume_name)) return file_fail(s->error, "--raw: %.200s is the file of VOLUME", p->raw);
    if (file_same(s->out, s->env_name)) return file_fail(s->error, "--out: %.200s is the file of --env", s->out);
    if (file_same(p->raw, s->env_name)) return file_fail(s->error, "--raw: %.200s is the file of --env", p->raw);
    for (int i = 0; i < p->merge_count; i++)
        if (file_same(p->raw, p->merge[i])) return file_fail(s->error, "--raw: %.200s is the file of --merge", p->raw);
    return 1;
}

static int run(program *p, int argc, char **argv) {
    bake_scene *s = &p->scene;
    isogi_result result;
    if (!parse(p, argc, argv)) return 0;
    if (p->format && !p->raw) return file_fail(s->error, "--format: is that of --raw, which is missing");
    if (!check_files(p) || !bake_scene_make(s) || !file_writable(s->out, s->error) || (p->raw && !file_writable(p->raw, s->error)))
        return 0;
    result = isogi_trace_create(&p->trace, &s->desc, &s->context);
    if (result != ISOGI_OK) return file_fail(s->error, "the texture: %s", isogi_result_string(result));
    if (p->raw && !isogi_trace_export_size(p->trace, p->format)) return file_fail(s->error, "--format: this one is not for this mode");
    for (int i = 0; i < p->merge_count; i++)
        if (!bake_scene_load(s, p->trace, p->merge[i])) return 0;
    if (access(s->out, F_OK) == 0 && !bake_scene_load(s, p->trace, s->out)) return 0;
    return bake(p) && bake_scene_save(s, p->trace, s->out) && (!p->raw || interrupted || write_raw(p));
}

int main(int argc, char **argv) {
    static program p;
    int ok, asked = 0;
    for (int i = 1; i < argc; i++) asked |= !strcmp(argv[i], "--help") || !strcmp(argv[i], "-h");
    signal(SIGINT, interrupt), signal(SIGTERM, interrupt);
    if (asked) help();
    ok = (asked || run(&p, argc, argv)) && file_printed(p.scene.error);
    if (!ok) fprintf(stderr, "bake: %s\n", p.scene.error);
    isogi_trace_free(p.trace);
    bake_scene_free(&p.scene);
    return ok ? (interrupted ? 3 : 0) : 1;
}
