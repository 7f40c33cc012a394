//! The tables, once for Markdown and page alike.

use super::curve::{FIT_FROM, Measure, TRUSTED};
use super::measure::{MOMENTS, NOISE_LEVELS, PICTURE_SAMPLES};
use super::methods::{OURS, RANDOM};
use super::reference::Origin;
use super::statistics::value_at;
use super::{MethodReport, Report, SceneReport};

/// Rows of text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Names of the columns; the first one says what a row is.
    pub head: Vec<String>,
    /// As long as the head, each.
    pub rows: Vec<Vec<String>>,
    /// What else has to be said, below.
    pub notes: Vec<String>,
}

/// What stands where nothing was measured.
pub const NOTHING: &str = "–";
/// Marks an error that the reference is not good enough for.
const LIMITED: &str = " †";

/// What only some scenes pay for.
const FEATURES: [&str; 4] = ["mirror rays", "texture lookups", "alpha tests", "choices among many lights"];

/// Three significant digits.
#[must_use]
pub fn figure(x: f64) -> String {
    let magnitude = if x == 0.0 { 0 } else { x.abs().log10().floor() as i32 };
    match magnitude {
        -3..=2 => format!("{x:.*}", (2 - magnitude) as usize),
        3..=6 => format!("{x:.0}"),
        _ => format!("{x:.2e}"),
    }
}

fn maybe(x: Option<f64>) -> String {
    x.map_or_else(|| NOTHING.to_owned(), figure)
}

/// An error, marked if the reference's own is not far below it.
fn error(rmse: Option<f64>, reference: Option<f64>) -> String {
    let limited = rmse.zip(reference).is_some_and(|(rmse, own)| rmse < TRUSTED * own);
    maybe(rmse) + if limited { LIMITED } else { "" }
}

/// Rows are figures, columns are scenes.
#[must_use]
pub fn performance(report: &Report) -> Table {
    let scenes = &report.scenes;
    let mut table = Table { head: vec![String::new()], ..Table::default() };
    table.head.extend(scenes.iter().map(|scene| scene.name.clone()));
    let mut row = |name: &str, of: &dyn Fn(&SceneReport) -> String| {
        let cells = scenes.iter().map(of);
        table.rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    };
    row("picture", &|s| format!("{}×{}, {}", s.width, s.height, s.integrator));
    row("triangles", &|s| s.facts.triangles.to_string());
    row("BVH levels, instances + mesh", &|s| format!("{} + {}", s.facts.top_levels, s.facts.mesh_levels));
    row("largest leaf, triangles", &|s| s.facts.largest_leaf.to_string());
    row("build, ms", &|s| figure(s.facts.build_ms));
    row("hierarchy with triangles, MB", &|s| figure(s.facts.hierarchy_bytes as f64 * 1e-6));
    row("time to first picture, s", &|s| figure(s.facts.seconds_to_first_picture));
    for (i, level) in NOISE_LEVELS.iter().enumerate() {
        let name = format!("time to noise {:.0} %, s", level * 100.0);
        row(&name, &|s| maybe(s.performance.seconds_to_noise[i]));
    }
    row("samples per pixel and second", &|s| figure(s.performance.samples_per_second));
    row("camera rays, million/s", &|s| figure(s.performance.camera_rays_per_second * 1e-6));
    row("shadow rays, million/s", &|s| figure(s.performance.shadow_rays_per_second * 1e-6));
    row("bounce rays, million/s", &|s| figure(s.performance.bounce_rays_per_second * 1e-6));
    for (i, name) in FEATURES.iter().enumerate() {
        row(&format!("{name}, for each camera ray"), &|s| match s.performance.features_per_camera_ray[i] {
            0.0 => "0".to_owned(),
            some => figure(some),
        });
    }
    for (i, moment) in MOMENTS.iter().enumerate() {
        let name = format!("RMSE after {moment} s");
        row(&name, &|s| error(s.performance.rmse_after[i], s.reference.standard_error(Measure::All)));
    }
    row("reference's own standard error", &|s| maybe(s.reference.standard_error(Measure::All)));
    if scenes.iter().any(|s| s.measures().contains(&Measure::Surfaces)) {
        let own = |s: &SceneReport| s.reference.standard_error(Measure::Surfaces);
        for (i, moment) in MOMENTS.iter().enumerate() {
            let name = format!("RMSE after {moment} s, where no light is seen");
            row(&name, &|s| error(s.performance.rmse_surfaces_after[i], own(s)));
        }
        row("reference's own, where no light is seen", &|s| maybe(own(s)));
    }
    row("reference, samples per pixel", &|s| match (s.reference.made, s.reference.origin) {
        (Some(made), Origin::Cached) => format!("{} (from an earlier report)", made.samples),
        (Some(made), _) => made.samples.to_string(),
        (None, _) => format!("given: {}", s.reference.file),
    });
    row("noise number / true error", &|s| {
        s.noise_check
            .as_ref()
            .map_or_else(|| NOTHING.to_owned(), |check| format!("{:.3} ± {:.3}", check.mean, check.deviation))
    });
    table.notes.push(
        "Of our own method, from its longest run. Times are of tracing alone, but for the first picture, which \
         counts from opening the file. RMSE is the root of the mean over pixels and channels of the squared \
         linear difference to the reference."
            .to_owned(),
    );
    if table.rows.iter().flatten().any(|cell| cell.ends_with(LIMITED)) {
        table.notes.push(format!(
            "† less than {TRUSTED} times the reference's own standard error (from its two halves): limited by it."
        ));
    }
    table
}

/// A row for each method.
#[must_use]
pub fn methods(scene: &SceneReport, measure: Measure) -> Table {
    let own = scene.reference.standard_error(measure);
    let random = scene.method(RANDOM).and_then(|m| m.findings(measure));
    let level = random.and_then(|found| Some(found.curve.last()?.rmse));
    let slowest = random.and_then(|found| found.seconds_to_random_error);
    let head = [
        "method".to_owned(),
        "slope over samples".to_owned(),
        format!("RMSE at {PICTURE_SAMPLES} samples"),
        "best – worst seed".to_owned(),
        "RMSE after 1 s".to_owned(),
        format!("s to RMSE {}", maybe(level)),
        "times as fast as plain random".to_owned(),
    ];
    let row = |method: &MethodReport| {
        let found = method.findings(measure)?;
        let at = found.curve.iter().find(|p| p.samples == PICTURE_SAMPLES);
        let over_time: Vec<(f64, f64)> = found.curve.iter().map(|p| (p.seconds, p.rmse)).collect();
        Some(vec![
            method.title.to_owned(),
            found.slope.map_or_else(
                || NOTHING.to_owned(),
                |fit| format!("{:.3} ± {:.3}", fit.slope, fit.standard_error).replace('-', "−"),
            ),
            error(at.map(|p| p.rmse), own),
            at.map_or_else(|| NOTHING.to_owned(), |p| format!("{} – {}", figure(p.least), figure(p.most))),
            error(value_at(&over_time, 1.0), own),
            maybe(found.seconds_to_random_error),
            maybe(slowest.zip(found.seconds_to_random_error).map(|(slow, own)| slow / own)),
        ])
    };
    let mut notes: Vec<String> =
        scene.methods.iter().map(|method| format!("{}: {}.", method.title, method.changes)).collect();
    let runs = scene.method(OURS).map_or(0, |m| m.runs.len());
    notes.push(format!(
        "{runs} seeds, root mean square over them. Slopes are fitted in log-log from {FIT_FROM} samples on, where the error \
         is at least {TRUSTED} times the reference's own; ± is the standard error of the fit."
    ));
    Table { head: head.to_vec(), rows: scene.methods.iter().filter_map(row).collect(), notes }
}

/// A row for each scene.
#[must_use]
pub fn noise(report: &Report) -> Table {
    let head =
        ["scene", "runs", "samples", "true error", "ratio: mean", "spread of one run", "5 % – 50 % – 95 %"];
    let row = |scene: &SceneReport| {
        let check = scene.noise_check.as_ref()?;
        let [low, middle, high] = check.percentiles;
        Some(vec![
            scene.name.clone(),
            check.runs.to_string(),
            check.samples.to_string(),
            format!("{:.2} %", check.true_error * 100.0),
            format!("{:.3} ± {:.3}", check.mean, check.mean_error),
            format!("± {:.3}", check.deviation),
            format!("{low:.3} – {middle:.3} – {high:.3}"),
            format!("{:.3}", check.unweighted),
        ])
    };
    let note = "The noise number, which the program tells without a reference, over the true error in the same \
                measure. 1 is right; ± behind the mean is its standard error, the spread one standard deviation. \
                True errors are relative to the reference's brightness; the noise number knows only the picture's own, \
                which is too high just where a pixel met more light than it should have, and too low where it met \
                none. Without such weights (last column: root mean squares over all runs) the two must agree.";
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: report.scenes.iter().filter_map(row).collect(),
        notes: vec![note.to_owned()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits() {
        for (x, text) in [
            (0.0, "0.00"),
            (0.001_234, "0.00123"),
            (1.0, "1.00"),
            (37.84, "37.8"),
            (968.0, "968"),
            (12_345.6, "12346"),
            (4.2e-5, "4.20e-5"),
        ] {
            assert_eq!(figure(x), text);
        }
    }

    #[test]
    fn an_error_near_the_reference_s_own_is_marked() {
        assert_eq!(error(Some(0.1), Some(0.02)), "0.100");
        assert_eq!(error(Some(0.1), Some(0.03)), "0.100 †");
        assert_eq!(error(Some(0.1), None), "0.100");
        assert_eq!(error(None, Some(0.1)), NOTHING);
    }
}
