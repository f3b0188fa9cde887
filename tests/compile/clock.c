/* Prints how many times slower this processor runs just now than one of 2.6 GHz, for limits that are stated for that: a chain of
   dependent products takes four cycles a link wherever it runs. */
#include <stdint.h>
#include <stdio.h>
#include <time.h>

int main(void) {
    enum { LINKS = 10000000 };
    uint64_t x = (uint64_t)time(NULL);
    clock_t begun = clock();
    for (int i = 0; i < LINKS; i++) x = x * 6364136223846793005u + 1442695040888963407u;
    double seconds = (double)(clock() - begun) / CLOCKS_PER_SEC, expected = 4.0 * LINKS / 2.6e9;
    printf("%.3f\n", seconds > expected && x ? seconds / expected : 1.0);
    return 0;
}
