//! White furnaces, and that light goes both ways alike.

use crate::geometry::Rng;
use crate::stage::Estimate;
use glam::Vec3;
use penumbra::scene::{Layers, Material};
use penumbra::torture::light::kinds::{
    Seen, body, brushed, coat, ggx, glossy_kinds, layered, layered_kinds, pane, sheen,
};
use penumbra::trace::bsdf::Lobes;
use penumbra::trace::bsdf::albedo::Reflected;

const ANGLES: [f32; 5] = [0.0, 0.5, 1.0, 1.4, 1.553];

fn toward(angle: f32) -> Vec3 {
    Vec3::new(angle.sin(), 0.0, angle.cos())
}

/// What goes to the eye from surroundings of radiance 1.
fn albedo(seen: &Seen, samples: usize) -> Estimate {
    let bsdf = seen.bsdf();
    let mut rng = Rng(7);
    let groups: Vec<f64> = (0..256)
        .map(|_| {
            let weight = |sample: penumbra::trace::bsdf::BsdfSample| f64::from(sample.weight.max_element());
            let mut once = || bsdf.sample(rng.unit(), rng.pair(), Lobes::ALL).map_or(0.0, weight);
            (0..samples / 256).map(|_| once()).sum::<f64>() / (samples / 256) as f64
        })
        .collect();
    Estimate::of(&groups)
}

/// White surfaces, and how much of the light at least comes back.
fn white_kinds() -> Vec<(String, Material, f64)> {
    let none = Layers::default;
    let mut kinds = Vec::new();
    for roughness in [0.0, 0.1, 0.3, 0.5, 0.7, 1.0] {
        kinds.push((format!("metal of roughness {roughness}"), layered(1.0, 1.0, roughness, none()), 0.984));
        kinds.push((
            format!("dielectric of roughness {roughness}"),
            layered(1.0, 0.0, roughness, none()),
            0.995,
        ));
        let half = layered(1.0, 0.5, roughness, none());
        kinds.push((format!("half metal of roughness {roughness}"), half, 0.984));
        let dense = Layers { ior: 2.4, ..none() };
        kinds.push((
            format!("diamond dust of roughness {roughness}"),
            layered(1.0, 0.0, roughness, dense),
            0.995,
        ));
        let glass = Layers { transmission: body(1.0), ..none() };
        kinds.push((format!("glass of roughness {roughness}"), layered(1.0, 0.0, roughness, glass), 0.984));
        let sheet = Layers { transmission: pane(1.0), ..none() };
        kinds.push((format!("pane of roughness {roughness}"), layered(1.0, 0.0, roughness, sheet), 0.984));
        let varnished = Layers { clearcoat: coat(0.1), ..none() };
        kinds.push((
            format!("varnish over roughness {roughness}"),
            layered(1.0, 0.0, roughness, varnished),
            0.8,
        ));
        let cloth = Layers { sheen: sheen(1.0, roughness), ..none() };
        kinds.push((format!("cloth of roughness {roughness}"), layered(1.0, 0.0, 0.8, cloth), 0.85));
        let strokes = Layers { anisotropy: brushed(1.0), ..none() };
        kinds.push((
            format!("brushed metal of roughness {roughness}"),
            layered(1.0, 1.0, roughness, strokes),
            0.8,
        ));
    }
    kinds
}

/// No energy is gained, and what is lost is less than stated: nearly nothing but for layers over layers.
#[test]
fn white_surfaces_in_white_surroundings_stay_white() {
    for (name, material, least) in white_kinds() {
        let is_body = material.layers.as_ref().is_some_and(|layers| layers.transmission.is_some());
        let sides: &[bool] = if is_body { &[true, false] } else { &[true] };
        for &front in sides {
            let mut line = String::new();
            for angle in ANGLES {
                let e = albedo(&Seen::from_side(&material, toward(angle), front), 1 << 17);
                line += &format!(" {:.4}±{:.4}", e.mean, e.sigma);
                assert!(e.sigma < 4e-3, "{name} at {angle}: {e:?} is too noisy to tell");
                let bound = 4.5 * e.sigma + GAIN;
                assert!(e.mean <= 1.0 + bound, "{name} at {angle}: {e:?} of 1, front {front}");
                let least = if angle > 1.5 { least - GRAZING } else { least };
                assert!(e.mean >= least - 4.5 * e.sigma, "{name} at {angle}: {e:?}, front {front}");
            }
            println!("{name}, front {front}:{line}");
        }
    }
}

/// What may be lost beside that at 89 degrees.
const GRAZING: f64 = 0.025;

/// What interpolating the tables may add.
const GAIN: f64 = 1e-3;

/// At roughness 1 what single facets reflect has a closed form: 1 − c ln((1 + c) / c) at cosine c.
#[test]
fn the_table_of_what_facets_reflect_has_its_closed_form() {
    let table = Reflected::table();
    let mut worst = 0.0f32;
    for i in 1..=100 {
        let c = i as f32 / 100.0;
        let exact = 1.0 - c * ((1.0 + c) / c).ln();
        worst = worst.max((table.at(c, 1.0).element_sum() - exact).abs());
    }
    println!("worst entry off by {worst:.1e}");
    assert!(worst < 2e-3);
}

/// f(wo, wi) = f(wi, wo), of all that stays on one side.
#[test]
fn light_goes_both_ways_alike() {
    let mut rng = Rng(5);
    let kinds = glossy_kinds().into_iter().map(|(name, material, _)| (name, material));
    for (name, material) in kinds.chain(layered_kinds()) {
        if material.layers.as_ref().is_some_and(|layers| layers.transmission.is_some()) {
            // Its compensation is one-sided; see the README.
            continue;
        }
        let mut worst = 0.0f32;
        for _ in 0..200 {
            let [a, b] = [(); 2].map(|()| {
                let d = rng.direction();
                Vec3::new(d.x, d.y, d.z.abs().max(0.01)).normalize()
            });
            let f = |wo: Vec3, wi: Vec3| {
                let [diffuse, glossy] = Seen::new(&material, wo).bsdf().eval(wi);
                ((diffuse + glossy) / wi.z).max_element()
            };
            let (there, back) = (f(a, b), f(b, a));
            worst = worst.max((there - back).abs() / there.max(back).max(1e-3));
        }
        println!("{name}: {worst:.1e}");
        assert!(worst < 2e-3, "{name}: differs by {worst}");
    }
}

/// The checker itself: metal without compensation, as it would be if only single facets counted, loses light.
#[test]
fn single_facets_alone_would_be_found_dark() {
    let material = Material { glossy: ggx(1.0, 1.0), ..Material::lambert(Vec3::ONE) };
    let seen = Seen::new(&material, toward(0.5));
    let bsdf = seen.bsdf();
    let mut rng = Rng(2);
    let n = 1 << 16;
    let mean = (0..n)
        .map(|_| {
            let single = Lobes { diffuse: false, ..Lobes::ALL };
            bsdf.sample(rng.unit(), rng.pair(), single).map_or(0.0, |s| f64::from(s.weight.x))
        })
        .sum::<f64>()
        / f64::from(n);
    let c = 0.5f64.cos();
    let exact = 1.0 - c * ((1.0 + c) / c).ln();
    println!("{mean} of {exact}");
    assert!((mean - exact).abs() < 5e-3 && mean < 0.6);
}
