//! `merge`.

use crate::exit;
use crate::headless::files_to_write;
use penumbra::cli::MergeArgs;
use penumbra::farm::{self, is_film};
use penumbra::image::save;

/// Makes one picture of films.
pub fn run(args: &MergeArgs) -> u8 {
    let outputs = match files_to_write(&args.output) {
        Ok(outputs) => outputs,
        Err(error) => return exit::because(&error, exit::BAD_COMMAND_LINE),
    };
    let merged = match farm::merge(&args.films, args.sample_range.clone(), args.allow_gaps) {
        Ok(Some(merged)) => merged,
        // The command line wants one at least.
        Ok(None) => return exit::BAD_COMMAND_LINE,
        Err(error) => return exit::because(&error, exit::FAILED),
    };
    let mut display = merged.header.display();
    display.exposure = args.exposure.unwrap_or(display.exposure);
    display.tone_map = args.tone_map.map_or(display.tone_map, Into::into);
    for path in &outputs {
        let written = if is_film(path) { merged.write(path) } else { save(path, &merged.film, &display) };
        if let Err(error) = written {
            eprintln!("error: {error}");
            return exit::FAILED;
        }
    }
    if !args.quiet {
        let (fewest, most) = merged.samples();
        let samples = if fewest == most { most.to_string() } else { format!("{fewest} to {most}") };
        let scene = &merged.header.identity.scene;
        eprintln!("{scene}: {} films, {samples} samples per pixel", args.films.len());
        for path in &outputs {
            eprintln!("wrote {}", path.display());
        }
    }
    0
}
