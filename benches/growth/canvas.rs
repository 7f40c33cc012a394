//! Pixels with letters: what plotters draws into, without any font of the system.

use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::iso_8859_1::{FONT_6X13, FONT_7X14_BOLD};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use embedded_graphics::text::{Baseline, Text};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendTextStyle, DrawingBackend, DrawingErrorKind, FontTransform,
};
use std::convert::Infallible;

/// An opaque picture, at first white.
pub struct Canvas<'a> {
    size: (u32, u32),
    rgb: &'a mut [u8],
}

impl<'a> Canvas<'a> {
    /// Draws into `rgb`, three bytes for each pixel.
    pub fn new(rgb: &'a mut [u8], size: (u32, u32)) -> Self {
        rgb.fill(0xff);
        Self { size, rgb }
    }
}

/// Letters' pixels, relative to the text's upper left corner.
#[derive(Default)]
struct Letters(Vec<Point>);

impl Dimensions for Letters {
    fn bounding_box(&self) -> Rectangle {
        Rectangle::new(Point::zero(), Size::new(u32::MAX, u32::MAX))
    }
}

impl DrawTarget for Letters {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        self.0.extend(pixels.into_iter().filter(|pixel| pixel.1.is_on()).map(|pixel| pixel.0));
        Ok(())
    }
}

fn font<S: BackendTextStyle>(style: &S) -> MonoTextStyle<'static, BinaryColor> {
    MonoTextStyle::new(if style.size() < 15.0 { &FONT_6X13 } else { &FONT_7X14_BOLD }, BinaryColor::On)
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn draw_pixel(
        &mut self,
        at: BackendCoord,
        color: BackendColor,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let (width, height) = self.size;
        if (0..width as i32).contains(&at.0) && (0..height as i32).contains(&at.1) {
            let first = 3 * (at.1 as usize * width as usize + at.0 as usize);
            let (r, g, b) = color.rgb;
            for (old, new) in self.rgb[first..first + 3].iter_mut().zip([r, g, b]) {
                *old = (f64::from(*old) + (f64::from(new) - f64::from(*old)) * color.alpha).round() as u8;
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = font(style).font.character_size;
        Ok((size.width * text.chars().count() as u32, size.height))
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        at: BackendCoord,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let (width, height) = self.estimate_text_size(text, style)?;
        let anchor = style.anchor();
        let left = match anchor.h_pos {
            HPos::Left => 0,
            HPos::Center => width as i32 / 2,
            HPos::Right => width as i32,
        };
        let top = match anchor.v_pos {
            VPos::Top => 0,
            VPos::Center => height as i32 / 2,
            VPos::Bottom => height as i32,
        };
        let mut letters = Letters::default();
        let Ok(_) = Text::with_baseline(text, Point::zero(), font(style), Baseline::Top).draw(&mut letters);
        for Point { x, y } in letters.0 {
            let (x, y) = (x - left, y - top);
            let (x, y) = match style.transform() {
                FontTransform::None => (x, y),
                FontTransform::Rotate90 => (-y, x),
                FontTransform::Rotate180 => (-x, -y),
                FontTransform::Rotate270 => (y, -x),
            };
            self.draw_pixel((at.0 + x, at.1 + y), style.color())?;
        }
        Ok(())
    }
}
