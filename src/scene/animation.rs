//! Keyframes that move nodes and morph weights, and the system that plays them.

use super::Transform;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DQuat, DVec3};

/// An animation, on an entity of its own.
#[derive(Component, Clone, Debug, Default)]
pub struct Animation {
    /// What it moves.
    pub channels: Vec<Channel>,
    /// Seconds until it begins anew: time of its last keyframe.
    pub duration: f64,
}

/// One property of one entity over time.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Entity with a [`Pose`] (or with [`MorphWeights`]).
    pub target: Entity,
    /// What of it.
    pub property: Property,
    /// Its values.
    pub curve: Curve,
}

/// What a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    /// Three numbers.
    Translation,
    /// A unit quaternion: x, y, z, w.
    Rotation,
    /// Three numbers.
    Scale,
    /// As many numbers as the mesh has morph targets.
    Weights,
}

/// Values at keyframes and between them.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Seconds, strictly ascending, at least one.
    pub times: Vec<f32>,
    /// `width` numbers a keyframe; thrice as many for [`Interpolation::Cubic`].
    pub values: Vec<f32>,
    /// Numbers of one value, at least 1.
    pub width: usize,
    /// How values lead from one keyframe to the next.
    pub interpolation: Interpolation,
}

/// glTF 2.0 specification, appendix C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the keyframe before.
    Step,
    /// Straight, for rotations along the shortest arc.
    #[default]
    Linear,
    /// Hermite spline; a keyframe has incoming tangent, value and outgoing tangent.
    Cubic,
}

/// The parts of an animated entity's [`Transform`].
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[require(Transform)]
pub struct Pose {
    /// Moved to.
    pub translation: DVec3,
    /// Turned by.
    pub rotation: DQuat,
    /// Scaled by, first of all.
    pub scale: DVec3,
}

/// On what was moved by hand: it stands where it was put, whatever animations say.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByHand;

/// How much of each morph target goes into a [`super::Deform`]ing mesh.
#[derive(Component, Clone, Debug, Default, PartialEq)]
pub struct MorphWeights(pub Vec<f32>);

/// What is played and where it is.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct Playing {
    /// Entities with an [`Animation`]; later ones win where they move the same thing.
    pub animations: Vec<Entity>,
    /// Seconds since the start. Each animation begins anew after its own duration. `None`: everything stands as the file
    /// has it.
    pub time: Option<f64>,
}

/// Puts everything that is animated where it is at the time of [`Playing`].
pub fn play(
    playing: Res<Playing>,
    animations: Query<&Animation>,
    mut poses: Query<(&mut Pose, &mut Transform), Without<ByHand>>,
    mut weights: Query<&mut MorphWeights>,
) {
    let Some(time) = playing.time else { return };
    let mut value = Vec::new();
    for animation in playing.animations.iter().filter_map(|&entity| animations.get(entity).ok()) {
        let time = animation.local_time(time);
        for Channel { target, property, curve } in &animation.channels {
            curve.sample(time, *property == Property::Rotation, &mut value);
            if *property == Property::Weights {
                if let Ok(mut weights) = weights.get_mut(*target) {
                    weights.set_if_neq(MorphWeights(value.clone()));
                }
                continue;
            }
            let Ok((mut pose, mut transform)) = poses.get_mut(*target) else { continue };
            let mut moved = *pose;
            match *value.as_slice() {
                [x, y, z] if *property == Property::Translation => {
                    moved.translation = [x, y, z].map(f64::from).into();
                }
                [x, y, z] if *property == Property::Scale => moved.scale = [x, y, z].map(f64::from).into(),
                [x, y, z, w] => moved.rotation = DQuat::from_array([x, y, z, w].map(f64::from)).normalize(),
                _ => continue,
            }
            if moved.is_finite() && pose.set_if_neq(moved) {
                transform.set_if_neq(Transform::from(moved));
            }
        }
    }
}

impl Animation {
    /// Seconds since it last began, if it plays over and over.
    #[must_use]
    pub fn local_time(&self, time: f64) -> f32 {
        let time = time.max(0.0);
        // At its very end it is not yet at its beginning.
        let wraps = self.duration > 0.0 && time > self.duration;
        (if wraps { time % self.duration } else { time }) as f32
    }
}

impl Pose {
    fn is_finite(&self) -> bool {
        self.translation.is_finite() && self.rotation.is_finite() && self.scale.is_finite()
    }
}

impl From<Pose> for Transform {
    fn from(pose: Pose) -> Self {
        Self(DAffine3::from_scale_rotation_translation(pose.scale, pose.rotation, pose.translation))
    }
}

impl Curve {
    /// The value at `time` seconds, clamped to the ends; `is_rotation`: along the shortest arc.
    pub fn sample(&self, time: f32, is_rotation: bool, value: &mut Vec<f32>) {
        let width = self.width;
        let after = self.times.partition_point(|&key| key <= time);
        let before = after.saturating_sub(1);
        let after = after.min(self.times.len() - 1);
        let span = self.times[after] - self.times[before];
        let t = if span > 0.0 { (time - self.times[before]) / span } else { 0.0 };
        let at = |key: usize, part: usize| {
            let parts = if self.interpolation == Interpolation::Cubic { 3 } else { 1 };
            self.values.get((parts * key + part) * width..).unwrap_or_default()
        };
        value.clear();
        match self.interpolation {
            Interpolation::Step => value.extend(at(before, 0).iter().take(width)),
            Interpolation::Linear if is_rotation && width == 4 => {
                let quaternion = |key| DQuat::from_array(std::array::from_fn(|i| f64::from(at(key, 0)[i])));
                let between = quaternion(before).slerp(quaternion(after), f64::from(t));
                value.extend(between.to_array().map(|x| x as f32));
            }
            Interpolation::Linear => {
                let pairs = at(before, 0).iter().zip(at(after, 0)).take(width);
                value.extend(pairs.map(|(a, b)| a + (b - a) * t));
            }
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let weights = [2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t, 3.0 * t2 - 2.0 * t3, t3 - t2];
                let parts = [at(before, 1), at(before, 2), at(after, 1), at(after, 0)];
                value.extend((0..width).map(|i| {
                    weights[0] * parts[0][i]
                        + weights[1] * span * parts[1][i]
                        + weights[2] * parts[2][i]
                        + weights[3] * span * parts[3][i]
                }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(interpolation: Interpolation, times: &[f32], values: &[f32], width: usize) -> Curve {
        Curve { times: times.to_vec(), values: values.to_vec(), width, interpolation }
    }

    fn at(curve: &Curve, time: f32, is_rotation: bool) -> Vec<f32> {
        let mut value = Vec::new();
        curve.sample(time, is_rotation, &mut value);
        value
    }

    #[test]
    fn steps_and_lines_pass_their_keyframes_and_stay_at_the_ends() {
        let line = curve(Interpolation::Linear, &[1.0, 3.0], &[0.0, 10.0, 4.0, 20.0], 2);
        assert_eq!([0.0, 1.0, 2.0, 3.0, 9.0].map(|t| at(&line, t, false)[0]), [0.0, 0.0, 2.0, 4.0, 4.0]);
        assert_eq!(at(&line, 2.5, false), [3.0, 17.5]);
        let step = Curve { interpolation: Interpolation::Step, ..line };
        assert_eq!([0.0, 2.9, 3.0].map(|t| at(&step, t, false)[1]), [10.0, 10.0, 20.0]);
    }

    #[test]
    fn a_spline_of_a_cubic_is_that_cubic() {
        // x³ has tangents 3 x².
        let f = |x: f32| x * x * x;
        let keys = [0.0, 2.0, 3.0];
        let values: Vec<f32> = keys.iter().flat_map(|&x| [3.0 * x * x, f(x), 3.0 * x * x]).collect();
        let spline = curve(Interpolation::Cubic, &keys, &values, 1);
        for x in [0.0, 0.5, 1.0, 1.9, 2.0, 2.25, 3.0] {
            assert!((at(&spline, x, false)[0] - f(x)).abs() < 1e-4, "{x}");
        }
    }

    #[test]
    fn rotations_take_the_shortest_arc() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        // The second is a quarter turn about y with its sign turned.
        let turn = curve(Interpolation::Linear, &[0.0, 1.0], &[0., 0., 0., 1., 0., -half, 0., -half], 4);
        let [x, y, z, w] = at(&turn, 0.5, true)[..] else { panic!() };
        let eighth = std::f32::consts::FRAC_PI_8;
        assert!((x, z) == (0.0, 0.0) && (y.abs() - eighth.sin()).abs() < 1e-6);
        assert!((w.abs() - eighth.cos()).abs() < 1e-6 && y * w > 0.0);
    }

    #[test]
    fn an_animation_begins_anew_after_its_end() {
        let animation = Animation { channels: Vec::new(), duration: 2.0 };
        assert_eq!([0.5, 2.0, 2.5, -1.0].map(|t| animation.local_time(t)), [0.5, 2.0, 0.5, 0.0]);
    }
}
