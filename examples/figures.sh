#!/bin/sh
# The figures of Wyman et al. 2006 with our data, into build/figures with an index.html; numbers beside the pictures are differences to
# the reference that the caption names, at its exposure, RMS in sRGB values of 0 to 1. With ISOGI_DATA real volumes, else procedural stand-ins.
# A few minutes of one processor's time; the last line tells how many.
#     FIGURES_SIZE=900x900   pixels; default 320x320            FIGURES_SAMPLES=1    times as many samples; with 80 figure 7 has about the paper's
out=${FIGURES_OUT:-build/figures}
size=${FIGURES_SIZE:-320x320} more=${FIGURES_SAMPLES:-1}
mkdir -p "$out"
page=$out/index.html
begun=$(date +%s) failed=0
samples() { # FIGURES_DIVIDE: fewer, for a look whether all of it works
    n=$(($1 * more / ${FIGURES_DIVIDE:-1}))
    echo $((n > 0 ? n : 1))
}

echo '<!doctype html><meta charset="utf-8"><title>isogi figures</title><style>body{background:#222;color:#ddd;font:15px sans-serif}figure{display:inline-block;margin:6px}img{display:block}</style>' > "$page"

head_of() { echo "figure $1: $2"; echo "<h3>Figure $1. $2</h3>" >> "$page"; }

# NAME CAPTION VIEWER_ARGUMENTS...
picture() {
    name=$1 caption=$2
    shift 2
    since=$(date +%s)
    case " $* " in
    *" --mode lambert "* | *" --mode phong "* | *" --samples "*) ;; # no paths; or their number is chosen
    *) set -- "$@" --samples "$(samples 32)" ;;
    esac
    if stats=$(build/viewer "$@" --size "$size" --stats --out "$out/$name.png"); then
        number=$(echo "$stats" | sed -n 's/^difference_rms //p')
        echo "$stats" | sed -n 's/^exposure //p' > "$out/$name.exposure"
        echo "    $name   ${number:+difference $number   }$(($(date +%s) - since)) s"
        echo "<figure><img src=\"$name.png\" alt=\"$name\"><figcaption>$caption${number:+<br>difference $number}</figcaption></figure>" >> "$page"
    else failed=1
    fi
}

# LIKE NAME CAPTION ARGUMENTS...: the same, compared with the picture LIKE. At its exposure: one of its own would hide differences of
# brightness, or add some
compared() {
    like=$1 name=$2 caption=$3
    shift 3
    picture "$name" "$caption" "$@" --compare "$out/$like.png" --exposure "$(cat "$out/$like.exposure")"
}

data() { [ -n "$ISOGI_DATA" ] && [ -f "$ISOGI_DATA/$1" ]; }
few="--samples $(samples 16)"
if data vismale_head_128x256x256_uint8.raw; then
    skull="$ISOGI_DATA/vismale_head_128x256x256_uint8.raw --iso 100 --spacing 1.58,1,1.01 --up 0,0,-1 --camera 150,5,1.7"
    skull_sun="--env sky --light directional:1,-1,-1:3,2.8,2.4:0.5" head_grid="64,128,128 128,256,256 256,512,512"
    close_sun="--camera 150,5,0.8 --light directional:1,-0.4,-0.3:4,3.8,3.4"
else
    skull="procedural:skull --camera 30,8,2" skull_sun="--env sky --light directional:1,1,0.6:3,2.8,2.4:0.5"
    head_grid="64,72,72 128,144,144 256,288,288" close_sun="--camera 35,30,0.8 --light directional:-1,0.9,0.8:4,3.8,3.4"
fi
if data bonsai_256x256x256_uint8.raw; then
    fading="$ISOGI_DATA/bonsai_256x256x256_uint8.raw --up 0,0,1 --camera 30,50,1.1 --light directional:1,-0.6,1:5,4.6,4" fading_isos="100 135 150"
else fading="procedural:hydrogen --camera 35,10,1.1 --light directional:0.4,0.8,1:5,4.6,4" fading_isos="0.2 0.24 0.26"
fi
fading="$fading --env sky --bounces 1"
if data engine_256x256x128_uint8.raw; then engine="--scene engine --camera 37,25,2"
else engine="--scene engine-block --camera 37,25,2"
fi
if data neghip_64x64x64_uint8.raw; then field="$ISOGI_DATA/neghip_64x64x64_uint8.raw --iso 50" close=30,25,1.1 whole=30,25,1.7
else field="procedural:hydrogen" close=30,25,1.4 whole=30,25,2.2
fi

head_of 1 "Global light beside Phong with shadows"
picture 1a-global "a skull, global light" $skull $few $skull_sun
picture 1a-phong "Phong with shadows" $skull --mode phong --shadows on $skull_sun
picture 1b-global "a simulation, global light" $field --camera $whole
picture 1b-phong "Phong with shadows" $field --camera $whole --mode phong --shadows on

head_of 4 "A hard shadow as the isovalue rises: what throws it is gone before it, since texels lie on isosurfaces of their own; differences to path tracing"
for iso in $fading_isos; do
    picture "4-iso-$iso-reference" "isovalue $iso, path tracing" $fading --iso $iso --mode pathtrace --samples $(samples 64)
    compared "4-iso-$iso-reference" "4-iso-$iso" "isovalue $iso" $fading --iso $iso $few
done

head_of 5 "Normals and offset, from close: artefacts of voxels on the surface and along shadow borders; differences to smoothed + offset"
direct="--mode pathtrace --bounces 0 $few $close_sun"
picture 5-smoothed-offset "direct light, smoothed normals, offset" $skull $direct
compared 5-smoothed-offset 5-gradient "gradient normals" $skull $direct --normals trilinear --offset -1
compared 5-smoothed-offset 5-smoothed "smoothed normals" $skull $direct --offset -1
picture 5-global-smoothed-offset "four bounces, smoothed normals, offset" $skull $few $close_sun --bounces 4
compared 5-global-smoothed-offset 5-global-gradient "four bounces, gradient normals" $skull $few $close_sun --bounces 4 --normals trilinear --offset -1

head_of 6 "Lookups; differences to path tracing"
picture 6-reference "path tracing" $engine --mode pathtrace --samples $(samples 512)
for lookup in closest-isovalue nearest trilinear bspline; do compared 6-reference "6-$lookup" $lookup $engine --lookup $lookup; done

head_of 7 "Samples; differences to path tracing with $(samples 512)"
for n in 2 8 32 128; do
    n=$(samples $n)
    compared 6-reference "7-transfer-$n" "transfer, $n" $engine --mode transfer --samples "$n"
    compared 6-reference "7-irradiance-$n" "irradiance, $n" $engine --samples "$n"
    compared 6-reference "7-pathtrace-$n" "path tracing, $n" $engine --mode pathtrace --samples "$n"
done

head_of "8 and 9" "A simulation, from close and whole: ours, vicinity shading, Lambert with fog, Phong and Lambert with ambient by normal, Lambert without shadows"
for view in 8 9; do
    camera=$([ $view = 8 ] && echo "--camera $close" || echo "--camera $whole")
    picture $view-ours "global light" $field $camera
    picture $view-vicinity "vicinity shading" $field $camera --mode vicinity
    picture $view-fog "Lambert with fog" $field $camera --mode lambert --fog 2
    picture $view-phong "Phong, ambient by normal, shadows" $field $camera --mode phong --ambient normal --shadows on
    picture $view-lambert-shadows "Lambert, ambient by normal, shadows" $field $camera --mode lambert --shadows on
    picture $view-lambert "Lambert without shadows, ambient constant" $field $camera --mode lambert --ambient constant
done

head_of 10 "Global light beside vicinity shading"
picture 10-ours "global light" $skull $few
picture 10-vicinity "vicinity shading" $skull $few --mode vicinity

head_of 11 "Textures beside path tracing; differences to it"
compared 6-reference 11-irradiance "irradiance texture" $engine --samples $(samples 64)
compared 6-reference 11-transfer "transfer of order 5" $engine --mode transfer --samples $(samples 64)

head_of 12 "Texture of 1/8, 1 and 8 times the volume's resolution; differences to path tracing"
picture 12-reference "path tracing" $skull $skull_sun --mode pathtrace --samples $(samples 64)
k=0
for grid in $head_grid; do
    k=$((k + 1))
    compared 12-reference "12-$k" "$grid texels" $skull $few $skull_sun --lattice $grid
done

echo "$(($(date +%s) - begun)) s in all: $page"
times > "$out/times" && tail -n 1 "$out/times" && rm "$out/times" # of the viewer: processor time; in a pipe it would be none
exit $failed
