/* Properties of the meshes of isogi_vol.h. */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "fields.h"

/* ---- volumes for tests ---- */

/* Random; few whole levels, so that the isovalue 0 meets data, face saddles and body saddles; columns of opposite corners against
   the others, where most passages are; a sum of waves; values over six decades. */
enum { NOISE, LEVELS, OPPOSED, SMOOTH, WIDE, KINDS };

static void field_fill(field *f, int kind, test_random *r) {
    double wave[4][4];
    int turn = (int)(random_bits(r) & 7);
    for (int w = 0; w < 4; w++)
        for (int a = 0; a < 4; a++) wave[w][a] = random_range(r, -1, 1) * (a < 3 ? 1.2 : 6.28);
    for (int k = 0; k < f->size[2]; k++)
        for (int j = 0; j < f->size[1]; j++)
            for (int i = 0; i < f->size[0]; i++) {
                int at = ((i & 1) | (j & 1) << 1 | (k & 1) << 2) ^ turn;
                double v = random_range(r, -1, 1);
                if (kind == LEVELS) v = floor(random_range(r, -3, 4));
                if (kind == OPPOSED) v = at == 0 || at == 7 ? random_range(r, 0, 1) : -random_range(r, 0, 1) * random_unit(r);
                if (kind == WIDE) v *= pow(10, random_range(r, -3, 3));
                if (kind == SMOOTH) {
                    v = 0;
                    for (int w = 0; w < 4; w++) v += sin(wave[w][0] * i + wave[w][1] * j + wave[w][2] * k + wave[w][3]);
                }
                *field_at(f, i, j, k) = v;
            }
}

/* ---- what a mesh is ---- */

static int find_root(int *parent, int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

typedef struct shape {
    long vertices, edges, triangles, components, euler; /* euler = vertices - edges + triangles */
    long open_edges, bad_edges, bad_vertices; /* one triangle only; more than two, or the same direction twice; no disk around it */
    int *component;                                     /* of each vertex, if asked for */
} shape;

typedef struct half_edge { uint32_t other; int forward; } half_edge;

/* Whether triangles around a vertex form one fan: links[2n] -> links[2n+1] */
static int single_fan(const uint32_t *links, int n) {
    int start = 0, used = 1;
    for (int i = 0; i < n; i++) {
        int has_before = 0;
        for (int j = 0; j < n; j++) has_before |= links[2 * j + 1] == links[2 * i];
        if (!has_before) start = i;
    }
    for (uint32_t at = links[2 * start + 1]; at != links[2 * start]; used++) {
        int next = -1;
        for (int j = 0; j < n; j++)
            if (links[2 * j] == at) next = j;
        if (next < 0) break;
        at = links[2 * next + 1];
        if (used > n) return 0;
    }
    return used == n;
}

/* open(a, b) says whether an edge may have one triangle; NULL: no edge may. */
static shape mesh_shape(const isogi_mesh *mesh, int (*open)(const float a[3], const float b[3], const void *), const void *arg,
                        int **component) {
    shape s = {0};
    size_t n = mesh->vertex_count, t = mesh->triangle_count;
    size_t *first = (size_t *)calloc(n + 2, sizeof *first), *fan = (size_t *)calloc(n + 2, sizeof *fan);
    half_edge *half = (half_edge *)malloc((3 * t + 1) * sizeof *half);
    uint32_t *link = (uint32_t *)malloc((6 * t + 1) * sizeof *link);
    int *parent = (int *)malloc((n + 1) * sizeof *parent);
    for (size_t v = 0; v < n; v++) parent[v] = (int)v;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < t; i++)
            for (int c = 0; c < 3; c++) {
                uint32_t a = mesh->triangles[i][c], b = mesh->triangles[i][(c + 1) % 3], low = a < b ? a : b;
                if (a >= n || b >= n || a == b) {
                    s.bad_edges++;
                    continue;
                }
                if (!pass) first[low + 2]++, fan[a + 2]++;
                else {
                    half_edge h = {a < b ? b : a, a < b};
                    half[first[low + 1]++] = h;
                    link[2 * fan[a + 1]] = b, link[2 * fan[a + 1] + 1] = mesh->triangles[i][(c + 2) % 3];
                    fan[a + 1]++;
                    parent[find_root(parent, (int)a)] = find_root(parent, (int)b);
                }
            }
        if (!pass)
            for (size_t v = 1; v < n + 2; v++) first[v] += first[v - 1], fan[v] += fan[v - 1];
    }
    for (size_t v = 0; v < n; v++) {
        for (size_t i = first[v]; i < first[v + 1]; i++) {
            int same = 0, opposite = 0, before = 0;
            for (size_t j = first[v]; j < first[v + 1]; j++) {
                if (half[j].other != half[i].other) continue;
                before += j < i;
                if (half[j].forward == half[i].forward) same++;
                else opposite++;
            }
            if (before) continue;
            s.edges++;
            if (same > 1 || opposite > 1) s.bad_edges++;
            if (same + opposite == 1) {
                s.open_edges++;
                if (!open || !open(mesh->positions[v], mesh->positions[half[i].other], arg)) s.bad_edges++;
            }
        }
        if (fan[v + 1] == fan[v] || !single_fan(link + 2 * fan[v], (int)(fan[v + 1] - fan[v]))) s.bad_vertices++;
        s.components += parent[v] == (int)v;
    }
    s.vertices = (long)n, s.triangles = (long)t, s.euler = s.vertices - s.edges + s.triangles;
    if (component) {
        for (size_t v = 0; v < n; v++) parent[v] = find_root(parent, (int)v);
        *component = parent;
    } else free(parent);
    free(first), free(fan), free(half), free(link);
    return s;
}

/* Both ends on one face of the box (volumes without spacing or origin). */
static int on_border(const float a[3], const float b[3], const void *arg) {
    const field *f = (const field *)arg;
    for (int i = 0; i < 3; i++) {
        float high = (float)(f->size[i] - 1);
        if ((a[i] <= 0 && b[i] <= 0) || (a[i] >= high && b[i] >= high)) return 1;
    }
    return 0;
}

static double mesh_volume(const isogi_mesh *mesh) {
    double volume = 0;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        const float *a = mesh->positions[mesh->triangles[i][0]], *b = mesh->positions[mesh->triangles[i][1]];
        const float *c = mesh->positions[mesh->triangles[i][2]];
        for (int k = 0; k < 3; k++) {
            int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            volume += (double)a[k] * ((double)b[k1] * (double)c[k2] - (double)b[k2] * (double)c[k1]) / 6;
        }
    }
    return volume;
}

static isogi_mesh mesh_of(const field *f, double isovalue, int normals, int closed) {
    isogi_mesh mesh = {0};
    isogi_mesh_desc desc = {.isovalue = isovalue, .normals = normals, .closed = closed};
    isogi_result result = isogi_vol_mesh(f->pyramid, &desc, &mesh);
    CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
    return mesh;
}

static int mesh_same(const isogi_mesh *a, const isogi_mesh *b) {
    size_t v = a->vertex_count * sizeof *a->positions, t = a->triangle_count * sizeof *a->triangles;
    if (a->vertex_count != b->vertex_count || a->triangle_count != b->triangle_count || !a->normals != !b->normals) return 0;
    return (!v || !memcmp(a->positions, b->positions, v)) && (!t || !memcmp(a->triangles, b->triangles, t)) &&
           (!v || !a->normals || !memcmp(a->normals, b->normals, v));
}

/* ---- the topology of the trilinear surface, by another way ----

   Every cell is swept along x. A slice is bilinear: its four columns are inside or outside, neighbours of one kind are connected, and
   if they alternate the sign of g = ad - bc says which diagonal is. Columns are linear in x and g is quadratic, so nothing changes
   between their roots: one slice between any two of them tells all, in long double. The parts of slices and their connections form a
   graph to which the solid contracts (parts of bilinear slices have no holes), whence its components and Euler characteristic.
   The surface in a cell separates pairs of solid parts, one piece for every pair that meets; chi(surface) = 2 chi(solid) -
   chi(the part of the cell's border that is inside). */

typedef struct cell_topology {
    int part[8];  /* of the solid, inside or outside, that each corner belongs to */
    int parts;    /* in all */
    int euler;    /* of the surface */
    int segments[6]; /* lines of the surface on each face */
} cell_topology;

static long double column_at(const long double f[8], int c, long double x) { return (1 - x) * f[2 * c] + x * f[2 * c + 1]; }

static long double slice_g(const long double f[8], long double x) {
    return column_at(f, 0, x) * column_at(f, 3, x) - column_at(f, 1, x) * column_at(f, 2, x);
}

static int sweep_events(const long double f[8], long double event[8]) {
    long double d[4], a, b, c = slice_g(f, 0), root;
    int n = 0;
    for (int i = 0; i < 4; i++) d[i] = f[2 * i + 1] - f[2 * i];
    a = d[0] * d[3] - d[1] * d[2], b = f[0] * d[3] + f[6] * d[0] - f[2] * d[2] - f[4] * d[1];
    event[n++] = 0;
    for (int i = 0; i < 4; i++)
        if ((f[2 * i] >= 0) != (f[2 * i + 1] >= 0)) event[n++] = f[2 * i] / (f[2 * i] - f[2 * i + 1]);
    if (b * b - 4 * a * c > 0) {
        long double q = -0.5L * (b < 0 ? b - sqrtl(b * b - 4 * a * c) : b + sqrtl(b * b - 4 * a * c));
        for (int i = 0; i < 2; i++) {
            if (i ? q != 0 : a != 0) root = i ? c / q : q / a;
            else continue;
            if (root > 0 && root < 1) event[n++] = root;
        }
    }
    event[n++] = 1;
    for (int i = 1; i < n; i++)
        for (int j = i; j > 0 && event[j] < event[j - 1]; j--) root = event[j], event[j] = event[j - 1], event[j - 1] = root;
    return n - 1; /* intervals */
}

static void unite(int *parent, int a, int b) { parent[find_root(parent, a)] = find_root(parent, b); }

/* Which columns of a slice are inside, and parts[c]: the column that names its part. */
static void slice_parts(const long double f[8], long double x, int inside[4], int part[4]) {
    int parent[4];
    for (int c = 0; c < 4; c++) inside[c] = column_at(f, c, x) >= 0, parent[c] = c;
    for (int c = 0; c < 4; c++) {
        if (inside[c] == inside[c ^ 1]) unite(parent, c, c ^ 1);
        if (inside[c] == inside[c ^ 2]) unite(parent, c, c ^ 2);
    }
    if (inside[0] == inside[3] && inside[1] == inside[2] && inside[0] != inside[1]) {
        int joined = slice_g(f, x) > 0; /* the diagonal 0-3 */
        unite(parent, joined ? 0 : 1, joined ? 3 : 2);
    }
    for (int c = 0; c < 4; c++) part[c] = find_root(parent, c);
}

/* Lines on a face and the Euler characteristic of its inside part, without edges and corners, which are counted by the caller. */
static int face_segments(const long double v[4], int *inside_bond) {
    int in[4], changes = 0;
    long double g = v[0] * v[3] - v[1] * v[2];
    for (int c = 0; c < 4; c++) in[c] = v[c] >= 0;
    changes = (in[0] != in[1]) + (in[1] != in[3]) + (in[3] != in[2]) + (in[2] != in[0]);
    *inside_bond = changes == 4 && (in[0] ? g >= 0 : g <= 0);
    return changes / 2;
}

static cell_topology sweep_cell(const long double f[8]) {
    cell_topology t = {{0}, 0, 0, {0}};
    long double event[8];
    int n = sweep_events(f, event), parent[28], inside[7][4], part[7][4], graph = 0, border = 0, bond;
    for (int i = 0; i < 4 * n; i++) parent[i] = i;
    for (int i = 0; i < n; i++) {
        slice_parts(f, 0.5L * (event[i] + event[i + 1]), inside[i], part[i]);
        for (int c = 0; c < 4; c++) {
            unite(parent, 4 * i + c, 4 * i + part[i][c]);
            graph += inside[i][c] && part[i][c] == c;
        }
        for (int link = 0, c = 0; i && c < 4; c++) {
            if (inside[i][c] != inside[i - 1][c]) continue;
            unite(parent, 4 * i + c, 4 * (i - 1) + c);
            if (!inside[i][c]) continue;
            if (!(link >> (4 * part[i][c] + part[i - 1][c]) & 1)) graph--;
            link |= 1 << (4 * part[i][c] + part[i - 1][c]);
        }
    }
    for (int i = 0; i < 4 * n; i++) t.parts += parent[i] == i;
    for (int c = 0; c < 4; c++) {
        t.part[2 * c] = find_root(parent, c), t.part[2 * c + 1] = find_root(parent, 4 * (n - 1) + c);
        border += (f[2 * c] >= 0) + (f[2 * c + 1] >= 0);
    }
    for (int a = 0; a < 3; a++) {
        int u = 1 << (a + 1) % 3, v = 1 << (a + 2) % 3;
        for (int s = 0; s < 2; s++) {
            int base = s << a;
            long double face[4] = {f[base], f[base + u], f[base + v], f[base + u + v]};
            t.segments[2 * a + s] = face_segments(face, &bond);
            border -= bond;
            border += face[0] >= 0 && face[1] >= 0 && face[2] >= 0 && face[3] >= 0;
        }
        for (int e = 0; e < 4; e++) {
            int base = (e & 1 ? u : 0) + (e & 2 ? v : 0);
            border -= f[base] >= 0 && f[base + (1 << a)] >= 0;
        }
    }
    t.euler = 2 * graph - border;
    return t;
}

/* Components and Euler characteristic of the whole surface: crossed lattice edges are connected where a cell has them between the
   same two parts; cells, lines on faces and points on edges count +chi, -1, +1. label[3 * voxel + axis]: component, or -1. */
static void field_topology(const field *f, double isovalue, long double nudge, long *components, long *euler, int *label) {
    const int *n = f->size;
    size_t voxels = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    long faces = 0;
    int *parent = (int *)malloc(3 * voxels * sizeof *parent);
    *components = *euler = 0;
    for (size_t i = 0; i < 3 * voxels; i++) parent[i] = (int)i, label[i] = -1;
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            for (int i = 0; i < n[0]; i++)
                for (int a = 0; a < 3; a++) {
                    int to[3] = {i + (a == 0), j + (a == 1), k + (a == 2)};
                    if (to[a] >= n[a] || (*field_at(f, i, j, k) >= isovalue) == (*field_at(f, to[0], to[1], to[2]) >= isovalue)) continue;
                    label[3 * (i + n[0] * (j + n[1] * k)) + a] = 0;
                    ++*euler;
                }
    for (int k = 0; k < n[2] - 1; k++)
        for (int j = 0; j < n[1] - 1; j++)
            for (int i = 0; i < n[0] - 1; i++) {
                long double v[8];
                int edge[12], pair[12], count = 0, at[3] = {i, j, k};
                for (int c = 0; c < 8; c++)
                    v[c] = (long double)*field_at(f, i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)) - (long double)isovalue;
                for (int c = 0; c < 8; c++) v[c] += nudge;
                cell_topology t = sweep_cell(v);
                *euler += t.euler;
                for (int s = 0; s < 6; s++) faces += t.segments[s] * (s & 1 || at[s / 2] == 0);
                for (int c = 0; c < 8; c++)
                    for (int a = 0; a < 3; a++) {
                        int d = c | 1 << a, in = v[c] >= 0;
                        if (c & 1 << a || in == (v[d] >= 0)) continue;
                        edge[count] = 3 * ((i + (c & 1)) + n[0] * ((j + (c >> 1 & 1)) + n[1] * (k + (c >> 2)))) + a;
                        pair[count++] = 32 * t.part[in ? c : d] + t.part[in ? d : c];
                    }
                for (int p = 0; p < count; p++)
                    for (int q = 0; q < p; q++)
                        if (pair[p] == pair[q]) unite(parent, edge[p], edge[q]);
            }
    *euler -= faces;
    for (size_t i = 0; i < 3 * voxels; i++)
        if (!label[i]) label[i] = find_root(parent, (int)i), *components += parent[i] == (int)i;
    free(parent);
}

/* The reference itself against brute force: parts of the solid among the points of a fine grid. Passages narrower than the grid are
   missed by brute force, so that only most cells can agree. */
static int sampled_parts(const long double f[8], int n, int *parent) {
    int parts = 0;
    for (int i = 0; i < n * n * n; i++) parent[i] = i;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < n * n * n; i++) {
            int at[3] = {i % n, i / n % n, i / n / n}, step = 1;
            for (int a = 0; a < 3; a++, step *= n) {
                double v[2];
                if (at[a] == n - 1 || pass) continue;
                for (int e = 0; e < 2; e++) {
                    double x = (double)(at[0] + (e && a == 0)) / (n - 1), y = (double)(at[1] + (e && a == 1)) / (n - 1);
                    double z = (double)(at[2] + (e && a == 2)) / (n - 1);
                    v[e] = 0;
                    for (int c = 0; c < 8; c++) v[e] += (double)f[c] * (c & 1 ? x : 1 - x) * (c & 2 ? y : 1 - y) * (c & 4 ? z : 1 - z);
                }
                if ((v[0] >= 0) == (v[1] >= 0)) unite(parent, i, i + step);
            }
        }
    for (int i = 0; i < n * n * n; i++) parts += parent[i] == i;
    return parts;
}

TEST(reference_topology_agrees_with_fine_sampling) {
    enum { N = 25 };
    int *parent = (int *)malloc(sizeof(int) * N * N * N);
    test_random r = {1};
    int cells = LONG_SUITE ? 3000 : QUICK_SUITE ? 80 : 200, agree = 0, passages = 0;
    for (int i = 0; i < cells; i++) {
        long double f[8];
        int n[8] = {0}, loops = 0;
        field cell = field_new(2, 2, 2);
        field_fill(&cell, i % 3 ? OPPOSED : NOISE, &r);
        for (int c = 0; c < 8; c++) f[c] = (long double)cell.value[c];
        cell_topology t = sweep_cell(f);
        for (int c = 0; c < 8; c++) loops += !n[t.part[c] % 8]++;
        agree += t.parts == sampled_parts(f, N, parent);
        passages += t.euler == 0;
        field_free(&cell);
    }
    printf("    %d of %d cells agree; %d have a passage\n", agree, cells, passages);
    CHECK(agree > 0.95 * cells, "%d of %d", agree, cells);
    CHECK(passages > cells / 100, "%d of %d", passages, cells);
    free(parent);
}

/* ---- topology ---- */

/* A vertex of a lattice edge: two whole coordinates. */
static int vertex_edge(const field *f, const float p[3]) {
    int axis = -1, at[3];
    for (int a = 0; a < 3; a++) {
        at[a] = (int)floorf(p[a]);
        if (p[a] > (float)at[a]) {
            if (axis >= 0) return -1;
            axis = a;
        }
    }
    return axis < 0 ? -1 : 3 * (at[0] + f->size[0] * (at[1] + f->size[1] * at[2])) + axis;
}

static void check_topology(isogi_mesh *mesh, const field *f, double isovalue, int kind, uint64_t seed) {
    isogi_mesh_desc desc = {.isovalue = isovalue};
    isogi_result result = isogi_vol_mesh(f->pyramid, &desc, mesh);
    CHECK(result == ISOGI_OK, "%s", isogi_result_string(result));
    int *component, *label = (int *)malloc(3 * sizeof *label * (size_t)f->size[0] * (size_t)f->size[1] * (size_t)f->size[2]);
    int *partner = (int *)malloc((mesh->vertex_count + 1) * sizeof *partner);
    long components, euler, mixed = 0;
    shape s = mesh_shape(mesh, on_border, f, &component);
    /* half-open: the surface a little below, where small whole numbers have ties */
    field_topology(f, isovalue, kind == LEVELS ? 1e-6L : 0, &components, &euler, label);
    CHECK(s.bad_edges == 0 && s.bad_vertices == 0, "kind %d seed %llu: %ld edges, %ld vertices", kind, (unsigned long long)seed,
          s.bad_edges, s.bad_vertices);
    CHECK(s.components == components && s.euler == euler, "kind %d seed %llu size %d %d %d: components %ld, not %ld; Euler %ld, not %ld",
          kind, (unsigned long long)seed, f->size[0], f->size[1], f->size[2], s.components, components, s.euler, euler);
    /* the same edges are connected, not only as many */
    for (size_t v = 0; v < mesh->vertex_count; v++) partner[v] = -1;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        int edge = vertex_edge(f, mesh->positions[v]);
        if (edge < 0 || label[edge] < 0) continue;
        if (partner[component[v]] < 0) partner[component[v]] = label[edge];
        mixed += partner[component[v]] != label[edge];
    }
    CHECK(mixed == 0, "kind %d seed %llu: %ld vertices in the wrong component", kind, (unsigned long long)seed, mixed);
    free(component), free(label), free(partner);
}

TEST(one_cell_has_the_topology_of_the_trilinear_surface) {
    int cells = LONG_SUITE ? 2000000 : 15000;
    isogi_mesh mesh = {0};
    for (int i = 0; i < cells; i++) {
        test_random r = {(uint64_t)i};
        field f = field_new(2, 2, 2);
        int kind = i % 3 == 2 ? LEVELS : i % 3 ? OPPOSED : NOISE;
        field_fill(&f, kind, &r);
        field_build_with(&f, &serial);
        check_topology(&mesh, &f, 0, kind, (uint64_t)i);
        field_free(&f);
    }
    isogi_vol_mesh_free(NULL, &mesh);
}

TEST(volumes_have_the_topology_of_the_trilinear_surface) {
    int volumes = LONG_SUITE ? 100000 : 1000;
    isogi_mesh mesh = {0};
    for (int i = 0; i < volumes; i++) {
        test_random r = {(uint64_t)i + 1000};
        int kind = i % KINDS, x = 2 + (int)(random_bits(&r) % 7), y = 2 + (int)(random_bits(&r) % 7), z = 2 + (int)(random_bits(&r) % 7);
        field f = field_new(x, y, z);
        field_fill(&f, kind, &r);
        field_build_with(&f, &serial);
        check_topology(&mesh, &f, 0, kind, (uint64_t)i);
        field_free(&f);
    }
    isogi_vol_mesh_free(NULL, &mesh);
}

/* A surface whose Euler characteristic everybody knows: radius 9 or so around the middle of a box of 32. */
enum { SPHERE, TORUS, SHELL, TWO_TORI };

static double known_shape(int which, double x, double y, double z) {
    double ring = sqrt(x * x + y * y) - 9, r = sqrt(x * x + y * y + z * z), ring2 = sqrt(x * x + z * z) - 9;
    if (which == SPHERE) return 9 - r;
    if (which == TORUS) return 4 - sqrt(ring * ring + z * z);
    if (which == SHELL) return 3 - fabs(r - 9);
    ring2 = sqrt((x - 9) * (x - 9) + z * z) - 9; /* linked with the first */
    return fmax(2.5 - sqrt(ring * ring + z * z), 2.5 - sqrt(ring2 * ring2 + y * y));
}

static field known_field(int which) {
    field f = field_new(38, 33, 31);
    for (int k = 0; k < 31; k++)
        for (int j = 0; j < 33; j++)
            for (int i = 0; i < 38; i++) *field_at(&f, i, j, k) = known_shape(which, i - 14.3, j - 16.1, k - 15.2);
    return f;
}

TEST(known_shapes_have_their_euler_characteristic) {
    const long euler[] = {2, 0, 4, 0}, components[] = {1, 1, 2, 2};
    for (int shape_kind = 0; shape_kind < 4; shape_kind++) {
        field f = known_field(shape_kind);
        field_build_with(&f, NULL);
        isogi_mesh mesh = mesh_of(&f, 0, 0, 0);
        shape s = mesh_shape(&mesh, NULL, NULL, NULL);
        CHECK(s.bad_edges == 0 && s.open_edges == 0 && s.bad_vertices == 0, "shape %d: %ld bad edges, %ld open, %ld bad vertices",
              shape_kind, s.bad_edges, s.open_edges, s.bad_vertices);
        CHECK(s.euler == euler[shape_kind] && s.components == components[shape_kind], "shape %d: Euler %ld, components %ld", shape_kind,
              s.euler, s.components);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
}

/* ---- geometry ---- */

static const double tilted[9] = {0.8, -0.6, 0.1, 0.6, 0.8, 0.05, -0.1, 0, 1.1}; /* oblique too */

static void oriented(field *f, int mirrored) {
    for (int a = 0; a < 9; a++) f->volume.axes[a] = tilted[a] * (mirrored && a % 3 == 1 ? -1 : 1);
    f->volume.spacing[0] = 0.5, f->volume.spacing[1] = 2, f->volume.spacing[2] = 1.25;
    f->volume.origin[0] = -20, f->volume.origin[1] = 7, f->volume.origin[2] = 3;
}

static double trilinear_at(const field *f, const double grid[3]) {
    int c[3];
    double u[3], v = 0;
    for (int a = 0; a < 3; a++) {
        c[a] = (int)floor(grid[a]);
        c[a] = c[a] < 0 ? 0 : c[a] > f->size[a] - 2 ? f->size[a] - 2 : c[a];
        u[a] = grid[a] - c[a];
    }
    for (int n = 0; n < 8; n++)
        v += *field_at(f, c[0] + (n & 1), c[1] + (n >> 1 & 1), c[2] + (n >> 2)) * (n & 1 ? u[0] : 1 - u[0]) * (n & 2 ? u[1] : 1 - u[1]) *
             (n & 4 ? u[2] : 1 - u[2]);
    return v;
}

/* Coordinates below 8 are right to 2^-22 in float, the field's slope is below 2 sqrt(3) per cell: 4e-7 times that, and some. */
TEST(vertices_lie_on_the_surface) {
    double worst = 0;
    long inner = 0;
    for (int i = 0; i < 400; i++) {
        test_random r = {(uint64_t)i};
        field f = field_new(8, 7, 6);
        field_fill(&f, i & 1 ? OPPOSED : NOISE, &r);
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 0.05, 0, 0);
        for (size_t v = 0; v < mesh.vertex_count; v++) {
            double p[3];
            for (int a = 0; a < 3; a++) p[a] = (double)mesh.positions[v][a];
            inner += vertex_edge(&f, mesh.positions[v]) < 0;
            worst = fmax(worst, fabs(trilinear_at(&f, p) - 0.05));
        }
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
    printf("    largest error of a vertex's value %.3g; %ld vertices inside of cells\n", worst, inner);
    CHECK(worst < 2e-6, "%g", worst);
    CHECK(inner > 100, "%ld", inner);
}

/* Passages without width: the saddle in their middle has exactly the isovalue, and rounding says either side. */
TEST(vertices_of_passages_without_width_lie_on_the_surface) {
    const double cell[5][9] = {{1, 1, 1, 3, 4, 1, 1, 0, 1.5}, {4, 1, 0, 0, 0, 0, 0, 3, 1},    {1, 0, 2, 1, 0, 4, 0, 0, 1},
                               {0, 0, 0, 3, 4, 1, 0, 0, 1},   {-1, -1, -1, -3, -4, -1, -1, 0, -1.5}}; /* corners x + 2y + 4z, isovalue */
    for (int c = 0; c < 5; c++)
        for (int turn = 0; turn < 8; turn++) {
            field f = field_new(2, 2, 2);
            for (int i = 0; i < 8; i++) *field_at(&f, i & 1, i >> 1 & 1, i >> 2) = cell[c][i ^ turn];
            field_build_with(&f, &serial);
            isogi_mesh mesh = mesh_of(&f, cell[c][8], 0, 0);
            for (size_t v = 0; v < mesh.vertex_count; v++) {
                double p[3];
                for (int a = 0; a < 3; a++) p[a] = (double)mesh.positions[v][a];
                CHECK(fabs(trilinear_at(&f, p) - cell[c][8]) < 1e-6, "cell %d turned by %d: (%g %g %g) has %g", c, turn, p[0], p[1], p[2],
                      trilinear_at(&f, p));
            }
            CHECK(mesh.vertex_count > 0, "cell %d", c);
            isogi_vol_mesh_free(f.pyramid, &mesh);
            field_free(&f);
        }
}

/* A triangle of a sphere's mesh is seen counter-clockwise from its outside, which is the low side; in mirrored axes too. */
TEST(triangles_turn_counter_clockwise_seen_from_the_low_side) {
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        field f = known_field(SPHERE);
        long wrong = 0;
        double centre[3], grid[3] = {14.3, 16.1, 15.2}, expected;
        oriented(&f, mirrored);
        field_build_with(&f, NULL);
        isogi_vol_to_world(f.pyramid, grid, centre);
        isogi_mesh mesh = mesh_of(&f, 0, 0, 0);
        for (size_t i = 0; i < mesh.triangle_count; i++) {
            double p[3][3], volume = 0;
            for (int c = 0; c < 3; c++)
                for (int a = 0; a < 3; a++) p[c][a] = (double)mesh.positions[mesh.triangles[i][c]][a] - centre[a];
            for (int a = 0; a < 3; a++)
                volume += p[0][a] * (p[1][(a + 1) % 3] * p[2][(a + 2) % 3] - p[1][(a + 2) % 3] * p[2][(a + 1) % 3]);
            wrong += volume <= 0;
        }
        CHECK(wrong == 0 && mesh.triangle_count > 1000, "mirrored %d: %ld of %zu", mirrored, wrong, mesh.triangle_count);
        /* det(axes) times the spacings times the ball; the chords of cells of a ninth of the radius lose about 1 % */
        const double *m = f.volume.axes;
        double det = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
        expected = 4.0 / 3 * 3.14159265358979 * 729 * fabs(det) * 1.25;
        CHECK(fabs(mesh_volume(&mesh) / expected - 1) < 0.01, "volume %g, not %g", mesh_volume(&mesh), expected);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
}

/* The B-spline's gradient is exact for quadratics: the world's normal of a sphere in world space, on oblique anisotropic axes. */
TEST(normals_are_those_of_the_smoothed_field) {
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        field f = field_new(40, 30, 30);
        double centre[3], middle[3] = {20.2, 14.1, 15.3}, worst = 0;
        oriented(&f, mirrored);
        field_build_with(&f, NULL);
        isogi_vol_to_world(f.pyramid, middle, centre);
        for (int k = 0; k < 30; k++)
            for (int j = 0; j < 30; j++)
                for (int i = 0; i < 40; i++) {
                    double g[3] = {i, j, k}, w[3], d = 0;
                    isogi_vol_to_world(f.pyramid, g, w);
                    for (int a = 0; a < 3; a++) d += (w[a] - centre[a]) * (w[a] - centre[a]);
                    *field_at(&f, i, j, k) = 36 - d;
                }
        isogi_vol_free(f.pyramid);
        field_build_with(&f, NULL);
        isogi_mesh mesh = mesh_of(&f, 0, 1, 0);
        for (size_t v = 0; v < mesh.vertex_count; v++) {
            double n[3], length = 0, e = 0;
            for (int a = 0; a < 3; a++) n[a] = (double)mesh.positions[v][a] - centre[a], length += n[a] * n[a];
            for (int a = 0; a < 3; a++) e = fmax(e, fabs(n[a] / sqrt(length) - (double)mesh.normals[v][a]));
            worst = fmax(worst, e);
        }
        /* positions of size 30 are right to 2e-6, over a radius of 6 */
        CHECK(worst < 2e-6 && mesh.vertex_count > 500, "mirrored %d: %g at %zu vertices", mirrored, worst, mesh.vertex_count);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
}

/* Normals do not depend on the unit of the values, nor on a constant that is added: doubles of 1e-290 and of 1e290, whose squares are no
   doubles, and 0.01 beside 1e12. There the values are right to 1e-4, gradients of 0.08 to 1e-3 or better. */
TEST(normals_of_any_magnitude) {
    static const double unit[6] = {1, 1e-160, 1e-290, 1e160, 1e290, 0.01}, added[6] = {0, 0, 0, 0, 0, 1e12};
    static const double middle[3] = {5.4, 5.6, 5.5};
    for (int n = 0; n < 6; n++) {
        static double value[12 * 12 * 12];
        isogi_volume v = {.data = value, .type = ISOGI_F64, .size = {12, 12, 12}};
        isogi_mesh_desc desc = {.isovalue = added[n], .normals = 1};
        isogi_pyramid *pyramid = NULL;
        isogi_mesh mesh = {0};
        double worst = 0;
        for (int i = 0; i < 12 * 12 * 12; i++) {
            double x = i % 12 - middle[0], y = i / 12 % 12 - middle[1], z = i / 144 - middle[2];
            value[i] = unit[n] * (16.3 - (x * x + y * y + z * z)) + added[n];
        }
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK && isogi_vol_mesh(pyramid, &desc, &mesh) == ISOGI_OK, "unit %g", unit[n]);
        for (size_t i = 0; i < mesh.vertex_count; i++) {
            double to[3], length = 0;
            isogi_hit hit = {.side = 1};
            float smooth[1][3];
            for (int a = 0; a < 3; a++) {
                double x = (double)mesh.positions[i][a];
                hit.cell[a] = (uint32_t)x, hit.local[a] = x - floor(x), to[a] = x - middle[a], length += to[a] * to[a];
            }
            isogi_vol_normals(pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, smooth);
            for (int a = 0; a < 3; a++) {
                worst = fmax(worst, fabs((double)mesh.normals[i][a] - to[a] / sqrt(length)));
                worst = fmax(worst, fabs((double)smooth[0][a] - to[a] / sqrt(length)));
            }
        }
        CHECK(mesh.vertex_count > 200 && worst < (n < 5 ? 1e-5 : 1e-3), "unit %g, %g added: %g", unit[n], added[n], worst);
        isogi_vol_mesh_free(pyramid, &mesh), isogi_vol_free(pyramid);
    }
}

/* At every border and for every type: the same gradient as isogi_vol_sample_smooth gives. */
TEST(normals_agree_with_sampling) {
    const int sizes[4][3] = {{9, 8, 7}, {2, 5, 3}, {3, 2, 2}, {4, 3, 6}};
    for (int i = 0; i < 40; i++) {
        test_random r = {(uint64_t)i};
        field f = field_new(sizes[i % 4][0], sizes[i % 4][1], sizes[i % 4][2]);
        field_fill(&f, SMOOTH, &r);
        oriented(&f, i & 1);
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 0.1, 1, 0);
        double worst = 0;
        for (size_t v = 0; v < mesh.vertex_count; v++) {
            float g[1][3] = {{0}};
            double length, unit = 0;
            isogi_vol_sample_smooth(f.pyramid, (const float(*)[3])&mesh.positions[v], 1, NULL, g);
            length = sqrt((double)g[0][0] * (double)g[0][0] + (double)g[0][1] * (double)g[0][1] + (double)g[0][2] * (double)g[0][2]);
            if (length < 1e-3) continue;
            for (int a = 0; a < 3; a++) {
                worst = fmax(worst, fabs((double)mesh.normals[v][a] + (double)g[0][a] / length) * fmin(length, 1));
                unit += (double)mesh.normals[v][a] * (double)mesh.normals[v][a];
            }
            worst = fmax(worst, fabs(unit - 1));
        }
        /* float points of size 30 move by 2e-6, where the gradient changes by about its own size per cell of 0.5 */
        CHECK(worst < 3e-5, "volume %d: %g", i, worst);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
}

/* ---- closed meshes ---- */

TEST(closed_meshes_have_no_border) {
    for (int i = 0; i < (LONG_SUITE ? 1500 : QUICK_SUITE ? 200 : 500); i++) {
        test_random r = {(uint64_t)i + 7};
        field f = field_new(2 + (int)(random_bits(&r) % 5), 2 + (int)(random_bits(&r) % 5), 2 + (int)(random_bits(&r) % 5));
        int n[3] = {f.size[0], f.size[1], f.size[2]}, inside = 0, parts = 0;
        double inner = 0;
        field_fill(&f, i % KINDS, &r);
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 0, 1, 1), open = mesh_of(&f, 0, 0, 0);
        shape s = mesh_shape(&mesh, NULL, NULL, NULL);
        CHECK(s.bad_edges == 0 && s.open_edges == 0 && s.bad_vertices == 0, "volume %d: %ld bad edges, %ld open, %ld bad vertices", i,
              s.bad_edges, s.open_edges, s.bad_vertices);
        for (int v = 0; v < n[0] * n[1] * n[2]; v++) inside += f.value[v] >= 0;
        CHECK((mesh.triangle_count > 0) == (inside > 0), "volume %d: %zu triangles, %d voxels inside", i, mesh.triangle_count, inside);
        /* what it holds and what its negative holds fill the box; half-open makes no difference to volumes */
        for (int v = 0; v < n[0] * n[1] * n[2]; v++) f.value[v] = -f.value[v];
        isogi_vol_free(f.pyramid);
        field_build_with(&f, &serial);
        isogi_mesh rest = mesh_of(&f, 0, 0, 1);
        inner = mesh_volume(&mesh);
        CHECK(inner >= 0 && inner <= (n[0] - 1) * (n[1] - 1) * (n[2] - 1) * 1.000001, "volume %d: %g", i, inner);
        CHECK(mesh.triangle_count >= open.triangle_count, "volume %d", i);
        parts = mesh_volume(&rest) >= 0;
        CHECK(parts, "volume %d: %g", i, mesh_volume(&rest));
        isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &open), isogi_vol_mesh_free(f.pyramid, &rest);
        field_free(&f);
    }
}

TEST(a_closed_box_is_a_box) {
    field f = field_new(5, 4, 3);
    for (int i = 0; i < 60; i++) f.value[i] = 1;
    field_build_with(&f, NULL);
    isogi_mesh mesh = mesh_of(&f, 0, 1, 1), full = mesh_of(&f, 1, 0, 1), none = mesh_of(&f, 1.5, 1, 1), open = mesh_of(&f, 0, 0, 0);
    shape s = mesh_shape(&mesh, NULL, NULL, NULL);
    CHECK(s.euler == 2 && s.components == 1 && s.open_edges == 0 && s.bad_edges == 0, "Euler %ld, components %ld", s.euler, s.components);
    CHECK(fabs(mesh_volume(&mesh) - 24) < 1e-9 && fabs(mesh_volume(&full) - 24) < 1e-9, "volume %g %g", mesh_volume(&mesh),
          mesh_volume(&full));
    CHECK(mesh.triangle_count == 2 * 2 * (4 * 3 + 3 * 2 + 4 * 2), "%zu", mesh.triangle_count);
    CHECK(none.triangle_count == 0 && none.vertex_count == 0 && open.triangle_count == 0, "%zu %zu", none.triangle_count,
          open.triangle_count);
    for (size_t v = 0; v < mesh.vertex_count; v++)
        for (int a = 0; a < 3; a++) {
            float at = mesh.positions[v][a], last = (float)f.size[a] - 1, n = mesh.normals[v][a];
            CHECK(at <= 0 ? n < 0 : at >= last ? n > 0 : fabsf(n) <= 0, "vertex %zu axis %d: at %g, normal %g", v, a, (double)at,
                (double)n);
        }
    isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &full);
    isogi_vol_mesh_free(f.pyramid, &none), isogi_vol_mesh_free(f.pyramid, &open);
    field_free(&f);
}

/* A half space cut obliquely: its closed mesh holds exactly what the plane leaves of the box. */
TEST(a_closed_half_space_holds_its_volume) {
    field f = field_new(6, 6, 6);
    for (int i = 0; i < 216; i++) f.value[i] = 5.25 - (i % 6 + 0.5 * (i / 6 % 6)); /* x + y/2 <= 5.25 */
    field_build_with(&f, NULL);
    isogi_mesh mesh = mesh_of(&f, 0, 0, 1);
    /* area of {x + y/2 <= 5.25} in the square of side 5: 25 minus the triangle with legs 2.25 and 4.5 */
    CHECK(fabs(mesh_volume(&mesh) - 5 * (25 - 0.5 * 2.25 * 4.5)) < 1e-4, "%g", mesh_volume(&mesh));
    isogi_vol_mesh_free(f.pyramid, &mesh);
    field_free(&f);
}

/* ---- voxels that are not finite, thin volumes, data at the isovalue, types ---- */

/* The cells around a bad voxel are cut out, and nothing else changes. */
TEST(cells_with_a_voxel_that_is_not_finite_are_left_out) {
    const double bad[3] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < (LONG_SUITE ? 600 : 200); i++) {
        test_random r = {(uint64_t)i + 3};
        field f = field_new(7, 6, 8);
        long kept = 0, unused = 0;
        field_fill(&f, i & 1 ? SMOOTH : NOISE, &r);
        if (i % 5 == 0)
            for (int v = 0; v < 7 * 6 * 8; v++)
                f.value[v] = fabs(f.value[v]) * (v % 7 < 3 ? 1 : -1); /* sides that meet in a bad plane only */
        field_build_with(&f, &serial);
        isogi_mesh whole = mesh_of(&f, 0, 0, i & 2);
        isogi_vol_free(f.pyramid);
        for (int v = 0; v < 7 * 6 * 8; v++)
            if (i % 5 == 0 ? v % 7 == 3 : random_unit(&r) < 0.02) f.value[v] = bad[v % 3];
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 0, 1, i & 2);
        for (size_t t = 0; t < whole.triangle_count; t++) {
            int cell[3], good = 1;
            for (int a = 0; a < 3; a++) {
                double c = 0;
                for (int n = 0; n < 3; n++) c += (double)whole.positions[whole.triangles[t][n]][a] / 3;
                cell[a] = c > f.size[a] - 2 ? f.size[a] - 2 : (int)c;
            }
            for (int n = 0; n < 8; n++) good &= test_finite(*field_at(&f, cell[0] + (n & 1), cell[1] + (n >> 1 & 1), cell[2] + (n >> 2)));
            kept += good;
        }
        CHECK((long)mesh.triangle_count == kept, "volume %d: %zu triangles, not %ld", i, mesh.triangle_count, kept);
        char *used = (char *)calloc(mesh.vertex_count + 1, 1);
        for (size_t t = 0; t < mesh.triangle_count; t++)
            for (int n = 0; n < 3; n++) used[mesh.triangles[t][n]] = 1;
        for (size_t v = 0; v < mesh.vertex_count; v++) {
            unused += !used[v];
            for (int a = 0; a < 3; a++) CHECK(isfinite(mesh.positions[v][a]) && isfinite(mesh.normals[v][a]), "volume %d vertex %zu", i, v);
        }
        CHECK(unused == 0, "volume %d: %ld vertices without a triangle", i, unused);
        free(used);
        isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &whole);
        field_free(&f);
    }
}

/* A ball whose surroundings are masked out from one or two voxels above its surface: smoothed normals of hits and vertices, which would
   need what is masked, point out of the ball; those of a sheet one voxel thick, where the field rises on both sides, across it. */
TEST(surfaces_beside_a_mask_have_normals) {
    for (int type = 0; type < 2; type++)
        for (int layer = 0; layer < 4; layer++) {
            enum { N = 26 };
            static float floats[N * N * N];
            const double centre[3] = {12.3, 12.6, 12.1}, radius = 8.2;
            field f = field_new(N, N, N);
            double worst[2] = {1, 1};
            int hits = 0;
            for (int i = 0; i < N * N * N; i++) {
                double r = 0;
                for (int a = 0; a < 3; a++) r += pow((a ? a > 1 ? i / N / N : i / N % N : i % N) - centre[a], 2);
                f.value[i] = sqrt(r) > radius + 1 + 0.4 * layer ? (double)NAN : radius - sqrt(r), floats[i] = (float)f.value[i];
            }
            if (type) f.volume.data = floats, f.volume.type = ISOGI_F32;
            field_build_with(&f, &serial);
            isogi_mesh mesh = mesh_of(&f, 0, 1, 0);
            for (size_t v = 0; v < mesh.vertex_count; v++) {
                double along = 0, length = 0;
                for (int a = 0; a < 3; a++) {
                    double out = (double)mesh.positions[v][a] - centre[a];
                    along += out * (double)mesh.normals[v][a], length += out * out;
                }
                worst[0] = fmin(worst[0], along / sqrt(length));
            }
            test_random r = {(uint64_t)layer + 9};
            for (int n = 0; n < 2000; n++) {
                isogi_ray ray = {.tmax = 99};
                isogi_hit hit;
                float normal[1][3];
                double d[3], along = 0;
                random_direction(&r, d);
                for (int a = 0; a < 3; a++) ray.origin[a] = centre[a], ray.dir[a] = (float)d[a];
                isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
                if (!hit.side) continue;
                isogi_vol_normals(f.pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal), hits++;
                for (int a = 0; a < 3; a++) along += d[a] * (double)normal[0][a];
                worst[1] = fmin(worst[1], along);
            }
            CHECK(mesh.vertex_count > 300 && hits > 500, "%zu vertices, %d hits", mesh.vertex_count, hits);
            CHECK(worst[0] > 0.97 && worst[1] > 0.97, "cosines to the radius from %g at vertices, %g at hits", worst[0], worst[1]);
            isogi_vol_mesh_free(f.pyramid, &mesh);
            field_free(&f);
        }
    field f = field_new(9, 9, 9);
    for (int i = 0; i < 729; i++) f.value[i] = i / 81 == 4 ? 1 : i / 81 == 6 ? (double)NAN : -1;
    field_build_with(&f, &serial);
    isogi_ray ray = {.origin = {3.5, 4.5, 4.9}, .dir = {0.25f, 0.5f, -1}, .tmax = 9, .isovalue = 1};
    isogi_hit hit;
    float normal[1][3];
    isogi_vol_intersect(f.pyramid, &ray, 1, &hit, NULL);
    isogi_vol_normals(f.pyramid, &hit, 1, ISOGI_NORMAL_SMOOTH, normal);
    CHECK(hit.side && !(fabs((double)normal[0][0]) > 1e-6) && !(fabs((double)normal[0][1]) > 1e-6) && fabs((double)normal[0][2]) > 0.999,
          "side %d, normal %g %g %g", hit.side, (double)normal[0][0], (double)normal[0][1], (double)normal[0][2]);
    field_free(&f);
}

/* Two chunks that share a plane, which a mask crosses, or next to which one begins that only the second holds, or two voxels from which one
   lies at the field's border: there the vertices of both have the same normals. */
TEST(chunks_agree_beside_a_mask) {
    enum { N = 25, PLANE = 9 };
    static float data[N * N * N];
    const isogi_mesh_desc desc = {.isovalue = 0, .normals = 1};
    for (int mask = 0; mask < 3; mask++) {
        isogi_pyramid *part[2];
        isogi_mesh mesh[2];
        int compared = 0;
        for (int i = 0; i < N * N * N; i++) {
            const int x = i % N, y = i / N % N, z = i / N / N;
            const double r = sqrt(pow(x - 12.3, 2) + pow(y - 12.1, 2) + (mask < 2 ? pow(z - 11.8, 2) : 0));
            const int masked = mask == 0 ? r > 9 : mask == 1 ? x > PLANE + 1 : x == PLANE + 2 && z < 2;
            data[i] = masked ? NAN : (float)(8 - r + 0.2 * sin(2 * x + z) * (mask == 2));
        }
        for (int p = 0; p < 2; p++) {
            isogi_volume v = {.data = data + (p ? PLANE : 0), .type = ISOGI_F32, .size = {p ? N - PLANE : PLANE + 1, N, N}};
            v.stride[0] = 4, v.stride[1] = 4 * N, v.stride[2] = 4 * N * N;
            if (p) v.halo_low[0] = PLANE, v.first[0] = PLANE;
            else v.halo_high[0] = N - 1 - PLANE;
            memset(&mesh[p], 0, sizeof mesh[p]);
            CHECK(isogi_vol_build(&part[p], &v, &serial) == ISOGI_OK && isogi_vol_mesh(part[p], &desc, &mesh[p]) == ISOGI_OK, "part %d", p);
        }
        for (size_t i = 0; i < mesh[0].vertex_count; i++)
            for (size_t j = 0; j < mesh[1].vertex_count; j++) {
                double length = 0;
                if (memcmp(mesh[0].positions[i], mesh[1].positions[j], sizeof mesh[0].positions[i])) continue;
                compared++;
                for (int a = 0; a < 3; a++) {
                    length += pow((double)mesh[0].normals[i][a], 2);
                    CHECK(fabs((double)(mesh[0].normals[i][a] - mesh[1].normals[j][a])) < 1e-5,
                          "mask %d, vertex %zu: %g and %g along axis %d", mask, i, (double)mesh[0].normals[i][a],
                          (double)mesh[1].normals[j][a], a);
                }
                CHECK(fabs(length - 1) < 1e-5, "vertex %zu: length %g", i, length);
            }
        CHECK(compared > 30, "%d vertices compared", compared);
        for (int p = 0; p < 2; p++) isogi_vol_mesh_free(part[p], &mesh[p]), isogi_vol_free(part[p]);
    }
}

/* Blocks that the pyramid knows to be on one side are not read: what is put there behind its back is not seen. A block's diagonal is
   below 7 voxels, so none that meets the surface reaches further than that. */
TEST(blocks_without_surface_are_not_read) {
    field f = known_field(SPHERE);
    long changed = 0;
    field_build_with(&f, &serial);
    isogi_mesh before = mesh_of(&f, 0, 0, 0);
    for (int v = 0; v < 38 * 33 * 31; v++)
        if (fabs(f.value[v]) > 7) f.value[v] = -f.value[v], changed++;
    isogi_mesh after = mesh_of(&f, 0, 0, 0);
    CHECK(mesh_same(&before, &after) && changed > 1000, "%zu triangles, %zu; %ld voxels changed", before.triangle_count,
          after.triangle_count, changed);
    isogi_vol_mesh_free(f.pyramid, &before), isogi_vol_mesh_free(f.pyramid, &after);
    field_free(&f);
}

/* Rows are worked on 64 voxels at a time: nothing may show where one word ends and the next begins. */
TEST(rows_of_any_length) {
    const int lengths[] = {63, 64, 65, 66, 67, 127, 128, 129, 130, 131, 193, 257};
    isogi_mesh open = {0};
    for (int i = 0; i < 12; i++) {
        test_random r = {(uint64_t)i};
        field f = field_new(lengths[i], 3 + i % 3, 4);
        field_fill(&f, NOISE, &r);
        field_build_with(&f, &serial);
        check_topology(&open, &f, 0, NOISE, (uint64_t)i);
        isogi_mesh mesh = mesh_of(&f, 0, 0, 1);
        shape s = mesh_shape(&mesh, NULL, NULL, NULL);
        CHECK(s.bad_edges == 0 && s.open_edges == 0 && s.bad_vertices == 0, "%d voxels: %ld bad edges, %ld open, %ld bad vertices",
              lengths[i], s.bad_edges, s.open_edges, s.bad_vertices);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
    isogi_vol_mesh_free(NULL, &open);
}

TEST(thin_volumes) {
    for (int i = 0; i < 27; i++) {
        field f = field_new(1 + i % 3, 1 + i / 3 % 3, 1 + i / 9);
        int flat = f.size[0] == 1 || f.size[1] == 1 || f.size[2] == 1;
        for (int v = 0; v < f.size[0] * f.size[1] * f.size[2]; v++) f.value[v] = v ? -1 : 1;
        field_build_with(&f, NULL);
        isogi_mesh mesh = mesh_of(&f, 0, 1, 0), closed = mesh_of(&f, 0, 1, 1);
        CHECK(mesh.triangle_count == (flat ? 0 : 1), "size %d %d %d: %zu", f.size[0], f.size[1], f.size[2], mesh.triangle_count);
        CHECK(closed.triangle_count == (flat ? 0 : 4), "size %d %d %d: %zu", f.size[0], f.size[1], f.size[2], closed.triangle_count);
        isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &closed);
        field_free(&f);
    }
}

/* A corner at the isovalue is inside: meshes at data levels have the topology of those just below. */
TEST(bytes_at_the_isovalue_are_inside) {
    for (int i = 0; i < 60; i++) {
        enum { N = 9 };
        test_random r = {(uint64_t)i};
        uint8_t data[N * N * N];
        field f = field_new(N, N, N);
        for (int v = 0; v < N * N * N; v++) f.value[v] = data[v] = (uint8_t)(random_bits(&r) % (i & 1 ? 4 : 256));
        f.volume.data = data, f.volume.type = ISOGI_U8;
        field_build_with(&f, &serial);
        double level = i & 1 ? 2 : 100;
        isogi_mesh at = mesh_of(&f, level, 0, 0);
        shape s = mesh_shape(&at, on_border, &f, NULL);
        CHECK(s.bad_edges == 0 && s.bad_vertices == 0, "volume %d: %ld, %ld", i, s.bad_edges, s.bad_vertices);
        if (i & 1) { /* few levels: 1e-6 decides no tie that is not one */
            isogi_mesh below = mesh_of(&f, level - 1e-6, 0, 0);
            int same = at.vertex_count == below.vertex_count && at.triangle_count == below.triangle_count;
            CHECK(same, "volume %d: %zu %zu, %zu %zu", i, at.vertex_count, below.vertex_count, at.triangle_count, below.triangle_count);
            shape t = mesh_shape(&below, on_border, &f, NULL);
            CHECK(s.components == t.components && s.euler == t.euler, "volume %d: %ld, %ld; %ld, %ld", i, s.components, t.components,
                  s.euler, t.euler);
            isogi_vol_mesh_free(f.pyramid, &below);
        }
        isogi_vol_mesh_free(f.pyramid, &at);
        field_free(&f);
    }
}

static void store(void *p, isogi_type type, double v) {
    if (type == ISOGI_U8) *(uint8_t *)p = (uint8_t)v;
    if (type == ISOGI_I8) *(int8_t *)p = (int8_t)v;
    if (type == ISOGI_U16) *(uint16_t *)p = (uint16_t)v;
    if (type == ISOGI_I16) *(int16_t *)p = (int16_t)v;
    if (type == ISOGI_F32) *(float *)p = (float)v;
    if (type == ISOGI_F64) *(double *)p = v;
}

/* Whole numbers 0..100 in every type, packed, strided and backwards, with a rescale: the same mesh, bit by bit. */
TEST(every_type_and_stride_gives_the_same_mesh) {
    enum { X = 70, Y = 9, Z = 11 };
    static double memory[X * Y * Z * 3];
    for (int i = 0; i < 24; i++) {
        const isogi_type type = (isogi_type)(i % 6);
        const ptrdiff_t bytes[6] = {1, 1, 2, 2, 4, 8}, size = bytes[type];
        int layout = i / 6;
        test_random r = {5};
        field f = field_new(X, Y, Z);
        for (int k = 0; k < Z; k++)
            for (int j = 0; j < Y; j++)
                for (int n = 0; n < X; n++)
                    *field_at(&f, n, j, k) = floor(50 + 40 * sin(0.3 * n + 0.1 * j) * cos(0.5 * k) + 8 * random_unit(&r));
        field_build_with(&f, &serial);
        isogi_mesh expected = mesh_of(&f, 50, 1, 1);
        isogi_vol_free(f.pyramid);
        ptrdiff_t s[3] = {size, size * X, size * X * Y};
        char *base = (char *)memory;
        if (layout == 1) s[0] = 3 * size, s[1] = 3 * size * X, s[2] = 3 * size * X * Y;
        if (layout == 2) s[2] = size, s[1] = size * Z, s[0] = size * Y * Z;
        if (layout == 3) base += s[0] * (X - 1) + s[1] * (Y - 1) + s[2] * (Z - 1), s[0] = -s[0], s[1] = -s[1], s[2] = -s[2];
        for (int k = 0; k < Z; k++)
            for (int j = 0; j < Y; j++)
                for (int n = 0; n < X; n++) store(base + n * s[0] + j * s[1] + k * s[2], type, *field_at(&f, n, j, k));
        f.volume.data = base, f.volume.type = type;
        for (int a = 0; a < 3; a++) f.volume.stride[a] = layout ? s[a] : 0;
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 50, 1, 1);
        CHECK(mesh_same(&mesh, &expected) && mesh.triangle_count > 1000, "type %d layout %d: %zu triangles, %zu", (int)type, layout,
              mesh.triangle_count, expected.triangle_count);
        isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &expected);
        field_free(&f);
    }
}

/* Floats of many magnitudes in memory that ends with the last voxel: vertices on lattice edges, and with them these meshes, are the
   same bits on every instruction path. (Normals of vertices inside cells and near the border may differ by roundings.) */
TEST(every_path_gives_the_same_mesh) {
    const int sizes[][3] = {{2, 9, 8}, {4, 4, 4}, {5, 3, 9}, {37, 20, 11}, {70, 6, 5}};
    for (int i = 0; i < 20; i++) {
        const int *size = sizes[i % 5];
        test_random r = {(uint64_t)i};
        field f = field_new(size[0], size[1], size[2]);
        const size_t voxels = (size_t)size[0] * (size_t)size[1] * (size_t)size[2];
        float *data = (float *)malloc(voxels * sizeof *data);
        isogi_mesh expected = {0};
        field_fill(&f, i % 2 ? WIDE : SMOOTH, &r);
        for (size_t v = 0; v < voxels; v++) data[v] = (float)f.value[v];
        f.volume.data = data, f.volume.type = ISOGI_F32, f.volume.scale = i % 3 ? 1.7 : -0.3;
        for (int path = 1; path <= 4; path++) {
            isogi_context context = {.threads = 1, .force_path = path};
            field_build_with(&f, &context);
            isogi_mesh mesh = mesh_of(&f, 0.1, 1, i / 10);
            if (path == 1) expected = mesh;
            else CHECK(mesh_same(&mesh, &expected) && mesh.triangle_count > 5, "volume %d, path %d: %zu triangles, %zu", i, path,
                       mesh.triangle_count, expected.triangle_count);
            if (path > 1) isogi_vol_mesh_free(f.pyramid, &mesh);
            isogi_vol_free(f.pyramid);
            f.pyramid = NULL;
        }
        isogi_vol_mesh_free(NULL, &expected);
        field_free(&f);
        free(data);
    }
}

/* Nothing but edges decides whether a mesh holds together, whatever the values are. */
TEST(extreme_values_still_give_a_manifold) {
    const double sizes[] = {1e300, 1e-300, 4e-320, 1e155, 1e-155};
    for (int i = 0; i < 500; i++) {
        test_random r = {(uint64_t)i};
        field f = field_new(5, 5, 5);
        for (int v = 0; v < 125; v++)
            f.value[v] = random_range(&r, -1, 1) * (i % 6 < 5 ? sizes[i % 6] : pow(10, random_range(&r, -300, 300)));
        field_build_with(&f, &serial);
        isogi_mesh mesh = mesh_of(&f, 0, 1, i & 1);
        shape s = mesh_shape(&mesh, i & 1 ? NULL : on_border, &f, NULL);
        CHECK(s.bad_edges == 0 && s.bad_vertices == 0 && mesh.triangle_count > 50, "volume %d: %ld, %ld", i, s.bad_edges, s.bad_vertices);
        for (size_t v = 0; v < mesh.vertex_count; v++)
            for (int a = 0; a < 3; a++)
                CHECK(mesh.positions[v][a] >= 0 && mesh.positions[v][a] <= 4, "volume %d: %g", i, (double)mesh.positions[v][a]);
        isogi_vol_mesh_free(f.pyramid, &mesh);
        field_free(&f);
    }
}

/* ---- threads, memory, failure ---- */

static void backwards(void *user, size_t n, void (*task)(void *arg, size_t i), void *arg) {
    (void)user;
    while (n--) task(arg, n);
}

TEST(any_number_of_threads_gives_the_same_bits) {
    const int threads[] = {1, 2, 3, 8, 0};
    test_random r = {11};
    field f = field_new(130, 41, 37);
    field_fill(&f, SMOOTH, &r);
    for (int closed = 0; closed < 2; closed++) {
        isogi_mesh first = {0};
        for (int i = 0; i < 6; i++) {
            isogi_context context = {.threads = i < 5 ? threads[i] : 0, .parallel_for = i < 5 ? NULL : backwards};
            field_build_with(&f, &context);
            isogi_mesh mesh = mesh_of(&f, 0.2, 1, closed);
            if (!i) first = mesh;
            else {
                CHECK(mesh_same(&first, &mesh) && mesh.triangle_count > 10000, "run %d: %zu triangles, %zu", i, mesh.triangle_count,
                      first.triangle_count);
                isogi_vol_mesh_free(f.pyramid, &mesh);
            }
            isogi_vol_free(f.pyramid);
            f.pyramid = NULL;
        }
        isogi_vol_mesh_free(NULL, &first);
    }
    field_free(&f);
}

typedef struct memory_log {
    long allocations, live, fail_at; /* fail_at: which allocation fails, counted from 1; 0 = none */
    size_t bytes;
    int calls, cancel_at;
} memory_log;

static void *log_alloc(void *user, size_t size, size_t align) {
    memory_log *log = (memory_log *)user;
    size_t *block = NULL;
    if (++log->allocations == log->fail_at) return NULL;
    if (posix_memalign((void **)&block, align, size)) return NULL;
    memset(block, 0xa5, size); /* nothing may rely on zeros */
    log->live++, log->bytes += size;
    return block;
}

static void log_release(void *user, void *p, size_t size) {
    memory_log *log = (memory_log *)user;
    log->live--, log->bytes -= size;
    free(p);
}

static int log_progress(void *user, double fraction) {
    memory_log *log = (memory_log *)user;
    CHECK(fraction >= 0 && fraction <= 1, "%g", fraction);
    return ++log->calls == log->cancel_at;
}

TEST(a_moving_isovalue_soon_allocates_nothing) {
    memory_log log = {0};
    isogi_context context = {.alloc = log_alloc, .release = log_release, .user = &log, .threads = 2};
    test_random r = {3};
    field f = field_new(40, 41, 42);
    isogi_mesh mesh = {0};
    long after = 0;
    field_fill(&f, SMOOTH, &r);
    field_build_with(&f, &context);
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i <= 20; i++) {
            isogi_mesh_desc desc = {.isovalue = -3 + 0.3 * i, .normals = 1, .closed = 1};
            CHECK(isogi_vol_mesh(f.pyramid, &desc, &mesh) == ISOGI_OK, "round %d step %d", round, i);
        }
        if (!round) after = log.allocations;
    }
    CHECK(log.allocations == after, "%ld, then %ld", after, log.allocations);
    isogi_mesh_desc plain = {.isovalue = 0};
    CHECK(isogi_vol_mesh(f.pyramid, &plain, &mesh) == ISOGI_OK && !mesh.normals && mesh.triangle_count, "%zu", mesh.triangle_count);
    isogi_vol_mesh_free(f.pyramid, &mesh);
    CHECK(!mesh.positions && !mesh.triangles && !mesh.scratch && !mesh.vertex_count, "%p", (void *)mesh.positions);
    isogi_vol_free(f.pyramid);
    f.pyramid = NULL;
    CHECK(log.live == 0 && log.bytes == 0, "%ld blocks, %zu bytes", log.live, log.bytes);
    field_free(&f);
}

/* Whatever allocation fails, or wherever progress cancels: the mesh stays as it was, and nothing leaks. All the failures there are with
   --long, else the first 16 and then fewer and fewer. */
static void check_failure(int cancel) {
    test_random r = {3};
    memory_log log = {0};
    isogi_context context = {.alloc = log_alloc, .release = log_release, .progress = log_progress, .user = &log, .threads = 1};
    field f = field_new(20, 21, 22);
    field_fill(&f, SMOOTH, &r);
    field_build_with(&f, &context);
    const long blocks = log.live;
    int failures = 0, done = 0;
    isogi_mesh small_mesh = mesh_of(&f, 2.9, 1, 0);
    for (int k = 1; done < 2 && k < 10000; k += LONG_SUITE || k < 16 ? 1 : 1 + k / 8) {
        done = 0;
        for (int kept = 0; kept < 2; kept++) { /* into an empty mesh, or into one that holds another one */
            isogi_mesh mesh = {0}, before;
            isogi_mesh_desc small = {.isovalue = 2.9, .normals = 1}, large = {.isovalue = 0, .normals = 1, .closed = 1};
            if (kept) CHECK(isogi_vol_mesh(f.pyramid, &small, &mesh) == ISOGI_OK && mesh.triangle_count, "%zu", mesh.triangle_count);
            before = mesh;
            log.allocations = 0, log.calls = 0;
            if (cancel) log.cancel_at = k;
            else log.fail_at = k;
            isogi_result result = isogi_vol_mesh(f.pyramid, &large, &mesh);
            log.fail_at = log.cancel_at = 0;
            if (result == ISOGI_OK) done++;
            else {
                failures++;
                CHECK(result == (cancel ? ISOGI_CANCELLED : ISOGI_NO_MEMORY), "%s", isogi_result_string(result));
                CHECK(mesh.positions == before.positions && mesh.normals == before.normals && mesh.triangles == before.triangles, "step %d",
                      k);
                CHECK(mesh.vertex_capacity == before.vertex_capacity && mesh.triangle_capacity == before.triangle_capacity, "step %d", k);
                CHECK(kept ? mesh_same(&mesh, &small_mesh) : !mesh.vertex_count, "step %d", k);
                CHECK(isogi_vol_mesh(f.pyramid, &large, &mesh) == ISOGI_OK && mesh.triangle_count > 100, "step %d: %zu", k,
                      mesh.triangle_count);
            }
            isogi_vol_mesh_free(f.pyramid, &mesh);
        }
    }
    isogi_vol_mesh_free(f.pyramid, &small_mesh);
    CHECK(log.live == blocks, "%ld blocks, %ld before", log.live, blocks);
    CHECK(done == 2 && failures >= 4, "%d failures, %d ends", failures, done);
    field_free(&f);
    CHECK(log.live == 0 && log.bytes == 0, "%ld blocks, %zu bytes", log.live, log.bytes);
}

TEST(a_failing_allocation_leaves_the_mesh_as_it_was) { check_failure(0); }
TEST(cancelling_leaves_the_mesh_as_it_was) { check_failure(1); }

TEST(bad_arguments_are_refused) {
    field f = known_field(SPHERE);
    field_build_with(&f, &serial);
    isogi_mesh mesh = {0};
    isogi_mesh_desc good = {.isovalue = 0}, nan_value = {.isovalue = NAN}, infinite = {.isovalue = INFINITY}, huge = {.isovalue = 1e300};
    CHECK(isogi_vol_mesh(NULL, &good, &mesh) == ISOGI_INVALID, "%zu", mesh.vertex_count);
    CHECK(isogi_vol_mesh(f.pyramid, NULL, &mesh) == ISOGI_INVALID, "%zu", mesh.vertex_count);
    CHECK(isogi_vol_mesh(f.pyramid, &good, NULL) == ISOGI_INVALID, "%zu", mesh.vertex_count);
    CHECK(isogi_vol_mesh(f.pyramid, &nan_value, &mesh) == ISOGI_INVALID, "%zu", mesh.vertex_count);
    CHECK(isogi_vol_mesh(f.pyramid, &infinite, &mesh) == ISOGI_INVALID, "%zu", mesh.vertex_count);
    CHECK(isogi_vol_mesh(f.pyramid, &huge, &mesh) == ISOGI_OK && mesh.triangle_count == 0, "%zu", mesh.triangle_count);
    isogi_vol_mesh_free(f.pyramid, NULL), isogi_vol_mesh_free(f.pyramid, &mesh), isogi_vol_mesh_free(f.pyramid, &mesh);
    field_free(&f);
}

/* ---- real data ---- */

static int on_box(const float a[3], const float b[3], const void *arg) { return on_border(a, b, arg); }

static void check_scan(const char *name, int x, int y, int z, double isovalue) {
    char *path = test_data(name);
    if (!path) SKIP("ISOGI_DATA is not set");
    field f = field_new(x, y, z);
    size_t bytes = (size_t)x * (size_t)y * (size_t)z;
    uint8_t *data = (uint8_t *)malloc(bytes);
    FILE *file = fopen(path, "rb");
    CHECK(file && fread(data, 1, bytes, file) == bytes, "%s", path);
    if (file) fclose(file);
    f.volume.data = data, f.volume.type = ISOGI_U8;
    field_build_with(&f, NULL);
    isogi_mesh open = mesh_of(&f, isovalue, 0, 0), closed = mesh_of(&f, isovalue, 1, 1);
    shape s = mesh_shape(&open, on_box, &f, NULL), c = mesh_shape(&closed, NULL, NULL, NULL);
    printf("    %s at %g: %ld triangles, %ld components, Euler %ld; closed: %ld, %ld, %ld\n", name, isovalue, s.triangles, s.components,
           s.euler, c.triangles, c.components, c.euler);
    CHECK(s.bad_edges == 0 && s.bad_vertices == 0 && s.triangles > 100000, "%ld edges, %ld vertices", s.bad_edges, s.bad_vertices);
    CHECK(c.bad_edges == 0 && c.bad_vertices == 0 && c.open_edges == 0 && c.euler % 2 == 0, "%ld edges, %ld open, %ld vertices",
          c.bad_edges, c.open_edges, c.bad_vertices);
    isogi_vol_mesh_free(f.pyramid, &open), isogi_vol_mesh_free(f.pyramid, &closed);
    field_free(&f);
    free(data), free(path);
}

TEST(engine_is_watertight) { check_scan("engine_256x256x128_uint8.raw", 256, 256, 128, 80); }
TEST(bonsai_is_watertight) { check_scan("bonsai_256x256x256_uint8.raw", 256, 256, 256, 40); }

/* Where scale is less than the rounding of scale * raw + bias, several integers are one value: meshes are those of the values. */
TEST(integers_that_round_together_are_meshed_like_their_values) {
    test_random r = {77};
    size_t triangles = 0;
    for (int k = 0; k < 300; k++) {
        const double bias = (k & 1 ? -1 : 1) * pow(10, random_range(&r, 15, 19)), scale = (k & 2 ? -1 : 1) * random_range(&r, 0.1, 3);
        const int n = 5, count = n * n * n;
        uint8_t raw[125];
        field f = field_new(n, n, n);
        isogi_volume v = f.volume;
        isogi_mesh_desc desc = {0};
        isogi_mesh of_raw = {0}, of_values = {0};
        isogi_pyramid *pyramid = NULL;
        for (int i = 0; i < count; i++) raw[i] = (uint8_t)random_bits(&r), f.value[i] = scale * raw[i] + bias;
        v.data = raw, v.type = ISOGI_U8, v.scale = scale, v.bias = bias;
        field_build_with(&f, NULL);
        CHECK(isogi_vol_build(&pyramid, &v, NULL) == ISOGI_OK, "build");
        desc.isovalue = scale * (k & 4 ? 128 : 128.5) + bias;
        CHECK(isogi_vol_mesh(pyramid, &desc, &of_raw) == ISOGI_OK && isogi_vol_mesh(f.pyramid, &desc, &of_values) == ISOGI_OK, "mesh");
        triangles += of_values.triangle_count;
        CHECK(of_raw.triangle_count == of_values.triangle_count && of_raw.vertex_count == of_values.vertex_count,
              "bias %g, scale %g: %zu triangles, of values %zu", bias, scale, of_raw.triangle_count, of_values.triangle_count);
        CHECK(!of_raw.triangle_count || !memcmp(of_raw.triangles, of_values.triangles, of_raw.triangle_count * sizeof *of_raw.triangles),
              "bias %g, scale %g: other triangles", bias, scale);
        isogi_vol_mesh_free(pyramid, &of_raw), isogi_vol_mesh_free(f.pyramid, &of_values);
        isogi_vol_free(pyramid), field_free(&f);
    }
    CHECK(triangles > 10000, "%zu triangles", triangles);
}

TEST_MAIN("mesh")
