//! What the colours of the picture stand for.

use super::super::pixel_view::Legend;
use super::card;
use super::place::Place;
use super::style::FAINT;
use crate::report::false_color::COLORS;
use egui::{Color32, Context, Mesh, Rect, RichText, Sense, Shape, Ui, pos2, vec2};

/// Shows the legend.
pub fn show(context: &Context, legend: &Legend, place: Place) -> Rect {
    card(context, "legend", place, |ui| {
        ui.label(legend.title);
        if let Some(count) = &legend.count {
            ui.label(RichText::new(count).color(FAINT).small());
        }
        if let Some([low, high]) = &legend.range {
            ui.horizontal(|ui| {
                ui.label(RichText::new(low).color(FAINT).small());
                bar(ui, if legend.title == "depth" { &GREYS } else { &COLORS });
                ui.label(RichText::new(high).color(FAINT).small());
            });
        }
    })
}

/// From near to far.
const GREYS: [[u8; 3]; 2] = [[255; 3], [35; 3]];

fn bar(ui: &mut Ui, colors: &[[u8; 3]]) {
    let (rect, _) = ui.allocate_exact_size(vec2(120.0, 9.0), Sense::hover());
    let mut mesh = Mesh::default();
    for (i, &[r, g, b]) in colors.iter().enumerate() {
        let x = egui::lerp(rect.x_range(), i as f32 / (colors.len() - 1) as f32);
        let color = Color32::from_rgb(r, g, b);
        mesh.colored_vertex(pos2(x, rect.top()), color);
        mesh.colored_vertex(pos2(x, rect.bottom()), color);
        if i > 0 {
            let last = 2 * i as u32;
            mesh.add_triangle(last - 2, last - 1, last);
            mesh.add_triangle(last, last - 1, last + 1);
        }
    }
    ui.painter().add(Shape::mesh(mesh));
}
