//! The `[[light]]` tables.

use super::super::sky;
use super::{Check, Settings};
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Emission, Light, Transform, Visible};
use bevy_ecs::name::Name;
use glam::{DMat3, DVec3, Vec3};
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum LightTable {
    Parallelogram {
        corner: [f64; 3],
        edge_u: [f64; 3],
        edge_v: [f64; 3],
        radiance: Corners,
        #[serde(default)]
        two_sided: bool,
        visible: Option<bool>,
    },
    Disk {
        center: [f64; 3],
        normal: [f64; 3],
        radius: f32,
        radiance: [f32; 3],
        #[serde(default)]
        two_sided: bool,
        visible: Option<bool>,
    },
    Sphere {
        center: [f64; 3],
        radius: f32,
        radiance: [f32; 3],
        visible: Option<bool>,
    },
    Segment {
        from: [f64; 3],
        to: [f64; 3],
        strength: Ends,
        #[serde(default)]
        emission: EmissionName,
    },
    Point {
        position: [f64; 3],
        intensity: [f32; 3],
    },
    Spot {
        position: [f64; 3],
        target: [f64; 3],
        intensity: [f32; 3],
        #[serde(default)]
        inner_angle: f32,
        outer_angle: f32,
    },
    Directional {
        direction: [f64; 3],
        irradiance: [f32; 3],
        #[serde(default)]
        angle: f32,
    },
    Environment {
        radiance: Option<[f32; 3]>,
        image: Option<String>,
        #[serde(default)]
        turn: f32,
    },
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "radiance must be [r, g, b] or four of them")]
pub(super) enum Corners {
    One([f32; 3]),
    Four([[f32; 3]; 4]),
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "strength must be [r, g, b] or two of them")]
pub(super) enum Ends {
    One([f32; 3]),
    Two([[f32; 3]; 2]),
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum EmissionName {
    Isotropic,
    #[default]
    Sine,
}

pub(super) fn spawn(
    settings: &Settings,
    index: usize,
    table: &Spanned<LightTable>,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let mut check = Check::default();
    let (kind, transform, light, visible) = convert(table.get_ref(), &mut check);
    let name = format!("light {index} ({kind})");
    if let Some(problem) = check.problem {
        return Err(settings.broken(table, &name, problem));
    }
    let mut light = light;
    if let Light::Environment { radiance } = light
        && sink.options.sky.is_some()
    {
        let _ = radiance;
        sink.ignored(&settings.file, &name, "another sky was asked for");
        return Ok(());
    }
    if let (LightTable::Environment { image: Some(image), .. }, Light::Environment { radiance }) =
        (table.get_ref(), &light)
    {
        let Some(path) = settings.folder.path(image) else {
            return Err(settings.broken(table, &name, "image: there is no file in a built-in scene"));
        };
        light = Light::Sky { sky: sky::read(&path, sink)?, scale: *radiance };
    }
    let entity = sink.spawn((Name::new(name), transform, light));
    if let Some(visible) = visible {
        sink.world.entity_mut(entity).insert(Visible(visible));
    }
    Ok(())
}

fn convert(table: &LightTable, check: &mut Check) -> (&'static str, Transform, Light, Option<bool>) {
    match table {
        LightTable::Parallelogram { corner, edge_u, edge_v, radiance, two_sided, visible } => {
            let corner = check.point("corner", *corner);
            let (u, v) = (check.point("edge_u", *edge_u), check.point("edge_v", *edge_v));
            check.that(u.cross(v).length() > 0.0, || {
                "has no area: edge_u and edge_v are parallel or zero".to_owned()
            });
            let corners = match radiance {
                Corners::One(all) => [*all; 4],
                Corners::Four(four) => *four,
            };
            let light = Light::Parallelogram {
                edge_u: u.as_vec3(),
                edge_v: v.as_vec3(),
                radiance: corners.map(|corner| check.spectrum("radiance", corner)),
                two_sided: *two_sided,
            };
            ("parallelogram", Transform::from_translation(corner + 0.5 * (u + v)), light, *visible)
        }
        LightTable::Disk { center, normal, radius, radiance, two_sided, visible } => {
            let light = Light::Disk {
                radius: check.length("radius", *radius),
                radiance: check.spectrum("radiance", *radiance),
                two_sided: *two_sided,
            };
            let center = check.point("center", *center);
            ("disk", along(check, center, "normal", *normal), light, *visible)
        }
        LightTable::Sphere { center, radius, radiance, visible } => {
            let light = Light::Sphere {
                radius: check.length("radius", *radius),
                radiance: check.spectrum("radiance", *radiance),
            };
            ("sphere", Transform::from_translation(check.point("center", *center)), light, *visible)
        }
        LightTable::Segment { from, to, strength, emission } => {
            let (from, to) = (check.point("from", *from), check.point("to", *to));
            let half = 0.5 * (to - from);
            check.that(half.length() > 0.0, || "has no length: from and to are the same point".to_owned());
            let axis = half.try_normalize().unwrap_or(DVec3::X);
            let (y, z) = axis.any_orthonormal_pair();
            let ends = match strength {
                Ends::One(both) => [*both; 2],
                Ends::Two(ends) => *ends,
            };
            let light = Light::Segment {
                half_length: half.length() as f32,
                strength: ends.map(|end| check.spectrum("strength", end)),
                emission: match emission {
                    EmissionName::Isotropic => Emission::Isotropic,
                    EmissionName::Sine => Emission::Sine,
                },
            };
            let mut transform = Transform::from_translation(0.5 * (from + to));
            transform.0.matrix3 = DMat3::from_cols(axis, y, z);
            ("segment", transform, light, None)
        }
        LightTable::Point { position, intensity } => {
            let light = Light::Point { intensity: check.spectrum("intensity", *intensity) };
            ("point", Transform::from_translation(check.point("position", *position)), light, None)
        }
        LightTable::Spot { position, target, intensity, inner_angle, outer_angle } => {
            let position = check.point("position", *position);
            let target = check.point("target", *target);
            check.that(position != target, || "position and target are the same point".to_owned());
            check.that(*inner_angle >= 0.0 && inner_angle <= outer_angle && *outer_angle <= 90.0, || {
                format!("angles must be 0 <= inner_angle <= outer_angle <= 90 degrees, not {inner_angle} and {outer_angle}")
            });
            let light = Light::Spot {
                intensity: check.spectrum("intensity", *intensity),
                inner_angle: inner_angle.to_radians(),
                outer_angle: outer_angle.to_radians(),
            };
            ("spot", Transform::looking_at(position, target, DVec3::Y), light, None)
        }
        LightTable::Directional { direction, irradiance, angle } => {
            check.that((0.0..=180.0).contains(angle), || {
                format!("angle must be within 0 to 180 degrees, not {angle}")
            });
            let light = Light::Directional {
                irradiance: check.spectrum("irradiance", *irradiance),
                angle: angle.to_radians(),
            };
            ("directional", along(check, DVec3::ZERO, "direction", *direction), light, None)
        }
        LightTable::Environment { radiance, image, turn } => {
            check.that(radiance.is_some() || image.is_some(), || "needs a radiance or an image".to_owned());
            let radiance: Vec3 = check.spectrum("radiance", radiance.unwrap_or([1.0; 3]));
            check.that(turn.is_finite(), || "turn must be finite".to_owned());
            let mut transform = Transform::default();
            transform.0.matrix3 = DMat3::from_rotation_y(f64::from(*turn).to_radians());
            ("environment", transform, Light::Environment { radiance }, None)
        }
    }
}

/// At `place`, local −Z along `direction`.
fn along(check: &mut Check, place: DVec3, key: &str, direction: [f64; 3]) -> Transform {
    let direction = check.point(key, direction);
    check.that(direction.length() > 0.0, || format!("{key} must not be zero"));
    Transform::looking_at(place, place + direction.normalize_or(DVec3::NEG_Z), DVec3::Y)
}
