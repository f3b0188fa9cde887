#!/bin/sh
# Every picture of a folder is on its page index.html, and every picture on the page is there: page.sh FOLDER
bad=0
for picture in "$1"/*.png; do
    [ -e "$picture" ] || continue
    grep -q "src=\"$(basename "$picture")\"" "$1/index.html" || { echo "$picture is not on the page"; bad=1; }
done
for name in $(sed -n 's/.*src="\([^"]*\)".*/\1/p' "$1/index.html"); do
    [ -s "$1/$name" ] || { echo "$1/$name is missing"; bad=1; }
done
exit $bad
