/* The stack that calls of isogi_vol.h, isogi_trace.h and isogi_dvr.h take, on one thread: those of isogi_sh.h are in test_sh_limits.c. */
#define _GNU_SOURCE /* stacks of threads */
#include "isogi_dvr.h"
#include "isogi_trace.h"
#include "stack.h"

#if STACK_MEASURED
enum { SIDE = 24, RAYS = 96 };

static const isogi_context single = {.threads = 1};
static float voxels[SIDE][SIDE][SIDE], points[RAYS][3], normals[RAYS][3], values[RAYS][3], many[RAYS][108], errors[RAYS];
static isogi_volume volume = {.data = voxels, .type = ISOGI_F32, .size = {SIDE, SIDE, SIDE}};
static isogi_pyramid *pyramid;
static isogi_ray rays[RAYS];
static isogi_hit hits[2 * RAYS];
static float image[16 * 32 * 3];
static isogi_light lamps[2] = {
    {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 2, 3}, .rgb = {1, 1, 1}, .radius = 0.1f},
    {.kind = ISOGI_LIGHT_RECTANGLE, .vector = {11, 40, 12}, .rgb = {50, 50, 50}, .edge = {{4, 0, 0}, {0, 0, 4}}}};

/* Waves, rays through them, and points of their surface. */
static void begin(int path) {
    const isogi_context context = {.threads = 1, .force_path = path};
    for (size_t i = 0; i < SIDE * SIDE * SIDE; i++)
        (&voxels[0][0][0])[i] =
            sinf(0.5f * (float)(i % SIDE)) + sinf(0.4f * (float)(i / SIDE % SIDE)) + sinf(0.6f * (float)(i / SIDE / SIDE));
    for (size_t i = 0; i < sizeof image / sizeof *image; i++) image[i] = i < 60 ? 100 : 0.5f;
    isogi_vol_free(pyramid), pyramid = NULL;
    CHECK(isogi_vol_build(&pyramid, &volume, &context) == ISOGI_OK, "build");
    for (int i = 0; i < RAYS; i++) {
        for (int a = 0; a < 3; a++) {
            double away = sin(3 * i + a + 1);
            rays[i].origin[a] = 11 + 40 * away, rays[i].dir[a] = (float)(-40 * away + 5 * cos(5 * i + a));
        }
        rays[i].isovalue = 0.1;
    }
    isogi_vol_intersect(pyramid, rays, RAYS, hits, NULL);
    isogi_vol_positions(pyramid, hits, RAYS, points), isogi_vol_normals(pyramid, hits, RAYS, ISOGI_NORMAL_SMOOTH, normals);
}

static void largest(const char *name, void (*run)(int variant), int variants, size_t limit) {
    size_t most = 0;
    int at = 0;
    for (int v = 0; v < variants; v++) {
        size_t bytes = stack_of(run, v);
        if (bytes > most) most = bytes, at = v;
    }
    if (LONG_SUITE) printf("    %-22s %6zu bytes, variant %d\n", name, most, at);
    CHECK(most < limit, "%s: %zu bytes, variant %d", name, most, at);
}

/* ---- isogi_vol.h ---- */

static void use_build(int type) {
    const isogi_volume v = {.data = voxels, .type = (isogi_type)type, .size = {SIDE, SIDE, SIDE / 2}};
    const size_t first[3] = {3, 4, 5}, last[3] = {9, 9, 9};
    isogi_pyramid *p = NULL;
    if (isogi_vol_build(&p, &v, &single) == ISOGI_OK) isogi_vol_update(p, first, last, NULL);
    isogi_vol_free(p);
}
static void use_rays(int variant) {
    static uint8_t occluded[RAYS];
    static size_t counts[RAYS];
    const size_t count = variant ? RAYS : 1;
    const isogi_bundle bundle = {.origin = {11, 11, 11}, .isovalue = 0.1};
    const double range[1][2] = {{0, 0.2}};
    double piece[2];
    isogi_vol_intersect(pyramid, rays, count, hits, NULL), isogi_vol_occluded(pyramid, rays, count, occluded, NULL);
    isogi_vol_continue(pyramid, hits, (const float(*)[3])normals, NULL, 0.1, 0, count, hits + RAYS, NULL);
    isogi_vol_intersect_all(pyramid, rays, count, 2, hits, counts, NULL);
    isogi_vol_bundle(pyramid, &bundle, (const float(*)[3])normals, count, hits, NULL);
    isogi_vol_bundle_occluded(pyramid, &bundle, (const float(*)[3])normals, count, occluded, NULL);
    isogi_vol_next_interval(pyramid, rays, range, 1, 0, piece, NULL);
    isogi_vol_positions(pyramid, hits, count, values), isogi_vol_normals(pyramid, hits, count, (isogi_normal_kind)(variant & 1), values);
}
static void use_lookups(int variant) {
    static float scratch[SIDE * SIDE * SIDE];
    isogi_vol_sample_filtered(pyramid, (isogi_filter)variant, (const float(*)[3])points, RAYS, errors, values);
    isogi_vol_prefilter(&volume, scratch, &single);
}
static void use_mesh(int variant) {
    const isogi_mesh_desc desc = {.isovalue = 0.1, .normals = variant & 1, .closed = variant >> 1};
    isogi_mesh mesh = {0};
    isogi_vol_mesh(pyramid, &desc, &mesh), isogi_vol_mesh_free(pyramid, &mesh);
}

TEST(vol_takes_little_stack) {
    for (int path = 0; path <= 4; path++) {
        begin(path);
        largest("rays", use_rays, 3, MOST_BYTES), largest("meshes", use_mesh, 4, MOST_BYTES);
    }
    largest("pyramids", use_build, ISOGI_F64 + 1, MOST_BYTES), largest("lookups", use_lookups, 3, MOST_BYTES);
}

/* ---- isogi_trace.h ---- */

static isogi_trace_desc desc_of(int variant) {
    isogi_trace_desc d = {.pyramid = pyramid, .albedo = {0.7f, 0.6f, 0.5f}, .bounces = 2, .samples = 8, .order = 6};
    d.method = variant & 1 ? ISOGI_TRACE_PATHS : ISOGI_TRACE_FEEDBACK;
    d.mode = variant & 2 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE;
    d.lighting.env.rgb = image, d.lighting.env.width = 32, d.lighting.env.height = 16;
    if (!(variant & 2)) d.lighting.lights = lamps, d.lighting.light_count = 2;
    for (int a = 0; a < 3; a++) d.lattice[a] = SIDE / 3;
    return d;
}
static void use_bake(int variant) {
    isogi_trace_desc d = desc_of(variant);
    const size_t first[3] = {3, 4, 5}, last[3] = {9, 9, 9};
    isogi_trace_report report;
    isogi_trace *t = NULL;
    d.lazy = variant >> 2 & 1, d.hierarchy = variant >> 3 ? 0.1f : 0, d.sides = d.lazy ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
    if (d.lazy && d.hierarchy > 0) return;
    CHECK(isogi_trace_create(&t, &d, &single) == ISOGI_OK, "create %d", variant);
    isogi_trace_request(t, (const float(*)[3])points, RAYS), isogi_trace_step(t, 0, NULL);
    isogi_trace_sample(t, (const float(*)[3])points, RAYS, values, errors), isogi_trace_status(t, &report);
    if (variant & 2) isogi_trace_relight(t, &d.lighting), isogi_trace_sample_transfer(t, (const float(*)[3])points, RAYS, &many[0][0]);
    if (variant & 2)
        isogi_trace_sample_gloss(t, (const float(*)[3])points, (const float(*)[3])normals, (const float(*)[3])normals, 20, RAYS, values);
    isogi_trace_touch(t, first, last), isogi_trace_touch(t, first, last);
    d.albedo[0] = 0.3f, isogi_trace_change(t, &d), isogi_trace_step(t, 500, NULL);
    isogi_trace_free(t);
}
static void use_store(int variant) {
    isogi_trace_desc d = desc_of(variant & 3);
    isogi_trace *t = NULL, *other = NULL;
    void *bytes;
    float scales[108];
    d.storage = variant & 4 ? ISOGI_TRACE_BYTE : ISOGI_TRACE_HALF;
    isogi_trace_create(&t, &d, &single), isogi_trace_create(&other, &d, &single), isogi_trace_step(t, 0, NULL);
    bytes = malloc(isogi_trace_save_size(t) + isogi_trace_export_size(t, 0));
    CHECK(isogi_trace_save(t, bytes, isogi_trace_save_size(t)) == ISOGI_OK, "save");
    CHECK(isogi_trace_load(other, bytes, isogi_trace_save_size(t)) == ISOGI_OK, "load");
    isogi_trace_export(t, 0, bytes, isogi_trace_export_size(t, 0)), isogi_trace_export_scales(t, 0, scales);
    free(bytes), isogi_trace_free(t), isogi_trace_free(other);
}
static void use_gather(int variant) {
    isogi_trace_desc d = desc_of(0);
    d.sides = variant ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE;
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, RAYS, values, errors, &single);
}
static void floor_below(void *user, const isogi_ray *r, size_t count, isogi_trace_surface *s) {
    (void)user;
    for (size_t i = 0; i < count; i++)
        if (r[i].dir[1] < 0) s[i].t = (r[i].origin[1] + 50) / -(double)r[i].dir[1], s[i].normal[1] = 1;
}
static void use_gather_field(int variant) {
    isogi_trace_desc d = desc_of(0);
    d.pyramid = NULL, d.bounces = variant;
    isogi_trace_gather_field(&d, floor_below, NULL, (const float(*)[3])points, (const float(*)[3])normals, RAYS, values, errors, &single);
}

TEST(trace_takes_little_stack) {
    begin(0);
    largest("baking", use_bake, 12, MOST_BYTES_TRACE), largest("storage", use_store, 8, MOST_BYTES_TRACE);
    largest("own points", use_gather, 2, MOST_BYTES_TRACE);
    largest("own surfaces", use_gather_field, 2, MOST_BYTES_TRACE);
}

/* ---- isogi_dvr.h ---- */

static void use_frame(int variant) {
    static float picture[12 * 12][4], depth[12 * 12];
    const isogi_transfer_point p[3] = {{-1, {1, 0.5f, 0.2f}, 0}, {0.5, {0.5f, 1, 0.2f}, 0.2f}, {2, {1, 1, 1}, 1}};
    const isogi_peak peaks[1] = {{.isovalue = 0.1, .rgb = {1, 1, 1}, .opacity = 0.5f}};
    const isogi_transfer transfer = {p, 3, peaks, 1};
    const isogi_lighting lighting = {.env = {.rgb = image, .width = 32, .height = 16}, .lights = lamps, .light_count = 1};
    const isogi_view view = {.width = 12, .height = 12, .eye = {60, 40, 50}, .target = {11, 11, 11}};
    isogi_dvr_desc d = {.pyramid = pyramid, .order = 1 + variant % 2 * 5, .directions = 16, .grid = {6, 6, 6}};
    isogi_dvr *dvr = NULL;
    d.space = (isogi_dvr_space)(variant / 2 % 2), d.shading = (isogi_dvr_shading)(variant / 4 % 4),
    d.method = (isogi_dvr_method)(variant / 16 % 3);
    d.bound = variant / 48 ? 0.1 : 0;
    if (isogi_dvr_create(&dvr, &d, &single) != ISOGI_OK) return;
    if (isogi_dvr_set_transfer(dvr, &transfer) == ISOGI_OK && isogi_dvr_step(dvr, 0, NULL) == ISOGI_OK)
        isogi_dvr_render(dvr, &view, &lighting, picture, depth, NULL);
    isogi_dvr_sample_visibility(dvr, (const float(*)[3])points, 2, &many[0][0]);
    isogi_dvr_free(dvr);
}
static void use_suggestion(int variant) {
    static isogi_transfer_point p[ISOGI_SUGGEST_POINTS];
    double threshold;
    isogi_transfer_suggest(pyramid, (isogi_dvr_space)variant, p, &threshold);
}

TEST(dvr_takes_little_stack) {
    begin(0);
    largest("pictures", use_frame, 96, MOST_BYTES), largest("suggestions", use_suggestion, 2, MOST_BYTES);
}
#endif

TEST_MAIN("stack")
