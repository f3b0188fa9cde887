#!/bin/sh
# Benchmarks write the table that is promised: the eight columns, finite positive numbers, for each case one row of the default, and every
# case that is asked for; what is called usable is better than a black picture, what is called converged better still, and later.
# contract.sh [--dry] [sh|vol|trace|dvr]...; cases of real volumes are wanted where ISOGI_DATA holds them. --dry, of
# trace and dvr: tiny stand-ins for all scenes, with the cases of the full benchmark; seconds instead of minutes.
set -e
dry=
[ "$1" != --dry ] || { dry=1; shift; }
[ $# -gt 0 ] || set -- sh vol trace dvr

wanted() {
    case $1 in
    sh) echo eval-aos-f32-L4 eval-aos-f32-L10 eval-aos-f32-L20 eval-soa-f32-L4 eval-soa-f32-L10 eval-soa-f32-L20 eval-aos-f64-L4 eval-aos-f64-L10 \
        rotate-once-n3 rotate-once-n4 rotate-once-n5 rotate-once-n8 rotate-once-n16 rotate-build-n8 rotate-build-n16 rotate-apply-n5 \
        product-n5 product-batch-n5 zonal-n5 sum-n5 project-equirect-n5 \
        light-directional light-disc light-point light-sphere light-rectangle ;;
    vol) for field in ml256 gyroid256; do
            for rays in primary1 primary16 surface anyhit bundle64; do echo $rays-$field; done
         done
         echo pyramid-256 trilinear-along-rays tricubic-along-rays tricubic-random mesh-gyroid256 mesh-normals-gyroid256 ;;
    trace) for scene in engine-block $(have engine_256x256x128_uint8.raw engine) ${dry:+bonsai cthead}; do
            echo speedup-$scene speedup-$scene:naive filter-$scene filter-$scene:filter-off rays-$scene threads-$scene lazy-$scene \
                lazy-converged-$scene
           done
           [ -z "$dry" ] || echo full-engine-block table1-engine-block table1-engine-block:irradiance table1-engine-block:transfer \
               table2-engine-block table2-engine-block:transfer lattice-engine-block lattice-cavity figure5-ball-points-macroscopic \
               figure5-hollow-texture-microscopic ;;
    dvr) echo frame-ml256 frame-gyroid256 frame-scale-invariant-gyroid256 \
        $(have engine_256x256x128_uint8.raw frame-engine tf-update-engine tf-update-engine:paper tf-update-engine:sweep) \
        $(have bonsai_256x256x256_uint8.raw frame-bonsai tf-update-bonsai tf-update-bonsai:paper tf-update-bonsai:sweep) \
        $(have fuel_64x64x64_uint8.raw tf-update-fuel tf-update-fuel:paper tf-update-fuel:sweep) ;;
    esac
}
have() { [ -z "$dry" ] || { shift; echo "$@"; return; }
    [ -z "$ISOGI_DATA" ] || [ ! -f "$ISOGI_DATA/$1" ] || { shift; echo "$@"; }; }

lines=0
for only; do
    begun=$(date +%s)
    table=build/bench/${dry:+dry-}$only.csv
    if [ "$dry" ]; then
        ${MAKE:-make} --no-print-directory build/bench/bench_$only build/bench/plot
        build/bench/bench_$only --dry "$table"
        build/bench/plot "$table" "${table%.csv}.svg"
    else
        ${MAKE:-make} --no-print-directory bench QUICK=1 ONLY=$only
    fi
    [ "$(head -n 1 "$table")" = header,case,method,setting,seconds,error,work,unit ] || { echo "$table: other columns"; exit 1; }
    awk -F, -v file="$table" -v wanted="$(wanted $only | tr '\n' ' ')" '
        function number(x) { return x ~ /^[0-9]*\.?[0-9]+([eE][-+]?[0-9]+)?$/ }
        NR > 1 && (NF != 8 || !number($5) || !number($6) || !number($7) || $5 + 0 <= 0 || $7 + 0 <= 0) { print file ":" NR ": " $0; bad = 1 }
        NR > 1 { rows[$2 ":" $3]++; cases[$2] = 1 }
        /,lazy-/ { error[$2] = $6; rays[$2] = $7 }
        END {
            for (c in error) if (c ~ /^lazy-converged-/) {
                u = c; sub("converged-", "", u)
                if (error[u] >= 0.6 || error[c] > error[u] || rays[c] < rays[u]) {
                    print file ": " u " has error " error[u] " with " rays[u] " rays, " c " " error[c] " with " rays[c]; bad = 1
                }
            }
            for (c in cases) if (rows[c ":default"] != 1) { print file ": case " c " has " rows[c ":default"] + 0 " default rows"; bad = 1 }
            n = split(wanted, want, " ")
            for (i = 1; i <= n; i++) if (!rows[want[i] ~ /:/ ? want[i] : want[i] ":default"]) { print file ": " want[i] " is missing"; bad = 1 }
            exit bad
        }' "$table"
    [ -s "${table%.csv}.svg" ] || { echo "${table%.csv}.svg is missing"; exit 1; }
    lines=$((lines + $(wc -l < "$table")))
    took="$took $only $(($(date +%s) - begun)) s"
done
echo "note: $lines lines of measurements;$took"
