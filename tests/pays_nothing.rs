//! A scene with no mirrors, textures, alpha or many lights does nothing for them: counted.

#[path = "support/features.rs"]
mod features;

use features::{NEEDS, Needs, cornell, cornell_with, cornell_with_lamps};
use penumbra::app::App;
use penumbra::sync::traceable;
use penumbra::trace::{FeatureCounts, Film, Integrator, RayCounts, trace_pass};

fn traced(app: &App) -> (Film, RayCounts) {
    let scene = traceable(&app.world);
    let mut film = Film::new(scene.settings.size, 0);
    let rays = trace_pass(&scene, &mut film, 8, 8, || true);
    (film, rays)
}

/// Which of the counts are above zero: mirror rays, texture lookups, alpha tests, choices among lights.
fn which(counts: FeatureCounts) -> [bool; 4] {
    let FeatureCounts { mirror_rays, texture_lookups, alpha_tests, light_choices } = counts;
    [mirror_rays, texture_lookups, alpha_tests, light_choices].map(|count| count > 0)
}

#[test]
fn a_plain_scene_does_nothing_for_what_it_has_not_got() {
    for integrator in [Integrator::Direct, Integrator::Path] {
        let (plain, rays) = traced(&cornell(40, integrator));
        assert_eq!(rays.features, FeatureCounts::default(), "{integrator:?}");
        assert!(rays.camera == 40 * 40 * 8 && rays.shadow > 0);
        // What is there and nobody sees changes neither that nor the picture.
        for needs in NEEDS {
            let (film, counts) = traced(&cornell_with(needs, false, 40, integrator));
            assert_eq!(counts.features, FeatureCounts::default(), "{needs:?} unseen, {integrator:?}");
            assert!(film == plain, "{needs:?} unseen, {integrator:?}: another picture");
        }
    }
}

#[test]
fn what_a_scene_has_is_counted() {
    for (needs, expected) in [
        (Needs::Mirror, [true, false, false, false]),
        (Needs::Texture, [false, true, false, false]),
        (Needs::Alpha, [false, false, true, false]),
    ] {
        for integrator in [Integrator::Direct, Integrator::Path] {
            let (_, rays) = traced(&cornell_with(needs, true, 40, integrator));
            assert_eq!(which(rays.features), expected, "{needs:?}, {integrator:?}: {rays:?}");
        }
    }
    let (_, rays) = traced(&cornell_with_lamps(40));
    assert_eq!(which(rays.features), [false, false, false, true], "{rays:?}");
    let (_, rays) = traced(&cornell_with(Needs::Mirror, true, 40, Integrator::Direct));
    // The square fills a good part of the picture, and every camera ray to it is mirrored once at least.
    let mirrored = rays.features.mirror_rays;
    assert!(mirrored > rays.camera / 8 && mirrored <= rays.bounce, "{rays:?}");
}
