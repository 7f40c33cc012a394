//! Where the members of a group start, side by side, and how likely each would have come to some end.

use super::group::MEMBERS;
use super::{Set, Start, Way};
use crate::bvh::simd::{Job, Simd};
use crate::bvh::{Aabb, Isa, Ray};
use crate::trace::TraceScene;
use crate::trace::warp::offset;
use glam::Vec3;

/// Bound on the rounding of a ray between two points, over the size of their coordinates.
const ROUNDING: f32 = 4.0 / (1 << 24) as f32;

type Rows = [[f32; MEMBERS]; 3];

/// The starts of one sample of a group.
#[derive(Debug)]
pub struct Lanes {
    origin: Rows,
    normal: Rows,
    side: Rows,
    entry: [u32; MEMBERS],
    /// Of going to the end that was last weighed, by area times π; 0 where there is no way.
    pub density: [f32; MEMBERS],
    bounds: Aabb,
}

impl Default for Lanes {
    fn default() -> Self {
        let blank = [[0.0; MEMBERS]; 3];
        let (origin, normal, side) = (blank, blank, blank);
        Self { origin, normal, side, entry: [0; MEMBERS], density: [0.0; MEMBERS], bounds: Aabb::EMPTY }
    }
}

impl Lanes {
    /// Begins with another sample of `set`. Who has not started has no normal, so no way either.
    pub fn load(&mut self, set: &Set, sample: u32, starts: &[Option<Start>]) {
        self.bounds = Aabb::EMPTY;
        for m in 0..MEMBERS {
            let entry = set.first[m] + sample;
            let start = if m < set.members { starts[entry as usize] } else { None };
            self.entry[m] = entry;
            let [origin, normal, side] = start.map_or([Vec3::ZERO; 3], |s| [s.origin, s.normal, s.side]);
            if start.is_some() {
                self.bounds = self.bounds.with(origin);
            }
            for axis in 0..3 {
                self.origin[axis][m] = origin[axis];
                self.normal[axis][m] = normal[axis];
                self.side[axis][m] = side[axis];
            }
        }
    }

    /// How likely each member's path would have gone to an end with these normals; see [`super::End::Seen`].
    pub fn weigh(&mut self, isa: Isa, target: Vec3, normal: Vec3, shading: Vec3) {
        isa.run(Weigh { lanes: self, target, normal, shading });
    }

    /// Queues the rays to it from all but `own`; returns how many.
    pub fn go(
        &self,
        scene: &TraceScene,
        own: usize,
        [target, normal]: [Vec3; 2],
        rays: &mut Vec<Ray>,
        ways: &mut Vec<Way>,
    ) -> u32 {
        // A ray rounds on its way; it must not meet the surface that it ends on.
        let reach = self.bounds.min.abs().max(self.bounds.max.abs()) + target.abs();
        let target = offset(target, reach * ROUNDING, normal);
        let around = self.bounds.with(target);
        let lamps = scene.lights.any_shape(|bounds| bounds.overlaps(&around));
        let before = ways.len();
        for m in (0..MEMBERS).filter(|m| *m != own && self.density[*m] > 0.0) {
            let origin = Vec3::new(self.origin[0][m], self.origin[1][m], self.origin[2][m]);
            let ray = Ray { origin, direction: target - origin, t_max: 1.0 };
            if ray.direction == Vec3::ZERO || lamps && scene.lights.blocks(&ray, u32::MAX) {
                continue;
            }
            rays.push(ray);
            ways.push(Way {
                entry: self.entry[m],
                member: m as u32,
                owner: self.entry[own],
                density: self.density[m],
            });
        }
        (ways.len() - before) as u32
    }
}

struct Weigh<'a> {
    lanes: &'a mut Lanes,
    target: Vec3,
    normal: Vec3,
    shading: Vec3,
}

impl Job for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { lanes, target, normal, shading } = self;
        for m in 0..MEMBERS {
            let of = |rows: &Rows| Vec3::new(rows[0][m], rows[1][m], rows[2][m]);
            let d = target - of(&lanes.origin);
            let distance2 = d.length_squared();
            let leaves = of(&lanes.normal).dot(d);
            let arrives = -normal.dot(d);
            let density = (leaves / distance2) * (arrives / distance2);
            let seen = (leaves > 0.0) & (of(&lanes.side).dot(d) > 0.0);
            // Not so if it is not a number.
            let seen = seen & (arrives > 0.0) & (shading.dot(d) < 0.0) & (density < f32::MAX);
            lanes.density[m] = if seen { density } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lanes(starts: &[(Vec3, Vec3)]) -> Lanes {
        let start =
            |&(origin, normal): &(Vec3, Vec3)| Start { origin, normal, side: normal, throughput: Vec3::ONE };
        let starts: Vec<_> = starts.iter().map(|start_at| Some(start(start_at))).collect();
        let mut set = Set { first: [0; MEMBERS], members: starts.len(), samples: 1 };
        for m in 0..starts.len() {
            set.first[m] = m as u32;
        }
        let mut lanes = Lanes::default();
        lanes.load(&set, 0, &starts);
        lanes
    }

    #[test]
    fn densities_are_cosines_over_squared_distance() {
        let up = Vec3::Y;
        let mut lanes = lanes(&[(Vec3::ZERO, up), (Vec3::X, up), (Vec3::X, -up), (Vec3::Y * 3.0, -up)]);
        lanes.weigh(Isa::detect(), Vec3::Y, -up, -up);
        // Straight below; from 45 degrees, both cosines and the distance; with its back to it; behind it; nobody.
        assert_eq!(lanes.density[..5], [1.0, 0.25, 0.0, 0.0, 0.0]);
        lanes.weigh(Isa::SCALAR, Vec3::Y, -up, Vec3::new(-0.9, -0.1, 0.0));
        assert_eq!(lanes.density[..2], [1.0, 0.0], "its shading normal is away from the second");
        lanes.weigh(Isa::SCALAR, Vec3::ZERO, -up, -up);
        assert_eq!(lanes.density[0], 0.0, "no way from a point to itself");
    }
}
