//! Standard output.

use std::fmt::Display;
use std::io::{self, Write};

/// Prints a line. Who has stopped reading (`| head`) has what they wanted.
pub fn line(text: impl Display) {
    let _ = writeln!(io::stdout(), "{text}");
}
