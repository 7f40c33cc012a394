//! What happens to light above white, and on the way there.

use glam::{Mat3, Vec3};

/// From exposed linear radiance to what a display shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// Cut off, each channel for itself.
    #[default]
    Clip,
    /// Khronos PBR Neutral: colours stay, highlights roll off.
    Neutral,
    /// `AgX`: a film-like curve, and bright colours fade to white.
    AgX,
    /// The ACES look, by its usual fit.
    Aces,
}

impl ToneMap {
    /// All of them, in the order of the key.
    pub const ALL: [Self; 4] = [Self::Clip, Self::Neutral, Self::AgX, Self::Aces];

    /// What the command line and films call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clip => "clip",
            Self::Neutral => "neutral",
            Self::AgX => "agx",
            Self::Aces => "aces",
        }
    }

    /// The one called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|map| map.name() == name)
    }

    /// The next one round and round, or the one before.
    #[must_use]
    pub fn stepped(self, back: bool) -> Self {
        let here = Self::ALL.iter().position(|&map| map == self).unwrap_or(0);
        let step = if back { Self::ALL.len() - 1 } else { 1 };
        Self::ALL[(here + step) % Self::ALL.len()]
    }

    /// Maps exposed linear radiance to linear display values; what is still outside 0..=1 clips.
    ///
    /// Neutral: Khronos PBR Neutral tone mapper specification, 2024. `AgX`: T. Sobotka, 2022, with the matrices
    /// and the polynomial of B. Wrensch, "Minimal `AgX` Implementation", 2023. ACES: K. Narkowicz, "ACES Filmic
    /// Tone Mapping Curve", 2016.
    #[must_use]
    pub fn apply(self, color: Vec3) -> Vec3 {
        match self {
            Self::Clip => color,
            Self::Neutral => neutral(color),
            Self::AgX => agx(color),
            Self::Aces => aces(color),
        }
    }
}

fn neutral(color: Vec3) -> Vec3 {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let low = color.min_element();
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let color = color - offset;
    let peak = color.max_element();
    if peak < START {
        return color;
    }
    let d = 1.0 - START;
    let new_peak = 1.0 - d * d / (peak + d - START);
    let color = color * (new_peak / peak);
    let g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.lerp(Vec3::splat(new_peak), g)
}

fn agx(color: Vec3) -> Vec3 {
    const INSET: Mat3 = Mat3::from_cols(
        Vec3::new(0.842_479_06, 0.042_328_24, 0.042_375_655),
        Vec3::new(0.078_433_6, 0.878_468_64, 0.078_433_6),
        Vec3::new(0.079_223_745, 0.079_166_13, 0.879_143),
    );
    const OUTSET: Mat3 = Mat3::from_cols(
        Vec3::new(1.196_879, -0.052_896_85, -0.052_971_635),
        Vec3::new(-0.098_020_88, 1.151_903_1, -0.098_043_45),
        Vec3::new(-0.099_029_74, -0.098_961_175, 1.151_073_7),
    );
    // Stops around middle grey that the curve spans.
    const DARKEST: f32 = -12.473_93;
    const BRIGHTEST: f32 = 4.026_069;
    let stops = (INSET * color.max(Vec3::ZERO)).max(Vec3::splat(1e-10)).map(f32::log2);
    let x = ((stops - DARKEST) / (BRIGHTEST - DARKEST)).clamp(Vec3::ZERO, Vec3::ONE);
    let curve = |x: f32| {
        // Horner's rule over the polynomial of degree 6.
        [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232].iter().fold(0.0, |sum, c| sum * x + c)
    };
    let shown = (OUTSET * x.map(curve)).max(Vec3::ZERO);
    // It is made for a display of gamma 2.2.
    shown.powf(2.2)
}

fn aces(color: Vec3) -> Vec3 {
    (color * (2.51 * color + 0.03)) / (color * (2.43 * color + 0.59) + 0.14)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_map_goes_up_from_black_to_white_and_keeps_grey_grey() {
        for map in ToneMap::ALL {
            assert!(map.apply(Vec3::ZERO).max_element() < 0.002, "{map:?}");
            let mut last = -1.0;
            for i in 0..200 {
                let shown = map.apply(Vec3::splat(1e-3 * 1.08f32.powi(i)));
                assert!(shown.max_element() - shown.min_element() < 0.01, "{map:?} {shown}");
                assert!(shown.x >= last - 1e-4, "{map:?} falls at {i}: {shown} after {last}");
                last = shown.x;
            }
            assert!(last > 0.95, "{map:?} {last}");
            assert!(map.apply(Vec3::splat(1e6)).is_finite());
            assert_eq!(ToneMap::named(map.name()), Some(map));
            assert_eq!(map.stepped(false).stepped(true), map);
        }
    }

    #[test]
    fn middle_grey_is_about_as_bright_as_its_authors_say() {
        let grey = |map: ToneMap| map.apply(Vec3::splat(0.18)).x;
        // The neutral map shows base colours as they are, but for the 4 % of Fresnel.
        assert!((grey(ToneMap::Neutral) - 0.14).abs() < 1e-6);
        // AgX shows middle grey as half of what the display is given; the fit of ACES is 0.267 there.
        assert!((grey(ToneMap::AgX) - 0.5f32.powf(2.2)).abs() < 0.005, "{}", grey(ToneMap::AgX));
        assert!((grey(ToneMap::Aces) - 0.267).abs() < 0.002, "{}", grey(ToneMap::Aces));
    }
}
