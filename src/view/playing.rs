//! The scene's animations, played.

use super::controls::{Notice, Notices};
use super::input::Input;
use super::keymap::Tap;
use crate::scene::Playing;
use bevy_ecs::prelude::*;
use std::time::Instant;

/// Seconds of one step: films have 24 pictures a second.
const STEP: f64 = 1.0 / 24.0;

/// Whether the animations run, and since when the time they show is right.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Clock {
    since: Option<Instant>,
}

impl Clock {
    /// As this one, without the time that has passed: another world shows what this one did.
    #[must_use]
    pub fn restarted(self) -> Self {
        Self { since: self.since.map(|_| Instant::now()) }
    }

    /// Whether they run.
    #[must_use]
    pub fn runs(self) -> bool {
        self.since.is_some()
    }
}

/// Starts, stops and steps the animations; moves them on by the time that has passed.
pub fn advance(
    input: Res<Input>,
    mut clock: ResMut<Clock>,
    playing: Option<ResMut<Playing>>,
    mut notices: ResMut<Notices>,
) {
    advance_until(Instant::now(), &input, &mut clock, playing.map(Into::into), &mut notices);
}

fn advance_until(
    now: Instant,
    input: &Input,
    clock: &mut Clock,
    playing: Option<Mut<Playing>>,
    notices: &mut Notices,
) {
    let taps = [Tap::Play, Tap::StepBack, Tap::StepOn].map(|tap| input.count(tap));
    let asked = taps != [0; 3];
    let Some(mut playing) = playing.filter(|playing| !playing.animations.is_empty()) else {
        if asked {
            notices.0.push(Notice::Text("nothing in this scene is animated".to_owned()));
        }
        // Those that ran may be gone with another version of the file.
        clock.since = None;
        return;
    };
    let [plays, back, on] = taps;
    let before = playing.time.unwrap_or(0.0);
    let passed = clock.since.map_or(0.0, |since| now.saturating_duration_since(since).as_secs_f64());
    let steps = STEP * (on as f64 - back as f64);
    if back + on > 0 {
        clock.since = None;
    } else {
        clock.since = (clock.runs() ^ (plays % 2 == 1)).then_some(now);
    }
    if passed > 0.0 || asked {
        playing.time = Some((before + passed + steps).max(0.0));
    }
    if asked && !clock.runs() {
        notices.0.push(Notice::Text(format!("animation: {:.2} s", playing.time.unwrap_or(0.0))));
    }
}

#[cfg(test)]
mod tests {
    use super::super::input::Press;
    use super::*;
    use std::time::Duration;

    struct Stage(World, Instant);

    impl Stage {
        fn new(animations: usize) -> Self {
            let mut world = World::new();
            let animations = (0..animations).map(|_| world.spawn_empty().id()).collect();
            world.insert_resource(Playing { animations, time: None });
            Self(world, Instant::now())
        }

        /// What is shown after so many milliseconds more and these keys, and whether it runs.
        fn after(&mut self, milliseconds: u64, taps: &[Tap], clock: &mut Clock) -> (Option<f64>, usize) {
            self.1 += Duration::from_millis(milliseconds);
            let mut input = Input::new(self.1);
            input.taps = taps.iter().map(|&tap| Press::from(tap)).collect();
            let mut notices = Notices::default();
            let playing = self.0.get_resource_mut::<Playing>();
            advance_until(self.1, &input, clock, playing, &mut notices);
            (self.0.resource::<Playing>().time, notices.0.len())
        }
    }

    #[test]
    fn it_runs_with_the_time_and_stops_where_it_is() {
        let (mut stage, mut clock) = (Stage::new(1), Clock::default());
        assert_eq!(stage.after(1000, &[], &mut clock), (None, 0), "at rest until asked");
        assert_eq!(stage.after(1000, &[Tap::Play], &mut clock), (Some(0.0), 0));
        assert_eq!(stage.after(250, &[], &mut clock), (Some(0.25), 0));
        assert_eq!(stage.after(500, &[Tap::Play], &mut clock), (Some(0.75), 1));
        assert_eq!(stage.after(500, &[], &mut clock), (Some(0.75), 0));
        assert_eq!(
            stage.after(500, &[Tap::Play, Tap::Play], &mut clock),
            (Some(0.75), 1),
            "twice is nothing"
        );
        assert!(!clock.runs());
    }

    #[test]
    fn steps_are_those_of_films_and_stop_it() {
        let (mut stage, mut clock) = (Stage::new(2), Clock::default());
        assert_eq!(stage.after(0, &[Tap::StepOn, Tap::StepOn], &mut clock), (Some(2.0 * STEP), 1));
        assert_eq!(stage.after(9, &[Tap::StepBack; 3], &mut clock), (Some(0.0), 1), "not before the start");
        stage.after(0, &[Tap::Play], &mut clock);
        assert_eq!(stage.after(500, &[Tap::StepOn], &mut clock), (Some(0.5 + STEP), 1));
        assert!(!clock.runs());
    }

    #[test]
    fn a_scene_in_which_nothing_moves_says_so() {
        let (mut stage, mut clock) = (Stage::new(0), Clock::default());
        assert_eq!(stage.after(0, &[Tap::Play], &mut clock), (None, 1));
        assert!(!clock.runs());
        // Nor does a clock go on that ran before the file was changed.
        let mut clock = Clock { since: Some(stage.1) };
        assert_eq!(stage.after(40, &[], &mut clock), (None, 0));
        assert!(!clock.runs());
    }
}
