//! Directions with zero components, origins on faces of boxes, flat boxes: all that makes 0 · ∞.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::ask;
use glam::{IVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Isa, Ray};
use rayon::prelude::*;

/// Triangles of whole coordinates from 0 to 8, in planes of constant x, y or z.
#[derive(Default)]
struct Grid {
    triangles: Vec<[IVec3; 3]>,
    /// For each unit cube, numbered by x + 10 y + 100 z from -1 on, the triangles on its border.
    near: Vec<Vec<u32>>,
}

impl Grid {
    fn new(triangles: Vec<[IVec3; 3]>) -> Self {
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
    fn cubes(there: impl Fn(IVec3) -> bool) -> Self {
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
    fn first_hit(&self, origin: IVec3, direction: IVec3) -> Option<(i32, u32)> {
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

    fn blas(&self) -> Blas {
        let triangles: Vec<_> = self.triangles.iter().map(|t| t.map(IVec3::as_vec3)).collect();
        Blas::build(&triangles)
    }
}

/// Two triangles across `axis`.
fn square(at: IVec3, axis: usize) -> [[IVec3; 3]; 2] {
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
fn origins() -> impl Iterator<Item = IVec3> {
    (0..9261).map(|i| IVec3::new(i % 21, i / 21 % 21, i / 441) - 2)
}

fn ray(origin: IVec3, direction: Vec3) -> Ray {
    Ray::new(origin.as_vec3() * 0.5, direction)
}

/// All 26 directions, with 0 and with -0, from all 21³ origins, to a full grid, to one with gaps and to single
/// squares, whose boxes have no thickness: 2,408,000 rays, every kernel, alone and together.
#[test]
fn zero_direction_components_miss_nothing() {
    let mut grids =
        vec![("full", Grid::cubes(|_| true)), ("with gaps", Grid::cubes(|cube| cube.element_sum() % 3 == 1))];
    for axis in 0..3 {
        grids.push(("a square", Grid::new(square(IVec3::splat(4), axis).to_vec())));
    }
    for (name, grid) in &grids {
        let blas = grid.blas();
        let hits: usize = (0..54)
            .into_par_iter()
            .map(|turn| {
                let d = turn / 2;
                let direction = IVec3::new(d % 3, d / 3 % 3, d / 9) - 1;
                if direction == IVec3::ZERO {
                    return 0;
                }
                let zero = if turn % 2 == 0 { 0.0 } else { -0.0 };
                let floats = direction.as_vec3().map(|c| if c == 0.0 { zero } else { c });
                let rays: Vec<Ray> = origins().map(|origin| ray(origin, floats)).collect();
                let expected: Vec<_> = origins().map(|origin| grid.first_hit(origin, direction)).collect();
                for isa in Isa::available() {
                    let what = format!("{name}, {floats}, {}", isa.name());
                    let hits = ask(&what, &blas.clone().with_isa(isa), &rays);
                    for ((hit, expected), ray) in hits.iter().zip(&expected).zip(&rays) {
                        let hit = hit.map(|hit| (hit.t, hit.triangle));
                        let expected = expected.map(|(steps, number)| (steps as f32 * 0.5, number));
                        assert_eq!(hit, expected, "{what}: {ray:?}");
                    }
                }
                expected.iter().flatten().count()
            })
            .sum();
        println!("{name}: {} triangles, {hits} of 481572 rays hit", grid.triangles.len());
        assert!(hits > 1000);
    }
}

/// t that almost overflows, and a component that is almost not there.
#[test]
fn tiny_direction_components_miss_nothing() {
    let grids = [
        ("with gaps", Grid::cubes(|cube| cube.element_sum() % 3 == 1)),
        ("a square", Grid::new(square(IVec3::splat(4), 2).to_vec())),
    ];
    for (name, grid) in &grids {
        let blas = grid.blas();
        let expected: Vec<_> = origins().map(|origin| grid.first_hit(origin, IVec3::Z)).collect();
        for isa in Isa::available() {
            let blas = blas.clone().with_isa(isa);
            let what = format!("{name}, {}", isa.name());
            let short = Vec3::Z * 1e-30;
            let rays: Vec<Ray> = origins().map(|origin| ray(origin, short)).collect();
            for ((hit, expected), ray) in ask(&what, &blas, &rays).iter().zip(&expected).zip(&rays) {
                assert_eq!(hit.map(|h| h.triangle), expected.map(|e| e.1), "{what}: {ray:?}");
                if let (Some(hit), Some((steps, _))) = (hit, expected) {
                    let t = f64::from(*steps) * 0.5 / f64::from(short.z);
                    let off = (f64::from(hit.t) - t).abs() / t;
                    assert!(off <= 2.0 * f64::from(f32::EPSILON), "{what}: {ray:?}, {} is not {t}", hit.t);
                }
            }
            let slanting: Vec<Ray> = origins().map(|o| ray(o, Vec3::new(1e-45, 0.0, 1.0))).collect();
            // Not `ask`: see the next test.
            let mut hits = vec![None; slanting.len()];
            blas.closest_hits(&slanting, &mut hits);
            for (i, origin) in origins().enumerate() {
                let t = |first: Option<(i32, u32)>| first.map(|(steps, _)| steps as f32 * 0.5);
                let what = format!("{what}: {:?}: {:?}, not {:?}", slanting[i], hits[i], expected[i]);
                if origin.x % 2 != 0 {
                    assert_eq!(hits[i].map(|hit| hit.t), t(expected[i]), "{what}");
                    continue;
                }
                // Along the border of two cubes, nearer than floats can tell: in truth beyond it, so that the ray
                // goes no farther than to the first square there; but one that it only touches will do.
                if let Some(there) = t(grid.first_hit(origin + IVec3::X, IVec3::Z)) {
                    assert!(hits[i].is_some_and(|hit| hit.t <= there), "{what}");
                }
                // Of squares met edge on t is not known: see the next test.
                let met = hits[i].map(|hit| (hit.t, grid.triangles[hit.triangle as usize]));
                if let Some((t, corners)) = met.filter(|(_, [a, b, c])| a.z == b.z && b.z == c.z) {
                    let point = origin.as_vec3() * 0.5 + Vec3::Z * t;
                    let square = Aabb::around(&corners.map(IVec3::as_vec3));
                    assert!(square.contains(&Aabb::around(&[point])), "{what}");
                }
            }
        }
    }
}

/// A square that such a ray meets edge on: the determinant is so small that its reciprocal overflows.
#[test]
fn a_hit_always_has_a_place() {
    let [a, b, c] = [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE];
    let ray = Ray::new(Vec3::new(1.0, 0.0, -0.5), Vec3::new(1e-45, 0.0, 1.0));
    for isa in Isa::available() {
        if let Some(hit) = Blas::build(&[[a, b, c]]).with_isa(isa).closest_hit(&ray) {
            assert!(hit.u.is_finite() && hit.v.is_finite(), "{}: {hit:?}", isa.name());
        }
    }
}

/// The same from a triangle that is small enough, seen from far enough away that nobody calls it extreme.
#[test]
fn a_tiny_triangle_is_hit_where_it_is() {
    for size in [1e-18, 1e-20, 1e-23] {
        let triangle = [Vec3::ZERO, Vec3::X * size, Vec3::Y * size];
        let ray = Ray::new(Vec3::new(0.25 * size, 0.25 * size, 1.0), Vec3::NEG_Z);
        for isa in Isa::available() {
            let hit = Blas::build(&[triangle]).with_isa(isa).closest_hit(&ray);
            let right =
                hit.is_some_and(|h| h.t == 1.0 && (h.u - 0.25).abs() < 1e-3 && (h.v - 0.25).abs() < 1e-3);
            assert!(right, "{size:e}, {}: {hit:?}", isa.name());
        }
    }
}

/// The judge itself.
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
