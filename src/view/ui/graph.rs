//! Error over time, both logarithmic: this picture's curve, the one before, and where it is heading.

use super::super::instrument::{Graph, Point};
use super::super::status::{duration, percent};
use super::place::Places;
use super::style::{ACCENT, FAINT, LINE, MARGIN, TRUTH};
use super::{card, edit};
use crate::trace::convergence::PowerLaw;
use egui::{
    Align2, Color32, Context, FontId, Painter, Pos2, Rect, RichText, Sense, Shape, Stroke, Vec2, pos2, vec2,
};
use std::ops::RangeInclusive;

/// The plotted part of the plane.
struct Axes {
    rect: Rect,
    /// Decimal logarithms of seconds.
    seconds: RangeInclusive<f64>,
    /// Of relative errors.
    errors: RangeInclusive<f64>,
}

/// Size of the plot in a window.
fn plotted(room: Rect) -> Vec2 {
    vec2(room.width() * 0.36, room.height() * 0.42).clamp(vec2(150.0, 100.0), vec2(420.0, 280.0))
}

/// About how high the whole card is, with what is around the plot.
#[must_use]
pub fn height(room: Rect) -> f32 {
    plotted(room).y + 45.0
}

/// Shows the graph in the lower right corner, where no other card is, beside that of what `is_edited`.
pub fn show(context: &Context, graph: &Graph, is_edited: bool, places: &Places) -> Rect {
    let size = plotted(places.room);
    let beside = (Align2::RIGHT_BOTTOM, vec2(-edit::WIDTH - 2.0 * MARGIN, -MARGIN));
    let corner = (Align2::RIGHT_BOTTOM, vec2(-MARGIN, -MARGIN));
    let edge = places.room.right();
    let top = (Align2::RIGHT_TOP, vec2(-MARGIN, places.reach(edge - size.x, edge, true)));
    let corners =
        [if is_edited { beside } else { corner }, corner, (Align2::LEFT_BOTTOM, vec2(MARGIN, -MARGIN)), top];
    card(context, "graph", places.find(context, "graph", &corners), |ui| {
        ui.horizontal(|ui| {
            ui.label(RichText::new("noise over time").color(ACCENT).small());
            if graph.current.iter().any(|point| point.error.is_some()) {
                ui.label(RichText::new("true error").color(TRUTH).small());
            }
            if !graph.previous.is_empty() {
                ui.label(RichText::new("before").color(FAINT).small());
            }
            if let Some(law) = graph.law {
                ui.label(RichText::new(format!("falls as n^−{:.2}", law.b)).color(FAINT).small());
            }
        });
        let (response, painter) = ui.allocate_painter(size, Sense::hover());
        let rect = response.rect;
        let inner = Rect::from_min_max(rect.min + vec2(34.0, 4.0), rect.max - vec2(6.0, 16.0));
        plot(&painter, Axes::of(graph, inner), graph);
    })
}

/// Where a value lies, in decades.
fn decade(x: f64) -> f64 {
    x.max(1e-12).log10()
}

impl Axes {
    /// Around all points, and some of the way to come.
    fn of(graph: &Graph, rect: Rect) -> Self {
        let points = || graph.current.iter().chain(&graph.previous);
        let range = |values: &mut dyn Iterator<Item = f64>, default: (f64, f64)| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(decade(x)), high.max(decade(x)))
            });
            if low <= high { (low, high) } else { default }
        };
        let (first, last) = range(&mut points().map(|p| p.seconds), (-1.0, 1.0));
        let errors = points().flat_map(|p| [Some(p.noise), p.error]).flatten().filter(|&e| e > 0.0);
        let (least, most) = range(&mut { errors }, (-2.0, 0.0));
        Self {
            rect,
            seconds: first - 0.05..=(last + 0.3).max(first + 1.0),
            errors: (least - 0.2).min(most - 0.6)..=most + 0.1,
        }
    }

    fn place(&self, seconds: f64, error: f64) -> Pos2 {
        let share = |x: f64, range: &RangeInclusive<f64>| {
            ((decade(x) - range.start()) / (range.end() - range.start())) as f32
        };
        let (x, y) = (share(seconds, &self.seconds), share(error, &self.errors));
        pos2(
            self.rect.left() + x * self.rect.width(),
            self.rect.bottom() - y.clamp(-1.0, 2.0) * self.rect.height(),
        )
    }
}

/// 1, 2 and 5 times each power of ten within `range`; whether it is the 1.
fn ticks(range: &RangeInclusive<f64>) -> impl Iterator<Item = (f64, bool)> {
    let (low, high) = (*range.start(), *range.end());
    let decades = (low.floor() as i32)..=(high.ceil() as i32);
    decades
        .flat_map(|d| [1.0, 2.0, 5.0].map(|m| (m * 10f64.powi(d), m == 1.0)))
        .filter(move |(x, _)| (low..=high).contains(&decade(*x)))
}

/// The ticks that are drawn, powers of ten before others: where labels have no room, those stay.
fn rounder_first(range: &RangeInclusive<f64>, sparse: bool) -> Vec<(f64, bool)> {
    let mut all: Vec<(f64, bool)> = ticks(range).filter(|(_, round)| *round || sparse).collect();
    all.sort_by_key(|(_, round)| !round);
    all
}

/// Where labels stand.
#[derive(Default)]
struct Labels(Vec<Rect>);

impl Labels {
    /// Whether a label has room there; then it is taken.
    fn take(&mut self, rect: Rect) -> bool {
        let is_free = !self.0.iter().any(|other| other.intersects(rect));
        if is_free {
            // With some space beside it.
            self.0.push(rect.expand2(vec2(4.0, 0.0)));
        }
        is_free
    }
}

fn plot(painter: &Painter, axes: Axes, graph: &Graph) {
    let clipped = painter.with_clip_rect(axes.rect.expand(1.0));
    let font = FontId::proportional(10.0);
    // Few decades need more words.
    let sparse = |range: &RangeInclusive<f64>| range.end() - range.start() < 2.2;
    let mut labels = Labels::default();
    for (seconds, _) in rounder_first(&axes.seconds, sparse(&axes.seconds)) {
        let x = axes.place(seconds, 1.0).x;
        painter.vline(x, axes.rect.y_range(), Stroke::new(1.0, LINE));
        let text = painter.layout_no_wrap(short_time(seconds), font.clone(), FAINT);
        let rect = Align2::CENTER_TOP.anchor_size(pos2(x, axes.rect.bottom() + 3.0), text.size());
        if labels.take(rect) {
            painter.galley(rect.min, text, FAINT);
        }
    }
    for (error, _) in rounder_first(&axes.errors, sparse(&axes.errors)) {
        let y = axes.place(1.0, error).y;
        painter.hline(axes.rect.x_range(), y, Stroke::new(1.0, LINE));
        let text = painter.layout_no_wrap(percent(error), font.clone(), FAINT);
        let rect = Align2::RIGHT_CENTER.anchor_size(pos2(axes.rect.left() - 4.0, y), text.size());
        if labels.take(rect) {
            painter.galley(rect.min, text, FAINT);
        }
    }
    curve(&clipped, &axes, &graph.previous, |p| Some(p.noise), FAINT.gamma_multiply(0.8));
    if let (Some(law), Some(last)) = (graph.law, graph.current.last()) {
        heading(&clipped, &axes, law, last);
    }
    band(&clipped, &axes, &graph.current);
    curve(&clipped, &axes, &graph.current, |p| Some(p.noise), ACCENT);
    curve(&clipped, &axes, &graph.current, |p| p.error, TRUTH);
    if let Some(last) = graph.current.last() {
        clipped.circle_filled(axes.place(last.seconds, last.noise), 3.0, ACCENT);
    }
}

/// Without the space and the zero: labels stand close.
fn short_time(seconds: f64) -> String {
    if seconds < 1.0 { format!("{seconds} s") } else { duration(seconds).replace(".0", "") }
}

fn curve(
    painter: &Painter,
    axes: &Axes,
    points: &[Point],
    error: impl Fn(&Point) -> Option<f64>,
    color: Color32,
) {
    let line: Vec<Pos2> = points.iter().filter_map(|p| Some(axes.place(p.seconds, error(p)?))).collect();
    painter.add(Shape::line(line, Stroke::new(1.6, color)));
}

/// The interval around each estimate.
fn band(painter: &Painter, axes: &Axes, points: &[Point]) {
    for pair in points.windows(2) {
        let corner = |p: &Point, sign: f64| axes.place(p.seconds, p.noise + sign * p.doubt);
        let [a, b] = [&pair[0], &pair[1]];
        let corners = vec![corner(a, 1.0), corner(b, 1.0), corner(b, -1.0), corner(a, -1.0)];
        painter.add(Shape::convex_polygon(corners, ACCENT.gamma_multiply(0.22), Stroke::NONE));
    }
}

/// On from the last point as the law says.
fn heading(painter: &Painter, axes: &Axes, law: PowerLaw, last: &Point) {
    let speed = last.samples / last.seconds;
    let end = 10f64.powf(*axes.seconds.end());
    let noise = |seconds: f64| law.a * (seconds * speed).powf(-law.b);
    let ends = [axes.place(last.seconds, noise(last.seconds)), axes.place(end, noise(end))];
    painter.add(Shape::dashed_line(&ends, Stroke::new(1.2, ACCENT.gamma_multiply(0.7)), 4.0, 4.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, noise: f64) -> Point {
        Point { seconds, samples: seconds, noise, doubt: 0.1 * noise, error: None }
    }

    #[test]
    fn a_power_law_is_a_straight_line_within_the_axes() {
        let rect = Rect::from_min_size(pos2(10.0, 20.0), vec2(300.0, 200.0));
        let current: Vec<Point> = (0..20).map(|i| 1.3f64.powi(i)).map(|s| point(s, 0.3 / s.sqrt())).collect();
        let graph = Graph { current: current.clone(), ..Graph::default() };
        let axes = Axes::of(&graph, rect);
        let places: Vec<Pos2> = current.iter().map(|p| axes.place(p.seconds, p.noise)).collect();
        assert!(places.iter().all(|p| rect.contains(*p)), "{places:?}");
        let slope = |a: Pos2, b: Pos2| (b.y - a.y) / (b.x - a.x);
        let first = slope(places[0], places[1]);
        assert!(first > 0.0, "down is down");
        assert!(places.windows(2).all(|w| (slope(w[0], w[1]) / first - 1.0).abs() < 1e-2));
    }

    #[test]
    fn ticks_are_round_numbers_inside() {
        let found: Vec<f64> = ticks(&(-1.0..=1.0)).map(|(x, _)| x).collect();
        assert_eq!(found, [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]);
    }

    #[test]
    fn labels_leave_room_for_each_other_and_tens_come_first() {
        let order: Vec<f64> = rounder_first(&(0.0..=1.0), true).into_iter().map(|(x, _)| x).collect();
        assert_eq!(order, [1.0, 10.0, 2.0, 5.0]);
        let mut labels = Labels::default();
        let mut take = |x: f32| labels.take(Rect::from_min_size(pos2(x, 0.0), vec2(20.0, 10.0)));
        assert_eq!([0.0, 15.0, 22.0, 25.0, 60.0].map(&mut take), [true, false, false, true, true]);
    }

    #[test]
    fn no_points_and_odd_ones_have_axes_too() {
        let rect = Rect::from_min_size(Pos2::ZERO, vec2(30.0, 20.0));
        for current in [vec![], vec![point(0.0, 0.0)], vec![point(1.0, f64::NAN)], vec![point(1e300, 1e300)]]
        {
            let axes = Axes::of(&Graph { current, ..Graph::default() }, rect);
            assert!(axes.seconds.start() < axes.seconds.end() && axes.errors.start() < axes.errors.end());
        }
    }
}
