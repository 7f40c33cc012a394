//! `check`.

use crate::exit;
use crate::print::line;
use penumbra::cli::CheckArgs;
use penumbra::load::{Card, Verdict};

/// Prints the report card of each file.
pub fn run(args: &CheckArgs) -> u8 {
    let options = args.load_options();
    let mut worst = Verdict::Valid;
    for file in &args.files {
        let card = Card::check(file, &options);
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
