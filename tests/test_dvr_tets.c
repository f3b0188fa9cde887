/* Properties of tetrahedral meshes of isogi_dvr.h: exact integrals, gaps and re-entry, degenerate input. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"

typedef struct mesh {
    float (*points)[3], *values;
    uint32_t (*tets)[4];
    isogi_tet_mesh view;
    isogi_tets *built;
    isogi_tet_report report;
} mesh;

/* A lattice of n^3 points with spacing 1, cells split into six tetrahedra about the diagonal from corner 0 to corner 7: conforming. Cells
   that `keep` refuses are left out. */
static mesh lattice_mesh(int n, field_function *f, int (*keep)(int, int, int)) {
    static const int path[6][2] = {{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}};
    size_t cells = (size_t)((n - 1) * (n - 1) * (n - 1)), count = 0;
    mesh m = {(float(*)[3])malloc((size_t)(n * n * n) * sizeof(float[3])), (float *)malloc((size_t)(n * n * n) * sizeof(float)),
              (uint32_t(*)[4])malloc(6 * cells * sizeof(uint32_t[4])), {0}, NULL, {0}};
    for (int i = 0; i < n * n * n; i++) {
        const int c[3] = {i % n, i / n % n, i / n / n};
        for (int a = 0; a < 3; a++) m.points[i][a] = (float)c[a];
        m.values[i] = (float)f(c[0] / (n - 1.0), c[1] / (n - 1.0), c[2] / (n - 1.0));
    }
    for (int k = 0; k < n - 1; k++)
        for (int j = 0; j < n - 1; j++)
            for (int i = 0; i < n - 1; i++) {
                uint32_t corner[8];
                if (keep && !keep(i, j, k)) continue;
                for (int c = 0; c < 8; c++) corner[c] = (uint32_t)(i + (c & 1) + n * (j + (c >> 1 & 1) + n * (k + (c >> 2))));
                for (int t = 0; t < 6; t++) {
                    const uint32_t tet[4] = {corner[0], corner[path[t][0]], corner[path[t][1]], corner[7]};
                    memcpy(m.tets[count++], tet, sizeof tet);
                }
            }
    m.view = (isogi_tet_mesh){(const float(*)[3])m.points, m.values, (size_t)(n * n * n), (const uint32_t(*)[4])m.tets, count};
    return m;
}

static void mesh_build(mesh *m) {
    isogi_result result = isogi_dvr_tets_build(&m->built, &m->view, &m->report, &serial);
    CHECK(result == ISOGI_OK, "build: %s", isogi_result_string(result));
    if (!m->built) abort();
}

static void mesh_free(mesh *m) { isogi_dvr_tets_free(m->built), free(m->points), free(m->values), free(m->tets); }

static pixel cast_tets(const isogi_tets *tets, const isogi_tet_desc *desc, const isogi_transfer *transfer, const double eye[3],
                       const double target[3]) {
    isogi_view view = line_of_sight(eye, target);
    pixel p;
    isogi_result result = isogi_dvr_tets_render(tets, desc, transfer, &view, (float(*)[4])p.c, &p.depth, NULL);
    CHECK(result == ISOGI_OK, "render: %s", isogi_result_string(result));
    return p;
}

static double slope[3];
static double linear(double x, double y, double z) { return slope[0] * x + slope[1] * y + slope[2] * z; }

static const isogi_transfer_point ramp[] = {
    {-2, {1, 0.2f, 0.1f}, 0}, {-0.5, {0.3f, 1, 0.1f}, 2}, {0.1, {0.1f, 0.4f, 1}, 0}, {0.2, {0.1f, 0.4f, 1}, 1}, {2, {1, 0, 1}, 3}};
static const isogi_transfer both = {ramp, 5, sheets, 2};

/* A linear field is the same in tetrahedra and in the cells that they were cut from: pictures of the lattice, exact in data space, and
   with small steps in physical space. */
TEST(linear_fields_look_as_on_the_lattice) {
    enum { N = 7, SIDE = 16 };
    test_random r = {1};
    for (int n = 0; n < 6; n++) {
        random_direction(&r, slope);
        for (int a = 0; a < 3; a++) slope[a] *= 1.5;
        field f = field_of(linear, N);
        mesh m = lattice_mesh(N, linear, NULL);
        mesh_build(&m);
        CHECK(m.report.degenerate == 0 && m.report.crowded == 0 && m.report.border == 12 * (N - 1) * (N - 1), "border %zu",
              m.report.border);
        isogi_view view = view_of(&f, 1, &r, SIDE);
        for (int space = 0; space < 2; space++)
            for (int s = 0; s < (space ? 2 : 1); s++) {
                const isogi_dvr_desc desc = {.pyramid = f.pyramid, .space = (isogi_dvr_space)space, .step = 0.01, .opaque = 1,
                    .silhouette = (isogi_dvr_silhouette)s};
                const isogi_tet_desc tet_desc = {.space = (isogi_dvr_space)space, .opaque = 1, .silhouette = (isogi_dvr_silhouette)s};
                isogi_dvr *dvr = dvr_new(&desc, &both);
                float depth[2][SIDE * SIDE], image[SIDE * SIDE][4];
                float(*expected)[4] = picture(dvr, &view, NULL, depth[0], NULL);
                isogi_counters count = {0};
                isogi_result result = isogi_dvr_tets_render(m.built, &tet_desc, &both, &view, image, depth[1], &count);
                CHECK(result == ISOGI_OK && count.rays >= SIDE * SIDE && count.cells > 0, "%s, %d cells", isogi_result_string(result),
                      (int)count.cells);
                /* values of points are floats: 1e-7; steps of physical space */
                double most = largest_difference(expected, image, SIDE * SIDE), deepest = 0;
                for (int i = 0; i < SIDE * SIDE; i++)
                    if (expected[i][3] > 0.01f && depth[0][i] < 1e30f)
                        deepest = fmax(deepest, fabs((double)depth[0][i] - (double)depth[1][i]));
                CHECK(most < (space ? 4e-6 : 2e-4), "space %d silhouette %d: largest difference %g", space, s, most);
                CHECK(deepest < 0.02, "depth differs by %g", deepest);
                free(expected), isogi_dvr_free(dvr);
            }
        mesh_free(&m), field_free(&f);
    }
}

static double bumpy(double x, double y, double z) { return sin(5 * x + 1) * cos(4 * y) + 0.5 * sin(7 * z); }

/* The piecewise linear field along a line, by brute force: for each tetrahedron the stretch within it. */
typedef struct stretch { double t[2], value[2]; } stretch;
static int by_begin(const void *a, const void *b) {
    double x = ((const stretch *)a)->t[0], y = ((const stretch *)b)->t[0];
    return (x > y) - (x < y);
}
static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static int brute_stretches(const isogi_tet_mesh *m, const double o[3], const double d[3], stretch *out) {
    int count = 0;
    for (size_t i = 0; i < m->tet_count; i++) {
        double e[3][3], q[3], inverse[3][3], det, base[4], rate[4], t0 = 0, t1 = 1e30, v0 = 0, v1 = 0;
        const uint32_t *p = m->tets[i];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) e[k][a] = (double)m->points[p[k + 1]][a] - (double)m->points[p[0]][a];
        for (int a = 0; a < 3; a++) q[a] = o[a] - (double)m->points[p[0]][a];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) {
                const double *u = e[(k + 1) % 3], *v = e[(k + 2) % 3];
                inverse[k][a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
            }
        det = dot3(e[0], inverse[0]);
        base[0] = 1, rate[0] = 0;
        for (int k = 0; k < 3; k++) base[k + 1] = dot3(q, inverse[k]) / det, rate[k + 1] = dot3(d, inverse[k]) / det;
        for (int k = 1; k < 4; k++) base[0] -= base[k], rate[0] -= rate[k];
        for (int k = 0; k < 4; k++) { /* barycentric coordinate base + t rate >= 0 */
            double t = -base[k] / rate[k];
            if (rate[k] > 0) t0 = fmax(t0, t);
            else t1 = fmin(t1, t);
        }
        if (!(t1 > t0 + 1e-13)) continue;
        for (int k = 0; k < 4; k++)
            v0 += (base[k] + t0 * rate[k]) * (double)m->values[p[k]], v1 += (base[k] + t1 * rate[k]) * (double)m->values[p[k]];
        out[count++] = (stretch){{t0, t1}, {v0, v1}};
    }
    qsort(out, (size_t)count, sizeof *out, by_begin);
    return count;
}

/* Midpoint rule over many short pieces of each stretch; both spaces, no peaks. */
static void brute_integral(const stretch *s, int count, const isogi_transfer *t, int data, long double out[4]) {
    for (int a = 0; a < 3; a++) out[a] = 0;
    out[3] = 1;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 100; k++) {
            long double v[4], length = (long double)(data ? fabs(s[i].value[1] - s[i].value[0]) : s[i].t[1] - s[i].t[0]) / 100;
            reference_transfer(t, (long double)s[i].value[0] + (k + 0.5L) / 100 * ((long double)s[i].value[1] - (long double)s[i].value[0]),
                               v);
            for (int a = 0; a < 3; a++) out[a] += out[3] * -expm1l(-v[3] * length) * v[a];
            out[3] *= expl(-v[3] * length);
        }
}

static int keep_shell(int i, int j, int k) { return !(i > 1 && i < 5 && j > 0 && j < 5 && k > 1 && k < 4) && (i + j + k) % 5 != 2; }
static int keep_all(int i, int j, int k) { return (void)i, (void)j, (void)k, 1; }

/* Random fields, and meshes with holes that rays leave and enter again, from outside and from within. */
TEST(both_integrals_agree_with_brute_force_through_holes) {
    test_random r = {2};
    static stretch s[4000];
    double most[2] = {0, 0};
    int entered = 0;
    for (int n = 0; n < 4; n++) {
        mesh m = lattice_mesh(8, bumpy, n % 2 ? keep_shell : keep_all);
        for (size_t i = 0; i < m.view.point_count; i++)
            for (int a = 0; a < 3; a++) m.points[i][a] += (float)random_range(&r, -0.15, 0.15);
        mesh_build(&m);
        const isogi_transfer media = {ramp, 5, NULL, 0};
        for (int i = 0; i < (LONG_SUITE ? 400 : 30); i++) {
            double eye[3], target[3], origin[3], d[3], gaps = 0;
            float dir[3];
            long double expected[4];
            random_direction(&r, d);
            for (int a = 0; a < 3; a++) {
                target[a] = (double)(float)random_range(&r, 1, 6);
                eye[a] = (double)(float)(i % 4 ? target[a] + 20 * d[a] : random_range(&r, 1, 6)); /* every fourth from within */
            }
            isogi_view view = line_of_sight(eye, target);
            isogi_view_ray(&view, 0, 0, origin, dir);
            for (int a = 0; a < 3; a++) d[a] = (double)dir[a];
            int count = brute_stretches(&m.view, origin, d, s);
            for (int k = 1; k < count; k++) gaps += s[k].t[0] > s[k - 1].t[1] + 1e-6;
            entered += gaps > 0;
            for (int space = 0; space < 2; space++) {
                const isogi_tet_desc desc = {.space = (isogi_dvr_space)space, .opaque = 1};
                pixel p = cast_tets(m.built, &desc, &media, eye, target);
                brute_integral(s, count, &media, space, expected);
                for (int a = 0; a < 4; a++) {
                    double error = fabs((double)p.c[a] - (double)(a < 3 ? expected[a] : 1 - expected[3]));
                    most[space] = fmax(most[space], error);
                    CHECK(error < 5e-5, "mesh %d ray %d space %d channel %d: %.9g, not %.9g", n, i, space, a, (double)p.c[a],
                          (double)(a < 3 ? expected[a] : 1 - expected[3]));
                }
            }
        }
        mesh_free(&m);
    }
    printf("    largest difference %.2g physical, %.2g data; %d rays entered again\n", most[0], most[1], entered);
    CHECK(entered > 15, "%d rays entered again", entered);
}

/* Along edges, through points, within faces: as beside them, to the little that the place differs. */
TEST(rays_through_edges_and_points_find_their_way) {
    mesh m = lattice_mesh(6, bumpy, NULL);
    mesh_build(&m);
    const isogi_transfer media = {ramp, 5, NULL, 0};
    const double lines[][2][3] = {{{-5, 2, 2}, {5, 2, 2}}, {{-5, -5, -5}, {5, 5, 5}}, {{2, 2, -9}, {2, 2, 3}},     {{-4, -4, 2}, {5, 5, 2}},
                                  {{2, 9, 2}, {2, 3, 2}},  {{12, 10, 8}, {3, 3, 3}},  {{-3, 2.5, 3}, {3, 2.5, 3}}, {{3, 3, 3}, {5, 3, 3}},
                                  {{0, 0, 0}, {5, 4, 3}},  {{2, 2, 2}, {2, 2, 9}}};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        for (int space = 0; space < 2; space++) {
            const isogi_tet_desc desc = {.space = (isogi_dvr_space)space, .opaque = 1};
            double eye[3], target[3];
            for (int a = 0; a < 3; a++) eye[a] = lines[i][0][a] + 1e-4 * (a + 1), target[a] = lines[i][1][a] + 1e-4 * (a + 1.5);
            pixel p = cast_tets(m.built, &desc, &media, lines[i][0], lines[i][1]), q = cast_tets(m.built, &desc, &media, eye, target);
            CHECK(q.c[3] > 0.05f, "line %zu sees something: %g", i, (double)q.c[3]);
            for (int a = 0; a < 4; a++)
                CHECK(fabs((double)p.c[a] - (double)q.c[a]) < 3e-3, "line %zu space %d channel %d: %g, beside it %g", i, space, a,
                      (double)p.c[a], (double)q.c[a]);
        }
    mesh_free(&m);
}

static double one_value(double x, double y, double z) { return (void)x, (void)y, (void)z, 1; }

/* Rays from anywhere exactly at points of a lattice, or at middles of its edges, with and without a third of the tetrahedra: what lies
   behind is not missed. Rays next to the plane of a face are left out. */
TEST(rays_at_edges_and_points_see_all_that_is_behind) {
    const isogi_transfer_point fog[] = {{0, {1, 1, 1}, 0.1f}};
    const isogi_transfer media = {fog, 1, NULL, 0};
    const isogi_tet_desc desc = {.opaque = 1};
    static stretch s[64];
    test_random r = {31};
    long rays = 0;
    for (int n = 0; n < (LONG_SUITE ? 20000 : 1500); n++) {
        mesh m = lattice_mesh(3, one_value, NULL);
        size_t kept = 0;
        for (size_t i = 0; i < m.view.tet_count; i++)
            if (n % 2 || random_bits(&r) % 3) memmove(m.tets[kept++], m.tets[i], sizeof m.tets[0]);
        m.view.tet_count = kept;
        mesh_build(&m);
        for (int i = 0; i < 4; i++) {
            const int cell = (int)(random_bits(&r) % 8), edge = 1 + (int)(random_bits(&r) % 7);
            double eye[3], target[3], d[3], length = 0, slant = 1;
            for (int a = 0; a < 3; a++) {
                target[a] = i % 2 ? (double)(random_bits(&r) % 3) : (cell >> a & 1) + 0.5 * (edge >> a & 1);
                eye[a] = (double)(float)(target[a] + random_range(&r, -3, 3));
            }
            if (i > 1) { /* in one plane with the edge and a direction of small whole numbers */
                const double along = random_range(&r, -2, 2), across = random_range(&r, -2, 2);
                for (int a = 0; a < 3; a++) eye[a] = target[a] + along * (edge >> a & 1) + across * (1 + a);
            }
            double far = 0;
            for (int a = 0; a < 3; a++) d[a] = target[a] - eye[a], far += d[a] * d[a];
            for (int a = 0; a < 3; a++) d[a] /= sqrt(far);
            for (int f = 0; f < 9; f++) { /* the planes of faces */
                static const int normal[9][3] = {
                    {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}, {1, -1, 0}, {1, 0, -1}, {0, 1, -1}};
                slant = fmin(slant, fabs(normal[f][0] * d[0] + normal[f][1] * d[1] + normal[f][2] * d[2]));
            }
            if (slant < 1e-3) continue;
            const int count = brute_stretches(&m.view, eye, d, s);
            for (int k = 0; k < count; k++) length += s[k].t[1] - s[k].t[0];
            const double opacity = (double)cast_tets(m.built, &desc, &media, eye, target).c[3], expected = -expm1(-0.1 * length);
            rays++;
            CHECK(fabs(opacity - expected) <= 1e-5, "mesh %d, ray %d: opacity %g, not %g", n, i, opacity, expected);
        }
        mesh_free(&m);
    }
    CHECK(rays > 4000, "%ld rays", rays);
}

/* What is seen as far as a wall, over what is seen from there on: the whole. Walls stand within tetrahedra, in holes, before and behind. */
TEST(geometry_parts_what_is_seen) {
    test_random r = {5};
    mesh m = lattice_mesh(7, bumpy, keep_shell);
    int parted = 0;
    mesh_build(&m);
    for (int n = 0; n < (LONG_SUITE ? 20000 : 2000); n++) {
        const isogi_tet_desc desc = {.space = (isogi_dvr_space)(n % 2), .opaque = 1, .silhouette = (isogi_dvr_silhouette)(n % 4 / 2)};
        double eye[3], target[3], beyond[3], origin[3];
        float until = (float)random_range(&r, 0, 20), dir[3];
        for (int a = 0; a < 3; a++) target[a] = random_range(&r, 1, 4), eye[a] = target[a] + random_range(&r, -9, 9);
        isogi_view view = line_of_sight(eye, target);
        isogi_view_ray(&view, 0, 0, origin, dir);
        for (int a = 0; a < 3; a++) {
            eye[a] = origin[a], target[a] = origin[a] + 40 * (double)dir[a];
            beyond[a] = origin[a] + (double)(until * dir[a]);
        }
        pixel whole = cast_tets(m.built, &desc, &both, eye, target), rest = cast_tets(m.built, &desc, &both, beyond, target), first;
        view = line_of_sight(eye, target), view.until = &until;
        isogi_result result = isogi_dvr_tets_render(m.built, &desc, &both, &view, (float(*)[4])first.c, &first.depth, NULL);
        CHECK(result == ISOGI_OK, "render: %s", isogi_result_string(result));
        parted += first.c[3] > 0.01f && rest.c[3] > 0.01f;
        CHECK(!(first.depth < 1e30f) || first.depth <= until * 1.000001f, "case %d: seen %g off, before %g", n, (double)first.depth,
              (double)until);
        for (int a = 0; a < 4; a++) {
            double sum = (double)first.c[a] + (1 - (double)first.c[3]) * (double)rest.c[a];
            CHECK(fabs(sum - (double)whole.c[a]) < 1e-4, "case %d, channel %d: %g and %g behind it make %g, not %g", n, a,
                  (double)first.c[a], (double)rest.c[a], sum, (double)whole.c[a]);
        }
    }
    CHECK(parted > 200, "%d rays end among matter", parted);
    mesh_free(&m);
}

/* Every crossing of a peak composites its opacity: counted by brute force along the stretches. */
TEST(peaks_in_tetrahedra_are_crossed_exactly) {
    test_random r = {3};
    static stretch s[4000];
    mesh m = lattice_mesh(8, bumpy, NULL);
    mesh_build(&m);
    int total = 0;
    for (int i = 0; i < 200; i++) {
        const isogi_peak peak = {random_range(&r, -0.8, 0.8), {1, 0.5f, 0.25f}, 0.3f};
        const isogi_transfer surface = {NULL, 0, &peak, 1};
        double eye[3], target[3], origin[3], d[3];
        float dir[3];
        random_direction(&r, d);
        for (int a = 0; a < 3; a++) target[a] = (double)(float)random_range(&r, 1, 6), eye[a] = (double)(float)(target[a] + 20 * d[a]);
        isogi_view view = line_of_sight(eye, target);
        isogi_view_ray(&view, 0, 0, origin, dir);
        for (int a = 0; a < 3; a++) d[a] = (double)dir[a];
        int count = brute_stretches(&m.view, origin, d, s), crossings = 0;
        for (int k = 0; k < count; k++) crossings += (s[k].value[0] >= peak.isovalue) != (s[k].value[1] >= peak.isovalue);
        total += crossings;
        for (int space = 0; space < 2; space++) {
            const isogi_tet_desc desc = {.space = (isogi_dvr_space)space, .opaque = 1};
            pixel p = cast_tets(m.built, &desc, &surface, eye, target);
            CHECK(fabs((double)p.c[3] - (1 - pow(1 - (double)0.3f, crossings))) < 1e-6, "ray %d space %d: opacity %g of %d crossings", i,
                  space, (double)p.c[3], crossings);
        }
    }
    CHECK(total > 150, "%d crossings", total);
    mesh_free(&m);
}

/* ---- odd meshes ---- */

TEST(degenerate_and_crowded_tetrahedra_are_reported) {
    slope[0] = 1, slope[1] = slope[2] = 0;
    mesh m = lattice_mesh(4, linear, NULL);
    size_t count = m.view.tet_count;
    uint32_t (*more)[4] = (uint32_t(*)[4])malloc((count + 5) * sizeof *more);
    memcpy(more, m.tets, count * sizeof *more);
    const uint32_t flat[5][4] = {{0, 1, 2, 3}, {0, 1, 4, 5}, {7, 7, 8, 9}, {5, 5, 5, 5}, {0, 0, 0, 0}};
    memcpy(more + count, flat, sizeof flat);
    memcpy(more + count + 4, more, sizeof *more); /* the first once more: its faces are crowded */
    free(m.tets);
    m.tets = more, m.view.tets = (const uint32_t(*)[4])more, m.view.tet_count = count + 5;
    uint32_t swap = m.tets[3][0];
    m.tets[3][0] = m.tets[3][1], m.tets[3][1] = swap; /* turned inside out */
    mesh_build(&m);
    CHECK(m.report.degenerate == 4 && m.report.crowded > 0, "%zu degenerate, %zu crowded", m.report.degenerate, m.report.crowded);
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.5f};
    const isogi_transfer fog = {&medium, 1, NULL, 0};
    const isogi_tet_desc desc = {.space = ISOGI_DVR_DATA, .opaque = 1};
    const double eye[3] = {-5, 1.3, 1.6}, target[3] = {5, 1.3, 1.6};
    pixel p = cast_tets(m.built, &desc, &fog, eye, target);
    CHECK(fabs((double)p.c[3] + expm1(-0.5)) < 1e-6, "opacity %g", (double)p.c[3]);
    mesh_free(&m);
}

/* The mesh, and once more with points of its own, `shift` along x. */
static mesh twice(mesh m, double shift) {
    size_t n = m.view.point_count, count = m.view.tet_count;
    mesh two = {(float(*)[3])malloc(2 * n * sizeof(float[3])), (float *)malloc(2 * n * sizeof(float)),
                (uint32_t(*)[4])malloc(2 * count * sizeof(uint32_t[4])), {0}, NULL, {0}};
    for (size_t i = 0; i < 2 * n; i++) {
        for (int a = 0; a < 3; a++) two.points[i][a] = (float)((double)m.points[i % n][a] + (i >= n && a == 0 ? shift : 0));
        two.values[i] = m.values[i % n];
    }
    for (size_t i = 0; i < 2 * count; i++)
        for (int k = 0; k < 4; k++) two.tets[i][k] = m.tets[i % count][k] + (i >= count ? (uint32_t)n : 0);
    mesh_free(&m);
    two.view = (isogi_tet_mesh){(const float(*)[3])two.points, two.values, 2 * n, (const uint32_t(*)[4])two.tets, 2 * count};
    return two;
}

/* Grey of extinction 1/2 everywhere, physical space: along every ray of a picture, opacity is that of its length in the box `high`; returns
   how many pixels differ by more than `error`. */
static int wrong_in_fog(const isogi_tets *tets, const float eye[3], const float target[3], const double high[3], double error) {
    enum { SIDE = 12 };
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.5f};
    const isogi_transfer fog = {&medium, 1, NULL, 0};
    const isogi_tet_desc desc = {.opaque = 1};
    const isogi_view view = {.width = SIDE, .height = SIDE, .fov = 40, .eye = {eye[0], eye[1], eye[2]},
                             .target = {target[0], target[1], target[2]}};
    float image[SIDE * SIDE][4];
    int wrong = 0;
    CHECK(isogi_dvr_tets_render(tets, &desc, &fog, &view, image, NULL, NULL) == ISOGI_OK, "render");
    for (int i = 0; i < SIDE * SIDE; i++) {
        double o[3], from = 0, to = 1e30;
        float d[3];
        isogi_view_ray(&view, i % SIDE, i / SIDE, o, d);
        for (int a = 0; a < 3; a++) {
            double t0 = -o[a] / (double)d[a], t1 = (high[a] - o[a]) / (double)d[a];
            from = fmax(from, fmin(t0, t1)), to = fmin(to, fmax(t0, t1));
        }
        wrong += fabs((double)image[i][3] + (to > from ? expm1(-0.5 * (to - from)) : 0)) > error;
    }
    return wrong;
}

static const float outside[3] = {-5.1f, 4.9f, 6.07f}, within[3] = {0.33f, 1.91f, 1.07f}, corner[3] = {1, 2, 1};
static const float ahead[3] = {4.1f, 1.45f, 1.55f};

/* Whichever of its points comes first: its longest edge is the one between the second and the third. */
TEST(degenerate_tetrahedra_are_so_in_any_order) {
    static const float points[4][3] = {{0, 5e-13f, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 0.5f}}, values[4] = {0, 0, 1, 1};
    for (uint32_t first = 0; first < 4; first++) {
        const uint32_t tet[1][4] = {{first, (first + 1) % 4, (first + 2) % 4, (first + 3) % 4}};
        const isogi_tet_mesh one = {points, values, 4, tet, 1};
        isogi_tets *tets = NULL;
        isogi_tet_report report = {0};
        CHECK(isogi_dvr_tets_build(&tets, &one, &report, NULL) == ISOGI_OK && report.degenerate == 1, "%u first: %zu", first,
              report.degenerate);
        isogi_dvr_tets_free(tets);
    }
}

/* Nothing is lost between blocks with points of their own that touch, leave a gap or overlap by a rounding, whichever the eye is in; nor
   where every tetrahedron has points of its own and the eye is on one of them. */
TEST(parts_that_touch_or_overlap_are_seen_to_the_end) {
    const double overlaps[] = {0, -1e-6, 1e-7, 1e-6, 1e-5, 1e-3};
    slope[0] = slope[1] = slope[2] = 0;
    for (int i = 0; i < 12; i++) {
        double overlap = overlaps[i / 2];
        mesh m = twice(lattice_mesh(4, linear, NULL), i % 2 ? 3 - overlap : overlap - 3);
        for (size_t k = 0; k < m.view.point_count; k++) m.points[k][0] += i % 2 ? 0 : (float)(3 - overlap); /* in either order */
        mesh_build(&m);
        const double high[3] = {6 - overlap, 3, 3};
        const float *eyes[3] = {outside, within, corner};
        for (int e = 0; e < 3; e++) {
            int wrong = wrong_in_fog(m.built, eyes[e], ahead, high, 1e-5);
            CHECK(wrong == 0, "overlap %g, order %d, eye %d: %d pixels wrong", overlap, i % 2, e, wrong);
        }
        mesh_free(&m);
    }
    mesh m = lattice_mesh(4, linear, NULL);
    size_t n = m.view.tet_count;
    mesh apart = {(float(*)[3])malloc(4 * n * sizeof(float[3])), (float *)calloc(4 * n, sizeof(float)),
                  (uint32_t(*)[4])malloc(n * sizeof(uint32_t[4])), {0}, NULL, {0}};
    for (size_t i = 0; i < 4 * n; i++)
        memcpy(apart.points[i], m.points[m.tets[i / 4][i % 4]], sizeof *apart.points), apart.tets[i / 4][i % 4] = (uint32_t)i;
    apart.view = (isogi_tet_mesh){(const float(*)[3])apart.points, apart.values, 4 * n, (const uint32_t(*)[4])apart.tets, n};
    mesh_free(&m), mesh_build(&apart);
    const double high[3] = {3, 3, 3};
    int wrong[3] = {wrong_in_fog(apart.built, outside, ahead, high, 1e-5), wrong_in_fog(apart.built, within, ahead, high, 1e-5),
                    wrong_in_fog(apart.built, corner, ahead, high, 1e-5)};
    CHECK(wrong[0] + wrong[1] + wrong[2] == 0, "all apart: %d, %d, %d pixels wrong", wrong[0], wrong[1], wrong[2]);
    mesh_free(&apart);
}

/* Tetrahedra that occur twice, turned or not, are seen once; a thousand copies of one take no longer than a thousand tetrahedra. */
TEST(tetrahedra_listed_twice_are_seen_once) {
    const char *what[] = {"next to each other", "all, then all again", "every tenth", "one", "a thousand of one"};
    slope[0] = slope[1] = slope[2] = 0;
    for (int c = 0; c < 5; c++) {
        mesh m = lattice_mesh(4, linear, NULL);
        size_t count = m.view.tet_count, n = 0;
        uint32_t(*tets)[4] = (uint32_t(*)[4])malloc((2 * count + 1000) * sizeof *tets);
        for (size_t i = 0; i < (c == 1 ? 2 : 1) * count; i++) {
            size_t copies = c == 0 || (c == 2 && i % 10 == 0) || (c == 3 && i == 77) ? 2 : c == 4 && i == 77 ? 1000 : 1;
            for (size_t k = 0; k < copies; k++, n++) {
                memcpy(tets[n], m.tets[i % count], sizeof *tets);
                if (k % 2) tets[n][0] = m.tets[i][1], tets[n][1] = m.tets[i][0]; /* turned inside out */
            }
        }
        free(m.tets), m.tets = tets, m.view.tets = (const uint32_t(*)[4])tets, m.view.tet_count = n;
        mesh_build(&m);
        const double high[3] = {3, 3, 3};
        int wrong[2] = {wrong_in_fog(m.built, outside, ahead, high, 1e-5), wrong_in_fog(m.built, within, ahead, high, 1e-5)};
        CHECK(m.report.crowded == 4 * (n - count), "%s: %zu faces crowded", what[c], m.report.crowded);
        CHECK(wrong[0] + wrong[1] == 0, "%s: %d and %d pixels wrong", what[c], wrong[0], wrong[1]);
        mesh_free(&m);
    }
}

/* In physical space what counts is the length of the way, however much or little values change along it: ten or a tenth within a cube of
   length 1, through several points of the transfer function. */
TEST(lengths_count_whatever_values_pass_along_them) {
    const isogi_tet_desc desc = {.space = ISOGI_DVR_PHYSICAL, .opaque = 1};
    const double eye[3] = {-2, 0.3, 0.4}, target[3] = {3, 0.3, 0.4};
    for (double range = 0.1; range < 20; range *= 10) {
        const isogi_transfer_point p[] = {{0, {1, 0, 0}, 0}, {0.2 * range, {0, 1, 0}, 1}, {0.4 * range, {0, 0, 1}, 0.2f},
                                          {0.6 * range, {1, 1, 0}, 2}, {range, {1, 1, 1}, 0.5f}};
        const isogi_transfer transfer = {p, 5, NULL, 0};
        slope[0] = range, slope[1] = slope[2] = 0;
        mesh m = lattice_mesh(2, linear, NULL);
        mesh_build(&m);
        for (int back = 0; back < 2; back++) {
            const pixel seen = cast_tets(m.built, &desc, &transfer, back ? target : eye, back ? eye : target);
            const double expected = 1 - exp(-(0.2 * 0.5 + 0.2 * 0.6 + 0.2 * 1.1 + 0.4 * 1.25));
            CHECK(fabs((double)seen.c[3] - expected) < 1e-6, "range %g: opacity %g, not %g", range, (double)seen.c[3], expected);
        }
        mesh_free(&m);
    }
}

/* Parts that overlap: what the second holds is drawn from where the first ends, by the values there, which need be none of the face that
   it was entered by; and around an eye on the border of one part there is another, if the first ends there. Tetrahedra listed twice have no
   border of their own. */
TEST(parts_that_overlap_are_seen_by_their_own_values) {
    const float points[8][3] = {{0, -5, -5},    {0, 5, -5},    {0, 0, 8},    {1.6f, 0, 0},
                                {0.5f, -5, -5}, {0.5f, 5, -5}, {0.5f, 0, 8}, {3.5f, 0, 0}};
    const float values[8] = {1, 1, 1, 1, 0, 0, 0, 3.6f}; /* of the second 1.2 (x - 0.5) */
    const uint32_t tets[3][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}, {5, 4, 6, 7}};
    const isogi_transfer_point p[] = {{0, {1, 1, 1}, 0}, {5, {1, 1, 1}, 1}};
    const isogi_transfer transfer = {p, 2, NULL, 0};
    const isogi_tet_desc desc = {.space = ISOGI_DVR_PHYSICAL, .opaque = 1};
    /* at y = 0.1, z = 0.2 the first ends where 2.3 = 40 (1.6 - x) / 1.6, the second where 2.3 = 40 (3.5 - x) / 3 */
    const double eye[3] = {-2, 0.1, 0.2}, target[3] = {5, 0.1, 0.2}, first = 1.6 * (1 - 2.3 / 40), last = 3.5 - 3 * 2.3 / 40;
    for (size_t count = 2; count <= 3; count++) {
        const isogi_tet_mesh view = {points, values, 8, tets, count};
        const double depth = 0.2 * (first + 0.6 * (pow(last - 0.5, 2) - pow(first - 0.5, 2)));
        isogi_tets *built = NULL;
        isogi_tet_report report;
        CHECK(isogi_dvr_tets_build(&built, &view, &report, &serial) == ISOGI_OK, "build");
        CHECK(report.border == 8 && report.crowded == 4 * (count - 2), "%zu faces on the border, %zu crowded", report.border,
              report.crowded);
        const pixel seen = cast_tets(built, &desc, &transfer, eye, target);
        CHECK(fabs((double)seen.c[3] - (1 - exp(-depth))) < 1e-6, "%zu: opacity %g, not %g", count, (double)seen.c[3], 1 - exp(-depth));
        isogi_dvr_tets_free(built);
    }
    mesh m = twice(lattice_mesh(2, one_value, NULL), 0.5);
    mesh_build(&m);
    const double on[3] = {1, 0.3, 0.4}, ahead_of_it[3] = {4, 0.3, 0.4};
    const pixel seen = cast_tets(m.built, &desc, &transfer, on, ahead_of_it);
    CHECK(fabs((double)seen.c[3] - (1 - exp(-0.2 * 0.5))) < 1e-6, "from the border of one part in another: opacity %g", (double)seen.c[3]);
    mesh_free(&m);
}

/* However far a point is that no tetrahedron has, or another part of the mesh: from within a block, from the gap between two and from a
   corner, opacity and the depth at which it begins are those of the blocks. */
TEST(what_is_far_off_changes_nothing_near_by) {
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.5f};
    const isogi_transfer fog = {&medium, 1, NULL, 0};
    const isogi_tet_desc desc = {.opaque = 1};
    static const float eyes[3][4] = {{0.5f, 0.4f, 0.3f, 0}, {1.7f, 0.4f, 0.3f, 0.3f}, {1, 1, 0, 0}}; /* and where matter begins */
    static const double length[3] = {1.5, 1, 0};
    slope[0] = slope[1] = slope[2] = 0;
    for (int part = 0; part < 2; part++)
        for (int power = 0; power <= 12; power++) {
            mesh m = twice(twice(lattice_mesh(2, linear, NULL), 2), 2); /* 0..1, 2..3, and two that are moved off, or taken away */
            const float far_off = powf(10, (float)power);
            for (size_t i = 16; i < 32; i++)
                for (int a = 0; a < 3; a++) m.points[i][a] = 0.001f * far_off * m.points[i][a] + (a == 1 ? 5 + far_off : 0);
            if (!part) m.view.tet_count /= 2;
            mesh_build(&m);
            for (int e = 0; e < 3; e++) {
                isogi_view view = {.width = 1, .height = 1, .fov = 1, .depth = ISOGI_DEPTH_FIRST,
                                   .eye = {eyes[e][0], eyes[e][1], eyes[e][2]}};
                float image[1][4], depth;
                for (int a = 0; a < 3; a++) view.target[a] = view.eye[a] + (a == 0 ? 1.0f : 0.0f);
                if (e == 2) view.target[0] = 0, view.target[1] = 0, view.target[2] = 1; /* the diagonal */
                CHECK(isogi_dvr_tets_render(m.built, &desc, &fog, &view, image, &depth, NULL) == ISOGI_OK, "render");
                const double exact = -expm1(-0.5 * (e == 2 ? sqrt(3) : length[e]));
                CHECK(fabs((double)image[0][3] - exact) < 1e-6 && fabsf(depth - eyes[e][3]) < 1e-6f,
                      "%s %g off, eye %d: opacity %g, not %g, from %g on", part ? "parts" : "points", (double)far_off, e,
                      (double)image[0][3], exact, (double)depth);
            }
            mesh_free(&m);
        }
}

/* The eye on points, edges and faces of the border, the ray through others: all of the box is seen from there. */
TEST(eyes_on_the_border_see_what_is_before_them) {
    const isogi_transfer_point medium = {0, {1, 1, 1}, 0.3f};
    const isogi_transfer fog = {&medium, 1, NULL, 0};
    const isogi_tet_desc desc = {.opaque = 1};
    test_random r = {6};
    int wrong = 0;
    slope[0] = slope[1] = slope[2] = 0;
    mesh m = lattice_mesh(4, linear, NULL);
    mesh_build(&m);
    for (int n = 0; n < (LONG_SUITE ? 200000 : 20000); n++) {
        isogi_view view = {.width = 1, .height = 1, .fov = 1};
        double o[3], to = 1e30;
        float d[3], image[1][4];
        int parts = 1 + n % 4, along = 0;
        for (int a = 0; a < 3; a++) {
            view.eye[a] = (float)floor(random_range(&r, 0, 3 * parts + 1)) / (float)parts;
            view.target[a] = (float)floor(random_range(&r, 0, 3 * parts + 1)) / (float)parts;
        }
        view.eye[n % 3] = n & 64 ? 3 : 0;
        isogi_view_ray(&view, 0, 0, o, d);
        for (int a = 0; a < 3; a++) {
            if (fabsf(d[a]) > 0) to = fmin(to, ((d[a] > 0 ? 3 : 0) - o[a]) / (double)d[a]);
            else along |= !(o[a] > 0 && o[a] < 3); /* within the border: all or nothing */
        }
        CHECK(isogi_dvr_tets_render(m.built, &desc, &fog, &view, image, NULL, NULL) == ISOGI_OK, "render");
        wrong += !(along && image[0][3] <= 0) && fabs((double)image[0][3] + expm1(-(double)0.3f * to)) > 1e-5;
    }
    CHECK(wrong == 0, "%d rays wrong", wrong);
    mesh_free(&m);
}

/* Two blocks whose points coincide without being the same: the seam shows nothing, and a peak that lies in it is crossed once. */
TEST(blocks_that_touch_look_as_one) {
    slope[0] = 1, slope[1] = 0.2, slope[2] = 0.1;
    mesh m = lattice_mesh(4, linear, NULL);
    m = twice(m, 3);
    for (size_t i = 0; i < m.view.point_count; i++) /* with a step in the seam, of rounding's size */
        m.values[i] = m.points[i][0] / 3 + 0.1f * m.points[i][1] + (i >= m.view.point_count / 2 ? 5e-7f : 0.0f);
    mesh_build(&m);
    test_random r = {4};
    for (int i = 0; i < 100; i++) {
        double y = random_range(&r, 0.2, 2.8), z = random_range(&r, 0.2, 2.8), change = 2;
        const double eye[3] = {i % 2 ? -5 : 12, (double)(float)y, (double)(float)z}, target[3] = {4, (double)(float)y, (double)(float)z};
        const isogi_transfer_point medium = {0, {1, 1, 1}, 0.5f};
        const isogi_peak peak = {1 + (double)0.1f * (double)(float)y + 2.5e-7, {1, 1, 1}, 0.5f}; /* within the step */
        const isogi_transfer fog = {&medium, 1, NULL, 0}, surface = {NULL, 0, &peak, 1};
        const isogi_tet_desc desc = {.space = ISOGI_DVR_DATA, .opaque = 1};
        pixel p = cast_tets(m.built, &desc, &fog, eye, target), q = cast_tets(m.built, &desc, &surface, eye, target);
        CHECK(fabs((double)p.c[3] + expm1(-0.5 * change)) < 1e-6, "ray %d: opacity %.9g, not %.9g", i, (double)p.c[3],
              -expm1(-0.5 * change));
        CHECK(fabs((double)q.c[3] - 0.5) < 1e-6, "ray %d: the peak in the seam has opacity %g", i, (double)q.c[3]);
    }
    mesh_free(&m);
}

static int calls_left, blocks_out;
static void *failing_alloc(void *user, size_t size, size_t align) {
    (void)user, (void)align;
    if (calls_left-- == 0) return NULL;
    void *p = NULL;
    blocks_out++;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void counting_release(void *user, void *p, size_t size) { (void)user, (void)size, blocks_out--, free(p); }

TEST(bad_meshes_are_refused_and_no_memory_is_survived) {
    slope[0] = 1;
    mesh m = lattice_mesh(3, linear, NULL);
    isogi_tets *tets = NULL;
    isogi_tet_mesh bad;
    const isogi_context context = {.alloc = failing_alloc, .release = counting_release, .threads = 1};
#define REFUSED(change, code) bad = m.view, bad.change; CHECK(isogi_dvr_tets_build(&tets, &bad, NULL, &serial) == code && !tets, #change)
    REFUSED(points = NULL, ISOGI_INVALID);
    REFUSED(values = NULL, ISOGI_INVALID);
    REFUSED(tets = NULL, ISOGI_INVALID);
    REFUSED(point_count = 20, ISOGI_INVALID); /* tetrahedra name points beyond */
    REFUSED(tet_count = SIZE_MAX / 2, ISOGI_TOO_LARGE);
    CHECK(isogi_dvr_tets_build(NULL, &m.view, NULL, NULL) == ISOGI_INVALID &&
              isogi_dvr_tets_build(&tets, NULL, NULL, NULL) == ISOGI_INVALID,
          "NULL");
    for (int i = 0; i < 3; i++) {
        float *at = i ? &m.points[13][i] : &m.values[7], was = *at;
        *at = i == 2 ? INFINITY : NAN;
        CHECK(isogi_dvr_tets_build(&tets, &m.view, NULL, &serial) == ISOGI_INVALID && !tets, "not finite");
        *at = was;
    }
    int failures = 0;
    for (int k = 0;; k++) {
        calls_left = k, blocks_out = 0;
        isogi_result result = isogi_dvr_tets_build(&tets, &m.view, NULL, &context);
        if (result == ISOGI_OK) break;
        CHECK(result == ISOGI_NO_MEMORY && !tets && blocks_out == 0, "%s, %d blocks left", isogi_result_string(result), blocks_out);
        failures++;
    }
    CHECK(failures == 6, "%d allocations", failures);
    float image[1][4] = {{7, 7, 7, 7}}, depth;
    const double eye[3] = {-3, 1.1, 1.2}, target[3] = {3, 1.1, 1.2};
    isogi_view view = line_of_sight(eye, target);
    int before = blocks_out;
    for (int k = 0;; k++) {
        calls_left = k;
        isogi_result result = isogi_dvr_tets_render(tets, NULL, &both, &view, image, &depth, NULL);
        CHECK(blocks_out == before, "%d blocks, not %d", blocks_out, before);
        if (result == ISOGI_OK) break;
        CHECK(result == ISOGI_NO_MEMORY && image[0][0] > 6.9f, "%s", isogi_result_string(result));
    }
    isogi_tet_desc desc = {.unit = -1};
    calls_left = 1 << 30;
    CHECK(isogi_dvr_tets_render(tets, &desc, &both, &view, image, NULL, NULL) == ISOGI_INVALID, "unit");
    desc.unit = 0, desc.opaque = 2;
    CHECK(isogi_dvr_tets_render(tets, &desc, &both, &view, image, NULL, NULL) == ISOGI_INVALID, "opaque");
    CHECK(isogi_dvr_tets_render(tets, NULL, NULL, &view, image, NULL, NULL) == ISOGI_INVALID, "no transfer function");
    isogi_dvr_tets_free(tets), isogi_dvr_tets_free(NULL);
    /* nothing at all */
    const isogi_tet_mesh empty = {NULL, NULL, 0, NULL, 0};
    CHECK(isogi_dvr_tets_build(&tets, &empty, NULL, &serial) == ISOGI_OK, "an empty mesh");
    CHECK(isogi_dvr_tets_render(tets, NULL, &both, &view, image, &depth, NULL) == ISOGI_OK && image[0][3] <= 0 && depth > 1e30f,
          "an empty picture");
    isogi_dvr_tets_free(tets);
    mesh_free(&m);
}

/* ---- real meshes ---- */

static int read_tets(const char *name, mesh *m) {
    char *path = test_data(name);
    FILE *file = path ? fopen(path, "rb") : NULL;
    int32_t head[3] = {0};
    free(path);
    if (!file) return 0;
    size_t ok = fread(head, 4, 3, file), n = (size_t)head[1], t = (size_t)head[2];
    m->points = (float(*)[3])malloc(n * 12), m->values = (float *)malloc(n * 4), m->tets = (uint32_t(*)[4])malloc(t * 16);
    ok = ok == 3 && fread(m->points, 12, n, file) == n && fread(m->values, 4, n, file) == n && fread(m->tets, 16, t, file) == t;
    fclose(file);
    m->view = (isogi_tet_mesh){(const float(*)[3])m->points, m->values, n, (const uint32_t(*)[4])m->tets, t};
    return (int)ok;
}

TEST(simulations_on_tetrahedra_are_drawn) {
    const char *names[2] = {"tets/bluntfin_density.tet", "tets/comb_density.tet"};
    for (int n = 0; n < 2; n++) {
        mesh m = {0};
        if (!read_tets(names[n], &m)) SKIP("ISOGI_DATA has no tetrahedra");
        mesh_build(&m);
        float low[3], high[3], image[400][4];
        for (int a = 0; a < 3; a++) low[a] = high[a] = m.points[0][a];
        for (size_t i = 0; i < m.view.point_count; i++)
            for (int a = 0; a < 3; a++) low[a] = fminf(low[a], m.points[i][a]), high[a] = fmaxf(high[a], m.points[i][a]);
        isogi_view view = {.width = 20, .height = 20, .fov = 40};
        for (int a = 0; a < 3; a++) view.target[a] = 0.5f * (low[a] + high[a]), view.eye[a] = view.target[a] + (a == 2 ? 30.0f : 9.0f);
        /* along every ray, values between crossings agree with brute force: opacity in both spaces */
        const isogi_transfer_point medium[] = {{0, {1, 0, 0}, 0.2f}, {1, {0, 1, 0}, 0.5f}, {3, {0, 0, 1}, 1}};
        const isogi_transfer fog = {medium, 3, NULL, 0};
        static stretch s[8000];
        double most = 0;
        int rays = 0;
        for (int space = 0; space < 2; space++) {
            const isogi_tet_desc desc = {.space = (isogi_dvr_space)space, .unit = 3, .opaque = 1};
            isogi_counters count = {0};
            CHECK(isogi_dvr_tets_render(m.built, &desc, &fog, &view, image, NULL, &count) == ISOGI_OK, "render");
            for (int i = 0; i < 400; i += LONG_SUITE ? 9 : 133) {
                double origin[3], d[3];
                float dir[3];
                long double expected[4];
                isogi_view_ray(&view, i % 20, i / 20, origin, dir);
                for (int a = 0; a < 3; a++) d[a] = (double)dir[a];
                int found = brute_stretches(&m.view, origin, d, s);
                if (!space)
                    for (int k = 0; k < found; k++) s[k].t[0] /= 3, s[k].t[1] /= 3;
                brute_integral(s, found, &fog, space, expected);
                for (int a = 0; a < 4; a++) most = fmax(most, fabs((double)image[i][a] - (double)(a < 3 ? expected[a] : 1 - expected[3])));
                rays += found > 0;
            }
        }
        printf("    %s: %zu degenerate, %zu crowded, %zu border faces; largest difference from brute force %.2g in %d rays\n", names[n],
               m.report.degenerate, m.report.crowded, m.report.border, most, rays);
        CHECK(most < 2e-4 && rays > 1, "largest difference %g in %d rays", most, rays);
        mesh_free(&m);
    }
}

TEST_MAIN("dvr_tets")
