#!/bin/sh
# Benchmarks write the table that is promised: the eight columns, positive times, and for each case one row of the default. Those of
# sh and vol, which need no converged pictures first.
set -e
for only in sh vol; do
    ${MAKE:-make} --no-print-directory bench QUICK=1 ONLY=$only
done
for table in build/bench/sh.csv build/bench/vol.csv; do
    [ "$(head -n 1 "$table")" = header,case,method,setting,seconds,error,work,unit ] || { echo "$table: other columns"; exit 1; }
    awk -F, -v file="$table" '
        NR > 1 && (NF != 8 || !($5 > 0) || !($6 >= 0) || !($7 > 0)) { print file ":" NR ": " $0; bad = 1 }
        NR > 1 { cases[$2] = 1; if ($3 == "default") defaults[$2]++ }
        END { for (c in cases) if (defaults[c] != 1) { print file ": case " c " has " defaults[c] + 0 " default rows"; bad = 1 }; exit bad }' "$table"
    [ -s "${table%.csv}.svg" ] || { echo "${table%.csv}.svg is missing"; exit 1; }
done
echo "note: $(cat build/bench/sh.csv build/bench/vol.csv | wc -l) lines of measurements"
