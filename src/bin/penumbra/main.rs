//! The `penumbra` command: arguments in, exit code out. The one place that prints.

mod bar;
mod check;
mod compare;
mod exit;
mod headless;
mod merge;
mod print;
mod report;
mod signal;
mod torture;
mod window;

use clap::{CommandFactory, Parser};
use penumbra::cli::{Cli, Command};
use penumbra::load::built_in_scenes;
use std::path::Path;
use std::process::ExitCode;

/// Pictures come in changing sizes for hours: glibc's allocator keeps most of what was freed between them.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let code = match cli.command {
        Some(Command::Render(args)) => {
            let output = args.output.clone();
            match args.scene() {
                Ok(scene) => headless::run(&scene, &output),
                Err(error) => exit::because(&error, exit::BAD_COMMAND_LINE),
            }
        }
        Some(Command::Completions(args)) => {
            clap_complete::generate(args.shell, &mut Cli::command(), "penumbra", &mut std::io::stdout());
            0
        }
        Some(Command::Man(args)) => manual(args.folder.as_deref()),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::Compare(args)) => compare::run(&args),
        Some(Command::Merge(args)) => merge::run(&args),
        Some(Command::Report(args)) => report::run(&args),
        Some(Command::Torture(args)) => torture::run(&args),
        None if cli.window.list_scenes => {
            for scene in built_in_scenes() {
                print::line(format_args!("{:<15} {}", scene.name, scene.description));
            }
            0
        }
        None if !cli.window.output.output.is_empty() => headless::run(&cli.window.scene, &cli.window.output),
        None => window::run(&cli.window),
    };
    ExitCode::from(code)
}

/// Prints the manual page of the program, or writes that of each command into `folder`.
fn manual(folder: Option<&Path>) -> u8 {
    let Some(folder) = folder else {
        // Whoever closed standard output does not want to read it.
        return u8::from(clap_mangen::Man::new(Cli::command()).render(&mut std::io::stdout()).is_err());
    };
    let written =
        std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(Cli::command(), folder));
    match written {
        Ok(()) => 0,
        Err(error) => exit::because(&format!("{}: {error}", folder.display()), exit::FAILED),
    }
}
