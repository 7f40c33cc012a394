//! G4: a search through boxes finds what trying every triangle finds.

use super::batches::{BATCH, Counting};
use super::meshes::{self, Triangles, soup};
use crate::bvh::{Blas, Hit, Isa, Placement, Ray, Tlas};
use crate::torture::oracle::{Balls, Maker, Rng, Tracer, ask, brute_force, brute_force_in, check};
use crate::torture::{Case, Check, Place, Trial};
use glam::{DAffine3, Vec3};
use std::sync::Arc;

pub(super) const CASE: Case = Case {
    id: "G4",
    title: "boxes against trying every triangle, for hierarchies built (binned; slivers split), refitted and in parts of 1, 2, 4, 8; \
            nodes are 8 wide, and no other builder is there",
    limit: "the same hit and t, bit for bit; every node holds its triangles",
    run: |trial| run(trial, &ours().into_iter().chain(leaves()).collect::<Vec<_>>()),
};

/// Half of the rays are aimed exactly at corners and edges.
#[must_use]
pub fn aimed_ray(rng: &mut Rng, triangles: &[[Vec3; 3]], scale: f32, center: Vec3) -> Ray {
    let origin = center + rng.vec() * scale;
    let [a, b, c] = triangles[rng.below(triangles.len())];
    let target = match rng.below(4) {
        0 => a,
        1 => b.lerp(c, rng.unit()),
        2 => a * 0.25 + b * 0.25 + c * 0.5,
        _ => center + rng.vec() * scale,
    };
    Ray::new(origin, target - origin)
}

/// Meshes with the triangles in turn, placed where they are.
struct Parts {
    tlas: Tlas,
    firsts: Vec<u32>,
}

impl Parts {
    fn new(triangles: &[[Vec3; 3]], size: usize, isa: Isa) -> Self {
        let parts = triangles.chunks(size).map(|part| Arc::new(Blas::build(part)));
        let placements = parts.filter_map(|part| Placement::new(part, DAffine3::IDENTITY)).collect();
        let firsts = (0..triangles.len() as u32).step_by(size).collect();
        Self { tlas: Tlas::build(placements).with_isa(isa), firsts }
    }

    fn numbered(&self, hit: Hit) -> Hit {
        Hit { triangle: hit.triangle + self.firsts[hit.instance as usize], instance: 0, ..hit }
    }
}

impl Tracer for Parts {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.tlas.closest_hit(ray).map(|hit| self.numbered(hit))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.tlas.any_hit(ray)
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        Tracer::closest_hits(&self.tlas, rays, hits);
        hits.iter_mut().for_each(|hit| *hit = hit.map(|hit| self.numbered(hit)));
    }

    fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        Tracer::any_hits(&self.tlas, rays, blocked);
    }
}

/// A hierarchy that was built over other triangles, a little elsewhere, and moved; built where that cannot be.
fn refitted(triangles: &[[Vec3; 3]]) -> Blas {
    let mut rng = Rng(31);
    let mut shaken = |corners: &[Vec3; 3]| {
        let size = corners[0].distance(corners[1]).min(corners[0].distance(corners[2]));
        let by = rng.vec() * (0.1 * size);
        corners.map(|p| p + by)
    };
    let others: Triangles = triangles.iter().map(&mut shaken).collect();
    Blas::build(&others).refit(triangles).unwrap_or_else(|| Blas::build(triangles))
}

/// Every way to make a hierarchy, with each set of instructions.
#[must_use]
pub fn ours() -> Vec<Maker<'static>> {
    let makers = |isa: Isa| {
        [
            Maker::new(format!("built, {}", isa.name()), move |t| Blas::build(t).with_isa(isa)),
            Maker::new(format!("refitted, {}", isa.name()), move |t| refitted(t).with_isa(isa)),
            Maker::new(format!("in parts, {}", isa.name()), move |t| {
                Parts::new(t, t.len().div_ceil(8).max(1), isa)
            }),
        ]
    };
    Isa::available().into_iter().flat_map(makers).collect()
}

/// Top levels over so many triangles each: hierarchies whose leaves are of that size, each with one set of instructions.
fn leaves() -> Vec<Maker<'static>> {
    let isas = Isa::available();
    let maker = |(turn, size): (usize, usize)| {
        let isa = isas[turn % isas.len()];
        Maker::new(format!("leaves of {size}, {}", isa.name()), move |t| Parts::new(t, size, isa))
    };
    [1, 2, 4, 8].into_iter().enumerate().map(maker).collect()
}

/// Meshes to try.
fn scenes() -> Vec<(&'static str, Triangles)> {
    let mut mixed = soup(100, 1e-4, 9);
    mixed.push([Vec3::new(-1e6, 0.0, -1e6), Vec3::new(1e6, 0.0, -1e6), Vec3::new(0.0, 0.0, 1e6)]);
    vec![
        ("knot", meshes::knot(12, 150)),
        ("soup", soup(1000, 0.1, 3)),
        ("large soup", soup(200, 3.0, 5)),
        ("needles", meshes::needle_tube()),
        ("mixed scales", mixed),
    ]
}

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    let mut sets = Vec::new();
    for (name, triangles) in scenes() {
        for place in Place::ALL {
            // Rounded some collapse to a line, which has no surface.
            let there = meshes::with_surface(triangles.iter().map(|t| t.map(|p| place.point(p))));
            sets.push((format!("{name}, {}", place.name()), there));
        }
    }
    let (each, batch) = (trial.pick(512, 3 * BATCH, 1_000_000), trial.pick(256, BATCH, BATCH));
    let mut checks = Vec::new();
    for (number, (what, triangles)) in sets.iter().enumerate() {
        let part = [number, number + 1].map(|n| n as f64 / sets.len() as f64);
        checks.extend(whole(what, triangles));
        let tracers: Vec<_> = makers.iter().map(|maker| (maker.make)(triangles)).collect();
        let bounds = Blas::build(triangles).bounds();
        let scale = (bounds.max * 0.5 - bounds.min * 0.5).max_element() * 1.5;
        let balls = Balls::new(triangles, 2.0 * scale);
        let counting = Counting { trial, id: CASE.id, what, part, batch };
        let (rays, wrong) = counting.sum(each, makers.len(), |number| {
            let mut rng = Rng::numbered(trial.seed, number);
            let usable = |ray: &Ray| ray.direction != Vec3::ZERO;
            let rays: Vec<Ray> =
                std::iter::repeat_with(|| aimed_ray(&mut rng, triangles, scale, bounds.center()))
                    .filter(usable)
                    .take(batch as usize)
                    .collect();
            // Triangles far from a ray's line are known to be missed; given hours all are asked.
            let all = trial.effort == crate::torture::Effort::Long;
            let expected = |ray: &Ray| {
                if all {
                    brute_force_in(&bounds, triangles, ray)
                } else {
                    balls.brute_force(&bounds, triangles, ray)
                }
            };
            let expected: Vec<Option<Hit>> = rays.iter().map(expected).collect();
            tracers.iter().map(|tracer| ask(tracer.as_ref(), &rays).wrong(&expected)).collect()
        });
        for (maker, wrong) in makers.iter().zip(wrong) {
            checks.push(Check::none(format!("{what}, {}", maker.name), rays, "rays", wrong));
        }
        if trial.interrupted() {
            break;
        }
    }
    checks.extend(ends(makers));
    checks
}

/// Nodes against triangles.
fn whole(what: &str, triangles: &[[Vec3; 3]]) -> Vec<Check> {
    let hierarchies = [("built", Blas::build(triangles)), ("refitted", refitted(triangles))];
    let check = |(how, blas): &(&str, Blas)| {
        let wrong = u64::from(check(blas, triangles).is_err());
        Check::none(format!("nodes: {what}, {how}"), blas.hierarchy().nodes.len() as u64, "nodes", wrong)
    };
    hierarchies.iter().map(check).collect()
}

/// Rays that end exactly at their hit, where it counts, and one float before it, where it does not.
fn ends(makers: &[Maker<'_>]) -> Vec<Check> {
    let triangles = soup(300, 0.3, 3);
    let mut rng = Rng(7);
    let mut rays = Vec::new();
    while rays.len() < 2000 {
        let ray = aimed_ray(&mut rng, &triangles, 1.5, Vec3::ZERO);
        if let Some(hit) = brute_force(&triangles, &ray) {
            rays.extend([Ray { t_max: hit.t, ..ray }, Ray { t_max: hit.t.next_down(), ..ray }]);
        }
    }
    let expected: Vec<_> = rays.iter().map(|ray| brute_force(&triangles, ray)).collect();
    let check = |maker: &Maker<'_>| {
        let wrong = ask((maker.make)(&triangles).as_ref(), &rays).wrong(&expected);
        let wrong = wrong + expected.iter().step_by(2).filter(|hit| hit.is_none()).count() as u64;
        Check::none(format!("rays that end at their hit, {}", maker.name), rays.len() as u64, "rays", wrong)
    };
    makers.iter().map(check).collect()
}
