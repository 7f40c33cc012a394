#!/bin/sh
# Every scene below a folder, two seconds each, on one sheet to be looked at: run.sh PROGRAM SCENES OUT.jpg
# Needs `montage` of ImageMagick.
set -eu
program=$(realpath "$1") scenes=$(realpath "$2") out=$(realpath "$3")
sheet=$(mktemp -d)
trap 'rm -rf "$sheet"' EXIT
cd "$scenes"
find . -name '*.glb' -o -name '*.gltf' -o -name '*.obj' | sort | while read -r scene; do
    name=$(basename "${scene%.*}")
    while [ -e "$sheet/$name.png" ]; do name=$name+; done
    # 4: not all samples in time.
    "$program" render "$scene" -o "$sheet/$name.png" --resolution 256x192 --time-limit 2 --spp 64 --integrator path -q ||
        [ $? = 4 ] || echo "not rendered: $scene" >&2
done
montage -label '%t' "$sheet"/*.png -tile 8x -geometry 180x135+3+3 -background '#202020' -fill '#dddddd' -pointsize 8 -quality 86 "$out"
