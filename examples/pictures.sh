#!/bin/sh
# The pictures of README.md, from shapes that need no file, into examples/ or the folder that PICTURES_OUT names; a few minutes.
# PICTURES_DIVIDE=16: small, of small volumes and with few paths, for a look whether all of it works.
set -e
out=${PICTURES_OUT:-examples} pieces=${PICTURES_OUT:-build/pictures} divide=${PICTURES_DIVIDE:-1}
coarse=$([ $divide = 1 ] || echo :32)
mkdir -p "$out" "$pieces"
part() { n=$(($1 / divide)) && echo $((n > 0 ? n : 1)); }
side() { echo "--size $(part $1)x$(part $1)"; }
skull="procedural:skull$coarse --camera 30,8,1.8 --env sky --light directional:1,1,0.6:3,2.8,2.4:0.5 $(side 280)"
baked="$skull --samples $(part 32)"
build/viewer procedural:engine-block$coarse $(side 640) --samples $(part 64) --out "$out/engine-block.png"
build/viewer procedural:gyroid$coarse $(side 640) --samples $(part 64) --out "$out/gyroid.png"
build/viewer $baked --out "$out/skull-global.png"
build/viewer $skull --mode phong --shadows on --out "$out/skull-phong.png"
build/viewer $baked --lattice 64,72,72 --compare "$out/skull-global.png" --out "$out/skull-coarse.png"

hydrogen="procedural:hydrogen$coarse --camera 35,25,1.8 $(side 280) --aa 4"
build/viewer $hydrogen --mode dvr --out "$pieces/volume-1.png"
build/viewer $hydrogen --mode scale-invariant --out "$pieces/volume-2.png"
build/strip "$out/volume.png" "$pieces/volume-1.png" "$pieces/volume-2.png"

block="procedural:engine-block$coarse --camera 37,25,1.9 $(side 280) --aa 4 --mode dvr"
build/viewer $block --out "$pieces/surface-1.png"
build/viewer $block --surface 195 --albedo .95,.55,.2 --out "$pieces/surface-2.png"
build/strip "$out/surface.png" "$pieces/surface-1.png" "$pieces/surface-2.png"

# The paper's figures 4 to 12: a picture for each argument, which is added to $same, at the exposure of the last one.
strip() { # NAME ARGUMENTS...
    name=$1 parts= n=0
    shift
    for last; do :; done
    exposure=$(build/viewer $same $last --stats --out "$pieces/$name-$#.png" | sed -n 's/^exposure //p')
    for each; do
        n=$((n + 1)) parts="$parts $pieces/$name-$n.png"
        [ $n = $# ] || build/viewer $same $each --exposure "$exposure" --out "$pieces/$name-$n.png"
    done
    build/strip "$out/$name.png" $parts
}
reference="--mode pathtrace --samples $(part 256)"
same="procedural:hydrogen$coarse --camera 35,10,1.1 --env sky --light directional:0.4,0.8,1:5,4.6,4 --bounces 1 $(side 161)"
strip figure-4 "--iso 0.2" "--iso 0.24" "--iso 0.26" "--iso 0.26 $reference"
same="procedural:skull:72 --camera 35,30,0.8 --light directional:-1,0.9,0.8:4,3.8,3.4 $(side 216) --mode pathtrace --bounces 0 --samples $(part 64)"
strip figure-5 "--normals trilinear --offset -1" "--offset -1" ""
same="procedural:engine-block$coarse --camera 37,25,0.9 $(side 161) --samples $(part 64)"
strip figure-6 "--lookup closest-isovalue" "--lookup nearest" "--lookup trilinear" "$reference"
strip figure-7 "--mode pathtrace --samples 2" "--samples 2" "--samples 8" "--samples 32"
same="procedural:skull$coarse --camera 30,8,1.2 --env sky --light directional:1,1,0.6:3,2.8,2.4:0.5 $(side 161) --samples $(part 64)"
strip figure-12 "--lattice 64,72,72" "" "--lattice 256,288,288" "$reference"
same="procedural:hydrogen$coarse --camera 30,25,0.8 $(side 161)"
strip figure-8 "--mode vicinity" "--mode lambert --fog 2" "--mode phong --ambient normal --shadows on" ""
same="procedural:engine-block$coarse --camera 37,25,1.9 $(side 130)"
strip figure-9 "--mode vicinity" "--mode lambert --fog 2" "--mode phong --ambient normal --shadows on" "--mode lambert --shadows on" ""
same="procedural:skull$coarse --camera 30,8,1.2 $(side 161)"
strip figure-10 "--mode vicinity" "--env sky --bounces 0" "--env sky" "--env sky $reference"
same="procedural:engine-block$coarse --camera 37,25,0.9 $(side 161) --env sky --light directional:0.4,0.8,0.45:3,2.8,2.4:20"
strip figure-11 "" "--mode transfer" "$reference"
