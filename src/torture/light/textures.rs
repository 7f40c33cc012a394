//! H5, H6, H12: texture coordinates, decoding, tone maps.

use crate::image::develop::{Display, develop};
use crate::image::tone_map::ToneMap;
use crate::scene::{Encoding, Filter, Texels, Texture, Wrap};
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Trial};
use crate::trace::Film;
use crate::trace::texture::lookup;
use glam::{UVec2, Vec2, Vec3, Vec4};
use std::sync::Arc;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

/// Texels that tell their number by red.
fn numbered(width: u32, height: u32, wrap: Wrap) -> Texture {
    let texels = (0..width * height).map(|i| [i as u8, 0, 0, 255]).collect();
    let texels = Arc::new(Texels { width, height, texels });
    Texture { texels, encoding: Encoding::Linear, wrap: [wrap; 2], filter: Filter::Nearest }
}

/// Which of `n` texels the coordinate falls into, in exact arithmetic, and its neighbours if it is within `off` of them.
fn texels_at(u: f32, n: u32, wrap: Wrap, off: f64) -> [i64; 2] {
    let u = if u.is_finite() { f64::from(u) } else { 0.0 };
    // The remainder of a float by 1 or 2 is exact.
    let place = match wrap {
        Wrap::Repeat => u.rem_euclid(1.0),
        Wrap::Mirror => {
            let v = u.rem_euclid(2.0);
            if v < 1.0 { v } else { 2.0 - v }
        }
        Wrap::Clamp => u.clamp(0.0, 1.0),
    };
    let n_f = f64::from(n);
    [-off, off].map(|off| {
        let i = (place * n_f + off).floor() as i64;
        if wrap == Wrap::Repeat { i.rem_euclid(i64::from(n)) } else { i.clamp(0, i64::from(n) - 1) }
    })
}

/// Texture coordinates of all kinds: the texel is the right one, nothing leads outside.
#[must_use]
pub fn coordinates(count: u64, seed: u64, lookup: impl Fn(&Texture, Filter, Vec2) -> Vec4) -> Vec<Check> {
    let mut rng = Rng(seed);
    let odd = [
        0.0,
        -0.0,
        1.0,
        -1e-10,
        1e-45,
        1e30,
        -1e30,
        f32::MAX,
        f32::MIN,
        f32::NAN,
        f32::INFINITY,
        0.999_999_94,
        16_777_217.0,
    ];
    let (mut wrong, mut no_number) = (0, 0);
    let textures: Vec<(Texture, Wrap, u32)> =
        WRAPS.into_iter().flat_map(|wrap| [1, 2, 7, 200].map(|n| (numbered(n, 1, wrap), wrap, n))).collect();
    for i in 0..count {
        let u = match i % 4 {
            0 => odd[rng.bits() as usize % odd.len()],
            1 => rng.unit(),
            2 => rng.decades(-10.0, 10.0),
            _ => f32::from_bits(rng.bits()),
        };
        let (texture, wrap, n) = &textures[rng.bits() as usize % textures.len()];
        let found = lookup(texture, Filter::Nearest, Vec2::new(u, 0.5)).x * 255.0;
        // Single precision may take the neighbour within two units in the last place of the reduced coordinate.
        let allowed = texels_at(u, *n, *wrap, 2.0 * f64::from(*n) / f64::from(1 << 23));
        wrong += u64::from(!allowed.iter().any(|t| (*t as f32 - found).abs() < 0.5));
        let smooth = lookup(texture, Filter::Bilinear, Vec2::new(u, u));
        no_number +=
            u64::from(!(smooth.is_finite() && smooth.min_element() >= 0.0 && smooth.max_element() <= 1.0));
    }
    vec![
        Check::none("texels that are not where the coordinate is", count, "lookups", wrong),
        Check::none("filtered values outside of 0 to 1", count, "lookups", no_number),
    ]
}

/// Between black and white lies half the light, however it is encoded.
#[must_use]
pub fn decoding(lookup: impl Fn(&Texture, Filter, Vec2) -> Vec4) -> Vec<Check> {
    let texels = Arc::new(Texels { width: 2, height: 1, texels: vec![[0, 0, 0, 255], [255, 255, 255, 255]] });
    let mut checks = Vec::new();
    for encoding in [Encoding::Srgb, Encoding::Linear] {
        let texture = Texture {
            texels: Arc::clone(&texels),
            encoding,
            wrap: [Wrap::Clamp; 2],
            filter: Filter::Bilinear,
        };
        let middle = lookup(&texture, Filter::Bilinear, Vec2::splat(0.5));
        let off = f64::from((middle.truncate() - 0.5).abs().max_element());
        checks.push(Check::new(format!("{encoding:?}: off a half"), 1, "texels", off, 0.0));
    }
    // 188 of sRGB is half the light; of other data it is 188 / 255.
    for (encoding, exact) in [(Encoding::Srgb, 0.502_886_5), (Encoding::Linear, 188.0 / 255.0)] {
        let texels = Arc::new(Texels { width: 1, height: 1, texels: vec![[188, 188, 188, 188]] });
        let texture = Texture { texels, encoding, wrap: [Wrap::Repeat; 2], filter: Filter::Bilinear };
        let found = lookup(&texture, Filter::Bilinear, Vec2::splat(0.3));
        let off = (f64::from(found.x) - exact).abs();
        checks.push(Check::new(format!("188 as {encoding:?}"), 1, "texels", off, 1e-6));
        // Coverage is never encoded.
        let alpha = (f64::from(found.w) - 188.0 / 255.0).abs();
        checks.push(Check::new(format!("coverage beside {encoding:?}"), 1, "texels", alpha, 1e-6));
    }
    checks
}

/// Radiance beyond all measure: `develop` shows `radiance` at `exposure` as a byte.
#[must_use]
pub fn tone_maps(shown: impl Fn(f32, &Display) -> u8) -> Vec<Check> {
    let mut checks = Vec::new();
    for tone_map in ToneMap::ALL {
        let (mut wrong, mut tried, mut steps) = (0, 0, 0);
        for exposure in [-1000.0, -20.0, 0.0, 20.0, 1000.0f32] {
            let display = Display { exposure, tone_map };
            for radiance in [0.0, -0.0, -1.0, -1e10, -1e30] {
                wrong += u64::from(shown(radiance, &display) != 0);
                tried += 1;
            }
            // Brighter is never darker but for the last level, which dither may take.
            let mut before = 0;
            for power in -30..=38 {
                let now = shown(10f32.powi(power), &display);
                steps += u64::from(now.saturating_add(1) < before);
                before = now;
                tried += 1;
            }
        }
        let display = Display { exposure: 20.0, tone_map };
        for radiance in [1e6, 1e10, 1e30, f32::MAX] {
            wrong += u64::from(shown(radiance, &display) < 254);
            tried += 1;
        }
        checks.push(Check::none(format!("{tone_map:?}: not black or not white"), tried, "colours", wrong));
        checks.push(Check::none(format!("{tone_map:?}: darker where brighter"), tried, "colours", steps));
    }
    checks
}

fn developed(radiance: f32, display: &Display) -> u8 {
    let mut film = Film::new(UVec2::ONE, 0);
    for tile in film.tiles_mut() {
        for pixel in tile.pixels_mut() {
            pixel.add(0, Vec3::splat(radiance));
        }
    }
    develop(&film, None, display)[0]
}

fn h5(trial: &Trial<'_>) -> Vec<Check> {
    coordinates(trial.pick(1 << 18, 1 << 22, 1 << 30), trial.seed, lookup)
}

/// Coordinates.
pub const H5: Case = Case {
    id: "H5",
    title: "texture coordinates huge, tiny, negative, no number: the right texel",
    limit: "0 further off than 2 units in the last place",
    run: h5,
};

/// Decoding.
pub const H6: Case = Case {
    id: "H6",
    title: "colours are decoded, then filtered; data are not decoded",
    limit: "exactly a half between black and white",
    run: |_| decoding(lookup),
};

/// Tone maps.
pub const H12: Case = Case {
    id: "H12",
    title: "negative, huge and over-exposed radiance is black or white",
    limit: "0",
    run: |_| tone_maps(developed),
};
