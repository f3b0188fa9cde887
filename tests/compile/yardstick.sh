#!/bin/sh
# Prints C code whose compilation at -O2 takes gcc about YARDSTICK seconds (tests/compile/source.sh) on an idle core of 2.6 GHz. Other
# compilations are measured by it, for limits in seconds that hold on slow and on busy machines.
awk 'BEGIN {
    print "#include <math.h>"
    for (n = 0; n < 60; n++) {
        printf "static double kernel_%d(const double *a, double *b, int count) {\n    double sum = 0;\n    int i, j;\n", n
        printf "    for (i = 0; i < count; i++) {\n        double x = a[i] * %d.5, y = a[i + 1] - %d, z = x * y - b[i];\n", n, n + 1
        printf "        for (j = 0; j < 4; j++) {\n            if (x > y && z < %d) x = x * 0.5 + z, y = fabs(y - b[i + j]);\n", n
        printf "            else if (y > z) z = z * y + a[i + j], b[j] = x > 0 ? sqrt(x) : -x;\n            else x -= b[i] * %d, y += x * z;\n", n
        printf "        }\n        sum += x * y + z;\n        b[i] = sum;\n    }\n    return sum;\n}\n"
        printf "double user_%d(const double *a, double *b, int count) {\n", n
        printf "    return kernel_%d(a, b, 3) + kernel_%d(a + 1, b, 8) + kernel_%d(b, b + 4, count);\n}\n", n, n, n
    }
}'
