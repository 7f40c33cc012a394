//! Pictures of degenerate files without a NaN. (Of others, and normals and narrow gaps: cases G5 and G8 of `torture`.)

#[path = "support/mod.rs"]
mod support;

use glam::{DVec3, UVec2};
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::trace::Film;
use support::shared;

fn picture(path: std::path::PathBuf) -> Result<Film, String> {
    let wishes = Wishes { size: Some(UVec2::new(32, 24)), ..Wishes::default() };
    let mut opened = open(&SceneSource::File(path), &LoadOptions::default(), &wishes)
        .map_err(|error| error.to_string())?;
    opened.app.world.resource_mut::<FrameBudget>().sample_target = 4;
    loop {
        opened.app.frame();
        if opened.app.world.resource::<FrameStats>().done {
            break;
        }
    }
    Ok(opened.app.world.resource::<Film>().clone())
}

/// Slivers, triangles without area, 12 orders of magnitude in one object: no pixel that is no number. Areas are
/// compared with the table in `shared_scenes.rs`.
#[test]
fn no_pixel_of_a_degenerate_scene_is_no_number() {
    let Some(shared) = shared("no_pixel_of_a_degenerate_scene_is_no_number") else {
        return;
    };
    let mut seen = 0;
    for file in [
        "bad-input/own/index_degenerate.gltf",
        "bad-input/own/position_denormal.gltf",
        "bad-input/own/scale_zero_axis.gltf",
        "bad-input/own/scale_1e-20.gltf",
        "bad-input/own/scale_mixed.gltf",
        "bad-input/own/position_1e30.gltf",
        "scenes/obj/legocar/legocar.obj",
        "scenes/obj/kitchen/kitchen.obj",
        "scenes/obj/capsule/capsule.obj",
    ] {
        let film = match picture(shared.join(file)) {
            Ok(film) => film,
            Err(refused) => {
                println!("{file}: refused: {refused}");
                assert!(file.contains("position_"), "only these may be refused");
                continue;
            }
        };
        let size = film.size();
        let means = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
        let means: Vec<DVec3> = means.map(|(x, y)| film.pixel(x, y).mean()).collect();
        assert_eq!(film.dropped(), 0, "{file}: samples that are not finite");
        assert!(means.iter().all(|mean| mean.is_finite() && mean.min_element() >= 0.0), "{file}");
        let lit = means.iter().filter(|mean| mean.max_element() > 0.0).count();
        println!("{file}: {lit} of {} pixels are lit", means.len());
        seen += usize::from(lit > 0);
    }
    assert!(seen >= 5, "{seen} pictures are not black");
}
