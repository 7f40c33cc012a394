//! Trowbridge-Reitz (GGX) microfacets and Fresnel's reflectances, in the frame of the normal: Z is up.

use crate::trace::warp::spherical;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Below this GGX alpha a surface is a mirror: in f32 its peak would no longer be resolved.
pub(crate) const MIN_ALPHA: f32 = 1e-3;

/// A rough surface made of tiny mirrors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Microfacets {
    /// GGX alpha along X and Y, at least [`MIN_ALPHA`].
    pub(crate) alpha: Vec2,
}

impl Microfacets {
    pub(crate) fn new(alpha: f32) -> Self {
        Self { alpha: Vec2::splat(alpha.max(MIN_ALPHA)) }
    }

    /// Density of microfacets that face `h`, per projected area.
    pub(crate) fn distribution(&self, h: Vec3) -> f32 {
        // From x and y and not from the cosine: of a narrow peak 1 − z² would be all rounding.
        let slope = h.truncate() / self.alpha;
        let sum = slope.length_squared() + h.z * h.z;
        1.0 / (PI * self.alpha.x * self.alpha.y * sum * sum)
    }

    /// `w` with the surface squeezed until it is of roughness 1.
    fn squeezed(&self, w: Vec3) -> Vec3 {
        (w.truncate() * self.alpha).extend(w.z)
    }

    /// Height-correlated Smith G over 4 |z z'|; also for directions of opposite sides.
    pub(crate) fn visibility(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (wo.z.abs(), wi.z.abs());
        0.5 / (i * self.squeezed(wo).length() + o * self.squeezed(wi).length())
    }

    /// G over Smith's G1 of `wo`: the weight of a sampled visible normal.
    pub(crate) fn masking(&self, wo: Vec3, wi: Vec3) -> f32 {
        2.0 * wi.z.abs() * self.visibility(wo, wi) * (wo.z.abs() + self.squeezed(wo).length())
    }

    /// Density with which [`Microfacets::sample`] gives `h`.
    pub(crate) fn pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        self.distribution(h) * 2.0 * wo.dot(h).max(0.0) / (wo.z + self.squeezed(wo).length())
    }

    /// A normal that is visible from `wo`, whose z is positive.
    ///
    /// Reference: J. Dupuy, A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.
    pub(crate) fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let squeezed = self.squeezed(wo).normalize();
        let z = (1.0 - u.x) * (1.0 + squeezed.z) - squeezed.z;
        let h = spherical(z.clamp(-1.0, 1.0), u.y) + squeezed;
        self.squeezed(h.truncate().extend(h.z.max(0.0))).normalize_or(Vec3::Z)
    }
}

/// (1 − cos)⁵: how far Schlick's reflectance is on its way from F0 to F90.
pub(crate) fn schlick(cos: f32) -> f32 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Reflectance of a dielectric, unpolarised, and the cosine of the refracted direction; `eta` is the index
/// of the far side over that of the near one.
pub(crate) fn fresnel_dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Both surfaces of a thin pane together, with all the light that goes to and fro in between.
pub(crate) fn fresnel_pane(cos: f32, ior: f32) -> f32 {
    let (once, _) = fresnel_dielectric(cos, ior);
    2.0 * once / (1.0 + once)
}

/// Reflectance at normal incidence.
pub(crate) fn normal_reflectance(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}
