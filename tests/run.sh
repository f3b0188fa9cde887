#!/bin/sh
# Runs items side by side and adds up what they report; the last line is "N passed, N failed, N skipped".
#
#     sh tests/suite.sh quick | sh tests/run.sh [JOBS]
#
# An item is one line: kind, label and shell command, parted by tabs.
#     live    a test program: its output is shown as it comes, its counts are taken from ISOGI_TEST_SUMMARY
#     suite   the same in one line, its output only when something fails
#     check   counts as one: passed when the command succeeds; its output is shown when it fails
#     skip    counts as one that could not run here; the third field says why
# A program that crashes, hangs or leaves no counts is a failed one. Each item may write below $OUT, a folder of its own.
# ISOGI_TEST_SUMMARY, where set, is a file to which the sum is added, so that several runs can be added up in turn. UNTIL, where set, is
# the time, in seconds since 1970, from which on no item is begun any more: what is left is skipped, and counted so.

shown() { sed 's/^/    /' "$1" | tail -n 60; }

one() {
    tab=$(printf '\t')
    kind=${1%%"$tab"*} rest=${1#*"$tab"}
    label=${rest%%"$tab"*} command=${rest#*"$tab"}
    if [ "$UNTIL" ] && [ "$(date +%s)" -ge "$UNTIL" ] && [ "$kind" != skip ]; then
        kind=skip command="no time is left"
    fi
    if [ "$kind" = skip ]; then
        echo "skip $label: $command"
        echo "0 passed, 0 failed, 1 skipped" > "$(mktemp "$RESULTS/XXXXXX")"
        return
    fi
    OUT=build/check/$(printf %s "$label" | tr -c 'A-Za-z0-9._+-' _)
    rm -rf "$OUT"
    mkdir -p "$OUT"
    ISOGI_TEST_SUMMARY=$(mktemp "$RESULTS/XXXXXX")
    export OUT ISOGI_TEST_SUMMARY
    limit=
    command -v timeout > /dev/null && limit="timeout ${LIMIT:-1200}"
    begun=$(date +%s)
    if [ "$kind" = live ]; then $limit sh -c "$command" < /dev/null
    else $limit sh -c "$command" < /dev/null > "$OUT/log" 2>&1
    fi
    status=$?
    took=$(($(date +%s) - begun))
    [ $status = 124 ] && echo "    stopped after ${LIMIT:-1200} s" >> "$OUT/log"
    if [ "$kind" = check ]; then
        if [ $status = 0 ]; then
            echo "1 passed, 0 failed, 0 skipped" > "$ISOGI_TEST_SUMMARY"
            note=$(sed -n 's/^note: //p' "$OUT/log" | tail -n 1)
            echo "ok   $label ($took s)${note:+: $note}"
        else
            echo "0 passed, 1 failed, 0 skipped" > "$ISOGI_TEST_SUMMARY"
            { echo "FAIL $label ($took s): $command"; shown "$OUT/log"; }
        fi
    else
        counts=$(tail -n 1 "$ISOGI_TEST_SUMMARY")
        case $counts in
        *" 0 failed,"*) [ $status = 0 ] || lost=1 ;;
        *" failed,"*) ;;
        *) lost=1 ;;
        esac
        if [ "$lost" ]; then
            echo "0 passed, 1 failed, 0 skipped" >> "$ISOGI_TEST_SUMMARY"
            echo "FAIL $label: ended with status $status before all its tests were done ($took s)"
            [ "$kind" = live ] || shown "$OUT/log"
        elif [ "$kind" = suite ]; then
            if [ $status = 0 ]; then echo "ok   $label: $counts ($took s)"
            else { echo "FAIL $label: $counts ($took s)"; grep -v '^ok ' "$OUT/log" > "$OUT/failed"; shown "$OUT/failed"; }
            fi
        fi
    fi
    [ "$KEEP" ] || rm -rf "$OUT"
}

if [ "$1" = --one ]; then
    one "$2"
    exit 0
fi

mkdir -p build
RESULTS=$(mktemp -d build/results.XXXXXX)
export RESULTS
trap 'rm -rf "$RESULTS"' EXIT
begun=$(date +%s)
tr '\n' '\0' | xargs -0 -n 1 -P "${1:-2}" sh "$0" --one
passed=0 failed=0 skipped=0
for file in "$RESULTS"/*; do
    while read -r p _ f _ s _; do
        passed=$((passed + p)) failed=$((failed + ${f%%[!0-9]*})) skipped=$((skipped + ${s%%[!0-9]*}))
    done < "$file"
done
total="$passed passed, $failed failed, $skipped skipped"
[ "$ISOGI_TEST_SUMMARY" ] && echo "$total" >> "$ISOGI_TEST_SUMMARY"
echo
echo "$(($(date +%s) - begun)) s in all"
echo "$total"
[ "$failed" = 0 ] && [ "$passed" -gt 0 ]
