#!/bin/sh
# Compiles a test program with implementations that all test programs of one kind share, each compiled once, by whoever comes first.
# Those of headers that the test looks into, or sets up, it holds itself, as in the Makefile.
#
#     sh tests/compile/shared.sh COMPILER FLAGS SOURCE PROGRAM [LIBRARIES]
compiler=$1 flags=$2 source=$3 program=$4
shift 4
objects=build/check/objects-$({ cat isogi_*.h; echo "$compiler $flags"; } | cksum | cut -d' ' -f1)
mkdir -p "$objects"
shared=
# shellcheck disable=SC2086 # flags are words
needed=$($compiler -std=gnu99 $flags -I. -Iexamples/common -Itests -MM "$source") || exit 1
for h in vol sh trace dvr; do
    H=ISOGI_$(echo $h | tr a-z A-Z)
    case $needed in *isogi_$h.h*) ;; *) continue ;; esac
    grep -q "isogi_${h}__\|looks inside.*isogi_$h\|define ${H}_LEVEL" "$source" && continue
    (
        flock 9
        [ -f "$objects/$h.o" ] && exit 0
        # shellcheck disable=SC2086
        $compiler -std=gnu99 $flags -I. -DHEADER="\"isogi_$h.h\"" -D"${H}_IMPLEMENTATION" -c -o "$objects/$h.new" tests/compile/one.c &&
            mv "$objects/$h.new" "$objects/$h.o"
    ) 9> "$objects/$h.lock" || exit 1
    shared="$shared -D${H}_IMPLEMENTED $objects/$h.o"
done
# shellcheck disable=SC2086
$compiler -std=gnu99 $flags -I. -Iexamples/common -Itests -o "$program" "$source" $shared "$@"
