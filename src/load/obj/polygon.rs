//! Polygons → triangles, also where the polygon is concave.

use glam::{DVec2, DVec3};

/// Inside-tests that one polygon may cost before the rest of it becomes a fan.
const MOST_TESTS: usize = 50_000_000;

/// Corners of `n - 2` triangles that cover the polygon with its area, each turning as it does.
///
/// A fan where that is right (all convex polygons), else ear clipping in the polygon's plane (of
/// Newell's normal). What crosses itself or has no area gets some triangles.
pub(super) fn triangulate(points: &[DVec3]) -> Vec<[usize; 3]> {
    let n = points.len();
    if n < 3 {
        return Vec::new();
    }
    if n == 3 {
        return vec![[0, 1, 2]];
    }
    let Some(flat) = project(points) else {
        return fan(n, 0);
    };
    let starts = if n <= 8 { n } else { 1 };
    match (0..starts).find(|&start| fan_covers(&flat, start)) {
        Some(start) => fan(n, start),
        None => clip_ears(&flat),
    }
}

/// Newell's normal: twice the polygon's area long.
pub(super) fn newell(points: &[DVec3]) -> DVec3 {
    let origin = points.first().copied().unwrap_or_default();
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(&a, &b)| (a - origin).cross(b - origin)).sum()
}

/// The polygon in its own plane, counter-clockwise; None if it has no area.
fn project(points: &[DVec3]) -> Option<Vec<DVec2>> {
    let normal = newell(points).try_normalize()?;
    let (u, v) = normal.any_orthonormal_pair();
    let origin = points[0];
    Some(points.iter().map(|&p| DVec2::new((p - origin).dot(u), (p - origin).dot(v))).collect())
}

fn fan(n: usize, start: usize) -> Vec<[usize; 3]> {
    (1..n - 1).map(|i| [start, (start + i) % n, (start + i + 1) % n]).collect()
}

/// Twice the signed area.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether no triangle of the fan is turned over.
fn fan_covers(points: &[DVec2], start: usize) -> bool {
    let n = points.len();
    let total: f64 =
        (1..n - 1).map(|i| turn(points[start], points[(start + i) % n], points[(start + i + 1) % n])).sum();
    let slack = -1e-12 * total.abs();
    (1..n - 1).all(|i| turn(points[start], points[(start + i) % n], points[(start + i + 1) % n]) >= slack)
}

/// Cuts off ears until three corners are left. Quadratic in the corners, times the concave ones.
fn clip_ears(points: &[DVec2]) -> Vec<[usize; 3]> {
    let n = points.len();
    let mut next: Vec<usize> = (1..n).chain([0]).collect();
    let mut previous: Vec<usize> = [n - 1].into_iter().chain(0..n - 1).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    let (mut here, mut left, mut tried, mut tests) = (0, n, 0, 0);
    // A corner that is flat is cut last: it may still be needed to reach across.
    let mut accept_flat = false;
    while left > 3 {
        let (a, c) = (previous[here], next[here]);
        let area = turn(points[a], points[here], points[c]);
        let desperate = tried > 2 * left || tests > MOST_TESTS;
        let is_ear = area > 0.0 || (area == 0.0 && accept_flat);
        if desperate || (is_ear && !holds_a_corner(points, &next, [a, here, c], &mut tests)) {
            triangles.push([a, here, c]);
            next[a] = c;
            previous[c] = a;
            left -= 1;
            tried = 0;
            accept_flat = false;
            here = c;
        } else {
            tried += 1;
            accept_flat = tried > left;
            here = c;
        }
    }
    triangles.push([previous[here], here, next[here]]);
    triangles
}

/// Whether another corner lies in the triangle. One at the same place as a tip does not count.
fn holds_a_corner(points: &[DVec2], next: &[usize], [a, b, c]: [usize; 3], tests: &mut usize) -> bool {
    let [pa, pb, pc] = [a, b, c].map(|i| points[i]);
    let mut other = next[c];
    while other != a {
        *tests += 1;
        let p = points[other];
        let is_tip = p == pa || p == pb || p == pc;
        if !is_tip && turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0 {
            return true;
        }
        other = next[other];
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3]) -> f64 {
        let triangles = triangulate(points);
        assert_eq!(triangles.len(), points.len() - 2);
        let normal = newell(points);
        let parts = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| points[i]);
            let cross = (b - a).cross(c - a);
            assert!(cross.dot(normal) >= 0.0, "turned over");
            0.5 * cross.length()
        });
        parts.sum()
    }

    #[test]
    fn a_concave_polygon_keeps_its_area_from_every_corner() {
        let mut l =
            [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]].map(|[x, y]| DVec3::new(3.0, x, y));
        for _ in 0..6 {
            l.rotate_left(1);
            assert!((area(&l) - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_comb_needs_real_ears() {
        let mut comb = vec![DVec3::new(0., 0., 0.), DVec3::new(20., 0., 0.)];
        for tooth in (0..10).rev() {
            let x = 2.0 * f64::from(tooth);
            comb.extend([[x + 2., 1.], [x + 1.5, 5.], [x + 1.0, 1.]].map(|[x, y]| DVec3::new(x, y, 0.)));
        }
        comb.push(DVec3::new(0., 1., 0.));
        assert!((area(&comb) - newell(&comb).length() / 2.0).abs() < 1e-9);
    }

    #[test]
    fn collinear_corners_lose_no_area() {
        let square =
            [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [1., 2.], [0., 2.]].map(|[x, y]| DVec3::new(x, y, 0.));
        assert!((area(&square) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn hopeless_polygons_still_end() {
        let bow_tie = [[0., 0.], [1., 1.], [1., 0.], [0., 1.]].map(|[x, y]| DVec3::new(x, y, 0.));
        assert_eq!(triangulate(&bow_tie).len(), 2);
        assert_eq!(triangulate(&[DVec3::ONE; 5]).len(), 3);
        assert_eq!(triangulate(&[DVec3::ONE; 2]).len(), 0);
    }
}
