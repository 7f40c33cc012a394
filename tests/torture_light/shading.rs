//! Surfaces, textures and transport that are a little wrong.

use crate::{finds, trial};
use glam::{DMat3, Vec2, Vec3, Vec4};
use penumbra::image::Display;
use penumbra::scene::color::srgb_from_linear;
use penumbra::scene::{Encoding, Filter, Texture};
use penumbra::torture::light::meter::no_light;
use penumbra::torture::light::shading::{as_it_is, carried};
use penumbra::torture::light::surfaces::{all_surfaces, is_fine, tilted_mirrors};
use penumbra::torture::light::terminator::{
    PAPER, contact, faceted_meridian, flat_normals, judge_meridian, leak,
};
use penumbra::torture::light::textures::{coordinates, decoding, tone_maps};
use penumbra::torture::light::transport::{all_the_same, no_more_than_one, on_average};
use penumbra::torture::{Check, Place};
use penumbra::trace::texture::lookup;

#[test]
fn facets_that_shadow_each_other_are_found() {
    finds("largest step", &judge_meridian("facets", &faceted_meridian()));
    let up: Vec<f64> = (0..100).map(|i| if i == 50 { 1.0 } else { 1.0 - f64::from(i) / 100.0 }).collect();
    finds("wrong way", &judge_meridian("a bright line", &up));
}

#[test]
fn light_that_leaks_around_paper_is_found() {
    assert!(leak(Place::ORIGIN, PAPER).holds());
    // Near its edges the cube's smooth surface is 0.35 further out, beyond the paper.
    finds("behind paper", &[leak(Place::ORIGIN, PAPER - 0.35)]);
    finds("flat normals", &[flat_normals(|normal| (normal + Vec3::X * 1e-4).normalize())]);
}

#[test]
fn light_below_what_stands_on_a_floor_is_found() {
    assert!(contact(Place::ORIGIN, 0.0).holds());
    finds("stands on a floor", &[contact(Place::ORIGIN, 0.05)]);
}

#[test]
fn normal_maps_that_are_not_carried_along_are_found() {
    assert!(carried(&trial(), as_it_is).iter().all(Check::holds));
    // The other way across where the placement mirrors.
    let mirrored = |matrix: &DMat3, strength: f32| {
        let (tangent, strength) = as_it_is(matrix, strength);
        (tangent.truncate().extend(matrix.determinant().signum() as f32), strength)
    };
    finds("cosine off", &carried(&trial(), mirrored));
    // Height is scaled too, so nothing changes.
    finds("cosine off", &carried(&trial(), |matrix, _| as_it_is(matrix, 1.0)));
}

#[test]
fn mirrors_that_are_not_mended_are_found() {
    let checks = tilted_mirrors(1000, 3, |normal, _| normal);
    finds("enter the surface", &checks);
    finds("face away", &checks);
    let always_flat = tilted_mirrors(1000, 3, |_, at| at.geometric_normal);
    finds("were changed", &always_flat);
    finds("unit length", &tilted_mirrors(1000, 3, |normal, _| normal * 1.001));
}

#[test]
fn a_surface_density_three_percent_wrong_is_found() {
    finds("χ²", &all_surfaces(&trial(), &|wi| if wi.x < 0.0 { 0.97 } else { 1.03 }));
    let checks = all_surfaces(&trial(), &|_| 1.01);
    finds("integral", &checks);
    finds("weight beside", &checks);
}

#[test]
fn texels_one_off_are_found() {
    let shifted = |texture: &Texture, filter: Filter, uv: Vec2| {
        let texel = 1.0 / texture.texels.width as f32;
        lookup(texture, filter, uv + Vec2::new(0.1 * texel, 0.0))
    };
    finds("not where", &coordinates(10_000, 0, shifted));
    let spoilt = |texture: &Texture, filter: Filter, uv: Vec2| {
        if uv.x.is_nan() { Vec4::splat(f32::NAN) } else { lookup(texture, filter, uv) }
    };
    finds("outside of 0 to 1", &coordinates(10_000, 0, spoilt));
}

#[test]
fn filtering_before_decoding_is_found() {
    // The mean of the bytes is 0.5, of which sRGB makes 0.214.
    let before = |texture: &Texture, filter: Filter, uv: Vec2| {
        let linear = lookup(&Texture { encoding: Encoding::Linear, ..texture.clone() }, filter, uv);
        if texture.encoding == Encoding::Linear { linear } else { linear.powf(2.2) }
    };
    finds("Srgb", &decoding(before));
    let decoded_data = |texture: &Texture, filter: Filter, uv: Vec2| {
        lookup(&Texture { encoding: Encoding::Srgb, ..texture.clone() }, filter, uv)
    };
    finds("Linear", &decoding(decoded_data));
    let decoded_alpha = |texture: &Texture, filter: Filter, uv: Vec2| lookup(texture, filter, uv).powf(1.1);
    finds("coverage", &decoding(decoded_alpha));
}

#[test]
fn a_tone_map_without_a_clamp_is_found() {
    let careless = |radiance: f32, display: &Display| {
        let exposed = radiance * display.exposure.exp2();
        // Wraps around as bytes do.
        (255.0 * srgb_from_linear(exposed / (1.0 + exposed * exposed))) as i64 as u8
    };
    finds("not black or not white", &tone_maps(careless));
    finds("darker where brighter", &tone_maps(careless));
}

#[test]
fn lost_and_gained_energy_is_found() {
    assert!(all_the_same("fair", &[1.0; 4], 1.0, 1e-5).holds());
    for pixel in [0.9999, 1.0001, f64::NAN] {
        assert!(!all_the_same("off", &[1.0, pixel, 1.0], 1.0, 1e-5).holds(), "{pixel}");
    }
    let noisy =
        |mean: f64| -> Vec<f64> { (0..1024).map(|i| mean + 0.005 * (f64::from(i % 5) - 2.0)).collect() };
    assert!(on_average("fair", 1, &noisy(5.0), 5.0, 0.0).iter().all(Check::holds));
    finds("standard errors off", &on_average("half a percent", 1, &noisy(4.975), 5.0, 0.0));
    finds("relative", &on_average("too noisy", 1, &[1.0, 2.0, 0.0, 1.0], 1.0, 0.0));
    assert!(no_more_than_one("fair", 1, &noisy(1.0), [0.01, 1e-3]).iter().all(Check::holds));
    finds("above", &no_more_than_one("gains", 1, &noisy(1.005), [0.01, 1e-3]));
    finds("loss", &no_more_than_one("loses", 1, &noisy(0.98), [0.01, 1e-3]));
    finds("relative", &no_more_than_one("too noisy", 1, &[1.0, 2.0, 0.0, 1.0], [1.0, 1e-3]));
}

#[test]
fn what_is_no_light_is_found() {
    assert!(no_light("fair", &[0.0, 1.0], false).holds() && no_light("fair", &[1e-30], true).holds());
    for odd in [f64::NAN, f64::INFINITY, -1e-30] {
        assert!(!no_light("odd", &[1.0, odd], false).holds());
    }
    assert!(!no_light("a black dot", &[1.0, 0.0], true).holds());
    assert!(is_fine(Vec3::ONE, 0.0));
    for odd in [f32::NAN, f32::INFINITY, -1e-30] {
        assert!(!is_fine(Vec3::new(1.0, odd, 0.0), 1.0) && !is_fine(Vec3::ONE, odd));
    }
}
