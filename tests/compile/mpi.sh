#!/bin/sh
# bake_mpi on four ranks, on one, and bake: the same file, byte by byte; with errors in one line.
OUT=${OUT:-build/check/mpi}
mkdir -p "$OUT"
rm -f "$OUT"/*.bake "$OUT"/*.tmp # or baking would go on there
set -e
scene="procedural:engine-block:40 --samples 8 --bounces 2"
ranks() { n=$1; shift; mpirun --allow-run-as-root --oversubscribe -n "$n" build/bake_mpi "$@"; }
build/bake $scene --out "$OUT/one.bake"
ranks 4 $scene --out "$OUT/four.bake"
ranks 1 $scene --out "$OUT/alone.bake"
cmp "$OUT/one.bake" "$OUT/four.bake"
cmp "$OUT/one.bake" "$OUT/alone.bake"
# by feedback, in bricks of its own; and it goes on with a part
by_feedback="$scene --feedback --lattice 150,20,70"
build/bake $by_feedback --out "$OUT/feedback.bake"
ranks 3 $by_feedback --out "$OUT/feedback-three.bake"
ranks 1 $by_feedback --out "$OUT/feedback-alone.bake"
cmp "$OUT/feedback.bake" "$OUT/feedback-three.bake"
cmp "$OUT/feedback.bake" "$OUT/feedback-alone.bake"
build/bake $by_feedback --box 60,5,0,70,9,69 --out "$OUT/feedback-part.bake"
[ "$(wc -c < "$OUT/feedback-part.bake")" -lt "$(wc -c < "$OUT/feedback.bake")" ]
ranks 2 $by_feedback --out "$OUT/feedback-part.bake"
cmp "$OUT/feedback.bake" "$OUT/feedback-part.bake"
# it goes on where a file stops, of either program and however its box lies, and where it was killed
build/bake $scene --box 3,0,0,40,40,17 --out "$OUT/part.bake"
ranks 3 $scene --out "$OUT/part.bake"
cmp "$OUT/one.bake" "$OUT/part.bake"
ranks 3 $scene --out "$OUT/part.bake"
cmp "$OUT/one.bake" "$OUT/part.bake"
slow="procedural:engine-block:40 --samples 256 --bounces 2" # seconds: it must not be over when it is killed
rm -f "$OUT/killed.bake"
setsid mpirun --allow-run-as-root --oversubscribe -n 3 build/bake_mpi $slow --save-every 0 --out "$OUT/killed.bake" > "$OUT/message" 2>&1 &
job=$!
for turn in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30; do
    [ -e "$OUT/killed.bake" ] && break
    sleep 0.1
done
kill -TERM $job
if wait $job; then echo "it was over before it could be killed"; exit 1; fi
[ -s "$OUT/killed.bake" ] || { echo "not saved while it worked"; exit 1; }
build/bake $slow --out "$OUT/slow.bake" 2> "$OUT/message"
[ "$(wc -c < "$OUT/killed.bake")" -lt "$(wc -c < "$OUT/slow.bake")" ]
ranks 3 $slow --out "$OUT/killed.bake" 2> "$OUT/message"
cmp "$OUT/killed.bake" "$OUT/slow.bake"
rm -f "$OUT"/*.tmp
if ranks 2 $scene --samples 9 --out "$OUT/one.bake" 2> "$OUT/message"; then echo "another texture was taken"; exit 1; fi
grep -q "holds another texture" "$OUT/message"
ranks 2 $scene --mode transfer --both-sides --out "$OUT/transfer.bake"
build/bake $scene --mode transfer --both-sides --out "$OUT/transfer-one.bake"
cmp "$OUT/transfer.bake" "$OUT/transfer-one.bake"
if ranks 3 procedural:nothing --out "$OUT/none.bake" 2> "$OUT/message"; then echo "a volume that does not exist was baked"; exit 1; fi
grep -q "^bake_mpi: procedural:nothing: no such volume" "$OUT/message"
