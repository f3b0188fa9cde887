#!/bin/bash
# One rule about the sources: source.sh RULE [HEADER]. A line "note: ..." is shown beside a rule that holds.
set -u
rule=$1 header=${2:-}
CC=${CC:-cc} OUT=${OUT:-build/check/source}
headers=$(ls isogi_*.h)
mkdir -p "$OUT"
fail() { echo "$@"; exit 1; }

# CPU seconds of the quickest of eight tries, as on a core of 2.6 GHz, so that a busy or a slow machine does not count.
cpu_seconds() {
    local best=999 TIMEFORMAT='%U %S' t slower
    $CC -O2 -o "$OUT/clock" tests/compile/clock.c || return 1
    for _ in 1 2 3 4 5 6 7 8; do
        slower=$("$OUT/clock")
        t=$({ time "$@" 2> "$OUT/errors" > /dev/null; } 2>&1) || { cat "$OUT/errors"; return 1; }
        best=$(echo "$t $slower $("$OUT/clock")" | awk -v b=$best '{t = ($1 + $2) / (($3 + $4) / 2); print t < b ? t : b}')
        awk "BEGIN {exit !($best < $limit)}" && break
    done
    echo "$best"
}

case $rule in
shared-block) # the text that stands in two headers is the same text
    for h in isogi_sh.h isogi_vol.h; do
        sed -n '/^\/\* ---- shared block/,/^\/\* ---- end of shared block/p' $h > "$OUT/$h"
        [ "$(wc -l < "$OUT/$h")" -gt 10 ] || fail "$h: no shared block"
    done
    diff "$OUT/isogi_sh.h" "$OUT/isogi_vol.h"
    ;;
includes) # libc's few headers, the platform's threads, vector instructions; among themselves as the design says
    allowed='stddef|stdint|string|stdlib|math|float|pthread|unistd|sched|windows|immintrin|emmintrin|arm_neon'
    bad=$(grep -nE '^# *include *<' $headers | grep -vE "<($allowed)\.h>")
    own=$(grep -nE '^# *include *"' isogi_sh.h isogi_vol.h; grep -nE '^# *include *"' isogi_trace.h isogi_dvr.h | grep -vE '"isogi_(sh|vol)\.h"')
    [ -z "$bad$own" ] || fail "not allowed:
$bad$own"
    ;;
unfinished-words)
    words='\b(TO''DO|FIX''ME|X''XX|HA''CK)\b|not (yet )?impl''emented|for n''ow\b|place''holder|simpli''fied version'
    bad=$(grep -nIriE --include='*.[ch]' --include='*.sh' --include=Makefile --include='*.md' --include=run "$words" \
        isogi_*.h examples tests Makefile README.md .ci)
    [ -z "$bad" ] || fail "$bad"
    ;;
private-macros) # what the implementation defines for itself is gone after it
    for h in $headers; do
        sed -n 's/^ *# *define *\(ISOGI_[A-Z]*__[A-Za-z0-9_]*\).*/\1/p' $h | sort -u | while read -r macro; do
            grep -qE "^ *# *undef +$macro\b" $h || echo "$h: $macro is not undefined at the end"
        done
    done > "$OUT/left"
    [ ! -s "$OUT/left" ] || fail "$(cat "$OUT/left")"
    ;;
top-level)
    bad=$(git ls-files 2> /dev/null | cut -d/ -f1 | sort -u |
        grep -vxE 'isogi_(sh|vol|trace|dvr)\.h|examples|tests|Makefile|LICENSE|README\.md|\.ci|\.gitignore|\.clang-format')
    [ -z "$bad" ] || fail "not part of the layout: $bad"
    ;;
function-length) # reported, not refused: unrolled kernels and tables are long by nature
    long=$(for f in isogi_*.h examples/*.c examples/common/*.h tests/*.c tests/bench/*.c; do
        [ -f "$f" ] || continue
        awk -v f="$f" '/^[A-Za-z_].*\(/ {name = $0} /^[A-Za-z_].*\{$/ || /^\{/ {start = FNR}
            /^\}/ {if (start && FNR - start > 80) printf "%s:%d %d lines; ", f, start, FNR - start; start = 0}' "$f"
    done)
    [ -z "$long" ] || echo "note: over 80 lines: $long"
    ;;
symbols) # only isogi_ is exported, nothing can change behind a caller's back, nothing prints or ends the program
    command -v nm > /dev/null || fail "nm is missing"
    own=$(echo "${header}_IMPLEMENTATION" | tr a-z A-Z)
    $CC -std=c99 -O0 -fno-pic -I. -D"$own" -DHEADER="\"$header.h\"" -c tests/compile/one.c -o "$OUT/one.o" || exit 1
    bad=$(nm -g --defined-only "$OUT/one.o" | awk '{print $3}' | grep -v '^isogi_')
    [ -z "$bad" ] || fail "exported without the prefix: $bad"
    bad=$(nm "$OUT/one.o" | awk '$2 ~ /[bBdDC]/ {print $3}')
    [ -z "$bad" ] || fail "mutable statics: $bad"
    bad=$(nm -u "$OUT/one.o" | awk '{print $2}' | grep -xE '_*(v?f?printf|puts|putchar|fopen|fwrite|exit|abort|assert_fail|s?rand|time|clock|clock_gettime)(_chk)?')
    [ -z "$bad" ] || fail "must not be called: $bad"
    ;;
compile-time) # of the header's own implementation, and of its interface: 3 s and 0.1 s on an idle core. While other checks share the
              # core a compilation takes up to twice as long, in CPU seconds too.
    own=$(echo "${header}_IMPLEMENTATION" | tr a-z A-Z)
    limit=6
    whole=$(cpu_seconds $CC -std=c99 -O2 -I. -D"$own" -DHEADER="\"$header.h\"" -c tests/compile/one.c -o "$OUT/one.o") || fail "$whole"
    limit=0.2
    interface=$(cpu_seconds $CC -std=c99 -O2 -I. -DHEADER="\"$header.h\"" -c tests/compile/one.c -o "$OUT/one.o") || fail "$interface"
    awk "BEGIN {exit !($whole < 6)}" || fail "$whole s at -O2 beside other work: 3 s are allowed on an idle core"
    awk "BEGIN {exit !($interface < 0.2)}" || fail "interface: $interface s beside other work: 0.1 s are allowed on an idle core"
    echo "note: $whole s at -O2, interface $interface s"
    ;;
*) fail "no such rule: $rule" ;;
esac
