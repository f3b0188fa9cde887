/* Memory for voxels: as malloc's, and to be given to free, but in huge pages where Linux has them, as isogi_vol.h advises. */
#ifndef LARGE_H
#define LARGE_H

#include <stdint.h>
#include <stdlib.h>
#if defined(__linux__)
#include <sys/mman.h>
#endif

static inline void *large_allocate(size_t bytes) {
    void *p = malloc(bytes);
#ifdef MADV_HUGEPAGE
    const uintptr_t page = (uintptr_t)1 << 21, from = ((uintptr_t)p + page - 1) & ~(page - 1), to = ((uintptr_t)p + bytes) & ~(page - 1);
    if (p && from < to) (void)madvise((void *)from, to - from, MADV_HUGEPAGE);
#endif
    return p;
}

#endif
