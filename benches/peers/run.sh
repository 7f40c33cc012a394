#!/usr/bin/env bash
# Puts our engine into a copy of the peers' harness and runs it there, beside theirs, on the same rays.
#
#   benches/peers/run.sh HARNESS [its options]
#
# HARNESS is the folder that has `kernels`, `scenes` and `data`. It wants Embree (`pip install embreex`)
# and a C++ compiler. What is built goes to target/peers.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
harness=$(cd "${1:?usage: run.sh HARNESS [options]}" && pwd)
shift

copy=$root/target/peers
mkdir -p "$copy/kernels"
for part in scenes data; do ln -sfn "$harness/$part" "$copy/$part"; done
cp -r --no-preserve=mode "$harness/kernels/." "$copy/kernels"
cp "$here/penumbra.rs" "$copy/kernels/src/engines/"

engines=$copy/kernels/src/engines/mod.rs
sed -i -e '0,/^pub mod/s//pub mod penumbra;\npub mod/' \
    -e 's|^\( *\)v.push(reg!("bvh-iter".*|\1v.push(reg!("penumbra", penumbra::Penumbra));\n&|' "$engines"
cat >>"$copy/kernels/Cargo.toml" <<TOML

[dependencies.penumbra]
path = "$root"
default-features = false

[dependencies.glam]
version = "0.34"
features = ["bytemuck"]

[dependencies.bytemuck]
version = "1"

[workspace]
TOML
cd "$copy/kernels"
# All crates, ours too, get what the harness says: `target-cpu=native` and LTO. (Our kernels choose their instructions themselves in any case.)
cargo build --release --quiet
exec ./target/release/peer-kernels "$@"
