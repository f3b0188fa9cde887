/* procedural.h - volumes that are formulas: for the viewer, the examples and the tests

   Needs the API part of isogi_vol.h. A volume is made at any grid size, on the threads of a context:

       isogi_volume volume;
       const procedural_shape *shape = procedural_find("gyroid");
       if (procedural_make(shape, 256, &volume, NULL) == ISOGI_OK) { ... procedural_free(&volume); }

   Node i of N lies at -1 + 2 i / (N-1) along the longest axis; the other axes keep the voxels cubic. World: spacing 1, origin 0.
   procedural_value() gives the same formula at any point, so that a test may compare with what lies between the nodes. */
#ifndef PROCEDURAL_H
#define PROCEDURAL_H

#include "isogi_vol.h"
#include "large.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PROCEDURAL_PI 3.14159265358979323846

/* p: position in the box, whose longest half side is 1; voxel: the distance between nodes, for shapes whose edges are a number of
   voxels wide. */
typedef double procedural_formula(const double p[3], double voxel);

typedef struct procedural_shape {
    const char *name, *summary;
    procedural_formula *value;
    size_t size[3];  /* default grid */
    isogi_type type; /* ISOGI_F32 or ISOGI_U8 */
    double isovalue;
    float albedo[3];
    double up[3], toward[3], distance; /* camera: world up, direction from the centre of the box to the eye, radii of the box's sphere */
    const char *transfer;    /* default transfer function, in the text form of transfer_file.h */
} procedural_shape;

/* ---- signed distances: negative inside ------------------------------------------------------------------------------------ */

static inline double procedural_min(double a, double b) { return a < b ? a : b; }
static inline double procedural_max(double a, double b) { return a > b ? a : b; }
static inline double procedural_clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
static inline double procedural_length(double x, double y) { return sqrt(x * x + y * y); }

/* Union and difference whose seam is rounded over a width of about k. */
static inline double procedural_blend(double a, double b, double k) {
    double h = procedural_max(k - fabs(a - b), 0) / k;
    return procedural_min(a, b) - h * h * k * 0.25;
}
static inline double procedural_carve(double a, double b, double k) { return -procedural_blend(-a, b, k); }

/* Box with half sides x, y, z and edges rounded by r. */
static inline double procedural_box(double px, double py, double pz, double x, double y, double z, double r) {
    double a = fabs(px) - x + r, b = fabs(py) - y + r, c = fabs(pz) - z + r;
    double oa = procedural_max(a, 0), ob = procedural_max(b, 0), oc = procedural_max(c, 0);
    return sqrt(oa * oa + ob * ob + oc * oc) + procedural_min(procedural_max(a, procedural_max(b, c)), 0) - r;
}

/* Cylinder: `radial` is the distance from its axis, `along` the place on it; chamfered by c. */
static inline double procedural_cylinder(double radial, double along, double radius, double half, double c) {
    double a = radial - radius, b = fabs(along) - half;
    double oa = procedural_max(a, 0), ob = procedural_max(b, 0);
    double d = procedural_min(procedural_max(a, b), 0) + sqrt(oa * oa + ob * ob);
    return procedural_max(d, (a + b + c) * 0.70710678);
}

/* Ellipsoid: first-order distance, good near the surface. */
static inline double procedural_ellipsoid(double x, double y, double z, double a, double b, double c) {
    double k0 = sqrt(x * x / (a * a) + y * y / (b * b) + z * z / (c * c));
    double k1 = sqrt(x * x / (a * a * a * a) + y * y / (b * b * b * b) + z * z / (c * c * c * c));
    return k1 > 1e-12 ? k0 * (k0 - 1) / k1 : -procedural_min(a, procedural_min(b, c));
}

/* Capsule from a to b whose radius goes from ra to rb. */
static inline double procedural_capsule(const double p[3], const double a[3], const double b[3], double ra, double rb) {
    double ab[3], ap[3], t, dd = 0, d2 = 0, dot = 0;
    int i;
    for (i = 0; i < 3; i++) ab[i] = b[i] - a[i], ap[i] = p[i] - a[i], dd += ab[i] * ab[i], dot += ab[i] * ap[i];
    t = procedural_clamp(dot / dd, 0, 1);
    for (i = 0; i < 3; i++) d2 += (ap[i] - t * ab[i]) * (ap[i] - t * ab[i]);
    return sqrt(d2) - (ra + t * (rb - ra));
}

/* Distance to matter as a scanner shows it: 1 inside, 0 outside, an edge that goes from 10 % to 90 % within 1.5 voxels. */
static inline double procedural_matter(double d, double voxel) { return 0.5 - 0.5 * tanh(1.4648 * d / voxel); }

/* ---- formulas ---------------------------------------------------------------------------------------------------------------- */

/* Marschner and Lobb 1994, with fM = 6 and alpha = 0.25. */
static double procedural_marschner_lobb(const double p[3], double voxel) {
    const double alpha = 0.25, frequency = 6;
    double r = procedural_length(p[0], p[1]);
    (void)voxel;
    return (1 - sin(PROCEDURAL_PI * p[2] / 2) + alpha * (1 + cos(2 * PROCEDURAL_PI * frequency * cos(PROCEDURAL_PI * r / 2)))) /
           (2 * (1 + alpha));
}

static double procedural_gyroid(const double p[3], double voxel) {
    double x = 2 * PROCEDURAL_PI * (p[0] + 1), y = 2 * PROCEDURAL_PI * (p[1] + 1), z = 2 * PROCEDURAL_PI * (p[2] + 1);
    (void)voxel;
    return sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x);
}

/* Probability density of the 3d state with m = 0, largest value 1; the box reaches to 20 Bohr radii. The atom's axis is y. */
static double procedural_hydrogen(const double p[3], double voxel) {
    double x = 20 * p[0], y = 20 * p[1], z = 20 * p[2], r2 = x * x + y * y + z * z;
    double amplitude = (3 * y * y - r2) * exp(-sqrt(r2) / 3);
    (void)voxel;
    return amplitude * amplitude / (4 * 1296 * exp(-4.0));
}

/* Three Coulomb potentials, softened at their centres; the upper two are the lowest one, made smaller (Kraus 2005, figure 1). */
static double procedural_coulomb(const double p[3], double voxel) {
    static const double place[3][4] = {{0, -0.42, 0, 0.2}, {-0.42, 0.36, 0.05, 0.11}, {0.4, 0.44, -0.05, 0.085}};
    double sum = 0;
    int i;
    (void)voxel;
    for (i = 0; i < 3; i++) {
        double x = p[0] - place[i][0], y = p[1] - place[i][1], z = p[2] - place[i][2], s = place[i][3];
        sum += 1 / sqrt((x * x + y * y + z * z) / (s * s) + 0.25);
    }
    return sum;
}

/* A torus above a sphere above a perfectly flat plane, all opaque: the worst case of Kronander 2011. 1 in matter, 0 in air. */
static double procedural_torus_sphere_plane(const double p[3], double voxel) {
    double plane = p[1] + 0.7;
    double sphere = sqrt(p[0] * p[0] + (p[1] + 0.22) * (p[1] + 0.22) + p[2] * p[2]) - 0.34;
    double torus = procedural_length(procedural_length(p[0], p[2]) - 0.46, p[1] - 0.46) - 0.15;
    return procedural_matter(procedural_min(plane, procedural_min(sphere, torus)), voxel);
}

/* Half space minus a sphere that reaches through its plane: distance to the surface, positive in matter. The sphere has radius
   PROCEDURAL_CAVITY_RADIUS; its centre lies PROCEDURAL_CAVITY_DEPTH radii below the plane y = PROCEDURAL_CAVITY_PLANE, so that the
   opening takes the fraction (1 - depth) / 2 of the sphere's area. */
#define PROCEDURAL_CAVITY_RADIUS 0.7
#define PROCEDURAL_CAVITY_PLANE 0.3
#define PROCEDURAL_CAVITY_DEPTH 0.0
static double procedural_cavity(const double p[3], double voxel) {
    double y = p[1] - PROCEDURAL_CAVITY_PLANE + PROCEDURAL_CAVITY_DEPTH * PROCEDURAL_CAVITY_RADIUS;
    double outside_sphere = sqrt(p[0] * p[0] + y * y + p[2] * p[2]) - PROCEDURAL_CAVITY_RADIUS;
    (void)voxel;
    return procedural_min(PROCEDURAL_CAVITY_PLANE - p[1], outside_sphere);
}

/* ---- engine block: two cylinders, a manifold, a crankcase; lengths in voxels of the default grid, 80 to the unit --------------- */

static double procedural_engine_bolts(double x, double y, double z, double top, double radius, double depth) {
    double row = procedural_min(fabs(fabs(x) - 58), fabs(x)); /* bolts at x = -58, 0, 58 */
    return procedural_cylinder(procedural_length(row, fabs(z + 10) - 23), y - top, radius, depth, 0);
}

/* Upper block: deck, bores, water jacket, bolt holes, cooling fins. */
static double procedural_engine_block(double x, double y, double z) {
    double bore_x = fabs(x) - 31, bore = procedural_length(bore_x, z + 10), jacket, d, fins, angle;
    d = procedural_box(x, y - 20, z + 10, 68, 36, 31, 4);
    fins = fabs(y - 20 - 7 * floor((y - 20) / 7 + 0.5)) - 1.7; /* matter kept every 7 voxels */
    if (y > -6 && y < 44) d = procedural_max(d, procedural_min(fins, procedural_box(x, y - 20, z + 10, 60, 80, 23, 6)));
    d = procedural_carve(d, procedural_cylinder(bore, y - 20, 19, 60, 0), 1.5);
    angle = atan2(z + 10, bore_x);
    jacket = procedural_max(fabs(bore - 24.5) - 1.6, fabs(y - 48) - 26);
    jacket = procedural_max(jacket, (0.22 - fabs(sin(2 * angle))) * 12); /* four slots around each bore */
    d = procedural_carve(d, jacket, 1);
    d = procedural_carve(d, procedural_engine_bolts(x, y, z, 56, 3.4, 24), 1);
    d = procedural_carve(d, procedural_engine_bolts(x, y, z, 56, 5.2, 2.5), 1);
    return d;
}

/* Crankcase: a half barrel along x with bulkheads, bearings, and a bolted sump flange. */
static double procedural_engine_case(double x, double y, double z) {
    double radial = procedural_length(y + 34, z + 10), wall, d, spoke;
    d = procedural_cylinder(radial, x, 35, 66, 4);
    d = procedural_blend(d, procedural_box(x, y + 17, z + 10, 68, 5, 36, 2), 3);
    d = procedural_blend(d, procedural_box(x, y + 62, z + 10, 70, 4.5, 38, 2), 3);
    wall = procedural_cylinder(radial, x, 30, 61, 2);
    spoke = procedural_min(fabs(x), fabs(fabs(x) - 40)) - 3.5;                         /* bulkheads at x = -40, 0, 40 */
    wall = procedural_carve(wall, procedural_max(spoke, 15 - radial), 3);
    wall = procedural_min(wall, procedural_box(x, y + 66, z + 10, 61, 24, 24, 3));     /* open below */
    d = procedural_carve(d, wall, 2);
    d = procedural_blend(d, procedural_cylinder(radial, fabs(x) - 68, 21, 5, 2), 4);   /* bearing bosses at both ends */
    d = procedural_carve(d, procedural_cylinder(radial, x, 13, 90, 0), 2);
    {
        double angle = atan2(y + 34, z + 10), step = PROCEDURAL_PI / 3, a = angle - step * floor(angle / step + 0.5);
        d = procedural_carve(d, procedural_cylinder(procedural_length(radial * cos(a) - 17, radial * sin(a)), fabs(x) - 73, 1.7, 7, 0),
                             0.7);
    }
    {
        double pitch = 22, row = x - pitch * floor(x / pitch + 0.5);
        double bolt = procedural_length(row, fabs(z + 10) - 34.5);
        if (fabs(x) < 75) d = procedural_carve(d, procedural_cylinder(bolt, y + 58, 1.8, 16, 0), 0.7);
    }
    return d;
}

/* Exhaust manifold: two elbows from the front into one pipe along x. */
static double procedural_engine_manifold(double x, double y, double z) {
    double side = fabs(x) - 31, d, bore, elbow, flange, radius = 8.5, hole = 5.8;
    double straight = procedural_length(side, y - 26), qy = y - 14, qz = z - 22;
    /* the elbow's centre line: a quarter circle of radius 12 about (14, 22) in y, z */
    if (qy >= 0 && qz >= 0) elbow = procedural_length(side, procedural_length(qy, qz) - 12);
    else if (qz < 0) elbow = procedural_max(straight, -qz - 12);
    else elbow = procedural_length(side, qz - 12);
    if (qy < -16) elbow = procedural_max(elbow, -qy - 16 + elbow);
    d = procedural_max(elbow - radius, -y - 8);
    bore = procedural_max(elbow - hole, procedural_max(-y - 6, 8 - z));
    {
        double collector = procedural_length(y + 6, z - 34), along = x - 18;
        d = procedural_blend(d, procedural_cylinder(collector, along, 10, 58, 1), 4);
        bore = procedural_min(bore, procedural_cylinder(collector, along - 8, 7, 60, 0));
        d = procedural_blend(d, procedural_cylinder(collector, x - 72, 12.5, 3, 1), 2);
    }
    flange = procedural_box(side, y - 26, z - 23, 17, 11, 3, 2);
    flange = procedural_min(flange, procedural_box(side, y - 26, z - 19, 19, 13, 6, 3)); /* pad on the block, over the fins */
    flange = procedural_min(flange, procedural_cylinder(procedural_length(fabs(side) - 12.5, y - 26), z - 27, 2.8, 2.5, 0.8));
    d = procedural_blend(d, flange, 1.5);
    return procedural_carve(d, bore, 1);
}

static double procedural_engine(const double p[3], double voxel) {
    double x = 80 * p[0], y = 80 * p[1] - 8, z = 80 * p[2], edge = 80 * voxel, d, steel, bore, crown;
    d = procedural_blend(procedural_engine_block(x, y, z), procedural_engine_case(x, y, z), 2);
    bore = procedural_length(fabs(x) - 31, z + 10);
    d = procedural_max(d, -procedural_cylinder(bore, y - 10, 18.5, 70, 0)); /* the bores reach into the crankcase */
    d = procedural_min(d, procedural_engine_manifold(x, y, z));
    /* liners of steel, and a piston in the left bore with rings, dish and valve pockets */
    steel = procedural_max(fabs(bore - 18.5) - 2, fabs(y - 22) - 35.5);
    if (x < 0) {
        double groove = fabs(y - 34 - 5 * procedural_clamp(floor((y - 34) / 5 + 0.5), -1, 1)) - 1.1;
        crown = procedural_cylinder(bore, y - 22, 16.2, 20, 1.5);
        crown = procedural_max(crown, -procedural_max(groove, 14.2 - bore));
        crown = procedural_carve(crown, procedural_length(bore, y - 60) - 20.5, 1);
        crown = procedural_carve(crown, procedural_cylinder(bore, y - 6, 12.5, 18, 0), 2);
        d = procedural_min(d, crown);
    }
    d = procedural_min(d, steel);
    return 180 * procedural_matter(d, edge) + 60 * procedural_matter(steel, edge);
}

/* ---- skull: looks along +z, y is up; lengths as fractions of the box -------------------------------------------------------------- */

static double procedural_skull_teeth(double x, double y, double z, double row) {
    /* teeth stand on an arch: an ellipse of half axes 0.2, 0.26 about z = 0.4 */
    double u = x / 0.2, v = (z - 0.4) / 0.26, angle = atan2(u, v), step = 0.24;
    double cell = floor(angle / step) + 0.5, a, cx, cz, width, root;
    if (fabs(cell) > 6.5) cell = cell < 0 ? -6.5 : 6.5;
    a = cell * step, cx = 0.2 * sin(a), cz = 0.4 + 0.26 * cos(a);
    width = 0.026 + 0.005 * fabs(sin(a));
    root = procedural_ellipsoid(x - cx, y - row, z - cz, width, 0.062, width * 0.9);
    return procedural_max(root, fabs(y - row) - 0.052);
}

static double procedural_skull_mandible(double x, double y, double z) {
    double side = fabs(x), p[3], d, body;
    const double chin[3] = {0.07, -0.83, 0.6}, mid[3] = {0.21, -0.76, 0.36}, corner[3] = {0.33, -0.62, 0.06};
    const double joint[3] = {0.37, -0.2, 0.0}, horn[3] = {0.33, -0.22, 0.2}, base[3] = {0.31, -0.55, 0.16};
    p[0] = side, p[1] = y, p[2] = z;
    body = procedural_blend(procedural_capsule(p, chin, mid, 0.085, 0.08), procedural_capsule(p, mid, corner, 0.08, 0.065), 0.05);
    d = procedural_blend(body, procedural_ellipsoid(x, y + 0.86, z - 0.63, 0.13, 0.07, 0.07), 0.06);
    d = procedural_blend(d, procedural_capsule(p, corner, joint, 0.06, 0.05), 0.06);
    d = procedural_blend(d, procedural_capsule(p, base, horn, 0.06, 0.028), 0.08);
    {
        double arch = procedural_length(x / 0.2, (z - 0.4) / 0.26), wall = fabs(arch - 1) * 0.22 - 0.045;
        d = procedural_blend(d, procedural_max(procedural_max(wall, fabs(y + 0.72) - 0.06), 0.3 - z), 0.04);
    }
    return procedural_blend(d, procedural_skull_teeth(x, y, z, -0.635), 0.012);
}

/* Eye sockets and the hollows at the temples: what is not bone outside of the brain case. */
static double procedural_skull_hollows(double x, double y, double z) {
    double side = fabs(x);
    double socket = procedural_ellipsoid(side - 0.225, y + 0.005 + 0.12 * (side - 0.2), z - 0.74, 0.14, 0.13, 0.3);
    return procedural_min(socket, procedural_ellipsoid(side - 0.42, y + 0.02, z - 0.3, 0.1, 0.2, 0.17));
}

static double procedural_skull_face(double x, double y, double z, double cranium, double hollows) {
    double side = fabs(x), p[3], d = cranium, cheek, arch, nose;
    const double brow[3] = {0.08, 0.155, 0.68}, temple[3] = {0.42, 0.09, 0.54}, malar[3] = {0.4, -0.17, 0.54};
    const double zygoma[3] = {0.5, -0.15, 0.3}, ear[3] = {0.49, -0.1, -0.02}, maxilla[3] = {0.2, -0.3, 0.62};
    const double bridge[3] = {0, 0.1, 0.7}, tip[3] = {0, -0.1, 0.79}, process[3] = {0.06, 0.05, 0.66}, foot[3] = {0.14, -0.3, 0.65};
    const double pterygoid[3] = {0.14, -0.34, 0.2}, palate[3] = {0.15, -0.44, 0.36};
    p[0] = side, p[1] = y, p[2] = z;
    d = procedural_blend(d, procedural_capsule(p, brow, temple, 0.065, 0.05), 0.1);
    cheek = procedural_blend(procedural_capsule(p, temple, malar, 0.045, 0.07), procedural_capsule(p, malar, maxilla, 0.07, 0.06), 0.08);
    arch = procedural_blend(procedural_capsule(p, malar, zygoma, 0.055, 0.034), procedural_capsule(p, zygoma, ear, 0.034, 0.04), 0.05);
    d = procedural_blend(procedural_blend(d, cheek, 0.08), arch, 0.05);
    d = procedural_blend(d, procedural_ellipsoid(x, y + 0.3, z - 0.46, 0.23, 0.26, 0.25), 0.07); /* upper jaw */
    d = procedural_blend(d, procedural_capsule(p, pterygoid, palate, 0.04, 0.05), 0.06);
    d = procedural_carve(d, hollows, 0.04);
    d = procedural_blend(d, procedural_capsule(p, bridge, tip, 0.06, 0.035), 0.06);
    d = procedural_blend(d, procedural_capsule(p, process, foot, 0.045, 0.055), 0.06); /* the nose's walls, between the sockets */
    nose = procedural_blend(procedural_ellipsoid(side - 0.045, y + 0.25, z - 0.75, 0.05, 0.07, 0.25),
                            procedural_ellipsoid(x, y + 0.16, z - 0.72, 0.04, 0.11, 0.2), 0.06);
    d = procedural_carve(d, nose, 0.03);
    d = procedural_carve(d, procedural_ellipsoid(x, y + 0.58, z - 0.36, 0.15, 0.14, 0.22), 0.04); /* palate */
    return procedural_blend(d, procedural_skull_teeth(x, y, z, -0.525), 0.012);
}

static double procedural_skull(const double p[3], double voxel) {
    double x = p[0], y = p[1] - 0.06, z = p[2] + 0.02, cranium, brain, d, hollows = procedural_skull_hollows(x, y, z);
    cranium = procedural_ellipsoid(x, y - 0.26, z + 0.12, 0.57, 0.54, 0.72);
    cranium = procedural_blend(cranium, procedural_ellipsoid(x, y - 0.16, z - 0.2, 0.46, 0.42, 0.47), 0.25);
    cranium = procedural_blend(cranium, procedural_ellipsoid(x, y + 0.02, z + 0.38, 0.4, 0.3, 0.36), 0.2);
    brain = procedural_ellipsoid(x, y - 0.26, z + 0.12, 0.52, 0.48, 0.67);
    brain = procedural_blend(brain, procedural_ellipsoid(x, y - 0.22, z - 0.16, 0.4, 0.33, 0.44), 0.25);
    brain = procedural_carve(brain, hollows - 0.05, 0.03); /* a wall remains between the brain case and the hollows */
    d = procedural_skull_face(x, y, z, cranium, hollows);
    d = procedural_carve(d, brain, 0.03);
    d = procedural_carve(d, procedural_cylinder(procedural_length(x, z + 0.28), y + 0.3, 0.12, 0.25, 0), 0.04); /* where the spine enters */
    d = procedural_min(d, procedural_skull_mandible(x, y, z));
    return 200 * procedural_matter(d, voxel);
}

/* ---- the list ------------------------------------------------------------------------------------------------------------------ */

#define PROCEDURAL_TENT(low, left, peak, right, high)                                                                             \
    low " 0 .2 .3 .9\n" left " 0 .2 .3 .9\n" peak " 0.357 .9 .8 .6\n" right " 0 .9 .2 .2\n" high " 0 .9 .2 .2\n"

static const procedural_shape procedural_shapes[] = {
    {"marschner-lobb", "the test signal of Marschner and Lobb, fM 6, alpha 0.25", procedural_marschner_lobb, {128, 128, 128},
     ISOGI_F32, 0.5, {0.7f, 0.7f, 0.7f}, {0, 1, 0}, {1.5, 1.2, 2.0}, 2.3, PROCEDURAL_TENT("0", "0.45", "0.5", "0.55", "1")},
    {"gyroid", "sin x cos y + sin y cos z + sin z cos x, two periods", procedural_gyroid, {128, 128, 128}, ISOGI_F32, 0,
     {0.8f, 0.62f, 0.42f}, {0, 1, 0}, {1.5, 1.2, 2.0}, 2.3, PROCEDURAL_TENT("-1.5", "-0.15", "0", "0.15", "1.5")},
    {"hydrogen", "electron density of the 3d orbital with m = 0", procedural_hydrogen, {128, 128, 128}, ISOGI_F32, 0.05,
     {0.45f, 0.6f, 0.8f}, {0, 1, 0}, {1.5, 1.2, 2.0}, 1.9,
     "0 0 .1 .2 .9\n0.01 0 .1 .2 .9\n0.04 0.02 .1 .4 1\n0.15 0.06 .2 .8 .9\n0.4 0.2 1 .8 .3\n1 0.6 1 .3 .1\n"},
    {"coulomb", "three Coulomb potentials, two of them smaller copies of the third", procedural_coulomb, {128, 128, 128},
     ISOGI_F32, 1.2, {0.75f, 0.3f, 0.25f}, {0, 1, 0}, {0.3, 0.25, 2.0}, 1.9,
     "peak 0.72 0.35 .15 .3 .9\npeak 1.5 0.7 .9 .15 .1\n"},
    {"torus-sphere-plane", "a torus above a sphere above a flat plane, opaque", procedural_torus_sphere_plane, {128, 128, 128},
     ISOGI_F32, 0.5, {0.75f, 0.72f, 0.68f}, {0, 1, 0}, {1.5, 1.2, 2.0}, 2.3,
     "0 0 .85 .8 .75\n0.5 0 .85 .8 .75\n0.5 8 .85 .8 .75\n1 8 .85 .8 .75\n"},
    {"cavity", "half space minus a sphere that reaches through its plane; value: distance", procedural_cavity, {128, 128, 128},
     ISOGI_F32, 0, {0.5f, 0.5f, 0.5f}, {0, 1, 0}, {1.5, 2.4, 2.0}, 2.1,
     "-1 0 .8 .6 .5\n0 0 .8 .6 .5\n0 4 .8 .6 .5\n1 4 .8 .6 .5\n"},
    {"engine-block", "a machined engine block with steel liners, a piston and a manifold", procedural_engine, {160, 160, 96},
     ISOGI_U8, 90, {0.7f, 0.7f, 0.7f}, {0, 1, 0}, {1.5, 1.2, 2.0}, 1.85,
     "0 0 .7 .75 .8\n50 0 .7 .75 .8\n90 0.03 .7 .75 .8\n180 0.05 .7 .75 .8\n205 0.3 1 .6 .2\n255 0.8 1 .55 .15\n"},
    {"skull", "a skull, hollow, with teeth", procedural_skull, {128, 144, 144}, ISOGI_U8, 90, {0.8f, 0.74f, 0.62f}, {0, 1, 0},
     {1.1, 0.5, 2.0}, 1.75, "0 0 .9 .85 .7\n50 0 .9 .85 .7\n110 0.3 .9 .85 .7\n200 0.9 1 .95 .85\n"}};

#define PROCEDURAL_SHAPE_COUNT (sizeof procedural_shapes / sizeof procedural_shapes[0])

/* NULL if there is none of that name. */
static inline const procedural_shape *procedural_find(const char *name) {
    size_t i;
    for (i = 0; i < PROCEDURAL_SHAPE_COUNT; i++)
        if (!strcmp(procedural_shapes[i].name, name)) return &procedural_shapes[i];
    return NULL;
}

/* Value in the box whose longest half side is 1, with nodes `voxel` apart. */
static inline double procedural_value(const procedural_shape *shape, const double p[3], double voxel) { return shape->value(p, voxel); }

typedef struct procedural_job {
    const procedural_shape *shape;
    size_t size[3], longest;
    unsigned char *data;
} procedural_job;

static void procedural_slice(void *arg, size_t k) {
    const procedural_job *job = (const procedural_job *)arg;
    double voxel = 2.0 / (double)(job->longest - 1), p[3];
    size_t i, j, at;
    p[2] = ((double)k - 0.5 * (double)(job->size[2] - 1)) * voxel;
    for (j = 0; j < job->size[1]; j++) {
        p[1] = ((double)j - 0.5 * (double)(job->size[1] - 1)) * voxel;
        for (i = 0; i < job->size[0]; i++) {
            double value;
            p[0] = ((double)i - 0.5 * (double)(job->size[0] - 1)) * voxel;
            value = job->shape->value(p, voxel);
            at = i + job->size[0] * (j + job->size[1] * k);
            if (job->shape->type == ISOGI_U8) job->data[at] = (unsigned char)(procedural_clamp(value, 0, 255) + 0.5);
            else {
                float number = (float)value;
                memcpy(job->data + 4 * at, &number, sizeof number);
            }
        }
    }
}

/* longest: voxels along the longest axis, 2..2048; 0 = the shape's default grid. The voxels belong to the caller, who gives them
   back by procedural_free. *volume is untouched on failure. */
static inline isogi_result procedural_make(const procedural_shape *shape, size_t longest, isogi_volume *volume,
                                           const isogi_context *context) {
    procedural_job job;
    isogi_result result;
    size_t a, largest = 0, bytes = shape->type == ISOGI_U8 ? 1 : 4;
    for (a = 0; a < 3; a++) largest = shape->size[a] > largest ? shape->size[a] : largest;
    if (longest == 1 || longest > 2048) return ISOGI_INVALID;
    job.shape = shape;
    job.longest = longest ? longest : largest;
    for (a = 0; a < 3; a++) {
        job.size[a] = (shape->size[a] * job.longest + largest / 2) / largest;
        if (job.size[a] < 2) job.size[a] = 2;
    }
    job.data = (unsigned char *)large_allocate(bytes * job.size[0] * job.size[1] * job.size[2]);
    if (!job.data) return ISOGI_NO_MEMORY;
    result = isogi_parallel(context, job.size[2], procedural_slice, &job, 0, 1);
    if (result != ISOGI_OK) {
        free(job.data);
        return result;
    }
    memset(volume, 0, sizeof *volume);
    volume->data = job.data;
    volume->type = shape->type;
    for (a = 0; a < 3; a++) volume->size[a] = job.size[a], volume->spacing[a] = 1;
    return ISOGI_OK;
}

static inline void procedural_free(isogi_volume *volume) {
    union { const void *c; void *p; } data;
    data.c = volume->data;
    free(data.p);
    memset(volume, 0, sizeof *volume);
}

#endif /* PROCEDURAL_H */
