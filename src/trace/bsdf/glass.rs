//! What lets light through: bodies that refract it, and panes so thin that it goes straight on.

use super::albedo::GIVEN_BACK;
use super::microfacet::{MIN_ALPHA, Microfacets, fresnel_dielectric, fresnel_pane};
use glam::{Vec2, Vec3};

/// A transmitting interface, in the frame of its normal, as seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct GlassLobe {
    facets: Microfacets,
    /// Share of the surface that it is.
    pub(super) weight: f32,
    /// Colour of what passes.
    tint: Vec3,
    kind: GlassKind,
    /// Makes up for light that meets a second facet.
    ///
    /// Reference: E. Turquin, "Practical multiple scattering compensation for microfacet models", 2019.
    gain: f32,
}

/// What is behind the interface.
#[derive(Clone, Copy, Debug)]
pub(super) enum GlassKind {
    /// Something of another index: that of the far side over that of the near one.
    Body { eta: f32 },
    /// A second interface, at once.
    Pane { ior: f32 },
}

impl GlassLobe {
    /// `passed`: what the single scattering of a white interface adds up to.
    pub(super) fn new(alpha: f32, weight: f32, tint: Vec3, kind: GlassKind, passed: f32) -> Self {
        let passed = passed.clamp(0.1, 1.0);
        let gain = if alpha <= MIN_ALPHA { 1.0 } else { 1.0 + GIVEN_BACK * (1.0 / passed - 1.0) };
        Self { facets: Microfacets::new(alpha), weight, tint, kind, gain }
    }

    /// Whether it is only ever sampled.
    pub(super) fn is_delta(&self) -> bool {
        // Between equal indices light goes straight on, however rough.
        let equal = matches!(self.kind, GlassKind::Body { eta } if (eta - 1.0).abs() < 1e-3);
        equal || self.facets.alpha.x <= MIN_ALPHA
    }

    fn reflectance(&self, cos: f32) -> f32 {
        match self.kind {
            GlassKind::Body { eta } => fresnel_dielectric(cos, eta).0,
            GlassKind::Pane { ior } => fresnel_pane(cos, ior),
        }
    }

    /// f · |cos| and the density of [`GlassLobe::sample`].
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        const NOTHING: (Vec3, f32) = (Vec3::ZERO, 0.0);
        if self.is_delta() || wi.z == 0.0 {
            return NOTHING;
        }
        let scale = self.weight * self.gain;
        let flipped = Vec3::new(wi.x, wi.y, wi.z.abs());
        match self.kind {
            GlassKind::Body { eta } if wi.z < 0.0 => {
                let Some(h) = (wo + wi * eta).try_normalize() else { return NOTHING };
                let h = if h.z < 0.0 { -h } else { h };
                let (o, i) = (wo.dot(h), wi.dot(h));
                if o <= 0.0 || i >= 0.0 {
                    return NOTHING;
                }
                let passes = 1.0 - fresnel_dielectric(o, eta).0;
                // Solid angle of h over that of wi. Radiance is not scaled by the square of the index: what
                // enters a body leaves it again.
                let stretch = eta * eta * -i / (o + eta * i).powi(2);
                let whole = self.facets.pdf(wo, h) * stretch * passes;
                (self.tint * (whole * self.facets.masking(wo, wi) * scale), whole)
            }
            _ => {
                let Some(h) = (wo + flipped).try_normalize() else { return NOTHING };
                let o = wo.dot(h);
                let reflectance = self.reflectance(o);
                let (share, color) =
                    if wi.z > 0.0 { (reflectance, Vec3::ONE) } else { (1.0 - reflectance, self.tint) };
                let whole = self.facets.pdf(wo, h) * share / (4.0 * o.max(1e-7));
                (color * (whole * self.facets.masking(wo, flipped) * scale), whole)
            }
        }
    }

    /// A direction, whether it is one through the interface, and what it is worth if that is smooth: by
    /// Fresnel's chance mirrored or let through.
    pub(super) fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<(Vec3, bool, Vec3)> {
        let h = if self.is_delta() { Vec3::Z } else { self.facets.sample(wo, u) };
        let o = wo.dot(h).clamp(0.0, 1.0);
        let mirrored = h * (2.0 * o) - wo;
        if choice < self.reflectance(o) {
            return (mirrored.z > 0.0).then_some((mirrored, false, Vec3::splat(self.weight)));
        }
        let through = match self.kind {
            GlassKind::Body { eta } => h * (o / eta - fresnel_dielectric(o, eta).1) - wo / eta,
            GlassKind::Pane { .. } => Vec3::new(mirrored.x, mirrored.y, -mirrored.z),
        };
        (through.z < 0.0).then_some((through, true, self.tint * self.weight))
    }
}
