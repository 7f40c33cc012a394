//! Metal and dielectric over Lambert: what facets reflect, what they lose, and what reaches the base below them.

use super::Evaluated;
use super::albedo::{GIVEN_BACK, Reflected};
use super::microfacet::{Microfacets, schlick};
use crate::scene::color::luminance;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Metal and opaque dielectric.
#[derive(Clone, Copy, Debug)]
pub(super) struct Base {
    pub(super) facets: Microfacets,
    /// Of the tables: that of the facets, or their mean.
    roughness: f32,
    f0: Vec3,
    f90: f32,
    /// Lambert's albedo over π, times what the interface lets through toward the eye over its mean.
    diffuse: Vec3,
    interface: Interface,
    /// Light that meets several facets, before the share of the other direction.
    multiple: Vec3,
    /// Of narrow lobes the reflection is scaled up instead: one over what comes back to the eye.
    gain: Option<f32>,
}

/// Where facets lose less than this on average, light that meets several of them leaves about where the
/// others do (at grazing angles), and a wide lobe for it would be all noise.
const NARROW: f32 = 2e-3;

/// What a dielectric's interface reflects in all.
#[derive(Clone, Copy, Debug, Default)]
struct Interface {
    f0: f32,
    f90: f32,
    /// Of what meets several facets; `None`: as at the first one.
    multiple: Option<f32>,
}

impl Interface {
    fn reflects(&self, part: Vec2) -> f32 {
        let (single, whole) = (part.dot(Vec2::new(self.f0, self.f90)), part.element_sum());
        let again = self.multiple.unwrap_or_else(|| (single / whole).powi(2));
        (single + again * (1.0 - whole)).min(1.0)
    }
}

/// Reflectance of light that meets two facets or more, given the table's mean.
///
/// Reference: C. Kulla, A. Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH 2017, and
/// S. Hill's correction of it, 2018.
fn multiple_reflectance(f0: Vec3, f90: f32, mean: Vec2) -> Vec3 {
    let whole = mean.element_sum().min(1.0);
    // Schlick's formula, weighted by the cosine over the hemisphere.
    let average = (f0 * 20.0 + f90) / 21.0;
    average * average * whole / (1.0 - average * (1.0 - whole))
}

impl Base {
    /// `scattering`: the share of opaque dielectric, with this reflectance at normal incidence and at the
    /// horizon.
    pub(super) fn new(
        wo: Vec3,
        facets: Microfacets,
        color: Vec3,
        metallic: f32,
        scattering: f32,
        dielectric_f0: Vec3,
        dielectric_f90: f32,
    ) -> Self {
        let table = Reflected::table();
        let roughness = mean_alpha(facets.alpha).sqrt();
        let (part, mean) = (table.at(wo.z, roughness), table.mean(roughness));
        let f0 = color * metallic + dielectric_f0 * scattering;
        let f90 = metallic + dielectric_f90 * scattering;
        let escaped = 1.0 - mean.element_sum();
        let wide = escaped > NARROW;
        // The strongest channel for all, so that a coloured reflection does not tint what lies below.
        let strongest = Vec3::splat(dielectric_f0.max_element());
        let interface = Interface {
            f0: strongest.x,
            f90: dielectric_f90,
            multiple: wide.then(|| multiple_reflectance(strongest, dielectric_f90, mean).x),
        };
        let passed = (1.0 - interface.reflects(part)) / (1.0 - interface.reflects(mean)).max(1e-3);
        let multiple = if wide {
            let by_metal = multiple_reflectance(color, 1.0, mean) * metallic;
            let reflectance =
                by_metal + multiple_reflectance(dielectric_f0, dielectric_f90, mean) * scattering;
            reflectance * (GIVEN_BACK * (1.0 - part.element_sum()).max(0.0) / (PI * escaped))
        } else {
            Vec3::ZERO
        };
        let gain = if wide { None } else { Some(1.0 / part.element_sum()) };
        let diffuse = color * (scattering * passed / PI);
        Self { facets, roughness, f0, f90, diffuse, interface, multiple, gain }
    }

    /// In wide lobes and in the facets'.
    pub(super) fn powers(&self, wo: Vec3) -> [f32; 2] {
        let table = Reflected::table();
        let (part, mean) = (table.at(wo.z, self.roughness), table.mean(self.roughness));
        let diffuse = luminance(self.diffuse) * PI * (1.0 - self.interface.reflects(mean));
        let multiple = luminance(self.multiple) * PI * (1.0 - mean.element_sum());
        let facets = luminance(self.f0) * part.x + self.f90 * part.y;
        [diffuse + multiple, facets]
    }

    /// Both in the facets' frame; `cos` is that of `wi` to the normal of the wide lobes.
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, cos: f32, shares: &[f32; 5]) -> Evaluated {
        let mut sum = Evaluated::default();
        let mut whole = 1.0;
        if cos > 0.0 {
            let part = Reflected::table().at(cos, self.roughness);
            whole = part.element_sum().min(1.0);
            let passed = 1.0 - self.interface.reflects(part);
            sum.pdf = shares[0] * cos / PI;
            sum.diffuse = (self.diffuse * passed + self.multiple * (1.0 - whole)) * cos;
        }
        if let Some(h) = (wo + wi).try_normalize().filter(|_| wi.z > 0.0) {
            if cos != wi.z && self.gain.is_some() {
                whole = Reflected::table().at(wi.z, self.roughness).element_sum().min(1.0);
            }
            let s = schlick(wo.dot(h));
            let mut fresnel = self.f0 * (1.0 - s) + self.f90 * s;
            if let Some(gain) = self.gain {
                // Turquin's factor, of both directions so that it is reciprocal.
                let again = (0.5 * (gain + 1.0 / whole) - 1.0).max(0.0);
                fresnel += fresnel * fresnel * (GIVEN_BACK * again);
            }
            sum.glossy = fresnel * (self.facets.distribution(h) * self.facets.visibility(wo, wi) * wi.z);
            sum.pdf += shares[1] * self.facets.pdf(wo, h) / (4.0 * wo.dot(h).max(1e-7));
        }
        sum
    }
}

/// The alpha of isotropic facets that send back about as much, and toward no direction less: found by trying,
/// from (0.3, 0.09) to (1, 0.001).
fn mean_alpha(alpha: Vec2) -> f32 {
    let likeness = alpha.min_element() / alpha.max_element();
    (0.5 * alpha.length_squared()).sqrt() * (0.7 + 0.3 * likeness.powi(3))
}
