/* Tetrahedral meshes in both spaces: build/tets MESH SPACE OUT.png [WIDTH]

   MESH is a .raw volume whose cells are split into tetrahedra, five to a cell (Kraus 2005, figure 8e and f, with
   buckyball_32x32x32_uint8.raw), or a .tet file: 'TETS', numbers of points and tetrahedra (32 bits), points, values (floats), four
   points for each tetrahedron.
   SPACE is physical or data (with silhouettes). Isosurfaces of a third and two thirds of the range. */
#define ISOGI_IMPLEMENTATION
#include "isogi_dvr.h"
#include "option_text.h"
#include "picture.h"
#include "png.h"
#include "volume_file.h"

static isogi_tet_mesh mesh;
static float (*points)[3], *values;
static uint32_t (*tets)[4];

/* Parity alternates from cell to cell, so that neighbours share their faces. */
static int split(const isogi_volume *v) {
    static const uint8_t corner[2][5][4] = {{{0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}, {1, 2, 4, 7}},
                                            {{1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}}};
    const size_t *n = v->size, count = n[0] * n[1] * n[2];
    points = (float(*)[3])malloc(count * sizeof *points), values = (float *)malloc(count * sizeof *values);
    tets = (uint32_t(*)[4])malloc(5 * count * sizeof *tets);
    if (!points || !values || !tets) return 0;
    for (size_t i = 0; i < count; i++) {
        const size_t c[3] = {i % n[0], i / n[0] % n[1], i / n[0] / n[1]};
        for (int a = 0; a < 3; a++) points[i][a] = (float)c[a];
        values[i] = (float)volume_voxel(v, i);
        if (c[0] + 1 == n[0] || c[1] + 1 == n[1] || c[2] + 1 == n[2]) continue;
        for (int t = 0; t < 5; t++, mesh.tet_count++)
            for (int k = 0; k < 4; k++) {
                size_t b = corner[(c[0] + c[1] + c[2]) % 2][t][k];
                tets[mesh.tet_count][k] = (uint32_t)(i + (b & 1) + n[0] * ((b >> 1 & 1) + n[1] * (b >> 2)));
            }
    }
    mesh.point_count = count;
    return 1;
}

static int read_tets(const char *path, char *error) {
    unsigned char *data = NULL;
    size_t size = 0, at = 12;
    uint32_t count[2];
    if (!file_read(path, (size_t)1 << 31, &data, &size, error)) return 0;
    if (size < 12 || memcmp(data, "TETS", 4)) return file_fail(error, "%s: is not a .tet file", path);
    memcpy(count, data + 4, 8);
    if (size - 12 != 16 * ((size_t)count[0] + count[1]))
        return file_fail(error, "%s: has %zu bytes; %u points and %u tetrahedra take %zu", path, size, count[0], count[1],
                         12 + 16 * ((size_t)count[0] + count[1]));
    points = (float(*)[3])malloc(count[0] * sizeof *points + 1), values = (float *)malloc(count[0] * sizeof *values + 1);
    tets = (uint32_t(*)[4])malloc(count[1] * sizeof *tets + 1);
    if (!points || !values || !tets) return file_fail(error, "out of memory");
    memcpy(points, data + at, 12 * (size_t)count[0]), at += 12 * (size_t)count[0];
    memcpy(values, data + at, 4 * (size_t)count[0]), at += 4 * (size_t)count[0];
    memcpy(tets, data + at, 16 * (size_t)count[1]);
    mesh.point_count = count[0], mesh.tet_count = count[1];
    free(data);
    return 1;
}

int main(int argc, char **argv) {
    char error[FILE_ERROR_SIZE] = "out of memory";
    isogi_volume volume = {.data = NULL};
    isogi_tet_report report;
    isogi_tets *built = NULL;
    double width = 512;
    int data = argc > 2 && !strcmp(argv[2], "data");
    if (argc < 4 || argc > 5 || (!data && strcmp(argv[2], "physical")) || (argc > 4 && !whole_numbers(argv[4], ',', 1, 1, 8192, &width)))
        return fprintf(stderr, "usage: %s MESH physical|data OUT.png [WIDTH], 1 to 8192 pixels wide\n", argv[0]), 2;
    if (file_same(argv[1], argv[3])) return fprintf(stderr, "tets: %s is MESH and OUT.png\n", argv[3]), 1;
    size_t length = strlen(argv[1]);
    int raw = length > 4 && (!strcmp(argv[1] + length - 4, ".raw") || !strcmp(argv[1] + length - 4, ".RAW")), side = (int)width;
    if (!file_writable(argv[3], error)) return fprintf(stderr, "tets: %s\n", error), 1;
    if (raw ? !volume_read(argv[1], &volume, error) || !split(&volume) : !read_tets(argv[1], error))
        return fprintf(stderr, "tets: %s\n", error), 1;
    mesh.points = (const float(*)[3])points, mesh.values = values, mesh.tets = (const uint32_t(*)[4])tets;
    isogi_result result = isogi_dvr_tets_build(&built, &mesh, &report, NULL);
    if (result == ISOGI_OK && !mesh.tet_count) result = ISOGI_INVALID;
    if (result != ISOGI_OK) return fprintf(stderr, "tets: %s: %s\n", argv[1], isogi_result_string(result)), 1;
    printf("%zu tetrahedra, %zu degenerate, %zu faces on the border, %zu crowded\n", mesh.tet_count, report.degenerate, report.border,
           report.crowded);

    double low[3], high[3], least = 1e30, most = -1e30, radius = 0;
    for (int a = 0; a < 3; a++) low[a] = 1e30, high[a] = -1e30;
    for (size_t i = 0; i < mesh.point_count; i++) {
        for (int a = 0; a < 3; a++) low[a] = fmin(low[a], (double)points[i][a]), high[a] = fmax(high[a], (double)points[i][a]);
        least = fmin(least, (double)values[i]), most = fmax(most, (double)values[i]);
    }
    isogi_view view = {.width = 2 * side, .height = 2 * side, .fov = 40}; /* four rays a pixel */
    for (int a = 0; a < 3; a++) radius += 0.25 * (high[a] - low[a]) * (high[a] - low[a]);
    radius = sqrt(radius);
    for (int a = 0; a < 3; a++) {
        static const double toward[3] = {1.5, 1.2, 2};
        view.target[a] = (float)(0.5 * (low[a] + high[a]));
        view.eye[a] = (float)(0.5 * (low[a] + high[a]) + 3 * radius * toward[a] / 2.773);
    }
    double third = (most - least) / 3, half = 0.03 * (most - least);
    const isogi_peak peaks[] = {{least + third, {.2f, .45f, .9f}, 0.2f}, {least + 2 * third, {.9f, .5f, .15f}, 0.3f}};
    const float dense = (float)(20 / radius); /* the same surfaces as tents in physical space: their opacity follows the gradient */
    const isogi_transfer_point tents[] = {
        {least + third - half, {.2f, .45f, .9f}, 0},      {least + third, {.2f, .45f, .9f}, dense},
        {least + third + half, {.2f, .45f, .9f}, 0},      {least + 2 * third - half, {.9f, .5f, .15f}, 0},
        {least + 2 * third, {.9f, .5f, .15f}, 3 * dense}, {least + 2 * third + half, {.9f, .5f, .15f}, 0}};
    const isogi_transfer surfaces = {NULL, 0, peaks, 2}, thick = {tents, 6, NULL, 0};
    const isogi_tet_desc desc = {.space = data ? ISOGI_DVR_DATA : ISOGI_DVR_PHYSICAL,
                                 .silhouette = data ? ISOGI_DVR_SILHOUETTE_EXACT : ISOGI_DVR_SILHOUETTE_NONE};
    float(*image)[4] = (float(*)[4])malloc(4 * (size_t)side * (size_t)side * sizeof *image);
    unsigned char *bytes = (unsigned char *)malloc((size_t)side * (size_t)side * 3);
    if (!image || !bytes) return fprintf(stderr, "tets: out of memory\n"), 1;
    result = isogi_dvr_tets_render(built, &desc, data ? &surfaces : &thick, &view, image, NULL, NULL);
    if (result != ISOGI_OK)
        return fprintf(stderr, "tets: %s: %s\n", argv[1],
                       result == ISOGI_INVALID ? "its points lie too far apart, or all in one place" : isogi_result_string(result)), 1;
    const double behind[3] = {0.09, 0.095, 0.1};
    for (size_t i = 0; i < (size_t)side * (size_t)side; i++) {
        const size_t row = 2 * (size_t)side, at = 2 * (i / (size_t)side) * row + 2 * (i % (size_t)side);
        float mean[4];
        for (int c = 0; c < 4; c++) mean[c] = 0.25f * (image[at][c] + image[at + 1][c] + image[at + row][c] + image[at + row + 1][c]);
        picture_pixel(mean, 1, behind, bytes + 3 * i);
    }
    if (!png_write(argv[3], bytes, side, side, 3, error)) return fprintf(stderr, "tets: %s\n", error), 1;
    isogi_dvr_tets_free(built);
    free(image), free(bytes), free(points), free(values), free(tets), volume_free(&volume);
    return file_printed(error) ? 0 : (fprintf(stderr, "tets: %s\n", error), 1);
}
