//! Where cards go, so that none lies over another as long as there is room.

use super::style::MARGIN;
use egui::{Align2, Context, Id, Rect, Vec2, vec2};

/// Windows with less, in points, show one card at a time.
const ROOMY: Vec2 = vec2(520.0, 320.0);

/// What is taken of the window, by cards in the order of their importance.
pub struct Places {
    /// The whole window.
    pub room: Rect,
    taken: Vec<Rect>,
}

/// A corner or border, and how far from it.
pub type Place = (Align2, Vec2);

impl Places {
    /// All free.
    #[must_use]
    pub fn new(context: &Context) -> Self {
        Self { room: context.content_rect(), taken: Vec::new() }
    }

    /// Whether there is room for more than one card.
    #[must_use]
    pub fn is_roomy(&self) -> bool {
        self.room.size().x >= ROOMY.x && self.room.size().y >= ROOMY.y
    }

    /// A card is here.
    pub fn take(&mut self, card: Rect) {
        self.taken.push(card);
    }

    /// How large a card was last.
    #[must_use]
    pub fn size_of(&self, context: &Context, name: &str) -> Vec2 {
        context.memory(|memory| memory.area_rect(Id::new(name))).map_or(Vec2::ZERO, |rect| rect.size())
    }

    /// The first of `places` where the card `name`, as large as it was last, lies over no other; else the first.
    #[must_use]
    pub fn find(&self, context: &Context, name: &str, places: &[Place]) -> Place {
        self.find_clear_of(None, context, name, places)
    }

    /// The same, and if it can be it does not lie over `seen` either.
    #[must_use]
    pub fn find_clear_of(
        &self,
        seen: Option<Rect>,
        context: &Context,
        name: &str,
        places: &[Place],
    ) -> Place {
        let size = self.size_of(context, name);
        let at = |(anchor, offset): &Place| anchor.align_size_within_rect(size, self.room).translate(*offset);
        let mut free = places.iter().filter(|place| {
            let at = at(place);
            self.room.contains_rect(at) && !self.taken.iter().any(|card| card.intersects(at))
        });
        let first = free.clone().next().unwrap_or(&places[0]);
        *free.find(|place| !seen.is_some_and(|seen| seen.intersects(at(place)))).unwrap_or(first)
    }

    /// How far the cards reach down from the top, or up from the bottom if not `from_top`, in the columns between `left` and
    /// `right`, with a margin.
    #[must_use]
    pub fn reach(&self, left: f32, right: f32, from_top: bool) -> f32 {
        let middle = self.room.center().y;
        let within = self.taken.iter().filter(|card| card.left() < right && card.right() > left);
        let reach = |card: &Rect| match (from_top, card.center().y < middle) {
            (true, true) => card.bottom() - self.room.top(),
            (false, false) => self.room.bottom() - card.top(),
            _ => 0.0,
        };
        within.map(reach).fold(0.0, f32::max) + MARGIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn a_card_goes_where_no_other_is() {
        let room = Rect::from_min_max(pos2(0.0, 0.0), pos2(600.0, 400.0));
        let context = Context::default();
        let mut places = Places { room, taken: Vec::new() };
        let corners = [(Align2::LEFT_BOTTOM, vec2(10.0, -10.0)), (Align2::RIGHT_BOTTOM, vec2(-10.0, -10.0))];
        // Its size is not known: nothing is in the way of nothing.
        assert_eq!(places.find(&context, "card", &corners), corners[0]);
        let seen = Rect::from_center_size(pos2(10.0, 390.0), vec2(9.0, 9.0));
        assert_eq!(places.find_clear_of(Some(seen), &context, "card", &corners), corners[1]);
        places.take(Rect::from_min_max(pos2(0.0, 300.0), pos2(200.0, 395.0)));
        assert_eq!(places.find(&context, "card", &corners), corners[1]);
        let seen = |x: f32| Some(Rect::from_center_size(pos2(x, 390.0), vec2(9.0, 9.0)));
        let clear_of = |x: f32| places.find_clear_of(seen(x), &context, "card", &corners);
        assert_eq!([clear_of(300.0), clear_of(590.0)], [corners[1]; 2], "rather over that than over a card");
        places.take(Rect::from_min_max(pos2(400.0, 20.0), pos2(590.0, 100.0)));
        assert_eq!(places.reach(380.0, 590.0, true), 100.0 + MARGIN);
        assert_eq!(places.reach(0.0, 390.0, true), MARGIN);
        assert_eq!(places.reach(0.0, 600.0, false), 100.0 + MARGIN);
    }
}
