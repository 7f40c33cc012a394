//! Measures everything, scene by scene.

use super::curve::{Findings, Measure};
use super::facts::Facts;
use super::machine::Machine;
use super::measure::{Performance, Run, Subject, Tracing, run, surfaces, traceable};
use super::methods::{Method, OURS, RANDOM, company, methods};
use super::pictures::Pictures;
use super::plan::Plan;
use super::reference::{self, Reference};
use super::{GivenReference, MethodReport, Report, ReportError, ReportJob, SceneReport, curve, noise_check};
use crate::image::Display;
use crate::image::compare::LinearImage;
use crate::image::files::write_whole;
use crate::load::{LoadOptions, SceneSource};
use crate::open::{Opened, open};
use crate::trace::RenderSettings;
use glam::UVec2;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// How far a report is.
#[derive(Clone, Debug)]
pub struct ReportProgress {
    /// 0 to 1, of the planned time.
    pub part: f64,
    /// What is being measured.
    pub what: String,
    /// Planned seconds that are left.
    pub seconds_left: f64,
}

/// Planned time: what is done, and what is to do.
struct Clock<'a> {
    total: f64,
    done: f64,
    tell: &'a mut dyn FnMut(&ReportProgress),
}

impl Clock<'_> {
    fn at(&mut self, seconds: f64, what: &str) {
        let done = (self.done + seconds).min(self.total);
        let part = done / self.total;
        (self.tell)(&ReportProgress { part, what: what.to_owned(), seconds_left: self.total - done });
    }
}

/// Measures all scenes of `job`. An interruption ends it with what there is.
///
/// # Errors
/// If a scene or reference cannot be read or does not fit, or the folder cannot be written to: found out
/// before anything is measured, but for what only opening a scene can tell.
pub fn measure_all(
    job: &ReportJob,
    mut progress: impl FnMut(&ReportProgress),
) -> Result<Report, ReportError> {
    let size = job.wishes.size.unwrap_or(RenderSettings::default().size);
    let names = names(&job.scenes);
    let mut given = given_references(&job.references, &names, size)?;
    prepare_folder(&job.folder)?;
    let share = Plan::share(job.total, job.scenes.len());
    let total = share * job.scenes.len() as f64;
    let mut clock = Clock { total, done: 0.0, tell: &mut progress };
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::here(),
        scenes: Vec::new(),
        interrupted: false,
    };
    for (i, (source, name)) in job.scenes.iter().zip(&names).enumerate() {
        clock.done = share * i as f64;
        if let Some(scene) = measure_scene(job, source, name, given.remove(name), &mut clock)? {
            report.scenes.push(scene);
        }
        if job.interrupt.load(Ordering::Relaxed) {
            report.interrupted = true;
            break;
        }
    }
    Ok(report)
}

fn measure_scene(
    job: &ReportJob,
    source: &SceneSource,
    name: &str,
    given: Option<Reference>,
    clock: &mut Clock,
) -> Result<Option<SceneReport>, ReportError> {
    clock.at(0.0, &format!("{name}: opening"));
    let start = Instant::now();
    let Opened { app, .. } = open(source, &LoadOptions::default(), &job.wishes)?;
    let opening = start.elapsed().as_secs_f64();
    let settings = *app.world.resource::<RenderSettings>();
    let mut first = Tracing::new(traceable(&app, &settings), &job.interrupt);
    if !first.pass(1) {
        return Ok(None);
    }
    let facts = Facts::of(&app, opening + first.seconds);
    let compared: Vec<&'static Method> =
        methods(settings.integrator, Some(traceable(&app, &settings).lights)).collect();
    let plan = Plan::new(job.total, job.scenes.len(), company(compared.iter().copied()), job.seeds);
    drop(first);
    let mask = surfaces(&app, &settings);
    let mask = mask.as_deref();
    let reference = match given {
        Some(given) => given,
        None => {
            let what = format!("{name}: reference");
            let place = (job.folder.join(REFERENCES), name);
            let place = (place.0.as_path(), place.1);
            let tell = |seconds| clock.at(seconds, &what);
            match reference::made(&app, (&settings, mask), place, plan.reference, &job.interrupt, tell)? {
                Some(made) => made,
                None => return Ok(None),
            }
        }
    };
    clock.done += plan.reference;

    let subject = Subject {
        app: &app,
        settings,
        reference: &reference.picture,
        surfaces: mask,
        interrupt: &job.interrupt,
    };
    let (measured, kept) = all_methods(&subject, &compared, name, &plan, clock);
    let methods = method_reports(measured, |measure| reference.facts.standard_error(measure));
    let performance = methods
        .iter()
        .find(|m| m.name == OURS)
        .and_then(|ours| ours.runs.first())
        .map(Performance::of)
        .unwrap_or_default();
    let noise_check = (!job.interrupt.load(Ordering::Relaxed))
        .then(|| {
            let speed = (plan.noise_check, performance.samples_per_second);
            let what = format!("{name}: noise number against true error");
            let tell = |seconds| clock.at(seconds, &what);
            noise_check::check(&app, &settings, &reference.picture, speed, &job.interrupt, tell)
        })
        .flatten();
    Ok(Some(SceneReport {
        name: name.to_owned(),
        width: settings.size.x,
        height: settings.size.y,
        integrator: settings.integrator.name(),
        max_depth: settings.max_depth,
        facts,
        plan,
        performance,
        methods,
        noise_check,
        pictures: Pictures::new(&kept, (&reference.picture, mask), app.world.resource::<Display>()),
        reference: reference.facts,
    }))
}

type Measured = Vec<(&'static Method, Vec<Run>)>;
type Kept = Vec<(&'static str, LinearImage)>;

/// The first runs of all methods, then the second ones and so on, so that an interruption leaves some of
/// each; and of each first run its picture.
fn all_methods(
    subject: &Subject,
    methods: &[&'static Method],
    name: &str,
    plan: &Plan,
    clock: &mut Clock,
) -> (Measured, Kept) {
    let mut measured: Measured = methods.iter().map(|&method| (method, Vec::new())).collect();
    let mut kept = Vec::new();
    for seed in 0..plan.seeds {
        for (method, runs) in &mut measured {
            if subject.interrupt.load(Ordering::Relaxed) {
                return (measured, kept);
            }
            let seconds = plan.run(method.kind(), seed);
            let what = format!("{name}: {}, run {} of {}", method.title, seed + 1, plan.seeds);
            let (run, picture) = run(subject, method, seed, seconds, |s| clock.at(s, &what));
            clock.done += seconds;
            runs.push(run);
            if seed == 0 {
                kept.extend(picture.map(|picture| (method.name, picture)));
            }
        }
    }
    (measured, kept)
}

fn method_reports(measured: Measured, reference_error: impl Fn(Measure) -> Option<f64>) -> Vec<MethodReport> {
    let findings = |runs: &[Run], measure| {
        let curve = curve::curve(runs, measure);
        let slope = curve::slope(&curve, reference_error(measure));
        Findings { curve, slope, seconds_to_random_error: None }
    };
    let mut reports: Vec<MethodReport> = measured
        .into_iter()
        .filter(|(_, runs)| runs.iter().any(|run| !run.points.is_empty()))
        .map(|(method, runs)| MethodReport {
            name: method.name,
            title: method.title,
            changes: method.changes,
            ablation: method.ablation,
            all: findings(&runs, Measure::All),
            surfaces: Some(findings(&runs, Measure::Surfaces)).filter(|found| !found.curve.is_empty()),
            runs,
        })
        .collect();
    let random = reports.iter().find(|m| m.name == RANDOM).cloned();
    let level = |found: &Findings| found.curve.last().map(|last| last.rmse);
    let all = random.as_ref().and_then(|m| level(&m.all));
    let surfaces = random.as_ref().and_then(|m| level(m.surfaces.as_ref()?));
    for method in &mut reports {
        method.all.race_to(all);
        if let Some(found) = &mut method.surfaces {
            found.race_to(surfaces);
        }
    }
    reports
}

/// Folder of the references, in that of the report.
pub const REFERENCES: &str = "references";

fn prepare_folder(folder: &Path) -> Result<(), ReportError> {
    let path = folder.join(REFERENCES);
    std::fs::create_dir_all(&path).map_err(|source| ReportError::Folder { path: path.clone(), source })?;
    // Better now than after ten minutes.
    let probe = folder.join("writable");
    write_whole(&probe, b"")?;
    std::fs::remove_file(&probe).map_err(|source| ReportError::Folder { path: probe, source })
}

/// The scenes' names as file names, each once.
fn names(scenes: &[SceneSource]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for scene in scenes {
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
        let name: String = scene.name().chars().map(plain).collect();
        let taken = names.iter().filter(|other| **other == name).count();
        names.push(if taken == 0 { name } else { format!("{name}-{}", taken + 1) });
    }
    names
}

fn given_references(
    given: &[GivenReference],
    names: &[String],
    size: UVec2,
) -> Result<BTreeMap<String, Reference>, ReportError> {
    let mut found = BTreeMap::new();
    for GivenReference { scene, path } in given {
        let name = match scene {
            Some(scene) => names.iter().find(|name| *name == scene),
            None if names.len() == 1 => names.first(),
            None => None,
        };
        let Some(name) = name else {
            let given = scene.clone().unwrap_or_else(|| path.display().to_string());
            return Err(ReportError::ReferenceScene { given, scenes: names.join(", ") });
        };
        found.insert(name.clone(), reference::given(path, name, size)?);
    }
    Ok(found)
}
