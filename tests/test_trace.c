/* Tests of isogi_trace.h. Scenes are small analytic fields; isovalue 0 unless said otherwise; radiance 1 = SH coefficient sqrt(4 pi).
   FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include "test.h"
#include "trace_scenes.h"

/* ---- closed forms -------------------------------------------------------------------------------------------------------- */

/* Nothing occludes a convex surface, so every sample sees the sky: only trilinear bumps can take any of it, 1 % allowed. */
TEST(convex_surface_under_uniform_sky_is_pi) {
    double q[4] = {15.5, 15.5, 15.5, 9.3}, worst = 0;
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, 16);
    float points[300][3], e[300][3];
    int n = surface_points(&s, 0, 300, 1, points);
    CHECK(n == 300, "%d points", n);
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
    for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)e[i][0] - PI));
    CHECK(worst < 0.01 * PI, "texture: largest error of E %g", worst);
    (void)mean_irradiance(&d, (const float(*)[3])points, n, &worst);
    CHECK(worst < 0.01 * PI, "points: largest deviation of E %g", worst);
    scene_free(&s);
}

/* White surfaces under a white sky vanish: whatever leaves a path behind (absorption, leaks, lost directions) shows as a deficit.
   64 reflections leave (1-F)^65 of a cavity with F = 0.2: 5e-7. */
TEST(white_furnace) {
    double q_ball[4] = {15.5, 15.5, 15.5, 9.3}, q_torus[5] = {15.5, 15.5, 15.5, 9, 4}, q_gyroid[1] = {0.35};
    double q_pit[5] = {16, 15, 16, 22.3, 12};
    field *f[6] = {ball, torus, gyroid, pit, rough_pit, rough_ball};
    const double *q[6] = {q_ball, q_torus, q_gyroid, q_pit, q_pit, q_ball};
    isogi_light domes[2] = {{.vector = {0, 1, 0}, .rgb = {(float)PI, (float)PI, (float)PI}, .radius = (float)(PI / 2)},
                            {.vector = {0, -1, 0}, .rgb = {(float)PI, (float)PI, (float)PI}, .radius = (float)(PI / 2)}};
    const char *name[6] = {"ball", "torus", "gyroid", "pit", "rough pit", "rough ball"};
    for (int i = QUICK_SUITE; i < 6; i += 1 + QUICK_SUITE)
        for (int kind = 0; kind < 2; kind++) {
            scene s = scene_make(32, 32, 32, NULL, f[i], q[i]);
            isogi_trace_desc d = desc_make(&s, 1, 64, 64);
            float points[64][3];
            double worst, mean;
            int n = surface_points(&s, 0, LONG_SUITE ? 64 : 16, 2, points);
            d.normals = kind ? ISOGI_NORMAL_TRILINEAR : ISOGI_NORMAL_SMOOTH;
            mean = mean_irradiance(&d, (const float(*)[3])points, n, &worst);
            CHECK(fabs(mean - PI) < 0.002 * PI && worst < 0.01 * PI, "%s, normals %d: mean E %.5f, largest deviation %.5f", name[i], kind,
                  mean, worst);
            if (kind) {
                scene_free(&s);
                continue;
            }
            /* The same sky as two lights that fill it: now all light comes by shadow rays, whose noise is larger: 0.3 %
               on rough surfaces, where paths are long. */
            d.lighting.lights = domes, d.lighting.light_count = 2, d.lighting.env.sh = NULL, d.lighting.env.sh_order = 0,
            d.samples = i < 4 ? 2048 : 4096;
            mean = mean_irradiance(&d, (const float(*)[3])points, n, NULL);
            CHECK(fabs(mean - PI) < 0.012 * PI, "%s, by shadow rays: mean E %.5f", name[i], mean);
            d = desc_make(&s, 1, 64, 64);
            d.offset = -1; /* paths that begin on the surface, some of them into matter */
            mean = mean_irradiance(&d, (const float(*)[3])points, n, &worst);
            CHECK(fabs(mean - PI) < 0.002 * PI && worst < 0.01 * PI, "%s, no offset: mean E %.5f, largest deviation %.5f", name[i], mean,
                  worst);
            d.bounces = -1; /* Russian roulette weighs each path by 1 / 0.98 per reflection: noise, mean unchanged */
            mean = mean_irradiance(&d, (const float(*)[3])points, n, &worst);
            CHECK(fabs(mean - PI) < 0.01 * PI, "%s, roulette: mean E %.5f, largest deviation %.5f", name[i], mean, worst);
            scene_free(&s);
        }
}

/* E = pi F / (1 - R (1 - F)), the same everywhere in the pit; F, the opening's share of the sphere, from the run without reflections
   (voxels erode the lip: 2.5 %), the dependence on R within 2 %. Rays above the rim see sky alone. */
TEST(cavity_with_opening_follows_its_closed_form) {
    int n = LONG_SUITE ? 128 : 64, count = 200;
    double r = 0.4 * n, c = n / 2.0, q[5] = {c, 0.75 * n, c, 0.75 * n, r}, opening;
    scene s = scene_make(n, n, n, NULL, pit, q);
    float points[200][3];
    isogi_trace_desc d = desc_make(&s, 0, 0, 256);
    pit_points(&s, q, count, points);
    opening = mean_irradiance(&d, (const float(*)[3])points, count, NULL) / PI;
    CHECK(fabs(opening - 0.5) < 0.025 * 0.5, "F %.4f, one half expected", opening);
    for (int i = 0; i < 3; i++) {
        double albedo[3] = {0, 0.5, 0.9}, e, expected = PI * opening / (1 - albedo[i] * (1 - opening));
        d.albedo[0] = d.albedo[1] = d.albedo[2] = (float)albedo[i], d.bounces = -1;
        e = mean_irradiance(&d, (const float(*)[3])points, count, NULL);
        CHECK(fabs(e - expected) < 0.02 * expected, "R %g: E %.4f, expected %.4f", albedo[i], e, expected);
        d.bounces = 1; /* one reflection: pi F (1 + R (1 - F)) */
        e = mean_irradiance(&d, (const float(*)[3])points, count, NULL), expected = PI * opening * (1 + albedo[i] * (1 - opening));
        CHECK(fabs(e - expected) < 0.02 * expected, "R %g, one bounce: E %.4f, expected %.4f", albedo[i], e, expected);
    }
    scene_free(&s);
}

/* Sky minus what the sphere hides: pi (1 - (r/d)^2 cos t). 1024 samples: standard error 0.5 % at most; tolerance four of these. */
TEST(plane_below_black_sphere) {
    double q[5] = {32, 30, 32, 8, 12.4};
    scene s = scene_make(64, 64, 64, NULL, ball_over_plane, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, 1024);
    for (int i = 0; i < 8; i++) {
        float point[1][3] = {{(float)(32 + 3.1 * i), 12.4f, (float)(32 - 1.7 * i)}}, e[1][3];
        double h = 30 - 12.4, distance = length3((double)point[0][0] - 32, h, (double)point[0][2] - 32);
        double expected = PI * (1 - 64 / (distance * distance) * h / distance);
        isogi_trace_gather(&d, (const float(*)[3])point, NULL, 1, e, NULL, NULL);
        CHECK(fabs((double)e[0][0] - expected) < 0.02 * expected, "at %d: E %.4f, expected %.4f", i, (double)e[0][0], expected);
    }
    scene_free(&s);
}

/* Bounce 0 under a constant sky is vicinity shading (Stewart 2003): the same integral by uniform directions and independent numbers,
   from the same starts, a quarter voxel above the surface. Each side has a standard error below 0.7 % of pi: 3 %. */
TEST(no_bounce_under_constant_sky_is_vicinity_shading) {
    double q[1] = {0.3};
    scene s = scene_make(40, 40, 40, NULL, gyroid, q);
    isogi_trace_desc d = desc_make(&s, 0.7f, 0, 2048);
    float points[20][3], e[20][3], normals[20][3];
    int n = surface_points(&s, 0, 20, 4, points);
    test_random r = {5};
    isogi_vol_sample_smooth(s.pyramid, (const float(*)[3])points, (size_t)n, NULL, normals);
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, NULL, NULL);
    for (int i = 0; i < n; i++) {
        double sum = 0, isovalue, length = length3((double)normals[i][0], (double)normals[i][1], (double)normals[i][2]);
        float value;
        int count = 8192;
        isogi_vol_sample(s.pyramid, (const float(*)[3])points[i], 1, &value, NULL);
        isovalue = (double)value;
        for (int k = 0; k < count; k++) {
            isogi_ray ray;
            uint8_t blocked = 0;
            double w[3], cosine = 0;
            random_direction(&r, w);
            memset(&ray, 0, sizeof ray);
            for (int a = 0; a < 3; a++) {
                double normal = -(double)normals[i][a] / length;
                cosine += normal * w[a];
                ray.origin[a] = (double)points[i][a] + 0.25 * normal, ray.dir[a] = (float)w[a];
            }
            if (cosine <= 0) continue;
            ray.isovalue = isovalue;
            isogi_vol_occluded(s.pyramid, &ray, 1, &blocked, NULL);
            if (!blocked) sum += 4 * PI * cosine / count;
        }
        CHECK(fabs((double)e[i][1] - sum) < 0.03 * PI, "point %d: E %.4f, brute force %.4f", i, (double)e[i][1], sum);
    }
    scene_free(&s);
}

/* ---- lights -------------------------------------------------------------------------------------------------------------- */

/* Lights without extent take one ray and no random number: exact to float rounding. */
TEST(directional_and_point_light_match_analytic_values) {
    double q[5] = {16, 20, 16, 4, 8};
    scene s = scene_make(33, 33, 33, NULL, ball_over_plane, q);
    float open[3] = {6, 8, 7}, hidden[3] = {16, 8, 16};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0.3, 2, 0.5, 1.5, 0), above = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, 1, 0, 1, 0);
    isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 9, 14, 3, 40, 0), behind = light_make(ISOGI_LIGHT_POINT, 16, 27, 16, 40, 0);
    isogi_light below = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, -1, 0, 1, 0), near_lamp = light_make(ISOGI_LIGHT_POINT, 16, 12, 16, 40, 0);
    double d = length3(3, 6, 4), e;
    e = lit(&s, &sun, open, 0, 4);
    CHECK(fabs(e - 1.5 * 2 / length3(0.3, 2, 0.5)) < 1e-5, "sun E %.7f", e);
    e = lit(&s, &sun, open, 2, 4);
    CHECK(fabs(e - 4.5 * 2 / length3(0.3, 2, 0.5)) < 1e-5, "sun E %.7f, third channel", e);
    e = lit(&s, &lamp, open, 1, 4);
    CHECK(fabs(e - 80 * 6 / (d * d * d)) < 1e-5, "lamp E %.7f, expected %.7f", e, 80 * 6 / (d * d * d));
    CHECK(lit(&s, &above, hidden, 0, 4) <= 0, "sun behind the sphere %g", lit(&s, &above, hidden, 0, 4));
    CHECK(lit(&s, &behind, hidden, 0, 4) <= 0, "lamp behind the sphere %g", lit(&s, &behind, hidden, 0, 4));
    CHECK(lit(&s, &below, open, 0, 4) <= 0, "sun below the ground %g", lit(&s, &below, open, 0, 4));
    e = lit(&s, &near_lamp, hidden, 0, 4);
    CHECK(fabs(e - 40.0 / 16) < 1e-5, "lamp nearer than the sphere: E %.7f", e);
    scene_free(&s);
}

/* A disc of the sky brings rgb (sin^2 of its radius times cos, over sin^2: the same) and a whole sphere above the horizon brings
   I cos / d^2 exactly, as a point does; 4096 samples of a cosine that varies by a third: 0.3 %. Half hidden by a straight edge: half. */
TEST(lights_with_a_size_match_analytic_values) {
    double q[1] = {8};
    scene s = scene_make(33, 33, 33, NULL, ground, q);
    float p[3] = {16, 8, 16};
    isogi_light disc = light_make(ISOGI_LIGHT_DIRECTIONAL, 0.6, 0.8, 0, 1, 0.4),
                ball_light = light_make(ISOGI_LIGHT_SPHERE, 20, 14, 18, 50, 3);
    isogi_light dome = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, 1, 0, 1, PI / 2),
                rising = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 0, 0, 1, 0.1);
    double d = length3(4, 6, 2), e;
    e = lit(&s, &disc, p, 0, 4096);
    CHECK(fabs(e - 0.8) < 0.003 * 0.8 * 3, "disc E %.5f, expected 0.8", e);
    e = lit(&s, &ball_light, p, 0, 4096);
    CHECK(fabs(e - 50 * 6 / (d * d * d)) < 0.01 * e, "sphere E %.5f, expected %.5f", e, 50 * 6 / (d * d * d));
    ball_light.vector[0] = 15, ball_light.vector[1] = 9; /* about the point: radiance I / (pi r^2) from everywhere */
    e = lit(&s, &ball_light, p, 0, 65536); /* half of them below the ground: 0.5 % of noise */
    CHECK(fabs(e - 50.0 / 9) < 0.02 * e, "within the sphere E %.5f, expected %.5f", e, 50.0 / 9);
    e = lit(&s, &dome, p, 0, 4096);
    CHECK(fabs(e - 1) < 0.03, "hemisphere of light E %.5f, expected 1", e);
    /* upper half of a small disc on the horizon: 1/(pi a^2) * integral of the elevation = 2 a / (3 pi) */
    e = lit(&s, &rising, p, 0, 4096);
    CHECK(fabs(e - 2 * 0.1 / (3 * PI)) < 0.05 * e, "rising sun E %.6f, expected %.6f", e, 2 * 0.1 / (3 * PI));
    scene_free(&s);
}

/* Light that arrives by reflection alone: a lamp over a white pit; energy that a path picks up by shadow rays at its vertices must
   equal the same found through a sky that is bright only in a disc (relative 3 %, both noisy at 1 %). */
static void shadow_rays_agree(field *f, const char *name) {
    double q[5] = {16, 15, 16, 20, 9};
    int width = 64, height = 32;
    float *image = (float *)calloc((size_t)(3 * width * height), sizeof(float)), points[40][3];
    scene s = scene_make(33, 33, 33, NULL, f, q);
    isogi_trace_desc d = desc_make(&s, 0.8f, -1, 512);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 0, 1, 0, PI * pow(sin(0.3), 2), 0.3);
    int n = surface_points(&s, 0, 40, 6, points);
    double by_light, by_image, direct;
    memset(&d.lighting, 0, sizeof d.lighting);
    d.lighting.lights = &sun, d.lighting.light_count = 1;
    by_light = mean_irradiance(&d, (const float(*)[3])points, n, NULL) / 2; /* green is twice red */
    d.bounces = 0;
    direct = mean_irradiance(&d, (const float(*)[3])points, n, NULL) / 2;
    d.bounces = -1;
    CHECK(by_light > 1.2 * direct, "%s: with reflections %.4f, without %.4f", name, by_light, direct);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) /* bilinear edges make the disc as large as 0.3 rad on average */
            for (int c = 0; c < 3; c++) image[3 * (x + width * y) + c] = (y + 1) * PI / height <= 0.3 ? 1 : 0;
    memset(&d.lighting, 0, sizeof d.lighting);
    d.lighting.env.rgb = image, d.lighting.env.width = width, d.lighting.env.height = height;
    by_image = mean_irradiance(&d, (const float(*)[3])points, n, NULL);
    /* the image's disc: irradiance of a facing surface, by quadrature, in units of the sun's */
    double facing = 0;
    for (int i = 0; i < 2000; i++) {
        double theta = (i + 0.5) * 0.5 / 2000;
        float dir[3] = {(float)sin(theta), (float)cos(theta), 0}, rgb[3];
        isogi_env_radiance(&d.lighting.env, dir, rgb);
        facing += 2 * PI * sin(theta) * cos(theta) * (double)rgb[0] * 0.5 / 2000;
    }
    by_image *= PI * pow(sin(0.3), 2) / facing;
    CHECK(fabs(by_light - by_image) < 0.03 * by_light, "%s: shadow rays %.4f, escaping paths %.4f", name, by_light, by_image);
    free(image), scene_free(&s);
}

TEST(shadow_rays_at_vertices_agree_with_escaping_paths) { shadow_rays_agree(pit, "pit"), shadow_rays_agree(rough_pit, "rough pit"); }

/* The image drawn by brightness and weighed against the cosine: a convex surface gets the integral of radiance times cosine, here by
   quadrature over the image. A peak of 3000 in one pixel: without such sampling 256 samples would err by 100 %. */
TEST(bright_spot_of_an_image_is_found) {
    enum { W = 64, H = 32 };
    static float image[H][W][3];
    double q[4] = {15.5, 15.5, 15.5, 9}, worst = 0;
    float c = cosf(0.7f), sn = sinf(0.7f), rotation[9] = {c, 0, sn, 0, 1, 0, -sn, 0, c}, points[60][3], e[60][3], error[60], normals[60][3];
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, 256);
    int n = surface_points(&s, 0, 60, 7, points);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            for (int k = 0; k < 3; k++) image[y][x][k] = 0.2f + 0.5f * (float)y / H + (x == 20 && y == 9 ? 3000.0f : 0);
    memset(&d.lighting, 0, sizeof d.lighting);
    d.lighting.env.rgb = &image[0][0][0], d.lighting.env.width = W, d.lighting.env.height = H;
    memcpy(d.lighting.env.rotation, rotation, sizeof rotation);
    isogi_vol_sample_smooth(s.pyramid, (const float(*)[3])points, (size_t)n, NULL, normals);
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, error, NULL);
    for (int i = 0; i < n; i++) {
        const int fine = QUICK_SUITE ? 4 : 8;
        double expected = 0, length = length3((double)normals[i][0], (double)normals[i][1], (double)normals[i][2]);
        for (int y = 0; y < fine * H; y++)
            for (int x = 0; x < fine * W; x++) {
                double theta = (y + 0.5) * PI / (fine * H), phi = 2 * PI * ((x + 0.5) / (fine * W) - 0.5), cosine;
                float dir[3] = {(float)(sin(theta) * sin(phi)), (float)cos(theta), (float)(-sin(theta) * cos(phi))}, rgb[3];
                cosine = -((double)dir[0] * (double)normals[i][0] + (double)dir[1] * (double)normals[i][1] +
                           (double)dir[2] * (double)normals[i][2]) /
                         length;
                if (cosine <= 0) continue;
                isogi_env_radiance(&d.lighting.env, dir, rgb);
                expected += (double)rgb[0] * cosine * sin(theta) * (PI / (fine * H)) * (2 * PI / (fine * W));
            }
        worst = fmax(worst, fabs((double)e[i][0] - expected) / (0.02 * expected + 4 * (double)error[i]));
    }
    CHECK(worst < 1, "largest error in units of 2 %% and 4 standard errors: %g", worst);
    for (int i = 0; i < n; i++)
        CHECK(error[i] < 0.12f * e[i][0] + 0.02f, "E %g with a standard error of %g", (double)e[i][0], (double)error[i]);
    scene_free(&s);
}

/* No light comes through matter: inside of a closed shell it is exactly dark, also when everything reflects, the surface is rough
   and paths begin on the surface itself. The shell's middle is 2 inside, which a roughness of 1 does not pierce. */
TEST(nothing_leaks_into_a_closed_cavity) {
    double q[5] = {15.5, 15.5, 15.5, 7, 11};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 3, 1, 0.1);
    for (int variant = 0; variant < 4; variant++) {
        scene s = scene_make(32, 32, 32, NULL, variant < 2 ? shell : rough_shell, q);
        isogi_trace_desc d = desc_make(&s, 0.9f, 20, LONG_SUITE ? 256 : 32);
        float points[100][3], e[100][3];
        d.lighting.lights = &sun, d.lighting.light_count = 1, d.offset = variant & 1 ? -1 : 0;
        points_seen_from(&s, 15.5, 8, 100, points);
        isogi_trace_gather(&d, (const float(*)[3])points, NULL, 100, e, NULL, NULL);
        for (int i = 0; i < 100; i++) CHECK(e[i][0] <= 0 && e[i][1] <= 0, "variant %d, point %d: E %g", variant, i, (double)e[i][0]);
        scene_free(&s);
    }
}

/* White and closed, with a lamp inside: the true light is infinite. It must end, finite, and its error must say that it is worthless. */
TEST(white_closed_cavity_ends) {
    double q[5] = {11.5, 11.5, 11.5, 6, 9};
    scene s = scene_make(24, 24, 24, NULL, shell, q);
    isogi_trace_desc d = desc_make(&s, 1, -1, 16);
    isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 12, 12, 12, 1, 0);
    float point[1][3] = {{5.5f, 11.5f, 11.5f}}, e[1][3], error[1];
    d.lighting.lights = &lamp, d.lighting.light_count = 1;
    isogi_trace_gather(&d, (const float(*)[3])point, NULL, 1, e, error, NULL);
    CHECK(e[0][0] >= 0 && e[0][0] < 1e30f && error[0] > 0.1f, "E %g, error %g", (double)e[0][0], (double)error[0]);
    scene_free(&s);
}

/* ---- radiance transfer --------------------------------------------------------------------------------------------------- */

static void random_sky(float *sh, int order, uint64_t seed) {
    test_random r = {seed};
    for (int i = 0; i < order * order * 3; i++) sh[i] = (float)(i < 3 ? 4 : random_range(&r, -0.5, 0.5));
}

/* The same paths in both modes: the sums differ by float rounding of coefficients alone (1e-4). With other random numbers they differ
   by the noise of both: 5 standard errors, where 400 comparisons are expected to stay below 4. */
TEST(relit_by_sh_equals_baked_directly) {
    double q[5] = {16, 15, 16, 20, 9};
    scene s = scene_make(33, 33, 33, NULL, pit, q);
    float points[200][3], direct[200][3], relit[200][3], error[200], sh[75], other[75];
    int n = surface_points(&s, 0, 200, 9, points);
    for (int order = 3; order <= 5; order += 2)
        for (int colour = 0; colour < 2; colour++) {
            isogi_trace_desc d = desc_make(&s, 0.7f, 3, LONG_SUITE ? 64 : 24);
            isogi_lighting lighting;
            isogi_counters before = {0}, after = {0};
            isogi_trace *t = NULL;
            int found = 0, channels = 0;
            random_sky(sh, order, 10), random_sky(other, order, 11);
            if (colour) d.albedo[0] = 0.3f;
            d.lazy = 1, d.lighting.env.sh = sh, d.lighting.env.sh_order = order;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, direct);
            d.mode = ISOGI_TRACE_TRANSFER, d.order = order, d.storage = ISOGI_TRACE_FLOAT, d.lighting.env.sh = other;
            CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK, "order %d", order);
            isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
            isogi_trace_counters(t, &before);
            lighting = d.lighting, lighting.env.sh = sh;
            CHECK(isogi_trace_relight(t, &lighting) == ISOGI_OK, "relight");
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, relit, error);
            isogi_trace_counters(t, &after);
            CHECK(before.rays > 0 && before.rays == after.rays, "relighting took %g rays", (double)(after.rays - before.rays));
            isogi_trace_shape(t, NULL, &found, &channels);
            CHECK(found == order && channels == (colour ? 3 : 1), "order %d, channels %d", found, channels);
            for (int i = 0; i < n; i++)
                for (int c = 0; c < 3; c++)
                    CHECK(fabsf(relit[i][c] - direct[i][c]) < 1e-4f, "point %d channel %d: relit %g, direct %g", i, c, (double)relit[i][c],
                          (double)direct[i][c]);
            isogi_trace_free(t);
            d.mode = ISOGI_TRACE_IRRADIANCE, d.seed = 99, d.lighting.env.sh = sh;
            bake_and_sample(&d, NULL, (const float(*)[3])points, n, direct);
            for (int i = 0; i < n; i++) {
                double difference = fabs((double)relit[i][1] - (double)direct[i][1]);
                CHECK(difference < 5 * 1.41421 * (double)error[i] + 0.05, "other seed, point %d: relit %g, direct %g, error %g", i,
                      (double)relit[i][1], (double)direct[i][1], (double)error[i]);
            }
        }
    scene_free(&s);
}

/* Turning the environment by relighting is the same as baking under the turned one. */
TEST(relit_by_a_rotated_environment) {
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 25, 25, NULL, pit, q);
    float points[50][3], direct[50][3], relit[50][3], sh[27], transfer[50 * 9];
    float c = cosf(0.8f), sn = sinf(0.8f), rotation[9] = {c, -sn, 0, sn, c, 0, 0, 0, 1};
    isogi_trace_desc d = desc_make(&s, 0.5f, 2, 32);
    isogi_trace *t = NULL;
    int n = surface_points(&s, 0, 50, 12, points);
    random_sky(sh, 3, 13);
    d.lazy = 1, d.mode = ISOGI_TRACE_TRANSFER, d.order = 3, d.storage = ISOGI_TRACE_FLOAT, d.lighting.env.sh = sh,
    d.lighting.env.sh_order = 3;
    isogi_trace_create(&t, &d, NULL);
    isogi_trace_request(t, (const float(*)[3])points, (size_t)n), isogi_trace_step(t, 0, NULL);
    memcpy(d.lighting.env.rotation, rotation, sizeof rotation);
    CHECK(isogi_trace_relight(t, &d.lighting) == ISOGI_OK, "relight");
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, relit, NULL);
    isogi_trace_sample_transfer(t, (const float(*)[3])points, (size_t)n, transfer);
    d.mode = ISOGI_TRACE_IRRADIANCE;
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, direct);
    for (int i = 0; i < n; i++) {
        double dot = 0;
        float turned[27];
        CHECK(fabsf(relit[i][0] - direct[i][0]) < 1e-4f, "point %d: relit %g, direct %g", i, (double)relit[i][0], (double)direct[i][0]);
        isogi_sh_project(turned, 3, &d.lighting, NULL);
        for (int k = 0; k < 9; k++) dot += (double)transfer[9 * i + k] * (double)turned[3 * k];
        CHECK(fabs(dot - (double)relit[i][0]) < 1e-4, "point %d: dot product %g, sampled %g", i, dot, (double)relit[i][0]);
    }
    isogi_trace_free(t), scene_free(&s);
}

/* ---- determinism --------------------------------------------------------------------------------------------------------- */

static isogi_trace_desc busy_desc(const scene *s, const isogi_light *sun, isogi_trace_mode mode) {
    isogi_trace_desc d = desc_make(s, 0.8f, -1, 8);
    d.mode = mode, d.order = 2, d.seed = 5;
    d.lighting.lights = sun, d.lighting.light_count = 1;
    return d;
}

TEST(same_bits_for_any_threads_budget_and_lazily) {
    double q[5] = {8, 7, 8, 10.5, 5};
    scene s = scene_make(17, 16, 15, NULL, pit, q);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 2, 0.2);
    static float points[400][3], first[400][3], e[400][3];
    int n = surface_points(&s, 0, 400, 14, points);
    for (int mode = 0; mode < 2; mode++) {
        isogi_trace_desc d = busy_desc(&s, &sun, (isogi_trace_mode)mode);
        const int threads[4] = {1, 3, 2, 8};
        for (int i = 0; i < (QUICK_SUITE ? 2 : 4); i++) {
            isogi_context context;
            memset(&context, 0, sizeof context);
            context.threads = threads[i];
            d.lazy = 0;
            bake_and_sample(&d, &context, (const float(*)[3])points, n, i ? e : first);
            CHECK(!i || !memcmp(e, first, sizeof e), "mode %d: %d threads differ from one", mode, threads[i]);
            d.lazy = 1;
            bake_and_sample(&d, &context, (const float(*)[3])points, n, e);
            CHECK(!memcmp(e, first, sizeof e), "mode %d: lazily with %d threads differs from the full bake", mode, threads[i]);
        }
        for (int i = 0; i < 3; i++) { /* small budgets, requests in pieces and in reverse order */
            isogi_trace *t = NULL;
            double remaining = 1, before;
            uint64_t budget[3] = {1, 777, 50000};
            d.lazy = i > 0;
            isogi_trace_create(&t, &d, NULL);
            for (int k = n - 1; k >= 0; k--) isogi_trace_request(t, (const float(*)[3])&points[k], 1);
            for (before = 2; remaining > 0; before = remaining) {
                CHECK(isogi_trace_step(t, budget[i], &remaining) == ISOGI_OK, "step");
                CHECK(remaining < before, "remaining rose or stood still: %g after %g", remaining, before);
                if (remaining >= before) break;
            }
            isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
            CHECK(!memcmp(e, first, sizeof e), "mode %d: budget %g differs", mode, (double)budget[i]);
            isogi_trace_free(t);
        }
    }
    scene_free(&s);
}

static double clamped_ball(const double p[3], const double *q) { return fmax(-1, fmin(1, ball(p, q))); }

/* A point inside a cell, then a corner of the cell that has no surface around it, in one request: the corner reads another texel, the
   nearest that has one, which no lookup inside the cell asked for. */
TEST(requests_on_faces_follow_those_inside) {
    double q[4] = {11.5, 11.5, 11.5, 8.3};
    scene s = scene_make(24, 24, 24, NULL, clamped_ball, q);
    isogi_trace_lookup lookup[2] = {ISOGI_TRACE_TRILINEAR, ISOGI_TRACE_BSPLINE};
    for (int l = 0; l < 2; l++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 4);
        isogi_trace *whole = NULL, *t = NULL;
        size_t x[3];
        int tried = 0, apart = 0;
        d.lookup = lookup[l];
        isogi_trace_create(&whole, &d, NULL), isogi_trace_step(whole, 0, NULL);
        d.lazy = 1;
        for (size_t i = 0; i < 24 * 24 * 24; i += 5) {
            float point[2][3], e[3], expected[3];
            int have = 0;
            x[0] = i % 24, x[1] = i / 24 % 24, x[2] = i / 576;
            for (int k = 0; k < 8; k++) {
                size_t texel[3] = {x[0] + (size_t)(k & 1), x[1] + (size_t)(k >> 1 & 1), x[2] + (size_t)(k >> 2)};
                have |= isogi_trace_valid(whole, texel) << k;
            }
            if (!have || (have & 1)) continue;
            for (int a = 0; a < 3; a++) point[1][a] = (float)x[a], point[0][a] = (float)x[a] + 0.5f;
            isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])point, 2), isogi_trace_step(t, 0, NULL);
            isogi_trace_sample(t, (const float(*)[3])&point[1], 1, &e, NULL);
            isogi_trace_sample(whole, (const float(*)[3])&point[1], 1, &expected, NULL);
            tried++, apart += memcmp(e, expected, sizeof e) != 0;
            isogi_trace_free(t);
        }
        CHECK(tried > 50 && !apart, "lookup %d: %d of %d corners differ from the full bake", l, apart, tried);
        isogi_trace_free(whole);
    }
    scene_free(&s);
}

/* Lines of points, several to a cell, so that later lines come back to cells of earlier ones: all in one request, against the full bake. */
TEST(requests_that_come_back_to_a_cell_lack_nothing) {
    enum { LINE = 52, LINES = 13 * LINE };
    double q[4] = {11.5, 11.5, 11.5, 8.3};
    scene s = scene_make(24, 24, 24, NULL, clamped_ball, q);
    isogi_trace_lookup lookup[2] = {ISOGI_TRACE_TRILINEAR, ISOGI_TRACE_BSPLINE};
    static float point[LINES * LINE][3], e[LINES * LINE][3], expected[LINES * LINE][3];
    for (int i = 0; i < LINES * LINE; i++)
        point[i][0] = 0.2f + 0.43f * (float)(i % LINE), point[i][1] = 0.2f + 0.43f * (float)(i / LINE % LINE),
        point[i][2] = 3.2f + 0.43f * (float)(i / LINE / LINE);
    for (int l = 0; l < 2; l++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 1);
        int differ = 0, lit = 0;
        d.lookup = lookup[l];
        bake_and_sample(&d, NULL, (const float(*)[3])point, LINES * LINE, expected);
        d.lazy = 1;
        bake_and_sample(&d, NULL, (const float(*)[3])point, LINES * LINE, e);
        for (int i = 0; i < LINES * LINE; i++) differ += memcmp(e[i], expected[i], sizeof e[i]) != 0, lit += expected[i][0] > 0;
        CHECK(lit > 5000 && !differ, "lookup %d: of %d points with light %d differ from the full bake", l, lit, differ);
    }
    scene_free(&s);
}

/* Points in a cell around which no texel has a surface read the texel that is nearest to each of them. */
TEST(requests_that_come_back_to_a_cell_without_surface_find_the_nearest) {
    double q[4] = {11.5, 11.5, 11.5, 8.3};
    scene s = scene_make(24, 24, 24, NULL, clamped_ball, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, 1);
    isogi_trace *whole = NULL, *t = NULL;
    int tried = 0, differ = 0, apart = 0;
    isogi_trace_create(&whole, &d, NULL), isogi_trace_step(whole, 0, NULL);
    d.lazy = 1;
    for (size_t i = 0; i < 23 * 23 * 23; i += QUICK_SUITE ? 5 : 1) {
        float point[8][3], e[8][3], expected[8][3];
        int have = 0, lit = 0;
        for (size_t k = 0; k < 8; k++) {
            size_t texel[3] = {i % 23 + (k & 1), i / 23 % 23 + (k >> 1 & 1), i / 529 + (k >> 2)};
            have |= isogi_trace_valid(whole, texel);
            point[k][0] = (float)(i % 23) + (k & 1 ? 0.8f : 0.2f), point[k][1] = (float)(i / 23 % 23) + (k & 2 ? 0.8f : 0.2f),
            point[k][2] = (float)(i / 529) + (k & 4 ? 0.8f : 0.2f);
        }
        if (have) continue;
        isogi_trace_sample(whole, (const float(*)[3])point, 8, expected, NULL);
        for (int k = 0; k < 8; k++) lit += expected[k][0] > 0, apart += memcmp(expected[k], expected[0], sizeof expected[0]) != 0;
        if (!lit) continue;
        isogi_trace_create(&t, &d, NULL), isogi_trace_request(t, (const float(*)[3])point, 8), isogi_trace_step(t, 0, NULL);
        isogi_trace_sample(t, (const float(*)[3])point, 8, e, NULL);
        tried++, differ += memcmp(e, expected, sizeof e) != 0;
        isogi_trace_free(t);
    }
    CHECK(tried > 50 && apart > 50 && !differ, "%d of %d cells differ from the full bake", differ, tried);
    isogi_trace_free(whole), scene_free(&s);
}

/* Zero is the default: 64 samples, by either method, and in gather. */
TEST(samples_are_64_by_default) {
    double q[5] = {5, 4.5, 5, 6.5, 3};
    scene s = scene_make(11, 10, 11, NULL, pit, q);
    float points[20][3], e[3][20][3];
    int n = surface_points(&s, 0, 20, 15, points);
    for (int method = 0; method < 3; method++) {
        for (int k = 0; k < 3; k++) {
            isogi_trace_desc d = desc_make(&s, 0.8f, 1, k == 0 ? 0 : k == 1 ? 64 : 65);
            d.method = (isogi_trace_method)(method & 1), d.lazy = 1;
            if (method < 2) bake_and_sample(&d, NULL, (const float(*)[3])points, n, e[k]);
            else isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e[k], NULL, NULL);
        }
        CHECK(n == 20 && !memcmp(e[0], e[1], sizeof e[0]) && memcmp(e[1], e[2], sizeof e[0]), "method %d", method);
    }
    scene_free(&s);
}

/* Another seed is another estimate; the same seed the same, in gather as well. */
TEST(seed_decides) {
    double q[5] = {10, 9, 10, 13, 6};
    scene s = scene_make(21, 20, 19, NULL, pit, q);
    isogi_trace_desc d = desc_make(&s, 0.8f, 2, 8);
    float points[30][3], a[30][3], b[30][3];
    isogi_context serial;
    int n = surface_points(&s, 0, 30, 15, points);
    memset(&serial, 0, sizeof serial), serial.threads = 1;
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, a, NULL, NULL);
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, b, NULL, &serial);
    CHECK(!memcmp(a, b, sizeof a), "one thread gives other bits than all");
    d.seed = 1;
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, b, NULL, NULL);
    CHECK(memcmp(a, b, sizeof a), "another seed gives the same bits");
    scene_free(&s);
}

/* The stated standard error against the spread over 64 seeds. The directions are better spread than independent ones, so it may be too
   large (up to 5 times here), never too small (a quarter of slack for 64 seeds). */
TEST(error_estimate_is_honest) {
    double q[5] = {10, 9, 10, 13, 6};
    scene s = scene_make(21, 20, 19, NULL, pit, q);
    isogi_trace_desc d = desc_make(&s, 0.8f, -1, 16);
    float point[8][3], e[8][3], error[8];
    double sum[8] = {0}, square[8] = {0}, stated = 0, spread = 0;
    surface_points(&s, 0, 8, 16, point);
    for (int i = 0; i < 64; i++) {
        d.seed = (uint64_t)i;
        isogi_trace_gather(&d, (const float(*)[3])point, NULL, 8, e, error, NULL);
        for (int k = 0; k < 8; k++) {
            sum[k] += (double)e[k][1], square[k] += (double)e[k][1] * (double)e[k][1];
            stated += (double)error[k] * (double)error[k] / (64 * 8);
        }
    }
    for (int k = 0; k < 8; k++) spread += (square[k] / 64 - sum[k] * sum[k] / 4096) / 8;
    CHECK(sqrt(spread) < 1.25 * sqrt(stated) && sqrt(spread) > 0.2 * sqrt(stated), "spread %g, stated %g", sqrt(spread), sqrt(stated));
    scene_free(&s);
}

/* ---- lookups ------------------------------------------------------------------------------------------------------------- */

static const char *const lookup_names[4] = {"trilinear", "nearest", "closest isovalue", "B-spline"};

/* A gyroid between two constant halves: texels of a constant half have no surface. */
static double gyroid_and_air(const double p[3], const double *q) { return p[0] < 6.5 ? -2 : gyroid(p, q); }

/* Light (channel 1) and isovalue of every texel of a lattice of one texel per voxel; -1 where there is no surface. */
static void texel_lights(const isogi_trace *t, const scene *s, float *light, float *isovalue) {
    const size_t *n = s->volume.size;
    for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) {
        size_t texel[3] = {i % n[0], i / n[0] % n[1], i / n[0] / n[1]};
        float p[1][3] = {{(float)texel[0], (float)texel[1], (float)texel[2]}}, e[1][3];
        isogi_trace_sample(t, (const float(*)[3])p, 1, e, NULL);
        light[i] = isogi_trace_valid(t, texel) ? e[0][1] : -1, isovalue[i] = s->data[i];
    }
}

/* The four lookups by their definitions, from the lights of the texels: all texels of the lattice are looked at. -1: none applies. */
static double lookup_reference(const scene *s, const float *light, const float *isovalue, const float p[3], int kind) {
    const size_t *n = s->volume.size;
    double sum = 0, total = 0, best = 1e30, chosen = -1, value = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) {
            double linear = 1, spline = 1, squared = 0, apart;
            for (int a = 0; a < 3; a++) {
                double place = (double)(a == 0 ? i % n[0] : a == 1 ? i / n[0] % n[1] : i / n[0] / n[1]), d = fabs((double)p[a] - place);
                linear *= d < 1 ? 1 - d : 0, squared += d * d;
                spline *= d < 1 ? 2. / 3 - d * d + d * d * d / 2 : d < 2 ? pow(2 - d, 3) / 6 : 0;
            }
            if (pass == 0) value += linear * (double)isovalue[i];
            if (pass == 0 || light[i] < 0 || !((kind == 3 ? spline : linear) > 0)) continue;
            sum += (kind == 3 ? spline : linear) * (double)light[i], total += kind == 3 ? spline : linear;
            apart = kind == 2 ? fabs((double)isovalue[i] - value) : squared;
            if (apart < best) best = apart, chosen = (double)light[i];
        }
    return !(total > 0) ? -1 : kind == 0 || kind == 3 ? sum / total : chosen;
}

/* Every lookup against its definition, at places with and without invalid texels around them, baked fully, lazily and within an
   interval of isovalues. 1e-5: single precision. */
SLOW_TEST(lookups_follow_their_definitions) {
    double q[1] = {0.7};
    scene s = scene_make(16, 14, 13, NULL, gyroid_and_air, q);
    size_t count = 16 * 14 * 13;
    float *light = (float *)malloc(count * sizeof(float)), *isovalue = (float *)malloc(count * sizeof(float));
    float point[200][3], e[200][3];
    isogi_trace_desc d = desc_make(&s, 0.5f, 2, 8);
    isogi_trace *t = NULL;
    int n = surface_points(&s, 0.2, 200, 71, point);
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
    texel_lights(t, &s, light, isovalue);
    isogi_trace_free(t);
    CHECK(n == 200, "%d points", n);
    for (int way = 0; way < 3; way++)
        for (int kind = 0; kind < 4; kind++) {
            int compared = 0;
            d.lookup = (isogi_trace_lookup)kind, d.lazy = way == 1;
            d.isovalue_min = d.isovalue_max = way == 2 ? 0.2 : 0;
            bake_and_sample(&d, NULL, (const float(*)[3])point, n, e);
            for (int i = 0; i < n; i++) {
                double expected = lookup_reference(&s, light, isovalue, point[i], kind);
                if (expected < 0) continue;
                compared++;
                CHECK(fabs((double)e[i][1] - expected) < 1e-5, "%s (way %d) at %g %g %g: %g, expected %g", lookup_names[kind], way,
                      (double)point[i][0], (double)point[i][1], (double)point[i][2], (double)e[i][1], expected);
            }
            CHECK(compared > 150, "%s: %d compared", lookup_names[kind], compared);
        }
    free(light), free(isovalue), scene_free(&s);
}

/* Wyman et al. 2006, fig. 6, in numbers: RMS error of each lookup against light gathered at the points themselves. Trilinear has to be
   the best, as the paper found; the noise of both sides is far below the differences. */
SLOW_TEST(trilinear_lookup_errs_least) {
    double q[1] = {0.5}, rms[4];
    scene s = scene_make(20, 20, 20, NULL, gyroid, q);
    enum { N = 150 };
    static float point[N][3], e[N][3], truth[N][3];
    isogi_trace_desc d = desc_make(&s, 0.5f, LONG_SUITE ? 2 : 0, LONG_SUITE ? 1024 : 512);
    int n = surface_points(&s, 0.1, N, 72, point);
    d.lazy = 1;
    isogi_trace_gather(&d, (const float(*)[3])point, NULL, (size_t)n, truth, NULL, NULL);
    d.samples = LONG_SUITE ? 256 : 192;
    for (int kind = 0; kind < 4; kind++) {
        double sum = 0;
        d.lookup = (isogi_trace_lookup)kind;
        bake_and_sample(&d, NULL, (const float(*)[3])point, n, e);
        for (int i = 0; i < n; i++) sum += pow((double)e[i][1] - (double)truth[i][1], 2) / n;
        rms[kind] = sqrt(sum);
        printf("    %-17s RMS error %.4f of pi\n", lookup_names[kind], rms[kind] / PI);
    }
    for (int kind = 1; kind < 4; kind++) CHECK(rms[0] < rms[kind], "trilinear %g, %s %g", rms[0], lookup_names[kind], rms[kind]);
    scene_free(&s);
}

/* ---- texels -------------------------------------------------------------------------------------------------------------- */

/* Air of value 0 over matter of value 200: the air's texels and those deep in the matter have no surface. Every lookup between the
   two layers is that of the matter's surface alone: pi under the sky, whatever the isovalue. */
TEST(texels_without_a_surface_are_left_out) {
    static uint8_t data[16][16][16];
    isogi_volume v;
    isogi_pyramid *p = NULL;
    isogi_trace *t = NULL;
    isogi_trace_desc d;
    memset(&v, 0, sizeof v), memset(&d, 0, sizeof d);
    for (int i = 0; i < 4096; i++) data[i / 256][i / 16 % 16][i % 16] = i / 16 % 16 < 8 ? 200 : 0;
    v.data = data, v.size[0] = v.size[1] = v.size[2] = 16;
    isogi_vol_build(&p, &v, NULL);
    d.pyramid = p, d.samples = 4, d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1;
    isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL);
    for (size_t y = 0; y < 16; y++) {
        size_t texel[3] = {5, 0, 7};
        texel[1] = y;
        CHECK(isogi_trace_valid(t, texel) == (y == 7), "layer %d: valid %d", (int)y, isogi_trace_valid(t, texel));
    }
    for (int i = 0; i < 200; i++) {
        float point[1][3] = {{(float)(0.07 * i), (float)(7.001 + 0.998 * i / 200), (float)(14 - 0.06 * i)}}, e[1][3], error[1];
        isogi_trace_sample(t, (const float(*)[3])point, 1, e, error);
        /* four samples a texel that agree may have missed something, but not much */
        CHECK(fabs((double)e[0][0] - PI) < 1e-4 && error[0] > 0 && error[0] < 0.2f, "at y = %g: E %g, error %g", (double)point[0][1],
              (double)e[0][0], (double)error[0]);
    }
    {
        float point[1][3] = {{5, 12, 5}}, e[1][3] = {{1, 1, 1}}, error[1] = {0}; /* in the air no lookup is possible, and it says so */
        isogi_trace_sample(t, (const float(*)[3])point, 1, e, error);
        CHECK(e[0][0] <= 0 && error[0] > 1e30f, "in the air: E %g, error %g", (double)e[0][0], (double)error[0]);
    }
    isogi_trace_free(t), isogi_vol_free(p);
}

/* A texel whose eight neighbours' gradient vanishes is looked past: the nearest valid one of 4x4x4 stands in, lazily the same. */
TEST(lookup_falls_back_to_the_nearest_valid_texel) {
    static uint8_t data[12][12][12];
    isogi_volume v;
    isogi_pyramid *p = NULL;
    float point[1][3] = {{5.5f, 5.8f, 5.5f}}, e[2][1][3];
    memset(&v, 0, sizeof v);
    for (int i = 0; i < 1728; i++) data[i / 144][i / 12 % 12][i % 12] = i / 12 % 12 < 5 ? 200 : 0; /* matter below y = 4 */
    v.data = data, v.size[0] = v.size[1] = v.size[2] = 12;
    isogi_vol_build(&p, &v, NULL);
    for (int lazy = 0; lazy < 2; lazy++) { /* at y = 5.8 the eight texels are air */
        isogi_trace_desc d;
        memset(&d, 0, sizeof d);
        d.pyramid = p, d.samples = 4, d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1, d.lazy = lazy;
        bake_and_sample(&d, NULL, (const float(*)[3])point, 1, e[lazy]);
        CHECK(fabs((double)e[lazy][0][0] - PI) < 1e-4, "lazy %d: E %g", lazy, (double)e[lazy][0][0]);
    }
    CHECK(!memcmp(e[0], e[1], sizeof e[0]), "lazily %g, fully %g", (double)e[1][0][0], (double)e[0][0][0]);
    isogi_vol_free(p);
}

/* A lattice finer, coarser or smaller than the volume reads the same light on a smooth surface. */
TEST(lattice_of_its_own_resolution) {
    double q[1] = {9.37};
    scene s = scene_make(24, 24, 24, NULL, ground, q);
    for (int i = 0; i < 3; i++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 4);
        isogi_trace *t = NULL;
        float points[100][3], e[100][3];
        size_t lattice[3];
        test_random r = {17};
        for (int a = 0; a < 3; a++)
            d.lattice[a] = (size_t)(i == 0 ? 9 : 0), d.lattice_min[a] = i == 2 ? 4 : 0, d.lattice_max[a] = i == 2 ? 14 : 0;
        if (i == 1) d.lattice[1] = 61;
        isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL), isogi_trace_shape(t, lattice, NULL, NULL);
        CHECK(lattice[0] == (i == 0 ? 9u : i == 1 ? 24u : 11u) && lattice[1] == (i == 0 ? 9u : i == 1 ? 61u : 11u), "lattice %d x %d",
            (int)lattice[0], (int)lattice[1]);
        for (int k = 0; k < 100; k++)
            for (int a = 0; a < 3; a++) points[k][a] = a == 1 ? 9.37f : (float)random_range(&r, 4, 14);
        isogi_trace_sample(t, (const float(*)[3])points, 100, e, NULL);
        for (int k = 0; k < 100; k++) CHECK(fabs((double)e[k][0] - PI) < 1e-4, "lattice %d: E %g", i, (double)e[k][0]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* Points beyond the lattice read what its border has, whatever the lookup: beyond faces, edges and corners, near and far. */
TEST(points_beyond_the_lattice_read_its_border) {
    double q[5] = {10, 9, 10, 13, 6};
    scene s = scene_make(21, 20, 19, NULL, pit, q);
    for (int k = 0; k < 8; k++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 1);
        static float points[2][300][3], e[2][300][3];
        double low[3] = {0, 0, 0}, high[3] = {20, 19, 18};
        int lit = 0;
        test_random r = {(uint64_t)k};
        d.lookup = (isogi_trace_lookup)(k / 2);
        for (int a = 0; a < 3 && k % 2; a++) {
            low[a] = d.lattice_min[a] = 3.25, high[a] = d.lattice_max[a] = 14.75;
            d.lattice[a] = 10;
        }
        for (int i = 0; i < 300; i++)
            for (int a = 0; a < 3; a++) {
                double off = random_range(&r, 0, i % 3 ? 1 : 30), x = random_range(&r, low[a], high[a]);
                int beyond = random_bits(&r) % 2 || a == i % 3;
                if (beyond) x = random_bits(&r) % 2 ? low[a] : high[a];
                points[0][i][a] = (float)x, points[1][i][a] = (float)(!beyond ? x : x <= low[a] ? x - off : x + off);
            }
        bake_and_sample(&d, NULL, (const float(*)[3])points[0], 600, e[0]);
        for (int i = 0; i < 300; i++) {
            lit += e[0][i][1] > 0.5f;
            CHECK(!memcmp(e[0][i], e[1][i], sizeof e[0][i]), "case %d, point %d: E %g, at the border %g", k, i, (double)e[1][i][1],
                  (double)e[0][i][1]);
        }
        CHECK(lit > 50, "case %d: %d points have light", k, lit);
    }
    scene_free(&s);
}

/* Places that are not finite ask for no texel, among others or alone, and have no light. */
TEST(points_that_are_not_finite_have_no_light) {
    double q[1] = {0.4};
    scene s = scene_make(12, 11, 13, NULL, gyroid, q);
    for (int k = 0; k < 8; k++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 2);
        const float odd[4] = {(float)nan_value(), HUGE_VALF, -HUGE_VALF, 1e30f};
        float points[12][3], e[12][3], error[12];
        isogi_counters counters[2] = {{0}, {0}};
        isogi_trace *t = NULL;
        d.lookup = (isogi_trace_lookup)(k / 2), d.lazy = 1, d.mode = (isogi_trace_mode)(k % 2);
        for (int i = 0; i < 12; i++)
            for (int a = 0; a < 3; a++) points[i][a] = a == i % 3 ? odd[i / 3] : 5.25f;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, 9) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK,
              "case %d", k);
        isogi_trace_counters(t, &counters[0]);
        CHECK(isogi_trace_request(t, (const float(*)[3])points, 12) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
        isogi_trace_counters(t, &counters[1]);
        CHECK(!counters[0].texels && counters[1].texels, "case %d: %d texels, then %d", k, (int)counters[0].texels,
              (int)counters[1].texels);
        isogi_trace_sample(t, (const float(*)[3])points, 12, e, error);
        for (int i = 0; i < 12; i++)
            CHECK(i < 9 ? !(e[i][1] > 0) && error[i] > 1e30f : e[i][1] > 0, "case %d, point %d: %g, error %g", k, i, (double)e[i][1],
                  (double)error[i]);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

/* The only texel along an axis lies in the middle: as the one of a lattice that is that plane. More than 2^31 - 1 are too many. */
TEST(a_single_texel_lies_in_the_middle) {
    double q[5] = {10, 9, 10, 13, 6};
    scene s = scene_make(21, 20, 19, NULL, pit, q);
    for (int k = 0; k < 6; k++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
        float points[50][3], e[2][50][3], most = 0;
        test_random r = {3};
        for (int i = 0; i < 50; i++)
            for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, 4, 12);
        for (int b = 0; b < 3; b++) d.lattice_max[b] = k < 3 ? (double)s.volume.size[b] - 1 : 13, d.lattice_min[b] = k < 3 ? 0 : 4;
        if (k >= 3) d.lattice[k % 3] = 1;
        else memset(d.lattice_max, 0, sizeof d.lattice_max), d.lattice[k] = 1; /* the whole volume */
        bake_and_sample(&d, NULL, (const float(*)[3])points, 50, e[0]);
        for (int b = 0; b < 3; b++) d.lattice[b] = 0, d.lattice_max[b] = k < 3 ? (double)s.volume.size[b] - 1 : 13;
        d.lattice_min[k % 3] = d.lattice_max[k % 3] = k < 3 ? d.lattice_max[k] / 2 : 8.5;
        bake_and_sample(&d, NULL, (const float(*)[3])points, 50, e[1]);
        for (int i = 0; i < 50; i++) most = fmaxf(most, e[0][i][1]);
        CHECK(!memcmp(e[0], e[1], sizeof e[0]) && most > 0.1f, "lattice %d: E %g, in the middle %g, at most %g", k, (double)e[0][0][1],
              (double)e[1][0][1], (double)most);
    }
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
    isogi_trace *t = NULL;
    scarce memory = {1, 0}; /* none for so many texels */
    isogi_context context = {.alloc = scarce_alloc, .release = scarce_release, .user = &memory, .threads = 1};
    d.lattice[1] = (size_t)1 << 31, d.lattice[0] = d.lattice[2] = 1;
    CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_TOO_LARGE && !t && !memory.blocks, "%ld blocks", memory.blocks);
    d.lattice[1]--, memory.left = 1;
    CHECK(isogi_trace_create(&t, &d, &context) == ISOGI_NO_MEMORY && !t && !memory.blocks, "%ld blocks", memory.blocks);
    scene_free(&s);
}

/* Many texels of an axis at one place, at either border, and in the middle: as valid as a single one there, with the same light within an
   interval of isovalues, and as many within one that holds all. Surfaces are looked for in blocks of 4 cells: the last voxel of 33 begins a
   ninth that is not there. */
TEST(texels_at_one_place_are_alike) {
    double q[1] = {0.5};
    scene s = scene_make(33, 33, 33, NULL, gyroid, q);
    for (int k = 0; k < (LONG_SUITE ? 9 : 4); k++) {
        const double at = k / 3 == 0 ? 32 : k / 3 == 1 ? 0 : 16;
        float points[60][3], value[60], e[3][60][3], most = 0;
        test_random r = {(uint64_t)(29 + k)};
        for (int i = 0; i < 60; i++) /* of the interval alone */
            do {
                for (int a = 0; a < 3; a++) points[i][a] = a == k % 3 ? (float)at : (float)random_range(&r, 1, 31);
                isogi_vol_sample(s.pyramid, (const float(*)[3])points + i, 1, value + i, NULL);
            } while (value[i] < 0.1f || value[i] > 0.3f);
        isogi_trace *t[4] = {NULL}; /* of a single one, of many, within the interval, within that of all */
        isogi_trace_report report[4];
        for (int way = 0; way < 4; way++) {
            isogi_trace_desc d = desc_make(&s, 0.5f, 0, 4);
            for (int a = 0; a < 3; a++) d.lattice_max[a] = 32, d.lattice[a] = 9;
            d.lattice_min[k % 3] = d.lattice_max[k % 3] = at, d.lattice[k % 3] = way ? 7 : 1;
            if (way >= 2) d.isovalue_min = way == 2 ? 0.1 : -9, d.isovalue_max = way == 2 ? 0.3 : 9;
            CHECK(isogi_trace_create(&t[way], &d, NULL) == ISOGI_OK && isogi_trace_step(t[way], 0, NULL) == ISOGI_OK, "case %d", k);
            if (way < 3) isogi_trace_sample(t[way], (const float(*)[3])points, 60, e[way], NULL);
            isogi_trace_status(t[way], &report[way]);
        }
        CHECK(report[1].texels == 7 * report[0].texels && report[3].texels == report[1].texels,
              "case %d: %d texels, %d and %d", k, (int)report[0].texels, (int)report[1].texels, (int)report[3].texels);
        for (size_t i = 0; i < 7 * 81; i++) {
            size_t texel[3], single[3];
            texel[k % 3] = i / 81, texel[(k + 1) % 3] = i % 9, texel[(k + 2) % 3] = i / 9 % 9;
            memcpy(single, texel, sizeof single), single[k % 3] = 0;
            CHECK(isogi_trace_valid(t[0], single) == isogi_trace_valid(t[1], texel), "case %d: texel %d", k, (int)i);
        }
        for (int i = 0; i < 60; i++) {
            most = fmaxf(most, e[1][i][1]);
            CHECK(!memcmp(e[1][i], e[2][i], sizeof e[1][i]), "case %d: E %g, not %g", k, (double)e[2][i][1], (double)e[1][i][1]);
        }
        CHECK(most > 0.1f, "case %d: E %g", k, (double)most);
        for (int way = 0; way < 4; way++) isogi_trace_free(t[way]);
    }
    scene_free(&s);
}

/* Between voxels of one layer there is no cell, hence no surface: no light, by both methods and for points of one's own. */
TEST(a_volume_of_one_layer_has_no_texels) {
    double q[1] = {0.5};
    for (int k = 0; k < 6; k++) {
        scene s = scene_make(k % 3 == 0 ? 1 : 9, k % 3 == 1 ? 1 : 8, k % 3 == 2 ? 1 : 7, NULL, gyroid, q);
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
        float points[4][3] = {{0}}, e[4][3], error[4];
        isogi_trace *t = NULL;
        isogi_trace_report report;
        d.method = (isogi_trace_method)(k / 3), d.sides = k & 1 ? ISOGI_TRACE_HIGH_SIDE : ISOGI_TRACE_LOW_SIDE, d.capped = k & 1;
        for (int i = 0; i < 4; i++)
            for (int a = 0; a < 3; a++) points[i][a] = a == k % 3 ? 0 : (float)(i + a);
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_request(t, (const float(*)[3])points, 4) == ISOGI_OK &&
                  isogi_trace_step(t, 0, NULL) == ISOGI_OK,
              "case %d", k);
        isogi_trace_status(t, &report);
        for (int way = 0; way < 2; way++) {
            memset(e, 0x3f, sizeof e), memset(error, 0, sizeof error);
            isogi_result result = way ? isogi_trace_gather(&d, (const float(*)[3])points, NULL, 4, e, error, NULL)
                                      : isogi_trace_sample(t, (const float(*)[3])points, 4, e, error);
            CHECK(result == ISOGI_OK && !report.texels, "case %d: %d texels", k, (int)report.texels);
            for (int i = 0; i < 4; i++)
                CHECK(!(e[i][0] > 0 || e[i][1] > 0 || e[i][2] > 0) && !test_finite((double)error[i]), "case %d: E %g, error %g", k,
                      (double)e[i][1], (double)error[i]);
        }
        isogi_trace_free(t), scene_free(&s);
    }
}

/* Voxels twice as high as wide: the same ball in the world gets the same light, and a lamp's inverse square is of the world. */
TEST(anisotropic_spacing) {
    double q[4] = {15.5, 15.5, 15.5, 9.3}, spacing[3] = {1, 1, 2}, worst = 0, flat[1] = {8}, d = length3(3, 6, 4);
    scene s = scene_make(32, 32, 16, spacing, ball, q);
    isogi_trace_desc desc = desc_make(&s, 0, 0, 16);
    isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 9, 14, 12, 40, 0);
    float points[200][3], e[200][3], open[3] = {6, 8, 16};
    int n = surface_points(&s, 0, 200, 18, points);
    bake_and_sample(&desc, NULL, (const float(*)[3])points, n, e);
    for (int i = 0; i < n; i++) worst = fmax(worst, fabs((double)e[i][0] - PI));
    CHECK(worst < 0.01 * PI, "largest error of E %g", worst);
    scene_free(&s);
    s = scene_make(32, 32, 16, spacing, ground, flat);
    CHECK(fabs(lit(&s, &lamp, open, 0, 4) - 40 * 6 / (d * d * d)) < 1e-5, "lamp E %g", lit(&s, &lamp, open, 0, 4));
    scene_free(&s);
}

/* Only the texels that the interval reads, and these with the same bits as in a full bake. */
TEST(isovalue_range_computes_what_it_reads) {
    double q[4] = {15.5, 15.5, 15.5, 9};
    scene s = scene_make(32, 32, 32, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 4);
    float points[200][3], full[200][3], part[200][3];
    isogi_counters all = {0}, some = {0};
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 2, 0.2); /* so that every texel has another light */
    isogi_trace *t = NULL;
    int n = surface_points(&s, 1.5, 100, 19, points);
    d.lighting.lights = &sun, d.lighting.light_count = 1;
    n += surface_points(&s, 2.25, 100, 20, points + n);
    isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL), isogi_trace_counters(t, &all);
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, full, NULL), isogi_trace_free(t);
    d.isovalue_min = 1.5, d.isovalue_max = 2.25;
    isogi_trace_create(&t, &d, NULL), isogi_trace_step(t, 0, NULL), isogi_trace_counters(t, &some);
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, part, NULL), isogi_trace_free(t);
    CHECK(!memcmp(full, part, sizeof full), "lookups of the interval differ");
    /* the shell of radii 6.75 .. 7.5 reads texels up to a cell's diagonal away: 5.0 .. 9.3 of a cube of side 31, 10 % of it */
    CHECK(some.texels > 0 && some.texels < all.texels / 8, "%g of %g texels", (double)some.texels, (double)all.texels);
    scene_free(&s);
}

/* With the border closed, a volume that is solid throughout is a box under the sky, and its light enters through no face. */
TEST(capped_border_is_a_surface) {
    double q[1] = {1000};
    scene s = scene_make(12, 12, 12, NULL, ground, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 2, 16);
    float points[4][3] = {{0, 5, 6}, {11, 4, 3}, {5.5f, 11, 5}, {3, 6.5f, 0}}, e[4][3];
    d.capped = 1;
    bake_and_sample(&d, NULL, (const float(*)[3])points, 4, e);
    for (int i = 0; i < 4; i++) CHECK(fabs((double)e[i][0] - PI) < 0.01 * PI, "face %d: E %g", i, (double)e[i][0]);
    scene_free(&s);
}

/* Where two of its faces meet the surface looks half way between them, whatever part of the distance of voxels stands in the axes. */
TEST(edges_of_caps_look_half_way_between_faces) {
    static float data[9 * 9 * 9], texel[9][9][9][3];
    const isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {0, 1, 0}, .rgb = {1, 1, 1}};
    for (int i = 0; i < 9 * 9 * 9; i++) data[i] = 1;
    for (int k = 0; k < 4; k++) {
        isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {9, 9, 9}, .spacing = {1, 1, 1}, .axes = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        isogi_trace_desc d = {.lighting = {.lights = &sun, .light_count = 1}, .capped = 1, .samples = 1};
        isogi_pyramid *pyramid;
        isogi_trace *t = NULL;
        *(k & 1 ? &v.axes[0] : &v.spacing[0]) = k & 2 ? 10 : 0.1;
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        d.pyramid = pyramid;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                  isogi_trace_export(t, ISOGI_TRACE_FLOAT, texel, sizeof texel) == ISOGI_OK,
              "bake");
        CHECK(fabs((double)texel[4][8][4][0] - 1) < 1e-5 && fabs((double)texel[4][8][0][0] - sqrt(0.5)) < 1e-5 &&
                  fabs((double)texel[8][8][8][0] - sqrt(1 / 3.0)) < 1e-5,
              "%d: face %g, edge %g, corner %g", k, (double)texel[4][8][4][0], (double)texel[4][8][0][0], (double)texel[8][8][8][0]);
        isogi_trace_free(t), isogi_vol_free(pyramid);
    }
}

/* The cap closes every isovalue, though no voxel lies below the interval there: the interval must not leave its texels out. */
static double block_falling_at_one_side(const double p[3], const double *unused) {
    (void)unused;
    return p[0] < 4 ? 100 - 20 * (4 - p[0]) : 100;
}

/* However many texels lie in one place along an axis, and whatever isovalues are asked for: what is beyond that place reads them. */
TEST(texels_at_one_place_are_read_from_afar) {
    const float point[1][3] = {{4, 4.5f, 4}};
    double q[1] = {4.5};
    scene s = scene_make(9, 9, 9, NULL, ground, q);
    for (int k = 0; k < 20; k++) {
        isogi_trace_desc d = desc_make(&s, 0, 0, 4);
        float e[1][3];
        d.lattice[1] = 1 + (size_t)k / 2, d.lattice_min[1] = d.lattice_max[1] = 1, d.lattice_max[0] = d.lattice_max[2] = 8;
        d.isovalue_min = -0.1, d.isovalue_max = 0.1, d.lazy = k % 2;
        bake_and_sample(&d, NULL, point, 1, e);
        CHECK(fabs((double)e[0][1] - PI) < 1e-3, "%zu texels, %s: E %g", d.lattice[1], d.lazy ? "lazily" : "all", (double)e[0][1]);
    }
    scene_free(&s);
}

TEST(capped_border_is_lit_within_an_isovalue_range) {
    scene s = scene_make(16, 14, 14, NULL, block_falling_at_one_side, NULL);
    isogi_trace_desc d = desc_make(&s, 0.5f, 0, 16);
    float points[2][3] = {{10, 13, 6}, {9, 5, 0}}, e[2][3];
    d.capped = 1, d.isovalue_min = 45, d.isovalue_max = 55;
    bake_and_sample(&d, NULL, (const float(*)[3])points, 2, e);
    for (int i = 0; i < 2; i++) CHECK(fabs((double)e[i][0] - PI) < 0.01 * PI, "point %d: E %g", i, (double)e[i][0]);
    scene_free(&s);
}

/* Rough ground that reaches the open border, light from below the horizon alone: rays that begin on the surface itself, about a
   smoothed normal, must not go into the ground and leave it by the border. */
TEST(rays_from_the_surface_do_not_leak_through_the_ground) {
    enum { N = 64, W = 128, H = 64, POINTS = 400 };
    static float sky[H][W][3];
    uint64_t state = 5;
    double q[1] = {N / 2};
    scene s = scene_make(N, N, N, NULL, ground, q);
    isogi_trace_desc d = desc_make(&s, 0, 0, LONG_SUITE ? 256 : 64);
    float points[POINTS][3], e[POINTS][3];
    int n = 0, lit = 0;
    for (int i = 0; i < N * N * N; i++) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        s.data[i] += 1.6f * ((float)(state >> 40) / 16777216.0f - 0.5f);
    }
    isogi_vol_free(s.pyramid);
    if (isogi_vol_build(&s.pyramid, &s.volume, NULL) != ISOGI_OK) abort();
    for (int y = H / 2 + 3; y < H; y++) /* over 22 voxels the ground falls by 5 degrees at most */
        for (int x = 0; x < W; x++) sky[y][x][0] = sky[y][x][1] = sky[y][x][2] = 1;
    memset(&d.lighting, 0, sizeof d.lighting);
    d.pyramid = s.pyramid, d.offset = -1;
    d.lighting.env.rgb = sky[0][0], d.lighting.env.width = W, d.lighting.env.height = H;
    for (int i = 0; i < POINTS; i++) {
        isogi_ray ray;
        isogi_hit hit;
        memset(&ray, 0, sizeof ray), memset(&hit, 0, sizeof hit);
        ray.origin[0] = 22.3 + i % 20, ray.origin[1] = N - 1, ray.origin[2] = 22.7 + i / 20, ray.dir[1] = -1, ray.isovalue = 0;
        isogi_vol_intersect(s.pyramid, &ray, 1, &hit, NULL);
        if (hit.side) isogi_vol_positions(s.pyramid, &hit, 1, &points[n++]);
    }
    CHECK(n == POINTS, "only %d points", n);
    isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, NULL, NULL);
    for (int i = 0; i < n; i++) lit += e[i][0] > 1e-3f;
    CHECK(lit == 0, "%d of %d points see light through the ground", lit, n);
    for (int k = 0; k < 8; k++) { /* texels lie where cells meet, each of which has a gradient of its own; without offset, and with it */
        isogi_trace *t = NULL;
        if (QUICK_SUITE && (k ^ k >> 1 ^ k >> 2) & 1) continue; /* half of them: each method with either offset and number of bounces */
        int valid = 0;
        d.method = (isogi_trace_method)(k & 1), d.bounces = k >> 1 & 1, d.offset = k >> 2 ? 0 : -1, d.albedo[0] = 0.5f;
        d.samples = LONG_SUITE ? 32 : 4;
        d.isovalue_min = -4, d.isovalue_max = 4; /* a box by feedback would take all texels of its cube */
        for (int a = 0; a < 3; a++) d.box_first[a] = a == 1 ? 28 : 22, d.box_end[a] = a == 1 ? 36 : 42;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "case %d", k);
        lit = 0;
        for (size_t i = 0; i < 20 * 20 * 8; i++) { /* what is seen from there over the ground is no lower than where the sky ends */
            const size_t texel[3] = {22 + i % 20, 28 + i / 400, 22 + i / 20 % 20};
            const float point[1][3] = {{(float)texel[0], (float)texel[1], (float)texel[2]}};
            float light[1][3], error[1];
            isogi_trace_sample(t, point, 1, light, error);
            if (!isogi_trace_valid(t, texel) || !(error[0] < 1e30f)) continue;
            valid++, lit += light[0][0] > 1e-3f;
        }
        CHECK(valid > 1000 && lit == 0, "case %d: %d of %d texels see light through the ground", k, lit, valid);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

TEST(albedo_by_isovalue) {
    isogi_albedo_point points[2] = {{10, {0.2f, 0.4f, 0.6f}}, {20, {0.4f, 0.4f, 0.0f}}};
    isogi_trace_desc d;
    float rgb[3];
    memset(&d, 0, sizeof d);
    d.albedo_points = points, d.albedo_count = 2;
    isogi_trace_albedo(&d, 15, rgb);
    CHECK(fabsf(rgb[0] - 0.3f) < 1e-6f && fabsf(rgb[1] - 0.4f) < 1e-6f && fabsf(rgb[2] - 0.3f) < 1e-6f, "%g %g %g", (double)rgb[0],
          (double)rgb[1], (double)rgb[2]);
    isogi_trace_albedo(&d, -5, rgb);
    CHECK(fabsf(rgb[0] - 0.2f) < 1e-6f, "below: %g", (double)rgb[0]);
    isogi_trace_albedo(&d, 1e9, rgb);
    CHECK(fabsf(rgb[0] - 0.4f) < 1e-6f, "above: %g", (double)rgb[0]);
#ifndef __FAST_MATH__
    points[0].value = -1.7e308, points[1].value = 1.7e308; /* whose difference is no number */
    isogi_trace_albedo(&d, 0.85e308, rgb);
    CHECK(fabsf(rgb[0] - 0.35f) < 1e-6f, "of any value: %g", (double)rgb[0]);
    points[0].value = 10, points[1].value = 20;
#endif
    { /* many points, some of one value: as one after another */
        static isogi_albedo_point many[999];
        isogi_trace_desc long_table;
        test_random r = {12};
        int worse = 0;
        memset(&long_table, 0, sizeof long_table);
        long_table.albedo_points = many, long_table.albedo_count = 999;
        for (int i = 0; i < 999; i++) many[i].value = i / 3 * 0.5, many[i].rgb[0] = (float)random_unit(&r);
        for (int k = 0; k < 2000; k++) {
            const double x = k & 1 ? random_range(&r, -2, 170) : 0.25 * (k / 2 % 700);
            float expected;
            int i = 0;
            while (i < 999 && many[i].value < x) i++;
            expected = many[i < 999 ? i : 998].rgb[0];
            if (i > 0 && i < 999)
                expected = (float)(((many[i].value - x) * (double)many[i - 1].rgb[0] + (x - many[i - 1].value) * (double)expected) /
                                   (many[i].value - many[i - 1].value));
            isogi_trace_albedo(&long_table, x, rgb);
            worse += fabsf(rgb[0] - expected) > 1e-6f;
        }
        CHECK(!worse, "%d of 2000 differ", worse);
    }
    d.albedo[0] = 0.5f, d.albedo[1] = d.albedo[2] = 1;
    isogi_trace_albedo(&d, 10, rgb);
    CHECK(fabsf(rgb[0] - 0.1f) < 1e-6f && fabsf(rgb[2] - 0.6f) < 1e-6f, "multiplied: %g %g", (double)rgb[0], (double)rgb[2]);
    { /* and the light follows it: channel by channel, as albedo alone would give */
        double q[5] = {10, 9, 10, 13, 6};
        scene s = scene_make(21, 20, 19, NULL, pit, q);
        isogi_trace_desc curve = desc_make(&s, 0, 2, 16), plain = desc_make(&s, 0, 2, 16);
        isogi_albedo_point ramp[2] = {{-1e-3, {0.1f, 0.5f, 0.9f}}, {1e-3, {0.1f, 0.5f, 0.9f}}};
        float point[10][3], a[10][3], b[10][3];
        surface_points(&s, 0, 10, 21, point);
        curve.albedo_points = ramp, curve.albedo_count = 2;
        plain.albedo[0] = 0.1f, plain.albedo[1] = 0.5f, plain.albedo[2] = 0.9f;
        isogi_trace_gather(&curve, (const float(*)[3])point, NULL, 10, a, NULL, NULL);
        isogi_trace_gather(&plain, (const float(*)[3])point, NULL, 10, b, NULL, NULL);
        CHECK(!memcmp(a, b, sizeof a), "curve %g %g, plain %g %g", (double)a[0][0], (double)a[0][2], (double)b[0][0], (double)b[0][2]);
        scene_free(&s);
    }
}

/* ---- robustness ---------------------------------------------------------------------------------------------------------- */

typedef struct failing { long calls, fail_at, live; } failing;
static void *failing_alloc(void *user, size_t size, size_t align) {
    failing *f = (failing *)user;
    void *p = NULL;
    if (++f->calls == f->fail_at || posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size)) return NULL;
    f->live++;
    return p;
}
static void failing_release(void *user, void *p, size_t size) {
    (void)size;
    ((failing *)user)->live--;
    free(p);
}

static int survives(const scene *s, const isogi_trace_desc *d, failing *f, const float (*points)[3], int n) {
    isogi_context context;
    isogi_trace *t = NULL;
    float e[20][3];
    isogi_result result;
    memset(&context, 0, sizeof context);
    context.alloc = failing_alloc, context.release = failing_release, context.user = f, context.threads = 1;
    (void)s;
    result = isogi_trace_create(&t, d, &context);
    CHECK((result == ISOGI_OK) == (t != NULL), "create: %d with %p", result, (void *)t);
    if (result == ISOGI_OK) {
        isogi_result asked = isogi_trace_request(t, points, (size_t)n), stepped = isogi_trace_step(t, 0, NULL);
        result = asked != ISOGI_OK ? asked : stepped;
        if (result != ISOGI_OK) { /* one more attempt, now with memory, must bring it to its end */
            CHECK(result == ISOGI_NO_MEMORY, "result %d", result);
            CHECK(isogi_trace_request(t, points, (size_t)n) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "second attempt");
        }
        isogi_trace_sample(t, points, (size_t)n, e, NULL);
        for (int i = 0; i < n && d->mode == ISOGI_TRACE_IRRADIANCE; i++) CHECK(e[i][0] > 0.1f, "E %g after a failure", (double)e[i][0]);
    }
    isogi_trace_free(t);
    if (d->mode == ISOGI_TRACE_IRRADIANCE) {
        float before[20][3];
        memset(e, 0x5a, sizeof e), memcpy(before, e, sizeof e);
        if (isogi_trace_gather(d, points, NULL, (size_t)n, e, NULL, &context) != ISOGI_OK) {
            result = ISOGI_NO_MEMORY;
            CHECK(!memcmp(e, before, sizeof e), "gather wrote although it failed");
        }
    }
    CHECK(f->live == 0, "%ld blocks leaked, failure at %ld", f->live, f->fail_at);
    return result == ISOGI_OK;
}

TEST(every_allocation_may_fail) {
    static float image[8][16][3];
    double q[4] = {7.5, 7.5, 7.5, 5};
    scene s = scene_make(16, 16, 16, NULL, ball, q);
    float points[20][3];
    surface_points(&s, 0, 20, 22, points);
    for (int i = 0; i < 128; i++) image[i / 16][i % 16][0] = image[i / 16][i % 16][1] = image[i / 16][i % 16][2] = i == 37 ? 900 : 1;
    for (int variant = 0; variant < (LONG_SUITE ? 5 : 4); variant++) {
        isogi_trace_desc d = desc_make(&s, 0.5f, 1, 2);
        failing f = {0, 0, 0};
        long k;
        if (variant > 2) d.method = ISOGI_TRACE_FEEDBACK;
        d.lazy = variant == 1 || variant == 4, d.mode = variant == 2 ? ISOGI_TRACE_TRANSFER : ISOGI_TRACE_IRRADIANCE, d.order = 2;
        if (variant < 2)
            memset(&d.lighting.env, 0, sizeof d.lighting.env), d.lighting.env.rgb = &image[0][0][0],
            d.lighting.env.width = 16, d.lighting.env.height = 8;
        for (k = 1; k < 5000; k += LONG_SUITE ? 1 : QUICK_SUITE ? 11 : 5) {
            /* room for a brick's values that is lacking once is asked for again in the same step: that may end well */
            f.calls = 0, f.fail_at = k;
            if (survives(&s, &d, &f, (const float(*)[3])points, 20) && f.calls < k) break;
        }
        CHECK(k > 10 && k < 5000, "variant %d: %ld allocations", variant, k);
    }
    scene_free(&s);
}

/* Scratch is in proportion to the points: for one of them less than 100 KB, for many no more than 256 tasks need. */
typedef struct most_memory { size_t now, most; } most_memory;
static void *most_alloc(void *user, size_t size, size_t align) {
    most_memory *m = (most_memory *)user;
    void *p = NULL;
    m->now += size, m->most = m->now > m->most ? m->now : m->most;
    return posix_memalign(&p, align < sizeof(void *) ? sizeof(void *) : align, size) ? NULL : p;
}
static void most_release(void *user, void *p, size_t size) { ((most_memory *)user)->now -= size, free(p); }
TEST(few_points_take_little_memory) {
    double q[4] = {8, 8, 8, 5};
    scene s = scene_make(17, 17, 17, NULL, ball, q);
    static float points[20000][3], e[2][20000][3];
    size_t most[3];
    int n = surface_points(&s, 0, 2000, 3, points);
    for (int i = n; i < 20000; i++) memcpy(points[i], points[i % n], sizeof points[i]);
    for (int k = 0; k < 3; k++) {
        static const size_t count[3] = {1, 40, 20000};
        most_memory memory = {0, 0};
        isogi_context context = {.alloc = most_alloc, .release = most_release, .user = &memory, .threads = 1};
        isogi_trace_desc d = desc_make(&s, 0.5f, 0, 1);
        CHECK(isogi_trace_gather(&d, (const float(*)[3])points, NULL, count[k], e[k == 2], NULL, &context) == ISOGI_OK, "gather");
        CHECK(!memory.now, "%zu bytes leak", memory.now);
        most[k] = memory.most;
    }
    CHECK(!memcmp(e[0], e[1], 40 * sizeof e[0][0]), "other light with more points");
    printf("    own points: %zu bytes for one, %zu for 40, %zu for 20000\n", most[0], most[1], most[2]);
    CHECK(most[0] < 100000 && most[1] < 1000000 && most[2] < 10000000, "%zu, %zu, %zu bytes", most[0], most[1], most[2]);
    scene_free(&s);
}

typedef struct progress_log { int calls, cancel_at; double last; int rising; } progress_log;
static int progress_count(void *user, double fraction) {
    progress_log *log = (progress_log *)user;
    log->rising = log->rising && fraction > log->last - 1e-12 && fraction < 1 + 1e-12; /* rounding */
    log->last = fraction;
    return ++log->calls == log->cancel_at;
}

TEST(cancelled_bakes_can_go_on) {
    double q[4] = {9.5, 9.5, 9.5, 6};
    scene s = scene_make(20, 20, 20, NULL, ball, q);
    isogi_trace_desc d = desc_make(&s, 0.5f, 1, 8);
    isogi_light sun = light_make(ISOGI_LIGHT_DIRECTIONAL, 1, 2, 0.5, 2, 0.2);
    float points[100][3], first[100][3], e[100][3];
    int n = surface_points(&s, 0, 100, 23, points);
    d.lighting.lights = &sun, d.lighting.light_count = 1;
    for (int way = 0; way < 4; way++) { /* paths and feedback, by one thread and by three */
        const int threads = way % 2 ? 3 : 1;
        isogi_context context;
        progress_log log = {0, 0, 0, 1};
        isogi_trace *t = NULL;
        double remaining = 1;
        int cancelled = 0;
        d.method = way < 2 ? ISOGI_TRACE_PATHS : ISOGI_TRACE_FEEDBACK;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, first);
        memset(&context, 0, sizeof context);
        context.progress = progress_count, context.user = &log, context.threads = threads;
        isogi_trace_create(&t, &d, &context);
        for (int i = 0; i < 1000; i++) {
            isogi_result result;
            double before = remaining;
            log.calls = 0, log.cancel_at = i < 10 ? 1 + (way < 2 ? 0 : i % 3) : 0;
            if (way >= 2) log.last = 0; /* feedback begins a batch anew */
            result = isogi_trace_step(t, 0, &remaining);
            cancelled += result == ISOGI_CANCELLED;
            CHECK(result == ISOGI_OK || remaining >= before, "a cancelled step wrote %g", remaining);
            if (result == ISOGI_OK) break;
        }
        /* other threads may finish everything before the first report */
        CHECK((threads > 1 || cancelled == 10) && remaining <= 0, "cancelled %d times, remaining %g", cancelled, remaining);
        CHECK(log.rising && log.last > 0.9, "progress went back or ended at %g", log.last);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
        CHECK(!memcmp(e, first, sizeof e), "%d threads: other bits after cancelling", threads);
        isogi_trace_free(t);
        log.calls = 0, log.cancel_at = 1, context.threads = 1;
        memset(e, 0x5a, sizeof e);
        CHECK(isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)n, e, NULL, &context) == ISOGI_CANCELLED, "gather");
    }
    scene_free(&s);
}

/* Steps that are all cancelled when little is done bring the bake to its end. */
SLOW_TEST(steps_that_are_always_cancelled_get_on) {
    double q[5] = {12, 11, 12, 15, 7};
    scene s = scene_make(25, 24, 23, NULL, pit, q);
    float points[100][3], first[100][3], e[100][3];
    int n = surface_points(&s, 0, 100, 23, points);
    for (int way = 0; way < 4; way++) {
        isogi_trace_desc d = desc_make(&s, 0.7f, -1, 16);
        progress_log log = {0, 0, 0, 1};
        isogi_context context = {.threads = 1, .progress = progress_count, .user = &log};
        isogi_trace *t = NULL;
        isogi_result result = ISOGI_CANCELLED;
        int steps = 0;
        d.method = way % 2 ? ISOGI_TRACE_PATHS : ISOGI_TRACE_FEEDBACK, d.lazy = way >= 2;
        bake_and_sample(&d, NULL, (const float(*)[3])points, n, first);
        isogi_trace_create(&t, &d, &context), isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
        for (; result == ISOGI_CANCELLED && steps < 1000; steps++) {
            log.calls = 0, log.cancel_at = 12, log.last = 0;
            result = isogi_trace_step(t, 0, NULL);
        }
        CHECK(result == ISOGI_OK && steps > 2, "way %d: %s after %d steps", way, isogi_result_string(result), steps);
        isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, NULL);
        CHECK(!memcmp(e, first, sizeof e), "way %d: other bits", way);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

static int refused(const isogi_trace_desc *d, isogi_result expected) {
    isogi_trace *t = (isogi_trace *)(void *)&t;
    isogi_result result = isogi_trace_create(&t, d, NULL);
    return result == expected && t == (isogi_trace *)(void *)&t;
}

TEST(bad_input_is_refused) {
    double q[4] = {7.5, 7.5, 7.5, 5}, nan = nan_value();
    scene s = scene_make(16, 16, 16, NULL, ball, q);
    isogi_trace_desc good = desc_make(&s, 0.5f, 1, 2), d;
    isogi_albedo_point points[2] = {{1, {0, 0, 0}}, {1, {0, 0, 0}}};
    isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 1, 2, 3, 1, 0);
    isogi_trace *t = NULL;
    float p[1][3] = {{(float)nan, 1, 1}}, e[1][3] = {{5, 5, 5}}, error[1];
#define REFUSED(change, result)                                                                                                  \
    do {                                                                                                                         \
        d = good;                                                                                                                \
        change;                                                                                                                  \
        CHECK(refused(&d, result), "%s", #change);                                                                               \
        CHECK(fault_names(isogi_trace_fault(&d), #change), "%s: %s", #change, isogi_trace_fault(&d));                            \
    } while (0)
    REFUSED(d.pyramid = NULL, ISOGI_INVALID);
    REFUSED(d.albedo[1] = 1.5f, ISOGI_INVALID);
    REFUSED(d.albedo[1] = -0.1f, ISOGI_INVALID);
    REFUSED(d.albedo[2] = (float)nan, ISOGI_INVALID);
    REFUSED((d.albedo_points = points, d.albedo_count = 2), ISOGI_INVALID);
    REFUSED(d.albedo_count = 2, ISOGI_INVALID);
    REFUSED(d.bounces = -2, ISOGI_INVALID);
    REFUSED(d.samples = -1, ISOGI_INVALID);
    REFUSED(d.order = 7, ISOGI_INVALID);
    REFUSED(d.offset = (float)nan, ISOGI_INVALID);
    REFUSED(d.offset = 1.5f, ISOGI_INVALID);
    REFUSED(d.isovalue_min = 1, ISOGI_INVALID);
    REFUSED(d.isovalue_max = nan, ISOGI_INVALID);
    REFUSED(d.lattice_max[0] = 15.5, ISOGI_INVALID);
    REFUSED(d.lattice_min[0] = nan, ISOGI_INVALID);
    REFUSED(d.lattice[2] = (size_t)1 << 31, ISOGI_TOO_LARGE);
    REFUSED((d.lattice[0] = d.lattice[1] = d.lattice[2] = 0x7fffffff), ISOGI_TOO_LARGE);
    REFUSED(d.mode = (isogi_trace_mode)2, ISOGI_INVALID);
    REFUSED(d.transfer_channels = 2, ISOGI_INVALID);
    REFUSED(d.lookup = (isogi_trace_lookup)4, ISOGI_INVALID);
    REFUSED((d.mode = ISOGI_TRACE_TRANSFER, d.lighting.lights = &lamp, d.lighting.light_count = 1), ISOGI_INVALID);
    REFUSED(d.lighting.light_count = 1, ISOGI_INVALID);
    REFUSED(d.method = (isogi_trace_method)2, ISOGI_INVALID);
    REFUSED(d.error = -1, ISOGI_INVALID);
    REFUSED(d.normals = (isogi_normal_kind)2, ISOGI_INVALID);
    REFUSED(d.sides = (isogi_trace_sides)3, ISOGI_INVALID);
    REFUSED(d.reach = (float)nan, ISOGI_INVALID);
    REFUSED(d.hierarchy = -1, ISOGI_INVALID);
    REFUSED((d.hierarchy = 0.5f, d.lazy = 1), ISOGI_INVALID);
    REFUSED((d.hierarchy = 0.5f, d.box_end[0] = d.box_end[1] = d.box_end[2] = 8), ISOGI_INVALID);
    REFUSED(d.storage = (isogi_trace_format)9, ISOGI_INVALID);
    REFUSED((d.storage = ISOGI_TRACE_RGB9E5, d.mode = ISOGI_TRACE_TRANSFER), ISOGI_INVALID);
    REFUSED(d.emission_count = 1, ISOGI_INVALID);
    REFUSED((d.emission_count = 1, d.emission_points = points, d.mode = ISOGI_TRACE_TRANSFER), ISOGI_INVALID);
    REFUSED(d.box_end[1] = 17, ISOGI_INVALID);
    REFUSED((d.box_first[1] = 5, d.box_end[1] = 4), ISOGI_INVALID);
    REFUSED(d.lattice_min[2] = -0.5, ISOGI_INVALID);
    REFUSED((d.lattice_min[2] = 8, d.lattice_max[2] = 7, d.lattice_max[0] = d.lattice_max[1] = 9), ISOGI_INVALID);
    REFUSED(d.lighting.env.rotation[3] = 1, ISOGI_INVALID);
    CHECK(!isogi_trace_fault(&good) && isogi_trace_fault(NULL), "nothing is wrong with it: %s", isogi_trace_fault(&good));
    CHECK(isogi_trace_create(NULL, &good, NULL) == ISOGI_INVALID && isogi_trace_create(&t, NULL, NULL) == ISOGI_INVALID, "NULL");
    CHECK(isogi_trace_step(NULL, 0, NULL) == ISOGI_INVALID && isogi_trace_request(NULL, NULL, 0) == ISOGI_INVALID, "NULL texture");
    isogi_trace_free(NULL);
    CHECK(isogi_trace_create(&t, &good, NULL) == ISOGI_OK, "good");
    CHECK(isogi_trace_relight(t, &(isogi_lighting){.light_count = 1}) == ISOGI_INVALID, "lights that are not there");
    CHECK(isogi_trace_sample_transfer(t, (const float(*)[3])p, 1, e[0]) == ISOGI_INVALID, "transfer of irradiance");
    CHECK(isogi_trace_sample(t, NULL, 1, e, NULL) == ISOGI_INVALID &&
              isogi_trace_sample(t, (const float(*)[3])p, 1, NULL, NULL) == ISOGI_INVALID,
          "NULL points");
    CHECK(isogi_trace_sample(t, (const float(*)[3])p, 1, e, error) == ISOGI_OK, "NaN point: a lookup that is not ready, no crash");
    isogi_trace_free(t);
    CHECK(isogi_trace_gather(&good, (const float(*)[3])p, NULL, 1, e, error, NULL) == ISOGI_OK && e[0][0] <= 0 && error[0] > 1e30f,
          "NaN point: E %g", (double)e[0][0]);
    p[0][0] = 1e30f;
    CHECK(isogi_trace_gather(&good, (const float(*)[3])p, NULL, 1, e, error, NULL) == ISOGI_OK, "far point");
    good.mode = ISOGI_TRACE_TRANSFER;
    CHECK(isogi_trace_gather(&good, (const float(*)[3])p, NULL, 1, e, error, NULL) == ISOGI_INVALID, "gathering transfer");
    scene_free(&s);
}

/* NaN and infinite voxels make their cells empty; the rest is lit, and no lookup is anything but a number. */
TEST(voxels_that_are_not_finite) {
    double q[4] = {9.5, 9.5, 9.5, 6};
    scene s = scene_make(20, 20, 20, NULL, ball, q);
    float points[200][3], e[200][3];
    isogi_trace_desc d;
    int n;
    for (int i = 0; i < 8000; i += 37) s.data[i] = i % 2 ? (float)nan_value() : (i % 3 ? HUGE_VALF : -HUGE_VALF);
    isogi_vol_free(s.pyramid);
    isogi_vol_build(&s.pyramid, &s.volume, NULL);
    d = desc_make(&s, 0.9f, -1, 8);
    n = surface_points(&s, 0, 200, 24, points);
    CHECK(n == 200, "%d points", n);
    bake_and_sample(&d, NULL, (const float(*)[3])points, n, e);
    for (int i = 0; i < n; i++) CHECK(e[i][0] >= 0 && e[i][0] < 100, "point %d: E %g", i, (double)e[i][0]);
    scene_free(&s);
}

/* ---- real data ----------------------------------------------------------------------------------------------------------- */

static uint8_t *read_file_of(const char *name, size_t bytes) {
    char *path = test_data(name);
    FILE *file = path ? fopen(path, "rb") : NULL;
    uint8_t *data = (uint8_t *)malloc(bytes);
    size_t read = file ? fread(data, 1, bytes, file) : 0;
    if (file) fclose(file);
    free(path);
    if (read == bytes) return data;
    free(data);
    return NULL;
}

/* Rays of the standard view that hit; their points. */
static int view_points(const isogi_pyramid *p, double isovalue, int size, float (*points)[3]) {
    const isogi_volume *v = isogi_vol_volume(p);
    double centre[3], radius = 0, eye[3], forward[3] = {-1.5, -1.2, -2.0}, right[3], up[3], n = length3(1.5, 1.2, 2.0);
    int count = 0;
    for (int a = 0; a < 3; a++) centre[a] = 0.5 * v->spacing[a] * (double)(v->size[a] - 1), radius += centre[a] * centre[a];
    for (int a = 0; a < 3; a++) forward[a] /= n, eye[a] = centre[a] - forward[a] * sqrt(radius) / sin(PI / 8);
    right[0] = -forward[2], right[1] = 0, right[2] = forward[0], n = length3(right[0], 0, right[2]);
    for (int a = 0; a < 3; a++) right[a] /= n;
    up[0] = right[1] * forward[2] - right[2] * forward[1], up[1] = right[2] * forward[0] - right[0] * forward[2],
    up[2] = right[0] * forward[1] - right[1] * forward[0];
    for (int i = 0; i < size * size; i++) {
        isogi_ray ray;
        isogi_hit hit = {0};
        double x = (2 * (i % size + 0.5) / size - 1) * tan(PI / 8), y = (1 - 2 * (i / size + 0.5) / size) * tan(PI / 8);
        memset(&ray, 0, sizeof ray);
        for (int a = 0; a < 3; a++) ray.origin[a] = eye[a], ray.dir[a] = (float)(forward[a] + x * right[a] + y * up[a]);
        ray.isovalue = isovalue;
        isogi_vol_intersect(p, &ray, 1, &hit, NULL);
        if (!hit.side) continue;
        isogi_vol_positions(p, &hit, 1, (float(*)[3])points[count++]);
    }
    return count;
}

/* What a viewer sees of real scans: every lookup on a visible surface is ready, and next to none is black: under a white sky with
   albedo 0.7 even grooves are lit. Invalid texels that crept in would show as black or as specks brighter than the open sky. */
static void real_volume(const char *name, size_t x, size_t y, size_t z, double isovalue) {
    uint8_t *data = read_file_of(name, x * y * z);
    isogi_volume v;
    isogi_pyramid *p = NULL;
    isogi_trace *t = NULL;
    isogi_trace_desc d;
    static float points[160 * 160][3], e[160 * 160][3], error[160 * 160];
    int size = LONG_SUITE ? 160 : 48, n, dark = 0, bright = 0, unready = 0, wrong = 0;
    double sum = 0;
    if (!data) SKIP("ISOGI_DATA is not set");
    memset(&v, 0, sizeof v), memset(&d, 0, sizeof d);
    v.data = data, v.size[0] = x, v.size[1] = y, v.size[2] = z;
    isogi_vol_build(&p, &v, NULL);
    n = view_points(p, isovalue, size, points);
    d.pyramid = p, d.lazy = 1, d.samples = 16, d.bounces = -1, d.lighting.env.sh = white_sky, d.lighting.env.sh_order = 1;
    d.albedo[0] = d.albedo[1] = d.albedo[2] = 0.7f;
    isogi_trace_create(&t, &d, NULL);
    isogi_trace_request(t, (const float(*)[3])points, (size_t)n);
    CHECK(isogi_trace_step(t, 0, NULL) == ISOGI_OK, "step");
    isogi_trace_sample(t, (const float(*)[3])points, (size_t)n, e, error);
    for (int i = 0; i < n; i++) {
        sum += (double)e[i][1] / n;
        bright += (double)e[i][1] > 1.02 * PI, unready += error[i] > 1e30f;
        if (e[i][1] < 0.05f) memcpy(points[dark++], points[i], sizeof points[i]);
    }
    /* what is dark must be so: paths from the very point find no light either (the scan is cut open: one looks into it) */
    d.samples = 256;
    CHECK(isogi_trace_gather(&d, (const float(*)[3])points, NULL, (size_t)dark, e, NULL, NULL) == ISOGI_OK, "gather");
    for (int i = 0; i < dark; i++) wrong += e[i][1] > 0.5f;
    printf("    %d points, %d dark, of which %d should not be; mean E %.3f\n", n, dark, wrong, sum);
    CHECK(n > size * size / 10 && unready == 0 && bright == 0 && wrong == 0,
          "%d points: %d not ready, %d dark of which %d should not be, %d too bright", n, unready, dark, wrong, bright);
    CHECK(dark * 100 <= n, "%d of %d points are dark", dark, n);
    isogi_trace_free(t), isogi_vol_free(p), free(data);
}

TEST(scans_have_no_specks) {
    real_volume("engine_256x256x128_uint8.raw", 256, 256, 128, 80);
    if (LONG_SUITE) real_volume("bonsai_256x256x256_uint8.raw", 256, 256, 256, 40);
}

/* Points of a cap are floats, and may lie beside it by their rounding. */
TEST(points_on_caps_look_out_of_the_box) {
    static float data[16 * 16 * 16];
    const isogi_light sun = {.vector = {1, 0, 0}, .rgb = {1, 1, 1}};
    for (int i = 0; i < 16 * 16 * 16; i++) data[i] = (float)(i / 16 % 16 + 1);
    for (int k = 0; k < 12; k++) {
        const double edge = 0.3 + 0.05 * k;
        const isogi_volume v = {
            .data = data, .type = ISOGI_F32, .size = {16, 16, 16}, .spacing = {edge, edge, edge}, .origin = {-3.3, 0, 0}};
        isogi_pyramid *pyramid = NULL;
        isogi_trace_desc d = {.samples = 4, .capped = 1, .lighting = {.lights = &sun, .light_count = 1}};
        isogi_ray ray[32];
        isogi_hit hit[32];
        float point[32][3], e[32][3];
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        d.pyramid = pyramid, memset(ray, 0, sizeof ray);
        for (int i = 0; i < 32; i++) {
            ray[i].origin[0] = 20, ray[i].origin[1] = 0.5 + 0.1 * i, ray[i].origin[2] = 1 + 0.06 * i, ray[i].dir[0] = -1;
            ray[i].isovalue = 0.5, ray[i].flags = ISOGI_RAY_CAPPED;
        }
        isogi_vol_intersect(pyramid, ray, 32, hit, NULL), isogi_vol_positions(pyramid, hit, 32, point);
        CHECK(isogi_trace_gather(&d, (const float(*)[3])point, NULL, 32, e, NULL, NULL) == ISOGI_OK, "gather");
        for (int i = 0; i < 32; i++)
            CHECK(fabs((double)e[i][0] - 1) < 1e-3, "spacing %g, point %d, hit %d: %g", edge, i, hit[i].side, (double)e[i][0]);
        isogi_vol_free(pyramid);
    }
}

/* What comes out of matter meets the cap at a place that is there but for a rounding in double, also where the border lies at 0, and no
   float is as near. The lamp stands above, in the cap's plane: its light falls on the ground alone. */
TEST(points_where_rays_come_out_of_caps_are_on_them) {
    enum { RAYS = 200 };
    static float data[9 * 9 * 9], point[RAYS][3], e[RAYS][3];
    const isogi_light lamp = {.vector = {0, 0, 1}, .rgb = {10, 10, 10}};
    test_random r = {5};
    int beside = 0, met = 0;
    for (int i = 0; i < 9 * 9 * 9; i++) data[i] = 4.5f - (float)(i / 81) + 0.1f * (float)(i % 9);
    for (int k = 0; k < 6; k++) {
        const double edge = 0.31 + 0.1 * k;
        const isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {9, 9, 9}, .spacing = {edge, edge, edge}};
        isogi_trace_desc d = {.samples = 4, .capped = 1,
                              .lighting = {.env = {.sh = white_sky, .sh_order = 1}, .lights = &lamp, .light_count = 1}};
        isogi_pyramid *pyramid = NULL;
        int n = 0;
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        d.pyramid = pyramid;
        while (n < RAYS) {
            isogi_ray ray = {.flags = ISOGI_RAY_CAPPED};
            isogi_hit hit;
            for (int a = 0; a < 3; a++) {
                ray.origin[a] = edge * random_range(&r, 2, a == 2 ? 4 : 6);
                ray.dir[a] = (float)random_range(&r, a == 1 ? -1.2 : -0.2, a == 1 ? -0.6 : 0.2);
            }
            isogi_vol_intersect(pyramid, &ray, 1, &hit, NULL);
            if (hit.side == -2) isogi_vol_positions(pyramid, &hit, 1, &point[n]), beside += fabsf(point[n++][1]) > 0;
        }
        CHECK(isogi_trace_gather(&d, (const float(*)[3])point, NULL, RAYS, e, NULL, NULL) == ISOGI_OK, "gather");
        for (int i = 0; i < RAYS; i++) {
            if (point[i][1] > 1e-6f) continue; /* of another face */
            met++;
            CHECK(fabs((double)e[i][0] - PI) < 1e-3, "spacing %g, at %g %g %g: %g", edge, (double)point[i][0], (double)point[i][1],
                  (double)point[i][2], (double)e[i][0]);
        }
        isogi_vol_free(pyramid);
    }
    CHECK(met > 3 * RAYS && beside > 50, "%d points, of which %d lie beside the cap", met, beside);
}

/* Where the field is the same all along the cap's normal, the rounding of turned axes must not say whether there is matter behind. */
TEST(caps_of_turned_volumes_have_a_high_side) {
    static float data[9 * 9 * 9];
    for (int i = 0; i < 9 * 9 * 9; i++) data[i] = 4.5f - (float)(i / 9 % 9) + 0.1f * (float)(i % 9);
    for (int k = 0; k < 12; k++) {
        const double angle = 0.2 * k;
        isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {9, 9, 9}};
        isogi_trace_desc d = {.sides = ISOGI_TRACE_HIGH_SIDE, .capped = 1, .samples = 4, .reach = 2,
                              .lighting = {.env = {.sh = white_sky, .sh_order = 1}}};
        isogi_pyramid *pyramid = NULL;
        isogi_trace *t = NULL;
        int valid = 0;
        v.axes[0] = v.axes[8] = cos(angle), v.axes[2] = sin(angle), v.axes[6] = -sin(angle), v.axes[4] = 1;
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        d.pyramid = pyramid;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
        for (size_t i = 0; i < 49; i++) valid += isogi_trace_valid(t, (const size_t[3]){1 + i % 7, 1 + i / 7, 8});
        CHECK(valid == 49, "turned by %g: %d texels of 49", angle, valid);
        isogi_trace_free(t), isogi_vol_free(pyramid);
    }
}

/* Where grid axes are none of the world's, an infinite point is infinite along each of them. */
TEST(infinite_points_have_no_light_on_caps) {
    static float data[8 * 8 * 8];
    const float point[2][3] = {{HUGE_VALF, 1, 1}, {1, -HUGE_VALF, HUGE_VALF}};
    isogi_volume v = {.data = data, .type = ISOGI_F32, .size = {8, 8, 8}};
    const double axes[9] = {2 / 3.0, 2 / 3.0, 1 / 3.0, -2 / 3.0, 1 / 3.0, 2 / 3.0, 1 / 3.0, -2 / 3.0, 2 / 3.0};
    isogi_pyramid *pyramid = NULL;
    isogi_trace_desc d = {.samples = 4, .capped = 1, .lighting = {.env = {.sh = white_sky, .sh_order = 1}}};
    float e[2][3], error[2];
    for (int i = 0; i < 512; i++) data[i] = (float)(i % 8 + 1);
    memcpy(v.axes, axes, sizeof axes);
    CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
    d.pyramid = pyramid;
    CHECK(isogi_trace_gather(&d, point, NULL, 2, e, error, NULL) == ISOGI_OK, "gather");
    for (int i = 0; i < 2; i++) CHECK(!(e[i][0] > 0) && error[i] > 1e30f, "point %d: %g, error %g", i, (double)e[i][0], (double)error[i]);
    isogi_vol_free(pyramid);
}

static double noise_around_a_voxel(const double x[3], const double *parameter) {
    test_random r = {(uint64_t)(x[0] + 100 * x[1] + 10000 * x[2])};
    (void)parameter;
    return length3(x[0] - 6, x[1] - 6, x[2] - 6) < 0.5 ? 10 : random_unit(&r);
}

/* A lamp in a voxel that is matter at every isovalue below lights nothing: not where the smoothed normal points into matter, either. */
TEST(a_lamp_within_matter_lights_nothing) {
    enum { POINTS = 4000, LATTICE = 23 };
    static float points[POINTS][3], light[POINTS][3], texels[LATTICE * LATTICE * LATTICE][3];
    test_random r = {1};
    scene s = scene_make(12, 12, 12, NULL, noise_around_a_voxel, NULL);
    isogi_light lamp = {.kind = ISOGI_LIGHT_POINT, .vector = {6, 6, 6}, .rgb = {10, 10, 10}};
    isogi_trace_desc d = {.pyramid = s.pyramid, .lighting = {.lights = &lamp, .light_count = 1}, .samples = 4, .capped = 1};
    for (int i = 0; i < POINTS;) {
        float value;
        for (int a = 0; a < 3; a++) points[i][a] = (float)random_range(&r, 3, 9);
        isogi_vol_sample(s.pyramid, (const float(*)[3])&points[i], 1, &value, NULL);
        i += value < 1;
    }
    CHECK(isogi_trace_gather(&d, (const float(*)[3])points, NULL, POINTS, light, NULL, NULL) == ISOGI_OK, "%d points", POINTS);
    for (int i = 0; i < POINTS; i++)
        CHECK(!(light[i][1] > 0), "at %g %g %g: E %g", (double)points[i][0], (double)points[i][1], (double)points[i][2],
              (double)light[i][1]);
    for (int a = 0; a < 3; a++) d.lattice[a] = LATTICE, d.lattice_min[a] = 0.13, d.lattice_max[a] = 10.91;
    for (int method = ISOGI_TRACE_FEEDBACK; method <= ISOGI_TRACE_PATHS; method++) {
        isogi_trace *t = NULL;
        long valid = 0;
        d.method = (isogi_trace_method)method;
        CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                  isogi_trace_export(t, ISOGI_TRACE_FLOAT, texels, sizeof texels) == ISOGI_OK,
              "method %d", method);
        for (size_t i = 0; i < LATTICE * LATTICE * LATTICE; i++) {
            const size_t texel[3] = {i % LATTICE, i / LATTICE % LATTICE, i / LATTICE / LATTICE};
            float at[1][3], value;
            for (int a = 0; a < 3; a++) at[0][a] = (float)(0.13 + 0.49 * (double)texel[a]);
            isogi_vol_sample(s.pyramid, (const float(*)[3])at, 1, &value, NULL);
            if (!isogi_trace_valid(t, texel) || !(value < 1)) continue;
            valid++;
            CHECK(!(texels[i][1] > 0), "method %d, texel %zu: E %g", method, i, (double)texels[i][1]);
        }
        CHECK(valid > 10000, "%ld texels", valid);
        isogi_trace_free(t);
    }
    scene_free(&s);
}

static double rises_with_x(const double x[3], const double *parameter) { return (void)parameter, x[0]; }

/* A cap faces out of the box, wherever rays start: with an offset or on the surface, where the field rises towards it, too. */
TEST(caps_face_outwards_wherever_rays_start) {
    const float offset[3] = {0, 1, -1}, point[1][3] = {{9, 4.5f, 5.25f}};
    scene s = scene_make(10, 10, 10, NULL, rises_with_x, NULL);
    isogi_light sun = {.kind = ISOGI_LIGHT_DIRECTIONAL, .vector = {1, 0, 0}, .rgb = {1, 1, 1}};
    isogi_trace_desc d = {.pyramid = s.pyramid, .lighting = {.lights = &sun, .light_count = 1}, .samples = 4, .capped = 1};
    for (int o = 0; o < 3; o++)
        for (int method = -1; method <= ISOGI_TRACE_PATHS; method++) {
            isogi_trace *t = NULL;
            float e[1][3] = {{0, 0, 0}};
            d.offset = offset[o], d.method = (isogi_trace_method)(method < 0 ? 0 : method);
            if (method < 0) CHECK(isogi_trace_gather(&d, point, NULL, 1, e, NULL, NULL) == ISOGI_OK, "offset %g", (double)offset[o]);
            else {
                CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK &&
                          isogi_trace_sample(t, point, 1, e, NULL) == ISOGI_OK,
                      "offset %g, method %d", (double)offset[o], method);
                isogi_trace_free(t);
            }
            CHECK(fabs((double)e[0][1] - 1) < 1e-4, "offset %g, method %d: E %g", (double)offset[o], method, (double)e[0][1]);
        }
    scene_free(&s);
}

/* Of texels whose isovalues are equally close, the nearest is read. */
TEST(of_equal_isovalues_the_nearest_texel_is_read) {
    double q[1] = {4.5};
    scene s = scene_make(9, 9, 9, NULL, ground, q);
    const isogi_light lamp = light_make(ISOGI_LIGHT_POINT, 1, 12, 2, 300, 0);
    isogi_trace_desc d = desc_make(&s, 0, 0, 1);
    isogi_trace *t = NULL;
    memset(&d.lighting, 0, sizeof d.lighting);
    d.lighting.lights = &lamp, d.lighting.light_count = 1, d.lookup = ISOGI_TRACE_CLOSEST_ISOVALUE;
    CHECK(isogi_trace_create(&t, &d, NULL) == ISOGI_OK && isogi_trace_step(t, 0, NULL) == ISOGI_OK, "bake");
    for (int i = 0; i < 64; i++) {
        const float x = (float)(i % 4) / 3, z = (float)(i / 4 % 4) / 3, at = (float)(2 + i / 16);
        const float near_x = x < 0.5f ? at : at + 1, near_z = z < 0.5f ? 3 : 4;
        const float points[2][3] = {{at + 0.1f + 0.8f * x, 4, 3.1f + 0.8f * z}, {near_x, 4, near_z}};
        float e[2][3];
        CHECK(isogi_trace_sample(t, points, 2, e, NULL) == ISOGI_OK && e[1][0] > 0.1f && !memcmp(e[0], e[1], sizeof e[0]),
              "at %g %g: light %g, of the nearest texel %g", (double)points[0][0], (double)points[0][2], (double)e[0][0], (double)e[1][0]);
    }
    isogi_trace_free(t), scene_free(&s);
}

TEST_MAIN("trace")
