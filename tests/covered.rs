//! What is not there does not shine, and what is not seen from behind still throws a shadow.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, Vec3};
use penumbra::scene::{Alpha, Light, Material};
use penumbra::trace::Integrator;
use stage::{Estimate, Exact as _, Frames as _, Stage, quad, reds, settings};

const HERE: DAffine3 = DAffine3::IDENTITY;

/// A floor seen from above, below an emissive square of this material that shines down on it.
fn lit_by(material: Material, integrator: Integrator) -> Estimate {
    let mut stage = Stage::new(settings(16, 16, integrator, 1));
    let floor = quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    stage.add_mesh(floor, Material::lambert(Vec3::splat(0.5)), HERE);
    stage.add_mesh(quad(Vec3::new(0.2, -0.5, 1.0), Vec3::Y, Vec3::X), material, HERE);
    stage.look(DVec3::new(-0.4, 0.0, 0.6), DVec3::ZERO, DVec3::Y, 1e-5);
    Estimate::of(&reds(stage.trace(2048)))
}

#[test]
fn a_lamp_shines_as_far_as_it_is_there() {
    let lamp = |alpha, opacity| Material { alpha, opacity, ..Material::emissive(Vec3::ONE) };
    for integrator in [Integrator::Direct, Integrator::Path] {
        let whole = lit_by(lamp(Alpha::Opaque, 1.0), integrator);
        assert!(whole.mean > 0.05, "{whole:?}");
        let quarter = lit_by(lamp(Alpha::Blend, 0.25), integrator);
        quarter.assert_is("a quarter of it", 0.25 * whole.mean, 0.05);
        assert_eq!(lit_by(lamp(Alpha::Mask(0.5), 0.4), integrator).mean, 0.0);
        let masked = lit_by(lamp(Alpha::Mask(0.5), 0.6), integrator);
        masked.assert_is("all of it", whole.mean, 0.05);
    }
}

/// A wall between the eye and a floor, seen from behind; light comes from the eye's side, or from beyond the wall.
fn behind_a_wall(culled: bool, place: DAffine3, light: DVec3, integrator: Integrator) -> f64 {
    let mut stage = Stage::new(settings(8, 8, integrator, 1));
    let floor = quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    stage.add_mesh(floor, Material::lambert(Vec3::ONE), HERE);
    // Its front looks down at the floor.
    let wall = quad(Vec3::new(-0.5, -0.5, 1.0), Vec3::Y, Vec3::X);
    stage.add_mesh(wall, Material { culled, ..Material::lambert(Vec3::ZERO) }, place);
    stage.add(Light::Point { intensity: Vec3::ONE }, DAffine3::from_translation(light));
    stage.look(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 1e-5);
    Estimate::of(&reds(stage.trace(4))).mean
}

#[test]
fn the_eye_sees_through_a_back_that_is_culled_and_light_does_not() {
    // The front of a mirror image is the mirror image of the front.
    let places = [HERE, DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))];
    let each = |integrator| places.map(|place| (integrator, place));
    for (integrator, place) in [Integrator::Direct, Integrator::Path].into_iter().flat_map(each) {
        let (above, below) = (DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, 0.5));
        assert_eq!(behind_a_wall(false, place, below, integrator), 0.0, "the wall is black");
        // Intensity over the distance squared and π.
        let floor = behind_a_wall(true, place, below, integrator);
        assert!((floor - 4.0 / std::f64::consts::PI).abs() < 1e-3, "{floor}");
        assert_eq!(behind_a_wall(true, place, above, integrator), 0.0, "in the wall's shadow");
    }
}
