#!/bin/sh
# Figure 14 of Kronander et al. 2011 with our data, into build/figures (or $1): a volume under one light by local diffuse shading (the
# baseline), by local visibility, and by global visibility, by the paper's method and by sweeps, in one and in several resolutions; numbers
# are differences to global visibility by sweeps, RMS in sRGB values of 0 to 1, each picture at an exposure of its own, at which its mean is
# the same: how many times that of the first is told, too. With ISOGI_DATA engine, else engine-block.
# Pictures and captions are added to the HTML file FIGURES_PAGE in the folder, if that is set.
#     SIDE=512   pixels; default 320
out=${1:-build/figures} side=${SIDE:-320}
mkdir -p "$out" || exit 1
page=${FIGURES_PAGE:-/dev/null}
scene=procedural:engine-block # with a transfer function from its histogram
[ -z "$ISOGI_DATA" ] || [ ! -f "$ISOGI_DATA/engine_256x256x128_uint8.raw" ] || scene="--scene engine"
light="--light directional:1,2,1:3,3,3 --env sky"
failed=0

echo "<h2>Kronander 2011, shading by gradients, by local and by global visibility (figure 14)</h2>" >> "$page"
echo "figure 14: shading by gradients, by local and by global visibility: $scene"
# NAME CAPTION VIEWER_ARGUMENTS...
picture() {
    name=$1 caption=$2
    shift 2
    if stats=$(build/viewer $scene --mode dvr --size "${side}x$side" $light "$@" --stats --out "$out/$name.png"); then
        number=$(echo "$stats" | sed -n 's/^difference_rms //p')
        exposure=$(echo "$stats" | sed -n 's/^exposure //p')
        [ "$number" ] || first=$exposure
        told="difference $number, exposure x $(awk "BEGIN { printf \"%.3g\", $exposure / $first }")"
        echo "    $name   $caption${number:+   $told}"
        echo "<figure><img src=\"$name.png\" alt=\"$name\"><figcaption>$caption${number:+<br>$told}</figcaption></figure>" >> "$page"
    else failed=1
    fi
}
picture 14-global "global visibility" --order 3 --directions 64
for way in "14-diffuse|local diffuse shading|--shading local" "14-local|local visibility|--method paper --local --order 3 --directions 64" \
    "14-paper|global visibility, paper's method|--method paper --order 3 --directions 64" \
    "14-several|global visibility, several resolutions|--coarsest 8 --order 3 --directions 64"; do
    name=${way%%|*} rest=${way#*|}
    picture "$name" "${rest%%|*}" ${rest#*|} --compare "$out/14-global.png"
done
exit $failed
