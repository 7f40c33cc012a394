//! Error curves as SVG.

use super::curve::{CurvePoint, Findings, Measure};
use super::log_axis::{LogAxis, tick};
use super::methods::{OURS, RANDOM};
use super::{MethodReport, ReportError, SceneReport};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// What the error is drawn over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Seconds of tracing.
    Seconds,
    /// Samples per pixel.
    Samples,
}

/// Text and axes; [`for_page`] makes it the colour of the page's text.
const INK: RGBColor = RGBColor(0x22, 0x24, 0x29);
const INK_HEX: &str = "#222429";
const PAPER_HEX: &str = "#FEFEFE";
const PAPER: RGBColor = RGBColor(0xfe, 0xfe, 0xfe);
/// Told apart by those who see few colours, on white and on black: after Okabe and Ito, "Color Universal
/// Design", 2008. Ours gets the strongest.
const COLORS: [(&str, RGBColor); 14] = [
    (RANDOM, RGBColor(0xd5, 0x5e, 0x00)),
    ("stratified", RGBColor(0xcc, 0x79, 0xa7)),
    (OURS, RGBColor(0x1f, 0x83, 0xc4)),
    ("even", RGBColor(0x56, 0xb4, 0xe9)),
    ("shifted", RGBColor(0x00, 0x9e, 0x73)),
    ("random-pixel", RGBColor(0xe6, 0x9f, 0x00)),
    ("random-light", RGBColor(0x8a, 0x8d, 0x93)),
    // More than can be told apart for sure: the tables say it in numbers.
    ("no-shares-again", RGBColor(0x7a, 0x5c, 0xc4)),
    ("no-shafts", RGBColor(0xb0, 0x2a, 0x30)),
    ("no-cuts", RGBColor(0x9a, 0x6b, 0x2f)),
    ("no-warp", RGBColor(0x5f, 0x8f, 0x1d)),
    ("no-solid-angle", RGBColor(0x2b, 0x8c, 0x8c)),
    ("no-light-tree", RGBColor(0xa8, 0x9a, 0x00)),
    ("one-light-sample", RGBColor(0xe0, 0x6a, 0x9a)),
];
const SIZE: (u32, u32) = (780, 440);
const LEGEND_WIDTH: u32 = 168;
const FONT: &str = "sans-serif";

type Plane<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogAxis, LogAxis>>;

/// The curves of all methods, log-log. On white.
///
/// # Errors
/// If it cannot be drawn.
pub fn curves(scene: &SceneReport, axis: Axis, measure: Measure) -> Result<String, ReportError> {
    let mut svg = String::new();
    draw(&mut svg, scene, axis, measure).map_err(ReportError::Plot)?;
    Ok(svg)
}

/// The same for a page: no ground of its own, and text in the page's colour.
#[must_use]
pub fn for_page(svg: &str) -> String {
    svg.replace(&format!("fill=\"{PAPER_HEX}\""), "fill=\"none\"").replace(INK_HEX, "currentColor")
}

fn x_of(axis: Axis, point: &CurvePoint) -> f64 {
    match axis {
        Axis::Seconds => point.seconds,
        Axis::Samples => f64::from(point.samples),
    }
}

fn text<E: std::fmt::Display>(error: E) -> String {
    format!("the curves cannot be drawn: {error}")
}

fn draw(svg: &mut String, scene: &SceneReport, axis: Axis, measure: Measure) -> Result<(), String> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&PAPER).map_err(text)?;
    let (left, legend) = root.split_horizontally(SIZE.0 - LEGEND_WIDTH);
    // Ours last, on top.
    let mut lines: Vec<(&MethodReport, &Findings)> =
        scene.methods.iter().filter_map(|method| Some((method, method.findings(measure)?))).collect();
    lines.sort_by_key(|(method, _)| method.name == OURS);
    let points: Vec<&CurvePoint> =
        lines.iter().flat_map(|(_, found)| &found.curve).filter(|p| p.least > 0.0).collect();
    let xs = || points.iter().map(|p| x_of(axis, p).log10());
    let own = scene.reference.standard_error(measure).filter(|&e| e > 0.0);
    let (x0, x1) = (xs().fold(f64::INFINITY, f64::min), xs().fold(f64::NEG_INFINITY, f64::max));
    let low = points.iter().map(|p| p.least).chain(own).fold(f64::INFINITY, f64::min).log10() - 0.1;
    let high = points.iter().map(|p| p.most).fold(0.0, f64::max).log10() + 0.12;
    if !(x0 < x1 && low < high) {
        return Err(text(format!("{} has fewer than two points", scene.name)));
    }
    let (across, up) = (LogAxis::new(x0, x1), LogAxis::new(low, high));
    let (across_labels, up_labels) = (across.labels(), up.labels());
    let over = match axis {
        Axis::Seconds => "seconds of tracing",
        Axis::Samples => "samples per pixel",
    };
    let title = match measure {
        Measure::All => format!("{}: error over {over}", scene.name),
        Measure::Surfaces => format!("{}: error over {over}, where no light is seen", scene.name),
    };
    let mut chart = ChartBuilder::on(&left)
        .margin(12)
        .caption(title, (FONT, 16).into_font().color(&INK))
        .x_label_area_size(44)
        .y_label_area_size(62)
        .build_cartesian_2d(across, up)
        .map_err(text)?;
    chart
        .configure_mesh()
        .bold_line_style(INK.mix(0.16))
        .light_line_style(INK.mix(0.06))
        .axis_style(INK.mix(0.6))
        .label_style((FONT, 13).into_font().color(&INK))
        .axis_desc_style((FONT, 14).into_font().color(&INK))
        .x_desc(over)
        .y_desc("RMSE")
        .x_labels(across_labels)
        .y_labels(up_labels)
        .x_label_formatter(&|v| tick(*v))
        .y_label_formatter(&|v| tick(*v))
        .draw()
        .map_err(text)?;
    if let Some((_, random)) = lines.iter().find(|(method, _)| method.name == RANDOM) {
        guides(&mut chart, random, axis, (x0, x1), (low, high))?;
    }
    if let Some(own) = own.map(f64::log10) {
        let floor = DashedLineSeries::new([(x0, own), (x1, own)], 2, 4, INK.mix(0.7).stroke_width(1));
        chart.draw_series(floor).map_err(text)?;
        label(&mut chart, "the reference's own error", (x0 + 0.02 * (x1 - x0), own), VPos::Bottom)?;
    }
    for (method, found) in &lines {
        band(&mut chart, style(method).0, found, axis)?;
    }
    for (method, found) in &lines {
        line(&mut chart, method, found, axis)?;
    }
    keys(&legend, scene)?;
    root.present().map_err(text)
}

fn style(method: &MethodReport) -> (RGBColor, u32) {
    let color = COLORS.iter().find(|(name, _)| *name == method.name).map_or(INK, |(_, color)| *color);
    (color, if method.name == OURS { 3 } else { 2 })
}

fn band(chart: &mut Plane, color: RGBColor, found: &Findings, axis: Axis) -> Result<(), String> {
    let shared = || found.curve.iter().filter(|p| p.runs > 1 && p.least > 0.0);
    let upper = shared().map(|p| (x_of(axis, p).log10(), p.most.log10()));
    let lower = shared().rev().map(|p| (x_of(axis, p).log10(), p.least.log10()));
    let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
    chart.draw_series([Polygon::new(outline, color.mix(0.2))]).map_err(text)?;
    Ok(())
}

fn line(chart: &mut Plane, method: &MethodReport, found: &Findings, axis: Axis) -> Result<(), String> {
    let points: Vec<(f64, f64)> = found
        .curve
        .iter()
        .filter(|p| p.rmse > 0.0)
        .map(|p| (x_of(axis, p).log10(), p.rmse.log10()))
        .collect();
    let (color, width) = style(method);
    let pen = color.stroke_width(width);
    if method.ablation {
        chart.draw_series(DashedLineSeries::new(points, 7, 4, pen)).map_err(text)?;
    } else {
        chart.draw_series(LineSeries::new(points, pen)).map_err(text)?;
    }
    Ok(())
}

/// Lines of slope −1/2 and −1 from above the first point of plain random sampling.
fn guides(
    chart: &mut Plane,
    random: &Findings,
    axis: Axis,
    (x0, x1): (f64, f64),
    (low, high): (f64, f64),
) -> Result<(), String> {
    let Some(first) = random.curve.first() else { return Ok(()) };
    let start = (x_of(axis, first).log10(), (first.most.log10() + 0.06).min(high));
    for (slope, name) in [(-0.5, "slope −1/2"), (-1.0, "slope −1")] {
        let end_x = x1.min(start.0 + (low - start.1) / slope);
        let at = |x: f64| (x, start.1 + slope * (x - start.0));
        let pen = INK.mix(0.55).stroke_width(1);
        chart.draw_series(LineSeries::new([start, at(end_x)], pen)).map_err(text)?;
        // To the right of a falling line there is room above it.
        let (x, y) = at(x0 + 0.8 * (end_x - x0));
        let corner = Pos::new(HPos::Left, VPos::Bottom);
        let font = (FONT, 12).into_font().color(&INK.mix(0.8)).pos(corner);
        let shifted = (x + 0.006 * (x1 - x0), y + 0.004 * (high - low));
        chart.draw_series([Text::new(name, shifted, font)]).map_err(text)?;
    }
    Ok(())
}

fn label(chart: &mut Plane, name: &str, at: (f64, f64), vertical: VPos) -> Result<(), String> {
    let font = (FONT, 12).into_font().color(&INK.mix(0.8)).pos(Pos::new(HPos::Left, vertical));
    chart.draw_series([Text::new(name.to_owned(), at, font)]).map_err(text)?;
    Ok(())
}

/// The legend, beside the curves.
fn keys(area: &DrawingArea<SVGBackend, Shift>, scene: &SceneReport) -> Result<(), String> {
    let font = || (FONT, 13).into_font().color(&INK).pos(Pos::new(HPos::Left, VPos::Center));
    for (i, method) in (0..).zip(&scene.methods) {
        let y = 56 + 24 * i;
        let (color, width) = style(method);
        let pen = color.stroke_width(width);
        if method.ablation {
            for x in [4, 15, 26] {
                area.draw(&PathElement::new([(x, y), (x + 7, y)], pen)).map_err(text)?;
            }
        } else {
            area.draw(&PathElement::new([(4, y), (33, y)], pen)).map_err(text)?;
        }
        area.draw(&Text::new(method.title, (41, y), font())).map_err(text)?;
    }
    let y = 56 + 24 * scene.methods.len() as i32;
    let small = (FONT, 12).into_font().color(&INK.mix(0.8)).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new("band: best to worst seed", (4, y + 4), small)).map_err(text)?;
    Ok(())
}
