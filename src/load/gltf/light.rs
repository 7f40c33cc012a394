//! `KHR_lights_punctual` and cameras.

use super::Document;
use crate::load::LightUnits;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Aspect, Camera, Light, Projection};
use glam::Vec3;
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The light of a node, whose numbers are in these units.
pub(super) fn light_of(
    document: &Document<'_>,
    node: &Node,
    units: LightUnits,
    user: &str,
    sink: &mut Sink<'_>,
) -> Result<Option<Light>, LoadError> {
    let Some(named) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
        return Ok(None);
    };
    let lights = document.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let lights = lights.map_or(&[][..], |extension| &extension.lights);
    let light = document.at(lights, &named.light, "light", user)?;
    let file = document.file;
    let place = format!("light {}", named.light.value());
    let Checked::Valid(kind) = light.type_ else {
        sink.ignored(file, &place, "unknown type of light");
        return Ok(None);
    };
    let power = Vec3::from(light.color) * (light.intensity * units.factor(kind == LightType::Directional));
    if !power.is_finite() || power.min_element() < 0.0 {
        sink.ignored(file, &place, "light with a colour or intensity that is negative or not finite");
        return Ok(None);
    }
    if light.range.is_some() {
        sink.approximated(file, &place, "range of a light ignored: it reaches as far as light does");
    }
    Ok(Some(match kind {
        LightType::Point => Light::Point { intensity: power },
        LightType::Directional => Light::Directional { irradiance: power, angle: 0.0 },
        LightType::Spot => {
            let (inner, outer) =
                light.spot.as_ref().map_or((0.0, FRAC_PI_4), |s| (s.inner_cone_angle, s.outer_cone_angle));
            let legal = inner >= 0.0 && inner < outer && outer <= FRAC_PI_2;
            if !legal {
                let what = format!("spot cone angles out of order ({inner}, {outer}), mended");
                sink.repaired(file, &place, what);
            }
            let outer_angle = if outer.is_finite() { outer.clamp(1e-3, FRAC_PI_2) } else { FRAC_PI_4 };
            let inner_angle = if inner.is_finite() { inner.clamp(0.0, outer_angle * 0.999) } else { 0.0 };
            Light::Spot { intensity: power, inner_angle, outer_angle }
        }
    }))
}

/// The camera of a node; odd values are mended with a warning.
pub(super) fn camera_of(
    document: &Document<'_>,
    node: &Node,
    user: &str,
    sink: &mut Sink<'_>,
) -> Result<Option<(String, Camera, Option<Aspect>)>, LoadError> {
    let Some(index) = &node.camera else {
        return Ok(None);
    };
    let camera = document.at(&document.root.cameras, index, "camera", user)?;
    let name = node.name.clone().or_else(|| camera.name.clone());
    let name = name.unwrap_or_else(|| format!("camera {}", index.value()));
    let mut mend = |what: &str| {
        sink.repaired(document.file, &format!("camera {}", index.value()), what);
    };
    let is_shape = |aspect: f32| aspect.is_finite() && aspect > 0.0;
    let mut aspect = None;
    let projection = match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(perspective), _) => {
            let fov = perspective.yfov;
            aspect = perspective.aspect_ratio;
            if aspect.is_some_and(|aspect| !is_shape(aspect)) {
                mend("aspect ratio out of range, ignored");
            }
            if fov > 0.0 && fov < PI {
                Projection::Perspective { vertical_fov: fov }
            } else {
                mend("vertical field of view (yfov) outside 0 to 180 degrees, 45 degrees instead");
                Camera::default().projection
            }
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(orthographic)) => {
            let height = 2.0 * orthographic.ymag.abs();
            aspect = Some((orthographic.xmag / orthographic.ymag).abs());
            if orthographic.ymag > 0.0 && height.is_finite() {
                Projection::Orthographic { height }
            } else if height > 0.0 && height.is_finite() {
                mend("orthographic ymag negative, its magnitude used");
                Projection::Orthographic { height }
            } else {
                mend("orthographic ymag is 0 or not finite, a perspective of 45 degrees instead");
                Camera::default().projection
            }
        }
        _ => {
            mend("unknown type of camera or no values, a perspective of 45 degrees instead");
            Camera::default().projection
        }
    };
    let aspect = aspect.filter(|&aspect| is_shape(aspect)).map(Aspect);
    Ok(Some((name, Camera { projection }, aspect)))
}
