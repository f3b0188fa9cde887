/* files.h - whole files in and out, with one line of text when it fails

   Reading stops at a limit, so that an endless or enormous file is a message and not a machine without memory. Writing goes to a
   temporary file beside the target that takes its place only when it is complete: whatever fails, an existing file stays as it was. */
#ifndef FILES_H
#define FILES_H

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_ERROR_SIZE 512

/* Writes the message and returns 0, so that a failing function can end with it. Whatever came from a file or a name and is not
   plain ASCII is shown as '?', so that the message stays one line of text. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static inline int file_fail(char *error, const char *format, ...) {
    va_list values;
    char *c;
    va_start(values, format);
    vsnprintf(error, FILE_ERROR_SIZE, format, values);
    va_end(values);
    for (c = error; *c; c++)
        if ((unsigned char)*c < 32 || (unsigned char)*c >= 127) *c = '?';
    return 0;
}

/* Whether all that was printed has reached standard output. */
static inline int file_printed(char *error) {
    return (fflush(stdout) == 0 && !ferror(stdout)) || file_fail(error, "standard output: %s", strerror(errno));
}

/* Opens a regular file for reading and tells its size. Returns the descriptor, or -1 with a message. */
static inline int file_open(const char *path, uint64_t *size, char *error) {
    struct stat status;
    int file = open(path, O_RDONLY | O_NONBLOCK); /* without waiting for the other end of a pipe */
    if (file < 0) {
        file_fail(error, "%s: %s", path, strerror(errno));
        return -1;
    }
    if (fstat(file, &status) != 0) file_fail(error, "%s: %s", path, strerror(errno));
    else if (S_ISDIR(status.st_mode)) file_fail(error, "%s: is a folder", path);
    else if (!S_ISREG(status.st_mode)) file_fail(error, "%s: is not a regular file", path);
    else {
        *size = (uint64_t)status.st_size;
        return file;
    }
    close(file);
    return -1;
}

/* Exactly `size` bytes; 0 with a message if there are fewer. */
static inline int file_read_bytes(int file, const char *path, unsigned char *data, size_t size, char *error) {
    size_t done = 0;
    while (done < size) {
        size_t piece = size - done < ((size_t)1 << 30) ? size - done : (size_t)1 << 30;
        ssize_t got = read(file, data + done, piece);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return file_fail(error, "%s: %s", path, strerror(errno));
        if (got == 0) return file_fail(error, "%s: ends after %zu of %zu bytes", path, done, size);
        done += (size_t)got;
    }
    return 1;
}

/* The whole file, with a zero byte behind it. The caller frees *data. */
static inline int file_read(const char *path, size_t limit, unsigned char **data, size_t *size, char *error) {
    uint64_t length;
    unsigned char *bytes;
    int ok, file = file_open(path, &length, error);
    if (file < 0) return 0;
    if (length > limit) {
        close(file);
        return file_fail(error, "%s: has %llu bytes, at most %zu are allowed here", path, (unsigned long long)length, limit);
    }
    bytes = (unsigned char *)malloc((size_t)length + 1);
    ok = bytes ? file_read_bytes(file, path, bytes, (size_t)length, error) : file_fail(error, "%s: out of memory", path);
    close(file);
    if (!ok) {
        free(bytes);
        return 0;
    }
    bytes[length] = 0;
    *data = bytes;
    *size = (size_t)length;
    return 1;
}

/* Where symbolic links that lead to nothing lead: the file will be written there. */
static inline int file_end_of_links(const char *path, char target[PATH_MAX], char *error) {
    char link[PATH_MAX];
    ssize_t length = 0;
    for (int steps = 0; steps < 40 && (length = readlink(target, link, PATH_MAX - 32)) >= 0; steps++) {
        char *slash = strrchr(target, '/');
        size_t folder = *link == '/' || !slash ? 0 : (size_t)(slash - target) + 1; /* what a relative link begins from */
        if (folder + (size_t)length + 32 > PATH_MAX) return file_fail(error, "%s: leads to a name that is too long", path);
        memcpy(target + folder, link, (size_t)length);
        target[folder + (size_t)length] = 0;
    }
    return length < 0 || file_fail(error, "%s: %s", path, strerror(ELOOP));
}

/* The file that a path really names: links are followed, so that a link is not replaced by what it points to. */
static inline int file_target(const char *path, char target[PATH_MAX], mode_t *mode, int *special, char *error) {
    struct stat status;
    *special = 0;
    *mode = 0;
    if (!*path) return file_fail(error, "the name of the file to write is empty");
    if (strlen(path) + 32 > PATH_MAX) return file_fail(error, "%.100s...: the name is too long", path);
    strcpy(target, path);
    if (stat(path, &status) != 0)
        return errno == ENOENT ? file_end_of_links(path, target, error) : file_fail(error, "%s: %s", path, strerror(errno));
    if (S_ISDIR(status.st_mode)) return file_fail(error, "%s: is a folder", path);
    *special = !S_ISREG(status.st_mode);
    *mode = status.st_mode; /* never 0 where there is a file */
    if (!*special && !realpath(path, target)) return file_fail(error, "%s: %s", path, strerror(errno));
    if (strlen(target) + 32 > PATH_MAX) return file_fail(error, "%.100s...: the name is too long", path);
    return 1;
}

static inline int file_write_bytes(int file, const unsigned char *data, size_t size) {
    while (size) {
        ssize_t put = write(file, data, size < ((size_t)1 << 30) ? size : (size_t)1 << 30);
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return 0;
        data += put, size -= (size_t)put;
    }
    return 1;
}

static inline int file_temporary(const char *target, char name[PATH_MAX], const char *path, char *error) {
    const char *slash = strrchr(target, '/');
    int file, attempt = 0;
    do { /* short: the target's own name may be as long as names can be */
        snprintf(name, PATH_MAX, "%.*s.%ld-%d.tmp", slash ? (int)(slash - target) + 1 : 0, target, (long)getpid(), attempt);
        file = open(name, O_WRONLY | O_CREAT | O_EXCL, 0666);
    } while (file < 0 && errno == EEXIST && ++attempt < 100);
    if (file < 0) file_fail(error, "%s: cannot be written: %s", path, strerror(errno));
    return file;
}

/* The folder of a file that need not be there; returns the file's name within it. */
static inline const char *file_folder(const char *path, struct stat *folder, int *found) {
    const char *slash = strrchr(path, '/');
    char name[PATH_MAX] = ".";
    size_t length = slash ? (size_t)(slash - path) + 1 : 0;
    if (length && length < sizeof name) memcpy(name, path, length), name[length] = 0;
    *found = length < sizeof name && stat(name, folder) == 0;
    return path + length;
}

/* Two names of one file, be it there yet or not. Devices may be named twice. */
static inline int file_same(const char *a, const char *b) {
    struct stat x, y;
    int a_there, b_there;
    if (!a || !b) return 0;
    a_there = stat(a, &x) == 0, b_there = stat(b, &y) == 0;
    if (a_there != b_there) return 0;
    if (!a_there) {
        char end_a[PATH_MAX], end_b[PATH_MAX], error[FILE_ERROR_SIZE];
        const char *name_a, *name_b;
        mode_t mode;
        int special;
        if (!file_target(a, end_a, &mode, &special, error) || !file_target(b, end_b, &mode, &special, error)) return !strcmp(a, b);
        name_a = file_folder(end_a, &x, &a_there), name_b = file_folder(end_b, &y, &b_there);
        return a_there && b_there && !strcmp(name_a, name_b) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
    }
    return S_ISREG(x.st_mode) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

/* Whether file_write could succeed: asked before hours of work, not after. */
static inline int file_writable(const char *path, char *error) {
    char target[PATH_MAX], name[PATH_MAX];
    mode_t mode;
    int special, file;
    if (!file_target(path, target, &mode, &special, error)) return 0;
    if (special) return access(path, W_OK) == 0 || file_fail(error, "%s: %s", path, strerror(errno));
    if (mode && access(target, W_OK) != 0) return file_fail(error, "%s: %s", path, strerror(errno));
    file = file_temporary(target, name, path, error);
    if (file < 0) return 0;
    close(file);
    unlink(name);
    return 1;
}

/* Devices and pipes are written to as they are; a regular file is replaced as a whole. */
static inline int file_write(const char *path, const void *data, size_t size, char *error) {
    char target[PATH_MAX], name[PATH_MAX];
    mode_t mode;
    int special, file, ok;
#ifdef SIGXFSZ
    signal(SIGXFSZ, SIG_IGN); /* a file larger than the shell allows is an error to be told, not the end of the program */
#endif
    if (!file_target(path, target, &mode, &special, error)) return 0;
    if (special) {
        file = open(path, O_WRONLY);
        if (file < 0) return file_fail(error, "%s: %s", path, strerror(errno));
        ok = file_write_bytes(file, (const unsigned char *)data, size);
        ok = (close(file) == 0 && ok) || file_fail(error, "%s: %s", path, strerror(errno));
        return ok;
    }
    file = file_temporary(target, name, path, error);
    if (file < 0) return 0;
    ok = file_write_bytes(file, (const unsigned char *)data, size) && (!mode || fchmod(file, mode & 0777) == 0);
    ok = close(file) == 0 && ok;
    ok = ok && rename(name, target) == 0;
    if (!ok) {
        file_fail(error, "%s: cannot be written: %s", path, strerror(errno));
        unlink(name);
    }
    return ok;
}

#endif /* FILES_H */
