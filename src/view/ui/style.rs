//! One look for all cards.

use egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Frame, Margin, Stroke, TextStyle, Visuals,
    style::ScrollAnimation, vec2,
};

/// Between cards and the border, points.
pub const MARGIN: f32 = 10.0;
/// What is worth reading first.
pub const BRIGHT: Color32 = Color32::from_rgb(244, 244, 246);
/// Names of things, units.
pub const FAINT: Color32 = Color32::from_rgb(156, 160, 170);
/// What is live: this picture's curve, what is selected.
pub const ACCENT: Color32 = Color32::from_rgb(255, 190, 92);
/// What is true: errors against a reference.
pub const TRUTH: Color32 = Color32::from_rgb(104, 208, 232);
/// What to be careful about.
pub const CAUTION: Color32 = Color32::from_rgb(255, 122, 96);
/// Lines between things.
pub const LINE: Color32 = Color32::from_rgba_premultiplied(36, 36, 38, 40);

/// Dark enough for white letters over a white wall.
const CARD: Color32 = Color32::from_rgba_premultiplied(14, 15, 18, 232);

/// The ground that everything stands on.
pub fn frame() -> Frame {
    Frame::new()
        .fill(CARD)
        .corner_radius(CornerRadius::same(7))
        .inner_margin(Margin::symmetric(12, 9))
        .stroke(Stroke::new(1.0, LINE))
}

/// Sets colours, letters and distances.
pub fn apply(context: &Context) {
    let mut visuals = Visuals::dark();
    visuals.override_text_color = Some(BRIGHT);
    visuals.selection.bg_fill = ACCENT.gamma_multiply(0.4);
    context.set_visuals(visuals);
    context.style_mut(|style| {
        style.animation_time = 0.0;
        style.scroll_animation = ScrollAnimation::none();
        style.spacing.item_spacing = vec2(8.0, 4.0);
        // That there is more to see is seen before the mouse is there.
        style.spacing.scroll.dormant_handle_opacity = 0.7;
        let proportional = |size| FontId::new(size, FontFamily::Proportional);
        style.text_styles.insert(TextStyle::Body, proportional(13.0));
        style.text_styles.insert(TextStyle::Button, proportional(13.0));
        style.text_styles.insert(TextStyle::Small, proportional(10.5));
        style.text_styles.insert(TextStyle::Heading, proportional(19.0));
        style.text_styles.insert(TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace));
    });
    // Nothing shall move by itself: the window rests when the picture does.
    context.options_mut(|options| options.zoom_with_keyboard = false);
}
