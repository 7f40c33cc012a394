//! Surfaces that only reflect evenly: most of what there is, shaded by whole blocks.
//!
//! Where it is known what is in the way of a light, it is computed instead of sampled: no shadow rays, and no noise.

mod light;

use super::block::{Arrivals, Block, Depart, Departures, LANES, Placed};
use super::bsdf::normal::facing;
use super::emitter::Receiver;
use super::film::{TILE, Tile};
use super::integrator::Batch;
use super::light_tree::Chosen;
use super::lights::KNOWN_LIGHTS;
use super::path::{Bounce, DIRECTION, LOBE, PAIRS_PER_BOUNCE, Path, ROULETTE_DEPTH};
use super::reuse::{End, Start};
use super::sightlines::{Sightlines, Window};
use super::surface::Interaction;
use super::{Integrator, TraceScene};
use crate::bvh::{Hit, Ray};
use glam::{UVec2, Vec3};

/// Where paths of a wave have met diffuse surfaces, and what is needed to go on from there.
#[derive(Debug, Default)]
pub(super) struct Diffuse {
    /// Paths on flat surfaces of one colour.
    flat: Vec<Arrived>,
    /// Paths on surfaces that are smooth, or of which each place has a colour of its own.
    other: Vec<Arrived>,
    /// If anybody wants to know what is in the way.
    window: Option<Window>,
    /// Whether camera rays may run into lights.
    pub(super) lights_in_view: bool,
    /// Those of the tile, which lends them.
    sightlines: Sightlines,
    /// What has been asked about triangles in this batch.
    asked: Vec<((u32, u32), Option<u32>)>,
    /// Lights that have been counted in full, a bit for each, of each point of the block.
    counted: Vec<u32>,
    /// Triangles of an emissive mesh that are chosen for a block: by which numbers, and which.
    choices: (Vec<(Receiver, f32)>, Vec<Option<Chosen>>),
    block: Option<Box<Block>>,
    arrivals: Box<Arrivals>,
    departures: Box<Departures>,
}

/// Where a path has arrived.
#[derive(Clone, Copy, Debug)]
struct Arrived {
    path: u32,
    /// What [`Sightlines::of`] says.
    known: Option<u32>,
    /// The instance, if it is elsewhere than its mesh was made.
    placed: Option<u32>,
}

impl Arrived {
    /// Equal for those of one placement who know the same.
    fn company(&self) -> u64 {
        let number = |of: Option<u32>| of.map_or(0, |of| u64::from(of) + 1);
        number(self.placed) << 32 | number(self.known)
    }
}

/// So many answers are at hand.
const ASKED: usize = 64;

impl Diffuse {
    /// Begins with another batch.
    pub(super) fn enter(&mut self, scene: &TraceScene, tile: &mut Tile, size: UVec2) {
        let window = Window::new(scene, tile, size);
        // Through a lens one sees more than through a point.
        let is_sharp = !scene.viewpoint.has_lens();
        self.lights_in_view = !is_sharp || scene.lights.any_shape(|bounds| !window.hides(&bounds));
        self.window =
            (is_sharp && scene.settings.shafts && scene.lights.len() <= KNOWN_LIGHTS).then_some(window);
        self.sightlines = std::mem::take(&mut tile.sightlines);
        let tiles = (size.x.div_ceil(TILE) * size.y.div_ceil(TILE)) as usize;
        self.sightlines.tidy(tiles);
        self.asked.clear();
        self.asked.resize(ASKED, ((u32::MAX, u32::MAX), None));
    }

    /// Begins with samples from all over the picture.
    pub(super) fn enter_alone(&mut self) {
        self.lights_in_view = true;
        self.window = None;
    }

    /// Ends with it.
    pub(super) fn leave(&mut self, tile: &mut Tile) {
        tile.sightlines = std::mem::take(&mut self.sightlines);
    }

    /// Notes that path number `path` ends in `hit`.
    pub(super) fn add(&mut self, scene: &TraceScene, path: usize, hit: &Hit, depth: u32) {
        let known = if depth == 0 { self.ask(scene, hit) } else { None };
        let data = &scene.geometry.instances[hit.instance as usize];
        let flat = data.mesh.normals.is_empty()
            && data.mesh.colors.is_empty()
            && scene.surface_at(hit).1.base_color_texture.is_none();
        let is_there = scene.geometry.tlas.placements()[hit.instance as usize].is_identity();
        let placed = (!is_there).then_some(hit.instance);
        let kind = if flat { &mut self.flat } else { &mut self.other };
        kind.push(Arrived { path: path as u32, known, placed });
    }

    fn ask(&mut self, scene: &TraceScene, hit: &Hit) -> Option<u32> {
        let window = self.window.as_ref()?;
        let triangle = (hit.instance, hit.triangle);
        let asked = &mut self.asked[(hit.triangle ^ hit.instance << 3) as usize % ASKED];
        if asked.0 != triangle {
            *asked = (triangle, self.sightlines.of(scene, window, hit));
        }
        asked.1
    }
}

/// Where a path has arrived, as others see it.
fn end_at(at: &Interaction) -> End {
    let normal = at.geometric_normal;
    if at.normal.dot(at.wo) > 0.0 && at.normal.dot(normal) > 0.0 {
        End::Seen { target: at.origin_toward(normal), normal, shading: at.normal }
    } else {
        End::Alone
    }
}

impl Batch {
    /// What comes from all points that [`Diffuse::add`] has noted. Returns how many shadow rays have been traced for that.
    pub(super) fn shade_diffuse(&mut self, scene: &TraceScene) -> u64 {
        let mut rays = 0;
        let mut flat = std::mem::take(&mut self.diffuse.flat);
        let mut other = std::mem::take(&mut self.diffuse.other);
        // What is in the way is asked once for all who know the same, and a placement is looked up once.
        flat.sort_by_key(Arrived::company);
        for (points, is_flat) in [(&flat, true), (&other, false)] {
            for chunk in points.chunks(LANES) {
                let like = self.path(chunk[0].path as usize).sampler;
                let mut block = self.diffuse.block.take().unwrap_or_else(|| Box::new(Block::new(like)));
                self.fill(scene, &mut block, chunk, is_flat);
                if is_flat {
                    self.note_ends(&block);
                }
                self.diffuse.counted.clear();
                self.diffuse.counted.resize(chunk.len(), 0);
                self.light_block(scene, &block);
                if scene.settings.integrator == Integrator::Path {
                    self.follow_block(scene, &block);
                }
                self.diffuse.block = Some(block);
                rays += self.connect_many(scene);
            }
        }
        flat.clear();
        other.clear();
        (self.diffuse.flat, self.diffuse.other) = (flat, other);
        rays
    }

    fn fill(&mut self, scene: &TraceScene, block: &mut Block, points: &[Arrived], is_flat: bool) {
        block.count = points.len();
        for (i, arrived) in points.iter().enumerate() {
            let path = self.path(arrived.path as usize);
            let Some(hit) = &self.hits[arrived.path as usize] else { continue };
            block.paths[i] = arrived.path;
            block.known[i] = arrived.known;
            block.samplers.set(i, &path.sampler);
            let (instance, surface) = scene.surface_at(hit);
            let mut albedo = surface.material.base_color;
            if is_flat {
                let corners = instance.mesh.corners(hit.triangle as usize);
                for (rows, corner) in block.corners.iter_mut().zip(corners) {
                    rows.set(i, corner);
                }
                block.weights.set(i, Vec3::new(hit.u, hit.v, 0.0));
                block.direction.set(i, path.ray.direction);
            } else {
                let mut at = Interaction::new(scene, instance, hit, &path.ray);
                self.reuse.end(&path, end_at(&at));
                at.normal = facing(at.normal, &at);
                let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
                albedo *= texel.truncate();
                block.set_point(i, &at);
            }
            block.throughput.set(i, path.throughput * albedo);
        }
        if is_flat {
            let mut first = 0;
            for run in points.chunk_by(|a, b| a.placed == b.placed) {
                let placed = run[0].placed.map(|instance| Placed {
                    world_from_local: *scene.geometry.tlas.placements()[instance as usize].world_from_local(),
                    normal_matrix: scene.geometry.instances[instance as usize].normal_matrix,
                });
                block.find_points(scene.geometry.tlas.isa(), first..first + run.len(), placed.as_ref());
                first += run.len();
            }
        }
    }

    /// Where diverted paths have arrived that are on flat triangles.
    fn note_ends(&mut self, block: &Block) {
        if self.reuse.on {
            for i in 0..block.count {
                let normal = block.geometric_normal.get(i);
                let end = End::Seen { target: block.origin.get(i), normal, shading: normal };
                self.reuse.end(&self.path(block.paths[i] as usize), end);
            }
        }
    }

    /// Sends paths on.
    fn follow_block(&mut self, scene: &TraceScene, block: &Block) {
        let depth = self.path(block.paths[0] as usize).depth;
        let base = 1 + depth * PAIRS_PER_BOUNCE;
        let mut out = std::mem::take(&mut self.diffuse.departures);
        let mut samplers = block.samplers.clone();
        let shares = self.reuse.on && depth == 0;
        if shares {
            for i in 0..block.count {
                let sampler = self.shared_sampler(self.path(block.paths[i] as usize).entry);
                samplers.set(i, &sampler);
            }
        }
        let dimension = base + DIRECTION;
        scene.geometry.tlas.isa().run(Depart { block, samplers: &samplers, dimension, out: &mut out });
        for i in 0..block.count {
            let path = self.path(block.paths[i] as usize);
            let mut throughput = block.throughput.get(i);
            let pdf = out.pdf[i];
            if pdf <= 0.0 || throughput == Vec3::ZERO {
                continue;
            }
            if depth >= ROULETTE_DEPTH {
                let survival = throughput.max_element().clamp(0.05, 1.0);
                if path.sampler.pair(base + LOBE).y >= survival {
                    continue;
                }
                throughput /= survival;
            }
            let (origin, direction, normal) =
                (block.origin.get(i), out.direction.get(i), block.normal.get(i));
            let from = Receiver { point: block.position.get(i), normal };
            let mut sampler = path.sampler;
            if shares {
                let side = block.geometric_normal.get(i);
                self.reuse.start(path.entry, Start { origin, normal, side, throughput });
                sampler = self.shared_sampler(path.entry);
            }
            self.next.push(Path {
                entry: path.entry,
                sampler,
                ray: Ray::new(origin, direction),
                throughput,
                depth: depth + 1,
                bounce: Some(Bounce { pdf, from, counted: self.diffuse.counted[i] }),
                last: false,
                absorption: Vec3::ZERO,
            });
        }
        self.diffuse.departures = out;
    }
}
