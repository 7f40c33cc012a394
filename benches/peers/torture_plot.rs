//! Speed against leaks, both by powers of ten.

use crate::Row;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const INK: RGBColor = RGBColor(0x22, 0x24, 0x29);
const OURS: RGBColor = RGBColor(0x1f, 0x83, 0xc4);
const THEIRS: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
/// Where none is drawn: a power of ten below one.
const NONE: f64 = 0.1;

/// As SVG.
pub fn plot(rows: &[Row]) -> String {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (860, 520)).into_drawing_area();
        root.fill(&RGBColor(0xfe, 0xfe, 0xfe)).expect("filled");
        let speeds = || rows.iter().map(|r| r.speed[0]);
        let (low, high) = (speeds().fold(f64::INFINITY, f64::min) * 0.7, speeds().fold(0.0, f64::max) * 1.5);
        let most = rows.iter().map(|r| r.leaks[1]).fold(10.0, f64::max) * 20.0;
        let mut chart = ChartBuilder::on(&root)
            .margin(14)
            .caption("Rays per second against leaks", ("sans-serif", 17).into_font().color(&INK))
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d((0.05..most).log_scale(), (low..high).log_scale())
            .expect("axes");
        chart
            .configure_mesh()
            .bold_line_style(INK.mix(0.16))
            .light_line_style(INK.mix(0.05))
            .label_style(("sans-serif", 13).into_font().color(&INK))
            .x_desc("leaks per 10^7 rays aimed at edges and corners of closed meshes (0 at the left)")
            .y_desc("million rays per second, nearest hit, one thread")
            .x_label_formatter(&|x| if *x <= NONE * 1.01 { "0".to_owned() } else { format!("{x}") })
            .y_label_formatter(&|y| format!("{y}"))
            .draw()
            .expect("mesh");
        // Names that would lie on each other are moved apart.
        let mut names: Vec<(f64, f64)> = Vec::new();
        let mut order: Vec<&Row> = rows.iter().filter(|row| row.leaks[1].is_finite()).collect();
        order.sort_by(|a, b| b.speed[0].total_cmp(&a.speed[0]));
        for row in order {
            let color = if row.name.starts_with("penumbra") { OURS } else { THEIRS };
            let at = (row.leaks[1].max(NONE), row.speed[0]);
            chart.draw_series([Circle::new(at, 5, color.filled())]).expect("a point");
            let mut name = (at.0 * 1.25, at.1);
            while names.iter().any(|n| (n.0 / name.0).ln().abs() < 3.0 && (n.1 / name.1).ln().abs() < 0.09) {
                name.1 *= 0.97;
            }
            names.push(name);
            let font = ("sans-serif", 13).into_font().color(&INK).pos(Pos::new(HPos::Left, VPos::Center));
            chart.draw_series([Text::new(row.name.clone(), name, font)]).expect("a name");
        }
        root.present().expect("drawn");
    }
    svg
}
