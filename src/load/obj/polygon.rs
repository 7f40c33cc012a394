//! Polygons → triangles, also where the polygon is concave.

use glam::{DVec2, DVec3};

/// Inside-tests that one polygon may cost before the rest of it is cut anyhow.
const MOST_TESTS: usize = 50_000_000;

/// Corners of `n - 2` triangles that cover the polygon with its area, each turning as it does; and whether it was not given up
/// for all its corners.
///
/// A fan where that is right (all convex polygons), else ear clipping in the polygon's plane (of
/// Newell's normal). What crosses itself or has no area gets some triangles.
pub(super) fn triangulate(points: &[DVec3]) -> (Vec<[usize; 3]>, bool) {
    let n = points.len();
    if n < 3 {
        return (Vec::new(), true);
    }
    if n == 3 {
        return (vec![[0, 1, 2]], true);
    }
    let Some(flat) = project(points) else {
        return (fan(n, 0), true);
    };
    let starts = if n <= 8 { n } else { 1 };
    match (0..starts).find(|&start| fan_covers(&flat, start)) {
        Some(start) => (fan(n, start), true),
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

/// Cuts off ears until three corners are left. An ear holds no other corner; if any, then one where the polygon is not convex,
/// and of these a grid knows which are near.
fn clip_ears(points: &[DVec2]) -> (Vec<[usize; 3]>, bool) {
    let n = points.len();
    let mut next: Vec<usize> = (1..n).chain([0]).collect();
    let mut previous: Vec<usize> = [n - 1].into_iter().chain(0..n - 1).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    let (mut here, mut left, mut tried) = (0, n, 0);
    let mut hollows = Hollows::new(points);
    // A corner that is flat is cut last: it may still be needed to reach across.
    let mut accept_flat = false;
    while left > 3 {
        let (a, c) = (previous[here], next[here]);
        let area = turn(points[a], points[here], points[c]);
        let desperate = tried > 2 * left || hollows.tests > MOST_TESTS;
        let is_ear = area > 0.0 || (area == 0.0 && accept_flat);
        if desperate || (is_ear && !hollows.any_in([a, here, c])) {
            triangles.push([a, here, c]);
            next[a] = c;
            previous[c] = a;
            left -= 1;
            tried = 0;
            accept_flat = false;
            hollows.forget(here);
            for corner in [a, c] {
                if turn(points[previous[corner]], points[corner], points[next[corner]]) > 0.0 {
                    hollows.forget(corner);
                }
            }
            here = c;
        } else {
            tried += 1;
            accept_flat = tried > left;
            here = c;
        }
    }
    triangles.push([previous[here], here, next[here]]);
    (triangles, hollows.tests <= MOST_TESTS)
}

/// Corners where the polygon is not convex, by where they are.
struct Hollows<'a> {
    points: &'a [DVec2],
    /// By corner. None becomes one while ears are cut off, but some no longer are.
    is_one: Vec<bool>,
    /// How many there are, and how many there were when the grid was made.
    left: usize,
    known: usize,
    low: DVec2,
    /// Of a cell.
    size: DVec2,
    across: usize,
    /// Rows of cells, those of a row from left to right.
    cells: Vec<Vec<u32>>,
    tests: usize,
}

impl<'a> Hollows<'a> {
    fn new(points: &'a [DVec2]) -> Self {
        let n = points.len();
        let around = |i: usize| [(i + n - 1) % n, i, (i + 1) % n].map(|corner| points[corner]);
        let is_hollow = |i: usize| {
            let [before, here, after] = around(i);
            turn(before, here, after) <= 0.0
        };
        let is_one: Vec<bool> = (0..n).map(is_hollow).collect();
        let left = is_one.iter().filter(|&&is_one| is_one).count();
        let (low, size, cells) = (DVec2::ZERO, DVec2::ONE, Vec::new());
        let mut hollows = Self { points, is_one, left, known: left, low, size, across: 1, cells, tests: 0 };
        hollows.sort();
        hollows
    }

    /// It is none any more.
    fn forget(&mut self, corner: usize) {
        self.left -= usize::from(std::mem::take(&mut self.is_one[corner]));
        // Ears grow: they shall not cover ever more cells with ever less in them.
        if self.left < self.known / 4 {
            self.sort();
        }
    }

    /// Makes the grid, of about as many cells as there are to be in it.
    fn sort(&mut self) {
        let points = self.points;
        let low = points.iter().fold(DVec2::INFINITY, |low, point| low.min(*point));
        let high = points.iter().fold(DVec2::NEG_INFINITY, |high, point| high.max(*point));
        self.known = self.left;
        self.across = ((self.left as f64).sqrt() as usize).clamp(1, 1024);
        (self.low, self.size) = (low, (high - low) / self.across as f64);
        self.cells = vec![Vec::new(); self.across * self.across];
        for corner in (0..points.len()).filter(|&corner| self.is_one[corner]) {
            let [x, y] = self.cell(points[corner]);
            self.cells[y * self.across + x].push(corner as u32);
        }
    }

    fn cell(&self, point: DVec2) -> [usize; 2] {
        // Where all are on a line, cells have no size: what is no number becomes 0.
        let place = ((point - self.low) / self.size).to_array();
        place.map(|place| (place as usize).min(self.across - 1))
    }

    /// Whether one lies in the triangle. One at the same place as a tip does not count.
    fn any_in(&mut self, triangle: [usize; 3]) -> bool {
        let [a, b, c] = triangle.map(|corner| self.points[corner]);
        let [left, bottom] = self.cell(a.min(b).min(c));
        let [right, top] = self.cell(a.max(b).max(c));
        let cells = (bottom..=top).flat_map(|y| (left..=right).map(move |x| [x, y]));
        for [x, y] in cells {
            let cell = &mut self.cells[y * self.across + x];
            cell.retain(|&corner| self.is_one[corner as usize]);
            self.tests += 1 + cell.len();
            let holds = |&corner: &u32| {
                let p = self.points[corner as usize];
                let is_tip = p == a || p == b || p == c;
                !is_tip && turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
            };
            if cell.iter().any(holds) {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3]) -> f64 {
        let (triangles, is_right) = triangulate(points);
        assert!(is_right);
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

    /// Coastlines, gears and spirals of CAD and maps, with as many corners.
    #[test]
    fn outlines_of_very_many_corners_keep_their_area() {
        let at = |angle: f64, radius: f64| DVec3::new(radius * angle.cos(), 0.5, radius * angle.sin());
        let n = 60_000;
        let part = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let gear: Vec<DVec3> = (0..n).map(|i| at(-part(i), if i / 2 % 2 == 0 { 1.0 } else { 0.8 })).collect();
        let coast: Vec<DVec3> = (0..n)
            .map(|i| at(part(i), 1.0 + 0.2 * (7.0 * part(i)).sin() + 0.01 * ((i * i % 101) as f64 / 101.0)))
            .collect();
        let arm = |i: usize| 0.1 + 0.9 * i as f64 / n as f64;
        let spiral = (0..n / 2).map(|i| at(12.0 * part(2 * i), arm(2 * i)));
        let back = (0..n / 2).rev().map(|i| at(12.0 * part(2 * i), arm(2 * i) - 0.02));
        for outline in [gear, coast, spiral.chain(back).collect()] {
            let right = newell(&outline).length() / 2.0;
            assert!((area(&outline) / right - 1.0).abs() < 1e-9, "{right}");
        }
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
        assert_eq!(triangulate(&bow_tie).0.len(), 2);
        assert_eq!(triangulate(&[DVec3::ONE; 5]).0.len(), 3);
        assert_eq!(triangulate(&[DVec3::ONE; 2]).0.len(), 0);
    }
}
