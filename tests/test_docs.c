/* The programs in the documentation are programs: each quick start in a header and each in the README compiles and runs.
   FLAGS: -O0 */
#define _DEFAULT_SOURCE
#include "test.h"
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *const headers[] = {"isogi_sh", "isogi_vol", "isogi_trace", "isogi_dvr"};
enum { HEADERS = 4, MOST_LINES = 15, LINE = 512 };

/* The text of a file; NULL where there is none. The caller frees it. */
static char *read_text(const char *path) {
    FILE *file = fopen(path, "rb");
    size_t size = 0, got;
    char *text = NULL;
    if (!file) return NULL;
    do {
        text = (char *)realloc(text, size + 65537);
        got = fread(text + size, 1, 65536, file);
        size += got;
    } while (got);
    text[size] = 0;
    fclose(file);
    return text;
}

/* Copies the next line without its end; NULL after the last one. */
static const char *next_line(const char *at, char line[LINE]) {
    size_t length;
    if (!at || !*at) return NULL;
    length = strcspn(at, "\n");
    snprintf(line, LINE, "%.*s", (int)(length < LINE ? length : LINE - 1), at);
    return at + length + (at[length] == '\n');
}

static size_t indentation(const char *line) { return strspn(line, " "); }

/* The program below "   Quick start" in a header, shifted to the left edge; its lines that are not empty; 0 = none found. */
static int quick_start(const char *header, char *program, size_t size) {
    char path[64], line[LINE], *text;
    const char *at;
    size_t shift = 0, used = 0;
    int lines = 0, inside = 0;
    program[0] = 0;
    snprintf(path, sizeof path, "%s.h", header);
    text = read_text(path);
    for (at = next_line(text, line); at; at = next_line(at, line)) {
        if (!strncmp(line, "   Quick start", 14)) inside = 1;
        else if (inside && line[strspn(line, " ")] && indentation(line) < 5) break;
        else if (inside && (lines || line[strspn(line, " ")])) {
            if (!lines) shift = indentation(line);
            if (line[strspn(line, " ")]) lines++;
            used += (size_t)snprintf(program + used, size - used, "%s\n", strlen(line) > shift ? line + shift : "");
            if (used >= size) used = size - 1;
        }
    }
    while (used > 1 && program[used - 2] == '\n') program[--used] = 0;
    free(text);
    return lines;
}

/* The n-th block of C in the README; 0 = there are no more. */
static int readme_program(const char *readme, int n, char *program, size_t size) {
    char line[LINE];
    size_t used = 0;
    int inside = 0;
    program[0] = 0;
    for (const char *at = next_line(readme, line); at; at = next_line(at, line)) {
        if (!inside && !strcmp(line, "```c")) inside = n-- == 0;
        else if (inside && !strcmp(line, "```")) return 1;
        else if (inside && used < size - 1) used += (size_t)snprintf(program + used, size - used, "%s\n", line);
    }
    return 0;
}

/* The shell command's output and whether it succeeded and said something. */
static int succeeds(const char *command, char *said, size_t size) {
    FILE *file;
    size_t got;
    int status;
    fflush(stdout);
    if (!(file = popen(command, "r"))) return snprintf(said, size, "cannot run %s", command), 0;
    got = fread(said, 1, size - 1, file);
    said[got] = 0;
    status = pclose(file);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 && got > 0;
}

static const char *variable(const char *name, const char *otherwise) {
    const char *value = getenv(name);
    return value && *value ? value : otherwise;
}

static char program[8192], other[8192], output[4096];

/* Compiles and runs a program in build/docs, pasted into a file of its own: as C99 and as C++11, without a warning. Quick: linked with the
   implementations that were compiled before, which must not change what the program needs to include, and run once; --long: by itself, as
   users do, and run as both, as C++ without optimization, in half the time. */
static void check_program(const char *name, const char *text) {
    char command[2048], path[64];
    FILE *file;
    mkdir("build", 0777), mkdir("build/docs", 0777);
    snprintf(path, sizeof path, "build/docs/%s.c", name);
    file = fopen(path, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0, "cannot write %s", path);
    for (int cxx = 0; cxx < 2; cxx++) {
        const char *compiler = cxx ? variable("CXX", "c++") : variable("CC", "cc");
        snprintf(command, sizeof command, "%s --version", compiler);
        if (cxx && !succeeds(command, output, sizeof output)) continue; /* a C++ compiler is not needed */
        snprintf(command, sizeof command,
                 "{ %s %s %s %s -Wall -Wextra -Wpedantic -Werror %s -I. -c -o build/docs/%s.o %s && %s %s -o build/docs/%s build/docs/%s.o "
                 "%s -lm -lpthread && %s build/docs/%s; } 2>&1",
                 compiler, cxx ? "-x c++ -std=c++11" : "-std=c99", variable("CFLAGS", ""), cxx ? "-O0" : "",
                 LONG_SUITE ? "" : "-DISOGI_SH_IMPLEMENTED -DISOGI_VOL_IMPLEMENTED -DISOGI_TRACE_IMPLEMENTED -DISOGI_DVR_IMPLEMENTED", name,
                 path, compiler, variable("CFLAGS", ""), name, name,
                 LONG_SUITE ? "" : "build/isogi_sh.o build/isogi_vol.o build/isogi_trace.o build/isogi_dvr.o",
                 cxx && !LONG_SUITE ? "echo linked:" : "", name);
        CHECK(succeeds(command, output, sizeof output), "%s as %s: %s", name, cxx ? "C++11" : "C99", output);
        if (!cxx) printf("    %s", output);
    }
}

static void check_header(const char *header) {
    int lines = quick_start(header, program, sizeof program);
    CHECK(lines >= 5 && strstr(program, "int main(void)"), "%s.h has no quick start", header);
    CHECK(lines <= MOST_LINES, "%s.h: the quick start has %d lines, at most %d are allowed", header, lines, MOST_LINES);
    check_program(header, program);
}
TEST(quick_start_of_isogi_sh_compiles_and_runs) { check_header("isogi_sh"); }
TEST(quick_start_of_isogi_vol_compiles_and_runs) { check_header("isogi_vol"); }
TEST(quick_start_of_isogi_trace_compiles_and_runs) { check_header("isogi_trace"); }
TEST(quick_start_of_isogi_dvr_compiles_and_runs) { check_header("isogi_dvr"); }

/* Those that are no header's quick start. */
TEST(programs_of_the_readme_compile_and_run) {
    char *readme = read_text("README.md");
    int count = 0;
    CHECK(readme != NULL, "no README.md");
    while (readme && readme_program(readme, count, program, sizeof program)) {
        char name[32];
        int known = 0;
        for (int h = 0; h < HEADERS; h++) quick_start(headers[h], other, sizeof other), known |= !strcmp(program, other);
        snprintf(name, sizeof name, "readme_%d", count++);
        if (!known) check_program(name, program);
    }
    CHECK(count >= HEADERS, "%d programs in the README, one for each header is the least", count);
    free(readme);
}

TEST(readme_shows_the_quick_start_of_every_header) {
    char *readme = read_text("README.md");
    CHECK(readme != NULL, "no README.md");
    for (int h = 0; h < HEADERS && readme; h++) {
        int found = 0;
        quick_start(headers[h], program, sizeof program);
        for (int n = 0; !found && readme_program(readme, n, other, sizeof other); n++) found = !strcmp(program, other);
        CHECK(found, "the README shows another program than the quick start of %s.h", headers[h]);
    }
    free(readme);
}

/* Every "make X" is a target of the Makefile, every --option of build/viewer is one that its help lists. */
TEST(readme_names_commands_that_exist) {
    char *readme = read_text("README.md"), *makefile = read_text("Makefile"), line[LINE], word[64], target[80];
    FILE *help = popen("build/viewer --help", "r");
    int options = 0, targets = 0;
    output[0] = 0;
    static char text[65536];
    if (help) text[fread(text, 1, sizeof text - 1, help)] = 0, pclose(help);
    CHECK(readme && makefile && text[0], "README.md, Makefile or build/viewer is missing");
    for (const char *at = readme ? next_line(readme, line) : NULL; at; at = next_line(at, line)) {
        for (const char *p = line; (p = strstr(p, "make ")); p += 5) {
            if ((p != line && p[-1] != '`' && p[-1] != ' ') || sscanf(p + 5, "%63[a-z]", word) != 1) continue;
            if (p != line && p[-1] == ' ' && line[0] != ' ') continue; /* "make" as a word of English */
            snprintf(target, sizeof target, "\n%s:", word);
            CHECK(strstr(makefile, target) != NULL, "\"make %s\" is no target", word);
            targets++;
        }
        for (const char *p = strstr(line, "build/viewer"); p && (p = strstr(p, " --")); p += 3) {
            if (sscanf(p + 1, "%63[-a-z]", word) != 1) continue;
            CHECK(strstr(text, word) != NULL, "build/viewer has no option %s", word);
            options++;
        }
    }
    CHECK(targets > 3 && options > 3, "%d targets and %d options found: the search looks in the wrong place", targets, options);
    free(readme), free(makefile);
}

TEST_MAIN("docs")
