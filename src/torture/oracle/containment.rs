//! Whether a hierarchy holds all of every triangle, in however many parts.

use crate::bvh::wide::{Child, WIDTH};
use crate::bvh::{Aabb, Blas, WideBvh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Checks everything that a traversal relies on, and that no part of any triangle is missing.
///
/// A triangle in one leaf must be inside its box, exactly. Of one that was split, nothing may be left when the boxes of
/// its leaves are cut away, in double precision.
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

/// A point of the triangle that is in none of the boxes: the middle of what is left of it when they are cut away.
fn missing_point(corners: &[Vec3; 3], parts: &[(u32, Aabb)]) -> Option<DVec3> {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    // By so much a corner of what is cut may be off, in double precision; a float's own step is 2²⁶ times larger.
    let rounding = a.abs().max(b.abs()).max(c.abs()) * (8.0 * f64::EPSILON);
    let mut left = vec![vec![a, b, c]];
    for (_, part) in parts {
        let (min, max) = (part.min.as_dvec3() - rounding, part.max.as_dvec3() + rounding);
        left = left.into_iter().flat_map(|piece| outside(piece, min, max)).collect();
    }
    left.first().map(|piece| piece.iter().sum::<DVec3>() / piece.len() as f64)
}

/// The pieces of a polygon that are beyond the faces of a box.
fn outside(mut inside: Vec<DVec3>, min: DVec3, max: DVec3) -> Vec<Vec<DVec3>> {
    let whole = inside.clone();
    let mut pieces = Vec::new();
    for axis in 0..3 {
        for (sign, face) in [(1.0, max[axis]), (-1.0, -min[axis])] {
            let height = |p: &DVec3| sign * p[axis] - face;
            if inside.iter().all(|p| height(p) <= 0.0) {
                continue;
            }
            pieces.push(half(&inside, |p| height(p)));
            inside = half(&inside, |p| -height(p));
            if inside.is_empty() {
                // The box has nothing of it: it stays in one piece.
                return vec![whole];
            }
        }
    }
    pieces
}

/// What of a polygon is at heights above 0, its border included; nothing if it only touches that.
///
/// Reference: I. E. Sutherland, G. W. Hodgman, "Reentrant Polygon Clipping", CACM 17(1), 1974.
fn half(corners: &[DVec3], height: impl Fn(&DVec3) -> f64) -> Vec<DVec3> {
    if corners.iter().all(|p| height(p) <= 0.0) {
        return Vec::new();
    }
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % corners.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            above.push(*a);
        }
        if ha > 0.0 && hb < 0.0 || ha < 0.0 && hb > 0.0 {
            above.push(*a + (*b - *a) * (ha / (ha - hb)));
        }
    }
    above
}

/// Judged in double precision.
fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(all: &[[f32; 6]]) -> Vec<(u32, Aabb)> {
        let aabb = |b: &[f32; 6]| Aabb { min: Vec3::new(b[0], b[1], b[2]), max: Vec3::new(b[3], b[4], b[5]) };
        all.iter().map(|b| (0, aabb(b))).collect()
    }

    /// A needle along a diagonal in boxes along it, of which one is missing, or a little too small.
    #[test]
    fn what_no_box_holds_is_found() {
        let needle = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 1e-3)];
        let mut all: Vec<[f32; 6]> = (0..10)
            .map(|i| {
                let [from, to] = [i, i + 1].map(|k| k as f32 / 10.0);
                [from, from, 0.0, to, to, 1e-3]
            })
            .collect();
        assert_eq!(missing_point(&needle, &boxes(&all)), None);
        let last = all.pop();
        let p = missing_point(&needle, &boxes(&all)).unwrap();
        assert!(p.x > 0.9 && p.x < 1.0, "{p}");
        all.extend(last);
        // A float's step too small, where no point that somebody chose would be.
        all[4][3] = all[4][3].next_down();
        assert!(missing_point(&needle, &boxes(&all)).is_some());
    }
}
