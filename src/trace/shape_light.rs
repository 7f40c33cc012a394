//! Area lights with a shape of their own: sampled like all lights, and solid to rays.

use super::emitter::Emitter;
use super::light::{LightSample, error_of, sample_at, sample_flat};
use super::light_sampling::LightSampling;
use super::quad::{Place, Quad};
use super::spherical::{SphericalQuad, meet, weights};
use super::warp::{cone, cone_pdf, offset, uniform_sphere};
use crate::bvh::{Aabb, Ray};
use crate::scene::color::luminance;
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::PI;

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
    /// How places on it are chosen.
    pub sampling: LightSampling,
    /// Of the front; zero if it is round.
    normal: Vec3,
    area: f32,
    /// Sum of the largest coordinates, without sign, that it has.
    reach: f32,
}

/// Forms of area lights.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// The front is the side of u × v.
    Parallelogram(Quad),
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

impl ShapeLight {
    /// Unit normal at a point of it.
    #[must_use]
    pub fn normal_at(&self, point: Vec3) -> Vec3 {
        match self.shape {
            Shape::Sphere { center, .. } => (point - center).normalize_or(Vec3::Z),
            _ => self.normal,
        }
    }

    /// See the fields.
    #[must_use]
    pub fn new(shape: Shape, radiance: [Vec3; 4], two_sided: bool, visible: bool) -> Self {
        let bounds = shape.bounds();
        let reach = bounds.min.abs().max(bounds.max.abs()).element_sum();
        let (normal, area) = (shape.normal(), shape.area());
        let sampling = LightSampling::BEST;
        Self { shape, radiance, two_sided, visible, sampling, normal, area, reach }
    }

    /// What a choice among many needs to know.
    pub(super) fn emitter(&self) -> Emitter {
        let mean = luminance(self.radiance.iter().sum::<Vec3>() * 0.25);
        let (bounds, intensity) = (self.shape.bounds(), mean * self.area);
        match &self.shape {
            // As large as it looks from anywhere.
            Shape::Sphere { .. } => Emitter::all_round(bounds, intensity * 0.25),
            _ => Emitter::flat(bounds, self.normal, self.two_sided, intensity),
        }
    }

    /// A direction toward it from `point` with `normal`; see [`super::light::FlatLight::sample`].
    pub(super) fn sample(&self, point: Vec3, normal: Vec3, u: Vec2) -> Option<LightSample> {
        match &self.shape {
            Shape::Parallelogram(quad) if self.sampling.solid_angle && quad.is_near(point) => {
                let seen = SphericalQuad::new(quad, point)?;
                let corners = quad.corners().map(Vec3::as_dvec3);
                let position = meet(&corners, point, seen.sample(u)?)?;
                let place = weights(corners[0], quad.u.as_dvec3(), quad.v.as_dvec3(), position);
                let (pdf, radiance) = ((1.0 / seen.solid_angle) as f32, self.radiance_at(place.into()));
                sample_at(point, position.as_vec3(), self.normal, pdf, self.two_sided, radiance)
            }
            Shape::Parallelogram(quad) => {
                let place = if self.sampling.product {
                    quad.brightness(point, normal).sample(u)
                } else {
                    Place::evenly(u)
                };
                // Also where a corner is at the very point.
                if place.density.is_nan() || place.density <= 0.0 {
                    return None;
                }
                let area = self.area / place.density;
                let radiance = self.radiance_at(Vec2::new(place.a, place.b));
                sample_flat(point, quad.at(&place), self.normal, area, self.two_sided, radiance)
            }
            Shape::Disk { center, normal, radius } => {
                let square = square_around(*center, *normal, *radius);
                if self.sampling.solid_angle && square.is_near(point) {
                    // Evenly by solid angle in the square around it; by area, what is right above would have no end of variance.
                    let seen = SphericalQuad::new(&square, point)?;
                    let position = meet(&square.corners().map(Vec3::as_dvec3), point, seen.sample(u)?)?;
                    let is_in = position.distance_squared(center.as_dvec3()) <= f64::from(*radius).powi(2);
                    let (place, pdf) = (position.as_vec3(), (1.0 / seen.solid_angle) as f32);
                    let sample = || sample_at(point, place, *normal, pdf, self.two_sided, self.radiance[0]);
                    return is_in.then(sample).flatten();
                }
                let (tangent, bitangent) = normal.any_orthonormal_pair();
                let (y, x) = (2.0 * PI * u.y).sin_cos();
                let position = *center + (tangent * x + bitangent * y) * (radius * u.x.sqrt());
                sample_flat(point, position, *normal, self.area, self.two_sided, self.radiance[0])
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
                if !self.sampling.solid_angle {
                    let outward = uniform_sphere(u);
                    let position = *center + outward * *radius;
                    return sample_flat(point, position, outward, self.area, false, self.radiance[0]);
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

    /// Density in solid angle of [`ShapeLight::sample`] for a ray that leaves a surface with `normal` and hits at `hit`.
    #[must_use]
    pub fn pdf(&self, ray: &Ray, normal: Vec3, hit: &ShapeHit) -> f32 {
        match &self.shape {
            Shape::Sphere { center, radius } => {
                let sin2 = radius * radius / center.distance_squared(ray.origin);
                match (sin2 < 1.0, self.sampling.solid_angle) {
                    (false, _) => 0.25 / PI,
                    (true, true) => cone_pdf(sin2),
                    (true, false) => {
                        let way = ray.direction * hit.t;
                        let outward = (ray.origin + way - *center).normalize_or_zero();
                        let cos = outward.dot(way.normalize_or_zero()).abs();
                        way.length_squared() / (self.area * cos)
                    }
                }
            }
            Shape::Parallelogram(quad) if self.sampling.solid_angle && quad.is_near(ray.origin) => {
                pdf_near(quad, ray.origin)
            }
            shape => {
                if let Shape::Disk { center, normal, radius } = shape {
                    let square = square_around(*center, *normal, *radius);
                    if self.sampling.solid_angle && square.is_near(ray.origin) {
                        return pdf_near(&square, ray.origin);
                    }
                }
                let density = match shape {
                    Shape::Parallelogram(quad) if self.sampling.product => {
                        quad.brightness(ray.origin, normal).density(hit.uv.x, hit.uv.y)
                    }
                    _ => 1.0,
                };
                let distance2 = (hit.t * ray.direction.length()).powi(2);
                let cos = self.normal.dot(ray.direction.normalize()).abs();
                density * distance2 / (self.area * cos)
            }
        }
    }

    /// Where `ray` meets it; solid on both sides, whether it shines there or not.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<ShapeHit> {
        if self.surely_missed(ray) { None } else { self.exact_hit(ray) }
    }

    fn exact_hit(&self, ray: &Ray) -> Option<ShapeHit> {
        let hit = match &self.shape {
            Shape::Parallelogram(Quad { corner, u, v, .. }) => {
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

    /// Whether the ray ends before the plane of a flat one, or goes away from it, by a margin far above all
    /// rounding: most do, and need no more exact answer.
    #[inline]
    fn surely_missed(&self, ray: &Ray) -> bool {
        let corner = match &self.shape {
            Shape::Parallelogram(quad) => quad.corner,
            Shape::Disk { center, .. } => *center,
            Shape::Sphere { .. } => return false,
        };
        let slope = self.normal.dot(ray.direction);
        let height = self.normal.dot(corner - ray.origin) * slope.signum();
        let margin = 1e-4 * (self.reach + ray.origin.abs().element_sum());
        // False for NaN, and for a ray without end.
        height < -margin || height > slope.abs() * (1.0001 * ray.t_max) + margin
    }

    /// Emitted radiance back along a ray that hit here.
    #[must_use]
    pub fn emitted(&self, ray: &Ray, hit: &ShapeHit) -> Vec3 {
        let shines = match &self.shape {
            Shape::Sphere { .. } => true,
            _ => self.two_sided || self.normal.dot(ray.direction) < 0.0,
        };
        if shines { self.radiance_at(hit.uv) } else { Vec3::ZERO }
    }

    fn radiance_at(&self, uv: Vec2) -> Vec3 {
        let [a, b, c, d] = self.radiance;
        a.lerp(b, uv.x).lerp(c.lerp(d, uv.x), uv.y)
    }
}

fn pdf_near(quad: &Quad, point: Vec3) -> f32 {
    SphericalQuad::new(quad, point).map_or(0.0, |seen| (1.0 / seen.solid_angle) as f32)
}

/// The square that a disk touches from within.
fn square_around(center: Vec3, normal: Vec3, radius: f32) -> Quad {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    Quad::new(center - (tangent + bitangent) * radius, tangent * (2.0 * radius), bitangent * (2.0 * radius))
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
            Self::Parallelogram(quad) => quad.area,
            Self::Disk { radius, .. } => PI * radius * radius,
            Self::Sphere { radius, .. } => 4.0 * PI * radius * radius,
        }
    }

    /// The box around it.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Parallelogram(quad) => Aabb::around(&quad.corners()),
            Self::Disk { center, radius, .. } | Self::Sphere { center, radius } => {
                Aabb { min: *center - *radius, max: *center + *radius }
            }
        }
    }

    fn normal(&self) -> Vec3 {
        match self {
            Self::Parallelogram(quad) => quad.normal,
            Self::Disk { normal, .. } => *normal,
            Self::Sphere { .. } => Vec3::ZERO,
        }
    }
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
