//! Findings → files.

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
        for (axis, ending) in [(Axis::Seconds, "seconds"), (Axis::Samples, "samples")] {
            // A run that was interrupted early has no curve; the page says so in its place.
            if let Ok(svg) = curves(scene, axis) {
                files.push((format!("{}-{ending}.svg", scene.name), svg.into_bytes()));
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

/// Every measurement, one a line.
fn csv(report: &Report) -> String {
    let mut out = String::from("scene,method,seed,samples,seconds,rmse,noise\n");
    for scene in &report.scenes {
        for method in &scene.methods {
            for run in &method.runs {
                for point in &run.points {
                    let noise = point.noise.map(|n| format!("{n:.6e}")).unwrap_or_default();
                    // Into memory: cannot fail.
                    let _ = writeln!(
                        out,
                        "{},{},{},{},{:.6},{:.6e},{noise}",
                        scene.name, method.name, run.seed, point.samples, point.seconds, point.rmse
                    );
                }
            }
        }
    }
    out
}
