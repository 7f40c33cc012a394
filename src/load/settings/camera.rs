//! The `[camera]` table.

use super::{Check, Settings};
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Camera, Lens, Projection, Transform};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    position: [f64; 3],
    target: [f64; 3],
    up: Option<[f64; 3]>,
    vertical_fov: Option<f32>,
    orthographic_height: Option<f32>,
    lens_radius: Option<f32>,
    focus_distance: Option<f32>,
}

pub(super) fn spawn(
    settings: &Settings,
    table: &Spanned<CameraTable>,
    sink: &mut Sink<'_>,
) -> Result<Entity, LoadError> {
    let camera = table.get_ref();
    let mut check = Check::default();
    let eye = check.point("position", camera.position);
    let target = check.point("target", camera.target);
    let up = check.point("up", camera.up.unwrap_or([0.0, 1.0, 0.0]));
    check.that((target - eye).length() > 0.0, || "position and target are the same point".to_owned());
    check.that(up.length() > 0.0, || "up must not be zero".to_owned());
    let projection = match (camera.vertical_fov, camera.orthographic_height) {
        (Some(_), Some(_)) => {
            check.that(false, || "has both vertical_fov and orthographic_height: give one".to_owned());
            Camera::default().projection
        }
        (None, Some(height)) => {
            Projection::Orthographic { height: check.length("orthographic_height", height) }
        }
        (Some(degrees), None) => {
            check.that(degrees > 0.0 && degrees < 180.0, || {
                format!("vertical_fov must be between 0 and 180 degrees, not {degrees}")
            });
            Projection::Perspective { vertical_fov: degrees.to_radians() }
        }
        (None, None) => Camera::default().projection,
    };
    let lens = match (camera.lens_radius, camera.focus_distance) {
        (Some(radius), focus) => Some(Lens {
            radius: check.length("lens_radius", radius),
            focus: check.length("focus_distance", focus.unwrap_or((target - eye).length() as f32)),
        }),
        (None, Some(_)) => {
            check.that(false, || "has focus_distance but no lens_radius".to_owned());
            None
        }
        (None, None) => None,
    };
    if let Some(problem) = check.problem {
        return Err(settings.broken(table, "[camera]", problem));
    }
    let name = "camera";
    let entity = sink.spawn((Name::new(name), Transform::looking_at(eye, target, up), Camera { projection }));
    if let Some(lens) = lens {
        sink.world.entity_mut(entity).insert(lens);
    }
    sink.report.cameras.insert(0, (name.to_owned(), entity));
    Ok(entity)
}
