/* volume_file.h - volumes from raw files that carry their sizes and type in their names

       engine_256x256x128_uint8.raw       NAME_XxYxZ_TYPE.raw, x fastest, little-endian;
                                          types uint8 int8 uint16 int16 float32 float64

   Also here, because they walk over all voxels: search for voxels that are not finite, and an isovalue for a volume nobody has
   looked at yet. Needs the API part of isogi_vol.h. */
#ifndef VOLUME_FILE_H
#define VOLUME_FILE_H

#include "files.h"
#include "isogi_vol.h"
#include "large.h"
#include <ctype.h>

static inline size_t volume_type_bytes(isogi_type type) {
    static const size_t bytes[6] = {1, 1, 2, 2, 4, 8};
    return bytes[type];
}

static inline const char *volume_type_name(isogi_type type) {
    static const char *const name[6] = {"uint8", "int8", "uint16", "int16", "float32", "float64"};
    return name[type];
}

static inline const char *volume_base_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* "256x256x128" at text, which ends at end. */
static inline int volume_parse_sizes(const char *text, const char *end, size_t size[3]) {
    int a;
    for (a = 0; a < 3; a++) {
        size_t n = 0, digits = 0;
        for (; text < end && isdigit((unsigned char)*text); text++, digits++) {
            n = n * 10 + (size_t)(*text - '0');
            if (digits > 9) return 0;
        }
        if (!digits || (a < 2 ? text >= end || *text++ != 'x' : text != end)) return 0;
        size[a] = n;
    }
    return 1;
}

/* Sizes and type out of a file's name; 0 with a message when they are not there. */
static inline int volume_parse_name(const char *path, size_t size[3], isogi_type *type, char *error) {
    const char *name = volume_base_name(path), *dot = strrchr(name, '.'), *type_at, *size_at;
    size_t a, found = 6, bytes;
    if (!dot || (strcmp(dot, ".raw") && strcmp(dot, ".RAW")))
        return file_fail(error, "%s: only raw volumes are read, named like engine_256x256x128_uint8.raw", path);
    for (type_at = dot; type_at > name && type_at[-1] != '_'; type_at--) {}
    for (size_at = type_at > name ? type_at - 1 : name; size_at > name && size_at[-1] != '_'; size_at--) {}
    for (a = 0; a < 6; a++) {
        const char *candidate = volume_type_name((isogi_type)a);
        if ((size_t)(dot - type_at) == strlen(candidate) && !strncmp(type_at, candidate, strlen(candidate))) found = a;
    }
    if (type_at == name || found == 6 || !volume_parse_sizes(size_at, type_at - 1, size))
        return file_fail(error, "%s: the name must end in sizes and type, like engine_256x256x128_uint8.raw "
                                "(uint8 int8 uint16 int16 float32 float64)", path);
    bytes = volume_type_bytes((isogi_type)found);
    for (a = 0; a < 3; a++) {
        if (!size[a] || size[a] > 0x7fffffff) return file_fail(error, "%s: a size of %zu; 1 to 2147483647 are possible", path, size[a]);
        if (bytes > SIZE_MAX / 2 / size[a]) return file_fail(error, "%s: the sizes are too large for this machine", path);
        bytes *= size[a];
    }
    *type = (isogi_type)found;
    return 1;
}

static inline void volume_swap_bytes(unsigned char *data, size_t count, size_t bytes) {
    size_t i, k;
    for (i = 0; i < count; i++, data += bytes)
        for (k = 0; k < bytes / 2; k++) {
            unsigned char c = data[k];
            data[k] = data[bytes - 1 - k], data[bytes - 1 - k] = c;
        }
}

/* spacing 1, origin 0. The voxels belong to the caller, who gives them back by volume_free. *volume is untouched on failure. */
static inline int volume_read(const char *path, isogi_volume *volume, char *error) {
    isogi_volume v;
    uint64_t length;
    size_t count, bytes, a;
    unsigned char *data;
    const uint16_t one = 1;
    double machine = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    int ok, file;
    memset(&v, 0, sizeof v);
    if (!volume_parse_name(path, v.size, &v.type, error)) return 0;
    count = v.size[0] * v.size[1] * v.size[2], bytes = count * volume_type_bytes(v.type);
    file = file_open(path, &length, error);
    if (file < 0) return 0;
    if (length != bytes) file_fail(error, "%s: has %llu bytes, its name says %zu", path, (unsigned long long)length, bytes);
    else if (machine > 0 && (double)bytes > machine) file_fail(error, "%s: %.1f GiB do not fit into this machine's %.1f GiB", path,
                                                               (double)bytes / 0x1p30, machine / 0x1p30);
    if (length != bytes || (machine > 0 && (double)bytes > machine)) {
        close(file);
        return 0;
    }
    data = (unsigned char *)large_allocate(bytes);
    ok = data ? file_read_bytes(file, path, data, bytes, error) : file_fail(error, "%s: out of memory", path);
    close(file);
    if (!ok) {
        free(data);
        return 0;
    }
    if (*(const unsigned char *)&one == 0) volume_swap_bytes(data, count, volume_type_bytes(v.type));
    v.data = data;
    for (a = 0; a < 3; a++) v.spacing[a] = 1;
    *volume = v;
    return 1;
}

static inline void volume_free(isogi_volume *volume) {
    union { const void *c; void *p; } data;
    data.c = volume->data;
    free(data.p);
    memset(volume, 0, sizeof *volume);
}

/* Voxel i in storage order, of a packed volume. */
static inline double volume_voxel(const isogi_volume *v, size_t i) {
    switch (v->type) {
    case ISOGI_U8: return ((const uint8_t *)v->data)[i];
    case ISOGI_I8: return ((const int8_t *)v->data)[i];
    case ISOGI_U16: return ((const uint16_t *)v->data)[i];
    case ISOGI_I16: return ((const int16_t *)v->data)[i];
    case ISOGI_F32: return (double)((const float *)v->data)[i];
    case ISOGI_F64: return ((const double *)v->data)[i];
    }
    return 0;
}

/* Number of voxels that are NaN or infinite; *first is the first of them. With `replace` they are set to *replace (packed volumes
   whose voxels were read by volume_read only). */
static inline size_t volume_not_finite(isogi_volume *v, const double *replace, size_t *first) {
    size_t i, count = v->size[0] * v->size[1] * v->size[2], bad = 0;
    union { const void *c; void *p; } data;
    data.c = v->data;
    if (v->type != ISOGI_F32 && v->type != ISOGI_F64) return 0;
    for (i = 0; i < count; i++) {
        double x = volume_voxel(v, i);
        if (x - x == 0) continue;
        if (!bad++) *first = i;
        if (replace && v->type == ISOGI_F32) ((float *)data.p)[i] = (float)*replace;
        else if (replace) ((double *)data.p)[i] = *replace;
    }
    return bad;
}

/* An isovalue for a volume of which nothing is known: the threshold that parts the histogram into two classes of least variance
   (Otsu 1979). The largest single bin is left out: it is padding or air, and would outweigh the object; but not where all other voxels
   have one value, as in a mask: halfway between the two, then. */
static inline double volume_guess_isovalue(const isogi_volume *v, const double range[2]) {
    enum { bins = 512 };
    double histogram[bins] = {0}, total = 0, sum = 0, low = 0, low_sum = 0, best = -1, least = 0, most = 0;
    size_t i, count = v->size[0] * v->size[1] * v->size[2], stride = 1 + count / 20000000;
    int b, largest = 0, bins_used = 0;
    if (!(range[1] > range[0])) return range[0];
    for (i = 0; i < count; i += stride) {
        double x = (volume_voxel(v, i) - range[0]) / (range[1] - range[0]) * (bins - 1) + 0.5;
        if (x >= 0 && x < bins) histogram[(int)x]++;
    }
    for (b = 0; b < bins; b++) {
        bins_used += histogram[b] > 0;
        if (histogram[b] > histogram[largest]) largest = b;
    }
    if (bins_used > 2 && histogram[largest] > 0.3 * (double)(count / stride)) histogram[largest] = 0;
    for (b = 0; b < bins; b++) total += histogram[b], sum += b * histogram[b];
    for (b = 0; b < bins - 1; b++) {
        double high, difference, between;
        low += histogram[b], low_sum += b * histogram[b], high = total - low;
        if (low < 1 || high < 1) continue;
        difference = low_sum / low - (sum - low_sum) / high;
        between = low * high * difference * difference;
        if (between > best * (1 + 1e-12)) best = between, least = b;
        if (between >= best * (1 - 1e-12)) most = b; /* empty bins between two classes: take their middle */
    }
    return range[0] + (0.5 * (least + most) + 0.5) / (bins - 1) * (range[1] - range[0]);
}

#endif /* VOLUME_FILE_H */
