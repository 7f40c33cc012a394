//! Text over the picture: status lines, notices, help.

use super::chord::Letters;
use super::controls::{filter_name, integrator_name, tone_map_name};
use super::keymap::Keymap;
use crate::image::ToneMap;
use crate::scene::Filter;
use crate::trace::Integrator;
use embedded_graphics::Pixel;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::iso_8859_1::{FONT_5X8, FONT_6X10, FONT_8X13};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::{DrawTarget, Drawable};
use embedded_graphics::text::{Baseline, Text};
use glam::UVec2;
use std::convert::Infallible;

/// What the status lines say about the engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Samples a pixel has on average.
    pub samples_per_pixel: f64,
    /// Samples per pixel to stop at.
    pub sample_target: u32,
    /// Whether the target is reached.
    pub done: bool,
    /// Whether the user has paused refinement.
    pub paused: bool,
    /// Estimated relative noise of the picture.
    pub noise: Option<f64>,
    /// Rays of all kinds per second of tracing.
    pub rays_per_second: f64,
    /// Side of a preview pixel.
    pub preview_scale: Option<u32>,
    /// How often the film was reset.
    pub resets: u64,
    /// Samples dropped because they were not finite.
    pub dropped: u64,
    /// Exposure in stops.
    pub exposure: f32,
    /// What happens above white.
    pub tone_map: ToneMap,
    /// Base speed, scene units per second.
    pub speed: f64,
    /// Size of the picture in pixels.
    pub size: UVec2,
    /// How light is gathered.
    pub integrator: Integrator,
    /// Texture filter, if not the file's.
    pub filter: Option<Filter>,
    /// Instructions that rays are traced with.
    pub isa: &'static str,
}

/// How much the status lines tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Level {
    /// Nothing.
    None,
    /// What one wants to know while flying.
    #[default]
    Short,
    /// All.
    Long,
}

impl Level {
    /// The next one, round and round.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::None => Self::Short,
            Self::Short => Self::Long,
            Self::Long => Self::None,
        }
    }
}

/// What the window itself measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Pictures shown in the last second.
    pub pictures_per_second: f64,
    /// From a key press to the first picture that shows its effect, seconds: the median of the last ones.
    pub latency: Option<f64>,
}

/// The lines of `level`.
#[must_use]
pub fn status_lines(level: Level, status: &Status, measured: Measured) -> Vec<String> {
    if level == Level::None {
        return Vec::new();
    }
    let noise = status.noise.map_or_else(|| "-".to_owned(), |n| format!("{} %", significant(n * 100.0)));
    let mut first = format!(
        "{} / {} spp   noise {noise}   {} pictures/s   {} Mrays/s",
        samples(status.samples_per_pixel),
        status.sample_target,
        significant(measured.pictures_per_second),
        significant(status.rays_per_second / 1e6),
    );
    if let Some(scale) = status.preview_scale.filter(|&scale| scale > 1) {
        first += &format!("   preview 1/{scale}");
    }
    if status.paused {
        first += "   paused";
    } else if status.done {
        first += "   done";
    }
    let second =
        format!("exposure {:+.2} EV   speed {}/s   H: help", status.exposure, significant(status.speed));
    let mut lines = vec![first, second];
    if status.dropped > 0 {
        lines.push(format!("{} samples dropped: not finite", status.dropped));
    }
    if level == Level::Long {
        let latency = measured.latency.map_or_else(|| "-".to_owned(), |s| significant(s * 1e3));
        lines.push(format!(
            "{} x {}   {} light   tone map {}   textures {}",
            status.size.x,
            status.size.y,
            integrator_name(status.integrator),
            tone_map_name(status.tone_map),
            filter_name(status.filter),
        ));
        lines.push(format!("key to picture {latency} ms   restarts {}   {}", status.resets, status.isa));
    }
    lines
}

/// Three significant digits, without exponent while it is short.
fn significant(x: f64) -> String {
    let magnitude = x.abs();
    if magnitude == 0.0 {
        "0".to_owned()
    } else if !(1e-3..1e6).contains(&magnitude) {
        format!("{x:.2e}")
    } else {
        let digits = (2.0 - magnitude.log10().floor()).max(0.0) as usize;
        format!("{x:.digits$}")
    }
}

/// Whole samples as such, and a digit of what is between.
fn samples(samples: f64) -> String {
    if samples.fract() == 0.0 { format!("{samples}") } else { format!("{samples:.1}") }
}

/// How many screen pixels a dot of the font is wide and high.
#[must_use]
pub fn text_scale(scale_factor: f64, height: u32) -> u32 {
    (scale_factor.round() as u32).max(height / 900).max(1)
}

/// Bytes of a picture to write on, in dots of `scale` × `scale` pixels.
pub struct Canvas<'a> {
    rgba: &'a mut [u8],
    size: UVec2,
    scale: u32,
}

/// Where a block of text goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The upper left corner.
    Top,
    /// The lower left corner.
    Bottom,
    /// The middle.
    Middle,
}

/// Distance of text from the border, dots.
const MARGIN: u32 = 4;

impl<'a> Canvas<'a> {
    /// Over `rgba`, the bytes of a picture of `size` pixels.
    #[must_use]
    pub fn new(rgba: &'a mut [u8], size: UVec2, scale: u32) -> Self {
        debug_assert_eq!(rgba.len(), size.element_product() as usize * 4);
        Self { rgba, size, scale: scale.max(1) }
    }

    fn dots(&self) -> UVec2 {
        self.size / self.scale
    }

    /// Darkens the dots from `min` up to `max` by `darkness`, so that white text is legible on anything.
    fn plate(&mut self, min: UVec2, max: UVec2, darkness: u8) {
        let (min, max) = (min * self.scale, (max * self.scale).min(self.size));
        for y in min.y..max.y {
            let row = (y * self.size.x) as usize * 4;
            let (from, to) = (row + min.x as usize * 4, row + max.x.max(min.x) as usize * 4);
            for pixel in self.rgba[from..to].chunks_exact_mut(4) {
                pixel[..3].iter_mut().for_each(|c| *c /= darkness);
            }
        }
    }

    /// Writes `lines` as one block, broken where they are too long.
    pub fn write(&mut self, place: Place, lines: &[String]) {
        self.write_in(&FONT_8X13, place, lines, 4);
    }

    fn write_in(&mut self, font: &MonoFont, place: Place, lines: &[String], darkness: u8) {
        let glyph = UVec2::new(font.character_size.width, font.character_size.height);
        let room = self.dots().saturating_sub(UVec2::splat(2 * MARGIN));
        let columns = (room.x / glyph.x).max(1) as usize;
        let lines: Vec<String> = lines.iter().flat_map(|line| wrap(line, columns)).collect();
        let Some(longest) = lines.iter().map(|l| l.chars().count()).max() else {
            return;
        };
        let block = UVec2::new(longest as u32, lines.len() as u32) * glyph;
        let origin = match place {
            Place::Top => UVec2::splat(MARGIN),
            Place::Bottom => UVec2::new(MARGIN, (room.y + MARGIN).saturating_sub(block.y)),
            Place::Middle => room.saturating_sub(block) / 2 + MARGIN,
        };
        self.plate(origin.saturating_sub(UVec2::splat(MARGIN)), origin + block + MARGIN, darkness);
        let style = MonoTextStyle::new(font, BinaryColor::On);
        for (line, y) in lines.iter().zip((origin.y..).step_by(glyph.y as usize)) {
            let at = Point::new(origin.x as i32, y as i32);
            let Ok(_) = Text::with_baseline(line, at, style, Baseline::Top).draw(self);
        }
    }

    /// Writes the help, as large as it fits.
    pub fn write_help(&mut self, keys: &Keymap, letters: &Letters) {
        let text = keys.text(letters);
        let lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let longest = lines.iter().map(String::len).max().unwrap_or(0) as u32;
        let needed = UVec2::new(longest, lines.len() as u32);
        let fonts = [&FONT_8X13, &FONT_6X10];
        let room = self.dots().saturating_sub(UVec2::splat(2 * MARGIN));
        let fits = |font: &&MonoFont| {
            let glyph = UVec2::new(font.character_size.width, font.character_size.height);
            (needed * glyph).cmple(room).all()
        };
        let font = fonts.into_iter().find(fits).unwrap_or(&FONT_5X8);
        // Darker, for there may be other text below.
        self.write_in(font, Place::Middle, &lines, 16);
    }
}

/// Breaks `line` at spaces into pieces of at most `columns` characters; longer words are cut.
fn wrap(line: &str, columns: usize) -> Vec<String> {
    let mut rest: Vec<char> = line.chars().collect();
    let mut pieces = Vec::new();
    while rest.len() > columns {
        let space = rest[..=columns].iter().rposition(|&c| c == ' ').filter(|&at| at > 0);
        let tail = rest.split_off(space.unwrap_or(columns));
        pieces.push(rest.iter().collect::<String>().trim_end().to_owned());
        rest = tail.into_iter().skip_while(|&c| c == ' ').collect();
    }
    pieces.push(rest.into_iter().collect());
    pieces
}

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.dots().x, self.dots().y)
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let dots = self.dots();
        for Pixel(at, color) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y)) else {
                continue;
            };
            if color.is_off() || x >= dots.x || y >= dots.y {
                continue;
            }
            for row in y * self.scale..(y + 1) * self.scale {
                let from = (row * self.size.x + x * self.scale) as usize * 4;
                self.rgba[from..from + self.scale as usize * 4].fill(255);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status() -> Status {
        Status {
            samples_per_pixel: 2.75,
            sample_target: 64,
            done: false,
            paused: false,
            noise: None,
            rays_per_second: 1.234_5e6,
            preview_scale: Some(4),
            resets: 3,
            dropped: 0,
            exposure: 1.0 / 3.0,
            tone_map: ToneMap::Clip,
            speed: 0.5,
            size: UVec2::new(320, 240),
            integrator: Integrator::Direct,
            filter: None,
            isa: "scalar",
        }
    }

    #[test]
    fn unknown_noise_is_not_zero_noise() {
        let lines = status_lines(Level::Short, &status(), Measured::default());
        assert_eq!(lines[0], "2.8 / 64 spp   noise -   0 pictures/s   1.23 Mrays/s   preview 1/4");
        assert_eq!(lines[1], "exposure +0.33 EV   speed 0.500/s   H: help");
        let known = Status { noise: Some(0.012_34), ..status() };
        assert!(status_lines(Level::Short, &known, Measured::default())[0].contains("noise 1.23 %"));
    }

    #[test]
    fn text_of_any_length_on_a_picture_of_any_size_stays_inside() {
        let lines = status_lines(Level::Long, &status(), Measured::default());
        for (width, height) in [(1, 1), (3, 200), (7, 7), (200, 3), (40, 30), (321, 241)] {
            for scale in 1..4 {
                let size = UVec2::new(width, height);
                let mut rgba = vec![100; size.element_product() as usize * 4];
                let mut canvas = Canvas::new(&mut rgba, size, scale);
                for place in [Place::Top, Place::Middle, Place::Bottom] {
                    canvas.write(place, &lines);
                }
                canvas.write_help(&Keymap::default(), &Letters::default());
            }
        }
    }

    #[test]
    fn text_is_white_on_dark_even_over_white() {
        let size = UVec2::new(200, 40);
        let mut rgba = vec![255; size.element_product() as usize * 4];
        Canvas::new(&mut rgba, size, 1).write(Place::Top, &["spp".to_owned()]);
        let dark = rgba.chunks_exact(4).filter(|p| p[0] < 80 && p[3] == 255).count();
        let white = rgba.chunks_exact(4).take(32 * 200).filter(|p| p[0] == 255).count();
        assert!(dark > 300, "{dark}");
        assert!(white > 30, "{white}");
    }

    #[test]
    fn lines_break_at_spaces() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefgh ij", 4), ["abcd", "efgh", "ij"]);
        assert_eq!(wrap("", 4), [""]);
    }

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!(
            [0.0, 1234.5, 0.012_34, 9.999, 1e7].map(significant),
            ["0", "1234", "0.0123", "10.00", "1.00e7"]
        );
    }
}
