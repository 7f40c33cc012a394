//! The materials of MTL libraries and settings files: Lambert, Blinn-Phong, perfect mirrors and clear glass.

use super::microfacet::fresnel_dielectric;
use super::{Evaluated, Lobes, Proposal, pick, reflect};
use crate::scene::Glass;
use crate::scene::color::luminance;
use crate::trace::warp::{cosine_hemisphere, spherical};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A sum of lobes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Classic {
    /// Of all lobes but Lambert's: it mirrors the eye away from the surface.
    pub(super) normal: Vec3,
    /// Of Lambert's.
    pub(super) wide: Vec3,
    pub(super) wo: Vec3,
    /// Albedo of the Lambert lobe.
    pub(super) diffuse: Vec3,
    /// Specular colour and exponent of the Blinn-Phong lobe.
    pub(super) phong: Option<(Vec3, f32)>,
    pub(super) mirror: Vec3,
    pub(super) glass: Option<Glass>,
    /// The eye is outside.
    pub(super) front: bool,
}

impl Classic {
    pub(super) fn has(&self, lobes: Lobes) -> bool {
        lobes.diffuse && self.diffuse != Vec3::ZERO
            || lobes.glossy && self.phong.is_some()
            || lobes.delta && (self.mirror != Vec3::ZERO || self.glass.is_some())
    }

    /// For `wi` on the eye's side of the surface.
    #[inline]
    pub(super) fn eval(&self, wi: Vec3) -> [Vec3; 2] {
        let lambert = self.diffuse * (self.wide.dot(wi).max(0.0) / PI);
        let n_dot_l = self.normal.dot(wi);
        let Some((specular, exponent)) = self.phong else { return [lambert, Vec3::ZERO] };
        if n_dot_l <= 0.0 || self.normal.dot(self.wo) <= 0.0 {
            return [lambert, Vec3::ZERO];
        }
        let Some(h) = (self.wo + wi).try_normalize() else { return [lambert, Vec3::ZERO] };
        let scale = phong_normalization(exponent) * self.normal.dot(h).max(0.0).powf(exponent);
        [lambert, specular * (scale * n_dot_l)]
    }

    #[inline]
    pub(super) fn pdf(&self, wi: Vec3, lobes: Lobes) -> f32 {
        if !self.has(lobes) {
            return 0.0;
        }
        let shares = self.shares(lobes);
        let mut pdf = shares[0] * self.wide.dot(wi).max(0.0) / PI;
        if shares[1] > 0.0
            && let Some((_, exponent)) = self.phong
            && let Some(h) = (self.wo + wi).try_normalize()
        {
            let facing = (exponent + 1.0) / (2.0 * PI) * self.normal.dot(h).max(0.0).powf(exponent);
            pdf += shares[1] * facing / (4.0 * self.wo.dot(h).max(1e-7));
        }
        pdf
    }

    #[inline]
    pub(super) fn evaluate(&self, wi: Vec3, lobes: Lobes) -> Evaluated {
        let [diffuse, glossy] = self.eval(wi);
        Evaluated { diffuse, glossy, pdf: self.pdf(wi, lobes) }
    }

    pub(super) fn sample(&self, choice: f32, u: Vec2, lobes: Lobes) -> Option<Proposal> {
        let shares = self.shares(lobes);
        let (lobe, _) = pick(&shares, choice)?;
        Some(match lobe {
            0 => Proposal::reflected(around(self.wide, cosine_hemisphere(u))),
            1 => {
                let (_, exponent) = self.phong?;
                let h = around(self.normal, spherical(u.x.powf(1.0 / (exponent + 1.0)), u.y));
                // Seen from behind it would be the other half of a pair that nobody counts.
                if self.wo.dot(h) <= 0.0 {
                    return None;
                }
                Proposal::reflected(reflect(self.wo, h))
            }
            2 => {
                let wi = reflect(self.wo, self.normal);
                Proposal { follow: true, delta: Some(self.mirror / shares[2]), ..Proposal::reflected(wi) }
            }
            _ => self.sample_glass(u.x, shares[3])?,
        })
    }

    /// Probabilities of diffuse, glossy, mirror and glass; they sum to 1 or are all 0.
    fn shares(&self, lobes: Lobes) -> [f32; 4] {
        let mut shares = [
            if lobes.diffuse { luminance(self.diffuse) } else { 0.0 },
            if lobes.glossy { self.phong.map_or(0.0, |(specular, _)| luminance(specular)) } else { 0.0 },
            if lobes.delta { luminance(self.mirror) } else { 0.0 },
            if lobes.delta && self.glass.is_some() { 1.0 } else { 0.0 },
        ];
        let sum: f32 = shares.iter().sum();
        if sum > 0.0 {
            shares = shares.map(|s| s / sum);
        }
        shares
    }

    /// Fresnel-weighted choice between reflection and refraction at a smooth dielectric.
    fn sample_glass(&self, choice: f32, share: f32) -> Option<Proposal> {
        let glass = self.glass?;
        // Relative index of the far side over the near side.
        let eta = if self.front { glass.ior } else { 1.0 / glass.ior };
        let cos_o = self.normal.dot(self.wo).clamp(0.0, 1.0);
        let (reflectance, cos_t) = fresnel_dielectric(cos_o, eta);
        let through = choice >= reflectance;
        let (wi, weight) = if through {
            ((self.normal * (cos_o / eta - cos_t) - self.wo / eta).try_normalize()?, glass.tint)
        } else {
            (reflect(self.wo, self.normal), Vec3::ONE)
        };
        Some(Proposal { wi, through, follow: true, delta: Some(weight / share) })
    }
}

/// `local`, in a frame whose z is `normal`, in the world.
fn around(normal: Vec3, local: Vec3) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    (tangent * local.x + bitangent * local.y + normal * local.z).normalize()
}

/// Factor that makes the Blinn-Phong lobe reflect its specular colour at normal incidence:
/// (n + 2)(n + 4) / (8 π (2^(−n/2) + n)), F. Giesen, "Derivation of Phong and Blinn-Phong normalization
/// factors", 2009.
fn phong_normalization(exponent: f32) -> f32 {
    // The quotient first: squares of exponents overflow.
    (exponent + 2.0) / (8.0 * PI) * ((exponent + 4.0) / ((-0.5 * exponent).exp2() + exponent))
}
