/* Float evaluation of isogi_sh.h beside sphericart's, on one machine, one thread, turn by turn in one run. `make bench-peers` builds and
   runs it where SPHERICART names a folder with sphericart's include/sphericart.h and lib/libsphericart.so. LIBS: -lsphericart

       build/bench/peer_sphericart

   Nanoseconds a direction, data in cache, the shortest of many short runs; largest difference of a value between the two (the same real
   orthonormal basis). sphericart has no structures of arrays: the last column is what ours take. Its
   floats of degrees 19 and 20 are off (2e-4 and 2e-2 in one direction, against 128 bits, where ours are off by 2e-8). */
#define ISOGI_SH_IMPLEMENTATION
#include "isogi_sh.h"
#include <sphericart.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { COUNT = 128, ORDER = 21 };
static __attribute__((aligned(64))) float directions[COUNT][3], soa[3][COUNT], ours[ORDER * ORDER * COUNT], theirs[ORDER * ORDER * COUNT];

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void evaluate(int way, int order, size_t count, sphericart_spherical_harmonics_calculator_f_t *peer) {
    size_t n = ISOGI_SH_COUNT(order);
    if (way == 0) sphericart_spherical_harmonics_compute_array_f(peer, directions[0], 3 * count, theirs, n * count);
    else if (way == 1) isogi_sh_eval(ours, order, (const float(*)[3])directions, count);
    else isogi_sh_eval_soa(ours, order, soa[0], soa[1], soa[2], count);
}

int main(void) {
    static const int orders[] = {5, 11, 21};
    static const size_t counts[] = {128, 32, 16};
    srand(1);
    for (int i = 0; i < COUNT; i++) {
        double z = 2.0 * rand() / RAND_MAX - 1, phi = 6.283185307179586 * rand() / RAND_MAX, s = sqrt(1 - z * z);
        directions[i][0] = soa[0][i] = (float)(s * cos(phi)), directions[i][1] = soa[1][i] = (float)(s * sin(phi)), directions[i][2] = soa[2][i] = (float)z;
    }
    printf("degree   sphericart, ns   isogi, ns   ours / theirs   difference   isogi as structures of arrays, ns\n");
    for (int o = 0; o < 3; o++) {
        sphericart_spherical_harmonics_calculator_f_t *peer = sphericart_spherical_harmonics_new_f((size_t)orders[o] - 1);
        double best[3] = {1, 1, 1}, difference = 0;
        if (!peer) return fprintf(stderr, "sphericart makes no calculator\n"), 1;
        for (int run = 0; run < 500; run++)
            for (int way = 0; way < 3; way++) {
                double begun = cpu_seconds(), taken;
                for (int i = 0; i < 64; i++) evaluate(way, orders[o], counts[o], peer);
                taken = (cpu_seconds() - begun) / (64 * (double)counts[o]);
                if (taken < best[way]) best[way] = taken;
            }
        evaluate(1, orders[o], counts[o], peer);
        for (size_t i = 0; i < ISOGI_SH_COUNT(orders[o]) * counts[o]; i++) difference = fmax(difference, fabs((double)ours[i] - (double)theirs[i]));
        printf("%6d %16.2f %11.2f %15.2f %12.2g %35.2f\n", orders[o] - 1, 1e9 * best[0], 1e9 * best[1], best[1] / best[0], difference, 1e9 * best[2]);
        sphericart_spherical_harmonics_delete_f(peer);
    }
    return 0;
}
