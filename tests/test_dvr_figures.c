/* Figures of Kraus 2005 that test_dvr_data.c leaves out, as numbers: shading (2), constant transfer functions and their limit (3), the
   approximation of silhouettes (5), tetrahedra (8e, 8f). As pictures they come from examples/figures_scale_invariant.sh. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "dvr_fields.h"
#include "procedural.h"

enum { SIDE = 32, PIXELS = SIDE * SIDE };

typedef struct coulomb { isogi_volume volume; isogi_pyramid *pyramid; isogi_view view; } coulomb;

static coulomb three_potentials(size_t n) {
    coulomb c = {.volume = {.data = NULL}};
    CHECK(procedural_make(procedural_find("coulomb"), n, &c.volume, &serial) == ISOGI_OK &&
              isogi_vol_build(&c.pyramid, &c.volume, &serial) == ISOGI_OK,
          "volume");
    c.view = (isogi_view){.width = SIDE, .height = SIDE, .fov = 40};
    for (int a = 0; a < 3; a++)
        c.view.target[a] = 0.5f * (float)(n - 1), c.view.eye[a] = c.view.target[a] + (float)n * (a == 2 ? 1.5f : 0.2f);
    return c;
}

static void free_potentials(coulomb *c) { isogi_vol_free(c->pyramid), procedural_free(&c->volume); }

static const isogi_peak figure_sheets[2] = {{0.72, {.15f, .3f, .9f}, 0.35f}, {1.5, {.9f, .15f, .1f}, 0.7f}};
static const isogi_transfer both_sheets = {NULL, 0, figure_sheets, 2};

/* Uniform colour becomes shape: the same opacity in every pixel, and light that varies where there was none of that. */
TEST(figure_2_shading_gives_shape_to_surfaces_of_uniform_opacity) {
    coulomb c = three_potentials(48);
    const isogi_light sun = {.vector = {0.4f, 0.7f, 1}, .rgb = {3, 3, 3}};
    const isogi_lighting lighting = {.lights = &sun, .light_count = 1};
    float(*image[2])[4];
    double sum[2] = {0, 0}, square[2] = {0, 0};
    int count = 0;
    for (int lit = 0; lit < 2; lit++) {
        const isogi_dvr_desc desc = {.pyramid = c.pyramid, .space = ISOGI_DVR_DATA, .shading = lit ? ISOGI_DVR_LOCAL : ISOGI_DVR_UNLIT};
        isogi_dvr *dvr = dvr_new(&desc, &both_sheets);
        image[lit] = picture(dvr, &c.view, &lighting, NULL, NULL), isogi_dvr_free(dvr);
    }
    for (int i = 0; i < PIXELS; i++) {
        CHECK(fabsf(image[0][i][3] - image[1][i][3]) < 1e-6f, "pixel %d: opacity %g, with light %g", i, (double)image[0][i][3],
              (double)image[1][i][3]);
        if (fabs((double)image[0][i][3] - (1 - 0.65 * 0.65)) > 1e-4) continue; /* through the blue sheet twice and nothing else */
        for (int k = 0; k < 2; k++) sum[k] += (double)image[k][i][2], square[k] += pow((double)image[k][i][2], 2);
        count++;
    }
    for (int k = 0; k < 2; k++) sum[k] /= count, square[k] = sqrt(fmax(0, square[k] / count - sum[k] * sum[k])) / sum[k];
    printf("    %d pixels of the outer surface: spread of blue %.2g without light, %.2g with it\n", count, square[0], square[1]);
    CHECK(count > 50 && square[0] < 1e-4 && square[1] > 0.1, "%d pixels, %g, %g", count, square[0], square[1]);
    free(image[0]), free(image[1]), free_potentials(&c);
}

/* A constant transfer function shows where the data varies, most at the poles of the potentials; the set of sheets that stands for it
   comes nearer as 1 / N. */
TEST(figure_3_sheets_approach_the_constant_transfer_function) {
    coulomb c = three_potentials(48);
    const isogi_transfer_point constant = {0, {.85f, .85f, .9f}, 0.9f};
    const isogi_transfer whole = {&constant, 1, NULL, 0};
    const isogi_dvr_desc desc = {.pyramid = c.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1};
    isogi_dvr *dvr = dvr_new(&desc, &whole);
    float(*limit)[4] = picture(dvr, &c.view, NULL, NULL, NULL);
    isogi_peak *peaks = (isogi_peak *)malloc(4800 * sizeof *peaks);
    double error[3], darkest = 1, brightest = 0, range[2];
    isogi_vol_range(c.pyramid, range);
    CHECK(range[0] > 0 && range[1] < 24, "data from %g to %g", range[0], range[1]);
    for (int n = 0; n < 3; n++) {
        const int counts[3] = {48, 480, 4800};
        double gap = 24.0 / counts[n];
        for (int i = 0; i < counts[n]; i++) peaks[i] = (isogi_peak){(i + 0.5) * gap, {.85f, .85f, .9f}, (float)-expm1(-0.9 * gap)};
        const isogi_transfer set = {NULL, 0, peaks, (size_t)counts[n]};
        CHECK(isogi_dvr_set_transfer(dvr, &set) == ISOGI_OK, "%d sheets", counts[n]);
        float(*image)[4] = picture(dvr, &c.view, NULL, NULL, NULL);
        error[n] = rms_difference(image, limit, PIXELS), free(image);
    }
    for (int i = 0; i < PIXELS; i++) darkest = fmin(darkest, (double)limit[i][3]), brightest = fmax(brightest, (double)limit[i][3]);
    printf("    RMSE of 48, 480, 4800 sheets: %.2g %.2g %.2g; opacity of the limit %.2g to %.2g\n", error[0], error[1], error[2], darkest,
           brightest);
    CHECK(error[1] < 0.2 * error[0] && error[2] < 0.2 * error[1] && error[2] < 4e-3, "%g %g %g", error[0], error[1], error[2]);
    CHECK(brightest > darkest + 0.5, "opacity from %g to %g", darkest, brightest);
    free(peaks), free(limit), isogi_dvr_free(dvr), free_potentials(&c);
}

/* Eq. 16 for eq. 15: never less opaque, the same to second order where a surface is faced, too opaque near the silhouettes. */
TEST(figure_5_the_approximation_is_too_opaque_near_silhouettes_only) {
    coulomb c = three_potentials(48);
    const isogi_peak faint = {0.72, {.15f, .3f, .9f}, 0.05f};
    const isogi_transfer surface = {NULL, 0, &faint, 1};
    float(*image[3])[4];
    double faced = 0, rim = 0;
    for (int kind = 0; kind < 3; kind++) {
        const isogi_dvr_desc desc = {.pyramid = c.pyramid, .space = ISOGI_DVR_DATA, .opaque = 1, .silhouette = (isogi_dvr_silhouette)kind};
        isogi_dvr *dvr = dvr_new(&desc, &surface);
        image[kind] = picture(dvr, &c.view, NULL, NULL, NULL), isogi_dvr_free(dvr);
    }
    for (int i = 0; i < PIXELS; i++) {
        double plain = (double)image[0][i][3], exact = (double)image[1][i][3], difference = (double)image[2][i][3] - exact;
        CHECK(difference > -1e-6, "pixel %d: %g less", i, -difference);
        if (plain > 0 && exact < 1.5 * plain) faced = fmax(faced, difference);
        else rim = fmax(rim, difference);
    }
    printf("    largest difference where the surface is faced %.3g, near silhouettes %.3g\n", faced, rim);
    CHECK(faced < 0.005 && rim > 5 * faced && rim > 0.02, "faced %g, rim %g", faced, rim);
    for (int k = 0; k < 3; k++) free(image[k]);
    free_potentials(&c);
}

/* ---- figure 8e, 8f ---- */

/* Cells split into five tetrahedra, parity alternating, so that neighbours share their faces. */
static isogi_tets *split(const isogi_volume *v, float (*points)[3], float *values, uint32_t (*tets)[4], size_t *count) {
    static const uint8_t corner[2][5][4] = {{{0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}, {1, 2, 4, 7}},
                                            {{1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}}};
    const size_t n = v->size[0];
    isogi_tets *built = NULL;
    *count = 0;
    for (size_t i = 0; i < n * n * n; i++) {
        const size_t c[3] = {i % n, i / n % n, i / n / n};
        for (int a = 0; a < 3; a++) points[i][a] = (float)c[a];
        values[i] = ((const float *)v->data)[i];
        if (c[0] + 1 == n || c[1] + 1 == n || c[2] + 1 == n) continue;
        for (int t = 0; t < 5; t++, ++*count)
            for (int k = 0; k < 4; k++) {
                size_t b = corner[(c[0] + c[1] + c[2]) % 2][t][k];
                tets[*count][k] = (uint32_t)(i + (b & 1) + n * ((b >> 1 & 1) + n * (b >> 2)));
            }
    }
    const isogi_tet_mesh mesh = {(const float(*)[3])points, values, n * n * n, (const uint32_t(*)[4])tets, *count};
    CHECK(isogi_dvr_tets_build(&built, &mesh, NULL, &serial) == ISOGI_OK, "build");
    return built;
}

TEST(figures_8e_8f_surfaces_in_tetrahedra_are_uniform_in_data_space_alone) {
    enum { N = 20 };
    coulomb c = three_potentials(N);
    float(*points)[3] = (float(*)[3])malloc(N * N * N * sizeof *points), *values = (float *)malloc(N * N * N * sizeof *values);
    uint32_t(*tets)[4] = (uint32_t(*)[4])malloc(5 * N * N * N * sizeof *tets);
    size_t count;
    isogi_tets *built = split(&c.volume, points, values, tets, &count);
    const isogi_peak peak = {0.72, {1, 1, 1}, 0.3f};
    const isogi_transfer_point tent[] = {{0.7, {1, 1, 1}, 0}, {0.72, {1, 1, 1}, 2}, {0.74, {1, 1, 1}, 0}};
    const isogi_transfer surface = {NULL, 0, &peak, 1}, narrow = {tent, 3, NULL, 0};
    const isogi_tet_desc data = {.space = ISOGI_DVR_DATA, .opaque = 1},
                         lines = {.space = ISOGI_DVR_DATA, .silhouette = ISOGI_DVR_SILHOUETTE_EXACT, .opaque = 1}, physical = {.opaque = 1};
    static float image[3][PIXELS][4];
    double sum = 0, square = 0;
    int uniform = 0, hit = 0, enhanced = 0;
    CHECK(isogi_dvr_tets_render(built, &data, &surface, &c.view, image[0], NULL, NULL) == ISOGI_OK &&
              isogi_dvr_tets_render(built, &physical, &narrow, &c.view, image[1], NULL, NULL) == ISOGI_OK &&
              isogi_dvr_tets_render(built, &lines, &surface, &c.view, image[2], NULL, NULL) == ISOGI_OK,
          "render");
    for (int i = 0; i < PIXELS; i++) {
        double crossings = log1p(-(double)image[0][i][3]) / log1p(-(double)0.3f);
        CHECK(fabs(crossings - floor(crossings + 0.5)) < 1e-4, "pixel %d: %g crossings", i, crossings);
        CHECK(image[2][i][3] > image[0][i][3] - 1e-6f, "pixel %d: silhouettes only add", i);
        enhanced += image[2][i][3] > image[0][i][3] + 0.1f, hit += crossings > 0.5;
        if (fabs(crossings - 2) > 0.1) continue;
        sum += (double)image[1][i][3], square += pow((double)image[1][i][3], 2), uniform++;
    }
    double spread = sqrt(fmax(0, square / uniform - pow(sum / uniform, 2))) / (sum / uniform);
    printf("    %zu tetrahedra: %d of %d pixels with two crossings; spread of opacity in physical space %.2g; %d pixels enhanced\n", count,
           uniform, hit, spread, enhanced);
    CHECK(uniform > 100 && spread > 0.15 && enhanced > 10, "%d pixels, spread %g, %d enhanced", uniform, spread, enhanced);
    isogi_dvr_tets_free(built), free(points), free(values), free(tets), free_potentials(&c);
}

TEST_MAIN("dvr_figures")
