//! The picture that this one is compared with: a reference, or one that was kept.

use super::controls::{Notice, Notices};
use super::debug::Debug;
use super::edit::Editor;
use super::input::Input;
use super::instrument::Instrument;
use super::keymap::Tap;
use super::screenshot::scale_into;
use crate::app::FrameBudget;
use crate::image::compare::LinearImage;
use crate::image::develop::develop_linear;
use crate::image::{Display, Picture};
use crate::preview::Preview;
use crate::trace::Film;
use bevy_ecs::prelude::*;
use glam::{UVec2, Vec4};
use std::sync::Arc;

/// What there is to compare with, and how. The reference itself is the [`Instrument`]'s.
#[derive(Resource, Clone, Debug, Default)]
pub struct Sides {
    kept: Option<Kept>,
    /// The reference, although something was kept.
    prefers_reference: bool,
    /// Both side by side.
    split: bool,
}

#[derive(Clone, Debug)]
enum Kept {
    /// To be developed as the film is.
    Light(LinearImage),
    /// What stood for something else than light.
    Colors(Picture),
}

/// The picture to compare with, as it is shown.
#[derive(Clone, Debug)]
pub struct Side {
    /// Which one it is.
    pub name: &'static str,
    /// Its colours.
    pub picture: Picture,
}

/// What the window needs for comparing.
#[derive(Resource, Clone, Debug, Default)]
pub struct Compared {
    /// The other picture, if there is one.
    pub side: Option<Arc<Side>>,
    /// Whether it is shown to the left of this one.
    pub split: bool,
}

impl Compared {
    /// Whether it is the very same.
    #[must_use]
    pub fn is(&self, other: &Self) -> bool {
        let same = match (&self.side, &other.side) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        same && self.split == other.split
    }
}

impl Sides {
    /// Whether both pictures are shown side by side.
    #[must_use]
    pub fn are_split(&self) -> bool {
        self.split
    }

    fn shows_reference(&self, instrument: &Instrument) -> bool {
        instrument.reference.is_some() && (self.prefers_reference || self.kept.is_none())
    }

    /// As it is to be shown.
    fn side(&self, instrument: &Instrument, display: &Display) -> Option<Side> {
        if self.shows_reference(instrument) {
            let image = &instrument.reference.as_ref()?.image;
            return Some(Side { name: "reference", picture: developed(image, display) });
        }
        let picture = match self.kept.as_ref()? {
            Kept::Light(image) => developed(image, display),
            Kept::Colors(picture) => picture.clone(),
        };
        Some(Side { name: "kept picture", picture })
    }
}

fn developed(image: &LinearImage, display: &Display) -> Picture {
    let cells: Vec<Vec4> = image.pixels.iter().map(|color| color.extend(0.0)).collect();
    let mut rgba = vec![255; cells.len() * 4];
    develop_linear(&cells, image.size, display, &mut rgba);
    Picture { size: image.size, rgba, version: 0 }
}

/// The film's light; that of the preview while there is no other.
fn light(film: &Film, coarse: Option<&Film>) -> LinearImage {
    let Some(coarse) = coarse.filter(|_| film.mean_samples() == 0.0) else { return LinearImage::of(film) };
    let (size, small) = (film.size(), coarse.size());
    let places = (0..size.y).flat_map(|y| (0..size.x).map(move |x| UVec2::new(x, y) * small / size));
    LinearImage { size, pixels: places.map(|at| coarse.pixel(at.x, at.y).mean().as_vec3()).collect() }
}

/// Keeps the picture, chooses which one to compare with, and splits the window between both.
pub fn change_sides(
    input: Res<Input>,
    (film, preview, picture): (Res<Film>, Res<Preview>, Res<Picture>),
    budget: Res<FrameBudget>,
    instrument: Res<Instrument>,
    (editor, debug): (Res<Editor>, Res<Debug>),
    mut sides: ResMut<Sides>,
    mut notices: ResMut<Notices>,
) {
    for press in &input.taps {
        let has = (sides.kept.is_some(), instrument.reference.is_some());
        let said = match press.tap {
            Tap::Keep => {
                sides.kept = Some(if budget.develop {
                    Kept::Light(light(&film, preview.film()))
                } else {
                    Kept::Colors(picture.clone())
                });
                sides.prefers_reference = false;
                "kept: hold {compare} to see it, {split} for both"
            }
            Tap::OtherSide if has == (true, true) => {
                sides.prefers_reference = !sides.prefers_reference;
                if sides.prefers_reference {
                    "{compare}: the reference"
                } else {
                    "{compare}: the kept picture"
                }
            }
            Tap::OtherSide if has.0 => "there is no reference (--reference FILE)",
            Tap::OtherSide if has.1 => "nothing was kept: {keep} keeps this picture",
            Tap::OtherSide | Tap::Split if !(has.0 || has.1) => {
                "nothing to compare with: {keep} keeps this picture"
            }
            Tap::Split => {
                sides.split = !sides.split;
                continue;
            }
            // One thing at a time is closed.
            Tap::Escape if sides.split && !editor.has_selection() && !debug.is_open() => {
                sides.split = false;
                continue;
            }
            _ => continue,
        };
        notices.0.push(Notice::Text(said.to_owned()));
    }
}

/// Develops the other picture whenever it or the way of showing light is another.
pub fn develop_side(
    sides: Res<Sides>,
    instrument: Res<Instrument>,
    display: Res<Display>,
    mut compared: ResMut<Compared>,
    mut with: Local<Option<Display>>,
) {
    if sides.is_changed() || *with != Some(*display) {
        *with = Some(*display);
        *compared = Compared { side: sides.side(&instrument, &display).map(Arc::new), split: sides.split };
    }
}

/// The line between both pictures.
const LINE: [u8; 4] = [255, 190, 92, 255];

/// Where the one picture has nothing and the other has.
const BESIDE: [u8; 4] = [24, 24, 28, 255];

/// Puts `side` over the left `part` of `bytes`, a picture of `size`, and a line where it ends. A picture of another shape
/// sees as far up and down from the middle, and farther or less far aside.
pub fn cover(bytes: &mut [u8], size: UVec2, side: &Picture, part: f64) {
    let mut scaled = vec![0; bytes.len()];
    let shape = |size: UVec2| f64::from(size.x) / f64::from(size.y.max(1));
    if shape(size) == shape(side.size) {
        scale_into(&side.rgba, side.size, &mut scaled, size);
    } else {
        scale_by_height(side, &mut scaled, size);
    }
    let (stride, end) = (size.x as usize * 4, (part * f64::from(size.x)).round() as usize * 4);
    for (row, other) in bytes.chunks_exact_mut(stride).zip(scaled.chunks_exact(stride)) {
        let end = end.min(stride);
        row[..end].copy_from_slice(&other[..end]);
        if let Some(pixel) = row.get_mut(end..end + 4) {
            pixel.copy_from_slice(&LINE);
        }
    }
}

/// `side` in `to` pixels, as high as these, its middle column in the middle.
fn scale_by_height(side: &Picture, target: &mut [u8], to: UVec2) {
    let from = side.size;
    if from.min_element() == 0 {
        return;
    }
    let scale = f64::from(from.y) / f64::from(to.y);
    let source = |x: u32| (f64::from(x) + 0.5 - 0.5 * f64::from(to.x)) * scale + 0.5 * f64::from(from.x);
    for (y, row) in (0..to.y).zip(target.chunks_exact_mut(to.x as usize * 4)) {
        let line = ((f64::from(y) + 0.5) * scale) as usize * from.x as usize;
        for (x, pixel) in (0..to.x).zip(row.chunks_exact_mut(4)) {
            let at = source(x);
            let is_in = at >= 0.0 && at < f64::from(from.x);
            let found = is_in.then(|| side.rgba.get((line + at as usize) * 4..)?.get(..4)).flatten();
            pixel.copy_from_slice(found.unwrap_or(&BESIDE));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::instrument::{Reference, Seen};
    use super::*;
    use crate::trace::Viewpoint;
    use glam::Vec3;
    use std::time::Instant;

    const SIZE: UVec2 = UVec2::new(4, 1);

    /// A film of light 0.25 and, if wanted, a reference of light 0.5.
    fn world(has_reference: bool) -> (World, Schedule) {
        let mut film = Film::new(SIZE, 0);
        for tile in film.tiles_mut() {
            for pixel in tile.pixels_mut() {
                pixel.add(0, Vec3::splat(0.25));
            }
        }
        let image = LinearImage { size: SIZE, pixels: vec![Vec3::splat(0.5); 4] };
        let reference = has_reference.then(|| Reference::new(image, Viewpoint::default(), Seen::default()));
        let mut world = World::new();
        world.insert_resource(film);
        world.insert_resource(Instrument::against(reference));
        world.insert_resource(FrameBudget { develop: true, ..FrameBudget::default() });
        world.init_resource::<Preview>();
        world.init_resource::<Picture>();
        world.init_resource::<Display>();
        world.init_resource::<Editor>();
        world.init_resource::<Debug>();
        world.init_resource::<Sides>();
        world.init_resource::<Compared>();
        world.init_resource::<Notices>();
        let mut schedule = Schedule::default();
        schedule.add_systems((change_sides, develop_side).chain());
        (world, schedule)
    }

    /// The name of the other picture after these keys, and how bright it is.
    fn press(world: &mut World, schedule: &mut Schedule, taps: &[Tap]) -> Option<(&'static str, u8)> {
        let mut input = Input::new(Instant::now());
        input.taps = taps.iter().map(|&tap| tap.into()).collect();
        world.insert_resource(input);
        schedule.run(world);
        world.resource::<Compared>().side.as_ref().map(|side| (side.name, side.picture.rgba[0]))
    }

    #[test]
    fn the_reference_stays_when_a_picture_is_kept() {
        let (mut world, mut schedule) = world(true);
        let mut press = |taps: &[Tap]| press(&mut world, &mut schedule, taps).map(|(name, _)| name);
        assert_eq!(press(&[]), Some("reference"));
        assert_eq!(press(&[Tap::Keep]), Some("kept picture"));
        assert_eq!(press(&[Tap::OtherSide]), Some("reference"));
        assert_eq!(press(&[Tap::OtherSide]), Some("kept picture"));
    }

    #[test]
    fn the_other_picture_is_exposed_as_this_one_is() {
        for (has_reference, taps) in [(true, &[][..]), (false, &[Tap::Keep])] {
            let (mut world, mut schedule) = world(has_reference);
            let (_, before) = press(&mut world, &mut schedule, taps).unwrap();
            world.resource_mut::<Display>().exposure = -2.0;
            let (_, after) = press(&mut world, &mut schedule, &[]).unwrap();
            assert!(after + 40 < before, "{before} {after}");
        }
    }

    #[test]
    fn without_another_picture_there_is_nothing_to_split() {
        let (mut world, mut schedule) = world(false);
        assert_eq!(press(&mut world, &mut schedule, &[Tap::Split]), None);
        assert!(!world.resource::<Compared>().split);
        assert_eq!(world.resource::<Notices>().0.len(), 1);
        press(&mut world, &mut schedule, &[Tap::Keep, Tap::Split]);
        assert!(world.resource::<Compared>().split);
        press(&mut world, &mut schedule, &[Tap::Escape]);
        assert!(!world.resource::<Compared>().split);
    }

    #[test]
    fn left_of_the_line_is_the_other_picture_and_right_of_it_this_one() {
        let side = Picture { size: SIZE, rgba: vec![9; 16], version: 0 };
        for (part, shades) in
            [(0.5, vec![9, 9, 255, 100]), (1.0, vec![9; 4]), (0.0, vec![255, 100, 100, 100])]
        {
            let mut bytes = vec![100; 16];
            cover(&mut bytes, SIZE, &side, part);
            let seen: Vec<u8> = bytes.chunks_exact(4).map(|pixel| pixel[0]).collect();
            assert_eq!(seen, shades, "{part}");
        }
    }

    #[test]
    fn a_picture_of_another_shape_lies_on_its_middle() {
        let pixel = |shade: u8| [shade, shade, shade, 255];
        // Three columns, of which two fit; and one that leaves room on both sides.
        let wide = Picture { size: UVec2::new(3, 1), rgba: [7, 8, 9].map(pixel).concat(), version: 0 };
        let narrow = Picture { size: UVec2::new(1, 2), rgba: [5, 6].map(pixel).concat(), version: 0 };
        for (side, size, wanted) in [
            (&wide, UVec2::new(6, 2), vec![7, 7, 8, 8, 9, 9, 7, 7, 8, 8, 9, 9]),
            (&wide, UVec2::new(2, 2), vec![8, 8, 8, 8]),
            (&narrow, UVec2::new(3, 2), vec![24, 5, 24, 24, 6, 24]),
        ] {
            let mut bytes = vec![0; size.element_product() as usize * 4];
            cover(&mut bytes, size, side, 1.0);
            let seen: Vec<u8> = bytes.chunks_exact(4).map(|pixel| pixel[0]).collect();
            assert_eq!(seen, wanted);
        }
    }
}
