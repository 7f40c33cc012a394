//! What is compared: one table, a row for each way to render. A new technique that can be switched is a
//! new row here and a field of [`RenderSettings`].

use crate::trace::{Integrator, RenderSettings, Sampling};

/// One way to render.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Short, without spaces.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// What it changes of ours, in words.
    pub changes: &'static str,
    /// Ours with one thing switched off, not a peer.
    pub ablation: bool,
    /// More samples where there is more noise.
    pub adaptive: bool,
    /// Makes a difference with this integrator alone.
    pub only: Option<Integrator>,
    /// What it changes in the settings.
    pub apply: fn(&mut RenderSettings),
}

/// The row that everything is compared with, and that is measured longest.
pub const OURS: &str = "ours";
/// What the ancestor did.
pub const RANDOM: &str = "random";

/// All of them, in the order of the tables.
pub const METHODS: [Method; 10] = [
    Method {
        name: RANDOM,
        title: "plain random",
        changes: "every number independent, one sample of each light, as the ancestor sampled its area lights",
        ablation: false,
        adaptive: false,
        only: None,
        apply: |settings| {
            settings.sampling = Sampling::Independent;
            settings.light_samples = 1;
        },
    },
    Method {
        name: "stratified",
        title: "stratified 4×4",
        changes: "a jittered grid of 4 × 4 cells, over and over, one sample of each light",
        ablation: false,
        adaptive: false,
        only: None,
        apply: |settings| {
            settings.sampling = Sampling::Stratified;
            settings.light_samples = 1;
        },
    },
    Method {
        name: OURS,
        title: "ours",
        changes: "(0, 2)-sequences with Owen scrambling for the pixel, the lights and the bounces; more samples where \
                  there is more noise",
        ablation: false,
        adaptive: true,
        only: None,
        apply: |_| {},
    },
    Method {
        name: "even",
        title: "ours − adaptive",
        changes: "the same number of samples for every pixel",
        ablation: true,
        adaptive: false,
        only: None,
        apply: |_| {},
    },
    Method {
        name: "no-shafts",
        title: "ours − shafts",
        changes: "light that nothing can block is sampled too",
        ablation: true,
        adaptive: true,
        only: None,
        apply: |settings| settings.shafts = false,
    },
    Method {
        name: "no-reuse",
        title: "ours − reuse",
        changes: "each pixel follows its own paths alone",
        ablation: true,
        adaptive: true,
        only: Some(Integrator::Path),
        apply: |settings| settings.reuse = false,
    },
    Method {
        name: "one-light-sample",
        title: "ours − second look",
        changes: "one sample of each light wherever the eye looks",
        ablation: true,
        adaptive: true,
        only: None,
        apply: |settings| settings.light_samples = 1,
    },
    Method {
        name: "shifted",
        title: "ours − scrambling",
        changes: "the same sequences with a random shift in place of Owen's scrambling",
        ablation: true,
        adaptive: true,
        only: None,
        apply: |settings| settings.sampling = Sampling::Shifted,
    },
    Method {
        name: "random-pixel",
        title: "ours − pixel",
        changes: "independent places in the pixel, the rest as ours",
        ablation: true,
        adaptive: true,
        only: None,
        apply: |settings| settings.pixel_sampling = Some(Sampling::Independent),
    },
    Method {
        name: "random-light",
        title: "ours − lights",
        changes: "independent samples of lights and bounces, the places in the pixel as ours",
        ablation: true,
        adaptive: true,
        only: None,
        apply: |settings| {
            settings.sampling = Sampling::Independent;
            settings.pixel_sampling = Some(Sampling::Sobol);
        },
    },
];

/// Those that make a difference with this integrator.
pub fn methods(integrator: Integrator) -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(move |method| method.only.is_none_or(|only| only == integrator))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_but_ours_changes_something_of_its_own() {
        let ours = RenderSettings::default();
        let changed: Vec<(RenderSettings, bool)> = METHODS
            .iter()
            .map(|method| {
                let mut settings = ours;
                (method.apply)(&mut settings);
                assert_eq!(settings == ours && method.adaptive, method.name == OURS, "{}", method.name);
                (settings, method.adaptive)
            })
            .collect();
        for (i, a) in changed.iter().enumerate() {
            assert!(!changed[..i].contains(a), "{} is there twice", METHODS[i].name);
        }
    }
}
