/* Draws an isosurface of a tetrahedral mesh as text, lit by sky, sun and itself: points, normals and rays are the program's own, the
   light is isogi_trace_gather_field's. The mesh: a lattice whose points are shaken, five tetrahedra in each of its cells. */
#define ISOGI_IMPLEMENTATION
#include "isogi_trace.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N = 12, WIDTH = 76, HEIGHT = 34, MOST = 10 * N * N * N };
static double corner[N * N * N][4], triangle[MOST][4][3]; /* place, value; a corner, two edges, unit normal to the low side */
static float points[WIDTH * HEIGHT][3], normals[WIDTH * HEIGHT][3], light[WIDTH * HEIGHT][3];
static size_t triangles;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void cross(const double a[3], const double b[3], double c[3]) {
    for (int i = 0; i < 3; i++) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void triangle_add(double v[4][3], int b, int c, const double *low) {
    double(*t)[3] = triangle[triangles], down[3];
    for (int a = 0; a < 3; a++) {
        t[0][a] = v[0][a], t[1][a] = v[b][a] - v[0][a], t[2][a] = v[c][a] - v[0][a];
        down[a] = low[a] - v[0][a];
    }
    cross(t[1], t[2], t[3]);
    double length = sqrt(dot(t[3], t[3])) * (dot(t[3], down) < 0 ? -1 : 1);
    for (int a = 0; a < 3; a++) t[3][a] /= length;
    triangles += fabs(length) > 1e-12;
}

/* Where the value is 0 in a tetrahedron, in which it is linear: three or four edges are cut. */
static void cut(const double *p[4]) {
    const double *in[4], *out[4];
    double v[4][3];
    int n = 0, m = 0;
    for (int k = 0; k < 4; k++)
        if (p[k][3] >= 0) in[n++] = p[k];
        else out[m++] = p[k];
    for (int e = 0; e < n * m; e++) { /* two and two: around the quadrilateral */
        const double *a = n == 2 ? in[e == 1 || e == 2] : in[e % n], *b = n == 2 ? out[e / 2] : out[e / n];
        for (int c = 0; c < 3; c++) v[e][c] = (a[3] * b[c] - b[3] * a[c]) / (a[3] - b[3]);
    }
    if (n && m) triangle_add(v, 1, 2, out[0]);
    if (n * m == 4) triangle_add(v, 2, 3, out[0]);
}

/* What isogi_trace asks: every triangle, one after the other (Moeller and Trumbore 1997). */
static void meet(void *user, const isogi_ray *rays, size_t count, isogi_trace_surface *surfaces) {
    (void)user;
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < triangles; k++) {
            double(*t)[3] = triangle[k], d[3], o[3], p[3], q[3];
            for (int a = 0; a < 3; a++) d[a] = (double)rays[i].dir[a], o[a] = rays[i].origin[a] - t[0][a];
            cross(d, t[2], p), cross(o, t[1], q);
            double scale = 1 / dot(t[1], p), u = scale * dot(o, p), v = scale * dot(d, q), at = scale * dot(t[2], q);
            if (!(u >= 0 && v >= 0 && u + v <= 1 && at > 0) || (rays[i].tmax > 0 && at > rays[i].tmax)) continue;
            if (surfaces[i].t > 0 && at > surfaces[i].t) continue;
            surfaces[i].t = at;
            for (int a = 0; a < 3; a++) surfaces[i].normal[a] = (float)t[3][a];
        }
}

int main(int argc, char **argv) {
    if (argc > 1) return fprintf(stderr, "usage: %s, without arguments\n", argv[0]), 2;
    static const int tets[2][5][4] = {{{0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}, {1, 2, 4, 7}},
                                      {{1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}}}; /* by parity */
    for (int i = 0; i < N * N * N; i++) {
        const double x[3] = {i % N, i / N % N, i / N / N}, middle = 0.5 * (N - 1);
        for (int a = 0; a < 3; a++) corner[i][a] = x[a] - middle + 0.2 * sin(7.3 * i + 2 * a);
        double *c = corner[i], ring = sqrt(c[0] * c[0] + c[2] * c[2]) - 3.2; /* a torus above the ground */
        c[3] = fmax(1.5 - sqrt(ring * ring + c[1] * c[1]), -2 - c[1]);
    }
    for (int i = 0; i < N * N * N; i++)
        for (int k = 0; k < 5 && i % N < N - 1 && i / N % N < N - 1 && i / N / N < N - 1; k++) {
            const double *p[4];
            for (int c = 0; c < 4; c++) {
                int b = tets[(i % N + i / N % N + i / N / N) % 2][k][c];
                p[c] = corner[i + (b & 1) + N * (b >> 1 & 1) + N * N * (b >> 2)];
            }
            cut(p);
        }
    isogi_light sun = {.vector = {1, 1.2f, 0.6f}, .rgb = {2, 2, 2}, .radius = 0.1f};
    float sky[12] = {1.6f, 1.6f, 1.6f, 0.8f, 0.8f, 0.8f}; /* brighter above */
    isogi_trace_desc desc = {
        .lighting = {{.sh = sky, .sh_order = 2}, &sun, 1}, .albedo = {0.7f, 0.7f, 0.7f}, .bounces = 1, .samples = 12, .offset = 1e-4f};
    size_t count = 0, pixel[WIDTH * HEIGHT] = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double across = 13.0 * (i % WIDTH + 0.5) / WIDTH - 6.5, up = 5 - 11.0 * (i / WIDTH + 0.5) / HEIGHT;
        isogi_ray ray = {.origin = {across, 0.8 * up + 12, 16 - 0.6 * up}, .dir = {0, -0.6f, -0.8f}};
        isogi_trace_surface seen = {0};
        meet(NULL, &ray, 1, &seen);
        if (!(seen.t > 0)) continue;
        for (int a = 0; a < 3; a++) points[count][a] = (float)(ray.origin[a] + seen.t * (double)ray.dir[a]);
        memcpy(normals[count], seen.normal, sizeof seen.normal);
        pixel[i] = ++count;
    }
    isogi_result result =
        isogi_trace_gather_field(&desc, meet, NULL, (const float(*)[3])points, (const float(*)[3])normals, count, light, NULL, NULL);
    if (result != ISOGI_OK) return fprintf(stderr, "%s\n", isogi_result_string(result)), 1;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int shade = pixel[i] ? (int)(2.8f * light[pixel[i] - 1][0]) : 0;
        printf("%c%s", pixel[i] ? ".,:;-=+*oO#%@"[shade < 12 ? shade : 12] : ' ', i % WIDTH == WIDTH - 1 ? "\n" : "");
    }
    printf("%zu triangles, %zu points lit\n", triangles, count);
    return fflush(stdout) || ferror(stdout) ? (perror("standard output"), 1) : 0;
}
