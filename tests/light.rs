//! Light against closed forms, through the whole way: what the torture chamber has no case for.
//!
//! The exact figures are irradiances for lights of radiance 1; most are Lambert's polygon formula
//! (1760), checked against adaptive quadrature when this table was made.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test shows its figures, and fails at the first wrong one"
)]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DQuat, DVec3, Vec3};
use penumbra::scene::{Emission, Light, Material, Transform, TriangleMesh};
use penumbra::torture::light::oracle;
use penumbra::trace::Integrator;
use stage::{Estimate, Exact as _, Frames as _, Stage, quad, reds, settings};
use std::f64::consts::PI;

const ALBEDO: f32 = 0.8;
const HERE: DAffine3 = DAffine3::IDENTITY;

/// A Lambert square around `point`.
fn receiver(stage: &mut Stage, point: DVec3, normal: DVec3, half: f64) {
    let (a, b) = normal.normalize().any_orthonormal_pair();
    let corner = (point - (a + b) * half).as_vec3();
    let (u, v) = ((a * 2.0 * half).as_vec3(), (b * 2.0 * half).as_vec3());
    stage.add_mesh(quad(corner, u, v), Material::lambert(Vec3::splat(ALBEDO)), HERE);
}

/// Irradiance at `point`: a diffuse receiver there, seen by 256 pixels that are all the same point.
fn irradiance_with(samples: u32, point: DVec3, normal: DVec3, build: impl FnOnce(&mut Stage)) -> Estimate {
    let mut stage = Stage::new(settings(16, 16, Integrator::Direct, 1));
    receiver(&mut stage, point, normal, 1.0);
    let normal = normal.normalize();
    stage.look(point + normal * 0.25, point, normal.any_orthonormal_vector(), 1e-4);
    build(&mut stage);
    Estimate::of(&reds(stage.trace(samples))).times(PI / f64::from(ALBEDO))
}

/// The same with 10⁶ samples.
fn irradiance(point: DVec3, normal: DVec3, build: impl FnOnce(&mut Stage)) -> Estimate {
    irradiance_with(4096, point, normal, build)
}

/// A parallelogram light of radiance 1 that emits to both sides.
fn panel(stage: &mut Stage, corner: DVec3, u: Vec3, v: Vec3) {
    let light = Light::Parallelogram { edge_u: u, edge_v: v, radiance: [Vec3::ONE; 4], two_sided: true };
    stage.add(light, DAffine3::from_translation(corner + (u + v).as_dvec3() * 0.5));
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The middle of a line whose strength falls from 2 to 0 gets what a constant 1 sends it.
#[test]
fn a_line_of_falling_strength_sends_its_mean_to_the_middle() {
    let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        let strength = [2.0, 0.0].map(Vec3::splat);
        let light = Light::Segment { half_length: 1.5, strength, emission: Emission::Sine };
        s.add(light, DAffine3::from_translation(DVec3::Z * 2.0));
    });
    e.assert_is("line of falling strength", 0.561750554397, 1e-3);
}

/// By area or by length, nearly all light would come from places that are hardly ever sampled.
#[test]
fn lamps_much_larger_than_they_are_far_are_no_gamble() {
    let plate = irradiance_with(64, DVec3::ZERO, DVec3::Z, |s| {
        let light = Light::Disk { radius: 100.0, radiance: Vec3::ONE, two_sided: true };
        s.add(light, DAffine3::from_translation(DVec3::Z));
    });
    plate.assert_is("1 under a disk of radius 100", oracle::disk(100.0, 1.0, 0.0), 0.02);
    let (a, b) = (v(-1.0, 0.0, 0.002), v(1.0, 0.0, 0.002));
    let wire = irradiance_with(64, DVec3::ZERO, DVec3::Z, |s| {
        let strength = [Vec3::ONE; 2];
        let light = Light::Segment { half_length: 1.0, strength, emission: Emission::Isotropic };
        s.add(light, DAffine3::from_translation((a + b) * 0.5));
    });
    let exact = oracle::line(a, b, DVec3::ZERO, DVec3::Z, oracle::Line::Isotropic);
    wire.assert_is("0.002 under a line", exact, 0.02);
    // Below the acute corner of one of its triangles.
    let corner = Vec3::new(-1.0, -1.0, 0.5);
    let (u, w) = (Vec3::X * 1000.0, Vec3::Y * 1000.0);
    let known = irradiance_with(1, DVec3::ZERO, DVec3::Z, |s| panel(s, corner.as_dvec3(), u, w));
    let ceiling = irradiance_with(64, DVec3::ZERO, DVec3::Z, |s| {
        let lamp = Material { double_sided: true, ..Material::emissive(Vec3::ONE) };
        s.add_mesh(quad(corner, u, w), lamp, HERE);
    });
    ceiling.assert_is("under a corner of a large mesh", known.mean, 0.02);
}

#[test]
fn a_disk_sends_what_its_closed_form_says() {
    // Parallel to the receiver at height h, radius r, axis a away.
    let exact = |r: f64, h: f64, a: f64| {
        let z = h * h + a * a;
        PI / 2.0 * (1.0 - (z - r * r) / ((z + r * r).powi(2) - 4.0 * r * r * a * a).sqrt())
    };
    for (r, h, a) in [(1.0, 1.0, 0.0), (0.5, 2.0, 0.0), (1.0, 2.0, 1.5), (0.3, 0.6, 2.0)] {
        let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
            // Emits toward its local −Z.
            let light = Light::Disk { radius: r as f32, radiance: Vec3::ONE, two_sided: false };
            s.add(light, DAffine3::from_translation(v(a, 0.0, h)));
        });
        e.assert_is(&format!("disk r {r} h {h} a {a}"), exact(r, h, a), 1e-3);
    }
}

#[test]
fn distant_light_falls_with_the_cosine_alone() {
    for angle in [0.0, 0.0093, 0.5f32] {
        let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
            let light = Light::Directional { irradiance: Vec3::splat(2.0), angle };
            // Its −Z turned to come from 0.7 rad off the vertical.
            s.add(light, DAffine3::from_axis_angle(DVec3::X, 0.7));
        });
        // The disc is all above the horizon: its irradiance is that of its centre.
        e.assert_is(&format!("sun {angle} rad wide"), 2.0 * 0.7f64.cos(), 1e-3);
    }
    let e = irradiance(DVec3::ZERO, v(1.0, 2.0, 3.0), |s| {
        s.add(Light::Environment { radiance: Vec3::ONE }, HERE);
    });
    e.assert_is("environment", PI, 1e-3);
}

#[test]
fn point_and_spot_light_fall_with_the_distance_squared() {
    for at in [v(0.0, 0.0, 0.5), v(1.0, 2.0, 3.0), v(100.0, -40.0, 900.0)] {
        let exact = 3.0 * at.normalize().z / at.length_squared();
        let e = irradiance_with(16, DVec3::ZERO, DVec3::Z, |s| {
            s.add(Light::Point { intensity: Vec3::splat(3.0) }, DAffine3::from_translation(at));
        });
        e.assert_is(&format!("point at {at}"), exact, 1e-3);
        // The angle from the axis to the receiver, full inside 0.4 and dark outside 0.6.
        let ramp = (0.5f64.cos() - 0.6f64.cos()) / (0.4f64.cos() - 0.6f64.cos());
        for (off, share) in [(0.3, 1.0), (0.5, ramp * ramp), (0.7, 0.0)] {
            let e = irradiance_with(16, DVec3::ZERO, DVec3::Z, |s| {
                let light = Light::Spot { intensity: Vec3::splat(3.0), inner_angle: 0.4, outer_angle: 0.6 };
                let toward = DQuat::from_rotation_arc(DVec3::NEG_Z, -at.normalize());
                s.add(light, DAffine3::from_rotation_translation(toward * DQuat::from_rotation_x(off), at));
            });
            if share == 0.0 {
                assert_eq!((e.mean, e.sigma), (0.0, 0.0), "outside the cone");
            } else {
                e.assert_is(&format!("spot at {at}, {off} rad off"), exact * share, 1e-3);
            }
        }
    }
}

/// On the axis of a spot it is as bright however narrow that is; hard ones are.
#[test]
fn narrow_spots_are_as_bright() {
    for degrees in [30.0_f32, 1.0, 0.05, 0.02] {
        for inner in [0.5, 0.999, 1.0] {
            let outer_angle = degrees.to_radians();
            let light = Light::Spot { intensity: Vec3::ONE, inner_angle: inner * outer_angle, outer_angle };
            let spot = |stage: &mut Stage| {
                stage.add(
                    light.clone(),
                    Transform::looking_at(v(0.3, 1.7, 0.2), v(0.0, 0.0, 0.0), DVec3::Y).0,
                );
            };
            let distance2 = v(0.3, 1.7, 0.2).length_squared();
            let expected = 1.7 / distance2.powf(1.5);
            let found = irradiance_with(16, v(0.0, 0.0, 0.0), DVec3::Y, spot).mean;
            // What is seen has some extent.
            assert!((found / expected - 1.0).abs() < 1e-2, "{degrees} {inner}: {found} {expected}");
        }
    }
}

/// Of few shining triangles the small one beside two that are very large and far away.
#[test]
fn a_small_triangle_among_huge_ones_is_sampled() {
    let half = 1e4_f32;
    let far = |x: f32, z: f32| Vec3::new(x * half, 3e4, z * half);
    let near = |x: f32, z: f32| Vec3::new(x * 0.5, 1.2, z * 0.5);
    let square = |at: &dyn Fn(f32, f32) -> Vec3| [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
    let lamp = |corners: Vec<Vec3>| TriangleMesh {
        triangles: (0..corners.len() as u32 / 4)
            .flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| 4 * i + k)))
            .collect(),
        positions: corners,
        ..TriangleMesh::default()
    };
    let (large, small) = (square(&far), square(&near));
    let shining = Material { double_sided: true, ..Material::emissive(Vec3::ONE) };
    let lit = |meshes: &[Vec<Vec3>]| {
        irradiance_with(256, v(0.0, 0.0, 0.0), DVec3::Y, |stage| {
            for corners in meshes {
                stage.add_mesh(lamp(corners.clone()), shining.clone(), DAffine3::IDENTITY);
            }
        })
    };
    let together = lit(&[[large, small].concat()]);
    let apart = lit(&[large.to_vec(), small.to_vec()]);
    let sigma = together.sigma.hypot(apart.sigma);
    println!("together {together:?}, apart {apart:?}");
    assert!((together.mean - apart.mean).abs() < 4.5 * sigma && sigma < 0.01 * apart.mean);
}

#[test]
fn corner_colours_blend_over_a_parallelogram() {
    let radiance = [1.0, 2.0, 4.0, 8.0].map(Vec3::splat);
    let light = Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance, two_sided: true };
    let at = |height: f64| {
        let light = light.clone();
        irradiance(DVec3::ZERO, DVec3::Z, move |s| {
            s.add(light, DAffine3::from_translation(v(0.3, 0.2, height)));
        })
    };
    // By the midpoint rule; its error is of the order of 1 / 1000².
    let exact = |height: f64| {
        let n = 1000;
        let mut sum = 0.0;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let (a, b) = ((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
            let blend = (1.0 + a) * (1.0 - b) + (4.0 + 4.0 * a) * b;
            let d = v(a - 0.2, b - 0.3, height);
            sum += blend * (height / d.length_squared()).powi(2);
        }
        sum / f64::from(n * n)
    };
    at(1.0).assert_is("near", exact(1.0), 1e-3);
    at(1e3).assert_is("far: the mean colour", 3.75e-6, 1e-3);
}

/// A light that is mirrored as a whole shines on the mirrored side.
#[test]
fn a_mirrored_light_is_the_mirror_image() {
    let mirrored =
        |axis: DVec3| DAffine3::from_translation(DVec3::Z) * DAffine3::from_scale(DVec3::ONE - 2.0 * axis);
    let (edge_u, edge_v) = (Vec3::Y, Vec3::X);
    let corner = Vec3::new(-0.5, -0.5, 0.0);
    let shine = || Material::emissive(Vec3::ONE);
    for (axis, lit) in [(DVec3::X, true), (DVec3::Y, true), (DVec3::Z, false)] {
        let cases: [(&str, &dyn Fn(&mut Stage)); 2] = [
            ("parallelogram", &|s| {
                let radiance = [Vec3::ONE; 4];
                s.add(Light::Parallelogram { edge_u, edge_v, radiance, two_sided: false }, mirrored(axis));
            }),
            ("mesh", &|s| {
                s.add_mesh(quad(corner, edge_u, edge_v), shine(), mirrored(axis));
            }),
        ];
        for (name, build) in cases {
            let e = irradiance(DVec3::ZERO, DVec3::Z, build);
            if lit {
                e.assert_is(&format!("{name} mirrored along {axis}"), 0.752274688454, 1e-3);
            } else {
                assert_eq!((e.mean, e.sigma), (0.0, 0.0), "{name} mirrored along {axis}");
            }
        }
    }
    // Corner colours follow their corners.
    let radiance = [1.0, 2.0, 4.0, 8.0].map(Vec3::splat);
    let lit = |place: DAffine3, edge_u: Vec3, radiance: [Vec3; 4]| {
        let light = Light::Parallelogram { edge_u, edge_v: Vec3::Y, radiance, two_sided: true };
        irradiance(v(1.0, 0.0, 0.0), DVec3::Z, |s| {
            s.add(light, place);
        })
    };
    let [a, b, c, d] = radiance;
    let by_hand = lit(DAffine3::from_translation(DVec3::Z), Vec3::X, [b, a, d, c]);
    let by_placement = lit(mirrored(DVec3::X), Vec3::X, [a, b, c, d]);
    let sigma = by_hand.sigma.hypot(by_placement.sigma);
    assert!((by_hand.mean - by_placement.mean).abs() < 4.5 * sigma + 1e-5, "{by_hand:?} {by_placement:?}");
}

#[test]
fn an_occluder_just_before_a_light_hides_it_and_one_just_behind_does_not() {
    let lit = |gap: f32| {
        irradiance(DVec3::ZERO, DVec3::Z, |s| {
            panel(s, v(-0.5, -0.5, 1000.0), Vec3::X, Vec3::Y);
            s.add_mesh(
                quad(Vec3::new(-1.0, -1.0, 1000.0 + gap), Vec3::X * 2.0, Vec3::Y * 2.0),
                Material::default(),
                HERE,
            );
        })
    };
    let before = lit(-0.01);
    assert_eq!((before.mean, before.sigma), (0.0, 0.0));
    lit(0.01).assert_is("occluder behind", 9.99999666667e-7, 1e-3);
}
