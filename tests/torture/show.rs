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

/// Of all geometric cases there is something to see; where rays can be marked, none is, but in the broken one.
#[test]
fn what_is_sound_has_no_mark_and_what_is_broken_has_many() {
    for (case, rays) in
        [("G1", "400000 rays"), ("G2", "20000 rays"), ("G4", "5000 rays"), ("G5", "12000 rays")]
    {
        let (said, _) = opened(&format!("torture:{case}"));
        assert!(said.contains(&format!(": 0 of {rays}")), "{case}: {said}");
        let (said, _) = opened(&format!("torture:{case}-open"));
        assert!(said.contains(&format!(" of {rays}")) && !said.contains(": 0 of"), "{case}: {said}");
        println!("{said}");
    }
    for id in penumbra::torture::cases().iter().map(|case| case.id).filter(|id| id.starts_with(['G', 'C'])) {
        assert!(shown(&format!("torture:{id}")).is_some(), "{id}");
    }
}

#[test]
fn every_scene_can_be_looked_at() {
    for made in shows() {
        let (said, brightest) = opened(made.name);
        assert!(!said.is_empty(), "{}", made.name);
        // What is left of a room in coarse floats may be anything.
        if made.name != "torture:G7-open" {
            assert_eq!(brightest > 0.0, made.name != "torture:G5-room", "{}: {brightest}", made.name);
        }
    }
    assert!(shown("torture:g1").is_some() && shown("G1").is_none());
}
