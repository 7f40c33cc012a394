//! G3: directions with zero components, origins on faces of boxes, flat boxes: all that makes 0 · ∞.

use super::meshes::Triangles;
use crate::bvh::{Hit, Ray};
use crate::torture::oracle::{Answers, Maker, ask, kernels};
use crate::torture::{Case, Check, Place, Trial};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

pub(super) const CASE: Case = Case {
    id: "G3",
    title: "directions with components of 0 and -0, origins on faces of boxes, flat boxes",
    limit: "the nearest hit, any hit and t are those of whole numbers",
    run: |trial| run(trial, &kernels()),
};

/// Triangles of whole coordinates from 0 to 8, in planes of constant x, y or z.
pub struct Grid {
    triangles: Vec<[IVec3; 3]>,
    /// For each unit cube, numbered by x + 10 y + 100 z from -1 on, the triangles on its border.
    near: Vec<Vec<u32>>,
}

impl Grid {
    /// Of these.
    #[must_use]
    pub fn new(triangles: Vec<[IVec3; 3]>) -> Self {
        let mut near = vec![Vec::new(); 1000];
        for (triangle, number) in triangles.iter().zip(0..) {
            let low = triangle.iter().fold(IVec3::MAX, |low, &p| low.min(p));
            let high = triangle.iter().fold(IVec3::MIN, |high, &p| high.max(p));
            for (cube, near) in near.iter_mut().enumerate() {
                let corner = IVec3::new(cube as i32 % 10, cube as i32 / 10 % 10, cube as i32 / 100) - 1;
                if corner.cmple(high).all() && low.cmple(corner + 1).all() {
                    near.push(number);
                }
            }
        }
        Self { triangles, near }
    }

    /// The cubes from 0 to 8 that are there.
    pub fn cubes(there: impl Fn(IVec3) -> bool) -> Self {
        let mut triangles = Vec::new();
        for cube in (0..512).map(|i| IVec3::new(i % 8, i / 8 % 8, i / 64)).filter(|&cube| there(cube)) {
            for axis in 0..3 {
                triangles.extend(square(cube, axis));
                triangles.extend(square(cube + IVec3::AXES[axis], axis));
            }
        }
        Self::new(triangles)
    }

    /// Half-unit steps to the first triangle that is hit, and the lowest number of those hit there. Everything
    /// is whole: the origin is given in half units, and all planes are met at whole steps.
    #[must_use]
    pub fn first_hit(&self, origin: IVec3, direction: IVec3) -> Option<(i32, u32)> {
        (1..=20).find_map(|steps| {
            let p = origin + direction * steps;
            if p.min_element() < -2 || p.max_element() > 18 {
                return None;
            }
            let cube = (p + 2).map(|x| (x / 2).min(9));
            let near = &self.near[(cube.x + 10 * cube.y + 100 * cube.z) as usize];
            near.iter().find(|&&n| holds(&self.triangles[n as usize], p, direction)).map(|&n| (steps, n))
        })
    }

    /// As floats.
    #[must_use]
    pub fn triangles(&self) -> Triangles {
        self.triangles.iter().map(|t| t.map(IVec3::as_vec3)).collect()
    }
}

/// Two triangles across `axis`.
#[must_use]
pub fn square(at: IVec3, axis: usize) -> [[IVec3; 3]; 2] {
    let (u, v) = (IVec3::AXES[(axis + 1) % 3], IVec3::AXES[(axis + 2) % 3]);
    [[at, at + u, at + u + v], [at, at + u + v, at + v]]
}

/// Whether a point, in half units, is in the triangle or on its border, and the direction not in its plane.
fn holds(triangle: &[IVec3; 3], p: IVec3, direction: IVec3) -> bool {
    let [a, b, c] = triangle.map(|q| q * 2 - p);
    let sides = [a.cross(b), b.cross(c), c.cross(a)];
    let normal = (b - a).cross(c - a);
    let inside = sides.iter().all(|side| side.dot(normal) >= 0);
    inside && normal.dot(a) == 0 && normal.dot(direction) != 0
}

/// All whole and half points from -1 to 9, in half units.
pub fn origins() -> impl Iterator<Item = IVec3> {
    (0..9261).map(|i| IVec3::new(i % 21, i / 21 % 21, i / 441) - 2)
}

/// Full, with gaps, and one square across each axis.
#[must_use]
pub fn grids() -> Vec<(&'static str, Grid)> {
    let mut grids = vec![
        ("full grid", Grid::cubes(|_| true)),
        ("grid with gaps", Grid::cubes(|c| c.element_sum() % 3 == 1)),
    ];
    grids.extend((0..3).map(|axis| ("flat box", Grid::new(square(IVec3::splat(4), axis).to_vec()))));
    grids
}

/// The place with a scale that keeps whole numbers whole: the nearest power of two.
fn whole(place: Place) -> Place {
    Place { scale: place.scale.log2().round().exp2(), ..place }
}

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    // Every so manieth of the origins; other ones for each direction.
    let step = trial.pick(199, 29, 1) as usize;
    let grids = grids();
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.map(whole).into_iter().enumerate() {
        for (name, grid) in &grids {
            if trial.interrupted() {
                return checks;
            }
            let what = format!("{name}, times {}, at {}", place.scale, place.shift);
            trial.tell(CASE.id, what.clone(), number as f64 / Place::ALL.len() as f64);
            let triangles: Triangles = grid.triangles().iter().map(|t| t.map(|p| place.point(p))).collect();
            let tracers: Vec<_> = makers.iter().map(|maker| (maker.make)(&triangles)).collect();
            let turns: Vec<(u64, Vec<u64>)> = (0..54)
                .into_par_iter()
                .map(|turn| {
                    let origins: Vec<IVec3> = origins().skip(turn * 7 % step).step_by(step).collect();
                    along(grid, place, turn, &origins, &tracers)
                })
                .collect();
            let rays = turns.iter().map(|(rays, _)| rays).sum();
            for (i, maker) in makers.iter().enumerate() {
                let wrong = turns.iter().filter_map(|(_, wrong)| wrong.get(i)).sum();
                checks.push(Check::none(format!("{what}, {}", maker.name), rays, "rays", wrong));
            }
        }
    }
    checks.extend(tiny(makers));
    checks
}

/// One of the 26 directions, with 0 or -0: how many rays, and wrong ones by each tracer.
fn along(
    grid: &Grid,
    place: Place,
    turn: usize,
    origins: &[IVec3],
    tracers: &[Box<dyn crate::torture::oracle::Tracer>],
) -> (u64, Vec<u64>) {
    let d = turn as i32 / 2;
    let direction = IVec3::new(d % 3, d / 3 % 3, d / 9) - 1;
    if direction == IVec3::ZERO {
        return (0, Vec::new());
    }
    let zero = if turn.is_multiple_of(2) { 0.0 } else { -0.0 };
    let floats = direction.as_vec3().map(|c| if c == 0.0 { zero } else { c });
    let rays: Vec<Ray> = origins.iter().map(|o| Ray::new(place.point(o.as_vec3() * 0.5), floats)).collect();
    let expected: Vec<_> = origins.iter().map(|&origin| grid.first_hit(origin, direction)).collect();
    let right = |i: usize, hit: Option<&Hit>| {
        let expected = expected[i].map(|(steps, number)| (steps as f32 * 0.5 * place.scale as f32, number));
        hit.map(|hit| (hit.t, hit.triangle)) == expected
    };
    let wrong = |answers: Answers| answers.wrong_by(right, |i| expected[i].is_some());
    (rays.len() as u64, tracers.iter().map(|tracer| wrong(ask(tracer.as_ref(), &rays))).collect())
}

/// t that almost overflows, and a component that is almost not there.
fn tiny(makers: &[Maker<'_>]) -> Vec<Check> {
    let grids =
        [Grid::cubes(|cube| cube.element_sum() % 3 == 1), Grid::new(square(IVec3::splat(4), 2).to_vec())];
    let all: Vec<IVec3> = origins().collect();
    let mut checks = Vec::new();
    for maker in makers {
        let (mut short, mut slanting) = (0, 0);
        for grid in &grids {
            let tracer = (maker.make)(&grid.triangles());
            let ask = |direction: Vec3| {
                let rays: Vec<Ray> = all.iter().map(|o| Ray::new(o.as_vec3() * 0.5, direction)).collect();
                ask(tracer.as_ref(), &rays)
            };
            let expected: Vec<_> = all.iter().map(|&origin| grid.first_hit(origin, IVec3::Z)).collect();
            let is_near = |hit: &Hit, (steps, number): (i32, u32)| {
                let t = f64::from(steps) * 0.5 / f64::from(1e-30f32);
                hit.triangle == number && (f64::from(hit.t) - t).abs() <= 2.0 * f64::from(f32::EPSILON) * t
            };
            let right = |i: usize, hit: Option<&Hit>| match (hit, expected[i]) {
                (Some(hit), Some(expected)) => is_near(hit, expected),
                (hit, expected) => hit.is_none() && expected.is_none(),
            };
            short += ask(Vec3::Z * 1e-30).wrong_by(right, |i| expected[i].is_some());
            // Along the border of two cubes, nearer than floats can tell, it is in truth beyond it: so the ray goes
            // no farther than to the first square there; but one that it only touches will do.
            let hits = ask(Vec3::new(1e-45, 0.0, 1.0)).hits;
            slanting += (0..all.len()).filter(|&i| !grid.slants(all[i], hits[i].as_ref())).count() as u64;
        }
        let rays = 2 * all.len() as u64;
        checks.push(Check::none(format!("direction (0, 0, 1e-30), {}", maker.name), rays, "rays", short));
        checks.push(Check::none(format!("direction (1e-45, 0, 1), {}", maker.name), rays, "rays", slanting));
    }
    checks
}

impl Grid {
    /// Whether a ray from `origin` along z and hardly along x may hit this.
    fn slants(&self, origin: IVec3, hit: Option<&Hit>) -> bool {
        let t = |first: Option<(i32, u32)>| first.map(|(steps, _)| steps as f32 * 0.5);
        if origin.x % 2 != 0 {
            return hit.map(|hit| hit.t) == t(self.first_hit(origin, IVec3::Z));
        }
        let there = t(self.first_hit(origin + IVec3::X, IVec3::Z));
        let reached = there.is_none_or(|there| hit.is_some_and(|hit| hit.t <= there));
        // Of squares met edge on t is not known.
        let flat = hit.map(|hit| (hit.t, self.triangles[hit.triangle as usize]));
        let flat = flat.filter(|(_, [a, b, c])| a.z == b.z && b.z == c.z);
        reached
            && flat.is_none_or(|(t, corners)| {
                let point = origin.as_vec3() * 0.5 + Vec3::Z * t;
                let [a, b, c] = corners.map(IVec3::as_vec3);
                a.min(b).min(c).cmple(point).all() && point.cmple(a.max(b).max(c)).all()
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_know_squares() {
        let grid = Grid::new(square(IVec3::splat(4), 2).to_vec());
        let down = |x, y| grid.first_hit(IVec3::new(x, y, 6), IVec3::Z);
        assert_eq!(down(9, 8), Some((2, 0)), "on an edge");
        assert_eq!(down(9, 9), Some((2, 0)), "on the diagonal, the lower number");
        assert_eq!(down(8, 9), Some((2, 1)));
        assert_eq!(down(8, 8), Some((2, 0)), "a corner");
        assert_eq!(down(8, 7), None);
        assert_eq!(grid.first_hit(IVec3::new(9, 9, 8), IVec3::Z), None, "from the surface on");
        assert_eq!(grid.first_hit(IVec3::new(6, 9, 8), IVec3::X), None, "in the plane");
    }
}
