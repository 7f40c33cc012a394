//! Triangles to shoot at, made of nothing.

use crate::torture::oracle::{Rng, is_closed};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Triangles by their corners.
pub type Triangles = Vec<[Vec3; 3]>;

/// `count` triangles of about `size`, anywhere between −1 and 1.
#[must_use]
pub fn soup(count: usize, size: f32, seed: u64) -> Triangles {
    let mut rng = Rng(seed);
    (0..count)
        .map(|_| {
            let p = rng.vec();
            [p, p + rng.vec() * size, p + rng.vec() * size]
        })
        .collect()
}

/// A closed bumpy sphere of radius 2.
#[must_use]
pub fn bumpy_sphere() -> Triangles {
    const RINGS: usize = 16;
    let mut rng = Rng(1);
    let bumps: Vec<f32> = (0..(RINGS + 1) * RINGS).map(|_| 1.0 + 0.2 * rng.unit()).collect();
    let vertex = |i: usize, j: usize| {
        if i == 0 || i == RINGS {
            return Vec3::Y * if i == 0 { 2.0 } else { -2.0 };
        }
        let (theta, phi) = (PI * i as f32 / RINGS as f32, TAU * (j % RINGS) as f32 / RINGS as f32);
        let p = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        p * 2.0 * bumps[i * RINGS + j % RINGS]
    };
    let mut triangles = Vec::new();
    for (i, j) in (0..RINGS).flat_map(|i| (0..RINGS).map(move |j| (i, j))) {
        let (a, b, c, d) = (vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j));
        if i > 0 {
            triangles.push([a, b, c]);
        }
        if i < RINGS - 1 {
            triangles.push([a, c, d]);
        }
    }
    triangles
}

/// A closed tube along a trefoil knot, of `around` sides and `along` rings.
#[must_use]
pub fn knot(around: usize, along: usize) -> Triangles {
    let center = |i: usize| {
        let a = TAU * (i % along) as f32 / along as f32;
        let r = 2.0 + (3.0 * a).cos();
        Vec3::new(r * (2.0 * a).cos(), r * (2.0 * a).sin(), 1.5 * (3.0 * a).sin())
    };
    let vertex = |i: usize, j: usize| {
        let ahead = (center(i + 1) - center(i + along - 1)).normalize();
        // Not along the tube anywhere: the knot is never straight up.
        let side = ahead.cross(Vec3::new(0.1, 0.2, 1.0)).normalize();
        let b = TAU * (j % around) as f32 / around as f32;
        center(i) + (side * b.cos() + ahead.cross(side) * b.sin()) * 0.4
    };
    let quads = (0..along).flat_map(|i| (0..around).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let (a, b, c, d) = (vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// A closed tube of needles along a diagonal: slivers, which are split before building.
#[must_use]
pub fn needle_tube() -> Triangles {
    const SIDES: usize = 24;
    let along = Vec3::new(40.0, 37.0, 31.0);
    let across = along.any_orthonormal_vector();
    let other = along.normalize().cross(across);
    let point = |i: usize| {
        let angle = TAU * (i % SIDES) as f32 / SIDES as f32;
        (across * angle.cos() + other * angle.sin()) * 0.6
    };
    (0..SIDES)
        .flat_map(|i| {
            let (a, b) = (point(i), point(i + 1));
            [
                [-along + a, -along + b, along + b],
                [-along + a, along + b, along + a],
                [-along * 1.02, -along + b, -along + a],
                [along * 1.02, along + a, along + b],
            ]
        })
        .collect()
}

/// Two cones of 500 sides base to base: as many triangles at one corner.
#[must_use]
pub fn double_cone() -> Triangles {
    const SIDES: usize = 500;
    let rim = |i: usize| {
        let angle = TAU * (i % SIDES) as f32 / SIDES as f32;
        Vec3::new(10.0 * angle.cos(), 0.0, 10.0 * angle.sin())
    };
    (0..SIDES)
        .flat_map(|i| [[Vec3::Y * 4.0, rim(i + 1), rim(i)], [Vec3::Y * -4.0, rim(i), rim(i + 1)]])
        .collect()
}

/// The border of the cube from −1 to 1 in squares of which 8 are an edge: all boxes are flat, all edges along axes.
#[must_use]
pub fn squared_cube() -> Triangles {
    const N: i32 = 8;
    let mut triangles = Vec::new();
    for (axis, end) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let at = |i: i32, j: i32| {
            let mut p = Vec3::splat(end);
            p[(axis + 1) % 3] = 2.0 * i as f32 / N as f32 - 1.0;
            p[(axis + 2) % 3] = 2.0 * j as f32 / N as f32 - 1.0;
            p
        };
        for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            let outward = if end > 0.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
            triangles.extend(outward);
        }
    }
    triangles
}

/// Closed meshes with their names.
#[must_use]
pub fn closed() -> Vec<(&'static str, Triangles)> {
    vec![
        ("bumpy sphere", bumpy_sphere()),
        ("knot", knot(8, 96)),
        ("needles", needle_tube()),
        ("double cone", double_cone()),
        ("squared cube", squared_cube()),
    ]
}

/// The same triangles where each corner goes; those that collapse in rounding are dropped. `None` if the mesh is not
/// closed any more.
pub fn moved(triangles: &[[Vec3; 3]], place: impl Fn(Vec3) -> Vec3) -> Option<Triangles> {
    let triangles = with_surface(triangles.iter().map(|t| t.map(&place)));
    (is_closed(&triangles) && !triangles.is_empty()).then_some(triangles)
}

/// Those that have an area, judged in double precision.
pub fn with_surface(triangles: impl Iterator<Item = [Vec3; 3]>) -> Triangles {
    let has_surface = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        normal.is_finite() && normal != glam::DVec3::ZERO
    };
    triangles.filter(has_surface).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::oracle::{inside, winding_number};

    #[test]
    fn closed_meshes_are_closed_and_have_an_inside() {
        for (name, triangles) in closed() {
            assert!(is_closed(&triangles), "{name}");
            assert!(!inside(&mut Rng(1), &triangles, 5).is_empty(), "{name}");
            assert!(winding_number(&triangles, Vec3::new(99.0, 77.0, -55.0)).abs() < 1e-6, "{name}");
            let mut open = triangles;
            open.pop();
            assert!(!is_closed(&open), "{name}");
        }
    }
}
