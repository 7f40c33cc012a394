//! `torture`.

use crate::bar::Bar;
use crate::exit;
use crate::print::line;
use crate::signal::{set_threads, stop_on_signals};
use crate::window;
use clap::Parser;
use penumbra::cli::{Cli, TortureArgs};
use penumbra::torture::{self, Case, Effort, Trial, Tried};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Tries the cases asked for, and prints the table.
pub fn run(args: &TortureArgs) -> u8 {
    let cases = match chosen(&torture::cases(), &args.case) {
        Ok(cases) => cases,
        Err(error) => return exit::because(&error, exit::BAD_COMMAND_LINE),
    };
    if args.list {
        for case in &cases {
            line(format_args!("{:<4} {}: {}", case.id, case.title, case.limit));
        }
        return 0;
    }
    if let Some(id) = &args.show {
        if args.json || args.markdown {
            let error = "--show opens a scene; --json and --markdown print what cases came to";
            return exit::because(&error, exit::BAD_COMMAND_LINE);
        }
        return show(id, args.open_edge);
    }
    set_threads(args.threads);
    let interrupt = Arc::new(AtomicBool::new(false));
    stop_on_signals(&interrupt);
    let bar = Mutex::new(Bar::new(args.quiet));
    let mut tried: Vec<Tried> = Vec::new();
    for (i, case) in cases.iter().enumerate() {
        let progress = |step: torture::Step| {
            if let Ok(bar) = bar.lock() {
                let part = (i as f64 + step.part) / cases.len() as f64;
                bar.show(part, format!("{} {}: {}", step.id, case.title, step.what));
            }
        };
        let effort = match (args.long, args.quick) {
            (true, _) => Effort::Long,
            (_, true) => Effort::Quick,
            _ => Effort::Normal,
        };
        let trial = Trial { effort, seed: args.seed, progress: &progress, interrupt: &interrupt };
        trial.tell(case.id, "begins", 0.0);
        tried.push(torture::run(case, &trial));
        if interrupt.load(Ordering::Relaxed) {
            break;
        }
    }
    if let Ok(bar) = bar.lock() {
        bar.clear();
    }
    if let Err(error) = print(&tried, args) {
        return exit::because(&error, exit::FAILED);
    }
    if interrupt.load(Ordering::Relaxed) {
        exit::INTERRUPTED
    } else if tried.iter().all(Tried::holds_but_for_what_is_stated) {
        0
    } else {
        exit::ABOVE_LIMIT
    }
}

/// Opens the window on a case's scene.
fn show(id: &str, open: bool) -> u8 {
    let name = format!("torture:{id}{}", if open { "-open" } else { "" });
    if torture::shown(&name).is_none() {
        return exit::because(&torture::why_not_shown(id, open), exit::BAD_COMMAND_LINE);
    }
    match Cli::try_parse_from(["penumbra", &name]) {
        Ok(cli) => window::run(&cli.window),
        Err(error) => exit::because(&error, exit::BAD_COMMAND_LINE),
    }
}

/// Those of these names, which commas may part, each once.
fn chosen(all: &[Case], wanted: &[String]) -> Result<Vec<Case>, String> {
    if wanted.is_empty() {
        return Ok(all.to_vec());
    }
    let mut cases: Vec<Case> = Vec::new();
    for id in wanted.iter().flat_map(|list| list.split(',')).map(str::trim) {
        let case = all.iter().find(|case| case.id.eq_ignore_ascii_case(id));
        let case = case.ok_or_else(|| format!("--case {id}: there is no such case; --list names them"))?;
        if cases.iter().all(|other| other.id != case.id) {
            cases.push(*case);
        }
    }
    Ok(cases)
}

fn print(tried: &[Tried], args: &TortureArgs) -> serde_json::Result<()> {
    if args.json {
        line(torture::json(tried)?);
    } else if args.markdown {
        line(torture::markdown(tried).trim_end());
    } else {
        for [id, title, count, ours, limit, verdict] in torture::rows(tried) {
            line(format_args!(
                "{id:<4} {verdict:<9} {title}\n     tried {count}\n     ours  {ours}\n     limit {limit}"
            ));
        }
    }
    Ok(())
}
