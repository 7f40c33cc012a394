//! Emissive meshes: their triangles as one light.

use super::emitter::{Emitter, Receiver};
use super::features::{Feature, count, count_times};
use super::light::{LightSample, sample_at, sample_flat};
use super::light_sampling::LightSampling;
use super::light_tree::{Chosen, LightTree};
use super::spherical::{SphericalTriangle, meet, weights};
use crate::bvh::Aabb;
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Triangles of an emissive instance. A few are chosen by their area, many by what they may bring.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshLight {
    /// Index of the instance.
    pub(crate) instance: u32,
    /// Triangle numbers in the mesh, rising.
    pub(crate) triangles: Vec<u32>,
    /// Corners in render space, beside `triangles`.
    corners: Vec<[Vec3; 3]>,
    /// Cumulative part of the area, beside `triangles`; the last is 1.
    pub(crate) cumulative: Vec<f32>,
    /// Empty for a few.
    tree: Arc<LightTree>,
    /// Emits on the back too.
    pub(crate) two_sided: bool,
    /// The placement mirrors: the front is where `corners` run clockwise.
    pub(crate) mirrored: bool,
    /// How places on it are chosen.
    sampling: LightSampling,
    /// All of them together, as if they shone with luminance 1.
    shape: Emitter,
    luminance: f32,
}

/// Up to this many are chosen by their area alone: there is little to be won, if none is much smaller than others.
pub(super) const FEW: usize = 16;
/// So many times smaller than their mean.
const UNEVEN: f32 = 16.0;

impl MeshLight {
    /// Whether the choice among its triangles matters more than the place on one.
    #[must_use]
    pub fn is_many(&self) -> bool {
        self.triangles.len() > FEW
    }

    /// Of the triangles of an instance (numbers in its mesh, rising, and corners in render space) that shine with
    /// this luminance; those without area are left out. `None` if nothing is left. `before` is a light that it may
    /// be again.
    #[must_use]
    pub fn new(
        instance: u32,
        triangles: impl Iterator<Item = (u32, [Vec3; 3])>,
        [two_sided, mirrored]: [bool; 2],
        luminance: f32,
        before: Option<&Self>,
    ) -> Option<Self> {
        let mut areas = Vec::new();
        let mut light = Self { instance, two_sided, mirrored, ..Self::default() };
        for (triangle, corners) in triangles {
            let area = triangle_area(&corners);
            if area > 0.0 && area.is_finite() {
                light.triangles.push(triangle);
                light.corners.push(corners);
                areas.push(area);
            }
        }
        let total: f64 = areas.iter().map(|area| f64::from(*area)).sum();
        let mut sum = 0.0;
        light.cumulative.extend(areas.iter().map(|area| {
            sum += f64::from(*area);
            (sum / total) as f32
        }));
        *light.cumulative.last_mut()? = 1.0;
        light.luminance = luminance;
        let same = |before: &&Self| {
            before.corners == light.corners && [before.two_sided, before.mirrored] == [two_sided, mirrored]
        };
        if let Some(before) = before.filter(same) {
            (light.shape, light.tree) = (before.shape, Arc::clone(&before.tree));
            return Some(light);
        }
        let flat = |(corners, area): (&[Vec3; 3], &f32)| {
            Emitter::flat(Aabb::around(corners), light.front(corners), two_sided, *area)
        };
        let emitters: Vec<Emitter> = light.corners.iter().zip(&areas).map(flat).collect();
        light.shape = emitters.iter().copied().reduce(|all, more| all.union(&more))?;
        let mean = (total / areas.len() as f64) as f32;
        let is_even = areas.iter().all(|area| *area * UNEVEN >= mean);
        if emitters.len() > FEW || !is_even {
            light.tree = Arc::new(LightTree::new(&emitters));
        }
        Some(light)
    }

    /// Whether its triangles are chosen by what they may bring.
    #[must_use]
    pub fn has_tree(&self) -> bool {
        !self.tree.is_empty()
    }

    /// Chooses triangles and places otherwise.
    pub(super) fn sample_so(&mut self, sampling: LightSampling) {
        self.sampling = sampling;
        if !sampling.tree {
            self.tree = Arc::default();
        }
    }

    /// What a choice among many lights needs to know.
    pub(super) fn emitter(&self) -> Emitter {
        self.shape.times(self.luminance)
    }

    /// Unit normal of the side that shines; zero where it has none.
    fn front(&self, [a, b, c]: &[Vec3; 3]) -> Vec3 {
        let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
        if self.mirrored { -normal } else { normal }
    }

    /// Part of the area that number `i` has.
    fn part(&self, i: usize) -> f32 {
        self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] }
    }

    /// Chooses a triangle by a number in [0, 1).
    fn choose(&self, to: &Receiver, random: f32) -> Option<Chosen> {
        if self.has_tree() {
            count(Feature::LightChoice);
            return self.tree.sample(to, random);
        }
        let last = self.cumulative.len().checked_sub(1)?;
        let emitter = self.cumulative.partition_point(|&c| c <= random).min(last);
        let below = if emitter == 0 { 0.0 } else { self.cumulative[emitter - 1] };
        let chance = self.part(emitter);
        Some(Chosen { emitter, chance, rest: ((random - below) / chance).clamp(0.0, 1.0) })
    }

    /// Chooses a triangle for each of these, if it [`MeshLight::has_tree`].
    pub(super) fn choose_all(&self, wanted: &[(Receiver, f32)], chosen: &mut [Option<Chosen>]) {
        self.tree.sample_all(wanted, chosen);
        count_times(Feature::LightChoice, wanted.len());
    }

    /// Probability of choosing number `i`.
    fn chance(&self, to: &Receiver, i: usize) -> f32 {
        if self.tree.is_empty() { self.part(i) } else { self.tree.chance(to, i) }
    }

    /// A direction toward it; see [`super::light::FlatLight::sample`].
    pub(super) fn sample(&self, to: &Receiver, u: Vec2) -> Option<LightSample> {
        self.sample_on(&self.choose(to, u.x)?, to.point, u.y)
    }

    /// A direction toward the triangle that was chosen, by a number in [0, 1) and what is left of the first.
    pub(super) fn sample_on(&self, chosen: &Chosen, point: Vec3, second: f32) -> Option<LightSample> {
        let Chosen { emitter: i, chance: share, rest } = *chosen;
        let corners = &self.corners[i];
        let [a, b, c] = *corners;
        let at = |[b1, b2]: [f32; 2]| a * (1.0 - b1 - b2) + b * b1 + c * b2;
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()? * if self.mirrored { -1.0 } else { 1.0 };
        let (sample, [b1, b2]) = if self.is_near(corners, point) {
            let seen = seen_from(corners, point)?;
            let corners = corners.map(Vec3::as_dvec3);
            let position = meet(&corners, point, seen.sample(f64::from(rest), f64::from(second)))?;
            let weights = weights(corners[0], corners[1] - corners[0], corners[2] - corners[0], position);
            let pdf = (f64::from(share) / seen.solid_angle) as f32;
            (sample_at(point, position.as_vec3(), normal, pdf, self.two_sided, Vec3::ONE)?, weights)
        } else {
            let s = rest.sqrt();
            let weights = [s * (1.0 - second), s * second];
            let area = 0.5 * cross.length() / share;
            (sample_flat(point, at(weights), normal, area, self.two_sided, Vec3::ONE)?, weights)
        };
        Some(LightSample {
            triangle: Some((self.instance, self.triangles[i])),
            uv: Vec2::new(b1, b2),
            ..sample
        })
    }

    fn is_near(&self, corners: &[Vec3; 3], point: Vec3) -> bool {
        self.sampling.solid_angle && is_near(corners, point)
    }

    /// Density in solid angle of sampling `triangle` for a point at this distance and cosine at the light.
    #[must_use]
    pub fn pdf(&self, triangle: u32, to: &Receiver, distance2: f32, cos: f32) -> f32 {
        let Ok(i) = self.triangles.binary_search(&triangle) else { return 0.0 };
        let share = self.chance(to, i);
        if self.is_near(&self.corners[i], to.point) {
            return seen_from(&self.corners[i], to.point)
                .map_or(0.0, |seen| (f64::from(share) / seen.solid_angle) as f32);
        }
        share * distance2 / (triangle_area(&self.corners[i]) * cos.max(1e-9))
    }
}

/// Whether a triangle is so near that it is sampled by solid angle, not by area: its middle is nearer than its longest edge
/// is long, so no point of it is near that is not asked so, below acute corners either.
fn is_near([a, b, c]: &[Vec3; 3], point: Vec3) -> bool {
    let longest = (*b - *a).length_squared().max((*c - *b).length_squared()).max((*a - *c).length_squared());
    ((*a + *b + *c) / 3.0 - point).length_squared() < longest
}

fn seen_from(corners: &[Vec3; 3], point: Vec3) -> Option<SphericalTriangle> {
    SphericalTriangle::new(corners.map(|p| p.as_dvec3() - point.as_dvec3()))
}

/// Area of a triangle.
#[must_use]
pub fn triangle_area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::sampler::{hash, unit_float};

    /// Forty triangles on a bowl, shining inward or, mirrored, outward.
    fn bowl(mirrored: bool) -> MeshLight {
        let at = |i: u32, up: f32| {
            let (y, x) = (i as f32 * 0.157).sin_cos();
            Vec3::new(x * (1.0 + up), up * (1.0 + 0.1 * x), y * (1.0 + up))
        };
        let triangles = (0..40).map(|i| (i + 5, [at(i, 0.0), at(i + 1, 0.0), at(i, 1.0)]));
        MeshLight::new(0, triangles, [false, mirrored], 1.0, None).unwrap()
    }

    #[test]
    fn triangles_are_chosen_as_their_chances_say_and_densities_are_those_of_samples() {
        for mirrored in [false, true] {
            let light = bowl(mirrored);
            for point in [Vec3::new(0.3, 0.2, 0.1), Vec3::new(3.0, 0.5, 0.0), Vec3::new(0.0, -4.0, 0.0)] {
                let to = Receiver { point, normal: Vec3::Y };
                let chances: Vec<f64> = (0..40).map(|i| f64::from(light.chance(&to, i))).collect();
                assert!((chances.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{chances:?}");
                let (mut counts, count) = ([0.0; 40], 1 << 16);
                for i in 0..count {
                    let random = (i as f32 + 0.5) / count as f32;
                    counts[light.choose(&to, random).unwrap().emitter] += 1.0 / f64::from(count);
                    let u = Vec2::new(random, unit_float(hash(i)));
                    let Some(sample) = light.sample(&to, u) else { continue };
                    let (Some(target), Some(pdf), Some((_, triangle))) =
                        (sample.target, sample.pdf, sample.triangle)
                    else {
                        panic!("{sample:?}")
                    };
                    let normal = light.front(&light.corners[triangle as usize - 5]);
                    let along = target - point;
                    let cos = normal.dot(along.normalize()).abs();
                    let asked = light.pdf(triangle, &to, along.length_squared(), cos);
                    // At a flat angle the cosine of the rounded target is less exact.
                    assert!((asked / pdf - 1.0).abs() < 1e-4 / cos, "{asked} {pdf}");
                }
                for (count, chance) in counts.iter().zip(&chances) {
                    assert!((count - chance).abs() < 1e-3, "{counts:?} {chances:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_as_it_was_is_not_made_again() {
        let before = bowl(false);
        let again = |light: &MeshLight, mirrored: bool| {
            let triangles = light.triangles.iter().copied().zip(light.corners.iter().copied());
            MeshLight::new(0, triangles, [false, mirrored], 2.0, Some(light)).unwrap()
        };
        assert!(Arc::ptr_eq(&again(&before, false).tree, &before.tree));
        assert!(!Arc::ptr_eq(&again(&before, true).tree, &before.tree));
        assert_eq!(again(&before, false).emitter().intensity, 2.0 * before.emitter().intensity);
    }
}
