//! A picture of all directions as a light.

use glam::{DMat3, Vec3};
use std::f32::consts::PI;
use std::fmt;
use std::sync::Arc;

/// A picture of the whole sphere, shared: longitude from left to right, latitude from top (+Y) to bottom; its
/// middle is −Z, a quarter of its width to the right of that is +X. Two are the same if they are one in memory.
#[derive(Clone)]
pub struct Sky(Arc<Pixels>);

struct Pixels {
    width: usize,
    height: usize,
    /// Radiance, W/(m² sr), rows from the top; finite and 0 or more.
    radiance: Vec<Vec3>,
    /// Tells it from others in debug texts, and so in hashes of scenes.
    print: u64,
}

impl PartialEq for Sky {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl fmt::Debug for Sky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Pixels { width, height, print, .. } = &*self.0;
        write!(f, "Sky({width} x {height}, {print:016x})")
    }
}

impl Sky {
    /// A sky of `width` pixels across; values that are no light count as none. `None` if there is no pixel, or
    /// the rows are not whole.
    #[must_use]
    pub fn new(width: usize, mut radiance: Vec<Vec3>) -> Option<Self> {
        if width == 0 || radiance.is_empty() || !radiance.len().is_multiple_of(width) {
            return None;
        }
        let mut print = 0xcbf2_9ce4_8422_2325_u64;
        for pixel in &mut radiance {
            *pixel = Vec3::from_array(
                pixel.to_array().map(|c| if c.is_finite() { c.clamp(0.0, 1e9) } else { 0.0 }),
            );
            for c in pixel.to_array() {
                // FNV-1a over words.
                print = (print ^ u64::from(c.to_bits())).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
        let height = radiance.len() / width;
        Some(Self(Arc::new(Pixels { width, height, radiance, print })))
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.0.width, self.0.height]
    }

    /// Rows from the top.
    #[must_use]
    pub fn radiance(&self) -> &[Vec3] {
        &self.0.radiance
    }

    /// The column and the row that a unit direction is in.
    #[must_use]
    pub fn pixel_toward(&self, direction: Vec3) -> [usize; 2] {
        let [width, height] = self.size();
        let turn = 0.5 + direction.x.atan2(-direction.z) / (2.0 * PI);
        // Of the angle from +Y, not of its cosine: near the poles that has few digits.
        let polar = direction.x.hypot(direction.z).atan2(direction.y) / PI;
        let index = |part: f32, count: usize| ((part * count as f32) as usize).min(count - 1);
        [index(turn, width), index(polar, height)]
    }
}

/// How much a placement turns, without scale.
#[must_use]
pub fn rotation(matrix: DMat3) -> DMat3 {
    let y = matrix.y_axis.try_normalize();
    let z = y.and_then(|y| (matrix.z_axis - y * y.dot(matrix.z_axis)).try_normalize());
    match (y, z) {
        (Some(y), Some(z)) => DMat3::from_cols(y.cross(z), y, z),
        _ => DMat3::IDENTITY,
    }
}
