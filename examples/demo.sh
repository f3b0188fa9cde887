#!/bin/sh
# Volume in, globally lit pictures out, into build/demo. VOLUME in the environment chooses a file of the user's own; ISO, SPACING and UP are
# the viewer's options for it.
out=build/demo
mkdir -p "$out"
begun=$(date +%s)
failed=0

# NAME CAPTION VIEWER_ARGUMENTS...
picture() {
    file=$out/$1.png caption=$2
    shift 2
    since=$(date +%s)
    echo "$caption"
    if build/viewer "$@" --out "$file"; then echo "    $file   $(($(date +%s) - since)) s"
    else failed=1
    fi
}

if [ "$VOLUME" ]; then
    name=$(basename -- "$VOLUME")
    name=${name%.*}${ISO:+-$(printf %s "$ISO" | tr -c 0-9A-Za-z.+- _)}
    set -- "$VOLUME" ${ISO:+--iso "$ISO"} ${SPACING:+--spacing "$SPACING"} ${UP:+--up "$UP"}
    picture "$name-phong" "$name, light by the normal alone" "$@" --mode phong
    [ $failed = 1 ] || picture "$name" "$name, global light" "$@" --mode irradiance
else
    [ "$ISO$SPACING$UP" ] && echo "ISO, SPACING and UP are for a VOLUME of your own: there is none, so these are shapes made here"
    picture engine-block-phong "An engine block, light by the normal alone: the usual picture, to compare with" \
        procedural:engine-block --mode phong --size 640x640
    picture engine-block "The same under a sky and a sun, with shadows and every reflection" procedural:engine-block --size 640x640
    picture skull "A skull, the same light" procedural:skull --size 640x640
    picture gyroid "A gyroid: most of its light has been reflected a few times" procedural:gyroid --size 640x640
    picture hydrogen "A hydrogen orbital, volume rendered, shaded by what each point sees of the sky" procedural:hydrogen --mode dvr
fi
echo "$(($(date +%s) - begun)) s in all"
[ "$VOLUME" ] || echo "A volume of your own: make demo VOLUME=head_256x256x99_uint8.raw ISO=130 SPACING=1,1,2 UP=0,0,-1"
exit $failed
