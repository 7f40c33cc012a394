//! The scene as rays need it: flat arrays, indices for references.

use super::bsdf::Passed;
use super::emitter::Receiver;
use super::features::{Feature, count};
use super::lights::Lights;
use super::texture::lookup;
use super::{RenderSettings, Viewpoint};
use crate::bvh::triangle::cross;
use crate::bvh::{Accept, Hit, Ray, Tlas};
use crate::scene::{Alpha, Body, Glossy, Layers, Material, NormalMap, Texture, TriangleMesh};
use bevy_ecs::prelude::*;
use glam::{Affine2, DMat3, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// Everything a ray can hit, and what shading looks up there.
#[derive(Resource, Clone, Debug, Default)]
pub struct Geometry {
    /// The hierarchy. Its instance indices are those of `instances`.
    pub tlas: Tlas,
    /// One for each placement.
    pub instances: Vec<InstanceData>,
}

/// What shading looks up of an instance.
#[derive(Clone, Debug)]
pub struct InstanceData {
    /// The shared mesh.
    pub mesh: Arc<TriangleMesh>,
    /// Indices into [`Surfaces::materials`], by slot.
    pub materials: Vec<u32>,
    /// `world_from_local` for normals: the inverse transpose.
    pub normal_matrix: DMat3,
}

/// All materials and textures.
#[derive(Resource, Clone, Debug)]
pub struct Surfaces {
    /// Number 0 is the default material.
    pub materials: Vec<Surface>,
    /// All textures.
    pub textures: Vec<Texture>,
}

impl Default for Surfaces {
    fn default() -> Self {
        Self { materials: vec![Surface::from(Material::default())], textures: Vec::new() }
    }
}

/// Where rays have to ask whether a hit counts: the rest of the scene pays nothing for it.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// By instance: whether some of its material lets rays through by chance or by a mask.
    pub alpha: Vec<bool>,
    /// By instance: whether some of its material is not seen from behind.
    pub culled: Vec<bool>,
    /// By instance: whether it has triangles that are sampled as lights, and are no occluders of themselves.
    pub lights: Vec<bool>,
}

/// A [`Material`] with its textures resolved to indices.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The material; its texture references are not for here.
    pub material: Material,
    /// Base colour and alpha.
    pub base_color_texture: Option<TextureIndex>,
    /// Roughness in green, metalness in blue.
    pub glossy_texture: Option<TextureIndex>,
    /// Emission.
    pub emission_texture: Option<TextureIndex>,
    /// Tilts the shading normal.
    pub normal_map: Option<NormalMap<TextureIndex>>,
    /// What extensions add to metallic-roughness.
    pub layers: Option<Box<Layers<TextureIndex>>>,
    /// How much a rough body lets through, if the surface is one.
    pub passed: Option<Arc<Passed>>,
}

impl Surface {
    /// Whether all it does is to reflect evenly (Lambert), whatever its colour.
    #[inline]
    #[must_use]
    pub fn is_diffuse(&self) -> bool {
        let m = &self.material;
        matches!(m.glossy, Glossy::None)
            && m.mirror == Vec3::ZERO
            && m.glass.is_none()
            && self.normal_map.is_none()
            && m.emission == Vec3::ZERO
            && !m.unlit
    }

    /// The body behind the surface, if light can enter it.
    #[must_use]
    pub fn body(&self) -> Option<Body> {
        self.layers.as_ref()?.transmission.as_ref()?.body
    }
}

/// A texture and how to reach into it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureIndex {
    /// Index into [`Surfaces::textures`].
    pub index: u32,
    /// `texture_from_mesh` coordinates.
    pub uv_transform: Affine2,
    /// Whether it lies on the mesh's second set of coordinates.
    pub second_uvs: bool,
}

impl From<Material> for Surface {
    fn from(material: Material) -> Self {
        Self {
            material,
            base_color_texture: None,
            glossy_texture: None,
            emission_texture: None,
            normal_map: None,
            layers: None,
            passed: None,
        }
    }
}

/// Borrowed view of all that the picture depends on.
#[derive(Clone, Copy, Debug)]
pub struct TraceScene<'a> {
    /// What rays hit.
    pub geometry: &'a Geometry,
    /// What it is made of.
    pub surfaces: &'a Surfaces,
    /// Where hits have to be asked about.
    pub coverage: &'a Coverage,
    /// What shines.
    pub lights: &'a Lights,
    /// From where it is seen.
    pub viewpoint: &'a Viewpoint,
    /// How.
    pub settings: &'a RenderSettings,
}

impl<'a> TraceScene<'a> {
    /// The instance and the material of a hit.
    #[inline]
    #[must_use]
    pub fn surface_at(&self, hit: &Hit) -> (&'a InstanceData, &'a Surface) {
        let instance = &self.geometry.instances[hit.instance as usize];
        let slot = instance.mesh.slot(hit.triangle as usize);
        let material = instance.materials.get(slot).copied().unwrap_or(0);
        let materials = &self.surfaces.materials;
        (instance, materials.get(material as usize).unwrap_or(&materials[0]))
    }

    /// How many samples are taken of a light at a vertex after `depth` bounces; `None`: of one that is chosen by chance.
    #[must_use]
    pub fn light_samples(&self, depth: u32, light: Option<u32>) -> u32 {
        let count = self.settings.light_samples.max(1);
        match light.map(|light| self.lights.get(light)) {
            _ if depth > 0 => 1,
            // All samples of a light without extent are the same.
            Some(light) if !light.has_extent() => 1,
            // A choice among many varies more than where on one: as many for it again.
            Some(light) if light.is_many() => count.saturating_mul(count),
            None if self.lights.len() > super::mesh_light::FEW => count.saturating_mul(count),
            _ => count,
        }
    }

    /// How many samples of `light` are expected to be taken at a vertex after `depth` bounces.
    #[must_use]
    pub fn expected_looks(&self, depth: u32, light: u32, to: &Receiver) -> f32 {
        let certain = self.lights.samples_all(depth).then_some(light);
        self.lights.chance(depth, light, to) * self.light_samples(depth, certain) as f32
    }

    /// `texture` at the first or second of `uvs`, white where there is none.
    #[must_use]
    pub fn texture(&self, texture: Option<TextureIndex>, uvs: [Vec2; 2]) -> Vec4 {
        let Some(TextureIndex { index, uv_transform, second_uvs }) = texture else { return Vec4::ONE };
        let Some(texture) = self.surfaces.textures.get(index as usize) else { return Vec4::ONE };
        count(Feature::TextureLookup);
        let filter = self.settings.filter.unwrap_or(texture.filter);
        lookup(texture, filter, uv_transform.transform_point2(uvs[usize::from(second_uvs)]))
    }

    /// For each ray the nearest hit that is there: what alpha lets through is not, nor, where the ray `looks`, the back of what
    /// is not seen from behind. `random` in [0, 1) decides about partial coverage, as a function of the ray's number and
    /// the hit's key.
    pub fn closest_hits(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        looks: impl Fn(usize) -> bool,
        random: impl Fn(usize, u32) -> f32 + Sync,
    ) {
        let covering = Covering { scene: self, ignored: &[], looking: &[], random: &random };
        let asked = self.coverage.alpha.contains(&true);
        let covering: &dyn Accept = &covering;
        self.geometry.tlas.closest_hits(rays, hits, asked.then_some(covering));
        if !self.coverage.culled.contains(&true) {
            return;
        }
        // Hardly any ray meets a back first, so only these are asked all along their way.
        let meets_back =
            |&i: &usize| looks(i) && hits[i].is_some_and(|hit| self.is_unseen_back(&hit, &rays[i]));
        let again: Vec<usize> = (0..rays.len()).filter(meets_back).collect();
        if again.is_empty() {
            return;
        }
        let looking: Vec<Ray> = again.iter().map(|&i| rays[i]).collect();
        let mut found = vec![None; again.len()];
        let random = |i: usize, key: u32| random(again[i], key);
        let covering = Covering { scene: self, ignored: &[], looking: &looking, random };
        self.geometry.tlas.closest_hits(&looking, &mut found, Some(&covering));
        for (&i, hit) in again.iter().zip(found) {
            hits[i] = hit;
        }
    }

    /// The nearest surface that the eye sees along one ray; what is there by half is there.
    #[must_use]
    pub fn first_seen(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = [None];
        self.closest_hits(&[*ray], &mut hit, |_| true, |_, _| 0.5);
        hit[0]
    }

    /// Whether `ray` meets there the back of what is not seen from behind.
    fn is_unseen_back(&self, hit: &Hit, ray: &Ray) -> bool {
        if !self.coverage.culled.get(hit.instance as usize).is_some_and(|&culled| culled) {
            return false;
        }
        let (instance, surface) = self.surface_at(hit);
        if !surface.material.culled {
            return false;
        }
        let corners = instance.mesh.corners(hit.triangle as usize).map(Vec3::as_dvec3);
        // The inverse transpose keeps sides, also under a mirroring placement.
        (instance.normal_matrix * cross(&corners)).dot(ray.direction.as_dvec3()) > 0.0
    }

    /// For each ray whether something is there, not counting the triangle `ignored` of it, (instance,
    /// triangle).
    pub fn any_hits(
        &self,
        rays: &[Ray],
        blocked: &mut [bool],
        ignored: &[Option<(u32, u32)>],
        random: impl Fn(usize, u32) -> f32 + Sync,
    ) {
        let asked = self.coverage.alpha.contains(&true) || ignored.iter().any(Option::is_some);
        let covering = Covering { scene: self, ignored, looking: &[], random };
        let covering: &dyn Accept = &covering;
        self.geometry.tlas.any_hits(rays, blocked, asked.then_some(covering));
    }

    /// How much of it is there, 0 to 1.
    pub(super) fn coverage_at(&self, hit: &Hit) -> f32 {
        let (instance, surface) = self.surface_at(hit);
        let alpha = || {
            count(Feature::AlphaTest);
            let corners = instance.mesh.triangles[hit.triangle as usize];
            let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
            let uvs = both_uvs(&instance.mesh, corners, weights);
            let vertex = interpolate(&instance.mesh.colors, corners, weights).map_or(1.0, |c: Vec4| c.w);
            surface.material.opacity * vertex * self.texture(surface.base_color_texture, uvs).w
        };
        match surface.material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask(cutoff) => f32::from(u8::from(alpha() >= cutoff)),
            Alpha::Blend => alpha().clamp(0.0, 1.0),
        }
    }

    fn covers(&self, hit: &Hit, random: impl Fn(u32) -> f32) -> bool {
        match self.coverage_at(hit) {
            0.0 => false,
            1.0 => true,
            part => random(hit.instance.wrapping_mul(0x9e37_79b9) ^ hit.triangle) < part,
        }
    }
}

/// Says of hits whether they are there, for a batch of rays.
struct Covering<'a, 's, R> {
    scene: &'a TraceScene<'s>,
    /// For each ray a triangle that doesn't count; or empty.
    ignored: &'a [Option<(u32, u32)>],
    /// The rays, if they do not see backs that are not to be seen; or empty.
    looking: &'a [Ray],
    random: R,
}

impl<R: Fn(usize, u32) -> f32> Accept for Covering<'_, '_, R> {
    #[inline]
    fn asks(&self, instance: u32) -> bool {
        let set = |flags: &[bool]| flags.get(instance as usize).copied().unwrap_or(false);
        set(&self.scene.coverage.alpha)
            || !self.ignored.is_empty() && set(&self.scene.coverage.lights)
            || !self.looking.is_empty() && set(&self.scene.coverage.culled)
    }

    fn takes(&self, ray: usize, hit: &Hit) -> bool {
        self.ignored.get(ray).copied().flatten() != Some((hit.instance, hit.triangle))
            && !self.looking.get(ray).is_some_and(|ray| self.scene.is_unseen_back(hit, ray))
            && self.scene.covers(hit, |key| (self.random)(ray, key))
    }
}

/// Both sets of texture coordinates inside a triangle; zero if the mesh doesn't have them.
#[must_use]
pub fn both_uvs(mesh: &TriangleMesh, corners: [u32; 3], weights: Vec3) -> [Vec2; 2] {
    let set = |uvs: &[Vec2]| interpolate(uvs, corners, weights).unwrap_or(Vec2::ZERO);
    [set(&mesh.uvs), set(&mesh.second_uvs)]
}

/// A vertex attribute inside a triangle; `None` if the mesh doesn't have it.
#[must_use]
pub fn interpolate<T>(attribute: &[T], corners: [u32; 3], weights: Vec3) -> Option<T>
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = corners.map(|i| attribute.get(i as usize).copied());
    Some(a? * weights.x + b? * weights.y + c? * weights.z)
}
