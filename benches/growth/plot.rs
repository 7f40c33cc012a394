//! Three panels, log-log: time to build, memory, speed.

use super::{Growth, Point};
use penumbra::report::log_axis::{LogAxis, tick};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::path::Path;

const SIZE: (u32, u32) = (1140, 430);
const INK: RGBColor = RGBColor(0x22, 0x24, 0x29);
const FONT: &str = "sans-serif";
/// Told apart by those who see few colours: after Okabe and Ito, "Color Universal Design", 2008.
const COLORS: [RGBColor; 3] =
    [RGBColor(0x1f, 0x83, 0xc4), RGBColor(0xd5, 0x5e, 0x00), RGBColor(0x00, 0x9e, 0x73)];

type Value = fn(&Point) -> f64;

/// What a panel shows, by name.
struct Panel {
    title: &'static str,
    lines: &'static [(&'static str, Value)],
    /// From and to, as powers of ten.
    range: (f64, f64),
    /// Where the curves leave room for the legend: above those that rise, below those that fall.
    legend_above: bool,
}

const PANELS: [Panel; 3] = [
    Panel {
        title: "seconds to build",
        lines: &[("1 thread", |p| p.build_seconds[0]), ("2 threads", |p| p.build_seconds[1])],
        range: (-4.5, 1.5),
        legend_above: true,
    },
    Panel {
        title: "bytes per triangle",
        lines: &[("finished", |p| p.bytes), ("most while building", |p| p.peak_bytes)],
        range: (1.4, 3.0),
        legend_above: true,
    },
    Panel {
        title: "million rays a second, 1 thread",
        lines: &[("primary", |p| p.rays[0]), ("shadow", |p| p.rays[1]), ("bounce", |p| p.rays[2])],
        range: (-1.6, 2.4),
        legend_above: false,
    },
];

/// Writes `assets/pictures/growth.svg`.
///
/// # Errors
/// If they can't be drawn or written.
pub fn write(all: &[Growth]) -> Result<(), Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/pictures/growth.svg");
    let mut svg = String::new();
    draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(), all)?;
    std::fs::write(path, svg)?;
    Ok(())
}

fn draw<B: DrawingBackend>(root: &DrawingArea<B, Shift>, all: &[Growth]) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((1, 3)).iter().zip(&PANELS) {
        draw_panel(area, panel, all)?;
    }
    root.present()?;
    Ok(())
}

fn draw_panel<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    panel: &Panel,
    all: &[Growth],
) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let most = all.iter().flat_map(|growth| &growth.points).map(|point| point.triangles).max().unwrap_or(1);
    let text = |size: f64| (FONT, size).into_font().color(&INK);
    let (across, up) =
        (LogAxis::new(2.9, (most as f64).log10() + 0.1), LogAxis::new(panel.range.0, panel.range.1));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .caption(panel.title, text(16.0))
        .x_label_area_size(38)
        .y_label_area_size(50)
        .build_cartesian_2d(across, up)?;
    chart
        .configure_mesh()
        .bold_line_style(INK.mix(0.16))
        .light_line_style(INK.mix(0.06))
        .axis_style(INK.mix(0.6))
        .label_style(text(13.0))
        .x_desc("triangles")
        .x_label_formatter(&|&place| count(place))
        .y_label_formatter(&|&place| tick(place))
        .draw()?;
    let mut keys = Vec::new();
    for (number, growth) in all.iter().enumerate() {
        for (&(name, value), color) in panel.lines.iter().zip(COLORS) {
            let points: Vec<(f64, f64)> =
                growth.points.iter().map(|p| ((p.triangles as f64).log10(), value(p).log10())).collect();
            let pen = color.stroke_width(2);
            if number == 0 {
                chart.draw_series(LineSeries::new(points.clone(), pen))?;
            } else {
                chart.draw_series(DashedLineSeries::new(points.clone(), 6, 4, pen))?;
            }
            chart.draw_series(points.iter().map(|&at| Circle::new(at, 3, color.filled())))?;
            keys.push((format!("{}, {name}", growth.name), color, number > 0));
        }
    }
    let plot = chart.plotting_area().strip_coord_spec();
    for (i, (name, color, dashed)) in (0..).zip(keys) {
        let height = plot.dim_in_pixel().1 as i32;
        let y = if panel.legend_above { 12 } else { height - 100 } + 17 * i;
        let pieces: &[(i32, i32)] = if dashed { &[(10, 16), (20, 26), (30, 36)] } else { &[(10, 36)] };
        for &(from, to) in pieces {
            plot.draw(&PathElement::new([(from, y), (to, y)], color.stroke_width(2)))?;
        }
        plot.draw(&Text::new(name, (42, y), text(13.0).pos(Pos::new(HPos::Left, VPos::Center))))?;
    }
    Ok(())
}

/// The number of triangles at a logarithm.
fn count(place: f64) -> String {
    let number = 10f64.powf(place).round();
    if number < 1e6 { format!("{}k", number / 1e3) } else { format!("{}M", number / 1e6) }
}
