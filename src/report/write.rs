//! Findings → files.

use super::curve::Measure;
use super::markdown::markdown;
use super::page::page;
use super::plot::{Axis, curves};
use super::{Report, ReportError};
use crate::image::files::write_whole;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Writes all files to `folder`, each whole or not at all, and returns their paths, the page first.
///
/// # Errors
/// If one cannot be made or written.
pub fn write(report: &Report, folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let mut files: Vec<(String, Vec<u8>)> = vec![
        ("index.html".to_owned(), page(report)?.into_bytes()),
        ("report.md".to_owned(), markdown(report)?.into_bytes()),
        ("report.csv".to_owned(), csv(report).into_bytes()),
        ("report.json".to_owned(), serde_json::to_vec_pretty(report)?),
    ];
    for scene in &report.scenes {
        for measure in scene.measures() {
            for axis in [Axis::Seconds, Axis::Samples] {
                // A run that was interrupted early has no curve; the page says so in its place.
                if let Ok(svg) = curves(scene, axis, measure) {
                    files.push((plot_name(&scene.name, axis, measure), svg.into_bytes()));
                }
            }
        }
        let pictures = &scene.pictures;
        for shown in pictures.shown.iter().chain(&pictures.errors).chain(&pictures.crops) {
            files.push((format!("{}-{}.png", scene.name, shown.name), shown.png.clone()));
        }
    }
    let mut paths = Vec::new();
    for (name, bytes) in files {
        let path = folder.join(name);
        write_whole(&path, &bytes)?;
        paths.push(path);
    }
    Ok(paths)
}

/// File name of a plot.
#[must_use]
pub fn plot_name(scene: &str, axis: Axis, measure: Measure) -> String {
    let over = match axis {
        Axis::Seconds => "seconds",
        Axis::Samples => "samples",
    };
    match measure {
        Measure::All => format!("{scene}-{over}.svg"),
        Measure::Surfaces => format!("{scene}-{over}-surfaces.svg"),
    }
}

/// Every measurement, one a line.
fn csv(report: &Report) -> String {
    let mut out = String::from("scene,method,seed,samples,seconds,rmse,rmse_surfaces,noise\n");
    for scene in &report.scenes {
        for method in &scene.methods {
            for run in &method.runs {
                for point in &run.points {
                    let maybe = |x: Option<f64>| x.map(|x| format!("{x:.6e}")).unwrap_or_default();
                    // Into memory: cannot fail.
                    let _ = writeln!(
                        out,
                        "{},{},{},{},{:.6},{:.6e},{},{}",
                        scene.name,
                        method.name,
                        run.seed,
                        point.samples,
                        point.seconds,
                        point.rmse,
                        maybe(point.rmse_surfaces),
                        maybe(point.noise)
                    );
                }
            }
        }
    }
    out
}
