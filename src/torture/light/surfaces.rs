//! H3, H10, H11: surfaces, one point at a time.

use super::chi_square::{Draws, Map, compare};
use super::kinds::{Seen, coat, ggx, glossy_kinds, layered, layered_kinds};
use super::meter::larger;
use crate::scene::{Glossy, Layers, Material};
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Trial};
use crate::trace::bsdf::Lobes;
use crate::trace::bsdf::normal::clear_of_surface;
use crate::trace::surface::Interaction;
use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::f64::consts::PI;

/// A point of a floor, with this shading normal.
#[must_use]
pub fn floor_point(normal: Vec3, wo: Vec3) -> Interaction {
    Interaction {
        position: Vec3::ZERO,
        error: Vec3::ZERO,
        geometric_normal: Vec3::Z,
        normal,
        tangent: Vec4::ZERO,
        wo,
        uvs: [Vec2::ZERO; 2],
        color: Vec4::ONE,
        front: true,
        lifted: None,
    }
}

/// Tilted normals, each mended by `mend` for an eye at `wo` above a floor: no mirrored ray may enter it.
#[must_use]
pub fn tilted_mirrors(count: u64, seed: u64, mend: impl Fn(Vec3, &Interaction) -> Vec3) -> Vec<Check> {
    let mut rng = Rng(seed);
    let [mut inward, mut away, mut changed, mut long] = [0; 4];
    for i in 0..count {
        let mut wo = rng.direction();
        wo.z = wo.z.abs().max(1e-7);
        if i % 4 == 0 {
            // Grazing.
            wo.z *= 1e-4;
        }
        wo = wo.normalize();
        let mut normal = rng.direction();
        if i % 2 == 0 {
            normal = (normal * 0.3 + Vec3::Z).normalize();
        }
        let mirrored = |n: Vec3| n * (2.0 * n.dot(wo)) - wo;
        let valid = mirrored(normal).z > 1e-3 && normal.dot(wo) > 0.0;
        let mended = mend(normal, &floor_point(normal, wo));
        let wrong = |is: bool| u64::from(!is);
        inward += wrong(mirrored(mended).z > 0.0);
        away += wrong(mended.dot(wo) > 0.0);
        long += wrong((mended.length() - 1.0).abs() < 1e-5);
        changed += wrong(!valid || mended == normal);
    }
    vec![
        Check::none("mirrored rays that enter the surface", count, "normals", inward),
        Check::none("normals that face away from the eye", count, "normals", away),
        Check::none("normals not of unit length", count, "normals", long),
        Check::none("good normals that were changed", count, "normals", changed),
    ]
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

const CELLS: usize = 16;
/// Samples of each when there are hours.
const FULL: u64 = 100_000;
const DEGREES: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 89.9];

fn toward(degrees: f64) -> DVec3 {
    DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())
}

/// One kind of surface from one direction; the density is multiplied by `wrong`, for a test of the test.
fn one_surface(
    name: &str,
    material: &Material,
    width: Option<f64>,
    degrees: f64,
    draws: Draws,
    wrong: &dyn Fn(Vec3) -> f64,
) -> Vec<Check> {
    let seen = Seen::new(material, toward(degrees).as_vec3());
    let density = |wi: Vec3| f64::from(seen.bsdf().pdf(wi, Lobes::ALL)) * wrong(wi);
    let mut off = 0.0;
    let propose = |rng: &mut Rng| {
        let bsdf = seen.bsdf();
        let sample = bsdf.sample(rng.unit(), rng.pair(), Lobes::ALL)?;
        // The weight is value over density, and what is asked is what was said.
        let pdf = density(sample.wi) as f32;
        let [diffuse, glossy] = bsdf.eval(sample.wi);
        let value = diffuse + glossy;
        let beside = (sample.weight * pdf - value).abs().max_element() / value.max_element();
        off = larger(off, f64::from(if sample.pdf == Some(pdf) { beside } else { f32::INFINITY }));
        Some(sample.wi)
    };
    let what = format!("{name} at {degrees}°");
    // Lobes near the horizon are narrow.
    let draws = Draws { fine: if degrees > 89.0 { 1024 } else { draws.fine }, ..draws };
    let mut checks = match width {
        Some(width) => {
            // There one step of a direction's largest component is 0.7 % of the whole lobe: more samples would see the
            // steps of single precision.
            let few = width < 0.005 && degrees > 89.0 && draws.count < FULL;
            let draws = Draws { count: if few { draws.count.min(12_500) } else { draws.count }, ..draws };
            compare(&what, draws, propose, density, &by_half_vectors(toward(degrees), width))
        }
        None => compare(&what, draws, propose, density, &by_height()),
    };
    let what = format!("{what}: weight beside value over density");
    checks.push(Check::new(what, draws.count, "samples", off, 1e-5));
    checks
}

/// Every kind of surface × 5 angles.
#[must_use]
pub fn all_surfaces(trial: &Trial<'_>, wrong: &(dyn Fn(Vec3) -> f64 + Sync)) -> Vec<Check> {
    let glossy = glossy_kinds().into_iter().map(|(name, material, width)| (name, material, Some(width)));
    let layered = layered_kinds().into_iter().map(|(name, material)| (name, material, None));
    let kinds: Vec<_> = glossy.chain(layered).collect();
    let jobs: Vec<_> = kinds.iter().flat_map(|kind| DEGREES.map(|degrees| (kind, degrees))).collect();
    let draws = Draws {
        count: trial.pick(20_000, 25_000, FULL),
        seed: trial.seed.wrapping_add(12),
        cells: CELLS,
        fine: 512,
        level: 0.01,
        tests: jobs.len() as u32,
    };
    let of = |&((name, material, width), degrees): &(&(&str, Material, Option<f64>), f64)| {
        if trial.interrupted() {
            return Vec::new();
        }
        let checks = one_surface(name, material, *width, degrees, draws, &wrong);
        trial.tell("H10", *name, 0.5);
        checks
    };
    jobs.par_iter().flat_map_iter(of).collect()
}

/// Whether a surface may say so: a value and a density, both numbers and not below 0.
#[must_use]
pub fn is_fine(value: Vec3, pdf: f32) -> bool {
    value.is_finite() && value.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0
}

/// Roughness and angles at which formulas divide by nothing.
fn limits_of_formulas(trial: &Trial<'_>) -> Vec<Check> {
    let none = Layers::default;
    let phong = |exponent| Glossy::BlinnPhong { specular: Vec3::ONE, exponent, texture: None };
    let mut kinds: Vec<(String, Material)> = Vec::new();
    for roughness in [0.0, 1e-30, 1e-8, 1e-4, 1.0] {
        for metallic in [0.0, 1.0] {
            let glossy = ggx(metallic, roughness);
            kinds.push((format!("roughness {roughness}"), Material { glossy, ..Material::default() }));
            let coated = Layers { clearcoat: coat(roughness), ..none() };
            kinds.push((format!("varnish {roughness}"), layered(0.8, metallic, roughness, coated)));
        }
    }
    for exponent in [0.0, 1e-30, 1e6, 1e30] {
        let material = Material { glossy: phong(exponent), ..Material::lambert(Vec3::ZERO) };
        kinds.push((format!("exponent {exponent}"), material));
    }
    kinds.extend(layered_kinds().into_iter().map(|(name, material)| (name.to_owned(), material)));
    let heights = [0.0, 1e-38, 1e-20, 1e-8, 1e-4, 1.0f32];
    let count = trial.pick(200, 2000, 200_000);
    let of = |(name, material): &(String, Material)| {
        let mut rng = Rng(trial.seed.wrapping_add(3));
        let (mut odd, mut tried) = (0, 0);
        for height in heights {
            let seen = Seen::new(material, Vec3::new((1.0 - height * height).max(0.0).sqrt(), 0.0, height));
            let bsdf = seen.bsdf();
            let is_odd = |wi: Vec3| {
                let [a, b] = bsdf.eval(wi);
                let pdf = bsdf.pdf(wi, Lobes::ALL);
                u64::from(!is_fine(a + b, pdf))
            };
            for z in heights {
                let across = (1.0 - z * z).max(0.0).sqrt();
                odd += is_odd(Vec3::new(across, 0.0, z)) + is_odd(Vec3::new(-across, 0.0, z));
                tried += 2;
            }
            for _ in 0..count {
                odd += is_odd(rng.direction());
                // Ends of the interval are random numbers too.
                let mut end = || [rng.unit(), 0.0, 1.0 - f32::EPSILON / 2.0][rng.bits() as usize % 3];
                let (choice, u) = (end(), Vec2::new(end(), end()));
                if let Some(sample) = bsdf.sample(choice, u, Lobes::ALL) {
                    let unit = (sample.wi.length() - 1.0).abs() < 1e-3;
                    let fine = unit && is_fine(sample.weight, sample.pdf.unwrap_or(1.0));
                    odd += u64::from(!fine);
                }
                tried += 2;
            }
        }
        Check::none(name.clone(), tried, "directions", odd)
    };
    kinds.par_iter().filter(|_| !trial.interrupted()).map(of).collect()
}

/// Mirrors.
pub const H3: Case = Case {
    id: "H3",
    title: "no tilted normal lets a mirror reflect into its own surface",
    limit: "0 of 10⁶ random normals",
    run: |trial| {
        tilted_mirrors(
            trial.pick(100_000, 1_000_000, 100_000_000),
            trial.seed.wrapping_add(3),
            clear_of_surface,
        )
    },
};

/// Densities.
pub const H10: Case = Case {
    id: "H10",
    title: "every kind of surface is sampled as its density says, from 5 angles up to 89.9°",
    limit: "χ²: p > 0.01 for all together; weight is value over density within 1e-5",
    run: |trial| all_surfaces(trial, &|_| 1.0),
};

/// Limits.
pub const H11: Case = Case {
    id: "H11",
    title: "roughness 0 and 1e-30, an eye and light in the surface: everything finite",
    limit: "0",
    run: limits_of_formulas,
};
