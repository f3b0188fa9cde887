#!/bin/sh
# The shaders in the first comment of isogi_trace.h, each from its #version to the next empty line: compiled by glslangValidator, or run.
#
#     sh tests/compile/glsl.sh compile|run
OUT=${OUT:-build/check/glsl}
mkdir -p "$OUT"
awk -v out="$OUT" '/^       #version/ {n++; on = 1} /^$/ {on = 0} on {sub(/^       /, ""); print > (out "/" n ".frag")}' isogi_trace.h
[ -f "$OUT/2.frag" ] || { echo "two shaders expected"; exit 1; }
if [ "$1" = run ]; then
    sh tests/compile/shared.sh "${CC:-cc}" '-O2 -ffp-contract=off' tests/compile/glsl.c "$OUT/glsl" -lEGL -lm -lpthread || exit 1
    "$OUT/glsl" "$OUT/1.frag" "$OUT/2.frag" || [ $? = 77 ]
    exit
fi
for shader in "$OUT"/*.frag; do
    glslangValidator "$shader" || { cat "$shader"; exit 1; }
done
