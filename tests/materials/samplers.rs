//! Every lobe's sampler against its density, and value over density against the weight (χ², 1 % for all together).

use crate::chi_square::{CELLS, SAMPLES, sampler_against_density};
use crate::stage::Rng;
use glam::{DVec3, Vec3};
use penumbra::torture::light::kinds::{Seen, glossy_kinds, layered_kinds};
use penumbra::trace::bsdf::Lobes;
use std::f64::consts::PI;

/// A direction for each place of the unit square and the solid angle per area there; and back.
struct Map<D, P> {
    direction: D,
    place: P,
}

/// By half vectors, for narrow lobes: by their tangent over `width`, and by their angle.
fn by_half_vectors(
    eye: DVec3,
    width: f64,
) -> Map<impl Fn(f64, f64) -> (DVec3, f64), impl Fn(DVec3) -> (f64, f64)> {
    // The horizon of a grazing eye runs through the middle of cells, not along their borders.
    let turn = 0.5 / CELLS as f64;
    let direction = move |a: f64, b: f64| {
        let tan = width * a / (1.0 - a);
        let cos = 1.0 / (1.0 + tan * tan).sqrt();
        let phi = 2.0 * PI * (b + turn);
        let h = DVec3::new(tan * phi.cos(), tan * phi.sin(), 1.0) * cos;
        let v_dot_h = h.dot(eye);
        // d tan / da, then solid angle of h over d tan, then that of wi over that of h.
        let area = width / (1.0 - a).powi(2) * tan * cos.powi(3) * 2.0 * PI * 4.0 * v_dot_h;
        (h * (2.0 * v_dot_h) - eye, area)
    };
    let place = move |wi: DVec3| {
        let h = (wi + eye).normalize();
        let tan = h.x.hypot(h.y) / h.z;
        (tan / (width + tan), (h.y.atan2(h.x) / (2.0 * PI) - turn).rem_euclid(1.0))
    };
    Map { direction, place }
}

/// By height and angle over the whole sphere, finer near poles and horizon, where lobes are narrow.
fn by_height() -> Map<impl Fn(f64, f64) -> (DVec3, f64), impl Fn(DVec3) -> (f64, f64)> {
    let direction = |a: f64, b: f64| {
        let (s, side) = if a < 0.5 { (2.0 * a, 1.0) } else { (2.0 - 2.0 * a, -1.0) };
        let theta = 0.5 * PI * s * s * (3.0 - 2.0 * s);
        let phi = 2.0 * PI * b;
        let wi = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos() * side);
        (wi, 2.0 * PI * theta.sin() * 0.5 * PI * 6.0 * s * (1.0 - s) * 2.0)
    };
    let place = |wi: DVec3| {
        let theta = wi.x.hypot(wi.y).atan2(wi.z.abs());
        // The inverse of s² (3 − 2 s).
        let s = 0.5 - ((1.0 - 4.0 * theta / PI).clamp(-1.0, 1.0).asin() / 3.0).sin();
        let a = if wi.z > 0.0 { 0.5 * s } else { 1.0 - 0.5 * s };
        (a, (wi.y.atan2(wi.x) / (2.0 * PI)).rem_euclid(1.0))
    };
    Map { direction, place }
}

/// Proposes a direction; the weight must be value over density, and what is asked must be what was said.
fn propose(seen: &Seen, rng: &mut Rng) -> Option<Vec3> {
    let bsdf = seen.bsdf();
    let sample = bsdf.sample(rng.unit(), rng.pair(), Lobes::ALL)?;
    let pdf = bsdf.pdf(sample.wi, Lobes::ALL);
    assert_eq!(sample.pdf, Some(pdf));
    let [diffuse, glossy] = bsdf.eval(sample.wi);
    let off = (sample.weight * pdf - (diffuse + glossy)).abs().max_element();
    assert!(off <= 1e-5 * (diffuse + glossy).max_element(), "weight is not value over density");
    Some(sample.wi)
}

const DEGREES: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 89.9];

fn toward(degrees: f64) -> DVec3 {
    DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())
}

#[test]
fn each_glossy_material_is_sampled_as_its_density_says() {
    for (name, material, width) in glossy_kinds() {
        for degrees in DEGREES {
            let seen = Seen::new(&material, toward(degrees).as_vec3());
            let map = by_half_vectors(toward(degrees), width);
            // There one step of a direction's largest component is 0.7 % of the whole lobe: more samples
            // would see the steps of single precision.
            let samples = if width < 0.005 && degrees > 89.0 { SAMPLES / 8 } else { SAMPLES };
            sampler_against_density(
                &format!("{name} at {degrees}°"),
                samples,
                |rng| propose(&seen, rng),
                |wi| f64::from(seen.bsdf().pdf(wi, Lobes::ALL)),
                map.direction,
                map.place,
            );
        }
    }
}

#[test]
fn each_layered_material_is_sampled_as_its_density_says() {
    for (name, material) in layered_kinds() {
        for degrees in DEGREES {
            let seen = Seen::new(&material, toward(degrees).as_vec3());
            let map = by_height();
            sampler_against_density(
                &format!("{name} at {degrees}°"),
                SAMPLES,
                |rng| propose(&seen, rng),
                |wi| f64::from(seen.bsdf().pdf(wi, Lobes::ALL)),
                map.direction,
                map.place,
            );
        }
    }
}

/// The checker itself: the same with a density that is 3 % wrong in one lobe must fail.
#[test]
fn a_density_that_is_a_little_wrong_is_found() {
    let (name, material) = layered_kinds().swap_remove(0);
    let seen = Seen::new(&material, toward(30.0).as_vec3());
    let map = by_height();
    let wrong = |wi: Vec3| {
        let pdf = f64::from(seen.bsdf().pdf(wi, Lobes::ALL));
        pdf * if wi.x < 0.0 { 0.97 } else { 1.03 }
    };
    let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        sampler_against_density(name, SAMPLES, |rng| propose(&seen, rng), wrong, map.direction, map.place);
    }));
    let message = *found.expect_err("it passed").downcast::<String>().expect("a message");
    assert!(message.contains("χ²") || message.contains("integrates"), "{message}");
}
