//! glTF's surface: metal, dielectric over Lambert and glass side by side, sheen and varnish on top.
//!
//! Nothing gains energy, and all but transmission is reciprocal: a layer lets through to what lies below only
//! what it reflects toward neither of the two directions.

use super::albedo::{self, Reflected};
use super::base::Base;
use super::glass::{GlassKind, GlassLobe};
use super::microfacet::{MIN_ALPHA, Microfacets, normal_reflectance, schlick};
use super::normal::{clear_of_surface, tilted};
use super::{Evaluated, Lobes, Proposal, pick, reflect, sheen};
use crate::scene::color::luminance;
use crate::scene::{Anisotropy, Layers};
use crate::trace::TraceScene;
use crate::trace::scene::{Surface, TextureIndex};
use crate::trace::surface::Interaction;
use crate::trace::warp::cosine_hemisphere;
use glam::{Mat3, Vec2, Vec3, Vec4};

/// All lobes of a point as seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layered {
    /// Tangent, bitangent, normal.
    frame: Mat3,
    /// In that frame.
    wo: Vec3,
    /// The normal of the base's wide lobes in that frame, where it is another.
    wide: Option<Vec3>,
    base: Base,
    sheen: Option<SheenLobe>,
    coat: Option<Coat>,
    glass: Option<GlassLobe>,
    /// How much goes into wide lobes, the base's facets, the coat's, through glass, and into the sheen.
    powers: [f32; 5],
}

/// Fibres on top of the base.
#[derive(Clone, Copy, Debug)]
struct SheenLobe {
    color: Vec3,
    roughness: f32,
    /// What is left for the base toward the eye.
    rest: f32,
}

impl SheenLobe {
    fn rest(color: Vec3, roughness: f32, cos: f32) -> f32 {
        1.0 - color.max_element() * albedo::of_sheen(cos, roughness).min(1.0)
    }

    /// f · cos. Near the horizon the formula would send back more than there is; scaled by the brighter of
    /// both directions it is reciprocal still.
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let most = [wo, wi].map(|w| albedo::of_sheen(w.z, self.roughness));
        self.color * (sheen::reflected(self.roughness, wo, wi) / most[0].max(most[1]).max(1.0))
    }
}

/// Varnish on top of all, around its own normal.
#[derive(Clone, Copy, Debug)]
struct Coat {
    frame: Mat3,
    wo: Vec3,
    facets: Microfacets,
    roughness: f32,
    factor: f32,
    rest: f32,
}

/// The varnish has an index of refraction of 1.5.
const COAT_F0: f32 = 0.04;

impl Coat {
    fn rest(factor: f32, roughness: f32, cos: f32) -> f32 {
        1.0 - factor * Reflected::table().at(cos, roughness).dot(Vec2::new(COAT_F0, 1.0))
    }

    /// f · cos and the density of sampling it.
    fn evaluate(&self, wi: Vec3) -> (f32, f32) {
        let wi = self.frame.transpose() * wi;
        if wi.z <= 0.0 {
            return (0.0, 0.0);
        }
        let Some(h) = (self.wo + wi).try_normalize() else { return (0.0, 0.0) };
        let fresnel = COAT_F0 + (1.0 - COAT_F0) * schlick(self.wo.dot(h));
        let value = fresnel * self.facets.distribution(h) * self.facets.visibility(self.wo, wi) * wi.z;
        (value * self.factor, self.facets.pdf(self.wo, h) / (4.0 * self.wo.dot(h).max(1e-7)))
    }

    fn rest_toward(&self, wi: Vec3) -> f32 {
        let cos = self.frame.z_axis.dot(wi).abs();
        self.rest.min(Self::rest(self.factor, self.roughness, cos))
    }
}

/// Facets up to this alpha mirror so clearly that direct lighting follows what they show.
const CLEAR_ALPHA: f32 = 0.04;

impl Layered {
    pub(super) fn new(
        scene: &TraceScene,
        surface: &Surface,
        at: &Interaction,
        [normal, wide]: [Vec3; 2],
        color: Vec3,
        metallic: f32,
        roughness: f32,
    ) -> Self {
        let layers = surface.layers.as_deref();
        let alpha = (roughness * roughness).max(MIN_ALPHA);
        let brushed = layers.and_then(|layers| layers.anisotropy.as_ref());
        let (frame, facets) = match brushed {
            Some(brushed) => brush(scene, brushed, at, normal, alpha),
            None => (frame_around(normal), Microfacets::new(alpha)),
        };
        let wo = frame.transpose() * at.wo;
        let wo = Vec3::new(wo.x, wo.y, wo.z.max(1e-6));

        let red = |texture: Option<TextureIndex>| scene.texture(texture, at.uvs).x;
        let transmission = layers.and_then(|layers| layers.transmission.as_ref());
        let through = transmission.map_or(0.0, |t| t.factor * red(t.texture)) * (1.0 - metallic);
        let (f0, f90) = layers.map_or((Vec3::splat(0.04), 1.0), |layers| dielectric(scene, layers, at));
        let base = Base::new(wo, facets, color, metallic, (1.0 - metallic) - through, f0, f90);

        let inside = !at.front && transmission.is_some_and(|t| t.body.is_some());
        let glass = transmission.filter(|_| through > 0.0).map(|transmission| {
            let ior = layers.map_or(1.5, |layers| layers.ior);
            let rough = alpha.sqrt();
            let (kind, passed) = match transmission.body {
                Some(_) => {
                    let eta = if inside { 1.0 / ior } else { ior };
                    let passed = surface.passed.as_ref().map_or(1.0, |passed| passed.at(inside, wo.z, rough));
                    (GlassKind::Body { eta }, passed)
                }
                None => (GlassKind::Pane { ior }, Reflected::table().at(wo.z, rough).element_sum()),
            };
            GlassLobe::new(alpha, through, color, kind, passed)
        });
        let sheen = layers.and_then(|layers| layers.sheen.as_ref()).map(|sheen| {
            let color = sheen.color * scene.texture(sheen.color_texture, at.uvs).truncate();
            // Finer fibres would be resolved by no table, and are seen by hardly any eye.
            let roughness =
                (sheen.roughness * scene.texture(sheen.roughness_texture, at.uvs).w).clamp(0.07, 1.0);
            SheenLobe { color, roughness, rest: SheenLobe::rest(color, roughness, wo.z) }
        });
        // Within a body, the varnish is on the other side.
        let coat = layers.and_then(|layers| layers.clearcoat.as_ref()).filter(|_| !inside).map(|coat| {
            let normal = match &coat.normal_map {
                Some(map) => clear_of_surface(tilted(scene, map, at), at),
                None => clear_of_surface(at.normal, at),
            };
            let frame = frame_around(normal);
            let roughness = coat.roughness * scene.texture(coat.roughness_texture, at.uvs).y;
            let factor = coat.factor * red(coat.texture);
            let wo = frame.transpose() * at.wo;
            let wo = Vec3::new(wo.x, wo.y, wo.z.max(1e-6));
            let facets = Microfacets::new(roughness * roughness);
            Coat { frame, wo, facets, roughness, factor, rest: Coat::rest(factor, roughness, wo.z) }
        });
        let wide = (wide != normal).then(|| frame.transpose() * wide);
        let mut layered = Self { frame, wo, wide, base, sheen, coat, glass, powers: [0.0; 5] };
        layered.powers = layered.powers();
        layered
    }

    /// How much of white light from all around each lobe sends to the eye.
    fn powers(&self) -> [f32; 5] {
        let [wide, facets] = self.base.powers(self.wo);
        let below_coat = self.coat.map_or(1.0, |coat| coat.rest);
        let below = below_coat * self.sheen.map_or(1.0, |sheen| sheen.rest);
        let fibres = self
            .sheen
            .map_or(0.0, |sheen| luminance(sheen.color) * albedo::of_sheen(self.wo.z, sheen.roughness));
        [
            wide * below,
            facets * below,
            1.0 - below_coat,
            self.glass.map_or(0.0, |glass| glass.weight * below),
            fibres * below_coat,
        ]
    }

    pub(super) fn has(&self, lobes: Lobes) -> bool {
        let [wide, facets, coat, glass, fibres] = self.powers.map(|power| power > 0.0);
        let clear = glass && self.glass.is_some_and(|glass| glass.is_delta());
        lobes.diffuse && (wide || fibres)
            || lobes.glossy && (facets || coat || glass && !clear)
            || lobes.delta && clear
    }

    /// Their probabilities, which sum to 1 or are all 0.
    fn shares(&self, lobes: Lobes) -> [f32; 5] {
        let clear = self.glass.is_some_and(|glass| glass.is_delta());
        let glass = if clear { lobes.delta } else { lobes.glossy };
        let asked = [lobes.diffuse, lobes.glossy, lobes.glossy, glass, lobes.diffuse];
        let mut shares: [f32; 5] = std::array::from_fn(|i| if asked[i] { self.powers[i] } else { 0.0 });
        let sum: f32 = shares.iter().sum();
        if sum > 0.0 {
            shares = shares.map(|share| share / sum);
        }
        shares
    }

    /// What the layers on top leave of light between the eye and `wi`, `local` in the base's frame.
    fn rest(&self, wi: Vec3, local: Vec3) -> f32 {
        let below_coat = self.coat.map_or(1.0, |coat| coat.rest_toward(wi));
        let below_sheen = self.sheen.map_or(1.0, |sheen| {
            sheen.rest.min(SheenLobe::rest(sheen.color, sheen.roughness, local.z.abs()))
        });
        below_coat * below_sheen
    }

    /// `above`: on the eye's side of the true surface.
    pub(super) fn evaluate(&self, wi: Vec3, above: bool, lobes: Lobes) -> Evaluated {
        let local = self.frame.transpose() * wi;
        let shares = self.shares(lobes);
        let mut sum = Evaluated::default();
        let cos = self.wide.map_or(local.z, |wide| wide.dot(local));
        if above && local.z.max(cos) > 0.0 {
            sum = self.base.evaluate(self.wo, local, cos, &shares);
        }
        if let Some(glass) = &self.glass
            && above == (local.z > 0.0)
        {
            let (value, pdf) = glass.evaluate(self.wo, local);
            sum.glossy += value;
            sum.pdf += pdf * shares[3];
        }
        if self.sheen.is_some() || self.coat.is_some() {
            let rest = self.rest(wi, local);
            sum.diffuse *= rest;
            sum.glossy *= rest;
        }
        if let Some(sheen) = &self.sheen
            && above
            && local.z > 0.0
        {
            let below_coat = self.coat.map_or(1.0, |coat| coat.rest_toward(wi));
            // Light samples are taken above the horizon of the wide lobes.
            if cos > 0.0 {
                sum.diffuse += sheen.evaluate(self.wo, local) * below_coat;
            }
            sum.pdf += sheen::pdf(local) * shares[4];
        }
        if let Some(coat) = &self.coat
            && above
        {
            let (value, pdf) = coat.evaluate(wi);
            sum.glossy += value;
            sum.pdf += pdf * shares[2];
        }
        sum
    }

    pub(super) fn sample(&self, choice: f32, u: Vec2, lobes: Lobes) -> Option<Proposal> {
        let shares = self.shares(lobes);
        let (lobe, rest) = pick(&shares, choice)?;
        let world = |local: Vec3| (self.frame * local).normalize();
        match lobe {
            0 => {
                let local = cosine_hemisphere(u);
                Some(Proposal::reflected(world(self.wide.map_or(local, |wide| frame_around(wide) * local))))
            }
            1 => mirrored(&self.frame, &self.base.facets, self.wo, u),
            2 => {
                let coat = self.coat.as_ref()?;
                mirrored(&coat.frame, &coat.facets, coat.wo, u)
            }
            3 => {
                let glass = self.glass.as_ref()?;
                let (local, through, weight) = glass.sample(self.wo, rest, u)?;
                let wi = world(local);
                let delta = glass.is_delta().then(|| weight * (self.rest(wi, local) / shares[3]));
                Some(Proposal { wi, through, follow: through || delta.is_some(), delta })
            }
            _ => Some(Proposal::reflected(world(sheen::sample(u)))),
        }
    }
}

/// A reflection at a facet that is seen from `wo`, in the world.
fn mirrored(frame: &Mat3, facets: &Microfacets, wo: Vec3, u: Vec2) -> Option<Proposal> {
    let wi = reflect(wo, facets.sample(wo, u));
    let follow = facets.alpha.max_element() <= CLEAR_ALPHA;
    (wi.z > 0.0).then(|| Proposal { follow, ..Proposal::reflected((*frame * wi).normalize()) })
}

fn frame_around(normal: Vec3) -> Mat3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    Mat3::from_cols(tangent, bitangent, normal)
}

/// Reflectance of the dielectric at normal incidence and at the horizon.
fn dielectric(scene: &TraceScene, layers: &Layers<TextureIndex>, at: &Interaction) -> (Vec3, f32) {
    let specular = layers.specular * scene.texture(layers.specular_texture, at.uvs).w;
    let color = layers.specular_color * scene.texture(layers.specular_color_texture, at.uvs).truncate();
    let f0 = if layers.ior.is_finite() { normal_reflectance(layers.ior) } else { 1.0 };
    ((color * f0).min(Vec3::ONE) * specular, specular)
}

/// A frame along the brush, and facets that are rough along it.
fn brush(
    scene: &TraceScene,
    brushed: &Anisotropy<TextureIndex>,
    at: &Interaction,
    normal: Vec3,
    alpha: f32,
) -> (Mat3, Microfacets) {
    let texel = match brushed.texture {
        Some(_) => scene.texture(brushed.texture, at.uvs),
        None => Vec4::new(1.0, 0.5, 1.0, 1.0),
    };
    let direction = Vec2::from_angle(brushed.rotation).rotate(texel.truncate().truncate() * 2.0 - 1.0);
    let tangent = at.tangent.truncate();
    let along = tangent * direction.x + normal.cross(tangent) * (at.tangent.w * direction.y);
    let Some(along) = (along - normal * normal.dot(along)).try_normalize() else {
        return (frame_around(normal), Microfacets::new(alpha));
    };
    let strength = brushed.strength * texel.z;
    let frame = Mat3::from_cols(along, normal.cross(along), normal);
    let rough = alpha + (1.0 - alpha) * strength * strength;
    (frame, Microfacets { alpha: Vec2::new(rough, alpha) })
}
