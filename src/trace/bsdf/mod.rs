//! How a surface scatters light at one point: a sum of lobes.
//!
//! Directions leave the surface: `wo` to the eye, `wi` to the light, both of unit length.

pub mod normal;

use super::TraceScene;
use super::scene::Surface;
use super::surface::Interaction;
use super::warp::{cosine_hemisphere, spherical};
use crate::scene::color::luminance;
use crate::scene::{Glass, Glossy};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// The lobes of one surface point.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    normal: Vec3,
    geometric_normal: Vec3,
    /// Albedo of the Lambert lobe.
    diffuse: Vec3,
    glossy: Lobe,
    mirror: Vec3,
    glass: Option<Glass>,
    entering: bool,
}

#[derive(Clone, Copy, Debug)]
enum Lobe {
    None,
    BlinnPhong { specular: Vec3, exponent: f32 },
    Ggx { f0: Vec3, alpha: f32 },
}

/// Which lobes a question is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobes {
    /// Lambert.
    pub diffuse: bool,
    /// Blinn-Phong or GGX.
    pub glossy: bool,
    /// Mirror and glass: only ever sampled.
    pub delta: bool,
}

impl Lobes {
    /// All of them.
    pub const ALL: Self = Self { diffuse: true, glossy: true, delta: true };
    /// All but Lambert: what direct lighting follows.
    pub const SPECULAR: Self = Self { diffuse: false, glossy: true, delta: true };
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
}

/// Below this GGX alpha a surface is a mirror: in f32 its peak would no longer be resolved.
const MIN_ALPHA: f32 = 1e-3;

impl Bsdf {
    /// The lobes of `surface` at `at`.
    #[must_use]
    pub fn new(scene: &TraceScene, surface: &Surface, at: &Interaction) -> Self {
        let material = &surface.material;
        let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
        let base = material.base_color * texel.truncate();
        let mut normal = match &surface.normal_map {
            Some(map) => normal::tilted(scene, map, at),
            None => at.normal,
        };
        let mirrors = !matches!(material.glossy, Glossy::None)
            || surface.normal_map.is_some()
            || material.mirror != Vec3::ZERO
            || material.glass.is_some();
        // Lambert looks the same from everywhere: there it is enough that the normal is seen at all.
        normal = if mirrors { normal::clear_of_surface(normal, at) } else { normal::facing(normal, at) };
        let mut bsdf = Self {
            normal,
            geometric_normal: at.geometric_normal,
            diffuse: base,
            glossy: Lobe::None,
            mirror: material.mirror,
            glass: material.glass,
            entering: at.front,
        };
        match &material.glossy {
            Glossy::None => {}
            Glossy::BlinnPhong { specular, exponent } => {
                bsdf.glossy = Lobe::BlinnPhong { specular: *specular, exponent: *exponent };
            }
            Glossy::Ggx { metallic, roughness, .. } => {
                let texel = scene.texture(surface.glossy_texture, at.uvs);
                let (metallic, roughness) = (metallic * texel.z, roughness * texel.y);
                let f0 = Vec3::splat(0.04).lerp(base, metallic);
                bsdf.diffuse = base * (1.0 - metallic);
                let alpha = roughness * roughness;
                bsdf.glossy = Lobe::Ggx { f0, alpha: alpha.max(MIN_ALPHA) };
            }
        }
        bsdf
    }

    /// Unit shading normal, on the side of the eye.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Whether light from a chosen direction can be reflected at all.
    #[must_use]
    pub fn has_smooth_lobes(&self) -> bool {
        self.diffuse != Vec3::ZERO || !matches!(self.glossy, Lobe::None)
    }

    /// Whether a following ray can be worth its while, of these lobes.
    #[must_use]
    pub fn has(&self, lobes: Lobes) -> bool {
        lobes.diffuse && self.diffuse != Vec3::ZERO
            || lobes.glossy && !matches!(self.glossy, Lobe::None)
            || lobes.delta && (self.mirror != Vec3::ZERO || self.glass.is_some())
    }

    /// The Lambert and the glossy part of f · |cos| for light from `wi`; delta lobes give nothing.
    #[must_use]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> [Vec3; 2] {
        let n_dot_l = self.normal.dot(wi);
        let n_dot_v = self.normal.dot(wo);
        // Both the shading and the true normal must agree that this is a reflection.
        if n_dot_l <= 0.0 || n_dot_v <= 0.0 || self.geometric_normal.dot(wi) <= 0.0 {
            return [Vec3::ZERO; 2];
        }
        let lambert = self.diffuse * (n_dot_l / PI);
        if matches!(self.glossy, Lobe::None) {
            return [lambert, Vec3::ZERO];
        }
        let Some(h) = (wo + wi).try_normalize() else { return [lambert, Vec3::ZERO] };
        let n_dot_h = self.normal.dot(h).max(0.0);
        let v_dot_h = wo.dot(h).clamp(0.0, 1.0);
        match self.glossy {
            Lobe::None => [lambert, Vec3::ZERO],
            Lobe::BlinnPhong { specular, exponent } => {
                let scale = phong_normalization(exponent) * n_dot_h.powf(exponent);
                [lambert, specular * (scale * n_dot_l)]
            }
            Lobe::Ggx { f0, alpha } => {
                let fresnel = schlick(f0, v_dot_h);
                let d = ggx_distribution(self.normal.cross(h).length_squared(), alpha);
                let visibility = smith_visibility(n_dot_l, n_dot_v, alpha);
                // A dielectric's interface takes its share from what reaches the diffuse base. glTF weighs
                // by the cosine to the half vector, which at grazing angles sends back up to 1.7 times
                // the light; by the flatter of the two directions it is reciprocal and gains nothing.
                let passed = 1.0 - schlick(Vec3::splat(0.04), n_dot_l.min(n_dot_v)).x;
                [lambert * passed, fresnel * (d * visibility * n_dot_l)]
            }
        }
    }

    /// Density in solid angle with which [`Bsdf::sample`] proposes `wi` by the smooth ones of `lobes`.
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, lobes: Lobes) -> f32 {
        let n_dot_l = self.normal.dot(wi);
        let n_dot_v = self.normal.dot(wo);
        if n_dot_l <= 0.0 || n_dot_v <= 0.0 || !self.has(lobes) {
            return 0.0;
        }
        let shares = self.shares(wo, lobes);
        let mut pdf = shares[0] * n_dot_l / PI;
        if shares[1] > 0.0
            && let Some(h) = (wo + wi).try_normalize()
        {
            let n_dot_h = self.normal.dot(h).max(0.0);
            let v_dot_h = wo.dot(h).max(1e-7);
            pdf += shares[1]
                * match self.glossy {
                    Lobe::None => 0.0,
                    Lobe::BlinnPhong { exponent, .. } => {
                        (exponent + 1.0) / (2.0 * PI) * n_dot_h.powf(exponent) / (4.0 * v_dot_h)
                    }
                    Lobe::Ggx { alpha, .. } => {
                        // Visible normals: D · G1 / (4 n·v).
                        let sin2 = self.normal.cross(h).length_squared();
                        ggx_distribution(sin2, alpha) * smith_g1(n_dot_v, alpha) / (4.0 * n_dot_v)
                    }
                };
        }
        pdf
    }

    /// Proposes a direction by one of `lobes`: `choice` picks the lobe, `u` the direction. `None` if the
    /// proposal carries nothing.
    #[must_use]
    pub fn sample(&self, wo: Vec3, choice: f32, u: Vec2, lobes: Lobes) -> Option<BsdfSample> {
        let shares = self.shares(wo, lobes);
        let mut rest = choice;
        let lobe = shares.iter().position(|&share| {
            let taken = rest < share;
            rest -= share;
            taken
        });
        // Rounding may leave a crumb past the last share.
        let lobe = lobe.or_else(|| shares.iter().rposition(|&share| share > 0.0))?;
        let wi = match lobe {
            0 => self.world(cosine_hemisphere(u)),
            1 => self.sample_glossy(wo, u)?,
            2 => {
                let wi = reflect(wo, self.normal);
                let valid = self.geometric_normal.dot(wi) > 0.0;
                return valid.then_some(BsdfSample { wi, weight: self.mirror / shares[2], pdf: None });
            }
            _ => return self.sample_glass(wo, u.x, shares[3]),
        };
        let pdf = self.pdf(wo, wi, lobes);
        let [diffuse, glossy] = self.eval(wo, wi);
        let value = diffuse * f32::from(u8::from(lobes.diffuse)) + glossy * f32::from(u8::from(lobes.glossy));
        (pdf > 0.0 && value != Vec3::ZERO).then(|| BsdfSample { wi, weight: value / pdf, pdf: Some(pdf) })
    }

    /// Probabilities of diffuse, glossy, mirror and glass; they sum to 1 or are all 0.
    fn shares(&self, wo: Vec3, lobes: Lobes) -> [f32; 4] {
        let glossy = match self.glossy {
            Lobe::None => 0.0,
            Lobe::BlinnPhong { specular, .. } => luminance(specular),
            Lobe::Ggx { f0, .. } => luminance(schlick(f0, self.normal.dot(wo).clamp(0.0, 1.0))),
        };
        let mut shares = [
            if lobes.diffuse { luminance(self.diffuse) } else { 0.0 },
            if lobes.glossy { glossy } else { 0.0 },
            if lobes.delta { luminance(self.mirror) } else { 0.0 },
            if lobes.delta && self.glass.is_some() { 1.0 } else { 0.0 },
        ];
        let sum: f32 = shares.iter().sum();
        if sum > 0.0 {
            shares = shares.map(|s| s / sum);
        }
        shares
    }

    fn sample_glossy(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let h = match self.glossy {
            Lobe::None => return None,
            Lobe::BlinnPhong { exponent, .. } => {
                let cos = u.x.powf(1.0 / (exponent + 1.0));
                self.world(spherical(cos, u.y))
            }
            Lobe::Ggx { alpha, .. } => self.world(visible_normal(self.local(wo), alpha, u)),
        };
        Some(reflect(wo, h))
    }

    /// Fresnel-weighted choice between reflection and refraction at a smooth dielectric.
    fn sample_glass(&self, wo: Vec3, choice: f32, share: f32) -> Option<BsdfSample> {
        let glass = self.glass?;
        // Relative index of the far side over the near side.
        let eta = if self.entering { glass.ior } else { 1.0 / glass.ior };
        let cos_o = self.normal.dot(wo).clamp(0.0, 1.0);
        let (reflectance, cos_t) = fresnel_dielectric(cos_o, eta);
        if choice < reflectance {
            let wi = reflect(wo, self.normal);
            let valid = self.geometric_normal.dot(wi) > 0.0;
            return valid.then_some(BsdfSample { wi, weight: Vec3::ONE / share, pdf: None });
        }
        let wi = (self.normal * (cos_o / eta - cos_t) - wo / eta).try_normalize()?;
        let valid = self.geometric_normal.dot(wi) < 0.0;
        valid.then_some(BsdfSample { wi, weight: glass.tint / share, pdf: None })
    }

    fn world(&self, local: Vec3) -> Vec3 {
        let (tangent, bitangent) = self.normal.any_orthonormal_pair();
        (tangent * local.x + bitangent * local.y + self.normal * local.z).normalize()
    }

    fn local(&self, world: Vec3) -> Vec3 {
        let (tangent, bitangent) = self.normal.any_orthonormal_pair();
        Vec3::new(tangent.dot(world), bitangent.dot(world), self.normal.dot(world))
    }
}

/// `direction` mirrored at `normal`; both leave the surface.
fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (normal * (2.0 * normal.dot(direction)) - direction).normalize()
}

/// Factor that makes the Blinn-Phong lobe reflect its specular colour at normal incidence:
/// (n + 2)(n + 4) / (8 π (2^(−n/2) + n)), F. Giesen, "Derivation of Phong and Blinn-Phong normalization
/// factors", 2009.
fn phong_normalization(exponent: f32) -> f32 {
    (exponent + 2.0) * (exponent + 4.0) / (8.0 * PI * ((-0.5 * exponent).exp2() + exponent))
}

/// F = F0 + (1 − F0)(1 − cos)⁵.
fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    f0 + (1.0 - f0) * (1.0 - cos).powi(5)
}

/// Reflectance of a dielectric, unpolarised, and the cosine of the refracted direction.
fn fresnel_dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Trowbridge-Reitz (GGX) distribution of normals, from the squared sine to the surface's normal: from
/// the cosine a narrow peak would be wrong by percents, for 1 − cos² is all rounding there.
fn ggx_distribution(sin2: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let d = sin2 + (1.0 - sin2).max(0.0) * a2;
    a2 / (PI * d * d)
}

/// Height-correlated Smith G over 4 (n·l)(n·v).
fn smith_visibility(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let v = n_dot_l * (n_dot_v * n_dot_v * (1.0 - a2) + a2).sqrt();
    let l = n_dot_v * (n_dot_l * n_dot_l * (1.0 - a2) + a2).sqrt();
    0.5 / (v + l)
}

fn smith_g1(n_dot_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    2.0 * n_dot_v / (n_dot_v + (n_dot_v * n_dot_v * (1.0 - a2) + a2).sqrt())
}

/// A GGX normal visible from `wo`, in the frame of the normal.
///
/// Reference: J. Dupuy, A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.
fn visible_normal(wo: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let stretched = Vec3::new(wo.x * alpha, wo.y * alpha, wo.z).normalize();
    let z = (1.0 - u.x) * (1.0 + stretched.z) - stretched.z;
    let h = spherical(z.clamp(-1.0, 1.0), u.y) + stretched;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
}
