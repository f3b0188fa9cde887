#!/bin/sh
# The figures of Kraus 2005, "Scale-invariant volume rendering", as pictures: figures_scale_invariant.sh [FOLDER]
# Pictures and captions are added to the HTML file FIGURES_PAGE, in the folder or in the one above, if that is set.
#
# Needs build/viewer, build/isolines and, for 8e and 8f, build/tets with data. Figure 4 and 7 are drawings.
set -e
out=${1:-build/figures/scale-invariant}
side=${SIDE:-512}
mkdir -p "$out"
page=${FIGURES_PAGE:-/dev/null}
from= # the page's folder to ours
[ "$(dirname "$page")" = "$out" ] || from=$(basename "$out")/
echo '<h2>Kraus 2005, scale-invariant volume rendering</h2>' >> "$page"

show() { # NAME CAPTION
    echo "<figure><img src=\"$from$1.png\" alt=\"$1\"><figcaption>$1: $2</figcaption></figure>" >> "$page"
}
# What a picture shows goes through a file: transfer functions as text.
transfer() { printf '%b' "$2" > "$out/$1.tf"; }
draw() { # NAME CAPTION SHAPE TRANSFER OPTIONS...
    name=$1 caption=$2 shape=$3 tf=$4
    shift 4
    echo "$name"
    build/viewer "procedural:$shape" --tf "$out/$tf.tf" --size "${side}x$side" --aa 4 --exposure 1 --out "$out/$name.png" "$@"
    show "$name" "$caption"
}

transfer sheets 'peak 0.72 0.35 .15 .3 .9\npeak 1.5 0.7 .9 .15 .1\n'
# The same surfaces as narrow tents of physical space: opacity grows where the field is flat.
transfer tents '0.70 0 .15 .3 .9\n0.72 0.8 .15 .3 .9\n0.74 0 .15 .3 .9\n1.45 0 .9 .15 .1\n1.5 3 .9 .15 .1\n1.55 0 .9 .15 .1\n'
transfer constant '0 0.9 .85 .85 .9\n'
: > "$out/set.tf"
i=0
while [ $i -lt 24 ]; do # opacity of one sheet of the set: 1 - exp(-0.9 * 0.2)
    echo "$i" | awk '{printf "peak %g 0.1647 .85 .85 .9\n", 0.1 + 0.2 * $1}' >> "$out/set.tf"
    i=$((i + 1))
done
transfer ml 'peak 0.5 0.15 .9 .8 .6\n'
transfer ml-tent '0.47 0 .9 .8 .6\n0.5 0.2 .9 .8 .6\n0.53 0 .9 .8 .6\n'
transfer orbital 'peak 0.06 0.2 .3 .7 .9\n'
transfer orbital-tent '0.045 0 .3 .7 .9\n0.06 0.25 .3 .7 .9\n0.075 0 .3 .7 .9\n'

echo 1a && build/isolines coulomb 12 0.3 2.5 "$out/1a.png"
show 1a "three Coulomb potentials: isolines of a slice"
draw 1b "peaks as tents of physical space: opaque where the field is flat" coulomb tents --mode dvr --shading unlit --step 0.1
draw 1c "in data space: uniform opacity" coulomb sheets --mode scale-invariant --shading unlit
draw 1d "with silhouettes (eq. 15)" coulomb sheets --mode scale-invariant --shading unlit --silhouette exact
draw 2b "lit by the gradient" coulomb sheets --mode scale-invariant --shading local --light directional:0.4,0.7,1:3,3,3
draw 3a "a constant transfer function" coulomb constant --mode scale-invariant --shading unlit
draw 3b "24 isosurfaces of as much opacity together" coulomb set --mode scale-invariant --shading unlit
draw 5b "silhouettes by their approximation (eq. 16)" coulomb sheets --mode scale-invariant --shading unlit --silhouette approximate
front='--light directional:0.3,0.4,1:2.8,2.8,2.8 --shading two-sided --silhouette exact'
behind='--light directional:-0.3,-0.1,-1:6,6,6 --shading two-sided --silhouette exact'
draw 6a "light from the front" coulomb sheets --mode scale-invariant $front
draw 6b "light from behind, not transmitted" coulomb sheets --mode scale-invariant $behind --transmission none
draw 6c "transmitted diffusely" coulomb sheets --mode scale-invariant $behind --transmission diffuse
draw 6d "transmitted specularly" coulomb sheets --mode scale-invariant $behind --transmission specular
draw 8a "Marschner-Lobb signal, physical space" marschner-lobb ml-tent --mode dvr --shading unlit --step 0.1
draw 8b "Marschner-Lobb signal, data space" marschner-lobb ml --mode scale-invariant --shading unlit --silhouette exact
draw 8c "orbital of hydrogen, physical space" hydrogen orbital-tent --mode dvr --shading unlit --step 0.1
draw 8d "orbital of hydrogen, data space" hydrogen orbital --mode scale-invariant --shading unlit --silhouette exact
ball=${ISOGI_DATA:+$ISOGI_DATA/buckyball_32x32x32_uint8.raw}
if [ -f "$ball" ]; then
    echo 8e && build/tets "$ball" physical "$out/8e.png" "$side" && show 8e "tetrahedra, physical space"
    echo 8f && build/tets "$ball" data "$out/8f.png" "$side" && show 8f "tetrahedra, data space"
else
    echo "8e, 8f: left out: ISOGI_DATA has no buckyball_32x32x32_uint8.raw"
fi
