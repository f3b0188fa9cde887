#!/bin/sh
# The pictures of README.md, from shapes that need no file, into examples/.
set -e
mkdir -p build/pictures
skull="procedural:skull --camera 30,8,1.8 --env sky --light directional:1,1,0.6:3,2.8,2.4:0.5 --size 280x280"
baked="$skull --samples 32"
build/viewer procedural:engine-block --size 640x640 --out examples/engine-block.png
build/viewer procedural:gyroid --size 640x640 --out examples/gyroid.png
build/viewer $baked --out examples/skull-global.png
build/viewer $skull --mode phong --shadows on --out examples/skull-phong.png
build/viewer $baked --lattice 64,72,72 --compare examples/skull-global.png --out examples/skull-coarse.png

# The paper's figures 5, 6, 7 and 12: a picture for each argument, which is added to $same, at the exposure of the last one.
strip() { # NAME ARGUMENTS...
    name=$1 parts= n=0
    shift
    for last; do :; done
    exposure=$(build/viewer $same $last --stats --out build/pictures/last.png | sed -n 's/^exposure //p')
    for each; do
        n=$((n + 1)) parts="$parts build/pictures/$name-$n.png"
        build/viewer $same $each --exposure "$exposure" --out "build/pictures/$name-$n.png"
    done
    build/strip "examples/$name.png" $parts
}
close="procedural:skull --camera 30,8,1.2 --env sky --light directional:1,1,0.6:3,2.8,2.4:0.5"
same="$close --size 216x216 --mode pathtrace --bounces 0 --samples 16"
strip figure-5 "--normals trilinear --offset -1" "--offset -1" ""
same="procedural:engine-block --camera 37,25,0.9 --size 161x161"
strip figure-6 "--lookup closest-isovalue" "--lookup nearest" "--lookup trilinear" "--mode pathtrace --samples 64"
strip figure-7 "--mode pathtrace --samples 2" "--samples 2" "--samples 8" "--samples 32"
same="$close --size 161x161"
strip figure-12 "--lattice 64,72,72" "" "--lattice 256,288,288" "--mode pathtrace"
