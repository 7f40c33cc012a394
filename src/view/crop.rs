//! A part of the picture that alone is refined.

use super::controls::{Notice, Notices};
use super::input::Input;
use super::keymap::Tap;
use crate::app::FrameBudget;
use crate::trace::RenderSettings;
use bevy_ecs::prelude::*;
use glam::{DVec2, UVec2};

/// Sizes that the key goes through, as shares of the picture's sides.
const SHARES: [f64; 3] = [0.33, 0.5, 0.16];

/// The key: around the cursor, or all again; with Shift the next size. The mouse: what was drawn.
pub fn change_region(
    input: Res<Input>,
    settings: Res<RenderSettings>,
    mut budget: ResMut<FrameBudget>,
    mut notices: ResMut<Notices>,
    mut share: Local<usize>,
) {
    let mut wanted = budget.region;
    // The same part of a picture of another size.
    if let (Some([min, max]), Some(size)) = (wanted, input.resize.filter(|&size| size != settings.size)) {
        let part = |at: UVec2| at.as_dvec2() / settings.size.as_dvec2();
        let end = size.max(UVec2::ONE);
        let least = [min.min(end - 1), min.min(end - 1) + 1];
        wanted = region([part(min), part(max)], size).or(Some(least));
    }
    for press in input.taps.iter().filter(|press| press.tap == Tap::Crop) {
        *share = if press.shift { (*share + 1) % SHARES.len() } else { *share };
        wanted = if wanted.is_some() && !press.shift {
            None
        } else {
            let half = DVec2::splat(0.5 * SHARES[*share]);
            region([press.cursor - half, press.cursor + half], settings.size)
        };
    }
    if let Some(drawn) = input.region {
        wanted = region(drawn, settings.size);
    }
    if wanted != budget.region {
        budget.region = wanted;
        let said = match wanted {
            Some([min, max]) => format!("refining only {} × {} pixels", max.x - min.x, max.y - min.y),
            None => "refining all".to_owned(),
        };
        notices.0.push(Notice::Text(said));
    }
}

/// The pixels between two places of the picture, whose corners are at 0 and 1; `None` if there are none.
fn region([a, b]: [DVec2; 2], size: UVec2) -> Option<[UVec2; 2]> {
    let at = |place: DVec2| (place.clamp(DVec2::ZERO, DVec2::ONE) * size.as_dvec2()).round().as_uvec2();
    let (min, max) = (at(a.min(b)), at(a.max(b)));
    max.cmpgt(min).all().then_some([min, max])
}

/// Draws the outline of a rectangle, light over dark and dark over light.
pub fn outline(bytes: &mut [u8], size: UVec2, [min, max]: [UVec2; 2]) {
    if max.cmple(min).any() || size.cmpeq(UVec2::ZERO).any() {
        return;
    }
    let (min, last) = (min.min(size - 1), (max - 1).min(size - 1));
    let mut invert = |x: u32, y: u32| {
        let at = (y as usize * size.x as usize + x as usize) * 4;
        let light = bytes[at..at + 3].iter().map(|&c| u32::from(c)).sum::<u32>() < 384;
        bytes[at..at + 3].fill(if light { 230 } else { 30 });
    };
    // Each pixel once, also where two sides are one.
    for y in min.y..=last.y {
        let step = if y == min.y || y == last.y { 1 } else { (last.x - min.x).max(1) };
        for x in (min.x..=last.x).step_by(step as usize) {
            invert(x, y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::input::Press;
    use super::*;
    use std::time::Instant;

    fn run(inputs: &[(&[(Tap, bool)], Option<[DVec2; 2]>)]) -> Vec<Option<[UVec2; 2]>> {
        let mut world = World::new();
        world.insert_resource(RenderSettings { size: UVec2::new(100, 60), ..RenderSettings::default() });
        world.init_resource::<FrameBudget>();
        world.init_resource::<Notices>();
        let mut schedule = Schedule::default();
        schedule.add_systems(change_region);
        let step = |(taps, drawn): &(&[(Tap, bool)], Option<[DVec2; 2]>)| {
            let mut input = Input::new(Instant::now());
            input.taps = taps.iter().map(|&(tap, shift)| Press { shift, ..Press::from(tap) }).collect();
            input.region = *drawn;
            world.insert_resource(input);
            schedule.run(&mut world);
            world.resource::<FrameBudget>().region
        };
        inputs.iter().map(step).collect()
    }

    #[test]
    fn the_key_alone_sets_sizes_and_clears_the_region() {
        let (key, shifted) = ([(Tap::Crop, false)], [(Tap::Crop, true)]);
        let regions = run(&[(&key, None), (&shifted, None), (&[], None), (&key, None), (&key, None)]);
        let around = |x: u32, y: u32| Some([UVec2::new(50 - x, 30 - y), UVec2::new(50 + x, 30 + y)]);
        assert_eq!(regions[1..4], [around(25, 15), around(25, 15), None]);
        assert_eq!(regions[4], around(25, 15), "the size is remembered");
        assert!(regions[0].is_some());
    }

    #[test]
    fn the_region_goes_with_the_picture_through_all_its_sizes() {
        let mut world = World::new();
        world.insert_resource(RenderSettings { size: UVec2::new(100, 60), ..RenderSettings::default() });
        let region = Some([UVec2::new(50, 15), UVec2::new(75, 45)]);
        world.insert_resource(FrameBudget { region, ..FrameBudget::default() });
        world.init_resource::<Notices>();
        let mut schedule = Schedule::default();
        schedule.add_systems(change_region);
        let mut resize = |size: UVec2| {
            let mut input = Input::new(Instant::now());
            input.resize = Some(size);
            world.insert_resource(input);
            schedule.run(&mut world);
            world.resource_mut::<RenderSettings>().size = size;
            world.resource::<FrameBudget>().region
        };
        assert_eq!(resize(UVec2::new(200, 120)), region.map(|corners| corners.map(|at| at * 2)));
        assert_eq!(resize(UVec2::new(100, 60)), region);
        let tiny = resize(UVec2::ONE).unwrap();
        assert_eq!(tiny, [UVec2::ZERO, UVec2::ONE], "never nothing");
    }

    #[test]
    fn what_is_drawn_is_within_the_picture_and_a_line_is_nothing() {
        let drawn = |a: [f64; 2], b: [f64; 2]| Some([DVec2::from(a), DVec2::from(b)]);
        let none: &[(Tap, bool)] = &[];
        let regions = run(&[(none, drawn([0.9, 0.5], [-0.2, 0.25])), (none, drawn([0.5, 0.1], [0.5, 0.9]))]);
        assert_eq!(regions, [Some([UVec2::new(0, 15), UVec2::new(90, 30)]), None]);
    }

    #[test]
    fn an_outline_is_seen_on_any_picture_and_stays_in_it() {
        for (size, shade) in [(UVec2::new(9, 7), 10), (UVec2::new(9, 7), 240), (UVec2::ONE, 0)] {
            let mut bytes = vec![shade; size.element_product() as usize * 4];
            outline(&mut bytes, size, [UVec2::new(2, 1), UVec2::new(7, 20)]);
            let changed = bytes.chunks_exact(4).filter(|p| p[0].abs_diff(shade) > 100).count();
            assert_eq!(changed, if size == UVec2::ONE { 1 } else { 2 * 5 + 2 * 4 });
        }
    }
}
