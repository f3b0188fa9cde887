/* transfer_file.h - transfer functions as text

       # value extinction r g b          a point of the piecewise linear function; two lines of one value make a step
       70   0     .8 .8 .8
       100  0.02  .8 .8 .8
       peak 130 0.5  1 .9 .8             an isosurface: value opacity r g b

   Needs the API parts of isogi_vol.h and isogi_dvr.h. */
#ifndef TRANSFER_FILE_H
#define TRANSFER_FILE_H

#include "files.h"
#include "isogi_dvr.h"

#define TRANSFER_FILE_LIMIT 4096 /* points; peaks are limited by ISOGI_DVR_MAX_PEAKS */

typedef struct transfer_file {
    isogi_transfer transfer; /* points into the arrays below */
    isogi_transfer_point *points;
    isogi_peak *peaks;
    size_t point_count, peak_count;
} transfer_file;

static inline void transfer_file_free(transfer_file *t) {
    free(t->points), free(t->peaks);
    memset(t, 0, sizeof *t);
}

/* Exactly five numbers on the line; 0 if there are more, fewer, or other things. */
static inline int transfer_numbers(const char *line, double x[5]) {
    int i;
    char *end;
    for (i = 0; i < 5; i++, line = end) {
        x[i] = strtod(line, &end);
        if (end == line || x[i] - x[i] != 0) return 0;
        if (i < 4 && *end != ' ' && *end != '\t' && *end != ',') return 0;
        while (*end == ' ' || *end == '\t' || *end == ',') end++;
    }
    return *line == 0;
}

static inline int transfer_line(transfer_file *t, const char *line, int number, char *error) {
    double x[5];
    int peak, i;
    while (*line == ' ' || *line == '\t') line++;
    if (!*line) return 1;
    peak = !strncmp(line, "peak", 4) && (line[4] == ' ' || line[4] == '\t');
    if (!transfer_numbers(peak ? line + 5 : line, x))
        return file_fail(error, "line %d is not \"value extinction r g b\" or \"peak value opacity r g b\"", number);
    if (x[1] < 0 || x[1] > 1e30 || (peak && x[1] > 1))
        return file_fail(error, "line %d: %s", number, peak ? "an opacity is 0 to 1" : "an extinction is 0 to 1e30");
    for (i = 2; i < 5; i++)
        if (x[i] < 0 || x[i] > 1) return file_fail(error, "line %d: a colour is 0 to 1", number);
    if (!peak && t->point_count && x[0] < t->points[t->point_count - 1].value)
        return file_fail(error, "line %d: values must ascend", number);
    if (t->point_count >= TRANSFER_FILE_LIMIT && !peak)
        return file_fail(error, "line %d: more than %d points", number, TRANSFER_FILE_LIMIT);
    if (t->peak_count >= ISOGI_DVR_MAX_PEAKS && peak) return file_fail(error, "line %d: more than %d peaks", number, ISOGI_DVR_MAX_PEAKS);
    if (peak) {
        isogi_peak *p = &t->peaks[t->peak_count++];
        p->isovalue = x[0], p->opacity = (float)x[1];
        for (i = 0; i < 3; i++) p->rgb[i] = (float)x[2 + i];
    } else {
        isogi_transfer_point *p = &t->points[t->point_count++];
        p->value = x[0], p->extinction = (float)x[1];
        for (i = 0; i < 3; i++) p->rgb[i] = (float)x[2 + i];
    }
    return 1;
}

/* The caller frees by transfer_file_free. *t is untouched on failure. */
static inline int transfer_parse(const char *text, transfer_file *t, char *error) {
    transfer_file parsed;
    int number = 1, ok = 1;
    memset(&parsed, 0, sizeof parsed);
    parsed.points = (isogi_transfer_point *)malloc(TRANSFER_FILE_LIMIT * sizeof *parsed.points);
    parsed.peaks = (isogi_peak *)malloc(ISOGI_DVR_MAX_PEAKS * sizeof *parsed.peaks);
    if (!parsed.points || !parsed.peaks) ok = file_fail(error, "out of memory");
    while (ok && *text) {
        char line[256];
        size_t length = strcspn(text, "\r\n"), used = strcspn(text, "\r\n#");
        if (used >= sizeof line) ok = file_fail(error, "line %d is longer than %zu characters", number, sizeof line - 1);
        else {
            memcpy(line, text, used);
            line[used] = 0;
            while (used && (line[used - 1] == ' ' || line[used - 1] == '\t')) line[--used] = 0;
            ok = transfer_line(&parsed, line, number++, error);
        }
        text += length; /* a line ends with LF, CR LF, or a CR alone */
        text += !strncmp(text, "\r\n", 2) ? 2 : *text != 0;
    }
    if (ok && !parsed.point_count && !parsed.peak_count) ok = file_fail(error, "holds no point and no peak");
    if (!ok) {
        transfer_file_free(&parsed);
        return 0;
    }
    parsed.transfer.points = parsed.points, parsed.transfer.point_count = parsed.point_count;
    parsed.transfer.peaks = parsed.peaks, parsed.transfer.peak_count = parsed.peak_count;
    *t = parsed;
    return 1;
}

static inline int transfer_read(const char *path, transfer_file *t, char *error) {
    unsigned char *data;
    size_t size;
    char why[FILE_ERROR_SIZE];
    int ok;
    if (!file_read(path, (size_t)1 << 20, &data, &size, error)) return 0;
    if (memchr(data, 0, size)) ok = file_fail(error, "%s: is not a text file", path);
    else ok = transfer_parse((const char *)data, t, why) || file_fail(error, "%.200s: %.250s", path, why);
    free(data);
    return ok;
}

#endif /* TRANSFER_FILE_H */
