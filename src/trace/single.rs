//! Single samples of pixels anywhere in the picture, for no film.

use super::integrator::Batch;
use super::pass::RayCounts;
use super::sampler::Sampler;
use super::{RenderSettings, TraceScene};
use glam::{UVec2, Vec3};

impl Batch {
    /// Radiance of sample number `index` of each of `pixels`, in their order, all in the middle of their pixel: of the surface that
    /// [`super::place::places`] finds there.
    pub fn single_samples(&mut self, scene: &TraceScene, pixels: &[UVec2], index: u32) -> &[Vec3] {
        // Neighbours that share have whole tiles, and for a single sample nobody asks what is in the way of others.
        let settings = RenderSettings { reuse: false, ..scene.settings.for_single_samples() };
        let scene = &TraceScene { settings: &settings, ..*scene };
        self.keys.clear();
        self.keys.extend((0..pixels.len() as u32).map(|i| (i, index)));
        self.pixels.clear();
        let halves = |pixel: &UVec2| (pixel.as_vec2(), Sampler::halves(*pixel, &settings));
        self.pixels.extend(pixels.iter().map(halves));
        self.reuse.enter(scene, UVec2::ONE);
        self.diffuse.enter_alone();
        self.follow(scene, settings.size, true, &mut RayCounts::default());
        &self.radiance
    }
}
