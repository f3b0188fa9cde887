/* Writes an isosurface as a Wavefront OBJ file that any modeller opens, and counts what it is made of.

       build/mesh_obj [OUT.obj]        default: what the program was called, with .obj */
#define ISOGI_IMPLEMENTATION
#include "files.h"
#include "procedural.h"
#include <stdio.h>

int main(int argc, char **argv) {
    char beside[4096];
    const char *path = argc > 1 ? argv[1] : beside;
    snprintf(beside, sizeof beside, "%s.obj", argv[0]);
    if (argc > 2 || *path == '-') return fprintf(stderr, "usage: %s [OUT.obj]\n", argv[0]), 2;
    const procedural_shape *shape = procedural_find("gyroid");
    isogi_volume volume;
    isogi_pyramid *pyramid = NULL;
    isogi_mesh mesh = {0};
    isogi_mesh_desc desc = {.isovalue = shape->isovalue, .normals = 1, .closed = 1};
    isogi_result result = procedural_make(shape, 96, &volume, NULL);
    if (result == ISOGI_OK) result = isogi_vol_build(&pyramid, &volume, NULL);
    if (result == ISOGI_OK) result = isogi_vol_mesh(pyramid, &desc, &mesh);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;

    char *text = NULL, error[FILE_ERROR_SIZE];
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    if (!file) return perror(path), 1;
    for (size_t i = 0; i < mesh.vertex_count; i++) {
        const float *p = mesh.positions[i], *n = mesh.normals[i];
        fprintf(file, "v %.7g %.7g %.7g\nvn %.4f %.4f %.4f\n", (double)p[0], (double)p[1], (double)p[2], (double)n[0], (double)n[1],
                (double)n[2]);
    }
    for (size_t i = 0; i < mesh.triangle_count; i++) {
        const uint32_t *t = mesh.triangles[i];
        fprintf(file, "f %u//%u %u//%u %u//%u\n", t[0] + 1, t[0] + 1, t[1] + 1, t[1] + 1, t[2] + 1, t[2] + 1);
    }
    if (ferror(file) | fclose(file)) return perror(path), 1;
    if (!file_write(path, text, size, error)) return fprintf(stderr, "%s\n", error), 1;
    /* a closed surface has 3/2 edges for every triangle: V - E + F counts its handles, two for each */
    long euler = (long)mesh.vertex_count - (long)mesh.triangle_count / 2;
    printf("%s: %zu vertices, %zu triangles, closed, Euler characteristic %ld\n", path, mesh.vertex_count, mesh.triangle_count, euler);
    isogi_vol_mesh_free(pyramid, &mesh), isogi_vol_free(pyramid), procedural_free(&volume), free(text);
    return file_printed(error) ? 0 : (fprintf(stderr, "%s\n", error), 1);
}
