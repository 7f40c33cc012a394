//! How a surface scatters light at one point, seen from one direction.
//!
//! Directions leave the surface: `wo` to the eye, `wi` to the light, both of unit length.

pub mod albedo;
mod base;
mod classic;
mod glass;
mod layered;
mod microfacet;
pub mod normal;
mod sheen;

pub use albedo::Passed;

use super::TraceScene;
use super::scene::Surface;
use super::surface::Interaction;
use crate::scene::Glossy;
use classic::Classic;
use glam::{Vec2, Vec3};
use layered::Layered;

/// A surface point, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    normal: Vec3,
    geometric_normal: Vec3,
    /// Decides whether a direction leaves the surface.
    side: Vec3,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Classic(Classic),
    Layered(Layered),
}

/// Which lobes a question is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobes {
    /// What is so wide that light samples alone find it well: Lambert, sheen, light that rough metal scatters
    /// several times.
    pub diffuse: bool,
    /// Blinn-Phong, GGX, rough glass.
    pub glossy: bool,
    /// Mirror and clear glass: only ever sampled.
    pub delta: bool,
}

impl Lobes {
    /// All of them.
    pub const ALL: Self = Self { diffuse: true, glossy: true, delta: true };
    /// All but the wide ones: what direct lighting follows.
    pub const SPECULAR: Self = Self { diffuse: false, glossy: true, delta: true };
}

/// What a BSDF says about one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluated {
    /// f · |cos| of the wide lobes.
    pub diffuse: Vec3,
    /// f · |cos| of the glossy ones.
    pub glossy: Vec3,
    /// Density in solid angle with which [`Bsdf::sample`] proposes it.
    pub pdf: f32,
}

/// What a BSDF proposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit direction.
    pub wi: Vec3,
    /// f · |cos| / pdf.
    pub weight: Vec3,
    /// Density in solid angle; `None` for a mirror-like (delta) lobe.
    pub pdf: Option<f32>,
    /// As good as a mirror, or on its way through: what direct lighting sees through to the next surface.
    pub follow: bool,
}

impl Bsdf {
    /// The lobes of `surface` at `at`.
    #[must_use]
    pub fn new(scene: &TraceScene, surface: &Surface, at: &Interaction) -> Self {
        let material = &surface.material;
        let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
        let base = material.base_color * texel.truncate();
        let mirrors = !matches!(material.glossy, Glossy::None)
            || surface.normal_map.is_some()
            || material.mirror != Vec3::ZERO
            || material.glass.is_some();
        let shading = surface.normal_map.as_ref().map_or(at.normal, |map| normal::tilted(scene, map, at));
        let wide = normal::facing(shading, at);
        let normal = if mirrors { normal::clear_of_surface(shading, at) } else { wide };
        let kind = match &material.glossy {
            Glossy::Ggx { metallic, roughness, .. } => {
                let texel = scene.texture(surface.glossy_texture, at.uvs);
                let (metallic, roughness) = (metallic * texel.z, roughness * texel.y);
                Kind::Layered(Layered::new(scene, surface, at, [normal, wide], base, metallic, roughness))
            }
            glossy => Kind::Classic(Classic {
                normal,
                wide,
                wo: at.wo,
                diffuse: base,
                phong: match glossy {
                    Glossy::BlinnPhong { specular, exponent, .. } => {
                        let texel = scene.texture(surface.glossy_texture, at.uvs);
                        // Beyond a million it is a mirror to single precision.
                        Some((*specular * texel.truncate(), (exponent * texel.w).min(1e6)))
                    }
                    _ => None,
                },
                mirror: material.mirror,
                glass: material.glass,
                front: at.front,
            }),
        };
        Self { normal: wide, geometric_normal: at.geometric_normal, side: at.side(), kind }
    }

    /// Unit normal of the wide lobes, on the eye's side of the surface.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Whether light from a chosen direction can be reflected at all.
    #[must_use]
    pub fn has_smooth_lobes(&self) -> bool {
        self.has(Lobes { delta: false, ..Lobes::ALL })
    }

    /// Whether a following ray can be worth its while, of these lobes.
    #[must_use]
    pub fn has(&self, lobes: Lobes) -> bool {
        match &self.kind {
            Kind::Classic(classic) => classic.has(lobes),
            Kind::Layered(layered) => layered.has(lobes),
        }
    }

    /// Both about light from `wi`; the density is of sampling the smooth ones of `lobes`. Delta lobes give
    /// nothing.
    #[must_use]
    pub fn evaluate(&self, wi: Vec3, lobes: Lobes) -> Evaluated {
        // The true normal decides whether this is a reflection; the shading one has to agree.
        let above = self.side.dot(wi) > 0.0;
        match &self.kind {
            Kind::Classic(_) if !above => Evaluated::default(),
            Kind::Classic(classic) => classic.evaluate(wi, lobes),
            Kind::Layered(layered) => layered.evaluate(wi, above, lobes),
        }
    }

    /// The wide and the glossy part of f · |cos| for light from `wi`.
    #[must_use]
    pub fn eval(&self, wi: Vec3) -> [Vec3; 2] {
        let Evaluated { diffuse, glossy, .. } = self.evaluate(wi, Lobes::ALL);
        [diffuse, glossy]
    }

    /// Density in solid angle with which [`Bsdf::sample`] proposes `wi` by the smooth ones of `lobes`.
    #[must_use]
    pub fn pdf(&self, wi: Vec3, lobes: Lobes) -> f32 {
        self.evaluate(wi, lobes).pdf
    }

    /// Proposes a direction by one of `lobes`: `choice` picks the lobe, `u` the direction. `None` if the
    /// proposal carries nothing.
    #[must_use]
    pub fn sample(&self, choice: f32, u: Vec2, lobes: Lobes) -> Option<BsdfSample> {
        let proposal = match &self.kind {
            Kind::Classic(classic) => classic.sample(choice, u, lobes)?,
            Kind::Layered(layered) => layered.sample(choice, u, lobes)?,
        };
        let Proposal { wi, through, follow, delta } = proposal;
        // What by its shading normal would enter the surface, or not enter it, carries nothing.
        let side = if delta.is_some() { self.geometric_normal } else { self.side };
        if (side.dot(wi) < 0.0) != through {
            return None;
        }
        if let Some(weight) = delta {
            return Some(BsdfSample { wi, weight, pdf: None, follow });
        }
        let Evaluated { diffuse, glossy, pdf } = self.evaluate(wi, lobes);
        let value = diffuse * f32::from(u8::from(lobes.diffuse)) + glossy * f32::from(u8::from(lobes.glossy));
        (pdf > 0.0 && value != Vec3::ZERO).then(|| BsdfSample {
            wi,
            weight: value / pdf,
            pdf: Some(pdf),
            follow,
        })
    }
}

/// A direction that one of the lobes proposes.
struct Proposal {
    wi: Vec3,
    /// To the other side.
    through: bool,
    follow: bool,
    /// Its worth, if the lobe is no density.
    delta: Option<Vec3>,
}

impl Proposal {
    fn reflected(wi: Vec3) -> Self {
        Self { wi, through: false, follow: false, delta: None }
    }
}

/// `direction` mirrored at `normal`; both leave the surface.
fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (normal * (2.0 * normal.dot(direction)) - direction).normalize()
}

/// Which of `shares` the number `choice` falls into, and where in it, from 0 to 1.
fn pick(shares: &[f32], choice: f32) -> Option<(usize, f32)> {
    let mut rest = choice;
    for (i, &share) in shares.iter().enumerate() {
        if rest < share {
            return Some((i, (rest / share).min(1.0 - f32::EPSILON)));
        }
        rest -= share;
    }
    // Rounding may leave a crumb past the last share.
    shares.iter().rposition(|&share| share > 0.0).map(|last| (last, 1.0 - f32::EPSILON))
}
