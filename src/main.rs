//! The `penumbra` command.

fn main() {}
