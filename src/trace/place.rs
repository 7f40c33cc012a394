//! What surface a pixel shows, so that its light is found again in another view.

use super::TraceScene;
use super::scene::Surface;
use super::sightlines::Window;
use super::surface::Interaction;
use crate::bvh::{Hit, Ray};
use crate::scene::Glossy;
use glam::{Vec2, Vec3};

/// The first surface behind a point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Where, in render space; where there is nothing, the unit direction.
    pub position: Vec3,
    /// Unit geometric normal toward the eye; zero where there is nothing.
    pub facet: Vec3,
    /// What it is: an instance, a solid light, [`Place::NOTHING`] or [`Place::UNKNOWN`].
    pub thing: u32,
    /// Unit shading normal, times 127.
    pub normal: [i8; 3],
    /// How many samples light that was seen from elsewhere is worth here, at most: none on mirrors and glass.
    pub keeps: u8,
    /// Base colour, times 255; white for lamps.
    pub albedo: [u8; 3],
    /// A pixel here shows several surfaces.
    pub edge: bool,
}

/// What is remembered of a [`Place`] for each pixel, to find it again: small, for all of it is read and written
/// for each picture while one moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// See [`Place::position`].
    pub position: Vec3,
    /// See [`Place::thing`].
    pub thing: u32,
    /// Unit geometric normal, times 127.
    pub facet: [i8; 3],
    /// See [`Place::keeps`]; 0 also where a pixel shows several surfaces. With [`Spot::OUTLINE`] only its middle is of this one.
    pub keeps: u8,
}

impl Spot {
    /// Not looked at yet.
    pub const UNKNOWN: Self = Self { position: Vec3::ZERO, thing: Place::UNKNOWN, facet: [0; 3], keeps: 0 };
    /// Marks [`Spot::keeps`] of a pixel beside one of another surface.
    pub const OUTLINE: u8 = 0x80;

    /// The same without [`Spot::OUTLINE`].
    #[inline(always)]
    #[must_use]
    pub fn unmarked(&self) -> Self {
        Self { keeps: self.keeps & !Self::OUTLINE, ..*self }
    }

    /// Whether [`Spot::OUTLINE`] is set.
    #[inline(always)]
    #[must_use]
    pub fn is_outline(&self) -> bool {
        self.keeps & Self::OUTLINE > 0
    }

    /// Whether `other`, seen in a pixel of this side beside it, is of the same smooth surface.
    #[inline(always)]
    #[must_use]
    pub fn continues(&self, other: &Self, pixel: f32) -> bool {
        let [a, b] = [self, other].map(|spot| Vec3::from_array(spot.facet.map(f32::from)) / 127.0);
        self.thing == other.thing
            && (self.thing == Place::NOTHING
                || a.dot(b) > 0.9 && a.dot(other.position - self.position).abs() <= 2.0 * pixel)
    }
}

impl From<&Place> for Spot {
    fn from(place: &Place) -> Self {
        let keeps = if place.edge { 0 } else { place.keeps };
        Self { position: place.position, thing: place.thing, facet: packed(place.facet), keeps }
    }
}

/// Below this perceptual roughness one sees reflections, which move with the eye.
const SHINY: f32 = 0.25;
/// What light is worth that looks the same from everywhere, samples.
const MATT: f32 = 64.0;

impl Place {
    /// The ray leaves the scene.
    pub const NOTHING: u32 = u32::MAX;
    /// Nobody has looked yet.
    pub const UNKNOWN: u32 = u32::MAX - 1;
    /// Solid lights are counted from here on.
    const LIGHTS: u32 = 1 << 31;

    /// Not looked at yet.
    #[must_use]
    pub fn unknown() -> Self {
        Self::plain(Vec3::ZERO, Vec3::ZERO, Self::UNKNOWN, 0)
    }

    /// Whether it is on an instance, not on a lamp and not nowhere.
    #[inline(always)]
    #[must_use]
    pub fn is_instance(&self) -> bool {
        self.thing < Self::LIGHTS
    }

    /// Whether `other`, seen a few pixels of side `pixel` beside it, is part of the same smooth surface.
    #[inline(always)]
    #[must_use]
    pub fn continues(&self, other: &Self, pixel: f32) -> bool {
        self.thing == other.thing
            && (self.thing == Self::NOTHING
                || self.facet.dot(other.facet) > 0.9
                    && self.facet.dot(other.position - self.position).abs() <= pixel)
    }

    /// What light is divided by to leave base colours out of it.
    #[must_use]
    pub fn base(&self) -> Vec3 {
        if self.is_instance() {
            (Vec3::from_array(self.albedo.map(f32::from)) / 255.0).max(Vec3::splat(0.02))
        } else {
            Vec3::ONE
        }
    }

    fn plain(position: Vec3, facet: Vec3, thing: u32, keeps: u8) -> Self {
        Self { position, facet, thing, normal: packed(facet), keeps, albedo: [255; 3], edge: false }
    }
}

fn packed(normal: Vec3) -> [i8; 3] {
    // What is added has no digits behind the point: `round` is a call on old machines.
    const WHOLE: f32 = 1.5 * (1 << 23) as f32;
    (normal * 127.0).to_array().map(|c| ((c + WHOLE) - WHOLE) as i8)
}

/// Fills in the first surfaces at `places` of the picture.
pub fn places(scene: &TraceScene, places: &[Vec2], values: &mut [Place]) {
    let size = scene.settings.size;
    let rays: Vec<Ray> = places.iter().map(|&place| scene.viewpoint.ray(place, size)).collect();
    let mut hits = vec![None; rays.len()];
    // What is there by half is there.
    scene.closest_hits(&rays, &mut hits, |_| true, |_, _| 0.5);
    // Most of the picture shows no lamp.
    let corner = |pick: fn(Vec2, Vec2) -> Vec2| places.iter().copied().reduce(pick).unwrap_or_default();
    // A row alone would have no inside.
    let window = Window::around(scene, corner(Vec2::min) - 0.5, corner(Vec2::max) + 0.5, size);
    let lamps = scene.lights.any_shape(|bounds| !window.hides(&bounds));
    for ((value, ray), hit) in values.iter_mut().zip(&rays).zip(&hits) {
        *value = place(scene, ray, hit.as_ref(), lamps);
    }
}

/// `lamps`: whether there may be any.
fn place(scene: &TraceScene, ray: &Ray, hit: Option<&Hit>, lamps: bool) -> Place {
    let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
    let lamp = lamps.then(|| scene.lights.closest(&Ray { t_max, ..*ray }));
    if let Some(lamp) = lamp.flatten() {
        let thing = Place::LIGHTS | lamp.light;
        let position = ray.at(lamp.hit.t);
        let normal = lamp.shape.normal_at(position);
        let facet = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        return Place::plain(position, facet, thing, MATT as u8);
    }
    let Some(hit) = hit else {
        return Place::plain(ray.direction, Vec3::ZERO, Place::NOTHING, MATT as u8);
    };
    let (instance, surface) = scene.surface_at(hit);
    let at = Interaction::flat(scene, instance, hit, ray);
    let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
    let albedo = surface.material.base_color * texel.truncate();
    Place {
        position: at.position,
        facet: at.geometric_normal,
        thing: hit.instance,
        normal: packed(at.normal),
        keeps: keeps(scene, surface, &at) as u8,
        albedo: (albedo * 255.0).round().to_array().map(|c| c as u8),
        edge: false,
    }
}

/// How many samples light that was seen from elsewhere is worth, at most.
fn keeps(scene: &TraceScene, surface: &Surface, at: &Interaction) -> f32 {
    let material = &surface.material;
    let sees_through =
        surface.layers.as_ref().is_some_and(|l| l.transmission.is_some() || l.clearcoat.is_some());
    if material.mirror != Vec3::ZERO || material.glass.is_some() || sees_through {
        return 0.0;
    }
    if material.unlit {
        return MATT;
    }
    let (roughness, metallic) = match material.glossy {
        // Of the same width: α² = 2 / (n + 2) (B. Walter et al., "Microfacet Models for Refraction", 2007).
        Glossy::BlinnPhong { exponent, specular, .. } if specular != Vec3::ZERO => {
            ((2.0 / (exponent + 2.0)).powf(0.25), specular.max_element())
        }
        Glossy::None | Glossy::BlinnPhong { .. } => return MATT,
        Glossy::Ggx { metallic, roughness, .. } => {
            let texel = scene.texture(surface.glossy_texture, at.uvs);
            (roughness * texel.y, metallic * texel.z)
        }
    };
    if roughness < SHINY {
        return 0.0;
    }
    // What a dielectric reflects is faint beside what it scatters.
    MATT * roughness.min(1.0).powf(2.0 + 2.0 * metallic.clamp(0.0, 1.0))
}
