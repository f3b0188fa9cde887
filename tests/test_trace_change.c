/* Tests of what isogi_trace.h computes again when something changes: lighting, colours, isovalues, voxels. Path-traced, the changed texture
   has the bits of a new one; counters say what it cost. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

static isogi_trace *baked(const isogi_trace_desc *d) {
    isogi_trace *t = NULL;
    CHECK(isogi_trace_create(&t, d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "create and step %d", 1);
    return t;
}

static isogi_counters counted(const isogi_trace *t) {
    isogi_counters c = {0};
    isogi_trace_counters(t, &c);
    return c;
}

static int same_bits(const isogi_trace *a, const isogi_trace *b) {
    size_t size[2] = {isogi_trace_save_size(a), isogi_trace_save_size(b)};
    uint8_t *block[2] = {(uint8_t *)malloc(size[0]), (uint8_t *)malloc(size[1])};
    int same = isogi_trace_save(a, block[0], size[0]) == ISOGI_OK && isogi_trace_save(b, block[1], size[1]) == ISOGI_OK;
    same = same && size[0] == size[1] && size[0] > 64 && !memcmp(block[0], block[1], size[0]);
    free(block[0]), free(block[1]);
    return same;
}

/* Steps to the end: texels and rays it took. The result is that of a new texture, bit by bit. */
static isogi_counters finished(isogi_trace *t, const isogi_trace_desc *d, const char *what) {
    isogi_counters before = counted(t), after;
    double remaining = 1;
    isogi_trace *fresh = baked(d);
    isogi_trace_report report;
    CHECK(isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0, "%s: remaining %g", what, remaining);
    isogi_trace_status(t, &report);
    CHECK(report.drafts == 0 && same_bits(t, fresh), "%s: other bits than a new texture, %d drafts", what, (int)report.drafts);
    after = counted(t);
    after.rays -= before.rays, after.texels -= before.texels;
    isogi_trace_free(fresh);
    return after;
}

/* A new lighting, thousands of times as bright, too: irradiance is baked anew at its first price, and the old light can be read until the
   new one is there. Short formats then have another unit. */
TEST(irradiance_is_relit_at_the_price_of_a_bake) {
    double q[1] = {0.5};
    scene s = scene_make(8, 9, 7, NULL, gyroid, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 5000, 0.1);
    float points[30][3], e[3][30][3];
    int n = surface_points(&s, 0, 30, 1, points);
    for (int format = 1; format < 5; format++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 2, 2), other = d;
        isogi_counters counters, first;
        isogi_trace_report report;
        double remaining = 0;
        d.storage = other.storage = (isogi_trace_format)format,
        d.sides = other.sides = format & 1 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        other.lighting.lights = &sun, other.lighting.light_count = 1;
        isogi_trace *t = baked(&d), *fresh = baked(&other);
        first = counted(fresh);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL);
        CHECK(isogi_trace_relight(t, &other.lighting) == ISOGI_OK, "format %d", format);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[1], NULL);
        /* the error of the other unit: it is 2^11 larger */
        double rounding = format == ISOGI_TRACE_FLOAT ? 0 : format == ISOGI_TRACE_HALF ? 0.02 : 4;
        for (int i = 0; i < n; i++)
            CHECK(fabs((double)e[0][i][1] - (double)e[1][i][1]) <= rounding * PI, "format %d: %g before, %g after", format,
                  (double)e[0][i][1], (double)e[1][i][1]);
        isogi_trace_status(t, &report);
        CHECK(report.drafts == report.texels && report.texels > 50, "%d drafts of %d texels", (int)report.drafts, (int)report.texels);
        CHECK(isogi_trace_step(t, 200, &remaining) == ISOGI_OK && remaining > 0 && remaining < 1, "remaining %g", remaining);
        counters = finished(t, &other, "another lighting");
        CHECK(counted(t).texels == 2 * first.texels && counters.texels > 0, "%d texels of %d", (int)counters.texels, (int)first.texels);
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[2], NULL);
        CHECK(isogi_trace_relight(t, &other.lighting) == ISOGI_OK, "the same again, format %d", format);
        CHECK(finished(t, &other, "the same lighting").rays == 0, "the same lighting costs rays, format %d", format);
        sun.rgb[0] *= 2; /* in place: what is saved now is of the light before */
        {
            const size_t size = isogi_trace_save_size(t);
            uint8_t *block = (uint8_t *)malloc(size);
            isogi_trace *doubled = NULL;
            CHECK(isogi_trace_create(&doubled, &other, NULL) == ISOGI_OK && isogi_trace_save(t, block, size) == ISOGI_OK &&
                      isogi_trace_load(doubled, block, size) == ISOGI_INVALID && isogi_trace_load(t, block, size) == ISOGI_OK,
                  "saved before it is told, format %d", format);
            isogi_trace_free(doubled), free(block);
        }
        CHECK(isogi_trace_relight(t, &other.lighting) == ISOGI_OK && finished(t, &other, "changed in place").rays == first.rays,
              "changed in place, format %d", format);
        isogi_trace_free(t), isogi_trace_free(fresh);
    }
    scene_free(&s);
}

/* Texels whose isovalue lies in [low, high]. */
static int texels_between(const isogi_trace *t, const scene *s, double low, double high) {
    size_t x[3], size[3], i = 0;
    int n = 0;
    isogi_trace_shape(t, size, NULL, NULL);
    for (x[2] = 0; x[2] < size[2]; x[2]++)
        for (x[1] = 0; x[1] < size[1]; x[1]++)
            for (x[0] = 0; x[0] < size[0]; x[0]++, i++)
                n += (double)s->data[i] > low && (double)s->data[i] < high && isogi_trace_valid(t, x);
    return n;
}

/* Paths stay on the isosurface they begin on: a colour that changes between two isovalues changes the light of the texels in between. */
TEST(colours_concern_their_isovalues) {
    double q[1] = {0.5};
    scene s = scene_make(11, 10, 12, NULL, gyroid, q);
    isogi_albedo_point table[3][4] = {
        {{-1, {0.5f, 0.5f, 0.5f}}, {0, {0.5f, 0.5f, 0.5f}}, {0.4, {0.5f, 0.5f, 0.5f}}, {0.8, {0.5f, 0.5f, 0.5f}}}};
    memcpy(table[1], table[0], sizeof table[0]), memcpy(table[2], table[0], sizeof table[0]);
    table[1][2].rgb[1] = 0.9f; /* changes between 0 and 0.8 */
    for (int mode = 0; mode < 2; mode++) {
        isogi_trace_desc d = desc_make(&s, 0, 3, 2);
        d.albedo_points = table[0], d.albedo_count = 4, d.mode = (isogi_trace_mode)mode, d.transfer_channels = 3;
        isogi_trace *t = baked(&d);
        isogi_counters counters;
        d.albedo_points = table[1];
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "mode %d", mode);
        counters = finished(t, &d, "colours between 0 and 0.8");
        CHECK((int)counters.texels == texels_between(t, &s, 0, 0.8) && counters.texels > 50, "%d texels, %d expected", (int)counters.texels,
              texels_between(t, &s, 0, 0.8));
        d.albedo_points = table[2];
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "back").texels == counters.texels, "back, mode %d", mode);
        d.albedo_points = table[0];
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "equal").texels == 0, "an equal table, mode %d", mode);
        table[0][0].rgb[0] = 0.6f;
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "in place").texels == (uint64_t)texels_between(t, &s, -9, 9),
              "in place, mode %d", mode);
        table[0][0].rgb[0] = 0.5f;
        d.bounces = 0;
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "mode %d", mode);
        finished(t, &d, "no reflections");
        d.albedo_points = table[1];
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "colours without reflections").texels == 0,
              "without reflections, mode %d", mode);
        if (!mode) { /* what glows is seen without reflections */
            d.emission_points = table[1], d.emission_count = 4;
            isogi_trace *glowing = baked(&d);
            d.emission_points = table[2];
            CHECK(isogi_trace_change(glowing, &d) == ISOGI_OK && finished(glowing, &d, "emission").texels == counters.texels,
                  "emission, mode %d", mode);
            isogi_trace_free(glowing);
        }
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* ---- one member of the description at a time -------------------------------------------------------------------------------------- */

/* What a change of one member has to cost. SOME: texels of isovalues above 0.4, where a table's last point stood. */
enum { NONE, SOME, ALL, JOINING };

static void painted(void *user, double isovalue, const double point[3], float albedo[3], float emission[3]) {
    const float *shade = (const float *)user;
    (void)isovalue;
    for (int c = 0; c < 3; c++) albedo[c] *= point[0] > 5 ? shade[0] : shade[1];
    emission[1] = point[1] > 4 ? shade[1] : 0;
}

/* Member number k takes another value: d[0] before, d[1] after. What that costs with IRRADIANCE, and with TRANSFER (-1: not allowed). */
typedef struct member { const char *name; int cost, transfer; } member;
static const member members[] = {
    {"samples", ALL, ALL}, {"samples, the default", NONE, NONE}, {"bounces", ALL, ALL}, {"seed", ALL, ALL}, {"offset", ALL, ALL},
    {"offset, the default", NONE, NONE}, {"reach", ALL, ALL}, {"no_shadows", ALL, ALL}, {"no_shadows, twice", NONE, NONE},
    {"error", ALL, NONE}, {"material", ALL, ALL}, {"material_user", ALL, ALL}, {"light_count", ALL, NONE}, {"lights", ALL, NONE},
    {"env.sh_order", ALL, NONE}, {"albedo", ALL, ALL}, {"albedo_count", SOME, SOME}, {"albedo_points", SOME, SOME},
    {"emission_count", SOME, -1}, {"emission_points", SOME, -1}, {"isovalue_max", JOINING, JOINING}, {"isovalue_min", JOINING, JOINING},
    {"lookup", JOINING, JOINING}};
enum { MEMBERS = (int)(sizeof members / sizeof members[0]) };

static void change_member(int k, isogi_trace_desc d[2]) {
    static const isogi_albedo_point colours[2][3] = {
        {{-1, {0.5f, 0.6f, 0.7f}}, {0.4, {0.7f, 0.8f, 0.9f}}, {0.8, {0.2f, 0.3f, 0.4f}}},
        {{-1, {0.5f, 0.6f, 0.7f}}, {0.4, {0.7f, 0.8f, 0.9f}}, {0.8, {0.2f, 0.9f, 0.4f}}}};
    static const isogi_light lights[2][2] = {
        {{.vector = {1, 2, 1}, .rgb = {1, 2, 3}, .radius = 0.3f}, {.vector = {-1, 1, 2}, .rgb = {2, 2, 1}}},
        {{.vector = {1, 2, 1}, .rgb = {1, 2, 3}, .radius = 0.3f}, {.vector = {-1, 1, 1}, .rgb = {2, 2, 1}}}};
    static const float sky[12] = {3, 3.5f, 4, 0.3f, 0, 0.1f, 0.5f, 0, 0.7f, 0, -0.4f, 0.2f};
    static float shades[2][2] = {{0.9f, 0.5f}, {0.8f, 0.7f}};
    for (int i = 0; i < 2; i++) {
        d[i].lighting.lights = lights[0], d[i].lighting.light_count = 2, d[i].lighting.env.sh = sky, d[i].lighting.env.sh_order = 2;
        if (k == 10 || k == 11) d[i].material_user = shades[0];
        if (k == 11) d[i].material = painted;
        if (k == 16 || k == 17) d[i].albedo_points = colours[0], d[i].albedo_count = 3;
        if (k == 18 || k == 19) d[i].emission_points = colours[0], d[i].emission_count = 3;
        if (k > 19) d[i].isovalue_min = -0.2, d[i].isovalue_max = 0.3;
    }
    switch (k) {
    case 0: d[1].samples = 3; break;
    case 1: d[0].samples = 0, d[1].samples = 64, d[0].bounces = d[1].bounces = 0; break;
    case 2: d[1].bounces = 1; break;
    case 3: d[1].seed = 1; break;
    case 4: d[1].offset = 0.5f; break;
    case 5: d[1].offset = 0.25f; break;
    case 6: d[1].reach = 3; break;
    case 7: d[1].no_shadows = 1; break;
    case 8: d[0].no_shadows = 1, d[1].no_shadows = 2; break;
    case 9: d[1].error = 0.2f; break;
    case 10: d[1].material = painted; break;
    case 11: d[1].material_user = shades[1]; break;
    case 12: d[1].lighting.light_count = 1; break;
    case 13: d[1].lighting.lights = lights[1]; break;
    case 14: d[1].lighting.env.sh_order = 1; break;
    case 15: d[1].albedo[1] = 0.3f; break;
    case 16: d[1].albedo_count = 2; break;
    case 17: d[1].albedo_points = colours[1]; break;
    case 18: d[1].emission_count = 2; break;
    case 19: d[1].emission_points = colours[1]; break;
    case 20: d[1].isovalue_max = 0.9; break;
    case 21: d[1].isovalue_min = -0.9; break;
    default: d[1].lookup = ISOGI_TRACE_BSPLINE; /* reads further */
    }
}

/* There and back: each time the bits and the lookups of a new texture; only what depends on the member is computed again, and texels that
   have left the interval of isovalues are still there when it grows again. */
static void change_and_back(const scene *s, const member *m, int cost, const isogi_trace_desc d[2]) {
    float points[40][3], e[2][40][3];
    isogi_trace *t = baked(&d[0]), *fresh;
    const uint64_t first = counted(t).texels;
    const int n = surface_points(s, 0.1, 40, 9, points);
    for (int back = 0; back < (LONG_SUITE || cost == JOINING ? 2 : 1); back++) {
        const isogi_trace_desc *now = &d[!back];
        isogi_counters before = counted(t), took, new_one;
        double remaining = 1;
        fresh = baked(now), new_one = counted(fresh);
        CHECK(isogi_trace_change(t, now) == ISOGI_OK && isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0, "%s", m->name);
        took = counted(t), took.texels -= before.texels, took.rays -= before.rays;
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL);
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[1], NULL);
        CHECK(!memcmp(e[0], e[1], (size_t)n * sizeof e[0][0]) && fabs((double)e[0][0][0]) > 0.01, "%s: lookups, back %d", m->name, back);
        CHECK((back && cost == JOINING) || same_bits(t, fresh), "%s: other bits than a new texture, back %d", m->name, back);
        isogi_trace_free(fresh);
        const int sides = now->sides == ISOGI_TRACE_BOTH_SIDES ? 2 : 1;
        const uint64_t expected = cost == ALL ? new_one.texels : cost == JOINING && !back ? new_one.texels - first
                                : cost == SOME ? (uint64_t)texels_between(t, s, 0.4, 9) : 0;
        if (cost == SOME && sides == 2) /* of the high side, too */
            CHECK(took.texels > expected && took.texels < 2 * expected + 20, "%s: %d texels", m->name, (int)took.texels);
        else CHECK(took.texels == expected, "%s, back %d: %d texels, not %d", m->name, back, (int)took.texels, (int)expected);
        CHECK(cost == NONE || (cost == JOINING && back) ? took.rays == 0 : took.texels > 0, "%s, back %d: %d texels, %d rays", m->name,
              back, (int)took.texels, (int)took.rays);
        CHECK(cost != SOME || 10 * took.texels < 9 * new_one.texels, "%s: %d texels are some", m->name, (int)took.texels);
    }
    isogi_trace_free(t);
}
/* Large blocks are handed out again: new pages would take most of the time of bakes as small as these. */
typedef struct reused { void *block[4]; size_t size[4]; } reused;
static void *reused_alloc(void *user, size_t size, size_t align) {
    reused *r = (reused *)user;
    void *p = NULL;
    for (int i = 0; i < 4; i++)
        if (r->block[i] && r->size[i] == size) return p = r->block[i], r->block[i] = NULL, p;
    return posix_memalign(&p, align < 64 ? 64 : align, size) ? NULL : p;
}
static void reused_release(void *user, void *p, size_t size) {
    reused *r = (reused *)user;
    for (int i = 0; i < 4 && size > 100000; i++)
        if (!r->block[i]) { r->block[i] = p, r->size[i] = size; return; }
    free(p);
}

static void change_each_member(isogi_trace_mode mode) {
    reused memory = {{NULL}, {0}};
    const isogi_context serial = {.threads = 1, .alloc = reused_alloc, .release = reused_release, .user = &memory};
    const int size = LONG_SUITE ? 10 : 6;
    double q[1] = {0.5};
    scene s = scene_make(size, size - 1, size, NULL, gyroid, q);
    isogi_vol_free(s.pyramid), isogi_vol_build(&s.pyramid, &s.volume, &serial);
    for (int k = 0; k < MEMBERS; k++) {
        const member *m = &members[k];
        const int cost = mode == ISOGI_TRACE_IRRADIANCE ? m->cost : m->transfer;
        isogi_trace_desc d[2] = {desc_make(&s, 0.6f, 2, 2), desc_make(&s, 0.6f, 2, 2)};
        for (int i = 0; i < 2; i++) {
            if (mode == ISOGI_TRACE_TRANSFER) d[i].mode = mode, d[i].order = 2, d[i].transfer_channels = 3;
            if (k % 6 == 0) d[i].sides = ISOGI_TRACE_BOTH_SIDES;
        }
        change_member(k, d);
        if (cost >= 0) change_and_back(&s, m, cost, d);
    }
    scene_free(&s);
    for (int i = 0; i < 4; i++) free(memory.block[i]);
}
TEST(every_member_alone_costs_what_depends_on_it) { change_each_member(ISOGI_TRACE_IRRADIANCE); }
TEST(every_member_alone_costs_what_transfer_depends_on) { change_each_member(ISOGI_TRACE_TRANSFER); }

/* An interval that grows adds texels; one that shrinks costs nothing, and what was computed is still there when it grows again. */
TEST(isovalues_add_texels) {
    double q[1] = {0.5};
    scene s = scene_make(14, 13, 15, NULL, gyroid, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
    isogi_counters narrow, wide, more;
    d.isovalue_min = 0.9, d.isovalue_max = 1;
    isogi_trace *t = baked(&d);
    narrow = counted(t);
    d.isovalue_min = 0;
    isogi_trace *fresh = baked(&d);
    wide = counted(fresh);
    CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "wider %d", 1);
    more = finished(t, &d, "a wider interval");
    CHECK(more.texels == wide.texels - narrow.texels && more.texels > 100 && narrow.texels > 50, "%d and %d more texels, %d in all",
          (int)narrow.texels, (int)more.texels, (int)wide.texels);
    d.isovalue_min = 0.9;
    CHECK(isogi_trace_change(t, &d) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK && counted(t).texels == wide.texels,
          "narrower %d", 1);
    d.isovalue_min = 0;
    CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "wider again").texels == 0, "wider again %d", 1);
    d.lookup = ISOGI_TRACE_BSPLINE; /* reads further */
    CHECK(isogi_trace_change(t, &d) == ISOGI_OK, "lookup %d", 1);
    finished(t, &d, "B-spline");
    isogi_trace_free(t), isogi_trace_free(fresh), scene_free(&s);
}

/* Lazily an isovalue that moves costs the texels that were not read before, and none when it moves back. */
TEST(moving_the_isovalue_lazily) {
    double q[1] = {0.4};
    scene s = scene_make(20, 20, 20, NULL, gyroid, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
    isogi_trace *t = NULL;
    float points[100][3];
    uint64_t texels[4];
    d.lazy = 1;
    isogi_trace_create(&t, &d, NULL);
    for (int k = 0; k < 4; k++) {
        static const double isovalue[4] = {0, 0.02, 0.5, 0};
        int n = surface_points(&s, isovalue[k], 100, 3, points);
        uint64_t before = counted(t).texels;
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
        texels[k] = counted(t).texels - before;
    }
    CHECK(texels[0] > 100 && texels[1] < texels[0] / 4 && texels[2] > 100 && texels[3] == 0,
          "texels: %d at first, %d a little further, %d elsewhere, %d back", (int)texels[0], (int)texels[1], (int)texels[2],
          (int)texels[3]);
    isogi_trace_free(t), scene_free(&s);
}

/* Random boxes of voxels take random values; full textures of many kinds then have the bits of new ones, for fewer texels. */
static void change_box(scene *s, isogi_trace *t, test_random *r, int large) {
    size_t first[3], last[3];
    for (int a = 0; a < 3; a++) {
        first[a] = (size_t)random_range(r, 0, (double)s->volume.size[a]);
        last[a] = first[a] + (size_t)random_range(r, 0, large ? 6 : 2);
        if (last[a] >= s->volume.size[a]) last[a] = s->volume.size[a] - 1;
    }
    double low = random_range(r, -1, 0.9), high = low + random_range(r, 0, 0.2);
    CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before %d", 1);
    for (size_t z = first[2]; z <= last[2]; z++)
        for (size_t y = first[1]; y <= last[1]; y++)
            for (size_t x = first[0]; x <= last[0]; x++)
                s->data[x + s->volume.size[0] * (y + s->volume.size[1] * z)] =
                    random_bits(r) % 40 ? (float)random_range(r, low, high) : (float)nan_value();
    CHECK(isogi_vol_update(s->pyramid, first, last, NULL) == ISOGI_OK && isogi_trace_touch(t, first, last) == ISOGI_OK, "after %d", 1);
}
TEST(changed_voxels_give_the_bits_of_a_new_bake) {
    double q[1] = {0.3}, saved = 0;
    test_random r = {5};
    int rounds = LONG_SUITE ? 60 : 8;
    for (int k = 0; k < rounds; k++) {
        scene s = scene_make(19, 17, 18, NULL, gyroid, q);
        isogi_trace_desc d = desc_make(&s, 0.6f, k % 3 == 2 ? -1 : k % 3, 2);
        isogi_trace *t;
        uint64_t all;
        if (k % 8 == 1) d.sides = ISOGI_TRACE_BOTH_SIDES;
        if (k % 8 == 2) d.capped = 1;
        if (k % 8 == 3) d.isovalue_min = -0.1, d.isovalue_max = 0.2;
        if (k % 8 == 4) d.mode = ISOGI_TRACE_TRANSFER, d.order = 2;
        if (k % 8 == 5) d.lattice[0] = 7, d.lattice[1] = 40, d.lattice[2] = 9;
        if (k % 8 == 6) d.reach = 4, d.bounces = 0;
        if (k % 8 == 7) d.lattice[0] = 6, d.lattice[1] = d.lattice[2] = 5, d.isovalue_min = -0.02, d.isovalue_max = 0.02;
        t = baked(&d);
        change_box(&s, t, &r, k & 1), change_box(&s, t, &r, 0);
        all = counted(t).texels;
        isogi_counters again = finished(t, &d, k % 8 == 6 ? "within reach" : "a box of voxels");
        CHECK(again.texels > 0 || k % 8 == 7, "case %d: nothing was computed again", k);
        saved += 1 - (double)again.texels / (double)all;
        isogi_trace_free(t), scene_free(&s);
    }
    printf("    two boxes of up to 6 voxels in 19: on average %.0f %% of the texels are kept\n", 100 * saved / rounds);
    CHECK(saved / rounds > 0.05, "%.2f of the texels are kept", saved / rounds);
}

/* What another box has brought is kept up by changes of voxels, too: texels that keep a surface have the bits of a new bake. */
TEST(merged_boxes_follow_changed_voxels) {
    enum { N = 16, CUT = 8, TEXELS = N * N * N };
    static uint8_t has[TEXELS];
    double q[1] = {0.4};
    test_random r = {11};
    for (int k = 0; k < (LONG_SUITE ? 20 : 4); k++) {
        scene s = scene_make(N, N, N, NULL, gyroid, q);
        isogi_trace_desc d = desc_make(&s, 0.6f, 1, 2), half[2] = {d, d};
        isogi_trace *t[2];
        size_t size;
        void *block;
        for (int i = 0; i < 2; i++) {
            for (int a = 0; a < 3; a++) half[i].box_first[a] = 0, half[i].box_end[a] = N;
            if (i) half[i].box_first[2] = CUT;
            else half[i].box_end[2] = CUT;
            t[i] = baked(&half[i]);
        }
        size = isogi_trace_save_size(t[1]), block = malloc(size);
        CHECK(isogi_trace_save(t[1], block, size) == ISOGI_OK && isogi_trace_load(t[0], block, size) == ISOGI_OK, "merge");
        memset(has, 1, sizeof has);
        for (int change = 0; change < 3; change++) { /* none; two */
            isogi_trace_report report;
            isogi_trace *fresh;
            int beyond = 0, kept = 0;
            if (change) change_box(&s, t[0], &r, 1);
            CHECK(isogi_trace_step(t[0], 0, NULL) == ISOGI_OK && (isogi_trace_status(t[0], &report), !report.drafts), "step");
            fresh = baked(&d);
            for (size_t i = 0; i < TEXELS; i++) {
                const size_t texel[3] = {i % N, i / N % N, i / N / N};
                const float point[1][3] = {{(float)texel[0], (float)texel[1], (float)texel[2]}};
                float e[2][1][3];
                has[i] &= isogi_trace_valid(fresh, texel) != 0;
                if (!has[i]) continue;
                isogi_trace_sample(t[0], point, 1, e[0], NULL), isogi_trace_sample(fresh, point, 1, e[1], NULL);
                kept++, beyond += texel[2] >= CUT;
                CHECK(!memcmp(e[0], e[1], sizeof e[0]), "round %d, change %d, texel %d %d %d: %g, not %g", k, change, (int)texel[0],
                      (int)texel[1], (int)texel[2], (double)e[0][0][1], (double)e[1][0][1]);
            }
            CHECK(beyond > TEXELS / 4 && kept > TEXELS / 2, "round %d: %d texels are kept, %d of the other box", k, kept, beyond);
            isogi_trace_free(fresh);
        }
        isogi_trace_free(t[0]), isogi_trace_free(t[1]), free(block), scene_free(&s);
    }
}

/* On layers y = const, each an isosurface of its own, voxels of layers 10 and 11 change within the values of these: layers 8 to 13 are what
   texels and normals there read, and no other surface passes there. With a reach of 3 and one reflection, only
   texels within 6 of the box. */
TEST(only_surfaces_at_changed_voxels_are_computed_again) {
    double q[1] = {8};
    size_t first[3] = {15, 10, 15}, last[3] = {16, 11, 16};
    for (int k = 0; k < 3; k++) {
        scene s = scene_make(32, 24, 32, NULL, ground, q);
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
        d.reach = k ? 3 : 0, d.lattice[1] = k == 2 ? 47 : 0;
        isogi_trace *t = baked(&d);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before %d", k);
        s.data[15 + 32 * (10 + 24 * 15)] = -2.5f, s.data[16 + 32 * (11 + 24 * 15)] = -2.75f;
        isogi_vol_update(s.pyramid, first, last, NULL);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "after %d", k);
        isogi_counters c = finished(t, &d, "layers");
        int layers = k == 2 ? 11 : 6;
        if (!k) CHECK((int)c.texels == layers * 32 * 32, "%d texels, %d expected", (int)c.texels, layers * 32 * 32);
        else CHECK((int)c.texels < layers * 23 * 23 && (int)c.texels > layers * 17 * 17, "%d texels within reach", (int)c.texels);
        isogi_trace_free(t), scene_free(&s);
    }
}

/* A lattice of every eighth voxel, an interval of isovalues: a lump in the air brings texels in that are far from it, and its end does
   away with what is to be done. */
TEST(changed_voxels_bring_texels_into_the_interval) {
    double q[1] = {6.5};
    scene s = scene_make(33, 33, 33, NULL, ground, q);
    size_t first[3] = {17, 18, 17}, last[3] = {20, 21, 20};
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
    d.lattice[0] = d.lattice[1] = d.lattice[2] = 5, d.isovalue_min = 0.4, d.isovalue_max = 0.6;
    isogi_trace *t = baked(&d);
    for (int k = 0; k < 2; k++) {
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before %d", k);
        for (size_t z = first[2]; z <= last[2]; z++)
            for (size_t y = first[1]; y <= last[1]; y++)
                for (size_t x = first[0]; x <= last[0]; x++) s.data[x + 33 * (y + 33 * z)] = k ? (float)(6.5 - (double)y) : 3;
        isogi_vol_update(s.pyramid, first, last, NULL);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "after %d", k);
        if (!k) CHECK(finished(t, &d, "a lump").texels >= 8, "texels around the lump %d", k);
        else finished(t, &d, "the ground again");
    }
    isogi_trace_free(t), scene_free(&s);
}

/* A spike goes that brought texels into the interval, also some that lie too far from it to see it. */
TEST(changed_voxels_take_texels_out_of_the_interval) {
    double q[1] = {8};
    scene s = scene_make(24, 24, 24, NULL, ground, q);
    const size_t at[3] = {11, 20, 11};
    float *spike = &s.data[11 + 24 * (20 + 24 * 11)], was = *spike;
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
    isogi_trace *t, *fresh;
    isogi_trace_report report;
    *spike = 30, isogi_vol_update(s.pyramid, at, at, NULL);
    d.isovalue_min = 9, d.isovalue_max = 25, d.lattice[0] = d.lattice[1] = d.lattice[2] = 6;
    t = baked(&d), isogi_trace_status(t, &report);
    CHECK(report.texels > 8, "%d texels at the spike", (int)report.texels);
    isogi_trace_touch(t, at, at), *spike = was, isogi_vol_update(s.pyramid, at, at, NULL), isogi_trace_touch(t, at, at);
    isogi_trace_step(t, 0, NULL), isogi_trace_status(t, &report);
    fresh = baked(&d);
    CHECK(report.texels == 0 && isogi_trace_save_size(t) == isogi_trace_save_size(fresh), "%d texels without it", (int)report.texels);
    isogi_trace_free(fresh), isogi_trace_free(t), scene_free(&s);
}

static double ramp(const double p[3], const double *q) { return q[0] * p[0]; }

/* A voxel at the border that is not finite opens the cap for isovalues far below its neighbours', one that is finite again shuts it. */
TEST(caps_open_at_voxels_that_are_not_finite) {
    double q[1] = {8};
    scene s = scene_make(10, 10, 10, NULL, ground, q);
    size_t at[3] = {5, 2, 0};
    float *voxel = &s.data[5 + 10 * 2], was = *voxel;
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 2);
    d.capped = 1, d.sides = ISOGI_TRACE_HIGH_SIDE;
    isogi_trace *t = baked(&d);
    for (int k = 0; k < 2; k++) {
        CHECK(isogi_trace_touch(t, at, at) == ISOGI_OK, "before %d", k);
        *voxel = k ? was : (float)nan_value();
        isogi_vol_update(s.pyramid, at, at, NULL);
        CHECK(isogi_trace_touch(t, at, at) == ISOGI_OK, "after %d", k);
        finished(t, &d, k ? "a number again" : "not a number");
    }
    isogi_trace_free(t), scene_free(&s);
}

/* Where no surface of the interval was, an object of it comes: within the lattice, whose bricks there are new, and beyond it, whose
   outermost texels serve lookups up to the volume's border; with a single texel, too. */
TEST(objects_that_come_have_light) {
    const double q[1] = {0.3}, low[5] = {0, 0, 12, 12, 16}, high[5] = {0, 0, 20, 20, 20};
    const size_t lattice[5] = {33, 17, 9, 1, 1}, at[5] = {15, 15, 29, 28, 29};
    for (int k = 0; k < 10; k++) {
        const int c = k % 5, high_side = k >= 5;
        scene s = scene_make(33, 33, 33, NULL, ramp, q);
        const size_t first[3] = {at[c], at[c] - 1, at[c]}, last[3] = {at[c] + 2, at[c] + 2, at[c] + 2};
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
        d.isovalue_min = 50, d.isovalue_max = 100, d.sides = high_side ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        for (int a = 0; a < 3; a++) d.lattice[a] = lattice[c], d.lattice_min[a] = low[c], d.lattice_max[a] = high[c];
        if (c >= 3) d.lattice[1] = d.lattice[2] = 4, d.lattice_min[0] = d.lattice_max[0] = 16;
        isogi_trace *t = baked(&d);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before, case %d", k);
        for (size_t z = first[2]; z <= last[2]; z++)
            for (size_t y = first[1]; y <= last[1]; y++)
                for (size_t x = first[0]; x <= last[0]; x++) s.data[x + 33 * (y + 33 * z)] = 200;
        isogi_vol_update(s.pyramid, first, last, NULL);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "after, case %d", k);
        CHECK(finished(t, &d, "an object").texels > 0, "case %d: no texels", k);
        isogi_trace_free(t), scene_free(&s);
    }
}

/* Without feedback's exactness: light after a change agrees with a new bake as two seeds do; lazily what was asked for stays asked for. */
TEST(feedback_follows_changes) {
    double q[5] = {16, 15, 16, 20, 9};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 3, 1, 2, 0.2);
    for (int lazy = 0; lazy < 2; lazy++) {
        scene s = scene_make(33, 33, 33, NULL, pit, q);
        size_t first[3] = {14, 7, 14}, last[3] = {17, 12, 17};
        isogi_trace_desc d = desc_make(&s, 0.7f, -1, LONG_SUITE ? 16 : 8);
        isogi_trace *t = NULL, *fresh = NULL;
        float points[200][3], e[2][200][3];
        double sum = 0, mean = 0, moved = 0, remaining = 1;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = lazy, d.isovalue_min = -0.01, d.isovalue_max = 0.01;
        int n = surface_points(&s, 0, 200, 7, points);
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        isogi_trace_step(t, lazy ? 3000 : 0, &remaining); /* lazily in the middle of its work */
        uint64_t whole = counted(t).rays;
        d.lighting.lights = &sun, d.lighting.light_count = 1;
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0,
              "lighting, remaining %g", remaining);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before %d", lazy);
        for (size_t z = first[2]; z <= last[2]; z++)
            for (size_t y = first[1]; y <= last[1]; y++)
                for (size_t x = first[0]; x <= last[0]; x++)
                    s.data[x + 33 * (y + 33 * z)] = 3 + 0.1f * (float)(x + y + z); /* a block in the pit */
        isogi_vol_update(s.pyramid, first, last, NULL);
        CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "after %d", lazy);
        n = surface_points(&s, 0, 200, 8, points);
        isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        CHECK(isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0 && counted(t).rays > whole, "voxels, remaining %g",
              remaining);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL);
        isogi_trace_create(&fresh, &d, NULL), isogi_trace_request(fresh, (const float(*)[3])points, (size_t)n),
            isogi_trace_step(fresh, 0, NULL);
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[1], NULL);
        for (int i = 0; i < n; i++)
            sum += pow((double)e[0][i][1] - (double)e[1][i][1], 2) / n, mean += (double)e[1][i][1] / n, moved += (double)e[0][i][1] / n;
        printf("    %s: after changes of light and voxels %.3f rms from a new bake, means %.4f and %.4f\n", lazy ? "lazy" : "full",
               sqrt(sum) / mean, moved / mean, 1.0);
        CHECK(sqrt(sum) / mean < 0.08 && fabs(moved / mean - 1) < 0.02, "lazy %d: %.4f rms, mean %.4f", lazy, sqrt(sum) / mean,
              moved / mean);
        isogi_trace_free(t), isogi_trace_free(fresh), scene_free(&s);
    }
}

/* Members that only the default method reads, or reads in its own way: after the change light is that of a new bake, which is elsewhere
   than before. */
TEST(feedback_follows_members) {
    static const int which[6] = {4, 6, 7, 9, 11, 15}; /* the last two are common to both methods */
    double q[1] = {0.5};
    scene s = scene_make(11, 10, 11, NULL, gyroid, q);
    float points[100][3], e[3][100][3];
    const int n = surface_points(&s, 0.1, 100, 9, points);
    for (int k = 0; k < (LONG_SUITE ? 6 : 4); k++) {
        const char *name = members[which[k]].name;
        isogi_trace_desc d[2] = {desc_make(&s, 0.6f, 2, 4), desc_make(&s, 0.6f, 2, 4)};
        double sum = 0, mean = 0, moved = 0;
        isogi_counters before, after;
        for (int i = 0; i < 2; i++) d[i].method = ISOGI_TRACE_FEEDBACK, d[i].isovalue_min = 0, d[i].isovalue_max = 0.2;
        if (which[k] == 9) d[0].samples = d[1].samples = 32, d[0].error = 0.05f;
        change_member(which[k], d);
        isogi_trace *t = baked(&d[0]), *fresh = baked(&d[1]);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL), before = counted(t);
        CHECK(isogi_trace_change(t, &d[1]) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "%s", name);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[1], NULL), after = counted(t);
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[2], NULL);
        for (int i = 0; i < n; i++)
            for (int c = 0; c < 3; c++)
                mean += (double)e[2][i][c] / n, sum += pow((double)e[1][i][c] - (double)e[2][i][c], 2) / n,
                    moved += pow((double)e[0][i][c] - (double)e[2][i][c], 2) / n;
        CHECK(sqrt(sum) < 1e-3 * mean && sqrt(moved) > 5e-3 * mean, "%s: %.4f off a new bake, %.4f before", name, sqrt(sum) / mean,
              sqrt(moved) / mean);
        CHECK(fabs((double)(after.rays - before.rays) / (double)counted(fresh).rays - 1) < 0.01, "%s: %d rays, not %d", name,
              (int)(after.rays - before.rays), (int)counted(fresh).rays);
        isogi_trace_free(t), isogi_trace_free(fresh);
    }
    scene_free(&s);
}

/* Memory that holds no zeros, with more of the same behind it: an index that is read there leads nowhere. */
static void *wild_alloc(void *user, size_t size, size_t align) {
    void *p = NULL;
    (void)user;
    if (posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size + 4096)) return NULL;
    return memset(p, 0x7f, size + 4096);
}
static void wild_release(void *user, void *p, size_t size) { (void)user, (void)size, free(p); }

static uint64_t wanted_texels(const isogi_trace *t) {
    size_t x[3], size[3];
    uint64_t n = 0;
    isogi_trace_shape(t, size, NULL, NULL);
    for (x[2] = 0; x[2] < size[2]; x[2]++)
        for (x[1] = 0; x[1] < size[1]; x[1]++)
            for (x[0] = 0; x[0] < size[0]; x[0]++) n += isogi_trace_wanted(t, x) != 0;
    return n;
}

/* An interval that changes while steps make nodes, soon or late in that: the bake goes on with the bricks that are wanted now, fewer, more
   or none, and comes to its end with all of them. Lazily only with texels that are even along all axes, whose bricks are made at once. */
TEST(intervals_change_while_nodes_are_made) {
    static const double interval[3][2] = {{1.35, 1.4}, {-1, 1}, {5, 6}};
    static const int steps[3] = {1, 3, 50};
    double q[1] = {0.35};
    scene s = scene_make(32, 32, 32, NULL, gyroid, q);
    isogi_context context = {.alloc = wild_alloc, .release = wild_release, .threads = 1};
    static float points[512][3];
    for (int i = 0; i < 512; i++)
        points[i][0] = (float)(4 * (i & 7)), points[i][1] = (float)(4 * (i >> 3 & 7)), points[i][2] = (float)(4 * (i >> 6));
    for (int k = 0; k < 18; k += QUICK_SUITE ? 5 : 1) {
        isogi_trace_desc d = desc_make(&s, 0.7f, 0, 1);
        isogi_trace_report report;
        isogi_trace *t = NULL, *fresh = NULL;
        double remaining = 1;
        d.method = ISOGI_TRACE_FEEDBACK, d.lazy = k / 9, d.isovalue_min = -0.9, d.isovalue_max = 0.9;
        CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK, "case %d", k);
        isogi_trace_request(t, (const float(*)[3])points, 512);
        for (int i = 0; i < steps[k / 3 % 3]; i++) isogi_trace_step(t, 20, &remaining);
        CHECK(remaining > 0, "case %d: nothing is left to do", k);
        d.isovalue_min = interval[k % 3][0], d.isovalue_max = interval[k % 3][1];
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && isogi_trace_create(&fresh, &d, NULL) == ISOGI_OK, "case %d", k);
        isogi_trace_request(t, (const float(*)[3])points, 512), isogi_trace_request(fresh, (const float(*)[3])points, 512);
        for (int i = 0; i < 100; i++) isogi_trace_step(t, 20, NULL);
        CHECK(isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0, "case %d: remaining %g", k, remaining);
        isogi_trace_status(t, &report);
        CHECK(!report.drafts && !wanted_texels(t) && report.texels >= wanted_texels(fresh),
              "case %d: %d drafts, %d wanted, %d of %d texels", k, (int)report.drafts, (int)wanted_texels(t), (int)report.texels,
              (int)wanted_texels(fresh));
        isogi_trace_free(t), isogi_trace_free(fresh);
    }
    scene_free(&s);
}

/* A change to all light decides anew which fine texels there are: the bits and the memory of a new bake. What was there before has a
   sharp shadow, which needs many. */
TEST(hierarchies_are_made_anew_where_all_light_changes) {
    double q[5] = {10, 12, 10, 4, 5};
    scene s = scene_make(25, 25, 25, NULL, ball_over_plane, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 3, 1, 2, 0);
    float points[100][3], e[2][100][3];
    int n = surface_points(&s, 0, 100, 4, points);
    for (int k = 2; k < 5; k += 1 + QUICK_SUITE) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 16), sunny;
        isogi_trace_report report[3];
        d.hierarchy = 0.2f, d.method = k & 1 ? ISOGI_TRACE_FEEDBACK : ISOGI_TRACE_PATHS, d.sides = ISOGI_TRACE_BOTH_SIDES;
        sunny = d, memset(&sunny.lighting, 0, sizeof sunny.lighting);
        sunny.lighting.lights = &sun, sunny.lighting.light_count = 1;
        isogi_trace *t = NULL, *fresh = baked(&d);
        CHECK(isogi_trace_create(&t, &sunny, NULL) == ISOGI_OK, "create");
        isogi_trace_step(t, k / 2 == 1 ? 0 : 30000, NULL); /* to the end, or while it is under way */
        isogi_trace_status(t, &report[0]);
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "change");
        isogi_trace_status(t, &report[1]), isogi_trace_status(fresh, &report[2]);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL);
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[1], NULL);
        CHECK(report[1].texels == report[2].texels && (k / 2 != 1 || 10 * report[0].texels > 13 * report[1].texels),
              "case %d: %d texels, %d before, %d of a new bake", k, (int)report[1].texels, (int)report[0].texels, (int)report[2].texels);
        CHECK(k & 1 || !memcmp(e[0], e[1], (size_t)n * sizeof *e[0]), "case %d: other bits", k);
        isogi_trace_free(t), isogi_trace_free(fresh);
    }
    scene_free(&s);
}

/* Two levels on both sides: the coarse one is computed again, and decides anew. */
TEST(hierarchies_follow_changes) {
    double q[5] = {10, 12, 10, 4, 5};
    scene s = scene_make(25, 25, 25, NULL, ball_over_plane, q);
    size_t first[3] = {16, 8, 16}, last[3] = {18, 10, 18};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 3, 1, 2, 0.2);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 16);
    float points[100][3], e[2][100][3];
    double worst = 0, remaining = 1;
    d.hierarchy = 0.2f, d.isovalue_min = -0.5, d.isovalue_max = 0.5, d.sides = ISOGI_TRACE_BOTH_SIDES;
    isogi_trace *t = baked(&d), *fresh;
    CHECK(isogi_trace_relight(t, &(isogi_lighting){.lights = &sun, .light_count = 1}) == ISOGI_OK, "relight %d", 1);
    CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK, "before %d", 1);
    for (size_t z = first[2]; z <= last[2]; z++)
        for (size_t y = first[1]; y <= last[1]; y++)
            for (size_t x = first[0]; x <= last[0]; x++) s.data[x + 25 * (y + 25 * z)] = 1.5f;
    isogi_vol_update(s.pyramid, first, last, NULL);
    CHECK(isogi_trace_touch(t, first, last) == ISOGI_OK && isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0,
          "after: remaining %g", remaining);
    memset(&d.lighting, 0, sizeof d.lighting), d.lighting.lights = &sun, d.lighting.light_count = 1;
    fresh = baked(&d);
    int n = surface_points(&s, 0, 100, 4, points);
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e[0], NULL),
        isogi_trace_sample(fresh, (const float(*)[3])points, (size_t)n, e[1], NULL);
    for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)e[0][i][1] - (double)e[1][i][1]));
    /* cells that were fine before stay so: where they need not be, the fine texels' noise is seen instead of the coarse ones' */
    CHECK(worst < 0.35 * PI, "largest difference %.4f", worst);
    isogi_trace_free(t), isogi_trace_free(fresh), scene_free(&s);
}

/* ---- anything, in any order --------------------------------------------------------------------------------------------------- */

typedef struct stage { /* what descriptions borrow */
    isogi_albedo_point colours[2][4], glow[2][2];
    float image[2][8][16][3], sh[2][9][3];
    isogi_light light[3];
} stage;

static int one_of(test_random *r, int n) { return (int)(random_bits(r) % (uint64_t)n); }

static void change_anything(isogi_trace_desc *d, stage *g, test_random *r) {
    double a = random_range(r, -1, 1), b = random_range(r, -1, 1);
    switch (one_of(r, 9)) {
    case 0: d->lighting.lights = g->light, d->lighting.light_count = (size_t)one_of(r, 4); break;
    case 1: g->light[one_of(r, 3)] = light_make(ISOGI_LIGHT_DIRECTIONAL, a, 1, b, fabs(a), one_of(r, 2) ? 0 : fabs(b)); break;
    case 2: d->albedo_points = g->colours[one_of(r, 2)], d->albedo_count = 4; break;
    case 3: g->colours[0][one_of(r, 4)].rgb[one_of(r, 3)] = (float)fabs(a); break; /* in place */
    case 4:
        d->isovalue_min = fmin(a, b), d->isovalue_max = fmax(a, b);
        if (!one_of(r, 3)) d->isovalue_min = d->isovalue_max = 0;
        break;
    case 5: d->samples = 1 + one_of(r, 5), d->bounces = one_of(r, 4) - 1; break;
    case 6: if (d->mode == ISOGI_TRACE_IRRADIANCE) d->emission_points = g->glow[one_of(r, 2)], d->emission_count = 2; break;
    case 7: d->lighting.env.rgb = &g->image[one_of(r, 2)][0][0][0], d->lighting.env.width = 16, d->lighting.env.height = 8; break;
    default: d->lookup = (isogi_trace_lookup)one_of(r, 4), d->seed = (uint64_t)one_of(r, 2), d->no_shadows = !one_of(r, 8);
    }
}

static stage *stage_make(test_random *r) {
    stage *g = (stage *)calloc(1, sizeof *g);
    for (int i = 0; i < 8; i++) g->colours[i / 4][i % 4].value = -1 + 0.6 * (i % 4), g->glow[i / 4][i % 2].value = i % 2;
    for (int i = 0; i < 24; i++) g->colours[i / 12][i / 3 % 4].rgb[i % 3] = (float)random_range(r, 0, 0.95);
    for (int i = 0; i < 12; i++) g->glow[i / 6][i / 3 % 2].rgb[i % 3] = (float)random_range(r, 0, 2);
    for (int i = 0; i < 768; i++) (&g->image[0][0][0][0])[i] = (float)random_range(r, 0, one_of(r, 50) ? 1 : 300);
    for (int i = 0; i < 54; i++) (&g->sh[0][0][0])[i] = (float)(i % 27 < 3 ? 4 : random_range(r, -0.3, 0.3));
    for (int i = 0; i < 3; i++) g->light[i] = light_make(ISOGI_LIGHT_DIRECTIONAL, i, 1, 0.3, 1, 0.1 * i);
    return g;
}

static isogi_trace *asked(const isogi_trace_desc *d, const float (*points)[3], int n) {
    isogi_trace *t = NULL;
    CHECK(isogi_trace_create(&t, d, NULL) == ISOGI_OK && isogi_trace_request(t, points, (size_t)n) == ISOGI_OK, "create and request");
    return t;
}

/* Requests, changes of the description, changes of voxels and steps of any size, in any order, of textures of any kind: at the end every
   point whose isovalue is wanted has the bits of a new texture (which may lack what an earlier interval has brought, hence the error). */
TEST(changes_in_any_order_give_the_bits_of_a_new_bake) {
    int compared = 0;
    for (int k = 0; k < (LONG_SUITE ? 3000 : QUICK_SUITE ? 60 : 150); k++) {
        test_random r = {(uint64_t)(77 * k + 5)};
        double q[1] = {0.5}, remaining = 1;
        stage *g = stage_make(&r);
        scene s = scene_make(5 + one_of(&r, 9), 5 + one_of(&r, 9), 5 + one_of(&r, 9), NULL, gyroid, q);
        isogi_trace_desc d = desc_make(&s, (float)random_range(&r, 0, 0.95), one_of(&r, 4) - 1, 1 + one_of(&r, 4));
        float points[100][3], e[2][100][3], error[100], value[100];
        if (!one_of(&r, 4)) d.mode = ISOGI_TRACE_TRANSFER, d.order = 1 + one_of(&r, 3), d.transfer_channels = 3;
        if (!one_of(&r, 3)) d.lattice[0] = (size_t)(1 + one_of(&r, 14)), d.lattice[2] = (size_t)(1 + one_of(&r, 14));
        d.lazy = one_of(&r, 2), d.sides = one_of(&r, 2) ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE, d.capped = !one_of(&r, 3);
        d.lighting.env.sh = &g->sh[0][0][0], d.lighting.env.sh_order = 3, d.normals = (isogi_normal_kind)one_of(&r, 2);
        d.storage = (isogi_trace_format)one_of(&r, 3), d.albedo_points = g->colours[0], d.albedo_count = 4;
        for (int i = 0; i < 100; i++)
            for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, -0.5, (double)s.volume.size[a] - 0.5);
        isogi_trace *t = asked(&d, (const float(*)[3])points, d.lazy ? 30 : 0), *fresh;
        for (int i = 0; i < 10; i++) {
            isogi_trace_desc other = d;
            switch (one_of(&r, 5)) {
            case 0: CHECK(isogi_trace_request(t, (const float(*)[3])points + one_of(&r, 80), 20) == ISOGI_OK, "case %d", k); break;
            case 1: change_box(&s, t, &r, one_of(&r, 2)); break;
            case 2:
                change_anything(&other, g, &r);
                CHECK(isogi_trace_change(t, &other) == ISOGI_OK, "case %d", k);
                d = other;
                break;
            default: CHECK(isogi_trace_step(t, (uint64_t)(1 + one_of(&r, 3000)), &remaining) == ISOGI_OK, "case %d", k);
            }
        }
        isogi_trace_request(t, (const float(*)[3])points, 100); /* surfaces may have come */
        CHECK(isogi_trace_change(t, &d) == ISOGI_OK && isogi_trace_step(t, 0, &remaining) == ISOGI_OK && remaining <= 0, "case %d", k);
        fresh = asked(&d, (const float(*)[3])points, 100), isogi_trace_step(fresh, 0, NULL);
        isogi_trace_sample(t, (const float(*)[3])points, 100, e[0], NULL);
        isogi_trace_sample(fresh, (const float(*)[3])points, 100, e[1], error);
        isogi_vol_sample(s.pyramid, (const float(*)[3])points, 100, value, NULL);
        for (int i = 0; i < 100; i++) {
            int all = !(d.isovalue_min < 0 || d.isovalue_min > 0 || d.isovalue_max < 0 || d.isovalue_max > 0);
            if (!(error[i] < 1e30f) || !(all || ((double)value[i] >= d.isovalue_min && (double)value[i] <= d.isovalue_max))) continue;
            CHECK(!memcmp(e[0][i], e[1][i], sizeof e[0][i]), "case %d, point %d: %g, of a new bake %g", k, i, (double)e[0][i][1],
                  (double)e[1][i][1]);
            compared++;
        }
        isogi_trace_free(t), isogi_trace_free(fresh), scene_free(&s), free(g);
    }
    printf("    %d points compared\n", compared);
    CHECK(compared > 1000, "%d points compared", compared);
}

/* ---- what cannot change, and memory ---------------------------------------------------------------------------------------------- */

TEST(other_textures_are_refused) {
    double q[1] = {0.5};
    scene s = scene_make(8, 8, 8, NULL, gyroid, q), s2 = scene_make(8, 8, 8, NULL, gyroid, q);
    const isogi_trace_desc good = desc_make(&s, 0.5f, 1, 1);
    isogi_trace *t = baked(&good);
    size_t first[3] = {1, 2, 3}, last[3] = {2, 1, 3}, beyond[3] = {8, 8, 8}, far_off[3] = {1000, 1000, (size_t)-1};
    for (int i = 0; i < 17; i++) {
        isogi_trace_desc d = good;
        switch (i) {
        case 0: d.pyramid = s2.pyramid; break;
        case 1: d.mode = ISOGI_TRACE_TRANSFER; break;
        case 2: d.lattice[1] = 8; break;
        case 3: d.lattice_max[0] = d.lattice_max[1] = d.lattice_max[2] = 5; break;
        case 4: d.normals = ISOGI_NORMAL_TRILINEAR; break;
        case 5: d.lazy = 1; break;
        case 6: d.capped = 1; break;
        case 7: d.sides = ISOGI_TRACE_HIGH_SIDE; break;
        case 8: d.storage = ISOGI_TRACE_HALF; break;
        case 9: d.hierarchy = 0.3f; break;
        case 10: d.box_end[0] = d.box_end[1] = d.box_end[2] = 3; break;
        case 11: d.method = ISOGI_TRACE_FEEDBACK; break;
        case 12: d.albedo[0] = 2; break;
        case 13: d.pyramid = NULL; break;
        case 14: d.order = 3; break;
        case 15: d.lattice_min[2] = 1, d.lattice_max[2] = 2; break;
        default: d.box_first[0] = 1, d.box_end[0] = d.box_end[1] = d.box_end[2] = 8;
        }
        CHECK(isogi_trace_change(t, &d) == ISOGI_INVALID, "change %d", i);
    }
    CHECK(isogi_trace_change(NULL, &good) == ISOGI_INVALID && isogi_trace_change(t, NULL) == ISOGI_INVALID &&
              isogi_trace_relight(t, NULL) == ISOGI_INVALID,
          "nothing %d", 1);
    CHECK(isogi_trace_touch(t, first, last) == ISOGI_INVALID && isogi_trace_touch(t, beyond, beyond) == ISOGI_INVALID &&
              isogi_trace_touch(t, NULL, last) == ISOGI_INVALID,
          "an empty box %d", 1);
    CHECK(counted(t).rays == finished(t, &good, "nothing changed").rays + counted(t).rays, "rays %d", 0);
    CHECK(isogi_trace_touch(t, first, far_off) == ISOGI_OK, "cut to the volume %d", 1);
    finished(t, &good, "touched, not changed");
    isogi_trace_free(t), scene_free(&s), scene_free(&s2);
}

/* The k-th allocation fails, for every k: the texture is as it was, and the same call works afterwards. */
TEST(every_allocation_may_fail) {
    enum { W = 16, H = 8 };
    static float image[2][H][W][3];
    double q[1] = {0.5};
    scene s = scene_make(9, 8, 9, NULL, gyroid, q);
    size_t first[3] = {0, 0, 0}, last[3] = {4, 4, 4};
    for (int i = 0; i < 2 * W * H * 3; i++) (&image[0][0][0][0])[i] = i < W * H * 3 ? 1 : (float)(i % 7);
    for (int kind = 0; kind < 4; kind++) {
        int finished_once = 0;
        for (long k = 0; k < 60 && !finished_once; k++) {
            scarce memory = {-1, 0};
            isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
            isogi_trace_desc d = desc_make(&s, 0.5f, 1, 1), other;
            isogi_trace *t = NULL, *same;
            d.sides = kind & 1 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE, d.isovalue_min = 0.6, d.isovalue_max = 0.7;
            d.method = kind < 2 ? ISOGI_TRACE_PATHS : ISOGI_TRACE_FEEDBACK;
            d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0, d.lighting.env.rgb = &image[0][0][0][0], d.lighting.env.width = W,
            d.lighting.env.height = H;
            isogi_trace_create(&t, &d, &context), isogi_trace_step(t, 0, NULL);
            same = baked(&d), other = d;
            other.lighting.env.rgb = &image[1][0][0][0], other.isovalue_min = -0.5, other.albedo[0] = 0.9f;
            memory.left = k;
            isogi_result result = kind == 3 ? isogi_trace_touch(t, first, last) : isogi_trace_change(t, &other);
            finished_once = memory.left >= 0;
            memory.left = -1;
            CHECK(result == (finished_once ? ISOGI_OK : ISOGI_NO_MEMORY), "kind %d, allocation %ld: %d", kind, k, result);
            if (result != ISOGI_OK) {
                CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK && same_bits(t, same), "kind %d: changed after allocation %ld", kind, k);
                CHECK((kind == 3 ? isogi_trace_touch(t, first, last) : isogi_trace_change(t, &other)) == ISOGI_OK,
                      "kind %d: again after allocation %ld", kind, k);
            }
            if (kind < 2) finished(t, &other, "after a failure");
            else CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "kind %d: step after allocation %ld", kind, k);
            isogi_trace_free(t), isogi_trace_free(same);
            CHECK(memory.blocks == 0, "kind %d, allocation %ld: %ld blocks leak", kind, k, memory.blocks);
        }
        CHECK(finished_once, "kind %d: there are more allocations", kind);
    }
    scene_free(&s);
}

/* A touch that fails leaves lookups as they were, also where no texel around has a surface and the nearest one is read, and no memory. */
TEST(a_touch_that_fails_changes_no_lookup) {
    static float voxels[24 * 24 * 24];
    static const float sky[3] = {3.5449f, 3.5449f, 3.5449f}, point[1][3] = {{6.5f, 12.3f, 12.3f}};
    const size_t first[3] = {4, 4, 4}, last[3] = {20, 20, 20};
    for (int i = 0; i < 24 * 24 * 24; i++) voxels[i] = i % 24 >= 8;
    for (int method = 0; method < 2; method++) {
        scarce memory = {-1, 0};
        const isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
        const isogi_volume v = {.data = voxels, .type = ISOGI_F32, .size = {24, 24, 24}};
        isogi_pyramid *pyramid = NULL;
        isogi_trace *t = NULL;
        float before[1][3], after[1][3];
        int failed = 0;
        CHECK(isogi_vol_build(&pyramid, &v, &context) == ISOGI_OK, "build");
        const isogi_trace_desc d = {.pyramid = pyramid, .lighting = {.env = {.sh = sky, .sh_order = 1}}, .samples = 8,
                                    .method = (isogi_trace_method)method};
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
        isogi_trace_sample(t, point, 1, before, NULL);
        const size_t bytes = isogi_trace_memory(t);
        for (long k = 0; k < 100; k++) {
            memory.left = k;
            const isogi_result result = isogi_trace_touch(t, first, last);
            memory.left = -1;
            if (result == ISOGI_OK) break;
            failed++;
            isogi_trace_sample(t, point, 1, after, NULL);
            CHECK(!memcmp(before, after, sizeof after), "method %d, allocation %ld: %g, before %g", method, k, (double)after[0][1],
                  (double)before[0][1]);
            CHECK(isogi_trace_memory(t) == bytes, "method %d, allocation %ld: %zu bytes, before %zu", method, k, isogi_trace_memory(t),
                  bytes);
        }
        CHECK(failed > 2 && before[0][1] > 1, "%d allocations failed, E %g", failed, (double)before[0][1]);
        isogi_trace_free(t), isogi_vol_free(pyramid);
    }
}

/* A new lighting of transfer, with an image whose bright spots are looked for: each allocation fails once, on either side and level. The
   light stays as it was, and the same call works afterwards. */
TEST(every_allocation_of_a_lighting_may_fail) {
    enum { W = 64, H = 32 };
    static float image[2][H][W][3];
    double q[1] = {0.5};
    scene s = scene_make(9, 8, 9, NULL, gyroid, q);
    float points[30][3], e[3][30][3], lit[3][2][9][3];
    const int n = surface_points(&s, 0, 30, 5, points);
    const isogi_light dark = {.vector = {1, 2, 3}, .rgb = {-1, 0.5f, 1}};
    for (int i = 0; i < 2 * W * H * 3; i++) (&image[0][0][0][0])[i] = i / 3 % (W * H) == 900 ? 500 : i < W * H * 3 ? 1 : (float)(i % 7);
    for (int kind = 0; kind < 4; kind++) {
        int finished_once = 0;
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
        d.mode = ISOGI_TRACE_TRANSFER, d.order = 3, d.sides = kind & 1 ? ISOGI_TRACE_BOTH_SIDES : ISOGI_TRACE_LOW_SIDE;
        d.hierarchy = kind & 2 ? 9 : 0;
        memset(&d.lighting, 0, sizeof d.lighting);
        d.lighting.env.rgb = &image[0][0][0][0], d.lighting.env.width = W, d.lighting.env.height = H;
        const isogi_lighting other = {.env = {.rgb = &image[1][0][0][0], .width = W, .height = H}, .lights = &dark, .light_count = 1};
        for (long k = 0; k < 20 && !finished_once; k++) {
            scarce memory = {-1, 0};
            const isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
            isogi_trace *t = NULL, *side;
            CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "kind %d", kind);
            side = kind & 1 ? isogi_trace_high(t) : t;
            for (int call = 0; call < 3; call++) { /* before, after a failure, after it worked */
                isogi_result result = ISOGI_OK;
                if (call) memory.left = call == 1 ? k : -1, result = isogi_trace_relight(t, &other);
                if (call == 1) finished_once = memory.left >= 0;
                memory.left = -1;
                CHECK(result == (call == 1 && !finished_once ? ISOGI_NO_MEMORY : ISOGI_OK), "kind %d, allocation %ld: %s", kind, k,
                      isogi_result_string(result));
                isogi_trace_sample(side, (const float(*)[3])points, (size_t)n, e[call], NULL);
                isogi_trace_lighting(side, lit[call][0], lit[call][1]);
            }
            const int kept = !memcmp(e[0], e[1], (size_t)n * sizeof e[0][0]) && !memcmp(lit[0], lit[1], sizeof lit[0]);
            CHECK(kept == !finished_once, "kind %d, allocation %ld: the light %s", kind, k, kept ? "stays" : "changes");
            CHECK(memcmp(lit[0], lit[2], sizeof lit[0]), "kind %d: no new light", kind);
            for (int i = 0; i < n; i++) CHECK(memcmp(e[0][i], e[2][i], sizeof e[0][i]), "kind %d: no new light at %d", kind, i);
            isogi_trace_free(t);
            CHECK(memory.blocks == 0, "kind %d, allocation %ld: %ld blocks leak", kind, k, memory.blocks);
            CHECK(!finished_once || k > 0, "kind %d: no allocation at all", kind);
        }
        CHECK(finished_once, "kind %d: there are more allocations", kind);
    }
    scene_free(&s);
}

/* Errors refer to the brightest glow that there may be: where it changes all texels are computed again, those that have another colour
   than the one that changes, too. */
TEST(the_brightest_glow_is_part_of_all_errors) {
    double q[4] = {4, 4, 4, 2.6};
    scene s = scene_make(9, 9, 9, NULL, ball, q);
    isogi_albedo_point glow[2][3] = {{{-5, {1, 2, 3}}, {1, {1, 2, 3}}, {5, {9, 9, 9}}},
                                     {{-5, {1, 2, 3}}, {1, {1, 2, 3}}, {5, {30, 40, 50}}}};
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
    d.isovalue_min = -0.5, d.isovalue_max = 0.5, d.emission_points = glow[0], d.emission_count = 3;
    isogi_trace *t = baked(&d);
    d.emission_points = glow[1];
    CHECK(isogi_trace_change(t, &d) == ISOGI_OK && finished(t, &d, "another glow elsewhere").texels > 50, "change");
    isogi_trace_free(t), scene_free(&s);
}

TEST_MAIN("trace_change")
