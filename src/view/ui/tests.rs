use super::super::debug::Told;
use super::super::edit::EditStatus;
use super::super::edit::property::Row;
use super::super::status::tests::status;
use super::*;
use glam::DVec2;
use std::sync::Arc;
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

/// What there is to show, with nothing open.
fn content<'a>(
    status: Option<&'a Status>,
    notice: &'a str,
    keys: &'a Keymap,
    letters: &'a Letters,
) -> Content<'a> {
    Content {
        status,
        measured: Measured::default(),
        loading: None,
        hint: false,
        notice,
        compared: None,
        keys,
        letters,
    }
}

fn drawn(size: UVec2, display: f64, change: impl FnOnce(&mut Ui), background: u8) -> Vec<u8> {
    let (status, keys, letters) = (status(), Keymap::default(), Letters::default());
    let content = content(Some(&status), "saved cornell_1.png", &keys, &letters);
    let mut ui = Ui::default();
    change(&mut ui);
    let mut rgba = vec![background; size.element_product() as usize * 4];
    ui.draw(&mut rgba, size, display, &content);
    rgba
}

#[test]
fn text_is_light_on_dark_over_any_background() {
    let size = UVec2::new(640, 360);
    for background in [0, 128, 255] {
        let rgba = drawn(size, 1.0, |_| {}, background);
        let changed = rgba.chunks_exact(4).filter(|p| p[0] != background);
        let (dark, light) = changed.fold((0, 0), |(dark, light), p| {
            (dark + usize::from(p[1] < 90), light + usize::from(p[1] > 200))
        });
        assert!(dark > 4000 && light > 200, "on {background}: {dark} dark, {light} light");
    }
}

#[test]
fn everything_goes_into_a_window_of_any_size_on_any_display() {
    for (width, height) in [(1, 1), (3, 200), (200, 3), (40, 30), (321, 241), (1920, 1080)] {
        for display in [0.0, 1.0, 1.25, 2.0, 3.5] {
            let open = |ui: &mut Ui| {
                ui.help.turn();
                (ui.graph, ui.level) = (true, Level::All);
                (ui.report, ui.prompt) = (true, Some(open::Prompt::new("")));
            };
            drawn(UVec2::new(width, height), display, open, 90);
        }
    }
}

/// What selects a thing with so many numbers.
fn edited(rows: usize) -> EditStatus {
    let row = |i: usize| Row {
        property: Property::Position(i % 3),
        label: "x",
        value: 1.0,
        step: 0.1,
        grows: false,
        range: [-1e3, 1e3],
    };
    EditStatus { name: format!("{rows}"), rows: (0..rows).map(row).collect(), ..EditStatus::default() }
}

#[test]
fn cards_grow_with_what_they_have_to_say() {
    let (keys, letters, size) = (Keymap::default(), Letters::default(), UVec2::new(640, 480));
    let see = |ui: &mut Ui, loading: &'static str, rows: usize| {
        let status = Status { edit: Some(Arc::new(edited(rows))), ..status() };
        let content = Content { loading: Some(loading), ..content(Some(&status), "", &keys, &letters) };
        let mut rgba = vec![90; size.element_product() as usize * 4];
        ui.draw(&mut rgba, size, 1.0, &content);
        rgba
    };
    let later = ("loading a large scene: decompressing 35 %", 14);
    let mut grown = Ui::default();
    see(&mut grown, "loading", 3);
    assert!(see(&mut grown, later.0, later.1) == see(&mut Ui::default(), later.0, later.1));
}

#[test]
fn the_card_of_a_pixel_leaves_the_pixel_free() {
    let (keys, letters, size) = (Keymap::default(), Letters::default(), UVec2::new(640, 400));
    for pixel in [UVec2::new(60, 370), UVec2::new(600, 370), UVec2::new(320, 20), UVec2::new(20, 200)] {
        let mut told = Told::default();
        told.explanation.pixel = pixel;
        let debug = DebugStatus { told: Some(Arc::new(told)), ..DebugStatus::default() };
        let status = Status { debug, size, ..status() };
        let mut ui = Ui { level: Level::None, ..Ui::default() };
        let mut rgba = vec![90; size.element_product() as usize * 4];
        ui.draw(&mut rgba, size, 1.0, &content(Some(&status), "", &keys, &letters));
        assert_eq!(rgba[(4 * (pixel.y * size.x + pixel.x)) as usize], 90, "{pixel}");
        let covered = rgba.chunks_exact(4).filter(|p| p[0] != 90).count();
        assert!(covered > 10_000, "{covered} pixels of the card");
    }
}

#[test]
fn every_page_of_the_help_is_inside_the_window() {
    let (keys, letters) = (Keymap::default(), Letters::default());
    let content = content(None, "", &keys, &letters);
    for (width, height, most) in
        [(1920, 1080, 1), (960, 540, 1), (700, 450, 2), (640, 400, 3), (320, 240, 6), (200, 600, 12)]
    {
        let mut ui = Ui { level: Level::None, ..Ui::default() };
        let mut pages = 0;
        ui.help.turn();
        while ui.help.is_open() {
            let mut rgba = Vec::new();
            for _ in 0..2 {
                rgba = vec![90; (4 * width * height) as usize];
                ui.draw(&mut rgba, UVec2::new(width, height), 1.0, &content);
            }
            let drawn = |x: u32, y: u32| rgba[(4 * (y * width + x)) as usize] != 90;
            let rim = (0..width).any(|x| drawn(x, 0) || drawn(x, height - 1))
                || (0..height).any(|y| drawn(0, y) || drawn(width - 1, y));
            assert!(!rim, "page {pages} in {width}x{height} is cut");
            assert!(drawn(width / 2, height / 2));
            pages += 1;
            ui.help.turn();
        }
        assert!((1..=most).contains(&pages), "{pages} pages in {width}x{height}");
    }
}

#[test]
fn nothing_is_drawn_if_nothing_is_wanted() {
    let (keys, letters) = (Keymap::default(), Letters::default());
    let now = status();
    let content = content(Some(&now), "", &keys, &letters);
    let mut ui = Ui { level: Level::None, ..Ui::default() };
    assert!(ui.is_bare(&content));
    let mut rgba = vec![77; 100 * 100 * 4];
    ui.draw(&mut rgba, UVec2::splat(100), 1.0, &content);
    assert!(rgba.iter().all(|&c| c == 77));
    // But never a picture that is more than the film, as if it were not.
    let smoothed = Status { smoothed: true, ..status() };
    let content = Content { status: Some(&smoothed), ..content };
    assert!(!ui.is_bare(&content));
    ui.draw(&mut rgba, UVec2::splat(100), 1.0, &content);
    let changed = rgba.iter().filter(|&&c| c != 77).count() / 4;
    assert!((100..5000).contains(&changed), "{changed} pixels");
}

#[test]
fn the_same_twice_is_the_same_to_the_bit() {
    let size = UVec2::new(960, 540);
    let open = |ui: &mut Ui| ui.help.turn();
    assert_eq!(drawn(size, 1.0, open, 50), drawn(size, 1.0, open, 50));
}

#[test]
fn a_click_into_the_picture_takes_the_keyboard_from_the_card() {
    let status = Status { edit: Some(Arc::new(edited(3))), ..status() };
    let (keys, letters) = (Keymap::default(), Letters::default());
    let content = content(Some(&status), "", &keys, &letters);
    let size = UVec2::new(640, 400);
    let mut ui = Ui::default();
    let mut frame = |ui: &mut Ui| ui.draw(&mut vec![0; 640 * 400 * 4], size, 1.0, &content);
    let click = |ui: &mut Ui, frame: &mut dyn FnMut(&mut Ui), at: DVec2| {
        let mut taken = false;
        for pressed in [true, false] {
            ui.pointer(at, (1.0, size));
            taken |= ui.button(MouseButton::Left, pressed);
            frame(ui);
        }
        taken
    };
    frame(&mut ui);
    // Wherever on the card the numbers are.
    let mut down = (0..40).map(|i| DVec2::new(600.0, 20.0 + 5.0 * f64::from(i)));
    assert!(down.any(|at| click(&mut ui, &mut frame, at) && ui.takes_text()), "no number takes text");
    ui.key(KeyCode::Digit7, Some("7"), false);
    frame(&mut ui);
    assert!(!click(&mut ui, &mut frame, DVec2::new(50.0, 300.0)), "the picture gets it as well");
    assert!(!ui.takes_text());
    assert_eq!(ui.edits.last().map(|(_, value)| *value), Some(7.0), "what was typed counts");
}
