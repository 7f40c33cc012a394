//! What is compared: one table, a row for each way to render. A new technique that can be switched is a
//! new row here and a field of [`RenderSettings`] or [`LightSampling`].

use super::plan::{Company, Kind};
use crate::trace::light::FlatLight;
use crate::trace::lights::ALL_LIGHTS;
use crate::trace::shape_light::Shape;
use crate::trace::{Integrator, LightSampling, Lights, RenderSettings, Sampling};

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
    /// Where it makes a difference.
    pub matters: Matters,
    /// What it changes in the settings.
    pub apply: fn(&mut RenderSettings),
    /// How it samples lights.
    pub lights: LightSampling,
}

/// Where switching a thing off makes a difference: elsewhere it would be ours once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matters {
    /// Everywhere.
    Always,
    /// In global illumination.
    Paths,
    /// Where a light is more than a point.
    Extent,
    /// Where there is a parallelogram light.
    Parallelograms,
    /// Where a light can be near: a shape or a mesh.
    Shapes,
    /// Where one is chosen among many lights, or triangles: after a bounce of global illumination among two. (Where direct light is
    /// seen in a mirror, too, which is a small part of most pictures.)
    Many,
}

impl Matters {
    fn with(self, integrator: Integrator, lights: Option<&Lights>) -> bool {
        let any = |is: &dyn Fn(&FlatLight) -> bool| lights.is_none_or(|lights| lights.iter().any(is));
        match self {
            Self::Always => true,
            Self::Paths => integrator == Integrator::Path,
            Self::Extent => any(&FlatLight::has_extent),
            Self::Parallelograms => any(
                &|light| matches!(light, FlatLight::Shape(s) if matches!(s.shape, Shape::Parallelogram(_))),
            ),
            Self::Shapes => any(&|light| matches!(light, FlatLight::Shape(_) | FlatLight::Mesh(_))),
            Self::Many => {
                let all = if integrator == Integrator::Path { 1 } else { ALL_LIGHTS };
                any(&|light| matches!(light, FlatLight::Mesh(mesh) if mesh.has_tree()))
                    || lights.is_none_or(|lights| lights.len() > all)
            }
        }
    }
}

impl Method {
    /// How long its runs are goes by that.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self.ablation {
            true => Kind::Ablation,
            false if self.name == OURS => Kind::Ours,
            false => Kind::Other,
        }
    }
}

/// The row that everything is compared with, and that is measured longest.
pub const OURS: &str = "ours";
/// What the ancestor did.
pub const RANDOM: &str = "random";

/// Nothing of ours but the engine: what a plain ray tracer of direct light does.
fn plainly(settings: &mut RenderSettings) {
    settings.sampling = Sampling::Independent;
    settings.light_samples = 1;
    settings.shafts = false;
    settings.reuse = false;
}

/// Ours with one thing switched off.
const fn ours_but(
    name: &'static str,
    title: &'static str,
    changes: &'static str,
    matters: Matters,
    apply: fn(&mut RenderSettings),
) -> Method {
    Method {
        name,
        title,
        changes,
        ablation: true,
        adaptive: true,
        matters,
        apply,
        lights: LightSampling::BEST,
    }
}

/// Ours with its lights sampled otherwise.
const fn ours_with(
    lights: LightSampling,
    name: &'static str,
    title: &'static str,
    changes: &'static str,
    matters: Matters,
) -> Method {
    Method { lights, ..ours_but(name, title, changes, matters, |_| {}) }
}

/// All of them, in the order of the tables.
pub const METHODS: [Method; 15] = [
    Method {
        name: RANDOM,
        title: "plain random",
        changes: "as the ancestor did: a place on each light evenly by area and every number independent, one shadow ray to each \
                  light for each sample, the same number for every pixel; no light in closed form, no shafts, no warp, \
                  no paths shared",
        ablation: false,
        adaptive: false,
        matters: Matters::Always,
        apply: plainly,
        lights: LightSampling::PLAIN,
    },
    Method {
        name: "stratified",
        title: "stratified 4×4",
        changes: "as plain random, but with a jittered grid of 4 × 4 cells, over and over",
        ablation: false,
        adaptive: false,
        matters: Matters::Always,
        apply: |settings| {
            plainly(settings);
            settings.sampling = Sampling::Stratified;
        },
        lights: LightSampling::PLAIN,
    },
    Method {
        name: OURS,
        title: "ours",
        changes: "(0, 2)-sequences with Owen scrambling for the pixel, the lights and the bounces; light in closed form where \
                  it is known what is in the way; more samples where there is more noise",
        ablation: false,
        adaptive: true,
        matters: Matters::Always,
        apply: |_| {},
        lights: LightSampling::BEST,
    },
    Method {
        adaptive: false,
        ..ours_but(
            "even",
            "ours − adaptive",
            "the same number of samples for every pixel",
            Matters::Always,
            |_| {},
        )
    },
    ours_but(
        "no-shares-again",
        "ours − shares anew",
        "where more samples go is decided once, by the first three of each pixel",
        Matters::Always,
        |settings| settings.shares_again = false,
    ),
    ours_but(
        "no-shafts",
        "ours − shafts",
        "light that nothing can block is sampled too",
        Matters::Parallelograms,
        |settings| settings.shafts = false,
    ),
    ours_but(
        "no-cuts",
        "ours − penumbrae",
        "light is computed only where nothing is in its way: where something may be, the lamp is not cut but sampled",
        Matters::Parallelograms,
        |settings| settings.cuts = false,
    ),
    ours_with(
        LightSampling { product: false, ..LightSampling::BEST },
        "no-warp",
        "ours − warp",
        "places on parallelogram lights even by area, not by what they bring",
        Matters::Parallelograms,
    ),
    ours_with(
        LightSampling { solid_angle: false, ..LightSampling::BEST },
        "no-solid-angle",
        "ours − solid angle",
        "places on balls and on near lights by area, not by solid angle",
        Matters::Shapes,
    ),
    ours_with(
        LightSampling { tree: false, ..LightSampling::BEST },
        "no-light-tree",
        "ours − light tree",
        "one of many lights is chosen evenly, one of many triangles by its area",
        Matters::Many,
    ),
    ours_but(
        "no-reuse",
        "ours − reuse",
        "each pixel follows its own paths alone",
        Matters::Paths,
        |settings| {
            settings.reuse = false;
        },
    ),
    ours_but(
        "one-light-sample",
        "ours − second look",
        "one sample of each light wherever the eye looks",
        Matters::Extent,
        |settings| settings.light_samples = 1,
    ),
    ours_but(
        "shifted",
        "ours − scrambling",
        "the same sequences with a random shift in place of Owen's scrambling",
        Matters::Always,
        |settings| settings.sampling = Sampling::Shifted,
    ),
    ours_but(
        "random-pixel",
        "ours − pixel",
        "independent places in the pixel, the rest as ours",
        Matters::Always,
        |settings| settings.pixel_sampling = Some(Sampling::Independent),
    ),
    ours_but(
        "random-light",
        "ours − lights",
        "independent samples of lights and bounces, the places in the pixel as ours",
        Matters::Always,
        |settings| {
            settings.sampling = Sampling::Independent;
            settings.pixel_sampling = Some(Sampling::Sobol);
        },
    ),
];

/// Those that make a difference with this integrator and these lights; `None`: with any.
pub fn methods(integrator: Integrator, lights: Option<&Lights>) -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(move |method| method.matters.with(integrator, lights))
}

/// How many of them there are beside ours.
#[must_use]
pub fn company(methods: impl Iterator<Item = &'static Method>) -> Company {
    methods.fold(Company::default(), |company, method| match method.kind() {
        Kind::Ours => company,
        Kind::Other => Company { others: company.others + 1, ..company },
        Kind::Ablation => Company { ablations: company.ablations + 1, ..company },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::App;
    use crate::image::compare::LinearImage;
    use crate::load::{LoadOptions, SceneSource};
    use crate::open::{Wishes, open};
    use crate::report::measure::{Subject, run};
    use crate::report::reference::standard_error;
    use crate::sync::traceable;
    use crate::torture::stage::Estimate;
    use crate::trace::{Film, RayCounts, TraceScene, trace_pass};
    use glam::UVec2;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn every_method_but_ours_changes_something_of_its_own() {
        let ours = RenderSettings::default();
        let changed: Vec<(RenderSettings, bool, LightSampling)> = METHODS
            .iter()
            .map(|method| {
                let mut settings = ours;
                (method.apply)(&mut settings);
                let is_ours = settings == ours && method.adaptive && method.lights == LightSampling::BEST;
                assert_eq!(is_ours, method.name == OURS, "{}", method.name);
                (settings, method.adaptive, method.lights)
            })
            .collect();
        for (i, a) in changed.iter().enumerate() {
            assert!(!changed[..i].contains(a), "{} is there twice", METHODS[i].name);
        }
    }

    fn opened(scene: &'static str, size: u32, integrator: Integrator) -> App {
        let wishes = Wishes {
            size: Some(UVec2::splat(size)),
            integrator: Some(integrator),
            max_depth: Some(2),
            ..Wishes::default()
        };
        open(&SceneSource::BuiltIn(scene), &LoadOptions::default(), &wishes).unwrap().app
    }

    /// What a method makes of a scene with so many even samples, and its rays.
    fn made(app: &App, method: &Method, seed: u32, samples: u32) -> (Film, RayCounts) {
        let mut settings = RenderSettings { seed, ..*app.world.resource::<RenderSettings>() };
        (method.apply)(&mut settings);
        let scene = traceable(&app.world);
        let lights = scene.lights.sampled(method.lights);
        let scene = TraceScene { settings: &settings, lights: &lights, ..scene };
        let mut film = Film::new(settings.size, 0);
        let rays = trace_pass(&scene, &mut film, samples, samples, || true);
        (film, rays)
    }

    fn method(name: &str) -> &'static Method {
        METHODS.iter().find(|method| method.name == name).unwrap()
    }

    /// Mean luminance, from independent pictures.
    fn brightness(app: &App, method: &Method, seeds: std::ops::Range<u32>, samples: u32) -> Estimate {
        let means: Vec<f64> = seeds
            .map(|seed| {
                let luminances = LinearImage::of(&made(app, method, seed, samples).0).luminances();
                luminances.iter().sum::<f64>() / luminances.len() as f64
            })
            .collect();
        Estimate::of(&means)
    }

    /// Nothing that is switched off may change the picture but for its noise.
    #[test]
    fn all_methods_make_the_same_picture_in_the_end() {
        // Every shape of lamp, and a mesh that shines.
        for (scene, integrator) in [("gallery", Integrator::Path), ("cornell-gltf", Integrator::Path)] {
            let app = opened(scene, 24, integrator);
            let truth = brightness(&app, method(OURS), 1000..1032, 128);
            for method in &METHODS {
                let found = brightness(&app, method, 0..32, 64);
                let bound = 4.5 * found.sigma.hypot(truth.sigma);
                let off = found.mean - truth.mean;
                println!("{scene} {}: off {off:+.1e} of {:.3}, bound {bound:.1e}", method.name, truth.mean);
                assert!(off.abs() < bound, "{scene} {}", method.name);
                assert!(
                    bound < 0.03 * truth.mean,
                    "{scene} {}: {bound:.1e} would accept too much",
                    method.name
                );
            }
        }
    }

    #[test]
    fn plain_random_asks_a_shadow_ray_of_every_light_for_every_sample() {
        let app = opened("cornell", 32, Integrator::Direct);
        let (film, rays) = made(&app, method(RANDOM), 0, 64);
        assert_eq!(rays.camera, 64 * 1024);
        // Some pixels see the lamp, or turn away from it, as a place of the ceiling beside it does.
        assert!(rays.shadow as f64 > 0.6 * rays.camera as f64 && rays.shadow <= rays.camera, "{rays:?}");
        let (best, _) = made(&app, method(OURS), 0, 64);
        assert!(standard_error(&film, None) > 1.5 * standard_error(&best, None));
    }

    /// What is said to make no difference must not: same samples, same picture.
    #[test]
    fn what_does_not_matter_changes_nothing() {
        for (scene, integrator) in [
            ("cornell-point", Integrator::Direct),
            ("cornell", Integrator::Direct),
            ("mirrors", Integrator::Path),
        ] {
            let app = opened(scene, 24, integrator);
            let (as_always, _) = made(&app, method(OURS), 0, 8);
            let lights = traceable(&app.world).lights;
            let mut left_out = 0;
            for method in METHODS.iter().filter(|method| !method.matters.with(integrator, Some(lights))) {
                let (film, _) = made(&app, method, 0, 8);
                let same = LinearImage::of(&film) == LinearImage::of(&as_always);
                assert!(same, "{scene}: {} makes a difference", method.name);
                left_out += 1;
            }
            assert!(left_out > 0 || integrator == Integrator::Path, "{scene}");
        }
    }

    #[test]
    fn a_run_samples_lights_as_its_method_says() {
        let app = opened("cornell", 16, Integrator::Direct);
        let interrupt = AtomicBool::new(false);
        let reference = LinearImage::of(&made(&app, &METHODS[0], 0, 1).0);
        let subject = Subject {
            app: &app,
            settings: *app.world.resource::<RenderSettings>(),
            reference: &reference,
            surfaces: None,
            interrupt: &interrupt,
        };
        let (first, _) = run(&subject, &METHODS[0], 0, 0.0, |_| {});
        assert_eq!(first.points[0].rmse, 0.0, "the same sample of the same places");
        let warped = Method { lights: LightSampling::BEST, ..METHODS[0] };
        let (other, _) = run(&subject, &warped, 0, 0.0, |_| {});
        assert!(other.points[0].rmse > 0.0);
    }
}
