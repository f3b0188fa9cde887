/* The example programs as their users meet them: they run, and everything that is wrong is one clear line, an exit code other than 0 and
   no change to any file. The viewer has a file of its own. FLAGS: -O0 */
#include "isogi_vol.h"
#include "png.h"
#include "procedural.h"
#include "programs.h"

TEST(programs_without_arguments_run) {
    static const char *const names[] = {
        "bake_points", "isosurface_rays", "procedural_rays", "sh_light", "volume_shadows", "gather_field", "gather_tets"};
    for (size_t i = 0; i < (LONG_SUITE ? 7 : 5); i++) { /* the last two take seconds */
        char path[64];
        snprintf(path, sizeof path, "build/%s", names[i]);
        run_result r = run_program(path, "");
        CHECK(r.status == 0 && !*r.error && strlen(r.output) > 20, "%s: status %d, %s", names[i], r.status, r.error);
        if (access("/dev/full", W_OK)) continue;
        char command[400], text[256];
        snprintf(command, sizeof command, "build/%s 2>'%s' >/dev/full", names[i], temporary("full"));
        CHECK(system(command) && read_text(temporary("full"), text, sizeof text) && strstr(text, "standard output: "),
              "%s to a full disk: \"%s\"", names[i], text);
    }
    for (size_t i = 0; i < 7; i++) {
        char path[64];
        snprintf(path, sizeof path, "build/%s", names[i]);
        check_refusal(path, i % 2 ? "--help" : "volume.raw", 2, "usage");
    }
}

TEST(meshes_are_written) {
    char arguments[300], text[64], old[256];
    strcpy(old, temporary("old.obj"));
    write_bytes(old, "do not touch", 12);
    CHECK(link(old, temporary("a.obj")) == 0, "link"); /* a second name: the file is replaced as a whole, not written over */
    snprintf(arguments, sizeof arguments, "'%s'", temporary("a.obj"));
    run_result r = run_program("build/mesh_obj", arguments);
    CHECK(r.status == 0 && strstr(r.output, "closed"), "status %d: %s", r.status, r.error);
    CHECK(read_text(temporary("a.obj"), text, sizeof text) && !strncmp(text, "v ", 2), "begins with %s", text);
    CHECK(read_text(old, text, sizeof text) == 12 && !strcmp(text, "do not touch"), "the file that was there is written over: %s", text);
    check_refusal("build/mesh_obj", "--help", 2, "usage");
    check_refusal("build/mesh_obj", "a.obj b.obj", 2, "usage");
    check_refusal("build/mesh_obj", "/nowhere/a.obj", 1, "/nowhere/a.obj: cannot be written: No such file");
}

/* A link that leads nowhere yet stays a link: the file is made where it leads. One that leads to itself is an error. */
TEST(links_to_files_yet_to_come_are_followed) {
    static const unsigned char pixel[3] = {1, 2, 3};
    char arguments[600], text[64], error[FILE_ERROR_SIZE], picture[256];
    struct stat status;
    strcpy(picture, temporary("pixel.png"));
    CHECK(png_write(picture, pixel, 1, 1, 3, error), "%s", error);
    CHECK(symlink("link2", temporary("link1")) == 0 && symlink("target", temporary("link2")) == 0, "symlink");
    snprintf(arguments, sizeof arguments, "'%s' '%s'", temporary("link1"), picture);
    run_result r = run_program("build/strip", arguments);
    CHECK(r.status == 0, "status %d: %s", r.status, r.error);
    CHECK(readlink(temporary("link1"), text, sizeof text) == 5 && readlink(temporary("link2"), text, sizeof text) == 6, "links are gone");
    CHECK(lstat(temporary("target"), &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 50, "nothing is where they led");
    CHECK(symlink("ring", temporary("ring")) == 0, "symlink");
    snprintf(arguments, sizeof arguments, "'%s' '%s'", temporary("ring"), picture);
    check_refusal("build/strip", arguments, 1, "ring: Too many levels");
    CHECK(symlink("to_be", temporary("link3")) == 0, "symlink");
    snprintf(arguments, sizeof arguments, "procedural:gyroid:8 --samples 1 --raw '%s' --out '%s'", temporary("to_be"), temporary("link3"));
    check_refusal("build/bake", arguments, 1, "is the file of --out");
}

TEST(names_may_be_as_long_as_they_can_be) {
    char name[256], arguments[700];
    memset(name, 'n', 251), strcpy(name + 251, ".png");
    snprintf(arguments, sizeof arguments, "procedural:gyroid:8 --mode lambert --size 8x8 --out '%s'", temporary(name));
    run_result r = run_program("build/viewer", arguments);
    CHECK(r.status == 0, "status %d: %s", r.status, r.error);
}

/* What takes the place of a file may be read and written by the same people; one that may not be written stays. */
TEST(permissions_of_files_are_kept) {
    static const unsigned char pixel[3] = {1, 2, 3};
    static const mode_t modes[3] = {0640, 0604, 0};
    char arguments[600], error[FILE_ERROR_SIZE], picture[256], strip[256];
    struct stat status;
    strcpy(picture, temporary("pixel.png")), strcpy(strip, temporary("permitted.png"));
    CHECK(png_write(picture, pixel, 1, 1, 3, error), "%s", error);
    snprintf(arguments, sizeof arguments, "'%s' '%s'", strip, picture);
    for (int i = 0; i < 3; i++) {
        write_bytes(strip, "old", 3);
        CHECK(chmod(strip, modes[i]) == 0, "chmod");
        run_result r = run_program("build/strip", arguments);
        int replaced = stat(strip, &status) == 0 && status.st_size != 3, may = modes[i] || geteuid() == 0;
        CHECK(replaced == may && (r.status == 0) == may && (status.st_mode & 0777) == modes[i], "%03o: status %d, %03o, %s", modes[i],
              r.status, status.st_mode & 0777, r.error);
        unlink(strip);
    }
}

/* Every refusal leaves the file named as output as it was. */
static void check_kept(const char *program, const char *format, int status, const char *must_say) {
    char arguments[1024], kept[256], text[64];
    strcpy(kept, temporary("kept"));
    write_bytes(kept, "do not touch", 12);
    snprintf(arguments, sizeof arguments, format, kept);
    check_refusal(program, arguments, status, must_say);
    CHECK(read_text(kept, text, sizeof text) == 12 && !strcmp(text, "do not touch"), "%s %s changed its output", program, arguments);
}

/* Figure 1a of Kraus 2005: where the formula crosses a level between two pixels of a row there is ink, and ink is near a level. */
TEST(isolines_lie_where_the_formula_has_their_values) {
    enum { SIDE = 512, LINES = 12 };
    const procedural_shape *shape = procedural_find("coulomb");
    const double low = 0.3, high = 2.5, gap = (high - low) / (LINES - 1);
    static unsigned char file[1 << 20];
    static double value[SIDE][SIDE];
    unsigned char *pixels = NULL;
    char arguments[300], error[FILE_ERROR_SIZE];
    int form[3], crossings = 0, bare = 0, inked = 0, stray = 0;
    double furthest = 0;
    snprintf(arguments, sizeof arguments, "coulomb %d %g %g '%s'", LINES, low, high, temporary("1a.png"));
    run_result r = run_program("build/isolines", arguments);
    FILE *f = fopen(temporary("1a.png"), "rb");
    size_t size = f ? fread(file, 1, sizeof file, f) : 0;
    if (f) fclose(f);
    CHECK(r.status == 0 && png_decode(file, size, &pixels, form, error) && form[0] == SIDE && form[1] == SIDE && form[2] == 3,
          "status %d, %zu bytes", r.status, size);
    if (!pixels) return;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double p[3] = {((i % SIDE + 0.5) / SIDE - 0.5) * 2, (0.5 - (i / SIDE + 0.5) / SIDE) * 2, 0};
        value[i / SIDE][i % SIDE] = procedural_value(shape, p, 2 / 127.0);
    }
    for (int y = 1; y < SIDE - 1; y++)
        for (int x = 1; x < SIDE - 1; x++) {
            const unsigned char *at = pixels + 3 * (x + SIDE * y), *beside = at + 3;
            double v = value[y][x], next = value[y][x + 1], level = fmin(fmax(floor((v - low) / gap + 0.5), 0), LINES - 1);
            double slope = 0.5 * SIDE / 2 *
                           sqrt(pow(next - value[y][x - 1], 2) + pow(value[y + 1][x] - value[y - 1][x], 2)); /* per unit, of a box of 2 */
            if (floor((v - low) / gap) != floor((next - low) / gap) && fmax(v, next) > low && fmin(v, next) < high) {
                crossings++, bare += at[1] > 200 && beside[1] > 200; /* paper is 0.9 in all channels, ink dark in green */
            }
            if (at[1] > 120) continue; /* at most a pixel off its line, here by the formula's slope */
            double away = fabs(v - low - level * gap) / slope * SIDE / 2;
            inked++, stray += away > 2, furthest = fmax(furthest, away);
        }
    printf("    %d crossings of levels, %d without ink; %d pixels of ink, the furthest %.2g pixels off\n", crossings, bare, inked,
           furthest);
    CHECK(crossings > 2000 && inked > 5000 && !bare && !stray, "%d bare, %d stray", bare, stray);
    free(pixels);
}

TEST(bad_isolines_get_one_line) {
    static const char *const bad[] = {"gyroid x 0 1 '%s'", "gyroid 3 1 0 '%s'", "gyroid 3 0 nan '%s'", "gyroid 1e30 0 1 '%s'",
        "gyroid 0 0 1 '%s'", "gyroid 3 0 1x '%s'", "gyroid 2.5 0 1 '%s'"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) check_kept("build/isolines", bad[i], 1, "LINES is 1 to 1000");
    check_kept("build/isolines", "", 2, "usage");
    check_kept("build/isolines", "teapot 3 0 1 '%s'", 2, "usage");
    check_kept("build/isolines", "gyroid 3 0 1 /nowhere/a.png", 1, "/nowhere/a.png: cannot be written");
}

TEST(bad_meshes_of_tetrahedra_get_one_line) {
    const struct { const char *name; size_t size; unsigned char bytes[64]; const char *say;
    } files[] = {{"empty.tet", 0, {0}, "is not a .tet file"},
                 {"other.tet", 16, {"RIFFxxxxxxxxxxx"}, "is not a .tet file"},
                 {"cut.tet", 20, {'T', 'E', 'T', 'S', 4, 0, 0, 0, 1}, "has 20 bytes"},
                 {"vast.tet", 20, {'T', 'E', 'T', 'S', 255, 255, 255, 255, 255, 255, 255, 255}, "has 20 bytes"},
                 {"none.tet", 12, {'T', 'E', 'T', 'S'}, "invalid"},                                     /* no point */
                 {"beyond.tet", 44, {'T', 'E', 'T', 'S', 1, 0, 0, 0, 1, 0, 0, 0, [28] = 9}, "invalid"}, /* a corner that is no point */
                 {"short_4x4x4_uint8.raw", 63, {0}, "63 bytes"}};
    char arguments[600];
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        write_bytes(temporary(files[i].name), files[i].bytes, files[i].size);
        snprintf(arguments, sizeof arguments, "'%s' data '%%s'", temporary(files[i].name));
        check_kept("build/tets", arguments, 1, files[i].say);
    }
    check_kept("build/tets", "/nowhere.tet data '%s'", 1, "No such file");
    check_kept("build/tets", "/nowhere.tet magic '%s'", 2, "usage");
    check_kept("build/tets", "/nowhere.tet data '%s' 0", 2, "usage");
    check_kept("build/tets", "/nowhere.tet data '%s' 100000", 2, "usage");
    check_kept("build/tets", "/nowhere.tet data '%s' 16x", 2, "usage");
    check_kept("build/tets", "/nowhere.tet data '%s' 1e999", 2, "usage");
    check_kept("build/tets", "'%1$s' data '%1$s'", 1, "is MESH and OUT.png");
    check_kept("build/tets", "", 2, "usage");
}

TEST(strips_hold_their_pictures) {
    unsigned char pixels[2][2 * 3 * 3], *got = NULL, *file = NULL;
    char arguments[600], error[FILE_ERROR_SIZE];
    int shape[3] = {0};
    size_t size = 0;
    for (int i = 0; i < 18; i++) pixels[0][i] = (unsigned char)(9 * i), pixels[1][i] = (unsigned char)(255 - i);
    for (int i = 0; i < 2; i++) CHECK(png_write(temporary(i ? "b.png" : "a.png"), pixels[i], 2, 3, 3, error), "%s", error);
    snprintf(arguments, sizeof arguments, "'%s' '%s' '%s'", temporary("strip.png"), temporary("a.png"), temporary("b.png"));
    run_result r = run_program("build/strip", arguments);
    CHECK(r.status == 0 && file_read(temporary("strip.png"), 1 << 20, &file, &size, error), "status %d: %s", r.status, r.error);
    if (r.status) return;
    CHECK(png_decode(file, size, &got, shape, error) && shape[0] == 8 && shape[1] == 3, "%dx%d", shape[0], shape[1]);
    for (int y = 0; got && y < 3; y++)
        for (int i = 0; i < 2; i++) CHECK(!memcmp(got + 24 * y + 18 * i, pixels[i] + 6 * y, 6), "row %d of picture %d", y, i);
    free(got), free(file);
    check_kept("build/strip", "'%s'", 2, "usage");
    check_kept("build/strip", "'%s' /nowhere.png", 1, "/nowhere.png: No such file");
    check_kept("build/strip", "'%s' tests/test.h", 1, "tests/test.h: is not a PNG file");
    check_kept("build/strip", "'%s' examples/gyroid.png examples/figure-6.png", 1, "pixels high, the first");
    CHECK(png_write(temporary("alpha.png"), pixels[0], 2, 2, 4, error), "%s", error);
    snprintf(arguments, sizeof arguments, "'%%s' '%s'", temporary("alpha.png"));
    check_kept("build/strip", arguments, 1, "has an alpha channel");
}

TEST(bad_bakes_get_one_line) {
    static const char *const bad[][2] = {{"", "VOLUME and --out are needed"}, {"--out '%s'", "VOLUME and --out are needed"},
        {"procedural:gyroid:8 --out", "--out: needs a value"}, {"procedural:gyroid:8 --out --both-sides", "--out: needs a value"},
        {"procedural:gyroid:8 --out '%s' --raw --both-sides", "its value is missing"},
        {"procedural:teapot --out '%s'", "no such volume"}, {"procedural:gyroid:8 --samples 1 --out '%s'", "is damaged"},
        {"procedural:gyroid:8 --samples 0 --out '%s'", "--samples"},
        {"procedural:gyroid:8 --samples nan --out '%s'", "--samples"}, {"procedural:gyroid:8 --lattice 0,0,0 --out '%s'", "--lattice"},
        {"procedural:gyroid:8 --spacing 0,1,1 --out '%s'", "--spacing"}, {"procedural:gyroid:8 --format best --out '%s'", "--format"},
        {"procedural:gyroid:8 --storage best --out '%s'", "--storage"},
        {"procedural:gyroid:8 --env /nowhere.hdr --out '%s'", "/nowhere.hdr"},
        {"procedural:gyroid:8 --merge /nowhere.bake --out '%s'", "/nowhere.bake"}, {"procedural:gyroid:8 --box 1,2,3 --out '%s'", "--box"},
        {"procedural:gyroid:8.5 --out '%s'", "whole number"}, {"procedural:gyroid:8 --lattice 8,8,8.5 --out '%s'", "--lattice"},
        {"procedural:gyroid:8 --box 0,0,0,8,8,4.5 --out '%s'", "--box"},
        {"procedural:gyroid:8 --box 0,0,0,0,0,0 --out '%s'", "--box"}, {"procedural:gyroid:8 --raw /nowhere/a.rgb --samples 1 --out '%s'",
        "/nowhere/a.rgb: cannot be written"},
        {"procedural:gyroid:8 --mode transfer --light directional:1,1,1:1,1,1 --out '%s'", "--mode transfer bakes for any light"},
        {"/nowhere_4x4x4_uint8.raw --out '%s'", "No such file"},
        {"procedural:gyroid:8 --samples 1 --out /nowhere/a.bake", "/nowhere/a.bake: cannot be written"},
        {"procedural:gyroid:8 --nonsense --out '%s'", "no such option"},
        {"procedural:gyroid:8 --box 0,0,0,8,9,8 --out '%s'", "--box: reaches beyond the lattice along y"},
        {"'%1$s' --raw '%1$s' --out '%1$s.a'", "is the file of VOLUME"},
        {"'%1$s' --merge '%1$s.a' --out '%1$s'", "--out: "},
        {"procedural:gyroid:8 --raw '%1$s' --out '%1$s'", "is the file of --out"},
        {"procedural:gyroid:8 --raw ./neither.a --out neither.a", "is the file of --out"},
        {"procedural:gyroid:8 --merge '%1$s' --raw '%1$s' --out '%1$s.a'", "is the file of --merge"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) check_kept("build/bake", bad[i][0], 1, bad[i][1]);
}

/* What --out holds is kept whatever is merged into it; a texture of another bake, or what is none, is refused. */
TEST(merges_go_on_from_what_is_there) {
    static const char bake[] = "procedural:gyroid:8 --samples 4 --threads 1", *const boxes[2] = {"0,0,0,8,8,3", "0,0,3,8,8,8"};
    unsigned char *file[2] = {NULL, NULL};
    char arguments[1024], error[FILE_ERROR_SIZE], part[256];
    size_t size[2] = {0, 0};
    strcpy(part, temporary("part"));
    for (int i = 0; i < 4; i++) { /* all at once; one part, the other one, and both of them */
        snprintf(arguments, sizeof arguments, "%s --out '%s' %s%s%s%s%s", bake, i == 1 ? part : temporary(i ? "merged" : "whole"),
                 i % 3 ? "--box " : "", i % 3 ? boxes[i - 1] : "", i == 3 ? "--merge '" : "", i == 3 ? part : "", i == 3 ? "'" : "");
        run_result r = run_program("build/bake", arguments);
        CHECK(r.status == 0, "%s: status %d: %s", arguments, r.status, r.error);
    }
    for (int i = 0; i < 2; i++)
        CHECK(file_read(temporary(i ? "merged" : "whole"), 1 << 20, &file[i], &size[i], error), "%s", error);
    CHECK(size[0] && size[0] == size[1] && file[0] && file[1] && !memcmp(file[0], file[1], size[0]), "%zu and %zu bytes", size[0], size[1]);
    for (int i = 0; i < 2; i++) free(file[i]);
    snprintf(arguments, sizeof arguments, "%s --merge '%s' --out '%%s'", bake, part);
    check_kept("build/bake", arguments, 1, "is damaged");
    snprintf(arguments, sizeof arguments, "procedural:gyroid:8 --samples 2 --out '%s'", temporary("two"));
    CHECK(run_program("build/bake", arguments).status == 0, "%s", arguments);
    snprintf(arguments, sizeof arguments, "%s --merge '%s' --out '%s'", bake, part, temporary("two"));
    check_refusal("build/bake", arguments, 1, "holds another texture");
}

/* A file is known by what it is, not by how it is called. */
TEST(what_is_read_is_not_overwritten) {
    static const unsigned char pixel[3] = {1, 2, 3};
    static const char sky[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\x80\x40\x20\x81";
    char picture[256], environment[256], arguments[1024], error[FILE_ERROR_SIZE];
    strcpy(picture, temporary("one.png")), strcpy(environment, temporary("env.hdr"));
    CHECK(png_write(picture, pixel, 1, 1, 3, error), "%s", error);
    snprintf(arguments, sizeof arguments, "'%s/./one.png' '%s' '%s'", folder, picture, picture);
    check_refusal("build/strip", arguments, 1, "is both a picture and the strip");
    write_bytes(environment, sky, sizeof sky - 1);
    for (int out = 0; out < 2; out++) {
        snprintf(arguments, sizeof arguments, "procedural:gyroid:8 --samples 1 --env '%s' --%s '%s' --%s '%s'", environment,
                 out ? "out" : "raw", environment, out ? "raw" : "out", temporary("other"));
        check_refusal("build/bake", arguments, 1, "is the file of --env");
    }
}

TEST_MAIN("examples")
