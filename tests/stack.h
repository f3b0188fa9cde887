/* How much of the stack a call takes: the libraries promise less than 32 KB, and limits of their own where nothing is optimised. A test
   that includes this begins with #define _GNU_SOURCE, and asks STACK_MEASURED. */
#ifndef STACK_H
#define STACK_H

#include "test.h"

#if defined(__linux__) && !TEST_SANITIZED
#define STACK_MEASURED 1
#include <pthread.h>

enum { STACK = 1 << 18 };
#ifdef __OPTIMIZE__
enum { MOST_BYTES_SH = 32 << 10, MOST_BYTES = 32 << 10 };
#elif defined(__clang__)
enum { MOST_BYTES_SH = 60 << 10, MOST_BYTES = 140 << 10 };
#else
enum { MOST_BYTES_SH = 60 << 10, MOST_BYTES = 70 << 10 };
#endif
#if defined(__OPTIMIZE__) && defined(__clang__)
enum { MOST_BYTES_TRACE = 35000 }; /* it keeps 2 KB more in the frame of rays that are traced together */
#else
enum { MOST_BYTES_TRACE = MOST_BYTES };
#endif

typedef struct stack_use {
    void (*run)(int variant);
    int variant;
    uintptr_t top;
} stack_use;

static void *on_a_stack(void *user) {
    stack_use *u = (stack_use *)user;
    volatile unsigned char here = 0;
    u->top = (uintptr_t)&here;
    if (u->run) u->run(u->variant);
    return NULL;
}

/* Bytes below the caller's frame that a call wrote to; each is made once before, so that the linker's part of a first
   call does not count. */
static size_t stack_of(void (*run)(int variant), int variant) {
    static unsigned char memory[STACK] __attribute__((aligned(65536)));
    stack_use u = {run, variant, 0};
    pthread_attr_t attributes;
    pthread_t thread;
    size_t lowest = 0;
    int started;
    run(variant);
    memset(memory, 0xa5, sizeof memory);
    pthread_attr_init(&attributes);
    started = !pthread_attr_setstack(&attributes, memory, sizeof memory) && !pthread_create(&thread, &attributes, on_a_stack, &u);
    CHECK(started, "variant %d: no thread", variant);
    if (started) pthread_join(thread, NULL);
    pthread_attr_destroy(&attributes);
    while (lowest < STACK && memory[lowest] == 0xa5) lowest++;
    return u.top ? (size_t)(u.top - (uintptr_t)memory) - lowest : STACK;
}
#else
#define STACK_MEASURED 0
#endif
#endif
