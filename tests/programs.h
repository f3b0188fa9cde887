/* Running programs from tests: a folder of their own, exit code, what they wrote. */
#ifndef PROGRAMS_H
#define PROGRAMS_H

#include "test.h"
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static char folder[64]; /* removed at the end */

static void remove_folder(void) {
    char command[128];
    if (!*folder) return;
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    if (system(command) != 0) fprintf(stderr, "could not remove %s\n", folder);
}

static const char *temporary(const char *name) {
    static char path[16][300];
    static int turn;
    if (!*folder) {
        strcpy(folder, "/tmp/isogi_programs_XXXXXX");
        if (!mkdtemp(folder)) perror("mkdtemp"), exit(2);
        atexit(remove_folder);
    }
    turn = (turn + 1) % 16; /* a path stays for the next 15 calls */
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static void write_bytes(const char *path, const void *data, size_t size) {
    FILE *file = fopen(path, "wb");
    CHECK(file && fwrite(data, 1, size, file) == size && fclose(file) == 0, "cannot write %s", path);
}

typedef struct run_result {
    int status;      /* exit code; -1 when it was killed */
    size_t lines;    /* on the standard error */
    char error[2048], output[4096];
} run_result;

static size_t read_text(const char *path, char *text, size_t size) {
    FILE *file = fopen(path, "rb");
    size_t n = file ? fread(text, 1, size - 1, file) : 0;
    if (file) fclose(file);
    text[n] = 0;
    return n;
}

/* arguments: as a shell would read them */
static run_result run_program(const char *program, const char *arguments) {
    run_result r;
    char command[2048], output[256], error[256];
    int status;
    memset(&r, 0, sizeof r);
    strcpy(output, temporary("stdout")), strcpy(error, temporary("stderr"));
    snprintf(command, sizeof command, "'%s' %s >'%s' 2>'%s' </dev/null", program, arguments, output, error);
    fflush(stdout);
    status = system(command);
    r.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    if (r.status > 127) r.status = -1; /* the shell's way to tell of a signal */
    read_text(error, r.error, sizeof r.error), read_text(output, r.output, sizeof r.output);
    for (const char *c = r.error; *c; c++) r.lines += *c == '\n';
    return r;
}

/* A refusal is one line on the standard error and the given status. */
static void check_refusal(const char *program, const char *arguments, int status, const char *must_say) {
    run_result r = run_program(program, arguments);
    CHECK(r.status == status, "%s %s ended with %d: %s", program, arguments, r.status, r.error);
    CHECK(r.lines == 1, "%s %s wrote %zu lines: %s", program, arguments, r.lines, r.error);
    CHECK(strstr(r.error, must_say), "%s %s does not say \"%s\": %s", program, arguments, must_say, r.error);
}

#endif
