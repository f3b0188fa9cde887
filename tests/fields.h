/* Small volumes of doubles for tests, values first, then their pyramid. */
#ifndef FIELDS_H
#define FIELDS_H

#include "isogi_vol.h"
#include "test.h"

#define SHARED __attribute__((unused)) static

typedef struct field {
    int size[3];
    double *value; /* x fastest */
    isogi_volume volume;
    isogi_pyramid *pyramid;
} field;

SHARED const isogi_context serial = {.threads = 1};

SHARED field field_new(int x, int y, int z) {
    field f = {{x, y, z}, (double *)calloc((size_t)x * (size_t)y * (size_t)z, sizeof(double)), {0}, NULL};
    f.volume.data = f.value, f.volume.type = ISOGI_F64;
    for (int a = 0; a < 3; a++) f.volume.size[a] = (size_t)f.size[a];
    return f;
}

SHARED size_t field_count(const field *f) { return (size_t)f->size[0] * (size_t)f->size[1] * (size_t)f->size[2]; }

SHARED double *field_at(const field *f, int i, int j, int k) { return &f->value[i + f->size[0] * (j + f->size[1] * k)]; }

SHARED void field_build_with(field *f, const isogi_context *context) {
    isogi_result result = isogi_vol_build(&f->pyramid, &f->volume, context);
    CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
}

SHARED void field_free(field *f) {
    isogi_vol_free(f->pyramid);
    free(f->value);
}

SHARED size_t type_bytes(isogi_type type) { return type <= ISOGI_I8 ? 1 : type <= ISOGI_I16 ? 2 : type == ISOGI_F32 ? 4 : 8; }

/* Bit by bit, but that -ffast-math lets compilers order each copy of a formula as they like. */
SHARED int same_hit(const isogi_hit *a, const isogi_hit *b) {
#ifdef __FAST_MATH__
    return a->side == b->side && fabs(a->t - b->t) <= 1e-9 * (1 + fabs(a->t));
#else
    return a->side == b->side && !memcmp(a->cell, b->cell, sizeof a->cell) && !memcmp(a->local, b->local, sizeof a->local) &&
           !memcmp(&a->t, &b->t, sizeof a->t);
#endif
}

#undef SHARED
#endif
