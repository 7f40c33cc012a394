//! Where in the picture things to edit are that cannot be seen there, and what is selected.

use super::super::debug::boxes::Placed;
use super::super::debug::layer::Line;
use super::Editor;
use crate::scene::{GlobalTransform, Light, Visible};
use crate::sync::{Entities, RenderOrigin};
use crate::trace::{Geometry, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{DAffine3, UVec2, Vec3};

/// Pixels from the middle of a mark to its corners.
const RADIUS: f32 = 5.0;
/// Of a group with more things only so many are marked.
const MOST_BOXES: usize = 256;
const SELECTED: [u8; 3] = [255, 190, 92];
const OTHER: [u8; 3] = [104, 208, 232];

/// What is marked while something is selected.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// Lamps from end to end, and their colours.
    lamps: Vec<([Vec3; 2], [u8; 3])>,
    /// Around the selected instance, or those of a group.
    around: Vec<Line>,
}

impl Marks {
    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lamps.is_empty() && self.around.is_empty()
    }

    /// A diamond at each end, of one size wherever it is seen from.
    #[must_use]
    pub fn lines(&self, viewpoint: &Viewpoint, size: UVec2) -> Vec<Line> {
        let sheet = viewpoint.sheet(size);
        let mut lines = self.around.clone();
        for &(ends, color) in &self.lamps {
            let mut add = |a: Vec3, b: Vec3| lines.push(Line { ends: [a, b], color, alpha: 1.0 });
            add(ends[0], ends[1]);
            for end in ends {
                let pixel = sheet.pixel(sheet.own(end).z.max(0.0));
                let [right, up] = [0, 1].map(|row| sheet.axes.row(row) * pixel * RADIUS);
                for [a, b] in [[right, up], [up, -right], [-right, -up], [-up, right]] {
                    add(end + a, end + b);
                }
            }
        }
        lines
    }
}

/// Both ends of a lamp that no ray meets, in render space; one twice, if it has no length.
pub(super) fn ends_of(light: &Light, visible: Option<&Visible>, placed: &DAffine3) -> Option<[Vec3; 2]> {
    let half = match light {
        Light::Point { .. } | Light::Spot { .. } => Vec3::ZERO,
        Light::Segment { half_length, .. } => Vec3::X * *half_length,
        Light::Parallelogram { .. } | Light::Disk { .. } | Light::Sphere { .. } => {
            visible.filter(|visible| !visible.0).map(|_| Vec3::ZERO)?
        }
        Light::Directional { .. } | Light::Environment { .. } | Light::Sky { .. } => return None,
    };
    Some([-half, half].map(|end| placed.transform_point3(end.as_dvec3()).as_vec3()))
}

/// Marks the selected thing, and with it all lamps that no ray meets.
pub fn mark(
    editor: Res<Editor>,
    origin: Res<RenderOrigin>,
    geometry: Res<Geometry>,
    entities: Res<Entities>,
    lamps: Query<(Entity, &Light, &GlobalTransform, Option<&Visible>)>,
    parents: Query<&ChildOf>,
    mut marks: ResMut<Marks>,
) {
    let mut wanted = Marks::default();
    if let Some(selected) = editor.selected.map(|selection| selection.entity) {
        // What is selected; if that is a group, all in it.
        let is_group = !lamps.contains(selected) && !entities.instances.contains(&selected);
        let is_of = |top: Entity, entity: Entity| {
            entity == top || (is_group && parents.iter_ancestors(entity).any(|above| above == top))
        };
        for (entity, light, global, visible) in &lamps {
            let is_selected = is_of(selected, entity);
            let visible = if is_selected { Some(&Visible(false)) } else { visible };
            if let Some(ends) = ends_of(light, visible, &origin.render_from(global)) {
                wanted.lamps.push((ends, if is_selected { SELECTED } else { OTHER }));
            }
        }
        let instances = entities.instances.iter().zip(geometry.tlas.placements());
        let ours = instances.filter(|(instance, _)| is_of(selected, **instance));
        for (_, placement) in ours.take(MOST_BOXES) {
            let placed = Placed { bounds: placement.blas().bounds(), placement: Some(placement) };
            wanted.around.extend(placed.lines(SELECTED, 0.6));
        }
    }
    marks.set_if_neq(wanted);
}
