//! Top level: placed instances of bottom levels.

use super::batch::{Batch, Inside, Scratch, Target, Triangles};
use super::braid::{Entry, entries};
use super::filter::{Accept, All, Filter, Only};
use super::found::Found;
use super::packet::Packet;
use super::rows::{PACKET, Rays, each, lowest};
use super::simd::{Isa, Simd};
use super::single::Waiting;
use super::together::Visitor;
use super::wide::{Child, WideBvh, WideNode};
use super::{Aabb, Blas, Bvh, Hit, Probe, Ray};
use glam::{DAffine3, DMat3, DVec3};
use std::ops::ControlFlow;
use std::sync::Arc;

/// One placed [`Blas`].
#[derive(Clone, Debug)]
pub struct Placement {
    blas: Arc<Blas>,
    world_from_local: DAffine3,
    local_from_world: DAffine3,
    /// Nothing to transform, hence nothing to round.
    identity: bool,
}

/// A hierarchy over placed instances.
#[derive(Clone, Debug, Default)]
pub struct Tlas {
    wide: WideBvh,
    isa: Isa,
    placements: Vec<Placement>,
    /// What its leaves are.
    entries: Vec<Entry>,
    /// How many times more than the world's own rounding a ray may stray when transformed.
    slack: f32,
}

impl Placement {
    /// `None` if the transform is singular or not finite: such an instance has no surface to hit.
    #[must_use]
    pub fn new(blas: Arc<Blas>, world_from_local: DAffine3) -> Option<Self> {
        let local_from_world = world_from_local.inverse();
        let usable = world_from_local.is_finite() && local_from_world.is_finite();
        let identity = world_from_local == DAffine3::IDENTITY;
        usable.then_some(Self { blas, world_from_local, local_from_world, identity })
    }

    /// The bottom level.
    #[must_use]
    pub fn blas(&self) -> &Arc<Blas> {
        &self.blas
    }

    /// The placement.
    #[must_use]
    pub fn world_from_local(&self) -> &DAffine3 {
        &self.world_from_local
    }

    /// Whether it is where its mesh is.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.identity
    }

    /// Its inverse.
    #[must_use]
    pub fn local_from_world(&self) -> &DAffine3 {
        &self.local_from_world
    }

    /// The same ray in local space. The direction is not normalised, so t stays what it is.
    #[inline(always)]
    pub(super) fn local(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.local_from_world.transform_point3(ray.origin.as_dvec3()).as_vec3(),
            direction: self.local_from_world.transform_vector3(ray.direction.as_dvec3()).as_vec3(),
            t_max: ray.t_max,
        }
    }

    /// The box around a `local` one with its placed corners, rounded outward.
    pub(super) fn world_bounds(&self, local: Aabb) -> Aabb {
        if self.identity || local.is_empty() {
            return local;
        }
        let room = self.stray();
        (0..8).fold(Aabb::EMPTY, |aabb, corner| {
            let pick = |axis: usize| {
                f64::from(if corner >> axis & 1 == 0 { local.min[axis] } else { local.max[axis] })
            };
            let p = self.world_from_local.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            let [min, max] = [p - room, p + room].map(|p| {
                p.clamp(DVec3::splat(f64::from(f32::MIN)), DVec3::splat(f64::from(f32::MAX))).as_vec3()
            });
            aabb.union(Aabb { min: min.map(f32::next_down), max: max.map(f32::next_up) })
        })
    }

    /// How far in the world a ray strays that is rounded to floats where it starts in local space, but for what grows with its way
    /// there (see [`Placement::condition`]): much where a mesh is far from its own origin.
    fn stray(&self) -> DVec3 {
        let local = self.blas.bounds();
        let far = local.min.abs().max(local.max.abs()).as_dvec3() * f64::from(f32::EPSILON);
        let m = self.world_from_local.matrix3;
        m.x_axis.abs() * far.x + m.y_axis.abs() * far.y + m.z_axis.abs() * far.z
    }

    /// Bound on how a rounding error in local space grows in world space, relative to coordinates.
    fn condition(&self) -> f32 {
        if self.identity {
            return 1.0;
        }
        let norm = |m: DMat3| m.to_cols_array_2d().iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        (norm(self.world_from_local.matrix3) * norm(self.local_from_world.matrix3)) as f32
    }
}

impl Tlas {
    /// Builds over `placements`; `Hit::instance` will index them.
    #[must_use]
    pub fn build(placements: Vec<Placement>) -> Self {
        let (entries, boxes) = entries(&placements);
        let slack = placements.iter().map(Placement::condition).fold(1.0, f32::max);
        Self { wide: WideBvh::new(&Bvh::build(&boxes), 1), isa: Isa::detect(), placements, entries, slack }
    }

    /// What it was built over.
    #[must_use]
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// The same, traced with the given instructions.
    #[must_use]
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// The instructions it is traced with.
    #[must_use]
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// The hierarchy, to draw or measure.
    #[must_use]
    pub fn hierarchy(&self) -> &WideBvh {
        &self.wide
    }

    /// What the leaves of the hierarchy hold.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The box around everything; empty if there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.wide.bounds
    }

    /// The nearest hit; of equally near ones that of the lowest instance, then triangle.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut found = [None];
        self.closest_hits(std::slice::from_ref(ray), &mut found, None);
        found[0]
    }

    /// Whether there is any hit.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let mut found = [false];
        self.any_hits(std::slice::from_ref(ray), &mut found, None);
        found[0]
    }

    /// [`Tlas::closest_hit`] of each ray, among the hits that `accept`, if given, takes of the ray of that
    /// number. Faster than one by one, above all where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `hits` as `rays`.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>], accept: Option<&dyn Accept>) {
        assert_eq!(rays.len(), hits.len());
        let report = |i: usize, hit| hits[i] = hit;
        match accept {
            None => self.batch::<_, _, false>(rays, All, report),
            Some(accept) => self.batch::<_, _, false>(rays, Only(accept), report),
        }
    }

    /// [`Tlas::any_hit`] of each ray, among the hits that `accept`, if given, takes of the ray of that
    /// number. Faster than one by one, above all where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `blocked` as `rays`.
    pub fn any_hits(&self, rays: &[Ray], blocked: &mut [bool], accept: Option<&dyn Accept>) {
        assert_eq!(rays.len(), blocked.len());
        let report = |i: usize, hit: Option<Hit>| blocked[i] = hit.is_some();
        match accept {
            None => self.batch::<_, _, true>(rays, All, report),
            Some(accept) => self.batch::<_, _, true>(rays, Only(accept), report),
        }
    }

    fn batch<F: Filter, R: FnMut(usize, Option<Hit>), const ANY: bool>(
        &self,
        rays: &[Ray],
        filter: F,
        report: R,
    ) {
        let ray = |i: usize| rays[i];
        self.isa.run(Batch::<_, _, _, _, ANY> { target: self, count: rays.len(), ray, filter, report });
    }
}

impl Target for Tlas {
    const ONE_LEVEL: bool = false;

    #[inline(always)]
    fn nodes(&self) -> &[WideNode] {
        &self.wide.nodes
    }

    #[inline(always)]
    fn only(&self) -> Option<Inside<'_>> {
        None
    }

    #[inline(always)]
    fn probe(&self, ray: &Ray) -> Probe {
        Probe::with_slack(ray, &self.wide.bounds, self.slack)
    }

    #[inline(always)]
    fn bounds(&self) -> (Aabb, f32) {
        (self.wide.bounds, self.slack)
    }

    #[inline(always)]
    fn enter(&self, leaf: usize, ray: &Ray) -> (Inside<'_>, u32, Option<Probe>) {
        let Entry { instance, child } = self.entries[self.wide.prims[leaf] as usize];
        let placement = &self.placements[instance as usize];
        let blas = &*placement.blas;
        let local = (!placement.identity).then(|| Probe::new(&placement.local(ray), &blas.bounds()));
        (Inside { blas, instance, moved: local.is_some() }, child, local)
    }

    #[inline(always)]
    fn traverse_packet<S: Simd, F: Filter, const ANY: bool>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        rays: u64,
        filter: F,
    ) -> u64 {
        let Scratch { packet, found, waiting, numbers, inner } = scratch;
        let inner = inner.get_or_insert_with(Scratch::new);
        let mut visitor = Instances::<F, ANY> { tlas: self, found, numbers, filter, inner };
        self.wide.traverse_packet::<S, false>(simd, packet, 0, rays, waiting, &mut visitor)
    }
}

/// The instances, asked for by a packet.
struct Instances<'a, F, const ANY: bool> {
    tlas: &'a Tlas,
    found: &'a mut Found,
    numbers: &'a [usize; PACKET],
    filter: F,
    inner: &'a mut Scratch,
}

impl<F: Filter, const ANY: bool> Instances<'_, F, ANY> {
    /// Takes rays through one entry.
    #[inline(always)]
    fn entry<S: Simd>(&mut self, simd: S, packet: &mut Packet, entry: u32, rays: u64) -> u64 {
        let Entry { instance, child } = self.tlas.entries[entry as usize];
        let placement = &self.tlas.placements[instance as usize];
        let (blas, child) = (&*placement.blas, Child::unpack(child));
        let Scratch { packet: local, found, waiting, numbers, .. } = &mut *self.inner;
        if placement.identity {
            let (found, numbers, filter) = (&mut *self.found, self.numbers, self.filter);
            let mut visitor = Triangles::<F, ANY> { blas, instance, found, numbers, filter };
            return match child {
                Child::Node(root) => {
                    blas.wide.traverse_packet::<S, ANY>(simd, packet, root, rays, waiting, &mut visitor)
                }
                Child::Leaf { first, count } => visitor.many(simd, packet, first, count, rays),
            };
        }
        let mut moved = Rays::blank();
        let mut lanes = [0; PACKET];
        for (to, lane) in lanes.iter_mut().zip(each(rays)) {
            *to = lane;
        }
        let count = rays.count_ones() as usize;
        moved.load(count, |i| placement.local(&packet.rays.get(lanes[i % PACKET])));
        let mut done = 0;
        for (class, members) in moved.classes(simd, count) {
            local.rays.gather(&moved, members);
            local.prepare(simd, class, members.count_ones() as usize, &blas.bounds(), 1.0);
            found.rays = 0;
            for (i, member) in each(members).enumerate() {
                let lane = lanes[member % PACKET];
                numbers[i % PACKET] = self.numbers[lane % PACKET];
                found.copy(i, self.found, lane);
            }
            let mut visitor = Triangles::<F, ANY> { blas, instance, found, numbers, filter: self.filter };
            let all = lowest(members.count_ones() as usize);
            let ended = match child {
                Child::Node(root) => {
                    blas.wide.traverse_packet::<S, ANY>(simd, local, root, all, waiting, &mut visitor)
                }
                Child::Leaf { first, count } => visitor.many(simd, local, first, count, all),
            };
            for (i, member) in each(members).enumerate() {
                let lane = lanes[member % PACKET];
                self.found.copy(lane, found, i);
                packet.rays.t_max.0[lane % PACKET] = local.rays.t_max.0[i % PACKET];
                done |= (ended >> i & 1) << lane;
            }
        }
        done
    }
}

impl<S: Simd, F: Filter, const ANY: bool> Visitor<S> for Instances<'_, F, ANY> {
    #[inline(always)]
    fn many(&mut self, simd: S, packet: &mut Packet, first: usize, count: usize, rays: u64) -> u64 {
        let tlas = self.tlas;
        // One entry to a leaf: each is asked for by its own box.
        debug_assert_eq!(count, 1);
        self.entry(simd, packet, tlas.wide.prims[first], rays)
    }

    #[inline(always)]
    fn one(
        &mut self,
        simd: S,
        packet: &mut Packet,
        probe: &Probe,
        lane: usize,
        first: usize,
        count: usize,
    ) -> ControlFlow<(), f32> {
        let tlas = self.tlas;
        debug_assert_eq!(count, 1);
        let Entry { instance, child } = tlas.entries[tlas.wide.prims[first] as usize];
        let placement = &tlas.placements[instance as usize];
        let blas = &*placement.blas;
        let local = (!placement.identity)
            .then(|| Probe::new(&placement.local(&packet.rays.get(lane)), &blas.bounds()));
        let probe = local.as_ref().unwrap_or(probe);
        let (found, numbers, filter) = (&mut *self.found, self.numbers, self.filter);
        let mut visitor = Triangles::<F, ANY> { blas, instance, found, numbers, filter };
        match Child::unpack(child) {
            Child::Node(root) => {
                let waiting: &mut Waiting = &mut self.inner.waiting.single;
                blas.wide.traverse_one(simd, packet, probe, lane, root, waiting, &mut visitor)?;
                ControlFlow::Continue(packet.rays.t_max.0[lane % PACKET])
            }
            Child::Leaf { first, count } => visitor.one(simd, packet, probe, lane, first, count),
        }
    }
}
