//! What the numbers of a file's lamps mean: the format says candela and lux, and Blender's exporter writes one of three.

use super::Document;
use crate::load::LightUnits;
use crate::load::report::Sink;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use std::f32::consts::PI;

/// Lumen per watt: the constant of `KHR_lights_punctual` and of the candela's definition.
const LUMEN_PER_WATT: f32 = 683.0;
/// Watts that somebody typed have no more digits than this; one number in 200 that nobody typed has as few.
const TYPED_DIGITS: i32 = 4;
/// Single precision, twice rounded.
const ROUNDING: f64 = 3e-7;
/// Where no number was typed: lamps that would all be below this, in W and W/m², are in other units.
const LEAST_WATTS: f64 = 0.05;
const AS_THE_FORMAT_SAYS: &str =
    "punctual lights are in candela and lux as the format says: 683 make one W/sr or W/m²";

impl LightUnits {
    /// What a number is multiplied by to be W/sr (of a lamp with a place) or W/m² (of a directional one).
    pub(super) fn factor(self, is_directional: bool) -> f32 {
        match self {
            Self::Candela => 1.0 / LUMEN_PER_WATT,
            Self::Raw if !is_directional => 1.0 / (4.0 * PI),
            Self::Watts | Self::Raw => 1.0,
        }
    }

    /// The number that was typed in Blender, if it wrote in these units: W, or W/m² of a sun.
    fn typed(self, light: &Light) -> f64 {
        let is_directional = is_directional(light);
        let solid_angle = if is_directional { 1.0 } else { 4.0 * std::f64::consts::PI };
        let factor = match self {
            Self::Candela => solid_angle / f64::from(LUMEN_PER_WATT),
            Self::Watts => solid_angle,
            Self::Raw => 1.0,
        };
        f64::from(light.intensity) * factor
    }
}

fn is_directional(light: &Light) -> bool {
    light.type_ == Checked::Valid(Type::Directional)
}

/// What the user says, else what the file lets one see, of which all after the first `before` entities has been spawned; the
/// decision is told.
pub(super) fn of(document: &Document<'_>, before: usize, sink: &mut Sink<'_>) -> LightUnits {
    let root = &document.root;
    let extension = root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    let lights: Vec<&Light> = extension.iter().flat_map(|extension| &extension.lights).collect();
    let lights: Vec<&Light> =
        lights.into_iter().filter(|l| l.intensity.is_finite() && l.intensity > 0.0).collect();
    if lights.is_empty() {
        return LightUnits::Candela;
    }
    if let Some(units) = sink.options.light_units {
        let what = match units {
            LightUnits::Candela => "candela and lux, 683 of which make one W/sr or W/m²",
            LightUnits::Watts => "W/sr and W/m²",
            LightUnits::Raw => "W and W/m²",
        };
        sink.decide(document.file, format!("punctual lights are in {what}, as --light-units says"));
        return units;
    }
    let is_blender = root.asset.generator.as_ref().is_some_and(|generator| generator.contains("Blender"));
    let (units, what) = if is_blender {
        match by_blender(&lights) {
            LightUnits::Candela => (LightUnits::Candela, AS_THE_FORMAT_SAYS),
            LightUnits::Watts => (
                LightUnits::Watts,
                "punctual lights are taken for Blender's \"Unitless\", W/sr and W/m², as their numbers show",
            ),
            LightUnits::Raw => (
                LightUnits::Raw,
                "punctual lights are taken for Blender's \"Raw\", W and W/m², as their numbers show",
            ),
        }
    } else if sink.shines(before) {
        // Blender leaves W/(sr m²) as they are; for all others candela and cd/m² are of one measure.
        (
            LightUnits::Watts,
            "punctual lights are in candela and lux, what shines beside them in cd/m², as the format says",
        )
    } else {
        (LightUnits::Candela, AS_THE_FORMAT_SAYS)
    };
    sink.decide(document.file, format!("{what} (--light-units)"));
    units
}

/// Which of its three settings Blender wrote in: that in which most lamps have the watts that somebody types, such as 10 or
/// 1000. Where none has, its usual one, unless all lamps would be out.
fn by_blender(lights: &[&Light]) -> LightUnits {
    let typed = |units: LightUnits| lights.iter().filter(|light| is_typed(units.typed(light))).count();
    let [candela, watts, raw] = [LightUnits::Candela, LightUnits::Watts, LightUnits::Raw].map(typed);
    let best = if raw > watts { (raw, LightUnits::Raw) } else { (watts, LightUnits::Watts) };
    if best.0 > candela && 2 * best.0 >= lights.len() {
        return best.1;
    }
    let all_out = lights.iter().all(|light| LightUnits::Candela.typed(light) < LEAST_WATTS);
    if candela == 0 && all_out { LightUnits::Watts } else { LightUnits::Candela }
}

/// Whether a number has few digits, as people type them.
fn is_typed(number: f64) -> bool {
    let digits = TYPED_DIGITS - 1 - number.log10().floor() as i32;
    let scaled = number * 10_f64.powi(digits);
    (scaled - scaled.round()).abs() <= ROUNDING * scaled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decided(lights: &[(&str, f32)]) -> LightUnits {
        let light = |&(kind, intensity): &(&str, f32)| -> Light {
            let spot = if kind == "spot" { r#","spot":{}"# } else { "" };
            serde_json::from_str(&format!(r#"{{"type":"{kind}","intensity":{intensity}{spot}}}"#)).unwrap()
        };
        let lights: Vec<Light> = lights.iter().map(light).collect();
        by_blender(&lights.iter().collect::<Vec<_>>())
    }

    /// What Blender's exporter makes of lamps of these watts, in each of its settings.
    #[test]
    fn the_three_settings_of_blender_are_told_apart_by_their_numbers() {
        let pi4 = 4.0 * PI;
        for watts in [1000.0, 10.0, 60.0, 2.5, 0.35, 1234.0] {
            for kind in ["point", "spot"] {
                assert_eq!(decided(&[(kind, watts / pi4 * 683.0)]), LightUnits::Candela, "{watts}");
                assert_eq!(decided(&[(kind, watts / pi4)]), LightUnits::Watts, "{watts}");
                assert_eq!(decided(&[(kind, watts)]), LightUnits::Raw, "{watts}");
            }
        }
        for strength in [1.0, 3.0, 0.5, 1000.0] {
            assert_eq!(decided(&[("directional", strength * 683.0)]), LightUnits::Candela, "{strength}");
            assert_ne!(decided(&[("directional", strength)]), LightUnits::Candela, "{strength}");
        }
    }

    #[test]
    fn a_number_that_was_dragged_says_nothing_but_for_its_size() {
        assert_eq!(decided(&[("point", 41_253.773)]), LightUnits::Candela);
        assert_eq!(decided(&[("point", 1.273_239_5 * 683.0), ("point", 23.456_789)]), LightUnits::Candela);
        assert_eq!(decided(&[("point", 1.837_264_5)]), LightUnits::Watts);
        // One lamp in three that was typed by accident.
        assert_eq!(
            decided(&[("point", 1000.0), ("point", 41_253.773), ("point", 31_253.175)]),
            LightUnits::Candela
        );
    }
}
