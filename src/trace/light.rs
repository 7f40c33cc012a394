//! Lights as shading needs them: directions toward them, and with what density.
//!
//! All in render space. References: M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering",
//! 4th ed., chapter 12 (area, cone and disc sampling).

use super::emitter::{Emitter, Receiver};
use super::mesh_light::MeshLight;
use super::shape_light::ShapeLight;
use super::sky::SkyLight;
use super::warp::{cone, cone_pdf, cosine_hemisphere, offset};
use crate::bvh::Aabb;
use crate::scene::Emission;
use crate::scene::color::luminance;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A light in render space.
#[derive(Clone, Debug, PartialEq)]
pub enum FlatLight {
    /// The same to all sides.
    Point {
        /// Where it is.
        position: Vec3,
        /// Radiant intensity, W/sr.
        intensity: Vec3,
    },
    /// A cone around `axis`.
    Spot {
        /// Its tip.
        position: Vec3,
        /// Unit direction in which light leaves.
        axis: Vec3,
        /// Radiant intensity on the axis, W/sr.
        intensity: Vec3,
        /// One minus the cosine of the half angle of full intensity: of narrow ones the cosine itself has no digits.
        inner: f32,
        /// The same of the half angle of darkness.
        outer: f32,
    },
    /// A disc infinitely far away.
    Directional {
        /// Unit direction in which light travels.
        axis: Vec3,
        /// Irradiance on a surface facing it, W/m².
        irradiance: Vec3,
        /// Squared sine of the disc's angular radius; 0 for a point, which no ray can find.
        sin2_radius: f32,
    },
    /// A line.
    Segment {
        /// One end.
        from: Vec3,
        /// The other end.
        to: Vec3,
        /// Intensity per length at both ends, perpendicular to the line, W/(sr m).
        strength: [Vec3; 2],
        /// How it depends on the angle to the line.
        emission: Emission,
    },
    /// Anything flat or round that rays can hit.
    Shape(ShapeLight),
    /// Triangles of an emissive instance.
    Mesh(MeshLight),
    /// Everywhere beyond the scene, another in each direction.
    Sky(SkyLight),
    /// Everywhere beyond the scene.
    Environment {
        /// Radiance, W/(m² sr).
        radiance: Vec3,
    },
}

/// Light arriving at a point, before the shadow test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction toward the light.
    pub wi: Vec3,
    /// Where a shadow ray ends; `None` if it has no end.
    pub target: Option<Vec3>,
    /// Radiance; with `pdf` `None` the whole irradiance on a surface facing it.
    pub radiance: Vec3,
    /// Density in solid angle; `None` for a light that has no area.
    pub pdf: Option<f32>,
    /// (instance, triangle) of a mesh light, for its emission texture and as no occluder of itself.
    pub triangle: Option<(u32, u32)>,
    /// Barycentric weights of the triangle's second and third corner.
    pub uv: Vec2,
}

impl LightSample {
    pub(super) fn new(wi: Vec3, target: Option<Vec3>, radiance: Vec3, pdf: Option<f32>) -> Self {
        Self { wi, target, radiance, pdf, triangle: None, uv: Vec2::ZERO }
    }
}

impl FlatLight {
    /// Many triangles, among which a tree chooses.
    #[must_use]
    pub fn is_many(&self) -> bool {
        matches!(self, Self::Mesh(mesh) if mesh.is_many())
    }

    /// Whether it has more than one point to be sampled.
    #[must_use]
    pub fn has_extent(&self) -> bool {
        !matches!(self, Self::Point { .. } | Self::Spot { .. })
            && !matches!(self, Self::Directional { sin2_radius, .. } if *sin2_radius == 0.0)
    }

    /// A direction toward the light from `point` with unit normal `normal`. `None` where it is dark.
    #[must_use]
    pub fn sample(&self, point: Vec3, normal: Vec3, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Point { position, intensity } => {
                let (wi, distance2) = direction(point, *position)?;
                Some(LightSample::new(wi, Some(*position), *intensity / distance2, None))
            }
            Self::Spot { position, axis, intensity, inner, outer } => {
                let (wi, distance2) = direction(point, *position)?;
                let aside = 0.5 * (*axis + wi).length_squared();
                let ramp = (outer - aside) / (outer - inner).max(f32::MIN_POSITIVE);
                let share = ramp.clamp(0.0, 1.0).powi(2);
                (share > 0.0)
                    .then(|| LightSample::new(wi, Some(*position), *intensity * (share / distance2), None))
            }
            Self::Directional { axis, irradiance, sin2_radius } => {
                if *sin2_radius == 0.0 {
                    return Some(LightSample::new(-*axis, None, *irradiance, None));
                }
                let wi = cone(-*axis, *sin2_radius, u);
                let radiance = *irradiance / (PI * sin2_radius);
                Some(LightSample::new(wi, None, radiance, Some(cone_pdf(*sin2_radius))))
            }
            Self::Segment { from, to, strength, emission } => {
                let place = place_on_segment(point, [*from, *to], u.x)?;
                let position = from.lerp(*to, place.along);
                let (wi, _) = direction(point, position)?;
                let sine = match emission {
                    Emission::Isotropic => 1.0,
                    Emission::Sine => place.sine,
                };
                let strength = strength[0].lerp(strength[1], place.along);
                Some(LightSample::new(wi, Some(position), strength * (sine * place.weight), None))
            }
            Self::Shape(light) => light.sample(point, normal, u),
            Self::Mesh(light) => light.sample(&Receiver { point, normal }, u),
            Self::Sky(light) => light.sample(u),
            Self::Environment { radiance } => {
                let local = cosine_hemisphere(u);
                let (tangent, bitangent) = normal.any_orthonormal_pair();
                let wi = (tangent * local.x + bitangent * local.y + normal * local.z).normalize();
                (local.z > 0.0).then(|| LightSample::new(wi, None, *radiance, Some(local.z / PI)))
            }
        }
    }

    /// Radiance and density of [`FlatLight::sample`] for a ray that leaves the scene toward `wi`.
    #[must_use]
    pub fn beyond(&self, normal: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        match self {
            Self::Sky(light) => Some(light.toward(wi)),
            Self::Environment { radiance } => Some((*radiance, normal.dot(wi).max(0.0) / PI)),
            Self::Directional { axis, irradiance, sin2_radius } if *sin2_radius > 0.0 => {
                let inside = axis.cross(wi).length_squared() <= *sin2_radius && axis.dot(wi) < 0.0;
                inside.then(|| (*irradiance / (PI * sin2_radius), cone_pdf(*sin2_radius)))
            }
            _ => None,
        }
    }

    /// What a choice among many needs to know; `None` for a light beyond the scene.
    #[must_use]
    pub fn emitter(&self) -> Option<Emitter> {
        let (bounds, intensity) = match self {
            Self::Point { position, intensity } | Self::Spot { position, intensity, .. } => {
                (Aabb::around(&[*position]), luminance(*intensity))
            }
            Self::Segment { from, to, strength, .. } => {
                let mean = luminance((strength[0] + strength[1]) * 0.5);
                (Aabb::around(&[*from, *to]), mean * from.distance(*to))
            }
            Self::Shape(light) => return Some(light.emitter()),
            Self::Mesh(light) => return Some(light.emitter()),
            Self::Directional { .. } | Self::Sky(_) | Self::Environment { .. } => return None,
        };
        Some(Emitter::all_round(bounds, intensity))
    }
}

/// A place on a segment, as seen from a point.
struct SegmentPlace {
    /// Share of the way from its first end, 0 to 1.
    along: f32,
    /// Of the angle between it and the line of sight.
    sine: f32,
    /// 1 / (density by length · distance²): a line has no cosine and no area of its own.
    weight: f32,
}

/// Evenly by the angle under which the segment is seen from `point`, so that the distance does not matter, however near it is.
///
/// Reference: C. Kulla, M. Fajardo, "Importance Sampling Techniques for Path Tracing in Participating Media", EGSR 2012, 4.1
/// (equi-angular sampling).
fn place_on_segment(point: Vec3, ends: [Vec3; 2], u: f32) -> Option<SegmentPlace> {
    let [from, to] = ends.map(Vec3::as_dvec3);
    let axis = to - from;
    let length = axis.length();
    let unit = axis / length;
    let away = from - point.as_dvec3();
    let first = away.dot(unit);
    let height = (away - unit * first).length();
    if height <= 1e-9 * (length + first.abs()) {
        // In its own line it is seen as a point.
        let distance = first + f64::from(u) * length;
        let weight = (length / (distance * distance)) as f32;
        return weight.is_finite().then_some(SegmentPlace { along: u, sine: 0.0, weight });
    }
    let last = first + length;
    // Differences of arcs without cancellation, as seen from far away.
    let whole = (height * length).atan2(height * height + first * last);
    let turn = (first / height).atan() + f64::from(u) * whole;
    let place = height * turn.tan();
    let along = ((place - first) / length).clamp(0.0, 1.0);
    let sine = height / (height * height + place * place).sqrt();
    Some(SegmentPlace { along: along as f32, sine: sine as f32, weight: (whole / height) as f32 })
}

/// The unit direction and the squared distance between two points; `None` if they are one.
pub(super) fn direction(from: Vec3, to: Vec3) -> Option<(Vec3, f32)> {
    let along = to - from;
    let distance2 = along.length_squared();
    (distance2 > 0.0).then(|| (along / distance2.sqrt(), distance2))
}

/// A sample, uniform by area, on a flat light of this whole `area`.
pub(super) fn sample_flat(
    point: Vec3,
    position: Vec3,
    normal: Vec3,
    area: f32,
    two_sided: bool,
    radiance: Vec3,
) -> Option<LightSample> {
    let (wi, distance2) = direction(point, position)?;
    let cos = normal.dot(wi).abs();
    sample_at(point, position, normal, distance2 / (area * cos), two_sided, radiance)
}

/// A sample of this density in solid angle at a place of a flat light.
pub(super) fn sample_at(
    point: Vec3,
    position: Vec3,
    normal: Vec3,
    pdf: f32,
    two_sided: bool,
    radiance: Vec3,
) -> Option<LightSample> {
    let (wi, _) = direction(point, position)?;
    let cos = -normal.dot(wi);
    if !(cos > 0.0 || two_sided && cos < 0.0) {
        return None;
    }
    let facing = if cos > 0.0 { normal } else { -normal };
    let target = offset(position, error_of(position), facing);
    Some(LightSample::new(wi, Some(target), radiance, Some(pdf)))
}

/// Bound on the rounding error of a point computed on a light.
#[inline(always)]
pub(super) fn error_of(position: Vec3) -> Vec3 {
    position.abs() * (8.0 / (1 << 24) as f32)
}
