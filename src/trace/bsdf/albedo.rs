//! How much of the light a lobe sends back in all: tables over the cosine and the roughness, made when first
//! needed.

use super::microfacet::{Microfacets, fresnel_dielectric, schlick};
use super::sheen;
use glam::{Vec2, Vec3};
use std::sync::LazyLock;

/// Entries along the square root of the cosine, and along the square root of how much the roughness exceeds the
/// least one.
const SIZE: usize = 32;
/// Directions an entry is the mean of, squared.
const STRATA: u32 = 16;

/// The roughness of the least alpha.
const SMOOTH: f32 = 0.032;

/// Place along the entries for this roughness, in 0..=1; and back.
fn place_of(roughness: f32) -> f32 {
    ((roughness - SMOOTH) / (1.0 - SMOOTH)).clamp(0.0, 1.0).sqrt()
}

fn roughness_at(place: f32) -> f32 {
    SMOOTH + (1.0 - SMOOTH) * place * place
}

/// How much of the light that a single facet loses is given back: a little less than all, for tables err.
pub(super) const GIVEN_BACK: f32 = 0.98;

/// A function of a cosine and of a roughness (the root of alpha), both in 0..=1, linear in between.
#[derive(Clone, Debug)]
struct Grid<T>(Vec<T>);

impl<T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>> Grid<T> {
    fn new(entry: impl Fn(f32, f32) -> T) -> Self {
        let step = |i: usize| i as f32 / (SIZE - 1) as f32;
        let cells = (0..SIZE * SIZE).map(|i| {
            // Reflection from the very horizon is a limit; a little above it is near enough.
            let root = step(i % SIZE).max(0.01);
            entry(root * root, roughness_at(step(i / SIZE)))
        });
        Self(cells.collect())
    }

    fn at(&self, cos: f32, roughness: f32) -> T {
        let place = |x: f32| {
            let x = x.clamp(0.0, 1.0) * (SIZE - 1) as f32;
            let cell = (x as usize).min(SIZE - 2);
            (cell, x - cell as f32)
        };
        let ((i, s), (j, t)) = (place(cos.max(0.0).sqrt()), place(place_of(roughness)));
        let row = |j: usize| {
            let first = j * SIZE + i;
            self.0[first] * (1.0 - s) + self.0[first + 1] * s
        };
        row(j) * (1.0 - t) + row(j + 1) * t
    }

    /// 2 ∫ f(cos) cos d cos, of the function between the entries too, at each roughness.
    fn hemispherical(&self) -> Vec<T> {
        const STEPS: usize = 256;
        let mean = |j: usize| {
            let roughness = roughness_at(j as f32 / (SIZE - 1) as f32);
            let term = |k: usize| {
                let cos = (k as f32 + 0.5) / STEPS as f32;
                self.at(cos, roughness) * (2.0 * cos / STEPS as f32)
            };
            (1..STEPS).map(term).fold(term(0), |sum, term| sum + term)
        };
        (0..SIZE).map(mean).collect()
    }
}

fn along<T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>>(row: &[T], x: f32) -> T {
    let x = x.clamp(0.0, 1.0) * (SIZE - 1) as f32;
    let cell = (x as usize).min(SIZE - 2);
    let t = x - cell as f32;
    row[cell] * (1.0 - t) + row[cell + 1] * t
}

/// Pairs of numbers that are spread evenly.
fn strata(n: u32) -> impl Iterator<Item = Vec2> {
    // The second by the golden ratio: a lattice, which does well with what is periodic.
    let count = n * n;
    (0..count).map(move |i| {
        Vec2::new((i as f32 + 0.5) / count as f32, (f64::from(i) * 0.618_033_988_749_894_9).fract() as f32)
    })
}

fn toward(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

fn mirrored(wo: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * h.dot(wo)) - wo
}

/// What GGX reflects: of light at F0 and at F90 of Schlick's formula. Their sum is that of perfect mirrors.
///
/// Reference: B. Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 (the split).
#[derive(Debug)]
pub struct Reflected {
    by_cos: Grid<Vec2>,
    mean: Vec<Vec2>,
}

impl Reflected {
    /// The table, made on the first call.
    pub fn table() -> &'static Self {
        static TABLE: LazyLock<Reflected> = LazyLock::new(|| {
            let by_cos = Grid::new(|cos, roughness| {
                let facets = Microfacets::new(roughness * roughness);
                let wo = toward(cos);
                let sum: Vec2 = strata(STRATA)
                    .map(|u| {
                        let h = facets.sample(wo, u);
                        let wi = mirrored(wo, h);
                        let whole = if wi.z > 0.0 { facets.masking(wo, wi) } else { 0.0 };
                        let s = schlick(wo.dot(h));
                        Vec2::new(whole * (1.0 - s), whole * s)
                    })
                    .sum();
                sum / (STRATA * STRATA) as f32
            });
            let mean = by_cos.hemispherical();
            Reflected { by_cos, mean }
        });
        &TABLE
    }

    /// Toward a direction of this cosine.
    #[must_use]
    pub fn at(&self, cos: f32, roughness: f32) -> Vec2 {
        self.by_cos.at(cos, roughness)
    }

    /// In all directions, from light of all directions.
    #[must_use]
    pub fn mean(&self, roughness: f32) -> Vec2 {
        along(&self.mean, place_of(roughness))
    }
}

/// What a sheen of colour 1 reflects toward a cosine.
pub(super) fn of_sheen(cos: f32, roughness: f32) -> f32 {
    static TABLE: LazyLock<Grid<f32>> = LazyLock::new(|| {
        Grid::new(|cos, roughness| {
            let wo = toward(cos);
            let sum: f32 = strata(2 * STRATA)
                .map(|u| {
                    let wi = sheen::sample(u);
                    sheen::reflected(roughness, wo, wi) / sheen::pdf(wi)
                })
                .sum();
            sum / (4 * STRATA * STRATA) as f32
        })
    });
    TABLE.at(cos, roughness)
}

/// What a rough interface between two dielectrics reflects and transmits together: 1 but for the light that
/// meets a second facet. By whether the eye is on the denser side.
#[derive(Clone, Debug)]
pub struct Passed([Grid<f32>; 2]);

impl Passed {
    /// Of a body of this index of refraction, at least 1.
    #[must_use]
    pub fn new(ior: f32) -> Self {
        Self([ior, 1.0 / ior].map(|eta| {
            Grid::new(|cos, roughness| {
                let facets = Microfacets::new(roughness * roughness);
                let wo = toward(cos);
                let sum: f32 = strata(STRATA)
                    .map(|u| {
                        let h = facets.sample(wo, u);
                        let (reflectance, cos_t) = fresnel_dielectric(wo.dot(h), eta);
                        let reflected = mirrored(wo, h);
                        let refracted = h * (wo.dot(h) / eta - cos_t) - wo / eta;
                        let back = if reflected.z > 0.0 { facets.masking(wo, reflected) } else { 0.0 };
                        let on = if refracted.z < 0.0 { facets.masking(wo, refracted) } else { 0.0 };
                        reflectance * back + (1.0 - reflectance) * on
                    })
                    .sum();
                sum / (STRATA * STRATA) as f32
            })
        }))
    }

    pub(super) fn at(&self, inside: bool, cos: f32, roughness: f32) -> f32 {
        self.0[usize::from(inside)].at(cos, roughness)
    }
}
