#!/bin/sh
# Every benchmark writes the table that is promised: the eight columns, positive times, and for each case one row of the default.
set -e
${MAKE:-make} --no-print-directory bench QUICK=1
for table in build/bench/*.csv; do
    [ "$(head -n 1 "$table")" = header,case,method,setting,seconds,error,work,unit ] || { echo "$table: other columns"; exit 1; }
    awk -F, -v file="$table" '
        NR > 1 && (NF != 8 || !($5 > 0) || !($6 >= 0) || !($7 > 0)) { print file ":" NR ": " $0; bad = 1 }
        NR > 1 { cases[$2] = 1; if ($3 == "default") defaults[$2]++ }
        END { for (c in cases) if (defaults[c] != 1) { print file ": case " c " has " defaults[c] + 0 " default rows"; bad = 1 }; exit bad }' "$table"
    [ -s "${table%.csv}.svg" ] || { echo "${table%.csv}.svg is missing"; exit 1; }
done
echo "note: $(cat build/bench/*.csv | wc -l) lines of measurements"
