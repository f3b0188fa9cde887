#!/bin/sh
# Links implementations and a user of theirs: link.sh together|apart|built "COMPILER OF THE IMPLEMENTATIONS" "COMPILER OF THE USER"
# together: ISOGI_IMPLEMENTATION in one file. apart: ISOGI_X_IMPLEMENTATION, each in a file of its own. built: the same, as make left them.
set -e
OUT=${OUT:-build/check/link}
mkdir -p "$OUT"
set -f
if [ "$1" = built ]; then
    for name in sh vol trace dvr; do cp build/isogi_$name.o "$OUT/$name.o"; done
elif [ "$1" = together ]; then
    $2 -I. -DISOGI_IMPLEMENTATION -c tests/compile/all.c -o "$OUT/all.o"
else
    for name in SH VOL TRACE DVR; do
        header=isogi_$(echo $name | tr A-Z a-z).h
        $2 -I. -DISOGI_${name}_IMPLEMENTATION -DHEADER="\"$header\"" -c tests/compile/one.c -o "$OUT/$name.o"
    done
fi
$3 $CFLAGS -I. -c tests/compile/user.c -o "$OUT/user.o"
set +f
case "$2 $3" in *++*) linker=$(echo "$2 $3" | tr ' ' '\n' | grep -F ++ | head -n 1) ;; *) linker=$3 ;; esac
$linker $CFLAGS -o "$OUT/linked" "$OUT"/*.o -lm -lpthread
"$OUT/linked"
