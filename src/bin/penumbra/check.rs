//! `check`.

use crate::exit;
use crate::print::line;
use penumbra::cli::CheckArgs;
use penumbra::load::{Card, SceneSource, Verdict, scenes_in};
use std::ffi::OsString;
use std::path::Path;

/// Prints the report card of each file.
pub fn run(args: &CheckArgs) -> u8 {
    let options = args.load_options();
    let mut worst = Verdict::Valid;
    for file in args.files.iter().flat_map(scenes_of) {
        let card = Card::check(&file, &options);
        worst = worst.max(card.verdict);
        if !args.json {
            line(card.text());
            continue;
        }
        match serde_json::to_string(&card) {
            Ok(json) => line(json),
            Err(error) => return exit::because(&error, exit::FAILED),
        }
    }
    match worst {
        Verdict::Valid => 0,
        Verdict::Repaired => exit::NOT_ALL_AS_IN_THE_FILE,
        Verdict::Refused => exit::SCENE_NOT_READABLE,
    }
}

/// All scenes of a folder; anything else, and a folder without any, is itself.
fn scenes_of(argument: &OsString) -> Vec<OsString> {
    let is_other =
        matches!(SceneSource::parse(argument), Ok(SceneSource::BuiltIn(_))) || !Path::new(argument).is_dir();
    let scenes = if is_other { Vec::new() } else { scenes_in(Path::new(argument)) };
    if scenes.is_empty() { vec![argument.clone()] } else { scenes.into_iter().map(Into::into).collect() }
}
