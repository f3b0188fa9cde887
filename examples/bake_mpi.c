/* bake_mpi.c - the same texture as build/bake, bit by bit, by any number of processes

       mpirun -n 5 build/bake_mpi VOLUME --out FILE [the options of build/bake that describe the texture]

   Rank 0 hands out bricks of texels to whoever is free, loads what comes back and saves it every minute; the others bake. Every process
   reads the volume. Where FILE holds a part of the texture, whoever baked it, only bricks that lack texels are baked. */
#define ISOGI_IMPLEMENTATION
#include "bake_scene.h"

#include <mpi.h>

enum { ASK = 1, WORK, RESULT }; /* what a message is */

typedef struct bricks {
    size_t side, lattice[3], size[3], count;
} bricks;

/* Rank 0 asks for all texels; to the others the lattice is enough: nothing is classified, since nothing is asked for. */
static isogi_result empty_texture(const bake_scene *s, int rank, isogi_trace **trace) {
    isogi_trace_desc desc = s->desc;
    desc.lazy = rank > 0;
    return isogi_trace_create(trace, &desc, &s->context);
}

/* Texels along a brick: by feedback those of a cube, of which a box takes all. */
static void count_bricks(const bake_scene *s, const isogi_trace *trace, bricks *b) {
    isogi_trace_shape(trace, b->lattice, NULL, NULL);
    b->count = 1, b->side = s->desc.method == ISOGI_TRACE_FEEDBACK ? ISOGI_TRACE_CUBE : 16;
    for (int a = 0; a < 3; a++) b->size[a] = (b->lattice[a] + b->side - 1) / b->side, b->count *= b->size[a];
}

/* Texels first <= i < end. */
static void brick_place(const bricks *b, size_t brick, size_t first[3], size_t end[3]) {
    size_t at[3] = {brick % b->size[0], brick / b->size[0] % b->size[1], brick / b->size[0] / b->size[1]};
    for (int a = 0; a < 3; a++) {
        first[a] = at[a] * b->side;
        end[a] = first[a] + b->side < b->lattice[a] ? first[a] + b->side : b->lattice[a];
    }
}

/* The first brick from this one on that lacks texels; b->count if there is none. */
static size_t next_brick(const isogi_trace *whole, const bricks *b, size_t brick) {
    for (; brick < b->count; brick++) {
        size_t first[3], end[3], at[3];
        brick_place(b, brick, first, end);
        for (at[2] = first[2]; at[2] < end[2]; at[2]++)
            for (at[1] = first[1]; at[1] < end[1]; at[1]++)
                for (at[0] = first[0]; at[0] < end[0]; at[0]++)
                    if (isogi_trace_wanted(whole, at)) return brick;
    }
    return brick;
}

static double count_wanted(const isogi_trace *whole, const bricks *b) {
    double count = 0;
    for (size_t brick = 0; (brick = next_brick(whole, b, brick)) < b->count; brick++) count++;
    return count;
}

/* Bakes one brick and returns its block, to be freed; NULL on failure. */
static unsigned char *bake_brick(const bake_scene *s, const bricks *b, size_t brick, size_t *size) {
    isogi_trace_desc desc = s->desc;
    isogi_trace *trace = NULL;
    unsigned char *block = NULL;
    brick_place(b, brick, desc.box_first, desc.box_end);
    if (isogi_trace_create(&trace, &desc, &s->context) == ISOGI_OK && isogi_trace_step(trace, 0, NULL) == ISOGI_OK) {
        *size = isogi_trace_save_size(trace);
        block = (unsigned char *)malloc(*size);
        if (block && isogi_trace_save(trace, block, *size) != ISOGI_OK) free(block), block = NULL;
    }
    isogi_trace_free(trace);
    return block;
}

/* Asks for bricks until there are none. A result of no bytes says that a brick failed. */
static void work(const bake_scene *s, const bricks *b) {
    for (;;) {
        uint64_t brick = 0;
        size_t size = 0;
        unsigned char *block;
        MPI_Send(&brick, 1, MPI_UINT64_T, 0, ASK, MPI_COMM_WORLD);
        MPI_Recv(&brick, 1, MPI_UINT64_T, 0, WORK, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        if (brick >= b->count) return;
        block = bake_brick(s, b, (size_t)brick, &size);
        MPI_Send(block, block ? (int)size : 0, MPI_BYTE, 0, RESULT, MPI_COMM_WORLD);
        free(block);
    }
}

/* Rank 0: hands out bricks, loads results. Every worker is told that nothing is left, whatever failed. */
static isogi_result coordinate(bake_scene *s, isogi_trace *whole, const bricks *b, int workers) {
    isogi_result result = ISOGI_OK;
    size_t next = 0;
    bake_clock clock = bake_clock_start();
    double done = 0, all = count_wanted(whole, b);
    while (workers) {
        MPI_Status status;
        uint64_t brick;
        unsigned char *block;
        int size;
        MPI_Probe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &status);
        if (status.MPI_TAG == ASK) {
            uint64_t none;
            MPI_Recv(&none, 1, MPI_UINT64_T, status.MPI_SOURCE, ASK, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
            brick = result == ISOGI_OK ? next_brick(whole, b, next) : b->count;
            MPI_Send(&brick, 1, MPI_UINT64_T, status.MPI_SOURCE, WORK, MPI_COMM_WORLD);
            next = (size_t)brick + 1;
            if (brick >= b->count) workers--;
            continue;
        }
        MPI_Get_count(&status, MPI_BYTE, &size);
        block = (unsigned char *)malloc((size_t)size + 1);
        if (!block) MPI_Abort(MPI_COMM_WORLD, 1);
        MPI_Recv(block, size, MPI_BYTE, status.MPI_SOURCE, RESULT, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        if (result == ISOGI_OK) result = size ? isogi_trace_load(whole, block, (size_t)size) : ISOGI_NO_MEMORY;
        free(block);
        bake_say(&clock, ++done / all);
        if (result == ISOGI_OK) bake_save_now_and_then(s, whole, &clock);
    }
    bake_say_end();
    return result;
}

/* One process alone bakes every brick itself. */
static isogi_result alone(bake_scene *s, isogi_trace *whole, const bricks *b) {
    isogi_result result = ISOGI_OK;
    bake_clock clock = bake_clock_start();
    double done = 0, all = count_wanted(whole, b);
    for (size_t brick = 0; result == ISOGI_OK && (brick = next_brick(whole, b, brick)) < b->count; brick++) {
        size_t size = 0;
        unsigned char *block = bake_brick(s, b, brick, &size);
        result = block ? isogi_trace_load(whole, block, size) : ISOGI_NO_MEMORY;
        free(block);
        bake_say(&clock, ++done / all);
        if (result == ISOGI_OK) bake_save_now_and_then(s, whole, &clock);
    }
    bake_say_end();
    return result;
}

static int run(bake_scene *s, int argc, char **argv, int rank, int ranks) {
    isogi_trace *whole = NULL;
    isogi_result result;
    bricks b;
    int ok = 1, failing;
    bake_scene_begin(s);
    s->context.threads = ranks > 1 ? 1 : 0;
    for (int i = 1; i < argc && ok; i++) {
        int known = bake_scene_option(s, argc, argv, &i);
        if (known > 0) continue;
        if (known == 0 && (argv[i][0] == '-' || s->volume_name))
            ok = file_fail(s->error, "%.80s: no such option; --help lists them", argv[i]);
        else if (known == 0) s->volume_name = argv[i];
        else ok = 0;
    }
    ok = ok && bake_scene_make(s) && (rank || file_writable(s->out, s->error));
    result = ok ? empty_texture(s, rank, &whole) : ISOGI_OK;
    if (result != ISOGI_OK) ok = file_fail(s->error, "the texture: %s", isogi_result_string(result));
    if (ok && !rank && access(s->out, F_OK) == 0) ok = bake_scene_load(s, whole, s->out);
    failing = ok ? ranks : rank; /* all of them go on, or none, and the first that cannot says why */
    MPI_Allreduce(MPI_IN_PLACE, &failing, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    if (!ok && rank != failing) s->error[0] = 0;
    if (failing == ranks) {
        count_bricks(s, whole, &b);
        if (rank) work(s, &b);
        else {
            result = ranks > 1 ? coordinate(s, whole, &b, ranks - 1) : alone(s, whole, &b);
            ok = result == ISOGI_OK ? bake_scene_save(s, whole, s->out) : file_fail(s->error, "baking: %s", isogi_result_string(result));
        }
    }
    isogi_trace_free(whole);
    return ok && failing == ranks;
}

int main(int argc, char **argv) {
    static bake_scene s;
    int rank, ranks, ok, asked = 0;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    for (int i = 1; i < argc; i++)
        asked |= !strcmp(argv[i], "--help") || !strcmp(argv[i], "-h");
    if (asked && !rank) printf("mpirun -n N build/bake_mpi VOLUME --out FILE [options]\n%s", bake_scene_help);
    ok = (asked || run(&s, argc, argv, rank, ranks)) && file_printed(s.error);
    if (!ok && s.error[0]) fprintf(stderr, "bake_mpi: %s\n", s.error);
    bake_scene_free(&s);
    MPI_Finalize();
    return ok ? 0 : 1;
}
