//! Exit codes, documented in the README and in `--help`.

use std::fmt::Display;

pub const FAILED: u8 = 1;
pub const BAD_COMMAND_LINE: u8 = 2;
pub const SCENE_NOT_READABLE: u8 = 3;
pub const BEFORE_TARGET: u8 = 4;
pub const ABOVE_LIMIT: u8 = 5;
pub const NOT_ALL_AS_IN_THE_FILE: u8 = 6;
pub const INTERRUPTED: u8 = 130;

/// Says what went wrong, and gives `code`.
pub fn because(error: &impl Display, code: u8) -> u8 {
    // It may speak of a file's own names.
    eprintln!("error: {}", penumbra::load::harmless(&error.to_string()));
    code
}
