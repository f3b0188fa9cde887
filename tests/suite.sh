#!/bin/sh
# Lists the items of the quick or of the long suite, one per line, for tests/run.sh: the quick one's longest first, so that none is left
# alone at the end; the long one's cheap ones first, and what finds most before what finds less.
#
#     sh tests/suite.sh quick|long TEST_PROGRAMS...

suite=$1
shift
CC=${CC:-cc} CXX=${CXX:-c++}
tab=$(printf '\t')

item() { printf '%s\t%s\t%s\n' "$1" "$2" "$3"; }
have() { command -v "${1%% *}" > /dev/null 2>&1; }

WARN='-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Werror'
WARN_C="$WARN -Wstrict-prototypes"
ALL='isogi_sh isogi_vol isogi_trace isogi_dvr'
headers=
for h in $ALL; do [ -f $h.h ] && headers="$headers $h"; done

# ---- what the sources look like ------------------------------------------------------------------------------------------

sources() {
    for rule in shared-block includes unfinished-words private-macros top-level line-length function-length; do
        item check "source/$rule" "bash tests/compile/source.sh $rule"
    done
    for h in $headers; do
        item check "source/symbols-$h" "bash tests/compile/source.sh symbols $h"
        [ $suite = quick ] || item check "source/compile-time-$h" "bash tests/compile/source.sh compile-time $h"
    done
}

# ---- the compile matrix ---------------------------------------------------------------------------------------------------

# One header, or all, with one compiler as one language: NAME COMPILER FLAGS.
# "one.c" includes HEADER; "all.c" every header; "late.c" includes for the interface first, for the implementation later.
compile() {
    name=$1 compiler=$2 flags=$3 file=$4
    case $flags in
    *-fsyntax-only*) output= ;;
    *) output=' -c -o "$OUT/object"' ;;
    esac
    item check "compile/$name" "$compiler $flags -I. tests/compile/$file$output"
}

c_flags() { echo "-std=$1 $WARN_C"; }
cxx_flags() { echo "-x c++ -std=$1 $WARN"; }

# The least: this compiler, strict C99 and C++11, interfaces alone, everything with its implementation in C++. What make has compiled
# already, as strict C99, is not compiled again.
matrix_quick() {
    for h in $headers; do
        compile "c99-interface-$h" "$CC" "$(c_flags c99) -fsyntax-only -DHEADER='\"$h.h\"'" one.c
        item check "compile/c99-$h" "[ -f build/$h.o ] && [ ! -s build/$h.o.said ]"
    done
    if have "$CXX"; then compile c++11-all "$CXX" "$(cxx_flags c++11) -fsyntax-only -DISOGI_IMPLEMENTATION" all.c
    else
        compile c99-all "$CC" "$(c_flags c99) -fsyntax-only -DISOGI_IMPLEMENTATION" all.c
        item skip compile/c++11-all "$CXX is not installed"
    fi
    item check link/implementations-apart "sh tests/compile/link.sh built '$CC' '$CC'"
    if have "$CXX"; then item check link/used-from-c++ "sh tests/compile/link.sh built '$CC' '$CXX -x c++ -std=c++11'"
    else item skip link/used-from-c++ "$CXX is not installed"
    fi
}

# Several translation units and a user of theirs: all implementations in one, in C++ each in its own; in C the quick suite has that.
link_items() {
    cc=$1 cxx=$2 prefix=$3
    item check "link/${prefix}one-implementation" "sh tests/compile/link.sh together '$cc' '$cc'"
    if have "$cxx"; then item check "link/${prefix}implemented-in-c++" "sh tests/compile/link.sh apart '$cxx -x c++ -std=c++11' '$cc'"
    else item skip "link/${prefix}c++" "$cxx is not installed"
    fi
}

# What gcc warns of goes with what it optimises, what clang warns of does not. At -O2, header by header, make has compiled all.
matrix() {
    for pair in gcc:g++ clang:clang++; do
        cc=${pair%:*} cxx=${pair#*:}
        level=-O2
        [ $cc = gcc ] || level=-O0
        if ! have $cc; then
            item skip "compile/$cc" "$cc is not installed"
            continue
        fi
        for h in $headers; do
            compile "$cc-c99-interface-$h" $cc "$(c_flags c99) -fsyntax-only -DHEADER='\"$h.h\"'" one.c
            compile "$cc-c99-$h" $cc "$(c_flags c99) -fsyntax-only -DISOGI_IMPLEMENTATION -DHEADER='\"$h.h\"'" one.c
        done
        for std in c99 c11 c17; do
            compile "$cc-$std-all" $cc "$(c_flags $std) -fsyntax-only -DISOGI_IMPLEMENTATION" all.c
            compile "$cc-$std-late" $cc "$(c_flags $std) -fsyntax-only" late.c
        done
        for option in $([ $cc = clang ] || echo -O0 -Os -Ofast); do # clang warns of the same at any level
            compile "$cc-c99-all$option" $cc "$(c_flags c99) $option -DISOGI_IMPLEMENTATION" all.c
        done
        for option in -DISOGI_NO_SIMD -march=x86-64-v3; do
            [ $option != -march=x86-64-v3 ] || [ "$(uname -m)" = x86_64 ] || continue
            compile "$cc-c99-all$option" $cc "$(c_flags c99) $option $level -DISOGI_IMPLEMENTATION" all.c
        done
        [ $cc = gcc ] || compile "$cc-c99-all-ffast-math" $cc "$(c_flags c99) -ffast-math -fsyntax-only -DISOGI_IMPLEMENTATION" all.c
        compile "$cc-c99-all-DISOGI_NO_THREADS" $cc "$(c_flags c99) -O0 -DISOGI_NO_THREADS -DISOGI_IMPLEMENTATION" all.c
        if ! have $cxx; then
            item skip "compile/$cxx" "$cxx is not installed"
            continue
        fi
        for h in $headers; do
            compile "$cxx-c++11-interface-$h" $cxx "$(cxx_flags c++11) -Wold-style-cast -fsyntax-only -DHEADER='\"$h.h\"'" one.c
            compile "$cxx-c++11-$h" $cxx "$(cxx_flags c++11) -fsyntax-only -DISOGI_IMPLEMENTATION -DHEADER='\"$h.h\"'" one.c
        done
        for std in c++11 c++14 c++17 c++20; do
            compile "$cxx-$std-all" $cxx "$(cxx_flags $std) -fsyntax-only -DISOGI_IMPLEMENTATION" all.c
            compile "$cxx-$std-late" $cxx "$(cxx_flags $std) -fsyntax-only" late.c
        done
        compile "$cxx-c++11-all$level" $cxx "$(cxx_flags c++11) $level -DISOGI_IMPLEMENTATION" all.c
        compile "$cxx-c++11-all-DISOGI_NO_THREADS" $cxx "$(cxx_flags c++11) -fsyntax-only -DISOGI_NO_THREADS -DISOGI_IMPLEMENTATION" all.c
        link_items $cc $cxx "$cc-"
    done
    # The newest clang that is installed, which may know other built-in functions than the one that is called so.
    newest=$(ls /usr/bin/clang-[0-9] /usr/bin/clang-[0-9][0-9] 2> /dev/null | sort -V | tail -1)
    older=$(clang -dumpversion 2> /dev/null || echo 0)
    if [ -n "$newest" ] && [ "$(printf '%s\n' "$older" "$($newest -dumpversion)" | sort -V | tail -1)" != "$older" ]; then
        newest=${newest##*/}
        compile "$newest-c99-all" $newest "$(c_flags c99) -O0 -DISOGI_IMPLEMENTATION" all.c
        compile "$newest-c++17-all" $newest "$(cxx_flags c++17) -O0 -DISOGI_IMPLEMENTATION" all.c
        for test in test_sh test_vol_work test_trace_light; do
            item suite "$newest/$test" "$newest -std=gnu99 -O1 -ffp-contract=off -I. -Iexamples/common -Itests tests/$test.c -o \"\$OUT/$test\" -lm -lpthread && \"\$OUT/$test\""
        done
    else item skip compile/newest-clang "no clang-N is newer than clang itself"
    fi
    if have tcc; then
        compile tcc-all tcc "-std=c99 -Wall -Werror -DISOGI_IMPLEMENTATION" all.c
    else item skip compile/tcc-all "tcc is not installed"
    fi
    if echo 'int main(void) { return 0; }' | gcc -m32 -x c - -o /dev/null 2> /dev/null; then
        compile gcc-m32-all gcc "$(c_flags c99) -m32 -O2 -DISOGI_IMPLEMENTATION" all.c
    else item skip compile/gcc-m32-all "gcc -m32 has no libraries"
    fi
    if have x86_64-w64-mingw32-gcc; then
        compile mingw-all x86_64-w64-mingw32-gcc "$(c_flags c99) -O2 -DISOGI_IMPLEMENTATION" all.c
    else item skip compile/mingw-all "MinGW is not installed"
    fi
}

# ---- the test programs built in other ways --------------------------------------------------------------------------------

# NAME COMPILER FLAGS PREFIX PROGRAM...: PREFIX runs what was built
variant() {
    name=$1 compiler=$2 flags=$3 prefix=$4
    shift 4
    for program; do
        base=${program##*/} source=tests/${program##*/}.c
        libs=$(sed -n '1,20s|.*LIBS: \([^*]*\).*|\1|p' "$source")
        item suite "$name/$base" "sh tests/compile/shared.sh '$compiler' '$flags' $source \"\$OUT/$base\" -lm -lpthread $libs && $prefix \"\$OUT/$base\""
    done
}

CONTRACT_OFF=-ffp-contract=off

# COMPILER PROGRAM...: linked without -ffast-math, which would flush the denormal numbers of the whole process to zero: the tests use some.
fast_math() {
    compiler=$1
    shift
    for program; do
        base=${program##*/} source=tests/${program##*/}.c
        libs=$(sed -n '1,20s|.*LIBS: \([^*]*\).*|\1|p' "$source")
        item suite "fast-math-${compiler%% *}/$base" "$compiler -std=gnu99 -O2 -ffast-math -I. -Iexamples/common -Itests -c -o \"\$OUT/object.o\" $source && $compiler -o \"\$OUT/$base\" \"\$OUT/object.o\" -lm -lpthread $libs && \"\$OUT/$base\""
    done
}

only() { printf '%s\n' $units | grep -E "test_($1)\$"; }

variants() {
    threaded='vol|mesh|trace_bake|dvr_visibility'
    checked='sh|sh_limits|sample|vol|vol_api|vol_sides|vol_holes|vol_update|vol_field|mesh|trace|trace_bake|trace_light|trace_store|trace_inside|trace_change|dvr|dvr_data|dvr_inside|dvr_tets|dvr_transfer|dvr_visibility|dvr_bound|dvr_hard|dvr_closed|dvr_edits|dvr_medium'
    # Those that only start other programs have nothing to be built anew.
    units=
    for program; do
        case $program in *test_docs | *test_viewer | *test_examples) ;; *) units="$units $program" ;; esac
    done
    # A variant runs what it can change: the address sanitizer most of them, the others those that stand for their kind. What finds most
    # comes first, since the last items may find no time left.
    sanitizer=clang casts=,float-cast-overflow
    have clang || { sanitizer=$CC casts=; }
    variant address+undefined "$sanitizer" "-O1 -g $CONTRACT_OFF -fsanitize=address,undefined$casts -fno-sanitize-recover=all" '' $(only "$checked")
    variant thread "$sanitizer" "-O1 -g $CONTRACT_OFF -fsanitize=thread" 'TSAN_OPTIONS=halt_on_error=1' $(only "$threaded")
    variant O0 "$CC" "-O0 $CONTRACT_OFF" '' $(only 'sh|sh_limits|stack')
    variant O3 "$CC" "-O3 $CONTRACT_OFF" '' $(only 'sh|vol|vol_update|trace_inside|dvr|dvr_inside|dvr_data')
    fast_math "$CC" $(only 'sh|sh_limits|sample|vol|vol_sides|vol_holes|trace|dvr|dvr_visibility|dvr_bound|dvr_hard|dvr_classes')
    # With products and sums joined as a user's compiler may, all paths still build the same pyramid.
    if grep -qsw fma /proc/cpuinfo; then
        item suite contracted/test_vol_update "$CC -std=gnu99 -O2 -march=x86-64-v3 -I. -Iexamples/common -Itests -o \"\$OUT/test\" tests/test_vol_update.c -lm -lpthread && \"\$OUT/test\" --long"
    fi
    variant no-threads "$CC" "-O2 $CONTRACT_OFF -DISOGI_NO_THREADS" '' $(only 'vol|trace')
    variant no-simd "$CC" "-O2 $CONTRACT_OFF -DISOGI_NO_SIMD" '' $(only 'sh|sample|vol|dvr')
    # As processors with registers longer than double do.
    [ "$(uname -m)" != x86_64 ] || variant x87 "$CC" "-O2 -mfpmath=387 -DISOGI_NO_SIMD" '' $(only 'vol|vol_sides')
    variant sh-level-0 "$CC" "-O2 $CONTRACT_OFF -DISOGI_SH_LEVEL=0" '' $(only sh)
    variant sh-level-1 "$CC" "-O2 $CONTRACT_OFF -DISOGI_SH_LEVEL=1" '' $(only sh)
    if have clang; then
        variant clang clang "-O2 $CONTRACT_OFF" '' $(only 'sh|sample|vol|mesh|trace|dvr|stack')
        fast_math clang $(only 'sh|sh_limits|vol_hard')
    else item skip clang "clang is not installed"
    fi
}

# Other processors, emulated, one of them big-endian: the two headers that all others stand on, since emulation is ten times slower;
# rays on one of them only.
emulators() {
    for machine in aarch64 s390x riscv64; do
        if have $machine-linux-gnu-gcc && have qemu-$machine-static; then
            some='sh|sample'
            [ $machine = aarch64 ] && some='sh|sample|vol|vol_sides|vol_holes|vol_work'
            variant $machine $machine-linux-gnu-gcc "-O2 $CONTRACT_OFF -static" "qemu-$machine-static" $(printf '%s\n' "$@" | grep -E "test_($some)\$")
        else item skip "$machine" "$machine-linux-gnu-gcc or qemu-$machine-static is not installed"
        fi
    done
    # What a bake saves is the same bytes where the bytes of numbers are the other way round.
    if have s390x-linux-gnu-gcc && have qemu-s390x-static; then
        item suite s390x/test_trace_store "s390x-linux-gnu-gcc -std=gnu99 -O1 $CONTRACT_OFF -static -I. -Iexamples/common -Itests -o \"\$OUT/store\" tests/test_trace_store.c -lm -lpthread && qemu-s390x-static \"\$OUT/store\" same_bytes"
    fi
}

memcheck() {
    if ! have valgrind; then
        item skip valgrind "valgrind is not installed"
        return
    fi
    grind='valgrind -q --error-exitcode=9 --leak-check=full --errors-for-leak-kinds=all'
    for source in examples/*.c; do
        base=$(basename "$source" .c)
        case $base in viewer | bake | bake_mpi | bake_points | gather_field | isolines | strip | tets) continue ;; esac # below, in tests of their own, they want arguments, or they take minutes
        item check "valgrind/$base" "$grind build/$base > /dev/null"
    done
    [ -f examples/viewer.c ] && for mode in "irradiance --samples 2" "transfer --samples 2" "dvr --directions 32" scale-invariant; do
        item check "valgrind/viewer-${mode%% *}" "$grind build/viewer procedural:engine-block:24 --size 32x32 --mode $mode --out \"\$OUT/x.png\""
    done
}

fuzzers() {
    for source in tests/fuzz/fuzz_*.c; do
        [ -f "$source" ] || continue
        base=$(basename "$source" .c)
        if have clang; then
            # -O0: at -O1 the headers take many minutes to compile with these. A third as many runs a second.
            item check "fuzz/$base" "clang -std=gnu99 -O0 -g -fsanitize=fuzzer,address,undefined -I. -Iexamples/common -Itests -o \"\$OUT/$base\" $source -lm -lpthread && mkdir \"\$OUT/corpus\" && seeds=\$PWD/tests/golden && (cd \"\$OUT\" && ./$base -max_total_time=60 -rss_limit_mb=4096 corpus \"\$seeds\")"
        else item skip "fuzz/$base" "clang is not installed"
        fi
    done
}

analysers() {
    if have cppcheck; then
        for h in $headers; do
            item check "cppcheck/$h" "cppcheck --quiet --error-exitcode=1 --enable=warning,portability --inline-suppr --suppress=unmatchedSuppression --suppress=pointerSize --suppress=ctuuninitvar -DISOGI_IMPLEMENTATION --language=c --std=c99 -I. $h.h"
        done
    else item skip cppcheck "cppcheck is not installed"
    fi
}

case $suite in
quick)
    first=' trace_bake viewer trace_light vol_many trace sh mesh vol_hard trace_store trace_change '
    for name in $first; do
        for program; do [ "${program##*/}" != test_$name ] || item live test_$name "$program --quick"; done
    done
    matrix_quick
    for program; do
        case $first in *" ${program##*/test_} "*) ;; *) item live "${program##*/}" "$program --quick" ;; esac
    done
    sources
    item check bake/parts-and-pauses "sh tests/compile/bake.sh quick"
    ;;
long)
    sources
    matrix
    for program; do
        case $program in
        */test_sh) # holds the header here, and goes through every instruction level
            item live test_sh "sh tests/compile/shared.sh '$CC' '-O1 $CONTRACT_OFF' tests/test_sh.c \"\$OUT/test_sh\" -lm -lpthread && \"\$OUT/test_sh\" --long" ;;
        *) item live "${program##*/}" "$program --long" ;;
        esac
    done
    item check bake/parts-and-pauses "sh tests/compile/bake.sh"
    memcheck
    fuzzers
    item check figures/all "ISOGI_DATA= FIGURES_OUT=\"\$OUT\" FIGURES_DIVIDE=64 FIGURES_SIZE=48x48 sh examples/figures.sh && sh tests/compile/page.sh \"\$OUT\""
    item check figures/pictures "PICTURES_OUT=\"\$OUT\" PICTURES_DIVIDE=16 sh examples/pictures.sh"
    item check figures/scale-invariant "ISOGI_DATA= SIDE=48 FIGURES_PAGE=\"\$OUT/index.html\" sh examples/figures_scale_invariant.sh \"\$OUT\" && sh tests/compile/page.sh \"\$OUT\""
    item check figures/visibility "ISOGI_DATA= SIDE=48 FIGURES_PAGE=\"\$OUT/index.html\" sh examples/figures_visibility.sh \"\$OUT\" && sh tests/compile/page.sh \"\$OUT\""
    if have glslangValidator; then item check glsl/compiled "sh tests/compile/glsl.sh compile"
    else item skip glsl/compiled "glslangValidator is not installed"
    fi
    if printf '#include <EGL/egl.h>\n#include <GL/glcorearb.h>\n' | $CC -E - > /dev/null 2>&1; then
        item check glsl/run "sh tests/compile/glsl.sh run"
    else item skip glsl/run "<EGL/egl.h> and <GL/glcorearb.h> are not installed"
    fi
    if have mpirun && have mpicc; then item check mpi/same-bits "sh tests/compile/mpi.sh"
    else item skip mpi/same-bits "mpicc and mpirun are not installed"
    fi
    item check bench/tables "sh tests/bench/contract.sh sh vol"
    item check bench/dry-tables "sh tests/bench/contract.sh --dry trace dvr visibility" # in full they take too long beside other work
    analysers
    variants "$@"
    emulators "$@"
    ;;
*)
    echo "usage: sh tests/suite.sh quick|long TEST_PROGRAMS..." >&2
    exit 2
    ;;
esac
