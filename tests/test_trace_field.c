/* Tests of isogi_trace_gather_field: surfaces that are no volumes, one analytic field and one tetrahedral mesh (Wyman 2006, section 2). */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

/* ---- an analytic field: steps along the ray, then bisection ----------------------------------------------------------------------- */

typedef struct analytic {
    field *f;
    const double *parameter;
    double box, step; /* 0..box along each axis */
} analytic;

static double analytic_value(const analytic *a, const isogi_ray *r, double t) {
    double p[3];
    for (int i = 0; i < 3; i++) p[i] = r->origin[i] + t * (double)r->dir[i];
    return a->f(p, a->parameter);
}

static void analytic_intersect(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    const analytic *a = (const analytic *)user;
    for (size_t i = 0; i < count; i++) {
        const isogi_ray *r = &rays[i];
        double t = 0, end = r->tmax > 0 ? r->tmax : 1e30, before = analytic_value(a, r, 0);
        for (int k = 0; k < 3; k++) {
            double d = (double)r->dir[k];
            if (fabs(d) > 1e-9) end = fmin(end, ((d > 0 ? a->box : 0) - r->origin[k]) / d);
        }
        for (t = 0; t < end; t += a->step) {
            double next = fmin(t + a->step, end), value = analytic_value(a, r, next), low = t, high = next;
            if ((before < 0) == (value < 0)) continue;
            for (int k = 0; k < 50; k++) {
                double middle = 0.5 * (low + high);
                if ((analytic_value(a, r, middle) < 0) == (before < 0)) low = middle;
                else high = middle;
            }
            surfaces[i].t = high;
            for (int k = 0; k < 3; k++) {
                double p[3], q[3];
                for (int m = 0; m < 3; m++) p[m] = q[m] = r->origin[m] + high * (double)r->dir[m];
                p[k] += 1e-5, q[k] -= 1e-5;
                surfaces[i].normal[k] = (float)((a->f(p, a->parameter) - a->f(q, a->parameter)) / 2e-5);
            }
            break;
        }
    }
}

/* Points where rays meet the analytic surface, with normals to the low side. */
static int analytic_points(const analytic *a, int count, uint64_t seed, float (*points)[3], float (*normals)[3]) {
    test_random r = {seed};
    int found = 0;
    for (int attempt = 0; attempt < 100 * count && found < count; attempt++) {
        isogi_ray ray = {.tmax = 0};
        isogi_trace_surface s = {0};
        double d[3], length;
        random_direction(&r, d);
        for (int k = 0; k < 3; k++) ray.origin[k] = random_range(&r, 0, a->box), ray.dir[k] = (float)d[k];
        analytic_intersect((void *)(uintptr_t)a, &ray, 1, &s);
        if (!(s.t > 0)) continue;
        length = -length3((double)s.normal[0], (double)s.normal[1], (double)s.normal[2]);
        for (int k = 0; k < 3; k++)
            points[found][k] = (float)(ray.origin[k] + s.t * (double)ray.dir[k]), normals[found][k] = (float)((double)s.normal[k] / length);
        found++;
    }
    return found;
}

/* A ceiling at y = 2.1, whose normal points down. */
static void ceiling_intersect(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    (void)user;
    for (size_t i = 0; i < count; i++) {
        if (!(rays[i].dir[1] > 0)) continue;
        surfaces[i].t = (2.1 - rays[i].origin[1]) / (double)rays[i].dir[1], surfaces[i].normal[1] = -1;
        if (!(surfaces[i].t > 0)) surfaces[i].t = 0; /* tmax is not looked at: what lies beyond it is left out */
    }
}

/* Lamps just below a ceiling, closer to it than rays start off the surface: a shadow ray ends at the lamp, wherever it starts, and light is
   that at the point itself. */
TEST(shadow_rays_end_at_lamps_close_to_what_is_behind_them) {
    const float points[1][3] = {{0, 0, 0}}, up[1][3] = {{0, 2, 0}};
    for (int i = 0; i < 4; i++) {
        const isogi_light lamp = light_make(i & 1 ? ISOGI_LIGHT_SPHERE : ISOGI_LIGHT_POINT, 0.5 * i, 2, 0.3, 10, i & 1 ? 0.01 : 0);
        const isogi_trace_desc d = {.lighting = {.lights = &lamp, .light_count = 1}, .samples = 64, .offset = 0.25f};
        const double away = length3(0.5 * i, 2, 0.3), expected = 10 * 2 / (away * away * away);
        float e[1][3];
        CHECK(isogi_trace_gather_field(&d, ceiling_intersect, NULL, points, up, 1, e, NULL, NULL) == ISOGI_OK, "gather");
        CHECK(fabs((double)e[0][0] - expected) < 0.02 * expected, "lamp %d: E %g, not %g", i, (double)e[0][0], expected);
    }
}

/* Closed forms: a plane below a black sphere, E = pi (1 - (r/d)^2 cos t) (2 %, four standard errors), and the white furnace. */
TEST(analytic_sphere_and_plane) {
    double q[5] = {16, 16, 16, 4, 6}, worst = 0;
    analytic a = {ball_over_plane, q, 32, 0.25};
    isogi_trace_desc d = {.lighting.env = {.sh = white_sky, .sh_order = 1}, .samples = 1024, .offset = 1e-4f};
    float points[8][3], up[8][3], e[8][3], again[3][8][3], error[8];
    for (int i = 0; i < 8; i++) {
        points[i][0] = (float)(16 + 0.8 * i), points[i][1] = 6, points[i][2] = (float)(16 - 0.5 * i);
        up[i][0] = up[i][2] = 0, up[i][1] = 1;
    }
    CHECK(isogi_trace_gather_field(&d, analytic_intersect, &a, (const float(*)[3])points, (const float(*)[3])up, 8, e, error, NULL) ==
              ISOGI_OK,
          "plane %d", 8);
    for (int i = 0; i < 8; i++) {
        double distance = length3((double)points[i][0] - 16, 10, (double)points[i][2] - 16),
               expected = PI * (1 - 16 / (distance * distance) * 10 / distance);
        CHECK(fabs((double)e[i][0] - expected) < 0.02 * expected && error[i] < 0.03f * (float)PI, "at %d: E %.4f, expected %.4f, error %g",
              i, (double)e[i][0], expected, (double)error[i]);
    }
    d.albedo[0] = d.albedo[1] = d.albedo[2] = 1, d.bounces = 100, d.samples = 64;
    isogi_trace_gather_field(&d, analytic_intersect, &a, (const float(*)[3])points, (const float(*)[3])up, 8, e, error, NULL);
    for (int i = 0; i < 8; i++) worst = fmax(worst, fabs((double)e[i][0] - PI));
    CHECK(worst < 1e-4, "white furnace: %.6f off", worst);
    for (int k = 0; k < 3; k++) { /* 64 samples are the default */
        d.samples = k == 0 ? 64 : k == 1 ? 0 : 65, d.bounces = 0;
        isogi_trace_gather_field(&d, analytic_intersect, &a, (const float(*)[3])points, (const float(*)[3])up, 8, again[k], NULL, NULL);
    }
    CHECK(!memcmp(again[0], again[1], sizeof again[0]) && memcmp(again[0], again[2], sizeof again[0]), "E %.6f, with 64 samples %.6f",
          (double)again[1][0][0], (double)again[0][0][0]);
}

/* The gyroid itself and the voxels of it: the means differ by what voxels do to the surface (1 %) and by the noise. Every light too. */
TEST(analytic_gyroid_is_lit_like_its_volume) {
    double q[1] = {0.3}, sum[2] = {0, 0};
    analytic a = {gyroid, q, 32, 0.4};
    scene s = scene_make(33, 33, 33, NULL, gyroid, q);
    isogi_light lights[2] = {light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 1, 0.2), light_make(ISOGI_LIGHT_POINT, 16, 60, 16, 900, 0)};
    isogi_trace_desc d = desc_make(&s, 0.6f, 3, 64);
    float points[60][3], normals[60][3], e[60][3], f[60][3];
    int n = analytic_points(&a, 60, 5, points, normals);
    CHECK(n == 60, "%d points", n);
    d.lighting.lights = lights, d.lighting.light_count = 2;
    isogi_trace_gather(&d, (const float(*)[3])points, (const float(*)[3])normals, (size_t)n, e, NULL, NULL);
    d.offset = 0.25f, d.pyramid = NULL;
    isogi_trace_gather_field(&d, analytic_intersect, &a, (const float(*)[3])points, (const float(*)[3])normals, (size_t)n, f, NULL, NULL);
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++) sum[0] += (double)e[i][c], sum[1] += (double)f[i][c];
    printf("    mean E %.4f in voxels, %.4f analytic\n", sum[0] / n / 3, sum[1] / n / 3);
    CHECK(fabs(sum[0] - sum[1]) < 0.02 * sum[0], "mean E %.4f in voxels, %.4f analytic", sum[0] / n / 3, sum[1] / n / 3);
    scene_free(&s);
}

/* ---- a tetrahedral mesh ------------------------------------------------------------------------------------------------------------- */

typedef struct tets {
    int count, triangle_count;
    float (*points)[3], *values;
    int (*tet)[4];
    float (*triangle)[3][3];
} tets;

/* Marching tetrahedra: one triangle where one corner is on its own, two where two are. The field is linear in each: the isosurface is
   exactly these. */
static void tets_surface(tets *m, double isovalue) {
    m->triangle = (float(*)[3][3])malloc((size_t)m->count * 2 * sizeof *m->triangle);
    m->triangle_count = 0;
    for (int i = 0; i < m->count; i++) {
        int in[4], out[4], n = 0, k = 0;
        float cut[4][3];
        for (int c = 0; c < 4; c++) {
            if ((double)m->values[m->tet[i][c]] >= isovalue) in[n++] = m->tet[i][c];
            else out[k++] = m->tet[i][c];
        }
        if (!n || !k) continue;
        for (int e = 0; e < n * k; e++) { /* two and two: 0-0, 1-0, 1-1, 0-1, around the quadrilateral */
            int a = n == 2 && k == 2 ? in[e == 1 || e == 2] : in[e % n], b = n == 2 && k == 2 ? out[e / 2] : out[e / n];
            double t = (isovalue - (double)m->values[a]) / ((double)m->values[b] - (double)m->values[a]);
            for (int c = 0; c < 3; c++) cut[e][c] = (float)((1 - t) * (double)m->points[a][c] + t * (double)m->points[b][c]);
        }
        memcpy(m->triangle[m->triangle_count++], cut, 3 * sizeof cut[0]);
        if (n * k < 4) continue;
        memcpy(m->triangle[m->triangle_count][0], cut[0], sizeof cut[0]),
            memcpy(m->triangle[m->triangle_count++][1], cut[2], 2 * sizeof cut[0]);
    }
}

/* Every triangle, one after the other (Moeller and Trumbore 1997): slow, and obviously right. */
static void tets_intersect(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    const tets *m = (const tets *)user;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < m->triangle_count; k++) {
            double u[3], v[3], o[3], p[3], w[3], n[3], det, b, c, t;
            for (int a = 0; a < 3; a++) {
                u[a] = (double)m->triangle[k][1][a] - (double)m->triangle[k][0][a],
                v[a] = (double)m->triangle[k][2][a] - (double)m->triangle[k][0][a];
                o[a] = rays[i].origin[a] - (double)m->triangle[k][0][a], w[a] = (double)rays[i].dir[a];
            }
            for (int a = 0; a < 3; a++) n[a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
            for (int a = 0; a < 3; a++) p[a] = o[(a + 1) % 3] * w[(a + 2) % 3] - o[(a + 2) % 3] * w[(a + 1) % 3];
            det = -(n[0] * w[0] + n[1] * w[1] + n[2] * w[2]);
            if (fabs(det) < 1e-300) continue;
            t = (n[0] * o[0] + n[1] * o[1] + n[2] * o[2]) / det;
            b = (v[0] * p[0] + v[1] * p[1] + v[2] * p[2]) / det, c = -(u[0] * p[0] + u[1] * p[1] + u[2] * p[2]) / det;
            if (b < 0 || c < 0 || b + c > 1 || !(t > 0) || (rays[i].tmax > 0 && t > rays[i].tmax) ||
                (surfaces[i].t > 0 && t >= surfaces[i].t))
                continue;
            surfaces[i].t = t;
            for (int a = 0; a < 3; a++) surfaces[i].normal[a] = (float)(n[a] / length3(n[0], n[1], n[2]));
        }
}

/* Cubes in six tetrahedra each, about their main diagonal; points shaken by a fifth of a cube, so that nothing is regular. */
static tets tets_make(int n, field *f, const double *parameter) {
    static const int order[6][2] = {{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}};
    tets m = {0};
    test_random r = {17};
    int points = n * n * n, cubes = n - 1;
    m.points = (float(*)[3])malloc((size_t)points * sizeof *m.points), m.values = (float *)malloc((size_t)points * sizeof(float));
    m.tet = (int(*)[4])malloc((size_t)(6 * cubes * cubes * cubes) * sizeof *m.tet);
    for (int i = 0; i < points; i++) {
        double p[3] = {i % n, i / n % n, i / n / n};
        for (int a = 0; a < 3; a++) p[a] += random_range(&r, -0.2, 0.2), m.points[i][a] = (float)p[a];
        m.values[i] = (float)f(p, parameter);
    }
    for (int i = 0; i < cubes * cubes * cubes; i++)
        for (int k = 0; k < 6; k++, m.count++)
            for (int c = 0; c < 4; c++) {
                int corner = c == 0 ? 0 : c == 3 ? 7 : order[k][c - 1];
                m.tet[m.count][c] =
                    (i % cubes + (corner & 1)) + n * ((i / cubes % cubes + (corner >> 1 & 1)) + n * (i / cubes / cubes + (corner >> 2)));
            }
    return m;
}

static void tets_free(tets *m) { free(m->points), free(m->values), free(m->tet), free(m->triangle); }

/* Centres of triangles, with normals to the low side: found by the gradient of the field that was sampled. */
static int tets_points(const tets *m, field *f, const double *parameter, int count, float (*points)[3], float (*normals)[3]) {
    int found = 0, stride = m->triangle_count / count;
    for (int k = 0; k < m->triangle_count && found < count; k += stride ? stride : 1) {
        double u[3], v[3], n[3], p[3], q[3], size;
        for (int a = 0; a < 3; a++) {
            u[a] = (double)m->triangle[k][1][a] - (double)m->triangle[k][0][a],
            v[a] = (double)m->triangle[k][2][a] - (double)m->triangle[k][0][a];
            points[found][a] = (m->triangle[k][0][a] + m->triangle[k][1][a] + m->triangle[k][2][a]) / 3;
        }
        for (int a = 0; a < 3; a++) n[a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
        size = length3(n[0], n[1], n[2]);
        if (!(size > 1e-3)) continue;
        for (int a = 0; a < 3; a++)
            p[a] = (double)points[found][a] + 0.3 * n[a] / size, q[a] = (double)points[found][a] - 0.3 * n[a] / size;
        if (f(p, parameter) > f(q, parameter)) size = -size;
        for (int a = 0; a < 3; a++) normals[found][a] = (float)(n[a] / size);
        found++;
    }
    return found;
}

/* The isosurface of a tetrahedral ball is nearly convex: E = pi to the sky, less what its dents take (3 %). A pit in a mesh: with R = 0.5
   the
   mean is that of the closed form for the opening that the black run measures (3 %); white, everything is pi. */
TEST(tetrahedral_mesh) {
    double q_ball[4] = {6, 6, 6, 4}, q_pit[5] = {7, 6, 7, 7, 4}, mean[3] = {0, 0, 0};
    tets m = tets_make(13, ball, q_ball);
    isogi_trace_desc d = {.lighting.env = {.sh = white_sky, .sh_order = 1}, .samples = 32, .offset = 1e-4f};
    float points[40][3], normals[40][3], e[40][3];
    tets_surface(&m, 0);
    int n = tets_points(&m, ball, q_ball, 40, points, normals);
    CHECK(isogi_trace_gather_field(&d, tets_intersect, &m, (const float(*)[3])points, (const float(*)[3])normals, (size_t)n, e, NULL,
                                   NULL) == ISOGI_OK,
          "%d points", n);
    for (int i = 0; i < n; i++) mean[0] += (double)e[i][0] / n;
    CHECK(n > 20 && fabs(mean[0] - PI) < 0.03 * PI, "ball of %d triangles: mean E %.4f", m.triangle_count, mean[0]);
    tets_free(&m);
    m = tets_make(15, pit, q_pit);
    tets_surface(&m, 0);
    n = tets_points(&m, pit, q_pit, 40, points, normals);
    int inside = 0;
    for (int i = 0; i < n; i++) /* of the wall, well below the rim */
        if (points[i][1] < 5 && length3((double)points[i][0] - 7, (double)points[i][1] - 6, (double)points[i][2] - 7) < 4.4)
            memcpy(points[inside], points[i], 12), memcpy(normals[inside++], normals[i], 12);
    CHECK(inside > 8, "%d points in the pit", inside);
    for (int k = 0; k < 3; k++) {
        d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.5f * (float)k, d.bounces = 30, mean[k] = 0, d.samples = 128;
        isogi_trace_gather_field(&d, tets_intersect, &m, (const float(*)[3])points, (const float(*)[3])normals, (size_t)inside, e, NULL,
                                 NULL);
        for (int i = 0; i < inside; i++) mean[k] += (double)e[i][0] / inside;
    }
    double opening = mean[0] / PI;
    printf("    pit in %d tetrahedra: opening %.3f, E %.4f with albedo 0.5, closed form %.4f\n", m.count, opening, mean[1],
           PI * opening / (1 - 0.5 * (1 - opening)));
    CHECK(fabs(mean[1] - PI * opening / (1 - 0.5 * (1 - opening))) < 0.03 * mean[1], "albedo 0.5: E %.4f", mean[1]);
    CHECK(fabs(mean[2] - PI) < 2e-3 * PI, "white furnace: E %.5f", mean[2]);
    tets_free(&m);
}

/* ---- arguments --------------------------------------------------------------------------------------------------------------- */

/* A function that answers nonsense must not break anything: NaN normals, negative t, t beyond tmax, wild colours. */
static void nonsense(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    test_random *r = (test_random *)user;
    test_random mine = {0};
    memcpy(&mine.state, &rays[0].origin[0], sizeof mine.state), mine.state ^= r->state;
    for (size_t i = 0; i < count; i++) {
        const float odd[6] = {(float)nan_value(), -1, 0, 1e30f, 5, 0.5f};
        surfaces[i].t = (double)odd[random_bits(&mine) % 6];
        for (int a = 0; a < 3; a++)
            surfaces[i].normal[a] = odd[random_bits(&mine) % 6], surfaces[i].albedo[a] = odd[random_bits(&mine) % 6],
            surfaces[i].emission[a] = odd[random_bits(&mine) % 3];
    }
}

static void empty(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    (void)user, (void)rays, (void)count, (void)surfaces;
}
/* A ball that glows, from inside: radius 9, at the origin. */
static void inside_ball(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    (void)user;
    for (size_t i = 0; i < count; i++) {
        const isogi_ray *r = &rays[i];
        double b = 0, c = -81;
        for (int k = 0; k < 3; k++) b += r->origin[k] * (double)r->dir[k], c += r->origin[k] * r->origin[k];
        surfaces[i].t = sqrt(b * b - c) - b;
        for (int k = 0; k < 3; k++) {
            surfaces[i].normal[k] = (float)((r->origin[k] + surfaces[i].t * (double)r->dir[k]) / 9);
            surfaces[i].emission[k] = (float)(k + 1);
        }
    }
}

/* 64 points of it, with normals to the inside. */
static void inside_points(uint64_t seed, float (*points)[3], float (*normals)[3]) {
    test_random random = {seed};
    for (int i = 0; i < 64; i++) {
        double d[3];
        random_direction(&random, d);
        for (int k = 0; k < 3; k++) points[i][k] = (float)(9 * d[k]), normals[i][k] = (float)-d[k];
    }
}

/* Closed form: with all reflections pi / (1 - albedo) of what glows. Paths end by chance from the third reflection on; 64 * 1024 of them,
   four standard errors are 1 % at albedo 0.8. */
TEST(all_reflections_in_a_ball_that_glows) {
    float points[64][3], normals[64][3], e[64][3];
    inside_points(9, points, normals);
    for (int k = 0; k < 3; k++) {
        static const float albedo[3] = {0, 0.5f, 0.8f};
        isogi_trace_desc d = {.albedo = {albedo[k], albedo[k], albedo[k]}, .bounces = -1, .samples = 1024, .offset = 1e-3f};
        double mean[3] = {0, 0, 0}, expected = PI / (1 - (double)albedo[k]);
        CHECK(isogi_trace_gather_field(&d, inside_ball, NULL, (const float(*)[3])points, (const float(*)[3])normals, 64, e, NULL, NULL) ==
                  ISOGI_OK, "albedo %g", (double)albedo[k]);
        for (int i = 0; i < 64; i++)
            for (int c = 0; c < 3; c++) mean[c] += (double)e[i][c] / 64;
        for (int c = 0; c < 3; c++)
            CHECK(fabs(mean[c] - (c + 1) * expected) < 0.01 * (c + 1) * expected, "albedo %g, channel %d: E %.4f, expected %.4f",
                  (double)albedo[k], c, mean[c], (c + 1) * expected);
    }
}

static void dark_ball(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    inside_ball(user, rays, count, surfaces);
    for (size_t i = 0; i < count; i++) memset(surfaces[i].emission, 0, sizeof surfaces[i].emission);
}

/* What no_shadows leaves out is the way from lights and the environment, not that between surfaces. Closed form, within a ball of albedo R:
   light that arrives directly, as in the open (analytic for the sun and the sky's first order, by a ball that nothing is in the way of for
   an image), and by reflections its mean over the ball times R + R^2. Of a distant light the mean is a quarter of its irradiance over the
   mean cosine of its disk. The noise of a mean is below 1 %. Only the three rays of each path are traced, none to lights. */
static void counted_ball(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    *(size_t *)user += count;
    dark_ball(user, rays, count, surfaces);
}
TEST(without_shadows_a_ball_is_lit_from_outside) {
    enum { W = 16, H = 8 };
    static float image[H][W][3];
    const isogi_light sun[2] = {light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 2, 2, 0), light_make(ISOGI_LIGHT_DIRECTIONAL, 3, -2, 1, 3, 0.3)};
    const isogi_context serial = {.threads = 1};
    const double albedo = 0.5, share = albedo + albedo * albedo;
    float points[64][3], normals[64][3], e[64][3], open[64][3];
    inside_points(12, points, normals);
    for (int i = 0; i < W * H; i++)
        for (int c = 0; c < 3; c++) image[i / W][i % W][c] = i == 2 * W + 5 ? 40 : 1;
    for (int kind = 0; kind < 4; kind++) {
        isogi_trace_desc d = {.bounces = 2, .samples = 256, .offset = 1e-3f, .albedo = {0.5f, 0.5f, 0.5f}};
        double mean = PI, sum[2] = {0, 0}, off = 0;
        float integral[3];
        size_t rays = 0;
        if (kind == 0) d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1;
        if (kind == 1 || kind == 2) d.lighting.lights = sun + kind - 1, d.lighting.light_count = 1,
                mean = kind == 1 ? 0.5 : 0.75 / (0.5 + 0.5 * cos(0.3));
        if (kind == 3) {
            d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = W, d.lighting.env.height = H;
            isogi_sh_project(integral, 1, &d.lighting, NULL), mean = (double)integral[0] * sqrt(4 * PI) / 4;
        }
        isogi_trace_gather_field(&d, dark_ball, NULL, (const float(*)[3])points, (const float(*)[3])normals, 64, e, NULL, NULL);
        for (int i = 0; i < 64; i++) CHECK(fabs((double)e[i][0]) < 1e-9, "kind %d: E %g in the dark", kind, (double)e[i][0]);
        isogi_trace_gather_field(&d, empty, NULL, (const float(*)[3])points, (const float(*)[3])normals, 64, open, NULL, NULL);
        d.no_shadows = 1;
        isogi_trace_gather_field(&d, counted_ball, &rays, (const float(*)[3])points, (const float(*)[3])normals, 64, e, NULL, &serial);
        CHECK(rays == 64 * 256 * 3, "kind %d: %d rays", kind, (int)rays);
        for (int i = 0; i < 64; i++) {
            double expected = (double)open[i][0];
            if (kind == 0) expected = PI;
            if (kind == 1) /* 2 along (1, 2, 2) / 3 */
                expected = fmax(0, 2.0 / 3 * ((double)normals[i][0] + 2 * (double)normals[i][1] + 2 * (double)normals[i][2]));
            expected += share * mean;
            sum[0] += (double)e[i][0], sum[1] += expected, off = fmax(off, fabs((double)e[i][0] - expected) / (mean * (1 + share)));
        }
        CHECK(fabs(sum[0] / sum[1] - 1) < 0.01 && off < 0.1, "kind %d: mean %.4f, not %.4f; a point is %.4f off", kind, sum[0] / 64,
              sum[1] / 64, off);
    }
}

/* However far off the surface rays start, a lamp within the ball brings no more than it sends out. */
TEST(lamps_are_as_far_away_as_from_the_surface) {
    float points[64][3], normals[64][3], e[2][64][3];
    double mean[2] = {0, 0};
    const isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 3, 1, 0, 100, 0);
    inside_points(10, points, normals);
    for (int k = 0; k < 2; k++) {
        const isogi_trace_desc d = {.albedo = {0.5f, 0.5f, 0.5f}, .bounces = -1, .samples = 256, .offset = k ? 2 : 1e-3f,
                                    .lighting = {.lights = &lamp, .light_count = 1}};
        CHECK(isogi_trace_gather_field(&d, dark_ball, NULL, (const float(*)[3])points, (const float(*)[3])normals, 64, e[k], NULL, NULL) ==
                  ISOGI_OK, "offset %d", k);
        for (int i = 0; i < 64; i++) mean[k] += (double)e[k][i][0] / 64;
    }
    CHECK(fabs(mean[1] / mean[0] - 1) < 0.02, "%g from 2 units off, %g on the surface", mean[1], mean[0]);
}

/* One rule for errors: a ball that sees nothing but one sky has the same error from its voxels and as a field, and none is certain. */
TEST(errors_where_all_samples_agree) {
    double q[4] = {15.5, 15.5, 15.5, 9};
    float point[2][3] = {{24.5f, 15.5f, 15.5f}, {15.5f, 24.5f, 15.5f}}, normal[2][3] = {{1, 0, 0}, {0, 1, 0}}, e[2][3], error[2][2];
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 1, 0, 0.5, 0);
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    for (int samples = 4; samples < 1000; samples *= 8)
        for (int lights = 0; lights < 2; lights++) {
            isogi_trace_desc d = desc_make(&s, 0.5f, 2, samples);
            d.lighting.lights = &sun, d.lighting.light_count = (size_t)lights;
            isogi_trace_gather(&d, (const float(*)[3])point, NULL, 2, e, error[0], NULL);
            isogi_trace_gather_field(&d, empty, NULL, (const float(*)[3])point, (const float(*)[3])normal, 2, e, error[1], NULL);
            for (int i = 0; i < 2; i++)
                CHECK(error[1][i] > 0.3f / (float)samples && fabs((double)error[1][i] / (double)error[0][i] - 1) < (lights ? 0.3 : 0.01),
                      "%d samples: %g, of voxels %g", samples, (double)error[1][i], (double)error[0][i]);
        }
    scene_free(&s);
}

TEST(nonsense_is_survived_and_bad_arguments_refused) {
    test_random r = {5};
    isogi_trace_desc d = {.lighting.env = {.sh = white_sky, .sh_order = 1}, .samples = 16, .bounces = 5, .albedo = {0.5f, 0.5f, 0.5f}};
    float points[20][3], normals[20][3], e[20][3], error[20];
    for (int i = 0; i < 60; i++)
        points[i / 3][i % 3] = (float)random_range(&r, -3, 3), normals[i / 3][i % 3] = i < 3 ? 0 : (float)random_range(&r, -1, 1);
    points[1][0] = (float)nan_value();
    CHECK(isogi_trace_gather_field(&d, nonsense, &r, (const float(*)[3])points, (const float(*)[3])normals, 20, e, error, NULL) == ISOGI_OK,
          "points %d", 20);
    for (int i = 0; i < 20; i++) CHECK(e[i][0] >= 0 && e[i][0] < 1e9f && (i > 1 || error[i] > 1e30f), "E %g", (double)e[i][0]);
    CHECK(isogi_trace_gather_field(&d, NULL, &r, (const float(*)[3])points, (const float(*)[3])normals, 20, e, error, NULL) ==
              ISOGI_INVALID,
          "no function, %d", 0);
    CHECK(isogi_trace_gather_field(&d, nonsense, &r, (const float(*)[3])points, NULL, 20, e, error, NULL) == ISOGI_INVALID,
          "no normals, %d", 0);
    CHECK(isogi_trace_gather_field(NULL, nonsense, &r, (const float(*)[3])points, (const float(*)[3])normals, 20, e, error, NULL) ==
              ISOGI_INVALID,
          "no description, %d", 0);
    d.offset = -1;
    CHECK(isogi_trace_gather_field(&d, nonsense, &r, (const float(*)[3])points, (const float(*)[3])normals, 20, e, error, NULL) ==
              ISOGI_INVALID,
          "offset %d", -1);
}

/* The k-th allocation fails, for every k, those of an environment's image among them: nothing is written, nothing leaks. */
TEST(every_allocation_may_fail) {
    static float image[8][16][3];
    double q[5] = {16, 16, 16, 4, 6};
    analytic a = {ball_over_plane, q, 32, 0.25};
    float points[8][3], normals[8][3];
    int done = 0, n = analytic_points(&a, 8, 6, points, normals);
    for (int i = 0; i < 128; i++) image[i / 16][i % 16][0] = image[i / 16][i % 16][1] = image[i / 16][i % 16][2] = i == 37 ? 900 : 1;
    for (long k = 0; !done && k < 1000; k++) {
        scarce memory = {k, 0};
        isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
        isogi_trace_desc d = {.lighting.env = {.rgb = &image[0][0][0], .width = 16, .height = 8},
            .samples = 4, .bounces = 1, .offset = 1e-4f};
        float e[8][3], error[8], before[8][3];
        memset(e, 0x5a, sizeof e), memset(error, 0x5a, sizeof error), memcpy(before, e, sizeof e);
        isogi_result result = isogi_trace_gather_field(&d, analytic_intersect, &a, (const float(*)[3])points, (const float(*)[3])normals,
                                                       (size_t)n, e, error, &context);
        done = result == ISOGI_OK;
        if (done) CHECK(n == 8 && k > 1 && memory.left >= 0 && e[0][0] > 0.1f, "%ld allocations, E %g", k, (double)e[0][0]);
        else CHECK(result == ISOGI_NO_MEMORY && !memcmp(e, before, sizeof e) && !memcmp(error, before, sizeof error),
                   "allocation %ld: %s, or something was written", k, isogi_result_string(result));
        CHECK(memory.blocks == 0, "allocation %ld: %ld blocks leak", k, memory.blocks);
    }
    CHECK(done, "there are more allocations, %d", done);
}

TEST_MAIN("trace_field")
