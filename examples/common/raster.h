/* raster.h - a z-buffer rasterizer for indexed triangle meshes

   raster_draw writes, for one sample per pixel, 1 / depth along the view's axis and the triangle seen there. Exact coverage: screen
   places are rounded to 1/256 pixel and edges tested in integers with a top-left rule, so that neighbouring triangles neither
   overlap nor leave a crack. Triangles that reach behind the eye are clipped at the near plane. Threads take bands of rows; of two
   equally near triangles the first wins, so that the picture is the same for any number of threads. */
#ifndef RASTER_H
#define RASTER_H

#include "camera.h"
#include "isogi_vol.h"
#include <stdlib.h>
#include <string.h>

#define RASTER_BAND 16
#define RASTER_SUB 256.0
#define RASTER_NONE 0xffffffffu

typedef struct raster_vertex {
    int32_t x, y;  /* in 1/256 pixel */
    float inverse; /* 1 / depth; 0: before the near plane or far outside of the picture, so its triangles are clipped first */
} raster_vertex;

typedef struct raster_job {
    const isogi_mesh *mesh;
    const camera *view;
    double x_offset, y_offset; /* of the sample within the pixel, -1/2 .. 1/2 */
    const double (*clip)[4];   /* a b c d: only a x + b y + c z + d >= 0 is drawn */
    size_t clip_count;
    double near_plane;
    float *inverse;
    uint32_t *triangle;
    raster_vertex *vertex;
    size_t bands, chunks, *start; /* start[chunk * bands + band] into list; then one past the end */
    uint32_t *list;
} raster_job;

static inline void raster_to_camera(const raster_job *job, uint32_t index, double v[3]) {
    const float *p = job->mesh->positions[index];
    double d[3];
    int i;
    for (i = 0; i < 3; i++) d[i] = (double)p[i] - job->view->eye[i];
    v[0] = vector_dot(d, job->view->right), v[1] = vector_dot(d, job->view->up), v[2] = vector_dot(d, job->view->forward);
}

/* Place on the screen in pixels, such that the sample of pixel (i, j) lies at (i, j). */
static inline void raster_project(const raster_job *job, const double v[3], double *x, double *y) {
    double s = 0.5 * job->view->height / job->view->scale / v[2];
    *x = 0.5 * job->view->width - 0.5 + v[0] * s - job->x_offset;
    *y = 0.5 * job->view->height - 0.5 - v[1] * s - job->y_offset;
}

#define RASTER_VERTICES 16384
static inline void raster_vertex_task(void *arg, size_t chunk) {
    raster_job *job = (raster_job *)arg;
    size_t i, end = (chunk + 1) * RASTER_VERTICES;
    if (end > job->mesh->vertex_count) end = job->mesh->vertex_count;
    for (i = chunk * RASTER_VERTICES; i < end; i++) {
        raster_vertex *out = &job->vertex[i];
        double v[3], x, y;
        raster_to_camera(job, (uint32_t)i, v);
        out->x = out->y = 0, out->inverse = 0;
        if (!(v[2] > job->near_plane)) continue;
        raster_project(job, v, &x, &y);
        if (!(fabs(x) < 1e6 && fabs(y) < 1e6)) continue;
        out->x = (int32_t)floor(x * RASTER_SUB + 0.5), out->y = (int32_t)floor(y * RASTER_SUB + 0.5);
        out->inverse = (float)(1 / v[2]);
    }
}

/* ---- which triangles touch which band of rows ------------------------------------------------------------------------------------ */

static inline int raster_bands_of(const raster_job *job, size_t t, size_t *first, size_t *last) {
    const uint32_t *index = job->mesh->triangles[t];
    const raster_vertex *a = &job->vertex[index[0]], *b = &job->vertex[index[1]], *c = &job->vertex[index[2]];
    int32_t low, high;
    if (a->inverse <= 0 || b->inverse <= 0 || c->inverse <= 0) {
        *first = 0, *last = job->bands - 1;
        return a->inverse > 0 || b->inverse > 0 || c->inverse > 0 || job->near_plane > 0;
    }
    low = a->y < b->y ? a->y : b->y, low = low < c->y ? low : c->y;
    high = a->y > b->y ? a->y : b->y, high = high > c->y ? high : c->y;
    low = (low + 255) >> 8, high = high >> 8; /* rows whose samples lie within */
    if (low < 0) low = 0;
    if (high >= job->view->height) high = job->view->height - 1;
    if (low > high) return 0;
    *first = (size_t)low / RASTER_BAND, *last = (size_t)high / RASTER_BAND;
    return 1;
}

static inline void raster_chunk_range(const raster_job *job, size_t chunk, size_t *begin, size_t *end) {
    *begin = job->mesh->triangle_count / job->chunks * chunk;
    *end = chunk + 1 == job->chunks ? job->mesh->triangle_count : job->mesh->triangle_count / job->chunks * (chunk + 1);
}

static inline void raster_count_task(void *arg, size_t chunk) {
    raster_job *job = (raster_job *)arg;
    size_t t, end, first, last, b;
    for (raster_chunk_range(job, chunk, &t, &end); t < end; t++)
        if (raster_bands_of(job, t, &first, &last))
            for (b = first; b <= last; b++) job->start[chunk * job->bands + b]++;
}

static inline void raster_fill_task(void *arg, size_t chunk) {
    raster_job *job = (raster_job *)arg;
    size_t t, end, first, last, b;
    for (raster_chunk_range(job, chunk, &t, &end); t < end; t++)
        if (raster_bands_of(job, t, &first, &last))
            for (b = first; b <= last; b++) job->list[job->start[chunk * job->bands + b]++] = (uint32_t)t;
}

/* ---- one triangle ------------------------------------------------------------------------------------------------------------------ */

typedef struct raster_corner {
    int64_t x, y;
    double inverse;
} raster_corner;

/* Twice the area left of the edge a -> b at p, and whether points exactly on the edge belong to the triangle. */
static inline int64_t raster_edge(const raster_corner *a, const raster_corner *b, int64_t x, int64_t y) {
    return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}
static inline int64_t raster_bias(const raster_corner *a, const raster_corner *b) {
    return b->y > a->y || (b->y == a->y && b->x < a->x) ? 0 : -1;
}

static inline int raster_kept(const raster_job *job, double x, double y, double inverse) {
    double d[3];
    const double *eye = job->view->eye;
    size_t i;
    if (!job->clip_count) return 1;
    camera_direction(job->view, x + job->x_offset, y + job->y_offset, d);
    for (i = 0; i < job->clip_count; i++) {
        const double *plane = job->clip[i];
        double side = plane[0] * (eye[0] + d[0] / inverse) + plane[1] * (eye[1] + d[1] / inverse) + plane[2] * (eye[2] + d[2] / inverse);
        if (!(side + plane[3] >= 0)) return 0;
    }
    return 1;
}

static inline void raster_triangle(const raster_job *job, raster_corner c[3], uint32_t id, int row0, int row1) {
    int64_t area = raster_edge(&c[0], &c[1], c[2].x, c[2].y), bias[3];
    int64_t x0 = c[0].x, x1 = c[0].x, y0 = c[0].y, y1 = c[0].y, x, y, i;
    if (area == 0) return;
    if (area < 0) { /* either side is drawn */
        raster_corner swap = c[1];
        c[1] = c[2], c[2] = swap, area = -area;
    }
    for (i = 1; i < 3; i++) {
        x0 = c[i].x < x0 ? c[i].x : x0, x1 = c[i].x > x1 ? c[i].x : x1;
        y0 = c[i].y < y0 ? c[i].y : y0, y1 = c[i].y > y1 ? c[i].y : y1;
    }
    x0 = x0 < 0 ? 0 : (x0 + 255) / 256, y0 = y0 < 256 * (int64_t)row0 ? row0 : (y0 + 255) / 256;
    x1 = x1 < 0 ? -1 : x1 / 256, y1 = y1 < 0 ? -1 : y1 / 256;
    if (x1 >= job->view->width) x1 = job->view->width - 1;
    if (y1 > row1) y1 = row1;
    for (i = 0; i < 3; i++) bias[i] = raster_bias(&c[(i + 1) % 3], &c[(i + 2) % 3]);
    for (y = y0; y <= y1; y++)
        for (x = x0; x <= x1; x++) {
            int64_t w0 = raster_edge(&c[1], &c[2], 256 * x, 256 * y), w1 = raster_edge(&c[2], &c[0], 256 * x, 256 * y);
            int64_t w2 = area - w0 - w1;
            size_t at = (size_t)y * (size_t)job->view->width + (size_t)x;
            double inverse;
            if (w0 + bias[0] < 0 || w1 + bias[1] < 0 || w2 + bias[2] < 0) continue;
            inverse = ((double)w0 * c[0].inverse + (double)w1 * c[1].inverse + (double)w2 * c[2].inverse) / (double)area;
            if ((float)inverse < job->inverse[at] || ((float)inverse == job->inverse[at] && id >= job->triangle[at])) continue;
            if (!raster_kept(job, (double)x, (double)y, inverse)) continue;
            job->inverse[at] = (float)inverse, job->triangle[at] = id;
        }
}

/* The part of a triangle behind the near plane is cut off: what is left has 3 or 4 corners. */
static inline void raster_clipped(const raster_job *job, uint32_t id, int row0, int row1) {
    double v[3][3], cut[4][3];
    raster_corner c[4];
    int i, k, n = 0;
    for (i = 0; i < 3; i++) raster_to_camera(job, job->mesh->triangles[id][i], v[i]);
    for (i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        int a_in = a[2] >= job->near_plane, b_in = b[2] >= job->near_plane;
        if (a_in) memcpy(cut[n++], a, sizeof v[0]);
        if (a_in != b_in) {
            double t = (job->near_plane - a[2]) / (b[2] - a[2]);
            for (k = 0; k < 2; k++) cut[n][k] = a[k] + t * (b[k] - a[k]);
            cut[n++][2] = job->near_plane;
        }
    }
    for (i = 0; i < n; i++) {
        double x, y;
        raster_project(job, cut[i], &x, &y);
        /* 2^38 / 256 pixels: products of two places still fit into 63 bits after the picture's own size is taken off */
        x = x < -4e6 ? -4e6 : x > 4e6 ? 4e6 : x, y = y < -4e6 ? -4e6 : y > 4e6 ? 4e6 : y;
        c[i].x = (int64_t)floor(x * RASTER_SUB + 0.5), c[i].y = (int64_t)floor(y * RASTER_SUB + 0.5), c[i].inverse = 1 / cut[i][2];
    }
    for (i = 2; i < n; i++) {
        raster_corner fan[3];
        fan[0] = c[0], fan[1] = c[i - 1], fan[2] = c[i];
        raster_triangle(job, fan, id, row0, row1);
    }
}

static inline void raster_band_task(void *arg, size_t band) {
    raster_job *job = (raster_job *)arg;
    size_t chunk, i, pixel, width = (size_t)job->view->width;
    int row0 = (int)band * RASTER_BAND, row1 = row0 + RASTER_BAND - 1, k;
    if (row1 >= job->view->height) row1 = job->view->height - 1;
    for (pixel = (size_t)row0 * width; pixel < ((size_t)row1 + 1) * width; pixel++)
        job->inverse[pixel] = 0, job->triangle[pixel] = RASTER_NONE;
    for (chunk = 0; chunk < job->chunks; chunk++) {
        size_t cell = chunk * job->bands + band, begin = cell ? job->start[cell - 1] : 0;
        for (i = begin; i < job->start[cell]; i++) {
            const uint32_t *index = job->mesh->triangles[job->list[i]];
            raster_corner c[3];
            int clip = 0;
            for (k = 0; k < 3; k++) {
                const raster_vertex *v = &job->vertex[index[k]];
                c[k].x = v->x, c[k].y = v->y, c[k].inverse = (double)v->inverse;
                clip |= v->inverse <= 0;
            }
            if (clip) raster_clipped(job, job->list[i], row0, row1);
            else raster_triangle(job, c, job->list[i], row0, row1);
        }
    }
}

/* inverse[height*width]: 1 / depth of what is seen, 0 = nothing; triangle: its number, or RASTER_NONE. */
static inline isogi_result raster_draw(const isogi_mesh *mesh, const camera *view, double x_offset, double y_offset,
                                       const double (*clip)[4], size_t clip_count, double near_plane, float *inverse, uint32_t *triangle,
                                       const isogi_context *context) {
    raster_job job;
    isogi_result result = ISOGI_NO_MEMORY;
    size_t i, total = 0, cells;
    memset(&job, 0, sizeof job);
    job.mesh = mesh, job.view = view, job.x_offset = x_offset, job.y_offset = y_offset, job.clip = clip, job.clip_count = clip_count;
    job.near_plane = near_plane, job.inverse = inverse, job.triangle = triangle;
    job.bands = ((size_t)view->height + RASTER_BAND - 1) / RASTER_BAND;
    job.chunks = mesh->triangle_count / 8192 + 1;
    cells = job.bands * job.chunks;
    job.vertex = (raster_vertex *)malloc((mesh->vertex_count + 1) * sizeof *job.vertex);
    job.start = (size_t *)calloc(cells, sizeof *job.start);
    if (job.vertex && job.start) {
        result = isogi_parallel(context, (mesh->vertex_count + RASTER_VERTICES - 1) / RASTER_VERTICES, raster_vertex_task, &job, 0, 0);
        if (result == ISOGI_OK) result = isogi_parallel(context, job.chunks, raster_count_task, &job, 0, 0);
        for (i = 0; i < cells; i++) {
            size_t n = job.start[i];
            job.start[i] = total, total += n;
        }
        job.list = (uint32_t *)malloc((total + 1) * sizeof *job.list);
        if (result == ISOGI_OK && !job.list) result = ISOGI_NO_MEMORY;
        /* filling moves each start to the next one's: afterwards start[i] is the end of cell i */
        if (result == ISOGI_OK) result = isogi_parallel(context, job.chunks, raster_fill_task, &job, 0, 0);
        if (result == ISOGI_OK) result = isogi_parallel(context, job.bands, raster_band_task, &job, 0, 0);
    }
    free(job.vertex), free(job.start), free(job.list);
    return result;
}

/* Perspective-correct weights of a triangle's corners at a point (nearly) on it, clamped into the triangle. */
static inline void raster_weights(const isogi_mesh *mesh, uint32_t t, const double p[3], double w[3]) {
    const uint32_t *index = mesh->triangles[t];
    double e1[3], e2[3], d[3], a, b, c, x, y, det, sum;
    int i;
    for (i = 0; i < 3; i++) {
        double origin = (double)mesh->positions[index[0]][i];
        e1[i] = (double)mesh->positions[index[1]][i] - origin, e2[i] = (double)mesh->positions[index[2]][i] - origin, d[i] = p[i] - origin;
    }
    a = vector_dot(e1, e1), b = vector_dot(e1, e2), c = vector_dot(e2, e2), x = vector_dot(d, e1), y = vector_dot(d, e2);
    det = a * c - b * b;
    w[1] = w[2] = 1.0 / 3;
    if (det > 1e-12 * a * c) w[1] = (c * x - b * y) / det, w[2] = (a * y - b * x) / det;
    w[0] = 1 - w[1] - w[2];
    for (sum = 0, i = 0; i < 3; i++) w[i] = w[i] > 0 ? w[i] : 0, sum += w[i];
    for (i = 0; i < 3; i++) w[i] /= sum;
}

#endif /* RASTER_H */
