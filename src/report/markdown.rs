//! The findings as Markdown.

use super::curve::Measure;
use super::plot::Axis;
use super::tables::{self, Table};
use super::write::plot_name;
use super::{Report, ReportError, SceneReport};
use std::fmt::Write;

/// `report.md`.
///
/// # Errors
/// Never: writing to memory.
pub fn markdown(report: &Report) -> Result<String, ReportError> {
    let mut out = String::new();
    write_report(&mut out, report).map_err(|error| ReportError::Plot(error.to_string()))?;
    Ok(out)
}

fn write_report(out: &mut String, report: &Report) -> std::fmt::Result {
    let machine = &report.machine;
    writeln!(out, "# Penumbra {}: speed and error\n", report.version)?;
    writeln!(
        out,
        "Measured on {}, {} threads, {} ({}).\n",
        machine.processor, machine.threads, machine.isa, machine.system
    )?;
    if report.interrupted {
        writeln!(out, "**Interrupted: not everything was measured.**\n")?;
    }
    write_table(out, &tables::performance(report))?;
    for scene in &report.scenes {
        write_scene(out, scene)?;
    }
    writeln!(out, "## Is the noise number right?\n")?;
    write_table(out, &tables::noise(report))
}

fn write_scene(out: &mut String, scene: &SceneReport) -> std::fmt::Result {
    let name = &scene.name;
    writeln!(out, "## {name}\n")?;
    for measure in scene.measures() {
        if measure == Measure::Surfaces {
            writeln!(out, "### Where no light is seen\n")?;
        }
        for axis in [Axis::Seconds, Axis::Samples] {
            writeln!(out, "![error curves]({})\n", plot_name(name, axis, measure))?;
        }
        write_table(out, &tables::methods(scene, measure))?;
    }
    let pictures = &scene.pictures;
    for shown in pictures.shown.iter().chain(&pictures.errors).chain(&pictures.crops) {
        writeln!(out, "![{}]({name}-{}.png)", shown.title, shown.name)?;
    }
    if let Some(scale) = pictures.scale {
        writeln!(
            out,
            "\nError maps: black {:.0e} and less, white {:.0e} and more, logarithmic between. Crops: ours, \
             reference, error, around the worst pixels {:?}.\n",
            scale.most * 10f64.powi(-super::false_color::DECADES),
            scale.most,
            pictures.worst
        )?;
    }
    Ok(())
}

fn write_table(out: &mut String, table: &Table) -> std::fmt::Result {
    let line = |cells: &[String]| {
        let escaped: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
        format!("| {} |", escaped.join(" | "))
    };
    writeln!(out, "{}", line(&table.head))?;
    writeln!(out, "|{}", "---|".repeat(table.head.len()))?;
    for row in &table.rows {
        writeln!(out, "{}", line(row))?;
    }
    writeln!(out)?;
    for note in &table.notes {
        writeln!(out, "- {note}")?;
    }
    writeln!(out)
}
