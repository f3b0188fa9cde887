#!/bin/bash
# One rule about the sources: source.sh RULE [HEADER]. A line "note: ..." is shown beside a rule that holds.
set -u
rule=$1 header=${2:-}
CC=${CC:-cc} OUT=${OUT:-build/check/source}
headers=$(ls isogi_*.h)
mkdir -p "$OUT"
fail() { echo "$@"; exit 1; }

# CPU seconds that a compilation would take on an idle core of 2.6 GHz: its time over that of the yardstick, compiled just before and just
# after, so that neither a slow nor a busy machine counts; the least of at most four tries.
YARDSTICK=0.9
cpu_seconds() {
    local best=999 t before after
    sh tests/compile/yardstick.sh > "$OUT/yardstick.c"
    before=$(seconds_of $CC -std=c99 -O2 -c "$OUT/yardstick.c" -o "$OUT/yardstick.o") || { echo "$before"; return 1; }
    for _ in 1 2 3 4; do
        t=$(seconds_of "$@") || { echo "$t"; return 1; }
        after=$(seconds_of $CC -std=c99 -O2 -c "$OUT/yardstick.c" -o "$OUT/yardstick.o")
        best=$(awk -v b=$best -v t="$t" -v r="$before $after" -v y=$YARDSTICK 'BEGIN {split(r, a); t *= 2 * y / (a[1] + a[2]); print t < b ? t : b}')
        awk "BEGIN {exit !($best < $limit)}" && break
        before=$after
    done
    echo "$best"
}
seconds_of() {
    local TIMEFORMAT='%U %S' t
    t=$({ time "$@" 2> "$OUT/errors" > /dev/null; } 2>&1) || { cat "$OUT/errors"; return 1; }
    echo "$t" | awk '{print $1 + $2}'
}

case $rule in
shared-block) # the text that stands in two headers is the same text
    for h in isogi_sh.h isogi_vol.h; do
        sed -n '/^\/\* ---- shared block/,/^\/\* ---- end of shared block/p' $h > "$OUT/$h"
        [ "$(wc -l < "$OUT/$h")" -gt 10 ] || fail "$h: no shared block"
    done
    diff "$OUT/isogi_sh.h" "$OUT/isogi_vol.h"
    ;;
includes) # libc's few headers, the platform's threads and huge pages, vector instructions; among themselves as the design says
    allowed='stddef|stdint|string|stdlib|math|float|pthread|unistd|sched|sys/mman|windows|immintrin|emmintrin|arm_neon'
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
        awk -v h=$h '$1 ~ /^#/ {sub(/^ *# */, "#"); split($2, name, "(")}
            $1 == "#define" && name[1] ~ /^ISOGI_[A-Z]*__/ {defined[name[1]] = 1}
            $1 == "#undef" {gone[$2] = 1}
            END {for (m in defined) if (!(m in gone)) print h ": " m " is not undefined at the end"}' $h
    done > "$OUT/left"
    [ ! -s "$OUT/left" ] || fail "$(cat "$OUT/left")"
    ;;
top-level)
    bad=$(git ls-files 2> /dev/null | cut -d/ -f1 | sort -u |
        grep -vxE 'isogi_(sh|vol|trace|dvr)\.h|examples|tests|Makefile|LICENSE|README\.md|\.ci|\.gitignore|\.clang-format')
    [ -z "$bad" ] || fail "not part of the layout: $bad"
    ;;
line-length) # of C, in characters
    bad=$(for f in isogi_*.h examples/*.c examples/common/*.h tests/*.[ch] tests/*/*.[ch]; do
        [ ! -f "$f" ] || awk -v f="$f" 'length > 140 {print f ":" FNR ": " length " columns, at most 140"}' "$f"
    done)
    [ -z "$bad" ] || fail "$bad"
    ;;
function-length) # reported, not refused: unrolled kernels and tables are long by nature
    long=$(for f in isogi_*.h examples/*.c examples/common/*.h tests/*.c tests/bench/*.c; do
        [ -f "$f" ] || continue
        awk -v f="$f" '/^[A-Za-z_].*\(/ {name = $0} /^[A-Za-z_].*\{$/ || /^\{/ {start = FNR}
            /^\}/ {if (start && FNR - start > 80) printf "%s:%d %d lines; ", f, start, FNR - start; start = 0}' "$f"
    done)
    [ -z "$long" ] || echo "note: over 80 lines: $long"
    ;;
symbols) # only isogi_ is exported, nothing can change behind a caller's back, nothing prints or ends the program; of the object that make left
    command -v nm > /dev/null || fail "nm is missing"
    object=build/$header.o
    [ -f "$object" ] || fail "$object is missing"
    bad=$(nm -g --defined-only "$object" | awk '{print $3}' | grep -v '^isogi_')
    [ -z "$bad" ] || fail "exported without the prefix: $bad"
    # by section: constants that hold addresses are in .data.rel.ro where code may be moved
    bad=$(nm -f sysv "$object" | awk -F'|' '$7 ~ /^(\.[lst]?(data|bss)|COM|\*COM\*)/ && $7 !~ /^\.data\.rel\.ro/ {print $1}')
    [ -z "$bad" ] || fail "mutable statics: $bad"
    bad=$(nm -u "$object" | awk '{print $2}' | grep -xE '_*(v?f?printf|puts|putchar|fopen|fwrite|exit|abort|assert_fail|s?rand|time|clock|clock_gettime)(_chk)?')
    [ -z "$bad" ] || fail "must not be called: $bad"
    ;;
compile-time) # of the header's own implementation, and of its interface. The rule is 3 s and 0.1 s; the implementations do not all keep it
              # yet, so this only keeps them from growing.
    own=$(echo "${header}_IMPLEMENTATION" | tr a-z A-Z)
    most=13 limit=$most # isogi_vol.h takes 7 to 9.8; machines, and how busy they are, differ by that
    whole=$(cpu_seconds $CC -std=c99 -O2 -I. -D"$own" -DHEADER="\"$header.h\"" -c tests/compile/one.c -o "$OUT/one.o") || fail "$whole"
    limit=0.1
    interface=$(cpu_seconds $CC -std=c99 -O2 -I. -DHEADER="\"$header.h\"" -c tests/compile/one.c -o "$OUT/one.o") || fail "$interface"
    awk "BEGIN {exit !($whole < $most)}" || fail "$whole s at -O2: more than $most s, and 3 s is the rule"
    awk "BEGIN {exit !($interface < 0.1)}" || fail "interface: $interface s: 0.1 s is the rule"
    echo "note: $whole s at -O2, interface $interface s"
    ;;
*) fail "no such rule: $rule" ;;
esac
