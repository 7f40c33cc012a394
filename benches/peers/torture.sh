#!/usr/bin/env bash
# The torture chamber's geometric cases on the peers and on us, in a copy of the peers' harness.
#
#   benches/peers/torture.sh HARNESS [--to FOLDER] [--rays N] [--pairs N]
#
# HARNESS is the folder that has `kernels` (see run.sh). Prints a table; with `--to assets/torture` it also
# writes peers.csv, peers.md and peers.svg there. 10^7 rays take some minutes; what is built goes to target/peers-torture.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
harness=$(cd "${1:?usage: torture.sh HARNESS [--to FOLDER] [--rays N] [--pairs N]}" && pwd)
shift

kernels=$root/target/peers-torture/kernels
rm -rf "$kernels/src"
mkdir -p "$kernels"
cp -r --no-preserve=mode "$harness/kernels/." "$kernels"
mkdir -p "$kernels/src/bin"
cp "$here/textbook.rs" "$kernels/src/engines/"
cp "$here/torture.rs" "$kernels/src/bin/"
cp "$here/torture_plot.rs" "$kernels/src/"
sed -i -e '0,/^pub mod/s//pub mod textbook;\npub mod/' "$kernels/src/engines/mod.rs"
# Only the one program.
rm -f "$kernels/src/main.rs" "$kernels/src/scenes.rs" "$kernels/src/rays.rs"
cat >>"$kernels/Cargo.toml" <<TOML

[dependencies.penumbra]
path = "$root"
default-features = false

[dependencies.glam]
version = "0.34"
features = ["bytemuck"]

[dependencies.bytemuck]
version = "1"

[dependencies.plotters]
version = "0.3"
default-features = false
features = ["svg_backend"]

[workspace]
TOML
(cd "$kernels" && cargo build --release --quiet --bin torture)
exec "$kernels/target/release/torture" "$@"
