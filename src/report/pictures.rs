//! What the page shows: pictures, error maps and the places where the error is largest.

use super::false_color::{ErrorScale, errors, worst};
use super::methods::{METHODS, OURS};
use crate::image::Display;
use crate::image::compare::LinearImage;
use crate::scene::color::srgb_from_linear;
use glam::{UVec2, Vec3};
use image::{ImageFormat, RgbImage};
use std::io::Cursor;

/// All pictures of one scene.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    /// Ours and the reference.
    pub shown: Vec<Shown>,
    /// One for each method that has a picture.
    pub errors: Vec<Shown>,
    /// Three columns: ours, the reference, the error; a row for each of the worst places.
    pub crops: Option<Shown>,
    /// The pixels in the middle of the crops, from the top left.
    pub worst: Vec<[u32; 2]>,
    /// What the colours of the error maps stand for.
    pub scale: Option<ErrorScale>,
}

/// A picture to look at.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Of its file, after the scene's name.
    pub name: String,
    /// For people.
    pub title: String,
    /// Width and height.
    pub size: UVec2,
    /// PNG file.
    pub png: Vec<u8>,
}

/// Places to look at.
const PLACES: usize = 3;
/// Pixels of a crop along a side, and of the sheet for each of them.
const SIDE: u32 = 24;
const ZOOM: u32 = 7;
const GAP: u32 = 8;
const GAP_COLOR: [u8; 3] = [128, 128, 128];

impl Pictures {
    /// From the pictures that methods made, by name, and the reference. Scale and places are chosen by the
    /// pixels of the mask alone, if there is one.
    #[must_use]
    pub fn new(
        kept: &[(&'static str, LinearImage)],
        (reference, surfaces): (&LinearImage, Option<&[bool]>),
        display: &Display,
    ) -> Self {
        let size = reference.size;
        let developed = |picture: &LinearImage| -> Vec<[u8; 3]> {
            picture.pixels.iter().map(|&p| develop(p, display)).collect()
        };
        let truth = developed(reference);
        let maps: Vec<(&'static str, Vec<f64>)> =
            kept.iter().map(|(name, picture)| (*name, errors(picture, reference))).collect();
        let inside = |map: &Vec<f64>| -> Vec<f64> {
            (0..).zip(map).map(|(i, &e)| if surfaces.is_none_or(|s| s[i]) { e } else { 0.0 }).collect()
        };
        let scale = ErrorScale::of(&maps.iter().map(|(_, map)| inside(map)).collect::<Vec<_>>());
        let colored = |map: &[f64]| -> Vec<[u8; 3]> { map.iter().map(|&e| scale.color(e)).collect() };
        let title = |name: &str| METHODS.iter().find(|m| m.name == name).map_or("", |m| m.title);
        let mut pictures = Self { scale: Some(scale), ..Self::default() };
        for (name, map) in &maps {
            let file = format!("error-{name}");
            pictures.errors.push(Shown::new(file, title(name).to_owned(), size, &colored(map)));
        }
        let ours =
            kept.iter().find(|(name, _)| *name == OURS).zip(maps.iter().find(|(name, _)| *name == OURS));
        if let Some(((_, picture), (_, map))) = ours {
            let shown = developed(picture);
            pictures.shown.push(Shown::new(OURS.to_owned(), OURS.to_owned(), size, &shown));
            let places = worst(&inside(map), size, PLACES, SIDE);
            pictures.worst = places.iter().map(UVec2::to_array).collect();
            let sheet = Sheet { size, places: &places, columns: [&shown, &truth, &colored(map)] };
            pictures.crops = (!places.is_empty()).then(|| sheet.draw());
        }
        pictures.shown.push(Shown::new("reference".to_owned(), "reference".to_owned(), size, &truth));
        pictures
    }
}

impl Shown {
    fn new(name: String, title: String, size: UVec2, pixels: &[[u8; 3]]) -> Self {
        let image = RgbImage::from_raw(size.x, size.y, pixels.as_flattened().to_vec()).unwrap_or_default();
        let mut png = Cursor::new(Vec::new());
        // Into memory, in a format that is compiled in: there is nothing to fail.
        let written = image.write_to(&mut png, ImageFormat::Png);
        debug_assert!(written.is_ok());
        Self { name, title, size, png: png.into_inner() }
    }
}

/// Crops of several pictures side by side, enlarged.
struct Sheet<'a> {
    size: UVec2,
    places: &'a [UVec2],
    columns: [&'a [[u8; 3]]; 3],
}

impl Sheet<'_> {
    fn draw(&self) -> Shown {
        let side = UVec2::splat(SIDE).min(self.size);
        let cell = side * ZOOM;
        let rows = self.places.len() as u32;
        let size = UVec2::new(3 * cell.x + 2 * GAP, rows * cell.y + (rows - 1) * GAP);
        let mut pixels = vec![GAP_COLOR; size.element_product() as usize];
        for (row, place) in (0..rows).zip(self.places) {
            // Near a border the crop is moved, not cut.
            let corner = place.saturating_sub(side / 2).min(self.size - side);
            for (column, picture) in (0..3).zip(self.columns) {
                let origin = UVec2::new(column, row) * (cell + GAP);
                for y in 0..cell.y {
                    for x in 0..cell.x {
                        let from = corner + UVec2::new(x, y) / ZOOM;
                        let to = origin + UVec2::new(x, y);
                        pixels[(to.y * size.x + to.x) as usize] =
                            picture[(from.y * self.size.x + from.x) as usize];
                    }
                }
            }
        }
        Shown::new("worst".to_owned(), "worst pixels".to_owned(), size, &pixels)
    }
}

fn develop(radiance: Vec3, display: &Display) -> [u8; 3] {
    let exposed = (radiance * display.exposure.exp2()).clamp(Vec3::ZERO, Vec3::splat(1e6));
    let shown = display.tone_map.apply(exposed).clamp(Vec3::ZERO, Vec3::ONE);
    shown.to_array().map(|c| (255.0 * srgb_from_linear(c) + 0.5) as u8)
}
