#!/bin/sh
# build/bake: boxes merged, and a bake that was stopped and resumed, are the same file as one bake; bad input is one line and status 1.
# With "quick" it is not stopped by signals, which takes seconds.
OUT=${OUT:-build/check/bake}
mkdir -p "$OUT"
rm -f "$OUT"/*.bake "$OUT"/*.tmp # or baking would go on there
set -e
scene="procedural:gyroid:20 --samples 4 --bounces 1 --threads 1"
build/bake $scene --out "$OUT/whole.bake" --raw "$OUT/whole.rgb" --format rgb9e5 > "$OUT/log"
build/bake $scene --box 0,0,0,20,20,9 --out "$OUT/a.bake"
build/bake $scene --box 0,0,9,20,20,20 --out "$OUT/b.bake"
build/bake $scene --merge "$OUT/a.bake" "$OUT/b.bake" --out "$OUT/merged.bake"
cmp "$OUT/whole.bake" "$OUT/merged.bake"
grep -q '^20x20x20 texels, scales 1 1 1$' "$OUT/log"
[ "$(wc -c < "$OUT/whole.rgb")" = 32000 ]
cp "$OUT/a.bake" "$OUT/resumed.bake"
build/bake $scene --out "$OUT/resumed.bake"
cmp "$OUT/whole.bake" "$OUT/resumed.bake"
# by feedback, too, where the boxes end within a cube of 64 texels; what holds other light is no part of it
by_feedback="$scene --feedback --lattice 100,9,9"
build/bake $by_feedback --out "$OUT/feedback.bake"
build/bake $by_feedback --box 0,0,0,30,9,9 --out "$OUT/c.bake"
build/bake $by_feedback --box 70,3,0,100,9,9 --out "$OUT/d.bake"
[ "$(wc -c < "$OUT/c.bake")" -lt "$(wc -c < "$OUT/feedback.bake")" ]
build/bake $by_feedback --merge "$OUT/d.bake" "$OUT/c.bake" --out "$OUT/joined.bake"
cmp "$OUT/feedback.bake" "$OUT/joined.bake"
build/bake $by_feedback --out "$OUT/d.bake"
cmp "$OUT/feedback.bake" "$OUT/d.bake"
build/bake $scene --lattice 100,9,9 --out "$OUT/paths.bake"
if cmp -s "$OUT/feedback.bake" "$OUT/paths.bake"; then echo "--feedback: the same as by paths"; exit 1; fi
# the surface at 0 alone is less than all, and just what lies within a hair of it
build/bake $scene --isovalues 0,0 --out "$OUT/zero.bake"
build/bake $scene --isovalues -1e-300,0 --out "$OUT/hair.bake"
cmp "$OUT/zero.bake" "$OUT/hair.bake"
[ "$(wc -c < "$OUT/zero.bake")" -lt "$(wc -c < "$OUT/whole.bake")" ]
if [ "$1" != quick ]; then
    # stopped by a signal, and killed: what was done is kept, and the same command goes on to the same bytes
    slow="procedural:gyroid:40 --samples 12 --threads 1"
    rm -f "$OUT/stopped.bake"
    build/bake $slow --out "$OUT/stopped.bake" 2> "$OUT/message" &
    job=$!
    sleep 0.3
    kill -TERM $job
    stopped=0
    wait $job || stopped=$?
    [ $stopped = 3 ] || { echo "SIGTERM: status $stopped"; cat "$OUT/message"; exit 1; }
    grep -q "the same command goes on" "$OUT/message"
    build/bake $slow --save-every 0 --out "$OUT/stopped.bake" &
    job=$!
    before=$(cksum < "$OUT/stopped.bake")
    for turn in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
        sleep 0.1
        [ "$(cksum < "$OUT/stopped.bake")" = "$before" ] || break
    done
    kill -KILL $job
    if wait $job; then echo "it was over before it could be killed"; exit 1; fi
    [ "$(cksum < "$OUT/stopped.bake")" != "$before" ] || { echo "not saved while it worked"; exit 1; }
    build/bake $slow --out "$OUT/stopped.bake"
    build/bake $slow --out "$OUT/at-once.bake"
    cmp "$OUT/stopped.bake" "$OUT/at-once.bake"
    if command -v script > /dev/null; then # on a terminal, a bar that only grows, with the time left
        script -qec "build/bake $slow --out $OUT/seen.bake" "$OUT/seen" > /dev/null
        tr '\r' '\n' < "$OUT/seen" | sed -n 's/^\[\(#*\)\.*\] *\([0-9]*\) %, [0-9]* s left .*/\2/p' > "$OUT/parts"
        [ "$(wc -l < "$OUT/parts")" -ge 3 ] || { echo "no progress seen"; exit 1; }
        sort -nc "$OUT/parts"
    fi
    rm -f "$OUT"/*.tmp
fi
build/bake --help | grep -q -- '--merge'
refused() {
    what=$1
    shift
    if build/bake "$@" 2> "$OUT/message" > /dev/null; then echo "not refused: $*"; exit 1; fi
    [ "$(wc -l < "$OUT/message")" = 1 ] && grep -q "^bake: .*$what" "$OUT/message" || { echo "bad message for $*:"; cat "$OUT/message"; exit 1; }
}
refused "no such volume" procedural:nothing --out "$OUT/x.bake"
refused "another texture" $scene --samples 5 --merge "$OUT/a.bake" --out "$OUT/x.bake"
refused "is damaged" $scene --merge "$OUT/whole.rgb" --out "$OUT/x.bake"
refused "box" $scene --box 1,2,3 --out "$OUT/x.bake"
refused "box" $scene --box 0.5,0,0,16,16,8.5 --out "$OUT/x.bake"
refused "box" $scene --box 0,0,0,0,0,0 --out "$OUT/x.bake"
refused "lattice" $scene --lattice 1.5,2,2 --out "$OUT/x.bake"
refused "whole number" procedural:gyroid:16.5 --out "$OUT/x.bake"
refused "transfer bakes for any light" $scene --mode transfer --light directional:1,1,1:1,1,1 --out "$OUT/x.bake"
refused "format" $scene --mode transfer --raw "$OUT/x.rgb" --format rgb9e5 --out "$OUT/x.bake"
refused "format" $scene --format byte --out "$OUT/x.bake"
refused "storage" $scene --mode transfer --storage rgb9e5 --out "$OUT/x.bake"
refused "/nowhere/x.rgb: cannot be written" $scene --raw /nowhere/x.rgb --out "$OUT/x.bake"
refused "is the file of --out" $scene --raw "$OUT/x.bake" --out "$OUT/x.bake"
refused "beyond the lattice" $scene --box 0,0,0,99,99,99 --out "$OUT/x.bake"
refused "needed" $scene
refused "no such option" $scene --out "$OUT/x.bake" --nothing
[ ! -e "$OUT/x.bake" ]
