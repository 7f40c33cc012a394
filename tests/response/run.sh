#!/bin/sh
# How fast the window answers: from a key event to the picture that shows it, in every scene of a folder.
#
# usage: run.sh PROGRAM SCENES OUT.tsv [WIDTHxHEIGHT]     (needs Xvfb)
#
# Each scene is opened, left alone for a moment, then given 40 taps of W, arrows and S. A line for each scene: its
# name, number of taps, median and 99th percentile in ms, pictures a second while moving. Ends with 1 if a scene's
# median is above 35 ms or its 99th percentile above 60 ms. Scenes that are in OUT already are left out, so that it
# can be stopped and gone on with.
set -u
program=$1 scenes=$2 out=$3 size=${4:-960x540}
script=$(mktemp) said=$(mktemp)
trap 'rm -f "$script" "$said"' EXIT

i=0
while [ $i -lt 40 ]; do
    set -- W ArrowLeft S ArrowRight
    shift $((i % 4))
    # 0.12 s apart, 0.04 s long.
    awk -v i=$i -v key="$1" 'BEGIN { t = 1.5 + 0.12 * i; printf "%.2f down %s\n%.2f up %s\n", t, key, t + 0.04, key }'
    i=$((i + 1))
done > "$script"
echo "6.6 quit" >> "$script"

one() {
    name=${1#"$scenes"/}
    grep -q "^$name	" "$out" 2>/dev/null && return
    # A server of its own: one that broke down shall not spoil the next scene.
    timeout 120 xvfb-run -a -s "-screen 0 1280x800x24" \
        "$program" "$1" --resolution "$size" --replay "$script" > "$said" 2>/dev/null
    json=$(grep '^{"events"' "$said" | tail -1)
    value() { echo "$json" | sed -n "s/.*\"$1\": \([0-9.]*\).*/\1/p"; }
    printf "%s\t%s\t%s\t%s\t%s\n" "$name" "$(value events)" "$(value median_ms)" "$(value p99_ms)" \
        "$(value moving_pictures_per_second)" >> "$out"
}

for scene in cornell gallery bust $(find "$scenes" -name '*.gltf' -o -name '*.glb' -o -name '*.obj' | sort); do
    one "$scene"
done
awk -F '\t' '
    { if ($3 == "" || $3 > 35 || $4 > 60) { slow++; print "slow: " $0 } n++ }
    END { printf "%d scenes, %d too slow\n", n, slow; exit slow > 0 }
' "$out"
