//! What is in the way from the surfaces that a tile of the picture shows to the lights: often nothing, or a few triangles.
//!
//! It is asked once for the part of a triangle that a tile shows, whichever samples are in the batch, so a sample's result
//! does not depend on its company.

use super::TraceScene;
use super::blocker::{Blocker, simplify};
use super::film::Tile;
use super::light::FlatLight;
use super::quad::Quad;
use super::shape_light::Shape;
use crate::bvh::{Aabb, Hit, Ray, Shaft};
use glam::{DVec3, UVec2, Vec2, Vec3};

/// What is known for one tile, until the scene or the view changes.
#[derive(Clone, Debug, Default)]
pub(super) struct Sightlines {
    /// Instance and triangle of each number.
    known: Vec<(u32, u32)>,
    /// What keeps each light from each of these, light by light: a part of `blockers`; `None` if nobody knows.
    looks: Vec<Option<(u32, u32)>>,
    blockers: Vec<Blocker>,
    /// How many lights there are.
    lights: usize,
}

/// What is known is no part of the picture.
impl PartialEq for Sightlines {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The view through a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Rays through its corners, around it.
    corners: [Ray; 4],
}

/// More outlines in the way are too many.
const FEW: usize = 8;
/// So many triangles are looked at, since together they may be few outlines.
const LOOKED_AT: usize = 16;
/// So many triangles in view are remembered.
const MANY: usize = 32;

/// So many bytes of outlines are remembered by all tiles together.
const MEMORY: usize = 1 << 30;

impl Window {
    /// Of a tile of a picture of `size`.
    pub fn new(scene: &TraceScene, tile: &Tile, size: UVec2) -> Self {
        Self::around(scene, tile.origin.as_vec2(), (tile.origin + tile.size).as_vec2(), size)
    }

    /// Of a rectangle of a picture of `size`, pixels.
    pub fn around(scene: &TraceScene, low: Vec2, high: Vec2, size: UVec2) -> Self {
        let ray = |x: f32, y: f32| scene.viewpoint.ray(Vec2::new(x, y), size);
        Self { corners: [ray(low.x, low.y), ray(high.x, low.y), ray(high.x, high.y), ray(low.x, high.y)] }
    }

    /// Whether surely nothing in the box is seen through it.
    pub fn hides(&self, aabb: &Aabb) -> bool {
        let ends = self.corners.map(|ray| (ray.origin + ray.direction).as_dvec3());
        (0..4).any(|i| {
            let from = self.corners[i].origin.as_dvec3();
            let normal = self.corners[i].direction.as_dvec3().cross(ends[(i + 1) % 4] - from);
            let inward = if normal.dot(ends[(i + 2) % 4] - from) < 0.0 { -normal } else { normal };
            let farthest = DVec3::select(
                inward.cmpgt(DVec3::ZERO),
                aabb.max.as_dvec3() - from,
                aabb.min.as_dvec3() - from,
            );
            inward.dot(farthest) < -1e-6 * (inward.abs() * (farthest.abs() + from.abs())).element_sum()
        })
    }

    /// What it cuts out of the plane of a triangle, if it is not much larger than that: else the answer would cost more
    /// than it is worth. And the plane's normal, toward the eye.
    fn patch(&self, [a, b, c]: &[DVec3; 3]) -> Option<([DVec3; 4], DVec3)> {
        let normal = (b - a).cross(c - a);
        let mut patch = [DVec3::ZERO; 4];
        for (corner, ray) in patch.iter_mut().zip(&self.corners) {
            let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let t = normal.dot(a - origin) / normal.dot(direction);
            if !(t > 0.0 && t.is_finite()) {
                return None;
            }
            *corner = origin + direction * t;
        }
        let across = (patch[2] - patch[0]).cross(patch[3] - patch[1]);
        let toward_eye =
            if normal.dot(self.corners[0].direction.as_dvec3()) > 0.0 { -normal } else { normal };
        (normal.length_squared() >= 0.25 * across.length_squared()).then_some((patch, toward_eye))
    }
}

impl Sightlines {
    /// Forgets if it is much, as one of so many `tiles`. It is found out again then: nothing depends on it but time.
    pub fn tidy(&mut self, tiles: usize) {
        let most = MEMORY / size_of::<Blocker>() / tiles.max(1);
        if self.known.len() > MANY || self.blockers.len() > most {
            *self = Self::default();
        }
    }

    /// Finds out about the triangle of `hit`; `None` if nothing can be said. Else a number for [`Sightlines::blockers`].
    pub fn of(&mut self, scene: &TraceScene, window: &Window, hit: &Hit) -> Option<u32> {
        let of = (hit.instance, hit.triangle);
        if let Some(found) = self.known.iter().position(|known| *known == of) {
            return Some(found as u32);
        }
        let data = &scene.geometry.instances[hit.instance as usize];
        let placement = &scene.geometry.tlas.placements()[hit.instance as usize];
        let corners = data.mesh.corners(hit.triangle as usize).map(|p| {
            let p = p.as_dvec3();
            if placement.is_identity() { p } else { placement.world_from_local().transform_point3(p) }
        });
        let (patch, normal) = window.patch(&corners)?;
        self.lights = scene.lights.len();
        for light in 0..self.lights as u32 {
            let look = self.look(scene, &patch, normal, light);
            self.looks.push(look);
        }
        self.known.push(of);
        Some(self.known.len() as u32 - 1)
    }

    /// What may be between a light and a point of the triangle of that number; empty if nothing is.
    /// `None` if that is not known.
    pub fn blockers(&self, number: u32, light: u32) -> Option<&[Blocker]> {
        let look = self.looks.get(number as usize * self.lights + light as usize)?;
        look.map(|(first, end)| &self.blockers[first as usize..end as usize])
    }

    fn look(
        &mut self,
        scene: &TraceScene,
        patch: &[DVec3; 4],
        normal: DVec3,
        light: u32,
    ) -> Option<(u32, u32)> {
        let FlatLight::Shape(shape) = scene.lights.get(light) else { return None };
        let Shape::Parallelogram(quad) = &shape.shape else { return None };
        let first = self.blockers.len();
        let nothing = Some((first as u32, first as u32));
        let heights = patch.map(|p| (p - quad.corner.as_dvec3()).dot(quad.normal.as_dvec3()));
        let facing = if heights.iter().all(|h| *h >= 0.0) {
            quad.normal
        } else if heights.iter().all(|h| *h <= 0.0) {
            if !shape.two_sided {
                return nothing;
            }
            -quad.normal
        } else {
            return None;
        };
        let visible = above(quad, patch[0], normal);
        if visible.len() < 3 {
            return nothing;
        }
        let shaft = Shaft::new(patch, &visible);
        if !scene.lights.is_clear(&shaft, light) {
            return None;
        }
        let tolerance = 1e-6 * quad.corners().iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        let on_patch = 3e-7 * patch.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let up = normal.normalize();
        let few = scene.geometry.tlas.blockers(&shaft, |instance, triangle| {
            // Below the horizon, or in the same plane: nothing is in the way.
            if triangle.iter().all(|p| up.dot(p.as_dvec3() - patch[0]) <= on_patch) {
                return true;
            }
            if scene.coverage.alpha.get(instance as usize).copied().unwrap_or(false) {
                return false;
            }
            self.blockers.extend(Blocker::new(&triangle, quad.corner, facing, tolerance));
            self.blockers.len() - first <= LOOKED_AT
        });
        if !few {
            self.blockers.truncate(first);
            return None;
        }
        // In which order they are found is the hierarchy's affair: something behind a wall that nobody sees may change it.
        self.blockers[first..].sort_by(Blocker::order);
        simplify(&mut self.blockers, first, patch);
        if self.blockers.len() - first > FEW {
            self.blockers.truncate(first);
            return None;
        }
        Some((first as u32, self.blockers.len() as u32))
    }
}

/// The part of a parallelogram on the side of a plane to which its normal points.
fn above(quad: &Quad, on: DVec3, normal: DVec3) -> Vec<DVec3> {
    let corners = quad.corners().map(Vec3::as_dvec3);
    let heights = corners.map(|p| normal.dot(p - on));
    let mut out = Vec::with_capacity(5);
    for i in 0..4 {
        let (a, b) = (i, (i + 1) % 4);
        if heights[a] >= 0.0 {
            out.push(corners[a]);
        }
        if (heights[a] >= 0.0) != (heights[b] >= 0.0) {
            out.push(corners[a].lerp(corners[b], heights[a] / (heights[a] - heights[b])));
        }
    }
    out
}
