/* camera.h - a pinhole camera: pixels to rays, points to pixels; 3-vectors of double

   Same conventions as isogi_view: row 0 on top, pixel x covers x-1/2 .. x+1/2. */
#ifndef CAMERA_H
#define CAMERA_H

#include <math.h>

typedef struct camera {
    int width, height;
    double eye[3], target[3];
    double right[3], up[3], forward[3]; /* orthonormal */
    double scale;                       /* half the height of the picture at distance 1 */
} camera;

static inline double vector_dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static inline void vector_cross(const double a[3], const double b[3], double out[3]) {
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}
/* 0 for a vector that has no direction */
static inline int vector_normalize(double v[3]) {
    double length = sqrt(vector_dot(v, v));
    int i;
    if (!(length > 1e-150 && length < 1e150)) return 0;
    for (i = 0; i < 3; i++) v[i] /= length;
    return 1;
}

/* Row-major rotation that takes +y to `up` (a unit vector) by the shortest way; half a turn about x for -y. */
static inline void rotation_from_up(const double up[3], double m[9]) {
    double c = up[1], x = up[2], z = -up[0], s = 1 / (1 + c); /* axis y cross up = (x, 0, z) */
    if (c < -1 + 1e-9) {
        static const double half_turn[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
        int i;
        for (i = 0; i < 9; i++) m[i] = half_turn[i];
        return;
    }
    m[0] = c + s * x * x, m[1] = -z, m[2] = s * x * z;
    m[3] = z, m[4] = c, m[5] = -x;
    m[6] = s * x * z, m[7] = x, m[8] = c + s * z * z;
}

static inline void rotation_apply(const double m[9], const double v[3], double out[3]) {
    double x = m[0] * v[0] + m[1] * v[1] + m[2] * v[2], y = m[3] * v[0] + m[4] * v[1] + m[5] * v[2];
    double z = m[6] * v[0] + m[7] * v[1] + m[8] * v[2];
    out[0] = x, out[1] = y, out[2] = z;
}

/* fov: vertical, in degrees. An eye straight above or below gets an arbitrary but valid right hand. */
static inline void camera_look(camera *c, int width, int height, const double eye[3], const double target[3], const double up[3],
                               double fov) {
    int i;
    c->width = width, c->height = height;
    for (i = 0; i < 3; i++) c->eye[i] = eye[i], c->target[i] = target[i], c->forward[i] = target[i] - eye[i];
    if (!vector_normalize(c->forward)) c->forward[0] = c->forward[1] = 0, c->forward[2] = -1;
    vector_cross(c->forward, up, c->right);
    if (vector_dot(c->right, c->right) < 1e-12 * vector_dot(up, up)) {
        double other[3] = {0, 0, 0};
        other[fabs(c->forward[0]) < 0.5 ? 0 : 1] = 1;
        vector_cross(c->forward, other, c->right);
    }
    vector_normalize(c->right);
    vector_cross(c->right, c->forward, c->up);
    c->scale = tan(fov * 3.14159265358979323846 / 360);
}

/* Direction through (x, y), whose component along the view's axis is 1. */
static inline void camera_direction(const camera *c, double x, double y, double d[3]) {
    double s = 2 * c->scale / c->height, a = (x + 0.5 - 0.5 * c->width) * s, b = (0.5 * c->height - y - 0.5) * s;
    int i;
    for (i = 0; i < 3; i++) d[i] = c->forward[i] + a * c->right[i] + b * c->up[i];
}

#endif /* CAMERA_H */
