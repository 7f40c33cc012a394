//! Pictures on surfaces.

use bevy_ecs::prelude::*;
use std::sync::Arc;

/// How stored bytes become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Colours: sRGB transfer function on red, green and blue; alpha is linear.
    Srgb,
    /// Data: byte / 255.
    Linear,
}

/// Decoded image: rows from the top, `texels.len() == width * height`, both at least 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texels {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// RGBA bytes, not premultiplied.
    pub texels: Vec<[u8; 4]>,
}

/// What happens outside 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tile.
    #[default]
    Repeat,
    /// Tile, every other one mirrored.
    Mirror,
    /// Continue the border texel.
    Clamp,
}

/// What happens between texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The texel that the point falls into.
    Nearest,
    /// Linear between the four texel centres around the point.
    #[default]
    Bilinear,
}

/// A texture asset: an image and how to read it.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image; several textures may share it.
    pub texels: Arc<Texels>,
    /// How bytes become numbers.
    pub encoding: Encoding,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
    /// What the file asks for; `RenderSettings::filter` may override it.
    pub filter: Filter,
}
