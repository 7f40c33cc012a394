//! Cases to look at.

use glam::UVec2;
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::torture::{shown, shows};
use penumbra::trace::Film;

/// What is said of the scene, and the greatest mean of its pixels.
fn opened(name: &str) -> (String, f64) {
    let source = SceneSource::Made(shown(name).expect("there is such a scene"));
    let wishes = Wishes { size: Some(UVec2::new(48, 36)), ..Wishes::default() };
    let mut opened = open(&source, &LoadOptions::default(), &wishes).expect("nothing can go wrong");
    opened.app.world.resource_mut::<FrameBudget>().sample_target = 2;
    loop {
        opened.app.frame();
        if opened.app.world.resource::<FrameStats>().done {
            break;
        }
    }
    let film = opened.app.world.resource::<Film>();
    let pixels = (0..48 * 36).map(|i| film.pixel(i % 48, i / 48).mean().max_element());
    (opened.report.decisions().join("\n"), pixels.fold(0.0, f64::max))
}

#[test]
fn a_sound_mesh_shows_no_leak_and_an_open_one_shows_many() {
    let (said, _) = opened("torture:G1");
    assert!(said.contains(": 0 of 400000 rays"), "{said}");
    let (said, _) = opened("torture:G1-open");
    assert!(said.contains("rays aimed at edges and corners leak"), "{said}");
    assert!(!said.contains(": 0 of"), "{said}");
}

#[test]
fn every_scene_can_be_looked_at() {
    for made in shows() {
        let (said, brightest) = opened(made.name);
        assert!(!said.is_empty(), "{}", made.name);
        assert_eq!(brightest > 0.0, made.name != "torture:G5-room", "{}: {brightest}", made.name);
    }
    assert!(shown("torture:g1").is_some() && shown("G1").is_none());
}
