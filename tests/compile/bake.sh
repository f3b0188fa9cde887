#!/bin/sh
# build/bake: boxes merged, and a bake that was stopped and resumed, are the same file as one bake; bad input is one line and status 1.
OUT=${OUT:-build/check/bake}
mkdir -p "$OUT"
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
build/bake --help | grep -q -- '--merge'
refused() {
    what=$1
    shift
    if build/bake "$@" 2> "$OUT/message" > /dev/null; then echo "not refused: $*"; exit 1; fi
    [ "$(wc -l < "$OUT/message")" = 1 ] && grep -q "^bake: .*$what" "$OUT/message" || { echo "bad message for $*:"; cat "$OUT/message"; exit 1; }
}
refused "no such volume" procedural:nothing --out "$OUT/x.bake"
refused "another texture" $scene --samples 5 --merge "$OUT/a.bake" --out "$OUT/x.bake"
refused "corrupt" $scene --merge "$OUT/whole.rgb" --out "$OUT/x.bake"
refused "box" $scene --box 1,2,3 --out "$OUT/x.bake"
refused "invalid" $scene --box 0,0,0,99,99,99 --out "$OUT/x.bake"
refused "needed" $scene
refused "no such option" $scene --out "$OUT/x.bake" --nothing
[ ! -e "$OUT/x.bake" ]
