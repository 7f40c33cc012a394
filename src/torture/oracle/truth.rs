//! Ray and triangle in exact arithmetic: what is true of their floats, without any rounding.

use super::Exact;
use crate::bvh::Ray;
use glam::{DVec3, Vec3, Vec3Swizzles};

/// The truth, and how near it is to its opposite.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The ray's line goes through the triangle, border included, and not in its plane.
    pub inside: bool,
    /// Where it meets the plane; no number if it is in the plane or parallel.
    pub t: f64,
    /// The same answer follows from edge functions with errors of 8 ε of their margin's measure.
    pub certain: bool,
    /// Of the determinant n · d: the sum of its products' sizes, compared with itself.
    pub condition: f64,
}

type Vector = [Exact; 3];

fn subtract(p: &Vector, q: &Vector) -> Vector {
    [&p[0] - &q[0], &p[1] - &q[1], &p[2] - &q[2]]
}

fn cross(p: &Vector, q: &Vector) -> Vector {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &(&p[j] * &q[k]) - &(&p[k] * &q[j])
    })
}

fn dot(p: &Vector, q: &Vector) -> Exact {
    &(&(&p[0] * &q[0]) + &(&p[1] * &q[1])) + &(&p[2] * &q[2])
}

fn rounded(p: &Vector) -> DVec3 {
    DVec3::new(p[0].value(), p[1].value(), p[2].value())
}

/// ε = 2⁻²⁴, the rounding unit.
const EPSILON: f64 = 0.5 * f32::EPSILON as f64;

/// What is true of a ray and a triangle of finite floats.
///
/// Margins are measured as the triangle test computes (Woop et al. 2013): of corners p and q seen from the
/// origin, along the largest component z of the direction d, with s = d / `d_z`, an edge function is
/// (px - sx pz) (qy - sy qz) - (py - sy pz) (qx - sx qz). Its products' sizes are
/// (|px| + |sx pz|) (|qy| + |sy qz|) + (|py| + |sy pz|) (|qx| + |sx qz|).
#[must_use]
pub fn truth(ray: &Ray, corners: &[Vec3; 3]) -> Truth {
    let exact = |p: Vec3| p.to_array().map(Exact::from);
    let (origin, direction) = (exact(ray.origin), exact(ray.direction));
    let seen = corners.map(|p| subtract(&exact(p), &origin));
    let [a, b, c] = &seen;
    let edges = [dot(&direction, &cross(c, b)), dot(&direction, &cross(a, c)), dot(&direction, &cross(b, a))];
    let (ab, ac) = (subtract(b, a), subtract(c, a));
    let normal = cross(&ab, &ac);
    let (along, height) = (dot(&normal, &direction), dot(&normal, a));
    let has = |sign: i32| edges.iter().any(|e| e.sign() == sign);
    let parallel = along.sign() == 0;
    let inside = !(parallel || has(1) && has(-1));
    let t = if parallel { f64::NAN } else { height.value() / along.value() };

    let d = ray.direction.as_dvec3();
    let z = if d.z.abs() > d.x.abs().max(d.y.abs()) { 2 } else { usize::from(d.y.abs() > d.x.abs()) };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let sizes = [0, 1, 2].map(|i| {
        let p = rounded(&seen[i]).abs();
        (p[x] + (d[x] / d[z]).abs() * p[z], p[y] + (d[y] / d[z]).abs() * p[z])
    });
    // 0 where a margin is too small to tell.
    let clear = [(2, 1), (0, 2), (1, 0)].iter().zip(&edges).map(|(&(p, q), edge)| {
        let (p, q) = (sizes[p], sizes[q]);
        let off = edge.value().abs() / d[z].abs() > 8.0 * EPSILON * (p.0 * q.1 + p.1 * q.0);
        if off { edge.sign() } else { 0 }
    });
    let clear: Vec<i32> = clear.collect();
    let (e, f) = (rounded(&ab).abs(), rounded(&ac).abs());
    let normal_size = e.yzx() * f.zxy() + e.zxy() * f.yzx();
    let in_front = height.value().abs() > 8.0 * EPSILON * normal_size.dot(rounded(a).abs());
    let certain =
        if inside { !clear.contains(&0) && in_front } else { clear.contains(&1) && clear.contains(&-1) };
    Truth { inside, t, certain, condition: normal_size.dot(d.abs()) / along.value().abs() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On an edge, one float beside it, clearly beside it; in front and behind.
    #[test]
    fn exact_arithmetic_knows_edges() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let down = |x: f32, y: f32| truth(&Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z * 3.0), &corners);
        let on = down(0.5, 0.5);
        assert!(on.inside && !on.certain && on.t == 1.0 / 3.0, "{on:?}");
        let beside = down(0.5, 0.5f32.next_up());
        assert!(!beside.inside && !beside.certain, "{beside:?}");
        let tiny = down(1e-38, 1e-38);
        assert!(tiny.inside, "{tiny:?}");
        assert!(!down(-1e-45, 0.5).inside);
        assert!(!down(0.6, 0.6).inside && down(0.6, 0.6).certain);
        assert!(down(0.3, 0.3).inside && down(0.3, 0.3).certain);
        let behind = truth(&Ray::new(Vec3::new(0.3, 0.3, -1.0), Vec3::NEG_Z), &corners);
        assert!(behind.inside && behind.t == -1.0 && behind.certain, "{behind:?}");
        let in_plane = truth(&Ray::new(Vec3::new(-1.0, 0.3, 0.0), Vec3::X), &corners);
        assert!(!in_plane.inside && in_plane.t.is_nan(), "{in_plane:?}");
    }
}
