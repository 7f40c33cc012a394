//! Light against closed forms, through the whole way: entities, flat arrays, rays, film.
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
use penumbra::scene::{Emission, Light, Material, TriangleMesh};
use penumbra::trace::{Film, Integrator};
use stage::{Estimate, Exact as _, Frames as _, Stage, cube, grid, quad, reds, settings};
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

#[test]
fn a_parallelogram_sends_what_lambert_says() {
    let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        panel(s, v(-0.5, -0.5, 1.0), Vec3::X, Vec3::Y);
    });
    e.assert_is("1x1 at height 1", 0.752274688454, 1e-3);
    let e = irradiance(v(3.0, 0.25, 0.0), DVec3::Z, |s| {
        panel(s, v(-1.0, -0.5, 2.0), Vec3::X * 2.0, Vec3::Y);
    });
    e.assert_is("2x1 at height 2, oblique", 0.054022002505, 1e-3);
}

#[test]
fn a_light_cut_by_the_horizon_counts_only_above_it() {
    // The floor is there and hides the lower half; the upper half must not notice.
    let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        panel(s, v(2.0, -1.0, -1.0), Vec3::Y * 2.0, Vec3::Z * 2.0);
    });
    e.assert_is("lower half under the horizon", 0.0875102647738, 1e-3);
}

#[test]
fn emissive_triangles_send_what_lambert_says() {
    let shine = Material { double_sided: true, ..Material::emissive(Vec3::ONE) };
    let triangle = |corners: [[f32; 3]; 3]| TriangleMesh {
        positions: corners.map(Vec3::from_array).to_vec(),
        triangles: vec![[0, 1, 2]],
        ..TriangleMesh::default()
    };
    let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        s.add_mesh(triangle([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]), shine.clone(), HERE);
    });
    e.assert_is("triangle at height 1", 0.302299894039, 1e-3);
    // The lights of Nori's direct lighting test; its figures are radiances for an albedo of one half.
    for (corners, radiance) in [
        (
            [
                [-0.443432, 0.596366, 0.495985],
                [-0.320397, 0.0677699, -0.229359],
                [0.0341197, 0.11415, -0.343049],
            ],
            0.0898392585,
        ),
        (
            [
                [0.461963, 0.397843, 0.412747],
                [-0.0381582, 0.851323, -0.156872],
                [0.195443, 0.891957, -0.260672],
            ],
            0.0229200404,
        ),
        (
            [
                [0.100871, 0.289075, -0.422609],
                [-0.308386, 0.629587, 0.423966],
                [-0.373132, 0.237287, 0.351592],
            ],
            0.0534195402,
        ),
        (
            [[-0.17575, 0.639397, 0.151268], [0.318604, 0.732996, 0.459771], [0.139095, 0.294498, 0.478556]],
            0.0205313915,
        ),
        (
            [
                [-0.17487, 0.447916, 0.367201],
                [-0.405259, 0.249607, -0.354079],
                [0.356029, 0.0918984, -0.132271],
            ],
            0.2617398589,
        ),
    ] {
        let mut stage = Stage::new(settings(16, 16, Integrator::Direct, 1));
        receiver(&mut stage, DVec3::ZERO, DVec3::Y, 1.0);
        // Some of these hang low: the camera sees nothing of them from a hand's breadth below.
        stage.look(v(0.0, 0.01, 0.0), DVec3::ZERO, DVec3::Z, 1e-4);
        stage.add_mesh(triangle(corners), shine.clone(), HERE);
        let e = Estimate::of(&reds(stage.trace(4096))).times(0.5 / f64::from(ALBEDO));
        e.assert_is("a triangle of Nori's", radiance, 2e-3);
    }
}

#[test]
fn a_line_sends_what_its_measure_says() {
    let line = |from: DVec3, to: DVec3, emission: Emission, strength: [f32; 2]| {
        move |s: &mut Stage| {
            let along = to - from;
            let turn = DQuat::from_rotation_arc(DVec3::X, along.normalize());
            let half_length = (along.length() * 0.5) as f32;
            let light = Light::Segment { half_length, strength: strength.map(Vec3::splat), emission };
            s.add(light, DAffine3::from_rotation_translation(turn, (from + to) * 0.5));
        }
    };
    let (flat, tilted) = ((v(-1.5, 0.0, 2.0), v(1.5, 0.0, 2.0)), (v(-1.5, 0.0, 2.0), v(1.5, 0.5, 3.0)));
    for (ends, point, isotropic, sine) in [
        (flat, DVec3::ZERO, 0.6, 0.561750554397),
        (tilted, v(2.0, 1.0, 0.0), 0.221261776613, 0.207472175588),
        (tilted, v(1.0, -3.0, 0.0), 0.0991969298954, 0.0966847701406),
    ] {
        let e = irradiance(point, DVec3::Z, line(ends.0, ends.1, Emission::Isotropic, [1.0; 2]));
        e.assert_is("isotropic line", isotropic, 1e-3);
        let e = irradiance(point, DVec3::Z, line(ends.0, ends.1, Emission::Sine, [1.0; 2]));
        e.assert_is("sine line", sine, 1e-3);
    }
    // The middle of a line whose strength falls from 2 to 0 gets what a constant 1 sends it.
    let e = irradiance(DVec3::ZERO, DVec3::Z, line(flat.0, flat.1, Emission::Sine, [2.0, 0.0]));
    e.assert_is("line of falling strength", 0.561750554397, 1e-3);
}

#[test]
fn a_thin_bright_cylinder_is_a_sine_line() {
    // Radius ρ and radiance 1 / (2 ρ): a strength of 1 per length.
    const SIDES: u32 = 32;
    let rho = 1e-3;
    let mut mesh = TriangleMesh::default();
    for i in 0..SIDES {
        let angle = 2.0 * std::f32::consts::PI * i as f32 / SIDES as f32;
        let ring = Vec3::new(0.0, angle.cos(), angle.sin()) * rho + Vec3::Z * 2.0;
        mesh.positions.extend([ring - Vec3::X * 1.5, ring + Vec3::X * 1.5]);
        let (a, b) = (2 * i, (2 * i + 2) % (2 * SIDES));
        mesh.triangles.extend([[a, b + 1, a + 1], [a, b, b + 1]]);
    }
    let shine = Material { double_sided: true, ..Material::emissive(Vec3::splat(0.5 / rho)) };
    let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        s.add_mesh(mesh, shine, HERE);
    });
    // Seen from below it is 2 ρ wide, and nearer than its axis by less than ρ.
    let off = e.mean / 0.561750554397 - 1.0;
    println!("cylinder of radius 0.001: off {off:.1e} from the line");
    assert!(off.abs() < f64::from(rho) && e.sigma < 1e-4);
}

#[test]
fn a_ball_sends_what_its_disc_says() {
    for (angle, exact) in
        [(0.0, PI / 4.0), (1.0, 0.424352438708), (PI / 2.0, 0.0905860737061), (1.8f64, 0.0237033624341)]
    {
        let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
            let at = v(angle.sin(), 0.0, angle.cos()) * 2.0;
            s.add(Light::Sphere { radius: 1.0, radiance: Vec3::ONE }, DAffine3::from_translation(at));
        });
        e.assert_is(&format!("ball at {angle:.2} rad"), exact, 1e-3);
    }
    for ratio in [1e-2, 1e-4, 1e-6] {
        let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
            let light =
                Light::Sphere { radius: (100.0 * ratio) as f32, radiance: Vec3::splat((1.0 / ratio) as f32) };
            s.add(light, DAffine3::from_translation(DVec3::Z * 100.0));
        });
        e.assert_is(&format!("ball of {ratio} of its distance"), PI * ratio, 1e-4);
    }
}

#[test]
fn inside_a_shining_ball_every_place_gets_pi() {
    for (point, normal) in [
        (DVec3::ZERO, DVec3::Z),
        (v(2.0, 1.0, -1.0), v(1.0, 1.0, 1.0)),
        (v(0.0, -3.9, 0.0), v(0.0, -1.0, 0.3)),
        (v(0.0, 0.0, 3.5), -DVec3::Z),
    ] {
        let e = irradiance(point, normal, |s| {
            s.add(Light::Sphere { radius: 5.0, radiance: Vec3::ONE }, HERE);
        });
        e.assert_is(&format!("inside a ball, at {point}"), PI, 1e-3);
    }
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

#[test]
fn an_emissive_mesh_equals_the_parallelogram() {
    for (n, name) in [(1, "2 triangles"), (223, "99,458 triangles")] {
        let e = irradiance(DVec3::ZERO, DVec3::Z, |s| {
            // Counter-clockwise seen from below: its front is there.
            let mesh = grid(Vec3::new(-0.5, -0.5, 1.0), Vec3::Y, Vec3::X, n);
            s.add_mesh(mesh, Material::emissive(Vec3::ONE), HERE);
        });
        e.assert_is(name, 0.752274688454, 1e-3);
    }
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

#[test]
fn the_wrong_side_of_a_light_is_exactly_dark() {
    let dark = |name: &str, build: &dyn Fn(&mut Stage)| {
        let e = irradiance_with(64, DVec3::ZERO, DVec3::Z, build);
        assert_eq!((e.mean, e.sigma), (0.0, 0.0), "{name}");
    };
    let one_sided =
        |u, v| Light::Parallelogram { edge_u: u, edge_v: v, radiance: [Vec3::ONE; 4], two_sided: false };
    let above = DAffine3::from_translation(DVec3::Z);
    dark("back of a parallelogram", &|s| {
        s.add(one_sided(Vec3::X, Vec3::Y), above);
    });
    dark("back of a disk", &|s| {
        let disk = Light::Disk { radius: 1.0, radiance: Vec3::ONE, two_sided: false };
        s.add(disk, DAffine3::from_rotation_translation(DQuat::from_rotation_x(PI), DVec3::Z));
    });
    dark("back of an emissive mesh", &|s| {
        s.add_mesh(quad(Vec3::new(-0.5, -0.5, 1.0), Vec3::X, Vec3::Y), Material::emissive(Vec3::ONE), HERE);
    });
    dark("under the receiver", &|s| {
        panel(s, v(-0.5, -0.5, -1.0), Vec3::X, Vec3::Y);
    });
    dark("in the plane of the receiver", &|s| {
        panel(s, v(0.5, 0.5, 0.0), Vec3::X, Vec3::Y);
    });
    dark("in a closed box", &|s| {
        s.add(Light::Sphere { radius: 0.5, radiance: Vec3::ONE }, DAffine3::from_translation(DVec3::Z * 3.0));
        s.add_mesh(cube(), Material::default(), DAffine3::from_translation(DVec3::Z * 3.0));
    });
    let front = irradiance(DVec3::ZERO, DVec3::Z, |s| {
        s.add(one_sided(Vec3::Y, Vec3::X), above);
    });
    front.assert_is("front", 0.752274688454, 1e-3);
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

/// Irradiance at `p` with normal +Z from the rectangle at height `z`.
fn rectangle(p: DVec3, x: [f64; 2], y: [f64; 2], z: f64) -> f64 {
    let corners = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(i, j)| (v(x[i], y[j], z) - p).normalize());
    let mut sum = 0.0;
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let cross = a.cross(b);
        let sin = cross.length();
        if sin > 0.0 {
            sum += sin.atan2(a.dot(b)) * cross.z / sin;
        }
    }
    sum.abs() / 2.0
}

const LIGHT_HEIGHT: f64 = 4.0;
const POINTS: u32 = 201;

struct Penumbra {
    /// Height of the opaque half-plane x < 0.
    height: f64,
    /// Width of the strip that is looked at, around x = 0.
    width: f64,
    /// Pixels across the strip: independent estimates for the same x.
    rows: u32,
    scale: f64,
    shift: DVec3,
}

impl Penumbra {
    /// A film of one column for each point; `open` moves the half-plane under the floor.
    fn film(&self, samples: u32, open: bool) -> Film {
        let settings = settings(POINTS, self.rows, Integrator::Direct, 1);
        let mut stage = Stage::placed(settings, self.scale, self.shift);
        receiver(&mut stage, DVec3::ZERO, DVec3::Z, 2.0);
        panel(&mut stage, v(-0.5, -0.5, LIGHT_HEIGHT), Vec3::X, Vec3::Y);
        let z = if open { -self.height } else { self.height };
        let half_plane = quad(Vec3::new(-100.0, -100.0, z as f32), Vec3::X * 100.0, Vec3::Y * 200.0);
        stage.add_mesh(half_plane, Material::default(), HERE);
        stage.look(DVec3::Z * (0.5 * self.height), DVec3::ZERO, DVec3::Y, self.width);
        stage.trace(samples).clone()
    }

    /// Mean irradiance over a pixel of side `side` around `x`, `y`, by similar triangles.
    fn exact(&self, x: f64, y: f64, side: f64) -> f64 {
        let (nx, ny) = (16, 2);
        let mut sum = 0.0;
        for (i, j) in (0..nx).flat_map(|i| (0..ny).map(move |j| (i, j))) {
            let p = v(
                x + side * ((f64::from(i) + 0.5) / f64::from(nx) - 0.5),
                y + side * ((f64::from(j) + 0.5) / f64::from(ny) - 0.5),
                0.0,
            );
            let from = (-p.x * (LIGHT_HEIGHT - self.height) / self.height).max(-0.5);
            if from < 0.5 {
                sum += rectangle(p, [from, 0.5], [-0.5, 0.5], LIGHT_HEIGHT);
            }
        }
        sum / f64::from(nx * ny)
    }

    fn check(&self, name: &str, samples: u32, accuracy: f64) {
        let (film, open) = (self.film(samples, false), self.film(samples, true));
        let side = self.width / f64::from(POINTS);
        let edge = 0.5 * self.height / (LIGHT_HEIGHT - self.height);
        // The camera's own rounding: it looks at x + a few units in the last place.
        let margin = 1e-6 * (self.width + self.shift.abs().max_element() / self.scale / 256.0);
        // A place on the receiver, of side 4, is known to a unit in the last place of its barycentric weight, about ½: that
        // much of the penumbra's width, over which it falls from 1 to 0.
        let rounding = 4.0 / f64::from(1 << 25) / (2.0 * edge);
        let (mut dark, mut full, mut worst, mut worst_bound, mut total) = (0, 0, 0.0f64, 0.0f64, 0.0);
        for i in 0..POINTS {
            let x = (f64::from(i) + 0.5) * side - 0.5 * self.width;
            let mut off = Vec::new();
            for j in 0..self.rows {
                let y = (0.5 * f64::from(self.rows) - f64::from(j) - 0.5) * side;
                let pixel = film.pixel(i, j);
                if x + 0.5 * side < -edge - margin {
                    assert_eq!(pixel.mean(), DVec3::ZERO, "{name}: light in the umbra at {x}");
                    dark += 1;
                }
                if x - 0.5 * side > edge + margin {
                    assert_eq!(pixel, open.pixel(i, j), "{name}: some sample is not visible at {x}");
                    full += 1;
                }
                off.push(pixel.mean().x * PI / f64::from(ALBEDO) - self.exact(x, y, side));
            }
            let e = Estimate::of(&off);
            let unoccluded = rectangle(DVec3::X * x, [-0.5, 0.5], [-0.5, 0.5], LIGHT_HEIGHT);
            let bound = 4.5 * e.sigma + (1e-5 + rounding) * unoccluded;
            assert!(bound < accuracy * unoccluded, "{name}: bound {bound:.1e} at {x} accepts too much");
            assert!(e.mean.abs() <= bound, "{name}: off by {:.2e} at {x}, bound {bound:.1e}", e.mean);
            worst = worst.max(e.mean.abs() / bound);
            worst_bound = worst_bound.max(bound / unoccluded);
            total += e.mean / unoccluded;
        }
        let mean = total / f64::from(POINTS);
        println!(
            "{name}: worst {worst:.2} of its bound, bounds up to {worst_bound:.1e}, mean off {mean:+.1e}"
        );
        println!("{name}: {dark} pixels exactly dark, {full} exactly bright");
        assert!(dark > self.rows && full > self.rows);
    }
}

const PLAIN: Penumbra = Penumbra { height: 1.0, width: 0.5, rows: 64, scale: 1.0, shift: DVec3::ZERO };

#[test]
fn a_penumbra_is_that_of_similar_triangles() {
    PLAIN.check("penumbra", 512, 4e-3);
}

#[test]
fn no_light_leaks_under_a_contact() {
    let contact = Penumbra { height: 1e-3, width: 7.5e-4, rows: 16, ..PLAIN };
    contact.check("contact", 512, 1e-2);
}

#[test]
fn a_penumbra_is_the_same_small_large_and_far_away() {
    for (scale, shift) in [(1e-3, DVec3::ZERO), (1e3, DVec3::ZERO), (1.0, DVec3::splat(1e5))] {
        let placed = Penumbra { rows: 16, scale, shift, ..PLAIN };
        placed.check(&format!("scale {scale}, shift {}", shift.x), 512, 1e-2);
    }
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
