#!/bin/sh
# The pictures of README.md, from shapes that need no file, into examples/.
set -e
skull="procedural:skull --camera 30,8,1.8 --env sky --light directional:1,1,0.6:3,2.8,2.4:0.5 --size 280x280"
baked="$skull --samples 32"
build/viewer procedural:engine-block --size 640x640 --out examples/engine-block.png
build/viewer procedural:gyroid --size 640x640 --out examples/gyroid.png
build/viewer $baked --out examples/skull-global.png
build/viewer $skull --mode phong --shadows on --out examples/skull-phong.png
build/viewer $baked --lattice 64,72,72 --compare examples/skull-global.png --out examples/skull-coarse.png
