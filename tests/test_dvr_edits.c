/* Edits of transfer functions and clip planes, steps that are broken off, cancelled, or lack memory: a renderer computes only what they
   change, and in the end it holds what a new one does. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

static const char *const method_name[4] = {"default", "brute force", "paper", "sweeps"};

/* How far two numbers are apart: 0 also where neither is finite and both may be so, without end where one is not. */
static double apart(float a, float b, int finite) {
    const int both = test_finite((double)a) + test_finite((double)b);
    return both == 2 ? fabs((double)a - (double)b) : both || finite ? HUGE_VAL : 0;
}

/* The largest differences between what two renderers of the paper's method, or (not blocks) of others, hold at places: of visibility, local
   visibility and values, which beside voxels that are not finite are not so, either. */
static void differences(const isogi_dvr *a, const isogi_dvr *b, const float (*at)[3], size_t count, int blocks, double most[3]) {
    enum { MOST = 500 };
    static float v[2][MOST][4], local[2][MOST][4], value[2][MOST];
    CHECK(count <= MOST, "%zu places", count);
    for (int k = 0; k < 2; k++) {
        CHECK(isogi_dvr_sample_visibility(k ? b : a, at, count, v[k][0]) == ISOGI_OK, "sample");
        if (blocks) CHECK(isogi_dvr_sample_blocks(k ? b : a, at, count, value[k], local[k][0]) == ISOGI_OK, "sample blocks");
    }
    most[0] = most[1] = most[2] = 0;
    for (size_t i = 0; i < 4 * count; i++) {
        most[0] = fmax(most[0], apart(v[0][i / 4][i % 4], v[1][i / 4][i % 4], 1));
        if (blocks) most[1] = fmax(most[1], apart(local[0][i / 4][i % 4], local[1][i / 4][i % 4], 1));
        if (blocks) most[2] = fmax(most[2], apart(value[0][i / 4], value[1][i / 4], 0));
    }
}

/* Blocks in a row: e is empty, c of one value and l of many, which absorb, m of one larger value and n of many, whose extinction an edit
   takes away and gives back; where cut is not 0, so does a plane with all below that x. What depends on it is seen as by a new renderer,
   however far it is. */
typedef struct edited_row { const char *why, *blocks; double radius, reduction, cut; } edited_row;
static const edited_row edited_rows[] = {
    {"a ray of 32 voxels sees two blocks", "llllln", 32, 1, 0},
    {"the budget goes to other blocks, and with it their levels", "clllnl", 16, 1600, 0},
    {"data on the face between two blocks are those of the coarser one", "clleen", 16, 1000, 0},
    {"data on the face between two blocks are those of the coarser one", "cllllm", 16, 846, 0},
    {"nodes between two empty blocks are those of the one that sees matter", "ceemee", 16, 1000, 0},
    {"nodes between two blocks are those of the coarser one, which a plane close by makes finer", "llllll", 6, 30, 24}};

TEST(an_edit_is_seen_as_far_as_anything_depends_on_it) {
    enum { X = 97, Y = 17, PLACES = 500 };
    static float at[PLACES][3];
    for (size_t n = 0; n < sizeof edited_rows / sizeof *edited_rows; n++) {
        const edited_row *row = &edited_rows[n];
        const isogi_dvr_desc desc = {.pyramid = NULL, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 2,
                                     .directions = 32, .grid = {25, 3, 3}, .radius = row->radius, .reduction = row->reduction};
        isogi_dvr_desc with = desc;
        isogi_transfer_point p[] = {{0, {1, 0, 0}, 0},  {6, {0, 1, 0}, 0.02f}, {10, {0, 0, 1}, 0.15f}, {14, {1, 1, 0}, 0.05f},
                                    {20, {1, 1, 1}, 0}, {24, {1, 1, 1}, 0},    {27, {1, 0, 0}, 0.1f},  {34, {0, 1, 1}, 0.4f},
                                    {40, {0, 1, 1}, 0.003f}};
        const isogi_transfer transfer = {p, 9, NULL, 0};
        field f = field_new(X, Y, Y);
        test_random r = {61 + n};
        for (size_t i = 0; i < field_count(&f); i++) { /* faces between blocks of different kinds are empty */
            size_t x = i % X, block = x < X - 1 ? x / 16 : X / 16 - 1;
            char kind = row->blocks[block], before = row->blocks[x % 16 || !x ? block : block - 1];
            int none = kind == 'e' || before == 'e' || (kind < 'm') != (before < 'm');
            f.value[i] = none ? 22 : kind < 'm' ? 10 : 30;
            if (!none && (kind == 'l' || kind == 'n')) f.value[i] += random_unit(&r) + 2.5 * cos((double)(i / X % Y) * PI / 8);
        }
        field_build(&f), with.pyramid = f.pyramid;
        for (int i = 0; i < PLACES; i++)
            for (int a = 0; a < 3; a++) at[i][a] = a ? (float)random_range(&r, 0, Y - 1) : (float)(X - 1) * (float)i / (PLACES - 1);
        isogi_dvr *dvr = dvr_new(&with, &transfer);
        for (int edit = 0; edit < 3; edit++) {
            const double plane[1][4] = {{1, 0, 0, -row->cut}};
            const size_t planes = edit % 2 && row->cut > 0;
            double most[3];
            p[6].extinction = edit % 2 ? 0 : 0.1f, p[7].extinction = edit % 2 ? 0 : 0.4f;
            isogi_dvr *fresh = dvr_new(&with, &transfer);
            CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_set_clip(dvr, plane, planes) == ISOGI_OK &&
                      isogi_dvr_set_clip(fresh, plane, planes) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK,
                  "step");
            differences(dvr, fresh, (const float(*)[3])at, PLACES, 1, most);
            isogi_dvr_free(fresh);
            CHECK(!(most[0] > 0) && !(most[1] > 0) && !(most[2] > 0), "%s (%s), edit %d: visibility off by %g, local by %g, values by %g",
                  row->why, row->blocks, edit, most[0], most[1], most[2]);
        }
        isogi_dvr_free(dvr);
        field_free(&f);
    }
}

/* What a renderer holds after an edit, and a new one with the same function and planes, of which there is at most one. */
static void edit_is_like_new(const char *what, isogi_dvr *dvr, const isogi_dvr_desc *desc, const isogi_transfer *transfer,
                             const double (*plane)[4]) {
    enum { PLACES = 300 };
    static float at[PLACES][3];
    test_random r = {17};
    double most[3];
    isogi_dvr *fresh = dvr_new(desc, transfer);
    CHECK(isogi_dvr_set_transfer(dvr, transfer) == ISOGI_OK && isogi_dvr_set_clip(fresh, plane, plane != NULL) == ISOGI_OK, "edit");
    if (plane) CHECK(isogi_dvr_set_clip(dvr, plane, 1) == ISOGI_OK, "clip");
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK, "step");
    for (int i = 0; i < PLACES; i++)
        for (int a = 0; a < 3; a++)
            at[i][a] = (float)random_range(&r, 0, (double)(isogi_vol_volume(desc->pyramid)->size[a] - 1));
    differences(dvr, fresh, (const float(*)[3])at, PLACES, 0, most);
    CHECK(!(most[0] > 0), "%s: visibility off by %g", what, most[0]);
    isogi_dvr_free(fresh);
}

/* Edits that leave most of a block as it was, by the lattice of sweeps: a plane that moves on within the blocks that it cuts; extinction
   that changes just below a value alone, where a step is; and values of one block alone that a node beyond its border reaches. */
TEST(small_edits_reach_all_that_they_change) {
    field f = field_new(41, 17, 17), ramp = field_new(41, 17, 17);
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1, ramp.value[i] = (double)(i % 41);
    field_build(&f), field_build(&ramp);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .directions = 16, .grid = {5, 3, 3}};
    isogi_dvr_desc wide = desc;
    wide.pyramid = ramp.pyramid;
    const isogi_transfer_point even = {0, {1, 1, 1}, 0.05f};
    const isogi_transfer medium = {&even, 1, NULL, 0};
    isogi_dvr *dvr = dvr_new(&desc, &medium);
    for (int i = 0; i < 4; i++) { /* all within the first blocks along x, forth and back */
        const double plane[1][4] = {{1, 0, 0, -(const double[]){3.3, 9.1, 13.7, 5.2}[i]}};
        edit_is_like_new("a plane moves", dvr, &desc, &medium, plane);
    }
    isogi_dvr_free(dvr);
    isogi_transfer_point step[] = {{0, {1, 1, 1}, 0}, {20, {1, 1, 1}, 0}, {20, {1, 1, 1}, 0.1f}, {40, {1, 1, 1}, 0.1f}};
    const isogi_transfer steps = {step, 4, NULL, 0};
    dvr = dvr_new(&wide, &steps);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    for (int i = 0; i < 3; i++) {
        step[1].extinction = i % 2 ? 0 : 0.2f;
        edit_is_like_new("a value just below a step", dvr, &wide, &steps, NULL);
    }
    isogi_dvr_free(dvr);
    isogi_transfer_point tent[] = {{15.1, {1, 1, 1}, 0}, {15.5, {1, 1, 1}, 0.001f}, {15.9, {1, 1, 1}, 0},
                                   {30, {1, 1, 1}, 0},   {35, {1, 1, 1}, 0.01f},  {40, {1, 1, 1}, 0}};
    const isogi_transfer tents = {tent, 6, NULL, 0};
    wide.visibility_step = 10; /* a node at 20 is the mean of 15 to 25; blocks part at 16 */
    dvr = dvr_new(&wide, &tents);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    for (int i = 0; i < 3; i++) {
        tent[1].extinction = i % 2 ? 0.001f : 2;
        edit_is_like_new("values beside a border of blocks", dvr, &wide, &tents, NULL);
    }
    isogi_dvr_free(dvr), field_free(&f), field_free(&ramp);
}

/* Edits of one point, clip planes and steps that are broken off, in any order: what is seen at the end is what a new renderer sees, though
   it computes only what changed. Eight layers of blocks along x, of which an edit touches two or three; levels of others change as the
   budget goes elsewhere, and local rays of up to two blocks reach across. */
TEST(edits_in_any_order_end_like_a_new_renderer) {
    enum { X = 129, Y = 33, POINTS = 9, PLACES = 150 };
    static const struct { int method, coarsest; double radius, reduction; } kind[] = {
        {ISOGI_DVR_PAPER, 0, 6, 3}, {ISOGI_DVR_PAPER, 0, 16, 30}, {ISOGI_DVR_PAPER, 0, 24, 8}, {ISOGI_DVR_PAPER, 0, 32, 60},
        {ISOGI_DVR_PAPER, 0, 16, 8}, {ISOGI_DVR_SWEEP, 0, 0, 0}, {ISOGI_DVR_SWEEP, 8, 0, 0}, {ISOGI_DVR_BRUTE, 0, 0, 0}};
    static float at[PLACES][3];
    field f = field_new(X, Y, Y);
    test_random r = {31};
    int partial = 0;
    for (size_t i = 0; i < field_count(&f); i++) f.value[i] = (double)(i % X) + 7 * random_range(&r, -1, 1);
    field_build(&f);
    for (int n = 0; n < 8; n++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = (isogi_dvr_method)kind[n].method,
                                     .order = 2, .directions = 16, .grid = {17, 5, 5}, .coarsest = kind[n].coarsest,
                                     .radius = kind[n].radius, .reduction = kind[n].reduction};
        isogi_transfer_point p[POINTS];
        const isogi_transfer transfer = {p, POINTS, NULL, 0};
        for (int i = 0; i < POINTS; i++)
            p[i] = (isogi_transfer_point){16.0 * i, {1, (float)i / 8, 0.5f}, i && i < 8 ? 0.02f * (float)(i % 3) : 0.003f};
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        for (int edit = 0; edit < (LONG_SUITE ? 60 : 2); edit++) {
            const double plane[1][4] = {{random_range(&r, -1, 1), random_range(&r, -0.5, 0.5), random_range(&r, -0.5, 0.5), 60}};
            isogi_transfer_point *q = &p[1 + random_bits(&r) % (POINTS - 2)];
            double most[3];
            q->extinction = random_unit(&r) < 0.4 ? 0 : (float)random_range(&r, 0.005, 0.2), q->rgb[0] = (float)random_unit(&r);
            CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
            size_t cut = random_unit(&r) < 0.3;
            CHECK(isogi_dvr_set_clip(dvr, plane, cut) == ISOGI_OK, "clip");
            if (random_unit(&r) < 0.5) {
                double remaining;
                CHECK(isogi_dvr_step(dvr, 1 + random_bits(&r) % 9000, &remaining) == ISOGI_OK, "step");
                partial += remaining > 0;
                if (random_unit(&r) < 0.5) continue; /* the next edit comes before this one is done */
            }
            CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
            isogi_dvr *fresh = dvr_new(&desc, &transfer);
            CHECK(isogi_dvr_set_clip(fresh, plane, cut) == ISOGI_OK && isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK, "step");
            for (int i = 0; i < PLACES; i++)
                for (int a = 0; a < 3; a++) at[i][a] = (float)random_range(&r, 0, (a ? Y : X) - 1);
            differences(dvr, fresh, (const float(*)[3])at, PLACES, kind[n].method == ISOGI_DVR_PAPER, most);
            /* the function's ends stay as they are, and so do the classes of values: then bits are the same */
            CHECK(!(most[0] > 0) && !(most[1] > 0) && !(most[2] > 0), "kind %d, edit %d: visibility off by %g, local by %g, values by %g",
                  n, edit, most[0], most[1], most[2]);
            isogi_dvr_free(fresh);
        }
        isogi_dvr_free(dvr);
    }
    CHECK(partial > (LONG_SUITE ? 50 : 1), "%d steps that were broken off", partial);
    field_free(&f);
}

/* Steps a renderer to the end, and compares it with a new one at random places. */
static void check_like_a_new_renderer(isogi_dvr *dvr, const isogi_dvr_desc *desc, const isogi_transfer *transfer, const field *f,
                                      double allowed, const char *why) {
    enum { PLACES = 300 };
    static float at[PLACES][3];
    test_random r = {17};
    double most[3];
    isogi_dvr *fresh = dvr_new(desc, transfer);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK && isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK, "step");
    for (int i = 0; i < PLACES; i++)
        for (int a = 0; a < 3; a++) at[i][a] = (float)random_range(&r, 0, f->size[a] - 1);
    differences(dvr, fresh, (const float(*)[3])at, PLACES, desc->method == ISOGI_DVR_PAPER, most);
    CHECK(most[0] <= allowed && most[1] <= allowed && most[2] <= allowed, "%s: visibility off by %g, local by %g, values by %g", why,
          most[0], most[1], most[2]);
    isogi_dvr_free(fresh);
}

/* A field of 16 voxels' wide layers along x, its values those of `layer`, and up to `noise` more. */
static field layers(const double *layer, const double *noise, int count) {
    field f = field_new(16 * count + 1, 17, 17);
    test_random r = {3};
    for (size_t i = 0; i < field_count(&f); i++) {
        const int x = (int)(i % (size_t)f.size[0]), k = x / 16 < count ? x / 16 : count - 1;
        f.value[i] = layer[k] + noise[k] * random_unit(&r);
    }
    return f;
}

/* Sweeps: where a block empties, nodes on its faces keep what absorbs in the block beside it, which does not change. */
TEST(what_absorbs_beside_a_block_that_empties_stays) {
    const double layer[3] = {30, 10, 10}, none[3] = {0, 0, 0};
    isogi_transfer_point p[] = {{0, {1, 1, 1}, 0.01f}, {5, {1, 1, 1}, 0},  {8, {1, 1, 1}, 0.1f},
                                {18, {1, 1, 1}, 0.1f}, {19, {1, 1, 1}, 0}, {22, {1, 1, 1}, 0},
                                {25, {1, 1, 1}, 0.3f}, {39, {1, 1, 1}, 0.3f}, {40, {1, 1, 1}, 0}};
    const isogi_transfer transfer = {p, 9, NULL, 0};
    field f = layers(layer, none, 3);
    for (int i = 0; i < 17 * 17; i++) f.value[i * 49 + 16] = 20, f.value[i * 49 + 40] = i % 2 ? 40 : 0; /* layers part; a range for all */
    field_build(&f);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_SWEEP, .order = 2,
                                 .directions = 32, .grid = {13, 5, 5}};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    p[2].extinction = p[3].extinction = 0;
    CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
    check_like_a_new_renderer(dvr, &desc, &transfer, &f, 1e-5, "the second and third block empty");
    isogi_dvr_free(dvr), field_free(&f);
}

/* The paper's method: colours move the classes of values, and blocks that are still due must not take new ones for old. */
TEST(colours_that_change_between_steps_change_no_visibility) {
    const double layer[4] = {0, 0, 0, 0}, noise[4] = {100, 100, 100, 100};
    isogi_transfer_point p[] = {{0, {1, 1, 1}, 0.01f}, {50, {1, 1, 1}, 0.01f}, {60, {1, 1, 1}, 0.2f}, {100, {1, 1, 1}, 0.2f}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    field f = layers(layer, noise, 4);
    field_build(&f);
    for (int blocks = 0; blocks < 4; blocks++) {
        const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 2,
                                     .directions = 32, .grid = {9, 5, 5}, .reduction = 1};
        double left = 0;
        p[0].rgb[0] = p[3].rgb[0] = 1;
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        CHECK(isogi_dvr_step(dvr, 64 * 32 * (uint64_t)(4 + blocks), &left) == ISOGI_OK && left > 0, "step");
        p[0].rgb[0] = p[3].rgb[0] = 0.5f;
        CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
        check_like_a_new_renderer(dvr, &desc, &transfer, &f, 1e-3, "other colours");
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* The paper's method: data of a coarse block are averages, on its faces of the block beside it, too. What changes in that one alone changes
   the extinction in both, and is seen by rays of the blocks on either side of them. */
TEST(averages_on_faces_follow_both_blocks) {
    const double layer[5] = {10, 10, 30, 30, 30}, none[5] = {0, 0, 0, 0, 0};
    isogi_transfer_point p[] = {{0, {1, 0, 0}, 0.02f},     {6, {1, 0, 0}, 0.02f},  {8, {1, 1, 1}, 0.02f},
                                {16.5, {1, 1, 1}, 0.02f},  {16.6, {1, 1, 1}, 0.02f}, {19, {1, 1, 1}, 0.02f},
                                {19.2, {1, 1, 1}, 0.02f}, {30, {1, 1, 1}, 0.02f}, {31, {1, 1, 1}, 0}};
    const isogi_transfer transfer = {p, 9, NULL, 0};
    field f = layers(layer, none, 5);
    for (int i = 0; i < 17 * 17; i++) {
        f.value[i * 81 + 32] = 10;
        for (int x = 1; x < 16; x += 3) f.value[i * 81 + x] = 5; /* a fine block, then a coarse one */
    }
    field_build(&f);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 2,
                                 .directions = 32, .grid = {21, 5, 5}, .reduction = 81 * 17 * 17 / 4200.0, .radius = 16};
    isogi_dvr *dvr = dvr_new(&desc, &transfer);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    p[4].extinction = p[5].extinction = 1; /* of values that occur nowhere, but between 10 and 30 */
    CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
    check_like_a_new_renderer(dvr, &desc, &transfer, &f, 0, "values between two layers");
    isogi_dvr_free(dvr), field_free(&f);
}

/* The paper's method: blocks of one cluster are computed, then those that are due of another vanish; faces of the first are finished. */
TEST(faces_are_finished_where_no_block_is_left) {
    const double layer[9] = {10, 10, 20, 20, 20, 20, 20, 30, 30}, noise[9] = {3, 3, 0, 0, 0, 0, 0, 1, 1};
    isogi_transfer_point p[] = {{0, {1, 1, 1}, 0.01f}, {9, {1, 1, 1}, 0},  {13, {1, 1, 1}, 0}, {18, {1, 1, 1}, 0},   {22, {1, 1, 1}, 0},
                                {29, {1, 1, 1}, 0},    {32, {1, 1, 1}, 0}, {39, {1, 1, 1}, 0}, {40, {1, 1, 1}, 0.01f}};
    const isogi_transfer transfer = {p, 9, NULL, 0};
    field f = layers(layer, noise, 9);
    field_build(&f);
    const isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .method = ISOGI_DVR_PAPER, .order = 2,
                                 .directions = 32, .grid = {37, 5, 5}, .radius = 16};
    for (int blocks = 1; blocks < 8; blocks++) {
        p[1].extinction = p[2].extinction = 0.02f, p[5].extinction = p[6].extinction = 0.05f;
        isogi_dvr *dvr = dvr_new(&desc, &transfer);
        CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
        p[1].extinction = p[2].extinction = p[5].extinction = p[6].extinction = 0.2f;
        CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_step(dvr, 64 * 32 * 9, NULL) == ISOGI_OK && /* histograms */
                  isogi_dvr_step(dvr, 64 * 32 * (uint64_t)blocks, NULL) == ISOGI_OK,
              "edit");
        p[5].extinction = p[6].extinction = 0;
        CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "second edit");
        check_like_a_new_renderer(dvr, &desc, &transfer, &f, 0, "a cluster vanishes");
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

/* ---- random edits of random scenes ---- */

/* A context whose memory, or patience, comes to an end. */
typedef struct limits { int blocks, reports, cancelled; } limits; /* that are left; below 0: any number; whether it was */

static void *limited_alloc(void *user, size_t size, size_t align) {
    limits *l = (limits *)user;
    void *p = NULL;
    if (!l->blocks) return NULL;
    l->blocks -= l->blocks > 0;
    if (posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    return memset(p, 0xd5, size);
}

static void limited_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

static int limited_progress(void *user, double fraction) {
    limits *l = (limits *)user;
    (void)fraction;
    if (!l->reports) return l->reports = -1, l->cancelled = 1;
    l->reports -= l->reports > 0;
    return 0;
}

static int one_of(test_random *r, int n) { return (int)(random_bits(r) % (uint64_t)n); }
static int chance(test_random *r, double p) { return random_unit(r) < p; }

/* Up to three blocks a side, whole or not, one axis up to eight; values 0..100. Of most scenes blocks are of one value each, with some
   noise or not, and their faces part them: then an edit changes some blocks, and not those beside them. */
static field random_scene(test_random *r) {
    int n[3], faces = chance(r, 0.7), waves = chance(r, 0.2), longest = one_of(r, 3);
    double value[512], noise[512];
    for (int a = 0; a < 3; a++) {
        n[a] = chance(r, 0.5) ? 16 * (1 + one_of(r, a == longest ? 7 : 2)) + 1 : 2 + one_of(r, a == longest ? 110 : 32);
        if (a != longest && chance(r, 0.3)) n[a] = 17;
    }
    field f = field_new(n[0], n[1], n[2]);
    for (int i = 0; i < 512; i++) {
        value[i] = chance(r, 0.5) ? 50 : random_range(r, 0, 100);
        noise[i] = chance(r, 0.5) ? 0 : random_range(r, 0, 10);
    }
    for (size_t i = 0; i < field_count(&f); i++) {
        const int at[3] = {(int)(i % (size_t)n[0]), (int)(i / (size_t)n[0] % (size_t)n[1]), (int)(i / (size_t)n[0] / (size_t)n[1])};
        const int block = at[0] / 16 + 8 * (at[1] / 16) + 64 * (at[2] / 16);
        double v = value[block] + noise[block] * random_range(r, -1, 1);
        for (int a = 0; a < 3; a++)
            if (faces && at[a] && at[a] % 16 == 0) v = 50;
        if (waves) v = 50 + 45 * sin(0.2 * at[0] + 0.13 * at[1] - 0.3 * at[2] + value[0]);
        f.value[i] = fmin(100, fmax(0, v));
    }
    f.value[0] = 0, f.value[field_count(&f) - 1] = 100;
    if (chance(r, 0.3))
        for (size_t i = 0; i < field_count(&f) / 50; i++) f.value[random_bits(r) % field_count(&f)] = chance(r, 0.7) ? NAN : INFINITY;
    if (chance(r, 0.3))
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = exp(random_range(r, -1, 1)), f.volume.origin[a] = random_range(r, -100, 100);
    field_build(&f);
    return f;
}

/* Along axes or not, through the edges of blocks or anywhere, of any length. */
static size_t random_planes(test_random *r, const field *f, double (*planes)[4]) {
    const size_t count = (size_t)(chance(r, 0.2) ? 0 : chance(r, 0.7) ? 1 : one_of(r, 5));
    for (size_t i = 0; i < count; i++) {
        const int axis = one_of(r, 4);
        double grid[3], world[3], length = chance(r, 0.8) ? 1 : exp(random_range(r, -20, 20));
        for (int a = 0; a < 3; a++) {
            grid[a] = chance(r, 0.5) ? 16 * one_of(r, 1 + f->size[a] / 16) : random_range(r, 0, f->size[a] - 1);
            planes[i][a] = length * (axis == 3 ? random_range(r, -1, 1) : a != axis ? 0 : chance(r, 0.5) ? 1 : -1);
        }
        isogi_vol_to_world(f->pyramid, grid, world);
        planes[i][3] = -(planes[i][0] * world[0] + planes[i][1] * world[1] + planes[i][2] * world[2]);
    }
    return count;
}

/* A step of any size that may be cancelled, or find no memory. */
static void random_step(test_random *r, isogi_dvr *dvr, limits *l) {
    l->blocks = chance(r, 0.2) ? one_of(r, 20) : -1, l->reports = chance(r, 0.3) ? one_of(r, 30) : -1, l->cancelled = 0;
    isogi_result result = isogi_dvr_step(dvr, chance(r, 0.2) ? 0 : 1 + random_bits(r) % (chance(r, 0.5) ? 3000 : 300000), NULL);
    CHECK(result == ISOGI_OK || (result == ISOGI_NO_MEMORY && !l->blocks) || (result == ISOGI_CANCELLED && l->cancelled), "%s",
          isogi_result_string(result));
    l->blocks = l->reports = -1;
}

TEST(random_edits_of_random_scenes_end_like_a_new_renderer) {
    enum { POINTS = 10, PLACES = 200 };
    static float at[PLACES][3];
    int edits = 0;
    for (int scene = 0; scene < (LONG_SUITE ? 250 : QUICK_SUITE ? 3 : 30); scene++) {
        test_random r = {1000 + (uint64_t)scene};
        field f = random_scene(&r);
        limits l = {-1, -1, 0};
        const isogi_context context = {.alloc = limited_alloc, .release = limited_release, .progress = limited_progress, .user = &l,
                                       .threads = 1 + one_of(&r, 2), .force_path = one_of(&r, 3)};
        isogi_dvr_desc desc = {.pyramid = f.pyramid, .shading = ISOGI_DVR_VISIBILITY, .order = 2, .directions = 8 + one_of(&r, 8),
                               .radius = random_range(&r, 1, 32), .reduction = pow(10, random_range(&r, 0, 3))};
        isogi_transfer_point p[POINTS];
        const isogi_transfer transfer = {p, POINTS, NULL, 0};
        double planes[4][4], most[3];
        size_t count = 0;
        const int cuts = chance(&r, 0.5);
        desc.method = (isogi_dvr_method)(scene % 8 < 5 ? ISOGI_DVR_PAPER : scene % 8 < 7 ? ISOGI_DVR_SWEEP : ISOGI_DVR_BRUTE);
        for (int a = 0; a < 3; a++) desc.grid[a] = 1 + (size_t)one_of(&r, desc.method == ISOGI_DVR_BRUTE ? 4 : 12);
        if (desc.method == ISOGI_DVR_SWEEP && chance(&r, 0.5)) desc.coarsest = 1 << one_of(&r, 4);
        for (int i = 0; i < POINTS; i++) /* the ends stay as they are, and so do the classes of values; faces of blocks are of 50 */
            p[i] = (isogi_transfer_point){100.0 * i / (POINTS - 1), {(float)random_unit(&r), 1, 0}, 0.003f};
        p[4].value = 46, p[5].value = 54, p[4].extinction = p[5].extinction = 0;
        isogi_dvr *dvr = dvr_new_with(&desc, &transfer, &context);
        for (int edit = 0; edit < 6; edit++) {
            for (int step = one_of(&r, 3); step >= 0; step--) {
                const int k = 1 + one_of(&r, POINTS - 2);
                if (k != 4 && k != 5) p[k].extinction = chance(&r, 0.45) ? 0 : (float)random_range(&r, 0.005, 0.4);
                CHECK(isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK, "edit");
                if (cuts && chance(&r, 0.5)) {
                    count = random_planes(&r, &f, planes);
                    CHECK(isogi_dvr_set_clip(dvr, (const double(*)[4])planes, count) == ISOGI_OK, "clip");
                }
                for (int more = one_of(&r, 4); more > 0; more--) random_step(&r, dvr, &l);
            }
            isogi_dvr *fresh = dvr_new_with(&desc, &transfer, &(isogi_context){.threads = 1, .force_path = context.force_path});
            CHECK(isogi_dvr_set_clip(fresh, (const double(*)[4])planes, count) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                      isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK,
                  "step");
            for (int i = 0; i < PLACES; i++) {
                double grid[3], world[3];
                for (int a = 0; a < 3; a++)
                    grid[a] = chance(&r, 0.3) ? one_of(&r, f.size[a]) : random_range(&r, 0, f.size[a] - 1);
                isogi_vol_to_world(f.pyramid, grid, world);
                for (int a = 0; a < 3; a++) at[i][a] = (float)world[a];
            }
            differences(dvr, fresh, (const float(*)[3])at, PLACES, desc.method == ISOGI_DVR_PAPER, most);
            CHECK(!(most[0] > 0) && !(most[1] > 0) && !(most[2] > 0),
                  "scene %d, edit %d, %s: visibility off by %g, local by %g, values by %g", scene, edit, method_name[desc.method], most[0],
                  most[1], most[2]);
            isogi_dvr_free(fresh), edits++;
        }
        isogi_dvr_free(dvr), field_free(&f);
    }
    printf("    %d edits\n", edits);
}

TEST_MAIN("dvr_edits")
