#!/bin/sh
# Renders a still in parts with GNU parallel, merges them, and compares with a single run, bit for bit.
#
#   apt-get install parallel && cargo build --release && tests/farm/parallel.sh
#
# On several machines: `parallel --sshloginfile hosts …`, with a folder that all of them share.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
export PENUMBRA="${PENUMBRA:-$here/../../target/release/penumbra}"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
scene="gallery --resolution 160x120 --integrator path"
tasks=6 spp=100

# The recipe.
# shellcheck disable=SC2086
seq 0 $((tasks - 1)) |
    parallel --halt now,fail=1 --jobs 2 "$here/part.sh" {} $tasks $spp "$folder" $scene --threads 1 -q
"$PENUMBRA" merge "$folder"/part-*.film --sample-range 0..$spp -o "$folder/still.exr" -o "$folder/still.film"

# shellcheck disable=SC2086
"$PENUMBRA" render $scene --spp $spp -q -o "$folder/single.exr" -o "$folder/single.film"
cmp "$folder/still.film" "$folder/single.film"
cmp "$folder/still.exr" "$folder/single.exr"
echo "parallel: $tasks parts are the single run, bit for bit"
