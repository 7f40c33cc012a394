//! The window, or a picture where there is none.

use crate::headless;
#[cfg(feature = "view")]
use crate::{exit, signal::set_threads};
use penumbra::cli::WindowArgs;
#[cfg(feature = "view")]
use penumbra::{
    app::FrameBudget, farm::Identity, open::open, reference::Reference, shown::Shown, trace::RenderSettings,
};

/// Where the window comes to rest, if nobody says.
#[cfg(feature = "view")]
const WINDOW_SAMPLES: u32 = 1024;

#[cfg(not(feature = "view"))]
pub fn run(args: &WindowArgs) -> u8 {
    eprintln!("built without the window (feature `view`): rendering to a picture instead");
    instead_of_window(args)
}

#[cfg(feature = "view")]
pub fn run(args: &WindowArgs) -> u8 {
    use penumbra::view::bookmarks::{self, Bookmarks};
    use penumbra::view::{ViewError, ViewOptions};
    let source = match args.scene.source() {
        Ok(source) => source,
        Err(error) => return exit::because(&error, exit::SCENE_NOT_READABLE),
    };
    set_threads(args.scene.threads);
    let (keys, notice) = match penumbra::view::keys_file::read(args.keys.as_deref()) {
        Ok(keys) => (keys, String::new()),
        // Whoever named no file may not see what is printed.
        Err(error) if args.keys.is_none() => (
            penumbra::view::keymap::Keymap::default(),
            format!("keys.toml ignored, usual keys in use: {error}"),
        ),
        Err(error) => return exit::because(&error, exit::BAD_COMMAND_LINE),
    };
    if !notice.is_empty() {
        eprintln!("{notice}");
    }
    let replay = args.replay.as_deref().map(penumbra::view::replay::Replay::open).transpose();
    let record = args.record.as_deref().map(penumbra::view::replay::Recorder::create).transpose();
    let (replay, record) = match replay.and_then(|replay| Ok((replay, record?))) {
        Ok(both) => both,
        Err(error) => return exit::because(&error, exit::BAD_COMMAND_LINE),
    };
    let replays = replay.is_some();
    let reference = match args.output.reference.as_deref().map(Reference::open).transpose() {
        Ok(reference) => reference,
        Err(error) => return exit::because(&error, exit::FAILED),
    };
    let (wishes, even) = (args.scene.wishes(&args.output), args.scene.even);
    let options = ViewOptions {
        title: format!("Penumbra – {}", source.name()),
        size: wishes.size.unwrap_or(RenderSettings::default().size),
        in_points: wishes.size.is_none(),
        folder: source.folder(),
        screenshot_stem: source.name(),
        reference: reference.as_ref().map(|reference| reference.picture.clone()),
        keys,
        notice,
        replay,
        record,
        exit_after: None,
    };
    let (bookmarks, wrong) = bookmarks::default_path().map(Bookmarks::kept_in).unwrap_or_default();
    if let Some(why) = wrong {
        eprintln!("warning: no bookmarks: {why}");
    }
    let mut load = args.scene.load_options();
    let (only_film, never_smooth) = (args.no_kept_samples, args.no_smoothing);
    let opened = penumbra::view::run(options, move |watcher| {
        load.watcher = watcher;
        match open(&source, &load, &wishes) {
            Ok(mut opened) => {
                let mut shown = opened.app.world.resource_mut::<Shown>();
                (shown.only_film, shown.never_smooth) = (only_film, never_smooth);
                headless::tell(&opened.report);
                if let Some(reference) = reference.as_ref().filter(|reference| reference.seed().is_some()) {
                    let identity = Identity::of(&opened.app.world, source.name());
                    if let Err(error) = reference.is_independent(&identity, 0..u32::MAX) {
                        eprintln!("warning: {error}");
                    }
                }
                let mut budget = opened.app.world.resource_mut::<FrameBudget>();
                budget.sample_target = opened.samples.unwrap_or(WINDOW_SAMPLES);
                budget.adaptive = opened.samples.is_none() && !even;
                opened.app.world.insert_resource(bookmarks);
                Ok(opened.app)
            }
            Err(error) => Err(error.to_string()),
        }
    });
    match opened {
        Ok(response) => {
            if replays {
                crate::print::line(response.json());
            }
            0
        }
        Err(ViewError::NoDisplay(why)) => {
            eprintln!("no window: {why}; rendering to a picture instead");
            instead_of_window(args)
        }
        Err(ViewError::Scene(error)) => exit::because(&error, exit::SCENE_NOT_READABLE),
        Err(error) => exit::because(&error, exit::FAILED),
    }
}

/// Renders what the window would have shown to a picture.
fn instead_of_window(args: &WindowArgs) -> u8 {
    headless::render_to(&args.scene, &args.output, vec![headless::picture_of(&args.scene)])
}
