/* daylight.h - the light that programs take where none is given, and that of the scene engine-block: a sky of radiance 1 above to 0.3
   below, and a sun of irradiance 3 and two degrees across */
#ifndef DAYLIGHT_H
#define DAYLIGHT_H

#include "isogi_sh.h"

static const float daylight_above[3] = {1, 1, 1}, daylight_below[3] = {0.3f, 0.3f, 0.3f}, daylight_sun[3] = {3, 3, 3};
static const double daylight_to_sun[3] = {-1, 1, 0.45};
#define DAYLIGHT_SUN_RADIUS 0.01745329252 /* radians */

/* Radiance above[] towards +y, below[] downwards, linear in the cosine: two bands of spherical harmonics hold it exactly. */
static inline void daylight_sky(float sh[4][3], const float above[3], const float below[3]) {
    for (int c = 0; c < 3; c++) {
        sh[0][c] = 0.5f * (above[c] + below[c]) * 3.5449077f;
        sh[1][c] = 0.5f * (above[c] - below[c]) * 2.0466534f; /* Y_1^-1 = sqrt(3 / 4 pi) y */
        sh[2][c] = sh[3][c] = 0;
    }
}

/* Both, with +y up. `sh` and `sun` are the caller's: the lighting points at them. */
static inline void daylight_make(isogi_lighting *lighting, float sh[4][3], isogi_light *sun) {
    static const isogi_light none;
    daylight_sky(sh, daylight_above, daylight_below);
    *sun = none, sun->kind = ISOGI_LIGHT_DIRECTIONAL, sun->radius = (float)DAYLIGHT_SUN_RADIUS;
    for (int c = 0; c < 3; c++) sun->vector[c] = (float)daylight_to_sun[c], sun->rgb[c] = daylight_sun[c];
    lighting->env.sh = sh[0], lighting->env.sh_order = 2, lighting->lights = sun, lighting->light_count = 1;
}

#endif
