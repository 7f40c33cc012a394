//! The engine without a window.

use super::super::controls::{Notice, Notices};
use super::super::input::{Drag, Press};
use super::super::keymap::Hold;
use super::*;
use crate::app::FrameSystems;
use crate::load::{LoadOptions, SceneSource};
use crate::open::{Wishes, open};
use bevy_ecs::prelude::{IntoScheduleConfigs, Res};
use glam::{DVec2, UVec2};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;

/// Raises the interrupt in every frame that a key changes, as a window does that is slow to raise it after its command.
fn raise_late(input: Res<Input>, budget: Res<FrameBudget>) {
    if !input.taps.is_empty() {
        budget.interrupt.store(true, Ordering::SeqCst);
    }
}

/// An engine with two samples of the Cornell box, small.
fn small(presented: Option<Receiver<u64>>) -> (Sender<Command>, Arc<Mutex<Published>>, JoinHandle<()>) {
    let (commands, received) = channel();
    let published = Arc::new(Mutex::new(Published::default()));
    let engine = Engine {
        scene: "cornell".to_owned(),
        reference: None,
        commands: received,
        own: commands.clone(),
        interrupt: Arc::default(),
        published: Arc::clone(&published),
        presented,
        wake: |_| (),
    };
    let engine = std::thread::spawn(move || {
        engine.run(|_| {
            let wishes = Wishes { size: Some(UVec2::new(32, 24)), samples: Some(2), ..Wishes::default() };
            let source = SceneSource::parse("cornell").map_err(|e| e.to_string())?;
            let mut app = open(&source, &LoadOptions::default(), &wishes).map_err(|e| e.to_string())?.app;
            app.world.resource_mut::<FrameBudget>().sample_target = 2;
            app.add_systems(raise_late.in_set(FrameSystems::Update));
            Ok(app)
        });
    });
    (commands, published, engine)
}

#[test]
fn a_window_that_presents_nothing_does_not_stop_the_engine() {
    let (silent, presented) = channel();
    let (commands, published, engine) = small(Some(presented));
    let mut held = [false; Hold::COUNT];
    held[Hold::Forward as usize] = true;
    commands.send(Command::Held { held, at: Instant::now() }).unwrap();
    let (start, mut versions) = (Instant::now(), 0);
    while versions < 5 && start.elapsed() < Duration::from_secs(20) {
        versions += u32::from(lock(&published).picture.take().is_some());
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(versions, 5);
    drop(silent);
    commands.send(Command::Quit).unwrap();
    engine.join().unwrap();
}

#[test]
fn an_interrupt_that_comes_late_keeps_no_picture_back() {
    let (commands, published, engine) = small(None);
    // The picture as soon as all samples are there and `is_wanted`.
    let wait = |is_wanted: &dyn Fn(&[u8]) -> bool| {
        let start = Instant::now();
        let mut last = Vec::new();
        while start.elapsed() < Duration::from_secs(20) {
            let mut published = lock(&published);
            if let Some(picture) = published.picture.take() {
                last = picture.rgba;
            }
            if published.status.as_ref().is_some_and(|s| s.done) && !last.is_empty() && is_wanted(&last) {
                return Some(last);
            }
            drop(published);
            std::thread::sleep(Duration::from_millis(5));
        }
        None
    };
    let beauty = wait(&|_| true).unwrap();
    let view =
        |shift| Command::Tap { press: Press { shift, ..Press::from(Tap::PixelView) }, at: Instant::now() };
    for _ in 0..3 {
        commands.send(view(false)).unwrap();
        assert!(wait(&|rgba| *rgba != *beauty).is_some(), "the noise is not shown");
        commands.send(view(true)).unwrap();
        assert!(wait(&|rgba| *rgba == *beauty).is_some(), "the light is not shown again");
    }
    commands.send(Command::Quit).unwrap();
    engine.join().unwrap();
}

#[test]
fn keys_between_two_frames_act_in_their_order() {
    let at = Instant::now();
    let tap = |tap: Tap| Command::Tap { press: tap.into(), at };
    let drag = || Command::Drag { drag: Drag::Pan, pixels: DVec2::ONE, at };
    let held = || Command::Held { held: [false; Hold::COUNT], at };
    // How many commands each frame takes.
    let frames = |commands: Vec<Command>| {
        let mut waiting = VecDeque::from(commands);
        let counts = std::iter::from_fn(|| Some(of_one_frame(&mut waiting).len()).filter(|&count| count > 0));
        counts.collect::<Vec<usize>>()
    };
    assert!(frames(vec![]).is_empty());
    assert_eq!(frames(vec![tap(Tap::FrameAll), tap(Tap::ResetCamera), tap(Tap::FrameAll)]), [1, 1, 1]);
    assert_eq!(frames(vec![tap(Tap::Brighter), tap(Tap::Brighter), tap(Tap::Darker), drag()]), [2, 2]);
    assert_eq!(frames(vec![held(), drag(), drag(), tap(Tap::PrintCamera), held()]), [3, 2]);
}

/// However many frames the keys before it take.
#[test]
fn a_key_that_is_held_between_others_counts_for_as_long_as_it_was() {
    let start = Instant::now();
    let at = |ms| start + Duration::from_millis(ms);
    let tap = |tap: Tap, ms| Command::Tap { press: tap.into(), at: at(ms) };
    let held = |is: bool, ms| {
        let mut held = [false; Hold::COUNT];
        held[Hold::Forward as usize] = is;
        Command::Held { held, at: at(ms) }
    };
    let seconds = |commands: Vec<Command>| {
        let (mut waiting, mut input, mut sum) = (VecDeque::from(commands), Input::new(start), 0.0);
        while !waiting.is_empty() {
            for command in of_one_frame(&mut waiting) {
                input.apply(&command);
            }
            input.hold_until(counted_until(&waiting, at(500)));
            sum += input.seconds(Hold::Forward);
            input.end_frame();
        }
        sum
    };
    let [a, b] = [Tap::FrameAll, Tap::ResetCamera];
    let behind = seconds(vec![tap(a, 10), tap(b, 20), held(true, 30), held(false, 50)]);
    assert!((behind - 0.02).abs() < 1e-9, "{behind}");
    let around = seconds(vec![held(true, 10), tap(a, 20), held(false, 30)]);
    assert!((around - 0.02).abs() < 1e-9, "{around}");
}

#[test]
fn a_camera_that_is_copied_or_remembered_is_where_it_has_moved_to() {
    let source = SceneSource::parse("cornell").unwrap();
    let wishes = Wishes { size: Some(UVec2::new(32, 24)), samples: Some(1), ..Wishes::default() };
    let mut app = open(&source, &LoadOptions::default(), &wishes).unwrap().app;
    app.world.init_resource::<Instrument>();
    prepare(&mut app, &Arc::default());
    let mut press = |taps: &[Tap]| {
        app.world.resource_mut::<Input>().taps = taps.iter().map(|&tap| tap.into()).collect();
        app.frame();
        app.world.resource_mut::<Input>().end_frame();
        let said = std::mem::take(&mut app.world.resource_mut::<Notices>().0);
        said.into_iter().find(|notice| matches!(notice, Notice::Print(_)))
    };
    let home = press(&[Tap::PrintCamera]);
    let there = press(&[Tap::FrameAll, Tap::Remember(1), Tap::PrintCamera]);
    assert!(there.is_some() && there != home);
    assert_eq!(press(&[Tap::PrintCamera]), there);
    assert_eq!(press(&[Tap::ResetCamera, Tap::PrintCamera]), home);
    press(&[Tap::Recall(1)]);
    assert_eq!(press(&[Tap::PrintCamera]), there);
}

#[test]
fn the_first_picture_of_a_scene_is_whole() {
    let source = SceneSource::parse("cornell").unwrap();
    let wishes = Wishes { size: Some(UVec2::new(160, 160)), ..Wishes::default() };
    let mut app = open(&source, &LoadOptions::default(), &wishes).unwrap().app;
    app.world.init_resource::<Instrument>();
    prepare(&mut app, &Arc::default());
    // As if it had been interrupted at once.
    app.world.resource_mut::<FrameBudget>().time = Some(Duration::ZERO);
    app.frame();
    let picture = app.world.resource::<Picture>();
    let seen = picture.rgba.chunks_exact(4).filter(|pixel| pixel[..3] != [0; 3]).count();
    assert!(seen > 160 * 160 / 2, "{seen} pixels");
    assert!(app.world.resource::<FrameStats>().preview_scale.is_some());
    // And that was it.
    app.world.resource_mut::<Input>().end_frame();
    app.frame();
    assert!(!app.world.resource::<FrameStats>().begun);
}
