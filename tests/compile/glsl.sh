#!/bin/sh
# The shaders in the first comment of isogi_trace.h, each from its #version to the next empty line, compiled by glslangValidator.
OUT=${OUT:-build/check/glsl}
mkdir -p "$OUT"
awk -v out="$OUT" '/^       #version/ {n++; on = 1} /^$/ {on = 0} on {sub(/^       /, ""); print > (out "/" n ".frag")}' isogi_trace.h
[ -f "$OUT/2.frag" ] || { echo "two shaders expected"; exit 1; }
for shader in "$OUT"/*.frag; do
    glslangValidator "$shader" || { cat "$shader"; exit 1; }
done
