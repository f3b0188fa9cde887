#!/bin/sh
# bake_mpi on four ranks, on one, and bake: the same file, byte by byte; with errors in one line.
OUT=${OUT:-build/check/mpi}
mkdir -p "$OUT"
set -e
scene="procedural:engine-block:40 --samples 8 --bounces 2"
ranks() { n=$1; shift; mpirun --allow-run-as-root --oversubscribe -n "$n" build/bake_mpi "$@"; }
build/bake $scene --out "$OUT/one.bake"
ranks 4 $scene --out "$OUT/four.bake"
ranks 1 $scene --out "$OUT/alone.bake"
cmp "$OUT/one.bake" "$OUT/four.bake"
cmp "$OUT/one.bake" "$OUT/alone.bake"
ranks 2 $scene --mode transfer --both-sides --out "$OUT/transfer.bake"
build/bake $scene --mode transfer --both-sides --out "$OUT/transfer-one.bake"
cmp "$OUT/transfer.bake" "$OUT/transfer-one.bake"
if ranks 3 procedural:nothing --out "$OUT/none.bake" 2> "$OUT/message"; then echo "a volume that does not exist was baked"; exit 1; fi
grep -q "^bake_mpi: procedural:nothing: no such volume" "$OUT/message"
