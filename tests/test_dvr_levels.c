/* Global visibility of several resolutions (isogi_dvr_desc.coarsest): seams, closed forms, error and memory beside the regular grid. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "test.h"

enum { N = 65, SIDE = 48 };

/* A floor, a ball above it, and a thin haze beside it: blocks of every step. */
static double ball(double x, double y, double z) {
    double r = sqrt((x - 0.5) * (x - 0.5) + (y - 0.28) * (y - 0.28) + (z - 0.5) * (z - 0.5));
    double inside = 1 - r / 0.1, floor = 0.12 - y;
    return fmax(fmax(inside, 8 * floor), x > 0.8 ? 0.05 : 0);
}
static const isogi_transfer_point solid[] = {
    {0, {1, 1, 1}, 0}, {0.02, {1, 1, 1}, 0}, {0.03, {1, 1, 1}, 0.006f}, {0.1, {1, 1, 1}, 0.006f}, {0.25, {0.8f, 0.5f, 0.3f}, 2}};
static const isogi_transfer scenery = {solid, 5, NULL, 0};

static isogi_dvr *stepped(const isogi_dvr_desc *desc, const isogi_transfer *transfer, const isogi_context *context) {
    isogi_dvr *dvr = context ? dvr_new_with(desc, transfer, context) : dvr_new(desc, transfer);
    CHECK(isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "step");
    return dvr;
}

static isogi_dvr_desc several(const field *f, size_t grid, int coarsest) {
    const isogi_dvr_desc desc = {
        .pyramid = f->pyramid, .shading = ISOGI_DVR_VISIBILITY, .directions = 24, .grid = {grid, grid, grid}, .coarsest = coarsest};
    return desc;
}

/* Within a block the function is trilinear between its points, and where blocks meet both sides have the same one: points on all faces
   between blocks, and a little to either side. Light in pictures is joined in the same way. */
TEST(blocks_of_different_steps_meet_without_a_seam) {
    field f = field_of(ball, N);
    isogi_dvr_desc desc = several(&f, 33, 8);
    isogi_dvr *dvr = stepped(&desc, &scenery, NULL);
    isogi_dvr_report report;
    test_random r = {3};
    double most = 0, across = 0;
    CHECK(isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "inspect");
    for (int k = 0; k < 4; k++) CHECK(report.step_count[k], "no block of step %d", 1 << k);
    CHECK(report.grid_points < 33 * 33 * 33 && report.global_bytes < 33 * 33 * 33 * 9 * sizeof(float), "%zu points", report.grid_points);
    for (int i = 0; i < 20000; i++) {
        float p[2][3], v[2][9];
        int faces = 1 + i % 3; /* 2, 3: edges and corners */
        for (int a = 0; a < 3; a++) {
            double x = random_range(&r, 0, N - 1);
            if ((a + i / 3) % 3 < faces) x = 16 * (1 + (double)(random_bits(&r) % 3)); /* 8 distances are 16 voxels */
            p[0][a] = p[1][a] = (float)x;
            if ((a + i / 3) % 3 < faces) p[0][a] -= 1e-4f, p[1][a] += 1e-4f;
        }
        isogi_dvr_sample_visibility(dvr, (const float(*)[3])p, 2, v[0]);
        for (int c = 0; c < 9; c++) most = fmax(most, fabs((double)v[0][c] - (double)v[1][c]));
        isogi_dvr_sample_visibility(dvr, (const float(*)[3])p, 1, v[0]);
        for (int a = 0; a < 3; a++) p[1][a] = p[0][a] + ((a + i / 3) % 3 < faces ? 0.5f : 0);
        isogi_dvr_sample_visibility(dvr, (const float(*)[3])p, 2, v[0]);
        across = fmax(across, fabs((double)v[0][0] - (double)v[1][0]));
    }
    /* a slope of 3.5 to two voxels, over 2e-4 voxels, in each of three directions */
    CHECK(most < 2e-3 && across > 0.1, "a step of %g; half a voxel changes %g", most, across);
    isogi_dvr_free(dvr);
    field_free(&f);
}

static double lower_half(double x, double y, double z) { return (void)x, (void)y, z < 0.49; }

/* The lower half is opaque within a distance of the grid. Of eight layers of 64 blocks the two at its face hold every point; the others,
   which are empty or buried, hold every eighth. */
TEST(blocks_that_are_buried_are_as_coarse_as_empty_ones) {
    field f = field_of(lower_half, N);
    const isogi_transfer_point p[] = {{0.5, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 8}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    isogi_dvr_desc desc = several(&f, 65, 8);
    desc.directions = 8, desc.order = 1, desc.visibility_step = 1;
    isogi_dvr *dvr = stepped(&desc, &transfer, NULL);
    isogi_dvr_report report;
    CHECK(isogi_dvr_inspect(dvr, &report) == ISOGI_OK, "inspect");
    CHECK(report.step_count[0] == 128 && !report.step_count[1] && !report.step_count[2] && report.step_count[3] == 384,
          "blocks that hold every 1st, 2nd, 4th, 8th point: %zu %zu %zu %zu", report.step_count[0], report.step_count[1],
          report.step_count[2], report.step_count[3]);
    isogi_dvr_free(dvr);
    field_free(&f);
}

static double height(double x, double y, double z) { return (void)x, (void)y, 48 * z; }

/* A slab of 8 voxels whose optical depth across is 0.65, its upper face just below a border of blocks: within it and up to two distances
   of the grid beside it, coefficient by coefficient. The transmittance of a ray is known, its projection is by quadrature over
   directions. */
TEST(a_slab_is_seen_as_its_closed_form_says) {
    enum { PLACES = 40 };
    static float at[PLACES][3], v[2][PLACES][4];
    field f = field_of(height, 49);
    const isogi_transfer_point p[] = {{17, {1, 1, 1}, 0}, {17, {1, 1, 1}, 0.1f}, {23.5, {1, 1, 1}, 0.1f}, {23.5, {1, 1, 1}, 0}};
    const isogi_transfer transfer = {p, 4, NULL, 0};
    test_random r = {5};
    double worst[2] = {0, 0}, points[2];
    for (int i = 0; i < PLACES; i++)
        for (int a = 0; a < 3; a++) at[i][a] = (float)(a == 2 ? random_range(&r, 15.5, 26.5) : random_range(&r, 4, 44));
    for (int n = 0; n < 2; n++) {
        isogi_dvr_desc desc = several(&f, 33, n ? 8 : 1);
        isogi_dvr_report report;
        desc.order = 2, desc.directions = 256, desc.visibility_step = 0.75;
        isogi_dvr *dvr = stepped(&desc, &transfer, &serial);
        isogi_dvr_inspect(dvr, &report), points[n] = (double)report.grid_points;
        isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[n][0]);
        isogi_dvr_free(dvr);
    }
    for (int i = 0; i < PLACES; i++) {
        double exact[4] = {0, 0, 0, 0};
        enum { RAYS = 4000 };
        for (int k = 0; k < RAYS; k++) {
            double z = 1 - (2 * k + 1.0) / RAYS, s = sqrt(1 - z * z), phi = 2 * PI * fmod(k * 0.6180339887498949, 1),
                   dir[3] = {s * cos(phi), s * sin(phi), z}, leave = 1e9, t0, t1, clear;
            for (int a = 0; a < 3; a++) leave = fmin(leave, ((dir[a] > 0 ? 48 : 0) - (double)at[i][a]) / dir[a]);
            t0 = fmax(0, fmin((17 - (double)at[i][2]) / dir[2], (23.5 - (double)at[i][2]) / dir[2]));
            t1 = fmin(leave, fmax((17 - (double)at[i][2]) / dir[2], (23.5 - (double)at[i][2]) / dir[2]));
            clear = t1 > t0 ? exp(-0.1 * (t1 - t0)) : 1;
            exact[0] += clear * sqrt(0.25 / PI), exact[1] += clear * sqrt(0.75 / PI) * dir[1], exact[2] += clear * sqrt(0.75 / PI) * dir[2];
            exact[3] += clear * sqrt(0.75 / PI) * dir[0];
        }
        for (int n = 0; n < 2; n++)
            for (int c = 0; c < 4; c++) worst[n] = fmax(worst[n], fabs((double)v[n][i][c] - exact[c] * 4 * PI / RAYS));
    }
    /* 0.149 for both: at its faces a slab is blurred by a node of the lattice, 0.1 of depth along rays that graze it. Nothing is lost by
       the
       points that are left out */
    CHECK(worst[1] < 0.2 && worst[1] < worst[0] + 1e-3 && points[1] < 0.7 * points[0],
          "worst error %g, of the regular grid %g; %g of %g points", worst[1], worst[0], points[1], points[0]);
    field_free(&f);
}

static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
static const isogi_light sun = {.vector = {1, 2, 0.7f}, .rgb = {3, 3, 3}};
static const isogi_lighting outdoors = {.env = {.sh = sky, .sh_order = 1}, .lights = &sun, .light_count = 1};
static const isogi_view slanting = {.width = SIDE, .height = SIDE, .eye = {140, 110, 170}, .target = {32, 28, 32}};

static void draw(const isogi_dvr *dvr, const isogi_lighting *lighting, float (*image)[4]) {
    CHECK(isogi_dvr_render(dvr, &slanting, lighting, image, NULL, NULL) == ISOGI_OK, "render");
}

/* A picture by blocks is that of the regular grid of as many points to an axis, at half the memory, and nearer to a finer grid's than that
   of the regular grid that takes as much memory. */
TEST(several_resolutions_err_as_the_fine_grid_at_the_memory_of_a_coarse_one) {
    static float image[4][SIDE * SIDE][4];
    field f = field_of(ball, N);
    const size_t grids[4] = {65, 33, 33, 25};
    double bytes[4], error[4];
    for (int n = 0; n < 4; n++) {
        isogi_dvr_desc desc = several(&f, grids[n], n == 2 ? 8 : 1);
        isogi_dvr *dvr = stepped(&desc, &scenery, &serial);
        isogi_dvr_report report;
        isogi_dvr_inspect(dvr, &report), bytes[n] = (double)report.global_bytes;
        draw(dvr, &outdoors, image[n]), error[n] = rms_difference(image[n], image[0], SIDE * SIDE);
        isogi_dvr_free(dvr);
    }
    printf("    33^3: %.3g of %.2g MB; in several resolutions %.3g of %.2g MB; 25^3: %.3g of %.2g MB\n", error[1], bytes[1] * 1e-6,
           error[2], bytes[2] * 1e-6, error[3], bytes[3] * 1e-6);
    CHECK(bytes[2] < 0.75 * bytes[1] && error[2] < 1.05 * error[1] && error[2] < error[3] && error[3] > 0, "errors %g %g %g", error[1],
          error[2], error[3]);
    field_free(&f);
}

/* Vectors of every path read the blocks as the plain code does; so do lights nearby, which are added to it. */
TEST(every_path_reads_the_blocks) {
    static float image[5][SIDE * SIDE][4];
    static float voxels[N * N * N];
    field f = field_of(ball, N);
    isogi_volume single = *isogi_vol_volume(f.pyramid);
    isogi_pyramid *doubles = f.pyramid;
    const isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {400, 900, 300}, .rgb = {3e6f, 3e6f, 3e6f}};
    const isogi_lighting near_by = {.lights = &lamp, .light_count = 1};
    for (int i = 0; i < N * N * N; i++) voxels[i] = (float)f.value[i]; /* vectors read floats, not doubles */
    single.data = voxels, single.type = ISOGI_F32, memset(single.stride, 0, sizeof single.stride);
    CHECK(isogi_vol_build(&f.pyramid, &single, &serial) == ISOGI_OK, "build");
    for (int kind = 0; kind < 3; kind++) { /* a table of light, lights nearby, light scattered forward */
        for (int path = 1; path <= 4; path++) {
            const isogi_context context = {.threads = 1, .force_path = path};
            isogi_dvr_desc desc = several(&f, 33, 8);
            desc.anisotropy = kind == 2 ? 0.5 : 0;
            isogi_dvr *dvr = stepped(&desc, &scenery, &context);
            draw(dvr, kind == 1 ? &near_by : &outdoors, image[path]);
            isogi_dvr_free(dvr);
            CHECK(largest_difference(image[path], image[1], SIDE * SIDE) < 2e-3, "path %d: differs by %g", path,
                  largest_difference(image[path], image[1], SIDE * SIDE));
        }
        isogi_dvr_desc desc = several(&f, 33, 1);
        desc.anisotropy = kind == 2 ? 0.5 : 0;
        isogi_dvr *dvr = stepped(&desc, &scenery, &serial);
        draw(dvr, kind == 1 ? &near_by : &outdoors, image[0]);
        CHECK(rms_difference(image[0], image[1], SIDE * SIDE) < 4e-3, "light %d: rms %g from the regular grid", kind,
              rms_difference(image[0], image[1], SIDE * SIDE));
        isogi_dvr_free(dvr);
    }
    isogi_vol_free(f.pyramid), f.pyramid = doubles;
    field_free(&f);
}

/* Threads, slices, edits and back again: the same bits, as no block that an edit changes is classified with other classes here. Until an
   edit's last direction is swept, what is seen is what was. */
TEST(slices_threads_and_edits_of_several_resolutions_give_the_same_bits) {
    static float v[4][500][9], at[500][3];
    field f = field_of(ball, N);
    const isogi_context two = {.threads = 2};
    isogi_transfer_point edited[5];
    const isogi_transfer other = {edited, 5, NULL, 0};
    test_random r = {11};
    isogi_dvr_desc desc = several(&f, 33, 4);
    isogi_dvr *dvr[2] = {stepped(&desc, &scenery, &serial), dvr_new_with(&desc, &scenery, &two)};
    isogi_dvr_report report[2];
    double remaining = 1, last = 2;
    memcpy(edited, solid, sizeof edited), edited[2].extinction = edited[3].extinction = 0.3f;
    for (int i = 0; i < 500; i++)
        for (int a = 0; a < 3; a++) at[i][a] = (float)random_range(&r, -1, N);
    while (remaining > 0) {
        CHECK(isogi_dvr_step(dvr[1], 1000, &remaining) == ISOGI_OK && remaining < last, "%g after %g", remaining, last);
        last = remaining;
    }
    for (int n = 0; n < 2; n++) isogi_dvr_sample_visibility(dvr[n], (const float(*)[3])at, 500, v[n][0]);
    CHECK(!memcmp(v[0], v[1], sizeof v[0]), "threads or slices");
    CHECK(isogi_dvr_set_transfer(dvr[0], &other) == ISOGI_OK && isogi_dvr_step(dvr[0], 40000, &remaining) == ISOGI_OK && remaining > 0,
          "edit: %g left", remaining);
    isogi_dvr_sample_visibility(dvr[0], (const float(*)[3])at, 500, v[2][0]);
    CHECK(!memcmp(v[0], v[2], sizeof v[0]), "half of an edit shows");
    CHECK(isogi_dvr_step(dvr[0], 0, NULL) == ISOGI_OK && isogi_dvr_inspect(dvr[0], &report[0]) == ISOGI_OK &&
              isogi_dvr_inspect(dvr[1], &report[1]) == ISOGI_OK,
          "step");
    isogi_dvr_sample_visibility(dvr[0], (const float(*)[3])at, 500, v[2][0]);
    CHECK(memcmp(v[0], v[2], sizeof v[0]) && report[0].grid_points > report[1].grid_points, "the edit changes nothing");
    CHECK(isogi_dvr_set_transfer(dvr[0], &scenery) == ISOGI_OK && isogi_dvr_step(dvr[0], 0, NULL) == ISOGI_OK &&
              isogi_dvr_inspect(dvr[0], &report[0]) == ISOGI_OK,
          "back");
    isogi_dvr_sample_visibility(dvr[0], (const float(*)[3])at, 500, v[3][0]);
    CHECK(report[0].grid_points == report[1].grid_points && !memcmp(v[0], v[3], sizeof v[0]), "an edit and back: %zu points, were %zu",
          report[0].grid_points, report[1].grid_points);
    isogi_dvr_free(dvr[0]), isogi_dvr_free(dvr[1]);
    field_free(&f);
}

/* Memory whose allocation number `fail` fails (-1: none); live: blocks in use. */
typedef struct meagre { int fail, calls, live; } meagre;
static void *meagre_alloc(void *user, size_t size, size_t align) {
    meagre *m = (meagre *)user;
    void *p;
    if (m->calls++ == m->fail) return NULL;
    m->live++;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void meagre_release(void *user, void *p, size_t size) { (void)size, ((meagre *)user)->live -= p != NULL, free(p); }

/* What is half gathered when the function or the planes change is given up: nothing of it shows, nothing leaks, and the end has the bits
   of a renderer made for the new function. Edits keep the classes of values; `half` is what must remain for directions to be under way. */
TEST(what_is_half_gathered_is_dropped) {
    enum { PLACES = 200 };
    static float v[3][PLACES][9], at[PLACES][3];
    field f = field_of(ball, 33);
    isogi_transfer_point edited[5];
    const isogi_transfer other = {edited, 5, NULL, 0};
    const double planes[1][4] = {{1, 0.5, 0, -12}};
    test_random r = {12};
    memcpy(edited, solid, sizeof edited), edited[2].extinction = edited[3].extinction = 0.3f;
    for (int i = 0; i < PLACES; i++)
        for (int a = 0; a < 3; a++) at[i][a] = (float)random_range(&r, -1, 33);
    for (int coarsest = 2; coarsest <= 8; coarsest *= 2)
        for (int k = 0; k < (LONG_SUITE ? 10 : 5); k++) { /* back, planes, the same function and planes, freed, to the end */
            const int edit = k % 5, clips = edit == 1 || edit == 2, slices = k < 5 ? coarsest / 2 : 3;
            meagre m = {-1, 0, 0};
            const isogi_context context = {.alloc = meagre_alloc, .release = meagre_release, .user = &m, .threads = 1};
            isogi_dvr_desc desc = several(&f, 17, coarsest);
            desc.directions = LONG_SUITE ? 24 : 12;
            const double half = desc.directions / (desc.directions + 17.0);
            double remaining = 1;
            isogi_dvr *dvr = dvr_new_with(&desc, &scenery, &context), *fresh;
            isogi_dvr_report report[2];
            CHECK(isogi_dvr_step(dvr, 0, &remaining) == ISOGI_OK && remaining <= 0, "step");
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[0][0]);
            CHECK(isogi_dvr_set_transfer(dvr, &other) == ISOGI_OK, "half way: function");
            for (int i = 0; i < slices || !(remaining < half); i++)
                CHECK(isogi_dvr_step(dvr, 4000, &remaining) == ISOGI_OK && remaining > 0, "coarsest %d: %g left", coarsest, remaining);
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[1][0]);
            CHECK(!memcmp(v[0], v[1], sizeof v[0]), "coarsest %d, edit %d: half of it shows", coarsest, edit);
            if (edit == 3) { /* freed */
                isogi_dvr_free(dvr);
                CHECK(m.live == 0, "coarsest %d: %d blocks of memory left", coarsest, m.live);
                continue;
            }
            if (edit == 0 || edit == 2) CHECK(isogi_dvr_set_transfer(dvr, edit == 2 ? &other : &scenery) == ISOGI_OK, "function");
            if (clips) CHECK(isogi_dvr_set_clip(dvr, planes, 1) == ISOGI_OK, "planes");
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[1][0]);
            CHECK(!memcmp(v[0], v[1], sizeof v[0]), "coarsest %d, edit %d: shows before a step", coarsest, edit);
            CHECK(isogi_dvr_step(dvr, 0, &remaining) == ISOGI_OK && remaining <= 0, "end");
            isogi_dvr_inspect(dvr, &report[0]);
            fresh = dvr_new(&desc, edit ? &other : &scenery);
            if (clips) isogi_dvr_set_clip(fresh, planes, 1);
            CHECK(isogi_dvr_step(fresh, 0, NULL) == ISOGI_OK && isogi_dvr_inspect(fresh, &report[1]) == ISOGI_OK, "fresh");
            isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[1][0]);
            isogi_dvr_sample_visibility(fresh, (const float(*)[3])at, PLACES, v[2][0]);
            CHECK(!memcmp(v[1], v[2], sizeof v[1]) && report[0].grid_points == report[1].grid_points, "coarsest %d, edit %d: other bits",
                  coarsest, edit);
            CHECK(!memcmp(v[0], v[1], sizeof v[0]) == !edit, "coarsest %d, edit %d changes nothing", coarsest, edit);
            isogi_dvr_free(dvr), isogi_dvr_free(fresh);
            CHECK(m.live == 0, "coarsest %d, edit %d: %d blocks of memory left", coarsest, edit, m.live);
        }
    field_free(&f);
}

/* Peaks are for brute force, which holds the regular grid; the blocks come back with the sweeps. A function that is transparent clears
   what is held. */
TEST(peaks_take_the_regular_grid_and_sweeps_the_blocks_again) {
    field f = field_of(ball, 17);
    const isogi_peak peak = {0.3, {1, 1, 1}, 0.5f};
    const isogi_transfer peaked = {solid, 5, &peak, 1}, nothing = {NULL, 0, NULL, 0};
    isogi_dvr_desc desc = several(&f, 9, 2);
    isogi_dvr *dvr = stepped(&desc, &scenery, &serial);
    isogi_dvr_report report[3];
    const float at[1][3] = {{8, 5, 8}};
    float v[5][9];
    isogi_dvr_inspect(dvr, &report[0]), isogi_dvr_sample_visibility(dvr, at, 1, v[0]);
    CHECK(isogi_dvr_set_transfer(dvr, &peaked) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "peak");
    isogi_dvr_inspect(dvr, &report[1]), isogi_dvr_sample_visibility(dvr, at, 1, v[1]);
    desc.coarsest = 1, desc.method = ISOGI_DVR_BRUTE;
    isogi_dvr *brute = stepped(&desc, &peaked, &serial);
    isogi_dvr_sample_visibility(brute, at, 1, v[4]), isogi_dvr_free(brute);
    CHECK(report[1].grid_points == 9 * 9 * 9 && !memcmp(v[1], v[4], sizeof v[1]), "%zu points, %g by brute force %g", report[1].grid_points,
          (double)v[1][0], (double)v[4][0]);
    CHECK(isogi_dvr_set_transfer(dvr, &scenery) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "back");
    isogi_dvr_inspect(dvr, &report[2]), isogi_dvr_sample_visibility(dvr, at, 1, v[2]);
    CHECK(report[2].grid_points == report[0].grid_points && !memcmp(v[0], v[2], sizeof v[0]), "%zu points, were %zu", report[2].grid_points,
          report[0].grid_points);
    CHECK(isogi_dvr_set_transfer(dvr, &nothing) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK, "nothing");
    isogi_dvr_sample_visibility(dvr, at, 1, v[3]);
    CHECK(fabs((double)v[3][0] - 2 * sqrt(PI)) < 1e-6 && fabs((double)v[3][2]) < 1e-6, "%g", (double)v[3][0]);
    isogi_dvr_free(dvr);
    field_free(&f);
}

/* The same where blocks of many resolutions lie side by side: points of the regular grid are other ones, and more. */
TEST(peaks_take_the_regular_grid_from_blocks_of_all_kinds) {
    enum { PLACES = 60 };
    field f = field_of(ball, 33);
    const isogi_peak peak = {0.3, {1, 1, 1}, 0.5f};
    const isogi_transfer peaked = {solid, 5, &peak, 1};
    isogi_dvr_desc desc = several(&f, 33, 8);
    float at[PLACES][3], v[2][PLACES][1];
    test_random r = {23};
    isogi_dvr_report report;
    desc.directions = 6, desc.order = 1;
    for (int i = 0; i < 3 * PLACES; i++) at[i / 3][i % 3] = (float)random_range(&r, 0, 32);
    for (int k = 0; k < 2; k++) {
        if (k) desc.coarsest = 1, desc.method = ISOGI_DVR_BRUTE;
        isogi_dvr *dvr = stepped(&desc, k ? &peaked : &scenery, &serial);
        if (!k) CHECK(isogi_dvr_inspect(dvr, &report) == ISOGI_OK && report.grid_points < 20000, "%zu points", report.grid_points);
        CHECK(isogi_dvr_set_transfer(dvr, &peaked) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK &&
                  isogi_dvr_sample_visibility(dvr, (const float(*)[3])at, PLACES, v[k][0]) == ISOGI_OK,
              "peak");
        CHECK(isogi_dvr_inspect(dvr, &report) == ISOGI_OK && report.grid_points == 33 * 33 * 33, "%zu points", report.grid_points);
        isogi_dvr_free(dvr);
    }
    CHECK(!memcmp(v[0], v[1], sizeof v[0]), "not what brute force has");
    field_free(&f);
}

/* Memory that runs out: a code, nothing lost, and the next call goes on to the same bits. */
TEST(any_allocation_of_several_resolutions_may_fail) {
    field f = field_of(ball, 33);
    const float at[2][3] = {{16, 14, 16}, {30, 4, 9}};
    float expected[2][9];
    isogi_dvr_desc desc = several(&f, 17, 8);
    isogi_dvr *dvr = stepped(&desc, &scenery, &serial);
    isogi_dvr_sample_visibility(dvr, at, 2, expected[0]), isogi_dvr_free(dvr);
    for (int k = 0, failed = 1; failed; k++) {
        meagre m = {k, 0, 0};
        const isogi_context context = {.alloc = meagre_alloc, .release = meagre_release, .user = &m, .threads = 1};
        isogi_result result;
        failed = 0, dvr = NULL;
        result = isogi_dvr_create(&dvr, &desc, &context);
        CHECK(result == (m.calls > k ? ISOGI_NO_MEMORY : ISOGI_OK), "create %d: %s", k, isogi_result_string(result));
        if (result != ISOGI_OK) failed = 1;
        while (dvr && isogi_dvr_set_transfer(dvr, &scenery) != ISOGI_OK) failed++;
        while (dvr && isogi_dvr_step(dvr, 0, NULL) != ISOGI_OK) failed++;
        CHECK(failed < 2, "allocation %d: %d calls failed", k, failed);
        if (dvr) {
            static float image[SIDE * SIDE][4];
            float v[2][9];
            isogi_dvr_sample_visibility(dvr, at, 2, v[0]);
            CHECK(!memcmp(v, expected, sizeof v), "allocation %d: other bits", k);
            while (isogi_dvr_render(dvr, &slanting, &outdoors, image, NULL, NULL) != ISOGI_OK) failed++;
            isogi_dvr_free(dvr);
        }
        CHECK(m.live == 0, "allocation %d: %d left", k, m.live);
    }
    field_free(&f);
}

TEST(a_step_that_is_no_power_of_two_up_to_8_is_refused) {
    field f = field_of(ball, 9);
    for (int coarsest = -2; coarsest < 20; coarsest++) {
        isogi_dvr_desc desc = several(&f, 5, coarsest);
        isogi_dvr *dvr = NULL;
        isogi_result result = isogi_dvr_create(&dvr, &desc, &serial);
        CHECK((result == ISOGI_OK) == (coarsest == 0 || coarsest == 1 || coarsest == 2 || coarsest == 4 || coarsest == 8) &&
                  (result == ISOGI_OK) == (dvr != NULL),
              "%d: %s", coarsest, isogi_result_string(result));
        isogi_dvr_free(dvr);
    }
    field_free(&f);
}

TEST_MAIN("dvr_levels")
