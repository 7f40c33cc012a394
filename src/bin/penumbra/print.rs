//! Standard output.

use crate::exit;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

/// Prints a line. Who has stopped reading (`| head`) has what they wanted; nobody can go on without any other output.
pub fn line(text: impl Display) {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let error = io::Error::new(error.kind(), format!("standard output: {error}"));
            std::process::exit(exit::because(&error, exit::FAILED).into());
        }
        _ => {}
    }
}
