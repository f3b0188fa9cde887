/* The reference of frames: visibility by brute force at the grid points that a frame looks at, kept in build/bench/ so that it is computed
   once. For programs that hold the implementation of isogi_dvr.h. */
#ifndef BRUTE_REFERENCE_H
#define BRUTE_REFERENCE_H

#include "camera.h"
#include "isogi_dvr.h"
#include <stdio.h>
#include <time.h>

enum { BRUTE_SAMPLES = 1024, BRUTE_CHUNK = 512, BRUTE_CLASSES = 4096 };

/* In voxels. Visibility is then 0.0012 (engine) to 0.0018 (ml256) from that of pieces of a tenth; one voxel would make it 0.004 to 0.008,
   and frames differ by 0.00015 and 0.0005, RMSE of sRGB values. */
#define BRUTE_STEP 0.5

/* ---- which grid points ---- */

/* The eight grid points around a place in the volume's grid coordinates. */
static void brute_mark_cell(const isogi_dvr *d, const double place[3], uint8_t *needed) {
    size_t cell[3];
    for (int a = 0; a < 3; a++) {
        double x = fmin(fmax(place[a] / d->cells[a], 0), 1) * (double)(d->desc.grid[a] - 1);
        cell[a] = (size_t)x < d->desc.grid[a] - 1 ? (size_t)x : d->desc.grid[a] - 2;
    }
    for (size_t k = 0; k < 8; k++)
        needed[cell[0] + (k & 1) + d->desc.grid[0] * (cell[1] + (k >> 1 & 1) + d->desc.grid[1] * (cell[2] + (k >> 2)))] = 1;
}

typedef struct brute_marking {
    const isogi_dvr *dvr;
    const isogi_transfer *transfer;
    const camera *eye;
    double range; /* from where to where light is looked up before a sample: 1.5 grid distances, in world units */
    uint8_t *needed;
} brute_marking;

/* One ray of a picture in steps of half a voxel, until it is opaque: all that is looked up for it, and a little more. */
static void brute_mark_ray(const brute_marking *m, double x, double y) {
    const isogi_volume *v = isogi_vol_volume(m->dvr->desc.pyramid);
    static float place[BRUTE_SAMPLES][3], value[BRUTE_SAMPLES];
    double dir[3], enter = 0, leave = 1e30, step = 0.5 * v->spacing[0], clear = 1;
    size_t count = 0;
    camera_direction(m->eye, x, y, dir), vector_normalize(dir);
    for (int a = 0; a < 3; a++) {
        double low = (v->origin[a] - m->eye->eye[a]) / dir[a], high = low + (double)(v->size[a] - 1) * v->spacing[a] / dir[a];
        enter = fmax(enter, fmin(low, high)), leave = fmin(leave, fmax(low, high));
    }
    for (double t = enter + 0.5 * step; t < leave && count < BRUTE_SAMPLES; t += step, count++)
        for (int a = 0; a < 3; a++) place[count][a] = (float)(m->eye->eye[a] + t * dir[a]);
    if (isogi_vol_sample(m->dvr->desc.pyramid, (const float(*)[3])place, count, value, NULL) != ISOGI_OK) exit(1);
    for (size_t i = 0; i < count && clear > 0.003; i++) {
        float rgb[3], extinction;
        isogi_transfer_at(m->transfer, (double)value[i], rgb, &extinction);
        if (!(extinction > 0)) continue;
        clear *= exp(-0.5 * (double)extinction);
        for (int k = 0; k < 2; k++) {
            const double thick = (double)extinction * m->range / v->spacing[0], off = k * m->range * thick * thick / (thick * thick + 16);
            double world[3], grid[3];
            for (int a = 0; a < 3; a++) world[a] = (double)place[i][a] - off * dir[a];
            isogi_vol_to_grid(m->dvr->desc.pyramid, world, grid);
            brute_mark_cell(m->dvr, grid, m->needed);
        }
    }
}

static void brute_mark(const isogi_dvr *d, const isogi_view *view, const isogi_transfer *transfer, uint8_t *needed) {
    const isogi_volume *v = isogi_vol_volume(d->desc.pyramid);
    brute_marking m = {.dvr = d, .transfer = transfer, .needed = needed};
    double eye[3], target[3], up[3] = {0, 1, 0};
    camera c;
    for (int a = 0; a < 3; a++) {
        eye[a] = (double)view->eye[a], target[a] = (double)view->target[a];
        m.range = fmax(m.range, 1.5 * v->spacing[a] * d->cells[a] / (double)(d->desc.grid[a] - 1));
        if (view->up[0] != 0 || view->up[1] != 0 || view->up[2] != 0) up[a] = (double)view->up[a];
    }
    camera_look(&c, view->width, view->height, eye, target, up, 45);
    m.eye = &c;
    for (int i = 0; i < view->width * view->height; i++) brute_mark_ray(&m, i % view->width, i / view->width);
}

/* ---- what is kept: the visibility of points, each with its number; a computation that was stopped goes on ---- */

static uint64_t brute_hash(uint64_t key, const void *data, size_t bytes) {
    const uint8_t *p = (const uint8_t *)data;
    for (size_t i = 0; i < bytes; i++) key = (key ^ p[i]) * 0x100000001b3u;
    return key;
}

/* All that defines it but the library's own code, and what `also` stands for where it is not 0. */
static uint64_t brute_key(const isogi_dvr *d, const isogi_transfer *transfer, uint64_t also) {
    const isogi_volume *v = isogi_vol_volume(d->desc.pyramid);
    const double numbers[] = {(double)d->desc.order, (double)d->desc.directions, BRUTE_STEP, (double)d->desc.grid[0],
                              (double)d->desc.grid[1], (double)d->desc.grid[2], (double)v->size[0], (double)v->size[1],
                              (double)v->size[2], v->spacing[0], v->spacing[1], v->spacing[2]};
    uint64_t key = brute_hash(0xcbf29ce484222325u, numbers, sizeof numbers);
    for (size_t i = 0; i < transfer->point_count; i++) {
        key = brute_hash(key, &transfer->points[i].value, sizeof(double));
        key = brute_hash(key, &transfer->points[i].extinction, sizeof(float));
    }
    if (also) key = brute_hash(key, &also, sizeof also);
    return brute_hash(key, v->data, v->size[0] * v->size[1] * v->size[2] * (v->type == ISOGI_F32 ? 4 : 1));
}

/* Reads what `file` has of the points that are needed, and takes them off; their number. What follows is written after the last whole
   record. */
static size_t brute_read(FILE *file, isogi_dvr *d, uint8_t *needed) {
    float v[36];
    uint32_t point;
    size_t found = 0, records = 0;
    for (; fread(&point, sizeof point, 1, file) == 1 && fread(v, sizeof *v, d->coefficients, file) == d->coefficients; records++) {
        if (point >= d->point_count || !needed[point]) continue;
        memcpy(d->visibility + point * d->coefficients, v, d->coefficients * sizeof *v);
        needed[point] = 0, found++;
    }
    fseek(file, (long)(records * (sizeof point + d->coefficients * sizeof *v)), SEEK_SET);
    return found;
}

/* ---- one ray after the other: pieces of BRUTE_STEP voxels of the trilinear field, each taken for linear, with the transfer function's
   extinction integrated over it; nothing of the library. Distances of two voxels that are the same along all axes. ---- */

typedef struct brute_field {
    float *value; /* x fastest */
    size_t size[3], blocks[3];
    uint8_t *far; /* of blocks of 4^3 cells: how many blocks there are, along any axis, to the nearest one that absorbs; 0: this one */
    double sum[BRUTE_CLASSES + 2]; /* of extinction, over classes of values from the lowest on */
    float low, scale;
} brute_field;

/* Distances as a king goes, in two passes. */
static void brute_spread(brute_field *f) {
    const ptrdiff_t w = (ptrdiff_t)f->blocks[0], h = (ptrdiff_t)f->blocks[1], total = w * h * (ptrdiff_t)f->blocks[2];
    for (ptrdiff_t pass = 0; pass < 2 * total; pass++) {
        const ptrdiff_t i = pass < total ? pass : 2 * total - 1 - pass, x = i % w, y = i / w % h;
        for (ptrdiff_t k = 0; k < 13; k++) { /* half of the neighbours */
            const ptrdiff_t dx = pass < total ? k % 3 - 1 : 1 - k % 3, dy = pass < total ? k / 3 % 3 - 1 : 1 - k / 3 % 3,
                            dz = pass < total ? k / 9 - 1 : 1 - k / 9, j = i + dx + w * (dy + h * dz);
            if (x + dx < 0 || x + dx >= w || y + dy < 0 || y + dy >= h || j < 0 || j >= total) continue;
            if (f->far[i] > f->far[j] + 1) f->far[i] = (uint8_t)(f->far[j] + 1);
        }
    }
}

static void brute_field_make(brute_field *f, const isogi_volume *v, const isogi_transfer *transfer) {
    size_t voxels = v->size[0] * v->size[1] * v->size[2], total = 1;
    float low = 1e30f, high = -1e30f;
    f->value = (float *)malloc(voxels * sizeof *f->value);
    if (!f->value) exit(1);
    for (size_t i = 0; i < voxels; i++) {
        f->value[i] = v->type == ISOGI_F32 ? ((const float *)v->data)[i] : (float)((const uint8_t *)v->data)[i];
        low = fminf(low, f->value[i]), high = fmaxf(high, f->value[i]);
    }
    f->low = low, f->scale = BRUTE_CLASSES / (high - low) * (1 - 1e-6f);
    for (int i = 0; i < BRUTE_CLASSES + 1; i++) {
        float rgb[3], extinction;
        isogi_transfer_at(transfer, (double)f->low + (i + 0.5) / (double)f->scale, rgb, &extinction);
        f->sum[i + 1] = f->sum[i] + (double)extinction;
    }
    for (int a = 0; a < 3; a++) f->size[a] = v->size[a], f->blocks[a] = (v->size[a] + 2) / 4, total *= f->blocks[a];
    f->far = (uint8_t *)malloc(total);
    if (!f->far) exit(1);
    for (size_t i = 0; i < total; i++) {
        const size_t at[3] = {i % f->blocks[0] * 4, i / f->blocks[0] % f->blocks[1] * 4, i / f->blocks[0] / f->blocks[1] * 4};
        float least = 1e30f, most = -1e30f;
        f->far[i] = 250;
        for (size_t k = 0; k < 125; k++) {
            size_t x = at[0] + k % 5, y = at[1] + k / 5 % 5, z = at[2] + k / 25;
            if (x >= f->size[0] || y >= f->size[1] || z >= f->size[2]) continue;
            least = fminf(least, f->value[x + f->size[0] * (y + f->size[1] * z)]);
            most = fmaxf(most, f->value[x + f->size[0] * (y + f->size[1] * z)]);
        }
        for (int c = (int)((least - f->low) * f->scale); c <= (int)((most - f->low) * f->scale); c++)
            if (f->sum[c + 1] > f->sum[c]) f->far[i] = 0;
    }
    brute_spread(f);
}

/* Mean extinction where the value goes from one class to another. */
static double brute_mean(const brute_field *f, float from, float to) {
    const int a = (int)from, b = (int)to;
    if (!(f->sum[(a > b ? a : b) + 1] > f->sum[a < b ? a : b])) return 0;
    if (a == b) return f->sum[a + 1] - f->sum[a];
    return (f->sum[b] + (double)(to - (float)b) * (f->sum[b + 1] - f->sum[b]) - f->sum[a] -
            (double)(from - (float)a) * (f->sum[a + 1] - f->sum[a])) /
           (double)(to - from);
}

/* Transmittance from a place to the border. */
static double brute_ray(const brute_field *f, const double from[3], const double dir[3], const double inverse[3]) {
    const size_t row = f->size[0], slice = f->size[0] * f->size[1];
    double leave = 1e9, depth = 0, t = 0, length = 0; /* of the piece that ends at t; 0: none */
    float before = 0;
    for (int a = 0; a < 3; a++)
        if (fabs(dir[a]) > 0) leave = fmin(leave, ((dir[a] > 0 ? (double)f->size[a] - 1 : 0) - from[a]) * inverse[a]);
    while (depth < 8) {
        int cell[3], far;
        float u[3], v[4];
        for (int a = 0; a < 3; a++) {
            double x = fmax(from[a] + t * dir[a], 0);
            cell[a] = (int)x < (int)f->size[a] - 1 ? (int)x : (int)f->size[a] - 2, u[a] = (float)(x - cell[a]);
        }
        const float *p = f->value + (size_t)cell[0] + row * (size_t)cell[1] + slice * (size_t)cell[2];
        v[0] = p[0] + u[0] * (p[1] - p[0]), v[1] = p[row] + u[0] * (p[row + 1] - p[row]);
        v[2] = p[slice] + u[0] * (p[slice + 1] - p[slice]), v[3] = p[slice + row] + u[0] * (p[slice + row + 1] - p[slice + row]);
        v[0] += u[1] * (v[1] - v[0]), v[2] += u[1] * (v[3] - v[2]), v[0] += u[2] * (v[2] - v[0]);
        v[0] = fminf(fmaxf((v[0] - f->low) * f->scale, 0), BRUTE_CLASSES);
        if (length > 0) depth += length * brute_mean(f, before, v[0]);
        if (t >= leave) break;
        before = v[0], length = fmin(BRUTE_STEP, leave - t);
        far = f->far[(size_t)(cell[0] >> 2) + f->blocks[0] * ((size_t)(cell[1] >> 2) + f->blocks[1] * (size_t)(cell[2] >> 2))];
        if (far) { /* to the last place of a sample before what absorbs */
            double out = leave;
            for (int a = 0; a < 3; a++)
                if (fabs(dir[a]) > 0) out = fmin(out, (((cell[a] >> 2) + (dir[a] > 0 ? far : 1 - far)) * 4 - from[a]) * inverse[a]);
            out = BRUTE_STEP * floor(out / BRUTE_STEP);
            if (out > t + BRUTE_STEP) t = out, length = 0;
            if (length <= 0) continue;
        }
        t += length;
    }
    return exp(-depth);
}

typedef struct brute_job {
    isogi_dvr *dvr;
    const brute_field *field;
    const uint32_t *point;
    double (*dir)[6]; /* in voxels, and one over it */
} brute_job;

/* By the directions and weights of the renderer. */
static void brute_task(void *arg, size_t i) {
    const brute_job *job = (const brute_job *)arg;
    isogi_dvr *d = job->dvr;
    const size_t n = d->coefficients, point = job->point[i];
    double sum[36] = {0}, from[3];
    size_t rest = point;
    for (int a = 0; a < 3; a++) {
        from[a] = (double)(rest % d->desc.grid[a]) * d->cells[a] / (double)(d->desc.grid[a] - 1);
        rest /= d->desc.grid[a];
    }
    for (size_t k = 0; k < (size_t)d->desc.directions; k++) {
        double clear = brute_ray(job->field, from, job->dir[k], job->dir[k] + 3);
        for (size_t c = 0; c < n; c++) sum[c] += clear * (double)d->kernel[k * n + c];
    }
    for (size_t c = 0; c < n; c++) d->visibility[point * n + c] = (float)sum[c];
}

/* Where the library's own brute force differs by more than `limit`, relative RMSE, from what was read or computed, at some points: forgets
   that, and ends the program. */
static void brute_check(const isogi_dvr *d, const uint8_t *marked, const char *name, const char *path, double limit) {
    double sum = 0, norm = 0;
    size_t n = d->coefficients, stride = 1, looked = 0;
    isogi_dvr__crossings crossings;
    for (size_t i = 0; i < d->point_count; i++) stride += marked[i];
    stride = 1 + stride / 8;
    for (size_t i = 0, seen = 0; i < d->point_count; i++) {
        double v[36] = {0}, grid[3], world[3];
        size_t rest = i;
        isogi_counters work = {0};
        if (!marked[i] || seen++ % stride != stride / 2) continue;
        for (int a = 0; a < 3; a++) {
            grid[a] = (double)(rest % d->desc.grid[a]) * d->cells[a] / (double)(d->desc.grid[a] - 1);
            rest /= d->desc.grid[a];
        }
        isogi_vol_to_world(d->desc.pyramid, grid, world);
        for (size_t k = 0; k < (size_t)d->desc.directions; k++) {
            double clear = isogi_dvr__transmittance(d, grid, world, d->direction[k], &crossings, &work);
            for (size_t c = 0; c < n; c++) v[c] += clear * (double)d->kernel[k * n + c];
        }
        for (size_t c = 0; c < n; c++)
            sum += pow(v[c] - (double)d->visibility[i * n + c], 2), norm += v[c] * v[c];
        looked++;
    }
    if (sum <= limit * limit * norm) return;
    remove(path);
    fprintf(stderr, "%s: kept visibility and brute force differ by %.3g at %zu points\n", name, sqrt(sum / norm), looked);
    exit(1);
}

static double brute_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* To a renderer whose method is brute force, in place of isogi_dvr_step: visibility where the view looks. Kept as it is computed; limit is
   that of brute_check. also: a number of what the caller has put into `direction` and `kernel`, 0 where they are the library's. */
static void brute_visibility(isogi_dvr *d, const isogi_view *view, const isogi_transfer *transfer, const char *name, uint64_t also,
                             double limit) {
    uint8_t *needed = (uint8_t *)calloc(d->point_count, 2), *marked = needed + d->point_count;
    uint32_t *point = (uint32_t *)malloc(d->point_count * sizeof *point);
    size_t count = 0, n = d->coefficients, known = 0, done, rays = (size_t)d->desc.directions;
    brute_field field = {NULL};
    brute_job job = {d, &field, point, (double(*)[6])malloc(rays * sizeof *job.dir)};
    double begun = brute_now(), said = begun;
    char path[256];
    FILE *file;
    if (!needed || !point || !job.dir) exit(1);
    memset(d->visibility, 0, d->point_count * n * sizeof *d->visibility); /* what is in the dark counts for nothing */
    brute_mark(d, view, transfer, needed), memcpy(marked, needed, d->point_count);
    snprintf(path, sizeof path, "build/bench/brute-%s-%d-%016llx", name, d->desc.directions,
             (unsigned long long)brute_key(d, transfer, also));
    file = fopen(path, "r+b");
    if (!file) file = fopen(path, "w+b");
    if (file) known = brute_read(file, d, needed);
    for (size_t i = 0; i < d->point_count; i++)
        if (needed[i]) point[count++] = (uint32_t)i;
    if (count) brute_field_make(&field, isogi_vol_volume(d->desc.pyramid), transfer);
    for (size_t i = 0; i < 3 * rays; i++) {
        double x = d->direction[i / 3][3 + i % 3];
        job.dir[i / 3][i % 3] = x = fabs(x) > 1e-12 ? x : 0, job.dir[i / 3][3 + i % 3] = 1 / x;
    }
    for (done = 0; done < count;) {
        size_t some = count - done < BRUTE_CHUNK ? count - done : BRUTE_CHUNK;
        job.point = point + done;
        if (isogi_parallel(&d->context, some, brute_task, &job, 0, 1) != ISOGI_OK) exit(1);
        for (size_t i = done; file && i < done + some; i++)
            if (fwrite(&point[i], sizeof *point, 1, file) != 1 || fwrite(d->visibility + point[i] * n, sizeof(float), n, file) != n)
                fclose(file), file = NULL;
        if (file) fflush(file);
        done += some;
        if (done < count && brute_now() - said < 2) continue;
        said = brute_now();
        fprintf(stderr, "\r  visibility of %s by brute force, %zu rays: %3.0f %% of %zu grid points, %.0f s%s", name, rays,
                100 * (double)(known + done) / (double)(known + count), known + count, said - begun, done < count ? "" : "\n");
    }
    if (file) fclose(file);
    brute_check(d, marked, name, path, limit);
    d->next = d->point_count;
    free(needed), free(point), free(field.value), free(field.far), free(job.dir);
}

#endif
