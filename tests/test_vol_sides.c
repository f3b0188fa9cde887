/* On which side of the surface rays of isogi_vol.h are: sides of all hits against what the field says at both ends of a ray, dips and
   bumps as narrow as rounding allows, and the caps of borders, next to voxels that are not finite too. Huge values and long volumes.
   FLAGS: -O0 */
#define ISOGI_IMPLEMENTATION
#include "isogi_vol.h"
#include "ray_fields.h"
#include "reference_ray.h"

enum { PATHS = 7, MOST = 64 };

static isogi_pyramid *build_on(const isogi_volume *volume, int path) {
    isogi_context context = {.threads = 1, .force_path = forced_path(path)};
    isogi_volume v = *volume;
    isogi_pyramid *p = NULL;
    v.compact = path > 4;
    CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "path %d: not built", path);
    return p;
}

/* ---- sides of all hits ---- */

/* The field minus the isovalue at t; *finite: whether all corners of the cell are */
static double value_at(const field *f, const isogi_ray *ray, double t, int *finite) {
    const reference_field reference = {f->value, {f->size[0], f->size[1], f->size[2]}, 0};
    real at[3];
    int cell[3];
    for (int a = 0; a < 3; a++) {
        at[a] = fminl(fmaxl((real)ray->origin[a] + (real)t * (real)ray->dir[a], 0), f->size[a] - 1);
        cell[a] = at[a] < f->size[a] - 2 ? (int)at[a] : f->size[a] - 2;
    }
    *finite = 1;
    for (int c = 0; c < 8; c++) *finite &= test_finite(*field_at(f, cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)));
    return (double)reference_value(&reference, cell, at, (real)ray->isovalue);
}

/* Where the ray enters and leaves the box; 0: it misses. */
static int box_of(const field *f, const isogi_ray *ray, double t[2]) {
    t[0] = ray->tmin, t[1] = ray->tmax > 0 ? ray->tmax : 1e30;
    for (int a = 0; a < 3; a++) {
        const double d = (double)ray->dir[a], p = -ray->origin[a] / d, q = (f->size[a] - 1 - ray->origin[a]) / d;
        if (!(d > 0 || d < 0)) {
            if (!(ray->origin[a] >= 0 && ray->origin[a] <= f->size[a] - 1)) return 0;
            continue;
        }
        t[0] = fmax(t[0], fmin(p, q)), t[1] = fmin(t[1], fmax(p, q));
    }
    return t[0] < t[1];
}

/* Whether the sides of hits lead from the one at the ray's begin to the one at its end: they alternate, but after layers of voxels of
   the isovalue, which have no thickness and leave the ray outside. */
static int sides_add_up(const isogi_hit *hits, size_t count, int inside, int end, const field *f, const isogi_ray *ray, long *touched) {
    for (size_t k = 0; k <= count; k++) {
        const int before = k < count ? hits[k].side < 0 : end, after = k < count ? hits[k].side > 0 : end;
        if (inside != before) {
            int finite, on_face = 0;
            if (!inside || !k) return 0;
            for (int a = 0; a < 3; a++) on_face |= !(hits[k - 1].local[a] > 1e-13) || !(hits[k - 1].local[a] < 1 - 1e-13); /* rounding */
            if (!on_face || fabs(value_at(f, ray, hits[k - 1].t, &finite)) > 1e-12) return 0;
            ++*touched;
        }
        inside = after;
    }
    return 1;
}

static isogi_ray lattice_ray(const field *f, double isovalue, test_random *r) {
    isogi_ray ray = random_ray(f, isovalue, r);
    for (int a = 0; a < 3; a++) {
        ray.origin[a] = (double)(random_bits(r) % (uint64_t)f->size[a]) + (random_bits(r) & 1 ? 0.5 : 0);
        ray.origin[a] += random_bits(r) & 1 ? random_range(r, -1e-9, 1e-9) : 0;
        ray.dir[a] = (float)((int)(random_bits(r) % 3) - 1);
        ray.origin[a] -= 16 * (double)ray.dir[a];
    }
    if (ray.dir[0] == 0 && ray.dir[1] == 0 && ray.dir[2] == 0) ray.dir[0] = 1, ray.origin[0] = -3;
    return ray;
}

TEST(sides_of_all_hits_add_up) {
    enum { RAYS = 200 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS][MOST];
    static size_t counts[RAYS];
    test_random r = {101};
    long found = 0, judged = 0, touched = 0, wrong[PATHS] = {0};
    for (int v = 0; v < (LONG_SUITE ? 1500 : 60); v++) {
        const int kind = v % 4;
        field f = field_new(9, 8, 10);
        if (kind < KINDS) field_fill(&f, kind, &r);
        else for (size_t i = 0; i < field_count(&f); i++)
            f.value[i] = (double)(random_bits(&r) % 3) + (random_bits(&r) % 4 ? 0 : random_range(&r, -1e-12, 1e-12));
        for (int i = 0; i < RAYS; i++) {
            const double isovalue = kind == QUANTISED ? floor(random_range(&r, -3, 3)) : kind == KINDS ? 1 : random_range(&r, -0.5, 0.5);
            rays[i] = i % 3 ? random_ray(&f, isovalue, &r) : lattice_ray(&f, isovalue, &r);
            rays[i].flags = i & 1 ? ISOGI_RAY_CAPPED : 0;
            if (i % 5 == 0) rays[i].tmin = random_range(&r, 0, 10), rays[i].tmax = rays[i].tmin + random_range(&r, 0, 10);
        }
        for (int path = 0; path < PATHS; path++) {
            isogi_pyramid *p = build_on(&f.volume, path);
            isogi_vol_intersect_all(p, rays, RAYS, MOST, hits[0], counts, NULL);
            for (int i = 0; i < RAYS; i++) {
                double t[2];
                int finite, begin, end;
                if (!box_of(&f, &rays[i], t)) continue;
                const double first = value_at(&f, &rays[i], t[0], &finite), last = value_at(&f, &rays[i], t[1], &finite);
                const int enters = t[0] > rays[i].tmin, leaves = !(rays[i].tmax > 0 && t[1] >= rays[i].tmax);
                if (!(fabs(first) > 1e-6 && fabs(last) > 1e-6) || counts[i] > MOST) continue;
                begin = first >= 0 && !(rays[i].flags && enters), end = last >= 0 && !(rays[i].flags && leaves);
                judged++, found += (long)counts[i];
                wrong[path] += !sides_add_up(hits[i], counts[i], begin, end, &f, &rays[i], &touched);
            }
            isogi_vol_free(p);
        }
        field_free(&f);
    }
    printf("    %ld rays, %ld hits, %ld layers touched\n", judged, found, touched);
    for (int path = 0; path < PATHS; path++) CHECK(wrong[path] == 0, "path %d: %ld rays", path, wrong[path]);
    CHECK(judged > 20000 && found > 40000 && touched > 20, "%ld rays, %ld hits, %ld touched: the test says little", judged, found, touched);
}

/* Two cells with a kink in the face they share; the field there is `depth` beyond the isovalue: two hits around the face. */
TEST(dips_and_bumps_as_narrow_as_rounding_are_passed_in_two_hits) {
    for (int path = 0; path < PATHS; path++)
        for (int bump = 0; bump < 2; bump++)
            for (int along = 0; along < 3; along++)
                for (double depth = 5e-16; depth < 1e-2; depth *= 3) {
                    const double sign = bump ? -1 : 1;
                    field f = field_new(along == 0 ? 3 : 2, along == 1 ? 3 : 2, along == 2 ? 3 : 2);
                    const int across = along == 0;
                    for (int z = 0; z < f.size[2]; z++)
                        for (int y = 0; y < f.size[1]; y++)
                            for (int x = 0; x < f.size[0]; x++) {
                                const int at[3] = {x, y, z};
                                *field_at(&f, x, y, z) = sign * (at[along] == 0 ? 7 : at[along] == 2 ? 4 : at[across] ? -2 : 2);
                            }
                    isogi_pyramid *p = build_on(&f.volume, path);
                    isogi_ray ray = {.isovalue = 0, .flags = ISOGI_RAY_CAPPED};
                    isogi_hit hits[8];
                    size_t count;
                    for (int a = 0; a < 3; a++) ray.origin[a] = 0.5;
                    ray.origin[along] = -1, ray.dir[along] = 1, ray.origin[across] = 0.5 + depth / 4;
                    const double value = 4 * (ray.origin[across] - 0.5); /* the depth as rounding leaves it */
                    isogi_vol_intersect_all(p, &ray, 1, 8, hits, &count, NULL);
                    if (value > 0) {
                        const isogi_hit *pair = hits + !bump;
                        const size_t expected = bump ? 2 : 4;
                        CHECK(count == expected && pair[0].side == (bump ? 1 : -1) && pair[1].side == -pair[0].side,
                              "path %d, depth %g, axis %d, bump %d: %d hits", path, value, along, bump, (int)count);
                        const double error = 1e-13 + 2 * value * value; /* of the cubics' linear parts */
                        if (count == expected)
                            CHECK(fabs(pair[0].t - (2 - value / 7)) <= error && fabs(pair[1].t - (2 + value / 4)) <= error,
                                  "path %d, depth %g: t 2 %+g and 2 %+g", path, value, pair[0].t - 2, pair[1].t - 2);
                    }
                    isogi_vol_free(p), f.pyramid = NULL, field_free(&f);
                }
}

/* ---- starts on a surface ---- */

/* No ray comes back to a plane that it leaves, also where it leaves the cell in which it starts some roundings later: the next cell still
   knows, though registers may be longer than what memory keeps of times (x87). */
TEST(rays_that_start_just_before_a_face_leave_a_plane_for_good) {
    enum { STARTS = 30000, SIDE = 16 };
    static double data[SIDE][SIDE][SIDE];
    const double slope[3] = {0.7, 1.1, -0.37};
    isogi_volume volume = {.data = data, .type = ISOGI_F64, .size = {SIDE, SIDE, SIDE}};
    test_random r = {11};
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        data[i / SIDE / SIDE][i / SIDE % SIDE][i % SIDE] =
            slope[0] * (i % SIDE) + slope[1] * (i / SIDE % SIDE) + slope[2] * (i / SIDE / SIDE);
    for (int path = 1; path < PATHS; path++) {
        isogi_pyramid *p = build_on(&volume, path);
        long back[2] = {0, 0};
        for (int n = 0; n < STARTS; n++) {
            isogi_hit start = {.side = 1}, hit;
            float dir[1][3];
            double isovalue = 0, rate = 0;
            const int axis = n / 2 % 3, up = (int)(random_bits(&r) & 1);
            for (int a = 0; a < 3; a++) {
                start.cell[a] = 2 + (uint32_t)(random_bits(&r) % (SIDE - 5)), start.local[a] = random_unit(&r);
                dir[0][a] = (float)random_range(&r, -0.5, 0.5);
            }
            const double before = (double)(1 + random_bits(&r) % 8) * 0x1p-49;
            start.local[axis] = up ? 1 - before : before, dir[0][axis] = (float)((up ? 1 : -1) * random_range(&r, 0.2, 1.2));
            for (int a = 0; a < 3; a++)
                isovalue += slope[a] * (start.cell[a] + start.local[a]), rate += slope[a] * (double)dir[0][a];
            if (fabs(rate) < 0.05) continue;
            start.side = rate > 0 ? 1 : -1;
            const uint32_t flags = n & 1 ? ISOGI_RAY_ONWARD : 0;
            if (isogi_vol_continue(p, &start, (const float(*)[3])dir, NULL, isovalue, flags, 1, &hit, NULL) != ISOGI_OK || hit.side)
                back[n & 1]++;
        }
        CHECK(!back[0] && !back[1], "path %d: %ld rays come back, %ld that go onward", path, back[0], back[1]);
        isogi_vol_free(p);
    }
}

/* ---- caps ---- */

/* Rays that enter and leave a volume of which some voxels are not finite: a cap exactly where the border's cell is finite and inside. */
TEST(cells_that_are_not_finite_have_no_cap) {
    enum { RAYS = 400 };
    static isogi_ray rays[RAYS];
    static isogi_hit first[RAYS], hits[RAYS][MOST], again[RAYS], bundled[RAYS];
    static uint8_t occluded[RAYS], bundle_occluded[RAYS];
    static size_t counts[RAYS];
    static const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    test_random r = {102};
    long caps = 0, holes = 0;
    for (int v = 0; v < (LONG_SUITE ? 400 : 40); v++) {
        const int path = v % PATHS;
        field f = field_new(6 + (int)(random_bits(&r) % 8), 9, 7);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = v / PATHS % 2 ? 1 : random_range(&r, -0.3, 1);
        for (int i = 0; i < 20; i++) f.value[random_bits(&r) % field_count(&f)] = bad[i % 3];
        isogi_pyramid *p = build_on(&f.volume, path);
        for (int i = 0; i < RAYS; i++) rays[i] = random_ray(&f, 0, &r), rays[i].flags = ISOGI_RAY_CAPPED;
        for (int i = RAYS / 2; i < RAYS; i++) memcpy(rays[i].origin, rays[RAYS / 2].origin, sizeof rays[i].origin);
        isogi_vol_intersect(p, rays, RAYS, first, NULL);
        isogi_vol_occluded(p, rays, RAYS, occluded, NULL);
        isogi_vol_intersect_all(p, rays, RAYS, MOST, hits[0], counts, NULL);
        {
            static float dirs[RAYS / 2][3];
            isogi_bundle bundle = {.flags = ISOGI_RAY_CAPPED};
            memcpy(bundle.origin, rays[RAYS / 2].origin, sizeof bundle.origin);
            for (int i = 0; i < RAYS / 2; i++) memcpy(dirs[i], rays[RAYS / 2 + i].dir, sizeof dirs[i]);
            isogi_vol_bundle(p, &bundle, (const float(*)[3])dirs, RAYS / 2, bundled, NULL);
            isogi_vol_bundle_occluded(p, &bundle, (const float(*)[3])dirs, RAYS / 2, bundle_occluded, NULL);
        }
        for (int i = 0; i < RAYS; i++) {
            double t[2];
            const int met = box_of(&f, &rays[i], t), n = (int)counts[i], late = i - RAYS / 2;
            isogi_vol_intersect(p, &rays[i], 1, &again[i], NULL);
            CHECK(same_hit(&again[i], &first[i]) && occluded[i] == (first[i].side != 0), "one ray and many differ");
            CHECK(n ? same_hit(&first[i], &hits[i][0]) : !first[i].side, "first and all differ");
            if (late >= 0) CHECK(same_hit(&bundled[late], &first[i]) && bundle_occluded[late] == occluded[i], "bundles differ");
            for (int end = 0; end < 2 && met; end++) {
                int finite, capped = n && (end ? hits[i][n - 1].side == -2 : hits[i][0].side == 2);
                const double value = value_at(&f, &rays[i], t[end], &finite);
                if (end ? t[1] <= rays[i].tmin : t[0] <= rays[i].tmin) continue;
                if (finite && fabs(value) < 1e-9) continue;
                CHECK(capped == (finite && value > 0), "path %d, end %d: cap %d, finite %d, value %g", path, end, capped, finite, value);
                if (capped) CHECK(fabs(hits[i][end ? n - 1 : 0].t - t[end]) < 1e-9, "t %g, not %g", hits[i][end ? n - 1 : 0].t, t[end]);
                caps += capped, holes += !finite;
            }
        }
        isogi_vol_free(p), f.pyramid = NULL, field_free(&f);
    }
    printf("    %ld caps, %ld holes\n", caps, holes);
    CHECK(caps > 2000 && holes > 1000, "%ld caps, %ld holes: the test says little", caps, holes);
}

/* Along lattice diagonals rays leave through edges where two cells meet: the cell that they come from says whether there is a cap. */
TEST(rays_through_edges_leave_by_their_own_cell) {
    static float voxel[12 * 12 * 12];
    test_random r = {31};
    long rays = 0, wrong = 0;
    for (int turn = 0; turn < 300; turn++) {
        isogi_volume v = {.data = voxel, .type = ISOGI_F32};
        size_t count = 1;
        for (int a = 0; a < 3; a++) v.size[a] = 4 + (size_t)(random_bits(&r) % 9), count *= v.size[a];
        for (size_t i = 0; i < count; i++) voxel[i] = random_bits(&r) % 40 ? 1 + (float)(random_bits(&r) % 2) : NAN;
        isogi_pyramid *p[6];
        for (int k = 0; k < 6; k++) {
            const isogi_context context = {.threads = 1, .force_path = 1 + k % 3};
            v.compact = k > 2;
            CHECK(isogi_vol_build(&p[k], &v, &context) == ISOGI_OK, "build");
        }
        for (int n = 0; n < 20; n++) {
            isogi_ray ray = {.isovalue = 0.5, .flags = ISOGI_RAY_CAPPED};
            const int still = (int)(random_bits(&r) % 3);
            double enter = 0, leave = 1e9, corner[8];
            for (int a = 0; a < 3; a++) {
                const double most = (double)v.size[a] - 1;
                if (a == still) {
                    ray.origin[a] = (double)(random_bits(&r) % (v.size[a] - 1)) + random_range(&r, 0.125, 0.875);
                    continue;
                }
                ray.dir[a] = random_bits(&r) & 1 ? 1 : -1;
                ray.origin[a] = (double)(random_bits(&r) % v.size[a]) - 20 * (double)ray.dir[a];
                enter = fmax(enter, ((ray.dir[a] > 0 ? 0 : most) - ray.origin[a]) * (double)ray.dir[a]);
                leave = fmin(leave, ((ray.dir[a] > 0 ? most : 0) - ray.origin[a]) * (double)ray.dir[a]);
            }
            if (!(enter < leave)) continue;
            uint32_t last[3];
            for (int a = 0; a < 3; a++) last[a] = (uint32_t)floor(ray.origin[a] + (leave - 0.5) * (double)ray.dir[a]);
            const int capped = isogi_volume_corners(isogi_vol_volume(p[0]), last, corner);
            rays++;
            for (int k = 0; k < 6; k++) {
                isogi_hit hits[8];
                size_t found;
                int out = 0;
                isogi_vol_intersect_all(p[k], &ray, 1, 8, hits, &found, NULL);
                for (size_t i = 0; i < found && i < 8; i++) out |= hits[i].side == -2;
                wrong += out != capped;
            }
        }
        for (int k = 0; k < 6; k++) isogi_vol_free(p[k]);
    }
    CHECK(rays > 3000 && wrong == 0, "%ld rays, %ld wrong exits on six paths", rays, wrong);
}

/* A ray that ends on the border does not come out of it, as one that ends on a surface does not; one from without goes in there. */
TEST(rays_that_end_on_the_border_stay_inside) {
    float voxel[125];
    for (int i = 0; i < 125; i++) voxel[i] = i ? 1 : 2;
    for (int path = 1; path <= 4; path++) {
        const isogi_context context = {.threads = 1, .force_path = path};
        const isogi_volume v = {.data = voxel, .type = ISOGI_F32, .size = {5, 5, 5}};
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build(&p, &v, &context) == ISOGI_OK, "build");
        for (int k = 0; k < 6; k++) {
            static const double to[6] = {0, 3, 4, 4.0000001, 5, 0}, from[6] = {0.5, 0.5, 0.5, 0.5, 0.5, -1};
            isogi_ray ray = {.origin = {from[k], 1.5, 2.25}, .dir = {1, 0, 0}, .isovalue = 1, .flags = ISOGI_RAY_CAPPED};
            isogi_hit hit;
            ray.tmax = k == 5 ? 1 : to[k] > 0 ? to[k] - from[k] : 0;
            isogi_vol_intersect(p, &ray, 1, &hit, NULL);
            CHECK(hit.side == (k == 5 ? 2 : k == 1 || k == 2 ? 0 : -2), "path %d, to %g: side %d, t %.9g", path, to[k], hit.side, hit.t);
        }
        isogi_vol_free(p);
    }
}

/* What the caps of rays are, the border of a closed mesh is: counted at the same places. */
TEST(caps_are_where_closed_meshes_have_a_border) {
    test_random r = {103};
    long covered = 0, open = 0;
    for (int v = 0; v < 12; v++) {
        const int path = v % PATHS, nx = 6;
        field f = field_new(nx, 7, 7);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = 1;
        for (int i = 0; i < 6; i++) {
            const int x = nx - 1 - (int)(random_bits(&r) % 2), y = (int)(random_bits(&r) % 7), z = (int)(random_bits(&r) % 7);
            *field_at(&f, x, y, z) = (double)NAN;
        }
        isogi_pyramid *p = build_on(&f.volume, path);
        isogi_mesh mesh = {0};
        isogi_mesh_desc desc = {.isovalue = 0.5, .closed = 1};
        CHECK(isogi_vol_mesh(p, &desc, &mesh) == ISOGI_OK, "no mesh");
        for (int i = 0; i < 200; i++) {
            const int inwards = i & 1;
            isogi_ray ray = {.isovalue = 0.5, .flags = ISOGI_RAY_CAPPED, .dir = {inwards ? -1 : 1, 0, 0}};
            const double y = random_range(&r, 0, 6), z = random_range(&r, 0, 6);
            isogi_hit hit;
            int cover = 0;
            ray.origin[0] = inwards ? 9 : 1, ray.origin[1] = y, ray.origin[2] = z;
            isogi_vol_intersect(p, &ray, 1, &hit, NULL);
            for (size_t k = 0; k < mesh.triangle_count; k++) {
                double q[3][2];
                int on = 1, turn = 0;
                for (int c = 0; c < 3; c++) {
                    const float *at = mesh.positions[mesh.triangles[k][c]];
                    on &= (double)at[0] > nx - 1 - 1e-3, q[c][0] = (double)at[1] - y, q[c][1] = (double)at[2] - z;
                }
                for (int c = 0, next = 1; c < 3 && on; c++, next = (c + 1) % 3)
                    turn += q[c][0] * q[next][1] - q[c][1] * q[next][0] > 0 ? 1 : -1;
                cover += turn == 3 || turn == -3;
            }
            const int capped = hit.side == (inwards ? 2 : -2) && hit.cell[0] == (uint32_t)nx - 2;
            CHECK(capped == cover, "path %d: cap %d, mesh %d (side %d)", path, capped, cover, hit.side);
            covered += cover, open += !cover;
        }
        isogi_vol_mesh_free(p, &mesh);
        isogi_vol_free(p), f.pyramid = NULL, field_free(&f);
    }
    CHECK(covered > 200 && open > 200, "%ld covered, %ld open", covered, open);
}

/* At the largest value of the data only voxels, edges and faces of it are inside, and rounding moves rays off them where they enter: all
   paths have to put them back alike, and call a cap a cap. */
TEST(caps_at_the_largest_value_are_the_same_on_every_path) {
    enum { RAYS = 300 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS], plain[RAYS];
    test_random r = {104};
    long caps = 0, different = 0;
    for (int v = 0; v < (LONG_SUITE ? 600 : 60); v++) {
        field f = field_new(5, 6, 7);
        const double most = random_range(&r, 0.1, 1);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_bits(&r) % 8 ? most : random_range(&r, 0, most);
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = random_range(&r, 0.1, 3), f.volume.origin[a] = random_range(&r, -9, 9);
        for (int i = 0; i < RAYS; i++) {
            const int face = i % 3, upper = i / 3 % 2;
            double d[3];
            memset(&rays[i], 0, sizeof rays[i]);
            random_direction(&r, d);
            if (i % 7 == 0) memset(d, 0, sizeof d), d[face] = 1;
            if ((d[face] > 0) == upper) d[face] = -d[face];
            for (int a = 0; a < 3; a++) {
                double at = a == face ? upper * (f.size[a] - 1) : (double)(random_bits(&r) % (uint64_t)f.size[a]);
                if (a == (face + 1) % 3 && i & 1) at = random_range(&r, 0, f.size[a] - 1);
                rays[i].dir[a] = (float)d[a];
                rays[i].origin[a] = f.volume.origin[a] + f.volume.spacing[a] * at - 3 * (double)rays[i].dir[a];
            }
            rays[i].isovalue = most, rays[i].flags = ISOGI_RAY_CAPPED;
        }
        for (int path = 1; path < PATHS; path++) {
            isogi_pyramid *p = build_on(&f.volume, path);
            isogi_vol_intersect(p, rays, RAYS, path == 1 ? plain : hits, NULL);
            for (int i = 0; i < RAYS; i++) {
                caps += plain[i].side == 2;
                if (path == 1) continue;
                /* a corner of the lattice may be met in any of the cells around it */
                different += plain[i].side != hits[i].side || !(fabs(plain[i].t - hits[i].t) <= 1e-14);
                for (int a = 0; a < 3; a++)
                    different += !(fabs((plain[i].cell[a] + plain[i].local[a]) - (hits[i].cell[a] + hits[i].local[a])) <= 1e-14);
            }
            isogi_vol_free(p);
        }
        f.pyramid = NULL, field_free(&f);
    }
    printf("    %ld caps, %ld different\n", caps, different);
    CHECK(different <= caps * TOUCHES_PER_HIT && caps > 1000, "%ld of %ld differ", different, caps);
}

/* Rays that pass lattice points of the box's edges and cut off so little of the box that a place counted from the other border would not
   tell. Where they lie within roundings of a voxel that has the isovalue, all paths have to see it. */
TEST(surfaces_within_roundings_of_edges_are_the_same_on_every_path) {
    enum { RAYS = 3000 };
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS], plain[RAYS];
    test_random r = {105};
    long met = 0, different = 0;
    for (int v = 0; v < (LONG_SUITE ? 100 : 10); v++) {
        field f = field_new(5, 6, 7);
        for (size_t i = 0; i < field_count(&f); i++) f.value[i] = random_bits(&r) % 8 ? 1 : random_range(&r, 0, 1);
        for (int a = 0; a < 3; a++) f.volume.spacing[a] = random_range(&r, 0.1, 3), f.volume.origin[a] = random_range(&r, -9, 9);
        for (int i = 0; i < RAYS; i++) {
            const int in = i % 3, out = (in + 1 + i / 3 % 2) % 3;
            double d[3];
            random_direction(&r, d);
            d[in] *= pow(10, random_range(&r, -4, 0)), d[out] *= pow(10, random_range(&r, -4, 0));
            memset(&rays[i], 0, sizeof rays[i]);
            for (int a = 0; a < 3; a++) {
                const int upper = (int)(random_bits(&r) % 2);
                double at = a == in || a == out ? upper * (f.size[a] - 1) : (double)(random_bits(&r) % (uint64_t)f.size[a]);
                if ((a == in && (d[a] > 0) == upper) || (a == out && (d[a] > 0) != upper)) d[a] = -d[a];
                rays[i].dir[a] = (float)d[a];
                rays[i].origin[a] = f.volume.origin[a] + f.volume.spacing[a] * at - 3 * (double)rays[i].dir[a];
            }
            rays[i].isovalue = 1, rays[i].flags = ISOGI_RAY_CAPPED;
        }
        for (int path = 1; path < PATHS; path++)
            for (int batch = 0; batch < 2; batch++) {
                isogi_pyramid *p = build_on(&f.volume, path);
                isogi_hit *to = path == 1 && !batch ? plain : hits;
                if (batch) isogi_vol_intersect(p, rays, RAYS, to, NULL);
                else for (int i = 0; i < RAYS; i++) isogi_vol_intersect(p, &rays[i], 1, &to[i], NULL);
                for (int i = 0; i < RAYS; i++) {
                    met += plain[i].side != 0;
                    /* t as far as faces are told that are met under 1e-4 of a right angle */
                    different += plain[i].side != to[i].side || !(fabs(plain[i].t - to[i].t) <= 1e-10);
                }
                isogi_vol_free(p);
            }
        f.pyramid = NULL, field_free(&f);
    }
    printf("    %ld hits, %ld different\n", met, different);
    CHECK(different <= met * TOUCHES_PER_HIT && met > 1000, "%ld of %ld differ", different, met);
}

/* ---- fields given by a function ---- */

static double half_known(void *user, const double p[3], double gradient[3]) {
    (void)user;
    gradient[0] = gradient[1] = 0, gradient[2] = 0.01;
    return p[1] > 0.25 && p[1] < 0.75 ? (double)NAN : 1 + 0.01 * p[2];
}

TEST(a_function_has_no_cap_where_it_is_not_finite) {
    for (size_t cells = 2; cells < 40; cells += 11) {
        isogi_field shape = {.value = half_known, .hessian = 1e-6, .high = {1, 1, 1}, .cells = {cells, cells, cells}};
        isogi_pyramid *p = NULL;
        CHECK(isogi_vol_build_field(&p, &shape, NULL) == ISOGI_OK, "not built");
        for (int i = 0; i < 40; i++) {
            const double y = (i + 0.5) / 40, known = y < 0.25 || y > 0.75;
            isogi_ray ray = {.origin = {-1, y, 0.3}, .dir = {1, 0, 0}, .isovalue = 0.5, .flags = ISOGI_RAY_CAPPED};
            isogi_hit hits[4];
            size_t count;
            isogi_vol_intersect_all(p, &ray, 1, 4, hits, &count, NULL);
            CHECK(count == (known ? 2 : 0), "%d cells, y %g: %d hits", (int)cells, y, (int)count);
            if (count == 2) CHECK(hits[0].side == 2 && hits[1].side == -2, "%d and %d", hits[0].side, hits[1].side);
        }
        isogi_vol_free(p);
    }
}

/* Where values are so large or small that their squares leave the range of double, surfaces are left as elsewhere; where denormal numbers
   are zero, above what the header says. */
TEST(huge_and_tiny_values_change_no_hit) {
    enum { N = 24, RAYS = 300, FLUSHED = 5, SCALES = 8 };
    static const double scales[SCALES] = {1, 1e110, 1e200, 1e-150, 1e-290, 1, 1e200, 1e-36};
    static float value[N * N * N];
    static isogi_ray rays[RAYS];
    static isogi_hit hits[RAYS * MOST];
    size_t counts[RAYS], first[RAYS];
    test_random r = {77};
    long all = 0;
    for (int i = 0; i < N * N * N; i++) {
        const double x = 0.5 * (i % N), y = 0.5 * (i / N % N), z = 0.5 * (i / N / N);
        value[i] = (float)(sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x));
    }
    for (int i = 0; i < RAYS; i++)
        for (int a = 0; a < 3; a++)
            rays[i].dir[a] = (float)random_range(&r, -0.5, 0.5),
            rays[i].origin[a] = random_range(&r, 0, N - 1) - 80 * (double)rays[i].dir[a];
    for (int path = 0; path < PATHS; path++)
        for (int k = 0; k < SCALES; k++) {
            const isogi_volume volume = {.data = value, .type = ISOGI_F32, .size = {N, N, N}, .scale = scales[k]};
            flush_denormals(k >= FLUSHED);
            isogi_pyramid *p = build_on(&volume, path);
            isogi_vol_intersect_all(p, rays, RAYS, MOST, hits, counts, NULL);
            for (int i = 0; i < RAYS; i++) {
                if (!k && !path) first[i] = counts[i], all += (long)counts[i];
                CHECK(counts[i] == first[i], "scale %g, path %d, ray %d: %d hits, not %d", scales[k], path, i, (int)counts[i],
                      (int)first[i]);
                isogi_hit hit = hits[(size_t)i * MOST];
                size_t found = 0;
                for (; counts[i] && hit.side && found < MOST; found++)
                    isogi_vol_continue(p, &hit, (const float(*)[3]) & rays[i].dir, NULL, 0, 0, 1, &hit, NULL);
                CHECK(found == first[i], "scale %g, path %d, ray %d: %d continued, not %d", scales[k], path, i, (int)found, (int)first[i]);
            }
            isogi_vol_free(p);
            flush_denormals(0);
        }
    CHECK(all > RAYS, "%ld hits", all);
}

/* A ray leaves a steep surface less than 1e-9 cell before a cell's face, and passes a saddle in the next one, in whose middle the field is
   all but 0: what it hits there are roots. Between planes of voxels the field is (1 - 2 y) times a function of z. */
TEST(hits_behind_a_surface_next_to_a_face_are_roots) {
    test_random r = {4};
    double data[5][2][2], worst = 0;
    long hits = 0;
    for (int n = 0; n < (LONG_SUITE ? 30000 : 3000); n++) {
        const double g = random_range(&r, 1, 2), v[3] = {random_range(&r, 1, 2), -random_range(&r, 0.5, 3), -random_range(&r, 0.5, 4)};
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < 2; i++) {
                data[0][j][i] = data[1][j][i] = g;
                for (int k = 0; k < 3; k++) data[2 + k][j][i] = j ? -v[k] : v[k];
            }
        const isogi_volume volume = {.data = data, .type = ISOGI_F64, .size = {2, 2, 5}};
        isogi_pyramid *p = build_on(&volume, n % PATHS);
        for (int q = 0; q < 8; q++) {
            const double off = pow(10, random_range(&r, -12, -8));
            isogi_ray ray = {.dir = {0, (float)(off * random_range(&r, -2, 2)), 1}};
            isogi_hit found[16];
            size_t count;
            ray.origin[0] = random_unit(&r), ray.origin[1] = 0.5 + off * random_unit(&r) - 2 * (double)ray.dir[1];
            isogi_vol_intersect_all(p, &ray, 1, 16, found, &count, NULL);
            for (size_t k = 0; k < count; k++) {
                const long double y = (long double)ray.origin[1] + (long double)ray.dir[1] * (long double)found[k].t,
                                  u = (long double)found[k].t - (long double)floor(found[k].t);
                const int z = (int)found[k].t < 3 ? (int)found[k].t : 3;
                long double f[2];
                for (int c = 0; c < 2; c++) f[c] = (long double)data[z + c][0][0] * (1 - y) + (long double)data[z + c][1][0] * y;
                worst = fmax(worst, (double)fabsl(f[0] + ((int)found[k].t < 4 ? u : 1) * (f[1] - f[0]))), hits++;
            }
        }
        isogi_vol_free(p);
    }
    CHECK(hits > 8000 && worst < 1e-11, "%ld hits, the field there is up to %g", hits, worst);
}

/* Thousands of cells along one axis, as many levels of nodes as there may be: packets of neighbours on every path. */
TEST(packets_of_long_volumes_agree) {
    enum { LONG = 8192, SHORT = 9, RAYS = 64 * 16 };
    static float value[LONG * SHORT * SHORT];
    static isogi_ray rays[RAYS];
    static isogi_hit hits[2][RAYS];
    test_random r = {78};
    for (int axis = 0; axis < 3; axis++) {
        isogi_volume volume = {.data = value, .type = ISOGI_F32, .size = {SHORT, SHORT, SHORT}};
        isogi_pyramid *p[2];
        long found = 0;
        volume.size[axis] = LONG;
        for (size_t i = 0; i < sizeof value / sizeof *value; i++) {
            const size_t at[3] = {i % volume.size[0], i / volume.size[0] % volume.size[1], i / volume.size[0] / volume.size[1]};
            const size_t b = at[(axis + 1) % 3], c = at[(axis + 2) % 3];
            value[i] = (float)((double)b + 0.3 * sin(0.01 * (double)at[axis]) - 0.001 * (double)at[axis] + 0.2 * (double)c);
        }
        p[0] = build_on(&volume, 1), p[1] = build_on(&volume, 4);
        for (int i = 0; i < RAYS; i += 16) { /* nearly along the axis, up or down */
            const int down = random_bits(&r) & 1;
            double origin[3], dir[3];
            for (int a = 0; a < 3; a++) origin[a] = random_range(&r, 0, SHORT - 1), dir[a] = random_range(&r, -0.0006, 0.0006);
            origin[axis] = down ? LONG + 5 : -5, dir[axis] = down ? -1 : 1;
            for (int k = i; k < i + 16; k++) {
                memset(&rays[k], 0, sizeof rays[k]), rays[k].isovalue = 0.5;
                for (int a = 0; a < 3; a++)
                    rays[k].origin[a] = origin[a] + random_range(&r, -0.1, 0.1),
                    rays[k].dir[a] = (float)(dir[a] + random_range(&r, -1e-5, 1e-5));
            }
        }
        for (int way = 0; way < 2; way++)
            for (int i = 0; i < RAYS; i += 16) isogi_vol_intersect(p[way], rays + i, 16, hits[way] + i, NULL);
        for (int i = 0; i < RAYS; i++) {
            found += hits[0][i].side != 0;
            CHECK(hits[0][i].side == hits[1][i].side && fabs(hits[0][i].t - hits[1][i].t) < 1e-9,
                  "axis %d, ray %d: side %d at %.12g, not %d at %.12g", axis, i, hits[1][i].side, hits[1][i].t, hits[0][i].side,
                  hits[0][i].t);
        }
        CHECK(found > RAYS / 4, "axis %d: %ld hits", axis, found);
        isogi_vol_free(p[0]), isogi_vol_free(p[1]);
    }
}

TEST_MAIN("vol_sides")
