//! Lights as shading needs them: sampling, densities, and the shapes that rays can hit.
//!
//! All in render space. References: M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering",
//! 4th ed., chapter 12 (area, cone and disc sampling).

use super::surface::offset;
use crate::bvh::{Aabb, Ray};
use crate::scene::Emission;
use crate::scene::color::luminance;
use glam::{DVec3, Vec2, Vec3};
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
        /// Cosine of the half angle of full intensity.
        cos_inner: f32,
        /// Cosine of the half angle of darkness, below `cos_inner`.
        cos_outer: f32,
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
    /// Everywhere beyond the scene.
    Environment {
        /// Radiance, W/(m² sr).
        radiance: Vec3,
    },
}

/// A solid area light.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeLight {
    /// Its form.
    pub shape: Shape,
    /// Radiance, W/(m² sr), at the corners −u−v, +u−v, −u+v, +u+v of a parallelogram; elsewhere all the same.
    pub radiance: [Vec3; 4],
    /// Emits to both sides.
    pub two_sided: bool,
    /// Seen by rays, and stops them.
    pub visible: bool,
}

/// Forms of area lights.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// `corner` + a `u` + b `v`, a and b in 0..=1; the front is the side of u × v.
    Parallelogram {
        /// Where a and b are 0.
        corner: Vec3,
        /// Whole first edge.
        u: Vec3,
        /// Whole second edge.
        v: Vec3,
    },
    /// A flat round plate.
    Disk {
        /// Its middle.
        center: Vec3,
        /// Unit normal of the front.
        normal: Vec3,
        /// Its radius, above 0.
        radius: f32,
    },
    /// A ball that emits outward and inward.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Its radius, above 0.
        radius: f32,
    },
}

/// Triangles of an emissive instance, chosen in proportion to their emitted power.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshLight {
    /// Index of the instance.
    pub instance: u32,
    /// Triangle numbers in the mesh.
    pub triangles: Vec<u32>,
    /// Corners in render space, beside `triangles`.
    pub corners: Vec<[Vec3; 3]>,
    /// Cumulative probability, beside `triangles`; the last is 1.
    pub cumulative: Vec<f32>,
    /// Emits on the back too.
    pub two_sided: bool,
    /// The placement mirrors: the front is where `corners` run clockwise.
    pub mirrored: bool,
    /// Luminance of the radiant exitance summed over the area, W.
    pub power: f32,
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
    fn new(wi: Vec3, target: Option<Vec3>, radiance: Vec3, pdf: Option<f32>) -> Self {
        Self { wi, target, radiance, pdf, triangle: None, uv: Vec2::ZERO }
    }
}

impl FlatLight {
    /// A direction toward the light from `point` with unit normal `normal`. `None` where it is dark.
    #[must_use]
    pub fn sample(&self, point: Vec3, normal: Vec3, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Point { position, intensity } => {
                let (wi, distance2) = direction(point, *position)?;
                Some(LightSample::new(wi, Some(*position), *intensity / distance2, None))
            }
            Self::Spot { position, axis, intensity, cos_inner, cos_outer } => {
                let (wi, distance2) = direction(point, *position)?;
                let ramp = (axis.dot(-wi) - cos_outer) / (cos_inner - cos_outer).max(1e-6);
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
                // Uniform by length: density 1 / length; a line has no cosine and no area of its own.
                let position = from.lerp(*to, u.x);
                let (wi, distance2) = direction(point, position)?;
                let along = *to - *from;
                let length = along.length();
                let sine = match emission {
                    Emission::Isotropic => 1.0,
                    Emission::Sine => along.cross(wi).length() / length,
                };
                let strength = strength[0].lerp(strength[1], u.x);
                Some(LightSample::new(wi, Some(position), strength * (sine * length / distance2), None))
            }
            Self::Shape(light) => light.sample(point, u),
            Self::Mesh(light) => light.sample(point, u),
            Self::Environment { radiance } => {
                let local = super::bsdf::cosine_hemisphere(u);
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
            Self::Environment { radiance } => Some((*radiance, normal.dot(wi).max(0.0) / PI)),
            Self::Directional { axis, irradiance, sin2_radius } if *sin2_radius > 0.0 => {
                let inside = axis.cross(wi).length_squared() <= *sin2_radius && axis.dot(wi) < 0.0;
                inside.then(|| (*irradiance / (PI * sin2_radius), cone_pdf(*sin2_radius)))
            }
            _ => None,
        }
    }

    /// A rough measure of emitted power (luminance of flux), to choose among many lights.
    #[must_use]
    pub fn power(&self, scene_radius: f32) -> f32 {
        let disc = PI * scene_radius * scene_radius;
        match self {
            Self::Point { intensity, .. } => 4.0 * PI * luminance(*intensity),
            Self::Spot { intensity, cos_outer, .. } => 2.0 * PI * (1.0 - cos_outer) * luminance(*intensity),
            Self::Directional { irradiance, .. } => disc * luminance(*irradiance),
            Self::Segment { from, to, strength, .. } => {
                PI * PI * from.distance(*to) * luminance((strength[0] + strength[1]) * 0.5)
            }
            Self::Shape(light) => {
                let mean = light.radiance.iter().sum::<Vec3>() * 0.25;
                PI * light.shape.area() * luminance(mean)
            }
            Self::Mesh(light) => light.power,
            Self::Environment { radiance } => PI * disc * luminance(*radiance),
        }
    }
}

impl ShapeLight {
    fn sample(&self, point: Vec3, u: Vec2) -> Option<LightSample> {
        match &self.shape {
            Shape::Parallelogram { corner, u: edge_u, v: edge_v } => {
                let position = *corner + *edge_u * u.x + *edge_v * u.y;
                let cross = edge_u.cross(*edge_v);
                let area = cross.length();
                let radiance = self.radiance_at(u);
                sample_flat(point, position, cross / area, area, self.two_sided, radiance)
            }
            Shape::Disk { center, normal, radius } => {
                let (tangent, bitangent) = normal.any_orthonormal_pair();
                let (y, x) = (2.0 * PI * u.y).sin_cos();
                let position = *center + (tangent * x + bitangent * y) * (radius * u.x.sqrt());
                let area = PI * radius * radius;
                sample_flat(point, position, *normal, area, self.two_sided, self.radiance[0])
            }
            Shape::Sphere { center, radius } => {
                let to_center = *center - point;
                let distance2 = to_center.length_squared();
                let sin2 = radius * radius / distance2;
                // Also at the very centre, where `sin2` is infinite.
                if sin2 >= 1.0 {
                    // Inside: every direction sees it.
                    let wi = uniform_sphere(u);
                    let t = sphere_roots(point, wi, *center, *radius)?.1;
                    let target = Some(point + wi * t * (1.0 - 1e-6));
                    return Some(LightSample::new(wi, target, self.radiance[0], Some(0.25 / PI)));
                }
                let wi = cone(to_center / distance2.sqrt(), sin2, u);
                // The near side; beyond the silhouette by rounding, the point nearest to the centre.
                let along = to_center.dot(wi);
                let depth2 = (radius * radius - (distance2 - along * along)).max(0.0);
                let position = point + wi * (along - depth2.sqrt());
                let outward = (position - *center).try_normalize()?;
                let target = offset(position, error_of(position), outward);
                Some(LightSample::new(wi, Some(target), self.radiance[0], Some(cone_pdf(sin2))))
            }
        }
    }

    /// Density in solid angle of [`ShapeLight::sample`] for a ray from `origin` that hits at `hit`.
    fn pdf(&self, ray: &Ray, hit: &ShapeHit) -> f32 {
        match &self.shape {
            Shape::Sphere { center, radius } => {
                let sin2 = radius * radius / center.distance_squared(ray.origin);
                if sin2 < 1.0 { cone_pdf(sin2) } else { 0.25 / PI }
            }
            flat => {
                let distance2 = (hit.t * ray.direction.length()).powi(2);
                let cos = flat.normal().dot(ray.direction.normalize()).abs();
                distance2 / (flat.area() * cos)
            }
        }
    }

    /// Where `ray` meets it; solid on both sides, whether it shines there or not.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<ShapeHit> {
        let hit = match &self.shape {
            Shape::Parallelogram { corner, u, v } => {
                let (u64, v64) = (u.as_dvec3(), v.as_dvec3());
                let normal = u64.cross(v64);
                let (t, p) = plane_hit(ray, *corner, normal)?;
                let p = p - corner.as_dvec3();
                let inverse = 1.0 / normal.length_squared();
                let a = p.cross(v64).dot(normal) * inverse;
                let b = u64.cross(p).dot(normal) * inverse;
                let inside = (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
                inside.then_some(ShapeHit { t, uv: Vec2::new(a as f32, b as f32) })
            }
            Shape::Disk { center, normal, radius } => {
                let (t, p) = plane_hit(ray, *center, normal.as_dvec3())?;
                let inside = p.distance_squared(center.as_dvec3()) <= f64::from(*radius).powi(2);
                inside.then_some(ShapeHit { t, uv: Vec2::ZERO })
            }
            Shape::Sphere { center, radius } => {
                let (near, far) = sphere_roots(ray.origin, ray.direction, *center, *radius)?;
                let t = if near > 0.0 { near } else { far };
                Some(ShapeHit { t, uv: Vec2::ZERO })
            }
        };
        hit.filter(|h| h.t > 0.0 && h.t <= ray.t_max)
    }

    /// Emitted radiance back along a ray that hit here, and the density of sampling its direction.
    #[must_use]
    pub fn emitted(&self, ray: &Ray, hit: &ShapeHit) -> (Vec3, f32) {
        let shines = match &self.shape {
            Shape::Sphere { .. } => true,
            flat => self.two_sided || flat.normal().dot(ray.direction) < 0.0,
        };
        let radiance = if shines { self.radiance_at(hit.uv) } else { Vec3::ZERO };
        (radiance, self.pdf(ray, hit))
    }

    fn radiance_at(&self, uv: Vec2) -> Vec3 {
        let [a, b, c, d] = self.radiance;
        a.lerp(b, uv.x).lerp(c.lerp(d, uv.x), uv.y)
    }
}

/// Where a ray meets a light's shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter.
    pub t: f32,
    /// Coordinates on a parallelogram in 0..=1; zero elsewhere.
    pub uv: Vec2,
}

impl Shape {
    /// Area of one side.
    #[must_use]
    pub fn area(&self) -> f32 {
        match self {
            Self::Parallelogram { u, v, .. } => u.cross(*v).length(),
            Self::Disk { radius, .. } => PI * radius * radius,
            Self::Sphere { radius, .. } => 4.0 * PI * radius * radius,
        }
    }

    /// The box around it.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Parallelogram { corner, u, v } => {
                Aabb::around(&[*corner, *corner + *u, *corner + *v, *corner + *u + *v])
            }
            Self::Disk { center, radius, .. } | Self::Sphere { center, radius } => {
                Aabb { min: *center - *radius, max: *center + *radius }
            }
        }
    }

    fn normal(&self) -> Vec3 {
        match self {
            Self::Parallelogram { u, v, .. } => u.cross(*v).normalize_or(Vec3::Z),
            Self::Disk { normal, .. } => *normal,
            Self::Sphere { .. } => Vec3::ZERO,
        }
    }
}

impl MeshLight {
    fn sample(&self, point: Vec3, u: Vec2) -> Option<LightSample> {
        let i = self.cumulative.partition_point(|&c| c <= u.x).min(self.cumulative.len() - 1);
        let below = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        let share = self.cumulative[i] - below;
        // What is left of u.x within this triangle's share is a fresh number.
        let s = ((u.x - below) / share).clamp(0.0, 1.0).sqrt();
        let (b1, b2) = (s * (1.0 - u.y), s * u.y);
        let [a, b, c] = self.corners[i];
        let position = a * (1.0 - b1 - b2) + b * b1 + c * b2;
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()? * if self.mirrored { -1.0 } else { 1.0 };
        let area = 0.5 * cross.length() / share;
        let sample = sample_flat(point, position, normal, area, self.two_sided, Vec3::ONE)?;
        Some(LightSample {
            triangle: Some((self.instance, self.triangles[i])),
            uv: Vec2::new(b1, b2),
            ..sample
        })
    }

    /// Density in solid angle of sampling `triangle` at this distance and cosine at the light.
    #[must_use]
    pub fn pdf(&self, triangle: u32, distance2: f32, cos: f32) -> f32 {
        let Ok(i) = self.triangles.binary_search(&triangle) else { return 0.0 };
        let share = self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        share * distance2 / (triangle_area(&self.corners[i]) * cos.max(1e-9))
    }
}

/// Area of a triangle.
#[must_use]
pub fn triangle_area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

fn direction(from: Vec3, to: Vec3) -> Option<(Vec3, f32)> {
    let along = to - from;
    let distance2 = along.length_squared();
    (distance2 > 0.0).then(|| (along / distance2.sqrt(), distance2))
}

/// A sample, uniform by area, on a flat light of this whole `area`.
fn sample_flat(
    point: Vec3,
    position: Vec3,
    normal: Vec3,
    area: f32,
    two_sided: bool,
    radiance: Vec3,
) -> Option<LightSample> {
    let (wi, distance2) = direction(point, position)?;
    let cos = -normal.dot(wi);
    if !(cos > 0.0 || two_sided && cos < 0.0) {
        return None;
    }
    let facing = if cos > 0.0 { normal } else { -normal };
    let target = offset(position, error_of(position), facing);
    Some(LightSample::new(wi, Some(target), radiance, Some(distance2 / (area * cos.abs()))))
}

/// Bound on the rounding error of a point computed on a light.
fn error_of(position: Vec3) -> Vec3 {
    position.abs() * (8.0 / (1 << 24) as f32)
}

fn plane_hit(ray: &Ray, through: Vec3, normal: DVec3) -> Option<(f32, DVec3)> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let slope = direction.dot(normal);
    let t = (through.as_dvec3() - origin).dot(normal) / slope;
    // Also false for NaN: a ray in the plane.
    (t > 0.0 && t.is_finite()).then(|| (t as f32, origin + direction * t))
}

/// Both parameters at which the line meets the sphere, in order, in double precision.
fn sphere_roots(origin: Vec3, direction: Vec3, center: Vec3, radius: f32) -> Option<(f32, f32)> {
    let (d, c) = (direction.as_dvec3(), origin.as_dvec3() - center.as_dvec3());
    let a = d.length_squared();
    let half_b = d.dot(c);
    let discriminant = f64::from(radius).powi(2) - (c - d * (half_b / a)).length_squared();
    if discriminant < 0.0 {
        return None;
    }
    let half_chord = (discriminant / a).sqrt();
    Some(((-half_b / a - half_chord) as f32, (-half_b / a + half_chord) as f32))
}

/// Uniform in the cone around unit `axis` with this squared sine of its half angle.
fn cone(axis: Vec3, sin2_max: f32, u: Vec2) -> Vec3 {
    // 1 − cos θ without cancellation, also for a cone of microradians.
    let one_minus_cos = one_minus_cos(sin2_max) * u.x;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let (y, x) = (2.0 * PI * u.y).sin_cos();
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    ((tangent * x + bitangent * y) * sin + axis * (1.0 - one_minus_cos)).normalize()
}

fn cone_pdf(sin2_max: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos(sin2_max))
}

fn one_minus_cos(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (y, x) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * x, r * y, z)
}
