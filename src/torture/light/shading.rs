//! H2, H4: normals of odd and mapped surfaces.

use super::meter::{larger, no_light};
use super::terminator::sun;
use crate::scene::{
    Encoding, Filter, Glossy, Light, Material, NormalMap, Texels, Texture, TriangleMesh, Wrap,
};
use crate::torture::oracle::Rng;
use crate::torture::stage::{Stage, ball, reds, settings};
use crate::torture::{Case, Check, Trial};
use crate::trace::Integrator;
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;

const HERE: DAffine3 = DAffine3::IDENTITY;

/// Numbers that files have been seen to hold.
const ODD: [f32; 12] =
    [0.0, -0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 1e-30, 1e-45, f32::MAX];

fn odd(rng: &mut Rng) -> f32 {
    if rng.bits() & 1 == 0 { rng.unit() * 2.0 - 1.0 } else { ODD[rng.bits() as usize % ODD.len()] }
}

/// A ball under a white sky, whatever its normals: white where it is diffuse, and never black.
fn odd_normals(trial: &Trial<'_>) -> Vec<Check> {
    let kinds: [(&str, fn(Vec3, &mut Rng) -> Vec3); 6] = [
        ("zero", |_, _| Vec3::ZERO),
        ("no number", |_, _| Vec3::NAN),
        ("backward", |p, _| -p),
        ("opposite at every other corner", |p, rng| if rng.bits() & 1 == 0 { p } else { -p }),
        ("tiny", |p, _| p * 1e-30),
        ("anything", |_, rng| Vec3::new(odd(rng), odd(rng), odd(rng))),
    ];
    let surfaces = [
        ("diffuse", Material::lambert(Vec3::ONE)),
        (
            "metal",
            Material {
                glossy: Glossy::Ggx { metallic: 1.0, roughness: 0.3, texture: None },
                ..Material::lambert(Vec3::ONE)
            },
        ),
        ("mirror", Material::perfect_mirror(Vec3::ONE)),
    ];
    let mut checks = Vec::new();
    for (name, normal) in kinds {
        for (surface, material) in &surfaces {
            if trial.interrupted() {
                return checks;
            }
            let mut rng = Rng(trial.seed.wrapping_add(1));
            let mut mesh = ball(8);
            mesh.normals = mesh.positions.iter().map(|p| normal(*p, &mut rng)).collect();
            let mut stage = Stage::new(settings(64, 64, Integrator::Path, 4));
            stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
            stage.add_mesh(mesh, material.clone(), HERE);
            stage.look(DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO, DVec3::Y, 2.2);
            let (film, _) = stage.expose(16, || true);
            let what = format!("{name}, {surface}: black or no number");
            checks.push(no_light(what, &reds(&film), true));
            checks.push(Check::none(
                format!("{name}, {surface}: dropped"),
                64 * 64 * 16,
                "samples",
                film.dropped(),
            ));
            trial.tell("H2", name, 0.5);
        }
    }
    checks
}

/// A square of size 2 with u along +X and v along −Y, whose normal map is one texel.
fn mapped(texel: [u8; 4], scale: f32, tangent: Vec4, uvs: [Vec2; 4], place: DAffine3, eye: DVec3) -> Stage {
    let mut stage = Stage::new(settings(8, 8, Integrator::Direct, 1));
    let mesh = TriangleMesh {
        positions: [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: uvs.to_vec(),
        tangents: vec![tangent; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let texels = Arc::new(Texels { width: 1, height: 1, texels: vec![texel] });
    let texture =
        Texture { texels, encoding: Encoding::Linear, wrap: [Wrap::Repeat; 2], filter: Filter::Nearest };
    let texture = stage.app.world.spawn(texture).id();
    let normal_map = Some(NormalMap { texture: texture.into(), scale });
    stage.add_mesh(mesh, Material { normal_map, double_sided: true, ..Material::lambert(Vec3::ONE) }, place);
    stage.look(eye, DVec3::ZERO, eye.any_orthonormal_vector(), 0.1 * eye.length());
    stage
}

const UVS: [Vec2; 4] = [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO];

/// The tangent along u and the strength, as they are.
#[must_use]
pub fn as_it_is(_: &DMat3, strength: f32) -> (Vec4, f32) {
    (Vec4::new(1.0, 0.0, 0.0, 1.0), strength)
}

/// The normal that a mapped square is shaded by, as suns see it: off the exact one by. `told` makes the tangent and
/// strength that are used of how the square is placed and of the true strength.
#[must_use]
pub fn carried(trial: &Trial<'_>, told: impl Fn(&DMat3, f32) -> (Vec4, f32)) -> Vec<Check> {
    let texel = [178, 153, 230, 255];
    let n = (Vec3::new(178.0, 153.0, 230.0) / 255.0 * 2.0 - 1.0).as_dvec3();
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 0.8);
    let mut worst = 0.0f64;
    let mut tried = 0;
    for scale in [
        DVec3::ONE,
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(1.0, -1.0, 1.0),
        DVec3::new(2.0, 2.0, -2.0),
        DVec3::new(3.0, 1.0, 0.2),
        DVec3::splat(1e-3),
    ] {
        for strength in [1.0f32, 0.5, 0.0] {
            for side in [1.0, -1.0] {
                let matrix = turn * DMat3::from_diagonal(scale);
                let axis = |v: DVec3| (matrix * v).normalize();
                let out = axis(DVec3::Z);
                let tilt = f64::from(strength);
                let expected = (axis(DVec3::X) * n.x * tilt + axis(DVec3::Y) * n.y * tilt + out * n.z)
                    .normalize()
                    * side;
                let (tangent, told) = told(&matrix, strength);
                // A sun from near the normal itself: irradiance is the cosine.
                for toward in [expected, (expected + out.any_orthonormal_vector() * 0.2).normalize()] {
                    let place = DAffine3::from_mat3(matrix);
                    let eye = out * side * 3.0 * scale.x.abs();
                    let mut stage = mapped(texel, told, tangent, UVS, place, eye);
                    sun(&mut stage, toward);
                    let (film, _) = stage.expose(1, || true);
                    let cosine = toward.dot(expected);
                    let off = reds(&film)
                        .iter()
                        .map(|r| (r * std::f64::consts::PI - cosine).abs())
                        .fold(0.0, larger);
                    worst = larger(worst, off);
                    tried += 64;
                }
            }
        }
    }
    trial.tell("H4", "carried along", 0.5);
    vec![Check::new(
        "placed, mirrored, squeezed, from both sides: cosine off by",
        tried,
        "pixels",
        worst,
        1e-5,
    )]
}

/// Tangents and texture coordinates that say nothing: some light, no black, no NaN.
fn odd_maps(trial: &Trial<'_>) -> Vec<Check> {
    let count = trial.pick(200, 2000, 100_000);
    let of = |i: u64| {
        let mut rng = Rng(trial.seed.wrapping_add(i));
        let tangent = Vec4::new(odd(&mut rng), odd(&mut rng), odd(&mut rng), odd(&mut rng));
        let uvs = [0; 4].map(|_| Vec2::new(odd(&mut rng), odd(&mut rng)));
        let texel = [0; 4].map(|_| rng.bits() as u8);
        let mut stage = mapped(texel, rng.unit() * 4.0, tangent, uvs, HERE, DVec3::new(0.9, 0.6, 3.0));
        stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
        let (film, _) = stage.expose(16, || true);
        (no_light("", &reds(&film), true).ours as u64, film.dropped())
    };
    let (wrong, dropped) = (0..count)
        .into_par_iter()
        .filter(|_| !trial.interrupted())
        .map(of)
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    vec![
        Check::none("odd tangents and coordinates: black or no number", count * 64, "pixels", wrong),
        Check::none("odd tangents and coordinates: dropped", count * 64 * 16, "samples", dropped),
    ]
}

/// Odd normals.
pub const H2: Case = Case {
    id: "H2",
    title: "normals that are zero, no number, backward: no black dot under a white sky",
    limit: "0",
    run: odd_normals,
};

/// Normal maps.
pub const H4: Case = Case {
    id: "H4",
    title: "normal maps: carried along by placements; without directions, no harm",
    limit: "1e-5; 0 black pixels",
    run: |trial| [carried(trial, as_it_is), odd_maps(trial)].concat(),
};
