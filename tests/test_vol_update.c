/* How the pyramid of isogi_vol.h is built and updated: every path and every update gives the same bits, for the price of the box that
   changed. This program looks inside isogi_vol.h. FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "fields.h"

/* ---- updates ---- */

static void store(void *p, isogi_type type, size_t i, double v) {
    switch (type) {
    case ISOGI_U8: ((uint8_t *)p)[i] = (uint8_t)fmin(255, fmax(0, v)); break;
    case ISOGI_I8: ((int8_t *)p)[i] = (int8_t)fmin(127, fmax(-128, v)); break;
    case ISOGI_U16: ((uint16_t *)p)[i] = (uint16_t)fmax(0, v); break;
    case ISOGI_I16: ((int16_t *)p)[i] = (int16_t)v; break;
    case ISOGI_F32: ((float *)p)[i] = (float)v; break;
    case ISOGI_F64: ((double *)p)[i] = v; break;
    }
}

/* Whether two pyramids are the same bits, all of what rays look at. */
static int same_pyramid(const isogi_pyramid *a, const isogi_pyramid *b) {
    size_t blocks = a->level[0].size[0] * a->level[0].size[1] * a->level[0].size[2];
    int same = a->range[0] <= b->range[0] && a->range[0] >= b->range[0] && a->range[1] <= b->range[1] && a->range[1] >= b->range[1];
    same = same && a->all_finite == b->all_finite && a->fast == b->fast && a->broken_count == b->broken_count;
    same = same && !memcmp(a->broken, b->broken, blocks);
    for (int n = 0; n < 3 && same; n++)
        for (size_t i = 0; i < a->level[n].size[0] * a->level[n].size[1] * a->level[n].size[2]; i++)
            same = same && a->level[n].range[i][0] <= b->level[n].range[i][0] && a->level[n].range[i][0] >= b->level[n].range[i][0] &&
                   a->level[n].range[i][1] <= b->level[n].range[i][1] && a->level[n].range[i][1] >= b->level[n].range[i][1];
    if (!same || !a->fast) return same;
    same = a->node_levels == b->node_levels && a->node_scale <= b->node_scale && a->node_scale >= b->node_scale;
    for (int n = a->volume.compact != 0; n < a->node_levels && same; n++)
        for (size_t z = 0; z < a->node_level[n].size[2]; z++)
            for (size_t y = 0; y < a->node_level[n].size[1]; y++)
                for (size_t x = 0; x < a->node_level[n].size[0]; x++) {
                    size_t at = isogi_vol__node_at(a, n, x, y, z);
                    same = same && !memcmp(a->nodes[at], b->nodes[at], sizeof a->nodes[at]);
                }
    return same;
}

/* Voxels side by side or two apart, a few of them not finite where n is 3. Also where the compiler may contract: products and sums that
   it joins on one path alone would differ by a unit in the last place, which shows in a value of 8 bits once in some thousand leaves. */
TEST(all_paths_build_the_same_bits) {
    static const size_t sizes[5][3] = {{300, 9, 13}, {20, 33, 30}, {261, 2, 6}, {47, 21, 5}, {268, 7, 6}};
    test_random r = {9};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int n = 0; n < (LONG_SUITE ? 400 : QUICK_SUITE ? 20 : 40); n++) {
            const double top = n < 8 ? 250 : random_range(&r, 3, 250);
            const size_t *size = sizes[n % 5], voxels = size[0] * size[1] * size[2], step = n < 4 || n >= 8 ? 1 : 2;
            const ptrdiff_t bytes = (ptrdiff_t)(step * type_bytes((isogi_type)type)), x = (ptrdiff_t)size[0], y = (ptrdiff_t)size[1];
            void *raw = calloc(voxels * step, 8);
            isogi_volume v = {.data = raw, .type = (isogi_type)type, .size = {size[0], size[1], size[2]},
                .stride = {bytes, bytes * x, bytes * x * y}, .scale = 0.3, .bias = -5};
            isogi_pyramid *p[2] = {NULL, NULL};
            for (size_t i = 0; i < voxels * step; i++)
                store(raw, (isogi_type)type, i,
                      n % 4 == 3 && type >= ISOGI_F32 && !(random_bits(&r) % 400) ? (double)NAN : floor(random_range(&r, -120, top)));
            for (int path = 2; path < 6; path++) {
                const isogi_context context = {.threads = 1, .force_path = path % 5};
                CHECK(isogi_vol_build(&p[path > 2], &v, &context) == ISOGI_OK, "build");
                if (path == 2) continue;
                CHECK(same_pyramid(p[0], p[1]), "type %d, volume %d, path %d", type, n, path % 5);
                isogi_vol_free(p[1]);
            }
            isogi_vol_free(p[0]);
            free(raw);
        }
}

/* Boxes are painted over: with noise, with constants, beyond and within the volume's range, with numbers that are not finite, and back. */
static void check_updates(isogi_type type, double scale, double bias, int shape, test_random *r) {
    const size_t sizes[4][3] = {{300, 9, 13}, {20, 33, 30}, {70, 1, 6}, {5, 5, 4}}, *size = sizes[shape];
    size_t voxels = size[0] * size[1] * size[2];
    void *raw = calloc(voxels, 8), *base = calloc(voxels, 8);
    isogi_volume v = {.data = raw, .type = type, .size = {size[0], size[1], size[2]}, .scale = scale, .bias = bias,
        .compact = type % 2 && scale < 1};
    isogi_context context = {.threads = 1, .force_path = shape};
    isogi_pyramid *updated = NULL, *fresh = NULL;
    for (size_t i = 0; i < voxels; i++) store(base, type, i, floor(random_range(r, 20, 100)) + 1e-9 * random_unit(r));
    memcpy(raw, base, voxels * 8);
    CHECK(isogi_vol_build(&updated, &v, &context) == ISOGI_OK, "build");
    for (int turn = 0; turn < (LONG_SUITE ? 200 : QUICK_SUITE ? 20 : 40); turn++) {
        size_t first[3], last[3], blocks = 1;
        int kind = (int)(random_bits(r) % 6), whole = random_bits(r) % 16 == 0;
        double level = kind == 1 ? 60 : kind == 2 ? random_range(r, 101, 126) : kind == 3 ? random_range(r, 0, 19) : (double)NAN;
        isogi_counters counters = {0};
        double range[2];
        isogi_vol_range(updated, range);
        for (int a = 0; a < 3; a++) {
            first[a] = whole ? 0 : random_bits(r) % size[a];
            last[a] = whole ? size[a] - 1 : first[a] + random_bits(r) % (turn % 2 ? 3 : size[a]);
            size_t end = last[a] < size[a] ? last[a] : size[a] - 1;
            blocks *= end / 4 - (first[a] ? first[a] - 1 : 0) / 4 + 1;
        }
        if (kind == 4 && type == ISOGI_U16) level = 300; /* beyond what was */
        for (size_t z = first[2]; z <= last[2] && z < size[2]; z++)
            for (size_t y = first[1]; y <= last[1] && y < size[1]; y++)
                for (size_t x = first[0]; x <= last[0] && x < size[0]; x++) {
                    size_t i = x + size[0] * (y + size[1] * z), bytes = type_bytes(type);
                    if (kind == 0) store(raw, type, i, floor(random_range(r, 30, 90)));
                    else if (kind == 5 || (kind == 4 && type < ISOGI_F32 && type != ISOGI_U16))
                        memcpy((char *)raw + bytes * i, (char *)base + bytes * i, bytes);
                    else if (kind != 4 || random_bits(r) % 4 == 0) store(raw, type, i, level);
                }
        CHECK(isogi_vol_update(updated, first, last, &counters) == ISOGI_OK, "update");
        CHECK(isogi_vol_build(&fresh, &v, &context) == ISOGI_OK, "build");
        CHECK(same_pyramid(updated, fresh), "type %d, shape %d, turn %d, kind %d: not as built anew", (int)type, shape, turn, kind);
        /* where an extreme was painted over and is found again elsewhere, it takes a look at one block for each; but values that are
           one number as a float and many as a double are all looked at */
        int stays =
            range[0] <= fresh->range[0] && range[0] >= fresh->range[0] && range[1] <= fresh->range[1] && range[1] >= fresh->range[1];
        CHECK(counters.blocks >= 1 && (counters.blocks <= blocks + 2 || !stays || type == ISOGI_F64), "%d blocks read for a box of %d",
              (int)counters.blocks, (int)blocks);
        isogi_vol_free(fresh);
    }
    isogi_vol_free(updated);
    free(raw), free(base);
}

TEST(an_updated_pyramid_is_as_if_built_anew) {
    test_random r = {7};
    for (int type = ISOGI_U8; type <= ISOGI_F64; type++)
        for (int shape = 0; shape < 4; shape++) {
            check_updates((isogi_type)type, 1, 0, shape, &r);
            check_updates((isogi_type)type, shape % 2 ? -0.1 : 0.1, 3, shape, &r);
        }
}

TEST(an_update_costs_what_its_box_costs) {
    field f = field_new(128, 128, 128);
    test_random r = {8};
    size_t first[3] = {50, 60, 70}, last[3] = {53, 60, 80};
    isogi_counters counters = {0};
    for (int i = 0; i < 128 * 128 * 128; i++) f.value[i] = random_range(&r, -1, 1);
    field_build_with(&f, NULL);
    for (size_t z = first[2]; z <= last[2]; z++)
        for (size_t x = first[0]; x <= last[0]; x++) *field_at(&f, (int)x, 60, (int)z) = 0;
    CHECK(isogi_vol_update(f.pyramid, first, last, &counters) == ISOGI_OK, "update");
    CHECK(counters.blocks == 2 * 2 * 4, "%d blocks", (int)counters.blocks);
    /* the largest value goes: it takes one more look at the blocks whose bound, as a float, is the next largest */
    size_t at = 0;
    for (size_t i = 0; i < 128 * 128 * 128; i++)
        if (f.value[i] > f.value[at]) at = i;
    f.value[at] = 0;
    first[0] = last[0] = at % 128, first[1] = last[1] = at / 128 % 128, first[2] = last[2] = at / 128 / 128;
    counters.blocks = 0;
    CHECK(isogi_vol_update(f.pyramid, first, last, &counters) == ISOGI_OK, "update");
    CHECK(counters.blocks <= 8 + 16, "%d blocks", (int)counters.blocks);
    CHECK(isogi_vol_update(NULL, first, last, NULL) == ISOGI_INVALID, "no pyramid");
    last[1] = first[1] - 1;
    CHECK(isogi_vol_update(f.pyramid, first, last, NULL) == ISOGI_INVALID, "no box");
    first[0] = 128, last[0] = 130, last[1] = first[1];
    CHECK(isogi_vol_update(f.pyramid, first, last, NULL) == ISOGI_INVALID, "beyond the volume");
    field_free(&f);
}

/* Memory whose allocation number `left` fails. */
typedef struct scarce { long left, blocks; } scarce;
static void *scarce_alloc(void *user, size_t size, size_t align) {
    scarce *m = (scarce *)user;
    void *p = NULL;
    if (m->left-- == 0 || posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    m->blocks++;
    return p;
}
static void scarce_release(void *user, void *p, size_t size) { (void)size, ((scarce *)user)->blocks--, free(p); }

/* The k-th allocation of an update fails, for every k: the pyramid is as it was, and the same update succeeds afterwards. The first values
   come, for which an update needs most: the 8-bit bounds, which were not there. A voxel that is not finite comes, and moves. */
TEST(an_update_survives_every_failing_allocation) {
    enum { N = 21 };
    test_random r = {41};
    for (int kind = 0; kind < 3; kind++) {
        int failures = 0, done = 0, least = 2;
        for (long k = 0; !done && k < 100; k++) {
            scarce memory = {-1, 0};
            isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
            field f = field_new(N, N, N);
            isogi_pyramid *updated = NULL, *before = NULL, *after = NULL;
            isogi_counters counters = {0};
            const size_t first[3] = {3, 4, 5}, last[3] = {8, 9, 20};
            for (int i = 0; i < N * N * N; i++) f.value[i] = kind ? random_range(&r, -1, 1) : (double)NAN;
            if (kind != 1) *field_at(&f, 5, 6, 7) = (double)NAN;
            CHECK(isogi_vol_build(&updated, &f.volume, &context) == ISOGI_OK, "build");
            CHECK(isogi_vol_build(&before, &f.volume, NULL) == ISOGI_OK, "build");
            *field_at(&f, 5, 6, 7) = 0.5, *field_at(&f, 5, 6, 8) = -0.5;
            if (kind) *field_at(&f, 6, 6, 17) = (double)NAN;
            CHECK(isogi_vol_build(&after, &f.volume, NULL) == ISOGI_OK, "build");
            memory.left = k;
            isogi_result result = isogi_vol_update(updated, first, last, &counters);
            done = memory.left >= 0, memory.left = -1;
            CHECK(result == (done ? ISOGI_OK : ISOGI_NO_MEMORY), "kind %d, allocation %ld: %s", kind, k, isogi_result_string(result));
            if (result != ISOGI_OK) {
                CHECK(same_pyramid(updated, before) && !counters.blocks, "kind %d: an update whose allocation %ld failed changed it",
                      kind, k);
                CHECK(isogi_vol_update(updated, first, last, NULL) == ISOGI_OK, "kind %d: again after allocation %ld", kind, k);
                failures++;
            }
            CHECK(same_pyramid(updated, after), "kind %d, allocation %ld: not as built anew", kind, k);
            if (!kind) least = updated->path == ISOGI_VOL__PATH_AVX512 ? 4 : 3; /* nodes; tables that this path alone reads */
            isogi_vol_free(updated), isogi_vol_free(before), isogi_vol_free(after), field_free(&f);
            CHECK(memory.blocks == 0, "kind %d, allocation %ld: %ld blocks leak", kind, k, memory.blocks);
        }
        CHECK(done && failures >= least, "kind %d: %d allocations were tried", kind, failures);
    }
}

/* ---- too many vertices ---- */

/* No volume of this size fits in a test: the step that adds up what the rows have is given rows that say so. */
TEST(more_vertices_than_indices_are_too_large) {
    isogi_vol__mesh_row row[4];
    for (int over = 0; over < 2; over++) {
        memset(row, 0, sizeof row);
        row[0].vertex[0] = 0x7fffffff, row[1].vertex[2] = 0x7fffffff, row[2].vertex[4] = over ? 2 : 1;
        isogi_result result = isogi_vol__mesh_offsets(row, 3);
        CHECK(result == (over || SIZE_MAX == UINT32_MAX ? ISOGI_TOO_LARGE : ISOGI_OK), "%d: %s", over, isogi_result_string(result));
        if (result == ISOGI_OK)
            CHECK(row[3].vertex[0] == UINT32_MAX && row[2].vertex[4] == UINT32_MAX - 1, "%u %u", row[3].vertex[0], row[2].vertex[4]);
    }
}

TEST_MAIN("vol_update")
