/* Fields and rays for tests of the rays of isogi_vol.h. */
#ifndef RAY_FIELDS_H
#define RAY_FIELDS_H

#include "fields.h"

/* Every instruction path in turn, so that what holds for one volume after the other holds for all of them. */
__attribute__((unused)) static void field_build(field *f) {
    static int builds;
    isogi_context context = {.threads = 1, .force_path = builds++ % 5};
    field_build_with(f, &context);
}

/* Of hits that two paths may differ in: rays that only touch the surface, in lattice points and faces of its value, are decided by the
   order of sums, which -ffast-math leaves open. */
#ifdef __FAST_MATH__
#define TOUCHES_PER_HIT 1e-3
#else
#define TOUCHES_PER_HIT 0
#endif

enum { NOISE, SMOOTH, QUANTISED, KINDS };

/* White noise; a sum of a few waves; the same rounded to few levels, so that isovalues can equal data. */
static void field_fill(field *f, int kind, test_random *r) {
    double wave[4][4];
    for (int w = 0; w < 4; w++)
        for (int a = 0; a < 4; a++) wave[w][a] = random_range(r, -1, 1) * (a < 3 ? 0.9 : 6.28);
    for (int k = 0; k < f->size[2]; k++)
        for (int j = 0; j < f->size[1]; j++)
            for (int i = 0; i < f->size[0]; i++) {
                double v = 0;
                if (kind == NOISE) v = random_range(r, -1, 1);
                else for (int w = 0; w < 4; w++) v += sin(wave[w][0] * i + wave[w][1] * j + wave[w][2] * k + wave[w][3]);
                if (kind == QUANTISED) v = floor(2 * v);
                *field_at(f, i, j, k) = v;
            }
}

/* Towards a random place of the box, from within twice its size. */
static isogi_ray random_ray(const field *f, double isovalue, test_random *r) {
    isogi_ray ray = {.isovalue = isovalue};
    double d[3], target[3];
    random_direction(r, d);
    for (int a = 0; a < 3; a++) {
        target[a] = random_range(r, 0, f->size[a] - 1);
        ray.dir[a] = (float)d[a];
        ray.origin[a] = target[a] - (double)ray.dir[a] * random_range(r, 0, 1) * 2 * f->size[a];
    }
    return ray;
}

#endif
