#!/bin/sh
# Benchmarks write the table that is promised: the eight columns, finite positive numbers, for each case one row of the default, every case
# that is asked for, and every one that has a goal. contract.sh [--dry] [sh|vol|trace|dvr|visibility]...; cases of real volumes are wanted
# where ISOGI_DATA holds them. --dry, of trace and dvr: tiny stand-ins for all scenes, with the cases of the full benchmark; seconds instead
# of minutes; of visibility what --quick has.
set -e
dry=
[ "$1" != --dry ] || { dry=1; shift; }
[ $# -gt 0 ] || set -- sh vol trace dvr

# CASE, or CASE:METHOD (_ for a blank in it), or either with *N: N rows at least
wanted() {
    case $1 in
    sh) echo eval-aos-f32-L4 eval-aos-f32-L10 eval-aos-f32-L20 eval-soa-f32-L4 eval-soa-f32-L10 eval-soa-f32-L20 eval-aos-f64-L4 \
        eval-aos-f64-L10 rotate-once-n3 rotate-once-n4 rotate-once-n5 rotate-once-n8 rotate-once-n16 rotate-build-n8 rotate-build-n16 \
        rotate-apply-n5 product-n5 product-batch-n5 product-batch-n3 product-batch-n8 zonal-n5 sum-n5 project-equirect-n5 \
        project-equirect-n4 project-equirect-n8 \
        light-directional light-disc light-point light-sphere light-rectangle ;;
    vol) for field in ml256 gyroid256; do
            for rays in primary1 primary16 surface anyhit bundle64; do echo $rays-$field; done
         done
         echo pyramid-256 trilinear-along-rays trilinear-alone tricubic-along-rays tricubic-random mesh-gyroid256 mesh-normals-gyroid256 ;;
    trace) for scene in engine-block $(have engine_256x256x128_uint8.raw engine) ${dry:+bonsai cthead}; do
            echo speedup-$scene speedup-$scene:naive filter-$scene filter-$scene:filter-off rays-$scene threads-$scene lazy-$scene \
                lazy-converged-$scene "$scene*5"
           done
           [ -z "$dry" ] || echo full-engine-block table1-engine-block 'table1-engine-block:irradiance*8' 'table1-engine-block:transfer*8' \
               'table1-engine-block:path-traced_picture*4' table2-engine-block table2-engine-block:transfer table2-engine-block:lambert \
               table2-engine-block:lambert_shadowed table2-engine-block:phong_shadowed lattice-engine-block \
               'lattice-engine-block:hierarchy*2' lattice-cavity figure5-ball-points-macroscopic figure5-ball-points-microscopic \
               figure5-ball-texture-macroscopic figure5-ball-texture-microscopic figure5-hollow-points-macroscopic \
               figure5-hollow-points-microscopic figure5-hollow-texture-macroscopic figure5-hollow-texture-microscopic ;;
    dvr) for field in ml256 gyroid256; do echo frame-$field "frame-$field:steps*2"; done
         for field in ml gyroid; do
            echo frame-physical-unlit-$field frame-physical-lit-$field "frame-physical-lit-$field:steps*3" visibility-$field
         done
         echo frame-scale-invariant-gyroid256 'frame-scale-invariant-gyroid256:pre-integrated*2' \
             'frame-scale-invariant-gyroid256:post-classified*2' tet-pieces-data:table-2d tet-pieces-physical:table-3d
         for volume in engine_256x256x128 bonsai_256x256x256 fuel_64x64x64; do
            scene=${volume%%_*}
            have ${volume}_uint8.raw tf-update-$scene tf-update-$scene:paper "tf-update-$scene:sweep*4" "tf-edit-$scene*3"
            [ $scene = fuel ] || have ${volume}_uint8.raw frame-$scene "frame-$scene:steps*2"
         done ;;
    visibility) scene=torus-sphere-plane
        for error in rmse seen; do
            echo "rays-$scene-$error:sweep*2" "rays-$scene-$error:paper*3" "coefficients-$scene-$error:sweep*3" \
                "reduction-$scene-$error:paper*3" "radius-$scene-$error:paper*3" "grid-$scene-$error:sweep" "grid-$scene-$error:brute*2" \
                "coefficients-$scene-$error:truncation*4" "shading-$scene-$error:diffuse" "shading-$scene-$error:paper-local" \
                "shading-$scene-$error:unlit"
        done
        echo "frames-$scene" "frames-$scene:directional*3" "frames-$scene:point*4" ;;
    esac
}
have() { [ -z "$dry" ] || { shift; echo "$@"; return; }
    [ -z "$ISOGI_DATA" ] || [ ! -f "$ISOGI_DATA/$1" ] || { shift; echo "$@"; }; }

# Cases that have a goal, by which the table at the end is looked up; all scenes are there in a dry run, and with vol.
goals() {
    [ "$dry" ] || [ "$1" = vol ] || return 0
    sed -n '/^static const goal goals/,/};/s/.*{"\([^"]*\)", .*/\1/p' tests/bench/bench_$1.c | grep -v '^full-'
}

lines=0
for only; do
    begun=$(date +%s)
    table=build/bench/${dry:+dry-}$only.csv
    if [ "$dry" ]; then
        flag=--dry
        [ $only != visibility ] || flag=--quick
        ${MAKE:-make} --no-print-directory build/bench/bench_$only build/bench/plot
        build/bench/bench_$only $flag "$table"
        build/bench/plot "$table" "${table%.csv}.svg"
    else
        ${MAKE:-make} --no-print-directory bench QUICK=1 ONLY=$only
    fi
    [ "$(head -n 1 "$table")" = header,case,method,setting,seconds,error,work,unit ] || { echo "$table: other columns"; exit 1; }
    awk -F, -v file="$table" -v wanted="$( (wanted $only; goals $only) | tr '\n' ' ')" '
        function number(x) { return x ~ /^[0-9]*\.?[0-9]+([eE][-+]?[0-9]+)?$/ }
        NR > 1 && (NF != 8 || !number($5) || !number($6) || !number($7) || $5 + 0 <= 0 || $7 + 0 <= 0) { print file ":" NR ": " $0; bad = 1 }
        NR > 1 { method = $3; gsub(/ /, "_", method); rows[$2 ":" method]++; cases[$2]++ }
        END {
            for (c in cases) if (rows[c ":default"] != 1) { print file ": case " c " has " rows[c ":default"] + 0 " default rows"; bad = 1 }
            n = split(wanted, want, " ")
            for (i = 1; i <= n; i++) {
                least = 1; name = want[i]
                if (split(name, part, "*") > 1) { name = part[1]; least = part[2] }
                found = name ~ /:/ ? rows[name] : least > 1 ? cases[name] : rows[name ":default"]
                if (found < least) { print file ": " name " has " found + 0 " rows, not " least; bad = 1 }
            }
            exit bad
        }' "$table"
    [ -s "${table%.csv}.svg" ] || { echo "${table%.csv}.svg is missing"; exit 1; }
    lines=$((lines + $(wc -l < "$table")))
    took="$took $only $(($(date +%s) - begun)) s"
done
echo "note: $lines lines of measurements;$took"
