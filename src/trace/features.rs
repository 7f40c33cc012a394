//! How often was done what only some scenes need: it is counted where it is done, so that all others pay nothing for that either.

use std::cell::Cell;

/// Counts of what a scene without mirrors, textures, alpha or many lights has none of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FeatureCounts {
    /// Rays from mirrors and through glass; they are also counted as bounces.
    pub mirror_rays: u64,
    /// Places looked up in textures.
    pub texture_lookups: u64,
    /// Hits that were asked whether they are there: masks, and what is half-transparent.
    pub alpha_tests: u64,
    /// Choices of one among many lights, or triangles of one, by what it may bring.
    pub light_choices: u64,
}

impl std::ops::Add for FeatureCounts {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            mirror_rays: self.mirror_rays + other.mirror_rays,
            texture_lookups: self.texture_lookups + other.texture_lookups,
            alpha_tests: self.alpha_tests + other.alpha_tests,
            light_choices: self.light_choices + other.light_choices,
        }
    }
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Feature {
    MirrorRay,
    TextureLookup,
    AlphaTest,
    LightChoice,
}

// A batch is traced by one thread from beginning to end, and what it looks up is deep below it: through the arguments of all in
// between it would cost those who have nothing to count.
thread_local! {
    static COUNTS: [Cell<u64>; 4] = const { [const { Cell::new(0) }; 4] };
}

/// Counts one.
#[inline]
pub(super) fn count(feature: Feature) {
    count_times(feature, 1);
}

/// Counts some.
#[inline]
pub(super) fn count_times(feature: Feature, times: usize) {
    COUNTS.with(|counts| {
        let count = &counts[feature as usize];
        count.set(count.get() + times as u64);
    });
}

/// What this thread has counted since this was last called.
pub(super) fn take() -> FeatureCounts {
    COUNTS.with(|counts| {
        let [mirror_rays, texture_lookups, alpha_tests, light_choices] =
            [0, 1, 2, 3].map(|i: usize| counts[i].take());
        FeatureCounts { mirror_rays, texture_lookups, alpha_tests, light_choices }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_counted_is_taken_once() {
        let _ = take();
        count(Feature::MirrorRay);
        for feature in [Feature::TextureLookup, Feature::AlphaTest, Feature::LightChoice, Feature::AlphaTest]
        {
            count(feature);
        }
        let counted = FeatureCounts { mirror_rays: 1, texture_lookups: 1, alpha_tests: 2, light_choices: 1 };
        assert_eq!(take(), counted);
        assert_eq!(take(), FeatureCounts::default());
    }
}
