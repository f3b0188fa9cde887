/* option_text.h - what several programs read from their command lines: lists of numbers, names, lights */
#ifndef OPTION_TEXT_H
#define OPTION_TEXT_H

#include "isogi_sh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Exactly `count` numbers, 6 at most, parted by `separator`, each low..high; 0 otherwise. */
static inline int numbers(const char *text, char separator, int count, double low, double high, double *out) {
    double x[6];
    char *end;
    for (int i = 0; i < count; i++, text = end + 1) {
        x[i] = strtod(text, &end);
        if (end == text || !(x[i] >= low && x[i] <= high) || *end != (i + 1 < count ? separator : 0)) return 0;
    }
    memcpy(out, x, (size_t)count * sizeof *x);
    return 1;
}

/* The same for numbers without a fraction: 16.5 is refused, not cut to 16. */
static inline int whole_numbers(const char *text, char separator, int count, double low, double high, double *out) {
    double x[6];
    if (!numbers(text, separator, count, low, high, x)) return 0;
    for (int i = 0; i < count; i++)
        if (x[i] < floor(x[i]) || x[i] > floor(x[i])) return 0;
    memcpy(out, x, (size_t)count * sizeof *x);
    return 1;
}

static inline int parse_name(const char *text, const char *const *names, int count, int *out) {
    for (int i = 0; i < count; i++)
        if (!strcmp(text, names[i])) return *out = i, 1;
    return 0;
}

/* KIND:X,Y,Z:R,G,B[:RADIUS], or rectangle:X,Y,Z:R,G,B:UX,UY,UZ:VX,VY,VZ */
static inline int light_parse(const char *text, isogi_light *light) {
    static const char *const kind_name[4] = {"directional", "point", "sphere", "rectangle"};
    char part[6][64];
    int parts = 0, kind;
    double place[3], rgb[3], radius = 0, edge[2][3] = {{0}};
    isogi_lighting alone = {.lights = light, .light_count = 1};
    for (; parts < 6; parts++) {
        size_t length = strcspn(text, ":");
        if (length > 63) return 0;
        memcpy(part[parts], text, length), part[parts][length] = 0;
        text += length;
        if (!*text) break;
        text++;
    }
    if (parts < 2 || parts > 4 || !parse_name(part[0], kind_name, 4, &kind)) return 0;
    if ((parts == 4) != (kind == ISOGI_LIGHT_RECTANGLE)) return 0;
    if (!numbers(part[1], ',', 3, -1e9, 1e9, place) || !numbers(part[2], ',', 3, 0, 1e12, rgb)) return 0;
    if (parts == 3 && !numbers(part[3], ',', 1, 0, kind == 0 ? 90 : 1e9, &radius)) return 0;
    if (kind == ISOGI_LIGHT_DIRECTIONAL && !(place[0] * place[0] + place[1] * place[1] + place[2] * place[2] > 0)) return 0;
    if (kind == ISOGI_LIGHT_SPHERE && !(radius > 0)) return 0;
    for (int k = 0; parts == 4 && k < 2; k++)
        if (!numbers(part[3 + k], ',', 3, -1e9, 1e9, edge[k])) return 0;
    memset(light, 0, sizeof *light);
    light->kind = (isogi_light_kind)kind;
    light->radius = (float)(kind == ISOGI_LIGHT_DIRECTIONAL ? radius * 3.14159265358979323846 / 180 : radius);
    for (int i = 0; i < 3; i++) light->vector[i] = (float)place[i], light->rgb[i] = (float)rgb[i];
    for (int i = 0; i < 6; i++) light->edge[i / 3][i % 3] = (float)edge[i / 3][i % 3];
    return isogi_lighting_validate(&alone) == ISOGI_OK;
}

#endif
