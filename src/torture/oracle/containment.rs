//! Whether a hierarchy holds all of every triangle, in however many parts.

use crate::bvh::wide::{Child, WIDTH};
use crate::bvh::{Aabb, Blas, WideBvh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Points inside of a triangle, no two with the same weight of a corner; and on each edge, with its ends.
const INSIDE: usize = 100;
const ON_EDGE: usize = 20;

/// Checks everything that a traversal relies on, and that no part of any triangle is missing.
///
/// A triangle in one leaf must be inside its box, exactly. Of one that was split, each of 160 points
/// must be inside the box of one of its leaves.
///
/// # Errors
/// What the first defect is.
pub fn check(blas: &Blas, triangles: &[[Vec3; 3]]) -> Result<(), String> {
    check_hierarchy(blas.hierarchy(), triangles)
}

/// The same of a hierarchy that need not be a [`Blas`]'s.
///
/// # Errors
/// What the first defect is.
pub fn check_hierarchy(hierarchy: &WideBvh, triangles: &[[Vec3; 3]]) -> Result<(), String> {
    hierarchy.check(None).map_err(|defect| defect.to_string())?;
    // For each entry of `prims` the box of its leaf.
    let mut around = vec![None; hierarchy.prims.len()];
    for node in &hierarchy.nodes {
        for slot in (0..WIDTH).filter(|&slot| !node.child_bounds(slot).is_empty()) {
            let Child::Leaf { first, count } = Child::unpack(node.children[slot]) else {
                continue;
            };
            for (entry, around) in (first..).zip(&mut around[first..first + count]) {
                if around.replace(node.child_bounds(slot)).is_some() {
                    return Err(format!("entry {entry} is in two leaves"));
                }
            }
        }
    }
    let mut entries: Vec<(u32, Aabb)> = Vec::with_capacity(around.len());
    for (entry, (&prim, aabb)) in hierarchy.prims.iter().zip(around).enumerate() {
        if prim as usize >= triangles.len() {
            return Err(format!("entry {entry} is triangle {prim} of {}", triangles.len()));
        }
        entries.push((prim, aabb.ok_or_else(|| format!("entry {entry} is in no leaf"))?));
    }
    entries.sort_unstable_by_key(|&(prim, _)| prim);
    triangles.par_iter().enumerate().try_for_each(|(index, corners)| {
        let first = entries.partition_point(|&(prim, _)| (prim as usize) < index);
        let last = entries.partition_point(|&(prim, _)| prim as usize <= index);
        match &entries[first..last] {
            [] if has_surface(corners) => Err(format!("triangle {index} is in no leaf")),
            [] => Ok(()),
            [(_, aabb)] if aabb.contains(&Aabb::around(corners)) => Ok(()),
            [_] => Err(format!("triangle {index} sticks out of its leaf")),
            parts => match missing_point(corners, parts) {
                Some(p) => Err(format!("{p} of triangle {index} is in none of its {} leaves", parts.len())),
                None => Ok(()),
            },
        }
    })
}

/// A point of the triangle that is in none of the boxes.
fn missing_point(corners: &[Vec3; 3], parts: &[(u32, Aabb)]) -> Option<DVec3> {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    // By so much the sum below may be off, in double precision; a float's own step is 2²⁷ times larger.
    let rounding = low.abs().max(high.abs()) * (4.0 * f64::EPSILON);
    // M. Roberts' R2 sequence, folded into the triangle.
    let inside = (1..=INSIDE).map(|i| {
        let (u, v) = ((i as f64 * 0.754_877_666_246_693).fract(), (i as f64 * 0.569_840_290_998_053).fract());
        if u + v < 1.0 { (u, v) } else { (1.0 - u, 1.0 - v) }
    });
    let on_edges = (0..ON_EDGE).flat_map(|i| {
        let s = i as f64 / ON_EDGE as f64;
        [(s, 0.0), (1.0 - s, s), (0.0, 1.0 - s)]
    });
    on_edges.chain(inside).map(|(u, v)| a * (1.0 - u - v) + b * u + c * v).find(|&p| {
        !parts.iter().any(|(_, part)| {
            let (min, max) = (part.min.as_dvec3() - rounding, part.max.as_dvec3() + rounding);
            min.cmple(p).all() && p.cmple(max).all()
        })
    })
}

/// Judged in double precision.
fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
